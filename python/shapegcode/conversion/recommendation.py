"""What to do with an emitted program: one of five grades, each with its one reason, from benefit and price."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from shapegcode import _core
from shapegcode.comparison.result import ProgramDifference
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.program import Program
from shapegcode.verdict.figures import RegionVerdict
from shapegcode.verdict.judge import Judge, RegionFigures


def _figures_um(played: _core.PlaybackFigures) -> tuple[float, float]:
    """Residual vibration of the worst axis, contour error of the machine table."""
    return float(np.max(played.residual_mm)) * 1e3, played.response.max_abs_mm * 1e3


def most_to_gain_um(original: _core.PlaybackFigures) -> float:
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
GRADES: tuple[Grade, ...] = (
    "worth running",
    "better, tolerance not met",
    "already within tolerance: shaping is optional",
    "no benefit: run the original",
    "do not run",
)
"""From the best down; the first that applies from the end is the answer."""

LEAST_BETTER = 0.3
"""Share by which a figure must fall to count as a benefit."""


@dataclass(frozen=True)
class Situation:
    """What the grade is decided by.

    Attributes:
        cuts: all of the program, shaped or left unchanged.
        shaped: how many of them are shaped.
        original_within: every cut of the original keeps its limits.
        could_gain: there is a cut in which shaping gains, or as far as is known would gain, the least gain.
        benefit: a shaped cut gains enough, see `benefits`.
        other_changes: what else differs from the original; none, unless shapegcode has a defect.
    """

    cuts: Sequence[RegionVerdict]
    shaped: int
    original_within: bool
    could_gain: bool
    benefit: bool
    other_changes: Sequence[ProgramDifference] = ()


def recommend(situation: Situation) -> tuple[Grade, str]:
    """The grade and its reason: the first that applies, from "do not run" upwards."""
    worse = next((_at(cut, why) for cut in situation.cuts for why in cut.worse), "")
    if worse:
        return "do not run", worse
    for change in situation.other_changes:
        had, has = change.original or "nothing", change.emitted or "nothing"
        return "do not run", f"{change.place}: {change.kind} changed: {had} became {has}: please report this defect"
    if not situation.cuts:
        return "no benefit: run the original", "there is nothing to shape"
    if not situation.could_gain or (not situation.benefit and not situation.original_within):
        return "no benefit: run the original", "nothing that misses its limit gets noticeably better"
    if situation.original_within:
        return "already within tolerance: shaping is optional", "every cut of the original keeps its limits"
    missed = next((_at(cut, why) for cut in situation.cuts for why in cut.misses), "")
    if missed:
        return "better, tolerance not met", missed
    return "worth running", "every cut is within its limits, and within the price"


def _at(cut: RegionVerdict, why: str) -> str:
    return "lines {} to {}: {}".format(*cut.lines, why)


def benefits(cut: RegionVerdict, contour_limit_um: float, least_gain_um: float) -> bool:
    """Whether shaping a cut is a benefit.

    A figure that missed its limit, or a residual vibration above the least gain, falls by the least gain and either by
    30 % or to within the limit.
    """
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
    """A contour error that the control's own filter makes, and what cures it without shaping.

    Attributes:
        key: of the machine file, the filter's time constant.
        now_s: its value.
        enough_s: at which every cut of the original keeps its limits, simulated.
        rounding_um: contour error of the command, which the filter makes.
        lines: of the cut in which it is largest.
    """

    key: str
    now_s: float
    enough_s: float
    rounding_um: float
    lines: tuple[int, int]

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
    program: Program,
    machine: Machine,
    model: MachineModel,
    judge: Judge,
    originals: Sequence[_core.PlaybackFigures],
) -> FilterAdvice | None:
    """Whether a smaller filter of the control would do instead of shaping."""
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
        run = model.play_original(region.path, offset=model.offset(region))
        if getattr(run, judge.target).max_abs_mm > limit_mm or float(run.residual_mm.max()) > floor_mm:
            return False
    return True
