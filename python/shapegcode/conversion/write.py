"""From a cutting region to the text of its shaped blocks: the lines around them and the places of marks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.modes import NO_OFFSET, Offset, axis_modes, mode_tables, region_offset
from shapegcode.program import MM_PER_INCH, Program, least_increment_mm
from shapegcode.shaping.grid import Grid

_DEGREE = math.pi / 180.0
_PLUNGE_CORNER_DEG = 45.0
_PIECE_PERIODS = 1 << 17  # of a region in one go: what bounds the memory
_CORNER_SHARE = 0.75  # several corners of a polyline may fall into one shaper, and then their deviations add up


_TARGETS = {
    "response": _core.ContourTarget.response,
    "command": _core.ContourTarget.command,
    "off": _core.ContourTarget.none,
}


@dataclass(frozen=True)
class EmittedRegion:
    """The text that replaces a region.

    Attributes:
        text: whole lines.
        blocks: shaped blocks in it, without the lines around them.
        periods: whole block periods that each of them lasts.
        blocks_begin: byte of the text at which they begin.
        blocks_end: byte behind them.
        planned_um: deviation of what shall follow the path for which the feed was planned, µm; 0 without a target.
    """

    text: bytes
    blocks: int
    periods: npt.NDArray[np.uint32]
    blocks_begin: int
    blocks_end: int
    planned_um: float


def filter_tolerance(machine: Machine, grid: Grid, contour_tolerance_um: float = math.inf) -> _core.FilterTolerance:
    """What keeps the shaped command within a tolerance at corners and on arcs.

    Args:
        machine: whose controller smooths the shaped program once more.
        grid: what follows the look-ahead; its spread limits the speed.
        contour_tolerance_um: deviation allowed to it, µm.

    Returns:
        The tolerance, in mm.
    """
    own = machine.controller.shaped_time_constant_s
    tolerance = _core.FilterTolerance()
    tolerance.variance_s2 = max(shaper.variance_s2 for shaper in grid.shapers) + own * own / 12.0
    tolerance.mean_deviation_s = max(_mean_deviation_s(shaper) for shaper in grid.shapers) + own / 4.0
    tolerance.contour_tolerance_mm = contour_tolerance_um * 1e-3
    tolerance.corner_share = _CORNER_SHARE
    return tolerance


def shaping_options(
    machine: Machine,
    grid: Grid,
    limits: _core.MotionLimits,
    tolerance: _core.FilterTolerance,
    offset: Offset = NO_OFFSET,
) -> _core.ShapingOptions:
    """How a region is shaped on a grid: what the core needs of the machine file.

    Args:
        machine: controller and modes.
        grid: block period and shapers.
        limits: see `motion_limits`.
        tolerance: see `filter_tolerance`.
        offset: from the region's positions to the machine's; where it is not known of the axis that the grid's track
            follows, the grid's one shaper is used.

    Returns:
        The options of the core.
    """
    options = _core.ShapingOptions()
    options.limits = limits
    options.tolerance = tolerance
    options.block_period_s = grid.block_period_s
    options.interpolation_period_s = machine.controller.interpolation_period_s
    options.plunge_axis_angle_rad = machine.shaping.plunge_angle_deg * _DEGREE
    options.plunge_corner_angle_rad = _PLUNGE_CORNER_DEG * _DEGREE
    options.rest_at_stop_s = machine.controller.shaped_time_constant_s
    options.target = _TARGETS[machine.shaping.contour]
    options.modes = axis_modes(machine)
    options.axis_shapers = list(grid.axis_firs)
    options.least_feed_mm_per_s = machine.controller.minimum_feed_mm_per_min / 60.0
    if grid.track is not None and (start := offset[grid.track.axis]) is not None:
        options.following = grid.track.following(start)
        options.mode_tables = mode_tables(machine, offset=offset)
    return options


class _Marks:
    """N words and comments of a region, in the pieces in which it is written."""

    def __init__(self, program: Program, notes: Sequence[_core.RegionNote]) -> None:
        self._program = program
        self._notes = notes
        self._next = 0
        self.first_number = -1
        """N word at the region's begin, which belongs before its prologue; -1: none."""

    def within(self, piece: _core.ShapedCommand, *, last: bool) -> tuple[list[_core.BlockMark], list[int]]:
        """Marks of a piece and the periods at which its blocks must end for them, both counted from its begin."""
        first = piece.first_period
        end = first + len(piece.middle_mm)
        reached = piece.segment_periods
        marks: list[_core.BlockMark] = []
        breaks: list[int] = []
        while self._next < len(reached) and (last or reached[self._next] < end):
            note, period = self._notes[self._next], reached[self._next] - first
            self._next += 1
            number = note.n_number
            if note.segment == 0 and self.first_number < 0 <= number:
                self.first_number, number = number, -1
            comment = self._program.core.slice(note.comment_offset, note.comment_offset + note.comment_length)
            if number >= 0 or comment:
                marks.append(_core.BlockMark(period, number, comment))
                breaks.append(period)
        return marks, breaks


