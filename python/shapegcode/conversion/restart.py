"""Restart points inside long cuts: full modal blocks where the shaped command is slow.

A start from rest lacks the table's speed and deflection at that block, which excites the slowest mode.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.model.modes import slowest_excited_hz
from shapegcode.program import Program, between_increments, decimal
from shapegcode.program.stamp import whole_lines
from shapegcode.verdict.figures import Placed

EXTRA_SYSTEM = 541  # G54.1 as the core counts it
PLACEHOLDER = "N00000"  # N word of a restart point before the program is assembled
FIRST_NUMBER, END_NUMBER = 10_000, 100_000  # five digits, as `PLACEHOLDER`
_ROUND = 1000
_N_WORD = re.compile(rb"N *0*([0-9]{1,8})")


@dataclass(frozen=True)
class RestartMark:
    """A restart point in the text of a region."""

    byte: int  # offset of its N word in the text
    line: int  # its line, 0 for the first one of the text
    time_s: float  # from the start of the shaped blocks
    position_mm: tuple[float, float, float]  # start of its block
    speed_mm_per_s: float  # of the shaped command there
    vibration_um: float  # amplitude excited by a start from rest, in the slowest mode of each axis
    number: int = 0  # N; 0 before the program is assembled


@dataclass(frozen=True)
class CutRestarts:
    """Restart points of a region, or why there can be none."""

    marks: tuple[RestartMark, ...] = ()  # in their order
    longest_s: float = 0.0  # longest time without one
    reason: str = ""  # why there can be none; empty if there can
    stops: int = 0  # number of points that are added stops
    stops_s: float = 0.0  # added cutting time of these


@dataclass(frozen=True)
class RestartPoint:
    """A block inside a shaped cut at which the control can start, with the modal state there."""

    number: int  # its N word
    line: int  # of the emitted program, from 1
    lines: tuple[int, int]  # first and last line of the cut in the original
    time_s: float  # from the start of the cut
    position_mm: tuple[float, float, float]  # required tool position before the start, in the coordinate system
    speed_mm_per_s: float  # of the shaped command there
    vibration_um: float  # amplitude excited by a start from rest
    coordinate_system: str  # such as "G54" or "G54.1P3"
    tool: int | None = None  # T number in the spindle; null: none programmed before
    length_offset: int | None = None  # H number in force; null: none
    spindle_rev_per_min: float | None = None  # in force; null: none programmed


def free_numbers(program: Program) -> list[int]:
    """N numbers for restart points that a program does not use, reproducible and, if possible, ascending."""
    used = np.zeros(END_NUMBER, dtype=bool)
    for lines in whole_lines(program.core):
        numbers = np.array(_N_WORD.findall(lines.upper()), dtype="S8").astype(np.int64)
        used[numbers[numbers < END_NUMBER]] = True
    last = int(np.flatnonzero(used)[-1]) if used.any() else 0
    begin = max(FIRST_NUMBER, math.ceil((last + 1) / _ROUND) * _ROUND)
    free = np.flatnonzero(~used)
    return [*map(int, free[free >= begin]), *map(int, free[(free >= FIRST_NUMBER) & (free < begin)])]


def system_of(state: _core.ModalState) -> str:
    """The active coordinate system as programmed, such as "G54"."""
    extra = state.coordinate_system == EXTRA_SYSTEM
    return f"G54.1P{state.coordinate_number}" if extra else f"G{state.coordinate_system}"


def restart_points(
    program: Program, cuts: Iterable[tuple[Placed, CutRestarts, int | None]]
) -> tuple[RestartPoint, ...]:
    """The restart points of a program with their modal states. *cuts*: region, its restart points, T number."""
    return tuple(
        RestartPoint(
            number=mark.number,
            line=place.first_line + mark.line,
            lines=program.source_lines(*place.original_lines),
            time_s=mark.time_s,
            position_mm=mark.position_mm,
            speed_mm_per_s=mark.speed_mm_per_s,
            vibration_um=mark.vibration_um,
            coordinate_system=system_of(place.region.entry),
            tool=tool,
            length_offset=place.region.entry.length_number if place.region.entry.length_offset != 49 else None,
            spindle_rev_per_min=place.region.entry.spindle_rev_per_min or None,
        )
        for place, restarts, tool in cuts
        for mark in restarts.marks
    )


IntArray = npt.NDArray[np.int64]

_SLOW_RATIO = 0.2  # of the programmed feed
_APART = 0.1  # of the interval: smallest useful distance to another point or to an end of the cut
_MOTION, _PLANE, _FEED = map(re.compile, (rb"G0([123])(?![0-9])", rb"G(1[789])(?![0-9])", rb"F[0-9.]+"))


class RestartPlaces:
    """Chooses restart points of one region while its shaped command is generated."""

    def __init__(self, region: _core.Region, machine: Machine, period_s: float) -> None:
        self._period_s = period_s
        self._interval = machine.emission.restart_interval_s / period_s
        self._fastest_mm_per_s = _SLOW_RATIO * region.path.fastest_feed_mm_per_s
        self._floor_mm = machine.tolerance.residual_floor_um * 1e-3
        self._tolerance_mm = machine.tolerance.contour_um * 1e-3
        self._omega = 2.0 * math.pi * np.array(slowest_excited_hz(machine))
        self.last = 0  # period of the last point
        self.longest = 0  # largest number of periods between two of them
        self.reason = _why_none(region)  # why there can be none; empty if there can

    def low(self, piece: _core.ShapedCommand, at: IntArray) -> tuple[IntArray, FloatArray, FloatArray]:
        """Periods in *at* of low speed where a start from rest keeps the tolerance; their vibration, mm, and speed."""
        grid = np.asarray(piece.grid_mm)
        at = at[(at > 0) & (at < len(grid) - 1)]
        before, behind = (grid[at] - grid[at - 1]) / self._period_s, (grid[at + 1] - grid[at]) / self._period_s
        speed = np.maximum(np.linalg.norm(before, axis=1), np.linalg.norm(behind, axis=1))
        deflection = (behind - before) / self._period_s / self._omega**2
        left = np.linalg.norm(np.hypot(0.5 * (before + behind) / self._omega, deflection), axis=1)
        rests = (speed <= self._fastest_mm_per_s) & (left <= self._tolerance_mm)
        return at[rests], left[rests], speed[rests]

    def choose(
        self, at: IntArray, left: FloatArray, end: int, *, last: bool, usable: Callable[[int], bool]
    ) -> Iterator[int]:
        """Yield indices in *at* of restart points, at most one interval apart wherever the command is slow enough."""
        near = self._interval * _APART
        if last:
            at = at[: np.searchsorted(at, end - near)]
        if self.reason:
            at = at[:0]
        while not (last and end - self.last <= self._interval):
            borders = self.last + np.array([near, 0.5 * self._interval, self._interval])
            low, middle, high = (int(each) for each in np.searchsorted(at, borders, side="right"))
            if middle == high or left[middle:high].min() > self._floor_mm:
                middle = low
            order = middle + np.argsort(left[middle:high], kind="stable")
            # If there is none within the interval: the first slow position after it.
            group = int(np.searchsorted(at, at[high] + near, side="right")) if high < len(at) else high
            later = high + np.argsort(left[high:group], kind="stable")
            found = next((int(each) for each in chain(order, later, range(group, len(at))) if usable(int(each))), None)
            if found is None:
                break
            self._reach(int(at[found]))
            yield found
        if last:
            self._reach(end)

    def _reach(self, period: int) -> None:
        self.longest = max(self.longest, period - self.last)
        self.last = period

    def further_stops(self, points: Sequence[int], reached: Sequence[int], end: int) -> list[int]:
        """Segments before which a stop is needed: otherwise restart points would be more than one interval apart."""
        stops: list[int] = []
        begins = np.asarray(reached)
        near = self._interval * _APART
        aim = self._interval - near  # deceleration takes time too
        for begin, until in zip([0, *points], [*points, end], strict=True):
            at: float = begin
            while until - at > self._interval:
                index = int(np.searchsorted(begins, at + aim, side="right")) - 1
                if index < 0 or begins[index] <= at + near:
                    index += 1  # a long segment: stop after it
                if index >= len(begins) or begins[index] >= until - near:
                    break
                at = float(begins[index])
                stops.append(index + 1)
        return stops


def _why_none(region: _core.Region) -> str:
    entry = region.entry
    unknown = [axis for axis, known in zip("XYZ", entry.known, strict=True) if not known]
    if region.incremental or unknown:
        return f"the position of {', '.join(unknown) or 'an axis'} is not known, so it cannot be written absolutely"
    if entry.uncertain:
        return "its modal state is not known"
    return ""


def block_lines(text: bytes, blocks: int) -> tuple[IntArray, IntArray]:
    """Begin and end of the line of each block in a text, in bytes; comment lines are skipped."""
    letters = np.frombuffer(text + b"(", dtype=np.uint8)  # so that a character follows the last line end
    ends = np.flatnonzero(letters == ord("\n")) + 1
    begins = np.concatenate([[0], ends[:-1]]).astype(np.int64)[: len(ends)]
    for _ in range(2):  # a line may end with LF CR CR
        begins += letters[begins] == ord("\r")
    is_block = letters[begins] != ord("(")
    return begins[is_block][:blocks], ends[is_block][:blocks]


class RegionRestarts:
    """Writes blocks of a region as restart points, piece by piece."""

    def __init__(
        self, places: RestartPlaces, region: _core.Region, machine: Machine, fit: _core.FitOptions, decimals: int
    ) -> None:
        self._places, self._region, self._fit, self._decimals = places, region, fit, decimals
        self._max = machine.emission.max_line_length
        # An axis between two increments is not moved: its position is in the list of points.
        self._resting = between_increments(region, fit.increment_mm)
        self._marks: list[RestartMark] = []
        self._bytes = self._lines = 0  # of the previous pieces

    def add(
        self, text: bytes, piece: _core.ShapedCommand, fitted: _core.FittedBlocks, state: tuple[int, int], *, last: bool
    ) -> bytes:
        """Write the next piece with its restart points."""
        firsts, ends = fitted.first_periods.astype(np.int64), fitted.ends
        at, left, speed = self._places.low(piece, firsts)
        # The last block of a region may have to stop exactly.
        lines = _PointLines(text, len(firsts) - last if len(at) else 0, state, self._region, self._max)
        blocks = np.searchsorted(firsts, at)

        def point(index: int) -> bytes | None:
            block = int(blocks[index])
            values = zip("XYZ", ends[block] * 10.0**-self._decimals, self._resting, strict=True)
            position = "".join(f"{axis}{decimal(value, self._decimals)}" for axis, value, rests in values if not rests)
            return lines.write(block, position) if block > 0 else None

        parts, done, size = [], 0, self._bytes
        periods, end = at + piece.first_period, piece.first_period + len(piece.middle_mm)
        chosen = self._places.choose(periods, left, end, last=last, usable=lambda index: point(index) is not None)
        for index in chosen:
            block = int(blocks[index])
            begin, behind = lines.extent(block)
            parts += [text[done:begin], point(index) or b""]
            at_mm = np.where(self._resting, self._region.path.start_mm, ends[block - 1] * self._fit.increment_mm)
            x, y, z = (round(float(value), 6) for value in at_mm)
            mark = RestartMark(
                byte=size + begin - done,
                line=self._lines + text.count(b"\n", 0, begin),
                time_s=float(periods[index]) * self._fit.block_period_s,
                position_mm=(x, y, z),
                speed_mm_per_s=float(speed[index]),
                vibration_um=float(left[index]) * 1e3,
            )
            self._marks.append(mark)
            size += len(parts[-1]) + len(parts[-2])
            done = behind
        written = b"".join([*parts, text[done:]])
        self._bytes += len(written)
        self._lines += text.count(b"\n")
        return written

    def result(self, head: bytes, stops: int, stops_s: float) -> CutRestarts:
        """The restart points of the region."""
        lines = head.count(b"\n")
        marks = tuple(replace(each, byte=each.byte + len(head), line=each.line + lines) for each in self._marks)
        longest_s = self._places.longest * self._fit.block_period_s
        return CutRestarts(marks, longest_s, self._places.reason, stops, stops_s)


class _PointLines:
    def __init__(
        self, text: bytes, blocks: int, state: tuple[int, int], region: _core.Region, max_line_length: int
    ) -> None:
        self._text, self._region, self._max = text, region, max_line_length
        self._motion, self._plane = (str(code).encode() for code in state)
        self._begins, self._ends = block_lines(text, blocks)

    def extent(self, block: int) -> tuple[int, int]:
        begin, end = int(self._begins[block]), int(self._ends[block])
        return begin, begin + len(self._text[begin:end].rstrip(b"\r\n"))

    def write(self, block: int, position: str) -> bytes | None:
        """A block with its full modal state, G40 and G64 if the line has space; None: it cannot be a restart point."""
        if block >= len(self._begins):
            return None
        begin, end = self.extent(block)
        if self._text.startswith((b"N", b"G09"), begin) or self._in_force(_MOTION, end, self._motion) != b"1":
            return None
        feed = self._in_force(_FEED, end, b"").decode()
        plane = self._in_force(_PLANE, end, self._plane).decode()
        entry = self._region.entry
        # G54.1 needs P, which a block of a cut must not contain: it is in the list and set before the start.
        system = "" if entry.coordinate_system == EXTRA_SYSTEM else system_of(entry)
        codes = f"{PLACEHOLDER}G{plane}G{entry.units}G90{system}G94"
        for further in ("G40G64", "G40", ""):
            line = f"{codes}{further}G01{position}{feed}"
            if feed and len(line) <= self._max:
                return line.encode()
        return None

    def _in_force(self, pattern: re.Pattern[bytes], end: int, before: bytes) -> bytes:
        """The last match of *pattern* in the lines up to byte *end* of the piece; *before* if there is none."""
        while end > 0:
            begin = self._text.rfind(b"\n", 0, end) + 1
            line = self._text[begin:end].lstrip(b"\r")
            if not line.startswith(b"(") and (found := pattern.findall(line)):
                return bytes(found[-1])
            end = begin - 1
        return before
