"""What does the same without shaping: where the control's own filter rounds corners, not vibration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.program import Program
from shapegcode.verdict.judge import Judge

__all__ = ["FilterAdvice", "filter_advice"]

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
