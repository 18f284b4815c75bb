"""Reads text tables: layout (delimiter, decimal comma, preamble, header, row of units), rows of numbers.

Errors give line, column and text of the cell.
"""

import codecs
import csv
import io
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.io.data_file import MAX_TEXT_BYTES, DataFile, read_file
from shapegcode.io.units import FloatArray, Label, find_unit, tap_label

_LOG_HEAD_BYTES = 65_536


def chunks(path: Path) -> Iterator[bytes]:
    """Yield pieces of a file: a byte order mark is removed, and UTF-16 becomes UTF-8."""
    decoder: codecs.IncrementalDecoder | None = None
    first = True
    with DataFile(path) as file:
        for raw in file.pieces():
            piece = raw
            if first and piece[:2] in {codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE}:
                decoder = codecs.getincrementaldecoder("utf-16")(errors="replace")
            if decoder is not None:
                piece = decoder.decode(piece).encode("utf-8")
            if first:
                piece = piece.removeprefix(codecs.BOM_UTF8)
            first = False
            yield piece


def line_chunks(path: Path) -> Iterator[list[bytes]]:
    """Yield the lines of a file in batches, without line feeds."""
    rest = b""
    for piece in chunks(path):
        lines = (rest + piece).split(b"\n")
        rest = lines.pop()
        if len(rest) > MAX_TEXT_BYTES:
            raise RecordError(f"{path}: a line of more than {MAX_TEXT_BYTES} bytes: not a text file with lines")
        yield lines
    if rest:
        yield [rest]


def head_of(path: Path) -> bytes:
    """The beginning of a file."""
    head = next(chunks(path), b"")[:_LOG_HEAD_BYTES]
    if not head.strip():
        raise RecordError(f"{path}: the file is empty; required: the log of a run")
    if head[:4] != b"PK\x03\x04":
        refuse_binary(path, head, "a log of a run: SHDR text, MTConnect streams, Sinumerik Edge JSON or a table")
    return head


_TEXT_BYTES = frozenset(range(32, 256)) | {9, 10, 12, 13}
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)
#: A thousands point is followed by three digits; a comma after them shows that it is no decimal point.
_THOUSANDS = r"\d{1,3}(?:\.\d{3})+(?=,\d)"
_COMMA_NUMBER = re.compile(
    rf"[+-]?({_THOUSANDS},\d+|\d+(,\d+)?|,\d+)(e[+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE
)


def utf8_text(path: Path) -> bytes:
    """Read text as ASCII-compatible bytes with line feeds."""
    data = read_file(path)
    if data[:2] in {b"\xff\xfe", b"\xfe\xff"}:
        data = data.decode("utf-16", errors="replace").encode("utf-8")
    data = data.removeprefix(b"\xef\xbb\xbf")
    refuse_binary(path, data[:65536], "text with columns, UFF (dataset 58) or WAV")
    if b"\n" not in data[:65536] and b"\r" in data[:65536]:
        data = data.replace(b"\r", b"\n")
    return data


def refuse_binary(path: Path, head: bytes, needed: str) -> None:
    """Refuse a file that is not text."""
    strange = sorted(set(head) - _TEXT_BYTES)
    if strange:
        position = head.index(bytes([strange[0]]))
        raise RecordError(f"{path}: a binary file (byte 0x{strange[0]:02x} at {position}); required: {needed}")


def cells_of(line: str, delimiter: str) -> list[str]:
    """The cells of a line, without quotes and surrounding blanks."""
    if delimiter == " ":
        return line.split()
    if '"' in line:
        line = line.replace("\r", " ")  # the reader takes it for a line end
        row = next(iter(csv.reader([line], delimiter=delimiter, skipinitialspace=True)), [])
        return [cell.strip() for cell in row]
    return [cell.strip() for cell in line.split(delimiter)]


def is_number(cell: str, decimal_comma: bool) -> bool:
    """Whether a cell is a number, NaN and infinity included."""
    return (_COMMA_NUMBER if decimal_comma else _NUMBER).fullmatch(cell) is not None


def is_clock_time(cell: str) -> bool:
    """Whether a cell is a time of the day, with a date or without: ``10:15:00,000391``."""
    return re.search(r"\d{1,2}:\d{2}", cell) is not None


def has_thousands(cell: str) -> bool:
    """Whether a number with a decimal comma has points for thousands: ``1.265,02``."""
    return "." in cell and is_number(cell, True)


def with_point(cell: str) -> str:
    """Replace a decimal comma by a point; thousands points before it are removed."""
    return without_thousands(cell.encode()).decode().replace(",", ".") if "," in cell else cell


def without_thousands(data: bytes) -> bytes:
    """Remove thousands points from numbers with decimal commas."""
    if b"." not in data:
        return data
    return re.sub(rb"(?<![\d.,])" + _THOUSANDS.encode(), lambda found: found[0].replace(b".", b""), data)


