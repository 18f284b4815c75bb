"""A program with its cycle-time data, aligned with a log: start of each line, overrides."""

from __future__ import annotations

import math
import re
from bisect import bisect_left, bisect_right
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.errors import RecordError
from shapegcode.io.runs import RunLog, Signal
from shapegcode.io.units import MM_PER_INCH, FloatArray, find_unit
from shapegcode.machine import Machine
from shapegcode.model.machine_model import fanuc_model
from shapegcode.program import Program
from shapegcode.timing.calibration.runs_file import RunEntry

IntArray = npt.NDArray[np.int64]

_SEQUENCE = re.compile(r"[ /]*[Nn](\d{1,7})")
_MIN_ARC_MM = 0.5
_GENTLE_MM_PER_S2 = 100.0  # centripetal acceleration for which no machining centre slows down


@dataclass(frozen=True, eq=False)
class TimedProgram:
    """Program data for the cycle time."""

    program: Program
    line_count: int  # of the expanded program
    # (line_count + 2,) programmed feed of a line's last cut, by line number; NaN without a cut
    feed_mm_per_s: FloatArray
    # (line_count + 2,) radius of a line's arc, if it turns by more than 1 rad and is longer than 0.5 mm (to reach a
    # steady speed); else infinity
    arc_radius_mm: FloatArray
    free: npt.NDArray[np.bool_]  # (line_count + 2,) no machine slows down there because of an arc
    rapid: npt.NDArray[np.bool_]  # (line_count + 2,) the line moves in rapid
    function: npt.NDArray[np.bool_]  # (line_count + 2,) the line has M, S or T words, or an unknown travel
    sections: tuple[tuple[int, int], ...]  # (first line, last line) of the parts without functions

    def starts(self, model: _core.FanucModel) -> FloatArray:
        """Start time of each line in a model, s, (line_count + 2,); NaN: no move; last item: end of the program."""
        timed = _core.time_program(self.program.core, model, True)
        found = np.full(self.line_count + 2, np.nan)
        # A line may have several moves: the first one counts.
        found[timed.blocks["line"][::-1]] = timed.blocks["start_s"][::-1]
        found[-1] = timed.total_s
        return found

    @cached_property
    def text_lines(self) -> list[str]:
        """Lines of the expanded program."""
        return self.program.core.text.decode("latin-1").splitlines()

    @cached_property
    def sequence_lines(self) -> dict[int, list[int]]:
        """Lines by their N number, ascending."""
        positions: dict[int, list[int]] = defaultdict(list)
        for line, text in enumerate(self.text_lines, start=1):
            if number := _SEQUENCE.match(text):
                positions[int(number[1])].append(line)
        return positions

    @cached_property
    def tools(self) -> IntArray:
        """Tool in use at each line, (line_count + 2,), -1: unknown."""
        tool = np.full(self.line_count + 2, -1, dtype=np.int64)
        selected, functions = -1, self.program.core.functions
        for kind, index, line in self.program.core.steps:
            if kind == _core.StepKind.function:
                codes, asked, _ = functions[index]
                selected = asked if asked >= 0 else selected
                if 6 in codes:
                    tool[line:] = selected
        return tool


def timed_program(program: Program) -> TimedProgram:
    """Find the lines of a program with cuts, rapids or machine functions."""
    core = program.core
    count = core.line_count
    feed, radius = np.full(count + 2, np.nan), np.full(count + 2, np.inf)
    free, rapid, function = np.zeros((3, count + 2), dtype=bool)
    for region in program.regions:
        for index in range(len(region.path)):
            segment = region.path[index]
            feed[segment.line_number] = segment.feed_mm_per_s
            if segment.length_mm > max(_MIN_ARC_MM, _radius_mm(segment)):
                radius[segment.line_number] = _radius_mm(segment)
            free[segment.line_number] = segment.feed_mm_per_s**2 < _GENTLE_MM_PER_S2 * _radius_mm(segment)
    for segment, dwell_s in core.other_moves:
        if segment.kind == _core.SegmentKind.rapid:
            rapid[segment.line_number] = True
        elif dwell_s <= 0.0:
            feed[segment.line_number] = segment.feed_mm_per_s
            free[segment.line_number] = True
    for kind, _, line in core.steps:
        if kind == _core.StepKind.function:
            function[line] = True
    ends = [0, *(np.flatnonzero(function[1 : count + 1]) + 1).tolist(), count + 1]
    sections = tuple((before + 1, end - 1) for before, end in pairwise(ends) if end - before > 2)
    return TimedProgram(program, count, feed, radius, free, rapid, function, sections)


