"""Read a control's own settings as a machine: a FANUC parameter dump, a LinuxCNC INI file.

A base machine supplies what a dump lacks; an INI file is supplemented by defaults. See docs/reference/parameters.md.
"""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shapegcode.errors import MachineError, Problem
from shapegcode.io.data_file import read_file
from shapegcode.io.ini import UNITS_MM, ini_entries
from shapegcode.machine.fanuc_dump import ControlTables, Draft, is_table, read_dump, read_table, take_modes
from shapegcode.machine.fanuc_keys import NUMBERS, take_parameters, take_tables
from shapegcode.machine.machine import Machine
from shapegcode.machine.result import DEFAULT_WHY, ParameterImport
from shapegcode.settings.keys import inherited, toml

_EXPECTED = (20, 1013, 1401, 1420, 1430, 1604, 1610, 1620, 1622, 1660, 1735, 1783, 1820, 1825, 1826, 3401, 3402, 3410)
_LONGEST_NAME = 60
_MAX_DUMP_BYTES = 16 << 20
_CLAMP = "read, but not the smallest of the clamps 1422, 1430, 1432 for any axis"
_NO_KEY = {
    1020: "read: it determines which of A1, A2, ... is X, Y, Z; no key stores it",
    **dict.fromkeys((1422, 1430, 1432), _CLAMP),
}
"""Reasons why a parameter that was read is not stored in a key."""


def import_parameters(
    dump: str | Path | bytes,
    base: Machine | None = None,
    *,
    tables: Sequence[str | Path] = (),
    name: str | None = None,
    keep_modes: str = "",
    rigid: str = "",
    source: str = "<dump>",
) -> ParameterImport:
    """Make a machine from a control's parameter dump (CNC-PARA.TXT).

    Args:
        dump: the file, or its content.
        base: machine for values that are not in the dump; None: the defaults of the machine file.
        tables: files of tool offsets, work offsets and variables that the control punched out (TOOLOFST.TXT,
            EXT_WKZ.TXT, MACRO.TXT).
        name: of the machine; None: from the name of the dump file.
        keep_modes: axes ("xy") that keep the modes of the base, if the base is the same machine. Modes of
            other axes are not adopted: a dump contains no modes.
        rigid: axes declared to have no modes: "z".
        source: names the content in messages.

    Returns:
        The machine, and what was read, assumed and missing; not `ok` if nothing was read: the machine is then the base
        or a built-in one.

    Raises:
        MachineError: not a dump or table, an implausible value, or an axis limit that is in neither dump nor base.
        ArgumentError: an unknown axis, or modes to keep for a rigid axis or one without modes in the base.
        OSError: a file cannot be read.
    """
    data, file = (dump, source) if isinstance(dump, bytes) else (read_file(dump, _MAX_DUMP_BYTES), str(dump))
    draft = Draft(read_dump(data, file, NUMBERS), _started(base, name, file))
    take_parameters(draft)
    read = ControlTables()
    for path in tables:
        content = read_file(path, _MAX_DUMP_BYTES)
        if not is_table(content):
            message = "no table of offsets or variables (G10L10P1R..., G10L2P1X..., G10L85P500(...), #500=...)"
            raise MachineError(str(path), (Problem("", "", message),))
        read_table(content, Path(path).name, read)
    take_tables(draft, read)
    take_modes(draft, base, keep_modes, rigid)
    _list_missing(draft)
    if draft.problems:
        raise MachineError(file, tuple(draft.problems))
    if draft.read or draft.tables:
        _require_limits(draft, file)
        machine = Machine.from_data(draft.data, file)
        _remark_the_rest(draft, machine, base)
    else:  # the machine contains nothing of the dump, so no remark applies
        machine = base or Machine.load("vx500")
        draft.remarks.clear()
    for number, largest in dict(draft.differing).items():
        draft.assume(f"parameter {number}", largest, "differs between the axes; the largest counts")
    return ParameterImport(
        file,
        machine.with_remarks(draft.remarks),
        tuple(draft.read),
        tuple(draft.tables),
        tuple(draft.assumed),
        tuple(draft.missing),
        draft.remarks,
    )


