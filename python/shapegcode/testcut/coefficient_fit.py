"""Coefficients of the cutting force from mean forces: weighted non-linear least squares with 95 % intervals.

The forces come from the core (`_core.MillingForce`); here they are only laid over the measured ones. The power laws are
fitted about the middle of the chip thicknesses, where factor and exponent do not disturb each other.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls

from shapegcode.errors import ArgumentError
from shapegcode.io.record import FloatArray
from shapegcode.testcut.cut import COEFFICIENTS, CuttingLaw, CutTool
from shapegcode.testcut.forces import ForceModel, MeanForces, Thickness, chips_mm

MIN_CHIP_RATIO = 1.5  # The thickest mean chip over the thinnest; below it exponents are not told apart from factors
MIN_FEED_RATIO = 1.3  # The same of the feeds, for edge forces
_ROUNDS = 6
_HUBER = 2.5
_OUTLIER = 4.0
_MIN_OUTLIER = 0.02
_LARGEST_SHARE_OUT = 0.25
_DONE = 1e-7
_SETTLED = 1e-4
_MAX_STEPS = 40
_LARGEST_STEPS = np.array([1.0, 0.5, 1.0, 0.5, 1e3, 1e3])

_UNITS = ("N/mm²", "", "", "", "N/mm", "N/mm")  # of COEFFICIENTS


@dataclass(frozen=True)
class Coefficient:
    """One value with its 95 % interval.

    Attributes:
        name: key of ``[cutting]``.
        value: the best.
        low: lower end.
        high: upper end.
        unit: of all three.
    """

    name: str
    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True, eq=False)
class CoefficientFit:
    """What a fit found."""

    coefficients: tuple[Coefficient, ...]  # in the order of `[cutting]`
    thickness: Thickness  # "mean" or "local": to which chip thickness they belong
    middle_chip_mm: float  # geometric mean of the mean chip thicknesses
    # k1 in N/mm² and k2 there: much better known than the factors, which are those of a chip of 1 mm
    at_chip: tuple[Coefficient, ...]
    chip_mm: FloatArray  # (n,) mean chip thickness of each row
    predicted_n: FloatArray  # (n, 2) mean force of the fit
    outlier: npt.NDArray[np.bool_]  # (n,) rows that were left out, as their force is not that of the others
    rms_n: FloatArray  # (2,) root mean square of what the fit leaves of the others, along the feed and to its left
    rms_percent: float  # the same, of both, as a share of the resultant
    correlation: float  # how far neighbours share what the fit leaves, 0 to 1; the intervals allow for it

    @property
    def law(self) -> CuttingLaw:
        """The coefficients together."""
        return CuttingLaw(**{each.name: each.value for each in self.coefficients}, chip_thickness=self.thickness)


def fit_coefficients(
    data: MeanForces, tool: CutTool, axial_depth_mm: float, *, thickness: Thickness = "mean", edge: bool = False
) -> CoefficientFit:
    """Fit k1(t) and k2(t), and if asked the edge forces."""
    count = 6 if edge else 4
    chip = chips_mm(tool, axial_depth_mm, data)
    _check(data, chip, count, edge)
    middle = math.exp(float(np.mean(np.log(chip))))
    model = ForceModel(tool, axial_depth_mm, data, thickness, middle)
    parameters = _start(model, data, count)
    noise, robust = np.ones(model.measured.shape), np.ones(model.measured.shape)
    for _ in range(_ROUNDS):
        before = parameters
        parameters, left, slopes = _solved(model, parameters, robust / noise**2)
        noise = noise_of(left, model.forces(parameters), data.revolutions, robust)
        scaled = np.abs(left) / noise
        robust = np.minimum(1.0, _HUBER / np.maximum(scaled, 1e-12))
        if np.all(np.abs(parameters - before) < _SETTLED * np.maximum(np.abs(parameters), 1.0)):
            break
    outlier = _outliers(model.measured, left, noise)
    weights = np.where(outlier[:, None], 0.0, 1.0 / noise**2)
    parameters, left, slopes = _solved(model, parameters, weights)
    correlation = neighbour_correlation(left / noise, data.group, outlier)
    predicted = data.force_n - left[:, :2]
    covariance = _covariance(slopes, left, weights, correlation) + _of_place(model, parameters, slopes, weights)
    kept = left[~outlier, :2]
    size = np.linalg.norm(data.force_n[~outlier], axis=1)
    free = int((weights > 0.0).sum()) - count
    return CoefficientFit(
        _with_intervals(model, parameters, covariance, free, 1.0),
        thickness,
        model.reference,
        _with_intervals(model, parameters, covariance, free, model.reference)[:4:2],
        chip,
        predicted,
        outlier,
        np.sqrt(np.mean(kept**2, axis=0)),
        100.0 * float(np.sqrt(np.sum(kept**2) / np.sum(size**2))),
        correlation,
    )


def _outliers(measured: FloatArray, left: FloatArray, noise: FloatArray) -> npt.NDArray[np.bool_]:
    """(n,) rows whose force is not that of the others."""
    # Noise may be so small that the law itself is off by more than it: that alone makes no outlier.
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
        raise ArgumentError(f"{rows} mean forces are too few for {count} coefficients: needed are {2 * count} or more")
    if not np.all(chip > 0.0):
        raise ArgumentError("some forces belong to places where the tool meets nothing: leave them out")
    low, high = float(chip.min()), float(chip.max())
    feeds = np.unique(np.round(data.feed_mm_per_min, 3))
    if high / low < MIN_CHIP_RATIO:
        raise ArgumentError(
            f"the exponents cannot be told: the mean chip is {low * 1e3:.2f} to {high * 1e3:.2f} um thick, a ratio of "
            f"{high / low:.2f}, and must have one of {MIN_CHIP_RATIO:g} or more: let the radial depth grow from "
            "0.05 D to 0.35 D (ratio 2.7), or add passes with other feeds"
        )
    if edge and feeds.max() / feeds.min() < MIN_FEED_RATIO:
        raise ArgumentError(
            f"edge forces cannot be told from the exponents at feeds from {feeds.min():g} to {feeds.max():g} mm/min: "
            f"measure with feeds of a ratio of {MIN_FEED_RATIO:g} or more, better 3"
        )


def _start(model: ForceModel, data: MeanForces, count: int) -> FloatArray:
    """Constant k1 and k2 that fit best: with exponent 0 the force is linear in k1 and k1 k2."""
    along = model.forces_of(CuttingLaw(1.0, chip_thickness=model.thickness))
    across = model.forces_of(CuttingLaw(1.0, ratio=1.0, chip_thickness=model.thickness)) - along
    columns = np.column_stack([along.ravel(), across.ravel()])
    weight = np.repeat(1.0 / np.maximum(np.linalg.norm(data.force_n, axis=1), 1e-9), model.measured.shape[1])
    (tangential, radial), *_ = np.linalg.lstsq(columns * weight[:, None], model.measured.ravel() * weight, rcond=None)
    if tangential <= 0.0 or radial <= 0.0:
        raise ArgumentError(
            f"no cut gives such forces: they would need {tangential:.4g} N/mm² along and {radial:.4g} N/mm² across the "
            "cutting edge, both must be above 0: check --forces-on, the signs and names of fx (along the feed) and fy "
            "(to its left), and up or down milling"
        )
    start = np.zeros(count)
    start[0], start[2] = math.log(tangential), math.log(radial / tangential)
    return start


def _solved(model: ForceModel, start: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Levenberg-Marquardt steps to the weighted least squares: parameters, what they leave, slopes."""
    root = np.sqrt(weights).ravel()
    parameters = start
    predicted = model.forces(parameters)
    left = model.measured - predicted
    error = float(np.sum((root * left.ravel()) ** 2))
    damping, largest = 1e-3, _LARGEST_STEPS[: len(start)]
    slopes = model.slopes(parameters, predicted)
    for _ in range(_MAX_STEPS):
        weighted = slopes * root[:, None]
        scale = np.linalg.norm(weighted, axis=0)
        matrix = np.vstack([weighted, np.diag(math.sqrt(damping) * scale)])
        step, *_ = np.linalg.lstsq(matrix, np.concatenate([root * left.ravel(), np.zeros(len(start))]), rcond=None)
        # A law whose force does not grow with the chip is none.
        moved = parameters + np.clip(step, -largest, largest)
        moved[1], moved[3] = max(moved[1], -0.9), max(moved[3], -0.95 - moved[1])
        moved[4:] = np.maximum(moved[4:], 0.0)
        new = model.forces(moved)
        new_error = float(np.sum((root * (model.measured - new).ravel()) ** 2))
        if new_error > error * (1.0 + 1e-12):
            damping = max(damping, 1e-9) * 10.0
            if damping > 1e9:
                break
            continue
        gained = error - new_error
        change = float(np.max(np.abs(moved - parameters)))
        parameters, predicted, error, damping = moved, new, new_error, damping * 0.1
        left = model.measured - predicted
        slopes = model.slopes(parameters, predicted)
        if gained <= _DONE * error or change < _DONE:
            break
    return parameters, left, slopes


