"""What the tool meets along a measuring pass, the forces of a law there, and mean forces over whole revolutions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.io.record import FloatArray
from shapegcode.testcut.cut import CuttingLaw, CutTool, MeasuringPass, TestCut


@dataclass(frozen=True)
class Engagement:
    """What the tool meets where its axis is at each X; azimuths as in ``_core.EngagedArc``."""

    from_rad: FloatArray  # first azimuth in material, from the direction of feed, positive to its left
    to_rad: FloatArray  # last one; equal to `from_rad` where nothing is met
    radial_depth_mm: FloatArray  # depth of the outermost point in material below the edge: distance from it to the wall

    @classmethod
    def joined(cls, several: Sequence[Engagement]) -> Engagement:
        """Several behind each other."""
        return cls(
            *(np.concatenate(columns) for columns in zip(*(vars(each).values() for each in several), strict=True))
        )


def engagement(tool: CutTool, measuring: MeasuringPass, x_mm: FloatArray, *, up: bool) -> Engagement:
    """Engagement of a pass where the tool's axis is at each X, exact for the straight pieces of its edge."""
    radius = tool.radius_mm
    edge_x, edge_y = np.array(measuring.edge_x_mm), np.array(measuring.edge_height_mm)
    x = np.asarray(x_mm, dtype=np.float64)
    # Along the tool: how far a point of its front lies before the axis.
    begin = np.clip(edge_x[0] - x, 0.0, radius)
    end = _crossing(x, begin, edge_x, edge_y, radius)
    end = np.maximum(np.minimum(end, edge_x[-1] - x), begin)
    first, last = -np.arccos(begin / radius), -np.arccos(np.clip(end / radius, 0.0, 1.0))
    depth = np.where(end > begin, radius - np.sqrt(np.maximum(radius**2 - end**2, 0.0)), 0.0)
    if up:
        first, last = -last, -first
    return Engagement(first, last, depth)


def _crossing(x: FloatArray, begin: FloatArray, edge_x: FloatArray, edge_y: FloatArray, radius: float) -> FloatArray:
    """How far before the axis the front of the tool first comes out of the edge; `begin` where it is not in it."""
    found = np.full(len(x), radius)
    open_ = np.ones(len(x), dtype=bool)
    at_begin = np.interp(x + begin, edge_x, edge_y)
    outside = at_begin <= radius - np.sqrt(np.maximum(radius**2 - begin**2, 0.0))
    found[outside] = begin[outside]
    open_ &= ~outside
    slopes = np.diff(edge_y) / np.diff(edge_x)
    first = np.clip(np.searchsorted(edge_x, x + begin, side="right") - 1, 0, len(slopes) - 1)
    for step in range(len(slopes)):
        piece = first + step
        active = np.flatnonzero(open_ & (piece < len(slopes)))
        active = active[edge_x[np.minimum(piece[active], len(slopes) - 1)] - x[active] < radius]
        if active.size == 0:
            break
        k = piece[active]
        m = slopes[k]
        # The edge over the distance u before the axis: height c + m u; the tool's front: u^2 + (y - R)^2 = R^2.
        c = edge_y[k] + m * (x[active] - edge_x[k]) - radius
        inner = (m * c) ** 2 - (1.0 + m * m) * (c * c - radius * radius)
        u = (-m * c + np.sqrt(np.maximum(inner, 0.0))) / (1.0 + m * m)
        inside = (inner >= 0.0) & (u <= edge_x[k + 1] - x[active] + 1e-12)
        found[active[inside]] = u[inside]
        open_[active[inside]] = False
    return found


def straight_engagement(tool: CutTool, radial_depth_mm: FloatArray, *, up: bool) -> Engagement:
    """Engagement of straight cuts of known radial depth."""
    last = -np.arcsin(1.0 - radial_depth_mm / tool.radius_mm)
    first = np.full(len(last), -0.5 * math.pi)
    return Engagement(-last, -first, radial_depth_mm) if up else Engagement(first, last, radial_depth_mm)


def fully_engaged(
    cut: TestCut, measuring: MeasuringPass, x_mm: FloatArray, margin_mm: float = 0.0
) -> npt.NDArray[np.bool_]:
    """Where the tool is over the stock with all of its engagement, and by a margin within its ends."""
    met = engagement(cut.tool, measuring, x_mm, up=cut.up)
    reach = cut.tool.radius_mm * np.maximum(np.cos(met.to_rad), np.cos(met.from_rad))
    # The engagement ends at the end of the stock: there it is not whole, by whatever little.
    low, high = measuring.edge_x_mm[0] + margin_mm, measuring.edge_x_mm[-1] - max(margin_mm, 1e-6)
    return np.asarray((x_mm >= low) & (x_mm + reach <= high) & (met.to_rad > met.from_rad))


_STEP_MM = 0.1


