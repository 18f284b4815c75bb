"""The motion that a conversion makes of a region, for the plan of its feeds."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.conversion.write import filter_tolerance
from shapegcode.feed.plan import Travelled
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.shaping.grid import Grid

__all__ = ["ShapedMotion"]

Vector = npt.NDArray[np.float64]


class ShapedMotion:
    """The motion that `convert` will make of a region: look-ahead within the contour tolerance, then the shaper.

    What the emitted text does is measured afterwards (`travel_emitted`); this is what a schedule is planned with.
    """

    def __init__(self, machine: Machine, grid: Grid) -> None:
        period = machine.controller.interpolation_period_s
        ticks = round(grid.block_period_s / period)
        self._period_s = period
        model = MachineModel(machine)
        self._limits = model.limits()
        self._tolerance = filter_tolerance(grid, model.shaped_filter, machine.tolerance.contour_um)
        shaper = _core.Fir([ticks * delay for delay in grid.fir.delays], list(grid.fir.taps))
        # The emitted blocks join samples of the shaped command by straight lines.
        self._filters = [shaper, _core.Fir.moving_average(ticks), *model.shaped.filters]

    @property
    def reach_s(self) -> float:
        """Half of what shaper and filters last."""
        return 0.5 * self._period_s * sum(filter_.duration_samples for filter_ in self._filters)

    def travel(self, path: _core.Path, along: _core.Path, stations_mm: Vector, window_s: float) -> Travelled:
        """See `Mover`."""
        profile = _core.plan_speed(path, self._limits, self._tolerance)
        return Travelled.of(
            _core.travel_path(path, profile, along, stations_mm, self._period_s, self._filters, window_s)
        )
