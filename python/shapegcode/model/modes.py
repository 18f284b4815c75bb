"""Modes that vary with part mass or axis position, for plant, shapers and messages.

Positions in tables are machine positions: program position plus work offset and tool length.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.errors import MachineError, Problem
from shapegcode.io.units import FloatArray
from shapegcode.machine import AxisMode, Machine
from shapegcode.machine.axes import Drive

#: Machine position minus program position of X, Y, Z in mm; None if unknown.
Offset = tuple[float | None, float | None, float | None]
NO_OFFSET: Offset = (0.0, 0.0, 0.0)
UNKNOWN_OFFSET: Offset = (None, None, None)  # modes are nominal: they do not vary
_AXES = "xyz"


def still_mode(mode: AxisMode, part_mass_kg: float | None) -> _core.Mode:
    """Mode independent of axis position: nominal, or at the stated part mass."""
    nominal = _core.Mode(mode.frequency_hz, mode.damping_ratio, mode.participation)
    over = mode.frequency_over
    if over is None or over.mass_kg is None or part_mass_kg is None:
        return nominal
    # The core interpolates over any variable.
    return _core.ModeTable(0, over.mass_kg, over.frequency_hz, over.damping_ratio or ()).mode_at(nominal, part_mass_kg)


Pairs = list[tuple[_core.Mode, _core.ModeTable]]


def moving_modes(
    machine: Machine, shift: float = 0.0, offset: Offset = NO_OFFSET, only: str | None = None
) -> list[Pairs]:
    """Modes that move X, Y, Z, each with its variation over the commanded position.

    Each frequency is shifted by `shift` times its uncertainty, and damping is lowered by |`shift`| times the
    uncertainty of damping; `only`: the one mode to shift, such as "x.1". A table over the part's mass is evaluated;
    with a table over a position the nominal mode is listed, with the table. A mode that moves several axes is listed
    for each of them.
    """
    found: list[Pairs] = [[], [], []]
    for name, axis, mode in numbered_modes(machine):
        off = shift if only in (None, name.removeprefix("axes.").replace(".modes", "")) else 0.0
        still = _shifted(mode, off, machine)
        by = mode.excitation(axis)
        for moved, share in enumerate(mode.motion(axis)):
            own = by[moved] if sum(map(bool, by)) == 1 else 0.0
            if share:
                shape = (share * own, (0.0, 0.0, 0.0)) if own else (share, by)
                as_moved = _core.Mode(still.frequency_hz, still.damping_ratio, still.participation * shape[0], shape[1])
                found[moved].append((as_moved, position_table(mode, off, offset)))
    return found


def axis_modes(machine: Machine, shift: float = 0.0, only: str | None = None) -> list[list[_core.Mode]]:
    """The modes of `moving_modes`, without their variation over the commanded position."""
    return [[mode for mode, _ in pairs] for pairs in moving_modes(machine, shift, only=only)]


def own_modes(machine: Machine, shift: float = 0.0, only: str | None = None) -> list[list[_core.Mode]]:
    """The modes that are excited only by the axis along which they move."""
    return [[mode for mode in modes if not any(mode.excited_by)] for modes in axis_modes(machine, shift, only)]


def excited_modes(machine: Machine) -> list[list[_core.Mode]]:
    """Modes that X, Y, Z excite, for their shapers, weighted by the tool motion that the axis excites."""
    found: list[list[_core.Mode]] = [[], [], []]
    for exciting, share, axis, mode in _excitations(machine):
        still = _shifted(mode, 0.0, machine)
        weight = still.participation * abs(share) * math.hypot(*mode.motion(axis))
        found[exciting].append(_core.Mode(still.frequency_hz, still.damping_ratio, weight))
    return found


def slowest_excited_hz(machine: Machine) -> list[float]:
    """Lowest frequency that each of X, Y, Z excites, by the tables of the modes; infinite if it excites none."""
    found = [math.inf] * 3
    for exciting, _, _, mode in _excitations(machine):
        found[exciting] = min(found[exciting], slowest_mode(mode)[0])
    return found


def _excitations(machine: Machine) -> Iterator[tuple[int, float, int, AxisMode]]:
    """Yield an axis, the ratio with which it excites a mode, the axis under which the mode is listed, and the mode."""
    for _, axis, mode in numbered_modes(machine):
        for exciting, share in enumerate(mode.excitation(axis)):
            if share:
                yield exciting, share, axis, mode


def _shifted(mode: AxisMode, off: float, machine: Machine) -> _core.Mode:
    """A mode shifted by a fraction of its stated uncertainty."""
    still = still_mode(mode, machine.shaping.part_mass_kg)
    return _core.Mode(
        still.frequency_hz * (1.0 + off * (mode.frequency_uncertainty_percent or 0.0) / 100.0),
        still.damping_ratio * damping_scale(mode, off),
        still.participation,
    )


def slowest_mode(mode: AxisMode) -> tuple[float, float]:
    """Lowest frequency (Hz) by a mode's tables, and lowest damping ratio by tables and stated uncertainty."""
    over = mode.frequency_over
    least = damping_scale(mode, 1.0)
    if over is None:
        return mode.frequency_hz, mode.damping_ratio * least
    return min(over.frequency_hz), min(over.damping_ratio or (mode.damping_ratio,)) * least


