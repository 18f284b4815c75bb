"""Fits what takes time beside the motion: tool changes, M codes, the spindle, ways that the program does not tell.

What lies between two cuts is a sum of such times, and of the motion that is known already. The logs tell the sums; how
they divide among codes that always come together is a choice, and the one with the smallest numbers is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shapegcode import _core
from shapegcode.io.record import FloatArray
from shapegcode.machine import Machine
from shapegcode.timing.calibration.motion import MotionFit, starts_of
from shapegcode.timing.calibration.observed import ObservedRun

_READING_S = 0.1  # scatter of the time between two readings
_OUTLIER = 3.0  # of it: what is further off counts less
_RIDGE = 0.02  # pull of every number to 0, against its scatter of a reading
_MAX_S = 60.0
_UNSEEN = 1e-3  # sum of derivatives, in scatters of a reading
_TOOL_CHANGE = 6
_SPEEDS_KRPM = (0.0, 60.0)
_TABLE_KRPM = 30.0  # a spindle's table is written up to so far above where its time begins


@dataclass(frozen=True)
class FunctionFit:
    """Times beside the motion."""

    # by name: "start", "tool change", "M8", "way xy", "way z" in s; "spindle start from" and "spindle stop from" in
    # 1000/min, "spindle start" and "spindle stop" in s per 1000/min above
    values: dict[str, float]
    low: dict[str, float]  # of the 95 % intervals by name
    high: dict[str, float]
    last_tool_in_spindle: bool  # whether the tool that a program ends with is in the spindle when it starts anew
    scatter_s: float  # root mean square of what a stretch between two cuts took otherwise


@dataclass(frozen=True, eq=False)
class _Span:
    """A stretch of a run from one reading to another, with functions between."""

    run: ObservedRun
    begin: int  # line; 0: the start key
    end: int
    seconds: float


def whole_model(
    machine: Machine, motion: MotionFit, values: dict[str, float], last_tool_in_spindle: bool
) -> _core.FanucModel:
    """The controller with motion and functions."""
    model = motion.model(machine)
    model.program_start_s = values.get("start", 0.0)
    model.tool_change_s = values.get("tool change", 0.0)
    model.last_tool_in_spindle = last_tool_in_spindle
    model.m_function_s = 0.0
    model.m_code_s = dict(m_codes(values).items())
    xy = values.get("way xy", 0.0)
    model.unknown_move_s = [xy, xy, values.get("way z", 0.0)]
    model.spindle_start_s = spindle_rows(values, "spindle start")
    model.spindle_stop_s = spindle_rows(values, "spindle stop")
    return model


def m_codes(values: dict[str, float]) -> dict[int, float]:
    """Times of M codes."""
    return {int(name[1:]): value for name, value in values.items() if name[0] == "M" and name[1:].isdigit()}


def spindle_rows(values: dict[str, float], name: str) -> list[tuple[float, float]]:
    """The table of a spindle's time: none up to a speed, in proportion above."""
    slope, begin = values.get(name, 0.0), values.get(f"{name} from", 0.0)
    if slope <= 1e-6:
        return []
    rows = [(begin * 1000.0, 0.0)] if begin > 1e-3 else []
    return [*rows, ((begin + _TABLE_KRPM) * 1000.0, slope * _TABLE_KRPM)]


def fit_functions(runs: Sequence[ObservedRun], motion: MotionFit, machine: Machine) -> FunctionFit:
    """Least squares over the stretches between cuts, robust against what an operator does there."""
    spans = [span for run in runs for span in _spans(run)]
    names = _names(runs)
    kept = (False, True) if any(map(_returns, runs)) else (False,)
    fits = [_fit(spans, names, motion, machine, each) for each in kept]
    return min(fits, key=lambda fit: fit.scatter_s * (0.98 if not fit.last_tool_in_spindle else 1.0))


def _returns(run: ObservedRun) -> bool:
    """Whether a program ends with the tool that it begins with: only then it matters what is in the spindle."""
    used = [tool for tool in run.timed.tools.tolist() if tool >= 0]
    return bool(used) and used[0] == used[-1]


