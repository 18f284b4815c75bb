"""What a machine did while it ran a program, read from its log: line numbers, feed, tool, overrides over time.

>>> for run in iter_run_logs("monday.txt.gz"):
...     print(run.start, run.program, run.duration_s)

Formats: SHDR text and MTConnect streams (`mtconnect`), Sinumerik Edge (`edge_json`), tables (`run_table`).
Each makes events of a file; `run_cutter` cuts them into runs. What the items are called stands in `run_items`.
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

MAX_VALUES = 4_000_000  # values that one run may have: 10 hours at 100 a second; some 60 MB
_SHORTEST_NAME = 4  # NIST_PLATE-12 is PLATE-12; whether OP2 is BOX_OP2 is not known
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
        path: of the file, plain or packed by gzip: SHDR text, MTConnect streams, Sinumerik Edge JSON, or a table.
        items: names in the file by what they are (`run_items.ROLES`), over the names that are known:
            ``{"block": "Block_Number"}``.
        format: of the file; None: by its content.
        program_name: only runs whose log names this program, or none; several: names that it may have.
        feed_unit: of the feed, where the log does not say it: "mm/s", "mm/min", "inch/min" ...
        max_values: that a run may have.

    Returns:
        The runs, in their order.

    Raises:
        RecordError: no such log, or nothing of use in it; the message names file and line, what is there and what is
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
    """The runs of a log one by one: the memory is that of the longest run, however long the log.

    Args:
        path: as of `read_run_logs`.
        items: the same.
        format: the same.
        program_name: the same.
        feed_unit: the same.
        max_values: the same.

    Returns:
        The runs, in their order.

    Raises:
        RecordError: as of `read_run_logs`; runs before the fault were given.
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
    """What a file is, by its content; with a stated format it is only looked whether the file has anything."""
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
        f"{path}:1: no log of runs: the file begins with {begin[:60]!r}; needed is SHDR text (time|item|value), an "
        "MTConnectStreams document, Sinumerik Edge JSON or a table with a header"
    )


def _same_program(logged: str, asked: str) -> bool:
    """Whether a log's name means a program: names go with folders, suffixes and prefixes of the shop or without."""
    one, other = (re.split(r"[\\/]", name.strip())[-1].lower() for name in (logged, asked))
    stems = [re.sub(r"\.(nc|cnc|tap|mpf|spf|txt|ngc|gcode|hnc|min|eia)$", "", name) for name in (one, other)]
    stems = [re.sub(r"^o?0*(\d+)$", r"o\1", stem) for stem in stems]  # O0012 is O12, and 12 in some logs
    short, long = sorted(stems, key=len)
    if short == long:
        return bool(short)
    return len(short) >= _SHORTEST_NAME and long.endswith(short) and not long[-len(short) - 1].isalnum()
