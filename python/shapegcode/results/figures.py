"""Figures of simulations as results state them: per axis, in µm."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from shapegcode import _core
from shapegcode.io.arrays import FloatArray
from shapegcode.results.json import sparse
from shapegcode.results.result import Xyz

T = TypeVar("T")

CONTOURS = {"command": "contour error of the command", "response": "contour error of the machine table"}
"""What the contour errors of `Tracks` are called."""


@dataclass(frozen=True)
class Tracks(Generic[T]):
    """A figure of both tracks that a machine makes."""

    command: T  # of the set-points
    response: T  # of the table


@dataclass(frozen=True)
class Deviation:
    """How far a track leaves the programmed path."""

    largest_mm: float  # distance, either side; corners that the track cuts short count too
    left_mm: float  # to the left of the travel, or above
    right_mm: float  # to the right of it, or below

    @classmethod
    def of(cls, stats: Iterable[_core.DeviationStats]) -> Deviation:
        """The largest of one or several runs."""
        return cls.largest(cls(each.max_abs_mm, each.most_positive_mm, -each.most_negative_mm) for each in stats)

    @classmethod
    def largest(cls, deviations: Iterable[Deviation]) -> Deviation:
        """The largest of each."""
        rows = list(deviations)
        return cls(
            max(each.largest_mm for each in rows),
            max(each.left_mm for each in rows),
            max(each.right_mm for each in rows),
        )

    def gouge_and_excess_um(self, material_side: str) -> dict[str, float]:
        """Material cut too deep (gouge) and material left (excess)."""
        gouge, excess = (self.left_mm, self.right_mm) if material_side == "left" else (self.right_mm, self.left_mm)
        return {"gouge": gouge * 1e3, "excess": excess * 1e3}


@dataclass(frozen=True)
class ContourError:
    """How far a track leaves the programmed path, in µm."""

    max: float  # distance, either side; corners that the track cuts short count too
    rms: float  # root mean square over all samples
    left: float  # largest to the left of the travel, or above
    right: float  # largest to the right of it, or below
    # largest towards the workpiece, which cuts too much; only where the side of the workpiece is known
    gouge: float | None = field(default=None, metadata=sparse())
    # largest away from it, which leaves material standing; likewise
    excess: float | None = field(default=None, metadata=sparse())

    @classmethod
    def of(cls, stats: Iterable[_core.DeviationStats], material_side: str | None = None) -> ContourError:
        """Of one or several runs together; all zero without any."""
        rows = list(stats)
        count = sum(row.count for row in rows)
        squares = sum(row.sum_of_squares_mm2 for row in rows)
        largest = Deviation.of(rows) if rows else Deviation(0.0, 0.0, 0.0)
        beside = {} if material_side is None else largest.gouge_and_excess_um(material_side)
        return cls(
            largest.largest_mm * 1e3,
            math.sqrt(squares / count) * 1e3 if count else 0.0,
            largest.left_mm * 1e3,
            largest.right_mm * 1e3,
            **beside,
        )


def largest_xyz_um(vectors: Iterable[FloatArray]) -> Xyz[float]:
    """Largest of each axis, mm to µm."""
    rows = list(vectors)
    x, y, z = np.max(rows, axis=0) * 1e3 if rows else np.zeros(3)
    return Xyz(float(x), float(y), float(z))
