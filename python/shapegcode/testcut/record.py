"""Measured forces: file, position of each sample, removal of offset and drift, means over revolutions."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shapegcode.errors import ArgumentError
from shapegcode.io.record import UnevenTimeError, even_period
from shapegcode.io.table import TextTable
from shapegcode.io.units import FloatArray, Meaning, Measured, factor_between, read_label, unit_of
from shapegcode.testcut.cut import MeasuringPass, TestCut
from shapegcode.testcut.forces import Expected, fully_engaged

_EXAMPLE = "time_s,fx_n,fy_n"
#: Unit of `ForceRecord`, and of a column without unit.
_UNITS = {"time": "s", "displacement": "mm", "velocity": "mm/min", "force": "N", "torque": "N·m"}
#: Quantity, its kind, and the names of its column (without unit).
_NAMES: tuple[tuple[str, Measured, str], ...] = (
    ("time", "time", r"time|t|zeit|timestamp"),
    ("position", "displacement", r"position|pos|x|s|distance|way"),
    ("radial_depth", "displacement", r"radial[ _]?depth|rd|ae|a_e"),
    ("feed", "velocity", r"feed|f|vf|v_f|feed[ _]?rate"),
    ("fx", "force", r"f_?x|force[ _]?x|x[ _]?force"),
    ("fy", "force", r"f_?y|force[ _]?y|y[ _]?force"),
    ("torque", "torque", r"torque|m_?z|moment"),
)


@dataclass(frozen=True, eq=False)
class ForceRecord:
    """Measured forces, as acting on the tool."""

    file: str  # path
    force_n: FloatArray  # (n, 2) along the feed and to its left, in N
    torque_nm: FloatArray | None = None  # (n,) as measured, of either sign; None: not recorded
    time_s: FloatArray | None = None  # (n,), evenly spaced; None: not recorded
    position_mm: FloatArray | None = None  # (n,) X of the tool's axis in the program's coordinates; None: not recorded
    radial_depth_mm: FloatArray | None = None  # (n,) for means at known depths; None: from the test cut
    feed_mm_per_min: FloatArray | None = None  # (n,) if the file states it

    def __len__(self) -> int:
        return len(self.force_n)


def _names(name: str) -> Meaning | None:
    """The meaning of a column name; None: not used."""
    plain = name.strip(" _").lower()
    return next((Meaning(what, kind) for what, kind, pattern in _NAMES if re.fullmatch(pattern, plain)), None)


def _columns(table: TextTable) -> dict[str, tuple[int, float]]:
    """Index of each quantity's column, and the factor to the unit of `ForceRecord`."""
    found: dict[str, tuple[int, float]] = {}
    for index, label in enumerate(table.labels(lambda text, unit: read_label(text, unit, _names))):
        if label.meaning is None:
            continue
        what = label.meaning.what
        kind = next(kind for name, kind, _ in _NAMES if name == what)
        if kind != "force" and (label.unknown_unit or (label.unit is not None and label.unit.measures != kind)):
            continue  # another signal with a short name: "x [V]"
        unit = unit_of(table.where, label, (kind,))
        if what in found:
            raise ArgumentError(f"{table.where}: two columns of {what}: remove {label.text!r} or the other")
        found[what] = (index, 1.0 if unit is None else factor_between(unit, _UNITS[kind]))
    missing = [name for name in ("fx", "fy") if name not in found]
    if not missing and not {"time", "position", "radial_depth"} & set(found):
        missing = ["time, position or radial_depth"]
    if missing:
        raise ArgumentError(
            f"{table.where}: no column of {' and '.join(missing)}; the header is "
            f"{', '.join(table.layout.header)[:80] or 'missing'!r}; required: for example {_EXAMPLE}, "
            "position_mm,fx_n,fy_n or radial_depth_mm,fx_n,fy_n"
        )
    return found


