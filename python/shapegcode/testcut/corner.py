"""What the corner and the interval test tell: measured against expected resultant, and how feeds are followed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode._core import ArgumentError
from shapegcode.testcut.force import ForceLaw
from shapegcode.testcut.means import PlacedRecord, Revolutions, placed, revolutions, turned
from shapegcode.testcut.plan import MeasuringPass, TestCut, fully_engaged, straight_engagement
from shapegcode.testcut.shape import Expected, expected
from shapegcode.testcut.taper import Measured

__all__ = ["CornerResult", "FollowedPass", "IntervalResult", "corner_result", "interval_result"]

Array = npt.NDArray[np.float64]

_RATIO_LIMIT = 0.10
_DEVIATION_LIMIT = 0.05
_NOISE_SHARE = 2.0
_PER_MINUTE = 60.0
_LAGS_S = np.concatenate([[0.0], np.geomspace(2e-3, 0.5, 49)])
_FEEDS = 40


@dataclass(frozen=True, eq=False)
class CornerResult:
    """Measured against expected resultant of the passes of an unrolled corner.

    Attributes:
        cut: the test cut.
        passes: number of the pass, its record and what was expected.
        scale: measured over expected mean resultant of the first pass: how far the coefficients are off.
    """

    cut: TestCut
    passes: tuple[tuple[int, Revolutions, Expected], ...]
    scale: float

    def peaks(self) -> list[dict[str, float]]:
        """Largest resultant of each pass within the stock, mean over a revolution and momentary."""
        found = []
        for number, record, hoped in self.passes:
            seen = _inside(self.cut, number, record.x_mm) & ~record.chatter
            far = _inside(self.cut, number, hoped.x_mm)
            found.append(
                {
                    "pass": number,
                    "measured_mean_n": float(record.resultant_n[seen].max()),
                    "measured_peak_n": float(record.peak_n[seen].max()),
                    "expected_mean_n": float(hoped.mean_resultant_n[far].max()),
                    "expected_peak_n": float(hoped.peak_resultant_n[far].max()),
                }
            )
        return found

    @property
    def ratio(self) -> dict[str, float] | None:
        """Largest mean resultant of the second pass over that of the first, measured and expected."""
        peaks = {row["pass"]: row for row in self.peaks()}
        if not {1, 2} <= set(peaks):
            return None
        return {kind: peaks[2][f"{kind}_mean_n"] / peaks[1][f"{kind}_mean_n"] for kind in ("measured", "expected")}

    @property
    def as_expected(self) -> bool:
        """Whether the feed changes the largest resultant as much as expected, within 10 %."""
        ratio = self.ratio
        return ratio is None or abs(ratio["measured"] / ratio["expected"] - 1.0) <= _RATIO_LIMIT

    def report(self) -> dict[str, Any]:
        """The plain dictionary that ``--json`` writes."""
        notes = [f"{record.source}: {note}" for _, record, _ in self.passes for note in record.notes]
        return {
            "kind": "corner",
            "peaks": self.peaks(),
            "ratio": self.ratio,
            "scale": self.scale,
            "as_expected": self.as_expected,
            "notes": notes,
        }


def _inside(cut: TestCut, number: int, x_mm: Array) -> npt.NDArray[np.bool_]:
    measuring = cut.passes[number - 1]
    margin = 4.0 * measuring.feed_mm_per_min / cut.spindle_rev_per_min
    return fully_engaged(cut, measuring, x_mm, margin)


def corner_result(cut: TestCut, measured: Sequence[Measured]) -> CornerResult:
    """Lay measured resultants over the expected ones.

    Raises:
        ArgumentError: a record does not fit the cut.
    """
    found = []
    for each in measured:
        measuring = cut.passes[each.number - 1]
        hoped = expected(cut, measuring)
        record = revolutions(placed(each.record, cut, measuring, hoped.shape()))
        found.append((each.number, record, hoped))
    number, record, hoped = min(found, key=lambda each: each[0])
    seen = _inside(cut, number, record.x_mm) & ~record.chatter
    there = np.interp(record.x_mm[seen], hoped.x_mm, hoped.mean_resultant_n)
    scale = float(there @ record.resultant_n[seen] / (there @ there))
    return CornerResult(cut, tuple(found), scale)


@dataclass(frozen=True, eq=False)
class FollowedPass:
    """How the controller followed the feeds of one pass.

    Attributes:
        number: of the pass.
        interval_mm: length of its blocks.
        x_mm: (n,) end of each block with a changed feed.
        commanded_n: (n,) mean force in the last half of each block at its commanded feed.
        measured_n: (n,) what was measured there, scaled to what is expected on the straight part.
        deviation: largest |measured - commanded| as a share of commanded.
        at_mm: X of the end of that block.
        noise: standard deviation of such a mean where the feed does not change, as a share of it.
        lag_s: time constant with which the feed follows best.
        follows: whether the deviation is below 5 % and twice the noise.
        time_s: (m,) of the record.
        force_n: (m,) mean over a revolution, scaled.
        immediate_n: (m,) expected if the feed follows at once.
        lagging_n: (m,) expected with the lag.
        notes: for the user.
    """

    number: int
    interval_mm: float
    x_mm: Array
    commanded_n: Array
    measured_n: Array
    deviation: float
    at_mm: float
    noise: float
    lag_s: float
    follows: bool
    time_s: Array
    force_n: Array
    immediate_n: Array
    lagging_n: Array
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class IntervalResult:
    """From which interval on the controller follows.

    Attributes:
        cut: the test cut.
        passes: of the measured ones, by interval.
        interval_mm: shortest interval from which on all measured ones are followed; None: none is.
        lag_interval_mm: way in which 90 % of a step are done with the longest lag found, at the largest feed.
    """

    cut: TestCut
    passes: tuple[FollowedPass, ...]
    interval_mm: float | None
    lag_interval_mm: float

    def report(self) -> dict[str, Any]:
        """The plain dictionary that ``--json`` writes."""
        return {
            "kind": "interval",
            "interval_mm": self.interval_mm,
            "lag_interval_mm": self.lag_interval_mm,
            "passes": [
                {
                    "pass": each.number,
                    "interval_mm": each.interval_mm,
                    "deviation": each.deviation,
                    "at_mm": each.at_mm,
                    "noise": each.noise,
                    "lag_s": each.lag_s,
                    "follows": each.follows,
                }
                for each in self.passes
            ],
            "notes": [note for each in self.passes for note in each.notes],
        }


def interval_result(cut: TestCut, measured: Sequence[Measured]) -> IntervalResult:
    """Decide from the measured resultant at which interval the controller follows the commanded feeds.

    Raises:
        ArgumentError: a record does not fit the cut.
    """
    intervals = cut.about["intervals_mm"]
    found = [_followed(cut, each, float(intervals[each.number - 1])) for each in measured]
    found.sort(key=lambda each: each.interval_mm)
    good: float | None = None
    for each in reversed(found):
        if not each.follows:
            break
        good = each.interval_mm
    fastest = max(feed for each in cut.passes for _, feed in each.feeds)
    lag = float(np.median([each.lag_s for each in found]))
    return IntervalResult(cut, tuple(found), good, lag * math.log(10.0) * fastest / _PER_MINUTE)


def _followed(cut: TestCut, each: Measured, interval: float) -> FollowedPass:
    measuring = cut.passes[each.number - 1]
    record = placed(each.record, cut, measuring, expected(cut, measuring).shape())
    first, last = measuring.feeds[0][0], measuring.feeds[-2][0]
    law = ForceLaw(cut.tool, cut.tool.cutting, cut.spindle_rev_per_min, cut.axial_depth_mm)
    feeds = np.linspace(0.5, 1.1, _FEEDS) * max(feed for _, feed in measuring.feeds)
    feeds = np.concatenate([np.linspace(0.2, 0.98, _FEEDS) * min(feed for _, feed in measuring.feeds), feeds])
    feeds.sort()
    depth = np.full(len(feeds), float(cut.about["radial_depth_mm"]))
    levels = np.linalg.norm(
        law.forces(straight_engagement(cut.tool, depth, up=cut.milling == "up"), feeds).mean_n, axis=1
    )

    force = np.linalg.norm(turned(record.force_n, record.samples), axis=1)
    straight = fully_engaged(cut, measuring, record.x_mm, 1.0) & (record.x_mm < first - 0.5)
    if not straight.any():
        raise ArgumentError(f"{record.file}: nothing was recorded before the feed changes")
    scale = float(np.interp(measuring.feed_mm_per_min, feeds, levels) / force[straight].mean())
    force = force * scale

    entry = float(np.interp(first, record.x_mm, record.time_s))
    within = (record.time_s > entry - 0.2) & (record.x_mm < last + 2.0)
    time, size = record.time_s[within], force[within]

    def course(lag: float) -> Array:
        speed = _speeds(measuring, time - entry, lag) if record_time else _over_way(measuring, record, within, lag)
        return turned(np.interp(speed, feeds, levels)[:, None], record.samples)[:, 0]

    record_time = each.record.position_mm is None
    errors = [float(np.mean((course(lag) - size) ** 2)) for lag in _LAGS_S]
    lag = float(_LAGS_S[int(np.argmin(errors))])
    immediate = course(0.0)
    x_end, wanted, seen = _ends_of_blocks(measuring, record.x_mm[within], immediate, size, interval)
    off = np.abs(seen - wanted) / wanted
    noise = _noise(record.x_mm[straight], force[straight], 0.5 * interval)
    worst = int(np.argmax(off))
    return FollowedPass(
        each.number,
        interval,
        x_end,
        wanted,
        seen,
        float(off[worst]),
        float(x_end[worst]),
        noise,
        lag,
        bool(off[worst] <= _DEVIATION_LIMIT + _NOISE_SHARE * noise),
        time,
        size,
        immediate,
        course(lag),
        tuple(f"{record.file}: {note}" for note in record.notes),
    )


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


def _over_way(measuring: MeasuringPass, record: PlacedRecord, within: npt.NDArray[np.bool_], lag: float) -> Array:
    """The same where the record tells the position: at the X of each sample."""
    first, last = measuring.feeds[0][0], measuring.feeds[-1][0]
    fine = np.linspace(0.0, 1.5 * (last - first) / min(feed for _, feed in measuring.feeds) * _PER_MINUTE, 20000)
    speed = _speeds(measuring, fine, lag)
    way = first + np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(fine))]) / _PER_MINUTE
    return np.where(record.x_mm[within] < first, measuring.feeds[0][1], np.interp(record.x_mm[within], way, speed))


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
