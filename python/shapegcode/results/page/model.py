"""Contents of the page of a result, as data; `html` makes one file of it.

The module `page` beside a result makes its page; every number comes from the fields of the JSON, or from the scene.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from shapegcode.results.outcome import Pair, Plot
from shapegcode.results.table import Table

if TYPE_CHECKING:
    from shapegcode.results.page.scene import Scene

Script = Literal["inline", "beside"]  # where the script of a page is: in its file, or in one beside it

Light = Literal["green", "calm", "amber", "red"]
"""Run it; leave it as it is, there is nothing to do; do something first; do not run it."""


@dataclass(frozen=True)
class Figure:
    """A figure before and after, beside its limit."""

    name: str  # what it is
    unit: str  # of the numbers as they are shown
    before: float | None  # of the original; None: there is none
    after: float  # of what was made, or the only one
    digits: int = 1  # behind the point
    limit: float | None = None  # what `after` is judged by; None: not judged
    key_before: str = ""  # where the JSON holds it: names and ranks with dots between; empty: nowhere
    key_after: str = ""
    factor: float = 1.0  # from the number in the JSON to the one shown


@dataclass(frozen=True)
class Figures:
    """Figures as cards: the few that people look at first."""

    rows: tuple[Figure, ...]


@dataclass(frozen=True)
class HeatRow:
    """A line of a heat map."""

    name: str  # of the line
    values: tuple[float | None, ...]  # by column; None: not measured
    shares: tuple[float | None, ...]  # of a limit, which colour the cells: below 1 is within; None: no colour
    remark: str = ""  # in words, at its end
    counts: bool = True  # it takes part in the verdict; else it is only shown
    keys: tuple[str, ...] = ()  # of the values, where the JSON holds each, as in `Figure`; empty: nowhere


@dataclass(frozen=True)
class HeatMap:
    """Numbers in rows and columns, coloured by their share of a limit."""

    columns: tuple[str, ...]  # headings, with units
    rows: tuple[HeatRow, ...]  # from top to bottom
    digits: int = 2  # behind the point
    caption: str = ""  # below it
    factors: tuple[float, ...] = ()  # of the columns, from the numbers in the JSON to those shown; empty: 1


@dataclass(frozen=True)
class Bars:
    """Parts of a whole, as bars, such as where the time goes."""

    unit: str  # of the values
    rows: tuple[tuple[str, tuple[float, ...]], ...]  # name and values, one value for each label
    labels: tuple[str, ...] = ("",)  # what the values of a row are, for example "original" and "emitted"
    digits: int = 1  # behind the point
    # of each row's values, where the JSON holds each, as in `Figure`; empty: nowhere
    keys: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class Notes:
    """Topics with a sentence each, such as an operator's run sheet; `strong` ones stand out."""

    rows: tuple[tuple[str, str], ...]
    strong: frozenset[str] = frozenset()


@dataclass(frozen=True)
class NextStep:
    """One thing to do."""

    text: str  # in words
    command: str = ""  # to type; empty: none


@dataclass(frozen=True)
class NextSteps:
    """Things to do, in their order."""

    rows: tuple[NextStep, ...]


@dataclass(frozen=True)
class Picture:
    """A drawing of the house, as SVG."""

    name: str  # of the drawing, as --plots names its file
    plot: Plot  # draws it
    how: str  # one line: how to read it


@dataclass(frozen=True)
class Text:
    """Paragraphs; `warning` ones stand out."""

    paragraphs: tuple[str, ...]
    warning: bool = False


@dataclass(frozen=True)
class CutRow:
    """A cut that may be shaped or left unchanged."""

    lines: tuple[int, int]  # of the original program, first and last
    tool: str  # that cuts, for example "T3"; empty: not known
    gain_um: float | None  # what shaping gains; None: not tried
    residual_um: Pair[float | None]  # maximum residual vibration, original and shaped; None: not simulated
    contour_um: Pair[float | None]  # maximum contour error, likewise
    time_s: Pair[float | None]  # until the set-points rest, likewise
    bytes: Pair[int | None]  # of its program text, likewise
    outcome: str  # "shaped", or why not
    is_shaped: bool  # it is shaped in the emitted program: these are printed
    selected: bool  # it is ticked when the page opens
    can_be_shaped: bool = True  # False: it has no box to tick


@dataclass(frozen=True)
class CutTotals:
    """What the sums over the ticked cuts start from, and what they are judged by."""

    time_s: float  # cycle time of the original program
    bytes: int  # size of the original program
    residual_limit_um: float | None = None  # of the maximum residual vibration; None: not judged
    contour_limit_um: float | None = None  # of the maximum contour error; None: not judged


@dataclass(frozen=True)
class CutPicker:
    """A table of cuts to sort and to select; cost and gain of the selected ones, and the command that shapes only
    them."""

    rows: tuple[CutRow, ...]  # of the table, in the order of the program
    command: str  # to type, with `{lines}` where the lines of the ticked cuts stand, such as `12-80,95-240`
    totals: CutTotals  # of the original program


Part = Figures | HeatMap | Bars | Notes | NextSteps | Picture | Text | Table | CutPicker


@dataclass(frozen=True)
class Section:
    """A part of the page with a heading."""

    key: str  # its anchor: small letters and hyphens, unique on the page
    title: str  # heading
    parts: tuple[Part, ...]  # below it, in order
    how: str = ""  # one line below the heading: how to read this
    printed: bool = True  # it is on paper, too
    sheet: bool = False  # it is a page of its own on paper, such as the run sheet
    folded: bool = False  # closed until somebody opens it


@dataclass(frozen=True)
class Page:
    """A result as a page."""

    title: str  # what was done with what
    light: Light  # whether to go on
    verdict: str  # the answer in one sentence
    reason: str  # why the light has this colour
    sections: tuple[Section, ...]  # from top to bottom; the scene stands behind the first `before_scene` of them
    report: Mapping[str, Any]  # the JSON of the result, with `provenance` where its files are known
    scene: Scene | None = None  # motion to look at; None: there is none
    before_scene: int = 1  # how many sections stand above the scene
    # what is not as it should be with the page itself, such as a program that was changed since
    problems: Sequence[str] = field(default=())
