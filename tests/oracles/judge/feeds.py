"""Judges a program with scheduled feeds: what the machine really runs, and the forces along it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .cutting import Arcs, Cut, EndMill, Figures
from .engagement import Block, Material, Met, layers_of, stations
from .plant import distances_from_polyline, path_polyline
from .player import BlockEnd, play, starts
from .records import Interpretation, Move

Array = npt.NDArray[np.float64]
Key = tuple[tuple[int, ...], ...]


def known(program: Interpretation) -> list[Move]:
    """The moves from the first whose start is known."""
    return [move for move in program.moves if not np.isnan(move.start).any() and not np.isnan(move.end).any()]


def runs(program: Interpretation) -> list[list[Move]]:
    """Cutting moves between which nothing stops."""
    out: list[list[Move]] = []
    open_ = False
    for line in program.lines:
        stops = line.dwell_s > 0.0 or any(a in "MST" for a, _ in line.words)
        if stops:
            open_ = False
        for move in line.moves:
            if move.kind == "rapid" or move.cycle:
                open_ = False
            elif move.length > 0.0:
                if not open_:
                    out.append([])
                out[-1].append(move)
                open_ = True
    return out


@dataclass(frozen=True)
class Run:
    """A run of the original with what is met along it; `s_mm` of a station counts from the run's start."""

    moves: list[Move]
    s_mm: Array
    move: npt.NDArray[np.intp]
    behind: npt.NDArray[np.bool_]  # a station right behind a vertex: belongs to the move that begins there
    arcs: list[Arcs]

    @property
    def length(self) -> float:
        """Of the path."""
        return sum(move.length for move in self.moves)


def engagements(
    program: Interpretation, blocks: list[Block], radius: float, *, step_mm: float, layer_mm: float = 0.25,
    before: Sequence[tuple[Move, float]] = (),
) -> list[Run]:  # fmt: skip
    """What is met along every run of a program; `before`: moves of another program, each with its tool's radius."""
    material = Material(blocks)
    layers = layers_of([*known(program), *(move for move, _ in before)], blocks, layer_mm)
    for move, its in before:
        material.sweep(move, its)
    by_id: dict[int, list[Met]] = {}
    for move in known(program):
        if move.is_cut and move.length > 0.0:
            by_id[id(move)] = material.meet(move, radius, stations(move, step_mm, radius), layers)
        material.sweep(move, radius)
    out = []
    for moves in runs(program):
        s, owner, arcs = [], [], []
        at = 0.0
        for k, move in enumerate(moves):
            for met in by_id[id(move)]:
                s.append(at + met.s_mm)
                owner.append(k)
                arcs.append(met.arcs)
            at += move.length
        first = np.array([True, *(np.diff(owner) > 0)])
        out.append(Run(moves, np.array(s), np.array(owner), first, arcs))
    return out


@dataclass(frozen=True)
class Travel:
    """Feed of a run at its stations and the time at which each is reached."""

    feed: Array
    time: Array


def commanded(run: Run, emitted: list[Move]) -> Travel:
    """F of the emitted block at each station of the original run, the larger one at a border."""
    ends = np.cumsum([move.length for move in emitted])
    feeds = np.array([move.feed for move in emitted])
    s = run.s_mm * ends[-1] / run.length
    eps = 2e-3
    first = np.clip(np.searchsorted(ends, s - eps), 0, len(ends) - 1)
    last = np.clip(np.searchsorted(ends, s + eps), 0, len(ends) - 1)
    # At a vertex of the original the block before and behind see their own engagement.
    vertex = np.concatenate([[0.0], np.cumsum([move.length for move in run.moves])]) * ends[-1] / run.length
    ahead = np.isclose(s, vertex[run.move], atol=eps)
    behind = np.isclose(s, vertex[run.move + 1], atol=eps)
    feed = np.maximum(np.where(ahead, feeds[last], feeds[first]), np.where(behind, feeds[first], feeds[last]))
    times = np.concatenate([[0.0], np.cumsum([move.length / move.feed * 60.0 for move in emitted])])
    return Travel(feed, np.interp(s, np.concatenate([[0.0], ends]), times))


