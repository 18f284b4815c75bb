"""Text of a FANUC parameter dump (CNC-PARA.TXT) as records: which value stands for which axis, in which line.

Both grammars are read: ``N01420Q1A1P24000.0A2P24000.0`` (30i, 0i-D, 0i-F; the 15i leaves Q1 out) and
``N01825 A1 P 3000 A2 P 3000`` (16, 18, 21). Lines end in LF, CR-LF or LF-CR-CR.
"""

from __future__ import annotations

import re
from collections.abc import Container
from dataclasses import dataclass, field

from shapegcode.errors import MachineError, Problem

__all__ = ["Dump", "Entry", "read_dump"]

_NUMBER = r"[-+]?(?:\d{1,40}\.?\d{0,40}|\.\d{1,40})"
_RECORD = re.compile(r"N\s*(\d{1,6})\s*(Q\d+)?\s*(.*)", re.ASCII)
_VALUE = re.compile(rf"(?:([LAST])\s*(\d{{1,4}})\s*)?([PMI])\s*({_NUMBER})\s*", re.ASCII)
_VALUES = re.compile(rf"(?:(?:[LAST]\s*\d{{1,4}}\s*)?[PMI]\s*{_NUMBER}\s*)+", re.ASCII)


@dataclass(frozen=True)
class Entry:
    """One value of a dump.

    Attributes:
        number: parameter number.
        target: "A1", "S2", "L1", "T1", or empty where the value has no axis, spindle or path.
        letter: "P", or "M" and "I" for values in mm and inch.
        text: the value as it stands there.
        line: line number in the dump, from 1.
    """

    number: int
    target: str
    letter: str
    text: str
    line: int


@dataclass
class Dump:
    """The records of a dump.

    Attributes:
        file: its name.
        entries: first value of each (number, target).
        with_q: True where records carry Q1 (30i, 0i-D, 0i-F).
        complete: True where a ``%`` ends it.
        repeated: (number, line) of records that give a value again, for another path.
        strange: (line, text) of lines that are no records.
        records: how many records it has.
        others: parameters that were not wanted, with the line of the first record of each.
    """

    file: str
    entries: dict[tuple[int, str], Entry] = field(default_factory=dict)
    with_q: bool = False
    complete: bool = False
    repeated: list[tuple[int, int]] = field(default_factory=list)
    strange: list[tuple[int, str]] = field(default_factory=list)
    records: int = 0
    others: dict[int, int] = field(default_factory=dict)

    def get(self, number: int, axis: int | None = None) -> Entry | None:
        """The value of a parameter for an axis (1, 2, ...), or of the first path; None where the dump has none."""
        targets = ("", "L1") if axis is None else (f"A{axis}",)
        return next((self.entries[number, name] for name in targets if (number, name) in self.entries), None)


def read_dump(data: bytes, file: str, wanted: Container[int]) -> Dump:
    """Read the *wanted* parameters of a dump, and check the form of all; *file* names it in messages."""

    def bad(message: str, line: int | None = None) -> MachineError:
        return MachineError(file, (Problem("", "", message, line),))

    if b"\0" in data:
        raise bad("binary data, not a parameter dump", data[: data.index(b"\0")].count(b"\n") + 1)
    # Comments may hold the characters of any country; records are plain ASCII.
    text = data.decode("latin-1").removeprefix("ï»¿")
    dump = Dump(file)
    for line, raw in enumerate(text.split("\n" if "\n" in text else "\r"), start=1):
        words = raw.strip()
        if not words:
            continue
        if words.startswith("%"):
            if dump.records:
                dump.complete = True
                break
            continue
        if not words.startswith("N"):
            # What stands before the first record is a header.
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
