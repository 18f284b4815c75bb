"""Modes from a control's own capture of command and encoder; the loop and what hangs on it are simulated by SciPy."""

from pathlib import Path

import numpy as np
import pytest

import shapegcode as sg
from command import run
from held_loop import encoder_m
from shapegcode.identification.known_command import KnownCommand, known_command
from shapegcode.identification.sweep import is_capture
from shapegcode.identification.sweep_program import write_sweep
from shapegcode.io.units import FloatArray
from test_known_command import check_modes

MODES = [(60.0, 23.0, 0.02), (40.0, 46.0, 0.03)]


@pytest.fixture(scope="module")
def command(tmp_path_factory: pytest.TempPathFactory) -> KnownCommand:
    program = tmp_path_factory.mktemp("sweep") / "SWEEP.NC"
    write_sweep(program, sg.Machine.load("vx500"), "x", seconds=40.0)
    return known_command(program, "vx500")


@pytest.fixture(scope="module")
def actual_m(command: KnownCommand) -> FloatArray:
    return encoder_m(command.position, command.period_s, MODES)


def write(path: Path, command_m: FloatArray, actual_m: FloatArray, *, step_m: float = 1e-6, axis: str = "X") -> Path:
    rows = np.column_stack((np.arange(len(command_m)), 1e3 * command_m, 1e3 * np.round(actual_m / step_m) * step_m))
    np.savetxt(path, rows, "%.6f", ",", header=f"time [ms],{axis} [mm],{axis}_act [mm]", comments="")
    return path


def check(found: sg.Identification, *, within: float = 0.005) -> None:
    check_modes(found, [(hertz, zeta) for _, hertz, zeta in MODES], within)


@pytest.mark.parametrize("step_um", [0.1, 1.0])
def test_modes_with_the_encoder_held(
    command: KnownCommand, actual_m: FloatArray, tmp_path: Path, step_um: float
) -> None:
    file = write(tmp_path / "trace.csv", command.position, actual_m, step_m=step_um * 1e-6)
    found = sg.identify(file, sg.ReadOptions(axis="x"))
    check(found)
    assert found.axis == "x"
    assert "capture of command and encoder" in found.answer


def test_a_stiffer_loop_sees_the_same_modes(command: KnownCommand, tmp_path: Path) -> None:
    """The poles of the closed loop are others; the modes with the encoder held are not."""
    for gain, bandwidth in ((30.0, 50.0), (80.0, 120.0)):
        actual = encoder_m(
            command.position, command.period_s, MODES, gain_per_s=gain, bandwidth_hz=bandwidth, feed_forward=0.0
        )
        file = write(tmp_path / "trace.csv", command.position, actual, step_m=1e-7)
        check(sg.identify(file, sg.ReadOptions(axis="x")), within=0.01)


def test_into_the_machine_file(command: KnownCommand, actual_m: FloatArray, tmp_path: Path) -> None:
    file, machine = write(tmp_path / "trace.csv", command.position, actual_m), tmp_path / "mine.toml"
    machine.write_text(sg.Machine.load("vx500").to_toml(short=True))
    done = run(tmp_path, "identify", file, "--axis", "x", "--update", machine, "--keep-modes", "y")
    assert done.returncode == 0, done.stderr
    put = sorted(mode.frequency_hz for mode in sg.Machine.load(machine).axes.x.modes)
    assert put == pytest.approx([23.0, 46.0], rel=0.005)


def test_a_rigid_axis_shows_no_mode(command: KnownCommand, tmp_path: Path) -> None:
    actual = encoder_m(command.position, command.period_s, [])
    found = sg.identify(write(tmp_path / "trace.csv", command.position, actual), sg.ReadOptions(axis="x"), strict=False)
    assert found.modes == ()


@pytest.mark.parametrize(("axis", "words"), [(None, "add --axis x, y or z"), ("y", "called Y")])
def test_the_axis_must_be_said(
    command: KnownCommand, actual_m: FloatArray, tmp_path: Path, axis: str | None, words: str
) -> None:
    file = write(tmp_path / "trace.csv", command.position, actual_m)
    with pytest.raises(sg.RecordError, match=words):
        sg.identify(file, sg.ReadOptions(axis=axis))


