"""What the interval test tells: at which interval the controller follows the feed (paper 001, figure 8)."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from shapegcode.errors import ArgumentError
from shapegcode.testcut.cut import IntervalDetails, MeasuringPass, TestCut
from shapegcode.testcut.engagement import fully_engaged, straight_engagement
from shapegcode.testcut.force import ForceLaw, expected
from shapegcode.testcut.placing import PlacedRecord, placed, turned
from shapegcode.testcut.record import ForceRecord
from shapegcode.testcut.result import FollowedPass, IntervalResult

__all__ = ["fit_interval"]

Array = npt.NDArray[np.float64]

_DEVIATION_LIMIT = 0.05
_NOISE_SHARE = 2.0
_PER_MINUTE = 60.0
_LAGS_S = np.concatenate([[0.0], np.geomspace(2e-3, 0.5, 49)])
_FEEDS = 40


def fit_interval(cut: TestCut, measured: Mapping[int, ForceRecord]) -> IntervalResult:
    """Decide from the measured resultant at which interval the controller follows the commanded feeds."""
    records = {number: _placed(cut, number, record) for number, record in measured.items()}
    found = sorted((_followed(cut, number, record) for number, record in records.items()), key=lambda p: p.interval_mm)
    good: float | None = None
    for each in reversed(found):
        if not each.ok:
            break
        good = each.interval_mm
    fastest = max(feed for each in cut.passes for _, feed in each.feeds)
    lag = float(np.median([each.lag_s for each in found]))
    return IntervalResult(
        program=cut.program,
        machine=cut.machine,
        interval_mm=good,
        lag_interval_mm=lag * math.log(10.0) * fastest / _PER_MINUTE,
        passes=tuple(found),
        warnings=tuple(note for each in found for note in records[each.number].notes),
    )


def _placed(cut: TestCut, number: int, record: ForceRecord) -> PlacedRecord:
    measuring = cut.passes[number - 1]
    return placed(record, cut, measuring, expected(cut, measuring))


def _followed(cut: TestCut, number: int, record: PlacedRecord) -> FollowedPass:
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

    def course(lag: float) -> Array:
        if record.by_time:
            speed = _speeds(measuring, time - entry, lag)
        else:
            speed = _over_way(measuring, record.x_mm[within], lag)
        return turned(np.interp(speed, feeds, levels)[:, None], record.samples)[:, 0]

    errors = [float(np.mean((course(lag) - size) ** 2)) for lag in _LAGS_S]
    lag = float(_LAGS_S[int(np.argmin(errors))])
    immediate = course(0.0)
    ends, wanted, seen = _ends_of_blocks(measuring, record.x_mm[within], immediate, size, interval)
    off = np.abs(seen - wanted) / wanted
    noise = _noise(record.x_mm[straight], force[straight], 0.5 * interval)
    worst = int(np.argmax(off))
    return FollowedPass(
        number=number,
        interval_mm=interval,
        deviation=float(off[worst]),
        at_mm=float(ends[worst]),
        noise=noise,
        lag_s=lag,
        ok=bool(off[worst] <= _DEVIATION_LIMIT + _NOISE_SHARE * noise),
        time_s=time,
        force_n=size,
        immediate_n=immediate,
        lagging_n=course(lag),
    )


def _levels(cut: TestCut, measuring: MeasuringPass, radial_depth_mm: float) -> tuple[Array, Array]:
    """Feeds below, between and above those of a pass, and the mean force at each."""
    commanded = [feed for _, feed in measuring.feeds]
    feeds = np.sort(
        np.concatenate(
            [np.linspace(0.2, 0.98, _FEEDS) * min(commanded), np.linspace(0.5, 1.1, _FEEDS) * max(commanded)]
        )
    )
    law = ForceLaw(cut.tool, cut.tool.cutting, cut.spindle_rev_per_min, cut.axial_depth_mm)
    met = straight_engagement(cut.tool, np.full(len(feeds), radial_depth_mm), up=cut.up)
    return feeds, np.linalg.norm(law.forces(met, feeds).mean_n, axis=1)


def _speeds(measuring: MeasuringPass, time_s: Array, lag: float) -> Array:
    """Feed over time, from 0 at the first change, that follows each block's F with a first-order lag, mm/min."""
    begins, starts = [0.0], [measuring.feeds[0][1]]
    commands: list[float] = []
    length = np.diff([end for end, _ in measuring.feeds])
    for way, (_, feed) in zip(length, measuring.feeds[1:], strict=True):
        speed, command = starts[-1] / _PER_MINUTE, feed / _PER_MINUTE
        commands.append(feed)
        duration = _block_time(float(way), speed, command, lag)
        begins.append(begins[-1] + duration)
        left = math.exp(-duration / lag) if lag > 0.0 else 0.0
        starts.append((command + (speed - command) * left) * _PER_MINUTE)
    block = np.clip(np.searchsorted(begins, time_s, side="right") - 1, 0, len(commands) - 1)
    into = time_s - np.array(begins)[block]
    wanted, begun = np.array(commands)[block], np.array(starts)[block]
    share = np.exp(-np.maximum(into, 0.0) / lag) if lag > 0.0 else np.zeros(len(into))
    return np.where(time_s < 0.0, measuring.feeds[0][1], wanted + (begun - wanted) * share)


def _block_time(way: float, speed: float, command: float, lag: float) -> float:
    """Time for a way at a speed that approaches the commanded one: way = c t + (v - c) lag (1 - exp(-t / lag))."""
    time = way / command
    if lag <= 0.0:
        return time
    for _ in range(60):
        decay = math.exp(-time / lag)
        off = command * time + (speed - command) * lag * (1.0 - decay) - way
        step = off / (command + (speed - command) * decay)
        time = max(time - step, 0.5 * time)
        if abs(step) < 1e-12:
            break
    return time


def _over_way(measuring: MeasuringPass, x_mm: Array, lag: float) -> Array:
    """The same where the record tells the position: at the X of each sample."""
    first, last = measuring.feeds[0][0], measuring.feeds[-1][0]
    fine = np.linspace(0.0, 1.5 * (last - first) / min(feed for _, feed in measuring.feeds) * _PER_MINUTE, 20000)
    speed = _speeds(measuring, fine, lag)
    way = first + np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(fine))]) / _PER_MINUTE
    return np.where(x_mm < first, measuring.feeds[0][1], np.interp(x_mm, way, speed))


def _ends_of_blocks(
    measuring: MeasuringPass, x: Array, wanted: Array, seen: Array, interval: float
) -> tuple[Array, Array, Array]:
    rows = []
    for end, _ in measuring.feeds[1:-1]:
        inside = (x > end - 0.5 * interval) & (x <= end)
        if inside.sum() >= 1:
            rows.append((end, float(wanted[inside].mean()), float(seen[inside].mean())))
    table = np.array(rows)
    return table[:, 0], table[:, 1], table[:, 2]


def _noise(x: Array, force: Array, way: float) -> float:
    """Standard deviation of means over a way, as a share of the mean."""
    place = ((x - x[0]) / way).astype(int)
    sums, counts = np.bincount(place, force), np.bincount(place)
    means = sums[counts > 0] / counts[counts > 0]
    return float(np.std(means) / np.mean(means)) if len(means) > 2 else 0.0
