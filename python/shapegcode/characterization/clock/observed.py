"""A log laid beside its program: when each line began, at which overrides, where the machine was held."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.characterization.runs_file import RunEntry
from shapegcode.errors import RecordError
from shapegcode.io.run_log import RunLog, Signal
from shapegcode.io.units import find_unit
from shapegcode.machine import Machine
from shapegcode.program import Program

__all__ = [
    "ObservedRun",
    "PlayedProgram",
    "Stretch",
    "observe",
    "played_program",
    "rapid_rate",
    "seen_arc_acceleration",
]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

FEED_UNITS = {"mm/s": 1.0, "mm/min": 1.0 / 60.0, "m/min": 1000.0 / 60.0, "in/min": 25.4 / 60.0, "in/s": 25.4}
"""mm/s of the units that controls show a feed in."""

_LEAST_BLOCKS = 8
_FEED_BIN = 0.0025  # of the programmed feed: readings of a steady feed agree better
_LEAST_READINGS = 4
_LIMITED = 0.9  # of the programmed feed: below it something else than the program sets the speed
_LEAST_ARC_READINGS = 12
_LEAST_SHARE = 0.06
_LEAST_ARC_MM = 0.5
_GENTLE_MM_PER_S2 = 100.0  # across the path: no machining centre slows down for it
_DIALS = (1.0, 0.75, 0.5, 0.25, 0.1, 0.05)  # where a dial of rapids usually stands


@dataclass(frozen=True, eq=False)
class PlayedProgram:
    """A program as the clock sees it.

    Attributes:
        program: what was read.
        line_count: of the text that the control runs.
        feed_mm_per_s: (line_count + 2,) programmed feed of a line's last cut, by its number; NaN where it does not cut.
        arc_radius_mm: (line_count + 2,) radius of a line's arc, where it turns by more than a sixth of a circle and is
            long enough to be run steadily; infinity elsewhere.
        free: (line_count + 2,) whether no machine has to go slower there for the sake of an arc.
        rapid: (line_count + 2,) whether it moves in rapid.
        function: (line_count + 2,) whether it holds M, S or T words, or a way that is not known.
        sections: (first line, last line) of the stretches without functions.
    """

    program: Program
    line_count: int
    feed_mm_per_s: FloatArray
    arc_radius_mm: FloatArray
    free: npt.NDArray[np.bool_]
    rapid: npt.NDArray[np.bool_]
    function: npt.NDArray[np.bool_]
    sections: tuple[tuple[int, int], ...]

    @cached_property
    def tools(self) -> IntArray:
        """(line_count + 2,) Tool in use at a line, -1: not known."""
        tool = np.full(self.line_count + 2, -1, dtype=np.int64)
        selected, functions = -1, self.program.core.functions
        for kind, index, line in self.program.core.steps:
            if kind == _core.StepKind.function:
                codes, asked, _ = functions[index]
                selected = asked if asked >= 0 else selected
                if 6 in codes:
                    tool[line:] = selected
        return tool


@dataclass(frozen=True)
class Stretch:
    """A section of a run without functions.

    Attributes:
        lines: first and last.
        feed_override: ratio at which it was cut.
        measured: whether that was seen in the log, else it is taken from the run or as 1.
    """

    lines: tuple[int, int]
    feed_override: float
    measured: bool


@dataclass(frozen=True, eq=False)
class ObservedRun:
    """One run of a program, as far as its log tells.

    Attributes:
        name: program and log.
        played: the program.
        log: what was read.
        entry: what the file of runs says of it.
        time_s: (n,) when the control first reported a line, since the start.
        line: (n,) the line, never falling.
        stretches: sections with their feed overrides.
        rapid_override: ratio of the rapid rates.
        feed_unit_mm_per_s: what one unit of the logged feed is; NaN without a feed.
        notes: what was found and bridged.
    """

    name: str
    played: PlayedProgram
    log: RunLog
    entry: RunEntry
    time_s: FloatArray
    line: IntArray
    stretches: tuple[Stretch, ...]
    rapid_override: float
    feed_unit_mm_per_s: float
    notes: tuple[str, ...]

    @property
    def duration_s(self) -> float | None:
        """From start to completion; None: the log does not hold both."""
        return self.log.duration_s if self.log.complete else None

    @property
    def feed_overrides(self) -> tuple[float, ...]:
        """Each that was used, once."""
        return tuple(sorted({stretch.feed_override for stretch in self.stretches} | {1.0}))


def played_program(program: Program) -> PlayedProgram:
    """What the clock needs of a program.

    Args:
        program: what was read; lines count as its plain text does.

    Returns:
        Feeds, rapids and functions by line.
    """
    core = program.core
    count = core.line_count
    feed = np.full(count + 2, np.nan)
    radius = np.full(count + 2, np.inf)
    free = np.zeros(count + 2, dtype=bool)
    rapid = np.zeros(count + 2, dtype=bool)
    function = np.zeros(count + 2, dtype=bool)
    for region in program.regions:
        for index in range(len(region.path)):
            segment = region.path[index]
            feed[segment.line_number] = segment.feed_mm_per_s
            if segment.length_mm > max(_LEAST_ARC_MM, _radius_mm(segment)):
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
    return PlayedProgram(program, count, feed, radius, free, rapid, function, tuple(_sections(function, count)))


def _radius_mm(segment: _core.Segment) -> float:
    if segment.kind != _core.SegmentKind.arc:
        return math.inf
    return float(np.linalg.norm(np.asarray(segment.start_mm) - np.asarray(segment.centre_mm)))


def _sections(function: npt.NDArray[np.bool_], count: int) -> list[tuple[int, int]]:
    found: list[tuple[int, int]] = []
    first = 1
    for line in range(1, count + 2):
        if line > count or function[line]:
            if line - first > 1:
                found.append((first, line - 1))
            first = line + 1
    return found


def observe(entry: RunEntry, log: RunLog, played: PlayedProgram, machine: Machine) -> ObservedRun:
    """Lay a log beside its program.

    Args:
        entry: of the file of runs.
        log: one run.
        played: its program.
        machine: with which the program was read.

    Returns:
        When each line began, and the overrides.

    Raises:
        RecordError: they do not belong together; the message says why.
    """
    notes = list(log.notes)
    time_s, line = _lines(entry, log, played, notes)
    unit = _feed_unit(entry, log, played)
    stretches = tuple(_stretches(entry, log, played, unit, notes))
    run = ObservedRun(
        name=f"{entry.program.stem} ({log.source.rsplit('/', 1)[-1]})",
        played=played,
        log=log,
        entry=entry,
        time_s=time_s,
        line=line,
        stretches=stretches,
        rapid_override=_stated_rapid_override(entry, log),
        feed_unit_mm_per_s=unit,
        notes=tuple(notes),
    )
    _require_same(run, machine)
    return run


def _stated_rapid_override(entry: RunEntry, log: RunLog) -> float:
    if entry.rapid_override_percent is not None:
        return entry.rapid_override_percent / 100.0
    if log.rapid_override is not None and len(log.rapid_override):
        # The dial may be turned for a moment, at the start mostly: what held longest counts.
        return _longest(log.rapid_override, log.duration_s) or math.nan
    return math.nan


def _longest(signal: Signal, end_s: float | None) -> float:
    """The value that a signal had for the longest time."""
    held: dict[float, float] = defaultdict(float)
    until = np.append(signal.time_s[1:], end_s if end_s is not None else signal.time_s[-1])
    for value, begin, end in zip(signal.value, signal.time_s, until, strict=True):
        held[round(float(value), 3)] += max(0.0, float(end - begin))
    return max(held, key=lambda value: held[value])


def _lines(entry: RunEntry, log: RunLog, played: PlayedProgram, notes: list[str]) -> tuple[FloatArray, IntArray]:
    """Times and lines of what was reported, never falling."""
    line = _line_numbers(log, played)
    time_s = log.block.time_s
    within = (line >= 1) & (line <= played.line_count)
    above = line[line > played.line_count]
    where = f"{log.source}: {entry.program.name}"
    if len(above) > 0.02 * len(line):
        raise RecordError(
            f"{where} has {played.line_count} lines, and the log reports line {int(above.max())}: log and program do "
            "not belong together"
        )
    time_s, line = time_s[within], line[within]
    if len(line) < _LEAST_BLOCKS:
        raise RecordError(f"{where}: the log reports {len(line)} lines of it; {_LEAST_BLOCKS} are needed")
    # What was reported before the start key is of the run before.
    highest = np.maximum.accumulate(line)
    rises = line >= highest
    if np.mean(rises) < 0.9:
        raise RecordError(
            f"{where}: {np.mean(~rises):.0%} of the reported lines go back (the first after {time_s[~rises][0]:.1f} s: "
            f"{line[~rises][0]} behind {highest[~rises][0]}): log and program do not belong together, or it repeats "
            "parts of itself, which cannot be laid beside a log by line numbers"
        )
    if not rises.all():
        notes.append(f"{int(np.sum(~rises))} reported lines go back and are left out")
    time_s, line = time_s[rises], line[rises]
    first = np.concatenate([[True], np.diff(line) > 0])
    return np.asarray(time_s[first], dtype=np.float64), np.asarray(line[first], dtype=np.int64)


def _line_numbers(log: RunLog, played: PlayedProgram) -> IntArray:
    """Lines of the text from what the log counts."""
    value = np.asarray(log.block.value, dtype=np.int64)
    if log.block_counts == "line":
        return value
    places: dict[int, list[int]] = defaultdict(list)
    for number, text in enumerate(played.program.core.text.splitlines(), start=1):
        words = text.lstrip(b" /" if isinstance(text, bytes) else " /")
        head = words.decode("latin-1") if isinstance(words, bytes) else words
        if head[:1] in "Nn" and (digits := head[1:8]):
            sequence = ""
            for letter in digits:
                if not letter.isdigit():
                    break
                sequence += letter
            if sequence:
                places[int(sequence)].append(number)
    found, at = np.zeros(len(value), dtype=np.int64), 0
    for index, sequence_number in enumerate(value.tolist()):
        ahead = [place for place in places.get(sequence_number, []) if place >= at]
        if ahead:
            at = found[index] = ahead[0]
    return found


def _current(signal: Signal, blocks: Signal, line: IntArray) -> IntArray:
    """Line that was reported when a value came; 0 before the first."""
    at = np.searchsorted(blocks.time_s, signal.time_s, side="right") - 1
    return np.where(at >= 0, line[np.maximum(at, 0)], 0)


def _feed_unit(entry: RunEntry, log: RunLog, played: PlayedProgram) -> float:
    """mm/s of one unit of the logged feed: as stated, else the one in which steady cuts run as programmed."""
    if log.feed is None or len(log.feed) < _LEAST_READINGS:
        return math.nan
    stated = entry.feed_unit or log.feed_unit
    if stated is not None:
        unit = find_unit(stated)
        if unit is not None:
            return float(unit.factor) * 1000.0
    line = np.clip(_current(log.feed, log.block, _line_numbers(log, played)), 0, played.line_count + 1)
    ratio = log.feed.value / played.feed_mm_per_s[line]
    ratio = ratio[np.isfinite(ratio) & (ratio > 0.0)]
    steady = _mode(np.log(ratio)) if len(ratio) else None
    if steady is None:
        return math.nan
    # An override is between a half and twice the programmed feed: units lie further apart.
    best = min(FEED_UNITS.values(), key=lambda unit: abs(steady + math.log(unit)))
    if abs(steady + math.log(best)) > math.log(2.0):
        raise RecordError(
            f"{log.source}: steady feeds of {entry.program.name} are {math.exp(steady):.4g} times the programmed ones "
            f"in mm/s: no unit of {', '.join(FEED_UNITS)} makes that an override of 50 to 200 %; the log is of another "
            "program, or feed_unit must be stated"
        )
    return best


def _mode(values: FloatArray) -> float | None:
    """Where values heap up within a bin, at their upper heap if there are several; None if nowhere."""
    ordered = np.sort(values)
    upto = np.searchsorted(ordered, ordered + _FEED_BIN, side="right")
    count = upto - np.arange(len(ordered))
    most = int(count.max())
    if most < _LEAST_READINGS or most < _LEAST_SHARE * len(values):
        return None
    at = int(np.argmax(count))
    return float(np.median(ordered[at : at + most]))


def _stretches(entry: RunEntry, log: RunLog, played: PlayedProgram, unit: float, notes: list[str]) -> list[Stretch]:
    """Feed override of each section: what steady cuts show, else what is stated, else that of the run, else 1."""
    ratio = np.empty(0)
    line = np.empty(0, dtype=np.int64)
    if log.feed is not None and math.isfinite(unit):
        line = np.clip(_current(log.feed, log.block, _line_numbers(log, played)), 0, played.line_count + 1)
        ratio = log.feed.value * unit / played.feed_mm_per_s[line]
        # A control shows feeds in steps: where one is much of the feed, it tells nothing.
        fine = played.feed_mm_per_s[line] * _FEED_BIN > _step_of(log.feed.value) * unit
        keep = np.isfinite(ratio) & (ratio > 0.2) & (ratio < 2.5) & played.free[line] & fine
        ratio, line = ratio[keep], line[keep]
    whole = _mode(ratio) if len(ratio) else None
    stated = entry.override_percent / 100.0 if entry.override_percent is not None else None
    if stated is None and log.feed_override is not None and len(log.feed_override):
        stated = _longest(log.feed_override, log.duration_s)
    found = []
    for first, last in played.sections:
        inside = ratio[(line >= first) & (line <= last)]
        seen = _mode(inside) if len(inside) else None
        fallback = stated if stated is not None else whole
        value = seen if seen is not None else fallback if fallback is not None else 1.0
        found.append(Stretch((first, last), _rounded(value), seen is not None))
    used = sorted({stretch.feed_override for stretch in found if stretch.measured})
    if any(abs(value - 1.0) > 0.005 for value in used):
        notes.append("feed override " + ", ".join(f"{value:.1%}" for value in used) + " as steady cuts show")
    if ratio.size == 0 and stated is None:
        notes.append("no feed in the log: overrides cannot be told and are taken as 100 %")
    return found


def seen_arc_acceleration(runs: Sequence[ObservedRun]) -> float:
    """What the feeds shown in arcs say of the largest acceleration across the path: v²/r where v is below the feed.

    Args:
        runs: of the machine.

    Returns:
        mm/s²; NaN: no arc was run below its feed often enough.
    """
    found: list[FloatArray] = []
    for run in runs:
        log, played = run.log, run.played
        if log.feed is None or not math.isfinite(run.feed_unit_mm_per_s):
            continue
        line = np.clip(_current(log.feed, log.block, _line_numbers(log, played)), 0, played.line_count + 1)
        speed = log.feed.value * run.feed_unit_mm_per_s
        radius = played.arc_radius_mm[line]
        feed = played.feed_mm_per_s[line]
        inside = np.isfinite(radius) & np.isfinite(feed) & (speed > 0.0)
        for each, programmed in {
            (round(float(r), 1), float(f)) for r, f in zip(radius[inside], feed[inside], strict=True)
        }:
            group = inside & (np.round(radius, 1) == each) & (feed == programmed)
            # A reading may fall upon a corner or a ramp: the steady speed is the one that is hardly passed.
            top = float(np.percentile(speed[group], 90))
            if group.sum() >= _LEAST_READINGS and top < _LIMITED * programmed:
                found.append(np.full(int(group.sum()), top**2 / float(np.median(radius[group]))))
    every = np.concatenate(found) if found else np.empty(0)
    return float(np.median(every)) if len(every) >= _LEAST_ARC_READINGS else math.nan


def _step_of(values: FloatArray) -> float:
    """Smallest step between the values of a signal."""
    steps = np.diff(np.unique(values))
    return float(steps.min()) if len(steps) else 0.0


def _rounded(ratio: float) -> float:
    """As a dial has it: whole percents where they are within what a reading means."""
    whole = round(ratio, 2)
    return whole if abs(ratio - whole) < 0.002 else round(ratio, 4)


def rapid_rate(runs: list[ObservedRun], machine: Machine) -> tuple[float, list[ObservedRun], str]:
    """Rapid rate of the machine and the override of each run, from the feeds that its logs show in rapids.

    A rate shows as the highest feed that returns again and again. Where runs show several, the highest one, or one that
    a usual place of the dial makes of it, is the machine's.

    Args:
        runs: of the machine.
        machine: whose rates hold where no log shows any.

    Returns:
        The rate in mm/s (NaN: no log shows one), the runs with their overrides, and what was found, in words.
    """
    shown = {id(run): _shown_rate(run) for run in runs}
    plateaus = [plateau for plateau, _ in shown.values() if math.isfinite(plateau)]
    if not plateaus:
        return math.nan, [_with_rapids(run, 1.0) for run in runs], "no log shows a rapid at its rate"
    top = max(plateaus)
    fastest = max(single for _, single in shown.values())
    stated = [run for run in runs if math.isfinite(run.rapid_override) and math.isfinite(shown[id(run)][0])]
    rate = top
    if stated:
        rate = float(np.median([shown[id(run)][0] / run.rapid_override for run in stated if run.rapid_override > 0]))
    elif fastest > 1.05 * top:
        rate = next((top / dial for dial in _DIALS if top / dial >= 0.98 * fastest), fastest)
    found, said = [], []
    for run in runs:
        plateau = shown[id(run)][0]
        if math.isfinite(run.rapid_override):
            found.append(run)
            continue
        override = min(1.0, plateau / rate) if math.isfinite(plateau) else 1.0
        override = _rounded(override)
        if override < 0.99:
            said.append(f"{run.name}: rapids at {override:.0%}")
        found.append(_with_rapids(run, override))
    return rate, found, "; ".join(said)


def _with_rapids(run: ObservedRun, override: float) -> ObservedRun:
    notes = (*run.notes, f"rapid override {override:.0%} as its rapids show") if override < 0.99 else run.notes
    return replace(run, rapid_override=override, notes=notes)


def _shown_rate(run: ObservedRun) -> tuple[float, float]:
    """Feed at which rapids run steadily, and the highest one of a way along Z alone; NaN and 0 where none is seen."""
    log, played = run.log, run.played
    if log.feed is None or not math.isfinite(run.feed_unit_mm_per_s):
        return math.nan, 0.0
    line = np.clip(_current(log.feed, log.block, _line_numbers(log, played)), 0, played.line_count + 1)
    moving = np.isnan(played.feed_mm_per_s[line]) & (line > 0)
    value = log.feed.value[moving] * run.feed_unit_mm_per_s
    if not len(value):
        return math.nan, 0.0
    single = _along_z(played)[line[moving]]
    alone = value[single]
    high = value[value > 0.3 * value.max()]
    ordered = np.sort(high)
    upto = np.searchsorted(ordered, ordered * 1.003, side="right")
    count = upto - np.arange(len(ordered))
    steady = np.flatnonzero(count >= _LEAST_READINGS)
    plateau = float(np.median(ordered[steady[np.argmax(count[steady])] :][: count.max()])) if len(steady) else math.nan
    return plateau, float(alone.max()) if len(alone) else 0.0


def _along_z(played: PlayedProgram) -> npt.NDArray[np.bool_]:
    """Lines whose only axis word is Z."""
    alone = np.zeros(played.line_count + 2, dtype=bool)
    text = played.program.core.text
    lines = text.decode("latin-1").splitlines() if isinstance(text, bytes) else text.splitlines()
    for number, words in enumerate(lines[: played.line_count], start=1):
        plain = words.split("(")[0].upper()
        alone[number] = "Z" in plain and "X" not in plain and "Y" not in plain
    return alone


def _require_same(run: ObservedRun, machine: Machine) -> None:
    """The way that the program goes between the reported lines must take time where the log says that it did.

    Raises:
        RecordError: it does not: the log is of another program.
    """
    from shapegcode.model.controller import controller_model

    rows = _core.time_program(run.played.program.core, controller_model(machine), True).blocks
    begin = np.full(run.played.line_count + 2, np.nan)
    begin[rows["line"][::-1]] = rows["start_s"][::-1]
    known = np.isfinite(begin[run.line]) & ~run.played.function[run.line]
    if known.sum() < _LEAST_BLOCKS:
        return
    expected, seen = np.diff(begin[run.line][known]), np.diff(run.time_s[known])
    groups = max(4, len(expected) // 6)
    edges = np.linspace(0, len(expected), groups + 1).astype(int)[:-1]
    one, other = np.log(np.add.reduceat(expected, edges) + 0.05), np.log(np.add.reduceat(seen, edges) + 0.05)
    if np.std(one) < 0.15:
        return
    agreement = float(np.corrcoef(one, other)[0, 1])
    if agreement < 0.3:
        raise RecordError(
            f"{run.log.source}: its lines do not take the time that those of {run.entry.program.name} need "
            f"(correlation {agreement:.2f} over {groups} stretches, at least 0.3 is expected): log and program do not "
            "belong together"
        )
