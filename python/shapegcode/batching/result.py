"""Result of a batch: a row for each run, tables by problem and by gain, the next step."""

from __future__ import annotations

import heapq
import itertools
import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, ClassVar, Literal

from shapegcode.results.json import OldNames, Streamed, hidden, plain
from shapegcode.results.outcome import Pair
from shapegcode.results.page.model import Figure
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table

Ended = Literal["ok", "not ok", "refused", "failed"]
"""Ok: within tolerance; not ok: done, but out of tolerance; refused: bad input; failed: not completed."""

_SHOWN = 20
_LISTED = 2000


@dataclass(frozen=True)
class BatchRow(OldNames):
    """One program on one machine.

    Attributes:
        program: program as given.
        machine: machine as given.
        ended: how the run ended: "ok", "not ok", "refused" or "failed".
        answer: the first line of the command's output, or why there is none.
        residual_um: residual vibration of the worst axis; None: the command does not compute it.
        contour_um: contour error; None: the command does not compute it.
        cycle_time_s: cycle time; None: not computed; if the command writes no program, both values are equal.
        alarms: number of alarms of `check`.
        output: the program that was written; empty: none.
        report: its JSON; empty: none.
        page: its page; empty: none.
        earlier: an earlier batch did this run, and its files are unchanged since.
        wall_s: elapsed time.
        cpu_s: processor time.
        peak_bytes: peak memory.
    """

    program: str
    machine: str
    ended: Ended
    answer: str
    residual_um: Pair[float] | None
    contour_um: Pair[float] | None
    cycle_time_s: Pair[float] | None
    alarms: int | None
    output: str
    report: str
    page: str
    earlier: bool
    wall_s: float
    cpu_s: float
    peak_bytes: int

    @property
    def gain_um(self) -> float:
        """Reduction of the residual vibration, µm."""
        return 0.0 if self.residual_um is None else self.residual_um.original - self.residual_um.emitted

    @property
    def longer_percent(self) -> float | None:
        """Increase of the cycle time, %; None: unknown, or no change."""
        pair = self.cycle_time_s
        if pair is None or pair.original <= 0.0 or pair.original == pair.emitted:
            return None
        return 100.0 * (pair.emitted / pair.original - 1.0)


def figures_of(report: Mapping[str, Any]) -> dict[str, Any]:
    """The figures of a row from the JSON of a command."""
    counts = report.get("counts")
    return {
        "residual_um": _pair(report.get("residual_vibration_um"), _largest),
        "contour_um": _pair(
            _contour(report), lambda each: _number(each.get("max") if isinstance(each, dict) else each)
        ),
        "cycle_time_s": _pair(report.get("cycle_time_s"), _number),
        "alarms": counts.get("alarm") if isinstance(counts, Mapping) else None,
    }


def _contour(report: Mapping[str, Any]) -> object:
    """Contour error of the target of the verdict: machine table or command."""
    tracks = report.get("contour_error_um")
    if not isinstance(tracks, Mapping):
        return tracks
    limits = report.get("limits")
    target = limits.get("contour_target") if isinstance(limits, Mapping) else None
    return tracks.get(target or "response")


def _pair(value: object, take: Callable[[Any], float | None]) -> Pair[float] | None:
    both = isinstance(value, Mapping) and {"original", "emitted"} <= value.keys()
    original, emitted = (take(value[name] if both else value) for name in ("original", "emitted"))  # type: ignore[index]
    return None if original is None or emitted is None else Pair(original, emitted)


def _largest(value: object) -> float | None:
    numbers = [each for each in value.values() if isinstance(each, int | float)] if isinstance(value, Mapping) else []
    return float(max(numbers)) if numbers else None


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def _both(name: str) -> Any:
    """Cell for a figure of original and emitted; one number if both are equal."""

    def cell(row: BatchRow) -> str:
        pair = getattr(row, name)
        if pair is None:
            return ""
        before, after = f"{pair.original:.1f}", f"{pair.emitted:.1f}"
        return before if before == after else f"{before}\N{NO-BREAK SPACE}→\N{NO-BREAK SPACE}{after}"

    return cell


_RED = {"failed": "bold red", "refused": "red", "not ok": "yellow"}
_FIGURES = (
    Column("residual", "µm", _both("residual_um"), priority=0),
    Column("contour", "µm", _both("contour_um"), priority=2),
    Column("time", "s", _both("cycle_time_s"), priority=3),
    Column("longer", "%", "longer_percent", digits=1),
    Column("alarms", value="alarms"),
)


