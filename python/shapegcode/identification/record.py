"""One tap, or one decay: what the sensors gave, in SI units, whatever file it came from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from shapegcode import _core

FloatArray = npt.NDArray[np.float64]
Quantity = Literal["acceleration", "velocity", "displacement"]

UNITS: dict[Quantity, str] = {"acceleration": "m/s²", "velocity": "m/s", "displacement": "m"}


class RecordError(_core.ArgumentError):
    """A record cannot be used: the message says what was found and what is needed."""


@dataclass(frozen=True, eq=False)
class Record:
    """Samples of one tap (with force) or of one free decay (without).

    Attributes:
        source: file, and which hit or channel of it, for messages.
        period_s: time between two samples.
        response: (n,) in the unit of `quantity`.
        quantity: what the sensor measured.
        force_n: (n,) force of the hammer at the same instants; None: a free decay.
        axis: "x", "y" or "z" where the file says it.
        start_s: time of the first sample in the file.
        warnings: what reading the file had to assume.
    """

    source: str
    period_s: float
    response: FloatArray
    quantity: Quantity = "acceleration"
    force_n: FloatArray | None = None
    axis: str | None = None
    start_s: float = 0.0
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.force_n is not None and len(self.force_n) != len(self.response):
            raise RecordError(
                f"{self.source}: {len(self.force_n)} samples of force and {len(self.response)} of response: "
                "both must be sampled together"
            )

    @property
    def time_s(self) -> FloatArray:
        """Instants of the samples, (n,)."""
        return np.asarray(self.start_s + self.period_s * np.arange(len(self.response)), dtype=np.float64)