def travelled(
    run: Run, emitted: list[Move], *, window_s: float, period_s: float, samples: int, block_end: BlockEnd
) -> Travel:
    """Feed behind a moving average of the set-points, as travel over one tooth."""
    places = play(emitted, period_s=period_s, block_end=block_end, acceleration_samples=samples)
    begin = starts(emitted)[0]
    ways = [
        Move("line", m.line, np.array([a, 0, 0]), np.array([a + m.length, 0, 0]), np.array([m.length, 0, 0]), m.feed)
        for m, a in zip(emitted, np.cumsum([0.0, *(m.length for m in emitted[:-1])]), strict=True)
    ]
    way = play(ways, period_s=period_s, block_end=block_end, acceleration_samples=samples)[:, 0]
    assert np.allclose(places[0], begin)
    # Ticks on which nothing moves (the end of the average) would be no function of the way.
    time = np.arange(len(way)) * period_s
    fine = np.arange(0.0, time[-1] + 1e-12, min(period_s, window_s) / 2.0)
    ends = np.stack([np.interp(fine, time, places[:, k]) for k in range(2)], axis=1)
    begins = np.stack([np.interp(fine - window_s, time, places[:, k]) for k in range(2)], axis=1)
    speed = np.hypot(*(ends - begins).T) / window_s * 60.0
    at = np.interp(fine, time, way)
    order = np.flatnonzero(np.concatenate([[True], np.diff(at) > 0.0]))
    s = np.clip(run.s_mm * at[-1] / run.length, 0.0, at[-1])
    return Travel(np.interp(s, at[order], speed[order]), np.interp(s, at[order], fine[order]))


class Forces:
    """Figures at arcs and feeds; equal arcs are computed once."""

    def __init__(self, mill: EndMill) -> None:
        self._mill = mill
        self._cuts: dict[Key, Cut] = {}
        self._known: dict[tuple[Key, int], Figures] = {}

    def at(self, arcs: Arcs, feed: float) -> Figures:
        """At one place."""
        key = tuple(tuple(round(value * 500.0) for value in arc) for arc in arcs)
        asked = (key, round(feed * 10.0))
        if asked not in self._known:
            if key not in self._cuts:
                self._cuts[key] = Cut(self._mill, arcs)
            self._known[asked] = self._cuts[key].figures(feed)
        return self._known[asked]

    def along(self, run: Run, feed: Array) -> dict[str, Array]:
        """Columns of figures at the stations of a run."""
        rows = [self.at(arcs, f) for arcs, f in zip(run.arcs, feed, strict=True)]
        return {name: np.array([getattr(row, name) for row in rows]) for name in Figures.__dataclass_fields__}


def beside_mm(original: list[Move], emitted: list[Move], per_block: int = 9) -> float:
    """Largest distance of the emitted path from the original."""
    worst = 0.0
    at = 0.0
    ends = np.cumsum([move.length for move in original])
    for move in emitted:
        points = move.points(np.linspace(0.0, 1.0, per_block))
        low = max(int(np.searchsorted(ends, at - 0.5)), 0)
        high = min(int(np.searchsorted(ends, at + move.length + 0.5)), len(original) - 1)
        worst = max(worst, float(distances_from_polyline(points, path_polyline(original[low : high + 1])).max()))
        at += move.length
    return worst


_MOVED = re.compile(r"(?:G0?[123](?![0-9.])|[XYZIJKRF][+-]?[0-9.]+|\s)")


def rest_of(text: str) -> list[str]:
    """What is left of each line without words of motion, place and feed; lines of nothing else left out."""
    out = []
    for line in text.split("\n"):
        comments = re.findall(r"\([^)]*\)", line)
        left = _MOVED.sub("", re.sub(r"\([^)]*\)", "", line)) + "".join(comments)
        if left:
            out.append(left)
    return out
