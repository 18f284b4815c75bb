"""Spectra of taps and decays (FRF, peaks, envelopes), and of a command and its response, part by part.

Also finds where a free decay starts in a record that has neither the force nor the command of the axis.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np
import numpy.typing as npt
from scipy import fft, signal
from scipy.ndimage import maximum_filter1d, median_filter, uniform_filter1d

from shapegcode.errors import RecordError
from shapegcode.io.record import ComplexArray, FrequencyResponse, Record
from shapegcode.io.units import FloatArray

_PEAK_SHARE, _PEAK_RISES = 0.01, 2.0  # relative to the largest (-40 dB); factor of a peak over its surroundings
_PEAK_NOISE = 6.0  # Least height in noise levels, estimated by the spectrum's median
_BAND_SHARE = 0.25  # Half width of a mode's band relative to its frequency, at most half way to the next


def frf(records: Sequence[Record]) -> FrequencyResponse:
    """Frequency response above 0 Hz, averaged over taps (H1); coherence None for a single tap (it would be 1)."""
    if not records:
        raise RecordError("no record: an FRF needs at least one tap")
    period = records[0].period_s
    count = fft.next_fast_len(max(len(record.response) for record in records), real=True)
    forces, responses = [], []
    for record in records:
        if record.force_n is None:
            raise RecordError(f"{record.source}: no force: an FRF needs it")
        if not np.isclose(record.period_s, period, rtol=1e-5):
            raise RecordError(
                f"{record.source}: a sample every {record.period_s:g} s, but every {period:g} s in the first record"
            )
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
    """Amplitude spectrum of a decay's response under half a Hann window (1 at the first sample), with its peaks."""
    response = record.response - np.mean(record.response)
    samples = len(response)
    window = 0.5 * (1.0 + np.cos(np.pi * np.arange(samples) / samples))
    count = fft.next_fast_len(4 * samples, real=True)  # with zero padding
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
    return tuple(peaks[:8])


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
        sections = signal.butter(2, (low, high), "bandpass", fs=1.0 / record.period_s, output="sos")
        passed = signal.sosfiltfilt(sections, response)
        analytic = signal.hilbert(passed, fft.next_fast_len(2 * len(passed)))[: len(passed)]
        found.append(np.asarray(np.abs(analytic), dtype=np.float64))
    return found


REST_S = 0.5  # least rest of a command between two parts
_EXCITED = 0.2  # least amplitude of a used line, relative to the median of the command's spectrum
_BESIDE = 0.3  # least power relative to neighbouring lines: weaker lines show noise
_SMOOTH_LINES, _COHERENT = 31, 0.9


