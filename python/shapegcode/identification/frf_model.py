"""Maximum-likelihood fit of modes to frequency responses: poles shared by all responses, residues of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dtrtrs

from shapegcode.errors import ArgumentError
from shapegcode.io.frequency_response import ComplexArray
from shapegcode.io.units import FloatArray

POWERS = {"displacement": 0, "velocity": 1, "acceleration": 2}
_LARGEST_STEP = 0.3  # largest change of ln omega and ln zeta in one iteration
_STEP_FLOOR = 1e-10
_RANK = 1e-12  # relative tolerance below which columns are dependent
_MIN_DAMPING, _MAX_DAMPING = 1e-6, 0.99


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines of one response over force."""

    s: ComplexArray  # (n,) rad/s, points of the Laplace plane: off the imaginary axis with an exponential window
    response: ComplexArray  # (n,) SI unit per N
    weight: FloatArray  # (n,) 1 over the standard deviation of the noise
    power: int  # power of s in a mode's numerator: 0 displacement, 1 velocity, 2 acceleration
    background: ComplexArray  # (n, k) columns (real factors) for modes outside the lines
    correlation: ComplexArray  # (m,) of the noise of two lines 0, 1, 2, ... apart
    complex_modes: bool = True  # residues are complex

    @property
    def omega(self) -> FloatArray:
        """Angular frequencies, rad/s."""
        return np.asarray(self.s.imag, dtype=np.float64)

    @cached_property
    def goal(self) -> FloatArray:
        """(2n,) weighted response."""
        values = self.weight * self.response
        return np.concatenate((values.real, values.imag))

    @cached_property
    def weighted_background(self) -> FloatArray:
        """(2n, k) weighted columns of the background (modes outside the lines)."""
        return self.weighted(self.background)

    def weighted(self, columns: ComplexArray) -> FloatArray:
        """(2n, k) weighted columns."""
        found = np.empty((2 * len(columns), columns.shape[1]))
        np.multiply(columns.real, self.weight[:, None], out=found[: len(columns)])
        np.multiply(columns.imag, self.weight[:, None], out=found[len(columns) :])
        return found

    def near(self, omega: float, reach: float, steps: float = 3.0) -> npt.NDArray[np.bool_]:
        """Mask of the lines within a distance of an angular frequency, at least *steps* line spacings."""
        return np.asarray(np.abs(self.omega - omega) <= max(reach, steps * float(self.omega[1] - self.omega[0])))

    @property
    def independent(self) -> float:
        """Fraction of the lines whose noise is statistically independent."""
        return 1.0 / float(1.0 + 2.0 * np.sum(np.abs(self.correlation[1:]) ** 2))


@dataclass(frozen=True, eq=False)
class ModalFit:
    """Fitted modes and their residuals."""

    omega: FloatArray  # (m,) rad/s
    zeta: FloatArray  # (m,)
    residues: ComplexArray  # (responses, m) 1/kg; the real part is 1/mass, the imaginary part is of a complex mode
    background: tuple[FloatArray, ...]  # factors of the columns, of each response
    left: tuple[ComplexArray, ...]  # (n,) weighted residual of each response
    jacobian: tuple[FloatArray, ...]  # (2n, columns + 2m) of each response
    complex_modes: bool

    @property
    def squares(self) -> float:
        """Sum of the weighted residuals."""
        return float(sum(np.sum(np.abs(part) ** 2) for part in self.left))

    @property
    def parameters(self) -> int:
        """Number of fitted parameters."""
        modes = len(self.omega)
        per_response = (2 if self.complex_modes else 1) * modes
        return 2 * modes + sum(per_response + len(part) for part in self.background)


