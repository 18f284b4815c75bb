"""Modes fitted to frequency responses by weighted least squares: the model of a tap, over frequency instead of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode.errors import ArgumentError

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

#: Power of s in the numerator.
POWERS = {"displacement": 0, "velocity": 1, "acceleration": 2}
_LARGEST_STEP = 0.5  # of a logarithm
_STEP_FLOOR = 1e-9
_GAIN_FLOOR = 1e-10  # of the sum of squares: a step that gains less is the last one
_NEWTON = 1e-4  # damping below which a step is one of Gauss and Newton
_LEAST_DAMPING, _MOST_DAMPING = 1e-6, 0.99


@dataclass(frozen=True, eq=False)
class FrfLines:
    """Lines of one or several frequency responses of a point, one behind another."""

    omega: FloatArray  # (n,) rad/s
    response: ComplexArray  # (n,) complex, SI over N
    weight: FloatArray  # (n,) 1 over the noise's standard deviation, up to a common factor
    quantity: str  # what was divided by the force
    below: bool  # a free mass stands for the modes below the lines
    above: bool  # a spring without mass stands for those above


@dataclass(frozen=True, eq=False)
class FrfFit:
    """Result of `fit_frf`, with the names of the core's fits."""

    omega_rad_s: FloatArray  # (m,) undamped natural frequencies
    damping_ratio: FloatArray  # (m,)
    inverse_mass: FloatArray  # (m,) residues 1/m in 1/kg
    covariance: FloatArray  # (3m, 3m) of omega, zeta, 1/m of the first mode, then of the second,
    sum_of_squares: float  # of the weighted residuals
    samples: int  # real and imaginary parts together
    parameters: int  # fitted ones
    residual_autocorrelation: float  # of the weighted residuals between neighbouring lines
    fitted: list[ComplexArray]  # the model's lines, (n,) complex
    converged: bool  # whether a minimum was found


