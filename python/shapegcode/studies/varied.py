"""Which values are varied: what each is drawn from, and whether the converter knows of it.

A text is converted for the machine file. What is varied then is the machine that plays it: its modes, drives, filters,
times. A value that only the converter reads, such as `shaping.family`, needs another text.
"""

from __future__ import annotations

import itertools
import math
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from shapegcode.errors import ArgumentError, MachineError, Problem
from shapegcode.machine import Machine
from shapegcode.settings.edit import missing_row
from shapegcode.studies.distributions import Distribution, Listed, listed

Vary = Mapping[str, Distribution | Sequence[object] | npt.NDArray[Any]]
"""What each key is drawn from."""

# A machine may differ from its file in these, and they are read when blocks are played.
_PLAYED = re.compile(
    r"axes\.[xyz]\.(modes|rigid|drive\..+|rapid_mm_per_min)"
    r"|axes\.[xyz]\.modes\.\d+\.(frequency_hz|damping_ratio|participation|frequency_over(\..+)?)"
    r"|controller\.(interpolation_period_s|block_end|shaped_\w+|(position_gain_per_s|feed_forward_ratio)(\.[xyz])?)"
    r"|controller\.(in_position|rapid)\w*(\.[xyz])?"
    r"|shaping\.part_mass_kg|times\..+"
)
_SWINGS = re.compile(r"axes\.[xyz]\.(modes|rigid|drive)\b.*|shaping\.part_mass_kg")
# The file may leave out the table that holds it; `with_values` has the last word.
_OPTIONAL = re.compile(r"axes\.[xyz]\.(modes|drive)(\.|$)")
_TICK = "controller.interpolation_period_s"


@dataclass(frozen=True)
class Varied:
    """A key of the machine file and what its values are drawn from."""

    key: str  # dotted name
    distribution: Distribution  # of the values
    known: bool  # the converter knows each value; else only the machine that plays the text has it
    value: str  # what the file says, as TOML
    unit: str  # of the values

    @property
    def changes_times(self) -> bool:
        """Whether a program may take another time with it."""
        return not _SWINGS.fullmatch(self.key)


def check_keys(name: str, given: object) -> None:
    """Refuse what does not go by keys of the machine file."""
    if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
        said = f"{name} = {given!r}: must go by keys of the machine file"
        raise ArgumentError(f'{said}, such as {{"axes.x.modes.1.frequency_hz": ...}}')


def varied_values(machine: Machine, vary: Vary) -> tuple[Varied, ...]:
    """What is varied, checked against the keys that there are."""
    if not vary:
        raise ArgumentError("vary: nothing is varied: name at least one key of the machine file")
    check_keys("vary", vary)
    held = {value.key: value for value in machine.values()}
    found = []
    for key, given in vary.items():
        if isinstance(given, str) or not isinstance(given, Distribution | Sequence | np.ndarray):
            raise ArgumentError(f"vary: {key} = {given!r}: must be a distribution or a list of values")
        drawn = given if isinstance(given, Distribution) else listed(given)
        # Tables such as controller.in_position_s can be varied axis by axis.
        at = held.get(key) or held.get(key.rpartition(".")[0])
        wrong = missing_row(machine, key) or ("" if at or _OPTIONAL.match(key) else "no such key")
        if wrong:
            raise MachineError(machine.name, (Problem(key, "", wrong),))
        played = _PLAYED.fullmatch(key) is not None
        if drawn.known is False and not played:
            raise ArgumentError(f"vary: {key}: known = false: only the converter reads it, so that it must be known")
        known = not played if drawn.known is None else drawn.known
        found.append(Varied(key, drawn, known, at.value if at else "not set", at.unit if at else ""))
    return tuple(found)


def drawn_machine(machine: Machine, values: Mapping[str, object], source: str) -> Machine:
    """A machine with drawn values."""
    if not values:
        return machine
    # A control that ticks otherwise plays the same blocks; whether their period is a multiple is the converter's care.
    freed = {"emission.block_period_s": None} if _TICK in values and "emission.block_period_s" not in values else {}
    return machine.with_values({**freed, **values}, source=source)


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
