"""What the controller hands on: canonical moves in work coordinates, before and after cutter compensation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]


@dataclass
class Item:
    """A rapid, a line, an arc or a dwell. Lengths mm, feed mm/min (NaN for rapid), sweep rad, signed: positive is
    counter-clockwise seen from the positive end of the plane's normal."""

    kind: Literal["rapid", "line", "arc", "dwell"]
    line: int
    start: Vector
    end: Vector
    feed: float = math.nan
    dwell_s: float = 0.0
    centre: Vector | None = None
    sweep: float = 0.0
    axes: tuple[int, int, int] = (0, 1, 2)  #: first, second and normal axis of the plane
    side: int = 40  #: 40, 41 or 42
    offset_mm: float = 0.0  #: tool radius with its sign
    corner: tuple[str, float] | None = None  #: ("R" or "C", size) at the end

    def flat(self, point: Vector) -> Vector:
        """The two coordinates of the plane."""
        return np.array([point[self.axes[0]], point[self.axes[1]]])

    @property
    def moves_in_plane(self) -> bool:
        if self.kind == "arc":
            return True
        step = self.flat(self.end) - self.flat(self.start)
        return self.kind != "dwell" and bool(np.any(np.isnan(step)) or np.hypot(*step) > 1e-9)

    @property
    def radius(self) -> float:
        assert self.centre is not None
        return float(np.hypot(*(self.flat(self.start) - self.flat(self.centre))))

    def tangent(self, at_end: bool) -> Vector:
        """Unit direction of travel in the plane."""
        if self.kind == "arc":
            assert self.centre is not None
            out = self.flat(self.end if at_end else self.start) - self.flat(self.centre)
            out = np.array([-out[1], out[0]]) * math.copysign(1.0, self.sweep)
        else:
            out = self.flat(self.end) - self.flat(self.start)
        return np.asarray(out / np.hypot(*out))

    def lift(self, flat: Vector, like: Vector) -> Vector:
        """A point of the plane with the normal coordinate of another point."""
        out = like.copy()
        out[self.axes[0]], out[self.axes[1]] = flat
        return out
