"""A program played on the machine's model, without changing it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.moving_modes import NO_OFFSET, Offset, machine_warnings, region_offset, region_range_warnings
from shapegcode.program import Program
from shapegcode.verify import deviation_um, largest_um, other_time_s, play_emitted, play_original

FloatArray = npt.NDArray[np.float64]
_MOST_SAMPLES = 100_000_000  # set-points of a region: some ten seconds of computing


@dataclass(frozen=True, eq=False)
class RegionRun:
    """One cutting region played.

    Attributes:
        first_line: of the program, from 1.
        last_line: inclusive.
        period_s: time between two samples.
        command_mm: set-points after every filter, (n, 3); the decay after the stop included.
        response_mm: the table at the same instants, (n, 3).
        path: the programmed path.
        figures: what the core measured.
        offset: from the path's positions to the machine's, for modes that vary with them.
    """

    first_line: int
    last_line: int
    period_s: float
    command_mm: FloatArray
    response_mm: FloatArray
    path: _core.Path
    figures: _core.PlaybackFigures
    offset: Offset = NO_OFFSET


@dataclass(frozen=True, eq=False)
class Simulation:
    """A program played region by region.

    Attributes:
        machine: that the program was played on.
        shaped: the program was played as one emitted by shapegcode.
        regions: in order; their arrays hold at most `record_samples` samples.
        report: `cycle_time_s`, `cutting_time_s`, `residual_vibration_um`, `peak_vibration_um`, `contour_error_um`
            (command, response), `orbit_error_percent`, `regions`, `warnings`.
    """

    machine: Machine
    shaped: bool
    regions: tuple[RegionRun, ...]
    report: dict[str, Any]

    def play(self, run: RegionRun, *, record_samples: int) -> _core.PlaybackFigures:
        """Play a region again, with another number of recorded samples."""
        return _play(run.path, self.machine, self.shaped, record_samples, run.offset)


def simulate(
    program: Program,
    machine: Machine,
    *,
    shaped: bool = False,
    record_samples: int = 200_000,
    on_progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> Simulation:
    """Play a program through the controller's model and the plant.

    Args:
        program: what to play.
        machine: controller and modes.
        shaped: the program was emitted by shapegcode: blocks are played at their feed, without look-ahead and with
            `controller.shaped_time_constant_s`.
        record_samples: samples of command and response kept per region, at most; 0: figures only.
        on_progress: called with regions done and regions in all.

    Raises:
        ProgramError: a region takes longer than can be computed.
        ArgumentError: a limit of the machine is not usable.
    """
    program.refuse_endless(_MOST_SAMPLES * machine.controller.interpolation_period_s)
    runs = []
    for done, region in enumerate(program.regions, start=1):
        path = region.path
        offset = region_offset(region, machine)
        figures = _play(path, machine, shaped, record_samples, offset)
        runs.append(
            RegionRun(
                region.first_line,
                region.last_line,
                machine.controller.interpolation_period_s,
                figures.recorded_command,
                figures.recorded_response,
                path,
                figures,
                offset,
            )
        )
        on_progress(done, len(program.regions))
    played = [run.figures for run in runs]
    cutting = sum(figures.duration_s for figures in played)
    report = {
        "program": program.source,
        "machine": machine.name,
        "cycle_time_s": cutting + other_time_s(program.core, machine),
        "cutting_time_s": cutting,
        "residual_vibration_um": largest_um(figures.residual_mm for figures in played),
        "peak_vibration_um": largest_um(figures.peak_mm for figures in played),
        "contour_error_um": {
            "command": deviation_um(figures.command for figures in played),
            "response": deviation_um(figures.response for figures in played),
        },
        "orbit_error_percent": [error for figures in played for error in figures.orbit_error_percent],
        "regions": [
            {
                "lines": [run.first_line, run.last_line],
                "time_s": run.figures.duration_s,
                "residual_vibration_um": largest_um([run.figures.residual_mm]),
            }
            for run in runs
        ],
        "warnings": [*program.warnings, *machine_warnings(machine), *region_range_warnings(program.regions, machine)],
    }
    return Simulation(machine, shaped, tuple(runs), report)


def _play(
    path: _core.Path, machine: Machine, shaped: bool, record_samples: int, offset: Offset
) -> _core.PlaybackFigures:
    if not shaped:
        return play_original(path, machine, record_samples=record_samples, offset=offset)
    return play_emitted(path, path, machine, record_samples=record_samples, offset=offset)
