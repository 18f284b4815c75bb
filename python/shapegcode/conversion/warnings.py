"""Warnings of a conversion that are no misses: figures made worse, and what the control will make of the text."""

from __future__ import annotations

import math
from typing import Any

from shapegcode.conversion.readback import Placed
from shapegcode.machine import Machine
from shapegcode.program import Program, least_increment_mm

__all__ = ["binding_warnings", "controller_warnings", "region_warnings", "worse_warnings"]

# How much worse than the original's a figure must be to be worth a warning: ratio, and size in um.
_WORSE_RATIO, _WORSE_UM = 1.2, 5.0


def worse_warnings(figures: dict[str, Any]) -> list[str]:
    """Figures that the conversion made noticeably worse, within tolerance or not."""
    pairs = [
        (f"{name} {axis.upper()}", figures[key]["original"][axis], figures[key]["emitted"][axis])
        for name, key in (("residual vibration", "residual_vibration_um"), ("peak vibration", "peak_vibration_um"))
        for axis in "xyz"
    ]
    response = figures["contour_error_um"]["response"]
    pairs.append(("contour error of the table", response["original"]["max"], response["emitted"]["max"]))
    return [
        f"{name} is larger than the original's: {before:.1f} -> {after:.1f} um"
        for name, before, after in pairs
        if after > _WORSE_RATIO * before and after - before > _WORSE_UM
    ]


def binding_warnings(figures: dict[str, Any], machine: Machine) -> list[str]:
    """Which tolerance a conversion left, by how much, and what would be feasible; empty where all were kept."""
    tolerance = machine.tolerance
    regions = figures["regions"]
    warnings = []
    contour = max((region["contour_error_um"] for region in regions), default=0.0)
    if contour > tolerance.contour_um:
        rounding = math.sqrt(2.0) * least_increment_mm(machine, 21) * 1e3
        alone = f"; rounding the words alone may take {rounding:.1f} um of it" if rounding > 0.2 * contour else ""
        warnings.append(
            f"tolerance.contour_um = {tolerance.contour_um:g} binds: {contour:.1f} um were reached with the feed "
            f"lowered as far as it helps{alone}; feasible: {_rounded_up(contour):g} um"
        )
    over = [
        (region["residual_vibration_um"]["emitted"][axis], limit)
        for region in regions
        for axis, limit in region["residual_limit_um"].items()
        if region["residual_vibration_um"]["emitted"][axis] > limit
    ]
    if over:
        left, limit = max(over)
        warnings.append(
            f"the tolerance of residual vibration binds: {left:.2f} um are left, limit {limit:.2f} um "
            f"(tolerance.residual_*); feasible: tolerance.residual_floor_um = {_rounded_up(left):g}, "
            "or a longer shaper (`shapegcode shaper`)"
        )
    return warnings


def _rounded_up(value: float) -> float:
    """Two digits, with a margin of 5 %."""
    value *= 1.05
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / step) * step


def region_warnings(program: Program, placed: list[Placed], machine: Machine) -> list[str]:
    """What the control must be told or cannot do: look-ahead mode left on, feeds over the axes' limits."""
    warnings = []
    on = next((place.region for place in placed if place.region.look_ahead_mode), None)
    if on is not None and not machine.emission.prologue:
        warnings.append(
            f"{program.place(on.first_line)}: shaped blocks run while the program's look-ahead mode is on; the "
            'verdict holds for it off: set emission.prologue = ["G05.1Q0"] and emission.epilogue = ["G05.1Q1"]'
        )
    fastest = max(axis.max_feed_mm_per_min for axis in machine.axes.as_tuple())
    fast = next((place.region for place in placed if place.region.path.fastest_feed_mm_per_s * 60.0 > fastest), None)
    if fast is not None:
        warnings.append(
            f"{program.place(fast.first_line)}: programmed feed {fast.path.fastest_feed_mm_per_s * 60.0:g} mm/min is "
            f"over every axis' largest ({fastest:g} mm/min, axes.*.max_feed_mm_per_min): shaped at the axes' limits"
        )
    return warnings


def controller_warnings(machine: Machine, text: bytes, cutting_s: float, blocks: int, slowed_blocks: int) -> list[str]:
    """What the emitted text asks of memory, serial line and look-ahead."""
    controller = machine.controller
    warnings = []
    if len(text) > controller.program_memory_bytes:
        warnings.append(
            f"the emitted program has {len(text)} bytes, the controller's memory {controller.program_memory_bytes} "
            "(controller.program_memory_bytes): run it from DNC or a data server"
        )
    if controller.dnc_baud > 0 and blocks > 0 and cutting_s > 0.0:
        needed = len(text) * controller.dnc_bits_per_character / cutting_s
        if needed > controller.dnc_baud:
            warnings.append(
                f"drip feeding needs {needed:.0f} baud on average, the line has {controller.dnc_baud} "
                "(controller.dnc_baud): the buffer will run empty"
            )
    if slowed_blocks:
        warnings.append(
            f"{slowed_blocks} of {blocks} shaped blocks step an axis by more than "
            "controller.corner_speed_difference_mm_per_min: run them with the look-ahead mode off "
            '(emission.prologue, for example ["G05.1Q0"]), or it slows them'
        )
    return warnings
