"""The whole emitted program: header, checks of tool offsets, shaped regions, everything else unchanged."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from functools import cached_property, partial
from queue import SimpleQueue
from typing import Generic, TypeVar

import numpy as np

from shapegcode import _core
from shapegcode.conversion.restart import END_NUMBER, FIRST_NUMBER, CutRestarts, free_numbers
from shapegcode.conversion.write import (
    EmittedRegion,
    OverBudgetError,
    RegionText,
    RegionWriter,
    SpaceLeft,
    TransferLoad,
    keepable,
    measure_load,
)
from shapegcode.errors import RoundTripError
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.programs import stamp_of_machine
from shapegcode.program import Program, end_off_grid_mm, written_increment_mm
from shapegcode.program.compensation import guard_lines, header_lines
from shapegcode.program.computer import cores
from shapegcode.shaping.grid import Grid
from shapegcode.verdict.figures import Placed

T = TypeVar("T")

OnShare = Callable[[float], None]  # called with the finished ratio of a part, 0 to 1
Step = Callable[[float, int], None]
Aim = tuple[float, float]  # tolerance, µm, and feed ratio of a shaped region

_WAITING = 2  # running or finished parts per core that were not fetched: bounds the memory
_MAX_PERIODS = 10_000_000  # of a region: fits into half a gigabyte


def why_kept(program: Program, region: _core.Region, machine: Machine, grid: Grid) -> str:
    """Reason why a region cannot be written as shaped blocks; empty if it can."""
    if reason := why_off_grid(program, region, machine):
        return reason
    longest_s = _MAX_PERIODS * grid.block_period_s
    time_s = region.path.programmed_time_s
    if time_s > longest_s:
        return f"{time_s:.0f} s of cutting without a stop exceed what can be shaped at a time ({longest_s:.0f} s)"
    slowest = region.path.slowest_feed_mm_per_s * 60.0
    least = machine.controller.minimum_feed_mm_per_min
    if slowest < least * (1 - 1e-9):
        return f"feed {slowest:g} mm/min is below controller.minimum_feed_mm_per_min = {least:g}"
    return ""


def why_off_grid(program: Program, region: _core.Region, machine: Machine) -> str:
    """Reason why the end of a move cannot be written exactly enough before a change of unit; empty if it can."""
    if region.incremental:
        return ""
    units = {region.exit.units, *(each.exit.units for each in program.regions)}
    limit_mm = 0.5 * min(written_increment_mm(machine, each) for each in units) + 1e-9
    off_mm = end_off_grid_mm(region, written_increment_mm(machine, region.exit.units))
    moves = zip("XYZ", region.path.end_mm, off_mm, region.path.extent_mm, region.exit.known, strict=True)
    for axis, end_mm, off, extent_mm, is_known in moves:
        if is_known and extent_mm > 0.0 and off > limit_mm:
            return (
                f"it ends at {axis} {end_mm:.5f} mm, {off * 1e3:.2f} um off the increments of G{region.exit.units}; "
                f"the program changes between G20 and G21 (limit {limit_mm * 1e3:.2f} um)"
            )
    return ""


@dataclass(frozen=True)
class Written:
    """The emitted program before its verdict."""

    parts: list[bytes]  # of the whole program; empty after it was read back
    texts: list[tuple[RegionText, int]]  # text of each shaped region, and its offset in the program, bytes
    size: int  # bytes of the whole text
    placed: list[Placed]  # its shaped regions
    blocks: int  # shaped blocks in it
    kept_warnings: list[str]  # a sentence for every region left unchanged that the tables do not list
    shaped: dict[int, EmittedRegion]  # by index of a shaped region
    loads: dict[int, TransferLoad]  # likewise
    no_room: dict[int, str]  # reason by index of a region left unchanged for lack of space
    restarts: list[CutRestarts]  # of each shaped region, as in `placed`

    def read_back(self, machine: Machine) -> Program:
        """Read the emitted program and compare it with the original; the region texts then refer to it."""
        for text, _ in self.texts:
            text.hand_over()
        emitted = read_back(self.parts, self.placed, machine)
        for text, begin in self.texts:
            text.stands_in(emitted, begin)
        return emitted


class Prefetch(Generic[T]):
    """Runs tasks in a pool, in order; a limited number of them is started ahead of the results that are fetched.

    `tasks`: by number; each gets a function, and calls it with its finished ratio. `weights`: of all parts, some of
    which have no task. `on_progress`: called with the sum of the finished weights, by the thread that fetches results.
    """

    def __init__(
        self,
        pool: Executor,
        tasks: Mapping[int, Callable[[OnShare], T]],
        weights: Mapping[int, float],
        on_progress: Callable[[float], None],
    ) -> None:
        self._pool, self._weights, self.on_progress = pool, weights, on_progress
        self._waiting = list(tasks.items())[::-1]
        self._running: dict[int, Future[T]] = {}
        # Number of a part and its finished ratio; None: a part has ended.
        self._news: SimpleQueue[tuple[int, float] | None] = SimpleQueue()
        self._shares = dict.fromkeys(weights, 0.0)
        self._done = 0.0

    def start(self) -> None:
        """Start tasks until there are as many results to fetch as the limit allows."""
        while self._waiting and len(self._running) < _WAITING * cores():
            number, task = self._waiting.pop()
            future = self._pool.submit(task, partial(self._put, number))
            future.add_done_callback(lambda _future: self._news.put(None))
            self._running[number] = future

    def result(self, number: int) -> T:
        """Result of task *number*, the next one in order; waits for it."""
        self.start()
        future = self._running.pop(number)
        while not future.done():
            self._report(self._news.get())
        self.skip(number)
        return future.result()

    def skip(self, number: int) -> None:
        """Count a part as done."""
        self._report((number, 1.0))

    def _put(self, number: int, share: float) -> None:
        self._news.put((number, share))

    def _report(self, news: tuple[int, float] | None) -> None:
        if news is not None:
            number, share = news
            if share > self._shares[number]:
                self._done += (share - self._shares[number]) * self._weights[number]
                self._shares[number] = share
            self.on_progress(self._done)


class TextWriter:
    """Writes a program with its regions shaped on one grid."""

    def __init__(self, program: Program, model: MachineModel, grid: Grid, pool: Executor) -> None:
        self._program, self._machine, self._model, self.grid = program, model.machine, model, grid
        self._regions = RegionWriter(model, grid)
        self._pool = pool
        # By region: tolerance and feed for which it was shaped, and the result.
        self._shaped: dict[int, tuple[Aim, EmittedRegion, TransferLoad]] = {}
        self._started: tuple[dict[int, Aim], Prefetch[EmittedRegion]] | None = None

    def begin(self, aims: dict[int, Aim]) -> None:
        """If there are fewer regions than cores, start to shape them before their gain is known."""
        if len(aims) < cores():
            self._started = aims, self._ahead(aims, lambda _done: None)
            self._started[1].start()

    def options(self, index: int) -> _core.ShapingOptions:
        """Shaping options of a cut, without tolerance and lowered feed."""
        limits = self._model.limits(arc_feed_ratio=self._machine.shaping.arc_feed_ratio)
        offset = self._model.offset(self._program.regions[index])
        return self._regions.options(limits, self._regions.tolerance(), offset)

    def write(
        self, reasons: Sequence[str], aims: Mapping[int, Aim], unreported: Collection[int], on_progress: Step
    ) -> Written:
        """Write the whole program; *reasons*: for each region why it is left unchanged, empty to shape it."""
        core, regions = self._program.core, self._program.regions
        parts = [core.slice(0, core.header_offset), self._opening(shapes=not all(reasons))]
        line = 1 + sum(part.count(b"\n") for part in parts)
        position = core.header_offset
        written = Written([], [], 0, [], 0, [], {}, {}, {}, [])
        blocks, size = 0, core.size
        begin = sum(map(len, parts))
        # Unchanged moves: all except those of the shaped regions.
        shaped_moves = sum(len(regions[index].path) for index in aims)
        kept_moves = core.move_count - shaped_moves
        ahead = self._ahead(aims, lambda done: on_progress(done, shaped_moves))
        for index, (region, reason) in enumerate(zip(regions, reasons, strict=True)):
            between = core.slice(position, region.text_begin)
            position = region.text_end
            line += between.count(b"\n")
            begin += len(between)
            shaped, bytes_read = None, region.text_end - region.text_begin
            if not reason:
                try:
                    shaped, load = self._shaped_region(index, aims[index], ahead)
                    self._space_left(size - bytes_read, blocks + kept_moves).require(shaped.text.size, shaped.blocks)
                except OverBudgetError as error:
                    shaped = None
                    written.no_room[index] = str(error)
                    kept_moves += len(region.path)
            if shaped is None:
                if index not in unreported:
                    written.kept_warnings.append(self._keep(region, written.no_room.get(index, reason)))
                texts: Sequence[bytes] = [core.slice(region.text_begin, region.text_end)]
            else:
                written.restarts.append(self._numbered(shaped, written.restarts))
                texts = shaped.text.parts()
                size += shaped.text.size - bytes_read
                blocks += shaped.blocks
                written.placed.append(Placed(region, line, line + _lines(texts) - 1))
                written.texts.append((shaped.text, begin))
                written.shaped[index], written.loads[index] = shaped, load
            line += _lines(texts)
            begin += sum(map(len, texts))
            parts += [between, *texts]
        parts.append(core.slice(position, core.size))
        return replace(written, parts=parts, size=sum(map(len, parts)), blocks=blocks)

    def _numbered(self, shaped: EmittedRegion, before: Sequence[CutRestarts]) -> CutRestarts:
        """The restart points of a region, with unused N words."""
        marks = shaped.restarts.marks
        if not marks:
            return shaped.restarts
        taken = sum(len(each.marks) for each in before)
        numbers = self._free_numbers[taken : taken + len(marks)]
        if len(numbers) < len(marks):
            raise _core.ProgramError(
                f"{self._program.source}:1:1: {taken + len(marks)} restart points, but only {len(self._free_numbers)} "
                f"N numbers from {FIRST_NUMBER} to {END_NUMBER - 1} are free: raise emission.restart_interval_s"
            )
        shaped.text.number(marks, numbers)
        numbered = (replace(mark, number=number) for mark, number in zip(marks, numbers, strict=True))
        return replace(shaped.restarts, marks=tuple(numbered))

    @cached_property
    def _free_numbers(self) -> list[int]:
        return free_numbers(self._program)

    def _space_left(self, size: int, moves: int) -> SpaceLeft:
        controller = self._machine.controller
        return SpaceLeft(controller.max_program_bytes - size, controller.max_program_moves - moves, self._machine)

    def _ahead(self, aims: Mapping[int, Aim], on_moves: Callable[[float], None]) -> Prefetch[EmittedRegion]:
        """Shape regions in the pool, except those with unchanged tolerance and feed."""
        if self._started is not None and aims.items() <= self._started[0].items():
            prefetch = self._started[1]
            prefetch.on_progress = on_moves
            self._started = None
            return prefetch
        regions = self._program.regions
        # Each is limited to the size of the whole program; together they may still exceed it.
        space = self._space_left(0, 0)
        tasks = {
            index: partial(self._shaped_again, regions[index], *aim, space)
            for index, aim in aims.items()
            if self._is_new(index, aim)
        }
        weights = {index: float(len(regions[index].path)) for index in aims}
        return Prefetch(self._pool, tasks, weights, on_moves)

    def _is_new(self, index: int, aim: Aim) -> bool:
        return index not in self._shaped or self._shaped[index][0] != aim

    def _shaped_region(
        self, index: int, aim: Aim, ahead: Prefetch[EmittedRegion]
    ) -> tuple[EmittedRegion, TransferLoad]:
        if self._is_new(index, aim):
            shaped = ahead.result(index)
            bits = self._machine.controller.dnc_bits_per_character
            load = measure_load(self._program.regions[index], shaped, self.grid, bits)
            shaped.block_periods.clear()  # not used again
            shaped.block_bytes.clear()
            self._shaped[index] = aim, shaped, load
        else:
            ahead.skip(index)
        return self._shaped[index][1:]

    def _shaped_again(
        self, region: _core.Region, allowed_um: float, feed_share: float, space: SpaceLeft, on_share: OnShare
    ) -> EmittedRegion:
        limits = self._model.limits(arc_feed_ratio=self._machine.shaping.arc_feed_ratio)
        limits.feed_override = feed_share
        try:
            return self._regions.write(
                self._program, region, limits, self._regions.tolerance(allowed_um), space, on_share
            )
        except _core.ArgumentError as error:
            raise self._program.region_error(region, str(error)) from error

    def _keep(self, region: _core.Region, reason: str) -> str:
        if not keepable(region, self._program):
            why = f"{reason}; its arcs have absolute centres and cannot be left unchanged"
            raise self._program.region_error(region, why)
        place = self._program.place(region.first_line)
        return f"{place}: {self._program.lines(region)} left unchanged: {reason}"

    def _opening(self, *, shapes: bool) -> bytes:
        radii_mm = self._program.core.expanded_radii_mm
        lines = guard_lines(radii_mm, self._machine)
        if self._machine.emission.header and shapes:
            lines = [*self._header(), *(f"({note})" for note in header_lines(radii_mm)), *lines]
        return b"".join((line + self._program.core.line_end).encode() for line in lines)

    def _header(self) -> list[str]:
        from shapegcode import __version__

        grid = self.grid
        notes = [f"SHAPER CHANGES WITH {'XYZ'[grid.track.axis]} POSITION"] if grid.track else []
        stamp = replace(
            stamp_of_machine(self._machine, version=__version__),
            block_period_ms=f"{grid.block_period_s * 1e3:g}",
            shaper_ms=f"{grid.duration_s * 1e3:g}",
            family=grid.family,
            override=self._machine.emission.override,
            notes=tuple(notes),
        )
        return stamp.lines()


def _lines(parts: Sequence[bytes]) -> int:
    return sum(part.count(b"\n") for part in parts)


_STATE_FIELDS = (
    "motion", "plane", "distance", "feed_mode", "units", "compensation", "length_offset",
    "cycle", "cycle_return", "coordinate_system", "exact_stop", "feed",
)  # fmt: skip


def read_back(parts: list[bytes], placed: Sequence[Placed], machine: Machine) -> Program:
    """Read the emitted program and check end points, angles of arcs, and the modal states around regions."""
    # Half an increment: a program may have more digits than the controller resolves.
    tolerance_mm = {units: 0.5 * written_increment_mm(machine, units) + 1e-9 for units in (20, 21)}
    probes = [line for place in placed for line in (place.first_line - 1, place.last_line)]
    emitted = Program.from_parts(parts, machine, source="emitted program", probe_lines=probes)
    states = emitted.core.probed
    for index, place in enumerate(placed):
        region = place.region
        for state, own, line in (
            (states[2 * index], region.entry, place.first_line - 1),
            (states[2 * index + 1], region.exit, place.last_line),
        ):
            _compare_states(state, own, line, math.inf if region.incremental else tolerance_mm[own.units])
        blocks = place.blocks(emitted)
        _compare_ends(blocks, place, tolerance_mm)
        if blocks.largest_sweep_rad >= math.pi / 2:
            raise RoundTripError(
                f"emitted arc between lines {place.first_line} and {place.last_line} sweeps "
                f"{math.degrees(blocks.largest_sweep_rad):.1f} degrees (limit 90)"
            )
    return emitted


def _compare_states(emitted: _core.ModalState, original: _core.ModalState, line: int, limit_mm: float) -> None:
    for field in _STATE_FIELDS:
        was, now = getattr(original, field), getattr(emitted, field)
        if was != now and not (field == "feed" and original.feed_mode == 93):
            raise RoundTripError(f"emitted line {line}: modal {field} is {now}, the original has {was}")
    if original.known != emitted.known:
        raise RoundTripError(f"emitted line {line}: known axes {emitted.known}, the original has {original.known}")
    for axis, known, was, now in zip("XYZ", original.known, original.position_mm, emitted.position_mm, strict=True):
        if known and abs(was - now) > limit_mm:
            raise RoundTripError(f"emitted line {line}: {axis} is at {now:.6f} mm, the original at {was:.6f} mm")


def _compare_ends(blocks: _core.Path, place: Placed, tolerance_mm: Mapping[int, float]) -> None:
    path = place.region.path
    travel = path.end_mm - path.start_mm
    gap = float(np.abs((blocks.end_mm - blocks.start_mm) - travel).max())
    # Start and end are rounded to the increment, each once.
    limit = 2.0 * tolerance_mm[place.region.exit.units]
    if gap > limit:
        raise RoundTripError(
            f"shaped blocks of lines {place.region.first_line} to {place.region.last_line} end {gap * 1e3:.2f} um off "
            f"(limit {limit * 1e3:.2f} um)"
        )
