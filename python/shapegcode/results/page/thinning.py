"""Samples of a motion that passes by, thinned to what a screen can show.

Between two kept samples the path and every curve are straight lines in time within a part of a pixel; the sample at
which a curve is largest is kept, and those at which blocks begin as long as there is room.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode import _core

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

PIXELS_WIDE, PIXELS_HIGH = 1600, 200
"""Of the screen for which is thinned: path and time across, a curve from its least to its largest value."""

_HALF_PIXEL = 0.5
_STEP = 0.5  # of the tolerance, for each of two passes
_COARSER = 1.5
_PATH_LAST = 20.0
_SHARE_OF_STARTS = 0.5


@dataclass(frozen=True, eq=False)
class Kept:
    """What is left."""

    sample: IntArray  # which samples, (n,)
    labels: IntArray  # what was said of each, (n, labels)
    command_mm: FloatArray  # (n, 3)
    deviation_um: FloatArray  # (n, 3)
    curves: Mapping[str, FloatArray]  # by name, each (n,)
    path_pixels: float  # how far the path may be off
    pixels: float  # how far a curve may be off


class Thinner:
    """Takes samples piece by piece and keeps at most so many."""

    def __init__(self, scales: Mapping[str, float], most: int) -> None:
        """Keep at most so many samples."""
        self._scales = scales
        self._most = most
        self._names: list[str] = []
        self._pieces: list[tuple[IntArray, IntArray, FloatArray, BoolArray]] = []
        self._low: FloatArray | None = None
        self._high: FloatArray | None = None
        # What is thinned again is off by the sum of what each pass allows.
        self._spent = _STEP
        self._path_spent = _path_factor(_STEP)
        self.samples = 0

    def add(
        self,
        sample: IntArray,
        labels: IntArray,
        command_mm: FloatArray,
        deviation_um: FloatArray,
        curves: Mapping[str, FloatArray],
        starts: npt.NDArray[np.intp],
    ) -> None:
        """Further samples."""
        self._names = list(curves)
        values = np.column_stack([command_mm, deviation_um, *curves.values()])
        low, high = values.min(axis=0), values.max(axis=0)
        self._low = low if self._low is None else np.minimum(self._low, low)
        self._high = high if self._high is None else np.maximum(self._high, high)
        started = np.zeros(len(sample), dtype=bool)
        started[starts] = True
        # By the ranges so far, which only grow: finer than at the end.
        rows = self._chosen(sample, values, started, _STEP)
        self._pieces.append((sample[rows], labels[rows], values[rows], started[rows]))
        self.samples += len(sample)
        if sum(len(piece[0]) for piece in self._pieces) > 8 * self._most:
            thinned, factor = self._thinned(_STEP, most=4 * self._most)
            self._pieces = [thinned]
            self._spent += factor
            self._path_spent += _path_factor(factor)

    def _tolerances(self, factor: float) -> FloatArray:
        assert self._low is not None
        assert self._high is not None
        path = np.full(3, self._scales["path"])
        span = np.maximum(self._high - self._low, 1e-12)
        floors = np.array([self._scales.get(name, 0.0) for name in self._names])
        curves = np.maximum(span[6:], floors) * _HALF_PIXEL / PIXELS_HIGH
        # The three components of the deviation together are as fine as its magnitude.
        deviation = np.full(3, max(float(span[3:6].max()), self._scales["deviation"])) * _HALF_PIXEL / PIXELS_HIGH
        # The path is drawn large: it gives way only where its points alone are too many.
        path *= _path_factor(factor)
        tolerances: FloatArray = np.concatenate([path, deviation * factor, curves * factor])
        return tolerances

    def _chosen(
        self,
        sample: IntArray,
        values: FloatArray,
        started: npt.NDArray[np.bool_],
        factor: float,
        *,
        starts: bool = True,
    ) -> npt.NDArray[np.intp]:
        rows = _core.thin_curves(sample.astype(np.float64), np.asfortranarray(values), self._tolerances(factor))
        keep = np.zeros(len(sample), dtype=bool)
        keep[rows] = True
        keep[values[:, 6:].argmax(axis=0)] = True
        if starts:
            keep |= started
        return np.flatnonzero(keep)

    def _thinned(self, factor: float, most: int) -> tuple[tuple[IntArray, IntArray, FloatArray, BoolArray], float]:
        sample, labels, values, started = (np.concatenate(parts) for parts in zip(*self._pieces, strict=True))
        starts = int(started.sum()) <= _SHARE_OF_STARTS * most
        rows = self._chosen(sample, values, started, factor, starts=starts)
        while len(rows) > most:
            factor *= _COARSER
            rows = self._chosen(sample, values, started, factor, starts=starts)
        return (sample[rows], labels[rows], values[rows], started[rows]), factor

    def result(self) -> Kept:
        """What is left."""
        if not self._pieces:
            raise ValueError("no sample: nothing to show")
        (sample, labels, values, _), factor = self._thinned(_STEP, most=self._most)
        curves = {name: values[:, 6 + rank] for rank, name in enumerate(self._names)}
        path_pixels = (self._path_spent + _path_factor(factor)) * _HALF_PIXEL
        pixels = (self._spent + factor) * _HALF_PIXEL
        return Kept(sample, labels, values[:, :3], values[:, 3:6], curves, path_pixels, pixels)


def _path_factor(factor: float) -> float:
    """By what the path's tolerance grows where that of the curves grows by a factor."""
    return max(factor / _PATH_LAST, min(factor, _STEP))
