"""Modes from a record beside a program whose command is known; axis, drive and logger are simulated by NumPy alone."""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command import run
from shaken_axis import Logger, ShakenMode, logged, ran, random_modes, shaken
from shapegcode.errors import ArgumentError, RecordError
from shapegcode.identification.frf_fit import find_frf_modes
from shapegcode.identification.identify import identify
from shapegcode.identification.known_command import KnownCommand, known_command
from shapegcode.identification.model_search import Sought
from shapegcode.identification.result import Identification
from shapegcode.identification.sweep_program import write_sweep
from shapegcode.identification.update import update_machine
from shapegcode.io.record import FrequencyResponse, ReadOptions, Record
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine

VX500 = Machine.load("vx500")
PHONE = Logger()
MODES = [ShakenMode(0.5, 23.0, 0.02), ShakenMode(0.3, 46.0, 0.03)]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("sweep") / "SWEEP.NC"
    write_sweep(path, VX500, "x", seconds=40.0)
    return path


@pytest.fixture(scope="module")
def command(program: Path) -> KnownCommand:
    return known_command(program, VX500)


@pytest.fixture(scope="module")
def motion(command: KnownCommand) -> tuple[FloatArray, FloatArray]:
    return shaken(command.position * 1e3, command.period_s, MODES)


def record(motion: tuple[FloatArray, FloatArray], logger: Logger = PHONE, seed: int = 1) -> Record:
    times, values = logged(*motion, logger, seed)
    return Record("phone", float(times[1] - times[0]), values)


def found_in(program: Path, *records: Record, **options: Any) -> Identification:
    return identify(list(records), sweep=program, machine=VX500, **options)


def check_modes(found: Identification, modes: Sequence[tuple[float, float]], within: float = 0.005) -> None:
    """Frequencies and damping ratios; without a force no mass."""
    assert len(found.modes) == len(modes), found
    for mode, (hertz, zeta) in zip(found.modes, modes, strict=True):
        assert mode.frequency_hz.value == pytest.approx(hertz, rel=within)
        assert mode.damping_ratio.value == pytest.approx(zeta, rel=0.1)
        assert mode.mass_kg is mode.stiffness_n_per_m is None


def check(found: Identification, modes: list[ShakenMode]) -> None:
    check_modes(found, sorted((mode.frequency_hz, mode.damping_ratio) for mode in modes))


def test_the_tool_follows_the_axis_by_the_closed_form_of_a_moved_base() -> None:
    """x = y (2 zeta w s + w²)/(s² + 2 zeta w s + w²) = y (1 - s²/(...)): a residue of +1 in minus the ratio."""
    s = 2j * np.pi * np.arange(5.0, 90.0, 0.1)
    omega, zeta = 2.0 * np.pi * 30.0, 0.03
    ratio = (2.0 * zeta * omega * s + omega**2) / (s**2 + 2.0 * zeta * omega * s + omega**2)
    np.testing.assert_allclose(ratio, 1.0 + ShakenMode(1.0, 30.0, zeta).passed(s), rtol=1e-12)
    found = find_frf_modes(
        [FrequencyResponse("base", s.imag / 2.0 / np.pi, -ratio)], ("base",), Sought(None, 1, 1, None)
    )
    assert found.modes[0].mass_kg is not None
    assert found.modes[0].mass_kg.value == pytest.approx(1.0, rel=1e-3)
    assert not found.warnings, "the sign is not turned"


def test_modes_start_and_clock_of_a_logger(program: Path, motion: tuple[FloatArray, FloatArray]) -> None:
    found = found_in(program, record(motion))
    check(found, MODES)
    assert (found.axis, found.ok) == ("x", True)
    begins = re.search(r"the program begins ([0-9.]+) s after the record", found.notes[0])
    assert float(begins[1]) == pytest.approx(3.3 * 1.01, abs=0.03)
    clock = re.search(r"clock is \+([0-9.]+) %", found.notes[0])
    assert float(clock[1]) == pytest.approx(100.0 / 101.0, abs=0.003), "1.01 seconds are counted in one"
    assert not any("than simulated" in note for note in found.notes)
    upside_down = record(motion, Logger(clock=0.99, begins_s=-0.4, rate_hz=1600.0))
    check(found_in(program, Record("turned", upside_down.period_s, -upside_down.response)), MODES)


