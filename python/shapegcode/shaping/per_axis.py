"""A shaper for each axis: shorter than one that cancels the modes of all of them.

Different shapers on the axes of a machine distort the path; with the contour brought back behind them they
become usable, if their mean delays are equal: what is left of the distortion is of second order in time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from shapegcode._core import ArgumentError, Fir, Mode, Shaper
from shapegcode.shaping.grid_designs import RESIDUAL_LIMIT
from shapegcode.shaping.track import mean_range, taps_of_mean
from shapegcode.shaping.words import whole_periods

__all__ = ["design_per_axis"]

_MEANS = 9  # mean delays that are compared
_POINT = 1e-8  # periods: means that differ by less are one


def design_per_axis(axis_modes: Sequence[Sequence[Mode]], period_s: float, max_duration_s: float) -> list[Fir] | None:
    """Shortest non-negative filters, one for each axis, of one mean delay, that cancel the axis' own modes exactly.

    The longest of them is as short as the grid permits; among the mean delays that all axes can have, the one with
    the least sum of second central moments is taken. An axis without modes is only delayed.

    Source: this project.
    """
    if not any(axis_modes):
        raise ArgumentError("shapers for each axis need at least one mode: 0 given")
    if not (math.isfinite(period_s) and period_s > 0.0):
        raise ArgumentError(f"period_s is {period_s} s: it must be finite and above 0")
    shaken = [list(modes) for modes in axis_modes if modes]
    for periods in range(1, whole_periods(max_duration_s, period_s) + 1):
        ranges = [mean_range(modes, period_s, periods) for modes in shaken]
        least, largest = max(low for low, _ in ranges), min(high for _, high in ranges)
        if least > largest + _POINT:
            continue
        if least > largest:  # a single mean, within the rounding of both ends
            least = largest = 0.5 * (least + largest)
        found = [
            filters
            for mean in np.linspace(least, largest, _MEANS)
            if (filters := _of_mean(axis_modes, period_s, periods, float(mean))) is not None
        ]
        if found:
            return min(found, key=lambda filters: sum(each.variance_samples2 for each in filters))
    return None


def _of_mean(axis_modes: Sequence[Sequence[Mode]], period_s: float, periods: int, mean: float) -> list[Fir] | None:
    """One filter per axis with a mean delay of `mean` periods, or None."""
    filters = []
    for modes in axis_modes:
        if not modes:
            whole = math.floor(mean)
            share = mean - whole
            filters.append(Fir([whole, whole + 1], [1.0 - share, share]) if share > 0.0 else Fir([whole], [1.0]))
            continue
        found = taps_of_mean(modes, period_s, periods, mean * period_s)
        if found is None:
            return None
        delays, taps = found
        # What is left of a mode does not depend on when the first tap comes.
        shaper = Shaper(((delays - delays[0]) * period_s).tolist(), taps.tolist())
        if max(shaper.residual_ratio(mode) for mode in modes) > RESIDUAL_LIMIT:
            return None
        filters.append(Fir(delays.tolist(), taps.tolist()))
    return filters