def emit_region(
    program: Program,
    region: _core.Region,
    machine: Machine,
    grid: Grid,
    limits: _core.MotionLimits,
    tolerance: _core.FilterTolerance,
) -> EmittedRegion:
    """Shape one region and write it.

    The text begins with `emission.prologue` and a full safe line and ends with the modal state of the original.
    """
    notes = region.notes
    options = shaping_options(machine, grid, limits, tolerance, region_offset(region, machine))
    shaper = _core.RegionShaper(region.path, grid.fir, [note.segment for note in notes], options)

    inch = region.exit.units == 20
    unit = MM_PER_INCH if inch else 1.0
    increment = least_increment_mm(machine, region.exit.units)
    feed_decimals = machine.controller.feed_decimals_inch if inch else machine.controller.feed_decimals_mm
    fit = _core.FitOptions()
    fit.increment_mm = increment
    fit.block_period_s = grid.block_period_s
    fit.interpolation_period_s = machine.controller.interpolation_period_s
    fit.feed_unit_mm_per_s = 10.0**-feed_decimals * unit / 60.0
    fit.minimum_feed = max(1, math.ceil(machine.controller.minimum_feed_mm_per_min / unit * 10**feed_decimals - 1e-9))
    fit.merge_tolerance_increments = machine.emission.merge_tolerance_increments
    fit.arc_min_chord_mm = machine.emission.arc_min_chord_mm
    if machine.emission.rounding == "vibration":
        fit.modes = options.modes
    last = region.path[-1]
    writer = _core.WriterOptions()
    writer.position_decimals = -round(math.log10(increment / unit))
    writer.feed_decimals = feed_decimals
    writer.incremental = region.incremental
    writer.plane = region.entry.plane
    writer.line_end = program.core.line_end
    marks = _Marks(program, notes)
    texts: list[bytes] = []
    periods: list[npt.NDArray[np.uint32]] = []
    piece = shaper.next(_PIECE_PERIODS)
    assert piece is not None  # the first one always exists
    starts: list[list[int]] = []  # of the pieces, in increments
    while piece is not None:
        following = shaper.next(_PIECE_PERIODS)
        if following is None:
            writer.exact_stop_at_end = region.exact_stop_at_end
            if region.exit.motion in (2, 3) and last.kind == _core.SegmentKind.arc:
                fit.end_with_arc(region.exit.motion == 2, last.normal, last.radius_mm)
        here, breaks = marks.within(piece, last=following is None)
        fitted = _core.fit_blocks(piece, sorted({*piece.run_ends, *breaks}), fit)
        fit.lent_periods = fitted.left_periods
        starts.append([round(float(x) / increment) for x in piece.grid_mm[0]])
        text, writer.motion, writer.plane = _core.write_blocks(fitted, starts[-1], here, writer)
        texts.append(text)
        periods.append(fitted.periods)
        piece = following
    text = b"".join(texts)
    all_periods = np.concatenate(periods)
    first_number, line_end = marks.first_number, program.core.line_end

    # A search for the region's N word must not skip the prologue.
    head = [*machine.emission.prologue, _safe_line(region, starts[0], writer.position_decimals, machine)]
    if first_number >= 0:
        head[0] = f"N{first_number}{head[0]}"
    if machine.emission.prefill_dwell_s > 0.0:
        head.append(f"G04P{round(machine.emission.prefill_dwell_s * 1e3)}")
    tail = [_restore_line(region, writer.motion, writer.plane), *machine.emission.epilogue]
    end = line_end.encode()
    before = b"".join(line.encode("latin-1") + end for line in head)
    after = b"".join(line.encode("latin-1") + end for line in tail)
    return EmittedRegion(
        before + text + after, len(all_periods), all_periods, len(before), len(before) + len(text),
        shaper.largest_deviation_mm * 1e3,
    )  # fmt: skip


def decimal(value: float, decimals: int) -> str:
    """A number in FANUC's decimal notation: always with a point, no trailing zeros."""
    text = f"{value:.{decimals}f}".rstrip("0") if decimals else f"{value:.0f}."
    return "0." if text in {"-0.", "0."} else text


def feed_word(feed: float) -> str:
    """F with a point, and with a digit behind it below 10, so that it is never a one-digit feed code."""
    whole = len(str(int(feed))) if feed >= 1.0 else 0
    text = decimal(feed, max(0, 8 - whole))  # a word has eight digits
    return f"F{text}0" if feed < 10.0 and text.endswith(".") else f"F{text}"


def _mean_deviation_s(shaper: _core.Shaper) -> float:
    mean = shaper.mean_s
    return float(sum(abs(a) * abs(t - mean) for t, a in zip(shaper.times_s, shaper.amplitudes, strict=True)))


def _safe_line(region: _core.Region, start: list[int], decimals: int, machine: Machine) -> str:
    entry = region.entry
    words = [f"G{entry.plane}", "G91" if region.incremental else "G90", "G94", "G40", "G64", "G01"]
    if not region.incremental:
        known = entry.known
        words += [
            f"{letter}{decimal(value * 10.0**-decimals, decimals)}"
            for letter, value, is_known in zip("XYZ", start, known, strict=True)
            if is_known
        ]
    # In G93 the modal F is no speed; a feed over the axes' limit is none that the machine runs.
    unit = MM_PER_INCH if entry.units == 20 else 1.0
    fastest = max(axis.max_feed_mm_per_min for axis in machine.axes.as_tuple())
    words.append(feed_word(max(1e-8, min(region.path[0].feed_mm_per_s * 60.0, fastest) / unit)))
    return "".join(words)


def _restore_line(region: _core.Region, motion: int, plane: int) -> str:
    """Words that give the modal state of the original's last block back, behind the shaped blocks."""
    state = region.exit
    words = []
    if state.motion != motion:
        words.append(f"G0{state.motion}")
    if state.plane != plane:
        words.append(f"G{state.plane}")
    if state.distance != (91 if region.incremental else 90):
        words.append(f"G{state.distance}")
    if state.feed_mode != 94:
        words.append(f"G{state.feed_mode}")
    if state.exact_stop != 64:
        words.append(f"G{state.exact_stop}")
    words.append(feed_word(state.feed))
    return "".join(words)
