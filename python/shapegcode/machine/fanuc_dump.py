"""Files punched by a FANUC control: parameters as records, tables of offsets and macro variables; a machine file filled
from them.

Both grammars of CNC-PARA.TXT are read: ``N01420Q1A1P24000.0A2P24000.0`` (30i, 0i-D, 0i-F; the 15i leaves Q1 out) and
``N01825 A1 P 3000 A2 P 3000`` (16, 18, 21). Tables: ``G10G90L10P1R185.676`` (TOOLOFST.TXT),
``G10L2P1X-865.475Y-934.435Z-833.845`` (EXT_WKZ.TXT), ``G10L85P500(4044000000000000)`` (MACRO.TXT: the value as a double
in hexadecimal), ``#500=[25283*65536]/134217728`` (MACRO.TXT of older series). Lines end in LF, CR-LF or LF-CR-CR.
"""

import ast
import math
import operator
import re
import struct
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from shapegcode.errors import ArgumentError, MachineError, Problem
from shapegcode.io.units import MM_PER_INCH
from shapegcode.machine.axes import check_axes
from shapegcode.machine.machine import Machine
from shapegcode.machine.result import AssumedValue, MissingParameter, ReadParameter, ReadTable, Value
from shapegcode.results.outcome import Xyz

_TABLE_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
_G10 = re.compile(r"(?:N\s*\d+\s*)?(?:G9[01]\s*)?G10\b|(?:N\s*\d+\s*)?(?:G9[01]\s*)?G10(?=[A-Z])", re.ASCII)
_WORD = re.compile(rf"([A-Z])\s*({_TABLE_NUMBER})\s*", re.ASCII)
_DOUBLE = re.compile(r"\(\s*([0-9A-Fa-f]{16})\s*\)", re.ASCII)
_ASSIGNMENT = re.compile(r"#\s*(\d{1,5})\s*=\s*(.+)", re.ASCII)
_HARMLESS = re.compile(r"(?:O\d+|:\d+|M\d+|G90|G91|G11|SETVN\d+\[.*\]|\(.*\))?\s*;?", re.ASCII)
_OPERATORS = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}
_KEPT = range(500, 1000)
_SYSTEMS = {number: f"G{53 + number}" for number in range(1, 7)}


@dataclass
class ControlTables:
    """Contents of the control's tables of offsets and variables, in the units of the control."""

    # kinds of tool offset by L of G10: 1 (one value), 10 and 11 (geometry and wear; with memory C of the length), 12
    # and 13 (geometry and wear of the radius); a length is its value and whether it has a decimal point
    kinds: set[int] = field(default_factory=set)
    tools: dict[int, dict[int, tuple[float, bool]]] = field(default_factory=dict)  # offsets by kind and number
    # work offsets by name; "": added to all others
    systems: dict[str, dict[str, tuple[float, bool]]] = field(default_factory=dict)
    variables: dict[int, float | None] = field(default_factory=dict)  # by number; None: vacant
    # file, first and last line by group ("tools", "systems", "variables")
    sources: dict[str, tuple[str, int, int]] = field(default_factory=dict)
    left_out: list[tuple[str, int, str]] = field(default_factory=list)  # other lines

    def note(self, group: str, file: str, line: int) -> None:
        """Note that a line of a file was read into a group."""
        first = self.sources[group][1] if group in self.sources and self.sources[group][0] == file else line
        self.sources[group] = (file, first, line)


def is_table(data: bytes) -> bool:
    """True if a file is a table of offsets or variables: nothing else is set before the first G10 or assignment."""
    for _, words in _lines(data):
        if _G10.match(words) or _ASSIGNMENT.fullmatch(words):
            return True
        if not _HARMLESS.fullmatch(words):
            return False
    return False


def read_table(data: bytes, file: str, tables: ControlTables) -> None:
    """Read a table into *tables*; existing values are replaced."""
    for line, words in _lines(data):
        try:
            if found := _ASSIGNMENT.fullmatch(words):
                _variable(tables, int(found[1]), _value(found[2]), file, line)
            elif _G10.match(words):
                _take_words(tables, words, file, line)
            elif not _HARMLESS.fullmatch(words):
                tables.left_out.append((file, line, words[:60]))
        except (ValueError, KeyError, SyntaxError, ZeroDivisionError, OverflowError) as bad:
            message = f'"{words[:60]}": not a line of a table of offsets or variables ({bad})'
            raise MachineError(file, (Problem("", "", message, line),)) from bad


