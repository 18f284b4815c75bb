"""Reads tables of run logs: a header with a time and other items, one row per instant."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from shapegcode.errors import RecordError
from shapegcode.io.columns import Label, Meaning, read_label
from shapegcode.io.layout import cells_of, head_of, is_number, line_chunks, without_thousands
from shapegcode.io.run_items import Event, FileNotes, Item, ItemTable, Stamps
from shapegcode.io.units import Measured, factor_between

_DELIMITERS = ("\t", ";", ",", "|")
_HEAD_LINES = 400
_LATEST_S = 1e12
_MEASURES: dict[str, Measured] = {
    "time": "time", "feed": "velocity", "x": "displacement", "y": "displacement", "z": "displacement",
}  # fmt: skip
_TEXTS = ("status", "program", "block_text")


@dataclass(frozen=True)
class _UsedColumn:
    index: int
    item: Item
    factor: float = 1.0


@dataclass
class _Header:
    """The used columns."""

    line: int
    delimiter: str
    cells: int
    time: _UsedColumn
    columns: list[_UsedColumn]
    feed_unit: str | None
    time_unit: str | None


def table_events(path: Path, table: ItemTable, notes: FileNotes) -> Iterator[Event]:
    """Yield the values of the used columns."""
    header = _header(path, table)
    notes.feed_unit = header.feed_unit
    stamps = Stamps()
    number, readable = 0, False
    for lines in line_chunks(path):
        for number, line in enumerate(lines, start=number + 1):  # noqa: B020  (goes on over the chunks)
            if number <= header.line or not line.strip() or line.startswith(b"#"):
                continue
            text = line.decode("utf-8", errors="replace").replace("\r", " ")
            try:
                cells = cells_of(text, header.delimiter)
            except csv.Error as error:
                notes.add("row", number, f"{error}; the row is ignored")
                continue
            try:
                stamp, time = _time(cells, header, stamps)
            except (ValueError, IndexError):
                shown = cells[header.time.index] if header.time.index < len(cells) else ""
                if not readable:
                    raise RecordError(
                        f"{path}:{number}: {header.time.item.name} is {shown[:40]!r}: must be a number or a time "
                        "such as 2017-02-10T18:33:01.138Z"
                    ) from None
                notes.add("stamp", number, f"{header.time.item.name} is {shown[:40]!r}, not a time; the row is ignored")
                continue
            if not readable and header.time_unit is None and is_number(cells[header.time.index], True):
                notes.add("time unit", header.line, f"{header.time.item.name} has no unit: s is assumed")
            readable = True
            if any(cells[header.cells :]):
                hint = "; decimal commas need another delimiter" if header.delimiter == "," else ""
                raise RecordError(f"{path}:{number}: {len(cells)} cells, the header has {header.cells}{hint}")
            if len(cells) < header.cells:
                notes.add("short", number, f"{len(cells)} cells of {header.cells}")
            for column in header.columns:
                if column.index < len(cells):
                    cell = cells[column.index]
                    if column.item.role not in _TEXTS:
                        cell = _point(cell)
                        if column.factor != 1.0 and is_number(cell, False):
                            cell = repr(float(cell) * column.factor)
                    yield number, time, stamp, column.item, cell.encode()


def _time(cells: list[str], header: _Header, stamps: Stamps) -> tuple[bytes, float]:
    cell = cells[header.time.index]
    if is_number(cell, True) or is_number(cell, False):
        time = float(_point(cell)) * header.time.factor
        if header.time_unit is None:
            return cell.encode(), stamps.seconds(_point(cell).encode())
        if not abs(time) < _LATEST_S:
            raise ValueError(f"{time:g} s")
        return cell.encode(), time
    return cell.encode(), stamps.seconds(cell.encode())


def _point(cell: str) -> str:
    """Replace a decimal comma by a point."""
    return without_thousands(cell.encode()).decode().replace(",", ".") if "," in cell else cell


def _header(path: Path, table: ItemTable) -> _Header:
    lines = head_of(path).split(b"\n")[:_HEAD_LINES]
    found: list[str] = []
    for number, line in enumerate(lines, start=1):
        text = line.decode("utf-8", errors="replace").strip().lstrip("#").strip()
        for delimiter in _DELIMITERS:
            try:
                cells = cells_of(text, delimiter)
            except csv.Error:
                continue
            items = [_label(cell, table) for cell in cells]
            roles = [item.role for item, _ in items if item is not None]
            if "time" in roles and {"block", "sequence", "block_text"} & set(roles):
                return _columns(path, number, delimiter, items)
            if len(cells) > 1 and not found and not any(is_number(cell, True) for cell in cells):
                found = cells
    raise RecordError(
        f"{path}:1: no header with a time ({table.sought('time')}) and line numbers ({table.sought('block')}) among "
        f"the first {len(lines)} lines; the first candidate has {', '.join(found[:20]) or 'no names'}; specify "
        'them, for example items = { time = "Zeit", block = "Satz" }'
    )


def _label(cell: str, table: ItemTable) -> tuple[Item | None, Label]:
    """Item of a column, with its label."""

    def names(name: str) -> Meaning | None:
        item = table.find(name)
        return None if item is None else Meaning(item.role, _MEASURES.get(item.role, "response"))

    whole = table.find(cell)
    label = read_label(cell, "", names)
    if whole is not None and label.unit is None:
        return whole, label
    if label.meaning is None:
        return None, label
    role = label.meaning.what
    return Item(cell, role, 0), label  # type: ignore[arg-type]


def _columns(path: Path, number: int, delimiter: str, items: list[tuple[Item | None, Label]]) -> _Header:
    columns: list[_UsedColumn] = []
    time: _UsedColumn | None = None
    feed_unit = time_unit = None
    for index, (item, label) in enumerate(items):
        if item is None:
            continue
        measures = _MEASURES.get(item.role)
        if measures is not None and label.unit is not None and label.unit.measures != measures:
            raise RecordError(
                f"{path}:{number}: {label.text!r} has the unit {label.unit.name} of {label.unit.measures}: must be one "
                f"of {measures}"
            )
        if measures is not None and label.unit is None and label.unknown_unit:
            raise RecordError(f"{path}:{number}: {label.text!r}: the unit {label.unknown_unit!r} is not known")
        if item.role == "time":
            time_unit = label.unit.name if label.unit is not None else time_unit
            time = time or _UsedColumn(index, item, label.unit.factor if label.unit is not None else 1.0)
            continue
        if item.role == "feed" and label.unit is not None:
            feed_unit = label.unit.name
        length = measures == "displacement" and label.unit is not None
        columns.append(_UsedColumn(index, item, factor_between(label.unit, "mm") if length and label.unit else 1.0))
    assert time is not None
    columns.sort(key=lambda column: column.item.role == "status")  # status last: a run's last row belongs to it
    return _Header(number, delimiter, len(items), time, columns, feed_unit, time_unit)
