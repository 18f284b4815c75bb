"""Axis words to moves: targets, arcs, feeds, drilling."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from . import cycles
from .items import Item
from .words import BlockWords

if TYPE_CHECKING:
    from .controller import Controller

Vector = npt.NDArray[np.float64]


class Motion:
    """Mixed into the controller."""

    def start_motion(self) -> None:
        self.cycle_words: dict[str, float] = {}
        self.initial_level = math.nan

    # ---- where to ----------------------------------------------------------------------------------------------------

    def programmed_target(self: Controller, block: BlockWords) -> Vector:
        """End point in programmed coordinates (before mirror, scaling, rotation)."""
        start = self.transform.backward(self.position)
        end = start.copy()
        absolute = self.modal["distance"] == "G90"
        a, b, _ = self.axes
        for k, axis in enumerate("XYZ"):
            if axis not in block or (self.polar and k in (a, b)):
                continue
            value = self.millimetres(block, axis)
            end[k] = value if absolute else start[k] + value
        if self.polar and ("XYZ"[a] in block or "XYZ"[b] in block):
            if "XYZ"[a] in block:
                self.polar_radius = self.millimetres(block, "XYZ"[a])
                self.polar_origin = np.zeros(3) if absolute else start.copy()
            if "XYZ"[b] in block:
                angle = block.counted("XYZ"[b], 0.001)
                self.polar_angle = angle if absolute else self.polar_angle + angle
            turn = math.radians(self.polar_angle)
            end[a] = self.polar_origin[a] + self.polar_radius * math.cos(turn)
            end[b] = self.polar_origin[b] + self.polar_radius * math.sin(turn)
        return end

    def straight(self: Controller, kind: Literal["rapid", "line"], end: Vector, feed: float = math.nan) -> Item:
        item = Item(kind, self.line, self.position.copy(), end.copy(), feed=feed, axes=self.axes)
        self.items.append(item)
        self.position = end.copy()
        return item

    def feed(self: Controller, length_mm: float) -> float:
        """mm/min of a block; `length_mm` is the line's length, or the arc's radius (inverse time counts in it)."""
        if not self.f_word > 0.0:
            raise self.fail("cutting without a feed", 11)
        if self.modal["feed_mode"] == "G93":
            return self.f_word * length_mm
        per_unit = self.f_word * self.unit_mm
        return per_unit * self.spindle if self.modal["feed_mode"] == "G95" else per_unit

    # ---- one block ---------------------------------------------------------------------------------------------------

    def motion_block(self: Controller, block: BlockWords) -> None:
        if self.modal["cycle"] != "G80":
            # Operator's manual: a block without X, Y, Z, R drills nothing, and its Q and P are not stored.
            if any(letter in block for letter in "XYZR"):
                self.drill(block)
            return
        arc = self.modal["motion"] in ("G02", "G03")
        if not any(letter in block for letter in ("XYZIJKR" if arc else "XYZ")):
            return
        programmed = self.programmed_target(block)
        end = self.transform.forward(programmed)
        if not any("XYZ"[k] in block for k in self.axes[:2]) and not arc:
            # A move along the normal alone does not touch the plane, not even by rounding.
            end[list(self.axes[:2])] = self.position[list(self.axes[:2])]
        if self.modal["motion"] == "G00":
            item = self.straight("rapid", end)
        elif self.modal["motion"] == "G01":
            item = self.straight("line", end, self.feed(float(np.sqrt(np.sum((end - self.position) ** 2)))))
        else:
            item = self.arc(block, programmed, end)
        self.tag(item, block)

    def tag(self: Controller, item: Item, block: BlockWords) -> None:
        """Compensation and corner words, for the stages behind."""
        side = int(self.modal["comp"][1:])
        item.side = side
        if side != 40:
            item.offset_mm = self.tool("D", self.d_number) if self.d_number else 0.0
            if math.isnan(item.offset_mm):
                raise self.fail(f"radius of D{self.d_number} is not known")
            if self.transform.flips(*self.axes[:2]):
                item.side = 83 - side
        for kind in "RC":
            if f",{kind}" in block:
                item.corner = (kind, self.millimetres(block, f",{kind}"))

    def arc(self: Controller, block: BlockWords, programmed: Vector, end: Vector) -> Item:
        a, b, normal = self.axes
        start = self.transform.backward(self.position)
        if math.isnan(start[a] + start[b] + end[a] + end[b]):
            raise self.fail("arc from an unknown position")
        clockwise = self.modal["motion"] == "G02"
        centre = start.copy()
        if "R" in block:
            r = self.millimetres(block, "R")
            step = programmed - start
            chord = math.hypot(step[a], step[b])
            if chord < 1e-9:
                raise self.fail("arc by R without a chord", 20)
            if chord / 2 - abs(r) > self.arc_tolerance_mm:
                raise self.fail(f"R{abs(r)} is shorter than half the chord {chord / 2}", 20)
            height = math.sqrt(max(0.0, r * r - chord * chord / 4))
            left = (r > 0.0) != clockwise
            height *= 1.0 if left else -1.0
            centre[a] += step[a] / 2 - height * step[b] / chord
            centre[b] += step[b] / 2 + height * step[a] / chord
        else:
            if not any("IJK"[k] in block for k in (a, b)):
                raise self.fail("arc without R and centre", 22)
            for k in (a, b):
                if "IJK"[k] in block:
                    centre[k] += self.millimetres(block, "IJK"[k])
        radius = math.hypot(start[a] - centre[a], start[b] - centre[b])
        end_radius = math.hypot(programmed[a] - centre[a], programmed[b] - centre[b])
        if radius < 1e-9:
            raise self.fail("arc of radius zero", 20)
        if abs(radius - end_radius) > self.arc_tolerance_mm:
            raise self.fail(f"arc end off its radius by {abs(radius - end_radius):.4f}", 20)
        factors = self.transform.factors
        if abs(abs(factors[a]) - abs(factors[b])) > 1e-12:
            raise self.fail("arc scaled differently along its axes is not judged")
        centre = self.transform.forward(centre)
        centre[normal] = self.position[normal]
        ccw = clockwise == self.transform.flips(a, b)
        s, e = self.position - centre, end - centre
        sweep = math.atan2(e[b], e[a]) - math.atan2(s[b], s[a])
        sweep = sweep % math.tau if ccw else -(-sweep % math.tau)
        if math.hypot(programmed[a] - start[a], programmed[b] - start[b]) < 1e-9:
            sweep = math.tau if ccw else -math.tau
        scaled = radius * abs(float(factors[a]))
        item = Item("arc", self.line, self.position.copy(), end.copy(), centre=centre, sweep=sweep, axes=self.axes)
        item.feed = self.feed(scaled)
        self.items.append(item)
        self.position = end.copy()
        return item

    # ---- drilling ----------------------------------------------------------------------------------------------------

    def begin_cycle(self: Controller) -> None:
        self.cycle_words = {}
        self.initial_level = float(self.transform.backward(self.position)[self.axes[2]])

    def keep_cycle_words(self: Controller, block: BlockWords) -> None:
        """R and Z are kept as levels: a later G91 for the holes' places does not change what they mean."""
        data, incremental = self.cycle_words, self.modal["distance"] == "G91"
        if "R" in block:
            data["R"] = self.millimetres(block, "R") + (self.initial_level if incremental else 0.0)
        depth = "XYZ"[self.axes[2]]
        if depth in block:
            base = data.get("R", self.initial_level) if incremental else 0.0
            data["bottom"] = self.millimetres(block, depth) + base
        if "Q" in block:
            data["Q"] = abs(self.millimetres(block, "Q"))
        if "P" in block:
            self.cycle_words["P"] = block.number("P") / 1000.0

    def drill(self: Controller, block: BlockWords) -> None:
        self.keep_cycle_words(block)
        data = self.cycle_words
        normal = self.axes[2]
        repeats = block.whole("K") if "K" in block else block.whole("L") if "L" in block else 1
        if self.modal["cycle"] in ("G73", "G83") and not data.get("Q"):
            raise self.fail(f"{self.modal['cycle']} without Q", 45)
        r = data.get("R", self.initial_level)
        z = data.get("bottom", r)
        over = BlockWords([w for w in block.words if w.letter != "XYZ"[normal]], self.line, self.calculator)
        # Operator's manuals: scaling does not act on the depth of a peck and its return.
        factor = abs(float(self.transform.factors[normal]))
        for _ in range(repeats):
            if any("XYZ"[k] in over for k in self.axes[:2]):
                end = self.transform.forward(self.programmed_target(over))
                end[normal] = self.position[normal]
                self.straight("rapid", end)
            cycle = cycles.Cycle(
                self.modal["cycle"], self.initial_level, r, z, data.get("Q", 0.0) / factor, data.get("P", 0.0),
                self.modal["return_level"] == "G99", self.peck_clearance_mm / factor,
            )  # fmt: skip
            for what, amount in cycles.steps(cycle):
                self.cycle_step(what, amount)

    def cycle_step(self: Controller, what: str, amount: float) -> None:
        end = self.position.copy()
        if what == "dwell":
            self.items.append(Item("dwell", self.line, end, end.copy(), dwell_s=amount))
            return
        if what in ("shift", "back"):
            # Parameter 5101#4, #5 = 0: the tool's tip shifts along + of the plane's first axis.
            end[self.axes[0]] += amount if what == "shift" else -amount
            self.straight("rapid", end)
            return
        level = self.transform.backward(end)
        level[self.axes[2]] = amount
        end[self.axes[2]] = self.transform.forward(level)[self.axes[2]]
        length = abs(float(end[self.axes[2]] - self.position[self.axes[2]]))
        if what == "feed":
            self.straight("line", end, self.feed(length))
        else:
            self.straight("rapid", end)