def _radius_mm(segment: _core.Segment) -> float:
    if segment.kind != _core.SegmentKind.arc:
        return math.inf
    return float(np.linalg.norm(np.asarray(segment.start_mm) - np.asarray(segment.centre_mm)))


# units to try for a feed without unit, in mm/s
_FEED_UNITS = {"mm/s": 1.0, "mm/min": 1.0 / 60.0, "in/min": MM_PER_INCH / 60.0}
_MIN_READINGS = 4  # least readings of one value that are no coincidence
_FEED_BIN = 0.0025  # relative tolerance of readings of a steady feed
_MIN_SHARE = 0.06
_MIN_OVERRIDE, _MAX_OVERRIDE = 0.2, 2.0
_STEPS = (1.0, 0.5, 0.1, 1.0 / 60.0, 0.01, 0.001)  # resolutions of displayed feeds


@dataclass(frozen=True)
class CutSection:
    """A section of a run without functions."""

    lines: tuple[int, int]  # first and last
    feed_override: float  # override ratio
    measured: bool  # the override is from steady cuts of this section; else stated, of the whole run, or 1


def line_numbers(log: RunLog, timed: TimedProgram) -> IntArray:
    """Convert the log's block numbers to line numbers."""
    value = np.asarray(log.block.value, dtype=np.int64)
    if log.block_counts == "line":
        return value
    found, at = np.zeros(len(value), dtype=np.int64), 0
    for index, sequence_number in enumerate(value.tolist()):
        places = timed.sequence_lines.get(sequence_number, [])
        if (rank := bisect_left(places, at)) < len(places):
            at = found[index] = places[rank]
    return found


def lines_at(signal: Signal, log: RunLog, timed: TimedProgram) -> IntArray:
    """Reported line at each value of a signal."""
    line = line_numbers(log, timed)
    at = np.searchsorted(log.block.time_s, signal.time_s, side="right") - 1
    return np.clip(np.where(at >= 0, line[np.maximum(at, 0)], 0), 0, timed.line_count + 1)


def longest(pairs: Iterable[tuple[float, float]]) -> tuple[float, float]:
    """From pairs of value and duration: value with the longest total time, and its fraction; without pairs 1 and 1."""
    held: dict[float, float] = defaultdict(float)
    for value, duration in pairs:
        held[value] += duration
    value = max(held, key=lambda each: held[each], default=1.0)
    return value, held[value] / sum(held.values()) if any(held.values()) else 1.0


def held_longest(signal: Signal, end_s: float | None) -> float:
    """The value that a signal had for the longest time in total."""
    until = np.append(signal.time_s[1:], end_s if end_s is not None else signal.time_s[-1])
    values = (round(value, 3) for value in signal.value.tolist())
    return longest(zip(values, np.maximum(until - signal.time_s, 0.0).tolist(), strict=True))[0]


