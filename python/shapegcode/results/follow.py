"""Where on a path are samples that follow it: for drawing; figures come from the core's metrology."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from shapegcode import _core

FloatArray = npt.NDArray[np.float64]

# Pieces of the programmed path among which the nearest one is looked for.
_PATH_PIECES = 20_000
_SHORTEST_PIECE_MM = 0.01
# A millimetre between two places along the path counts as this many mm between a sample and the path.
_PROGRESS_WEIGHT = 0.03
_SEGMENTS_ASKED = 3  # on either side of the nearest vertex
_SAGITTA_MM = 1e-5

COARSE_STEP_RAD = 0.05
"""Of an arc between two points of a polyline that is looked at from afar."""


def follow(
    command_mm: FloatArray, points_mm: FloatArray, polyline_mm: FloatArray, *, complete: bool
) -> tuple[FloatArray, FloatArray]:
    """Where on a polyline are samples that follow it?

    Where the polyline passes a place twice, the distance that the command has gone decides.
    """
    vertices = _refine(polyline_mm)
    lengths = np.linalg.norm(np.diff(vertices, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    steps = np.linalg.norm(np.diff(command_mm, axis=0), axis=1)
    gone = np.concatenate([[0.0], np.cumsum(steps)])
    if complete and gone[-1] > 0:
        gone *= along[-1] / gone[-1]
    return _feet(points_mm, vertices, gone, _PROGRESS_WEIGHT)


def _feet(points: FloatArray, vertices: FloatArray, gone: FloatArray, weight: float) -> tuple[FloatArray, FloatArray]:
    """Nearest points of the polyline, as distances along it and places."""
    from scipy.spatial import KDTree

    if len(vertices) < 2:
        return np.zeros(len(points)), np.broadcast_to(vertices[0], points.shape).copy()
    lengths = np.linalg.norm(np.diff(vertices, axis=0), axis=1)
    distance = np.concatenate([[0.0], np.cumsum(lengths)])
    tree = KDTree(np.column_stack([vertices, weight * distance]))
    nearest = tree.query(np.column_stack([points, weight * gone]), workers=-1)[1]
    feet, best = np.empty_like(points), np.full(len(points), np.inf)
    progress = np.zeros(len(points))
    # The foot lies on a segment near the nearest vertex.
    for shift in range(-_SEGMENTS_ASKED, _SEGMENTS_ASKED):
        first = np.clip(nearest + shift, 0, len(vertices) - 2)
        start, chord = vertices[first], vertices[first + 1] - vertices[first]
        dot = np.einsum("ij,ij->i", points - start, chord)
        share = np.clip(dot / np.einsum("ij,ij->i", chord, chord), 0, 1)
        candidate = start + share[:, None] * chord
        distance2 = np.einsum("ij,ij->i", points - candidate, points - candidate)
        closer = distance2 < best
        feet[closer], best[closer] = candidate[closer], distance2[closer]
        progress[closer] = (distance[first] + share * lengths[first])[closer]
    return progress, feet


def _refine(polyline: FloatArray) -> FloatArray:
    """The polyline without repeated points, its long segments split, so that vertices stand for the path."""
    lengths = np.linalg.norm(np.diff(polyline, axis=0), axis=1)
    polyline = polyline[np.concatenate([[True], lengths > 0])]
    lengths = lengths[lengths > 0]
    if not len(lengths):
        return polyline
    pieces = np.ceil(lengths / max(lengths.sum() / _PATH_PIECES, _SHORTEST_PIECE_MM)).astype(np.intp)
    segment = np.repeat(np.arange(len(pieces)), pieces)
    share = (np.arange(len(segment)) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[segment]
    split = polyline[segment] + share[:, None] * (polyline[segment + 1] - polyline[segment])
    return np.concatenate([split, polyline[-1:]])


def piece_of(polyline: FloatArray, begin_mm: float, end_mm: float) -> FloatArray:
    """What lies between two distances along a polyline."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(polyline, axis=0), axis=1))])
    inside = (along > begin_mm) & (along < end_mm)
    ends = [[np.interp(s, along, polyline[:, axis]) for axis in range(3)] for s in (begin_mm, end_mm)]
    return np.concatenate([ends[:1], polyline[inside], ends[1:]])


def polyline_of(path: _core.Path) -> FloatArray:
    """The path as a polyline that is nowhere further than a hundredth of a micrometre from its arcs."""
    if path.largest_sweep_rad == 0.0:
        return path.polyline()
    parts = [path.start_mm[None, :]]
    for index in range(len(path)):
        segment = path[index]
        if segment.kind == _core.SegmentKind.arc:
            step = math.sqrt(8.0 * _SAGITTA_MM / segment.radius_mm)
            parts.append(_core.Path([segment]).polyline(min(step, COARSE_STEP_RAD))[1:])
        else:
            parts.append(segment.end_mm[None, :])
    return np.concatenate(parts)
