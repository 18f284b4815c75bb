"""Varied values: their distributions, and whether the converter knows them.

A value that the converter knows needs a program of its own; others change only the simulated machine.
"""

from __future__ import annotations

import importlib
import itertools
import math
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode.errors import ArgumentError, MachineError, Problem
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.settings.keys import toml
from shapegcode.settings.load import missing_row


@dataclass(frozen=True)
class Distribution:
    """Distribution of a sampled value."""

    words: str  # as shown
    quantile: Callable[[FloatArray], FloatArray] = field(compare=False)  # inverse distribution function
    # True: the program is converted for each value; False: it is converted for the value of the machine file, and only
    # the simulated machine has the sampled one; None: False for values that the simulation reads
    known: bool | None = None

    def at(self, shares: FloatArray) -> list[object]:
        """Quantiles at these probabilities."""
        return list(map(float, self.quantile(shares)))


@dataclass(frozen=True)
class Listed(Distribution):
    """One of some values, equally likely."""

    values: tuple[object, ...] = ()

    def at(self, shares: FloatArray) -> list[object]:
        """Quantiles at these probabilities."""
        count = len(self.values)
        return [self.values[min(int(share * count), count - 1)] for share in shares]


def _normal_quantile(shares: FloatArray) -> FloatArray:
    from scipy.special import ndtri

    # A sequence may contain 0, whose quantile is infinite.
    tiny = 0.5 / 2**32
    return np.asarray(ndtri(np.clip(shares, tiny, 1.0 - tiny)))


def normal(
    mean: float, sd: float | None = None, *, percent: float | None = None, known: bool | None = None
) -> Distribution:
    """Normal distribution of a value known with a standard deviation.

    >>> sg.normal(46, 2)             # 46 ± 2 Hz
    >>> sg.normal(46, percent=5)     # 46 Hz ± 5 %

    Args:
        mean: in the unit of the key.
        sd: standard deviation, likewise.
        percent: standard deviation in percent of the mean, instead.
        known: see `Distribution`.

    Returns:
        The distribution.

    Raises:
        ArgumentError: both or none of *sd* and *percent*, one that is not above 0, or a percentage of a mean of 0.
    """
    mean = _number("mean", mean)
    spread = _spread(sd, percent, abs(mean))
    words = f"normal, {mean:g} ± {spread:g}"
    return Distribution(words, lambda shares: mean + spread * _normal_quantile(shares), known)


def lognormal(median: float, percent: float, *, known: bool | None = None) -> Distribution:
    """Lognormal distribution of a value known to a factor, such as a damping ratio.

    Args:
        median: in the unit of the key.
        percent: one standard deviation above the median the value is larger by this percentage; one below, it is
            smaller by the same factor.
        known: see `Distribution`.

    Returns:
        The distribution.

    Raises:
        ArgumentError: a median or percentage that is not above 0.
    """
    if _number("median", median) <= 0.0:
        raise ArgumentError(f"lognormal: median = {median:g}: must be > 0")
    log_sd = math.log1p(_spread(None, percent, 100.0) / 100.0)
    words = f"lognormal, {median:g} × or ÷ {math.exp(log_sd):.4g}"
    return Distribution(words, lambda shares: median * np.exp(log_sd * _normal_quantile(shares)), known)


def uniform(low: float, high: float, *, known: bool | None = None) -> Distribution:
    """Uniform distribution of a value of which only the limits are known.

    Args:
        low: the lowest.
        high: the highest.
        known: see `Distribution`.

    Returns:
        The distribution.

    Raises:
        ArgumentError: the limits do not ascend.
    """
    if not _number("low", low) < _number("high", high):
        raise ArgumentError(f"uniform: high = {high:g}: must be above low = {low:g}")
    return Distribution(f"{low:g} to {high:g}", lambda shares: low + (high - low) * shares, known)


