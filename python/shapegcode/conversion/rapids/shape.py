"""Shaped rapids: G00 moves written as shaped G01 blocks, if the table then settles sooner before the next cut.

The time until the table has settled is compared: after a G00 the control waits for in-position only.
"""

from __future__ import annotations

import math
from bisect import bisect
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from shapegcode import _core
from shapegcode.conversion.budget import Budget
from shapegcode.conversion.rapids.gaps import NO_GAIN, Choice, OpenGap, RapidPlant, find_gaps
from shapegcode.conversion.tables import RapidMove, RapidsOutcome
from shapegcode.conversion.whole_text import read_back
from shapegcode.conversion.write import EmittedRegion, RegionWriter, measure_load
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.program import Program, written_increment_mm
from shapegcode.program.stamp import RAPID_MARK
from shapegcode.results.outcome import Pair
from shapegcode.shaping.grid import Grid
from shapegcode.verdict.figures import Placed
from shapegcode.verdict.judge import Judge

BUDGET = "budget"

_STOP, _STOP_S = "G04P1", 0.001  # a stop before the replacement, as before a G00


@dataclass(frozen=True)
class ShapedRapids:
    """A program with shaped rapids."""

    emitted: Program  # the whole program, read back
    placed: list[Placed]  # the cutting regions and their positions in it
    outcome: RapidsOutcome  # outcome of the rapids
    warnings: list[str]  # consequences of the replacement by cutting moves
    extra_s: float  # cycle time added by the replacements (without settling), s


def shape_rapids(
    emitted: Program, placed: Sequence[Placed], model: MachineModel, grid: Grid, pool: Executor, budget: Budget | None
) -> ShapedRapids:
    """Replace rapids of an emitted program where the next cut can then start sooner."""
    if model.machine.tolerance.residual_floor_um <= 0.0:
        raise _core.ArgumentError(
            "tolerance.residual_floor_um is 0: shaped rapids need the band in which vibration counts as decayed"
        )
    # One shaper for all axes keeps a straight move straight.
    return _RapidShaper(emitted, placed, _without_contour(model), replace(grid, axis_firs=()), pool).shaped(budget)