def read_forces(path: str | Path, *, on: str = "workpiece") -> ForceRecord:
    """Read measured forces."""
    path = Path(path)
    table = TextTable(path)
    columns = _columns(table)
    numbers = table.numbers([index for index, _ in columns.values()], 4)  # four rows or more
    values = {name: numbers[:, k] * factor for k, (name, (_, factor)) in enumerate(columns.items())}
    sign = -1.0 if on == "workpiece" else 1.0
    time = values.get("time")
    if time is not None:
        try:
            period, _ = even_period(time)
        except UnevenTimeError as error:
            raise ArgumentError(f"{path}:{table.line_of(error.row)}: {error}") from error
        time = time[0] + period * np.arange(len(time))
    torque, position, depth, feed = map(values.get, ("torque", "position", "radial_depth", "feed"))
    if position is not None and depth is None and np.any(np.diff(position) < 0.0):
        row = int(np.argmax(np.diff(position) < 0.0)) + 1
        raise ArgumentError(f"{path}:{table.line_of(row)}: the position decreases: one pass per file, along +X")
    force = sign * np.column_stack([values["fx"], values["fy"]])
    return ForceRecord(str(path), force, torque, time, position, depth, feed)


MIN_SAMPLES = 6.0  # least samples per revolution of a record; a table of means has at most one row
_MIN_AIR_REVS, _GUARD_REVS = 5, 2
_ABOVE_NOISE, _ABOVE_SHARE = 6.0, 0.04  # least force in a cut, relative to the noise in air, and to the largest force
_CLEAR_LINE = 8.0  # height of a clear line, relative to the median of the spectrum around it
_MAX_SHIFT_MM, _SHIFT_STEPS = 1.0, 81
#: Allowed relative difference of the cut's length: at constant feed (another override), and otherwise.
_OTHER_FEED, _OTHER_LENGTH = 0.6, 0.03


@dataclass(frozen=True, eq=False)
class PlacedRecord:
    """A sampled record of one pass, without offset and drift of the dynamometer, with the position of each sample."""

    file: str
    cut: TestCut
    measuring: MeasuringPass
    time_s: FloatArray  # (n,)
    x_mm: FloatArray  # (n,) X of the tool's axis
    force_n: FloatArray  # (n, 2) on the tool, along the feed and to its left
    torque_nm: FloatArray | None  # (n, 1); None: not recorded
    samples: float  # per revolution
    spindle_rev_per_min: float  # from the record, or as commanded
    offset_n: FloatArray  # (2,) force shown in air before the cut
    drift_n: FloatArray  # (2,) its change until after the cut
    by_time: bool  # positions are from time and feed; else recorded
    notes: tuple[str, ...]  # remarks, with the name of the file


def place_samples(record: ForceRecord, cut: TestCut, measuring: MeasuringPass, forecast: Expected) -> PlacedRecord:
    """Remove offset and drift of a sampled record of one pass, and find the position of each sample."""
    time, moved = _times_and_travel(record, measuring, cut.kind)
    period = float(time[-1] - time[0]) / (len(time) - 1)
    turn = 60.0 / cut.spindle_rev_per_min
    if turn / period < MIN_SAMPLES:
        raise ArgumentError(
            f"{record.file}: {turn / period:.1f} samples per revolution: must be {MIN_SAMPLES:g} or more, better "
            f"{12 * cut.tool.flutes}; or use means over whole revolutions, at most one row per revolution"
        )
    begin, end = _contact(record, turn / period)
    speed, sure = _spindle_speed(record.force_n[begin:end], period, cut.spindle_rev_per_min, cut.tool.flutes)
    notes = []
    if sure and abs(speed / cut.spindle_rev_per_min - 1.0) > 0.002:
        notes.append(f"the spindle turned at {speed:.1f} rev/min instead of the commanded {cut.spindle_rev_per_min:g}")
    samples = 60.0 / speed / period
    per_tooth = samples / cut.tool.flutes
    if per_tooth < 16.0 and abs(per_tooth - round(per_tooth)) < 0.01:
        notes.append(
            f"{per_tooth:.1f} samples per tooth repeat the same angles: means may be wrong by some "
            "percent; record with more samples, or with a rate that is not a multiple of the tooth passing frequency"
        )
    force, offset, drift = _without_offset(record.force_n, begin, end, round(_GUARD_REVS * samples))
    torque = None
    if record.torque_nm is not None:
        torque = _without_offset(record.torque_nm[:, None], begin, end, round(_GUARD_REVS * samples))[0]
    size = np.linalg.norm(turned(force, samples), axis=1)
    x = _positions(record, measuring, forecast, size, time, moved, (begin, end), notes)
    named = tuple(f"{record.file}: {note}" for note in notes)
    file, by_time = record.file, record.position_mm is None
    return PlacedRecord(file, cut, measuring, time, x, force, torque, samples, speed, offset, drift, by_time, named)


