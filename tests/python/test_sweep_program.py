"""Programs that shake an axis: read and simulated here by NumPy, apart from the package."""

import re
from pathlib import Path

import numpy as np
import pytest

from command import run
from shapegcode.cli import main
from shapegcode.errors import ArgumentError
from shapegcode.identification.sweep_program import write_sweep
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine

VX500 = Machine.load("vx500")
PLAIN = VX500.with_values({"controller.motion": "after_interpolation", "controller.time_constant_s": 0.008})


def moves(text: str, axis: str = "X") -> list[tuple[float, float]]:
    """(length in mm, feed in mm/min) of every stroke, and (0, seconds) of every dwell."""
    found, feed = [], 0.0
    for line in text.splitlines():
        if line.startswith("G04"):
            found.append((0.0, float(line[5:]) / 1000.0))
        elif match := re.fullmatch(rf"(?:G01 )?{axis}(-?[0-9.]+)(?: F([0-9.]+))?", line):
            feed = float(match[2] or feed)
            found.append((float(match[1]), feed))
    return found


def acceleration(strokes: list[tuple[float, float]], period_s: float, filter_samples: int) -> FloatArray:
    """Of a control with linear acceleration after interpolation: blocks at their feed, then a moving average."""
    speed: list[float] = []
    for length, feed in strokes:
        if length == 0.0:
            speed += [0.0] * round(feed / period_s)
            continue
        full = abs(length) / (feed / 60.0) / period_s
        ticks = int(np.floor(full + 1e-9))
        rest = [full - ticks] if full - ticks > 1e-9 else []
        speed += [np.sign(length) * feed / 60.0 * share for share in [1.0] * ticks + rest]  # the last tick is shorter
    smooth = np.convolve(speed, np.full(filter_samples, 1.0 / filter_samples))
    return np.diff(smooth, prepend=0.0) / period_s


def test_a_sweep_stays_within_its_limits_and_ends_where_it_began(tmp_path: Path) -> None:
    for axis, machine in (("x", VX500), ("z", PLAIN)):
        file = tmp_path / f"{axis}.nc"
        found = write_sweep(file, machine, axis, travel_mm=0.8, seconds=30.0)  # type: ignore[arg-type]
        strokes = moves(file.read_text(), axis.upper())
        positions = np.cumsum([length for length, feed in strokes])
        assert abs(positions[-1]) < 1e-9
        assert positions.min() > -1e-9
        assert 0.1 < positions.max() <= 0.8
        lasting = [abs(length) / feed * 60.0 for length, feed in strokes if length]
        assert min(lasting) > 0.8 * VX500.controller.block_time_s
        assert max(feed for length, feed in strokes if length) <= VX500.axes.x.max_feed_mm_per_min
        assert all(band.acceleration_mm_s2 <= 0.3 * 5000.0 for band in found.bands)
        assert found.bands[0].low_hz == 8.0
        assert 80.0 < found.bands[-1].high_hz <= 100.0
        if machine is VX500:  # no reversal asks for a ramp, even if the control's speed difference is 20 % smaller
            assert 2.0 * max(feed for length, feed in strokes if length) <= 0.8 * 500.0
        words = {word[0] for line in file.read_text().splitlines() if line[0] not in "%(O" for word in line.split()}
        assert words <= {"G", "F", "P", "M", axis.upper()}


def test_the_planned_acceleration_is_that_of_an_independent_simulation(tmp_path: Path) -> None:
    file = tmp_path / "x.nc"
    found = write_sweep(file, PLAIN, "x")
    period_s = PLAIN.controller.interpolation_period_s
    parts: list[list[tuple[float, float]]] = [[]]
    for each in moves(file.read_text())[1:]:
        parts[-1].append(each)
        if each[0] == 0.0:
            parts.append([])
    for band, rising, falling in zip(found.bands, parts[::2], parts[1::2], strict=False):
        a = acceleration([*rising, *falling], period_s, 8)
        hertz = np.fft.rfftfreq(len(a), period_s)
        inside = (hertz >= 0.95 * band.low_hz) & (hertz <= 1.05 * band.high_hz)
        power = 2.0 * np.sum(np.abs(np.fft.rfft(a)[inside]) ** 2) / len(a) ** 2
        moving_s = band.duration_s - 3.5
        expected = np.sqrt(2.0 * power * len(a) * period_s / moving_s)
        assert band.acceleration_mm_s2 == pytest.approx(expected, rel=0.03)
        assert band.acceleration_mm_s2 > 500.0, "each band is excited"


