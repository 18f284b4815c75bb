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
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import tomlkit
from tomlkit.items import AoT, InlineTable, Table

Origin = Literal["measured", "dump", "inherited", "assumed", "choice", "file", "default"]
"""Of a value: measured on this machine; read from the control's dump; taken over from another machine; assumed; a
choice, no property of a machine; stated in the file without a word of where it comes from; left out of the file."""

MEASURED = "measured"
"""What the remark of a measured value begins with."""

DEFAULT = "default"
"""The remark of a default that was written into a file."""

ORIGIN = "origin"
"""Name of the table, and of the key beside an inline value."""

_WORDS: dict[Origin, str] = {
    "measured": "measured",
    "dump": "parameters",
    "inherited": "inherited",
    "assumed": "assumed",
    "choice": "choice",
    "default": "default",
    "file": "stated",
}
ORIGIN_TEXT = rf"^({'|'.join(_WORDS.values())})($|: .|, .| \(.)"
"""What the text of an origin begins with; a note may follow."""

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
class _Line:
    """A line with a key: what it is called, where its remark begins, and the remark."""

    key: str
    end: int
    remark: str


def take_origins(data: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """The tables of a file without what they say of where values come from, and that; two for one value are a list."""
    found: dict[str, Any] = {}
    inline: dict[str, Any] = {}
    plain = {name: _plain(value, name, inline) for name, value in data.items() if name != ORIGIN}
    if ORIGIN in data:
        _flatten(data[ORIGIN], "", found)
    for key, said in inline.items():
        _note(key, said, found)
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


def _note(key: str, said: Any, found: dict[str, Any]) -> None:
    found[key] = [found[key], said] if key in found else said


def remark_of(stated: str) -> str:
    """The remark that an origin in a file states: without the word where the note says the same."""
    word, _, note = stated.partition(": ")
    return note if note and origin_of(note) == origin_of(word) else stated


def _stated(remark: str) -> str:
    word = _WORDS[origin_of(remark)]
    found = re.match(ORIGIN_TEXT, remark)
    return remark if found and found[1] == word else f"{word}: {remark}"


def remarks_of(text: str) -> dict[str, str]:
    """Where the values of a file come from."""
    stated = take_origins(tomllib.loads(text))[1]
    return remarks_in_comments(text) if stated is None else {key: remark_of(said) for key, said in stated.items()}


def remarks_in_comments(text: str) -> dict[str, str]:
    """What stands behind the values of a file that has neither form of origins."""
    return {line.key: line.remark for _, line in _lines(text) if line is not None and line.remark}


def origin_lines(remarks: Mapping[str, str]) -> list[str]:
    """The table of the origins."""
    lines = [f"{key} = {tomlkit.string(_stated(remark)).as_string()}" for key, remark in remarks.items() if remark]
    return [f"[{ORIGIN}]  # where values come from: {', '.join(_WORDS.values())}", *lines] if lines else []


def with_origin_table(text: str, remarks: Mapping[str, str] | None = None) -> str:
    """A file with its origins in a table at its end; the rest stays byte for byte, but for values with an origin."""
    remarks = remarks_of(text) if remarks is None else remarks
    document = tomlkit.parse(text)
    if take_origins(document)[1] is not None:
        document.pop(ORIGIN, None)
        _unwrap(document)
        text = document.as_string()
    newline = "\r\n" if text.partition("\n")[0].endswith("\r") else "\n"
    table = "".join(line + newline for line in origin_lines(remarks))
    return text.rstrip("\r\n") + 2 * newline + table if table else text


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
    """A file whose values come from elsewhere; comments that said the same as an origin follow it."""
    old = remarks_of(text)
    new = {key: change(key, remark) for key, remark in old.items()}
    lines = []
    for raw, line in _lines(text):
        if line is None or line.remark != old.get(line.key, "") or new.get(line.key, "") == line.remark:
            lines.append(raw)
            continue
        body, said = raw.rstrip("\r\n"), new[line.key]
        lines.append(body[: line.end].rstrip() + (f"  # {said}" if said else "") + raw[len(body) :])
    return with_origin_table("".join(lines), new)


def _lines(text: str) -> Iterator[tuple[str, _Line | None]]:
    """Every line with its end, and what it says of a key; None for every other line."""
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
