"""Forces along a test cut: the core's force law at the engagements that the cut's description tells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.testcut.cut import CuttingLaw, CutTool, MeasuringPass, TestCut
from shapegcode.testcut.engagement import Engagement, engagement

__all__ = ["CutForces", "Expected", "ForceLaw", "expected", "mean_chip_mm"]

Array = npt.NDArray[np.float64]
_STEP_MM = 0.1


@dataclass(frozen=True)
class CutForces:
    """Forces on the tool over one revolution, at each of n engagements.

    Attributes:
        mean_n: (n, 2) mean of the vector along the feed and to its left.
        mean_resultant_n: (n,) mean of the magnitude.
        peak_resultant_n: (n,) largest magnitude.
        mean_torque_nm: (n,).
    """

    mean_n: Array
    mean_resultant_n: Array
    peak_resultant_n: Array
    mean_torque_nm: Array


class ForceLaw:
    """A tool with coefficients at a spindle speed and an axial depth."""

    def __init__(self, tool: CutTool, law: CuttingLaw, spindle_rev_per_min: float, axial_depth_mm: float) -> None:
        """Make the tables of the core."""
        mill = _core.EndMill(tool.diameter_mm, tool.flutes, math.radians(tool.helix_deg), list(tool.runout_mm))
        self._force = _core.MillingForce(mill, law.core(), spindle_rev_per_min)
        self._depth = axial_depth_mm

    def forces(self, met: Engagement, feed_mm_per_min: Array | Sequence[float]) -> CutForces:
        """Forces at each engagement with the feed at it, in mm/min."""
        rows = np.zeros((len(met.from_rad), 5))
        for k, (begin, end, feed) in enumerate(zip(met.from_rad, met.to_rad, feed_mm_per_min, strict=True)):
            if end <= begin or feed <= 0.0:
                continue
            figures = self._force.figures(np.array([[begin, end, 0.0, self._depth]]), float(feed))
            rows[k, :2] = figures.mean_n
            rows[k, 2:] = figures.mean_resultant_n, figures.peak_resultant_n, figures.mean_torque_nm
        return CutForces(rows[:, :2], rows[:, 2], rows[:, 3], rows[:, 4])


def mean_chip_mm(
    tool: CutTool, spindle_rev_per_min: float, axial_depth_mm: float, met: Engagement, feed_mm_per_min: Array
) -> Array:
    """Mean chip thickness that the force law gives each engagement its coefficients by.

    The law itself tells it: with the exponent 1 the force is the mean chip thickness times the force with exponent 0.
    """
    once, twice = (
        ForceLaw(tool, CuttingLaw(1.0, exponent), spindle_rev_per_min, axial_depth_mm)
        .forces(met, feed_mm_per_min)
        .mean_torque_nm
        for exponent in (0.0, 1.0)
    )
    return np.asarray(np.divide(twice, once, out=np.zeros_like(once), where=once > 0.0))


@dataclass(frozen=True, eq=False)
class Expected:
    """What the force law lets expect along a pass, at stations.

    Attributes:
        x_mm: (n,) ascending, of the tool's axis.
        mean_n: (n,) magnitude of the mean force.
        mean_resultant_n: (n,) mean magnitude.
        peak_resultant_n: (n,) largest magnitude.
    """

    x_mm: Array
    mean_n: Array
    mean_resultant_n: Array
    peak_resultant_n: Array


def expected(cut: TestCut, measuring: MeasuringPass, law: CuttingLaw | None = None) -> Expected:
    """Forces along a pass at its commanded feeds."""
    count = math.ceil((measuring.end_mm - measuring.start_mm) / _STEP_MM) + 1
    x = np.linspace(measuring.start_mm, measuring.end_mm, count)
    met = engagement(cut.tool, measuring, x, up=cut.up)
    along = ForceLaw(cut.tool, law or cut.tool.cutting, cut.spindle_rev_per_min, cut.axial_depth_mm)
    forces = along.forces(met, measuring.commanded_feed(x))
    return Expected(x, np.linalg.norm(forces.mean_n, axis=1), forces.mean_resultant_n, forces.peak_resultant_n)
