"""Records of loggers whose samples are not evenly spaced: the band-limited signal through them, on an even grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

from shapegcode.io.record import FloatArray
from shapegcode.io.sampling import UnevenTimeError

__all__ = ["EvenGrid", "even_grid", "resample"]

#: The grid has this share of the samples: the rest of them is what noise and gaps are told by.
_DENSITY = 0.8
#: The longest step may be so many mean ones: a longer one leaves less than a third of the band.
_LONGEST_STEP = 3.0
#: Sinc of so many samples either way in a Kaiser window with 80 dB, flat up to .4 of the grid's rate.
_REACH = 16
_BETA = 7.86
_RIDGE = 1e-6
#: Intervals are widened by this much at least: what the pulse holds above the grid's band is an error beside the noise,
#: which a fit to the grid does not see.
_LEAST_WIDENED = 3.0


@dataclass(frozen=True, eq=False)
class EvenGrid:
    """An even grid for uneven instants.

    Attributes:
        period_s: time between two of its samples.
        times_s: (m,) instants.
        widened: what intervals are multiplied with.
        notes: what was done, in words.
    """

    period_s: float
    times_s: FloatArray
    widened: float
    notes: list[str]


def even_grid(times_s: FloatArray) -> EvenGrid:
    """The grid that uneven instants are dense enough for.

    Source: H. Landau, Acta Mathematica 117, 1967: samples denser than a band's Nyquist rate determine a signal in it;
    with no gap longer than the grid's period the solution is stable (K. Groechenig, 1992).
    """
    steps = np.diff(times_s)
    mean = float(times_s[-1] - times_s[0]) / len(steps)
    row = int(np.argmax(steps))
    if steps[row] > _LONGEST_STEP * mean:
        raise UnevenTimeError(
            row + 1,
            f"{steps[row]:.6g} s between {times_s[row]:.9g} s and {times_s[row + 1]:.9g} s, on average {mean:.6g} s: a "
            f"step of more than {_LONGEST_STEP:g} times the mean leaves too little to resample; samples are missing",
        )
    period = max(mean / _DENSITY, float(steps[row]))
    count = int((times_s[-1] - times_s[0]) / period + 1e-9) + 1
    widened = max(_LEAST_WIDENED, float(np.sqrt(steps[row] / mean)))
    note = (
        f"times are not evenly spaced: steps of {np.min(steps):.4g} to {steps[row]:.4g} s, on average {mean:.4g} s; "
        f"resampled to {1.0 / period:.5g} samples per second, which is good up to {0.4 / period:.4g} Hz; intervals are "
        f"widened {widened:.2g} times"
    )
    return EvenGrid(period, times_s[0] + period * np.arange(count), widened, [note])


def resample(values: FloatArray, times_s: FloatArray, grid: EvenGrid) -> FloatArray:
    """The band-limited signal that goes through the samples best, on a grid: least squares over sinc functions."""
    offset = float(np.mean(values))
    place = (times_s - grid.times_s[0]) / grid.period_s
    first = np.floor(place).astype(int) - _REACH + 1
    columns = first[:, None] + np.arange(2 * _REACH)
    away = place[:, None] - columns
    inside = np.sqrt(np.maximum(1.0 - (away / _REACH) ** 2, 0.0))
    weights = np.sinc(away) * np.i0(_BETA * inside) / np.i0(_BETA)
    # Grid points beyond the ends belong to the signal, too.
    count = len(grid.times_s) + 2 * _REACH
    columns = columns + _REACH
    band = np.zeros((2 * _REACH, count))
    right = np.zeros(count)
    for j in range(2 * _REACH):
        np.add.at(right, columns[:, j], weights[:, j] * (values - offset))
        for k in range(j, 2 * _REACH):
            np.add.at(band[k - j], columns[:, j], weights[:, j] * weights[:, k])
    band[0] += _RIDGE
    solved = solveh_banded(band, right, lower=True)
    return np.asarray(offset + solved[_REACH : _REACH + len(grid.times_s)], dtype=np.float64)
