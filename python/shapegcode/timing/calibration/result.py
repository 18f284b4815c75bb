"""A cycle-time model calibrated from run logs, and how well it says what the machine did."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from shapegcode.machine import Machine
from shapegcode.results.json import OldNames, hidden
from shapegcode.results.outcome import Plot
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table

TOLERANCE_PERCENT = 2.0


@dataclass(frozen=True)
class FamilyScore(OldNames):
    """One kind of look-ahead that was tried.

    Attributes:
        name: of it.
        meaning: in words.
        fitted_s: how far its times differ from the logs that it was fitted to, s (weighted root mean square over
            windows of seconds to minutes).
        cross_validated_s: the same on runs that it was not fitted to; null: too few runs to leave any out.
    """

    name: str
    meaning: str
    fitted_s: float
    cross_validated_s: float | None


@dataclass(frozen=True)
class CalibratedParameter(OldNames):
    """One number of the machine file.

    Attributes:
        key: of it.
        meaning: in words.
        value: as calibrated.
        low: least value of the 95 % interval.
        high: largest one.
        unit: of all three.
        is_determined: whether the runs determine it; else they allow very different values, or determine only sums
            with others.
        previous_value: that of the machine file before; null: it had none.
    """

    key: str
    meaning: str
    value: float
    low: float
    high: float
    unit: str
    is_determined: bool
    previous_value: float | None = None


@dataclass(frozen=True)
class CycleTimePart:
    """A part of a run: a tool, or a kind of motion.

    Attributes:
        name: "T3", "cuts", "between cuts".
        measured_s: what it took in the log.
        predicted_s: of the calibrated model.
    """

    name: str
    measured_s: float
    predicted_s: float

    @property
    def error_percent(self) -> float:
        """Predicted over measured."""
        return 100.0 * (self.predicted_s / self.measured_s - 1.0) if self.measured_s > 0.0 else 0.0


@dataclass(frozen=True)
class CalibrationRun(OldNames):
    """One run.

    Attributes:
        program: file.
        log: file.
        use: "fit" or "test".
        measured_s: from start to completion, by the log; null: it does not hold both.
        held_s: of it, holds: the machine waited where no program asks for it.
        predicted_s: of the calibrated model, at the overrides of this run.
        low_s: least time of the 95 % interval.
        high_s: largest one.
        cross_validated_s: of a model calibrated with the other programs (or runs) alone; null: no others.
        feed_override: ratio at which most of it was cut.
        rapid_override: ratio of its rapids.
        tools: by tool.
        kinds: cuts, and what lies between them.
        holds: where it was held, in words.
        notes: what was bridged in the log.
    """

    program: str
    log: str
    use: str
    measured_s: float | None
    held_s: float
    predicted_s: float
    low_s: float
    high_s: float
    cross_validated_s: float | None
    feed_override: float
    rapid_override: float
    tools: tuple[CycleTimePart, ...]
    kinds: tuple[CycleTimePart, ...]
    holds: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Program and log, without folders."""
        program, log = (each.replace("\\", "/").rsplit("/", 1)[-1] for each in (self.program, self.log))
        return f"{program.rsplit('.', 1)[0]}, {log}"

    @property
    def error_percent(self) -> float | None:
        """Predicted over what was measured without holds."""
        return _error(self.predicted_s, self.measured_s, self.held_s)

    @property
    def cross_validated_percent(self) -> float | None:
        """The same of the model calibrated with the others."""
        return _error(self.cross_validated_s, self.measured_s, self.held_s)

    @property
    def judged_percent(self) -> float | None:
        """Error as a run left out, where there is one; else of the fit."""
        return self.cross_validated_percent if self.cross_validated_s is not None else self.error_percent


def _error(predicted_s: float | None, measured_s: float | None, held_s: float) -> float | None:
    if predicted_s is None or measured_s is None or measured_s <= held_s:
        return None
    return 100.0 * (predicted_s / (measured_s - held_s) - 1.0)