def mode_columns(lines: Lines, omega: FloatArray, zeta: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Responses of modes of 1 kg, (n, m), and their derivatives with respect to ln omega and ln zeta."""
    s = lines.s[:, None]
    damping = 2.0 * zeta * omega * s
    below = s * s + damping + omega**2
    column = (s * s if lines.power == 2 else s**lines.power) / below
    shared = -column / below
    return column, shared * (damping + 2.0 * omega**2), shared * damping


@dataclass(frozen=True, eq=False)
class _Linearised:
    linear: list[FloatArray]
    jacobian: list[FloatArray]  # columns: linear factors, then ln omega and ln zeta of each mode
    projected: FloatArray  # projected off the columns of the linear factors
    residual: FloatArray
    squares: float


def _linearised(parts: Sequence[Lines], theta: FloatArray) -> _Linearised:
    complex_modes = parts[0].complex_modes
    omega, zeta = np.exp(theta[::2]), np.exp(theta[1::2])
    modes = len(omega)
    linear, jacobians, projected, residuals = [], [], [], []
    for lines in parts:
        column, to_omega, to_zeta = mode_columns(lines, omega, zeta)
        goal, blocks = lines.goal, [lines.weighted(column)]
        if complex_modes:  # second column per mode: first-degree numerator
            turn = lines.s[:, None] / omega
            blocks.append(lines.weighted(column * turn))
        columns = np.hstack([*blocks, lines.weighted_background])
        norms = np.maximum(np.sqrt(np.einsum("ij,ij->j", columns, columns)), 1e-300)
        basis, triangle = np.linalg.qr(columns / norms)
        factors = _solved(triangle, basis.T @ goal) / norms
        gain = factors[:modes] + (factors[modes : 2 * modes] * turn if complex_modes else 0.0)
        along: ComplexArray = to_omega * gain
        if complex_modes:
            along -= column * turn * factors[modes : 2 * modes]
        moved = np.empty((len(goal), 2 * modes))
        moved[:, ::2], moved[:, 1::2] = lines.weighted(along), lines.weighted(to_zeta * gain)
        linear.append(factors)
        jacobians.append(np.hstack((columns, moved)))
        projected.append(moved - basis @ (basis.T @ moved))
        residuals.append(goal - columns @ factors)
    residual = np.concatenate(residuals)
    return _Linearised(linear, jacobians, np.vstack(projected), residual, float(residual @ residual))


def _solved(triangle: FloatArray, right: FloatArray) -> FloatArray:
    size = np.abs(np.diag(triangle))
    if float(np.min(size)) > _RANK * float(np.max(size)):
        return np.asarray(dtrtrs(triangle, right)[0])
    return np.asarray(np.linalg.lstsq(triangle, right, rcond=_RANK)[0])


def fit_modes(
    parts: Sequence[Lines], starts: Sequence[tuple[float, float]], iterations: int, gain_floor: float
) -> ModalFit:
    """Fit modes to lines: sum over modes of residue s^q / (s² + 2 zeta omega s + omega²), and the background.

    Levenberg-Marquardt in ln omega and ln zeta with exact derivatives; everything linear is eliminated.

    Source: D. J. Ewins, Modal Testing, 2nd ed., ch. 4; variable projection: G. Golub and V. Pereyra, 2003.
    """
    theta, complex_modes = np.log(np.array(starts, dtype=np.float64)).ravel(), parts[0].complex_modes
    modes, samples = len(starts), 2 * sum(len(lines.s) for lines in parts)
    if samples <= 2 * modes + sum((1 + complex_modes) * modes + lines.background.shape[1] for lines in parts) + 1:
        raise ArgumentError(f"{samples // 2} lines are too few for {modes} modes")
    low = 0.3 * min(float(lines.omega[0]) for lines in parts)
    high = 3.0 * max(float(lines.omega[-1]) for lines in parts)
    bounds = np.log([low, high]), np.log([_MIN_DAMPING, _MAX_DAMPING])
    at, damping = _linearised(parts, theta), 1e-3
    for _ in range(iterations):
        gram = at.projected.T @ at.projected
        scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        scaled = gram / np.outer(scale, scale) + (damping + 1e-14) * np.eye(2 * modes)
        step = np.linalg.solve(scaled, at.projected.T @ at.residual / scale) / scale
        largest = float(np.max(np.abs(step)))
        if not np.isfinite(largest):
            break
        tried = theta + step * min(1.0, _LARGEST_STEP / max(largest, 1e-300))
        for index, (least, most) in enumerate(bounds):
            tried[index::2] = np.clip(tried[index::2], least, most)
        moved = float(np.max(np.abs(tried - theta)))
        following = _linearised(parts, tried)
        gained = at.squares - following.squares
        if gained >= -1e-13 * at.squares:
            theta, at, damping = tried, following, 0.1 * damping
        else:
            damping = max(10.0 * damping, 1e-6)
        if moved <= _STEP_FLOOR or (0.0 <= gained <= gain_floor * at.squares) or damping > 1e8:
            break
    omega, zeta = np.exp(theta[::2]), np.exp(theta[1::2])
    residues = [part[:modes] + (part[modes : 2 * modes] * 1j if complex_modes else 0.0) for part in at.linear]
    first = (2 if complex_modes else 1) * modes
    ends = np.cumsum([2 * len(lines.s) for lines in parts])[:-1]
    left = [part[: len(part) // 2] + 1j * part[len(part) // 2 :] for part in np.split(at.residual, ends)]
    return ModalFit(
        omega, zeta, np.array(residues, dtype=np.complex128), tuple(part[first:] for part in at.linear), tuple(left),
        tuple(at.jacobian), complex_modes,
    )  # fmt: skip
