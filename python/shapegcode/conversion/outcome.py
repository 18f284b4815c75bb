"""Assemble the result of a conversion: simulate the whole emitted program for its verdict, and collect the figures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from shapegcode import _core
from shapegcode.conversion import tables
from shapegcode.conversion.operating import at_the_control
from shapegcode.conversion.plan import ConversionPlan, Shaped
from shapegcode.conversion.restart import restart_points
from shapegcode.conversion.result import ChangeProof, Conversion, FilterAdvice, Grade
from shapegcode.conversion.whole_text import Written
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel, ini_lines
from shapegcode.model.modes import machine_warnings, region_range_warnings
from shapegcode.model.programs import SimulatedPrograms
from shapegcode.program import Program, written_increment_mm
from shapegcode.program.comparison import Allowed, ProgramDifference, compare
from shapegcode.program.stamp import no_room
from shapegcode.results.outcome import Pair
from shapegcode.shaping.grid import Grid
from shapegcode.verdict import figures as parts, judge as judging
from shapegcode.verdict.figures import Placed, ProgramFigures, RegionVerdict

_MOSTLY = 0.7  # least ratio of the command's contour error to the target's, if the filter is its cause
_TRIALS = (0.9, 0.7, 0.5)  # tried ratios to the time constant that suffices if rounding is proportional to it
# A warning is issued for a figure worse than the original's by this ratio and by this size in um.
_WORSE_RATIO, _WORSE_UM = 1.2, 5.0
# Permitted distance of the emitted path from the original's: the larger of both.
_PATH_TOLERANCES, _PATH_UM = 10.0, 200.0


@dataclass(frozen=True)
class ProgramVerdict:
    """Verdict of the whole emitted program against its limits, its price and its original."""

    figures: ProgramFigures
    cuts: tuple[tables.CutOutcome, ...]
    cycle_time_s: Pair[float]
    proof: ChangeProof | None
    grade: Grade
    reason: str


def judge(plan: ConversionPlan, shaped: Shaped) -> ProgramVerdict:
    """Judge every cut, shaped or left unchanged, and the moves between them; prove that nothing else changed."""
    machine, rapids = plan.machine, shaped.rapids
    emitted_s = plan.pool.submit(plan.model.cycle_time_s, shaped.emitted.core)
    between = plan.rapid_vibration
    rapids_shaped = rapids is not None and rapids.outcome.shaped > 0
    if rapids_shaped:
        between = plan.pool.submit(judging.rapid_vibration_um, shaped.emitted, plan.model)
    proving = None
    # Without a header, shaped rapids cannot be distinguished from cuts.
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
    """Assemble the result: figures, warnings, parameter sensitivity, notes for the control."""
    program, machine, written = plan.program, plan.machine, shaped.written
    core, tolerance, tools_by_index = program.core, machine.tolerance, tables.tools_of_cuts(program)
    tools = [tools_by_index.get(plan.aims.index(place.region)) for place in written.placed]
    # On a processor that is idle during the last simulations.
    mark = plan.pool.submit(lambda: shaped.emitted.mark)
    warnings = _warnings(plan, shaped, verdict.figures)
    sensitivity, tried = _sensitivity(plan, shaped)
    originals, curve = [original.result() for original in plan.originals], None
    if plan.choice.tolerance_curve:
        original_um = max((getattr(run, plan.judge.target).max_abs_mm for run in originals), default=0.0) * 1e3
        curve = plan.aims.tolerance_curve(verdict.cycle_time_s.original, original_um)
    mark.result()
    grade = verdict.grade
    emitted = shaped.emitted.with_verdict(good=grade != "do not run", better=grade == "better, tolerance not met")
    return Conversion(
        **vars(verdict.figures),
        program=program.source,
        machine=machine.name,
        recommendation=grade,
        reason=verdict.reason,
        cuts=verdict.cuts,
        tolerance_curve=curve,
        proof=verdict.proof,
        advice=_filter_advice(plan, originals),
        cycle_time_s=verdict.cycle_time_s,
        cutting_time_s=verdict.figures.region_time_s(),
        block_period_s=plan.grid.block_period_s,
        shaper=_used_shaper(plan.grid),
        blocks=parts.BlockCount(core.block_count, written.blocks),
        expanded=core.expanded,
        expanded_radii_mm={f"D{number}": radius for number, radius in core.expanded_radii_mm.items()},
        bytes_read=core.size,
        bytes_emitted=written.size,
        limits=parts.AppliedLimits(
            tolerance.contour_um,
            plan.judge.target,
            tolerance.residual_ratio,
            tolerance.residual_floor_um,
            tolerance.residual_floor_increments,
            tolerance.feed_excess_ratio,
            machine.verdict.plant,
            machine.price.program_time_percent,
            machine.price.cut_time_percent,
        ),
        warnings=tuple(warnings),
        budget=plan.spending.outcome(plan.grid, written) if plan.spending is not None else None,
        rapids=shaped.rapids.outcome if shaped.rapids is not None else None,
        least_gain_um=machine.shaping.least_gain_um,
        parameter_sensitivity=sensitivity,
        unverified_parameters_tested=tried,
        at_the_control=at_the_control(
            program, shaped.emitted, written, verdict.figures, plan.model, plan.grid.block_period_s
        ),
        restart_points=restart_points(program, zip(written.placed, written.restarts, tools, strict=True)),
        emitted=emitted,
        placed=tuple(written.placed),
        simulated=SimulatedPrograms(program, machine, emitted, plant=machine.verdict.plant),
    )


def _unchanged(plan: ConversionPlan, shaped: Shaped) -> list[tuple[Placed, judging.RegionFigures]]:
    left = [index for index, reason in enumerate(plan.reasons) if reason]
    if not left:
        return []
    spans = [(place.first_line, place.last_line) for place in shaped.written.placed]
    spans += [move.emitted_lines for move in shaped.rapids.outcome.moves] if shaped.rapids is not None else []
    cuts = [plan.program.regions[index] for index in left]
    found = [*zip(left, cuts, judging.unshaped_regions(shaped.emitted, spans, cuts), strict=True)]
    running = {
        index: plan.pool.submit(plan.judge.simulate_unchanged, mine, cut, plan.originals[index].result())
        for index, cut, mine in found
        if index not in plan.originals_judged or not mine.path.moves_as(cut.path)
    }
    simulated = plan.originals_judged | {index: run.result() for index, run in running.items()}
    return [(Placed(cut, mine.first_line, mine.last_line), simulated[index]) for index, cut, mine in found]


def _cuts(plan: ConversionPlan, shaped: Shaped, figures: ProgramFigures) -> tuple[tables.CutOutcome, ...]:
    tools = tables.tools_of_cuts(plan.program)
    sizes = {
        plan.aims.index(place.region): text.size
        for place, (text, _) in zip(shaped.written.placed, shaped.written.texts, strict=True)
    }
    rows = []
    for index, (region, cut) in enumerate(zip(plan.program.regions, figures.all_cuts, strict=True)):
        read = region.text_end - region.text_begin
        gained = plan.gains_um.get(index)
        if gained is None:
            gained = judging.max_gain_um(plan.originals[index].result())
        residual, reason, is_shaped = cut.residual_vibration_um, plan.reasons[index], index in sizes
        rows.append(
            tables.CutOutcome(
                lines=cut.lines,
                emitted_lines=cut.emitted_lines,
                tool=tools.get(index),
                is_shaped=is_shaped,
                reason=reason,
                gain_um=gained,
                residual_um=Pair(max(residual.original), max(residual.emitted)),
                contour_um=Pair(cut.original_contour_error_um, cut.contour_error_um),
                tolerance_um=plan.aims.shaped_for_um(index),
                time_s=cut.time_s,
                bytes=Pair(read, sizes.get(index, read)),
                misses=cut.misses,
                remedy="" if is_shaped or not cut.misses else tables.remedy_for(reason),
            )
        )
    return tuple(rows)


def _sensitivity(plan: ConversionPlan, shaped: Shaped) -> tuple[tuple[tables.Sensitivity, ...], int]:
    deciding = plan.judge.deciding(shaped.figures, shaped.written.placed)
    if deciding is None:
        return (), 0
    simulated = zip(shaped.written.placed, shaped.figures, shaped.trackers, strict=True)
    return tables.parameter_sensitivity(
        plan.judge, plan.machine, list(simulated), shaped.emitted, deciding, plan.pool,
        shaped.started, partial(plan.on_progress, "sensitivity to unverified parameters"),
    )  # fmt: skip


def _cycle_time_s(plan: ConversionPlan, shaped: Shaped, emitted_s: float, cutting: Pair[float]) -> Pair[float]:
    """Cycle times of both programs as by `shapegcode time`."""
    original_s = plan.original_s.result()
    if plan.machine.emission.header:
        return Pair(original_s, emitted_s)
    # Without a header the shaped regions cannot be recognised.
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
        # In a shaped program the parameter sensitivity lists them.
        warnings += _open_axes(program, machine)
    warnings += _simulation_warnings(plan, figures)
    warnings += _text_warnings(plan, written, figures)
    warnings += [why for _, _, why in ini_lines([place.blocks(shaped.emitted) for place in written.placed], machine)]
    return warnings + (shaped.rapids.warnings if shaped.rapids is not None else [])


def _other_control(machine: Machine) -> list[str]:
    kind, name = machine.controller.kind, machine.emission.dialect
    if kind == "grbl":
        return [
            "no dialect for GRBL: the program has words that GRBL does not read (O, M06, G43, G64 and others): "
            "remove them with emission.words, and read every line before it is run"
        ]
    if (name if name in {"linuxcnc", "klipper"} else "fanuc") == kind:
        return []
    judged = {"fanuc": "a FANUC control's", "linuxcnc": "LinuxCNC's", "klipper": "Klipper's"}[kind]
    return [
        f'emission.dialect = "{name}", but the motion is simulated with {judged} planner (controller.kind = "{kind}"): '
        "residual vibration and time are valid only if both are the control that runs the program"
    ]


def _used_shaper(grid: Grid) -> parts.UsedShaper:
    following = None
    if grid.track is not None:
        nodes = grid.track.nodes
        following = parts.FollowingShapers(
            "xyz"[grid.track.axis],
            tuple(node.position_mm for node in nodes),
            tuple(tuple(node.shaper.times_s) for node in nodes),
            tuple(tuple(node.shaper.amplitudes) for node in nodes),
            grid.track.worst_residual,
        )
    return parts.UsedShaper(
        tuple(grid.shaper.times_s),
        tuple(grid.shaper.amplitudes),
        grid.family,
        grid.duration_s,
        tuple(parts.GridTaps(tuple(fir.delays), tuple(fir.taps)) for fir in grid.axis_firs),
        grid.per_axis_duration_s,
        following,
    )


def prove(original: Program, emitted: Program, machine: Machine, *, rapids_shaped: bool) -> ChangeProof:
    """Compare an emitted program with its original; changes by shaping are allowed.

    The verdict limits the deviation of the response, or of the command if that is the target. The programmed path of
    the blocks deviates further (up to three tolerances in the conversions of the tests); more than the larger of
    `_PATH_TOLERANCES` tolerances and `_PATH_UM` means that a part was left out.
    """
    kinds = {"feeds", "blocks", "calls"}
    kinds |= {"shaped-rapids"} if rapids_shaped else set()
    kinds |= {"compensation"} if original.core.expanded_radii_mm else set()
    path_um = max(_PATH_TOLERANCES * machine.tolerance.contour_um, _PATH_UM)
    found = compare(original, emitted, machine, allow=Allowed(frozenset(kinds), path_um))
    # Without a header, lines of emission.* cannot be recognised as the converter's own.
    refused = tuple(each for each in found.refused if machine.emission.header or each.kind != "emission")
    return ChangeProof(found.answer, found.counts, found.path_um, refused)


def recommend(
    cuts: Sequence[RegionVerdict],
    *,
    original_within: bool,
    could_gain: bool,
    benefit: bool,
    other_changes: Sequence[ProgramDifference] = (),
) -> tuple[Grade, str]:
    """The grade of a program and its reason: the first that applies, from "do not run" upwards.

    `original_within`: every cut of the original keeps its limits. `could_gain`: shaping gains enough in some cut, or
    might. `benefit`: a shaped cut gains enough. `other_changes`: not caused by shaping, so a defect of shapegcode.
    """
    if worse := next((_at(cut, why) for cut in cuts for why in cut.worse), ""):
        return "do not run", worse
    for change in other_changes:
        had, has = change.original or "nothing", change.emitted or "nothing"
        return "do not run", f"{change.place}: {change.kind} changed: {had} became {has}: please report this defect"
    if not cuts:
        return "no benefit: run the original", "there is nothing to shape"
    if not could_gain or (not benefit and not original_within):
        return "no benefit: run the original", "nothing that misses its limit gets noticeably better"
    if original_within:
        return "already within tolerance: shaping is optional", "every cut of the original keeps its limits"
    if missed := next((_at(cut, why) for cut in cuts for why in cut.misses), ""):
        return "better, tolerance not met", missed
    return "worth running", "every cut keeps its limits and its price"


def _at(cut: RegionVerdict, why: str) -> str:
    return "lines {} to {}: {}".format(*cut.lines, why)


def _filter_advice(plan: ConversionPlan, originals: Sequence[_core.SimulationFigures]) -> FilterAdvice | None:
    """Find a smaller filter of the control with which the original keeps its limits without shaping."""
    machine = plan.machine
    limit_um, floor_um = machine.tolerance.contour_um, machine.tolerance.residual_floor_um
    errors = [(getattr(run, plan.judge.target).max_abs_mm * 1e3, run.command.max_abs_mm * 1e3) for run in originals]
    if not any(error > limit_um for error, _ in errors):
        return None
    if any(float(run.residual_mm.max()) * 1e3 > floor_um for run in originals):
        return None  # vibration must be removed in any case
    if any(error > limit_um and command < _MOSTLY * error for error, command in errors):
        return None
    field = "look_ahead_filter_time_constant_s" if machine.controller.motion == "look_ahead" else "time_constant_s"
    now_s, period_s = getattr(machine.controller, field), plan.model.period_s
    worst = max(range(len(errors)), key=lambda index: errors[index][0])
    region = plan.program.regions[worst]
    for trial in _TRIALS if now_s > 0.0 else ():
        enough_s = math.floor(now_s * trial * limit_um / errors[worst][0] / period_s) * period_s
        if _keeps(plan, f"controller.{field}", enough_s):
            lines = (region.first_line, region.last_line)
            return FilterAdvice(f"controller.{field}", now_s, enough_s, errors[worst][1], lines)
    return None


def _keeps(plan: ConversionPlan, key: str, value: float) -> bool:
    model, tolerance = MachineModel(plan.machine.with_values(key, value)), plan.machine.tolerance
    limit_mm, floor_mm = tolerance.contour_um * 1e-3, tolerance.residual_floor_um * 1e-3
    runs = (model.simulate_original(each.path, offset=model.offset(each)) for each in plan.program.regions)
    return all(
        getattr(run, plan.judge.target).max_abs_mm <= limit_mm and float(run.residual_mm.max()) <= floor_mm
        for run in runs
    )


def _open_axes(program: Program, machine: Machine) -> list[str]:
    return [
        f"{letter.upper()} moves, but it is not known whether it has a vibration mode: assumed rigid; "
        f"tap it (shapegcode identify), or set axes.{letter}.rigid = true"
        for letter in tables.unknown_axes(machine)
        if any(region.path.extent_mm["xyz".index(letter)] > 0.0 for region in program.regions)
    ]


def _simulation_warnings(plan: ConversionPlan, figures: ProgramFigures) -> Iterator[str]:
    program = plan.program
    expanded = " expanded" if program.core.expanded else ""
    for region in figures.regions:
        for miss in region.misses:
            yield f"{program.place(region.lines[0])}: lines {region.lines[0]} to {region.lines[1]}{expanded}: {miss}"
    yield from _binding(plan, figures)
    pairs = [
        (f"{name} {axis.upper()}", both.original[axis], both.emitted[axis])
        for name, both in (
            ("residual vibration", figures.residual_vibration_um),
            ("peak vibration", figures.peak_vibration_um),
        )
        for axis in "xyz"
    ]
    response = figures.contour_error_um.response
    pairs.append(("contour error of the machine table", response.original.max, response.emitted.max))
    for name, before, after in pairs:
        if after > _WORSE_RATIO * before and after - before > _WORSE_UM:
            yield f"{name} is larger than the original's: {before:.1f} -> {after:.1f} um"


def _binding(plan: ConversionPlan, figures: ProgramFigures) -> Iterator[str]:
    """Yield tolerances that a conversion exceeds, with the value reached and a feasible one."""
    tolerance = plan.machine.tolerance
    contour = max((region.contour_error_um for region in figures.regions), default=0.0)
    if contour > tolerance.contour_um:
        rounding_um = math.sqrt(2.0) * written_increment_mm(plan.machine, 21) * 1e3
        how = "within the price (price.*)" if plan.aims.is_priced else "with the feed lowered as far as useful"
        share = f"; up to {rounding_um:.1f} um of it by rounding of the words"
        yield (
            f"tolerance.contour_um = {tolerance.contour_um:g} is exceeded: {contour:.1f} um were reached "
            f"{how}{share if rounding_um > 0.2 * contour else ''}; "
            f"feasible: {_rounded_up(contour):g} um"
        )
    over = [
        (left, limit)
        for region in figures.regions
        for left, limit in zip(region.residual_vibration_um.emitted, region.residual_limit_um, strict=True)
        if left > limit
    ]
    if over:
        left, limit = max(over)
        yield (
            f"the tolerance of residual vibration is exceeded: {left:.2f} um remain, limit {limit:.2f} um "
            f"(tolerance.residual_*); feasible: tolerance.residual_floor_um = {_rounded_up(left):g}, "
            "or a longer shaper (`shapegcode shaper`)"
        )


def _rounded_up(value: float) -> float:
    value *= 1.05
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / step) * step


def _text_warnings(plan: ConversionPlan, written: Written, figures: ProgramFigures) -> Iterator[str]:
    program, machine, placed, size = plan.program, plan.machine, written.placed, written.size
    controller, emission = machine.controller, machine.emission
    on = next((place.region for place in placed if place.region.look_ahead_mode), None)
    if on is not None and not emission.prologue:
        yield (
            f"{program.place(on.first_line)}: shaped blocks run while the program's look-ahead mode is on; the verdict "
            'is for look-ahead off: set emission.prologue = ["G05.1Q0"] and emission.epilogue = ["G05.1Q1"]'
        )
    fastest = max(axis.max_feed_mm_per_min for axis in machine.axes.as_tuple())
    fast = next((place.region for place in placed if place.region.path.fastest_feed_mm_per_s * 60.0 > fastest), None)
    if fast is not None:
        yield (
            f"{program.place(fast.first_line)}: programmed feed {fast.path.fastest_feed_mm_per_s * 60.0:g} mm/min is "
            f"over the limit of every axis ({fastest:g} mm/min, axes.*.max_feed_mm_per_min): shaped at the axes' limits"
        )
    if size > controller.program_memory_bytes:
        yield (
            f"the emitted program has {size} bytes, the controller's memory {controller.program_memory_bytes} "
            f"(controller.program_memory_bytes): {no_room(controller.program_memory_bytes)}"
        )
    cutting_s = figures.region_time_s().emitted
    if controller.dnc_baud > 0 and written.blocks > 0 and cutting_s > 0.0:
        needed = size * controller.dnc_bits_per_character / cutting_s
        if needed > controller.dnc_baud:
            yield (
                f"drip feeding needs {needed:.0f} baud on average, the line has {controller.dnc_baud} "
                "(controller.dnc_baud): the buffer will run empty"
            )
    if figures.slowed_blocks and not emission.leaves_look_ahead:
        example = ', for example ["G05.1Q0"]' if emission.dialect == "fanuc" else ""
        yield (
            f"{figures.slowed_blocks} of {written.blocks} shaped blocks change the speed of an axis by more than "
            "controller.corner_speed_difference_mm_per_min: run them with the look-ahead mode off "
            f"(emission.prologue{example}), or look-ahead slows them down"
        )
