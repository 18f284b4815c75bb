"""Cycle time of a program on a machine, and its parts, in closed form and by full interpolation.

The closed form is by Lee, Ro, Song and Oh, 2022 (paper 004) for acceleration after interpolation; with look-ahead it
is the planner's. Full interpolation checks it.
"""

from __future__ import annotations

import math
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, pairwise
from pathlib import Path
from typing import Any

import numpy.typing as npt

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.machine_model import fanuc_model
from shapegcode.model.programs import SimulatedPrograms, shaped_warnings
from shapegcode.program import Program, given_program
from shapegcode.program.stamp import OVERRIDE_LOCKED
from shapegcode.timing.result import PARTS, BlockTime, CycleTime, LogNext, OpenPart, RegionTime, ToolTime

_KINDS = {kind.value: name for name, kind in _core.BlockKind.__members__.items()}
_CUTTING, _RAPID = _core.BlockKind.cutting.value, _core.BlockKind.rapid.value

_MAX_OVERRIDE = 2.54  # of controls whose switch has eight bits


def cycle_time(
    program: Program | str | Path,
    machine: Machine | str | Path,
    *,
    per_block: bool = False,
    full: bool = True,
    feed_override: float | None = None,
    rapid_override: float | None = None,
    log_next: Sequence[Program | str | Path] = (),
) -> CycleTime:
    """Compute the cycle time of a program as it is, without shaping.

    Shaped regions of an emitted program (by its header) are timed block by block at their feed, with the slower rule
    of block timing, as in `convert`; if the control's planner cannot be switched off, that planner times them.

    Of a move of an axis with unknown position (before its first absolute word, after M06, G28, G53) the known part
    is timed; for the rest of a rapid `times.unknown_move_s` is added.

    Args:
        program: the program, or its file.
        machine: whose controller simulates it.
        per_block: fill `CycleTime.blocks` too.
        full: check the closed form by full interpolation.
        feed_override: scales every programmed feed; None: the shop's usual one
            (`times.feed_override_percent`).
        rapid_override: scales the rapid rates; None: likewise.
        log_next: programs, or their files, that could be logged next; gives the interval that would remain after each.

    Returns:
        The total time in s, by part, tool, region and, if requested, block; with its 95 % interval
        if the machine was calibrated with run logs.

    Raises:
        ArgumentError: an invalid controller value, an override at which full interpolation would take the
            program beyond `controller.max_program_s`, one above 254 %, or `log_next` with an uncalibrated machine.
        ProgramError, OSError: a program cannot be read.
    """
    machine = Machine.of(machine)
    program = given_program(program, machine)
    if feed_override is None:
        feed_override = machine.times.feed_override_percent / 100.0
    if rapid_override is None:
        rapid_override = machine.times.rapid_override_percent / 100.0
    if (largest := max(feed_override, rapid_override)) > _MAX_OVERRIDE:
        raise _core.ArgumentError(f"override {largest:g}: a ratio of at most {_MAX_OVERRIDE:g} (0.5 is 50 %)")
    model = fanuc_model(machine, feed_override=feed_override, rapid_override=rapid_override)
    timed = _core.time_program(program.core, model, per_block)
    slowest, limit_s = min(feed_override, rapid_override, 1.0), machine.controller.max_program_s
    if full and slowest < 1.0 and timed.total_s > limit_s:
        raise _core.ArgumentError(
            f"{program.source}: takes {timed.total_s:.0f} s with feeds at {feed_override:.4g} and rapids at "
            f"{rapid_override:.4g} of the programmed ones, and at most {limit_s:.10g} s are interpolated "
            "(controller.max_program_s); only the closed form has no limit (--no-full)"
        )
    interval = time_interval(program, machine, feed_override, rapid_override)
    if log_next and interval is None:
        raise _core.ArgumentError(
            f"{machine.name} has no times.scatter: the effect of a log is known only for a machine "
            "calibrated with run logs (shapegcode characterize --runs)"
        )
    others = [given_program(each, machine) for each in log_next]
    return CycleTime(
        **_parts(timed),
        cycle_time_s=float(timed.total_s),
        program=program.source,
        machine=machine.name,
        total_low_s=max(0.0, timed.total_s - interval.half_width_s) if interval else None,
        total_high_s=timed.total_s + interval.half_width_s if interval else None,
        interval_parts=interval.parts() if interval else (),
        narrowed_by=interval.narrowed_by() if interval else None,
        log_next=_log_next(interval, others, machine, (feed_override, rapid_override)),
        full_interpolation_s=_core.interpolate_program(program.core, model).total_s if full else None,
        tools=tuple(
            ToolTime(
                **_parts(each),
                duration_s=float(each.total_s),
                tool=each.tool if each.tool >= 0 else None,
                first_line=each.first_line,
            )
            for each in timed.tools
        ),
        regions=tuple(_regions(timed.regions, program, feed_override)),
        blocks=tuple(_blocks(timed.blocks, program)) if per_block else (),
        shaped_regions=program.shaped_regions,
        warnings=(
            *program.warnings,
            *(why for _, why in shaped_warnings(program, machine)),
            *_locked(program, feed_override),
        ),
        simulated=SimulatedPrograms(program, machine, labels=("program", "")),
    )


