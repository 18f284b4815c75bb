"""What a user asks of the choice among shapers: modes in words or of a machine, and the block periods worth trying."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from shapegcode._core import ArgumentError, DesignError, Mode, Shaper
from shapegcode.shaping.bands import NARROW_PERCENT, ModeBand, parse_mode_band
from shapegcode.shaping.choose import choose
from shapegcode.shaping.options import DesignOptions
from shapegcode.shaping.ranking import SAME
from shapegcode.shaping.result import Recommendation
from shapegcode.shaping.robust.search import Task, shortest_below
from shapegcode.shaping.taps import parse_taps

if TYPE_CHECKING:
    from shapegcode.machine import Machine

__all__ = ["NARROW_PERCENT", "candidate_periods", "check_block_period", "choose_shaper", "machine_bands"]

_ASSUMED_TICK_S = 0.001  # interpolation period where no machine states one
_LONGEST_BLOCK_PERIOD_S = 0.02
_PERIODS_COMPARED = 3
_SLOWEST_PERIODS = 3.0  # longest shaper where none is stated: three-hump EI of the slowest mode and of a faster one
_FINEST_SHARE = 1.0 / 32.0  # of the fastest mode's period: a finer grid is as good as continuous times
_WHOLE = 1e-6  # interpolation periods
_ROUNDING = 1e-9  # relative
_BAND = re.compile(r"±|\+-|\+/-")  # a stated band, even one of 0


def choose_shaper(
    modes: Sequence[str | Mode | ModeBand] = (),
    *,
    machine: Machine | None = None,
    uncertainty: float = 0.0,
    periods_s: Sequence[float | None] | None = None,
    families: Sequence[str] | None = None,
    max_duration_s: float | None = None,
    max_abs_sum: float = 10.0,
    vibration_limit: float | None = None,
    objective: str = "shortest",
    allow_negative: bool = False,
    taps: str | Shaper | None = None,
    on_progress: Callable[[float], None] = lambda _: None,
) -> Recommendation:
    """Compare every family of shapers for some modes, and recommend one.

    >>> import shapegcode as sg
    >>> sg.choose_shaper(["46:0.02±5%", "131:0.02"], periods_s=[0.005]).design.shaper

    Args:
        modes: texts such as ``46:0.02±5%`` (Hz, damping ratio, band), modes or bands; empty: those of the machine.
        machine: its modes, unless some are given, and its controller: the block periods worth trying.
        uncertainty: half width of the band, relative, of modes that state none.
        periods_s: grids on which the taps may lie, s; None among them: continuous times too. None: with a machine its
            block period or the best few, without one continuous times and the best few multiples of 1 ms.
        families: names of the families to compare; None: all.
        max_duration_s: longest shaper in s; None: three periods of the slowest mode, and the machine's limit if that
            is not enough.
        max_abs_sum: largest sum of the taps' magnitudes.
        vibration_limit: largest worst residual ratio of the design to take; None: the machine's
            `shaping.vibration_limit`, without a machine 0.05.
        objective: "shortest", "contour" (least contour cost) or "robust" (least worst residual).
        allow_negative: whether a design with negative taps may be taken.
        taps: a shaper of the user's own, compared with the others: as text ("0:.5,10.9ms:.5") or as it is.
        on_progress: called with the share of the work done, 0 to 1.

    Raises:
        ArgumentError: neither modes nor a machine with modes, equal modes, or a value outside its range.
        DesignError: a mode cannot be cancelled on any of the grids, or no family has a design within the limits.
    """
    if modes:
        bands = [_band(each, uncertainty) for each in modes]
    elif machine is not None:
        bands = machine_bands(machine, uncertainty)
    else:
        raise ArgumentError("a comparison of shapers needs modes or a machine: neither is given")
    if periods_s is not None and machine is not None:
        for period_s in periods_s:
            if period_s is not None:
                check_block_period(period_s, machine)
    own = parse_taps(taps) if isinstance(taps, str) else taps
    if vibration_limit is None:
        vibration_limit = DesignOptions.vibration_limit if machine is None else machine.shaping.vibration_limit
    limit = vibration_limit

    def compared(longest_s: float) -> Recommendation:
        options = DesignOptions(None, longest_s, max_abs_sum, limit, own)
        kinds = periods_s
        if kinds is None:
            best = candidate_periods(bands, machine, longest_s, limit)
            kinds = best if machine is not None else [None, *best]
        return choose(
            bands, kinds, options, families=families, objective=objective, allow_negative=allow_negative,
            on_progress=on_progress,
        )  # fmt: skip

    if max_duration_s is not None:
        return compared(max_duration_s)
    usual_s = math.ceil(1e3 * _SLOWEST_PERIODS / min(band.mode.frequency_hz for band in bands)) / 1e3
    if machine is None:
        return compared(usual_s)
    longest_s = machine.shaping.max_duration_s
    if usual_s < longest_s:
        # Long shapers take long to find, and are wanted only where there is no short one.
        with contextlib.suppress(DesignError):
            result = compared(usual_s)
            if result.ok and result.design.exact:
                return result
    return compared(longest_s)


def check_block_period(period_s: float, machine: Machine) -> None:
    """Refuse a block period that the machine's controller cannot play.

    Raises:
        ArgumentError: not finite and above 0, no whole multiple of the interpolation period, or below the block time.
    """
    if not (math.isfinite(period_s) and period_s > 0.0):
        raise ArgumentError(f"block period is {period_s} s, must be finite and above 0")
    tick_s, block_time_s = machine.controller.interpolation_period_s, machine.controller.block_time_s
    ticks = period_s / tick_s
    if round(ticks) < 1 or abs(ticks - round(ticks)) > _WHOLE:
        raise ArgumentError(
            f"block period {period_s * 1e3:g} ms is no whole multiple of the interpolation period {tick_s * 1e3:g} ms"
        )
    if period_s < block_time_s * (1.0 - _ROUNDING):
        raise ArgumentError(
            f"block period {period_s * 1e3:g} ms is below the block time {block_time_s * 1e3:g} ms "
            "(controller.block_time_s)"
        )


def machine_bands(machine: Machine, uncertainty: float = 0.0) -> list[ModeBand]:
    """The modes of all axes of a machine with the bands that it states; equal ones once, with the wider band.

    A band as narrow as a tap test gives is none: a shaper that is exact at the nominal frequency leaves less there than
    one that spends `shaping.vibration_limit` all over it. The verdict plays its ends all the same.

    Args:
        machine: its axes' modes; one shaper serves all axes, because different ones would distort the path.
        uncertainty: half width of the band, relative, of modes that state none.

    Raises:
        ArgumentError: the machine has no mode, or an uncertainty outside its range.
    """
    from shapegcode.model.modes import still_mode

    widths: dict[tuple[float, float], float] = {}
    for axis in machine.axes.as_tuple():
        for mode in axis.modes:
            stated = mode.frequency_uncertainty_percent
            width = uncertainty
            if stated is not None:
                width = stated / 100.0 if stated > NARROW_PERCENT else 0.0
            still = still_mode(mode, machine.shaping.part_mass_kg)
            key = still.frequency_hz, still.damping_ratio
            widths[key] = max(width, widths.get(key, 0.0))
    if not widths:
        raise ArgumentError("the machine file gives no vibration mode (axes.x.modes): nothing to shape for")
    return [ModeBand(Mode(*key), width) for key, width in widths.items()]


def candidate_periods(
    bands: Sequence[ModeBand], machine: Machine | None, max_duration_s: float, vibration_limit: float = 0.05
) -> list[float]:
    """The block periods worth comparing, ascending, s: those on which a non-negative shaper is shortest.

    Args:
        bands: the modes.
        machine: a stated block period is the only candidate; else its interpolation period and block time say which
            there are. None: multiples of 1 ms.
        max_duration_s: longest shaper.
        vibration_limit: largest worst residual ratio of the shapers that are compared.

    Returns:
        The best three of those up to 20 ms, among them the longest whose shaper lasts at most 2 % longer than the
        shortest one, which is what a conversion takes; the shortest three if none has such a shaper.

    Raises:
        ArgumentError: a value outside its range.
    """
    if machine is not None and machine.emission.block_period_s is not None:
        return [machine.emission.block_period_s]
    if machine is not None:
        tick_s, least_s = machine.controller.interpolation_period_s, machine.controller.block_time_s
    else:
        least_s = _FINEST_SHARE / max(band.mode.frequency_hz for band in bands)
        tick_s = _ASSUMED_TICK_S * max(1, math.ceil(least_s / _ASSUMED_TICK_S))
    first = max(1, math.ceil(least_s / tick_s - _WHOLE))
    last = max(first + _PERIODS_COMPARED - 1, math.floor(_LONGEST_BLOCK_PERIOD_S / tick_s + _WHOLE))
    every: list[tuple[float, float]] = []  # duration, and the period with a minus: of equal durations the longer one
    for multiple in range(first, last + 1):
        period_s = multiple * tick_s
        # What is longer than the worst of the best so far need not be found.
        longest_s = max_duration_s
        if len(every) >= _PERIODS_COMPARED:
            longest_s = min(longest_s, max(every[_PERIODS_COMPARED - 1][0], (1.0 + SAME) * every[0][0]))
        task = Task.checked(bands, period_s, non_negative=True, max_abs_sum=1.0, zeros_at_nominal=False)
        found = shortest_below(task, vibration_limit, longest_s, least_cost=False)
        if found is not None:
            every = sorted([*every, (round(found.shaper.duration_s, 9), -period_s)])
    if not every:
        return [multiple * tick_s for multiple in range(first, first + _PERIODS_COMPARED)]
    taken = max(-period for duration, period in every if duration <= (1.0 + SAME) * every[0][0])
    others = [-period for _, period in every if -period != taken]
    return sorted([taken, *others[: _PERIODS_COMPARED - 1]])


def _band(given: str | Mode | ModeBand, uncertainty: float) -> ModeBand:
    if isinstance(given, Mode):
        return ModeBand(given, uncertainty)
    if isinstance(given, ModeBand):
        return given
    band = parse_mode_band(given)
    return band if _BAND.search(given) else ModeBand(band.mode, uncertainty)
