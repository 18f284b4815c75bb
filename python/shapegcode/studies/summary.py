"""What the draws come to: quantiles, how sure the verdict is, and which value decides it."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode.errors import ArgumentError
from shapegcode.studies.distributions import Listed
from shapegcode.studies.replay import SHARE
from shapegcode.studies.result import BinQuantiles, Decides, Quantity
from shapegcode.studies.varied import Varied, index_problem

FloatArray = npt.NDArray[np.float64]

PERCENT = (5.0, 25.0, 50.0, 75.0, 95.0, 99.0)
_BINS = 10
_LEAST_IN_BIN = 5
_WITHIN = 1.0 + 1e-9
_CONFIDENCE = 0.95


def check_probability(name: str, value: object) -> None:
    """Refuse what is no probability that can be asked for."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value <= 1.0:
        raise ArgumentError(f"{name} = {value!r}: must be a probability, above 0 and at most 1")


def quantity(name: str, values: FloatArray, nominal: float) -> Quantity:
    """Quantiles of one measure."""
    p5, p25, p50, p75, p95, p99 = np.percentile(values, PERCENT).tolist()
    return Quantity(name, nominal, float(values.mean()), p5, p25, p50, p75, p95, p99, float(values.max()))


def within(shares: FloatArray) -> npt.NDArray[np.bool_]:
    """Which draws are within every limit; of the largest share of a limit of each."""
    return shares <= _WITHIN


def interval_of(good: int, count: int) -> tuple[float, float]:
    """Clopper and Pearson's interval of a probability, at 95 %."""
    from scipy.stats import beta

    tail = (1.0 - _CONFIDENCE) / 2.0
    low = beta.ppf(tail, good, count - good + 1) if good else 0.0
    high = beta.ppf(1.0 - tail, good + 1, count - good) if good < count else 1.0
    return float(low), float(high)


def bins_of(each: Varied, column: Sequence[object], values: FloatArray) -> tuple[BinQuantiles, ...]:
    """Quantiles of a measure where a value is low, ..., high: in ten bins of as many draws, or by choice."""
    if isinstance(each.distribution, Listed):
        places = [(str(choice), [index for index, value in enumerate(column) if value == choice])
                  for choice in each.distribution.values]  # fmt: skip
        groups = [(rank, name, np.array(chosen, dtype=int)) for rank, (name, chosen) in enumerate(places) if chosen]
        return tuple(_bin(float(rank), name, values[chosen]) for rank, name, chosen in groups)
    numbers = np.asarray(column, dtype=float)
    order = np.argsort(numbers, kind="stable")
    count = max(1, min(_BINS, len(order) // _LEAST_IN_BIN))
    return tuple(
        _bin(float(np.median(numbers[part])), f"{np.median(numbers[part]):.4g}", values[part])
        for part in np.array_split(order, count)
    )


def _bin(at: float, name: str, values: FloatArray) -> BinQuantiles:
    return BinQuantiles(at, name, *np.percentile(values, (5.0, 50.0, 95.0)).tolist())


def decides(
    varied: Sequence[Varied],
    columns: Sequence[Sequence[object]],
    measured: Mapping[str, FloatArray],
    *,
    indices: bool,
    seed: int,
) -> tuple[Decides, ...]:
    """Which value moves the share of the limit most."""
    shares = measured[SHARE]
    found = _indices(varied, shares, seed) if indices else {}
    rows = []
    for each, column in zip(varied, columns, strict=True):
        bins = bins_of(each, column, shares)
        low, high = min(bins, key=lambda one: one.median), max(bins, key=lambda one: one.median)
        rows.append(Decides(each.key, low.median, high.median, low.name, high.name, *found.get(each.key, ())))
    rank = (lambda row: row.total or 0.0) if found else (lambda row: row.high - row.low)
    return tuple(sorted(rows, key=rank, reverse=True))


def _indices(varied: Sequence[Varied], shares: FloatArray, seed: int) -> dict[str, tuple[float, ...]]:
    """First-order and total index of each value by SALib, and their errors; none where nothing changes the share."""
    try:
        from SALib.analyze import sobol
    except ModuleNotFoundError as error:
        raise ArgumentError(f"indices: need {error.name}: pip install 'shapegcode[study]'") from None
    if float(np.ptp(shares)) == 0.0:
        return {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found: Any = sobol.analyze(index_problem(varied), shares, calc_second_order=False, seed=seed)
    return {
        each.key: tuple(float(found[name][rank]) for name in ("S1", "ST", "S1_conf", "ST_conf"))
        for rank, each in enumerate(varied)
    }
