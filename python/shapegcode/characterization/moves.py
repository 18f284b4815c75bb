"""Single moves in a servo log: steps of the command, times and shapes of the moves.

A move between rests is a smoothed rectangle of speed, in closed form; time constants are fitted to all moves of a part.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from shapegcode.characterization.air_tests import AXES, AirTest, Part
from shapegcode.errors import ArgumentError
from shapegcode.io.servo_log import ServoLog
from shapegcode.io.units import FloatArray

_HOLD_SHARE, _BEND_SHARE, _LONGEST_HOLD = 0.9, 0.85, 64


def held_samples(log: ServoLog) -> tuple[int, int]:
    """Samples for which each command is held, and index of the first sample with a new one; (1, 0): not held."""
    command = np.nan_to_num(log.command_mm)
    increments = np.diff(command, axis=0)
    noise = np.maximum(command[: max(3, round(0.1 / log.sampling_s))].std(axis=0), 5e-4)
    increments = np.where(np.abs(increments) > 8.0 * noise, increments, 0.0)
    energy = (increments**2).sum(axis=1)
    total, best = float(energy.sum()), (1, 0)
    for count in range(2, _LONGEST_HOLD + 1) if total > 0.0 else ():
        sums = np.array([energy[first::count].sum() for first in range(count)])
        first = int(sums.argmax())
        if sums[first] > _HOLD_SHARE * total:
            best = (count, (first + 1) % count)
    return best


@dataclass(frozen=True)
class _Bends:
    """How well the speed changes of a command repeat every few samples, each at a sample or between two neighbours."""

    share: float  # fraction of all curvature
    first: int  # index of the first such sample
    fraction: float  # position of the bend between the two samples, 0 to 1
    energy: float  # total curvature above the noise


def _bends(log: ServoLog, count: int) -> _Bends:
    energy = (np.diff(np.nan_to_num(log.command_mm), 2, axis=0) ** 2).sum(axis=1)
    energy = energy - energy[: max(3, round(0.1 / log.sampling_s))].mean()
    sums = np.array([energy[k::count].sum() for k in range(count)])
    pairs = sums + np.roll(sums, -1)
    k = int(pairs.argmax())
    total = float(sums.sum())
    one, two = (math.sqrt(max(float(each), 0.0)) for each in (sums[k], np.roll(sums, -1)[k]))
    share = float(pairs[k]) / total if total > 0.0 else 0.0
    return _Bends(share, (k + 1) % count, two / (one + two) if one + two > 0.0 else 0.0, max(total, 0.0))


def bend_samples(logs: Sequence[ServoLog]) -> int:
    """Number of samples between speed changes of an interpolated command, 3 or more; 1: none found."""
    best = 1
    for count in range(3, _LONGEST_HOLD // 2):
        every = [_bends(log, count) for log in logs]
        total = sum(each.energy for each in every)
        # A divisor of the true count also contains all bends: use the largest.
        if total > 0.0 and sum(each.share * each.energy for each in every) > _BEND_SHARE * total:
            best = count
    return best


def ticks(log: ServoLog, bend: int) -> tuple[FloatArray, FloatArray]:
    """Times and positions: one per interpolation period if the log shows it, else one per sample."""
    count, first = held_samples(log)
    if count == 1 and bend > 1:
        found = _bends(log, bend)
        before = np.arange(found.first, len(log.times_s) - 2, bend)
        before = before[before > 0]
        times = log.times_s[before] + found.fraction * log.sampling_s
        x = log.command_mm
        # The straight lines on both sides meet at the bend.
        left = x[before] + found.fraction * (x[before] - x[before - 1])
        right = x[before + 1] - (1.0 - found.fraction) * (x[before + 2] - x[before + 1])
        return times, (left + right) / 2.0
    if count == 1:
        return log.times_s, log.command_mm
    n = (len(log.times_s) - first) // count
    times = log.times_s[first : first + n * count : count]
    held = log.command_mm[first : first + n * count].reshape(n, count, 3)
    return times, held.mean(axis=1)


_PAUSE_S = 0.3  # rests within a part are shorter, the pause between two parts is 0.5 s
_SHORTEST_BOX_S, _STAMP, _MAX_SAMPLES = 2e-5, 0.03, 1500


@dataclass(frozen=True)
class PartLog:
    """The samples of one part."""

    part: Part
    times_s: FloatArray
    travel_mm: FloatArray  # travel of the part's axis from its start, in the direction of the first move
    noise_mm: float  # standard deviation of a sample at rest

    def middles_s(self) -> FloatArray:
        """Times at which a back-and-forth part passes the middle of its travel, (n,)."""
        length = abs(self.part.length_mm) * self.part.stride
        u = self.travel_mm / length - 0.5
        # hysteresis, so that noise at the middle is not counted twice
        state = np.where(u > 0.2, 1, np.where(u < -0.2, -1, 0))
        known = np.flatnonzero(state)
        turns = np.flatnonzero(np.diff(state[known])) if len(known) else np.array([], dtype=int)
        middles = []
        for i, j in zip(known[turns], known[turns + 1], strict=True):
            times, shares = self.times_s[i : j + 1], u[i : j + 1]
            slope, offset = np.polyfit(times - times[0], shares, 1)
            middles.append(times[0] - offset / slope)
        return np.array(middles)

    def pitch_s(self) -> tuple[float, float]:
        """Mean time from one move to the next, and its 95 % half-width."""
        steps = np.diff(self.middles_s())
        spread = float(steps.std(ddof=1)) if len(steps) > 1 else 0.001
        return float(steps.mean()), 1.96 * max(spread, 2e-5) / math.sqrt(len(steps))


def parts_of(log: ServoLog, test: AirTest, bend: int = 1) -> list[PartLog]:
    """Split a log into the parts of its test."""
    wanted = [part for part in test.parts if part.pattern != "pause"]
    for part in wanted:
        if np.isnan(log.command_mm[0, AXES.index(part.axis)]):
            raise ArgumentError(f"{log.file}: no commanded position of {part.axis}, which test {test.name} needs")
    times, positions = ticks(log, bend)
    used = sorted({AXES.index(part.axis) for part in wanted})
    points = positions[:, used]
    start = points[: max(3, int(0.1 / (times[1] - times[0])))]
    noise = np.maximum(start.std(axis=0), 8e-4)
    reach = max(1, round(0.024 / float(np.median(np.diff(times)))))
    moved = np.abs(points[reach:] - points[:-reach]).max(axis=1) > max(9.0 * float(noise.max()), 0.004)
    rows = np.flatnonzero(moved)
    if not len(rows):
        raise ArgumentError(f"{log.file}: no motion, so this is not a log of test {test.name}")
    motions = np.split(rows, np.flatnonzero(np.diff(times[rows]) > _PAUSE_S) + 1)
    if len(motions) != len(wanted):
        raise ArgumentError(
            f"{log.file}: {len(motions)} motions with rests of {_PAUSE_S:g} s between them; test "
            f"{test.name} has {len(wanted)}"
        )
    out = []
    margin = max(2, round(0.05 / float(np.median(np.diff(times)))))
    for part, motion in zip(wanted, motions, strict=True):
        first = int(motion[0])
        low, high = max(0, first - margin), min(len(times), int(motion[-1]) + reach + margin)
        axis = AXES.index(part.axis)
        rest = positions[low : max(low + 2, first), axis]
        travel = (positions[low:high, axis] - rest.mean()) * math.copysign(1.0, part.length_mm)
        spread = float(noise[used.index(axis)])
        out.append(PartLog(part, times[low:high], travel, spread))
        moved, expected = travel.max() - travel.min(), abs(part.length_mm) * part.stride
        # Smoothing shortens a reversal without stop.
        least = 0.98 if part.pattern in ("dwell", "exact", "rapid") else 0.5
        if not least * expected < moved < 1.02 * expected + 10.0 * spread:
            raise ArgumentError(
                f"{log.file}: {part.axis} moves over {moved:.3f} mm in part {len(out)}, test {test.name} has "
                f"{expected:.3f} mm there: wrong log, units or scale"
            )
    return out


def smoothed_share(times: FloatArray, boxes: Sequence[float] | FloatArray) -> FloatArray:
    """Fraction of the travel over time: a rectangle of speed, then moving averages; *boxes*: durations of these, s."""
    used = [float(box) for box in boxes if box > _SHORTEST_BOX_S]
    power, out = len(used), np.zeros_like(times)
    if not power:
        return np.asarray(np.where(times > 0.0, 1.0, 0.0))
    for chosen in itertools.product((0, 1), repeat=power):
        lag = sum(itertools.compress(used, chosen))
        out += (-1.0) ** sum(chosen) * np.maximum(times - lag, 0.0) ** power
    return np.asarray(out / (math.factorial(power) * math.prod(used)))


def lagged_share(times: FloatArray, values: FloatArray) -> FloatArray:
    """Fraction of the travel over time: rectangle of speed, then first-order lag; *values*: their times, s."""
    rectangle_s, lag_s = values

    def ramp(t: FloatArray) -> FloatArray:
        late = np.maximum(t, 0.0)
        return np.asarray(late + lag_s * np.expm1(-late / lag_s))

    return np.asarray((ramp(times) - ramp(times - rectangle_s)) / rectangle_s)


@dataclass(frozen=True)
class ShapeFit:
    """A curve fitted to the moves of a part."""

    values: FloatArray  # the fitted parameters, without the start
    half: FloatArray  # half-widths of their 95 % intervals
    rms_mm: float  # RMS residual


def fit_shape(
    log: PartLog, share: Callable[[FloatArray, FloatArray], FloatArray], guess: Sequence[float],
    ends: tuple[Sequence[float], Sequence[float]],
) -> ShapeFit:  # fmt: skip
    """Fit one curve to all moves of a back-and-forth part, superimposed at their middles; *ends*: lowest, highest."""
    middles = log.middles_s()
    length = abs(log.part.length_mm)
    pieces_t, pieces_y = [], []
    edges = [log.times_s[0], *((middles[1:] + middles[:-1]) / 2.0), log.times_s[-1]]
    for k, middle in enumerate(middles):
        inside = (log.times_s >= edges[k]) & (log.times_s <= edges[k + 1])
        travel = log.travel_mm[inside] / length
        pieces_t.append(log.times_s[inside] - middle)
        pieces_y.append(travel if k % 2 == 0 else 1.0 - travel)
    t, y = np.concatenate(pieces_t), np.concatenate(pieces_y)
    every = -(-len(t) // _MAX_SAMPLES)
    t, y = t[::every], y[::every]

    def residual(p: FloatArray) -> FloatArray:
        return np.asarray((share(t - p[-1], p[:-1]) - y) * length)

    grid = np.linspace(0.0, 2.0, 20001)
    middle = float(grid[np.searchsorted(share(grid, np.array(guess)), 0.5)])
    begin = np.array([*guess, -middle])
    bounds = [*ends[0], -2.0], [*ends[1], 2.0]
    found = least_squares(residual, begin, bounds=bounds, x_scale=np.maximum(np.abs(begin), 1e-3), max_nfev=60)
    n = len(guess)
    variance = float(found.fun @ found.fun) / max(1, len(t) - len(begin))
    jacobian = np.asarray(found.jac)
    covariance = variance * np.linalg.pinv(jacobian.T @ jacobian)
    # Time stamps are accurate to a fraction of the sampling time, however many samples agree.
    stamp = _STAMP * float(np.median(np.diff(log.times_s)))
    half = np.hypot(1.96 * np.sqrt(np.maximum(np.diag(covariance)[:n], 0.0)), stamp)
    return ShapeFit(found.x[:n], half, math.sqrt(variance))


def line_slope(log: PartLog, settle_s: float) -> tuple[float, float] | None:
    """Mean speed in mm/s of the outward travel, and its 95 % half-width; None if too little is steady."""
    top = int(np.argmax(log.travel_mm))
    begin = int(np.argmax(log.travel_mm > max(8.0 * log.noise_mm, 0.003)))
    first, last = log.times_s[begin] + settle_s, log.times_s[top] - settle_s
    inside = (log.times_s > first) & (log.times_s < last)
    if last - first < 0.15 * (log.times_s[top] - log.times_s[begin]) or inside.sum() < 20:
        return None
    x = log.times_s[inside] - log.times_s[inside].mean()
    y = log.travel_mm[inside]
    slope = float(x @ (y - y.mean()) / (x @ x))
    rest = y - y.mean() - slope * x
    # Block ripple is not white: it may tilt the line by its own height over the line's length.
    sigma = math.sqrt(float(rest @ rest) / max(1, len(x) - 2) / float(x @ x))
    return slope, 1.96 * sigma + float(rest.std()) / float(np.ptp(x)) * 0.5
