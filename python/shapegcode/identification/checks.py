"""Which records can be used: double hits, overload, missing force, too short, too slow; and what their noise is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.identification.decay import find_decay
from shapegcode.identification.hits import Hit, find_hits, split_hits
from shapegcode.identification.prepared import Prepared, Refused
from shapegcode.identification.quality import DECAYED, excited_hz, is_clipped, refuse_short
from shapegcode.io.record import UNITS, FloatArray, Record

#: A second pulse above this share of the first is refused: the momentum, and so the mass, would be off by as much.
#: Below, it may be the ringing of an anti-aliasing filter, which reaches 9 %.
DOUBLE_HIT = 0.1
#: The force must stand out of its noise by this factor: the mass would be off by about the inverse.
LEAST_FORCE = 10.0
#: A pulse of fewer samples does not tell its momentum: with three, a half sine is known to about 10 %.
LEAST_PULSE = 3
#: Samples before the hit from which noise and offset are measured: a standard deviation to 25 %.
LEAST_LEAD = 8
#: A record that begins inside the pulse at more than this share of its peak has lost too much of the momentum.
_CUT_PULSE = 0.2
#: The machine was at rest before the hit if it shook less than this share of what it did afterwards.
_AT_REST = 0.1
#: The force counts for half a pulse on either side of it, and for so many samples at least: the feet of the pulse hold
#: some tenths of a percent of its momentum.
_LEAST_MARGIN = 3
#: An offset is taken away where it exceeds so many standard errors of its mean.
_OFFSET_ERRORS = 2.0
#: An offset of the force above this share of the peak is told.
_OFFSET_TOLD = 0.05
#: Correlation of force and response below which the two point against one another.
_OPPOSED = -0.7
#: Sampling periods may differ by this share: a file of six digits is off by less than a sample in a whole record.
_SAME_PERIOD = 1e-5


def _mean_to_remove(values: FloatArray) -> float:
    """Mean of a quiet stretch, 0 where it is within its own uncertainty."""
    mean = float(np.mean(values))
    error = float(np.std(values)) / np.sqrt(len(values))
    return mean if abs(mean) > _OFFSET_ERRORS * error else 0.0


def _orient(record: Record, hit: Hit, response: FloatArray, force: FloatArray, warnings: list[str]) -> FloatArray:
    """The response with the sign that the push of the hammer gives it at the point of the tap."""
    if hit.end - hit.first < LEAST_PULSE:
        return response
    stretch = slice(hit.first, min(hit.end + (hit.end - hit.first), len(force)))
    push = force[stretch]
    if record.quantity != "acceleration":
        push = np.cumsum(push)
    if record.quantity == "displacement":
        push = np.cumsum(push)
    moved = response[stretch]
    norm = float(np.linalg.norm(push) * np.linalg.norm(moved))
    if norm > 0.0 and float(push @ moved) / norm < _OPPOSED:
        warnings.append(
            f"{record.source}: the response goes against the push of the hammer: its sign is turned, as for a sensor "
            "at the same point that points the other way"
        )
        return -response
    return response


@dataclass(frozen=True, eq=False)
class _Usable:
    """A record that passed, and its figures."""

    record: Record
    force_noise_n: float | None
    response_noise: float | None
    excited_hz: float | None
    hit: Hit | None


def _tap(record: Record, band_hz: float | None, warnings: list[str]) -> _Usable:
    """Check a record with force."""
    force = record.force_n
    assert force is not None
    if not np.ptp(force) > 0.0:
        raise RecordError(
            f"zero force: every sample is {force[0]:zg} N; needed is the hammer's signal, or take it as a free decay "
            "(--ignore-force)"
        )
    for name, values in (("force", force), (f"response ({record.quantity})", record.response)):
        if is_clipped(values):
            top = float(values[np.argmax(np.abs(values - np.median(values)))])
            raise RecordError(
                f"overload: the {name} is cut off at {top:.5g}; needed is a larger range of the input or a softer hit"
            )
    hits = find_hits(record)
    off_pulse = np.ones(len(force), dtype=bool)
    for each in hits:
        off_pulse[each.first : each.end] = False
    quiet = force[off_pulse]
    sigma = float(np.std(quiet)) if quiet.size >= LEAST_LEAD else 0.0
    if not hits or abs(hits[0].peak_n) < LEAST_FORCE * sigma:
        peak = float(np.max(np.abs(force - np.median(force))))
        raise RecordError(
            f"no hit stands out: the largest force, {peak:.4g} N, is less than {LEAST_FORCE:g} times its noise of "
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
            "the record begins inside the pulse: part of the force is missing; needed is a pre-trigger of some "
            f"{LEAST_LEAD} samples or more"
        )
    if hit.second_share > 0.0:
        warnings.append(
            f"{record.source}: a second pulse of {100 * hit.second_share:.0f} % comes {1000 * hit.second_s:.3g} ms "
            "after the first: taken as ringing and left out of the force"
        )
    return _windowed(record, hit, quiet, sigma, band_hz, warnings)


def _windowed(
    record: Record, hit: Hit, quiet: FloatArray, sigma: float, band_hz: float | None, warnings: list[str]
) -> _Usable:
    assert record.force_n is not None
    where = record.source
    offset = _mean_to_remove(quiet) if quiet.size >= LEAST_LEAD else 0.0
    if abs(offset) > _OFFSET_TOLD * abs(hit.peak_n):
        warnings.append(f"{where}: offset of the force, {offset:.4g} N, taken away")
    force = np.zeros(len(record.force_n))
    margin = max(_LEAST_MARGIN, (hit.end - hit.first) // 2)
    window = slice(max(hit.first - margin, 0), hit.end + margin)
    force[window] = record.force_n[window] - offset
    if hit.peak_n < 0.0:
        warnings.append(f"{where}: the pulse is negative: a hammer only pushes, so the sign of the force is turned")
        force = -force
    response, noise = record.response, None
    lead = response[: max(hit.first - 1, 0)]
    if len(lead) < LEAST_LEAD:
        warnings.append(
            f"{where}: {len(lead)} samples before the hit: noise and offset are measured from {LEAST_LEAD} or more "
            "(pre-trigger)"
        )
    else:
        response = response - _mean_to_remove(lead)
        noise = float(np.std(lead))
        after = float(np.sqrt(np.mean(response[hit.end :][: len(lead)] ** 2))) if hit.end < len(response) else 0.0
        if noise > _AT_REST * after > 0.0:
            warnings.append(
                f"{where}: before the hit the sensor shows {100 * noise / after:.0f} % of what it shows afterwards: "
                "noise, or the machine was not at rest"
            )
    width = int(np.count_nonzero(np.abs(force) > 0.1 * abs(hit.peak_n)))
    if width < LEAST_PULSE:
        warnings.append(
            f"{where}: the pulse has {width} samples above a tenth of its peak: below {LEAST_PULSE} its momentum, and "
            "so the mass, is uncertain; sample faster or take a softer tip"
        )
    strongest = refuse_short(
        record, response[hit.first if hit.end - hit.first > LEAST_PULSE else hit.end :], noise or 0.0, band_hz, warnings
    )
    reached = excited_hz(force, record.period_s)
    wanted = band_hz or strongest
    if reached < wanted:
        warnings.append(
            f"{where}: the hit excites up to {reached:.4g} Hz (-20 dB), less than "
            f"{'the' if band_hz else 'the strongest vibration at'} {wanted:.4g} Hz"
            f"{' asked for' if band_hz else ''}: take a harder tip"
        )
    response = _orient(record, hit, response, force, warnings)
    return _Usable(replace(record, response=response, force_n=force), sigma, noise, reached, hit)


def _decay(record: Record, band_hz: float | None, start_s: float | None, warnings: list[str]) -> _Usable:
    """Check a record without force."""
    free = find_decay(record, start_s)
    if is_clipped(free.response):
        raise RecordError(
            f"overload: the response ({record.quantity}) is cut off at {np.max(np.abs(free.response)):.5g} "
            f"{UNITS[record.quantity]}; needed is a larger range of the input"
        )
    refuse_short(free, free.response, 0.0, band_hz, warnings)
    tenth = free.response[-max(len(free.response) // 10, LEAST_LEAD) :]
    offset = float(np.mean(tenth))
    still = float(np.std(tenth)) < DECAYED * float(np.std(free.response[: len(tenth)]))
    if still and _mean_to_remove(tenth):
        free = replace(free, response=free.response - offset)
    return _Usable(free, None, None, None, None)


def prepare(records: Sequence[Record], *, band_hz: float | None = None, start_s: float | None = None) -> Prepared:
    """Divide recordings into hits, find where decays begin, and leave out what cannot be used.

    The force is set to 0 outside its pulse after its offset is taken away, and the offset of the response where it
    shows before the hit.
    """
    if not records:
        raise RecordError("no record: needed is at least one tap or decay")
    _refuse_mixture(records)
    warnings = list(dict.fromkeys(text for record in records for text in record.warnings))
    notes = tuple(dict.fromkeys(text for record in records for text in record.notes))
    usable: list[_Usable] = []
    refused: list[Refused] = []
    for record in (part for each in records for part in split_hits(each)):
        try:
            if record.force_n is not None:
                usable.append(_tap(record, band_hz, warnings))
            else:
                usable.append(_decay(record, band_hz, start_s, warnings))
        except RecordError as error:
            refused.append(Refused(record.source, str(error).removeprefix(f"{record.source}: ")))
    if not usable:
        raise RecordError("no record can be used:\n" + "\n".join(f"{each.source}: {each.reason}" for each in refused))
    return Prepared(
        records=tuple(each.record for each in usable),
        refused=tuple(refused),
        warnings=tuple(warnings),
        notes=notes,
        force_noise_n=tuple(each.force_noise_n for each in usable),
        response_noise=tuple(each.response_noise for each in usable),
        excited_hz=tuple(each.excited_hz for each in usable),
        hits=tuple(each.hit for each in usable),
    )


def _refuse_mixture(records: Sequence[Record]) -> None:
    """Refuse records that do not belong together."""
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
        if abs(first.period_s / other.period_s - 1.0) > _SAME_PERIOD:
            raise RecordError(
                f"{first.source} has a sample every {first.period_s:.9g} s, {other.source} every "
                f"{other.period_s:.9g} s: must be sampled alike"
            )