def mode_columns(
    lines: FrfLines, omega: FloatArray, zeta: FloatArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Frequency responses of modes of 1 kg, and their derivatives to ln omega and ln zeta."""
    s = 1j * lines.omega[:, None]
    below = s**2 + 2.0 * zeta * omega * s + omega**2
    column = s ** POWERS[lines.quantity] / below
    shared = -column / below
    return column, shared * (2.0 * zeta * omega * s + 2.0 * omega**2), shared * (2.0 * zeta * omega * s)


def _rest(lines: FrfLines) -> ComplexArray:
    """Columns of what lies below and above the lines."""
    s = 1j * lines.omega
    top = s ** POWERS[lines.quantity]
    columns = [top / s**2] if lines.below else []
    if lines.above:
        columns.append(top)
    return np.array(columns, dtype=np.complex128).T.reshape(len(s), len(columns))


def _stacked(lines: FrfLines, columns: ComplexArray) -> FloatArray:
    weighted = lines.weight[:, None] * columns
    return np.vstack((weighted.real, weighted.imag))


def fit_frf(lines: FrfLines, starts: Sequence[tuple[float, float]], most_iterations: int) -> FrfFit:
    """Fit modes to lines: the sum over modes of (1/m) s^q / (s² + 2 zeta omega s + omega²).

    Levenberg-Marquardt in ln omega and ln zeta with exact derivatives; everything linear is eliminated.

    Source: D. J. Ewins, Modal Testing, 2nd ed., ch. 4; variable projection: G. Golub and V. Pereyra, 2003.
    """
    theta = np.log(np.array(starts, dtype=np.float64)).ravel()
    rest = _stacked(lines, _rest(lines))
    goal = _stacked(lines, lines.response[:, None])[:, 0]
    modes, samples = len(starts), len(goal)
    parameters = 3 * modes + rest.shape[1]
    if samples <= parameters + 1:
        raise ArgumentError(f"{samples // 2} lines are too few for {modes} modes")
    bounds = np.log([0.3 * lines.omega[0], 3.0 * lines.omega.max()]), np.log([_LEAST_DAMPING, _MOST_DAMPING])
    at = _linearised(lines, theta, rest, goal)
    damping, converged = 1e-3, False
    for _ in range(most_iterations):
        gram = at.jacobian.T @ at.jacobian
        scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        scaled = gram / np.outer(scale, scale) + (damping + 1e-14) * np.eye(2 * modes)
        step = np.linalg.solve(scaled, at.jacobian.T @ at.residual / scale) / scale
        largest = float(np.max(np.abs(step)))
        if not np.isfinite(largest):
            break
        tried = theta + step * min(1.0, _LARGEST_STEP / max(largest, 1e-300))
        for index, (low, high) in enumerate(bounds):
            tried[index::2] = np.clip(tried[index::2], low, high)
        moved = float(np.max(np.abs(tried - theta)))
        before = at.squares
        following = _linearised(lines, tried, rest, goal)
        if following.squares <= at.squares * (1.0 + 1e-13):
            theta, at, damping = tried, following, 0.1 * damping
        else:
            damping = max(10.0 * damping, 1e-6)
        gained = before - at.squares
        if moved <= _STEP_FLOOR or (following is at and gained <= _GAIN_FLOOR * at.squares and damping < _NEWTON):
            converged = True
            break
    return _finished(lines, theta, at, parameters, converged)


@dataclass(frozen=True, eq=False)
class _Linearised:
    """The problem at one theta: linear parameters, residual, derivatives without what the linear ones follow."""

    linear: FloatArray
    columns: FloatArray
    raw: FloatArray
    jacobian: FloatArray
    residual: FloatArray
    squares: float


def _linearised(lines: FrfLines, theta: FloatArray, rest: FloatArray, goal: FloatArray) -> _Linearised:
    omega, zeta = np.exp(theta[::2]), np.exp(theta[1::2])
    column, to_omega, to_zeta = (_stacked(lines, each) for each in mode_columns(lines, omega, zeta))
    columns = np.hstack((column, rest))
    norms = np.maximum(np.sqrt(np.sum(columns**2, axis=0)), 1e-300)
    basis, triangle = np.linalg.qr(columns / norms)
    linear = np.linalg.lstsq(triangle, basis.T @ goal, rcond=1e-12)[0] / norms
    residual = goal - columns @ linear
    raw = np.empty((len(goal), 2 * len(omega)))
    raw[:, ::2] = to_omega * linear[: len(omega)]
    raw[:, 1::2] = to_zeta * linear[: len(omega)]
    return _Linearised(linear, columns, raw, raw - basis @ (basis.T @ raw), residual, float(residual @ residual))


def _finished(lines: FrfLines, theta: FloatArray, at: _Linearised, parameters: int, converged: bool) -> FrfFit:
    omega, zeta = np.exp(theta[::2]), np.exp(theta[1::2])
    modes, samples = len(omega), len(at.residual)
    jacobian = np.hstack((at.columns, at.raw))
    norms = np.maximum(np.sqrt(np.sum(jacobian**2, axis=0)), 1e-300)
    inverse = np.linalg.pinv((jacobian / norms).T @ (jacobian / norms), hermitian=True) / np.outer(norms, norms)
    whole = at.squares / (samples - parameters) * inverse
    first = at.columns.shape[1]
    change = np.zeros((3 * modes, len(norms)))
    for mode in range(modes):
        change[3 * mode, first + 2 * mode] = omega[mode]
        change[3 * mode + 1, first + 2 * mode + 1] = zeta[mode]
        change[3 * mode + 2, mode] = 1.0
    half = samples // 2
    left = at.residual[:half] + 1j * at.residual[half:]
    power = max(at.squares, np.finfo(float).tiny)
    fitted = lines.response - left / lines.weight
    return FrfFit(
        omega,
        zeta,
        at.linear[:modes],
        change @ whole @ change.T,
        at.squares,
        samples,
        parameters,
        float(np.sum((left[1:] * np.conj(left[:-1])).real) / power),
        [fitted],
        converged,
    )
