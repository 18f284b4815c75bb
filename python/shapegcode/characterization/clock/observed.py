"""A log laid beside its program: when each line began, at which overrides."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from shapegcode.characterization.clock.played import PlayedProgram
from shapegcode.characterization.clock.readings import (
    Stretch,
    feed_unit,
    held_longest,
    line_numbers,
    lines_at,
    stretches_of,
)
from shapegcode.characterization.runs_file import RunEntry
from shapegcode.errors import RecordError
from shapegcode.io.run_log import RunLog
from shapegcode.machine import Machine
from shapegcode.model.controller import controller_model

__all__ = ["ObservedRun", "observe"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_LEAST_BLOCKS = 8
_MISSING_S, _MISSING = 15.0, 0.15  # of a program: more than a machine's own times explain
_LEAST_RISING = 0.9  # of the reported lines


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
        whole: whether the log begins where the program does.
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
    whole: bool = True

    @property
    def duration_s(self) -> float | None:
        """From start to completion; None: the log does not hold both."""
        return self.log.duration_s if self.log.complete and self.whole else None

    @property
    def feed_overrides(self) -> tuple[float, ...]:
        """Each that was used, once."""
        return tuple(sorted({stretch.feed_override for stretch in self.stretches} | {1.0}))


def observe(entry: RunEntry, log: RunLog, played: PlayedProgram, machine: Machine) -> ObservedRun:
    """Lay a log beside its program."""
    notes = list(log.notes)
    time_s, line = _lines(entry, log, played, notes)
    _compare_tools(entry, log, played, notes)
    unit = feed_unit(entry, log, played)
    stretches = tuple(stretches_of(entry, log, played, unit, notes))
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
    starts = played.starts(controller_model(machine))  # by the machine's own limits, before anything is learned
    whole = _is_whole(run, starts, notes)
    _require_same(run, starts)
    return replace(run, whole=whole, notes=tuple(notes))


def _stated_rapid_override(entry: RunEntry, log: RunLog) -> float:
    if entry.rapid_override_percent is not None:
        return entry.rapid_override_percent / 100.0
    if log.rapid_override is not None and len(log.rapid_override):
        # The dial may be turned for a moment, at the start mostly: what held longest counts.
        return held_longest(log.rapid_override, log.duration_s) or math.nan
    return math.nan


def _lines(entry: RunEntry, log: RunLog, played: PlayedProgram, notes: list[str]) -> tuple[FloatArray, IntArray]:
    """Times and lines of what was reported, never falling."""
    line = line_numbers(log, played)
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
    # What is reported before the first block is of the run before; single readings may be wrong.
    rises = _rising(line)
    if np.mean(rises) < _LEAST_RISING:
        back = int(np.flatnonzero(~rises)[0])
        raise RecordError(
            f"{where}: {np.mean(~rises):.0%} of the reported lines go back (line {line[back]} after "
            f"{time_s[back]:.1f} s is out of order): log and program do not belong together, or it repeats parts of "
            "itself, which cannot be laid beside a log by line numbers"
        )
    if not rises.all():
        notes.append(f"{int(np.sum(~rises))} reported lines are out of order and left out")
    time_s, line = time_s[rises], line[rises]
    first = np.concatenate([[True], np.diff(line) > 0])
    return np.asarray(time_s[first], dtype=np.float64), np.asarray(line[first], dtype=np.int64)


def _compare_tools(entry: RunEntry, log: RunLog, played: PlayedProgram, notes: list[str]) -> None:
    """The tools that the log names must be those that the program calls there; numbers of another kind are noted."""
    if log.tool is None:
        return
    called = {int(tool) for tool in played.tools if tool >= 0}
    line = lines_at(log.tool, log, played)
    wrong = []
    for value, at in zip(log.tool.value.tolist(), line.tolist(), strict=True):
        # The number changes within the block that changes the tool.
        here = {int(tool) for tool in played.tools[max(at - 2, 0) : at + 3] if tool >= 0}
        if value > 0.0 and at > 0 and here and int(value) not in here:
            wrong.append((int(value), at, here))
    if not wrong:
        return
    value, at, here = wrong[0]
    said = f"tool {value} in the spindle at line {at}, where the program has T{min(here)}"
    if len(wrong) > 1 and all(each[0] in called for each in wrong):
        raise RecordError(f"{log.source}: {said}: it is not the log of {entry.program.name} as it stands")
    notes.append(f"{said}: numbers of another kind, or of a tool that was there before the start")


def _rising(line: IntArray) -> npt.NDArray[np.bool_]:
    """Which values belong to the longest row that never falls."""
    ends: list[int] = []  # value at which the best row of each length ends
    places: list[int] = []  # and where
    before = np.full(len(line), -1, dtype=np.int64)
    for index, value in enumerate(line.tolist()):
        length = bisect_right(ends, value)
        if length == len(ends):
            ends.append(value)
            places.append(index)
        else:
            ends[length] = value
            places[length] = index
        before[index] = places[length - 1] if length > 0 else -1
    kept = np.zeros(len(line), dtype=bool)
    at = places[-1] if places else -1
    while at >= 0:
        kept[at] = True
        at = int(before[at])
    return kept


def _is_whole(run: ObservedRun, starts: FloatArray, notes: list[str]) -> bool:
    """Whether the log begins where the program does."""
    begin, total_s = starts[run.line], float(starts[-1])
    known = np.flatnonzero(np.isfinite(begin))
    if not len(known) or run.log.duration_s is None:
        return True
    missing_s = total_s - float(begin[known[-1]])
    if missing_s > max(_MISSING_S, _MISSING * total_s):
        raise RecordError(
            f"{run.log.source}: completed at line {run.line[-1]} of the {run.played.line_count} lines of "
            f"{run.entry.program.name}, {missing_s:.0f} s before its end: log and program do not belong together"
        )
    if float(begin[known[0]]) - float(run.time_s[known[0]]) > max(_MISSING_S, _MISSING * total_s):
        notes.append(f"begins at line {run.line[known[0]]}, in the middle of the program: the run is not whole")
        return False
    return True


def _require_same(run: ObservedRun, starts: FloatArray) -> None:
    """The way that the program goes between the reported lines must take time where the log says that it did."""
    begin = starts[run.line]
    known = np.isfinite(begin) & ~run.played.function[run.line]
    if known.sum() < _LEAST_BLOCKS:
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
            f"{run.log.source}: its lines do not take the time that those of {run.entry.program.name} need "
            f"(correlation {agreement:.2f} over {groups} stretches, at least 0.3 is expected): log and program do not "
            "belong together"
        )
