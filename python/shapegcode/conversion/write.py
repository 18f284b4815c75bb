"""Write the shaped blocks of a cutting region, the lines around them, and the original's N words and comments."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.conversion import restart
from shapegcode.machine import Machine
from shapegcode.machine.dialects import dialect_of
from shapegcode.machine.programs import Emission
from shapegcode.model.machine_model import MachineModel, OwnFilter, command_planner, planned_jerk_mm_s3
from shapegcode.model.modes import NO_OFFSET, Offset, excited_modes
from shapegcode.program import MM_PER_INCH, Program, between_increments, decimal, written_increment_mm
from shapegcode.program.stamp import REGION_MARK
from shapegcode.shaping.grid import Grid


class RegionText:
    """The lines of a region, held in memory once: as written, later as part of the program."""

    def __init__(self, parts: Sequence[bytes]) -> None:
        self._parts: Sequence[bytes] | None = parts
        self._inside: tuple[Program, int] | None = None
        self._numbers: Sequence[int] = ()
        self.size = sum(map(len, parts))  # bytes

    def parts(self) -> Sequence[bytes]:
        """The text in its parts."""
        if self._inside is not None:
            program, begin = self._inside
            return [program.text_slice(begin, begin + self.size)]
        assert self._parts is not None  # else it was handed over and not read back yet
        return self._parts

    def number(self, restarts: Sequence[restart.RestartMark], numbers: Sequence[int]) -> None:
        """Give restart points their N words."""
        if not numbers or numbers == self._numbers:
            return
        parts: list[bytes | bytearray] = list(self.parts())
        begins = np.cumsum([0, *map(len, parts)])
        for mark, number in zip(restarts, numbers, strict=True):
            index = int(np.searchsorted(begins, mark.byte, side="right")) - 1
            if isinstance(parts[index], bytes):
                parts[index] = bytearray(parts[index])
            at = mark.byte - int(begins[index])
            parts[index][at : at + len(restart.PLACEHOLDER)] = f"N{number}".encode()  # type: ignore[index]
        self._parts, self._inside, self._numbers = [bytes(part) for part in parts], None, numbers

    def hand_over(self) -> None:
        """Release the parts, which are now held elsewhere."""
        self._parts = self._inside = None

    def stands_in(self, program: Program, begin: int) -> None:
        """Hold the text as a part of the program's text from now on, starting at byte *begin*."""
        self._parts, self._inside = None, (program, begin)


@dataclass(frozen=True)
class EmittedRegion:
    """The text that replaces a region."""

    text: RegionText  # whole lines
    blocks: int  # number of shaped blocks, without the lines around them
    # number of block periods of each block, one array per piece of the region
    block_periods: list[npt.NDArray[np.uint32]]
    block_bytes: list[npt.NDArray[np.uint32]]  # likewise the characters of each block
    planned_um: float  # deviation for which the feed was planned, µm; 0 without a target
    restarts: restart.CutRestarts  # blocks at which the control can restart
    is_slowed: bool  # it is slower than without a contour tolerance
    duration_s: float  # time of its blocks


@dataclass(frozen=True)
class TransferLoad:
    """Memory, data rate and block rate that a shaped region needs."""

    extra_bytes: int  # size of its text minus that of the original
    baud: float  # required line speed in its section with most characters per second, bit/s
    blocks_per_second: float  # in its busiest section


def measure_load(region: _core.Region, shaped: EmittedRegion, grid: Grid, bits_per_character: float) -> TransferLoad:
    """Measure the bytes that a shaped cut adds, and its highest data and block rates over a shaper's duration."""
    durations = np.concatenate(shaped.block_periods, dtype=np.float64)
    durations *= grid.block_period_s
    window_s = max(grid.duration_s, grid.block_period_s)
    sizes = np.concatenate(shaped.block_bytes, dtype=np.float64)
    characters = _core.busiest_per_s(durations, sizes, window_s)
    return TransferLoad(
        shaped.text.size - (region.text_end - region.text_begin),
        characters * bits_per_character,
        _core.busiest_per_s(durations, None, window_s),
    )


