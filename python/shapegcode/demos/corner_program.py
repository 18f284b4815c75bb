"""The corners of paper 001 as files: a FANUC program, its tool and its stock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources

from shapegcode import _core

__all__ = [
    "ALLOWANCE_MM", "AXIAL_DEPTH_MM", "BLOCK_MM", "CASES", "STRAIGHT_MM", "TOOL_RADIUS_MM", "CornerCase",
    "corner_program", "program_name", "stock_text", "tool_text",
]  # fmt: skip

TOOL_RADIUS_MM = 4.0
ALLOWANCE_MM = 0.8
AXIAL_DEPTH_MM = 15.0
FEED_MM_PER_REV = 0.12
BLOCK_MM = 0.6
STRAIGHT_MM = 30.0


@dataclass(frozen=True)
class CornerCase:
    """A row of table 1.

    Attributes:
        number: of the case.
        rough_radius_mm: of the corner as roughing left it.
        finish_radius_mm: of the corner to be made.
        spindle_rev_per_min: speed of the spindle.
    """

    number: int
    rough_radius_mm: float
    finish_radius_mm: float
    spindle_rev_per_min: float

    @property
    def feed_mm_per_min(self) -> float:
        """As programmed."""
        return FEED_MM_PER_REV * self.spindle_rev_per_min


CASES = (CornerCase(1, 8.0, 8.0, 1800.0), CornerCase(2, 4.0, 4.0, 2000.0), CornerCase(3, 8.0, 4.0, 2000.0))


def corner_program(case: CornerCase, cut: _core.CornerCut, feed_mm_per_min: float) -> str:
    """The corner as a FANUC program: line, arc where there is one, line."""
    path = cut.path(feed_mm_per_min / 60.0)
    start = path[0].start_mm
    moves: Sequence[str] = [_move(path[i], case.finish_radius_mm - TOOL_RADIUS_MM) for i in range(len(path))]
    return "\n".join(
        [
            "%",
            f"O{1000 + case.number}",
            "G21 G17 G90 G94",
            f"M03 S{case.spindle_rev_per_min:.0f}",
            f"G00 X{start[0]:.3f} Y{start[1]:.3f}",
            f"G00 Z{-AXIAL_DEPTH_MM:.3f}",
            f"{moves[0]} F{feed_mm_per_min:g}",
            *moves[1:],
            "G00 Z10.",
            "M30",
            "%",
            "",
        ]
    )


def _move(segment: _core.Segment, radius_mm: float) -> str:
    place = f"X{segment.end_mm[0]:.3f} Y{segment.end_mm[1]:.3f}"
    return f"G03 {place} R{radius_mm:.3f}" if segment.kind == _core.SegmentKind.arc else f"G01 {place}"


def program_name(case: CornerCase) -> str:
    """Name of the program in messages."""
    return f"corner case {case.number}"


def tool_text(limits: str = "") -> str:
    """The tool file of the paper, with limits."""
    text = (resources.files("shapegcode") / "data" / "milling" / "paper001_tool.toml").read_text(encoding="utf-8")
    return f"{text}\n{limits}"


def stock_text(case: CornerCase) -> str:
    """The stock file: what roughing left."""
    return (
        f"[allowance]\nallowance_mm = {ALLOWANCE_MM!r}\ncorner_radius_mm = {case.rough_radius_mm!r}\n"
        f'wall = "right"\nz_mm = [{-AXIAL_DEPTH_MM!r}, 0.0]\n'
    )
