"""What a design of a shaper may be."""

from __future__ import annotations

from dataclasses import dataclass

from shapegcode._core import ArgumentError, Shaper

__all__ = ["DesignOptions"]


@dataclass(frozen=True)
class DesignOptions:
    """What a design may be.

    Attributes:
        period_s: grid on which the taps must lie, s; None: continuous times.
        max_duration_s: longest shaper, s.
        max_abs_sum: largest sum of the taps' magnitudes.
        vibration_limit: residual ratio that a family with a tolerated residual (EI, SI, robust) may leave.
        taps: the shaper of the family `taps`; no other family uses it.
    """

    period_s: float | None = None
    max_duration_s: float = 0.25
    max_abs_sum: float = 10.0
    vibration_limit: float = 0.05
    taps: Shaper | None = None

    @property
    def grid_period_s(self) -> float:
        """The period of the grid, s."""
        if self.period_s is None:
            raise ArgumentError("this family is designed on a grid: give its period")
        return self.period_s
