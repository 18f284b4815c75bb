"""Sequences of cutting blocks of a program: duration of each block at its feed, and the stops between them.

All lines are those of `Program.core.text`; `Program.place` gives the source.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.model.machine_model import fanuc_model
from shapegcode.model.stream import cuts_of_lines
from shapegcode.program import Program

_CUTTING, _RAPID, _DWELL = (getattr(_core.BlockKind, name).value for name in ("cutting", "rapid", "dwell"))
# The time model rounds the end of a run up to a period, which has a minimum. The program is therefore timed at a
# tiny feed override: relative to the times at full feed, the period is then a nanosecond.
_PERIOD_S = 1e-5
_SLOW_MOTION = 1e-4
_RESOLUTION_S = _PERIOD_S * _SLOW_MOTION
_NO_LIMIT = 1e12
_ROUNDING = 1e-6
_PERIOD_SLACK = 1e-5

# Effects of a stop between two cutting moves, worst first.
_STOPS = "the control stops reading ahead, and the tool stops in the cut"
_CANCELS = "it cancels the look-ahead mode for its block, and the tool stops in the cut"
_ASKED = "the tool stops in the cut, as programmed"
_STOPS_READING = "the control reads ahead only up to here"
_MAY_CANCEL = "in a look-ahead mode the tool would stop in the cut"
_EFFECTS = (_STOPS, _CANCELS, _ASKED, _STOPS_READING, _MAY_CANCEL)
_CODED = re.compile(rb"[Gg] *0*(53|9|61)(?![\d.])")
_COMMENT = re.compile(rb"\([^()\r\n]*\)?")


@dataclass(frozen=True)
class CuttingRun:
    """A sequence of cutting blocks."""

    first_line: int  # line of the first block
    last_line: int  # line of the last one
    bytes: int  # bytes of these lines, line ends included
    # required characters per second: for shaped blocks in the busiest window of the shaper duration, for all
    # others on average
    needed_per_s: float
    blocks: int  # number of moving blocks
    time_s: float  # time at their feed, with axis limits, without acceleration
    taken_s: float  # the same with at least the block time for each
    short_blocks: int  # number of blocks shorter than the block time
    shortest_s: float  # shortest block
    first_short_line: int  # line of the first short block, 0: none


@dataclass(frozen=True)
class ClampedFeed:
    """A programmed feed beyond the axis limits, with the blocks that the limits slow down."""

    feed_mm_per_min: float  # as programmed
    first_line: int  # line of its first slowed block
    blocks: int  # number of slowed blocks
    min_mm_per_min: float  # feed along the path in the slowest of them


@dataclass(frozen=True)
class BlockTable:
    """The blocks of a program."""

    runs: tuple[CuttingRun, ...]  # its cutting runs in order
    cutting_lines: npt.NDArray[np.int64]  # ascending line of every cutting block
    rapid_lines: npt.NDArray[np.int64]  # ascending line of every rapid
    dwell_lines: npt.NDArray[np.int64]  # ascending line of every dwell
    first_short_lines: tuple[int, ...]  # lines of the first short blocks
    clamped_feeds: tuple[ClampedFeed, ...]  # by feed, ascending


@dataclass(frozen=True)
class Breaker:
    """A word that stops the look-ahead between two cutting moves."""

    line: int  # its line
    message: str  # the text
    unasked: bool  # the program does not request a stop there


def block_table(program: Program, machine: Machine) -> BlockTable:
    """Time every cutting block at its feed, except those that move rotary axes only."""
    limited = _timed(program, machine, with_limits=True)
    # A move of rotary axes only has no length here, and so no comparable time.
    cutting = np.flatnonzero((limited["kind"] == _CUTTING) & (limited["duration_s"] > 0.0))
    lines_of = {kind: limited["line"][limited["kind"] == kind].astype(np.int64) for kind in (_RAPID, _DWELL)}
    if cutting.size == 0:
        return BlockTable((), np.empty(0, np.int64), lines_of[_RAPID], lines_of[_DWELL], (), ())
    free = _timed(program, machine, with_limits=False)[cutting]
    rows = limited[cutting]
    lines = rows["line"].astype(np.int64)
    # A run starts with a region, and where something lies between two cutting moves.
    # Several moves of one line (a corner word) are one block.
    run_starts: npt.NDArray[np.bool_] = np.diff(cuts_of_lines(program.regions, lines), prepend=-2) != 0
    run_starts |= np.diff(cutting, prepend=-2) != 1
    block_starts = np.flatnonzero(run_starts | (np.diff(lines, prepend=-1) != 0))
    run_of_block = np.cumsum(run_starts)[block_starts] - 1
    limited_s = np.add.reduceat(rows["duration_s"], block_starts) * _SLOW_MOTION
    programmed = np.add.reduceat(free["duration_s"], block_starts) * _SLOW_MOTION
    feed = free["feed_mm_per_s"][block_starts] * (60.0 / _SLOW_MOTION)
    line = lines[block_starts]

    # The control executes a shaped block in whole periods: its F is rounded up, so that it ends just within the last.
    period_s = machine.controller.interpolation_period_s
    whole = np.ceil(limited_s / period_s - _PERIOD_SLACK) * period_s
    shaped = cuts_of_lines([region for region in program.regions if region.shaped], line) >= 0
    duration = np.where(shaped, whole, limited_s)
    stretch_s = np.where(shaped, _shaper_s(program, machine), np.inf)

    block_time = machine.controller.block_time_s
    short = duration < block_time * (1.0 - _ROUNDING)
    ratio = programmed / np.maximum(limited_s, _RESOLUTION_S)
    slowed = (ratio < 1.0 - _ROUNDING) & (limited_s - programmed > 2.0 * _RESOLUTION_S)
    clamped = tuple(_clamped_feeds(line[slowed], feed[slowed], ratio[slowed]))
    line_bytes = _line_offsets(program)
    bounds = np.append(np.flatnonzero(np.diff(run_of_block, prepend=-1)), line.size).tolist()
    short_at, runs = np.flatnonzero(short), []
    taken = np.maximum(duration, block_time)
    for begin, end in itertools.pairwise(bounds):
        first, last = int(line[begin]), int(line[end - 1])
        first_short = int(np.searchsorted(short_at, begin))
        shorts = int(np.searchsorted(short_at, end)) - first_short
        own_s = duration[begin:end]
        # Characters between two blocks belong to the following block.
        amounts = np.diff(line_bytes[line[begin:end]], prepend=line_bytes[first - 1])
        runs.append(
            CuttingRun(
                first, last, int(line_bytes[last] - line_bytes[first - 1]),
                _core.busiest_per_s(own_s, amounts, stretch_s[begin]), end - begin, float(own_s.sum()),
                float(taken[begin:end].sum()), shorts, float(own_s.min()),
                int(line[short_at[first_short]]) if shorts else 0,
            )
        )  # fmt: skip
    firsts = tuple(line[short_at[:20]].tolist())
    return BlockTable(tuple(runs), lines, lines_of[_RAPID], lines_of[_DWELL], firsts, clamped)


def _shaper_s(program: Program, machine: Machine) -> float:
    """Time over which the character rate is averaged, s: the header's shaper duration, at least the block time."""
    min_s = machine.controller.block_time_s
    try:
        return max(float(program.stamp.shaper_ms) * 1e-3, min_s) if program.stamp else min_s
    except ValueError:
        return min_s