def test_too_little_motion_is_refused(command: KnownCommand, actual_m: FloatArray, tmp_path: Path) -> None:
    first = int(command.parts[0][1] / command.period_s)
    with pytest.raises(sg.RecordError, match="moves in 1 part"):
        sg.identify(write(tmp_path / "short.csv", command.position[:first], actual_m[:first]), sg.ReadOptions(axis="x"))
    still = np.zeros(5000)
    with pytest.raises(sg.RecordError, match="moves in 0 parts"):
        sg.identify(write(tmp_path / "still.csv", still, still), sg.ReadOptions(axis="x"))


def test_other_files_are_no_captures(tmp_path: Path) -> None:
    tap = tmp_path / "tap.csv"
    tap.write_text("time [s],force [N],accX actual [m/s^2]\n0,0,0\n0.001,1,2\n")
    assert not is_capture(tap)
    alone = tmp_path / "command.csv"
    alone.write_text("time_ms,X,Y_act\n" + "".join(f"{k},{k},{k}\n" for k in range(200)))
    assert not is_capture(alone)


def test_the_next_step_takes_the_same_modes(command: KnownCommand, actual_m: FloatArray, tmp_path: Path) -> None:
    write(tmp_path / "trace.csv", command.position, actual_m)
    done = run(tmp_path, "identify", "trace.csv", "--axis", "x", "--frequencies", "10:30")
    assert done.returncode == 0, done.stderr
    assert "next: shapegcode identify trace.csv --axis x --frequencies 10:30 --update mine.toml" in done.stdout


@pytest.mark.parametrize(
    "options",
    [["--stops"], ["--across"], ["--decay"], ["--start", "1s"], ["--quantity", "velocity"], ["--sample-period", "1ms"]],
)
def test_what_goes_with_a_sensor_is_refused(tmp_path: Path, options: list[str]) -> None:
    moving = np.cumsum(np.random.default_rng(1).standard_normal(2000)) * 1e-3
    write(tmp_path / "trace.csv", moving, moving)
    done = run(tmp_path, "identify", "trace.csv", "--axis", "x", *options)
    assert done.returncode == 2
    named = options[0].replace("--decay", "--ignore-force")
    assert f"a capture of command and encoder, for which {named} has no effect" in done.stdout


def test_a_column_of_a_sensor_makes_it_a_record(tmp_path: Path) -> None:
    """A trace with an accelerometer beside the positions: the decay of 31 Hz, 2 % behind a stop."""
    times, omega, zeta = 5e-4 * np.arange(2000), 2.0 * np.pi * 31.0, 0.02
    sensor = np.exp(-zeta * omega * times) * np.cos(omega * np.sqrt(1.0 - zeta**2) * times)
    sensor += 1e-3 * np.random.default_rng(2).standard_normal(len(times))
    rows = np.column_stack((times, 0.0 * times, 0.0 * times, sensor))
    file = tmp_path / "trace.csv"
    np.savetxt(file, rows, "%.8g", ",", header="time [s],X [mm],X_act [mm],accX [m/s^2]", comments="")
    found = sg.identify(file, sg.ReadOptions(axis="x", response_columns=("accX",)))
    assert found.modes[0].frequency_hz.value == pytest.approx(31.0, rel=0.002)
    assert found.modes[0].damping_ratio.value == pytest.approx(zeta, rel=0.05)


def test_a_band_beyond_the_sampling_is_told_with_its_limits(tmp_path: Path) -> None:
    moving = np.cumsum(np.random.default_rng(1).standard_normal(20_000)) * 1e-3
    file = write(tmp_path / "trace.csv", moving, moving)
    with pytest.raises(sg.RecordError, match=r"resolves 4 to 400 Hz, the band asked for is 500 to 900 Hz"):
        sg.identify(file, sg.ReadOptions(axis="x"), band_hz=(500.0, 900.0))