def keepable(region: _core.Region, program: Program) -> bool:
    """True if a region of a program may be left unchanged in the emitted one: no arc with an absolute centre."""
    return not program.has_absolute_arc_centres or region.path.largest_sweep_rad <= 0.0


class OverBudgetError(Exception):
    """The shaped text of a region exceeds the permitted size of the program."""


@dataclass(frozen=True)
class SpaceLeft:
    """Largest size of the shaped text of a region."""

    bytes: int  # bytes of text
    blocks: int  # shaped blocks
    machine: Machine  # with the limits

    def require(self, text_bytes: int, blocks: int) -> None:
        """Raise OverBudgetError beyond the limits; called for each piece, so that at most one is written in vain."""
        controller = self.machine.controller
        if text_bytes > self.bytes:
            limit = f"{controller.max_program_bytes} bytes (controller.max_program_bytes)"
        elif blocks > self.blocks:
            limit = f"{controller.max_program_moves} moves (controller.max_program_moves)"
        else:
            return
        raise OverBudgetError(f"its shaped text would take the program over {limit}")


_PIECE_PERIODS = 1 << 17  # of a region at a time: bounds the memory
_CORNER_SHARE = 0.75  # deviations of several corners within one shaper duration add up


_FADED = 1.0 / 3.0  # part of the time to decay to a millionth in which it decays to a hundredth


def filter_tolerance(grid: Grid, own: OwnFilter, contour_tolerance_um: float = math.inf) -> _core.FilterTolerance:
    """Contour tolerance for the planner, with the figures of the filters that decide the error at corners and arcs."""
    tolerance = _core.FilterTolerance()
    tolerance.variance_s2 = max(shaper.variance_s2 for shaper in grid.shapers) + own.variance_s2
    tolerance.mean_deviation_s = max(_mean_deviation_s(shaper) for shaper in grid.shapers) + own.mean_deviation_s
    tolerance.contour_tolerance_mm = contour_tolerance_um * 1e-3
    tolerance.corner_share = _CORNER_SHARE
    return tolerance


class _WithdrawnError(Exception):
    """The written part of a region is invalid: its feed does not keep the tolerance."""


class _Marks:
    def __init__(self, program: Program, notes: Sequence[_core.RegionNote]) -> None:
        self._program, self._notes, self._next = program, notes, 0
        self.first_word = ""
        """N word at the start of the region, as written, to put before its prologue; empty: none."""

    def within(self, piece: _core.ShapedCommand, *, last: bool) -> tuple[list[_core.BlockMark], list[int]]:
        """N words and comments within a piece; periods from its start at which blocks must end to place them."""
        first = piece.first_period
        end = first + len(piece.middle_mm)
        reached = piece.segment_periods
        marks: list[_core.BlockMark] = []
        breaks: list[int] = []
        while self._next < len(reached) and (last or reached[self._next] < end):
            note, period = self._notes[self._next], reached[self._next] - first
            self._next += 1
            number = note.n_number
            if note.segment == 0 and number >= 0 and not self.first_word:
                self.first_word, number = f"N{number:0{note.n_digits}}", -1
            comment = self._program.core.slice(note.comment_offset, note.comment_offset + note.comment_length)
            if number >= 0 or comment:
                marks.append(_core.BlockMark(period, number, comment, note.n_digits))
                breaks.append(period)
        return marks, breaks


def _block_bytes(texts: Sequence[bytes], blocks: Iterable[int]) -> list[npt.NDArray[np.uint32]]:
    """Size of each block, with line end and preceding comment lines; of the last one also with following ones."""
    sizes, behind = [], 0
    for text, count in zip(texts, blocks, strict=True):
        ends = restart.block_lines(text, count)[1]
        sizes.append(np.diff(ends, prepend=-behind).astype(np.uint32))
        behind = len(text) - int(ends[-1]) if len(ends) else behind + len(text)
    for part in [each for each in sizes if len(each)][-1:]:
        part[-1] += behind
    return sizes


