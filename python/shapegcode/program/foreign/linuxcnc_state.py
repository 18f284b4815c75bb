"""What LinuxCNC's interpreter carries from block to block: modes, position, offsets; None where it is not known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from shapegcode.io.units import MM_PER_INCH
from shapegcode.program.foreign.linuxcnc_tools import ToolTable

AXES = "xyz"
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

    def copy(self) -> Modes:
        """Another one with the same values."""
        return replace(self)


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


def normal_axis(plane: int) -> int:
    """The axis of drilling in G17, G18, G19."""
    return {170: 2, 180: 1, 190: 0}[plane]


def plane_axes(plane: int) -> tuple[int, int]:
    """First and second axis of the plane, in the sense in which G03 turns."""
    return {170: (0, 1), 180: (2, 0), 190: (1, 2)}[plane]


def system_words(system: int) -> str:
    """A work coordinate system in FANUC's words."""
    return f"G{53 + system}" if system <= 6 else f"G54.1 P{system - 6}"


def given_axes(values: Mapping[str, float]) -> list[int]:
    """Indices of the linear axes among words."""
    return [axis for axis in range(3) if AXES[axis] in values]
