"""Block period of a conversion and the shaper on its grid, chosen for a machine."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from shapegcode import _core
from shapegcode._core import ArgumentError, DesignError, Mode, Shaper
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import excited_modes, moving_axis, numbered_modes, position_table, still_mode
from shapegcode.shaping.bands import (
    NO_MODE,
    ON_GRID,
    SAME,
    VIBRATION_LIMIT,
    DesignOptions,
    ModeBand,
    band_names,
    check_modes_and_times,
    machine_bands,
    ms,
    whole_periods,
)
from shapegcode.shaping.grid_designs import shortest_non_negative
from shapegcode.shaping.track import MovingMode, ShaperTrack, design_per_axis, design_track, shaper_fir

_ASSUMED_PERIOD_S = 0.001  # interpolation period without a machine
_LONGEST_BLOCK_PERIOD_S = 0.02
_PERIODS_COMPARED = 3
_FINEST_SHARE = 1.0 / 32.0  # of the fastest mode's period; finer grids are as good as continuous times
_WHOLE = 1e-6  # interpolation periods
_ROUNDING = 1e-9  # relative


@dataclass(frozen=True)
class BlockPeriodCandidate:
    """One row of the comparison of block periods."""

    period_s: float  # block period, s, a whole multiple of the interpolation period
    shaper: Shaper | None  # best on that grid; None: no design
    refusal: str = ""  # why there is no design; else empty
    # largest residual ratio over the modes' bands, proven; None: no shaper, or no mode with a band
    worst_residual: float | None = None
    note: str = ""  # a sentence for the report if the shaper exceeds the vibration limit; else empty


@dataclass(frozen=True)
class BlockPeriodChoice:
    """The chosen block period, its shaper, and all candidates."""

    period_s: float  # block period, s
    shaper: Shaper  # best on its grid
    candidates: tuple[BlockPeriodCandidate, ...]  # every tried period, ascending, including the chosen one
    worst_residual: float | None  # largest residual ratio over the modes' bands, proven; None: no mode with a band
    note: str  # a sentence for the report if the shaper exceeds the vibration limit; else empty


def choose_block_period(
    modes: Sequence[Mode | ModeBand],
    interpolation_period_s: float,
    block_time_s: float,
    max_block_period_s: float = 0.02,
    max_duration_s: float = 0.25,
    vibration_limit: float = VIBRATION_LIMIT,
) -> BlockPeriodChoice:
    """Choose the block period with the shortest non-negative shaper.

    Every whole multiple of the interpolation period from the controller's block time up to `max_block_period_s` is
    tried. The shortest duration wins; within 2 % of it the longest period wins, because it needs the
    fewest blocks.

    A mode without a band is cancelled exactly; if any has a band, the residual ratio is at most `vibration_limit`
    within the bands. If in that case no period has such a design within `max_duration_s`, the
    designs with the smallest worst residual within that duration are compared: the period with the smallest one wins
    (within 2 % of it the longest period), and `note` says so.

    Args:
        modes: modes to cancel, with or without bands, at least one.
        interpolation_period_s: of the controller, s, above 0.
        block_time_s: shortest time of a block in the controller, s, at least 0.
        max_block_period_s: longest block period, s; the path is sampled once per block.
        max_duration_s: longest shaper, s.
        vibration_limit: largest residual ratio over the bands, above 0 and below 1.

    Returns:
        The period, its shaper, the worst residual over bands, and all candidates. If modes have bands, the contour
        cost is minimised only for the chosen one.

    Raises:
        ArgumentError: no mode, a value outside its range, or no multiple of the interpolation period in the range.
        DesignError: no candidate has a design: modes without a band cannot be cancelled within `max_duration_s`, or
            in every grid a frequency within the bands aliases to 0 Hz.

    Source: this project.
    """
    bands = [each if isinstance(each, ModeBand) else ModeBand(each) for each in modes]
    times_s = {"max_block_period_s": max_block_period_s, "max_duration_s": max_duration_s}
    check_modes_and_times(bands, interpolation_period_s=interpolation_period_s, **times_s)
    if not (math.isfinite(block_time_s) and block_time_s >= 0.0):
        raise ArgumentError(f"block_time_s is {block_time_s} s: it must be finite and at least 0")
    fewest = max(1, math.ceil(block_time_s / interpolation_period_s - ON_GRID))
    most = whole_periods(max_block_period_s, interpolation_period_s)
    if fewest > most:
        raise ArgumentError(
            f"no block period between the block time of {ms(block_time_s)} and the limit of "
            f"{ms(max_block_period_s)} is a multiple of the interpolation period of {ms(interpolation_period_s)}"
        )
    periods_s = [multiple * interpolation_period_s for multiple in range(fewest, most + 1)]
    candidates = tuple(_candidate(bands, each, max_duration_s, vibration_limit) for each in periods_s)
    wide = any(band.uncertainty for band in bands)
    if any(each.shaper is not None for each in candidates):
        choice = _shortest(candidates)
        if not wide:
            return choice
        best = _candidate(bands, choice.period_s, max_duration_s, vibration_limit, min_cost=True)
        return _shortest(tuple(best if each.period_s == choice.period_s else each for each in candidates))
    if wide:
        candidates = tuple(_fallback(each, bands, max_duration_s, vibration_limit) for each in candidates)
        found = [(each, each.worst_residual) for each in candidates if each.worst_residual is not None]
        if found:
            least = (1.0 + SAME) * min(worst for _, worst in found)
            near = (each for each, worst in found if worst <= least)
            return _choice(max(near, key=lambda each: each.period_s), candidates)
    raise DesignError(
        f"no block period from {ms(periods_s[0])} to {ms(periods_s[-1])} in steps of {ms(interpolation_period_s)} has "
        f"a shaper without negative impulses within {ms(max_duration_s)} for {band_names(bands)}; on the first: "
        f"{candidates[0].refusal}"
    )


def robust_candidate(
    bands: Sequence[ModeBand], period_s: float, max_duration_s: float = 0.25, vibration_limit: float = VIBRATION_LIMIT
) -> BlockPeriodCandidate:
    """The candidate of :func:`choose_block_period` on one period."""
    check_modes_and_times(bands, period_s=period_s, max_duration_s=max_duration_s)
    candidate = _candidate(bands, period_s, max_duration_s, vibration_limit, min_cost=True)
    if candidate.shaper is None and any(band.uncertainty for band in bands):
        candidate = _fallback(candidate, bands, max_duration_s, vibration_limit)
    if candidate.shaper is None:
        raise DesignError(candidate.refusal)
    return candidate


def _shortest(candidates: tuple[BlockPeriodCandidate, ...]) -> BlockPeriodChoice:
    durations_s = [each.shaper.duration_s for each in candidates if each.shaper is not None]
    limit_s = (1.0 + SAME) * min(durations_s)
    short = [each for each in candidates if each.shaper is not None and each.shaper.duration_s <= limit_s]
    return _choice(max(short, key=lambda each: each.period_s), candidates)


def _choice(chosen: BlockPeriodCandidate, candidates: tuple[BlockPeriodCandidate, ...]) -> BlockPeriodChoice:
    assert chosen.shaper is not None
    return BlockPeriodChoice(chosen.period_s, chosen.shaper, candidates, chosen.worst_residual, chosen.note)


def _candidate(
    bands: Sequence[ModeBand], period_s: float, max_duration_s: float, limit: float, *, min_cost: bool = False
) -> BlockPeriodCandidate:
    """Shortest design on a grid, or why there is none (without the search for a remedy)."""
    if not any(band.uncertainty for band in bands):
        try:
            shaper = shortest_non_negative([band.mode for band in bands], period_s, max_duration_s)
        except DesignError as error:
            return BlockPeriodCandidate(period_s, None, str(error))
        return BlockPeriodCandidate(period_s, shaper)
    from shapegcode.shaping.robust import Task, refusal, shortest_below

    if not 0.0 < limit < 1.0:
        raise ArgumentError(f"vibration_limit is {limit}: it must be above 0 and below 1")
    task = Task.checked(bands, period_s)
    found = shortest_below(task, limit, max_duration_s, min_cost=min_cost)
    if found is None:
        return BlockPeriodCandidate(period_s, None, refusal(task, limit, max_duration_s))
    return BlockPeriodCandidate(period_s, found.shaper, worst_residual=found.worst_residual)


def _fallback(
    refused: BlockPeriodCandidate, bands: Sequence[ModeBand], max_duration_s: float, limit: float
) -> BlockPeriodCandidate:
    """Design with the smallest worst residual within the longest duration, with a note; *refused* if there is none."""
    from shapegcode.shaping.robust import Task, best_within, unreachable

    task = Task.checked(bands, refused.period_s)
    last = task.periods(max_duration_s)
    found = best_within(task, last) if last and not unreachable(task) else None
    if found is None:
        return refused
    note = (
        f"no shaper within {ms(max_duration_s)} keeps {band_names(bands)} below {100.0 * limit:.3g} % of the vibration "
        f"on a {ms(refused.period_s)} grid: that with the smallest worst residual, {100.0 * found.worst_residual:.3g} "
        "%, is used"
    )
    return BlockPeriodCandidate(found.period_s, found.shaper, worst_residual=found.worst_residual, note=note)


def check_block_period(period_s: float, machine: Machine) -> None:
    """Refuse a block period that the machine's controller cannot run."""
    if not (math.isfinite(period_s) and period_s > 0.0):
        raise ArgumentError(f"block period is {period_s} s, must be finite and above 0")
    interpolation_s, block_time_s = machine.controller.interpolation_period_s, machine.controller.block_time_s
    ticks = period_s / interpolation_s
    if round(ticks) < 1 or abs(ticks - round(ticks)) > _WHOLE:
        raise ArgumentError(
            f"block period {period_s * 1e3:g} ms is not a multiple of the interpolation period "
            f"{interpolation_s * 1e3:g} ms"
        )
    if period_s < block_time_s * (1.0 - _ROUNDING):
        raise ArgumentError(
            f"block period {period_s * 1e3:g} ms is below the block time {block_time_s * 1e3:g} ms "
            "(controller.block_time_s)"
        )


