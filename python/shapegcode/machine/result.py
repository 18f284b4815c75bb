"""Results on machines: import of a parameter dump; values with unit, origin and meaning; two machines compared."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import TypeVar

from shapegcode.machine.machine import Machine
from shapegcode.results.json import OldNames, hidden
from shapegcode.results.outcome import Xyz
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table
from shapegcode.settings.keys import KeyValue, toml

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
    """A value that is not in the dump, or is derived from it with an assumption."""

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
        read: values stored in keys, grouped by key.
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
        return self._next_after("MACHINE")

    def _next_after(self, file: str) -> str:
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
        """Keys by table of the machine file: those read, and those assumed, without those left at their defaults."""
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
        """Missing parameters by reason, the first 20 of each."""
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


_RANKED = 8
_Keyed = TypeVar("_Keyed", "KeyValue", "DifferentValue")


@dataclass(frozen=True)
class OpenValue(OldNames):
    """A value that was not measured on the machine, and its effect on a program."""

    key: str  # dotted name
    value: str  # as in the file, with its unit
    origin: str  # "assumed", "inherited" or "default"
    tested_value: str = ""  # the changed value, as text; empty: not tested
    effect: str = ""  # its largest effect on a figure, as text; empty: not tested
    share: float | None = None  # change of the figure relative to its limit; None: not tested


@dataclass(frozen=True, repr=False, eq=False)
class MachineDescription(Result):
    """Every value of a machine with its unit, origin and meaning.

    Attributes:
        machine: the tables of the machine file, with defaults.
        keys: every value by its dotted key, in the order of the file.
        warnings: origins that were read from comments, as in older files; remarks on the ranking.
        program: program for which the unverified values were ranked; None: not ranked.
        matters: unverified values that change a figure of its verdict, largest effect first.
        source: file of the machine, or its name, if known.
    """

    machine: Mapping[str, object]
    keys: Mapping[str, KeyValue]
    warnings: tuple[str, ...] = ()
    program: str | None = None
    matters: tuple[OpenValue, ...] = ()
    source: str = "MACHINE"

    @property
    def answer(self) -> str:
        """Number of unverified values; for a program, also how many matter, and which one most."""
        name, count = self.machine["name"], len(self._open())
        if self.program is None:
            if not count:
                return f"{name}: every value is set"
            sentence = f"{count} of {len(self.keys)} values are assumed or inherited"
            return f"{name}: {sentence}; --for part.nc ranks them by their effect on your program"
        if not self.matters:
            return f"{name}: none of {count} unverified parameters matters for {Path(self.program).name}"
        first = self.matters[0]
        return (
            f"{name}: {len(self.matters)} of {count} unverified parameters matter for "
            f"{Path(self.program).name}, most of all {first.key} ({first.effect})"
        )

    def _open(self) -> list[KeyValue]:
        return [value for value in self.keys.values() if value.unmeasured]

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        if self.matters:
            key = self.matters[0].key
            how = "`shapegcode identify --tap-plan`" if ".modes" in key else "docs/howto/characterize.md"
            return f"measure {key} first: {how} explains how."
        if self._open() and self.program is None:
            return f"`shapegcode machine show {self.source} --for part.nc` ranks them by their effect on your program."
        return f"use it: shapegcode convert IN -m {self.source} -o OUT."

    def tables(self, *, everything: bool = True) -> list[Table]:
        """Tables of the unverified values and of the keys, grouped by table of the file.

        Args:
            everything: all keys; False: with a program, only the most important values.

        Returns:
            The tables.
        """
        if self.program is not None and not everything:
            return self._ranking(_RANKED)
        rows = list(_by_table(self.keys.values()))
        heads = [rank for rank, row in enumerate(rows) if isinstance(row, str)]
        columns = (
            _KEY,
            Column("value", value=_with_unit, text=True),
            Column("origin", value=_origin, left=True, priority=2),
            Column("meaning", value=lambda row: getattr(row, "meaning", None), text=True),
        )
        counts = Counter(_origin(value) or "" for value in self.keys.values())
        summary = (Column("origin", value=lambda row: row[0], left=True), Column("keys", value=lambda row: row[1]))
        return [
            *self._ranking(),
            Table("", columns, rows, sections=heads, row_style=_bold),
            Table("origins", summary, counts.most_common()),
        ]

    def _ranking(self, limit: int | None = None) -> list[Table]:
        """Unverified values: with a program those that matter, largest effect first; else all, by table of the file."""
        if self.program is not None:
            columns = (
                Column("matters most", value="key", left=True),
                Column(
                    "assumed value → tested value",
                    value=lambda row: f"{row.value} {row.origin} → {row.tested_value}",
                    text=True,
                ),
                Column("then, µm", value="effect", text=True),
            )
            left_out = len(self.matters[limit:]) if limit is not None else 0
            more = f"{left_out} more matter less; " if left_out else ""
            caption = f"{more}--verbose: every value of the machine" if limit is not None else ""
            return [Table("", columns, self.matters[:limit], caption=caption)] if self.matters else []
        tables: dict[str, list[str]] = {}
        for value in self._open():
            tables.setdefault(value.key.rpartition(".")[0], []).append(_last(value.key))
        listed = [(f"[{table}]", ", ".join(names)) for table, names in tables.items()]
        by_table = (
            Column("assumed in", value=lambda row: row[0], left=True),
            Column("keys", value=lambda row: row[1], text=True),
        )
        return [Table("", by_table, listed)] if listed else []


def _by_table(values: Iterable[_Keyed]) -> Iterator[str | _Keyed]:
    """Yield values, with the name of each table before its first value."""
    for table, rows in groupby(values, key=lambda value: value.key.rpartition(".")[0]):
        yield from [table] if table else []
        yield from rows


def _last(key: str) -> str:
    return key.rpartition(".")[2]


_KEY = Column("key", value=lambda row: f"[{row}]" if isinstance(row, str) else _last(row.key), left=True)


def _bold(row: object) -> str:
    return "bold" if isinstance(row, str) else ""


def _with_unit(row: str | KeyValue) -> str | None:
    if isinstance(row, str):
        return None
    return f"{row.value} {row.unit}" if row.unit not in ("", "1") and row.value != "not set" else row.value


def _origin(row: str | KeyValue) -> str | None:
    return None if isinstance(row, str) else "assumed" if row.assumed else row.origin


def describe_machine(machine: Machine | str | Path) -> MachineDescription:
    """List every value of a machine with its unit, origin and meaning.

    Args:
        machine: a machine, its file, or the name of a built-in one.

    Returns:
        The values with their units and meanings.

    Raises:
        MachineError: the file is not TOML or has wrong keys or values; every problem is listed.
        OSError: the file cannot be read.
    """
    loaded = Machine.of(machine)
    keys = {value.key: value for value in loaded.values()}
    warnings = (loaded.origin_warning,) if loaded.origin_warning else ()
    return MachineDescription(loaded.model_dump(mode="json"), keys, warnings)


_NONE = "-"


@dataclass(frozen=True)
class DifferentValue:
    """A key with different values in two machines."""

    key: str  # dotted name
    unit: str  # of the values; "1" for a ratio
    first: str  # value of the first machine, as TOML; "-": it has no such key
    second: str  # value of the second machine, likewise
    first_origin: str  # origin, see `shapegcode machine show`
    second_origin: str  # origin in the second machine
    meaning: str  # meaning of the key


@dataclass(frozen=True, repr=False, eq=False)
class MachineDifference(Result):
    """Differences between two machines; origins are not compared.

    Attributes:
        first: name or file of the first machine.
        second: name or file of the second machine.
        keys: number of compared keys.
        different: differing keys, in the order of the reference of the machine file.
        warnings: none.
    """

    first: str
    second: str
    keys: int
    different: tuple[DifferentValue, ...]
    warnings: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """True if they have the same values."""
        return not self.different

    @property
    def answer(self) -> str:
        """Number of differing keys."""
        if self.ok:
            return f"{self.first} and {self.second}: all {self.keys} values are the same"
        return f"{self.first} and {self.second}: {len(self.different)} of {self.keys} values differ"

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        if self.ok:
            return "nothing: converted programs are the same for both."
        return f"`shapegcode machine show {self.second}` explains each key."

    def tables(self) -> list[Table]:
        """The keys that differ, grouped by table of the file."""
        rows = list(_by_table(self.different))
        columns = (
            _KEY,
            Column(Path(self.first).name, value=lambda row: _of_one(row, "first"), text=True),
            Column(Path(self.second).name, value=lambda row: _of_one(row, "second"), text=True),
        )
        return [Table("", columns, rows, row_style=_bold)] if rows else []


def _of_one(row: str | DifferentValue, which: str) -> str | None:
    """A value with unit and origin; *which*: "first" or "second"."""
    if isinstance(row, str):
        return None
    value, origin = getattr(row, which), getattr(row, f"{which}_origin")
    unit = "" if row.unit in ("", "1") or value in (_NONE, "not set") else f" {row.unit}"
    return value if value == _NONE else f"{value}{unit} ({origin})"


def machine_difference(first: Machine | str | Path, second: Machine | str | Path) -> MachineDifference:
    """Compare two machines, defaults included.

    Args:
        first: a machine, its file, or the name of a built-in one.
        second: the machine to compare with it, in any of these forms.

    Returns:
        The differences.

    Raises:
        MachineError: a file is not TOML or has wrong keys or values; every problem is listed.
        OSError: a file cannot be read.
    """
    machines = [Machine.of(each) for each in (first, second)]
    names = [each.name if isinstance(each, Machine) else str(each) for each in (first, second)]
    ours, theirs = ({value.key: value for value in machine.values()} for machine in machines)
    keys = list(dict.fromkeys([*ours, *theirs]))
    return MachineDifference(names[0], names[1], len(keys), tuple(_different(keys, ours, theirs)))


def _different(keys: list[str], ours: dict[str, KeyValue], theirs: dict[str, KeyValue]) -> Iterator[DifferentValue]:
    for key in keys:
        both = [ours.get(key), theirs.get(key)]
        first, second = (_NONE if each is None else each.value for each in both)
        if first == second or {first, second} == {_NONE, "not set"}:
            continue  # equal, or missing in both
        origin, other_origin = (_NONE if each is None else _origin(each) or "" for each in both)
        known = both[0] or both[1]
        assert known is not None
        yield DifferentValue(key, known.unit, first, second, origin, other_origin, known.meaning)
