"""Where the free decay begins in a record without force: the command that stopped the axis is not known."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy import signal
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from shapegcode.identification.record import FloatArray, Record, RecordError
from shapegcode.identification.spectra import decay_spectrum

__all__ = ["find_decay"]

#: The envelope is the RMS over so many periods: long enough for the beat of two modes an octave apart.
_ENVELOPE_PERIODS = 2.0
#: Something happens where the envelope rises by this factor; the beat of two modes makes less of a rise.
_EVENT_RISES = 1.3
#: Of the decays that begin with this share of the largest envelope, the longest is taken.
_STRONG = 0.5
#: The tail of a decay, in which no command is left, begins after this share of it.
_TAIL = 0.3
#: Samples below which a tail tells no frequency.
_LEAST_TAIL = 16
#: Modes above this share of the tail's largest peak are vibration, whatever is slower is the axis's own motion.
_MODE_SHARE = 0.2
#: The axis moves where its mean over a period of the lowest mode is above this share of the envelope.
_MOTION_SHARE = 0.2
#: The search for the strongest frequency leaves out what has fewer than so many periods in the record.
_FEWEST_PERIODS = 3.0


def _fast_frequency_hz(response: FloatArray, period_s: float) -> float:
    """Strongest frequency of the differences of the samples, in which the slow motion of the axis weighs little.

    0: there is none.
    """
    jerk = np.diff(response)
    count = 4 * len(jerk)
    spectrum = np.abs(np.fft.rfft(jerk - np.mean(jerk), count))
    spectrum[: int(np.ceil(_FEWEST_PERIODS * 4))] = 0.0
    # Undo the differences' weight above the lowest quarter of the band, where it would favour noise.
    frequency = np.arange(len(spectrum)) / (count * period_s)
    weight = np.maximum(np.sin(np.pi * frequency * period_s), np.sin(np.pi / 8))
    at = int(np.argmax(spectrum / weight))
    return float(frequency[at]) if spectrum[at] > 0.0 else 0.0


def _forward_rms(values: FloatArray, window: int) -> FloatArray:
    """RMS over each sample and those after it."""
    power = np.concatenate(([0.0], np.cumsum(values**2)))
    ends = np.minimum(np.arange(len(values)) + window, len(values))
    begins = np.arange(len(values))
    mean = np.maximum(power[ends] - power[begins], 0.0) / np.maximum(ends - begins, window // 2)
    return np.asarray(np.sqrt(mean), dtype=np.float64)


def _mean_over(values: FloatArray, samples: float) -> FloatArray:
    return np.asarray(uniform_filter1d(values, max(1, round(samples)), mode="nearest"), dtype=np.float64)


def _envelope(quiet: FloatArray, period_samples: float) -> FloatArray:
    shaking = quiet - _mean_over(quiet, period_samples)
    return _forward_rms(shaking, max(2, round(_ENVELOPE_PERIODS * period_samples)))


def _events(envelope: FloatArray) -> npt.NDArray[np.intp]:
    """Samples from which the envelope falls."""
    level = np.log(np.maximum(envelope, 1e-6 * np.max(envelope)))
    padded = np.concatenate(([level.min() - 1.0], level))
    found, _ = signal.find_peaks(padded, prominence=np.log(_EVENT_RISES))
    return np.asarray(found - 1 if found.size else [np.argmax(envelope)], dtype=np.intp)


def _until_next(envelope: FloatArray, starts: npt.NDArray[np.intp]) -> list[tuple[int, int]]:
    """First and last + 1 sample of what follows each start; the envelope looks ahead and rises before an event."""
    ends = [int(a) + int(np.argmin(envelope[a:b])) + 1 for a, b in pairwise(starts)]
    return list(zip([int(each) for each in starts], [*ends, len(envelope)], strict=True))


def _longest(quiet: FloatArray, period_samples: float) -> tuple[int, int, float]:
    """First and last + 1 sample of the longest of the strong decays, and the envelope at its beginning."""
    envelope = _envelope(quiet, period_samples)
    starts = _events(envelope)
    strong = envelope[starts] >= _STRONG * np.max(envelope[starts])
    parts = [part for part, good in zip(_until_next(envelope, starts), strong, strict=True) if good]
    start, end = max(parts, key=lambda part: part[1] - part[0])
    return start, end, float(envelope[start])


def _slowest_period(record: Record, quiet: FloatArray, start: int, end: int) -> float | None:
    """Period in samples of the lowest mode in the tail of a decay."""
    tail = start + int(_TAIL * (end - start))
    if end - tail < _LEAST_TAIL:
        return None
    peaks = decay_spectrum(replace(record, response=quiet[tail:end])).peaks
    modes = [peak.frequency_hz for peak in peaks if peak.amplitude > _MODE_SHARE * peaks[0].amplitude]
    return 1.0 / (min(modes) * record.period_s) if modes else None


def _rest_after_motion(quiet: FloatArray, period_samples: float, level: float, start: int, end: int) -> int:
    """First sample from which the axis itself stays at rest for a period of the lowest mode."""
    moving = np.abs(_mean_over(quiet, period_samples)[start:end]) > _MOTION_SHARE * np.sqrt(2.0) * level
    window = max(1, round(period_samples))
    ahead = maximum_filter1d(moving.astype(np.uint8), window, mode="nearest", origin=-(window // 2))
    rest = np.flatnonzero(ahead == 0)
    return start + int(rest[0]) if rest.size else start


def find_decay(record: Record, start_s: float | None = None) -> Record:
    """The free decay in a record without force.

    Args:
        record: of a rapid stop, for example.
        start_s: time of the record at which the decay begins; None: the longest of the strong ones is taken, from
            where its envelope falls and the axis itself no longer moves. Either way it ends before the next event.

    Raises:
        RecordError: nothing vibrates, or *start_s* lies outside the record.
    """
    response = record.response
    last_s = record.start_s + record.period_s * (len(response) - 1)
    if start_s is not None and not record.start_s <= start_s < last_s:
        raise RecordError(
            f"{record.source}: start at {start_s:g} s: must be within the record, {record.start_s:g} to {last_s:g} s"
        )
    if not np.ptp(response) > 0.0:
        raise RecordError(f"{record.source}: every sample is {response[0]:g}: no vibration; is the sensor connected?")
    frequency = _fast_frequency_hz(response, record.period_s)
    if frequency == 0.0:
        raise RecordError(f"{record.source}: {len(response)} samples and no vibration with three periods or more")
    quiet = np.asarray(response - np.median(response), dtype=np.float64)
    period = 1.0 / (frequency * record.period_s)
    if start_s is not None:
        first = int(np.ceil((start_s - record.start_s) / record.period_s - 1e-9))
        part = replace(record, response=response[first:])
        period = _slowest_period(part, quiet[first:], 0, len(part.response)) or period
        envelope = _envelope(quiet, period)
        starts = np.append(first, [at for at in _events(envelope) if at > first + period])
        start, end = _until_next(envelope, starts)[0]
    else:
        start, end, level = _longest(quiet, period)
        slowest = _slowest_period(record, quiet, start, end)
        if slowest is not None:
            # Envelope and motion are told apart by the slowest mode, which is known only now.
            start, end, level = _longest(quiet, slowest)
            start = _rest_after_motion(quiet, slowest, level, start, end)
    return replace(record, response=response[start:end], start_s=record.start_s + start * record.period_s)
