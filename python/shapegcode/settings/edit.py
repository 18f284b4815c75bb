"""A TOML file edited with tomlkit: some entries change, the rest stays byte for byte.

The entries of a table are the list ``table.value.body``: keys with their items, comments, blank lines. It is edited in
place; then the document is rendered. Whoever edits reads the result again and compares it with what was meant.
"""

from __future__ import annotations

import re

import tomlkit
from tomlkit.items import AoT, Comment, Item, Key, Table, Whitespace

from shapegcode.errors import ArgumentError

__all__ = [
    "Entry",
    "commented_key",
    "commented_table",
    "entry_of",
    "is_blank",
    "own_end",
    "parse_exactly",
    "take_tail",
]

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
