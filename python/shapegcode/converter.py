"""The converter: regions of a program shaped, written, read back and judged."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shapegcode import _core
from shapegcode.emit import Grid, emit_region, make_grid, motion_limits
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.shaping import choose_block_period, shortest_non_negative
from shapegcode.verify import Placed, axis_modes, measure, other_time_s, play_original, read_back, summarise

_CONTOUR_MARGIN = 0.95  # of the tolerance: the rest is for rounding and for what the simple bound leaves out
_COMMENT_WIDTH = 60

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
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


def choose_grid(machine: Machine, block_period_s: float | None = None) -> Grid:
    """Block period and shortest non-negative shaper for all modes of a machine.

    Args:
        machine: modes and controller.
        block_period_s: a period to use; None: `emission.block_period_s`, or the best one.

    Raises:
        DesignError: no shaper exists within `shaping.max_duration_s`.
        ArgumentError: the machine has no mode, or the period does not fit the controller.
    """
    modes = [mode for axis in axis_modes(machine) for mode in axis]
    if not modes:
        raise _core.ArgumentError("the machine file gives no vibration mode (axes.x.modes): nothing to shape for")
    controller = machine.controller
    period = block_period_s if block_period_s is not None else machine.emission.block_period_s
    if period is None:
        choice = choose_block_period(
            modes, controller.interpolation_period_s, controller.block_time_s,
            max_duration_s=machine.shaping.max_duration_s,
        )  # fmt: skip
        return make_grid(choice.period_s, choice.shaper)
    ticks = period / controller.interpolation_period_s
    if round(ticks) < 1 or not math.isclose(ticks, round(ticks), abs_tol=1e-6):
        raise _core.ArgumentError(
            f"block period {period * 1e3:g} ms is no whole multiple of the interpolation period "
            f"{controller.interpolation_period_s * 1e3:g} ms"
        )
    if period < controller.block_time_s * (1 - 1e-9):
        raise _core.ArgumentError(
            f"block period {period * 1e3:g} ms is below the block time {controller.block_time_s * 1e3:g} ms "
            "(controller.block_time_s)"
        )
    return make_grid(period, shortest_non_negative(modes, period, machine.shaping.max_duration_s))


def convert(
    program: Program | str | Path,
    machine: Machine,
    *,
    arc_feed_ratio: float | None = None,
    block_period_s: float | None = None,
    on_progress: Progress = lambda _stage, _done, _total: None,
) -> Conversion:
    """Shape every cutting region of a program, and judge the emitted text by playing it.

    Args:
        program: what to convert, or its file.
        machine: controller, modes, tolerances.
        arc_feed_ratio: feed on arcs relative to the programmed one, reached before the arc; None:
            `shaping.arc_feed_ratio`.
        block_period_s: block period; None: see `choose_grid`.
        on_progress: called with stage, regions done and regions in all.

    Raises:
        ProgramError: the program cannot be read, or a region not be written.
        DesignError: no shaper exists on this grid.
        ArgumentError: a value outside its range.
        RoundTripError: the emitted text would not be equivalent: a defect of shapegcode.
    """
    if arc_feed_ratio is not None and not 0.0 < arc_feed_ratio <= 1.0:
        raise _core.ArgumentError(f"arc feed ratio is {arc_feed_ratio:g}, must be above 0 and at most 1")
    if not isinstance(program, Program):
        program = Program.read(program, machine)
    grid = choose_grid(machine, block_period_s)
    limits = motion_limits(
        machine,
        arc_feed_ratio=machine.shaping.arc_feed_ratio if arc_feed_ratio is None else arc_feed_ratio,
        grid=grid,
        contour_tolerance_um=machine.tolerance.contour_um * _CONTOUR_MARGIN,
    )
    # The originals are played on the other cores while this one shapes.
    pool = ThreadPoolExecutor(max_workers=os.cpu_count() or 1)
    try:
        originals = [
            pool.submit(play_original, region.path, machine)
            for region in program.regions
            if not _why_kept(region, machine)
        ]
        written = _write(program, machine, grid, limits, on_progress)
        emitted = read_back(written.text, written.placed, machine)
        figures = measure(
            emitted, written.placed, originals, machine, pool,
            lambda done: on_progress("round trip", done, len(written.placed)),
        )  # fmt: skip
    finally:
        pool.shutdown(cancel_futures=True)
    report = _report(program, machine, grid, written, summarise(figures, written.placed, machine))
    return Conversion(written.text, report, emitted, tuple(written.placed))


@dataclass(frozen=True)
class _Written:
    """The emitted text before it is judged."""

    text: bytes
    placed: list[Placed]
    blocks: int
    kept_warnings: list[str]
    kept_s: float


def _write(
    program: Program, machine: Machine, grid: Grid, limits: _core.MotionLimits, on_progress: Progress
) -> _Written:
    core = program.core
    regions = program.regions
    reasons = [_why_kept(region, machine) for region in regions]
    line_end = core.line_end.encode()
    parts: list[bytes] = []
    line = 1

    def put(piece: bytes) -> None:
        nonlocal line
        parts.append(piece)
        line += piece.count(b"\n")

    put(core.slice(0, core.header_offset))
    if machine.emission.header and not all(reasons):
        put(b"".join(comment.encode() + line_end for comment in _header(machine, grid)))
    position = core.header_offset
    placed: list[Placed] = []
    kept: list[str] = []
    kept_s = 0.0
    blocks = 0
    for done, (region, reason) in enumerate(zip(regions, reasons, strict=True), start=1):
        put(core.slice(position, region.text_begin))
        position = region.text_end
        if reason:
            kept.append(_keep(program, region, machine, reason))
            kept_s += play_original(region.path, machine).duration_s
            put(core.slice(region.text_begin, region.text_end))
            continue
        try:
            shaped = emit_region(program, region, machine, grid, limits)
        except _core.ArgumentError as error:
            raise _region_error(program, region, str(error)) from error
        first = line
        put(shaped.text)
        placed.append(Placed(region, first, line - 1))
        blocks += shaped.blocks
        on_progress("shaping", done, len(regions))
    put(core.slice(position, core.size))
    return _Written(b"".join(parts), placed, blocks, kept, kept_s)


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
        raise _region_error(program, region, f"{reason}; its arcs have absolute centres and cannot be kept as they are")
    first, last = region.first_line, region.last_line
    return f"{program.source}:{first}: lines {first} to {last} kept untouched: {reason}"


def _region_error(program: Program, region: _core.Region, message: str) -> _core.ProgramError:
    first, last = region.first_line, region.last_line
    error = _core.ProgramError(f"{program.source}:{first}:1: lines {first} to {last}: {message}")
    error.__dict__.update(line=first, column=1)
    return error


def _header(machine: Machine, grid: Grid) -> list[str]:
    from shapegcode import __version__

    modes = [
        f"{axis} {mode.frequency_hz:g} HZ {mode.damping_ratio:g}"
        for axis, modes in zip("XYZ", machine.axes.as_tuple(), strict=True)
        for mode in modes.modes
    ]
    lines = [
        f"SHAPEGCODE {__version__} MACHINE {machine.name}",
        *(f"MODE {mode}" for mode in modes),
        f"BLOCK PERIOD {grid.block_period_s * 1e3:g} MS SHAPER {grid.shaper.duration_s * 1e3:g} MS",
        "OVERRIDE 100 PCT",
        f"TIME CONSTANT AFTER INTERPOLATION {machine.controller.shaped_time_constant_s * 1e3:g} MS",
    ]
    return [f"({_plain(line)[:_COMMENT_WIDTH]})" for line in lines]


def _plain(text: str) -> str:
    """Only what a FANUC comment may hold: capitals, digits and plain signs."""
    return "".join(c if c.isalnum() or c in " .-" else " " for c in text.upper())


def _report(
    program: Program, machine: Machine, grid: Grid, written: _Written, figures: dict[str, Any]
) -> dict[str, Any]:
    placed = written.placed
    warnings = [*program.warnings, *written.kept_warnings]
    cutting = {
        which: sum(region["time_s"][which] for region in figures["regions"]) for which in ("original", "emitted")
    }
    other = written.kept_s + other_time_s(program.core.other_moves, machine)
    prefill = machine.emission.prefill_dwell_s * len(placed)
    if not placed:
        warnings.append(f"{program.source}: no cutting moves that can be shaped: the text is unchanged")
    for region in figures["regions"]:
        first, last = region["lines"]
        warnings += [f"{program.source}:{first}: lines {first} to {last}: {miss}" for miss in region["misses"]]
    warnings += _controller_warnings(
        machine, written.text, cutting["emitted"], written.blocks, figures["slowed_blocks"]
    )
    return {
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
        },
        "blocks": {"read": program.core.block_count, "emitted": written.blocks},
        "bytes_emitted": len(written.text),
        **figures,
        "within_tolerance": not any(region["misses"] for region in figures["regions"]),
        "warnings": warnings,
    }


def _controller_warnings(machine: Machine, text: bytes, cutting_s: float, blocks: int, slowed_blocks: int) -> list[str]:
    controller = machine.controller
    warnings = []
    if len(text) > controller.program_memory_bytes:
        warnings.append(
            f"the emitted program has {len(text)} bytes, the controller's memory {controller.program_memory_bytes} "
            "(controller.program_memory_bytes): run it from DNC or a data server"
        )
    if controller.dnc_baud > 0 and blocks > 0 and cutting_s > 0.0:
        needed = len(text) * controller.dnc_bits_per_character / cutting_s
        if needed > controller.dnc_baud:
            warnings.append(
                f"drip feeding needs {needed:.0f} baud on average, the line has {controller.dnc_baud} "
                "(controller.dnc_baud): the buffer will run empty"
            )
    if slowed_blocks:
        warnings.append(
            f"{slowed_blocks} of {blocks} shaped blocks step an axis by more than "
            "controller.corner_speed_difference_mm_per_min: run them with the look-ahead mode off "
            '(emission.prologue, for example ["G05.1Q0"]), or it slows them'
        )
    return warnings
