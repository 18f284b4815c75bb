"""Compares shapers of several families: designs them, marks the useful designs, and recommends one."""

import cmath
import contextlib
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapegcode._core import ArgumentError, DesignError, Mode, ShapegcodeError, Shaper
from shapegcode.machine import Machine
from shapegcode.shaping.bands import (
    Design,
    DesignOptions,
    ModeBand,
    check_modes_and_times,
    evaluate,
    machine_bands,
    mode_band,
    ms,
    parse_taps,
    spoken,
)
from shapegcode.shaping.grid import candidate_periods, check_block_period
from shapegcode.shaping.registry import FAMILIES, Family, design, family_named
from shapegcode.shaping.result import (
    OBJECTIVES,
    Recommendation,
    Refusal,
    is_within,
    pareto_front,
    reason_for,
    recommend,
)
from shapegcode.shaping.robust import least_worst

_SLOWEST_PERIODS = 3.0  # default longest shaper in periods of the slowest mode: its three-hump EI and a faster mode's
_ROBUST = "robust"  # the family whose best design is shown even above the limit
_OWN_TAPS = "taps"  # the family of the user's impulses
_MAX_PERIODS = 5000  # periods in the longest shaper: finer grids are as good as continuous times
_NEAR_ONE = 0.01  # a pole this close to +1 on the grid is a whole number of cycles per period


