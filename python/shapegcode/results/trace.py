"""Command and response of a program, played: what the pictures of motion draw."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

_STILL_MM = 1e-9


@dataclass(frozen=True, eq=False)
class Trace:
    """Command and response of one program, played on the machine's model.

    Attributes:
        label: name in legends, for example "original" or "emitted".
        period_s: time between two samples.
        command_mm: set-points of the axes after every filter, shape (n, 3).
        response_mm: position of the table at the same instants, shape (n, 3).
        start_s: time of the first sample.
        stops: the record holds the stop at the end; False where it is cut before.
        largest_mm: largest distance of the table from the programmed path over the whole run, as the core measured
            it; None: not measured.
        residual_mm: largest |response - command| of each axis after the stop, likewise.

    Raises:
        ValueError: a wrong shape, fewer than two samples, a value that is not finite, or a period that is not
            positive.
    """

    label: str
    period_s: float
    command_mm: FloatArray
    response_mm: FloatArray
    start_s: float = 0.0
    stops: bool = True
    largest_mm: float | None = None
    residual_mm: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        """Check the arrays and keep read-only views of them."""
        if not (np.isfinite(self.period_s) and self.period_s > 0):
            raise ValueError(f"trace {self.label}: period_s = {self.period_s}: must be finite and above 0")
        for name in ("command_mm", "response_mm"):
            values = np.asarray(getattr(self, name), dtype=np.float64).view()
            if values.ndim != 2 or values.shape[1] != 3 or len(values) < 2:
                raise ValueError(f"trace {self.label}: {name} has shape {values.shape}: not (n, 3), n > 1")
            if not np.isfinite(values).all():
                raise ValueError(f"trace {self.label}: {name} has values that are not finite")
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if self.command_mm.shape != self.response_mm.shape:
            raise ValueError(
                f"trace {self.label}: {len(self.command_mm)} samples of the command, "
                f"{len(self.response_mm)} of the response: must be equal"
            )

    @property
    def times_s(self) -> FloatArray:
        """Time of each sample, shape (n,)."""
        return self.start_s + np.arange(len(self.command_mm), dtype=np.float64) * self.period_s

    @property
    def departure_s(self) -> float:
        """Instant of the last sample before the set-points begin to move; the first one if they never do."""
        moved = (np.abs(self.command_mm - self.command_mm[0]) > _STILL_MM).any(axis=1)
        return self.start_s + float(max(int(moved.argmax()) - 1, 0)) * self.period_s

    @property
    def deflection_mm(self) -> FloatArray:
        """Response minus command, shape (n, 3)."""
        return self.response_mm - self.command_mm

    @property
    def rest_s(self) -> float:
        """Instant at which the set-points have come to rest for good: first sample at the final position."""
        moved = np.flatnonzero((np.abs(self.command_mm - self.command_mm[-1]) > _STILL_MM).any(axis=1))
        return self.start_s + (float(moved[-1] + 1) * self.period_s if len(moved) else 0.0)

    def part(self, begin_s: float, end_s: float, zero_s: float = 0.0) -> Trace:
        """The samples between two instants.

        Args:
            begin_s: of the first one, as far as there are samples.
            end_s: of the last one, likewise.
            zero_s: instant that becomes time zero.

        Returns:
            At least two samples; it stops if the stop is among them.
        """
        count = len(self.command_mm)
        ranks = (np.array([begin_s, end_s]) - self.start_s) / self.period_s
        first = round(float(np.clip(ranks[0], 0, count - 2)))
        last = round(float(np.clip(ranks[1], first + 1, count - 1)))
        return replace(
            self,
            command_mm=self.command_mm[first : last + 1],
            response_mm=self.response_mm[first : last + 1],
            start_s=self.start_s + first * self.period_s - zero_s,
            stops=self.stops and first * self.period_s <= self.rest_s - self.start_s <= last * self.period_s,
        )
