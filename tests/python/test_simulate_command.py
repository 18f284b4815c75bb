"""``shapegcode simulate``: the motion of a whole program in time, its files and figures, with either plant."""

import dataclasses
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import scipy.signal

import feed_drive_reference as reference
import shapegcode as sg
from acceptance import PROGRAMS
from shapegcode.cli import main
from shapegcode.io.units import FloatArray
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.stream import KINDS, REST_S, Chunk
from shapegcode.results import plot
from shapegcode.results.json import schema
from shapegcode.simulation.motion import MotionEnvelope

TICK_S = 0.001
WHOLE = (
    "%\nO1\nG21 G17 G90 G94\nG00 X0. Y0. Z5.\nM06 T1\nG00 X0. Y0. Z5.\nG01 Z-1. F600.\nX30. F6000.\n"
    "G03 X40. Y10. R10.\nG01 Y30.\nG04 P250\nG00 Z20.\nX100. Y50.\nG01 X90. F3000.\nY45.\nM30\n%\n"
)
SHORT = "%\nO1\nG21 G17 G90 G94\nG00 X0. Y0. Z0.\nG01 X2. Y.5 F1500.\nG00 X0.\nM30\n%\n"
CORNER = "%\nO1\nG21 G17 G90 G94\nG00 X0. Y0. Z0.\nG01 X30. F6000.\nY20.\nG04 X2.\nM30\n%\n"
DRIVE = {
    "motor_inertia_kg_m2": 0.004,
    "screw_lead_mm": 10.0,
    "table_mass_kg": 250.0,
    "stiffness_n_per_um": 120.0,
    "velocity_bandwidth_hz": 40.0,
    "friction_model": "lugre",
    "friction_viscous_n_s_per_m": 500.0,
    "friction_coulomb_n": 120.0,
    "friction_static_n": 160.0,
}


def machine_with(drive: dict[str, Any] | None = None, **tables: dict[str, Any]) -> sg.Machine:
    """The built-in vx500 with values of its tables, and the drive on every axis."""
    changed = {f"{table}.{key}": value for table, values in tables.items() for key, value in values.items()}
    return sg.Machine.load("vx500").with_values(changed | {f"axes.{axis}.drive": drive for axis in "xyz"})


def toml_file(folder: Path, machine: sg.Machine) -> str:
    """The machine as a file."""
    (folder / "machine.toml").write_text(machine.to_toml())
    return str(folder / "machine.toml")


def streamed(text: str, machine: sg.Machine, **options: Any) -> Chunk:
    """The whole motion in one piece."""
    chunks = list(sg.stream(text, machine, chunk_samples=10_000_000, **options))
    assert len(chunks) == 1
    return chunks[0]


