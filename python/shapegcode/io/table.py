"""Reads text tables: layout, header with units, rows of numbers.

Delimiter, decimal comma, preamble and a row of units are detected (`shapegcode.io.layout`). Errors give
line, column and text of the cell.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.io.columns import Label
from shapegcode.io.layout import (
    cells_of,
    find_layout,
    has_thousands,
    is_clock_time,
    is_number,
    utf8_text,
    without_thousands,
)
from shapegcode.io.units import FloatArray

_PIECE_BYTES = 4_000_000  # faults are searched in pieces of this size


class TextTable:
    """A text file with columns."""

    def __init__(self, path: Path, *, by_number: bool = False) -> None:
        self.path = path  # path
        data = utf8_text(path)
        self.layout = find_layout(path, data, by_number)  # its layout
        self.where = f"{path}:{self.layout.header_line}" if self.layout.header else f"{path}"
        self.used: list[int] = []  # indices of the columns requested last
        offset = 0
        for _ in range(self.layout.first_row - 1):
            offset = data.index(b"\n", offset) + 1
        self.data = data[offset:]

    def labels(self, read: Callable[[str, str], Label]) -> list[Label]:
        """Parsed label of each column."""
        count = self.layout.columns
        units = [*self.layout.units, *[""] * count][:count]
        header = [*self.layout.header, *[""] * count][:count]
        return [read(text, unit) for text, unit in zip(header, units, strict=True)]

    def numbers(self, used: list[int], fewest: int) -> FloatArray:
        """Read columns, shape (rows, columns used)."""
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
        if len(table) < fewest:
            raise RecordError(f"{self.path}: {len(table)} rows of numbers: too short; required: at least {fewest}")
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
        """Yield pieces of the file with the number of their first line, to find faults without parsing all of it."""
        number, start = self.layout.first_row, 0
        while start < len(self.data):
            end = self.data.find(b"\n", start + _PIECE_BYTES) + 1 or len(self.data)
            piece = self.data[start:end]
            yield number, piece
            number += piece.count(b"\n")
            start = end

    def _lines(self, first: int, piece: bytes) -> Iterator[tuple[int, str]]:
        """Yield number and text of the lines with cells."""
        for number, line in enumerate(piece.split(b"\n"), start=first):
            text = line.decode("latin-1").partition("#")[0]
            if text.strip():
                yield number, text

    def first_cell(self, index: int) -> str:
        """Cell of a column in the first row; empty if missing."""
        _, text = next((line for piece in self._pieces() for line in self._lines(*piece)), (0, ""))
        cells = cells_of(text, self.layout.delimiter)
        return cells[index] if index < len(cells) else ""

    def line_of(self, row: int) -> int:
        """Line number of a row in the file."""
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
                        f"{self.path}:{number}: column {index + 1}{name} {cell!r} is a time of day, which is not "
                        "supported: state the time between samples (such as --sample-period 0.1ms), or export seconds"
                    )
                if not finite:
                    kind = "is empty" if not cell else f"{cell!r} is not a finite number"
                    dialect = "comma" if comma else "point"
                    raise RecordError(
                        f"{self.path}:{number}: column {index + 1}{name} {kind}: every cell must be a number (decimal "
                        f"{dialect}, columns separated by {self.layout.delimiter_name})"
                    )

    def _refuse_points(self) -> None:
        """Refuse thousands points, or both kinds of numbers: with decimal commas points are invalid."""
        pieces = (piece for piece in self._pieces() if b"." in piece[1])
        for number, text in (line for piece in pieces for line in self._lines(*piece)):
            cells = cells_of(text, self.layout.delimiter)
            for index in self.used:
                if "." in cells[index] and not has_thousands(cells[index]):
                    raise RecordError(
                        f"{self.path}:{number}: column {index + 1}: {cells[index]!r} has a decimal point, other cells "
                        "have decimal commas: must be the same throughout, without thousands separators"
                    )
