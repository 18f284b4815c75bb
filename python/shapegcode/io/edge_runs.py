"""Captures of a Sinumerik control as logs of runs: line numbers from block events, positions from every cycle."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.io.edge_capture import EdgeBlock, EdgeCapture
from shapegcode.io.edge_json import read_edge_json
from shapegcode.io.run_record import RunLog, Signal

__all__ = ["edge_runs"]

_END = re.compile(r"\s*(?:/?\s*N\d+\s*)?(?:M0?2|M30)\b", re.IGNORECASE)
_AXES = ("x", "y", "z")


def edge_runs(path: Path) -> Iterator[RunLog]:
    """The run of a capture.

    The blocks are those of the program that has most of them in the capture; those of cycles and subprograms stand in
    the texts only, since their lines count in other files.
    """
    capture = read_edge_json(path)
    count = Counter(block.path for block in capture.blocks if block.line is not None)
    if not count:
        raise RecordError(f"{path}: no block events (HFBlockEvent) with a line: nobody knows what ran; record them")
    program = count.most_common(1)[0][0]
    blocks = [block for block in capture.blocks if block.path == program and block.line is not None]
    notes = list(capture.notes)
    if len(count) > 1:
        others = ", ".join(f"{name or 'without a name'} ({number})" for name, number in count.most_common()[1:6])
        notes.append(f"line numbers are those of {program or 'no name'}; left out are blocks of {others}")
    end = next((block.time_s for block in capture.blocks if _END.match(block.text)), None)
    tools = [block for block in capture.blocks if block.active_tool is not None and block.active_tool < 65535]
    yield RunLog(
        source=str(path),
        start="",
        duration_s=None,
        block=_signal(blocks, [float(block.line or 0) for block in blocks], "SeekOffset"),
        tool=_signal(tools, [float(block.active_tool or 0) for block in tools], "ActiveTool") if tools else None,
        position_mm=_positions(capture),
        program=program or None,
        notes=tuple(notes),
        block_texts=tuple((block.time_s, block.text) for block in capture.blocks),
        gaps=tuple((gap.start_s, gap.duration_s) for gap in capture.gaps),
        ended_by=None if end is None else "M30",
        cut_start=True,
        cut_end=end is None,
    )


def _signal(blocks: list[EdgeBlock], values: list[float], name: str) -> Signal:
    return Signal(np.array([block.time_s for block in blocks]), np.array(values), name)


def _positions(capture: EdgeCapture) -> tuple[tuple[str, Signal], ...]:
    """Commands of X, Y, Z by the labels of the axes."""
    return tuple(
        (letter, Signal(capture.time_s, capture.position(axis.number), f"DES_POS|{axis.number}"))
        for letter in _AXES
        for axis in capture.axes
        if axis.name.lower().startswith(letter) and "DES_POS" in axis.signals
    )
