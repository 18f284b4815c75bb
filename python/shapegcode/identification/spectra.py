"""Spectra of taps and decays: averaged FRF, coherence, auto spectra, peaks with labels, envelopes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import fft, signal

from shapegcode.errors import RecordError
from shapegcode.io.record import FloatArray, Record

ComplexArray = npt.NDArray[np.complex128]

#: A peak counts above this share of the largest (-40 dB) ...
_PEAK_SHARE = 0.01
#: ... and if it stands out of its surroundings by this factor.
_PEAK_RISES = 2.0
#: So many standard noise levels, of which the spectrum's median is a measure.
_PEAK_NOISE = 6.0
_MOST_PEAKS = 8
#: The spectrum of a decay is drawn from so many times as many points as there are samples.
_PADDING = 4
#: A mode's band reaches this share of its frequency to either side, and at most half way to the next mode.
_BAND_SHARE = 0.25
_BAND_ORDER = 2


@dataclass(frozen=True, eq=False)
class Frf:
    """Frequency response of several taps of the same point."""

    frequency_hz: FloatArray  # (m,), from 0 to half the sampling rate
    response: ComplexArray  # (m,) complex, H1: response over force, in the unit of the response per N
    coherence: FloatArray | None  # (m,) 0 to 1; None: one tap, whose coherence is 1 whatever it holds
    force_spectrum: FloatArray  # (m,) energy spectral density of the force, mean of the taps, (N·s)²
    response_spectrum: FloatArray  # (m,) of the response, (unit·s)²
    taps: int  # number of taps


def frf(records: Sequence[Record]) -> Frf:
    """Averaged frequency response, H1 = sum(conj(F) X) / sum(|F|²): noise of the response averages out.

    No window beside the one of the force that `checks.prepare` applied; a response that has not decayed at the end of
    its record leaks. Records of different length are filled up with zeros.
    """
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
        forces.append(fft.rfft(record.force_n, count) * period)
        responses.append(fft.rfft(record.response, count) * period)
    force, response = np.array(forces), np.array(responses)
    cross = np.mean(np.conj(force) * response, axis=0)
    force_power = np.mean(np.abs(force) ** 2, axis=0)
    response_power = np.mean(np.abs(response) ** 2, axis=0)
    tiny = np.finfo(np.float64).tiny
    coherence = None
    if len(records) > 1:
        coherence = np.abs(cross) ** 2 / np.maximum(force_power * response_power, tiny)
        coherence = np.minimum(coherence, 1.0)
    return Frf(
        frequency_hz=np.asarray(fft.rfftfreq(count, period), dtype=np.float64),
        response=np.asarray(cross / np.maximum(force_power, tiny), dtype=np.complex128),
        coherence=coherence,
        force_spectrum=np.asarray(force_power, dtype=np.float64),
        response_spectrum=np.asarray(response_power, dtype=np.float64),
        taps=len(records),
    )


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
    window: str  # what the samples were multiplied by
    resolution_hz: float  # 1 / duration: peaks closer than this are one


def decay_spectrum(record: Record) -> Spectrum:
    """Amplitude spectrum of the response of a decay, with its peaks.

    The window falls from 1 at the first sample to 0 after the last (half of a Hann window): the beginning of a decay
    counts fully and the end of the record leaves no side lobes. Filled up with zeros to four times the length.
    """
    response = record.response - np.mean(record.response)
    samples = len(response)
    window = 0.5 * (1.0 + np.cos(np.pi * np.arange(samples) / samples))
    count = fft.next_fast_len(_PADDING * samples, real=True)
    amplitude = np.abs(fft.rfft(response * window, count)) * 2.0 / float(np.sum(window))
    frequency = np.asarray(fft.rfftfreq(count, record.period_s), dtype=np.float64)
    resolution = 1.0 / (samples * record.period_s)
    return Spectrum(
        frequency_hz=frequency,
        amplitude=np.asarray(amplitude, dtype=np.float64),
        peaks=_peaks(frequency, amplitude, resolution),
        window="half Hann, 1 at the first sample",
        resolution_hz=resolution,
    )


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
    return tuple(peaks[:_MOST_PEAKS])


@dataclass(frozen=True, eq=False)
class Envelope:
    """A response within a band, and its envelope."""

    time_s: FloatArray  # (n,)
    response: FloatArray  # (n,) within the band, without phase shift, in the unit of the record
    envelope: FloatArray  # (n,) magnitude of the analytic signal
    band_hz: tuple[float, float] | None  # limits of the band; None: the whole response


def envelope(record: Record, band_hz: tuple[float, float] | None = None) -> Envelope:
    """Envelope of a response by the Hilbert transform, of a band by a Butterworth filter run both ways (order 4)."""
    response = np.asarray(record.response - np.mean(record.response), dtype=np.float64)
    if band_hz is not None:
        low, high = band_hz
        half = 0.5 / record.period_s
        if not 0.0 < low < high < half:
            raise RecordError(f"{record.source}: band {low:g} to {high:g} Hz: must lie between 0 and {half:g} Hz")
        sections = signal.butter(_BAND_ORDER, (low, high), "bandpass", fs=1.0 / record.period_s, output="sos")
        response = np.asarray(signal.sosfiltfilt(sections, response), dtype=np.float64)
    count = fft.next_fast_len(2 * len(response))
    analytic = signal.hilbert(response, count)[: len(response)]
    return Envelope(record.time_s, response, np.asarray(np.abs(analytic), dtype=np.float64), band_hz)


def mode_envelopes(record: Record, frequencies_hz: Sequence[float]) -> list[Envelope]:
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
        found.append(envelope(record, (low, high)))
    return found
