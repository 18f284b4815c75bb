"""The shortest time along a path under limits of speed, acceleration and jerk of every axis, by an interior point.

A path is q(p), p in [0, L], in n axes. The unknown is b = v², v = dp/dt, as cubic pieces with a continuous slope: with
a = b'/2 and s = b''/2 the acceleration of an axis is q'' b + q' a, its jerk √b (q''' b + 3 q'' a + q' s). In the first
and the last piece b grows from rest with the 4/3 power of the distance, as under constant jerk, and a cap on its factor
keeps every limit there.

The time ∫ dp/√b is convex in b, speeds and accelerations are linear. The jerk is held as |q''' b + 3 q'' a + q' s| <=
J/√b, whose right side is convex: its tangent at the last iterate lies below it, so what keeps the tangent keeps the
limit. A primal-dual interior point moves the tangent along with every Newton step; every iterate keeps the limits at
the points of control of each piece, five for speed and acceleration, three for the jerk. As the problem is not convex
there are several starts on a coarse grid; the best, and the next best if it is another profile, are solved again on
finer grids. (Over 150 random paths all starts came to the same time within 6e-4, nearly all within 2e-5.)
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded

Vector = npt.NDArray[np.float64]
Function = Callable[[Vector], Vector]

_INSIDE = 1e-7  # share of a piece by which its ends are moved inwards: q''' may jump at a node
_DENSE = np.array([_INSIDE, 0.25, 0.5, 0.75, 1.0 - _INSIDE])  # of speed and acceleration
# Lobatto's quadrature: it sees the ends of a piece too, at which b would fall to 0 unseen.
_QUADRATURE = 0.5 + 0.5 * np.array([-1.0, -math.sqrt(3 / 7), 0.0, math.sqrt(3 / 7), 1.0])
_QUADRATURE_WEIGHT = np.array([1 / 20, 49 / 180, 16 / 45, 49 / 180, 1 / 20])
_CLOSER = 0.3  # length of a coarse piece by the distance to the next break, on either side
_REST_JERK = 2.0 / 9.0  # jerk is this times (b / p^(4/3))^1.5 from rest


class Path(Protocol):
    """A path by p: derivatives, and where they (or the limits) jump."""

    @property
    def length(self) -> float:
        """Largest p."""

    @property
    def breaks(self) -> Vector:
        """Places at which the grid must have a node."""

    @property
    def scales(self) -> Vector:
        """Length over which the path changes at each break: the grid is about that fine there."""

    def derivatives(self, p: Vector) -> tuple[Vector, Vector, Vector]:
        """First, second and third derivative by p, a row for each p and a column for each axis."""


@dataclass(frozen=True)
class CallablePath:
    """A path of three functions, each with a row for each p."""

    length: float
    first: Function
    second: Function
    third: Function
    breaks: Vector = field(default_factory=lambda: np.zeros(0))
    scales: Vector = field(default_factory=lambda: np.zeros(0))

    def derivatives(self, p: Vector) -> tuple[Vector, Vector, Vector]:
        return self.first(p), self.second(p), self.third(p)


def sampled_path(p: Vector, first: Vector, second: Vector, third: Vector) -> CallablePath:
    """A path of derivatives on a grid, straight between its points."""

    def straight(table: Vector) -> Function:
        return lambda at: np.column_stack([np.interp(at, p, column) for column in table.T])

    return CallablePath(float(p[-1]), straight(first), straight(second), straight(third))


@dataclass(frozen=True)
class RoundedPolyline:
    """A polyline by its own arc length in X, Y, Z, whose jumps of direction are spread by a triangle over ±half-width.

    Corner i at p_i with the jump D_i of direction adds D_i w((p - p_i)/d_i)/d_i to q'', w(u) = 1 - |u|. Bumps may
    overlap each other and reach over the ends.
    """

    start: Vector
    direction: Vector  # of the first segment
    corners: Vector  # p_i
    jumps: Vector  # D_i, a row for each corner
    half_widths: Vector
    length: float

    @property
    def breaks(self) -> Vector:
        return np.concatenate((self.corners - self.half_widths, self.corners, self.corners + self.half_widths))

    @property
    def scales(self) -> Vector:
        return np.concatenate((self.half_widths, self.half_widths, self.half_widths))

    def _offsets(self, p: Vector) -> Vector:
        return (p[:, None] - self.corners) / self.half_widths

    def position(self, p: Vector) -> Vector:
        """Axes at each p."""
        travel = _ramp(self._offsets(p)) - _ramp(self._offsets(np.zeros(1)))
        found: Vector = self.start + p[:, None] * self.direction + (travel * self.half_widths) @ self.jumps
        return found

    def derivatives(self, p: Vector) -> tuple[Vector, Vector, Vector]:
        order = np.argsort(p, kind="stable")
        x = p[order]
        # The jumps passed altogether, then inside each rounding its own so far.
        begins = np.searchsorted(x, self.corners - self.half_widths, side="right")
        ends = np.searchsorted(x, self.corners + self.half_widths, side="left")
        passed = np.zeros((len(x) + 1, len(self.direction)))
        np.add.at(passed, ends, self.jumps)
        first = self.direction + np.cumsum(passed, axis=0)[:-1]
        second, third = np.zeros_like(first), np.zeros_like(first)
        for k, (begin, end) in enumerate(zip(begins, ends, strict=True)):
            d, jump = self.half_widths[k], self.jumps[k]
            u = ((x[begin:end] - self.corners[k]) / d)[:, None]
            first[begin:end] += (0.5 + u - 0.5 * u * np.abs(u)) * jump
            second[begin:end] += (1.0 - np.abs(u)) / d * jump
            third[begin:end] += np.where(u < 0.0, 1.0, -1.0) / d**2 * jump
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        return first[back], second[back], third[back]


def _ramp(u: Vector) -> Vector:
    """Integral of the share of the turn: 0 before the bump, u behind it."""
    c = np.clip(u, -1.0, 1.0)
    inside = np.maximum(c, 0.0) + (1.0 - np.abs(c)) ** 3 / 6.0
    return np.where(u > 1.0, u, inside)


def rounded_polyline(points: Vector, half_widths: Sequence[float] | Vector) -> RoundedPolyline:
    """The polyline through `points` (a row each; the first three columns are X, Y, Z) with rounded inner corners."""
    legs = np.diff(np.asarray(points, dtype=np.float64), axis=0)
    lengths = np.linalg.norm(legs[:, :3], axis=1)
    widths = np.asarray(half_widths, dtype=np.float64)
    if not np.all(lengths > 0.0):
        raise ValueError("a segment without length in X, Y, Z")
    if widths.shape != (len(legs) - 1,) or not np.all(widths > 0.0):
        raise ValueError("one half-width above 0 is needed for every inner corner")
    directions = legs / lengths[:, None]
    ends = np.cumsum(lengths)
    return RoundedPolyline(
        np.asarray(points[0], dtype=np.float64),
        directions[0],
        ends[:-1],
        np.diff(directions, axis=0),
        widths,
        float(ends[-1]),
    )


@dataclass(frozen=True)
class Limits:
    """Limits of each axis, of the speed along X, Y, Z (the first three axes) by p, and of b by p.

    `breaks`: where feed or cap jump.
    """

    velocity: Vector
    acceleration: Vector
    jerk: Vector
    feed: Function | None = None
    cap: Function | None = None
    breaks: Vector = field(default_factory=lambda: np.zeros(0))

    def largest_b(self, p: Vector, first: Vector) -> Vector:
        """What speed, feed and cap leave of b."""
        inverse = np.max(np.abs(first) / self.velocity, axis=1) ** 2
        if self.feed is not None:
            inverse = np.maximum(inverse, np.sum(first[:, :3] ** 2, axis=1) / self.feed(p) ** 2)
        if self.cap is not None:
            inverse = np.maximum(inverse, 1.0 / self.cap(p))
        found: Vector = 1.0 / np.maximum(inverse, 1e-30)
        return found


@dataclass(frozen=True)
class Ratios:
    """Largest share of each limit between the nodes; of the cap, as a speed."""

    velocity: float
    acceleration: float
    jerk: float
    feed: float
    cap: float

    @property
    def largest(self) -> float:
        """Largest of all."""
        return max(self.velocity, self.acceleration, self.jerk, self.feed, self.cap)


@dataclass(frozen=True)
class Profile:
    """Speed along a path: b at the nodes (0 and L among them), and half its slope."""

    p: Vector
    b: Vector
    a: Vector

    def at(self, p: Vector) -> tuple[Vector, Vector, Vector]:
        """b, a and s = b''/2 at each p; at 0 and L themselves s is the value 1e-12 L inside."""
        k = np.clip(np.searchsorted(self.p, p, side="right") - 1, 0, len(self.p) - 2)
        h = self.p[k + 1] - self.p[k]
        basis = _hermite((p - self.p[k]) / h, h)
        local = np.column_stack((self.b[k], self.a[k], self.b[k + 1], self.a[k + 1]))
        b, a, s = (np.einsum("ki,ki->k", part, local) for part in basis)
        for inside, sign, x, node in ((k == 0, 1.0, p, 1), (k == len(self.p) - 2, -1.0, self.p[-1] - p, -2)):
            away = np.maximum(x[inside], 1e-12 * self.p[-1])
            factor = self.b[node] / abs(self.p[node] - self.p[0 if node == 1 else -1]) ** (4.0 / 3.0)
            b[inside] = factor * away ** (4.0 / 3.0)
            a[inside] = sign * factor * away ** (1.0 / 3.0) * 2.0 / 3.0
            s[inside] = factor * away ** (-2.0 / 3.0) * _REST_JERK
        return b, a, s

    def node_times_s(self) -> Vector:
        """Instant at which each node is passed."""
        lower, h = self.p[1:-2], np.diff(self.p[1:-1])
        nodes, weights = np.polynomial.legendre.leggauss(8)
        b = self.at((lower[:, None] + 0.5 * (nodes + 1.0) * h[:, None]).ravel())[0].reshape(-1, 8)
        inner = 0.5 * h * (b**-0.5 @ weights)
        first = 3.0 * (self.p[1] - self.p[0]) / math.sqrt(self.b[1])
        last = 3.0 * (self.p[-1] - self.p[-2]) / math.sqrt(self.b[-2])
        return np.concatenate(([0.0], np.cumsum(np.concatenate(([first], inner, [last])))))

    @property
    def time_s(self) -> float:
        """Time over the whole path."""
        return float(self.node_times_s()[-1])

    def slowed(self, factor: float) -> Profile:
        """The same with b times `factor`."""
        return Profile(self.p, self.b * factor, self.a * factor)


@dataclass(frozen=True)
class TimeOptimal:
    """The fastest profile found."""

    time_s: float
    profile: Profile
    ratios: Ratios
    refinement_change: float  # of the time at the last finer grid or, if more, by what keeps the limits between nodes
    starts: int
    start_times_s: tuple[float, ...]  # on the coarse grid

    @property
    def p(self) -> Vector:
        """Nodes."""
        return self.profile.p

    @property
    def b(self) -> Vector:
        """(dp/dt)² at the nodes."""
        return self.profile.b


def _hermite(t: Vector, h: Vector) -> tuple[Vector, Vector, Vector]:
    """b, b'/2 and b''/2 at share t of pieces of length h by (b, b'/2) of both ends, in a last axis of four."""
    t2, t3 = t * t, t * t * t
    value = np.stack(
        np.broadcast_arrays(2 * t3 - 3 * t2 + 1, 2 * h * (t3 - 2 * t2 + t), -2 * t3 + 3 * t2, 2 * h * (t3 - t2)),
        axis=-1,
    )
    slope = np.stack(
        np.broadcast_arrays(3 * (t2 - t) / h, 3 * t2 - 4 * t + 1, -3 * (t2 - t) / h, 3 * t2 - 2 * t),
        axis=-1,
    )
    bend = np.stack(
        np.broadcast_arrays((6 * t - 3) / h**2, (6 * t - 4) / h, -(6 * t - 3) / h**2, (6 * t - 2) / h),
        axis=-1,
    )
    return value, slope, bend


def largest_ratios(path: Path, limits: Limits, profile: Profile, per_piece: int = 30) -> Ratios:
    """Largest share of each limit over `per_piece` points of every piece, ends included."""
    return _ratios(path, limits, profile, per_piece)[0]


@dataclass(frozen=True)
class _Shares:
    """Largest share of the limits in each piece."""

    speed: Vector
    acceleration: Vector
    jerk: Vector

    @property
    def largest(self) -> Vector:
        found: Vector = np.maximum(np.maximum(self.speed, self.acceleration), self.jerk)
        return found

    def above(self, tolerance: float) -> _Shares:
        """What is not above it becomes 1."""
        return _Shares(*(np.where(x > tolerance, x, 1.0) for x in (self.speed, self.acceleration, self.jerk)))


def _ratios(path: Path, limits: Limits, profile: Profile, per_piece: int) -> tuple[Ratios, _Shares]:
    """Largest shares of all, and in each piece."""
    share = np.linspace(_INSIDE, 1.0 - _INSIDE, per_piece)
    p = (profile.p[:-1, None] + share * np.diff(profile.p)[:, None]).ravel()
    b, a, s = (x[:, None] for x in profile.at(p))
    first, second, third = path.derivatives(p)
    velocity = np.max(np.abs(first) * np.sqrt(b) / limits.velocity)
    acceleration = np.max(np.abs(second * b + first * a) / limits.acceleration, axis=1)
    jerk = np.max(np.abs(third * b + 3.0 * second * a + first * s) * np.sqrt(b) / limits.jerk, axis=1)
    feed = cap = 0.0
    if limits.feed is not None:
        feed = float(np.max(np.sqrt(np.sum(first[:, :3] ** 2, axis=1) * b[:, 0]) / limits.feed(p)))
    if limits.cap is not None:
        cap = float(np.sqrt(np.max(b[:, 0] / limits.cap(p))))
    speed = np.sqrt(b[:, 0] / limits.largest_b(p, first))
    shares = _Shares(*(x.reshape(-1, per_piece).max(axis=1) for x in (speed, acceleration, jerk)))
    return Ratios(float(velocity), float(acceleration.max()), float(jerk.max()), feed, cap), shares


def _rest_caps(path: Path, limits: Limits, reach: float, at_end: bool) -> tuple[float, float]:
    """Largest factor of p^(4/3) from rest within `reach`: by the jerk, and by everything else."""
    x = reach * np.linspace(1e-6, 1.0, 24)
    p = path.length - x if at_end else x
    first, second, third = path.derivatives(p)
    x = x[:, None]
    sign = -1.0 if at_end else 1.0
    by_jerk = np.abs(third * x**2 + sign * 2.0 * second * x + _REST_JERK * first) / limits.jerk
    by_acceleration = np.abs(second * x ** (4 / 3) + sign * first * x ** (1 / 3) * 2.0 / 3.0) / limits.acceleration
    by_speed = x[:, 0] ** (4 / 3) / limits.largest_b(p, first)
    others = max(float(by_acceleration.max()), float(by_speed.max()))
    return float(by_jerk.max()) ** (-2.0 / 3.0), 1.0 / others


def _product(matrices: Vector, local: Vector) -> Vector:
    found: Vector = np.matmul(matrices, local[:, :, None])[:, :, 0]
    return found


@dataclass(frozen=True)
class _Standing:
    """Where an iterate stands: b at the points of control and of the sum, room to the limits, weighted time."""

    local: Vector
    b: Vector
    sum_b: Vector
    root: Vector
    slack: Vector
    time: float

    def merit(self, mu: float) -> float:
        """Time and barrier."""
        if float(self.slack.min()) <= 0.0:
            return math.inf
        return self.time - mu * float(np.sum(np.log(self.slack)))


class _Problem:
    """All limits on one grid, as rows over the four unknowns of each piece."""

    def __init__(self, path: Path, limits: Limits, nodes: Vector) -> None:
        self.path, self.limits = path, limits
        self.nodes = nodes  # 0 and L included
        inner = nodes[1:-1]
        self.rest = float(nodes[1]), float(nodes[-1] - nodes[-2])
        self.tie = 2.0 / (3.0 * self.rest[0]), -2.0 / (3.0 * self.rest[1])
        h = np.diff(inner)
        self.pieces = pieces = len(h)
        self.lengths = h
        places = (inner[:-1, None] + h[:, None] * _DENSE).ravel()
        derivatives = path.derivatives(places)
        axes = derivatives[0].shape[1]
        largest = limits.largest_b(places, derivatives[0]).reshape(pieces, 5, 1)
        first, second, third = (d.reshape(pieces, 5, axes, 1) for d in derivatives)
        value, slope, bend = (self._tied(m) for m in _hermite(_DENSE, h[:, None]))
        v, s, c = value[:, :, None], slope[:, :, None], bend[:, :, None]
        acceleration = ((second * v + first * s) / limits.acceleration[:, None]).reshape(pieces, 5 * axes, 4)
        speed = value / largest
        first, second, third, v, s, c = (x[:, ::2] for x in (first, second, third, v, s, c))
        self.value = value[:, ::2]
        self.jerk = ((third * v + 3.0 * second * s + first * c) / limits.jerk[:, None]).reshape(pieces, 3 * axes, 4)
        self.axes = axes
        self.caps = [_rest_caps(path, limits, reach, k == 1) for k, reach in enumerate(self.rest)]
        self.linear = np.concatenate((speed, np.zeros((pieces, 1, 4)), acceleration, -acceleration), axis=1)
        self.summed = self._tied(_hermite(_QUADRATURE, h[:, None])[0])
        self.sum_weight = h[:, None] * _QUADRATURE_WEIGHT
        self.sum_place = inner[:-1, None] + h[:, None] * _QUADRATURE

    def tighten(self, shares: _Shares) -> None:
        """Divides what each piece may use of speed, acceleration and jerk by its largest share."""
        self.linear[:, :5] *= shares.speed[1:-1, None, None] ** 2
        self.linear[:, 6:] *= shares.acceleration[1:-1, None, None]
        self.jerk *= shares.jerk[1:-1, None, None]

    def _tied(self, basis: Vector) -> Vector:
        """Slope of the outermost nodes as the rest pieces have it, by their b."""
        basis = basis.copy()
        basis[0, :, 0] += self.tie[0] * basis[0, :, 1]
        basis[-1, :, 2] += self.tie[1] * basis[-1, :, 3]
        basis[0, :, 1] = basis[-1, :, 3] = 0.0
        return basis

    def profile(self, x: Vector) -> Profile:
        """With the pieces from and to rest."""
        b, a = (np.concatenate(([0.0], x[:, k], [0.0])) for k in (0, 1))
        return Profile(self.nodes, b, a)

    def time(self, x: Vector) -> float:
        """Infinite if b is not above 0 throughout."""
        share = np.linspace(0.0, 1.0, 9)
        b = _product(self._tied(_hermite(share, self.lengths[:, None])[0]), self.local(x))
        return self.profile(x).time_s if float(b.min()) > 0.0 else math.inf

    def local(self, x: Vector) -> Vector:
        return np.concatenate((x[:-1], x[1:]), axis=1)

    def set_caps(self, jerk_scale: float) -> None:
        """Rows of the rest pieces, with the jerk times `jerk_scale`."""
        for k, (piece, column) in enumerate(((0, 0), (self.pieces - 1, 2))):
            by_jerk, by_others = self.caps[k]
            cap = min(by_jerk * jerk_scale ** (2 / 3), by_others) * self.rest[k] ** (4 / 3)
            self.linear[piece, 5, column] = 1.0 / cap

    def shrunk(self, x: Vector, jerk_scale: float, share: float) -> Vector:
        """b times what keeps every limit with room to spare: of the jerk `share`, its 2/3 power of the others."""
        local = self.local(x)
        linear = float(_product(self.linear, local).max())
        root = np.sqrt(np.maximum(np.repeat(_product(self.value, local), self.axes, axis=1), 0.0))
        jerk = float(np.max(np.abs(_product(self.jerk, local)) * root)) / jerk_scale
        factor = min(share ** (2 / 3) / linear, (share / jerk) ** (2 / 3), 1.0)
        found: Vector = x * factor
        return found

    def improved(
        self,
        x: Vector,
        *,
        weight: Vector | None = None,
        jerk_scale: float = 1.0,
        gap: float = 0.1,
        accuracy: float = 1e-5,
    ) -> Vector:
        """A local minimum of the time, each instant weighted by `weight` at the points of the sum, near x."""
        self.set_caps(jerk_scale)
        x = self.shrunk(x, jerk_scale, 0.97)
        jerk = self.jerk / jerk_scale
        weights = self.sum_weight if weight is None else self.sum_weight * weight
        n = self.linear.shape[1]
        middle, rows = n + jerk.shape[1], n + 2 * jerk.shape[1]
        g = np.empty((self.pieces, rows, 4))
        g[:, :n] = self.linear
        now = self._standing(x, jerk, weights)
        mu = gap * now.time / now.slack.size
        dual = mu / now.slack
        best, best_time, since = x, now.time, 0
        for _ in range(200):
            slack = now.slack
            tangent = np.repeat(self.value / (2.0 * now.b[:, :, None]), self.axes, axis=1)
            steep = jerk * now.root[:, :, None]
            g[:, n:middle] = tangent + steep
            g[:, middle:] = tangent - steep
            scaled = dual / slack
            gradient = np.matmul((-0.5 * weights * now.sum_b**-1.5)[:, None, :], self.summed)[:, 0]
            unbalanced = self._share(gradient, gradient + np.matmul(dual[:, None, :], g)[:, 0], now.local)
            # As long as the gradients do not cancel each other the barrier stays: the limits would be met head-on.
            mu = max(mu, gap * unbalanced * now.time / slack.size)
            gradient += np.matmul((mu / slack)[:, None, :], g)[:, 0]
            hessian = np.matmul((g * scaled[:, :, None]).transpose(0, 2, 1), g)
            curvature = 0.75 * weights * now.sum_b**-2.5
            hessian += np.matmul((self.summed * curvature[:, :, None]).transpose(0, 2, 1), self.summed)
            step, slope = self._newton(hessian, gradient, (x[0, 0], x[-1, 0]))
            if not slope < 0.0:
                break
            move = self.local(step)
            down = _product(g, move)
            change = mu / slack - dual + scaled * down
            primal = min(1.0, 0.97 / max(float(np.max(down / slack)), 1e-12))
            for values, matrix in ((now.b, self.value), (now.sum_b, self.summed)):
                fall = float(np.max(-_product(matrix, move) / values))
                primal = min(primal, 0.8 / max(fall, 1e-12))
            dual_step = min(1.0, 0.97 / max(float(np.max(-change / dual)), 1e-12))
            merit = now.merit(mu)
            for _ in range(20):
                after = self._standing(x + primal * step, jerk, weights)
                if after.merit(mu) <= merit + 1e-4 * primal * slope + 1e-12 * abs(merit):
                    break
                primal *= 0.5
            else:
                break
            x, now = x + primal * step, after
            dual = dual + dual_step * change
            since = 0 if now.time < best_time * (1.0 - accuracy) else since + 1
            if now.time < best_time:
                best, best_time = x, now.time
            total = float(np.sum(dual * now.slack))
            if (total < accuracy * now.time and since >= 3) or since >= 12:
                break
            mu = max((1.0 - min(primal, dual_step)) ** 2, 0.15) * total / slack.size
        return best

    def _standing(self, x: Vector, jerk: Vector, weights: Vector) -> _Standing:
        local = self.local(x)
        b, sum_b = _product(self.value, local), _product(self.summed, local)
        root = np.sqrt(np.repeat(b, self.axes, axis=1))
        ratio = _product(jerk, local) * root
        slack = np.concatenate((1.0 - _product(self.linear, local), 1.0 - ratio, 1.0 + ratio), axis=1)
        rest = 3.0 * (self.rest[0] * x[0, 0] ** -0.5 + self.rest[1] * x[-1, 0] ** -0.5)
        return _Standing(local, b, sum_b, root, slack, float(np.sum(weights * sum_b**-0.5)) + float(rest))

    def _share(self, gradient: Vector, remainder: Vector, local: Vector) -> float:
        """How much of the gradient is left, each unknown in units of its piece's b."""

        def size(part: Vector) -> float:
            nodes = np.zeros((self.pieces + 1, 2))
            nodes[:-1] += part[:, :2]
            nodes[1:] += part[:, 2:]
            nodes[:-1] *= np.column_stack((local[:, 0], local[:, 0] / self.lengths))
            return float(np.sum(np.abs(nodes[1:-1])))

        return min(1.0, size(remainder) / size(gradient))

    def _newton(self, hessian: Vector, gradient: Vector, ends: tuple[float, float]) -> tuple[Vector, float]:
        """The step, and the slope along it; a slope of 0 if there is none."""
        size = 2 * (self.pieces + 1)
        band = np.zeros((4, size))
        right = np.zeros((self.pieces + 1, 2))
        right[:-1] -= gradient[:, :2]
        right[1:] -= gradient[:, 2:]
        for row in range(4):
            for column in range(row + 1):
                band[row - column, column : column + 2 * self.pieces : 2] += hessian[:, row, column]
        for k, (place, end) in enumerate(zip((0, -1), ends, strict=True)):
            right[place, 0] += 1.5 * self.rest[k] * end**-1.5
            band[0, 0 if k == 0 else size - 2] += 2.25 * self.rest[k] * end**-2.5
            band[0, 1 if k == 0 else size - 1] = 1.0
        scale = band[0] ** -0.5
        for k in range(4):
            band[k, : size - k] *= scale[: size - k] * scale[k:]
        band[0] += 1e-13
        try:
            factor = cholesky_banded(band, lower=True, check_finite=False)
        except LinAlgError:
            return right, 0.0
        step = (scale * cho_solve_banded((factor, True), scale * right.ravel(), check_finite=False)).reshape(-1, 2)
        slope = -float(np.sum(step * right))
        step[0, 1] = self.tie[0] * step[0, 0]
        step[-1, 1] = self.tie[1] * step[-1, 0]
        return np.asarray(step, dtype=np.float64), slope


