"""Read a TOML settings file as its model: all problems at once, each with its line; change values by key."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from shapegcode.errors import FileError, Problem
from shapegcode.io.data_file import MAX_SETTINGS_BYTES, read_file, toml_tables
from shapegcode.settings.keys import InlineTable, TomlTable, facts, lines_of, table_type, toml, toml_key

MAX_PROBLEMS = 100
_LONGEST_NAME = 200  # for the comparison with known names
_KNOWN = "; known here: "


class KeyProblem(ValueError):
    """Raised by a validator for a key that contradicts another one; located in the file by its name."""

    def __init__(self, key: str, value: object, limit: str) -> None:
        self.key = key
        self.value = value
        self.limit = limit
        super().__init__(f"{key} = {toml(value)}: {limit}")


def syntax_problem(message: str, text: str) -> Problem:
    """Problem with line and column of a TOML syntax error, parsed from tomllib's message."""
    found = re.search(r"\s*\(at line (\d+), column (\d+)\)$", message)
    if found:
        return Problem("", "", f"{message[: found.start()]} (column {found[2]})", int(found[1]))
    last = text.rstrip().count("\n") + 1
    return Problem("", "", message.replace(" (at end of document)", " (end of file)"), last)


def problems_of(error: ValidationError, model: type[TomlTable], data: dict[str, Any], text: str) -> tuple[Problem, ...]:
    """Convert pydantic's errors to problems of the file: dotted keys, TOML values, limits with units."""
    problems: list[Problem] = []
    listed: set[str] = set()  # tables whose keys were listed with the first unknown one
    details = error.errors(include_url=False)
    for detail in details[:MAX_PROBLEMS]:
        location, value = _locate(detail["loc"], data, detail["type"])
        if detail["type"] == "too_short" and isinstance(value, list) and len(value) >= detail["ctx"]["min_length"]:
            continue  # pydantic does not count its bad items, each of which has its own error
        # A list counts from 0 in pydantic, from 1 for users.
        key = ".".join(str(part + 1) if isinstance(part, int) else toml_key(part) for part in location)
        limit = _limit(detail["type"], detail.get("ctx", {}), detail["msg"])
        cause = detail.get("ctx", {}).get("error")
        if isinstance(cause, KeyProblem):
            name = f"{key}.{cause.key}" if key else cause.key
            problem = Problem(name, _short(cause.value), cause.limit)
        elif detail["type"] == "extra_forbidden":
            suggestion = _suggestion(model, location)
            problem = Problem(key, _short(value), "unknown key" + ("" if suggestion in listed else suggestion))
            if suggestion.startswith(_KNOWN):
                listed.add(suggestion)
        elif detail["type"] == "value_error" and isinstance(value, dict):
            problem = Problem(key, "", limit)
        elif detail["type"] == "string_pattern_mismatch":
            field = field_of(model, location)
            problem = Problem(key, _short(value), f"malformed; {field.description if field else limit}")
        else:
            shown = "" if detail["type"] == "missing" else _short(value)
            problem = Problem(key, shown, limit + _unit_remark(model, location))
        problem = replace(problem, line=line_of(problem.key, text))
        if problem not in problems:
            problems.append(problem)
    return (*problems, *further_problems(len(details)))


def further_problems(count: int) -> tuple[Problem, ...]:
    """One problem that states how many more than `MAX_PROBLEMS` there are; empty if there are not more."""
    more = count - MAX_PROBLEMS
    return (Problem("", "", f"{more} further problems are not listed"),) if more > 0 else ()


_LIMITS = {
    "missing": "required, but missing",
    "greater_than": "must be greater than {gt}",
    "greater_than_equal": "must be {ge} or more",
    "less_than": "must be less than {lt}",
    "less_than_equal": "must be {le} or less",
    "finite_number": "must be a finite number",
    "float_type": "must be a number",
    **dict.fromkeys(("int_type", "int_from_float"), "must be a whole number"),
    "bool_type": "must be true or false",
    "string_type": "must be a text in quotes",
    "literal_error": "must be {expected}",
    **dict.fromkeys(("model_type", "model_attributes_type", "dict_type"), "must be a table"),
    "too_short": "must have {min_length} or more values",
    "too_long": "must have {max_length} or fewer values",
    **dict.fromkeys(("tuple_type", "list_type"), "must be a list"),
    "value_error": "{error}",
}
"""Rule for a value as text, by pydantic's kind of error."""


