"""Edit a TOML file with tomlkit: change some entries or origins, keep the rest byte for byte.

A caller that edits entries (``table.value.body``) must read the result again and compare it with the intended values.
"""

from __future__ import annotations

import contextlib
import re
import tomllib
from collections.abc import Callable, Mapping
from typing import Any

import tomlkit
from tomlkit.items import AoT, Comment, InlineTable, Item, Key, Table

from shapegcode.errors import ArgumentError
from shapegcode.settings.keys import ORIGIN, ORIGIN_TEXT, ORIGIN_WORDS, lines_of, origin_of, remarks_of, take_origins

Entry = tuple[Key | None, Item]

_HEADER = re.compile(r"^[ \t]*\[+[ \t]*([^\[\]\n]*?)[ \t]*\]", re.MULTILINE)
COMMENTED_KEY = re.compile(r"#\s*([A-Za-z0-9_-]+)\s*=\s*\.\.\.")
COMMENTED_TABLE = re.compile(r"#\s*\[\[\s*([^\[\]]+?)\s*\]\]")


def parse_exactly(text: str, file: str) -> tomlkit.TOMLDocument:
    """Parse a TOML file that can be edited without changing any other byte; refuse others."""
    document = tomlkit.parse(text)
    rendered = document.as_string()
    if rendered == text:
        return document
    lines = zip(text.splitlines(), rendered.splitlines(), strict=False)
    number, (line, other) = next((n, pair) for n, pair in enumerate(lines, start=1) if pair[0] != pair[1])
    raise ArgumentError(f"{file}:{number}: {line.strip()!r} cannot be kept unchanged: write it as {other.strip()!r}")


def commented(entry: Entry, pattern: re.Pattern[str]) -> str:
    """The name in a comment ``# name = ...`` for a missing key, or ``# [[name]]`` for a list without tables; else
    empty."""
    match = pattern.match(entry[1].trivia.comment) if isinstance(entry[1], Comment) else None
    return match[1] if match else ""


def own_end(entries: list[Entry]) -> int:
    """Index after the last key and the commented keys that follow it; later entries belong to other tables."""
    end = max((index + 1 for index, (key, _) in enumerate(entries) if key is not None), default=0)
    for index in range(end, len(entries)):
        if not isinstance(entries[index][1], Comment) or commented(entries[index], COMMENTED_TABLE):
            break
        if commented(entries[index], COMMENTED_KEY):
            end = index + 1
    return end


def take_tail(table: Table) -> list[Entry]:
    """Remove and return entries after the last key of a table and its nested tables: they belong to the next table."""
    entries = table.value.body
    last = next((item for key, item in reversed(entries) if key is not None), None)
    last = last.body[-1] if isinstance(last, AoT) else last
    tail = take_tail(last) if isinstance(last, Table) else []
    end = own_end(entries)
    tail += entries[end:]
    del entries[end:]
    return tail


# --- origins of values ------------------------------------------------------------------------------------------------


def origin_lines(remarks: Mapping[str, str]) -> list[str]:
    """Lines of the table of origins."""
    lines = [f"{key} = {tomlkit.string(_stated(remark)).as_string()}" for key, remark in remarks.items() if remark]
    return [f"[{ORIGIN}]  # origins of values: {', '.join(ORIGIN_WORDS.values())}", *lines] if lines else []


def with_origin_table(text: str, remarks: Mapping[str, str] | None = None) -> str:
    """Move the origins of values into a table at the end; the only other change is that inline origins are removed."""
    remarks = remarks_of(text) if remarks is None else remarks
    text = without_origins(text)
    newline = "\r\n" if text.partition("\n")[0].endswith("\r") else "\n"
    table = "".join(line + newline for line in origin_lines(remarks))
    return text.rstrip("\r\n") + 2 * newline + table if table else text


def without_origins(text: str) -> str:
    """Remove the origins from a file; the rest stays byte for byte."""
    plain, stated = take_origins(tomllib.loads(text))
    if stated is None:
        return text
    # Usually they are one table at the end, which can be cut off; with tomlkit it would take about one second.
    headers = list(_HEADER.finditer(text))
    if headers and headers[-1][1] == ORIGIN:
        head = text[: headers[-1].start()]
        with contextlib.suppress(tomllib.TOMLDecodeError):  # the apparent heading is inside a string
            if tomllib.loads(head) == plain:
                return head
    document = tomlkit.parse(text)
    document.pop(ORIGIN, None)
    _unwrap(document)
    return document.as_string()


def _unwrap(table: Any) -> None:
    for name, item in list(table.items()):
        if isinstance(item, InlineTable) and item.keys() == {"value", ORIGIN}:
            table[name] = item["value"]
        elif isinstance(item, AoT):
            for each in item.body:
                _unwrap(each)
        elif isinstance(item, Table) or (not isinstance(item, InlineTable) and isinstance(item, Mapping)):
            _unwrap(item)


def with_remarks(text: str, change: Callable[[str, str], str]) -> str:
    """Change the origins in a file, also in comments that repeat them."""
    old = remarks_of(text)
    new = {key: change(key, remark) for key, remark in old.items()}
    lines = []
    for raw, line in lines_of(text):
        before, remark = ("", "") if line is None else (old.get(line.key, ""), new.get(line.key, ""))
        if line is None or line.kind == "table" or line.remark != before or remark == before:
            lines.append(raw)
        else:
            body = raw.rstrip("\r\n")
            lines.append(body[: line.end].rstrip() + (f"  # {remark}" if remark else "") + raw[len(body) :])
    return with_origin_table("".join(lines), new)


def _stated(remark: str) -> str:
    word = ORIGIN_WORDS[origin_of(remark)]
    found = re.match(ORIGIN_TEXT, remark)
    return remark if found and found[1] == word else f"{word}: {remark}"
