"""Reads logs of program runs: line numbers, feed, tool, overrides over time.

>>> for run in iter_run_logs("monday.txt.gz"):
...     print(run.start, run.program, run.duration_s)

Formats: SHDR text and MTConnect streams (`mtconnect`), Sinumerik Edge (`edge_json`), and tables, which are read here: a
header with a time and other items, one row per instant. A reader yields the events of a file, which `runs.RunCutter`
splits into runs; that of Sinumerik Edge yields the run itself. Item names are in `run_items`.
"""

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from shapegcode.errors import RecordError
from shapegcode.io.edge_json import edge_runs
from shapegcode.io.mtconnect import mtconnect_events, shdr_events
from shapegcode.io.run_items import Event, FileNotes, Item, ItemTable, Stamps, stated_feed_unit
from shapegcode.io.runs import RunCutter, RunLog
from shapegcode.io.table import cells_of, head_of, is_number, line_chunks, with_point
from shapegcode.io.units import Label, Meaning, Measured, factor_between, read_label

LogFormat = Literal["shdr", "mtconnect", "edge", "csv"]

MAX_VALUES = 4_000_000  # values of one run: 10 hours at 100 per second; about 60 MB
_SHORTEST_NAME = 4  # of a name that may lack its prefix: PLATE-12 is NIST_PLATE-12; OP2 may not be BOX_OP2
_TABLE_LINES = 100
_SHDR_LINE = re.compile(rb"[^|\r\n]*\d[^|\r\n]*\|[^|\r\n]+\|")


def read_run_logs(
    path: str | Path,
    *,
    items: Mapping[str, str] | None = None,
    format: LogFormat | None = None,
    program_name: str | Sequence[str] | None = None,
    feed_unit: str | None = None,
    max_values: int = MAX_VALUES,
) -> tuple[RunLog, ...]:
    """Read all runs of a log.

    Args:
        path: path of the file, plain or gzip: SHDR text, MTConnect streams, Sinumerik Edge JSON, or a table.
        items: item names in the file by role (`run_items.ROLES`), which override the known names:
            ``{"block": "Block_Number"}``.
        format: format of the file; None: by its content.
        program_name: only runs with this program name, or without a name; several: its possible names.
        feed_unit: unit of the feed, if the log does not state it: "mm/s", "mm/min", "inch/min" ...
        max_values: limit of values per run.

    Returns:
        The runs in order.

    Raises:
        RecordError: not a log, or without usable data; the message gives file and line, what was found and what is
            needed.
        OSError: the file cannot be read.
    """
    return tuple(
        iter_run_logs(
            path, items=items, format=format, program_name=program_name, feed_unit=feed_unit, max_values=max_values
        )
    )


def iter_run_logs(
    path: str | Path,
    *,
    items: Mapping[str, str] | None = None,
    format: LogFormat | None = None,
    program_name: str | Sequence[str] | None = None,
    feed_unit: str | None = None,
    max_values: int = MAX_VALUES,
) -> Iterator[RunLog]:
    """Yield the runs of a log one by one; memory is that of the longest run, however long the log.

    Args:
        path: path of the file, as in `read_run_logs`.
        items: item names by role.
        format: format of the file.
        program_name: name or names of the program.
        feed_unit: unit of the feed.
        max_values: limit of values per run.

    Returns:
        The runs in order.

    Raises:
        RecordError: as in `read_run_logs`; runs before the fault are yielded.
        OSError: the file cannot be read.
    """
    path = Path(path)
    table = ItemTable(items)
    unit = None if feed_unit is None else stated_feed_unit(feed_unit)
    kind = _format(path, format)
    names = (program_name,) if isinstance(program_name, str) else tuple(program_name or ())
    if kind == "edge":
        runs = edge_runs(path)
    else:
        cutter = RunCutter(str(path), table, unit, max_values)
        events = {"shdr": shdr_events, "mtconnect": mtconnect_events, "csv": table_events}[kind]
        runs = cutter.runs(events(path, table, cutter.notes))
    others: list[str] = []
    found = False
    for run in runs:
        if not names or run.program is None or any(_same_program(run.program, name) for name in names):
            found = True
            yield run
        elif run.program not in others:
            others.append(run.program)
    if not found:
        raise RecordError(f"{path}: no run of {' or '.join(names)}; the log names {', '.join(others)}")


def _format(path: Path, stated: LogFormat | None) -> LogFormat:
    """Format of a file by its content; a stated one is returned unless the file is empty or binary."""
    if stated is not None and stated not in get_args(LogFormat):
        raise RecordError(f"format {stated!r}: must be one of {', '.join(get_args(LogFormat))}")
    head = head_of(path)
    if stated is not None:
        return stated
    begin = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    if begin[:1] == b"{" or begin[:4] == b"PK\x03\x04":
        return "edge"
    if begin[:1] == b"<" or b"<MTConnectStreams" in head or b":MTConnectStreams" in head:
        return "mtconnect"
    lines = [line for line in begin.splitlines() if line.strip() and not line.lstrip().startswith((b"#", b"*"))]
    if any(_SHDR_LINE.match(line) for line in lines[:20]):
        return "shdr"
    if any(mark in line for line in lines[:_TABLE_LINES] for mark in (b",", b";", b"\t", b"|")):
        return "csv"
    raise RecordError(
        f"{path}:1: not a log of runs: the file begins with {begin[:60]!r}; required: SHDR text (time|item|value), an "
        "MTConnectStreams document, Sinumerik Edge JSON or a table with a header"
    )


def _same_program(logged: str, asked: str) -> bool:
    """Whether a logged name is that of a program, with or without folders, suffixes and prefixes."""
    one, other = (re.split(r"[\\/]", name.strip())[-1].lower() for name in (logged, asked))
    stems = [re.sub(r"\.(nc|cnc|tap|mpf|spf|txt|ngc|gcode|hnc|min|eia)$", "", name) for name in (one, other)]
    stems = [re.sub(r"^o?0*(\d+)$", r"o\1", stem) for stem in stems]  # O0012 is O12, and 12 in some logs
    short, long = sorted(stems, key=len)
    if short == long:
        return bool(short)
    return len(short) >= _SHORTEST_NAME and long.endswith(short) and not long[-len(short) - 1].isalnum()


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
                        cell = with_point(cell)
                        if column.factor != 1.0 and is_number(cell, False):
                            cell = repr(float(cell) * column.factor)
                    yield number, time, stamp, column.item, cell.encode()


def _time(cells: list[str], header: _Header, stamps: Stamps) -> tuple[bytes, float]:
    cell = cells[header.time.index]
    if is_number(cell, True) or is_number(cell, False):
        time = float(with_point(cell)) * header.time.factor
        if header.time_unit is None:
            return cell.encode(), stamps.seconds(with_point(cell).encode())
        if not abs(time) < _LATEST_S:
            raise ValueError(f"{time:g} s")
        return cell.encode(), time
    return cell.encode(), stamps.seconds(cell.encode())


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
    columns.sort(key=lambda column: column.item.role == "status")  # status last: the row that ends a run belongs to it
    return _Header(number, delimiter, len(items), time, columns, feed_unit, time_unit)
