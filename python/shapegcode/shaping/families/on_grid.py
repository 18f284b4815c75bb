"""The families of shapers on a sample grid: what defines them, imposed exactly there.

Rounding the times of a continuous design to a grid undoes its zeros. So a family is taken here by the
conditions that define it, and the shortest taps on the grid that meet them are looked for: zeros, with their
multiplicity, hold at ``z = e^{s*period}`` to rounding; a tolerated residual holds over its whole band, proven by
:func:`shapegcode._core.worst_residual`. A zero is linear in the taps. A limit on the residual is linear for each
frequency and direction, and the ones that matter are found as the linear program breaks them.
"""

from __future__ import annotations

import math

from shapegcode._core import (
    ArgumentError,
    DesignError,
    ShapegcodeError,
    Shaper,
    convolve,
    grid_polynomial,
)
from shapegcode.shaping.families.conditions import Conditions
from shapegcode.shaping.families.grid_search import GridSearch
from shapegcode.shaping.words import ms, whole_periods

__all__ = ["shortest_on_grid"]


_LONGER = 4  # times the longest duration: how far a refusal looks for what would do
_HINT_PERIODS = 400  # longest grid that a refusal searches, periods


def shortest_on_grid(conditions: Conditions, period_s: float, max_duration_s: float, *, title: str) -> Shaper:
    """Shortest shaper with taps at multiples of a period that meets the conditions.

    Among the shapers of the shortest duration, one without negative taps has the least second central moment that
    was found (the contour cost; a local minimum from three starts), one with them the least sum of magnitudes.

    Source: this project.
    """
    for name, value in (("period_s", period_s), ("max_duration_s", max_duration_s)):
        if not (math.isfinite(value) and value > 0.0):
            raise ArgumentError(f"{name} is {value} s: it must be finite and above 0")
    search = GridSearch(conditions, period_s)
    most = whole_periods(max_duration_s, period_s)
    shaper = search.shortest(most)
    if shaper is not None:
        return shaper
    text = f"no {title} within {ms(max_duration_s)} on a {ms(period_s)} grid"
    further = min(_LONGER * most, _HINT_PERIODS)
    if further > most:
        longer = search.shortest(further)
        if longer is not None:
            raise DesignError(f"{text}; the shortest lasts {ms(longer.duration_s)}")
        text += f", nor within {ms(further * period_s)}"
    raise DesignError(f"{text}; {_polynomial(conditions, period_s)}; try another period")


def _polynomial(conditions: Conditions, period_s: float) -> str:
    """What the polynomial with the same zeros would be."""
    if not conditions.zeros:
        return "there is no zero from which a polynomial could be made"
    try:
        shaper = Shaper([0.0], [1.0])
        for zero in conditions.zeros:
            for _ in range(zero.multiplicity):
                shaper = convolve(shaper, grid_polynomial([zero.mode], period_s))
    except ShapegcodeError as error:
        return f"nor is there a polynomial: {error}"
    return f"the polynomial with its zeros lasts {ms(shaper.duration_s)} with sum|a| {shaper.abs_sum:.4g}"
