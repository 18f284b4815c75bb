"""How long a part lasts on a controller that smooths after interpolation: the one place of these formulas.

Source: C.-Y. Lee, S.-K. Ro, C. K. Song, J. S. Oh: Cycle Time Estimation of Block Overlap Based CNC, J. Korean Soc.
Precis. Eng. 39(7), 2022 (paper 004), equations 2 to 16; the in-position wait follows a rapid and an exact stop.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from shapegcode.characterization.plan import AXES, AirTest, BlockEnd, Part

if TYPE_CHECKING:
    from shapegcode.machine import Machine

__all__ = ["NO_PERIOD_S", "ControllerTiming", "part_time_s", "program_time_s", "whole_periods"]

NO_PERIOD_S = 1e-6
"""An interpolation period so short that nothing is rounded."""

_TICK_DUST = 1e-6  # periods: the dust of doubles


@dataclass(frozen=True)
class ControllerTiming:
    """The facts of a controller that decide how long a test lasts; times in s.

    Attributes:
        period_s: interpolation period.
        block_end: what becomes of the rest of a period at the end of a block.
        block_time_s: shortest time in which a block is taken in.
        cutting_s: from the end of a cutting command to rest: time constant and bell time.
        rapid_s: time constant of a rapid, by axis.
        rapid_bell_s: bell time of a rapid, by axis.
        in_position_s: wait after a rapid or an exact stop, by axis.
        overhead_s: what the stopwatch sees besides the program.
    """

    period_s: float
    block_end: BlockEnd
    block_time_s: float
    cutting_s: float
    rapid_s: Mapping[str, float] = field(default_factory=dict)
    rapid_bell_s: Mapping[str, float] = field(default_factory=dict)
    in_position_s: Mapping[str, float] = field(default_factory=dict)
    overhead_s: float = 0.0

    @classmethod
    def of(cls, machine: Machine) -> ControllerTiming:
        """What a machine file says."""
        control = machine.controller

        def by_axis(value: object) -> dict[str, float]:
            get = getattr(value, "as_tuple", None)
            values = get() if get is not None else (value,) * 3
            return dict(zip(AXES, values, strict=True))

        return cls(
            control.interpolation_period_s,
            control.block_end,
            control.block_time_s,
            control.time_constant_s + control.bell_time_s,
            by_axis(control.rapid_time_constant_s),
            by_axis(control.rapid_bell_time_s),
            by_axis(control.in_position_s),
        )


def whole_periods(duration_s: float, period_s: float) -> float:
    """A duration rounded up to whole interpolation periods, in s."""
    return math.ceil(duration_s / period_s - _TICK_DUST) * period_s


def _rapid_s(part: Part, timing: ControllerTiming) -> float:
    ramp = timing.rapid_s[part.axis]
    nominal = part.duration_s
    if nominal >= ramp:
        moving = whole_periods(nominal, timing.period_s) + ramp
    else:
        # acceleration = rate / time constant; half the way up, half the way down
        moving = 2.0 * whole_periods(math.sqrt(nominal * ramp), timing.period_s)
    return moving + timing.rapid_bell_s[part.axis] + timing.in_position_s[part.axis]


def part_time_s(part: Part, timing: ControllerTiming, override: float = 1.0) -> float:
    """Duration of one part in s."""
    if part.pattern == "pause":
        return part.dwell_s
    if part.pattern == "rapid":
        return part.count * _rapid_s(part, timing)
    feeds = (1.0, 0.5) if part.pattern == "feed_steps" else (1.0,)
    mean = 0.0
    for feed in feeds:
        nominal = part.duration_s / (feed * override)
        if part.pattern in ("dwell", "exact"):
            block = whole_periods(nominal, timing.period_s)
        else:
            block = whole_periods(nominal, timing.period_s) if timing.block_end == "ceil" else nominal
            block = max(block, timing.block_time_s)
        mean += block / len(feeds)
    if part.pattern == "dwell":
        return part.count * (mean + timing.cutting_s + part.dwell_s)
    if part.pattern == "exact":
        return part.count * (mean + timing.cutting_s + timing.in_position_s[part.axis])
    return part.count * mean + timing.cutting_s


def program_time_s(test: AirTest, timing: ControllerTiming) -> float:
    """Duration of a test in s, with the operator's overhead."""
    override = test.override_percent / 100.0
    return timing.overhead_s + sum(part_time_s(part, timing, override) for part in test.parts)
