"""The plan of a conversion: its shaper, what each cut is shaped for, and why a cut is left unchanged."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from shapegcode import _core
from shapegcode.conversion.aims import Aims, CutCurves
from shapegcode.conversion.budget import Budget, Spending, keepable
from shapegcode.conversion.recommendation import benefits, most_to_gain_um
from shapegcode.conversion.sensitivity import StartedTrials
from shapegcode.conversion.whole_text import TextWriter, Written, why_kept
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.program import Program
from shapegcode.shaping.grid import Grid, choose_grid
from shapegcode.verdict.figures import Placed, RegionVerdict
from shapegcode.verdict.judge import Judge, RegionFigures, rapid_vibration_um, simulate_unchanged

if TYPE_CHECKING:
    from shapegcode.conversion.rapids.shape import ShapedRapids

_NEAR_PRICE = 0.7  # of the price: from here on the time of the program is worked out in full

Progress = Callable[[str, float, int], None]


@dataclass(frozen=True)
class CutChoice:
    """What the caller chose."""

    not_shaped: dict[int, str]  # why a cut is not to be shaped, by its index
    shape_all: bool  # shape whatever can be shaped
    tolerance_curve: bool  # work out what other tolerances would cost


@dataclass(frozen=True)
class Shaped:
    """A program written, read back and simulated."""

    written: Written
    emitted: Program
    figures: list[RegionFigures]
    trackers: list[_core.ContourTracker | None]  # of its cuts; None: as in the text before
    started: StartedTrials  # sensitivity that is simulated ahead of need
    rapids: ShapedRapids | None = None  # what became of its rapids; None: they were not to be shaped


class ConversionPlan:
    """What a conversion is to do; changed as cuts leave their tolerance, their price or the budget."""

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
            pool.submit(self.model.simulate_original, region.path, offset=self.model.offset(region))
            for region in program.regions
        ]
        fastest = max((region.path.fastest_feed_mm_per_s for region in program.regions), default=0.0)
        self.grid_for = partial(choose_grid, machine, fastest_mm_per_s=fastest)
        self.grid = self.grid_for(block_period_s)
        self.writer = TextWriter(program, self.model, self.grid, pool)
        self.judge = Judge(self.model)
        self.curves = CutCurves(self.writer, program, machine, self.originals)
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
        self.simulated: dict[int, tuple[object, RegionFigures]] = {}
        self.originals_judged: dict[int, RegionFigures] = {}
        self.spending = None if budget is None else Spending(budget, program, machine)
        if budget is None:
            self.writer.begin(self.reasons, self.aims.room_um, self.aims.feed_ratio)
        self.original_within = False  # every cut of the original keeps its limits
        self.original_s = pool.submit(self.model.cycle_time_s, program.core)
        self.rapid_vibration = pool.submit(rapid_vibration_um, program, self.model)

    def use_grid(self, grid: Grid) -> None:
        """Write on this grid from now on."""
        if self.writer.grid is not grid:
            self.writer = TextWriter(self.program, self.model, grid, self.pool)
            self.curves.use(self.writer)

    def excess_s(self, shaped: Shaped) -> float:
        """Time above what the price of the program allows."""
        price_s = self.price_s()
        cuts_s = math.fsum(figures.emitted_s - figures.original.duration_s for figures in shaped.figures)
        cuts_s += self.machine.emission.prefill_dwell_s * len(shaped.figures)
        if cuts_s < _NEAR_PRICE * price_s or not self.machine.emission.header:
            return cuts_s - price_s
        return self.model.cycle_time_s(shaped.emitted.core) - self.original_s.result() - price_s

    def price_s(self) -> float:
        """Time that shaping may add to the program."""
        return self.original_s.result() * self.machine.price.program_time_percent / 100.0

    def is_benefit(self, shaped: Shaped) -> bool:
        """Whether a shaped cut gains enough, see `benefits`."""
        least, limit_um = self.machine.shaping.least_gain_um, self.machine.tolerance.contour_um
        return any(benefits(verdict, limit_um, least) for verdict in self.verdicts(shaped))

    def verdicts(self, shaped: Shaped) -> tuple[RegionVerdict, ...]:
        """Every shaped cut beside its limits."""
        return self.judge.verdicts(shaped.figures, shaped.written.placed, self.grid.block_period_s)

    @property
    def chosen(self) -> list[int]:
        """Cuts that are to be shaped, by their index."""
        return [index for index, reason in enumerate(self.reasons) if not reason]

    def is_keepable(self, index: int) -> bool:
        """Whether a cut can be left unchanged."""
        return keepable(self.program.regions[index], self.machine)

    def leave(self, index: int, reason: str, gained_um: float | None) -> None:
        """Leave a cut unchanged."""
        self.reasons[index] = reason
        self.left.add(index)
        if gained_um is not None:
            self.gains_um[index] = gained_um

    def leave_out(self) -> None:
        """Leave unchanged, before anything is shaped, what has nothing to gain or keeps its limits as it is."""
        self.original_within = self._original_is_within()
        if self.choice.shape_all:
            return
        least = self.machine.shaping.least_gain_um
        for index, (reason, original) in enumerate(zip(self.reasons, self.originals, strict=True)):
            if not reason and self.is_keepable(index):
                most = most_to_gain_um(original.result())
                if most < least:
                    self.leave(index, f"nothing there to gain: {most:.1f} µm", most)
        if self.original_within:
            self.leave_everything("every cut of the original keeps its limits")

    def leave_everything(self, reason: str) -> None:
        """Nothing is shaped; cuts that can stay as they are and have no reason yet get this one."""
        for index in self.chosen:
            if self.is_keepable(index):
                gained = self.gains_um.get(index)
                self.leave(index, reason or f"shaping gains {gained or 0.0:.1f} µm", gained)

    def _original_is_within(self) -> bool:
        """Whether every cut as programmed keeps its limits in every operating condition that counts for it."""
        regions = self.program.regions
        placed = [Placed(region, region.first_line, region.last_line) for region in regions]
        nominal = Judge(self.model, [case for case in self.judge.cases if case.nominal])
        for judge in (nominal, self.judge):  # the first needs few simulations
            figures = [
                simulate_unchanged(judge, self.model, region, region, original.result())
                for region, original in zip(regions, self.originals, strict=True)
            ]
            if any(verdict.misses for verdict in judge.verdicts(figures, placed, self.grid.block_period_s)):
                return False
        self.originals_judged = dict(enumerate(figures))
        return True
