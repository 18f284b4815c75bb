"""The plan of a conversion: its shaper; contour tolerance and feed of each cut and their cost; cuts left unchanged."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from shapegcode import _core
from shapegcode.conversion.budget import Budget, Spending
from shapegcode.conversion.tables import StartedTrials
from shapegcode.conversion.whole_text import Aim, TextWriter, Written, why_kept
from shapegcode.conversion.write import keepable
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.program import Program
from shapegcode.results.table import Column, Table
from shapegcode.shaping.grid import Grid, choose_grid
from shapegcode.verdict.figures import Placed, RegionVerdict
from shapegcode.verdict.judge import Judge, RegionFigures, max_gain_um, rapid_vibration_um

if TYPE_CHECKING:
    from shapegcode.conversion.rapids.shape import ShapedRapids

_SLOWER = 0.98  # ratio of the lowered feed to the one that would just suffice
_MIN_FEED_RATIO = 0.5  # of the programmed feed: below it, a too high speed has other causes
_HELPED = 0.98  # ratio of errors: a tighter plan with less improvement is reverted
_PRICE_MARGIN = 0.995  # ratio of the permitted time used for a plan
_LOOSER = 1.05  # smallest factor on the deviation after a plan that was still too expensive


@dataclass
class _Attempt:
    """The latest plan with which a cut exceeded its tolerance."""

    allowed_um: float
    reached_um: float  # deviation reached with it
    overridden: bool  # beyond tolerance only at another feed override
    helps: bool = True  # a tighter one helps


class Aims:
    """Tolerance, feed and price of every cut of one conversion."""

    def __init__(
        self, program: Program, machine: Machine, reasons: list[str], curve_of: Callable[[int], CutCurve]
    ) -> None:
        count = len(program.regions)
        self._machine, self._curve_of = machine, curve_of
        self._places = {id(region): index for index, region in enumerate(program.regions)}
        self.reasons = reasons  # why a cut is left unchanged; empty: it is shaped; updated here
        self._asked_um = machine.tolerance.contour_um
        self.allowed_um = [machine.tolerance.contour_um * _MARGIN] * count  # deviation for which its feed is planned
        self.feed_ratio = [1.0] * count  # ratio of the planned to the programmed feed
        self.original_s: dict[int, float] = {}
        self.emitted_s: dict[int, float] = {}  # of every cut that was ever shaped, until the set-points rest
        self._asked_s: dict[int, float] = {}  # likewise, for the requested tolerance
        self._blocks_s: dict[int, float] = {}  # time of its blocks
        self._tried: dict[int, _Attempt] = {}
        self._priced: set[int] = set()  # planned for the tightest tolerance within their price

    def wanted(self) -> dict[int, Aim]:
        """Planned deviation and feed ratio of each cut to shape."""
        return {
            index: (self.allowed_um[index], self.feed_ratio[index]) for index, why in enumerate(self.reasons) if not why
        }

    def index(self, figures_place: object) -> int:
        """Index of a region of the original."""
        return self._places[id(figures_place)]

    def note(self, written: Written, figures: Sequence[RegionFigures]) -> None:
        """Store the times of the shaped cuts."""
        for place, region in zip(written.placed, figures, strict=True):
            index = self.index(place.region)
            self.original_s[index], self.emitted_s[index] = region.original.duration_s, region.emitted_s
            self._blocks_s[index] = written.shaped[index].duration_s
            if index not in self._priced:
                self._asked_s[index] = region.emitted_s

    def slow_down(self, written: Written, figures: Sequence[RegionFigures]) -> bool:
        """Lower the feed of cuts that are too fast along the path. False if no feed was lowered."""
        limit = 1.0 + self._machine.tolerance.feed_excess_ratio
        slower = False
        for place, region in zip(written.placed, figures, strict=True):
            excess = region.feed_excess
            index, ratio = self.index(place.region), 0.0 if excess is None else excess.ratio
            if ratio > limit and self.feed_ratio[index] > _MIN_FEED_RATIO:
                self.feed_ratio[index] = max(_MIN_FEED_RATIO, self.feed_ratio[index] * _SLOWER * limit / ratio)
                slower = True
        return slower

    def tighten(self, written: Written, figures: Sequence[RegionFigures], judge: Judge) -> bool:
        """Plan cuts that exceed their contour tolerance for a tighter one, so that they slow down. False: no change.

        The bound on the feed treats corners and arcs one by one, but deviations within one shaper duration add up. If
        the planned deviation of a cut is below its tolerance, tightening starts from that deviation (with a
        tolerance above it the plan would not change). A cut that exceeds the limit only at other overrides is tightened
        once. A cut gets its former plan back if tightening does not help, or was not enough at other overrides.
        """
        allowed_um = self.allowed_um
        tightened = False
        for place, region in zip(written.placed, figures, strict=True):
            index = self.index(place.region)
            limit, before = self._asked_um, self._tried.get(index)
            if index in self._priced:
                continue
            reached = judge.contour_um(region, turned=False)
            if overridden := reached <= limit:
                reached = judge.contour_um(region)
            if reached <= limit or (before is not None and not before.helps):
                continue
            tightened = True
            if before is not None and (before.overridden or (not overridden and reached > _HELPED * before.reached_um)):
                allowed_um[index] = before.allowed_um
                before.helps = False
                continue
            self._tried[index] = _Attempt(allowed_um[index], reached, overridden)
            # 0: without a contour target nothing is planned.
            allowed_um[index] = min(allowed_um[index], written.shaped[index].planned_um or math.inf)
            allowed_um[index] *= _MARGIN * limit / reached
        return tightened

    def keep_cut_price(self, written: Written, keepable: Callable[[int], bool], attempts_left: int) -> bool:
        """Loosen the tolerance of cuts whose time exceeds the price; leave a cut unchanged if no tolerance suffices."""
        percent = self._machine.price.cut_time_percent
        changed = False
        for place in written.placed:
            index = self.index(place.region)
            allowed_s = self.original_s[index] * (1.0 + percent / 100.0)
            if self.emitted_s[index] <= allowed_s:
                continue
            found_um = self._tightest_um(index, allowed_s)
            if found_um is not None and attempts_left > 0:
                self._loosen(index, found_um if attempts_left > 1 else self._curve_of(index).loosest_um)
            elif keepable(index):
                min_s = self.emitted_s[index] if found_um is not None else self._planned_s(index, math.inf)
                cost = (min_s / self.original_s[index] - 1.0) * 100.0
                self.reasons[index] = (
                    f"shaping it takes {cost:+.0f} % time at any tolerance, price {percent:g} % "
                    "(price.cut_time_percent)"
                )
            else:
                continue
            changed = True
        return changed

    def keep_program_price(
        self, excess_s: float, gains_um: Mapping[int, float], keepable: Callable[[int], bool]
    ) -> bool:
        """Bring the program's time within its price: loosen tolerances to a common value, then leave cuts unchanged."""
        cuts = [index for index in gains_um if not self.reasons[index]]
        wanted_s = math.fsum(self.emitted_s[index] for index in cuts) - excess_s

        def total_s(level_um: float) -> float:
            return math.fsum(self._planned_s(index, max(level_um, self.allowed_um[index])) for index in cuts)

        if cuts and total_s(math.inf) <= wanted_s:
            level_um = _bisect(
                min(self.allowed_um),
                max(self._curve_of(index).loosest_um for index in cuts),
                lambda allowed_um: total_s(allowed_um) <= wanted_s,
            )
            for index in cuts:
                saved_s = self._planned_s(index, self.allowed_um[index]) - self._planned_s(index, level_um)
                if level_um > self.allowed_um[index] and saved_s > 1e-3 * excess_s:
                    self._loosen(index, level_um)
            return True
        costs = {index: self.emitted_s[index] - self.original_s[index] for index in cuts if keepable(index)}
        order = sorted((i for i in costs if costs[i] > 0.0), key=lambda index: gains_um[index] / costs[index])
        for index in order:
            if excess_s <= 0.0:
                break
            excess_s -= costs[index]
            percent = self._machine.price.program_time_percent
            self.reasons[index] = (
                f"gains least for its time ({gains_um[index]:.1f} µm for {costs[index]:.2f} s), and the program may "
                f"take {percent:g} % more (price.program_time_percent)"
            )
        return bool(order)

    @property
    def is_priced(self) -> bool:
        """True if a shaped cut has a looser tolerance than requested, namely the tightest one that its price allows."""
        return any(not self.reasons[index] for index in self._priced)

    def shaped_for_um(self, index: int) -> float:
        """Contour tolerance of a shaped cut, µm: the requested one, or the tightest within its price."""
        return max(self._asked_um, self.allowed_um[index] / _MARGIN) if index in self._priced else self._asked_um

    def time_s(self, index: int, tolerance_um: float) -> float:
        """Time of a cut at a contour tolerance: simulated for the requested one, else planned."""
        if tolerance_um <= self._asked_um:
            return self._asked_s[index]
        return min(self._asked_s[index], self._planned_s(index, tolerance_um * _MARGIN))

    def tolerance_curve(self, original_s: float, original_um: float) -> ToleranceCurve | None:
        """Tolerance against time of the program; None if no cut was ever shaped."""
        cuts = list(self.emitted_s)
        if not cuts:
            return None
        asked = self._asked_um
        wanted = [("as asked", asked), *((f"{factor:g} times", factor * asked) for factor in _FACTORS[1:])]
        if original_um > asked:
            wanted.append(("the original's contour error", original_um))
        loosest = max(asked, *(self._curve_of(index).planned_um[-1] / _MARGIN for index in cuts))
        wanted.append(("no slowing needed", loosest))
        points = [self._point(name, um, cuts, original_s) for name, um in sorted(wanted, key=lambda each: each[1])]
        tolerances, times = [each.tolerance_um for each in points], [each.time_s for each in points]
        knee = knee_of(tolerances, times)
        if knee is not None:
            points[knee] = replace(points[knee], is_knee=True)
        return ToleranceCurve(tuple(points), len(cuts))

    def _point(self, name: str, tolerance_um: float, cuts: Sequence[int], original_s: float) -> TolerancePoint:
        price = self._machine.price
        times = {index: self.time_s(index, tolerance_um) for index in cuts}
        dearest = max(times[index] / self.original_s[index] - 1.0 for index in cuts)
        time_s = original_s + math.fsum(times[index] - self.original_s[index] for index in cuts)
        increase = (time_s / original_s - 1.0) * 100.0 if original_s > 0.0 else 0.0
        within = increase <= price.program_time_percent and dearest * 100.0 <= price.cut_time_percent
        return TolerancePoint(name, tolerance_um, time_s, increase, within)

    def _planned_s(self, index: int, allowed_um: float) -> float:
        """Time of a cut planned for a deviation, s; time lost by slowing is scaled to that of the written blocks."""
        curve, blocks_s = self._curve_of(index), self._blocks_s[index]
        min_s, now_s, then_s = (curve.time_s(um) for um in (math.inf, self.allowed_um[index], allowed_um))
        ratio = max(0.0, blocks_s - min_s) / (now_s - min_s) if now_s > min_s else 1.0
        slowest_s = min_s if now_s > min_s else max(min_s, blocks_s)
        return self.emitted_s[index] - blocks_s + slowest_s + ratio * (then_s - min_s)

    def _loosen(self, index: int, allowed_um: float) -> None:
        # More if the plan was too optimistic.
        self.allowed_um[index] = max(allowed_um, _LOOSER * self.allowed_um[index])
        self._priced.add(index)

    def _tightest_um(self, index: int, allowed_s: float) -> float | None:
        """Smallest deviation for which a cut can be planned within a time; None if there is none."""
        if self._planned_s(index, math.inf) > allowed_s:
            return None
        now_um = self.allowed_um[index]
        return _bisect(
            now_um,
            max(self._curve_of(index).loosest_um, now_um),
            lambda allowed_um: self._planned_s(index, allowed_um) <= allowed_s * _PRICE_MARGIN,
        )


