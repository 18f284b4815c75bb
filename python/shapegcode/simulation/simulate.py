"""A program played on the machine's model, without changing it."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

import numpy as np

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import Offset, machine_warnings, region_range_warnings
from shapegcode.model.stream import stream
from shapegcode.program import Program, given_program
from shapegcode.results.figures import ContourError, Tracks, largest_xyz_um
from shapegcode.results.result import Xyz
from shapegcode.simulation.files import csv_file, npz_file
from shapegcode.simulation.motion import MotionRecorder
from shapegcode.simulation.result import Motion, RegionRun, Simulation

__all__ = ["play_motion", "simulate"]

# How long behind a stop its settling time is looked for. A drive is integrated all that time.
_SHORTEST_REST_S, _LONGEST_REST_S, _DRIVE_REST_S = 0.5, 10.0, 0.5


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

    `play_motion` and `stream` play the whole program in one.

    Args:
        program: what to play, or its file.
        machine: controller and plant.
        plant: "modal" for the modes behind an ideal servo, "feed-drive" for `axes.*.drive`; what is said of vibration
            then holds the lag of the servo loop.
        shaped: the program was emitted by shapegcode: blocks are played at their feed, without look-ahead and with
            `controller.shaped_time_constant_s`.
        record_samples: samples of command and response kept per region, at most; 0: figures only.
        on_progress: called with regions done and regions in all.

    Returns:
        The figures of the regions, and their samples.

    Raises:
        ProgramError: the program cannot be read.
        OSError: its file cannot be read.
        ArgumentError: there is no such plant, or a limit of the machine is not usable.
        MachineError: the machine has no feed drives.
        NumericError: the integrator of a feed drive fails.
    """
    program = given_program(program, machine)
    model, band_um = MachineModel(machine), machine.tolerance.residual_floor_um
    limit_s = _rest_s(model, plant)
    runs = []
    for done, region in enumerate(program.regions, start=1):
        replay = partial(_play, region.path, model, plant, shaped, model.offset(region), band_um, limit_s)
        figures = replay(record_samples)
        runs.append(
            RegionRun(
                lines=(region.first_line, region.last_line),
                time_s=figures.duration_s,
                residual_vibration_um=largest_xyz_um([figures.residual_mm]),
                settling_time_s=_settling_s([figures], band_um),
                period_s=model.period_s,
                path=region.path,
                figures=figures,
                replay=replay,
            )
        )
        on_progress(done, len(program.regions))
    played = [run.figures for run in runs]
    cutting_s = sum((figures.duration_s for figures in played), start=0.0)
    warnings = [*program.warnings, *machine_warnings(machine), *region_range_warnings(program.regions, machine)]
    return Simulation(
        program=program.source,
        machine=machine.name,
        plant=plant,
        shaped=shaped,
        cycle_time_s=cutting_s + model.other_time_s(program.core),
        cutting_time_s=cutting_s,
        residual_vibration_um=largest_xyz_um(figures.residual_mm for figures in played),
        peak_vibration_um=largest_xyz_um(figures.peak_mm for figures in played),
        settling_time_s=_settling_s(played, band_um),
        settling_band_um=band_um,
        settling_limit_s=limit_s,
        contour_error_um=Tracks(
            ContourError.of(figures.command for figures in played),
            ContourError.of(figures.response for figures in played),
        ),
        orbit_error_percent=tuple(error for figures in played for error in figures.orbit_error_percent),
        response_orbit_error_percent=tuple(
            error for figures in played for error in figures.response_orbit_error_percent
        ),
        regions=tuple(runs),
        warnings=tuple(warnings),
    )


def play_motion(
    program: Program | str | Path,
    machine: Machine,
    *,
    plant: str = "modal",
    shaped: bool = False,
    lines: tuple[int, int] | None = None,
    csv: str | Path | None = None,
    npz: str | Path | None = None,
    every: int = 1,
    on_progress: Callable[[float], None] = lambda _done: None,
) -> Motion:
    """Play a whole program in time; keep the largest values and the curves of its motion, and write it to files.

    Memory does not grow with the length of the program.

    Args:
        program: what to play, or its file.
        machine: controller and plant.
        plant: "modal" or "feed-drive", see `simulate`.
        shaped: the program was emitted by shapegcode, see `simulate`.
        lines: look at what happens in these lines alone, see `stream`.
        csv: file of one line per sample; "-": standard output.
        npz: NumPy archive with the same columns.
        every: write every such sample only.
        on_progress: called with the share that is done.

    Returns:
        Largest values by axis, and envelopes of the curves.

    Raises:
        ProgramError: the program cannot be read.
        OSError: a file cannot be read or written; what was there before stays.
        ArgumentError: a plant or lines that do not exist, or lines in which nothing happens.
        MachineError: the machine has no feed drives.
        NumericError: the integrator of a feed drive fails.
    """
    program = given_program(program, machine)
    model = MachineModel(machine)
    chunks = stream(program, machine, plant=plant, shaped=shaped, lines=lines)
    whole_s = _core.time_program(program.core, model.playing(shaped=shaped).model).total_s or model.period_s
    recorder = MotionRecorder(model.period_s)
    with contextlib.ExitStack() as files:
        written = [
            files.enter_context(make(name)) for make, name in ((csv_file, csv), (npz_file, npz)) if name is not None
        ]
        for chunk in chunks:
            recorder.add(chunk)
            for file in written:
                file.write(chunk.every(every))
            on_progress(float(chunk.time_s[-1]) / whole_s)
        if not recorder.samples:
            first, last = lines or (1, program.core.line_count)
            raise _core.ArgumentError(f"lines {first}-{last}: nothing happens there: name other lines")
    names = {name: None if file is None else str(file) for name, file in (("csv", csv), ("npz", npz))}
    return recorder.result(program.source, lines=lines, every=every, **names)


def _play(
    path: _core.Path,
    model: MachineModel,
    plant: str,
    shaped: bool,
    offset: Offset,
    band_um: float,
    limit_s: float,
    record_samples: int,
) -> _core.PlaybackFigures:
    options = model.options(plant=plant, offset=offset)
    options.record_samples = record_samples
    options.measure_response_orbit = True
    options.settling_band_mm = band_um * 1e-3
    options.settling_limit_s = limit_s
    return model.playing(shaped=shaped).play(path, options)


def _rest_s(model: MachineModel, plant: str) -> float:
    if plant != "modal":
        return _DRIVE_REST_S
    return min(max(model.vibration_memory_s, _SHORTEST_REST_S), _LONGEST_REST_S)


def _settling_s(played: Iterable[_core.PlaybackFigures], band_um: float) -> Xyz[float | None]:
    """Longest settling time of each axis; None where it does not settle, or no band is given."""
    rows = [figures.settling_s for figures in played]
    longest = np.max(rows, axis=0) if rows else np.zeros(3)
    return Xyz(*(float(value) if band_um > 0.0 and math.isfinite(value) else None for value in longest))
