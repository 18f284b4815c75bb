"""The choice of the block period: it decides how long a shaper on its grid must be.

Candidates are the multiples of the controller's interpolation period: the shortest exact designs are compared, or the
robust ones where modes state a band.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from shapegcode._core import ArgumentError, DesignError, Mode, Shaper
from shapegcode.shaping.bands import ON_GRID, ModeBand, band_names, check_modes_and_times, ms, whole_periods
from shapegcode.shaping.grid_designs import shortest_non_negative
from shapegcode.shaping.ranking import SAME
from shapegcode.shaping.robust import (
    VIBRATION_LIMIT,
    RobustDesign,
    Task,
    best_within,
    refusal,
    shortest_below,
    unreachable,
)

if TYPE_CHECKING:
    from shapegcode.machine import Machine

_SAME = 0.02  # designs whose durations (or worst residuals) differ by less are equal, relative
_ASSUMED_TICK_S = 0.001  # interpolation period where no machine states one
_LONGEST_BLOCK_PERIOD_S = 0.02
_PERIODS_COMPARED = 3
_FINEST_SHARE = 1.0 / 32.0  # of the fastest mode's period: a finer grid is as good as continuous times
_WHOLE = 1e-6  # interpolation periods
_ROUNDING = 1e-9  # relative


@dataclass(frozen=True)
class BlockPeriodCandidate:
    """One row of the comparison of block periods."""

    period_s: float  # block period, s, a whole multiple of the interpolation period
    shaper: Shaper | None  # best on that grid; None: there is none
    refusal: str = ""  # why there is none; empty if there is one
    # largest residual ratio over the modes' bands, proven; None: no shaper, or no mode states a band
    worst_residual: float | None = None
    note: str = ""  # a sentence for the report where the shaper leaves more than the vibration limit; else empty


@dataclass(frozen=True)
class BlockPeriodChoice:
    """The chosen block period, its shaper, and what it was chosen from."""

    period_s: float  # block period, s
    shaper: Shaper  # best on its grid
    candidates: tuple[BlockPeriodCandidate, ...]  # every period that was tried, ascending, the chosen one among them
    worst_residual: float | None  # largest residual ratio over the modes' bands, proven; None: no mode states a band
    note: str  # a sentence for the report where the shaper leaves more than the vibration limit; else empty


def choose_block_period(
    modes: Sequence[Mode | ModeBand],
    interpolation_period_s: float,
    block_time_s: float,
    max_block_period_s: float = 0.02,
    max_duration_s: float = 0.25,
    vibration_limit: float = VIBRATION_LIMIT,
) -> BlockPeriodChoice:
    """Block period on which the shortest non-negative shaper is shortest.

    Every whole multiple of the interpolation period from the controller's block time up to `max_block_period_s` is
    tried. The shortest duration wins; among durations within 2 % of it the longest period does, because it writes the
    fewest blocks.

    A mode without a band is cancelled exactly; where any states one, the shaper leaves at most `vibration_limit`
    anywhere in the bands. If no period has such a design within `max_duration_s`, the one with the least worst residual
    of that duration is taken, and `note` of the result says so; among worst residuals within 2 % of each other the
    longest period wins.

    Args:
        modes: to cancel, with or without bands, at least one.
        interpolation_period_s: of the controller, s, above 0.
        block_time_s: what the controller needs for a block, s, at least 0; no block is shorter.
        max_block_period_s: longest block period, s; the path is sampled once per block.
        max_duration_s: longest shaper, s.
        vibration_limit: largest residual ratio over the bands, above 0 and below 1.

    Returns:
        The period, its shaper, the worst residual over bands, and all candidates. Where modes state bands the contour
        cost is made least for the chosen one only.

    Raises:
        ArgumentError: no mode, a value outside its range, or no multiple of the interpolation period in the range.
        DesignError: no candidate has a design: modes without a band cannot be cancelled within `max_duration_s`, or
            every grid has a frequency of the bands that completes a whole number of cycles per period.

    Source: this project.
    """
    bands = [each if isinstance(each, ModeBand) else ModeBand(each) for each in modes]
    periods_s = _periods(bands, interpolation_period_s, block_time_s, max_block_period_s, max_duration_s)
    if not any(band.uncertainty for band in bands):
        candidates = tuple(_exact_candidate(bands, period_s, max_duration_s) for period_s in periods_s)
        if any(each.shaper is not None for each in candidates):
            return _shortest(candidates)
    else:
        _check_limit(vibration_limit)
        rough = tuple(_below_candidate(bands, each, max_duration_s, vibration_limit) for each in periods_s)
        if any(each.shaper is not None for each in rough):
            period_s = _shortest(rough).period_s
            best = _below_candidate(bands, period_s, max_duration_s, vibration_limit, least_cost=True)
            return _shortest(tuple(best if each.period_s == period_s else each for each in rough))
        candidates = tuple(_fallback(each, bands, max_duration_s, vibration_limit) for each in rough)
        found = [(each, each.worst_residual) for each in candidates if each.worst_residual is not None]
        if found:
            least = (1.0 + _SAME) * min(worst for _, worst in found)
            near = (each for each, worst in found if worst <= least)
            return _choice(max(near, key=lambda each: each.period_s), candidates)
    raise DesignError(
        f"no block period from {ms(periods_s[0])} to {ms(periods_s[-1])} in steps of {ms(interpolation_period_s)} has "
        f"a shaper without negative impulses within {ms(max_duration_s)} for {band_names(bands)}; the first says: "
        f"{candidates[0].refusal}"
    )


def robust_candidate(
    bands: Sequence[ModeBand],
    period_s: float,
    max_duration_s: float = 0.25,
    vibration_limit: float = VIBRATION_LIMIT,
) -> BlockPeriodCandidate:
    """What :func:`choose_block_period` would take on one given period.

    Source: this project.
    """
    check_modes_and_times(bands, period_s=period_s, max_duration_s=max_duration_s)
    if not any(band.uncertainty for band in bands):
        shaper = shortest_non_negative([band.mode for band in bands], period_s, max_duration_s)
        return BlockPeriodCandidate(period_s, shaper)
    _check_limit(vibration_limit)
    candidate = _below_candidate(bands, period_s, max_duration_s, vibration_limit, least_cost=True)
    if candidate.shaper is None:
        candidate = _fallback(candidate, bands, max_duration_s, vibration_limit)
    if candidate.shaper is None:
        raise DesignError(candidate.refusal)
    return candidate


def _periods(
    bands: Sequence[ModeBand],
    interpolation_period_s: float,
    block_time_s: float,
    max_block_period_s: float,
    max_duration_s: float,
) -> list[float]:
    """The block periods to try, ascending."""
    check_modes_and_times(
        bands,
        interpolation_period_s=interpolation_period_s,
        max_block_period_s=max_block_period_s,
        max_duration_s=max_duration_s,
    )
    if not (math.isfinite(block_time_s) and block_time_s >= 0.0):
        raise ArgumentError(f"block_time_s is {block_time_s} s: it must be finite and at least 0")
    fewest = max(1, math.ceil(block_time_s / interpolation_period_s - ON_GRID))
    most = whole_periods(max_block_period_s, interpolation_period_s)
    if fewest > most:
        raise ArgumentError(
            f"no block period between the block time of {ms(block_time_s)} and the limit of "
            f"{ms(max_block_period_s)} is a multiple of the interpolation period of {ms(interpolation_period_s)}"
        )
    return [multiple * interpolation_period_s for multiple in range(fewest, most + 1)]


def _check_limit(vibration_limit: float) -> None:
    if not 0.0 < vibration_limit < 1.0:
        raise ArgumentError(f"vibration_limit is {vibration_limit}: it must be above 0 and below 1")


def _shortest(candidates: tuple[BlockPeriodCandidate, ...]) -> BlockPeriodChoice:
    durations_s = [each.shaper.duration_s for each in candidates if each.shaper is not None]
    limit_s = (1.0 + _SAME) * min(durations_s)
    short = [each for each in candidates if each.shaper is not None and each.shaper.duration_s <= limit_s]
    return _choice(max(short, key=lambda each: each.period_s), candidates)


def _choice(chosen: BlockPeriodCandidate, candidates: tuple[BlockPeriodCandidate, ...]) -> BlockPeriodChoice:
    assert chosen.shaper is not None
    return BlockPeriodChoice(chosen.period_s, chosen.shaper, candidates, chosen.worst_residual, chosen.note)


def _exact_candidate(bands: Sequence[ModeBand], period_s: float, max_duration_s: float) -> BlockPeriodCandidate:
    try:
        shaper = shortest_non_negative([band.mode for band in bands], period_s, max_duration_s)
        return BlockPeriodCandidate(period_s, shaper)
    except DesignError as error:
        return BlockPeriodCandidate(period_s, None, str(error))


def _task(bands: Sequence[ModeBand], period_s: float) -> Task:
    return Task.checked(bands, period_s, non_negative=True, max_abs_sum=1.0, zeros_at_nominal=False)


def _below_candidate(
    bands: Sequence[ModeBand], period_s: float, max_duration_s: float, limit: float, *, least_cost: bool = False
) -> BlockPeriodCandidate:
    """The shortest design below the limit, without the search for hints that a refusal by itself would make."""
    task = _task(bands, period_s)
    found = shortest_below(task, limit, max_duration_s, least_cost=least_cost)
    if found is not None:
        return _candidate(found)
    return BlockPeriodCandidate(period_s, None, refusal(task, limit, max_duration_s))


def _fallback(
    refused: BlockPeriodCandidate, bands: Sequence[ModeBand], max_duration_s: float, limit: float
) -> BlockPeriodCandidate:
    """The least worst design of the longest duration, and the sentence that says so; else the refusal as it is."""
    task = _task(bands, refused.period_s)
    last = task.periods(max_duration_s)
    found = best_within(task, last) if last and not unreachable(task) else None
    if found is None:
        return refused
    note = (
        f"no shaper within {ms(max_duration_s)} keeps {band_names(bands)} below {100.0 * limit:.3g} % of the vibration "
        f"on a {ms(refused.period_s)} grid: the one with the least worst residual, {100.0 * found.worst_residual:.3g} "
        "%, is used"
    )
    return replace(_candidate(found), note=note)


def _candidate(found: RobustDesign) -> BlockPeriodCandidate:
    return BlockPeriodCandidate(found.period_s, found.shaper, worst_residual=found.worst_residual)


def check_block_period(period_s: float, machine: Machine) -> None:
    """Refuse a block period that the machine's controller cannot play."""
    if not (math.isfinite(period_s) and period_s > 0.0):
        raise ArgumentError(f"block period is {period_s} s, must be finite and above 0")
    tick_s, block_time_s = machine.controller.interpolation_period_s, machine.controller.block_time_s
    ticks = period_s / tick_s
    if round(ticks) < 1 or abs(ticks - round(ticks)) > _WHOLE:
        raise ArgumentError(
            f"block period {period_s * 1e3:g} ms is no whole multiple of the interpolation period {tick_s * 1e3:g} ms"
        )
    if period_s < block_time_s * (1.0 - _ROUNDING):
        raise ArgumentError(
            f"block period {period_s * 1e3:g} ms is below the block time {block_time_s * 1e3:g} ms "
            "(controller.block_time_s)"
        )


