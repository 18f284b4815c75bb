"""The rows of a batch as a table for spreadsheets."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any

from shapegcode.batching.result import BatchRow
from shapegcode.results.json import plain


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
