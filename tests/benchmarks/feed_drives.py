"""Feed drives beside SciPy: `python tests/benchmarks/feed_drives.py`.

Two axes with friction (LuGre) and a mode on each table, on a circle of 20 mm at 100 mm/s, one set-point per ms. A tight
Radau solution of a second implementation says how far each is off.
"""

from __future__ import annotations

import argparse
import copy
import time

import numpy as np
import numpy.typing as npt
import places  # noqa: F401
from table import Row, Sample, comparison_table, markdown, timed

import feed_drive_reference as reference
from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.model.modes import drive_parameters

Vector = npt.NDArray[np.float64]

_PERIOD_S = 1e-3
_KILO = 1e-3
_GOAL = 40.0  # times SciPy's BDF


def _circle(samples: int) -> tuple[Vector, Vector]:
    t = np.arange(1, samples + 1) * _PERIOD_S
    way = np.cumsum(100.0 * np.minimum(t / 0.05, 1.0)) * _PERIOD_S
    return 20.0 * np.sin(way / 20.0), 20.0 - 20.0 * np.cos(way / 20.0)


def _drive(forward: float = 0.0) -> _core.FeedDriveParameters:
    friction = _core.FrictionParameters(
        _core.FrictionModel.lugre, viscous_n_s_per_m=1500, coulomb_n=300, static_n=450, stribeck_velocity_m_per_s=0.005,
        bristle_stiffness_n_per_m=3e7, bristle_damping_n_s_per_m=3e4,
    )  # fmt: skip
    return _core.FeedDriveParameters(
        motor_mass_kg=150, table_mass_kg=400, stiffness_n_per_m=1.2e8, damping_n_s_per_m=1e4, position_gain_per_s=30,
        velocity_gain_n_s_per_m=1.65e5, velocity_integral_time_s=0.02, table_friction=friction,
        motor_friction=_core.FrictionParameters(viscous_n_s_per_m=500), modes=[_core.Mode(46, 0.02)],
        velocity_feed_forward_ratio=forward, acceleration_feed_forward_ratio=forward,
    )  # fmt: skip


def feed_drive_tables(samples: int, repetitions: int) -> tuple[list[Row], list[list[str]]]:
    """Rates beside SciPy's as rows; beside them a table of rates and errors."""
    parameters = _drive()
    axes = _circle(samples)
    rtol, atol_mm = 1e-6, 1e-6
    atol_m = atol_mm * 1e-3
    drives = [reference.Drive(parameters, _PERIOD_S) for _ in axes]
    exact = [reference.play(drive, axis)[:, 0] for drive, axis in zip(drives, axes, strict=True)]

    def ours() -> list[Vector]:
        return [_core.FeedDrive(parameters, _PERIOD_S, rtol, atol_mm).respond(axis)[:, 0] for axis in axes]

    def real_time() -> list[Vector]:
        return [_core.FeedDriveRealTime(parameters, _PERIOD_S).respond(axis) for axis in axes]

    def by_period() -> list[Vector]:
        return [
            reference.play(drive, axis, method="BDF", rtol=rtol, atol_m=atol_m, jac=drive.jacobian)[:, 0]
            for drive, axis in zip(drives, axes, strict=True)
        ]

    def at_once() -> list[Vector]:
        return reference.play_at_once(drives, axes, rtol=rtol, atol_m=atol_m)

    tasks = {
        "FeedDrive (CVODE BDF), from set-point to set-point": ours,
        "FeedDriveRealTime, 4 substeps": real_time,
        "solve_ivp BDF with Jacobian, from set-point to set-point": by_period,
        "solve_ivp BDF with Jacobian, whole command at once, both axes as one system": at_once,
    }
    rates: dict[str, list[float]] = {name: [] for name in tasks}
    errors: dict[str, float] = {}
    for _ in range(repetitions):
        for name, task in tasks.items():
            # One thread each; other processes then count less.
            seconds, found = timed(task, time.process_time)
            rates[name].append(samples / seconds * _KILO)
            errors[name] = max(float(np.abs(a - b).max()) for a, b in zip(found, exact, strict=True))
    cvode, fixed, stepwise, whole = (Sample.of(rates[name]) for name in tasks)
    unit = "thousand samples/s, two axes"
    rows = [
        Row("drive_bdf", "FeedDrive", unit, cvode, "solve_ivp BDF, set-point to set-point", stepwise, at_least=_GOAL),
        Row("drive_bdf_whole", "FeedDrive", unit, cvode, "solve_ivp BDF, whole command at once", whole),
        Row("drive_real_time", "FeedDriveRealTime", unit, fixed, "solve_ivp BDF, whole command at once", whole),
    ]
    table = [[name, str(Sample.of(rates[name])), f"{errors[name] * 1e3:.3f}"] for name in tasks]
    return rows, table


def _evaluations(parameters: _core.FeedDriveParameters, axis: Vector, restart: bool) -> tuple[float, Vector]:
    """Evaluations of the equations for each set-point, and the responses; a copy has no history and starts again."""
    drive = _core.FeedDrive(parameters, _PERIOD_S)
    evaluations, responses = 0, []
    for setpoint in axis:
        if restart:
            evaluations += drive.rhs_evaluations
            drive = copy.copy(drive)
        responses.append(drive.step(setpoint))
    return (evaluations + drive.rhs_evaluations) / len(axis), np.array(responses)


def method_table(samples: int) -> list[list[str]]:
    """What running on over the set-points is worth, and the substeps of the real-time form, on drives of one axis."""
    axis = _circle(samples)[0]
    rows = []
    drives = {
        "no feed-forward": _drive(),
        "speed and acceleration fed forward": _drive(1.0),
        "vx500, X": drive_parameters(Machine.load("vx500"))[0],
    }
    for name, parameters in drives.items():
        exact = _core.FeedDrive(parameters, _PERIOD_S, 1e-10, 1e-11).respond(axis)[:, 0]
        for restart in (False, True):
            evaluations, found = _evaluations(parameters, axis, restart)
            what = "restarted at every set-point" if restart else "running on"
            error_um = float(np.abs(found - exact).max()) * 1e3
            rows.append([name, f"FeedDrive, {what}", f"{evaluations:.1f}", f"{error_um:.3f}"])
        for substeps in (1, 2, 4, 8):
            found = _core.FeedDriveRealTime(parameters, _PERIOD_S, substeps).respond(axis)
            error_um = float(np.abs(found - exact).max()) * 1e3
            rows.append([name, f"FeedDriveRealTime, substeps: {substeps}", f"{3 * substeps}", f"{error_um:.3f}"])
    return rows


def main() -> int:
    """Print the tables; 0 if every goal is met."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--samples", type=int, default=2000, help="set-points (default: %(default)s)")
    parser.add_argument("--repetitions", type=int, default=3, help="default: %(default)s")
    arguments = parser.parse_args()
    rows, table = feed_drive_tables(arguments.samples, arguments.repetitions)
    print(comparison_table(rows), end="\n\n")
    print(markdown(["two axes with friction, rtol 1e-6", "thousand samples/s", "largest error, µm"], table), end="\n\n")
    head = ["drive", "method", "evaluations per set-point", "largest error, µm"]
    print(markdown(head, method_table(arguments.samples)))
    return 0 if all(row.met is not False for row in rows) else 1


if __name__ == "__main__":
    raise SystemExit(main())
