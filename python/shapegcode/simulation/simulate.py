"""Simulates a program on a model of the machine, without changing it."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel, fanuc_model
from shapegcode.model.modes import Offset, machine_warnings, region_range_warnings
from shapegcode.model.programs import SimulatedPrograms, shaped_warnings
from shapegcode.model.stream import stream
from shapegcode.program import Program, given_program
from shapegcode.program.compensation import paired_regions
from shapegcode.results.outcome import ContourError, Tracks, Xyz, largest_xyz_um
from shapegcode.simulation.motion import MotionRecorder, csv_file, npz_file
from shapegcode.simulation.result import Motion, RegionRun, ShapedFigures, Simulation
from shapegcode.verdict.judge import judge_program

# Time for which settling is observed after a stop; short for a drive, which is integrated all that time.
_SHORTEST_REST_S, _LONGEST_REST_S, _DRIVE_REST_S = 0.5, 10.0, 0.5


def simulate(
    program: Program | str | Path,
    machine: Machine | str | Path,
    *,
    plant: str = "modal",
    shaped: bool | None = None,
    against: Program | str | Path | None = None,
    record_samples: int = 200_000,
    on_progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> Simulation:
    """Simulate each cutting region of a program from rest to rest, through models of controller and plant.

    `simulate_motion` and `stream` simulate the whole program as one motion.

    Args:
        program: the program, or its file.
        machine: controller and plant.
        plant: "modal" for an ideal servo followed by the modes, "feed-drive" for `axes.*.drive`; vibration figures
            then include servo lag.
        shaped: True: all cuts are shaped blocks, simulated at their feed, without look-ahead, through the control's own
            filter (`controller.shaped_time_constant_s`), with the worse rule of block timing. False: none of them is.
            None: only the regions that an emitted program marks as shaped.
        against: the original of a shaped program: the contour error is measured against its path, and the whole program
            gets a verdict in the operating conditions that count, as in `convert`. None: the contour error is measured
            against the program's own path, and there is no verdict.
        record_samples: largest number of stored samples per region; 0: figures only.
        on_progress: called with completed and total regions.

    Returns:
        Figures of the regions, and their samples.

    Raises:
        ProgramError: the program cannot be read.
        OSError: its file cannot be read.
        ArgumentError: an unknown plant, an unusable limit of the machine, or `against` has a cut that the
            program lacks.
        MachineError: the machine has no feed drives.
        NumericError: the integrator of a feed drive fails.
    """
    if isinstance(record_samples, bool) or record_samples < 0:
        raise _core.ArgumentError(f"record_samples = {record_samples}: a number of samples, 0 or more")
    machine = Machine.of(machine)
    program = given_program(program, machine)
    model, band_um = MachineModel(machine), machine.tolerance.residual_floor_um
    limit_s = _DRIVE_REST_S
    if plant == "modal":
        limit_s = min(max(model.vibration_memory_s, _SHORTEST_REST_S), _LONGEST_REST_S)
    nominal, verdict = {}, None
    if against is not None:
        against = given_program(against, machine)
        pairs = list(paired_regions(program, against))
        nominal = {mine.first_line: other.path for mine, other in pairs if not mine.path.moves_as(other.path)}
        verdict = judge_program(program, against, pairs, model, shaped=shaped)
    runs: list[RegionRun] = []
    simulated: list[_core.SimulationFigures] = []
    of_shaped: list[_core.SimulationFigures] = []
    # A planner that cannot be switched off executes the emitted arcs in every cut of an emitted program.
    emitted = model.always_plans and (program.shaped_regions > 0 if shaped is None else shaped)
    for done, region in enumerate(program.regions, start=1):
        as_shaped = region.shaped if shaped is None else shaped
        path = nominal.get(region.first_line)
        by_shaped, offset = as_shaped or emitted, model.offset(region)
        replay = partial(_simulate_region, region.path, path, model, plant, by_shaped, offset, band_um, limit_s)
        figures = [replay(record_samples)]
        if as_shaped:
            figures += [replay(0, block_end=rule) for rule in model.block_rules if rule != model.own_rule]
        runs.append(
            RegionRun(
                lines=(region.first_line, region.last_line),
                shaped=as_shaped,
                was_rapid=region.was_rapid,
                time_s=max(each.duration_s for each in figures),
                residual_vibration_um=largest_xyz_um(each.residual_mm for each in figures),
                settling_time_s=_settling_s(figures, band_um),
                period_s=model.period_s,
                path=path or region.path,
                figures=figures[0],
                replay=replay,
            )
        )
        simulated += figures
        of_shaped += figures if as_shaped and not region.was_rapid else []
        on_progress(done, len(program.regions))
    own, cuts = [run.figures for run in runs], [run for run in runs if run.shaped and not run.was_rapid]
    shaped_figures = None
    if cuts:
        shaped_figures = ShapedFigures(len(cuts), math.fsum(run.time_s for run in cuts), **_largest(of_shaped))
    warnings = [*program.warnings, *machine_warnings(machine), *region_range_warnings(program.regions, machine)]
    if shaped is None:
        warnings += [why for _, why in shaped_warnings(program, machine)]
    return Simulation(
        program=program.source,
        machine=machine.name,
        plant=plant,
        shaped=any(run.shaped for run in runs),
        measured_against=(against or program).source,
        cycle_time_s=_core.time_program(program.core, fanuc_model(machine, shaped=shaped)).total_s,
        cutting_time_s=math.fsum(run.time_s for run in runs),
        **_largest(simulated),
        settling_time_s=_settling_s(simulated, band_um),
        settling_band_um=band_um,
        settling_limit_s=limit_s,
        orbit_error_percent=tuple(error for figures in own for error in figures.orbit_error_percent),
        response_orbit_error_percent=tuple(error for figures in own for error in figures.response_orbit_error_percent),
        of_shaped=shaped_figures,
        verdict=verdict,
        regions=tuple(runs),
        warnings=tuple(warnings),
        simulated=SimulatedPrograms(program, machine, labels=("program", ""), plant=plant),
    )


def simulate_motion(
    program: Program | str | Path,
    machine: Machine | str | Path,
    *,
    plant: str = "modal",
    shaped: bool | None = None,
    lines: tuple[int, int] | None = None,
    csv: str | Path | None = None,
    npz: str | Path | None = None,
    every: int = 1,
    on_progress: Callable[[float], None] = lambda _done: None,
) -> Motion:
    """Simulate the motion of a whole program; return its largest values and curves, and write it to files if requested.

    Memory does not grow with the length of the program.

    Args:
        program: the program, or its file.
        machine: controller and plant.
        plant: "modal" or "feed-drive", see `simulate`.
        shaped: the cuts are shaped blocks, see `simulate`.
        lines: only the motion in these lines, see `stream`.
        csv: file with one line per sample; "-": standard output.
        npz: NumPy archive with the same columns.
        every: write only every *every*-th sample.
        on_progress: called with the completed fraction.

    Returns:
        Largest values by axis, and envelopes of the curves.

    Raises:
        ProgramError: the program cannot be read.
        OSError: a file cannot be read or written; an existing file remains.
        ArgumentError: an invalid plant or line range, `every` below 1, or lines without motion.
        MachineError: the machine has no feed drives.
        NumericError: the integrator of a feed drive fails.
    """
    if every < 1:
        raise _core.ArgumentError(f"every = {every}: must be 1 or more")
    machine = Machine.of(machine)
    program = given_program(program, machine)
    model = MachineModel(machine)
    chunks = stream(program, machine, plant=plant, shaped=shaped, lines=lines)
    whole_s = _core.time_program(program.core, fanuc_model(machine, shaped=shaped)).total_s or model.period_s
    recorder = MotionRecorder(model.period_s)
    with contextlib.ExitStack() as files:
        written = [
            files.enter_context(make(name)) for make, name in ((csv_file, csv), (npz_file, npz)) if name is not None
        ]
        for chunk in chunks:
            recorder.add(chunk)
            for write in written:
                write(chunk.every(every))
            on_progress(float(chunk.time_s[-1]) / whole_s)
        if not recorder.samples:
            first, last = lines or (1, program.core.line_count)
            raise _core.ArgumentError(f"lines {first}-{last}: no motion there: specify other lines")
    names = {name: None if file is None else str(file) for name, file in (("csv", csv), ("npz", npz))}
    return recorder.result(program.source, lines, every, **names)


def _largest(simulated: Sequence[_core.SimulationFigures]) -> dict[str, Any]:
    return {
        "residual_vibration_um": largest_xyz_um(figures.residual_mm for figures in simulated),
        "peak_vibration_um": largest_xyz_um(figures.peak_mm for figures in simulated),
        "contour_error_um": Tracks(
            ContourError.of(figures.command for figures in simulated),
            ContourError.of(figures.response for figures in simulated),
        ),
    }


def _simulate_region(
    blocks: _core.Path,
    path: _core.Path | None,
    model: MachineModel,
    plant: str,
    shaped: bool,
    offset: Offset,
    band_um: float,
    limit_s: float,
    record_samples: int,
    *,
    block_end: _core.BlockEnd | None = None,
) -> _core.SimulationFigures:
    options = model.options(plant=plant, offset=offset)
    options.record_samples = record_samples
    options.measure_response_orbit = True
    options.settling_band_mm = band_um * 1e-3
    options.settling_limit_s = limit_s
    return model.simulated(shaped=shaped).simulate(blocks, options, against=path, block_end=block_end)


def _settling_s(simulated: Iterable[_core.SimulationFigures], band_um: float) -> Xyz[float | None]:
    """Longest settling time of each axis, s; None: the axis does not settle, or the settling band is zero."""
    rows = [figures.settling_s for figures in simulated]
    longest = np.max(rows, axis=0) if rows else np.zeros(3)
    return Xyz(*(float(value) if band_um > 0.0 and math.isfinite(value) else None for value in longest))
