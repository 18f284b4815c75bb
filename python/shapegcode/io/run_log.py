"""Reads logs of program runs: line numbers, feed, tool, overrides over time.

>>> for run in iter_run_logs("monday.txt.gz"):
...     print(run.start, run.program, run.duration_s)

Formats: SHDR text and MTConnect streams (`mtconnect`), Sinumerik Edge (`edge_json`), tables (`run_table`).
Each yields the events of a file; `run_cutter` splits them into runs. Item names are in `run_items`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal, get_args

from shapegcode.errors import RecordError
from shapegcode.io.edge_json import edge_runs
from shapegcode.io.layout import head_of
from shapegcode.io.mtconnect import mtconnect_events, shdr_events
from shapegcode.io.run_cutter import RunCutter
from shapegcode.io.run_items import ItemTable, stated_feed_unit
from shapegcode.io.run_table import table_events
from shapegcode.io.run_tracks import RunLog

LogFormat = Literal["shdr", "mtconnect", "edge", "csv"]

MAX_VALUES = 4_000_000  # values of one run: 10 hours at 100 per second; about 60 MB
_SHORTEST_NAME = 4  # NIST_PLATE-12 is PLATE-12; OP2 may not be BOX_OP2
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
    )  # fmt: skip


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
    """Format of a file by its content; with a stated format only check that it is not empty."""
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