def _limit(kind: str, context: Mapping[str, Any], message: str) -> str:
    if kind not in _LIMITS:
        return message[:1].lower() + message[1:]
    numbers = {name: f"{context[name]:g}" for name in ("gt", "ge", "lt", "le") if abs(context.get(name, 1e9)) < 1e6}
    text = _LIMITS[kind].format_map({**context, **numbers})
    return text.replace("'", '"') if kind == "literal_error" else text


def _short(value: object) -> str:
    text = "{...}" if isinstance(value, dict) and value else toml(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _locate(location: tuple[int | str, ...], data: object, kind: str) -> tuple[tuple[int | str, ...], object]:
    """The part of a pydantic location that exists in the file, and the value there."""
    value = data
    for depth, part in enumerate(location):
        in_table = isinstance(value, dict) and part in value
        in_list = isinstance(value, list) and isinstance(part, int) and part < len(value)
        if in_table or in_list:
            value = value[part]  # type: ignore[index]
        elif kind == "missing" and isinstance(value, dict | list):
            return location, None
        else:
            return location[:depth], value
    return location, value


def field_of(root: type[TomlTable], location: Sequence[int | str]) -> FieldInfo | None:
    """The field of a model at a location, None if there is none."""
    model: type[BaseModel] | None = root
    field: FieldInfo | None = None
    for part in location:
        if isinstance(part, int):
            continue
        if model is None or part not in model.model_fields:
            return field if model is None else None
        field = model.model_fields[part]
        model = table_type(field)
    return field


def _unit_remark(root: type[TomlTable], location: tuple[int | str, ...]) -> str:
    # The keys x, y, z of a PerAxis have the unit of the parent key.
    unit = facts(field_of(root, location)).get("unit") or facts(field_of(root, location[:-1])).get("unit")
    return f" (unit: {unit})" if unit and unit != "1" else ""


def _suggestion(root: type[TomlTable], location: tuple[int | str, ...]) -> str:
    """Hint with the known key most similar to an unknown one, or with all known ones."""
    parent = tuple(part for part in location[:-1] if not isinstance(part, int))
    field = field_of(root, parent)
    model = root if not parent else table_type(field) if field is not None else None
    if model is None:
        return ""
    name = str(location[-1])[:_LONGEST_NAME]
    tables = root.model_fields.items() if len(location) == 1 else ()
    if homes := [f"{table}.{name}" for table, each in tables if name in getattr(table_type(each), "model_fields", ())]:
        return f"; did you mean {homes[0]}?"
    close = difflib.get_close_matches(name, model.model_fields, n=1, cutoff=0.5)
    return f"; did you mean {close[0]}?" if close else f"{_KNOWN}{', '.join(model.model_fields)}"


@lru_cache(maxsize=1)  # used for every problem of a file
def _first_lines(text: str) -> dict[tuple[str, str], int]:
    found: dict[tuple[str, str], int] = {}
    for number, (_, line) in enumerate(lines_of(text), start=1):
        if line is not None:
            found.setdefault((line.kind, line.key), number)
    return found


def line_of(key: str, text: str) -> int | None:
    """Line of a dotted key in a text of the plain layout ``[table]`` / ``key = value``; None if not found."""
    lines, parts = _first_lines(text), key.split(".")
    names = [("key", ".".join(parts[:count])) for count in range(1, len(parts) + 1)]
    return min((lines[name] for name in (*names, ("table", key)) if name in lines), default=None)


_Model = TypeVar("_Model", bound=TomlTable)


def read_text(path: Path, error: type[FileError]) -> str:
    """The text of a file."""
    try:
        return read_file(path, MAX_SETTINGS_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as bad:
        line = bad.object[: bad.start].count(b"\n") + 1
        problem = Problem("", "", f"not UTF-8 text (byte 0x{bad.object[bad.start]:02x})", line)
        raise error(str(path), (problem,)) from bad


def parsed(text: str, source: str, error: type[FileError]) -> dict[str, Any]:
    """The tables of a TOML text; *source* names it in messages."""
    try:
        return toml_tables(text)
    except ValueError as bad:
        raise error(source, (syntax_problem(str(bad), text),)) from bad


def validated(model: type[_Model], data: dict[str, Any], source: str, text: str, error: type[FileError]) -> _Model:
    """Validate the tables of a file as a model; *source* names it in messages, *text* is for line numbers."""
    try:
        return model.model_validate(data)
    except ValidationError as bad:
        raise error(source, problems_of(bad, model, data, text)) from bad


def loaded(model: type[_Model], path: str | Path, error: type[FileError]) -> _Model:
    """Parse a file into its model."""
    text = read_text(Path(path), error)
    return validated(model, parsed(text, str(path), error), str(path), text, error)


# --- values changed by their dotted keys ------------------------------------------------------------------------------

# A part of a dotted key: quoted if it contains a dot.
_PART = re.compile(r'"([^"]*)"|([^."]+)')


def with_values(settings: _Model, values: Mapping[str, object], source: str, error: type[FileError]) -> _Model:
    """Copy the settings with other values; defaults stay defaults."""
    data = _plain(settings)
    for key, value in values.items():
        *tables, last = parts = _parts(key)
        table: Any = data
        held: Any = settings
        for rank, name in enumerate(parts):
            if wrong := _no_row(table, parts[:rank], name):
                raise error(source, (Problem(key, toml(value), wrong),))
            if rank < len(tables):
                held = _below(held, name)
                table = _entry(table, name, held)
        if isinstance(table, list):
            table[int(last) - 1] = value
        elif isinstance(table, dict) and value is None:
            table.pop(last, None)
        elif isinstance(table, dict):
            table[last] = value
        else:
            raise error(source, (Problem(key, toml(value), "no such key"),))
    return validated(type(settings), data, source, "", error)


def missing_row(settings: TomlTable, key: str) -> str:
    """Problem of a dotted key with a list index, from 1, that does not exist; empty: no problem."""
    held: Any = settings
    parts = _parts(key)
    for rank, name in enumerate(parts):
        if wrong := _no_row(held, parts[:rank], name):
            return wrong
        held = _below(held, name)
    return ""


def _no_row(held: Any, above: list[str], name: str) -> str:
    if not isinstance(held, list | tuple) or _is_row(name, held):
        return ""
    there = f"there {'is' if len(held) == 1 else 'are'} {len(held)}" if held else "there is none"
    return f"no such key: {'.'.join(above)} counts from 1, and {there}"


def _parts(key: str) -> list[str]:
    return [quoted or bare for quoted, bare in _PART.findall(key)] or [key]


def _plain(value: Any) -> Any:
    """Contents of a value in a file, as dictionaries and lists of TOML."""
    if isinstance(value, TomlTable):
        fields = {name: getattr(value, name) for name in value.model_fields_set}
        return {name: _plain(held) for name, held in fields.items() if held is not None}
    if isinstance(value, Mapping):
        return {name: _plain(held) for name, held in value.items()}
    return [_plain(held) for held in value] if isinstance(value, list | tuple) else value


def _is_row(name: str, rows: list[Any] | tuple[Any, ...]) -> bool:
    return name.isdigit() and 0 < int(name) <= len(rows)


def _below(held: Any, name: str) -> Any:
    """Value of the loaded settings under a name, with defaults; None if there is none."""
    if isinstance(held, Mapping):
        return held.get(name)
    if isinstance(held, list | tuple):
        return held[int(name) - 1] if _is_row(name, held) else None
    return getattr(held, name, None) if isinstance(held, TomlTable) else None


def _entry(table: Any, name: str, held: Any) -> Any:
    """A table of the file by its name, created if missing; None if there cannot be one."""
    if isinstance(table, dict):
        # A value that is a table is copied as a whole, to keep its other keys.
        whole = held is not None and (isinstance(held, InlineTable) or not isinstance(held, TomlTable))
        return table.setdefault(name, _plain(held) if whole else {})
    return table[int(name) - 1] if isinstance(table, list) else None
