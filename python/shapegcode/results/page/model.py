"""Content of the page of a result, as data; `html` converts it to one file.

The module `page` in a result's folder makes its page; numbers come from the fields of the JSON, or from the scene.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from shapegcode.results.outcome import Pair, Plot
from shapegcode.results.table import Table

if TYPE_CHECKING:
    from shapegcode.results.page.scene import Scene

Script = Literal["inline", "beside"]  # script of a page: in its file, or in a file of the same folder

Light = Literal["green", "calm", "amber", "red"]
"""Run it; nothing to do; do something first; do not run it."""


@dataclass(frozen=True)
class Figure:
    """A figure before and after, with its limit."""

    name: str  # its name
    unit: str  # unit of the numbers shown
    before: float | None  # figure of the original; None: none
    after: float  # figure of the result, or the only one
    digits: int = 1  # decimals
    limit: float | None = None  # limit of `after`; None: not judged
    key_before: str = ""  # its position in the JSON: names and indices joined by dots; empty: none
    key_after: str = ""
    factor: float = 1.0  # ratio of the number shown to the one in the JSON


@dataclass(frozen=True)
class Figures:
    """Figures as cards: the few main ones."""

    rows: tuple[Figure, ...]


@dataclass(frozen=True)
class HeatRow:
    """A line of a heat map."""

    name: str  # heading of the line
    values: tuple[float | None, ...]  # by column; None: not measured
    shares: tuple[float | None, ...]  # ratios to a limit, for the colours: below 1 is within; None: no colour
    remark: str = ""  # text at its end
    counts: bool = True  # it counts in the verdict; False: it is only shown
    keys: tuple[str, ...] = ()  # position of each value in the JSON, as in `Figure`; empty: none


@dataclass(frozen=True)
class HeatMap:
    """Numbers in rows and columns, coloured by their ratio to a limit."""

    columns: tuple[str, ...]  # headings, with units
    rows: tuple[HeatRow, ...]  # from top to bottom
    digits: int = 2  # decimals
    caption: str = ""  # text below the map
    factors: tuple[float, ...] = ()  # by column, ratio of the numbers shown to those in the JSON; empty: 1


@dataclass(frozen=True)
class Bars:
    """Parts of a whole as bars, such as time components."""

    unit: str  # unit of the values
    rows: tuple[tuple[str, tuple[float, ...]], ...]  # name and values, one value for each label
    labels: tuple[str, ...] = ("",)  # names of the values of a row, for example "original" and "emitted"
    digits: int = 1  # decimals
    # position of each value in the JSON by row, as in `Figure`; empty: none
    keys: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class Notes:
    """Topics with a sentence each, such as an operator's run sheet; `strong` ones are highlighted."""

    rows: tuple[tuple[str, str], ...]
    strong: frozenset[str] = frozenset()


@dataclass(frozen=True)
class NextStep:
    """One step."""

    text: str  # the sentence
    command: str = ""  # command to type; empty: none


@dataclass(frozen=True)
class NextSteps:
    """Steps in their order."""

    rows: tuple[NextStep, ...]


@dataclass(frozen=True)
class Picture:
    """A matplotlib picture, as SVG."""

    name: str  # name of the picture, as in the file of --plots
    plot: Plot  # draws it
    how: str  # one line: how to read it


@dataclass(frozen=True)
class Text:
    """Paragraphs; `warning` ones are highlighted."""

    paragraphs: tuple[str, ...]
    warning: bool = False


@dataclass(frozen=True)
class CutRow:
    """A cut that may be shaped or left unchanged."""

    lines: tuple[int, int]  # first and last line of the original program
    tool: str  # tool, for example "T3"; empty: unknown
    gain_um: float | None  # gain of shaping; None: not tried
    residual_um: Pair[float | None]  # maximum residual vibration, original and shaped; None: not simulated
    contour_um: Pair[float | None]  # maximum contour error, likewise
    time_s: Pair[float | None]  # until the set-points rest, likewise
    bytes: Pair[int | None]  # size of its program text, likewise
    outcome: str  # "shaped", or why not
    is_shaped: bool  # it is shaped in the emitted program: these are printed
    selected: bool  # ticked when the page opens
    can_be_shaped: bool = True  # False: it has no check box


@dataclass(frozen=True)
class CutTotals:
    """Initial values and limits of the totals over the ticked cuts."""

    time_s: float  # cycle time of the original program
    bytes: int  # size of the original program
    residual_limit_um: float | None = None  # limit of the maximum residual vibration; None: not judged
    contour_limit_um: float | None = None  # limit of the maximum contour error; None: not judged


@dataclass(frozen=True)
class CutPicker:
    """A table of cuts to sort and to select; cost and gain of the selected ones, and the command that shapes only
    them."""

    rows: tuple[CutRow, ...]  # rows of the table, in program order
    command: str  # to type; `{lines}` is replaced by the lines of the ticked cuts, such as `12-80,95-240`
    totals: CutTotals  # totals of the original program


Part = Figures | HeatMap | Bars | Notes | NextSteps | Picture | Text | Table | CutPicker


@dataclass(frozen=True)
class Section:
    """A part of the page with a heading."""

    key: str  # its anchor: small letters and hyphens, unique on the page
    title: str  # heading
    parts: tuple[Part, ...]  # below it, in order
    how: str = ""  # explanation, one line below the heading
    printed: bool = True  # printed on paper, too
    sheet: bool = False  # a separate page on paper, such as the run sheet
    folded: bool = False  # closed until it is opened


@dataclass(frozen=True)
class Page:
    """A result as a page."""

    title: str  # kind of result and program
    light: Light  # traffic light
    verdict: str  # the answer in one sentence
    reason: str  # why the light has this colour
    sections: tuple[Section, ...]  # from top to bottom; the scene comes after the first `before_scene` of them
    report: Mapping[str, Any]  # the JSON of the result, with `provenance` if its files are known
    scene: Scene | None = None  # the motion; None: none
    before_scene: int = 1  # number of sections above the scene
    # problems of the page itself, such as a program that was changed since
    problems: Sequence[str] = field(default=())