def feed_unit(entry: RunEntry, log: RunLog, timed: TimedProgram) -> float:
    """Unit of the logged feed, mm/s: as stated, else nearest to the programmed feeds; NaN: unknown, or few readings."""
    if log.feed is None or len(log.feed) < _MIN_READINGS:
        return math.nan
    line = lines_at(log.feed, log, timed)
    ratio = log.feed.value / timed.feed_mm_per_s[line]
    ratio = ratio[np.isfinite(ratio) & (ratio > 0.0)]
    steady = steady_value(np.log(ratio)) if len(ratio) else None
    name = entry.feed_unit or log.feed_unit
    stated = find_unit(name) if name is not None else None
    # An override is between a half and twice the programmed feed: units differ by more.
    units = [float(stated.factor) * 1000.0] if stated is not None else list(_FEED_UNITS.values())
    if steady is None:
        return units[0] if stated is not None else math.nan
    best = min(units, key=lambda unit: abs(steady + math.log(unit)))
    if abs(steady + math.log(best)) > math.log(2.0):
        tried = name if stated is not None else f"each of {', '.join(_FEED_UNITS)}"
        raise RecordError(
            f"{log.source}: steady feeds of {entry.program.name} are {math.exp(steady):.4g} times the programmed ones "
            f"in mm/s; with {tried} that would not be an override of 50 to 200 %; the log is of another program, the "
            f"program in another unit (G20, G21), or feed_unit must be stated{' otherwise' if stated else ''}"
        )
    return best


def steady_value(values: FloatArray) -> float | None:
    """Most frequent value; None: no value is frequent enough."""
    ordered = np.sort(values)
    count = np.searchsorted(ordered, ordered + _FEED_BIN, side="right") - np.arange(len(ordered))
    most = int(count.max())
    if most < _MIN_READINGS or most < _MIN_SHARE * len(values):
        return None
    at = int(np.argmax(count))
    return float(np.median(ordered[at : at + most]))


def cut_sections_of(
    entry: RunEntry, log: RunLog, timed: TimedProgram, unit: float, notes: list[str]
) -> list[CutSection]:
    """Feed override of each section: by its steady feed, else stated or logged, else the run's steady feed, else 1."""
    ratio, line = np.empty(0), np.empty(0, dtype=np.int64)
    if log.feed is not None and math.isfinite(unit):
        line = lines_at(log.feed, log, timed)
        ratio = log.feed.value * unit / timed.feed_mm_per_s[line]
        # Displayed feeds are multiples of a step, assumed to be the largest usual one that fits all of them. Readings
        # are used only if the step is fine enough for the programmed feed.
        shown = ((step, log.feed.value / step) for step in _STEPS)
        step = next((each for each, parts in shown if np.all(np.abs(parts - np.round(parts)) < 1e-3)), 0.0)
        fine = timed.feed_mm_per_s[line] * _FEED_BIN > step * unit
        keep = np.isfinite(ratio) & (ratio > 0.0) & timed.free[line] & fine
        ratio, line = ratio[keep], line[keep]
    whole = steady_value(ratio) if len(ratio) else None
    stated = entry.override_percent / 100.0 if entry.override_percent is not None else None
    if stated is None and log.feed_override is not None and len(log.feed_override):
        stated = held_longest(log.feed_override, log.duration_s)
    found = []
    for first, last in timed.sections:
        inside = ratio[(line >= first) & (line <= last) & (ratio >= _MIN_OVERRIDE) & (ratio <= _MAX_OVERRIDE)]
        seen = steady_value(inside) if len(inside) else None
        value = next(each for each in (seen, stated, whole, 1.0) if each is not None)
        found.append(CutSection((first, last), to_whole_percent(value), seen is not None))
    used = sorted({cut_section.feed_override for cut_section in found if cut_section.measured})
    if any(abs(value - 1.0) > 0.005 for value in used):
        notes.append("feed override " + ", ".join(f"{value:.1%}" for value in used) + " by steady cuts")
    if ratio.size == 0 and stated is None:
        notes.append("no feed in the log: overrides are unknown and assumed to be 100 %")
    return found


def to_whole_percent(ratio: float) -> float:
    """Round a ratio to whole percent, as on an override switch, if that is less than 0.2 % away; else to 0.01 %."""
    whole = round(ratio, 2)
    return whole if abs(ratio - whole) < 0.002 else round(ratio, 4)


_MIN_BLOCKS = 8
_MISSING_S, _MISSING = 15.0, 0.15  # missing part of a program: more than a machine's own times explain
_MIN_RISING = 0.9  # least ratio of ascending reported lines


