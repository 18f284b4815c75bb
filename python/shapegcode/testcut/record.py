"""Reads measured cutting forces: CSV with a header, samples over time or position, or means at radial depths."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shapegcode.errors import ArgumentError
from shapegcode.io.columns import Meaning, read_label, unit_of
from shapegcode.io.sampling import UnevenTimeError, even_period
from shapegcode.io.table import TextTable
from shapegcode.io.units import Measured, factor_between

__all__ = ["FORCES_ON", "ForceRecord", "read_forces"]

Array = npt.NDArray[np.float64]

FORCES_ON = ("workpiece", "tool")
_EXAMPLE = "time_s,fx_n,fy_n"
#: Unit of `ForceRecord`, and of a column that states none.
_UNITS = {"time": "s", "displacement": "mm", "velocity": "mm/min", "force": "N", "torque": "N·m"}
#: Quantity, its kind, and the names under which its column goes (without the unit).
_NAMES: tuple[tuple[str, Measured, str], ...] = (
    ("time", "time", r"time|t|zeit|timestamp"),
    ("position", "displacement", r"position|pos|x|s|distance|way"),
    ("radial_depth", "displacement", r"radial[ _]?depth|rd|ae|a_e"),
    ("feed", "velocity", r"feed|f|vf|v_f|feed[ _]?rate"),
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


def _names(name: str) -> Meaning | None:
    """What a name stands for; None: another column."""
    plain = name.strip(" _").lower()
    return next((Meaning(what, kind) for what, kind, pattern in _NAMES if re.fullmatch(pattern, plain)), None)


def _columns(table: TextTable) -> dict[str, tuple[int, float]]:
    """Index of each quantity's column, and the factor to the unit of `ForceRecord`."""
    found: dict[str, tuple[int, float]] = {}
    for index, label in enumerate(table.labels(lambda text, unit: read_label(text, unit, _names))):
        if label.meaning is None:
            continue
        what = label.meaning.what
        kind = next(kind for name, kind, _ in _NAMES if name == what)
        if kind != "force" and (label.unknown_unit or (label.unit is not None and label.unit.measures != kind)):
            continue  # a signal of something else under a short name: "x [V]"
        unit = unit_of(table.where, label, (kind,))
        if what in found:
            raise ArgumentError(f"{table.where}: two columns of {what}: {label.text!r} is one too many")
        found[what] = (index, 1.0 if unit is None else factor_between(unit, _UNITS[kind]))
    missing = [name for name in ("fx", "fy") if name not in found]
    if not missing and not {"time", "position", "radial_depth"} & set(found):
        missing = ["time, position or radial_depth"]
    if missing:
        raise ArgumentError(
            f"{table.where}: no column of {' and '.join(missing)}; the header is "
            f"{', '.join(table.layout.header)[:80] or 'missing'!r}; wanted for example {_EXAMPLE}, "
            "position_mm,fx_n,fy_n or radial_depth_mm,fx_n,fy_n"
        )
    return found


def read_forces(path: str | Path, *, on: str = "workpiece") -> ForceRecord:
    """Read measured forces."""
    path = Path(path)
    table = TextTable(path)
    columns = _columns(table)
    numbers = table.numbers([index for index, _ in columns.values()], _FEWEST_ROWS)
    values = {name: numbers[:, k] * factor for k, (name, (_, factor)) in enumerate(columns.items())}
    sign = -1.0 if on == "workpiece" else 1.0
    time = values.get("time")
    if time is not None:
        try:
            period, _ = even_period(time)
        except UnevenTimeError as error:
            raise ArgumentError(f"{path}:{table.line_of(error.row)}: {error}") from error
        time = time[0] + period * np.arange(len(time))
    position = values.get("position")
    if position is not None and "radial_depth" not in values and np.any(np.diff(position) < 0.0):
        row = int(np.argmax(np.diff(position) < 0.0)) + 1
        raise ArgumentError(f"{path}:{table.line_of(row)}: the position goes back: one pass per file, along +X")
    return ForceRecord(
        str(path),
        sign * np.column_stack([values["fx"], values["fy"]]),
        values.get("torque"),
        time,
        position,
        values.get("radial_depth"),
        values.get("feed"),
    )
