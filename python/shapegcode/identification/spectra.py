"""Spectra: of taps and decays (FRF, peaks, envelopes), and of a command and its response, part by part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy import fft, signal
from scipy.ndimage import median_filter, uniform_filter1d

from shapegcode.errors import RecordError
from shapegcode.io.record import ComplexArray, FrequencyResponse, Record
from shapegcode.io.units import FloatArray

_PEAK_SHARE, _PEAK_RISES = 0.01, 2.0  # relative to the largest (-40 dB); factor of a peak over its surroundings
_PEAK_NOISE = 6.0  # Least height in noise levels, estimated by the spectrum's median
_MAX_PEAKS = 8
_PADDING = 4  # Zero padding of a decay's spectrum: points per sample
_BAND_SHARE = 0.25  # Half width of a mode's band relative to its frequency, at most half way to the next
_BAND_ORDER = 2


def frf(records: Sequence[Record]) -> FrequencyResponse:
    """Frequency response above 0 Hz, averaged over taps (H1); coherence None for a single tap (always 1)."""
    if not records:
        raise RecordError("no record: an FRF needs at least one tap")
    period = records[0].period_s
    count = fft.next_fast_len(max(len(record.response) for record in records), real=True)
    forces, responses = [], []
    for record in records:
        if record.force_n is None:
            raise RecordError(f"{record.source}: no force: an FRF needs it")
        if not np.isclose(record.period_s, period, rtol=1e-5):
            raise RecordError(f"{record.source}: a sample every {record.period_s:g} s, the first has {period:g} s")
        forces.append(fft.rfft(record.force_n, count)[1:] * period)
        responses.append(fft.rfft(record.response, count)[1:] * period)
    force, response = np.array(forces), np.array(responses)
    cross = np.mean(np.conj(force) * response, axis=0)
    power, tiny = np.mean(np.abs(force) ** 2, axis=0), np.finfo(np.float64).tiny
    coherence = None
    if len(records) > 1:
        both = power * np.mean(np.abs(response) ** 2, axis=0)
        coherence = np.minimum(np.abs(cross) ** 2 / np.maximum(both, tiny), 1.0)
    ratio = np.asarray(cross / np.maximum(power, tiny), dtype=np.complex128)
    hertz = np.asarray(fft.rfftfreq(count, period)[1:], dtype=np.float64)
    return FrequencyResponse(records[0].source, hertz, ratio, records[0].quantity, coherence)


@dataclass(frozen=True)
class Peak:
    """A peak of a spectrum."""

    frequency_hz: float  # of its top, interpolated between points of the spectrum
    amplitude: float  # at the top
    label: str  # label in a picture, such as "46.0 Hz"


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Amplitude spectrum of a decay."""

    frequency_hz: FloatArray  # (m,), from 0 to half the sampling rate
    amplitude: FloatArray  # (m,) in the unit of the response: amplitude of an equivalent steady sine
    peaks: tuple[Peak, ...]  # the largest first


def decay_spectrum(record: Record) -> Spectrum:
    """Amplitude spectrum of the response of a decay with half a Hann window, 1 at the first sample, and its peaks."""
    response = record.response - np.mean(record.response)
    samples = len(response)
    window = 0.5 * (1.0 + np.cos(np.pi * np.arange(samples) / samples))
    count = fft.next_fast_len(_PADDING * samples, real=True)
    amplitude = np.abs(fft.rfft(response * window, count)) * 2.0 / float(np.sum(window))
    frequency = np.asarray(fft.rfftfreq(count, record.period_s), dtype=np.float64)
    peaks = _peaks(frequency, amplitude, 1.0 / (samples * record.period_s))
    return Spectrum(frequency, np.asarray(amplitude, dtype=np.float64), peaks)


def _peaks(frequency: FloatArray, amplitude: FloatArray, resolution_hz: float) -> tuple[Peak, ...]:
    level = np.log(np.maximum(amplitude, np.finfo(np.float64).tiny))
    floor = max(_PEAK_SHARE * float(np.max(amplitude)), _PEAK_NOISE * float(np.median(amplitude)))
    if not floor > 0.0:
        return ()
    found, _ = signal.find_peaks(level, height=np.log(floor), prominence=np.log(_PEAK_RISES))
    step = float(frequency[1])
    decimals = min(max(0, int(np.ceil(-np.log10(0.3 * resolution_hz)))), 2)
    peaks = []
    for at in found:
        left, top, right = level[at - 1], level[at], level[at + 1]
        shift = 0.5 * (left - right) / (left - 2.0 * top + right)
        value = float(frequency[at] + shift * step)
        height = float(np.exp(top - 0.25 * (left - right) * shift))
        peaks.append(Peak(value, height, f"{value:.{decimals}f} Hz"))
    peaks.sort(key=lambda peak: -peak.amplitude)
    return tuple(peaks[:_MAX_PEAKS])


