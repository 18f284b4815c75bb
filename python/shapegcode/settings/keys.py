"""Building blocks of the machine file: types of values, fields with their metadata, TOML notation; and
origins of values in the table ``[origin]``, where each text begins with a keyword.

    [origin]
    axes.x.modes.1.frequency_hz = "measured, 95 %: 46.1 ... 46.3"
    controller.time_constant_s = "parameters: FANUC 1622, 1610"
    controller.block_time_s = "inherited: from VX500: paper 000"

Or at the value: ``frequency_hz = { value = 46.2, origin = "measured" }``. Comments are ignored;
only in older files without either form the first words of the comments are used.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, Strict, ValidationError
from pydantic.fields import FieldInfo

from shapegcode._core import ArgumentError
from shapegcode.hints import HintedClass, guess, missing_attribute

Origin = Literal["measured", "dump", "inherited", "assumed", "choice", "file", "default"]
"""Origin of a value: measured on this machine; read from the control's dump; inherited from another machine; assumed; a
choice, not a machine property; set in the file without an origin; not in the file."""

DEFAULT = "default"  # remark of a default that was written into a file
ORIGIN = "origin"  # name of the table, and of the key next to an inline value
ORIGIN_WORDS: dict[Origin, str] = {
    "measured": "measured", "dump": "parameters", "inherited": "inherited", "assumed": "assumed", "choice": "choice",
    "default": "default", "file": "stated",
}  # fmt: skip
ORIGIN_TEXT = rf"^({'|'.join(ORIGIN_WORDS.values())})($|: .|, .| \(.)"
"""Start of the text of an origin; a note may follow."""

_BEGINNINGS: tuple[tuple[str, Origin], ...] = (
    (r"measured\b(?!\?)|95 %:|half of the 95 %", "measured"),
    (r"parameters\b|FANUC \S", "dump"),
    (r"inherited\b|from \S", "inherited"),
    (r"assumed\b|guess|estimate|measured\?|not known|not measured|.*\b(?:not measured|is assumed)$", "assumed"),
    (r"choice\b", "choice"),
    (r"default\b", "default"),
)

_HEADER = re.compile(r"\s*(\[{1,2})\s*([^\[\]]+?)\s*\]{1,2}\s*(?:#\s*(.*))?")
_KEY = re.compile(r'\s*([A-Za-z0-9_.-]+|"[^"]*")\s*=')
_UNSET = re.compile(r"\s*#\s*([A-Za-z0-9_-]+)\s*=\s*\.\.\.\s*(?:#\s*(.*))?")
_UNSET_LIST = re.compile(r"\s*#\s*\[\[\s*([^\[\]]+?)\s*\]\]\s*(?:#\s*(.*))?")
_VALUE = re.compile(r"(?:\"(?:[^\"\\]|\\.)*\"|'[^']*'|[^#\"'])*")


def origin_of(remark: str) -> Origin:
    """Origin of a value, from its remark."""
    return next((origin for begins, origin in _BEGINNINGS if re.match(begins, remark)), "file")


def inherited(name: str, remark: str) -> str:
    """Remark of a value inherited from another machine."""
    if origin_of(remark) in ("assumed", "choice", "inherited", "default"):
        return remark
    return f"from {name}: {remark}" if remark else f"from {name}"


@dataclass(frozen=True)
class KeyLine:
    """A line with the heading of a table, a key, or a key that is not set: a comment ``# name = ...``."""

    kind: Literal["table", "key", "unset"]
    key: str  # dotted name
    end: int = 0  # start of its remark
    remark: str = ""


