"""Feed scheduling: a program with the highest feeds within every limit of the cut, and its gain."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import groupby
from pathlib import Path

import numpy as np

from shapegcode import _core
from shapegcode.cutting.stock import Stock
from shapegcode.cutting.tool import Tool
from shapegcode.errors import RoundTripError
from shapegcode.feed import result
from shapegcode.feed.load import LOADS, Load, PathLoad, exceeded, move_load, region_load
from shapegcode.feed.plan import AIR, KEPT, MINIMUM, FeedPlan, Mover, OrdinaryMotion, limits_of, plan_region
from shapegcode.feed.result import FeedSchedule
from shapegcode.feed.survey import COMMENT, Survey, SurveyedMove, SurveyedRegion, survey
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.programs import SimulatedPrograms
from shapegcode.program import MM_PER_INCH, Program, least_increment_mm
from shapegcode.program.compensation import program_for_conversion
from shapegcode.results.outcome import Pair

MARGIN = 0.015  # safety margin to each limit of the load, for errors of the model and the load's position

_SWEEPING = 0.5  # fraction of the progress bar
_PLANNING = 0.7  # fraction of the rest
_NEEDS_FEED = re.compile(rb"F|G0*[123](?!\d)|G\s*[78]\d|G\s*6[56]|M\s*\d*9[789]|[#<]")  # cuts, cycles, calls

Progress = Callable[[float], None]


def schedule_feed(
    program: Program | str | Path,
    machine: Machine | str | Path,
    tools: Tool | Sequence[Tool],
    stock: Stock,
    *,
    motion: Mover | None = None,
    margin: float = MARGIN,
    resolution_mm: float | None = None,
    on_progress: Progress = lambda _done: None,
) -> FeedSchedule:
    """Set the feeds of a program so that force, deflection, torque, power and chip keep the limits of tool and spindle.

    Args:
        program: the program, or its file.
        machine: machine whose controller runs it.
        tools: the tool, or several with their T numbers.
        stock: stock before the first block.
        motion: motion at the new feeds; None: the controller's own, as for an ordinary program.
        margin: safety margin to each limit of the load, as a ratio; the limit of the feed per tooth has no margin.
        resolution_mm: grid spacing of the simulated material; None: a hundredth of the smallest tool's diameter.
        on_progress: called with the completed fraction, 0 to 1.

    Returns:
        The program text with its new feeds; time, force and load before and after.

    Raises:
        ProgramError: the program cannot be read, or was shaped already.
        ArgumentError: a value outside its range, no tool, no cutting move.
        StockError: the stock does not suit the program.
        RoundTripError: the new program would not be equivalent: a defect of shapegcode.

    Source: this project; the force model and force-controlled feeds are those of Kim and Ko, 2001 (paper 001).
    """
    machine = Machine.of(machine)
    program = program_for_conversion(program, machine)
    program.refuse_shaped("other feeds would undo that; take the original, convert --feed-schedule does both")
    surveyed = survey(
        program, machine, tools, stock, resolution_mm=resolution_mm,
        on_progress=lambda done, total: on_progress(_SWEEPING * done / total),
    )  # fmt: skip
    return schedule_survey(
        surveyed, machine, motion=motion, margin=margin,
        on_progress=lambda done: on_progress(_SWEEPING + (1.0 - _SWEEPING) * done),
    )  # fmt: skip


def schedule_survey(
    surveyed: Survey,
    machine: Machine,
    *,
    motion: Mover | None = None,
    margin: float = MARGIN,
    on_progress: Progress = lambda _done: None,
) -> FeedSchedule:
    """Like :func:`schedule_feed`, for a program with known engagement."""
    if not 0.0 <= margin < 1.0:
        raise _core.ArgumentError(f"margin is {margin:g}, must be at least 0 and below 1")
    program = surveyed.program
    ordinary = OrdinaryMotion(machine)
    own = motion or ordinary
    total = max(len(surveyed.regions), 1)
    plans = _plan_all(surveyed, machine, own, margin, lambda done: on_progress(_PLANNING * done / total))
    text, first_lines, blocks = _write(program, plans, machine)
    written = _read_back(text, program, first_lines, machine)
    loads: list[PathLoad | None] = []
    for index, (plan, part) in enumerate(zip(plans, surveyed.regions, strict=True)):
        path = written.regions[index].path
        loads.append(region_load(part, plan, path, before=ordinary, after=own))
        on_progress(_PLANNING + (1.0 - _PLANNING) * (index + 1) / total)
    return feed_figures(
        surveyed, plans, loads, machine, margin=margin, text=text, written=written,
        cycle_time_s=Pair(*(MachineModel(machine).cycle_time_s(each.core) for each in (program, written))),
        blocks=Pair(sum(region.blocks for region in program.regions), blocks),
    )  # fmt: skip


def _plan_all(
    surveyed: Survey, machine: Machine, motion: Mover, margin: float, on_progress: Callable[[int], None]
) -> list[FeedPlan | None]:
    program = surveyed.program

    def plan(part: SurveyedRegion) -> FeedPlan | None:
        if part.kept or part.track is None or len(part.track) == 0:
            return None
        options = _writer_options(program, part.region, machine)
        divisible = _core.divisible_segments(program.core, part.region, options)
        control = machine.controller
        feed_unit_mm_per_min = 10.0**-control.feed_decimals_mm
        if part.region.exit.units == 20:
            feed_unit_mm_per_min = MM_PER_INCH * 10.0**-control.feed_decimals_inch
        return plan_region(part, machine, motion, divisible, margin, feed_unit_mm_per_min)

    plans: list[FeedPlan | None] = []
    with ThreadPoolExecutor(max_workers=2) as pool:
        for found in pool.map(plan, surveyed.regions):
            plans.append(found)
            on_progress(len(plans))
    return plans


def _writer_options(
    program: Program, region: _core.Region, machine: Machine, *, modal_feed: float = 0.0, restore_feed: bool = True
) -> _core.FeedWriterOptions:
    unit = MM_PER_INCH if region.exit.units == 20 else 1.0
    increment = least_increment_mm(machine, region.exit.units)
    return _core.FeedWriterOptions(
        increment_mm=increment,
        unit_mm=unit,
        position_decimals=-round(math.log10(increment / unit)),
        absolute_centres=program.has_absolute_arc_centres,
        modal_feed=modal_feed,
        restore_feed=restore_feed,
    )


def _write(program: Program, plans: Sequence[FeedPlan | None], machine: Machine) -> tuple[bytes, list[int], int]:
    core = program.core
    parts: list[bytes] = []
    first_lines: list[int] = []
    line, position, blocks = 1, 0, 0
    modal_feed = 0.0  # the active F if it is not that of the original
    for index, (region, plan) in enumerate(zip(program.regions, plans, strict=True)):
        between = core.slice(position, region.text_begin)
        line += between.count(b"\n")
        first_lines.append(line)
        text = core.slice(region.text_begin, region.text_end)
        if plan is None:
            blocks += region.blocks
            modal_feed = 0.0
        else:
            restore = not _says_its_own_feed(program, plans, index)
            options = _writer_options(program, region, machine, modal_feed=modal_feed, restore_feed=restore)
            refed = _core.write_feeds(core, region, list(plan.stretches), options)
            text = refed.text
            blocks += refed.blocks
            modal_feed = 0.0 if restore else refed.modal_feed
        parts += [between, text]
        line += text.count(b"\n")
        position = region.text_end
    parts.append(core.slice(position, core.size))
    return b"".join(parts), first_lines, blocks


def _says_its_own_feed(program: Program, plans: Sequence[FeedPlan | None], index: int) -> bool:
    """Whether the next region is written with its own feed, and no block between the regions uses the modal feed."""
    if index + 1 == len(plans) or plans[index + 1] is None:
        return False
    here, following = program.regions[index], program.regions[index + 1]
    between = COMMENT.sub(b"", program.core.slice(here.text_end, following.text_begin))
    return here.exit.units == following.entry.units and not _NEEDS_FEED.search(between.upper())


def _read_back(text: bytes, program: Program, first_lines: Sequence[int], machine: Machine) -> Program:
    """Read the new text back; regions must start at `first_lines`, with original length and end."""
    try:
        emitted = Program.from_text(
            text, machine, source="the written program", emitted=True,
            absolute_arc_centres=program.has_absolute_arc_centres,
        )  # fmt: skip
    except _core.ProgramError as error:
        raise RoundTripError(f"the written program cannot be read: {error}") from error
    if len(emitted.regions) != len(program.regions):
        raise RoundTripError(f"{len(program.regions)} regions were read, {len(emitted.regions)} were written")
    for before, after, line in zip(program.regions, emitted.regions, first_lines, strict=True):
        increment = least_increment_mm(machine, before.exit.units)
        off = max(abs(float(d)) for d in before.path[-1].end_mm - after.path[-1].end_mm)
        longer = abs(before.path.length_mm - after.path.length_mm)
        if after.first_line != line or off > 1e-6 or longer > increment * len(after.path):
            raise RoundTripError(
                f"{program.lines(before)}: written from line {line}, read back from line {after.first_line}; ends "
                f"{off:g} mm apart, lengths differ by {longer:g} mm"
            )
    return replace(emitted, source=program.source, unexpanded=None)


_AIR_N = 1e-9
_SHOWN_ALIKE = 4

Plans = Sequence[FeedPlan | None]
Loads = Sequence[PathLoad | None]


def feed_figures(
    surveyed: Survey, plans: Plans, loads: Loads, machine: Machine, *, margin: float, text: bytes, written: Program,
    cycle_time_s: Pair[float], blocks: Pair[int],
) -> FeedSchedule:  # fmt: skip
    """Build the result of a schedule."""
    program = surveyed.program
    moves = tuple(_move(move, machine) for move in surveyed.moves)
    parts = list(zip(surveyed.regions, plans, loads, strict=True))
    placed: list[tuple[SurveyedRegion | result.KeptMove, PathLoad]]
    placed = [(part, load) for part, _, load in parts if load is not None]
    placed += [(move, move.load) for move in moves if move.load is not None]
    known = [load for _, load in placed]
    excess = max((share for part, plan, load in parts for _, share in _misses(part, plan, load, machine)), default=0.0)
    return FeedSchedule(
        program=program.source,
        machine=machine.name,
        tools=tuple(sorted({part.tool.tool.name for part in surveyed.regions if part.tool is not None})),
        margin=margin,
        feed_mm_per_min=_feeds(surveyed, plans),
        resultant_force_n=_resultants(known),
        peak=result.PeakLoads(**{column: _peak(column, placed, program) for column in LOADS}),
        cycle_time_s=cycle_time_s,
        air_time_s=Pair(
            sum(_air_time(load.original) for load in known), sum(_air_time(load.emitted) for load in known)
        ),
        blocks=blocks,
        limits=tuple(entry for part, plan, _ in parts for entry in _limits(part, plan)),
        regions=tuple(_region(part, plan, load, machine) for part, plan, load in parts),
        moves=moves,
        excess_ratio=max(excess, 0.0),
        warnings=tuple(_shortened(_warnings(surveyed, plans, moves, machine), program.source)),
        text=text,
        written=written,
        survey=surveyed,
        plans=tuple(plans),
        loads=tuple(loads),
        simulated=SimulatedPrograms(program, machine, written),
    )


def _move(move: SurveyedMove, machine: Machine) -> result.KeptMove:
    load = move_load(move)
    misses = ["its force is unknown: no spindle speed"]
    if load is not None:
        misses = [
            f"cut at its old feed: {words} {getattr(load.emitted, column).max():.4g} {unit}, limit {limit:.4g} {unit}"
            for column, words, unit, limit in exceeded(move.tool, load.emitted, machine)
        ]
    return result.KeptMove(move.place, move.feed_mm_per_min, tuple(misses), load)


def _region(
    part: SurveyedRegion, plan: FeedPlan | None, load: PathLoad | None, machine: Machine
) -> result.ScheduledRegion:
    track = part.track
    misses = [words for words, _ in _misses(part, plan, load, machine)]
    if load is None and track is not None and track.section_mm2.any():
        misses = [f"its force is unknown: {part.kept or 'reason unknown'}"]
    removed = None
    if track is not None and len(track) > 0:
        removed = float((np.diff(np.concatenate(([0.0], track.s_mm))) * track.section_mm2).sum())
    return result.ScheduledRegion(
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
    """Messages for limits that are still exceeded, each with the relative excess that a lower feed could reduce."""
    if load is None or part.tool is None or part.track is None:
        return
    helped = np.zeros(len(load.s_mm), dtype=bool) if plan is None else ~np.isin(plan.holds, (KEPT, MINIMUM))
    for column, words, unit, limit in exceeded(part.tool, load.emitted, machine):
        values = getattr(load.emitted, column)
        worst = int(np.argmax(values))
        line = int(part.region.path.segment_lines[part.track.segment[worst]])
        cause = ""
        if plan is None or plan.holds[worst] == KEPT:
            cause = ", where the feed is left unchanged: reduce it in the program"
        elif plan.holds[worst] == MINIMUM:
            cause = ", at the lowest feed"
        message = f"{words} {float(values[worst]):.4g} {unit} in line {line}, limit {limit:.4g} {unit}{cause}"
        yield message, float(values[helped].max(initial=0.0)) / limit - 1.0


def _resultants(loads: Sequence[PathLoad]) -> Pair[result.ResultantForce]:
    return Pair(_resultant([load.original for load in loads]), _resultant([load.emitted for load in loads]))


def _resultant(loads: Sequence[Load]) -> result.ResultantForce:
    """Mean resultant, averaged over the time in the material, and largest resultant, of all loads together."""
    cut = [load.peak_resultant_n > _AIR_N for load in loads]
    parts = list(zip(loads, cut, strict=True))
    time = sum(float(load.time_s[inside].sum()) for load, inside in parts)
    impulse = sum(float((load.time_s * load.mean_resultant_n)[inside].sum()) for load, inside in parts)
    largest = max((float(load.peak_resultant_n.max(initial=0.0)) for load in loads), default=0.0)
    return result.ResultantForce(impulse / time if time > 0.0 else 0.0, largest)


def _peak(
    column: str, loads: Sequence[tuple[SurveyedRegion | result.KeptMove, PathLoad]], program: Program
) -> result.PeakLoad:
    """Largest value of a column before and after, and where."""
    original, emitted, place = 0.0, 0.0, ""
    for part, load in loads:
        was, now = getattr(load.original, column), getattr(load.emitted, column)
        original = max(original, float(was.max(initial=0.0)))
        if len(now) and float(now.max()) > emitted:
            emitted, place = float(now.max()), _place(program, part, int(np.argmax(now)))
    return result.PeakLoad(original, emitted, place)


def _place(program: Program, part: SurveyedRegion | result.KeptMove, station: int) -> str:
    if isinstance(part, result.KeptMove):
        return part.place
    assert part.track is not None
    return program.place(int(part.region.path.segment_lines[part.track.segment[station]]))


def _air_time(load: Load) -> float:
    return float(load.time_s[load.peak_resultant_n <= _AIR_N].sum())


def _feeds(surveyed: Survey, plans: Plans) -> result.FeedRange:
    feeds: list[float] = []
    for part, plan in zip(surveyed.regions, plans, strict=True):
        if plan is None:
            feeds += (part.region.path.segment_feeds_mm_per_s * 60.0).tolist()
        else:
            feeds += [stretch.feed_mm_per_min for stretch in plan.stretches]
    return _range(feeds)


def _range(feeds: Sequence[float]) -> result.FeedRange:
    return result.FeedRange(min(feeds, default=0.0), max(feeds, default=0.0))


def _limits(part: SurveyedRegion, plan: FeedPlan | None) -> Iterator[result.HeldLines]:
    path = part.region.path
    if plan is None:
        feeds = (path.segment_feeds_mm_per_s * 60.0).tolist()
        yield result.HeldLines((part.region.first_line, part.region.last_line), _range(feeds), KEPT, part.kept)
        return
    track = part.track
    assert track is not None
    segment = np.asarray(track.segment)
    starts = np.searchsorted(segment, np.arange(len(path)))
    ends = np.searchsorted(segment, np.arange(len(path)), side="right")
    holds: list[str] = []
    for i in range(len(path)):
        inside = slice(starts[i], ends[i])
        # A block with material is limited by the limit there, even if it begins in air.
        feeds = np.where(plan.holds[inside] == AIR, np.inf, plan.limit_mm_per_min[inside])
        tightest = int(np.argmin(feeds)) if ends[i] > starts[i] else 0
        holds.append(str(plan.holds[inside][tightest]) if ends[i] > starts[i] else KEPT)
    written = _feeds_of_segments(plan, path)
    lines = path.segment_lines
    for (hold, reason), run in groupby(range(len(path)), key=lambda i: (holds[i], plan.kept[i])):
        indices = list(run)
        feeds = [feed for i in indices for feed in written[i]]
        yield result.HeldLines((int(lines[indices[0]]), int(lines[indices[-1]])), _range(feeds), hold, reason)


def _feeds_of_segments(plan: FeedPlan, path: _core.Path) -> list[list[float]]:
    ends = np.array([stretch.end_mm for stretch in plan.stretches])
    feeds = [stretch.feed_mm_per_min for stretch in plan.stretches]
    borders = np.concatenate(([0.0], path.segment_ends_mm))
    first = np.searchsorted(ends, borders[:-1] + 1e-6, side="right")
    last = np.searchsorted(ends, borders[1:] - 1e-6)
    most = len(feeds) - 1
    return [feeds[min(a, most) : min(b, most) + 1] for a, b in zip(first, last, strict=True)]


def _warnings(surveyed: Survey, plans: Plans, moves: Sequence[result.KeptMove], machine: Machine) -> Iterator[str]:
    program = surveyed.program
    yield from program.warnings
    yield from surveyed.warnings
    for tool in {id(part.tool): part.tool for part in surveyed.regions if part.tool is not None}.values():
        own = limits_of(tool, machine, 0.0)
        if not any(np.isfinite(getattr(own, name)) for name in (*LOADS, "feed_per_tooth_mm")):
            yield (
                f"tool {tool.tool.name}: no limit of force, deflection, torque or power is set, so nothing limits its "
                "feed: set one of [limits] in its file; the column before shows the present load"
            )
    for part, plan in zip(surveyed.regions, plans, strict=True):
        place = f"{program.place(part.region.first_line)}: {program.lines(part.region)}"
        if part.kept:
            yield f"{place} keep their feeds: {part.kept}"
        if plan is not None:
            yield from _kept_blocks(program.place, part, plan)
            if (plan.holds == MINIMUM).any():
                yield (
                    f"{place}: the limits need a feed below the lowest feed, which is written instead: reduce "
                    "the depth of cut"
                )
    yield from (f"{move.place}: {miss}" for move in moves for miss in move.misses)


def _kept_blocks(place: Callable[[int], str], part: SurveyedRegion, plan: FeedPlan) -> Iterator[str]:
    lines = part.region.path.segment_lines
    for reason, run in groupby(range(len(lines)), key=lambda i: plan.kept[i]):
        indices = list(run)
        if reason:
            first, last = int(lines[indices[0]]), int(lines[indices[-1]])
            where = "" if first == last else f" to line {last}"
            yield f"{place(first)}{where}: left unchanged: {reason}"


def _shortened(warnings: Iterable[str], source: str) -> list[str]:
    """Each warning once; of many with one reason the first few, and the number of others."""
    shown: list[str] = []
    seen: Counter[str] = Counter()
    for warning in dict.fromkeys(warnings):
        reason = warning.rpartition(": ")[2]
        seen[reason] += 1
        if seen[reason] <= _SHOWN_ALIKE:
            shown.append(warning)
    shown += [
        f"{source}: {number - _SHOWN_ALIKE} more: {reason}" for reason, number in seen.items() if number > _SHOWN_ALIKE
    ]
    return shown
