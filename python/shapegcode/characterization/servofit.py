"""What servo logs with actual positions say about the position loop."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from shapegcode.characterization.facts import Facts
from shapegcode.characterization.hold import held_samples
from shapegcode.characterization.plan import AXES
from shapegcode.identification.servo.models import lag_way
from shapegcode.io.servo_log import ServoLog

Array = npt.NDArray[np.float64]
_SERVO_SLACK = 0.02
_GAINS = (2.0, 1000.0)  # 1/s


def fit_servo(facts: Facts, logs: Mapping[str, ServoLog]) -> None:
    """Position gain K and feed-forward f: e = −K ∫e dt + (1 − f) x + c, fitted to following error e and command x."""
    done = False
    for index, axis in enumerate(AXES):
        records = [each for log in logs.values() if (each := _servo_rows(log, index)) is not None]
        if not records:
            continue
        done = True
        name = f"position gain {axis}"
        gain, rest = _lag_of(records)
        if rest < 0.02 or not 2.0 * _GAINS[0] < gain < 0.5 * _GAINS[1]:
            facts.unknown(name, "the actual position follows the command without a lag that tells it", "1/s")
            continue
        spread = np.std(np.array([_lag_of([record]) for record in records]), axis=0) / math.sqrt(len(records))
        # Command and actual position may be sampled up to half a sample apart, which looks like lag.
        apart = 0.5 * min(log.sampling_s for log in logs.values()) * gain
        half = float(spread[0]) + (_SERVO_SLACK + apart / rest) * gain
        facts.known(name, gain, half, f"controller.position_gain_per_s.{axis.lower()}", unit="1/s")
        half = float(spread[1]) + _SERVO_SLACK + apart
        key = f"controller.feed_forward_ratio.{axis.lower()}"
        facts.known(f"feed-forward {axis}", max(0.0, 1.0 - rest), half, key, unit="1")
    if not done:
        facts.unknown("position gain", "no actual positions in the logs", "1/s")


def _servo_rows(log: ServoLog, index: int) -> tuple[Array, Array, float] | None:
    """Command, following error and time step, one row for each held command so that its stairs are no error."""
    if log.actual_mm is None or np.isnan(log.actual_mm[0, index]) or np.isnan(log.command_mm[0, index]):
        return None
    count, first = held_samples(log)
    n = (len(log.times_s) - first) // count

    def rows(values: Array) -> Array:
        return np.asarray(values[first : first + n * count].reshape(n, count).mean(axis=1))

    way = rows(log.command_mm[:, index] - log.command_mm[0, index])
    if np.ptp(way) < 1.0:
        return None
    error = way - rows(log.actual_mm[:, index] - log.actual_mm[0, index])
    step = count * log.sampling_s
    return way, error - np.median(error[: max(3, round(0.1 / step))]), step


def _lag_of(records: list[tuple[Array, Array, float]]) -> tuple[float, float]:
    """Position gain in 1/s and what feed-forward leaves (1 − f), from all records: least squares of the error."""
    from scipy.optimize import minimize_scalar

    def solve(gain: float) -> tuple[float, float]:
        cross = square = power = 0.0
        for way, error, step in records:
            model = lag_way(way, gain, step)
            cross += float(model @ error)
            square += float(model @ model)
            power += float(error @ error)
        rest = cross / square
        return power - rest * cross, rest

    found = minimize_scalar(
        lambda log_gain: solve(math.exp(log_gain))[0], bounds=tuple(np.log(_GAINS)), method="bounded"
    )
    gain = math.exp(float(found.x))
    return gain, float(solve(gain)[1])
