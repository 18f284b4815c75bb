"""On what a conversion is written: the block period and the shaper on it, chosen for a machine."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import axis_modes, mode_tables, moving_axis, numbered_modes, still_mode
from shapegcode.shaping.bands import NO_MODE, ModeBand, machine_bands
from shapegcode.shaping.block_period import (
    BlockPeriodCandidate,
    BlockPeriodChoice,
    candidate_periods,
    check_block_period,
    choose_block_period,
    robust_candidate,
)
from shapegcode.shaping.designs import DesignOptions
from shapegcode.shaping.registry import design
from shapegcode.shaping.track import MovingMode, ShaperTrack, design_per_axis, design_track

_STROKES_S = (0.25, 0.4, 0.7)  # at the feed: how a ripple meets a mode's own motion depends on the length


@dataclass(frozen=True)
class Grid:
    """On what a conversion is written: block period and the shaper on it."""

    block_period_s: float  # T_B
    shaper: _core.Shaper  # the design, times on the block grid
    fir: _core.Fir  # the same in whole block periods
    # shapers along an axis, used instead where its position is known; None: no mode varies with position
    track: ShaperTrack | None = None
    family: str = ""  # name of the design's row in the registry of families
    note: str = ""  # what a user should know of the choice; empty: nothing
    # a shaper for each of X, Y, Z in whole block periods, used instead; empty: the one for all
    axis_firs: tuple[_core.Fir, ...] = ()
    per_axis_duration_s: float | None = None  # how long such shapers would be, s; None: not looked for, or not shorter

    @property
    def shapers(self) -> tuple[_core.Shaper, ...]:
        """All shapers that may act."""
        return (self.shaper, *(node.shaper for node in (self.track.nodes if self.track else ())))

    @property
    def duration_s(self) -> float:
        """Time of the last tap of the longest shaper, s."""
        if self.axis_firs:
            return max(fir.duration_samples for fir in self.axis_firs) * self.block_period_s
        return max(shaper.duration_s for shaper in self.shapers)


def make_grid(
    block_period_s: float, shaper: _core.Shaper, track: ShaperTrack | None = None, *, family: str = "", note: str = ""
) -> Grid:
    """Grid of a shaper whose times are whole block periods, and of shapers that follow an axis."""
    delays = [round(t / block_period_s) for t in shaper.times_s]
    return Grid(block_period_s, shaper, _core.Fir(delays, list(shaper.amplitudes)), track, family, note)


def choose_grid(
    machine: Machine | str | Path, block_period_s: float | None = None, *, fastest_mm_per_s: float | None = None
) -> Grid:
    """Block period and shaper for all modes of a machine, and shapers that follow moving modes.

    With `shaping.family` = "auto" the shortest shaper without negative impulses that leaves at most
    `shaping.vibration_limit` of the vibration anywhere in the modes' stated bands; exact where no band is stated. With
    a named family its shortest one. Text that shall bear a turned feed override (`Machine.bears_override`) gets the
    period that suits other feed overrides, see `best_for_dial`.

    Args:
        machine: modes and controller.
        block_period_s: a period to use; None: `emission.block_period_s`, or the best one.
        fastest_mm_per_s: the fastest feed that is programmed; None: the slowest of the axes' largest feeds.

    Returns:
        The grid: block period, shaper for all axes, shapers for stretches of the moving axis.

    Raises:
        DesignError: no shaper exists within `shaping.max_duration_s`.
        ArgumentError: the machine has no mode, its modes vary over several axes, or the period does not fit the
            controller.
    """
    machine = Machine.of(machine)
    if not any(axis.modes for axis in machine.axes.as_tuple()):
        raise _core.ArgumentError(NO_MODE)
    bands = machine_bands(machine)
    shaping, controller = machine.shaping, machine.controller
    period = block_period_s if block_period_s is not None else machine.emission.block_period_s
    if period is not None:
        check_block_period(period, machine)
    feed = fastest_mm_per_s or min(axis.max_feed_mm_per_min for axis in machine.axes.as_tuple()) / 60.0
    if shaping.family != "auto":
        if shaping.per_axis:
            raise _core.ArgumentError(f'shaping.per_axis needs shaping.family = "auto": it is {shaping.family!r}')
        if moving_axis(machine) is not None:
            raise _core.ArgumentError(
                f"shaping.family = {shaping.family!r}: modes that move with an axis (frequency_over) are followed by "
                'shapers without negative impulses; use "auto"'
            )
        return _of_family(shaping.family, bands, machine, period, feed)
    family = "robust" if any(band.uncertainty for band in bands) else "non-negative"
    best: BlockPeriodChoice | BlockPeriodCandidate
    if period is None:
        best = choose_block_period(
            bands, controller.interpolation_period_s, controller.block_time_s,
            max_duration_s=shaping.max_duration_s, vibration_limit=shaping.vibration_limit,
        )  # fmt: skip
        if machine.bears_override:
            designs = [(each.period_s, each.shaper) for each in best.candidates if each.shaper is not None]
            period, _ = best_for_dial(designs, machine, feed)
    if period is not None:
        best = robust_candidate(bands, period, shaping.max_duration_s, shaping.vibration_limit)
    assert best.shaper is not None  # what is chosen exists
    grid = make_grid(best.period_s, best.shaper, _track(machine, best.period_s), family=family, note=best.note)
    return _per_axis(grid, machine, exact=family == "non-negative")


def _per_axis(grid: Grid, machine: Machine, *, exact: bool) -> Grid:
    """The grid with a shaper for each axis where the machine file asks for it, or with a note of its duration."""
    wanted = machine.shaping.per_axis
    possible = exact and grid.track is None and machine.shaping.contour != "off"
    if not possible:
        if wanted:
            raise _core.ArgumentError(
                "shaping.per_axis needs shaping.contour (different shapers distort the path), shaping.family = "
                '"auto", and modes without frequency_uncertainty_percent and frequency_over axis'
            )
        return grid
    longest = machine.shaping.max_duration_s if wanted else grid.shaper.duration_s - 0.5 * grid.block_period_s
    firs = design_per_axis(axis_modes(machine), grid.block_period_s, longest)
    if firs is None:
        if wanted:
            raise _core.DesignError(
                f"no shapers of equal mean delay for each axis within {longest * 1e3:g} ms on a "
                f"{grid.block_period_s * 1e3:g} ms grid; the one for all axes lasts {grid.shaper.duration_s * 1e3:g} ms"
            )
        return grid
    if wanted:
        return replace(grid, axis_firs=tuple(firs))
    duration_s = max(fir.duration_samples for fir in firs) * grid.block_period_s
    return replace(grid, per_axis_duration_s=duration_s)


def _of_family(
    name: str, bands: list[ModeBand], machine: Machine, period_s: float | None, feed_mm_per_s: float
) -> Grid:
    """The shortest shaper of a family, on one grid or on the one on which it is shortest."""
    shaping = machine.shaping
    periods_s = (
        [period_s]
        if period_s is not None
        else candidate_periods(bands, machine, shaping.max_duration_s, shaping.vibration_limit)
    )
    found = []
    refusals = []
    for each in periods_s:
        options = DesignOptions(each, shaping.max_duration_s, vibration_limit=shaping.vibration_limit)
        try:
            found.append((design(name, bands, options)[0], each))
        except _core.DesignError as error:
            refusals.append(str(error))
    if not found:
        raise _core.DesignError(f"shaping.family = {name!r}: {refusals[0]}")
    best, period = min(found, key=lambda pair: (pair[0].duration_s, -pair[1]))
    if machine.bears_override and len(found) > 1:
        period, _ = best_for_dial([(each, design.shaper) for design, each in found], machine, feed_mm_per_s)
        best = next(design for design, each in found if each == period)
    note = ""
    if best.worst_residual > shaping.vibration_limit:
        note = (
            f"the {name} shaper leaves up to {best.worst_residual:.1%} of the vibration within the modes' bands, "
            f"shaping.vibration_limit is {shaping.vibration_limit:.1%}"
        )
    return make_grid(period, best.shaper, _track(machine, period), family=name, note=note)


def _track(machine: Machine, period_s: float) -> ShaperTrack | None:
    return None if moving_axis(machine) is None else shaper_track(machine, period_s)


def shaper_track(
    machine: Machine, period_s: float, max_duration_s: float | None = None, *, residual_limit: float = 0.01
) -> ShaperTrack:
    """Shapers for all modes of a machine along the axis over which some of them vary."""
    axis = moving_axis(machine)
    if axis is None:
        raise _core.ArgumentError("no mode of the machine file varies with the position of an axis (frequency_over)")
    tables = [table for of_axis in mode_tables(machine) for table in of_axis]
    modes = [
        MovingMode(still_mode(mode, machine.shaping.part_mass_kg), table if len(table.position_mm) else None)
        for (_, _, mode), table in zip(numbered_modes(machine), tables, strict=True)
    ]
    reached = [position for table in tables for position in table.position_mm]
    longest = machine.shaping.max_duration_s if max_duration_s is None else max_duration_s
    span = (min(reached), max(reached))
    return design_track(modes, axis, span, period_s, longest, residual_limit=residual_limit)


def dial_vibration_um(block_period_s: float, shaper: _core.Shaper, model: MachineModel, feed_mm_per_s: float) -> float:
    """Largest residual vibration of straight moves in equal blocks, over the feed overrides."""
    moves = np.array([float(bool(axis.modes)) for axis in model.machine.axes.as_tuple()])
    speed = feed_mm_per_s * math.sqrt(moves.sum())
    fir = _core.Fir([round(t / block_period_s) for t in shaper.times_s], list(shaper.amplitudes))
    worst_mm = 0.0
    for stroke_s in _STROKES_S:
        path = _core.Path([_core.Segment.line(np.zeros(3), moves * feed_mm_per_s * stroke_s, speed)])
        samples = fir.apply(_core.interpolate(path, _core.plan_speed(path, model.limits()), block_period_s))
        ways = np.linalg.norm(np.diff(samples, axis=0), axis=1)
        blocks = _core.Path(
            [
                _core.Segment.line(start, end, way / block_period_s)
                for start, end, way in zip(samples[:-1], samples[1:], ways, strict=True)
                if way > 0.0
            ]
        )
        for ratio in model.machine.dial_positions:
            played = model.play_emitted(blocks, path, override=ratio, contour=False)
            worst_mm = max(worst_mm, float(played.residual_mm.max()))
    return worst_mm * 1e3


def best_for_dial(
    designs: Iterable[tuple[float, _core.Shaper]], machine: Machine, feed_mm_per_s: float
) -> tuple[float, _core.Shaper]:
    """The block period with the best of both: a short shaper, and little vibration with another feed override.

    What stays below `tolerance.residual_floor_um` counts as that. Above it twice the vibration weighs as much as a
    shaper of twice the duration.
    """
    model = MachineModel(machine)
    floor_um = max(machine.tolerance.residual_floor_um, 1e-3)

    def cost(design: tuple[float, _core.Shaper]) -> float:
        period_s, shaper = design
        return shaper.duration_s * max(floor_um, dial_vibration_um(period_s, shaper, model, feed_mm_per_s))

    return min(designs, key=cost)
