"""Coordinate modes between the programmed point and the work coordinate system: mirror, then scaling, then rotation."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]


@dataclass
class Transform:
    """An affine map, built from what is switched on; identity where nothing is."""

    mirror: dict[int, float] = field(default_factory=dict)  #: axis → coordinate of the mirror
    scale_centre: Vector | None = None
    factors: Vector = field(default_factory=lambda: np.ones(3))
    turn_centre: Vector | None = None
    turn_rad: float = 0.0
    turn_axes: tuple[int, int] = (0, 1)

    def matrix(self) -> npt.NDArray[np.float64]:
        """The 4 × 4 matrix of mirror, scaling and rotation in this order."""
        total = np.eye(4)
        for axis, at in self.mirror.items():
            step = np.eye(4)
            step[axis, axis], step[axis, 3] = -1.0, 2.0 * at
            total = step @ total
        if self.scale_centre is not None:
            step = np.eye(4)
            for k in range(3):
                step[k, k] = self.factors[k]
                step[k, 3] = self.scale_centre[k] * (1.0 - self.factors[k])
            total = step @ total
        if self.turn_centre is not None:
            a, b = self.turn_axes
            step = np.eye(4)
            # Operator's manuals, table of the programmable mirror image: CW and CCW of the rotation change places.
            mirrored = np.linalg.det(total[np.ix_((a, b), (a, b))]) < 0.0
            angle = -self.turn_rad if mirrored else self.turn_rad
            c, s = math.cos(angle), math.sin(angle)
            step[a, a], step[a, b], step[b, a], step[b, b] = c, -s, s, c
            step[:3, 3] = self.turn_centre - step[:3, :3] @ self.turn_centre
            total = step @ total
        return total

    def forward(self, point: Vector) -> Vector:
        """Programmed → work coordinates; an axis that nothing touches may be unknown (NaN)."""
        return self._apply(self.matrix(), point)

    def backward(self, point: Vector) -> Vector:
        """Work → programmed coordinates."""
        return self._apply(np.linalg.inv(self.matrix()), point)

    @staticmethod
    def _apply(matrix: npt.NDArray[np.float64], point: Vector) -> Vector:
        out = matrix[:3, 3].copy()
        for k in range(3):
            for j in range(3):
                if abs(matrix[k, j]) > 1e-15:
                    out[k] += matrix[k, j] * point[j]
        return out

    def flips(self, a: int, b: int) -> bool:
        """Whether a turn in the plane of these axes changes its sense."""
        linear = self.matrix()[:3, :3]
        return bool(linear[a, a] * linear[b, b] - linear[a, b] * linear[b, a] < 0.0)
