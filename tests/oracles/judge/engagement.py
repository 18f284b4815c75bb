"""What an end mill meets on its way, from the definition alone: no grid, no code of the converter.

A place on the front of the tool's circle is in material if it lies in the stock and nowhere within a radius of the way
of any tool so far, as far as that way ran deep enough. Borders between both are found by bisection.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import shapely

from .records import Move

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

PLACES = 181  # on the front half of the circle
_BISECTIONS = 12
TOUCH_MM = 0.004
"""What stands less than this beyond an earlier way is no material: rounded radii leave as much of a wall cut twice."""
TRAIL_MM = 0.15
"""This much of the way right behind the tool does not count as swept: the last rule would clear the tool's own rim."""


@dataclass(frozen=True)
class Stretch:
    """A straight line or an arc of the tool's axis in XY, its tip going from one height to another."""

    start: Array
    end: Array
    from_z: float
    to_z: float
    radius: float  # of the tool
    centre: Array | None = None
    sweep: float = 0.0

    @property
    def box(self) -> tuple[Array, Array]:
        """Corners of a box around the axis' way."""
        if self.centre is None:
            return np.minimum(self.start, self.end), np.maximum(self.start, self.end)
        arm = np.hypot(*(self.start - self.centre))
        return self.centre - arm, self.centre + arm

    def at(self, share: float) -> Array:
        """Place of the axis."""
        if self.centre is None:
            return self.start + share * (self.end - self.start)
        turn, arm = share * self.sweep, self.start - self.centre
        c, s = math.cos(turn), math.sin(turn)
        return self.centre + np.array([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]])

    def part(self, low: float, high: float) -> Stretch:
        """From one share of the way to another."""
        z = self.to_z - self.from_z
        return Stretch(
            self.at(low), self.at(high), self.from_z + low * z, self.from_z + high * z, self.radius, self.centre,
            (high - low) * self.sweep,
        )  # fmt: skip

    def below(self, height: float) -> Stretch | None:
        """The part on which the tip is below a height."""
        if max(self.from_z, self.to_z) < height:
            return self
        if min(self.from_z, self.to_z) >= height:
            return None
        share = (height - self.from_z) / (self.to_z - self.from_z)
        return self.part(0.0, share) if self.from_z < height else self.part(share, 1.0)

    def distance(self, places: Array, share: Array | float = 1.0) -> Array:
        """Of places (n, 2) from the way; of an arc from its first share (of each place its own)."""
        if self.centre is None:
            along = self.end - self.start
            squared = float(along @ along)
            part = np.clip((places - self.start) @ along / squared, 0.0, 1.0) if squared > 0 else np.zeros(len(places))
            return np.asarray(np.linalg.norm(places - self.start - part[:, None] * along, axis=1))
        arm, off = self.start - self.centre, places - self.centre
        sense, begin = math.copysign(1.0, self.sweep), math.atan2(arm[1], arm[0])
        turned = np.mod(sense * (np.arctan2(off[:, 1], off[:, 0]) - begin), 2.0 * math.pi)
        angle = begin + share * self.sweep
        end = self.centre + math.hypot(*arm) * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        ends = np.minimum(np.linalg.norm(places - self.start, axis=1), np.linalg.norm(places - end, axis=1))
        beside = np.abs(np.linalg.norm(off, axis=1) - math.hypot(*arm))
        return np.where(turned <= share * abs(self.sweep), np.minimum(beside, ends), ends)


def stretch_of(move: Move, tool_radius: float) -> Stretch:
    """The way of a move."""
    centre = None if move.centre is None else move.centre[:2]
    return Stretch(
        move.start[:2], move.end[:2], float(move.start[2]), float(move.end[2]), tool_radius, centre, move.sweep or 0.0
    )


@dataclass
class Block:
    """Material between two heights over a shape of shapely."""

    shape: shapely.Geometry
    bottom: float
    top: float

    def __post_init__(self) -> None:
        shapely.prepare(self.shape)


@dataclass(frozen=True)
class Met:
    """What is met at one place of a move: arcs of (from, to, bottom, top) in rad and mm above the tip."""

    s_mm: float  # along the move
    arcs: tuple[tuple[float, float, float, float], ...]


