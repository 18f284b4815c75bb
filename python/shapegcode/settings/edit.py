"""A TOML file as its lines, so that some of them can be changed and the rest stays byte for byte."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

__all__ = ["Chunk", "chunks", "commented_key", "commented_table"]

_COMMENTED_KEY = re.compile(r"\s*#\s*([A-Za-z0-9_-]+)\s*=\s*\.\.\.")
_COMMENTED_TABLE = re.compile(r"\s*#\s*\[\[\s*([^\[\]]+?)\s*\]\]")


@dataclass(frozen=True)
class Chunk:
    """The lines of one blank line, comment, head of a table, or key with its value.

    Attributes:
        kind: what it is; "array" is the head of a table in a list, [[name]].
        text: as in the file, line end included.
        line: its first line, from 1.
        path: parts of the dotted name of a table or key; empty for blank lines and comments.
    """

    kind: Literal["blank", "comment", "table", "array", "key"]
    text: str
    line: int
    path: tuple[str, ...] = ()

    @property
    def is_head(self) -> bool:
        """Whether a table begins here."""
        return self.kind in ("table", "array")


def chunks(text: str) -> list[Chunk]:
    """The chunks of a TOML file; their texts joined are the file.

    Raises:
        tomllib.TOMLDecodeError: it is no TOML.
    """
    tomllib.loads(text)
    return list(_chunks(re.findall(r"[^\n]*\n|[^\n]+", text)))


def commented_key(chunk: Chunk) -> str:
    """The name in a comment ``# name = ...``, which stands for a key that is left out; empty for everything else."""
    match = _COMMENTED_KEY.match(chunk.text) if chunk.kind == "comment" else None
    return match[1] if match else ""


def commented_table(chunk: Chunk) -> str:
    """The name in a comment ``# [[name]]``, which stands for a list without tables; empty for everything else."""
    match = _COMMENTED_TABLE.match(chunk.text) if chunk.kind == "comment" else None
    return match[1] if match else ""


def _chunks(lines: list[str]) -> Iterator[Chunk]:
    place = 0
    while place < len(lines):
        text, number = lines[place], place + 1
        bare = text.strip()
        place += 1
        if not bare:
            yield Chunk("blank", text, number)
        elif bare.startswith("#"):
            yield Chunk("comment", text, number)
        elif bare.startswith("["):
            kind: Literal["table", "array"] = "array" if bare.startswith("[[") else "table"
            yield Chunk(kind, text, number, _path(tomllib.loads(text)))
        else:
            # A value may go over several lines: it is whole as soon as it can be read alone.
            while (data := _loads(text)) is None:
                text += lines[place]
                place += 1
            yield Chunk("key", text, number, _path(data)[: _depth(text)])


def _loads(text: str) -> dict[str, Any] | None:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return None


def _path(data: Any) -> tuple[str, ...]:
    """Names from the outside to the inside, as long as there is but one."""
    found: list[str] = []
    while isinstance(data, dict) and len(data) == 1:
        ((name, data),) = data.items()
        found.append(name)
    return tuple(found)


def _depth(text: str) -> int:
    """How many parts the name of a key has: an inline table as its value adds none."""
    part = r"""\s*(?:[A-Za-z0-9_-]+|"(?:[^"\\]|\\.)*"|'[^']*')\s*"""
    match = re.match(rf"{part}(?:\.{part})*=", text)
    return len(re.findall(part, match[0][:-1])) if match else 1
