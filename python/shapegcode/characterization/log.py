"""Reads servo logs: CSV with a header, time and axis positions, whatever the columns are called."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shapegcode._core import ArgumentError

__all__ = ["ServoLog", "parse_units", "read_log"]

Array = npt.NDArray[np.float64]
_ACTUAL = {"act", "actual", "fb", "feedback", "fbk", "measured", "meas", "ist", "real"}
_TIME = {"time", "t", "timestamp", "zeit"}
_TIME_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "µs": 1e-6}
_LENGTH_UNITS = {"mm": 1.0, "um": 1e-3, "µm": 1e-3, "m": 1000.0, "inch": 25.4, "in": 25.4}
_HEAD_LINES = 50
_MAX_ROWS = 20_000_000
_SHORTEST_S, _LONGEST_S = 2e-5, 0.05


@dataclass(frozen=True)
class ServoLog:
    """One record.

    Attributes:
        file: where it was read.
        times_s: time of each row, from 0 on.
        command_mm: shape (n, 3), commanded X, Y, Z; NaN for an axis that was not recorded.
        actual_mm: the same for actual positions; None if none was recorded.
    """

    file: str
    times_s: Array
    command_mm: Array
    actual_mm: Array | None

    @property
    def sampling_s(self) -> float:
        """Median time between two rows in s."""
        return float(np.median(np.diff(self.times_s)))


def parse_units(text: str) -> tuple[float, float]:
    """Read ``TIME,LENGTH``, for example ``ms,um``: the factors to s and mm.

    Raises:
        ArgumentError: a unit is not known.
    """
    words = [word.strip().lower() for word in text.split(",")]
    if len(words) != 2 or words[0] not in _TIME_UNITS or words[1] not in _LENGTH_UNITS:
        raise ArgumentError(
            f"--units {text}: must be TIME,LENGTH with TIME of {', '.join(_TIME_UNITS)} and LENGTH of "
            f"{', '.join(_LENGTH_UNITS)}"
        )
    return _TIME_UNITS[words[0]], _LENGTH_UNITS[words[1]]


def _split(line: str, delimiter: str) -> list[str]:
    cells = line.split() if delimiter == " " else line.split(delimiter)
    return [cell.strip().strip('"') for cell in cells]


def _tokens(cell: str) -> set[str]:
    return set(re.findall(r"[a-zµ]+", cell.lower().replace("μ", "µ")))


@dataclass
class _Columns:
    time: int
    time_unit: float | None
    command: dict[int, int]
    actual: dict[int, int]
    length_unit: float | None


def _columns(cells: list[str]) -> _Columns | None:
    """What the cells of a header mean; None if they are no header."""
    found = _Columns(-1, None, {}, {}, None)
    for index, cell in enumerate(cells):
        tokens = _tokens(cell)
        if tokens & _TIME:
            found.time = index
            found.time_unit = next((_TIME_UNITS[unit] for unit in tokens if unit in _TIME_UNITS), None)
            continue
        axes = tokens & {"x", "y", "z"}
        joined = re.fullmatch(r"([xyz])(a|act|c|cmd|com)", cell.lower().strip())
        if joined:
            axes, tokens = {joined[1]}, tokens | ({"act"} if joined[2].startswith("a") else set())
        if len(axes) != 1:
            continue
        target = found.actual if tokens & _ACTUAL else found.command
        target.setdefault("xyz".index(axes.pop()), index)
        unit = next((_LENGTH_UNITS[each] for each in tokens if each in _LENGTH_UNITS), None)
        found.length_unit = found.length_unit or unit
    return found if found.time >= 0 and (found.command or found.actual) else None


def _header(path: Path, lines: list[str]) -> tuple[int, str, _Columns]:
    for number, line in enumerate(lines[:_HEAD_LINES]):
        for delimiter in (";", "\t", ",", " "):
            if delimiter in line and (columns := _columns(_split(line, delimiter))):
                return number, delimiter, columns
    shown = lines[0][:60] if lines else ""
    raise ArgumentError(
        f"{path}:1: no header with a time and an axis among the first {_HEAD_LINES} lines; wanted for example "
        f"time_ms,X,Y,Z or time_ms,X,Y,Z,X_act,Y_act,Z_act; the first line is {shown!r}"
    )


def _time_unit(path: Path, columns: _Columns, units: tuple[float, float] | None, step: float) -> float:
    if units is not None:
        return units[0]
    if columns.time_unit is not None:
        return columns.time_unit
    as_seconds, as_ms = (_SHORTEST_S <= step * unit <= _LONGEST_S for unit in (1.0, 1e-3))
    if as_seconds == as_ms:
        raise ArgumentError(f"{path}: a time step of {step:g} may be s or ms: say it with --units, for example ms,mm")
    return 1.0 if as_seconds else 1e-3


def read_log(path: Path, units: tuple[float, float] | None = None) -> ServoLog:
    """Read a servo log.

    Args:
        path: CSV with a header; the delimiter is found out, a decimal comma is read where it does not delimit.
        units: factors to s and mm; None: from the header (``time_ms``, ``X [um]``), else a time step from 0.02 to 50 ms
            and mm.

    Raises:
        ArgumentError: what is wrong, with file, line, value and limit.
        OSError: the file cannot be read.
    """
    try:
        lines = path.read_bytes().decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise ArgumentError(f"{path}: not UTF-8 text (byte 0x{error.object[error.start]:02x})") from error
    at, delimiter, columns = _header(path, lines)
    if not columns.command:
        raise ArgumentError(
            f"{path}:{at + 1}: only actual positions; the commanded ones are needed (columns X, Y, Z or X_cmd, ...)"
        )
    wanted = [columns.time, *columns.command.values(), *columns.actual.values()]
    rows: list[list[float]] = []
    numbers: list[int] = []
    for number, line in enumerate(lines[at + 1 :], start=at + 2):
        if not line.strip():
            continue
        cells = _split(line, delimiter)
        row = []
        for index in wanted:
            cell = cells[index] if index < len(cells) else ""
            if delimiter != ",":
                cell = cell.replace(",", ".")
            try:
                value = float(cell)
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                raise ArgumentError(f"{path}:{number}: column {index + 1}: {cell!r} is not a finite number")
            row.append(value)
        if rows and row[0] <= rows[-1][0]:
            raise ArgumentError(f"{path}:{number}: time {row[0]:g} does not come after {rows[-1][0]:g}")
        rows.append(row)
        numbers.append(number)
        if len(rows) > _MAX_ROWS:
            raise ArgumentError(f"{path}: more than {_MAX_ROWS} rows")
    if len(rows) < 100:
        raise ArgumentError(f"{path}: {len(rows)} rows; a test has at least 100")
    table = np.array(rows)
    table[:, 0] *= _time_unit(path, columns, units, float(np.median(np.diff(table[:, 0]))))
    table[:, 1:] *= units[1] if units else (columns.length_unit or 1.0)
    times = table[:, 0] - table[0, 0]
    steps = np.diff(times)
    step = float(np.median(steps))
    if not _SHORTEST_S <= step <= _LONGEST_S:
        raise ArgumentError(f"{path}: a row every {step * 1e3:g} ms; from 0.02 to 50 ms can be used (see --units)")
    gap = int(np.argmax(steps))
    if steps[gap] > 2.5 * step:
        raise ArgumentError(
            f"{path}:{numbers[gap + 1]}: {steps[gap] * 1e3:g} ms since the row before, usually {step * 1e3:g} ms: "
            "rows are missing"
        )
    command = np.full((len(times), 3), np.nan)
    for k, axis in enumerate(columns.command, start=1):
        command[:, axis] = table[:, k]
    actual: Array | None = None
    if columns.actual:
        actual = np.full((len(times), 3), np.nan)
        for k, axis in enumerate(columns.actual, start=1 + len(columns.command)):
            actual[:, axis] = table[:, k]
    return ServoLog(str(path), times, command, actual)
