"""Read a LinuxCNC INI file as a machine: limits of the axes, period, planner settings; else its defaults."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shapegcode.errors import MachineError, Problem
from shapegcode.io.data_file import read_file
from shapegcode.io.ini import UNITS_MM, ini_entries
from shapegcode.machine.machine import Machine
from shapegcode.settings.keys import toml

_MAX_BYTES = 1 << 20
_PLANNER = {
    ("TRAJ", "ARC_BLEND_RAMP_FREQ"): ("ramp_frequency_hz", float),
    ("TRAJ", "ARC_BLEND_KINK_RATIO"): ("kink_ratio", float),
    ("TRAJ", "ARC_BLEND_OPTIMIZATION_DEPTH"): ("optimization_depth", int),
    ("DISPLAY", "MAX_FEED_OVERRIDE"): ("max_feed_override", float),
}


@dataclass(frozen=True)
class IniMachine:
    """A machine described by an INI file."""

    machine: Machine  # with the origin of each value
    count: int  # values that were read
    notes: tuple[str, ...]  # settings that are not modelled


class _Ini:
    """Entries of an INI file with their lines, and their problems."""

    def __init__(self, file: str, text: str) -> None:
        self.file = file
        self.entries = ini_entries(text)
        self.problems: list[Problem] = []

    def number(self, section: str, name: str) -> float | None:
        """A number above 0; None if missing or invalid, which is noted as a problem."""
        text, line = self.entries.get((section, name), ("", 0))
        if not line:
            return None
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if 0.0 < value < math.inf:
            return value
        self.problems.append(Problem(f"[{section}] {name}", toml(text), "must be a number greater than 0", line))
        return None

    def origin(self, section: str, name: str) -> str:
        return f"parameters: {Path(self.file).name} line {self.entries[section, name][1]}: [{section}] {name}"


def read_ini(file: str | Path, *, name: str | None = None) -> IniMachine:
    """Read the machine of a LinuxCNC INI file, with *name* or [EMC] MACHINE; its modes are not known."""
    ini = _Ini(str(file), read_file(file, _MAX_BYTES).decode("utf-8", "replace"))
    if not any(section == "TRAJ" for section, _ in ini.entries):
        raise MachineError(str(file), (Problem("", "", "not an INI file of LinuxCNC: it has no section [TRAJ]"),))
    unit_text, line = ini.entries.get(("TRAJ", "LINEAR_UNITS"), ("mm", 0))
    unit_mm = UNITS_MM.get(unit_text.lower())
    if unit_mm is None:
        ini.problems.append(Problem("[TRAJ] LINEAR_UNITS", toml(unit_text), "must be mm or inch", line))
    axes, remarks = _axes(ini, unit_mm or 1.0)
    controller = dict(_controller(ini, remarks))
    if ini.problems:
        raise MachineError(str(file), tuple(ini.problems))
    own = name or ini.entries.get(("EMC", "MACHINE"), (Path(file).stem, 0))[0]
    data: dict[str, Any] = {
        "name": "".join(c for c in own if " " <= c <= "~")[:60] or "machine",
        "description": f"read from {Path(file).name}",
        "axes": axes, "controller": controller, "emission": {"dialect": "linuxcnc"},
    }  # fmt: skip
    if unit_mm != 1.0:  # unit of the tool table
        data["input"] = {"machine_unit": "inch"}
    machine = Machine.from_data(data, str(file)).with_remarks(remarks)
    return IniMachine(machine, len(remarks), tuple(_notes(ini)))


def _axes(ini: _Ini, unit_mm: float) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """Limits of the axes: the smallest of axis, joint and path."""
    axes: dict[str, dict[str, float]] = {}
    remarks: dict[str, str] = {}
    for number, axis in enumerate("xyz"):
        limits: dict[str, float] = {}
        for word, keys, factor in (
            ("VELOCITY", ("max_feed_mm_per_min", "rapid_mm_per_min"), 60.0),
            ("ACCELERATION", ("max_acceleration_mm_s2",), 1.0),
        ):
            own = f"MAX_{word}"
            places = [(f"AXIS_{axis.upper()}", own), (f"JOINT_{number}", own), ("TRAJ", f"MAX_LINEAR_{word}")]
            found = [(value, place) for place in places if (value := ini.number(*place)) is not None]
            if not found:
                needed = f"[AXIS_{axis.upper()}] MAX_{word}"
                ini.problems.append(Problem(needed, "", "is missing, and so is that of the joint and of [TRAJ]"))
                continue
            value, place = min(found)
            for key in keys:
                limits[key] = round(value * unit_mm * factor, 9)
                remarks[f"axes.{axis}.{key}"] = ini.origin(*place)
        axes[axis] = limits
    return axes, remarks


def _controller(ini: _Ini, remarks: dict[str, str]) -> Iterator[tuple[str, Any]]:
    """Servo period and planner settings."""
    yield "kind", "linuxcnc"
    # Blocks are not rounded to periods: the remainder is carried into the next block.
    yield "block_end", "carry"
    if (period_ns := ini.number("EMCMOT", "SERVO_PERIOD")) is not None:
        yield "interpolation_period_s", round(period_ns * 1e-9, 12)
        remarks["controller.interpolation_period_s"] = ini.origin("EMCMOT", "SERVO_PERIOD")
    planner: dict[str, float] = {}
    for place, (key, kind) in _PLANNER.items():
        if (value := ini.number(*place)) is not None:
            planner[key] = min(kind(value), 1) if key == "kink_ratio" else kind(value)
            remarks[f"controller.linuxcnc.{key}"] = ini.origin(*place)
    yield "linuxcnc", planner


def _notes(ini: _Ini) -> Iterator[str]:
    if ini.entries.get(("TRAJ", "ARC_BLEND_ENABLE"), ("1", 0))[0] == "0":
        yield "[TRAJ] ARC_BLEND_ENABLE = 0: LinuxCNC then looks one segment ahead; the model looks further"
    for entry in ("PLANNER_TYPE", "MAX_LINEAR_JERK"):
        if ("TRAJ", entry) in ini.entries:
            yield f"[TRAJ] {entry}: the S-curve planner of LinuxCNC 2.10 is not modelled; that of 2.9 is"
