"""The tables of a conversion: original against emitted, and the sensitivity to unverified parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shapegcode.conversion.rests import RestsOn
from shapegcode.results.table import NO_BREAK, Column, Table
from shapegcode.verdict.tables import unbroken

__all__ = ["BeforeAfter", "before_after_table", "change_percent", "percent", "rests_table"]

# Rounding in sums of increments stays far below this, a least increment far above.
# A percentage of less than this compares rounding with rounding.
_LEAST_COMPARED_UM = 1.0


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
    """Original against emitted, in groups of figures."""
    filled = [group for group in groups if group]
    sections = [sum(len(group) for group in filled[:rank]) for rank in range(1, len(filled))]
    return Table("", _BEFORE_AFTER, [row for group in filled for row in group], sections=sections)


def rests_table(rows: Sequence[RestsOn], tried: int) -> Table:
    """The values that nobody measured on this machine and that the verdict rests on."""
    columns = (
        Column("key", left=True),
        Column("assumed → tested", value=_moved, text=True),
        Column("figure, µm", value=_figure, text=True),
        Column("limit", value="limit_um", digits=1),
    )
    return Table(
        "sensitivity to unverified parameters: assumed values, changed one at a time",
        columns,
        rows,
        caption=f"{tried} values moved, one at a time, in the region that comes nearest to a limit",
        row_style=lambda row: "red" if row.moved_um > row.limit_um else "",
    )


def _moved(row: RestsOn) -> str:
    """What stands in the file, and what was tried instead: four columns of their own do not fit 80 characters."""
    return unbroken(f"{row.value} {row.origin} → {row.moved}")


def _figure(row: RestsOn) -> str:
    """A short name of the figure, and how far it moves."""
    name = row.figure.replace("residual vibration", "residual").replace("contour error", "contour")
    return f"{name.partition(' of ')[0]} " + f"{row.figure_um:.1f} → {row.moved_um:.1f}".replace(" ", NO_BREAK)
