"""Which tests are drawn up for a machine and a box."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from shapegcode.characterization.plan import AXES, AirBox, AirTest, Kind, Part, Pattern, check
from shapegcode.errors import ArgumentError

if TYPE_CHECKING:
    from shapegcode.machine import Machine

__all__ = ["make_tests"]

#: Feeds to choose from, mm/min: in each, 1 µm is a small and exact part of a period.
_FEEDS = (3000.0, 1200.0, 600.0, 300.0, 120.0, 60.0)
_FIRST_NUMBER = 7001  # 8000 and 9000 are often locked
_STOP_S = 0.032  # a whole multiple of every usual interpolation period
_LOG_STOP_S = 0.160
_STOP_DWELL_S = 0.008
_LOG_DWELL_S = 0.096
_LOG_PAUSE_S = 0.5
_STEPS_WAY_S = 0.8  # at full feed: longer than the ramps at both ends
_LOG_SHARES = (1.0, 0.5, 0.25, 0.1, 0.05)
_MORE_SHARES = (0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.55, 0.45, 0.4, 0.35)
_LONG_RAPID_S = 0.2
_LONG_RAPIDS = ((1.0, 100), (0.5, 100), (0.2, 60), (0.14, 60), (0.1, 60), (0.07, 60), (0.05, 60), (0.03, 60))
_SHORT_RAPIDS = ((1.0, 100), (0.85, 60), (0.7, 60), (0.55, 60), (0.4, 60), (0.3, 60), (0.2, 60), (0.1, 60), (0.05, 60))
_PER_MINUTE = 60.0


class _Maker:
    """Draws up the tests for one machine and one box."""

    def __init__(self, machine: Machine, box: AirBox) -> None:
        self._box = box
        self._step = machine.controller.least_increment_mm
        axes = machine.axes.as_tuple()
        largest = 0.5 * min(axis.max_feed_mm_per_min for axis in axes)
        usable = [feed for feed in _FEEDS if feed <= largest]
        if not usable:
            raise ArgumentError(f"half of the smallest max_feed is {largest:g} mm/min; the tests need 60 or more")
        self.feed = usable[0]
        self.rapid = {name: axis.rapid_mm_per_min for name, axis in zip(AXES, axes, strict=True)}

    def _length(self, axis: str, duration_s: float, feed: float, side: int = 0) -> float:
        """Signed length for a duration; *side* -1 and +1: just below and just above it, whatever the increment."""
        exact = duration_s * feed / _PER_MINUTE
        margin = max(self._step, 0.0005 * exact) if side else 0.0
        units = round((exact + side * margin) / self._step)
        if side and (units * self._step - exact) * side <= 0.0:
            units += side
        return math.copysign(round(max(units, 1) * self._step, 9), self._box.travel_mm(axis))

    def stops(
        self, pattern: Pattern, axis: str, count: int, side: int, *, log: bool = False, slower: float = 1.0
    ) -> Part:
        """Moves of nearly the same duration, each ending in a stop."""
        base, dwell = (_LOG_STOP_S, _LOG_DWELL_S) if log else (_STOP_S, _STOP_DWELL_S)
        feed = self.feed / slower
        length = self._fit(axis, self._length(axis, base, feed, side))
        dwell = dwell if pattern == "dwell" else 0.0
        return Part(pattern, axis, count, length, feed, dwell_s=dwell)

    def run(self, axis: str, count: int, duration_s: float, side: int = 0) -> Part:
        """Continuous moves, there and back over as much of the box as they fill evenly."""
        length = self._length(axis, duration_s, self.feed, side)
        room = int((abs(self._box.travel_mm(axis)) + 1e-9) / abs(length))
        if room < 1:
            raise ArgumentError(self._too_small(axis, abs(length)))
        stride = min(room, count // 2)
        turns = max(1, round(count / (2 * stride)))
        return Part("continuous", axis, 2 * stride * turns, length, self.feed, stride)

    def rapids(self, axis: str, share: float, count: int) -> Part:
        """Rapids over a share of the box."""
        units = math.floor(share * abs(self._box.travel_mm(axis)) / self._step + 1e-9)
        if units < 1:
            raise ArgumentError(self._too_small(axis, self._step))
        length = math.copysign(round(units * self._step, 9), self._box.travel_mm(axis))
        return Part("rapid", axis, count, length, self.rapid[axis])

    def rapid_series(self, axis: str) -> list[Part]:
        """Rapids over several lengths for a log; more where none may reach the rate: each gives only a bracket."""
        reached = self._rate_is_reached(axis)
        shares = _LOG_SHARES if reached else (*_LOG_SHARES, *_MORE_SHARES)
        return [self.rapids(axis, share, 6 if reached else 4) for share in shares]

    def rapid_shares(self, axis: str) -> tuple[tuple[float, int], ...]:
        """Shares of the box and counts of rapids for a stopwatch.

        Half a short rapid lasts whole periods: lengths that round differently tell the time constant.
        """
        return _LONG_RAPIDS if self._rate_is_reached(axis) else _SHORT_RAPIDS

    def _rate_is_reached(self, axis: str) -> bool:
        return abs(self._box.travel_mm(axis)) > _LONG_RAPID_S * self.rapid[axis] / _PER_MINUTE

    def feed_steps(self, axis: str, length_mm: float) -> list[Part]:
        """Pieces of one length, alternately fast and slow, and back."""
        room = int((abs(self._box.travel_mm(axis)) + 1e-9) / length_mm)
        wanted = max(8, 2 * math.ceil(_STEPS_WAY_S * self.feed / _PER_MINUTE / (2.0 * length_mm)))
        stride = min(wanted, room - room % 2)
        if stride < 4:
            return []
        length = math.copysign(round(round(length_mm / self._step) * self._step, 9), self._box.travel_mm(axis))
        return [Part("feed_steps", axis, 2 * stride, length, self.feed, stride), Part("pause", dwell_s=_LOG_PAUSE_S)]

    def _fit(self, axis: str, length: float) -> float:
        if abs(length) > abs(self._box.travel_mm(axis)):
            raise ArgumentError(self._too_small(axis, abs(length)))
        return length

    def _too_small(self, axis: str, needed: float) -> str:
        return f"--box {self._box}: {axis} has {abs(self._box.travel_mm(axis)):g} mm, a test needs {needed:.3f} mm"


def make_tests(machine: Machine, box: AirBox) -> list[AirTest]:
    """The tests for a machine: those for a stopwatch first, then the shorter ones for a servo log."""
    make = _Maker(machine, box)
    tests: list[AirTest] = []

    def add(
        kind: Kind, name: str, purpose: str, parts: Iterable[Part], override: int = 100, same: bool = False
    ) -> None:
        number = tests[-1].number if same else _FIRST_NUMBER + len({test.number for test in tests})
        test = AirTest(name, number, kind, purpose, tuple(parts), override)
        check(test, box)
        tests.append(test)

    def stopwatch(name: str, purpose: str, part: Part, override: int = 100, same: bool = False) -> None:
        add("stopwatch", name, purpose, [part], override, same)

    stopwatch("overhead", "TIME OF START AND END OF A PROGRAM", Part("pause", dwell_s=10.0))
    stopwatch("stop_below", "TIME CONSTANT", make.stops("dwell", "X", 200, -1))
    stopwatch("stop_above", "INTERPOLATION PERIOD", make.stops("dwell", "X", 200, +1))
    stopwatch("stop_slow", "SHAPE OF THE ACCELERATION", make.stops("dwell", "X", 200, -1, slower=5.0))
    stopwatch("stop_slower", "SHAPE OF THE ACCELERATION", make.stops("dwell", "X", 200, -1, slower=20.0))
    stopwatch("run_above", "CEIL OR CARRY", make.run("X", 600, _STOP_S, +1))
    for axis in AXES:
        stopwatch(f"exact_{axis.lower()}", f"IN-POSITION TIME OF {axis}", make.stops("exact", axis, 200, -1))
    stopwatch("blocks_tiny", "BLOCK TIME", make.run("X", 2000, 0.0002))
    stopwatch("blocks_short", "BLOCK TIME, KNEE", make.run("X", 1000, 0.0041))
    stopwatch("blocks_medium", "BLOCK TIME, KNEE", make.run("X", 1000, 0.0121))
    for axis in AXES:
        for share, count in make.rapid_shares(axis):
            name = f"rapid_{axis.lower()}_{share * 100:.0f}"
            stopwatch(name, f"RAPID OF {axis}, {share * 100:.0f} PERCENT OF THE BOX", make.rapids(axis, share, count))
    override_run = make.run("X", 20, min(1.0, abs(box.travel_mm("X")) / make.feed * _PER_MINUTE))
    for percent in (50, 100, 120):
        stopwatch(f"override_{percent}", "FEED OVERRIDE", override_run, percent, same=percent != 50)

    for name, purpose, parts in _log_tests(make):
        add("log", name, purpose, parts)
    return tests


def _log_tests(make: _Maker) -> Iterator[tuple[str, str, list[Part]]]:
    """Name, purpose and parts of the tests for a servo log; a pause stands behind each part."""
    pause = Part("pause", dwell_s=_LOG_PAUSE_S)

    def paused(parts: Iterable[Part]) -> list[Part]:
        return [each for part in parts for each in (part, pause)]

    stops = [make.stops("dwell", "X", 10, side, log=True) for side in (-1, +1)]
    yield "log_cutting", "TIME CONSTANT, PERIOD", paused(stops)
    yield "log_exact", "IN-POSITION TIMES", paused(make.stops("exact", axis, 10, -1, log=True) for axis in AXES)
    yield "log_run", "CEIL OR CARRY", paused([make.run("X", 160, _STOP_S, +1)])
    yield "log_blocks", "BLOCK TIME", paused([make.run("X", 1200, 0.0002)])
    for axis in AXES:
        yield f"log_rapid_{axis.lower()}", f"RAPID OF {axis}", paused(make.rapid_series(axis))
    lengths = (20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2)
    parts = [part for length in lengths for part in make.feed_steps("X", length * make.feed / 3000.0)]
    if parts:
        yield "log_feed_steps", "FEED-CONTROL INTERVAL", parts
