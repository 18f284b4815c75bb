"""A shaper and what it is worth for the modes that it was designed for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from shapegcode._core import Shaper, worst_residual
from shapegcode.results.json import hidden
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
        pareto: whether no other design of the comparison is at least as good in everything and better in something.
    """

    json_extra: ClassVar[dict[str, Any]] = {
        "times_s": tuple[float, ...],
        "amplitudes": tuple[float, ...],
        "duration_s": float,
        "variance_s2": float,
        "abs_sum": float,
        "negative": bool,
    }
    json_exact: ClassVar[tuple[str, ...]] = ("times_s", "amplitudes")

    family: str
    shaper: Shaper = field(metadata=hidden())
    period_s: float | None
    residual: float
    worst_residual: float
    exact: bool = True
    pareto: bool = False

    @property
    def times_s(self) -> tuple[float, ...]:
        """Times of the taps, s."""
        return tuple(self.shaper.times_s.tolist())

    @property
    def amplitudes(self) -> tuple[float, ...]:
        """Amplitudes of the taps; they add up to 1."""
        return tuple(self.shaper.amplitudes.tolist())

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

    @staticmethod
    def hidden_from_json(data: Mapping[str, Sequence[float]]) -> dict[str, Shaper]:
        """The shaper, from what the JSON says of it."""
        return {"shaper": Shaper(data["times_s"], data["amplitudes"])}

    def radial_error_um(self, speed_mm_per_s: float, radius_mm: float) -> float:
        """By how much a circle comes out too small, µm: variance*v²/(2R)."""
        return self.variance_s2 * speed_mm_per_s**2 / (2.0 * radius_mm) * 1e3


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
