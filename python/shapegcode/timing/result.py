"""The cycle time of a program: figures, tables, the file of its blocks, the next step."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping
from dataclasses import astuple, dataclass, field, fields, replace
from operator import attrgetter
from typing import Any, ClassVar

from shapegcode.hints import Hinted
from shapegcode.model.programs import SimulatedPrograms
from shapegcode.results.json import hidden
from shapegcode.results.outcome import Plot
from shapegcode.results.page.model import Figure
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table, share_percent

AGREEMENT_PERCENT = 0.5  # Largest difference at which closed form and full interpolation agree


@dataclass(frozen=True, repr=False, eq=False)
class TimeParts:
    """Parts of a duration; they add up to the whole."""

    cutting_s: float  # cutting blocks at their feed
    rapid_s: float  # rapids at their rate
    in_position_s: float  # in-position waits after rapids and exact stops
    dwell_s: float  # G04, and the dwells of drilling cycles
    # time added by acceleration to cutting blocks and rapids; with look-ahead also by the limits at corners and on arcs
    acceleration_s: float
    tool_change_s: float  # M06
    function_s: float  # other M codes; also start of the program, waits for the spindle, rapids of unknown travel


PARTS = tuple(field.name for field in fields(TimeParts))  # names of the parts, in display order


@dataclass(frozen=True)
class ToolTime(TimeParts):
    """Time of all uses of one tool."""

    duration_s: float  # total
    tool: int | None  # T number; None before the first tool is known
    first_line: int  # line of its first use, from 1


@dataclass(frozen=True)
class RegionTime:
    """A sequence of cutting moves between two stops."""

    lines: tuple[int, int]  # first and last line, from 1
    tool: int | None  # T number in use; None if unknown
    start_s: float  # since the start of the program
    duration_s: float  # from rest to rest, including the wait of an exact stop at its end
    programmed_s: float  # length over programmed feeds and override, without rounding or limits
    cutting_s: float  # blocks at their feed; without look-ahead in the periods of block timing (`block_end`)
    acceleration_s: float  # time added by acceleration
    in_position_s: float  # in-position wait of an exact stop at its end
    length_mm: float  # length of its path


@dataclass(frozen=True)
class BlockTime(Hinted):
    """One cutting block, rapid, dwell, or block with M codes."""

    line: int  # from 1
    kind: str  # "cutting", "rapid", "dwell", "tool_change" or "function"
    start_s: float  # since the start of the program
    # until the next one starts; the last block before a rest includes the wait, and without look-ahead the acceleration
    duration_s: float
    length_mm: float  # 0 without motion
    programmed_feed_mm_per_min: float | None  # programmed F; None except for cutting blocks
    mean_feed_mm_per_min: float  # length over duration
    reached_feed_mm_per_min: float  # highest speed along the path; 0 without motion


@dataclass(frozen=True)
class OpenPart:
    """Contribution of one source of uncertainty to the 95 % interval of a predicted time."""

    name: str  # a parameter, the kind of look-ahead, or a scatter
    half_width_s: float  # half of the 95 % interval from this source alone, s
    share: float  # fraction of the variance, 0 to 1


@dataclass(frozen=True)
class LogNext:
    """A program that could be logged next for calibration."""

    program: str  # its name
    half_width_s: float  # half of the 95 % interval that would remain for the timed program, s


LABELS = {
    "cutting_s": "cutting", "rapid_s": "rapid", "in_position_s": "in-position", "dwell_s": "dwell",
    "acceleration_s": "lost to acceleration", "tool_change_s": "tool change", "function_s": "M functions",
}  # fmt: skip
"""Name of each part in tables and pictures."""

_SLOWEST = 5
_NOTABLE = 0.1  # fraction of the time worth a remark
_REMEDIES = {
    "acceleration_s": "join short blocks, or check the time constants and corner limits of the machine file",
    "rapid_s": "shorten the rapids, or order the tools so that fewer are needed",
    "in_position_s": "avoid rapids and exact stops, each of which waits for its axes",
    "dwell_s": "check whether the dwells can be shorter",
    "tool_change_s": "order the tools so that fewer changes are needed",
    "function_s": "put M codes into blocks with motion, if the control allows it",
}


@dataclass(frozen=True, repr=False, eq=False)
class CycleTime(TimeParts, Result):
    """Cycle time of a program.

    Attributes:
        cycle_time_s: total, in closed form.
        program: name of the program.
        machine: name of the machine.
        total_low_s: lower end of the 95 % interval of the total; None: the machine was not calibrated with run logs.
        total_high_s: upper end; None: not calibrated with run logs.
        interval_parts: components of the interval, the largest first; empty: not calibrated with run logs.
        narrowed_by: what a program must contain for its log to narrow the interval most; None: not calibrated.
        log_next: programs that could be logged next, the most useful first; empty unless requested.
        full_interpolation_s: total by full interpolation; None: not requested.
        tools: times per tool, in order of first use.
        regions: times per region, in order.
        blocks: times per block, in order; empty unless requested.
        shaped_regions: number of regions with shaped blocks, by the program's header; 0: none.
        warnings: findings of the reader; why the verdict in an emitted program's header is not valid here.
        simulated: the program, for a page.
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

    @property
    def methods(self) -> tuple[str, ...]:
        """Published methods of the models of controller and plant."""
        return () if self.simulated is None else self.simulated.methods

    @property
    def difference_percent(self) -> float | None:
        """Difference of closed form from full interpolation, %; None without the latter."""
        full = self.full_interpolation_s
        if full is None:
            return None
        return (self.cycle_time_s / full - 1.0) * 100.0 if full > 0.0 else 0.0

    @property
    def ok(self) -> bool:
        """True if closed form and full interpolation differ by at most `AGREEMENT_PERCENT`, or without the latter."""
        difference = self.difference_percent
        return difference is None or abs(difference) <= AGREEMENT_PERCENT

    @property
    def answer(self) -> str:
        """The total time, and whether full interpolation agrees."""
        takes = f"{self.program} takes {self.cycle_time_s:.3f} s"
        if self.total_high_s is not None:
            takes += f" ± {self.total_high_s - self.cycle_time_s:.1f} s"
        sentence = f"{takes} ({_clock(self.cycle_time_s)}) on {self.machine}"
        if self.difference_percent is None:
            return sentence
        agrees = "agrees" if self.ok else "DIFFERS"
        return f"{sentence}; full interpolation {agrees} ({self.difference_percent:+z.3f} %)"

    @property
    def next_step(self) -> str:
        """What to improve next, in one sentence."""
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
                f"cutting takes {cutting / programmed:.2f} times its time by feed: check for feeds above the limits "
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
            return f"most of it is cutting: start with lines {first} to {last} ({tool_name(region.tool)}, {share})."
        return "see the blocks: --csv FILE."

    def slowest_regions(self, count: int = _SLOWEST) -> list[RegionTime]:
        """The regions with the longest times, longest first.

        Args:
            count: largest number.

        Returns:
            The regions, longest first.
        """
        return heapq.nlargest(count, self.regions, key=attrgetter("duration_s"))

    def slowest_blocks(self, count: int = _SLOWEST) -> list[BlockTime]:
        """The blocks with the longest times, longest first.

        Args:
            count: largest number.

        Returns:
            The blocks, longest first; none if blocks were not requested.
        """
        return heapq.nlargest(count, self.blocks, key=attrgetter("duration_s"))

    def without_blocks(self) -> CycleTime:
        """Copy without the blocks, of which there may be millions."""
        return replace(self, blocks=())

    def key_figures(self) -> tuple[Figure, ...]:
        """Total, and its nonzero parts."""
        shown = {"cycle_time_s": "cycle time"} | {part: LABELS[part] for part in PARTS if getattr(self, part) > 0.0}
        return tuple(Figure(name, "s", None, getattr(self, key), 2, key_after=key) for key, name in shown.items())

    def tables(self) -> list[Table]:
        """Tables of parts, tools, the slowest cuts and blocks, and of the interval if it is known."""
        found = [self._parts_table()]
        if self.tools:
            found.append(self._tools_table())
        if self.regions or self.blocks:
            found.append(self._slowest_table())
        if self.interval_parts:
            found.append(self._interval_table())
        if self.log_next:
            columns = (Column("program", text=True), Column("± s", value="half_width_s", digits=2))
            found.append(Table("remaining interval if logged next", columns, self.log_next))
        return found

    def _interval_table(self) -> Table:
        columns = (
            Column("source", value="name", text=True),
            Column("± s by itself", value="half_width_s", digits=2),
            Column("of the variance", value=lambda part: share_percent(part.share, 1.0)),
        )
        return Table("components of the interval", columns, self.interval_parts[:_SLOWEST])

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
            Column("of total", value=lambda row: row[2]),
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
            *(("{} to {}".format(*region.lines), f"cut, {tool_name(region.tool)}", region) for region in regions),
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
        """Picture `time`: time by tool and by cut. No picture if the cycle time is zero."""
        return self._drawn_beside() if self.cycle_time_s > 0.0 else {}

    def csv_lines(self) -> Iterator[str]:
        """CSV lines with a heading, one per block: the attributes of `BlockTime`, seconds to a microsecond."""
        yield ",".join(field.name for field in fields(BlockTime)) + "\n"
        for block in self.blocks:
            cells = astuple(block)
            yield ",".join("" if c is None else f"{c:.6f}" if isinstance(c, float) else str(c) for c in cells) + "\n"


def tool_name(tool: int | None) -> str:
    """Name of a tool."""
    return "no tool yet" if tool is None else f"T{tool}"


def _mean_feed(row: RegionTime | BlockTime) -> float | None:
    return row.length_mm / row.duration_s * 60.0 if row.length_mm > 0.0 and row.duration_s > 0.0 else None


def _clock(seconds: float) -> str:
    """Format as hours, minutes and seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"
