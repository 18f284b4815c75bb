"""One tap, or one decay: what the sensors gave, in SI units, whatever file it came from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from shapegcode.errors import RecordError

FloatArray = npt.NDArray[np.float64]
Quantity = Literal["acceleration", "velocity", "displacement"]

UNITS: dict[Quantity, str] = {"acceleration": "m/s²", "velocity": "m/s", "displacement": "m"}


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
        notes: what reading the file left out.
        widened: what intervals are multiplied with: samples that were not evenly spaced tell less.
    """

    source: str
    period_s: float
    response: FloatArray
    quantity: Quantity = "acceleration"
    force_n: FloatArray | None = None
    axis: str | None = None
    start_s: float = 0.0
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    widened: float = 1.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.period_s) and self.period_s > 0.0):
            raise RecordError(f"{self.source}: period of {self.period_s:g} s: must be finite and above 0")
        _check_samples(self.source, "response", self.response)
        if self.force_n is not None:
            _check_samples(self.source, "force", self.force_n)
        if self.force_n is not None and len(self.force_n) != len(self.response):
            raise RecordError(
                f"{self.source}: {len(self.force_n)} samples of force and {len(self.response)} of response: "
                "both must be sampled together"
            )

    @property
    def time_s(self) -> FloatArray:
        """Instants of the samples, (n,)."""
        return np.asarray(self.start_s + self.period_s * np.arange(len(self.response)), dtype=np.float64)


def _check_samples(source: str, what: str, values: FloatArray) -> None:
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind not in "fiu" or not array.size:
        raise RecordError(
            f"{source}: the {what} is of shape {array.shape} and type {array.dtype}: needed is one row of real numbers"
        )
    bad = np.flatnonzero(~np.isfinite(array))
    if bad.size:
        raise RecordError(f"{source}: sample {bad[0]} of the {what} is {array[bad[0]]}: must be finite")
