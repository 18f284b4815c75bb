"""The edge that a test cut needs, the path of the tool that mills it, and the edge that this path really leaves.

Heights count from the wall of the measuring pass, outwards; the tool lies beyond the edge, its axis at least its radius
away from every point that must stay.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode.errors import ArgumentError

Array = npt.NDArray[np.float64]

_GRID_MM = 0.004
_CHORD_MM = 1e-4
_MOVED = 9  # increments


@dataclass(frozen=True, eq=False)
class Edge:
    """A line of points, ascending in X; straight between them, and beyond the ends on as at the ends."""

    x_mm: Array  # (n,) at least 2
    height_mm: Array  # (n,)

    def at(self, x_mm: Array) -> Array:
        """Height at each X."""
        x, y = self.x_mm, self.height_mm
        inside = np.interp(x_mm, x, y)
        first, last = ((y[k + 1] - y[k]) / (x[k + 1] - x[k]) for k in (0, -2))
        return np.asarray(
            inside
            + np.where(x_mm < x[0], (x_mm - x[0]) * first, 0.0)
            + np.where(x_mm > x[-1], (x_mm - x[-1]) * last, 0.0)
        )


def unrolled_edge(s_mm: Array, radial_depth_mm: Array, radius_mm: float, stock_mm: float, at_mm: float) -> Edge:
    """The edge on which a straight pass meets the radial depth of another path at each distance.

    Where the axis stands at X, the front of the tool comes out of the edge at X + sqrt(R² - (R - depth)²), as high
    above the wall as the depth: these points are the edge.
    """
    depth = radial_depth_mm
    if depth.max() >= radius_mm:
        raise ArgumentError(
            f"the radial depth reaches {depth.max():.3f} mm, the tool's radius is {radius_mm:g} mm: such a corner "
            "cannot be unrolled on a straight line"
        )
    x = s_mm + at_mm + np.sqrt(radius_mm**2 - (radius_mm - depth) ** 2)
    back = np.flatnonzero(np.diff(x) <= 0.0)
    if back.size:
        raise ArgumentError(
            f"at {s_mm[back[0]]:.2f} mm of the path the radial depth falls from {depth[back[0]]:.3f} mm faster than "
            f"on a straight pass of a tool of {2 * radius_mm:g} mm: such a corner cannot be unrolled on a straight line"
        )
    ends = np.array([min(0.0, x[0] - 1.0), max(stock_mm, x[-1] + 1.0)])
    return Edge(np.concatenate([ends[:1], x, ends[1:]]), np.concatenate([depth[:1], depth, depth[-1:]]))


def tool_path(edge: Edge, radius_mm: float, start_mm: float, end_mm: float) -> Edge:
    """The line of the tool's axis that mills an edge without cutting into it, within 0.1 µm of what is possible."""
    return reduced(_envelope(edge, radius_mm, start_mm, end_mm, 1.0))


def left_edge(path: Edge, radius_mm: float, start_mm: float, end_mm: float) -> Edge:
    """The edge that a tool leaves whose axis follows a path; the counterpart of :func:`tool_path`."""
    return reduced(_envelope(path, radius_mm, start_mm, end_mm, -1.0))


def _envelope(line: Edge, radius: float, start: float, end: float, side: float) -> Edge:
    """Outermost height over X of circles about the points of a line; *side* 1: outwards, -1: inwards."""
    if len(line.x_mm) == 2:
        slope = float(np.diff(line.height_mm)[0] / np.diff(line.x_mm)[0])
        x = np.array([start, end])
        return Edge(x, line.at(x) + side * radius * math.sqrt(1.0 + slope * slope))
    count = int(np.ceil((end - start) / _GRID_MM)) + 1
    reach = int(np.ceil(radius / _GRID_MM))
    x = start + _GRID_MM * np.arange(-reach, count + reach, dtype=np.float64)
    heights = side * line.at(x)
    best = np.full(count, -np.inf)
    for offset in range(-reach, reach + 1):
        away = abs(offset) * _GRID_MM
        if away <= radius:
            part = heights[reach + offset : reach + offset + count]
            np.maximum(best, part + np.sqrt(radius * radius - away * away), out=best)
    return Edge(x[reach : reach + count], side * best)


def on_increments(line: Edge, step_mm: float) -> Edge:
    """The points of a line moved along it, by a few increments, to where both coordinates are increments, or nearly."""
    tried = step_mm * (np.round(line.x_mm / step_mm)[:, None] + np.arange(-_MOVED, _MOVED + 1))
    tried[[0, -1]] = step_mm * np.round(line.x_mm[[0, -1]] / step_mm)[:, None]
    # Neighbours stay apart.
    gaps = 0.4 * np.diff(line.x_mm)
    low = np.concatenate([[-np.inf], line.x_mm[1:] - gaps])
    high = np.concatenate([line.x_mm[:-1] + gaps, [np.inf]])
    heights = np.stack([line.at(column) for column in tried.T], axis=1)
    off = np.abs(heights - step_mm * np.round(heights / step_mm))
    off[(tried < low[:, None]) | (tried > high[:, None])] = np.inf
    off[[0, -1], _MOVED] = 0.0
    best = np.argmin(off, axis=1)
    rows = np.arange(len(best))
    return Edge(tried[rows, best], step_mm * np.round(heights[rows, best] / step_mm))


def reduced(line: Edge, chord_mm: float = _CHORD_MM) -> Edge:
    """As few points of a line as keep within a distance of all of them (Douglas and Peucker)."""
    x, y = line.x_mm, line.height_mm
    keep = np.zeros(len(x), dtype=bool)
    keep[[0, -1]] = True
    open_ = [(0, len(x) - 1)]
    while open_:
        low, high = open_.pop()
        if high - low < 2:
            continue
        way, rise = x[high] - x[low], y[high] - y[low]
        inner = slice(low + 1, high)
        away = np.abs((y[inner] - y[low]) * way - (x[inner] - x[low]) * rise) / np.hypot(way, rise)
        worst = int(np.argmax(away))
        if away[worst] > chord_mm:
            middle = low + 1 + worst
            keep[middle] = True
            open_ += [(low, middle), (middle, high)]
    return Edge(x[keep], y[keep])