class RegionWriter:
    """Shapes regions on one grid and writes them."""

    def __init__(self, model: MachineModel, grid: Grid, mark: str = REGION_MARK) -> None:
        self._machine, self._model, self._grid, self._mark = model.machine, model, grid, mark
        interval_s = self._machine.emission.restart_interval_s
        if interval_s < grid.block_period_s * (1.0 - 1e-9):
            raise _core.ArgumentError(
                f"emission.restart_interval_s = {interval_s:g} s: must be at least a block period, which is "
                f"{grid.block_period_s:g} s here"
            )

    def tolerance(self, contour_tolerance_um: float = math.inf) -> _core.FilterTolerance:
        """See `filter_tolerance`."""
        return filter_tolerance(self._grid, self._model.shaped_filter, contour_tolerance_um)

    def options(
        self, limits: _core.MotionLimits, tolerance: _core.FilterTolerance, offset: Offset = NO_OFFSET
    ) -> _core.ShapingOptions:
        """Shaping options of a region for the core."""
        grid, plant = self._grid, self._model.options(offset=offset)
        options = _core.ShapingOptions()
        options.limits = limits
        options.tolerance = tolerance
        options.planner = command_planner(self._machine)
        if options.planner == _core.CommandPlanner.time_optimal:
            options.limits.max_jerk_mm_per_s3 = planned_jerk_mm_s3(self._machine)
        options.block_period_s = grid.block_period_s
        options.interpolation_period_s = self._model.period_s
        options.plunge_axis_angle_rad = math.radians(self._machine.shaping.plunge_angle_deg)
        options.plunge_corner_angle_rad = math.radians(45.0)
        options.rest_at_stop_s = self._model.shaped_filter.duration_s
        targets = _core.ContourTarget.__members__
        options.target = targets.get(self._machine.shaping.contour, _core.ContourTarget.none)
        options.modes = plant.modes
        options.axis_shapers = list(grid.axis_firs)
        options.feed_excess_ratio = self._machine.tolerance.feed_excess_ratio
        options.least_feed_mm_per_s = self._machine.controller.minimum_feed_mm_per_min / 60.0
        if grid.track is not None and (start := offset[grid.track.axis]) is not None:
            options.following = grid.track.following(start)
            options.mode_tables = plant.mode_tables
        return options

    def write(
        self,
        program: Program,
        region: _core.Region,
        limits: _core.MotionLimits,
        tolerance: _core.FilterTolerance,
        space: SpaceLeft | None = None,
        on_progress: Callable[[float], None] = lambda _share: None,
    ) -> EmittedRegion:
        """Shape one region and write it: lines before it with the safe line, blocks, lines that restore the state."""
        options = self.options(limits, tolerance, self._model.offset(region))
        # Periods without the stops for restart points, and the number of stops.
        stopped = self._stop_for_restarts(region, options) if self._machine.emission.restart_stops else (0, 0)
        marked = [note.segment for note in region.notes]
        shaper = _core.RegionShaper(region.path, self._grid.fir, marked, options)
        shaper.begin_early()
        try:
            return self._write(program, region, shaper, space, on_progress, stopped)
        except _WithdrawnError:
            shaper.begin_anew()
        return self._write(program, region, shaper, space, on_progress, stopped)

    def _places(self, region: _core.Region) -> restart.RestartPlaces:
        places = restart.RestartPlaces(region, self._machine, self._grid.block_period_s)
        if self._mark != REGION_MARK:
            places.reason = "it replaces a rapid"
        return places

    def _stop_for_restarts(self, region: _core.Region, options: _core.ShapingOptions) -> tuple[int, int]:
        """Add the stops that restart points need; return the block periods without them, and the number of stops."""
        places = self._places(region)
        segments = range(1, len(region.path))
        shaper = _core.RegionShaper(region.path, self._grid.fir, segments, options)
        points: list[int] = []
        end, reached = 0, []
        with closing(_pieces(shaper)) as pieces:
            for piece, _, is_last in pieces:
                at, left, _ = places.low(piece, np.arange(len(piece.middle_mm)))
                at, end = at + piece.first_period, piece.first_period + len(piece.middle_mm)
                chosen = places.choose(at, left, end, last=is_last, usable=lambda _: True)
                points += [int(at[index]) for index in chosen]
                reached = piece.segment_periods
        stops = [] if places.reason else places.further_stops(points, reached, end)
        options.further_stops = stops
        return end, len(stops)

    def _write(
        self,
        program: Program,
        region: _core.Region,
        shaper: _core.RegionShaper,
        space: SpaceLeft | None,
        on_progress: Callable[[float], None],
        stopped: tuple[int, int],
    ) -> EmittedRegion:
        fit = self._fit(region)
        state = self._writer(program, region, fit)
        marks = _Marks(program, region.notes)
        restarts = restart.RegionRestarts(self._places(region), region, self._machine, fit, state.position_decimals)
        texts: list[bytes] = []
        periods: list[npt.NDArray[np.uint32]] = []
        starts: list[list[int]] = []  # of the pieces, in increments
        with closing(_pieces(shaper)) as pieces:
            for piece, share, is_last in pieces:
                if is_last:
                    state.exact_stop_at_end = region.exact_stop_at_end
                    last = region.path[-1]
                    if region.exit.motion in (2, 3) and last.kind == _core.SegmentKind.arc:
                        fit.end_with_arc(region.exit.motion == 2, last.normal, last.radius_mm)
                here, breaks = marks.within(piece, last=is_last)
                fitted = _core.fit_blocks(piece, sorted({*piece.run_ends, *breaks}), fit)
                fit.lent_periods = fitted.left_periods
                starts.append([round(float(x) / fit.increment_mm) for x in piece.grid_mm[0]])
                modal = state.motion, state.plane
                text, state.motion, state.plane = _core.write_blocks(fitted, starts[-1], here, state)
                text = restarts.add(text, piece, fitted, modal, last=is_last)
                end = piece.first_period + len(piece.middle_mm)
                texts.append(text)
                periods.append(fitted.periods)
                if space is not None:
                    space.require(sum(map(len, texts)), sum(map(len, periods)))
                on_progress(share)
        # A search for the region's N word must not skip the prologue.
        number = marks.first_word
        before = self._head(region, number, starts[0], state)
        emission = self._machine.emission
        restored = _restore_line(region, state.motion, state.plane)
        after = [restored, *_own(emission, "UNLOCK"), *_own(emission, "EPILOGUE")]
        emitted = RegionText([before, *texts, _lines(after, state)])
        unstopped, stops = stopped
        found = restarts.result(before, stops, (end - unstopped) * fit.block_period_s if stops else 0.0)
        duration_s = float(sum(int(part.sum()) for part in periods)) * self._grid.block_period_s
        return EmittedRegion(
            emitted, sum(map(len, periods)), periods, _block_bytes(texts, map(len, periods)),
            shaper.largest_deviation_mm * 1e3, found, shaper.is_slowed, duration_s,
        )  # fmt: skip

    def _fit(self, region: _core.Region) -> _core.FitOptions:
        controller, emission = self._machine.controller, self._machine.emission
        unit, feed_decimals = self._units(region)
        fit = _core.FitOptions()
        fit.increment_mm = written_increment_mm(self._machine, region.exit.units)
        fit.block_period_s = self._grid.block_period_s
        fit.interpolation_period_s = self._model.period_s
        fit.feed_unit_mm_per_s = 10.0**-feed_decimals * unit / 60.0
        fit.minimum_feed = max(1, math.ceil(controller.minimum_feed_mm_per_min / unit * 10**feed_decimals - 1e-9))
        fit.merge_tolerance_increments = emission.merge_tolerance_increments
        fit.arc_min_chord_mm = emission.arc_min_chord_mm
        if (own := dialect_of(emission.dialect)) is not None:
            fit.smooth_arcs_mm = own.smooth_arcs_um * 1e-3
        if self._machine.bears_override:
            fit.most_periods = 1
            fit.equal_above_increments = self._machine.tolerance.residual_floor_increments
            fit.equal_periods = math.ceil(self._model.vibration_memory_s * _FADED / fit.block_period_s)
        if emission.rounding == "vibration":
            fit.modes = excited_modes(self._machine)
        return fit

    def _writer(self, program: Program, region: _core.Region, fit: _core.FitOptions) -> _core.WriterOptions:
        unit, feed_decimals = self._units(region)
        writer = _core.WriterOptions()
        writer.position_decimals = -round(math.log10(fit.increment_mm / unit))
        writer.feed_decimals = feed_decimals
        writer.incremental = region.incremental
        writer.plane = region.entry.plane
        writer.line_end = program.core.line_end
        return writer

    def _units(self, region: _core.Region) -> tuple[float, int]:
        """Millimetres per unit of the program, and decimals of F."""
        inch = region.exit.units == 20
        controller, own = self._machine.controller, dialect_of(self._machine.emission.dialect)
        decimals = controller.feed_decimals_inch if inch else controller.feed_decimals_mm
        finer = own.feed_decimals if own is not None else None
        return MM_PER_INCH if inch else 1.0, decimals if finer is None else max(decimals, finer + inch)

    def _head(self, region: _core.Region, number: str, start: list[int], writer: _core.WriterOptions) -> bytes:
        emission = self._machine.emission
        fastest = max(axis.max_feed_mm_per_min for axis in self._machine.axes.as_tuple())
        unit_mm, _ = self._units(region)
        resting = between_increments(region, unit_mm * 10.0**-writer.position_decimals)
        safe = _safe_line(region, start, resting, writer.position_decimals, fastest)
        lines = [*_own(emission, "LOCK"), *_own(emission, "PROLOGUE"), safe]
        lines[0] = number + lines[0]
        if emission.header:
            lines.insert(0, self._mark)
        return _lines([*lines, *emission.prefill_lines], writer)


