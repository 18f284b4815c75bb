"""Motion of a path by planners that are not the package's own: Klipper's host, recordings of LinuxCNC, grbl's rules.

A path is its segments as the core gives them: geometry and feed alone are used.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dialect_readers import ReadMove, klipper_set_points, read_linuxcnc
from judge import response
from judge.plant import AxisModes
from shapegcode import _core

Vector = NDArray[np.float64]
PERIOD_S = 0.001
ARC_MM = 1.0
"""Klipper's default of `resolution` in `[gcode_arcs]`."""
_ABOUT_MM = 3.0  # of travel on either side, within which the nearest place of the path is looked for


def klipper_points(path: _core.Path, limits: dict[str, float], folder: Path) -> tuple[Vector, float]:
    """Set-points at 1 ms as the look-ahead of Klipper's own host plans them, and their time."""
    pieces = [
        {
            "kind": each.kind.name, "end": list(each.end_mm), "feed": each.feed_mm_per_s,
            "centre": list(each.centre_mm), "sweep": each.sweep_rad, "normal": each.normal,
        }
        for each in path
    ]  # fmt: skip
    return klipper_set_points(path[0].start_mm, pieces, limits, folder)


def grbl_lines(path: _core.Path, tolerance_mm: float) -> list[tuple[Vector, Vector, float]]:
    """Start, end and feed of the lines that grbl makes of a path: an arc's chords turn by equal angles."""
    lines = []
    for each in path:
        points = [np.array(each.start_mm), np.array(each.end_mm)]
        if each.kind == _core.SegmentKind.arc:
            radius, first, second = each.radius_mm, (each.normal + 1) % 3, (each.normal + 2) % 3
            sagitta = math.sqrt(tolerance_mm * (2.0 * radius - tolerance_mm))
            count = max(1, math.floor(abs(0.5 * each.sweep_rad * radius) / sagitta))
            centre, start = np.array(each.centre_mm), points[0]
            began = math.atan2(start[second] - centre[second], start[first] - centre[first])
            for k in range(1, count):
                point = start + k / count * (points[-1] - start)
                point[first] = centre[first] + radius * math.cos(began + each.sweep_rad * k / count)
                point[second] = centre[second] + radius * math.sin(began + each.sweep_rad * k / count)
                points.insert(-1, point)
        lines += [(a, b, each.feed_mm_per_s) for a, b in pairwise(points) if np.any(a != b)]
    return lines


class Grbl:
    """Blocks as grbl runs them: a buffer that is filled again as soon as a block is over, and planned to a stop."""

    def __init__(self, acceleration: Vector, rate: Vector, deviation_mm: float, buffer: int) -> None:
        self._acceleration, self._rate, self._deviation_mm, self._buffer = acceleration, rate, deviation_mm, buffer

    def block_times_s(self, lines: list[tuple[Vector, Vector, float]]) -> list[float]:
        """Time of each block."""
        lengths = [float(np.linalg.norm(b - a)) for a, b, _ in lines]
        units = [(b - a) / length for (a, b, _), length in zip(lines, lengths, strict=True)]
        most = [min(self._acceleration[k] / abs(u[k]) for k in range(3) if u[k]) for u in units]
        rates = [min(self._rate[k] / abs(u[k]) for k in range(3) if u[k]) for u in units]
        feeds = [min(feed, rate) for (_, _, feed), rate in zip(lines, rates, strict=True)]
        junctions = [0.0, *(self._junction(*pair) for pair in pairwise(units))]
        times, entry = [], 0.0
        for i, length in enumerate(lengths):
            leave = self._exit(i, entry, lengths, most, feeds, junctions)
            # accelerate, cruise, brake
            top = min(feeds[i], math.sqrt(most[i] * length + 0.5 * (entry**2 + leave**2)))
            top = max(top, entry, leave)
            ramps = (2.0 * top**2 - entry**2 - leave**2) / (2.0 * most[i])
            times.append((2.0 * top - entry - leave) / most[i] + max(0.0, length - ramps) / top)
            entry = leave
        return times

    def _junction(self, before: Vector, after: Vector) -> float:
        """Speed of the arc that cuts the corner by the deviation."""
        cosine = max(-1.0, min(1.0, float(before @ after)))
        if abs(cosine) > 0.999999:  # grbl calls it straight, or a reversal
            return math.inf if cosine > 0.0 else 0.0
        turn = math.acos(cosine)
        across = (after - before) / np.linalg.norm(after - before)
        acceleration = min(self._acceleration[k] / abs(across[k]) for k in range(3) if across[k])
        half = math.cos(0.5 * turn)
        return math.sqrt(acceleration * self._deviation_mm * half / (1.0 - half))

    def _exit(
        self, i: int, entry: float, lengths: list[float], most: list[float], feeds: list[float], junctions: list[float]
    ) -> float:
        """Speed at the end of block i, with so many blocks in the buffer as it holds."""
        known = range(i + 1, min(len(lengths), i + self._buffer))
        speed = 0.0
        for k in reversed(known):
            speed = min(math.sqrt(speed**2 + 2.0 * most[k] * lengths[k]), junctions[k], feeds[k], feeds[k - 1])
        return min(speed, math.sqrt(entry**2 + 2.0 * most[i] * lengths[i]), feeds[i])