def candidate_periods(
    bands: Sequence[ModeBand], machine: Machine | None, max_duration_s: float, vibration_limit: float = 0.05
) -> list[float]:
    """Block periods to compare, ascending, s: the machine's, or three, of the shortest non-negative shapers if any."""
    from shapegcode.shaping.robust import Task, shortest_below

    if machine is not None and machine.emission.block_period_s is not None:
        return [machine.emission.block_period_s]
    if machine is not None:
        interpolation_s, min_s = machine.controller.interpolation_period_s, machine.controller.block_time_s
    else:
        min_s = _FINEST_SHARE / max(band.mode.frequency_hz for band in bands)
        interpolation_s = _ASSUMED_PERIOD_S * max(1, math.ceil(min_s / _ASSUMED_PERIOD_S))
    first = max(1, math.ceil(min_s / interpolation_s - _WHOLE))
    last = max(first + _PERIODS_COMPARED - 1, math.floor(_LONGEST_BLOCK_PERIOD_S / interpolation_s + _WHOLE))
    every: list[tuple[float, float]] = []  # duration and negative period: of equal durations the longer period first
    for multiple in range(first, last + 1):
        period_s = multiple * interpolation_s
        # Search up to the third shortest duration so far, at least up to 2 % above the shortest one.
        longest_s = max_duration_s
        if len(every) >= _PERIODS_COMPARED:
            longest_s = min(longest_s, max(every[_PERIODS_COMPARED - 1][0], (1.0 + SAME) * every[0][0]))
        task = Task.checked(bands, period_s)
        found = shortest_below(task, vibration_limit, longest_s, min_cost=False)
        if found is not None:
            every = sorted([*every, (round(found.shaper.duration_s, 9), -period_s)])
    if not every:
        return [multiple * interpolation_s for multiple in range(first, first + _PERIODS_COMPARED)]
    taken = max(-period for duration, period in every if duration <= (1.0 + SAME) * every[0][0])
    others = [-period for _, period in every if -period != taken]
    return sorted([taken, *others[: _PERIODS_COMPARED - 1]])


