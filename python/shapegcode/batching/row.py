"""From the outcome of a run to its row, and a row read back from the manifest."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from shapegcode.batching.job import BatchJob, JobOutcome
from shapegcode.batching.result import BatchRow, Ended, figures_of
from shapegcode.results.outcome import Pair

__all__ = ["row_of", "row_read"]

_ENDED: dict[int, Ended] = {0: "ok", 1: "not ok", 2: "refused"}
_PAIRS = ("residual_um", "contour_um", "cycle_time_s")
_PREFIX = "shapegcode: "


def row_of(job: BatchJob, outcome: JobOutcome) -> tuple[BatchRow, Mapping[str, bytes]]:
    """The row of a run, and the files of it that count.

    Args:
        job: the run.
        outcome: what came back.

    Returns:
        The row, and the content of files by name: none of a run that failed.
    """
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
    """A row of JSON.

    Args:
        row: values by name.
        earlier: it was done by an earlier batch.

    Returns:
        The row.
    """
    pairs: dict[str, Any] = {
        name: None if row[name] is None else Pair(row[name]["original"], row[name]["emitted"]) for name in _PAIRS
    }
    values: dict[str, Any] = {
        field.name: row[field.name] for field in fields(BatchRow) if field.name not in (*_PAIRS, "earlier")
    }
    return BatchRow(**values, **pairs, earlier=earlier)
