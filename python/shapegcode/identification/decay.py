"""Finds the start of the free decay in a record without force, where the axis' command is unknown."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy import signal
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from shapegcode.errors import RecordError
from shapegcode.identification.spectra import decay_spectrum
from shapegcode.io.record import Record
from shapegcode.io.units import FloatArray

_ENVELOPE_PERIODS = 2.0  # RMS window of the envelope: periods of the slowest mode, or a beat of the two closest modes
_ENVELOPE_SHARE = 0.05  # ... and at least this fraction of the record while the modes are unknown
_EVENT_RISES, _EVENT_SHARE = 1.3, 0.3  # An event: the envelope rises by this factor, to this fraction of its maximum
_TAIL = 0.3  # The tail of a decay, without command, begins after this fraction of it
_MIN_TAIL = 16  # Least samples of a tail to find a frequency
_MODE_SHARE = 0.2  # Modes are peaks above this fraction of the tail's largest; slower motion is of the axis
# A window of one period with this fraction of the largest RMS begins at most half a period early, so the decay
# begins this fraction of a period later.
_ONSET = 0.7
_SLOWER = 0.8  # Below this fraction of the slowest mode's frequency it is motion of the axis
_MOTION_SHARE = 0.4  # The axis moves: mean over a period of the lowest mode above this fraction of the envelope
_FEWEST_PERIODS = 3.0  # of the strongest frequency in the record
_STOP_PERIODS, _STOP_FALLS = 3.0, 0.3  # periods of the lowest frequency after a stop; ratio to which the envelope falls
_LOWEST_HZ = 10.0  # lowest mode in an ordinary run; slower is motion
_MOST_STOPS = 20


def _fast_frequency_hz(response: FloatArray, period_s: float) -> float:
    """Strongest frequency of the differences, which suppress slow axis motion; 0: none."""
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
    """First and last + 1 sample of the decay after each start; the forward RMS rises before an event."""
    ends = [int(a) + int(np.argmin(envelope[a:b])) + 1 for a, b in pairwise(starts)]
    return list(zip([int(each) for each in starts], [*ends, len(envelope)], strict=True))


def _end_of(envelope: FloatArray, start: int, window_samples: float) -> int:
    """Last + 1 sample of a decay with known beginning."""
    later = [int(at) for at in _events(envelope) if at > start + window_samples]
    return _until_next(envelope, np.array([start, *later], dtype=np.intp))[0][1]


def _longest(envelope: FloatArray) -> tuple[int, int]:
    """First and last + 1 sample of the longest decay."""
    return max(_until_next(envelope, _events(envelope)), key=lambda part: part[1] - part[0])


@dataclass(frozen=True)
class _Scales:
    """Periods of the modes in the tail of a decay, in samples."""

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
    """First sample where one period of the strongest vibration has half of the full power: it has started."""
    last = min(end, start + max(2, round(scales.window)))
    one = max(2, round(scales.strongest))
    short = _forward_rms(quiet[start : min(end, last + one)], one)
    enough = short[: last - start] > _ONSET * np.max(short[: last - start])
    return min(start + int(np.argmax(enough)) + round(_ONSET * one), end - 1)


def _rest_after_motion(quiet: FloatArray, period_samples: float, level: float, start: int, end: int) -> int:
    """First sample after which the axis is at rest for a period of the slowest mode."""
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


def split_stops(record: Record, lowest_hz: float | None = None) -> list[Record]:
    """One record for each stop after which the machine rests, least motion first, at most 20."""
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

    parts = sorted(sorted(parts, key=lambda part: -envelope[part[0]])[:_MOST_STOPS], key=moved)
    names = [f" stop at {record.start_s + begin * record.period_s:.2f} s" for begin, _ in parts]
    return [part_of(record, *part, name) for part, name in zip(parts, names, strict=True)]


def find_decay(record: Record, start_s: float | None = None) -> Record:
    """Find the free decay in a record without force."""
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
