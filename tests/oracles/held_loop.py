"""An axis in its position loop with masses on springs on it: what its encoder shows, by SciPy alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.signal import cont2discrete

FloatArray = npt.NDArray[np.float64]
_SUB = 4  # steps of the simulation per set-point


def encoder_m(
    command_m: FloatArray,
    period_s: float,
    modes: Sequence[tuple[float, float, float]],
    *,
    mass_kg: float = 400.0,
    gain_per_s: float = 40.0,
    bandwidth_hz: float = 60.0,
    feed_forward: float = 0.5,
    integral_s: float = 0.02,
) -> FloatArray:
    """Position of the encoder at the instants of the command.

    `modes`: mass in kg, frequency in Hz and damping ratio of each with the encoder held. Position gain, a PI speed loop
    and feed-forward of the speed; the command is straight between its samples.
    """
    size = 3 + 2 * len(modes)  # position, speed, integral, then deflection and its speed of each mode
    speed_gain = 2.0 * np.pi * bandwidth_hz * (mass_kg + sum(mass for mass, _, _ in modes))
    acceleration, by_input = np.zeros(size), np.zeros(2)
    acceleration[:3] = -speed_gain * gain_per_s, -speed_gain, speed_gain / integral_s
    by_input[:] = speed_gain * gain_per_s, speed_gain * feed_forward
    for k, (mass, hertz, zeta) in enumerate(modes):
        omega = 2.0 * np.pi * hertz
        acceleration[3 + 2 * k : 5 + 2 * k] = mass * omega**2, 2.0 * zeta * mass * omega
    acceleration, by_input = acceleration / mass_kg, by_input / mass_kg
    a, b = np.zeros((size, size)), np.zeros((size, 2))
    a[0, 1] = 1.0
    a[1], b[1] = acceleration, by_input
    a[2, :2], b[2] = (-gain_per_s, -1.0), (gain_per_s, feed_forward)
    for k, (_, hertz, zeta) in enumerate(modes):
        omega, at = 2.0 * np.pi * hertz, 3 + 2 * k
        a[at, at + 1] = 1.0
        a[at + 1], b[at + 1] = -acceleration, -by_input
        a[at + 1, at] -= omega**2
        a[at + 1, at + 1] -= 2.0 * zeta * omega
    step = period_s / _SUB
    ad, bd, *_ = cont2discrete((a, b, np.eye(1, size), np.zeros((1, 2))), step, method="zoh")
    times = np.arange(len(command_m) * _SUB) * step
    position = np.interp(times, np.arange(len(command_m)) * period_s, command_m) - command_m[0]
    speed = np.repeat(np.diff(command_m, append=command_m[-1]) / period_s, _SUB)
    driven = np.column_stack((position, speed)) @ bd.T
    state, found = np.zeros(size), np.empty(len(command_m))
    for k, push in enumerate(driven):
        if k % _SUB == 0:
            found[k // _SUB] = state[0]
        state = ad @ state + push
    return found + command_m[0]