@pytest.mark.parametrize(
    ("ramp_s", "wait_s"),
    [(0.02, 0.0), *(pytest.param(*each, marks=pytest.mark.slow) for each in ((0.0, 0.0), (0.1, 0.0), (0.05, 0.12)))],
)
def test_ramps_and_waits_of_the_control_need_not_be_those_of_the_machine_file(
    tmp_path: Path, ramp_s: float, wait_s: float
) -> None:
    assert VX500.controller.time_constant_s == 0.05
    program = tmp_path / "SWEEP.NC"
    write_sweep(program, VX500, "x")
    moved = shaken(ran(program.read_text(), 5e-4, ramp_s, wait_s), 5e-4, MODES)
    found = found_in(program, record(moved, Logger(clock=0.995, begins_s=-6.0), seed=4))
    check(found, MODES)
    told = [re.search(r"takes ([0-9]+) ms (longer|less) than simulated", note) for note in found.notes]
    (match,) = [each for each in told if each]
    longer = ramp_s + wait_s - 0.05
    assert match[2] == ("longer" if longer > 0.0 else "less")
    assert float(match[1]) == pytest.approx(1e3 * abs(longer), abs=6.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3, 5, 8])
def test_modes_of_random_machines(command: KnownCommand, program: Path, seed: int) -> None:
    generator = np.random.default_rng(seed)
    modes = random_modes(generator)
    moved = shaken(command.position * 1e3, command.period_s, modes, bandwidth_hz=generator.uniform(40.0, 120.0))
    check(found_in(program, record(moved, seed=seed)), modes)


def test_two_loggers_of_different_sampling_are_used_together(
    program: Path, motion: tuple[FloatArray, FloatArray]
) -> None:
    slow = record(motion, Logger(rate_hz=401.0, clock=0.995, begins_s=-7.0), seed=2)
    check(found_in(program, record(motion), slow), MODES)


def test_behind_a_feed_hold_and_a_jump_of_the_clock_the_part_before_is_used(
    program: Path, motion: tuple[FloatArray, FloatArray], command: KnownCommand
) -> None:
    values = motion[1]
    at = int(command.parts[11][0] * 16_000.0) + 20_000
    held = np.concatenate((values[:at], np.zeros(48_000), values[at:]))
    found = found_in(program, record((np.arange(len(held)) / 16_000.0, held)))
    check(found, MODES)
    assert any("from" in note and "on the record does not match the program (feed hold" in note for note in found.notes)
    jumped = record(motion)
    where = int((command.parts[11][0] + 4.0) * 808.0)
    lost = np.concatenate((jumped.response[:where], jumped.response[where + 600 :]))
    found = found_in(program, Record("jumped", jumped.period_s, lost))
    check(found, MODES)
    assert any("a jump of the logger's clock" in note for note in found.notes)


def test_a_logger_that_starts_late_or_stops_early_shows_no_further_modes(
    program: Path, motion: tuple[FloatArray, FloatArray], command: KnownCommand
) -> None:
    late = found_in(program, record(motion, Logger(begins_s=26.0)))
    check(late, MODES)
    assert "s before the record" in late.notes[0]
    for end_s in (command.parts[5][0] + 0.2, command.parts[8][1] - 0.5):  # what rings in the part before is cut off
        whole = record(motion)
        count = int((end_s + 3.3) * 1.01 * 800.0)
        check(found_in(program, Record("early", whole.period_s, whole.response[:count])), MODES)
    count = int((command.parts[2][1] + 3.3) * 1.01 * 800.0)
    first = int((command.parts[1][0] + 3.3) * 1.01 * 800.0)
    with pytest.raises(RecordError, match=r"no (two parts of .* required: one such pair|relation)"):
        found_in(program, Record("middle", whole.period_s, whole.response[first:count]))


