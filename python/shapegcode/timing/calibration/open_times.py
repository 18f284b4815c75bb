"""Directions in the space of the parameters of a cycle-time model that run logs leave open: rows of the machine file.

Each row is a step of one standard deviation, or of a fraction of it with a larger weight; rows are independent. The
directions are columns of the symmetric root of the covariance, each nearest to one parameter (Zuber and Strimmer, 2011,
"CAR scores"): a row's change to a time, squared, is the part of its variance from that parameter.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.settings.keys import toml
from shapegcode.timing.calibration.motion import FunctionFit, MotionFit, misfit, section_residuals, sections_of
from shapegcode.timing.calibration.observed import ObservedRun

_Row = dict[str, object]  # of times.open

_NO_STEP = 2e-3  # in a logarithm or s: smaller changes are omitted
_ALONE, _SMALL = 0.1, 0.2  # largest negligible step of other parameters; largest step for which times are linear
_MIN_PART = 0.05  # least fraction of a step that is used; times below 0 are then set to 0
_KIND_SPREAD = 0.1  # a kind worse by this ratio in cross-validation has exp(-1/2) times the weight
MIN_WEIGHT = 0.02  # least weight of a kind of look-ahead with a row
_BLOCK_TIME = "controller.look_ahead_block_time_s"
_USUAL_BLOCK_TIME_S = 0.002 * math.e  # one deviation above that of a usual machine
_NOTICED = 0.01  # cost in misfit of one standard deviation from a usual machine
# Prior of the model error for a tool's cuts, and its weight in tools
_USUAL_CUTS, _USUAL_TOOLS = 0.01, 4
_USUAL_RUNS = 0.003  # scatter between repeated runs if no program was run twice


def kind_weights(scores: Sequence[float], best: int) -> list[float]:
    """Probability of each kind of look-ahead, from cross-validation."""
    least = max(scores[best], 1e-9)
    found = [math.exp(-0.5 * (max(0.0, score / least - 1.0) / _KIND_SPREAD) ** 2) for score in scores]
    return [each / sum(found) for each in found]


def motion_rows(fit: MotionFit, covariance: FloatArray, runs: Sequence[ObservedRun], machine: Machine) -> list[_Row]:
    """Rows for the parameters of the motion; for look-ahead without a fitted block time also one for the block time."""
    base, parameters = fit.file_values(), fit.family.parameters
    rows = []
    for index, step in enumerate(_symmetric_root(covariance).T):
        parameter, others = parameters[index], np.delete(np.abs(step), index)
        # A full step to the slower side, since a limit that was not reached has its effect there; a small one if
        # other parameters must compensate.
        part = 1.0 if others.max(initial=0.0) < _ALONE else min(1.0, _SMALL / float(np.abs(step).max()))
        part *= 1.0 if parameter.unit == "s" else -1.0
        values = {
            each.name: min(max(fit.values[each.name] * math.exp(part * change), each.low), each.high)
            for each, change in zip(parameters, step, strict=True)
            if abs(change) > _NO_STEP
        }
        rows += open_row(parameter.meaning, base, replace(fit, values=fit.values | values).file_values(), part**-2)
    if fit.family.motion == "look_ahead" and not any(each.key == _BLOCK_TIME for each in parameters):
        block_time = _unnoticed_block_time(fit, runs, machine)
        rows += open_row("time in which a block is read", base, base | {_BLOCK_TIME: float(f"{block_time:.3g}")})
    return rows


def _unnoticed_block_time(fit: MotionFit, runs: Sequence[ObservedRun], machine: Machine) -> float:
    """Largest block time that the logs do not contradict, s; at most `_USUAL_BLOCK_TIME_S`."""
    sections, model = sections_of(runs), fit.model(machine)
    before, block_time = misfit(sections, model), _USUAL_BLOCK_TIME_S
    while block_time > 1e-4:
        limits = model.limits
        limits.block_time_s = block_time
        model.limits = limits
        if misfit(sections, model) <= before + _NOTICED:
            break
        block_time /= 1.5
    return block_time


def function_rows(
    functions: FunctionFit, file_values: Callable[[FunctionFit], Mapping[str, object]], meaning: Callable[[str], str]
) -> list[_Row]:
    """A row for each time that adds to the motion's."""
    names, base = list(functions.values), file_values(functions)
    value = np.array(list(functions.values.values()))
    rows = []
    for name, step in zip(names, _symmetric_root(functions.covariance).T, strict=True):
        # Times stay at 0 or above: a smaller or opposite step keeps the sums that the logs determine.
        parts = {sign: _possible(value, sign * step) for sign in (1.0, -1.0)}
        sign = max(parts, key=lambda each: parts[each])
        part = max(min(parts[sign], _SMALL / float(np.abs(step).max())), _MIN_PART)
        moved = np.maximum(value + sign * part * step, 0.0)
        changed = replace(functions, values=dict(zip(names, moved.tolist(), strict=True)))
        rows += open_row(meaning(name), base, file_values(changed), weight=part**-2)
    return rows


