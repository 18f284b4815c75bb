"""How two machines differ, key by key."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from shapegcode.machine.machine import Machine
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table
from shapegcode.settings.keys import KeyValue

__all__ = ["DifferentValue", "MachineDifference", "machine_difference"]

_NONE = "-"


@dataclass(frozen=True)
class DifferentValue:
    """A key that two machines do not have alike.

    Attributes:
        key: dotted name.
        unit: of the values; "1" for a ratio.
        first: value of the first machine, as TOML; "-": it has no such key.
        second: of the second.
        first_origin: where it comes from; see `shapegcode machine show`.
        second_origin: likewise.
        meaning: what it is.
    """

    key: str
    unit: str
    first: str
    second: str
    first_origin: str
    second_origin: str
    meaning: str


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
        return f"`shapegcode machine show {self.second}` says what each key means."

    def tables(self) -> list[Table]:
        """The keys that differ, those of one table of the file below its name."""
        rows: list[str | DifferentValue] = []
        section = ""
        for each in self.different:
            table = each.key.rpartition(".")[0]
            if table != section:
                rows.append(section := table)
            rows.append(each)
        columns = (
            Column("key", value=lambda row: f"[{row}]" if isinstance(row, str) else _last(row), left=True),
            Column(Path(self.first).name, value=lambda row: _shown(row, "first"), text=True),
            Column(Path(self.second).name, value=lambda row: _shown(row, "second"), text=True),
        )
        return [Table("", columns, rows, row_style=_bold)] if rows else []


def _last(row: DifferentValue) -> str:
    return row.key.rpartition(".")[2]


def _bold(row: str | DifferentValue) -> str:
    return "bold" if isinstance(row, str) else ""


def _shown(row: str | DifferentValue, which: Literal["first", "second"]) -> str | None:
    """A value with its unit, and where it comes from."""
    if isinstance(row, str):
        return None
    value = row.first if which == "first" else row.second
    origin = row.first_origin if which == "first" else row.second_origin
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
    machines = [each if isinstance(each, Machine) else Machine.load(each) for each in (first, second)]
    names = [each.name if isinstance(each, Machine) else str(each) for each in (first, second)]
    ours, theirs = ({value.key: value for value in machine.values()} for machine in machines)
    keys = list(dict.fromkeys([*ours, *theirs]))
    return MachineDifference(names[0], names[1], len(keys), tuple(_different(keys, ours, theirs)))


def _different(keys: list[str], ours: dict[str, KeyValue], theirs: dict[str, KeyValue]) -> Iterator[DifferentValue]:
    for key in keys:
        own, other = ours.get(key), theirs.get(key)
        if own is not None and other is not None and own.value == other.value:
            continue
        if {None if each is None else each.value for each in (own, other)} == {None, "not set"}:
            continue  # neither has it
        known = own or other
        assert known is not None
        yield DifferentValue(
            key,
            known.unit,
            _NONE if own is None else own.value,
            _NONE if other is None else other.value,
            _NONE if own is None else "assumed" if own.assumed else own.origin,
            _NONE if other is None else "assumed" if other.assumed else other.origin,
            known.meaning,
        )
