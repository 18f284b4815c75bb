"""Serialiser of all JSON, and the schema of a result from its class: fields, and properties of `json_extra`.

Numbers have nine digits, unless `exact` or `json_exact`; below 1e-9 they are 0 in the units of `_COARSE_UNITS`.
Minus zero is 0; NaN and infinity are null.
"""

import dataclasses
import enum
import hashlib
import inspect
import io
import json
import math
import re
import types
import typing
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePath
from typing import Any, Self, cast

import numpy as np

from shapegcode.hints import Hinted, missing_attribute
from shapegcode.io.data_file import open_file

FORMAT = 1  # format of the JSON of results: increased when older files can no longer be read


@dataclass(frozen=True)
class ProvenanceFile:
    """A file that was read or written."""

    role: str  # purpose: "input", "machine", "output" and so on
    name: str  # as given
    sha256: str  # empty: it could not be read
    size_bytes: int  # its size

    @classmethod
    def of(cls, role: str, name: str | Path, content: bytes | memoryview | None = None) -> Self:
        """Make the entry of a file, or of content to be written."""
        if content is not None:
            return cls(role, str(name), hashlib.sha256(content).hexdigest(), len(content))
        try:
            return cls(role, str(name), *file_hash(name))
        except OSError:
            return cls(role, str(name), "", 0)


@dataclass(frozen=True)
class Provenance:
    """Command, version and files of a result."""

    result: str  # name of its class
    by: str  # "shapegcode" and its version
    format: int  # see `FORMAT`
    command: str  # as typed; of ``--program all`` the command for this program alone
    files: tuple[ProvenanceFile, ...]  # read and written

    def file(self, role: str) -> ProvenanceFile | None:
        """The file with a role."""
        return next((each for each in self.files if each.role == role), None)


def file_hash(name: str | Path) -> tuple[str, int]:
    """SHA-256 of a file, and its size."""
    with open_file(name) as stream:
        return hashlib.file_digest(cast(io.BufferedReader, stream), "sha256").hexdigest(), stream.tell()


@cache
def this_version() -> str:
    """ "shapegcode" and its version."""
    from importlib import metadata  # slow to load, and needed only where a file is written

    try:
        return f"shapegcode {metadata.version('shapegcode')}"
    except metadata.PackageNotFoundError:
        return "shapegcode (not installed)"


_DIGITS = 9
_NOTHING = 1e-9  # smaller values are round-off in the units below
_COARSE_UNITS = ("_um", "_mm", "_s", "_percent")


def hidden() -> dict[str, Any]:
    """Metadata of a field that is not in the JSON: ``field(metadata=hidden())``."""
    return {"hidden": True}


def exact() -> dict[str, Any]:
    """Metadata of a field whose numbers keep every digit: ``field(metadata=exact())``."""
    return {"exact": True}


def sparse() -> dict[str, Any]:
    """Metadata of a field whose key is left out if its value is None: ``field(default=None, metadata=sparse())``."""
    return {"sparse": True}


RENAMED: Mapping[str, Mapping[str, str]] = {
    "BatchRow": {"said": "answer"},
    "BudgetOutcome": {"given_up": "left_unchanged"},
    "CalibratedParameter": {"told": "is_determined", "had": "previous_value"},
    "CalibrationRun": {"left_out_s": "cross_validated_s", "left_out_percent": "cross_validated_percent"},
    "CaseVerdict": {"starved_ms": "underrun_ms"},
    "Conversion": {"rests_on": "parameter_sensitivity", "unmeasured_tried": "unverified_parameters_tested"},
    "CutOutcome": {"cure": "remedy"},
    "CycleTimeCalibration": {"not_told": "undetermined"},
    "FamilyScore": {"left_out_s": "cross_validated_s"},
    "MachineStudy": {"decides": "parameter_sensitivity"},
    "OpenValue": {"moved": "tested_value"},
    "RapidsOutcome": {"kept": "left_unchanged"},
    "Result": {"made": "provenance"},
    "Sensitivity": {"moved": "tested_value", "moved_um": "tested_um"},
}
"""Renamed JSON keys and fields by class: former and present names."""