def _possible(value: FloatArray, step: FloatArray) -> float:
    """Largest fraction of a step, at most 1, that keeps all values ≥ 0."""
    falls = step < -_NO_STEP
    return min(1.0, float(np.min(value[falls] / -step[falls], initial=1.0)))


def open_row(name: str, base: Mapping[str, object], other: Mapping[str, object], weight: float = 1.0) -> list[_Row]:
    """List with one row of the values that differ from `base`; empty if none differs."""
    # Keys missing in the other kind are not used by it.
    values = [f"{key} = {toml(value)}" for key, value in other.items() if value is not None and value != base.get(key)]
    return [{"name": name, "values": values, "weight": float(f"{weight:.4g}")}] if values else []


def _symmetric_root(covariance: FloatArray) -> FloatArray:
    """Square root R of the covariance, R R^T, (n, n); column i is the direction nearest to parameter i."""
    deviation = np.sqrt(np.maximum(np.diag(covariance), 1e-18))
    value, vector = np.linalg.eigh(covariance / np.outer(deviation, deviation))
    return np.asarray(deviation[:, None] * ((vector * np.sqrt(np.maximum(value, 0.0))) @ vector.T))


def cut_scatter(runs: Sequence[ObservedRun], fit: MotionFit, machine: Machine) -> float:
    """Relative standard deviation of a tool's cutting time; deviations of different tools are independent."""
    from scipy.stats import t as student

    sums: dict[tuple[int, int], list[float]] = defaultdict(lambda: [0.0, 0.0])
    for run in runs:
        sections = sections_of([run])
        for section, residual in zip(sections, section_residuals(sections, fit.model(machine)), strict=True):
            took = float(section.time_s[-1] - section.time_s[0])
            error = float(np.median(residual[-4:]) - np.median(residual[:4]))
            if took > 0.0:
                of = sums[id(run.timed), int(run.timed.tools[section.line[0]])]
                of[0] += max(-0.2 * took, min(error, 0.2 * took))
                of[1] += took
    # Tools are weighted by time, with their number as total weight.
    whole = sum(took for _, took in sums.values())
    square = sum(error**2 / took for error, took in sums.values()) / whole if whole > 0.0 else 0.0
    freedom = _USUAL_TOOLS + len(sums)
    pooled = (_USUAL_TOOLS * _USUAL_CUTS**2 + len(sums) * square) / freedom
    return math.sqrt(pooled) * float(student.ppf(0.975, freedom)) / 1.96


def run_scatter(ratios: Mapping[str, Sequence[float]]) -> float:
    """Relative standard deviation between repeated runs, from measured over predicted time by program."""
    repeated = [np.asarray(each) for each in ratios.values() if len(each) > 1]
    freedom = sum(len(each) - 1 for each in repeated)
    if not freedom:
        return _USUAL_RUNS
    return math.sqrt(sum(float(((each / each.mean() - 1.0) ** 2).sum()) for each in repeated) / freedom)
