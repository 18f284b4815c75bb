"""How long a program takes on a machine, and where the time goes: in closed form, and by giving every set-point.

The closed form costs one formula per block (paper 004 for acceleration after interpolation, the planner in look-ahead);
the full interpolation plays the same program sample by sample and is the check of it.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.controller import controller_model
from shapegcode.program import Program

__all__ = ["AGREEMENT_PERCENT", "BlockTime", "CycleTime", "RegionTime", "TimeParts", "ToolTime", "cycle_time"]

AGREEMENT_PERCENT = 0.5
"""Closed form and full interpolation agree if they differ by no more than this."""

_KINDS = {value: name for name, value in ((kind.name, kind.value) for kind in _core.BlockKind.__members__.values())}
_CUTTING, _RAPID = _core.BlockKind.cutting.value, _core.BlockKind.rapid.value


@dataclass(frozen=True)
class TimeParts:
    """Where a stretch of time goes; the parts add up to the whole.

    Attributes:
        total_s: the whole.
        cutting_s: cutting blocks at their feed.
        rapid_s: rapids at their rate.
        in_position_s: waits for the axes to arrive, behind rapids and exact stops.
        dwell_s: G04, and the dwells of drilling cycles.
        acceleration_s: what acceleration adds to cutting blocks and rapids; in look-ahead also what the limits at
            corners and on arcs add.
        tool_change_s: M06.
        function_s: every other M code.
    """

    total_s: float
    cutting_s: float
    rapid_s: float
    in_position_s: float
    dwell_s: float
    acceleration_s: float
    tool_change_s: float
    function_s: float


PARTS = tuple(field.name for field in fields(TimeParts) if field.name != "total_s")
"""Names of the parts, in the order in which they are shown."""


@dataclass(frozen=True)
class ToolTime(TimeParts):
    """All uses of one tool together.

    Attributes:
        tool: T number; None before the first tool is known.
        first_line: of its first use, from 1.
    """

    tool: int | None
    first_line: int


@dataclass(frozen=True)
class RegionTime:
    """A run of cutting moves between two stops.

    Attributes:
        lines: first and last line, from 1.
        tool: T number in use; None where it is not known.
        start_s: since the start of the program.
        duration_s: from rest to rest, the wait of an exact stop at its end included.
        programmed_s: its length at the programmed feeds and the override, nothing rounded or limited.
        cutting_s: its blocks at their feed, in whole interpolation periods.
        acceleration_s: what acceleration adds.
        in_position_s: wait of an exact stop at its end.
        length_mm: length of its path.
    """

    lines: tuple[int, int]
    tool: int | None
    start_s: float
    duration_s: float
    programmed_s: float
    cutting_s: float
    acceleration_s: float
    in_position_s: float
    length_mm: float


@dataclass(frozen=True)
class BlockTime:
    """One cutting block, rapid, dwell, or block with M codes.

    Attributes:
        line: from 1.
        kind: "cutting", "rapid", "dwell", "tool_change" or "function".
        start_s: since the start of the program.
        duration_s: until the next one starts; the last block of a run has the run's acceleration and wait.
        length_mm: 0 for what does not move.
        programmed_feed_mm_per_min: F as programmed; None for what is no cutting block.
        mean_feed_mm_per_min: length over duration.
        reached_feed_mm_per_min: highest speed along the path; 0 for what does not move.
    """

    line: int
    kind: str
    start_s: float
    duration_s: float
    length_mm: float
    programmed_feed_mm_per_min: float | None
    mean_feed_mm_per_min: float
    reached_feed_mm_per_min: float


@dataclass(frozen=True)
class CycleTime(TimeParts):
    """How long a program takes.

    Attributes:
        program: name of the program.
        machine: name of the machine.
        full_interpolation_s: the whole time by giving every set-point; None: not asked for.
        tools: per tool, in the order of first use.
        regions: per region, in order.
        blocks: per block, in order; empty unless asked for.
        warnings: what the reader noticed.
    """

    program: str
    machine: str
    full_interpolation_s: float | None
    tools: tuple[ToolTime, ...]
    regions: tuple[RegionTime, ...]
    blocks: tuple[BlockTime, ...]
    warnings: tuple[str, ...]

    @property
    def difference_percent(self) -> float | None:
        """Closed form over full interpolation, in % of the latter; None without one."""
        full = self.full_interpolation_s
        if full is None:
            return None
        return (self.total_s / full - 1.0) * 100.0 if full > 0.0 else 0.0

    @property
    def agrees(self) -> bool:
        """Closed form and full interpolation differ by no more than `AGREEMENT_PERCENT`, or only one was asked for."""
        difference = self.difference_percent
        return difference is None or abs(difference) <= AGREEMENT_PERCENT

    def report(self, *, blocks: bool = False) -> dict[str, Any]:
        """The plain dictionary that ``--json`` writes; `blocks` says whether the blocks are in it."""
        data = asdict(self)
        data["difference_percent"] = self.difference_percent
        if not blocks:
            del data["blocks"]
        return data


def cycle_time(
    program: Program,
    machine: Machine,
    *,
    per_block: bool = False,
    full: bool = True,
    feed_override: float = 1.0,
    rapid_override: float = 1.0,
) -> CycleTime:
    """Time of a program on a machine as it is: nothing is shaped.

    Moves of an axis whose position the program does not tell (before its first absolute word, after M06, G28, G53)
    count what is known of them.

    Args:
        program: what to time.
        machine: whose controller plays it.
        per_block: give `CycleTime.blocks` too.
        full: check the closed form by full interpolation.
        feed_override: scales every programmed feed.
        rapid_override: scales the rapid rates.

    Raises:
        ArgumentError: a value that no controller can have, or a program too long to interpolate.
    """
    model = controller_model(machine, feed_override=feed_override, rapid_override=rapid_override)
    timed = _core.time_program(program.core, model, per_block)
    return CycleTime(
        **_parts(timed),
        program=program.source,
        machine=machine.name,
        full_interpolation_s=_core.interpolate_program(program.core, model).total_s if full else None,
        tools=tuple(
            ToolTime(**_parts(tool), tool=_tool(tool.tool), first_line=tool.first_line) for tool in timed.tools
        ),
        regions=tuple(_regions(timed.regions, program, feed_override)),
        blocks=tuple(_blocks(timed.blocks, program)) if per_block else (),
        warnings=tuple(program.warnings),
    )


def _parts(timed: _core.CycleTime | _core.ToolTime) -> dict[str, float]:
    return {name: float(getattr(timed, name)) for name in ("total_s", *PARTS)}


def _tool(number: int) -> int | None:
    return None if number < 0 else number


def _regions(rows: npt.NDArray[Any], program: Program, feed_override: float) -> Iterator[RegionTime]:
    programmed: dict[tuple[int, int], deque[float]] = defaultdict(deque)
    for region in program.regions:
        programmed[region.first_line, region.last_line].append(region.path.programmed_time_s / feed_override)
    names = ("start_s", "duration_s", "cutting_s", "acceleration_s", "in_position_s", "length_mm")
    for row in rows:
        times = {name: float(row[name]) for name in names}
        lines = int(row["first_line"]), int(row["last_line"])
        yield RegionTime(lines, _tool(int(row["tool"])), **times, programmed_s=programmed[lines].popleft())


def _blocks(rows: npt.NDArray[Any], program: Program) -> Iterator[BlockTime]:
    moves = _moves(program)
    columns = (rows[name].tolist() for name in ("line", "kind", "start_s", "duration_s", "feed_mm_per_s"))
    for line, kind, start_s, duration_s, reached in zip(*columns, strict=True):
        queue = moves[line, kind == _RAPID] if kind in (_CUTTING, _RAPID) else None
        length, feed = queue.popleft() if queue else (0.0, 0.0)
        yield BlockTime(
            line,
            _KINDS[kind],
            start_s,
            duration_s,
            length,
            feed * 60.0 if kind == _CUTTING else None,
            length / duration_s * 60.0 if duration_s > 0.0 else 0.0,
            reached * 60.0,
        )


def _moves(program: Program) -> dict[tuple[int, bool], deque[tuple[float, float]]]:
    """Length and programmed feed of the moves of each line, rapids apart: in the order in which the line makes them."""
    found: dict[tuple[int, bool], deque[tuple[float, float]]] = defaultdict(deque)

    def note(segments: Iterable[_core.Segment]) -> None:
        for segment in segments:
            rapid = segment.kind == _core.SegmentKind.rapid
            found[segment.line_number, rapid].append((segment.length_mm, segment.feed_mm_per_s))

    for region in program.regions:
        path = region.path
        note(path[index] for index in range(len(path)))
    note(segment for segment, dwell_s in program.core.other_moves if dwell_s <= 0.0)
    return found


def slowest_blocks(blocks: tuple[BlockTime, ...], count: int) -> list[BlockTime]:
    """The blocks that take longest, longest first."""
    order = np.argsort([-block.duration_s for block in blocks], kind="stable")[:count]
    return [blocks[index] for index in order]