def take_origins(data: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """Split the tables of a file into values and origins (None: no origins); two origins of a value become a list."""
    found: dict[str, Any] = {}
    inline: dict[str, Any] = {}
    plain = {name: _plain(value, name, inline) for name, value in data.items() if name != ORIGIN}
    if ORIGIN in data:
        _flatten(data[ORIGIN], "", found)
    for key, origin in inline.items():
        _note(key, origin, found)
    return plain, found if ORIGIN in data or inline else None


def _plain(value: Any, key: str, inline: dict[str, Any]) -> Any:
    if isinstance(value, list):
        return [_plain(each, f"{key}.{number}", inline) for number, each in enumerate(value, start=1)]
    if not isinstance(value, Mapping):
        return value
    if value.keys() == {"value", ORIGIN}:
        inline[key] = value[ORIGIN]
        return value["value"]
    return {name: _plain(each, f"{key}.{name}", inline) for name, each in value.items()}


def _flatten(value: Any, key: str, found: dict[str, Any]) -> None:
    if not isinstance(value, Mapping):
        _note(key or ORIGIN, value, found)
        return
    for name, each in value.items():
        _flatten(each, f"{key}.{name}" if key else name, found)


def _note(key: str, origin: Any, found: dict[str, Any]) -> None:
    found[key] = [found[key], origin] if key in found else origin


def remark_of(stated: str) -> str:
    """Remark for an origin such as "assumed: note"; only the note, if the note alone gives the same origin."""
    word, _, note = stated.partition(": ")
    return note if note and origin_of(note) == origin_of(word) else stated


def remarks_of(text: str) -> dict[str, str]:
    """Origins of the values of a file."""
    stated = take_origins(tomllib.loads(text))[1]
    return remarks_in_comments(text) if stated is None else {key: remark_of(origin) for key, origin in stated.items()}


def remarks_in_comments(text: str) -> dict[str, str]:
    """The comments after values, by key: the remarks of a file without `[origin]`."""
    return {line.key: line.remark for _, line in lines_of(text) if line and line.remark}


def lines_of(text: str) -> Iterator[tuple[str, KeyLine | None]]:
    """Yield every line, line end included, with its table or key; None for other lines."""
    table, counts, inside = "", dict[str, int](), 0
    texts = _lines_of_long_texts(text)
    for number, raw in enumerate(text.splitlines(keepends=True)):
        line = raw.rstrip("\r\n")
        if number in texts or inside:
            inside += 0 if number in texts else open_brackets(line)
            yield raw, None
        elif header := _HEADER.fullmatch(line):
            table = re.sub(r"\s*\.\s*", ".", header[2])
            if header[1] == "[[":
                counts[table] = counts.get(table, 0) + 1
                table = f"{table}.{counts[table]}"
            yield raw, KeyLine("table", table)
        elif (found := _UNSET_LIST.fullmatch(line)) or (found := _UNSET.fullmatch(line)):
            listed = "[[" in line.partition("=")[0]
            key = found[1] if listed or not table else f"{table}.{found[1]}"
            end_of = len(line) if found[2] is None else line.rindex("#", 0, found.start(2))
            yield raw, KeyLine("unset", key, end_of, (found[2] or "").strip())
        elif found := _KEY.match(line):
            key = f"{table}.{found[1]}" if table else found[1]
            end = _VALUE.match(line, found.end())
            assert end is not None
            inside = open_brackets(line[found.end() :])
            yield raw, KeyLine("key", key, end.end(), line[end.end() :].lstrip("# ").rstrip())
        else:
            yield raw, None


_TEXT = re.compile(r"""(\"{3}(?:\\.|[^\\])*?\"{3,5}|'{3}.*?'{3,5})|"(?:\\.|[^"\\\n])*"|'[^'\n]*'|#[^\n]*""", re.DOTALL)


def _lines_of_long_texts(text: str) -> set[int]:
    """Lines, from 0, of triple-quoted strings, which contain no keys or comments."""
    found: set[int] = set()
    for match in _TEXT.finditer(text):
        if match[1]:
            first = text.count("\n", 0, match.start())
            found.update(range(first, first + match[0].count("\n") + 1))
    return found


def open_brackets(line: str) -> int:
    """Number of opened minus closed brackets in a line, outside of strings and comments."""
    bare = re.sub(r'"(?:[^"\\]|\\.)*"|\'[^\']*\'|#.*', "", line)
    return bare.count("[") - bare.count("]")


# Numbers are strict: a string or a boolean instead of a number is an error; 3 for 3.0 is not.
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
"""Unit of a key by the ending of its name; the longest match counts."""


_KNOWN = object()


def key(meaning: str, *, unit: str = "", fanuc: str = "", assumed: Any = _KNOWN, **field: Any) -> Any:
    """A pydantic field with the documentation of a key; *unit*: needed unless the name of the key ends in it.

    *assumed*: a default that is an assumption, instead of ``default``; without both the key is mandatory.
    """
    if assumed is not _KNOWN:
        field["default"] = assumed
    noted: dict[str, Any] = {"unit": unit, "fanuc": fanuc, "assumed": assumed is not _KNOWN}
    return Field(description=meaning, json_schema_extra=noted, **field)


if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)


def _own(names: Iterable[str]) -> list[str]:
    """Names without Pydantic's."""
    return sorted({*names} - {*type.__dir__(BaseModel)})


class _Table(HintedClass, ModelMetaclass):
    def __call__(cls, *args: Any, **values: Any) -> Any:
        """Make a table in Python; wrong values are refused in one line."""
        if args and "__new__" not in vars(cls):
            raise ArgumentError(f"{cls.__name__}: only keywords are taken{guess('()', cls.__name__)}")
        try:
            return super().__call__(*args, **values)
        except ValidationError as error:
            wrong = [f"{'.'.join(map(str, each['loc']))}: {each['msg']}" for each in error.errors()]
            raise ArgumentError(f"{cls.__name__}: {'; '.join(wrong)}{guess('()', cls.__name__)}") from None

    def __dir__(cls) -> list[str]:
        return _own(super().__dir__())


