"""Writes captures as the SINUMERIK Data Recorder does, for the tests of their reader."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
MEASURED = Path(__file__).resolve().parents[2] / "python/shapegcode/data/measured/sinumerik/capture.json.gz"
"""The real capture that comes with the package."""


def edge_document(
    columns: Mapping[str, FloatArray],
    *,
    first: int = 5_000_000,
    cycle_ms: float = 2,
    counter: Sequence[int] | None = None,
    events: Sequence[Mapping[str, Any]] = (),
    rows_per_entry: int = 101,
) -> dict[str, Any]:
    """A whole document: columns by address, rows in pieces as the recorder sends them, events at the end."""
    count = len(next(iter(columns.values())))
    counts = list(range(first, first + count)) if counter is None else list(counter)
    rows = [[counts[row], *(round(float(values[row]), 9) for values in columns.values())] for row in range(count)]
    payload: list[Any] = [{"HFData": rows[at : at + rows_per_entry]} for at in range(0, count, rows_per_entry)]
    signals = [{"Name": each, "Type": "DOUBLE", "Axis": _label(each), "Address": each} for each in ("CYCLE", *columns)]
    return {
        "Header": {
            "Version": {"outputFileFormatVersion": "1.0", "RecorderVersion": "3.1.0-36"},
            "Format": "DEFAULT",
            "SignalListHFData": signals,
            "CycleTimeMs": cycle_ms,
            "Initial": {"Time": "2023-12-22T14:25:56.836Z", "HFProbeCounter": first},
        },
        "Payload": payload + copy.deepcopy(list(events)),
        "Footer": {"ErrorMessages": [], "FilePathChain": {"Previous": None, "Actual": "a.json", "Next": None}},
    }


def _label(address: str) -> str:
    name, bar, number = address.partition("|")
    return {"1": "X1", "2": "Y1", "3": "Z1"}.get(number, f"Q{number}") if bar else name


def write_edge(path: Path, document: Any) -> Path:
    """Write it as one file."""
    path.write_text(json.dumps(document), encoding="utf-8")
    return path
