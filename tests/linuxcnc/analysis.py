"""What a recording says, by NumPy and SciPy alone: nothing here is the project's own code."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

Array = NDArray[np.float64]
PERIOD_S = 1e-3
STEADY = 1e-3
"""mm/s^2: an acceleration below this is rounding."""


def zv_taps(frequency_hz: float, damping: float, *, zeros: int = 1) -> Array:
    """ZV (two: ZVD ...) on samples: the second impulse is shared by two samples so that the mode sees no difference."""
    omega = 2.0 * np.pi * frequency_hz
    damped = omega * np.sqrt(1.0 - damping**2)
    half_period = np.pi / damped
    decay = np.exp(-damping * omega * half_period)
    z = np.exp(complex(-damping * omega, damped) * PERIOD_S)
    whole, part = divmod(half_period / PERIOD_S, 1.0)
    # unknown shares a, b: a + b/z = z^-part, real and imaginary part
    system = np.array([[1.0, (1.0 / z).real], [0.0, (1.0 / z).imag]])
    shares = np.linalg.solve(system, [(z**-part).real, (z**-part).imag])
    taps = np.zeros(int(whole) + 2)
    taps[0] = 1.0
    taps[-2:] += decay * shares
    taps /= taps.sum()
    once = taps
    for _ in range(zeros - 1):
        taps = np.convolve(taps, once)
    return taps


def convolved(command: Array, taps: Array) -> Array:
    """Each column behind the taps, held at its first value before the beginning."""
    held = np.vstack([np.repeat(command[:1], len(taps) - 1, axis=0), command])
    return np.column_stack([np.convolve(column, taps, "valid") for column in held.T])


def mean_delay_s(taps: Array) -> float:
    """First moment of the taps."""
    return PERIOD_S * float(taps @ np.arange(len(taps)))


def fade_weight(share: Array) -> Array:
    """The polynomial of fifth order from 0 to 1 with slope and curvature 0 at both ends."""
    share = np.clip(share, 0.0, 1.0)
    return 6.0 * share**5 - 15.0 * share**4 + 10.0 * share**3


def vibration(command: Array, frequency_hz: float, damping: float) -> Array:
    """Deflection of a mode that is moved by the command, which is linear between samples."""
    omega = 2.0 * np.pi * frequency_hz
    second_order = [1.0, 2.0 * damping * omega, omega**2]
    numerator, denominator, _ = cont2discrete(([-1.0, 0.0, 0.0], second_order), PERIOD_S, method="foh")
    return np.asarray(lfilter(numerator[0], denominator, command - command[0]))


def swing_when_steady(command: Array, frequency_hz: float, damping: float) -> float:
    """Largest deflection of a mode while the command rests or keeps its speed: what swings there was excited before."""
    steady = np.concatenate([[True], np.abs(acceleration(command)) < STEADY, [True]])
    deflection = vibration(command, frequency_hz, damping)
    return float(np.abs(deflection[np.convolve(steady, np.ones(5), "same") > 4.5]).max())


def deviation(points: Array, path: Array) -> Array:
    """Distance of each point from the path that is sampled at the same times, in the last 60 samples."""
    moved = np.concatenate([[True], np.any(np.diff(path, axis=0) != 0.0, axis=1)])
    corners = path[moved]
    place = np.cumsum(moved) - 1
    nearest = np.full(len(points), np.inf)
    for back in range(-15, 60):
        first = np.clip(place - back - 1, 0, len(corners) - 2)
        start, way = corners[first], corners[first + 1] - corners[first]
        along = np.einsum("ij,ij->i", points - start, way) / np.maximum(np.einsum("ij,ij->i", way, way), 1e-300)
        foot = start + np.clip(along, 0.0, 1.0)[:, None] * way
        nearest = np.minimum(nearest, np.linalg.norm(points - foot, axis=1))
    return nearest


def acceleration(positions: Array) -> Array:
    """Second difference."""
    return np.diff(positions, 2, axis=0) / PERIOD_S**2