def damping_scale(mode: AxisMode, shift: float) -> float:
    """Factor on a mode's damping ratio if its frequency is shifted by `shift` times its uncertainty.

    Either sign of `shift` lowers the damping. To first order a shaper's residual is the same at higher and lower
    damping, as it depends on the pole's distance |dw/w + i dzeta|; to second order it is larger at lower damping.
    """
    return 1.0 - abs(shift) * (mode.damping_uncertainty_percent or 0.0) / 100.0


def moving_axis(machine: Machine) -> int | None:
    """The axis over whose position modes vary: 0, 1, 2 for X, Y, Z; None: no such axis."""
    named = {mode.frequency_over.axis for _, _, mode in numbered_modes(machine) if mode.frequency_over is not None}
    axes = sorted(axis for axis in named if axis is not None)
    if len(axes) > 1:
        raise _core.ArgumentError(
            f"modes vary over the positions of {' and '.join(name.upper() for name in axes)} (frequency_over): "
            "shapers can follow only one axis"
        )
    return _AXES.index(axes[0]) if axes else None


def region_offset(region: _core.Region, machine: Machine) -> Offset:
    """Offset from program to machine positions in a region.

    The work offset is that of `input.work_offsets`, zero if omitted there; the tool length and wear of the active H
    are added for Z (G44: subtracted). None for an axis whose position the program does not state.
    """
    state = region.entry
    system = f"G54.1P{state.coordinate_number}" if state.coordinate_system == 541 else f"G{state.coordinate_system}"
    offsets = list(machine.input.work_offsets.get(system, (0.0, 0.0, 0.0)))
    sign = {43: 1.0, 44: -1.0}.get(state.length_offset, 0.0)
    number = str(state.length_number)
    length = machine.input.tool_length_mm.get(number, 0.0) + machine.input.tool_length_wear_mm.get(number, 0.0)
    offsets[2] += sign * length
    x, y, z = (value if known else None for value, known in zip(offsets, state.known, strict=True))
    return (x, y, z)


def machine_warnings(machine: Machine) -> list[str]:
    """Warnings that need no program: the part's mass is missing, has no effect, or lies outside a table."""
    mass = machine.shaping.part_mass_kg
    tables = [(name, mode, mode.frequency_over) for name, _, mode in numbered_modes(machine)]
    over_mass = [(name, mode, over.mass_kg) for name, mode, over in tables if over is not None and over.mass_kg]
    if mass is None:
        return [
            f"{name} has a table over mass_kg, but shaping.part_mass_kg is not given: its nominal "
            f"{mode.frequency_hz:g} Hz is used"
            for name, mode, _ in over_mass
        ]
    if not over_mass:
        return [f"shaping.part_mass_kg = {mass:g}: no mode has a table over mass_kg, so it has no effect"]
    return [
        f"shaping.part_mass_kg = {mass:g} lies outside the table of {name}, {masses[0]:g} to {masses[-1]:g} kg: its "
        f"nearest row is used, {still_mode(mode, mass).frequency_hz:g} Hz"
        for name, mode, masses in over_mass
        if not masses[0] <= mass <= masses[-1]
    ]


def region_range_warnings(regions: Sequence[_core.Region], machine: Machine) -> list[str]:
    """Warnings for each mode: the program leaves its table, or does not state the position of its axis."""
    warnings = []
    for name, _, mode in numbered_modes(machine):
        over = mode.frequency_over
        if over is None or over.axis is None:
            continue
        axis = _AXES.index(over.axis)
        reached: list[float] = []
        offsets = [(region, region_offset(region, machine)[axis]) for region in regions]
        for region, offset in offsets:
            if offset is not None:
                positions = np.asarray(region.path.polyline())[:, axis] + offset
                reached += [float(positions.min()), float(positions.max())]
        if unknown := [region for region, offset in offsets if offset is None]:
            warnings.append(
                f"line {unknown[0].first_line}: the position of {over.axis.upper()} is unknown, and {name} "
                f"varies with it: its nominal {mode.frequency_hz:g} Hz is used"
            )
        low, high = over.abscissa[0], over.abscissa[-1]
        if reached and (min(reached) < low or max(reached) > high):
            warnings.append(
                f"{over.axis.upper()} moves between {min(reached):g} and {max(reached):g} mm (machine coordinates), "
                f"the table of {name} covers {low:g} to {high:g} mm: beyond it the nearest row is used"
            )
    return warnings


