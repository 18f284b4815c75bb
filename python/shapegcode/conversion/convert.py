"""The converter, in the order of the figure in ARCHITECTURE.md; some of its boxes are in `plan` and `outcome`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import compress
from pathlib import Path

from shapegcode import _core
from shapegcode.conversion.budget import Budget
from shapegcode.conversion.outcome import judge, result_of
from shapegcode.conversion.plan import ConversionPlan, CutChoice, Progress, Shaped
from shapegcode.conversion.result import Conversion
from shapegcode.conversion.tables import StartedTrials, chosen_cuts, start_trials
from shapegcode.conversion.whole_text import Written
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.program.compensation import program_for_conversion
from shapegcode.program.computer import cores
from shapegcode.program.stamp import RAPID_MARK, REGION_MARK, STAMP_BEGIN
from shapegcode.shaping.grid import Grid

_ATTEMPTS = 10  # for cuts beyond tolerance, feed or price; few need more than two
_PRICE_ROUNDS = 6


def convert(
    program: Program | str | Path,
    machine: Machine | str | Path,
    *,
    contour: str | None = None,
    contour_tolerance_um: float | None = None,
    shaper: str | None = None,
    per_axis: bool | None = None,
    planner: str | None = None,
    dialect: str | None = None,
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
    """Shape the cuts of a program, and simulate the whole emitted program for its verdict.

    An option with a key below, such as `shaping.contour`, has the value of the machine file if it is None; else it is
    checked like that value.

    Args:
        program: the program to convert, or its file.
        machine: controller, modes, tolerances.
        contour: target of contour compensation, "response", "command" or "off": `shaping.contour`.
        contour_tolerance_um: permitted deviation of the target from the path, µm: `tolerance.contour_um`.
        shaper: family of the shaper, such as "zvd": `shaping.family`.
        per_axis: one shaper per axis: `shaping.per_axis`.
        planner: planner of a cut before it is shaped, "look-ahead", "optimal" or "auto": `shaping.planner`.
        dialect: control for which the program is written, such as "linuxcnc": `emission.dialect`.
        rapids: write rapids as shaped moves where that saves time: `shaping.rapids`.
        budget: limits of the emitted program; None: no limit.
        arc_feed_ratio: feed on arcs relative to the programmed one, reached before the arc: `shaping.arc_feed_ratio`.
        block_period_s: block period, s: `emission.block_period_s`; if neither is set, `choose_grid` chooses it.
        max_time_increase_percent: largest increase of the program's time: `price.program_time_percent`.
        max_cut_time_increase_percent: largest increase of the time of one cut: `price.cut_time_percent`.
        only: ranges of lines of the expanded program (first, last): shape only the cuts with a line in one; None: all.
        leave: ranges of lines of the expanded program (first, last): leave the cuts with a line in one unchanged.
        shape_all: shape every cut that can be shaped within the limits of ``[price]``, even if it gains less than
            `shaping.least_gain_um`, gets worse, or the program is within tolerance. False: such cuts stay unchanged.
        tolerance_curve: compute the cycle time at other contour tolerances.
        on_progress: called with stage, number of finished parts and number of parts.

    Returns:
        The emitted program with its verdict. No file is written: `conversion.text` is the content of one.

    Raises:
        ProgramError: the program cannot be read, is shaped already, or a region cannot be written.
        OSError: its file cannot be read.
        MachineError: a value that is invalid in a machine file.
        DesignError: no shaper exists within `shaping.max_duration_s`.
        ArgumentError: the program was read with settings that differ from the machine's; a machine without modes, a
            block period that the controller cannot run, a budget that cannot be kept, lines without a cut.
        RoundTripError: the emitted program would not be equivalent: a defect of shapegcode.
    """
    stated = {
        "shaping.contour": contour,
        "tolerance.contour_um": contour_tolerance_um,
        "shaping.family": shaper,
        "shaping.per_axis": per_axis,
        "shaping.planner": planner,
        "emission.dialect": dialect,
        "shaping.rapids": rapids,
        "shaping.arc_feed_ratio": arc_feed_ratio,
        "price.program_time_percent": max_time_increase_percent,
        "price.cut_time_percent": max_cut_time_increase_percent,
    }
    for name, value in (("shape_all", shape_all), ("tolerance_curve", tolerance_curve)):
        if not isinstance(value, bool):
            raise _core.ArgumentError(f"{name} = {value!r}: must be True or False")
    program, machine = read(program, machine, stated)
    if is_foreign := machine.emission.dialect != "fanuc":
        # A large module that FANUC programs do not need.
        from shapegcode.conversion.translate import require_dialect, with_dialect

        require_dialect(program, machine, budget)
    choice = CutChoice(chosen_cuts(program, only, leave), shape_all, tolerance_curve)
    pool = ThreadPoolExecutor(max_workers=cores())
    try:
        plan = ConversionPlan(program, machine, block_period_s, budget, choice, pool, on_progress)
        plan.leave_out()
        choose_block_period(plan)
        shaped = keep_what_pays(plan, settle(plan))
        if machine.shaping.rapids:
            shaped = shape_rapids(plan, shaped)
        shaped = _as_it_was(plan, shaped)
        conversion = result_of(plan, shaped, judge(plan, shaped))
        return with_dialect(conversion) if is_foreign else conversion
    finally:
        pool.shutdown(cancel_futures=True)


def read(
    program: Program | str | Path, machine: Machine | str | Path, stated: Mapping[str, object]
) -> tuple[Program, Machine]:
    """Read the program for shaping, and apply the options to the machine."""
    machine = Machine.of(machine)
    if given := {key: value for key, value in stated.items() if value is not None}:
        machine = machine.with_values(given, source="options of convert")
    program = program_for_conversion(program, machine)
    program.refuse_shaped("convert the original")
    # Refuse comments of the original that mark shaped blocks in an emitted program.
    for mark in (REGION_MARK.encode(), RAPID_MARK.encode(), STAMP_BEGIN):
        if (at := program.core.find(mark)) >= 0:
            line = program.core.slice(0, at).count(b"\n") + 1
            raise _core.ProgramError(
                f"{program.place(line)}:1: the comment {mark.decode()} marks shaped blocks in an emitted program: "
                "change it"
            )
    return program, machine


def choose_block_period(plan: ConversionPlan) -> None:
    """Choose the grid again if a budget limits the rate and the block period is not fixed."""
    spending = plan.spending
    if spending is not None and spending.budget.limits_rate and not plan.fixed_period:
        weights = [float(original.result().residual_mm.max()) for original in plan.originals]
        plan.grid = spending.choose_period(plan.grid, weights, plan.grid_for, partial(write, plan))


def settle(plan: ConversionPlan) -> Shaped:
    """Write, read back and simulate; repeat, up to `_ATTEMPTS` times, while a cut exceeds tolerance, feed or price."""
    for attempt in range(_ATTEMPTS):
        written = write(plan, plan.grid, "shaping" if attempt == 0 else "shaping again, slower")
        shaped = simulate(plan, written, read_back(plan, written), prefetch=attempt == 0)
        figures, aims = shaped.figures, plan.aims
        aims.note(written, figures)
        changed = aims.slow_down(written, figures)
        last = attempt + 1 == _ATTEMPTS
        changed = (not last and aims.tighten(written, figures, plan.judge)) or changed
        changed = aims.keep_cut_price(written, plan.is_keepable, _ATTEMPTS - 1 - attempt) or changed
        if not changed:
            return shaped
        shaped.trackers.clear()  # free memory before the next program is written
        for run in shaped.started.values():
            run.cancel()
    written = write(plan, plan.grid)
    return simulate(plan, written, read_back(plan, written))


def write(plan: ConversionPlan, grid: Grid, stage: str = "") -> Written:
    """Shape the chosen cuts on a grid, and write the whole program."""
    plan.use_grid(grid)
    # Cuts left unchanged for a budget or by choice are listed in the table of cuts.
    left_unchanged = {} if plan.spending is None else plan.spending.left_unchanged
    unreported = {*left_unchanged, *plan.left, *plan.aims.emitted_s}
    on_progress = partial(plan.on_progress, stage) if stage else lambda _done, _total: None
    written = plan.writer.write(plan.reasons, plan.aims.wanted(), unreported, on_progress)
    for index, reason in written.no_room.items():
        plan.reasons[index] = reason
    plan.note_curves(written)
    return written


# The program read back, and trackers of its new cuts, by rank among the shaped cuts.
ReadBack = tuple[Program, dict[int, _core.ContourTracker]]


def read_back(plan: ConversionPlan, written: Written) -> ReadBack:
    """Read the program back, and compare its end points and modal state with the original."""
    following = {
        rank: plan.pool.submit(_core.ContourTracker, place.region.path)
        for rank, (place, (text, _)) in enumerate(zip(written.placed, written.texts, strict=True))
        if (known := plan.simulated.get(plan.aims.index(place.region))) is None or known[0] is not text
    }
    emitted = written.read_back(plan.machine)
    return emitted, {rank: each.result() for rank, each in following.items()}


def simulate(plan: ConversionPlan, written: Written, text: ReadBack, *, prefetch: bool = False) -> Shaped:
    """Simulate every shaped cut with new text; `prefetch`: also start the sensitivity analysis of the deciding cut."""
    placed, (emitted, trackers) = written.placed, text
    indices = [plan.aims.index(place.region) for place in placed]
    places = [placed[rank] for rank in trackers]
    running = plan.judge.begin(emitted, places, list(trackers.values()), plan.pool)
    started: StartedTrials = {}
    if prefetch and cores() > 1 and len(placed) == len(trackers) == 1:
        started = start_trials(plan.judge, plan.machine, places[0], emitted, trackers[0], plan.pool)
    originals = [plan.originals[indices[rank]] for rank in trackers]
    found = plan.judge.figures(running, originals, partial(plan.on_progress, "round trip"))
    for rank, figures in zip(trackers, found, strict=True):
        plan.simulated[indices[rank]] = written.texts[rank][0], figures
    return Shaped(
        written, emitted, [plan.simulated[index][1] for index in indices],
        [trackers.get(rank) for rank in range(len(placed))], started,
    )  # fmt: skip


def keep_what_pays(plan: ConversionPlan, shaped: Shaped) -> Shaped:
    """Leave cuts unchanged for the budget or small gain; for the price loosen tolerances or leave more unchanged."""
    while plan.spending is not None and plan.spending.give_up(plan.grid, shaped.written, plan.verdicts(shaped)):
        for index, left_unchanged in plan.spending.left_unchanged.items():
            plan.reasons[index] = left_unchanged.reason
        shaped = settle(plan)
    shaped = _without_what_gains_nothing(plan, shaped)
    for _ in range(_PRICE_ROUNDS):
        excess_s = plan.excess_s(shaped)
        gains = {index: plan.gains_um.get(index, 0.0) for index in plan.chosen}
        if excess_s <= 0.0 or not plan.aims.keep_program_price(excess_s, gains, plan.is_keepable):
            break
        shaped = _without_what_gains_nothing(plan, settle(plan))
    if not plan.choice.shape_all and not plan.is_benefit(shaped):
        chosen = plan.chosen
        plan.leave_everything("")
        shaped = _rewritten(plan, shaped, chosen)
    return shaped


def _without_what_gains_nothing(plan: ConversionPlan, shaped: Shaped) -> Shaped:
    """Leave cuts unchanged that gained too little or became worse."""
    least = plan.machine.shaping.least_gain_um
    chosen = plan.chosen
    for index, figures, verdict in zip(chosen, shaped.figures, plan.verdicts(shaped), strict=True):
        gained = plan.gains_um[index] = figures.gain_um
        stays = not plan.is_keepable(index) or plan.choice.shape_all
        if not stays and (gained < least or verdict.worse):
            plan.leave(index, verdict.worse[0] if verdict.worse else f"shaping gains {gained:.1f} µm")
    return _rewritten(plan, shaped, chosen)


def _rewritten(plan: ConversionPlan, shaped: Shaped, before: Sequence[int]) -> Shaped:
    """Write again with some cuts left unchanged; the others are neither shaped nor simulated again."""
    stay = [not plan.reasons[index] for index in before]
    if all(stay):
        return shaped
    written = write(plan, plan.grid)
    figures, trackers = [*compress(shaped.figures, stay)], [*compress(shaped.trackers, stay)]
    return Shaped(written, written.read_back(plan.machine), figures, trackers, {})


def _as_it_was(plan: ConversionPlan, shaped: Shaped) -> Shaped:
    """If nothing was shaped and the input was a single FANUC program, return it instead of its expansion."""
    rapids_shaped = shaped.rapids is not None and shaped.rapids.outcome.shaped > 0
    # A foreign program was given in another dialect than the emitted one.
    is_other = plan.program.number is not None or plan.program.foreign is not None
    if shaped.written.placed or rapids_shaped or is_other:
        return shaped
    return replace(shaped, written=replace(shaped.written, size=plan.program.size), emitted=plan.program)


def shape_rapids(plan: ConversionPlan, shaped: Shaped) -> Shaped:
    """Replace rapids by shaped moves where that saves time; none if the program would exceed its price."""
    from shapegcode.conversion.rapids import shape

    found = shape.shape_rapids(shaped.emitted, shaped.written.placed, plan.model, plan.grid, plan.pool, plan.budget)
    price_s, outcome, count = plan.price_s(), found.outcome, found.outcome.shaped
    if plan.machine.emission.header:
        added_s = plan.model.cycle_time_s(found.emitted.core) - plan.original_s.result()
    else:
        added_s = plan.excess_s(shaped) + price_s + found.extra_s
    if not count or added_s <= price_s:
        written = replace(shaped.written, size=found.emitted.size, placed=found.placed)
        return replace(shaped, written=written, emitted=found.emitted, rapids=found)
    left = {**outcome.left_unchanged, "the price of the program": count}
    outcome = replace(outcome, shaped=0, left_unchanged=left, time_saved_s=0.0, blocks=0, slowed_blocks=0, moves=())
    why = f"{count} rapids are left unchanged: as cutting moves they would add {added_s:.2f} s"
    warning = f"{why}, price {price_s:.2f} s (price.program_time_percent)"
    return replace(shaped, rapids=replace(found, outcome=outcome, extra_s=0.0, warnings=[warning]))