def _coarse_nodes(path: Path, limits: Limits) -> Vector:
    """Nodes that get denser towards both ends and the breaks."""
    length = path.length
    breaks = np.concatenate((path.breaks, limits.breaks))
    scales = np.concatenate((path.scales, np.full(len(limits.breaks), length / 200.0)))
    inside = (breaks > 1e-6 * length) & (breaks < (1.0 - 1e-6) * length)
    breaks, scales = breaks[inside], scales[inside]
    reach = []
    for at_end in (False, True):
        place = np.array([length * (1.0 - 1e-9) if at_end else length * 1e-9])
        first = path.derivatives(place)[0]
        moving = np.abs(first[0]) > 1e-9
        jerk = float(np.min(limits.jerk[moving] / np.abs(first[0][moving])))
        acceleration = float(np.min(limits.acceleration[moving] / np.abs(first[0][moving])))
        to_acceleration = acceleration**3 / (6.0 * jerk**2)
        to_speed = float(limits.largest_b(place, first)[0]) ** 0.75 * math.sqrt(_REST_JERK / jerk)
        free = float(np.min(length - breaks if at_end else breaks, initial=length))
        wanted = max(0.3 * min(to_acceleration, to_speed), 1e-6 * length)
        reach.append(min(wanted, 0.01 * length, 0.3 * free))
    begin, end = reach[0], length - reach[1]
    centres = np.concatenate(([0.0], breaks, [length]))
    cores = np.concatenate(([0.0], scales, [0.0]))
    widest = length / 60.0

    def width(p: float) -> float:
        return min(widest, _CLOSER * float(np.min(np.abs(p - centres) + 1.5 * cores)))

    anchors = [begin]
    for stop in np.sort(breaks):
        if stop - anchors[-1] > 1e-7 * length and end - stop > 1e-7 * length:
            anchors.append(float(stop))
    anchors.append(end)
    nodes = [0.0, begin]
    for a, z in itertools.pairwise(anchors):
        marks = [a]
        while marks[-1] < z:
            wide = width(marks[-1])
            marks.append(marks[-1] + max(min(wide, width(marks[-1] + wide)), 1e-8 * length))
        # The last step overshoots: all are pressed together.
        nodes += [a + (m - a) * (z - a) / (marks[-1] - a) for m in marks[1:-1]] + [z]
    return np.array([*nodes, length])


