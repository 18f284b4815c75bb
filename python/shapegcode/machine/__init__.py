"""Description of a machine tool: the machine file, and the import of a FANUC control's parameters."""

from shapegcode.machine.axes import Axes, Axis, AxisMode, check_axes
from shapegcode.machine.machine import Machine, inherited_text

__all__ = ["Axes", "Axis", "AxisMode", "Machine", "check_axes", "inherited_text"]
