"""Work offsets, local shift, tool offsets: G54 ... G59, G54.1, G52, G10, system variables."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .words import BlockWords

if TYPE_CHECKING:
    from .controller import Controller

Vector = npt.NDArray[np.float64]
#: First system variable of each tool offset table (memory C) → (table, what).
TOOL_VARIABLES = {
    10000: ("H", "wear"), 11000: ("H", "geometry"), 12000: ("D", "wear"), 13000: ("D", "geometry"),
    2000: ("H", "wear"), 2200: ("H", "geometry"),
}  # fmt: skip
#: G10 L number → tool offset table.
TOOL_DATA = {10: ("H", "geometry"), 11: ("H", "wear"), 12: ("D", "geometry"), 13: ("D", "wear")}


class Offsets:
    """Mixed into the controller. A work offset that nobody gave is NaN."""

    modal: dict[str, str]
    position: Vector

    def start_offsets(self, given: Mapping[str, tuple[float, float, float]] | None) -> None:
        self.work: dict[str, Vector] = {name: np.array(v, dtype=float) for name, v in (given or {}).items()}
        self.unknown_offset = 0.0 if given else math.nan
        self.external: Vector = np.zeros(3)
        self.local_shift: Vector = np.zeros(3)
        self.tools: dict[tuple[str, str, int], float] = {}
        self.length_mm = 0.0

    def offset_of(self, name: str) -> Vector:
        return self.work.get(name, np.full(3, self.unknown_offset))

    def choose_wcs(self, name: str) -> None:
        if name != self.modal["wcs"]:
            self.position = self.position + self.offset_of(self.modal["wcs"]) - self.offset_of(name)
            self.modal["wcs"] = name

    def set_work(self, name: str, axis: int, value: float, add: bool = False) -> None:
        """Set, or change by, an offset; the position in the active system follows."""
        table = self.work.setdefault(name, np.full(3, self.unknown_offset)) if name != "external" else self.external
        step = value if add else value - table[axis]
        table[axis] += step
        if not add:
            table[axis] = value
        if name in ("external", self.modal["wcs"]):
            self.position[axis] -= step

    def change_length_offset(self: Controller) -> None:
        new = 0.0
        if self.modal["length_offset"] != "G49" and self.h_number != 0:
            new = self.tool("H", self.h_number) * (-1.0 if self.modal["length_offset"] == "G44" else 1.0)
        self.position[2] += self.length_mm - new
        self.length_mm = new

    def tool(self, table: str, number: int) -> float:
        """Geometry and wear together, NaN if nobody gave either."""
        parts = [
            self.tools[table, what, number] for what in ("geometry", "wear") if (table, what, number) in self.tools
        ]
        return sum(parts) if parts else math.nan

    def set_data(self: Controller, block: BlockWords) -> None:
        """G10 L2, L20 and L10 ... L13; other L numbers set what this judge does not follow."""
        kind = block.whole("L") if "L" in block else 0
        add = self.modal["distance"] == "G91"
        number = block.whole("P") if "P" in block else 0
        if kind in (2, 20):
            if kind == 2 and not 0 <= number <= 6:
                raise self.fail(f"G10 L2 P{number}", 30)
            name = f"G54.1P{number}" if kind == 20 else "external" if number == 0 else f"G{53 + number}"
            for axis in range(3):
                if "XYZ"[axis] in block:
                    self.set_work(name, axis, self.millimetres(block, "XYZ"[axis]), add)
        elif kind in TOOL_DATA:
            key = (*TOOL_DATA[kind], number)
            value = self.millimetres(block, "R")
            self.tools[key] = value + (self.tools.get(key, 0.0) if add else 0.0)

    # ---- system variables --------------------------------------------------------------------------------------------

    def work_variable(self, number: int) -> tuple[str, int] | None:
        if 5201 <= number <= 5203:
            return "external", number - 5201
        for base, count, first in ((5221, 6, 0), (7001, 48, 100), (14001, 300, 100)):
            row, axis = divmod(number - base, 20)
            if 0 <= row < count and axis < 3:
                return (f"G{54 + row}" if first == 0 else f"G54.1P{row + 1}"), axis
        return None

    def tool_variable(self, number: int) -> tuple[str, str, int] | None:
        for base, (table, what) in TOOL_VARIABLES.items():
            if 1 <= number - base <= (200 if base < 10000 else 999):
                return table, what, number - base
        return None

    def read_offset(self: Controller, number: int) -> float | None:
        if place := self.work_variable(number):
            table = self.external if place[0] == "external" else self.offset_of(place[0])
            return float(table[place[1]]) / self.unit_mm
        if tool := self.tool_variable(number):
            return self.tools.get(tool, 0.0) / self.unit_mm
        return None

    def write_offset(self: Controller, number: int, value: float) -> bool:
        if place := self.work_variable(number):
            self.set_work(*place, value * self.unit_mm)
        elif tool := self.tool_variable(number):
            self.tools[tool] = value * self.unit_mm
        else:
            return False
        return True