@dataclass(frozen=True, repr=False, eq=False)
class CycleTimeCalibration(Result):
    """A cycle-time model of a machine, calibrated with logs of its runs.

    Attributes:
        machine: name.
        family: kind of look-ahead that says best what runs took that it was not fitted to.
        families: all that were tried.
        numbers: what was calibrated, one row for each key of the machine file.
        runs: one row for each run.
        fitted: the machine with it.
        remarks: for each key that was set, by its dotted name: interval and source.
        undetermined: what the logs do not determine, in words.
        warnings: runs that differ by more than 2 %, and where one was held.
        largest_error_percent: of a run: as one left out where others are, without holds; null: no whole run.
    """

    machine: str
    family: str
    families: tuple[FamilyScore, ...]
    numbers: tuple[CalibratedParameter, ...]
    runs: tuple[CalibrationRun, ...]
    fitted: Machine = field(metadata=hidden())
    remarks: Mapping[str, str] = field(metadata=hidden())
    undetermined: tuple[str, ...]
    warnings: tuple[str, ...]

    json_extra: ClassVar[dict[str, Any]] = {**Result.json_extra, "largest_error_percent": float | None}

    @property
    def largest_error_percent(self) -> float | None:
        """Largest error of a run: as one left out where others are, without holds."""
        judged = [abs(run.judged_percent) for run in self.runs if run.judged_percent is not None]
        return max(judged) if judged else None

    @property
    def ok(self) -> bool:
        """Whether the error of every run is within 2 %."""
        largest = self.largest_error_percent
        return largest is not None and largest <= TOLERANCE_PERCENT

    @property
    def answer(self) -> str:
        """How well it says what the machine did."""
        largest = self.largest_error_percent
        learned = sum(number.is_determined for number in self.numbers)
        head = f"{self.machine}: {learned} parameters calibrated with {sum(run.use == 'fit' for run in self.runs)} runs"
        if largest is None:
            return f"{head}; no log has a complete run to check them"
        left_out = any(run.cross_validated_s is not None or run.use == "test" for run in self.runs)
        kind = "left out" if left_out else "fitted"
        within = "within" if self.ok else "NOT within"
        return f"{head}; runs {kind} are {within} {TOLERANCE_PERCENT:g} % (at most {largest:.1f} %)"

    @property
    def next_step(self) -> str:
        """To use the machine file, or to give it more runs."""
        if self.ok:
            return "write it with -o FILE; shapegcode time part.nc -m FILE gives the time of other programs"
        return "add runs of other programs, or state what the operator had set (override_percent in RUNS.toml)"

    def next_step_after(self, file: str) -> str:
        """The same where the machine file was written.

        Args:
            file: name of it.

        Returns:
            One sentence.
        """
        return f"shapegcode time part.nc -m {file} gives the time of other programs" if self.ok else self.next_step

    def plots(self) -> Mapping[str, Plot]:
        """Predicted against measured."""
        return self._drawn_beside()

    def to_toml(self) -> str:
        """The machine file with the calibrated parameters, each with a remark."""
        return self.fitted.to_toml(self.remarks)

    def tables(self) -> list[Table]:
        """Runs, tools, kinds of look-ahead, numbers."""
        tools = [(run, share) for run in self.runs for share in (*run.tools, *run.kinds)]
        return [
            Table("runs", _RUNS, self.runs),
            Table("by tool, and by kind of motion", _SHARES, tools),
            Table("kinds of look-ahead", _FAMILIES, self.families),
            Table("calibrated", _NUMBERS, self.numbers),
        ]


_RUNS = (
    Column("run", value="name", text=True),
    Column("use", value="use", left=True),
    Column("measured", "s", "measured_s", digits=1),
    Column("held", "s", lambda run: run.held_s or None, digits=1),
    Column("predicted", "s", "predicted_s", digits=1),
    Column("95 %", "s", lambda run: f"{run.low_s:.0f}-{run.high_s:.0f}"),
    Column("error", "%", "error_percent", digits=2),
    Column("left out", "%", "cross_validated_percent", digits=2),
)
_SHARES = (
    Column("run", value=lambda row: row[0].name, text=True),
    Column("part", value=lambda row: row[1].name, left=True),
    Column("measured", "s", lambda row: row[1].measured_s, digits=1),
    Column("predicted", "s", lambda row: row[1].predicted_s, digits=1),
    Column("error", "%", lambda row: row[1].error_percent, digits=1),
)
_FAMILIES = (
    Column("kind", value="name", text=True),
    Column("fitted", "s", "fitted_s", digits=3),
    Column("left out", "s", "cross_validated_s", digits=3),
    Column("what it is", value="meaning", text=True),
)
_NUMBERS = (
    Column("number", value="meaning", text=True),
    Column("value", value=lambda number: f"{number.value:.4g} {number.unit}"),
    Column(
        "95 % interval",
        value=lambda row: f"{row.low:.4g} ... {row.high:.4g}" if row.is_determined else "not determined",
    ),
    Column("file had", value=lambda number: None if number.previous_value is None else f"{number.previous_value:.4g}"),
    Column("key", value="key", text=True),
)
