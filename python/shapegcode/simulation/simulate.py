"""A program played on the machine's model, without changing it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import NO_OFFSET, Offset, machine_warnings, region_offset, region_range_warnings
from shapegcode.program import Program, given_program
from shapegcode.results.figures import deviation_um, largest_um, xyz

FloatArray = npt.NDArray[np.float64]
_MOST_SAMPLES = 100_000_000  # set-points of a region: some ten seconds of computing
# How long behind a stop its settling time is looked for. A drive is integrated all that time.
_SHORTEST_REST_S, _LONGEST_REST_S, _DRIVE_REST_S = 0.5, 10.0, 0.5


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
        plant: "modal" or "feed-drive".
        regions: in order; their arrays hold at most `record_samples` samples.
        report: `cycle_time_s`, `cutting_time_s`, `plant`, `residual_vibration_um`, `peak_vibration_um`,
            `settling_time_s` (None: not settled within `settling_limit_s`, or no band), `settling_band_um`,
            `contour_error_um` (command, response), `orbit_error_percent` (command) and
            `response_orbit_error_percent`, one per arc, `regions`, `warnings`.
    """

    machine: Machine
    shaped: bool
    plant: str
    regions: tuple[RegionRun, ...]
    report: dict[str, Any]

    def play(self, run: RegionRun, *, record_samples: int) -> _core.PlaybackFigures:
        """Play a region again, with another number of recorded samples."""
        return _play(run.path, self.machine, self.shaped, self.plant, record_samples, run.offset)


def simulate(
    program: Program | str | Path,
    machine: Machine,
    *,
    plant: str = "modal",
    shaped: bool = False,
    record_samples: int = 200_000,
    on_progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> Simulation:
    """Play the cutting regions of a program through the controller's model and the plant, each from rest to rest.

    `stream` plays the whole program in one.

    Args:
        program: what to play, or its file.
        machine: controller and plant.
        plant: "modal" for the modes behind an ideal servo, "feed-drive" for `axes.*.drive`; what is said of vibration
            then holds the lag of the servo loop.
        shaped: the program was emitted by shapegcode: blocks are played at their feed, without look-ahead and with
            `controller.shaped_time_constant_s`.
        record_samples: samples of command and response kept per region, at most; 0: figures only.
        on_progress: called with regions done and regions in all.

    Raises:
        ProgramError: the program cannot be read, or a region takes longer than can be computed.
        OSError: its file cannot be read.
        ArgumentError: there is no such plant, or a limit of the machine is not usable.
        MachineError: the machine has no feed drives.
        NumericError: the integrator of a feed drive fails.
    """
    program = given_program(program, machine)
    program.refuse_endless(_MOST_SAMPLES * machine.controller.interpolation_period_s)
    runs = []
    for done, region in enumerate(program.regions, start=1):
        path = region.path
        offset = region_offset(region, machine)
        figures = _play(path, machine, shaped, plant, record_samples, offset)
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
        "cycle_time_s": cutting + MachineModel(machine).other_time_s(program.core),
        "cutting_time_s": cutting,
        "plant": plant,
        "residual_vibration_um": largest_um(figures.residual_mm for figures in played),
        "peak_vibration_um": largest_um(figures.peak_mm for figures in played),
        "settling_time_s": _settling_s(played, machine),
        "settling_band_um": machine.tolerance.residual_floor_um,
        "settling_limit_s": _rest_s(machine, plant),
        "contour_error_um": {
            "command": deviation_um(figures.command for figures in played),
            "response": deviation_um(figures.response for figures in played),
        },
        "orbit_error_percent": [error for figures in played for error in figures.orbit_error_percent],
        "response_orbit_error_percent": [error for figures in played for error in figures.response_orbit_error_percent],
        "regions": [
            {
                "lines": [run.first_line, run.last_line],
                "time_s": run.figures.duration_s,
                "residual_vibration_um": largest_um([run.figures.residual_mm]),
                "settling_time_s": _settling_s([run.figures], machine),
            }
            for run in runs
        ],
        "warnings": [*program.warnings, *machine_warnings(machine), *region_range_warnings(program.regions, machine)],
    }
    return Simulation(machine, shaped, plant, tuple(runs), report)


def _play(
    path: _core.Path, machine: Machine, shaped: bool, plant: str, record_samples: int, offset: Offset
) -> _core.PlaybackFigures:
    model = MachineModel(machine)
    options = model.options(plant=plant, offset=offset)
    options.record_samples = record_samples
    options.measure_response_orbit = True
    options.settling_band_mm = machine.tolerance.residual_floor_um * 1e-3
    options.settling_limit_s = _rest_s(machine, plant)
    return model.playing(shaped=shaped).play(path, options)


def _rest_s(machine: Machine, plant: str) -> float:
    if plant != "modal":
        return _DRIVE_REST_S
    return min(max(MachineModel(machine).vibration_memory_s, _SHORTEST_REST_S), _LONGEST_REST_S)


def _settling_s(played: Iterable[_core.PlaybackFigures], machine: Machine) -> dict[str, float | None]:
    """Longest settling time of each axis; None where it does not settle, or no band is given."""
    rows = [figures.settling_s for figures in played]
    longest = xyz(np.max(rows, axis=0) if rows else np.zeros(3))
    given = machine.tolerance.residual_floor_um > 0.0
    return {axis: value if given and math.isfinite(value) else None for axis, value in longest.items()}
