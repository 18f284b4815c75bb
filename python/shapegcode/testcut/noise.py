"""Noise of measured forces from what a fit leaves: its size over the force, and how far neighbours share it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

__all__ = ["neighbour_correlation", "noise_of"]

Array = npt.NDArray[np.float64]

_MEDIAN = 0.4549
_LARGEST_CORRELATION = 0.95


def noise_of(left: Array, predicted: Array, revolutions: Array, robust: Array) -> Array:
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
            constant, share = _not_negative(columns * weight[:, None], observed * weight)
            level = constant + share * square
            level = np.maximum(level, 1e-4 * float(level.max()) + 1e-300)
        # The median is not moved by outliers; of squares of a normal variable it is _MEDIAN of the mean.
        level *= float(np.median(left[:, k] ** 2 * many / level)) / _MEDIAN
        found[:, k] = np.sqrt(level / many)
    return found


def _not_negative(matrix: Array, right: Array) -> tuple[float, float]:
    """Least squares with two unknowns, none below 0."""
    both, *_ = np.linalg.lstsq(matrix, right, rcond=None)
    if both.min() >= 0.0:
        return float(both[0]), float(both[1])
    alone = [max(float(column @ right) / float(column @ column), 0.0) for column in matrix.T]
    errors = [float(np.sum((right - value * column) ** 2)) for value, column in zip(alone, matrix.T, strict=True)]
    return (alone[0], 0.0) if errors[0] <= errors[1] else (0.0, alone[1])


def neighbour_correlation(scaled: Array, group: npt.NDArray[np.intp], outlier: npt.NDArray[np.bool_]) -> float:
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