def _bisect(low: float, high: float, is_enough: Callable[[float], bool]) -> float:
    """Smallest sufficient value, by bisection on a logarithmic scale; the upper end if none is."""
    for _ in range(40):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if is_enough(middle) else (middle, high)
    return high


_MARGIN = 0.95  # planned ratio of the tolerance: the rest is for rounding and effects outside the plan
_FACTORS = (1.0, 1.25, 1.5, 2.0)  # ratios to the requested tolerance at which a cut is planned
_BETWEEN = (2.8, 4.0, 5.6, 8.0)  # likewise, up to the deviation that needs no slowing
_FLAT = 0.002  # relative change of time: a flatter curve has no knee


@dataclass(frozen=True)
class CutCurve:
    """Time of one shaped cut over its planned deviation."""

    planned_um: tuple[float, ...]  # ascending; the last one is reached without slowing
    times_s: tuple[float, ...]  # of the shaped command at each, descending

    @property
    def loosest_um(self) -> float:
        """Planned deviation above which no time is saved, plus 10 %."""
        return self.planned_um[-1] * 1.1

    def time_s(self, planned_um: float) -> float:
        """Time at a planned deviation: linear over its logarithm; constant beyond the planned points."""
        if len(self.planned_um) == 1 or not math.isfinite(planned_um):
            return self.times_s[-1]
        return float(np.interp(math.log(planned_um), np.log(self.planned_um), self.times_s))


