"""The axes of a machine file: limits, vibration modes, feed drives."""

from functools import partial
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from shapegcode._core import Mode
from shapegcode.errors import ArgumentError
from shapegcode.settings.keys import Bool, Float, InlineTable, NonNegative, Positive, Text, TomlTable, key, toml

optional = partial(key, default=None)
_Ratio = Annotated[NonNegative, Field(lt=1)]
_Percent = Annotated[NonNegative, Field(lt=100)]
_Hertz = Annotated[Positive, Field(le=10_000)]
_Speed = Annotated[Positive, Field(ge=1, le=10_000_000)]
_MAX_MODES = 200  # identification finds 40 at most


class Drive(TomlTable):
    """Feed drive of an axis, for the simulation with friction."""

    motor_inertia_kg_m2: Positive = key(
        "moment of inertia on the motor shaft: rotor, brake, coupling and ball screw", unit="kg m²"
    )
    screw_lead_mm: Positive = key(
        "travel per revolution of the motor: lead of the ball screw, times the gear ratio if there is one"
    )
    table_mass_kg: Positive = key("moving mass: table or slide with its load")
    stiffness_n_per_um: Positive = key(
        "axial stiffness from motor to table: screw, nut, bearings and coupling in series"
    )
    damping_ratio: _Ratio = key("damping ratio of motor and table on that stiffness", assumed=0.05)
    backlash_um: NonNegative = key(
        "free travel between motor and table (a ball bar shows it together with the elastic windup of the screw); 0: "
        "none",
        assumed=0.0,
    )
    position_feedback: Literal["motor", "table"] = key(
        'feedback of the position loop. "motor": the encoder of the motor (semi-closed); "table": a linear scale '
        "(fully closed). Its gain is controller.position_gain_per_s, its feed-forward controller.feed_forward_ratio",
        fanuc="1815#1",
        assumed="motor",
    )
    velocity_bandwidth_hz: Positive = key(
        "bandwidth of the velocity loop with motor and load as one inertia; it determines the proportional gain",
        fanuc="2021, 2044",
    )
    velocity_integral_time_s: NonNegative = key(
        "integral time of the velocity loop; 0: no integral part", fanuc="2043", assumed=0.02
    )
    acceleration_feed_forward_ratio: Annotated[NonNegative, Field(le=1)] = key(
        "ratio of the acceleration torque that is fed forward; 0: none", fanuc="2069", assumed=0.0
    )
    torque_limit_n_m: Positive | None = optional(
        "largest torque of the motor; left out: not limited", unit="N m", fanuc="2060"
    )
    friction_model: Literal["viscous", "stribeck", "lugre"] = key(
        'friction of the table. "viscous": proportional to speed only; "stribeck": Coulomb, static and Stribeck '
        'as a curve over the speed; "lugre": the same with presliding, as at reversals',
        assumed="viscous",
    )
    friction_viscous_n_s_per_m: NonNegative = key("viscous friction of the guideways", unit="N s/m", assumed=0.0)
    friction_coulomb_n: Positive | None = optional("sliding friction of the guideways; stribeck and lugre need it")
    friction_static_n: Positive | None = optional(
        "static friction of the guideways, not below the sliding one; stribeck and lugre need it"
    )
    friction_stribeck_velocity_mm_per_s: Positive = key(
        "speed at which 63 % of the fall from static to sliding friction is reached", assumed=5.0
    )
    friction_smoothing_velocity_mm_per_s: Positive = key(
        "speed within which the friction changes its sign (stribeck only)", assumed=0.1
    )
    friction_bristle_stiffness_n_per_um: Positive = key(
        "force over displacement before the table slides (lugre only); static friction / this: presliding distance",
        assumed=30.0,
    )
    friction_bristle_damping_n_s_per_m: NonNegative = key(
        "damping before the table slides (lugre only)", unit="N s/m", assumed=30_000.0
    )
    motor_friction_viscous_n_m_s_per_rad: NonNegative = key(
        "viscous friction of motor, bearings and nut", unit="N m s/rad", assumed=0.0
    )

    @model_validator(mode="after")
    def _friction_is_complete(self) -> Self:
        if self.friction_model == "viscous":
            return self
        sliding, static = self.friction_coulomb_n, self.friction_static_n
        if sliding is None or static is None:
            name = "friction_coulomb_n" if sliding is None else "friction_static_n"
            raise ValueError(f'friction_model is "{self.friction_model}": needs {name}')
        if static < sliding:
            raise ValueError(
                f"friction_static_n is {toml(static)}: must not be below friction_coulomb_n, {toml(sliding)} (unit: N)"
            )
        return self


