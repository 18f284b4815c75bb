"""A machine in words: its values with their origin, and its commented file, long and short."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic.fields import FieldInfo

from shapegcode.settings.keys import (
    InlineTable,
    KeyValue,
    TomlTable,
    facts,
    item_type,
    key_info,
    table_type,
    toml,
)  # fmt: skip
from shapegcode.settings.remarks import origin_lines, origin_of

_LINE_WIDTH = 110


def values_of(
    table: TomlTable, prefix: str = "", given: bool = True, remarks: Mapping[str, str] | None = None
) -> Iterator[KeyValue]:
    """Every key below a table with its value and origin, in the order of the file."""
    for name, field in type(table).model_fields.items():
        value, key = getattr(table, name), f"{prefix}{name}"
        from_file = given and name in table.model_fields_set
        if isinstance(value, TomlTable) and not isinstance(value, InlineTable):
            yield from values_of(value, f"{key}.", from_file, remarks)
        elif item_type(field) and value:
            for number, item in enumerate(value, start=1):
                yield from values_of(item, f"{key}.{number}.", from_file, remarks)
        else:
            info = key_info(field, key)
            remark = (remarks or {}).get(key, "")
            # A key without a value can have a remark that says why: "assumed: not limited", "not measured: rigid".
            says_why = not value and (value is not None or remark.startswith("assumed"))
            origin = origin_of(remark) if from_file or (remark and says_why) else "default"
            assumed = origin == "assumed" or (info.assumed and origin == "default")
            yield KeyValue(
                key=key,
                value="not set" if value is None else toml(value),
                unit=info.unit,
                origin=origin,
                assumed=assumed,
                meaning=info.meaning,
                fanuc=info.fanuc,
                remark=remark,
            )


def write_short_toml(machine: TomlTable, remarks: Mapping[str, str]) -> str:
    """A machine as a file of what differs from the defaults, or of which it is known where it comes from."""
    return _ShortWriter(dict(remarks)).write(machine)


_SHORT_HEAD = (
    "Machine file of shapegcode, the short form: what is not here has its default. `shapegcode machine show FILE` "
    "prints every value with its meaning; docs/reference/machine.md explains the keys."
)
_TOLD = ("measured", "dump")


def write_toml(machine: TomlTable, remarks: Mapping[str, str]) -> str:
    """A machine as a commented machine file."""
    return _TomlWriter(dict(remarks)).write(machine)


class _TomlWriter:
    """Writes a machine as commented TOML."""

    def __init__(self, remarks: dict[str, str]) -> None:
        self._remarks = remarks
        self._said: dict[str, str] = {}
        self._lines: list[str] = []

    def write(self, machine: TomlTable) -> str:
        self._lines = []
        self._comment(
            "Machine file of shapegcode. Keys and defaults: docs/reference/machine.md. A key that is left "
            "out has its default; `shapegcode machine show FILE` prints every value."
        )
        self._lines.append("")
        self._table(machine, "")
        if self._remarks:
            raise KeyError(f"remarks for unknown keys: {', '.join(sorted(self._remarks))}")
        return self._text()

    def _text(self) -> str:
        if said := origin_lines(self._said):
            self._lines += [*([""] if self._lines[-1] else []), *said]
        return "\n".join(self._lines).rstrip("\n") + "\n"

    def _add(self, line: str, key: str, remark: str) -> None:
        """A line, its remark as the comment behind it: for people, what counts is the table of the origins."""
        if remark:
            self._said[key] = remark
        self._lines.append(f"{line}  # {remark}" if remark else line)

    def _comment(self, text: str) -> None:
        self._lines += textwrap.wrap(
            text,
            _LINE_WIDTH,
            initial_indent="# ",
            subsequent_indent="# ",
            break_long_words=False,
            break_on_hyphens=False,
        )

    def _table(self, table: TomlTable, prefix: str) -> None:
        """Plain keys first, then the tables below, as TOML asks."""
        below: list[tuple[str, FieldInfo, Any]] = []
        for name, field in type(table).model_fields.items():
            value = getattr(table, name)
            if (isinstance(value, TomlTable) and not isinstance(value, InlineTable)) or item_type(field):
                below.append((name, field, value))
            else:
                self._plain(f"{prefix}{name}", name, field, value)
        for name, field, value in below:
            key = f"{prefix}{name}"
            if item := item_type(field):
                self._list(key, field, item, value)
                continue
            # A table of nothing but tables needs no head.
            if not all(table_type(inner) for inner in type(value).model_fields.values()):
                self._head(f"[{key}]", field.description or "")
            self._table(value, f"{key}.")

    def _head(self, header: str, meaning: str) -> None:
        if self._lines and self._lines[-1]:
            self._lines.append("")
        self._lines.append(f"{header}  # {meaning}" if meaning else header)

    def _plain(self, key: str, name: str, field: FieldInfo, value: object) -> None:
        info = key_info(field, key)
        meaning = info.meaning[:1].upper() + info.meaning[1:]
        unit = f" [{info.unit}]" if info.unit and info.unit != "1" else ""
        fanuc = f" (FANUC parameter {info.fanuc})" if info.fanuc else ""
        self._comment(f"{meaning}{unit}{fanuc}.")
        line = f"# {name} = ..." if value is None else f"{name} = {toml(value)}"
        self._add(line, key, self._remarks.pop(key, ""))

    def _list(self, key: str, field: FieldInfo, item: type[TomlTable], tables: tuple[TomlTable, ...]) -> None:
        if not tables:
            self._lines.append("")
            self._comment(f"{key}: {field.description}.")
            self._add(f"# [[{key}]]", key, self._remarks.pop(key, ""))
            self._lines += [f"# {name} = ..." for name, inner in item.model_fields.items() if inner.is_required()]
        for number, table in enumerate(tables, start=1):
            self._head(f"[[{key}]]", (item.__doc__ or "").rstrip(".") if number == 1 else "")
            self._table(table, f"{key}.{number}.")


class _ShortWriter(_TomlWriter):
    """Leaves out what a reader would have anyway."""

    def write(self, machine: TomlTable) -> str:
        self._lines = []
        self._comment(_SHORT_HEAD)
        self._lines.append("")
        self._table(machine, "")
        return self._text()

    def _table(self, table: TomlTable, prefix: str) -> None:
        """Head and keys of a table alone where something is left of it."""
        below: list[tuple[str, FieldInfo, Any]] = []
        for name, field in type(table).model_fields.items():
            value = getattr(table, name)
            if (isinstance(value, TomlTable) and not isinstance(value, InlineTable)) or item_type(field):
                below.append((f"{prefix}{name}", field, value))
            elif self._is_told(f"{prefix}{name}", table, name, field):
                line = f"# {name} = ..." if value is None else f"{name} = {toml(value)}"
                self._add(line, f"{prefix}{name}", self._remarks.get(f"{prefix}{name}", ""))
        for key, field, value in below:
            if item_type(field):
                self._short_list(key, value)
            elif value is not None:
                self._short_table(f"[{key}]", value, f"{key}.")

    def _short_table(self, head: str, table: TomlTable, prefix: str) -> None:
        before = list(self._lines)
        self._head(head, "")
        headed = len(self._lines)
        self._table(table, prefix)
        if len(self._lines) == headed:
            self._lines = before
        elif self._lines[headed] == "":
            # Nothing but tables of its own.
            self._lines = [*before, *self._lines[headed:]]

    def _short_list(self, key: str, tables: tuple[TomlTable, ...]) -> None:
        remark = self._remarks.get(key, "")
        if not tables and remark:
            self._add(f"# [[{key}]]", key, remark)
        for number, table in enumerate(tables, start=1):
            self._short_table(f"[[{key}]]", table, f"{key}.{number}.")

    def _is_told(self, key: str, table: TomlTable, name: str, field: FieldInfo) -> bool:
        """Whether the file must hold it, or holds it with a word of where it comes from."""
        value = getattr(table, name)
        if field.is_required():
            return True
        remark, assumed = self._remarks.get(key, ""), bool(facts(field).get("assumed"))
        origin = origin_of(remark)
        # What equals the default goes where nothing is lost: an assumption whose default is marked as one, a statement
        # without a word of where it comes from whose default is not.
        told = {"assumed": not assumed, "inherited": not assumed, "file": bool(remark) or assumed}.get(
            origin, origin in _TOLD
        )
        if value is None:
            return self._remarks.get(key, "").startswith("assumed")
        return name in table.model_fields_set and (told or value != field.get_default(call_default_factory=True))
