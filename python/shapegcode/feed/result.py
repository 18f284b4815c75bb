"""Result of a feed schedule: force, torque, power and deflection before and after, and limits of each block."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from shapegcode.feed.load import LOADS, FeedTraces, PathLoad, WallMaps, feed_traces, wall_maps
from shapegcode.feed.plan import FeedPlan
from shapegcode.feed.survey import Survey
from shapegcode.model.programs import SimulatedPrograms
from shapegcode.program import Program
from shapegcode.results.json import hidden
from shapegcode.results.outcome import Pair, Plot
from shapegcode.results.page.model import Figure
from shapegcode.results.page.scene import Scene
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table

_SHOWN_MISSES = 3
_LIMIT_WORDS = {
    "resultant": "resultant force",
    "chip_load": "feed per tooth",
    "programmed": "feed as programmed",
    "max_feed": "largest feed of tool or axes",
    "air": "nothing to cut",
    "minimum": "lowest feed",
    "kept": "left unchanged",
}


@dataclass(frozen=True)
class FeedRange:
    """Range of feeds."""

    min: float  # lowest
    max: float  # highest


@dataclass(frozen=True)
class ResultantForce:
    """Resultant force in the XY plane over an interval."""

    mean: float  # mean over the time in material of the mean over a revolution
    max: float  # largest of the peak in a revolution


@dataclass(frozen=True)
class PeakLoad:
    """Largest value along the program, with the original and with the new feeds."""

    original: float  # with the original feeds
    emitted: float  # with the new feeds
    place: str  # file and line of the largest value with the new feeds; empty if there is none


@dataclass(frozen=True)
class PeakLoads:
    """Largest loads along the program."""

    peak_resultant_n: PeakLoad  # largest resultant in a revolution
    mean_resultant_n: PeakLoad  # mean of the resultant over a revolution
    peak_deflection_um: PeakLoad  # largest deflection of the tip in a revolution
    peak_torque_nm: PeakLoad  # largest torque in a revolution
    mean_power_w: PeakLoad  # mean power over a revolution


@dataclass(frozen=True)
class HeldLines:
    """Lines whose feed is determined by the same limit."""

    lines: tuple[int, int]  # first and last, from 1
    feed_mm_per_min: FeedRange  # the feeds in these lines
    # their limit: "resultant", "deflection", "torque", "power" or "chip_load"; "programmed": the feed of the
    # program; "max_feed": the largest feed of tool file or axes; "air": nothing to cut; "minimum": the lowest feed;
    # "kept": left unchanged
    limit: str
    reason: str  # why they are left unchanged; else empty


@dataclass(frozen=True)
class ScheduledRegion:
    """A sequence of cutting moves between two stops."""

    lines: tuple[int, int]  # first and last, from 1
    kept: str  # why its feeds stay; empty if they may change
    spindle_rev_per_min: float  # speed of the spindle; 0: unknown
    radial_depth_mm: float | None  # largest; None: unknown
    removal_mm3: float | None  # removed volume; None: unknown
    misses: tuple[str, ...]  # messages for exceeded limits
    resultant_force_n: Pair[ResultantForce] | None  # before and after; None: unknown


@dataclass(frozen=True)
class KeptMove:
    """A cutting move outside the regions, but in material: its feed stays."""

    place: str  # file and line
    feed_mm_per_min: float  # as programmed
    misses: tuple[str, ...]  # messages for exceeded limits
    load: PathLoad | None = field(metadata=hidden())  # its force; None: unknown


@dataclass(frozen=True, repr=False, eq=False)
class FeedSchedule(Result):
    """A program with the highest feeds that keep the limits of the cut; `original` is before, `emitted` after.

    Attributes:
        program: name of the program.
        machine: name of the machine.
        tools: names of the tools that cut.
        margin: safety ratio to each limit of the load; the limit of the feed per tooth has no margin.
        feed_mm_per_min: range of the written feeds.
        resultant_force_n: resultant over all cutting moves whose load is known.
        peak: largest loads along the program.
        cycle_time_s: time of the whole program.
        air_time_s: time of cutting moves without engagement, where the load is known.
        blocks: number of blocks with a cutting move of a region.
        limits: limits of the feed by lines, in order.
        regions: sequences of cutting moves between two stops.
        moves: cutting moves in material outside the regions.
        excess_ratio: largest relative excess of a limit where a lower feed could help; 0: none.
        warnings: findings, each with its location.
        text: the program with its new feeds.
        written: the same program, as read back.
        survey: tool engagement.
        plans: the feeds of each region that may change; None for the others.
        loads: loads along each region; None: unknown.
        simulated: the program before and after, for a page.
    """

    program: str
    machine: str
    tools: tuple[str, ...]
    margin: float
    feed_mm_per_min: FeedRange
    resultant_force_n: Pair[ResultantForce]
    peak: PeakLoads
    cycle_time_s: Pair[float]
    air_time_s: Pair[float]
    blocks: Pair[int]
    limits: tuple[HeldLines, ...]
    regions: tuple[ScheduledRegion, ...]
    moves: tuple[KeptMove, ...]
    excess_ratio: float
    warnings: tuple[str, ...]
    text: bytes = field(metadata=hidden())
    written: Program = field(metadata=hidden())
    survey: Survey = field(metadata=hidden())
    plans: tuple[FeedPlan | None, ...] = field(metadata=hidden())
    loads: tuple[PathLoad | None, ...] = field(metadata=hidden())
    simulated: SimulatedPrograms | None = field(default=None, compare=False, repr=False, metadata=hidden())

    @property
    def methods(self) -> tuple[str, ...]:
        """Published methods of force model and controller."""
        return ("cutting force", *(() if self.simulated is None else self.simulated.methods))

    @property
    def misses(self) -> tuple[str, ...]:
        """Messages for exceeded limits of regions and moves."""
        groups = [*(region.misses for region in self.regions), *(move.misses for move in self.moves)]
        return tuple(miss for misses in groups for miss in misses)

    @property
    def ok(self) -> bool:
        """Whether every limit is kept."""
        return not self.misses

    @property
    def answer(self) -> str:
        """Whether every limit is kept, with force and time, or where not."""
        name, misses = Path(self.program).name, self.misses
        if not misses:
            force, time = self.resultant_force_n, self.cycle_time_s
            return (
                f"{name}: every limit is kept; peak resultant {force.original.max:.1f} → {force.emitted.max:.1f} N, "
                f"cycle time {time.original:.2f} → {time.emitted:.2f} s"
            )
        more = f"; and {len(misses) - _SHOWN_MISSES} more" if len(misses) > _SHOWN_MISSES else ""
        return f"{name}: NOT within limits: {'; '.join(misses[:_SHOWN_MISSES])}{more}"

    @property
    def next_step(self) -> str:
        """Next command or change, in one sentence."""
        if self.ok:
            return "shapegcode convert shapes this program too; or both in one go: convert --feed-schedule"
        unknown = [region for region in self.regions if region.misses and region.resultant_force_n is None]
        if unknown or any(move.load is None for move in self.moves):
            return "specify the unknown: S in the program or feed.spindle_rev_per_min in the tool file"
        return "reduce the depth of cut there, lower the feed of moves that are left unchanged, or choose another limit"

    @cached_property
    def traces(self) -> FeedTraces | None:
        """Curves along the cutting path; None without a known force."""
        assert self.simulated is not None
        return feed_traces(self.survey, self.plans, self.loads, self.simulated.machine)

    @cached_property
    def walls(self) -> WallMaps | None:
        """Form error of the walls along the cutting path; None without a wall whose cutting force is known."""
        return None if self.traces is None else wall_maps(self.survey, self.loads, self.traces)

    def _completed(self, scene: Scene) -> Scene:
        """The motion with the cutting force."""
        found: Scene = self._beside("plots").with_forces(scene, self)
        return found

    def key_figures(self) -> tuple[Figure, ...]:
        """Time and largest force, before and after."""
        time, force = self.cycle_time_s, self.resultant_force_n
        return (
            Figure("cycle time", "s", time.original, time.emitted, 2,
                   key_before="cycle_time_s.original", key_after="cycle_time_s.emitted"),
            Figure("largest cutting force", "N", force.original.max, force.emitted.max, 0,
                   key_before="resultant_force_n.original.max", key_after="resultant_force_n.emitted.max"),
        )  # fmt: skip

    def tables(self) -> list[Table]:
        """Tables of figures before and after, and of the limits of the feed by lines."""
        return [self._gain_table(), self._limit_table()]

    def plots(self) -> Mapping[str, Plot]:
        """Curves along the path, the path coloured by force, the walls; none without a known force."""
        return self._drawn_beside()

    def _gain_table(self) -> Table:
        force = self.resultant_force_n
        rows: list[tuple[str, Any, int, str]] = [
            *((name, getattr(self.peak, key), digits, unit) for key, (name, unit, digits) in LOADS.items()),
            ("mean resultant over the time in material", Pair(force.original.mean, force.emitted.mean), 1, "N"),
            ("cycle time", self.cycle_time_s, 2, "s"),
            ("of which cutting moves in air", self.air_time_s, 2, "s"),
            ("cutting blocks", self.blocks, 0, ""),
        ]
        columns = (
            Column("largest along the program", value=lambda row: row[0], text=True),
            Column("before", value=lambda row: f"{row[1].original:.{row[2]}f}"),
            Column("after", value=lambda row: f"{row[1].emitted:.{row[2]}f}"),
            Column("unit", value=lambda row: row[3], text=True),
            Column("line", value=lambda row: getattr(row[1], "place", "").rpartition(":")[2]),
        )
        title = f"{self.program} on {self.machine}, tool {', '.join(self.tools) or '-'}"
        return Table(title, columns, rows, sections=(len(LOADS) + 1,))

    def _limit_table(self) -> Table:
        slowest = sorted(self.limits, key=lambda entry: entry.feed_mm_per_min.min)[:24]
        title = "what limits the feed"
        if len(self.limits) > len(slowest):
            title += f" (the {len(slowest)} slowest of {len(self.limits)} ranges; --json has all)"
        columns = (
            Column("lines", value=lambda entry: _from_to(*map(str, entry.lines)), text=True),
            Column("feed", "mm/min", lambda entry: _from_to(*map("{:g}".format, astuple(entry.feed_mm_per_min)))),
            Column("limited by", value=lambda entry: _LIMIT_WORDS.get(entry.limit, entry.limit), text=True),
        )
        return Table(title, columns, sorted(slowest, key=lambda entry: entry.lines[0]))


def _from_to(first: str, last: str) -> str:
    return first if first == last else f"{first} to {last}"
