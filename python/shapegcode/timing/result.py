"""The cycle time of a program: figures, tables, the file of its blocks, the next step."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping
from dataclasses import astuple, dataclass, field, fields, replace
from operator import attrgetter
from typing import Any, ClassVar

from shapegcode.model.programs import SimulatedPrograms
from shapegcode.results.json import hidden
from shapegcode.results.outcome import Plot
from shapegcode.results.page.model import Figure
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table, share_percent
from shapegcode.timing.interval import LogNext, OpenPart

AGREEMENT_PERCENT = 0.5  # Closed form and full interpolation agree if they differ by no more than this


@dataclass(frozen=True, repr=False)
class TimeParts:
    """Parts of a duration; they add up to the whole.

    Attributes:
        cutting_s: cutting blocks at their feed.
        rapid_s: rapids at their rate.
        in_position_s: waits for the axes to arrive, behind rapids and exact stops.
        dwell_s: G04, and the dwells of drilling cycles.
        acceleration_s: what acceleration adds to cutting blocks and rapids; in look-ahead also what the limits at
            corners and on arcs add.
        tool_change_s: M06.
        function_s: every other M code.
    """

    cutting_s: float
    rapid_s: float
    in_position_s: float
    dwell_s: float
    acceleration_s: float
    tool_change_s: float
    function_s: float


PARTS = tuple(field.name for field in fields(TimeParts))  # Names of the parts, in the order in which they are shown


@dataclass(frozen=True)
class ToolTime(TimeParts):
    """All uses of one tool together."""

    duration_s: float  # the whole
    tool: int | None  # T number; None before the first tool is known
    first_line: int  # of its first use, from 1


@dataclass(frozen=True)
class RegionTime:
    """A run of cutting moves between two stops."""

    lines: tuple[int, int]  # first and last line, from 1
    tool: int | None  # T number in use; None where it is not known
    start_s: float  # since the start of the program
    duration_s: float  # from rest to rest, the wait of an exact stop at its end included
    programmed_s: float  # its length at the programmed feeds and the override, nothing rounded or limited
    cutting_s: float  # its blocks at their feed, in whole interpolation periods
    acceleration_s: float  # what acceleration adds
    in_position_s: float  # wait of an exact stop at its end
    length_mm: float  # length of its path


@dataclass(frozen=True)
class BlockTime:
    """One cutting block, rapid, dwell, or block with M codes."""

    line: int  # from 1
    kind: str  # "cutting", "rapid", "dwell", "tool_change" or "function"
    start_s: float  # since the start of the program
    duration_s: float  # until the next one starts; the last block of a run has the run's acceleration and wait
    length_mm: float  # 0 for what does not move
    programmed_feed_mm_per_min: float | None  # F as programmed; None for what is no cutting block
    mean_feed_mm_per_min: float  # length over duration
    reached_feed_mm_per_min: float  # highest speed along the path; 0 for what does not move


LABELS = {
    "cutting_s": "cutting", "rapid_s": "rapid", "in_position_s": "in-position", "dwell_s": "dwell",
    "acceleration_s": "lost to acceleration", "tool_change_s": "tool change", "function_s": "M functions",
}  # fmt: skip
"""Name of each part in tables and pictures."""

_SLOWEST = 5
_NOTABLE = 0.1  # A part of the time that deserves the next look
_REMEDIES = {
    "acceleration_s": "join short blocks, or look at the time constants and corner limits of the machine file",
    "rapid_s": "shorten the rapids, or take tools in an order that needs fewer of them",
    "in_position_s": "spare rapids and exact stops, each of which waits for its axes",
    "dwell_s": "look whether the dwells may be shorter",
    "tool_change_s": "take the tools in an order that needs fewer changes",
    "function_s": "put M codes into blocks that move, where the control allows it",
}


@dataclass(frozen=True, repr=False, eq=False)
class CycleTime(TimeParts, Result):
    """How long a program takes.

    Attributes:
        cycle_time_s: the whole, in closed form.
        program: name of the program.
        machine: name of the machine.
        total_low_s: lower end of the 95 % interval of the whole; None: the machine was not calibrated with run logs.
        total_high_s: upper end; None: likewise.
        interval_parts: components of the interval, the largest first; empty: likewise.
        narrowed_by: what a program must hold whose log would narrow the interval most, in words; None: likewise.
        log_next: programs that could be logged next, the most useful first; empty unless asked for.
        full_interpolation_s: the whole time by giving every set-point; None: not asked for.
        tools: per tool, in the order of first use.
        regions: per region, in order.
        blocks: per block, in order; empty unless asked for.
        shaped_regions: how many of the regions are shaped blocks, as the program's header says; 0: it has none.
        warnings: what the reader noticed; why the verdict in a header of shapegcode does not hold here.
        simulated: the program, to show it on a page.
    """

    json_extra: ClassVar[dict[str, Any]] = {**Result.json_extra, "difference_percent": float | None}

    cycle_time_s: float
    program: str
    machine: str
    total_low_s: float | None
    total_high_s: float | None
    interval_parts: tuple[OpenPart, ...]
    narrowed_by: str | None
    log_next: tuple[LogNext, ...]
    full_interpolation_s: float | None
    tools: tuple[ToolTime, ...]
    regions: tuple[RegionTime, ...]
    blocks: tuple[BlockTime, ...]
    shaped_regions: int
    warnings: tuple[str, ...]
    simulated: SimulatedPrograms | None = field(default=None, compare=False, repr=False, metadata=hidden())

    __eq__ = Result.__eq__
    __hash__ = Result.__hash__

    @property
    def methods(self) -> tuple[str, ...]:
        """Published methods of the controller and the plant."""
        return () if self.simulated is None else self.simulated.methods

    @property
    def difference_percent(self) -> float | None:
        """Closed form over full interpolation, in % of the latter; None without one."""
        full = self.full_interpolation_s
        if full is None:
            return None
        return (self.cycle_time_s / full - 1.0) * 100.0 if full > 0.0 else 0.0

    @property
    def ok(self) -> bool:
        """Closed form and full interpolation differ by no more than `AGREEMENT_PERCENT`, or only one was asked for."""
        difference = self.difference_percent
        return difference is None or abs(difference) <= AGREEMENT_PERCENT

    @property
    def answer(self) -> str:
        """The whole time, and whether the check agrees."""
        takes = f"{self.program} takes {self.cycle_time_s:.3f} s"
        if self.total_high_s is not None:
            takes += f" ± {self.total_high_s - self.cycle_time_s:.1f} s"
        sentence = f"{takes} ({_clock(self.cycle_time_s)}) on {self.machine}"
        if self.difference_percent is None:
            return sentence
        agrees = "agrees" if self.ok else "DIFFERS"
        return f"{sentence}; full interpolation {agrees} ({self.difference_percent:+.3f} %)"

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        if not self.ok:
            return (
                f"trust the full interpolation: the closed form differs by {self.difference_percent:+.2f} % "
                f"(limit {AGREEMENT_PERCENT:g} %)."
            )
        if self.cycle_time_s <= 0.0:
            return "nothing in the program takes time: is it the right one?"
        cutting, programmed = sum(r.cutting_s for r in self.regions), sum(r.programmed_s for r in self.regions)
        if cutting - programmed > _NOTABLE * self.cycle_time_s:
            return (
                f"cutting takes {cutting / programmed:.2f} times what its feeds say: look for feeds above the limits "
                "of the axes, and for blocks of a few interpolation periods, which are rounded up to whole ones."
            )
        worst = max(_REMEDIES, key=lambda part: float(getattr(self, part)))
        if getattr(self, worst) > _NOTABLE * self.cycle_time_s:
            share = share_percent(getattr(self, worst), self.cycle_time_s)
            return f"{LABELS[worst]} takes {share} of the time: {_REMEDIES[worst]}."
        if self.regions:
            region = self.slowest_regions(1)[0]
            first, last = region.lines
            share = share_percent(region.duration_s, self.cycle_time_s)
            return f"most of it is cutting: begin with lines {first} to {last} ({tool_name(region.tool)}, {share})."
        return "look at the blocks: --csv FILE."

    def slowest_regions(self, count: int = _SLOWEST) -> list[RegionTime]:
        """The regions that take longest, longest first.

        Args:
            count: how many at most.

        Returns:
            The regions, longest first.
        """
        return heapq.nlargest(count, self.regions, key=attrgetter("duration_s"))

    def slowest_blocks(self, count: int = _SLOWEST) -> list[BlockTime]:
        """The blocks that take longest, longest first.

        Args:
            count: how many at most.

        Returns:
            The blocks, longest first; none where the blocks were not asked for.
        """
        return heapq.nlargest(count, self.blocks, key=attrgetter("duration_s"))

    def without_blocks(self) -> CycleTime:
        """The same without the single blocks, of which there may be millions."""
        return replace(self, blocks=())

    def key_figures(self) -> tuple[Figure, ...]:
        """The whole, and its parts that take time."""
        shown = {"cycle_time_s": "cycle time"} | {part: LABELS[part] for part in PARTS if getattr(self, part) > 0.0}
        return tuple(Figure(name, "s", None, getattr(self, key), 2, key_after=key) for key, name in shown.items())

    def tables(self) -> list[Table]:
        """Parts; tools; the slowest regions and blocks."""
        found = [self._parts_table()]
        if self.tools:
            found.append(self._tools_table())
        if self.regions or self.blocks:
            found.append(self._slowest_table())
        if self.interval_parts:
            found.append(Table("components of the interval", _INTERVAL, self.interval_parts[:_SLOWEST]))
        if self.log_next:
            found.append(Table("remaining interval if logged next", _LOG_NEXT, self.log_next))
        return found

    def _parts_table(self) -> Table:
        whole = self.cycle_time_s
        rows = [("cycle time", whole, _clock(whole))]
        rows += [(LABELS[part], getattr(self, part), share_percent(getattr(self, part), whole)) for part in PARTS]
        if self.total_low_s is not None and self.total_high_s is not None:
            rows.append(("95 % interval from", self.total_low_s, ""))
            rows.append(("to", self.total_high_s, ""))
        if self.full_interpolation_s is not None:
            rows.append(("cycle time by full interpolation", self.full_interpolation_s, ""))
        columns = (
            Column("time", value=lambda row: row[0], text=True),
            Column("s", value=lambda row: row[1], digits=3),
            Column("of the whole", value=lambda row: row[2]),
        )
        return Table("", columns, rows, sections=(1, 1 + len(PARTS)))

    def _tools_table(self) -> Table:
        columns = (
            Column("tool", value=lambda tool: tool_name(tool.tool), text=True),
            Column("from line", value="first_line"),
            Column("total", value="duration_s", digits=2),
            Column("share", value=lambda tool: share_percent(tool.duration_s, self.cycle_time_s)),
            *(Column(LABELS[part], value=part, digits=2) for part in PARTS if getattr(self, part) > 0.0),
        )
        return Table("by tool, s", columns, self.tools)

    def _slowest_table(self) -> Table:
        regions, blocks = self.slowest_regions(), self.slowest_blocks()
        rows: list[tuple[str, str, RegionTime | BlockTime]] = [
            *(("{} to {}".format(*region.lines), f"region, {tool_name(region.tool)}", region) for region in regions),
            *((str(block.line), f"block, {block.kind.replace('_', ' ')}", block) for block in blocks),
        ]
        columns = (
            Column("lines", value=lambda row: row[0], text=True),
            Column("what", value=lambda row: row[1], text=True),
            Column("s", value=lambda row: row[2].duration_s, digits=3),
            Column("share", value=lambda row: share_percent(row[2].duration_s, self.cycle_time_s)),
            Column("mm", value=lambda row: row[2].length_mm or None, digits=1),
            Column("mean mm/min", value=lambda row: _mean_feed(row[2]), digits=0),
        )
        return Table("slowest", columns, rows, sections=(len(regions),))

    def plots(self) -> Mapping[str, Plot]:
        """`time`: where the time goes, by tool and by region; none for a program that takes no time."""
        return self._drawn_beside() if self.cycle_time_s > 0.0 else {}

    def csv_lines(self) -> Iterator[str]:
        """One line per block below a line of headings: the attributes of `BlockTime`, seconds to a microsecond."""
        yield ",".join(field.name for field in fields(BlockTime)) + "\n"
        for block in self.blocks:
            cells = astuple(block)
            yield ",".join("" if c is None else f"{c:.6f}" if isinstance(c, float) else str(c) for c in cells) + "\n"


_INTERVAL = (
    Column("source", value="name", text=True),
    Column("± s by itself", value="half_width_s", digits=2),
    Column("of the variance", value=lambda part: share_percent(part.share, 1.0)),
)
_LOG_NEXT = (Column("program", value="program", text=True), Column("± s", value="half_width_s", digits=2))


def tool_name(tool: int | None) -> str:
    """A tool in words."""
    return "no tool yet" if tool is None else f"T{tool}"


def _mean_feed(row: RegionTime | BlockTime) -> float | None:
    return row.length_mm / row.duration_s * 60.0 if row.length_mm > 0.0 and row.duration_s > 0.0 else None


def _clock(seconds: float) -> str:
    """Hours, minutes and seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"