def position_table(mode: AxisMode, shift: float = 0.0, offset: Offset = NO_OFFSET) -> _core.ModeTable:
    """Variation of a mode with the commanded position; no rows if it is constant, or the position is unknown."""
    over = mode.frequency_over
    if over is None or over.axis is None:
        return _core.ModeTable()
    axis = _AXES.index(over.axis)
    start = offset[axis]
    if start is None:
        return _core.ModeTable()
    scale = 1.0 + shift * (mode.frequency_uncertainty_percent or 0.0) / 100.0
    return _core.ModeTable(
        axis,
        [position - start for position in over.abscissa],
        [frequency * scale for frequency in over.frequency_hz],
        [ratio * damping_scale(mode, shift) for ratio in over.damping_ratio or ()],
    )


def numbered_modes(machine: Machine) -> Iterator[tuple[str, int, AxisMode]]:
    """Key, axis and mode of every mode."""
    for axis, (letter, table) in enumerate(zip(_AXES, machine.axes.as_tuple(), strict=True)):
        for number, mode in enumerate(table.modes, start=1):
            yield f"axes.{letter}.modes.{number}", axis, mode


_UM = 1e-6  # m
_N_PER_UM = 1e6  # N/m
_MM = 1e-3  # m
_GROWING_PER_S = 1e-3  # real part of a pole above which a loop grows
_LINEAR = {
    "acceleration_feed_forward_ratio": 0.0, "backlash_um": 0.0, "torque_limit_n_m": None,
    "friction_model": "viscous", "friction_coulomb_n": None, "friction_static_n": None,
}  # fmt: skip


def drive_parameters(
    machine: Machine | str | Path, shift: float = 0.0, only: str | None = None
) -> list[_core.FeedDriveParameters]:
    """Feed drives of X, Y and Z, referred to table travel.

    Position gain and velocity feed-forward are those of the controller. A mode that
    only its own axis excites is attached to the table of that axis; if its frequency varies with a position, with the
    nominal frequency.

    Args:
        machine: with a table ``[axes.x.drive]``, and likewise for y and z.
        shift: shift of each mode's frequency, as a ratio to its stated uncertainty.
        only: the one mode to shift, such as "x.1"; None: all.

    Returns:
        Parameters of X, Y and Z, in SI units.

    Raises:
        MachineError: an axis without such a table or with an unstable loop.
    """
    machine = Machine.of(machine)
    control, axes = machine.controller, machine.axes.as_tuple()
    drives = {f"axes.{name}.drive": axis.drive for name, axis in zip(_AXES, axes, strict=True)}
    absent = "required for a simulation with feed drives, but missing"
    if missing := tuple(Problem(key, "", absent) for key, drive in drives.items() if drive is None):
        raise MachineError(machine.name, missing)
    loops = zip(control.position_gain_per_s.as_tuple(), control.feed_forward_ratio.as_tuple(), strict=True)
    parameters, unstable = [], []
    for (key, drive), modes, (gain, ratio) in zip(drives.items(), own_modes(machine, shift, only), loops, strict=True):
        assert drive is not None
        parameters.append(_of_axis(modes, drive, gain, ratio))
        # Stability of the loop without dry friction, backlash and force limit.
        linear = _of_axis([], drive.model_copy(update=_LINEAR), gain, 0.0)
        poles = np.linalg.eigvals(np.array(_core.linear_model(linear)[0]))
        worst = poles[np.argmax(poles.real)]
        if worst.real > _GROWING_PER_S:
            said = (
                f"the loop is unstable: it grows by a factor e in {1.0 / worst.real:.3g} s at "
                f"{abs(worst.imag) / (2.0 * math.pi):.4g} Hz; lower controller.position_gain_per_s ({gain:g}), raise "
                "velocity_bandwidth_hz or velocity_integral_time_s"
            )
            unstable.append(Problem(key, "", said))
    if unstable:
        raise MachineError(machine.name, tuple(unstable))
    return parameters


