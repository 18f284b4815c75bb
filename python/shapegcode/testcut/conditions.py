"""What every test cut needs to know: machine, tool, speed, feed, depth; and the corner that one may be made of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from shapegcode import _core
from shapegcode.cutting.tool import Tool
from shapegcode.errors import ArgumentError
from shapegcode.machine import Machine
from shapegcode.testcut.cut import CuttingLaw, CutTool

__all__ = ["CornerShape", "CutConditions"]

_LEAST_AIR_MM = 5.0
_AIR_REVS = 20.0
_LARGEST_SHARE = 0.95  # of the radius, up to which a radial depth is taken


@dataclass(frozen=True)
class CutConditions:
    """What every test cut needs to know; what machine and tool cannot do is refused when a cut is drawn up.

    Attributes:
        machine: whose controller runs the program.
        tool: the tool file.
        feed_mm_per_min: of the measuring passes; of a corner that of its straight part.
        axial_depth_mm: of every pass.
        spindle_rev_per_min: of every pass; None: `feed.spindle_rev_per_min` of the tool.
        up: up milling, the material on the left of the feed.
    """

    machine: Machine
    tool: Tool
    feed_mm_per_min: float
    axial_depth_mm: float
    spindle_rev_per_min: float | None = None
    up: bool = False

    @property
    def spindle(self) -> float:
        """Spindle speed, rev/min.

        Raises:
            ArgumentError: neither conditions nor tool state one.
        """
        known = self.tool.feed.spindle_rev_per_min if self.spindle_rev_per_min is None else self.spindle_rev_per_min
        if known is None:
            raise ArgumentError("the tool has no feed.spindle_rev_per_min: state the spindle speed (-S)")
        return known

    @property
    def diameter_mm(self) -> float:
        """Of the tool."""
        return 2.0 * self.tool.radius_mm

    def cut_tool(self) -> CutTool:
        """The tool as the side file holds it."""
        cutter = self.tool.tool
        runout = tuple(0.001 * value for value in cutter.runout_um or ())
        law = CuttingLaw.of(self.tool.coefficients())
        return CutTool(cutter.diameter_mm, cutter.flutes, cutter.helix_deg, runout, law)

    def air_mm(self, feed_mm_per_min: float) -> float:
        """How far a pass goes through the air at both ends.

        Args:
            feed_mm_per_min: its largest feed.

        Returns:
            Millimetres beyond the tool's radius.
        """
        return max(_LEAST_AIR_MM, math.ceil(_AIR_REVS * feed_mm_per_min / self.spindle))

    def check_feeds(self, feeds: Sequence[float]) -> None:
        """Refuse what the machine or the tool cannot do.

        Args:
            feeds: of blocks, mm/min.

        Raises:
            ArgumentError: a feed outside of the machine's, an axial depth beyond the flutes, a spindle that turns left.
        """
        most = self.machine.axes.x.max_feed_mm_per_min
        least = self.machine.controller.minimum_feed_mm_per_min
        for feed in feeds:
            if not least <= feed <= most:
                raise ArgumentError(f"a feed of {feed:g} mm/min: this machine takes {least:g} to {most:g} mm/min")
        long = self.tool.tool.flute_length_mm
        if self.axial_depth_mm > long:
            raise ArgumentError(f"an axial depth of {self.axial_depth_mm:g} mm: the flutes are {long:g} mm long")
        if self.tool.sense() != _core.SpindleSense.clockwise:
            raise ArgumentError("the tool turns counter-clockwise: test cuts are written for M03 only")

    def check_depths(self, low_mm: float, high_mm: float) -> None:
        """Refuse radial depths that the round tool cannot have on a straight pass.

        Args:
            low_mm: the smallest.
            high_mm: the largest.

        Raises:
            ArgumentError: below 0, too near to the radius, or falling.
        """
        most = _LARGEST_SHARE * self.tool.radius_mm
        if not 0.0 < low_mm <= high_mm <= most:
            raise ArgumentError(
                f"radial depths from {low_mm:g} to {high_mm:g} mm: must ascend, above 0, at most {most:g} mm"
            )


@dataclass(frozen=True)
class CornerShape:
    """An inside corner between two straight walls at a right angle (paper 001, figure 1; docs/evidence/references.md).

    Attributes:
        allowance_mm: radial depth on the walls; None: 0.1 D of the tool.
        rough_radius_mm: of the corner that roughing left; None: D.
        finish_radius_mm: of the finished corner; None: D.
    """

    allowance_mm: float | None = None
    rough_radius_mm: float | None = None
    finish_radius_mm: float | None = None

    def sizes_mm(self, diameter_mm: float) -> tuple[float, float, float]:
        """The three values for a tool.

        Args:
            diameter_mm: of the tool, D.

        Returns:
            Allowance, rough and finish radius; of what is not given, case 1 of the paper.
        """
        given = (self.allowance_mm, self.rough_radius_mm, self.finish_radius_mm)
        usual = (0.1 * diameter_mm, diameter_mm, diameter_mm)
        allowance, rough, finish = (other if own is None else own for own, other in zip(given, usual, strict=True))
        return allowance, rough, finish
