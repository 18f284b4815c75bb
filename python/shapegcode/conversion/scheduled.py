"""Feed scheduling and shaping together: feeds are chosen for the simulated motion of the shaped program."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from shapegcode import _core
from shapegcode.conversion.budget import Budget
from shapegcode.conversion.convert import convert
from shapegcode.conversion.result import Conversion
from shapegcode.conversion.translate import translated
from shapegcode.conversion.write import filter_tolerance
from shapegcode.cutting.stock import Stock
from shapegcode.cutting.tool import Tool
from shapegcode.feed.load import PathLoad, load_of
from shapegcode.feed.plan import Mover, OrdinaryMotion, Travelled, travel_emitted
from shapegcode.feed.result import FeedSchedule
from shapegcode.feed.schedule import MARGIN, feed_figures, schedule_survey
from shapegcode.feed.survey import survey
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.program import Program
from shapegcode.results.outcome import Plot
from shapegcode.results.table import Table
from shapegcode.shaping.grid import Grid, choose_grid


class ShapedMotion(Mover):
    """Motion that `convert` plans for a region: look-ahead within the contour tolerance, then the shaper."""

    def __init__(self, machine: Machine, grid: Grid) -> None:
        period = machine.controller.interpolation_period_s
        ticks = round(grid.block_period_s / period)
        model = MachineModel(machine)
        self._limits = model.limits()
        self._tolerance = filter_tolerance(grid, model.shaped_filter, machine.tolerance.contour_um)
        shaper = _core.Fir([ticks * delay for delay in grid.fir.delays], list(grid.fir.taps))
        # The emitted blocks join samples of the shaped command by straight lines.
        super().__init__(period, [shaper, _core.Fir.moving_average(ticks), *model.shaped.filters])

    def travel(self, path: _core.Path, along: _core.Path, stations_mm: FloatArray, window_s: float) -> Travelled:
        """See `Mover`."""
        profile = _core.plan_speed(path, self._limits, self._tolerance)
        found = _core.travel_path(path, profile, along, stations_mm, self.period_s, self.filters, window_s)
        return Travelled.of(found)


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class ScheduledConversion(Conversion):
    """A program with scheduled feeds, shaped; its `original` figures are of the program with these feeds, unshaped.

    Attributes:
        feed_schedule: the schedule; its `emitted` loads are the shaped program's.
    """

    feed_schedule: FeedSchedule

    @property
    def methods(self) -> tuple[str, ...]:
        """Methods of conversion and feed schedule."""
        return (*super().methods, *self.feed_schedule.methods)

    @property
    def ok(self) -> bool:
        """True if the shaped program keeps the machine's tolerances and the tool's limits."""
        return super().ok and self.feed_schedule.ok

    @property
    def answer(self) -> str:
        """The verdicts on motion and cut."""
        return f"{super().answer}; {self.feed_schedule.answer}"

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        if self.within_tolerance and not self.feed_schedule.ok:
            return f"do not run it: {self.feed_schedule.next_step}"
        return super().next_step

    def tables(self, *, every_cut: bool = False) -> list[Table]:
        """Tables of the schedule, then of the conversion.

        Args:
            every_cut: see `Conversion.tables`.

        Returns:
            The tables.
        """
        return [*self.feed_schedule.tables(), *super().tables(every_cut=every_cut)]

    def plots(self) -> Mapping[str, Plot]:
        """Plots of conversion and schedule."""
        return {**super().plots(), **self.feed_schedule.plots()}


_ROUNDS = 4


def convert_scheduled(
    program: Program | str | Path,
    machine: Machine | str | Path,
    tools: Tool | Sequence[Tool],
    stock: Stock,
    *,
    margin: float = MARGIN,
    resolution_mm: float | None = None,
    block_period_s: float | None = None,
    arc_feed_ratio: float | None = None,
    budget: Budget | None = None,
    on_progress: Callable[[float], None] = lambda _done: None,
) -> ScheduledConversion:
    """Schedule the feeds of a program, shape it, and compute the force of the emitted program.

    If the emitted program exceeds a limit, feeds are chosen again with more margin, up to three times.

    Args:
        program: the program to convert, or its file.
        machine: controller, modes, tolerances.
        tools: see :func:`shapegcode.feed.schedule.schedule_feed`.
        stock: see `schedule_feed`.
        margin: see `schedule_feed`.
        resolution_mm: see `schedule_feed`.
        block_period_s: see :func:`shapegcode.convert`.
        arc_feed_ratio: see `convert`.
        budget: see `convert`.
        on_progress: called with the finished ratio, 0 to 1.

    Returns:
        The conversion with its feed schedule.

    Raises:
        ProgramError, MachineError, DesignError, ArgumentError, StockError, RoundTripError: as `schedule_feed` and
            `convert`.
    """
    machine = Machine.of(machine)
    surveyed = survey(
        program, machine, tools, stock, resolution_mm=resolution_mm, on_progress=lambda d, n: on_progress(0.2 * d / n)
    )
    motion = ShapedMotion(machine, choose_grid(machine, block_period_s))
    wanted = margin
    for attempt in range(_ROUNDS):
        planned = schedule_survey(surveyed, machine, motion=motion, margin=margin)
        conversion = convert(
            planned.written,
            machine,
            arc_feed_ratio=arc_feed_ratio,
            block_period_s=block_period_s,
            budget=budget,
            shape_all=True,
            tolerance_curve=attempt == 0,
        )
        on_progress(0.2 + 0.8 * (attempt + 1) / _ROUNDS)
        emitted = _measured(planned, conversion, machine, wanted)
        if emitted.excess_ratio <= 0.0:
            break
        margin += emitted.excess_ratio + 0.005  # a little more than the last round exceeded it
    changed: dict[str, object] = {"warnings": tuple(dict.fromkeys([*emitted.warnings, *conversion.warnings]))}
    if not emitted.ok:
        changed |= {
            "emitted": conversion.emitted.with_verdict(good=False),
            "recommendation": "do not run",
            "reason": emitted.answer,
        }
    scheduled = ScheduledConversion(**vars(conversion) | changed, feed_schedule=emitted)
    found = translated(scheduled)
    return scheduled if found is None else replace(scheduled, written=found.text)  # with that verdict in its header


def _measured(planned: FeedSchedule, conversion: Conversion, machine: Machine, margin: float) -> FeedSchedule:
    """The schedule with the loads of the emitted program."""
    placed = {id(place.region): place for place in conversion.placed}
    ordinary = OrdinaryMotion(machine)
    loads: list[PathLoad | None] = []
    for part, region, load in zip(planned.survey.regions, planned.written.regions, planned.loads, strict=True):
        if load is None:
            loads.append(None)
            continue
        along, window_s = part.region.path, part.window_s
        if (place := placed.get(id(region))) is None:
            travelled = ordinary.travel(region.path, along, load.s_mm, window_s)
        else:
            travelled = travel_emitted(place.blocks(conversion.emitted), along, machine, load.s_mm, window_s)
        loads.append(replace(load, emitted=load_of(part, travelled)))
    return feed_figures(
        planned.survey, planned.plans, loads, machine, margin=margin, text=planned.text, written=planned.written,
        cycle_time_s=replace(planned.cycle_time_s, emitted=conversion.cycle_time_s.emitted),
        blocks=replace(planned.blocks, emitted=conversion.blocks.emitted),
    )  # fmt: skip
