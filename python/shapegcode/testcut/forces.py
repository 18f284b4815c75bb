"""Tool engagement along a measuring pass, forces by a law, and the law's coefficients from mean forces."""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares, nnls
from scipy.special import stdtrit

from shapegcode import _core
from shapegcode.cutting.tool import COEFFICIENTS
from shapegcode.errors import ArgumentError
from shapegcode.io.units import FloatArray
from shapegcode.testcut.cut import CuttingLaw, CutTool, MeasuringPass, TestCut


@dataclass(frozen=True)
class Engagement:
    """Engagement for each X of the tool's axis; azimuths as in ``_core.EngagedArc``."""

    from_rad: FloatArray  # lowest azimuth in material, from the direction of feed, positive to its left
    to_rad: FloatArray  # highest one; equal to `from_rad` without engagement
    radial_depth_mm: FloatArray  # distance of the outermost engaged point from the wall

    @classmethod
    def joined(cls, several: Sequence[Self]) -> Self:
        """Concatenate several engagements."""
        return cls(*map(np.concatenate, zip(*(vars(each).values() for each in several), strict=True)))


def engagement(tool: CutTool, measuring: MeasuringPass, x_mm: FloatArray, *, up: bool) -> Engagement:
    """Engagement in a pass at each X of the tool's axis; exact if the stock edge consists of straight lines."""
    radius = tool.radius_mm
    edge_x, edge_y = np.array(measuring.edge_x_mm), np.array(measuring.edge_height_mm)
    x = np.asarray(x_mm, dtype=np.float64)
    # Distances ahead of the axis between which the tool's front is in the material.
    begin = np.clip(edge_x[0] - x, 0.0, radius)
    end = _crossing(x, begin, edge_x, edge_y, radius)
    end = np.maximum(np.minimum(end, edge_x[-1] - x), begin)
    first, last = -np.arccos(begin / radius), -np.arccos(np.clip(end / radius, 0.0, 1.0))
    depth = np.where(end > begin, radius - np.sqrt(np.maximum(radius**2 - end**2, 0.0)), 0.0)
    if up:
        first, last = -last, -first
    return Engagement(first, last, depth)


def _crossing(x: FloatArray, begin: FloatArray, edge_x: FloatArray, edge_y: FloatArray, radius: float) -> FloatArray:
    """Distance ahead of the tool's axis, `begin` or more, at which the front of the tool leaves the stock edge."""
    open_ = np.interp(x + begin, edge_x, edge_y) > radius - np.sqrt(np.maximum(radius**2 - begin**2, 0.0))
    found = np.where(open_, radius, begin)
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
        # At the distance u ahead of the axis the edge has the height R + c + m u; the front: u^2 + (y - R)^2 = R^2.
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
    """Mask where the tool is fully engaged: at least a margin away from the ends of the stock."""
    met = engagement(cut.tool, measuring, x_mm, up=cut.up)
    reach = cut.tool.radius_mm * np.maximum(np.cos(met.to_rad), np.cos(met.from_rad))
    # The engagement ends at the end of the stock: there it is not complete.
    low, high = measuring.edge_x_mm[0] + margin_mm, measuring.edge_x_mm[-1] - max(margin_mm, 1e-6)
    return np.asarray((x_mm >= low) & (x_mm + reach <= high) & (met.to_rad > met.from_rad))


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
    """Mean chip thickness at each engagement, mm: ratio of the torques that force laws of exponents 1 and 0 give."""
    laws = (ForceLaw(tool, CuttingLaw(1.0, exponent), spindle_rev_per_min, axial_depth_mm) for exponent in (0.0, 1.0))
    once, twice = (law.forces(met, feed_mm_per_min).mean_torque_nm for law in laws)
    return np.asarray(np.divide(twice, once, out=np.zeros_like(once), where=once > 0.0))


@dataclass(frozen=True, eq=False)
class Expected:
    """Forces expected by the force law along a pass, at stations."""

    x_mm: FloatArray  # (n,) ascending, of the tool's axis
    mean_n: FloatArray  # (n,) magnitude of the mean force
    mean_resultant_n: FloatArray  # (n,) mean magnitude
    peak_resultant_n: FloatArray  # (n,) largest magnitude