def _finer(problem: _Problem, x: Vector, which: npt.NDArray[np.bool_]) -> tuple[_Problem, Vector]:
    """Pieces halved, and the same profile on them."""
    nodes = problem.nodes
    middles = 0.5 * (nodes[:-1] + nodes[1:])[which]
    finer = np.sort(np.concatenate((nodes, middles)))
    b, a, _ = problem.profile(x).at(finer[1:-1])
    return _Problem(problem.path, problem.limits, finer), np.column_stack((b, a))


def _worth_halving(problem: _Problem, x: Vector) -> npt.NDArray[np.bool_]:
    """Pieces in which, or beside which, something changes and that take their share of the time."""
    profile = problem.profile(x)
    times = np.diff(profile.node_times_s())
    shares = _ratios(problem.path, problem.limits, profile, 5)[1]
    busy = np.maximum(shares.acceleration, shares.jerk) > 0.02
    busy[1:-1] |= np.abs(np.diff(np.log(x[:, 0]))) > 0.02
    near = busy.copy()
    near[1:] |= busy[:-1]
    near[:-1] |= busy[1:]
    worth: npt.NDArray[np.bool_] = near & (times > 1e-4 * times.sum())
    worth[0] = worth[-1] = True
    return worth


def time_optimal(
    path: Path,
    limits: Limits,
    *,
    starts: int = 6,
    seed: int = 1,
    change: float = 0.002,
    tolerance: float = 1.002,
) -> TimeOptimal:
    """The shortest time found from rest to rest, and the profile that takes it.

    `starts` of at least 5: a slow one, two under a wider jerk limit made slower, the others with random weights of the
    time along the path. Grids get finer until the time changes by less than `change`; where a limit is exceeded by
    more than `tolerance` between the points of control the grid gets finer too, and at last all is made slower.
    """
    rng = np.random.default_rng(seed)
    coarse = _Problem(path, limits, _coarse_nodes(path, limits))
    inner = coarse.nodes[1:-1]
    room = inner * (path.length - inner) / path.length
    slow = np.column_stack((room ** (4 / 3), 2.0 / 3.0 * room ** (1 / 3) * (1.0 - 2.0 * inner / path.length)))
    slow[0, 1], slow[-1, 1] = coarse.tie[0] * slow[0, 0], coarse.tie[1] * slow[-1, 0]
    # Of any size: b is scaled to keep the limits, up as well as down.
    slow *= 1e12
    coarse.set_caps(1.0)
    found: list[tuple[float, Vector]] = []
    for k in range(starts):
        x, scale, weight = slow, 1.0, None
        if k == 0:
            x = coarse.shrunk(slow, 1.0, 1.0) * 1e-3
        elif k < 3:
            scale = (30.0, 4.0)[k - 1]
        else:
            knots = np.linspace(0.0, path.length, 4 + len(path.breaks))
            noise = np.interp(coarse.sum_place.ravel(), knots, rng.normal(0.0, 1.2, len(knots)))
            weight = np.exp(noise).reshape(coarse.sum_place.shape)
        if k > 0:
            x = coarse.improved(x, weight=weight, jerk_scale=scale, accuracy=1e-3)
        x = coarse.improved(x, gap=0.3 if k == 0 else 0.03, accuracy=1e-4)
        found.append((coarse.time(x), x))
    ordered = sorted(found, key=lambda pair: pair[0])
    # The second best counts if it is another profile.
    others = (x for _, x in ordered[1:] if np.max(np.abs(x[:, 0] / ordered[0][1][:, 0] - 1.0)) > 0.02)
    begun = [ordered[0][1], *itertools.islice(others, 1)]
    time, relative, profile = min(
        (_refined(coarse, x, change, tolerance) for x in begun), key=lambda candidate: candidate[0]
    )
    ratios = largest_ratios(path, limits, profile)
    return TimeOptimal(time, profile, ratios, relative, starts, tuple(t for t, _ in found))