def _largest_step(count: int) -> FloatArray:
    return np.array([1.0, 0.5, 1.0, 0.5, 1e3, 1e3])[:count]


def _covariance(slopes: FloatArray, left: FloatArray, weights: FloatArray, correlation: float) -> FloatArray:
    weighted = slopes * np.sqrt(weights).ravel()[:, None]
    free = int((weights > 0.0).sum()) - slopes.shape[1]
    square = float(np.sum(weights * left**2)) / max(free, 1)
    scale = np.maximum(np.linalg.norm(weighted, axis=0), 1e-300)
    inner = np.linalg.pinv((weighted / scale).T @ (weighted / scale))
    return np.asarray(inner / np.outer(scale, scale) * square * (1.0 + correlation) / (1.0 - correlation))


def _of_place(model: ForceModel, parameters: FloatArray, slopes: FloatArray, weights: FloatArray) -> FloatArray:
    """Covariance that comes from not knowing exactly where the tool was in each group."""
    data, count = model.data, len(parameters)
    found = np.zeros((count, count))
    if data.displaced is None:
        return found
    there = dataclasses.replace(data, met=data.displaced)
    moved = ForceModel(model.tool, model.depth, there, model.thickness, model.reference)
    change = moved.forces(parameters) - model.forces(parameters)
    root = np.sqrt(weights)
    inverse = np.linalg.pinv(slopes * root.ravel()[:, None])
    for group in np.unique(data.group):
        effect = inverse @ (root * np.where((data.group == group)[:, None], change, 0.0)).ravel()
        found += np.outer(effect, effect)
    return found


