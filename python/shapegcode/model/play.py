"""Paths played on the machine's model: as the controller plays a program, and as it plays shaped blocks."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.controller import controller_model, motion_limits
from shapegcode.model.modes import NO_OFFSET, Offset, axis_modes, mode_tables, slowest_mode

Vector = npt.NDArray[np.float64]


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
