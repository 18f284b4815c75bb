"""The converter: regions of a program shaped, written, read back and judged."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from shapegcode import _core
from shapegcode.conversion.budget import Budget, Load, Spending, measure_load
from shapegcode.conversion.judge import RegionFigures, contour_target, contour_um, measure, summarise
from shapegcode.conversion.rapids.shape import ShapedRapids, rapid_warnings, shape_rapids
from shapegcode.conversion.readback import Placed, read_back
from shapegcode.conversion.warnings import binding_warnings, controller_warnings, region_warnings, worse_warnings
from shapegcode.conversion.write import emit_region, filter_tolerance
from shapegcode.machine import Machine
from shapegcode.model.controller import motion_limits
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import (
    axis_modes,
    machine_warnings,
    region_range_warnings,
)
from shapegcode.program import Program, written_by_shapegcode
from shapegcode.program.compensation import guard_lines, header_lines, read_for_conversion, require_decision
from shapegcode.shaping.grid import Grid, choose_grid

_CONTOUR_MARGIN = 0.95  # of the tolerance: the rest is for rounding and for what the simple bound leaves out
_MOST_PERIODS = 10_000_000  # block periods of a region: what fits into memory with a margin
_HELPED = 0.98  # of what was reached before: less room that brings no more is taken back
_ATTEMPTS = 8  # each with less room for the regions that left the contour tolerance; few need more than two
_COMMENT_WIDTH = 60
# One length, so that the verdict can take its place without moving a line.
_VERDICT_PENDING, _VERDICT_GOOD, _VERDICT_BAD = (
    b"(VERDICT PENDING                )",
    b"(VERDICT WITHIN TOLERANCE       )",
    b"(OUT OF TOLERANCE - DO NOT RUN  )",
)

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, repr=False)
class Conversion:
    """What a conversion made.

    Attributes:
        text: the emitted program.
        report: the figures of the emitted program beside those of the original (see docs/report.md).
        emitted: the emitted program as read back.
        placed: the shaped regions and their places in the emitted text.
    """

    text: bytes
    report: Mapping[str, Any]
    emitted: Program
    placed: tuple[Placed, ...]

    @property
    def within_tolerance(self) -> bool:
        """Whether every region keeps the machine's tolerances."""
        return bool(self.report["within_tolerance"])

    def __repr__(self) -> str:
        """Size and verdict, not the text."""
        verdict = "within tolerance" if self.within_tolerance else "out of tolerance"
        return (
            f"<Conversion of {self.report['program']}: {len(self.placed)} regions, {len(self.text)} bytes, {verdict}>"
        )


def marked_out_of_tolerance(text: bytes) -> bytes:
    """An emitted program that misses a limit which only its caller knows of, with the verdict in its header."""
    return text.replace(_VERDICT_GOOD, _VERDICT_BAD, 1)


