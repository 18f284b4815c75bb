"""Reads the raw accelerations that the printer firmware Klipper writes of a resonance test."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from shapegcode.io.options import ReadOptions
from shapegcode.io.record import Record
from shapegcode.io.taps import read_csv

__all__ = ["is_klipper", "klipper_options", "read_sweep"]

_HEADER = re.compile(rb"^\s*#\s*time\s*,\s*accel_x\s*,\s*accel_y\s*,\s*accel_z\s*$", re.MULTILINE)
_OF_NAME = re.compile(r"raw_data_([xyz])(?:[_.]|$)|axis=([-0-9.]+),([-0-9.]+)", re.IGNORECASE)


def is_klipper(head: bytes) -> bool:
    """Whether a file begins as Klipper's raw data do: ``#time,accel_x,accel_y,accel_z``."""
    return _HEADER.search(head[:400]) is not None


def klipper_options(options: ReadOptions) -> ReadOptions:
    """Options with the units that Klipper writes without saying them: s and mm/s²."""
    scaled = options.response_scale is not None or options.response_unit is not None
    return replace(
        options,
        time_unit=options.time_unit or "s",
        response_unit=options.response_unit if scaled else "mm/s^2",
        ignore_force=True,
    )


def read_sweep(path: Path, options: ReadOptions) -> Record:
    """The record along the axis that was shaken."""
    told = options.axis or _axis_of_name(path.name)
    records = read_csv(path, replace(klipper_options(options), axis=told))
    record = max(records, key=lambda each: float(each.response.std()))
    note = () if told else (f"{path}: the axis is not told: {(record.axis or '').upper()} moved most (--axis says it)",)
    return replace(record, source=str(path), notes=(*record.notes, *note))


def _axis_of_name(name: str) -> str | None:
    match = _OF_NAME.search(name)
    if match is None:
        return None
    if match[1]:
        return match[1].lower()
    x, y = (abs(float(part)) for part in match.group(2, 3))
    return "x" if y == 0.0 < x else "y" if x == 0.0 < y else None