def candidate_periods(
    bands: Sequence[ModeBand], machine: Machine | None, max_duration_s: float, vibration_limit: float = 0.05
) -> list[float]:
    """The block periods worth comparing, ascending, s: those on which a non-negative shaper is shortest."""
    if machine is not None and machine.emission.block_period_s is not None:
        return [machine.emission.block_period_s]
    if machine is not None:
        tick_s, least_s = machine.controller.interpolation_period_s, machine.controller.block_time_s
    else:
        least_s = _FINEST_SHARE / max(band.mode.frequency_hz for band in bands)
        tick_s = _ASSUMED_TICK_S * max(1, math.ceil(least_s / _ASSUMED_TICK_S))
    first = max(1, math.ceil(least_s / tick_s - _WHOLE))
    last = max(first + _PERIODS_COMPARED - 1, math.floor(_LONGEST_BLOCK_PERIOD_S / tick_s + _WHOLE))
    every: list[tuple[float, float]] = []  # duration, and the period with a minus: of equal durations the longer one
    for multiple in range(first, last + 1):
        period_s = multiple * tick_s
        # What is longer than the worst of the best so far need not be found.
        longest_s = max_duration_s
        if len(every) >= _PERIODS_COMPARED:
            longest_s = min(longest_s, max(every[_PERIODS_COMPARED - 1][0], (1.0 + SAME) * every[0][0]))
        task = Task.checked(bands, period_s, non_negative=True, max_abs_sum=1.0, zeros_at_nominal=False)
        found = shortest_below(task, vibration_limit, longest_s, least_cost=False)
        if found is not None:
            every = sorted([*every, (round(found.shaper.duration_s, 9), -period_s)])
    if not every:
        return [multiple * tick_s for multiple in range(first, first + _PERIODS_COMPARED)]
    taken = max(-period for duration, period in every if duration <= (1.0 + SAME) * every[0][0])
    others = [-period for _, period in every if -period != taken]
    return sorted([taken, *others[: _PERIODS_COMPARED - 1]])
