"""Shaped rapids: G00 moves written as shaped G01 blocks where the table is ready for the next cut sooner.

What is compared is the time until the table has settled, not the time until the axes have arrived: behind a G00 the
control waits for in-position, but the modes ring on. A rapid is replaced where that costs more than the lower feed, the
shaper and the exact stop of the replacement. The text that holds the replacements is read back and played.
"""

from __future__ import annotations

import math
from bisect import bisect
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from shapegcode import _core
from shapegcode.conversion.budget import Budget, measure_load
from shapegcode.conversion.judge import measure, summarise
from shapegcode.conversion.rapids.candidates import NO_CUT, Gap, Rapid, find_gaps
from shapegcode.conversion.rapids.plant import RapidPlant, Timing
from shapegcode.conversion.readback import Placed, read_back
from shapegcode.conversion.write import EmittedRegion, emit_region, filter_tolerance
from shapegcode.machine import Machine
from shapegcode.model.controller import motion_limits
from shapegcode.program import Program, least_increment_mm
from shapegcode.shaping.grid import Grid

__all__ = ["ShapedRapids", "rapid_warnings", "shape_rapids"]

NOTHING_SHAPED = "no cut of the program is shaped"
NO_GAIN = "no time gained"
OUT_OF_TOLERANCE = "misses its tolerance as shaped blocks"
BUDGET = "budget"

_STOP, _STOP_S = "G04P1", 0.001  # what comes before has stopped, as it has before a G00


@dataclass(frozen=True)
class ShapedRapids:
    """A text with shaped rapids.

    Attributes:
        text: the whole program.
        emitted: the same, read back.
        placed: the cutting regions and their places in it.
        report: the report's key `rapids`.
        extra_s: what the replacements add to the cycle time (settling not counted), s.
    """

    text: bytes
    emitted: Program
    placed: list[Placed]
    report: Mapping[str, Any]
    extra_s: float


@dataclass
class _Choice:
    """A rapid that may be replaced, and what is known of it."""

    rapid: Rapid
    region: _core.Region
    before: Timing
    original: Future[_core.PlaybackFigures]
    shaped: EmittedRegion | None = None
    text: bytes = b""
    after: Timing | None = None
    slowed_blocks: int = 0
    summary: dict[str, Any] = field(default_factory=dict)

    @property
    def extra_bytes(self) -> int:
        """What the replacement adds to the text."""
        return len(self.text) - (self.region.text_end - self.region.text_begin)


def _without_contour(machine: Machine) -> Machine:
    """The same machine for moves in the air: their contour is neither corrected nor judged."""
    shaping = machine.shaping.model_copy(update={"contour": "off"})
    tolerance = machine.tolerance.model_copy(update={"contour_um": math.inf})
    return machine.model_copy(update={"shaping": shaping, "tolerance": tolerance})


