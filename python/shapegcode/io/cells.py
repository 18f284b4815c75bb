"""Cells of text files with columns: what divides them, and which of them are numbers, whatever their decimal sign."""

from __future__ import annotations

import csv
import re
from pathlib import Path

from shapegcode.errors import RecordError
from shapegcode.io.data_file import read_file

__all__ = [
    "cells_of", "has_thousands", "is_clock_time", "is_number", "refuse_binary", "utf8_text", "without_thousands",
]  # fmt: skip

_TEXT_BYTES = frozenset(range(32, 256)) | {9, 10, 12, 13}
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)
#: Behind a point for thousands stand three digits; the comma behind the last of them tells it from a decimal point.
_THOUSANDS = r"\d{1,3}(?:\.\d{3})+(?=,\d)"
_COMMA_NUMBER = re.compile(
    rf"[+-]?({_THOUSANDS},\d+|\d+(,\d+)?|,\d+)(e[+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE
)


def utf8_text(path: Path) -> bytes:
    """The text as ASCII-compatible bytes with line feeds."""
    data = read_file(path)
    if data[:2] in {b"\xff\xfe", b"\xfe\xff"}:
        data = data.decode("utf-16", errors="replace").encode("utf-8")
    data = data.removeprefix(b"\xef\xbb\xbf")
    refuse_binary(path, data[:65536], "text with columns, UFF (dataset 58) or WAV")
    if b"\n" not in data[:65536] and b"\r" in data[:65536]:
        data = data.replace(b"\r", b"\n")
    return data


def refuse_binary(path: Path, head: bytes, needed: str) -> None:
    """Refuse a file that is no text."""
    strange = sorted(set(head) - _TEXT_BYTES)
    if strange:
        place = head.index(bytes([strange[0]]))
        raise RecordError(f"{path}: a binary file (byte 0x{strange[0]:02x} at {place}); needed is {needed}")


def cells_of(line: str, delimiter: str) -> list[str]:
    """The cells of a line, without quotes and surrounding blanks."""
    if delimiter == " ":
        return line.split()
    if '"' in line:
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


def without_thousands(data: bytes) -> bytes:
    """Text of numbers with decimal commas, points for thousands left out."""
    if b"." not in data:
        return data
    return re.sub(rb"(?<![\d.,])" + _THOUSANDS.encode(), lambda found: found[0].replace(b".", b""), data)
