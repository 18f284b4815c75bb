"""Where the values of a file come from: the comment behind each value says it, and its first words count.

    frequency_hz = 46.2   # measured, 95 %: 46.1 ... 46.3
    time_constant_s = 0.1 # FANUC 1622, 1610
    block_time_s = 0.005  # from VX500: paper 000
    rapid_path = "linear" # assumed

So an origin stands where people see it beside its value, and needs no second table.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

__all__ = ["DEFAULT", "MEASURED", "Origin", "inherited", "open_brackets", "origin_of", "remarks_of", "with_remarks"]

Origin = Literal["measured", "dump", "inherited", "assumed", "choice", "file", "default"]
"""Of a value: measured on this machine; read from the control's dump; taken over from another machine; assumed; a
choice, no property of a machine; stated in the file without a word of where it comes from; left out of the file."""

MEASURED = "measured"
"""What the remark of a measured value begins with."""

DEFAULT = "default"
"""The remark of a default that was written into a file."""

_BEGINNINGS: tuple[tuple[str, Origin], ...] = (
    (r"measured\b|95 %:|half of the 95 %", "measured"),
    (r"FANUC \S", "dump"),
    (r"from \S", "inherited"),
    (r"assumed\b|not known|not measured|.*\b(?:not measured|is assumed)$", "assumed"),
    (r"choice\b", "choice"),
    (r"default\b", "default"),
)

_HEADER = re.compile(r"\s*(\[{1,2})\s*([^\[\]]+?)\s*\]{1,2}\s*(?:#\s*(.*))?")
_KEY = re.compile(r'\s*([A-Za-z0-9_.-]+|"[^"]*")\s*=')
_UNSET = re.compile(r"\s*#\s*([A-Za-z0-9_-]+)\s*=\s*\.\.\.\s*(?:#\s*(.*))?")
_UNSET_LIST = re.compile(r"\s*#\s*\[\[\s*([^\[\]]+?)\s*\]\]\s*(?:#\s*(.*))?")
_VALUE = re.compile(r"(?:\"(?:[^\"\\]|\\.)*\"|'[^']*'|[^#\"'])*")


def origin_of(remark: str) -> Origin:
    """Where a value of a file comes from, by what stands behind it.

    Args:
        remark: the comment, without its sign.

    Returns:
        The origin; "file" where the comment says nothing of it.
    """
    return next((origin for begins, origin in _BEGINNINGS if re.match(begins, remark)), "file")


def inherited(name: str, remark: str) -> str:
    """The remark of a value that is taken over from another machine.

    Args:
        name: of that machine.
        remark: behind the value there.

    Returns:
        The remark for here: what was assumed there is assumed here, a choice stays one, everything else is inherited.
    """
    origin = origin_of(remark)
    if origin in ("assumed", "choice", "inherited", "default"):
        return remark
    return f"from {name}: {remark}" if remark else f"from {name}"


@dataclass(frozen=True)
class _Line:
    """A line with a key: what it is called, where its remark begins, and the remark."""

    key: str
    end: int
    remark: str


def remarks_of(text: str) -> dict[str, str]:
    """The remarks of a file.

    Args:
        text: TOML of the plain layout ``[table]`` / ``key = value``.

    Returns:
        Per dotted key (tables of a list count from 1) what stands behind its value; keys without a remark are left out.
    """
    return {line.key: line.remark for _, line in _lines(text) if line is not None and line.remark}


def with_remarks(text: str, change: Callable[[str, str], str]) -> str:
    """A file with other remarks; everything else stays byte for byte.

    Args:
        text: TOML of the plain layout.
        change: called with dotted key and remark; gives the new remark, empty for none.

    Returns:
        The text.
    """
    lines = []
    for raw, line in _lines(text):
        new = "" if line is None else change(line.key, line.remark)
        if line is None or new == line.remark:
            lines.append(raw)
            continue
        body = raw.rstrip("\r\n")
        lines.append(body[: line.end].rstrip() + (f"  # {new}" if new else "") + raw[len(body) :])
    return "".join(lines)


def _lines(text: str) -> Iterator[tuple[str, _Line | None]]:
    """Every line with its end, and what it says of a key; None for every other line."""
    table, counts, inside = "", dict[str, int](), 0
    for raw in text.splitlines(keepends=True):
        line = raw.rstrip("\r\n")
        if inside:
            inside += open_brackets(line)
            yield raw, None
            continue
        if header := _HEADER.fullmatch(line):
            table = re.sub(r"\s*\.\s*", ".", header[2])
            if header[1] == "[[":
                counts[table] = counts.get(table, 0) + 1
                table = f"{table}.{counts[table]}"
            yield raw, None
        elif (found := _UNSET_LIST.fullmatch(line)) or (found := _UNSET.fullmatch(line)):
            listed = "[[" in line.partition("=")[0]
            key = found[1] if listed or not table else f"{table}.{found[1]}"
            end_of = len(line) if found[2] is None else line.rindex("#", 0, found.start(2))
            yield raw, _Line(key, end_of, (found[2] or "").strip())
        elif found := _KEY.match(line):
            key = f"{table}.{found[1]}" if table else found[1]
            end = _VALUE.match(line, found.end())
            assert end is not None
            inside = open_brackets(line[found.end() :])
            yield raw, _Line(key, end.end(), line[end.end() :].lstrip("# ").rstrip())
        else:
            yield raw, None


def open_brackets(line: str) -> int:
    """How many more lists begin in a line than end in it; texts and comments do not count."""
    bare = re.sub(r'"(?:[^"\\]|\\.)*"|\'[^\']*\'|#.*', "", line)
    return bare.count("[") - bare.count("]")
