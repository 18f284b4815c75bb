"""Units in the spellings of measuring programs (``m/s^2``, ``m_s2``, ``kgf``), and labels of columns that contain them.

`read_label` splits every label in the same way: ``Acc_X [m/s^2]``, ``time_ms``, ``Kraft / N``, or a name with its unit
in the row below. Meanings of names differ: ``x`` is a response along X in a tap file, a position in a record of
forces. So each file type has its own names; those of tap files are here, since universal files share them.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from shapegcode.errors import RecordError

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
    """Whether a text is a unit, such as V, that is not converted for a quantity of this kind."""
    plain = re.sub(r"[\s^]", "", text.lower()).replace("²", "2").replace("μ", "µ")
    return plain in _FOREIGN or (measures == "time" and plain in _FOREIGN_TIMES)


@dataclass(frozen=True)
class Meaning:
    """The meaning of a column name."""

    what: str  # quantity, by the name in the file's reader, such as "fx"
    measures: Measured | Literal["response"]  # its kind; "response" for a response of unknown kind
    axis: str | None = None  # "x", "y" or "z"; None: no axis


Names = Callable[[str], Meaning | None]
"""Names of one file type: maps a name without unit to its meaning; None: not used."""


@dataclass(frozen=True)
class Label:
    """Parsed label of a column or channel."""

    text: str  # the label
    meaning: Meaning | None  # None: unknown name
    unit: Unit | None  # None: unknown or not stated
    unknown_unit: str = ""  # text of an unknown unit

    @property
    def measures(self) -> Measured | Literal["response"] | None:
        """Kind of the quantity; None: unknown."""
        return None if self.meaning is None else self.meaning.measures

    @property
    def axis(self) -> str | None:
        """ "x", "y" or "z"; None: no axis."""
        return None if self.meaning is None else self.meaning.axis


def words_of(name: str) -> list[str]:
    """The words of a name, in lower case."""
    return re.findall(r"[^\W\d_]+", name.lower())


def read_label(text: str, unit_text: str, names: Names) -> Label:
    """Read a label."""
    if text.strip().lower() in {"x_value", "x value"}:  # LabVIEW's name of the time, which it writes in seconds
        return Label(text, Meaning("time", "time"), find_unit(unit_text or "s"))
    name, unit, unknown = _split_unit(text, names)
    if unit_text.strip(" []()-"):
        unit = find_unit(unit_text)
        unknown = "" if unit else unit_text.strip()
    return Label(text.strip(), names(name), unit, unknown)


def _split_unit(text: str, names: Names) -> tuple[str, Unit | None, str]:
    """Split a label into name, unit, text of an unknown unit."""
    if names(text) is None and not _is_in(text) and (unit := find_unit(text)):
        return "", unit, ""
    unknown = ""
    name = text
    for match in re.finditer(r"[\[({<]([^\[\](){}<>]*)[\])}>]", text):
        inner = match[1].strip()
        if inner.lower() in {"x", "y", "z"} or inner.isdigit() or (len(inner) > 1 and _is_name(inner, names)):
            continue
        name = name.replace(match[0], " ")
        if unit := find_unit(inner):
            return name.rstrip(" /"), unit, ""
        unknown = inner or unknown
    if unknown:
        return name, None, unknown
    for split in re.finditer(r"[_ ,/]+", text):
        head, tail = text[: split.start()], text[split.end() :]
        if head and (unit := find_unit(tail)) and not (_is_in(tail) and _kind(head, names) != unit.measures):
            return re.sub(r" in$", "", head), unit, ""
    for split in re.finditer(r"[_ ,/.:-]+", text):
        head, tail = text[: split.start()], text[split.end() :].strip()
        kind = _kind(head, names)
        # "x_v" is the velocity along X, "x_V" a response in V.
        named = kind == "response" and _is_name(tail, names) and tail != "V"
        if kind is not None and is_foreign_unit(tail, kind) and not named:
            return head, None, tail
    head, found, tail = text.partition("/")
    if found and head and words_of(tail) != [tail.strip().lower()]:
        return head, None, tail.strip()
    return text, None, ""


def _is_in(text: str) -> bool:
    """Whether a text is "in": a unit after the name of a length, otherwise a word."""
    return text.strip().lower() == "in"


def _kind(name: str, names: Names) -> str | None:
    found = names(name)
    return None if found is None else found.measures


def _is_name(text: str, names: Names) -> bool:
    """Whether a text is a single word, a known name, and no unit."""
    return words_of(text) == [text.lower()] and names(text) is not None and find_unit(text) is None


def unit_of(where: str, label: Label, allowed: tuple[Measured, ...], remedy: str = "") -> Unit | None:
    """Unit of a label for a quantity; None: not stated."""
    needed = f"required: one of {units_of(*allowed)}"
    if label.unit is None and label.unknown_unit:
        raise RecordError(
            f"{where}: {label.text!r}: the unit {label.unknown_unit!r} is not known; {needed}"
            + (f"; {remedy}" if remedy else "")
        )
    if label.unit is not None and label.unit.measures not in allowed:
        raise RecordError(
            f"{where}: {label.text!r} has the unit {label.unit.name} of {label.unit.measures}, but must be of "
            f"{' or '.join(allowed)}: name and unit must agree; {needed}"
        )
    return label.unit


# --- the names in records of taps and decays --------------------------------------------------------------------------

_NAMES: dict[str, Measured] = {}
for _measures, _words in {
    "time": "t time zeit timestamp",
    "force": "f force kraft hammer",
    "acceleration": "a acc accel acceleration accelerometer beschleunigung",
    "velocity": "v vel velocity geschwindigkeit",
    "displacement": "d u disp displacement weg deflection auslenkung",
}.items():
    _NAMES |= dict.fromkeys(_words.split(), _measures)  # type: ignore[arg-type]
_ORDER: tuple[Measured, ...] = ("time", "force", "acceleration", "velocity", "displacement")
_WEAK_FORCE = {"impact", "excitation", "anregung"}
_RESPONSE = {"response", "antwort"}
_WITH_AXIS = re.compile(r"(a|acc|accel|acceleration|v|vel|velocity|d|u|disp|displacement|f|force)([xyz])")


def tap_label(text: str, unit_text: str = "") -> Label:
    """Read a label of a tap file: if its name is unknown, or only "response", the quantity follows from the unit."""
    label = read_label(text, unit_text, _tap_names)
    if label.unit is None or label.measures not in {None, "response"}:
        return label
    return replace(label, meaning=Meaning(label.unit.measures, label.unit.measures, label.axis))


def _tap_names(name: str) -> Meaning | None:
    """Meaning of a name that contains an axis, or an English or German word for time, force or a response."""
    words = words_of(name)
    axis = next((word for word in words if word in {"x", "y", "z"}), None)
    found: list[Measured] = []
    for word in words:
        if word in _NAMES:
            found.append(_NAMES[word])
        elif joined := _WITH_AXIS.fullmatch(word):
            found.append(_NAMES[joined[1]])
            axis = axis or joined[2]
    measures: Measured | Literal["response"] | None = next((each for each in _ORDER if each in found), None)
    if measures is None:
        strong = bool(_RESPONSE & set(words))
        weak = bool(_WEAK_FORCE & set(words))
        measures = "response" if strong else "force" if weak else "response" if axis else None
    return None if measures is None else Meaning(measures, measures, axis)
