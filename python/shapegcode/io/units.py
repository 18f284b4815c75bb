"""Units and names as measuring programs write them: ``Acc_X [m/s^2]``, ``time_ms``, ``Kraft / N``."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

__all__ = ["Label", "Unit", "find_unit", "read_label", "units_of"]

Measured = Literal["time", "force", "acceleration", "velocity", "displacement"]

#: Standard acceleration of gravity, m/s² (exact by definition).
_G_M_S2 = 9.80665
#: Pound-force in N (exact by definition).
_LBF_N = 4.4482216152605

_FACTORS: dict[Measured, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "us": 1e-6, "min": 60.0},
    "force": {"N": 1.0, "kN": 1e3, "lbf": _LBF_N},
    "acceleration": {"m/s²": 1.0, "mm/s²": 1e-3, "g": _G_M_S2},
    "velocity": {"m/s": 1.0, "mm/s": 1e-3, "µm/s": 1e-6, "um/s": 1e-6},
    "displacement": {"m": 1.0, "mm": 1e-3, "µm": 1e-6, "um": 1e-6},
}
_SPELLINGS = {
    "sec": "s",
    "second": "s",
    "seconds": "s",
    "sek": "s",
    "sekunde": "s",
    "sekunden": "s",
    "msec": "ms",
    "millisecond": "ms",
    "milliseconds": "ms",
    "usec": "us",
    "µsec": "us",
    "minute": "min",
    "minutes": "min",
    "newton": "n",
    "newtons": "n",
    "meter": "m",
    "metre": "m",
    "micron": "um",
    "gn": "g",
    "g0": "g",
    "g's": "g",
    "gs": "g",
    "ms-2": "m/s²",
    "mms-2": "mm/s²",
    "ms-1": "m/s",
    "mms-1": "mm/s",
}
#: Units of raw signals and of quantities that are not converted: behind a name they must not pass for a part of it.
_FOREIGN = frozenset(
    {"v", "mv", "µv", "uv", "kv", "volt", "volts", "pc", "nc", "coulomb", "ma"}
    | {"count", "counts", "cts", "digit", "digits", "lsb", "adc", "%", "%fs", "fs", "db"}
    | {"lb", "lbs", "kgf", "kp", "dan", "mn", "cn"}
    | {"inch", "mil", "mils", "in/s", "in/s2", "ips", "ft/s", "ft/s2", "mg", "nm"}
)
_FOREIGN_TIMES = frozenset({"ns", "h", "hour", "hours", "tick", "ticks", "sample", "samples"})


@dataclass(frozen=True)
class Unit:
    """A known unit.

    Attributes:
        measures: what it is a unit of.
        name: as messages write it.
        factor: multiplies a value to give SI (s, N, m/s², m/s, m).
    """

    measures: Measured
    name: str
    factor: float


_UNITS = {
    name.lower(): Unit(measures, name, factor) for measures, row in _FACTORS.items() for name, factor in row.items()
}


def units_of(measures: Measured) -> str:
    """The units known for a quantity, for messages."""
    return ", ".join(name for name in _FACTORS[measures] if name[0] != "u")


def find_unit(text: str) -> Unit | None:
    """The unit that a text means, upper or lower case; None: not known."""
    plain = text.strip().lower().replace("μ", "µ")
    plain = re.sub(r"[\s*·⋅()\[\]]", "", plain.replace("**", "^"))
    plain = plain.replace("⁻", "-").replace("¹", "1").replace("²", "2").replace("^", "")
    plain = _SPELLINGS.get(plain, plain)
    plain = re.sub(r"^(m|mm|µm|um)[/_](s|sec)[/_](s|sec)$", r"\1/s2", plain)
    plain = re.sub(r"^(m|mm|µm|um)[/_p]s(ec)?(2?)$", r"\1/s\3", plain)
    return _UNITS.get(plain.replace("s2", "s²"))


_NAMES: dict[str, Measured] = {}
for _measures, _names in {
    "time": "t time zeit timestamp",
    "force": "f force kraft hammer",
    "acceleration": "a acc accel acceleration accelerometer beschleunigung",
    "velocity": "v vel velocity geschwindigkeit",
    "displacement": "d u disp displacement weg deflection auslenkung",
}.items():
    _NAMES |= dict.fromkeys(_names.split(), _measures)  # type: ignore[arg-type]
_WEAK_FORCE = {"impact", "excitation", "anregung"}
_RESPONSE = {"response", "antwort"}
_WITH_AXIS = re.compile(r"(a|acc|accel|acceleration|v|vel|velocity|d|u|disp|displacement|f|force)([xyz])")


@dataclass(frozen=True)
class Label:
    """What a column's or a channel's label says.

    Attributes:
        text: the label.
        measures: None where it says nothing, "response" for a response of unknown quantity.
        axis: "x", "y" or "z".
        unit: where it is known.
        unknown_unit: text where a unit stands that is not known.
    """

    text: str
    measures: Measured | Literal["response"] | None
    axis: str | None
    unit: Unit | None
    unknown_unit: str = ""


def _split_unit(text: str) -> tuple[str, Unit | None, str]:
    """(name, unit, text of an unknown unit) of a label."""
    if text.strip().lower() not in _NAMES and (unit := find_unit(text)):
        return "", unit, ""
    unknown = ""
    name = text
    for match in re.finditer(r"[\[({<]([^\[\](){}<>]*)[\])}>]", text):
        inner = match[1].strip()
        if inner.lower() in {"x", "y", "z"} or inner.isdigit() or (len(inner) > 1 and inner.lower() in _NAMES):
            continue
        name = name.replace(match[0], " ")
        if unit := find_unit(inner):
            return name.rstrip(" /"), unit, ""
        unknown = inner or unknown
    if unknown:
        return name, None, unknown
    for split in re.finditer(r"[_ ,/]+", text):
        head, tail = text[: split.start()], text[split.end() :]
        if head and (unit := find_unit(tail)):
            return re.sub(r" in$", "", head), unit, ""
    for split in re.finditer(r"[_ ,/.:-]+", text):
        head, tail = text[: split.start()], text[split.end() :]
        if _is_foreign(head, tail.strip()):
            return head, None, tail.strip()
    head, found, tail = text.partition("/")
    if found and head and _words(tail) != [tail.strip().lower()]:
        return head, None, tail.strip()
    return text, None, ""


def _is_foreign(head: str, tail: str) -> bool:
    """Whether a name is followed by a unit that is not converted, such as V: of "x_v" that is the velocity."""
    measures, _ = _meaning(_words(head))
    plain = re.sub(r"[\s^]", "", tail.lower()).replace("²", "2").replace("μ", "µ")
    if measures == "time":
        return plain in _FOREIGN_TIMES or plain in _FOREIGN
    return measures is not None and plain in _FOREIGN and (measures != "response" or plain not in _NAMES or tail == "V")


def _words(text: str) -> list[str]:
    return re.findall(r"[^\W\d_]+", text.lower())


def _meaning(words: list[str]) -> tuple[Measured | Literal["response"] | None, str | None]:
    axis = next((word for word in words if word in {"x", "y", "z"}), None)
    found: list[Measured] = []
    for word in words:
        if word in _NAMES:
            found.append(_NAMES[word])
        elif joined := _WITH_AXIS.fullmatch(word):
            found.append(_NAMES[joined[1]])
            axis = axis or joined[2]
    for measures in ("time", "force", "acceleration", "velocity", "displacement"):
        if measures in found:
            return measures, axis
    if _RESPONSE & set(words):
        return "response", axis
    if _WEAK_FORCE & set(words):
        return "force", axis
    return ("response" if axis else None), axis


def read_label(text: str, unit_text: str = "") -> Label:
    """Read a label; *unit_text* is what a row of units below it says."""
    if text.strip().lower() in {"x_value", "x value"}:  # LabVIEW's name of the time, which it writes in seconds
        return Label(text, "time", None, find_unit(unit_text or "s"))
    name, unit, unknown = _split_unit(text)
    if unit_text.strip(" []()-"):
        unit = find_unit(unit_text)
        unknown = "" if unit else unit_text.strip()
    measures, axis = _meaning(_words(name))
    if unit is not None and measures in {None, "response"}:
        measures = unit.measures
    return Label(text.strip(), measures, axis, unit, unknown)
