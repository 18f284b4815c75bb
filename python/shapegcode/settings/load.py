"""Reading a TOML file of settings as its model: every problem at once, each with its line."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from shapegcode.errors import FileError, Problem
from shapegcode.io.data_file import MAX_SETTINGS_BYTES, read_file, toml_tables
from shapegcode.settings.keys import TomlTable
from shapegcode.settings.problems import problems_of, syntax_problem

_Model = TypeVar("_Model", bound=TomlTable)


def read_text(path: Path, error: type[FileError]) -> str:
    """The text of a file.

    Raises:
        FileError: the given kind of it: not UTF-8.
        OSError: the file cannot be read.
    """
    try:
        return read_file(path, MAX_SETTINGS_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as bad:
        line = bad.object[: bad.start].count(b"\n") + 1
        problem = Problem("", "", f"not UTF-8 text (byte 0x{bad.object[bad.start]:02x})", line)
        raise error(str(path), (problem,)) from bad


def parsed(text: str, source: str, error: type[FileError]) -> dict[str, Any]:
    """The tables of a TOML text; *source* names it in messages.

    Raises:
        FileError: the given kind of it: not TOML, or beyond the limits of `toml_tables`.
    """
    try:
        return toml_tables(text)
    except ValueError as bad:
        raise error(source, (syntax_problem(str(bad), text),)) from bad


def validated(model: type[_Model], data: dict[str, Any], source: str, text: str, error: type[FileError]) -> _Model:
    """The tables of a file as their model; *source* names it in messages, *text* gives them line numbers.

    Raises:
        FileError: the given kind of it: wrong keys or values; every problem is listed.
    """
    try:
        return model.model_validate(data)
    except ValidationError as bad:
        raise error(source, problems_of(bad, model, data, text)) from bad


def loaded(model: type[_Model], path: str | Path, error: type[FileError]) -> _Model:
    """A file as its model.

    Raises:
        FileError: the given kind of it: not TOML, or wrong keys or values; every problem is listed.
        OSError: the file cannot be read.
    """
    text = read_text(Path(path), error)
    return validated(model, parsed(text, str(path), error), str(path), text, error)
