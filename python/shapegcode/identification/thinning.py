"""Fewer samples of the same taps: no more than the band needs, behind one filter that force and response share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import firwin, kaiserord, oaconvolve

from shapegcode.identification.checks import LEAST_PULSE
from shapegcode.identification.prepared import Prepared
from shapegcode.identification.spectra import decay_spectrum
from shapegcode.io.record import FloatArray, Record

#: Of the new sampling rate: the filter is flat up to here ...
FLAT = 0.35
#: ... and has fallen to -80 dB at half of it, as the filters of recorders do.
_STOP_DB = 80.0
#: The band ends at this share of the new rate at most.
_BAND = 0.34
#: Fewer samples than this need no thinning.
_FEW = 4096
#: What stands out of the response above the band that the hit excites is looked at with this margin.
_MARGIN = 1.25
_MARGIN_OF_BLOWS = 2.0
_GRID = 8  # points of the filter's transform per tap


@dataclass(frozen=True, eq=False)
class Thinned:
    """Taps with fewer samples."""

    responses: list[FloatArray]  # (n,) each
    forces: list[FloatArray]  # (n,) each, of a recorder's force
    straight: list[FloatArray]  # (n,) each, of a force that runs straight from sample to sample
    period_s: float  # time between two samples
    factor: int  # of how many samples one is left
    # share of the band up to half the new rate that the filter lets pass, in power: what is left of white noise
    white_share: float
    noise_correlation: float  # between two samples on end of white noise behind the filter
    # noise per sample of the pulse, as a share of what it was: the pulse's momentum is known as before
    force_noise: float
    first_s: list[float]  # time of the first new sample after that of the old first, per record; negative: before it


def highest_of_interest_hz(ready: Prepared, asked_hz: float | None) -> float:
    """Up to where a tap must be sampled for its modes to be found.

    Modes above the band are part of what is measured within it: what stands out of the response is fitted along.
    """
    excited = max((value for value in ready.excited_hz if value is not None), default=0.0)
    margin = _MARGIN
    if are_blows(ready):  # they excite all that the rate holds
        excited, margin = 0.0, _MARGIN_OF_BLOWS
    peaks = [
        peak.frequency_hz
        for record, hit in zip(ready.records, ready.hits, strict=True)
        for peak in decay_spectrum(_after(record, 0 if hit is None else hit.first)).peaks
    ]
    return max(excited if asked_hz is None else asked_hz, margin * max(peaks, default=0.0))


def _after(record: Record, first: int) -> Record:
    return Record(record.source, record.period_s, record.response[first:], record.quantity)


def thin(ready: Prepared, highest_hz: float) -> Thinned | None:
    """Leave out samples that the band does not need.

    Force and response pass the same filter of linear phase, whose delay is taken away: their ratio stays what it was.
    The record is taken as at rest before its first sample; where the pulse comes soon after it, it begins earlier by as
    much as the filter spreads the pulse.
    """
    period = ready.records[0].period_s
    factor = int(_BAND / (highest_hz * period)) if highest_hz > 0.0 else 1
    longest = max(len(record.response) for record in ready.records)
    factor = min(factor, longest // (_FEW // 2))
    if factor < 2 or longest <= _FEW or (are_blows(ready) and ready.records[0].quantity == "velocity"):
        return None
    plain, straight = _filters(factor)
    reach = len(plain) // 2
    responses, forces, courses, first_s, widths = [], [], [], [], []
    for record in ready.records:
        force = record.force_n
        assert force is not None
        acts = np.flatnonzero(force)
        # Samples to put before the record, so that nothing of the pulse is spread beyond it.
        before = max(0, 2 * reach + factor - int(acts[0]))
        lead = np.zeros(before)
        places = slice(reach, before + len(force) - reach, factor)
        response = oaconvolve(np.concatenate((lead, record.response)), plain, "same")[places]
        both = [oaconvolve(np.concatenate((lead, force)), taps, "same")[places] for taps in (plain, straight)]
        inside = np.arange(before + len(force))[places]
        near = (inside >= before + acts[0] - reach) & (inside <= before + acts[-1] + reach)
        forces.append(np.where(near, both[0], 0.0))
        courses.append(np.where(near, both[1], 0.0))
        responses.append(np.ascontiguousarray(response))
        first_s.append((reach - before) * period)
        widths.append((acts[-1] - acts[0] + 1) / np.count_nonzero(near))
    whole = float(np.sum(plain**2))
    return Thinned(
        responses,
        forces,
        courses,
        period * factor,
        factor,
        whole * factor,
        float(np.sum(plain[factor:] * plain[:-factor])) / whole,
        float(np.sqrt(np.mean(widths))) / factor,
        first_s,
    )


def are_blows(ready: Prepared) -> bool:
    """Whether the pulses are single blows of one or two samples."""
    forces = (record.force_n for record in ready.records)
    return any(np.count_nonzero(force) < LEAST_PULSE for force in forces if force is not None)


def _filters(factor: int) -> tuple[FloatArray, FloatArray]:
    """The filter, and what it is of a force that runs straight between its samples: (sin x / x)² of its spectrum."""
    count, beta = kaiserord(_STOP_DB, (0.5 - FLAT) * 2.0 / factor)
    count |= 1
    plain = firwin(count, (0.5 + FLAT) / factor, window=("kaiser", beta))
    size = _GRID * count
    spectrum = np.fft.rfft(plain, size) * np.sinc(np.fft.rfftfreq(size)) ** 2
    return np.asarray(plain, dtype=np.float64), np.asarray(np.fft.irfft(spectrum, size)[:count], dtype=np.float64)
