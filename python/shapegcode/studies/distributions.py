"""What a varied value may be: normal, lognormal, uniform, or one of a list."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode.errors import ArgumentError
from shapegcode.settings.keys import toml

Unit = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Distribution:
    """What a value is drawn from."""

    # the program is converted for each value; False: it is converted for the value of the machine file, and only
    # the machine that plays it has the other one; None: False where a machine may differ from its file
    known: bool | None = None

    def at(self, shares: Unit) -> list[object]:
        """The values below which these shares of all lie."""
        raise NotImplementedError

    def levels(self, most: int) -> list[object]:
        """A few values that stand for all, for a grid."""
        return self.at((np.arange(most) + 0.5) / most)

    @property
    def words(self) -> str:
        """For people."""
        raise NotImplementedError


@dataclass(frozen=True)
class Normal(Distribution):
    """Mean and standard deviation, both in the unit of the value."""

    mean: float
    sd: float

    def at(self, shares: Unit) -> list[object]:
        """See `Distribution`."""
        return list(map(float, self.mean + self.sd * _normal_quantile(shares)))

    @property
    def words(self) -> str:
        """For people."""
        return f"normal, {self.mean:g} ± {self.sd:g}"


@dataclass(frozen=True)
class Lognormal(Distribution):
    """Median, and the standard deviation of the natural logarithm; never below zero."""

    median: float
    log_sd: float

    def at(self, shares: Unit) -> list[object]:
        """See `Distribution`."""
        return list(map(float, self.median * np.exp(self.log_sd * _normal_quantile(shares))))

    @property
    def words(self) -> str:
        """For people."""
        return f"lognormal, {self.median:g} × or ÷ {math.exp(self.log_sd):.4g}"


@dataclass(frozen=True)
class Uniform(Distribution):
    """Every value between two is as likely."""

    low: float
    high: float

    def at(self, shares: Unit) -> list[object]:
        """See `Distribution`."""
        return list(map(float, self.low + (self.high - self.low) * shares))

    @property
    def words(self) -> str:
        """For people."""
        return f"{self.low:g} to {self.high:g}"


@dataclass(frozen=True)
class Listed(Distribution):
    """One of some values, each as likely."""

    values: tuple[object, ...]

    def at(self, shares: Unit) -> list[object]:
        """See `Distribution`."""
        count = len(self.values)
        return [self.values[min(int(share * count), count - 1)] for share in shares]

    def levels(self, most: int) -> list[object]:
        """All of them, whatever is asked."""
        return list(self.values)

    @property
    def words(self) -> str:
        """For people."""
        return " or ".join(toml(value) for value in self.values)


def _normal_quantile(shares: Unit) -> Unit:
    from scipy.special import ndtri

    # A sequence may hold 0, whose quantile is none.
    tiny = 0.5 / 2**32
    return np.asarray(ndtri(np.clip(shares, tiny, 1.0 - tiny)))


def normal(mean: float, sd: float | None = None, *, percent: float | None = None, known: bool | None = None) -> Normal:
    """A value that is known with a standard deviation.

    >>> sg.normal(46, 2)             # 46 ± 2 Hz
    >>> sg.normal(46, percent=5)     # 46 Hz ± 5 %

    Args:
        mean: in the unit of the key.
        sd: standard deviation, likewise.
        percent: standard deviation in percent of the mean, in place of it.
        known: see `Distribution`.

    Returns:
        The distribution.

    Raises:
        ArgumentError: not one of the two spreads, or one that is not above 0.
    """
    mean = _number("mean", mean)
    return Normal(mean, _spread(sd, percent, abs(mean)), known=known)


def lognormal(median: float, percent: float, *, known: bool | None = None) -> Lognormal:
    """A value above zero that is known to a factor, such as a damping ratio.

    Args:
        median: in the unit of the key.
        percent: by how much it is larger one standard deviation above the median; below, it is smaller by the same
            factor.
        known: see `Distribution`.

    Returns:
        The distribution.

    Raises:
        ArgumentError: a median or percentage that is not above 0.
    """
    if _number("median", median) <= 0.0:
        raise ArgumentError(f"lognormal: median = {median:g}: must be > 0")
    return Lognormal(float(median), math.log1p(_spread(None, percent, 100.0) / 100.0), known=known)


def uniform(low: float, high: float, *, known: bool | None = None) -> Uniform:
    """A value of which nothing is known but its limits.

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
    return Uniform(float(low), float(high), known=known)


def listed(values: Sequence[object] | npt.NDArray[Any], *, known: bool | None = None) -> Listed:
    """One of some values; a plain list says the same.

    Args:
        values: as a machine file may have them.
        known: see `Distribution`.

    Returns:
        The distribution.

    Raises:
        ArgumentError: no list, or an empty one.
    """
    if isinstance(values, str) or not isinstance(values, Sequence | np.ndarray) or getattr(values, "ndim", 1) == 0:
        raise ArgumentError(f"{values!r}: must be a list of values")
    if len(values) == 0:
        raise ArgumentError("a list of values is empty: give two or more")
    # A machine file has Python's numbers.
    plain = (each.tolist() if isinstance(each, np.generic | np.ndarray) else each for each in values)
    return Listed(tuple(plain), known=known)


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
