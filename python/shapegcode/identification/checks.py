"""Refuses unusable records (double hit, overload, no force, too short, too slow) and measures noise of the others."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np
from scipy.ndimage import label

from shapegcode.errors import RecordError
from shapegcode.identification.spectra import decay_spectrum, find_decay, part_of
from shapegcode.io.record import UNITS, Quantity, Record
from shapegcode.io.units import FloatArray


@dataclass(frozen=True)
class RecordUse:
    """Whether a record (of an impact, decay or sweep) or a frequency response was used, and if not, why."""

    source: str  # file, with the number of the impact or the channel
    used: bool  # whether the modes were fitted to it
    reason: str = ""  # why it is not used; empty: it is used
    samples: int | None = None  # number of samples, of a decay from its start; null if not used, as below
    period_s: float | None = None  # time between two samples
    start_s: float | None = None  # time of the first sample in the file
    quantity: Quantity | None = None  # what the sensor measured
    excited_hz: float | None = None  # highest frequency that the impact excites (-20 dB); null for a decay
    # line spacing of a frequency response without time record; `samples` are then its lines
    resolution_hz: float | None = None

    @property
    def duration_s(self) -> float | None:
        """Duration, s; None for a record that is not used, or for a frequency response."""
        return None if self.samples is None or self.period_s is None else self.samples * self.period_s


@dataclass(frozen=True)
class Hit:
    """One impact of the hammer."""

    first: int  # first sample of the pulse
    peak: int  # sample of its largest force
    end: int  # first sample after the pulse
    peak_n: float  # largest force relative to the offset, with its sign
    second_share: float = 0.0  # largest later pulse before the next impact, relative to this one; 0: none
    second_s: float = 0.0  # its delay after this one


@dataclass(frozen=True, eq=False)
class Usable:
    """A usable record, its noise and its pulse; for a free decay both noise and pulse are None."""

    record: Record  # without offset; the force is 0 outside the pulse; a free decay from its beginning
    force_noise_n: float | None = None  # RMS noise of the force outside the pulse
    response_noise: float | None = None  # RMS noise of the response before the impact, in its unit; None: not measured
    excited_hz: float | None = None  # frequency up to which the force excites (-20 dB)
    hit: Hit | None = None  # the pulse
    turned: bool = False  # whether the sign of the response was reversed


@dataclass(frozen=True, eq=False)
class Prepared:
    """Checked records of taps or decays."""

    usable: tuple[Usable, ...]
    refused: tuple[RecordUse, ...]  # the others
    warnings: tuple[str, ...]  # for the user
    notes: tuple[str, ...]  # parts of the files that were ignored

    @property
    def records(self) -> tuple[Record, ...]:
        """Usable records."""
        return tuple(each.record for each in self.usable)

    def without(self, unused: Sequence[Usable], why: str) -> Self:
        """Copy with some of the records refused."""
        refused = tuple(RecordUse(each.record.source, False, why) for each in unused)
        usable = tuple(each for each in self.usable if each not in unused)
        return replace(self, usable=usable, refused=(*self.refused, *refused))


# A second pulse above this fraction of the first is refused: the impulse, and so the mass, would be wrong by as much.
DOUBLE_HIT = 0.1  # Below, it may be the ringing of an anti-aliasing filter, which reaches 9 %
MIN_FORCE = 10.0  # Least ratio of the peak force to its noise: the error of the mass is about the inverse
MIN_PULSE = 3  # Least samples of a pulse: with three, the impulse of a half sine is known to about 10 %
MIN_LEAD = 8  # Least samples before the impact to measure noise and offset: a standard deviation to 25 %
_CUT_PULSE = 0.2  # Refuse a record that begins within the pulse above this fraction of its peak
_AT_REST = 0.1  # At rest before the impact: vibration below this fraction of that afterwards
_OPPOSED = -0.7  # Correlation of force and response below which they are opposite


def _mean_to_remove(values: FloatArray) -> float:
    """Mean of a quiet interval; 0 if below two standard errors."""
    mean = float(np.mean(values))
    error = float(np.std(values)) / np.sqrt(len(values))
    return mean if abs(mean) > 2.0 * error else 0.0


def _is_opposed(record: Record, hit: Hit, response: FloatArray, force: FloatArray) -> bool:
    """Whether the response is opposite to the hammer's force."""
    if hit.end - hit.first < MIN_PULSE:
        return False
    stretch = slice(hit.first, min(hit.end + (hit.end - hit.first), len(force)))
    push, moved = force[stretch], response[stretch]
    for _ in range(("acceleration", "velocity", "displacement").index(record.quantity)):
        push = np.cumsum(push)
    norm = float(np.linalg.norm(push) * np.linalg.norm(moved))
    return norm > 0.0 and float(push @ moved) / norm < _OPPOSED


