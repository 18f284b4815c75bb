"""Plane shapes offset by a distance: what GEOS makes of them, with its corners put where they belong."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from shapely import Geometry, STRtree

__all__ = ["chord_angle_rad", "grown", "swept"]

Points = NDArray[np.float64]

# Chords leave the arcs that they stand for by less than this.
_SAGITTA_MM = 4e-5
# GEOS takes corners nearer than this, relative to the distance, for one; so far may they be off.
_SNAP = 2e-3
_ROUNDS = 3
# A corner, not two chords of an arc.
_TURN_RAD = 0.1


def chord_angle_rad(radius_mm: float) -> float:
    """Angle of a chord that leaves its arc by 0.04 µm; at most some 80 degrees."""
    return 2 * math.acos(1 - _SAGITTA_MM / max(radius_mm, 4 * _SAGITTA_MM))


def grown(area: Geometry, distance_mm: float) -> Geometry:
    """An area with all points within a distance of it; below 0: without those that near to its boundary."""
    if distance_mm == 0:
        return area
    return _placed(area.buffer(distance_mm, quad_segs=_quarter(distance_mm)), area.boundary, abs(distance_mm))


def swept(points: Points, distance_mm: float, *, round_ends: bool = True) -> Geometry:
    """All points within a distance of a line; without round ends only those beside it."""
    import shapely

    line = shapely.LineString(points)
    caps = "round" if round_ends else "flat"
    return _placed(line.buffer(distance_mm, quad_segs=_quarter(distance_mm), cap_style=caps), line, distance_mm)


def _quarter(distance_mm: float) -> int:
    """Chords of a quarter of a circle."""
    return math.ceil(0.5 * math.pi / chord_angle_rad(abs(distance_mm)))


def _placed(shape: Geometry, source: Geometry, distance_mm: float) -> Geometry:
    """A shape with its corners moved to the distance from the line that it was offset from."""
    import shapely

    if shape.is_empty:
        return shape
    ends = [shapely.get_coordinates(part) for part in shapely.get_parts(source)]
    pieces = shapely.linestrings(np.vstack([np.stack([part[:-1], part[1:]], axis=1) for part in ends]))
    tree = shapely.STRtree(pieces)
    before = shapely.get_coordinates(shape)
    corners, restless = before.copy(), np.arange(len(before))
    for _ in range(_ROUNDS):
        points = shapely.points(corners[restless])
        reach = (1 + _SNAP) * distance_mm
        at, nearest = tree.query_nearest(points, max_distance=reach, all_matches=False)
        foot = shapely.get_coordinates(shapely.shortest_line(pieces[nearest], points[at]))[::2]
        away = corners[restless[at]] - foot
        length = np.hypot(*away.T)
        # What is nearer than that is a flat end; what is in place already may stay.
        error = np.abs(length - distance_mm)
        is_off = (error < _SNAP * distance_mm) & (error > 1e-9)
        restless = restless[at[is_off]]
        corners[restless] = (foot + away * (distance_mm / length)[:, None])[is_off]
        if not restless.size:
            break
    for index in _turns(shape, corners):
        corners[index] = _meeting(corners[index], pieces, tree, distance_mm)
    placed = shapely.set_coordinates(shapely.force_2d(shape), corners)
    return placed if placed.is_valid else shape


def _turns(shape: Geometry, corners: Points) -> NDArray[np.intp]:
    """Where the outline of a shape, with these corners, really turns: not between two chords of an arc."""
    import shapely

    begin, turns = 0, []
    for ring in shapely.get_rings(shape):
        count = shapely.get_num_coordinates(ring)
        points = corners[begin : begin + count - 1]
        along = np.roll(points, -1, axis=0) - points
        before = np.roll(along, 1, axis=0)
        cross = before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0]
        angle = np.abs(np.arctan2(cross, np.sum(before * along, axis=1)))
        found = begin + np.flatnonzero(angle > _TURN_RAD)
        # The first corner of a ring stands at its end once more.
        turns += [found, found[found == begin] + count - 1]
        begin += count
    return np.concatenate(turns)


def _meeting(corner: Points, pieces: NDArray[np.object_], tree: STRtree, distance_mm: float) -> Points:
    """A corner moved to the distance from both lines that it lies between; as it was where there is only one."""
    import shapely

    moved = corner
    for _ in range(_ROUNDS):
        point = shapely.Point(moved)
        near = pieces[tree.query(point, predicate="dwithin", distance=(1 + _SNAP) * distance_mm)]
        if not near.size:
            return corner
        away = moved - shapely.get_coordinates(shapely.shortest_line(near, point))[::2]
        length = np.hypot(*away.T)
        direction = away / length[:, None]
        first = int(np.argmin(length))
        second = int(np.argmin(direction @ direction[first]))
        pair = direction[[first, second]]
        if abs(np.linalg.det(pair)) < math.sin(_TURN_RAD):
            return corner
        moved = moved + np.linalg.solve(pair, distance_mm - length[[first, second]])
    return moved if np.hypot(*(moved - corner)) < 5 * _SNAP * distance_mm else corner
