"""Engagement without a grid: places on the tool's circumference against everything the tool has swept before.

Written from the definition: a place is in material if it lies within the stock and nowhere within a radius of the way
of the tool's axis so far, as far as that way ran deep enough.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt
import shapely

from judge.engagement import Stretch
from shapegcode._core import EngagementTrack, Path, Segment, SegmentKind

Array = npt.NDArray[np.float64]


def random_program(rng: np.random.Generator, levels: list[float], moves: int) -> Path:
    """Lines and arcs on random levels within +-14 mm, with plunges, ramps and retracts in between."""
    here = np.array([*rng.uniform(-14, 14, 2), 2.0])
    segments: list[Segment] = []

    def line(to: Array) -> None:
        nonlocal here
        segments.append(Segment.line(here, to, 10.0))
        here = to

    while len(segments) < moves:
        line(np.array([here[0], here[1], rng.choice(levels)]))
        for _ in range(rng.integers(3, 7)):
            if rng.uniform() < 0.4:
                centre = here + np.array([*rng.uniform(-7, 7, 2), 0.0])
                sweep = rng.uniform(0.3, 5.0) * rng.choice([-1.0, 1.0])
                arm = here - centre
                turn = np.array([[np.cos(sweep), -np.sin(sweep)], [np.sin(sweep), np.cos(sweep)]])
                to = np.array([*(centre[:2] + turn @ arm[:2]), here[2]])
                segments.append(Segment.arc(here, to, centre, sweep, 10.0))
                here = to
            else:
                line(np.array([*rng.uniform(-14, 14, 2), here[2]]))
        line(np.array([here[0], here[1], 2.0]))
        line(np.array([*rng.uniform(-14, 14, 2), 2.0]))
    return Path(segments)


def _stretch(segment: Segment, tool_radius_mm: float) -> Stretch:
    start, end = segment.start_mm, segment.end_mm
    centre = segment.centre_mm[:2] if segment.kind == SegmentKind.arc else None
    return Stretch(start[:2], end[:2], start[2], end[2], tool_radius_mm, centre, segment.sweep_rad)


def section_mm2(path: Path, track: EngagementTrack, sample: int, rings: list[Array], borders: list[float],
                tool_radius_mm: float, places: int = 1080) -> float:  # fmt: skip
    """Area of material that the front of the tool meets at a sample, without what is below its end."""
    if track.horizontal[sample] == 0.0:
        return 0.0
    azimuth = (np.arange(places) + 0.5) / places * np.pi - np.pi / 2
    angle = track.direction_rad[sample] + azimuth
    centre = np.array([track.x_mm[sample], track.y_mm[sample]])
    rim = centre + tool_radius_mm * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    last = int(track.segment[sample])
    begin = sum(path[i].length_mm for i in range(last))
    tip = path[last].point_at(track.s_mm[sample] - begin)[2]
    inside = np.zeros(places, dtype=bool)
    for ring in rings:
        inside ^= shapely.contains_xy(shapely.Polygon(ring), rim[:, 0], rim[:, 1])
    area = 0.0
    for bottom, top in pairwise(borders):
        middle = 0.5 * (bottom + top)
        if middle <= tip:
            continue
        left = inside.copy()
        for i in range(last + 1):
            way = _stretch(path[i], tool_radius_mm)
            part = way if i < last else way.part(0.0, (track.s_mm[sample] - begin) / path[i].length_mm)
            if min(part.from_z, part.to_z) < middle:
                left &= part.distance(rim) > tool_radius_mm - 1e-9
        area += (top - max(bottom, tip)) * tool_radius_mm * np.sum(np.cos(azimuth[left])) * np.pi / places
    return area
