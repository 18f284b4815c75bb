"""Make the result of a conversion: simulate the whole emitted program for its verdict, and collect the figures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from shapegcode.conversion.operating import at_the_control
from shapegcode.conversion.plan import ConversionPlan, Shaped
from shapegcode.conversion.recommendation import (
    Grade,
    filter_advice,
    most_to_gain_um,
    open_axes,
    recommend,
    simulation_warnings,
    text_warnings,
)
from shapegcode.conversion.restart import restart_points
from shapegcode.conversion.result import ChangeProof, Conversion
from shapegcode.conversion.tables import CutOutcome, Sensitivity, outcome_of, parameter_sensitivity, tools_of_cuts
from shapegcode.machine import Machine
from shapegcode.model.machine_model import ini_lines
from shapegcode.model.modes import machine_warnings, region_range_warnings
from shapegcode.model.programs import SimulatedPrograms
from shapegcode.program import Program
from shapegcode.program.comparison import Allowed, compare
from shapegcode.results.outcome import Pair
from shapegcode.shaping.grid import Grid
from shapegcode.verdict.figures import (
    AppliedLimits,
    BlockCount,
    FollowingShapers,
    GridTaps,
    Placed,
    ProgramFigures,
    UsedShaper,
)
from shapegcode.verdict.judge import RegionFigures, rapid_vibration_um, simulate_unchanged, unshaped_regions

_PATH_TOLERANCES = 10.0
_PATH_UM = 200.0


@dataclass(frozen=True)
class ProgramVerdict:
    """The whole emitted program beside its limits, its price and its original."""

    figures: ProgramFigures
    cuts: tuple[CutOutcome, ...]
    cycle_time_s: Pair[float]
    proof: ChangeProof | None
    grade: Grade
    reason: str


def judge(plan: ConversionPlan, shaped: Shaped) -> ProgramVerdict:
    """Judge every cut, shaped or left unchanged, and what lies between them; prove that nothing else changed."""
    machine, rapids = plan.machine, shaped.rapids
    emitted_s = plan.pool.submit(plan.model.cycle_time_s, shaped.emitted.core)
    between = plan.rapid_vibration
    rapids_shaped = rapids is not None and rapids.outcome.shaped > 0
    if rapids_shaped:
        between = plan.pool.submit(rapid_vibration_um, shaped.emitted, plan.model)
    proving = None
    # Without header comments nothing tells shaped rapids from cuts.
    if shaped.written.placed and (machine.emission.header or not rapids_shaped):
        proving = plan.pool.submit(prove, plan.program, shaped.emitted, machine, rapids_shaped=rapids_shaped)
    every = sorted(
        [*zip(shaped.written.placed, shaped.figures, strict=True), *_unchanged(plan, shaped)],
        key=lambda pair: pair[0].original_lines,
    )
    figures = plan.judge.summarise(
        [each for _, each in every], [place for place, _ in every], plan.grid.block_period_s,
        Pair(plan.rapid_vibration.result(), between.result()),
    )  # fmt: skip
    cuts = _cuts(plan, shaped, figures)
    times = _cycle_time_s(plan, shaped, emitted_s.result(), figures.region_time_s())
    proof = None if proving is None else proving.result()
    grade, reason = recommend(
        figures.all_cuts, original_within=plan.original_within,
        could_gain=any(cut.gain_um >= machine.shaping.least_gain_um for cut in cuts),
        benefit=plan.is_benefit(shaped), other_changes=proof.refused if proof is not None else (),
    )  # fmt: skip
    return ProgramVerdict(figures, cuts, times, proof, grade, reason)


def result_of(plan: ConversionPlan, shaped: Shaped, verdict: ProgramVerdict) -> Conversion:
    """The result: figures, warnings, what they rest on, and what the control will make of the text."""
    program, machine = plan.program, plan.machine
    core, tools = program.core, tools_of_cuts(program)
    # For a core that waits while the last simulations run.
    mark = plan.pool.submit(lambda: shaped.emitted.mark)
    warnings = _warnings(plan, shaped, verdict.figures)
    sensitivity, tried = _sensitivity(plan, shaped)
    originals, curve = [original.result() for original in plan.originals], None
    if plan.choice.tolerance_curve:
        original_um = max((getattr(run, plan.judge.target).max_abs_mm for run in originals), default=0.0) * 1e3
        curve = plan.aims.tolerance_curve(verdict.cycle_time_s.original, original_um)
    mark.result()
    emitted = shaped.emitted.with_verdict(
        good=verdict.grade != "do not run", better=verdict.grade == "better, tolerance not met"
    )
    return Conversion(
        **vars(verdict.figures),
        program=program.source,
        machine=machine.name,
        recommendation=verdict.grade,
        reason=verdict.reason,
        cuts=verdict.cuts,
        tolerance_curve=curve,
        proof=verdict.proof,
        advice=filter_advice(program, machine, plan.model, plan.judge, originals),
        cycle_time_s=verdict.cycle_time_s,
        cutting_time_s=verdict.figures.region_time_s(),
        block_period_s=plan.grid.block_period_s,
        shaper=_used_shaper(plan.grid),
        blocks=BlockCount(core.block_count, shaped.written.blocks),
        expanded=core.expanded,
        expanded_radii_mm={f"D{number}": radius for number, radius in core.expanded_radii_mm.items()},
        bytes_read=core.size,
        bytes_emitted=shaped.written.size,
        limits=AppliedLimits(
            machine.tolerance.contour_um,
            plan.judge.target,
            machine.tolerance.residual_ratio,
            machine.tolerance.residual_floor_um,
            machine.tolerance.residual_floor_increments,
            machine.tolerance.feed_excess_ratio,
            machine.verdict.plant,
            machine.price.program_time_percent,
            machine.price.cut_time_percent,
        ),
        warnings=tuple(warnings),
        budget=plan.spending.outcome(plan.grid, shaped.written) if plan.spending is not None else None,
        rapids=shaped.rapids.outcome if shaped.rapids is not None else None,
        least_gain_um=machine.shaping.least_gain_um,
        parameter_sensitivity=sensitivity,
        unverified_parameters_tested=tried,
        at_the_control=at_the_control(
            shaped.emitted,
            shaped.written.placed,
            shaped.written.loads,
            verdict.figures,
            plan.model,
            plan.grid.block_period_s,
            shaped.written.restarts,
        ),
        restart_points=restart_points(
            program,
            (
                (place, restarts, tools.get(plan.aims.index(place.region)))
                for place, restarts in zip(shaped.written.placed, shaped.written.restarts, strict=True)
            ),
        ),
        emitted=emitted,
        placed=tuple(shaped.written.placed),
        simulated=SimulatedPrograms(program, machine, emitted, plant=machine.verdict.plant),
    )


def _unchanged(plan: ConversionPlan, shaped: Shaped) -> list[tuple[Placed, RegionFigures]]:
    """The cuts left unchanged, as they stand in the emitted program, simulated."""
    left = [index for index, reason in enumerate(plan.reasons) if reason]
    if not left:
        return []
    spans = [(place.first_line, place.last_line) for place in shaped.written.placed]
    spans += [move.emitted_lines for move in shaped.rapids.outcome.moves] if shaped.rapids is not None else []
    regions = unshaped_regions(shaped.emitted, spans, [plan.program.regions[index] for index in left])
    running = [
        None if region.path.moves_as(plan.program.regions[index].path) and index in plan.originals_judged
        else plan.pool.submit(
            simulate_unchanged, plan.judge, plan.model, region, plan.program.regions[index],
            plan.originals[index].result(),
        )
        for index, region in zip(left, regions, strict=True)
    ]  # fmt: skip
    return [
        (
            Placed(plan.program.regions[index], region.first_line, region.last_line),
            plan.originals_judged[index] if run is None else run.result(),
        )
        for index, region, run in zip(left, regions, running, strict=True)
    ]


def _cuts(plan: ConversionPlan, shaped: Shaped, figures: ProgramFigures) -> tuple[CutOutcome, ...]:
    """One row for each cut."""
    tools = tools_of_cuts(plan.program)
    sizes = {
        plan.aims.index(place.region): text.size
        for place, (text, _) in zip(shaped.written.placed, shaped.written.texts, strict=True)
    }
    rows = []
    for index, (region, cut) in enumerate(zip(plan.program.regions, figures.all_cuts, strict=True)):
        read = region.text_end - region.text_begin
        gained = plan.gains_um.get(index)
        if gained is None:
            gained = most_to_gain_um(plan.originals[index].result())
        rows.append(
            outcome_of(
                cut, is_shaped=index in sizes, reason=plan.reasons[index], gain_um=gained,
                tolerance_um=plan.aims.shaped_for_um(index), tool=tools.get(index),
                size=Pair(read, sizes.get(index, read)),
            )
        )  # fmt: skip
    return tuple(rows)


def _sensitivity(plan: ConversionPlan, shaped: Shaped) -> tuple[tuple[Sensitivity, ...], int]:
    """Sensitivity of the shaped cut that comes nearest to a limit."""
    deciding = plan.judge.deciding(shaped.figures, shaped.written.placed)
    if deciding is None:
        return (), 0
    simulated = zip(shaped.written.placed, shaped.figures, shaped.trackers, strict=True)
    return parameter_sensitivity(
        plan.judge, plan.machine, list(simulated), shaped.emitted, deciding, plan.pool,
        shaped.started, partial(plan.on_progress, "sensitivity to unverified parameters"),
    )  # fmt: skip


def _cycle_time_s(plan: ConversionPlan, shaped: Shaped, emitted_s: float, cutting: Pair[float]) -> Pair[float]:
    """What `shapegcode time` says of both texts."""
    original_s = plan.original_s.result()
    if plan.machine.emission.header:
        return Pair(original_s, emitted_s)
    # Nothing in such a text says which regions are shaped.
    added_s = plan.machine.emission.prefill_dwell_s * len(shaped.written.placed)
    added_s += shaped.rapids.extra_s if shaped.rapids else 0.0
    return Pair(original_s, original_s - cutting.original + cutting.emitted + added_s)


def _warnings(plan: ConversionPlan, shaped: Shaped, figures: ProgramFigures) -> list[str]:
    program, machine, written = plan.program, plan.machine, shaped.written
    warnings = [*program.warnings, *written.kept_warnings, *machine_warnings(machine)]
    warnings += _other_control(machine)
    warnings += [plan.grid.note] if plan.grid.note else []
    warnings += region_range_warnings(program.regions, machine)
    if plan.spending is not None and (sentence := plan.spending.warning(plan.grid)):
        warnings.append(sentence)
    elif not program.regions:
        warnings.append(f"{program.source}: no cutting moves that can be shaped: its motion is unchanged")
    if not written.placed:
        # Where something was shaped, the sensitivity to unverified parameters names them.
        warnings += open_axes(program, machine)
    warnings += simulation_warnings(program, figures, machine, is_priced=bool(plan.aims.priced))
    warnings += text_warnings(program, written.placed, figures, machine, written.size, written.blocks)
    warnings += [why for _, _, why in ini_lines([place.blocks(shaped.emitted) for place in written.placed], machine)]
    return warnings + (shaped.rapids.warnings if shaped.rapids is not None else [])


def _other_control(machine: Machine) -> list[str]:
    """Where the program is written for another control than its planner is judged by."""
    kind, name = machine.controller.kind, machine.emission.dialect
    if kind == "grbl":
        return [
            "no dialect for GRBL: the program has words that GRBL does not read (O, M06, G43, G64 and others): "
            "take them out with emission.words, and read every line before it is run"
        ]
    if (name if name in {"linuxcnc", "klipper"} else "fanuc") == kind:
        return []
    judged = {"fanuc": "a FANUC control's", "linuxcnc": "LinuxCNC's", "klipper": "Klipper's"}[kind]
    return [
        f'emission.dialect = "{name}", but the motion is judged by {judged} planner (controller.kind = "{kind}"): '
        "residual vibration and time hold only if both are the control that runs the program"
    ]


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


def prove(original: Program, emitted: Program, machine: Machine, *, rapids_shaped: bool) -> ChangeProof:
    """Compare an emitted program with its original; what shaping changes is allowed.

    The verdict judges how far the response leaves the path. A shaped command leaves it further (up to three tolerances
    in the conversions of the tests): what is beyond `_PATH_TOLERANCES` and `_PATH_UM` is a part that was left out.
    """
    kinds = {"feeds", "blocks", "calls"}
    kinds |= {"shaped-rapids"} if rapids_shaped else set()
    kinds |= {"compensation"} if original.core.expanded_radii_mm else set()
    path_um = max(_PATH_TOLERANCES * machine.tolerance.contour_um, _PATH_UM)
    found = compare(original, emitted, machine, allow=Allowed(frozenset(kinds), path_um))
    # Without header comments nothing says that lines of emission.* are the converter's own.
    refused = tuple(each for each in found.refused if machine.emission.header or each.kind != "emission")
    return ChangeProof(found.answer, found.counts, found.path_um, refused)
