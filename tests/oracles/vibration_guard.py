"""Vibration Guard of ISG's CNC kernel (Beckhoff TwinCAT CNC): what is published of it, and kernels that fit.

Published (TF5200, P-AXIS-00571 "Vibration Guard mode", https://infosys.beckhoff.com/content/1033/tf5200_axis_parameter/555381643.html):
four modes, how far the frequency may be off for at most 5 % residual vibration at a damping of .1, that modes 1 to 3
"may have different forward and backward motions", that each is less sensitive and costs more contour than the one
before, and that mode 4 is symmetrical. No kernel, no duration. The kernels here are derived: ZV, ZVD, ZVDD and ZV with
its mirror image are those of whole half periods that have these properties, and the published bands lie within theirs
if "deviation" is that of the frequency set from the machine's.

The residual is the formula of the judge; nothing here comes from the package.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from judge.plant import residual_ratio

FloatArray = NDArray[np.float64]

DAMPING = 0.1
LIMIT = 0.05


@dataclass(frozen=True)
class GuardMode:
    """A mode of the Vibration Guard."""

    number: int  # 1 to 4
    below: float  # largest negative deviation, a share
    above: float  # largest positive deviation
    kernel: str  # what it was derived to be
    symmetric: bool = False  # whether contours are alike forwards and backwards

    @property
    def band(self) -> tuple[float, float]:
        """The machine's frequency over the one set, if the deviation is the machine's."""
        return 1.0 - self.below, 1.0 + self.above

    @property
    def band_of_setting(self) -> tuple[float, float]:
        """The same if the deviation is that of the setting; as wide, as a ratio."""
        return 1.0 / (1.0 + self.above), 1.0 / (1.0 - self.below)

    def taps(self) -> tuple[FloatArray, FloatArray]:
        """Times in periods of the mode and amplitudes of the derived kernel."""
        root = math.sqrt(1.0 - DAMPING**2)
        decay = math.exp(-math.pi * DAMPING / root)
        pair = np.array([1.0, decay]) / (1.0 + decay)
        factors = [pair, pair[::-1]] if self.symmetric else [pair] * self.number
        amplitudes = np.ones(1)
        for factor in factors:
            amplitudes = np.convolve(amplitudes, factor)
        return 0.5 / root * np.arange(len(amplitudes)), amplitudes


MODES = (
    GuardMode(1, 0.03, 0.03, "ZV"),
    GuardMode(2, 0.13, 0.19, "ZVD"),
    GuardMode(3, 0.20, 0.33, "ZVDD"),
    GuardMode(4, 0.10, 0.13, "ZV and its mirror image", symmetric=True),
)


def five_percent_band(times: FloatArray, amplitudes: FloatArray, around: float = 1.0) -> tuple[float, float]:
    """Where the residual stays at most 5 %, from `around` to both sides; up to 4 times the mode."""
    ends = []
    for limit in (0.2, 4.0):
        # a thousandth more than 5 %: a design is proven to a thousandth of its limit
        grid = np.linspace(around, limit, 20_001)
        over = np.flatnonzero(residual_ratio(times, amplitudes, grid, DAMPING) > LIMIT * (1.0 + 1e-6))
        ends.append(float(grid[max(over[0] - 1, 0)]) if len(over) else limit)
    return ends[0], ends[1]


def arc_error(times: FloatArray, amplitudes: FloatArray) -> float:
    """Second central moment, periods²: an arc comes out too small by that times v²/(2R)."""
    mean = float(np.dot(amplitudes, times))
    return float(np.dot(amplitudes, (times - mean) ** 2))


def corner_error(times: FloatArray, amplitudes: FloatArray) -> float:
    """Half the mean deviation of the taps, periods: by that times v a right-angled corner is cut (no tap negative)."""
    mean = float(np.dot(amplitudes, times))
    return 0.5 * float(np.dot(amplitudes, np.abs(times - mean)))