@dataclass(frozen=True, eq=False)
class Spectra:
    """Spectra of a command and its response, part by part between rests; times are the program's, not the logger's."""

    hertz: FloatArray  # (n,)
    command: ComplexArray  # (parts, n)
    response: ComplexArray  # (parts, n)

    @property
    def turn(self) -> ComplexArray:
        """Factor i*omega of a time derivative at each line, (n,)."""
        return np.asarray(2j * np.pi * self.hertz)

    @cached_property
    def power(self) -> FloatArray:
        """Power of the command, (n,)."""
        return np.asarray(np.sum(np.abs(self.command) ** 2, axis=0), dtype=np.float64)

    def late(self, lags_s: FloatArray) -> Self:
        """Copy with the response of each part advanced by its lag."""
        return replace(self, response=self.response * np.exp(self.turn * lags_s[:, None]))

    def of(self, rows: npt.NDArray[np.intp]) -> Self:
        """Select parts."""
        return replace(self, command=self.command[rows], response=self.response[rows])

    def ratio(self) -> ComplexArray:
        """Response/command by least squares over the parts, (n,)."""
        return np.asarray(np.sum(np.conj(self.command) * self.response, axis=0) / np.maximum(self.power, 1e-300))

    def in_twos(self, rows: npt.NDArray[np.intp]) -> Self:
        """Add parts 0 and 1, 2 and 3, ...: ringing of the first during the second is then within the same window."""
        first = [np.flatnonzero(rows // 2 == pair) for pair in np.unique(rows // 2)]
        return replace(
            self,
            command=np.array([self.command[each].sum(axis=0) for each in first]),
            response=np.array([self.response[each].sum(axis=0) for each in first]),
        )

    def coherent(self) -> tuple[npt.NDArray[np.bool_], FloatArray]:
        """Mask of the excited lines between the first and the last at which the parts agree; coherence of all lines."""
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
    parts = np.split(rows, np.flatnonzero(np.diff(rows) * period_s > REST_S) + 1)
    return [(int(part[0]), int(part[-1]) + 2) for part in parts]


_ENVELOPE_PERIODS = 2.0  # RMS window of the envelope: periods of the slowest mode, or a beat of the two closest modes
_ENVELOPE_SHARE = 0.05  # ... and at least this fraction of the record while the modes are unknown
_EVENT_RISES, _EVENT_SHARE = 1.3, 0.3  # An event: the envelope rises by this factor, to this fraction of its maximum
_TAIL = 0.3  # The tail of a decay, without command, begins after this fraction of it
_MIN_TAIL = 16  # Least samples of a tail to find a frequency
_MODE_SHARE = 0.2  # Modes are peaks above this fraction of the tail's largest; slower motion is of the axis
# A window of one period with this fraction of the largest RMS begins at most half a period early, so the decay
# has begun this fraction of a period later.
_ONSET = 0.7
_SLOWER = 0.8  # Vibration below this fraction of the slowest mode's frequency is motion of the axis
_MOTION_SHARE = 0.4  # The axis moves if the mean over the slowest mode's period exceeds this fraction of the amplitude
_FEWEST_PERIODS = 3.0  # of the strongest frequency in the record
_STOP_PERIODS, _STOP_FALLS = 3.0, 0.3  # periods of the lowest frequency after a stop; ratio to which the envelope falls
_LOWEST_HZ = 10.0  # lowest mode in an ordinary run; slower is motion


def _fast_frequency_hz(response: FloatArray, period_s: float) -> float:
    """Strongest frequency of the differences between samples, which suppress slow motion of the axis; 0: none."""
    jerk = np.diff(response)
    count = 4 * len(jerk)
    spectrum = np.abs(np.fft.rfft(jerk - np.mean(jerk), count))
    spectrum[: int(np.ceil(_FEWEST_PERIODS * 4))] = 0.0
    # Divide by the differences' gain above the lowest quarter of the band, where it would favour noise.
    frequency = np.arange(len(spectrum)) / (count * period_s)
    weight = np.maximum(np.sin(np.pi * frequency * period_s), np.sin(np.pi / 8))
    at = int(np.argmax(spectrum / weight))
    return float(frequency[at]) if spectrum[at] > 0.0 else 0.0


def _forward_rms(values: FloatArray, window: int) -> FloatArray:
    """RMS over a window that starts at each sample."""
    power = np.concatenate(([0.0], np.cumsum(values**2)))
    begins = np.arange(len(values))
    ends = np.minimum(begins + window, len(values))
    mean = np.maximum(power[ends] - power[begins], 0.0) / np.maximum(ends - begins, window // 2)
    return np.asarray(np.sqrt(mean), dtype=np.float64)


def _mean_over(values: FloatArray, samples: float) -> FloatArray:
    return np.asarray(uniform_filter1d(values, max(1, round(samples)), mode="nearest"), dtype=np.float64)


def _envelope(quiet: FloatArray, period_samples: float, window_samples: float) -> FloatArray:
    return _forward_rms(quiet - _mean_over(quiet, period_samples), max(2, round(window_samples)))


def _events(envelope: FloatArray) -> npt.NDArray[np.intp]:
    """Samples from which the envelope falls."""
    largest = float(np.max(envelope))
    level = np.log(np.maximum(envelope, 1e-6 * largest))
    padded = np.concatenate(([level.min() - 1.0], level))
    found, _ = signal.find_peaks(padded, height=np.log(_EVENT_SHARE * largest), prominence=np.log(_EVENT_RISES))
    return np.asarray(found - 1 if found.size else [np.argmax(envelope)], dtype=np.intp)


def _until_next(envelope: FloatArray, starts: npt.NDArray[np.intp]) -> list[tuple[int, int]]:
    """First and last + 1 sample of each decay: to where the envelope is lowest before the next start, or the end."""
    ends = [int(a) + int(np.argmin(envelope[a:b])) + 1 for a, b in pairwise(starts)]
    return list(zip([int(each) for each in starts], [*ends, len(envelope)], strict=True))


def _end_of(envelope: FloatArray, start: int, window_samples: float) -> int:
    """Index after the last sample of a decay that begins at the sample *start*."""
    later = [int(at) for at in _events(envelope) if at > start + window_samples]
    return _until_next(envelope, np.array([start, *later], dtype=np.intp))[0][1]


def _longest(envelope: FloatArray) -> tuple[int, int]:
    """Index of the first sample of the longest decay, and the index after its last sample."""
    return max(_until_next(envelope, _events(envelope)), key=lambda part: part[1] - part[0])


@dataclass(frozen=True)
class _Scales:
    """Periods of the modes of a decay, in samples."""

    slowest: float  # period of the slowest mode
    strongest: float  # period of the strongest
    window: float  # averaging window of the envelope


def _scales(record: Record, quiet: FloatArray, start: int, end: int, fast_samples: float) -> _Scales:
    """Find the slowest mode of a decay from its tail (after the command), the strongest from all of it."""
    rate = 1.0 / record.period_s
    tail = quiet[start + int(_TAIL * (end - start)) : end]
    peaks = decay_spectrum(replace(record, response=tail)).peaks if len(tail) >= _MIN_TAIL else ()
    modes = sorted(peak.frequency_hz for peak in peaks if peak.amplitude > _MODE_SHARE * peaks[0].amplitude)
    if not modes:
        return _Scales(fast_samples, fast_samples, _ENVELOPE_PERIODS * fast_samples)
    beat = max((1.0 / (high - low) for low, high in pairwise(modes)), default=0.0)
    whole = decay_spectrum(replace(record, response=quiet[start:end])).peaks
    strongest = next((each.frequency_hz for each in whole if each.frequency_hz > _SLOWER * modes[0]), modes[0])
    return _Scales(rate / modes[0], rate / strongest, rate * max(_ENVELOPE_PERIODS / modes[0], beat))


def _onset(quiet: FloatArray, scales: _Scales, start: int, end: int) -> int:
    """0.7 periods after the first sample from which a period of the strongest mode has half of the full power."""
    last = min(end, start + max(2, round(scales.window)))
    one = max(2, round(scales.strongest))
    short = _forward_rms(quiet[start : min(end, last + one)], one)
    enough = short[: last - start] > _ONSET * np.max(short[: last - start])
    return min(start + int(np.argmax(enough)) + round(_ONSET * one), end - 1)


def _rest_after_motion(quiet: FloatArray, period_samples: float, level: float, start: int, end: int) -> int:
    """First sample from which the axis is at rest for a period of the slowest mode; without one, `start`."""
    moving = np.abs(_mean_over(quiet, period_samples)[start:end]) > _MOTION_SHARE * np.sqrt(2.0) * level
    window = max(1, round(period_samples))
    ahead = maximum_filter1d(moving.astype(np.uint8), window, mode="nearest", origin=-(window // 2))
    rest = np.flatnonzero(ahead == 0)
    return start + int(rest[0]) if rest.size else start


def _without_median(record: Record) -> FloatArray:
    if not np.ptp(record.response) > 0.0:
        raise RecordError(
            f"{record.source}: every sample is {record.response[0]:zg}: no vibration; is the sensor connected?"
        )
    return np.asarray(record.response - np.median(record.response), dtype=np.float64)


def part_of(record: Record, begin: int, end: int, name: str = "") -> Record:
    """A range of samples as a record of its own."""
    force_n = None if record.force_n is None else record.force_n[begin:end]
    at_s, response = record.start_s + begin * record.period_s, record.response[begin:end]
    return replace(record, source=f"{record.source}{name}", response=response, force_n=force_n, start_s=at_s)


def split_stops(records: Iterable[Record], lowest_hz: float | None = None) -> list[Record]:
    """Stops after which the machine rests (the 20 strongest of each record), all by ascending slow motion."""
    stops = [stop for record in records for stop in _stops_of(record, lowest_hz)]
    return [part for _, part in sorted(stops, key=lambda stop: stop[0])]


def _stops_of(record: Record, lowest_hz: float | None) -> Iterator[tuple[float, Record]]:
    quiet = _without_median(record)
    period = 1.0 / ((lowest_hz or _LOWEST_HZ) * record.period_s)
    envelope = _envelope(quiet, period, _ENVELOPE_PERIODS * period)
    parts = []
    for begin, stop in _until_next(envelope, _events(envelope)):
        rest = _rest_after_motion(quiet, period, float(envelope[begin]), begin, stop)
        whole = max(rest, min(stop, len(envelope) - round(_ENVELOPE_PERIODS * period)) - 1)
        if stop - rest > _STOP_PERIODS * period and envelope[whole] < _STOP_FALLS * envelope[rest]:
            parts.append((rest, stop))
    slow = _mean_over(_mean_over(quiet, period), period)

    def moved(part: tuple[int, int]) -> float:
        inside = slice(part[0] + round(period), part[1])
        return float(np.sum(slow[inside] ** 2) / np.sum(quiet[inside] ** 2))

    for part in sorted(parts, key=lambda part: -envelope[part[0]])[:20]:
        yield moved(part), part_of(record, *part, f" stop at {record.start_s + part[0] * record.period_s:.2f} s")


def find_decay(record: Record, start_s: float | None = None) -> Record:
    """Find the free decay in a record without force: the longest one, or that which begins at `start_s`."""
    response = record.response
    last_s = record.start_s + record.period_s * (len(response) - 1)
    if start_s is not None and not record.start_s <= start_s < last_s:
        raise RecordError(
            f"{record.source}: start at {start_s:g} s: must be within the record, {record.start_s:g} to {last_s:g} s"
        )
    quiet = _without_median(record)
    frequency = _fast_frequency_hz(response, record.period_s)
    if frequency == 0.0:
        raise RecordError(f"{record.source}: {len(response)} samples without a vibration of three periods or more")
    period = 1.0 / (frequency * record.period_s)
    window = max(_ENVELOPE_PERIODS * period, _ENVELOPE_SHARE * len(quiet))
    envelope = _envelope(quiet, period, window)
    if start_s is None:
        start, end = _longest(envelope)
    else:
        start = int(np.ceil((start_s - record.start_s) / record.period_s - 1e-9))
        end = _end_of(envelope, start, window)
    scales = _scales(record, quiet, start, end, period)
    # The slowest mode separates envelope from motion; it is known only now.
    envelope = _envelope(quiet, scales.slowest, scales.window)
    if start_s is not None:
        return part_of(record, start, _end_of(envelope, start, scales.window))
    start, end = _longest(envelope)
    start = _onset(quiet, scales, start, end)
    start = _rest_after_motion(quiet, scales.slowest, float(np.max(envelope[start:end])), start, end)
    return part_of(record, start, end)
