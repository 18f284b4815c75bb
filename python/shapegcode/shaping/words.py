"""How messages say times, periods and modes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from shapegcode._core import Mode
from shapegcode.shaping.bands import ModeBand

__all__ = ["ON_GRID", "band_names", "mode_names", "ms", "spoken", "whole_periods"]

ON_GRID = 1e-9
"""Periods; forgives the rounding of a quotient."""


def ms(time_s: float) -> str:
    """A time, s, in ms."""
    return f"{time_s * 1e3:.6g} ms"


def mode_names(modes: Sequence[Mode]) -> str:
    """Modes by frequency and damping ratio."""
    return ", ".join(f"{mode.frequency_hz:g} Hz (zeta {mode.damping_ratio:g})" for mode in modes)


def band_names(bands: Sequence[ModeBand]) -> str:
    """Modes with their bands, as they are typed."""
    return ", ".join(f"{band} Hz" for band in bands)


def spoken(bands: Sequence[ModeBand]) -> str:
    """Modes with their bands in a sentence."""

    def one(band: ModeBand) -> str:
        text = f"{band.mode.frequency_hz:g} Hz"
        return f"{text} ±{100.0 * band.uncertainty:g} %" if band.uncertainty else text

    return " and ".join(map(one, bands))


def whole_periods(duration_s: float, period_s: float) -> int:
    """How many periods fit into a duration."""
    return math.floor(duration_s / period_s + ON_GRID)
