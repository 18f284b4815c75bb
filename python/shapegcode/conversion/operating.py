"""Requirements of an emitted program for control and operator: memory, serial line, override, restart, first run."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shapegcode import _core
from shapegcode.conversion.restart import RestartPoint
from shapegcode.conversion.whole_text import Written
from shapegcode.conversion.write import TransferLoad
from shapegcode.machine import Machine
from shapegcode.machine.dialects import dialect_of
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import slowest_excited_hz
from shapegcode.program import Program
from shapegcode.program.stamp import FEED_HOLD, FIRST_RUN, OVERRIDES, RESTART, SINGLE_BLOCK, no_room
from shapegcode.results.table import Column, Table
from shapegcode.verdict.figures import Placed, ProgramFigures

_SHOWN_POINTS = 12
_SINGLE_BLOCKS = 200  # number of the fastest blocks that are simulated
_PRESSES_PER_S = 2.0
_FAST_RATIO, _FAST_BLOCKS = 0.5, 4000  # of fast blocks: least ratio to the highest feed; largest number
_BEGIN = re.compile(rb"(?:\s*\([^\n]*\n)*\s*(N\d+)?")  # comment lines, and the N word of the line after them
_TAPE_CHARACTERS_PER_M = 1000.0 / 2.54  # a row of holes every tenth of an inch


@dataclass(frozen=True)
class ControlNote:
    """A caution for the operator."""

    topic: str  # short heading
    text: str  # with its figures


def at_the_control(
    program: Program,
    emitted: Program,
    written: Written,
    figures: ProgramFigures,
    model: MachineModel,
    block_period_s: float,
) -> tuple[ControlNote, ...]:
    """Cautions for the operator of an emitted program; *program* is the original."""
    placed, loads = written.placed, written.loads
    if not placed:
        return ()
    machine = model.machine
    override = OVERRIDES[machine.emission.override]
    turned = [case for case in figures.cases if case.override != 1.0 and case.mode is None]
    elsewhere = []
    if turned and machine.emission.override != "lock":
        worst = max(turned, key=lambda each: math.inf if each.share_of_limit is None else each.share_of_limit)
        elsewhere = [
            f"at {worst.override * 100:.0f} % the {worst.figure} is {worst.value_um:.1f} µm, limit "
            f"{worst.limit_um:.1f} µm"
        ]
    size, room = emitted.size, machine.controller.program_memory_bytes
    fits = "in this control's memory: " + ("fits" if size <= room else f"does not fit: {no_room(room)}")
    return (
        ControlNote("memory", f"{size} bytes ({size / _TAPE_CHARACTERS_PER_M:.0f} m of tape); {room} bytes {fits}"),
        ControlNote("drip feed (DNC)", _line(loads, machine)),
        ControlNote("look-ahead", _look_ahead(loads, machine, block_period_s)),
        ControlNote(override.topic, "; ".join([override.sentence, *elsewhere])),
        ControlNote(FEED_HOLD.topic, FEED_HOLD.sentence),
        ControlNote(SINGLE_BLOCK.topic, f"{SINGLE_BLOCK.sentence}; {_single_block(emitted, placed, figures, model)}"),
        ControlNote(RESTART.topic, "; ".join([RESTART.sentence, *_restarts(program, written, machine)])),
        ControlNote(FIRST_RUN.topic, FIRST_RUN.sentence),
    )


def control_table(notes: Sequence[ControlNote]) -> Table:
    """The notes as a table."""
    columns = (
        Column("at the control", value="topic", text=True),
        Column("caution, before you run", value="text", text=True),
    )
    return Table("", columns, notes)


def restart_table(points: Sequence[RestartPoint]) -> Table:
    """Restart points inside of cuts, with the modal state required before the start."""
    columns = (
        Column("restart", value=lambda point: f"N{point.number}", left=True, priority=0),
        Column("line", value="line", priority=0),
        Column("original lines", value=lambda point: "{} to {}".format(*point.lines), left=True, priority=2),
        Column("T", value="tool"),
        Column("H", value="length_offset"),
        Column("system", value="coordinate_system", left=True),
        Column("S", value="spindle_rev_per_min", digits=0),
        Column("X", "mm", lambda point: point.position_mm[0], 3),
        Column("Y", "mm", lambda point: point.position_mm[1], 3),
        Column("Z", "mm", lambda point: point.position_mm[2], 3),
        Column("vibration", "µm", "vibration_um", 1, priority=3),
    )
    more = len(points) - _SHOWN_POINTS
    caption = f"and {more} more: restart_points of --json" if more > 0 else ""
    return Table("restart points inside of cuts", columns, points[:_SHOWN_POINTS], caption)


def _line(loads: Mapping[int, TransferLoad], machine: Machine) -> str:
    baud = max((load.baud for load in loads.values()), default=0.0)
    line = machine.controller.dnc_baud
    here = ""
    if line > 0:
        enough = "enough" if baud <= line else "buffer underrun (--baud fits the program to the line)"
        here = f", the line of this machine has {line}: {enough}"
    return f"needs {baud:.0f} baud, in the busiest part of the program{here}"


def _look_ahead(loads: Mapping[int, TransferLoad], machine: Machine, block_period_s: float) -> str:
    rate = max((load.blocks_per_second for load in loads.values()), default=0.0)
    needs = f"the control must read up to {rate:.0f} blocks/s, one every {block_period_s * 1e3:g} ms"
    prologue = " ".join(machine.emission.prologue)
    if (own := dialect_of(machine.emission.dialect)) is not None:
        before = f"; {prologue} before each shaped cut" if prologue else ""
        return f"{needs}{before}; {own.control}: {own.facts['look-ahead'].text}"
    if machine.emission.leaves_look_ahead:
        on = " ".join(machine.emission.epilogue)
        again = f", {on} after the cut switches it on again" if on else ""
        return f"{needs}; {prologue} before each shaped cut switches the look-ahead mode off{again}"
    if prologue:
        return f"{needs}; {prologue} before each shaped cut must select the control's mode for shaped cuts"
    return f"{needs}; contour control with look-ahead (G05.1Q1, G08P1) must be off: the program does not switch it off"


def _single_block(emitted: Program, placed: Sequence[Placed], figures: ProgramFigures, model: MachineModel) -> str:
    """Effect of single block on the cut whose original vibrates most; a few shaped blocks run from rest to rest."""
    index = max(range(len(placed)), key=lambda each: max(figures.regions[each].residual_vibration_um.original))
    place, region = placed[index], figures.regions[index]
    blocks = place.blocks(emitted)
    feeds = blocks.segment_feeds_mm_per_s
    if len(feeds) == 0:
        return "the shaped cuts are shorter than an increment"
    fast = np.flatnonzero(feeds >= _FAST_RATIO * feeds.max())
    fast = fast[:: math.ceil(len(fast) / _FAST_BLOCKS)]
    slowest = np.array(slowest_excited_hz(model.machine))
    # Speed step that each block applies to the modes; the axis with the lowest frequency has the largest weight.
    chords = np.array([blocks[int(one)].end_mm - blocks[int(one)].start_mm for one in fast])
    steps = chords / np.maximum(np.linalg.norm(chords, axis=1), 1e-9)[:, None] * feeds[fast, None]
    fastest = fast[np.argsort(-np.linalg.norm(steps / slowest, axis=1), kind="stable")[:_SINGLE_BLOCKS]]
    offset = model.offset(place.region)
    mark_um = 0.0
    for one in sorted(int(each) for each in fastest):
        block = _core.Path([blocks[one]])
        simulated = model.simulate_emitted(block, block, contour=False, offset=offset)
        mark_um = max(mark_um, float(np.max([simulated.peak_mm, simulated.residual_mm])) * 1e3)
    time_s = region.time_s.emitted + len(blocks) * (1.0 / _PRESSES_PER_S + model.shaped_filter.duration_s)
    lines = "{} to {}".format(*region.emitted_lines)
    marks = f" and leave marks of up to {mark_um:.0f} µm" if mark_um >= 1.0 else ""
    return (
        f"in single block, emitted lines {lines} would take {_duration(time_s)} instead of "
        f"{_duration(region.time_s.emitted)} ({len(blocks)} stops, two presses of cycle start a second){marks}"
    )


def _duration(time_s: float) -> str:
    for unit, seconds in (("h", 3600.0), ("min", 60.0)):
        if time_s >= 1.5 * seconds:
            return f"{time_s / seconds:.1f} {unit}" if time_s < 9.5 * seconds else f"{time_s / seconds:.0f} {unit}"
    return f"{time_s:.1f} s" if time_s < 10.0 else f"{time_s:.0f} s"


def _restarts(program: Program, written: Written, machine: Machine) -> Iterator[str]:
    emission, placed, restarts = machine.emission, written.placed, written.restarts
    if (own := dialect_of(emission.dialect)) is not None:
        yield f"{own.control}: {own.facts['restart'].text}"
    else:
        yield _restart_lines(written)
    count = sum(len(each.marks) for each in restarts)
    if count:
        before = (*emission.prologue, *emission.around_cuts["LOCK"])
        shakes_um = max(mark.vibration_um for each in restarts for mark in each.marks)
        switched = f", enter {' '.join(before)} by MDI" if before else ""
        yield (
            f"{count} restart point{'' if count == 1 else 's'} inside long cuts, where the command is slow "
            "(table of restart points); to start at one: load its tool, activate its H and coordinate system, "
            f"switch the spindle on{switched}, move to its position from above, then search its N number; such a start "
            f"makes the machine vibrate once, by up to {shakes_um:.1f} µm"
        )
    if stops := sum(each.stops for each in restarts):
        cost_s = sum(each.stops_s for each in restarts)
        yield (
            f"{stops} of these points {'is a stop that was' if stops == 1 else 'are stops that were'} added "
            f"(emission.restart_stops): {cost_s:.1f} s more, and a dwell mark where the tool stops in the cut"
        )
    long = [
        (program.source_lines(*place.original_lines), each)
        for place, each in zip(placed, restarts, strict=True)
        if each.longest_s > emission.restart_interval_s
    ]
    for (first, last), each in sorted(long, key=lambda pair: -pair[1].longest_s)[:1]:
        more = f" (longest gap; {len(long) - 1} more)" if len(long) > 1 else ""
        why = each.reason or "the command is not slow enough there"
        remedy = "" if each.reason or emission.restart_stops else "; emission.restart_stops = true adds a stop"
        yield (
            f"no restart point for {_duration(each.longest_s)} in original lines {first} to {last}{more}: {why}{remedy}"
        )


def _restart_lines(written: Written) -> str:
    placed, named = written.placed, []
    for place, (text, _) in zip(placed[:4], written.texts, strict=False):
        # After the comments: lines that lock the override or switch a mode belong to the cut.
        begin = _BEGIN.match(text.parts()[0])
        assert begin is not None
        line = place.first_line + begin[0].count(b"\n")
        named.append(f"{begin[1].decode()} (line {line})" if begin[1] else f"line {line}")
    more = f" and {len(placed) - len(named)} more" if len(placed) > len(named) else ""
    return f"cuts begin at {', '.join(named)}{more}"
