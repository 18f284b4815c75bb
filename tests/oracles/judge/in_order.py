"""Where a motion is on a programmed path, passed in order: deviation, and speed beside the programmed feed.

A path that runs over itself has several places near a point; the one meant is the one that the motion has come to. A
motion that stays within ε of the path in order is one for which places that never go back can be chosen, one per
point, each within ε: the earliest such place is always as good as any later one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .plant import path_polyline
from .player import starts
from .records import Move

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Way:
    """A path as points, the length up to each, and the pieces between."""

    points: Vector
    length: Vector
    along: Vector  #: unit vector of each piece
    size: Vector  #: its length

    @staticmethod
    def of(moves: Sequence[Move]) -> Way:
        points = path_polyline(moves)
        steps = np.diff(points, axis=0)
        size = np.maximum(np.linalg.norm(steps, axis=1), 1e-15)
        return Way(points, np.concatenate([[0.0], np.cumsum(size)]), steps / size[:, None], size)

    def earliest(self, point: Vector, from_s: float, within: float, ahead: float) -> float | None:
        """The first place at or behind `from_s` within a distance of a point; None within `ahead` of it."""
        first = min(max(0, int(self.length.searchsorted(from_s, side="right")) - 1), len(self.size) - 1)
        last = min(len(self.size), int(self.length.searchsorted(from_s + ahead)) + 1)
        # A few pieces are nearly always enough.
        for end in (min(first + 8, last), last):
            offset, size = point - self.points[first:end], self.size[first:end]
            foot = np.einsum("ij,ij->i", offset, self.along[first:end])
            off2 = np.einsum("ij,ij->i", offset, offset) - foot * foot
            half = np.sqrt(np.maximum(within * within - off2, 0.0))
            low = np.minimum(np.maximum(foot - half, 0.0), size)
            low[0] = max(low[0], min(from_s - self.length[first], size[0]))
            hits = (off2 + (foot - low) ** 2 <= (within + 1e-9) ** 2).nonzero()[0]
            if len(hits):
                return float(self.length[first + hits[0]] + low[hits[0]])
        return None


def places(points: Vector, way: Way, within: float, ahead: float) -> Vector | None:
    """Places (n,) that never go back, each within a distance of its point; None if there are none."""
    out, s = np.zeros(len(points)), 0.0
    for k, point in enumerate(points):
        found = way.earliest(point, s, within, ahead)
        if found is None:
            return None
        out[k] = s = max(s, found)
    return out


def deviation_um(points: Vector, way: Way, at_least_um: float, *, ahead: float, steps: int = 18) -> float:
    """The least ε with which the points follow the path in order, µm, to 1 %.

    `at_least_um`: the largest distance to the nearest place, in order or not. `ahead`: the longest way that one point
    may be from the one before it.
    """
    low, high = at_least_um * 1e-3 + 1e-5, at_least_um * 1e-3 + 1e-5
    for _ in range(steps):
        if places(points, way, high, ahead) is not None:
            break
        low, high = high, 2.0 * high
    while high > 1.01 * low:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if places(points, way, middle, ahead) is not None else (middle, high)
    return 1e3 * high


def missed_um(points: Vector, way: Way, within_um: float, *, ahead: float) -> float:
    """By how much the motion passes the corners of the path while it goes by, µm. `within_um`: its deviation."""
    s = places(points, way, within_um * 1e-3, ahead)
    if s is None:
        return math.inf
    reach = 6e-3 * within_um + float(np.diff(s).max(initial=0.0))
    first = np.searchsorted(s, way.length - reach)
    last = np.searchsorted(s, way.length + reach, side="right")
    return 1e3 * max(
        float(np.linalg.norm(points[a : max(b, a + 1)] - corner, axis=1).min(initial=math.inf))
        for corner, a, b in zip(way.points, np.minimum(first, len(points) - 1), last, strict=True)
    )


@dataclass(frozen=True)
class Haste:
    """Largest speed over programmed feed, where (line of the program), and both in mm/min."""

    ratio: float
    line: int
    speed: float
    feed: float


def haste(
    points: Vector,
    s: Vector,
    moves: Sequence[Move],
    period_s: float,
    *,
    window: int,
    slack_mm: float,
    increment_mm: float,
) -> Haste:
    """The motion's speed over `window` periods beside the feed that the program says there.

    The way of a window is counted less two increments, by which the rounding of both its ends may lengthen it. Of the
    feeds that the window passes the highest counts. `s`: places, good to `slack_mm`.
    """
    worst = Haste(0.0, moves[0].line, 0.0, moves[0].feed)
    if len(points) <= window:
        return worst
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    way = np.maximum(travelled[window:] - travelled[:-window] - 2.0 * increment_mm, 0.0)
    speed = way / (window * period_s)
    feeds = np.array([move.feed / 60.0 for move in moves])
    ends = np.cumsum([move.length for move in moves])
    begins = starts(moves)
    first = np.minimum(np.searchsorted(ends, s[:-window] - slack_mm), len(moves) - 1)
    last = np.minimum(np.searchsorted(ends, s[window:] + slack_mm), len(moves) - 1)
    for k in np.argsort(-speed):
        if speed[k] <= worst.ratio * feeds.min():
            break
        a, b = int(first[k]), int(last[k])
        # Short moves that lie where the motion is: which of them it is on is not for a point to say.
        while a > 0 and np.linalg.norm(points[k] - begins[a]) <= 2.0 * slack_mm:
            a -= 1
        while b + 1 < len(moves) and np.linalg.norm(points[k + window] - begins[b + 1]) <= 2.0 * slack_mm:
            b += 1
        allowed = a + int(np.argmax(feeds[a : b + 1]))
        if speed[k] > worst.ratio * feeds[allowed]:
            worst = Haste(speed[k] / feeds[allowed], moves[allowed].line, 60.0 * speed[k], 60.0 * feeds[allowed])
    return worst
