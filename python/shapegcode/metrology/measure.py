"""Virtual metrology: measures the part that the simulated response would cut, section by section of the path.

The tool is a disc that removes swept material: cutting forces, deflection and tooth marks are not included.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.metrology.figures import MeasuredSection, WallProfile
from shapegcode.metrology.result import MeasuredProgram, MeasuredRegion, Measurement
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import machine_warnings, region_range_warnings
from shapegcode.model.programs import SimulatedPrograms, shaped_warnings
from shapegcode.program import Program, given_program
from shapegcode.program.compensation import paired_regions

_LONGEST_REST_S = 10.0  # longest observation of a vibration after a stop
_MIN_REST_S = 0.25
_MAX_PROFILE_STATIONS = 200_000  # stored per program for pictures
_MAX_TOOL_MM, _MIN_SPACING_MM, _SHORT_MM = 1000.0, 1e-3, 0.5
_MAX_SECTIONS = 20_000  # largest number of sections of a program
_LAST_LINE = 2**32 - 1
_BLOCKS_PER_CURVE = 2.5  # blocks of a shaped program are shorter than this many block periods at its feed


@dataclass(frozen=True)
class Job:
    """A region to simulate, the nominal region against which it is measured, and the sections of the nominal region."""

    simulated: _core.Region
    nominal: _core.Region
    sections: list[_core.PathSection]
    joined_mm: float  # shorter sections are joined to curves, as there were too many; 0: the usual length


def measure(
    programs: Program | str | Path | Sequence[Program | str | Path],
    machine: Machine | str | Path,
    tool_diameter_mm: float,
    *,
    plant: str = "modal",
    against: Program | str | Path | None = None,
    lines: Sequence[tuple[int, int]] | None = None,
    band_um: float = 1.0,
    station_spacing_mm: float = 0.05,
    cutoff_mm: float | None = None,
    lambda_s_mm: float = 0.0,
    on_progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> Measurement:
    """Measure one program, or several side by side.

    Shaped regions (by the program's header) are simulated block by block at their feed, all others
    with the controller's own motion.

    Args:
        programs: one or several programs, or their files.
        machine: controller and modes.
        tool_diameter_mm: diameter of the disc swept along the response.
        plant: "modal" or "feed-drive", see `sg.stream`.
        against: the program whose path is the nominal one; None: the first of several if it has no shaped region
            and each of the others has one; else each program's own path.
        lines: sections by first and last lines of the nominal program; None: sequences of lines of one direction,
            of arcs about one centre, and of short moves (a curve).
        band_um: settled means within this distance of the command.
        station_spacing_mm: largest distance between two measured stations of walls.
        cutoff_mm: cut-off lambda c of the roughness; None: the standard's, by the length of a section.
        lambda_s_mm: short-wave cut-off of the roughness; 0: none.
        on_progress: called with completed and total regions.

    Returns:
        The figures of every section of every program, and which programs keep `tolerance.contour_um`.

    Raises:
        ArgumentError: no program, one without cuts, a value outside its range, lines without a cut, or a program
            without the regions of the one it is measured against.
        ProgramError: a program cannot be read, or a region takes too long to compute.
        OSError: a file cannot be read.
        MachineError: the machine has no feed drives.
        NumericError: the integrator of a feed drive fails.
    """
    machine = Machine.of(machine)
    given = [programs] if isinstance(programs, Program | str | Path) else list(programs)
    several = [given_program(each, machine) for each in given]
    if not several:
        raise _core.ArgumentError("no program to measure")
    options = _options(tool_diameter_mm, band_um, station_spacing_mm, cutoff_mm, lambda_s_mm)
    shaped = [program.shaped_regions > 0 for program in several]
    if against is not None:
        against = given_program(against, machine)
    elif len(several) > 1 and not shaped[0] and all(shaped[1:]):
        against = several[0]
    for program in several if against is None else [against]:
        if not program.regions:
            raise _core.ArgumentError(f"{program.source}: no cutting move, nothing to measure")
    total, done = sum(len(program.regions) for program in several), 0

    def one_done() -> None:
        nonlocal done
        done += 1
        on_progress(min(done, total), total)

    limit_um = machine.tolerance.contour_um
    beside = [(each.source, ours, (against or each).source) for each, ours in zip(several, shaped, strict=True)]
    # The tolerance applies to shaped programs measured against the programmed path, which is not their own path; if
    # there are none, to the unshaped ones.
    judged = [ours and path != name for name, ours, path in beside]
    judged = judged if any(judged) else [not ours for ours in shaped]
    measured = []
    for program, about, counts in zip(several, beside, judged, strict=True):
        jobs = jobs_of(program, against or program, machine, lines)
        regions = tuple(_measured_regions(jobs, machine, plant, options, one_done))
        warnings = (
            *program.warnings,
            *machine_warnings(machine),
            *region_range_warnings(program.regions, machine),
            *(why for _, why in shaped_warnings(program, machine)),
            *_coarse_warnings(regions, station_spacing_mm, jobs),
        )
        measured.append(MeasuredProgram.of(about, regions, limit_um if counts else None, warnings))
    names = [Path(program.source).name for program in several]
    second = several[1] if len(several) > 1 else None
    simulated = SimulatedPrograms(several[0], machine, second, labels=(names[0], names[-1]), plant=plant)
    asked = tool_diameter_mm, band_um, station_spacing_mm, cutoff_mm, lambda_s_mm
    return Measurement(machine.name, plant, *asked, limit_um, tuple(measured), simulated)


def _coarse_warnings(regions: Iterable[MeasuredRegion], asked_mm: float, jobs: Iterable[Job]) -> Iterator[str]:
    for region in regions:
        if region.station_spacing_mm > asked_mm:
            yield (
                f"lines {region.lines[0]} to {region.lines[1]}: so long a path that its walls are measured every "
                f"{region.station_spacing_mm:.3g} mm, not every {asked_mm:g} mm"
            )
    joined_mm = max((job.joined_mm for job in jobs), default=0.0)
    if joined_mm > 0.0:
        yield (
            f"so many sections that lines and arcs below {joined_mm:.3g} mm are measured together as curves; "
            "--lines selects sections"
        )


def _options(
    tool_diameter_mm: float, band_um: float, station_spacing_mm: float, cutoff_mm: float | None, lambda_s_mm: float
) -> _core.MetrologyOptions:
    """Check the measuring options before simulating anything."""
    diameter, spacing, cutoff = tool_diameter_mm, station_spacing_mm, cutoff_mm or 0.0
    for name, value, is_in, limit in (
        ("tool diameter", diameter, diameter > 0.0, "above 0"), ("station spacing", spacing, spacing > 0.0, "above 0"),
        ("tool diameter", diameter, diameter <= _MAX_TOOL_MM, f"at most {_MAX_TOOL_MM:g} mm"),
        ("station spacing", spacing, spacing >= _MIN_SPACING_MM, f"at least {_MIN_SPACING_MM:g} mm"),
        ("cut-off", cutoff, cutoff >= 0.0, "at least 0"), ("lambda s", lambda_s_mm, lambda_s_mm >= 0.0, "at least 0"),
    ):  # fmt: skip
        if not (is_in and math.isfinite(value)):
            raise _core.ArgumentError(f"{name} is {value:g} mm, must be {limit}")
    options = _core.MetrologyOptions()
    options.tool_radius_mm = tool_diameter_mm / 2.0
    options.station_spacing_mm, options.band_mm = station_spacing_mm, band_um * 1e-3
    options.cutoff_mm, options.lambda_s_mm = cutoff, lambda_s_mm
    return options


def measure_samples(
    chunks: Iterable[tuple[FloatArray, FloatArray]],
    path: _core.Path,
    period_s: float,
    tool_diameter_mm: float,
    *,
    lines: tuple[int, int] = (1, 1),
    band_um: float = 1.0,
    station_spacing_mm: float = 0.05,
    cutoff_mm: float | None = None,
    lambda_s_mm: float = 0.0,
) -> MeasuredRegion:
    """Measure samples of command and response from any source against a path.

    Args:
        chunks: command and response, (n, 3) each, mm, piece by piece; the first sample is at the start of the path.
        path: the programmed path.
        period_s: time between two samples.
        tool_diameter_mm: diameter of the disc swept along the response.
        lines: first and last line of the path in its program, for reports.
        band_um: settled means within this distance of the command.
        station_spacing_mm: see `measure`.
        cutoff_mm: see `measure`.
        lambda_s_mm: see `measure`.

    Returns:
        The figures of the path and of its sections.

    Raises:
        ArgumentError: a value outside its range, arrays of other shapes, or values that are not finite.
    """
    options = _options(tool_diameter_mm, band_um, station_spacing_mm, cutoff_mm, lambda_s_mm)
    options.period_s = period_s
    return _measured(chunks, path, _core.path_sections(path), options, lines)


def _measured_regions(
    jobs: Iterable[Job], machine: Machine, plant: str, options: _core.MetrologyOptions, on_done: Callable[[], None]
) -> Iterator[MeasuredRegion]:
    """Simulate and measure every region of a program."""
    kept = 0
    options.period_s = machine.controller.interpolation_period_s
    for number, job in enumerate(jobs, start=1):
        samples, keep = _samples(job, machine, plant), kept < _MAX_PROFILE_STATIONS
        lines = (job.nominal.first_line, job.nominal.last_line)
        region = _measured(samples, job.nominal.path, job.sections, options, lines, number, keep_walls=keep)
        kept += sum(each.walls.distance_mm.size for each in region.sections if each.walls is not None)
        yield region
        on_done()


def _measured(
    chunks: Iterable[tuple[FloatArray, FloatArray]], path: _core.Path, sections: list[_core.PathSection],
    options: _core.MetrologyOptions, lines: tuple[int, int], region: int = 1, *, keep_walls: bool = True,
) -> MeasuredRegion:  # fmt: skip
    metrology = _core.SectionMetrology(path, sections, options)
    for command, response in chunks:
        metrology.feed(command, response)
    walls: list[WallProfile | None] = [None] * len(sections)
    for index in range(len(sections)) if keep_walls else ():
        first_mm, spacing_mm, left, right, point, normal = metrology.wall_profile(index)
        distance_mm = first_mm + spacing_mm * np.arange(left.size, dtype=np.float64)
        walls[index] = WallProfile(distance_mm, left * 1e3, right * 1e3, point, normal)
    figures, diameter_mm = metrology.finish(), 2.0 * options.tool_radius_mm
    both = zip(figures.sections, walls, strict=True)
    found = tuple(MeasuredSection.of(each, region, diameter_mm, wall) for each, wall in both)
    return MeasuredRegion(lines, path, figures, found, metrology.station_spacing_mm)


def _samples(job: Job, machine: Machine, plant: str) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield command and response of a region, including the decay of vibration and servo lag after the stop."""
    model = MachineModel(machine)
    memory_s = max(model.vibration_memory_s, _MIN_REST_S)
    if plant != "modal":
        # The lag decays as exp(-gain t): wait until a millionth remains, as for vibration.
        memory_s = max(memory_s, math.log(1e6) / min(machine.controller.position_gain_per_s.as_tuple()))
    rest_s = min(memory_s, _LONGEST_REST_S)
    options = model.options(plant=plant, offset=model.offset(job.simulated))
    stream = model.simulated(shaped=job.simulated.shaped).stream(job.simulated.path, options, rest_s)
    while len(chunk := stream.read(65_536)) > 0:
        yield chunk.command_mm, chunk.response_mm


def jobs_of(program: Program, nominal: Program, machine: Machine, lines: Sequence[tuple[int, int]] | None) -> list[Job]:
    """Pairs of simulated and nominal region to measure, with their sections; pairs without a section are left out."""
    pairs = [pair for pair in paired_regions(program, nominal) if pair[1].path.length_mm > 0.0]
    blocks = _BLOCKS_PER_CURVE * machine.controller.block_time_s
    blocks = blocks if program.shaped_regions > 0 and nominal is program else 0.0
    # Consecutive shorter sequences are joined to one curve.
    paths = [(region.path, max(_SHORT_MM, blocks * region.path.fastest_feed_mm_per_s)) for _, region in pairs]
    joined = 1.0
    if lines is None:
        # Increase the least length of a separate section until there are few enough; a region has at least one.
        most = max(_MAX_SECTIONS, len(pairs))
        while joined < 2.0**20 and sum(len(_core.path_sections(path, joined * mm)) for path, mm in paths) > most:
            joined *= 2.0
    jobs = []
    for (simulated, region), (path, short_mm) in zip(pairs, paths, strict=True):
        if lines is None:
            sections = _core.path_sections(path, joined * short_mm)
        else:
            sections = _core.line_sections(path, [(min(a, _LAST_LINE), min(b, _LAST_LINE)) for a, b in lines])
        if sections:
            jobs.append(Job(simulated, region, sections, joined * short_mm if joined > 1.0 else 0.0))
    if lines is not None and not jobs:
        names = ", ".join(f"{first}-{last}" for first, last in lines)
        raise _core.ArgumentError(f"{nominal.source}: no cutting move in lines {names}")
    return jobs
