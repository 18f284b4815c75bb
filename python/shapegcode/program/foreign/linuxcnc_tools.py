"""LinuxCNC's tool table: lengths and diameters, in the units of the machine."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from shapegcode.io.data_file import read_file
from shapegcode.io.ini import UNITS_MM, ini_entries
from shapegcode.program.foreign.plain import refusal

_MAX_BYTES = 10_000_000
_WORD = re.compile(r"([A-Z])\s*([-+]?(?:\d+\.?\d*|\.\d+))", re.IGNORECASE)


@dataclass(frozen=True)
class ToolRow:
    """A row of the tool table."""

    offset_mm: tuple[float, float, float]  # X, Y, Z
    diameter_mm: float  # 0: none is given


@dataclass(frozen=True)
class ToolTable:
    """The tools by number, and the file from which they come."""

    tools: dict[int, ToolRow]
    file: str
    units: str

    @property
    def unit_mm(self) -> float:
        """Length of its unit."""
        return UNITS_MM[self.units]

    @property
    def lengths_mm(self) -> dict[int, float]:
        """By tool."""
        return {number: tool.offset_mm[2] for number, tool in self.tools.items()}

    @property
    def radii_mm(self) -> dict[int, float]:
        """Likewise."""
        return {number: tool.diameter_mm / 2.0 for number, tool in self.tools.items()}


def find_tool_table(stated: str, unit: str, folder: Path | None) -> ToolTable | None:
    """The tool table that `input.tool_table` (or an INI file there) states, else `tool.tbl` of the folder; or None."""
    if not stated:
        beside = folder / "tool.tbl" if folder is not None else None
        if beside is None or not beside.is_file():
            return None
        return read_tool_table(beside, unit)
    path = Path(stated).expanduser()
    if path.suffix.lower() != ".ini":
        return read_tool_table(path, unit)
    entries = ini_entries(read_file(path, _MAX_BYTES).decode("utf-8", "replace"))
    table, _ = entries.get(("EMCIO", "TOOL_TABLE"), ("", 0))
    if not table:
        raise refusal(str(path), 1, "it has no [EMCIO] TOOL_TABLE")
    linear, line = entries.get(("TRAJ", "LINEAR_UNITS"), ("mm", 1))
    unit_mm = UNITS_MM.get(linear.lower())
    if unit_mm is None:
        raise refusal(str(path), line, f"[TRAJ] LINEAR_UNITS = {linear.lower()} is neither mm nor inch")
    return read_tool_table(path.parent / Path(table).expanduser(), "inch" if unit_mm > 1.0 else "mm")


def read_tool_table(path: Path, unit: str) -> ToolTable:
    """Read a tool table: lines `T1 P1 X0 Y0 Z12.5 D6 ;comment`."""
    factor = UNITS_MM[unit]
    tools: dict[int, ToolRow] = {}
    text = read_file(path, _MAX_BYTES).decode("utf-8", "replace")
    for number, line in enumerate(text.splitlines(), start=1):
        code = line.split(";")[0].strip()
        if not code:
            continue
        words = {letter.upper(): float(value) for letter, value in _WORD.findall(code)}
        if "T" not in words or _WORD.sub("", code).strip():
            raise refusal(str(path), number, f"{code[:40]!r} is no row of a tool table (T1 P1 Z12.5 D6)")
        x, y, z = (words.get(axis, 0.0) * factor for axis in "XYZ")
        tools[int(words["T"])] = ToolRow((x, y, z), words.get("D", 0.0) * factor)
    return ToolTable(tools, str(path), unit)