def _names(runs: Sequence[ObservedRun]) -> list[str]:
    functions = [each for run in runs for each in run.timed.program.core.functions]
    codes = {code for codes, _, _ in functions for code in codes}
    spins = any(speed > 0.0 for _, _, speed in functions)
    names = ["start", "way xy", "way z"]
    names += ["tool change"] if _TOOL_CHANGE in codes else []
    names += [f"M{code}" for code in sorted(codes - {_TOOL_CHANGE})]
    if spins and codes & {3, 4}:
        names += ["spindle start", "spindle start from"]
    if spins and 5 in codes:
        names += ["spindle stop", "spindle stop from"]
    return names


def _spans(run: ObservedRun) -> list[_Span]:
    """Readings next to each other with a function between, and whole ways from cut to cut; start and end of the run."""
    line, time_s, function = run.line, run.time_s, run.timed.function
    spans = []

    def add(first: int, last: int) -> None:
        begin = int(line[first]) if first >= 0 else 0
        end = int(line[last]) if last < len(line) else run.timed.line_count + 1
        since = float(time_s[first]) if first >= 0 else 0.0
        until = float(time_s[last]) if last < len(line) else run.duration_s
        if until is not None and until > since and function[max(begin, 1) : end].any():
            spans.append(_Span(run, begin, end, until - since))

    cuts = np.flatnonzero(np.isfinite(run.timed.feed_mm_per_s[line]))
    # How the way to the first cut divides differs from run to run: a control reports its first lines late.
    for index in range(int(cuts[0]) if len(cuts) else -1, len(line)):
        add(index, index + 1)
    if len(cuts):
        if run.whole and not run.log.cut_start:
            add(-1, int(cuts[0]))
        for first, last in pairwise(cuts.tolist()):
            if last > first + 1:
                add(first, last)
        add(int(cuts[-1]), len(line))
    return spans


def _fit(spans: Sequence[_Span], names: list[str], motion: MotionFit, machine: Machine, kept: bool) -> FunctionFit:
    from scipy.optimize import least_squares

    seconds = np.array([span.seconds for span in spans])
    scale = np.array([_MAX_S if not name.endswith("from") else _SPEEDS_KRPM[1] for name in names])
    pull = np.array([0.0 if name.endswith("from") else _RIDGE for name in names]) / _READING_S

    def errors(place: FloatArray) -> FloatArray:
        model = whole_model(machine, motion, dict(zip(names, place.tolist(), strict=True)), kept)
        starts = starts_of(model)
        taken = [
            starts(span.run, 1.0)[span.end] - (starts(span.run, 1.0)[span.begin] if span.begin > 0 else 0.0)
            for span in spans
        ]
        return np.concatenate([(np.array(taken) - seconds) / _READING_S, pull * place])

    begin = np.array([4.0 if name.endswith("from") else 0.3 for name in names])
    found = least_squares(
        errors, begin, bounds=(np.zeros(len(names)), scale), loss="soft_l1", f_scale=_OUTLIER, x_scale=1.0,
        diff_step=np.full(len(names), 1e-3), max_nfev=60,
    )  # fmt: skip
    values = dict(zip(names, found.x.tolist(), strict=True))
    error = errors(found.x)[: len(spans)] * _READING_S
    middle = float(np.sqrt(np.mean(np.minimum(error**2, 1.0)))) if len(error) else 0.0
    # Each stretch is counted about twice: as a whole, and in its readings.
    slope = np.asarray(found.jac)
    spread = np.linalg.pinv(slope.T @ slope) * 2.0 * max(1.0, (middle / _READING_S) ** 2)
    # A number that changes nothing is not told.
    unseen = np.abs(slope[: len(spans)]).sum(axis=0) < _UNSEEN
    reach = np.where(unseen, _MAX_S, 2.0 * np.sqrt(np.maximum(np.diag(spread), 0.0)))
    low = {name: max(0.0, values[name] - float(each)) for name, each in zip(names, reach, strict=True)}
    high = {name: min(_MAX_S, values[name] + float(each)) for name, each in zip(names, reach, strict=True)}
    return FunctionFit(values, low, high, kept, middle)