@dataclass(frozen=True)
class TolerancePoint:
    """The program at one contour tolerance."""

    name: str  # "as asked", "1.5 times", "the original's contour error", "no slowing needed"
    tolerance_um: float  # contour tolerance; "no slowing needed": smallest from the requested up that slows no cut
    time_s: float  # of the program
    time_increase_percent: float  # over the original
    is_within_price: bool  # the times of the program and of each cut are within the table [price]
    is_knee: bool = False  # a tighter tolerance costs disproportionately more time


@dataclass(frozen=True)
class ToleranceCurve:
    """Tolerance against time, over the cuts that were ever shaped in the conversion."""

    points: tuple[TolerancePoint, ...]  # from tight to loose
    cuts: int  # number of these cuts

    @property
    def sentence(self) -> str:
        """Cost of the requested tolerance and the knee: "15 µm costs +102 % time, 25 µm +18 %"; empty without knee."""
        first, knee = self.points[0], next((each for each in self.points if each.is_knee), None)
        if knee is None:
            return ""
        return (
            f"{first.tolerance_um:.3g} µm costs {first.time_increase_percent:+.3g} % time, "
            f"{knee.tolerance_um:.3g} µm {knee.time_increase_percent:+.3g} %"
        )


def plan_curve(
    path: _core.Path, fir: _core.Fir, options: _core.ShapingOptions, asked_um: float, original_um: float
) -> CutCurve:
    """Plan a cut without limit, then ever tighter to the requested tolerance; each search starts from the last one."""
    wanted = sorted(
        {*(factor * asked_um for factor in (*_FACTORS, *_BETWEEN)), max(original_um, asked_um)}, reverse=True
    )
    tried = [math.inf, *(each * 1e-3 for each in wanted)]
    planned = _core.plan_tolerances(path, fir, options, tried)
    reached_um = max(planned[0][1] * 1e3, 1e-3)
    points = {reached_um: planned[0][0]}
    # Points that need no slowing are redundant; a search may end slightly below the time of a looser one.
    slowest = planned[0][0]
    for tolerance_um, (time_s, _) in zip(wanted, planned[1:], strict=True):
        if tolerance_um < reached_um:
            slowest = max(slowest, time_s)
            points[tolerance_um] = slowest
    ordered = sorted(points.items())
    return CutCurve(tuple(um for um, _ in ordered), tuple(time_s for _, time_s in ordered))


