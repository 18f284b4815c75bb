"""The families of shapers on a sample grid: what defines them, imposed exactly there.

Rounding the times of a continuous design to a grid undoes its zeros. So a family is taken here by the
conditions that define it, and the shortest taps on the grid that meet them are looked for: zeros, with their
multiplicity, hold at ``z = e^{s*period}`` to rounding; a tolerated residual holds over its whole band, proven by
:func:`shapegcode._core.worst_residual`. A zero is linear in the taps. A limit on the residual is linear for each
frequency and direction, and the ones that matter are found as the linear program breaks them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.shaping.bands import ModeBand, check_times, ms, whole_periods
from shapegcode.shaping.cutting_planes import NO_RESIDUAL, SAME_RESIDUAL, CutPool, TapProblem
from shapegcode.shaping.grid_designs import RESIDUAL_LIMIT, exact_conditions, lower_hull, refined, smallest_enough

_LONGER = 4  # times the longest duration: how far a refusal looks for what would do
_HINT_PERIODS = 400  # longest grid that a refusal searches, periods
_SUPPORT_THRESHOLDS = (1e-9, 1e-7, 1e-13)  # magnitudes above one of these are taps


def shortest_on_grid(conditions: Conditions, period_s: float, max_duration_s: float, *, title: str) -> _core.Shaper:
    """Shortest shaper with taps at multiples of a period that meets the conditions.

    Among the shapers of the shortest duration, one without negative impulses has the least second central moment (the
    contour cost), one with them the least sum of magnitudes.

    Source: this project.
    """
    check_times(period_s=period_s, max_duration_s=max_duration_s)
    search = _GridSearch(conditions, period_s)
    most = whole_periods(max_duration_s, period_s)
    shaper = search.shortest(most)
    if shaper is not None:
        return shaper
    text = f"no {title} within {ms(max_duration_s)} on a {ms(period_s)} grid"
    further = min(_LONGER * most, _HINT_PERIODS)
    if further > most:
        longer = search.shortest(further)
        if longer is not None:
            raise _core.DesignError(f"{text}; the shortest lasts {ms(longer.duration_s)}")
        text += f", nor within {ms(further * period_s)}"
    raise _core.DesignError(f"{text}; {_polynomial(conditions, period_s)}; try another period")


def _polynomial(conditions: Conditions, period_s: float) -> str:
    if not conditions.zeros:
        return "there is no zero from which a polynomial could be made"
    try:
        shaper = _core.Shaper([0.0], [1.0])
        for zero in conditions.zeros:
            for _ in range(zero.multiplicity):
                shaper = _core.convolve(shaper, _core.grid_polynomial([zero.mode], period_s))
    except _core.ShapegcodeError as error:
        return f"nor is there a polynomial: {error}"
    return f"the polynomial with its zeros lasts {ms(shaper.duration_s)} with sum|a| {shaper.abs_sum:.4g}"


@dataclass(frozen=True)
class Zero:
    """A mode of which nothing may be left: `multiplicity` - 1 derivatives of the residual vanish with it."""

    mode: _core.Mode
    multiplicity: int = 1


@dataclass(frozen=True)
class ResidualLimit:
    """The most that may be left of a mode (no unit) whose natural frequency lies anywhere in a band (Hz)."""

    mode: _core.Mode
    lowest_hz: float
    highest_hz: float
    limit: float

    @property
    def band(self) -> ModeBand:
        """The band around its middle."""
        middle_hz = 0.5 * (self.lowest_hz + self.highest_hz)
        width = (self.highest_hz - self.lowest_hz) / (self.highest_hz + self.lowest_hz)
        return ModeBand(_core.Mode(middle_hz, self.mode.damping_ratio), width)

    def worst(self, shaper: _core.Shaper) -> float:
        """Proven bound on the residual over the band."""
        return _core.worst_residual(shaper, self.mode, self.lowest_hz, self.highest_hz).upper_bound


@dataclass(frozen=True)
class Conditions:
    """What a shaper must satisfy."""

    zeros: tuple[Zero, ...] = ()  # met to rounding
    limits: tuple[ResidualLimit, ...] = ()  # met over their bands
    largest_tap: float | None = None  # None: no tap is negative; else: the largest magnitude of a tap, either sign


class _GridSearch:
    """The linear programs of one set of conditions; the planes that were found are good for every duration."""

    def __init__(self, conditions: Conditions, period_s: float) -> None:
        self._conditions, self._period_s = conditions, period_s
        self._limit = min((each.limit for each in conditions.limits), default=NO_RESIDUAL)
        self._bands = [each.band for each in conditions.limits]
        self._pool = CutPool.around(self._bands)

    def shortest(self, most: int) -> _core.Shaper | None:
        """The shortest shaper of at most that many periods, or None."""
        # A guess: half a cycle for each zero, a whole one for each limit without a zero in it.
        cycles_s = sum(0.5 * zero.multiplicity / zero.mode.frequency_hz for zero in self._conditions.zeros)
        cycles_s = cycles_s or sum(1.0 / limit.mode.frequency_hz for limit in self._conditions.limits)
        start = max(1, math.ceil(cycles_s / self._period_s))
        # A solution stays one with further taps at zero.
        last = smallest_enough(lambda last: self._feasible(self._problem(last)) is not None, start, most)
        while last is not None and last <= most:
            for taps in self._candidates(last):
                if (shaper := self._polished(taps)) is not None:
                    return shaper
            last += 1  # what the linear program took for feasible was so within its tolerance only
        return None

    def _problem(self, last: int) -> TapProblem:
        largest = self._conditions.largest_tap
        max_abs_sum = None if largest is None else math.inf
        equal = self._equalities(last)
        return TapProblem(
            self._bands, self._period_s, last, equal, max_abs_sum, self._pool, largest=largest or math.inf
        )

    def _feasible(self, problem: TapProblem) -> FloatArray | None:
        with suppress(_core.DesignError):
            bounds = problem.least_worst(self._limit)
            return bounds.taps if bounds is not None and bounds.upper <= self._limit else None
        return None

    def _candidates(self, last: int) -> Iterator[FloatArray]:
        """Taps of that many periods, the best first."""
        problem = self._problem(last)
        feasible = self._feasible(problem)
        if feasible is None:
            return
        inner = (1.0 - 0.4 * SAME_RESIDUAL) * self._limit  # room for the gap of the planes and for the proof

        def cheapest(cost: FloatArray) -> FloatArray | None:
            with suppress(_core.DesignError):
                return problem.cheapest(cost, inner)
            return None

        if self._conditions.largest_tap is None:
            yield from lower_hull(cheapest, last)
        elif (least := cheapest(np.ones(last + 1))) is not None:
            yield least
        yield feasible

    def _equalities(self, last: int) -> tuple[FloatArray, FloatArray]:
        zeros = self._conditions.zeros
        modes, counts = [zero.mode for zero in zeros], [zero.multiplicity for zero in zeros]
        return exact_conditions(modes, self._period_s, last, counts)

    def _polished(self, vertex: FloatArray) -> _core.Shaper | None:
        """The taps solved again to rounding, or None if they then break a condition."""
        matrix, right = self._equalities(len(vertex) - 1)
        largest = self._conditions.largest_tap
        for threshold in _SUPPORT_THRESHOLDS:
            support = np.flatnonzero(np.abs(vertex) > threshold)
            taps = vertex[support]
            free = np.ones(len(taps), dtype=bool)
            if largest is not None:
                free = np.abs(taps) < largest - 1e-8
                taps[~free] = np.copysign(largest, taps[~free])
            columns = matrix[:, support]
            taps[free] = refined(columns[:, free], right - columns[:, ~free] @ taps[~free], taps[free])
            if abs(taps.sum() - 1.0) <= RESIDUAL_LIMIT and (taps.min() > 0.0 or largest is not None):
                times = (support - support[0]) * self._period_s
                shaper = _core.Shaper(times.tolist(), (taps / taps.sum()).tolist())
                if self._meets(shaper) and float(np.abs(matrix[:-1, support] @ taps).max(initial=0.0)) < RESIDUAL_LIMIT:
                    return shaper
        return None

    def _meets(self, shaper: _core.Shaper) -> bool:
        largest = self._conditions.largest_tap
        return (
            all(shaper.residual_ratio(zero.mode) <= RESIDUAL_LIMIT for zero in self._conditions.zeros)
            and all(each.worst(shaper) <= each.limit for each in self._conditions.limits)
            and (largest is None or float(np.abs(shaper.amplitudes).max()) <= largest * (1.0 + RESIDUAL_LIMIT))
        )