class TomlTable(BaseModel, metaclass=_Table):
    """Base of every table of the file: unknown keys are errors and values never change after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        """Set the units from the names of the keys."""
        for name, field in cls.model_fields.items():
            noted = field.json_schema_extra
            if isinstance(noted, dict) and noted.get("unit") == "":
                noted["unit"] = _UNITS[max((end for end in _UNITS if name.endswith(end)), key=len, default="")]

    def __dir__(self) -> list[str]:
        return _own(super().__dir__())

    def __getattr__(self, name: str) -> Any:
        """Refuse an attribute that the table does not have, with a hint."""
        try:
            return super().__getattr__(name)  # type: ignore[misc]
        except AttributeError:
            raise missing_attribute(self, name) from None

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse to set a key, and name the alternative."""
        if not name.startswith("_"):
            raise AttributeError(
                f"{type(self).__name__}.{name} cannot be set: values never change; "
                f"machine.with_values({{'...{name}': value}}) returns a machine with another one"
            )
        super().__setattr__(name, value)


class InlineTable(TomlTable):
    """A table written in one line, as the value of a key."""


class PerAxis(InlineTable):
    """One value per axis. A single number in a machine file applies to all three."""

    x: NonNegative = key("value of the X axis")
    y: NonNegative = key("value of the Y axis")
    z: NonNegative = key("value of the Z axis")

    def as_tuple(self) -> tuple[float, float, float]:
        """The three values in the order X, Y, Z."""
        return (self.x, self.y, self.z)


def _spread(value: object) -> object:
    """Apply a single number to all three axes; a table must contain all three."""
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
class KeyValue:
    """One value of loaded settings, with the documentation of its key."""

    key: str  # dotted name, ``axes.x.modes.1.frequency_hz``
    value: str  # the value as TOML, "not set" for an optional key without one
    unit: str  # unit, "1" for a ratio, empty if there is none
    # its origin: "measured" on this machine, "dump" of the control's parameters, "inherited" from another
    # machine, "assumed", "choice" (no property of a machine), "file" (set in the file without an origin),
    # "default" (not in the file)
    origin: Origin
    assumed: bool  # True if the value is an assumption, in the file or as a default
    meaning: str  # its meaning
    fanuc: str  # numbers of the FANUC parameters that correspond to it, or empty
    remark: str = ""  # text of its origin in the file

    @property
    def unmeasured(self) -> bool:
        """True if it is unverified: assumed or inherited."""
        return self.assumed or self.origin == "inherited"


def facts(field: FieldInfo | None) -> dict[str, Any]:
    """Metadata that the function `key` gave to a field; empty without."""
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


def values_of(
    table: TomlTable, prefix: str = "", given: bool = True, remarks: Mapping[str, str] | None = None
) -> Iterator[KeyValue]:
    """Every key below a table with its value and origin, in the order in which the keys are defined."""
    for name, field in type(table).model_fields.items():
        value, key = getattr(table, name), f"{prefix}{name}"
        from_file = given and name in table.model_fields_set
        if isinstance(value, TomlTable) and not isinstance(value, InlineTable):
            yield from values_of(value, f"{key}.", from_file, remarks)
        elif item_type(field) and value:
            for number, item in enumerate(value, start=1):
                yield from values_of(item, f"{key}.{number}.", from_file, remarks)
        else:
            noted = facts(field)
            remark = (remarks or {}).get(key, "")
            # A key without a value can have a remark with the reason: "assumed: not limited", "not measured: rigid".
            says_why = not value and (value is not None or remark.startswith("assumed"))
            origin = origin_of(remark) if from_file or (remark and says_why) else "default"
            assumed = origin == "assumed" or (noted["assumed"] and origin == "default")
            shown = "not set" if value is None else toml(value)
            yield KeyValue(key, shown, noted["unit"], origin, assumed, field.description or "", noted["fanuc"], remark)


def toml(value: object) -> str:
    """A value in TOML notation."""
    if isinstance(value, PerAxis):
        return toml(value.x if value.x == value.y == value.z else dict(value))
    if isinstance(value, InlineTable):
        return toml({name: item for name, item in value if item is not None})
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        is_whole = math.isfinite(value) and value == int(value) and abs(value) < 1e15
        return f"{value:.1f}" if is_whole else repr(value)
    if isinstance(value, str):
        # JSON strings are TOML basic strings, except that TOML requires DEL to be escaped.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml(item) for item in value) + "]"
    if isinstance(value, dict):
        items = ", ".join(f"{toml_key(key)} = {toml(item)}" for key, item in value.items())
        return f"{{ {items} }}" if value else "{}"
    return str(value)


def toml_key(key: str) -> str:
    """A key in TOML notation, quoted if necessary."""
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key)
