"""Klipper's resonance sweep: its pulses and a plant simulated by SciPy, and what cannot be had from such a file."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from command import run
from shapegcode.errors import RecordError
from shapegcode.identification.identify import identify
from shapegcode.identification.update import update_machine
from shapegcode.io.record import ReadOptions
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine

RATE_HZ, FINER = 1600.0, 4


def pulses(lowest_hz: float = 5.0, highest_hz: float = 133.3, hz_per_s: float = 2.0) -> tuple[FloatArray, FloatArray]:
    """Time and acceleration in mm/s² of the test: quarter periods of +a, -a, -a, +a, with a = 75 mm/s² per Hz."""
    ends, levels = [0.0], []
    frequency, sign = lowest_hz, 1.0
    while frequency <= highest_hz:
        quarter = 0.25 / frequency
        levels += [sign * 75.0 * frequency, -sign * 75.0 * frequency]
        ends += [ends[-1] + quarter, ends[-1] + 2.0 * quarter]
        frequency, sign = frequency + 2.0 * quarter * hz_per_s, -sign
    time = np.arange(int((ends[-1] + 1.0) * RATE_HZ * FINER)) / (RATE_HZ * FINER)
    place = np.minimum(np.searchsorted(ends, time, side="right") - 1, len(levels))
    return time, np.array([*levels, 0.0])[place]


def shaken(modes: list[tuple[float, float, float]]) -> tuple[FloatArray, FloatArray]:
    """Time and acceleration of the head; modes of (share of the motion, frequency, damping ratio)."""
    time, command = pulses()
    response = command.copy()
    for share, hertz, damping in modes:
        omega = 2.0 * np.pi * hertz
        system = ([-share, 0.0, 0.0], [1.0, 2.0 * damping * omega, omega**2])
        numerator, denominator, _ = cont2discrete(system, time[1], method="zoh")
        response += lfilter(numerator.ravel(), denominator, command)
    return time[::FINER], response[::FINER]


def save(path: Path, time: FloatArray, response: FloatArray, axis: int = 0) -> Path:
    rng = np.random.default_rng(3)
    table = 60.0 * rng.standard_normal((len(time), 3)) + (0.0, 0.0, 9810.0)
    table[:, axis] += response
    np.savetxt(path, np.column_stack((time + 1234.5, table)), fmt="%.6f", delimiter=",", comments="",
               header="#time,accel_x,accel_y,accel_z")  # fmt: skip
    return path


@pytest.mark.parametrize(
    "modes", [[(1.0, 48.0, 0.06)], [(0.7, 55.0, 0.04), (0.3, 92.0, 0.03)], [(0.8, 41.0, 0.05), (0.2, 60.0, 0.05)]]
)
def test_frequency_and_damping_of_a_sweep(tmp_path: Path, modes: list[tuple[float, float, float]]) -> None:
    found = identify(save(tmp_path / "raw_data_y_1.csv", *shaken(modes), axis=1))
    assert (found.axis, found.decay, len(found.modes)) == ("y", False, len(modes))
    for mode, (_, hertz, damping) in zip(found.modes, modes, strict=True):
        assert mode.frequency_hz.low <= hertz <= mode.frequency_hz.high
        assert mode.damping_ratio.low <= damping <= mode.damping_ratio.high
        assert mode.damping_ratio.uncertainty_percent >= 10.0, "a sweep without force is known less well than a tap"
        assert mode.mass_kg is None
    assert any("no mass and no stiffness" in warning for warning in found.warnings)
    mine = tmp_path / "mine.toml"
    mine.write_text(Machine.builtin_text("vx500"), encoding="utf-8")
    update = update_machine(mine, found, keep_modes="xz")
    assert [round(mode.frequency_hz) for mode in update.machine.axes.y.modes] == [round(mode[1]) for mode in modes]
    assert {Path(each).stem for each in found.save_plots(tmp_path)} == {"identify-sweep"}


@pytest.mark.slow
def test_the_axis_that_moved_most_is_taken_and_said(tmp_path: Path) -> None:
    path = save(tmp_path / "log.csv", *shaken([(1.0, 48.0, 0.06)]))
    found = identify(path)
    assert found.axis == "x"
    assert any("the axis is not stated: X moved most" in note for note in found.notes)
    assert identify(path, ReadOptions(axis="x")).notes[0].startswith("searched from 10 to 130 Hz")


def test_what_a_sweep_must_hold(tmp_path: Path) -> None:
    time, response = shaken([(1.0, 48.0, 0.06)])
    short = save(tmp_path / "short.csv", time[:8000], response[:8000])
    with pytest.raises(RecordError, match=r"short.csv: 5 s: too short for a sweep \(10 s or more\).*--decay"):
        identify(short)
    slow = save(tmp_path / "slow.csv", time[::8], response[::8])
    with pytest.raises(RecordError, match=r"200 samples per second are too slow for 130 Hz; required: 325"):
        identify(slow)
    with pytest.raises(RecordError, match="a sweep is identified alone"):
        identify([short, slow])
    text = short.read_text().splitlines()
    text[9] = text[8]
    short.write_text("\n".join(text))
    with pytest.raises(RecordError, match=r"short.csv:10: time .* is repeated: must ascend"):
        identify(short)


def test_a_decay_that_klipper_recorded(tmp_path: Path) -> None:
    time = np.arange(6400) / 3200.0
    decay = np.where(time > 0.2, 4000.0 * np.exp(-12.0 * (time - 0.2)) * np.sin(300.0 * (time - 0.2)), 0.0)
    path = save(tmp_path / "adxl.csv", time, decay)
    answer = run(tmp_path, "identify", path, "--decay", "--axis", "x", "--json", "-")
    assert answer.returncode == 0, answer.stderr
    found = identify(path, ReadOptions(axis="x", ignore_force=True))
    assert found.decay
    assert found.modes[0].frequency_hz.value == pytest.approx(np.hypot(300.0, 12.0) / (2.0 * np.pi), rel=1e-3)


@pytest.mark.parametrize("option", [["--across"], ["--stops"], ["--start", "1s"]])
def test_what_goes_with_a_decay_is_refused(tmp_path: Path, option: list[str]) -> None:
    save(tmp_path / "raw_data_y_1.csv", *shaken([(1.0, 48.0, 0.06)]), axis=1)
    done = run(tmp_path, "identify", "raw_data_y_1.csv", "--axis", "y", *option)
    assert (done.returncode, done.stderr) == (2, "")
    assert f"a sweep without force, for which {option[0]} has no effect" in done.stdout
