"""Which lines of LinuxCNC's INI file a shaped program needs, and why: by which rule its planner slows its blocks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Literal

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.machine_model import fanuc_model

RAMP_FREQUENCY_HZ = 10_000.0
"""At which no block that is written is a ramp."""
_CORNER_RAD = 0.1  # a turn of the path itself, at which LinuxCNC blends or stops
_MOST_KINK_RATIO = 0.7  # LinuxCNC takes 0.7071 for more
_KINK_MARGIN = 1.25
_STEPS = 20.0  # of a kink ratio of 1


def ini_lines(
    paths: Iterable[_core.Path], machine: Machine
) -> Iterator[tuple[Literal["kink_ratio", "ramp_frequency"], int, str]]:
    """What to set, as its key, the line where it matters most, and a sentence; nothing for another control."""
    if machine.controller.kind != "linuxcnc":
        return
    model = fanuc_model(machine)
    rules = model.planner
    found = [_core.linuxcnc_slowing(path, model.limits, rules, _CORNER_RAD) for path in paths]
    blocks = sum(each.segments for each in found)
    if kinks := sum(each.kinks for each in found):
        worst = max(found, key=lambda each: each.largest_ratio)
        ratio = min(_MOST_KINK_RATIO, math.ceil(worst.largest_ratio * _KINK_MARGIN * _STEPS) / _STEPS)
        more = "" if worst.largest_ratio < _MOST_KINK_RATIO else ", the most that it takes"
        yield "kink_ratio", worst.line, (
            f"LinuxCNC slows where {kinks} of {blocks} shaped blocks meet: {worst.speed_mm_per_s:.0f} mm/s turn by "
            f"{worst.angle_rad * 1e3:.2f} mrad within {rules.period_s * 1e3:g} ms, {worst.largest_ratio:.2f} of the "
            f"acceleration, and {rules.kink_ratio:g} is allowed; INI file: [TRAJ] ARC_BLEND_KINK_RATIO = "
            f"{ratio:g}{more}"
        )  # fmt: skip
    if ramps := sum(each.ramps for each in found):
        yield "ramp_frequency", 0, (
            f"LinuxCNC stretches {ramps} of {blocks} shaped blocks, as it makes the speed a ramp over each that takes "
            f"less than {1e3 / rules.ramp_frequency_hz:g} ms; INI file: [TRAJ] ARC_BLEND_RAMP_FREQ = "
            f"{RAMP_FREQUENCY_HZ:.0f}, and it is {rules.ramp_frequency_hz:g}"
        )  # fmt: skip