def path_of_text(text: str, folder: Path) -> _core.Path:
    """The last cut of a program in LinuxCNC's words, read by its own interpreter."""
    cut: list[ReadMove] = []
    for move in reversed(read_linuxcnc(text, folder)):
        if not move.rapid and not move.dwell_s:
            cut.append(move)
        elif cut:
            break
    return _core.Path([_segment(move) for move in reversed(cut)])


def _segment(move: ReadMove) -> _core.Segment:
    feed = move.feed_mm_per_min / 60.0
    if move.centre is None:
        return _core.Segment.line(move.start, move.end, feed)
    angles = [math.atan2(*(point - move.centre)[[1, 0]]) for point in (move.start, move.end)]
    sweep = (angles[1] - angles[0]) * move.turn % math.tau * move.turn
    return _core.Segment.arc(move.start, move.end, move.centre, sweep, feed)


def smoothed(points: Vector) -> Vector:
    """Set-points behind the cubic between the samples of a joint: a sixth, four sixths, a sixth."""
    held = np.vstack([np.repeat(points[:1], 2, axis=0), points, np.repeat(points[-1:], 2, axis=0)])
    return (held[:-2] + 4.0 * held[1:-1] + held[2:]) / 6.0


def distance_in_time(one: Vector, other: Vector, max_shift: int = 6) -> float:
    """Largest distance of set-points at the same time, mm, where one begins by so many periods earlier or later."""
    found = []
    for shift in range(-max_shift, max_shift + 1):
        a, b = one[max(0, shift) :], other[max(0, -shift) :]
        count = max(len(a), len(b))
        a, b = (np.vstack([each, np.repeat(each[-1:], count - len(each), axis=0)]) for each in (a, b))
        found.append(float(np.linalg.norm(a - b, axis=1).max()))
    return min(found)


def klipper_text(path: _core.Path) -> str:
    """A path in Klipper's words with its arcs as G2 and G3, between two dwells."""
    start = " ".join(f"{axis}{value:.6f}" for axis, value in zip("XYZ", path[0].start_mm, strict=True))
    lines = ["G90", f"G0 {start} F24000", "G4 P500"]
    for each in path:
        words = [f"{axis}{value:.6f}" for axis, value in zip("XYZ", each.end_mm, strict=True)]
        code = "G1"
        if each.kind == _core.SegmentKind.arc:
            assert each.normal == 2
            code = "G3" if each.sweep_rad > 0.0 else "G2"
            words += [f"{axis}{each.centre_mm[k] - each.start_mm[k]:.6f}" for k, axis in enumerate("IJ")]
        lines.append(f"{code} {' '.join(words)} F{each.feed_mm_per_s * 60.0:g}")
    return "\n".join([*lines, "G4 P500", ""])


def table_off_path_um(cut: Vector, path: Vector, modes: Sequence[AxisModes]) -> tuple[float, float]:
    """Largest distance of the table behind set-points from the path, and the larger of it and that the other way."""
    _, command, table = response(cut, modes, PERIOD_S, rest_s=0.2)
    along_path, along = _travel(path), _travel(command)[::5]
    along *= along_path[-1] / along[-1]
    table = table[::5]
    there = distances_from_polyline(table, along, path, along_path)
    back = distances_from_polyline(path, along_path, table, along)
    return 1e3 * there, 1e3 * max(there, back)


def _travel(points: Vector) -> Vector:
    """Length from the first point to each."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def distances_from_polyline(points: Vector, at: Vector, line: Vector, along: Vector) -> float:
    """Largest distance of points, by the travel at which each stands, from the stretch of a polyline about them.

    `along`: travel at each vertex. A path may cross itself elsewhere.
    """
    step = np.diff(line, axis=0)
    length = (step**2).sum(axis=1)
    farthest = 0.0
    for point, place in zip(points, at, strict=True):
        low = max(0, int(np.searchsorted(along, place - _ABOUT_MM)) - 1)
        stretch = slice(low, min(len(step), int(np.searchsorted(along, place + _ABOUT_MM)) + 1))
        begin, turn, square = line[:-1][stretch], step[stretch], np.maximum(length[stretch], 1e-18)
        share = np.clip(((point - begin) * turn).sum(axis=1) / square, 0.0, 1.0)
        farthest = max(farthest, float(((begin + share[:, None] * turn - point) ** 2).sum(axis=1).min()))
    return farthest**0.5
