"""What a shaper leaves of a mode: by the formula, by the matrix exponential; whether a linear program has one."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import linprog

from judge.plant import residual_ratio
from shapegcode._core import Mode, Shaper


def left_of(shaper: Shaper, mode: Mode) -> float:
    """The residual ratio V, written out."""
    return float(residual_ratio(shaper.times_s, shaper.amplitudes, mode.frequency_hz, mode.damping_ratio)[0])


def simulated(shaper: Shaper, mode: Mode) -> float:
    """Size of the free motion after the last tap over that of one unit impulse then, by the matrix exponential.

    The size is that of the state in the modal coordinates, in which an undisturbed motion only turns and decays.
    """
    omega = 2.0 * np.pi * mode.frequency_hz
    matrix = np.array([[0.0, 1.0], [-(omega**2), -2.0 * mode.damping_ratio * omega]])
    state = np.zeros(2)
    now = 0.0
    for time, amplitude in zip(shaper.times_s, shaper.amplitudes, strict=True):
        state = expm(matrix * (time - now)) @ state + np.array([0.0, amplitude])
        now = time

    def size(motion: NDArray[np.float64]) -> float:
        position, speed = motion
        damped = omega * math.sqrt(1.0 - mode.damping_ratio**2)
        return math.hypot(position, (speed + mode.damping_ratio * omega * position) / damped)

    return size(state) / size(np.array([0.0, 1.0]))


def is_feasible(rows: Sequence[NDArray[np.complex128]], last: int) -> bool:
    """Whether non-negative impulses at 0 ... `last` periods have sum 1 and these sums zero: a linear program."""
    matrix = np.vstack([np.ones(last + 1), *[part for row in rows for part in (row.real, row.imag)]])
    options = {"primal_feasibility_tolerance": 1e-10}
    found = linprog(np.zeros(last + 1), A_eq=matrix, b_eq=np.eye(len(matrix))[0], options=options, method="highs-ds")
    return bool(found.status == 0)
