"""Smooth shapers: a polynomial over time instead of a few taps, as the printer firmware Kalico convolves it.

There a smoother is a list of coefficients for one damping ratio. Here it is taken by what those coefficients meet: a
polynomial that is zero at both ends and nowhere negative, has the area 1, cancels the mode and some frequencies above
it, and is the shortest that does. On a grid the same conditions are imposed on the samples, so that the zeros hold
there to rounding: sampling the polynomial itself would lose them.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from shapegcode._core import DesignError, Mode, Shaper
from shapegcode.shaping.families.grid_search import RESIDUAL_LIMIT
from shapegcode.shaping.options import DesignOptions
from shapegcode.shaping.words import mode_names, ms

__all__ = ["smooth_kernel"]

FloatArray = NDArray[np.float64]

_FIRST = 0.7  # of the usual length: no kernel without negative samples is shorter, so the search begins there
_FURTHEST = 2.5
_STRIDES = 40  # of the usual length: how coarsely the first kernel is looked for, before the steps are halved
_MOST_SAMPLES = 20_000
_WHOLE = 1e-9
_CLEARLY = 1e-3  # of the largest sample: a negative one that what rounding left does not lift
_SINGULAR = 1e-12  # relative singular value below which two conditions ask for the same thing on this grid


def smooth_kernel(
    name: str, ratios: tuple[float, ...], periods: float, *, at_least: bool = False
) -> Callable[[Mode, DesignOptions], Shaper]:
    """The design of one mode by a polynomial kernel.

    Source: D. Butyugin's smoothers of the printer firmware Kalico; their derivation on a grid: this project.
    """

    def of_one(mode: Mode, options: DesignOptions) -> Shaper:
        period_s = options.grid_period_s
        usual = periods / (mode.frequency_hz * period_s)
        # one step more than unknowns: the two ends carry no sample
        fewest = max(2 * len(ratios) + 2, math.ceil((1.0 - _WHOLE if at_least else _FIRST) * usual))
        most = max(2 * fewest, int(_FURTHEST * usual))
        title = f"{name} for {mode_names([mode])} on a {ms(period_s)} grid"
        if usual > _MOST_SAMPLES:
            raise DesignError(f"{title} would take {usual:.0f} samples: at most {_MOST_SAMPLES}; take a longer period")

        def taps(steps: int) -> FloatArray | None:
            return _samples(mode, ratios, period_s, steps)

        steps = _first(lambda count: taps(count) is not None, fewest, most, max(1, int(usual) // _STRIDES))
        found = None if steps is None else taps(steps)
        if found is None:
            raise DesignError(
                f"no {title} up to {ms(most * period_s)}: no polynomial of degree {2 * len(ratios) + 2} without "
                f"negative samples has its zeros there; {_other_period(max(ratios) * mode.frequency_hz, period_s)}"
            )
        return Shaper((np.arange(len(found)) * period_s).tolist(), found.tolist())

    return of_one


def _first(good: Callable[[int], bool], fewest: int, most: int, stride: int) -> int | None:
    """The smallest good count from `fewest` to `most`, found by strides and then by halves; None: there is none."""
    count = next((each for each in range(fewest, most + 1, stride) if good(each)), None)
    if count is None:
        return None
    bad = max(count - stride, fewest - 1)
    while count - bad > 1:
        middle = (bad + count) // 2
        if good(middle):
            count = middle
        else:
            bad = middle
    return count


def _samples(mode: Mode, ratios: tuple[float, ...], period_s: float, steps: int) -> FloatArray | None:
    """The kernel's samples between its ends, `steps` periods apart; None if one is negative or a zero is missed."""
    x = 2.0 * np.arange(1, steps) / steps - 1.0
    count = 2 * len(ratios) + 1
    basis = legendre.legvander(x, count - 1) * (1.0 - x * x)[:, None]
    rows = [np.ones(len(x))]
    for index, ratio in enumerate(ratios):
        pole = Mode(ratio * mode.frequency_hz, mode.damping_ratio).pole
        # what each sample leaves at the last one; a double zero cancels the derivative too
        terms = np.exp((pole.real * (len(x) - 1 - np.arange(len(x))) + 1j * pole.imag * np.arange(len(x))) * period_s)
        terms = terms * x ** ratios[:index].count(ratio)
        rows += [terms.real, terms.imag]
    matrix = np.array(rows)
    target = np.eye(len(rows))[0]
    taps = basis @ np.linalg.lstsq(matrix @ basis, target, rcond=_SINGULAR)[0]
    if float(taps.min()) < -_CLEARLY * float(taps.max()):
        return None
    for _ in range(2):  # what rounding left of the zeros
        taps = taps + np.linalg.lstsq(matrix, target - matrix @ taps, rcond=_SINGULAR)[0]
    if float(np.abs(matrix @ taps - target).max()) > RESIDUAL_LIMIT or float(taps.min()) <= 0.0:
        return None
    return np.asarray(taps / taps.sum(), dtype=np.float64)


def _other_period(highest_hz: float, period_s: float) -> str:
    """What to do where there is no kernel."""
    if 2.0 * highest_hz * period_s > 1.0:
        return f"a period below {ms(0.5 / highest_hz)} tells its highest zero, {highest_hz:.4g} Hz, from slower ones"
    return "it is for modes that are damped less"
