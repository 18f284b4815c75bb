"""Warnings of a conversion: misses, figures made worse, and what the control will make of the text."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from shapegcode.machine import Machine
from shapegcode.machine.controller import Controller
from shapegcode.machine.output import Tolerance
from shapegcode.program import Program, least_increment_mm
from shapegcode.program.operating import no_room
from shapegcode.verdict.figures import Placed, PlayedFigures

# How much worse than the original's a figure must be to be worth a warning: ratio, and size in um.
_WORSE_RATIO, _WORSE_UM = 1.2, 5.0


def open_axes(program: Program, machine: Machine) -> list[str]:
    """Axes that move in the regions of a program, have no mode and are not said to be rigid."""
    reach = [np.ptp(np.asarray(region.path.polyline()), axis=0) for region in program.regions]
    stated = {value.key for value in machine.values() if not value.unmeasured}
    return [
        f"{letter.upper()} moves, and whether it has a vibration mode is not known: assumed rigid; "
        f"tap it (shapegcode identify), or state axes.{letter}.rigid = true"
        for rank, (letter, axis) in enumerate(zip("xyz", machine.axes.as_tuple(), strict=True))
        if not axis.modes
        and not (axis.rigid and f"axes.{letter}.rigid" in stated)
        and any(ways[rank] > 0.0 for ways in reach)
    ]


def played_warnings(program: Program, figures: PlayedFigures, machine: Machine, *, is_priced: bool) -> list[str]:
    """What simulating the emitted program showed: misses, the tolerance that binds, figures made worse."""
    expanded = " expanded" if program.core.expanded else ""
    misses = [
        f"{program.place(region.lines[0])}: lines {region.lines[0]} to {region.lines[1]}{expanded}: {miss}"
        for region in figures.regions
        for miss in region.misses
    ]
    rounding_um = math.sqrt(2.0) * least_increment_mm(machine, 21) * 1e3
    return [*misses, *_binding(figures, machine.tolerance, rounding_um, is_priced=is_priced), *_worse(figures)]


def text_warnings(
    program: Program, placed: Sequence[Placed], figures: PlayedFigures, machine: Machine, size: int, blocks: int
) -> list[str]:
    """What the control must be told or cannot do with the emitted text."""
    fastest = max(axis.max_feed_mm_per_min for axis in machine.axes.as_tuple())
    return [
        *_mode_left_on(program, placed, machine.emission.prologue),
        *_too_fast(program, placed, fastest),
        *_memory_and_line(machine.controller, size, blocks, figures.region_time_s().emitted),
        *_slowed(0 if machine.emission.leaves_look_ahead else figures.slowed_blocks, blocks),
    ]


def _worse(figures: PlayedFigures) -> list[str]:
    """Figures that the conversion made noticeably worse, within tolerance or not."""
    pairs = [
        (f"{name} {axis.upper()}", both.original[axis], both.emitted[axis])
        for name, both in (
            ("residual vibration", figures.residual_vibration_um),
            ("peak vibration", figures.peak_vibration_um),
        )
        for axis in "xyz"
    ]
    response = figures.contour_error_um.response
    pairs.append(("contour error of the machine table", response.original.max, response.emitted.max))
    return [
        f"{name} is larger than the original's: {before:.1f} -> {after:.1f} um"
        for name, before, after in pairs
        if after > _WORSE_RATIO * before and after - before > _WORSE_UM
    ]


def _binding(figures: PlayedFigures, tolerance: Tolerance, rounding_um: float, *, is_priced: bool) -> Iterator[str]:
    """Which tolerance a conversion left, by how much, and what would be feasible; nothing where all were kept."""
    contour = max((region.contour_error_um for region in figures.regions), default=0.0)
    if contour > tolerance.contour_um:
        how = "within the price (price.*)" if is_priced else "with the feed lowered as far as it helps"
        share = f"; rounding the words alone may take {rounding_um:.1f} um of it"
        yield (
            f"tolerance.contour_um = {tolerance.contour_um:g} binds: {contour:.1f} um were reached "
            f"{how}{share if rounding_um > 0.2 * contour else ''}; "
            f"feasible: {_rounded_up(contour):g} um"
        )
    over = [pair for region in figures.regions for pair in region.over_limit()]
    if over:
        left, limit = max(over)
        yield (
            f"the tolerance of residual vibration binds: {left:.2f} um are left, limit {limit:.2f} um "
            f"(tolerance.residual_*); feasible: tolerance.residual_floor_um = {_rounded_up(left):g}, "
            "or a longer shaper (`shapegcode shaper`)"
        )


def _rounded_up(value: float) -> float:
    """Two digits, with a margin of 5 %."""
    value *= 1.05
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / step) * step


def _mode_left_on(program: Program, placed: Sequence[Placed], prologue: Sequence[str]) -> Iterator[str]:
    on = next((place.region for place in placed if place.region.look_ahead_mode), None)
    if on is not None and not prologue:
        yield (
            f"{program.place(on.first_line)}: shaped blocks run while the program's look-ahead mode is on; the "
            'verdict holds for it off: set emission.prologue = ["G05.1Q0"] and emission.epilogue = ["G05.1Q1"]'
        )


def _too_fast(program: Program, placed: Sequence[Placed], fastest: float) -> Iterator[str]:
    fast = next((place.region for place in placed if place.region.path.fastest_feed_mm_per_s * 60.0 > fastest), None)
    if fast is not None:
        yield (
            f"{program.place(fast.first_line)}: programmed feed {fast.path.fastest_feed_mm_per_s * 60.0:g} mm/min is "
            f"over every axis' largest ({fastest:g} mm/min, axes.*.max_feed_mm_per_min): shaped at the axes' limits"
        )


def _memory_and_line(controller: Controller, size: int, blocks: int, cutting_s: float) -> Iterator[str]:
    if size > controller.program_memory_bytes:
        yield (
            f"the emitted program has {size} bytes, the controller's memory {controller.program_memory_bytes} "
            f"(controller.program_memory_bytes): {no_room(controller.program_memory_bytes)}"
        )
    if controller.dnc_baud > 0 and blocks > 0 and cutting_s > 0.0:
        needed = size * controller.dnc_bits_per_character / cutting_s
        if needed > controller.dnc_baud:
            yield (
                f"drip feeding needs {needed:.0f} baud on average, the line has {controller.dnc_baud} "
                "(controller.dnc_baud): the buffer will run empty"
            )


def _slowed(slowed: int, blocks: int) -> Iterator[str]:
    if slowed:
        yield (
            f"{slowed} of {blocks} shaped blocks step an axis by more than "
            "controller.corner_speed_difference_mm_per_min: run them with the look-ahead mode off "
            '(emission.prologue, for example ["G05.1Q0"]), or it slows them'
        )
