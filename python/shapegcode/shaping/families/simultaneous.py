"""Shortest shaper without negative taps, at continuous times, that cancels several modes at once.

A linear program on a fine time grid finds which taps there are and roughly when; Newton's method on amplitudes and
times together then moves them off the grid to where every mode is cancelled to rounding. In general the shortest such
shaper of n modes has n+1 taps: it is the shortest non-negative one of the minimal shapers of Park, Hong and
Danielson 2009 (paper 002).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from shapegcode._core import DesignError, Mode, Shaper, convolved_zv
from shapegcode.shaping.families.conditions import Conditions, Zero
from shapegcode.shaping.families.on_grid import shortest_on_grid
from shapegcode.shaping.words import mode_names, ms

__all__ = ["simultaneous_zv"]

FloatArray = NDArray[np.float64]

_PER_PERIOD = (40, 80, 160, 320)  # steps of the time grid in a period of the fastest mode
_NEIGHBOURS = 2.5  # steps: taps closer than this are one tap between them
_NEWTON_STEPS = 30
_RESIDUAL = 1e-13
_SMALLEST_TAP = 1e-9


def simultaneous_zv(modes: Sequence[Mode], max_duration_s: float) -> Shaper:
    """Shortest shaper with non-negative taps at continuous times that cancels every mode.

    Source: this project (numerical optimum over all modes at once).
    """
    fastest_hz = max(mode.frequency_hz for mode in modes)
    title = f"simultaneous shaper without negative taps for {mode_names(modes)}"
    conditions = Conditions(zeros=tuple(Zero(mode) for mode in modes))
    for per_period in _PER_PERIOD:
        step_s = 1.0 / (per_period * fastest_hz)
        # the exact solution may be shorter than that of the grid by a step or two
        try:
            start = shortest_on_grid(conditions, step_s, max_duration_s + 2.0 * step_s, title=title)
        except DesignError as error:
            one_by_one_s = convolved_zv(modes).duration_s
            raise DesignError(
                f"no {title} within {ms(max_duration_s)}; one ZV after the other lasts {ms(one_by_one_s)}"
            ) from error
        shaper = _polished(*_merged(start, _NEIGHBOURS * step_s), modes)
        if shaper is not None and shaper.duration_s <= max_duration_s * (1.0 + 1e-9):
            return shaper
    raise DesignError(
        f"no {title} within {ms(max_duration_s)}: on a grid of {1e3 * step_s:.3g} ms there is one of "
        f"{ms(start.duration_s)}, but no exact one was found near it"
    )


def _merged(shaper: Shaper, distance_s: float) -> tuple[FloatArray, FloatArray]:
    """Times and amplitudes with neighbouring taps as one, at their mean time."""
    groups: list[list[int]] = []
    for index, time_s in enumerate(shaper.times_s):
        if groups and time_s - shaper.times_s[groups[-1][-1]] <= distance_s:
            groups[-1].append(index)
        else:
            groups.append([index])
    amplitudes = np.array([shaper.amplitudes[group].sum() for group in groups])
    times = np.array([shaper.amplitudes[group] @ shaper.times_s[group] for group in groups]) / amplitudes
    return times - times[0], amplitudes


def _polished(times_s: FloatArray, amplitudes: FloatArray, modes: Sequence[Mode]) -> Shaper | None:
    """Newton on all amplitudes and times; None if it ends at no non-negative shaper that cancels the modes."""
    poles = np.array([mode.pole for mode in modes])
    scale = float(np.abs(poles).max())
    count = len(times_s)
    target = np.zeros(2 * len(modes) + 1)
    target[-1] = 1.0
    best: tuple[float, FloatArray, FloatArray] = (math.inf, times_s, amplitudes)
    for _ in range(_NEWTON_STEPS):
        terms = np.exp(poles[:, None].real * (times_s[-1] - times_s) - 1j * poles[:, None].imag * times_s)
        by_amplitude = np.vstack([terms.real, terms.imag, np.ones(count)])
        slopes = -(poles[:, None] / scale) * terms * amplitudes
        by_time = np.vstack([slopes.real, slopes.imag, np.zeros(count)])[:, 1:]
        error = by_amplitude @ amplitudes - target
        size = float(np.abs(error).max())
        if not math.isfinite(size):
            return None
        if size < best[0]:
            best = (size, times_s, amplitudes)
        # the last tap's time also scales the sums; that changes no zero, so the Newton steps leave it out
        change = np.linalg.lstsq(np.hstack([by_amplitude, by_time]), error, rcond=1e-10)[0]
        amplitudes = amplitudes - change[:count]
        times_s = times_s - np.concatenate([[0.0], change[count:]]) / scale
    _, times_s, amplitudes = best
    if np.any(np.diff(times_s) <= 0.0) or float(amplitudes.min()) < _SMALLEST_TAP:
        return None
    shaper = Shaper(times_s.tolist(), (amplitudes / amplitudes.sum()).tolist())
    return shaper if max(shaper.residual_ratio(mode) for mode in modes) <= _RESIDUAL else None
