"""A corner of Kim and Ko, 2001 (paper 001): engagement in closed form, force, feeds by equation 7, the scheduler."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.cutting.stock import Stock
from shapegcode.cutting.tool import Tool
from shapegcode.demos.corner_program import (
    ALLOWANCE_MM,
    AXIAL_DEPTH_MM,
    BLOCK_MM,
    STRAIGHT_MM,
    TOOL_RADIUS_MM,
    CornerCase,
    corner_program,
    program_name,
    stock_text,
    tool_text,
)
from shapegcode.feed.result import FeedSchedule, ResultantForce
from shapegcode.feed.schedule import schedule_feed
from shapegcode.feed.travel import OrdinaryMotion
from shapegcode.machine import Machine
from shapegcode.program import Program

__all__ = ["AlongCorner", "CornerStudy", "Scheduled", "study_corner"]

Vector = npt.NDArray[np.float64]

_STEP_MM = 0.02
_FINER = 401
_LEAST_BLOCK_SHARE = 0.1
_DEEPER = 1.0 + 1e-6
_FEEDS_MM_PER_MIN = (1.0, 2000.0)  # within which a feed is searched
_WITHIN = 0.95


@dataclass(frozen=True)
class AlongCorner:
    """A feed along the corner and what the tool bears, at the stations of the study.

    Attributes:
        feed_mm_per_min: (n,).
        mean_n: mean of the resultant over one revolution.
        peak_n: its peak.
    """

    feed_mm_per_min: Vector
    mean_n: Vector
    peak_n: Vector

    def resultant(self, length_mm: Vector) -> ResultantForce:
        """Mean of the mean resultant over time, and the largest peak."""
        time = length_mm / self.feed_mm_per_min
        return ResultantForce(float((time * self.mean_n).sum() / time.sum()), float(self.peak_n.max()))


@dataclass(frozen=True)
class Scheduled:
    """The scheduler on the corner, checked on the closed form's engagement.

    Attributes:
        result: what it made of the corner's program.
        program: that program.
        along: feed that the machine really runs of what was written, and the force.
        time_s: of the cutting moves as written.
        constant_feed_mm_per_min: highest constant feed whose peak is nowhere above the target.
        constant_time_s: of the cutting moves with it.
    """

    result: FeedSchedule
    program: str
    along: AlongCorner
    time_s: float
    constant_feed_mm_per_min: float
    constant_time_s: float

    @property
    def gain(self) -> float:
        """Share of the time with the constant feed that the schedule saves."""
        return 1.0 - self.time_s / self.constant_time_s


@dataclass(frozen=True)
class CornerStudy:
    """Everything about one case.

    Attributes:
        case: which.
        cut: the corner in closed form, with 30 mm of straight before and behind.
        track: what the tool meets.
        force: the force model.
        beam: the tool as the beam that bends; its overhang is assumed.
        programmed: with the programmed feed.
        blocks_mm: ends of the blocks of equation 7; the first number is where the first of them begins.
        equation7: with the feeds of equation 7.
        constant_force_mm_per_min: by `mean` and `peak`: feed with which the worst place bears as much as the straight.
        scheduled: the scheduler, whose target is the peak resultant of the straight.
    """

    case: CornerCase
    cut: _core.CornerCut
    track: _core.EngagementTrack
    force: _core.MillingForce
    beam: _core.ToolBeam
    programmed: AlongCorner
    blocks_mm: Vector
    equation7: AlongCorner
    constant_force_mm_per_min: dict[str, float]
    scheduled: Scheduled

    @property
    def worst(self) -> int:
        """The station with the largest radial depth."""
        return int(np.argmax(self.track.radial_depth_mm))

    @property
    def length_mm(self) -> Vector:
        """Of the stretch before each station."""
        length: Vector = np.diff(np.asarray(self.track.s_mm), prepend=0.0)
        return length

    def deepest(self) -> _core.CornerEngagement:
        """Where the radial depth is largest, between the stations too."""
        s_mm = np.asarray(self.track.s_mm)
        near = np.linspace(s_mm[self.worst - 1], s_mm[self.worst + 1], _FINER)
        return max((self.cut.at(float(s)) for s in near), key=lambda engagement: engagement.radial_depth_mm)

    @property
    def feeds(self) -> tuple[tuple[str, AlongCorner], ...]:
        """The feeds that are compared, with their names for people."""
        return (("as programmed", self.programmed), ("equation 7", self.equation7), ("scheduled", self.scheduled.along))

    def share_within(self, share: float = _WITHIN) -> float:
        """Share of the path on which the schedule's peak is at least this share of the target."""
        target = self.programmed.peak_n[0]
        length = self.length_mm
        return float(length[self.scheduled.along.peak_n >= share * target].sum() / length.sum())

    def wall_error_um(self, along: AlongCorner, every: int, height_mm: Vector) -> Vector:
        """Form error of the wall, (stations / every, heights), µm."""
        rows = [
            _core.wall_error_um(
                self.force, self.beam, self.track.arcs_of(i), float(along.feed_mm_per_min[i]), _core.WallSide.right,
                height_mm,
            )
            for i in range(0, len(self.track), every)
        ]  # fmt: skip
        return np.array(rows, dtype=np.float64)


