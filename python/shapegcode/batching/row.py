"""Rows of a batch: from the outcome of a run, read back from the manifest, and as a table for spreadsheets."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
import weakref
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, overload

from shapegcode.batching.plan import Plan
from shapegcode.batching.process import BatchJob, JobOutcome
from shapegcode.batching.result import BatchRow, Ended, figures_of
from shapegcode.results.json import plain
from shapegcode.results.outcome import Pair

_ENDED: dict[int, Ended] = {0: "ok", 1: "not ok", 2: "refused"}
_PAIRS = ("residual_um", "contour_um", "cycle_time_s")
_PREFIX = "shapegcode: "


def row_of(job: BatchJob, outcome: JobOutcome) -> tuple[BatchRow, Mapping[str, bytes]]:
    """The row of a run, and the files of it that count."""
    ended: Ended = _ENDED.get(outcome.code, "failed") if outcome.ending == "ended" else "failed"
    if ended == "refused" and any(os.strerror(code) in outcome.complained for code in (errno.ENOSPC, errno.EDQUOT)):
        ended = "failed"  # not the program's fault
    written = {} if ended in ("failed", "refused") else outcome.files
    report = json.loads(written[job.report]) if job.report in written else {}
    # Of a file with several programs (--program all) there is one of each: they have no figures in common.
    several = report if isinstance(report, list) else [report]
    output = next((str(each["output"]) for each in several if "output" in each), "")
    row = {
        "program": job.program,
        "machine": job.machine,
        "ended": ended,
        "said": _said(outcome, ended),
        **figures_of(several[0] if len(several) == 1 else {}),
        "output": output,
        "report": job.report if job.report in written else "",
        "page": next((name for name in written if name.endswith(".html")), ""),
        "wall_s": outcome.wall_s,
        "cpu_s": outcome.cpu_s,
        "peak_bytes": outcome.peak_bytes,
    }
    return row_read(row, earlier=False), written


def _said(outcome: JobOutcome, ended: Ended) -> str:
    """The answer, or what went wrong."""
    text = outcome.said if ended in ("ok", "not ok") else outcome.complained
    lines = [line for line in text.strip().splitlines() if line]
    first = next((line for line in lines if line.startswith(_PREFIX)), lines[0] if lines else outcome.ending)
    return first.removeprefix(_PREFIX)


def row_read(row: Mapping[str, Any], *, earlier: bool) -> BatchRow:
    """A row of JSON."""
    pairs: dict[str, Any] = {
        name: None if row[name] is None else Pair(row[name]["original"], row[name]["emitted"]) for name in _PAIRS
    }
    values: dict[str, Any] = {
        field.name: row[field.name] for field in fields(BatchRow) if field.name not in (*_PAIRS, "earlier")
    }
    return BatchRow(**values, **pairs, earlier=earlier)


class KeptRows(Sequence[BatchRow]):
    """KeptRows of a batch that stand in its manifest and are read when somebody looks at them.

    A later batch writes another file, so that these stay what they were.

    Args:
        manifest: the file.
        planned: the runs.
        places: where the row of each run begins in the file; -1: there is none.
        earlier: of each run: not 0 if an earlier batch did it.
    """

    def __init__(self, manifest: Path, planned: Plan, places: Sequence[int], earlier: Sequence[int]) -> None:
        self._stream = manifest.open("rb")
        weakref.finalize(self, self._stream.close)
        self._planned, self._places, self._earlier = planned, places, earlier
        self._ranks = array("q", (rank for rank, at in enumerate(places) if at >= 0))

    def __len__(self) -> int:
        """How many runs are done."""
        return len(self._ranks)

    def __iter__(self) -> Iterator[BatchRow]:
        """One after the other."""
        return map(self._row, self._ranks)

    @overload
    def __getitem__(self, rank: int) -> BatchRow: ...

    @overload
    def __getitem__(self, rank: slice) -> list[BatchRow]: ...

    def __getitem__(self, rank: int | slice) -> BatchRow | list[BatchRow]:
        """One of them, or several."""
        ranks = self._ranks[rank]
        return self._row(ranks) if isinstance(ranks, int) else [self._row(each) for each in ranks]

    def __reduce__(self) -> tuple[type, tuple[list[BatchRow]]]:
        """Elsewhere there is no file."""
        return list, (list(self),)

    def _row(self, rank: int) -> BatchRow:
        self._stream.seek(self._places[rank])
        row = json.loads(self._stream.readline())
        job, base = self._planned.job(rank), self._planned.base
        files = {name: base.path_of(row[name]) for name in ("output", "report", "page") if row[name]}
        given = {"program": job.program, "machine": job.machine}
        return row_read(row | files | given, earlier=bool(self._earlier[rank]))


def summary_lines(rows: Iterable[BatchRow]) -> Iterator[str]:
    """The rows as CSV."""
    names = ["residual_um", "contour_um", "cycle_time_s"]
    heads: list[str] = []
    for field in fields(BatchRow):
        heads += [f"{field.name}.original", f"{field.name}.emitted"] if field.name in names else [field.name]
    yield _csv_line(heads)
    for row in rows:
        flat = _flat(plain(row))
        yield _csv_line([flat.get(head, "") for head in heads])


def _flat(row: Mapping[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, Mapping):
            flat |= {f"{name}.{key}": inner for key, inner in value.items()}
        else:
            flat[name] = value
    return flat


def _csv_line(cells: Sequence[object]) -> str:
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerow(["" if cell is None else cell for cell in cells])
    return stream.getvalue()
