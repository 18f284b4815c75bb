"""The text that replaces a region: its lines, its blocks, and how much of it there may be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode.conversion.restart_points import PLACEHOLDER, CutRestarts, RestartMark
from shapegcode.machine import Machine
from shapegcode.program import Program

__all__ = ["EmittedRegion", "NoRoomError", "RegionText", "Room"]


class RegionText:
    """The lines of a region: in parts as they were written, then in the program that was made of them.

    So a text of a million lines stands in memory once.

    Args:
        parts: whole lines each.
    """

    def __init__(self, parts: Sequence[bytes]) -> None:
        self._parts: Sequence[bytes] | None = parts
        self._inside: tuple[Program, int] | None = None
        self._numbers: Sequence[int] = ()
        self.size = sum(map(len, parts))
        """Bytes."""

    def parts(self) -> Sequence[bytes]:
        """The text, in as many parts as it has."""
        if self._inside is not None:
            program, begin = self._inside
            return [program.text_slice(begin, begin + self.size)]
        assert self._parts is not None  # handed over, and not read back
        return self._parts

    def number(self, restarts: Sequence[RestartMark], numbers: Sequence[int]) -> None:
        """Give restart points their N words."""
        if not numbers or numbers == self._numbers:
            return
        parts: list[bytes | bytearray] = list(self.parts())
        begins = np.cumsum([0, *map(len, parts)])
        for mark, number in zip(restarts, numbers, strict=True):
            index = int(np.searchsorted(begins, mark.byte, side="right")) - 1
            if isinstance(parts[index], bytes):
                parts[index] = bytearray(parts[index])
            at = mark.byte - int(begins[index])
            parts[index][at : at + len(PLACEHOLDER)] = f"N{number}".encode()  # type: ignore[index]
        self._parts, self._inside, self._numbers = [bytes(part) for part in parts], None, numbers

    def hand_over(self) -> None:
        """Somebody else has the parts now."""
        self._parts = self._inside = None

    def stands_in(self, program: Program, begin: int) -> None:
        """The text is part of that of a program."""
        self._parts, self._inside = None, (program, begin)

    def joined(self) -> bytes:
        """The text in one."""
        return b"".join(self.parts())


@dataclass(frozen=True)
class EmittedRegion:
    """The text that replaces a region.

    Attributes:
        text: whole lines.
        blocks: shaped blocks in it, without the lines around them.
        block_periods: whole block periods that each of them lasts, of each part that holds blocks.
        block_bytes: likewise the characters of each of them.
        planned_um: deviation of what shall follow the path for which the feed was planned, µm; 0 without a target.
        restarts: blocks of it at which the control can begin.
        is_slowed: it is slower than without a contour tolerance.
        duration_s: of its blocks.
    """

    text: RegionText
    blocks: int
    block_periods: list[npt.NDArray[np.uint32]]
    block_bytes: list[npt.NDArray[np.uint32]]
    planned_um: float
    restarts: CutRestarts
    is_slowed: bool = True
    duration_s: float = 0.0


class NoRoomError(Exception):
    """The shaped text of a region is more than the written program may have."""


@dataclass(frozen=True)
class Room:
    """What the text of a region may have at most.

    Attributes:
        bytes: of text.
        blocks: shaped ones.
        machine: whose keys say so.
    """

    bytes: int
    blocks: int
    machine: Machine

    def require(self, text_bytes: int, blocks: int) -> None:
        """Refuse what is more; called piece by piece, so that no more than a piece is written in vain."""
        controller = self.machine.controller
        if text_bytes > self.bytes:
            limit = f"{controller.max_program_bytes} bytes (controller.max_program_bytes)"
        elif blocks > self.blocks:
            limit = f"{controller.max_program_moves} moves (controller.max_program_moves)"
        else:
            return
        raise NoRoomError(f"its shaped text would take the program over {limit}")