def _of_axis(modes: list[_core.Mode], drive: Drive, gain_per_s: float, ratio: float) -> _core.FeedDriveParameters:
    rad_per_m = 2.0 * math.pi / (drive.screw_lead_mm * _MM)
    motor_mass = drive.motor_inertia_kg_m2 * rad_per_m**2
    reduced_mass = motor_mass * drive.table_mass_kg / (motor_mass + drive.table_mass_kg)
    stiffness = drive.stiffness_n_per_um * _N_PER_UM
    table_friction = _core.FrictionParameters(
        getattr(_core.FrictionModel, drive.friction_model),
        viscous_n_s_per_m=drive.friction_viscous_n_s_per_m,
        coulomb_n=drive.friction_coulomb_n or 0.0,
        static_n=drive.friction_static_n or 0.0,
        stribeck_velocity_m_per_s=drive.friction_stribeck_velocity_mm_per_s * _MM,
        smoothing_velocity_m_per_s=drive.friction_smoothing_velocity_mm_per_s * _MM,
        bristle_stiffness_n_per_m=drive.friction_bristle_stiffness_n_per_um * _N_PER_UM,
        bristle_damping_n_s_per_m=drive.friction_bristle_damping_n_s_per_m,
    )
    motor_viscous = drive.motor_friction_viscous_n_m_s_per_rad * rad_per_m**2
    return _core.FeedDriveParameters(
        motor_mass_kg=motor_mass, table_mass_kg=drive.table_mass_kg, stiffness_n_per_m=stiffness,
        damping_n_s_per_m=2.0 * drive.damping_ratio * math.sqrt(stiffness * reduced_mass),
        position_gain_per_s=gain_per_s,
        velocity_gain_n_s_per_m=2.0 * math.pi * drive.velocity_bandwidth_hz * (motor_mass + drive.table_mass_kg),
        velocity_integral_time_s=drive.velocity_integral_time_s, velocity_feed_forward_ratio=ratio,
        acceleration_feed_forward_ratio=drive.acceleration_feed_forward_ratio,
        position_feedback=getattr(_core.PositionFeedback, drive.position_feedback),
        backlash_m=drive.backlash_um * _UM,
        force_limit_n=0.0 if drive.torque_limit_n_m is None else drive.torque_limit_n_m * rad_per_m,
        table_friction=table_friction, motor_friction=_core.FrictionParameters(viscous_n_s_per_m=motor_viscous),
        modes=modes,
    )  # fmt: skip


_WANTED = (
    "must be a machine or a list of modes for each axis of the command, such as [machine.axes.x.modes, "
    "machine.axes.y.modes] or [[Mode(46.0, 0.02)], []]"
)


def plant_response(
    command_mm: npt.ArrayLike, modes: Machine | Sequence[Sequence[AxisMode | _core.Mode]], period_s: float
) -> FloatArray:
    """Response of base-excited modes to a record of set-points, exact for set-points joined by straight lines.

    The plant is at rest at the first row. The result is bit-identical to that of the core's real-time plant.

    Args:
        command_mm: set-points in mm, shape (n_samples, n_axes), one per period.
        modes: for each axis core or machine-file modes; none: the axis follows its command. A machine gives those
            of X, Y, Z, or of the first axes if the command has fewer. Modes with tables over a position are nominal.
        period_s: time between samples in s, above 0.

    Returns:
        Positions of the table in mm at the same instants, (n_samples, n_axes), in the memory order of the command.

    Raises:
        ArgumentError: not one list of modes per axis, a non-finite command, an invalid mode or period.
    """
    if isinstance(modes, Machine):
        command_mm = np.asarray(command_mm, dtype=np.float64)
        axes = axis_modes(modes)
        return _core.plant_response(command_mm, axes[: command_mm.shape[1]] if command_mm.ndim == 2 else axes, period_s)
    if not isinstance(modes, Sequence) or isinstance(modes, str):
        raise _core.ArgumentError(f"modes are {type(modes).__name__}: {_WANTED}")
    return _core.plant_response(command_mm, [_core_modes(axis) for axis in modes], period_s)


def _core_modes(modes: Sequence[AxisMode | _core.Mode]) -> list[_core.Mode]:
    if not isinstance(modes, Sequence) or not all(isinstance(mode, AxisMode | _core.Mode) for mode in modes):
        raise _core.ArgumentError(f"the modes of an axis are {str(modes)[:80]!r}: {_WANTED}")
    return [still_mode(mode, None) if isinstance(mode, AxisMode) else mode for mode in modes]
