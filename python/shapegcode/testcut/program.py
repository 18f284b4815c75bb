"""A test cut as a FANUC program: mills the edge, then the measuring pass, for each pass; instructions in its head."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapegcode.io.atomic import write_text
from shapegcode.program.operating import OVERRIDE
from shapegcode.results.json import to_text
from shapegcode.testcut.cut import CornerDetails, Edge, offset_line, on_increments
from shapegcode.testcut.result import CutDesign

_SKIM_MM = 0.2
_ROUGH_SHARE = 0.1  # of the diameter: largest radial depth of the cuts that mill the edge
_RAW_MM = 0.5  # by which the raw edge may stand out
_CLEAR_Z_MM = 10.0
_NEAR_Z_MM = 2.0
_BLOCKS_OF_EDGE = 3.0  # times the block time that a block of the edge lasts at least
_SAMPLES_PER_TOOTH = 12.3  # no whole number: samples should not fall on the same angles over and over
_TITLES = {"taper": "TAPER TEST CUT", "corner": "CORNER ON A STRAIGHT LINE", "interval": "FEED INTERVAL TEST"}
_PURPOSES = {
    "taper": ("CUTTING COEFFICIENTS FROM A GROWING RADIAL DEPTH",),
    "corner": ("SAME RADIAL DEPTH AS IN A CORNER, FEED CONSTANT,", "THEN MODIFIED"),
    "interval": ("HOW OFTEN THE CONTROL FOLLOWS A CHANGE OF FEED",),
}
_PER_MINUTE = 60.0


def write_test_cut(design: CutDesign, file: str | Path, number: int = 7101) -> CutDesign:
    """Write the program of a test cut, and beside it the side file (JSON) that `fit_test_cut` reads.

    Args:
        design: what to cut.
        file: of the program; the side file has its name and the ending ``.json``.
        number: of the program, O.

    Returns:
        The design with the names of both files.

    Raises:
        OSError: a file cannot be written.
    """
    output = Path(file)
    side = output.with_suffix(".json")
    named = replace(design, cut=replace(design.cut, program=output.name), files=(str(output), str(side)))
    write_text(side, to_text(named.cut.data()))
    write_text(output, program_text(named, number))
    return named


def program_text(design: CutDesign, number: int = 7101) -> str:
    """The program of a test cut."""
    writer = _Writer(design)
    lines = ["%", f"O{number:04d}({_TITLES[design.cut.kind]})"]
    lines += [f"({line})" for line in writer.head()]
    lines += ["G21 G17 G90 G94 G64 G40 G49 G80", "G54"]
    lines += [f"S{design.cut.spindle_rev_per_min:g} M03", "G04 P3000", f"G00 Z{_text(_CLEAR_Z_MM)}"]
    for k in range(len(design.cut.passes)):
        lines += writer.passes(k)
    return "\n".join([*lines, "M05", "M30", "%"]) + "\n"


def _text(value: float, decimals: int = 3) -> str:
    """A number with its decimal point."""
    text = f"{value:.{decimals}f}".rstrip("0")
    return "0." if text in ("-0.", "0.") else text


class _Writer:
    def __init__(self, design: CutDesign) -> None:
        self.design, self.cut, self.controller = design, design.cut, design.machine.controller
        self.decimals = max(1, round(-math.log10(self.controller.least_increment_mm)))
        self.radius = self.cut.tool.radius_mm
        self.side = -1.0 if not self.cut.up else 1.0  # of the material, along Y: what lies within the raw edge
        self.walls: list[float] = []  # how far each wall lies within the raw edge
        depth = 0.0
        for each in self.cut.passes:
            depth += round(max(each.edge_height_mm) + _SKIM_MM, 3)
            self.walls.append(depth)

    def head(self) -> Iterator[str]:
        """Instructions, in lines that any control shows."""
        cut, tool = self.cut, self.cut.tool
        left, right = min(each.start_mm for each in cut.passes), max(each.end_mm for each in cut.passes)
        edge = "REAR EDGE" if self.side < 0.0 else "FRONT EDGE"
        rate = math.ceil(_SAMPLES_PER_TOOTH * tool.flutes * cut.spindle_rev_per_min / _PER_MINUTE / 10.0) * 10
        yield from _PURPOSES[cut.kind]
        yield f"SHAPEGCODE TESTCUT FOR {_plain(cut.machine)}"
        yield f"TOOL IN SPINDLE: D{tool.diameter_mm:g} MM, {tool.flutes} FLUTES,"
        yield f"HELIX {tool.helix_deg:g} DEG, FLUTES OVER {cut.axial_depth_mm:g} MM LONG"
        yield f"STOCK: X {self.design.stock_mm:g} MM LONG, {edge} FREE,"
        yield f"AT LEAST {math.ceil(self.walls[-1] + 5.0)} MM WIDE BEYOND THE CLAMPS,"
        yield f"FREE FROM TOP TO {math.ceil(cut.axial_depth_mm + 2.0)} MM BELOW"
        yield "CLAMP IT ON THE DYNAMOMETER, EDGE ALONG X WITHIN 0.1 MM"
        yield f"ZERO G54: X LEFT END, Y {edge}, Z TOP OF STOCK,"
        yield "Z WITH THIS TOOL: NO LENGTH OFFSET IS CALLED"
        far = self.side * (-_RAW_MM - 3.0 * self.radius), self.side * self.walls[-1]
        yield f"TOOL AXIS: X{left:g} TO {right:g}, Y{min(far):.1f} TO {max(far):.1f},"
        yield f"Z-{cut.axial_depth_mm:g} TO {_CLEAR_Z_MM:g}: KEEP IT FREE OF CLAMPS"
        yield OVERRIDE.comment
        yield "NO LOOK-AHEAD MODE THAT CHANGES F"
        yield f"AT EACH M00: START A NEW RECORD, FX FY, {rate} HZ OR MORE,"
        yield "FX ALONG +X, FY ALONG +Y, THEN CYCLE START;"
        yield "STOP THE RECORD AT THE NEXT STOP. ONE FILE PER PASS"
        yield "FIRST RUN: DRY, ABOVE THE STOCK"
        if isinstance(cut.about, CornerDetails) and cut.about.deeper_than_corner is not None:
            deeper = cut.about.deeper_than_corner
            yield f"X{deeper.from_mm:.2f} TO {deeper.to_mm:.2f}: UP TO {deeper.most_mm:.3f} MM DEEPER"
            yield "THAN THE CORNER: THE ROUND TOOL LEAVES IT"

    def passes(self, k: int) -> Iterator[str]:
        """The edge of a pass, a stop, and the pass."""
        each = self.cut.passes[k]
        wall = self.walls[k]
        before = self.walls[k - 1] if k else -_RAW_MM
        path = offset_line(self.design.edge, self.radius, each.start_mm, each.end_mm)
        path = on_increments(path, self.controller.least_increment_mm)
        yield f"(PASS {k + 1}: MILL THE EDGE)"
        for offset in _offsets(self.design.edge, before, wall, self.design.stock_mm, self.cut.tool.diameter_mm):
            yield from self._edge(path, wall, offset, min(feed for _, feed in each.feeds))
        yield f"G00 Z{_text(_CLEAR_Z_MM)}"
        yield f"M00 (START RECORD {k + 1}: {each.name})"
        # The control may have stopped the spindle.
        yield f"S{self.cut.spindle_rev_per_min:g} M03"
        yield "G04 P3000"
        yield from self._begin(each.start_mm, self.side * (wall - self.radius), each.feed_mm_per_min)
        for end, feed in each.feeds:
            yield f"G01 X{_text(end, self.decimals)} F{_text(feed, 1)}"
        yield f"G00 Z{_text(_CLEAR_Z_MM)}"
        yield f"M00 (STOP RECORD {k + 1})"
        yield f"S{self.cut.spindle_rev_per_min:g} M03"

    def _begin(self, x: float, y: float, feed: float) -> Iterator[str]:
        yield f"G00 X{_text(x, self.decimals)} Y{_text(y, self.decimals)}"
        yield f"Z{_text(_NEAR_Z_MM)}"
        yield f"G01 Z{_text(-self.cut.axial_depth_mm, self.decimals)} F{_text(max(feed, 100.0), 1)}"

    def _edge(self, path: Edge, wall: float, offset: float, feed: float) -> Iterator[str]:
        """One cut along the edge, farther out by an offset."""
        y = wall - path.height_mm - offset
        shortest = float(np.min(np.hypot(np.diff(path.x_mm), np.diff(y))))
        block_s = max(self.controller.block_time_s, self.controller.interpolation_period_s)
        feed = max(min(feed, shortest / (_BLOCKS_OF_EDGE * block_s) * _PER_MINUTE), 1.0)
        yield from self._begin(float(path.x_mm[0]), self.side * float(y[0]), feed)
        first = f" F{_text(math.floor(feed * 10.0) / 10.0, 1)}"
        for px, py in zip(path.x_mm[1:], y[1:], strict=True):
            yield f"G01 X{_text(float(px), self.decimals)} Y{_text(self.side * float(py), self.decimals)}{first}"
            first = ""
        yield f"G00 Z{_text(_NEAR_Z_MM)}"


def _offsets(edge: Edge, before: float, wall: float, stock: float, diameter: float) -> list[float]:
    """How far outside of the edge each cut runs: none takes off much, the last one little, so that it bends little."""
    x = np.linspace(0.0, stock, 200)
    most = float(np.max(wall - edge.at(x) - before))
    if most <= _SKIM_MM:
        return [0.0]
    rough = math.ceil((most - _SKIM_MM) / (_ROUGH_SHARE * diameter))
    return [round(_SKIM_MM + (most - _SKIM_MM) * k / rough, 3) for k in range(rough - 1, -1, -1)] + [0.0]


def _plain(name: str) -> str:
    return "".join(sign for sign in name.upper() if sign.isalnum() or sign in " -.")[:30]
