"""The axes of a machine file: limits and vibration modes."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from shapegcode.machine_keys import NonNegative, Positive, Table, key


class Mode(Table):
    """One vibration mode of an axis, excited by the motion of that axis."""

    frequency_hz: Annotated[Positive, Field(le=10_000)] = key(
        "natural frequency; from a tap test, or from the decay after a rapid stop", unit="Hz"
    )
    damping_ratio: Annotated[NonNegative, Field(lt=1)] = key("damping ratio (1 = critically damped)", unit="1")
    participation: Positive = key(
        "share of this mode in the axis's deflection; several modes of one axis need not add up to 1",
        unit="1",
        default=1.0,
    )
    frequency_uncertainty_percent: Annotated[NonNegative, Field(lt=100)] | None = key(
        "the frequency may be off by this much either way (position of the table, weight of the workpiece); "
        "left out: not known, and only the nominal frequency is designed for",
        unit="%",
        default=None,
    )


class Axis(Table):
    """Limits of one axis; all three tables are required."""

    max_feed_mm_per_min: Positive = key("largest cutting feed of this axis", unit="mm/min", fanuc="1430")
    rapid_mm_per_min: Positive = key("rapid traverse (G00)", unit="mm/min", fanuc="1420")
    max_acceleration_mm_s2: Positive = key("largest acceleration while cutting", unit="mm/s²", fanuc="1660")
    max_jerk_mm_s3: Positive | None = key(
        "largest jerk while cutting; left out: not limited", unit="mm/s³", default=None
    )
    modes: tuple[Mode, ...] = key("vibration modes, one table each; none: the axis is taken as rigid", default=())


class Axes(Table):
    """The three linear axes."""

    x: Axis = key("the X axis")
    y: Axis = key("the Y axis")
    z: Axis = key("the Z axis")

    def as_tuple(self) -> tuple[Axis, Axis, Axis]:
        """The three axes in the order X, Y, Z."""
        return (self.x, self.y, self.z)
