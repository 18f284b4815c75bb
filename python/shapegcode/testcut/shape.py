"""What the force law lets expect along a measuring pass."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode.testcut.force import ForceLaw
from shapegcode.testcut.means import Shape
from shapegcode.testcut.plan import MeasuringPass, TestCut, engagement

__all__ = ["Expected", "expected"]

Array = npt.NDArray[np.float64]

_STEP_MM = 0.1


@dataclass(frozen=True, eq=False)
class Expected:
    """Forces along a pass, at stations.

    Attributes:
        x_mm: (n,) of the tool's axis.
        feed_mm_per_min: (n,) commanded.
        radial_depth_mm: (n,).
        mean_n: (n,) magnitude of the mean force.
        mean_resultant_n: (n,) mean magnitude.
        peak_resultant_n: (n,) largest magnitude.
    """

    x_mm: Array
    feed_mm_per_min: Array
    radial_depth_mm: Array
    mean_n: Array
    mean_resultant_n: Array
    peak_resultant_n: Array

    def shape(self) -> Shape:
        """To find the pass in a record."""
        return Shape(self.x_mm, self.mean_n)


def expected(cut: TestCut, measuring: MeasuringPass, cutting: Mapping[str, Any] | None = None) -> Expected:
    """Forces along a pass at its commanded feeds.

    Args:
        cut: the test cut.
        measuring: the pass.
        cutting: coefficients; None: those known before.

    Returns:
        The forces in N.
    """
    count = math.ceil((measuring.end_mm - measuring.start_mm) / _STEP_MM) + 1
    x = np.linspace(measuring.start_mm, measuring.end_mm, count)
    met = engagement(cut, measuring, x)
    feed = measuring.commanded_feed(x)
    law = ForceLaw(cut.tool, cutting or cut.tool.cutting, cut.spindle_rev_per_min, cut.axial_depth_mm)
    forces = law.forces(met, feed)
    size = np.linalg.norm(forces.mean_n, axis=1)
    return Expected(x, feed, met.radial_depth_mm, size, forces.mean_resultant_n, forces.peak_resultant_n)