def expected(cut: TestCut, measuring: MeasuringPass, law: CuttingLaw | None = None) -> Expected:
    """Forces along a pass at its commanded feeds."""
    count = math.ceil((measuring.end_mm - measuring.start_mm) / 0.1) + 1
    x = np.linspace(measuring.start_mm, measuring.end_mm, count)
    met = engagement(cut.tool, measuring, x, up=cut.up)
    along = ForceLaw(cut.tool, law or cut.tool.cutting, cut.spindle_rev_per_min, cut.axial_depth_mm)
    forces = along.forces(met, measuring.commanded_feed(x))
    return Expected(x, np.linalg.norm(forces.mean_n, axis=1), forces.mean_resultant_n, forces.peak_resultant_n)


Thickness = Literal["mean", "local"]


@dataclass(frozen=True, eq=False)
class MeanForces:
    """Mean forces on the tool over whole revolutions, with engagements."""

    met: Engagement  # n engagements
    feed_mm_per_min: FloatArray  # (n,)
    spindle_rev_per_min: FloatArray  # (n,)
    force_n: FloatArray  # (n, 2) along the feed and to its left
    revolutions: FloatArray  # (n,) number of revolutions of each mean
    group: npt.NDArray[np.intp]  # (n,) index of the record, from 0, in the given order
    # n engagements with the tool position shifted by its standard error, equally for all rows of a group;
    # None: the engagements are exact
    displaced: Engagement | None = None
    torque_nm: FloatArray | None = None  # (n,) mean torque of the spindle; None: not measured


def _by_speed(data: MeanForces) -> Iterator[tuple[float, npt.NDArray[np.intp], Engagement]]:
    """Each spindle speed with the rows and engagements at it."""
    for speed in np.unique(data.spindle_rev_per_min):
        at = np.flatnonzero(data.spindle_rev_per_min == speed)
        yield float(speed), at, Engagement(*(column[at] for column in vars(data.met).values()))


class ForceModel:
    """Mean forces as a function of the parameters: ln k1, ln k2 at the reference chip, exponents, edge forces."""

    def __init__(
        self, tool: CutTool, axial_depth_mm: float, data: MeanForces, thickness: Thickness, reference_mm: float
    ) -> None:
        self.tool, self.depth, self.data, self.thickness = tool, axial_depth_mm, data, thickness
        self.reference = reference_mm
        # A torque is converted to a force at the tool's radius.
        self.at_radius = 1e3 / tool.radius_mm
        torque = [] if data.torque_nm is None else [self.at_radius * data.torque_nm]
        self.measured = np.column_stack([data.force_n, *torque])

    def law(self, parameters: FloatArray) -> CuttingLaw:
        """Coefficients from parameters."""
        k1, k1_exponent, k2, k2_exponent, *edge = parameters.tolist()
        logarithm = math.log(self.reference)
        factors = math.exp(k1 - k1_exponent * logarithm), math.exp(k2 - k2_exponent * logarithm)
        k_te, k_re = edge or (0.0, 0.0)
        return CuttingLaw(factors[0], k1_exponent, factors[1], k2_exponent, k_te, k_re, self.thickness)

    def forces(self, law: CuttingLaw) -> FloatArray:
        """Mean forces, (n, 2 or 3): along the feed, to its left; torque over tool radius, if torque was measured."""
        found = np.zeros(self.measured.shape)
        for speed, at, met in _by_speed(self.data):
            forces = ForceLaw(self.tool, law, speed, self.depth).forces(met, self.data.feed_mm_per_min[at])
            found[at, :2] = forces.mean_n
            found[at, 2:] = self.at_radius * forces.mean_torque_nm[:, None]
        return found


MIN_CHIP_RATIO = 1.5  # thickest over thinnest mean chip; below it exponents and factors are not distinguishable
MIN_FEED_RATIO = 1.3  # largest over smallest feed; below it edge forces are not distinguishable
_HUBER, _OUTLIER, _MIN_OUTLIER, _LARGEST_SHARE_OUT = 2.5, 4.0, 0.02, 0.25
# For ln k1, its exponent, ln k2, the exponent of k1 k2, and the edge forces.
_LOWEST, _HIGHEST = np.array([-50.0, -0.9, -50.0, -0.95, 0.0, 0.0]), np.array([50.0, 5.0, 50.0, 5.0, 1e6, 1e6])

