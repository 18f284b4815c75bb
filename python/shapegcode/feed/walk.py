"""The spindle and its tool along a program: what each cutting move meets when it is swept through the material."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.cutting.tool import Tool
from shapegcode.cutting.zero_points import ZeroPoints
from shapegcode.program import Program

__all__ = ["SurveyedMove", "SurveyedRegion", "Walk", "why_not_swept"]

_SHOWN_COLLISIONS = 5
_SLACK_MM = 1e-6
_TOOL_CHANGE, _CLOCKWISE, _COUNTER_CLOCKWISE, _STOP = 6, 3, 4, 5


@dataclass(frozen=True)
class SurveyedRegion:
    """A run of cutting moves between two stops, and what the tool meets on it.

    Attributes:
        region: of the program.
        index: of the region.
        tool: the tool that cuts it; None: one without a tool file.
        track: what the tool meets; None where it is not known.
        spindle_rev_per_min: speed of the spindle, 0 where it is not known.
        sense: in which it turns.
        kept: why the feeds of the region stay as they are; empty if they may change.
        clear: per sample whether nothing is met for certain, (n,): behind a ramp the layers of the material are cut in
            part, which the track takes for whole or gone. None: wherever the track says so.
    """

    region: _core.Region
    index: int
    tool: Tool | None
    track: _core.EngagementTrack | None
    spindle_rev_per_min: float
    sense: _core.SpindleSense
    kept: str
    clear: npt.NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class SurveyedMove:
    """A cutting move outside of the regions that meets material: its feed stays, but its force counts.

    Attributes:
        place: file and line.
        tool: what cuts.
        track: what it meets.
        feed_mm_per_min: as programmed.
        spindle_rev_per_min: speed of the spindle, 0 where it is not known.
        sense: in which it turns.
    """

    place: str
    tool: Tool
    track: _core.EngagementTrack
    feed_mm_per_min: float
    spindle_rev_per_min: float
    sense: _core.SpindleSense


def why_not_swept(region: _core.Region, zero: ZeroPoints) -> str:
    """Why what the tool meets on a region cannot be told; empty if it can."""
    if elsewhere := zero.why_elsewhere(region.first_line):
        return elsewhere
    if region.incremental:
        return "its place is not known"
    if not region.path.arcs_in_xy:
        path = region.path
        first = next(i for i in range(len(path)) if path[i].kind == _core.SegmentKind.arc and path[i].normal != 2)
        return f"it holds arcs that are not in the XY plane (G17), the first in line {path[first].line_number}"
    return ""


def _above_overhang(tool: Tool, track: _core.EngagementTrack) -> float:
    """Height above the tip of what is cut above the clamping, mm; 0: nothing."""
    top = float(track.arcs[:, 3].max(initial=0.0)) if len(track.arcs) else 0.0
    return top if top > tool.tool.overhang_mm else 0.0


class Walk:
    """The state of the spindle and its tool along a program."""

    def __init__(self, program: Program, tools: Sequence[Tool]) -> None:
        self.warnings: list[str] = []
        self.zero = ZeroPoints(program)
        self._program = program
        self._functions = program.core.functions
        self._moves = program.core.other_moves
        self._sense: _core.SpindleSense | None = None
        self._ready = -1  # T before its M06
        self._number = -1
        self.moves: list[SurveyedMove] = []
        # A second work piece on which ramps leave what they may have left: what is air there is air for certain.
        self.cautious: _core.Material | None = None
        self._speed = -1.0
        self._stands = False  # M05
        self._collisions: list[str] = []
        # Where a program moves from places that are not known, neither are those of its rapids.
        self._adrift = any(region.incremental for region in program.regions)
        self._tools: dict[int, Tool] = {}
        self._any: Tool | None = None
        for tool in tools:
            number = tool.tool.number
            if number is None:
                if len(tools) > 1:
                    raise _core.ArgumentError(f"{len(tools)} tools: each needs its T number (tool.number)")
                self._any = tool
            elif number in self._tools:
                raise _core.ArgumentError(f"two tools have the number T{number}")
            else:
                self._tools[number] = tool
        # Where the program changes tools, T alone only gets the next one ready.
        self._changes = any(_TOOL_CHANGE in m_codes for m_codes, _, _ in self._functions)
        used = {tool for _, tool, _ in self._functions if tool > 0}
        if self._any is not None and len(used) > 1:
            self.warnings.append(
                f"{program.source}: uses the tools {', '.join(f'T{n}' for n in sorted(used))}: all are taken as "
                f"{self._any.tool.name}; give tool.number to tell them apart"
            )

    def function(self, index: int) -> None:
        """A block with M, S or T words."""
        m_codes, tool, speed = self._functions[index]
        if speed > 0.0:
            self._speed = speed
        if tool > 0:
            self._ready = tool
        if _TOOL_CHANGE in m_codes and self._ready > 0:
            self._number = self._ready
        self._stands = _STOP in m_codes or (self._stands and not {_CLOCKWISE, _COUNTER_CLOCKWISE} & set(m_codes))
        if _CLOCKWISE in m_codes:
            self._sense = _core.SpindleSense.clockwise
        if _COUNTER_CLOCKWISE in m_codes:
            self._sense = _core.SpindleSense.counter_clockwise

    @property
    def _tool(self) -> Tool | None:
        if self._any is not None:
            return self._any
        number = self._in_spindle
        if number <= 0 and len(self._tools) == 1 and not self._changes:  # a program for one tool need not name it
            return next(iter(self._tools.values()))
        return self._tools.get(number)

    @property
    def _in_spindle(self) -> int:
        """T number of the tool that cuts; not positive: not known."""
        return self._number if self._changes else self._ready

    def tools_of_regions(self) -> list[Tool | None]:
        """What cuts each region; the walk stands at the program's start again afterwards."""
        found: list[Tool | None] = []
        for kind, index, _ in self._program.core.steps:
            if kind == _core.StepKind.function:
                self.function(index)
            elif kind == _core.StepKind.region:
                found.append(self._tool)
        self._sense, self._ready, self._number, self._speed, self._stands = None, -1, -1, -1.0, False
        return found

    def why_no_tool(self, cutters: Sequence[Tool | None]) -> str:
        """Which tools are missing where no region has one; empty if that is not the reason."""
        if not cutters or any(cutter is not None for cutter in cutters):
            return ""
        used = sorted({tool for _, tool, _ in self._functions if tool > 0})
        said = f"the program uses {', '.join(f'T{n}' for n in used)}" if used else "the program names no tool"
        return f": {said}, the tool files describe {', '.join(f'T{n}' for n in sorted(self._tools))}"

    def cuts_elsewhere(self) -> list[_core.Path]:
        """Cutting moves outside of the regions, each as a path."""
        return [
            _core.Path([segment])
            for segment, dwell_s in self._moves
            if segment.kind != _core.SegmentKind.rapid and not dwell_s > 0.0 and segment.length_mm > 0.0
        ]

    def sweep_other(self, material: _core.Material, index: int, line: int) -> None:
        """A rapid, or a cutting move outside of the regions."""
        segment, dwell_s = self._moves[index]
        tool = self._tool
        if tool is None or dwell_s > 0.0 or not segment.length_mm > 0.0:
            return
        if segment.kind == _core.SegmentKind.arc and segment.normal != 2:
            return
        if (segment.kind == _core.SegmentKind.rapid and self._adrift) or self.zero.why_elsewhere(line):
            return
        path = _core.Path([segment])
        track = _core.sweep(material, path, tool.tool.diameter_mm)
        if self.cautious is not None:
            _core.sweep(self.cautious, path, tool.tool.diameter_mm)
        if not (track.section_mm2.any() or track.plunged_mm2.any()):
            return
        if segment.kind == _core.SegmentKind.rapid:
            self._collisions.append(self._program.place(line))
        elif not _above_overhang(tool, track):
            speed = self._speed if self._speed > 0.0 else tool.feed.spindle_rev_per_min or 0.0
            feed = segment.feed_mm_per_s * 60.0
            place = self._program.place(line)
            self.moves.append(SurveyedMove(place, tool, track, feed, speed, tool.sense(self._sense)))

    def tell_collisions(self) -> None:
        """A warning for each place at which a rapid runs into material; of many the first ones."""
        places = list(dict.fromkeys(self._collisions))
        told = [
            f"{place}: rapid into material: is Z 0 of the stock file that of the program?"
            for place in places[:_SHOWN_COLLISIONS]
        ]
        if len(places) > _SHOWN_COLLISIONS:
            told.append(f"{self._program.source}: {len(places) - _SHOWN_COLLISIONS} more rapids into material")
        self.warnings[:0] = told

    def _look_at_depth(self, region: _core.Region, tool: Tool, track: _core.EngagementTrack) -> None:
        """Say where the tool cuts above its flutes."""
        if not len(track.arcs):
            return
        tops = track.arcs[:, 3]
        deepest = int(tops.argmax())
        flutes_mm = tool.tool.flute_length_mm
        if tops[deepest] > flutes_mm + _SLACK_MM:
            sample = int(np.searchsorted(track.first_arc, deepest, side="right")) - 1
            line = int(region.path.segment_lines[track.segment[sample]])
            self.warnings.append(
                f"{self._program.place(line)}: cuts {tops[deepest]:.4g} mm above the tip, tool.flute_length_mm is "
                f"{flutes_mm:g}: the shank would rub"
            )

    def sweep_region(self, material: _core.Material, index: int) -> SurveyedRegion:
        """A region."""
        region = self._program.regions[index]
        tool = self._tool
        kept = why_not_swept(region, self.zero)
        if tool is None:
            number = self._in_spindle
            kept = f"no tool file describes T{number}" if number > 0 else "the program names no tool before it"
        speed = region.entry.spindle_rev_per_min
        if tool is not None and not speed > 0.0:
            speed = tool.feed.spindle_rev_per_min or 0.0
        track, clear = None, None
        if tool is not None and not kept:
            track = _core.sweep(material, region.path, tool.tool.diameter_mm)
            if self.cautious is not None:
                clear = ~(_core.sweep(self.cautious, region.path, tool.tool.diameter_mm).section_mm2 > 0.0)
            self._look_at_depth(region, tool, track)
            if above := _above_overhang(tool, track):
                kept = f"it cuts {above:.3g} mm above the tip, tool.overhang_mm is {tool.tool.overhang_mm:g}"
                track = None
            elif not speed > 0.0:
                kept = "no spindle speed: neither S in the program nor feed.spindle_rev_per_min in the tool file"
            elif self._stands:
                kept = "the spindle stands (M05)"
            elif not _core.feeds_per_minute(self._program.core, region):
                kept = "not all of its feeds are per minute (G94) in one unit"
        sense = _core.SpindleSense.clockwise if tool is None else tool.sense(self._sense)
        return SurveyedRegion(region, index, tool, track, speed, sense, kept, clear)
