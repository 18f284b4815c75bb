"""Logs of commands and actual positions: what the position loop is, what it explains, and what cannot be told."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lsim

import shapegcode as sg
from command import run
from edge_writer import MEASURED, edge_document, write_edge
from shapegcode import _core
from shapegcode.identification.servo.fit import delayed, lagged_motion
from shapegcode.io.units import FloatArray

PERIOD_S = 0.002


def moves(count: int, speed: float, acceleration: float, pause_s: float = 0.3) -> FloatArray:
    """Way there and back with ramps of constant acceleration, smoothed over 40 ms, every 0.1 ms."""
    step = 1e-4
    ramp = np.arange(0.0, speed / acceleration, step) * acceleration
    one = np.concatenate([ramp, np.full(round(0.3 / step), speed), ramp[::-1], np.zeros(round(pause_s / step))])
    speeds = np.concatenate([np.zeros(3000), *(one * (-1) ** rank for rank in range(count))])
    smooth = np.convolve(speeds, np.full(400, 1.0 / 400.0))[: len(speeds)]
    return np.cumsum(smooth) * step


def simulated(way: FloatArray, dead_s: float, gain: float, forward: float) -> FloatArray:
    """(K + f s)/(s + K) behind a dead time by SciPy, in steps of 0.1 ms, of set-points every 2 ms joined by lines."""
    time = np.arange(len(way)) * 1e-4
    way = np.interp(time, time[::20], way[::20])
    late = np.interp(np.arange(len(way)) * 1e-4 - dead_s, np.arange(len(way)) * 1e-4, way)
    system = ([forward, gain] if forward else [gain], [1.0, gain])
    return np.asarray(lsim(system, late - way[0], time)[1]) + way[0]


def capture(
    path: Path, axes: dict[int, tuple[FloatArray, FloatArray]], noise: float = 0.0, lost_at: int | None = None
) -> Path:
    """Write a capture; at sample `lost_at` five cycles are missing."""
    every = round(PERIOD_S / 1e-4)
    rng = np.random.default_rng(7)
    columns = {}
    for number, (command, actual) in axes.items():
        columns[f"DES_POS|{number}"] = command[::every]
        columns[f"ENC_POS|{number}"] = actual[::every] + noise * rng.standard_normal(len(actual[::every]))
    counter = None
    if lost_at is not None:
        counter = [row + (5 if row >= lost_at else 0) for row in range(len(next(iter(columns.values()))))]
    return write_edge(path, edge_document(columns, first=0, counter=counter))


def test_the_lag_on_a_ramp_is_its_closed_form_and_that_of_the_core() -> None:
    time = PERIOD_S * np.arange(400)
    ramp = np.where(time > 0.1, 80.0 * (time - 0.1), 0.0)
    error = lagged_motion(ramp, 30.0, PERIOD_S)
    behind = time > 0.1
    # v/K (1 − e^(−K t)) behind the start of the ramp, which lies on a sample.
    assert error[behind] == pytest.approx(80.0 / 30.0 * (1.0 - np.exp(-30.0 * (time[behind] - 0.1))), abs=1e-9)
    way = np.cumsum(np.random.default_rng(3).normal(size=300))
    way[1] = way[0]  # at rest before
    core = _core.ServoLag(np.array([30.0, 60.0, 90.0]), np.array([0.2, 0.0, 0.9]), PERIOD_S)
    core.reset(np.full(3, way[0]))
    errors = []
    for place in way:
        core.step(np.full(3, place))
        errors.append(np.array(core.error_mm))
    for axis, (gain, rest) in enumerate(((30.0, 0.8), (60.0, 1.0), (90.0, 0.1))):
        assert rest * lagged_motion(way, gain, PERIOD_S) == pytest.approx(np.array(errors)[:, axis], abs=1e-9)
    # An axis that runs when the record begins lags v/K from its first sample on.
    assert lagged_motion(5.0 * time, 30.0, PERIOD_S) == pytest.approx(5.0 / 30.0, abs=1e-12)
    # The command 2.25 samples later, in steps of a quarter of a sample: the same polygon, so the same error.
    fine = np.interp(np.arange(4 * len(way)) / 4.0, np.arange(len(way)), way)
    quarters = lagged_motion(fine, 30.0, PERIOD_S / 4.0)
    assert lagged_motion(way, 30.0, PERIOD_S, 2.25)[3:] == pytest.approx(quarters[3:1191:4], abs=1e-9)
    assert delayed(5.0 * time, 2.25) == pytest.approx(5.0 * (time - 2.25 * PERIOD_S), abs=1e-12)


@pytest.mark.parametrize(
    ("dead_s", "gain", "forward"), [(0.0, 40.0, 0.5), (0.004, 30.0, 0.02), (0.00825, 60.0, 0.9), (0.0073, 25.0, 0.6)]
)
def test_a_simulated_capture_gives_its_loop_back(dead_s: float, gain: float, forward: float, tmp_path: Path) -> None:
    way = moves(6, 200.0, 1500.0)
    file = capture(tmp_path / "a.json", {1: (way, simulated(way, dead_s, gain, forward))}, noise=2e-4)
    (axis,) = sg.fit_servo(file).axes
    lag = dead_s + (1.0 - forward) / gain
    for name, truth, slack in (
        ("lag at constant speed", lag, 2e-5),
        ("dead time", dead_s, 1e-4),
        ("position gain", gain, 0.02 * gain),
        ("feed-forward", forward, 0.01),
    ):
        found = axis.parameter(name)
        assert found.value == pytest.approx(truth, abs=slack), name
        assert found.low - slack / 5.0 <= truth <= found.high + slack / 5.0, name
    model = axis.model("dead time and servo lag")
    # What is left is the noise of the encoder.
    assert model.rest == pytest.approx(2e-4, rel=0.2)
    assert axis.lag_rms > 100.0 * model.rest


@pytest.mark.slow
def test_a_drive_with_friction_is_told_from_a_lag(tmp_path: Path) -> None:
    """A mass with Coulomb friction, speed loop and gain, integrated in small steps here."""
    way = moves(4, 100.0, 1000.0)
    gain, bandwidth, integral, friction = 40.0, 2.0 * math.pi * 35.0, 0.006, 120.0
    late = np.interp(np.arange(len(way)) * 1e-4 - 0.006, np.arange(len(way)) * 1e-4, way)
    place = speed = total = 0.0
    actual = np.empty_like(way)
    for rank in range(len(way)):
        actual[rank] = place
        fed = (late[min(rank + 1, len(way) - 1)] - late[rank]) / 1e-4
        wrong = gain * (late[rank] - place) + 0.97 * fed - speed
        total += wrong * 1e-4
        force = bandwidth * (wrong + total / integral) - friction * math.tanh(speed / 0.05)
        speed += 1e-4 * force
        place += 1e-4 * speed
    file = capture(tmp_path / "a.json", {2: (way, actual)}, noise=1e-4)
    (axis,) = sg.fit_servo(file, drive=True).axes
    lag, drive = axis.model("dead time and servo lag"), axis.model("drive")
    assert drive.rest < 0.5 * lag.rest
    found = axis.parameter("drive: position gain")
    assert found.value == pytest.approx(gain, rel=0.15)


def test_the_measured_capture() -> None:
    """The control's own model of axis 2 is a dead time of 8.25 ms; ours leaves a fraction of its rest."""
    found = sg.fit_servo(MEASURED)
    axes = {axis.name.split()[0]: axis for axis in found.axes}
    for number, least in (("1", 80.0), ("2", 95.0), ("6", 90.0)):
        axis = axes[number]
        best = axis.best
        assert best.explained_percent is not None
        assert best.explained_percent > least
        assert best.rest < 0.01 * axis.lag_rms * (1.0 if number != "6" else 1.2)
        lag = axis.parameter("lag at constant speed")
        assert lag.value == pytest.approx(8.245e-3, abs=0.01e-3)
    # 8.25 ms: command as late as that less encoder is the contour deviation that the control gives, to 0.4 µm.
    capture = sg.read_edge_json(MEASURED)
    for stretch in capture.stretches:
        own = delayed(capture.position(2)[stretch], 8.25 / 2.0) - capture.position(2, actual=True)[stretch]
        assert np.std((own - capture.column("CONT_DEV", 2)[stretch])[50:]) < 4.5e-4
    assert "7.250 ms" in axes["5"].note
    assert axes["5"].models == ()
    assert axes["3"].unit == "deg"


