"""Evaluates records of test cuts: coefficients of a taper, resultant in a corner, shortest interval of feed changes."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import takewhile
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.ndimage import find_objects, label
from scipy.special import lambertw

from shapegcode.errors import ArgumentError
from shapegcode.io.units import FloatArray
from shapegcode.testcut import forces, result
from shapegcode.testcut.cut import CuttingLaw, IntervalDetails, MeasuringPass, TestCut, read_test_cut
from shapegcode.testcut.forces import Engagement, ForceLaw, MeanForces, Thickness, engagement, expected, fully_engaged
from shapegcode.testcut.record import (
    MIN_SAMPLES,
    ForceRecord,
    PlacedRecord,
    Revolutions,
    place_samples,
    read_forces,
    revolutions,
    turned,
)
from shapegcode.testcut.result import CornerResult, IntervalResult, TaperResult

_Record = str | Path | ForceRecord


def fit_test_cut(
    cut: TestCut | str | Path,
    records: Sequence[_Record] | Mapping[int, _Record],
    *,
    forces_on: str = "workpiece",
    chip_thickness: Thickness = "mean",
    edge_forces: bool = False,
) -> TaperResult | CornerResult | IntervalResult:
    """Fit cutting-force parameters to the measured forces of a test cut.

    Args:
        cut: the test cut, or its side file.
        records: files of the passes in order, or by pass number, from 1; see docs/howto/test_cuts.md.
        forces_on: the measured forces act on "workpiece" (as from a dynamometer below it) or "tool".
        chip_thickness: taper: chip thickness of the power laws, "mean" of the engagement or "local".
        edge_forces: taper: also fit the edge forces, K_te and K_re.

    Returns:
        For a taper the coefficients of the cutting force, for a corner measured and expected resultant, for an
        interval test the shortest interval that the controller follows.

    Raises:
        ArgumentError: an unusable file, or records that do not match the cut or do not determine the result.
        OSError: a file cannot be read.
    """
    known = cut if isinstance(cut, TestCut) else read_test_cut(cut)
    by_pass = records if isinstance(records, Mapping) else dict(enumerate(records, start=1))
    for number, record in by_pass.items():
        if not 1 <= number <= len(known.passes):
            raise ArgumentError(f"{record}: pass {number}: the test cut has {len(known.passes)} passes")
    if known.kind != "taper" and (edge_forces or chip_thickness != "mean"):
        raise ArgumentError(f"the test cut is a {known.kind}: edge forces and chip thickness are for a taper")
    measured = {
        number: record if isinstance(record, ForceRecord) else read_forces(record, on=forces_on)
        for number, record in by_pass.items()
    }
    if known.kind == "taper":
        return _fit_taper(known, measured, thickness=chip_thickness, edge=edge_forces)
    return _fit_corner(known, measured) if known.kind == "corner" else _fit_interval(known, measured)


_BINS_PER_PASS = 60
_ONE_FILE = np.zeros(0, dtype=np.intp)  # placeholder: groups are numbered when files are joined
_PLACE = 0.25  # standard error of the tool's position found from entry and exit, in feeds per revolution


def _fit_taper(cut: TestCut, measured: Mapping[int, ForceRecord], *, thickness: Thickness, edge: bool) -> TaperResult:
    law = cut.tool.cutting
    sampled = any(_samples(cut, number, record) >= MIN_SAMPLES for number, record in measured.items())
    for _ in range(2 if sampled else 1):
        # The positions of entry and exit depend slightly on the law.
        rows, passes, left_out, warnings = _reduced(cut, measured, law)
        data = _joined(rows)
        fit = forces.fit_coefficients(data, cut.tool, cut.axial_depth_mm, thickness=thickness, edge=edge)
        law = fit.law
    if fit.outlier.any():
        warnings.append(f"{fit.outlier.sum()} of {len(fit.outlier)} mean forces do not fit the others: ignored")
    low, high = float(fit.chip_mm.min()), float(fit.chip_mm.max())
    return TaperResult(
        cut.program, cut.machine, fit.law, fit.coefficients, fit.at_chip,
        result.ChipRange(low, high, fit.middle_chip_mm), len(fit.chip_mm), int(fit.outlier.sum()),
        (float(fit.rms_n[0]), float(fit.rms_n[1])), fit.rms_percent, fit.correlation, passes=tuple(passes),
        left_out=tuple(left_out), poor=tuple(_poor(fit)), warnings=tuple(warnings), cut=cut, fit=fit, data=data,
    )  # fmt: skip


def _poor(fit: forces.CoefficientFit) -> Iterator[str]:
    """Messages for poorly known coefficients of the power laws."""
    for each in fit.coefficients[:4]:
        half = 0.5 * (each.high - each.low)
        if each.name.endswith("exponent"):
            if half > result.EXPONENT_LIMIT:
                yield f"{each.name} is known only to +-{half:.3f} (needed: +-{result.EXPONENT_LIMIT:g})"
        elif half > result.FACTOR_LIMIT * each.value:
            share = 100.0 * half / each.value
            yield f"{each.name} is known only to +-{share:.0f} % (needed: +-{100 * result.FACTOR_LIMIT:g} %)"


def _samples(cut: TestCut, number: int, record: ForceRecord) -> float:
    """Samples of a record per revolution; 0 if its rows are means at known radial depths."""
    if record.radial_depth_mm is not None:
        return 0.0
    turn = 60.0 / cut.spindle_rev_per_min
    if record.time_s is not None:
        return float(turn / np.mean(np.diff(record.time_s)))
    assert record.position_mm is not None
    travel = float(np.ptp(record.position_mm)) / (len(record) - 1)
    return cut.passes[number - 1].feed_mm_per_min / cut.spindle_rev_per_min / max(travel, 1e-12)


def _reduced(
    cut: TestCut, measured: Mapping[int, ForceRecord], law: CuttingLaw
) -> tuple[list[MeanForces], list[result.TaperPass], list[result.LeftOut], list[str]]:
    """Reduce records to mean forces: means as recorded, or over revolutions in full engagement without chatter."""
    rows: list[MeanForces] = []
    passes: list[result.TaperPass] = []
    left_out: list[result.LeftOut] = []
    warnings: list[str] = []
    for number, record in measured.items():
        measuring = cut.passes[number - 1]
        if _samples(cut, number, record) <= 1.0 + 1e-6:
            rows.append(_of_means(cut, measuring, record))
            continue
        found = revolutions(place_samples(record, cut, measuring, expected(cut, measuring, law)))
        shown = found.record
        offset, drift = ((float(along), float(left)) for along, left in (shown.offset_n, shown.drift_n))
        passes.append(result.TaperPass(shown.file, found.feed_mm_per_min, shown.spindle_rev_per_min, offset, drift))
        warnings += shown.notes
        rows.append(_of_revolutions(cut, measuring, found))
        for (part,) in find_objects(label(found.chatter)[0]):
            low, high = (float(found.x_mm[part][end]) for end in (0, -1))
            left_out.append(result.LeftOut(number, low, high))
            warnings.append(
                f"{shown.file}: X {low:.1f} to {high:.1f} mm ignored: the force oscillates far more there than in the "
                "rest of the pass (chatter?)"
            )
    return rows, passes, left_out, warnings


def _of_means(cut: TestCut, measuring: MeasuringPass, record: ForceRecord) -> MeanForces:
    """Use rows that are means already, at the file's radial depths or positions."""
    if record.radial_depth_mm is not None:
        depth = record.radial_depth_mm
        wrong = np.flatnonzero((depth <= 0.0) | (depth >= 2.0 * cut.tool.radius_mm))
        if wrong.size:
            raise ArgumentError(
                f"{record.file}: a radial depth of {depth[wrong[0]]:g} mm: must be above 0 and below the diameter, "
                f"{cut.tool.diameter_mm:g} mm"
            )
        row = np.ones(len(depth), dtype=bool)
        met = forces.straight_engagement(cut.tool, depth, up=cut.up)
    else:
        if record.position_mm is None:
            raise ArgumentError(
                f"{record.file}: means over time have no position; required: position_mm or radial_depth_mm"
            )
        row = fully_engaged(cut, measuring, record.position_mm)
        met = engagement(cut.tool, measuring, record.position_mm[row], up=cut.up)
    torque = None if record.torque_nm is None else np.abs(record.torque_nm[row])
    one = np.ones(int(row.sum()))
    feed = measuring.feed_mm_per_min * one if record.feed_mm_per_min is None else record.feed_mm_per_min[row]
    speed = cut.spindle_rev_per_min * one
    return MeanForces(met, feed, speed, record.force_n[row], one, _ONE_FILE, torque_nm=torque)


