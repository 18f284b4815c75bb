"""What to do with an emitted program: one of five grades, each with its one reason, from benefit and price."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from shapegcode import _core
from shapegcode.conversion.tables import unknown_axes
from shapegcode.machine import Machine
from shapegcode.machine.programs import Tolerance
from shapegcode.model.machine_model import MachineModel
from shapegcode.program import Program, written_increment_mm
from shapegcode.program.comparison import ProgramDifference
from shapegcode.program.stamp import no_room
from shapegcode.verdict.figures import Placed, ProgramFigures, RegionVerdict
from shapegcode.verdict.judge import Judge, RegionFigures


def _figures_um(simulated: _core.SimulationFigures) -> tuple[float, float]:
    """Residual vibration of the worst axis, contour error of the machine table."""
    return float(np.max(simulated.residual_mm)) * 1e3, simulated.response.max_abs_mm * 1e3


def most_to_gain_um(original: _core.SimulationFigures) -> float:
    """The most that shaping can gain: what is there."""
    return max(_figures_um(original))


def gain_um(figures: RegionFigures) -> float:
    """What shaping gained: the larger fall of the two figures, the emitted one in the worse rule."""
    after = np.max([_figures_um(run) for run in figures.emitted], axis=0)
    return max(0.0, float(np.max(np.asarray(_figures_um(figures.original)) - after)))


Grade = Literal[
    "worth running",
    "better, tolerance not met",
    "already within tolerance: shaping is optional",
    "no benefit: run the original",
    "do not run",
]
GRADES: tuple[Grade, ...] = get_args(Grade)
"""From the best down; the first that applies from the end is the answer."""

LEAST_BETTER = 0.3
"""Share by which a figure must fall to count as a benefit."""


def recommend(
    cuts: Sequence[RegionVerdict],
    *,
    original_within: bool,
    could_gain: bool,
    benefit: bool,
    other_changes: Sequence[ProgramDifference] = (),
) -> tuple[Grade, str]:
    """The grade of a program and its reason: the first that applies, from "do not run" upwards.

    `original_within`: every cut of the original keeps its limits. `could_gain`: shaping gains enough in some cut, or
    would as far as is known. `benefit`: of a shaped cut, see `benefits`. `other_changes`: a defect of shapegcode.
    """
    if worse := next((_at(cut, why) for cut in cuts for why in cut.worse), ""):
        return "do not run", worse
    for change in other_changes:
        had, has = change.original or "nothing", change.emitted or "nothing"
        return "do not run", f"{change.place}: {change.kind} changed: {had} became {has}: please report this defect"
    if not cuts:
        return "no benefit: run the original", "there is nothing to shape"
    if not could_gain or (not benefit and not original_within):
        return "no benefit: run the original", "nothing that misses its limit gets noticeably better"
    if original_within:
        return "already within tolerance: shaping is optional", "every cut of the original keeps its limits"
    if missed := next((_at(cut, why) for cut in cuts for why in cut.misses), ""):
        return "better, tolerance not met", missed
    return "worth running", "every cut is within its limits, and within the price"


def _at(cut: RegionVerdict, why: str) -> str:
    return "lines {} to {}: {}".format(*cut.lines, why)


def benefits(cut: RegionVerdict, contour_limit_um: float, least_gain_um: float) -> bool:
    """Whether a figure that missed its limit, or vibrates, falls by the least gain and by 30 % or to the limit."""
    pairs = [(cut.original_contour_error_um, cut.contour_error_um, contour_limit_um, contour_limit_um)]
    residual = cut.residual_vibration_um
    pairs += [
        (before, after, limit, min(limit, least_gain_um))
        for before, after, limit in zip(residual.original, residual.emitted, cut.residual_limit_um, strict=True)
    ]
    return any(
        before > threshold
        and before - after >= least_gain_um
        and (after <= (1.0 - LEAST_BETTER) * before or (before > limit >= after))
        for before, after, limit, threshold in pairs
    )


_MOSTLY = 0.7  # of the contour error of the machine table: the command itself errs so much
_TRIALS = (0.9, 0.7, 0.5)  # of the time constant that a rounding in proportion to it would allow


@dataclass(frozen=True)
class FilterAdvice:
    """A contour error caused by the control's own filter, and its remedy without shaping."""

    key: str  # of the machine file, the filter's time constant
    now_s: float  # its value
    enough_s: float  # at which every cut of the original keeps its limits, simulated
    rounding_um: float  # contour error of the command, which the filter makes
    lines: tuple[int, int]  # of the cut in which it is largest

    def __str__(self) -> str:
        """For people."""
        lower = f"lowered to {self.enough_s * 1e3:.3g} ms" if self.enough_s > 0.0 else "switched off"
        return (
            f"the control's {self.now_s * 1e3:.3g} ms filter rounds the path by {self.rounding_um:.0f} µm "
            "(lines {} to {})".format(*self.lines)
            + f": {lower} ({self.key}), or with contour control, the original "
            "keeps every limit without shaping"
        )