def mode_envelopes(record: Record, frequencies_hz: Sequence[float]) -> list[FloatArray]:
    """Envelope of each mode in its own band: forward-backward Butterworth filter, then Hilbert transform."""
    half, response = 0.5 / record.period_s, record.response - np.mean(record.response)
    found = []
    for frequency in frequencies_hz:
        if not 0.0 < frequency < half:
            raise RecordError(f"{record.source}: mode at {frequency:g} Hz: must lie between 0 and {half:g} Hz")
        below = [each for each in frequencies_hz if each < frequency]
        above = [each for each in frequencies_hz if each > frequency]
        low = max([(1.0 - _BAND_SHARE) * frequency, *(0.5 * (each + frequency) for each in below)])
        high = min([(1.0 + _BAND_SHARE) * frequency, *(0.5 * (each + frequency) for each in above), 0.99 * half])
        sections = signal.butter(_BAND_ORDER, (low, high), "bandpass", fs=1.0 / record.period_s, output="sos")
        passed = signal.sosfiltfilt(sections, response)
        analytic = signal.hilbert(passed, fft.next_fast_len(2 * len(passed)))[: len(passed)]
        found.append(np.asarray(np.abs(analytic), dtype=np.float64))
    return found


# --- command and response, part by part between rests -----------------------------------------------------------------

REST_S = 0.5  # least rest of a command between two parts
_EXCITED = 0.2  # least amplitude of a used line, relative to the median of the command's spectrum
_BESIDE = 0.3  # least power relative to neighbouring lines: weaker lines show noise
_SMOOTH_LINES, _COHERENT = 31, 0.9


@dataclass(frozen=True, eq=False)
class Spectra:
    """Spectra of each part, at the same lines and on the program's time."""

    hertz: FloatArray  # (n,)
    command: ComplexArray  # (parts, n)
    response: ComplexArray  # (parts, n)

    @property
    def turn(self) -> ComplexArray:
        """(n,) i omega."""
        return np.asarray(2j * np.pi * self.hertz)

    @cached_property
    def power(self) -> FloatArray:
        """Power of the command, (n,)."""
        return np.asarray(np.sum(np.abs(self.command) ** 2, axis=0), dtype=np.float64)

    def late(self, lags_s: FloatArray) -> Spectra:
        """Copy with the response of each part advanced by its lag."""
        return replace(self, response=self.response * np.exp(self.turn * lags_s[:, None]))

    def of(self, rows: npt.NDArray[np.intp]) -> Spectra:
        """Select parts."""
        return replace(self, command=self.command[rows], response=self.response[rows])

    def ratio(self) -> ComplexArray:
        """Response/command by least squares over the parts, (n,)."""
        return np.asarray(np.sum(np.conj(self.command) * self.response, axis=0) / np.maximum(self.power, 1e-300))

    def in_twos(self, rows: npt.NDArray[np.intp]) -> Spectra:
        """Sums of the parts 0 and 1, 2 and 3, ...: ringing of one part in the next is then within one window."""
        first = [np.flatnonzero(rows // 2 == pair) for pair in np.unique(rows // 2)]
        return replace(
            self,
            command=np.array([self.command[each].sum(axis=0) for each in first]),
            response=np.array([self.response[each].sum(axis=0) for each in first]),
        )

    def coherent(self) -> tuple[npt.NDArray[np.bool_], FloatArray]:
        """Excited lines from the first to the last on which the parts agree, and coherence of all."""
        ratio, power = self.ratio(), self.power
        left = np.sum(np.abs(self.response - ratio * self.command) ** 2, axis=0) / max(len(self.command) - 1, 1)
        noise = uniform_filter1d(left, _SMOOTH_LINES) / np.maximum(power, 1e-300)
        size = np.abs(ratio) ** 2
        coherence = np.asarray(size / (size + noise + 1e-300), dtype=np.float64)
        used = (power > _EXCITED**2 * np.median(power)) & (power > _BESIDE * median_filter(power, _SMOOTH_LINES))
        good = np.flatnonzero(used & (uniform_filter1d(coherence, _SMOOTH_LINES) > _COHERENT))
        inside = np.zeros(len(used), dtype=np.bool_)
        if len(good):
            inside[good[0] : good[-1] + 1] = True
        return used & inside, coherence


def transforms(parts: list[FloatArray], begins_s: FloatArray, period_s: float, hertz: FloatArray) -> ComplexArray:
    """Fourier sum over each part, values times exp(-i omega t), at evenly spaced frequencies."""
    values = np.zeros((len(parts), max(1, *(len(each) for each in parts))))
    for row, part in zip(values, parts, strict=True):
        row[: len(part)] = part
    turn = -2j * np.pi * period_s
    lines = signal.czt(values, len(hertz), np.exp(turn * (hertz[1] - hertz[0])), np.exp(-turn * hertz[0]), axis=-1)
    return np.asarray(lines * np.exp(-2j * np.pi * hertz * begins_s[:, None]), dtype=np.complex128)


def moving_parts(x_mm: FloatArray, period_s: float) -> list[tuple[int, int]]:
    """First and last + 1 sample of each part of a motion between rests of half a second or more."""
    rows = np.flatnonzero(np.diff(x_mm))
    if not len(rows):
        return []
    cuts = np.flatnonzero(np.diff(rows) * period_s > REST_S)
    return [
        (int(rows[first]), int(rows[last]) + 2)
        for first, last in zip([0, *(cuts + 1)], [*cuts, len(rows) - 1], strict=True)
    ]
