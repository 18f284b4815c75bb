"""Arcs of other controls' programs: by centre, radius, opening angle, intermediate point, tangent.

In their plane points are complex numbers. Sources for a SINUMERIK: CR= easymanua.ls 1265481 p. 192; CIP, CT and the
pole as centre 592300 pp. 156 and 157; AR= and TURN= 662598 p. 78.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]

PLANES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}  # first and second axis of a plane, and the axis across it

_STRAIGHT = 1e-9  # sine of an angle below which a direction is one
_FULL_TURN = 1e-9  # rad
_ONE_POINT_MM = 1e-9


def flat(point: Vector, plane: int) -> complex:
    """A point in its plane."""
    first, second, _ = PLANES[plane]
    return complex(point[first], point[second])


def moved_to(point: Vector, plane: int, to: complex) -> Vector:
    """A point that is moved in its plane."""
    first, second, _ = PLANES[plane]
    moved = point.copy()
    moved[first], moved[second] = to.real, to.imag
    return moved


def sweep_of(start: complex, end: complex, centre: complex, turn: int) -> float:
    """Sweep of an arc, turn = 1 counter-clockwise, -1 clockwise; a whole circle where start and end are one."""
    sweep = turn * (cmath.phase(end - centre) - cmath.phase(start - centre)) % math.tau
    return turn * (math.tau if sweep < _FULL_TURN else sweep)


def centre_by_radius(start: complex, end: complex, radius: float, turn: int) -> complex:
    """Centre of an arc by its radius, negative: of more than half a turn."""
    half = 0.5 * abs(end - start)
    height = math.copysign(math.sqrt(max(0.0, radius * radius - half * half)), radius) * turn
    return _beside_chord(start, end, height)


def _beside_chord(start: complex, end: complex, height: float) -> complex:
    """The point at a height on the left of the middle of a chord."""
    return 0.5 * (start + end) + 1j * height * (end - start) / abs(end - start)


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
        across = PLANES[self.plane][2]
        radius = abs(flat(self.start - self.centre, self.plane))
        return math.hypot(radius * self.sweep_rad, self.end[across] - self.start[across])

    def point_at(self, share: float) -> Vector:
        """The point behind this share of its length."""
        point = self.start + share * (self.end - self.start)
        if self.centre is None or share in (0.0, 1.0):
            return point
        begin, end = (flat(each - self.centre, self.plane) for each in (self.start, self.end))
        # Start and end radius differ by round-off, and by what the control allows.
        radius = abs(begin) + share * (abs(end) - abs(begin))
        spoke = cmath.rect(radius, cmath.phase(begin) + share * self.sweep_rad)
        return moved_to(point, self.plane, flat(self.centre, self.plane) + spoke)

    def part(self, begin: float, end: float) -> Element:
        """The part between two shares of its length."""
        first = self.start if begin == 0.0 else self.point_at(begin)
        last = self.end if end == 1.0 else self.point_at(end)
        return replace(self, start=first, end=last, sweep_rad=self.sweep_rad * (end - begin))

    def direction_at(self, share: float) -> Vector:
        """Unit vector along the path; zeros where it has no length."""
        step = self.end - self.start
        if self.centre is not None:
            spoke = flat(self.point_at(share) - self.centre, self.plane)
            step = moved_to(step, self.plane, 1j * self.sweep_rad * spoke)
        length = float(np.linalg.norm(step))
        return step / length if length > 0.0 else step


def _arc(start: Vector, end: Vector, centre: complex, plane: int, turn: int) -> Element:
    sweep = sweep_of(flat(start, plane), flat(end, plane), centre, turn)
    return Element(start, end, moved_to(start, plane, centre), plane, sweep)


def by_centre(start: Vector, end: Vector, centre: complex, plane: int, turn: int, tolerance_mm: float) -> Element:
    """An arc by its centre."""
    radii = [abs(flat(each, plane) - centre) for each in (start, end)]
    if radii[0] < _ONE_POINT_MM:
        raise ValueError("the centre is the start: I, J, K would have to be the distance from the start to the centre")
    if abs(radii[0] - radii[1]) > tolerance_mm:
        raise ValueError(
            f"the end is {abs(radii[0] - radii[1]):.3f} mm off the radius: start radius {radii[0]:.3f}, end radius "
            f"{radii[1]:.3f}, tolerance {tolerance_mm:.3f}"
        )
    return _arc(start, end, centre, plane, turn)


def by_radius(start: Vector, end: Vector, radius: float, plane: int, turn: int, tolerance_mm: float) -> Element:
    """An arc by its radius, negative: of more than half a turn."""
    a, b = flat(start, plane), flat(end, plane)
    half = 0.5 * abs(b - a)
    if half < _ONE_POINT_MM:
        raise ValueError("CR= to the start: a whole circle would have to be given by I, J, K")
    if half - abs(radius) > tolerance_mm:
        raise ValueError(
            f"CR={radius:g}: the end is {2.0 * half:.3f} mm away, so it would have to be {half:.3f} or more"
        )
    return _arc(start, end, centre_by_radius(a, b, radius, turn), plane, turn)


def by_angle(start: Vector, end: Vector, angle_deg: float, plane: int, turn: int) -> Element:
    """An arc by its end and its opening angle, AR=."""
    a, b = flat(start, plane), flat(end, plane)
    half = 0.5 * abs(b - a)
    if half < _ONE_POINT_MM:
        raise ValueError("AR= with the start as end: a whole circle would have to be given by I, J, K")
    return _arc(start, end, _beside_chord(a, b, half / math.tan(math.radians(angle_deg) / 2.0) * turn), plane, turn)


def through(start: Vector, middle: Vector, end: Vector) -> Element:
    """The arc from start to end through a point between them."""
    across = np.cross(middle - start, end - middle)
    size = float(np.linalg.norm(across))
    reach = float(np.linalg.norm(middle - start) * np.linalg.norm(end - middle))
    if size <= _STRAIGHT * reach or reach == 0.0:
        raise ValueError("start, intermediate point and end lie on a line: the circle would have to have three points")
    axis = int(np.argmax(np.abs(across)))
    if abs(across[axis]) / size < 1.0 - 1e-9:
        raise ValueError(
            "a circle through these points lies oblique in space: it would have to lie in a plane of two axes"
        )
    plane = {2: 17, 1: 18, 0: 19}[axis]
    a, b, c = (flat(each, plane) for each in (start, middle, end))
    ratio = (c - a) / (b - a)
    centre = a + (b - a) * (ratio - abs(ratio) ** 2) / (2j * ratio.imag)
    return _arc(start, end, centre, plane, 1 if ratio.imag > 0.0 else -1)


def tangential(start: Vector, end: Vector, direction: Vector, plane: int) -> Element:
    """The arc to an end that goes on in the direction of the path before it; a line where it leads straight on."""
    ahead, chord = flat(direction, plane), flat(end - start, plane)
    if abs(ahead) < 1e-9 or abs(chord) < _ONE_POINT_MM:
        raise ValueError("CT needs the direction of a move before it in the plane, and an end elsewhere than its start")
    seen = chord * ahead.conjugate() / abs(ahead)  # along the direction, and to its left
    if abs(seen.imag) <= 1e-9 * abs(chord):
        if seen.real < 0.0:
            raise ValueError("CT to a point straight behind: no circle leads there")
        return Element(start, end)
    centre = flat(start, plane) + 1j * ahead / abs(ahead) * abs(chord) ** 2 / (2.0 * seen.imag)
    return _arc(start, end, centre, plane, 1 if seen.imag > 0.0 else -1)
