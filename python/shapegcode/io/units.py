"""Table of units, with the spellings of measuring programs: ``m/s^2``, ``m_s2``, ``mm/min``, ``kgf``, arrays."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]  # of doubles, of any shape


Measured = Literal["time", "force", "torque", "acceleration", "velocity", "displacement"]

MM_PER_INCH = 25.4  # exact by definition
_G_M_S2 = 9.80665  # standard acceleration of gravity, m/s² (exact by definition)
_LBF_N = 4.4482216152605  # pound-force in N (exact by definition)
_INCH_M = 0.0254  # inch in m (exact by definition)

_FACTORS: dict[Measured, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "us": 1e-6, "min": 60.0},
    "force": {"N": 1.0, "kN": 1e3, "kgf": _G_M_S2, "lbf": _LBF_N},
    "torque": {"N·m": 1.0, "N·cm": 1e-2},
    "acceleration": {"m/s²": 1.0, "mm/s²": 1e-3, "g": _G_M_S2},
    "velocity": {
        "m/s": 1.0, "mm/s": 1e-3, "mm/min": 1e-3 / 60.0, "µm/s": 1e-6, "um/s": 1e-6, "m/min": 1.0 / 60.0,
        "inch/min": _INCH_M / 60.0, "inch/s": _INCH_M,
    },
    "displacement": {"m": 1.0, "mm": 1e-3, "µm": 1e-6, "um": 1e-6, "inch": _INCH_M},
}  # fmt: skip
_SPELLINGS = {
    spelling: unit
    for unit, spellings in {
        "s": "sec second seconds sek sekunde sekunden", "ms": "msec millisecond milliseconds", "us": "usec µsec",
        "min": "minute minutes", "n": "newton newtons", "kgf": "kp", "nm": "n_m", "m": "meter metre", "um": "micron",
        "inch": "in", "g": "gn g0 g's gs", "m/s²": "ms-2", "mm/s²": "mms-2", "m/s": "ms-1",
        "mm/s": "mms-1 millimeter/second", "mm/min": "mm_min mmpm millimeter/minute",
        "inch/min": "in/min ipm inch_min inch/minute",
    }.items()
    for spelling in spellings.split()
}  # fmt: skip
#: Units of raw signals and of quantities not converted: after a name they must not be read as part of it.
_FOREIGN = frozenset(
    {"v", "mv", "µv", "uv", "kv", "volt", "volts", "pc", "nc", "coulomb", "ma"}
    | {"count", "counts", "cts", "digit", "digits", "lsb", "adc", "%", "%fs", "fs", "db"}
    | {"lb", "lbs", "dan", "mn", "cn"}
    | {"mil", "mils", "in/s", "in/s2", "ips", "ft/s", "ft/s2", "mg", "nm"}
)
_FOREIGN_TIMES = frozenset({"ns", "h", "hour", "hours", "tick", "ticks", "sample", "samples"})


@dataclass(frozen=True)
class Unit:
    """A known unit."""

    measures: Measured  # measured quantity
    name: str  # name in messages
    factor: float  # multiplies a value to give SI (s, N, N·m, m/s², m/s, m)


_UNITS = {
    name.lower().replace("·", ""): Unit(measures, name, factor)
    for measures, row in _FACTORS.items()
    for name, factor in row.items()
}


def units_of(*measures: Measured) -> str:
    """Known units of quantities, for messages."""
    return "; ".join(", ".join(name for name in _FACTORS[each] if name[0] != "u") for each in measures)


def find_unit(text: str) -> Unit | None:
    """Find a unit, in upper or lower case; None: unknown."""
    plain = text.strip().lower().replace("μ", "µ").replace("_per_", "/")
    plain = re.sub(r"[\s*·⋅()\[\]]", "", plain.replace("**", "^"))
    plain = plain.replace("⁻", "-").replace("¹", "1").replace("²", "2").replace("^", "")
    plain = _SPELLINGS.get(plain, plain)
    plain = re.sub(r"^(m|mm|µm|um)[/_](s|sec)[/_](s|sec)$", r"\1/s2", plain)
    plain = re.sub(r"^(m|mm|µm|um)[/_p]s(ec)?(2?)$", r"\1/s\3", plain)
    return _UNITS.get(plain.replace("s2", "s²"))


def factor_between(unit: Unit, wanted: str) -> float:
    """Factor from a unit to another of the same quantity."""
    other = find_unit(wanted)
    if other is None or other.measures != unit.measures:
        raise ValueError(f"{unit.name} of {unit.measures} cannot be converted to {wanted}")
    return unit.factor / other.factor


def is_foreign_unit(text: str, measures: str | None) -> bool:
    """Whether a text is a unit without conversion, such as V, for a quantity of this kind."""
    plain = re.sub(r"[\s^]", "", text.lower()).replace("²", "2").replace("μ", "µ")
    return plain in _FOREIGN or (measures == "time" and plain in _FOREIGN_TIMES)
