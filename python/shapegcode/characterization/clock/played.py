"""A program as the clock sees it: which of its lines cut, move in rapid, or hold machine functions."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.program import Program

__all__ = ["PlayedProgram", "played_program"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_SEQUENCE = re.compile(r"[ /]*[Nn](\d{1,7})")
_LEAST_ARC_MM = 0.5
_GENTLE_MM_PER_S2 = 100.0  # across the path: no machining centre slows down for it


@dataclass(frozen=True, eq=False)
class PlayedProgram:
    """A program as the clock sees it.

    Attributes:
        program: what was read.
        line_count: of the text that the control runs.
        feed_mm_per_s: (line_count + 2,) programmed feed of a line's last cut, by its number; NaN where it does not cut.
        arc_radius_mm: (line_count + 2,) radius of a line's arc, where it turns by more than a sixth of a circle and is
            long enough to be run steadily; infinity elsewhere.
        free: (line_count + 2,) whether no machine has to go slower there for the sake of an arc.
        rapid: (line_count + 2,) whether it moves in rapid.
        function: (line_count + 2,) whether it holds M, S or T words, or a way that is not known.
        sections: (first line, last line) of the stretches without functions.
    """

    program: Program
    line_count: int
    feed_mm_per_s: FloatArray
    arc_radius_mm: FloatArray
    free: npt.NDArray[np.bool_]
    rapid: npt.NDArray[np.bool_]
    function: npt.NDArray[np.bool_]
    sections: tuple[tuple[int, int], ...]

    def starts(self, model: _core.ControllerModel) -> FloatArray:
        """When the lines begin on a model."""
        timed = _core.time_program(self.program.core, model, True)
        found = np.full(self.line_count + 2, np.nan)
        # A line may hold several moves: its first one counts.
        found[timed.blocks["line"][::-1]] = timed.blocks["start_s"][::-1]
        found[-1] = timed.total_s
        return found

    @cached_property
    def text_lines(self) -> list[str]:
        """The lines of the text that the control runs."""
        return self.program.core.text.decode("latin-1").splitlines()

    @cached_property
    def sequence_lines(self) -> dict[int, list[int]]:
        """Lines by their N number, ascending."""
        places: dict[int, list[int]] = defaultdict(list)
        for line, text in enumerate(self.text_lines, start=1):
            if number := _SEQUENCE.match(text):
                places[int(number[1])].append(line)
        return places

    @cached_property
    def tools(self) -> IntArray:
        """(line_count + 2,) Tool in use at a line, -1: not known."""
        tool = np.full(self.line_count + 2, -1, dtype=np.int64)
        selected, functions = -1, self.program.core.functions
        for kind, index, line in self.program.core.steps:
            if kind == _core.StepKind.function:
                codes, asked, _ = functions[index]
                selected = asked if asked >= 0 else selected
                if 6 in codes:
                    tool[line:] = selected
        return tool


def played_program(program: Program) -> PlayedProgram:
    """What the clock needs of a program."""
    core = program.core
    count = core.line_count
    feed = np.full(count + 2, np.nan)
    radius = np.full(count + 2, np.inf)
    free = np.zeros(count + 2, dtype=bool)
    rapid = np.zeros(count + 2, dtype=bool)
    function = np.zeros(count + 2, dtype=bool)
    for region in program.regions:
        for index in range(len(region.path)):
            segment = region.path[index]
            feed[segment.line_number] = segment.feed_mm_per_s
            if segment.length_mm > max(_LEAST_ARC_MM, _radius_mm(segment)):
                radius[segment.line_number] = _radius_mm(segment)
            free[segment.line_number] = segment.feed_mm_per_s**2 < _GENTLE_MM_PER_S2 * _radius_mm(segment)
    for segment, dwell_s in core.other_moves:
        if segment.kind == _core.SegmentKind.rapid:
            rapid[segment.line_number] = True
        elif dwell_s <= 0.0:
            feed[segment.line_number] = segment.feed_mm_per_s
            free[segment.line_number] = True
    for kind, _, line in core.steps:
        if kind == _core.StepKind.function:
            function[line] = True
    return PlayedProgram(program, count, feed, radius, free, rapid, function, tuple(_sections(function, count)))


def _radius_mm(segment: _core.Segment) -> float:
    if segment.kind != _core.SegmentKind.arc:
        return math.inf
    return float(np.linalg.norm(np.asarray(segment.start_mm) - np.asarray(segment.centre_mm)))


def _sections(function: npt.NDArray[np.bool_], count: int) -> list[tuple[int, int]]:
    found: list[tuple[int, int]] = []
    first = 1
    for line in range(1, count + 2):
        if line > count or function[line]:
            if line - first > 1:
                found.append((first, line - 1))
            first = line + 1
    return found
