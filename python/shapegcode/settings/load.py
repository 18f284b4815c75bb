"""Reading a TOML file of settings as its model: every problem at once, each with its line."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from shapegcode.errors import FileError, Problem
from shapegcode.io.data_file import MAX_SETTINGS_BYTES, read_file, toml_tables
from shapegcode.settings.keys import TomlTable, facts, table_type, toml, toml_key
from shapegcode.settings.remarks import open_brackets

MAX_PROBLEMS = 100
_LONGEST_NAME = 200  # that is compared with known ones


class KeyProblem(ValueError):
    """What a validator raises of a key that does not fit another one: found again in the file by its name."""

    def __init__(self, key: str, value: object, limit: str) -> None:
        self.key = key
        self.value = value
        self.limit = limit
        super().__init__(f"{key} = {toml(value)}: {limit}")


def syntax_problem(message: str, text: str) -> Problem:
    """Line and column of a TOML syntax error, read from tomllib's message."""
    found = re.search(r"\s*\(at line (\d+), column (\d+)\)$", message)
    if found:
        return Problem("", "", f"{message[: found.start()]} (column {found[2]})", int(found[1]))
    last = text.rstrip().count("\n") + 1
    return Problem("", "", message.replace(" (at end of document)", " (end of file)"), last)


def problems_of(error: ValidationError, model: type[TomlTable], data: dict[str, Any], text: str) -> tuple[Problem, ...]:
    """Pydantic's errors as problems of the file: dotted keys, TOML values, limits with units."""
    problems: list[Problem] = []
    details = error.errors(include_url=False)
    for detail in details[:MAX_PROBLEMS]:
        location, value = _locate(detail["loc"], data, detail["type"])
        if detail["type"] == "too_short" and isinstance(value, list) and len(value) >= detail["ctx"]["min_length"]:
            continue  # short only of its bad items, which are listed themselves
        # A list counts from 0 in pydantic, from 1 for people.
        key = ".".join(str(part + 1) if isinstance(part, int) else toml_key(part) for part in location)
        limit = _limit(detail["type"], detail.get("ctx", {}), detail["msg"])
        cause = detail.get("ctx", {}).get("error")
        if isinstance(cause, KeyProblem):
            name = f"{key}.{cause.key}" if key else cause.key
            problem = Problem(name, _short(cause.value), cause.limit)
        elif detail["type"] == "extra_forbidden":
            problem = Problem(key, _short(value), "unknown key" + _suggestion(model, location))
        elif detail["type"] == "missing":
            problem = Problem(key, "", limit + _unit_remark(model, location))
        elif detail["type"] == "value_error" and isinstance(value, dict):
            problem = Problem(key, "", limit)
        elif detail["type"] == "string_pattern_mismatch":
            field = _field(model, location)
            problem = Problem(key, _short(value), f"malformed; {field.description if field else limit}")
        else:
            problem = Problem(key, _short(value), limit + _unit_remark(model, location))
        problem = Problem(problem.key, problem.value, problem.limit, line_of(problem.key, text))
        if problem not in problems:
            problems.append(problem)
    return (*problems, *further_problems(len(details)))


def further_problems(count: int) -> tuple[Problem, ...]:
    """Note that there are more than `MAX_PROBLEMS` problems; finding the line of each takes time."""
    more = count - MAX_PROBLEMS
    return (Problem("", "", f"{more} further problems are not listed"),) if more > 0 else ()


def _number(limit: float) -> str:
    return f"{limit:g}" if abs(limit) < 1e6 else str(limit)


def _limit(kind: str, context: Mapping[str, Any], message: str) -> str:
    """What a value must be, in words, from pydantic's description of the error."""
    match kind:
        case "missing":
            return "required, but missing"
        case "greater_than":
            return f"must be greater than {_number(context['gt'])}"
        case "greater_than_equal":
            return f"must be {_number(context['ge'])} or more"
        case "less_than":
            return f"must be less than {_number(context['lt'])}"
        case "less_than_equal":
            return f"must be {_number(context['le'])} or less"
        case "finite_number":
            return "must be a finite number"
        case "float_type":
            return "must be a number"
        case "int_type" | "int_from_float":
            return "must be a whole number"
        case "bool_type":
            return "must be true or false"
        case "string_type":
            return "must be a text in quotes"
        case "literal_error":
            return f"must be {context['expected']}".replace("'", '"')
        case "model_type" | "model_attributes_type" | "dict_type":
            return "must be a table"
        case "too_short":
            return f"must have {context['min_length']} or more values"
        case "too_long":
            return f"must have {context['max_length']} or fewer values"
        case "tuple_type" | "list_type":
            return "must be a list"
        case "value_error":
            return str(context["error"])
        case _:
            return message[:1].lower() + message[1:]


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


def _field(root: type[TomlTable], location: tuple[int | str, ...]) -> FieldInfo | None:
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
    # The keys x, y, z of a PerAxis have the unit of the key above them.
    unit = facts(_field(root, location)).get("unit") or facts(_field(root, location[:-1])).get("unit")
    return f" (unit: {unit})" if unit and unit != "1" else ""


def _suggestion(root: type[TomlTable], location: tuple[int | str, ...]) -> str:
    """The known key that an unknown one most likely stands for."""
    parent = [part for part in location[:-1] if not isinstance(part, int)]
    model: type[BaseModel] | None = root
    for part in parent:
        field = model.model_fields.get(part) if model is not None else None
        model = table_type(field) if field is not None else None
    if model is None:
        return ""
    name = str(location[-1])[:_LONGEST_NAME]
    close = difflib.get_close_matches(name, model.model_fields, n=1, cutoff=0.5)
    if close:
        return f"; did you mean {close[0]}?"
    return f"; known here: {', '.join(model.model_fields)}"


_HEADER = re.compile(r"\s*\[{1,2}\s*([^\[\]]+?)\s*\]{1,2}\s*(?:#.*)?")


def line_of(key: str, text: str) -> int | None:
    """Line of a dotted key in a text of the plain layout ``[table]`` / ``key = value``; None if not found there."""
    table, counts = "", dict[str, int]()
    inside = 0  # depth of the brackets of a list that goes over several lines
    for number, line in enumerate(text.splitlines(), start=1):
        if inside:
            inside += open_brackets(line)
            continue
        header = _HEADER.fullmatch(line)
        if header:
            table = re.sub(r"\s*\.\s*", ".", header[1])
            if line.lstrip().startswith("[["):
                counts[table] = counts.get(table, 0) + 1
                table = f"{table}.{counts[table]}"
            if table == key:
                return number
            continue
        assignment = re.match(r'\s*([A-Za-z0-9_.-]+|"[^"]*")\s*=', line)
        if assignment:
            name = f"{table}.{assignment[1]}" if table else assignment[1]
            if key == name or key.startswith(name + "."):
                return number
            inside = open_brackets(line[assignment.end() :])
    return None


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
    """The tables of a file as their model; *source* names it in messages, *text* gives them line numbers."""
    try:
        return model.model_validate(data)
    except ValidationError as bad:
        raise error(source, problems_of(bad, model, data, text)) from bad


def loaded(model: type[_Model], path: str | Path, error: type[FileError]) -> _Model:
    """A file as its model."""
    text = read_text(Path(path), error)
    return validated(model, parsed(text, str(path), error), str(path), text, error)
