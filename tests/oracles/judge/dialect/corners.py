"""Corner words ,R and ,C: a fillet or a chamfer between a block and the next one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from .curves import OffsetCurve, left_of, nearest_crossing
from .items import Item
from .tape import Alarm


def turn_between(a: Item, b: Item) -> float:
    """Change of direction at the corner, rad, positive to the left."""
    t, u = a.tangent(True), b.tangent(False)
    return math.atan2(t[0] * u[1] - t[1] * u[0], float(t @ u))


def sweep_to(item: Item, end: object) -> float:
    """Sweep of the arc if it ended at the flat point `end`, in its own sense."""
    assert item.centre is not None
    c, s = item.flat(item.centre), item.flat(item.start)
    e = np.asarray(end, dtype=float)
    sign = math.copysign(1.0, item.sweep)
    angle = math.atan2(e[1] - c[1], e[0] - c[0]) - math.atan2(s[1] - c[1], s[0] - c[0])
    return sign * ((sign * angle) % math.tau)


def cut_end(item: Item, flat: object) -> Item:
    end = item.lift(np.asarray(flat, dtype=float), item.end)
    sweep = sweep_to(item, flat) if item.kind == "arc" else 0.0
    return replace(item, end=end, sweep=sweep, corner=None)


def cut_start(item: Item, flat: object) -> Item:
    start = item.lift(np.asarray(flat, dtype=float), item.start)
    shorter = replace(item, start=start)
    if item.kind == "arc":
        shorter.sweep = sweep_to(shorter, item.flat(item.end))
    return shorter


def insert_corners(items: list[Item]) -> list[Item]:
    """The items with every ,R and ,C made into a move of its own."""
    out: list[Item] = []
    todo = list(items)
    while todo:
        item = todo.pop(0)
        if item.corner is None:
            out.append(item)
            continue
        if not todo or todo[0].kind not in ("line", "arc") or not todo[0].moves_in_plane:
            raise Alarm(item.line, "corner word without a following move", 51)
        kind, size = item.corner
        following = todo[0]
        corner = item.flat(item.end)
        if kind == "C":
            if item.kind == "arc" or following.kind == "arc":
                raise Alarm(item.line, "chamfer at an arc is not judged")
            p, q = corner - size * item.tangent(True), corner + size * following.tangent(False)
            inserted = replace(item, kind="line", corner=None)
        else:
            side = math.copysign(1.0, turn_between(item, following))
            centre = nearest_crossing(item, following, side * size)
            if centre is None:
                raise Alarm(item.line, "fillet does not fit", 50)
            p, q = OffsetCurve(item, 0.0).foot(centre), OffsetCurve(following, 0.0).foot(centre)
            inserted = replace(item, kind="arc", corner=None, centre=item.lift(centre, item.end), sweep=side)
        inserted.start, inserted.end = item.lift(p, item.end), item.lift(q, item.end)
        if inserted.kind == "arc":
            inserted.sweep = sweep_to(inserted, q)
        out += [cut_end(item, p), inserted]
        todo[0] = cut_start(following, q)
    return out


__all__ = ["cut_end", "cut_start", "insert_corners", "left_of", "sweep_to", "turn_between"]
