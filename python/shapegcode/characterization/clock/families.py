"""What the look-ahead of a control may look like: its limits as numbers that a log can be fitted with.

Each family is a rule for corners with the limits beside it. All are played by the same planner.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.controller import controller_model

__all__ = ["FAMILIES", "LookAhead", "Parameter", "family_of", "fitted_model", "machine_values"]


@dataclass(frozen=True)
class Parameter:
    """One number of a family.

    Attributes:
        name: short, within the family.
        key: of the machine file; "{axis}" stands for the axes of `axes`.
        unit: of the value in the machine file.
        start: where a fit begins, in mm, s and rad.
        low: least value.
        high: largest value.
        scale: value in the machine file over that of the fit.
        axes: that it holds for.
        meaning: in words.
    """

    name: str
    key: str
    unit: str
    start: float
    low: float
    high: float
    meaning: str
    scale: float = 1.0
    axes: str = ""


@dataclass(frozen=True)
class LookAhead:
    """A rule for corners with its limits.

    Attributes:
        name: as it is shown.
        motion: `controller.motion`.
        law: `controller.law`.
        rule: `controller.corner_rule`.
        parameters: what is fitted.
        meaning: in words.
    """

    name: str
    motion: str
    law: str
    rule: str
    parameters: tuple[Parameter, ...]
    meaning: str


_ACROSS = Parameter(
    "acceleration_xy", "axes.{axis}.max_acceleration_mm_s2", "mm/s²", 1000.0, 20.0, 30_000.0,
    "acceleration of X and Y", axes="xy",
)  # fmt: skip
_ALONG_Z = Parameter(
    "acceleration_z", "axes.{axis}.max_acceleration_mm_s2", "mm/s²", 1000.0, 20.0, 30_000.0, "acceleration of Z",
    axes="z",
)  # fmt: skip
_JERK_TIME = Parameter(
    "jerk_time", "controller.bell_time_s", "s", 0.05, 0.001, 0.5, "time in which the acceleration is built up"
)
_ARCS = Parameter(
    "arc_acceleration", "controller.centripetal_acceleration_mm_s2", "mm/s²", 1000.0, 5.0, 30_000.0,
    "acceleration across the path in arcs",
)  # fmt: skip
_CORNER = Parameter(
    "corner_xy", "controller.corner_speed_difference_mm_per_min.{axis}", "mm/min", 8.0, 0.05, 300.0,
    "speed step of X and Y at a corner", scale=60.0, axes="xy",
)  # fmt: skip
_CORNER_Z = Parameter(
    "corner_z", "controller.corner_speed_difference_mm_per_min.{axis}", "mm/min", 8.0, 0.05, 300.0,
    "speed step of Z at a corner", scale=60.0, axes="z",
)  # fmt: skip
_RAPID_TIME = Parameter(
    "rapid_time", "controller.rapid_time_constant_s", "s", 0.15, 0.01, 1.0, "time in which a rapid reaches its rate"
)
_ARRIVAL = Parameter("arrival", "controller.in_position_s", "s", 0.04, 1e-4, 1.0, "wait behind a rapid")
_DEVIATION = Parameter(
    "deviation", "controller.junction_deviation_mm", "mm", 0.005, 1e-5, 0.5, "deviation allowed at a corner"
)
_STOP_ANGLE = Parameter(
    "stop_angle", "controller.corner_stop_angle_deg", "degrees", 0.5, 0.03, 3.0, "corners that are stops",
    scale=180.0 / math.pi,
)  # fmt: skip
_TIME_CONSTANT = Parameter(
    "time_constant", "controller.time_constant_s", "s", 0.08, 0.005, 0.6, "time in which a feed is reached"
)
_BLOCK_TIME = Parameter(
    "block_time", "controller.look_ahead_block_time_s", "s", 0.002, 1e-4, 0.05, "time in which a block is read"
)
_BOTH = (_RAPID_TIME, _ARRIVAL)

FAMILIES = (
    LookAhead(
        "speed difference", "look_ahead", "jerk_limited", "speed_difference",
        (_ACROSS, _ALONG_Z, _JERK_TIME, _CORNER, _CORNER_Z, _ARCS, *_BOTH),
        "look-ahead with a largest speed step of each axis at corners (FANUC 1783)",
    ),
    LookAhead(
        "speed difference, block time", "look_ahead", "jerk_limited", "speed_difference",
        (_ACROSS, _ALONG_Z, _JERK_TIME, _CORNER, _CORNER_Z, _ARCS, _BLOCK_TIME, *_BOTH),
        "the same, and blocks are read no faster than so",
    ),
    LookAhead(
        "speed difference, constant time", "look_ahead", "constant_time", "speed_difference",
        (_ACROSS, _ALONG_Z, _TIME_CONSTANT, _JERK_TIME, _CORNER, _CORNER_Z, _ARCS, *_BOTH),
        "the same, with ramps of a constant time",
    ),
    LookAhead(
        "junction deviation", "look_ahead", "jerk_limited", "junction_deviation",
        (_ACROSS, _ALONG_Z, _JERK_TIME, _DEVIATION, _ARCS, *_BOTH),
        "look-ahead that passes a corner as an arc within a deviation",
    ),
    LookAhead(
        "stops at corners", "look_ahead", "jerk_limited", "stops",
        (_ACROSS, _ALONG_Z, _JERK_TIME, _STOP_ANGLE, _ARCS, *_BOTH),
        "look-ahead that stops at sharp corners",
    ),
    LookAhead(
        "after interpolation", "after_interpolation", "constant_time", "speed_difference", (_TIME_CONSTANT, *_BOTH),
        "no look-ahead: blocks overlap within the time constant (FANUC 1622)",
    ),
)  # fmt: skip
"""What is tried."""

_OFF = 1e9
_NO_LIMIT = 1e6  # mm/s²


def family_of(name: str) -> LookAhead:
    """The family of a name."""
    return next(family for family in FAMILIES if family.name == name)


def fitted_model(
    machine: Machine, family: LookAhead, values: Mapping[str, float], rapid_mm_per_s: float
) -> _core.ControllerModel:
    """The controller that a family and its numbers describe."""
    model = controller_model(machine)
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
    model.motion = getattr(_core.MotionKind, family.motion)
    model.filter_shape = _core.FilterShape.linear
    model.time_constant_s = values.get("time_constant", 0.0)
    model.bell_time_s = 0.0
    model.look_ahead_filter_time_constant_s = 0.0
    if math.isfinite(rapid_mm_per_s):
        model.rapid_rate_mm_per_s = [rapid_mm_per_s] * 3
    model.rapid_time_constant_s = [values["rapid_time"]] * 3
    model.rapid_bell_time_s = 0.0
    model.in_position = _core.InPosition.measured
    model.in_position_s = [values["arrival"]] * 3
    return model


def machine_values(family: LookAhead, values: Mapping[str, float], rapid_mm_per_s: float) -> dict[str, object]:
    """The same as values of the machine file, by dotted key."""
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
        if math.isfinite(rapid_mm_per_s):
            found[f"axes.{axis}.rapid_mm_per_min"] = float(f"{rapid_mm_per_s * 60.0:.5g}")
    for parameter in family.parameters:
        value = float(f"{values[parameter.name] * parameter.scale:.5g}")
        if parameter.key.startswith("controller.corner_speed"):
            corner.update(dict.fromkeys(parameter.axes, value))
        elif "{axis}" in parameter.key:
            found.update({parameter.key.format(axis=axis): value for axis in parameter.axes})
        else:
            found[parameter.key] = value
    if any(parameter.name == "corner_xy" for parameter in family.parameters):
        found["controller.corner_speed_difference_mm_per_min"] = corner
    if family.motion == "after_interpolation":
        found["controller.after_interpolation_shape"] = "linear"
    return found