def shape_rapids(
    emitted: Program,
    placed: Sequence[Placed],
    machine: Machine,
    grid: Grid,
    pool: Executor,
    budget: Budget | None = None,
) -> ShapedRapids:
    """Replace the rapids of an emitted text where that brings the next cut closer.

    Args:
        emitted: a program with shaped regions, read back.
        placed: the regions and their places in it.
        machine: controller, modes and tolerances.
        grid: block period and shaper.
        pool: runs playbacks.
        budget: limits of the whole text; rapids get what the regions leave.

    Returns:
        The text with those that were replaced, and what each gained.

    Raises:
        ArgumentError: `tolerance.residual_floor_um` is 0: there is no band to settle in.
        RoundTripError: see `verify.read_back`.
    """
    if machine.tolerance.residual_floor_um <= 0.0:
        raise _core.ArgumentError(
            "tolerance.residual_floor_um is 0: shaped rapids need the band in which vibration counts as settled"
        )
    machine = _without_contour(machine)
    grid = replace(grid, axis_firs=())  # one shaper for all axes keeps a straight move straight
    plant = RapidPlant(machine)
    kept: Counter[str] = Counter()
    gaps = find_gaps(emitted, machine)
    found = sum(len(gap.rapids) for gap in gaps)
    open_gaps: list[_OpenGap] = []
    for gap in gaps:
        kept.update(rapid.reason for rapid in gap.rapids if rapid.region is None)
        if not gap.cut_follows or not placed:
            reason = NO_CUT if placed else NOTHING_SHAPED
            kept.update(reason for rapid in gap.rapids if rapid.region is not None)
            continue
        open_gap = _OpenGap(gap, plant, pool, grid.block_period_s)
        kept.update({NO_GAIN: sum(rapid.region is not None for rapid in gap.rapids) - len(open_gap.choices)})
        if open_gap.choices:
            open_gaps.append(open_gap)
    choices = [choice for gap in open_gaps for choice in gap.choices]
    for choice in choices:
        _write(choice, emitted, machine, grid)
        if budget is not None and _too_fast(choice, grid, machine, budget):
            kept[BUDGET] += 1
            choice.text = b""
    splice = partial(_splice, emitted.core.text, placed)
    _judge([choice for choice in choices if choice.text], splice, machine, grid, plant, pool)
    for open_gap in open_gaps:
        open_gap.drop(OUT_OF_TOLERANCE, kept, lambda choice: bool(choice.text and choice.summary["misses"]))
        open_gap.drop_useless(kept)
    if budget is not None and budget.max_bytes is not None:
        _save_bytes(open_gaps, budget.max_bytes - emitted.core.size, kept)
    shaped = [choice for gap in open_gaps for choice in gap.choices if choice.text]
    spliced = splice(shaped)
    read = read_back(spliced.text, spliced.everything, machine)
    report = {
        "found": found,
        "shaped": len(shaped),
        "kept": {reason: count for reason, count in sorted(kept.items()) if count},
        "time_saved_s": math.fsum(gap.saved_s() for gap in open_gaps),
        "settle_band_um": machine.tolerance.residual_floor_um,
        "blocks": sum(choice.shaped.blocks for choice in shaped if choice.shaped is not None),
        "slowed_blocks": sum(choice.slowed_blocks for choice in shaped),
        "moves": [_entry(choice, place, placed) for choice, place in zip(shaped, spliced.moves, strict=True)],
    }
    extra_s = math.fsum(c.after.clock_s - c.before.clock_s for c in shaped if c.after is not None)
    return ShapedRapids(spliced.text, read, spliced.placed, report, extra_s)


class _OpenGap:
    """A gap in which rapids may be replaced, and what that does to the time until the next cut can begin."""

    def __init__(self, gap: Gap, plant: RapidPlant, pool: Executor, least_gain_s: float) -> None:
        self._plant = plant
        self._least_gain_s = least_gain_s
        self._steps = [plant.pause(step) if isinstance(step, float) else plant.rapid(step) for step in gap.steps]
        self.choices: list[_Choice] = []
        self._at: list[int] = []
        regions = [step.region for step in gap.steps if not isinstance(step, float) and step.region is not None]
        if not regions:
            return
        self._region = regions[-1]
        clock_s = math.fsum(step.clock_s for step in self._steps)
        self._before_s = plant.ready_s(self._steps, self._region)
        if self._before_s < clock_s + least_gain_s:
            return
        end_s = 0.0
        for at, (step, timing) in enumerate(zip(gap.steps, self._steps, strict=True)):
            end_s += timing.clock_s
            if isinstance(step, float) or step.region is None or timing.settling_s <= 0.0:
                continue
            if clock_s - end_s < plant.longest_memory_s:
                original = pool.submit(plant.play_original, step)
                self.choices.append(_Choice(step, step.region, timing, original))
                self._at.append(at)

    def _ready_s(self, shaped: Sequence[bool]) -> float:
        """Time from the last cut until the next one finds the table settled, s."""
        steps = list(self._steps)
        for at, choice, is_shaped in zip(self._at, self.choices, shaped, strict=True):
            if is_shaped and choice.after is not None:
                steps[at] = choice.after
        return self._plant.ready_s(steps, self._region)

    def saved_s(self) -> float:
        """What the replacements that are left save, s."""
        flags = [bool(choice.text) for choice in self.choices]
        return self._before_s - self._ready_s(flags) if any(flags) else 0.0

    def extra_bytes(self) -> int:
        """What they add to the text."""
        return sum(choice.extra_bytes for choice in self.choices if choice.text)

    def drop(self, reason: str, kept: Counter[str], condition: Callable[[_Choice], bool]) -> None:
        """Keep the rapids that meet a condition."""
        for choice in self.choices:
            if condition(choice) and choice.text:
                choice.text = b""
                kept[reason] += 1

    def drop_useless(self, kept: Counter[str]) -> None:
        """Keep every rapid without whose replacement the next cut begins as soon; the earlier ones first."""
        # All together first: of two rapids that ring equally long, replacing one alone gains nothing.
        flags = [bool(choice.text) for choice in self.choices]
        ready_s = self._ready_s(flags)
        for k in range(len(flags)):
            if flags[k]:
                flags[k] = False
                without_s = self._ready_s(flags)
                if without_s < ready_s + self._least_gain_s:
                    ready_s = without_s
                else:
                    flags[k] = True
        if ready_s > self._before_s - self._least_gain_s:
            flags = [False] * len(flags)
        chosen = iter(flags)
        self.drop(NO_GAIN, kept, lambda _choice: not next(chosen))


