"""Characterization tests: parts of equal moves in the air, the tests of a machine and box, and their duration.

A test is one run of a program. The fit needs only the data of the tests, which ``RESULTS.toml`` repeats.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal, Self

from shapegcode.errors import ArgumentError
from shapegcode.machine import Machine

AXES = ("X", "Y", "Z")
BlockEnd = Literal["ceil", "carry"]  # rounding of a block's end to the interpolation period
Kind = Literal["stopwatch", "log"]
Pattern = Literal["pause", "continuous", "dwell", "exact", "rapid", "feed_steps"]


@dataclass(frozen=True)
class AirBox:
    """Space in which the tests may move, relative to the operator's start point."""

    low: tuple[float, float, float] = (0.0, 0.0, 0.0)  # smallest X, Y, Z in mm, 0 or below
    high: tuple[float, float, float] = (100.0, 100.0, 20.0)  # largest X, Y, Z in mm, 0 or above

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``X0:X1,Y0:Y1,Z0:Z1`` in mm from the start point, for example ``0:100,-50:50,0:20``."""
        number = r"([-+]?\d+(?:\.\d*)?)"
        found = re.fullmatch(",".join([rf"\s*{number}:{number}\s*"] * 3), text)
        if not found:
            raise ArgumentError(f"--box {text}: must be X0:X1,Y0:Y1,Z0:Z1 in mm from the start point")
        values = [float(word) for word in found.groups()]
        for axis, low, high in zip(AXES, values[::2], values[1::2], strict=True):
            if not low <= 0.0 <= high or low == high:
                span = f"{axis} from {low:g} to {high:g} mm"
                raise ArgumentError(f"--box {text}: {span} does not contain the start point, 0")
            if max(-low, high) > 10_000.0:
                raise ArgumentError(f"--box {text}: {axis} reaches {max(-low, high):g} mm, the limit is 10000")
        return cls(tuple(values[::2]), tuple(values[1::2]))  # type: ignore[arg-type]

    def travel_mm(self, axis: str) -> float:
        """Signed travel from the start point to the farther side, in mm."""
        index = AXES.index(axis)
        low, high = self.low[index], self.high[index]
        return high if high >= -low else low

    def __str__(self) -> str:
        return ",".join(f"{low:g}:{high:g}" for low, high in zip(self.low, self.high, strict=True))


@dataclass(frozen=True)
class Part:
    """Equal moves of one axis."""

    # `continuous`: cutting moves that overlap; `dwell`: a dwell after each; `exact`: exact stop (G61) after each;
    # `rapid`: G00; `feed_steps`: cutting moves, alternately at the feed and at half of it; `pause`: one dwell, no
    # motion
    pattern: Pattern
    axis: str = "X"
    count: int = 1
    length_mm: float = 0.0  # negative if the first goes in the negative direction
    feed_mm_per_min: float = 0.0  # cutting feed; for a rapid the rate at 100 % in the machine file
    stride: int = 1  # moves in one direction before the reversal
    dwell_s: float = 0.0  # dwell after each move (`dwell`), or the pause

    @property
    def duration_s(self) -> float:
        """Length over feed of one move, in s, at 100 % override."""
        return abs(self.length_mm) / self.feed_mm_per_min * 60.0 if self.feed_mm_per_min else 0.0


@dataclass(frozen=True)
class AirTest:
    """One run of one program."""

    name: str  # name of the test, as in `RESULTS.toml`
    number: int  # O number of its program
    kind: Kind  # `stopwatch`: timed from start to end; `log`: recorded by the control
    purpose: str  # its purpose, in one line
    parts: tuple[Part, ...]
    override_percent: int = 100

    @property
    def program(self) -> str:
        """Name of the program file."""
        return f"O{self.number:04d}.nc"


@dataclass(frozen=True)
class Step:
    """One block of a part: a move, or a dwell if ``length_mm`` is 0."""

    length_mm: float
    feed_mm_per_min: float  # its feed; 0 for a rapid and for a dwell
    dwell_s: float = 0.0


def steps(part: Part) -> Iterator[Step]:
    """The blocks of a part in their order."""
    if part.pattern == "pause":
        yield Step(0.0, 0.0, part.dwell_s)
        return
    for index in range(part.count):
        sign = 1 if index // part.stride % 2 == 0 else -1
        slow = part.pattern == "feed_steps" and index % 2 == 1
        feed = 0.0 if part.pattern == "rapid" else part.feed_mm_per_min * (0.5 if slow else 1.0)
        yield Step(sign * part.length_mm, feed)
        if part.pattern == "dwell":
            yield Step(0.0, 0.0, part.dwell_s)


def check(test: AirTest, box: AirBox) -> None:
    """Check that a test stays within the box and ends at its start."""
    at = dict.fromkeys(AXES, 0.0)
    for part in test.parts:
        index = AXES.index(part.axis)
        low, high = box.low[index], box.high[index]
        for step in steps(part):
            at[part.axis] += step.length_mm
            if not low - 1e-6 <= at[part.axis] <= high + 1e-6:
                goes = f"{part.axis} would go to {at[part.axis]:.3f} mm"
                raise ArgumentError(f"test {test.name}: {goes}, the box is {low:g} to {high:g} mm")
    if not all(math.isclose(position, 0.0, abs_tol=1e-6) for position in at.values()):
        raise ArgumentError(f"test {test.name} would not end at its start: {at}")


_FEEDS = (3000.0, 1200.0, 600.0, 300.0, 120.0, 60.0)  # mm/min: at each, 1 µm takes a round time, from 0.02 to 1 ms
_FIRST_NUMBER = 7001  # 8000 and 9000 are often locked
_STOP_S, _STOP_DWELL_S = 0.032, 0.008  # multiples of 1, 2, 4 and 8 ms, the most usual interpolation periods
_LOG_STOP_S, _LOG_DWELL_S, _LOG_PAUSE_S = 0.160, 0.096, 0.5
_STEPS_MOVE_S = 0.8  # at full feed: longer than the ramps at both ends
_LOG_RATIOS = (1.0, 0.5, 0.25, 0.1, 0.05)
_MORE_RATIOS = (0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.55, 0.45, 0.4, 0.35)
_LONG_RAPID_S = 0.2
_LONG_RAPIDS = ((1.0, 100), (0.5, 100), (0.2, 60), (0.14, 60), (0.1, 60), (0.07, 60), (0.05, 60), (0.03, 60))
_SHORT_RAPIDS = ((1.0, 100), (0.85, 60), (0.7, 60), (0.55, 60), (0.4, 60), (0.3, 60), (0.2, 60), (0.1, 60), (0.05, 60))


class _Maker:
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

    def _signed(self, axis: str, increments: int) -> float:
        """Length of these increments in mm, with the sign of the direction to the farther side of the box."""
        length, travel = round(increments * self._step, 9), self._box.travel_mm(axis)
        if not 0.0 < length <= abs(travel) + 1e-9:
            needed = max(length, self._step)
            raise ArgumentError(f"--box {self._box}: {axis} has {abs(travel):g} mm, but a test needs {needed:.3f} mm")
        return math.copysign(length, travel)

    def _length(self, axis: str, duration_s: float, feed: float, side: int) -> float:
        """Signed length for a duration; *side* -1, +1: rounded to increments below or above it."""
        exact = duration_s * feed / 60.0
        margin = max(self._step, 0.0005 * exact) if side else 0.0
        increments = round((exact + side * margin) / self._step)
        if side and (increments * self._step - exact) * side <= 0.0:
            increments += side
        return self._signed(axis, max(increments, 1))

    def stops(self, pattern: Pattern, axis: str, count: int, side: int, slower: float = 1.0, log: bool = False) -> Part:
        """Equal moves of about `_STOP_S` each (*log*: `_LOG_STOP_S`), each ending in a stop."""
        base, dwell = (_LOG_STOP_S, _LOG_DWELL_S) if log else (_STOP_S, _STOP_DWELL_S)
        length = self._length(axis, base, self.feed / slower, side)
        return Part(pattern, axis, count, length, self.feed / slower, dwell_s=dwell if pattern == "dwell" else 0.0)

    def run(self, axis: str, count: int, duration_s: float, side: int = 0) -> Part:
        """Continuous moves of one length back and forth, as many in one direction as fit into the box."""
        length = self._length(axis, duration_s, self.feed, side)
        stride = min(int((abs(self._box.travel_mm(axis)) + 1e-9) / abs(length)), count // 2)
        turns = max(1, round(count / (2 * stride)))
        return Part("continuous", axis, 2 * stride * turns, length, self.feed, stride)

    def rapids(self, axis: str, ratio: float, count: int) -> Part:
        increments = math.floor(ratio * abs(self._box.travel_mm(axis)) / self._step + 1e-9)
        return Part("rapid", axis, count, self._signed(axis, increments), self.rapid[axis])

    def rate_is_reached(self, axis: str) -> bool:
        """Whether rapids over the box reach the rapid rate (if not, the tests have rapids of more lengths)."""
        return abs(self._box.travel_mm(axis)) > _LONG_RAPID_S * self.rapid[axis] / 60.0

    def feed_steps(self, axis: str, length_mm: float) -> list[Part]:
        """Moves of one length in one direction, alternately fast and slow, then back; none if the box is too small."""
        room = int((abs(self._box.travel_mm(axis)) + 1e-9) / length_mm)
        wanted = max(8, 2 * math.ceil(_STEPS_MOVE_S * self.feed / 60.0 / (2.0 * length_mm)))
        stride = min(wanted, room - room % 2)
        if stride < 4:
            return []
        length = self._signed(axis, round(length_mm / self._step))
        return [Part("feed_steps", axis, 2 * stride, length, self.feed, stride)]


def make_tests(machine: Machine, box: AirBox) -> list[AirTest]:
    """Make the tests of a machine: those for a stopwatch first, then the shorter ones for a servo log."""
    make = _Maker(machine, box)
    tests: list[AirTest] = []

    def add(kind: Kind, name: str, purpose: str, parts: Iterable[Part], override: int = 100) -> None:
        # One program is run at several overrides.
        same = name.startswith("override") and tests[-1].name.startswith("override")
        number = tests[-1].number if same else _FIRST_NUMBER + len({test.number for test in tests})
        test = AirTest(name, number, kind, purpose, tuple(parts), override)
        check(test, box)
        tests.append(test)

    def stopwatch(name: str, purpose: str, part: Part, override: int = 100) -> None:
        add("stopwatch", name, purpose, [part], override)

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
        for ratio, count in _LONG_RAPIDS if make.rate_is_reached(axis) else _SHORT_RAPIDS:
            name = f"rapid_{axis.lower()}_{ratio * 100:.0f}"
            stopwatch(name, f"RAPID OF {axis}, {ratio * 100:.0f} PERCENT OF THE BOX", make.rapids(axis, ratio, count))
    override_run = make.run("X", 20, min(1.0, abs(box.travel_mm("X")) / make.feed * 60.0))
    for percent in (50, 100, 120):
        stopwatch(f"override_{percent}", "FEED OVERRIDE", override_run, percent)

    def log(name: str, purpose: str, parts: Iterable[Part]) -> None:
        pause = Part("pause", dwell_s=_LOG_PAUSE_S)
        add("log", name, purpose, [each for part in parts for each in (part, pause)])

    log("log_cutting", "TIME CONSTANT, PERIOD", [make.stops("dwell", "X", 10, side, log=True) for side in (-1, +1)])
    log("log_exact", "IN-POSITION TIMES", [make.stops("exact", axis, 10, -1, log=True) for axis in AXES])
    log("log_run", "CEIL OR CARRY", [make.run("X", 160, _STOP_S, +1)])
    log("log_blocks", "BLOCK TIME", [make.run("X", 1200, 0.0002)])
    for axis in AXES:
        ratios, count = (_LOG_RATIOS, 6) if make.rate_is_reached(axis) else ((*_LOG_RATIOS, *_MORE_RATIOS), 4)
        rapids = [make.rapids(axis, ratio, count) for ratio in ratios]
        log(f"log_rapid_{axis.lower()}", f"RAPID OF {axis}", rapids)
    lengths = (20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2)
    if parts := [part for length in lengths for part in make.feed_steps("X", length * make.feed / 3000.0)]:
        log("log_feed_steps", "FEED-CONTROL INTERVAL", parts)
    return tests


NO_PERIOD_S = 1e-6  # too short to round anything


@dataclass(frozen=True)
class ControllerTiming:
    """What determines the duration of a test, in s: paper 004 in docs/evidence/references.md, equations 2 to 16."""

    period_s: float
    block_end: BlockEnd
    block_time_s: float  # shortest time to read a block
    cutting_s: float  # from the end of a cutting command to rest: time constant and bell time
    rapid_s: Mapping[str, float] = field(default_factory=dict)  # time constant of a rapid, by axis
    rapid_bell_s: Mapping[str, float] = field(default_factory=dict)  # bell time of a rapid, by axis
    in_position_s: Mapping[str, float] = field(default_factory=dict)  # wait after a rapid or an exact stop, by axis
    overhead_s: float = 0.0  # stopwatch time in addition to the program

    @classmethod
    def of(cls, machine: Machine) -> Self:
        """Timing of a machine file."""
        control = machine.controller
        rapid_s = dict(zip(AXES, control.rapid_time_constant_s.as_tuple(), strict=True))
        rapid_bell_s = dict.fromkeys(AXES, control.rapid_bell_time_s)
        in_position_s = dict(zip(AXES, control.in_position_s.as_tuple(), strict=True))
        stop = control.block_end, control.block_time_s, control.time_constant_s + control.bell_time_s
        return cls(control.interpolation_period_s, *stop, rapid_s, rapid_bell_s, in_position_s)


def whole_periods(duration_s: float, period_s: float) -> float:
    """Round a duration up to whole interpolation periods, in s."""
    return math.ceil(duration_s / period_s - 1e-6) * period_s  # less the round-off, in periods


def part_time_s(part: Part, timing: ControllerTiming, override: float = 1.0) -> float:
    """Duration of one part in s."""
    if part.pattern == "pause":
        return part.dwell_s
    if part.pattern == "rapid":
        ramp = timing.rapid_s[part.axis]
        if part.duration_s >= ramp:
            moving = whole_periods(part.duration_s, timing.period_s) + ramp
        else:  # acceleration = rate / time constant; half of the travel up, half down
            moving = 2.0 * whole_periods(math.sqrt(part.duration_s * ramp), timing.period_s)
        return part.count * (moving + timing.rapid_bell_s[part.axis] + timing.in_position_s[part.axis])
    feeds = (1.0, 0.5) if part.pattern == "feed_steps" else (1.0,)
    stops = part.pattern in ("dwell", "exact")
    mean = 0.0
    for feed in feeds:
        block = part.duration_s / (feed * override)
        if stops or timing.block_end == "ceil":
            block = whole_periods(block, timing.period_s)
        mean += (block if stops else max(block, timing.block_time_s)) / len(feeds)
    if part.pattern == "dwell":
        return part.count * (mean + timing.cutting_s + part.dwell_s)
    if part.pattern == "exact":
        return part.count * (mean + timing.cutting_s + timing.in_position_s[part.axis])
    return part.count * mean + timing.cutting_s


def program_time_s(test: AirTest, timing: ControllerTiming) -> float:
    """Duration of a test in s, with the operator's overhead."""
    override = test.override_percent / 100.0
    return timing.overhead_s + sum(part_time_s(part, timing, override) for part in test.parts)
