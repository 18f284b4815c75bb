"""The round trip: the emitted text is read back, played as the controller would, and measured.

Nothing here looks at what the converter meant to write; the figures are those of the text.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.controller import controller_model
from shapegcode.emit import motion_limits
from shapegcode.machine import Machine
from shapegcode.moving_modes import NO_OFFSET, Offset, axis_modes, mode_tables, slowest_mode
from shapegcode.program import Program, least_increment_mm
from shapegcode.worst_case import Deviation

_LARGEST_SWEEP_RAD = math.pi / 2
_STATE_FIELDS = (
    "motion", "plane", "distance", "feed_mode", "units", "compensation", "length_offset",
    "cycle", "cycle_return", "coordinate_system", "exact_stop", "feed",
)  # fmt: skip

Vector = npt.NDArray[np.float64]


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


def playback_options(
    machine: Machine, *, time_constant_s: float = 0.0, shift: float = 0.0, offset: Offset = NO_OFFSET
) -> _core.PlaybackOptions:
    """Plant and interpolation period of a machine, with an acceleration filter after interpolation.

    Args:
        machine: modes and controller.
        time_constant_s: length of the filter; 0: none.
        shift: see `moving_modes.axis_modes`.
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


def own_rule(machine: Machine) -> _core.BlockEnd:
    """The controller's own rule of block timing."""
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
    command_contour: bool = True,
    last_seconds: float = 0.0,
    shift: float = 0.0,
    record_samples: int = 0,
    offset: Offset = NO_OFFSET,
    starved_blocks: Sequence[int] = (),
    memory_s: float = 0.0,
    tracker: _core.ContourTracker | None = None,
) -> _core.PlaybackFigures:
    """Emitted blocks as the controller plays them, measured against the programmed path.

    Args:
        blocks: what was emitted.
        path: what was programmed.
        machine: controller and modes.
        block_end: rule of block timing; None: the controller's own.
        override: feed override, 1 = 100 %.
        contour: measure the deviations too.
        command_contour: that of the command among them.
        last_seconds: play no more than the end; 0: all.
        shift: see `moving_modes.axis_modes`.
        record_samples: samples kept for pictures.
        offset: see `playback_options`.
        starved_blocks: behind each of these, tried one by one, the buffer is empty for `verdict.starved_s`.
        tracker: of the programmed path, shared by several runs; None: one of its own.
        memory_s: how long after that its vibration is looked at; 0: to the end.
    """
    controller = machine.controller
    own = controller.shaped_time_constant_s
    options = playback_options(machine, time_constant_s=own, shift=shift, offset=offset)
    options.measure_contour = contour
    if tracker is not None:
        options.tracker = tracker
    options.measure_command = command_contour
    options.last_seconds = last_seconds
    options.record_samples = record_samples
    if starved_blocks:
        options.starved_blocks = list(starved_blocks)
        options.starved_s = machine.verdict.starved_s
        options.starved_memory_s = memory_s + own if memory_s > 0.0 else 0.0
    return _core.play_blocks(blocks, path, block_end or own_rule(machine), override, options)


def play_planned(
    blocks: _core.Path, path: _core.Path, machine: Machine, *, offset: Offset = NO_OFFSET
) -> _core.PlaybackFigures:
    """Emitted blocks as the controller's look-ahead plans them anew if it is left on, against the programmed path."""
    options = playback_options(
        machine, time_constant_s=machine.controller.look_ahead_filter_time_constant_s, offset=offset
    )
    return _core.play_path(blocks, _core.plan_speed(blocks, motion_limits(machine)), options, path)


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


def vibration_memory_s(machine: Machine) -> float:
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


def xyz(values: Iterable[float]) -> dict[str, float]:
    """One value per axis under its letter."""
    return {axis: float(value) for axis, value in zip("xyz", values, strict=True)}


def largest_um(vectors: Iterable[Vector]) -> dict[str, float]:
    """Largest of each axis, mm to µm."""
    rows = list(vectors)
    return xyz(np.max(rows, axis=0) * 1e3 if rows else np.zeros(3))


def deviation_um(stats: Iterable[_core.DeviationStats], material_side: str | None = None) -> dict[str, float]:
    """Largest magnitude, RMS over all samples and largest on either side of the path, µm.

    Args:
        stats: of one or several runs.
        material_side: "left" or "right" of the travel, where the workpiece is: adds `gouge` and `excess`.
    """
    rows = list(stats)
    count = sum(row.count for row in rows)
    squares = sum(row.sum_of_squares_mm2 for row in rows)
    largest = Deviation.of(rows) if rows else Deviation(0.0, 0.0, 0.0)
    found = {
        "max": largest.largest_mm * 1e3,
        "rms": math.sqrt(squares / count) * 1e3 if count else 0.0,
        "left": largest.left_mm * 1e3,
        "right": largest.right_mm * 1e3,
    }
    return found if material_side is None else found | largest.gouge_and_excess_um(material_side)
