"""The figures of a cornering cut: what the paper's equation 7 makes of it, and what the scheduler does."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shapegcode.demos.corner_program import ALLOWANCE_MM, AXIAL_DEPTH_MM, TOOL_RADIUS_MM
from shapegcode.demos.corner_study import AlongCorner, CornerStudy, Scheduled
from shapegcode.feed.result import FeedRange, ResultantForce
from shapegcode.results.result import Pair

__all__ = ["DIAMETER_MM", "CornerScheduled", "PaperCorner", "corner_figures"]

DIAMETER_MM = 2.0 * TOOL_RADIUS_MM
_LEAST_GAIN_PERCENT = 15.0
_WALL_EVERY = 20
_WALL_ROWS = 16


@dataclass(frozen=True)
class CornerDepth:
    """Radial depth along a corner.

    Attributes:
        straight: before and behind it.
        max: largest.
        behind: at the station behind the largest.
    """

    straight: float
    max: float
    behind: float


@dataclass(frozen=True)
class LengthRange:
    """Lengths from the shortest to the longest.

    Attributes:
        min: shortest.
        max: longest.
    """

    min: float
    max: float


@dataclass(frozen=True)
class CornerBlocks:
    """The blocks of equation 7.

    Attributes:
        number: how many there are.
        length_mm: of them.
    """

    number: int
    length_mm: LengthRange


@dataclass(frozen=True)
class MeanAndPeak:
    """A figure by the mean of the resultant over a revolution, and by its peak.

    Attributes:
        mean: by the mean.
        peak: by the peak.
    """

    mean: float
    peak: float


@dataclass(frozen=True)
class CuttingTime:
    """Time of the cutting moves.

    Attributes:
        scheduled: with the feeds of the scheduler.
        constant: with the highest constant feed that keeps the target.
    """

    scheduled: float
    constant: float


@dataclass(frozen=True)
class WallErrors:
    """Largest form error of the wall.

    Attributes:
        programmed: with the programmed feed.
        equation7: with the feeds of equation 7.
        scheduled: with those of the scheduler.
    """

    programmed: float
    equation7: float
    scheduled: float


@dataclass(frozen=True)
class CornerScheduled:
    """The scheduler on a corner; `original` is the programmed feed.

    Attributes:
        target_n: peak resultant of the straight at the programmed feed.
        feed_mm_per_min: of what is written.
        resultant_force_n: at the feed that the machine really runs, on the engagement in closed form.
        share_within_5_percent: of the path on which the peak is at least 95 % of the target.
        blocks: cutting blocks.
        cutting_time_s: beside a constant feed.
        constant_feed_mm_per_min: highest constant feed whose peak is nowhere above the target.
        gain_percent: share of the time with it that the schedule saves.
        warnings: of the schedule.
    """

    target_n: float
    feed_mm_per_min: FeedRange
    resultant_force_n: Pair[ResultantForce]
    share_within_5_percent: float
    blocks: Pair[int]
    cutting_time_s: CuttingTime
    constant_feed_mm_per_min: float
    gain_percent: float
    warnings: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """Whether the target is kept, and the gain worth it."""
        return self.resultant_force_n.emitted.max <= self.target_n and self.gain_percent >= _LEAST_GAIN_PERCENT


@dataclass(frozen=True)
class PaperCorner:
    """A corner of the paper; `original` is the programmed feed, `emitted` that of equation 7.

    Attributes:
        case: number in table 1 of the paper.
        spindle_rev_per_min: speed of the spindle.
        rough_radius_mm: of the corner as roughing left it.
        radial_depth_mm: along the corner.
        radial_depth_ratio: the largest, in diameters of the tool.
        angle_deg: where it is, along the arc of the tool's centre.
        full_circle_radial_depth_mm: at the vertex, if the rough corner were a whole circle; None: no vertex.
        blocks: of equation 7.
        feed_mm_per_min: of equation 7.
        resultant_force_n: before and with equation 7.
        above_straight_percent: what equation 7 leaves above the straight.
        drop_percent: of the largest peak by equation 7.
        equation7_by_peak_mm_per_min: its least feed, were it made for the peak resultant.
        constant_force_mm_per_min: feed with which the worst place bears as much as the straight.
        scheduled: the scheduler on the same corner.
        wall_error_um: largest form error of the wall.
    """

    case: int
    spindle_rev_per_min: float
    rough_radius_mm: float
    radial_depth_mm: CornerDepth
    radial_depth_ratio: float
    angle_deg: float
    full_circle_radial_depth_mm: float | None
    blocks: CornerBlocks
    feed_mm_per_min: FeedRange
    resultant_force_n: Pair[ResultantForce]
    above_straight_percent: MeanAndPeak
    drop_percent: float
    equation7_by_peak_mm_per_min: float
    constant_force_mm_per_min: MeanAndPeak
    scheduled: CornerScheduled
    wall_error_um: WallErrors


def corner_figures(study: CornerStudy) -> PaperCorner:
    """The figures of a case."""
    case, length = study.case, study.length_mm
    programmed, after, blocks = study.programmed, study.equation7, np.diff(study.blocks_mm)
    deepest = study.deepest()
    target = float(programmed.peak_n[0])
    return PaperCorner(
        case=case.number,
        spindle_rev_per_min=case.spindle_rev_per_min,
        rough_radius_mm=case.rough_radius_mm,
        radial_depth_mm=CornerDepth(
            straight=ALLOWANCE_MM,
            max=deepest.radial_depth_mm,
            behind=float(study.track.radial_depth_mm[min(study.worst + 1, len(study.track) - 1)]),
        ),
        radial_depth_ratio=deepest.radial_depth_mm / DIAMETER_MM,
        angle_deg=math.degrees(deepest.turned_rad),
        full_circle_radial_depth_mm=_full_circle_mm(case.rough_radius_mm, case.finish_radius_mm),
        blocks=CornerBlocks(len(blocks), LengthRange(float(blocks.min()), float(blocks.max()))),
        feed_mm_per_min=FeedRange(float(after.feed_mm_per_min.min()), float(after.feed_mm_per_min.max())),
        resultant_force_n=Pair(programmed.resultant(length), after.resultant(length)),
        above_straight_percent=MeanAndPeak(
            100.0 * float(after.mean_n.max() / programmed.mean_n[0] - 1.0),
            100.0 * float(after.peak_n.max() / target - 1.0),
        ),
        drop_percent=100.0 * float(1.0 - after.peak_n.max() / programmed.peak_n.max()),
        equation7_by_peak_mm_per_min=case.feed_mm_per_min * target / float(programmed.peak_n[study.worst]),
        constant_force_mm_per_min=MeanAndPeak(**study.constant_force_mm_per_min),
        scheduled=_scheduled(study, study.scheduled, target),
        wall_error_um=WallErrors(
            *(_largest_wall_um(study, along) for along in (programmed, after, study.scheduled.along))
        ),
    )


def _scheduled(study: CornerStudy, scheduled: Scheduled, target_n: float) -> CornerScheduled:
    length = study.length_mm
    return CornerScheduled(
        target_n=target_n,
        feed_mm_per_min=scheduled.result.feed_mm_per_min,
        resultant_force_n=Pair(study.programmed.resultant(length), scheduled.along.resultant(length)),
        share_within_5_percent=study.share_within(),
        blocks=scheduled.result.blocks,
        cutting_time_s=CuttingTime(scheduled.time_s, scheduled.constant_time_s),
        constant_feed_mm_per_min=scheduled.constant_feed_mm_per_min,
        gain_percent=100.0 * scheduled.gain,
        warnings=scheduled.result.warnings,
    )


def _full_circle_mm(rough_mm: float, finish_mm: float) -> float | None:
    """Radial depth at the vertex if the rough corner were a whole circle, not an arc; None: no vertex."""
    if finish_mm > TOOL_RADIUS_MM:
        return None
    tool = np.array([-TOOL_RADIUS_MM, TOOL_RADIUS_MM])
    rough = np.array([-1.0, 1.0]) * (rough_mm + ALLOWANCE_MM)
    apart = float(np.hypot(*(rough - tool)))
    towards = (rough - tool) / apart
    along = (apart**2 + TOOL_RADIUS_MM**2 - rough_mm**2) / (2.0 * apart)
    across = math.sqrt(TOOL_RADIUS_MM**2 - along**2)
    # The upper of the two points where the circles meet; the wall is the X axis.
    return float(tool[1] + along * towards[1] + across * abs(towards[0]))


def _largest_wall_um(study: CornerStudy, along: AlongCorner) -> float:
    heights = np.linspace(0.0, AXIAL_DEPTH_MM, _WALL_ROWS)
    return float(np.nanmax(np.abs(study.wall_error_um(along, _WALL_EVERY, heights))))