class FrequencyOver(InlineTable):
    """Frequency of a mode over an axis position or the mass of the part."""

    axis: Literal["x", "y", "z"] | None = optional("axis on whose position it depends")
    position_mm: tuple[Float, ...] | None = optional("positions of the axis, ascending, in the machine's coordinates")
    mass_kg: tuple[NonNegative, ...] | None = optional("masses of the part, ascending")
    frequency_hz: tuple[_Hertz, ...] = key("natural frequencies, one per row")
    damping_ratio: tuple[_Ratio, ...] | None = optional("damping ratios, one per row")

    @model_validator(mode="after")
    def _is_a_table(self) -> Self:
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
        """Key of the independent variable of the rows."""
        return "position_mm" if self.mass_kg is None else "mass_kg"

    @property
    def abscissa(self) -> tuple[float, ...]:
        """Positions in mm or masses in kg, ascending."""
        return (self.position_mm if self.mass_kg is None else self.mass_kg) or ()


Share = Annotated[Float, Field(ge=-1000, le=1000)]


class Direction(InlineTable):
    """Components along X, Y and Z; default 0."""

    x: Share = key("component along the X axis", unit="1", default=0.0)
    y: Share = key("component along the Y axis", unit="1", default=0.0)
    z: Share = key("component along the Z axis", unit="1", default=0.0)

    @model_validator(mode="after")
    def _points_somewhere(self) -> Self:
        if not any(self.as_tuple()):
            raise ValueError("x, y and z are 0: one must be another number")
        return self

    def as_tuple(self) -> tuple[float, float, float]:
        """The components in the order X, Y, Z."""
        return (self.x, self.y, self.z)


class AxisMode(TomlTable):
    """One vibration mode, listed under one axis."""

    frequency_hz: _Hertz = key("natural frequency; from a tap test, or from the decay after a rapid stop")
    damping_ratio: _Ratio = key("damping ratio (1 = critically damped)")
    participation: Annotated[Positive, Field(le=1000)] = key(
        "participation factor of this mode in the axis' deflection; the factors of one axis need not add up to 1",
        unit="1",
        default=1.0,
    )
    excited_by: Direction | None = optional(
        "factors of the accelerations of X, Y and Z that excite this mode, { y = 1, z = 0.2 }; left out: its own "
        "axis alone, { y = 1 } under axes.y. A mode that several axes excite is listed under one of them only"
    )
    moves: Direction | None = optional(
        "mode shape at the tool relative to the part: { y = 1, z = 0.3 } moves the tool by 0.3 mm in Z per mm in Y; "
        "left out: its axis alone. participation scales all components"
    )
    frequency_uncertainty_percent: _Percent | None = optional(
        "uncertainty of the frequency, up and down (position of the table, mass of the workpiece); left out: not "
        "known. With no value, or up to 0.2 %, the shaper is designed for the nominal frequency only"
    )
    damping_uncertainty_percent: _Percent | None = optional(
        "uncertainty of the damping ratio, up and down, relative; left out: the ratio is taken as exact"
    )
    mass_kg: Positive | None = optional(
        "equivalent mass of this mode at the tapped point; its stiffness there is mass_kg * (2 pi "
        "frequency_hz)^2. Shapers do not need it; left out: not measured"
    )
    mass_uncertainty_percent: NonNegative | None = optional("uncertainty of the mass, up and down")
    source: Text | None = optional("origin of the values of this mode")
    frequency_over: FrequencyOver | None = optional(
        'table of the frequency over the position of an axis, { axis = "z", position_mm = [0, 200, 400], '
        "frequency_hz = [52, 46, 41] }, or over the mass of the part, { mass_kg = [0, 300], frequency_hz = [46, 38] }; "
        "damping_ratio = [...] is optional. Linear between the rows, constant beyond them; positions are the "
        "machine's: program plus work offset and tool length. frequency_hz above stays the nominal value and lies "
        "within the table"
    )

    def excitation(self, axis: int) -> tuple[float, float, float]:
        """Factors of the accelerations of X, Y, Z that excite a mode of an axis (0, 1, 2)."""
        return _along(axis) if self.excited_by is None else self.excited_by.as_tuple()

    def motion(self, axis: int) -> tuple[float, float, float]:
        """Mode shape of this mode in X, Y, Z, without participation; *axis*: the axis (0, 1, 2) that has the mode."""
        return _along(axis) if self.moves is None else self.moves.as_tuple()

    @model_validator(mode="after")
    def _has_a_mass_and_lies_in_its_table(self) -> Self:
        if self.mass_uncertainty_percent is not None and self.mass_kg is None:
            raise ValueError("mass_uncertainty_percent is given, mass_kg is not")
        if self.frequency_over is not None:
            low, high = min(self.frequency_over.frequency_hz), max(self.frequency_over.frequency_hz)
            if not low <= self.frequency_hz <= high:
                raise ValueError(
                    f"frequency_hz is {toml(self.frequency_hz)}: must lie within frequency_over, "
                    f"{toml(low)} to {toml(high)} (unit: Hz)"
                )
        return self