def convert(
    program: Program | str | Path,
    machine: Machine,
    *,
    arc_feed_ratio: float | None = None,
    block_period_s: float | None = None,
    budget: Budget | None = None,
    on_progress: Progress = lambda _stage, _done, _total: None,
) -> Conversion:
    """Shape every cutting region of a program, and judge the emitted text by playing it.

    Args:
        program: what to convert, or its file.
        machine: controller, modes, tolerances.
        arc_feed_ratio: feed on arcs relative to the programmed one, reached before the arc; None:
            `shaping.arc_feed_ratio`.
        block_period_s: block period; None: see `choose_grid`.
        budget: what the emitted text may need; None: no limit.
        on_progress: called with stage, regions done and regions in all.

    Returns:
        The emitted text, where its shaped regions stand, and the verdict on it: `ok`, the figures before and after,
        every case that was played.

    Raises:
        ProgramError: the program cannot be read, or a region not be written.
        DesignError: no shaper exists on this grid.
        ArgumentError: a value outside its range, or a budget that no choice fits.
        RoundTripError: the emitted text would not be equivalent: a defect of shapegcode.
    """
    if arc_feed_ratio is not None and not 0.0 < arc_feed_ratio <= 1.0:
        raise _core.ArgumentError(f"arc feed ratio is {arc_feed_ratio:g}, must be above 0 and at most 1")
    if not isinstance(program, Program):
        program = read_for_conversion(program, machine)
    require_decision(program, machine)
    if written_by_shapegcode(program):
        raise _core.ProgramError(
            f"{program.source}:1:1: written by shapegcode already (its header says so): convert the original"
        )
    grid = choose_grid(machine, block_period_s)
    ratio = machine.shaping.arc_feed_ratio if arc_feed_ratio is None else arc_feed_ratio
    program.refuse_endless(_MOST_PERIODS * grid.block_period_s)
    reasons = [_why_kept(region, machine) for region in program.regions]
    room_um = [machine.tolerance.contour_um * _CONTOUR_MARGIN] * len(program.regions)
    spending = None if budget is None else Spending(budget, program, machine)
    # The originals are played on the other cores while this one shapes.
    model = MachineModel(machine)
    pool = ThreadPoolExecutor(max_workers=os.cpu_count() or 1)
    try:
        playbacks = [
            pool.submit(model.play_original, region.path, offset=model.offset(region)) for region in program.regions
        ]
        settle = partial(
            _settle, program, machine, arc_feed_ratio=ratio, room_um=room_um, playbacks=playbacks, pool=pool,
            spending=spending, on_progress=on_progress,
        )  # fmt: skip
        if spending is not None and spending.budget.limits_rate and block_period_s is None:
            weights = [float(play.result().residual_mm.max()) for play in playbacks]
            grid = spending.choose_period(
                grid, weights, lambda period_s: choose_grid(machine, period_s),
                lambda other: _write(program, machine, other, ratio, reasons, room_um, spending),
            )  # fmt: skip
        written, emitted, figures = settle(grid, reasons)
        while spending is not None and spending.give_up(
            grid, written, summarise(figures, written.placed, machine, grid.block_period_s)
        ):
            reasons = [spending.given_up.get(index, reason) for index, reason in enumerate(reasons)]
            written, emitted, figures = settle(grid, reasons)
        rapids: ShapedRapids | None = None
        if machine.shaping.rapids:
            rapids = shape_rapids(emitted, written.placed, machine, grid, pool, budget)
            written, emitted = replace(written, text=rapids.text, placed=rapids.placed), rapids.emitted
        kept_s = sum(play.result().duration_s for play, reason in zip(playbacks, reasons, strict=True) if reason)
    finally:
        pool.shutdown(cancel_futures=True)
    summary = summarise(figures, written.placed, machine, grid.block_period_s)
    report = _report(program, machine, grid, written, kept_s, summary, spending)
    if rapids is not None:
        report["rapids"] = _tidy(rapids.report)
        report["cycle_time_s"]["emitted"] += rapids.extra_s
        report["warnings"] += rapid_warnings(rapids.report, machine)
    verdict = _VERDICT_GOOD if report["within_tolerance"] else _VERDICT_BAD
    text = written.text.replace(_VERDICT_PENDING, verdict, 1)
    return Conversion(text, report, emitted, tuple(written.placed))


@dataclass(frozen=True)
class _Written:
    """The emitted text before it is judged.

    Per index of a shaped region: `planned_um`, the deviation that its feed was planned for, µm, where the contour is
    kept by a target; and, only under a budget, `loads`.
    """

    text: bytes
    placed: list[Placed]
    blocks: int
    kept_warnings: list[str]
    planned_um: dict[int, float]
    loads: dict[int, Load]


def _settle(
    program: Program,
    machine: Machine,
    grid: Grid,
    reasons: list[str],
    *,
    arc_feed_ratio: float,
    room_um: list[float],
    playbacks: list[Future[_core.PlaybackFigures]],
    pool: Executor,
    spending: Spending | None,
    on_progress: Progress,
) -> tuple[_Written, Program, list[RegionFigures]]:
    """Write, read back and play; again, slower, where a region left the contour tolerance."""
    originals = [playback for playback, reason in zip(playbacks, reasons, strict=True) if not reason]
    tried: dict[int, _Tried] = {}
    for attempt in range(_ATTEMPTS):
        stage = partial(on_progress, "shaping" if attempt == 0 else "shaping again, slower")
        written = _write(program, machine, grid, arc_feed_ratio, reasons, room_um, spending, stage)
        emitted = read_back(written.text, written.placed, machine)
        figures = measure(emitted, written.placed, originals, machine, pool, partial(on_progress, "round trip"))
        if attempt + 1 == _ATTEMPTS or not _tighten(room_um, tried, program, written, figures, machine):
            break
    return written, emitted, figures


@dataclass
class _Tried:
    """The last room of a region that left the tolerance, what it then reached, µm, and whether less room helps."""

    room_um: float
    reached_um: float
    helps: bool = True