def _tap(record: Record, band_hz: float | None, warnings: list[str]) -> Usable:
    force = record.force_n
    assert force is not None
    if not np.ptp(force) > 0.0:
        raise RecordError(
            f"zero force: every sample is {force[0]:zg} N; required: the hammer's signal, or take it as a free decay "
            "(--ignore-force)"
        )
    for name, values in (("force", force), (f"response ({record.quantity})", record.response)):
        if is_clipped(values):
            top = float(values[np.argmax(np.abs(values - np.median(values)))])
            raise RecordError(
                f"overload: the {name} is cut off at {top:.5g}; required: a larger input range or a softer impact"
            )
    hits = find_hits(record)
    off_pulse = np.ones(len(force), dtype=bool)
    for each in hits:
        off_pulse[each.first : each.end] = False
    quiet = force[off_pulse]
    sigma = float(np.std(quiet)) if quiet.size >= MIN_LEAD else 0.0
    if not hits or abs(hits[0].peak_n) < MIN_FORCE * sigma:
        peak = float(np.max(np.abs(force - np.median(force))))
        raise RecordError(
            f"no impact above the noise: the largest force, {peak:.4g} N, is below {MIN_FORCE:g} times its noise of "
            f"{sigma:.3g} N; hit harder or choose a smaller range"
        )
    hit = hits[0]
    if hit.second_share >= DOUBLE_HIT:
        raise RecordError(
            f"double hit: a second pulse of {100 * hit.second_share:.0f} % comes {1000 * hit.second_s:.3g} ms after "
            f"the first; above {100 * DOUBLE_HIT:g} % it is not one tap: hit again"
        )
    if hit.first == 0 and hit.peak > 0 and (force[0] - np.median(force)) / hit.peak_n > _CUT_PULSE:
        raise RecordError(
            "the record begins inside the pulse: part of the force is missing; required: a pre-trigger of some "
            f"{MIN_LEAD} samples or more"
        )
    if hit.second_share > 0.0:
        warnings.append(
            f"{record.source}: a second pulse of {100 * hit.second_share:.0f} % comes {1000 * hit.second_s:.3g} ms "
            "after the first: taken as ringing and left out of the force"
        )
    return _windowed(record, hit, quiet, sigma, band_hz, warnings)


