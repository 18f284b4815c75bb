"""Feeds of one region: the highest that keep every limit, as the machine will really run them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.milling.survey import SurveyedRegion
from shapegcode.milling.tool_file import Tool
from shapegcode.milling.travel import Motion, Vector

__all__ = ["AIR", "KEPT", "MINIMUM", "PROGRAMMED", "FeedPlan", "limits_of", "milling_force", "plan_region", "tool_beam"]

_ATTEMPTS = 12
_LOWERING = 3  # attempts that only slow down earlier, before feeds are lowered too
_TOO_FAST = 1e-6  # relative
_DEEPER_PLUNGE = 0.01  # of the tool's end in material: a ramp cuts with its end
_AIR_MM2 = 1e-9
_STEEPEST_AIR = 0.7  # share of the travel in XY from which on a move in air is no plunge
_STEP = 0.005  # feeds that differ by less are one: a border for less gains nothing
_LIMIT_NAMES = np.array(
    [name for _, name in sorted((limit.value, name) for name, limit in _core.FeedLimit.__members__.items())],
    dtype="<U16",
)

PROGRAMMED, AIR, KEPT, MINIMUM = "programmed", "air", "kept", "minimum"
"""What holds a feed where no limit does: the program, no material, a block that is left alone, the least chip."""


@dataclass(frozen=True)
class FeedPlan:
    """Feeds of a region.

    Attributes:
        surveyed: the region, and what the tool meets on it.
        limit_mm_per_min: largest feed allowed on the stretch before each station, (n,).
        holds: what holds it there, (n,) of names.
        kept: per segment why its feed stays, empty where it may change.
        stretches: the feeds, as they are written.
        held_at_minimum: stations at which the least feed per tooth is more than the limits allow, (n,) of bool.
        window_s: time between two teeth, over which feeds are taken.
    """

    surveyed: SurveyedRegion
    limit_mm_per_min: Vector
    holds: npt.NDArray[np.str_]
    kept: tuple[str, ...]
    stretches: tuple[_core.FeedStretch, ...]
    held_at_minimum: npt.NDArray[np.bool_]
    window_s: float


def milling_force(tool: Tool, surveyed: SurveyedRegion) -> _core.MillingForce:
    """The force model of a region."""
    return _core.MillingForce(tool.end_mill(), tool.coefficients(), surveyed.spindle_rev_per_min, surveyed.sense)


def tool_beam(tool: Tool) -> _core.ToolBeam:
    """The tool as the beam that bends."""
    cutter = tool.tool
    return _core.ToolBeam(
        overhang_mm=cutter.overhang_mm,
        fluted_length_mm=cutter.flute_length_mm,
        effective_diameter_mm=cutter.effective_diameter_ratio * cutter.diameter_mm,
        shank_diameter_mm=cutter.shank_diameter_mm or cutter.diameter_mm,
        young_modulus_gpa=cutter.youngs_modulus_gpa,
        holder_n_per_um=cutter.holder_stiffness_n_per_um or math.inf,
    )


def limits_of(tool: Tool, machine: Machine, margin: float) -> _core.FeedLimits:
    """The limits of tool and machine, each less a margin (a share of 1)."""
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
        beam=tool_beam(tool),
    )


def plan_region(surveyed: SurveyedRegion, machine: Machine, motion: Motion, divisible: list[bool], margin: float,
                feed_unit_mm_per_min: float) -> FeedPlan:  # fmt: skip
    """Choose the feeds of a region whose feeds may change.

    Args:
        surveyed: the region.
        machine: its feed control.
        motion: how the blocks will be run; the feeds are lowered until this motion keeps the limits.
        divisible: per segment whether its block may be divided.
        margin: share of each limit that is left free.
        feed_unit_mm_per_min: feeds are whole multiples of it.
    """
    region, tool, track = surveyed.region, surveyed.tool, surveyed.track
    assert tool is not None and track is not None
    teeth_per_min = tool.tool.flutes * surveyed.spindle_rev_per_min
    path = region.path
    segment = np.asarray(track.segment)
    programmed = path.segment_feeds_mm_per_s * 60.0
    lowest = max((tool.limits.feed_per_tooth_min_mm or 0.0) * teeth_per_min, machine.controller.minimum_feed_mm_per_min)
    kept = _kept_segments(surveyed, programmed, lowest, tool)
    limit, holds = _limits_along(surveyed, programmed[segment], lowest, machine, margin)
    at_minimum = holds == MINIMUM
    frozen = np.array([bool(reason) for reason in kept])
    limit = np.where(frozen[segment], programmed[segment], limit)
    holds[frozen[segment]] = KEPT
    stretches = _stretches_that_keep(
        path, np.asarray(track.s_mm), limit, frozen, programmed, divisible, machine, motion, 60.0 / teeth_per_min,
        feed_unit_mm_per_min, segment,
    )  # fmt: skip
    return FeedPlan(surveyed, limit, holds, kept, tuple(stretches), at_minimum, 60.0 / teeth_per_min)


def _kept_segments(surveyed: SurveyedRegion, programmed: Vector, lowest: float, tool: Tool) -> tuple[str, ...]:
    track = surveyed.track
    assert track is not None
    reasons = [""] * len(programmed)
    end_mm2 = np.pi * tool.radius_mm**2
    plunged = np.asarray(track.plunged_mm2) > _DEEPER_PLUNGE * end_mm2
    for index in np.unique(np.asarray(track.segment)[plunged]):
        reasons[index] = "plunges into material"
    for index in np.flatnonzero(programmed < lowest * (1.0 - 1e-9)):
        reasons[index] = f"its feed, {programmed[index]:g} mm/min, is already below the least one, {lowest:g} mm/min"
    return tuple(reasons)


def _limits_along(
    surveyed: SurveyedRegion, programmed: Vector, lowest: float, machine: Machine, margin: float
) -> tuple[Vector, npt.NDArray[np.str_]]:
    """Largest feed on the stretch before each station, and what holds it."""
    tool, track = surveyed.tool, surveyed.track
    assert tool is not None and track is not None
    axes = machine.axes
    fastest = min(axes.x.max_feed_mm_per_min, axes.y.max_feed_mm_per_min)
    fastest = min(fastest, tool.feed.max_feed_mm_per_min or fastest)
    # Without a largest chip nobody said that more than the programmed feed is wanted in material.
    raised = tool.limits.feed_per_tooth_max_mm is not None or tool.feed.max_feed_mm_per_min is not None
    ceiling = np.full(len(programmed), fastest) if raised else np.minimum(programmed, fastest)
    force = milling_force(tool, surveyed)
    # Searched to far below the least feed: what needs less than that is told apart from what just reaches it.
    bound, limit, _ = _core.largest_feeds(
        force, track, limits_of(tool, machine, margin), 1e-3 * lowest, float(ceiling.max())
    )
    holds = np.where(bound < ceiling, _LIMIT_NAMES[limit], PROGRAMMED)
    feeds = np.minimum(bound, ceiling)
    low = feeds < lowest
    feeds[low] = np.minimum(lowest, ceiling[low])
    holds[low] = MINIMUM
    air = np.asarray(track.section_mm2) <= _AIR_MM2
    feeds[air] = programmed[air]
    holds[air] = AIR
    # A station speaks for the stretch before it, on which the load changes from what the last one met.
    segment = np.asarray(track.segment)
    same = (segment[1:] == segment[:-1]) & ~air[1:] & ~air[:-1]
    before = np.where(same & (feeds[:-1] < feeds[1:]), np.arange(len(feeds) - 1), np.arange(1, len(feeds)))
    feeds[1:], holds[1:] = feeds[before], holds[before]
    if tool.feed.air_feed_mm_per_min is not None:
        level = np.asarray(track.horizontal) > _STEEPEST_AIR  # nobody wants a tool to come down faster than he said
        clear = air & level & ~_near_material(np.asarray(track.s_mm), air, tool.feed.approach_mm)
        feeds[clear] = np.maximum(programmed[clear], min(tool.feed.air_feed_mm_per_min, fastest))
    return feeds, holds


def _stepped(limit: Vector, programmed: Vector) -> Vector:
    """Feeds rounded down to steps of half a percent below the programmed one, or the largest if that is more."""
    steps = np.ceil(np.log(programmed / limit) / math.log1p(_STEP) - 1e-9)
    down: Vector = programmed * (1.0 + _STEP) ** -steps
    return down


def _near_material(s_mm: Vector, air: npt.NDArray[np.bool_], approach_mm: float) -> npt.NDArray[np.bool_]:
    """Stations from which the next material is no farther than the approach."""
    contact = np.where(air, np.inf, np.concatenate(([0.0], s_mm[:-1])))  # where the stretch of a station begins
    following = np.minimum.accumulate(contact[::-1])[::-1]
    near: npt.NDArray[np.bool_] = following - s_mm <= approach_mm
    return near


def _stretches_that_keep(
    path: _core.Path,
    stations: Vector,
    limit: Vector,
    frozen: npt.NDArray[np.bool_],
    programmed: Vector,
    divisible: list[bool],
    machine: Machine,
    motion: Motion,
    window_s: float,
    feed_unit: float,
    segment: npt.NDArray[np.uint32],
) -> list[_core.FeedStretch]:
    """Plan, travel, and slow down earlier or more where the travel is still too fast."""
    control = machine.feed_control
    kept = np.where(frozen, programmed, 0.0)
    planned = _stepped(limit, programmed[segment])
    reach = np.full(len(stations), motion.reach_s + window_s)
    free = ~frozen[segment]
    stretches: list[_core.FeedStretch] = []
    for attempt in range(_ATTEMPTS):
        feeds = _core.look_ahead_on_load(stations, planned, reach)
        stretches = _core.schedule_feed(
            path.segment_ends_mm, kept, divisible, stations, feeds, control.interval_mm,
            np.inf if control.max_change_mm_per_min is None else control.max_change_mm_per_min, feed_unit,
        )  # fmt: skip
        travelled = motion.travel(_core.with_feeds(path, stretches), stations, window_s)
        over = free & (travelled.feed_mm_per_min > limit * (1.0 + _TOO_FAST))
        if not over.any():
            break
        reach[over] = 1.5 * reach[over] + motion.reach_s / 4.0 + window_s
        if attempt >= _LOWERING:
            planned[over] *= limit[over] / travelled.feed_mm_per_min[over]
    return stretches