def choose_shaper(
    modes: float | str | Mode | ModeBand | Machine | Sequence[float | str | Mode | ModeBand] = (),
    *,
    machine: Machine | str | Path | None = None,
    uncertainty: float = 0.0,
    periods_s: float | Sequence[float | None] | None = None,
    families: str | Sequence[str] | None = None,
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
        modes: frequencies in Hz of undamped modes, texts such as ``46:0.02±5%`` (Hz, damping ratio, band), modes or
            bands, pairs (Hz, damping ratio) in a list, modes that `identify` found; empty, or a machine: its own.
        machine: source of the modes, unless given, and of the block periods to try.
        uncertainty: relative half width of the band of modes given without a band.
        periods_s: grids on which the impulses may lie, s; an item None stands for continuous times. No list: with a
            machine its block period or the best few; without a machine continuous times and the best few multiples
            of 1 ms.
        families: names of the families to compare; None: all.
        max_duration_s: longest shaper in s; None: three periods of the slowest mode; with a machine its
            `shaping.max_duration_s` if that is shorter, or if no shaper within three periods keeps the limits.
        max_abs_sum: largest sum of the impulses' magnitudes.
        vibration_limit: limit of the worst residual ratio; None: the machine's
            `shaping.vibration_limit`, without a machine 0.05.
        objective: "shortest", "contour" (least contour cost) or "robust" (smallest worst residual).
        allow_negative: allow a design with negative impulses.
        taps: the user's own shaper, compared with the others: a `Shaper`, or its text, such as "0:.5,10.9ms:.5".
        on_progress: called with the completed fraction, 0 to 1.

    Returns:
        Every design with its figures, the recommended one and the reason.

    Raises:
        ArgumentError: no modes, given or of a machine; two equal modes; or a value outside its range.
        DesignError: a mode cannot be cancelled on any of the grids, or no family has a design within the limits.
    """
    if isinstance(modes, Machine):
        machine, modes = modes, ()
    modes = getattr(modes, "modes", modes)  # of an axis or an identification
    if isinstance(modes, tuple) and len(modes) == 2 and isinstance(modes[1], float) and modes[1] < 1.0:
        modes = [mode_band(modes, uncertainty)]  # a frequency and a damping ratio
    machine = None if machine is None else Machine.of(machine)
    # Convert arrays to lists of Python numbers.
    several: list[float | str | Mode | ModeBand] = np.atleast_1d(np.asarray(modes, dtype=object)).tolist()
    periods = None if periods_s is None else np.atleast_1d(np.asarray(periods_s, dtype=object)).tolist()
    families = None if families is None else np.atleast_1d(np.asarray(families, dtype=object)).tolist()
    if several:
        bands = [mode_band(each, uncertainty) for each in several]
    elif machine is not None:
        bands = machine_bands(machine, uncertainty)
    else:
        raise ArgumentError("a comparison of shapers needs modes or a machine: neither is given")
    if periods is not None and machine is not None:
        for period_s in periods:
            if period_s is not None:
                check_block_period(period_s, machine)
    own = parse_taps(taps) if isinstance(taps, str) else taps
    if vibration_limit is None:
        vibration_limit = DesignOptions.vibration_limit if machine is None else machine.shaping.vibration_limit
    limit = vibration_limit

    def compared(longest_s: float) -> Recommendation:
        options = DesignOptions(None, longest_s, max_abs_sum, limit, own)
        kinds: Sequence[float | None] | None = periods
        if kinds is None:
            best = candidate_periods(bands, machine, longest_s, limit)
            kinds = best if machine is not None else [None, *best]
        result = choose(
            bands, kinds, options, families=families, objective=objective, allow_negative=allow_negative,
            on_progress=on_progress,
        )  # fmt: skip
        return result if several or machine is None else replace(result, machine=machine.name)

    if max_duration_s is not None:
        return compared(max_duration_s)
    usual_s = math.ceil(1e3 * _SLOWEST_PERIODS / min(band.mode.frequency_hz for band in bands)) / 1e3
    if machine is None:
        return compared(usual_s)
    longest_s = machine.shaping.max_duration_s
    if usual_s < longest_s:
        # Long shapers take long to find, and are needed only without a short one.
        with contextlib.suppress(DesignError):
            result = compared(usual_s)
            if result.ok and result.design.exact:
                return result
    return compared(longest_s)


def choose(
    bands: Sequence[ModeBand],
    periods_s: Sequence[float | None] = (None,),
    options: DesignOptions | None = None,
    *,
    families: Sequence[str] | None = None,
    objective: str = "shortest",
    allow_negative: bool = False,
    on_progress: Callable[[float], None] = lambda _: None,
) -> Recommendation:
    """Design all or the given families on each grid of `periods_s` (None: at continuous times), compare, recommend."""
    options = options or DesignOptions()
    _check(bands, periods_s, options, objective)
    # The user's impulses only if given.
    names = [row.name for row in FAMILIES if row.name != _OWN_TAPS] if families is None else list(families)
    rows = [family_named(name) for name in dict.fromkeys([*names, *([] if options.taps is None else [_OWN_TAPS])])]
    wanted = list(dict.fromkeys(periods_s))
    usable = [period_s for period_s in wanted if period_s is None or not _aliases(bands, period_s)]
    if not usable:
        raise DesignError(next(_aliases(bands, period_s) for period_s in wanted if period_s is not None))
    found: list[Design] = []
    refusals: list[Refusal] = []
    work = list(itertools.product(rows, usable))
    for done, (row, period_s) in enumerate(work):
        on_progress(done / len(work))
        if row.continuous if period_s is None else row.on_grid:
            try:
                found += design(row.name, bands, replace(options, period_s=period_s))
            except ShapegcodeError as error:
                refusals.append(Refusal(row.name, period_s, str(error)))
    refusals += _never_tried(rows, usable, bands, periods_s)
    least = _least_worst(rows, usable, bands, options, found)
    found += least
    shown_anyway = {(each.family, each.period_s) for each in least}
    refusals = [each for each in refusals if (each.family, each.period_s) not in shown_anyway]
    if not found:
        reasons = "; ".join(dict.fromkeys(f"{refusal.family}: {refusal.reason}" for refusal in refusals))
        raise DesignError(f"no family has a shaper for {spoken(bands)} within {ms(options.max_duration_s)}: {reasons}")
    compared = tuple(replace(each, pareto=on) for each, on in zip(found, pareto_front(found), strict=True))
    index = recommend(compared, options.vibration_limit, objective, allow_negative)
    return Recommendation(
        modes=tuple(bands),
        designs=compared,
        recommended=index,
        reason=reason_for(compared, index, bands, options.vibration_limit, objective, allow_negative),
        refused=tuple(refusals),
        objective=objective,
        allow_negative=allow_negative,
        vibration_limit=options.vibration_limit,
        max_duration_s=options.max_duration_s,
        max_abs_sum=options.max_abs_sum,
    )


def _check(
    bands: Sequence[ModeBand], periods_s: Sequence[float | None], options: DesignOptions, objective: str
) -> None:
    check_modes_and_times(bands)
    for (first, one), (second, other) in itertools.combinations(enumerate(bands, start=1), 2):
        if (one.mode.frequency_hz, one.mode.damping_ratio) == (other.mode.frequency_hz, other.mode.damping_ratio):
            raise ArgumentError(f"modes {first} and {second} are equal ({one}): specify each mode once")
    if not periods_s:
        raise ArgumentError("a comparison needs at least one period, or None for continuous times: 0 given")
    positive = [("max_duration_s", options.max_duration_s), ("vibration_limit", options.vibration_limit)]
    positive += [("period", period_s) for period_s in periods_s if period_s is not None]
    for name, value in positive:
        if not (math.isfinite(value) and value > 0.0):
            raise ArgumentError(f"{name} is {value:g}: it must be finite and above 0")
    finest_s = min((period_s for period_s in periods_s if period_s is not None), default=math.inf)
    if options.max_duration_s > _MAX_PERIODS * finest_s:
        raise ArgumentError(
            f"a shaper of {ms(options.max_duration_s)} on a grid of {ms(finest_s)} has up to "
            f"{options.max_duration_s / finest_s:.3g} impulses, at most {_MAX_PERIODS} can be searched: use a longer "
            "period or a shorter duration"
        )
    if objective not in OBJECTIVES:
        raise ArgumentError(f"{objective!r} is not an objective: {', '.join(OBJECTIVES)}")


def _aliases(bands: Sequence[ModeBand], period_s: float) -> str:
    """Why a mode cannot be cancelled on a grid (it aliases to 0 Hz); empty if all can."""
    for band in bands:
        cycles = abs(band.mode.pole.imag) * period_s / (2.0 * math.pi)
        if cycles > 0.5 and abs(cmath.exp(band.mode.pole * period_s) - 1.0) < _NEAR_ONE:
            return (
                f"the mode at {band.mode.frequency_hz:g} Hz cannot be cancelled on a grid of {ms(period_s)}: its "
                f"{cycles:.4g} cycles per period alias to 0 Hz; use another period"
            )
    return ""


def _least_worst(
    rows: Sequence[Family],
    usable: Sequence[float | None],
    bands: Sequence[ModeBand],
    options: DesignOptions,
    found: Sequence[Design],
) -> list[Design]:
    """The design with the smallest worst residual on each grid; none if not wanted, or if another keeps the limit."""
    wanted = any(row.name == _ROBUST for row in rows) and any(band.uncertainty for band in bands)
    if not wanted or any(not each.negative and is_within(each, options.vibration_limit) for each in found):
        return []
    designs = []
    for period_s in usable:
        if period_s is not None:
            with contextlib.suppress(DesignError):
                shaper = least_worst(bands, period_s, options.max_duration_s).shaper
                designs.append(evaluate(_ROBUST, shaper, bands, period_s))
    return designs


def _never_tried(
    rows: Sequence[Family], usable: Sequence[float | None], bands: Sequence[ModeBand], periods_s: Sequence[float | None]
) -> Iterator[Refusal]:
    for row in rows:
        if not row.on_grid and None not in usable:
            yield Refusal(row.name, usable[0], "is designed only at continuous times")
        if not row.continuous and usable == [None]:
            yield Refusal(row.name, None, "is designed on a grid: specify a period")
    for row, period_s in itertools.product(rows, periods_s):
        if period_s is not None and period_s not in usable and row.on_grid:
            yield Refusal(row.name, period_s, _aliases(bands, period_s))
