"""The converter: regions of a program shaped, written, read back and judged."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from shapegcode import _core
from shapegcode.conversion.advice import filter_advice
from shapegcode.conversion.benefit import most_to_gain_um
from shapegcode.conversion.budget import Budget
from shapegcode.conversion.curve import ToleranceCurve
from shapegcode.conversion.cuts import CutOutcome, chosen_cuts, outcome_of, tools_of_cuts
from shapegcode.conversion.operating import at_the_control
from shapegcode.conversion.proof import prove
from shapegcode.conversion.rapids.shape import ShapedRapids
from shapegcode.conversion.recommendation import Situation, recommend
from shapegcode.conversion.restart_points import restart_points
from shapegcode.conversion.rests import RestsOn, rests_on
from shapegcode.conversion.result import Conversion
from shapegcode.conversion.run import CutChoice, Progress, Run, Settled
from shapegcode.conversion.warnings import open_axes, played_warnings, text_warnings
from shapegcode.conversion.whole_text import Written
from shapegcode.machine import Machine
from shapegcode.model.modes import machine_warnings, region_range_warnings
from shapegcode.model.playable import PlayedPrograms
from shapegcode.program import Program
from shapegcode.program.compensation import program_for_conversion
from shapegcode.program.stamp import RAPID_MARK, REGION_MARK, STAMP_BEGIN
from shapegcode.results.result import Pair
from shapegcode.shaping.grid import Grid
from shapegcode.verdict.ahead import cores
from shapegcode.verdict.figures import (
    AppliedLimits,
    BlockCount,
    FollowingShapers,
    GridTaps,
    PlayedFigures,
    UsedShaper,
)
from shapegcode.verdict.program import rapid_vibration_um

__all__ = ["convert"]


def convert(
    program: Program | str | Path,
    machine: Machine | str | Path,
    *,
    contour: str | None = None,
    contour_tolerance_um: float | None = None,
    shaper: str | None = None,
    per_axis: bool | None = None,
    rapids: bool | None = None,
    budget: Budget | None = None,
    arc_feed_ratio: float | None = None,
    block_period_s: float | None = None,
    max_time_increase_percent: float | None = None,
    max_cut_time_increase_percent: float | None = None,
    only: Sequence[tuple[int, int]] | None = None,
    leave: Sequence[tuple[int, int]] = (),
    shape_all: bool = False,
    tolerance_curve: bool = True,
    on_progress: Progress = lambda _stage, _done, _total: None,
) -> Conversion:
    """Shape the cuts of a program, and judge the whole emitted program by simulating it.

    What is None here is as the machine file has it; a value is checked as one of a machine file.

    Args:
        program: what to convert, or its file.
        machine: controller, modes, tolerances.
        contour: what is brought back to the programmed path, "response", "command" or "off": `shaping.contour`.
        contour_tolerance_um: largest deviation of it from the path, µm: `tolerance.contour_um`.
        shaper: family of the shaper, such as "zvd": `shaping.family`.
        per_axis: a shaper for each axis: `shaping.per_axis`.
        rapids: rapids become shaped moves where that saves time: `shaping.rapids`.
        budget: what the emitted text may need; None: no limit.
        arc_feed_ratio: feed on arcs relative to the programmed one, reached before the arc: `shaping.arc_feed_ratio`.
        block_period_s: duration of a short block, s: `emission.block_period_s`; None there too: see `choose_grid`.
        max_time_increase_percent: largest increase of the program's time: `price.program_time_percent`.
        max_cut_time_increase_percent: likewise of one cut: `price.cut_time_percent`.
        only: shape nothing but the cuts in these lines of the original, each first and last; None: all.
        leave: leave the cuts in these lines unchanged.
        shape_all: shape every cut within the price, also one that gains less than `shaping.least_gain_um`, becomes
            worse, or of a program that is within its tolerance already. False: such a cut is left unchanged.
        tolerance_curve: work out what other contour tolerances would cost in time.
        on_progress: called with stage, and how many of its parts are done and there are.

    Returns:
        The emitted program with its verdict. It is not written anywhere: `conversion.text` is what a file would hold.

    Raises:
        ProgramError: the program cannot be read, or a region not be written.
        OSError: its file cannot be read.
        MachineError: a value that a machine file could not have.
        DesignError: no shaper exists on this grid.
        ArgumentError: the program was read with other settings than the machine has; a block period that the
            controller cannot play, a budget without a choice, lines without a cut.
        RoundTripError: the emitted text would not be equivalent: a defect of shapegcode.
    """
    machine = Machine.of(machine)
    stated = {
        "shaping.contour": contour,
        "tolerance.contour_um": contour_tolerance_um,
        "shaping.family": shaper,
        "shaping.per_axis": per_axis,
        "shaping.rapids": rapids,
        "shaping.arc_feed_ratio": arc_feed_ratio,
        "price.program_time_percent": max_time_increase_percent,
        "price.cut_time_percent": max_cut_time_increase_percent,
    }
    if stated := {key: value for key, value in stated.items() if value is not None}:
        machine = machine.with_values(stated, source="options of convert")
    program = program_for_conversion(program, machine)
    if program.stamp is not None:
        raise _core.ProgramError(
            f"{program.source}:1:1: written by shapegcode already (its header says so): convert the original"
        )
    _refuse_own_marks(program)
    choice = CutChoice(chosen_cuts(program, only, leave), shape_all, tolerance_curve)
    # Shapes regions, plays the originals, and what was emitted, on all cores.
    pool = ThreadPoolExecutor(max_workers=cores())
    try:
        run = Run(program, machine, block_period_s, budget, choice, pool, on_progress)
        found = run.shaped()
        return _result(run, found.settled, found.rapids, original_within=found.original_within)
    finally:
        pool.shutdown(cancel_futures=True)


def _refuse_own_marks(program: Program) -> None:
    """A comment of an original that the emitted program would say of its own blocks."""
    for mark in (REGION_MARK.encode(), RAPID_MARK.encode(), STAMP_BEGIN):
        if (at := program.core.find(mark)) >= 0:
            line = program.core.slice(0, at).count(b"\n") + 1
            raise _core.ProgramError(
                f"{program.place(line)}:1: the comment {mark.decode()} is how a shaped program marks its own blocks: "
                "give it other words"
            )


def _result(run: Run, settled: Settled, rapids: ShapedRapids | None, *, original_within: bool) -> Conversion:
    program, machine, written = run.program, run.machine, settled.written
    core = program.core
    # For a core that waits while the last simulations run.
    mark = run.pool.submit(lambda: settled.emitted.mark)
    emitted_s = run.pool.submit(run.model.cycle_time_s, settled.emitted.core)
    between = run.rapid_vibration
    if rapids is not None and rapids.outcome.shaped:
        between = run.pool.submit(rapid_vibration_um, settled.emitted, run.model)
    rapids_shaped = rapids is not None and rapids.outcome.shaped > 0
    proving = None
    # Without header comments nothing tells shaped rapids from cuts.
    if written.placed and (machine.emission.header or not rapids_shaped):
        proving = run.pool.submit(prove, program, settled.emitted, machine, rapids_shaped=rapids_shaped)
    every = sorted(
        [*zip(written.placed, settled.figures, strict=True), *run.unchanged(settled, rapids)],
        key=lambda pair: pair[0].original_lines,
    )
    figures = run.judge.summarise(
        [each for _, each in every], [place for place, _ in every], run.grid.block_period_s,
        Pair(run.rapid_vibration.result(), between.result()),
    )  # fmt: skip
    cutting = figures.region_time_s()
    cuts = _cuts(run, settled, figures)
    times = _cycle_time_s(run, settled, emitted_s.result(), cutting, rapids)
    proof = None if proving is None else proving.result()
    grade, reason = recommend(
        Situation(
            figures.all_cuts, len(written.placed), original_within=original_within,
            could_gain=any(cut.gain_um >= machine.shaping.least_gain_um for cut in cuts),
            benefit=run.is_benefit(settled), other_changes=proof.refused if proof is not None else (),
        )
    )  # fmt: skip
    warnings = _warnings(run, written, figures)
    if rapids is not None:
        warnings += rapids.warnings
    rests, tried = _rests_on(run, settled)
    mark.result()
    emitted = settled.emitted.with_verdict(good=grade != "do not run", better=grade == "better, tolerance not met")
    return Conversion(
        **vars(figures),
        program=program.source,
        machine=machine.name,
        recommendation=grade,
        reason=reason,
        cuts=cuts,
        tolerance_curve=_curve(run, times) if run.choice.tolerance_curve else None,
        proof=proof,
        advice=filter_advice(program, machine, run.model, run.judge, [original.result() for original in run.originals]),
        cycle_time_s=times,
        cutting_time_s=cutting,
        block_period_s=run.grid.block_period_s,
        shaper=_used_shaper(run.grid),
        blocks=BlockCount(core.block_count, written.blocks),
        expanded=core.expanded,
        expanded_radii_mm={f"D{number}": radius for number, radius in core.expanded_radii_mm.items()},
        bytes_read=core.size,
        bytes_emitted=written.size,
        limits=AppliedLimits(
            machine.tolerance.contour_um,
            run.judge.target,
            machine.tolerance.residual_ratio,
            machine.tolerance.residual_floor_um,
            machine.tolerance.residual_floor_increments,
            machine.tolerance.feed_excess_ratio,
            machine.verdict.plant,
            machine.price.program_time_percent,
            machine.price.cut_time_percent,
        ),
        warnings=tuple(warnings),
        budget=run.spending.outcome(run.grid, written) if run.spending is not None else None,
        rapids=rapids.outcome if rapids is not None else None,
        least_gain_um=machine.shaping.least_gain_um,
        rests_on=rests,
        unmeasured_tried=tried,
        at_the_control=at_the_control(
            settled.emitted,
            written.placed,
            written.loads,
            figures,
            run.model,
            run.grid.block_period_s,
            written.restarts,
        ),
        restart_points=restart_points(program, zip(written.placed, written.restarts, strict=True)),
        emitted=emitted,
        placed=tuple(written.placed),
        model=run.model,
        played=PlayedPrograms(program, machine, emitted, plant=machine.verdict.plant),
    )


def _cuts(run: Run, settled: Settled, figures: PlayedFigures) -> tuple[CutOutcome, ...]:
    """One row for each cut."""
    tools = tools_of_cuts(run.program)
    sizes = {
        run.aims.index(place.region): text.size
        for place, (text, _) in zip(settled.written.placed, settled.written.texts, strict=True)
    }
    rows = []
    for index, (region, cut) in enumerate(zip(run.program.regions, figures.all_cuts, strict=True)):
        read = region.text_end - region.text_begin
        gained = run.gains_um.get(index)
        if gained is None:
            gained = most_to_gain_um(run.originals[index].result())
        rows.append(
            outcome_of(
                cut, is_shaped=index in sizes, reason=run.reasons[index], gain_um=gained,
                tolerance_um=run.aims.shaped_for_um(index), tool=tools.get(index),
                size=Pair(read, sizes.get(index, read)),
            )
        )  # fmt: skip
    return tuple(rows)


def _curve(run: Run, times: Pair[float]) -> ToleranceCurve | None:
    """Tolerance against time, of the cuts that were shaped once; None: there are none."""
    original_um = max(
        (getattr(original.result(), run.judge.target).max_abs_mm for original in run.originals), default=0.0
    )
    return run.aims.tolerance_curve(times.original, original_um * 1e3)


def _rests_on(run: Run, settled: Settled) -> tuple[tuple[RestsOn, ...], int]:
    """Sensitivity of the shaped cut that comes nearest to a limit."""
    deciding = run.judge.deciding(settled.figures, settled.written.placed)
    if deciding is None:
        return (), 0
    simulated = zip(settled.written.placed, settled.figures, settled.trackers, strict=True)
    return rests_on(
        run.judge, run.machine, list(simulated), settled.emitted, deciding, run.pool,
        settled.begun, partial(run.on_progress, "sensitivity to unverified parameters"),
    )  # fmt: skip


def _cycle_time_s(
    run: Run, settled: Settled, emitted_s: float, cutting: Pair[float], rapids: ShapedRapids | None
) -> Pair[float]:
    """What `shapegcode time` says of both texts."""
    original_s = run.original_s.result()
    if run.machine.emission.header:
        return Pair(original_s, emitted_s)
    # Nothing in such a text says which regions are shaped.
    added_s = run.machine.emission.prefill_dwell_s * len(settled.written.placed)
    added_s += rapids.extra_s if rapids else 0.0
    return Pair(original_s, original_s - cutting.original + cutting.emitted + added_s)


def _warnings(run: Run, written: Written, figures: PlayedFigures) -> list[str]:
    program, machine = run.program, run.machine
    warnings = [*program.warnings, *written.kept_warnings, *machine_warnings(machine)]
    warnings += [run.grid.note] if run.grid.note else []
    warnings += region_range_warnings(program.regions, machine)
    if run.spending is not None and (sentence := run.spending.warning(run.grid)):
        warnings.append(sentence)
    elif not program.regions:
        warnings.append(f"{program.source}: no cutting moves that can be shaped: the program is unchanged")
    if not written.placed:
        # Where something was shaped, the sensitivity to unverified parameters names them.
        warnings += open_axes(program, machine)
    warnings += played_warnings(program, figures, machine, is_priced=bool(run.aims.priced))
    return warnings + text_warnings(program, written.placed, figures, machine, written.size, written.blocks)


def _used_shaper(grid: Grid) -> UsedShaper:
    following = None
    if grid.track is not None:
        nodes = grid.track.nodes
        following = FollowingShapers(
            "xyz"[grid.track.axis],
            tuple(node.position_mm for node in nodes),
            tuple(tuple(node.shaper.times_s) for node in nodes),
            tuple(tuple(node.shaper.amplitudes) for node in nodes),
            grid.track.worst_residual,
        )
    return UsedShaper(
        tuple(grid.shaper.times_s),
        tuple(grid.shaper.amplitudes),
        grid.family,
        grid.duration_s,
        tuple(GridTaps(tuple(fir.delays), tuple(fir.taps)) for fir in grid.axis_firs),
        grid.per_axis_duration_s,
        following,
    )