_HEAD_BYTES = 262_144  # covers headers of loggers with long preambles
_HEAD_LINES = 400
_ROWS_TO_KNOW = 3  # consecutive rows of numbers that count as data; a preamble may have one or two
_MARK = re.compile(r"^\s*(#+|%+|//+|\*+)\s*")  # comment mark
_NAMES = {"\t": "tab", ";": "semicolon", ",": "comma", " ": "blanks"}
_RATE = re.compile(
    r"(?:sampl\w*[ _-]*(?:rate|freq\w*)|abtast(?:rate|frequenz)|sample_rate|\bfs\b)"
    r"[^\d\w]*(k?hz)?[^\d\w]*([\d.,]+(?:e[+-]?\d+)?)\s*(k?hz)?",
    re.IGNORECASE,
)
_STEP = re.compile(
    r"(?:delta_x|sampl\w*[ _-]*(?:interval|period)|abtastintervall)"
    r"[^\d\w]*(m?s)?[^\d\w]*([\d.,]+(?:e[+-]?\d+)?)\s*(ms|us|µs|s)?\b",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Layout:
    """Layout of a file."""

    delimiter: str  # between cells; " " for any run of blanks
    decimal_comma: bool  # numbers have a decimal comma
    header: list[str]  # cells of the header; empty: no header
    header_line: int  # its line, from 1
    units: list[str]  # cells of the row of units below it (LabVIEW: in the preamble); empty: no such row
    first_row: int  # line of the first row of numbers, from 1
    columns: int  # cells of that row
    skipped: int  # lines before the header
    period_s: float | None = None  # sampling period that the preamble states


@dataclass
class _Rows:
    """The rows of numbers of a text if its lines are split at one delimiter, and where they start."""

    delimiter: str
    start: int
    columns: int
    decimal_comma: bool
    numbers: list[list[str]] = field(default_factory=list)


def _is_row(cells: list[str], strict: bool, delimiter: str) -> bool:
    filled = [cell for cell in cells if cell]
    numbers = sum(is_number(cell, False) or (delimiter != "," and is_number(cell, True)) for cell in filled)
    return numbers == len(filled) > 0 if strict else 2 * numbers > len(filled)


def _rows(lines: list[str], delimiter: str, strict: bool, least: int) -> _Rows | None:
    run: list[int] = []
    split = [cells_of(line, delimiter) for line in lines]
    filled = [index for index, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")]
    for index in filled:
        cells = split[index]
        if len(cells) < least or not _is_row(cells, strict, delimiter):
            run = []
            continue
        if run and len(split[run[-1]]) != len(cells):
            run = []
        run.append(index)
        if len(run) == _ROWS_TO_KNOW or index == filled[-1]:
            sample = [split[k] for k in run]
            comma = delimiter != "," and any(
                "," in cell and is_number(cell, True) for line in split[run[0] :] for cell in line
            )
            return _Rows(delimiter, run[0], len(cells), comma, sample)
    return None


def _find_rows(lines: list[str]) -> _Rows | None:
    for strict in (True, False):
        for delimiter in _NAMES:
            found = _rows(lines, delimiter, strict, 2)
            if found is None:
                continue
            above = next((line for line in reversed(lines[: found.start]) if line.strip()), "")
            if delimiter == "," and found.columns == 2 and above and "," not in above:
                break  # one column with a decimal comma
            return found
    return _rows(lines, ";", True, 1)


def _number(text: str) -> float | None:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return None


def _stated_period(lines: list[str]) -> float | None:
    for line in lines:
        if match := _RATE.search(line):
            rate = _number(match[2])
            if rate:
                kilo = "k" in (match[1] or match[3] or "").lower()
                return 1.0 / (rate * (1000.0 if kilo else 1.0))
        if match := _STEP.search(line):
            step = _number(match[2])
            unit = find_unit(match[1] or match[3] or "s")
            if step and unit is not None:
                return step * unit.factor
    return None


def _labels_known(cells: list[str]) -> int:
    return sum(tap_label(cell).measures is not None for cell in cells)


def find_layout(path: Path, head: bytes, by_number: bool) -> Layout:
    """Find the layout of a text file."""
    lines = _head_lines(head)
    rows = _find_rows(lines)
    if rows is None:
        shown = next((line for line in lines if line.strip()), "")
        raise RecordError(
            f"{path}:1: no rows of numbers among the first {len(lines)} lines; required: columns of numbers separated "
            f"by comma, semicolon, tab or blanks below a header such as 'time_s,force_N,acc_m/s^2'; the first line is "
            f"{shown[:80]!r}"
        )
    above = [
        (number, cells_of(_MARK.sub("", line), rows.delimiter))
        for number, line in enumerate(lines[: rows.start], start=1)
        if re.search(r"\w", line)
    ]
    header, units = _choose_header(path, above, rows, lines)
    if not header[1] and not by_number:
        raise RecordError(
            f"{path}:1: no header: the first line is {lines[rows.start][:80]!r}; required: a line that names the "
            "columns, such as 'time_s,force_N,acc_m/s^2', or columns named by number (--time-column 1 ...)"
        )
    # Cells without a name in the header, except empty ones after the last delimiter.
    is_short = bool(header[1]) and any(any(row[len(header[1]) :]) for row in rows.numbers)
    if _labels_known(header[1][rows.columns :]) or is_short:
        hint = (
            "; decimal commas look like commas between columns: export with semicolons or decimal points"
            if rows.delimiter == "," and rows.columns == 2 * len(header[1])
            else ""
        )
        raise RecordError(
            f"{path}:{header[0]}: header cells, separated by {_NAMES[rows.delimiter]}: {len(header[1])}; of line "
            f"{rows.start + 1}: {rows.columns}; must be equally many, with the same delimiter{hint}; the header is "
            f"{lines[header[0] - 1][:80]!r}"
        )
    return Layout(
        delimiter=rows.delimiter,
        decimal_comma=rows.decimal_comma,
        header=header[1][: rows.columns],
        header_line=header[0],
        units=units,
        first_row=rows.start + 1,
        columns=rows.columns,
        skipped=max(0, header[0] - 1),
        period_s=_stated_period(lines[: max(0, header[0] - 1)]),
    )


def _choose_header(
    path: Path, above: list[tuple[int, list[str]]], rows: _Rows, lines: list[str]
) -> tuple[tuple[int, list[str]], list[str]]:
    if not above:
        return (0, []), []
    number, cells = above[-1]
    if cells[0].lower() == "x_value":  # LabVIEW's preamble states the units of the signals, not of the time
        units = next((line[1:] for _, line in reversed(above) if line[0].lower() == "y_unit_label"), [])
        return above[-1], ["", *units] if units else []
    filled = [cell for cell in cells if cell.strip(" -[]()")]
    known = sum(find_unit(cell) is not None for cell in filled)
    if filled and 2 * known >= len(filled) and len(above) > 1:
        before = above[-2]
        if len(before[1]) == len(cells) and (known == len(filled) or _labels_known(before[1]) > 1):
            return before, cells
    if _labels_known(cells) and not _is_row(cells, False, rows.delimiter):
        return above[-1], []
    for at in range(len(above) - 2, -1, -1):
        if len(above[at][1]) == rows.columns and _labels_known(above[at][1]) > 1:
            _refuse_between(path, above[at + 1 :], rows, lines)
    if all(is_number(cell, True) or is_number(cell, False) for cell in cells if cell):
        return (0, []), []
    return (number, cells), []


def _refuse_between(path: Path, between: list[tuple[int, list[str]]], rows: _Rows, lines: list[str]) -> None:
    for number, cells in between:
        for at, cell in enumerate(cells, start=1):
            if not (is_number(cell, False) or (rows.delimiter != "," and is_number(cell, True))):
                raise RecordError(
                    f"{path}:{number}: column {at}: {cell!r} is not a number; below the header only a row of units and "
                    f"rows of numbers are allowed; the line is {lines[number - 1][:80]!r}"
                )
    number, cells = between[0]
    raise RecordError(f"{path}:{number}: {len(cells)} cells, the rows below have {rows.columns}: must be equally many")


def _head_lines(head: bytes) -> list[str]:
    part = head[:_HEAD_BYTES]
    try:
        text = part.decode("utf-8")
    except UnicodeDecodeError as error:
        whole = len(part) < len(head) and error.start > len(part) - 4
        text = part[: error.start].decode("utf-8") if whole else part.decode("cp1252", errors="replace")
    lines = text.split("\n")
    if len(part) < len(head):
        lines = lines[:-1]
    return [line.rstrip("\r") for line in lines[:_HEAD_LINES]]


_PIECE_BYTES = 4_000_000  # faults are searched in pieces of this size


class TextTable:
    """A text file with columns."""

    def __init__(self, path: Path, *, by_number: bool = False) -> None:
        self.path = path
        data = utf8_text(path)
        self.layout = find_layout(path, data, by_number)
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
                finite = is_number(cell, comma) and math.isfinite(float(with_point(cell)))
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
                        f"{dialect}, columns separated by {_NAMES[self.layout.delimiter]})"
                    )

    def _refuse_points(self) -> None:
        """Refuse decimal points in a file with decimal commas, where a point may only separate thousands."""
        pieces = (piece for piece in self._pieces() if b"." in piece[1])
        for number, text in (line for piece in pieces for line in self._lines(*piece)):
            cells = cells_of(text, self.layout.delimiter)
            for index in self.used:
                if "." in cells[index] and not has_thousands(cells[index]):
                    raise RecordError(
                        f"{self.path}:{number}: column {index + 1}: {cells[index]!r} has a decimal point, other cells "
                        "have decimal commas: must be the same throughout, without thousands separators"
                    )