@cache
def renamed_of(cls: type) -> Mapping[str, str]:
    """Former and present names of the fields of a class and its bases."""
    return {old: new for base in cls.__mro__ for old, new in RENAMED.get(base.__name__, {}).items()}


class OldNames(Hinted):
    """Base of classes with renamed fields: the former name gives the value, with a warning."""

    if not typing.TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Value of a renamed field."""
            new = renamed_of(type(self)).get(name)
            if new is None:
                raise missing_attribute(self, name)
            what = type(self).__name__
            warnings.warn(f"{what}.{name} is {what}.{new} now", FutureWarning, stacklevel=2)
            return getattr(self, new)


def current_keys(cls: type, data: Mapping[str, Any]) -> Mapping[str, Any]:
    """The JSON of an object with present keys; warns once of each former key."""
    old = {key: new for key, new in renamed_of(cls).items() if key in data and new not in data}
    for key, new in old.items():
        _warn_of_old_key(cls.__name__, key, new)
    return {old.get(key, key): value for key, value in data.items()} if old else data


@cache
def _warn_of_old_key(what: str, key: str, new: str) -> None:
    warnings.warn(f"JSON of the version before: key {key} of a {what} is {new} now", FutureWarning, stacklevel=2)


class Streamed(list[Any]):
    """Entries that are converted one by one, as `json.JSONEncoder.iterencode` asks for them."""

    def __init__(self, entries: Sequence[object]) -> None:
        super().__init__()
        self._entries = entries

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[Any]:
        """Entries converted by `plain`."""
        return map(plain, self._entries)


def plain(value: object) -> Any:
    """Convert a value to JSON types: objects, lists, strings, numbers, true, false, null."""
    return _plain(value, coarse=False, every_digit=False)


def _plain(value: object, *, coarse: bool, every_digit: bool) -> Any:
    def inner(entry: object, key: str = "", digits: bool = False) -> Any:
        return _plain(entry, coarse=coarse or key.endswith(_COARSE_UNITS), every_digit=every_digit or digits)

    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        found = {}
        for field in dataclasses.fields(value):
            held = getattr(value, field.name)
            if not (field.metadata.get("hidden") or (field.metadata.get("sparse") and held is None)):
                found[field.name] = inner(held, field.name, bool(field.metadata.get("exact")))
        exact_ones, extra = getattr(value, "json_exact", ()), getattr(value, "json_extra", ())
        return found | {name: inner(getattr(value, name), name, name in exact_ones) for name in extra}
    if isinstance(value, Mapping):
        return {str(key): inner(entry, str(key)) for key, entry in value.items()}
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, np.ndarray):
        return inner(value.tolist())
    if isinstance(value, np.generic):
        return inner(value.item())
    if isinstance(value, float):
        return _number(value, coarse=coarse, every_digit=every_digit)
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, Sequence | set | frozenset) and not isinstance(value, bytes):
        return [inner(entry) for entry in value]
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


def _number(value: float, *, coarse: bool, every_digit: bool) -> float | None:
    if not math.isfinite(value):
        return None
    if every_digit:
        return value + 0.0  # -0.0 becomes 0.0
    return 0.0 if coarse and abs(value) < _NOTHING else float(f"{value:.{_DIGITS}g}") + 0.0


def to_text(value: object) -> str:
    """Write a plain value as stable JSON: sorted keys, two spaces, one newline at the end."""
    return json.dumps(value, sort_keys=True, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


# --- the schema -------------------------------------------------------------------------------------------------------

_SIMPLE = {bool: "boolean", int: "integer", float: "number", str: "string", type(None): "null"}


def schema(result: type) -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of the output of `plain` for a dataclass, from its annotations and docstrings.

    Args:
        result: the class. If it has `json_extra` (names to types), the schema has these keys too, and three optional
            ones: `plots` and `output` (names of the files written), `provenance` (command, version and files).

    Returns:
        The schema.

    Raises:
        TypeError: an annotation that cannot be written as JSON.
    """
    definitions: dict[str, Any] = {}
    root = _object(result, {}, definitions, files=hasattr(result, "json_extra"))
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": result.__name__}
    return head | root | ({"$defs": dict(sorted(definitions.items()))} if definitions else {})


