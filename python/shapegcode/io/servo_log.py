"""Reads servo logs: text with columns of time and axis positions, identified by words in their names."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shapegcode.errors import ArgumentError, RecordError
from shapegcode.io.table import TextTable
from shapegcode.io.units import Label, Meaning, factor_between, find_unit, read_label, unit_of, units_of, words_of

Array = npt.NDArray[np.float64]
_ACTUAL = {"act", "actual", "fb", "feedback", "fbk", "measured", "meas", "ist", "real"}
_TIME = {"time", "t", "timestamp", "zeit"}
_EXAMPLE = "time_ms,X,Y,Z or time_ms,X,Y,Z,X_act,Y_act,Z_act"
_MIN_ROWS, _MAX_ROWS = 100, 20_000_000
_SHORTEST_S, _LONGEST_S = 2e-5, 0.05


@dataclass(frozen=True)
class ServoLog:
    """A servo log."""

    file: str  # path
    times_s: Array  # time of each row, from 0 on
    command_mm: Array  # shape (n, 3), commanded X, Y, Z; NaN for an axis not recorded
    actual_mm: Array | None  # the same for actual positions; None if none was recorded

    @property
    def sampling_s(self) -> float:
        """Median time between two rows in s."""
        return float(np.median(np.diff(self.times_s)))


def parse_units(text: str) -> tuple[float, float]:
    """Read ``TIME,LENGTH``, for example ``ms,um``: the factors to s and mm."""
    units = [find_unit(word) for word in text.split(",")]
    if [unit and unit.measures for unit in units] != ["time", "displacement"]:
        raise ArgumentError(
            f"--units {text}: must be TIME,LENGTH with TIME of {units_of('time')} and LENGTH of "
            f"{units_of('displacement')}"
        )
    seconds, millimetres = (factor_between(unit, to) for unit, to in zip(units, ("s", "mm"), strict=True) if unit)
    return seconds, millimetres


def _names(name: str) -> Meaning | None:
    """Meaning of a column name: the time, or the commanded or actual position of an axis."""
    words = set(words_of(name))
    if words & _TIME:
        return Meaning("time", "time")
    axes = words & {"x", "y", "z"}
    actual = bool(words & _ACTUAL)
    if joined := re.fullmatch(r"([xyz])(a|act|c|cmd|com)", name.lower().strip()):
        axes, actual = {joined[1]}, joined[2].startswith("a")
    return Meaning("actual" if actual else "command", "displacement", axes.pop()) if len(axes) == 1 else None


@dataclass(frozen=True)
class _Columns:
    """Indices of the used columns; those of commanded and actual positions by axis."""

    labels: list[Label]
    time: int
    command: dict[str, int]
    actual: dict[str, int]

    @property
    def used(self) -> list[int]:
        return [self.time, *self.command.values(), *self.actual.values()]


def _columns(table: TextTable) -> _Columns:
    labels = table.labels(lambda text, unit: read_label(text, unit, _names))
    time = next((index for index, label in enumerate(labels) if label.measures == "time"), -1)
    found = _Columns(labels, time, {}, {})
    for index, label in enumerate(labels):
        if label.meaning is not None and label.axis is not None:
            target = found.actual if label.meaning.what == "actual" else found.command
            target.setdefault(label.axis, index)
    if time < 0 or not (found.command or found.actual):
        raise ArgumentError(
            f"{table.where}: no header with a time and an axis; required: for example {_EXAMPLE}; the header is "
            f"{', '.join(table.layout.header)[:60]!r}"
        )
    if not found.command:
        raise ArgumentError(
            f"{table.where}: only actual positions; the commanded ones are needed (columns X, Y, Z or X_cmd, ...)"
        )
    return found


def is_servo_log(path: Path, head: bytes) -> bool:
    """Whether a file is text whose header names the commanded and the actual position of an axis."""
    if b"\0" in head or not any(word.encode() in head.lower() for word in _ACTUAL):
        return False
    try:
        found = _columns(TextTable(path))
    except (ArgumentError, RecordError):
        return False
    return bool(set(found.command) & set(found.actual))


def _time_unit(table: TextTable, label: Label, step: float) -> float:
    unit = unit_of(table.where, label, ("time",), "specify it with --units")
    if unit is not None:
        return unit.factor
    as_seconds, as_ms = (_SHORTEST_S <= step * unit <= _LONGEST_S for unit in (1.0, 1e-3))
    if as_seconds == as_ms:
        raise ArgumentError(
            f"{table.path}: a time step of {step:g} may be s or ms: specify it with --units, for example ms,mm"
        )
    return 1.0 if as_seconds else 1e-3


def _length_factors(table: TextTable, columns: _Columns) -> list[float]:
    """Factors to mm of the columns after the time; one without a unit gets that of the first column with a unit."""
    labels = [columns.labels[index] for index in columns.used[1:]]
    units = [unit_of(table.where, label, ("displacement",), "specify it with --units") for label in labels]
    factors = [None if unit is None else factor_between(unit, "mm") for unit in units]
    usual = next((each for each in factors if each is not None), 1.0)
    return [usual if each is None else each for each in factors]


def read_log(path: Path, units: tuple[float, float] | None = None) -> ServoLog:
    """Read a servo log."""
    table = TextTable(path)
    columns = _columns(table)
    values = table.numbers(columns.used, _MIN_ROWS)
    if len(values) > _MAX_ROWS:
        raise ArgumentError(f"{path}: more than {_MAX_ROWS} rows")
    bad = np.flatnonzero(np.diff(values[:, 0]) <= 0.0)
    if bad.size:
        row = int(bad[0]) + 1
        when = f"time {values[row, 0]:g} does not come after {values[row - 1, 0]:g}"
        raise ArgumentError(f"{path}:{table.line_of(row)}: {when}")
    step = float(np.median(np.diff(values[:, 0])))
    values[:, 0] *= units[0] if units else _time_unit(table, columns.labels[columns.time], step)
    values[:, 1:] *= units[1] if units else _length_factors(table, columns)
    times = values[:, 0] - values[0, 0]
    _refuse_gaps(table, times)
    command = np.full((len(times), 3), np.nan)
    actual = np.full((len(times), 3), np.nan)
    for k, axis in enumerate(columns.command, start=1):
        command[:, "xyz".index(axis)] = values[:, k]
    for k, axis in enumerate(columns.actual, start=1 + len(columns.command)):
        actual[:, "xyz".index(axis)] = values[:, k]
    return ServoLog(str(path), times, command, actual if columns.actual else None)


def _refuse_gaps(table: TextTable, times: Array) -> None:
    steps = np.diff(times)
    step = float(np.median(steps))
    if not _SHORTEST_S <= step <= _LONGEST_S:
        raise ArgumentError(
            f"{table.path}: a row every {step * 1e3:g} ms; from 0.02 to 50 ms can be used (see --units)"
        )
    gap = int(np.argmax(steps))
    if steps[gap] > 2.5 * step:
        raise ArgumentError(
            f"{table.path}:{table.line_of(gap + 1)}: {steps[gap] * 1e3:g} ms since the row before, usually "
            f"{step * 1e3:g} ms: rows are missing"
        )
