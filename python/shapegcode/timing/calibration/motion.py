"""Fits, for each kind of look-ahead, the times of cuts and rapids with intervals; then the times between cuts."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.model.machine_model import fanuc_model
from shapegcode.timing.calibration.observed import IntArray, ObservedRun, seen_arc_acceleration


@dataclass(frozen=True)
class Parameter:
    """One parameter of a kind of look-ahead."""

    name: str  # short, within the family
    key: str  # key of the machine file; "{axis}": each axis of `axes`
    unit: str  # unit of the value in the machine file
    start: float  # start of a fit, in mm, s and rad
    low: float
    high: float
    meaning: str
    scale: float = 1.0  # ratio of the machine file's value to the fit's
    axes: str = ""  # axes of the parameter


@dataclass(frozen=True)
class LookAhead:
    """A kind of look-ahead: its rule for corners, and the limits to be fitted."""

    name: str  # displayed name
    meaning: str
    parameters: tuple[Parameter, ...]  # fitted parameters
    rule: str = "speed_difference"  # `controller.corner_rule`
    law: str = "jerk_limited"  # `controller.law`
    motion: str = "look_ahead"  # `controller.motion`


_ACCELERATION = "axes.{axis}.max_acceleration_mm_s2"
_SPEED_STEP = "controller.corner_speed_difference_mm_per_min.{axis}"
_PER_MINUTE, _DEGREES = 60.0, 180.0 / math.pi
# fmt: off
_ACROSS = Parameter("acceleration_xy", _ACCELERATION, "mm/s²", 1000.0, 20.0, 3e4, "acceleration of X and Y", axes="xy")
_ALONG_Z = Parameter("acceleration_z", _ACCELERATION, "mm/s²", 1000.0, 20.0, 3e4, "acceleration of Z", axes="z")
_ARCS = Parameter(
    "arc_acceleration", "controller.centripetal_acceleration_mm_s2", "mm/s²", 1000.0, 5.0, 3e4,
    "acceleration across the path in arcs")
_CORNER = Parameter(
    "corner_xy", _SPEED_STEP, "mm/min", 8.0, 0.05, 300.0, "speed step of X and Y at a corner", _PER_MINUTE, "xy")
_CORNER_Z = Parameter(
    "corner_z", _SPEED_STEP, "mm/min", 8.0, 0.05, 300.0, "speed step of Z at a corner", _PER_MINUTE, "z")
_JERK_TIME = Parameter(
    "jerk_time", "controller.bell_time_s", "s", 0.05, 0.001, 0.5, "time in which the acceleration is built up")
_RAPID_TIME = Parameter(
    "rapid_time", "controller.rapid_time_constant_s", "s", 0.15, 0.01, 1.0, "time in which a rapid reaches its rate")
_ARRIVAL = Parameter("arrival", "controller.in_position_s", "s", 0.04, 1e-4, 1.0, "wait after a rapid")
_DEVIATION = Parameter(
    "deviation", "controller.junction_deviation_mm", "mm", 0.005, 1e-5, 0.5, "deviation allowed at a corner")
_STOP_ANGLE = Parameter(
    "stop_angle", "controller.corner_stop_angle_deg", "degrees", 0.5, 0.03, 3.0, "corners that are stops", _DEGREES)
_TIME_CONSTANT = Parameter(
    "time_constant", "controller.time_constant_s", "s", 0.08, 0.005, 0.6, "time in which a feed is reached")
_BLOCK_TIME = Parameter(
    "block_time", "controller.look_ahead_block_time_s", "s", 0.002, 1e-4, 0.05, "time in which a block is read")
# fmt: on
_BOTH = (_RAPID_TIME, _ARRIVAL)
_SPEED = (_ACROSS, _ALONG_Z, _JERK_TIME, _CORNER, _CORNER_Z, _ARCS)

FAMILIES = (
    LookAhead(
        "speed difference", "look-ahead with a largest speed step of each axis at corners (FANUC 1783)",
        (*_SPEED, *_BOTH),
    ),
    LookAhead(
        "speed difference, block time", "the same, with a shortest time to read a block",
        (*_SPEED, _BLOCK_TIME, *_BOTH),
    ),
    LookAhead(
        "speed difference, constant time", "the same, with ramps of constant duration",
        (_ACROSS, _ALONG_Z, _TIME_CONSTANT, _JERK_TIME, _CORNER, _CORNER_Z, _ARCS, *_BOTH), law="constant_time",
    ),
    LookAhead(
        "junction deviation", "look-ahead that passes a corner as an arc within a deviation",
        (_ACROSS, _ALONG_Z, _JERK_TIME, _DEVIATION, _ARCS, *_BOTH), "junction_deviation",
    ),
    LookAhead(
        "stops at corners", "look-ahead that stops at sharp corners",
        (_ACROSS, _ALONG_Z, _JERK_TIME, _STOP_ANGLE, _ARCS, *_BOTH), "stops",
    ),
    LookAhead(
        "after interpolation", "no look-ahead: blocks overlap within the time constant (FANUC 1622)",
        (_TIME_CONSTANT, *_BOTH), law="constant_time", motion="after_interpolation",
    ),
)  # fmt: skip
"""Families to try."""

_OFF = 1e9
_NO_LIMIT = 1e6  # mm/s²


@dataclass(frozen=True)
class MotionFit:
    """One kind of look-ahead with its fitted parameters."""

    family: LookAhead
    values: dict[str, float]  # parameters by name, in mm, s and rad
    rapid_mm_per_s: float  # rapid rate of every axis; NaN: the machine's

    def model(self, machine: Machine) -> _core.FanucModel:
        """Controller model of the family with these parameters."""
        family, values = self.family, self.values
        model = fanuc_model(machine)
        limits = _core.MotionLimits()
        limits.law = getattr(_core.AccelerationLaw, family.law)
        xy, z = values.get("acceleration_xy", _OFF), values.get("acceleration_z", _OFF)
        limits.max_acceleration_mm_per_s2 = [xy, xy, z]
        limits.max_feed_mm_per_s = [axis.max_feed_mm_per_min / 60.0 for axis in machine.axes.as_tuple()]
        limits.jerk_time_s = values.get("jerk_time", 0.0)
        limits.time_constant_s = max(values.get("time_constant", 0.0), model.period_s)
        corner, corner_z = values.get("corner_xy", _OFF), values.get("corner_z", _OFF)
        limits.corner_speed_difference_mm_per_s = [corner, corner, corner_z]
        limits.centripetal_acceleration_mm_per_s2 = values.get("arc_acceleration", _OFF)
        limits.junction_deviation_mm = values.get("deviation", _OFF)
        limits.corner_stop_angle_rad = values.get("stop_angle", _OFF)
        limits.block_time_s = values.get("block_time", 0.0)
        model.limits = limits
        model.planner = _core.PlannerRules()
        model.motion = getattr(_core.MotionKind, family.motion)
        model.filter_shape = _core.FilterShape.linear
        model.time_constant_s = values.get("time_constant", 0.0)
        model.bell_time_s = 0.0
        model.look_ahead_filter_time_constant_s = 0.0
        if math.isfinite(self.rapid_mm_per_s):
            model.rapid_rate_mm_per_s = [self.rapid_mm_per_s] * 3
        model.rapid_time_constant_s = [values["rapid_time"]] * 3
        model.rapid_bell_time_s = 0.0
        model.in_position = _core.InPosition.measured
        model.in_position_s = [values["arrival"]] * 3
        return model

    def file_values(self) -> dict[str, object]:
        """Parameters as values of the machine file, by dotted key."""
        family = self.family
        corner = dict.fromkeys("xyz", 0.0)
        found: dict[str, object] = {
            "controller.motion": family.motion,
            "controller.law": family.law,
            "controller.corner_rule": family.rule,
            "controller.look_ahead_filter_time_constant_s": 0.0,
            "controller.rapid_bell_time_s": 0.0,
            "controller.in_position": "measured",
            "controller.contour_acceleration_mm_s2": None,
            "controller.junction_deviation_mm": None,
            "controller.corner_stop_angle_deg": None,
            "controller.look_ahead_block_time_s": 0.0,
            "controller.bell_time_s": 0.0,
            "controller.polyline_acceleration_mm_s2": _NO_LIMIT,
        }
        for axis in "xyz":
            found[f"axes.{axis}.max_jerk_mm_s3"] = None
            if math.isfinite(self.rapid_mm_per_s):
                found[f"axes.{axis}.rapid_mm_per_min"] = float(f"{self.rapid_mm_per_s * 60.0:.5g}")
        for parameter in family.parameters:
            value = float(f"{self.values[parameter.name] * parameter.scale:.5g}")
            if parameter.key.startswith("controller.corner_speed"):
                corner.update(dict.fromkeys(parameter.axes, value))
            elif "{axis}" in parameter.key:
                found.update({parameter.key.format(axis=axis): value for axis in parameter.axes})
            else:
                found[parameter.key] = value
        if _CORNER in family.parameters:
            found["controller.corner_speed_difference_mm_per_min"] = corner
        if family.motion == "after_interpolation":
            found["controller.after_interpolation_shape"] = "linear"
        return found


# A control reports its line a few times per second, so a line is first seen up to one reading late. The duration of a
# part is therefore known to one or two readings, whatever its length; the model's error grows with the length.

#: (length of the windows in s, limit of the error in s, weight).
_SCALES = ((1.0, 0.25, 1.0), (6.0, 0.5, 0.7), (30.0, 1.0, 0.5))
_SECTION = (2.0, 0.5)  # whole sections: limit of the error in s over the root of their half minutes, weight
_MIN_READINGS = 10


@dataclass(frozen=True, eq=False)
class SeenSection:
    """Readings of one section of a run."""

    run: ObservedRun
    feed_override: float
    time_s: FloatArray  # (n,) times of the readings
    line: IntArray  # (n,) reported lines

    @cached_property
    def windows(self) -> tuple[tuple[IntArray, IntArray], ...]:
        """For each window length: indices of the readings at which windows start, and at which they end."""
        found = []
        for length_s, _, _ in _SCALES:
            upto = np.searchsorted(self.time_s, self.time_s + length_s)
            begins = np.flatnonzero(upto < len(self.time_s))
            found.append((begins, upto[begins]))
        return tuple(found)


def sections_of(runs: Sequence[ObservedRun]) -> list[SeenSection]:
    """The sections of all runs that contain enough readings."""
    found = []
    for run in runs:
        for cut_section in run.cut_sections:
            inside = (run.line >= cut_section.lines[0]) & (run.line <= cut_section.lines[1])
            if int(inside.sum()) >= _MIN_READINGS:
                found.append(SeenSection(run, cut_section.feed_override, run.time_s[inside], run.line[inside]))
    return found


def starts_of(model: _core.FanucModel) -> Callable[[ObservedRun, float], FloatArray]:
    """Start of each line in a model, by run and feed override: (line_count + 2,), the last is the program's end."""
    found: dict[tuple[int, float, float], FloatArray] = {}

    def starts(run: ObservedRun, feed_override: float) -> FloatArray:
        key = (id(run.timed), feed_override, run.rapid_override)
        if key not in found:
            model.feed_override, model.rapid_override = feed_override, run.rapid_override
            own = run.timed.starts(model)
            # A line without a move starts with the next one.
            known = np.where(np.isnan(own), len(own), np.arange(len(own)))
            found[key] = own[np.minimum.accumulate(known[::-1])[::-1]]
        return found[key]

    return starts