def _times_and_travel(record: ForceRecord, measuring: MeasuringPass, kind: str) -> tuple[FloatArray, FloatArray]:
    """Time of each sample, and travel since the first one; if one is not recorded, computed from the commanded feed."""
    if record.position_mm is not None:
        x = record.position_mm
        if record.time_s is not None:
            return record.time_s, x - x[0]
        pace = 60.0 / measuring.commanded_feed(0.5 * (x[1:] + x[:-1]))
        return np.concatenate([[0.0], np.cumsum(np.diff(x) * pace)]), x - x[0]
    if record.time_s is None:
        raise ArgumentError(
            f"{record.file}: a table of means: a {kind} needs sampled records with time_s or position_mm"
        )
    time = record.time_s
    return time, (time - time[0]) * measuring.feed_mm_per_min / 60.0


def _spindle_speed(force_n: FloatArray, period_s: float, commanded: float, flutes: int) -> tuple[float, bool]:
    """Speed by the clearest spectral line of spindle, teeth or harmonics, and True; else the commanded one, False."""
    count = len(force_n)
    turns = count * period_s * commanded / 60.0
    if turns < 20.0:  # too few for a line
        return commanded, False
    padded = 1 << int(np.ceil(np.log2(4 * count)))
    window = np.hanning(count)[:, None]
    power = np.sum(np.abs(np.fft.rfft((force_n - force_n.mean(axis=0)) * window, padded, axis=0)) ** 2, axis=1)
    step = 1.0 / (padded * period_s)
    best: tuple[float, float] | None = None
    for order in (flutes, 1, 2 * flutes, 2):
        centre = order * commanded / 60.0
        low, high = (round(centre * side / step) for side in (0.95, 1.05))
        if high + 1 >= len(power) or high - low < 8:
            continue
        part = power[low : high + 1]
        peak = int(np.argmax(part))
        height = float(part[peak] / max(float(np.median(part)), 1e-300))
        if 0 < peak < len(part) - 1 and height > _CLEAR_LINE**2 and (best is None or height > best[0]):
            fine = _vertex(-np.log(np.maximum(part[peak - 1 : peak + 2], 1e-300)))
            best = height, (low + peak + fine) * step * 60.0 / order
    return (commanded, False) if best is None else (float(best[1]), True)


def turned(force: FloatArray, samples: float) -> FloatArray:
    """Centred moving mean of each column over a (fractional) number of samples."""
    middle = np.arange(len(force)) + 0.5
    low, high = np.clip(middle - 0.5 * samples, 0, len(force)), np.clip(middle + 0.5 * samples, 0, len(force))
    return np.asarray(_sums(force, low, high) / (high - low)[:, None])


