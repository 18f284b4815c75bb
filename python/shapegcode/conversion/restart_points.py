"""Restart points of a program: their N numbers, and what is in force at each of them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from shapegcode import _core
from shapegcode.program import Program
from shapegcode.verdict.placed import Placed

__all__ = [
    "EXTRA_SYSTEM",
    "PLACEHOLDER",
    "CutRestarts",
    "FreeNumbers",
    "RestartMark",
    "RestartPoint",
    "restart_points",
    "system_of",
]

EXTRA_SYSTEM = 541
"""G54.1 as the core counts it."""

PLACEHOLDER = "N00000"
"""N word of a restart point before the program that it stands in is put together."""

_FIRST_NUMBER, _END_NUMBER = 10_000, 100_000  # five digits, as `PLACEHOLDER`
_ROUND = 1000
_CHUNK = 1 << 20  # bytes
_N_WORD = re.compile(rb"N *0*([0-9]{1,8})")
_COMMENT = re.compile(rb"\([^()\r\n]*\)")
_TOOL, _CHANGE = re.compile(rb"T *([0-9]+)"), re.compile(rb"M *0*6(?![0-9])")


@dataclass(frozen=True)
class RestartMark:
    """A restart point in the text of a region.

    Attributes:
        byte: of its N word, from the begin of the text.
        line: of it, 0 for the first one of the text.
        time_s: from the begin of the shaped blocks.
        position_mm: where its block begins.
        speed_mm_per_s: of the shaped command there.
        vibration_um: amplitude that a start from rest leaves there, in the slowest mode of each axis.
        number: N; 0 before the program is put together.
    """

    byte: int
    line: int
    time_s: float
    position_mm: tuple[float, float, float]
    speed_mm_per_s: float
    vibration_um: float
    number: int = 0


@dataclass(frozen=True)
class CutRestarts:
    """Restart points of a region, and what there is to say about them.

    Attributes:
        marks: in their order.
        longest_s: longest time without one.
        reason: why there can be none; empty: there can.
        stops: how many of them are stops that were put in for them.
        stops_s: what these add to the cutting time.
    """

    marks: tuple[RestartMark, ...] = ()
    longest_s: float = 0.0
    reason: str = ""
    stops: int = 0
    stops_s: float = 0.0


@dataclass(frozen=True)
class RestartPoint:
    """A block inside of a shaped cut at which the control can begin, and what is in force there.

    Attributes:
        number: its N word.
        line: of the emitted program, from 1.
        lines: of the cut in the original, first and last.
        time_s: from the begin of the cut.
        position_mm: where the tool has to be before the start, in the coordinate system.
        speed_mm_per_s: of the shaped command there.
        vibration_um: amplitude that a start from rest leaves there.
        coordinate_system: such as "G54" or "G54.1P3".
        tool: T number in the spindle; null: no tool change before the cut.
        length_offset: H number in force; null: none.
        spindle_rev_per_min: in force; null: none programmed.
    """

    number: int
    line: int
    lines: tuple[int, int]
    time_s: float
    position_mm: tuple[float, float, float]
    speed_mm_per_s: float
    vibration_um: float
    coordinate_system: str
    tool: int | None = None
    length_offset: int | None = None
    spindle_rev_per_min: float | None = None


class FreeNumbers:
    """N numbers for restart points that a program does not use itself.

    Args:
        program: the original; its N words are looked for when the first number is asked for.
    """

    def __init__(self, program: Program) -> None:
        self._program = program
        self._free: list[int] | None = None

    def first(self, count: int) -> list[int]:
        """So many of them, always the same, ascending where there is room."""
        if self._free is None:
            self._free = self._found()
        if count > len(self._free):
            raise _core.ProgramError(
                f"{self._program.source}:1:1: {count} restart points, but only {len(self._free)} N numbers from "
                f"{_FIRST_NUMBER} to {_END_NUMBER - 1} are free: raise emission.restart_interval_s"
            )
        return self._free[:count]

    def _found(self) -> list[int]:
        used = np.zeros(_END_NUMBER, dtype=bool)
        core = self._program.core
        end = 0
        while end < core.size:
            begin, end = end, 1 + core.find(b"\n", end + _CHUNK) or core.size
            numbers = np.array(_N_WORD.findall(core.slice(begin, end).upper()), dtype="S8").astype(np.int64)
            used[numbers[numbers < _END_NUMBER]] = True
        last = int(np.flatnonzero(used)[-1]) if used.any() else 0
        begin = max(_FIRST_NUMBER, math.ceil((last + 1) / _ROUND) * _ROUND)
        free = np.flatnonzero(~used)
        return [*map(int, free[free >= begin]), *map(int, free[(free >= _FIRST_NUMBER) & (free < begin)])]


def system_of(state: _core.ModalState) -> str:
    """The coordinate system in force, as it is programmed."""
    extra = state.coordinate_system == EXTRA_SYSTEM
    return f"G54.1P{state.coordinate_number}" if extra else f"G{state.coordinate_system}"


def restart_points(program: Program, places: Iterable[tuple[Placed, CutRestarts]]) -> tuple[RestartPoint, ...]:
    """The restart points of a program, with what is in force at each."""
    tools = _Tools(program)
    return tuple(
        RestartPoint(
            number=mark.number,
            line=place.first_line + mark.line,
            lines=place.original_lines,
            time_s=mark.time_s,
            position_mm=mark.position_mm,
            speed_mm_per_s=mark.speed_mm_per_s,
            vibration_um=mark.vibration_um,
            coordinate_system=system_of(place.region.entry),
            tool=tools.before(place.region),
            length_offset=place.region.entry.length_number if place.region.entry.length_offset != 49 else None,
            spindle_rev_per_min=place.region.entry.spindle_rev_per_min or None,
        )
        for place, restarts in places
        for mark in restarts.marks
    )


class _Tools:
    """The tool in the spindle, region by region; only regions with restart points ask."""

    def __init__(self, program: Program) -> None:
        self._core, self._at = program.core, 0
        self._staged: int | None = None
        self._tool: int | None = None

    def before(self, region: _core.Region) -> int | None:
        """T number of the last tool change before a region; regions are asked for in their order."""
        text = _COMMENT.sub(b"", self._core.slice(self._at, region.text_begin)).upper()
        self._at = max(self._at, region.text_begin)
        for line in text.splitlines() if b"T" in text or b"M" in text else ():
            if word := _TOOL.search(line):
                self._staged = int(word[1])
            if _CHANGE.search(line):
                self._tool = self._staged
        return self._tool
