"""Result of the import of a parameter dump as a machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby

from shapegcode.machine.machine import Machine
from shapegcode.results.json import hidden
from shapegcode.results.outcome import Xyz
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table
from shapegcode.settings.keys import toml

DEFAULT_WHY = "default of the machine file"
"""Reason of a value that is not in the dump and needed no decision."""
_SHOWN = 20

Value = bool | int | float | str | tuple[int, ...] | Xyz[float]
"""Value of a key of the machine file: one, or one per axis."""


@dataclass(frozen=True)
class ReadParameter:
    """A value of a dump and the key in which it is stored."""

    parameter: int  # number of the parameter
    axis: str  # "A1" ... of an axis, "S1" ... of a spindle, "L1" ... of a path; empty if the value has none
    raw: str  # the value as written, with its letter
    line: int  # line of the dump, from 1
    key: str  # dotted name in the machine file
    value: Value  # value of the key; may combine several values of the dump


@dataclass(frozen=True)
class ReadTable:
    """A table of offsets or variables of the control, and the key in which it is stored."""

    file: str  # name of the file
    first_line: int  # first line, from 1
    last_line: int  # last line
    key: str  # dotted name in the machine file
    count: int  # number of values in the key


@dataclass(frozen=True)
class AssumedValue:
    """An assumed value that is not in the dump."""

    key: str  # dotted name in the machine file, or the fact as text
    value: Value  # the assumed value
    why: str  # reason


@dataclass(frozen=True)
class MissingParameter:
    """A parameter that is missing, not understood or not used."""

    parameter: str  # number of the parameter; empty if it is not one parameter
    line: int | None  # line of the dump, from 1; None without a line
    why: str  # reason


@dataclass(frozen=True, repr=False, eq=False)
class ParameterImport(Result):
    """A control's parameter dump as a machine.

    Attributes:
        dump: name of the dump.
        machine: the machine described by the dump.
        read: values stored in keys, in the order of the keys.
        tables_read: keys from tables of offsets or variables.
        assumed: assumed values.
        missing: parameters missing in the dump, not understood or not used.
        remarks: text after the keys of the machine file: origin of each value.
        warnings: none; see `assumed` and `missing`.
    """

    dump: str
    machine: Machine = field(metadata=hidden())
    read: tuple[ReadParameter, ...]
    tables_read: tuple[ReadTable, ...]
    assumed: tuple[AssumedValue, ...]
    missing: tuple[MissingParameter, ...]
    remarks: Mapping[str, str] = field(metadata=hidden())
    warnings: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """True if anything was read: a machine consisting only of assumptions is useless."""
        return bool(self.read or self.tables_read)

    @property
    def answer(self) -> str:
        """Number of keys that were read from the parameter file, are inherited, or assumed."""
        if not self.ok:
            return f"{self.dump}: it has no parameter of motion or programs, so no machine file can be made"
        keys = len({row.key for row in self.read} | {row.key for row in self.tables_read})
        values = self.machine.values()
        here = {row.key for row in self.assumed}
        inherited = sum(v.origin == "inherited" for v in values)
        before = sum(v.assumed and v.key not in here and not v.remark.endswith("not measured") for v in values)
        already = f" (and {before} that were assumed in the machine of --from)" if before else ""
        return (
            f"{self.dump}: {keys} keys of {self.machine.name} read, {inherited} inherited, {len(self.assumed)} "
            f"assumed{already}; "
            f"{len(self.missing)} parameters missing, not understood or not used"
        )

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        return self._next_with("MACHINE")

    def _next_with(self, file: str) -> str:
        if not self.ok:
            return "punch the parameters out again (CNC-PARA.TXT, all of them), and import that."
        find = f"shapegcode identify TAP.csv --update {file}"
        if not any(axis.modes for axis in self.machine.axes.as_tuple()):
            return f"find the vibration modes, which a dump does not contain: {find}."
        axes = zip("xyz", self.machine.axes.as_tuple(), strict=True)
        open_axes = [letter for letter, axis in axes if not axis.modes and not axis.rigid]
        if open_axes:
            names = ", ".join(open_axes).upper()
            return f"tap {names}, whose modes are unknown: {find}."
        return "measure the assumed values: shapegcode characterize."

    def to_toml(self) -> str:
        """Text of the machine file, each value with its parameter."""
        return self.machine.to_toml(self.remarks)

    def tables(self, *, everything: bool = True) -> list[Table]:
        """Tables of values read, assumed and missing; only those with rows.

        Args:
            everything: one row per value, with its origin; else the keys by table of the file.

        Returns:
            The tables.
        """
        if not everything:
            return [table for table in (self._keys_by_table(), self._missing_numbers()) if table.rows]
        read = (
            Column("key", value=lambda rows: rows[0].key, left=True),
            Column("value", value=lambda rows: _shown(rows[0]), text=True),
            Column("from", value=_origins, text=True),
        )
        tables = (
            Column("key", left=True),
            Column("values", value="count"),
            Column("from", value=lambda row: f"{row.file}, lines {row.first_line} to {row.last_line}", text=True),
        )
        assumed = (Column("key", left=True), Column("value", value=_shown, text=True), Column("why", text=True))
        missing = (Column("parameter"), Column("line"), Column("why", text=True))
        found = [
            Table("read", read, [list(rows) for _, rows in groupby(self.read, key=lambda row: row.key)]),
            Table("read from tables", tables, self.tables_read),
            Table("assumed", assumed, self.assumed),
            Table("missing, not understood or not used", missing, self.missing),
        ]
        return [table for table in found if table.rows]

    def _keys_by_table(self) -> Table:
        """Keys by table of the machine file: those read, and those decided."""
        tables: dict[str, tuple[list[str], list[str]]] = {}
        decided = [row.key for row in self.assumed if row.why != DEFAULT_WHY]
        read = [*(row.key for row in self.read), *(row.key for row in self.tables_read)]
        for rank, keys in enumerate((read, decided)):
            for key in dict.fromkeys(keys):
                table, _, name = key.rpartition(".")
                tables.setdefault(table, ([], []))[rank].append(name)
        alike: dict[tuple[str, str], list[str]] = {}
        for table, (names, assumed) in tables.items():
            alike.setdefault((_first_of(names), _first_of(assumed)), []).append(f"[{table}]" if table else "")
        columns = (
            Column("table", value=lambda row: " ".join(row[1]), text=True),
            Column("read", value=lambda row: row[0][0], text=True),
            Column("assumed", value=lambda row: row[0][1], text=True),
        )
        defaults = len(self.assumed) - len(decided)
        more = f"{defaults} more are left at their defaults; " if defaults else ""
        return Table("", columns, list(alike.items()), caption=f"{more}--verbose: every value, its line, and why")

    def _missing_numbers(self) -> Table:
        """Missing parameters by reason, the first ones of many."""
        reasons: dict[str, list[str]] = {}
        for row in self.missing:
            reasons.setdefault("not in the dump" if row.line is None else "not understood or not used", []).append(
                row.parameter or row.why.partition(":")[0]
            )
        columns = (
            Column("parameters", value=lambda row: row[0], left=True),
            Column("numbers", value=lambda row: _first_of(row[1]), text=True),
        )
        return Table("", columns, list(reasons.items()))


def _first_of(names: Sequence[str]) -> str:
    shown = ", ".join(names[:_SHOWN])
    return shown if len(names) <= _SHOWN else f"{shown} and {len(names) - _SHOWN} more"


def _origins(rows: list[ReadParameter]) -> str:
    """Origin of the value of a key: "line 11: 1660 A1 P900.0 A2 P700.0"."""
    words = []
    for (number, line), group in groupby(rows, key=lambda row: (row.parameter, row.line)):
        words.append(f"line {line}: {number} " + " ".join(f"{row.axis} {row.raw}".strip() for row in group))
    return "; ".join(words)


def _shown(row: ReadParameter | AssumedValue) -> str:
    value = row.value
    if isinstance(value, Xyz):
        one = value.x == value.y == value.z
        return toml(value.x) if one else toml({axis: value[axis] for axis in "xyz"})
    return value if isinstance(value, str) else toml(value)
