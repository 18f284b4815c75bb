"""Finds the sampling period from the instants in a file; resamples unevenly sampled data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded

from shapegcode.io.units import FloatArray

#: Allowed deviation of an instant from even sampling, relative to the period. Rounding to the file's digits
#: moves it by up to half a digit; a missing or a doubled sample moves it, or a neighbour, by half a period or more.
_OFF_GRID = 0.49
#: Allowed relative difference of a step from the period; a missing sample doubles the step.
_OFF_STEP = 0.9
_TELL = 0.1  # deviation from the grid that is reported, relative to the period
#: Allowed relative difference of stated and measured rate: clocks are far better, wrong units far worse.
STATED_RATE_TOLERANCE = 0.01
#: Rounding moves an instant by half a digit at most; if digits are finer than this fraction of the deviation, the
#: clock of the logger itself is uneven.
_ROUNDED = 0.5
_UNEVEN = 0.05  # uneven clock: half of the steps differ from the usual one by more than this ratio
_GRID_ONLY = "samples must be evenly spaced"


class UnevenTimeError(ValueError):
    """The instants are not evenly spaced."""

    def __init__(self, row: int, text: str, *, ascending: bool = False) -> None:
        super().__init__(text)
        self.row, self.ascending = row, ascending


def even_period(
    times_s: FloatArray, stated_s: float | None = None, *, even_clock: bool = True
) -> tuple[float, list[str]]:
    """Mean period of evenly spaced instants, and warnings."""
    count = len(times_s)
    steps = np.diff(times_s)
    backwards = np.flatnonzero(steps < 0.0)
    if backwards.size:
        row = int(backwards[0]) + 1
        raise UnevenTimeError(row, f"time {times_s[row]:.9g} s comes after {times_s[row - 1]:.9g} s: must ascend")
    mean = float(times_s[-1] - times_s[0]) / (count - 1)
    if stated_s is not None and not abs(mean / stated_s - 1.0) <= STATED_RATE_TOLERANCE:
        what = f"the time column has a sample every {mean:.6g} s, {stated_s:.6g} s is stated"
        must = f"must agree within {100 * STATED_RATE_TOLERANCE:g} %; is the unit of the time right?"
        raise UnevenTimeError(0, f"{what}: {must}")
    period = mean if stated_s is None else stated_s
    rising = steps[steps > 0.0]
    digit = float(np.min(rising)) if rising.size else 0.0
    coarse = stated_s is not None and digit > 1.5 * stated_s
    repeated = np.flatnonzero(steps == 0.0)
    if repeated.size and not coarse:
        row = int(repeated[0]) + 1
        remedy = "if the file has too few digits, omit the time and state the period (--sample-period)"
        raise UnevenTimeError(row, f"time {times_s[row]:.9g} s is repeated: must ascend; {remedy}")
    usual = float(np.median(steps))
    if not coarse:
        row = int(np.argmax(np.abs(steps - usual)))
        if abs(steps[row] - usual) > _OFF_STEP * usual:
            raise UnevenTimeError(
                row + 1,
                f"{steps[row]:.6g} s between {times_s[row]:.9g} s and {times_s[row + 1]:.9g} s, usually {usual:.6g} s: "
                f"{_GRID_ONLY}; samples are missing",
                # Lost samples of an even clock are not an uneven clock: the data in the gap are unknown.
                ascending=bool(np.median(np.abs(steps - usual)) > _UNEVEN * usual),
            )
    grid = times_s[0] + period * np.arange(count)
    off = times_s - grid
    # The first instant is rounded like the others.
    off -= np.median(off)
    row = int(np.argmax(np.abs(off)))
    share = float(abs(off[row])) / period
    limit = max(_OFF_GRID, digit / period if coarse else 0.0)
    place = f"time {times_s[row]:.9g} s is {share:.2g} periods of {period:.6g} s from even spacing"
    if share > limit:
        text = f"{place} (limit {limit:.2g}): {_GRID_ONLY} and none may be missing"
        raise UnevenTimeError(row, text, ascending=True)
    if not even_clock and share > _TELL and not coarse and _digit_of(times_s) < _ROUNDED * share * period:
        text = f"{place}, more than the digits of the file explain: {_GRID_ONLY}"
        raise UnevenTimeError(row, text, ascending=True)
    if share > _TELL and not coarse:
        return period, [
            f"times are up to {100 * share:.0f} % of a period from even spacing: assumed rounding, with the mean "
            f"period of {period:.6g} s"
        ]
    return period, []


def _digit_of(times_s: FloatArray) -> float:
    """Value of the last digit of instants, s; 0: finer than a picosecond."""
    for power in range(13):
        scaled = times_s * 10.0**power
        if np.max(np.abs(scaled - np.round(scaled))) < 1e-3:
            return float(10.0**-power)
    return 0.0


_DENSITY = 0.8  # grid points per sample: the surplus samples average noise and bridge gaps
_LONGEST_STEP = 3.0  # longest step relative to the mean: a longer one limits the band to less than a third
_REACH = 16  # sinc of this many samples on either side in a Kaiser window with 80 dB, flat up to .4 of the grid's rate
_BETA = 7.86
_RIDGE = 1e-6
#: Least factor on intervals: the pulse's content above the grid's band is an error in addition to noise
#: that a fit to the grid does not detect.
_MIN_WIDENED = 3.0


@dataclass(frozen=True, eq=False)
class EvenGrid:
    """An even grid for uneven instants."""

    period_s: float  # time between two of its samples
    times_s: FloatArray  # (m,) instants
    widened: float  # factor on confidence intervals
    notes: list[str]  # description of the resampling


def even_grid(times_s: FloatArray) -> EvenGrid:
    """Finest even grid that the uneven samples can determine.

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
            f"step of more than {_LONGEST_STEP:g} times the mean is too long to resample; samples are missing",
        )
    period = max(mean / _DENSITY, float(steps[row]))
    count = int((times_s[-1] - times_s[0]) / period + 1e-9) + 1
    widened = max(_MIN_WIDENED, float(np.sqrt(steps[row] / mean)))
    note = (
        f"times are not evenly spaced: steps of {np.min(steps):.4g} to {steps[row]:.4g} s, on average {mean:.4g} s; "
        f"resampled to {1.0 / period:.5g} samples per second, valid up to {0.4 / period:.4g} Hz; intervals are "
        f"widened by a factor of {widened:.2g}"
    )
    return EvenGrid(period, times_s[0] + period * np.arange(count), widened, [note])


def resample(values: FloatArray, times_s: FloatArray, grid: EvenGrid) -> FloatArray:
    """Band-limited signal on a grid that fits the samples best: least squares of sinc functions."""
    offset = float(np.mean(values))
    at = (times_s - grid.times_s[0]) / grid.period_s
    first = np.floor(at).astype(int) - _REACH + 1
    columns = first[:, None] + np.arange(2 * _REACH)
    away = at[:, None] - columns
    inside = np.sqrt(np.maximum(1.0 - (away / _REACH) ** 2, 0.0))
    weights = np.sinc(away) * np.i0(_BETA * inside) / np.i0(_BETA)
    # The signal includes grid points beyond the ends.
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