@dataclass(frozen=True)
class CutForces:
    """Forces on the tool over one revolution, at each of n engagements."""

    mean_n: FloatArray  # (n, 2) mean of the vector along the feed and to its left
    mean_resultant_n: FloatArray  # (n,) mean of the magnitude
    peak_resultant_n: FloatArray  # (n,) largest magnitude
    mean_torque_nm: FloatArray  # (n,)


class ForceLaw:
    """A tool with coefficients at a spindle speed and an axial depth."""

    def __init__(self, tool: CutTool, law: CuttingLaw, spindle_rev_per_min: float, axial_depth_mm: float) -> None:
        """Make the tables of the core."""
        mill = _core.EndMill(tool.diameter_mm, tool.flutes, math.radians(tool.helix_deg), list(tool.runout_mm))
        self._force = _core.MillingForce(mill, law.core(), spindle_rev_per_min)
        self._depth = axial_depth_mm

    def forces(self, met: Engagement, feed_mm_per_min: FloatArray | Sequence[float]) -> CutForces:
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
    tool: CutTool, spindle_rev_per_min: float, axial_depth_mm: float, met: Engagement, feed_mm_per_min: FloatArray
) -> FloatArray:
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
    """What the force law lets expect along a pass, at stations."""

    x_mm: FloatArray  # (n,) ascending, of the tool's axis
    mean_n: FloatArray  # (n,) magnitude of the mean force
    mean_resultant_n: FloatArray  # (n,) mean magnitude
    peak_resultant_n: FloatArray  # (n,) largest magnitude


def expected(cut: TestCut, measuring: MeasuringPass, law: CuttingLaw | None = None) -> Expected:
    """Forces along a pass at its commanded feeds."""
    count = math.ceil((measuring.end_mm - measuring.start_mm) / _STEP_MM) + 1
    x = np.linspace(measuring.start_mm, measuring.end_mm, count)
    met = engagement(cut.tool, measuring, x, up=cut.up)
    along = ForceLaw(cut.tool, law or cut.tool.cutting, cut.spindle_rev_per_min, cut.axial_depth_mm)
    forces = along.forces(met, measuring.commanded_feed(x))
    return Expected(x, np.linalg.norm(forces.mean_n, axis=1), forces.mean_resultant_n, forces.peak_resultant_n)


Thickness = Literal["mean", "local"]
_STEP = 1e-5  # of the logarithms and exponents, for slopes
_EDGE_STEP = 0.1  # N/mm


@dataclass(frozen=True, eq=False)
class MeanForces:
    """Mean forces on the tool over whole revolutions, with what it met."""

    met: Engagement  # n engagements
    feed_mm_per_min: FloatArray  # (n,)
    spindle_rev_per_min: FloatArray  # (n,)
    force_n: FloatArray  # (n, 2) along the feed and to its left
    revolutions: FloatArray  # (n,) how many each is the mean of
    group: npt.NDArray[np.intp]  # (n,) number of the pass or file, in the order in which it was cut
    # n engagements if the place of the tool were off by its standard error, the same way for all rows of a group;
    # None: the engagements are exact
    displaced: Engagement | None = None
    torque_nm: FloatArray | None = None  # (n,) mean torque of the spindle; None: not measured


def chips_mm(tool: CutTool, depth: float, data: MeanForces) -> FloatArray:
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

    def law(self, parameters: FloatArray) -> CuttingLaw:
        """The coefficients of parameters."""
        k1, k1_exponent, k2, k2_exponent, *edge = parameters.tolist()
        logarithm = math.log(self.reference)
        factors = math.exp(k1 - k1_exponent * logarithm), math.exp(k2 - k2_exponent * logarithm)
        k_te, k_re = edge or (0.0, 0.0)
        return CuttingLaw(factors[0], k1_exponent, factors[1], k2_exponent, k_te, k_re, self.thickness)

    def forces(self, parameters: FloatArray) -> FloatArray:
        """(n, 2 or 3) forces with the coefficients of parameters."""
        return self.forces_of(self.law(parameters))

    def forces_of(self, law: CuttingLaw) -> FloatArray:
        """(n, 2 or 3) forces along the feed, to its left, and the torque's where it was measured."""
        found = np.zeros(self.measured.shape)
        for speed, at, met in _by_speed(self.data):
            forces = ForceLaw(self.tool, law, speed, self.depth).forces(met, self.data.feed_mm_per_min[at])
            found[at, :2] = forces.mean_n
            found[at, 2:] = self.at_radius * forces.mean_torque_nm[:, None]
        return found

    def slopes(self, parameters: FloatArray, at: FloatArray) -> FloatArray:
        """(all measured values, p) change of the forces with each parameter; the edge forces act as they are."""
        columns = []
        for k in range(len(parameters)):
            moved = parameters.copy()
            step = _STEP if k < 4 else _EDGE_STEP
            moved[k] += step
            columns.append((self.forces(moved) - at).ravel() / step)
        return np.column_stack(columns)