def test_what_is_refused_with_its_reason(program: Path, motion: tuple[FloatArray, FloatArray], tmp_path: Path) -> None:
    good = record(motion)
    noise = np.random.default_rng(3).standard_normal(len(good.response))
    hum = np.sin(2.0 * np.pi * 50.0 * good.time_s)
    with pytest.raises(RecordError, match=r"no relation to the command .* along X\? .* override of 100 %"):
        found_in(program, Record("other axis", good.period_s, 0.3 * noise + 0.5 * hum))
    with pytest.raises(RecordError, match=r"every sample is 9.81 m/s²: nothing was measured"):
        found_in(program, Record("flat", good.period_s, np.full(len(noise), 9.81)))
    with pytest.raises(RecordError, match=r"correlate with the record, the best by [0-9]?[0-9] % \(limit 50 %\)"):
        found_in(program, Record("noise", good.period_s, noise))
    clipped = Record("clipped", good.period_s, np.clip(good.response, -3.0, 3.0))
    with pytest.raises(RecordError, match=r"overload: the acceleration is cut off at 3 m/s²"):
        found_in(program, clipped)
    with pytest.raises(RecordError, match=r"1.25 s: too short; required: two parts"):
        found_in(program, Record("short", good.period_s, good.response[:1000]))
    with pytest.raises(RecordError, match=r"40 samples per second are too slow; required: 2.5 for each Hz"):
        found_in(program, record(motion, Logger(rate_hz=40.0)))
    with pytest.raises(RecordError, match="velocity: a sweep needs an acceleration"):
        found_in(program, Record("laser", good.period_s, good.response, "velocity"))
    late = Record("late", good.period_s, good.response[8000:])
    assert re.search(r"the program begins 6\.[67][0-9]+ s before the record", found_in(program, late).notes[0])
    coarse = found_in(program, record(motion, Logger(rate_hz=100.0)))
    assert [round(mode.frequency_hz.value) for mode in coarse.modes] == [23]
    assert any(
        re.match(r"searched from \d+ to \d+ Hz; 100 samples per second reach 40 Hz", note) for note in coarse.notes
    )
    faster = good.response[: len(good.response) // 2]
    with pytest.raises(RecordError, match="no relation to the command"):
        found_in(program, Record("override", 1.25 * good.period_s, faster))
    with pytest.raises(ArgumentError, match="a sweep needs the machine"):
        identify([good], sweep=program)
    for band_hz in ((500.0, 900.0), (20.0, 20.05), (0.5, 1.0)):
        with pytest.raises(RecordError, match=rf"lines between {band_hz[0]:g} and {band_hz[1]:g} Hz, .* are needed"):
            found_in(program, good, band_hz=band_hz)
    refused = (
        ("X1. F100.\nY1.", "Y by 1 mm too"),
        ("M00", "nothing moves"),
        ("X1. F100.", r"has no rest of 0.5 s or more; required: 2 parts"),
    )
    for text, why in refused:
        other = tmp_path / "other.nc"
        other.write_text(f"%\nO1\nG21 G91 G94 G01 {text}\nM30\n%\n")
        with pytest.raises(RecordError, match=why):
            found_in(other, good)


def test_the_command_finds_the_axis_of_a_phone_and_writes_the_machine(
    program: Path, motion: tuple[FloatArray, FloatArray], tmp_path: Path
) -> None:
    shaken_axis = record(motion)
    other = 0.05 * np.random.default_rng(5).standard_normal((len(shaken_axis.response), 2))
    table = np.column_stack((shaken_axis.time_s, other[:, 0], shaken_axis.response, other[:, 1] + 9.81))
    header = '"Time (s)","Acceleration x (m/s^2)","Acceleration y (m/s^2)","Acceleration z (m/s^2)"'
    np.savetxt(tmp_path / "phone.csv", table, fmt="%.9e", delimiter=",", header=header, comments="")
    (tmp_path / "mine.toml").write_text(Machine.builtin_text("vx500"), encoding="utf-8")
    answer = run(
        tmp_path, "identify", "phone.csv", "--sweep", program, "-m", "mine.toml", "--update", "mine.toml",
        "--keep-modes", "yz", "--json", "found.json", "--plots", "plots",
    )  # fmt: skip
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.startswith("use: 2 modes of the X axis in a sweep without force: 23, 46 Hz")
    assert "this axis of the sensor matches the command best" in answer.stdout
    assert sorted(round(mode.frequency_hz) for mode in Machine.load(tmp_path / "mine.toml").axes.x.modes) == [23, 46]
    assert json.loads((tmp_path / "found.json").read_text())["axis"] == "x"
    assert {each.stem for each in (tmp_path / "plots").iterdir()} == {"identify-sweep"}
    again = run(tmp_path, "identify", "phone.csv", "--axis", "x", "--sweep", program, "-m", "mine.toml")
    assert again.returncode == 0, "the X axis of the machine, whatever that of the sensor is"
    assert f"next: shapegcode identify phone.csv --sweep {program} -m mine.toml --update mine.toml" in again.stdout
    bare = run(tmp_path, "identify", "phone.csv", "--sweep", program)
    assert (bare.returncode, "--sweep needs -m" in bare.stderr) == (2, True)
    with pytest.raises(RecordError, match=r"axis Y is asked for, .* moves X: omit the axis"):
        identify(tmp_path / "phone.csv", ReadOptions(axis="y"), sweep=program, machine=VX500)
    found = identify(tmp_path / "phone.csv", sweep=program, machine=VX500)
    assert update_machine(tmp_path / "mine.toml", found, keep_modes="yz").machine.axes.x.modes
