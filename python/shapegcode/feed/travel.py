"""How fast a machine really travels along a path: the feed that the cut sees, not the F word."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel

__all__ = ["Mover", "OrdinaryMotion", "Travelled", "travel_emitted"]

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Travelled:
    """Travel along a path, one value per station.

    Attributes:
        feed_mm_per_min: largest feed per tooth on the stretch before the station, as a feed.
        time_s: time on that stretch.
    """

    feed_mm_per_min: Vector
    time_s: Vector

    @classmethod
    def of(cls, travel: _core.Travel) -> Travelled:
        """What the core found."""
        return cls(np.asarray(travel.highest_mm_per_s) * 60.0, np.asarray(travel.time_s))


class Mover(Protocol):
    """What makes a motion of the blocks of a region."""

    @property
    def reach_s(self) -> float:
        """Time by which the travel lags behind a change of the commanded feed."""

    def travel(self, path: _core.Path, along: _core.Path, stations_mm: Vector, window_s: float) -> Travelled:
        """Travel of a path made of `along`, to whose length the stations ascend; feeds are over the window."""


class OrdinaryMotion:
    """The controller's own motion, as it plays an ordinary program."""

    def __init__(self, machine: Machine) -> None:
        self._controller = MachineModel(machine).ordinary

    @property
    def reach_s(self) -> float:
        """Half of what the filters behind the interpolation last."""
        period_s = self._controller.model.period_s
        return 0.5 * period_s * sum(filter_.duration_samples for filter_ in self._controller.filters)

    def travel(self, path: _core.Path, along: _core.Path, stations_mm: Vector, window_s: float) -> Travelled:
        """See `Mover`."""
        return Travelled.of(self._controller.travel(path, along, stations_mm, window_s))


def travel_emitted(
    blocks: _core.Path, path: _core.Path, machine: Machine, stations_mm: Vector, window_s: float
) -> Travelled:
    """Travel of shaped blocks as the controller plays them, along the programmed path; else as `Mover.travel`."""
    model = MachineModel(machine)
    return Travelled.of(
        _core.travel_blocks(blocks, path, model.own_rule, stations_mm, model.period_s, model.shaped.filters, window_s)
    )