def _refined(problem: _Problem, x: Vector, change: float, tolerance: float) -> tuple[float, float, Profile]:
    """Time, its relative change at the last finer grid, and profile."""
    before, relative = problem.profile(x).time_s, math.inf
    for _ in range(6):
        problem, x = _finer(problem, x, _worth_halving(problem, x))
        x = problem.improved(x, gap=0.01)
        now = problem.profile(x).time_s
        relative, before = abs(before - now) / now, now
        if relative < change:
            break
    # Between the points of control: first by shorter pieces, then by less for the pieces that exceed a limit.
    for attempt in range(9):
        profile = problem.profile(x)
        ratios, shares = _ratios(problem.path, problem.limits, profile, 30)
        if ratios.largest <= tolerance:
            break
        if attempt < 4 and np.count_nonzero(shares.largest > tolerance) > attempt * 10:
            problem, x = _finer(problem, x, shares.largest > tolerance)
        else:
            problem.tighten(shares.above(tolerance))
        x = problem.improved(x, gap=0.003)
    profile = problem.profile(x)
    ratios = largest_ratios(problem.path, problem.limits, profile)
    slower = min(
        (tolerance / max(ratios.velocity, ratios.feed, ratios.cap)) ** 2,
        tolerance / ratios.acceleration,
        (tolerance / ratios.jerk) ** (2 / 3),
    )
    if slower < 1.0:
        profile = profile.slowed(slower)
    relative = max(relative, profile.time_s / before - 1.0)
    return profile.time_s, relative, profile