@dataclass(frozen=True, repr=False, eq=False)
class Batch(Result):
    """A command over many programs and machines.

    Attributes:
        command: the command.
        output: folder of the results.
        rows: one for each finished run, machine by machine, programs in the order found.
        summary: CSV file with all rows.
        not_done: runs not started or not finished because the batch was stopped.
        stopped: reason for the stop; empty: not stopped.
        warnings: why the batch was stopped, and subprograms that were not run on their own.
        wall_s: elapsed time of the batch.
        processes: number of parallel processes.
        html: folder of the pages, for the index that the command writes; empty: no index.
    """

    json_extra: ClassVar[dict[str, Any]] = {**Result.json_extra, "counts": dict[str, int]}

    command: str
    output: str
    rows: Sequence[BatchRow]
    summary: str
    not_done: int
    stopped: str = ""
    warnings: tuple[str, ...] = ()
    wall_s: float = 0.0
    processes: int = field(default=1, metadata=hidden())
    html: str = field(default="", metadata=hidden())

    @property
    def counts(self) -> dict[str, int]:
        """Number of runs with each outcome."""
        return {name: self._tally[name] for name in ("ok", "not ok", "refused", "failed")}

    @cached_property
    def _tally(self) -> Counter[str]:
        """Number of rows by outcome and by machine, and of those done by an earlier batch."""
        each = ((row.ended, f"on {row.machine}", *(["earlier"] if row.earlier else [])) for row in self.rows)
        return Counter(itertools.chain.from_iterable(each))

    @property
    def ok(self) -> bool:
        """True if every run is done, and ended "ok"."""
        return not self.not_done and self.counts["ok"] == len(self.rows)

    @property
    def answer(self) -> str:
        """Number of runs that are ok and of the others, and the elapsed time."""
        counts, whole = self.counts, len(self.rows) + self.not_done
        trouble = [f"{count} {name}" for name, count in counts.items() if count and name != "ok"]
        trouble += [f"{self.not_done} not done"] if self.not_done else []
        earlier = self._tally["earlier"]
        before = f", {earlier} of them by an earlier batch" if earlier else ""
        tail = f"; {', '.join(trouble)}" if trouble else ""
        return f"{counts['ok']} of {whole} runs of {self.command} are ok{before}{tail} ({self.wall_s:.1f} s)"

    @property
    def next_step(self) -> str:
        """Next step for the worst remaining problem."""
        counts = self.counts
        if self.not_done or counts["failed"]:
            return "resolve the cause, then run the same command with --resume: finished runs are kept."
        if counts["refused"]:
            return f"correct what was refused (reasons: {self.summary}), then repeat the command with --resume."
        if counts["not ok"]:
            return f"see the reports of runs that are not ok; {self.summary} lists them."
        if self.command == "convert":
            return "run one of the emitted programs above the workpiece first."
        return f"open {self.summary} in a spreadsheet."

    def _to_write(self) -> dict[str, Any]:
        """Like `to_dict`, with streamed rows."""
        names = [each.name for each in fields(self) if each.name != "rows" and not each.metadata.get("hidden")]
        found: dict[str, Any] = plain({name: getattr(self, name) for name in (*names, *self.json_extra)})
        return found | {"rows": Streamed(self.rows)}

    def key_figures(self) -> tuple[Figure, ...]:
        """Number of runs with each outcome."""
        shown = {name: float(count) for name, count in self.counts.items() if count or name == "ok"}
        return tuple(Figure(name, "runs", None, count, 0, None, "", f"counts.{name}") for name, count in shown.items())

    def tables(self) -> list[Table]:
        """Tables of runs with problems, and of good runs by gain: 20 of each at most; for an index of pages, 2000."""
        worst, counts, shown = list(_RED), self.counts, _LISTED if self.html else _SHOWN
        others, fine = (row for row in self.rows if row.ended != "ok"), (row for row in self.rows if row.ended == "ok")
        bad = heapq.nsmallest(shown, others, key=lambda row: worst.index(row.ended))
        good = heapq.nsmallest(shown, fine, key=lambda row: -row.gain_um)
        names = (
            Column("program", value="program", left=True, link=self._link, priority=0),
            Column("machine", value="machine", left=True, priority=4),
        )
        why = (Column("", value="ended", left=True, priority=0), Column("why", value="answer", text=True))
        tables = []
        if bad:
            left = len(self.rows) - counts["ok"] - shown
            tables.append(self._table("needs attention", (*names, *why), bad, left, lambda row: _RED[row.ended]))
        if good:
            tables.append(self._table("ok, by gain", (*names, *_FIGURES), good, counts["ok"] - shown))
        return tables

    def _link(self, row: BatchRow) -> str:
        """Link from the index to the page of a run."""
        return os.path.relpath(row.page, self.html) if row.page and self.html else ""

    def _table(
        self, title: str, columns: tuple[Column, ...], rows: list[BatchRow], left: int, style: Any = None
    ) -> Table:
        caption = f"and {left} more: {self.summary}" if left > 0 else ""
        if sum(name.startswith("on ") for name in self._tally) == 1:
            columns = tuple(column for column in columns if column.name != "machine")
        return Table(title, columns, rows, caption, row_style=style)