_UNITS = ("N/mm²", "", "", "", "N/mm", "N/mm")  # of COEFFICIENTS


@dataclass(frozen=True)
class Coefficient:
    """One value with its 95 % interval."""

    name: str  # key of ``[cutting]``
    value: float  # best value
    low: float  # lower end
    high: float  # upper end
    unit: str  # unit of these values


@dataclass(frozen=True, eq=False)
class CoefficientFit:
    """Result of a fit."""

    coefficients: tuple[Coefficient, ...]  # in the order of `[cutting]`
    thickness: Thickness  # "mean" or "local": chip thickness of the power laws
    middle_chip_mm: float  # geometric mean of the mean chip thicknesses
    # k1 in N/mm² and k2 at this thickness, known much better than the factors, which are for a chip of 1 mm
    at_chip: tuple[Coefficient, ...]
    chip_mm: FloatArray  # (n,) mean chip thickness of each row
    predicted_n: FloatArray  # (n, 2) mean force of the fit
    outlier: npt.NDArray[np.bool_]  # (n,) ignored rows, whose force deviates from the others
    rms_n: FloatArray  # (2,) RMS residual of the other rows, along the feed and to its left
    rms_percent: float  # RMS residual of both, relative to the resultant
    correlation: float  # correlation of neighbouring residuals, 0 to 1; the intervals allow for it

    @property
    def law(self) -> CuttingLaw:
        """The coefficients as a force law."""
        return CuttingLaw(**{each.name: each.value for each in self.coefficients}, chip_thickness=self.thickness)


def fit_coefficients(
    data: MeanForces, tool: CutTool, axial_depth_mm: float, *, thickness: Thickness = "mean", edge: bool = False
) -> CoefficientFit:
    """Fit power laws of k1 and k2 about the mean chip (factor and exponent uncorrelated); *edge*: edge forces too."""
    count = 6 if edge else 4
    chip = np.zeros(len(data.feed_mm_per_min))
    for speed, at, met in _by_speed(data):
        chip[at] = mean_chip_mm(tool, speed, axial_depth_mm, met, data.feed_mm_per_min[at])
    _check(data, chip, count, edge)
    middle = math.exp(float(np.mean(np.log(chip))))
    model = ForceModel(tool, axial_depth_mm, data, thickness, middle)
    parameters = _start(model, data, count)
    noise, robust = np.ones(model.measured.shape), np.ones(model.measured.shape)
    for _ in range(6):
        before = parameters
        parameters, left, _ = _solved(model, parameters, robust / noise**2)
        noise = noise_of(left, model.forces(model.law(parameters)), data.revolutions, robust)
        scaled = np.abs(left) / noise
        robust = np.minimum(1.0, _HUBER / np.maximum(scaled, 1e-12))
        if np.all(np.abs(parameters - before) < 1e-4 * np.maximum(np.abs(parameters), 1.0)):
            break
    outlier = _outliers(model.measured, left, noise)
    weights = np.where(outlier[:, None], 0.0, 1.0 / noise**2)
    parameters, left, weighted = _solved(model, parameters, weights)
    correlation = neighbour_correlation(left / noise, data.group, outlier)
    predicted = data.force_n - left[:, :2]
    covariance = _covariance(weighted, left, weights, correlation) + _of_position(model, parameters, weighted, weights)
    kept = left[~outlier, :2]
    size = np.linalg.norm(data.force_n[~outlier], axis=1)
    free = int((weights > 0.0).sum()) - count
    factors, at_chip = (_with_intervals(model, parameters, covariance, free, each) for each in (1.0, model.reference))
    rms_n, percent = np.sqrt(np.mean(kept**2, axis=0)), 100.0 * float(np.sqrt(np.sum(kept**2) / np.sum(size**2)))
    left_by_fit = outlier, rms_n, percent, correlation
    return CoefficientFit(factors, thickness, model.reference, at_chip[:4:2], chip, predicted, *left_by_fit)


