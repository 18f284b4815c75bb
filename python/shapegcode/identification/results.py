"""What an identification found, with its uncertainty."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


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
        """The estimate of a monotonic function of the value."""
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

    def as_dict(self) -> dict[str, Any]:
        """Each value under its name, and its interval [low, high] under the name with `_ci95`."""
        found: dict[str, Any] = {}
        for name in ("frequency_hz", "damping_ratio", "mass_kg", "damping_n_s_per_m", "stiffness_n_per_m"):
            estimate: Estimate | None = getattr(self, name)
            found[name] = None if estimate is None else estimate.value
            found[f"{name}_ci95"] = None if estimate is None else [estimate.low, estimate.high]
        if self.refusal:
            found["refusal"] = self.refusal
        return found


@dataclass(frozen=True)
class ChartPole:
    """A pole of the stabilisation chart.

    Attributes:
        order: number of modes of the model that it belongs to.
        frequency_hz: undamped natural frequency.
        damping_ratio: of the pole.
        stable_frequency: the model one order lower has it too, within 1 %.
        stable_damping: and within 5 % of the damping ratio.
    """

    order: int
    frequency_hz: float
    damping_ratio: float
    stable_frequency: bool
    stable_damping: bool


@dataclass(frozen=True, eq=False, repr=False)
class Identification:
    """Modes found in one or several records of the same point.

    Attributes:
        modes: those that the data support, by ascending frequency.
        refused: those that stand out of the noise but are not supported, each with its refusal.
        order: number of modes of the chosen model.
        evidence: information criterion (lower is better) by number of modes.
        chart: poles of the stabilisation chart.
        fit_percent: 100 * (1 - |measured - fitted| / |measured|), over all records together.
        noise_rms: of the response's measurement noise, in the unit of the records.
        fitted: response of the model per record, (n,), at the samples that were used.
        used: first and last + 1 sample per record that was fitted.
        checks: figures that confirm the result by another way, by name.
        warnings: what the user should know.
    """

    modes: tuple[IdentifiedMode, ...]
    refused: tuple[IdentifiedMode, ...]
    order: int
    evidence: Mapping[int, float]
    chart: tuple[ChartPole, ...]
    fit_percent: float
    noise_rms: float
    fitted: tuple[FloatArray, ...]
    used: tuple[tuple[int, int], ...]
    checks: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """One line per mode; what else there is stays in the attributes."""
        from shapegcode.identification.tap_table import mode_line

        count = f"{self.order} mode{'' if self.order == 1 else 's'}"
        lines = [f"Identification: model of {count}, {self.fit_percent:.1f} % of the response"]
        lines += [f"  {mode_line(mode)}" for mode in (*self.modes, *self.refused)]
        if self.warnings:
            lines.append(f"  {len(self.warnings)} warning{'' if len(self.warnings) == 1 else 's'}: see .warnings")
        return "\n".join(lines)
