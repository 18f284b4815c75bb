"""What defines a family on a sample grid: zeros, limits on the residual over bands, and the range of the taps."""

from __future__ import annotations

from dataclasses import dataclass

from shapegcode._core import Mode, Shaper, worst_residual

__all__ = ["Conditions", "ResidualLimit", "Zero"]


@dataclass(frozen=True)
class Zero:
    """A mode of which nothing may be left: `multiplicity` - 1 derivatives of the residual vanish with it."""

    mode: Mode
    multiplicity: int = 1


@dataclass(frozen=True)
class ResidualLimit:
    """The most that may be left of a mode (no unit) whose natural frequency lies anywhere in a band (Hz)."""

    mode: Mode
    lowest_hz: float
    highest_hz: float
    limit: float

    def worst(self, shaper: Shaper) -> tuple[float, float]:
        """Proven bound on the residual over the band, and the frequency (Hz) where it is largest."""
        found = worst_residual(shaper, self.mode, self.lowest_hz, self.highest_hz)
        return found.upper_bound, found.frequency_hz


@dataclass(frozen=True)
class Conditions:
    """What a shaper must satisfy.

    Attributes:
        zeros: met to rounding.
        limits: met over their bands.
        largest_tap: None: no tap is negative; else: the largest magnitude of a tap, either sign.
    """

    zeros: tuple[Zero, ...] = ()
    limits: tuple[ResidualLimit, ...] = ()
    largest_tap: float | None = None
