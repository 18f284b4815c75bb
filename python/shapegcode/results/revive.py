"""Read results back from ``--json`` files: the inverse of `shapegcode.results.json.plain`, by the types of the fields.

Data that are not in the JSON (samples, programs) are missing: access raises an error that says so.
"""

import dataclasses
import enum
import importlib
import json
import math
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from shapegcode._core import ArgumentError
from shapegcode.io.data_file import DataFile
from shapegcode.results.json import FORMAT, Provenance, current_keys
from shapegcode.results.outcome import NotKeptError, Outcome
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table


class NotKept:
    """Placeholder for data that are not in the JSON."""

    def __init__(self, name: str) -> None:
        self._name = name

    def _refuse(self, *_: object) -> typing.NoReturn:
        raise NotKeptError(f"{self._name}: the JSON of a result does not contain it; run the command again")

    __bool__ = __call__ = __float__ = __getitem__ = __iter__ = __len__ = _refuse

    def __getattr__(self, attribute: str) -> typing.NoReturn:
        if attribute.startswith("__"):  # requested by Python itself, such as by copy
            raise AttributeError(attribute)
        self._refuse()

    def __repr__(self) -> str:
        return f"<{self._name}: not in the JSON>"


def written_reports(path: str | Path) -> list[dict[str, Any]]:
    """The JSON of the results in a file: one, or those of ``--program all``."""
    try:
        with DataFile(path, ArgumentError) as file:
            found = file.json(str(path), file.read(), partial(_no_number, path))
    except UnicodeDecodeError as error:
        raise ArgumentError(f"{path}: byte {error.start} is not UTF-8: not a JSON file of shapegcode") from None
    except json.JSONDecodeError as error:
        cut = error.pos >= len(error.doc.rstrip()) or "Unterminated" in error.msg
        why = f"the file ends in the middle ({len(error.doc)} characters): it was cut off" if cut else error.msg
        raise ArgumentError(f"{path}: line {error.lineno}, column {error.colno}: {why}") from None
    found = found if isinstance(found, list) else [found]
    if not found:
        raise ArgumentError(f"{path}: an empty list, without a result")
    for rank, each in enumerate(found, 1):
        if not isinstance(each, dict):
            where = f"entry {rank} of the list" if len(found) > 1 else "the file"
            raise ArgumentError(f"{path}: {where} is not an object: not a file of --json")
    return found


def _no_number(path: str | Path, word: str) -> typing.NoReturn:
    raise ArgumentError(f"{path}: {word} is not a number in JSON: not a file of --json")


def load_result(path: str | Path | Mapping[str, Any]) -> Result:
    """Read back a result that a command wrote with ``--json``, or that `json.dump` wrote from its `to_json()`.

    Args:
        path: path of the file, or its content, such as `to_json()` gives it.

    Returns:
        The result, with all data of its JSON.

    Raises:
        ArgumentError: truncated, not a JSON of a result, several results, or from an incompatible version.
        OSError: the file cannot be read.
    """
    if isinstance(path, Mapping):
        return revived(path)
    reports = written_reports(path)
    if len(reports) > 1:
        raise ArgumentError(f"{path}: contains {len(reports)} results (--program all), and one is needed")
    try:
        return revived(reports[0])
    except ArgumentError as error:
        raise ArgumentError(f"{path}: {error}") from None


def provenance_in(report: Mapping[str, Any]) -> Provenance:
    """Command, version and files of a result."""
    report = current_keys(Result, report)
    if "error" in report and "provenance" not in report:
        raise ArgumentError(f"the command failed for this program: {report['error']}")
    if "provenance" not in report:
        raise ArgumentError(
            "key provenance is missing: the JSON was written by an older version or by to_dict(); run the command "
            "again with --json, or use to_json()"
        )
    provenance: Provenance = _value(Provenance, report["provenance"], "provenance")
    if provenance.format != FORMAT:
        raise ArgumentError(
            f"provenance.format = {provenance.format}: written by {provenance.by}; this version reads format {FORMAT}"
        )
    return provenance


def revived(report: Mapping[str, Any], kept: Mapping[str, Any] = types.MappingProxyType({})) -> Result:
    """Restore a result from its JSON; *kept*: values of those fields that the JSON does not contain."""
    provenance = provenance_in(report)
    package = importlib.import_module("shapegcode")  # every kind of result is public
    cls = getattr(package, provenance.result) if provenance.result in package.__all__ else None
    if not (isinstance(cls, type) and issubclass(cls, Result)):
        raise ArgumentError(f"provenance.result = {provenance.result}: not a result known to this version")
    report = current_keys(cls, report)
    names = {field.name for field in dataclasses.fields(cls)}  # type: ignore[arg-type]
    beside = {*cls.json_extra, "provenance", "plots", "output", "program_address"}
    if unknown := sorted(report.keys() - names - beside):
        raise ArgumentError(f"key {unknown[0]} is not one of a {provenance.result}: written by {provenance.by}")
    hidden = {name: value for name, value in kept.items() if name in names | beside and value is not None}
    own = {key: value for key, value in report.items() if key in names}
    result: Result = _from_json(cls(**(dict(_fields(cls, own, "", {})) | hidden)))
    return result


