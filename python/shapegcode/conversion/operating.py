"""What an emitted program asks of the control and of its operator: memory, line, override, restart, first run."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

from shapegcode.conversion.budget import TransferLoad
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.program.operating import FEED_HOLD, FIRST_RUN, OVERRIDES, RESTART, SINGLE_BLOCK, no_room
from shapegcode.results.table import Column, Table
from shapegcode.verdict.figures import PlayedFigures
from shapegcode.verdict.placed import Placed

__all__ = ["ControlNote", "at_the_control", "control_table"]

_NAMED_LINES = 4
_CHUNK = 1 << 16  # bytes
_TAPE_CHARACTERS_PER_M = 1000.0 / 2.54  # a row of holes every tenth of an inch


@dataclass(frozen=True)
class ControlNote:
    """One thing to know at the control.

    Attributes:
        topic: in a word or two.
        text: in words, with its figures.
    """

    topic: str
    text: str


def at_the_control(
    emitted: Program,
    placed: Sequence[Placed],
    loads: Mapping[int, TransferLoad],
    figures: PlayedFigures,
    machine: Machine,
    block_period_s: float,
) -> tuple[ControlNote, ...]:
    """What to heed with an emitted program.

    Args:
        emitted: the program.
        placed: its shaped regions; none: nothing to heed.
        loads: what regions ask of line and control.
        figures: as played.
        machine: that shall run it.
        block_period_s: of the shaped blocks.

    Returns:
        The notes, in the order in which one meets them.
    """
    if not placed:
        return ()
    override = OVERRIDES[machine.emission.override]
    elsewhere = [] if machine.emission.override == "lock" else _at_other_overrides(figures)
    return (
        ControlNote("memory", _memory(emitted.size, machine)),
        ControlNote("drip feed (DNC)", _line(loads, machine)),
        ControlNote("look-ahead", _look_ahead(loads, machine, block_period_s)),
        ControlNote(override.topic, "; ".join([override.sentence, *elsewhere])),
        *(ControlNote(habit.topic, habit.sentence) for habit in (FEED_HOLD, SINGLE_BLOCK)),
        ControlNote(RESTART.topic, f"{RESTART.sentence}; {_restart_lines(emitted, placed)}"),
        ControlNote(FIRST_RUN.topic, FIRST_RUN.sentence),
    )


def control_table(notes: Sequence[ControlNote]) -> Table:
    """The notes as a table.

    Args:
        notes: what to heed.

    Returns:
        One row for each.
    """
    columns = (Column("at the control", value="topic", text=True), Column("what to heed", value="text", text=True))
    return Table("", columns, notes)


def _memory(size: int, machine: Machine) -> str:
    room = machine.controller.program_memory_bytes
    fits = "fits" if size <= room else f"does not fit: {no_room(room)}"
    return f"{size} bytes ({size / _TAPE_CHARACTERS_PER_M:.0f} m of tape); {room} bytes on this machine: {fits}"


def _line(loads: Mapping[int, TransferLoad], machine: Machine) -> str:
    baud = max((load.baud for load in loads.values()), default=0.0)
    line = machine.controller.dnc_baud
    here = f", the line of this machine has {line}" if line > 0 else ""
    enough = "" if line <= 0 else ": enough" if baud <= line else ": it starves (--baud fits the program to it)"
    return f"{baud:.0f} baud or more in the busiest stretch of the cuts{here}{enough}"


def _look_ahead(loads: Mapping[int, TransferLoad], machine: Machine, block_period_s: float) -> str:
    rate = max((load.blocks_per_second for load in loads.values()), default=0.0)
    needs = f"up to {rate:.0f} blocks/s, one every {block_period_s * 1e3:g} ms"
    prologue = " ".join(machine.emission.prologue)
    if machine.emission.leaves_look_ahead:
        on = " ".join(machine.emission.epilogue)
        again = f", {on} behind it on again" if on else ""
        return f"{needs}; {prologue} before each shaped cut switches the look-ahead mode off{again}"
    if prologue:
        return f"{needs}; {prologue} before each shaped cut is meant to put the control into the mode for them"
    return f"{needs}; the program switches no mode: contour control with look-ahead (G05.1Q1, G08P1) must be off"


def _at_other_overrides(figures: PlayedFigures) -> Iterator[str]:
    turned = [case for case in figures.cases if case.override != 1.0 and case.mode is None]
    worst = max(turned, key=lambda each: max(each.residual_um), default=None)
    if worst is not None:
        yield f"at {worst.override * 100:.0f} % up to {max(worst.residual_um):.1f} µm of vibration stay"


def _restart_lines(emitted: Program, placed: Sequence[Placed]) -> str:
    named = []
    for place in placed[:_NAMED_LINES]:
        rows = range(place.first_line, place.last_line + 1)
        lines = zip(rows, _lines_from(emitted, place.first_line), strict=False)
        first = next(lines)
        # Behind the comment: lines that lock the override or switch a mode belong to the cut.
        at, line = next((each for each in chain([first], lines) if not each[1].lstrip().startswith(b"(")), first)
        number = re.match(rb"N\d+", line.strip())
        named.append(f"{number[0].decode()} (line {at})" if number else f"line {at}")
    more = f" and {len(placed) - len(named)} more" if len(placed) > len(named) else ""
    return f"here: {', '.join(named)}{more}"


def _lines_from(emitted: Program, number: int) -> Iterator[bytes]:
    """The lines of a text from one on, of which it has a million perhaps."""
    passed, rest = 1, b""
    for begin in range(0, emitted.size, _CHUNK):
        chunk = emitted.text_slice(begin, min(begin + _CHUNK, emitted.size))
        if passed + chunk.count(b"\n") < number:
            passed += chunk.count(b"\n")
            continue
        *lines, rest = (rest + chunk).split(b"\n")
        yield from lines[number - passed :]
        passed = number
    yield rest
