"""Record of one tap or decay, in SI units; and the user's options for reading its file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.io.units import FloatArray, Measured, Unit, find_unit, units_of

Quantity = Literal["acceleration", "velocity", "displacement"]

UNITS: dict[Quantity, str] = {"acceleration": "m/s²", "velocity": "m/s", "displacement": "m"}


@dataclass(frozen=True, eq=False)
class Record:
    """Samples of one tap (with force) or of one free decay (without).

    Attributes:
        source: file, with the number of the impact or the channel, for messages.
        period_s: time between two samples.
        response: (n,) in the unit of `quantity`.
        quantity: what the sensor measured.
        force_n: (n,) force of the hammer at the same instants; None: a free decay.
        axis: "x", "y" or "z" None if the file does not state it.
        start_s: time of the first sample in the file.
        warnings: assumptions made on reading.
        notes: parts ignored on reading.
        widened: factor on confidence intervals (uneven samples carry less information).
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
            f"{source}: the {what} is of shape {array.shape} and type {array.dtype}; required: one row of real numbers"
        )
    bad = np.flatnonzero(~np.isfinite(array))
    if bad.size:
        raise RecordError(f"{source}: sample {bad[0]} of the {what} is {array[bad[0]]}: must be finite")


@dataclass(frozen=True)
class ReadOptions:
    """User's statements about a file, which override the file.

    Attributes:
        axis: use only the response along this axis ("x", "y" or "z"); a file without axes is assumed to have this one.
        time_column: header or number (from 1) of the column with the time.
        force_column: header or number of the column with the hammer's force.
        response_columns: headers or numbers of the response columns; empty: all named by the header.
        time_unit: unit of the time column, overrides the header.
        force_unit: unit of the force.
        response_unit: unit of the response.
        period_s: time between two samples, if the file has no time, or to check it.
        quantity: measured quantity, if the file does not state it.
        force_scale: N per unit in the file; integer WAV: N at full scale.
        response_scale: m/s², m/s or m (see *quantity*) per unit in the file; integer WAV: at full scale.
        response_first: in a WAV file, the response is the first channel and the force the second.
        force_sensitivity: sensitivity of the hammer, such as "2.25 mV/N", for a force in volts.
        response_sensitivity: sensitivity of the sensor, such as "100 mV/g", for a response in volts.
        ignore_force: read only the response, as a free decay.
        exponential_window_s: time constant of an exponential window that the analyser applied to the response.
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
    force_sensitivity: str | None = None
    response_sensitivity: str | None = None
    ignore_force: bool = False
    exponential_window_s: float | None = None

    def __post_init__(self) -> None:
        if self.axis not in {None, "x", "y", "z"}:
            raise RecordError(f"axis {self.axis!r}: must be x, y or z")
        for name in ("period_s", "force_scale", "response_scale"):
            value = getattr(self, name)
            if value is not None and not 0.0 < abs(value) < float("inf"):
                raise RecordError(f"{name} = {value:g}: must be a number other than 0")
        for name in ("period_s", "exponential_window_s"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < float("inf"):
                raise RecordError(f"{name} = {value:g}: must be above 0")
        kinds: dict[str, tuple[Measured, ...]] = {
            "time": ("time",),
            "force": ("force",),
            "response": get_args(Quantity),
        }
        for kind, allowed in kinds.items():
            text = getattr(self, f"{kind}_unit")
            if text is not None and stated_unit(text, allowed) is None:
                raise RecordError(f"{kind}_unit {text!r} is not known: must be one of {units_of(*allowed)}")
        for kind in ("force", "response"):
            text = getattr(self, f"{kind}_sensitivity")
            if text is not None:
                per_volt(f"{kind}_sensitivity", text, kinds[kind])
                if getattr(self, f"{kind}_scale") is not None:
                    raise RecordError(f"{kind}_sensitivity {text!r} and {kind}_scale: specify only one")


_VOLTS = {"v": 1.0, "mv": 1e-3, "µv": 1e-6, "uv": 1e-6}


def volts_of(unit_text: str) -> float | None:
    """Factor from V, mV or µV to volts."""
    plain = unit_text.strip().lower().replace("μ", "µ")
    return 1.0 if plain in {"", "volt", "volts"} else _VOLTS.get(plain)


def per_volt(option: str, text: str, allowed: tuple[Measured, ...]) -> tuple[Unit, float]:
    """Unit and value of one volt by a sensitivity."""
    match = re.fullmatch(r"\s*([0-9.]+(?:[eE][+-]?\d+)?)\s*([mµuμ]?V)\s*/\s*\(?(.+?)\)?\s*", text)
    unit = find_unit(match[3]) if match else None
    volts = volts_of(match[2]) if match else None
    if match is None or unit is None or volts is None or unit.measures not in allowed or not float(match[1]) > 0.0:
        example = "2.25 mV/N" if allowed == ("force",) else "100 mV/g"
        raise RecordError(
            f"{option} {text!r}: must be V, mV or µV over one of {units_of(*allowed)}, such as {example!r}"
        )
    return unit, unit.factor / (float(match[1]) * volts)


def stated_unit(text: str | None, allowed: tuple[Measured, ...]) -> Unit | None:
    """The unit of an option, checked against the allowed quantities."""
    unit = find_unit(text) if text else None
    return unit if unit is not None and unit.measures in allowed else None