def _with_intervals(
    model: ForceModel, parameters: FloatArray, covariance: FloatArray, free: int, chip_mm: float
) -> tuple[Coefficient, ...]:
    """Values with their intervals; the factors k1 and k2 at a chip thickness."""
    from scipy.stats import t as student

    quantile = float(student.ppf(0.975, max(free, 1)))
    way = math.log(chip_mm / model.reference)
    found = []
    for k, (name, unit) in enumerate(zip(COEFFICIENTS[: len(parameters)], _UNITS, strict=False)):
        factor = k in (0, 2)
        direction = np.zeros(len(parameters))
        direction[k] = 1.0
        if factor:
            direction[k + 1] = way
        value = float(direction @ parameters)
        half = quantile * math.sqrt(max(float(direction @ covariance @ direction), 0.0))
        ends = (value, value - half, value + half)
        best, low, high = (math.exp(each) for each in ends) if factor else ends
        found.append(Coefficient(name, best, low, high, unit))
    return tuple(found)


_MEDIAN = 0.4549
_LARGEST_CORRELATION = 0.95


def noise_of(left: FloatArray, predicted: FloatArray, revolutions: FloatArray, robust: FloatArray) -> FloatArray:
    """Standard deviation of each value: a constant and a share of the value, as the residuals show them."""
    found = np.empty_like(left)
    many = revolutions / float(np.mean(revolutions))
    for k in range(left.shape[1]):
        square = predicted[:, k] ** 2
        columns = np.column_stack([np.ones(len(square)), square])
        weight = np.ones(len(square))
        level = np.full(len(square), float(np.mean((robust[:, k] * left[:, k]) ** 2)))
        observed = robust[:, k] * left[:, k] ** 2 * many
        for _ in range(4):
            weight = 1.0 / np.maximum(level, 1e-300)
            constant, share = nnls(columns * weight[:, None], observed * weight)[0]
            level = constant + share * square
            level = np.maximum(level, 1e-4 * float(level.max()) + 1e-300)
        # The median is not moved by outliers; of squares of a normal variable it is _MEDIAN of the mean.
        level *= float(np.median(left[:, k] ** 2 * many / level)) / _MEDIAN
        found[:, k] = np.sqrt(level / many)
    return found


def neighbour_correlation(scaled: FloatArray, group: npt.NDArray[np.intp], outlier: npt.NDArray[np.bool_]) -> float:
    """Correlation of neighbours within each group, of what the fit leaves; not below 0."""
    pairs = (group[1:] == group[:-1]) & ~outlier[1:] & ~outlier[:-1]
    if pairs.sum() < 8:
        return 0.0
    product = float(np.mean(scaled[1:][pairs] * scaled[:-1][pairs]))
    square = float(np.mean(scaled[~outlier] ** 2))
    # By chance alone it is up to twice this.
    chance = 2.0 / math.sqrt(2.0 * pairs.sum())
    found = product / max(square, 1e-300)
    return min(found, _LARGEST_CORRELATION) if found > chance else 0.0
