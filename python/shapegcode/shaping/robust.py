"""Robust shapers on a sample grid: the smallest worst-case residual over bands, and the shortest one below a limit.

The optimum is proven by `cutting_planes` and a sweep; a mode without a band (uncertainty 0) is cancelled exactly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from shapegcode._core import ArgumentError, DesignError, Mode, Shaper
from shapegcode.io.units import FloatArray
from shapegcode.shaping.bands import (
    VIBRATION_LIMIT,
    ModeBand,
    band_names,
    check_modes_and_times,
    check_times,
    mode_names,
    ms,
    proven_worst,
    whole_periods,
)
from shapegcode.shaping.cutting_planes import NO_RESIDUAL, SAME_RESIDUAL, Bounds, CutPool, TapProblem
from shapegcode.shaping.grid_designs import (
    RESIDUAL_LIMIT,
    exact_conditions,
    lower_hull,
    polished,
    shortest_non_negative,
    smallest_enough,
)

_LONGER = 4  # for a message of failure a sufficient duration is sought up to this multiple of the longest duration
_OTHER_PERIODS = (0.5, 0.75, 1.25, 1.5, 2.0)  # other periods tried for that message, relative to the given one
_HINT_PRECISION = 0.05  # relative precision of the sufficient duration
_HINT_PERIODS = 500  # longest grid searched for that message, periods
_NO_TAP = 1e-9  # smaller amplitudes are the solver's round-off
_GROWTH = 1.4  # growth factor of the number of periods in the search
_WHOLE = 1e-3  # tolerance of a whole number of cycles per period
# If the optimum for a damped mode ends with periods without taps, a tap this large marks their end.
_LAST_TAP = 1e-3
_SAME_VARIANCE = 5e-3  # relative


def least_worst(
    bands: Sequence[ModeBand],
    period_s: float,
    duration_s: float,
    *,
    non_negative: bool = True,
    max_abs_sum: float = 10.0,
    zeros_at_nominal: bool = False,
) -> RobustDesign:
    """Design taps on a grid with the smallest worst residual over the bands, for a given duration.

    The optimum is proven to 0.1 %: `worst_residual` is at most 0.1 % above `min_possible` (a residual below 1e-6
    counts as zero). There is one exception: with a damped mode the optimum may have no taps at the end of the duration.
    As the residual counts from the last tap on, the shaper is then shorter, or gets a last tap of 0.001.

    Source: this project.
    """
    task = Task.checked(bands, period_s, non_negative, max_abs_sum, zeros_at_nominal)
    check_times(duration_s=duration_s)
    if not task.wide:
        raise ArgumentError(
            f"no mode states a band ({band_names(bands)}): nothing to minimise; use the shortest exact design"
        )
    last = task.periods(duration_s)
    found = best_within(task, last)
    if found is None:
        reason = unreachable(task)
        raise DesignError(no_exact(task, last * period_s) + (f"; {reason}" if reason else ""))
    return found


def minimax_robust(
    bands: Sequence[ModeBand],
    period_s: float,
    *,
    vibration_limit: float = VIBRATION_LIMIT,
    max_duration_s: float = 0.25,
    non_negative: bool = True,
    max_abs_sum: float = 10.0,
    zeros_at_nominal: bool = False,
    mirrored: bool = False,
    hints: bool = True,
) -> RobustDesign:
    """Design the shortest taps on a grid with at most a given residual ratio within the bands.

    The number of periods is the smallest with which a design keeps the limit (to 0.1 %) in all bands. Of the designs of
    that duration that keep it, the one with the least second central moment, the contour cost, is chosen (to 0.5 %);
    if negative impulses are allowed, the one with the least sum of magnitudes.

    Source: this project.
    """
    task = Task.checked(bands, period_s, non_negative, max_abs_sum, zeros_at_nominal, mirrored)
    check_times(max_duration_s=max_duration_s)
    if not 0.0 < vibration_limit < 1.0:
        raise ArgumentError(f"vibration_limit is {vibration_limit}: it must be above 0 and below 1")
    found = shortest_below(task, vibration_limit, max_duration_s)
    if found is None:
        text = refusal(task, vibration_limit, max_duration_s)
        raise DesignError(f"{text}{_hints(task, vibration_limit, max_duration_s)}" if hints else text)
    return found


def _hints(task: Task, limit: float, max_duration_s: float) -> str:
    """Hints for a refusal: what the longest allowed duration reaches; a sufficient duration; another period."""
    text = ""
    if not unreachable(task):
        most = task.periods(max_duration_s)
        reached = best_within(task, most) if task.wide and most else None
        if reached is not None:
            text += f"; the longest allowed shaper reaches {_percent(reached.worst_residual)}"
        else:
            text += f"; {no_exact(task, most * task.period_s)}"
        longest = min(_LONGER * most, max(_HINT_PERIODS, most))
        enough = smallest_below(task, limit, longest, too_few=most, precision=_HINT_PRECISION)
        text += f"; {ms(enough * task.period_s)} suffices" if enough else f"; {ms(longest * task.period_s)} do not"
    return f"{text}; {_other_period(task, limit, max_duration_s)}"


def _other_period(task: Task, limit: float, max_duration_s: float) -> str:
    shortest_s, least = math.inf, math.inf
    shortest_text, min_text = "", "no other period from half to twice as long has a design within that duration"
    for share in _OTHER_PERIODS:
        other = task.at_period(share * task.period_s)
        most = min(other.periods(max_duration_s), _HINT_PERIODS)
        if not most or unreachable(other):
            continue
        enough = smallest_below(other, limit, most)
        if enough is not None:
            if enough * other.period_s < shortest_s:
                shortest_s = enough * other.period_s
                shortest_text = f"on a period of {ms(other.period_s)} a design of {ms(shortest_s)} would suffice"
            continue
        found = best_within(other, most)
        if found is not None and found.worst_residual < least:
            least = found.worst_residual
            min_text = f"a period of {ms(other.period_s)} reaches {_percent(least)} within that duration"
    return shortest_text or min_text


def _percent(ratio: float) -> str:
    return f"{100.0 * ratio:.3g} %"


@dataclass(frozen=True)
class RobustDesign:
    """A shaper on a grid, its worst residual, and a proven lower bound."""

    shaper: Shaper  # the taps; times are multiples of `period_s`
    period_s: float  # period of the grid, s
    worst_residual: float  # largest residual ratio over the bands, proven
    min_possible: float  # no design of this duration or a shorter one has a smaller worst residual


@dataclass(frozen=True)
class Task:
    """Design task for any duration."""

    bands: tuple[ModeBand, ...]  # modes with their bands; one without a band is cancelled exactly
    period_s: float  # of the grid, s
    max_abs_sum: float | None  # largest sum of the taps' magnitudes; None: no tap is negative
    zeros_at_nominal: bool  # every mode is cancelled exactly at its nominal frequency
    pool: CutPool  # planes found so far
    mirrored: bool = False  # the taps are symmetric in time

    @classmethod
    def checked(
        cls,
        bands: Sequence[ModeBand],
        period_s: float,
        non_negative: bool = True,
        max_abs_sum: float = 1.0,
        zeros_at_nominal: bool = False,
        mirrored: bool = False,
    ) -> Task:
        """Check the values, and create the task."""
        check_modes_and_times(bands, period_s=period_s)
        if not (math.isfinite(max_abs_sum) and max_abs_sum >= 1.0):
            raise ArgumentError(f"max_abs_sum is {max_abs_sum}: must be finite and at least 1, the sum of the impulses")
        pool = CutPool.around([band for band in bands if band.uncertainty])
        return cls(tuple(bands), period_s, None if non_negative else max_abs_sum, zeros_at_nominal, pool, mirrored)

    @property
    def wide(self) -> list[ModeBand]:
        """Modes with a residual limit over a band."""
        return [band for band in self.bands if band.uncertainty]

    @property
    def exact(self) -> list[Mode]:
        """Modes that are cancelled exactly."""
        return [band.mode for band in self.bands if self.zeros_at_nominal or not band.uncertainty]

    def periods(self, duration_s: float) -> int:
        """Number of whole periods within a duration."""
        return whole_periods(duration_s, self.period_s)

    def conditions(self, last: int) -> tuple[FloatArray, FloatArray]:
        """Matrix and right-hand side of the equality conditions on the taps at 0 ... `last` periods."""
        matrix, right = exact_conditions(self.exact, self.period_s, last)
        if not self.mirrored:
            return matrix, right
        pairs = (np.eye(last + 1) - np.eye(last + 1)[::-1])[: (last + 1) // 2]
        return np.vstack([matrix, pairs]), np.append(right, np.zeros(len(pairs)))

    def problem(self, last: int, last_tap: float = 0.0) -> TapProblem:
        """The taps at 0 ... `last` periods, the last one at least `last_tap`."""
        return TapProblem(self.wide, self.period_s, last, self.conditions(last), self.max_abs_sum, self.pool, last_tap)

    def at_period(self, period_s: float) -> Task:
        """The same task on another grid."""
        return replace(self, period_s=period_s, pool=CutPool.around(self.wide))

    def finished(self, taps: FloatArray, lower: float) -> RobustDesign | None:
        """Remove round-off, re-solve the zeros to full precision, and evaluate; None if the taps become invalid."""
        if self.mirrored:
            taps = 0.5 * (taps + taps[::-1])
        largest = None if self.max_abs_sum is None else math.inf
        shaper = polished(taps, self.conditions(len(taps) - 1), self.period_s, _NO_TAP, largest)
        if shaper is None or any(shaper.residual_ratio(mode) > RESIDUAL_LIMIT * shaper.abs_sum for mode in self.exact):
            return None
        worst = proven_worst(shaper, self.bands)
        return RobustDesign(shaper, self.period_s, worst, min(lower, worst))


def shortest_below(task: Task, limit: float, max_duration_s: float, *, min_cost: bool = True) -> RobustDesign | None:
    """Shortest design with a worst residual below the limit, of least contour cost if requested; else None."""
    most = task.periods(max_duration_s)
    if not task.wide and task.max_abs_sum is None and not task.mirrored:
        with suppress(DesignError):
            shaper = shortest_non_negative(task.exact, task.period_s, max_duration_s)
            return RobustDesign(shaper, task.period_s, proven_worst(shaper, task.bands), 0.0)
        return None
    if unreachable(task):
        return None
    last = smallest_below(task, limit, most)
    while last is not None and last <= most:
        found = _within(task, last, limit, min_cost)
        if found is not None:
            return found
        last += 1  # the taps became invalid in full precision
    return None


def best_within(task: Task, last: int) -> RobustDesign | None:
    """Minimise the worst residual within `last` periods; None if the exact zeros have no solution."""
    bounds = task.problem(last).least_worst()
    if bounds is None:
        return None
    found = task.finished(bounds.taps, bounds.lower)
    if found is None:
        raise DesignError(
            f"the design of {ms(last * task.period_s)} on a {ms(task.period_s)} grid becomes invalid when "
            f"solved in full precision for modes {band_names(task.bands)}; try another period"
        )
    reached = max((1.0 + SAME_RESIDUAL) * bounds.upper, NO_RESIDUAL)
    if found.worst_residual > reached:
        # The optimum ends with periods without taps, and the residual is taken from the last tap.
        last = smallest_below(task, reached, last) or last
        for last_tap in (0.0, _LAST_TAP):
            ended = task.problem(last, last_tap).least_worst()
            other = None if ended is None else task.finished(ended.taps, bounds.lower)
            if other is not None and other.worst_residual < found.worst_residual:
                found = other
    return found


def _below(task: Task, last: int, limit: float) -> Bounds | None:
    # Symmetric taps with a zero added at each end are symmetric, but two periods longer: so one less is tried too.
    for periods in (last, last - 1) if task.mirrored and last else (last,):
        bounds = task.problem(periods).least_worst(limit)
        if bounds is not None and bounds.upper <= limit:
            return bounds
    return None


def smallest_below(task: Task, limit: float, most: int, *, too_few: int = 0, precision: float = 0.0) -> int | None:
    """Smallest number of periods of a design below the limit, to a relative precision; None if it exceeds `most`."""
    # A design stays valid with zero taps added. The search starts near the duration of the convolved ZV.
    start = max(1.0, sum(0.5 / band.mode.frequency_hz for band in task.bands) / task.period_s, _GROWTH * too_few)
    return smallest_enough(
        lambda last: _below(task, last, limit) is not None, math.ceil(start), most, too_few, growth=_GROWTH,
        precision=precision,
    )  # fmt: skip


def _within(task: Task, last: int, limit: float, min_cost: bool) -> RobustDesign | None:
    """A design of `last` periods below the limit, with the least contour cost if requested; None if none is valid."""
    for last_tap in (0.0, _LAST_TAP):
        problem = task.problem(last, last_tap)
        bounds = problem.least_worst(limit)
        plain = None if bounds is None else task.finished(bounds.taps, bounds.lower)
        if plain is not None and plain.worst_residual <= limit:
            break
    else:
        return None
    inner = (1.0 - 0.4 * SAME_RESIDUAL) * limit  # margin for the gap of the planes and the proof
    candidates = []
    if min_cost and task.max_abs_sum is None:
        candidates = lower_hull(lambda cost: problem.cheapest(cost, inner), last, _SAME_VARIANCE)
    elif min_cost:
        least = problem.cheapest(np.ones(last + 1), inner)
        candidates = [] if least is None else [least]
    for taps in candidates:
        found = task.finished(taps, plain.min_possible)
        if found is not None and found.worst_residual <= limit:
            return found
    return plain


def no_exact(task: Task, duration_s: float) -> str:
    """Message: no design up to this duration cancels the modes without a band."""
    taps = "non-negative impulses" if task.max_abs_sum is None else f"impulses with sum|a| up to {task.max_abs_sum:g}"
    if task.mirrored:
        taps = f"mirrored {taps}"
    return f"{taps} up to {ms(duration_s)} on a {ms(task.period_s)} grid do not cancel {mode_names(task.exact)} exactly"


def refusal(task: Task, limit: float, max_duration_s: float) -> str:
    """Message: no design is below the limit, with the reason if known."""
    reason = unreachable(task)
    if not task.wide:
        return no_exact(task, max_duration_s) + (f"; {reason}" if reason else "")
    return (
        f"no design within {ms(max_duration_s)} on a {ms(task.period_s)} grid keeps below {100.0 * limit:.3g} % for "
        f"{band_names(task.bands)}" + (f"; {reason}" if reason else "")
    )


def unreachable(task: Task) -> str:
    """Message: a frequency that no non-negative shaper of this grid can reduce; empty if none.

    At a frequency with a whole number of cycles per period all taps add in phase: a shaper then reduces vibration only
    because the vibration decays during the shaper.
    """
    if task.max_abs_sum is not None:
        return ""
    for band in task.bands:
        turns_per_hz = math.sqrt(1.0 - band.mode.damping_ratio**2) * task.period_s
        low, high = (band.mode.frequency_hz * (1.0 + side * band.uncertainty) * turns_per_hz for side in (-1.0, 1.0))
        turns = max(1, math.ceil(low - _WHOLE))
        if turns <= high + _WHOLE:
            cycles = "one cycle" if turns == 1 else f"{turns} cycles"
            return (
                f"{band} Hz completes {cycles} per period of {ms(task.period_s)} at {turns / turns_per_hz:.5g} Hz, "
                "where all impulses add up (z close to +1)"
            )
    return ""
