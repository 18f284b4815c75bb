"""What is typed for an option as a value: numbers with units, shares, ranges. One rule for each kind on every command.

Each function takes the text as it is typed and raises `argparse.ArgumentTypeError`, whose message says what it must be.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Mapping
from typing import NoReturn

_LARGEST_OVERRIDE = 2.54
_SIZE_UNITS = {"": 1, "k": 1024, "M": 1024**2, "G": 1024**3}
_LENGTH_UNITS = {"um": 1.0, "µm": 1.0, "mm": 1e3}
_TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}


def _refuse(text: str, must: str) -> NoReturn:
    raise argparse.ArgumentTypeError(f"{text!r}: must be {must}")


def program_number(text: str) -> int:
    """An O number with or without its letter."""
    match = re.fullmatch(r"[Oo]?0*([1-9][0-9]{0,7})", text)
    return int(match[1]) if match else _refuse(text, "a program number, O1 ... O99999999")


def program_choice(text: str) -> int | str:
    """Which program of a file: its O number, an address, or all of them."""
    if text == "all" or re.fullmatch(r"#[1-9][0-9]{0,8}|(.*/)?<[^<>]+>|.*/[Oo]?[0-9]{1,8}", text):
        return text
    try:
        return program_number(text)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f"{error}, /FOLDER/O1, <NAME>, #3 for the third one, or all") from None


def axes(text: str) -> str:
    """Axes such as ``XZ``, ``x,z`` or ``"x z"``."""
    letters = set(re.sub(r"[\s,]+", "", text.lower()))
    if not letters or letters - set("xyz"):
        _refuse(text, "axes, for example X or XZ")
    return "".join(sorted(letters))


def line_range(text: str) -> tuple[int, int]:
    """Lines such as ``120-180`` or ``120``, first and last, from 1."""
    match = re.fullmatch(r"0*([1-9][0-9]{0,9})(?:-0*([1-9][0-9]{0,9}))?", text)
    first, last = (int(match[1]), int(match[2] or match[1])) if match else (1, 0)
    return (first, last) if first <= last else _refuse(text, "lines, first to last, for example 120-180")


def line_ranges(text: str) -> tuple[tuple[int, int], ...]:
    """Ranges of lines such as ``12-80,95-240``."""
    return tuple(line_range(part.strip()) for part in text.split(","))


def count(text: str) -> int:
    """A whole number, 1 or more."""
    match = re.fullmatch(r"0*([1-9][0-9]{0,11})", text)
    return int(match[1]) if match else _refuse(text, "a whole number, 1 or more")


def _share(text: str) -> float:
    return number(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)


def ratio(text: str) -> float:
    """A share such as ``60%`` or ``0.6``, above 0 and at most 1."""
    return value if 0.0 < (value := _share(text)) <= 1.0 else _refuse(text, "above 0 and at most 100%")


def share(text: str) -> float:
    """A share such as ``3%`` or ``0.03``, at least 0 and below 1."""
    return value if 0.0 <= (value := _share(text)) < 1.0 else _refuse(text, "at least 0 and below 100%")


def override(text: str) -> float:
    """A feed override such as ``80%`` or ``0.8``, above 0 and at most 254 % (what a control takes)."""
    most = _LARGEST_OVERRIDE
    return value if 0.0 < (value := _share(text)) <= most else _refuse(text, f"above 0 and at most {most:.0%}")


def seconds(text: str) -> float:
    """A time with its unit, such as ``5ms`` or ``0.005s``."""
    return _with_unit(text, "time", _TIME_UNITS, "5ms")


def start_time(text: str) -> float:
    """A time with its unit, or 0, which needs none."""
    return 0.0 if text in ("0", "0s", "0ms") else seconds(text)


def frequency_band(text: str) -> tuple[float, float]:
    """Two frequencies in Hz such as ``20:400``, ascending."""
    try:
        low, high = map(float, text.split(":"))
    except ValueError:
        low, high = math.nan, math.nan
    return (low, high) if 0.0 <= low < high < math.inf else _refuse(text, "two frequencies in Hz, for example 20:400")


def micrometres(text: str) -> float:
    """A length with its unit, such as ``5um`` or ``0.005mm``, in µm."""
    return _with_unit(text, "length", _LENGTH_UNITS, "5um")


def _with_unit(text: str, what: str, units: Mapping[str, float], example: str) -> float:
    """A number above 0 with one of the units, times what the unit stands for."""
    match = re.fullmatch(rf"([-+.\d]+(?:[eE][-+]?\d+)?)\s*({'|'.join(units)})", text)
    try:
        value = float(match[1]) * units[match[2]] if match else 0.0
    except ValueError:
        value = 0.0
    typed = ", ".join(unit for unit in units if unit.isascii())
    good = math.isfinite(value) and value > 0.0
    return value if good else _refuse(text, f"a {what} above 0 with its unit ({typed}), for example {example}")


def size(text: str) -> int:
    """A number of bytes such as ``262144``, ``256k``, ``1M`` or ``2G`` (1024 bytes, 1024 k, 1024 M), above 0."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)([kMG]?)", text)
    value = math.floor(float(match[1]) * _SIZE_UNITS[match[2]]) if match else 0
    return value if value >= 1 else _refuse(text, "a number of bytes above 0, for example 65536, 64k or 1M")


def positive(text: str) -> float:
    """A number above 0."""
    return value if math.isfinite(value := number(text)) and value > 0.0 else _refuse(text, "above 0")


def nonzero(text: str) -> float:
    """A number other than 0."""
    return value if math.isfinite(value := number(text)) and value != 0.0 else _refuse(text, "a number other than 0")


def number(text: str) -> float:
    """A number."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no number") from None
