"""Robust shapers on a sample grid: the least worst residual over frequency bands, and the shortest one below a limit.

A mode's frequency is never known exactly: an identification gives it with an interval, and it moves with the load. The
designs here bound the residual ratio over a whole band of each mode, on the grid, so that they survive being written as
blocks. What is best is proven: the cutting planes of :mod:`shapegcode.shaping.robust.cutting_planes` give
a bound that no other design can beat, and a sweep with a bound on what lies between its samples judges the taps.

A mode without a band (uncertainty 0) is cancelled exactly at its frequency, as the plain grid designs do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from shapegcode._core import ArgumentError, DesignError
from shapegcode.shaping.bands import ModeBand
from shapegcode.shaping.robust.search import (
    RobustDesign,
    Task,
    best_within,
    check_time,
    no_exact,
    refusal,
    shortest_below,
    smallest_below,
    unreachable,
)
from shapegcode.shaping.words import band_names, ms

__all__ = ["VIBRATION_LIMIT", "RobustDesign", "least_worst", "minimax_robust"]

VIBRATION_LIMIT = 0.05
"""Residual ratio that a robust design may leave anywhere in the bands unless another one is asked for."""

_LONGER = 4  # times the longest duration: how far a refusal looks for what would do
_OTHER_PERIODS = (0.5, 0.75, 1.25, 1.5, 2.0)  # of the refused one: what a refusal looks at
_HINT_PRECISION = 0.05  # relative, of the duration that would do
_HINT_PERIODS = 500  # longest grid that a refusal searches, periods


def least_worst(
    bands: Sequence[ModeBand],
    period_s: float,
    duration_s: float,
    *,
    non_negative: bool = True,
    max_abs_sum: float = 10.0,
    zeros_at_nominal: bool = False,
) -> RobustDesign:
    """Taps on a grid whose worst residual over the bands is least, for a given duration.

    The optimum is proven to 0.1 %: `worst_residual` is at most that much above `least_possible` (a residual below
    1e-6 counts as none). The exception is a damped mode on a grid where the best use of the last periods is to wait:
    the residual counts from the last tap, so the shaper is then shorter, or a last tap of 0.001 marks the end.

    Source: this project.
    """
    task = Task.checked(bands, period_s, non_negative, max_abs_sum, zeros_at_nominal)
    check_time("duration_s", duration_s)
    if not task.wide:
        raise ArgumentError(
            f"no mode states a band ({band_names(bands)}): nothing to make least; ask for the shortest exact design"
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
    """Shortest taps on a grid that leave at most a given share of the vibration anywhere in the bands.

    The number of periods is the smallest for which the least worst residual is below the limit (to 0.1 %). Among the
    non-negative designs of that duration the one with the least second central moment, the contour cost, is taken
    (to 0.5 %); with negative taps, the one with the least sum of magnitudes.

    Source: this project.
    """
    task = Task.checked(bands, period_s, non_negative, max_abs_sum, zeros_at_nominal, mirrored)
    check_time("max_duration_s", max_duration_s)
    if not 0.0 < vibration_limit < 1.0:
        raise ArgumentError(f"vibration_limit is {vibration_limit}: it must be above 0 and below 1")
    found = shortest_below(task, vibration_limit, max_duration_s)
    if found is None:
        text = refusal(task, vibration_limit, max_duration_s)
        raise DesignError(f"{text}{_hints(task, vibration_limit, max_duration_s)}" if hints else text)
    return found


def _hints(task: Task, limit: float, max_duration_s: float) -> str:
    """What the longest allowed duration reaches, which one would do, and which other period."""
    text = ""
    if not unreachable(task):
        most = task.periods(max_duration_s)
        reached = best_within(task, most) if task.wide and most else None
        if reached is not None:
            text += f"; the longest allowed reaches {_percent(reached.worst_residual)}"
        else:
            text += f"; {no_exact(task, most * task.period_s)}"
        longest = min(_LONGER * most, max(_HINT_PERIODS, most))
        enough = smallest_below(task, limit, longest, too_few=most, precision=_HINT_PRECISION)
        text += f"; {ms(enough * task.period_s)} would do" if enough else f"; nor does {ms(longest * task.period_s)} do"
    return f"{text}; {_other_period(task, limit, max_duration_s)}"


def _other_period(task: Task, limit: float, max_duration_s: float) -> str:
    """Which of some other periods does best within the duration."""
    shortest_s, least = math.inf, math.inf
    shortest_text, least_text = "", "no other period from half to twice as long has a design within that duration"
    for share in _OTHER_PERIODS:
        other = task.at_period(share * task.period_s)
        most = min(other.periods(max_duration_s), _HINT_PERIODS)
        if not most or unreachable(other):
            continue
        enough = smallest_below(other, limit, most)
        if enough is not None:
            if enough * other.period_s < shortest_s:
                shortest_s = enough * other.period_s
                shortest_text = f"on a period of {ms(other.period_s)} a design of {ms(shortest_s)} would do"
            continue
        found = best_within(other, most)
        if found is not None and found.worst_residual < least:
            least = found.worst_residual
            least_text = f"a period of {ms(other.period_s)} reaches {_percent(least)} within that duration"
    return shortest_text or least_text


def _percent(ratio: float) -> str:
    return f"{100.0 * ratio:.3g} %"
