"""Measurements, their ratios and how they are shown."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Sample:
    """What the repetitions gave, in the order in which they ran."""

    values: tuple[float, ...]

    @classmethod
    def of(cls, values: Sequence[float]) -> Sample:
        return cls(tuple(values))

    @property
    def median(self) -> float:
        return statistics.median(self.values)

    def __truediv__(self, other: Sample) -> Sample:
        """Ratios within each repetition, so that a slow minute of the machine slows both sides."""
        return Sample(tuple(a / b for a, b in zip(self.values, other.values, strict=True)))

    def __str__(self) -> str:
        return f"{_number(self.median)} ({_number(min(self.values))} – {_number(max(self.values))})"


@dataclass(frozen=True)
class Row:
    """One figure beside its peer's."""

    key: str  # stable name in the JSON output
    what: str  # what was measured
    unit: str  # of `ours` and `theirs`
    ours: Sample  # this project's figure
    peer: str = ""  # what it is held against; empty: nothing
    theirs: Sample | None = None  # the peer's figure, repetition by repetition
    at_least: float | None = None  # smallest ratio ours / theirs that meets the target; None: no target
    at_most: float | None = None  # largest such ratio, or largest `ours` where there is no peer

    @property
    def ratio(self) -> Sample | None:
        return None if self.theirs is None else self.ours / self.theirs

    @property
    def target(self) -> str:
        what = "ratio" if self.theirs else self.unit
        if self.at_least is not None:
            return f"{what} ≥ {self.at_least:g}"
        return f"{what} ≤ {self.at_most:g}" if self.at_most is not None else ""

    @property
    def met(self) -> bool | None:
        """Whether the median keeps the target; None without one."""
        judged = (self.ratio or self.ours).median
        if self.at_least is not None:
            return judged >= self.at_least
        return judged <= self.at_most if self.at_most is not None else None

    def as_json(self) -> dict[str, Any]:
        ratio = self.ratio
        return {
            "what": self.what,
            "unit": self.unit,
            "ours": self.ours.values,
            "peer": self.peer or None,
            "theirs": self.theirs.values if self.theirs else None,
            "ratio_median": ratio.median if ratio else None,
            "at_least": self.at_least,
            "at_most": self.at_most,
            "met": self.met,
        }


def timed(action: Callable[[], Any], clock: Callable[[], float] = time.perf_counter) -> tuple[float, Any]:
    """How long it takes, and its result."""
    begin = clock()
    result = action()
    return clock() - begin, result


def comparison_table(rows: Sequence[Row]) -> str:
    """Medians with least and largest value, as Markdown."""
    lines = []
    for row in rows:
        ratio = row.ratio
        lines.append(
            [
                row.what, f"{row.ours} {row.unit}", row.peer, f"{row.theirs} {row.unit}" if row.theirs else "",
                str(ratio) if ratio else "", row.target, {True: "met", False: "**missed**", None: ""}[row.met],
            ]
        )  # fmt: skip
    return markdown(["what", "shapegcode", "peer", "the peer's", "ratio", "target", ""], lines)


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table with aligned columns."""
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]

    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)) + " |"

    return "\n".join([line(head), "|" + "|".join("-" * (width + 2) for width in widths) + "|", *map(line, rows)])


def _number(value: float) -> str:
    """Three significant digits without an exponent."""
    if value >= 100:
        return f"{value:.0f}"
    return f"{value:.1f}" if value >= 10 else f"{value:.2f}"
