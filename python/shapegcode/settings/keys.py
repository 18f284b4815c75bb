"""Building blocks of the tables of the machine file: types of values, fields with their metadata, TOML notation."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, Strict
from pydantic.fields import FieldInfo

from shapegcode.settings.remarks import Origin, origin_of

# Numbers are strict: a string or a truth value in place of a number is an error; 3 for 3.0 is not.
Float = Annotated[float, Strict(), Field(allow_inf_nan=False)]
Positive = Annotated[float, Strict(), Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Strict(), Field(ge=0, allow_inf_nan=False)]
Count = Annotated[int, Strict(), Field(ge=0)]
Bool = Annotated[bool, Strict()]
Text = Annotated[str, Strict()]


_UNITS = {
    "": "",
    "_mm_per_min": "mm/min", "_mm_per_s": "mm/s", "_mm_s2": "mm/s²", "_mm_s3": "mm/s³", "_per_s": "1/s", "_s": "s",
    "_mm": "mm", "_um": "µm", "_inch": "inch", "_hz": "Hz", "_kg": "kg", "_n": "N", "_nm": "N m", "_w": "W",
    "_n_per_um": "N/µm", "_n_per_mm": "N/mm", "_n_per_mm2": "N/mm²", "_gpa": "GPa", "_deg": "degrees",
    "_percent": "%", "_ratio": "1", "_exponent": "1", "_bytes": "bytes", "_kb": "kB", "_baud": "baud",
}  # fmt: skip
"""Unit of a key by the end of its name; the longest that fits."""


_KNOWN = object()


def key(meaning: str, *, unit: str = "", fanuc: str = "", assumed: Any = _KNOWN, **field: Any) -> Any:
    """A pydantic field with what the documentation of a key needs; *unit* only where its name does not end in it.

    *assumed* is a default that nobody measured, in place of ``default``; left out, both make the key mandatory.
    """
    if assumed is not _KNOWN:
        field["default"] = assumed
    noted: dict[str, Any] = {"unit": unit, "fanuc": fanuc, "assumed": assumed is not _KNOWN}
    return Field(description=meaning, json_schema_extra=noted, **field)


class TomlTable(BaseModel):
    """Base of every table of the file: unknown keys are errors and values never change after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Note the units that the names of the keys say."""
        for name, field in cls.model_fields.items():
            noted = field.json_schema_extra
            if isinstance(noted, dict) and noted.get("unit") == "":
                noted["unit"] = _UNITS[max((end for end in _UNITS if name.endswith(end)), key=len, default="")]

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse it with what to do instead."""
        if not name.startswith("_"):
            raise AttributeError(
                f"{type(self).__name__}.{name} cannot be set: values never change; "
                f"machine.with_values({{'...{name}': value}}) gives a machine with another one"
            )
        super().__setattr__(name, value)


class InlineTable(TomlTable):
    """A table that is written in one line, as the value of a key."""


class PerAxis(InlineTable):
    """One value per axis. A machine file may give a single number, which then holds for all three."""

    x: NonNegative = key("value of the X axis")
    y: NonNegative = key("value of the Y axis")
    z: NonNegative = key("value of the Z axis")

    def as_tuple(self) -> tuple[float, float, float]:
        """The three values in the order X, Y, Z."""
        return (self.x, self.y, self.z)


