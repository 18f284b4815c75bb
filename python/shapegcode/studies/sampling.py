"""Where draws lie in the unit cube: Sobol's sequence, latin hypercube, grid, and Saltelli's design for indices."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from shapegcode.errors import ArgumentError
from shapegcode.studies.distributions import Listed
from shapegcode.studies.varied import Varied

Sampling = Literal["sobol", "lhs", "grid"]
SAMPLINGS: tuple[Sampling, ...] = ("sobol", "lhs", "grid")

MOST_DRAWS = 1_000_000
"""Of a study: further ones say nothing more, and fill the memory."""

Columns = list[list[object]]


def drawn(varied: Sequence[Varied], n: int, sampling: str, seed: int, *, indices: bool) -> Columns:
    """The values of all draws."""
    if sampling not in SAMPLINGS:
        raise ArgumentError(f"sampling = {sampling!r}: must be one of {', '.join(SAMPLINGS)}")
    if isinstance(n, bool) or not isinstance(n, int) or not 1 <= n <= MOST_DRAWS:
        raise ArgumentError(f"n = {n!r}: must be a whole number of draws, 1 or more and at most {MOST_DRAWS}")
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ArgumentError(f"seed = {seed!r}: must be a whole number, 0 or more")
    if indices and sampling != "sobol":
        raise ArgumentError(f'indices: need sampling = "sobol", not {sampling!r}')
    if sampling == "grid":
        return _grid(varied, n)
    shares = _saltelli(varied, n, seed) if indices else _sequence(len(varied), n, sampling, seed)
    return [each.distribution.at(column) for each, column in zip(varied, shares.T, strict=True)]


def _sequence(dimensions: int, n: int, sampling: str, seed: int) -> npt.NDArray[np.float64]:
    from scipy.stats import qmc

    if sampling == "lhs":
        return np.asarray(qmc.LatinHypercube(dimensions, rng=np.random.default_rng(seed)).random(n))
    # The beginning of a sequence of a power of two, which is what SciPy asks for.
    power = math.ceil(math.log2(n)) if n > 1 else 0
    return np.asarray(qmc.Sobol(dimensions, rng=np.random.default_rng(seed)).random_base2(power))[:n]


def _grid(varied: Sequence[Varied], n: int) -> Columns:
    listed = math.prod(len(each.distribution.values) for each in varied if isinstance(each.distribution, Listed))
    free = sum(not isinstance(each.distribution, Listed) for each in varied)
    if listed > n:
        raise ArgumentError(f"n = {n}: the lists alone have {listed} combinations: give n = {listed} or more")
    # The root by counting: floating point would make 2 of the cube root of 27.
    level = 1
    while free and listed * (level + 1) ** free <= n:
        level += 1
    rows = itertools.product(*(each.distribution.levels(level) for each in varied))
    return [list(column) for column in zip(*rows, strict=True)]


def index_problem(varied: Sequence[Varied]) -> dict[str, Any]:
    """What SALib calls a problem: the unit cube."""
    count = len(varied)
    return {"num_vars": count, "names": [each.key for each in varied], "bounds": [[0.0, 1.0]] * count}


def _saltelli(varied: Sequence[Varied], n: int, seed: int) -> npt.NDArray[np.float64]:
    try:
        from SALib.sample import sobol
    except ModuleNotFoundError as error:
        raise ArgumentError(f"indices: need {error.name}: pip install 'shapegcode[study]'") from None
    per_point = len(varied) + 2
    if n < 2 * per_point:
        raise ArgumentError(f"n = {n}: indices of {len(varied)} keys need n = {2 * per_point} or more")
    base = 2 ** int(math.log2(n // per_point))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return np.asarray(sobol.sample(index_problem(varied), base, calc_second_order=False, seed=seed))
