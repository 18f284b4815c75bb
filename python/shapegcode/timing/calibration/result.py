"""A cycle-time model calibrated from run logs, and its errors."""

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
    """A kind of look-ahead that was tried.

    Attributes:
        name: its name.
        meaning: description.
        fitted_s: error of its times in the logs used for the fit, s (weighted sum of root mean squares over
            windows of 1, 6 and 30 s and over whole sections).
        cross_validated_s: error in runs not used for the fit, s; null: too few runs for cross-validation.
    """

    name: str
    meaning: str
    fitted_s: float
    cross_validated_s: float | None


@dataclass(frozen=True)
class CalibratedParameter(OldNames):
    """One calibrated parameter of the machine file.

    Attributes:
        key: its key.
        meaning: description.
        value: calibrated value.
        low: lower end of the 95 % interval.
        high: upper end.
        unit: unit of these values.
        is_determined: whether the runs determine it; otherwise they allow very different values, or determine only sums
            with others.
        previous_value: former value in the machine file; null: none.
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
        name: "T3", "no tool", "cuts" or "between cuts".
        measured_s: time in the log, without holds.
        predicted_s: time of the calibrated model.
    """

    name: str
    measured_s: float
    predicted_s: float

    @property
    def error_percent(self) -> float:
        """Error of the predicted time relative to the measured one, %."""
        return 100.0 * (self.predicted_s / self.measured_s - 1.0) if self.measured_s > 0.0 else 0.0


@dataclass(frozen=True)
class CalibrationRun(OldNames):
    """One run, measured and predicted.

    Attributes:
        program: file.
        log: file.
        use: "fit" or "test".
        measured_s: from start to completion, by the log; null: not both are in the log.
        held_s: part of it in stops that are not programmed (holds).
        predicted_s: time of the calibrated model at the overrides of this run.
        low_s: lower end of the 95 % interval.
        high_s: upper end.
        cross_validated_s: time of a model calibrated only with the other programs (or runs); null: no others.
        feed_override: feed override ratio of most cutting.
        rapid_override: rapid override ratio.
        tools: times by tool.
        kinds: times of cuts, and between cuts.
        holds: descriptions of its holds.
        notes: findings and gaps of the log.
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
        """Names of program and log, without folders."""
        program, log = (each.replace("\\", "/").rsplit("/", 1)[-1] for each in (self.program, self.log))
        return f"{program.rsplit('.', 1)[0]}, {log}"

    @property
    def error_percent(self) -> float | None:
        """Error of the predicted time relative to the measured one without holds, %."""
        return _error(self.predicted_s, self.measured_s, self.held_s)

    @property
    def cross_validated_percent(self) -> float | None:
        """Error, %, of the model calibrated only with the other programs (or runs)."""
        return _error(self.cross_validated_s, self.measured_s, self.held_s)

    @property
    def judged_percent(self) -> float | None:
        """Cross-validation error if available, else error of the fit, %."""
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
        family: kind of look-ahead that predicts best the runs not used for its fit.
        families: all kinds tried.
        numbers: calibrated parameters; a key of the machine file may have several rows, such as one per M code.
        runs: one row for each run.
        fitted: the calibrated machine.
        remarks: source of each key that was set in the machine file, with its interval if known, by dotted name.
        undetermined: parameters that the logs do not determine, in words.
        warnings: runs with errors above 2 %, and holds.
        largest_error_percent: of a run less its holds, by cross-validation if possible; null: no complete run.
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
        """Largest error of a run, by cross-validation if possible, without holds, %."""
        judged = [abs(run.judged_percent) for run in self.runs if run.judged_percent is not None]
        return max(judged) if judged else None

    @property
    def ok(self) -> bool:
        """Whether the error of every complete run is within 2 %; False without a complete run."""
        largest = self.largest_error_percent
        return largest is not None and largest <= TOLERANCE_PERCENT

    @property
    def answer(self) -> str:
        """Number of parameters and largest error."""
        largest = self.largest_error_percent
        learned = sum(number.is_determined for number in self.numbers)
        head = f"{self.machine}: {learned} parameters calibrated with {sum(run.use == 'fit' for run in self.runs)} runs"
        if largest is None:
            return f"{head}; no log has a complete run to check them"
        left_out = any(run.cross_validated_s is not None or run.use == "test" for run in self.runs)
        kind = "not in the fit" if left_out else "fitted"
        within = "within" if self.ok else "NOT within"
        return f"{head}; runs {kind} are {within} {TOLERANCE_PERCENT:g} % (at most {largest:.1f} %)"

    @property
    def next_step(self) -> str:
        """What to do next, in one sentence."""
        if self.ok:
            return "write it with -o FILE; shapegcode time part.nc -m FILE gives the time of other programs"
        return "add runs of other programs, or state what the operator had set (override_percent in RUNS.toml)"

    def _next_after(self, file: str) -> str:
        return f"shapegcode time part.nc -m {file} gives the time of other programs" if self.ok else self.next_step

    def plots(self) -> Mapping[str, Plot]:
        """Picture of predicted against measured times."""
        return self._drawn_beside()

    def to_toml(self) -> str:
        """Text of the machine file with the calibrated parameters, each with a remark."""
        return self.fitted.to_toml(self.remarks)

    def tables(self) -> list[Table]:
        """Tables of runs, tools, kinds of look-ahead, parameters."""
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
    Column("holds", "s", lambda run: run.held_s or None, digits=1),
    Column("predicted", "s", "predicted_s", digits=1),
    Column("95 %", "s", lambda run: f"{run.low_s:.0f}-{run.high_s:.0f}"),
    Column("error", "%", "error_percent", digits=2),
    Column("cross-validated", "%", "cross_validated_percent", digits=2),
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
    Column("cross-validated", "s", "cross_validated_s", digits=3),
    Column("description", value="meaning", text=True),
)
_NUMBERS = (
    Column("parameter", value="meaning", text=True),
    Column("value", value=lambda number: f"{number.value:.4g} {number.unit}"),
    Column(
        "95 % interval",
        value=lambda row: f"{row.low:.4g} ... {row.high:.4g}" if row.is_determined else "not determined",
    ),
    Column("file had", value=lambda number: None if number.previous_value is None else f"{number.previous_value:.4g}"),
    Column("key", value="key", text=True),
)
