"""A program in LinuxCNC's words as the package reads it, held against LinuxCNC's own interpreter rs274."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import shapegcode as sg
from acceptance import MOVE_KINDS, machine_with, moves_of
from linuxcnc_programs import TOOLS, RandomProgram
from rs274_tool import CanonicalMove, canonical_moves, run_rs274

NO_OFFSET = [0.0, 0.0, 0.0]
OFFSETS = {**{f"G{n}": NO_OFFSET for n in range(54, 60)}, **{f"G54.1P{n}": NO_OFFSET for n in (1, 2, 3)}}
TABLE = "".join(f"T{number} P{number} Z{length} ; a tool\n" for number, length in TOOLS.items())
NEAR_MM = 1e-3
"""How far a path may be off: 1 µm."""


def machine(**keys: Any) -> sg.Machine:
    """One that reads LinuxCNC's words, on which rs274's offsets and places are known: all of them are 0."""
    known = {"input.work_offsets": OFFSETS, "input.tool_change_unknown_axes": "", "input.machine_unit": "inch"}
    return machine_with({"controller.dialect": "linuxcnc", **known, **keys})


def compare(seed: int, folder: Path) -> int:
    """How many moves and dwells of a random program agree; a difference is a failure that names the line."""
    inches = RandomProgram(seed).inches
    # rs274 prints four decimals: of inches they are too few.
    scale = 100 if inches else 1
    theirs = list(canonical_moves(run_rs274(RandomProgram(seed, scale).text(), folder, tools=TABLE)))
    (folder / "tool.tbl").write_text(TABLE)
    program = sg.Program.from_text(RandomProgram(seed).text(), machine(), source="random.ngc", folder=folder)
    return agree(program, theirs, scale)


def agree(program: sg.Program, theirs: list[CanonicalMove], scale: int = 1) -> int:
    """How many moves and dwells agree with those of rs274, whose lengths are `scale` times as large."""
    first = next((index for index, move in enumerate(theirs) if move.kind == "rapid"), 0)  # from nobody knows where
    theirs = [part for move in theirs[first + 1 :] for part in turns(move)]
    theirs = [move for move in theirs if move.dwell_s > 0.0 or move.length_mm > 1e-4 * scale]
    ours = [(segment, dwell_s) for segment, dwell_s in moves_of(program) if dwell_s > 0.0 or segment.length_mm > 1e-4]
    for (segment, dwell_s), move in zip(ours, theirs, strict=False):
        wrong = difference(segment, dwell_s, move, scale)
        assert not wrong, f"{program.place(segment.line_number)}: {wrong}; rs274: {move}"
    assert len(ours) == len(theirs), f"{len(ours)} moves and dwells, rs274 {len(theirs)}"
    return len(ours)


def turns(move: CanonicalMove) -> Iterator[CanonicalMove]:
    """An arc of several turns as full turns and the rest; anything else as it is."""
    whole = math.floor(abs(move.sweep_rad) / math.tau - 1e-9) if move.kind == "arc" else 0
    if whole == 0:
        yield move
        return
    shares = np.array([*(math.tau * turn / abs(move.sweep_rad) for turn in range(whole + 1)), 1.0])
    points = move.points(shares)
    for k, share in enumerate(np.diff(shares)):
        yield replace(move, start=points[k], end=points[k + 1], sweep_rad=move.sweep_rad * float(share))


def difference(segment: Any, dwell_s: float, move: CanonicalMove, scale: int) -> str:
    """What is not the same, in words; empty where nothing is. rs274 prints dwells with four decimals."""
    if move.kind == "dwell" or dwell_s > 0.0:
        return "" if math.isclose(dwell_s, move.dwell_s, abs_tol=5.1e-5) else f"dwell {dwell_s}"
    if MOVE_KINDS[segment.kind] != move.kind:
        return f"a {MOVE_KINDS[segment.kind]} to {segment.end_mm}"
    shares = np.linspace(0.0, 1.0, 25)
    ours = np.array([segment.point_at(share * segment.length_mm) for share in shares])
    off = float(np.linalg.norm(ours - move.points(shares) / scale, axis=1).max())
    if off > NEAR_MM:
        return f"up to {off:.5f} mm off; {segment.start_mm} to {segment.end_mm}"
    feed = segment.feed_mm_per_s * 60.0
    if move.kind != "rapid" and not math.isclose(feed, move.feed / scale, rel_tol=1e-4, abs_tol=2e-3):
        return f"feed {feed}"
    return ""