def _of_revolutions(cut: TestCut, measuring: MeasuringPass, found: Revolutions) -> MeanForces:
    """Mean forces over groups of revolutions without chatter."""
    margin = 2.0 * found.feed_mm_per_min / found.record.spindle_rev_per_min
    kept = np.flatnonzero(fully_engaged(cut, measuring, found.x_mm, margin) & ~found.chatter)
    if kept.size < 4:
        raise ArgumentError(f"{found.record.file}: {kept.size} revolutions in full engagement: too few")
    many = max(1, kept.size // _BINS_PER_PASS)
    # A bin contains consecutive revolutions only: none spans an ignored part.
    runs = np.split(kept, np.flatnonzero(np.diff(kept) > 1) + 1)
    bins = np.vstack([run[: len(run) // many * many].reshape(-1, many) for run in runs])
    x = found.x_mm[bins].mean(axis=1)
    met = engagement(cut.tool, measuring, x, up=cut.up)
    speed = found.record.spindle_rev_per_min
    displaced = engagement(cut.tool, measuring, x + _PLACE * found.feed_mm_per_min / speed, up=cut.up)
    force = found.mean_n[bins].mean(axis=1)
    torque = None if found.torque_nm is None else found.torque_nm[bins].mean(axis=1)
    one = np.ones(len(x))
    feed = found.feed_mm_per_min * one
    return MeanForces(met, feed, speed * one, force, many * one, _ONE_FILE, displaced, torque)


def _joined(rows: Sequence[MeanForces]) -> MeanForces:
    def column(name: str) -> FloatArray:
        return np.concatenate([getattr(each, name) for each in rows])

    # A torque in only some of the files is not used.
    torques = [each.torque_nm for each in rows if each.torque_nm is not None]
    torque = np.concatenate(torques) if len(torques) == len(rows) else None
    met, displaced = ([each.met for each in rows], [each.displaced or each.met for each in rows])
    group = np.repeat(np.arange(len(rows)), [len(each.force_n) for each in rows])
    feed, speed, force, turns = map(column, ("feed_mm_per_min", "spindle_rev_per_min", "force_n", "revolutions"))
    return MeanForces(Engagement.joined(met), feed, speed, force, turns, group, Engagement.joined(displaced), torque)


def _fit_corner(cut: TestCut, measured: Mapping[int, ForceRecord]) -> CornerResult:
    """Measured against expected resultant (paper 001, figure 7)."""
    passes = {}
    for number, record in measured.items():
        measuring = cut.passes[number - 1]
        forecast = expected(cut, measuring)
        found = revolutions(place_samples(record, cut, measuring, forecast))
        seen = _inside(cut, number, found.x_mm) & ~found.chatter
        far = _inside(cut, number, forecast.x_mm)
        recorded = float(found.resultant_n[seen].max()), float(found.peak_n[seen].max())
        wanted = float(forecast.mean_resultant_n[far].max()), float(forecast.peak_resultant_n[far].max())
        passes[number] = result.CornerPass(number, *recorded, *wanted, found, forecast)
    first = passes[min(passes)]
    seen = _inside(cut, first.number, first.record.x_mm) & ~first.record.chatter
    there = np.interp(first.record.x_mm[seen], first.forecast.x_mm, first.forecast.mean_resultant_n)
    ratio = None
    if {1, 2} <= set(passes):
        before, after = passes[1], passes[2]
        of_mean = after.measured_mean_n / before.measured_mean_n
        ratio = result.ForceRatio(of_mean, after.expected_mean_n / before.expected_mean_n)
    return CornerResult(
        program=cut.program,
        machine=cut.machine,
        peaks=tuple(passes.values()),
        ratio=ratio,
        scale=float(there @ first.record.resultant_n[seen] / (there @ there)),
        warnings=tuple(note for each in passes.values() for note in each.record.record.notes),
    )


def _inside(cut: TestCut, number: int, x_mm: FloatArray) -> npt.NDArray[np.bool_]:
    measuring = cut.passes[number - 1]
    margin = 4.0 * measuring.feed_mm_per_min / cut.spindle_rev_per_min
    return fully_engaged(cut, measuring, x_mm, margin)


_DEVIATION_LIMIT, _NOISE_SHARE = 0.05, 2.0
_LAGS_S = np.concatenate([[0.0], np.geomspace(2e-3, 0.5, 49)])


def _fit_interval(cut: TestCut, measured: Mapping[int, ForceRecord]) -> IntervalResult:
    """From which interval on the controller follows the commanded feeds."""
    passes = [(number, cut.passes[number - 1], record) for number, record in measured.items()]
    records = {number: place_samples(each, cut, at, expected(cut, at)) for number, at, each in passes}
    found = sorted((_followed(cut, number, record) for number, record in records.items()), key=lambda p: p.interval_mm)
    good = [each.interval_mm for each in takewhile(lambda each: each.ok, reversed(found))]
    fastest = max(feed for each in cut.passes for _, feed in each.feeds)
    lag = float(np.median([each.lag_s for each in found]))
    return IntervalResult(
        program=cut.program,
        machine=cut.machine,
        interval_mm=good[-1] if good else None,
        lag_interval_mm=lag * math.log(10.0) * fastest / 60.0,
        passes=tuple(found),
        warnings=tuple(note for each in found for note in records[each.number].notes),
    )


def _followed(cut: TestCut, number: int, record: PlacedRecord) -> result.FollowedPass:
    assert isinstance(cut.about, IntervalDetails)
    measuring, interval = cut.passes[number - 1], cut.about.intervals_mm[number - 1]
    first, last = measuring.feeds[0][0], measuring.feeds[-2][0]
    feeds, levels = _levels(cut, measuring, cut.about.radial_depth_mm)

    force = np.linalg.norm(turned(record.force_n, record.samples), axis=1)
    straight = fully_engaged(cut, measuring, record.x_mm, 1.0) & (record.x_mm < first - 0.5)
    if not straight.any():
        raise ArgumentError(f"{record.file}: nothing was recorded before the feed changes")
    force = force * float(np.interp(measuring.feed_mm_per_min, feeds, levels) / force[straight].mean())

    entry = float(np.interp(first, record.x_mm, record.time_s))
    within = (record.time_s > entry - 0.2) & (record.x_mm < last + 2.0)
    time, size = record.time_s[within], force[within]

    def course(lag: float) -> FloatArray:
        by_time = record.by_time
        speed = _speeds(measuring, time - entry, lag) if by_time else _speeds_at(measuring, record.x_mm[within], lag)
        return turned(np.interp(speed, feeds, levels)[:, None], record.samples)[:, 0]

    errors = [float(np.mean((course(lag) - size) ** 2)) for lag in _LAGS_S]
    lag = float(_LAGS_S[int(np.argmin(errors))])
    immediate = course(0.0)
    # Means over the second half of each block.
    x = record.x_mm[within]
    halves = [(end, (x > end - 0.5 * interval) & (x <= end)) for end, _ in measuring.feeds[1:-1]]
    rows = [(end, immediate[half].mean(), size[half].mean()) for end, half in halves if half.any()]
    ends, wanted, seen = np.array(rows).T
    off = np.abs(seen - wanted) / wanted
    noise = _noise(record.x_mm[straight], force[straight], 0.5 * interval)
    worst = int(np.argmax(off))
    ok = bool(off[worst] <= _DEVIATION_LIMIT + _NOISE_SHARE * noise)
    told = number, interval, float(off[worst]), float(ends[worst]), noise, lag, ok
    return result.FollowedPass(*told, time, size, immediate, course(lag))


def _levels(cut: TestCut, measuring: MeasuringPass, radial_depth_mm: float) -> tuple[FloatArray, FloatArray]:
    """Feeds below, between and above those of a pass, and the mean force at each."""
    commanded = [feed for _, feed in measuring.feeds]
    low, high = np.linspace(0.2, 0.98, 40) * min(commanded), np.linspace(0.5, 1.1, 40) * max(commanded)
    feeds = np.sort(np.concatenate([low, high]))
    law = ForceLaw(cut.tool, cut.tool.cutting, cut.spindle_rev_per_min, cut.axial_depth_mm)
    met = forces.straight_engagement(cut.tool, np.full(len(feeds), radial_depth_mm), up=cut.up)
    return feeds, np.linalg.norm(law.forces(met, feeds).mean_n, axis=1)


def _speeds(measuring: MeasuringPass, time_s: FloatArray, lag: float) -> FloatArray:
    """Feed over time with a first-order lag after each block's F, mm/min; time is 0 at the first change."""
    begins, starts = [0.0], [measuring.feeds[0][1]]
    commands: list[float] = []
    length = np.diff([end for end, _ in measuring.feeds])
    for travel, (_, feed) in zip(length, measuring.feeds[1:], strict=True):
        speed, command = starts[-1] / 60.0, feed / 60.0
        commands.append(feed)
        duration = _block_time(float(travel), speed, command, lag)
        begins.append(begins[-1] + duration)
        left = math.exp(-duration / lag) if lag > 0.0 else 0.0
        starts.append((command + (speed - command) * left) * 60.0)
    block = np.clip(np.searchsorted(begins, time_s, side="right") - 1, 0, len(commands) - 1)
    into = time_s - np.array(begins)[block]
    wanted, speed_then = np.array(commands)[block], np.array(starts)[block]
    share = np.exp(-np.maximum(into, 0.0) / lag) if lag > 0.0 else np.zeros(len(into))
    return np.where(time_s < 0.0, measuring.feeds[0][1], wanted + (speed_then - wanted) * share)


def _block_time(travel: float, speed: float, command: float, lag: float) -> float:
    """Time of a travel from speed v towards the commanded c: travel = c t + (v - c) lag (1 - exp(-t / lag))."""
    if lag <= 0.0:
        return travel / command
    change = (speed - command) / command
    rest = travel / (command * lag) - change
    return lag * (rest + float(lambertw(change * math.exp(-rest)).real))


def _speeds_at(measuring: MeasuringPass, x_mm: FloatArray, lag: float) -> FloatArray:
    """Feed with a first-order lag at the recorded X of each sample, mm/min."""
    first, last = measuring.feeds[0][0], measuring.feeds[-1][0]
    fine = np.linspace(0.0, 1.5 * (last - first) / min(feed for _, feed in measuring.feeds) * 60.0, 20000)
    speed = _speeds(measuring, fine, lag)
    travel = first + np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(fine))]) / 60.0
    return np.where(x_mm < first, measuring.feeds[0][1], np.interp(x_mm, travel, speed))


def _noise(x: FloatArray, force: FloatArray, travel: float) -> float:
    """Standard deviation of the mean forces of sections of length *travel*, relative to their mean."""
    interval_of = ((x - x[0]) / travel).astype(int)
    sums, counts = np.bincount(interval_of, force), np.bincount(interval_of)
    means = sums[counts > 0] / counts[counts > 0]
    return float(np.std(means) / np.mean(means)) if len(means) > 2 else 0.0
