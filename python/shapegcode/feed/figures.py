"""The figures of a feed schedule, from what the tool meets, the feeds that were chosen and the loads along the way."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby

import numpy as np

from shapegcode import _core
from shapegcode.feed.load import LOADS, Load, PathLoad, exceeded, move_load
from shapegcode.feed.plan import AIR, KEPT, MINIMUM, FeedPlan, limits_of
from shapegcode.feed.result import (
    FeedRange,
    FeedSchedule,
    HeldLines,
    KeptMove,
    PeakLoad,
    PeakLoads,
    ResultantForce,
    ScheduledRegion,
)
from shapegcode.feed.survey import Survey, SurveyedMove, SurveyedRegion
from shapegcode.machine import Machine
from shapegcode.model.playable import PlayedPrograms
from shapegcode.program import Program
from shapegcode.results.result import Pair

_AIR_N = 1e-9
_SHOWN_ALIKE = 4

Plans = Sequence[FeedPlan | None]
Loads = Sequence[PathLoad | None]


def feed_figures(
    surveyed: Survey, plans: Plans, loads: Loads, machine: Machine, *, margin: float, text: bytes, written: Program,
    cycle_time_s: Pair[float], blocks: Pair[int],
) -> FeedSchedule:  # fmt: skip
    """The result of a schedule."""
    program = surveyed.program
    moves = tuple(_move(move, machine) for move in surveyed.moves)
    parts = list(zip(surveyed.regions, plans, loads, strict=True))
    placed = [(_places(program, part), load) for part, _, load in parts if load is not None]
    placed += [(_place(move.place), move.load) for move in moves if move.load is not None]
    known = [load for _, load in placed]
    excess = max((share for part, plan, load in parts for _, share in _misses(part, plan, load, machine)), default=0.0)
    return FeedSchedule(
        program=program.source,
        machine=machine.name,
        tools=tuple(sorted({part.tool.tool.name for part in surveyed.regions if part.tool is not None})),
        margin=margin,
        feed_mm_per_min=_feeds(surveyed, plans),
        resultant_force_n=_resultants(known),
        peak=PeakLoads(**{column: _peak(column, placed) for column in LOADS}),
        cycle_time_s=cycle_time_s,
        air_time_s=Pair(
            sum(_air_time(load.original) for load in known), sum(_air_time(load.emitted) for load in known)
        ),
        blocks=blocks,
        limits=tuple(entry for part, plan, _ in parts for entry in _limits(part, plan)),
        regions=tuple(_region(part, plan, load, machine) for part, plan, load in parts),
        moves=moves,
        excess_ratio=max(excess, 0.0),
        warnings=tuple(_shortened([*_warnings(surveyed, plans, machine), *_of_moves(moves)], program.source)),
        text=text,
        written=written,
        survey=surveyed,
        plans=tuple(plans),
        loads=tuple(loads),
        played=PlayedPrograms(program, machine, written),
    )


def _move(move: SurveyedMove, machine: Machine) -> KeptMove:
    load = move_load(move)
    misses = ["its force is not known: no spindle speed"]
    if load is not None:
        misses = [
            f"cut at its own feed: {words} {getattr(load.emitted, column).max():.4g} {unit}, limit {limit:.4g} {unit}"
            for column, words, unit, limit in exceeded(move.tool, load.emitted, machine)
        ]
    return KeptMove(move.place, move.feed_mm_per_min, tuple(misses), load)


def _region(part: SurveyedRegion, plan: FeedPlan | None, load: PathLoad | None, machine: Machine) -> ScheduledRegion:
    track = part.track
    misses = [words for words, _ in _misses(part, plan, load, machine)]
    if load is None and track is not None and track.section_mm2.any():
        misses = [f"its force is not known: {part.kept or 'nothing is said of it'}"]
    removed = None
    if track is not None and len(track) > 0:
        removed = float((np.diff(np.concatenate(([0.0], track.s_mm))) * track.section_mm2).sum())
    return ScheduledRegion(
        lines=(part.region.first_line, part.region.last_line),
        kept=part.kept,
        spindle_rev_per_min=part.spindle_rev_per_min,
        radial_depth_mm=None if track is None else float(track.radial_depth_mm.max(initial=0.0)),
        removal_mm3=removed,
        misses=tuple(misses),
        resultant_force_n=None if load is None else _resultants([load]),
    )


def _misses(
    part: SurveyedRegion, plan: FeedPlan | None, load: PathLoad | None, machine: Machine
) -> Iterator[tuple[str, float]]:
    """Limits that the region does not keep behind the schedule: in words, and the share that is too much.

    The share counts where a lower feed could help: not where feeds stay, or are the least already.
    """
    if load is None or part.tool is None or part.track is None:
        return
    helped = np.zeros(len(load.s_mm), dtype=bool) if plan is None else ~np.isin(plan.holds, (KEPT, MINIMUM))
    for column, words, unit, limit in exceeded(part.tool, load.emitted, machine):
        values = getattr(load.emitted, column)
        worst = int(np.argmax(values))
        line = int(part.region.path.segment_lines[part.track.segment[worst]])
        cause = ""
        if plan is None or plan.holds[worst] == KEPT:
            cause = ", where the feed stays as it was: lower it yourself"
        elif plan.holds[worst] == MINIMUM:
            cause = ", at the least feed"
        said = f"{words} {float(values[worst]):.4g} {unit} in line {line}, limit {limit:.4g} {unit}{cause}"
        yield said, float(values[helped].max(initial=0.0)) / limit - 1.0


# --- loads ------------------------------------------------------------------------------------------------------------


def _resultants(loads: Sequence[PathLoad]) -> Pair[ResultantForce]:
    return Pair(_resultant([load.original for load in loads]), _resultant([load.emitted for load in loads]))


def _resultant(loads: Sequence[Load]) -> ResultantForce:
    """Mean over the time in material of the mean resultant, and the largest resultant of all."""
    cut = [load.peak_resultant_n > _AIR_N for load in loads]
    time = sum(float(load.time_s[inside].sum()) for load, inside in zip(loads, cut, strict=True))
    impulse = sum(
        float((load.time_s * load.mean_resultant_n)[inside].sum()) for load, inside in zip(loads, cut, strict=True)
    )
    largest = max((float(load.peak_resultant_n.max(initial=0.0)) for load in loads), default=0.0)
    return ResultantForce(impulse / time if time > 0.0 else 0.0, largest)


def _peak(column: str, loads: Sequence[tuple[Callable[[int], str], PathLoad]]) -> PeakLoad:
    """Largest value of a column before and after, and the place of the latter; beside a load what tells its places."""
    original, emitted, place = 0.0, 0.0, ""
    for place_of, load in loads:
        was, now = getattr(load.original, column), getattr(load.emitted, column)
        original = max(original, float(was.max(initial=0.0)))
        if len(now) and float(now.max()) > emitted:
            emitted, place = float(now.max()), place_of(int(np.argmax(now)))
    return PeakLoad(original, emitted, place)


def _places(program: Program, part: SurveyedRegion) -> Callable[[int], str]:
    """File and line of a station of a region."""
    assert part.track is not None
    lines, segment = part.region.path.segment_lines, part.track.segment
    return lambda station: program.place(int(lines[segment[station]]))


def _place(place: str) -> Callable[[int], str]:
    return lambda _station: place


def _air_time(load: Load) -> float:
    return float(load.time_s[load.peak_resultant_n <= _AIR_N].sum())


# --- feeds ------------------------------------------------------------------------------------------------------------


def _feeds(surveyed: Survey, plans: Plans) -> FeedRange:
    """Lowest and highest feed that stands in the written regions."""
    feeds: list[float] = []
    for part, plan in zip(surveyed.regions, plans, strict=True):
        if plan is None:
            feeds += (part.region.path.segment_feeds_mm_per_s * 60.0).tolist()
        else:
            feeds += [stretch.feed_mm_per_min for stretch in plan.stretches]
    return FeedRange(min(feeds), max(feeds)) if feeds else FeedRange(0.0, 0.0)


def _limits(part: SurveyedRegion, plan: FeedPlan | None) -> Iterator[HeldLines]:
    """Ranges of lines, each with its feeds and what holds them."""
    path = part.region.path
    if plan is None:
        feeds = (path.segment_feeds_mm_per_s * 60.0).tolist()
        yield _held(part.region.first_line, part.region.last_line, feeds, KEPT, part.kept)
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
        yield _held(int(lines[indices[0]]), int(lines[indices[-1]]), feeds, hold, reason)


def _held(first: int, last: int, feeds: list[float], hold: str, reason: str) -> HeldLines:
    return HeldLines((first, last), FeedRange(min(feeds), max(feeds)), hold, reason)


def _feeds_of_segments(plan: FeedPlan, path: _core.Path) -> list[list[float]]:
    """The feeds that stand in each segment."""
    ends = np.array([stretch.end_mm for stretch in plan.stretches])
    feeds = [stretch.feed_mm_per_min for stretch in plan.stretches]
    borders = np.concatenate(([0.0], path.segment_ends_mm))
    first = np.searchsorted(ends, borders[:-1] + 1e-6, side="right")
    last = np.searchsorted(ends, borders[1:] - 1e-6)
    most = len(feeds) - 1
    return [feeds[min(a, most) : min(b, most) + 1] for a, b in zip(first, last, strict=True)]


# --- warnings ---------------------------------------------------------------------------------------------------------


def _warnings(surveyed: Survey, plans: Plans, machine: Machine) -> Iterator[str]:
    program = surveyed.program
    yield from program.warnings
    yield from surveyed.warnings
    for tool in {id(part.tool): part.tool for part in surveyed.regions if part.tool is not None}.values():
        own = limits_of(tool, machine, 0.0)
        if not any(np.isfinite(getattr(own, name)) for name in (*LOADS, "feed_per_tooth_mm")):
            yield (
                f"tool {tool.tool.name}: no limit of force, deflection, torque or power is set, so nothing slows "
                "its feed: set one of [limits] in its file; the column before shows what it takes now"
            )
    for part, plan in zip(surveyed.regions, plans, strict=True):
        place = f"{program.place(part.region.first_line)}: {program.lines(part.region)}"
        if part.kept:
            yield f"{place} keep their feeds: {part.kept}"
        if plan is not None:
            yield from _kept_blocks(program.place, part, plan)
            if plan.held_at_minimum.any():
                yield (
                    f"{place}: the limits ask for less than the least feed, which is what is written: take less "
                    "material at once"
                )


def _of_moves(moves: Sequence[KeptMove]) -> list[str]:
    return [f"{move.place}: {miss}" for move in moves for miss in move.misses]


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
