"""The choice of a shaper as a user asks for it: modes in words or of a machine, and whatever limits are stated."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shapegcode._core import ArgumentError, DesignError, Mode, Shaper
from shapegcode.machine import Machine
from shapegcode.shaping.bands import ModeBand, machine_bands, mode_band
from shapegcode.shaping.comparison import choose
from shapegcode.shaping.options import DesignOptions
from shapegcode.shaping.periods import candidate_periods, check_block_period
from shapegcode.shaping.result import Recommendation
from shapegcode.shaping.taps import parse_taps

__all__ = ["choose_shaper"]

_SLOWEST_PERIODS = 3.0  # longest shaper where none is stated: three-hump EI of the slowest mode and of a faster one


def choose_shaper(
    modes: float | str | Mode | ModeBand | Sequence[float | str | Mode | ModeBand] = (),
    *,
    machine: Machine | str | Path | None = None,
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
        modes: frequencies in Hz of undamped modes, texts such as ``46:0.02±5%`` (Hz, damping ratio, band), modes or
            bands; one or several; empty: those of the machine.
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

    Returns:
        Every design with what it costs and leaves, the one to take and why.

    Raises:
        ArgumentError: neither modes nor a machine with modes, equal modes, or a value outside its range.
        DesignError: a mode cannot be cancelled on any of the grids, or no family has a design within the limits.
    """
    machine = None if machine is None else Machine.of(machine)
    # Arrays are lists, too, and their numbers Python's.
    several: list[float | str | Mode | ModeBand] = np.atleast_1d(np.asarray(modes, dtype=object)).tolist()
    periods = None if periods_s is None else np.asarray(periods_s, dtype=object).tolist()
    families = None if families is None else np.asarray(families, dtype=object).tolist()
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
        # Long shapers take long to find, and are wanted only where there is no short one.
        with contextlib.suppress(DesignError):
            result = compared(usual_s)
            if result.ok and result.design.exact:
                return result
    return compared(longest_s)
