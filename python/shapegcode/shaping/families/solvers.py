"""How each family is designed: at continuous times, and on a grid from the conditions that define it.

Families of one mode serve several by convolution, one mode after the other, on either kind of times.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from shapegcode._core import (
    ArgumentError,
    Mode,
    Shaper,
    convolve,
    extra_insensitive,
    mzv,
    mzv_second_zero,
    negative_zv,
    repeated_zv,
)
from shapegcode.shaping.bands import ModeBand
from shapegcode.shaping.families.conditions import Conditions, ResidualLimit, Zero
from shapegcode.shaping.families.on_grid import shortest_on_grid
from shapegcode.shaping.families.simultaneous import simultaneous_zv
from shapegcode.shaping.families.smooth import smooth_kernel
from shapegcode.shaping.options import DesignOptions
from shapegcode.shaping.taps import on_grid
from shapegcode.shaping.words import mode_names

__all__ = ["Solve", "hump_ei", "modified", "negative", "repeated", "simultaneous", "smooth", "specified", "user_taps"]

Solve = Callable[[Sequence[ModeBand], DesignOptions], Sequence[Shaper]]
"""All shapers of a family for some bands, the preferred one first."""

_STEPS_PER_PERIOD = 64  # of the fastest frequency: time grid of the SI shaper at continuous times


def _one_after_the_other(of_one: Callable[[Mode, DesignOptions], Shaper]) -> Solve:
    """The design of one mode, convolved over all."""

    def solve(bands: Sequence[ModeBand], options: DesignOptions) -> list[Shaper]:
        shaper = of_one(bands[0].mode, options)
        for band in bands[1:]:
            shaper = convolve(shaper, of_one(band.mode, options))
        return [shaper]

    return solve


def _defined(
    name: str,
    continuous: Callable[[Mode, DesignOptions], Shaper],
    conditions: Callable[[Mode, DesignOptions], Conditions],
) -> Solve:
    """A closed form at continuous times; on a grid the shortest taps that meet the conditions that define it."""

    def of_one(mode: Mode, options: DesignOptions) -> Shaper:
        if options.period_s is None:
            return continuous(mode, options)
        return shortest_on_grid(
            conditions(mode, options),
            options.period_s,
            options.max_duration_s,
            title=f"{name} for {mode_names([mode])}",
        )

    return _one_after_the_other(of_one)


def repeated(name: str, zeros: int) -> Solve:
    """ZV, ZVD, ZVDD ...: that many zeros at each mode; on a grid the shortest non-negative taps that have them."""
    return _defined(
        name,
        lambda mode, _options: repeated_zv(mode, zeros),
        lambda mode, _options: Conditions(zeros=(Zero(mode, zeros),)),
    )


def hump_ei(name: str, humps: int) -> Solve:
    """EI with that many humps; on a grid its zeros, and its residual between the outermost ones."""

    def conditions(mode: Mode, options: DesignOptions) -> Conditions:
        zeros_hz = extra_insensitive(mode, options.vibration_limit, humps).zeros_hz
        return Conditions(
            zeros=tuple(Zero(Mode(frequency_hz, mode.damping_ratio)) for frequency_hz in zeros_hz),
            limits=(ResidualLimit(mode, zeros_hz[0], zeros_hz[-1], options.vibration_limit),),
        )

    return _defined(
        name, lambda mode, options: extra_insensitive(mode, options.vibration_limit, humps).shaper, conditions
    )


modified = _defined(
    "MZV",
    lambda mode, _options: mzv(mode),
    lambda mode, _options: Conditions(zeros=(Zero(mode), Zero(mzv_second_zero(mode)))),
)
"""MZV; on a grid the shortest non-negative taps with its two zeros."""

negative = _defined(
    "negative ZV",
    lambda mode, _options: negative_zv(mode),
    lambda mode, _options: Conditions(zeros=(Zero(mode),), largest_tap=1.0),
)
"""Unity-magnitude ZV; on a grid the shortest taps between -1 and 1."""


def smooth(name: str, ratios: tuple[float, ...], periods: float, *, at_least: bool = False) -> Solve:
    """A polynomial kernel with zeros at these multiples of each mode, see `smooth_kernel`."""
    return _one_after_the_other(smooth_kernel(name, ratios, periods, at_least=at_least))


def specified(bands: Sequence[ModeBand], options: DesignOptions) -> list[Shaper]:
    """SI: the shortest non-negative taps that leave at most the vibration limit over every band."""
    conditions = Conditions(limits=tuple(_limit(band, options.vibration_limit) for band in bands))
    period_s = options.period_s
    if period_s is None:
        period_s = 1.0 / (_STEPS_PER_PERIOD * max(each.highest_hz for each in conditions.limits))
    title = f"SI shaper with {options.vibration_limit:.4g} left for {mode_names([band.mode for band in bands])}"
    return [shortest_on_grid(conditions, period_s, options.max_duration_s, title=title)]


def _limit(band: ModeBand, limit: float) -> ResidualLimit:
    if not 0.0 < limit < 1.0:
        raise ArgumentError(f"the vibration limit is {limit:.4g}: it must be above 0 and below 1")
    return ResidualLimit(band.mode, band.shifted(-1.0).frequency_hz, band.shifted(1.0).frequency_hz, limit)


def simultaneous(bands: Sequence[ModeBand], options: DesignOptions) -> list[Shaper]:
    """Shortest non-negative taps at continuous times that cancel all modes at once."""
    return [simultaneous_zv([band.mode for band in bands], options.max_duration_s)]


def user_taps(_bands: Sequence[ModeBand], options: DesignOptions) -> list[Shaper]:
    """The taps that were given, on the grid if there is one."""
    if options.taps is None:
        raise ArgumentError("the family taps judges taps that are given: none are")
    return [options.taps if options.period_s is None else on_grid(options.taps, options.period_s)]
