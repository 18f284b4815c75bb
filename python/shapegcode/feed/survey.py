"""Tool engagement along a program: the tool sweeps the stock move by move, in program order."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.cutting.material import build_material
from shapegcode.cutting.stock import Stock
from shapegcode.cutting.tool import Tool
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.program.compensation import program_for_conversion

_COARSEST = 0.1  # coarsest resolution, relative to the smallest tool's radius
_RESOLUTION_RATIO = 0.01  # default resolution, relative to the smallest tool's diameter
_SHOWN_COLLISIONS = 5
_SLACK_MM = 1e-6
_TOOL_CHANGE, _CLOCKWISE, _COUNTER_CLOCKWISE, _STOP = 6, 3, 4, 5
COMMENT = re.compile(rb"\([^)]*\)")
_CODE = re.compile(rb"G0*(52|53|54\.1|54|55|56|57|58|59|92|10)(?![\d.])")
_P = re.compile(rb"P0*(\d+)")
_SHIFT_WORD = re.compile(rb"[XYZIJK]\s*([+-]?[\d.]+)")


@dataclass(frozen=True)
class Survey:
    """Engagement of the tools along a program, from sweeping them through its stock.

    Attributes:
        program: the program.
        regions: its regions in order.
        moves: cutting moves outside the regions that remove material.
        material: remaining stock.
        warnings: findings, each with its location.
    """

    program: Program
    regions: tuple[SurveyedRegion, ...]
    moves: tuple[SurveyedMove, ...]
    material: _core.Material
    warnings: tuple[str, ...]


def survey(
    program: Program | str | Path,
    machine: Machine | str | Path,
    tools: Tool | Sequence[Tool],
    stock: Stock,
    *,
    resolution_mm: float | None = None,
    on_progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> Survey:
    """Compute the tool engagement along a program.

    Args:
        program: the program, or its file.
        machine: machine whose controller runs it.
        tools: the cutting tools; several need their T numbers.
        stock: stock before the first block.
        resolution_mm: grid spacing of the simulated material; None: a hundredth of the smallest tool's diameter.
        on_progress: called with completed and total steps.

    Returns:
        Engagement along the path of each region, and the remaining stock.

    Raises:
        ProgramError: the program cannot be read.
        ArgumentError: no tool, indistinguishable tools, no cutting move, or a grid that does not fit into
            memory.
        StockError: the stock does not suit the program.
    """
    machine = Machine.of(machine)
    tools = list(tools) if isinstance(tools, Sequence) else [tools]
    if not tools:
        raise _core.ArgumentError("no tool is given; required: at least one")
    if wrong := [each for each in tools if not isinstance(each, Tool)]:
        raise _core.ArgumentError(f"tools: sg.Tool.load(file) is needed, not {type(wrong[0]).__name__}")
    program = program_for_conversion(program, machine)
    walk = Walk(program, tools)
    material = _material(walk, program, machine, tools, stock, resolution_mm)
    if any(tool.feed.air_feed_mm_per_min is not None for tool in tools):
        walk.cautious = material.copy()
        walk.cautious.take_whole_layers()
    regions: list[SurveyedRegion] = []
    total = len(program.core.steps)
    for done, (kind, index, line) in enumerate(program.core.steps):
        if kind == _core.StepKind.function:
            walk.function(index)
        elif kind == _core.StepKind.move:
            walk.sweep_other(material, index, line)
        else:
            regions.append(walk.sweep_region(material, index))
        on_progress(done + 1, total)
    walk.warn_of_collisions()  # first, as collisions invalidate all other warnings
    known = [region.track for region in regions if region.track is not None]
    if known and not any(track.section_mm2.any() for track in known):
        walk.warnings.append(
            f"{program.source}: the tool never touches the stock: check its position, in program coordinates"
        )
    return Survey(program, tuple(regions), tuple(walk.moves), material, tuple(walk.warnings))


def _material(
    walk: Walk, program: Program, machine: Machine, tools: Sequence[Tool], stock: Stock, resolution_mm: float | None
) -> _core.Material:
    cutters = walk.tools_of_regions()
    reasons = [why_not_swept(region, walk.zero) for region in program.regions]
    swept = [index for index, reason in enumerate(reasons) if not reason and cutters[index] is not None]
    if not swept:
        why = next((f": {reason}" for reason in reasons if reason), walk.why_no_tool(cutters))
        if program.core.kept_compensated_moves:
            why = ': they run under unexpanded cutter compensation; set input.compensation = "expand"'
        raise _core.ArgumentError(f"{program.source}: no cutting moves whose engagement can be computed{why}")
    smallest = min(tools, key=lambda tool: tool.radius_mm)
    if resolution_mm is not None and not 0.0 < resolution_mm <= _COARSEST * smallest.radius_mm:
        raise _core.ArgumentError(
            f"resolution is {resolution_mm:g} mm, must be above 0 and at most {_COARSEST * smallest.radius_mm:g} mm "
            f"(a tenth of the radius of {smallest.tool.name})"
        )
    resolution = resolution_mm or _RESOLUTION_RATIO * smallest.tool.diameter_mm
    # The walls of an allowance are those of the finishing tool.
    walls = [program.regions[index].path for index in swept if cutters[index] is smallest]
    others = [program.regions[index].path for index in swept if cutters[index] is not smallest]
    return build_material(stock, walls, smallest, resolution, machine, others=[*others, *walk.cuts_elsewhere()])


@dataclass(frozen=True)
class SurveyedRegion:
    """A sequence of cutting moves between two stops, with its engagement."""

    region: _core.Region  # region of the program
    tool: Tool | None  # the tool that cuts it; None: without a tool file, or not known
    track: _core.EngagementTrack | None  # engagement; None if unknown
    spindle_rev_per_min: float  # speed of the spindle, 0 if unknown
    sense: _core.SpindleSense  # sense of rotation
    kept: str  # why the feeds of the region stay unchanged; empty if they may change
    # whether a sample is certainly in air, (n,): a layer that a ramp has cut only in part still counts as material
    # here, but may count as removed in the track. None: as in the track
    clear: npt.NDArray[np.bool_] | None = None

    @property
    def window_s(self) -> float:
        """Time between two teeth, s, over which feeds are averaged; needs tool and speed."""
        assert self.tool is not None
        return 60.0 / (self.tool.tool.flutes * self.spindle_rev_per_min)


@dataclass(frozen=True)
class SurveyedMove:
    """A cutting move in material outside the regions: its feed stays, but its force counts."""

    place: str  # file and line
    tool: Tool  # its tool
    track: _core.EngagementTrack  # its engagement
    feed_mm_per_min: float  # as programmed
    spindle_rev_per_min: float  # speed of the spindle, 0 if unknown
    sense: _core.SpindleSense  # sense of rotation


def why_not_swept(region: _core.Region, zero: ZeroPoints) -> str:
    """Why the engagement in a region is unknown; empty if it is known."""
    if elsewhere := zero.why_elsewhere(region.first_line):
        return elsewhere
    if region.incremental:
        return "its position is unknown"
    if not region.path.arcs_in_xy:
        segments = map(region.path.__getitem__, range(len(region.path)))
        first = next(each for each in segments if each.kind == _core.SegmentKind.arc and each.normal != 2)
        return f"it has arcs that are not in the XY plane (G17), the first in line {first.line_number}"
    return ""


def _above_overhang(tool: Tool, track: _core.EngagementTrack) -> float:
    """Height above the tip up to which the tool cuts, mm, if that exceeds the tool's overhang; else 0."""
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
        # A second stock on which ramps leave all possible material: air there is certain.
        self.cautious: _core.Material | None = None
        self._speed = -1.0
        self._stands = False  # M05
        self._collisions: list[str] = []
        # If a program moves from unknown positions, those of its rapids are unknown too.
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
        # If the program changes tools, T alone only preselects the next one.
        self._changes = any(_TOOL_CHANGE in m_codes for m_codes, _, _ in self._functions)
        self._used = [f"T{number}" for number in sorted({tool for _, tool, _ in self._functions if tool > 0})]
        if self._any is not None and len(self._used) > 1:
            self.warnings.append(
                f"{program.source}: uses the tools {', '.join(self._used)}: all are assumed to be "
                f"{self._any.tool.name}; set tool.number to distinguish them"
            )

    def function(self, index: int) -> None:
        """Process a block with M, S or T words."""
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
        if number <= 0 and len(self._tools) == 1 and not self._changes:  # a program with one tool need not name it
            return next(iter(self._tools.values()))
        return self._tools.get(number)

    @property
    def _in_spindle(self) -> int:
        """T number of the tool in the spindle; 0 or negative: unknown."""
        return self._number if self._changes else self._ready

    def tools_of_regions(self) -> list[Tool | None]:
        """Tool of each region; afterwards the walk is at the program's start again."""
        found: list[Tool | None] = []
        for kind, index, _ in self._program.core.steps:
            if kind == _core.StepKind.function:
                self.function(index)
            elif kind == _core.StepKind.region:
                found.append(self._tool)
        self._sense, self._ready, self._number, self._speed, self._stands = None, -1, -1, -1.0, False
        return found

    def why_no_tool(self, cutters: Sequence[Tool | None]) -> str:
        """Message with used and described tools, if there are regions and none has a described tool; else empty."""
        if not cutters or any(cutter is not None for cutter in cutters):
            return ""
        used_tools = f"the program uses {', '.join(self._used)}" if self._used else "the program names no tool"
        return f": {used_tools}, the tool files describe {', '.join(f'T{n}' for n in sorted(self._tools))}"

    def cuts_elsewhere(self) -> list[_core.Path]:
        """Cutting moves outside the regions, each as a path."""
        return [
            _core.Path([segment])
            for segment, dwell_s in self._moves
            if segment.kind != _core.SegmentKind.rapid and not dwell_s > 0.0 and segment.length_mm > 0.0
        ]

    def sweep_other(self, material: _core.Material, index: int, line: int) -> None:
        """Sweep a rapid, or a cutting move outside the regions."""
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

    def warn_of_collisions(self) -> None:
        """Warn of each rapid into material; of many the first ones."""
        places = list(dict.fromkeys(self._collisions))
        why = "rapid into material: is Z 0 of the stock file that of the program?"
        messages = [f"{place}: {why}" for place in places[:_SHOWN_COLLISIONS]]
        if (more := len(places) - _SHOWN_COLLISIONS) > 0:
            messages.append(f"{self._program.source}: {more} more rapids into material")
        self.warnings[:0] = messages

    def _look_at_depth(self, region: _core.Region, tool: Tool, track: _core.EngagementTrack) -> None:
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
        """Sweep a region, and return its engagement."""
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
                kept = "the spindle is stopped (M05)"
            elif not _core.feeds_per_minute(self._program.core, region):
                kept = "not all of its feeds are per minute (G94) in one unit"
        sense = _core.SpindleSense.clockwise if tool is None else tool.sense(self._sense)
        return SurveyedRegion(region, tool, track, speed, sense, kept, clear)