_MOVES_S = (0.25, 0.4, 0.7)  # durations of moves at the feed: how ripple and vibration add up depends on the length


@dataclass(frozen=True)
class Grid:
    """Grid of a conversion: block period and shaper."""

    block_period_s: float  # duration of a block, s
    shaper: _core.Shaper  # the design, times on the block grid
    fir: _core.Fir  # as a filter in whole block periods
    # shapers along an axis, used instead where its position is known; None: no mode varies with position
    track: ShaperTrack | None = None
    family: str = ""  # name of the design's row in the registry of families
    note: str = ""  # remark on the choice for the user; may be empty
    # a shaper for each of X, Y, Z in whole block periods, used instead; empty: the one for all
    axis_firs: tuple[_core.Fir, ...] = ()
    per_axis_duration_s: float | None = None  # duration of shapers per axis, s; None: not searched, or not shorter

    @property
    def shapers(self) -> tuple[_core.Shaper, ...]:
        """All shapers that may be used, without those of `axis_firs`."""
        return (self.shaper, *(node.shaper for node in (self.track.nodes if self.track else ())))

    @property
    def duration_s(self) -> float:
        """Time of the last impulse of the longest shaper, s."""
        if self.axis_firs:
            return max(fir.duration_samples for fir in self.axis_firs) * self.block_period_s
        return max(shaper.duration_s for shaper in self.shapers)