def _pieces(shaper: _core.RegionShaper) -> Generator[tuple[_core.ShapedCommand, float, bool]]:
    """Yield pieces of a region, finished ratio, and whether it is the last; a thread shapes the next one meanwhile."""

    def shaped() -> tuple[_core.ShapedCommand | None, float]:
        piece = shaper.next(_PIECE_PERIODS)
        if shaper.is_withdrawn:
            raise _WithdrawnError
        return piece, shaper.share

    piece, share = shaped()
    following, following_share = shaped()
    with ThreadPoolExecutor(max_workers=1) as other:
        while piece is not None:
            under_way = other.submit(shaped) if following is not None else None
            yield piece, share, following is None
            piece, share = following, following_share
            following, following_share = under_way.result() if under_way is not None else (None, 1.0)


def _own(emission: Emission, kind: str) -> tuple[str, ...]:
    """Lines of the machine file around a cut; in another dialect a placeholder for `translate`."""
    lines = emission.around_cuts[kind]
    return lines if emission.dialect == "fanuc" or not lines else (f"(EMISSION {kind})",)


def _lines(lines: Sequence[str], writer: _core.WriterOptions) -> bytes:
    return b"".join((line + writer.line_end).encode("latin-1") for line in lines)


def feed_word(feed: float) -> str:
    """F with a point, below 10 with a decimal, so that it is never a one-digit feed code."""
    whole = len(str(int(feed))) if feed >= 1.0 else 0
    text = decimal(feed, max(0, 8 - whole))  # a word has eight digits
    return f"F{text}0" if feed < 10.0 and text.endswith(".") else f"F{text}"


