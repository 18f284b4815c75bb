"""From the machine file to the core's feed drives."""

from __future__ import annotations

import math

from shapegcode import _core
from shapegcode.machine import Axis, Machine, MachineError, Problem
from shapegcode.machine_drive import Drive

_UM = 1e-6  # m
_N_PER_UM = 1e6  # N/m
_MM = 1e-3  # m


def drive_parameters(machine: Machine) -> list[_core.FeedDriveParameters]:
    """The feed drives of X, Y and Z, referred to the travel of the tables.

    Position gain and feed-forward are those of the controller; the modes of the axes ride on the tables, at their
    nominal frequencies.

    Args:
        machine: with a table ``[axes.x.drive]``, and so for y and z.

    Raises:
        MachineError: an axis has no such table.
    """
    missing = [
        Problem(f"axes.{name}.drive", "", "required for a simulation with feed drives, but missing")
        for name, axis in zip("xyz", machine.axes.as_tuple(), strict=True)
        if axis.drive is None
    ]
    if missing:
        raise MachineError(machine.name, tuple(missing))
    gains = machine.controller.position_gain_per_s.as_tuple()
    ratios = machine.controller.feed_forward_ratio.as_tuple()
    return [
        _of_axis(axis, axis.drive, gain, ratio)
        for axis, gain, ratio in zip(machine.axes.as_tuple(), gains, ratios, strict=True)
        if axis.drive is not None
    ]


def _of_axis(axis: Axis, drive: Drive, gain_per_s: float, ratio: float) -> _core.FeedDriveParameters:
    rad_per_m = 2.0 * math.pi / (drive.screw_lead_mm * _MM)
    motor_mass = drive.motor_inertia_kg_m2 * rad_per_m**2
    reduced_mass = motor_mass * drive.table_mass_kg / (motor_mass + drive.table_mass_kg)
    stiffness = drive.stiffness_n_per_um * _N_PER_UM
    feedback = _core.PositionFeedback
    return _core.FeedDriveParameters(
        motor_mass_kg=motor_mass,
        table_mass_kg=drive.table_mass_kg,
        stiffness_n_per_m=stiffness,
        damping_n_s_per_m=2.0 * drive.damping_ratio * math.sqrt(stiffness * reduced_mass),
        position_gain_per_s=gain_per_s,
        velocity_gain_n_s_per_m=2.0 * math.pi * drive.velocity_bandwidth_hz * (motor_mass + drive.table_mass_kg),
        velocity_integral_time_s=drive.velocity_integral_time_s,
        velocity_feed_forward_ratio=ratio,
        acceleration_feed_forward_ratio=drive.acceleration_feed_forward_ratio,
        position_feedback=feedback.table if drive.position_feedback == "table" else feedback.motor,
        backlash_m=drive.backlash_um * _UM,
        force_limit_n=0.0 if drive.torque_limit_n_m is None else drive.torque_limit_n_m * rad_per_m,
        table_friction=_table_friction(drive),
        motor_friction=_core.FrictionParameters(
            viscous_n_s_per_m=drive.motor_friction_viscous_n_m_s_per_rad * rad_per_m**2
        ),
        modes=[_core.Mode(mode.frequency_hz, mode.damping_ratio, mode.participation) for mode in axis.modes],
    )


def _table_friction(drive: Drive) -> _core.FrictionParameters:
    models = _core.FrictionModel
    model = {"viscous": models.viscous, "stribeck": models.stribeck, "lugre": models.lugre}[drive.friction_model]
    return _core.FrictionParameters(
        model,
        viscous_n_s_per_m=drive.friction_viscous_n_s_per_m,
        coulomb_n=drive.friction_coulomb_n or 0.0,
        static_n=drive.friction_static_n or 0.0,
        stribeck_velocity_m_per_s=drive.friction_stribeck_velocity_mm_per_s * _MM,
        smoothing_velocity_m_per_s=drive.friction_smoothing_velocity_mm_per_s * _MM,
        bristle_stiffness_n_per_m=drive.friction_bristle_stiffness_n_per_um * _N_PER_UM,
        bristle_damping_n_s_per_m=drive.friction_bristle_damping_n_s_per_m,
    )
