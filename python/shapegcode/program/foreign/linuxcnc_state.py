"""What LinuxCNC's interpreter carries from block to block: modes, position, offsets, tools; None: not known."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from shapegcode.io.data_file import read_file
from shapegcode.io.ini import UNITS_MM, ini_entries
from shapegcode.io.units import MM_PER_INCH
from shapegcode.program.foreign.read import refusal

AXES = "xyz"
_MAX_BYTES = 10_000_000
_WORD = re.compile(r"([A-Z])\s*([-+]?(?:\d+\.?\d*|\.\d+))", re.IGNORECASE)
CYCLES = frozenset({730, 740, 810, 820, 830, 840, 850, 860, 890})
"""Drilling cycles that are read, in tenths of their G numbers."""

Triple = list[float | None]


@dataclass
class Modes:
    """Modal groups, as tenths of G numbers; what M70 saves."""

    motion: int = 800
    plane: int = 170
    distance: int = 900
    centres: int = 911
    feed_mode: int = 940
    units: int = 210
    path: int = 640
    system: int = 1  # 1 ... 9: G54 ... G59.3
    retract: int = 990  # LinuxCNC's own at power-on
    feed: float = 0.0
    speed: float = 0.0
    spindle: int = 5
    mist: bool = False
    flood: bool = False


@dataclass
class State:
    """Modes, position and offsets. Lengths are mm; the position is that of the program's coordinates."""

    modes: Modes = field(default_factory=Modes)
    position: Triple = field(default_factory=lambda: [None, None, None])  # of X, Y, Z
    work: dict[int, Triple] = field(default_factory=dict)  # offsets of the nine work coordinate systems
    g92: Triple = field(default_factory=lambda: [0.0, 0.0, 0.0])  # offset of G92 and G52
    g52: bool = False  # the offset stands in the plain program as G52
    saved_g92: Triple = field(default_factory=lambda: [0.0, 0.0, 0.0])  # what G92.3 restores
    length: float | None = 0.0  # tool length offset of Z that is in force
    length_number: int = 0  # its H number, 0: none
    tool: int = 0  # in the spindle
    selected: int = 0  # by T
    lengths: dict[int, float] = field(default_factory=dict)  # of tools, as far as they are known
    radii: dict[int, float] = field(default_factory=dict)  # likewise
    table: ToolTable | None = None
    cycle: CycleWords | None = None  # what a row of drilling cycles keeps
    cycle_dwell: float = 0.0  # the last P of a drilling cycle, s: G74 and G84 without P take it, even from before G80
    machine_unit_mm: float = 1.0  # length of the machine's own unit

    @property
    def unit_mm(self) -> float:
        """Length of the program's unit."""
        return MM_PER_INCH if self.modes.units == 200 else 1.0

    def offsets(self, system: int) -> Triple:
        """Offsets of a work coordinate system, 1 to 9."""
        return self.work.setdefault(system, [None, None, None])

    def shift(self, axis: int, before: float | None, after: float | None) -> None:
        """The position where an offset of an axis changes and the machine does not move."""
        here = self.position[axis]
        if before == after and before is not None:
            return
        known = here is not None and before is not None and after is not None
        self.position[axis] = here + before - after if known else None  # type: ignore[operator]

    def select_system(self, system: int) -> None:
        """Another work coordinate system."""
        if system == self.modes.system:
            return
        before, after = self.offsets(self.modes.system), self.offsets(system)
        for axis in range(3):
            self.shift(axis, before[axis], after[axis])
        self.modes.system = system

    def set_length(self, length: float | None, number: int) -> None:
        """Another tool length offset."""
        if length is None and self.length is None and number == self.length_number:
            return
        self.shift(2, self.length, length)
        self.length, self.length_number = length, number


@dataclass
class CycleWords:
    """Of a row of drilling cycles: what holds until it ends."""

    initial: float | None  # level at which the row began
    r: float | None = None
    bottom: float | None = None
    peck: float | None = None
    dwell: float | None = None
    entered: float | None = None  # level at which the plain program's row began, None: it is in none


def system_words(system: int) -> str:
    """A work coordinate system in FANUC's words."""
    return f"G{53 + system}" if system <= 6 else f"G54.1 P{system - 6}"


def given_axes(values: Mapping[str, float]) -> list[int]:
    """Indices of the linear axes among words."""
    return [axis for axis in range(3) if AXES[axis] in values]


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
        return read_tool_table(beside, unit) if beside is not None and beside.is_file() else None
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