def axis(columns: dict[str, Any], name: str) -> FloatArray:
    """A column of X, Y and Z as one array."""
    return np.column_stack([columns[f"{letter}_{name}"] for letter in "xyz"])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "part.nc").write_text(WHOLE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """The message with which the command refuses its arguments."""
    before = sorted(os.listdir())
    assert main(["simulate", "part.nc", "-m", "vx500", *words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert sorted(os.listdir()) == before
    return err


# ---- time --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("motion", ["look_ahead", "after_interpolation"])
def test_motion_takes_the_cycle_time(motion: str) -> None:
    machine = machine_with(controller={"motion": motion}, times={"tool_change_s": 2.5, "m_function_s": 0.125})
    simulated = streamed(WHOLE, machine)
    time = sg.cycle_time(WHOLE, machine, per_block=True)
    assert simulated.time_s[-1] == pytest.approx(time.cycle_time_s + REST_S, abs=1e-9)
    assert simulated.time_s[-1] == pytest.approx(time.full_interpolation_s + REST_S, abs=1e-9)
    # What `time` says of each kind of block is what happens there.
    for name in ("rapid", "dwell", "tool_change"):
        counted = np.count_nonzero(simulated.kind == KINDS.index(name)) * TICK_S
        assert counted == pytest.approx(sum(block.duration_s for block in time.blocks if block.kind == name), abs=1e-9)
    for block in time.blocks:
        if block.kind in ("rapid", "dwell"):
            inside = (simulated.time_s > block.start_s + TICK_S / 2) & (
                simulated.time_s < block.start_s + block.duration_s - TICK_S / 2
            )
            assert set(simulated.line[inside]) == {block.line}


@pytest.mark.parametrize("name", ["CONTOUR_R.NC", "G17_18_19.NC", "TEST_G90.NC"])
def test_motion_of_a_real_program_takes_its_cycle_time(name: str) -> None:
    """In the last one the position of X is not known for a while: the command jumps then, the plant does not."""
    program = sg.Program.read(PROGRAMS / name, "vx500")
    samples, fastest, largest = 0, 0.0, 0.0
    for chunk in sg.stream(program, "vx500"):
        samples += len(chunk)
        fastest = max(fastest, float(np.abs(chunk.velocity_mm_per_s).max()))
        largest = max(largest, float(np.abs(chunk.error_mm).max()))
    expected = sg.cycle_time(program, "vx500").full_interpolation_s
    assert (samples - 1) * TICK_S == pytest.approx(expected + REST_S, abs=TICK_S)
    assert fastest <= 400.0 * (1 + 1e-9)
    assert 0.01 < largest < 0.2


def test_motion_ends_where_the_program_ends_and_keeps_its_speeds() -> None:
    machine = sg.Machine.load("vx500")
    simulated = streamed(WHOLE, machine)
    assert simulated.command_mm[0] == pytest.approx([0.0, 0.0, 5.0])
    assert simulated.command_mm[-1] == pytest.approx([90.0, 45.0, 20.0])
    steps = np.diff(simulated.command_mm, axis=0) / TICK_S
    assert simulated.velocity_mm_per_s[1:] == pytest.approx(steps, abs=1e-9)
    cutting = (simulated.kind == KINDS.index("cutting"))[1:]
    assert np.linalg.norm(steps[cutting], axis=1).max() == pytest.approx(100.0, rel=1e-6)
    rapids = [axis.rapid_mm_per_min / 60.0 for axis in machine.axes.as_tuple()]
    assert (np.abs(steps).max(axis=0) <= np.array(rapids) * (1 + 1e-9)).all()


def test_shaped_program_moves_block_by_block() -> None:
    machine = sg.Machine.load("vx500")
    conversion = sg.convert(WHOLE, machine)
    emitted = sg.Program.from_text(conversion.text, machine, source="emitted")
    # Cutting blocks at their feed, and what the filter adds to each region.
    figures = [run.figures for run in sg.simulate(emitted, machine, shaped=True, record_samples=0).regions]
    simulated = streamed(conversion.text.decode(), machine, shaped=True)
    cutting = np.count_nonzero(simulated.kind == KINDS.index("cutting"))
    expected = sum(round(each.duration_s / TICK_S) for each in figures)
    # The end of a region is seen one period behind its last motion; the rest behind the program's end is cutting's too.
    assert abs(cutting - expected - round(REST_S / TICK_S)) <= len(figures) + 1


# ---- files -------------------------------------------------------------------------------------------------


def read_csv(file: Path) -> dict[str, Any]:
    table = np.genfromtxt(file, delimiter=",", names=True, dtype=None, encoding="utf-8")
    return {name: table[name] for name in table.dtype.names}


def test_csv_and_npz_hold_the_same_motion_as_the_api(folder: Path) -> None:
    assert main(["simulate", "part.nc", "-m", "vx500", "--csv", "m.csv", "--npz", "m.npz", "--json", "r.json"]) == 0
    csv, npz = read_csv(folder / "m.csv"), np.load(folder / "m.npz")
    simulated = streamed(WHOLE, sg.Machine.load("vx500"))
    assert list(csv) == ["kind", *simulated.columns()]
    assert set(npz) == {*csv, "kind_names"}
    for name, column in simulated.columns().items():
        assert npz[name].dtype == column.dtype
        np.testing.assert_array_equal(npz[name], column)
        np.testing.assert_array_equal(csv[name], npz[name])
    assert (npz["kind_names"][npz["kind"]] == csv["kind"]).all()
    assert zipfile.ZipFile(folder / "m.npz").testzip() is None
    report = json.loads((folder / "r.json").read_text())
    jsonschema.validate(report, schema(sg.Simulation))
    motion = report["motion"]
    assert (motion["csv"], motion["npz"]) == ("m.csv", "m.npz")
    assert motion["samples"] == len(csv["kind"])
    error_um = 1e3 * np.abs(axis(csv, "error_mm")).max(axis=0)
    assert [motion["largest_error_um"][name] for name in "xyz"] == pytest.approx(error_um)
    second = np.abs(np.diff(axis(csv, "command_mm"), n=2, axis=0)).max(axis=0) / TICK_S**2
    assert [motion["largest_acceleration_mm_per_s2"][name] for name in "xyz"] == pytest.approx(second, rel=1e-6)
    assert sorted(os.listdir(folder)) == ["m.csv", "m.npz", "part.nc", "r.json"]


def test_every_and_lines_choose_rows_of_the_whole_motion(folder: Path) -> None:
    def columns(*words: str) -> dict[str, Any]:
        assert main(["simulate", "part.nc", "-m", "vx500", "--npz", "m.npz", *words]) == 0
        archive = np.load(folder / "m.npz")
        return {name: archive[name] for name in archive if name != "kind_names"}

    with pytest.raises(sg.ArgumentError, match="every = 0"):
        sg.simulate_motion(folder / "part.nc", "vx500", every=0)
    whole, tenth = columns(), columns("--every", "10")
    for name, column in whole.items():
        np.testing.assert_array_equal(tenth[name], column[::10])
    some = columns("--lines", "9-11")
    inside = (whole["line"] >= 9) & (whole["line"] <= 11)
    assert 0 < inside.sum() < len(inside)
    for name, column in whole.items():
        np.testing.assert_array_equal(some[name], column[inside])
    # Vibration that the blocks before excited is there at the first row.
    assert abs(some["x_error_mm"][0]) > 1e-4
    both = columns("--lines", "9-11", "--every", "7")
    np.testing.assert_array_equal(both["time_s"], whole["time_s"][inside & (np.arange(len(inside)) % 7 == 0)])


def test_csv_on_standard_output(folder: Path, capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    assert main(["simulate", "part.nc", "-m", "vx500", "--csv", "m.csv"]) == 0
    capfdbinary.readouterr()
    assert main(["simulate", "part.nc", "-m", "vx500", "--csv", "-"]) == 0
    assert capfdbinary.readouterr().out == (folder / "m.csv").read_bytes()


def test_pieces_of_any_size_are_the_same_motion() -> None:
    machine = sg.Machine.load("vx500")
    whole = streamed(WHOLE, machine)
    pieces = list(sg.stream(WHOLE, machine, chunk_samples=777))
    assert max(map(len, pieces)) == 777
    for name in ("time_s", "line", "kind", "command_mm", "response_mm"):
        np.testing.assert_array_equal(np.concatenate([getattr(each, name) for each in pieces]), getattr(whole, name))


# ---- plants ------------------------------------------------------------------------------------------------


def test_modal_response_is_that_of_scipy_on_the_exported_commands(folder: Path) -> None:
    """Each mode: 2 ζ ω s + ω² over s² + 2 ζ ω s + ω², with set-points joined by straight lines."""
    assert main(["simulate", "part.nc", "-m", "vx500", "--npz", "m.npz"]) == 0
    columns = np.load(folder / "m.npz")
    for letter, of_axis in zip("xyz", sg.Machine.load("vx500").axes.as_tuple(), strict=True):
        command = columns[f"{letter}_command_mm"]
        response = command.copy()
        for mode in of_axis.modes:
            omega = 2 * np.pi * mode.frequency_hz
            damping = 2 * mode.damping_ratio * omega
            system = scipy.signal.StateSpace(*scipy.signal.tf2ss([damping, omega**2], [1.0, damping, omega**2]))
            moved = scipy.signal.lsim(system, command - command[0], columns["time_s"])[1] + command[0]
            response += mode.participation * (moved - command)
        np.testing.assert_allclose(columns[f"{letter}_response_mm"], response, rtol=0.0, atol=2e-9)


def test_feed_drive_response_is_that_of_solve_ivp(folder: Path) -> None:
    """A second implementation of the drive by SciPy's implicit Runge-Kutta method on the exported commands."""
    machine = machine_with(DRIVE)
    (folder / "part.nc").write_text(SHORT)
    words = ["--plant", "feed-drive", "--npz", "m.npz", "--json", "r.json"]
    assert main(["simulate", "part.nc", "-m", toml_file(folder, machine), *words]) == 0
    columns = np.load(folder / "m.npz")
    drive = MachineModel(machine).options(plant="feed-drive").drives[0]
    command = columns["x_command_mm"][:160]
    assert np.ptp(command) > 1.0
    assert command[0] == 0.0
    simulated = reference.play(reference.Drive(drive, TICK_S), command[1:], method="Radau", rtol=1e-7, atol_m=1e-11)
    np.testing.assert_allclose(columns["x_response_mm"][1:160], simulated[:, 0], rtol=0.0, atol=2e-5)
    np.testing.assert_allclose(columns["x_motor_mm"][1:160], simulated[:, 2], rtol=0.0, atol=2e-5)
    np.testing.assert_allclose(columns["x_friction_force_n"][1:160], simulated[:, 3], rtol=0.0, atol=0.1)
    report = json.loads((folder / "r.json").read_text())
    jsonschema.validate(report, schema(sg.Simulation))
    assert report["plant"] == "feed-drive"
    force = report["motion"]["largest_motor_force_n"]["x"]
    assert force == pytest.approx(np.abs(columns["x_motor_force_n"]).max())
    # The lag of a position loop: speed over gain.
    lag_um = 1e3 * 25.0 / drive.position_gain_per_s
    assert report["motion"]["largest_error_um"]["x"] > 0.5 * lag_um
    assert report["peak_vibration_um"]["x"] > 0.5 * lag_um
    assert report["settling_time_s"]["x"] > 0.0


def test_feed_drive_gives_motor_and_forces_only_there() -> None:
    machine = machine_with(DRIVE)
    assert "x_motor_force_n" not in streamed(SHORT, machine).columns()
    driven = streamed(SHORT, machine, plant="feed-drive").columns()
    assert {"x_motor_mm", "y_motor_force_n", "z_friction_force_n"} <= set(driven)
    # Nothing moves in Z, so nothing acts there.
    assert np.abs(driven["z_motor_force_n"]).max() < 1e-3


def test_machine_without_drives_is_refused_with_the_table(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine = toml_file(folder, machine_with())
    assert main(["simulate", "part.nc", "-m", machine, "--plant", "feed-drive", "--csv", "m.csv"]) == 2
    assert "axes.x.drive" in capsys.readouterr().err
    assert not (folder / "m.csv").exists()


def test_modes_that_vary_see_the_machine_s_position() -> None:
    """A work offset that puts the whole program beyond the table of the mode is the mode of the table's end."""
    over = {"axis": "x", "position_mm": [100.0, 400.0], "frequency_hz": [46.0, 30.0]}
    machine = sg.Machine.load("vx500").with_values("input.work_offsets", {"G54": [500.0, 0.0, 0.0]})
    far = streamed(WHOLE, machine.with_values("axes.x.modes.1.frequency_over", over))
    slow = streamed(WHOLE, machine.with_values("axes.x.modes.1.frequency_hz", 30.0))
    fast = streamed(WHOLE, machine.with_values("axes.x.modes.1.frequency_hz", 46.0))
    np.testing.assert_array_equal(far.command_mm, slow.command_mm)
    np.testing.assert_allclose(far.response_mm, slow.response_mm, rtol=0.0, atol=1e-9)
    assert np.abs(far.response_mm - fast.response_mm).max() > 1e-3


def test_settling_time_is_that_of_a_long_rest() -> None:
    machine = sg.Machine.load("vx500")
    text = "%\nO1\nG90 G94\nG00 X0. Y0. Z0.\nG01 X50. F9000.\nG04 X3.\nM30\n%\n"
    program = sg.Program.from_text(text, machine)
    simulation = sg.simulate(program, machine)
    stop = round(simulation.regions[0].figures.duration_s / TICK_S)
    deflection = 1e3 * np.abs(streamed(text, machine).error_mm[stop:, 0])
    outside = np.flatnonzero(deflection > simulation.settling_band_um)
    assert 0 < outside[-1] < len(deflection) / 2
    swing = 1.0 / min(mode.frequency_hz for mode in machine.axes.x.modes)
    # Between samples it may leave the band once more.
    assert (outside[-1] + 1) * TICK_S <= simulation.settling_time_s.x <= outside[-1] * TICK_S + swing
    no_band = machine.with_values("tolerance.residual_floor_um", 0.0)
    assert sg.simulate(program, no_band).settling_time_s.x is None


def test_lag_along_the_path_is_no_contour_error() -> None:
    # Without friction a drive on a straight line stays on it and arrives, however far it lags behind at the stop.
    linear = DRIVE | {"friction_model": "viscous"}
    machine = machine_with(linear, controller={"position_gain_per_s": dict.fromkeys("xyz", 5.0)})
    text = "%\nO1\nG21 G17 G90 G94\nG00 X0. Y0. Z0.\nG01 X30. F6000.\nM30\n%\n"
    program = sg.Program.from_text(text, machine)
    simulation = sg.simulate(program, machine, plant="feed-drive")
    assert simulation.residual_vibration_um.x > 5000.0
    assert simulation.contour_error_um.response.max < 0.1  # of overshoot: none
    measured = sg.measure(program, machine, 10.0, plant="feed-drive")
    assert measured.programs[0].contour_error_um.response.max < 0.1


def test_contour_error_of_a_drive_is_that_of_its_track() -> None:
    machine = machine_with(DRIVE)
    contour = sg.simulate(CORNER, machine, plant="feed-drive").contour_error_um.response
    x, y = streamed(CORNER, machine, plant="feed-drive").response_mm[:, :2].T
    # Brute force: distance of every sample from the two legs, and of the corner from the track.
    from_legs = np.minimum(np.hypot(np.maximum(x - 30.0, 0.0), y), np.hypot(x - 30.0, np.maximum(-y, 0.0)))
    from_corner = np.min(np.hypot(x - 30.0, y))
    end = np.min(np.hypot(x - 30.0, y - 20.0))
    assert contour.max == pytest.approx(1e3 * max(from_legs.max(), from_corner, end), abs=2.0)
    assert from_corner > 10 * end


def test_orbit_error_of_the_response_is_the_area_of_its_track() -> None:
    machine = machine_with()
    text = "%\nO1\nG21 G17 G90 G94\nG00 X0. Y0. Z0.\nG01 X20. F12000.\nG03 X40. Y20. R20.\nG01 Y40.\nM30\n%\n"
    simulation = sg.simulate(text, machine)
    x, y = streamed(text, machine).response_mm[:, :2].T
    angle = np.arctan2(y - 20.0, x - 20.0)
    gap = np.abs(20.0**2 - (x - 20.0) ** 2 - (y - 20.0) ** 2)
    fine = np.linspace(-np.pi / 2, 0.0, 100_001)
    on_arc = (angle > -np.pi / 2 - 0.1) & (angle < 0.1) & (x >= 19.0)
    area = np.mean(np.interp(fine, angle[on_arc], gap[on_arc])) * (np.pi / 2) / 2
    assert simulation.response_orbit_error_percent == (pytest.approx(100 * area / (np.pi * 100.0), rel=0.01),)
    assert simulation.response_orbit_error_percent[0] > 0.02
    assert simulation.orbit_error_percent[0] < 1e-9


# ---- pictures, memory --------------------------------------------------------------------------------------


def test_picture_of_the_motion(tmp_path: Path) -> None:
    machine = machine_with(DRIVE)
    program = sg.Program.from_text(SHORT, machine, source="some/short.nc")
    motion = sg.simulate_motion(program, machine, plant="feed-drive", lines=(5, 6))
    plot.save(sg.plot_motion(motion), tmp_path / "motion.svg")
    drawn = (tmp_path / "motion.svg").read_text()
    for said in ("short.nc, lines 5 to 6", "acceleration", "response", "motor", "friction"):
        assert said in drawn
    assert "some/" not in drawn


def test_the_motion_is_drawn_into_the_callers_axes() -> None:
    """A short one is drawn sample by sample: the curves are those of the whole motion."""
    machine = sg.Machine.load("vx500")
    motion = sg.simulate_motion(SHORT, machine)
    figure = plot.figure(12, 12)
    places = figure.subplots(2, 1)
    panel = sg.plot_motion(motion, places[1])
    figure.draw_without_rendering()
    assert panel.get_window_extent().y1 < places[0].get_window_extent().y0
    command, response = panel.get_lines()[:2]
    simulated = streamed(SHORT, machine)
    np.testing.assert_array_equal(command.get_ydata(), simulated.command_mm[:, 0])
    np.testing.assert_array_equal(response.get_ydata(), simulated.response_mm[:, 0])


def test_a_simulation_draws_what_was_asked_for() -> None:
    machine = sg.Machine.load("vx500")
    simulation = sg.simulate(CORNER, machine)
    assert list(simulation.plots()) == ["path", "feed", "vibration"]
    motion = sg.simulate_motion(CORNER, machine)
    assert list(dataclasses.replace(simulation, motion=motion).plots()) == ["motion", "path", "feed", "vibration"]
    assert list(dataclasses.replace(simulation, regions=()).plots()) == []


def test_envelope_is_that_of_all_samples_at_once() -> None:
    rng = np.random.default_rng(1)
    values = np.cumsum(rng.normal(size=(54_321, 2)), axis=0)
    envelope = MotionEnvelope(most=100)
    for piece in np.split(values, np.sort(rng.integers(0, len(values), 40))):
        envelope.add(piece)
    middles, low, high = envelope.result()
    size = envelope.samples_per_bucket
    assert 50 <= len(low) <= 101
    assert size & (size - 1) == 0
    for number in range(len(low)):
        bucket = values[number * size : (number + 1) * size]
        assert middles[number] == pytest.approx(number * size + (len(bucket) - 1) / 2)
        np.testing.assert_array_equal(low[number], bucket.min(axis=0))
        np.testing.assert_array_equal(high[number], bucket.max(axis=0))
    assert len(low) * size >= len(values)


def max_memory_mb(folder: Path, turns: int) -> float:
    """Largest resident size of a process that writes the motion of so many squares of 24 s each."""
    square = "G01 X20. F200.\nY20.\nX0.\nY0.\n"
    (folder / "part.nc").write_text("%\nO1\nG21 G17 G90 G94\nG00 X0. Y0. Z0.\n" + square * turns + "M30\n%\n")
    code = (
        "import resource, sys\nfrom shapegcode.cli import main\n"
        "assert main(['simulate', 'part.nc', '-m', 'vx500', '--npz', 'm.npz']) == 0\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True)
    return float(done.stdout.splitlines()[-1])


@pytest.mark.slow
def test_memory_does_not_grow_with_the_length(folder: Path) -> None:
    short = max_memory_mb(folder, 10)
    size = (folder / "m.npz").stat().st_size
    long = max_memory_mb(folder, 60)
    grown = (folder / "m.npz").stat().st_size - size
    assert grown > 80e6
    assert long < short + 15.0


# ---- bad input ---------------------------------------------------------------------------------------------


def test_api_refuses_before_anything_is_played() -> None:
    for options in ({"plant": "other"}, {"lines": (5, 4)}, {"lines": (1, 99)}, {"chunk_samples": 0}):
        with pytest.raises(sg.ArgumentError):
            sg.stream(WHOLE, "vx500", **options)


POCKET = (
    "G21 G90 G17 G40\nG00 X0 Y0 Z5.\nG01 Z-3. F300\nG41 D2 X30. F2500\nY20.\nX-30.\nY-20.\nX30.\nY5.\nG40 X0 Y0\nM30\n"
)


def test_an_original_of_unknown_radius_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "pocket.nc").write_text(f"%\nO0002\n{POCKET}%\n")
    known = ["--set", "input.tool_radius_mm.2=5"]
    words = ["convert", "pocket.nc", "-m", "vx500", *known, "--compensation", "expand", "--shape-all", "-o", "part.nc"]
    assert main(words) == 0
    capsys.readouterr()
    message = refused(capsys, "--against", "pocket.nc")
    assert "pocket.nc:6: the radius of offset D2 is not known" in message
    assert "input.tool_radius_mm" in message
    assert main(["simulate", "part.nc", "-m", "vx500", "--against", "pocket.nc", *known, "--json", "s.json"]) == 0
    limit = sg.Machine.load("vx500").tolerance.contour_um
    assert json.loads((folder / "s.json").read_text())["contour_error_um"]["response"]["max"] < 2.0 * limit
    # What has no radius on either side follows its own path.
    assert main(["simulate", "pocket.nc", "-m", "vx500", "--against", "pocket.nc"]) == 0
    assert main(["measure", "pocket.nc", "part.nc", "-m", "vx500", "--tool-diameter", "10mm"]) == 2


def test_the_original_is_the_program_of_the_same_number(folder: Path) -> None:
    first, second = (f"G21 G90 G17\nG00 X0 Y0 Z5.\nG01 X{x}. F3000\nY40.\nM30\n" for x in (30, 60))
    (folder / "two.nc").write_text(f"%\nO0001\n{first}O0002\n{second}%\n")
    (folder / "part.nc").write_text(f"%\nO0002\n{second}%\n")
    assert main(["simulate", "part.nc", "-m", "vx500", "--program", "O2", "--against", "two.nc",
                 "--set", "tolerance.contour_um=500", "--set", "tolerance.residual_floor_um=500"]) == 0  # fmt: skip
    assert main(["simulate", "part.nc", "-m", "vx500", "--against", "two.nc"]) == 2
