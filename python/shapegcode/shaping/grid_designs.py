"""Shapers on a sample grid: the shortest taps on the grid that meet the defining conditions of a family.

Rounding the times of a continuous design to a grid destroys its zeros. So here a family is given by its
defining conditions, and the shortest taps that meet them are searched. Each zero has its full multiplicity, and
lies at ``z = e^{s*period}`` (s: pole of the mode) to round-off. A residual limit is met over its whole band, as
:func:`shapegcode._core.worst_residual` proves. A zero is a linear condition on the taps; for a limit
of the residual see `cutting_planes`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from shapegcode import _core
from shapegcode._core import DesignError, Mode, ShapegcodeError, Shaper, grid_polynomial
from shapegcode.io.units import FloatArray
from shapegcode.shaping.bands import (
    ModeBand,
    check_modes_and_times,
    check_times,
    mode_band,
    mode_names,
    ms,
    proven_worst,
    whole_periods,
)
from shapegcode.shaping.cutting_planes import NO_RESIDUAL, SAME_RESIDUAL, CutPool, TapProblem

RESIDUAL_LIMIT = 1e-10  # largest residual ratio of a returned design; usual values are 1e-16 to 1e-15

_SAME_CONDITION = 1e-13  # relative singular value below which two modes' conditions coincide on this grid
_SUPPORT_THRESHOLDS = (1e-9, 1e-7, 1e-13)  # smaller magnitudes are no taps; tried in order
_SAME_OBJECTIVE = 1e-9  # relative to the squared duration
_LONGER = 4  # for a message of failure a sufficient duration is sought up to this multiple of the longest duration
_HINT_PERIODS = 400  # and up to this number of periods


def shortest_non_negative(modes: Sequence[Mode], period_s: float, max_duration_s: float = 0.25) -> Shaper:
    """Design the shortest non-negative shaper on a grid with zero residual at every mode.

    The number of periods is the smallest for which the conditions (sum 1, each mode's complex residual zero)
    have a non-negative solution. Among the solutions of that duration the one with the least second central
    moment, the contour cost, is chosen. Modes with the same conditions on this grid (equal ones, or aliases of one
    another) count once. The taps of the optimiser are re-solved in full precision and checked.

    Args:
        modes: Modes to cancel, at least one; one above the grid's Nyquist frequency is fine.
        period_s: Period of the grid in s, above 0.
        max_duration_s: Longest duration in s that is tried, above 0.

    Returns:
        The shaper: times are multiples of `period_s`, amplitudes above 0, ``residual_ratio`` of every mode at
        most 1e-10 (about 1e-16 as a rule).

    Raises:
        ArgumentError: No mode, or a period or duration that is not finite and positive.
        DesignError: No such shaper within `max_duration_s`; the message describes the polynomial design.

    Source: this project.
    """
    modes = [mode_band(each).mode for each in modes]
    check_modes_and_times(modes, period_s=period_s, max_duration_s=max_duration_s)
    search = _GridSearch(Conditions(zeros=tuple(map(Zero, modes))), period_s)
    shaper = search.shortest(whole_periods(max_duration_s, period_s))
    if shaper is not None:
        return shaper
    try:
        polynomial = grid_polynomial(modes, period_s)
        what_exists = f"the shortest polynomial takes {ms(polynomial.duration_s)} with sum|a| {polynomial.abs_sum:.4g}"
    except ShapegcodeError as error:
        what_exists = f"nor is there a polynomial design: {error}"
    raise DesignError(
        f"no non-negative design within {ms(max_duration_s)} on a {ms(period_s)} grid for modes "
        f"{mode_names(modes)}; {what_exists}; try another period"
    )


def shortest_on_grid(conditions: Conditions, period_s: float, max_duration_s: float, *, title: str) -> Shaper:
    """Design the shortest shaper with taps at multiples of a period that meets the conditions.

    Of the shapers of the shortest duration the one with the least second central moment is chosen (the contour cost; to
    0.1 % if the residual is limited over bands); if taps may be negative, the one with the least sum of magnitudes.
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
            raise DesignError(f"{text}; the shortest takes {ms(longer.duration_s)}")
        text += f", nor within {ms(further * period_s)}"
    raise DesignError(f"{text}; {_polynomial(conditions, period_s)}; try another period")


def _polynomial(conditions: Conditions, period_s: float) -> str:
    if not conditions.zeros:
        return "without zeros there is no polynomial design"
    try:
        shaper = Shaper([0.0], [1.0])
        for zero in conditions.zeros:
            for _ in range(zero.multiplicity):
                shaper = _core.convolve(shaper, grid_polynomial([zero.mode], period_s))
    except ShapegcodeError as error:
        return f"nor is there a polynomial design: {error}"
    return f"the polynomial with its zeros takes {ms(shaper.duration_s)} with sum|a| {shaper.abs_sum:.4g}"


@dataclass(frozen=True)
class Zero:
    """A mode with zero residual, and zero derivatives of the residual up to order `multiplicity` - 1."""

    mode: _core.Mode
    multiplicity: int = 1


@dataclass(frozen=True)
class Conditions:
    """Conditions on a shaper."""

    zeros: tuple[Zero, ...] = ()  # met to rounding
    bands: tuple[ModeBand, ...] = ()  # bands in which the residual is limited
    limit: float = NO_RESIDUAL  # residual ratio within `bands`
    largest_tap: float | None = None  # None: no tap is negative; else: the largest magnitude of a tap, either sign


class _GridSearch:
    """The linear programs of one set of conditions; the planes found are valid for every duration."""

    def __init__(self, conditions: Conditions, period_s: float) -> None:
        self._conditions, self._period_s = conditions, period_s
        self._pool = CutPool.around(conditions.bands)

    def shortest(self, most: int) -> Shaper | None:
        """The shortest shaper of at most `most` periods, or None."""
        # A guess: half a cycle for each zero; without zeros, a cycle for each band.
        cycles_s = sum(0.5 * zero.multiplicity / zero.mode.frequency_hz for zero in self._conditions.zeros)
        cycles_s = cycles_s or sum(1.0 / band.mode.frequency_hz for band in self._conditions.bands)
        start = max(1, math.ceil(cycles_s / self._period_s))
        too_few = 0
        if self._conditions.largest_tap is None:  # positive impulses cannot cancel within less than half a cycle
            half_cycles_s = (0.5 / zero.mode.frequency_hz for zero in self._conditions.zeros)
            too_few = max((math.ceil(each / self._period_s - 1e-9) - 1 for each in half_cycles_s), default=0)
        # Further zero taps keep a solution valid.
        last = smallest_enough(lambda last: self._feasible(self._problem(last)) is not None, start, most, too_few)
        while last is not None and last <= most:
            problem = self._problem(last)
            for taps, threshold in product(self._candidates(problem), _SUPPORT_THRESHOLDS):
                shaper = polished(taps, problem.equalities, self._period_s, threshold, self._conditions.largest_tap)
                if shaper is not None and self._meets(shaper):
                    return shaper
            last += 1  # the linear program was feasible only within its tolerance
        return None

    def _problem(self, last: int) -> TapProblem:
        zeros, bands, largest = self._conditions.zeros, self._conditions.bands, self._conditions.largest_tap
        modes, counts = [zero.mode for zero in zeros], [zero.multiplicity for zero in zeros]
        equal, total = exact_conditions(modes, self._period_s, last, counts), None if largest is None else math.inf
        return TapProblem(bands, self._period_s, last, equal, total, self._pool, largest=largest or math.inf)

    def _feasible(self, problem: TapProblem) -> FloatArray | None:
        with suppress(DesignError):
            bounds = problem.least_worst(self._conditions.limit)
            return bounds.taps if bounds is not None and bounds.upper <= self._conditions.limit else None
        return None

    def _candidates(self, problem: TapProblem) -> Iterator[FloatArray]:
        """Yield taps that solve a problem, the best first."""
        feasible = self._feasible(problem)
        if feasible is None:
            return
        inner = (1.0 - 0.4 * SAME_RESIDUAL) * self._conditions.limit  # margin for the gap of the planes and the proof

        def cheapest(cost: FloatArray) -> FloatArray | None:
            with suppress(DesignError):
                return problem.cheapest(cost, inner)
            return None

        if self._conditions.largest_tap is None:
            yield from lower_hull(cheapest, problem.last, SAME_RESIDUAL if problem.bands else 0.0)
        elif (least := cheapest(np.ones(problem.last + 1))) is not None:
            yield least
        yield feasible

    def _meets(self, shaper: Shaper) -> bool:
        largest = self._conditions.largest_tap
        return (
            all(shaper.residual_ratio(zero.mode) <= RESIDUAL_LIMIT for zero in self._conditions.zeros)
            and all(proven_worst(shaper, [each]) <= self._conditions.limit for each in self._conditions.bands)
            and (largest is None or float(np.abs(shaper.amplitudes).max()) <= largest * (1.0 + RESIDUAL_LIMIT))
        )


def exact_conditions(
    modes: Sequence[Mode], period_s: float, last: int, multiplicities: Sequence[int] = ()
) -> tuple[FloatArray, FloatArray]:
    """Matrix and right-hand side of the equality conditions on the taps at 0, 1 ... `last` periods.

    The rows of the modes (residual of each mode, scaled so that no entry exceeds 1) are replaced by an orthogonal
    basis of their span: near-equal modes then cost no precision, and equal ones no row. Without modes the sum
    is the only condition. Zeros are simple, or of these multiplicities.
    """
    if not modes:
        return np.ones((1, last + 1)), np.ones(1)
    steps = np.arange(last + 1)
    poles = np.array([mode.pole for mode in modes])
    decay = np.exp(np.outer(poles.real * period_s, last - steps))
    terms = decay * np.exp(1j * np.outer(poles.imag, steps * period_s))
    if multiplicities:
        powers = [(rank, power) for rank, count in enumerate(multiplicities) for power in range(count)]
        terms = np.array([terms[rank] * (steps / max(1, last)) ** power for rank, power in powers])
    _, strength, basis = np.linalg.svd(np.vstack([terms.real, terms.imag]), full_matrices=False)
    kept = basis[strength > _SAME_CONDITION * strength[0]] * math.sqrt(last + 1)
    matrix = np.vstack([kept, np.ones(last + 1)])
    return matrix, np.eye(len(matrix))[-1]


def smallest_enough(
    is_enough: Callable[[int], bool], start: int, most: int, too_few: int = 0, *, growth: float = 2.0,
    precision: float = 0.0,
) -> int | None:  # fmt: skip
    """Smallest sufficient number, to a relative precision, by growing, then bisection; None: above `most`."""
    enough = min(most, start)
    while enough < most and not is_enough(enough):
        too_few, enough = enough, max(enough + 1, math.ceil(growth * enough))
    enough = min(enough, most)
    if enough <= too_few or not is_enough(enough):
        return None
    return halved(is_enough, too_few, enough, precision)


def halved(is_enough: Callable[[int], bool], too_few: int, enough: int, precision: float = 0.0) -> int:
    """Smallest sufficient number by bisection, to a relative precision."""
    while enough - too_few > max(1, math.floor(precision * enough)):
        middle = (too_few + enough) // 2
        if is_enough(middle):
            enough = middle
        else:
            too_few = middle
    return enough


def refined(columns: FloatArray, right: FloatArray, taps: FloatArray) -> FloatArray:
    """Refine taps to meet ``columns @ taps == right`` to full precision."""
    for _ in range(3):  # the second removes the first one's rounding error, the third has no effect
        taps = taps + np.linalg.lstsq(columns, right - columns @ taps, rcond=1e-14)[0]
    return taps


class _Corner(NamedTuple):
    """Taps on the lower boundary of the feasible first two moments, and the slope of the supporting line there."""

    taps: FloatArray
    mean: float
    second: float
    slope: float | None
    """None: the boundary ends here with a vertical line."""

    @property
    def variance(self) -> float:
        return self.second - self.mean**2


def lower_hull(
    cheapest: Callable[[FloatArray], FloatArray | None], last: int, tolerance: float = 0.0
) -> list[FloatArray]:
    """Candidates for the least second central moment: corners of the lower boundary of the first two moments.

    The second central moment is concave in the taps, so no convex program minimises it; but it is least at one of
    these corners, each of which minimises a linear cost. A part of the boundary is skipped if the supporting
    lines at its two ends prove that no solution on it is better by more than `tolerance` (a ratio).
    """
    time = np.arange(last + 1) / last
    moments = np.vstack([time, time**2])

    def corner(cost: FloatArray, slope: float | None) -> _Corner | None:
        taps = cheapest(cost)
        if taps is None:
            return None
        mean, second = (moments @ taps).tolist()
        return _Corner(taps, mean, second, slope)

    leftmost, rightmost = corner(moments[0], None), corner(-moments[0], None)
    if leftmost is None or rightmost is None:
        return []
    found = [leftmost, rightmost]
    edges = [(leftmost, rightmost)]
    while edges:
        left, right = edges.pop()
        if _min_between(left, right) >= (1.0 - tolerance) * min(each.variance for each in found):
            continue
        run = right.mean - left.mean
        slope = (right.second - left.second) / run if run > _SAME_OBJECTIVE else 2.0 * left.mean
        below = corner(moments[1] - slope * moments[0], slope)
        least = min(left.second - slope * left.mean, right.second - slope * right.mean)
        if below is None or below.second - slope * below.mean >= least - _SAME_OBJECTIVE:
            continue
        found.append(below)
        if run > _SAME_OBJECTIVE:
            edges += [(left, below), (below, right)]
    return [each.taps for each in sorted(found, key=lambda each: each.variance)]


def _min_between(left: _Corner, right: _Corner) -> float:
    """Lower bound on the second central moment between two corners, from their supporting lines."""
    if left.slope is None or right.slope is None or right.slope - left.slope <= _SAME_OBJECTIVE:
        return -math.inf
    rise = right.second - left.second + left.slope * left.mean - right.slope * right.mean
    mean = rise / (left.slope - right.slope)
    second = left.second + left.slope * (mean - left.mean)
    return min(left.variance, right.variance, second - mean**2)


def polished(
    taps: FloatArray, conditions: tuple[FloatArray, FloatArray], period_s: float, threshold: float,
    largest: float | None = None,
) -> Shaper | None:  # fmt: skip
    """Re-solve taps above a threshold to round-off; None if they miss a condition, or must be above 0 and are not."""
    matrix, right = conditions
    support = np.flatnonzero(np.abs(taps) > threshold)
    columns, amplitudes = matrix[:, support], taps[support]
    # Taps at the largest magnitude, where there is one, are not changed.
    free = np.ones(len(support), dtype=bool) if largest is None else np.abs(amplitudes) < largest - 1e-8
    if largest is not None:
        amplitudes[~free] = np.copysign(largest, amplitudes[~free])
    amplitudes[free] = refined(columns[:, free], right - columns[:, ~free] @ amplitudes[~free], amplitudes[free])
    off = np.abs(columns @ amplitudes - right).max()
    if off > RESIDUAL_LIMIT or (largest is None and not np.all(amplitudes > 0.0)):
        return None
    return Shaper(((support - support[0]) * period_s).tolist(), (amplitudes / amplitudes.sum()).tolist())