def _windowed(
    record: Record, hit: Hit, quiet: FloatArray, sigma: float, band_hz: float | None, warnings: list[str]
) -> Usable:
    assert record.force_n is not None
    where = record.source
    offset = _mean_to_remove(quiet) if quiet.size >= MIN_LEAD else 0.0
    if abs(offset) > 0.05 * abs(hit.peak_n):
        warnings.append(f"{where}: offset of the force, {offset:.4g} N, removed")
    force = np.zeros(len(record.force_n))
    margin = max(3, (hit.end - hit.first) // 2)  # the force is used for half a pulse on either side
    window = slice(max(hit.first - margin, 0), hit.end + margin)
    force[window] = record.force_n[window] - offset
    if hit.peak_n < 0.0:
        warnings.append(f"{where}: the pulse is negative: a hammer only pushes, so the sign of the force is reversed")
        force = -force
    response, noise = record.response, None
    lead = response[: max(hit.first - 1, 0)]
    if len(lead) < MIN_LEAD:
        warnings.append(
            f"{where}: {len(lead)} samples before the impact: noise and offset are measured from {MIN_LEAD} or more "
            "(pre-trigger)"
        )
    else:
        response = response - _mean_to_remove(lead)
        noise = float(np.std(lead))
        after = float(np.sqrt(np.mean(response[hit.end :][: len(lead)] ** 2))) if hit.end < len(response) else 0.0
        if noise > _AT_REST * after > 0.0:
            warnings.append(
                f"{where}: before the impact the sensor shows {100 * noise / after:.0f} % of what it shows afterwards: "
                "noise, or the machine was not at rest"
            )
    width = int(np.count_nonzero(np.abs(force) > 0.1 * abs(hit.peak_n)))
    if width < MIN_PULSE:
        warnings.append(
            f"{where}: the pulse has {width} samples above a tenth of its peak: below {MIN_PULSE} its impulse, and "
            "so the mass, is uncertain; sample faster or take a softer tip"
        )
    begin = hit.first if hit.end - hit.first > MIN_PULSE else hit.end
    strongest = refuse_short(record, response[begin:], noise or 0.0, band_hz, warnings)
    reached = excited_hz(force, record.period_s)
    wanted = band_hz or strongest
    if reached < wanted:
        warnings.append(
            f"{where}: the impact excites up to {reached:.4g} Hz (-20 dB), less than "
            f"{'the' if band_hz else 'the strongest vibration at'} {wanted:.4g} Hz"
            f"{' asked for' if band_hz else ''}: take a harder tip"
        )
    turned = _is_opposed(record, hit, response, force)
    if turned:
        response = -response
        warnings.append(
            f"{where}: the response is opposite to the hammer's force: its sign is reversed, as for a sensor at the "
            "same point that points the other way"
        )
    return Usable(replace(record, response=response, force_n=force), sigma, noise, reached, hit, turned)


def _decay(record: Record, band_hz: float | None, start_s: float | None, warnings: list[str]) -> Usable:
    free = find_decay(record, start_s)
    if is_clipped(free.response):
        raise RecordError(
            f"overload: the response ({record.quantity}) is cut off at {np.max(np.abs(free.response)):.5g} "
            f"{UNITS[record.quantity]}; required: a larger range of the input"
        )
    refuse_short(free, free.response, 0.0, band_hz, warnings)
    tenth = free.response[-max(len(free.response) // 10, MIN_LEAD) :]
    offset = float(np.mean(tenth))
    still = float(np.std(tenth)) < DECAYED * float(np.std(free.response[: len(tenth)]))
    if still and _mean_to_remove(tenth):
        free = replace(free, response=free.response - offset)
    return Usable(free)


def prepare(records: Sequence[Record], *, band_hz: float | None = None, start_s: float | None = None) -> Prepared:
    """Split recordings into impacts, find the starts of decays, and refuse unusable records."""
    if not records:
        raise RecordError("no record: at least one tap or decay is required")
    _refuse_mixture(records)
    warnings = list(dict.fromkeys(text for record in records for text in record.warnings))
    notes = tuple(dict.fromkeys(text for record in records for text in record.notes))
    usable: list[Usable] = []
    refused: list[RecordUse] = []
    for record in (part for each in records for part in split_hits(each)):
        is_decay = record.force_n is None
        try:
            usable.append(_decay(record, band_hz, start_s, warnings) if is_decay else _tap(record, band_hz, warnings))
        except RecordError as error:
            refused.append(RecordUse(record.source, False, str(error).removeprefix(f"{record.source}: ")))
    if not usable:
        raise RecordError("no record can be used:\n" + "\n".join(f"{each.source}: {each.reason}" for each in refused))
    return Prepared(tuple(usable), tuple(refused), tuple(warnings), notes)


def _refuse_mixture(records: Sequence[Record]) -> None:
    first = records[0]
    for other in records[1:]:
        pairs = [
            ("quantity", first.quantity, other.quantity),
            ("axis", first.axis, other.axis),
            ("kind", *("decay" if each.force_n is None else "tap with force" for each in (first, other))),
        ]
        for name, one, two in pairs:
            if one != two:
                raise RecordError(
                    f"{first.source}: {name} is {one}; {other.source}: {name} is {two}: must be the same in all "
                    "records; choose (--axis, --response-column, --ignore-force)"
                )
        if abs(first.period_s / other.period_s - 1.0) > 1e-5:  # as in files of six digits
            raise RecordError(
                f"{first.source} has a sample every {first.period_s:.9g} s, {other.source} every "
                f"{other.period_s:.9g} s: must have the same sampling rate"
            )


_CLIPPED_RUN = 3  # Consecutive equal extreme samples that may be an overload; a smooth peak has two
_CLIPPED_STEP = 1e-4  # Values closer than this fraction of the range count as equal: filters do not clip to one value
_SMOOTH_FALL = 6.0  # A smooth peak falls by four resolution steps at twice the distance of the run's ends from the top
# A lobe is flat if over half of its samples above 50 % are above 95 %, with at least this many samples.
_NEARLY_TOP, _FLAT_SHARE, _FLAT_RUN = 0.95, 0.5, 5
EXCITED = 0.1  # Force spectrum fallen to this ratio (-20 dB): noise counts tenfold
EXCITED_HALF_SINE = 1.3033  # A half sine reaches it at this multiple of 1/duration: cos(pi x) / (1 - 4 x²) = 0.1
MIN_PERIODS = 8.0  # Least periods to find damping without full decay; fewer cannot distinguish decay from beat
_STRONG_PEAK = 0.3  # ... of the lowest spectral peak above this fraction of the largest
DECAYED = 0.1  # Decayed: the last tenth of the record is below this fraction of the beginning
_MIN_SAMPLES = 32  # Least samples after the impact for any model
FOLDING = 0.8  # limit of the strongest frequency, relative to half the sampling rate: modes above may be aliased


def is_clipped(values: FloatArray) -> bool:
    """Whether a signal is clipped: three or more equal extreme samples, steep on both sides; or a flat top in noise."""
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
            # Clipping is steep on both sides; a peak at a kink, where the force begins or ends, on one only.
            if sides and top - max(float(signal[k]) for k in sides) > _SMOOTH_FALL * step:
                return True
    return False


def _is_flat_topped(signal: FloatArray) -> bool:
    """Whether the highest lobe is clipped, also under noise: much of its upper half is above 95 % of the maximum."""
    top, crest = float(np.max(signal)), int(np.argmax(signal))
    lobes = (label(signal > share * top)[0] for share in (_NEARLY_TOP, 0.5))
    high, half = (np.count_nonzero(lobe == lobe[crest]) for lobe in lobes)
    return bool(high >= _FLAT_RUN and high > _FLAT_SHARE * half)


def excited_hz(force_n: FloatArray, period_s: float) -> float:
    """Highest frequency that a pulse excites, Hz: its spectrum has fallen by 20 dB; at most half the sampling rate."""
    pulse = np.trim_zeros(force_n)
    if pulse.size == 0:
        return 0.0
    count = max(4096, 16 * len(pulse))
    spectrum = np.abs(np.fft.rfft(pulse, count))
    low = np.flatnonzero(spectrum < EXCITED * spectrum[0])
    if not low.size:
        return 0.5 / period_s
    at = int(low[0])
    above, below = spectrum[at - 1] - EXCITED * spectrum[0], spectrum[at] - EXCITED * spectrum[0]
    return float(at - below / (below - above)) / (count * period_s)


def refuse_short(
    record: Record, response: FloatArray, noise: float, band_hz: float | None, warnings: list[str]
) -> float:
    """Refuse a record too short, or sampled too slowly; return the frequency of its strongest mode, Hz.

    With a band, its upper end decides whether sampling is too slow; the strongest mode then gives a warning only.
    """
    half_rate = 0.5 / record.period_s
    if len(response) < _MIN_SAMPLES:
        raise RecordError(
            f"{len(response)} samples of response: too short; required: {_MIN_SAMPLES} at the very least, and "
            f"{MIN_PERIODS:g} periods of the lowest mode"
        )
    if band_hz is not None and band_hz > FOLDING * half_rate:
        raise RecordError(
            f"{1.0 / record.period_s:g} samples per second are too slow for {band_hz:g} Hz; required: "
            f"{2.0 * band_hz / FOLDING:.4g} or more, better {5.0 * band_hz:.4g}"
        )
    if not np.ptp(response) > 0.0:
        raise RecordError(f"every sample of the response is {response[0]:g}: is the sensor connected?")
    duration = len(response) * record.period_s
    peaks = decay_spectrum(replace(record, response=response, force_n=None)).peaks
    if not peaks:
        raise RecordError(f"no vibration above the noise in the spectrum of {duration:.4g} s: too short, or noise only")
    frequency = peaks[0].frequency_hz
    if frequency > FOLDING * half_rate:
        text = (
            f"the strongest vibration, {frequency:.4g} Hz, is above {FOLDING * half_rate:.4g} Hz, "
            f"{100 * FOLDING:g} % of half the sampling rate: sampling may be too slow and the mode aliased; required: "
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
    if last > DECAYED * first and periods < MIN_PERIODS:
        raise RecordError(
            f"{duration:.4g} s contain {periods:.1f} periods of {lowest:.4g} Hz, and the response is still "
            f"at {100 * last / first:.0f} %: too short; required: {MIN_PERIODS / lowest:.4g} s "
            f"({MIN_PERIODS:g} periods) or more"
        )
    if last > DECAYED * first and record.force_n is not None:
        warnings.append(
            f"{record.source}: the response is still at {100 * last / first:.0f} % at the end of the record: its "
            "FRF is smeared (leakage), the fit over time is not"
        )
    return frequency


_PULSE_ENDS = 0.01  # A pulse ends below this ratio to the peak; a half sine then lacks 0.005 % of its impulse
_NOISE_ENDS = 3.0  # ... or below this many standard deviations of noise
_SMALLEST_PULSE = 0.03  # Pulses are searched above this fraction of the largest force
_SMALLEST_HIT = 0.1  # An impact is above this fraction of the largest force; below, someone touched the hammer
_PULSE_NOISE = 7.0  # ... and above this many standard deviations, which a million samples of noise do not reach
_RINGING_SAMPLES = 8  # A further pulse within this many samples is ringing of the anti-aliasing filter
_BOUNCE_S = 0.1  # A second impact within this time is a bounce of the hammer
_RESTED = 0.1  # Before an intended next impact the response has fallen to this fraction of its peak
_LEAD_SHARE = 0.1  # A record of one impact begins before it by this fraction of the shortest time between impacts
_MAD = 1.4826  # Normal noise: standard deviation over median absolute deviation


def _pulses(force: FloatArray, sigma: float) -> list[Hit]:
    """Find every pulse of a force without offset and with a positive maximum."""
    peak = float(np.max(force))
    level = max(_SMALLEST_PULSE * peak, _PULSE_NOISE * sigma)
    above = np.flatnonzero(force > level)
    if above.size == 0:
        return []
    parts = np.split(above, np.flatnonzero(np.diff(above) > _RINGING_SAMPLES) + 1)
    floor = max(_PULSE_ENDS * peak, _NOISE_ENDS * sigma)
    low = np.flatnonzero(force <= floor)
    found = []
    for part in parts:
        first, last = int(part[0]), int(part[-1])
        before, after = np.searchsorted(low, (first, last))
        start = int(low[before - 1]) if before else 0
        end = int(low[after]) + 1 if after < low.size else len(force)
        top = first + int(np.argmax(force[first : last + 1]))
        found.append(Hit(start, top, end, float(force[top])))
    return found


def _has_rested(record: Record, noise: float, hit: Hit, next_hit: Hit) -> bool:
    """Whether the response decays between two impacts: at the end, little of it remains above the noise."""
    between = (record.response - np.median(record.response))[hit.end : next_hit.first]
    peak = float(np.max(np.abs(between)))
    power = float(np.mean(between[-max(1, len(between) // 10) :] ** 2)) - noise**2
    return bool(np.sqrt(2.0 * max(power, 0.0)) <= _RESTED * peak)


def find_hits(record: Record) -> list[Hit]:
    """Find the impacts of a record, in order; pulses of a bounce belong to the impact before."""
    if record.force_n is None or not np.ptp(record.force_n) > 0.0:
        return []
    force = record.force_n - np.median(record.force_n)
    sign = 1.0 if np.max(force) >= -np.min(force) else -1.0
    hits: list[Hit] = []
    largest = float(np.max(sign * force))
    noise = 0.0
    sigma = _MAD * float(np.median(np.abs(force - np.median(force))))  # quiet most of the time
    for pulse in _pulses(sign * force, sigma):
        if not hits and pulse.first > 1:
            noise = float(np.std(record.response[: pulse.first - 1]))
        if hits:
            gap = (pulse.first - hits[-1].end) * record.period_s
            small = pulse.peak_n < _SMALLEST_HIT * largest
            if small or gap < _BOUNCE_S or not _has_rested(record, noise, hits[-1], pulse):
                share = pulse.peak_n / abs(hits[-1].peak_n)
                if share > hits[-1].second_share:
                    late = (pulse.peak - hits[-1].peak) * record.period_s
                    hits[-1] = replace(hits[-1], second_share=share, second_s=late)
                continue
        hits.append(pulse)
    return [replace(hit, peak_n=sign * hit.peak_n) for hit in hits]


def split_hits(record: Record) -> list[Record]:
    """One record per impact of a recording, with some time before it; with fewer than two, the recording itself."""
    hits = find_hits(record)
    if len(hits) < 2:
        return [record]
    lead = int(_LEAD_SHARE * float(np.min(np.diff([hit.first for hit in hits]))))
    edges = [*(max(0, hit.first - lead) for hit in hits), len(record.response)]
    return [part_of(record, *ends, f" hit {number}") for number, ends in enumerate(pairwise(edges), start=1)]
