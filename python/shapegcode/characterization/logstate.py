"""What the fits to servo logs share: what is known so far, and the time from one move to the next."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from shapegcode.characterization.findings import Finding
from shapegcode.characterization.moves import PartLog

SOURCE = "log"
ODD_SHAPE = 0.002  # of the way: a fit that leaves more is no fit
BELL_GAIN = 0.8  # a second moving average must lower the variance below this share
_FINE = 1.7  # periods
_FINE_BENT = 1.0


@dataclass
class State:
    """What is known so far; times in s."""

    period: float | None = None
    held: bool = False
    bent: bool = False
    sampling: float = 0.001
    end: str | None = None
    cutting: float | None = None
    cutting_half: float = 0.0
    exponential: bool = False
    stop_pitch: float | None = None
    findings: list[Finding] = field(default_factory=list)

    @property
    def fine_s(self) -> float:
        """A second moving average up to this length may be interpolation between unseen periods."""
        if self.bent and self.period:
            return _FINE_BENT * self.period
        return 0.0 if self.held else _FINE * max(self.period or 0.0, 2.0 * self.sampling)


def pitch_of(part: PartLog) -> tuple[float, float]:
    """Mean time from one move to the next, and its 95 % half-width."""
    steps = np.diff(part.middles_s())
    spread = float(steps.std(ddof=1)) if len(steps) > 1 else 0.001
    return float(steps.mean()), 1.96 * max(spread, 2e-5) / math.sqrt(len(steps))
