"""The converter: regions of a program shaped, written, read back and judged."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from shapegcode import _core
from shapegcode.conversion.advice import filter_advice
from shapegcode.conversion.aims import Aims
from shapegcode.conversion.benefit import gain_um, most_to_gain_um
from shapegcode.conversion.budget import Budget
from shapegcode.conversion.curve import CutCurves, ToleranceCurve
from shapegcode.conversion.cuts import CutOutcome, chosen_cuts, outcome_of, tools_of_cuts
from shapegcode.conversion.operating import at_the_control
from shapegcode.conversion.proof import prove
from shapegcode.conversion.rapids.shape import ShapedRapids, shape_rapids
from shapegcode.conversion.recommendation import Situation, benefits, recommend
from shapegcode.conversion.restart_points import restart_points
from shapegcode.conversion.rests import Begun, RestsOn, begin_rests, rests_on
from shapegcode.conversion.result import Conversion
from shapegcode.conversion.spending import Spending, keepable
from shapegcode.conversion.warnings import open_axes, played_warnings, text_warnings
from shapegcode.conversion.whole_text import TextWriter, Written, why_kept
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import machine_warnings, region_range_warnings
from shapegcode.model.playable import PlayedPrograms
from shapegcode.program import Program
from shapegcode.program.compensation import read_for_conversion, require_decision
from shapegcode.program.stamp import RAPID_MARK, REGION_MARK, STAMP_BEGIN
from shapegcode.results.result import Pair
from shapegcode.shaping.grid import Grid, choose_grid
from shapegcode.verdict.ahead import cores
from shapegcode.verdict.figures import (
    AppliedLimits,
    BlockCount,
    FollowingShapers,
    GridTaps,
    PlayedFigures,
    RegionVerdict,
    UsedShaper,
)
from shapegcode.verdict.judge import Judge, RegionFigures
from shapegcode.verdict.placed import Placed
from shapegcode.verdict.program import rapid_vibration_um, simulate_unchanged, unshaped_regions

__all__ = ["convert"]

_ATTEMPTS = 10  # each for cuts that left their tolerance, ran too fast or cost too much; few need more than two
_PRICE_ROUNDS = 6
_NEAR_PRICE = 0.7  # of the price: from here on the time of the program is worked out in full

Progress = Callable[[str, float, int], None]


def convert(
    program: Program | str | Path,
    machine: Machine,
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
        ArgumentError: a block period that the controller cannot play, a budget without a choice, lines without a cut.
        RoundTripError: the emitted text would not be equivalent: a defect of shapegcode.
    """
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
    if not isinstance(program, Program):
        program = read_for_conversion(program, machine)
    require_decision(program, machine)
    if program.stamp is not None:
        raise _core.ProgramError(
            f"{program.source}:1:1: written by shapegcode already (its header says so): convert the original"
        )
    _refuse_own_marks(program)
    choice = _Choice(chosen_cuts(program, only, leave), shape_all, tolerance_curve)
    # Shapes regions, plays the originals, and what was emitted, on all cores.
    pool = ThreadPoolExecutor(max_workers=cores())
    try:
        return _Run(program, machine, block_period_s, budget, choice, pool, on_progress).conversion()
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


@dataclass(frozen=True)
class _Choice:
    """What the caller chose.

    Attributes:
        not_shaped: why a cut is not to be shaped, by its index.
        shape_all: shape whatever can be shaped.
        tolerance_curve: work out what other tolerances would cost.
    """

    not_shaped: dict[int, str]
    shape_all: bool
    tolerance_curve: bool


@dataclass(frozen=True)
class _Settled:
    """A program written, read back and simulated, with trackers of its cuts, and what is simulated ahead of need."""

    written: Written
    emitted: Program
    figures: list[RegionFigures]
    trackers: list[_core.ContourTracker | None]
    begun: Begun


