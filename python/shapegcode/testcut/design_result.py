"""A test cut as it was drawn up: what its side file holds, and what its program needs beyond that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from shapegcode.machine import Machine
from shapegcode.results.json import hidden
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table
from shapegcode.testcut.cut import TestCut
from shapegcode.testcut.edges import Edge

__all__ = ["CutDesign"]


@dataclass(frozen=True, repr=False, eq=False)
class CutDesign(Result):
    """A test cut as it was drawn up.

    Attributes:
        cut: what the side file holds.
        files: program and side file, where they are written.
        warnings: what is not as the user might think.
        edge: to be milled before each pass.
        stock_mm: length of the stock along X.
        machine: whose controller runs the program.
    """

    cut: TestCut
    files: tuple[str, ...]
    warnings: tuple[str, ...]
    edge: Edge = field(metadata=hidden())
    stock_mm: float = field(metadata=hidden())
    machine: Machine = field(metadata=hidden())

    @property
    def ok(self) -> bool:
        """It can be cut."""
        return True

    @property
    def answer(self) -> str:
        """What is cut."""
        cut = self.cut
        seconds = sum(each.duration_s for each in cut.passes)
        return f"{cut.kind} for {cut.machine}: {len(cut.passes)} measuring passes, {seconds:.0f} s of cutting in them"

    @property
    def next_step(self) -> str:
        """To cut, and to fit the records."""
        files = " ".join(f"pass{number}.csv" for number in range(1, len(self.cut.passes) + 1))
        side = self.files[1] if self.files else "its side file"
        return f"run it, then shapegcode testcut fit {files} --cut {side}"

    def tables(self) -> list[Table]:
        """One row for each pass."""
        columns = (
            Column("pass", value=lambda row: row[0]),
            Column("what", value=lambda row: row[1].name.lower(), text=True),
            Column("radial depth", "mm", lambda row: _range(row[1].edge_height_mm, 2, 5e-3)),
            Column("feed", "mm/min", lambda row: _range([feed for _, feed in row[1].feeds])),
            Column("blocks", value=lambda row: len(row[1].feeds)),
            Column("s", value=lambda row: row[1].duration_s, digits=1),
        )
        return [Table("", columns, list(enumerate(self.cut.passes, start=1)))]


def _range(values: Sequence[float], digits: int | None = None, same: float = 0.0) -> str:
    low, high = (f"{value:g}" if digits is None else f"{value:.{digits}f}" for value in (min(values), max(values)))
    return low if max(values) - min(values) <= same else f"{low} ... {high}"
