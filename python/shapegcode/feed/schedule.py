"""Feed scheduling: a program with the highest feeds that keep every limit of the cut, and what that gains."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from shapegcode import _core
from shapegcode.cutting.stock import Stock
from shapegcode.cutting.tool import Tool
from shapegcode.errors import RoundTripError
from shapegcode.feed.figures import feed_figures
from shapegcode.feed.load import PathLoad, region_load
from shapegcode.feed.plan import FeedPlan, Mover, OrdinaryMotion, plan_region
from shapegcode.feed.result import FeedSchedule
from shapegcode.feed.survey import Survey, survey
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.program import MM_PER_INCH, Program, least_increment_mm
from shapegcode.results.result import Pair

MARGIN = 0.015
"""Share of each limit that a schedule leaves free: for what model and position of the load are off by."""

_SWEEPING = 0.5  # share of the progress bar; of the rest for planning
_PLANNING = 0.7
_SAME_PLACE_INCREMENTS = 1.0
_COMMENT = re.compile(rb"\([^)]*\)")
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
    """Set the feeds of a program so that force, deflection, torque, power and chip stay within the tool's limits.

    Args:
        program: what to schedule, or its file.
        machine: whose controller runs it.
        tools: the tool, or several with their T numbers.
        stock: what is there before the first block.
        motion: how the feeds will be run; None: as the controller runs an ordinary program.
        margin: share of each limit that is left free.
        resolution_mm: grid of the material; None: a hundredth of the tool's diameter.
        on_progress: called with the share that is done, 0 to 1.

    Returns:
        The text with its new feeds, and time, force and load before and after.

    Raises:
        ProgramError: the program cannot be read.
        ArgumentError: a value outside its range, no tool, no cutting move.
        StockError: the stock does not suit the program.
        RoundTripError: the written text would not be equivalent: a defect of shapegcode.

    Source: this project; the force model and feeds that follow the force are those of Kim and Ko, 2001 (paper 001).
    """
    machine = Machine.of(machine)
    surveyed = survey(
        program,
        machine,
        tools,
        stock,
        resolution_mm=resolution_mm,
        on_progress=lambda done, total: on_progress(_SWEEPING * done / max(total, 1)),
    )
    return schedule_survey(
        surveyed,
        machine,
        motion=motion,
        margin=margin,
        on_progress=lambda done: on_progress(_SWEEPING + (1.0 - _SWEEPING) * done),
    )


def schedule_survey(
    surveyed: Survey,
    machine: Machine,
    *,
    motion: Mover | None = None,
    margin: float = MARGIN,
    on_progress: Progress = lambda _done: None,
) -> FeedSchedule:
    """As :func:`schedule_feed`, for a program whose engagement is known already."""
    if not 0.0 <= margin < 1.0:
        raise _core.ArgumentError(f"margin is {margin:g}, must be at least 0 and below 1")
    program = surveyed.program
    ordinary = OrdinaryMotion(machine)
    own = motion or ordinary
    total = max(len(surveyed.regions), 1)
    plans = _plan_all(surveyed, machine, own, margin, lambda done: on_progress(_PLANNING * done / total))
    text, places, blocks = _write(program, plans, machine)
    written = _read_back(text, program, places, machine)
    loads: list[PathLoad | None] = []
    for index, (plan, part) in enumerate(zip(plans, surveyed.regions, strict=True)):
        path = written.regions[index].path
        loads.append(region_load(part, plan, path, machine, before=ordinary, after=own))
        on_progress(_PLANNING + (1.0 - _PLANNING) * (index + 1) / total)
    return feed_figures(
        surveyed, plans, loads, machine, margin=margin, text=text, written=written,
        cycle_time_s=Pair(*(MachineModel(machine).cycle_time_s(each.core) for each in (program, written))),
        blocks=Pair(sum(region.blocks for region in program.regions), blocks),
    )  # fmt: skip


def _plan_all(
    surveyed: Survey, machine: Machine, motion: Mover, margin: float, on_progress: Callable[[int], None]
) -> list[FeedPlan | None]:
    """Plans of the regions, each on its own: two at a time, as they share nothing."""
    program = surveyed.program

    def plan(index: int) -> FeedPlan | None:
        part = surveyed.regions[index]
        if part.kept or part.track is None or len(part.track) == 0:
            return None
        options = _writer_options(part.region, machine)
        divisible = _core.divisible_segments(program.core, part.region, options)
        return plan_region(part, machine, motion, divisible, margin, _feed_unit_mm_per_min(part.region, machine))

    plans: list[FeedPlan | None] = []
    with ThreadPoolExecutor(max_workers=2) as pool:
        for done, result in enumerate(pool.map(plan, range(len(surveyed.regions)))):
            plans.append(result)
            on_progress(done + 1)
    return plans


def _writer_options(
    region: _core.Region, machine: Machine, *, modal_feed: float = 0.0, restore_feed: bool = True
) -> _core.FeedWriterOptions:
    unit = MM_PER_INCH if region.exit.units == 20 else 1.0
    increment = least_increment_mm(machine, region.exit.units)
    return _core.FeedWriterOptions(
        increment_mm=increment,
        unit_mm=unit,
        position_decimals=-round(math.log10(increment / unit)),
        absolute_centres=machine.input.arc_centre == "absolute",
        modal_feed=modal_feed,
        restore_feed=restore_feed,
    )


def _feed_unit_mm_per_min(region: _core.Region, machine: Machine) -> float:
    """Step of the F word, mm/min."""
    if region.exit.units == 20:
        return MM_PER_INCH * 10.0**-machine.controller.feed_decimals_inch
    return 10.0**-machine.controller.feed_decimals_mm


def _write(program: Program, plans: Sequence[FeedPlan | None], machine: Machine) -> tuple[bytes, list[int], int]:
    """The text, per region its first line there, and the number of cutting blocks."""
    core = program.core
    parts: list[bytes] = []
    places: list[int] = []
    line, position, blocks = 1, 0, 0
    modal_feed = 0.0  # where it is not that of the original
    for index, (region, plan) in enumerate(zip(program.regions, plans, strict=True)):
        between = core.slice(position, region.text_begin)
        line += between.count(b"\n")
        places.append(line)
        text = core.slice(region.text_begin, region.text_end)
        if plan is None:
            blocks += region.blocks
            modal_feed = 0.0
        else:
            restore = not _says_its_own_feed(program, plans, index)
            options = _writer_options(region, machine, modal_feed=modal_feed, restore_feed=restore)
            refed = _core.write_feeds(core, region, list(plan.stretches), options)
            text = refed.text
            blocks += refed.blocks
            modal_feed = 0.0 if restore else refed.modal_feed
        parts += [between, text]
        line += text.count(b"\n")
        position = region.text_end
    parts.append(core.slice(position, core.size))
    return b"".join(parts), places, blocks


def _says_its_own_feed(program: Program, plans: Sequence[FeedPlan | None], index: int) -> bool:
    """Whether the region behind one is written too, and nothing in between could need the modal feed."""
    if index + 1 == len(plans) or plans[index + 1] is None:
        return False
    here, following = program.regions[index], program.regions[index + 1]
    between = _COMMENT.sub(b"", program.core.slice(here.text_end, following.text_begin))
    return here.exit.units == following.entry.units and not _NEEDS_FEED.search(between.upper())


def _read_back(text: bytes, program: Program, places: Sequence[int], machine: Machine) -> Program:
    """The written text as a program; its regions must be those of the original, by place, length and end."""
    try:
        emitted = Program.from_text(text, machine, source="the written program", emitted=True)
    except _core.ProgramError as error:
        raise RoundTripError(f"the written program cannot be read: {error}") from error
    if len(emitted.regions) != len(program.regions):
        raise RoundTripError(f"{len(program.regions)} regions were read, {len(emitted.regions)} were written")
    for before, after, line in zip(program.regions, emitted.regions, places, strict=True):
        increment = least_increment_mm(machine, before.exit.units)
        off = max(abs(float(d)) for d in before.path[-1].end_mm - after.path[-1].end_mm)
        longer = abs(before.path.length_mm - after.path.length_mm)
        if after.first_line != line or off > 1e-6 or longer > _SAME_PLACE_INCREMENTS * increment * len(after.path):
            raise RoundTripError(
                f"{program.lines(before)}: written from line {line}, read back from line {after.first_line}; ends "
                f"{off:g} mm apart, lengths differ by {longer:g} mm"
            )
    return replace(emitted, source=program.source, unexpanded=None)
