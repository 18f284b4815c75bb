"""What can be chosen for a program, and in which order combinations are tried."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from shapegcode.errors import ArgumentError
from shapegcode.machine import Machine
from shapegcode.studies.distributions import listed
from shapegcode.studies.varied import check_keys

Choices = Mapping[str, Sequence[object]]
"""Values to choose from, by key of the machine file."""
Ranks = tuple[int, ...]

_FAMILIES = ("auto", "zv", "mzv", "zvd", "ei", "ei2")
_SHARES = (1.0, 0.75, 0.5)
_ARC_FEEDS = (1.0, 0.9, 0.8)
_POPULATION = 12
_WHOLE = 1e-6


def usual_choices(machine: Machine) -> dict[str, tuple[object, ...]]:
    """Block period, family, tolerance that is aimed at, and feed on arcs."""
    controller = machine.controller
    least = max(1, math.ceil(controller.block_time_s / controller.interpolation_period_s - _WHOLE))
    ticks = sorted({least, least + 1, least + 2, math.ceil(1.5 * least), 2 * least})
    return {
        "emission.block_period_s": tuple(round(each * controller.interpolation_period_s, 12) for each in ticks),
        "shaping.family": _FAMILIES,
        "tolerance.contour_um": tuple(share * machine.tolerance.contour_um for share in _SHARES),
        "shaping.arc_feed_ratio": _ARC_FEEDS,
    }


def checked_choices(choices: Choices, varied: Sequence[str]) -> Choices:
    """The choices, if they are such."""
    if not choices:
        raise ArgumentError("choose: nothing to choose: give a list of values for one key or more")
    check_keys("choose", choices)
    checked = {}
    for key, values in choices.items():
        try:
            checked[key] = listed(values).values
        except ArgumentError:
            raise ArgumentError(f"choose: {key} = {values!r}: must be a list of one value or more") from None
        if key in varied:
            raise ArgumentError(f"choose: {key}: it is drawn (vary): a value is either drawn or chosen")
    return checked


def search(choices: Choices, most: int, seed: int, cost: Callable[[Ranks], float]) -> Iterator[Ranks]:
    """Combinations worth a conversion: all of them, or as many as differential evolution gets to."""
    sizes = [len(values) for values in choices.values()]
    if math.prod(sizes) <= most:
        yield from itertools.product(*(range(size) for size in sizes))
        return
    yield from _evolved(sizes, most, seed, cost)


class _EnoughError(Exception):
    """As many were tried as may be."""


def _evolved(sizes: Sequence[int], most: int, seed: int, cost: Callable[[Ranks], float]) -> Iterator[Ranks]:
    from scipy.optimize import Bounds, differential_evolution

    known: dict[Ranks, float] = {}

    def asked(point: npt.NDArray[np.float64]) -> float:
        ranks = tuple(round(each) for each in point)
        if ranks not in known:
            if len(known) >= most:
                raise _EnoughError
            known[ranks] = cost(ranks)
        return known[ranks]

    bounds = Bounds(np.zeros(len(sizes)), np.array(sizes) - 1.0)
    with contextlib.suppress(_EnoughError):
        differential_evolution(
            asked, bounds, integrality=np.ones(len(sizes), dtype=bool), popsize=_POPULATION, maxiter=most, tol=0.0,
            polish=False, rng=np.random.default_rng(seed), x0=np.zeros(len(sizes)),
        )  # fmt: skip
    yield from known
