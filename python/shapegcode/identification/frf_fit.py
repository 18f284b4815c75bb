"""Modes of a frequency response without its time record, each with its 95 % interval, or the reason why not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter, uniform_filter1d

from shapegcode import _core
from shapegcode.errors import RecordError
from shapegcode.identification.frf_model import POWERS, FrfFit, FrfLines, fit_frf, mode_columns
from shapegcode.identification.model_search import (
    PEAKS,
    Doubts,
    Fit,
    Search,
    Sought,
    Starts,
    estimates_of,
    evidence_of,
    judged_modes,
    rival_of,
    search,
    stabilisation_chart,
    starts_of,
)
from shapegcode.identification.result import Identification, IdentifiedMode, by_support
from shapegcode.io.frequency_response import FrequencyResponse
from shapegcode.io.record import FloatArray

#: A resonance narrower than so many distances of two lines tells its damping by its window, not by its structure.
_MIN_WIDTH = 1.0
_ROUNDS = 2  # of weights taken from what the model leaves


def find_frf_modes(responses: Sequence[FrequencyResponse], files: tuple[str, ...], sought: Sought) -> Identification:
    """Find the modes that frequency responses of the same point support; see `identify.identify`."""
    problem, used = frf_problem_of(responses, sought.band_hz)
    problem, models = _searched(problem, sought)
    turned: list[str] = []
    order = sought.modes or models.order
    chosen = models.fits[order - 1] if 0 < order <= len(models.fits) else None
    if isinstance(chosen, FrfFit) and bool(np.all(chosen.inverse_mass < 0.0)):
        turned.append(
            f"{responses[0].source}: every mode goes against the push of the hammer: the sign is turned, as for a "
            "sensor at the same point that points the other way"
        )
        opposite = [replace(each, response=-each.response) for each in responses]
        problem, used = frf_problem_of(opposite, sought.band_hz)
        problem, models = _searched(problem, sought)
    order = sought.order(models)
    notes = list(dict.fromkeys(note for each in responses for note in each.notes))
    notes.append(
        "a frequency response no longer tells overload, double hits or windows: an exponential window adds its damping"
    )
    fit = models.fits[order - 1] if order else None
    left = problem.left(fit)
    doubts = Doubts(
        limit_percent=sought.accepted_percent,
        band_hz=sought.band_hz or problem.band_hz,
        record_s=problem.duration_s,
        rival=rival_of(order, models.fits, problem.white_share),
    )
    found = [] if fit is None else estimates_of(fit, (), white_share=problem.white_share)
    found = [_if_wide(mode, problem.resolution_hz) for mode in judged_modes(found, doubts)]
    fitted = problem.lines.response - left if fit is not None else np.zeros_like(left)
    return Identification(
        files=files,
        **by_support(found),
        order=order,
        evidence=dict(enumerate(models.evidence)),
        fit_percent=0.0 if fit is None else 100.0 * (1.0 - float(np.sqrt(fit.sum_of_squares / problem.squares))),
        noise_rms=float(np.sqrt(np.mean(np.abs(left) ** 2))),
        warnings=(*dict.fromkeys(warning for each in responses for warning in each.warnings), *turned),
        notes=tuple(notes),
        responses=tuple(used),
        chart=stabilisation_chart(problem),
        fitted_lines=tuple(np.split(fitted, np.cumsum(problem.counts)[:-1])),
    )


def _searched(problem: FrfProblem, sought: Sought) -> tuple[FrfProblem, Search]:
    """Models of growing order; then the noise is known from what they leave, and they are fitted and judged anew."""
    models = search(problem, sought)
    for _ in range(_ROUNDS):
        if not models.fits:
            break
        problem = problem.reweighted(models.fits[max(models.order, 1) - 1])
        fits = tuple(problem.fit(starts_of(fit)) for fit in models.fits)
        models = Search(fits, tuple(evidence_of(problem, each) for each in (None, *fits)))
    return problem, models


def _if_wide(mode: IdentifiedMode, resolution_hz: float) -> IdentifiedMode:
    """The mode, refused where lines so far apart do not tell the damping."""
    width = 2.0 * mode.damping_ratio.value * mode.frequency_hz.value
    if width >= _MIN_WIDTH * resolution_hz:
        return mode
    why = (
        f"its half-power width of {width:.3g} Hz is less than the {resolution_hz:.3g} Hz between two lines: window and "
        "length of the record make such a peak; needed is a finer resolution, or the time record"
    )
    return replace(mode, refusal=why)


_STEPS, _QUICK_STEPS = 60, 15
#: Noise is taken as even over so many lines, and over this share of all at least.
_SMOOTH_LINES, _SMOOTH_SHARE = 31, 0.02
#: A line counts for no more than a noise of this share of the largest line would have it: no sensor is better.
_MIN_NOISE = 1e-5
_BESIDE = 0.25  # Lines beside the band asked for that are fitted along, as a share of its ends
_LEFT_OUT = 5.0  # Of the lines, the lowest lies so many distances of two of them above 0, if what is below was left out
_IMPULSE_LINES = 4096
_THIRD_DIFFERENCE = 20.0  # Squared third difference of white noise, over its variance: 1 + 9 + 9 + 1


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

    def peaks_left(self, last: Fit | None) -> list[float]:
        """Frequencies (rad/s) of the highest peaks within the band of what a model leaves, the highest first."""
        height = np.abs(self.lines.weight * self.left(last))
        low, high = (2.0 * np.pi * end for end in self.band_hz)
        height[(self.lines.omega < low) | (self.lines.omega > high)] = 0.0
        found: list[float] = []
        for index in np.argsort(height)[::-1]:
            omega = float(self.lines.omega[index])
            if height[index] <= 0.0 or len(found) == PEAKS:
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
    """Running mean of a power over neighbouring lines, as an acceleration's, its peaks levelled by a median first."""
    course = omega ** (2.0 * (2.0 - POWERS[quantity]))
    width = max(_SMOOTH_LINES, int(_SMOOTH_SHARE * len(power))) | 1
    level = median_filter(power * course, width, mode="nearest") / np.log(2.0)
    return np.asarray(uniform_filter1d(level, width, mode="nearest") / course, dtype=np.float64)


def _weight(noise: FloatArray, lines: FrfLines) -> FloatArray:
    # Of the acceleration: noise of a displacement made of it may exceed every mode at the lowest lines.
    course = lines.omega ** (2.0 - POWERS[lines.quantity])
    least = (_MIN_NOISE * float(np.max(np.abs(lines.response * course))) / course) ** 2
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
