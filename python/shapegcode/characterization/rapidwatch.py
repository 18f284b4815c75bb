"""Rapids by the stopwatch: every time constant is tried, and what then is left is bell time and in-position time."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from shapegcode.characterization.facts import Facts
from shapegcode.characterization.plan import AirTest
from shapegcode.characterization.timing import NO_PERIOD_S, ControllerTiming, part_time_s

__all__ = ["TimedTest", "fit_timed_rapids"]

Array = npt.NDArray[np.float64]
_WIDE = 0.5  # of the value: an interval of so much either way determines nothing
_CONTRADICTS = 4.0  # standard deviations
_RAMPS_S = np.arange(0.005, 1.0, 0.00025)
_INSIDE = 3.84  # chi² of a 95 % interval of one parameter
_WAIT_UNKNOWN_S = 0.1


@dataclass(frozen=True)
class TimedTest:
    """A test that was timed.

    Attributes:
        test: what it does.
        time_s: mean of the readings.
        sigma_s: its standard deviation.
    """

    test: AirTest
    time_s: float
    sigma_s: float


def fit_timed_rapids(
    facts: Facts,
    axis: str,
    timed: list[TimedTest],
    period: float | None,
    overhead: tuple[float, float],
    wait: tuple[float, float],
) -> str:
    """Time constant and bell time of an axis' rapids."""
    names = (f"rapid time constant {axis}", f"rapid bell time {axis}")
    if len(timed) < 2:
        for name in names:
            facts.unknown(name, f"needs two of the rapid_{axis.lower()} tests or more")
        return ""
    parts = [each.test.parts[0] for each in timed]
    count = np.array([part.count for part in parts])
    sigma = np.hypot([each.sigma_s for each in timed], overhead[1] / 1.96) / count
    if period is None:
        sigma = np.hypot(sigma, 0.002)
    weight = 1.0 / sigma**2
    seen = (np.array([each.time_s for each in timed]) - overhead[0]) / count
    # After a rapid comes at least the in-position wait, if that is known.
    least = max(0.0, wait[0] - wait[1]) if wait[1] < _WAIT_UNKNOWN_S else 0.0
    chi2, after = np.empty(len(_RAMPS_S)), np.empty(len(_RAMPS_S))
    zero = {axis: 0.0}
    for k, ramp in enumerate(_RAMPS_S):
        timing = ControllerTiming(period or NO_PERIOD_S, "ceil", 0.0, 0.0, {axis: float(ramp)}, zero, zero)
        moving = np.array([part_time_s(replace(part, count=1), timing) for part in parts])
        after[k] = max(least, float(weight @ (seen - moving)) / float(weight.sum()))
        chi2[k] = float((((seen - moving - after[k]) / sigma) ** 2).sum())
    floor = float(chi2.min())
    if floor > _CONTRADICTS**2 + 3.0 * len(timed):
        for name in names:
            facts.unknown(name, "the times contradict each other")
        tests = ", ".join(each.test.name for each in timed)
        return (
            f"{tests}: no time constant gives these times (chi² {floor:.0f}); is the rapid rate of the machine file "
            "right, and the rapid override 100 %?"
        )
    inside = chi2 <= floor + _INSIDE
    likely = np.exp(-0.5 * (chi2[inside] - floor))
    _ramp(facts, axis, _RAMPS_S[inside], likely)
    sums = after[inside]
    slack = math.hypot(wait[1], 1.96 / math.sqrt(float(weight.sum())))
    ends = float(sums.min()) - wait[0] - slack, float(sums.max()) - wait[0] + slack
    _bell(facts, axis, float(likely @ sums / likely.sum()), wait, ends, slack)
    return ""


def _ramp(facts: Facts, axis: str, ramps: Array, likely: Array) -> None:
    """The time constant: mean and ends of those that fit."""
    name = f"rapid time constant {axis}"
    step = float(_RAMPS_S[1] - _RAMPS_S[0])
    low, high = float(ramps.min()) - step, float(ramps.max()) + step
    value = float(likely @ ramps / likely.sum())
    if high - low > 2.0 * _WIDE * value:
        why = f"from {low * 1e3:.0f} to {high * 1e3:.0f} ms all fit; longer moves would tell more"
        facts.unknown(name, why, high=high)
    else:
        facts.between(name, value, low, high, f"controller.rapid_time_constant_s.{axis.lower()}")


def _bell(
    facts: Facts, axis: str, total: float, wait: tuple[float, float], ends: tuple[float, float], slack: float
) -> None:
    """The bell time is what comes after the motion, without the wait for in-position."""
    name, key = f"rapid bell time {axis}", f"controller.rapid_bell_time_s.{axis.lower()}"
    low, high = ends
    bell = total - wait[0]
    if wait[1] > _WAIT_UNKNOWN_S:
        why = f"needs exact_{axis.lower()}: rapids alone show bell and in-position time together, {total * 1e3:.1f} ms"
        facts.unknown(name, why, high=total)
    elif low <= 0.0 and high > 2.0 * slack + 0.02:
        facts.unknown(name, f"anything up to {high * 1e3:.0f} ms fits", high=high)
    elif low <= 0.0:
        facts.between(name, 0.0, 0.0, max(high, 0.0), key, "none, or below the upper end")
    elif high - low > 2.0 * _WIDE * bell:
        facts.unknown(name, f"from {low * 1e3:.0f} to {high * 1e3:.0f} ms all fit", high=high)
    else:
        facts.between(name, bell, low, high, key, "if rapids and exact stops wait equally long for in-position")
