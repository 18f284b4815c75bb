"""Extra-insensitive (EI) shapers of the literature and the residual formula, for comparison with the robust designs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from judge.plant import residual_ratio
from shapegcode._core import Mode
from shapegcode.shaping import ModeBand

FloatArray = NDArray[np.float64]

TOLERATED = 0.05


def extra_insensitive(mode: Mode) -> tuple[FloatArray, FloatArray]:
    """Times in s and amplitudes of the three-impulse EI shaper with 5 % (Singhose 1994, exact without damping).

    With damping the impulses decay by K per half period and are scaled to sum 1, as motion controllers build it; at
    the nominal frequency this leaves somewhat less than 5 %.
    """
    damped_s = 1.0 / (mode.frequency_hz * math.sqrt(1.0 - mode.damping_ratio**2))
    decay = math.exp(-mode.damping_ratio * math.pi / math.sqrt(1.0 - mode.damping_ratio**2))
    amplitudes = np.array([(1.0 + TOLERATED) / 4, (1.0 - TOLERATED) / 2 * decay, (1.0 + TOLERATED) / 4 * decay**2])
    return np.array([0.0, 0.5, 1.0]) * damped_s, amplitudes / amplitudes.sum()


def extra_insensitive_fit(mode: Mode) -> tuple[FloatArray, FloatArray]:
    """The same by the published fit for damped modes (Singhose, Seering and Singer 1994), zeta up to 0.3."""
    v, z = TOLERATED, mode.damping_ratio
    damped_s = 1.0 / (mode.frequency_hz * math.sqrt(1.0 - z**2))
    second = (
        0.49990 + 0.46159 * v * z + 4.26169 * v * z**2 + 1.75601 * v * z**3
        + 8.57843 * v**2 * z - 108.644 * v**2 * z**2 + 336.989 * v**2 * z**3
    )  # fmt: skip
    first_amplitude = 0.24968 + 0.24962 * v + 0.80008 * z + 1.23328 * v * z + 0.49599 * z**2 + 3.17316 * v * z**2
    last_amplitude = 0.25149 + 0.21474 * v - 0.83249 * z + 1.41498 * v * z + 0.85181 * z**2 - 4.90094 * v * z**2
    amplitudes = np.array([first_amplitude, 1.0 - first_amplitude - last_amplitude, last_amplitude])
    return np.array([0.0, second, 1.0]) * damped_s, amplitudes


def ei_convolved(bands: Sequence[ModeBand]) -> tuple[FloatArray, FloatArray]:
    """EI shapers of all modes in series, at continuous times; of the two forms that which leaves less."""
    both = []
    for form in (extra_insensitive, extra_insensitive_fit):
        times_s, amplitudes = np.zeros(1), np.ones(1)
        for band in bands:
            t, a = form(band.mode)
            times_s, amplitudes = np.add.outer(times_s, t).ravel(), np.multiply.outer(amplitudes, a).ravel()
        both.append((times_s, amplitudes))
    return min(both, key=lambda shaper: worst_over_bands(shaper[0], shaper[1], bands, 401))


def worst_over_bands(times_s: FloatArray, amplitudes: FloatArray, bands: Sequence[ModeBand], samples: int) -> float:
    """The residual ratio V, written out, at its largest on a plain grid of frequencies."""
    worst = 0.0
    for band in bands:
        hertz = band.mode.frequency_hz * (1.0 + band.uncertainty * np.linspace(-1.0, 1.0, samples))
        worst = max(worst, float(residual_ratio(times_s, amplitudes, hertz, band.mode.damping_ratio).max()))
    return worst


def random_pairs(count: int, seed: int) -> list[tuple[ModeBand, ModeBand]]:
    """Mode pairs: 10 to 60 Hz, frequency ratio 1.1 to 6, damping ratio 0 to 0.1, each within 10 %."""
    rng = np.random.default_rng(seed)
    pairs = []
    for _ in range(count):
        f, ratio, first, second = (float(rng.uniform(*ends)) for ends in ((10, 60), (1.1, 6.0), (0, 0.1), (0, 0.1)))
        pairs.append((ModeBand(Mode(f, first), 0.1), ModeBand(Mode(f * ratio, second), 0.1)))
    return pairs


def fine_enough_period_s(bands: Sequence[ModeBand]) -> float:
    """Longest of 1 to 5 ms with at least three periods per swing at the upper end of the highest band; else 1 ms."""
    highest_hz = max(band.mode.frequency_hz * (1.0 + band.uncertainty) for band in bands)
    return 1e-3 * min(5, max(1, math.floor(1e3 / (3.0 * highest_hz))))
