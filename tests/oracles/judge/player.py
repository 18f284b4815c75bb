"""Plays cutting blocks back as set-points, each at its own constant feed: a control without look-ahead."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from .records import Move

Vector = npt.NDArray[np.float64]
BlockEnd = Literal["ceil", "carry"]
_SECONDS_PER_MINUTE = 60.0
#: Ticks by which a block may overrun one and still end on it: dust of doubles at large coordinates (1 ns at 1 ms).
_TICK_DUST = 1e-6


def starts(moves: Sequence[Move]) -> Vector:
    """Start position of every move, shape (n, 3), chained from the first one by the displacements.

    An axis that is unknown at the first move counts from 0 until a move starts from a known position; so
    programs in G91 from an unknown origin can be simulated. Raises ValueError where a displacement is unknown.
    """
    out = np.zeros((len(moves), 3))
    at = np.zeros(3)
    for i, move in enumerate(moves):
        at = np.where(np.isnan(move.start), at, move.start)
        out[i] = at
        if np.isnan(move.delta).any():
            raise ValueError(f"line {move.line}: displacement {move.delta} is not known")
        at = at + move.delta
    return out


def _speeds(moves: Sequence[Move], override: float) -> list[float]:
    speeds = []
    for move in moves:
        if move.kind == "rapid":
            raise ValueError(f"line {move.line}: a rapid has no programmed feed; play cutting blocks only")
        speed = move.feed * override / _SECONDS_PER_MINUTE
        if not speed > 0.0 or math.isinf(speed):
            raise ValueError(f"line {move.line}: feed {move.feed} mm/min times {override} cannot be simulated")
        speeds.append(speed)
    return speeds


def durations(
    moves: Sequence[Move], *, period_s: float = 0.001, block_end: BlockEnd = "ceil", override: float = 1.0
) -> Vector:
    """Duration of every block in s: length/feed, rounded up to whole periods if `block_end` is "ceil"."""
    if block_end not in ("ceil", "carry"):
        raise ValueError(f"block_end must be 'ceil' or 'carry', not {block_end!r}")
    out = np.zeros(len(moves))
    for i, (move, speed) in enumerate(zip(moves, _speeds(moves, override), strict=True)):
        ticks = move.length / (speed * period_s)
        out[i] = math.ceil(ticks - _TICK_DUST) * period_s if block_end == "ceil" else ticks * period_s
    return out


def play(
    moves: Sequence[Move],
    *,
    period_s: float = 0.001,
    block_end: BlockEnd = "ceil",
    override: float = 1.0,
    acceleration_samples: int = 0,
) -> Vector:
    """Set-points of a run of cutting blocks, shape (n, 3), mm, one row per period from the start on.

    "ceil": every block starts on a tick, moves feed × period per tick and has its remainder in its last tick.
    "carry": time runs on from block to block; the path is sampled once per period. `acceleration_samples` is
    the length of a moving average on every axis (linear acceleration after interpolation); 0 or 1 means none.
    """
    begin = starts(moves)
    speeds = _speeds(moves, override)
    times = durations(moves, period_s=period_s, block_end=block_end, override=override)
    rows: list[Vector] = [begin[:1].copy()] if len(moves) else [np.zeros((0, 3))]
    if block_end == "ceil":
        for move, at, speed, time in zip(moves, begin, speeds, times, strict=True):
            ticks = round(time / period_s)
            if ticks == 0:
                continue
            travelled = np.minimum(np.arange(1, ticks + 1) * speed * period_s, move.length)
            travelled[-1] = move.length
            rows.append(at + move.offsets(travelled / move.length))
    else:
        border = np.concatenate([[0.0], np.cumsum(times)])
        ticks = math.ceil(border[-1] / period_s - _TICK_DUST)
        clock = np.minimum(np.arange(1, ticks + 1) * period_s, border[-1])
        owner = np.clip(np.searchsorted(border, clock, side="left") - 1, 0, max(len(moves) - 1, 0))
        for i in np.unique(owner):
            inside = clock[owner == i]
            rows.append(begin[i] + moves[i].offsets(np.clip((inside - border[i]) / times[i], 0.0, 1.0)))
    return moving_average(np.concatenate(rows), acceleration_samples)


def moving_average(points: Vector, samples: int) -> Vector:
    """Mean of the last `samples` rows, at rest before and after: `samples` − 1 rows are added at the end."""
    if samples < 0:
        raise ValueError(f"a moving average of {samples} samples does not exist")
    if samples <= 1 or len(points) == 0:
        return points
    before = np.repeat(points[:1], samples - 1, axis=0)
    after = np.repeat(points[-1:], samples - 1, axis=0)
    # Sums of displacements, so that the end is the end to the last digit but one.
    held = np.concatenate([before, points, after]) - points[0]
    window = np.lib.stride_tricks.sliding_window_view(held, samples, axis=0)
    return np.asarray(window.mean(axis=-1) + points[0])