def listed(values: Sequence[object] | npt.NDArray[Any], *, known: bool | None = None) -> Listed:
    """One of some values, equally likely; a plain list means the same.

    Args:
        values: values as in a machine file.
        known: see `Distribution`.

    Returns:
        The distribution.

    Raises:
        ArgumentError: not a list, or an empty one.
    """
    if isinstance(values, str) or not isinstance(values, Sequence | np.ndarray) or getattr(values, "ndim", 1) == 0:
        raise ArgumentError(f"{values!r}: must be a list of values")
    if len(values) == 0:
        raise ArgumentError("a list of values is empty: give two or more")
    # A machine file has Python's numbers.
    plain = tuple(each.tolist() if isinstance(each, np.generic | np.ndarray) else each for each in values)
    return Listed(" or ".join(map(toml, plain)), np.asarray, known, plain)


def _number(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not math.isfinite(value):
        raise ArgumentError(f"{name} = {value!r}: must be a finite number")
    return float(value)


def _spread(sd: float | None, percent: float | None, whole: float) -> float:
    if (sd is None) == (percent is None):
        raise ArgumentError("normal: give either sd, in the unit of the key, or percent")
    name, given = ("sd", sd) if percent is None else ("percent", percent)
    if _number(name, given) <= 0.0:
        raise ArgumentError(f"{name} = {given:g}: must be > 0")
    if percent is not None and whole == 0.0:
        raise ArgumentError(f"percent = {percent:g}: must be of a mean that is not 0: give sd")
    return _number(name, given) * (1.0 if percent is None else whole / 100.0)


Vary = Mapping[str, Distribution | Sequence[object] | npt.NDArray[Any]]  # distribution of each key

# Values in which a machine may differ from its file, and which are read when blocks are simulated.
_SIMULATED = re.compile(
    r"axes\.[xyz]\.(modes|rigid|drive\..+|rapid_mm_per_min)"
    r"|axes\.[xyz]\.modes\.\d+\.(frequency_hz|damping_ratio|participation|(frequency_over|moves|excited_by)(\..+)?)"
    r"|controller\.(interpolation_period_s|block_end|shaped_\w+|(position_gain_per_s|feed_forward_ratio)(\.[xyz])?)"
    r"|controller\.(in_position|rapid)\w*(\.[xyz])?"
    r"|shaping\.part_mass_kg|times\..+"
)
_VIBRATING = re.compile(r"axes\.[xyz]\.(modes|rigid|drive)\b.*|shaping\.part_mass_kg")
# Keys of tables that the file may lack; `with_values` checks them.
_OPTIONAL = re.compile(r"axes\.[xyz]\.(modes|drive)(\.|$)")


@dataclass(frozen=True)
class Varied:
    """A varied key of the machine file with its distribution."""

    key: str  # dotted name
    distribution: Distribution  # of the values
    known: bool  # the converter knows each value; False: only the simulated machine has it
    value: str  # value in the file, as TOML
    unit: str  # of the values

    @property
    def changes_times(self) -> bool:
        """True if it may change the time of a program."""
        return not _VIBRATING.fullmatch(self.key)


def check_keys(name: str, given: object) -> None:
    """Refuse arguments that are not mappings by keys of the machine file."""
    if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
        problem = f"{name} = {given!r}: must be a mapping by keys of the machine file"
        raise ArgumentError(f'{problem}, such as {{"axes.x.modes.1.frequency_hz": ...}}')


def varied_values(machine: Machine, vary: Vary) -> tuple[Varied, ...]:
    """Validate the varied values against the keys of the machine."""
    if not vary:
        raise ArgumentError("vary: nothing is varied: give at least one key of the machine file")
    check_keys("vary", vary)
    held = {value.key: value for value in machine.values()}
    found = []
    for key, given in vary.items():
        if isinstance(given, str) or not isinstance(given, Distribution | Sequence | np.ndarray):
            raise ArgumentError(f"vary: {key} = {given!r}: must be a distribution or a list of values")
        distribution = given if isinstance(given, Distribution) else listed(given)
        # Tables such as controller.in_position_s can be varied axis by axis.
        at = held.get(key) or held.get(key.rpartition(".")[0])
        wrong = missing_row(machine, key) or ("" if at or _OPTIONAL.match(key) else "no such key")
        if wrong:
            raise MachineError(machine.name, (Problem(key, "", wrong),))
        simulated = _SIMULATED.fullmatch(key) is not None
        if distribution.known is False and not simulated:
            raise ArgumentError(f"vary: {key}: known = false: only the converter reads it, so it must be known")
        known = not simulated if distribution.known is None else distribution.known
        found.append(Varied(key, distribution, known, at.value if at else "not set", at.unit if at else ""))
    return tuple(found)


def sampled_machine(machine: Machine, values: Mapping[str, object], source: str) -> Machine:
    """A machine with sampled values."""
    if not values:
        return machine
    # A control with another period executes the same blocks; only the converter requires a multiple of it.
    freed = {"emission.block_period_s": None} if "controller.interpolation_period_s" in values else {}
    return machine.with_values({**freed, **values}, source=source)


SAMPLINGS = ("sobol", "lhs", "grid")

MAX_DRAWS = 1_000_000  # of a study: more add no information and fill the memory

Columns = list[list[object]]


def sampled_columns(varied: Sequence[Varied], n: int, sampling: str, seed: int, *, indices: bool) -> Columns:
    """Columns of the values of all samples."""
    if sampling not in SAMPLINGS:
        raise ArgumentError(f"sampling = {sampling!r}: must be one of {', '.join(SAMPLINGS)}")
    if isinstance(n, bool) or not isinstance(n, int) or not 1 <= n <= MAX_DRAWS:
        raise ArgumentError(f"n = {n!r}: must be a whole number of samples, 1 or more and at most {MAX_DRAWS}")
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ArgumentError(f"seed = {seed!r}: must be a whole number, 0 or more")
    if indices and sampling != "sobol":
        raise ArgumentError(f'indices: need sampling = "sobol", not {sampling!r}')
    if sampling == "grid":
        return _grid(varied, n)
    shares = _saltelli(varied, n, seed) if indices else _sequence(len(varied), n, sampling, seed)
    return [each.distribution.at(column) for each, column in zip(varied, shares.T, strict=True)]


def _sequence(dimensions: int, n: int, sampling: str, seed: int) -> FloatArray:
    from scipy.stats import qmc

    if sampling == "lhs":
        return np.asarray(qmc.LatinHypercube(dimensions, rng=np.random.default_rng(seed)).random(n))
    # The first n points of a sequence of a power of two, as SciPy requires.
    power = math.ceil(math.log2(n)) if n > 1 else 0
    return np.asarray(qmc.Sobol(dimensions, rng=np.random.default_rng(seed)).random_base2(power))[:n]


def _grid(varied: Sequence[Varied], n: int) -> Columns:
    listed = math.prod(len(each.distribution.values) for each in varied if isinstance(each.distribution, Listed))
    free = sum(not isinstance(each.distribution, Listed) for each in varied)
    if listed > n:
        raise ArgumentError(f"n = {n}: the lists alone have {listed} combinations: give n = {listed} or more")
    # Integer root by counting: floating point would give 2 for the cube root of 27.
    level = 1
    while free and listed * (level + 1) ** free <= n:
        level += 1
    middles = (np.arange(level) + 0.5) / level
    drawn = [each.distribution for each in varied]
    values = (each.values if isinstance(each, Listed) else each.at(middles) for each in drawn)
    return [list(column) for column in zip(*itertools.product(*values), strict=True)]


def index_problem(varied: Sequence[Varied]) -> dict[str, Any]:
    """The unit cube as a problem of SALib."""
    count = len(varied)
    return {"num_vars": count, "names": [each.key for each in varied], "bounds": [[0.0, 1.0]] * count}


def salib(part: str) -> Any:
    """Import the module `sobol` of a part of SALib."""
    try:
        return importlib.import_module(f"SALib.{part}.sobol")
    except ModuleNotFoundError as error:
        raise ArgumentError(f"indices: need {error.name}: pip install 'shapegcode[study]'") from None


def _saltelli(varied: Sequence[Varied], n: int, seed: int) -> FloatArray:
    sobol = salib("sample")
    per_point = len(varied) + 2
    if n < 2 * per_point:
        raise ArgumentError(f"n = {n}: indices of {len(varied)} keys need n = {2 * per_point} or more")
    base = 2 ** int(math.log2(n // per_point))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return np.asarray(sobol.sample(index_problem(varied), base, calc_second_order=False, seed=seed))