def _every_line(data: bytes) -> Iterator[tuple[int, str]]:
    """Lines that are not empty, and their numbers; comments may contain any characters."""
    text = data.decode("latin-1").removeprefix("ï»¿")
    lines = text.split("\n" if "\n" in text else "\r")
    return ((number, words) for number, raw in enumerate(lines, start=1) if (words := raw.strip()))


def _lines(data: bytes) -> Iterator[tuple[int, str]]:
    """Lines with words, and their numbers; a line with % ends them, unless no words came before it."""
    seen = False
    for number, line in _every_line(data):
        words = line.rstrip(";").strip()
        if words.startswith("%"):
            if seen:
                return
            continue
        if words:
            seen = True
            yield number, words


def _take_words(tables: ControlTables, words: str, file: str, line: int) -> None:
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
    """Parse a length; also return whether it has a decimal point."""
    return float(text), "." in text


def _variable(tables: ControlTables, number: int, value: float | None, file: str, line: int) -> None:
    if number in _KEPT:
        tables.variables[number] = value
        tables.note("variables", file, line)
    else:
        tables.left_out.append((file, line, f"#{number}: not a retained variable (#500 to #999)"))


def _value(text: str) -> float | None:
    """Value of an assignment: a number, an expression with + - * / and square brackets, or #0 (vacant)."""
    if re.fullmatch(r"#\s*0", text.strip()):
        return None
    if not re.fullmatch(r"[-+*/.\d\[\]\s]{1,200}", text):
        raise ValueError("its value is not a number")
    return _computed(ast.parse(text.strip().replace("[", "(").replace("]", ")"), mode="eval").body)


def _computed(node: ast.expr) -> float:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return float(node.value)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        return -_computed(node.operand) if isinstance(node.op, ast.USub) else _computed(node.operand)
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return float(_OPERATORS[type(node.op)](_computed(node.left), _computed(node.right)))
    raise ValueError("its value is not a number")


LONGEST_MS = 10_000.0
_MAX_VALUE = 1e7


@dataclass(frozen=True)
class Entry:
    """One value of a dump."""

    number: int  # parameter number
    target: str  # "A1", "S2", "L1", "T1", or empty if the value has no axis, spindle or path
    letter: str  # "P", or "M" and "I" for values in mm and inch
    text: str  # the value as written
    line: int  # line number in the dump, from 1


@dataclass
class Dump:
    """The records of a dump."""

    file: str  # its name
    entries: dict[tuple[int, str], Entry] = field(default_factory=dict)  # first value of each (number, target)
    with_q: bool = False  # True where records carry Q1 (30i, 0i-D, 0i-F)
    complete: bool = False  # True if it ends with ``%``
    # (number, line) of records that repeat a value for another path
    repeated: list[tuple[int, int]] = field(default_factory=list)
    strange: list[tuple[int, str]] = field(default_factory=list)  # (line, text) of lines that are not records
    records: int = 0  # number of records
    # other parameters, with the line of their first record
    others: dict[int, int] = field(default_factory=dict)

    def get(self, number: int, axis: int | None = None) -> Entry | None:
        """Entry of a parameter for an axis (1, 2, ...); without axis the only one, or that of path 1; None: missing."""
        targets = ("", "L1") if axis is None else (f"A{axis}",)
        return next((self.entries[number, name] for name in targets if (number, name) in self.entries), None)


_NUMBER = r"[-+]?(?:\d{1,40}\.?\d{0,40}|\.\d{1,40})"
_RECORD = re.compile(r"N\s*(\d{1,6})\s*(Q\d+)?\s*(.*)", re.ASCII)
_VALUE = re.compile(rf"(?:([LAST])\s*(\d{{1,4}})\s*)?([PMI])\s*({_NUMBER})\s*", re.ASCII)
_VALUES = re.compile(rf"(?:(?:[LAST]\s*\d{{1,4}}\s*)?[PMI]\s*{_NUMBER}\s*)+", re.ASCII)


