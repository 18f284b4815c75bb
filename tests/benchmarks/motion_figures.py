"""What set-points ask of a machine: time, speed, acceleration, jerk, distance from the path. For any engine's alike."""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import places  # noqa: F401

from judge import interpret
from judge.plant import distances_from_polyline

Array = npt.NDArray[np.float64]
PERIOD_S = 1e-3
_POINT_MM = 0.005  # between points of a path that distances are measured from


@dataclass(frozen=True)
class Limits:
    """Of X, Y and Z; mm and s."""

    feed: tuple[float, float, float]
    acceleration: tuple[float, float, float]
    jerk: tuple[float, float, float]

    @classmethod
    def of(cls, feed: float, acceleration: float, jerk: float) -> Limits:
        """The same for every axis."""
        return cls((feed,) * 3, (acceleration,) * 3, (jerk,) * 3)


@dataclass(frozen=True)
class Piece:
    """A line, or an arc about an axis (0, 1, 2) through `centre`, to `end`."""

    end: tuple[float, float, float]
    feed: float  # mm/s
    centre: tuple[float, float, float] | None = None
    sweep: float = 0.0
    normal: int = 2

    def words(self) -> str:
        """As peers.hpp reads it."""
        end = " ".join(f"{value:.17g}" for value in self.end)
        if self.centre is None:
            return f"line {end} {self.feed:.17g}"
        centre = " ".join(f"{value:.17g}" for value in self.centre)
        return f"arc {end} {centre} {self.sweep:.17g} {self.normal} {self.feed:.17g}"

    def points(self, start: Sequence[float]) -> Array:
        """Along it, its start left out."""
        begin, end = np.array(start), np.array(self.end)
        way = end - begin
        if self.centre is None:
            return begin + _shares(float(np.linalg.norm(way)))[:, None] * way
        first, second = (self.normal + 1) % 3, (self.normal + 2) % 3
        radial = begin - np.array(self.centre)
        radius = math.hypot(radial[first], radial[second])
        share = _shares(radius * abs(self.sweep))
        angle = math.atan2(radial[second], radial[first]) + self.sweep * share
        points = begin + share[:, None] * way
        points[:, first] = self.centre[first] + radius * np.cos(angle)
        points[:, second] = self.centre[second] + radius * np.sin(angle)
        return points


def _shares(length: float) -> Array:
    return np.linspace(0.0, 1.0, math.ceil(length / _POINT_MM) + 1)[1:]


@dataclass(frozen=True)
class Route:
    """A connected path."""

    pieces: list[Piece] = field(default_factory=list)
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def points(self) -> Array:
        """Close to each other."""
        at, points = self.start, [np.array([self.start])]
        for piece in self.pieces:
            points.append(piece.points(at))
            at = piece.end
        return np.concatenate(points)


@dataclass(frozen=True)
class Figures:
    """Of a motion; shares are of the limits, of the axis that is worst off."""

    time_s: float
    speed: float
    acceleration: float
    jerk: float
    off_mm: float = math.nan

    @property
    def shares(self) -> list[float]:
        """Of the limits."""
        return [self.speed, self.acceleration, self.jerk]


def figures(points: Array, limits: Limits, route: Route | None = None, period_s: float = PERIOD_S) -> Figures:
    """Finite differences of set-points that begin and end at rest; how far they leave the path."""
    still = np.flatnonzero(np.abs(np.diff(points, axis=0)).max(axis=1) > 0.0)
    time_s = (still[-1] - still[0] + 1) * period_s if len(still) else 0.0
    padded = np.concatenate([np.repeat(points[:1], 4, axis=0), points, np.repeat(points[-1:], 4, axis=0)])
    shares = [
        float((np.abs(np.diff(padded, n=order, axis=0)).max(axis=0) / period_s**order / np.array(most)).max())
        for order, most in ((1, limits.feed), (2, limits.acceleration), (3, limits.jerk))
    ]
    found = Figures(time_s, *shares)
    if route is None:
        return found
    return replace(found, off_mm=float(distances_from_polyline(points, route.points()).max()))


def ours(
    driver: Path, route: Route, limits: Limits, file: Path, how: str = "play", **settings: object
) -> tuple[Array, dict[str, Any]]:
    """Set-points of `MotionController`, and what its steps took; `how` "plan": of `time_optimal_trajectory`."""
    task = [f"{name} {value}" for name, value in {"period": PERIOD_S, **settings}.items()]
    for name in ("feed", "acceleration", "jerk"):
        task.append(" ".join([name, *(f"{value:.17g}" for value in getattr(limits, name))]))
    task.append(" ".join(["start", *(f"{value:.17g}" for value in route.start)]))
    task += [piece.words() for piece in route.pieces]
    run = subprocess.run([driver, how, file], input="\n".join(task), capture_output=True, text=True, check=False)
    if run.returncode != 0:
        raise RuntimeError(run.stderr.strip())
    points = read_points(file)
    if how == "play":
        points = np.vstack([route.start, points])  # where it rests before the first step
    return points, json.loads(run.stdout)


def read_points(file: Path) -> Array:
    """Rows of three doubles, as the drivers write them."""
    return np.fromfile(file).reshape(-1, 3)


def read_program(text: str, rapid: float) -> Route:
    """Moves of a plain program from 0 on; G91.1 says what a FANUC control does anyway."""
    pieces = []
    for move in interpret(text.replace("G91.1 ", ""), start_state={"position": [0.0, 0.0, 0.0]}).moves:
        end, feed = (*map(float, move.end),), rapid if move.kind == "rapid" else move.feed / 60.0
        if move.kind == "arc":
            assert move.centre is not None and move.sweep is not None and move.normal_axis is not None
            pieces.append(Piece(end, feed, (*map(float, move.centre),), move.sweep, move.normal_axis))
        elif move.length > 0.0:
            pieces.append(Piece(end, feed))
    return Route(pieces)