def _clamped_feeds(line: npt.NDArray[np.int64], feed: FloatArray, ratio: FloatArray) -> Iterator[ClampedFeed]:
    feeds, group = np.unique(feed.round(3), return_inverse=True)
    least = np.full(feeds.size, np.inf)
    np.minimum.at(least, group, ratio)
    first = np.full(feeds.size, np.iinfo(np.int64).max)
    np.minimum.at(first, group, line)
    columns = feeds, first, np.bincount(group), feeds * least
    yield from (ClampedFeed(*row) for row in zip(*(column.tolist() for column in columns), strict=True))


def _timed(program: Program, machine: Machine, *, with_limits: bool) -> npt.NDArray[Any]:
    """Time each move (length over feed, no acceleration), dwell and function at a very low override, one row each."""
    model = fanuc_model(machine, feed_override=_SLOW_MOTION, shaped=False)
    model.planner = _core.PlannerRules()
    model.motion = _core.MotionKind.after_interpolation
    model.filter_shape = _core.FilterShape.linear
    model.block_end = _core.BlockEnd.carry
    model.period_s = _PERIOD_S
    model.time_constant_s = model.bell_time_s = 0.0
    model.in_position = _core.InPosition.measured
    model.in_position_s = (0.0, 0.0, 0.0)
    limits = model.limits
    limits.max_feed_mm_per_s = limits.max_feed_mm_per_s * _SLOW_MOTION if with_limits else np.full(3, _NO_LIMIT)
    model.limits = limits
    return _core.time_program(program.core, model, per_block=True).blocks