def knee_of(tolerances_um: Sequence[float], times_s: Sequence[float]) -> int | None:
    """Index of the point furthest below the line from first to last, on logarithmic scales; None: no knee."""
    if len(times_s) < 3 or times_s[0] <= times_s[-1] * (1.0 + _FLAT):
        return None
    x, y = np.log(tolerances_um), np.log(times_s)
    if x[-1] <= x[0]:
        return None
    below = (1.0 - (x - x[0]) / (x[-1] - x[0])) - (y - y[-1]) / (y[0] - y[-1])
    rank = int(np.argmax(below))
    return rank if below[rank] > 0.0 else None


def curve_table(curve: ToleranceCurve) -> Table:
    """The curve as a table."""

    def remarks(point: TolerancePoint) -> str:
        return ", ".join(["knee"] * point.is_knee + ["above the price"] * (not point.is_within_price))

    columns = (
        Column("contour tolerance", value="name", text=True),
        Column("µm", value="tolerance_um", digits=1),
        Column("program s", value="time_s", digits=2),
        Column("increase %", value="time_increase_percent", digits=1),
        Column("", value=remarks, text=True),
    )
    caption = f"cuts in this table: {curve.cuts}"
    return Table("tolerance against time", columns, curve.points, caption)


_NEAR_PRICE = 0.7  # ratio of the price above which the program's time is computed in full

