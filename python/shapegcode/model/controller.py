"""From the machine file to the core's model of its controller."""

from __future__ import annotations

import math

from shapegcode import _core
from shapegcode.machine import Machine


def fanuc_model(
    machine: Machine, *, feed_override: float = 1.0, rapid_override: float = 1.0, shaped: bool | None = None
) -> _core.FanucModel:
    """The controller of a machine as the core times and plays it."""
    controller = machine.controller
    model = _core.FanucModel()
    model.period_s = controller.interpolation_period_s
    model.block_end = getattr(_core.BlockEnd, controller.block_end)
    model.motion = getattr(_core.MotionKind, controller.motion)
    model.filter_shape = getattr(_core.FilterShape, controller.after_interpolation_shape)
    model.time_constant_s = controller.time_constant_s
    model.bell_time_s = controller.bell_time_s
    model.limits = motion_limits(machine)
    model.look_ahead_filter_time_constant_s = controller.look_ahead_filter_time_constant_s
    model.rapid_rate_mm_per_s = [axis.rapid_mm_per_min / 60.0 for axis in machine.axes.as_tuple()]
    model.rapid_time_constant_s = controller.rapid_time_constant_s.as_tuple()
    model.rapid_bell_time_s = controller.rapid_bell_time_s
    model.rapid_path = getattr(_core.RapidPath, controller.rapid_path)
    model.in_position = getattr(_core.InPosition, controller.in_position)
    model.in_position_s = controller.in_position_s.as_tuple()
    model.position_gain_per_s = controller.position_gain_per_s.as_tuple()
    model.feed_forward_ratio = controller.feed_forward_ratio.as_tuple()
    model.in_position_width_mm = [width * 1e-3 for width in controller.in_position_width_um.as_tuple()]
    kinds = _core.ShapedRegions
    model.shaped_regions = kinds.marked if shaped is None else kinds.all if shaped else kinds.none
    model.shaped_filter_shape = getattr(_core.FilterShape, controller.shaped_filter_shape)
    model.shaped_time_constant_s = controller.shaped_time_constant_s
    model.shaped_bell_time_s = controller.shaped_bell_time_s
    model.feed_override = feed_override
    model.rapid_override = rapid_override
    times = machine.times
    model.program_start_s = times.program_start_s
    model.last_tool_in_spindle = times.last_tool_in_spindle
    model.tool_change_s = times.tool_change_s
    model.m_function_s = times.m_function_s
    model.m_code_s = dict(zip(times.m_codes.code, times.m_codes.s, strict=True)) if times.m_codes else {}
    model.spindle_start_s = times.spindle_start.rows if times.spindle_start else []
    model.spindle_stop_s = times.spindle_stop.rows if times.spindle_stop else []
    model.unknown_move_s = times.unknown_move_s.as_tuple()
    return model


def motion_limits(machine: Machine, *, arc_feed_ratio: float = 1.0) -> _core.MotionLimits:
    """Look-ahead limits of a machine."""
    limits = _core.MotionLimits()
    controller = machine.controller
    axes = machine.axes.as_tuple()
    limits.law = getattr(_core.AccelerationLaw, controller.law)
    # A ramp of one tick stands for "no ramp": zero time has no acceleration.
    limits.time_constant_s = max(controller.time_constant_s, controller.interpolation_period_s)
    limits.jerk_time_s = controller.bell_time_s
    limits.max_feed_mm_per_s = [axis.max_feed_mm_per_min / 60.0 for axis in axes]
    limits.max_acceleration_mm_per_s2 = [axis.max_acceleration_mm_s2 for axis in axes]
    limits.max_jerk_mm_per_s3 = [_limit(axis.max_jerk_mm_s3) for axis in axes]
    # 0 means a stop at every corner; the planner wants a speed, and this one is a stop to every purpose.
    rule, along = controller.corner_rule, controller.polyline_acceleration_mm_s2
    if rule == "speed_difference":
        steps = controller.corner_speed_difference_mm_per_min.as_tuple()
        limits.corner_speed_difference_mm_per_s = [max(value / 60.0, 1e-3) for value in steps]
        along = controller.centripetal_acceleration_mm_s2 if along is None else along
    elif rule == "junction_deviation":
        limits.junction_deviation_mm = _limit(controller.junction_deviation_mm)
    else:
        limits.corner_stop_angle_rad = math.radians(_limit(controller.corner_stop_angle_deg))
    limits.polyline_acceleration_mm_per_s2 = _limit(along)
    limits.centripetal_acceleration_mm_per_s2 = controller.centripetal_acceleration_mm_s2
    limits.block_time_s = controller.look_ahead_block_time_s
    if controller.contour_acceleration_mm_s2 is not None:
        limits.contour_acceleration_mm_per_s2 = controller.contour_acceleration_mm_s2.as_tuple()
    limits.arc_feed_ratio = arc_feed_ratio
    return limits


def _limit(value: float | None) -> float:
    return math.inf if value is None else value
