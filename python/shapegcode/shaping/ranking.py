"""How designs of shapers rank: Pareto front, objectives, the rule of the recommendation, and its reason in words."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from shapegcode._core import ArgumentError
from shapegcode.shaping.bands import SAME, Design, ModeBand, ms, spoken
from shapegcode.shaping.registry import FAMILIES

NO_RESIDUAL = 1e-9
"""A residual ratio below this is none: what is left is the rounding of the solver."""

_CONVERTED = {"non-negative", "robust"}  # what a conversion takes by itself
_FOR_GRIDS = {row.name for row in FAMILIES if not row.continuous}
_DIGITS = 9  # designs that agree in so many digits are equally good
_ROUNDING = 1e-6  # a design made for a limit may miss it by so much, relative


def _merits(each: Design) -> tuple[float, float, float, float]:
    """What is better small: duration, worst residual, contour cost (either sign), sum of magnitudes."""
    values = (each.duration_s, max(each.worst_residual, NO_RESIDUAL), abs(each.variance_s2), each.abs_sum)
    duration, residual, contour, magnitudes = (float(f"{value:.{_DIGITS}g}") for value in values)
    return duration, residual, contour, magnitudes


def _shortest(each: Design) -> tuple[float, ...]:
    duration, residual, contour, _ = _merits(each)
    # Of equal durations the longest period writes the fewest blocks; what is left is within the limit.
    return duration, -(each.period_s or 0.0), _rank(each), contour, residual


def _rank(each: Design) -> float:
    """Of which family an equally good design is taken."""
    return 0.0 if each.family in _CONVERTED else 1.0 if each.family in _FOR_GRIDS else 2.0


def _flattest(each: Design) -> tuple[float, ...]:
    duration, residual, contour, _ = _merits(each)
    return residual, duration, -(each.period_s or 0.0), contour


def _truest(each: Design) -> tuple[float, ...]:
    duration, residual, contour, _ = _merits(each)
    return contour, duration, -(each.period_s or 0.0), residual


OBJECTIVES: dict[str, tuple[str, Callable[[Design], tuple[float, ...]]]] = {
    "shortest": ("the shortest", _shortest),
    "contour": ("the one with the least contour cost", _truest),
    "robust": ("the one with the least worst residual", _flattest),
}
"""Objectives by name: how the reason calls the winner, and what is least in it."""


def pareto_front(designs: Sequence[Design]) -> list[bool]:
    """For each design whether no other one is at least as good in everything and better in something.

    Compared are duration, worst residual, magnitude of the contour cost and sum of the taps' magnitudes, each to nine
    digits, a residual below 1e-9 as none. A design on a grid serves where continuous times are asked for, not the
    other way round: so designs on grids are compared with each other only.
    """
    if not designs:
        return []
    merits = np.array([_merits(each) for each in designs])
    on_grid = np.array([each.period_s is not None for each in designs])
    front = []
    for own, grid in zip(merits, on_grid, strict=True):
        better = (merits <= own).all(axis=1) & (merits < own).any(axis=1)
        front.append(not bool((better & (on_grid | ~grid)).any()))
    return front


def recommend(
    designs: Sequence[Design], vibration_limit: float, objective: str = "shortest", allow_negative: bool = False
) -> int:
    """Index of the design to take.

    Of the designs without negative impulses (of all with `allow_negative`, or where every design has some) those whose
    worst residual is at most the limit compete for the objective, and of these, if there are any, those that cancel the
    modes that state no band; if there is none within the limit, the one that leaves least is taken. Of equally short
    ones on grids, to 2 %, the one with the longest period is taken, because it writes the fewest blocks; of equal ones
    the family that a conversion takes by itself, then one that is made for grids.
    """
    if not designs:
        raise ArgumentError("there is no design to choose from: 0 given")
    indices = _eligible(designs, allow_negative)
    good = _good(designs, indices, vibration_limit)
    least = OBJECTIVES[objective][1] if good else _flattest

    def order(index: int) -> tuple[float, ...]:
        return (*least(designs[index]), _rank(designs[index]))

    best = min(good or indices, key=order)
    if designs[best].period_s is None or (good and objective != "shortest"):
        return best
    most = (1.0 + SAME) * least(designs[best])[0]
    near = [index for index in good or indices if designs[index].period_s and least(designs[index])[0] <= most]
    longest_s = max(designs[index].period_s or 0.0 for index in near)
    return min((index for index in near if designs[index].period_s == longest_s), key=order)


def _good(designs: Sequence[Design], indices: Sequence[int], vibration_limit: float) -> list[int]:
    """Those within the limit; of them those that cancel the modes without a band, if there are any."""
    good = [index for index in indices if is_within(designs[index], vibration_limit)]
    return [index for index in good if designs[index].exact] or good


def _eligible(designs: Sequence[Design], allow_negative: bool) -> list[int]:
    indices = range(len(designs))
    return [index for index in indices if allow_negative or not designs[index].negative] or list(indices)


def is_within(each: Design, vibration_limit: float) -> bool:
    """Whether the worst residual is at most the limit, but for rounding."""
    return each.worst_residual <= vibration_limit * (1.0 + _ROUNDING)


def reason_for(
    designs: Sequence[Design], index: int, bands: Sequence[ModeBand], limit: float, objective: str, allow_negative: bool
) -> str:
    """Why `recommend` takes the design of that index, in a sentence."""
    taken = designs[index]
    indices = _eligible(designs, allow_negative)
    among = _good(designs, indices, limit)
    good = len(among)
    only_negative = not allow_negative and taken.negative
    kind = "" if allow_negative or only_negative else "non-negative "
    if good:
        unstated = [band for band in bands if not band.uncertainty]
        exactly = f" and which cancel{'' if good > 1 else 's'} {spoken(unstated)}" if unstated and taken.exact else ""
        text = (
            f"{OBJECTIVES[objective][0]} of {good} {kind}design{'' if good == 1 else 's'} whose worst residual over "
            f"{spoken(bands)} stays within {_percent(limit)}{exactly} (it leaves {_percent(taken.worst_residual)})"
        )
    else:
        text = (
            f"none of {len(indices)} {kind}design{'' if len(indices) == 1 else 's'} stays within {_percent(limit)} "
            f"over {spoken(bands)}; this one leaves least, {_percent(taken.worst_residual)}"
        )
        others = [each for each in designs if each.negative and is_within(each, limit)]
        if others and not allow_negative:
            other = min(others, key=_shortest)
            text += f"; with negative impulses {other.family} ({ms(other.duration_s)}) would leave less"
    return text + ("; every design has negative impulses" if only_negative else "")


def _percent(ratio: float) -> str:
    return "nothing" if ratio < NO_RESIDUAL else f"{100.0 * ratio:.3g} %"