@dataclass(frozen=True, eq=False)
class ObservedRun:
    """One run of a program, from its log."""

    timed: TimedProgram
    log: RunLog
    entry: RunEntry  # its entry in the file of runs
    time_s: FloatArray  # (n,) time since the start at which a line was first reported
    line: IntArray  # (n,) reported lines, strictly ascending
    cut_sections: tuple[CutSection, ...]  # sections with their feed overrides
    rapid_override: float  # ratio of the rapid rates; NaN: neither stated nor logged, before `with_override`
    feed_unit_mm_per_s: float  # one unit of the logged feed; NaN without a feed
    notes: tuple[str, ...]  # findings and gaps
    whole: bool = True  # the log begins with the program

    @property
    def duration_s(self) -> float | None:
        """From start to completion, s; None: the log lacks one of them, or both."""
        return self.log.duration_s if self.log.complete and self.whole else None


def observe(entry: RunEntry, log: RunLog, timed: TimedProgram, machine: Machine) -> ObservedRun:
    """Align a log with its program."""
    notes = list(log.notes)
    time_s, line = _lines(entry, log, timed, notes)
    _compare_tools(entry, log, timed, notes)
    unit = feed_unit(entry, log, timed)
    cut_sections = tuple(cut_sections_of(entry, log, timed, unit, notes))
    rapid_override = math.nan
    if entry.rapid_override_percent is not None:
        rapid_override = entry.rapid_override_percent / 100.0
    elif log.rapid_override is not None and len(log.rapid_override):
        # The override may change briefly, mostly at the start: use the value that lasted longest.
        rapid_override = held_longest(log.rapid_override, log.duration_s) or math.nan
    run = ObservedRun(timed, log, entry, time_s, line, cut_sections, rapid_override, unit, tuple(notes))
    starts = timed.starts(fanuc_model(machine))  # by the machine's own limits, before calibration
    whole = _is_whole(run, starts, notes)
    _require_same(run, starts)
    return replace(run, whole=whole, notes=tuple(notes))


def _lines(entry: RunEntry, log: RunLog, timed: TimedProgram, notes: list[str]) -> tuple[FloatArray, IntArray]:
    """Times and numbers of the lines in the log, each at its first report; lines out of order are left out."""
    line = line_numbers(log, timed)
    time_s = log.block.time_s
    within = (line >= 1) & (line <= timed.line_count)
    above = line[line > timed.line_count]
    where = f"{log.source}: {entry.program.name}"
    if len(above) > 0.02 * len(line):
        raise RecordError(
            f"{where} has {timed.line_count} lines, and the log reports line {int(above.max())}: log and program do "
            "not belong together"
        )
    time_s, line = time_s[within], line[within]
    if len(line) < _MIN_BLOCKS:
        raise RecordError(f"{where}: the log reports {len(line)} lines of it; {_MIN_BLOCKS} are needed")
    # Lines reported before the first block belong to the previous run; single readings may be wrong.
    rises = _rising(line)
    if np.mean(rises) < _MIN_RISING:
        back = int(np.flatnonzero(~rises)[0])
        raise RecordError(
            f"{where}: {np.mean(~rises):.0%} of the reported lines go back (line {line[back]} after "
            f"{time_s[back]:.1f} s is out of order): log and program do not belong together, or it repeats parts of "
            "itself, which cannot be aligned with a log by line numbers"
        )
    if not rises.all():
        notes.append(f"{int(np.sum(~rises))} reported lines are out of order and ignored")
    time_s, line = time_s[rises], line[rises]
    first = np.concatenate([[True], np.diff(line) > 0])
    return np.asarray(time_s[first], dtype=np.float64), np.asarray(line[first], dtype=np.int64)