def make_grid(
    block_period_s: float, shaper: _core.Shaper, track: ShaperTrack | None = None, *, family: str = "", note: str = ""
) -> Grid:
    """Make the grid of a shaper in whole block periods, and of shapers that follow an axis."""
    return Grid(block_period_s, shaper, shaper_fir(shaper, block_period_s), track, family, note)


def choose_grid(
    machine: Machine | str | Path, block_period_s: float | None = None, *, fastest_mm_per_s: float | None = None
) -> Grid:
    """Choose block period and shaper for all modes of a machine, and shapers that follow moving modes.

    With `shaping.family` = "auto" the shaper is the shortest one without negative impulses whose residual ratio stays
    within `shaping.vibration_limit` over the modes' bands (else the one with the smallest worst residual), and is zero
    for modes without a band. With a named family it is the shortest one of that family. If neither argument nor file
    gives a period, an override-tolerant program (`Machine.bears_override`) gets the one that suits other feed
    overrides, see `best_for_overrides`.

    Args:
        machine: modes and controller.
        block_period_s: the period to use; None: `emission.block_period_s`, or the best one.
        fastest_mm_per_s: fastest programmed feed; None: the slowest of the axes' largest feeds.

    Returns:
        The grid: block period, shaper for all axes, shapers along the followed axis, shapers per axis if requested.

    Raises:
        DesignError: no shaper exists within `shaping.max_duration_s`.
        ArgumentError: the machine has no mode, its modes vary over several axes or do not suit `shaping.family` or
            `shaping.per_axis`, or the period does not fit the controller.
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
            period = best_for_overrides(designs, machine, feed)
    if period is not None:
        best = robust_candidate(bands, period, shaping.max_duration_s, shaping.vibration_limit)
    assert best.shaper is not None  # a chosen candidate has a shaper
    track = None if moving_axis(machine) is None else shaper_track(machine, best.period_s)
    grid = make_grid(best.period_s, best.shaper, track, family=family, note=best.note)
    return _per_axis(grid, machine, exact=family == "non-negative")


def _per_axis(grid: Grid, machine: Machine, *, exact: bool) -> Grid:
    """Add shapers per axis if the machine file requests them; else note their duration if below the common shaper's."""
    wanted = machine.shaping.per_axis
    possible = exact and grid.track is None and machine.shaping.contour != "off"
    if not possible:
        if wanted:
            raise _core.ArgumentError(
                "shaping.per_axis needs shaping.contour (different shapers distort the path), shaping.family = "
                '"auto", and modes without frequency_uncertainty_percent whose frequency does not depend on an axis '
                "position (frequency_over)"
            )
        return grid
    longest = machine.shaping.max_duration_s if wanted else grid.shaper.duration_s - 0.5 * grid.block_period_s
    firs = design_per_axis(excited_modes(machine), grid.block_period_s, longest)
    if firs is None:
        if wanted:
            raise _core.DesignError(
                f"no shapers of equal mean delay for each axis within {longest * 1e3:g} ms on a "
                f"{grid.block_period_s * 1e3:g} ms grid; the one for all axes takes {grid.shaper.duration_s * 1e3:g} ms"
            )
        return grid
    if wanted:
        return replace(grid, axis_firs=tuple(firs))
    duration_s = max(fir.duration_samples for fir in firs) * grid.block_period_s
    return replace(grid, per_axis_duration_s=duration_s)


