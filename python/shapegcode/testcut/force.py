"""Forces along a test cut: the core's force law at the engagements that the cut's description tells."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.testcut.plan import CutTool, Engagement

__all__ = ["COEFFICIENTS", "CutForces", "ForceLaw", "coefficients", "mean_chip_mm"]

Array = npt.NDArray[np.float64]

COEFFICIENTS = (
    "specific_n_per_mm2",
    "specific_exponent",
    "ratio",
    "ratio_exponent",
    "tangential_edge_n_per_mm",
    "radial_edge_n_per_mm",
)


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


def coefficients(values: Mapping[str, Any]) -> _core.CuttingCoefficients:
    """The core's coefficients from the keys of a tool file's ``[cutting]``; those that are left out are 0."""
    return _core.CuttingCoefficients(
        **{name: float(values.get(name, 0.0)) for name in COEFFICIENTS},
        thickness=_core.ChipThickness.__members__[values.get("chip_thickness", "mean")],
    )


class ForceLaw:
    """A tool with coefficients at a spindle speed and an axial depth."""

    def __init__(
        self, tool: CutTool, values: Mapping[str, Any], spindle_rev_per_min: float, axial_depth_mm: float
    ) -> None:
        """Make the tables of the core.

        Raises:
            ArgumentError: a tool or coefficients that the core refuses.
        """
        mill = _core.EndMill(tool.diameter_mm, tool.flutes, math.radians(tool.helix_deg), list(tool.runout_mm))
        self._force = _core.MillingForce(mill, coefficients(values), spindle_rev_per_min)
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
    plain = {"specific_n_per_mm2": 1.0}
    once, twice = (
        ForceLaw(tool, {**plain, "specific_exponent": exponent}, spindle_rev_per_min, axial_depth_mm)
        .forces(met, feed_mm_per_min)
        .mean_torque_nm
        for exponent in (0.0, 1.0)
    )
    return np.asarray(np.divide(twice, once, out=np.zeros_like(once), where=once > 0.0))
