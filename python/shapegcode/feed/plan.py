"""Feeds of one region: the highest within every limit, as the machine will really reach them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.cutting.tool import Tool
from shapegcode.feed.survey import SurveyedRegion
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel

Vector = npt.NDArray[np.float64]
_ATTEMPTS = 12
_LONGEST_REACH = 2.0  # multiple of the lag beyond which slowing down earlier has no effect
_LOWERING = 3  # attempts that only slow down earlier, before feeds are reduced too
_SAME_DIRECTION = 0.95  # cosine of a turn that does not change the load
_MIN_SHARE = 0.9  # least ratio of one reduction of a feed
_TOO_FAST = 1e-4  # relative: rounding of the travel, far below the margin
_DEEPER_PLUNGE = 0.01  # fraction of the tool's end area in material above which a move is a plunge, not a ramp
_AIR_MM2 = 1e-9
_STEEPEST_AIR = 0.7  # least ratio of travel in XY for a move in air that is no plunge
_MIN_PROGRAMMED = 0.1  # lowest feed over the programmed one, if the tool file has no least feed per tooth
_STEP = 0.005  # smaller feed steps are not written, as they gain nothing
_LIMIT_NAMES = np.array(
    [name for _, name in sorted((limit.value, name) for name, limit in _core.FeedLimit.__members__.items())],
    dtype="<U16",
)
PROGRAMMED, MAX_FEED, AIR, KEPT, MINIMUM = "programmed", "max_feed", "air", "kept", "minimum"
"""Reasons for a feed other than limits: program, largest feed, no material, unchanged block, lowest feed."""


@dataclass(frozen=True)
class Travelled:
    """Feed and time along a path, one value of each per station."""

    feed_mm_per_min: Vector  # largest on the interval before the station, each a mean over the window of the travel
    time_s: Vector  # time on that interval

    @classmethod
    def of(cls, travel: _core.Travel) -> Travelled:
        """Convert from the core."""
        return cls(np.asarray(travel.highest_mm_per_s) * 60.0, np.asarray(travel.time_s))


class Mover:
    """Motion model of the blocks of a region."""

    def __init__(self, period_s: float, filters: Sequence[_core.Fir]) -> None:
        self.period_s, self.filters = period_s, filters

    @property
    def reach_s(self) -> float:
        """Lag of the travel after a change of the commanded feed, s: half the duration of its filters."""
        return 0.5 * self.period_s * sum(filter_.duration_samples for filter_ in self.filters)

    def travel(self, path: _core.Path, along: _core.Path, stations_mm: Vector, window_s: float) -> Travelled:
        """Simulate `path`; return feed and time on the intervals between stations of `along`, the same cut."""
        raise NotImplementedError


class OrdinaryMotion(Mover):
    """The controller's own motion, as for an ordinary program."""

    def __init__(self, machine: Machine) -> None:
        self._controller = MachineModel(machine).ordinary
        super().__init__(self._controller.model.period_s, self._controller.filters)

    def travel(self, path: _core.Path, along: _core.Path, stations_mm: Vector, window_s: float) -> Travelled:
        """See `Mover`."""
        return Travelled.of(self._controller.travel(path, along, stations_mm, window_s))


def travel_emitted(
    blocks: _core.Path, path: _core.Path, machine: Machine, stations_mm: Vector, window_s: float
) -> Travelled:
    """Simulate shaped blocks; return their speed at stations along the programmed path, mean over the window."""
    model = MachineModel(machine)
    return Travelled.of(
        _core.travel_blocks(blocks, path, model.own_rule, stations_mm, model.period_s, model.shaped.filters, window_s)
    )


@dataclass(frozen=True)
class FeedPlan:
    """Feeds of a region."""

    limit_mm_per_min: Vector  # largest feed allowed on the interval before each station, (n,)
    holds: npt.NDArray[np.str_]  # reason of that feed, (n,) names
    kept: tuple[str, ...]  # why each segment's feed stays; empty if it may change
    stretches: tuple[_core.FeedStretch, ...]  # the feeds to write