class _Run:
    """One conversion under way."""

    def __init__(
        self,
        program: Program,
        machine: Machine,
        block_period_s: float | None,
        budget: Budget | None,
        choice: _Choice,
        pool: Executor,
        on_progress: Progress,
    ) -> None:
        self.program, self.machine, self.budget, self.choice = program, machine, budget, choice
        self.pool, self.on_progress = pool, on_progress
        self.fixed_period = block_period_s is not None
        self.model = MachineModel(machine)
        # Simulated while the shapers are designed.
        self.originals = [
            pool.submit(self.model.play_original, region.path, offset=self.model.offset(region))
            for region in program.regions
        ]
        fastest = max((region.path.fastest_feed_mm_per_s for region in program.regions), default=0.0)
        self._grid_for = partial(choose_grid, machine, fastest_mm_per_s=fastest)
        self.grid = self._grid_for(block_period_s)
        self.writer = TextWriter(program, self.model, self.grid, pool)
        self.judge = Judge(self.model)
        self.curves = CutCurves(self.writer_of, program, machine, self.originals)
        self.aims = Aims(
            program, machine,
            [
                choice.not_shaped.get(index) or why_kept(region, machine, self.grid)
                for index, region in enumerate(program.regions)
            ],
            self.curves.of,
        )  # fmt: skip
        self.reasons = self.aims.reasons
        self.gains_um: dict[int, float] = {}
        self.left: set[int] = set(choice.not_shaped)  # of which the table of cuts says why
        self._simulated: dict[int, tuple[object, RegionFigures]] = {}
        self._originals_judged: dict[int, RegionFigures] = {}
        self.spending = None if budget is None else Spending(budget, program, machine)
        if budget is None:
            self.writer.begin(self.reasons, self.aims.room_um, self.aims.feed_ratio)
        self.original_s = pool.submit(self.model.cycle_time_s, program.core)
        self.rapid_vibration = pool.submit(rapid_vibration_um, program, self.model)

    def writer_of(self) -> TextWriter:
        """The writer on the grid that is used now."""
        return self.writer

    def conversion(self) -> Conversion:
        """Shape, write, read back and judge."""
        shape_all = self.choice.shape_all
        original_within = self._original_is_within()
        if not shape_all:
            self._leave_what_has_nothing_to_gain()
            if original_within:
                self._leave_everything("every cut of the original keeps its limits")
        if self.spending is not None and self.spending.budget.limits_rate and not self.fixed_period:
            weights = [float(play.result().residual_mm.max()) for play in self.originals]
            self.grid = self.spending.choose_period(self.grid, weights, self._grid_for, self._write)
        settled = self._settle()
        while self.spending is not None and self.spending.give_up(self.grid, settled.written, self._verdicts(settled)):
            for index, given_up in self.spending.given_up.items():
                self.reasons[index] = given_up.reason
            settled = self._settle()
        settled = self._within_program_price(self._without_what_gains_nothing(settled))
        if not shape_all and not self._is_benefit(settled):
            self._leave_everything("")
            settled = self._rewritten([], [])
        rapids: ShapedRapids | None = None
        if self.machine.shaping.rapids:
            rapids = shape_rapids(
                settled.emitted, settled.written.placed, self.model, self.grid, self.pool, self.budget
            )
            written = replace(settled.written, size=rapids.emitted.size, placed=rapids.placed)
            settled = replace(settled, written=written, emitted=rapids.emitted)
        if not settled.written.placed and (rapids is None or not rapids.outcome.shaped) and self._is_alone():
            # Not what it was expanded into: calls and macros stay as they were written.
            written = replace(settled.written, size=self.program.size)
            settled = replace(settled, written=written, emitted=self.program)
        return self._result(settled, rapids, original_within=original_within)

    def _is_alone(self) -> bool:
        """Whether the program has its file for itself."""
        return len(self.program.own_text) == self.program.size

    def _original_is_within(self) -> bool:
        """Whether every cut as programmed keeps its limits in every operating condition that counts for it."""
        regions = self.program.regions
        placed = [Placed(region, region.first_line, region.last_line) for region in regions]
        nominal = Judge(self.model, [case for case in self.judge.cases if case.nominal])
        for judge in (nominal, self.judge):  # the first is without a further simulation
            figures = [
                simulate_unchanged(judge, self.model, region, region, original.result())
                for region, original in zip(regions, self.originals, strict=True)
            ]
            if any(verdict.misses for verdict in judge.verdicts(figures, placed, self.grid.block_period_s)):
                return False
        self._originals_judged = dict(enumerate(figures))
        return True

    def _leave_everything(self, reason: str) -> None:
        """Nothing is shaped; cuts that can stay as they are and have no reason yet get this one."""
        for index, region in enumerate(self.program.regions):
            if not self.reasons[index] and keepable(region, self.machine):
                gained = self.gains_um.get(index)
                self._leave(index, reason or f"shaping gains {gained or 0.0:.1f} µm", gained)

    def _leave_what_has_nothing_to_gain(self) -> None:
        """Where the original vibrates and errs by less than the least gain, shaping is not even tried."""
        least = self.machine.shaping.least_gain_um
        for index, (reason, play) in enumerate(zip(self.reasons, self.originals, strict=True)):
            if not reason and keepable(self.program.regions[index], self.machine):
                most = most_to_gain_um(play.result())
                if most < least:
                    self._leave(index, f"nothing there to gain: {most:.1f} µm", most)

    def _without_what_gains_nothing(self, settled: _Settled) -> _Settled:
        """The same without the cuts that gained too little or became worse: these are left unchanged."""
        least = self.machine.shaping.least_gain_um
        indices = self._shaped()
        left: list[RegionFigures] = []
        trackers: list[_core.ContourTracker | None] = []
        simulated = zip(settled.figures, settled.trackers, strict=True)
        for index, (figures, tracker), verdict in zip(indices, simulated, self._verdicts(settled), strict=True):
            gained = self.gains_um[index] = gain_um(figures)
            stays = not keepable(self.program.regions[index], self.machine) or self.choice.shape_all
            if stays or (gained >= least and not verdict.worse):
                left.append(figures)
                trackers.append(tracker)
            else:
                self._leave(index, verdict.worse[0] if verdict.worse else f"shaping gains {gained:.1f} µm", gained)
        return settled if len(left) == len(indices) else self._rewritten(left, trackers)

    def _rewritten(self, figures: list[RegionFigures], trackers: list[_core.ContourTracker | None]) -> _Settled:
        """Further cuts are left unchanged; what stays shaped is as before: neither shaped nor simulated again."""
        written = self._write(self.grid)
        return _Settled(written, written.read_back(self.machine), figures, trackers, {})

    def _within_program_price(self, settled: _Settled) -> _Settled:
        """Cuts loosened, and then left unchanged, until the program is within its price."""
        for _ in range(_PRICE_ROUNDS):
            excess_s = self._excess_s(settled)
            gains = {index: self.gains_um.get(index, 0.0) for index in self._shaped()}
            if excess_s <= 0.0 or not self.aims.keep_program_price(excess_s, gains, self._is_keepable):
                break
            settled = self._without_what_gains_nothing(self._settle())
        return settled

    def _excess_s(self, settled: _Settled) -> float:
        """Time above what the price of the program allows."""
        original_s = self.original_s.result()
        price_s = original_s * self.machine.price.program_time_percent / 100.0
        cuts_s = math.fsum(figures.emitted_s - figures.original.duration_s for figures in settled.figures)
        cuts_s += self.machine.emission.prefill_dwell_s * len(settled.figures)
        if cuts_s < _NEAR_PRICE * price_s or not self.machine.emission.header:
            return cuts_s - price_s
        return self.model.cycle_time_s(settled.emitted.core) - original_s - price_s

    def _is_benefit(self, settled: _Settled) -> bool:
        least, limit_um = self.machine.shaping.least_gain_um, self.machine.tolerance.contour_um
        return any(benefits(verdict, limit_um, least) for verdict in self._verdicts(settled))

    def _verdicts(self, settled: _Settled) -> tuple[RegionVerdict, ...]:
        return self.judge.verdicts(settled.figures, settled.written.placed, self.grid.block_period_s)

    def _shaped(self) -> list[int]:
        return [index for index, reason in enumerate(self.reasons) if not reason]

    def _is_keepable(self, index: int) -> bool:
        return keepable(self.program.regions[index], self.machine)

    def _leave(self, index: int, reason: str, gained_um: float | None) -> None:
        self.reasons[index] = reason
        self.left.add(index)
        if gained_um is not None:
            self.gains_um[index] = gained_um

    def _write(self, grid: Grid, on_progress: Callable[[float, int], None] = lambda _done, _total: None) -> Written:
        if self.writer.grid is not grid:
            self.writer = TextWriter(self.program, self.model, grid, self.pool)
        # Of what was given up for a budget, or is left unchanged by choice, the table of cuts speaks.
        given_up = {} if self.spending is None else self.spending.given_up
        untold = {*given_up, *self.left, *self.aims.emitted_s}
        written = self.writer.write(self.reasons, self.aims.room_um, self.aims.feed_ratio, untold, on_progress)
        for index, reason in written.no_room.items():
            self.reasons[index] = reason
        self.curves.note(written)
        return written

    def _settle(self) -> _Settled:
        """Write, read back and simulate; again where a cut left its tolerance, ran too fast or took too long."""
        for attempt in range(_ATTEMPTS):
            stage = partial(self.on_progress, "shaping" if attempt == 0 else "shaping again, slower")
            settled = self._simulated_from(self._write(self.grid, stage), ahead=attempt == 0)
            written, figures = settled.written, settled.figures
            self.aims.note(written, figures)
            changed = self.aims.slow_down(written, figures)
            last = attempt + 1 == _ATTEMPTS
            changed = (not last and self.aims.tighten(written, figures, self.judge)) or changed
            changed = self.aims.keep_cut_price(written, self._is_keepable, _ATTEMPTS - 1 - attempt) or changed
            if not changed:
                break
            settled.trackers.clear()  # nobody asks for them any more: they take room beside the next text
            for run in settled.begun.values():
                run.cancel()
        else:
            settled = self._simulated_from(self._write(self.grid), ahead=False)
        return settled

    def _simulated_from(self, written: Written, *, ahead: bool) -> _Settled:
        """The program read back and simulated; `ahead`: its sensitivity too, where that is known before it.

        A cut whose text is as in the program before is not simulated again.
        """
        texts = [text for text, _ in written.texts]
        indices = [self.aims.index(place.region) for place in written.placed]
        known = {
            rank: self._simulated[index][1]
            for rank, (index, text) in enumerate(zip(indices, texts, strict=True))
            if index in self._simulated and self._simulated[index][0] is text
        }
        fresh = [rank for rank in range(len(texts)) if rank not in known]
        places = [written.placed[rank] for rank in fresh]
        following = [self.pool.submit(_core.ContourTracker, place.region.path) for place in places]
        emitted = written.read_back(self.machine)
        trackers = [each.result() for each in following]
        playing = self.judge.begin(emitted, places, trackers, self.pool)
        begun: Begun = {}
        if ahead and cores() > 1 and len(trackers) == 1:
            begun = begin_rests(self.judge, self.machine, places[0], emitted, trackers[0], self.pool)
        originals = [self.originals[indices[rank]] for rank in fresh]
        found = self.judge.figures(playing, originals, partial(self.on_progress, "round trip"))
        all_trackers: list[_core.ContourTracker | None] = [None] * len(texts)
        for rank, figures, tracker in zip(fresh, found, trackers, strict=True):
            known[rank], all_trackers[rank] = figures, tracker
            self._simulated[indices[rank]] = texts[rank], figures
        return _Settled(written, emitted, [known[rank] for rank in range(len(texts))], all_trackers, begun)

    def _unchanged(self, settled: _Settled, rapids: ShapedRapids | None) -> list[tuple[Placed, RegionFigures]]:
        """The cuts left unchanged, as they stand in the emitted program, simulated."""
        left = [index for index, reason in enumerate(self.reasons) if reason]
        if not left:
            return []
        spans = [(place.first_line, place.last_line) for place in settled.written.placed]
        spans += [move.emitted_lines for move in rapids.outcome.moves] if rapids is not None else []
        regions = unshaped_regions(settled.emitted, spans, [self.program.regions[index] for index in left])
        begun = [
            None if region.path.moves_as(self.program.regions[index].path) and index in self._originals_judged
            else self.pool.submit(
                simulate_unchanged, self.judge, self.model, region, self.program.regions[index],
                self.originals[index].result(),
            )
            for index, region in zip(left, regions, strict=True)
        ]  # fmt: skip
        return [
            (
                Placed(self.program.regions[index], region.first_line, region.last_line),
                self._originals_judged[index] if run is None else run.result(),
            )
            for index, region, run in zip(left, regions, begun, strict=True)
        ]

    def _result(self, settled: _Settled, rapids: ShapedRapids | None, *, original_within: bool) -> Conversion:
        program, machine, written = self.program, self.machine, settled.written
        core = program.core
        # For a core that waits while the last simulations run.
        mark = self.pool.submit(lambda: settled.emitted.mark)
        emitted_s = self.pool.submit(self.model.cycle_time_s, settled.emitted.core)
        between = self.rapid_vibration
        if rapids is not None and rapids.outcome.shaped:
            between = self.pool.submit(rapid_vibration_um, settled.emitted, self.model)
        rapids_shaped = rapids is not None and rapids.outcome.shaped > 0
        proving = None
        # Without header comments nothing tells shaped rapids from cuts.
        if written.placed and (machine.emission.header or not rapids_shaped):
            proving = self.pool.submit(prove, program, settled.emitted, machine, rapids_shaped=rapids_shaped)
        every = sorted(
            [*zip(written.placed, settled.figures, strict=True), *self._unchanged(settled, rapids)],
            key=lambda pair: pair[0].original_lines,
        )
        figures = self.judge.summarise(
            [each for _, each in every], [place for place, _ in every], self.grid.block_period_s,
            Pair(self.rapid_vibration.result(), between.result()),
        )  # fmt: skip
        cutting = figures.region_time_s()
        cuts = self._cuts(settled, figures)
        times = self._cycle_time_s(settled, emitted_s.result(), cutting, rapids)
        proof = None if proving is None else proving.result()
        grade, reason = recommend(
            Situation(
                figures.all_cuts, len(written.placed), original_within=original_within,
                could_gain=any(cut.gain_um >= machine.shaping.least_gain_um for cut in cuts),
                benefit=self._is_benefit(settled), other_changes=proof.refused if proof is not None else (),
            )
        )  # fmt: skip
        warnings = self._warnings(written, figures)
        if rapids is not None:
            warnings += rapids.warnings
        rests, tried = self._rests_on(settled)
        mark.result()
        emitted = settled.emitted.with_verdict(good=grade != "do not run", better=grade == "better, tolerance not met")
        return Conversion(
            **vars(figures),
            program=program.source,
            machine=machine.name,
            recommendation=grade,
            reason=reason,
            cuts=cuts,
            tolerance_curve=self._curve(times) if self.choice.tolerance_curve else None,
            proof=proof,
            advice=filter_advice(program, machine, self.model, self.judge, [run.result() for run in self.originals]),
            cycle_time_s=times,
            cutting_time_s=cutting,
            block_period_s=self.grid.block_period_s,
            shaper=_used_shaper(self.grid),
            blocks=BlockCount(core.block_count, written.blocks),
            expanded=core.expanded,
            expanded_radii_mm={f"D{number}": radius for number, radius in core.expanded_radii_mm.items()},
            bytes_read=core.size,
            bytes_emitted=written.size,
            limits=AppliedLimits(
                machine.tolerance.contour_um,
                self.judge.target,
                machine.tolerance.residual_ratio,
                machine.tolerance.residual_floor_um,
                machine.tolerance.residual_floor_increments,
                machine.tolerance.feed_excess_ratio,
                machine.verdict.plant,
                machine.price.program_time_percent,
                machine.price.cut_time_percent,
            ),
            warnings=tuple(warnings),
            budget=self.spending.outcome(self.grid, written) if self.spending is not None else None,
            rapids=rapids.outcome if rapids is not None else None,
            least_gain_um=machine.shaping.least_gain_um,
            rests_on=rests,
            unmeasured_tried=tried,
            at_the_control=at_the_control(
                settled.emitted,
                written.placed,
                written.loads,
                figures,
                self.model,
                self.grid.block_period_s,
                written.restarts,
            ),
            restart_points=restart_points(program, zip(written.placed, written.restarts, strict=True)),
            emitted=emitted,
            placed=tuple(written.placed),
            model=self.model,
            played=PlayedPrograms(program, machine, emitted, plant=machine.verdict.plant),
        )

    def _cuts(self, settled: _Settled, figures: PlayedFigures) -> tuple[CutOutcome, ...]:
        """One row for each cut."""
        tools = tools_of_cuts(self.program)
        sizes = {
            self.aims.index(place.region): text.size
            for place, (text, _) in zip(settled.written.placed, settled.written.texts, strict=True)
        }
        rows = []
        for index, (region, cut) in enumerate(zip(self.program.regions, figures.all_cuts, strict=True)):
            read = region.text_end - region.text_begin
            gained = self.gains_um.get(index)
            if gained is None:
                gained = most_to_gain_um(self.originals[index].result())
            rows.append(
                outcome_of(
                    cut, is_shaped=index in sizes, reason=self.reasons[index], gain_um=gained,
                    tolerance_um=self.aims.shaped_for_um(index), tool=tools.get(index),
                    size=Pair(read, sizes.get(index, read)),
                )
            )  # fmt: skip
        return tuple(rows)

    def _curve(self, times: Pair[float]) -> ToleranceCurve | None:
        """Tolerance against time, of the cuts that were shaped once; None: there are none."""
        original_um = max((getattr(run.result(), self.judge.target).max_abs_mm for run in self.originals), default=0.0)
        return self.aims.tolerance_curve(times.original, original_um * 1e3)

    def _rests_on(self, settled: _Settled) -> tuple[tuple[RestsOn, ...], int]:
        """Sensitivity of the shaped cut that comes nearest to a limit."""
        deciding = self.judge.deciding(settled.figures, settled.written.placed)
        if deciding is None:
            return (), 0
        simulated = zip(settled.written.placed, settled.figures, settled.trackers, strict=True)
        return rests_on(
            self.judge, self.machine, list(simulated), settled.emitted, deciding, self.pool,
            settled.begun, partial(self.on_progress, "what it rests on"),
        )  # fmt: skip

    def _cycle_time_s(
        self, settled: _Settled, emitted_s: float, cutting: Pair[float], rapids: ShapedRapids | None
    ) -> Pair[float]:
        """What `shapegcode time` says of both texts."""
        original_s = self.original_s.result()
        if self.machine.emission.header:
            return Pair(original_s, emitted_s)
        # Nothing in such a text says which regions are shaped.
        added_s = self.machine.emission.prefill_dwell_s * len(settled.written.placed)
        added_s += rapids.extra_s if rapids else 0.0
        return Pair(original_s, original_s - cutting.original + cutting.emitted + added_s)

    def _warnings(self, written: Written, figures: PlayedFigures) -> list[str]:
        program, machine = self.program, self.machine
        warnings = [*program.warnings, *written.kept_warnings, *machine_warnings(machine)]
        warnings += [self.grid.note] if self.grid.note else []
        warnings += region_range_warnings(program.regions, machine)
        if self.spending is not None and (sentence := self.spending.warning(self.grid)):
            warnings.append(sentence)
        elif not program.regions:
            warnings.append(f"{program.source}: no cutting moves that can be shaped: the program is unchanged")
        if not written.placed:
            # Where something was shaped, what the verdict rests on names them.
            warnings += open_axes(program, machine)
        warnings += played_warnings(program, figures, machine)
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