def _log_next(
    interval: TimeInterval | None, programs: Sequence[Program], machine: Machine, overrides: tuple[float, float]
) -> tuple[LogNext, ...]:
    """For each program alone: the interval that remains once its run has been logged; the smallest first."""
    found = [(program.source, time_interval(program, machine, *overrides)) for program in programs]
    left = [LogNext(name, interval.after_logging(other)) for name, other in found if interval and other]
    return tuple(sorted(left, key=lambda each: each.half_width_s))


def _locked(program: Program, feed_override: float) -> Iterator[str]:
    """Warn if the times of shaped moves include an override that the control ignores there."""
    locked = program.shaped_regions and f"({OVERRIDE_LOCKED.comment})".encode() in program.own_text
    if locked and feed_override != 1.0:
        yield (
            f"the program switches the feed override off in its shaped regions ({program.shaped_regions}), which the "
            f"control runs at 100 %; here timed at {feed_override * 100:g} % like all others: their times with "
            "--override 100% are the true ones"
        )


def _parts(timed: _core.CycleTime | _core.ToolTime) -> dict[str, float]:
    return {name: float(getattr(timed, name)) for name in PARTS}


def _regions(rows: npt.NDArray[Any], program: Program, feed_override: float) -> Iterator[RegionTime]:
    programmed: dict[tuple[int, int], deque[float]] = defaultdict(deque)
    for region in program.regions:
        programmed[region.first_line, region.last_line].append(region.path.programmed_time_s / feed_override)
    names = ("start_s", "duration_s", "cutting_s", "acceleration_s", "in_position_s", "length_mm")
    for row in rows:
        times = {name: float(row[name]) for name in names}
        lines, tool = (int(row["first_line"]), int(row["last_line"])), int(row["tool"])
        yield RegionTime(lines, tool if tool >= 0 else None, **times, programmed_s=programmed[lines].popleft())


def _blocks(rows: npt.NDArray[Any], program: Program) -> Iterator[BlockTime]:
    moves = _moves(program)
    columns = (rows[name].tolist() for name in ("line", "kind", "start_s", "duration_s", "feed_mm_per_s"))
    for line, kind, start_s, duration_s, reached in zip(*columns, strict=True):
        queue = moves[line, kind == _RAPID] if kind in (_CUTTING, _RAPID) else None
        length, feed = queue.popleft() if queue else (0.0, 0.0)
        programmed = feed * 60.0 if kind == _CUTTING else None
        mean = length / duration_s * 60.0 if duration_s > 0.0 else 0.0
        yield BlockTime(line, _KINDS[kind], start_s, duration_s, length, programmed, mean, reached * 60.0)


def _moves(program: Program) -> dict[tuple[int, bool], deque[tuple[float, float]]]:
    """Length and programmed feed of the moves of each line, separately for rapids, in order."""
    found: dict[tuple[int, bool], deque[tuple[float, float]]] = defaultdict(deque)
    cuts = (region.path[index] for region in program.regions for index in range(len(region.path)))
    others = (segment for segment, dwell_s in program.core.other_moves if dwell_s <= 0.0)
    for segment in chain(cuts, others):
        rapid = segment.kind == _core.SegmentKind.rapid
        found[segment.line_number, rapid].append((segment.length_mm, segment.feed_mm_per_s))
    return found


_DEVIATIONS = 1.96  # standard deviations of a 95 % interval
_KIND = "kind of look-ahead"
CUTS, BETWEEN, RUNS = "scatter, cuts of a tool", "scatter between cuts", "repeated runs"