def _compare_tools(entry: RunEntry, log: RunLog, timed: TimedProgram, notes: list[str]) -> None:
    """Compare logged tools with those that the program calls; note a difference, refuse the log of another version."""
    if log.tool is None:
        return
    called = {int(tool) for tool in timed.tools if tool >= 0}
    line = lines_at(log.tool, log, timed)
    wrong = []
    for value, at in zip(log.tool.value.tolist(), line.tolist(), strict=True):
        # The number changes within the block that changes the tool.
        here = {int(tool) for tool in timed.tools[max(at - 2, 0) : at + 3] if tool >= 0}
        if value > 0.0 and at > 0 and here and int(value) not in here:
            wrong.append((int(value), at, here))
    if not wrong:
        return
    value, at, here = wrong[0]
    said = f"tool {value} in the spindle at line {at}, but the program has T{min(here)}"
    if len(wrong) > 1 and all(each[0] in called for each in wrong):
        raise RecordError(f"{log.source}: {said}: it is not the log of this version of {entry.program.name}")
    notes.append(f"{said}: the log numbers tools in another way, or the tool was in the spindle before the start")


def _rising(line: IntArray) -> npt.NDArray[np.bool_]:
    """Mask of the longest non-descending subsequence."""
    ends: list[int] = []  # end of the best subsequence of each length
    before = np.full(len(line), -1, dtype=np.int64)
    values = line.tolist()
    for index, value in enumerate(values):
        length = bisect_right(ends, value, key=values.__getitem__)
        before[index] = ends[length - 1] if length > 0 else -1
        ends[length : length + 1] = [index]
    kept = np.zeros(len(line), dtype=bool)
    at = ends[-1] if ends else -1
    while at >= 0:
        kept[at] = True
        at = int(before[at])
    return kept


def _is_whole(run: ObservedRun, starts: FloatArray, notes: list[str]) -> bool:
    """Whether the log begins with the program."""
    begin, total_s = starts[run.line], float(starts[-1])
    known = np.flatnonzero(np.isfinite(begin))
    if not len(known) or run.log.duration_s is None:
        return True
    missing_s = total_s - float(begin[known[-1]])
    if missing_s > max(_MISSING_S, _MISSING * total_s):
        raise RecordError(
            f"{run.log.source}: completed at line {run.line[-1]} of the {run.timed.line_count} lines of "
            f"{run.entry.program.name}, {missing_s:.0f} s before its end: log and program do not belong together"
        )
    if float(begin[known[0]]) - float(run.time_s[known[0]]) > max(_MISSING_S, _MISSING * total_s):
        notes.append(f"begins at line {run.line[known[0]]}, in the middle of the program: the run is incomplete")
        return False
    return True