def _write(choice: _Choice, emitted: Program, machine: Machine, grid: Grid) -> None:
    """The lines that replace a rapid."""
    region = choice.region
    limits = motion_limits(machine)
    # Ends of blocks are rounded, and F is rounded up: at the clamp itself a block would last a tick too long.
    margin_mm_per_s = 2.0 * least_increment_mm(machine, region.exit.units) / grid.block_period_s
    limits.max_feed_mm_per_s = np.maximum(limits.max_feed_mm_per_s - margin_mm_per_s, margin_mm_per_s)
    limits.feed_override = max(0.5, 1.0 - margin_mm_per_s / region.path[0].feed_mm_per_s)
    choice.shaped = emit_region(emitted, region, machine, grid, limits, filter_tolerance(machine, grid))
    lines = [choice.rapid.head] if choice.rapid.head else []
    # In G95 a dwell may count revolutions.
    lines += ["G94", _STOP] if region.entry.feed_mode != 94 else [_STOP]
    end = emitted.core.line_end.encode()
    choice.text = b"".join(line.encode("latin-1") + end for line in lines) + choice.shaped.text


def _too_fast(choice: _Choice, grid: Grid, machine: Machine, budget: Budget) -> bool:
    assert choice.shaped is not None
    load = measure_load(choice.region, choice.shaped, grid, machine)
    pairs = ((load.baud, budget.baud), (load.blocks_per_second, budget.max_blocks_per_second))
    return any(limit is not None and value > limit * (1.0 + 1e-9) for value, limit in pairs)


def _judge(
    choices: Sequence[_Choice],
    splice: Callable[[Sequence[_Choice]], _Spliced],
    machine: Machine,
    grid: Grid,
    plant: RapidPlant,
    pool: Executor,
) -> None:
    """Play every replacement as the text has it."""
    spliced = splice(choices)
    emitted = read_back(spliced.text, spliced.everything, machine)
    stops_s = _STOP_S + machine.emission.prefill_dwell_s
    running = []
    for choice, place in zip(choices, spliced.moves, strict=True):
        blocks = emitted.core.cutting_path(place.first_line, place.last_line)
        running.append(pool.submit(plant.blocks, blocks, choice.region, stops_s))
    figures = measure(emitted, spliced.moves, [choice.original for choice in choices], machine, pool)
    summaries = summarise(figures, spliced.moves, machine, grid.block_period_s)["regions"]
    for choice, timing, played, summary in zip(choices, running, figures, summaries, strict=True):
        choice.after = timing.result()
        choice.slowed_blocks = played.slowed_blocks
        choice.summary = summary


