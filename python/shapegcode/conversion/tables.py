"""The tables of a conversion: original against emitted, and the cases of the verdict."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from shapegcode.conversion.rests import RestsOn
from shapegcode.results.table import NO_BREAK, Column, Table
from shapegcode.verdict.figures import CaseVerdict

__all__ = ["BeforeAfter", "before_after_table", "case_table", "change_percent", "percent", "rests_table"]

# Rounding in sums of increments stays far below this, a least increment far above.
# A percentage of less than this compares rounding with rounding.
_LEAST_COMPARED_UM = 1.0
_NUMBER = re.compile(r"(\d) (%|ms\b|s\b|mm\b|Hz\b|µm\b)")
_SWINGS_UM = 0.005  # an axis that nowhere reaches this has no column


def change_percent(original: float, emitted: float) -> float:
    """Change from original to emitted; the original is not zero."""
    return (emitted - original) / abs(original) * 100


def percent(change: float) -> str:
    """A change in words."""
    return "0 %" if abs(change) < 0.05 else f"{change:+.1f} %"


@dataclass(frozen=True)
class BeforeAfter:
    """One line of the table: a figure of both programs, or of the emitted one alone.

    Attributes:
        figure: what it is.
        unit: its unit.
        original: figure of the original program; None where there is none.
        emitted: figure of the emitted program.
        digits: behind the point.
        limit: what the emitted figure is judged by; None where it is not judged.
    """

    figure: str
    unit: str
    original: float | None
    emitted: float
    digits: int = 1
    limit: float | None = None

    @property
    def change(self) -> str:
        """From original to emitted; empty without an original, and where it is too small to compare with."""
        least = _LEAST_COMPARED_UM if self.unit == "µm" else 0.5 * 10.0**-self.digits
        if self.original is None or abs(self.original) < least:
            return ""
        return percent(change_percent(self.original, self.emitted))

    def text(self, value: float | None) -> str:
        """One of its figures with its digits."""
        return "" if value is None else f"{float(value):z.{self.digits}f}"


_BEFORE_AFTER = (
    Column("figure", text=True),
    Column("unit", text=True),
    Column("original", value=lambda row: row.text(row.original)),
    Column("emitted", value=lambda row: row.text(row.emitted)),
    Column("change"),
    Column("limit", value=lambda row: row.text(row.limit)),
)


def before_after_table(groups: Sequence[Sequence[BeforeAfter]]) -> Table:
    """Original against emitted, in groups of figures.

    Args:
        groups: from top to bottom; a line stands between them.

    Returns:
        The table.
    """
    filled = [group for group in groups if group]
    sections = [sum(len(group) for group in filled[:rank]) for rank in range(1, len(filled))]
    return Table("", _BEFORE_AFTER, [row for group in filled for row in group], sections=sections)


def case_table(cases: Sequence[CaseVerdict], worst: CaseVerdict | None) -> Table:
    """What every case leaves, whether it counts, and which one decides.

    Args:
        cases: as played.
        worst: the one that decides; None: no case counts.

    Returns:
        The table.
    """
    columns = (
        Column("case", value=lambda case: _unbroken(case.name), text=True),
        *(
            Column(axis.upper(), value=f"residual_um.{axis}", digits=2)
            for axis in "xyz"
            if any(case.residual_um[axis] >= _SWINGS_UM for case in cases)
        ),
        Column("command", value=lambda case: _micrometres(case.contour_error_um.command)),
        Column("table", value=lambda case: _micrometres(case.contour_error_um.response)),
        Column("s", value="time_s", digits=2),
        Column("of limit", value=lambda case: _share(case.share_of_limit)),
        Column("verdict", value=lambda case: _verdict(case) + (" <- worst" if case is worst else ""), left=True),
    )
    shown = sum(not case.counts for case in cases)
    brackets = "; those in brackets are only shown" if shown else ""
    return Table(
        "cases of the verdict: residual X Y Z, contour error of command and table, µm",
        columns,
        cases,
        caption=f"{len(cases) - shown} of {len(cases)} cases count{brackets} ([verdict])",
        row_style=lambda case: _style(case, case is worst),
    )


def rests_table(rows: Sequence[RestsOn], tried: int) -> Table:
    """The values that nobody measured on this machine and that the verdict rests on.

    Args:
        rows: those that move it furthest first.
        tried: how many values were moved.

    Returns:
        The table.
    """
    columns = (
        Column("key", left=True),
        Column("value → if it were", value=_moved, text=True),
        Column("figure, µm", value=_figure, text=True),
        Column("limit", value="limit_um", digits=1),
    )
    return Table(
        "what the verdict rests on: values that nobody measured on this machine",
        columns,
        rows,
        caption=f"{tried} values moved, one at a time, in the region that comes nearest to a limit",
        row_style=lambda row: "red" if row.moved_um > row.limit_um else "",
    )


def _moved(row: RestsOn) -> str:
    """What stands in the file, and what was tried instead: four columns of their own do not fit 80 characters."""
    return _unbroken(f"{row.value} {row.origin} → {row.moved}")


def _figure(row: RestsOn) -> str:
    """A short name of the figure, and how far it moves."""
    name = row.figure.replace("residual vibration", "residual").replace("contour error", "contour")
    return f"{name.partition(' of ')[0]} " + f"{row.figure_um:.1f} → {row.moved_um:.1f}".replace(" ", NO_BREAK)


def _unbroken(text: str) -> str:
    """A number stays on the line of its unit."""
    return _NUMBER.sub(rf"\1{NO_BREAK}\2", text)


def _micrometres(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"


def _share(share: float | None) -> str:
    """Of the limit in percent; a limit of zero leaves no share."""
    return "no limit but 0" if share is None else f"{share * 100:.0f} %"


def _verdict(case: CaseVerdict) -> str:
    word = "within" if case.within else "OUT"
    return word if case.counts else f"({word.lower()})"


def _style(case: CaseVerdict, worst: bool) -> str:
    if not case.counts:
        return "dim"
    colour = "" if case.within else "red"
    return f"bold {colour}".strip() if worst else colour