def study_corner(case: CornerCase, machine: Machine) -> CornerStudy:
    """Everything about one case.

    Args:
        case: which.
        machine: that runs the scheduled program.

    Returns:
        Engagement in closed form, force, feeds by equation 7, and what the scheduler makes of it.
    """
    cut = _core.CornerCut(
        TOOL_RADIUS_MM, case.rough_radius_mm, case.finish_radius_mm, ALLOWANCE_MM, 0.5 * math.pi, STRAIGHT_MM,
        STRAIGHT_MM,
    )  # fmt: skip
    track = cut.track(AXIAL_DEPTH_MM, _STEP_MM)
    plain = Tool.from_toml(tool_text(), "paper001_tool.toml")
    force = plain.force(case.spindle_rev_per_min)
    programmed = _along(force, track, np.full(len(track), case.feed_mm_per_min))
    borders, feeds = _equation7(cut, track, programmed)
    worst = int(np.argmax(track.radial_depth_mm))
    lowest, highest = _FEEDS_MM_PER_MIN
    constant = {}
    for name, limits in (
        ("mean", _core.FeedLimits(mean_resultant_n=float(programmed.mean_n[0]))),
        ("peak", _core.FeedLimits(peak_resultant_n=float(programmed.peak_n[0]))),
    ):
        constant[name] = _core.largest_feed(force, track.arcs_of(worst), limits, lowest, highest).feed_mm_per_min
    return CornerStudy(
        case=case,
        cut=cut,
        track=track,
        force=force,
        beam=plain.beam(),
        programmed=programmed,
        blocks_mm=borders,
        equation7=_along(force, track, feeds),
        constant_force_mm_per_min=constant,
        scheduled=_scheduled(case, cut, track, force, float(programmed.peak_n[0]), machine),
    )


def _along(force: _core.MillingForce, track: _core.EngagementTrack, feeds: Vector) -> AlongCorner:
    figures = force.figures_of(track, feeds)
    return AlongCorner(feeds, figures["mean_resultant_n"], figures["peak_resultant_n"])


def _equation7(cut: _core.CornerCut, track: _core.EngagementTrack, programmed: AlongCorner) -> tuple[Vector, Vector]:
    """Equation 7 in blocks of 0.6 mm at most, each by the largest mean resultant in it: borders, feed per station."""
    s_mm, depth = np.asarray(track.s_mm), np.asarray(track.radial_depth_mm)
    deeper = np.flatnonzero(depth > _DEEPER * ALLOWANCE_MM)
    begin, end = float(s_mm[max(deeper[0] - 1, 0)]), float(s_mm[deeper[-1]])
    path = cut.path(1.0)
    joints = np.cumsum([path[i].length_mm for i in range(len(path))])[:-1]
    # A remainder much shorter than a block is left to the block before it.
    inside = [float(joint) for joint in joints if begin < joint < end - _LEAST_BLOCK_SHARE * BLOCK_MM]
    corners = [begin, *inside, end]
    pieces = [np.linspace(a, b, math.ceil((b - a) / BLOCK_MM - _LEAST_BLOCK_SHARE) + 1) for a, b in pairwise(corners)]
    borders = np.concatenate([pieces[0][:1], *(piece[1:] for piece in pieces)])
    feeds = programmed.feed_mm_per_min.copy()
    reference = programmed.mean_n[0]
    # Of two stations at a sharp vertex the first ends the block before it.
    block = np.searchsorted(borders, s_mm)
    same = np.flatnonzero(np.diff(s_mm) == 0.0) + 1
    block[same] += 1
    for number in range(1, len(borders)):
        stations = block == number
        feeds[stations] *= reference / programmed.mean_n[stations].max()
    return borders, feeds


def _scheduled(
    case: CornerCase,
    cut: _core.CornerCut,
    track: _core.EngagementTrack,
    force: _core.MillingForce,
    target_n: float,
    machine: Machine,
) -> Scheduled:
    tool = Tool.from_toml(
        tool_text(f'[limits]\nresultant_n = {target_n!r}\nresultant = "peak"\n'), "paper001_tool.toml"
    )
    stock = Stock.from_toml(stock_text(case), "paper001_stock.toml")
    text = corner_program(case, cut, case.feed_mm_per_min)
    result = schedule_feed(Program.from_text(text, machine, source=program_name(case)), machine, tool, stock)
    window_s = 60.0 / (tool.tool.flutes * case.spindle_rev_per_min)
    stations = np.asarray(track.s_mm)
    motion = OrdinaryMotion(machine)

    def run(program: Program) -> tuple[Vector, float]:
        path = program.regions[0].path
        travelled = motion.travel(path, cut.path(1.0), stations, window_s)
        return travelled.feed_mm_per_min, float(travelled.time_s.sum())

    feeds, time_s = run(result.written)
    limits = _core.FeedLimits(peak_resultant_n=target_n)
    constant = float(np.min(_core.largest_feeds(force, track, limits, *_FEEDS_MM_PER_MIN)[0]))
    constant = math.floor(10.0 * constant) / 10.0  # as it can be written
    _, constant_s = run(Program.from_text(corner_program(case, cut, constant), machine, source=program_name(case)))
    return Scheduled(result, text, _along(force, track, feeds), time_s, constant, constant_s)
