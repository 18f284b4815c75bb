"""What the user says about a file of records, over what the file says itself."""

from __future__ import annotations

from dataclasses import dataclass

from shapegcode.errors import RecordError
from shapegcode.io.record import Quantity
from shapegcode.io.units import Measured, Unit, find_unit, units_of

__all__ = ["ReadOptions", "stated_unit"]


@dataclass(frozen=True)
class ReadOptions:
    """What the user says about a file, over what the file says itself.

    Attributes:
        axis: use the response along this axis only ("x", "y" or "z"); where the file names no axis, it is this one.
        time_column: header or number (from 1) of the column with the time.
        force_column: the same for the force of the hammer.
        response_columns: the same for the responses; empty: all that the header names.
        time_unit: unit of the time column, whatever the header says.
        force_unit: of the force.
        response_unit: of the response.
        period_s: time between two samples, where the file has no time, or to check it.
        quantity: what the sensor measured, where the file does not say.
        force_scale: N for 1 in the file; of an integer WAV, N at full scale.
        response_scale: m/s², m/s or m (see *quantity*) for 1 in the file; of an integer WAV, at full scale.
        response_first: in a WAV file, the response is the first channel and the force the second.
        ignore_force: read the response only, as a free decay.
    """

    axis: str | None = None
    time_column: str | None = None
    force_column: str | None = None
    response_columns: tuple[str, ...] = ()
    time_unit: str | None = None
    force_unit: str | None = None
    response_unit: str | None = None
    period_s: float | None = None
    quantity: Quantity | None = None
    force_scale: float | None = None
    response_scale: float | None = None
    response_first: bool = False
    ignore_force: bool = False

    def __post_init__(self) -> None:
        if self.axis not in {None, "x", "y", "z"}:
            raise RecordError(f"axis {self.axis!r}: must be x, y or z")
        for name in ("period_s", "force_scale", "response_scale"):
            value = getattr(self, name)
            if value is not None and not 0.0 < abs(value) < float("inf"):
                raise RecordError(f"{name} = {value:g}: must be a number other than 0")
        if self.period_s is not None and self.period_s < 0.0:
            raise RecordError(f"period_s = {self.period_s:g}: must be above 0")
        stated: tuple[tuple[str, str | None, tuple[Measured, ...]], ...] = (
            ("time_unit", self.time_unit, ("time",)),
            ("force_unit", self.force_unit, ("force",)),
            ("response_unit", self.response_unit, ("acceleration", "velocity", "displacement")),
        )
        for option, text, allowed in stated:
            if text is not None and stated_unit(text, allowed) is None:
                raise RecordError(f"{option} {text!r} is not known: must be one of {units_of(*allowed)}")


def stated_unit(text: str | None, allowed: tuple[Measured, ...]) -> Unit | None:
    """The unit of an option, if it is one of the quantities allowed.

    Args:
        text: of the option; None: not given.
        allowed: kinds of quantity.

    Returns:
        The unit; None where the text is none of an allowed quantity.
    """
    unit = find_unit(text) if text else None
    return unit if unit is not None and unit.measures in allowed else None
