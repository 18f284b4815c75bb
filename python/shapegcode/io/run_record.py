"""One run of a program as a log shows it: line numbers, feed, tool, overrides over time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

__all__ = ["RunLog", "Signal"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Signal:
    """One data item over time: each value holds until the next one.

    Attributes:
        time_s: (n,) since the start of the run, not falling; what held before the start has a time of 0 or less.
        value: (n,) as the log has it, in the unit that the item says.
        name: of the item in the log.
    """

    time_s: FloatArray
    value: FloatArray
    name: str = ""

    def __len__(self) -> int:
        """How many values there are."""
        return len(self.time_s)


@dataclass(frozen=True, eq=False)
class RunLog:
    """One run of a program.

    Attributes:
        source: file.
        start: time stamp of the start, as the file has it; empty where the file has none.
        duration_s: from start to completion, holds included; None: the log does not hold both.
        block: numbers as the control gave them, see `block_counts`; empty where this run has none.
        feed: along the path; None: not logged.
        feed_unit: of the feed, such as "mm/s", a unit of `shapegcode.io.units`; None: the log
            does not say.
        tool: number in the spindle; 0 while it is changed, on some controls.
        spindle_rpm: speed of the spindle in 1/min.
        feed_override: ratio, 1: 100 %.
        rapid_override: the same of rapids.
        position_mm: (axis, positions in mm or degrees) of the axes that were logged.
        holds: (start_s, duration_s) of what the log itself calls a hold, an interruption or a stop.
        program: name that the log gives; None: it gives none.
        notes: what was bridged or left out, with the line.
        block_counts: what `block` counts: "line" of the program file, the first one is 1, or "sequence": N words.
        block_texts: (time_s, text) of the blocks, where the log has their text.
        gaps: (start_s, duration_s) of long times in which the log says nothing: a dwell, a long block, or the log
            or its clock was interrupted.
        lines: first and last line of the run in the file; (0, 0) where the file has no lines.
        ended_by: what the log says at the end, such as "PROGRAM_COMPLETED"; None: it ends before.
        cut_start: the log began within the run.
        cut_end: the log ended, or its clock was set back, within the run.
    """

    source: str
    start: str
    duration_s: float | None
    block: Signal
    feed: Signal | None = None
    feed_unit: str | None = None
    tool: Signal | None = None
    spindle_rpm: Signal | None = None
    feed_override: Signal | None = None
    rapid_override: Signal | None = None
    position_mm: tuple[tuple[str, Signal], ...] = ()
    holds: tuple[tuple[float, float], ...] = ()
    program: str | None = None
    notes: tuple[str, ...] = ()
    block_counts: Literal["line", "sequence"] = "line"
    block_texts: tuple[tuple[float, str], ...] = field(default=())
    gaps: tuple[tuple[float, float], ...] = ()
    lines: tuple[int, int] = (0, 0)
    ended_by: str | None = None
    cut_start: bool = False
    cut_end: bool = False

    @property
    def complete(self) -> bool:
        """Whether the log holds the run from its start to its end."""
        return not (self.cut_start or self.cut_end)
