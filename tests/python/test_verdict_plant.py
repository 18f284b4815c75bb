"""The verdict behind feed drives: contour with the servo's lag, residual as the swing of the table behind its motor."""

from pathlib import Path

import numpy as np
import pytest

import shapegcode as sg
from shapegcode.model.machine_model import MachineModel

PART = "%\nO1\nG21G17G90G94\nG00X0Y0Z0\nG01X60.F6000\nG03X80.Y20.I0J20.\nG01Y40.\nM30\n%\n"


@pytest.fixture(scope="module")
def machine() -> sg.Machine:
    return sg.Machine.load("vx500").with_values(
        {
            "verdict.plant": "feed-drive",
            "controller.feed_forward_ratio": {"x": 0.9, "y": 0.9, "z": 0.9},
            "tolerance.contour_um": 2000.0,
        }
    )


def test_residual_is_the_swing_behind_the_motor(machine: sg.Machine) -> None:
    """Against the columns of the motion in time, worked out here."""
    program = sg.Program.from_text(PART, machine)
    (region,) = program.regions
    simulated = MachineModel(machine).simulate_original(region.path)
    chunks = list(sg.stream(program, machine, plant="feed-drive"))
    command, response, motor = (
        np.concatenate([getattr(chunk, name) for chunk in chunks]) for name in ("command_mm", "response_mm", "motor_mm")
    )
    rests = np.flatnonzero(np.any(np.diff(command, axis=0) != 0.0, axis=1))[-1] + 2
    width_mm = min(machine.controller.in_position_width_um.as_tuple()) * 1e-3
    for axis in range(2):
        far = np.flatnonzero(np.abs(motor[rests:, axis] - command[rests:, axis]) > width_mm)
        swing = (response - motor)[rests + (far[-1] + 1 if far.size else 0) :, axis]
        expected_um = 1e3 * np.max(np.abs(swing - swing[-200:].mean()))
        assert 1e3 * simulated.residual_mm[axis] == pytest.approx(expected_um, rel=0.25, abs=0.3)


def test_the_verdict_holds_the_lag(machine: sg.Machine, tmp_path: Path) -> None:
    path = tmp_path / "part.nc"
    path.write_text(PART)
    modal = sg.convert(path, machine.with_values({"verdict.plant": "modal"}), shape_all=True)
    drive = sg.convert(path, machine, shape_all=True)
    assert drive.limits.plant == "feed-drive" and modal.limits.plant == "modal"
    # An arc (v = 100 mm/s, R = 20 mm) behind a loop (K = 30 /s, a = 90 % fed forward): v²(1 - a²)/(2 K² R) inside.
    lag_um = 1e3 * 100.0**2 * (1.0 - 0.9**2) / (2.0 * 30.0**2 * 20.0)
    original = drive.contour_error_um.response.original.max
    assert original == pytest.approx(modal.contour_error_um.response.original.max + lag_um, rel=0.6)
    # What oscillates after the stop is cancelled behind the drive as well, though it was designed without it.
    assert drive.residual_vibration_um.emitted.x <= max(0.6 * drive.residual_vibration_um.original.x, 1.0)
    shaped = tmp_path / "shaped.nc"
    shaped.write_bytes(drive.text)
    beside = sg.simulate(shaped, machine, plant="feed-drive", record_samples=0, against=path)
    assert beside.of_shaped.contour_error_um.response == drive.contour_error_um.response.emitted


def test_drives_must_be_known() -> None:
    machine = sg.Machine.load("kimm004").with_values(
        {"verdict.plant": "feed-drive", "axes.x.modes": [{"frequency_hz": 40.0, "damping_ratio": 0.02}]}
    )
    with pytest.raises(sg.MachineError, match=r"axes\.x\.drive"):
        sg.convert(PART, machine)