class _RapidShaper:
    def __init__(
        self, emitted: Program, placed: Sequence[Placed], model: MachineModel, grid: Grid, pool: Executor
    ) -> None:
        self.emitted, self.placed, self.grid, self.pool = emitted, placed, grid, pool
        self.model, self.machine = model, model.machine
        self.writer = RegionWriter(model, grid, RAPID_MARK)
        self.judge = Judge(model)
        self.plant = RapidPlant(model)

    def shaped(self, budget: Budget | None) -> ShapedRapids:
        kept: Counter[str] = Counter()
        gaps = find_gaps(self.emitted, self.machine)
        open_gaps: list[OpenGap] = []
        for gap in gaps:
            kept.update(rapid.reason for rapid in gap.rapids if rapid.region is None)
            if not gap.cut_follows or not self.placed:
                reason = "no cut follows" if self.placed else "no cut of the program is shaped"
                kept.update(reason for rapid in gap.rapids if rapid.region is not None)
                continue
            open_gap = OpenGap(gap, self.plant, self.pool, self.grid.block_period_s)
            kept.update({NO_GAIN: sum(rapid.region is not None for rapid in gap.rapids) - len(open_gap.choices)})
            if open_gap.choices:
                open_gaps.append(open_gap)
        choices = [choice for gap in open_gaps for choice in gap.choices]
        bits = self.machine.controller.dnc_bits_per_character
        for choice in choices:
            shaped = choice.shaped = self._write(choice)
            if budget is not None and budget.too_fast(measure_load(choice.region, shaped, self.grid, bits)):
                kept[BUDGET] += 1
                choice.text = b""
        self._judge([choice for choice in choices if choice.text])
        for open_gap in open_gaps:
            reason = "misses its tolerance as shaped blocks"
            open_gap.drop(reason, kept, lambda choice: choice.verdict is not None and bool(choice.verdict.misses))
            open_gap.drop_useless(kept)
        if budget is not None and budget.max_bytes is not None:
            _save_bytes(open_gaps, budget.max_bytes - self.emitted.core.size, kept)
        return self._result(open_gaps, kept, sum(len(gap.rapids) for gap in gaps))

    def _result(self, open_gaps: Sequence[OpenGap], kept: Counter[str], found: int) -> ShapedRapids:
        shaped = [choice for gap in open_gaps for choice in gap.choices if choice.text]
        emitted, placed, moves = self._splice(shaped)
        outcome = RapidsOutcome(
            found=found,
            shaped=len(shaped),
            left_unchanged={reason: count for reason, count in sorted(kept.items()) if count},
            time_saved_s=math.fsum(gap.saved_s() for gap in open_gaps),
            settle_band_um=self.machine.tolerance.residual_floor_um,
            blocks=sum(choice.shaped.blocks for choice in shaped if choice.shaped is not None),
            slowed_blocks=sum(choice.slowed_blocks for choice in shaped),
            moves=tuple(_move(choice, place, self.placed) for choice, place in zip(shaped, moves, strict=True)),
        )
        extra_s = math.fsum(c.after.clock_s - c.before.clock_s for c in shaped if c.after is not None)
        return ShapedRapids(emitted, placed, outcome, _warnings(outcome, self.machine), extra_s)

    def _write(self, choice: Choice) -> EmittedRegion:
        region = choice.region
        limits = self.model.limits()
        # Block ends are rounded, and F is rounded up: at the clamp itself a block would take one period too long.
        increment_mm = written_increment_mm(self.machine, region.exit.units)
        margin_mm_per_s = 2.0 * increment_mm / self.grid.block_period_s
        limits.max_feed_mm_per_s = np.maximum(limits.max_feed_mm_per_s - margin_mm_per_s, margin_mm_per_s)
        limits.feed_override = max(0.5, 1.0 - margin_mm_per_s / region.path[0].feed_mm_per_s)
        shaped = self.writer.write(self.emitted, region, limits, self.writer.tolerance())
        lines = [choice.rapid.head] if choice.rapid.head else []
        # In G95 a dwell may count revolutions.
        lines += ["G94", _STOP] if region.entry.feed_mode != 94 else [_STOP]
        end = self.emitted.core.line_end.encode()
        choice.text = b"".join([*(line.encode("latin-1") + end for line in lines), *shaped.text.parts()])
        return shaped

    def _judge(self, choices: Sequence[Choice]) -> None:
        emitted, _, moves = self._splice(choices)
        stops_s = _STOP_S + self.machine.emission.prefill_dwell_s
        running = [
            self.pool.submit(self.plant.blocks, place.blocks(emitted), choice.region, stops_s)
            for choice, place in zip(choices, moves, strict=True)
        ]
        originals = [choice.original for choice in choices]
        figures = self.judge.measure(emitted, moves, originals, self.pool)
        verdicts = self.judge.verdicts(figures, moves, self.grid.block_period_s)
        for choice, timing, simulated, verdict in zip(choices, running, figures, verdicts, strict=True):
            choice.after = timing.result()
            choice.slowed_blocks = simulated.slowed_blocks
            choice.verdict = verdict

    def _splice(self, choices: Sequence[Choice]) -> tuple[Program, list[Placed], list[Placed]]:
        """The program with replacements of rapids, read back; positions of its regions and of the replacements."""
        text, parts, at = self.emitted.core.text, [], 0
        lines, shifts = [], [0]  # lines after each of which another number of lines has been added
        moves = []
        for choice in choices:
            region = choice.region
            parts += [text[at : region.text_begin], choice.text]
            at = region.text_end
            first, more = region.first_line + shifts[-1], choice.text.count(b"\n") - 1
            moves.append(Placed(region, first, first + more))
            lines.append(region.first_line)
            shifts.append(shifts[-1] + more)
        moved = []
        for place in self.placed:
            shift = shifts[bisect(lines, place.first_line)]
            moved.append(Placed(place.region, place.first_line + shift, place.last_line + shift))
        everything = sorted([*moved, *moves], key=lambda place: place.first_line)
        return read_back([b"".join([*parts, text[at:]])], everything, self.machine), moved, moves


