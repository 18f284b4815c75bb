"""A TOML file edited with tomlkit: some entries change, the rest stays byte for byte.

The entries of a table are the list ``table.value.body``: keys with their items, comments, blank lines. It is edited in
place; then the document is rendered. Whoever edits reads the result again and compares it with what was meant.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, TypeVar

import tomlkit
from tomlkit.items import AoT, Comment, Item, Key, Table, Whitespace

from shapegcode.errors import ArgumentError, FileError, Problem
from shapegcode.settings.keys import InlineTable, TomlTable, toml
from shapegcode.settings.load import validated

Entry = tuple[Key | None, Item]

_COMMENTED_KEY = re.compile(r"#\s*([A-Za-z0-9_-]+)\s*=\s*\.\.\.")
_COMMENTED_TABLE = re.compile(r"#\s*\[\[\s*([^\[\]]+?)\s*\]\]")


def parse_exactly(text: str, file: str) -> tomlkit.TOMLDocument:
    """A TOML file that can be edited so that the rest of it stays byte for byte."""
    document = tomlkit.parse(text)
    rendered = document.as_string()
    if rendered == text:
        return document
    lines = zip(text.splitlines(), rendered.splitlines(), strict=False)
    number, (line, other) = next((n, pair) for n, pair in enumerate(lines, start=1) if pair[0] != pair[1])
    raise ArgumentError(f"{file}:{number}: {line.strip()!r} cannot be kept as it is: write it as {other.strip()!r}")


def entry_of(line: str) -> Entry:
    """A line with a key as an entry, its comment and line end included."""
    return tomlkit.parse(line).body[0]


def commented_key(entry: Entry) -> str:
    """The name in a comment ``# name = ...``, which stands for a key that is left out; empty for everything else."""
    return _said(entry, _COMMENTED_KEY)


def commented_table(entry: Entry) -> str:
    """The name in a comment ``# [[name]]``, which stands for a list without tables; empty for everything else."""
    return _said(entry, _COMMENTED_TABLE)


def _said(entry: Entry, pattern: re.Pattern[str]) -> str:
    match = pattern.match(entry[1].trivia.comment) if isinstance(entry[1], Comment) else None
    return match[1] if match else ""


def own_end(entries: list[Entry]) -> int:
    """One behind the last key, and behind the commented keys that follow it at once: what is there is of others."""
    end = max((place + 1 for place, (key, _) in enumerate(entries) if key is not None), default=0)
    for place in range(end, len(entries)):
        if not isinstance(entries[place][1], Comment) or commented_table(entries[place]):
            break
        if commented_key(entries[place]):
            end = place + 1
    return end


def take_tail(table: Table) -> list[Entry]:
    """Take away what stands behind the last key of a table and of the tables in it: it is of what follows."""
    entries = table.value.body
    last = next((item for key, item in reversed(entries) if key is not None), None)
    if isinstance(last, AoT):
        return take_tail(last.body[-1]) + _cut(entries)
    if isinstance(last, Table):
        return take_tail(last) + _cut(entries)
    return _cut(entries)


def _cut(entries: list[Entry]) -> list[Entry]:
    end = own_end(entries)
    tail = entries[end:]
    del entries[end:]
    return tail


def is_blank(entry: Entry) -> bool:
    """Whether it is a blank line."""
    return isinstance(entry[1], Whitespace)


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
