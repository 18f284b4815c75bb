"""Reads records from text files with columns: CSV of any dialect, and what loggers and spreadsheets write."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.io.layout import (
    Layout,
    cells_of,
    find_layout,
    has_thousands,
    is_clock_time,
    is_number,
    utf8_text,
    without_thousands,
)
from shapegcode.io.options import ReadOptions, stated_unit
from shapegcode.io.record import FloatArray, Quantity, Record
from shapegcode.io.sampling import UnevenTimeError, even_period
from shapegcode.io.units import Label, read_label, units_of

__all__ = ["read_csv"]

_EXAMPLE = "time_s,force_N,acc_m/s^2"
_RESPONSES = ("acceleration", "velocity", "displacement")
#: Fewer samples are no record of a vibration.
_FEWEST_ROWS = 16
#: Faults are looked for in pieces of this size.
_PIECE_BYTES = 4_000_000


@dataclass(frozen=True)
class _Column:
    index: int
    label: Label
    factor: float
    quantity: Quantity = "acceleration"


def _chosen(path: Path, layout: Layout, wanted: str, option: str, labels: list[Label]) -> int:
    """Index of the column that an option names."""
    if wanted.strip().isdigit():
        number = int(wanted)
        if not 1 <= number <= layout.columns:
            raise RecordError(f"{path}: {option} {number}: the file has columns 1 to {layout.columns}")
        return number - 1
    plain = wanted.strip().lower()
    found = [index for index, label in enumerate(labels) if label.text.lower() == plain]
    found = found or [index for index, label in enumerate(labels) if label.text.lower().startswith(plain)]
    if len(found) != 1:
        what = "no column has" if not found else f"{len(found)} columns have"
        raise RecordError(f"{path}:{layout.header_line}: {option} {wanted!r}: {what} this name; {_listed(labels)}")
    return found[0]


def _listed(labels: list[Label]) -> str:
    return "the header names " + ", ".join(repr(label.text) for label in labels if label.text)


class _Reader:
    """Chooses the columns of one file."""

    def __init__(self, path: Path, layout: Layout, options: ReadOptions) -> None:
        self.path, self.layout, self.options = path, layout, options
        units = [*layout.units, *[""] * (layout.columns - len(layout.units))]
        header = layout.header or [""] * layout.columns
        self.labels = [read_label(text, unit) for text, unit in zip(header, units, strict=False)]
        self.labels += [Label("", None, None, None)] * (layout.columns - len(self.labels))
        self.where = f"{path}:{layout.header_line}" if layout.header else f"{path}"
        self.warnings: list[str] = []

    def _column(self, index: int, allowed: tuple[str, ...], option_unit: str | None, scale: float | None) -> _Column:
        label = self.labels[index]
        name = repr(label.text) if label.text else f"column {index + 1}"
        known = "; ".join(units_of(measures) for measures in allowed)  # type: ignore[arg-type]
        said = label.measures if label.measures in _RESPONSES else None
        wanted = self.options.quantity if "acceleration" in allowed else None
        quantity = wanted or said or "acceleration"
        if scale is not None:
            return _Column(index, label, scale, quantity)  # type: ignore[arg-type]
        unit = stated_unit(option_unit, allowed) or (None if option_unit else label.unit)
        if unit is None and label.unknown_unit:
            raise RecordError(
                f"{self.where}: {name}: the unit {label.unknown_unit!r} is not known; needed is one of {known}; "
                "state the unit, or the scale of a signal in volts (--force-scale, --response-scale)"
            )
        if unit is None and allowed == ("time",):
            return _Column(index, label, 1.0)
        if unit is None:
            base = {"force": "N", "velocity": "m/s", "displacement": "m"}.get(
                quantity if "acceleration" in allowed else allowed[0], "m/s²"
            )
            self.warnings.append(f"{name} has no unit: {base} is taken")
            return _Column(index, label, 1.0, quantity)  # type: ignore[arg-type]
        named = label.measures in {"time", "force", *_RESPONSES} and label.measures != unit.measures
        if unit.measures not in allowed or (named and not option_unit) or (wanted and unit.measures != wanted):
            meant = wanted or (label.measures if named else allowed[0])
            raise RecordError(
                f"{self.where}: {name} has the unit {unit.name} of {unit.measures}, it should be {meant}: name and "
                f"unit must agree; needed is one of {known}"
            )
        return _Column(index, label, unit.factor, unit.measures)  # type: ignore[arg-type]

    def time(self) -> _Column | None:
        """The column of the time; None: there is none, and a period is stated."""
        options = self.options
        if options.time_column is not None:
            index = _chosen(self.path, self.layout, options.time_column, "--time-column", self.labels)
        else:
            found = [k for k, label in enumerate(self.labels) if label.measures == "time"]
            if not found:
                if options.period_s is not None or self.layout.period_s is not None:
                    return None
                raise RecordError(
                    f"{self.where}: no column of time; {_listed(self.labels)}; needed is one called time (or t, Zeit), "
                    "--time-column, or the period (--period)"
                )
            index = found[0]
            if len(found) > 1:
                self.warnings.append(f"{len(found)} columns of time: {self.labels[index].text!r} is used")
        return self._column(index, ("time",), options.time_unit, None)

    def force(self) -> _Column | None:
        """The column of the force; None: there is none, a free decay."""
        options = self.options
        if options.ignore_force:
            return None
        if options.force_column is not None:
            index = _chosen(self.path, self.layout, options.force_column, "--force-column", self.labels)
        else:
            found = [k for k, label in enumerate(self.labels) if label.measures == "force"]
            if len(found) > 1 and options.axis:
                found = [k for k in found if self.labels[k].axis in {options.axis, None}]
            if not found:
                return None
            if len(found) > 1:
                names = ", ".join(repr(self.labels[k].text) for k in found)
                raise RecordError(f"{self.where}: {len(found)} columns of force, {names}: choose with --force-column")
            index = found[0]
        return self._column(index, ("force",), options.force_unit, options.force_scale)

    def responses(self, taken: set[int]) -> list[_Column]:
        """The columns of the response, one per axis."""
        options = self.options
        if options.response_columns:
            found = [
                _chosen(self.path, self.layout, name, "--response-column", self.labels)
                for name in options.response_columns
            ]
        else:
            kinds = {"response", *_RESPONSES}
            found = [k for k, label in enumerate(self.labels) if label.measures in kinds and k not in taken]
            if options.axis is not None:
                named = [k for k in found if self.labels[k].axis is not None]
                chosen = [k for k in named if self.labels[k].axis == options.axis]
                if named and not chosen:
                    axes = ", ".join(sorted({self.labels[k].axis or "" for k in named}))
                    raise RecordError(
                        f"{self.where}: --axis {options.axis}: the responses are along {axes}; {_listed(self.labels)}"
                    )
                found = chosen or found
        if not found:
            raise RecordError(
                f"{self.where}: no column of a response; {_listed(self.labels)}; needed is an acceleration, velocity "
                f"or displacement, as in {_EXAMPLE!r}, or --response-column"
            )
        columns = [self._column(k, _RESPONSES, options.response_unit, options.response_scale) for k in found]
        self._refuse_mixed(columns)
        return columns

    def _refuse_mixed(self, columns: list[_Column]) -> None:
        quantities = sorted({column.quantity for column in columns})
        names = ", ".join(repr(column.label.text or f"column {column.index + 1}") for column in columns)
        if len(quantities) > 1:
            raise RecordError(
                f"{self.where}: the responses {names} are {' and '.join(quantities)}: must be one quantity; choose "
                "with --response-column or --axis"
            )
        axes = [column.label.axis for column in columns]
        if len(set(axes)) < len(axes) and not self.options.response_columns:
            raise RecordError(
                f"{self.where}: {len(columns)} responses, {names}, and not one for each of the axes x, y, z: choose "
                "with --response-column or --axis"
            )


class _Body:
    """The rows of numbers of a file."""

    def __init__(self, path: Path, data: bytes, layout: Layout) -> None:
        self.path, self.layout = path, layout
        self.used: list[int] = []
        offset = 0
        for _ in range(layout.first_row - 1):
            offset = data.index(b"\n", offset) + 1
        self.data = data[offset:]

    def numbers(self, used: list[int]) -> FloatArray:
        """Some columns, shape (rows, columns used).

        Args:
            used: their indices.

        Raises:
            RecordError: a cell is not a finite number; with line, column and text.
        """
        self.used = used
        try:
            table = self._table(self.data)
        except (ValueError, IndexError) as error:
            self._refuse_bad_cell()
            raise RecordError(f"{self.path}: {error}") from error
        if not np.isfinite(table).all():
            self._refuse_bad_cell()
        if self.layout.decimal_comma:
            self._refuse_points()
        if len(table) < _FEWEST_ROWS:
            raise RecordError(
                f"{self.path}: {len(table)} rows of numbers: too short; a record has at least {_FEWEST_ROWS}, a good "
                "one some 1000"
            )
        return table

    def _table(self, data: bytes) -> FloatArray:
        if self.layout.decimal_comma:
            data = without_thousands(data).replace(b",", b".")
        return np.loadtxt(
            io.TextIOWrapper(io.BytesIO(data), encoding="latin-1"),
            delimiter=None if self.layout.delimiter == " " else self.layout.delimiter,
            usecols=self.used,
            comments="#",
            quotechar='"' if b'"' in data else None,
            ndmin=2,
            dtype=np.float64,
        )

    def _pieces(self) -> Iterator[tuple[int, bytes]]:
        """(number of its first line, text) of pieces of the file, so that faults are found without going "
        "through it all."""
        number, start = self.layout.first_row, 0
        while start < len(self.data):
            end = self.data.find(b"\n", start + _PIECE_BYTES) + 1 or len(self.data)
            piece = self.data[start:end]
            yield number, piece
            number += piece.count(b"\n")
            start = end

    def _lines(self, first: int, piece: bytes) -> Iterator[tuple[int, str]]:
        """(number, text) of the lines with cells."""
        for number, line in enumerate(piece.split(b"\n"), start=first):
            text = line.decode("latin-1").partition("#")[0]
            if text.strip():
                yield number, text

    def first_cell(self, index: int) -> str:
        """The cell of a column in the first row; empty where there is none."""
        _, text = next((line for piece in self._pieces() for line in self._lines(*piece)), (0, ""))
        cells = cells_of(text, self.layout.delimiter)
        return cells[index] if index < len(cells) else ""

    def line_of(self, row: int) -> int:
        """Line number of a row."""
        lines = (number for piece in self._pieces() for number, _ in self._lines(*piece))
        return next(islice(lines, row, None))

    def _is_good(self, piece: bytes) -> bool:
        if not piece.strip():
            return True
        try:
            return bool(np.isfinite(self._table(piece)).all())
        except (ValueError, IndexError):
            return False

    def _refuse_bad_cell(self) -> None:
        comma = self.layout.decimal_comma
        names = self.layout.header
        bad = (piece for piece in self._pieces() if not self._is_good(piece[1]))
        for number, text in (line for piece in bad for line in self._lines(*piece)):
            cells = cells_of(text, self.layout.delimiter)
            for index in self.used:
                name = f" ({names[index]})" if index < len(names) else ""
                if index >= len(cells):
                    raise RecordError(
                        f"{self.path}:{number}: {len(cells)} cells, column {index + 1}{name} is missing: every row "
                        f"must have it; the line is {text.strip()[:80]!r}"
                    )
                cell = cells[index]
                plain = without_thousands(cell.encode()).decode().replace(",", ".") if comma else cell
                finite = is_number(cell, comma) and math.isfinite(float(plain))
                if is_clock_time(cell):
                    raise RecordError(
                        f"{self.path}:{number}: column {index + 1}{name} {cell!r} is a time of the day, which is not "
                        "read: state the time between two samples (--period, for example --period 0.1ms), or export "
                        "seconds"
                    )
                if not finite:
                    kind = "is empty" if not cell else f"{cell!r} is not a finite number"
                    dialect = "comma" if comma else "point"
                    raise RecordError(
                        f"{self.path}:{number}: column {index + 1}{name} {kind}: every cell must be a number (decimal "
                        f"{dialect}, columns divided by {self.layout.delimiter_name})"
                    )

    def _refuse_points(self) -> None:
        """Points for thousands, or both kinds of numbers: where decimal commas are, points are not wanted."""
        pieces = (piece for piece in self._pieces() if b"." in piece[1])
        for number, text in (line for piece in pieces for line in self._lines(*piece)):
            cells = cells_of(text, self.layout.delimiter)
            for index in self.used:
                if "." in cells[index] and not has_thousands(cells[index]):
                    raise RecordError(
                        f"{self.path}:{number}: column {index + 1}: {cells[index]!r} has a decimal point, other cells "
                        "have decimal commas: must be the same throughout, without separators of thousands"
                    )


