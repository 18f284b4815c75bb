"""Reads measured cutting forces: CSV with a header, samples over time or position, or means at radial depths."""

from __future__ import annotations

import io
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shapegcode._core import ArgumentError
from shapegcode.io.layout import (
    Layout,
    cells_of,
    find_layout,
    is_number,
    utf8_text,
    without_thousands,
)
from shapegcode.io.sampling import UnevenTimeError, even_period

__all__ = ["FORCES_ON", "ForceRecord", "read_forces"]

Array = npt.NDArray[np.float64]

FORCES_ON = ("workpiece", "tool")
_EXAMPLE = "time_s,fx_n,fy_n"
_UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6},
    "position": {"mm": 1.0, "um": 1e-3, "µm": 1e-3, "m": 1000.0},
    "depth": {"mm": 1.0, "um": 1e-3, "µm": 1e-3},
    "feed": {"mm/min": 1.0, "mm_per_min": 1.0, "mm/s": 60.0, "mm_per_s": 60.0},
    "force": {"n": 1.0, "kn": 1000.0, "kgf": 9.80665, "lbf": 4.4482216152605},
    "torque": {"nm": 1.0, "n·m": 1.0, "n m": 1.0, "n_m": 1.0, "ncm": 0.01},
}
#: Quantity, and the names under which its column goes (without the unit).
_NAMES = (
    ("time", "time", r"time|t|zeit|timestamp"),
    ("position", "position", r"position|pos|x|s|distance|way"),
    ("radial_depth", "depth", r"radial[ _]?depth|rd|ae|a_e"),
    ("feed", "feed", r"feed|f|vf|v_f|feed[ _]?rate"),
    ("fx", "force", r"f_?x|force[ _]?x|x[ _]?force"),
    ("fy", "force", r"f_?y|force[ _]?y|y[ _]?force"),
    ("torque", "torque", r"torque|m_?z|moment"),
)
_FEWEST_ROWS = 4


@dataclass(frozen=True, eq=False)
class ForceRecord:
    """Measured forces, turned so that they act on the tool.

    Attributes:
        file: where they were read.
        force_n: (n, 2) along the feed and to its left, in N.
        torque_nm: (n,) magnitude as measured; None: not recorded.
        time_s: (n,), evenly spaced; None: not recorded.
        position_mm: (n,) X of the tool's axis in the program's coordinates; None: not recorded.
        radial_depth_mm: (n,) of means at known depths; None: the test cut's description tells it.
        feed_mm_per_min: (n,) where the file tells it.
    """

    file: str
    force_n: Array
    torque_nm: Array | None = None
    time_s: Array | None = None
    position_mm: Array | None = None
    radial_depth_mm: Array | None = None
    feed_mm_per_min: Array | None = None

    def __len__(self) -> int:
        return len(self.force_n)


def _quantity(cell: str) -> tuple[str, float | None, str] | None:
    """Name of the quantity, factor of its unit (None: none is stated), kind of unit; None for another column."""
    text = cell.strip().lower().replace("μ", "µ")
    for name, kind, pattern in _NAMES:
        found = re.fullmatch(rf"(?:{pattern})(?:[\s_]*[\[(]?\s*([^\[\]()]*?)\s*[\])]?)?", text)
        if found is None:
            continue
        unit = (found[1] or "").strip(" _")
        if not unit:
            return name, None, kind
        if unit in _UNITS[kind]:
            return name, _UNITS[kind][unit], kind
    return None