def section_residuals(sections: Sequence[SeenSection], model: _core.FanucModel) -> list[FloatArray]:
    """Measured minus modelled time, s, for each reading of each section."""
    starts = starts_of(model)
    return [section.time_s - starts(section.run, section.feed_override)[section.line] for section in sections]


def misfit(sections: Sequence[SeenSection], model: _core.FanucModel) -> float:
    """Error of a model in the times of sections: equal weight for every program, limited influence of outliers."""
    # Sum of squares and count, by program
    found: dict[int, FloatArray] = defaultdict(lambda: np.zeros((2, len(_SCALES) + 1)))
    for section, residual in zip(sections, section_residuals(sections, model), strict=True):
        sums, counts = found[id(section.run.timed)]
        for scale, (_, limit_s, _) in enumerate(_SCALES):
            begins, ends = section.windows[scale]
            apart = residual[ends] - residual[begins]
            sums[scale] += np.minimum(apart**2, limit_s**2).sum()
            counts[scale] += len(apart)
        whole = np.median(residual[-4:]) - np.median(residual[:4])
        whole /= max(1.0, np.sqrt((section.time_s[-1] - section.time_s[0]) / 30.0))
        sums[-1] += min(whole**2, _SECTION[0] ** 2)
        counts[-1] += 1
    weight = np.array([*(scale[2] for scale in _SCALES), _SECTION[1]])
    means = [(np.sqrt(sums / np.maximum(counts, 1.0)) * weight).sum() for sums, counts in found.values()]
    return float(np.mean(means)) if means else 0.0