def _mean_deviation_s(shaper: _core.Shaper) -> float:
    mean = shaper.mean_s
    return float(sum(abs(a) * abs(t - mean) for t, a in zip(shaper.times_s, shaper.amplitudes, strict=True)))


def _safe_line(
    region: _core.Region, start: list[int], resting: list[bool], decimals: int, fastest_mm_per_min: float
) -> str:
    entry = region.entry
    words = [f"G{entry.plane}", "G91" if region.incremental else "G90", "G94", "G40", "G64", "G01"]
    if not region.incremental:
        words += [
            f"{letter}{decimal(value * 10.0**-decimals, decimals)}"
            for letter, value, is_known, rests in zip("XYZ", start, entry.known, resting, strict=True)
            if is_known and not rests
        ]
    # In G93 the modal F is not a speed; a feed above the axes' limit is never reached.
    unit = MM_PER_INCH if entry.units == 20 else 1.0
    words.append(feed_word(max(1e-8, min(region.path[0].feed_mm_per_s * 60.0, fastest_mm_per_min) / unit)))
    return "".join(words)


def _restore_line(region: _core.Region, motion: int, plane: int) -> str:
    state, distance = region.exit, 91 if region.incremental else 90
    shaped = {"motion": motion, "plane": plane, "distance": distance, "feed_mode": 94, "exact_stop": 64}
    codes = [code for name, own in shaped.items() if (code := getattr(state, name)) != own]
    return "".join(f"G{code:02d}" for code in codes) + feed_word(state.feed)


