"""Mean forces over whole revolutions with what the tool met, and the forces that a law gives there."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from shapegcode.testcut.cut import CuttingLaw, CutTool
from shapegcode.testcut.engagement import Engagement
from shapegcode.testcut.force import ForceLaw, mean_chip_mm

__all__ = ["ForceModel", "MeanForces", "Thickness", "chips_mm"]

Array = npt.NDArray[np.float64]
Thickness = Literal["mean", "local"]
_STEP = 1e-5  # of the logarithms and exponents, for slopes
_EDGE_STEP = 0.1  # N/mm


@dataclass(frozen=True, eq=False)
class MeanForces:
    """Mean forces on the tool over whole revolutions, with what it met.

    Attributes:
        met: n engagements.
        feed_mm_per_min: (n,).
        spindle_rev_per_min: (n,).
        force_n: (n, 2) along the feed and to its left.
        revolutions: (n,) how many each is the mean of.
        group: (n,) number of the pass or file, in the order in which it was cut.
        displaced: n engagements if the place of the tool were off by its standard error, the same way for all rows of
            a group; None: the engagements are exact.
        torque_nm: (n,) mean torque of the spindle; None: not measured.
    """

    met: Engagement
    feed_mm_per_min: Array
    spindle_rev_per_min: Array
    force_n: Array
    revolutions: Array
    group: npt.NDArray[np.intp]
    displaced: Engagement | None = None
    torque_nm: Array | None = None


def chips_mm(tool: CutTool, depth: float, data: MeanForces) -> Array:
    """(n,) mean chip thickness of each row."""
    found = np.zeros(len(data.feed_mm_per_min))
    for speed, at, met in _by_speed(data):
        found[at] = mean_chip_mm(tool, speed, depth, met, data.feed_mm_per_min[at])
    return found


def _by_speed(data: MeanForces) -> Iterator[tuple[float, npt.NDArray[np.intp], Engagement]]:
    """Each spindle speed with the rows and engagements at it."""
    for speed in np.unique(data.spindle_rev_per_min):
        at = np.flatnonzero(data.spindle_rev_per_min == speed)
        yield float(speed), at, Engagement(*(column[at] for column in vars(data.met).values()))


class ForceModel:
    """Mean forces over the parameters: ln k1 and ln k2 at the reference chip, their exponents, edge forces."""

    def __init__(
        self, tool: CutTool, axial_depth_mm: float, data: MeanForces, thickness: Thickness, reference_mm: float
    ) -> None:
        self.tool, self.depth, self.data, self.thickness = tool, axial_depth_mm, data, thickness
        self.reference = reference_mm
        # A torque is laid over as the force at the tool's radius that makes it.
        self.at_radius = 1e3 / tool.radius_mm
        torque = [] if data.torque_nm is None else [self.at_radius * data.torque_nm]
        self.measured = np.column_stack([data.force_n, *torque])

    def law(self, parameters: Array) -> CuttingLaw:
        """The coefficients of parameters."""
        k1, k1_exponent, k2, k2_exponent, *edge = parameters.tolist()
        logarithm = math.log(self.reference)
        factors = math.exp(k1 - k1_exponent * logarithm), math.exp(k2 - k2_exponent * logarithm)
        k_te, k_re = edge or (0.0, 0.0)
        return CuttingLaw(factors[0], k1_exponent, factors[1], k2_exponent, k_te, k_re, self.thickness)

    def forces(self, parameters: Array) -> Array:
        """(n, 2 or 3) forces with the coefficients of parameters."""
        return self.forces_of(self.law(parameters))

    def forces_of(self, law: CuttingLaw) -> Array:
        """(n, 2 or 3) forces along the feed, to its left, and the torque's where it was measured."""
        found = np.zeros(self.measured.shape)
        for speed, at, met in _by_speed(self.data):
            forces = ForceLaw(self.tool, law, speed, self.depth).forces(met, self.data.feed_mm_per_min[at])
            found[at, :2] = forces.mean_n
            found[at, 2:] = self.at_radius * forces.mean_torque_nm[:, None]
        return found

    def slopes(self, parameters: Array, at: Array) -> Array:
        """(all measured values, p) change of the forces with each parameter; the edge forces act as they are."""
        columns = []
        for k in range(len(parameters)):
            moved = parameters.copy()
            step = _STEP if k < 4 else _EDGE_STEP
            moved[k] += step
            columns.append((self.forces(moved) - at).ravel() / step)
        return np.column_stack(columns)
