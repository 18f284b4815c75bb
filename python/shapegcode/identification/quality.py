"""Faults of a record that its samples show: overload, too short, sampled too slowly; and what a force excites."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from shapegcode.errors import RecordError
from shapegcode.identification.spectra import decay_spectrum
from shapegcode.io.record import FloatArray, Record

#: So many equal extreme samples on end may be an overload; two can lie on either side of a smooth peak.
_CLIPPED_RUN = 3
#: Values closer than this share of the range are equal: converters with filters do not clip to one value.
_CLIPPED_STEP = 1e-4
#: At a smooth peak the curve has fallen by four resolutions where it is twice as far from the top as the run's ends.
_SMOOTH_FALL = 6.0
#: A lobe is flat if more than this share of what lies above half of it lies above 95 %, in so many samples at least.
_NEARLY_TOP = 0.95
_FLAT_SHARE = 0.5
_FLAT_RUN = 5
#: Where the force's spectrum has fallen to this share (-20 dB), noise counts tenfold.
_EXCITED = 0.1
#: A half sine falls to that share at this many over its duration: cos(pi x) / (1 - 4 x²) = 0.1 in size.
EXCITED_HALF_SINE = 1.3033
#: Periods that tell a damping ratio though the response has not decayed; fewer do not tell decay from beat.
LEAST_PERIODS = 8.0
#: ... of the lowest vibration whose peak in the spectrum has this share of the largest.
_STRONG_PEAK = 0.3
#: Decayed: the last tenth of the record is below this share of the beginning.
DECAYED = 0.1
#: Samples after the hit below which no model has data enough.
_LEAST_SAMPLES = 32
#: The strongest frequency must lie below this share of half the sampling rate: above, filters cut and modes fold.
FOLDING = 0.8


def is_clipped(values: FloatArray) -> bool:
    """Whether a signal is cut off at its largest or smallest value.

    A run of three or more samples at the extreme, next to which the signal falls more steeply than a smooth peak of the
    same width at this resolution would.
    """
    centred = values - np.median(values)
    largest = float(np.max(np.abs(centred)))
    if largest == 0.0:
        return False
    if any(_is_flat_topped(signal) for signal in (centred, -centred) if np.max(signal) >= 0.5 * largest):
        return True
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0.0]
    step = max(_CLIPPED_STEP * float(np.ptp(values)), float(np.min(steps)))
    for signal in (centred, -centred):
        top = float(np.max(signal))
        if top < 0.5 * largest:
            continue
        high = np.flatnonzero(signal >= top - 0.5 * step)
        for run in np.split(high, np.flatnonzero(np.diff(high) > 1) + 1):
            if len(run) < _CLIPPED_RUN:
                continue
            reach = (len(run) + 1) // 2
            sides = [k for k in (int(run[0]) - reach, int(run[-1]) + reach) if 0 <= k < len(signal)]
            # A cut falls on both sides; a peak with a kink, where the force begins or ends, on one.
            if sides and top - max(float(signal[k]) for k in sides) > _SMOOTH_FALL * step:
                return True
    return False


def _is_flat_topped(signal: FloatArray) -> bool:
    """Whether the highest lobe is cut off though noise or a filter behind hide it.

    Of a smooth peak the part above 95 % is .3 of the part above half of it; of one cut at 85 % it is .5.
    """
    top = float(np.max(signal))
    crest = int(np.argmax(signal))
    high, half = (_run_around(signal > share * top, crest) for share in (_NEARLY_TOP, 0.5))
    return high >= _FLAT_RUN and high > _FLAT_SHARE * half


def _run_around(inside: npt.NDArray[np.bool_], at: int) -> int:
    """Length of the run of True that holds a place."""
    outside = np.flatnonzero(~inside)
    place = int(np.searchsorted(outside, at))
    before = int(outside[place - 1]) if place > 0 else -1
    after = int(outside[place]) if place < len(outside) else len(inside)
    return after - before - 1


def excited_hz(force_n: FloatArray, period_s: float) -> float:
    """Frequency up to which a pulse excites: where its spectrum has fallen by 20 dB, at most half the sampling rate."""
    pulse = np.trim_zeros(force_n)
    if pulse.size == 0:
        return 0.0
    count = max(4096, 16 * len(pulse))
    spectrum = np.abs(np.fft.rfft(pulse, count))
    low = np.flatnonzero(spectrum < _EXCITED * spectrum[0])
    if not low.size:
        return 0.5 / period_s
    at = int(low[0])
    above, below = spectrum[at - 1] - _EXCITED * spectrum[0], spectrum[at] - _EXCITED * spectrum[0]
    return float(at - below / (below - above)) / (count * period_s)


def refuse_short(
    record: Record, response: FloatArray, noise: float, band_hz: float | None, warnings: list[str]
) -> float:
    """Refuse what is too short or sampled too slowly for the strongest mode."""
    half_rate = 0.5 / record.period_s
    if len(response) < _LEAST_SAMPLES:
        raise RecordError(
            f"{len(response)} samples of response: too short; needed are {_LEAST_SAMPLES} at the very least, and "
            f"{LEAST_PERIODS:g} periods of the lowest mode"
        )
    if band_hz is not None and band_hz > FOLDING * half_rate:
        raise RecordError(
            f"{1.0 / record.period_s:g} samples per second are too slow for {band_hz:g} Hz: needed are "
            f"{2.0 * band_hz / FOLDING:.4g} or more, better {5.0 * band_hz:.4g}"
        )
    if not np.ptp(response) > 0.0:
        raise RecordError(f"every sample of the response is {response[0]:g}: is the sensor connected?")
    duration = len(response) * record.period_s
    peaks = decay_spectrum(replace(record, response=response, force_n=None)).peaks
    if not peaks:
        raise RecordError(f"no vibration stands out of the spectrum of {duration:.4g} s: too short, or noise only")
    frequency = peaks[0].frequency_hz
    if frequency > FOLDING * half_rate:
        text = (
            f"the strongest vibration, {frequency:.4g} Hz, is above {FOLDING * half_rate:.4g} Hz, "
            f"{100 * FOLDING:g} % of half the sampling rate: sampling may be too slow and the mode folded; needed are "
            f"{5.0 * frequency:.4g} samples per second or more, with an anti-aliasing filter"
        )
        if band_hz is None:
            raise RecordError(text)
        warnings.append(f"{record.source}: {text}")
    tenth = max(len(response) // 10, 1)
    ends = response - np.mean(response)
    power = (float(np.mean(part**2)) - noise**2 for part in (ends[:tenth], ends[-tenth:]))
    first, last = (float(np.sqrt(max(each, 0.0))) for each in power)
    lowest = min(peak.frequency_hz for peak in peaks if peak.amplitude > _STRONG_PEAK * peaks[0].amplitude)
    periods = lowest * duration
    if last > DECAYED * first:
        if periods < LEAST_PERIODS:
            raise RecordError(
                f"{duration:.4g} s hold {periods:.1f} periods of {lowest:.4g} Hz, and the response is still "
                f"at {100 * last / first:.0f} %: too short; needed are {LEAST_PERIODS / lowest:.4g} s "
                f"({LEAST_PERIODS:g} periods) or more"
            )
        if record.force_n is not None:
            warnings.append(
                f"{record.source}: the response is still at {100 * last / first:.0f} % at the end of the record: its "
                " FRF is smeared, the fit in time is not"
            )
    return frequency
