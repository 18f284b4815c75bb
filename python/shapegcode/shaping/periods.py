"""The block periods that a comparison of shapers tries, and whether a controller can play one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from shapegcode._core import ArgumentError
from shapegcode.shaping.bands import ModeBand
from shapegcode.shaping.ranking import SAME
from shapegcode.shaping.robust.search import Task, shortest_below

if TYPE_CHECKING:
    from shapegcode.machine import Machine

__all__ = ["candidate_periods", "check_block_period"]

_ASSUMED_TICK_S = 0.001  # interpolation period where no machine states one
_LONGEST_BLOCK_PERIOD_S = 0.02
_PERIODS_COMPARED = 3
_FINEST_SHARE = 1.0 / 32.0  # of the fastest mode's period: a finer grid is as good as continuous times
_WHOLE = 1e-6  # interpolation periods
_ROUNDING = 1e-9  # relative


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