def _of_family(
    name: str, bands: list[ModeBand], machine: Machine, period_s: float | None, feed_mm_per_s: float
) -> Grid:
    """Shortest shaper of a family, on one grid or on the best grid."""
    from shapegcode.shaping.registry import design

    shaping = machine.shaping
    limits = shaping.max_duration_s, shaping.vibration_limit
    periods_s = candidate_periods(bands, machine, *limits) if period_s is None else [period_s]
    found, refusals = [], []
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
        period = best_for_overrides([(each, design.shaper) for design, each in found], machine, feed_mm_per_s)
        best = next(design for design, each in found if each == period)
    note = ""
    if best.worst_residual > shaping.vibration_limit:
        note = (
            f"the {name} shaper has a residual of up to {best.worst_residual:.1%} within the modes' bands, "
            f"shaping.vibration_limit is {shaping.vibration_limit:.1%}"
        )
    return make_grid(period, best.shaper, family=name, note=note)


def shaper_track(machine: Machine, period_s: float) -> ShaperTrack:
    """Design shapers for all modes of a machine, at positions of the axis on which frequencies depend."""
    axis = moving_axis(machine)
    if axis is None:
        raise _core.ArgumentError("no mode of the machine file varies with the position of an axis (frequency_over)")
    numbered = [mode for _, _, mode in numbered_modes(machine)]
    tables = [position_table(mode) for mode in numbered]
    modes = [
        MovingMode(still_mode(mode, machine.shaping.part_mass_kg), table if len(table.position_mm) else None)
        for mode, table in zip(numbered, tables, strict=True)
    ]
    reached = [position for table in tables for position in table.position_mm]
    return design_track(modes, axis, (min(reached), max(reached)), period_s, machine.shaping.max_duration_s)


def override_vibration_um(
    block_period_s: float, shaper: _core.Shaper, model: MachineModel, feed_mm_per_s: float
) -> float:
    """Largest residual vibration over the feed overrides, µm, of straight moves in blocks one block period long."""
    moves = np.array([float(bool(modes)) for modes in excited_modes(model.machine)])
    speed = feed_mm_per_s * math.sqrt(moves.sum())
    fir = shaper_fir(shaper, block_period_s)
    worst_mm = 0.0
    for move_s in _MOVES_S:
        path = _core.Path([_core.Segment.line(np.zeros(3), moves * feed_mm_per_s * move_s, speed)])
        samples = fir.apply(_core.interpolate(path, _core.plan_speed(path, model.limits()), block_period_s))
        lengths = np.linalg.norm(np.diff(samples, axis=0), axis=1)
        blocks = _core.Path(
            [
                _core.Segment.line(start, end, length / block_period_s)
                for start, end, length in zip(samples[:-1], samples[1:], lengths, strict=True)
                if length > 0.0
            ]
        )
        for ratio in model.machine.dial_positions:
            simulated = model.simulate_emitted(blocks, path, override=ratio, contour=False)
            worst_mm = max(worst_mm, float(simulated.residual_mm.max()))
    return worst_mm * 1e3


def best_for_overrides(designs: Iterable[tuple[float, _core.Shaper]], machine: Machine, feed_mm_per_s: float) -> float:
    """Period whose shaper has the smallest duration times vibration (at least the floor) at other overrides."""
    model = MachineModel(machine)
    floor_um = max(machine.tolerance.residual_floor_um, 1e-3)

    def cost(design: tuple[float, _core.Shaper]) -> float:
        period_s, shaper = design
        return shaper.duration_s * max(floor_um, override_vibration_um(period_s, shaper, model, feed_mm_per_s))

    return min(designs, key=cost)[0]