def _without_contour(model: MachineModel) -> MachineModel:
    """The machine without contour compensation, and without limits of contour error and feed excess."""
    machine = model.machine
    # A straight move has no corners: the ramps of the look-ahead suffice.
    shaping = machine.shaping.model_copy(update={"contour": "off", "planner": "look-ahead"})
    tolerance = machine.tolerance.model_copy(update={"contour_um": math.inf, "feed_excess_ratio": math.inf})
    return MachineModel(machine.model_copy(update={"shaping": shaping, "tolerance": tolerance}))


def _save_bytes(gaps: Sequence[OpenGap], room: int, kept: Counter[str]) -> None:
    order = sorted((gap for gap in gaps if gap.extra_bytes() > 0), key=lambda gap: gap.saved_s() / gap.extra_bytes())
    needed = sum(gap.extra_bytes() for gap in gaps)
    for gap in order:
        if needed <= room:
            return
        needed -= gap.extra_bytes()
        gap.drop(BUDGET, kept, lambda _choice: True)


def _move(choice: Choice, place: Placed, placed: Sequence[Placed]) -> RapidMove:
    before, after, verdict = choice.before, choice.after, choice.verdict
    assert after is not None and verdict is not None
    line = original_line(choice.rapid.line, placed)
    return RapidMove(
        lines=(line, line),
        emitted_lines=(place.first_line, place.last_line),
        time_s=Pair(before.motion_s, after.motion_s),
        in_position_s=Pair(before.arrival_s, after.arrival_s),
        settling_s=Pair(before.settling_s, after.settling_s),
        residual_vibration_um=verdict.residual_vibration_um,
        residual_limit_um=verdict.residual_limit_um,
        misses=verdict.misses,
    )


def _warnings(outcome: RapidsOutcome, machine: Machine) -> list[str]:
    if not outcome.shaped:
        return []
    fastest = ", ".join(
        f"{letter} {axis.max_feed_mm_per_min:g}" for letter, axis in zip("XYZ", machine.axes.as_tuple(), strict=True)
    )
    warnings = [
        f"{outcome.shaped} of {outcome.found} rapids are shaped cutting moves (the next cuts can start "
        f"{outcome.time_saved_s:.2f} s sooner in total): rapid override has no effect on them, feed override has",
        "shaped rapids run at the cutting feeds of the axes (axes.*.max_feed_mm_per_min: "
        f"{fastest} mm/min): the control's clamp of cutting feeds (parameters 1422, 1430) must not lie below",
    ]
    if machine.controller.rapid_path == "non_linear":
        warnings.append(
            "shaped rapids are straight lines; the replaced rapids were not (controller.rapid_path = "
            '"non_linear"): check that the straight path is free'
        )
    if outcome.slowed_blocks and not machine.emission.leaves_look_ahead:
        warnings.append(
            f"{outcome.slowed_blocks} blocks of shaped rapids step an axis by more than "
            "controller.corner_speed_difference_mm_per_min: run them with the look-ahead mode off "
            '(emission.prologue, for example ["G05.1Q0"]), or it slows them down'
        )
    return warnings


def original_line(line: int, placed: Sequence[Placed]) -> int:
    """Line of the original for an unchanged line of the emitted program."""
    index = bisect([place.first_line for place in placed], line)
    if index:
        before = placed[index - 1]
        return line - before.last_line + before.region.last_line
    return line - placed[0].first_line + placed[0].region.first_line
