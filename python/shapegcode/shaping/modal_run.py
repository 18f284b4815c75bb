"""Modes that follow one command side by side, for pictures and demonstrations: the plant of the core, mode by mode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shapegcode import _core

__all__ = ["ModalRun", "respond", "shaped_step"]

FloatArray = NDArray[np.float64]

_AXES = 3  # modes per run of the plant: one on each axis


@dataclass(frozen=True)
class ModalRun:
    """A command and what each mode makes of it.

    Attributes:
        times_s: instants, (n,), s.
        command: the command at them, (n,); unit of the user.
        responses: position of each mode's mass at them, (n, n_modes), same unit.
        residuals: largest |response - command| of each mode from the instant at which the command rests, (n_modes,).
    """

    times_s: FloatArray
    command: FloatArray
    responses: FloatArray
    residuals: FloatArray


def respond(modes: Sequence[_core.Mode], command: FloatArray, period_s: float) -> ModalRun:
    """Base-excited modes, each alone, under a command that is linear between its samples (first-order hold)."""
    command = np.asarray(command, dtype=np.float64)
    if not modes or command.ndim != 1 or len(command) < 2:
        raise _core.ArgumentError(
            f"a response needs at least one mode and two samples: {len(modes)} modes, samples of shape {command.shape}"
        )
    options = _core.PlaybackOptions()
    options.period_s = period_s
    options.measure_contour = False
    options.record_samples = len(command)
    path = _core.Path([_core.Segment.line([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 1.0)])
    samples = np.asfortranarray(np.tile(command[:, None], (1, _AXES)))
    responses, residuals = [], []
    for first in range(0, len(modes), _AXES):
        group = modes[first : first + _AXES]
        options.modes = [[mode] for mode in group] + [[]] * (_AXES - len(group))
        figures = _core.play_samples(samples, path, options)
        responses.append(figures.recorded_response[: len(command), : len(group)])
        residuals.append(np.asarray(figures.residual_mm)[: len(group)])
    times_s = np.arange(len(command), dtype=np.float64) * period_s
    return ModalRun(times_s, command, np.hstack(responses, dtype=np.float64), np.hstack(residuals, dtype=np.float64))


def shaped_step(shaper: _core.Shaper, period_s: float, until_s: float) -> FloatArray:
    """A unit step behind a shaper: the staircase of its taps at 0, one period, ... at least `until_s`.

    All is one period late, so that the first sample is at rest. A tap between two samples is shared by both so that
    its time is kept; its step takes two periods.
    """
    times_s = np.arange(round(until_s / period_s) + 2) * period_s
    after = (times_s[:, None] - shaper.times_s[None, :]) / period_s
    return np.asarray(np.clip(0.5 * after, 0.0, 1.0) @ shaper.amplitudes, dtype=np.float64)