def _sums(table: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Sum of each column between two (fractional) sample positions."""
    sums = np.vstack([np.zeros((1, table.shape[1])), np.cumsum(table, axis=0)])
    at = np.arange(len(sums), dtype=np.float64)
    return np.column_stack([np.interp(high, at, column) - np.interp(low, at, column) for column in sums.T])


def _contact(record: ForceRecord, samples: float) -> tuple[int, int]:
    """Approximate first and last sample of the cut."""
    air = round(_MIN_AIR_REVS * samples)
    if len(record) < 4 * air:
        raise ArgumentError(f"{record.file}: {len(record) / samples:.1f} revolutions: a pass has many more")
    smooth = turned(record.force_n, samples)
    before, after = smooth[:air], smooth[-air:]
    line = np.linspace(0.0, 1.0, len(smooth))[:, None]
    base = np.median(before, axis=0) * (1.0 - line) + np.median(after, axis=0) * line
    size = np.linalg.norm(smooth - base, axis=1)
    noise = float(np.sqrt(np.mean(np.var(before, axis=0) + np.var(after, axis=0))))
    level = max(_ABOVE_NOISE * noise, _ABOVE_SHARE * float(np.max(size)))
    cutting = np.flatnonzero(size > level)
    if cutting.size < 10 * samples:
        raise ArgumentError(
            f"{record.file}: no cut found: force {np.max(size):.3g} N, noise in the air {noise:.3g} N; the record "
            "must begin and end in the air"
        )
    begin, end = int(cutting[0]), int(cutting[-1])
    if begin < air or end > len(smooth) - air:
        where = f"no air {'before' if begin < air else 'after'} the cut"
        raise ArgumentError(f"{record.file}: {where}: record at least {_MIN_AIR_REVS} revolutions more there")
    return begin, end


def _without_offset(force: FloatArray, begin: int, end: int, guard: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Subtract the straight line through the force in air before and after the cut; also returns offset and drift."""
    air = (0, max(begin - guard, 1)), (min(end + guard, len(force) - 1), len(force))
    first, second = (0.5 * (low + high) for low, high in air)
    before, after = (force[low:high].mean(axis=0) for low, high in air)
    share = ((np.arange(len(force), dtype=np.float64) - first) / (second - first))[:, None]
    return force - (before * (1.0 - share) + after * share), before, after - before


def _positions(
    record: ForceRecord, measuring: MeasuringPass, forecast: Expected, size: FloatArray, time: FloatArray,
    moved: FloatArray, contact: tuple[int, int], notes: list[str],
) -> FloatArray:  # fmt: skip
    """X of the axis at each sample, from the entry; at constant feed without recorded positions also from the exit."""
    seen = np.flatnonzero(forecast.mean_n > _ABOVE_SHARE * forecast.mean_n.max())
    wanted, first = (forecast.x_mm[seen[0]], forecast.x_mm[seen[-1]]), contact[0]
    if record.position_mm is None and not measuring.constant_feed:
        # The travel over time is that of the blocks; only its start is searched.
        ends_mm = np.array([measuring.start_mm, *(end for end, _ in measuring.feeds)])
        pace = 60.0 / np.array([feed for _, feed in measuring.feeds])
        at = np.concatenate([[0.0], np.cumsum(np.diff(ends_mm) * pace)])
        moved = np.interp(time - time[first] + np.interp(wanted[0], ends_mm, at), at, ends_mm)
    length, wanted_length = moved[contact[1]] - moved[first], wanted[1] - wanted[0]
    free = record.position_mm is None and measuring.constant_feed
    if abs(wanted_length / length - 1.0) > (_OTHER_FEED if free else _OTHER_LENGTH):
        raise ArgumentError(
            f"{record.file}: the cut is {length:.2f} mm long instead of {wanted_length:.2f} mm: is it the right "
            "pass, and was the feed override 100 %?"
        )
    x = wanted[0] + (moved - moved[first]) * (wanted_length / length if free else 1.0)
    ends = [_shift(forecast, x, size, side) for side in wanted]
    if not free:
        return np.asarray(x + ends[0])
    # Both ends: offset and rate.
    share = (x - wanted[0]) / wanted_length
    x = x + ends[0] * (1.0 - share) + ends[1] * share
    rate = float(np.polyfit(time, x, 1)[0]) * 60.0
    if abs(rate / measuring.feed_mm_per_min - 1.0) > 0.005:
        notes.append(f"the feed was {rate:.1f} mm/min instead of the commanded {measuring.feed_mm_per_min:g}")
    return np.asarray(x)


def _shift(forecast: Expected, x: FloatArray, size: FloatArray, side: float) -> float:
    """Shift of X that aligns the force at one end of the cut with the expected one, for any scale."""
    near = np.flatnonzero(np.abs(x - side) < 3.0 * _MAX_SHIFT_MM)
    near = near[:: max(1, len(near) // 400)]
    measured, place = size[near], x[near]

    def misfit(shift: float) -> float:
        expected = np.interp(place + shift, forecast.x_mm, forecast.mean_n)
        factor = float(expected @ measured) / max(float(expected @ expected), 1e-300)
        return float(np.sum((measured - factor * expected) ** 2))

    tried = np.linspace(-_MAX_SHIFT_MM, _MAX_SHIFT_MM, _SHIFT_STEPS)
    errors = np.array([misfit(shift) for shift in tried])
    best = int(np.clip(np.argmin(errors), 1, _SHIFT_STEPS - 2))
    return float(tried[best] + _vertex(errors[best - 1 : best + 2]) * (tried[1] - tried[0]))


def _vertex(three: FloatArray) -> float:
    """Position of the minimum of the parabola through three values, in steps from the middle one; 0: no minimum."""
    left, middle, right = three.tolist()
    bend = left - 2.0 * middle + right
    return 0.5 * (left - right) / bend if bend > 0.0 else 0.0


_CHATTER, _MIN_CHATTER = 8.0, 0.02  # limit of chatter in standard deviations; least deviation, relative to the median


@dataclass(frozen=True, eq=False)
class Revolutions:
    """Means over whole revolutions of one pass."""

    record: PlacedRecord
    x_mm: FloatArray  # (n,) X of the tool's axis in the middle of each revolution
    mean_n: FloatArray  # (n, 2) mean force on the tool along the feed and to its left
    torque_nm: FloatArray | None  # (n,) mean torque; None: not recorded
    resultant_n: FloatArray  # (n,) mean magnitude
    peak_n: FloatArray  # (n,) largest magnitude
    # (n,) the force oscillates more, relative to its mean, than in the rest of the pass
    chatter: npt.NDArray[np.bool_]
    # mean feed of the pass, from the record; the first commanded one for a pass with changing feeds
    feed_mm_per_min: float


def revolutions(record: PlacedRecord) -> Revolutions:
    """Means over whole revolutions of a pass."""
    cut, measuring, x = record.cut, record.measuring, record.x_mm
    inside = np.flatnonzero((x >= measuring.start_mm) & (x <= measuring.end_mm))
    turns = int((inside[-1] - inside[0]) / record.samples)
    edges = inside[0] + np.arange(turns + 1) * record.samples
    size, torque = np.linalg.norm(record.force_n, axis=1), record.torque_nm
    recorded = [] if torque is None else [torque]
    table = np.hstack([record.force_n, size[:, None], size[:, None] ** 2, x[:, None], *recorded])
    means = _sums(table, edges[:-1], edges[1:]) / record.samples
    peaks = np.maximum.reduceat(size[: int(edges[-1])], edges[:-1].astype(np.intp))
    middle = means[:, 4]
    uneven = np.sqrt(np.maximum(means[:, 3] - np.sum(means[:, :2] ** 2, axis=1), 0.0))
    full = np.flatnonzero(fully_engaged(cut, measuring, middle))[_GUARD_REVS:-_GUARD_REVS]
    chatter = np.zeros(len(middle), dtype=bool)
    chatter[full] = _chatters(middle[full], uneven[full], means[full, 2])
    feed = measuring.feed_mm_per_min
    if measuring.constant_feed:
        feed = float(np.polyfit(record.time_s[inside], x[inside], 1)[0]) * 60.0
    torque = np.abs(means[:, 5]) if record.torque_nm is not None else None
    return Revolutions(record, middle, means[:, :2], torque, means[:, 2], peaks, chatter, feed)


def _chatters(x: FloatArray, uneven: FloatArray, resultant: FloatArray) -> npt.NDArray[np.bool_]:
    """Mask where the force oscillates more within a revolution, relative to its mean, than in the rest of the pass."""
    if len(uneven) < 20:
        return np.zeros(len(uneven), dtype=bool)
    share = uneven / np.maximum(resultant, 1e-300)
    place = (x - x.mean()) / max(float(np.ptp(x)), 1e-300)
    floor = _MIN_CHATTER * float(np.median(share))
    weight = np.ones(len(share))
    for _ in range(12):
        # Least absolute deviations, so that outliers do not bend the curve.
        off = share - np.polyval(np.polyfit(place, share, 2, w=np.sqrt(weight)), place)
        weight = 1.0 / np.maximum(np.abs(off), floor)
    spread = 1.4826 * float(np.median(np.abs(off))) + floor
    return np.asarray(off > _CHATTER * spread)