_LABEL = re.compile(r"N\d+")
_MERE_MOVE = re.compile(r"(?:N\d+)?(?:G0?[123])?(?:[XYZIJKRF]-?(?:\d+\.\d*|\.\d+))+")


def linear_lines(
    lines: Mapping[int, str], path: _core.Path, blocks: Sequence[_core.LinearBlock], decimals: int
) -> dict[int, list[str]]:
    """SINUMERIK lines with linear feeds (FLIN) for those of shaped blocks, by number; none for one that is joined."""
    numbers = [int(number) for number in path.segment_lines]
    written: dict[int, list[str]] = {number: [] for number in numbers}
    is_linear, code, start = False, "", np.asarray(path.start_mm, dtype=float)
    for block in blocks:
        label = _LABEL.match(lines[numbers[block.first]])
        out = written[numbers[block.first]]
        if block.sets_feed:
            out.append(f"{'FNORM ' if is_linear else ''}F{decimal(block.start_feed_mm_per_min, 2)}")
            is_linear = False
        change = "" if block.is_linear == is_linear else "FLIN " if block.is_linear else "FNORM "
        is_linear = block.is_linear
        motion = "G1" if not block.sweep_rad else "G3" if block.sweep_rad > 0.0 else "G2"
        words = "" if motion == code else f"{motion} "
        code = motion
        moved = np.abs(np.round(block.end_mm, decimals) - np.round(start, decimals)) > 0.5 * 10.0**-decimals
        words += "".join(f"{'XYZ'[k]}{decimal(float(block.end_mm[k]), decimals)}" for k in range(3) if moved[k])
        words += f"CR={decimal(block.radius_mm, 3)}" if block.sweep_rad else ""
        out.append(f"{change}{words}F{decimal(block.feed_mm_per_min, 2 if block.is_linear else 4)}")
        if label is not None:
            out[0] = f"{label[0]} {out[0]}"
        start = block.end_mm
    if is_linear:
        written[numbers[-1]].append("FNORM")
    return written


def joints_of(lines: Mapping[int, str], numbers: Sequence[int]) -> list[int] | None:
    """Indices of blocks that cannot be joined to the one before (N word, or lines between); None: not all are moves."""
    if not all(_MERE_MOVE.fullmatch(lines[number]) for number in numbers):
        return None
    pairs = enumerate(pairwise(numbers), start=1)
    return [k for k, (before, number) in pairs if number != before + 1 or lines[number].startswith("N")]
