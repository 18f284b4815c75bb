"""Exact shaper designs on a sample grid that need an optimiser.

The shortest, a polynomial, may have wild taps: :func:`shortest_non_negative` spends a few more and never reverses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from shapegcode._core import DesignError, Mode, ShapegcodeError, Shaper, grid_polynomial
from shapegcode.io.units import FloatArray
from shapegcode.shaping.bands import check_modes_and_times, mode_names, ms, whole_periods
from shapegcode.shaping.cutting_planes import LinearProgram, non_negative_least_squares

RESIDUAL_LIMIT = 1e-10
"""Largest residual ratio of a design that is handed out; the usual one is 1e-16 to 1e-15."""

_SAME_CONDITION = 1e-13  # relative singular value below which two modes ask for the same thing on this grid
_FEASIBLE = 1e-11  # residual of the non-negative least-squares problem that counts as none
_SUPPORT_THRESHOLDS = (1e-9, 1e-13)  # amplitudes above one of these are taps of the optimiser's vertex
_SAME_OBJECTIVE = 1e-9  # of the squared duration
_SAME_DURATION = 0.02  # designs whose durations differ by less are equal, relative


def shortest_non_negative(modes: Sequence[Mode], period_s: float, max_duration_s: float = 0.25) -> Shaper:
    """Shortest shaper with non-negative impulses on a grid that cancels every mode exactly there.

    The number of periods is the smallest for which the conditions (sum 1, both parts of each mode's sum zero)
    have a non-negative solution. Among the solutions of that duration the one with the least second central
    moment, the contour cost, is taken: exactly, not only against a fixed centre. Modes that ask for the same
    thing on this grid (equal ones, or aliases of one another) count once. The taps of the optimiser are
    solved again in full precision and checked.

    Args:
        modes: Modes to cancel, at least one; one above the grid's Nyquist frequency is fine.
        period_s: Period of the grid in s, above 0.
        max_duration_s: Longest duration in s that is tried, above 0.

    Returns:
        The shaper: times are multiples of `period_s`, amplitudes above 0, ``residual_ratio`` of every mode at
        most 1e-10 (about 1e-16 as a rule).

    Raises:
        ArgumentError: No mode, or a period or duration that is not finite and positive.
        DesignError: No such shaper within `max_duration_s`; the message tells what the polynomial would be.

    Source: this project.
    """
    check_modes_and_times(modes, period_s=period_s, max_duration_s=max_duration_s)
    most = whole_periods(max_duration_s, period_s)
    # A solution stays one with further taps at zero.
    last = smallest_enough(lambda last: _non_negative_solution(modes, period_s, last) is not None, 1, most)
    while last is not None and last <= most:
        for vertex in _vertices(modes, period_s, last):
            conditions = exact_conditions(modes, period_s, last)
            for threshold in _SUPPORT_THRESHOLDS:
                shaper = polished(vertex, conditions, period_s, threshold, signed=False)
                if shaper is not None and max(shaper.residual_ratio(mode) for mode in modes) <= RESIDUAL_LIMIT:
                    return shaper
        last += 1
    raise DesignError(_none_exists(modes, period_s, max_duration_s))


def exact_conditions(
    modes: Sequence[Mode], period_s: float, last: int, multiplicities: Sequence[int] = ()
) -> tuple[FloatArray, FloatArray]:
    """Matrix and right-hand side of the equality conditions on the taps at 0, 1 ... `last` periods.

    The modes' rows (each mode's residual sum, which decay keeps at most 1) are replaced by an orthonormal
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
    """The smallest number that is enough, to a relative precision: growing, then halving; None: it exceeds `most`."""
    enough = min(most, start)
    while enough < most and not is_enough(enough):
        too_few, enough = enough, max(enough + 1, math.ceil(growth * enough))
    enough = min(enough, most)
    if enough <= too_few or not is_enough(enough):
        return None
    return halved(is_enough, too_few, enough, precision)


def halved(is_enough: Callable[[int], bool], too_few: int, enough: int, precision: float = 0.0) -> int:
    """The smallest number that is enough, by halving; to a relative precision it may exceed the smallest."""
    while enough - too_few > max(1, math.floor(precision * enough)):
        middle = (too_few + enough) // 2
        if is_enough(middle):
            enough = middle
        else:
            too_few = middle
    return enough


