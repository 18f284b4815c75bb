"""A cut of the original program and its blocks in the emitted one."""

from __future__ import annotations

from dataclasses import dataclass

from shapegcode import _core
from shapegcode.program import Program

__all__ = ["Placed"]


@dataclass(frozen=True)
class Placed:
    """A region and where its shaped blocks stand in the emitted text.

    Attributes:
        region: of the original program.
        first_line: first emitted line, from 1.
        last_line: last emitted line.
        path: the shaped blocks; None: those of these lines.
    """

    region: _core.Region
    first_line: int
    last_line: int
    path: _core.Path | None = None

    @property
    def original_lines(self) -> tuple[int, int]:
        """First and last line of the region in the original program."""
        return self.region.first_line, self.region.last_line

    def blocks(self, emitted: Program) -> _core.Path:
        """The shaped blocks as they were read back."""
        if self.path is not None:
            return self.path
        return emitted.core.cutting_path(self.first_line, self.last_line)