def limits_of(tool: Tool, machine: Machine, margin: float) -> _core.FeedLimits:
    """Combine the limits of tool and machine, less the margin (none for the feed per tooth)."""
    room = 1.0 - margin

    def least(*values: float | None) -> float:
        return room * min((value for value in values if value is not None), default=math.inf)

    limits, control = tool.limits, machine.feed_control
    peak = limits.resultant == "peak"
    return _core.FeedLimits(
        mean_resultant_n=math.inf if peak else least(limits.resultant_n),
        peak_resultant_n=least(limits.resultant_n) if peak else math.inf,
        peak_deflection_um=least(limits.deflection_um),
        peak_torque_nm=least(limits.torque_nm, control.spindle_torque_nm),
        mean_power_w=least(limits.power_w, control.spindle_power_w),
        feed_per_tooth_mm=limits.feed_per_tooth_max_mm or math.inf,
        beam=tool.beam(),
    )


def plan_region(surveyed: SurveyedRegion, machine: Machine, motion: Mover, divisible: list[bool], margin: float,
                feed_unit_mm_per_min: float) -> FeedPlan:  # fmt: skip
    """Choose the feeds of a region whose feeds may change.

    Source: this project; the least distance between changes of the feed is from Kim and Ko, 2001 (paper 001).
    """
    tool, track, path, control = surveyed.tool, surveyed.track, surveyed.region.path, machine.feed_control
    assert tool is not None and track is not None
    segment, stations_mm, window_s = np.asarray(track.segment), np.asarray(track.s_mm), surveyed.window_s
    programmed = path.segment_feeds_mm_per_s * 60.0
    # Without a least chip, a tenth of the programmed feed is the lowest, so that an impossible limit causes no rubbing.
    chip_mm = tool.limits.feed_per_tooth_min_mm or 0.0
    share = 0.0 if chip_mm else _MIN_PROGRAMMED
    teeth_per_min = tool.tool.flutes * surveyed.spindle_rev_per_min
    least = max(chip_mm * teeth_per_min, machine.controller.minimum_feed_mm_per_min)
    kept = _kept_segments(surveyed, programmed, least)
    slowest = np.maximum(least, share * programmed)
    lowest = (feed_unit_mm_per_min * np.ceil(slowest / feed_unit_mm_per_min - 1e-9))[segment]  # to the resolution of F
    limit, holds, load = _limits_along(surveyed, programmed[segment], lowest, machine, margin)
    frozen = np.array([bool(reason) for reason in kept])
    limit = np.where(frozen[segment], programmed[segment], limit)
    holds[frozen[segment]] = KEPT
    # Plan, simulate the travel, and slow down earlier or more where it is still too fast.
    max_change = math.inf if control.max_change_mm_per_min is None else control.max_change_mm_per_min
    floor = np.minimum(limit, lowest)
    planned = np.maximum(_stepped(limit, programmed[segment]), floor)
    before = np.full(len(planned), motion.reach_s + window_s)
    behind = np.full(len(planned), motion.reach_s)
    stretches: list[_core.FeedStretch] = []
    for attempt in range(_ATTEMPTS):
        feeds = _core.look_ahead_on_load(stations_mm, planned, load, before, behind)
        stretches = _core.schedule_feed(
            path.segment_ends_mm, np.where(frozen, programmed, 0.0), divisible, stations_mm, feeds, control.interval_mm,
            max_change, feed_unit_mm_per_min,
        )  # fmt: skip
        run = motion.travel(_core.with_feeds(path, stretches), path, stations_mm, window_s).feed_mm_per_min
        over = ~frozen[segment] & (run > load * (1.0 + _TOO_FAST))
        if not over.any():
            break
        for reach in (before, behind):
            longest = _LONGEST_REACH * (motion.reach_s + window_s)
            reach[over] = np.minimum(1.5 * reach[over] + window_s, longest)
        if attempt >= _LOWERING:
            planned[over] *= np.maximum(load[over] / run[over], _MIN_SHARE)
            planned = np.maximum(planned, floor)
    return FeedPlan(limit, holds, kept, tuple(stretches))


def _kept_segments(surveyed: SurveyedRegion, programmed: Vector, lowest: float) -> tuple[str, ...]:
    tool, track = surveyed.tool, surveyed.track
    assert tool is not None and track is not None
    reasons = [""] * len(programmed)
    end_mm2 = np.pi * tool.radius_mm**2
    plunged = np.asarray(track.plunged_mm2) > _DEEPER_PLUNGE * end_mm2
    for index in np.unique(np.asarray(track.segment)[plunged]):
        reasons[index] = "plunges into material"
    for index in np.flatnonzero(programmed < lowest * (1.0 - 1e-9)):
        reasons[index] = f"its feed, {programmed[index]:g} mm/min, is already below the lowest one, {lowest:g} mm/min"
    return tuple(reasons)


