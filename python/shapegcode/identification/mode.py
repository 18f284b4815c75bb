"""A mode as identified: each value with its 95 % interval, and both in words."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Estimate:
    """A value and its 95 % interval.

    Attributes:
        value: the estimate.
        low: lower end of the interval.
        high: upper end.
    """

    value: float
    low: float
    high: float

    def __post_init__(self) -> None:
        """Numbers of Python, whatever they come as."""
        for name in ("value", "low", "high"):
            object.__setattr__(self, name, float(getattr(self, name)))

    @property
    def uncertainty_percent(self) -> float:
        """Larger half of the interval, in percent of the value."""
        return 100.0 * max(self.high - self.value, self.value - self.low) / abs(self.value)

    def map(self, function: Callable[[float], float]) -> Estimate:
        """The estimate of a monotonic function of the value.

        Args:
            function: of the value; rising or falling.

        Returns:
            Its value and the ends of its interval.
        """
        ends = sorted((function(self.low), function(self.high)))
        return Estimate(function(self.value), *ends)


@dataclass(frozen=True)
class IdentifiedMode:
    """One mode.

    Attributes:
        frequency_hz: undamped natural frequency.
        damping_ratio: 1 = critically damped.
        mass_kg: equivalent (modal) mass at the point of the tap; None for a free decay.
        damping_n_s_per_m: equivalent viscous damping; None for a free decay.
        stiffness_n_per_m: equivalent stiffness; None for a free decay.
        refusal: why the data do not support this mode; empty: they do.
    """

    frequency_hz: Estimate
    damping_ratio: Estimate
    mass_kg: Estimate | None = None
    damping_n_s_per_m: Estimate | None = None
    stiffness_n_per_m: Estimate | None = None
    refusal: str = ""


_SKEWED = 1.2


def mode_line(mode: IdentifiedMode) -> str:
    """A mode in one line: each value with half of its 95 % interval, or why the data do not support it."""
    if mode.refusal:
        return f"{mode.frequency_hz.value:.4g} Hz not supported: {mode.refusal}"
    named = (
        ("frequency", mode.frequency_hz, 1.0, "Hz"),
        ("damping", mode.damping_ratio, 100.0, "%"),
        ("m", mode.mass_kg, 1.0, "kg"),
        ("c", mode.damping_n_s_per_m, 1.0, "N s/m"),
        ("k", mode.stiffness_n_per_m, 1e-6, "N/µm"),
    )
    parts = (
        f"{name} {estimate_cell(estimate, factor)} {unit}"
        for name, estimate, factor, unit in named
        if estimate is not None
    )
    return ", ".join(parts)


def with_interval(estimate: Estimate, factor: float = 1.0) -> str:
    """``46.02 ± 0.05``, with as many digits as the interval is worth; both ends where it is skewed."""
    value, low, high = (factor * each for each in (estimate.value, estimate.low, estimate.high))
    above, below = high - value, value - low
    if not (math.isfinite(above) and math.isfinite(below) and above > 0.0 and below > 0.0):
        return f"{value:.4g} ({low:.4g} ... {high:.4g})"
    if max(above, below) > _SKEWED * min(above, below):
        decimals = _decimals(min(above, below))
        return f"{value:z.{decimals}f} ({low:z.{decimals}f} ... {high:z.{decimals}f})"
    return plus_minus(value, max(above, below))


def plus_minus(value: float, half: float) -> str:
    """A value and half its interval, to two digits of the latter."""
    decimals = _decimals(half)
    return f"{value:z.{decimals}f} ± {half:.{decimals}f}"


def _decimals(half: float) -> int:
    return min(max(0, 1 - math.floor(math.log10(half))), 6)


def estimate_cell(estimate: Estimate | None, factor: float) -> str:
    """An estimate times a factor with its interval, for a table; empty where there is none."""
    return "" if estimate is None else with_interval(estimate, factor)
