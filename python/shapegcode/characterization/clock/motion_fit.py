"""Fits the numbers of a family to the sections of runs: what cuts and rapids take."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode.characterization.clock.families import LookAhead, fitted_model
from shapegcode.characterization.clock.windows import SectionClock, misfit, section_residuals
from shapegcode.machine import Machine

__all__ = ["MotionFit", "fit_motion", "parameter_intervals"]

FloatArray = npt.NDArray[np.float64]

_STEP = 0.3  # of the first simplex, in the logarithm
_WINDOW_S = 6.0
_PLACES, _SEARCHED, _VALLEYS, _STEPS = 400, 1.0, 5, 500
# Where the runs do not tell a number, it is that of a usual machine: so far from it costs as much as so much misfit.
_TYPICAL_SPREAD = 1.0  # in the logarithm
_SEEN_SPREAD = 0.15  # of a number that the logs show
_PRIOR = 0.01
_LEAST_STEP = 0.02  # of the numeric derivatives, in the logarithm


@dataclass(frozen=True)
class MotionFit:
    """A family with its numbers.

    Attributes:
        family: which.
        values: of its parameters by name, in mm, s and rad.
        rapid_mm_per_s: rapid rate of every axis; NaN: the machine's.
    """

    family: LookAhead
    values: dict[str, float]
    rapid_mm_per_s: float


def fit_motion(
    clocks: Sequence[SectionClock],
    family: LookAhead,
    machine: Machine,
    rapid_mm_per_s: float,
    *,
    seen: Mapping[str, float] | None = None,
    thorough: bool = True,
    on_step: Callable[[], None] | None = None,
) -> MotionFit:
    """Least misfit over the numbers of a family: Nelder-Mead, restarted from where it ended."""
    from scipy.optimize import minimize

    parameters = family.parameters
    low = np.log([parameter.low for parameter in parameters])
    high = np.log([parameter.high for parameter in parameters])
    usual = {parameter.name: parameter.start for parameter in parameters} | dict(seen or {})
    typical = np.log([usual[parameter.name] for parameter in parameters])
    reach = np.array([_SEEN_SPREAD if parameter.name in (seen or {}) else _TYPICAL_SPREAD for parameter in parameters])
    calls = 0

    def values(place: FloatArray) -> dict[str, float]:
        kept = np.clip(place, low, high)
        return {parameter.name: math.exp(value) for parameter, value in zip(parameters, kept, strict=True)}

    def cost(place: FloatArray) -> float:
        nonlocal calls
        calls += 1
        if on_step is not None and calls % 20 == 0:
            on_step()
        beyond = float(np.abs(place - np.clip(place, low, high)).sum())
        usual = _PRIOR * float((((place - typical) / reach) ** 2).sum())
        return misfit(clocks, fitted_model(machine, family, values(place), rapid_mm_per_s)) + usual + 10.0 * beyond

    def search(place: FloatArray, most: int) -> tuple[float, FloatArray]:
        simplex = np.vstack([place, place + _STEP * np.eye(len(parameters))])
        found = minimize(
            cost, place, method="Nelder-Mead",
            options={"maxfev": most, "xatol": 2e-3, "fatol": 1e-4, "initial_simplex": simplex, "adaptive": True},
        )  # fmt: skip
        return float(found.fun), found.x

    # The misfit has several valleys: the search begins in the lowest of many places, and again from where it ended.
    generator = np.random.default_rng(1)
    places, valleys, restarts = (_PLACES, _VALLEYS, 2) if thorough else (_PLACES // 2, _VALLEYS // 2, 1)
    spread = generator.normal(0.0, _SEARCHED, (places, len(parameters))) * (reach / _TYPICAL_SPREAD)
    tried = [typical, *(np.clip(typical + each, low, high) for each in spread)]
    ranked = sorted(((cost(place), index) for index, place in enumerate(tried)), key=lambda each: each[0])
    ends = [search(tried[index], _STEPS // 2) for _, index in ranked[:valleys]]
    best = min(ends, key=lambda end: end[0])
    for _ in range(restarts):
        end = search(best[1] + generator.normal(0.0, 0.1, len(parameters)), _STEPS)
        best = min(best, end, key=lambda each: each[0])
    return MotionFit(family, values(best[1]), rapid_mm_per_s)


def parameter_intervals(
    fit: MotionFit, clocks: Sequence[SectionClock], machine: Machine
) -> dict[str, tuple[float, float]]:
    """95 % intervals of the numbers of a fit.

    From the derivatives of what stretches of some seconds take; the scatter is that of the sections, each of which
    counts as one (a sandwich of clusters), so that an error of the model is in it.
    """
    names = [parameter.name for parameter in fit.family.parameters]
    stretches = [_stretches(clock) for clock in clocks]

    def taken(values: dict[str, float]) -> list[FloatArray]:
        residual = section_residuals(clocks, fitted_model(machine, fit.family, values, fit.rapid_mm_per_s))
        return [np.diff(each[places]) for each, places in zip(residual, stretches, strict=True)]

    centre = taken(fit.values)
    slopes = []
    for name in names:
        above = taken(fit.values | {name: fit.values[name] * math.exp(_LEAST_STEP)})
        below = taken(fit.values | {name: fit.values[name] * math.exp(-_LEAST_STEP)})
        slopes.append([(one - other) / (2.0 * _LEAST_STEP) for one, other in zip(above, below, strict=True)])
    normal = np.zeros((len(names), len(names)))
    scatter = np.zeros_like(normal)
    for section, error in enumerate(centre):
        slope = np.column_stack([each[section] for each in slopes])
        normal += slope.T @ slope
        pull = slope.T @ np.clip(error, -1.0, 1.0)
        scatter += np.outer(pull, pull)
    sections = len(centre)
    inverse = np.linalg.pinv(normal + 1e-12 * np.trace(normal) * np.eye(len(names)))
    # Few clusters understate the scatter: the usual correction, and Student's t of their number.
    spread = inverse @ scatter @ inverse * sections / max(1, sections - 1)
    from scipy.stats import t as student

    reach = float(student.ppf(0.975, max(1, sections - 1)))
    white = np.concatenate(centre) if centre else np.zeros(1)
    noise = inverse * float(np.mean(np.minimum(white**2, 1.0)))
    found = {}
    for index, parameter in enumerate(fit.family.parameters):
        deviation = math.sqrt(max(spread[index, index], noise[index, index], 0.0))
        seen = normal[index, index] > 1e-6
        ratio = math.exp(min(reach * deviation, 5.0)) if seen else math.inf
        value = fit.values[parameter.name]
        found[parameter.name] = max(parameter.low, value / ratio), min(parameter.high, value * ratio)
    return found


def _stretches(clock: SectionClock) -> npt.NDArray[np.int64]:
    """Readings that are some seconds apart."""
    places = [0]
    for index, time_s in enumerate(clock.time_s):
        if time_s - clock.time_s[places[-1]] >= _WINDOW_S:
            places.append(index)
    if len(places) == 1 and len(clock.time_s) > 1:
        places.append(len(clock.time_s) - 1)
    return np.array(places)
