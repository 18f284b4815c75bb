"""The converter: regions of a program shaped, written, read back and judged."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from shapegcode import _core
from shapegcode.conversion.ahead import cores
from shapegcode.conversion.benefit import KeptRegion, gain_um, most_to_gain_um
from shapegcode.conversion.budget import Budget
from shapegcode.conversion.operating import at_the_control
from shapegcode.conversion.rapids.shape import ShapedRapids, shape_rapids
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
from shapegcode.verdict.figures import (
    AppliedLimits,
    BlockCount,
    FollowingShapers,
    GridTaps,
    PlayedFigures,
    UsedShaper,
)
from shapegcode.verdict.judge import Judge, RegionFigures

__all__ = ["convert"]

_CONTOUR_MARGIN = 0.95  # of the tolerance: the rest is for rounding and for what the simple bound leaves out
_SLOWER = 0.98  # than what would just be slow enough
_LEAST_FEED_SHARE = 0.5  # of the programmed feed: what runs too fast at that is not the feed's doing
_HELPED = 0.98  # of what was reached before: less room that brings no more is taken back
_ATTEMPTS = 8  # each with less room for the regions that left the contour tolerance; few need more than two

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
    shape_all: bool = False,
    on_progress: Progress = lambda _stage, _done, _total: None,
) -> Conversion:
    """Shape every cutting region of a program, and judge the emitted text by playing it.

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
        shape_all: shape every region, also where that gains less than `shaping.least_gain_um` or misses a tolerance;
            False: such a region keeps its text.
        on_progress: called with stage, and how many of its parts are done and there are.

    Returns:
        The emitted program with its verdict. It is not written anywhere: `conversion.text` is what a file would hold.

    Raises:
        ProgramError: the program cannot be read, or a region not be written.
        OSError: its file cannot be read.
        MachineError: a value that a machine file could not have.
        DesignError: no shaper exists on this grid.
        ArgumentError: a block period that the controller cannot play, or a budget that no choice fits.
        RoundTripError: the emitted text would not be equivalent: a defect of shapegcode.
    """
    stated = {
        "shaping.contour": contour,
        "tolerance.contour_um": contour_tolerance_um,
        "shaping.family": shaper,
        "shaping.per_axis": per_axis,
        "shaping.rapids": rapids,
        "shaping.arc_feed_ratio": arc_feed_ratio,
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
    # Shapes regions, plays the originals, and what was emitted, on all cores.
    pool = ThreadPoolExecutor(max_workers=cores())
    try:
        run = _Run(program, machine, block_period_s, budget, pool, on_progress)
        return run.conversion(shape_all=shape_all)
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
class _Settled:
    """A text that is read back and played, with trackers of its regions' paths, and what is played ahead of need."""

    written: Written
    emitted: Program
    figures: list[RegionFigures]
    trackers: list[_core.ContourTracker]
    begun: Begun


@dataclass
class _Attempt:
    """The last room of a region that left the tolerance, what it then reached, µm, and whether less room helps.

    `turned`: it left the tolerance only with the dial turned.
    """

    room_um: float
    reached_um: float
    turned: bool
    helps: bool = True


