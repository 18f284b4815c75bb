"""Drilling cycles G73 ... G89 at one hole, as the operations of the operator's manual."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

#: A step of a cycle: what, level along the drilling axis or shift in the plane, seconds.
Step = tuple[Literal["rapid", "feed", "dwell", "shift", "back"], float]


@dataclass
class Cycle:
    """The data of a cycle; levels in programmed coordinates, mm, s."""

    code: str
    initial: float
    r: float
    z: float
    q: float = 0.0
    dwell_s: float = 0.0
    to_r: bool = False
    clearance: float = 0.5  #: d, parameters 5114 and 5115


def pecks(cycle: Cycle) -> Iterator[tuple[float, float]]:
    """(level reached before, level of this peck), the last one being the bottom."""
    down = math.copysign(1.0, cycle.z - cycle.r)
    total = abs(cycle.z - cycle.r)
    done = 0.0
    while done < total - 1e-9:
        before, done = done, min(total, done + cycle.q)
        yield cycle.r + down * before, cycle.r + down * done


def steps(cycle: Cycle) -> Iterator[Step]:
    """What the tool does above one hole, from the initial level (or R) on."""
    wait: list[Step] = [("dwell", cycle.dwell_s)] if cycle.dwell_s > 0.0 else []
    back = cycle.r if cycle.to_r else cycle.initial
    code = cycle.code
    if code == "G87":  # from below: shifted down to R, then up to Z
        yield ("shift", cycle.q)
        yield ("rapid", cycle.r)
        yield ("back", cycle.q)
        yield ("feed", cycle.z)
        yield from wait
        yield ("shift", cycle.q)
        yield ("rapid", cycle.initial)
        yield ("back", cycle.q)
        return
    yield ("rapid", cycle.r)
    if code in ("G73", "G83") and cycle.q > 0.0:
        down = math.copysign(1.0, cycle.z - cycle.r)
        for before, now in pecks(cycle):
            if code == "G83" and abs(before - cycle.r) > 1e-9:
                yield ("rapid", before - down * cycle.clearance)
            yield ("feed", now)
            if now != cycle.z and abs(now - cycle.z) > 1e-9:
                yield ("rapid", cycle.r if code == "G83" else now - down * cycle.clearance)
    else:
        yield ("feed", cycle.z)
    if code in ("G82", "G76", "G88", "G89", "G73", "G83"):
        yield from wait
    if code in ("G74", "G84"):
        yield from wait
        yield ("feed", cycle.r)
        yield from wait
    elif code in ("G85", "G89"):
        yield ("feed", cycle.r)
    if code == "G76":
        yield ("shift", cycle.q)
        yield ("rapid", back)
        yield ("back", cycle.q)
    elif code == "G88":
        yield ("rapid", cycle.r)
        yield ("rapid", back)
    else:
        yield ("rapid", back)
