"""An accelerometer on a tool while an axis goes from place to place: NumPy and SciPy alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.signal import lsim, lti

FloatArray = npt.NDArray[np.float64]
PERIOD_S = 1e-3
_PAUSES_S = (0.02, 0.05, 0.3, 0.8, 1.5)


def ordinary_run(
    rng: np.random.Generator,
    modes: Sequence[tuple[float, float, float]],
    *,
    moves: int = 25,
    smoothing: int = 8,
    noise_m_s2: float = 0.02,
    pauses_s: Sequence[float] = _PAUSES_S,
) -> FloatArray:
    """Acceleration of the tool in m/s², a sample every millisecond, with the gravity of a tilted sensor.

    `modes`: share of the axis' motion, frequency in Hz, damping ratio. Moves of 5 to 120 mm at 50 to 200 mm/s with
    ramps of 1 to 3 m/s², smoothed over some milliseconds, and pauses between them.
    """
    parts = [np.zeros(500)]
    for _ in range(moves):
        length, ramp = rng.uniform(5.0, 120.0) * rng.choice([-1.0, 1.0]), rng.choice([1000.0, 2000.0, 3000.0])
        speed = min(float(rng.choice([50.0, 100.0, 200.0])), float(np.sqrt(abs(length) * ramp)))
        samples = [round(each / PERIOD_S) for each in (speed / ramp, abs(length) / speed - speed / ramp)]
        push = np.full(samples[0], np.sign(length) * ramp)
        parts += [push, np.zeros(samples[1]), -push, np.zeros(round(float(rng.choice(pauses_s)) / PERIOD_S))]
    command = 1e-3 * np.convolve(np.concatenate([*parts, np.zeros(500)]), np.ones(smoothing) / smoothing, "same")
    tool, times = command.copy(), PERIOD_S * np.arange(len(command))
    for share, hertz, zeta in modes:
        omega = 2.0 * np.pi * hertz
        tool += lsim(lti([-share, 0.0, 0.0], [1.0, 2.0 * zeta * omega, omega**2]), command, times)[1]
    return np.asarray(tool + noise_m_s2 * rng.standard_normal(len(tool)) + 0.3)