def filter_advice(
    program: Program, machine: Machine, model: MachineModel, judge: Judge, originals: Sequence[_core.SimulationFigures]
) -> FilterAdvice | None:
    """Find a smaller filter of the control with which the original keeps its limits without shaping."""
    limit_um, floor_um = machine.tolerance.contour_um, machine.tolerance.residual_floor_um
    errors = [(getattr(run, judge.target).max_abs_mm * 1e3, run.command.max_abs_mm * 1e3) for run in originals]
    if not any(error > limit_um for error, _ in errors):
        return None
    if any(float(run.residual_mm.max()) * 1e3 > floor_um for run in originals):
        return None  # vibration has to be cured in any case
    if any(error > limit_um and command < _MOSTLY * error for error, command in errors):
        return None
    field = "time_constant_s"
    if machine.controller.motion == "look_ahead":
        field = "look_ahead_filter_time_constant_s"
    now_s = getattr(machine.controller, field)
    worst = max(range(len(errors)), key=lambda index: errors[index][0])
    region = program.regions[worst]
    for trial in _TRIALS if now_s > 0.0 else ():
        period_s = model.period_s
        enough_s = math.floor(now_s * trial * limit_um / errors[worst][0] / period_s) * period_s
        if _keeps(program, machine, judge, {f"controller.{field}": enough_s}):
            lines = (region.first_line, region.last_line)
            return FilterAdvice(f"controller.{field}", now_s, enough_s, errors[worst][1], lines)
    return None


def _keeps(program: Program, machine: Machine, judge: Judge, values: dict[str, float]) -> bool:
    """Whether every cut of the original keeps its limits on the machine with other values."""
    model = MachineModel(machine.with_values(values))
    limit_mm, floor_mm = machine.tolerance.contour_um * 1e-3, machine.tolerance.residual_floor_um * 1e-3
    for region in program.regions:
        run = model.simulate_original(region.path, offset=model.offset(region))
        if getattr(run, judge.target).max_abs_mm > limit_mm or float(run.residual_mm.max()) > floor_mm:
            return False
    return True


# How much worse than the original's a figure must be to be worth a warning: ratio, and size in um.
_WORSE_RATIO, _WORSE_UM = 1.2, 5.0


def open_axes(program: Program, machine: Machine) -> list[str]:
    """Axes that move in the regions of a program, and of which it is not known whether they have a mode."""
    return [
        f"{letter.upper()} moves, and whether it has a vibration mode is not known: assumed rigid; "
        f"tap it (shapegcode identify), or state axes.{letter}.rigid = true"
        for letter in unknown_axes(machine)
        if any(region.path.extent_mm["xyz".index(letter)] > 0.0 for region in program.regions)
    ]


