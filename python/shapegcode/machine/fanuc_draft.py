"""A machine file in preparation: its tables, and the origin of each value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from shapegcode.errors import ArgumentError, Problem
from shapegcode.machine.axes import check_axes
from shapegcode.machine.fanuc_dump import Dump, DumpValues
from shapegcode.machine.machine import Machine
from shapegcode.machine.result import AssumedValue, MissingParameter, ReadParameter, ReadTable, Value
from shapegcode.results.outcome import Xyz


class Draft:
    """Tables of a machine file, filled from the records of a dump."""

    def __init__(self, dump: Dump, data: dict[str, Any]) -> None:
        self.dump = dump  # the records
        self.values = DumpValues(dump)  # the same as numbers and bits
        self.data = data  # tables of the machine file
        self.read: list[ReadParameter] = []  # every value of the dump that was stored in a key
        self.tables: list[ReadTable] = []  # tables of offsets and variables that were stored in keys
        self.assumed: list[AssumedValue] = []  # assumed values
        self.missing: list[MissingParameter] = []
        self.remarks: dict[str, str] = {}  # origin of the value by dotted key

    def problem(self, number: int, message: str) -> None:
        """Report a parameter that makes the dump useless, with its line."""
        line = next((entry.line for (n, _), entry in self.dump.entries.items() if n == number), None)
        self.values.problems.append(Problem(f"parameter {number}", "", message, line))

    def miss(self, number: int | str, why: str, line: int | None = None) -> None:
        """Note a parameter that is missing or has no effect."""
        if line is None and isinstance(number, int):
            entry = self.dump.get(number) or next(iter(self.values.entries(number)), None)
            line = entry.line if entry else None
        self.missing.append(MissingParameter(str(number), line, why))

    def assume(self, key: str, value: Value, why: str) -> None:
        """Note an assumed value; it is in the machine already, or in no key."""
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
            axes = self.values.axes if axis is None else (axis,)
            entries = [entry for a in axes if (entry := self.dump.get(number, a))]
            path = self.dump.get(number)
            for entry in entries or ([path] if path else []):
                self.read.append(ReadParameter(number, entry.target, entry.letter + entry.text, entry.line, key, shown))

    def choose(self, key: str, number: int, bit: int, on: Value = True, off: Value = False) -> bool | None:
        """Put one of two values into the machine by a bit of the dump; do nothing and return None without it."""
        found = self.values.bit(number, bit)
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
                raise ArgumentError(f"{axis.upper()}: {base.name if base else 'no base machine'} has no mode to keep")
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
