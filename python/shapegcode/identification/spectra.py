"""Spectra of taps and decays: averaged FRF with coherence, peaks with labels, envelopes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft, signal

from shapegcode.errors import RecordError
from shapegcode.io.frequency_response import FrequencyResponse
from shapegcode.io.record import Record
from shapegcode.io.units import FloatArray

_PEAK_SHARE = 0.01  # A peak counts above this share of the largest (-40 dB)
_PEAK_RISES = 2.0  # ... and if it stands out of its surroundings by this factor
_PEAK_NOISE = 6.0  # So many standard noise levels, of which the spectrum's median is a measure
_MAX_PEAKS = 8
_PADDING = 4  # The spectrum of a decay is drawn from so many times as many points as there are samples
#: A mode's band reaches this share of its frequency to either side, and at most half way to the next mode.
_BAND_SHARE = 0.25
_BAND_ORDER = 2


def frf(records: Sequence[Record]) -> FrequencyResponse:
    """Frequency response above 0 Hz, averaged over taps (H1); coherence: None of one tap, which has always 1."""
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

    frequency_hz: float  # of its top, between the points of the spectrum
    amplitude: float  # there
    label: str  # for the picture, such as "46.0 Hz"


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Amplitude spectrum of a decay."""

    frequency_hz: FloatArray  # (m,), from 0 to half the sampling rate
    amplitude: FloatArray  # (m,) in the unit of the response: the amplitude of a steady sine that would give the same
    peaks: tuple[Peak, ...]  # the largest first


def decay_spectrum(record: Record) -> Spectrum:
    """Amplitude spectrum of the response of a decay behind half a Hann window, 1 at its first sample, and its peaks."""
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


def _envelope(record: Record, low_hz: float, high_hz: float) -> FloatArray:
    """(n,) Envelope in a band: a Butterworth filter run both ways (order 4), then the Hilbert transform."""
    response = record.response - np.mean(record.response)
    sections = signal.butter(_BAND_ORDER, (low_hz, high_hz), "bandpass", fs=1.0 / record.period_s, output="sos")
    response = np.asarray(signal.sosfiltfilt(sections, response), dtype=np.float64)
    analytic = signal.hilbert(response, fft.next_fast_len(2 * len(response)))[: len(response)]
    return np.asarray(np.abs(analytic), dtype=np.float64)


def mode_envelopes(record: Record, frequencies_hz: Sequence[float]) -> list[FloatArray]:
    """The envelope of each mode in a band of its own: a quarter to either side, at most half way to the next mode."""
    half = 0.5 / record.period_s
    found = []
    for frequency in frequencies_hz:
        if not 0.0 < frequency < half:
            raise RecordError(f"{record.source}: mode at {frequency:g} Hz: must lie between 0 and {half:g} Hz")
        below = [each for each in frequencies_hz if each < frequency]
        above = [each for each in frequencies_hz if each > frequency]
        low = max([(1.0 - _BAND_SHARE) * frequency, *(0.5 * (each + frequency) for each in below)])
        high = min([(1.0 + _BAND_SHARE) * frequency, *(0.5 * (each + frequency) for each in above), 0.99 * half])
        found.append(_envelope(record, low, high))
    return found
