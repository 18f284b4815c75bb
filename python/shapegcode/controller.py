"""From the machine file to the core's model of its controller."""

from __future__ import annotations

from shapegcode import _core
from shapegcode.emit import motion_limits
from shapegcode.machine import Machine


def controller_model(
    machine: Machine, *, feed_override: float = 1.0, rapid_override: float = 1.0
) -> _core.ControllerModel:
    """The controller of a machine as the core times and plays it.

    Args:
        machine: the machine.
        feed_override: scales every programmed feed, 1 = as programmed.
        rapid_override: scales the rapid rates, 1 = full.
    """
    controller = machine.controller
    model = _core.ControllerModel()
    model.period_s = controller.interpolation_period_s
    model.block_end = getattr(_core.BlockEnd, controller.block_end)
    model.motion = getattr(_core.MotionKind, controller.motion)
    model.time_constant_s = controller.time_constant_s
    model.bell_time_s = controller.bell_time_s
    model.limits = motion_limits(machine)
    model.rapid_rate_mm_per_s = [axis.rapid_mm_per_min / 60.0 for axis in machine.axes.as_tuple()]
    model.rapid_time_constant_s = [controller.rapid_time_constant_s] * 3
    model.rapid_bell_time_s = controller.rapid_bell_time_s
    model.rapid_path = getattr(_core.RapidPath, controller.rapid_path)
    model.in_position_s = controller.in_position_s.as_tuple()
    model.feed_override = feed_override
    model.rapid_override = rapid_override
    return model
