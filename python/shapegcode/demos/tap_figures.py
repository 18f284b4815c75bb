"""What the demonstration of a tap works out: plain figures of each of its bodies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

__all__ = ["Body", "ColletFigures", "EndMillFigures", "SeriesFigures", "SteppedFigures", "SystemFigures"]


@dataclass(frozen=True)
class Body:
    """A body on spring and damper: m x'' + c x' + k x = force.

    Attributes:
        mass_kg: m.
        damping_n_s_per_m: c.
        stiffness_n_per_m: k.
    """

    mass_kg: float
    damping_n_s_per_m: float
    stiffness_n_per_m: float

    @property
    def frequency_hz(self) -> float:
        """Undamped natural frequency."""
        return math.sqrt(self.stiffness_n_per_m / self.mass_kg) / (2.0 * math.pi)

    @property
    def damping_ratio(self) -> float:
        """1 = critically damped."""
        return self.damping_n_s_per_m / (2.0 * math.sqrt(self.mass_kg * self.stiffness_n_per_m))


@dataclass(frozen=True)
class SteppedFigures:
    """A body whose motion is stepped by the Wilson-theta method.

    Attributes:
        theta: of the method.
        steps_per_sample: of the method.
        frequency_hz: of the stepped response.
        damping_ratio: of the stepped response.
        phi: coefficients of its ARMA model.
        rms_m_per_s2: of its acceleration.
    """

    theta: float
    steps_per_sample: int
    frequency_hz: float
    damping_ratio: float
    phi: tuple[float, ...]
    rms_m_per_s2: float


@dataclass(frozen=True)
class SystemFigures:
    """The body of 5 kg after 1 N·s.

    Attributes:
        phi: autoregressive coefficients of its exact response.
        theta1: moving-average coefficient.
        rms_m_per_s2: of the acceleration.
        frequency_hz: undamped.
        damping_ratio: 1 = critically damped.
        wilson_theta: the same of the response by the Wilson-theta method.
        closed_form_kg: mass in closed form.
        bisection_kg: mass by halving a range.
        halvings: how many that took.
    """

    phi: tuple[float, ...]
    theta1: float
    rms_m_per_s2: float
    frequency_hz: float
    damping_ratio: float
    wilson_theta: SteppedFigures
    closed_form_kg: float
    bisection_kg: float
    halvings: int


@dataclass(frozen=True)
class EndMillFigures:
    """The end mill, from its printed coefficients.

    Attributes:
        frequency_hz: undamped.
        damping_ratio: 1 = critically damped.
        mass_kg: equivalent mass.
        stiffness_n_per_m: equivalent stiffness.
        wilson_theta: of its equation by the Wilson-theta method, with one step per sample and with more.
    """

    frequency_hz: float
    damping_ratio: float
    mass_kg: float
    stiffness_n_per_m: float
    wilson_theta: tuple[SteppedFigures, ...]


@dataclass(frozen=True)
class ColletFigures:
    """The collet, from its equation.

    Attributes:
        frequency_hz: undamped.
        equation_damping_ratio: with the damping of the equation.
        listed_damping_ratio: with the damping of the list below it.
    """

    frequency_hz: float
    equation_damping_ratio: float
    listed_damping_ratio: float


@dataclass(frozen=True)
class SeriesFigures:
    """End mill and collet in series under a force.

    Attributes:
        force_n: on the tip.
        end_mill_um: deflection of the end mill.
        collet_um: deflection of the collet.
        natural_frequencies_hz: of both as one chain, ascending.
        end_mill_share_of_slow_mode_percent: of the tip's deflection in the slower mode.
    """

    json_extra: ClassVar[dict[str, Any]] = {
        "total_um": float,
        "end_mill_share_percent": float,
        "collet_share_percent": float,
    }

    force_n: float
    end_mill_um: float
    collet_um: float
    natural_frequencies_hz: tuple[float, float]
    end_mill_share_of_slow_mode_percent: float

    @property
    def total_um(self) -> float:
        """Deflection of the tip."""
        return self.end_mill_um + self.collet_um

    @property
    def end_mill_share_percent(self) -> float:
        """Of the end mill in the deflection."""
        return 100.0 * self.end_mill_um / self.total_um

    @property
    def collet_share_percent(self) -> float:
        """Of the collet in the deflection."""
        return 100.0 - self.end_mill_share_percent
