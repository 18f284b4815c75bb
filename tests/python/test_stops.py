"""Modes from the stops of ordinary runs; the run is simulated by NumPy and SciPy alone."""

from pathlib import Path

import numpy as np
import pytest

import shapegcode as sg
from command import run
from ordinary_run import PERIOD_S, ordinary_run
from shapegcode.identification.spectra import split_stops
from test_known_command import check_modes

MODES = [(0.6, 27.0, 0.02), (0.3, 61.0, 0.03)]


def record(seed: int, **options: object) -> sg.Record:
    return sg.Record("run", PERIOD_S, ordinary_run(np.random.default_rng(seed), MODES, **options))  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", [0, 2, 3, 5])
def test_stops_of_a_run_give_its_modes(seed: int) -> None:
    found = sg.identify([record(seed)], stops=True)
    check_modes(found, [(hertz, zeta) for _, hertz, zeta in MODES])
    assert len(found.taps) >= 10
    assert all("stop" in tap.source for tap in found.taps)


def test_what_moves_behind_a_stop_is_left_out() -> None:
    """Some pauses are so short that a stop holds the next start: the modes of the stillest stops do not explain it."""
    found = sg.identify([record(7)], stops=True)
    assert any("do not explain it" in use.reason for use in found.records)


def test_the_stillest_stops_of_all_records_come_first() -> None:
    t = np.arange(0.0, 12.0, 1e-3)
    since = [np.clip(t - (1.0 + 2.7 * k), 0.0, None) for k in range(4)]
    decays = sum(np.exp(-6.0 * each) * np.sin(2.0 * np.pi * 40.0 * each) for each in since)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(len(t))
    drift = 0.05 * np.sin(2.0 * np.pi * 1.3 * t)
    moving, still = (sg.Record(name, 1e-3, decays + noise + more) for name, more in (("moving", drift), ("still", 0.0)))
    for records in ([moving, still], [still, moving]):
        names = [stop.source.split()[0] for stop in split_stops(records)]
        assert names == ["still"] * 4 + ["moving"] * 4


def test_moves_at_steady_speed_are_rests_too() -> None:
    found = sg.identify([record(3, pauses_s=(0.005,), moves=12)], stops=True)
    assert [mode.frequency_hz.value for mode in found.modes] == pytest.approx([27.0, 61.0], rel=0.005)


def test_a_run_without_rests_is_refused() -> None:
    steady = sg.Record("fan", PERIOD_S, np.sin(2.0 * np.pi * 33.0 * PERIOD_S * np.arange(20_000)))
    with pytest.raises(sg.RecordError, match="no stop"):
        sg.identify([steady], stops=True)


def test_a_force_has_no_stops() -> None:
    whole = record(0)
    tap = sg.Record("tap", PERIOD_S, whole.response, force_n=np.zeros(len(whole.response)))
    with pytest.raises(sg.ArgumentError, match="contains a force"):
        sg.identify([tap], stops=True)


@pytest.mark.filterwarnings("error")
def test_a_dead_sensor_is_told() -> None:
    with pytest.raises(sg.RecordError, match="every sample is 0: no vibration; is the sensor connected"):
        sg.identify([sg.Record("run", PERIOD_S, np.zeros(20_000))], stops=True)


def test_a_start_goes_with_one_decay() -> None:
    with pytest.raises(sg.ArgumentError, match=r"start at 1 s: is for one decay"):
        sg.identify([record(0)], stops=True, start_s=1.0)


def test_by_command(tmp_path: Path) -> None:
    values = record(0).response
    rows = np.column_stack((PERIOD_S * np.arange(len(values)), values))
    np.savetxt(tmp_path / "run.csv", rows, "%.6g", ",", header="time [s],accX [m/s^2]", comments="")
    done = run(tmp_path, "identify", "run.csv", "--axis", "x", "--stops")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "use: 2 modes of the X axis in 16 decays: 27, 61.03 Hz" in done.stdout