def read_csv(path: Path, options: ReadOptions) -> list[Record]:
    """Read a text file with columns.

    Returns:
        One record per response column.

    Raises:
        RecordError: what was found and what is needed, with line and text of the cell.
        OSError: the file cannot be read.
    """
    data = utf8_text(path)
    named = (options.time_column, *options.response_columns)
    by_number = bool(options.response_columns) and all(name is None or name.strip().isdigit() for name in named)
    layout = find_layout(path, data, by_number)
    reader = _Reader(path, layout, options)
    if layout.skipped:
        lines = "line" if layout.skipped == 1 else "lines"
        reader.warnings.append(
            f"note: {path}: {layout.skipped} {lines} before the header in line {layout.header_line} left out"
        )
    time = reader.time()
    force = reader.force()
    taken = {column.index for column in (time, force) if column is not None}
    responses = reader.responses(taken)
    body = _Body(path, data, layout)
    if time is not None and options.period_s is not None and is_clock_time(body.first_cell(time.index)):
        reader.warnings.append(
            f"note: {path}: {time.label.text!r} holds times of the day, which are not read: the stated period of "
            f"{options.period_s:.6g} s is taken"
        )
        time = None
    columns = [column for column in (time, force, *responses) if column is not None]
    table = body.numbers([column.index for column in columns])
    stated = options.period_s if options.period_s is not None else layout.period_s
    start_s = 0.0
    if time is None:
        assert stated is not None
        period = stated
        if options.period_s is None:
            reader.warnings.append(f"no column of time: the preamble's {1.0 / period:.9g} samples per second are taken")
    else:
        times = table[:, 0] * time.factor
        try:
            period, notes = even_period(times, stated)
        except UnevenTimeError as error:
            raise RecordError(f"{path}:{body.line_of(error.row)}: {error}") from error
        reader.warnings += notes
        start_s = float(times[0])
        if time.label.unit is None and options.time_unit is None:
            reader.warnings.append(f"the time has no unit: s is taken, {1.0 / period:.6g} samples per second")
    at = 0 if time is None else 1
    force_n = None
    if force is not None:
        force_n = np.ascontiguousarray(table[:, at] * force.factor)
        at += 1
    several = len(responses) > 1
    return [
        Record(
            source=f"{path} {column.label.text}" if several else str(path),
            period_s=period,
            response=np.ascontiguousarray(table[:, at + k] * column.factor),
            quantity=column.quantity,
            force_n=force_n,
            axis=column.label.axis or (options.axis if not several else None),
            start_s=start_s,
            warnings=tuple(reader.warnings),
        )
        for k, column in enumerate(responses)
    ]