def _save_bytes(gaps: Sequence[_OpenGap], room: int, kept: Counter[str]) -> None:
    """Keep the rapids of the gaps that save least per byte until the rest fits into the room."""
    order = sorted((gap for gap in gaps if gap.extra_bytes() > 0), key=lambda gap: gap.saved_s() / gap.extra_bytes())
    needed = sum(gap.extra_bytes() for gap in gaps)
    for gap in order:
        if needed <= room:
            return
        needed -= gap.extra_bytes()
        gap.drop(BUDGET, kept, lambda _choice: True)


@dataclass(frozen=True)
class _Spliced:
    """A text with replacements, and the places of regions and replacements in it."""

    text: bytes
    placed: list[Placed]
    moves: list[Placed]

    @property
    def everything(self) -> list[Placed]:
        return sorted([*self.placed, *self.moves], key=lambda place: place.first_line)


def _splice(text: bytes, placed: Sequence[Placed], choices: Sequence[_Choice]) -> _Spliced:
    parts, at = [], 0
    shifts = []  # (line behind which it holds, lines that were added)
    added = 0
    moves = []
    for choice in choices:
        region = choice.region
        parts += [text[at : region.text_begin], choice.text]
        at = region.text_end
        first = region.first_line + added
        moves.append(Placed(region, first, first + choice.text.count(b"\n") - 1))
        added += choice.text.count(b"\n") - 1
        shifts.append((region.first_line, added))
    parts.append(text[at:])
    lines = [line for line, _ in shifts]
    moved = []
    for place in placed:
        index = bisect(lines, place.first_line)
        shift = shifts[index - 1][1] if index else 0
        moved.append(Placed(place.region, place.first_line + shift, place.last_line + shift))
    return _Spliced(b"".join(parts), moved, moves)


def _entry(choice: _Choice, place: Placed, placed: Sequence[Placed]) -> dict[str, Any]:
    assert choice.after is not None
    line = _original_line(choice.rapid.line, placed)
    summary = choice.summary
    return {
        "lines": [line, line],
        "emitted_lines": [place.first_line, place.last_line],
        "time_s": {"original": choice.before.motion_s, "emitted": choice.after.motion_s},
        "in_position_s": {"original": choice.before.arrival_s, "emitted": choice.after.arrival_s},
        "settling_s": {"original": choice.before.settling_s, "emitted": choice.after.settling_s},
        **{key: summary[key] for key in ("residual_vibration_um", "residual_limit_um", "misses")},
    }


def _original_line(line: int, placed: Sequence[Placed]) -> int:
    """Line of the original from which a kept line of the emitted text comes."""
    index = bisect([place.first_line for place in placed], line)
    if index:
        before = placed[index - 1]
        return line - before.last_line + before.region.last_line
    return line - placed[0].first_line + placed[0].region.first_line


def rapid_warnings(report: Mapping[str, Any], machine: Machine) -> list[str]:
    """What is different where rapids became cutting moves; empty where none did."""
    if not report["shaped"]:
        return []
    fastest = ", ".join(
        f"{letter} {axis.max_feed_mm_per_min:g}" for letter, axis in zip("XYZ", machine.axes.as_tuple(), strict=True)
    )
    warnings = [
        f"{report['shaped']} of {report['found']} rapids are shaped cutting moves (the table is ready "
        f"{report['time_saved_s']:.2f} s sooner in all): rapid override no longer acts on them, feed override does",
        "shaped rapids run at the cutting feeds of the axes (axes.*.max_feed_mm_per_min: "
        f"{fastest} mm/min): the control's clamp of cutting feeds (parameters 1422, 1430) must not lie below",
    ]
    if machine.controller.rapid_path == "non_linear":
        warnings.append(
            "shaped rapids are straight lines; the rapids that they replace were not (controller.rapid_path = "
            '"non_linear"): check that the straight way is free'
        )
    if report["slowed_blocks"]:
        warnings.append(
            f"{report['slowed_blocks']} blocks of shaped rapids step an axis by more than "
            "controller.corner_speed_difference_mm_per_min: run them with the look-ahead mode off "
            '(emission.prologue, for example ["G05.1Q0"]), or it slows them'
        )
    return warnings
