"""Load along a path at the feed that the machine reaches (outside of cuts: as programmed), and curves for pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.cutting.tool import Tool
from shapegcode.feed.plan import FeedPlan, Mover, Travelled, Vector, goes_on, limits_of
from shapegcode.feed.survey import Survey, SurveyedMove, SurveyedRegion
from shapegcode.machine import Machine
from shapegcode.results.outcome import Pair

_SLACK = 1e-3  # relative tolerance of a limit, for its search and rounding
LOADS = {  # columns of Load, named like their limits in the core: display name, unit and decimals
    "peak_resultant_n": ("peak resultant", "N", 1),
    "mean_resultant_n": ("mean resultant", "N", 1),
    "peak_deflection_um": ("deflection", "µm", 1),
    "peak_torque_nm": ("torque", "N m", 3),
    "mean_power_w": ("power", "W", 1),
}
_COLUMNS = 400
_ROWS = 31


@dataclass(frozen=True)
class Load:
    """Load along a path, per station, (n,); feed: as reached, outside of regions as programmed."""

    feed_mm_per_min: Vector  # largest on the interval before the station
    time_s: Vector  # on that interval
    mean_resultant_n: Vector  # mean of the XY resultant over one revolution
    peak_resultant_n: Vector  # largest XY resultant in that revolution
    peak_torque_nm: Vector  # largest torque
    mean_power_w: Vector  # mean power
    peak_deflection_um: Vector  # largest deflection of the tip

    @classmethod
    def in_a_row(cls, loads: Sequence[Load]) -> Load:
        """Concatenate loads."""
        names = [field.name for field in fields(cls)]
        return cls(**{name: np.concatenate([getattr(load, name) for load in loads]) for name in names})


@dataclass(frozen=True)
class PathLoad(Pair[Load]):
    """Load along a path, `original` and `emitted`."""

    s_mm: Vector  # the stations, along the path, (n,)


def region_load(
    part: SurveyedRegion, plan: FeedPlan | None, written: _core.Path, *, before: Mover, after: Mover
) -> PathLoad | None:
    """Load along a cut for the original and the emitted program; None if engagement or spindle speed is unknown."""
    if part.track is None or part.tool is None or not part.spindle_rev_per_min > 0.0 or len(part.track) == 0:
        return None
    stations = np.asarray(part.track.s_mm)
    was = load_of(part, before.travel(part.region.path, part.region.path, stations, part.window_s))
    if plan is None and before is after:
        return PathLoad(was, was, stations)
    travelled = after.travel(written, part.region.path, stations, part.window_s)
    return PathLoad(was, load_of(part, travelled), stations)


def move_load(move: SurveyedMove) -> PathLoad | None:
    """Load along a move outside of the regions at its programmed feed; None without a spindle speed."""
    if not move.spindle_rev_per_min > 0.0:
        return None
    stations = np.asarray(move.track.s_mm)
    times = np.diff(np.concatenate(([0.0], stations))) / move.feed_mm_per_min * 60.0
    load = load_of(move, Travelled(np.full(len(stations), move.feed_mm_per_min), times))
    return PathLoad(load, load, stations)


def load_of(part: SurveyedRegion | SurveyedMove, travelled: Travelled) -> Load:
    """Load along a region, or along a move outside of the regions."""
    assert part.tool is not None and part.track is not None
    # The engagement at a station applies with the feeds of the intervals before and after it.
    feeds = travelled.feed_mm_per_min.copy()
    feeds[:-1] = np.where(goes_on(part.track), np.maximum(feeds[:-1], feeds[1:]), feeds[:-1])
    force = part.tool.force(part.spindle_rev_per_min, part.sense)
    figures = force.figures_of(part.track, feeds, part.tool.beam())
    return Load(travelled.feed_mm_per_min, travelled.time_s, **{name: figures[name] for name in LOADS})


def exceeded(tool: Tool, load: Load, machine: Machine) -> Iterator[tuple[str, str, str, float]]:
    """Yield column, name, unit and limit of exceeded limits."""
    limits = limits_of(tool, machine, 0.0)
    for column, (words, unit, _) in LOADS.items():
        limit = getattr(limits, column)
        if np.isfinite(limit) and (getattr(load, column) > limit * (1.0 + _SLACK)).any():
            yield column, words, unit, limit


@dataclass(frozen=True)
class FeedTraces:
    """A schedule along the path, all cuts in sequence; each value applies to the interval before its station."""

    distance_mm: Vector  # end of each interval, (n,)
    length_mm: Vector  # of each interval, (n,)
    xy_mm: Vector  # position of each station, (n, 2)
    begins: npt.NDArray[np.intp]  # index of the first station of each region
    radial_depth_mm: Vector  # radial depth, (n,)
    section_mm2: Vector  # area of the cut, perpendicular to the feed, (n,)
    programmed_mm_per_min: Vector  # F words of the original, (n,)
    written_mm_per_min: Vector  # new F words, (n,)
    load: Pair[Load]  # with the original and the new feeds, as the machine reaches them
    limit: Mapping[str, Vector]  # of tool and machine by the name of the load (`LOADS`), (n,); inf: no limit

    def __len__(self) -> int:
        return len(self.distance_mm)


def feed_traces(
    survey: Survey, plans: Sequence[FeedPlan | None], loads: Sequence[PathLoad | None], machine: Machine
) -> FeedTraces | None:
    """Curves of all regions with known load; None: no such region."""
    parts = [
        (part, part.track, plan, load)
        for part, plan, load in zip(survey.regions, plans, loads, strict=True)
        if part.track is not None and part.tool is not None and load is not None
    ]
    if not parts:
        return None
    lengths = [np.diff(load.s_mm, prepend=0.0) for *_, load in parts]
    length = np.concatenate(lengths)
    counts = np.array([len(each) for each in lengths])
    limits = [limits_of(part.tool, machine, 0.0) for part, *_ in parts if part.tool is not None]
    programmed = [
        np.asarray(part.region.path.segment_feeds_mm_per_s * 60.0)[np.asarray(track.segment)]
        for part, track, *_ in parts
    ]
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
        limit={name: np.repeat([getattr(each, name) for each in limits], counts) for name in LOADS},
    )


def _written(plan: FeedPlan, load: PathLoad) -> Vector:
    ends = np.array([stretch.end_mm for stretch in plan.stretches])
    # Use the middle of an interval, as the feed may change at its end.
    middles = load.s_mm - 0.5 * np.diff(load.s_mm, prepend=0.0)
    inside = np.minimum(np.searchsorted(ends, middles), len(ends) - 1)
    return np.array([stretch.feed_mm_per_min for stretch in plan.stretches])[inside]


def groups(distance_mm: Vector, most: int) -> npt.NDArray[np.intp]:
    """Divide the stations into *most* groups of about equal length, or fewer: index of each group's first station."""
    if len(distance_mm) <= most:
        return np.arange(len(distance_mm))
    edges = np.linspace(0.0, float(distance_mm[-1]), most + 1)[:-1]
    return np.unique(np.searchsorted(distance_mm, edges))