@dataclass
class Material:
    """Blocks of stock and everything that was swept so far."""

    blocks: list[Block]
    swept: list[Stretch] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)

    def _inside(self, places: Array, height: float, near: Sequence[Stretch]) -> Mask:
        inside = np.zeros(len(places), dtype=bool)
        for block in self.blocks:
            if block.bottom <= height < block.top:
                inside |= shapely.contains_xy(block.shape, places[:, 0], places[:, 1])
        for stretch in near:
            if not inside.any():
                break
            low, high = stretch.box
            reach = stretch.radius
            which = np.flatnonzero(
                inside & (places >= low - reach).all(axis=1) & (places <= high + reach).all(axis=1)
            )  # fmt: skip
            if len(which):
                inside[which] = stretch.distance(places[which]) > reach + TOUCH_MM
        return inside

    def meet(self, move: Move, tool_radius: float, s_mm: Array, layers: Array) -> list[Met]:
        """What the tool meets at distances along a move, which is not yet swept."""
        way = stretch_of(move, tool_radius)
        level = math.hypot(*(way.end - way.start)) if way.centre is None else 1.0
        if level == 0.0:
            return [Met(float(s), ()) for s in s_mm]
        length = move.length
        found: list[list[tuple[float, float, float, float]]] = [[] for _ in s_mm]
        shares = s_mm / length
        centres = np.array([way.at(share) for share in shares])
        heading = _headings(way, shares)
        tips = way.from_z + shares * (way.to_z - way.from_z)
        azimuth = np.linspace(-0.5 * math.pi, 0.5 * math.pi, PLACES)
        low, high = centres.min(axis=0) - tool_radius, centres.max(axis=0) + tool_radius
        near = []
        last = self.swept[-1] if self.swept and np.allclose(self.swept[-1].end, way.start, atol=1e-6) else None
        last_length = self.lengths[-1] if last is not None else 0.0
        for stretch in self.swept if last is None else self.swept[:-1]:
            a, b = stretch.box
            if (a - stretch.radius <= high).all() and (b + stretch.radius >= low).all():
                near.append(stretch)
        for bottom, top in pairwise(layers):
            middle = 0.5 * (bottom + top)
            cut = [part for part in (stretch.below(middle) for stretch in near) if part is not None]
            here = np.flatnonzero(tips < middle)
            if not len(here):
                continue

            def test(of: npt.NDArray[np.intp], angle: Array, height: float = middle, cut: list[Stretch] = cut) -> Mask:
                turned = heading[of] + angle
                rim = centres[of] + tool_radius * np.stack([np.cos(turned), np.sin(turned)], axis=1)
                inside = self._inside(rim, height, cut)
                young = inside & (s_mm[of] < TRAIL_MM)
                old = inside & ~young
                if last is not None:
                    tail = last.below(height)
                    if tail is not None and old.any():
                        inside[old] &= tail.distance(rim[old]) > tail.radius + TOUCH_MM
                    length = last_length - TRAIL_MM
                    flat = last.centre is not None or not np.array_equal(last.start, last.end)
                    tail = last.part(0.0, length / last_length).below(height) if flat and length > 0.0 else None
                    if tail is not None and young.any():
                        inside[young] &= tail.distance(rim[young]) > tail.radius + TOUCH_MM
                if way.centre is not None:  # a straight way never comes back to its front
                    which = np.flatnonzero(inside & (s_mm[of] > TRAIL_MM))
                    share = (s_mm[of[which]] - TRAIL_MM) / move.length
                    inside[which] = way.distance(rim[which], share) > tool_radius + TOUCH_MM
                return inside

            of = np.repeat(here, PLACES)
            mask = test(of, np.tile(azimuth, len(here))).reshape(len(here), PLACES)
            padded = np.pad(mask, ((0, 0), (1, 1)))
            rows, columns = np.nonzero(padded[:, 1:] != padded[:, :-1])  # a border before place `column`
            outside = (columns == 0) | (columns == PLACES)
            one = azimuth[np.clip(columns - 1, 0, PLACES - 1)]
            other = azimuth[np.clip(columns, 0, PLACES - 1)]
            before = padded[rows, columns]
            for _ in range(_BISECTIONS):
                centre = 0.5 * (one + other)
                same = test(here[rows], centre) == before
                one, other = np.where(same, centre, one), np.where(same, other, centre)
            border = np.where(outside, np.where(columns == 0, azimuth[0], azimuth[-1]), 0.5 * (one + other))
            for k in range(0, len(rows), 2):
                station = here[rows[k]]
                floor = max(float(bottom), float(tips[station]))
                found[station].append(
                    (float(border[k]), float(border[k + 1]), floor - tips[station], float(top - tips[station]))
                )
        return [Met(float(s), tuple(arcs)) for s, arcs in zip(s_mm, found, strict=True)]

    def sweep(self, move: Move, tool_radius: float) -> None:
        """Take away what a move passes."""
        if not np.isnan(move.start).any():
            self.swept.append(stretch_of(move, tool_radius))
            self.lengths.append(move.length)


def _headings(way: Stretch, shares: Array) -> Array:
    if way.centre is None:
        along = way.end - way.start
        return np.full(len(shares), math.atan2(along[1], along[0]))
    arm = way.start - way.centre
    return math.atan2(arm[1], arm[0]) + shares * way.sweep + math.copysign(0.5 * math.pi, way.sweep)


def layers_of(moves: Sequence[Move], blocks: Sequence[Block], most_mm: float) -> Array:
    """Heights between which no level way begins or ends; where ramps are, no farther apart than given."""
    heights = {block.bottom for block in blocks} | {block.top for block in blocks}
    ramps = []
    for move in moves:
        z = [float(move.start[2]), float(move.end[2])]
        heights.update(value for value in z if not math.isnan(value))
        if abs(z[1] - z[0]) > 1e-9 and math.hypot(*move.delta[:2]) > 1e-9:
            ramps.append((min(z), max(z)))
    low, high = min(block.bottom for block in blocks), max(block.top for block in blocks)
    ordered = sorted({round(min(max(value, low), high), 6) for value in heights})
    out = [ordered[0]]
    for a, b in pairwise(ordered):
        ramped = any(r[0] < b and r[1] > a for r in ramps)
        parts = max(1, math.ceil((b - a) / most_mm)) if ramped else 1
        out += [a + (b - a) * (k + 1) / parts for k in range(parts)]
    return np.array(out)


def stations(move: Move, step_mm: float, radius: float) -> Array:
    """Where to look along a move: evenly, both ends, and closer behind its start, where the load may jump."""
    length = move.length
    even = np.linspace(0.0, length, max(2, math.ceil(length / step_mm) + 1))
    close = np.array([1e-4, 0.01, 0.03]) * radius
    return np.unique(np.concatenate([even, close[close < length]]))
