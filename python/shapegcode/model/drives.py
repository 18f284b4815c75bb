"""From the machine file to the core's feed drives."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from shapegcode import _core
from shapegcode.errors import MachineError, Problem
from shapegcode.machine import Machine
from shapegcode.machine.axes import Drive
from shapegcode.model.modes import axis_modes

_UM = 1e-6  # m
_N_PER_UM = 1e6  # N/m
_MM = 1e-3  # m
_GROWING_PER_S = 1e-3  # real part of a pole above which a loop grows


def drive_parameters(
    machine: Machine | str | Path, shift: float = 0.0, only: str | None = None
) -> list[_core.FeedDriveParameters]:
    """The feed drives of X, Y and Z, referred to the travel of the tables.

    Position gain and feed-forward are those of the controller; the modes of the axes ride on the tables, those that
    vary with a position at their nominal frequency.

    Args:
        machine: with a table ``[axes.x.drive]``, and so for y and z.
        shift: share of each mode's stated uncertainty by which it is off, see `axis_modes`.
        only: the one mode that is off; None: all of them.

    Returns:
        Parameters of X, Y and Z, in SI units.

    Raises:
        MachineError: an axis has no such table, or its loop is unstable.
    """
    machine = Machine.of(machine)
    missing = [
        Problem(f"axes.{name}.drive", "", "required for a simulation with feed drives, but missing")
        for name, axis in zip("xyz", machine.axes.as_tuple(), strict=True)
        if axis.drive is None
    ]
    if missing:
        raise MachineError(machine.name, tuple(missing))
    gains = machine.controller.position_gain_per_s.as_tuple()
    ratios = machine.controller.feed_forward_ratio.as_tuple()
    parameters = [
        _of_axis(modes, axis.drive, gain, ratio)
        for axis, modes, gain, ratio in zip(
            machine.axes.as_tuple(), axis_modes(machine, shift, only), gains, ratios, strict=True
        )
        if axis.drive is not None
    ]
    unstable = [
        problem
        for name, drive, gain in zip("xyz", parameters, gains, strict=True)
        for problem in _instability(name, drive, gain)
    ]
    if unstable:
        raise MachineError(machine.name, tuple(unstable))
    return parameters


def _instability(name: str, drive: _core.FeedDriveParameters, gain_per_s: float) -> list[Problem]:
    """What says that the loop of an axis grows by itself, dry friction, backlash and force limit left out."""
    linear = _core.FeedDriveParameters(
        motor_mass_kg=drive.motor_mass_kg,
        table_mass_kg=drive.table_mass_kg,
        stiffness_n_per_m=drive.stiffness_n_per_m,
        damping_n_s_per_m=drive.damping_n_s_per_m,
        position_gain_per_s=drive.position_gain_per_s,
        velocity_gain_n_s_per_m=drive.velocity_gain_n_s_per_m,
        velocity_integral_time_s=drive.velocity_integral_time_s,
        position_feedback=drive.position_feedback,
        table_friction=_core.FrictionParameters(viscous_n_s_per_m=drive.table_friction.viscous_n_s_per_m),
        motor_friction=drive.motor_friction,
    )
    poles = np.linalg.eigvals(np.array(_core.linear_model(linear)[0]))
    worst = poles[np.argmax(poles.real)]
    if worst.real <= _GROWING_PER_S:
        return []
    return [
        Problem(
            f"axes.{name}.drive",
            "",
            f"the loop is unstable: it grows by a factor e in {1.0 / worst.real:.3g} s at "
            f"{abs(worst.imag) / (2.0 * math.pi):.4g} Hz; lower controller.position_gain_per_s ({gain_per_s:g}), raise "
            "velocity_bandwidth_hz or velocity_integral_time_s",
        )
    ]


def _of_axis(modes: list[_core.Mode], drive: Drive, gain_per_s: float, ratio: float) -> _core.FeedDriveParameters:
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
        modes=modes,
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