def test_what_a_control_does_not_reach_is_said(tmp_path: Path) -> None:
    file = tmp_path / "x.nc"
    with pytest.raises(
        ArgumentError, match=r"150 Hz cannot be reached, 86.96 Hz can: a block lasts 5 ms or more, with 15 % margin"
    ):
        write_sweep(file, VX500, "x", band_hz=(10.0, 150.0))
    slow = VX500.with_values("controller.block_time_s", 0.05)
    with pytest.raises(ArgumentError, match=r"band of 8 to 200 Hz: must ascend by 1.5 times or more; .* 8.696 Hz"):
        write_sweep(file, slow, "x")
    with pytest.raises(ArgumentError, match=r"at 8 Hz the control commands only 5 mm/s², less than 20 mm/s²"):
        write_sweep(file, VX500, "x", acceleration_share=0.001)
    coarse = VX500.with_values("controller.least_increment_mm", 0.01)
    assert write_sweep(file, coarse, "x").limit.endswith("less than 40 µm")
    assert not (tmp_path / "none.nc").exists()
    answer = run(tmp_path, "sweep", "-m", "vx500", "-o", "none.nc", "--travel", "0")
    assert (answer.returncode, (tmp_path / "none.nc").exists()) == (2, False)


def test_the_command_writes_the_program_and_says_the_band_before(tmp_path: Path) -> None:
    answer = run(tmp_path, "sweep", "-m", "vx500", "--axis", "y", "-o", "y.nc", "--seconds", "20")
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.startswith("Y axis of VX500: 8 to 86")
    assert "next: run y.nc with a logger on what the Y axis moves" in answer.stdout
    assert run(tmp_path, "machine", "show", "vx500", "--for", "y.nc").returncode == 0, "no mark of a shaped program"
    small = run(tmp_path, "sweep", "-m", "vx500", "-o", "x.nc", "--set", "controller.program_memory_bytes=20000")
    assert small.returncode == 0
    assert "controller.program_memory_bytes" in small.stdout + small.stderr


def test_limits_that_contradict_are_refused_with_their_value(tmp_path: Path) -> None:
    file = tmp_path / "x.nc"
    with pytest.raises(ArgumentError, match=r"band of 0 to 20 Hz: must be above 0, finite and ascend"):
        write_sweep(file, VX500, "x", band_hz=(0.0, 20.0))
    with pytest.raises(ArgumentError, match=r"band of 10 to nan Hz: must be above 0"):
        write_sweep(file, VX500, "x", band_hz=(10.0, float("nan")))
    with pytest.raises(ArgumentError, match=r"seconds = 1e\+09: must be at most 100000 \(controller.max_program_s\)"):
        write_sweep(file, VX500, "x", seconds=1e9)
    with pytest.raises(ArgumentError, match=r"seconds = 1: 0.83 cycles of 10 Hz .* required: 3 or more, 3.6 s"):
        write_sweep(file, VX500, "x", band_hz=(10.0, 80.0), seconds=1.0)
    with pytest.raises(ArgumentError, match=r"axis = 'w': must be x, y or z"):
        write_sweep(file, VX500, "w")  # type: ignore[arg-type]
    assert not file.exists()


def test_the_command_writes_all_or_nothing_and_to_standard_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    zero = run(tmp_path, "sweep", "-m", "vx500", "-o", "x.nc", "--frequencies", "0:20")
    assert (zero.returncode, zero.stderr.count("\n")) == (2, 1)
    answer = run(tmp_path, "sweep", "-m", "vx500", "-o", "x.nc", "--seconds", "10", "--json", "nowhere/x.json")
    assert (answer.returncode, list(tmp_path.iterdir())) == (2, [])
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", "-m", "vx500", "-o", "-", "--seconds", "10"]) == 0
    piped = capsys.readouterr().out
    assert piped.startswith("%\nO7201(SWEEP X)\n")
    assert piped.endswith("M30\n%\n")
    assert not list(tmp_path.iterdir())