def _object(
    cls: Any, arguments: Mapping[Any, Any], definitions: dict[str, Any], *, files: bool = False
) -> dict[str, Any]:
    hints = typing.get_type_hints(cls)
    meanings = _meanings(cls)
    shown = {field.name: hints[field.name] for field in dataclasses.fields(cls) if not field.metadata.get("hidden")}
    shown |= getattr(cls, "json_extra", {})
    left_out = {field.name for field in dataclasses.fields(cls) if field.metadata.get("sparse")}
    written: dict[str, Any] = {"plots": tuple[str, ...], "output": str, "provenance": Provenance} if files else {}
    properties = {}
    for name, kind in (shown | written).items():
        meaning = {"description": meanings[name]} if name in meanings else {}
        properties[name] = _of(arguments.get(kind, kind), definitions) | meaning
    return {
        "type": "object",
        "description": (cls.__doc__ or "").strip().partition("\n")[0],
        "properties": properties,
        "required": sorted(shown.keys() - left_out),
        "additionalProperties": False,
    }


_FIELD = re.compile(r" {4}(\w+): .*?(?:  # (.*))?")


def _meanings(cls: type) -> dict[str, str]:
    """Descriptions of the fields of a class and its bases, from `Attributes:`, comments, and properties."""
    found: dict[str, str] = {}
    for name in getattr(cls, "json_extra", {}):
        member = getattr(cls, name, None)
        if isinstance(member, property) and member.__doc__:
            found[name] = member.__doc__.strip().partition("\n")[0]
    for base in reversed(cls.__mro__):
        lines = (base.__doc__ or "").splitlines()
        at = next((rank for rank, line in enumerate(lines) if line.strip() == "Attributes:"), len(lines))
        if at == len(lines) and dataclasses.is_dataclass(base):
            found |= _comments(base)
        name = ""
        for line in lines[at + 1 :]:
            if not line.strip():
                break
            head, colon, rest = line.strip().partition(": ")
            if line.startswith(" " * 8) and not line.startswith(" " * 9) and colon and head.isidentifier():
                name, found[head] = head, rest
            elif name:
                found[name] += " " + line.strip()
    return found


def _comments(cls: type) -> dict[str, str]:
    """Comments after the fields of a class in its source, or in the lines above them."""
    found: dict[str, str] = {}
    above: list[str] = []
    for line in inspect.getsource(cls).splitlines():
        if line.startswith("    # "):
            above.append(line[6:])
            continue
        if (field := _FIELD.fullmatch(line)) and (said := [*above, *filter(None, [field[2]])]):
            found[field[1]] = " ".join(said) + "."
        above = []
    return found


def _of(hint: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    if hint in (Any, object):
        return {}
    if hint in _SIMPLE:
        return {"type": _SIMPLE[hint]}
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (types.UnionType, typing.Union):
        return {"anyOf": [_of(each, definitions) for each in arguments]}
    if origin is typing.Literal:
        return {"enum": list(arguments)}
    cls = origin or hint
    if dataclasses.is_dataclass(cls) and isinstance(cls, type):
        bound = dict(zip(getattr(cls, "__parameters__", ()), arguments, strict=False))
        name = cls.__name__ + "".join(f"_{getattr(each, '__name__', 'of')}" for each in arguments)
        if name not in definitions:
            definitions[name] = {}
            definitions[name] = _object(cls, bound, definitions)
        return {"$ref": f"#/$defs/{name}"}
    if not isinstance(cls, type):
        raise TypeError(f"{hint} cannot be written as JSON")
    if issubclass(cls, np.ndarray):
        return {"type": "array"}
    if issubclass(cls, enum.Enum):
        return {"enum": [each.name for each in cls]}
    if cls is tuple and arguments[-1:] != (...,) and arguments:
        items = [_of(each, definitions) for each in arguments]
        return {"type": "array", "prefixItems": items, "minItems": len(items), "maxItems": len(items)}
    if issubclass(cls, Mapping):
        return {"type": "object", "additionalProperties": _of(arguments[1], definitions) if arguments else {}}
    if issubclass(cls, PurePath):
        return {"type": "string"}
    if issubclass(cls, Sequence | set | frozenset):
        return {"type": "array", **({"items": _of(arguments[0], definitions)} if arguments else {})}
    raise TypeError(f"{hint} cannot be written as JSON")
