"""When a recorded command changes: over how many samples it is held, or bent, and its places in between."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode.io.servo_log import ServoLog

__all__ = ["bend_samples", "held_samples", "ticks"]

Array = npt.NDArray[np.float64]
_HOLD_SHARE = 0.9
_BEND_SHARE = 0.85
_LONGEST_HOLD = 64


def held_samples(log: ServoLog) -> tuple[int, int]:
    """Over how many samples the command is held, and the index of a first sample; 1 if it is not held.

    A command that changes only once per interpolation period has all its increments there.
    """
    command = np.nan_to_num(log.command_mm)
    increments = np.diff(command, axis=0)
    noise = np.maximum(command[: max(3, round(0.1 / log.sampling_s))].std(axis=0), 5e-4)
    increments = np.where(np.abs(increments) > 8.0 * noise, increments, 0.0)
    energy = (increments**2).sum(axis=1)
    total = float(energy.sum())
    best = (1, 0)
    if total > 0.0:
        for count in range(2, _LONGEST_HOLD + 1):
            sums = np.array([energy[first::count].sum() for first in range(count)])
            first = int(sums.argmax())
            if sums[first] > _HOLD_SHARE * total:
                best = (count, (first + 1) % count)
    return best


@dataclass(frozen=True)
class _Bends:
    """How much of the bending of a command lies at every count-th sample and its successor.

    Attributes:
        share: of all bending.
        first: index of such a sample.
        place: of the bend between the two samples, 0 to 1.
        energy: all bending above the noise.
    """

    share: float
    first: int
    place: float
    energy: float


def _bends(log: ServoLog, count: int) -> _Bends:
    command = np.nan_to_num(log.command_mm)
    bend = np.diff(command, 2, axis=0)
    energy = (bend**2).sum(axis=1)
    rest = max(3, round(0.1 / log.sampling_s))
    energy = energy - energy[:rest].mean()
    sums = np.array([energy[k::count].sum() for k in range(count)])
    pairs = sums + np.roll(sums, -1)
    k = int(pairs.argmax())
    total = float(sums.sum())
    one, two = (math.sqrt(max(float(each), 0.0)) for each in (sums[k], np.roll(sums, -1)[k]))
    share = float(pairs[k]) / total if total > 0.0 else 0.0
    return _Bends(share, (k + 1) % count, two / (one + two) if one + two > 0.0 else 0.0, max(total, 0.0))


def bend_samples(logs: Sequence[ServoLog]) -> int:
    """After how many samples the speed of a command changes that is interpolated between periods; 1: not seen.

    Only periods of three samples or more can be told, and only where the command is not held.
    """
    best = 1
    for count in range(3, _LONGEST_HOLD // 2):
        every = [_bends(log, count) for log in logs]
        total = sum(each.energy for each in every)
        # A divisor of the true count shows all bends too: the largest counts.
        if total > 0.0 and sum(each.share * each.energy for each in every) > _BEND_SHARE * total:
            best = count
    return best


def ticks(log: ServoLog, bend: int) -> tuple[Array, Array]:
    """Times and positions, one for each interpolation period where that shows."""
    count, first = held_samples(log)
    if count == 1 and bend > 1:
        found = _bends(log, bend)
        before = np.arange(found.first, len(log.times_s) - 2, bend)
        before = before[before > 0]
        times = log.times_s[before] + found.place * log.sampling_s
        x = log.command_mm
        # The straight pieces on both sides meet at the bend.
        left = x[before] + found.place * (x[before] - x[before - 1])
        right = x[before + 1] - (1.0 - found.place) * (x[before + 2] - x[before + 1])
        return times, (left + right) / 2.0
    if count == 1:
        return log.times_s, log.command_mm
    n = (len(log.times_s) - first) // count
    times = log.times_s[first : first + n * count : count]
    held = log.command_mm[first : first + n * count].reshape(n, count, 3)
    return times, held.mean(axis=1)