class ZeroPoints:
    """Work coordinates and zero shifts along the program; the stock is described in those of the first cutting move."""

    def __init__(self, program: Program) -> None:
        self._lines: list[int] = []  # lines of changes
        self._states: list[tuple[str, str]] = []  # work coordinates, their shift
        self._machine: set[int] = set()  # lines with positions of the machine (G53)
        system, shift = "", ""
        for number, raw in enumerate(program.core.text.split(b"\n"), start=1):
            if b"G" not in raw and b"g" not in raw:
                continue
            line = COMMENT.sub(b"", raw).upper().replace(b" ", b"")
            for code in (match.group(1) for match in _CODE.finditer(line)):
                if code == b"53":
                    self._machine.add(number)
                    continue
                if code == b"54.1":
                    chosen = _P.search(line)
                    system = f"G54.1P{chosen.group(1).decode() if chosen else '?'}"
                elif code in (b"52", b"92", b"10"):
                    shift = self._shift(code, line, number, shift)
                else:
                    system = f"G{code.decode()}"
                self._lines.append(number)
                self._states.append((system, shift))
        regions = program.regions
        self._first = self._state(regions[0].first_line) if regions else ("", "")

    @staticmethod
    def _shift(code: bytes, line: bytes, number: int, shift: str) -> str:
        if code == b"10" and not (b"L2" in line and b"L12" not in line):  # tools, parameters: not a zero point
            return shift
        values = [float(value) for value in _SHIFT_WORD.findall(line.split(b"G" + code, 1)[-1]) if value != b"."]
        if code == b"52" and values and not any(values) and (not shift or shift.startswith("G52")):
            return ""  # shift cancelled
        return f"G{code.decode()} in line {number}"

    def _state(self, line: int) -> tuple[str, str]:
        at = bisect_right(self._lines, line)
        return self._states[at - 1] if at else ("", "")

    def why_elsewhere(self, line: int) -> str:
        """Why the positions of a line are not in stock coordinates; empty if they are."""
        if line in self._machine:
            return "its positions are those of the machine (G53)"
        system, shift = self._state(line)
        first_system, first_shift = self._first
        if (system or "G54") != (first_system or "G54"):
            return (
                f"it is cut in other work coordinates ({system or 'G54'}) than the first cutting move "
                f"({first_system or 'G54'}), which are those of the stock"
            )
        if shift != first_shift:
            what = f"the zero point has been moved ({shift})" if shift else f"the shift of {first_shift} has ended"
            return f"{what} since the first cutting move, whose coordinates are those of the stock"
        return ""