def _spread(value: object) -> object:
    """A single number stands for all three axes; a table must name all three."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return {"x": value, "y": value, "z": value}
    return value


class PositivePerAxis(PerAxis):
    """One value per axis, greater than 0."""

    x: Positive = key("value of the X axis")
    y: Positive = key("value of the Y axis")
    z: Positive = key("value of the Z axis")


class TimePerAxis(PerAxis):
    """One time per axis in seconds, 0 to 10."""

    x: Annotated[NonNegative, Field(le=10)] = key("value of the X axis")
    y: Annotated[NonNegative, Field(le=10)] = key("value of the Y axis")
    z: Annotated[NonNegative, Field(le=10)] = key("value of the Z axis")


class RatioPerAxis(PerAxis):
    """One ratio per axis, 0 to 1."""

    x: Annotated[NonNegative, Field(le=1)] = key("value of the X axis")
    y: Annotated[NonNegative, Field(le=1)] = key("value of the Y axis")
    z: Annotated[NonNegative, Field(le=1)] = key("value of the Z axis")


AxisValues = Annotated[PerAxis, BeforeValidator(_spread, json_schema_input_type=NonNegative | PerAxis)]
PositiveAxisValues = Annotated[
    PositivePerAxis, BeforeValidator(_spread, json_schema_input_type=Positive | PositivePerAxis)
]
AxisTimes = Annotated[TimePerAxis, BeforeValidator(_spread, json_schema_input_type=NonNegative | TimePerAxis)]
AxisRatios = Annotated[RatioPerAxis, BeforeValidator(_spread, json_schema_input_type=NonNegative | RatioPerAxis)]


@dataclass(frozen=True)
class KeyInfo:
    """One key of the machine file with what the documentation says of it."""

    # dotted name; ``axes.x.modes.1.frequency_hz`` for values, ``axes.<x|y|z>`` and ``modes[]`` in the documentation of
    # the format
    key: str
    unit: str  # unit, "1" for a ratio, empty where there is none
    default: str  # default as written in TOML, or "required", or "not set"
    meaning: str  # what it is
    fanuc: str  # numbers of the FANUC parameters that correspond to it, or empty
    assumed: bool  # True where the default is an assumption and not a known value


@dataclass(frozen=True)
class KeyValue:
    """One value of loaded settings, with what the documentation says of its key."""

    key: str  # dotted name, ``axes.x.modes.1.frequency_hz``
    value: str  # the value as TOML, "not set" for an optional key without one
    unit: str  # unit, "1" for a ratio, empty where there is none
    # where it comes from: "measured" on this machine, "dump" of the control's parameters, "inherited" from another
    # machine, "assumed", "choice" (no property of a machine), "file" (the file states it, and does not say why),
    # "default" (the file leaves it out)
    origin: Origin
    assumed: bool  # True where the value is an assumption, in the file or as a default
    meaning: str  # what it is
    fanuc: str  # numbers of the FANUC parameters that correspond to it, or empty
    remark: str = ""  # what stands behind the value in the file

    @property
    def unmeasured(self) -> bool:
        """Whether nobody measured or looked it up on this machine: it is assumed or inherited."""
        return self.assumed or self.origin == "inherited"


def facts(field: FieldInfo | None) -> dict[str, Any]:
    """What `key` noted of a field."""
    extra = field.json_schema_extra if field is not None else None
    return dict(extra) if isinstance(extra, dict) else {}


def table_type(field: FieldInfo) -> type[TomlTable] | None:
    """The table type of a field: a table itself or the items of a list of tables; None for a plain value."""
    return _as_table(field.annotation) or item_type(field)


def item_type(field: FieldInfo) -> type[TomlTable] | None:
    """The table type of the items of a field that holds a list of tables; None for every other field."""
    arguments = get_args(field.annotation)
    is_list = len(arguments) == 2 and arguments[1] is Ellipsis
    return _as_table(arguments[0]) if is_list else None


def _as_table(annotation: Any) -> type[TomlTable] | None:
    arguments = get_args(annotation)
    if isinstance(annotation, UnionType) and len(arguments) == 2 and arguments[1] is NoneType:
        annotation = arguments[0]  # an optional table
    return annotation if isinstance(annotation, type) and issubclass(annotation, TomlTable) else None


def key_info(field: FieldInfo, key: str) -> KeyInfo:
    """What the documentation says of a field; *key* is its dotted name."""
    noted = facts(field)
    default = "required" if field.is_required() else "not set" if field.default is None else toml(field.default)
    unit, fanuc = noted.get("unit", ""), noted.get("fanuc", "")
    return KeyInfo(key, unit, default, field.description or "", fanuc, bool(noted.get("assumed")))


def values_of(
    table: TomlTable, prefix: str = "", given: bool = True, remarks: Mapping[str, str] | None = None
) -> Iterator[KeyValue]:
    """Every key below a table with its value and origin, in the order of the file."""
    for name, field in type(table).model_fields.items():
        value, key = getattr(table, name), f"{prefix}{name}"
        from_file = given and name in table.model_fields_set
        if isinstance(value, TomlTable) and not isinstance(value, InlineTable):
            yield from values_of(value, f"{key}.", from_file, remarks)
        elif item_type(field) and value:
            for number, item in enumerate(value, start=1):
                yield from values_of(item, f"{key}.{number}.", from_file, remarks)
        else:
            info = key_info(field, key)
            remark = (remarks or {}).get(key, "")
            # A key without a value can have a remark that says why: "assumed: not limited", "not measured: rigid".
            says_why = not value and (value is not None or remark.startswith("assumed"))
            origin = origin_of(remark) if from_file or (remark and says_why) else "default"
            assumed = origin == "assumed" or (info.assumed and origin == "default")
            shown = "not set" if value is None else toml(value)
            yield KeyValue(key, shown, info.unit, origin, assumed, info.meaning, info.fanuc, remark)


def toml(value: object) -> str:
    """A value in TOML notation."""
    if isinstance(value, PerAxis):
        if value.x == value.y == value.z:
            return toml(value.x)
        return toml(dict(value))
    if isinstance(value, InlineTable):
        given = {name: getattr(value, name) for name in type(value).model_fields}
        return toml({name: item for name, item in given.items() if item is not None})
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        is_whole = math.isfinite(value) and value == int(value) and abs(value) < 1e15
        return f"{value:.1f}" if is_whole else repr(value)
    if isinstance(value, str):
        # JSON strings are TOML basic strings, but for DEL, which TOML wants escaped.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml(item) for item in value) + "]"
    if isinstance(value, dict):
        items = ", ".join(f"{toml_key(key)} = {toml(item)}" for key, item in value.items())
        return f"{{ {items} }}" if value else "{}"
    return str(value)


def toml_key(key: str) -> str:
    """A key in TOML notation: in quotes where it must be."""
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key)
