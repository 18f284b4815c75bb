"""The axes of a machine file: limits and vibration modes."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from shapegcode.machine.drive import Drive
from shapegcode.settings.keys import Bool, Float, InlineTable, NonNegative, Positive, Text, TomlTable, key, toml

_MAX_MODES = 200  # identification finds 40 at most


class FrequencyOver(InlineTable):
    """How the frequency of a mode depends on where an axis stands or on what the part weighs."""

    axis: Literal["x", "y", "z"] | None = key("axis whose position counts", default=None)
    position_mm: tuple[Float, ...] | None = key(
        "positions of the axis, ascending, in the machine's coordinates", unit="mm", default=None
    )
    mass_kg: tuple[NonNegative, ...] | None = key("masses of the part, ascending", unit="kg", default=None)
    frequency_hz: tuple[Annotated[Positive, Field(le=10_000)], ...] = key("natural frequencies, one per row", unit="Hz")
    damping_ratio: tuple[Annotated[NonNegative, Field(lt=1)], ...] | None = key(
        "damping ratios, one per row", unit="1", default=None
    )

    @model_validator(mode="after")
    def _is_a_table(self) -> FrequencyOver:
        if self.mass_kg is not None and self.position_mm is not None:
            raise ValueError("is either over position_mm of an axis or over mass_kg: both are given")
        if self.mass_kg is None and self.position_mm is None:
            raise ValueError("needs position_mm (with axis) or mass_kg: neither is given")
        if (self.axis is None) != (self.position_mm is None):
            given, missing = ("position_mm", "axis") if self.axis is None else ("axis", "position_mm")
            raise ValueError(f"{given} is given, {missing} is not")
        for name, values in (("frequency_hz", self.frequency_hz), ("damping_ratio", self.damping_ratio)):
            if values is not None and len(values) != len(self.abscissa):
                raise ValueError(
                    f"{name} has {len(values)} values for {len(self.abscissa)} of {self.abscissa_name}: "
                    "must have one for each"
                )
        if len(self.abscissa) < 2:
            raise ValueError(f"{self.abscissa_name} has {len(self.abscissa)} values: must have 2 or more")
        for before, after in pairwise(self.abscissa):
            if not after > before:
                raise ValueError(f"{self.abscissa_name} must ascend: {toml(after)} follows {toml(before)}")
        return self

    @property
    def abscissa_name(self) -> str:
        """Key that the rows are counted along."""
        return "position_mm" if self.mass_kg is None else "mass_kg"

    @property
    def abscissa(self) -> tuple[float, ...]:
        """Positions in mm or masses in kg, ascending."""
        return (self.position_mm if self.mass_kg is None else self.mass_kg) or ()


class AxisMode(TomlTable):
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
        "left out: not known. Only the nominal frequency is designed for then, and up to 0.2 %",
        unit="%",
        default=None,
    )
    damping_uncertainty_percent: Annotated[NonNegative, Field(lt=100)] | None = key(
        "the damping ratio may be off by this much of itself either way; left out: not known, and the ratio is taken "
        "as exact",
        unit="%",
        default=None,
    )
    mass_kg: Positive | None = key(
        "equivalent mass of this mode at the point that was tapped; its stiffness there is mass_kg * (2 pi "
        "frequency_hz)^2. Shapers do not need it; left out: not measured",
        unit="kg",
        default=None,
    )
    mass_uncertainty_percent: NonNegative | None = key(
        "the mass may be off by this much either way", unit="%", default=None
    )
    source: Text | None = key("where the values of this mode come from", default=None)
    frequency_over: FrequencyOver | None = key(
        'table of the frequency over the position of an axis, { axis = "z", position_mm = [0, 200, 400], '
        "frequency_hz = [52, 46, 41] }, or over the mass of the part, { mass_kg = [0, 300], frequency_hz = [46, 38] }; "
        "damping_ratio = [...] may follow. Linear between the rows, constant beyond them; positions are the machine's: "
        "program plus work offset and tool length. frequency_hz above stays the nominal value and lies within the "
        "table",
        default=None,
    )

    @model_validator(mode="after")
    def _uncertainty_of_a_mass(self) -> AxisMode:
        if self.mass_uncertainty_percent is not None and self.mass_kg is None:
            raise ValueError("mass_uncertainty_percent is given, mass_kg is not")
        return self

    @model_validator(mode="after")
    def _nominal_in_table(self) -> AxisMode:
        if self.frequency_over is not None:
            low, high = min(self.frequency_over.frequency_hz), max(self.frequency_over.frequency_hz)
            if not low <= self.frequency_hz <= high:
                raise ValueError(
                    f"frequency_hz is {toml(self.frequency_hz)}: must lie within frequency_over, "
                    f"{toml(low)} to {toml(high)} (unit: Hz)"
                )
        return self


class Axis(TomlTable):
    """Limits of one axis; all three tables are required."""

    max_feed_mm_per_min: Positive = key("largest cutting feed of this axis", unit="mm/min", fanuc="1430")
    rapid_mm_per_min: Positive = key("rapid traverse (G00)", unit="mm/min", fanuc="1420")
    max_acceleration_mm_s2: Positive = key("largest acceleration while cutting", unit="mm/s²", fanuc="1660")
    max_jerk_mm_s3: Positive | None = key(
        "largest jerk while cutting; left out: not limited", unit="mm/s³", default=None
    )
    modes: Annotated[tuple[AxisMode, ...], Field(max_length=_MAX_MODES)] = key(
        "vibration modes, one table each; none: the axis is taken as rigid", default=()
    )
    rigid: Bool = key(
        "no vibration mode of this axis counts: looked for and not found, or decided. false, and no modes: nobody "
        "knows; the axis is taken as rigid, and every verdict says so",
        default=False,
    )
    drive: Drive | None = key(
        "feed drive, for the simulation with friction; left out: the axis follows its set-points exactly", default=None
    )

    @model_validator(mode="after")
    def _rigid_or_not(self) -> Axis:
        if self.rigid and self.modes:
            raise ValueError("rigid is true, and there are modes: take out one of both")
        return self


class Axes(TomlTable):
    """The three linear axes."""

    x: Axis = key("the X axis")
    y: Axis = key("the Y axis")
    z: Axis = key("the Z axis")

    def as_tuple(self) -> tuple[Axis, Axis, Axis]:
        """The three axes in the order X, Y, Z."""
        return (self.x, self.y, self.z)
