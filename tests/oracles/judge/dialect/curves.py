"""Offset curves and where they cross, by sampling and root finding: no formula for any kind of corner."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from .items import Item
from .tape import Alarm

Vector = npt.NDArray[np.float64]


def left_of(direction: Vector) -> Vector:
    return np.array([-direction[1], direction[0]])


class OffsetCurve:
    """An item shifted by `distance` to the left of its direction (negative: right), as a curve that goes on beyond
    both ends (a line straight on, an arc around its circle)."""

    def __init__(self, item: Item, distance: float) -> None:
        self.item, self.distance = item, distance
        self.is_arc = item.kind == "arc"
        if self.is_arc:
            assert item.centre is not None
            self.centre = item.flat(item.centre)
            # Left of a counter-clockwise arc is towards its centre.
            self.radius = item.radius - distance * math.copysign(1.0, item.sweep)
            if self.radius <= 0.0:
                raise Alarm(item.line, f"arc of radius {item.radius:.4f} inside of the tool {abs(distance):.4f}", 41)
            start = item.flat(item.start) - self.centre
            self.start_angle = math.atan2(start[1], start[0])
        else:
            self.direction = item.tangent(False)
            self.origin = item.flat(item.start) + distance * left_of(self.direction)
            step = item.flat(item.end) - item.flat(item.start)
            self.length = float(np.hypot(*step))

    def point(self, u: float) -> Vector:
        """u = 0 at the start, 1 at the end."""
        if self.is_arc:
            angle = self.start_angle + u * self.item.sweep
            return self.centre + self.radius * np.array([math.cos(angle), math.sin(angle)])
        return np.asarray(self.origin + u * self.length * self.direction)

    def miss(self, p: Vector) -> float:
        """Signed distance of a point from the curve and its continuation."""
        if self.is_arc:
            return float(np.hypot(*(p - self.centre)) - self.radius)
        return float(left_of(self.direction) @ (p - self.origin))

    def span(self, reach: float) -> tuple[float, float]:
        """The range of u to search: a line with `reach` mm added at both ends, an arc once around its end."""
        if self.is_arc:
            turn = math.tau / abs(self.item.sweep)
            return 1.0 - 0.5 * turn, 1.0 + 0.5 * turn
        more = reach / self.length
        return -more, 1.0 + more

    def foot(self, p: Vector) -> Vector:
        """The point of the curve nearest to p."""
        if self.is_arc:
            out = p - self.centre
            return np.asarray(self.centre + self.radius * out / np.hypot(*out))
        return np.asarray(p - self.miss(p) * left_of(self.direction))


def crossings(a: OffsetCurve, b: OffsetCurve, reach: float, samples: int = 800) -> list[Vector]:
    """Every point in which the curve a meets b or its continuation."""
    first, last = a.span(reach)
    grid = np.linspace(first, last, samples)
    value = np.array([b.miss(a.point(u)) for u in grid])
    found = [
        a.point(float(brentq(lambda u: b.miss(a.point(u)), grid[k], grid[k + 1], xtol=1e-14)))
        for k in range(samples - 1)
        if value[k] * value[k + 1] < 0.0
    ]
    found += [a.point(u) for u, v in zip(grid, value, strict=True) if v == 0.0]
    return found


def nearest_crossing(a: Item, b: Item, distance: float) -> Vector | None:
    """Where the two offset curves meet, nearest to the corner; None if they do not."""
    corner = a.flat(a.end)
    curves = OffsetCurve(a, distance), OffsetCurve(b, distance)
    points = crossings(*curves, reach=4.0 * abs(distance) + 1.0)
    if not points:
        return None
    return min(points, key=lambda p: float(np.hypot(*(p - corner))))
