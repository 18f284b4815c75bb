"""The feed drive of an axis in a machine file: what `simulate` needs to move the axis as motor, screw and table."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from shapegcode.settings.keys import NonNegative, Positive, TomlTable, key, toml


class Drive(TomlTable):
    """Feed drive of an axis, for the simulation with friction."""

    motor_inertia_kg_m2: Positive = key(
        "moment of inertia that turns with the motor: rotor, brake, coupling and ball screw", unit="kg m²"
    )
    screw_lead_mm: Positive = key(
        "travel for one turn of the motor: lead of the ball screw, times the gear ratio where there is one", unit="mm"
    )
    table_mass_kg: Positive = key("moving mass: table or slide with what it carries", unit="kg")
    stiffness_n_per_um: Positive = key(
        "axial stiffness from motor to table: screw, nut, bearings and coupling in series", unit="N/µm"
    )
    damping_ratio: Annotated[NonNegative, Field(lt=1)] = key(
        "damping ratio of motor against table on that stiffness", unit="1", default=0.05, assumed=True
    )
    backlash_um: NonNegative = key(
        "free travel between motor and table (a ball bar shows it together with the stretch of the screw); 0: none",
        unit="µm",
        default=0.0,
        assumed=True,
    )
    position_feedback: Literal["motor", "table"] = key(
        'what the position loop measures. "motor": the encoder of the motor (semi-closed); "table": a linear scale '
        "(fully closed). Its gain is controller.position_gain_per_s, its feed-forward controller.feed_forward_ratio",
        fanuc="1815#1",
        default="motor",
        assumed=True,
    )
    velocity_bandwidth_hz: Positive = key(
        "bandwidth of the speed loop with all inertia as one mass; it states its gain", unit="Hz", fanuc="2021, 2044"
    )
    velocity_integral_time_s: NonNegative = key(
        "integral time of the speed loop; 0: no integral part", unit="s", fanuc="2043", default=0.02, assumed=True
    )
    acceleration_feed_forward_ratio: Annotated[NonNegative, Field(le=1)] = key(
        "share of the torque for the set-points' acceleration that is fed forward; 0: none",
        unit="1",
        fanuc="2069",
        default=0.0,
        assumed=True,
    )
    torque_limit_n_m: Positive | None = key(
        "largest torque of the motor; left out: not limited", unit="N m", fanuc="2060", default=None
    )
    friction_model: Literal["viscous", "stribeck", "lugre"] = key(
        'friction of the table. "viscous": in proportion to the speed alone; "stribeck": Coulomb, static and Stribeck '
        'as a curve over the speed; "lugre": the same with presliding, as a table shows it at reversals',
        default="viscous",
        assumed=True,
    )
    friction_viscous_n_s_per_m: NonNegative = key(
        "viscous friction of the guideways", unit="N s/m", default=0.0, assumed=True
    )
    friction_coulomb_n: Positive | None = key(
        "sliding friction of the guideways; stribeck and lugre need it", unit="N", default=None
    )
    friction_static_n: Positive | None = key(
        "friction of the guideways to be overcome from rest, not below the sliding one; stribeck and lugre need it",
        unit="N",
        default=None,
    )
    friction_stribeck_velocity_mm_per_s: Positive = key(
        "speed at which the friction has fallen from static to sliding", unit="mm/s", default=5.0, assumed=True
    )
    friction_smoothing_velocity_mm_per_s: Positive = key(
        "speed within which the friction changes its sign (stribeck alone)", unit="mm/s", default=0.1, assumed=True
    )
    friction_bristle_stiffness_n_per_um: Positive = key(
        "force over displacement before the table slides (lugre alone); static friction over it is the distance",
        unit="N/µm",
        default=30.0,
        assumed=True,
    )
    friction_bristle_damping_n_s_per_m: NonNegative = key(
        "damping before the table slides (lugre alone)", unit="N s/m", default=30_000.0, assumed=True
    )
    motor_friction_viscous_n_m_s_per_rad: NonNegative = key(
        "viscous friction of motor, bearings and nut", unit="N m s/rad", default=0.0, assumed=True
    )

    @model_validator(mode="after")
    def _friction_is_complete(self) -> Drive:
        if self.friction_model == "viscous":
            return self
        for name in ("friction_coulomb_n", "friction_static_n"):
            if getattr(self, name) is None:
                raise ValueError(f'friction_model is "{self.friction_model}": needs {name}')
        assert self.friction_coulomb_n is not None
        assert self.friction_static_n is not None
        if self.friction_static_n < self.friction_coulomb_n:
            raise ValueError(
                f"friction_static_n is {toml(self.friction_static_n)}: must not be below "
                f"friction_coulomb_n, {toml(self.friction_coulomb_n)} (unit: N)"
            )
        return self
