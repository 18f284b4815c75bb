"""Shapes of a stock file: its polygons, and the layer left by roughing."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Geometry, MultiPolygon, Polygon as Area, STRtree
from shapely.ops import substring

from shapegcode import _core
from shapegcode.cutting.stock import Allowance, Polygon, Stock, StockPiece
from shapegcode.errors import StockError
from shapegcode.io.units import FloatArray as Points
from shapegcode.settings.keys import toml

_SAME_MM = 2e-3  # points of a program nearer than this coincide
_CLOSED_RATIO = 0.5  # least length of closed contours in a sequence that has some; the rest is lead-in and lead-out
_SAGITTA_MM = 4e-5  # largest deviation of chords from their arcs
_SNAP = 2e-3  # GEOS merges corners nearer than this, relative to the distance; tolerance of corners
_ROUNDS = 3
_TURN_RAD = 0.1  # least turn at a corner; between two chords of an arc it is smaller


def shaped_pieces(stock: Stock, paths: Sequence[_core.Path], tool_radius_mm: float) -> list[StockPiece]:
    """The prisms of a stock over polygons, or of the layer left by roughing."""
    if stock.allowance is not None:
        return _pieces(_Allowance(stock, stock.allowance, tool_radius_mm).area(paths), stock.allowance.z_mm)
    solid, key = (stock, "polygon") if stock.program is None else (stock.program.on, "program.on.polygon")
    assert solid.polygon is not None, "without a box the solid has a polygon"
    return _polygon(stock, solid.polygon, key)


def _polygon(stock: Stock, polygon: Polygon, key: str) -> list[StockPiece]:
    names = ["points_mm", *(f"holes_mm.{number}" for number in range(1, len(polygon.holes_mm) + 1))]
    outline, *holes = areas = [shapely.Polygon(ring) for ring in (polygon.points_mm, *polygon.holes_mm)]
    for name, area in zip(names, areas, strict=True):
        if not area.is_valid or area.area == 0:
            raise stock.error(f"{key}.{name}", "", f"must enclose an area: {shapely.is_valid_reason(area)}")
    pieces = _pieces(outline.difference(shapely.union_all(holes)), polygon.z_mm)
    if not pieces:
        raise stock.error(f"{key}.holes_mm", "", "must not remove the whole polygon")
    return pieces


def _pieces(area: Area | MultiPolygon, z_mm: tuple[float, float]) -> list[StockPiece]:
    pieces = []
    for part in shapely.get_parts(area):
        if part.geom_type != "Polygon" or part.area < _SAME_MM * _SAME_MM:
            continue  # contact of two shapes, apart from rounding
        ordered = shapely.orient_polygons(part)
        rings = (ordered.exterior, *ordered.interiors)
        pieces.append(StockPiece(tuple(np.asarray(ring.coords)[:-1] for ring in rings), *z_mm))
    return pieces


class _Allowance:
    """Builds the area left by roughing (Kim and Ko, 2001, paper 001): part plus layer, with the corners of roughing."""

    def __init__(self, stock: Stock, allowance: Allowance, radius_mm: float) -> None:
        self._stock, self._keys, self._radius = stock, allowance, radius_mm
        corner = allowance.corner_radius_mm
        if corner < radius_mm * (1 - 1e-9):
            why = f"tool larger than the corner: must not be below the tool's radius, {radius_mm:g} mm"
            raise self._error("corner_radius_mm", why)
        self._reach = radius_mm + allowance.width_mm
        self._rough = allowance.allowance_mm + corner

    def area(self, paths: Sequence[_core.Path]) -> Area | MultiPolygon:
        keys = self._keys
        walls, swept = [], []
        for points in self._runs(paths):
            loops, rest = _loops(_with_touched(points))
            closed, whole = sum(shapely.LinearRing(loop).length for loop in loops), shapely.LineString(points).length
            if loops and closed < _CLOSED_RATIO * whole:
                why = f"only {closed:.4g} of {whole:.4g} mm of a sequence of cutting moves are closed"
                raise self._error("wall", f"{why}: is that the wall? Describe the stock as [polygon]")
            for wall, gone in map(self._closed, loops) if loops else [self._open(rest)]:
                walls.append(wall)
                swept.append(gone)
        if not walls:
            raise self._error("z_mm", "no cutting move of the program is below the top")
        part = shapely.union_all(walls).difference(shapely.union_all(swept))
        if part.is_empty:
            raise self._error("wall", "the tool removes everything behind the walls: wrong side?")
        # Layer left by roughing with corner_radius_mm, whose path is offset by allowance plus radius from the part.
        return grown(grown(part, self._rough), -keys.corner_radius_mm)

    def _error(self, key: str, limit: str) -> StockError:
        return self._stock.error(f"allowance.{key}", toml(getattr(self._keys, key)), limit)

    def _runs(self, paths: Sequence[_core.Path]) -> Iterator[Points]:
        top = self._keys.z_mm[1] - 1e-9
        for path in paths:
            radius = max((path[index].radius_mm for index in range(len(path))), default=0.0)
            points = path.polyline(chord_angle_rad(radius + self._reach + self._rough))
            below = np.concatenate([[False], points[:, 2] < top, [False]])
            edges = np.flatnonzero(below[1:] != below[:-1])
            for first, last in zip(edges[::2], edges[1::2], strict=True):
                plane = points[first:last, :2]
                moved = np.hypot(*np.diff(plane, axis=0).T) > 1e-9
                plane = plane[np.concatenate([[True], moved])]
                if len(plane) > 1:
                    yield plane

    def _closed(self, loop: Points) -> tuple[Area, Area]:
        """The part behind the wall of a closed contour, and the removed area in front of it."""
        ring = shapely.Polygon(loop)
        if not ring.is_valid:
            reason = shapely.is_valid_reason(ring)
            raise self._error("wall", f"the closed contour crosses itself ({reason}): describe the stock as [polygon]")
        sweep = swept(np.vstack([loop, loop[:1]]), self._radius)
        if ring.exterior.is_ccw == (self._keys.wall == "left"):
            part = ring.difference(sweep)
            if part.is_empty:
                raise self._error("wall", "the tool removes everything inside the closed contour: wrong side?")
            return part.difference(grown(part, -self._keys.width_mm)), sweep
        pocket = ring.union(sweep)
        # GEOS' fast offset, with errors of some micrometres, is sufficient here.
        if pocket.buffer(-self._rough).is_empty:
            room = 2 * shapely.maximum_inscribed_circle(pocket, tolerance=1e-3).length
            why = "roughing tool larger than the pocket: with allowance_mm on both sides it needs "
            raise self._error("corner_radius_mm", f"{why}{2 * self._rough:g} mm, the pocket is {room:.4g} mm wide")
        return grown(pocket, self._keys.width_mm), pocket

    def _open(self, points: Points) -> tuple[Area | MultiPolygon, Area]:
        """The part behind the wall of an open contour, and the area removed by the tool."""
        wall = shapely.LineString(points)
        start, end = self._keys.lead_in_mm, wall.length - self._keys.lead_out_mm
        if end - start <= _SAME_MM:
            why = f"no wall remains between lead-in and lead-out of a sequence {wall.length:g} mm long"
            raise self._error("lead_in_mm", why)
        points = np.asarray(substring(wall, start, end).coords)
        # Extend the wall straight beyond its ends, as far as the tool reaches.
        straight = _extended(points, 2 * self._radius + self._rough)
        line = shapely.LineString(straight)
        if not line.is_simple:
            why = "the path crosses itself or the straight continuation of its ends"
            raise self._error("wall", f"{why}: describe the stock as [polygon]")
        band = swept(straight, self._reach, round_ends=False)
        cut = shapely.LineString(_extended(straight, _SAME_MM))
        faces = shapely.get_parts(shapely.polygonize([shapely.union_all([band.boundary, cut])]))
        return shapely.union_all(self._behind(faces, straight)), swept(straight, self._radius)

    def _behind(self, faces: NDArray[np.object_], points: Points) -> list[Area]:
        along = np.diff(points, axis=0)
        to_left = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
        to_wall = to_left if self._keys.wall == "left" else -to_left
        middle = 0.5 * (points[:-1] + points[1:])
        behind = []
        for face in faces:
            at_wall, at_free = (shapely.contains_xy(face, middle + side * 1e-4 * to_wall).any() for side in (1, -1))
            if at_wall and at_free:
                raise self._error("wall", "both sides of the path are connected: describe the stock as [polygon]")
            if at_wall:
                behind.append(face)
        return behind


def _extended(points: Points, length_mm: float) -> Points:
    first, last = points[0] - points[1], points[-1] - points[-2]
    before = points[0] + first * (length_mm / np.hypot(*first))
    after = points[-1] + last * (length_mm / np.hypot(*last))
    return np.vstack([before, points, after])


def _with_touched(points: Points) -> Points:
    """Split the segments of a line at its other points that lie on them, such as where its end overlaps its start."""
    pieces = shapely.linestrings(np.stack([points[:-1], points[1:]], axis=1))
    touching, touched = shapely.STRtree(pieces).query(shapely.points(points), predicate="dwithin", distance=_SAME_MM)
    inside = [
        (piece, shapely.line_locate_point(pieces[piece], shapely.Point(points[point])), point)
        for point, piece in zip(touching, touched, strict=True)
        if point not in (piece, piece + 1)
        and min(np.hypot(*(points[point] - points[piece])), np.hypot(*(points[point] - points[piece + 1]))) > _SAME_MM
    ]
    inside.sort()
    return np.insert(points, [piece + 1 for piece, _, _ in inside], points[[point for _, _, point in inside]], axis=0)


def _loops(points: Points) -> tuple[list[Points], Points]:
    """Closed contours in a line, each with an area, and the rest of the line."""
    loops: list[Points] = []
    line: list[int] = []
    seen: dict[tuple[int, int], int] = {}

    def cell(point: Points) -> tuple[int, int]:
        return (math.floor(point[0] / _SAME_MM), math.floor(point[1] / _SAME_MM))

    for index, point in enumerate(points):
        column, row = cell(point)
        near = [seen.get((column + i, row + j), -1) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        found = [at for at in near if at >= 0 and np.hypot(*(points[line[at]] - point)) < _SAME_MM]
        # Neighbours on the line may be close without closing a contour.
        closing = min(found, default=-1)
        if closing >= 0 and len(line) - closing >= 3:
            loop = points[line[closing:]]
            if shapely.Polygon(loop).area > _SAME_MM * _SAME_MM:
                loops.append(loop)
                for dropped in line[closing + 1 :]:
                    seen.pop(cell(points[dropped]), None)
                del line[closing + 1 :]
                continue
        seen[column, row] = len(line)
        line.append(index)
    return loops, points[line]


def chord_angle_rad(radius_mm: float) -> float:
    """Angle of a chord that deviates from its arc by 0.04 µm; at most about 83 degrees."""
    return 2 * math.acos(1 - _SAGITTA_MM / max(radius_mm, 4 * _SAGITTA_MM))


def grown(area: Geometry, distance_mm: float) -> Geometry:
    """Offset an area outwards by a distance; below 0: inwards."""
    if distance_mm == 0:
        return area
    return _placed(area.buffer(distance_mm, quad_segs=_quarter(distance_mm)), area.boundary, abs(distance_mm))


def swept(points: Points, distance_mm: float, *, round_ends: bool = True) -> Geometry:
    """All points within a distance of a line; without round ends only perpendicular to it."""
    line = shapely.LineString(points)
    caps = "round" if round_ends else "flat"
    return _placed(line.buffer(distance_mm, quad_segs=_quarter(distance_mm), cap_style=caps), line, distance_mm)


def _quarter(distance_mm: float) -> int:
    return math.ceil(0.5 * math.pi / chord_angle_rad(abs(distance_mm)))


def _placed(shape: Geometry, source: Geometry, distance_mm: float) -> Geometry:
    """Move the corners of an offset shape to the exact distance from the original line."""
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
        # Nearer points are of a flat end; exact points need no move.
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
    """Indices of the corners at which an outline turns by more than between two chords of an arc."""
    begin, turns = 0, []
    for ring in shapely.get_rings(shape):
        count = shapely.get_num_coordinates(ring)
        points = corners[begin : begin + count - 1]
        along = np.roll(points, -1, axis=0) - points
        before = np.roll(along, 1, axis=0)
        cross = before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0]
        angle = np.abs(np.arctan2(cross, np.sum(before * along, axis=1)))
        found = begin + np.flatnonzero(angle > _TURN_RAD)
        # The first corner of a ring is repeated at its end.
        turns += [found, found[found == begin] + count - 1]
        begin += count
    return np.concatenate(turns)


def _meeting(corner: Points, pieces: NDArray[np.object_], tree: STRtree, distance_mm: float) -> Points:
    """Move a corner until it has this distance from both adjacent lines; unchanged with only one line."""
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
