"""What is fitted of frequency responses: their lines with weights, and how many of them are independent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter, uniform_filter1d

from shapegcode import _core
from shapegcode.errors import RecordError
from shapegcode.identification.frf_model import POWERS, FrfFit, FrfLines, fit_frf, mode_columns
from shapegcode.identification.model_search import Fit, Starts, starts_of
from shapegcode.io.frequency_response import FrequencyResponse

FloatArray = npt.NDArray[np.float64]

_STEPS, _QUICK_STEPS = 60, 15
#: Noise is taken as even over so many lines, and over this share of all at least.
_SMOOTH_LINES, _SMOOTH_SHARE = 31, 0.02
#: A line counts for no more than a noise of this share of the largest line would have it: no sensor is better.
_LEAST_NOISE = 1e-5
#: Lines beside the band asked for that are fitted along, as a share of its ends.
_BESIDE = 0.25
#: Of the lines, the lowest lies so many distances of two of them above 0, if what is below was left out.
_LEFT_OUT = 5.0
_IMPULSE_LINES = 4096
#: Squared third difference of white noise, over its variance: 1 + 9 + 9 + 1.
_THIRD_DIFFERENCE = 20.0


@dataclass(frozen=True, eq=False)
class FrfProblem:
    """Lines of frequency responses of one point, as a search wants them."""

    lines: FrfLines  # of all responses, one behind another
    counts: tuple[int, ...]  # lines of each response
    band_hz: tuple[float, float]  # modes are looked for in it
    resolution_hz: float  # usual distance of two lines
    white_share: float = 1.0  # of the lines, how many are independent
    noise_correlation: float = 0.0  # that of white noise

    @property
    def squares(self) -> float:
        """Of the weighted lines."""
        return float(np.sum(np.abs(self.lines.weight * self.lines.response) ** 2))

    @property
    def samples(self) -> int:
        """Real and imaginary parts together."""
        return 2 * len(self.lines.omega)

    @property
    def constants(self) -> int:
        """Parameters of a model without modes."""
        return int(self.lines.below) + int(self.lines.above)

    @property
    def duration_s(self) -> float:
        """Length of a record that tells as fine a resolution."""
        return 1.0 / self.resolution_hz

    @property
    def period_s(self) -> float:
        """Sampling period of a record that holds the highest line."""
        return float(np.pi / self.lines.omega.max())

    @property
    def chart_orders(self) -> int:
        """Number of modes that the lines are enough for."""
        even = int(self.lines.omega[: self.counts[0]].max() / (2.0 * np.pi * self.resolution_hz)) + 1
        return (min(even, _IMPULSE_LINES) - 8) // 8

    def fit(self, starts: Starts) -> FrfFit:
        """The best model near some modes."""
        return fit_frf(self.lines, starts, _STEPS)

    def fit_quickly(self, starts: Starts) -> FrfFit:
        """A model in a few steps."""
        return fit_frf(self.lines, starts, _QUICK_STEPS)

    def fit_left(self, starts: Starts, last: Fit | None) -> FrfFit:
        """A model in a few steps of what another one leaves."""
        left = replace(self.lines, response=self.left(last), below=False, above=False)
        return fit_frf(left, starts, _QUICK_STEPS)

    def left(self, last: Fit | None) -> npt.NDArray[np.complex128]:
        """What a model leaves of the lines."""
        if last is None:
            return self.lines.response
        return np.asarray(self.lines.response - np.concatenate(last.fitted), dtype=np.complex128)

    def peaks_left(self, last: Fit | None, most: int) -> list[float]:
        """Frequencies (rad/s) of the highest peaks within the band of what a model leaves, the highest first."""
        height = np.abs(self.lines.weight * self.left(last))
        low, high = (2.0 * np.pi * end for end in self.band_hz)
        height[(self.lines.omega < low) | (self.lines.omega > high)] = 0.0
        found: list[float] = []
        for index in np.argsort(height)[::-1]:
            omega = float(self.lines.omega[index])
            if height[index] <= 0.0 or len(found) == most:
                break
            if all(abs(omega - other) > 6.0 * np.pi * self.resolution_hz for other in found):
                found.append(omega)
        return found

    def poles(self, most: int) -> Sequence[npt.NDArray[np.complex128]]:
        """Discrete poles of models with 1 to `most` modes, from the impulse response that belongs to the lines."""
        count = self.counts[0]
        omega, response = self.lines.omega[:count], self.lines.response[:count]
        places = np.linspace(
            0.0, omega[-1], min(int(omega[-1] / (2.0 * np.pi * self.resolution_hz)) + 1, _IMPULSE_LINES)
        )
        mobility = response * (1j * omega) ** (1 - POWERS[self.lines.quantity])
        even = np.interp(places, omega, mobility.real, left=0.0) + 1j * np.interp(
            places, omega, mobility.imag, left=0.0
        )
        return _core.stabilisation_poles([np.fft.irfft(even)[: len(places)]], most)

    def rank(self, candidates: Starts, kept: int) -> Sequence[int]:
        """The candidates that are kept, and the one that explains most beside them."""
        omega, zeta = np.array(candidates).T
        columns = self.lines.weight[:, None] * mode_columns(self.lines, omega, zeta)[0]
        stacked = np.vstack((columns.real, columns.imag))
        goal = np.concatenate([(part(self.lines.weight * self.lines.response)) for part in (np.real, np.imag)])
        if kept:
            basis = np.linalg.qr(stacked[:, :kept])[0]
            goal = goal - basis @ (basis.T @ goal)
            stacked = stacked - basis @ (basis.T @ stacked)
        norm = np.sum(stacked**2, axis=0)
        gain = np.where(norm > 0.0, (goal @ stacked) ** 2 / np.maximum(norm, 1e-300), 0.0)
        gain[:kept] = -1.0
        return [*range(kept), int(np.argmax(gain))] if len(candidates) > kept else list(range(kept))

    def reweighted(self, fit: Fit) -> FrfProblem:
        """The same lines with the noise that a model leaves, smoothed, and the share of them that is independent."""
        left, ends = np.abs(self.left(fit)) ** 2, np.cumsum(self.counts)[:-1]
        parts = zip(np.split(left, ends), np.split(self.lines.omega, ends), strict=True)
        noise = np.concatenate([_smoothed(part, omega, self.lines.quantity) for part, omega in parts])
        weight = _weight(noise, self.lines)
        weighted = weight * self.left(fit)
        return replace(self, lines=replace(self.lines, weight=weight), white_share=_independent(weighted, self.counts))


def _smoothed(power: FloatArray, omega: FloatArray, quantity: str) -> FloatArray:
    """Running mean of a power over neighbouring lines, its peaks levelled by a median first.

    As that of an acceleration, whose noise is the most even: that of a displacement made of it falls by 1/f².
    """
    course = omega ** (2.0 * (2.0 - POWERS[quantity]))
    width = max(_SMOOTH_LINES, int(_SMOOTH_SHARE * len(power))) | 1
    level = median_filter(power * course, width, mode="nearest") / np.log(2.0)
    return np.asarray(uniform_filter1d(level, width, mode="nearest") / course, dtype=np.float64)


def _weight(noise: FloatArray, lines: FrfLines) -> FloatArray:
    # Of the acceleration: noise of a displacement made of it may exceed every mode at the lowest lines.
    course = lines.omega ** (2.0 - POWERS[lines.quantity])
    least = (_LEAST_NOISE * float(np.max(np.abs(lines.response * course))) / course) ** 2
    return np.asarray(1.0 / np.sqrt(np.maximum(noise, least)), dtype=np.float64)


def _independent(residual: npt.NDArray[np.complex128], counts: tuple[int, ...]) -> float:
    """Share of lines that tell something of their own, from the correlation of neighbours."""
    parts = np.split(residual, np.cumsum(counts)[:-1])
    power = sum(float(np.sum(np.abs(part) ** 2)) for part in parts)
    total = 1.0
    for lag in range(1, max(2, min(counts) // 4)):
        rho = sum(float(np.sum((part[lag:] * np.conj(part[:-lag])).real)) for part in parts) / max(power, 1e-300)
        if rho < 2.0 / np.sqrt(sum(counts)):
            break
        total += 2.0 * rho
    return 1.0 / total


def _measured_noise(each: FrequencyResponse) -> FloatArray:
    """Noise power of each line: from the coherence, else from how rough the neighbours are."""
    power = np.abs(each.response) ** 2
    omega = 2.0 * np.pi * each.frequency_hz
    if each.coherence is not None and np.any(each.coherence < 1.0):
        coherence = np.clip(each.coherence, 1e-3, 1.0)
        return _smoothed(power * (1.0 - coherence) / coherence, omega, each.quantity)
    if len(power) < 8:
        return np.ones(len(power))
    rough = np.abs(np.diff(each.response, 3)) ** 2 / _THIRD_DIFFERENCE
    return _smoothed(np.concatenate(([rough[0]], rough, [rough[-1]] * 2)), omega, each.quantity)


def frf_problem_of(
    responses: Sequence[FrequencyResponse], band_hz: tuple[float, float] | None
) -> tuple[FrfProblem, list[FrequencyResponse]]:
    """The lines of a fit, and the band to look in."""
    first = responses[0]
    for other in responses[1:]:
        for name in ("quantity", "axis"):
            if getattr(first, name) != getattr(other, name):
                raise RecordError(
                    f"{first.source}: {name} is {getattr(first, name)}; {other.source}: {getattr(other, name)}: "
                    "must be the same in all files"
                )
    used = list(responses)
    if band_hz is not None:
        lowest, highest = (float(end(each.frequency_hz[i] for each in responses)) for end, i in ((min, 0), (max, -1)))
        if not (band_hz[0] < band_hz[1] and band_hz[0] < highest and band_hz[1] > lowest):
            raise RecordError(
                f"band of {band_hz[0]:g} to {band_hz[1]:g} Hz: must ascend and lie within the lines, {lowest:g} to "
                f"{highest:g} Hz"
            )
        used = [_within(each, (1.0 - _BESIDE) * band_hz[0], (1.0 + _BESIDE) * band_hz[1]) for each in responses]
    frequency = np.concatenate([each.frequency_hz for each in used])
    resolution = max(each.resolution_hz for each in used)
    # Modes that the lines leave out below and above.
    below = bool(np.min(frequency) > _LEFT_OUT * resolution)
    lines = FrfLines(
        2.0 * np.pi * frequency,
        np.concatenate([each.response for each in used]),
        np.ones(len(frequency)),
        first.quantity,
        below,
        True,
    )
    noise = np.concatenate([_measured_noise(each) for each in used])
    lines = replace(lines, weight=_weight(noise, lines))
    band = (float(np.min(frequency)), float(np.max(frequency)))
    return FrfProblem(lines, tuple(len(each.frequency_hz) for each in used), band, resolution), used


def _within(each: FrequencyResponse, low_hz: float, high_hz: float) -> FrequencyResponse:
    inside = (each.frequency_hz >= low_hz) & (each.frequency_hz <= high_hz)
    coherence = None if each.coherence is None else each.coherence[inside]
    return replace(each, frequency_hz=each.frequency_hz[inside], response=each.response[inside], coherence=coherence)


def refit(problem: FrfProblem, fits: Sequence[Fit]) -> list[FrfFit]:
    """The same models under other weights."""
    return [problem.fit(starts_of(fit)) for fit in fits]