def read_dump(data: bytes, file: str, wanted: Container[int]) -> Dump:
    """Read the *wanted* parameters of a dump, and check the form of all; *file* names it in messages."""

    def bad(message: str, line: int | None = None) -> MachineError:
        return MachineError(file, (Problem("", "", message, line),))

    if b"\0" in data:
        raise bad("binary data, not a parameter dump", data[: data.index(b"\0")].count(b"\n") + 1)
    dump = Dump(file)
    for line, words in _every_line(data):
        if words.startswith("%"):
            if dump.records:
                dump.complete = True
                break
            continue
        if not words.startswith("N"):
            # Lines before the first record are a header.
            if dump.records:
                dump.strange.append((line, words[:60]))
            continue
        record = _RECORD.fullmatch(words)
        if record is None:
            if dump.records:
                raise bad(f'"{words[:60]}": a record must be N, a number, and values', line)
            continue
        if not _VALUES.fullmatch(record[3]):
            if not dump.records and not re.search(r"[PMI]", record[3]):
                raise bad(f'"{words[:60]}": not a parameter record; is this a CNC-PARA.TXT?', line)
            raise bad(f'"{words[:60]}": cut or not numeric; values are P, M or I and a number', line)
        dump.records += 1
        dump.with_q |= record[2] is not None
        if int(record[1]) in wanted:
            _take(dump, record, line)
        else:
            dump.others.setdefault(int(record[1]), line)
    if not dump.records:
        raise bad("no parameter record (N01420Q1A1P24000.0 or N01825 A1 P 3000); is this a CNC-PARA.TXT?")
    return dump


def _take(dump: Dump, record: re.Match[str], line: int) -> None:
    number = int(record[1])
    seen: set[str] = set()
    again = False
    for letter, index, kind, text in _VALUE.findall(record[3]):
        target = f"{letter}{int(index)}" if letter else ""
        if target in seen:
            problem = Problem("", "", f"parameter {number}: {target or 'the value'} is given twice in one record", line)
            raise MachineError(dump.file, (problem,))
        seen.add(target)
        if (number, target) in dump.entries:
            again = True
        else:
            dump.entries[number, target] = Entry(number, target, kind, text, line)
    if again:
        dump.repeated.append((number, line))


