"""Lines of frequency responses, measured or from impacts, with their noise; maximum-likelihood fit of modes to them.

All responses share the poles; each has its own residues.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy import fft
from scipy.linalg.lapack import dtrtrs
from scipy.ndimage import median_filter, uniform_filter1d

from shapegcode.errors import ArgumentError
from shapegcode.identification.checks import Usable
from shapegcode.io.record import ComplexArray, FrequencyResponse
from shapegcode.io.units import FloatArray

POWERS = {"displacement": 0, "velocity": 1, "acceleration": 2}
_LARGEST_STEP = 0.3  # largest change of ln omega and ln zeta in one iteration
_RANK = 1e-12  # relative tolerance below which columns are dependent
_MIN_DAMPING, _MAX_DAMPING = 1e-6, 0.99


@dataclass(frozen=True, eq=False)
class Lines:
    """Spectral lines of one frequency response (response over force), with their noise."""

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
        """(2n, k) columns times the weights of the lines, real parts above imaginary ones."""
        found = np.empty((2 * len(columns), columns.shape[1]))
        np.multiply(columns.real, self.weight[:, None], out=found[: len(columns)])
        np.multiply(columns.imag, self.weight[:, None], out=found[len(columns) :])
        return found

    def near(self, omega: float, reach: float, steps: float = 3.0) -> npt.NDArray[np.bool_]:
        """Mask of the lines within *reach* of an angular frequency; if *steps* line spacings are more, within these."""
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
        """Sum of the squares of the weighted residuals."""
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
        if moved <= 1e-10 or (0.0 <= gained <= gain_floor * at.squares) or damping > 1e8:
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


_END = 1e-2  # value of the exponential window at the end of the record
_LEAD, _LAGS = 4, 64  # samples used before a pulse; lags of the correlation between lines
_QUIETEST = 1e-6  # least noise of a sensor, relative to the largest line
_LATE = 0.4  # a steady disturbance is searched after this fraction of the record
_STANDS_OUT = 8.0  # times the median of the spectrum there
_STEADY = (0.8, 1.25)  # range of the second half's amplitude over that of the first half, both after `_LATE`


def steady_sines(response: FloatArray, period_s: float) -> tuple[FloatArray, list[float]]:
    """Sum of the oscillations (hum, a pump) that do not decay in the record's late part, and their frequencies, Hz."""
    samples = len(response)
    half = int(samples * (1.0 - _LATE)) // 2
    first, second = response[samples - 2 * half : samples - half], response[samples - half :]
    window = np.hanning(half)
    window /= window.sum() / 2.0
    spectra = [np.fft.rfft((part - part.mean()) * window) for part in (first, second)]
    height = np.abs(spectra[1])
    step = 1.0 / (half * period_s)
    wide = median_filter(height, 41, mode="nearest")
    tops = np.flatnonzero((height[1:-1] >= height[:-2]) & (height[1:-1] > height[2:])) + 1
    found = []
    for top in tops[height[tops] > _STANDS_OUT * wide[tops]]:
        if top < 2 or not _STEADY[0] < height[top] / max(abs(spectra[0][top]), 1e-300) < _STEADY[1]:
            continue
        # From half to half the phase advances by whole cycles and a remainder.
        turn = np.angle(spectra[1][top] / spectra[0][top] * np.exp(-2j * np.pi * top)) / (2.0 * np.pi)
        if abs(turn) < 0.45:
            found.append((float(height[top]), float((top + turn) * step)))
    chosen = [hertz for _, hertz in sorted(found, reverse=True)[:12]]
    if not chosen:
        return np.zeros(samples), []
    time_s = np.arange(samples) * period_s
    turns = [2.0 * np.pi * hertz * time_s for hertz in chosen]
    waves = [wave(turn) for turn in turns for wave in (np.cos, np.sin)]
    stacked = np.array([np.ones(samples), time_s, *waves]).T
    late = slice(samples - 2 * half, samples)
    factors = np.linalg.lstsq(stacked[late], response[late], rcond=None)[0]
    return np.asarray(stacked[:, 2:] @ factors[2:], dtype=np.float64), chosen