def envelope(values: Vector, starts: npt.NDArray[np.intp]) -> tuple[Vector, Vector]:
    """Minimum and maximum of each group of stations."""
    return np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)


@dataclass(frozen=True)
class WallMaps:
    """Form error of the wall over distance and height, µm (+: material remains); in a slot: right wall."""

    edges_mm: Vector  # of the columns, along the cutting path, (m + 1,)
    height_mm: Vector  # above the tip, (h,)
    error_um: Pair[Vector]  # with the original and the new feeds, (m, h) each; NaN: no wall there


def wall_maps(survey: Survey, loads: Sequence[PathLoad | None], traces: FeedTraces) -> WallMaps | None:
    """Walls along the cutting path; None: no walls.

    Each column is an interval of the path; it shows the wall at the station with the original's largest peak resultant.

    Source: the error of a wall is from Kim and Ko, 2001 (paper 001), section 2.3; its map is this project's.
    """
    starts = groups(traces.distance_mm, _COLUMNS)
    ends = np.append(starts[1:], len(traces))
    load = traces.load.original.peak_resultant_n
    chosen = np.array([a + int(np.argmax(load[a:b])) for a, b in zip(starts, ends, strict=True)])
    parts = [part for part, known in zip(survey.regions, loads, strict=True) if known is not None]
    bands = [np.asarray(part.track.arcs)[:, 2:] for part in parts if part.track is not None]
    cut = np.concatenate([*bands, np.empty((0, 2))])
    # Between the lowest and the highest engagement above the tip.
    lowest, highest = (cut[:, 0].min(), cut[:, 1].max()) if len(cut) else (0.0, 1.0)
    height = np.linspace(lowest, highest, _ROWS)
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


def _wall(force: _core.MillingForce, beam: _core.ToolBeam, arcs: Vector, feed: float, height: Vector) -> Vector:
    """Error of the wall to the right of the feed; of the left wall if only that is cut."""
    for side in (_core.WallSide.right, _core.WallSide.left):
        error = np.asarray(_core.wall_error_um(force, beam, arcs, feed, side, height))
        if np.isfinite(error).any():
            break
    return error
