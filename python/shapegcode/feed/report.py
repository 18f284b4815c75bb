"""What a feed schedule gains: force, torque, power and deflection before and after, and what limits each block."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, overload

import numpy as np

from shapegcode import _core
from shapegcode.cutting.tool import Tool
from shapegcode.feed.plan import AIR, KEPT, MINIMUM, FeedPlan, goes_on, limits_of, milling_force, tool_beam
from shapegcode.feed.survey import Survey, SurveyedMove, SurveyedRegion
from shapegcode.feed.travel import Motion, Travelled, Vector
from shapegcode.machine import Machine
from shapegcode.program import Program

__all__ = ["Load", "RegionLoad", "feed_report", "load_of", "region_load"]

_SLACK = 1e-3  # of a limit: what its own search and the rounding of a figure may be off by
_AIR_N = 1e-9
_SHOWN_ALIKE = 4
_LIMITED = (  # column of Load, limit of the core, name and unit for people
    ("peak_resultant_n", "peak_resultant_n", "peak resultant", "N"),
    ("mean_resultant_n", "mean_resultant_n", "mean resultant", "N"),
    ("peak_deflection_um", "peak_deflection_um", "deflection", "µm"),
    ("peak_torque_nm", "peak_torque_nm", "torque", "N m"),
    ("mean_power_w", "mean_power_w", "power", "W"),
)


@dataclass(frozen=True)
class Load:
    """Load along a region, one value per station; the feed is what the machine really runs.

    Attributes:
        feed_mm_per_min: largest on the stretch before the station.
        time_s: on that stretch.
        mean_resultant_n: mean of the XY resultant over one revolution.
        peak_resultant_n: largest.
        peak_torque_nm: largest torque.
        mean_power_w: mean power.
        peak_deflection_um: largest deflection of the tip.
    """

    feed_mm_per_min: Vector
    time_s: Vector
    mean_resultant_n: Vector
    peak_resultant_n: Vector
    peak_torque_nm: Vector
    mean_power_w: Vector
    peak_deflection_um: Vector


@dataclass(frozen=True)
class RegionLoad:
    """Load along a region before and after; `s_mm` are the stations."""

    s_mm: Vector
    before: Load
    after: Load


def region_load(
    part: SurveyedRegion, plan: FeedPlan | None, written: _core.Path, machine: Machine, *, before: Motion, after: Motion
) -> RegionLoad | None:
    """Load along a region as programmed and as written; None where engagement or spindle speed are not known.

    Args:
        part: the region.
        plan: its new feeds; None: they did not change.
        written: its path as read back.
        machine: the machine.
        before: how the original is run.
        after: how the written program is run.
    """
    if part.track is None or part.tool is None or not part.spindle_rev_per_min > 0.0 or len(part.track) == 0:
        return None
    stations = np.asarray(part.track.s_mm)
    window_s = 60.0 / (part.tool.tool.flutes * part.spindle_rev_per_min)
    was = load_of(part, before.travel(part.region.path, part.region.path, stations, window_s))
    if plan is None and before is after:
        return RegionLoad(stations, was, was)
    travelled = after.travel(written, part.region.path, stations, window_s)
    return RegionLoad(stations, was, load_of(part, travelled))


def load_of(part: SurveyedRegion | SurveyedMove, travelled: Travelled) -> Load:
    """Load along a region that is travelled so."""
    assert part.tool is not None and part.track is not None
    # What a station meets is met with the feed of the stretch before it and of the one behind it.
    feeds = travelled.feed_mm_per_min.copy()
    feeds[:-1] = np.where(goes_on(part.track), np.maximum(feeds[:-1], feeds[1:]), feeds[:-1])
    figures = milling_force(part.tool, part).figures_of(part.track, feeds, tool_beam(part.tool))
    return Load(
        travelled.feed_mm_per_min,
        travelled.time_s,
        **{name: figures[name] for name, *_ in _LIMITED},
    )


def feed_report(
    surveyed: Survey,
    plans: Sequence[FeedPlan | None],
    loads: Sequence[RegionLoad | None],
    machine: Machine,
    margin: float,
) -> dict[str, Any]:
    """The report of a schedule (see docs/feed.md), without its times and blocks."""
    program = surveyed.program
    warnings = [*program.warnings, *surveyed.warnings]
    for tool in {id(part.tool): part.tool for part in surveyed.regions if part.tool is not None}.values():
        own = limits_of(tool, machine, 0.0)
        names = [name for _, name, *_ in _LIMITED] + ["feed_per_tooth_mm"]
        if not any(np.isfinite(getattr(own, name)) for name in names):
            warnings.append(
                f"tool {tool.tool.name}: no limit of force, deflection, torque or power is set, so nothing slows "
                "its feed: set one of [limits] in its file; the column before shows what it takes now"
            )
    regions: list[dict[str, Any]] = []
    excess = 0.0
    for part, plan, load in zip(surveyed.regions, plans, loads, strict=True):
        misses, beyond = _misses(part, plan, load, machine)
        if load is None and part.track is not None and part.track.section_mm2.any():
            misses = [f"its force is not known: {part.kept or 'nothing is said of it'}"]
        excess = max(excess, beyond)
        place = f"{program.place(part.region.first_line)}: {program.lines(part.region)}"
        if part.kept:
            warnings.append(f"{place} keep their feeds: {part.kept}")
        if plan is not None:
            warnings += _kept_blocks(program.place, part, plan)
            if plan.held_at_minimum.any():
                warnings.append(
                    f"{place}: the limits ask for less than the least feed, which is what is written: take less "
                    "material at once"
                )
        regions.append(
            {
                "lines": [part.region.first_line, part.region.last_line],
                "kept": part.kept,
                "spindle_rev_per_min": part.spindle_rev_per_min,
                "radial_depth_mm": _largest(part, "radial_depth_mm"),
                "removal_mm3": _removed_mm3(part),
                "misses": misses,
                **({} if load is None else {"resultant_force_n": _before_after_all([load])}),
            }
        )
    known = [load for load in loads if load is not None]
    placed: list[tuple[Sequence[str], RegionLoad]] = [
        (_Places(program, part), load) for part, load in zip(surveyed.regions, loads, strict=True) if load is not None
    ]
    elsewhere = [(move, _load_elsewhere(move)) for move in surveyed.moves]
    known += [load for _, load in elsewhere if load is not None]
    placed += [([move.place] * len(load.s_mm), load) for move, load in elsewhere if load is not None]
    moves = [_move_entry(move, load, machine) for move, load in elsewhere]
    warnings += [f"{entry['place']}: {miss}" for entry in moves for miss in entry["misses"]]
    limits = [entry for part, plan in zip(surveyed.regions, plans, strict=True) for entry in _limits(part, plan)]
    return {
        "program": program.source,
        "machine": machine.name,
        "tools": sorted({part.tool.tool.name for part in surveyed.regions if part.tool is not None}),
        "margin": margin,
        "feed_mm_per_min": _feeds(surveyed, plans),
        "resultant_force_n": _before_after_all(known),
        "peak": _peaks(placed),
        "air_time_s": {
            when: float(sum(_air_time(getattr(load, when)) for load in known)) for when in ("before", "after")
        },
        "limits": limits,
        "regions": regions,
        "moves": moves,
        "excess_ratio": excess,
        "within_limits": not any(entry["misses"] for entry in (*regions, *moves)),
        "warnings": _shortened(warnings, program.source),
    }


def _load_elsewhere(move: SurveyedMove) -> RegionLoad | None:
    """Load along a move outside of the regions at its programmed feed; None without a spindle speed."""
    if not move.spindle_rev_per_min > 0.0:
        return None
    stations = np.asarray(move.track.s_mm)
    times = np.diff(np.concatenate(([0.0], stations))) / move.feed_mm_per_min * 60.0
    load = load_of(move, Travelled(np.full(len(stations), move.feed_mm_per_min), times))
    return RegionLoad(stations, load, load)


def _move_entry(move: SurveyedMove, load: RegionLoad | None, machine: Machine) -> dict[str, Any]:
    """A move outside of the regions in the report."""
    misses = ["its force is not known: no spindle speed"]
    if load is not None:
        misses = [
            f"cut at its own feed: {words} {getattr(load.after, column).max():.4g} {unit}, limit {limit:.4g} {unit}"
            for column, words, unit, limit in _exceeded(move.tool, load, machine)
        ]
    return {"place": move.place, "feed_mm_per_min": move.feed_mm_per_min, "misses": misses}


def _exceeded(tool: Tool, load: RegionLoad, machine: Machine) -> Iterator[tuple[str, str, str, float]]:
    """Column, name, unit and limit of what a load exceeds."""
    limits = limits_of(tool, machine, 0.0)
    for column, name, words, unit in _LIMITED:
        limit = getattr(limits, name)
        if np.isfinite(limit) and (getattr(load.after, column) > limit * (1.0 + _SLACK)).any():
            yield column, words, unit, limit


def _largest(part: SurveyedRegion, column: str) -> float | None:
    return None if part.track is None else float(getattr(part.track, column).max(initial=0.0))


def _removed_mm3(part: SurveyedRegion) -> float | None:
    """Volume that is cut on the region."""
    if part.track is None or len(part.track) == 0:
        return None
    lengths = np.diff(np.concatenate(([0.0], part.track.s_mm)))
    return float((lengths * part.track.section_mm2).sum())


def _before_after_all(loads: Sequence[RegionLoad]) -> dict[str, dict[str, float]]:
    return {when: _resultant([getattr(load, when) for load in loads]) for when in ("before", "after")}


def _resultant(loads: Sequence[Load]) -> dict[str, float]:
    """Mean over the time in material of the mean resultant, and the largest resultant of all."""
    cut = [load.peak_resultant_n > _AIR_N for load in loads]
    time = sum(float(load.time_s[inside].sum()) for load, inside in zip(loads, cut, strict=True))
    impulse = sum(
        float((load.time_s * load.mean_resultant_n)[inside].sum()) for load, inside in zip(loads, cut, strict=True)
    )
    return {
        "mean": impulse / time if time > 0.0 else 0.0,
        "max": max((float(load.peak_resultant_n.max(initial=0.0)) for load in loads), default=0.0),
    }


def _peaks(loads: Sequence[tuple[Sequence[str], RegionLoad]]) -> dict[str, dict[str, Any]]:
    """The largest value of each column, before and after, and the place of the latter; loads with their places."""
    peaks: dict[str, dict[str, Any]] = {}
    for column, *_ in _LIMITED:
        entry: dict[str, Any] = {"before": 0.0, "after": 0.0, "place": ""}
        for places, load in loads:
            was, now = getattr(load.before, column), getattr(load.after, column)
            entry["before"] = max(entry["before"], float(was.max(initial=0.0)))
            if len(now) and float(now.max()) > entry["after"]:
                entry["after"], entry["place"] = float(now.max()), places[int(np.argmax(now))]
        peaks[column] = entry
    return peaks


class _Places(Sequence[str]):
    """File and line of each station of a region, looked up when asked for."""

    def __init__(self, program: Program, part: SurveyedRegion) -> None:
        assert part.track is not None
        self._program, self._lines, self._segment = program, part.region.path.segment_lines, part.track.segment

    def __len__(self) -> int:
        return len(self._segment)

    @overload
    def __getitem__(self, station: int) -> str: ...
    @overload
    def __getitem__(self, station: slice) -> Sequence[str]: ...
    def __getitem__(self, station: int | slice) -> str | Sequence[str]:
        if isinstance(station, slice):
            return [self[i] for i in range(*station.indices(len(self)))]
        return self._program.place(int(self._lines[self._segment[station]]))


def _air_time(load: Load) -> float:
    return float(load.time_s[load.peak_resultant_n <= _AIR_N].sum())


def _feeds(surveyed: Survey, plans: Sequence[FeedPlan | None]) -> dict[str, float]:
    """Lowest and highest feed that stands in the written regions."""
    feeds: list[float] = []
    for part, plan in zip(surveyed.regions, plans, strict=True):
        if plan is None:
            feeds += (part.region.path.segment_feeds_mm_per_s * 60.0).tolist()
        else:
            feeds += [stretch.feed_mm_per_min for stretch in plan.stretches]
    return {"min": min(feeds), "max": max(feeds)} if feeds else {"min": 0.0, "max": 0.0}


def _misses(
    part: SurveyedRegion, plan: FeedPlan | None, load: RegionLoad | None, machine: Machine
) -> tuple[list[str], float]:
    """Limits that the region does not keep behind the schedule, in words, and the largest share that is too much.

    The share counts where a lower feed could help: not where feeds stay, or are the least already.
    """
    if load is None or part.tool is None or part.track is None:
        return [], 0.0
    helped = np.zeros(len(load.s_mm), dtype=bool) if plan is None else ~np.isin(plan.holds, (KEPT, MINIMUM))
    misses, excess = [], 0.0
    for column, words, unit, limit in _exceeded(part.tool, load, machine):
        values = getattr(load.after, column)
        worst = int(np.argmax(values))
        line = int(part.region.path.segment_lines[part.track.segment[worst]])
        cause = ""
        if plan is None or plan.holds[worst] == KEPT:
            cause = ", where the feed stays as it was: lower it yourself"
        elif plan.holds[worst] == MINIMUM:
            cause = ", at the least feed"
        misses.append(f"{words} {float(values[worst]):.4g} {unit} in line {line}, limit {limit:.4g} {unit}{cause}")
        excess = max(excess, float(values[helped].max(initial=0.0)) / limit - 1.0)
    return misses, excess


def _kept_blocks(place: Callable[[int], str], part: SurveyedRegion, plan: FeedPlan) -> Iterator[str]:
    """One sentence per run of blocks that are left alone for one reason."""
    lines = part.region.path.segment_lines
    for reason, run in groupby(range(len(lines)), key=lambda i: plan.kept[i]):
        indices = list(run)
        if reason:
            first, last = int(lines[indices[0]]), int(lines[indices[-1]])
            where = "" if first == last else f" to line {last}"
            yield f"{place(first)}{where}: left as it was: {reason}"


def _shortened(warnings: Sequence[str], source: str) -> list[str]:
    """Each warning once; of many that say the same of different lines the first few, and how many more there are."""
    shown: list[str] = []
    seen: Counter[str] = Counter()
    for warning in dict.fromkeys(warnings):
        said = warning.rpartition(": ")[2]
        seen[said] += 1
        if seen[said] <= _SHOWN_ALIKE:
            shown.append(warning)
    shown += [
        f"{source}: {number - _SHOWN_ALIKE} more: {said}" for said, number in seen.items() if number > _SHOWN_ALIKE
    ]
    return shown


def _limits(part: SurveyedRegion, plan: FeedPlan | None) -> Iterator[dict[str, Any]]:
    """Ranges of lines, each with its feeds and what holds them."""
    path = part.region.path
    if plan is None:
        feeds = (path.segment_feeds_mm_per_s * 60.0).tolist()
        yield _range(part.region.first_line, part.region.last_line, feeds, KEPT, part.kept)
        return
    track = part.track
    assert track is not None
    segment = np.asarray(track.segment)
    starts = np.searchsorted(segment, np.arange(len(path)))
    ends = np.searchsorted(segment, np.arange(len(path)), side="right")
    holds: list[str] = []
    for i in range(len(path)):
        inside = slice(starts[i], ends[i])
        # A block that cuts is held by what holds it there, even if it begins in air.
        feeds = np.where(plan.holds[inside] == AIR, np.inf, plan.limit_mm_per_min[inside])
        tightest = int(np.argmin(feeds)) if ends[i] > starts[i] else 0
        holds.append(str(plan.holds[inside][tightest]) if ends[i] > starts[i] else KEPT)
    written = _feeds_of_segments(plan, path)
    lines = path.segment_lines
    for (hold, reason), run in groupby(range(len(path)), key=lambda i: (holds[i], plan.kept[i])):
        indices = list(run)
        feeds = [feed for i in indices for feed in written[i]]
        yield _range(int(lines[indices[0]]), int(lines[indices[-1]]), feeds, hold, reason)


def _range(first: int, last: int, feeds: list[float], hold: str, reason: str) -> dict[str, Any]:
    return {
        "lines": [first, last],
        "feed_mm_per_min": {"min": min(feeds), "max": max(feeds)},
        "limit": hold,
        "reason": reason,
    }


def _feeds_of_segments(plan: FeedPlan, path: _core.Path) -> list[list[float]]:
    """The feeds that stand in each segment."""
    ends = np.array([stretch.end_mm for stretch in plan.stretches])
    feeds = [stretch.feed_mm_per_min for stretch in plan.stretches]
    borders = np.concatenate(([0.0], path.segment_ends_mm))
    first = np.searchsorted(ends, borders[:-1] + 1e-6, side="right")
    last = np.searchsorted(ends, borders[1:] - 1e-6)
    most = len(feeds) - 1
    return [feeds[min(a, most) : min(b, most) + 1] for a, b in zip(first, last, strict=True)]
