"""The round trip: the emitted text is read back, played as the controller would, and measured.

Nothing here looks at what the converter meant to write; the figures are those of the text.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.controller import controller_model
from shapegcode.emit import motion_limits
from shapegcode.machine import Machine
from shapegcode.moving_modes import NO_OFFSET, Offset, mode_tables, region_offset, slowest_mode, still_mode
from shapegcode.program import Program, least_increment_mm

OVERRIDES = (0.8, 0.9, 1.1, 1.2)
_BLOCK_ENDS = (_core.BlockEnd.ceil, _core.BlockEnd.carry)
_LARGEST_SWEEP_RAD = math.pi / 2
_STATE_FIELDS = (
    "motion", "plane", "distance", "feed_mode", "units", "compensation", "length_offset",
    "cycle", "cycle_return", "coordinate_system", "exact_stop", "feed",
)  # fmt: skip

Vector = npt.NDArray[np.float64]
Step = Callable[[int, int], None]


class RoundTripError(_core.ShapegcodeError):
    """The emitted text does not say what it should: a defect of shapegcode, never of the input. Nothing is written."""


@dataclass(frozen=True)
class Placed:
    """A region and where its shaped blocks stand in the emitted text.

    Attributes:
        region: of the original program.
        first_line: first emitted line, from 1.
        last_line: last emitted line.
    """

    region: _core.Region
    first_line: int
    last_line: int


@dataclass(frozen=True)
class RegionFigures:
    """One region played: as programmed, and as emitted under both rules of block end.

    Attributes:
        original: the programmed path under the controller's own motion.
        emitted: the emitted blocks, one entry per rule (ceil, carry).
        overrides: residual of the emitted blocks per feed override, mm, (3,).
        shifted: the same per shift of the modes (see `mode_shifts`).
        slowed_blocks: emitted blocks that the controller's look-ahead limits would slow.
    """

    original: _core.PlaybackFigures
    emitted: tuple[_core.PlaybackFigures, ...]
    overrides: tuple[Vector, ...]
    shifted: tuple[Vector, ...]
    slowed_blocks: int


def axis_modes(machine: Machine, shift: float = 0.0) -> list[list[_core.Mode]]:
    """Modes of X, Y, Z for the core, each shifted by `shift` times its stated uncertainty.

    A table over the part's mass is looked up; of one over a position the nominal frequency is taken.
    """
    return [
        [
            _core.Mode(
                still.frequency_hz * (1.0 + shift * (mode.frequency_uncertainty_percent or 0.0) / 100.0),
                still.damping_ratio,
                still.participation,
            )
            for mode in axis.modes
            for still in (still_mode(mode, machine.shaping.part_mass_kg),)
        ]
        for axis in machine.axes.as_tuple()
    ]


def mode_shifts(machine: Machine) -> tuple[float, ...]:
    """-1 and +1 where a mode states an uncertainty of its frequency, else nothing."""
    stated = any(mode.frequency_uncertainty_percent for axis in machine.axes.as_tuple() for mode in axis.modes)
    return (-1.0, 1.0) if stated else ()


def playback_options(
    machine: Machine, *, time_constant_s: float = 0.0, shift: float = 0.0, offset: Offset = NO_OFFSET
) -> _core.PlaybackOptions:
    """Plant and interpolation period of a machine, with an acceleration filter after interpolation.

    Args:
        machine: modes and controller.
        time_constant_s: length of the filter; 0: none.
        shift: see `axis_modes`.
        offset: from the command's positions to the machine's, for modes that vary with them.
    """
    options = _core.PlaybackOptions()
    period = machine.controller.interpolation_period_s
    options.period_s = period
    options.modes = axis_modes(machine, shift)
    options.mode_tables = mode_tables(machine, shift, offset)
    options.axis_filters = [
        _core.Fir.moving_average(round(length / period)) for length in (time_constant_s,) if round(length / period) > 1
    ]
    return options


def _own_rule(machine: Machine) -> _core.BlockEnd:
    rule: _core.BlockEnd = getattr(_core.BlockEnd, machine.controller.block_end)
    return rule


def play_original(
    path: _core.Path, machine: Machine, *, record_samples: int = 0, offset: Offset = NO_OFFSET
) -> _core.PlaybackFigures:
    """A programmed path as the controller plays an ordinary program."""
    model = controller_model(machine)
    options = playback_options(machine, offset=offset)
    options.axis_filters = _core.acceleration_filters(model)
    options.record_samples = record_samples
    if model.motion == _core.MotionKind.look_ahead:
        return _core.play_path(path, _core.plan_speed(path, model.limits), options)
    return _core.play_blocks(path, path, model.block_end, 1.0, options)


def play_emitted(
    blocks: _core.Path,
    path: _core.Path,
    machine: Machine,
    block_end: _core.BlockEnd | None = None,
    *,
    override: float = 1.0,
    contour: bool = True,
    last_seconds: float = 0.0,
    shift: float = 0.0,
    record_samples: int = 0,
    offset: Offset = NO_OFFSET,
) -> _core.PlaybackFigures:
    """Emitted blocks as the controller plays them (None: by its own rule), measured against the programmed path."""
    own = machine.controller.shaped_time_constant_s
    options = playback_options(machine, time_constant_s=own, shift=shift, offset=offset)
    options.measure_contour = contour
    options.last_seconds = last_seconds
    options.record_samples = record_samples
    return _core.play_blocks(blocks, path, block_end or _own_rule(machine), override, options)


def read_back(text: bytes, placed: Sequence[Placed], machine: Machine) -> Program:
    """Read the emitted text and hold it against the original: end points, modal state at every border, sweeps.

    Raises:
        RoundTripError: something differs; the message names the line and both values.
    """
    probes = [line for place in placed for line in (place.first_line - 1, place.last_line)]
    emitted = Program.from_text(text, machine, source="emitted program", emitted=True, probe_lines=probes)
    states = emitted.core.probed
    for index, place in enumerate(placed):
        region = place.region
        _compare_states(states[2 * index], region.entry, place.first_line - 1, region.incremental, machine)
        _compare_states(states[2 * index + 1], region.exit, place.last_line, region.incremental, machine)
        blocks = emitted.core.cutting_path(place.first_line, place.last_line)
        _compare_ends(blocks, place, machine)
        if blocks.largest_sweep_rad >= _LARGEST_SWEEP_RAD:
            raise RoundTripError(
                f"emitted arc between lines {place.first_line} and {place.last_line} sweeps "
                f"{math.degrees(blocks.largest_sweep_rad):.1f} degrees (limit 90)"
            )
    return emitted


def measure(
    emitted: Program,
    placed: Sequence[Placed],
    originals: Sequence[Future[_core.PlaybackFigures]],
    machine: Machine,
    pool: Executor,
    on_step: Step = lambda _done, _total: None,
) -> list[RegionFigures]:
    """Play every emitted region beside its original.

    Args:
        emitted: the program read back.
        placed: the regions and their places in it.
        originals: the originals' playbacks under way, one per region (`play_original`).
        machine: controller model and plant.
        pool: runs the playbacks.
        on_step: called with regions done and regions in all.
    """
    limits = motion_limits(machine)
    memory_s = _vibration_memory_s(machine)
    running = []
    for place in placed:
        path = place.region.path
        blocks = emitted.core.cutting_path(place.first_line, place.last_line)
        play = partial(play_emitted, blocks, path, machine, offset=region_offset(place.region, machine))
        runs = [pool.submit(play, rule) for rule in _BLOCK_ENDS]
        residual = partial(play, contour=False, last_seconds=memory_s)
        overrides = [pool.submit(residual, override=ratio) for ratio in OVERRIDES]
        shifted = [pool.submit(residual, shift=shift) for shift in mode_shifts(machine)]
        slowed = pool.submit(
            _core.count_slowed_blocks, blocks, limits.corner_speed_difference_mm_per_s, limits.max_feed_mm_per_s
        )
        running.append((runs, overrides, shifted, slowed))
    results: list[RegionFigures] = []
    for original, (runs, overrides, shifted, slowed) in zip(originals, running, strict=True):
        results.append(
            RegionFigures(
                original.result(),
                tuple(run.result() for run in runs),
                tuple(run.result().residual_mm for run in overrides),
                tuple(run.result().residual_mm for run in shifted),
                slowed.result(),
            )
        )
        on_step(len(results), len(placed))
    return results


def _vibration_memory_s(machine: Machine) -> float:
    """Time after which a vibration is a millionth of itself; 0 where a mode has no damping to speak of."""
    rates = [
        damping * 2.0 * math.pi * frequency
        for axis in machine.axes.as_tuple()
        for mode in axis.modes
        for frequency, damping in (slowest_mode(mode),)
    ]
    slowest = min(rates, default=0.0)
    return math.log(1e6) / slowest if slowest > 0.01 else 0.0


def other_time_s(program: _core.ProgramText, machine: Machine) -> float:
    """Time of everything between the regions, s: rapids, waits for in-position, dwells, kept moves, functions.

    Moves of which an axis' position is not known count with what is known of them.
    """
    return _core.time_program(program, controller_model(machine)).outside_regions_s


def summarise(figures: Sequence[RegionFigures], placed: Sequence[Placed], machine: Machine) -> dict[str, Any]:
    """The figures of all regions as the stable keys of the report; the emitted ones are the worse of both rules."""
    emitted = [run for region in figures for run in region.emitted]
    originals = [region.original for region in figures]
    return {
        "residual_vibration_um": {
            "original": largest_um(run.residual_mm for run in originals),
            "emitted": largest_um(run.residual_mm for run in emitted),
        },
        "peak_vibration_um": {
            "original": largest_um(run.peak_mm for run in originals),
            "emitted": largest_um(run.peak_mm for run in emitted),
        },
        "contour_error_um": {
            "command": {
                "original": deviation_um(run.command for run in originals),
                "emitted": deviation_um(run.command for run in emitted),
            },
            "response": {
                "original": deviation_um(run.response for run in originals),
                "emitted": deviation_um(run.response for run in emitted),
            },
        },
        "orbit_error_percent": [
            max(pair)
            for region in figures
            for pair in zip(*(run.orbit_error_percent for run in region.emitted), strict=True)
        ],
        "override_residual": [
            {"override": ratio, "residual_um": largest_um(region.overrides[k] for region in figures)}
            for k, ratio in enumerate(OVERRIDES)
        ],
        "frequency_residual": [
            {"shift": shift, "residual_um": largest_um(region.shifted[k] for region in figures)}
            for k, shift in enumerate(mode_shifts(machine))
        ],
        "slowed_blocks": sum(region.slowed_blocks for region in figures),
        "regions": [_region_summary(region, place, machine) for region, place in zip(figures, placed, strict=True)],
    }


def contour_target(machine: Machine) -> str:
    """What the contour tolerance is about: "command" or "response"."""
    return "response" if machine.shaping.contour == "response" else "command"


def contour_um(runs: Iterable[_core.PlaybackFigures], machine: Machine) -> float:
    """Largest deviation from the path of what the contour tolerance is about, µm."""
    target = contour_target(machine)
    return max(float(getattr(run, target).max_abs_mm) for run in runs) * 1e3


def _region_summary(figures: RegionFigures, place: Placed, machine: Machine) -> dict[str, Any]:
    tolerance = machine.tolerance
    misses = []
    increment_um = least_increment_mm(machine, place.region.exit.units) * 1e3
    rounding_um = tolerance.residual_floor_increments * increment_um
    before = figures.original.residual_mm * 1e3
    after = np.max([run.residual_mm for run in figures.emitted], axis=0) * 1e3
    limits = [max(tolerance.residual_ratio * was, tolerance.residual_floor_um, rounding_um) for was in before]
    for axis, now, limit in zip("XYZ", after, limits, strict=True):
        if now > limit:
            misses.append(f"residual vibration {axis} {now:.2f} um, limit {limit:.2f} um")
    contour = contour_um(figures.emitted, machine)
    if contour > tolerance.contour_um:
        misses.append(
            f"contour error of the {contour_target(machine)} {contour:.1f} um, limit {tolerance.contour_um:.1f} um"
        )
    return {
        "lines": [place.region.first_line, place.region.last_line],
        "emitted_lines": [place.first_line, place.last_line],
        "time_s": {
            "original": figures.original.duration_s,
            "emitted": max(run.duration_s for run in figures.emitted),
        },
        "residual_vibration_um": {"original": _xyz(before), "emitted": _xyz(after)},
        "residual_limit_um": _xyz(limits),
        "contour_error_um": contour,
        "misses": misses,
    }


def _compare_states(
    emitted: _core.ModalState, original: _core.ModalState, line: int, incremental: bool, machine: Machine
) -> None:
    for field in _STATE_FIELDS:
        was, now = getattr(original, field), getattr(emitted, field)
        if was != now and not (field == "feed" and original.feed_mode == 93):
            raise RoundTripError(f"emitted line {line}: modal {field} is {now}, the original has {was}")
    if original.known != emitted.known:
        raise RoundTripError(f"emitted line {line}: known axes {emitted.known}, the original has {original.known}")
    if incremental:
        return
    limit = _end_tolerance_mm(machine, original.units)
    for axis, known, was, now in zip("XYZ", original.known, original.position_mm, emitted.position_mm, strict=True):
        if known and abs(was - now) > limit:
            raise RoundTripError(f"emitted line {line}: {axis} is at {now:.6f} mm, the original at {was:.6f} mm")


def _compare_ends(blocks: _core.Path, place: Placed, machine: Machine) -> None:
    path = place.region.path
    travel = path.end_mm - path.start_mm
    gap = float(np.abs((blocks.end_mm - blocks.start_mm) - travel).max())
    # Start and end are rounded to the increment, each once.
    limit = 2.0 * _end_tolerance_mm(machine, place.region.exit.units)
    if gap > limit:
        raise RoundTripError(
            f"shaped blocks of lines {place.region.first_line} to {place.region.last_line} end {gap * 1e3:.2f} um off "
            f"(limit {limit * 1e3:.2f} um)"
        )


def _end_tolerance_mm(machine: Machine, units: int) -> float:
    # Half an increment: a program may carry more digits than the controller resolves.
    return 0.5 * least_increment_mm(machine, units) + 1e-9


def _xyz(values: Iterable[float]) -> dict[str, float]:
    return {axis: float(value) for axis, value in zip("xyz", values, strict=True)}


def largest_um(vectors: Iterable[Vector]) -> dict[str, float]:
    """Largest of each axis, mm to µm."""
    rows = list(vectors)
    return _xyz(np.max(rows, axis=0) * 1e3 if rows else np.zeros(3))


def deviation_um(stats: Iterable[_core.DeviationStats]) -> dict[str, float]:
    """Largest magnitude, RMS over all samples and largest on either side of the path, µm."""
    rows = list(stats)
    count = sum(row.count for row in rows)
    squares = sum(row.sum_of_squares_mm2 for row in rows)
    return {
        "max": max((row.max_abs_mm for row in rows), default=0.0) * 1e3,
        "rms": math.sqrt(squares / count) * 1e3 if count else 0.0,
        "left": max((row.most_positive_mm for row in rows), default=0.0) * 1e3,
        "right": -min((row.most_negative_mm for row in rows), default=0.0) * 1e3,
    }
