"""A shaper and what it is worth for the modes that it was designed for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shapegcode._core import Shaper, worst_residual
from shapegcode.shaping.bands import ModeBand

__all__ = ["Design", "evaluate"]

_EXACT = 1e-3  # of the vibration; taps that someone typed have four digits


@dataclass(frozen=True)
class Design:
    """One row of a comparison of shapers.

    Attributes:
        family: name of its row in the registry.
        shaper: the taps.
        period_s: grid on which its times lie and its zeros are exact, s; None: times are continuous.
        residual: largest residual ratio of the modes at their nominal frequencies.
        worst_residual: the same over the modes' bands.
        exact: whether the modes without a band are cancelled, to a thousandth.
    """

    family: str
    shaper: Shaper
    period_s: float | None
    residual: float
    worst_residual: float
    exact: bool = True

    @property
    def duration_s(self) -> float:
        """Time of the last tap, s."""
        return self.shaper.duration_s

    @property
    def variance_s2(self) -> float:
        """Contour cost, s²: dR/R = variance*(v/R)²/2."""
        return self.shaper.variance_s2

    @property
    def abs_sum(self) -> float:
        """Sum of the taps' magnitudes: 1 without negative taps."""
        return self.shaper.abs_sum

    @property
    def negative(self) -> bool:
        """Whether any tap is negative."""
        return self.shaper.has_negative


def evaluate(family: str, shaper: Shaper, bands: Sequence[ModeBand], period_s: float | None = None) -> Design:
    """The figures of a shaper for modes and their bands; the worst residual is proven to 1e-6 of it."""
    residual = max(shaper.residual_ratio(band.mode) for band in bands)
    worst = max(_worst(shaper, band) for band in bands)
    exact = all(shaper.residual_ratio(band.mode) <= _EXACT for band in bands if not band.uncertainty)
    return Design(family, shaper, period_s, residual, worst, exact)


def _worst(shaper: Shaper, band: ModeBand) -> float:
    if band.uncertainty == 0.0:
        return shaper.residual_ratio(band.mode)
    ends_hz = (band.shifted(-1.0).frequency_hz, band.shifted(1.0).frequency_hz)
    return worst_residual(shaper, band.mode, *ends_hz).residual_ratio