def _started(base: Machine | None, name: str | None, file: str) -> dict[str, Any]:
    """Initial tables. Name and description are those of the control: a base machine only fills gaps."""
    data = base.model_dump(mode="python", exclude_unset=True) if base else {}
    stem = "".join(c for c in Path(file).stem if " " <= c <= "~")
    # HM100_CNC-PARA.TXT is the dump of the HM100.
    own = re.sub(r"[ _.-]*(CNC[ _-]?PARA\w*)?$", "", stem, flags=re.IGNORECASE) or stem
    data["name"] = (name or own or "machine")[:_LONGEST_NAME]
    data["description"] = f"read from {Path(file).name}" + (
        f"; parameters that it does not contain are from {base.name}" if base else ""
    )
    return data


def _list_missing(draft: Draft) -> None:
    for number, line in draft.dump.repeated:
        draft.miss(number, "given again (another path): the first one counts", line)
    for line, text in draft.dump.strange:
        draft.miss("", f'not understood: "{text}"', line)
    held = {number for number, _ in draft.dump.entries}
    listed = {row.parameter for row in draft.missing}
    for number in _EXPECTED:
        if number not in held and str(number) not in listed:
            draft.miss(number, "not in the dump")
    used = {row.parameter for row in draft.read}
    for number in sorted(held - used):
        if str(number) not in listed:
            draft.miss(number, _NO_KEY.get(number, "read, but not used for a key"))
    if others := draft.dump.others:
        first = min(others)
        count = f"{len(others)} parameter{'' if len(others) == 1 else 's'}"
        draft.miss("", f"{count} not known here and not read, such as {first}", others[first])
    if not draft.dump.complete:
        draft.miss("", "no % at the end: the dump may be cut")


def _remark_the_rest(draft: Draft, machine: Machine, base: Machine | None) -> None:
    """Note the origins of values that are not in the dump."""
    for value in machine.values():
        if value.key in draft.remarks or value.key in ("name", "description"):
            continue
        if value.assumed and value.origin == "default":
            draft.remarks[value.key] = "assumed: not in the dump"
            draft.assume(value.key, value.value, DEFAULT_WHY)
        elif base and value.origin != "default":
            draft.remarks[value.key] = inherited(base.name, base.remarks.get(value.key, ""))


def _require_limits(draft: Draft, file: str) -> None:
    """Require axis limits; without a parameter derive feed and acceleration from rapid rate and time constant."""
    ramp_s = draft.get("controller.time_constant_s")
    for axis in "xyz":
        feed_key, acceleration_key = f"axes.{axis}.max_feed_mm_per_min", f"axes.{axis}.max_acceleration_mm_s2"
        rapid = draft.get(f"axes.{axis}.rapid_mm_per_min")
        if rapid and draft.get(feed_key) is None:
            draft.assume_key(feed_key, rapid, "no 1422 or 1430: the rapid rate")
        feed = draft.get(feed_key)
        if feed and ramp_s and draft.get(acceleration_key) is None:
            why = "no 1660: acceleration for the largest cutting feed with the time constant after interpolation"
            draft.assume_key(acceleration_key, round(feed / 60.0 / ramp_s, 3), why)

    needed = {"max_feed_mm_per_min": "1430", "rapid_mm_per_min": "1420", "max_acceleration_mm_s2": "1660"}
    problems = [
        Problem(f"axes.{axis}.{name}", "", f"not in the dump (parameter {number}); or use --from MACHINE")
        for axis in "xyz"
        for name, number in needed.items()
        if draft.get(f"axes.{axis}.{name}") is None
    ]
    if problems:
        raise MachineError(file, tuple(problems))


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
    """Read the machine of a LinuxCNC INI file, without modes; its name is *name*, [EMC] MACHINE or the file's."""
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
    """Limits of the axes, each the smallest of those of axis, joint and path; and the origins of the values."""
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
    """Kind of control, rule of block timing, servo period and planner settings."""
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