def _outliers(measured: FloatArray, left: FloatArray, noise: FloatArray) -> npt.NDArray[np.bool_]:
    """Mask of rows whose force does not follow the fitted law, (n,)."""
    # The noise may be below the error of the law itself, which must not turn a row into an outlier.
    size = np.linalg.norm(measured, axis=1)[:, None]
    outlier = np.any((np.abs(left) > _OUTLIER * noise) & (np.abs(left) > _MIN_OUTLIER * size), axis=1)
    if outlier.mean() > _LARGEST_SHARE_OUT:
        raise ArgumentError(
            f"{100 * outlier.mean():.0f} % of the forces do not follow one law: was the tool worn, did it chatter, or "
            "is the work piece not the one described?"
        )
    return np.asarray(outlier)


def _check(data: MeanForces, chip: FloatArray, count: int, edge: bool) -> None:
    rows = len(chip)
    if rows < 2 * count:
        raise ArgumentError(f"{rows} mean forces are too few for {count} coefficients; required: {2 * count} or more")
    if not np.all(chip > 0.0):
        raise ArgumentError("some forces are at positions without engagement: remove them")
    low, high = float(chip.min()), float(chip.max())
    feeds = np.unique(np.round(data.feed_mm_per_min, 3))
    if high / low < MIN_CHIP_RATIO:
        raise ArgumentError(
            f"the exponents cannot be determined: the mean chip is {low * 1e3:.2f} to {high * 1e3:.2f} um thick, a "
            f"ratio of {high / low:.2f}, and must have one of {MIN_CHIP_RATIO:g} or more: increase the radial depth "
            "from 0.05 D to 0.35 D (ratio 2.7), or add passes with other feeds"
        )
    if edge and feeds.max() / feeds.min() < MIN_FEED_RATIO:
        raise ArgumentError(
            f"edge forces cannot be distinguished from the exponents at feeds from {feeds.min():g} to {feeds.max():g} "
            f"mm/min: measure with feeds of a ratio of {MIN_FEED_RATIO:g} or more, better 3"
        )


def _start(model: ForceModel, data: MeanForces, count: int) -> FloatArray:
    """Best constant k1 and k2: with exponent 0 the force is linear in k1 and k1 k2."""
    along = model.forces(CuttingLaw(1.0, chip_thickness=model.thickness))
    across = model.forces(CuttingLaw(1.0, ratio=1.0, chip_thickness=model.thickness)) - along
    columns = np.column_stack([along.ravel(), across.ravel()])
    weight = np.repeat(1.0 / np.maximum(np.linalg.norm(data.force_n, axis=1), 1e-9), model.measured.shape[1])
    (tangential, radial), *_ = np.linalg.lstsq(columns * weight[:, None], model.measured.ravel() * weight, rcond=None)
    if tangential <= 0.0 or radial <= 0.0:
        raise ArgumentError(
            f"impossible forces: they would need {tangential:.4g} N/mm² along and {radial:.4g} N/mm² normal to the "
            "cutting edge, both must be above 0: check --forces-on, the signs and names of fx (along the feed) and fy "
            "(to its left), and up or down milling"
        )
    start = np.zeros(count)
    start[0], start[2] = math.log(tangential), math.log(radial / tangential)
    return start


