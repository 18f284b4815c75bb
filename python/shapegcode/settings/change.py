"""Other values for some keys of settings that are loaded, checked as those of a file are."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, TypeVar

from shapegcode.errors import FileError, Problem
from shapegcode.settings.keys import InlineTable, TomlTable, toml
from shapegcode.settings.load import validated

__all__ = ["missing_row", "with_values"]

_Model = TypeVar("_Model", bound=TomlTable)
# A part of a dotted key: in quotes where it holds a dot itself.
_PART = re.compile(r'"([^"]*)"|([^."]+)')


def with_values(settings: _Model, values: Mapping[str, object], source: str, error: type[FileError]) -> _Model:
    """The settings with other values; what was a default stays one."""
    data = _plain(settings)
    for key, value in values.items():
        *tables, last = parts = _parts(key)
        place: Any = data
        held: Any = settings
        for rank, name in enumerate(parts):
            if wrong := _no_row(place, parts[:rank], name):
                raise error(source, (Problem(key, toml(value), wrong),))
            if rank < len(tables):
                held = _below(held, name)
                place = _entry(place, name, held)
        if isinstance(place, list):
            place[int(last) - 1] = value
        elif isinstance(place, dict) and value is None:
            place.pop(last, None)
        elif isinstance(place, dict):
            place[last] = value
        else:
            raise error(source, (Problem(key, toml(value), "no such key"),))
    return validated(type(settings), data, source, "", error)


def missing_row(settings: TomlTable, key: str) -> str:
    """Why a dotted key names no entry of a list: there it must be a number from 1 to as many as there are."""
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
    """What a file says of a value, in the dictionaries and lists of a TOML file."""
    if isinstance(value, TomlTable):
        fields = {name: getattr(value, name) for name in value.model_fields_set}
        return {name: _plain(held) for name, held in fields.items() if held is not None}
    if isinstance(value, Mapping):
        return {name: _plain(held) for name, held in value.items()}
    return [_plain(held) for held in value] if isinstance(value, list | tuple) else value


def _is_row(name: str, rows: list[Any] | tuple[Any, ...]) -> bool:
    return name.isdigit() and 0 < int(name) <= len(rows)


def _below(held: Any, name: str) -> Any:
    """What the loaded settings hold under a name, defaults as well; None where there is nothing."""
    if isinstance(held, Mapping):
        return held.get(name)
    if isinstance(held, list | tuple):
        return held[int(name) - 1] if _is_row(name, held) else None
    return getattr(held, name, None) if isinstance(held, TomlTable) else None


def _entry(place: Any, name: str, held: Any) -> Any:
    """A table of the file by its name, made where the file leaves it out; None where there can be none."""
    if isinstance(place, dict):
        # A value that is a table goes as a whole: its other keys must not be lost.
        whole = held is not None and (isinstance(held, InlineTable) or not isinstance(held, TomlTable))
        return place.setdefault(name, _plain(held) if whole else {})
    return place[int(name) - 1] if isinstance(place, list) else None