def _tighten(
    room_um: list[float],
    tried: dict[int, _Tried],
    program: Program,
    written: _Written,
    figures: list[RegionFigures],
    machine: Machine,
) -> bool:
    """Give regions that left the contour tolerance less room, so that they run slower. False if there is none.

    The bound on feed counts corners and arcs one by one; where several fall into one shaper they add up. Where the feed
    was searched for a target, what it was planned for counts: more room than that would change nothing. A region that
    less room does not help gets its room back: slower would only be slower.
    """
    limit = machine.tolerance.contour_um
    places = {id(region): index for index, region in enumerate(program.regions)}
    tightened = False
    for place, region in zip(written.placed, figures, strict=True):
        reached = contour_um(region, machine)
        index = places[id(place.region)]
        before = tried.get(index)
        if reached <= limit or (before is not None and not before.helps):
            continue
        tightened = True
        if before is not None and reached > _HELPED * before.reached_um:
            room_um[index] = before.room_um
            before.helps = False
        else:
            tried[index] = _Tried(room_um[index], reached)
            room_um[index] = min(room_um[index], written.planned_um.get(index, math.inf))
            room_um[index] *= _CONTOUR_MARGIN * limit / reached
    return tightened


def _write(
    program: Program,
    machine: Machine,
    grid: Grid,
    arc_feed_ratio: float,
    reasons: list[str],
    room_um: list[float],
    spending: Spending | None = None,
    on_progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> _Written:
    core = program.core
    regions = program.regions
    line_end = core.line_end.encode()
    parts: list[bytes] = []
    line = 1

    def put(piece: bytes) -> None:
        nonlocal line
        parts.append(piece)
        line += piece.count(b"\n")

    put(core.slice(0, core.header_offset))
    if machine.emission.header and not all(reasons):
        head = [*_header(machine, grid), *(f"({note})" for note in header_lines(core.expanded_radii_mm))]
        put(b"".join(comment.encode() + line_end for comment in head))
    put(b"".join(guard.encode() + line_end for guard in guard_lines(core.expanded_radii_mm, machine)))
    position = core.header_offset
    placed: list[Placed] = []
    kept: list[str] = []
    planned_um: dict[int, float] = {}
    loads: dict[int, Load] = {}
    blocks = 0
    for done, (region, reason, room) in enumerate(zip(regions, reasons, room_um, strict=True), start=1):
        put(core.slice(position, region.text_begin))
        position = region.text_end
        if reason:
            if spending is None or done - 1 not in spending.given_up:  # it has a sentence for all of them
                kept.append(_keep(program, region, machine, reason))
            put(core.slice(region.text_begin, region.text_end))
            continue
        try:
            limits = motion_limits(machine, arc_feed_ratio=arc_feed_ratio)
            shaped = emit_region(program, region, machine, grid, limits, filter_tolerance(machine, grid, room))
        except _core.ArgumentError as error:
            raise program.region_error(region, str(error)) from error
        first = line
        put(shaped.text)
        placed.append(Placed(region, first, line - 1))
        blocks += shaped.blocks
        if shaped.planned_um > 0.0:
            planned_um[done - 1] = shaped.planned_um
        if spending is not None:
            loads[done - 1] = measure_load(region, shaped, grid, machine)
        on_progress(done, len(regions))
    put(core.slice(position, core.size))
    return _Written(b"".join(parts), placed, blocks, kept, planned_um, loads)


def _why_kept(region: _core.Region, machine: Machine) -> str:
    """Why a region cannot be written as shaped blocks; empty if it can."""
    slowest = region.path.slowest_feed_mm_per_s * 60.0
    least = machine.controller.minimum_feed_mm_per_min
    if slowest < least * (1 - 1e-9):
        return f"feed {slowest:g} mm/min is below controller.minimum_feed_mm_per_min = {least:g}"
    return ""


def _keep(program: Program, region: _core.Region, machine: Machine, reason: str) -> str:
    """The warning for a region that keeps its text."""
    if machine.input.arc_centre == "absolute" and region.path.largest_sweep_rad > 0.0:
        raise program.region_error(region, f"{reason}; its arcs have absolute centres and cannot be kept as they are")
    return f"{program.place(region.first_line)}: {program.lines(region)} kept untouched: {reason}"


def _header(machine: Machine, grid: Grid) -> list[str]:
    from shapegcode import __version__

    modes = [
        f"{axis} {mode.frequency_hz:g} HZ {mode.damping_ratio:g}"
        for axis, modes in zip("XYZ", axis_modes(machine), strict=True)
        for mode in modes
    ]
    lines = [
        f"SHAPEGCODE {__version__} MACHINE {machine.name}",
        *(f"MODE {mode}" for mode in modes),
        f"BLOCK PERIOD {grid.block_period_s * 1e3:g} MS SHAPER {grid.duration_s * 1e3:g} MS",
        *([f"{len(grid.track.nodes)} SHAPERS FOLLOW {'XYZ'[grid.track.axis]}"] if grid.track else []),
        "SET FEED OVERRIDE 100 PCT",
        f"TIME CONSTANT AFTER INTERPOLATION {machine.controller.shaped_time_constant_s * 1e3:g} MS",
    ]
    first, *rest = (f"({_plain(line)[:_COMMENT_WIDTH]})" for line in lines)
    return [first, _VERDICT_PENDING.decode(), *rest]


def _plain(text: str) -> str:
    """Only what a FANUC comment may hold: capitals, digits and plain signs."""
    return "".join(c if c.isalnum() or c in " .-" else " " for c in text.upper())


def _report(
    program: Program,
    machine: Machine,
    grid: Grid,
    written: _Written,
    kept_s: float,
    figures: dict[str, Any],
    spending: Spending | None,
) -> dict[str, Any]:
    placed = written.placed
    warnings = [*program.warnings, *written.kept_warnings, *machine_warnings(machine)]
    warnings += [grid.note] if grid.note else []
    warnings += region_range_warnings(program.regions, machine)
    cutting = {
        which: sum(region["time_s"][which] for region in figures["regions"]) for which in ("original", "emitted")
    }
    other = kept_s + MachineModel(machine).other_time_s(program.core)
    prefill = machine.emission.prefill_dwell_s * len(placed)
    if spending is not None and (sentence := spending.warning(grid)):
        warnings.append(sentence)
    elif not placed:
        warnings.append(f"{program.source}: no cutting moves that can be shaped: the text is unchanged")
    for region in figures["regions"]:
        first, last = region["lines"]
        where = f"{program.place(first)}: lines {first} to {last}" + (" expanded" if program.core.expanded else "")
        warnings += [f"{where}: {miss}" for miss in region["misses"]]
    warnings += binding_warnings(figures, machine)
    warnings += worse_warnings(figures)
    warnings += region_warnings(program, placed, machine)
    warnings += controller_warnings(machine, written.text, cutting["emitted"], written.blocks, figures["slowed_blocks"])
    report = {
        "program": program.source,
        "machine": machine.name,
        "cycle_time_s": {
            "original": cutting["original"] + other,
            "emitted": cutting["emitted"] + other + prefill,
        },
        "cutting_time_s": cutting,
        "block_period_s": grid.block_period_s,
        "shaper": {
            "times_s": [float(t) for t in grid.shaper.times_s],
            "amplitudes": [float(a) for a in grid.shaper.amplitudes],
            "family": grid.family,
            "duration_s": grid.duration_s,
            "per_axis": [{"delays": list(fir.delays), "taps": list(fir.taps)} for fir in grid.axis_firs],
            "per_axis_duration_s": grid.per_axis_duration_s,
        },
        "blocks": {"read": program.core.block_count, "emitted": written.blocks},
        "expanded": program.core.expanded,
        "expanded_radii_mm": {f"D{number}": radius for number, radius in program.core.expanded_radii_mm.items()},
        "bytes_read": program.core.size,
        "bytes_emitted": len(written.text),
        **figures,
        "limits": {
            "contour_um": machine.tolerance.contour_um,
            "contour_target": contour_target(machine),
            "residual_ratio": machine.tolerance.residual_ratio,
            "residual_floor_um": machine.tolerance.residual_floor_um,
            "residual_floor_increments": machine.tolerance.residual_floor_increments,
        },
        "within_tolerance": not any(region["misses"] for region in figures["regions"]),
        "warnings": warnings,
    }
    if spending is not None:
        report["budget"] = spending.report(grid, written)
    keep = report.pop("shaper")
    if grid.track is not None:
        keep["following"] = {
            "axis": "xyz"[grid.track.axis],
            "position_mm": [node.position_mm for node in grid.track.nodes],
            "times_s": [[float(t) for t in node.shaper.times_s] for node in grid.track.nodes],
            "amplitudes": [[float(a) for a in node.shaper.amplitudes] for node in grid.track.nodes],
            "worst_residual": grid.track.worst_residual,
        }
    return {**_tidy(report), "shaper": keep}


def _tidy(value: Any) -> Any:
    """Numbers as a person would write them: nine digits, and nothing below a millionth of a micrometre."""
    if isinstance(value, dict):
        return {key: _tidy(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_tidy(entry) for entry in value]
    if isinstance(value, float):
        return 0.0 if abs(value) < 1e-9 else float(f"{value:.9g}")
    return value
