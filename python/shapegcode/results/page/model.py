"""What stands on the page of a result, as data; `html` makes one file of it.

A result's page is made by the module `page` beside it, as its pictures by the module `plots`; a result without one gets
its answer, tables, pictures and next step. Every number comes from the fields that make the JSON, or from the scene.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from shapegcode.results.outcome import Pair, Plot
from shapegcode.results.page.scene import Scene
from shapegcode.results.table import Table

__all__ = [
    "Bars",
    "CutPicker",
    "CutRow",
    "CutTotals",
    "Figure",
    "Figures",
    "HeatMap",
    "HeatRow",
    "Light",
    "NextStep",
    "NextSteps",
    "Notes",
    "Page",
    "Part",
    "Picture",
    "Script",
    "Section",
    "Text",
]

Script = Literal["inline", "beside"]
"""Where the script of a page is: in its file, or in one beside it."""

Light = Literal["green", "calm", "amber", "red"]
"""Run it; leave it as it is, there is nothing to do; do something first; do not run it."""


@dataclass(frozen=True)
class Figure:
    """A figure before and after, beside its limit.

    Attributes:
        name: what it is.
        unit: of the numbers as they are shown.
        before: of the original; None: there is none.
        after: of what was made, or the only one.
        digits: behind the point.
        limit: what `after` is judged by; None: not judged.
        key_before: where the JSON holds it: names and ranks with dots between; empty: nowhere.
        key_after: likewise.
        factor: from the number in the JSON to the one shown.
    """

    name: str
    unit: str
    before: float | None
    after: float
    digits: int = 1
    limit: float | None = None
    key_before: str = ""
    key_after: str = ""
    factor: float = 1.0


@dataclass(frozen=True)
class Figures:
    """Figures as cards: the few that people look at first."""

    rows: tuple[Figure, ...]


@dataclass(frozen=True)
class HeatRow:
    """A line of a heat map.

    Attributes:
        name: of the line.
        values: by column; None: not measured.
        shares: of a limit, which colour the cells: below 1 is within; None: no colour.
        remark: in words, at its end.
        counts: it takes part in the verdict; else it is only shown.
        keys: of the values, where the JSON holds each, as in `Figure`; empty: nowhere.
    """

    name: str
    values: tuple[float | None, ...]
    shares: tuple[float | None, ...]
    remark: str = ""
    counts: bool = True
    keys: tuple[str, ...] = ()


@dataclass(frozen=True)
class HeatMap:
    """Numbers in rows and columns, coloured by their share of a limit.

    Attributes:
        columns: headings, with units.
        rows: from top to bottom.
        digits: behind the point.
        caption: below it.
        factors: of the columns, from the numbers in the JSON to those shown; empty: 1.
    """

    columns: tuple[str, ...]
    rows: tuple[HeatRow, ...]
    digits: int = 2
    caption: str = ""
    factors: tuple[float, ...] = ()


@dataclass(frozen=True)
class Bars:
    """Parts of a whole, as bars, such as where the time goes.

    Attributes:
        unit: of the values.
        rows: name and values, one value for each label.
        labels: what the values of a row are, for example "original" and "emitted".
        digits: behind the point.
        keys: of each row's values, where the JSON holds each, as in `Figure`; empty: nowhere.
    """

    unit: str
    rows: tuple[tuple[str, tuple[float, ...]], ...]
    labels: tuple[str, ...] = ("",)
    digits: int = 1
    keys: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class Notes:
    """Topics with a sentence each, such as an operator's run sheet; `strong` ones stand out."""

    rows: tuple[tuple[str, str], ...]
    strong: frozenset[str] = frozenset()


@dataclass(frozen=True)
class NextStep:
    """One thing to do.

    Attributes:
        text: in words.
        command: to type; empty: none.
    """

    text: str
    command: str = ""


@dataclass(frozen=True)
class NextSteps:
    """Things to do, in their order."""

    rows: tuple[NextStep, ...]


@dataclass(frozen=True)
class Picture:
    """A drawing of the house, as SVG.

    Attributes:
        name: of the drawing, as --plots names its file.
        plot: draws it.
        how: one line: how to read it.
    """

    name: str
    plot: Plot
    how: str


@dataclass(frozen=True)
class Text:
    """Paragraphs; `warning` ones stand out."""

    paragraphs: tuple[str, ...]
    warning: bool = False


@dataclass(frozen=True)
class CutRow:
    """A cut that may be shaped or left unchanged.

    Attributes:
        lines: of the original program, first and last.
        tool: that cuts, for example "T3"; empty: not known.
        gain_um: what shaping gains; None: not tried.
        residual_um: maximum residual vibration, original and shaped; None: not simulated.
        contour_um: maximum contour error, likewise.
        time_s: until the set-points rest, likewise.
        bytes: of its program text, likewise.
        outcome: "shaped", or why not.
        is_shaped: it is shaped in the emitted program: these are printed.
        selected: it is ticked when the page opens.
        can_be_shaped: False: it has no box to tick.
    """

    lines: tuple[int, int]
    tool: str
    gain_um: float | None
    residual_um: Pair[float | None]
    contour_um: Pair[float | None]
    time_s: Pair[float | None]
    bytes: Pair[int | None]
    outcome: str
    is_shaped: bool
    selected: bool
    can_be_shaped: bool = True


@dataclass(frozen=True)
class CutTotals:
    """What the sums over the ticked cuts start from, and what they are judged by.

    Attributes:
        time_s: cycle time of the original program.
        bytes: size of the original program.
        residual_limit_um: of the maximum residual vibration; None: not judged.
        contour_limit_um: of the maximum contour error; None: not judged.
    """

    time_s: float
    bytes: int
    residual_limit_um: float | None = None
    contour_limit_um: float | None = None


@dataclass(frozen=True)
class CutPicker:
    """A table of cuts to sort and to tick; what the ticked ones cost and gain, and the command that shapes only them.

    Attributes:
        rows: of the table, in the order of the program.
        command: to type, with `{lines}` where the lines of the ticked cuts stand, such as `12-80,95-240`.
        totals: of the original program.
    """

    rows: tuple[CutRow, ...]
    command: str
    totals: CutTotals


Part = Figures | HeatMap | Bars | Notes | NextSteps | Picture | Text | Table | CutPicker


@dataclass(frozen=True)
class Section:
    """A part of the page with a heading.

    Attributes:
        key: its anchor: small letters and hyphens, unique on the page.
        title: heading.
        parts: below it, in order.
        how: one line below the heading: how to read this.
        printed: it is on paper, too.
        sheet: it is a page of its own on paper, such as the run sheet.
        folded: closed until somebody opens it.
    """

    key: str
    title: str
    parts: tuple[Part, ...]
    how: str = ""
    printed: bool = True
    sheet: bool = False
    folded: bool = False


@dataclass(frozen=True)
class Page:
    """A result as a page.

    Attributes:
        title: what was done with what.
        light: whether to go on.
        verdict: the answer in one sentence.
        reason: why the light has this colour.
        sections: from top to bottom; the scene stands behind the first `before_scene` of them.
        report: the JSON of the result, with `made` where its files are known.
        scene: motion to look at; None: there is none.
        before_scene: how many sections stand above the scene.
        problems: what is not as it should be with the page itself, such as a program that was changed since.
    """

    title: str
    light: Light
    verdict: str
    reason: str
    sections: tuple[Section, ...]
    report: Mapping[str, Any]
    scene: Scene | None = None
    before_scene: int = 1
    problems: Sequence[str] = field(default=())
