"""One NC block after another: modal state, offsets, coordinate modes, moves. Control flow is in `flow`."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from ..records import MODAL_GROUPS, PLANES, WAKE_UP, canonical_g
from .items import Item
from .motion import Motion
from .offsets import Offsets
from .tape import Alarm
from .transforms import Transform
from .words import INTEGERS, BlockWords, Word

Vector = npt.NDArray[np.float64]
INERT = {"G05", "G05.1", "G08", "G09", "G11", "G22", "G23", "G64.1", "G96", "G97"}
ONE_SHOT = {"G04", "G10", "G28", "G30", "G52", "G53", "G92", "G27", "G29", "G31"}
MODES = {"G15", "G16", "G50", "G51", "G50.1", "G51.1", "G68", "G69"}


class Controller(Motion, Offsets):
    """State between blocks. Positions are in the active work coordinates, mm, NaN where not known."""

    def __init__(
        self,
        *,
        calculator: bool = True,
        work_offsets: Mapping[str, tuple[float, float, float]] | None = None,
        arc_tolerance_mm: float = 0.01,
        unknown_after_tool_change: str = "XYZ",
        peck_clearance_mm: float = 0.5,
    ) -> None:
        self.calculator = calculator
        self.arc_tolerance_mm = arc_tolerance_mm
        self.unknown_after_tool_change = unknown_after_tool_change
        self.peck_clearance_mm = peck_clearance_mm
        self.modal = dict(WAKE_UP)
        self.position: Vector = np.full(3, np.nan)
        self.transform = Transform()
        self.polar = False
        self.polar_radius = self.polar_angle = 0.0
        self.polar_origin: Vector = np.zeros(3)
        self.f_word = math.nan
        self.spindle = 0.0
        self.d_number = self.h_number = 0
        self.items: list[Item] = []
        self.line = 0
        self.start_offsets(work_offsets)
        self.start_motion()

    # ---- helpers -----------------------------------------------------------------------------------------------------

    def fail(self, message: str, alarm: int = 0) -> Alarm:
        return Alarm(self.line, message, alarm)

    @property
    def unit_mm(self) -> float:
        return 25.4 if self.modal["units"] == "G20" else 1.0

    @property
    def axes(self) -> tuple[int, int, int]:
        return PLANES[self.modal["plane"]]

    def millimetres(self, words: BlockWords, letter: str) -> float:
        return words.length(letter, self.modal["units"])

    # ---- one block ---------------------------------------------------------------------------------------------------

    def run(self, line: int, words: list[Word]) -> None:
        """Execute the words of one block (no O, N, and no call)."""
        self.line = line
        codes = [canonical_g(f"{w.value:g}") for w in words if w.letter == "G"]
        block = BlockWords([w for w in words if w.letter != "G"], line, self.calculator)
        for word in block.words:
            if word.letter in INTEGERS and "." in word.literal:
                raise self.fail(f"decimal point in {word.letter}{word.literal}", 7)
        for code in codes:
            if code not in MODAL_GROUPS and code not in INERT | ONE_SHOT | MODES:
                raise self.fail(f"{code} is not judged", 10)
        self.take_modal(codes, block)
        for code in codes:
            if code in MODES:
                self.switch_mode(code, block)
        one_shot = [c for c in codes if c in ONE_SHOT]
        if one_shot:
            self.one_shot(one_shot[-1], block)
        elif not any(c in MODES - {"G15", "G16"} for c in codes):
            self.motion_block(block)
        if any(w.letter == "M" and w.value == 6 for w in words):
            for k, axis in enumerate("XYZ"):
                if axis in self.unknown_after_tool_change:
                    self.position[k] = math.nan

    def take_modal(self, codes: list[str], block: BlockWords) -> None:
        before = dict(self.modal)
        groups = [MODAL_GROUPS.get(code) for code in codes]
        for code, group in zip(codes, groups, strict=True):
            if group is not None and group != "wcs":
                self.modal[group] = code
        if "motion" in groups and "cycle" not in groups:
            self.modal["cycle"] = "G80"
        if before["cycle"] == "G80" and self.modal["cycle"] != "G80":
            self.begin_cycle()
        if before["units"] != self.modal["units"] or before["feed_mode"] != self.modal["feed_mode"]:
            self.f_word = math.nan
        if "S" in block:
            self.spindle = block.number("S")
        if "F" in block:
            self.f_word = block.number("F")
        if "D" in block:
            self.d_number = block.whole("D")
        if "H" in block:
            self.h_number = block.whole("H")
        if "length_offset" in groups or ("H" in block and self.modal["length_offset"] != "G49"):
            self.change_length_offset()
        wcs = [c for c in codes if MODAL_GROUPS.get(c) == "wcs"]
        if wcs:
            name = wcs[-1]
            if name == "G54.1" or (name == "G54" and "P" in block and "G10" not in codes):
                name = f"G54.1P{block.whole('P')}"
            self.choose_wcs(name)

    def switch_mode(self, code: str, block: BlockWords) -> None:
        named = {k: self.millimetres(block, a) for k, a in enumerate("XYZ") if a in block}
        t = self.transform
        if code == "G15":
            self.polar = False
        elif code == "G16":
            self.polar, self.polar_origin = True, np.zeros(3)
        elif code == "G69":
            t.turn_centre = None
        elif code == "G68":
            if "R" not in block:
                raise self.fail("G68 without R", 0)
            t.turn_centre = None
            here = t.backward(self.position)
            t.turn_axes = self.axes[:2]
            # Operator's manuals: in scaling mode the centre is scaled, the angle is not; so is the mirror.
            t.turn_centre = t.forward(np.array([named.get(k, here[k]) if k in t.turn_axes else 0.0 for k in range(3)]))
            t.turn_rad = math.radians(block.counted("R", 0.001))
        elif code == "G50":
            t.scale_centre, t.factors = None, np.ones(3)
        elif code == "G51":
            here = t.backward(self.position)
            t.factors = np.ones(3)
            for k in range(3):
                letter = "IJK"[k]
                word = letter if letter in block else "P"
                if word in block:
                    factor = block.by_letter[word]
                    t.factors[k] = factor.value * (0.001 if factor.plain else 1.0)
            t.scale_centre = np.array([named.get(k, here[k] if t.factors[k] != 1.0 else 0.0) for k in range(3)])
        elif code == "G51.1":
            t.mirror.update(named)
        elif code == "G50.1":
            for k in named or dict(t.mirror):
                t.mirror.pop(k, None)

    def one_shot(self, code: str, block: BlockWords) -> None:
        named = [k for k, a in enumerate("XYZ") if a in block]
        if code == "G04":
            seconds = 0.0
            if "X" in block:
                seconds = block.counted("X", 0.001)
            elif "P" in block:
                seconds = block.number("P") / 1000.0
            self.items.append(Item("dwell", self.line, self.position.copy(), self.position.copy(), dwell_s=seconds))
        elif code == "G10":
            self.set_data(block)
        elif code == "G52":
            for k in named:
                new = self.millimetres(block, "XYZ"[k])
                self.position[k] += self.local_shift[k] - new
                self.local_shift[k] = new
        elif code == "G92":
            for k in named:
                self.position[k] = self.millimetres(block, "XYZ"[k])
        elif code in ("G28", "G30"):
            end = self.programmed_target(block)
            self.straight("rapid", self.transform.forward(end))
            self.lose(named)
        elif code == "G53":
            self.lose(named)
        else:
            raise self.fail(f"{code} is not judged")

    def lose(self, axes: list[int]) -> None:
        """These axes go somewhere in machine coordinates."""
        end = self.position.copy()
        end[axes] = math.nan
        self.straight("rapid", end)
