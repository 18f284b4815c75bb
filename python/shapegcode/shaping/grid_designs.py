"""Shaper designs on a sample grid that need an optimiser, and the choice of the block period.

A shaper survives being written as blocks only if its taps lie on the block grid and its zeros are exact there
(spec 2 and 4). The shortest exact design is a polynomial (:func:`shapegcode._core.grid_polynomial`), but its
taps may be wild; :func:`shortest_non_negative` spends a few more taps on a design that never reverses, and
:func:`choose_block_period` compares block periods, because they decide how long that takes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog, nnls

from shapegcode._core import ArgumentError, DesignError, Mode, ShapegcodeError, Shaper, grid_polynomial

__all__ = ["BlockPeriodCandidate", "BlockPeriodChoice", "choose_block_period", "shortest_non_negative"]

FloatArray = NDArray[np.float64]

RESIDUAL_LIMIT = 1e-10
"""Largest residual ratio of a design that is handed out; the usual one is 1e-16 to 1e-15."""

_SAME_CONDITION = 1e-13  # relative singular value below which two modes ask for the same thing on this grid
_FEASIBLE = 1e-11  # residual of the non-negative least-squares problem that counts as none
_SUPPORT_THRESHOLDS = (1e-9, 1e-13)  # amplitudes above one of these are taps of the optimiser's vertex
_SAME_OBJECTIVE = 1e-9  # of the squared duration
_SAME_DURATION = 0.02  # designs whose durations differ by less are equal, relative
_ON_GRID = 1e-9  # periods; forgives the rounding of a quotient


class BlockPeriodCandidate(NamedTuple):
    """One row of the comparison of block periods."""

    period_s: float
    """Block period in s, a whole multiple of the interpolation period."""
    shaper: Shaper | None
    """Shortest non-negative shaper on that grid, or None if there is none."""
    refusal: str
    """Why there is none; empty if there is one."""


class BlockPeriodChoice(NamedTuple):
    """The chosen block period, its shaper, and what it was chosen from."""

    period_s: float
    """Chosen block period in s."""
    shaper: Shaper
    """Shortest non-negative shaper on its grid."""
    candidates: tuple[BlockPeriodCandidate, ...]
    """Every period that was tried, ascending, the chosen one among them."""


def shortest_non_negative(modes: Sequence[Mode], period_s: float, max_duration_s: float = 0.25) -> Shaper:
    """Shortest shaper with non-negative taps on a grid that cancels every mode exactly there.

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

    Source: this project (spec 2, grid-exact shapers).
    """
    _check_modes_and_times(modes, period_s=period_s, max_duration_s=max_duration_s)
    most = math.floor(max_duration_s / period_s + _ON_GRID)
    last = _smallest_feasible(modes, period_s, most)
    while last is not None and last <= most:
        for vertex in _vertices(modes, period_s, last):
            shaper = _polished(vertex, modes, period_s)
            if shaper is not None:
                return shaper
        last += 1
    raise DesignError(_none_exists(modes, period_s, max_duration_s))


def choose_block_period(
    modes: Sequence[Mode],
    interpolation_period_s: float,
    block_time_s: float,
    max_block_period_s: float = 0.02,
    max_duration_s: float = 0.25,
) -> BlockPeriodChoice:
    """Block period on which the shortest non-negative shaper is shortest.

    Every whole multiple of the interpolation period from the controller's block time up to
    `max_block_period_s` is tried. The shortest duration wins; among durations within 2 % of it the longest
    period does, because it writes the fewest blocks.

    Args:
        modes: Modes to cancel, at least one.
        interpolation_period_s: Interpolation period of the controller in s, above 0.
        block_time_s: Time in s that the controller needs for a block, at least 0; no block is shorter.
        max_block_period_s: Longest block period in s; the path is sampled once per block.
        max_duration_s: Longest duration in s of a shaper.

    Returns:
        The period, its shaper, and the table of all candidates for the report.

    Raises:
        ArgumentError: No mode, a time outside its range, or no multiple of the interpolation period in the
        range. DesignError: No candidate has a non-negative shaper within `max_duration_s`.

    Source: this project (spec 2: the block period is a design choice; spec 4).
    """
    _check_modes_and_times(
        modes,
        interpolation_period_s=interpolation_period_s,
        max_block_period_s=max_block_period_s,
        max_duration_s=max_duration_s,
    )
    if not (math.isfinite(block_time_s) and block_time_s >= 0.0):
        raise ArgumentError(f"block_time_s is {block_time_s} s: it must be finite and at least 0")
    fewest = max(1, math.ceil(block_time_s / interpolation_period_s - _ON_GRID))
    most = math.floor(max_block_period_s / interpolation_period_s + _ON_GRID)
    if fewest > most:
        raise ArgumentError(
            f"no block period between the block time of {_ms(block_time_s)} and the limit of "
            f"{_ms(max_block_period_s)} is a multiple of the interpolation period of "
            f"{_ms(interpolation_period_s)}"
        )
    candidates = tuple(
        _candidate(modes, multiple * interpolation_period_s, max_duration_s) for multiple in range(fewest, most + 1)
    )
    designs = [(each.period_s, each.shaper) for each in candidates if each.shaper is not None]
    if not designs:
        raise DesignError(
            f"no block period from {_ms(candidates[0].period_s)} to {_ms(candidates[-1].period_s)} in steps "
            f"of {_ms(interpolation_period_s)} has a non-negative shaper within {_ms(max_duration_s)} for "
            f"modes {_names(modes)}; the first says: {candidates[0].refusal}"
        )
    limit = (1.0 + _SAME_DURATION) * min(shaper.duration_s for _, shaper in designs)
    period_s, shaper = max((each for each in designs if each[1].duration_s <= limit), key=lambda each: each[0])
    return BlockPeriodChoice(period_s, shaper, candidates)


def _candidate(modes: Sequence[Mode], period_s: float, max_duration_s: float) -> BlockPeriodCandidate:
    try:
        return BlockPeriodCandidate(period_s, shortest_non_negative(modes, period_s, max_duration_s), "")
    except DesignError as error:
        return BlockPeriodCandidate(period_s, None, str(error))


def _check_modes_and_times(modes: Sequence[Mode], **times_s: float) -> None:
    if not modes:
        raise ArgumentError("a shaper needs at least one mode: 0 given")
    for name, value in times_s.items():
        if not (math.isfinite(value) and value > 0.0):
            raise ArgumentError(f"{name} is {value} s: it must be finite and above 0")


def _conditions(modes: Sequence[Mode], period_s: float, last: int) -> tuple[FloatArray, FloatArray]:
    """Matrix and right-hand side of the equality conditions on the taps at 0, 1 ... `last` periods.

    The modes' rows (each mode's residual sum, which decay keeps at most 1) are replaced by an orthonormal
    basis of their span: near-equal modes then cost no precision, and equal ones no row.
    """
    steps = np.arange(last + 1)
    poles = np.array([mode.pole for mode in modes])
    decay = np.exp(np.outer(poles.real * period_s, last - steps))
    terms = decay * np.exp(1j * np.outer(poles.imag, steps * period_s))
    _, strength, basis = np.linalg.svd(np.vstack([terms.real, terms.imag]), full_matrices=False)
    kept = basis[strength > _SAME_CONDITION * strength[0]] * math.sqrt(last + 1)
    matrix = np.vstack([kept, np.ones(last + 1)])
    return matrix, np.eye(len(matrix))[-1]


def _non_negative_solution(modes: Sequence[Mode], period_s: float, last: int) -> FloatArray | None:
    """Taps at 0 ... `last` periods that satisfy every condition, or None.

    Lawson and Hanson's active-set method answers to rounding, where a linear program answers to its
    tolerance.
    """
    matrix, right = _conditions(modes, period_s, last)
    try:
        taps, residual = nnls(matrix, right)
    except RuntimeError:  # it cycled: the linear program decides
        return _vertex(matrix, right, np.zeros(last + 1))
    return taps if residual <= _FEASIBLE else None


def _smallest_feasible(modes: Sequence[Mode], period_s: float, most: int) -> int | None:
    """Smallest number of periods that has a non-negative solution, or None if it exceeds `most`.

    A solution stays one with further taps at zero, so doubling and then halving finds it.
    """
    too_few, enough = 0, 1
    while enough < most and _non_negative_solution(modes, period_s, enough) is None:
        too_few, enough = enough, 2 * enough
    enough = min(enough, most)
    if enough <= too_few or _non_negative_solution(modes, period_s, enough) is None:
        return None
    while enough - too_few > 1:
        middle = (too_few + enough) // 2
        if _non_negative_solution(modes, period_s, middle) is None:
            too_few = middle
        else:
            enough = middle
    return enough


def _vertex(matrix: FloatArray, right: FloatArray, cost: FloatArray) -> FloatArray | None:
    """Vertex of the feasible taps that minimises `cost`, or None if the solver finds none."""
    result = linprog(
        cost,
        A_eq=matrix,
        b_eq=right,
        bounds=(0.0, None),
        method="highs-ds",
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    return np.asarray(result.x, dtype=np.float64) if result.status == 0 else None


def _vertices(modes: Sequence[Mode], period_s: float, last: int) -> Iterator[FloatArray]:
    """Solutions worth polishing, the one with the least second central moment first."""
    matrix, right = _conditions(modes, period_s, last)
    time = np.arange(last + 1) / last
    moments = np.vstack([time, time**2])

    def variance(taps: FloatArray) -> float:
        first, second = moments @ taps
        return float(second - first**2)

    yield from sorted(_lower_hull(matrix, right, moments), key=variance)
    # a design at the edge of what is possible may lie within the linear program's tolerance
    taps = _non_negative_solution(modes, period_s, last)
    if taps is not None:
        yield taps


def _lower_hull(matrix: FloatArray, right: FloatArray, moments: FloatArray) -> list[FloatArray]:
    """Vertices of the lower edge of what the first two moments of the feasible taps can be.

    The second central moment is concave in the taps, so no single linear program minimises it; but it is
    least at one of these vertices, and each of them is a linear program.
    """
    leftmost = _vertex(matrix, right, moments[0])
    rightmost = _vertex(matrix, right, -moments[0])
    if leftmost is None or rightmost is None:
        return []
    found = [leftmost, rightmost]
    edges = [(leftmost, rightmost)]
    while edges:
        left, right_end = edges.pop()
        rise = moments @ (right_end - left)
        slope = rise[1] / rise[0] if rise[0] > _SAME_OBJECTIVE else 2.0 * float(moments[0] @ left)
        cost = moments[1] - slope * moments[0]
        below = _vertex(matrix, right, cost)
        if below is None or cost @ below >= min(cost @ left, cost @ right_end) - _SAME_OBJECTIVE:
            continue
        found.append(below)
        if rise[0] > _SAME_OBJECTIVE:
            edges += [(left, below), (below, right_end)]
    return found


def _polished(vertex: FloatArray, modes: Sequence[Mode], period_s: float) -> Shaper | None:
    """The vertex solved again to rounding on its own taps, or None if that is no non-negative design."""
    matrix, right = _conditions(modes, period_s, len(vertex) - 1)
    for threshold in _SUPPORT_THRESHOLDS:
        support = np.flatnonzero(vertex > threshold)
        columns = matrix[:, support]
        taps = vertex[support]
        for _ in range(3):  # the second removes what the first one's rounding left, the third nothing
            taps = taps + np.linalg.lstsq(columns, right - columns @ taps, rcond=1e-14)[0]
        if not (np.all(taps > 0.0) and abs(taps.sum() - 1.0) <= RESIDUAL_LIMIT):
            continue
        shaper = Shaper(((support - support[0]) * period_s).tolist(), (taps / taps.sum()).tolist())
        if max(shaper.residual_ratio(mode) for mode in modes) <= RESIDUAL_LIMIT:
            return shaper
    return None


def _none_exists(modes: Sequence[Mode], period_s: float, max_duration_s: float) -> str:
    try:
        polynomial = grid_polynomial(modes, period_s)
        what_exists = f"the shortest polynomial lasts {_ms(polynomial.duration_s)} with sum|a| {polynomial.abs_sum:.4g}"
    except ShapegcodeError as error:
        what_exists = f"nor is there a polynomial: {error}"
    return (
        f"no non-negative design within {_ms(max_duration_s)} on a {_ms(period_s)} grid for modes "
        f"{_names(modes)}; {what_exists}; try another period"
    )


def _ms(time_s: float) -> str:
    return f"{time_s * 1e3:.6g} ms"


def _names(modes: Sequence[Mode]) -> str:
    return ", ".join(f"{mode.frequency_hz:g} Hz (zeta {mode.damping_ratio:g})" for mode in modes)
