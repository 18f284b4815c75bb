"""Reads LinuxCNC programs with the core: its options from the machine file, called files, tool table.

What is read and what is refused: docs/reference/input_dialects.md.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from shapegcode import _core
from shapegcode.io.data_file import read_file
from shapegcode.io.ini import UNITS_MM, ini_entries
from shapegcode.machine import Machine
from shapegcode.program.foreign import read

_MAX_BYTES = 10_000_000  # of a tool table
_LAST_TOOL = 2**31 - 1
_FILE_NAME = re.compile(r"[\w.+-]+")
_WORD = re.compile(r"([A-Z])\s*([-+]?(?:\d+\.?\d*|\.\d+))", re.IGNORECASE)
_BEGINS_IN = {"plane": "G17", "distance": "G90", "feed_mode": "G94", "path_mode": "G64"}


def read_linuxcnc(source: str, *, file: str, machine: Machine, folder: Path | None = None) -> read.ForeignProgram:
    """Read a LinuxCNC program as an expanded program."""
    table = find_tool_table(machine.input.tool_table, machine.input.machine_unit, folder)
    options = _options(machine, table)
    options.file, folders = read.shown_name(file), read.program_folders(machine, folder)
    options.find_subroutine = lambda name: _subroutine(name, folders, machine)
    with read.located_errors(file):
        program = _core.read_linuxcnc(source.encode("latin-1", "replace"), options)
    tools = {} if table is None else table.tools
    settings = read.ForeignSettings(
        tool_length_mm={number: offset_mm[2] for number, (offset_mm, _) in tools.items()},
        tool_radius_mm={number: diameter_mm / 2.0 for number, (_, diameter_mm) in tools.items()},
        peck_clearance_mm=_core.linuxcnc_peck_clearance_mm,
        path_tolerance_mm=program.path_tolerance_mm,
    )
    return read.program_of_core("linuxcnc", program.expanded, settings)


def _options(machine: Machine, table: ToolTable | None) -> _core.LinuxcncOptions:
    """Modes, offsets and tools before the first line, from the machine file."""
    options, given = _core.LinuxcncOptions(), machine.input
    power_on = vars(machine.power_on)
    options.first_codes = "".join(code for name, code in _BEGINS_IN.items() if power_on[name] != code)
    options.inch = power_on["units"] == "G20"
    options.work_offset = int(power_on["work_offset"][1:]) - 53
    options.work_offsets_mm = {
        int(name[6:]) + 6 if name.startswith("G54.1P") else int(name[1:]) - 53: offsets
        for name, offsets in given.work_offsets.items()
    }
    options.machine_unit_mm = UNITS_MM[given.machine_unit]
    if table is not None:
        options.tool_table = _core.LinuxcncToolTable(
            read.shown_name(table.file), table.units, UNITS_MM[table.units], dict(table.tools.items())
        )
    options.tool_length_mm = {int(number): length for number, length in given.tool_length_mm.items()}
    # The emitted program will be read with the machine's own setting.
    options.adds_points = not machine.controller.calculator_decimal_point
    options.block_skip = {"unknown": None, "on": True, "off": False}[given.block_skip]
    options.max_steps = machine.controller.max_program_steps
    options.max_expansion_bytes = machine.controller.max_expansion_bytes
    return options


def _subroutine(name: str, folders: list[Path], machine: Machine) -> tuple[str, bytes] | None:
    """Name and text of the file of a subroutine; None if there is none."""
    if _FILE_NAME.fullmatch(name) is None:
        return None
    for path in (folder / (name + suffix) for folder in folders for suffix in (".ngc", ".NGC", ".nc")):
        if path.is_file():
            return read.called_program(path, machine)
    return None


Tool = tuple[tuple[float, float, float], float]  # offsets of X, Y, Z and diameter (0: not stated), mm


@dataclass(frozen=True)
class ToolTable:
    """The tools by number, and the file from which they come."""

    tools: dict[int, Tool]
    file: str
    units: str


def find_tool_table(stated: str, unit: str, folder: Path | None) -> ToolTable | None:
    """Read the tool table of `input.tool_table` (also by an INI file), else `tool.tbl` of the folder; None: no file."""
    if not stated:
        beside = folder / "tool.tbl" if folder is not None else None
        return read_tool_table(beside, unit) if beside is not None and beside.is_file() else None
    path = Path(stated).expanduser()
    if path.suffix.lower() != ".ini":
        return read_tool_table(path, unit)
    entries = ini_entries(read_file(path, _MAX_BYTES).decode("utf-8", "replace"))
    table, _ = entries.get(("EMCIO", "TOOL_TABLE"), ("", 0))
    if not table:
        raise read.refusal(str(path), 1, "it has no [EMCIO] TOOL_TABLE")
    linear, line = entries.get(("TRAJ", "LINEAR_UNITS"), ("mm", 1))
    unit_mm = UNITS_MM.get(linear.lower())
    if unit_mm is None:
        raise read.refusal(str(path), line, f"[TRAJ] LINEAR_UNITS = {linear.lower()} is neither mm nor inch")
    return read_tool_table(path.parent / Path(table).expanduser(), "inch" if unit_mm > 1.0 else "mm")


def read_tool_table(path: Path, unit: str) -> ToolTable:
    """Read a tool table: lines `T1 P1 X0 Y0 Z12.5 D6 ;comment`."""
    factor = UNITS_MM[unit]
    tools: dict[int, Tool] = {}
    text = read_file(path, _MAX_BYTES).decode("utf-8", "replace")
    for number, line in enumerate(text.splitlines(), start=1):
        code = line.split(";")[0].strip()
        if not code:
            continue
        words = {letter.upper(): float(value) for letter, value in _WORD.findall(code)}
        if words.get("T", _LAST_TOOL + 1.0) > _LAST_TOOL or _WORD.sub("", code).strip():
            raise read.refusal(str(path), number, f"{code[:40]!r} is not a row of a tool table (T1 P1 Z12.5 D6)")
        x, y, z = (words.get(axis, 0.0) * factor for axis in "XYZ")
        tools[int(words["T"])] = (x, y, z), words.get("D", 0.0) * factor
    return ToolTable(tools, str(path), unit)
