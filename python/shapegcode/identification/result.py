"""What an identification found, with its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from shapegcode.identification.mode import IdentifiedMode, mode_line

FloatArray = npt.NDArray[np.float64]


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
        count = f"{self.order} mode{'' if self.order == 1 else 's'}"
        lines = [f"Identification: model of {count}, {self.fit_percent:.1f} % of the response"]
        lines += [f"  {mode_line(mode)}" for mode in (*self.modes, *self.refused)]
        if self.warnings:
            lines.append(f"  {len(self.warnings)} warning{'' if len(self.warnings) == 1 else 's'}: see .warnings")
        return "\n".join(lines)