def _along(axis: int) -> tuple[float, float, float]:
    x, y, z = (float(axis == each) for each in range(3))
    return (x, y, z)


class Axis(TomlTable):
    """Limits, vibration modes and feed drive of one axis; a machine file has a table for each of X, Y and Z."""

    max_feed_mm_per_min: _Speed = key("largest cutting feed of this axis", fanuc="1430")
    rapid_mm_per_min: _Speed = key("rapid traverse (G00)", fanuc="1420")
    max_acceleration_mm_s2: Annotated[Positive, Field(ge=1, le=1_000_000)] = key(
        "largest acceleration while cutting", fanuc="1660"
    )
    max_jerk_mm_s3: Annotated[Positive, Field(ge=10, le=10**10)] | None = optional(
        "largest jerk while cutting; left out: not limited"
    )
    modes: Annotated[tuple[AxisMode, ...], Field(max_length=_MAX_MODES)] = key(
        "vibration modes, one table each; none: the axis is simulated as rigid", default=()
    )
    rigid: Bool = key(
        "whether this axis is known, from a test or by your decision, to have no significant vibration mode. false "
        "without modes: not known; it is simulated as rigid, and reported if a shaped cut moves it",
        default=False,
    )
    drive: Drive | None = optional(
        "feed drive, for the simulation with friction; left out: the axis follows its set-points exactly"
    )

    @model_validator(mode="after")
    def _rigid_or_not(self) -> Self:
        if self.rigid and self.modes:
            raise ValueError("rigid is true, but there are modes: delete one of them")
        return self


class Axes(TomlTable):
    """The three linear axes."""

    x: Axis = key("the X axis")
    y: Axis = key("the Y axis")
    z: Axis = key("the Z axis")

    def as_tuple(self) -> tuple[Axis, Axis, Axis]:
        """The three axes in the order X, Y, Z."""
        return (self.x, self.y, self.z)

    def __getitem__(self, axis: str) -> Axis:
        """The axis of a name, x, y or z."""
        return dict(zip("xyz", self.as_tuple(), strict=True))[axis.lower()]


def as_mode(given: Any) -> Any:
    """The mode of a pair (Hz, damping ratio), or of what has one, such as an identified mode; others as they are."""
    return Mode(*given) if isinstance(given, tuple) else getattr(given, "mode", given)


def check_axes(keep: str, rigid: str) -> None:
    """Refuse names that are not axes, and axes that are both kept and rigid."""
    wrong = sorted({*keep, *rigid} - set("xyz"))
    if wrong:
        raise ArgumentError(f"{', '.join(wrong)}: axes are x, y and z")
    if both := sorted({*keep} & {*rigid}):
        raise ArgumentError(f"{', '.join(both).upper()}: its modes cannot be kept if it is rigid")
