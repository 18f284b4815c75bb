"""A control's tables of tool offsets, work offsets and macro variables, as it punches them out.

``G10G90L10P1R185.676`` (TOOLOFST.TXT), ``G10L2P1X-865.475Y-934.435Z-833.845`` (EXT_WKZ.TXT),
``G10L85P500(4044000000000000)`` (MACRO.TXT: the value as a double in hexadecimal), ``#500=[25283*65536]/134217728``
(the same of older series).
"""

from __future__ import annotations

import ast
import math
import operator
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

from shapegcode.errors import MachineError, Problem

__all__ = ["ControlTables", "is_table", "read_table"]

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
_G10 = re.compile(r"(?:N\s*\d+\s*)?(?:G9[01]\s*)?G10\b|(?:N\s*\d+\s*)?(?:G9[01]\s*)?G10(?=[A-Z])", re.ASCII)
_WORD = re.compile(rf"([A-Z])\s*({_NUMBER})\s*", re.ASCII)
_DOUBLE = re.compile(r"\(\s*([0-9A-Fa-f]{16})\s*\)", re.ASCII)
_ASSIGNMENT = re.compile(r"#\s*(\d{1,5})\s*=\s*(.+)", re.ASCII)
_HARMLESS = re.compile(r"(?:O\d+|:\d+|M\d+|G90|G91|G11|SETVN\d+\[.*\]|\(.*\))?\s*;?", re.ASCII)
_OPERATORS = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}
_KEPT = range(500, 1000)
_SYSTEMS = {number: f"G{53 + number}" for number in range(1, 7)}


@dataclass
class ControlTables:
    """What the tables say, in the units that they are written in.

    Attributes:
        kinds: kinds of tool offset by number of G10: 1 (one value for all), 10 and 11 (geometry and wear of both, or
            of the length), 12 and 13 (of the radius).
        tools: per kind the offsets by number.
        systems: work offsets by name, "" for the one that is added to all.
        variables: by number; None: vacant.
        sources: per group ("tools", "systems", "variables") file, first and last line.
        left_out: lines that hold something else.
    """

    kinds: set[int] = field(default_factory=set)
    tools: dict[int, dict[int, tuple[float, bool]]] = field(default_factory=dict)
    systems: dict[str, dict[str, tuple[float, bool]]] = field(default_factory=dict)
    variables: dict[int, float | None] = field(default_factory=dict)
    sources: dict[str, tuple[str, int, int]] = field(default_factory=dict)
    left_out: list[tuple[str, int, str]] = field(default_factory=list)

    def note(self, group: str, file: str, line: int) -> None:
        """A line of a file was read into a group."""
        first = self.sources[group][1] if group in self.sources and self.sources[group][0] == file else line
        self.sources[group] = (file, first, line)


def is_table(data: bytes) -> bool:
    """Whether a file is such a table: its first line with words is a G10 or an assignment, or leads to one."""
    for _, words in _lines(data):
        if _G10.match(words) or _ASSIGNMENT.fullmatch(words):
            return True
        if not _HARMLESS.fullmatch(words):
            return False
    return False


def read_table(data: bytes, file: str, tables: ControlTables) -> None:
    """Read a table into those that were read before; a value that is there already is replaced."""
    for line, words in _lines(data):
        try:
            if found := _ASSIGNMENT.fullmatch(words):
                _variable(tables, int(found[1]), _value(found[2]), file, line)
            elif _G10.match(words):
                _take(tables, words, file, line)
            elif not _HARMLESS.fullmatch(words):
                tables.left_out.append((file, line, words[:60]))
        except (ValueError, KeyError, SyntaxError, ZeroDivisionError, OverflowError) as bad:
            said = f'"{words[:60]}": not a line of a table of offsets or variables ({bad})'
            raise MachineError(file, (Problem("", "", said, line),)) from bad


def _lines(data: bytes) -> Iterator[tuple[int, str]]:
    """Lines with words, and their numbers, up to the second %."""
    text = data.decode("latin-1").removeprefix("ï»¿")
    seen = False
    for number, raw in enumerate(text.split("\n" if "\n" in text else "\r"), start=1):
        words = raw.strip().rstrip(";").strip()
        if words.startswith("%"):
            if seen:
                return
            continue
        if words:
            seen = True
            yield number, words


def _take(tables: ControlTables, words: str, file: str, line: int) -> None:
    double = _DOUBLE.search(words)
    bare = _DOUBLE.sub("", words)
    found = _WORD.findall(bare)
    if "".join(letter + number for letter, number in found) != re.sub(r"\s+", "", bare):
        raise ValueError("words are a letter and a number")
    values = {letter: number for letter, number in found if letter not in "GN"}
    kind, number = int(values.pop("L", "1")), int(values.pop("P"))
    if kind == 85:
        if double is None:
            raise ValueError("no value of 16 hexadecimal digits in brackets")
        (value,) = struct.unpack(">d", bytes.fromhex(double[1]))
        _variable(tables, number, value if math.isfinite(value) else None, file, line)
    elif kind in (2, 20):
        name = f"G54.1P{number}" if kind == 20 else "" if number == 0 else _SYSTEMS[number]
        tables.systems[name] = {axis: _length(values[axis]) for axis in "XYZ" if axis in values}
        tables.note("systems", file, line)
    elif kind in (1, 10, 11, 12, 13):
        tables.kinds.add(kind)
        tables.tools.setdefault(kind, {})[number] = _length(values["R"])
        tables.note("tools", file, line)
    else:
        tables.left_out.append((file, line, words[:60]))


def _length(text: str) -> tuple[float, bool]:
    """A length, and whether it has a decimal point."""
    return float(text), "." in text


def _variable(tables: ControlTables, number: int, value: float | None, file: str, line: int) -> None:
    if number in _KEPT:
        tables.variables[number] = value
        tables.note("variables", file, line)
    else:
        tables.left_out.append((file, line, f"#{number}: not one that the control keeps (#500 to #999)"))


def _value(text: str) -> float | None:
    """The value of an assignment: a number, numbers joined by + - * / in square brackets, or #0, which is vacant."""
    if re.fullmatch(r"#\s*0", text.strip()):
        return None
    if not re.fullmatch(r"[-+*/.\d\[\]\s]{1,200}", text):
        raise ValueError("its value is no number")
    return _computed(ast.parse(text.strip().replace("[", "(").replace("]", ")"), mode="eval").body)


def _computed(node: ast.expr) -> float:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return float(node.value)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        return -_computed(node.operand) if isinstance(node.op, ast.USub) else _computed(node.operand)
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return float(_OPERATORS[type(node.op)](_computed(node.left), _computed(node.right)))
    raise ValueError("its value is no number")