def _require_same(run: ObservedRun, starts: FloatArray) -> None:
    """Check that modelled times between reported lines correlate with those of the log."""
    begin = starts[run.line]
    known = np.isfinite(begin) & ~run.timed.function[run.line]
    if known.sum() < _MIN_BLOCKS:
        return
    expected, seen = np.diff(begin[known]), np.diff(run.time_s[known])
    groups = max(4, len(expected) // 6)
    edges = np.linspace(0, len(expected), groups + 1).astype(int)[:-1]
    one, other = np.log(np.add.reduceat(expected, edges) + 0.05), np.log(np.add.reduceat(seen, edges) + 0.05)
    if np.std(one) < 0.15:
        return
    agreement = float(np.corrcoef(one, other)[0, 1])
    if agreement < 0.3:
        raise RecordError(
            f"{run.log.source}: times of its lines do not match those of {run.entry.program.name} "
            f"(correlation {agreement:.2f} over {groups} parts, at least 0.3 is expected): log and program do not "
            "belong together"
        )


_LIMITED = 0.9  # ratio to the programmed feed below which something else limits the speed
_MIN_ARC_READINGS = 12
_DIALS = (1.0, 0.75, 0.5, 0.25, 0.1, 0.05)  # usual settings of the rapid override


def _shown_feeds(run: ObservedRun) -> tuple[IntArray, FloatArray]:
    """Lines with a logged feed, and the feed, mm/s; empty if its unit is unknown."""
    if run.log.feed is None or not math.isfinite(run.feed_unit_mm_per_s):
        return np.empty(0, dtype=np.int64), np.empty(0)
    return lines_at(run.log.feed, run.log, run.timed), run.log.feed.value * run.feed_unit_mm_per_s


def seen_arc_acceleration(runs: Sequence[ObservedRun]) -> float:
    """Limit of centripetal acceleration by the logged feeds in arcs, mm/s²: v²/r where v is below F; NaN: unknown."""
    found: list[FloatArray] = []
    for run in runs:
        line, speed = _shown_feeds(run)
        radius, feed = run.timed.arc_radius_mm[line], run.timed.feed_mm_per_s[line]
        inside = np.isfinite(radius) & np.isfinite(feed) & (speed > 0.0)
        for each, programmed in set(zip(np.round(radius[inside], 1), feed[inside], strict=True)):
            group = inside & (np.round(radius, 1) == each) & (feed == programmed)
            # A reading may be at a corner or on a ramp: the steady speed is the one rarely exceeded.
            top = float(np.percentile(speed[group], 90))
            if group.sum() >= _MIN_READINGS and top < _LIMITED * programmed:
                found.append(np.full(int(group.sum()), top**2 / float(np.median(radius[group]))))
    every = np.concatenate(found) if found else np.empty(0)
    return float(np.median(every)) if len(every) >= _MIN_ARC_READINGS else math.nan


def rapid_rate(runs: Sequence[ObservedRun]) -> tuple[float, list[ObservedRun]]:
    """Rapid rate, mm/s, from the logged feeds of rapids (NaN: unknown); and the runs, each with its rapid override."""
    shown = {id(run): _shown_rate(run) for run in runs}
    plateaus = [plateau for plateau, _ in shown.values() if math.isfinite(plateau)]
    if not plateaus:
        return math.nan, [with_override(run, math.nan) for run in runs]
    top = max(plateaus)
    fastest = max(single for _, single in shown.values())
    stated = [run for run in runs if math.isfinite(run.rapid_override) and math.isfinite(shown[id(run)][0])]
    rate = top
    if stated:
        rate = float(np.median([shown[id(run)][0] / run.rapid_override for run in stated if run.rapid_override > 0]))
    elif fastest > 1.05 * top:
        rate = next((top / dial for dial in _DIALS if top / dial >= 0.98 * fastest), fastest)
    return rate, [with_override(run, rate) for run in runs]


def with_override(run: ObservedRun, rate_mm_per_s: float) -> ObservedRun:
    """A run with its rapid override: as stated, else from its rapids, else 1."""
    if math.isfinite(run.rapid_override):
        return run
    ratio = _shown_rate(run)[0] / rate_mm_per_s
    override = to_whole_percent(min(1.0, ratio)) if math.isfinite(ratio) else 1.0
    notes = (*run.notes, f"rapid override {override:.0%} by its rapids") if override < 0.99 else run.notes
    return replace(run, rapid_override=override, notes=notes)


def _shown_rate(run: ObservedRun) -> tuple[float, float]:
    """Steady feed of rapids, and the highest feed along Z alone, mm/s; NaN and 0 if not found."""
    line, speed = _shown_feeds(run)
    moving = np.isnan(run.timed.feed_mm_per_s[line]) & (line > 0)
    value = speed[moving]
    if not len(value):
        return math.nan, 0.0
    alone = value[_along_z(run.timed)[line[moving]]]
    ordered = np.sort(value[value > 0.3 * value.max()])
    count = np.searchsorted(ordered, ordered * 1.003, side="right") - np.arange(len(ordered))
    steady = np.flatnonzero(count >= _MIN_READINGS)
    plateau = float(np.median(ordered[steady[np.argmax(count[steady])] :][: count.max()])) if len(steady) else math.nan
    return plateau, float(alone.max()) if len(alone) else 0.0


def _along_z(timed: TimedProgram) -> npt.NDArray[np.bool_]:
    """Mask of lines whose only axis word is Z."""
    alone = np.zeros(timed.line_count + 2, dtype=bool)
    for number, words in enumerate(timed.text_lines[: timed.line_count], start=1):
        alone[number] = set(words.split("(")[0].upper()) & set("XYZ") == {"Z"}
    return alone