def refined(columns: FloatArray, right: FloatArray, taps: FloatArray) -> FloatArray:
    """Taps that meet ``columns @ taps == right`` to rounding, from such that nearly do."""
    for _ in range(3):  # the second removes what the first one's rounding left, the third nothing
        taps = taps + np.linalg.lstsq(columns, right - columns @ taps, rcond=1e-14)[0]
    return taps


def _non_negative_solution(modes: Sequence[Mode], period_s: float, last: int) -> FloatArray | None:
    """Taps at 0 ... `last` periods that satisfy every condition to rounding, by Lawson and Hanson's method, or None."""
    matrix, right = exact_conditions(modes, period_s, last)
    taps = non_negative_least_squares(matrix, right)
    if taps is None:  # it went round in circles: the linear program decides
        return Vertices(matrix, right)(np.zeros(last + 1))
    return taps if float(np.linalg.norm(matrix @ taps - right)) <= _FEASIBLE else None


class Vertices:
    """Vertices of the taps ``x >= 0`` with ``matrix @ x == right``, each of least cost."""

    def __init__(self, matrix: FloatArray, right: FloatArray) -> None:
        count = matrix.shape[1]
        self._program = LinearProgram(np.zeros(count), np.full(count, math.inf), (matrix, right))

    def __call__(self, cost: FloatArray) -> FloatArray | None:
        """The vertex that minimises ``cost @ x``; None: not found."""
        self._program.set_cost(cost)
        try:
            return self._program.solve()
        except DesignError:
            return None


def _vertices(modes: Sequence[Mode], period_s: float, last: int) -> Iterator[FloatArray]:
    """Solutions worth polishing, the one with the least second central moment first."""
    matrix, right = exact_conditions(modes, period_s, last)
    yield from lower_hull(Vertices(matrix, right), last)
    # a design at the edge of what is possible may lie within the linear program's tolerance
    taps = _non_negative_solution(modes, period_s, last)
    if taps is not None:
        yield taps


class _Corner(NamedTuple):
    """Taps at the lower edge of what their first two moments can be, and the slope of a line that supports it there."""

    taps: FloatArray
    mean: float
    second: float
    slope: float | None
    """None: the edge ends here, the line is vertical."""

    @property
    def variance(self) -> float:
        return self.second - self.mean**2


def lower_hull(
    cheapest: Callable[[FloatArray], FloatArray | None], last: int, tolerance: float = 0.0
) -> list[FloatArray]:
    """Taps among which the second central moment is least: corners of the lower edge of the first two moments.

    The second central moment is concave in the taps, so no convex program minimises it; but it is least at one of
    these corners, and each of them has the least of a linear cost. Stretches of the edge where the supporting lines
    of their ends prove that nothing better lies are left out.
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
        if _least_between(left, right) >= (1.0 - tolerance) * min(each.variance for each in found):
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


def _least_between(left: _Corner, right: _Corner) -> float:
    """Lower bound on the second central moment between two corners, from the lines that support the edge there."""
    if left.slope is None or right.slope is None or right.slope - left.slope <= _SAME_OBJECTIVE:
        return -math.inf
    rise = right.second - left.second + left.slope * left.mean - right.slope * right.mean
    mean = rise / (left.slope - right.slope)
    second = left.second + left.slope * (mean - left.mean)
    return min(left.variance, right.variance, second - mean**2)


def polished(
    taps: FloatArray, conditions: tuple[FloatArray, FloatArray], period_s: float, threshold: float, *, signed: bool
) -> Shaper | None:
    """Taps above a threshold, solved again to rounding; None if they then miss the sum 1 or change their sign."""
    matrix, right = conditions
    support = np.flatnonzero(np.abs(taps) > threshold)
    amplitudes = refined(matrix[:, support], right, taps[support])
    total = float(amplitudes.sum())
    if abs(total - 1.0) > RESIDUAL_LIMIT or not (signed or np.all(amplitudes > 0.0)):
        return None
    return Shaper(((support - support[0]) * period_s).tolist(), (amplitudes / total).tolist())


def _none_exists(modes: Sequence[Mode], period_s: float, max_duration_s: float) -> str:
    try:
        polynomial = grid_polynomial(modes, period_s)
        what_exists = f"the shortest polynomial lasts {ms(polynomial.duration_s)} with sum|a| {polynomial.abs_sum:.4g}"
    except ShapegcodeError as error:
        what_exists = f"nor is there a polynomial: {error}"
    return (
        f"no non-negative design within {ms(max_duration_s)} on a {ms(period_s)} grid for modes "
        f"{mode_names(modes)}; {what_exists}; try another period"
    )
