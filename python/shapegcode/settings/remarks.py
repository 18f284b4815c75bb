"""Where the values of a machine file come from: the table ``[origin]``, each text begins with a word.

    [origin]
    axes.x.modes.1.frequency_hz = "measured, 95 %: 46.1 ... 46.3"
    controller.time_constant_s = "parameters: FANUC 1622, 1610"
    controller.block_time_s = "inherited: from VX500: paper 000"

Or beside the value: ``frequency_hz = { value = 46.2, origin = "measured" }``. A comment is for people and says nothing;
only in files without either form, as they were written before, the first words of the comments count.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

Origin = Literal["measured", "dump", "inherited", "assumed", "choice", "file", "default"]
"""Of a value: measured on this machine; read from the control's dump; taken over from another machine; assumed; a
choice, no property of a machine; stated in the file without a word of where it comes from; left out of the file."""

DEFAULT = "default"
"""The remark of a default that was written into a file."""

ORIGIN = "origin"
"""Name of the table, and of the key beside an inline value."""

ORIGIN_WORDS: dict[Origin, str] = {
    "measured": "measured",
    "dump": "parameters",
    "inherited": "inherited",
    "assumed": "assumed",
    "choice": "choice",
    "default": "default",
    "file": "stated",
}
ORIGIN_TEXT = rf"^({'|'.join(ORIGIN_WORDS.values())})($|: .|, .| \(.)"
"""Start of the text of an origin; a note may follow."""

_BEGINNINGS: tuple[tuple[str, Origin], ...] = (
    (r"measured\b(?!\?)|95 %:|half of the 95 %", "measured"),
    (r"parameters\b|FANUC \S", "dump"),
    (r"inherited\b|from \S", "inherited"),
    (r"assumed\b|guess|estimate|measured\?|not known|not measured|.*\b(?:not measured|is assumed)$", "assumed"),
    (r"choice\b", "choice"),
    (r"default\b", "default"),
)

_HEADER = re.compile(r"\s*(\[{1,2})\s*([^\[\]]+?)\s*\]{1,2}\s*(?:#\s*(.*))?")
_KEY = re.compile(r'\s*([A-Za-z0-9_.-]+|"[^"]*")\s*=')
_UNSET = re.compile(r"\s*#\s*([A-Za-z0-9_-]+)\s*=\s*\.\.\.\s*(?:#\s*(.*))?")
_UNSET_LIST = re.compile(r"\s*#\s*\[\[\s*([^\[\]]+?)\s*\]\]\s*(?:#\s*(.*))?")
_VALUE = re.compile(r"(?:\"(?:[^\"\\]|\\.)*\"|'[^']*'|[^#\"'])*")


def origin_of(remark: str) -> Origin:
    """Where a value of a file comes from, by what stands behind it."""
    return next((origin for begins, origin in _BEGINNINGS if re.match(begins, remark)), "file")


def inherited(name: str, remark: str) -> str:
    """The remark of a value that is taken over from another machine."""
    origin = origin_of(remark)
    if origin in ("assumed", "choice", "inherited", "default"):
        return remark
    return f"from {name}: {remark}" if remark else f"from {name}"


@dataclass(frozen=True)
class KeyLine:
    """A line that names a table or a key, or in a comment ``# name = ...`` a key that is left out."""

    kind: Literal["table", "key", "unset"]
    key: str  # dotted name
    end: int = 0  # where its remark begins
    remark: str = ""