def _limits_along(
    surveyed: SurveyedRegion, programmed: Vector, lowest: Vector, machine: Machine, margin: float
) -> tuple[Vector, npt.NDArray[np.str_], Vector]:
    """Desired feed in the interval before each station, its limit, and the feed that the load allows."""
    tool, track = surveyed.tool, surveyed.track
    assert tool is not None and track is not None
    axes = machine.axes
    least, most = machine.controller.minimum_feed_mm_per_min, tool.feed.max_feed_mm_per_min
    if most is not None and most < least:
        raise _core.ArgumentError(
            f"feed.max_feed_mm_per_min = {most:g} of {tool.tool.name}: must not be below "
            f"controller.minimum_feed_mm_per_min = {least:g}"
        )
    fastest = min(axes.x.max_feed_mm_per_min, axes.y.max_feed_mm_per_min, most or math.inf)
    # Without a largest feed (per tooth or in mm/min) in the tool file the programmed feed is the limit in material.
    raised = tool.limits.feed_per_tooth_max_mm is not None or most is not None
    ceiling = np.full(len(programmed), fastest) if raised else np.minimum(programmed, fastest)
    force = tool.force(surveyed.spindle_rev_per_min, surveyed.sense)
    highest = max(fastest, float(ceiling.max()))
    # Search far below the lowest feed, to separate stations that need less from those that just reach it.
    bound, limit, _ = _core.largest_feeds(
        force, track, limits_of(tool, machine, margin), 1e-3 * float(lowest.min()), highest
    )
    top = np.where(ceiling > programmed, MAX_FEED, PROGRAMMED)
    holds = np.where((bound < ceiling) & (limit != _core.FeedLimit.none.value), _LIMIT_NAMES[limit], top)
    feeds = np.minimum(bound, ceiling)
    load = np.where(bound < highest, np.maximum(bound, lowest), np.inf)
    low = feeds < lowest
    feeds[low] = np.minimum(lowest, ceiling)[low]
    holds[low] = MINIMUM
    air = np.asarray(track.section_mm2) <= _AIR_MM2
    feeds[air] = np.minimum(programmed, fastest)[air]
    load[air] = np.inf
    holds[air] = AIR
    # A station represents the interval before it, on which the load changes from the last station's.
    passed = goes_on(track) & ~air[:-1]
    before = np.where(passed & (feeds[:-1] < feeds[1:]), np.arange(len(feeds) - 1), np.arange(1, len(feeds)))
    feeds[1:], holds[1:] = feeds[before], holds[before]
    load[1:] = np.where(passed, np.minimum(load[1:], load[:-1]), load[1:])
    if tool.feed.air_feed_mm_per_min is not None:
        level = np.asarray(track.horizontal) > _STEEPEST_AIR  # a tool must not plunge faster than programmed
        certain = air if surveyed.clear is None else air & surveyed.clear
        near = _near_material(np.asarray(track.s_mm), certain, tool.feed.approach_mm)
        clear = certain & (holds == AIR) & level & ~near
        feeds[clear] = np.maximum(programmed[clear], min(tool.feed.air_feed_mm_per_min, fastest))
    return feeds, holds, load


def goes_on(track: _core.EngagementTrack) -> npt.NDArray[np.bool_]:
    """Whether the direction, and so the load, stays nearly the same up to the next station, (n - 1,)."""
    turn = np.diff(np.asarray(track.direction_rad))
    level = np.asarray(track.horizontal)
    return np.asarray((np.cos(turn) > _SAME_DIRECTION) & (level[1:] > 0.0) & (level[:-1] > 0.0))


def _stepped(limit: Vector, programmed: Vector) -> Vector:
    """Round feeds down in steps of 0.5 % from the programmed feed; feeds above that, from the largest feed."""
    top = np.where(limit > programmed, limit.max(initial=0.0), programmed)
    steps = np.ceil(np.log(top / limit) / math.log1p(_STEP) - 1e-9)
    return np.asarray(top * (1.0 + _STEP) ** -steps)


def _near_material(s_mm: Vector, air: npt.NDArray[np.bool_], approach_mm: float) -> npt.NDArray[np.bool_]:
    contact = np.where(air, np.inf, np.concatenate(([0.0], s_mm[:-1])))  # start of a station's interval
    following = np.minimum.accumulate(contact[::-1])[::-1]
    return np.asarray(following - s_mm <= approach_mm)