# What a program must contain to determine a parameter, by words of the parameter's name; the first match counts.
_REMEDIES = {
    _KIND: "a program unlike those logged, with corners of many angles and moves of many lengths",
    "block is read": "a program with many moves below {move:.2g} mm",
    "acceleration is built up": "a program with many moves below {move:.2g} mm",
    "step of Z": "a program of a surface, in which Z changes its speed from move to move",
    "step of X and Y": "a program with sharp corners at the full feed",
    "at a corner": "a program with corners of many angles at the full feed",
    "corners that are stops": "a program with corners of 1° to 90° at the full feed",
    "in arcs": "a program with small arcs at a high feed",
    "acceleration of Z": "a program that cuts up and down with Z",
    "acceleration of X": "a program with many starts and stops of X and Y",
    "feed is reached": "a program with many starts and stops",
    "rapid": "a program with many rapids, short and long",
    "spindle": "a program with several spindle speeds, each with its M03 and M05",
    "cuts of a tool": "this program itself, or one with the same kind of work",
}


@dataclass(frozen=True)
class TimeInterval:
    """The 95 % interval of a program's time."""

    total_s: float
    mean_move_mm: float  # mean length of its moves in cuts
    steps: Mapping[str, float]  # change of the time by each undetermined direction, s
    scatters: Mapping[str, float]  # standard deviation of scatter that no parameter explains, s

    @property
    def half_width_s(self) -> float:
        """Half of the interval, s."""
        return _half(self.steps.values(), self.scatters.values())

    def parts(self) -> tuple[OpenPart, ...]:
        """Components of the interval, the largest first."""
        found: dict[str, float] = defaultdict(float)
        for name, value in (*self.steps.items(), *self.scatters.items()):
            found[_KIND if name.startswith(_KIND) else name] += value**2
        whole = sum(found.values()) or 1.0
        parts = [OpenPart(name, _DEVIATIONS * math.sqrt(each), each / whole) for name, each in found.items() if each]
        return tuple(sorted(parts, key=lambda part: -part.share))

    def narrowed_by(self) -> str:
        """Kind of program whose log would narrow the interval most; scatter between cuts or runs is left aside."""
        name = next((part.name for part in self.parts() if part.name not in (BETWEEN, RUNS)), CUTS)
        alone = f"a program in which {name} occurs alone"
        return next((text for word, text in _REMEDIES.items() if word in name), alone).format(move=self.mean_move_mm)

    def after_logging(self, other: TimeInterval) -> float:
        """Half of the interval, s, once a run of another program is logged, with its own scatter (least squares)."""
        common = sum(value * other.steps.get(name, 0.0) for name, value in self.steps.items())
        known = sum(value**2 for value in (*other.steps.values(), *other.scatters.values()))
        left = sum(value**2 for value in self.steps.values()) - (common**2 / known if known > 0.0 else 0.0)
        return _half((math.sqrt(max(left, 0.0)),), self.scatters.values())


def _half(*values: Iterable[float]) -> float:
    return _DEVIATIONS * math.sqrt(sum(value**2 for each in values for value in each))


def time_interval(
    program: Program, machine: Machine, feed_override: float, rapid_override: float
) -> TimeInterval | None:
    """Interval of a program's time; None: the machine file holds no calibration scatter."""
    times = machine.times
    if times.scatter is None:
        return None

    def timed(of: Machine) -> _core.CycleTime:
        model = fanuc_model(of, feed_override=feed_override, rapid_override=rapid_override)
        return _core.time_program(program.core, model, False)

    best = timed(machine)
    steps: dict[str, float] = {}
    for row in times.open:
        change = timed(machine.with_values(row.by_key())).total_s - best.total_s
        steps[row.name] = math.hypot(steps.get(row.name, 0.0), change * math.sqrt(row.weight))
        steps[row.name] *= math.copysign(1.0, change)
    cuts: dict[int, float] = defaultdict(float)
    for region in best.regions:
        cuts[int(region["tool"])] += float(region["duration_s"])
    move = float(best.regions["length_mm"].sum()) / max(program.core.block_count, 1)
    gaps = [0, *sorted({line for kind, _, line in program.core.steps if kind == _core.StepKind.function})]
    sections = sum(after - before > 2 for before, after in pairwise([*gaps, program.core.line_count + 1]))
    scatters = {
        CUTS: times.scatter.cuts_percent / 100.0 * math.hypot(*cuts.values()),
        BETWEEN: times.scatter.between_cuts_s * math.sqrt(sections),
        RUNS: times.scatter.runs_percent / 100.0 * best.total_s,
    }
    return TimeInterval(best.total_s, move, steps, scatters)
