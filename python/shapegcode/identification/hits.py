"""Where the hammer hit: pulses of the force, double hits, and a long recording divided into its hits."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shapegcode.io.record import FloatArray, Record

#: A pulse ends where it falls below this share of its peak; a half sine has then lost 0.01 % of its momentum.
_PULSE_ENDS = 0.01
#: ... or into the noise, so many standard deviations.
_NOISE_ENDS = 3.0
#: Pulses are looked for above this share of the largest force.
_SMALLEST_PULSE = 0.03
#: A pulse is a hit above this share of the largest force; below, somebody has touched the hammer.
_SMALLEST_HIT = 0.1
#: ... and above so many standard deviations of noise, which a million samples of noise do not reach.
_PULSE_NOISE = 7.0
#: A pulse that comes again within so many samples belongs to the one before: anti-aliasing filters ring for a few
#: samples, in force and response alike.
_RINGING_SAMPLES = 8
#: Nobody hits twice on purpose within this time: a hammer that comes down again sooner has bounced.
_BOUNCE_S = 0.1
#: Between two hits on purpose the response has fallen to this share of its peak.
_AT_REST = 0.1
#: A record cut out of a recording begins before its hit by this share of the time between the hits.
_LEAD_SHARE = 0.1
#: Normal noise: standard deviation over median absolute deviation.
_MAD = 1.4826


@dataclass(frozen=True)
class Hit:
    """One hit of the hammer."""

    first: int  # first sample of the pulse
    peak: int  # sample of its largest force
    end: int  # first sample after the pulse
    peak_n: float  # largest force over the offset; negative where the force is
    second_share: float = 0.0  # largest later pulse before the next hit, as a share of this one; 0: none
    second_s: float = 0.0  # how long after this one it comes


def robust_sigma(values: FloatArray) -> float:
    """Standard deviation of the noise of a signal that is quiet most of the time."""
    return _MAD * float(np.median(np.abs(values - np.median(values))))


def _pulses(force: FloatArray, sigma: float) -> list[Hit]:
    """Every pulse of a force without offset whose largest value is positive."""
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
        before = np.searchsorted(low, first)
        after = np.searchsorted(low, last)
        start = int(low[before - 1]) if before else 0
        end = int(low[after]) + 1 if after < low.size else len(force)
        top = first + int(np.argmax(force[first : last + 1]))
        found.append(Hit(start, top, end, float(force[top])))
    return found


def _rested(record: Record, noise: float, hit: Hit, next_hit: Hit) -> bool:
    """Whether the response has died away between two hits, or down to its noise."""
    between = (record.response - np.median(record.response))[hit.end : next_hit.first]
    peak = float(np.max(np.abs(between)))
    power = float(np.mean(between[-max(1, len(between) // 10) :] ** 2)) - noise**2
    return bool(np.sqrt(2.0 * max(power, 0.0)) <= _AT_REST * peak)


def find_hits(record: Record) -> list[Hit]:
    """The hits of a record, in their order; pulses of a bounce belong to the hit before.

    A pulse is a new hit if it comes 0.1 s or more after the one before, the response has died away to a tenth
    meanwhile, and it has at least a tenth of the largest force.
    """
    if record.force_n is None or not np.ptp(record.force_n) > 0.0:
        return []
    force = record.force_n - np.median(record.force_n)
    sign = 1.0 if np.max(force) >= -np.min(force) else -1.0
    hits: list[Hit] = []
    largest = float(np.max(sign * force))
    noise = 0.0
    for pulse in _pulses(sign * force, robust_sigma(force)):
        if not hits and pulse.first > 1:
            noise = float(np.std(record.response[: pulse.first - 1]))
        if hits:
            gap = (pulse.first - hits[-1].end) * record.period_s
            small = pulse.peak_n < _SMALLEST_HIT * largest
            if small or gap < _BOUNCE_S or not _rested(record, noise, hits[-1], pulse):
                share = pulse.peak_n / abs(hits[-1].peak_n)
                if share > hits[-1].second_share:
                    late = (pulse.peak - hits[-1].peak) * record.period_s
                    hits[-1] = replace(hits[-1], second_share=share, second_s=late)
                continue
        hits.append(pulse)
    return [replace(hit, peak_n=sign * hit.peak_n) for hit in hits]


def split_hits(record: Record) -> list[Record]:
    """One record for each hit of a recording, each with some time before the hit.

    A record with one hit, or without force, comes back as it is.
    """
    hits = find_hits(record)
    if len(hits) < 2:
        return [record]
    assert record.force_n is not None
    gaps = np.diff([hit.first for hit in hits])
    lead = int(_LEAD_SHARE * float(np.min(gaps)))
    starts = [max(0, hit.first - lead) for hit in hits]
    ends = [*starts[1:], len(record.response)]
    return [
        replace(
            record,
            source=f"{record.source} hit {number}",
            response=record.response[start:end],
            force_n=record.force_n[start:end],
            start_s=record.start_s + start * record.period_s,
        )
        for number, (start, end) in enumerate(zip(starts, ends, strict=True), start=1)
    ]
