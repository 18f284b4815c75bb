"""Curves of a feed schedule along the cutting path: what its pictures draw."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.cutting.tool import Limits
from shapegcode.feed.plan import FeedPlan, milling_force, tool_beam
from shapegcode.feed.report import RegionLoad
from shapegcode.feed.schedule import FeedSchedule
from shapegcode.feed.survey import SurveyedRegion

__all__ = ["LOADS", "FeedTraces", "WallMaps", "envelope", "feed_traces", "groups", "wall_maps"]

Vector = npt.NDArray[np.float64]

LOADS = ("peak_resultant_n", "mean_resultant_n", "peak_deflection_um", "peak_torque_nm", "mean_power_w")
"""Columns of the load, as `feed_report.Load` names them."""

_COLUMNS = 400
_ROWS = 31


@dataclass(frozen=True)
class FeedTraces:
    """A schedule along the cutting path, all regions in a row; each value holds on the stretch before its station.

    Attributes:
        distance_mm: where each stretch ends, (n,).
        length_mm: of each stretch.
        xy_mm: place of each station, (n, 2).
        begins: index of the first station of each region.
        radial_depth_mm: what the tool meets.
        section_mm2: area of the cut, in the plane across the feed.
        feed_mm_per_min: `programmed`, `written` (F words), `before` and `after` (as the machine runs them).
        before: load by name (`LOADS`) with the original feeds.
        after: the same with the new ones.
        limit: limit of the tool file by name, inf where there is none.
    """

    distance_mm: Vector
    length_mm: Vector
    xy_mm: Vector
    begins: npt.NDArray[np.intp]
    radial_depth_mm: Vector
    section_mm2: Vector
    feed_mm_per_min: Mapping[str, Vector]
    before: Mapping[str, Vector]
    after: Mapping[str, Vector]
    limit: Mapping[str, Vector]

    def __len__(self) -> int:
        """Stations."""
        return len(self.distance_mm)


def feed_traces(result: FeedSchedule) -> FeedTraces:
    """The curves of all regions whose load is known.

    Raises:
        ArgumentError: there is none.
    """
    parts = list(_known(result))
    if not parts:
        raise _core.ArgumentError("no region whose cutting force is known: there is nothing to draw")
    lengths = [np.diff(load.s_mm, prepend=0.0) for _, _, load in parts]
    length = np.concatenate(lengths)
    counts = np.array([len(each) for each in lengths])
    feeds = [_feeds(part, plan, load) for part, plan, load in parts]
    limits = [_limits(part) for part, _, _ in parts]
    return FeedTraces(
        distance_mm=np.cumsum(length),
        length_mm=length,
        xy_mm=np.concatenate(
            [np.column_stack((part.track.x_mm, part.track.y_mm)) for part, _, _ in parts if part.track]
        ),
        begins=np.concatenate(([0], np.cumsum(counts)[:-1])),
        radial_depth_mm=np.concatenate([part.track.radial_depth_mm for part, _, _ in parts if part.track]),
        section_mm2=np.concatenate([part.track.section_mm2 for part, _, _ in parts if part.track]),
        feed_mm_per_min={name: np.concatenate([each[name] for each in feeds]) for name in feeds[0]},
        before={name: np.concatenate([getattr(load.before, name) for _, _, load in parts]) for name in LOADS},
        after={name: np.concatenate([getattr(load.after, name) for _, _, load in parts]) for name in LOADS},
        limit={name: np.repeat([each[name] for each in limits], counts) for name in LOADS},
    )


def _known(result: FeedSchedule) -> Iterator[tuple[SurveyedRegion, FeedPlan | None, RegionLoad]]:
    for part, plan, load in zip(result.survey.regions, result.plans, result.loads, strict=True):
        if load is not None:
            yield part, plan, load


def _feeds(part: SurveyedRegion, plan: FeedPlan | None, load: RegionLoad) -> dict[str, Vector]:
    path = part.region.path
    assert part.track is not None
    words = np.array([path[i].feed_mm_per_s * 60.0 for i in range(len(path))])
    programmed = words[np.asarray(part.track.segment)]
    written = programmed
    if plan is not None:
        ends = np.array([stretch.end_mm for stretch in plan.stretches])
        # The middle of a stretch: its end may be the place where the feed changes.
        middles = load.s_mm - 0.5 * np.diff(load.s_mm, prepend=0.0)
        inside = np.minimum(np.searchsorted(ends, middles), len(ends) - 1)
        written = np.array([stretch.feed_mm_per_min for stretch in plan.stretches])[inside]
    return {
        "programmed": programmed,
        "written": written,
        "before": load.before.feed_mm_per_min,
        "after": load.after.feed_mm_per_min,
    }


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
        before: with the original feeds, (m, h); NaN: no wall is made there.
        after: with the new ones.
    """

    edges_mm: Vector
    height_mm: Vector
    before: Vector
    after: Vector


def wall_maps(result: FeedSchedule, traces: FeedTraces) -> WallMaps | None:
    """The walls along the cutting path; None: none are made.

    A column speaks for a stretch of the path, taken where the peak resultant was largest before.
    """
    starts = groups(traces.distance_mm, _COLUMNS)
    ends = np.append(starts[1:], len(traces))
    load = traces.before["peak_resultant_n"]
    chosen = np.array([a + int(np.argmax(load[a:b])) for a, b in zip(starts, ends, strict=True)])
    parts = list(_known(result))
    bottom, top = _reach(parts)
    height = np.linspace(bottom, top, _ROWS)
    maps = {"before": np.full((len(chosen), _ROWS), np.nan), "after": np.full((len(chosen), _ROWS), np.nan)}
    owner = np.searchsorted(traces.begins, chosen, side="right") - 1
    for number, (part, _, _) in enumerate(parts):
        rows = np.flatnonzero(owner == number)
        assert part.tool is not None
        assert part.track is not None
        force, beam = milling_force(part.tool, part), tool_beam(part.tool)
        inside = height <= part.tool.tool.overhang_mm
        for row in rows:
            arcs = part.track.arcs_of(int(chosen[row] - traces.begins[number]))
            if len(arcs) == 0:
                continue
            for when, table in maps.items():
                feed = float(traces.feed_mm_per_min[when][chosen[row]])
                table[row, inside] = _wall(force, beam, arcs, feed, height[inside])
    if not np.isfinite(maps["before"]).any():
        return None
    edges = np.append(traces.distance_mm[starts] - traces.length_mm[starts], traces.distance_mm[-1])
    return WallMaps(edges, height, maps["before"], maps["after"])


def _reach(parts: list[tuple[SurveyedRegion, FeedPlan | None, RegionLoad]]) -> tuple[float, float]:
    """Lowest and highest engagement above the tip, mm."""
    bands = [np.asarray(part.track.arcs)[:, 2:] for part, _, _ in parts if part.track is not None]
    cut = np.concatenate([*bands, np.empty((0, 2))])
    return (float(cut[:, 0].min()), float(cut[:, 1].max())) if len(cut) else (0.0, 1.0)


def _wall(force: _core.MillingForce, beam: _core.ToolBeam, arcs: Vector, feed: float, height: Vector) -> Vector:
    """Error of the wall to the right of the feed, or of that to the left where only that is made."""
    for side in (_core.WallSide.right, _core.WallSide.left):
        error = np.asarray(_core.wall_error_um(force, beam, arcs, feed, side, height))
        if np.isfinite(error).any():
            break
    return error
