"""Cutter compensation G41/G42 of a finished list of moves: start-up type A, straight joins at outer corners.

Inner corners are where the offset curves cross, found by sampling (`curves`). Outer corners: up to 90° of turn one
point on both tangents; beyond, two points, each one tool radius along its tangent.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from .corners import sweep_to, turn_between
from .curves import left_of, nearest_crossing
from .items import Item
from .tape import Alarm

Vector = npt.NDArray[np.float64]
#: A change of direction below this is none (rad).
TANGENT = 1e-6


def shift_of(item: Item) -> float:
    """Distance to the left of the path."""
    return item.offset_mm if item.side == 41 else -item.offset_mm


def compensate(items: list[Item]) -> list[Item]:
    """The tool centre's moves."""
    out: list[Item] = []
    k = 0
    while k < len(items):
        if items[k].side == 40 or not items[k].moves_in_plane:
            out.append(replace(items[k], side=40))
            k += 1
            continue
        last = k
        while last < len(items) and (items[last].side != 40 or not items[last].moves_in_plane):
            last += 1
        if last == len(items):
            raise Alarm(items[-1].line, "compensation is not cancelled before the end", 0)
        out += run(items[k : last + 1])
        k = last + 1
    return out


def run(items: list[Item]) -> list[Item]:
    """From the start-up move to the move that cancels, both included."""
    moving = [k for k, item in enumerate(items) if item.moves_in_plane]
    first, cancel = items[0], items[-1]
    if first.kind == "arc" or cancel.kind == "arc":
        raise Alarm((first if first.kind == "arc" else cancel).line, "arc at start-up or cancel", 34)
    if len({items[k].side for k in moving[:-1]}) > 1:
        raise Alarm(first.line, "change of side is not judged")
    shift = shift_of(first)
    ends: dict[int, list[Vector]] = {}  # moving item → the points behind it, the last being the next one's start
    for a, b in itertools.pairwise(moving):
        if a == 0:
            ends[a] = [normal_point(items[b], False, shift)] if b != moving[-1] else [items[a].flat(items[a].end)]
        elif b == moving[-1]:
            ends[a] = [normal_point(items[a], True, shift)]
        else:
            if b - a > 2:
                raise Alarm(items[a].line, "two blocks without a move in the plane are not judged")
            ends[a] = join(items[a], items[b], shift)
    out: list[Item] = []
    at = first.flat(first.start)
    for k, item in enumerate(items):
        begin = item.lift(at, item.start)
        if k not in ends:
            flat = item.flat(item.end) if k == len(items) - 1 else at
            out.append(replace(item, start=begin, end=item.lift(flat, item.end), side=40))
            continue
        points = ends[k]
        moved = replace(item, start=begin, end=item.lift(points[0], item.end), side=40)
        if item.kind == "arc":
            # A full circle stays one; else the sweep follows from the new ends.
            full = abs(abs(item.sweep) - math.tau) < 1e-9
            moved.sweep = item.sweep if full and np.hypot(*(points[0] - at)) < 1e-6 else sweep_to(moved, points[0])
        if k > 0:
            check_direction(item, moved)
        out.append(moved)
        for p, q in itertools.pairwise(points):
            if np.hypot(*(q - p)) > 1e-9:
                out.append(
                    replace(
                        item, kind="line", centre=None, sweep=0.0, side=40,
                        start=item.lift(p, item.end), end=item.lift(q, item.end),
                    )
                )  # fmt: skip
        at = points[-1]
    return out


def check_direction(item: Item, moved: Item) -> None:
    """A line that runs backwards, or an arc that goes on where it should have shrunk away, cuts too much."""
    if item.kind == "line":
        step = moved.flat(moved.end) - moved.flat(moved.start)
        if float(step @ item.tangent(True)) < -1e-9:
            raise Alarm(item.line, "the compensated move runs backwards", 41)
    elif item.kind == "arc" and abs(moved.sweep) - abs(item.sweep) > 0.75 * math.pi:
        raise Alarm(item.line, "the compensated arc runs backwards", 41)


def normal_point(item: Item, at_end: bool, shift: float) -> Vector:
    point = item.flat(item.end if at_end else item.start)
    return np.asarray(point + shift * left_of(item.tangent(at_end)))


def join(a: Item, b: Item, shift: float) -> list[Vector]:
    """Points of the tool centre from the end of `a` to the start of `b`."""
    turn = turn_between(a, b)
    p, q = normal_point(a, True, shift), normal_point(b, False, shift)
    if abs(turn) < TANGENT:
        return [p]
    if turn * shift > 0.0:
        point = nearest_crossing(a, b, shift)
        if point is None:
            raise Alarm(a.line, "the offset paths do not meet", 33)
        return [point]
    t, u = a.tangent(True), b.tangent(False)
    if abs(turn) <= 0.5 * math.pi + 1e-9:
        # p + x t = q - y u
        x, _ = np.linalg.solve(np.column_stack([t, u]), q - p)
        between = [p + x * t]
    else:
        between = [p + abs(shift) * t, q - abs(shift) * u]
    return [*([p] if a.kind == "arc" else []), *between, *([q] if b.kind == "arc" else [])]
