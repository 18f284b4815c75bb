"""What each cut is shaped for: its contour tolerance and feed, and what that may cost in time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from shapegcode.conversion.curve import FACTORS, MARGIN, CutCurve, ToleranceCurve, TolerancePoint, knee_of
from shapegcode.conversion.whole_text import Written
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.verdict.judge import Judge, RegionFigures

__all__ = ["Aims"]

_SLOWER = 0.98  # than what would just be slow enough
_LEAST_FEED_RATIO = 0.5  # of the programmed feed: what runs too fast at that is not the feed's doing
_HELPED = 0.98  # of what was reached before: a tighter plan that brings no more is taken back
_PRICE_MARGIN = 0.995  # of the time that a price allows, for a plan
_LOOSER = 1.05  # least step of a plan that was still too expensive
_LEVELS = 40  # steps of a bisection


@dataclass
class _Attempt:
    """The last plan of a cut that left its tolerance, what it then reached, µm, and whether a tighter one helps.

    `overridden`: it left the tolerance only at another feed override.
    """

    room_um: float
    reached_um: float
    overridden: bool
    helps: bool = True


class Aims:
    """Tolerance, feed and price of every cut of one conversion.

    Args:
        program: the original.
        machine: its tolerances and prices.
        reasons: why a cut is left unchanged, per cut; empty: it is shaped. Changed here.
        curve_of: time of a cut over its tolerance, by its index.
    """

    def __init__(
        self, program: Program, machine: Machine, reasons: list[str], curve_of: Callable[[int], CutCurve]
    ) -> None:
        count = len(program.regions)
        self._machine, self._curve_of = machine, curve_of
        self._places = {id(region): index for index, region in enumerate(program.regions)}
        self.reasons = reasons
        self._asked_um = machine.tolerance.contour_um
        self.room_um = [machine.tolerance.contour_um * MARGIN] * count
        """Deviation that its feed is planned for."""
        self.feed_ratio = [1.0] * count
        """Of the programmed feed, that it is planned with."""
        self.original_s: dict[int, float] = {}
        self.emitted_s: dict[int, float] = {}
        """Of every cut that was shaped once, until the set-points rest."""
        self._asked_s: dict[int, float] = {}  # likewise, for the tolerance that was asked for
        self._blocks_s: dict[int, float] = {}  # time of its blocks
        self._tried: dict[int, _Attempt] = {}
        self._priced: set[int] = set()  # planned as closely as their price allows, whatever that reaches

    def index(self, figures_place: object) -> int:
        """Rank of a region of the original."""
        return self._places[id(figures_place)]

    def note(self, written: Written, figures: Sequence[RegionFigures]) -> None:
        """Remember how long the cuts take as they were shaped."""
        for place, region in zip(written.placed, figures, strict=True):
            index = self.index(place.region)
            self.original_s[index], self.emitted_s[index] = region.original.duration_s, region.emitted_s
            self._blocks_s[index] = written.durations_s[index]
            if index not in self._priced:
                self._asked_s[index] = region.emitted_s

    def slow_down(self, written: Written, figures: Sequence[RegionFigures]) -> bool:
        """Give cuts that run faster along the path than the machine allows a lower feed. False if there are none."""
        limit = 1.0 + self._machine.tolerance.feed_excess_ratio
        slower = False
        for place, region in zip(written.placed, figures, strict=True):
            excess = region.feed_excess
            index, ratio = self.index(place.region), 0.0 if excess is None else excess.ratio
            if ratio > limit and self.feed_ratio[index] > _LEAST_FEED_RATIO:
                self.feed_ratio[index] = max(_LEAST_FEED_RATIO, self.feed_ratio[index] * _SLOWER * limit / ratio)
                slower = True
        return slower

    def tighten(self, written: Written, figures: Sequence[RegionFigures], judge: Judge) -> bool:
        """Plan cuts that left their contour tolerance more tightly, so that they run slower. False if there is none.

        The bound on feed counts corners and arcs one by one; where several fall into one shaper they add up. Where the
        feed was searched for a target, what it was planned for counts: a looser plan than that would change nothing. A
        cut that a tighter plan does not help gets its plan back: slower would only be slower. So does one that is
        within the limit at 100 % feed override, and after one attempt still not at the stated others.
        """
        room_um = self.room_um
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
                room_um[index] = before.room_um
                before.helps = False
                continue
            self._tried[index] = _Attempt(room_um[index], reached, overridden)
            room_um[index] = min(room_um[index], written.planned_um.get(index, math.inf))
            room_um[index] *= MARGIN * limit / reached
        return tightened

    def keep_cut_price(self, written: Written, keepable: Callable[[int], bool], attempts_left: int) -> bool:
        """Loosen cuts that take longer than the price of one cut; leave unchanged what costs more in any case."""
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
                least_s = self.emitted_s[index] if found_um is not None else self._planned_s(index, math.inf)
                cost = (least_s / self.original_s[index] - 1.0) * 100.0
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
        """Loosen cuts, all to one tolerance, until the program is within its price; then leave cuts unchanged."""
        cuts = [index for index in gains_um if not self.reasons[index]]
        wanted_s = math.fsum(self.emitted_s[index] for index in cuts) - excess_s

        def total_s(level_um: float) -> float:
            return math.fsum(self._planned_s(index, max(level_um, self.room_um[index])) for index in cuts)

        if cuts and total_s(math.inf) <= wanted_s:
            level_um = _bisect(
                min(self.room_um), max(self._curve_of(index).loosest_um for index in cuts),
                lambda room_um: total_s(room_um) <= wanted_s,
            )  # fmt: skip
            for index in cuts:
                saved_s = self._planned_s(index, self.room_um[index]) - self._planned_s(index, level_um)
                if level_um > self.room_um[index] and saved_s > 1e-3 * excess_s:
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
    def priced(self) -> set[int]:
        """Cuts that are shaped as closely as their price allows, and not for the tolerance that was asked for."""
        return {index for index in self._priced if not self.reasons[index]}

    def shaped_for_um(self, index: int) -> float:
        """Contour tolerance that a cut is shaped for: what was asked, or the tightest that its price allows."""
        return max(self._asked_um, self.room_um[index] / MARGIN) if index in self._priced else self._asked_um

    def time_s(self, index: int, tolerance_um: float) -> float:
        """What a cut that was shaped once takes at a contour tolerance; infinity: nothing is slowed.

        As simulated at the tolerance that was asked for; else as planned, with what the control's own filter adds.
        """
        if tolerance_um <= self._asked_um:
            return self._asked_s[index]
        return min(self._asked_s[index], self._planned_s(index, tolerance_um * MARGIN))

    def tolerance_curve(self, original_s: float, original_um: float) -> ToleranceCurve | None:
        """Tolerance against time of the program."""
        cuts = list(self.emitted_s)
        if not cuts:
            return None
        asked = self._asked_um
        wanted = [("as asked", asked), *((f"{factor:g} times", factor * asked) for factor in FACTORS[1:])]
        if original_um > asked:
            wanted.append(("the original's contour error", original_um))
        loosest = max(asked, *(self._curve_of(index).planned_um[-1] / MARGIN for index in cuts))
        wanted.append(("no slowing", loosest))
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

    def _planned_s(self, index: int, room_um: float) -> float:
        """What a cut takes where its feed is planned for a deviation.

        What slowing costs, in the ratio in which it cost it as simulated; what is not slowed takes what is planned.
        """
        curve, blocks_s = self._curve_of(index), self._blocks_s[index]
        least_s, now_s, then_s = (curve.time_s(um) for um in (math.inf, self.room_um[index], room_um))
        ratio = max(0.0, blocks_s - least_s) / (now_s - least_s) if now_s > least_s else 1.0
        slowest_s = least_s if now_s > least_s else max(least_s, blocks_s)
        return self.emitted_s[index] - blocks_s + slowest_s + ratio * (then_s - least_s)

    def _loosen(self, index: int, room_um: float) -> None:
        self.room_um[index] = max(room_um, _LOOSER * self.room_um[index])  # more, where a plan was too good
        self._priced.add(index)

    def _tightest_um(self, index: int, allowed_s: float) -> float | None:
        """Smallest deviation for which a cut can be planned within a time; None: there is none."""
        if self._planned_s(index, math.inf) > allowed_s:
            return None
        now_um = self.room_um[index]
        return _bisect(
            now_um, max(self._curve_of(index).loosest_um, now_um),
            lambda room_um: self._planned_s(index, room_um) <= allowed_s * _PRICE_MARGIN,
        )  # fmt: skip


def _bisect(low: float, high: float, is_enough: Callable[[float], bool]) -> float:
    """Smallest value that is enough, over the logarithm; the upper end if nothing is."""
    for _ in range(_LEVELS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if is_enough(middle) else (middle, high)
    return high
