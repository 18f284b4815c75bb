"""Arcs of SINUMERIK programs: by centre, radius, opening angle, intermediate point, tangent.

Sources: CR= easymanua.ls 1265481 p. 192; CIP, CT and the pole as centre 592300 pp. 156 and 157; AR= and TURN= 662598
p. 78.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]

PLANES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}
"""First and second axis of a plane, and the axis across it."""

_STRAIGHT = 1e-9  # sine of an angle below which a direction is one


@dataclass(frozen=True)
class Element:
    """A line, an arc or a helix; positions in mm."""

    start: Vector
    end: Vector
    centre: Vector | None = None  # of an arc; None: a line
    plane: int = 17  # 17, 18 or 19
    sweep_rad: float = 0.0  # of an arc, counter-clockwise positive, seen against the axis across the plane

    @property
    def length_mm(self) -> float:
        """Along the path, with the motion across the plane."""
        if self.centre is None:
            return float(np.linalg.norm(self.end - self.start))
        first, second, across = PLANES[self.plane]
        radius = math.hypot(self.start[first] - self.centre[first], self.start[second] - self.centre[second])
        return math.hypot(radius * self.sweep_rad, self.end[across] - self.start[across])

    def point_at(self, share: float) -> Vector:
        """The point behind this share of its length."""
        if self.centre is None or share in (0.0, 1.0):
            return self.start + share * (self.end - self.start)
        first, second, across = PLANES[self.plane]
        point = self.start + share * (self.end - self.start)
        begin, end = (each[[first, second]] - self.centre[[first, second]] for each in (self.start, self.end))
        # Start and end radius differ by round-off, and by what the control allows.
        radius = math.hypot(*begin) + share * (math.hypot(*end) - math.hypot(*begin))
        angle = math.atan2(begin[1], begin[0]) + share * self.sweep_rad
        point[first], point[second] = self.centre[[first, second]] + radius * np.array(
            [math.cos(angle), math.sin(angle)]
        )
        point[across] = self.start[across] + share * (self.end[across] - self.start[across])
        return point

    def part(self, begin: float, end: float) -> Element:
        """The part between two shares of its length."""
        first = self.start if begin == 0.0 else self.point_at(begin)
        last = self.end if end == 1.0 else self.point_at(end)
        return replace(self, start=first, end=last, sweep_rad=self.sweep_rad * (end - begin))

    def direction_at(self, share: float) -> Vector:
        """Unit vector along the path; zeros where it has no length."""
        if self.centre is None:
            step = self.end - self.start
        else:
            first, second, across = PLANES[self.plane]
            radial = self.point_at(share) - self.centre
            step = np.zeros(3)
            step[first], step[second] = -radial[second] * self.sweep_rad, radial[first] * self.sweep_rad
            step[across] = self.end[across] - self.start[across]
        length = float(np.linalg.norm(step))
        return step / length if length > 0.0 else step


def sweep_of(start: Vector, end: Vector, centre: Vector, plane: int, turn: int) -> float:
    """Sweep of an arc, turn = 1 counter-clockwise, -1 clockwise; a whole circle where start and end are one."""
    first, second, _ = PLANES[plane]
    if math.hypot(end[first] - start[first], end[second] - start[second]) < 1e-9:
        return turn * math.tau
    angles = [math.atan2(each[second] - centre[second], each[first] - centre[first]) for each in (start, end)]
    return turn * ((turn * (angles[1] - angles[0])) % math.tau)


def by_centre(start: Vector, end: Vector, centre: Vector, plane: int, turn: int, tolerance_mm: float) -> Element:
    """An arc by its centre."""
    first, second, _ = PLANES[plane]
    radii = [math.hypot(each[first] - centre[first], each[second] - centre[second]) for each in (start, end)]
    if radii[0] < 1e-9:
        raise ValueError("the centre is the start: I, J, K would have to be the distance from the start to the centre")
    if abs(radii[0] - radii[1]) > tolerance_mm:
        raise ValueError(
            f"the end is {abs(radii[0] - radii[1]):.3f} mm off the radius: start radius {radii[0]:.3f}, end radius "
            f"{radii[1]:.3f}, tolerance {tolerance_mm:.3f}"
        )
    return Element(start, end, centre, plane, sweep_of(start, end, centre, plane, turn))


def by_radius(start: Vector, end: Vector, radius: float, plane: int, turn: int, tolerance_mm: float) -> Element:
    """An arc by its radius, negative: of more than half a turn."""
    first, second, _ = PLANES[plane]
    chord = np.array([end[first] - start[first], end[second] - start[second]])
    half = 0.5 * float(np.hypot(*chord))
    if half < 1e-9:
        raise ValueError("CR= to the start: a whole circle would have to be given by I, J, K")
    if half - abs(radius) > tolerance_mm:
        raise ValueError(
            f"CR={radius:g}: the end is {2.0 * half:.3f} mm away, so it would have to be {half:.3f} or more"
        )
    height = math.sqrt(max(0.0, radius * radius - half * half)) * math.copysign(1.0, radius) * turn
    return _beside_chord(start, end, chord, height, plane, turn)


def by_angle(start: Vector, end: Vector, angle_deg: float, plane: int, turn: int) -> Element:
    """An arc by its end and its opening angle, AR=."""
    first, second, _ = PLANES[plane]
    chord = np.array([end[first] - start[first], end[second] - start[second]])
    half = 0.5 * float(np.hypot(*chord))
    if half < 1e-9:
        raise ValueError("AR= with the start as end: a whole circle would have to be given by I, J, K")
    height = half / math.tan(math.radians(angle_deg) / 2.0) * turn
    return _beside_chord(start, end, chord, height, plane, turn)


def _beside_chord(start: Vector, end: Vector, chord: Vector, height: float, plane: int, turn: int) -> Element:
    first, second, _ = PLANES[plane]
    left = np.array([-chord[1], chord[0]]) / float(np.hypot(*chord))
    centre = start.copy()
    centre[[first, second]] = start[[first, second]] + 0.5 * chord + height * left
    return Element(start, end, centre, plane, sweep_of(start, end, centre, plane, turn))


def turned(start: Vector, centre: Vector, angle_deg: float, plane: int, turn: int) -> Vector:
    """Where an arc of this opening angle about a centre ends."""
    first, second, _ = PLANES[plane]
    angle = turn * math.radians(angle_deg)
    x, y = start[first] - centre[first], start[second] - centre[second]
    end = start.copy()
    end[first] = centre[first] + x * math.cos(angle) - y * math.sin(angle)
    end[second] = centre[second] + x * math.sin(angle) + y * math.cos(angle)
    return end


def through(start: Vector, middle: Vector, end: Vector) -> Element:
    """The arc from start to end through a point between them."""
    across = np.cross(middle - start, end - middle)
    size = float(np.linalg.norm(across))
    reach = float(np.linalg.norm(middle - start) * np.linalg.norm(end - middle))
    if size <= _STRAIGHT * reach or reach == 0.0:
        raise ValueError("start, intermediate point and end lie on a line: the circle would have to have three points")
    normal = across / size
    axis = int(np.argmax(np.abs(normal)))
    if abs(normal[axis]) < 1.0 - 1e-9:
        raise ValueError(
            "a circle through these points lies oblique in space: it would have to lie in a plane of two axes"
        )
    plane = {2: 17, 1: 18, 0: 19}[axis]
    first, second, _ = PLANES[plane]
    a, b, c = (each[[first, second]] for each in (start, middle, end))
    matrix = 2.0 * np.array([b - a, c - a])
    at = np.linalg.solve(matrix, np.array([b @ b - a @ a, c @ c - a @ a]))
    centre = start.copy()
    centre[first], centre[second] = at
    turn = 1 if (b - a)[0] * (c - b)[1] > (b - a)[1] * (c - b)[0] else -1
    return Element(start, end, centre, plane, sweep_of(start, end, centre, plane, turn))


def tangential(start: Vector, end: Vector, direction: Vector, plane: int) -> Element:
    """The arc to an end that goes on in the direction of the path before it; a line where it leads straight on."""
    first, second, _ = PLANES[plane]
    ahead = direction[[first, second]]
    chord = end[[first, second]] - start[[first, second]]
    distance, size = float(np.hypot(*chord)), float(np.hypot(*ahead))
    if size < 1e-9 or distance < 1e-9:
        raise ValueError("CT needs the direction of a move before it in the plane, and an end elsewhere than its start")
    left = np.array([-ahead[1], ahead[0]]) / size
    aside = float(chord @ left)
    if abs(aside) <= 1e-9 * distance:
        if float(chord @ ahead) < 0.0:
            raise ValueError("CT to a point straight behind: no circle leads there")
        return Element(start, end)
    centre = start.copy()
    centre[[first, second]] = start[[first, second]] + left * (distance * distance / (2.0 * aside))
    return Element(start, end, centre, plane, sweep_of(start, end, centre, plane, 1 if aside > 0.0 else -1))
