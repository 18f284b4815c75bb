"""One conversion under way: cuts shaped, loosened to their price, left unchanged, until the program stands."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from itertools import compress

from shapegcode import _core
from shapegcode.conversion.aims import Aims, CutCurves
from shapegcode.conversion.budget import Budget, Spending, keepable
from shapegcode.conversion.rapids.shape import ShapedRapids, shape_rapids
from shapegcode.conversion.recommendation import benefits, gain_um, most_to_gain_um
from shapegcode.conversion.rests import Begun, begin_rests
from shapegcode.conversion.whole_text import TextWriter, Written, why_kept
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.program import Program
from shapegcode.shaping.grid import Grid, choose_grid
from shapegcode.verdict.ahead import cores
from shapegcode.verdict.figures import (
    Placed,
    RegionVerdict,
)
from shapegcode.verdict.judge import Judge, RegionFigures
from shapegcode.verdict.program import rapid_vibration_um, simulate_unchanged, unshaped_regions

_ATTEMPTS = 10  # each for cuts that left their tolerance, ran too fast or cost too much; few need more than two
_PRICE_ROUNDS = 6
_NEAR_PRICE = 0.7  # of the price: from here on the time of the program is worked out in full

Progress = Callable[[str, float, int], None]


@dataclass(frozen=True)
class CutChoice:
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
class Settled:
    """A program written, read back and simulated, with trackers of its cuts, and what is simulated ahead of need."""

    written: Written
    emitted: Program
    figures: list[RegionFigures]
    trackers: list[_core.ContourTracker | None]
    begun: Begun


@dataclass(frozen=True)
class Shaped:
    """What a conversion comes to, before it is judged as a whole.

    Attributes:
        settled: the emitted program.
        rapids: what became of its rapids; None: they were not to be shaped.
        original_within: every cut of the original keeps its limits.
    """

    settled: Settled
    rapids: ShapedRapids | None
    original_within: bool


class Run:
    """One conversion under way."""

    def __init__(
        self,
        program: Program,
        machine: Machine,
        block_period_s: float | None,
        budget: Budget | None,
        choice: CutChoice,
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
                choice.not_shaped.get(index) or why_kept(program, region, machine, self.grid)
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

    def shaped(self) -> Shaped:
        """Shape, write, read back and simulate, until every cut is within tolerance and price or left unchanged."""
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
        if not shape_all and not self.is_benefit(settled):
            shaped = self._shaped()
            self._leave_everything("")
            settled = self._rewritten(settled, shaped)
        rapids: ShapedRapids | None = None
        if self.machine.shaping.rapids:
            rapids = shape_rapids(
                settled.emitted, settled.written.placed, self.model, self.grid, self.pool, self.budget
            )
            rapids = self._within_price(settled, rapids)
            written = replace(settled.written, size=rapids.emitted.size, placed=rapids.placed)
            settled = replace(settled, written=written, emitted=rapids.emitted)
        if not settled.written.placed and (rapids is None or not rapids.outcome.shaped) and self._is_alone():
            # Not what it was expanded into: calls and macros stay as they were written.
            written = replace(settled.written, size=self.program.size)
            settled = replace(settled, written=written, emitted=self.program)
        return Shaped(settled, rapids, original_within)

    def _within_price(self, settled: Settled, rapids: ShapedRapids) -> ShapedRapids:
        """The shaped rapids, or none where with them the program would take more time than its price."""
        price_s = self._price_s()
        if self.machine.emission.header:
            added_s = self.model.cycle_time_s(rapids.emitted.core) - self.original_s.result()
        else:
            added_s = self._excess_s(settled) + price_s + rapids.extra_s
        if not rapids.outcome.shaped or added_s <= price_s:
            return rapids
        outcome, count = rapids.outcome, rapids.outcome.shaped
        kept = {**outcome.kept, "the price of the program": count}
        outcome = replace(outcome, shaped=0, kept=kept, time_saved_s=0.0, blocks=0, slowed_blocks=0, moves=())
        why = f"{count} rapids stay rapids: with them as cutting moves the program would take {added_s:.2f} s more"
        return replace(
            rapids, emitted=settled.emitted, placed=settled.written.placed, outcome=outcome, extra_s=0.0,
            warnings=[f"{why}, price {price_s:.2f} s (price.program_time_percent)"],
        )  # fmt: skip

    def _is_alone(self) -> bool:
        """Whether nothing was left out when it was read: its file as a whole is what was given."""
        return self.program.number is None

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

    def _without_what_gains_nothing(self, settled: Settled) -> Settled:
        """The same without the cuts that gained too little or became worse: these are left unchanged."""
        least = self.machine.shaping.least_gain_um
        indices = self._shaped()
        for index, figures, verdict in zip(indices, settled.figures, self._verdicts(settled), strict=True):
            gained = self.gains_um[index] = gain_um(figures)
            stays = not keepable(self.program.regions[index], self.machine) or self.choice.shape_all
            if not stays and (gained < least or verdict.worse):
                self._leave(index, verdict.worse[0] if verdict.worse else f"shaping gains {gained:.1f} µm", gained)
        return self._rewritten(settled, indices)

    def _rewritten(self, settled: Settled, shaped: Sequence[int]) -> Settled:
        """Some cuts are left unchanged now; what stays shaped is as before: neither shaped nor simulated again."""
        stay = [not self.reasons[index] for index in shaped]
        if all(stay):
            return settled
        written = self._write(self.grid)
        figures, trackers = [*compress(settled.figures, stay)], [*compress(settled.trackers, stay)]
        return Settled(written, written.read_back(self.machine), figures, trackers, {})

    def _within_program_price(self, settled: Settled) -> Settled:
        """Cuts loosened, and then left unchanged, until the program is within its price."""
        for _ in range(_PRICE_ROUNDS):
            excess_s = self._excess_s(settled)
            gains = {index: self.gains_um.get(index, 0.0) for index in self._shaped()}
            if excess_s <= 0.0 or not self.aims.keep_program_price(excess_s, gains, self._is_keepable):
                break
            settled = self._without_what_gains_nothing(self._settle())
        return settled

    def _excess_s(self, settled: Settled) -> float:
        """Time above what the price of the program allows."""
        price_s = self._price_s()
        cuts_s = math.fsum(figures.emitted_s - figures.original.duration_s for figures in settled.figures)
        cuts_s += self.machine.emission.prefill_dwell_s * len(settled.figures)
        if cuts_s < _NEAR_PRICE * price_s or not self.machine.emission.header:
            return cuts_s - price_s
        return self.model.cycle_time_s(settled.emitted.core) - self.original_s.result() - price_s

    def _price_s(self) -> float:
        """Time that shaping may add to the program."""
        return self.original_s.result() * self.machine.price.program_time_percent / 100.0

    def is_benefit(self, settled: Settled) -> bool:
        """Whether a shaped cut gains enough, see `benefits`."""
        least, limit_um = self.machine.shaping.least_gain_um, self.machine.tolerance.contour_um
        return any(benefits(verdict, limit_um, least) for verdict in self._verdicts(settled))

    def _verdicts(self, settled: Settled) -> tuple[RegionVerdict, ...]:
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

    def _settle(self) -> Settled:
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

    def _simulated_from(self, written: Written, *, ahead: bool) -> Settled:
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
        return Settled(written, emitted, [known[rank] for rank in range(len(texts))], all_trackers, begun)

    def unchanged(self, settled: Settled, rapids: ShapedRapids | None) -> list[tuple[Placed, RegionFigures]]:
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
