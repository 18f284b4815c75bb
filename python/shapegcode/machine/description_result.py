"""Every value of a machine with unit, origin and meaning; those nobody measured; what differs between two machines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TypeVar

from shapegcode.machine.machine import Machine
from shapegcode.results.json import OldNames
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table
from shapegcode.settings.keys import KeyValue

_RANKED = 8
_Keyed = TypeVar("_Keyed", "KeyValue", "DifferentValue")


@dataclass(frozen=True)
class OpenValue(OldNames):
    """A value that was not measured on the machine, and what it would do to a program."""

    key: str  # dotted name
    value: str  # as it stands in the file, with its unit
    origin: str  # "assumed", "inherited" or "default"
    tested_value: str = ""  # the changed value, in words; empty: it was not tried
    effect: str = ""  # what that does to the figure that it takes furthest, in words; empty: it was not tried
    share: float | None = None  # how far the figure goes, of its limit; None: it was not tried


@dataclass(frozen=True, repr=False, eq=False)
class MachineDescription(Result):
    """Every value of a machine with its unit, origin and meaning.

    Attributes:
        machine: the tables of the machine file, defaults as well.
        keys: every value by its dotted key, in the order of the file.
        warnings: that its origins are read from comments, as older files have them.
        program: for which the values that were not measured were ranked; None: for none.
        matters: those of them that move its verdict, the furthest first.
        source: file of the machine, or its name, where that is known.
    """

    machine: Mapping[str, object]
    keys: Mapping[str, KeyValue]
    warnings: tuple[str, ...] = ()
    program: str | None = None
    matters: tuple[OpenValue, ...] = ()
    source: str = "MACHINE"

    @property
    def ok(self) -> bool:
        """Whether the machine can be used: always, as one that cannot is refused."""
        return True

    @property
    def answer(self) -> str:
        """How much of it nobody measured, and which of that matters most."""
        name, count = self.machine["name"], len(self._open())
        if self.program is None:
            if not count:
                return f"{name}: every value is stated"
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
            return f"measure {key} first: {how} says how."
        if self._open() and self.program is None:
            return f"`shapegcode machine show {self.source} --for part.nc` ranks them by their effect on your program."
        return f"use it: shapegcode convert IN -m {self.source} -o OUT."

    def tables(self, *, everything: bool = True) -> list[Table]:
        """What nobody measured, and the keys, those of one table of the file below its name.

        Args:
            everything: all keys; else, for a program, the values that matter most for it and no others.

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
        """What nobody measured: for a program those values that matter, the furthest first; else all by table."""
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
    """Values with the name of their table before the first one of each."""
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
    """Every value of a machine: from the file, a default, or a default that is an assumption.

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
    """A key that two machines do not have alike."""

    key: str  # dotted name
    unit: str  # of the values; "1" for a ratio
    first: str  # value of the first machine, as TOML; "-": it has no such key
    second: str  # of the second
    first_origin: str  # where it comes from; see `shapegcode machine show`
    second_origin: str  # likewise
    meaning: str  # what it is


@dataclass(frozen=True, repr=False, eq=False)
class MachineDifference(Result):
    """What differs between two machines; where values come from does not count.

    Attributes:
        first: name or file of the first machine.
        second: of the second.
        keys: how many keys were compared.
        different: those that differ, in the order of the file.
        warnings: none.
    """

    first: str
    second: str
    keys: int
    different: tuple[DifferentValue, ...]
    warnings: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether they have the same values."""
        return not self.different

    @property
    def answer(self) -> str:
        """How many keys differ."""
        if self.ok:
            return f"{self.first} and {self.second}: all {self.keys} values are the same"
        return f"{self.first} and {self.second}: {len(self.different)} of {self.keys} values differ"

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        if self.ok:
            return "nothing: programs come out the same on both."
        return f"`shapegcode machine show {self.second}` explains each key."

    def tables(self) -> list[Table]:
        """The keys that differ, grouped by table of the file."""
        rows = list(_by_table(self.different))
        columns = (
            _KEY,
            Column(Path(self.first).name, value=lambda row: _shown(row, "first"), text=True),
            Column(Path(self.second).name, value=lambda row: _shown(row, "second"), text=True),
        )
        return [Table("", columns, rows, row_style=_bold)] if rows else []


def _shown(row: str | DifferentValue, which: str) -> str | None:
    """A value with its unit, and where it comes from; `which`: "first" or "second"."""
    if isinstance(row, str):
        return None
    value, origin = getattr(row, which), getattr(row, f"{which}_origin")
    unit = "" if row.unit in ("", "1") or value in (_NONE, "not set") else f" {row.unit}"
    return value if value == _NONE else f"{value}{unit} ({origin})"


def machine_difference(first: Machine | str | Path, second: Machine | str | Path) -> MachineDifference:
    """Compare two machines, defaults included.

    Args:
        first: a machine, its file, or the name of a built-in one.
        second: likewise.

    Returns:
        What differs.

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
            continue  # they have the same, or neither has it
        origin, other_origin = (_NONE if each is None else _origin(each) or "" for each in both)
        known = both[0] or both[1]
        assert known is not None
        yield DifferentValue(key, known.unit, first, second, origin, other_origin, known.meaning)