@dataclass(frozen=True, eq=False)
class Hits:
    """Spectra of impacts with a common window."""

    lines: Lines  # of all impacts together (H1)
    force: ComplexArray  # (impacts, n)
    response: ComplexArray  # (impacts, n)
    kept: slice  # used lines of the transform
    starts: tuple[int, ...]  # first used sample of each record
    count: int  # used samples of each record
    period_s: float
    sigma: float  # 1/s: the window of the responses is exp(-sigma t)
    gain_error: FloatArray  # (n,) relative standard error of the force's spectrum: noise of its channel

    def in_time(self, lines: ComplexArray) -> FloatArray:
        """(hits, count) samples from spectra of impacts, with the window divided out."""
        whole = np.zeros((len(lines), self.count // 2 + 1), dtype=np.complex128)
        whole[:, self.kept] = lines
        grown = np.exp(self.sigma * self.period_s * np.arange(self.count))
        return np.asarray(fft.irfft(whole, self.count, axis=1) * grown, dtype=np.float64)


def hits_of(
    usable: Sequence[Usable], responses: Sequence[FloatArray], low_hz: float, high_hz: float, applied_s: float | None
) -> Hits:
    """Lines of all impacts, each from 4 samples before its pulse; `applied_s`: time constant of the window."""
    period = usable[0].record.period_s
    starts = [max(0, each.hit.first - _LEAD) if each.hit else 0 for each in usable]
    count = min(len(response) - start for response, start in zip(responses, starts, strict=True))
    sigma = -np.log(_END) / (count * period)
    applied = 0.0 if applied_s is None else 1.0 / applied_s
    window = np.exp(-sigma * period * np.arange(count))
    frequency = np.fft.rfftfreq(count, period)
    kept = slice(int(np.searchsorted(frequency, low_hz)), int(np.searchsorted(frequency, high_hz, "right")))

    def transformed(samples: Sequence[FloatArray], along: FloatArray) -> ComplexArray:
        cuts = [values[start : start + count] * along for values, start in zip(samples, starts, strict=True)]
        return np.asarray(fft.rfft(np.array(cuts), axis=1)[:, kept], dtype=np.complex128)

    whole = window * np.exp(-applied * period * np.arange(count))
    force = transformed([np.asarray(each.record.force_n) for each in usable], whole)
    response = transformed(responses, window)
    power = np.sum(np.abs(force) ** 2, axis=0)
    noise = np.mean([(each.response_noise or 0.0) ** 2 for each in usable]) * np.sum(window**2)
    level = max(float(np.sqrt(noise)), _QUIETEST * float(np.max(np.abs(response))))
    lags = fft.fft(window**2)[:_LAGS]
    pulse = np.mean([np.count_nonzero(np.asarray(each.record.force_n)) for each in usable])
    noise_n = np.sqrt(np.mean([(each.force_noise_n or 0.0) ** 2 for each in usable]))
    # With the window exp(-t/tau) the response at jw equals the original one at jw + 1/tau: no damping is added.
    plane = np.asarray(sigma + applied + 2j * np.pi * frequency[kept], dtype=np.complex128)
    ratio = np.sum(np.conj(force) * response, axis=0) / power
    nothing = np.zeros((len(power), 0), dtype=np.complex128)
    quantity = POWERS[usable[0].record.quantity]
    lines = Lines(plane, ratio, np.sqrt(power) / level, quantity, nothing, lags / lags[0])
    error = noise_n * np.sqrt(pulse) / np.sqrt(power)
    return Hits(lines, force, response, kept, tuple(starts), count, period, sigma, error)


def measured_lines(each: FrequencyResponse, applied_s: float | None) -> Lines:
    """Lines of a measured response, weighted by the roughness of neighbouring lines and by coherence."""
    omega = 2.0 * np.pi * each.frequency_hz
    power = np.abs(each.response) ** 2
    quantity = POWERS[each.quantity]
    course = omega ** (2.0 * (2.0 - quantity))  # noise is white as an acceleration
    rough = np.abs(np.diff(each.response, 3)) ** 2 / 20.0  # of white noise: 1 + 9 + 9 + 1 times its variance
    noise = smoothed(np.concatenate(([rough[0]], rough, [rough[-1]] * 2)) * course) / course
    if each.coherence is not None and np.any(each.coherence < 1.0):
        coherence = np.clip(each.coherence, 1e-3, 1.0)
        # Coherence may understate the noise of neighbouring lines, and noise would be fitted as modes.
        noise = np.maximum(noise, power * smoothed((1.0 - coherence) / coherence))
    applied = 0.0 if applied_s is None else 1.0 / applied_s
    plane = np.asarray(applied + 1j * omega, dtype=np.complex128)
    nothing, alone = np.zeros((len(omega), 0), dtype=np.complex128), np.ones(1, dtype=np.complex128)
    return weighted(Lines(plane, each.response, np.ones(len(omega)), quantity, nothing, alone), noise)


def weighted(lines: Lines, noise: FloatArray) -> Lines:
    """The same lines with weights 1/sqrt(noise power); noise below 1e-5 of the largest line is raised to that."""
    # As acceleration: noise of a displacement integrated from it may exceed all modes at the lowest lines.
    course = lines.omega ** (2.0 - lines.power)
    least = (1e-5 * float(np.max(np.abs(lines.response * course))) / course) ** 2
    return replace(lines, weight=np.asarray(1.0 / np.sqrt(np.maximum(noise, least)), dtype=np.float64))


def smoothed(power: FloatArray) -> FloatArray:
    """Running mean of a power over 31 lines, or 2 % of all if that is more, after a median that removes its peaks."""
    width = max(31, int(0.02 * len(power))) | 1
    level = median_filter(power, width, mode="nearest") / np.log(2.0)
    return np.asarray(uniform_filter1d(level, width, mode="nearest"), dtype=np.float64)


def correlation_of(left: Sequence[ComplexArray]) -> ComplexArray:
    """Correlation of the residual between lines 0, 1, 2, ... apart, until it is insignificant."""
    power = sum(float(np.sum(np.abs(part) ** 2)) for part in left)
    count = sum(len(part) for part in left)
    found = [1.0 + 0.0j]
    for lag in range(1, max(2, min(len(part) for part in left) // 4)):
        rho = sum(complex(np.sum(part[lag:] * np.conj(part[:-lag]))) for part in left) / max(power, 1e-300)
        if abs(rho) < 2.0 / np.sqrt(count):
            break
        found.append(rho)
    return np.array(found, dtype=np.complex128)
