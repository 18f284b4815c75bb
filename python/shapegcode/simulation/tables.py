"""The tables of ``shapegcode simulate``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from shapegcode.conversion.report import CONTOURS

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["motion_table", "simulation_table"]

# With a feed drive what is left between command and table is vibration and the lag of the servo loop.
_NAMES = {"modal": ("residual vibration", "peak vibration"), "feed-drive": ("error after the stop", "largest error")}


def simulation_table(report: Mapping[str, Any]) -> Table:
    """Table of a simulation's figures (see :class:`shapegcode.simulation.simulate.Simulation`)."""
    from rich.table import Table

    table = Table(title=f"{report['program']} on {report['machine']}, {report['plant']} plant")
    table.add_column("cutting regions, each from rest to rest")
    table.add_column("value", justify="right")
    table.add_column("unit")
    table.add_row("cycle time", f"{report['cycle_time_s']:.2f}", "s")
    table.add_row("of it cutting regions", f"{report['cutting_time_s']:.2f}", "s", end_section=True)
    keys = ("residual_vibration_um", "peak_vibration_um")
    for name, key in zip(_NAMES[report["plant"]], keys, strict=True):
        for axis, value in report[key].items():
            table.add_row(f"{name} {axis.upper()}", f"{value:.2f}", "µm", end_section=axis == "z")
    band, limit = report["settling_band_um"], report["settling_limit_s"]
    for axis, value in report["settling_time_s"].items() if band > 0.0 else ():
        time = f"over {limit * 1e3:.0f}" if value is None else f"{value * 1e3:.0f}"
        table.add_row(f"settling {axis.upper()} to ±{band:g} µm", time, "ms", end_section=axis == "z")
    for key, name in CONTOURS.items():
        deviation = report["contour_error_um"][key]
        table.add_row(f"{name}, largest", f"{deviation['max']:.2f}", "µm")
        table.add_row(f"{name}, RMS", f"{deviation['rms']:.2f}", "µm", end_section=key == "response")
    orbits = {"command": "orbit_error_percent", "table (response)": "response_orbit_error_percent"}
    for whose, key in orbits.items():
        if report[key]:
            table.add_row(f"orbit error of the {whose}, largest", f"{max(report[key]):.4f}", "%")
    return table


_MOTION_ROWS = (
    ("largest_speed_mm_per_min", "speed of the command", "m/min", 1e-3, 2),
    ("largest_acceleration_mm_per_s2", "acceleration of the command", "m/s²", 1e-3, 2),
    ("largest_error_um", "response − command", "µm", 1.0, 2),
    ("largest_motor_force_n", "force of the motor", "N", 1.0, 0),
    ("largest_friction_force_n", "friction", "N", 1.0, 0),
)


def motion_table(motion: Mapping[str, Any]) -> Table:
    """Table of the largest values of a whole motion (see :class:`shapegcode.simulation.motion.MotionFigures`)."""
    from rich.table import Table

    lines = motion.get("lines")
    part = "whole program" if lines is None else f"lines {lines[0]} to {lines[1]}"
    table = Table(title=f"{part}, {motion['samples']} samples up to {motion['end_s']:.2f} s")
    table.add_column("largest")
    for axis in "XYZ":
        table.add_column(axis, justify="right")
    table.add_column("unit")
    for key, name, unit, factor, decimals in _MOTION_ROWS:
        if key in motion:
            values = (f"{factor * motion[key][axis]:.{decimals}f}" for axis in "xyz")
            table.add_row(name, *values, unit)
    return table