def test_axes_that_tell_nothing(tmp_path: Path) -> None:
    way = moves(4, 50.0, 500.0)
    steady = 20.0 * 1e-4 * np.arange(len(way))
    still = np.zeros_like(way)
    file = capture(
        tmp_path / "a.json", {1: (way, simulated(way, 0.008, 40.0, 1.0)), 2: (steady, steady - 0.1), 3: (still, still)}
    )
    lagging, running, resting = sg.fit_servo(file).axes
    gain = lagging.parameter("position gain")
    assert gain.value is None
    assert "no lag remains to determine it" in gain.note
    assert running.note == "never changes its speed"
    assert running.parameters[0].value == pytest.approx(0.1 / 20.0)
    assert resting.note == "did not move"
    inches = capture(tmp_path / "c.json", {1: (way, way / 25.4), 2: (way, -way)})
    assert [axis.note.partition(":")[0] for axis in sg.fit_servo(inches).axes] == [
        "the actual position moves 0.0394 times as far as the command",
        "the actual position moves -1 times as far as the command",
    ]
    only = capture(tmp_path / "b.json", {3: (still, still)})
    assert not sg.fit_servo(only).ok


def test_machine_file_and_command(tmp_path: Path) -> None:
    way = moves(6, 200.0, 1500.0)
    loop = simulated(way, 0.004, 35.0, 0.5)
    file = capture(tmp_path / "a.json", {1: (way, loop), 4: (2.0 * way, 2.0 * loop)})
    out = tmp_path / "new.toml"
    report = tmp_path / "a.json.out"
    done = run(tmp_path,
        "characterize", "--servo", str(file), "-m", "vx500", "--axes", "X=1,y=4", "-o", str(out), "--json", str(report),
        "--plots", str(tmp_path / "plots"),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert f"next: shapegcode machine show {out}" in done.stdout and "-o FILE" not in done.stdout
    machine = sg.Machine.load(out)
    assert machine.controller.position_gain_per_s.x == pytest.approx(35.0, rel=0.01)
    assert machine.controller.feed_forward_ratio.y == pytest.approx(0.5, abs=0.01)
    assert "measured (log, with a dead time)" in out.read_text()
    assert json.loads(report.read_text())["axes"][0]["models"][1]["name"] == "dead time and servo lag"
    assert (tmp_path / "plots" / "servo.png").is_file()
    for options, message in (
        (["--axes", "X=9"], "--axes x=9: must be X, Y or Z and an axis of the log, which has 1 (X1), 4 (Q4)"),
        (["--axes", "Q=1"], "must be X, Y or Z"),
        (["--axes", "1,2"], "must be for example X=1,Y=6,Z=2"),
        (["--units", "ms,mm"], "--units ms,mm: is for a CSV"),
    ):
        done = run(tmp_path, "characterize", "--servo", str(file), "-m", "vx500", *options)
        assert done.returncode == 2
        assert message in done.stderr.replace("\n", " ")
    done = run(tmp_path, "characterize", "--fit", "x", "-m", "vx500", "--drive")
    assert done.returncode == 2
    assert "--drive: only with --servo" in done.stderr


def test_a_csv_log(tmp_path: Path) -> None:
    way = moves(6, 200.0, 1500.0)
    loop = simulated(way, 0.0, 30.0, 0.2)
    rows = [f"{1e-4 * rank * 1e3:.1f},{way[rank]:.6f},{loop[rank]:.6f}" for rank in range(0, len(way), 20)]
    file = tmp_path / "log.csv"
    file.write_text("\n".join(["time_ms,X,X_act", *rows]))
    (axis,) = sg.fit_servo(file).axes
    gain = axis.parameter("position gain")
    assert gain.value == pytest.approx(30.0, rel=0.02)
    file.write_text("\n".join(["time_ms,X", *(row.rpartition(",")[0] for row in rows)]))
    with pytest.raises(sg.RecordError, match="no actual positions"):
        sg.fit_servo(file)


def test_a_command_that_jumps_is_divided_there(tmp_path: Path) -> None:
    """Other coordinates in mid-motion, by more than half a turn: neither a turn nor a motion."""
    way = moves(6, 200.0, 1500.0)
    loop = simulated(way, 0.006, 40.0, 0.5)
    every = round(PERIOD_S / 1e-4)
    step = len(way) // 2 // every
    jump = np.where(np.arange(len(way)) >= step * every, 321.0, 0.0)
    found = sg.fit_servo(capture(tmp_path / "a.json", {1: (way + jump, loop + jump)}, lost_at=step // 2))
    (axis,) = found.axes
    assert axis.unit == "mm"
    assert axis.top_speed == pytest.approx(200.0, rel=0.01)
    gain = axis.parameter("position gain")
    assert gain.value == pytest.approx(40.0, rel=0.02)
    at_s = (step + 5) * PERIOD_S
    assert any(f"its command has a step, first at {at_s:.3f} s" in warning for warning in found.warnings)


@pytest.mark.slow
def test_of_a_long_log_the_liveliest_windows_are_taken(tmp_path: Path) -> None:
    way = np.concatenate([np.zeros(400_000), moves(6, 200.0, 1500.0), np.full(500_000, moves(6, 200.0, 1500.0)[-1])])
    found = sg.fit_servo(capture(tmp_path / "a.json", {1: (way, simulated(way, 0.006, 40.0, 0.5))}, noise=2e-4))
    assert found.warnings == ("of 47751 samples the 40000 with most changes of an axis' speed were used",)
    gain = found.axes[0].parameter("position gain")
    assert gain.value == pytest.approx(40.0, rel=0.02)


def test_captures_that_cannot_be_fitted(tmp_path: Path) -> None:
    way = np.linspace(0.0, 1.0, 300)
    only = edge_document({"DES_POS|1": way, "TORQUE|1": way})
    with pytest.raises(sg.RecordError, match=r"no axis with command and actual .*axis 1 \(X1\): no ENC_POS"):
        sg.fit_servo(write_edge(tmp_path / "a.json", only))
    short = edge_document({"DES_POS|1": way[:50], "ENC_POS|1": way[:50]})
    with pytest.raises(sg.RecordError, match="over 100 samples"):
        sg.fit_servo(write_edge(tmp_path / "b.json", short))
    holes = way.copy()
    holes[20] = np.nan
    with pytest.raises(sg.RecordError, match="ignored: values are missing"):
        sg.fit_servo(write_edge(tmp_path / "c.json", edge_document({"DES_POS|1": way, "ENC_POS|1": holes})))
