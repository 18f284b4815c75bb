"""Rapids of a program text: which of them can become a shaped cutting move, and why the others cannot."""

from __future__ import annotations

import math
import re
from collections import deque
from dataclasses import dataclass

import numpy as np

from shapegcode import _core
from shapegcode.conversion.whole_text import why_off_grid
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.program import MM_PER_INCH, Program

MOVE = _core.StepKind.move

CANNED_CYCLE = "drilling cycle"
COMPENSATION = "cutter compensation"
OTHER_WORDS = "other words in its block"
NEW_STATE = "other codes in its block change the modal state"
UNKNOWN_START = "start position not known"
NO_CUT = "no cut follows"
OFF_GRID = "its end lies between two increments, and the program changes between G20 and G21"
BLOCK_SKIP = "the modal state depends on the block-skip switch"

# Nothing behind these needs a table at rest: the operator or the tool changer comes first.
_ENDING_CODES = {0, 1, 2, 6, 30}
_BLOCK = re.compile(r"(?:[A-Z][+-]?[0-9]*\.?[0-9]*)+")
_WORD = re.compile(r"([A-Z])([+-]?[0-9]*\.?[0-9]*)")
_COMMENT = re.compile(r"\([^)]*\)")
_G_CODES = {0, 17, 18, 19, 20, 21, 40, 54, 55, 56, 57, 58, 59, 61, 64, 80, 90, 91, 94, 98, 99}
_UNCHANGED = (
    "plane", "distance", "feed_mode", "units", "compensation", "length_offset", "length_number", "cycle",
    "cycle_return", "coordinate_system", "coordinate_number", "exact_stop", "feed",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Rapid:
    """One rapid of a text."""

    line: int  # in the text, from 1
    start_mm: FloatArray  # where it starts, (3,), as far as it is known
    end_mm: FloatArray  # where it ends, (3,)
    region: _core.Region | None  # the move as something that can be written; None: it must stay
    reason: str  # why it must stay
    head: str  # its N word and its comments, empty if it has none

    @property
    def travel_mm(self) -> FloatArray:
        """Signed travel of each axis, (3,)."""
        return np.asarray(self.end_mm - self.start_mm)


@dataclass(frozen=True)
class Gap:
    """What happens between two cuts, in order."""

    steps: tuple[Rapid | float, ...]  # rapids, and the seconds that anything else lasts
    cut_follows: bool  # a cut follows, so the vibration must have settled at its end

    @property
    def rapids(self) -> list[Rapid]:
        """Its rapids in order."""
        return [step for step in self.steps if isinstance(step, Rapid)]


def find_gaps(program: Program, machine: Machine) -> list[Gap]:
    """Rapids of an emitted text, gathered between its cuts."""
    core = program.core
    moves = core.other_moves
    functions = core.functions
    numbers, counts = np.unique([line for kind, _, line in core.steps if kind == MOVE], return_counts=True)
    shared = set(numbers[counts > 1].tolist())
    reader = _Reader(program, machine, shared)
    gaps: list[Gap] = []
    steps: list[Rapid | float] = []

    def end(cut_follows: bool) -> None:
        if any(isinstance(step, Rapid) for step in steps):
            gaps.append(Gap(tuple(steps), cut_follows))
        steps.clear()

    unmeasured = deque(reader.unmeasured)
    for kind, index, line in core.steps:
        while unmeasured and unmeasured[0].line <= line:
            steps.append(unmeasured.popleft())
        if kind == _core.StepKind.function:
            codes = functions[index][0]
            if _ENDING_CODES.intersection(codes):
                end(cut_follows=False)
            steps.append(len(codes) * machine.times.m_function_s)
        elif kind == _core.StepKind.region:
            end(cut_follows=True)
        else:
            segment, dwell_s = moves[index]
            if dwell_s > 0.0:
                steps.append(dwell_s)
            elif segment.kind != _core.SegmentKind.rapid:
                end(cut_follows=True)
            elif (rapid := reader.rapid(segment, line)) is not None:
                steps.append(rapid)
    steps.extend(unmeasured)
    end(cut_follows=False)
    return gaps


class _Reader:
    """Looks at the blocks of a text that hold rapids."""

    def __init__(self, program: Program, machine: Machine, shared: set[int]) -> None:
        self._core = core = program.core
        self._program, self._machine = program, machine
        self._shared = shared  # lines that make several moves
        moves = core.other_moves
        texts = core.text.split(b"\n")
        self._begins = [0]
        for text in texts:
            self._begins.append(self._begins[-1] + len(text) + 1)
        rapids = {
            line
            for kind, index, line in core.steps
            if kind == MOVE and moves[index][1] <= 0.0 and moves[index][0].kind == _core.SegmentKind.rapid
        }
        # The reader gives no move where it does not know the path.
        taken = {line for kind, _, line in core.steps if kind == MOVE}
        for region in core.regions:
            taken.update(range(region.first_line, region.last_line + 1))
        silent = [n for n, text in enumerate(texts, start=1) if n not in taken and _may_be_rapid(text)]
        lines = rapids.union(silent)
        probes = sorted(lines | {line - 1 for line in lines})
        probed = Program.from_text(core.text, machine, source=program.source, emitted=True, probe_lines=probes)
        self._states = dict(zip(probes, probed.core.probed, strict=True))
        self._largest_mm_per_s = np.array([axis.max_feed_mm_per_min / 60.0 for axis in machine.axes.as_tuple()])
        self.unmeasured = [rapid for line in silent if (rapid := self._unmeasured(line)) is not None]

    def rapid(self, segment: _core.Segment, line: int) -> Rapid | None:
        """The rapid of a line; None if it does not move."""
        if segment.length_mm <= 0.0:
            return None
        start_mm, end_mm = np.array(segment.start_mm), np.array(segment.end_mm)
        reason = self._why_kept(line)
        if reason:
            return Rapid(line, start_mm, end_mm, None, reason, "")
        source = self._source(line)
        begin, end = self._begins[line - 1], min(self._begins[line], self._core.size)
        entry, after = self._states[line - 1], self._states[line]
        feed = self._feed_mm_per_s(end_mm - start_mm, entry.units)
        path = _core.Path([_core.Segment.line(start_mm, end_mm, feed)])
        region = _core.Region(path=path, entry=entry, exit=after, line=line, text_begin=begin, text_end=end)
        if why_off_grid(self._program, region, self._machine):
            return Rapid(line, start_mm, end_mm, None, OFF_GRID, "")
        number = next((f"N{value}" for letter, value in _words(source) or () if letter == "N"), "")
        return Rapid(line, start_mm, end_mm, region, "", number + "".join(_COMMENT.findall(source)))

    def _unmeasured(self, line: int) -> Rapid | None:
        """A rapid whose travel is not known: it counts, but takes no time."""
        after = self._states[line]
        if after.motion != 0 or after.cycle != 80 or self._start_known(line):
            return None
        where = np.array(after.position_mm)
        return Rapid(line, where, where, None, self._why_kept(line), "")

    def _source(self, line: int) -> str:
        return self._core.slice(self._begins[line - 1], min(self._begins[line], self._core.size)).decode("latin-1")

    def _start_known(self, line: int) -> bool:
        block = _COMMENT.sub("", self._source(line)).upper()
        known = self._states[line - 1].known
        return all(is_known for letter, is_known in zip("XYZ", known, strict=True) if letter in block)

    def _why_kept(self, line: int) -> str:
        entry, after = self._states[line - 1], self._states[line]
        if entry.cycle != 80 or after.cycle != 80:
            return CANNED_CYCLE
        if entry.compensation != 40:
            return COMPENSATION
        if entry.uncertain:
            return BLOCK_SKIP
        if line in self._shared or _words(self._source(line)) is None:
            return OTHER_WORDS
        if not self._start_known(line):
            return UNKNOWN_START
        if after.motion != 0 or any(getattr(entry, name) != getattr(after, name) for name in _UNCHANGED):
            return NEW_STATE
        return ""

    def _feed_mm_per_s(self, travel_mm: FloatArray, units: int) -> float:
        """Largest cutting feed along a travel, a whole F word: of each axis for itself, of the fastest tangentially."""
        share = np.abs(travel_mm) / np.linalg.norm(travel_mm)
        moved = share > 0.0
        along = float((self._largest_mm_per_s[moved] / share[moved]).min())
        unit = (MM_PER_INCH if units == 20 else 1.0) / 60.0
        return max(1.0, math.floor(min(along, float(self._largest_mm_per_s.max())) / unit + 1e-9)) * unit


def _words(source: str) -> list[tuple[str, str]] | None:
    """Words of a block that holds nothing but a number, axis words and codes that a rapid may carry; else None."""
    block = _COMMENT.sub("", source).upper()
    block = "".join(block.split())
    if not _BLOCK.fullmatch(block):
        return None
    words = _WORD.findall(block)
    letters = [letter for letter, _ in words if letter != "G"]
    plain = len(set(letters)) == len(letters) and set(letters) <= set("NXYZ") and all(value for _, value in words)
    codes = {float(value) for letter, value in words if letter == "G" and value}
    return words if plain and codes <= _G_CODES else None


def _may_be_rapid(text: bytes) -> bool:
    """Whether a block has axis words and no code that gives them another meaning than travel."""
    block = _COMMENT.sub("", text.decode("latin-1")).upper()
    if not any(letter in block for letter in "XYZ"):
        return False
    codes = {value for letter, value in _WORD.findall("".join(block.split())) if letter == "G"}
    return {float(value) for value in codes if value} <= _G_CODES | {41, 42, 43, 44, 49}