def simulation_warnings(
    program: Program, figures: ProgramFigures, machine: Machine, *, is_priced: bool
) -> Iterator[str]:
    """Warnings from the simulation of the emitted program: misses, exceeded tolerances, figures made worse."""
    expanded = " expanded" if program.core.expanded else ""
    for region in figures.regions:
        for miss in region.misses:
            yield f"{program.place(region.lines[0])}: lines {region.lines[0]} to {region.lines[1]}{expanded}: {miss}"
    rounding_um = math.sqrt(2.0) * written_increment_mm(machine, 21) * 1e3
    yield from _binding(figures, machine.tolerance, rounding_um, is_priced=is_priced)
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
    for name, before, after in pairs:
        if after > _WORSE_RATIO * before and after - before > _WORSE_UM:
            yield f"{name} is larger than the original's: {before:.1f} -> {after:.1f} um"


def _binding(figures: ProgramFigures, tolerance: Tolerance, rounding_um: float, *, is_priced: bool) -> Iterator[str]:
    """Tolerances that a conversion exceeds, by how much, and feasible values; nothing if all are kept."""
    contour = max((region.contour_error_um for region in figures.regions), default=0.0)
    if contour > tolerance.contour_um:
        how = "within the price (price.*)" if is_priced else "with the feed lowered as far as it helps"
        share = f"; rounding the words alone may take {rounding_um:.1f} um of it"
        yield (
            f"tolerance.contour_um = {tolerance.contour_um:g} is exceeded: {contour:.1f} um were reached "
            f"{how}{share if rounding_um > 0.2 * contour else ''}; "
            f"feasible: {_rounded_up(contour):g} um"
        )
    over = [pair for region in figures.regions for pair in region.over_limit()]
    if over:
        left, limit = max(over)
        yield (
            f"the tolerance of residual vibration is exceeded: {left:.2f} um remain, limit {limit:.2f} um "
            f"(tolerance.residual_*); feasible: tolerance.residual_floor_um = {_rounded_up(left):g}, "
            "or a longer shaper (`shapegcode shaper`)"
        )


def _rounded_up(value: float) -> float:
    """Two digits, with a margin of 5 %."""
    value *= 1.05
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / step) * step


def text_warnings(
    program: Program, placed: Sequence[Placed], figures: ProgramFigures, machine: Machine, size: int, blocks: int
) -> Iterator[str]:
    """Warnings on settings of the control, and on what it cannot do with the emitted program."""
    controller, emission = machine.controller, machine.emission
    on = next((place.region for place in placed if place.region.look_ahead_mode), None)
    if on is not None and not emission.prologue:
        yield (
            f"{program.place(on.first_line)}: shaped blocks run while the program's look-ahead mode is on; the verdict "
            'is for look-ahead off: set emission.prologue = ["G05.1Q0"] and emission.epilogue = ["G05.1Q1"]'
        )
    fastest = max(axis.max_feed_mm_per_min for axis in machine.axes.as_tuple())
    fast = next((place.region for place in placed if place.region.path.fastest_feed_mm_per_s * 60.0 > fastest), None)
    if fast is not None:
        yield (
            f"{program.place(fast.first_line)}: programmed feed {fast.path.fastest_feed_mm_per_s * 60.0:g} mm/min is "
            f"over every axis' largest ({fastest:g} mm/min, axes.*.max_feed_mm_per_min): shaped at the axes' limits"
        )
    if size > controller.program_memory_bytes:
        yield (
            f"the emitted program has {size} bytes, the controller's memory {controller.program_memory_bytes} "
            f"(controller.program_memory_bytes): {no_room(controller.program_memory_bytes)}"
        )
    cutting_s = figures.region_time_s().emitted
    if controller.dnc_baud > 0 and blocks > 0 and cutting_s > 0.0:
        needed = size * controller.dnc_bits_per_character / cutting_s
        if needed > controller.dnc_baud:
            yield (
                f"drip feeding needs {needed:.0f} baud on average, the line has {controller.dnc_baud} "
                "(controller.dnc_baud): the buffer will run empty"
            )
    if figures.slowed_blocks and not emission.leaves_look_ahead:
        example = ', for example ["G05.1Q0"]' if emission.dialect == "fanuc" else ""
        yield (
            f"{figures.slowed_blocks} of {blocks} shaped blocks change the speed of an axis by more than "
            "controller.corner_speed_difference_mm_per_min: run them with the look-ahead mode off "
            f"(emission.prologue{example}), or look-ahead slows them down"
        )
