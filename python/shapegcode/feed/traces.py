"""Curves of a feed schedule along the cutting path: what its pictures draw."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.cutting.tool import Limits
from shapegcode.feed.load import LOADS, Load, PathLoad
from shapegcode.feed.plan import FeedPlan
from shapegcode.feed.survey import Survey
from shapegcode.feed.walk import SurveyedRegion
from shapegcode.results.result import Pair

__all__ = ["FeedTraces", "WallMaps", "envelope", "feed_traces", "groups", "wall_maps"]

Vector = npt.NDArray[np.float64]

_COLUMNS = 400
_ROWS = 31


@dataclass(frozen=True)
class FeedTraces:
    """A schedule along the cutting path, all regions in a row; each value holds on the stretch before its station.

    Attributes:
        distance_mm: where each stretch ends, (n,).
        length_mm: of each stretch, (n,).
        xy_mm: place of each station, (n, 2).
        begins: index of the first station of each region.
        radial_depth_mm: what the tool meets, (n,).
        section_mm2: area of the cut, in the plane across the feed, (n,).
        programmed_mm_per_min: F words of the original, (n,).
        written_mm_per_min: the new ones, (n,).
        load: with the original feeds and with the new ones, as the machine runs them.
        limit: of the tool file by the name of the load (`LOADS`), (n,); inf where there is none.
    """

    distance_mm: Vector
    length_mm: Vector
    xy_mm: Vector
    begins: npt.NDArray[np.intp]
    radial_depth_mm: Vector
    section_mm2: Vector
    programmed_mm_per_min: Vector
    written_mm_per_min: Vector
    load: Pair[Load]
    limit: Mapping[str, Vector]

    def __len__(self) -> int:
        """Stations."""
        return len(self.distance_mm)


def feed_traces(
    survey: Survey, plans: Sequence[FeedPlan | None], loads: Sequence[PathLoad | None]
) -> FeedTraces | None:
    """The curves of all regions whose load is known; None: there is none."""
    parts = [
        (part, part.track, plan, load)
        for part, plan, load in zip(survey.regions, plans, loads, strict=True)
        if part.track is not None and load is not None
    ]
    if not parts:
        return None
    lengths = [np.diff(load.s_mm, prepend=0.0) for *_, load in parts]
    length = np.concatenate(lengths)
    counts = np.array([len(each) for each in lengths])
    limits = [_limits(part) for part, *_ in parts]
    programmed = [_programmed(part, track) for part, track, *_ in parts]
    written = [
        was if plan is None else _written(plan, load) for was, (*_, plan, load) in zip(programmed, parts, strict=True)
    ]
    return FeedTraces(
        distance_mm=np.cumsum(length),
        length_mm=length,
        xy_mm=np.concatenate([np.column_stack((track.x_mm, track.y_mm)) for _, track, *_ in parts]),
        begins=np.concatenate(([0], np.cumsum(counts)[:-1])),
        radial_depth_mm=np.concatenate([track.radial_depth_mm for _, track, *_ in parts]),
        section_mm2=np.concatenate([track.section_mm2 for _, track, *_ in parts]),
        programmed_mm_per_min=np.concatenate(programmed),
        written_mm_per_min=np.concatenate(written),
        load=Pair(
            Load.in_a_row([load.original for *_, load in parts]), Load.in_a_row([load.emitted for *_, load in parts])
        ),
        limit={name: np.repeat([each[name] for each in limits], counts) for name in LOADS},
    )


def _programmed(part: SurveyedRegion, track: _core.EngagementTrack) -> Vector:
    feeds: Vector = (part.region.path.segment_feeds_mm_per_s * 60.0)[np.asarray(track.segment)]
    return feeds


def _written(plan: FeedPlan, load: PathLoad) -> Vector:
    ends = np.array([stretch.end_mm for stretch in plan.stretches])
    # The middle of a stretch: its end may be the place where the feed changes.
    middles = load.s_mm - 0.5 * np.diff(load.s_mm, prepend=0.0)
    inside = np.minimum(np.searchsorted(ends, middles), len(ends) - 1)
    feeds: Vector = np.array([stretch.feed_mm_per_min for stretch in plan.stretches])[inside]
    return feeds


def _limits(part: SurveyedRegion) -> dict[str, float]:
    limits = Limits() if part.tool is None else part.tool.limits
    peak = limits.resultant == "peak"
    values = {
        "peak_resultant_n": limits.resultant_n if peak else None,
        "mean_resultant_n": None if peak else limits.resultant_n,
        "peak_deflection_um": limits.deflection_um,
        "peak_torque_nm": limits.torque_nm,
        "mean_power_w": limits.power_w,
    }
    return {name: math.inf if value is None else value for name, value in values.items()}


def groups(distance_mm: Vector, most: int) -> npt.NDArray[np.intp]:
    """First stations of at most *most* runs of about equal length; every station is in one."""
    if len(distance_mm) <= most:
        return np.arange(len(distance_mm))
    edges = np.linspace(0.0, float(distance_mm[-1]), most + 1)[:-1]
    return np.unique(np.searchsorted(distance_mm, edges))


def envelope(values: Vector, starts: npt.NDArray[np.intp]) -> tuple[Vector, Vector]:
    """Least and largest value of each run of stations."""
    return np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)


@dataclass(frozen=True)
class WallMaps:
    """Form error of the wall over distance and height, µm: + material is left standing.

    Of the two walls of a slot it is that to the right of the feed.

    Attributes:
        edges_mm: of the columns, along the cutting path, (m + 1,).
        height_mm: above the tip, (h,).
        error_um: with the original feeds and with the new ones, (m, h) each; NaN: no wall is made there.
    """

    edges_mm: Vector
    height_mm: Vector
    error_um: Pair[Vector]


def wall_maps(survey: Survey, loads: Sequence[PathLoad | None], traces: FeedTraces) -> WallMaps | None:
    """The walls along the cutting path; None: none are made.

    A column speaks for a stretch of the path, taken where the peak resultant was largest before.

    Source: the error of a wall is that of Kim and Ko, 2001 (paper 001), section 2.3; its map is of this project.
    """
    starts = groups(traces.distance_mm, _COLUMNS)
    ends = np.append(starts[1:], len(traces))
    load = traces.load.original.peak_resultant_n
    chosen = np.array([a + int(np.argmax(load[a:b])) for a, b in zip(starts, ends, strict=True)])
    parts = [part for part, known in zip(survey.regions, loads, strict=True) if known is not None]
    height = np.linspace(*_reach(parts), _ROWS)
    maps = [(each, np.full((len(chosen), _ROWS), np.nan)) for each in (traces.load.original, traces.load.emitted)]
    owner = np.searchsorted(traces.begins, chosen, side="right") - 1
    for number, part in enumerate(parts):
        assert part.tool is not None and part.track is not None
        force, beam = part.tool.force(part.spindle_rev_per_min, part.sense), part.tool.beam()
        inside = height <= part.tool.tool.overhang_mm
        for row in np.flatnonzero(owner == number):
            arcs = part.track.arcs_of(int(chosen[row] - traces.begins[number]))
            if len(arcs) == 0:
                continue
            for each, table in maps:
                table[row, inside] = _wall(force, beam, arcs, float(each.feed_mm_per_min[chosen[row]]), height[inside])
    (_, original), (_, emitted) = maps
    if not np.isfinite(original).any():
        return None
    edges = np.append(traces.distance_mm[starts] - traces.length_mm[starts], traces.distance_mm[-1])
    return WallMaps(edges, height, Pair(original, emitted))


def _reach(parts: Sequence[SurveyedRegion]) -> tuple[float, float]:
    """Lowest and highest engagement above the tip, mm."""
    bands = [np.asarray(part.track.arcs)[:, 2:] for part in parts if part.track is not None]
    cut = np.concatenate([*bands, np.empty((0, 2))])
    return (float(cut[:, 0].min()), float(cut[:, 1].max())) if len(cut) else (0.0, 1.0)


def _wall(force: _core.MillingForce, beam: _core.ToolBeam, arcs: Vector, feed: float, height: Vector) -> Vector:
    """Error of the wall to the right of the feed, or of that to the left where only that is made."""
    for side in (_core.WallSide.right, _core.WallSide.left):
        error = np.asarray(_core.wall_error_um(force, beam, arcs, feed, side, height))
        if np.isfinite(error).any():
            break
    return error
