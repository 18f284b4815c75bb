"""What the tool meets along a measuring pass, exact for the straight pieces of the edge; geometry of this project."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode.testcut.cut import CutTool, MeasuringPass, TestCut

__all__ = ["Engagement", "engagement", "fully_engaged", "straight_engagement"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Engagement:
    """What the tool meets where its axis is at each X; azimuths as in ``_core.EngagedArc``.

    Attributes:
        from_rad: first azimuth in material, from the direction of feed, positive to its left.
        to_rad: last one; equal to `from_rad` where nothing is met.
        radial_depth_mm: depth of the outermost point in material below the edge: distance from it to the wall.
    """

    from_rad: Array
    to_rad: Array
    radial_depth_mm: Array


def engagement(tool: CutTool, measuring: MeasuringPass, x_mm: Array, *, up: bool) -> Engagement:
    """Engagement of a pass where the tool's axis is at each X, exact for the straight pieces of its edge."""
    radius = tool.radius_mm
    edge_x, edge_y = np.array(measuring.edge_x_mm), np.array(measuring.edge_height_mm)
    x = np.asarray(x_mm, dtype=np.float64)
    # Along the tool: how far a point of its front lies before the axis.
    begin = np.clip(edge_x[0] - x, 0.0, radius)
    end = _crossing(x, begin, edge_x, edge_y, radius)
    end = np.maximum(np.minimum(end, edge_x[-1] - x), begin)
    first, last = -np.arccos(begin / radius), -np.arccos(np.clip(end / radius, 0.0, 1.0))
    depth = np.where(end > begin, radius - np.sqrt(np.maximum(radius**2 - end**2, 0.0)), 0.0)
    if up:
        first, last = -last, -first
    return Engagement(first, last, depth)


def _crossing(x: Array, begin: Array, edge_x: Array, edge_y: Array, radius: float) -> Array:
    """How far before the axis the front of the tool first comes out of the edge; `begin` where it is not in it."""
    found = np.full(len(x), radius)
    open_ = np.ones(len(x), dtype=bool)
    at_begin = np.interp(x + begin, edge_x, edge_y)
    outside = at_begin <= radius - np.sqrt(np.maximum(radius**2 - begin**2, 0.0))
    found[outside] = begin[outside]
    open_ &= ~outside
    slopes = np.diff(edge_y) / np.diff(edge_x)
    first = np.clip(np.searchsorted(edge_x, x + begin, side="right") - 1, 0, len(slopes) - 1)
    for step in range(len(slopes)):
        piece = first + step
        active = np.flatnonzero(open_ & (piece < len(slopes)))
        active = active[edge_x[np.minimum(piece[active], len(slopes) - 1)] - x[active] < radius]
        if active.size == 0:
            break
        k = piece[active]
        m = slopes[k]
        # The edge over the distance u before the axis: height c + m u; the tool's front: u^2 + (y - R)^2 = R^2.
        c = edge_y[k] + m * (x[active] - edge_x[k]) - radius
        inner = (m * c) ** 2 - (1.0 + m * m) * (c * c - radius * radius)
        u = (-m * c + np.sqrt(np.maximum(inner, 0.0))) / (1.0 + m * m)
        inside = (inner >= 0.0) & (u <= edge_x[k + 1] - x[active] + 1e-12)
        found[active[inside]] = u[inside]
        open_[active[inside]] = False
    return found


def straight_engagement(tool: CutTool, radial_depth_mm: Array, *, up: bool) -> Engagement:
    """Engagement of straight cuts of known radial depth."""
    last = -np.arcsin(1.0 - radial_depth_mm / tool.radius_mm)
    first = np.full(len(last), -0.5 * math.pi)
    return Engagement(-last, -first, radial_depth_mm) if up else Engagement(first, last, radial_depth_mm)


def fully_engaged(cut: TestCut, measuring: MeasuringPass, x_mm: Array, margin_mm: float = 0.0) -> npt.NDArray[np.bool_]:
    """Where the tool is over the stock with all of its engagement, and by a margin within its ends."""
    met = engagement(cut.tool, measuring, x_mm, up=cut.up)
    reach = cut.tool.radius_mm * np.maximum(np.cos(met.to_rad), np.cos(met.from_rad))
    # The engagement ends at the end of the stock: there it is not whole, by whatever little.
    low, high = measuring.edge_x_mm[0] + margin_mm, measuring.edge_x_mm[-1] - max(margin_mm, 1e-6)
    return np.asarray((x_mm >= low) & (x_mm + reach <= high) & (met.to_rad > met.from_rad))