def _columns(path: Path, layout: Layout) -> dict[str, tuple[int, float]]:
    units = [*layout.units, *[""] * layout.columns]
    found: dict[str, tuple[int, float]] = {}
    for index, cell in enumerate(layout.header):
        meant = _quantity(cell) or _quantity(f"{cell} {units[index]}")
        if meant is None:
            continue
        name, factor, kind = meant
        if name in found:
            raise ArgumentError(f"{path}:{layout.header_line}: two columns of {name}: {cell!r} is one too many")
        stated = _UNITS[kind].get(units[index].strip(" []()").lower()) if factor is None else factor
        found[name] = (index, 1.0 if stated is None else stated)
    missing = [name for name in ("fx", "fy") if name not in found]
    if not missing and not {"time", "position", "radial_depth"} & set(found):
        missing = ["time, position or radial_depth"]
    if missing:
        raise ArgumentError(
            f"{path}:{layout.header_line or 1}: no column of {' and '.join(missing)}; the header is "
            f"{', '.join(layout.header)[:80] or 'missing'!r}; wanted for example {_EXAMPLE}, position_mm,fx_n,fy_n or "
            "radial_depth_mm,fx_n,fy_n"
        )
    return found


def read_forces(path: str | Path, *, on: str = "workpiece") -> ForceRecord:
    """Read measured forces.

    Args:
        path: CSV with a header (delimiter and decimal comma are found out); units in the header, else s, mm, N, N m.
        on: "workpiece": what a dynamometer under the work piece measures; "tool": forces on the tool.

    Raises:
        ArgumentError: what was found and what is needed, with file and line.
        OSError: the file cannot be read.
    """
    path = Path(path)
    data = utf8_text(path)
    layout = find_layout(path, data, False)
    columns = _columns(path, layout)
    body = data.split(b"\n", layout.first_row - 1)[-1]
    table = _numbers(path, body, layout, [index for index, _ in columns.values()])
    values = {name: table[:, k] * factor for k, (name, (_, factor)) in enumerate(columns.items())}
    if len(table) < _FEWEST_ROWS:
        raise ArgumentError(f"{path}: {len(table)} rows: too few; needed are at least {_FEWEST_ROWS}")
    sign = -1.0 if on == "workpiece" else 1.0
    time = values.get("time")
    if time is not None:
        try:
            period, _ = even_period(time)
        except UnevenTimeError as error:
            raise ArgumentError(f"{path}:{layout.first_row + error.row}: {error}") from error
        time = time[0] + period * np.arange(len(time))
    position = values.get("position")
    if position is not None and "radial_depth" not in values and np.any(np.diff(position) < 0.0):
        row = int(np.argmax(np.diff(position) < 0.0)) + 1
        raise ArgumentError(f"{path}:{layout.first_row + row}: the position goes back: one pass per file, along +X")
    return ForceRecord(
        str(path),
        sign * np.column_stack([values["fx"], values["fy"]]),
        values.get("torque"),
        time,
        position,
        values.get("radial_depth"),
        values.get("feed"),
    )


def _numbers(path: Path, body: bytes, layout: Layout, used: list[int]) -> Array:
    text = without_thousands(body).replace(b",", b".") if layout.decimal_comma else body
    try:
        table = np.loadtxt(
            io.BytesIO(text),
            delimiter=None if layout.delimiter == " " else layout.delimiter,
            usecols=used,
            comments="#",
            quotechar='"' if b'"' in text else None,
            ndmin=2,
            encoding="latin-1",
        )
    except (ValueError, IndexError) as error:
        raise ArgumentError(_bad_cell(path, body, layout, used) or f"{path}: {error}") from error
    if not np.isfinite(table).all():
        raise ArgumentError(_bad_cell(path, body, layout, used))
    return np.asarray(table, dtype=np.float64)


def _bad_cell(path: Path, body: bytes, layout: Layout, used: list[int]) -> str:
    for number, raw in enumerate(body.split(b"\n"), start=layout.first_row):
        line = raw.decode("latin-1").partition("#")[0]
        cells = cells_of(line.strip(), layout.delimiter)
        for index in used if line.strip() else ():
            cell = cells[index] if index < len(cells) else ""
            plain = cell.replace(",", ".") if layout.decimal_comma else cell
            if not (is_number(cell, layout.decimal_comma) and math.isfinite(float(plain))):
                return f"{path}:{number}: column {index + 1} ({layout.header[index]}): {cell!r} is not a finite number"
    return ""