def _solved(model: ForceModel, start: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Weighted least squares: parameters, residuals, weighted Jacobian (measured values, parameters)."""
    root = np.sqrt(weights)
    # Force must increase with the chip: the exponent of k1 k2 is limited too, and replaces that of k2.
    to_law = np.eye(len(start))
    to_law[3, 1] = -1.0
    to_limited = np.linalg.inv(to_law)

    def left_by(parameters: FloatArray) -> FloatArray:
        return np.asarray(model.measured - model.forces(model.law(parameters)))

    def misfit(limited: FloatArray) -> FloatArray:
        return np.asarray((root * left_by(to_law @ limited)).ravel())

    bounds = _LOWEST[: len(start)], _HIGHEST[: len(start)]
    found = least_squares(misfit, to_limited @ start, bounds=bounds, x_scale="jac", max_nfev=40)
    parameters = to_law @ found.x
    return parameters, left_by(parameters), np.asarray(found.jac @ to_limited)


def _covariance(weighted: FloatArray, left: FloatArray, weights: FloatArray, correlation: float) -> FloatArray:
    free = int((weights > 0.0).sum()) - weighted.shape[1]
    square = float(np.sum(weights * left**2)) / max(free, 1)
    scale = np.maximum(np.linalg.norm(weighted, axis=0), 1e-300)
    inner = np.linalg.pinv((weighted / scale).T @ (weighted / scale))
    return np.asarray(inner / np.outer(scale, scale) * square * (1.0 + correlation) / (1.0 - correlation))


def _of_position(model: ForceModel, parameters: FloatArray, weighted: FloatArray, weights: FloatArray) -> FloatArray:
    """Covariance due to the uncertain tool position in each group."""
    data, count = model.data, len(parameters)
    found = np.zeros((count, count))
    if data.displaced is None:
        return found
    there = dataclasses.replace(data, met=data.displaced)
    moved = ForceModel(model.tool, model.depth, there, model.thickness, model.reference)
    change = moved.forces(model.law(parameters)) - model.forces(model.law(parameters))
    root = np.sqrt(weights)
    inverse = np.linalg.pinv(weighted)
    for group in np.unique(data.group):
        effect = inverse @ (root * np.where((data.group == group)[:, None], change, 0.0)).ravel()
        found += np.outer(effect, effect)
    return found


def _with_intervals(
    model: ForceModel, parameters: FloatArray, covariance: FloatArray, free: int, chip_mm: float
) -> tuple[Coefficient, ...]:
    """Coefficients with 95 % intervals; the factors k1 and k2 are evaluated at one chip thickness."""
    quantile = float(stdtrit(max(free, 1), 0.975))
    distance = math.log(chip_mm / model.reference)
    found = []
    for k, (name, unit) in enumerate(zip(COEFFICIENTS[: len(parameters)], _UNITS, strict=False)):
        factor, direction = k in (0, 2), np.eye(len(parameters))[k]
        if factor:
            direction[k + 1] = distance
        value = float(direction @ parameters)
        half = quantile * math.sqrt(max(float(direction @ covariance @ direction), 0.0))
        ends = (value, value - half, value + half)
        best, low, high = (math.exp(each) for each in ends) if factor else ends
        found.append(Coefficient(name, best, low, high, unit))
    return tuple(found)


_MEDIAN, _LARGEST_CORRELATION = 0.4549, 0.95


def noise_of(left: FloatArray, predicted: FloatArray, revolutions: FloatArray, robust: FloatArray) -> FloatArray:
    """Standard deviation of each value: a constant and a relative part, from the residuals."""
    found = np.empty_like(left)
    many = revolutions / float(np.mean(revolutions))
    for k in range(left.shape[1]):
        square = predicted[:, k] ** 2
        columns = np.column_stack([np.ones(len(square)), square])
        level = np.full(len(square), float(np.mean((robust[:, k] * left[:, k]) ** 2)))
        observed = robust[:, k] * left[:, k] ** 2 * many
        for _ in range(4):
            weight = 1.0 / np.maximum(level, 1e-300)
            constant, share = nnls(columns * weight[:, None], observed * weight)[0]
            level = constant + share * square
            level = np.maximum(level, 1e-4 * float(level.max()) + 1e-300)
        # The median is robust against outliers; for squares of a normal variable it is _MEDIAN times the mean.
        level *= float(np.median(left[:, k] ** 2 * many / level)) / _MEDIAN
        found[:, k] = np.sqrt(level / many)
    return found


def neighbour_correlation(scaled: FloatArray, group: npt.NDArray[np.intp], outlier: npt.NDArray[np.bool_]) -> float:
    """Correlation of neighbouring residuals of the same group, over all groups; 0 if it may be chance."""
    pairs = (group[1:] == group[:-1]) & ~outlier[1:] & ~outlier[:-1]
    if pairs.sum() < 8:
        return 0.0
    product = float(np.mean(scaled[1:][pairs] * scaled[:-1][pairs]))
    square = float(np.mean(scaled[~outlier] ** 2))
    chance = 2.0 / math.sqrt(2.0 * pairs.sum())
    found = product / max(square, 1e-300)
    return min(found, _LARGEST_CORRELATION) if found > chance else 0.0