class Draft:
    """Tables of a machine file, filled from the checked values of a dump."""

    def __init__(self, dump: Dump, data: dict[str, Any]) -> None:
        self.dump = dump  # the records
        self.axes = (1, 2, 3)  # numbers of the axes X, Y, Z in the dump
        self.problems: list[Problem] = []  # implausible values; the caller checks them at the end
        self.differing: list[tuple[int, float]] = []
        self.data = data  # tables of the machine file
        self.read: list[ReadParameter] = []  # every value of the dump that was stored in a key
        self.tables: list[ReadTable] = []  # tables of offsets and variables that were stored in keys
        self.assumed: list[AssumedValue] = []  # assumed values
        self.missing: list[MissingParameter] = []
        self.remarks: dict[str, str] = {}  # origin of the value by dotted key

    def scalar(self, number: int, high: float = _MAX_VALUE, unit: str = "", low: float = 0.0) -> float | None:
        """A parameter without axes; if the dump has it per axis, the largest of X, Y, Z."""
        entry = self.dump.get(number)
        if entry is not None:
            return self._number(entry, low, high, unit)
        values = [self._number(each, low, high, unit) for each in self.entries(number)]
        if values and min(values) != max(values):
            self.differing.append((number, max(values)))
        return max(values, default=None)

    def per_axis(self, number: int, high: float = _MAX_VALUE, unit: str = "", low: float = 0.0) -> list[float] | None:
        """The values of X, Y, Z; or, for all three, the one value without an axis; None if the dump has neither."""
        entries = self.entries(number)
        if len(entries) < 3:
            one = self.dump.get(number)
            return [self._number(one, low, high, unit)] * 3 if one else None
        return [self._number(entry, low, high, unit) for entry in entries]

    def entries(self, number: int) -> list[Entry]:
        """Entries of a parameter for X, Y and Z, in this order, as far as the dump has them."""
        found = (self.dump.get(number, axis) for axis in self.axes)
        return [entry for entry in found if entry is not None]

    def bit(self, number: int, bit: int) -> bool | None:
        """A bit of a parameter, counted from the right, from 0; that of X if per axis; None: missing or malformed."""
        entry = self.dump.get(number) or next(iter(self.entries(number)), None)
        return None if entry is None else self.bit_of(entry, bit)

    def bit_of(self, entry: Entry, bit: int) -> bool | None:
        """A bit of a value of eight bits, from the right, from 0; for another value note a problem and return None."""
        if len(entry.text) != 8 or set(entry.text) - {"0", "1"}:
            name = f"parameter {entry.number} {entry.target}".rstrip()
            self.problems.append(Problem(name, entry.text, "must be eight bits, 0 or 1", entry.line))
            return None
        return entry.text[7 - bit] == "1"

    def _number(self, entry: Entry, low: float, high: float, unit: str) -> float:
        value = float(entry.text) * (MM_PER_INCH if entry.letter == "I" and unit.startswith("mm") else 1.0)
        if not low <= value <= high:
            name = f"parameter {entry.number} {entry.target}".rstrip()
            limit = f"must be {low:g} to {high:g} (unit: {unit})"
            self.problems.append(Problem(name, entry.text, limit, entry.line))
        return value

    def problem(self, number: int, message: str) -> None:
        """Report a parameter that makes the dump useless, with its line."""
        line = next((entry.line for (n, _), entry in self.dump.entries.items() if n == number), None)
        self.problems.append(Problem(f"parameter {number}", "", message, line))

    def miss(self, number: int | str, why: str, line: int | None = None) -> None:
        """Note a parameter that is missing or has no effect."""
        if line is None and isinstance(number, int):
            entry = self.dump.get(number) or next(iter(self.entries(number)), None)
            line = entry.line if entry else None
        self.missing.append(MissingParameter(str(number), line, why))

    def assume(self, key: str, value: Value, why: str) -> None:
        """Note an assumed value that is set already, or that has no key."""
        self.assumed.append(AssumedValue(key, value, why))

    def assume_key(self, key: str, value: Value, why: str) -> None:
        """Set a key that the dump does not contain to an assumed value."""
        self.put(key, value)
        self.remarks[key] = f"assumed: {why}"
        self.assume(key, value, why)

    def get(self, key: str) -> Any:
        """Value of a dotted key; None if it is not set."""
        value: Any = self.data
        for part in key.split("."):
            value = value.get(part) if isinstance(value, Mapping) else None
        return value

    def drop(self, key: str) -> None:
        """Delete a key, so that its default applies."""
        *tables, name = key.split(".")
        table = self.get(".".join(tables))
        if isinstance(table, dict):
            table.pop(name, None)

    def set(self, key: str, value: Any, *numbers: int, note: str = "", axis: int | None = None) -> None:
        """Put a value of the dump into the machine."""
        shown = self.put(key, value)
        origin = "FANUC " + ", ".join(str(number) for number in numbers)
        self.remarks[key] = f"{origin}: {note}" if note else origin
        if note:
            self.assume(key, shown, note)
        for number in numbers:
            axes = self.axes if axis is None else (axis,)
            entries = [entry for a in axes if (entry := self.dump.get(number, a))]
            path = self.dump.get(number)
            for entry in entries or ([path] if path else []):
                self.read.append(ReadParameter(number, entry.target, entry.letter + entry.text, entry.line, key, shown))

    def choose(self, key: str, number: int, bit: int, on: Value = True, off: Value = False) -> bool | None:
        """Put one of two values into the machine by a bit of the dump; do nothing and return None without it."""
        found = self.bit(number, bit)
        if found is not None:
            self.set(key, on if found else off, number)
        return found

    def put(self, key: str, value: Any) -> Value:
        """Put a value into the tables without a remark; return it in the form to show."""
        *tables, name = key.split(".")
        table = self.data
        for part in tables:
            table = table.setdefault(part, {})
        if isinstance(value, list):
            table[name] = dict(zip("xyz", value, strict=True))
            return Xyz(*value)
        table[name] = value
        shown: Value = "; ".join(f"{k} = {v}" for k, v in value.items()) or "none" if isinstance(value, dict) else value
        return shown


def take_modes(draft: Draft, base: Machine | None, keep: str, rigid: str) -> None:
    """Keep the modes of the base on the axes for which this is requested; delete the others."""
    check_axes(keep, rigid)
    for axis in "xyz":
        modes = getattr(base.axes, axis).modes if base else ()
        key = f"axes.{axis}"
        if axis in keep:
            if not modes:
                raise ArgumentError(f"{axis.upper()}: {base.name if base else 'without --from it'} has no mode to keep")
            draft.remarks[f"{key}.rigid"] = "its modes are kept"
            continue
        for name in ("modes", "rigid"):
            draft.drop(f"{key}.{name}")
        if axis in rigid:
            draft.put(f"{key}.rigid", True)
            draft.remarks[f"{key}.rigid"] = "decided when the dump was imported"
            continue
        found = ", ".join(f"{mode.frequency_hz:g} Hz" for mode in modes)
        kept = f"--keep-modes {axis.upper()} does"
        whose = f"; {found} of {base.name} are not adopted: {kept}" if base and found else ""
        draft.remarks[f"{key}.modes"] = "not measured"
        draft.remarks[f"{key}.rigid"] = "assumed: not measured"
        none = f"--rigid {axis.upper()}: it has none"
        draft.miss("", f"{key}.modes: a dump does not contain them{whose}; identify finds them; {none}")
