"""The response of vibration modes to set-points as arrays, with modes as the core or a machine file states them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.machine import AxisMode, Machine
from shapegcode.model.modes import axis_modes, still_mode

__all__ = ["plant_response"]

_WANTED = (
    "must be a machine or a list of modes for each axis of the command, such as [machine.axes.x.modes, "
    "machine.axes.y.modes] or [[Mode(46.0, 0.02)], []]"
)


def plant_response(
    command_mm: npt.ArrayLike, modes: Machine | Sequence[Sequence[AxisMode | _core.Mode]], period_s: float
) -> npt.NDArray[np.float64]:
    """Response of base-excited modes to a whole record of set-points, exact for set-points linear in between.

    What the real-time plant of the core gives sample by sample, to the last bit, at the speed of a batch. At rest at
    the first row.

    Args:
        command_mm: set-points in mm, shape (n_samples, n_axes), one per period.
        modes: of each axis, those of the core or of a machine file; none: the axis follows its command. A machine
            stands for the modes of its X, Y, Z, as many as the command has axes. Tables over a position count with
            their nominal mode.
        period_s: time between samples in s, above 0.

    Returns:
        Positions of the table in mm at the same instants, (n_samples, n_axes), in the memory order of the command.

    Raises:
        ArgumentError: not as many lists of modes as axes, a command that is not finite, an invalid mode or period.
    """
    if isinstance(modes, Machine):
        command_mm = np.asarray(command_mm, dtype=np.float64)
        axes = axis_modes(modes)
        return _core.plant_response(command_mm, axes[: command_mm.shape[1]] if command_mm.ndim == 2 else axes, period_s)
    if not isinstance(modes, Sequence) or isinstance(modes, str):
        raise _core.ArgumentError(f"modes are {type(modes).__name__}: {_WANTED}")
    return _core.plant_response(command_mm, [_axis(axis) for axis in modes], period_s)


def _axis(modes: Sequence[AxisMode | _core.Mode]) -> list[_core.Mode]:
    """The modes of one axis for the core."""
    if not isinstance(modes, Sequence) or not all(isinstance(mode, AxisMode | _core.Mode) for mode in modes):
        raise _core.ArgumentError(f"the modes of an axis are {str(modes)[:80]!r}: {_WANTED}")
    return [still_mode(mode, None) if isinstance(mode, AxisMode) else mode for mode in modes]