Progress = Callable[[str, float, int], None]


@dataclass(frozen=True)
class CutChoice:
    """Options of the caller: cuts to shape, tolerance curve."""

    not_shaped: dict[int, str]  # reason not to shape a cut, by its index
    shape_all: bool  # shape whatever can be shaped
    tolerance_curve: bool  # compute the times at other tolerances


@dataclass(frozen=True)
class Shaped:
    """A program written, read back and simulated."""

    written: Written
    emitted: Program
    figures: list[RegionFigures]
    trackers: list[_core.ContourTracker | None]  # one per shaped cut; None: simulated before with the same text
    started: StartedTrials  # sensitivity trials started early
    rapids: ShapedRapids | None = None  # None: rapids are not shaped


class ConversionPlan:
    """State of a conversion: shaper, aims and choices, updated as cuts exceed tolerance, price or budget."""

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
        self.fixed_period = block_period_s is not None or machine.emission.block_period_s is not None
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
        self._curves: dict[int, CutCurve] = {}  # of cuts on this grid, planned on first use
        self.reasons = [
            choice.not_shaped.get(index) or why_kept(program, region, machine, self.grid)
            for index, region in enumerate(program.regions)
        ]
        self.aims = Aims(program, machine, self.reasons, self.curve_of)
        self.gains_um: dict[int, float] = {}
        self.left: set[int] = set(choice.not_shaped)  # with a reason in the table of cuts
        self.simulated: dict[int, tuple[object, RegionFigures]] = {}
        self.originals_judged: dict[int, RegionFigures] = {}
        self.spending = None if budget is None else Spending(budget, program, machine)
        if budget is None:
            self.writer.begin(self.aims.wanted())
        self.original_within = False  # every cut of the original keeps its limits
        self.original_s = pool.submit(self.model.cycle_time_s, program.core)
        self.rapid_vibration = pool.submit(rapid_vibration_um, program, self.model)

    def use_grid(self, grid: Grid) -> None:
        """Write on this grid from now on."""
        if self.writer.grid is not grid:
            self.writer = TextWriter(self.program, self.model, grid, self.pool)
            self._curves.clear()

    def note_curves(self, written: Written) -> None:
        """Store the curves, of one point, of the cuts that the tolerance does not slow: they need no plan."""
        for index, shaped in written.shaped.items():
            if not shaped.is_slowed:
                self._curves.setdefault(index, CutCurve((max(shaped.planned_um, 1e-3),), (shaped.duration_s,)))

    def curve_of(self, index: int) -> CutCurve:
        """The curve of a cut."""
        if index not in self._curves:
            original_um = getattr(self.originals[index].result(), self.judge.target).max_abs_mm * 1e3
            self._curves[index] = plan_curve(
                self.program.regions[index].path, self.writer.grid.fir, self.writer.options(index),
                self.machine.tolerance.contour_um * _MARGIN, original_um,
            )  # fmt: skip
        return self._curves[index]

    def excess_s(self, shaped: Shaped) -> float:
        """Time by which the program exceeds its permitted increase of time (`price_s`), s; negative: below it."""
        price_s = self.price_s()
        cuts_s = math.fsum(figures.emitted_s - figures.original.duration_s for figures in shaped.figures)
        cuts_s += self.machine.emission.prefill_dwell_s * len(shaped.figures)
        if cuts_s < _NEAR_PRICE * price_s or not self.machine.emission.header:
            return cuts_s - price_s
        return self.model.cycle_time_s(shaped.emitted.core) - self.original_s.result() - price_s

    def price_s(self) -> float:
        """Time that shaping may add to the program, s."""
        return self.original_s.result() * self.machine.price.program_time_percent / 100.0

    def is_benefit(self, shaped: Shaped) -> bool:
        """True if a shaped cut gains enough."""
        least, limit_um = self.machine.shaping.least_gain_um, self.machine.tolerance.contour_um
        return any(verdict.is_benefit(limit_um, least) for verdict in self.verdicts(shaped))

    def verdicts(self, shaped: Shaped) -> tuple[RegionVerdict, ...]:
        """Verdict of every shaped cut against its limits."""
        return self.judge.verdicts(shaped.figures, shaped.written.placed, self.grid.block_period_s)

    @property
    def chosen(self) -> list[int]:
        """Indices of the cuts to shape."""
        return [index for index, reason in enumerate(self.reasons) if not reason]

    def is_keepable(self, index: int) -> bool:
        """True if a cut can be left unchanged."""
        return keepable(self.program.regions[index], self.program)

    def leave(self, index: int, reason: str) -> None:
        """Leave a cut unchanged."""
        self.reasons[index] = reason
        self.left.add(index)

    def leave_out(self) -> None:
        """Leave cuts unchanged without gain; all that can be if every cut keeps its limits (not with `shape_all`)."""
        self.original_within = self._original_is_within()
        if self.choice.shape_all:
            return
        least = self.machine.shaping.least_gain_um
        for index, (reason, original) in enumerate(zip(self.reasons, self.originals, strict=True)):
            if not reason and self.is_keepable(index):
                most = max_gain_um(original.result())
                if most < least:
                    self.gains_um[index] = most
                    self.leave(index, f"nothing to gain: {most:.1f} µm")
        if self.original_within:
            self.leave_everything("every cut of the original keeps its limits")

    def leave_everything(self, reason: str) -> None:
        """Leave every cut unchanged for which that is possible; a cut without a reason gets this one."""
        for index in self.chosen:
            if self.is_keepable(index):
                self.leave(index, reason or f"shaping gains {self.gains_um.get(index, 0.0):.1f} µm")

    def _original_is_within(self) -> bool:
        """True if every cut of the original keeps its limits in every operating condition that counts."""
        regions = self.program.regions
        placed = [Placed(region, region.first_line, region.last_line) for region in regions]
        nominal = Judge(self.model, [case for case in self.judge.cases if case.nominal])
        for judge in (nominal, self.judge):  # the first needs few simulations
            figures = [
                judge.simulate_unchanged(region, region, original.result())
                for region, original in zip(regions, self.originals, strict=True)
            ]
            if any(verdict.misses for verdict in judge.verdicts(figures, placed, self.grid.block_period_s)):
                return False
        self.originals_judged = dict(enumerate(figures))
        return True
