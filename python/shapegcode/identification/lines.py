"""Lines of frequency responses: of impacts with an exponential window, of measured responses with noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft
from scipy.ndimage import median_filter, uniform_filter1d

from shapegcode.identification.checks import Usable
from shapegcode.identification.frf_model import POWERS, Lines
from shapegcode.io.frequency_response import ComplexArray, FrequencyResponse
from shapegcode.io.units import FloatArray

_END = 1e-2  # of the exponential window at the end of the record
_LEAD, _LAGS = 4, 64  # samples before a pulse
_QUIETEST = 1e-6  # least noise of a sensor, relative to the largest line
_LATE = 0.4  # a steady disturbance is searched after this fraction of the record
_STANDS_OUT = 8.0  # times the median of the spectrum there
_STEADY = (0.8, 1.25)  # range of the last quarter's amplitude over that of the quarter before
_MOST_STEADY = 12


def steady_sines(response: FloatArray, period_s: float) -> tuple[FloatArray, list[float]]:
    """Steady oscillations (hum, a pump) with their frequencies: equal in both halves of the record's late part."""
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
    chosen = [hertz for _, hertz in sorted(found, reverse=True)[:_MOST_STEADY]]
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
    starts: tuple[int, ...]  # first sample of each record
    count: int  # samples per record
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
    """Lines of all impacts, each from its pulse on; `applied_s`: time constant of a window in the responses.

    With the window exp(-t/tau) the response at jw equals the original one at jw + 1/tau: no damping is added.
    """
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
    plane = np.asarray(sigma + applied + 2j * np.pi * frequency[kept], dtype=np.complex128)
    ratio = np.sum(np.conj(force) * response, axis=0) / power
    nothing = np.zeros((len(power), 0), dtype=np.complex128)
    quantity = POWERS[usable[0].record.quantity]
    lines = Lines(plane, ratio, np.sqrt(power) / level, quantity, nothing, lags / lags[0])
    error = noise_n * np.sqrt(pulse) / np.sqrt(power)
    return Hits(lines, force, response, kept, tuple(starts), count, period, sigma, error)


#: Noise counts as constant over this many lines, and at least over this fraction of all.
_SMOOTH_LINES, _SMOOTH_SHARE = 31, 0.02
_MIN_NOISE = 1e-5  # least assumed noise relative to the largest line, which limits weights
_THIRD_DIFFERENCE = 20.0  # squared third difference of white noise, over its variance: 1 + 9 + 9 + 1


def measured_lines(each: FrequencyResponse, applied_s: float | None) -> Lines:
    """Lines of a measured response, weighted by the roughness of neighbouring lines and by coherence."""
    omega = 2.0 * np.pi * each.frequency_hz
    power = np.abs(each.response) ** 2
    quantity = POWERS[each.quantity]
    course = omega ** (2.0 * (2.0 - quantity))  # noise is white as an acceleration
    rough = np.abs(np.diff(each.response, 3)) ** 2 / _THIRD_DIFFERENCE
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
    """The same lines, weighted by the noise power of each line."""
    # As acceleration: noise of a displacement integrated from it may exceed all modes at the lowest lines.
    course = lines.omega ** (2.0 - lines.power)
    least = (_MIN_NOISE * float(np.max(np.abs(lines.response * course))) / course) ** 2
    return replace(lines, weight=np.asarray(1.0 / np.sqrt(np.maximum(noise, least)), dtype=np.float64))


def smoothed(power: FloatArray) -> FloatArray:
    """Running mean of a power over neighbouring lines, after a median that removes its peaks."""
    width = max(_SMOOTH_LINES, int(_SMOOTH_SHARE * len(power))) | 1
    level = median_filter(power, width, mode="nearest") / np.log(2.0)
    return np.asarray(uniform_filter1d(level, width, mode="nearest"), dtype=np.float64)


def correlation_of(left: Sequence[ComplexArray]) -> ComplexArray:
    """Correlation of the residual between lines 0, 1, 2, ... apart, if it is significant."""
    power = sum(float(np.sum(np.abs(part) ** 2)) for part in left)
    count = sum(len(part) for part in left)
    found = [1.0 + 0.0j]
    for lag in range(1, max(2, min(len(part) for part in left) // 4)):
        rho = sum(complex(np.sum(part[lag:] * np.conj(part[:-lag]))) for part in left) / max(power, 1e-300)
        if abs(rho) < 2.0 / np.sqrt(count):
            break
        found.append(rho)
    return np.array(found, dtype=np.complex128)