def _line_offsets(program: Program) -> npt.NDArray[np.int64]:
    """Byte offset of the end of each line, starting with 0."""
    text = np.frombuffer(program.core.text, dtype=np.uint8)
    ends = np.flatnonzero(text == ord(program.core.line_end[-1])) + 1
    padding = [text.size] * max(0, program.core.line_count + 2 - ends.size)
    return np.concatenate(([0], ends, padding)).astype(np.int64)


def look_ahead_breakers(program: Program, machine: Machine, table: BlockTable) -> Iterator[Breaker]:
    """Yield words that may stop the look-ahead, once for each two cutting moves without a rapid between them."""
    gaps: dict[int, list[tuple[int, str, str]]] = {}
    cutting = table.cutting_lines

    def note(line: int, words: str, effect: str, *, behind: bool = False) -> None:
        # A word in a cutting block belongs to the junction before it, an exact stop to the one after it.
        after = int(np.searchsorted(cutting, line, side="right" if behind else "left"))
        if not 0 < after < cutting.size:
            return
        between = np.searchsorted(table.rapid_lines, (cutting[after - 1], cutting[after] + 1), side="left")
        if between[0] == between[1]:
            gaps.setdefault(after, []).append((line, words, effect))

    regions = program.regions
    for region in regions:
        if region.exact_stop_at_end:
            note(region.last_line, "exact stop", _ASKED, behind=True)
    for line, code in _coded_lines(program):
        at = int(np.searchsorted(cutting, line))
        if code == "53":
            note(line, "G53", _STOPS_READING)
        elif at < cutting.size and int(cutting[at]) == line:
            note(line, "exact stop", _ASKED, behind=True)
    for line in table.dwell_lines.tolist():
        note(line, "G04", _ASKED)
    firsts = np.array([region.first_line for region in regions], dtype=np.int64)
    functions = program.core.functions
    for kind, index, line in program.core.steps:
        if kind == _core.StepKind.function:
            following = int(np.searchsorted(firsts, line))
            mode = following < len(regions) and regions[following].look_ahead_mode
            note(line, *_words(functions[index], machine, look_ahead_mode=mode))
    for entries in gaps.values():
        words = ", ".join(dict.fromkeys(word for _, word, _ in entries))
        effect = min((effect for _, _, effect in entries), key=_EFFECTS.index)
        sentence = f"{words} between two cutting moves: {effect}"
        yield Breaker(min(line for line, _, _ in entries), sentence, effect in (_STOPS, _CANCELS))


def _coded_lines(program: Program) -> Iterator[tuple[int, str]]:
    """Lines with G53, G09 or G61, and the code."""
    text = program.core.text
    if _CODED.search(text) is None:
        return
    if b"(" in text:
        text = _COMMENT.sub(lambda comment: b" " * len(comment[0]), text)
    offsets = _line_offsets(program)
    for match in _CODED.finditer(text):
        yield int(np.searchsorted(offsets, match.start(), side="right")), match[1].decode()


def _words(function: tuple[list[int], int, float], machine: Machine, *, look_ahead_mode: bool) -> tuple[str, str]:
    """The words of a block, and their effect on the look-ahead of this machine."""
    m_codes, tool, spindle = function
    words = [f"M{code:02d}" for code in m_codes]
    words += [f"S{spindle:g}"] if spindle >= 0 else []
    words += [f"T{tool}"] if tool >= 0 else []
    if any(code in machine.controller.no_buffer_m_codes for code in m_codes):
        effect = _STOPS
    elif any(code in (0, 1) for code in m_codes):
        effect = _ASKED
    else:
        effect = _CANCELS if look_ahead_mode else _MAY_CANCEL
    return " ".join(words), effect
