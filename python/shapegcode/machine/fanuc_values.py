"""Values of a parameter dump: whole numbers and bits, per axis or not, each within its limits."""

from __future__ import annotations

from shapegcode.errors import Problem
from shapegcode.machine.fanuc_dump import Dump, Entry

__all__ = ["LONGEST_MS", "MM_PER_INCH", "DumpValues"]

LONGEST_MS = 10_000.0
_LARGEST = 1e7
MM_PER_INCH = 25.4


class DumpValues:
    """Takes values out of a dump.

    Attributes:
        dump: the records.
        axes: numbers of the axes X, Y, Z in the dump.
        problems: values that cannot be; whoever takes values looks at them at the end.
        differing: parameters without axes whose values differ between the axes, with the one that counts.
    """

    def __init__(self, dump: Dump) -> None:
        self.dump = dump
        self.axes = (1, 2, 3)
        self.problems: list[Problem] = []
        self.differing: list[tuple[int, float]] = []

    def scalar(self, number: int, high: float = _LARGEST, unit: str = "", low: float = 0.0) -> float | None:
        """A parameter without axes; where the dump gives it per axis, the largest of X, Y, Z."""
        entry = self.dump.get(number)
        if entry is not None:
            return self._number(entry, low, high, unit)
        values = [self._number(each, low, high, unit) for each in self.entries(number)]
        if values and min(values) != max(values):
            self.differing.append((number, max(values)))
        return max(values, default=None)

    def per_axis(self, number: int, high: float = _LARGEST, unit: str = "", low: float = 0.0) -> list[float] | None:
        """The values of X, Y, Z; one without an axis stands for all three. None where the dump lacks one."""
        entries = self.entries(number)
        if len(entries) < 3:
            one = self.dump.get(number)
            return [self._number(one, low, high, unit)] * 3 if one else None
        return [self._number(entry, low, high, unit) for entry in entries]

    def entries(self, number: int) -> list[Entry]:
        """What the dump has of a parameter for X, Y and Z, in this order."""
        found = (self.dump.get(number, axis) for axis in self.axes)
        return [entry for entry in found if entry is not None]

    def bit(self, number: int, bit: int) -> bool | None:
        """A bit of a parameter, counted from the right; None where the dump has none."""
        entry = self.dump.get(number) or next(iter(self.entries(number)), None)
        return None if entry is None else self.bit_of(entry, bit)

    def bit_of(self, entry: Entry, bit: int) -> bool | None:
        """A bit of a value, counted from the right; None, and a problem, where it is no eight bits."""
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