class _Run:
    """One conversion under way."""

    def __init__(
        self,
        program: Program,
        machine: Machine,
        block_period_s: float | None,
        budget: Budget | None,
        pool: Executor,
        on_progress: Progress,
    ) -> None:
        self.program, self.machine, self.budget, self.pool = program, machine, budget, pool
        self.on_progress = on_progress
        self.fixed_period = block_period_s is not None
        self.model = MachineModel(machine)
        # Played while the shapers are designed.
        self.originals = [
            pool.submit(self.model.play_original, region.path, offset=self.model.offset(region))
            for region in program.regions
        ]
        fastest = max((region.path.fastest_feed_mm_per_s for region in program.regions), default=0.0)
        self._grid_for = partial(choose_grid, machine, fastest_mm_per_s=fastest)
        self.grid = self._grid_for(block_period_s)
        self.writer = TextWriter(program, self.model, self.grid, pool)
        self.judge = Judge(self.model)
        self.reasons = [why_kept(region, machine, self.grid) for region in program.regions]
        self.feed_share = [1.0] * len(program.regions)
        self.room_um = [machine.tolerance.contour_um * _CONTOUR_MARGIN] * len(program.regions)
        self.kept: dict[int, KeptRegion] = {}
        self.spending = None if budget is None else Spending(budget, program, machine)
        if budget is None:
            self.writer.begin(self.reasons, self.room_um, self.feed_share)
        self.original_s = pool.submit(self.model.cycle_time_s, program.core)

    def conversion(self, *, shape_all: bool) -> Conversion:
        """Shape, write, read back and judge."""
        if not shape_all:
            self._leave_what_has_nothing_to_gain()
        if self.spending is not None and self.spending.budget.limits_rate and not self.fixed_period:
            weights = [float(play.result().residual_mm.max()) for play in self.originals]
            self.grid = self.spending.choose_period(self.grid, weights, self._grid_for, self._write)
        settled = self._settle()
        while self.spending is not None and self.spending.give_up(
            self.grid,
            settled.written,
            self.judge.verdicts(settled.figures, settled.written.placed, self.grid.block_period_s),
        ):
            for index, given_up in self.spending.given_up.items():
                self.reasons[index] = given_up.reason
            settled = self._settle()
        if not shape_all:
            settled = self._without_what_gains_nothing(settled)
        rapids: ShapedRapids | None = None
        if self.machine.shaping.rapids:
            rapids = shape_rapids(
                settled.emitted, settled.written.placed, self.model, self.grid, self.pool, self.budget
            )
            written = replace(settled.written, size=rapids.emitted.size, placed=rapids.placed)
            settled = replace(settled, written=written, emitted=rapids.emitted)
        return self._result(settled, rapids)

    def _leave_what_has_nothing_to_gain(self) -> None:
        """Where the original shakes and errs by less than the least gain, shaping is not even tried."""
        least = self.machine.shaping.least_gain_um
        for index, (reason, play) in enumerate(zip(self.reasons, self.originals, strict=True)):
            if not reason and keepable(self.program.regions[index], self.machine):
                most = most_to_gain_um(play.result())
                if most < least:
                    self._keep(index, f"nothing there to gain: {most:.1f} µm", most)

    def _without_what_gains_nothing(self, settled: _Settled) -> _Settled:
        """The same without the regions that gained too little or left a tolerance: these keep their text."""
        least = self.machine.shaping.least_gain_um
        indices = [index for index, reason in enumerate(self.reasons) if not reason]
        verdicts = self.judge.verdicts(settled.figures, settled.written.placed, self.grid.block_period_s)
        left: list[RegionFigures] = []
        trackers: list[_core.ContourTracker] = []
        played = zip(settled.figures, settled.trackers, strict=True)
        for index, (figures, tracker), verdict in zip(indices, played, verdicts, strict=True):
            gained = gain_um(figures)
            if not keepable(self.program.regions[index], self.machine) or (gained >= least and not verdict.misses):
                left.append(figures)
                trackers.append(tracker)
            else:
                why = verdict.misses[0] if verdict.misses else f"shaping gains {gained:.1f} µm"
                self._keep(index, why, gained)
        if len(left) == len(indices):
            return settled
        # What stays shaped is as before: it is neither shaped nor played again.
        written = self._write(self.grid)
        return _Settled(written, written.read_back(self.machine), left, trackers, {})

    def _keep(self, index: int, reason: str, gained_um: float) -> None:
        region = self.program.regions[index]
        self.reasons[index] = reason
        self.kept[index] = KeptRegion(
            (region.first_line, region.last_line), reason, gained_um, self.originals[index].result().duration_s
        )

    def _write(self, grid: Grid, on_progress: Callable[[float, int], None] = lambda _done, _total: None) -> Written:
        if self.writer.grid is not grid:
            self.writer = TextWriter(self.program, self.model, grid, self.pool)
        # Of what was given up for a budget, or gains nothing, one sentence speaks for all.
        given_up = {} if self.spending is None else self.spending.given_up
        written = self.writer.write(self.reasons, self.room_um, self.feed_share, {*given_up, *self.kept}, on_progress)
        for index, reason in written.no_room.items():
            self.reasons[index] = reason
        return written

    def _settle(self) -> _Settled:
        """Write, read back and play; again, slower, where a region left the contour tolerance."""
        tried: dict[int, _Attempt] = {}
        for attempt in range(_ATTEMPTS):
            stage = partial(self.on_progress, "shaping" if attempt == 0 else "shaping again, slower")
            settled = self._played(self._write(self.grid, stage), ahead=attempt == 0)
            slower = self._slow_down(settled.written, settled.figures)
            if attempt + 1 == _ATTEMPTS or not (self._tighten(tried, settled.written, settled.figures) or slower):
                break
            settled.trackers.clear()  # nobody asks for them any more: they take room beside the next text
            for run in settled.begun.values():
                run.cancel()
        return settled

    def _played(self, written: Written, *, ahead: bool) -> _Settled:
        """The text read back and played; `ahead`: what its verdict rests on too, where that is known before it."""
        following = [self.pool.submit(_core.ContourTracker, place.region.path) for place in written.placed]
        emitted = written.read_back(self.machine)
        originals = [play for play, reason in zip(self.originals, self.reasons, strict=True) if not reason]
        trackers = [each.result() for each in following]
        playing = self.judge.begin(emitted, written.placed, trackers, self.pool)
        begun: Begun = {}
        if ahead and cores() > 1 and len(trackers) == 1:
            begun = begin_rests(self.judge, self.machine, written.placed[0], emitted, trackers[0], self.pool)
        figures = self.judge.figures(playing, originals, partial(self.on_progress, "round trip"))
        return _Settled(written, emitted, figures, trackers, begun)

    def _slow_down(self, written: Written, figures: list[RegionFigures]) -> bool:
        """Give regions that run faster along the path than the machine allows a lower feed. False if there are none."""
        limit = 1.0 + self.machine.tolerance.feed_excess_ratio
        places = {id(region): index for index, region in enumerate(self.program.regions)}
        slower = False
        for place, region in zip(written.placed, figures, strict=True):
            index, ratio = places[id(place.region)], region.feed_excess.ratio
            if ratio > limit and self.feed_share[index] > _LEAST_FEED_SHARE:
                self.feed_share[index] = max(_LEAST_FEED_SHARE, self.feed_share[index] * _SLOWER * limit / ratio)
                slower = True
        return slower

    def _tighten(self, tried: dict[int, _Attempt], written: Written, figures: list[RegionFigures]) -> bool:
        """Give regions that left the contour tolerance less room, so that they run slower. False if there is none.

        The bound on feed counts corners and arcs one by one; where several fall into one shaper they add up. Where the
        feed was searched for a target, what it was planned for counts: more room than that would change nothing. A
        region that less room does not help gets its room back: slower would only be slower. So does one that is
        within the limit at 100 % feed override, and after one attempt still not at the stated others.
        """
        limit, room_um = self.machine.tolerance.contour_um, self.room_um
        places = {id(region): index for index, region in enumerate(self.program.regions)}
        tightened = False
        for place, region in zip(written.placed, figures, strict=True):
            index = places[id(place.region)]
            before = tried.get(index)
            reached = self.judge.contour_um(region, turned=False)
            if turned := reached <= limit:
                reached = self.judge.contour_um(region)
            if reached <= limit or (before is not None and not before.helps):
                continue
            tightened = True
            if before is not None and (before.turned or (not turned and reached > _HELPED * before.reached_um)):
                room_um[index] = before.room_um
                before.helps = False
                continue
            tried[index] = _Attempt(room_um[index], reached, turned)
            room_um[index] = min(room_um[index], written.planned_um.get(index, math.inf))
            room_um[index] *= _CONTOUR_MARGIN * limit / reached
        return tightened

    def _result(self, settled: _Settled, rapids: ShapedRapids | None) -> Conversion:
        program, machine, written = self.program, self.machine, settled.written
        core = program.core
        # For a core that waits while the last playbacks run.
        mark = self.pool.submit(lambda: settled.emitted.mark)
        emitted_s = self.pool.submit(self.model.cycle_time_s, settled.emitted.core)
        figures = self.judge.summarise(settled.figures, written.placed, self.grid.block_period_s)
        cutting = figures.region_time_s()
        warnings = self._warnings(written, figures)
        if rapids is not None:
            warnings += rapids.warnings
        rests, tried = self._rests_on(settled, figures)
        mark.result()
        emitted = settled.emitted.with_verdict(good=figures.within_tolerance)
        return Conversion(
            **vars(figures),
            program=program.source,
            machine=machine.name,
            cycle_time_s=self._cycle_time_s(settled, emitted_s.result(), cutting, rapids),
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
            ),
            warnings=tuple(warnings),
            budget=self.spending.outcome(self.grid, written) if self.spending is not None else None,
            rapids=rapids.outcome if rapids is not None else None,
            kept=tuple(self.kept[index] for index in sorted(self.kept)),
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

    def _rests_on(self, settled: _Settled, figures: PlayedFigures) -> tuple[tuple[RestsOn, ...], int]:
        if figures.worst_case is None:
            return (), 0
        played = zip(settled.written.placed, settled.figures, settled.trackers, strict=True)
        return rests_on(
            self.judge, self.machine, list(played), settled.emitted, figures.worst_case.lines, self.pool,
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
        elif not written.placed and not self.kept:
            warnings.append(f"{program.source}: no cutting moves that can be shaped: the text is unchanged")
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
