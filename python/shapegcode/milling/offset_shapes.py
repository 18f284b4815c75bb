"""Plane shapes offset by a distance, exact but for the chords of the arcs.

GEOS offsets shapes itself, but snaps corners nearer than a thousandth of the distance, some micrometres here. So a
strip along the boundary is made of a rectangle for each edge and a wedge for each corner, and united with the shape or
taken from it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from shapely import Geometry

__all__ = ["SAGITTA_MM", "chord_angle_rad", "grown", "swept"]

Points = NDArray[np.float64]

# Chords leave the arcs that they stand for by less than this.
SAGITTA_MM = 1e-4


def chord_angle_rad(radius_mm: float) -> float:
    """Angle of a chord that leaves its arc by SAGITTA_MM; at most a right angle."""
    return 2 * math.acos(1 - SAGITTA_MM / max(radius_mm, 4 * SAGITTA_MM))


def grown(area: Geometry, distance_mm: float) -> Geometry:
    """An area with all points within a distance of it; below 0: without those that near to its boundary."""
    import shapely

    if distance_mm == 0 or area.is_empty:
        return area
    pieces: list[Geometry] = []
    for part in shapely.get_parts(shapely.orient_polygons(area)):
        if part.geom_type == "Polygon":
            for ring in (part.exterior, *part.interiors):
                points = shapely.get_coordinates(ring)[:-1]
                # The area lies on the left of its rings; backwards, what is not of it.
                pieces += _strip(points if distance_mm > 0 else points[::-1], abs(distance_mm), turns=True)
    strip = shapely.union_all(pieces)
    return area.union(strip) if distance_mm > 0 else area.difference(strip)


def swept(points: Points, distance_mm: float, *, round_ends: bool = True) -> Geometry:
    """All points within a distance of a line; without round ends only those beside it."""
    import shapely

    return shapely.union_all(_strip(np.vstack([points, points[-2:0:-1]]), distance_mm, turns=round_ends))


def _strip(points: Points, distance_mm: float, *, turns: bool) -> list[Geometry]:
    """Rectangles and wedges on the right of a closed line; without `turns` none where it goes straight back."""
    import shapely

    points = points[np.hypot(*(points - np.roll(points, 1, axis=0)).T) > 0]
    along = np.roll(points, -1, axis=0) - points
    along /= np.hypot(*along.T)[:, None]
    right = distance_mm * np.column_stack([along[:, 1], -along[:, 0]])
    following = np.roll(points, -1, axis=0)
    rectangles = shapely.polygons(np.stack([points, following, following + right, points + right], axis=1))
    # At the end of each edge the strip opens where the line turns to the left.
    after, right_after = np.roll(along, -1, axis=0), np.roll(right, -1, axis=0)
    cross = along[:, 0] * after[:, 1] - along[:, 1] * after[:, 0]
    dot = np.sum(along * after, axis=1)
    is_back = (dot < 0) & (np.abs(cross) < 1e-9)
    angles = np.where(is_back, math.pi if turns else 0.0, np.arctan2(cross, dot))
    step = chord_angle_rad(distance_mm)
    single = (angles > 0) & (angles <= step)
    corners = np.stack([following, following + right, following + right_after], axis=1)
    pieces = [*rectangles, *shapely.polygons(corners[single])]
    for index in np.flatnonzero(angles > step):
        turn = np.linspace(0, angles[index], math.ceil(angles[index] / step) + 1)
        x, y = right[index]
        arc = np.column_stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)])
        arc[-1] = right_after[index]
        pieces.append(shapely.Polygon(np.vstack([following[index], following[index] + arc])))
    return pieces