_STEP = 0.3  # step of the first simplex, in the logarithm
_WINDOW_S = 6.0
_POINTS, _SEARCHED, _VALLEYS, _STEPS = 400, 1.0, 5, 500
# Prior of parameters that runs do not determine, around a usual machine: cost of a deviation in misfit.
_TYPICAL_SPREAD = 1.0  # in the logarithm
_SEEN_SPREAD = 0.15  # of a parameter that logs show
_PRIOR = 0.01
_MIN_STEP = 0.02  # of the numeric derivatives, in the logarithm
_MIN_NOISE_S = 0.05  # least scatter of two readings in a window


def fit_motion(
    runs: Sequence[ObservedRun],
    family: LookAhead,
    machine: Machine,
    rapid_mm_per_s: float,
    *,
    thorough: bool = True,
    on_step: Callable[[], None] = lambda: None,
) -> MotionFit:
    """Minimise a family's misfit over its parameters: Nelder-Mead from several starts, then again near the best end."""
    from scipy.optimize import minimize

    sections = sections_of(runs)
    seen = _seen(runs)
    parameters = family.parameters
    low = np.log([parameter.low for parameter in parameters])
    high = np.log([parameter.high for parameter in parameters])
    usual = {parameter.name: parameter.start for parameter in parameters} | seen
    typical = np.log([usual[parameter.name] for parameter in parameters])
    reach = _typical_spread(parameters, seen)
    calls = 0

    def fit(point: FloatArray) -> MotionFit:
        kept = np.clip(point, low, high)
        values = {parameter.name: math.exp(value) for parameter, value in zip(parameters, kept, strict=True)}
        return MotionFit(family, values, rapid_mm_per_s)

    def cost(point: FloatArray) -> float:
        nonlocal calls
        calls += 1
        if calls % 20 == 0:
            on_step()
        beyond = float(np.abs(point - np.clip(point, low, high)).sum())
        usual = _PRIOR * float((((point - typical) / reach) ** 2).sum())
        return misfit(sections, fit(point).model(machine)) + usual + 10.0 * beyond

    def search(point: FloatArray, most: int) -> tuple[float, FloatArray]:
        simplex = np.vstack([point, point + _STEP * np.eye(len(parameters))])
        found = minimize(
            cost, point, method="Nelder-Mead",
            options={"maxfev": most, "xatol": 2e-3, "fatol": 1e-4, "initial_simplex": simplex, "adaptive": True},
        )  # fmt: skip
        return float(found.fun), found.x

    # The misfit has several minima: start at the best of many points, and restart at the end.
    generator = np.random.default_rng(1)
    points, valleys, restarts = (_POINTS, _VALLEYS, 2) if thorough else (_POINTS // 2, _VALLEYS // 2, 1)
    spread = generator.normal(0.0, _SEARCHED, (points, len(parameters))) * (reach / _TYPICAL_SPREAD)
    tried = [typical, *(np.clip(typical + each, low, high) for each in spread)]
    ranked = sorted(((cost(point), index) for index, point in enumerate(tried)), key=lambda each: each[0])
    ends = [search(tried[index], _STEPS // 2) for _, index in ranked[:valleys]]
    best = min(ends, key=lambda end: end[0])
    for _ in range(restarts):
        end = search(best[1] + generator.normal(0.0, 0.1, len(parameters)), _STEPS)
        best = min(best, end, key=lambda each: each[0])
    return fit(best[1])


def parameter_covariance(
    fit: MotionFit, runs: Sequence[ObservedRun], machine: Machine
) -> tuple[FloatArray, FloatArray]:
    """Covariance (n, n) of the logarithms of a fit's parameters, and variances (n,) by the runs alone.

    Computed from derivatives of the durations of windows of some seconds. For the scatter each section counts as one
    observation (cluster sandwich estimator). In the covariance, parameters that the runs do not determine keep their
    prior spread.
    """
    from scipy.stats import t as student

    parameters = fit.family.parameters
    names = [parameter.name for parameter in parameters]
    sections = sections_of(runs)
    windows = [_windows(section) for section in sections]

    def taken(values: dict[str, float]) -> list[FloatArray]:
        residual = section_residuals(sections, replace(fit, values=values).model(machine))
        return [np.diff(each[points]) for each, points in zip(residual, windows, strict=True)]

    centre = taken(fit.values)
    slopes = []
    for name in names:
        above = taken(fit.values | {name: fit.values[name] * math.exp(_MIN_STEP)})
        below = taken(fit.values | {name: fit.values[name] * math.exp(-_MIN_STEP)})
        slopes.append([(one - other) / (2.0 * _MIN_STEP) for one, other in zip(above, below, strict=True)])
    normal = np.zeros((len(names), len(names)))
    scatter = np.zeros_like(normal)
    for rank, error in enumerate(centre):
        slope = np.column_stack([each[rank] for each in slopes])
        normal += slope.T @ slope
        pull = slope.T @ np.clip(error, -1.0, 1.0)
        scatter += np.outer(pull, pull)
    white = np.concatenate(centre) if centre else np.zeros(1)
    noise = max(float(np.mean(np.minimum(white**2, 1.0))), _MIN_NOISE_S**2)
    reach = _typical_spread(parameters, _seen(runs))
    # Few clusters understate the scatter: apply the usual correction, and Student's t. They determine no more
    # directions than their number: the noise of the windows is a lower bound of the variance.
    clusters = max(1, len(centre) - 1)
    scatter *= len(centre) / clusters * (float(student.ppf(0.975, clusters)) / 1.96) ** 2

    def covariance(known: FloatArray) -> FloatArray:
        inverse = np.linalg.inv(normal + known)
        return np.asarray(inverse @ scatter @ inverse + noise * inverse)

    alone = 1e-12 * max(float(np.trace(normal)), 1e-6) * np.eye(len(names))
    return covariance(noise * np.diag(reach**-2.0)), np.diag(covariance(alone))


def _seen(runs: Sequence[ObservedRun]) -> dict[str, float]:
    """Parameters that the logs show directly, by name."""
    across = seen_arc_acceleration(runs)
    return {"arc_acceleration": across} if math.isfinite(across) else {}


def _typical_spread(parameters: Sequence[Parameter], seen: Container[str]) -> FloatArray:
    """Standard deviation (n,) of each parameter's logarithm over machines; smaller for parameters that logs show."""
    return np.array([_SEEN_SPREAD if parameter.name in seen else _TYPICAL_SPREAD for parameter in parameters])


def _windows(section: SeenSection) -> IntArray:
    """Indices of readings some seconds apart."""
    points = [0]
    for index, time_s in enumerate(section.time_s):
        if time_s - section.time_s[points[-1]] >= _WINDOW_S:
            points.append(index)
    return np.array(points if len(points) > 1 or len(section.time_s) < 2 else [0, len(section.time_s) - 1])


# The time between two cuts is the sum of motion and other times. Logs determine the sums; their division among codes
# that always occur together is a choice: the one with the smallest values is used.

_READING_S = 0.1  # scatter of the time between two readings
_OUTLIER = 3.0  # in units of _READING_S: larger deviations have less weight
_RIDGE = 0.02  # weight of the ridge towards 0, relative to a reading's scatter
_USUAL_S, _USUAL_KRPM = 2.0, 5.0  # standard deviation over usual machines: of a time, and of a spindle's first speed
_MAX_S = 60.0
_UNSEEN = 1e-3  # least sum of derivatives, relative to a reading's scatter
_TOOL_CHANGE = 6
_MAX_KRPM = 60.0
_TABLE_KRPM = 30.0  # range of a spindle's table above its first speed


@dataclass(frozen=True)
class FunctionFit:
    """Fitted times of M codes, tool changes, spindle starts, program start and moves of unknown length."""

    # by name: "start", "tool change", "M8", "move xy", "move z" in s; "spindle start from" and "spindle stop from" in
    # 1000/min, "spindle start" and "spindle stop" in s per 1000/min above
    values: dict[str, float]
    low: dict[str, float]  # lower ends of the 95 % intervals by name
    high: dict[str, float]
    covariance: FloatArray  # (n, n) in the order of the values
    last_tool_in_spindle: bool  # when the program is started again, its last tool is in the spindle
    scatter_s: float  # RMS deviation of the time between two cuts


@dataclass(frozen=True, eq=False)
class _Span:
    """The time between two logged lines of a run, with M, S or T functions between them."""

    run: ObservedRun
    begin: int  # line; 0: cycle start
    end: int
    seconds: float


def whole_model(
    machine: Machine, motion: MotionFit, values: dict[str, float], last_tool_in_spindle: bool
) -> _core.FanucModel:
    """Controller model with fitted motion, and *values*: times of tool changes, M codes, spindle and unknown moves."""
    model = motion.model(machine)
    model.program_start_s = values.get("start", 0.0)
    model.tool_change_s = values.get("tool change", 0.0)
    model.last_tool_in_spindle = last_tool_in_spindle
    model.m_function_s = 0.0
    model.m_code_s = dict(m_codes(values).items())
    xy = values.get("move xy", 0.0)
    model.unknown_move_s = [xy, xy, values.get("move z", 0.0)]
    model.spindle_start_s = spindle_rows(values, "spindle start")
    model.spindle_stop_s = spindle_rows(values, "spindle stop")
    return model


def m_codes(values: dict[str, float]) -> dict[int, float]:
    """Times of M codes by number."""
    return {int(name[1:]): value for name, value in values.items() if name[0] == "M" and name[1:].isdigit()}


def spindle_rows(values: dict[str, float], name: str) -> list[tuple[float, float]]:
    """Table of a spindle's time: zero up to a speed, then rising linearly from zero."""
    slope, begin = values.get(name, 0.0), values.get(f"{name} from", 0.0)
    if slope <= 1e-6:
        return []
    rows = [(begin * 1000.0, 0.0)] if begin > 1e-3 else []
    return [*rows, ((begin + _TABLE_KRPM) * 1000.0, slope * _TABLE_KRPM)]


def fit_functions(runs: Sequence[ObservedRun], motion: MotionFit, machine: Machine) -> FunctionFit:
    """Fit the times between cuts by least squares, robust against operator actions."""
    spans = [span for run in runs for span in _spans(run)]
    names = _names(runs)
    # The tool in the spindle at the start matters only if a program ends with its first tool.
    used = ([tool for tool in run.timed.tools.tolist() if tool >= 0] for run in runs)
    kept = (False, True) if any(tools and tools[0] == tools[-1] for tools in used) else (False,)
    fits = [_fit(spans, names, motion, machine, each) for each in kept]
    return min(fits, key=lambda fit: fit.scatter_s * (0.98 if not fit.last_tool_in_spindle else 1.0))


def _names(runs: Sequence[ObservedRun]) -> list[str]:
    functions = [each for run in runs for each in run.timed.program.core.functions]
    codes = {code for codes, _, _ in functions for code in codes}
    spins = any(speed > 0.0 for _, _, speed in functions)
    names = ["start", "move xy", "move z"]
    names += ["tool change"] if _TOOL_CHANGE in codes else []
    names += [f"M{code}" for code in sorted(codes - {_TOOL_CHANGE})]
    names += ["spindle start", "spindle start from"] if spins and codes & {3, 4} else []
    return names + (["spindle stop", "spindle stop from"] if spins and 5 in codes else [])


def _spans(run: ObservedRun) -> list[_Span]:
    """Times between logged lines with M, S or T functions in between: between cuts, at start and end of the run."""
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
    # Only the total time to the first cut is used, as a control reports its first lines late.
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
    scale = np.array([_MAX_S if not name.endswith("from") else _MAX_KRPM for name in names])
    pull = np.array([0.0 if name.endswith("from") else _RIDGE for name in names]) / _READING_S

    def errors(point: FloatArray) -> FloatArray:
        values = dict(zip(names, point.tolist(), strict=True))
        starts = starts_of(whole_model(machine, motion, values, kept))
        taken = []
        for span in spans:
            of_run = starts(span.run, 1.0)
            taken.append(of_run[span.end] - (of_run[span.begin] if span.begin > 0 else 0.0))
        return np.concatenate([(np.array(taken) - seconds) / _READING_S, pull * point])

    begin = np.array([4.0 if name.endswith("from") else 0.3 for name in names])
    found = least_squares(
        errors, begin, bounds=(np.zeros(len(names)), scale), loss="soft_l1", f_scale=_OUTLIER, x_scale=1.0,
        diff_step=np.full(len(names), 1e-3), max_nfev=60,
    )  # fmt: skip
    values = dict(zip(names, found.x.tolist(), strict=True))
    error = errors(found.x)[: len(spans)] * _READING_S
    middle = float(np.sqrt(np.mean(np.minimum(error**2, 1.0)))) if len(error) else 0.0
    # Each span counts about twice: as a whole, and in its readings.
    slope = np.asarray(found.jac)
    spread = np.linalg.pinv(slope.T @ slope) * 2.0 * max(1.0, (middle / _READING_S) ** 2)
    # The same with the prior of usual machines in place of the ridge, which is arbitrary.
    usual = np.array([_USUAL_KRPM if name.endswith("from") else _USUAL_S for name in names])
    seen = slope[: len(spans)]
    told = seen.T @ seen / (2.0 * max(1.0, (middle / _READING_S) ** 2))
    covariance = np.linalg.inv(told + np.diag(usual**-2.0))
    # A parameter without effect is not determined.
    unseen = np.abs(seen).sum(axis=0) < _UNSEEN
    reach = np.where(unseen, _MAX_S, 2.0 * np.sqrt(np.maximum(np.diag(spread), 0.0)))
    low = dict(zip(names, np.maximum(found.x - reach, 0.0).tolist(), strict=True))
    high = dict(zip(names, np.minimum(found.x + reach, _MAX_S).tolist(), strict=True))
    return FunctionFit(values, low, high, covariance, kept, middle)