def take_origins(data: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """The tables of a file without what they say of where values come from, and that; two for one value are a list."""
    found: dict[str, Any] = {}
    inline: dict[str, Any] = {}
    plain = {name: _plain(value, name, inline) for name, value in data.items() if name != ORIGIN}
    if ORIGIN in data:
        _flatten(data[ORIGIN], "", found)
    for key, origin in inline.items():
        _note(key, origin, found)
    return plain, found if ORIGIN in data or inline else None


def _plain(value: Any, key: str, inline: dict[str, Any]) -> Any:
    if isinstance(value, list):
        return [_plain(each, f"{key}.{number}", inline) for number, each in enumerate(value, start=1)]
    if not isinstance(value, Mapping):
        return value
    if value.keys() == {"value", ORIGIN}:
        inline[key] = value[ORIGIN]
        return value["value"]
    return {name: _plain(each, f"{key}.{name}", inline) for name, each in value.items()}


def _flatten(value: Any, key: str, found: dict[str, Any]) -> None:
    if not isinstance(value, Mapping):
        _note(key or ORIGIN, value, found)
        return
    for name, each in value.items():
        _flatten(each, f"{key}.{name}" if key else name, found)


def _note(key: str, origin: Any, found: dict[str, Any]) -> None:
    found[key] = [found[key], origin] if key in found else origin


def remark_of(stated: str) -> str:
    """The remark that an origin in a file states: without the word where the note says the same."""
    word, _, note = stated.partition(": ")
    return note if note and origin_of(note) == origin_of(word) else stated


def remarks_of(text: str) -> dict[str, str]:
    """Where the values of a file come from."""
    stated = take_origins(tomllib.loads(text))[1]
    return remarks_in_comments(text) if stated is None else {key: remark_of(origin) for key, origin in stated.items()}


def remarks_in_comments(text: str) -> dict[str, str]:
    """What stands behind the values of a file that has neither form of origins."""
    return {line.key: line.remark for _, line in lines_of(text) if line and line.remark}


def lines_of(text: str) -> Iterator[tuple[str, KeyLine | None]]:
    """Every line with its end, and what it names; None for every other line."""
    table, counts, inside = "", dict[str, int](), 0
    texts = _lines_of_long_texts(text)
    for number, raw in enumerate(text.splitlines(keepends=True)):
        line = raw.rstrip("\r\n")
        if number in texts:
            yield raw, None
        elif inside:
            inside += open_brackets(line)
            yield raw, None
        elif header := _HEADER.fullmatch(line):
            table = re.sub(r"\s*\.\s*", ".", header[2])
            if header[1] == "[[":
                counts[table] = counts.get(table, 0) + 1
                table = f"{table}.{counts[table]}"
            yield raw, KeyLine("table", table)
        elif (found := _UNSET_LIST.fullmatch(line)) or (found := _UNSET.fullmatch(line)):
            listed = "[[" in line.partition("=")[0]
            key = found[1] if listed or not table else f"{table}.{found[1]}"
            end_of = len(line) if found[2] is None else line.rindex("#", 0, found.start(2))
            yield raw, KeyLine("unset", key, end_of, (found[2] or "").strip())
        elif found := _KEY.match(line):
            key = f"{table}.{found[1]}" if table else found[1]
            end = _VALUE.match(line, found.end())
            assert end is not None
            inside = open_brackets(line[found.end() :])
            yield raw, KeyLine("key", key, end.end(), line[end.end() :].lstrip("# ").rstrip())
        else:
            yield raw, None


_TEXT = re.compile(r"""(\"{3}(?:\\.|[^\\])*?\"{3,5}|'{3}.*?'{3,5})|"(?:\\.|[^"\\\n])*"|'[^'\n]*'|#[^\n]*""", re.DOTALL)


def _lines_of_long_texts(text: str) -> set[int]:
    """Lines, from 0, of texts in three quotes: nothing in them is a key or a comment."""
    found: set[int] = set()
    for match in _TEXT.finditer(text):
        if match[1]:
            first = text.count("\n", 0, match.start())
            found.update(range(first, first + match[0].count("\n") + 1))
    return found


def open_brackets(line: str) -> int:
    """How many more lists begin in a line than end in it; texts and comments do not count."""
    bare = re.sub(r'"(?:[^"\\]|\\.)*"|\'[^\']*\'|#.*', "", line)
    return bare.count("[") - bare.count("]")