def _value(hint: Any, data: Any, where: str, bound: Mapping[Any, Any] = types.MappingProxyType({})) -> Any:
    hint = bound.get(hint, hint)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if hint in (Any, object):
        return data
    if origin in (types.UnionType, typing.Union):
        return _first_that_fits(arguments, data, where, bound)
    if origin is typing.Literal:
        return data if data in arguments else _wrong(where, data, f"one of {', '.join(map(str, arguments))}")
    cls = origin or hint
    if cls in _NAMES:
        return _simple(cls, data, where)
    if dataclasses.is_dataclass(cls):
        return _object(cls, arguments, data, where, bound)
    if issubclass(cls, enum.Enum):
        return cls[data] if data in cls.__members__ else _wrong(where, data, f"one of {', '.join(cls.__members__)}")
    if issubclass(cls, PurePath):
        return cls(_simple(str, data, where))
    if issubclass(cls, Mapping):
        if not isinstance(data, dict):
            _wrong(where, data, "an object")
        inner = arguments[1] if arguments else Any
        return {key: _value(inner, entry, f"{where}.{key}", bound) for key, entry in data.items()}
    if not isinstance(data, list):
        _wrong(where, data, "a list")
    if issubclass(cls, np.ndarray):
        return np.array(data, dtype=np.float64)
    return _sequence(cls, arguments, data, where, bound)


def _simple(cls: type, data: Any, where: str) -> Any:
    if cls is float and data is None:
        return math.nan  # JSON has no NaN
    if cls is float and isinstance(data, int | float) and not isinstance(data, bool):
        return float(data)
    return data if type(data) is cls else _wrong(where, data, _NAMES[cls])


_NAMES = {bool: "true or false", int: "a whole number", float: "a number", str: "a text", type(None): "null"}


def _first_that_fits(kinds: Sequence[Any], data: Any, where: str, bound: Mapping[Any, Any]) -> Any:
    if data is None and type(None) in kinds:
        return None
    failed: list[ArgumentError] = []
    for kind in kinds:
        try:
            return _value(kind, data, where, bound)
        except ArgumentError as error:
            failed.append(error)
    raise failed[0]


def _sequence(cls: type, arguments: Sequence[Any], data: list[Any], where: str, bound: Mapping[Any, Any]) -> Any:
    if cls is tuple and arguments and arguments[-1:] != (...,):
        if len(data) != len(arguments):
            _wrong(where, data, f"a list of {len(arguments)}")
        kinds: Sequence[Any] = arguments
    else:
        kinds = [arguments[0] if arguments else Any] * len(data)
    found = [_value(kinds[rank], entry, f"{where}[{rank}]", bound) for rank, entry in enumerate(data)]
    return found if cls is list else frozenset(found) if issubclass(cls, set | frozenset) else tuple(found)


def _object(cls: Any, arguments: Sequence[Any], data: Any, where: str, bound: Mapping[Any, Any]) -> Any:
    if not isinstance(data, dict):
        _wrong(where, data, "an object")
    data = dict(current_keys(cls, data))
    own = dict(zip(getattr(cls, "__parameters__", ()), (bound.get(each, each) for each in arguments), strict=False))
    return _from_json(cls(**dict(_fields(cls, data, where, own))))


def _from_json(value: Any) -> Any:
    if isinstance(value, Outcome):
        object.__setattr__(value, "is_read_back", True)
    return value


def _fields(cls: Any, data: Mapping[str, Any], where: str, bound: Mapping[Any, Any]) -> Iterator[tuple[str, Any]]:
    kept = _from_properties(cls, data, where)
    hints = typing.get_type_hints(cls)
    for field in dataclasses.fields(cls):
        name = f"{where}.{field.name}" if where else field.name
        optional = field.default is not dataclasses.MISSING or field.default_factory is not dataclasses.MISSING
        if field.name in data and field.init:
            yield field.name, _value(hints[field.name], data[field.name], name, bound)
        elif field.name in kept:
            yield field.name, kept[field.name]
        elif optional or not field.init:
            continue
        elif field.metadata.get("hidden"):
            yield field.name, NotKept(name)
        else:
            raise ArgumentError(f"key {name} is missing")


def _from_properties(cls: Any, data: Mapping[str, Any], where: str) -> Mapping[str, Any]:
    """Compute fields missing in the JSON from properties in it, for classes with `hidden_from_json(data)`."""
    read = getattr(cls, "hidden_from_json", None)
    if read is None:
        return {}
    try:
        found: Mapping[str, Any] = read(data)
    except (KeyError, TypeError, ValueError) as error:
        raise ArgumentError(f"{where}: {error} is missing or wrong") from None
    return found


def _wrong(where: str, data: Any, wanted: str) -> typing.NoReturn:
    shown = json.dumps(data)
    shown = shown if len(shown) <= 40 else shown[:37] + "..."
    raise ArgumentError(f"{where} = {shown}: must be {wanted}")


@dataclass(frozen=True)
class ReportPage:
    """A page that was written."""

    source: str  # JSON from which it was made
    page: str  # file that was written
    result: str  # class of the result; empty: it could not be read back
    motion: bool  # the programs were found unchanged and simulated again
    problems: tuple[str, ...]  # also listed on the page


@dataclass(frozen=True, repr=False, eq=False)
class Reports(Result):
    """Pages of results that were written earlier.

    Attributes:
        pages: in the order of the files.
        warnings: problems of all pages, each with its file.
    """

    pages: tuple[ReportPage, ...]
    warnings: tuple[str, ...]

    @property
    def ok(self) -> bool:
        """True if every page shows its result without a problem."""
        return not self.warnings

    @property
    def answer(self) -> str:
        """Number of pages, and number of pages with a caution."""
        count = len(self.pages)
        sentence = f"{count} page{'s' if count > 1 else ''} written"
        bad = sum(bool(page.problems) for page in self.pages)
        return f"{sentence}, {bad} with a caution" if bad else sentence

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        if not self.ok:
            return "run the command of this result again: its new page has no caution."
        return f"open {self.pages[0].page} in a browser."

    def tables(self) -> list[Table]:
        """A table of the pages."""
        columns = (
            Column("result", left=True),
            Column("page", left=True),
            Column("motion", value=lambda page: "yes" if page.motion else "no"),
        )
        return [Table("", columns, self.pages)]
