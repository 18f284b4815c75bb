"""integrations/example_control, built against the installed library as a user would: real programs with an operator's
commands, its record held against closed forms, NumPy and SciPy."""

import fcntl
import importlib.util
import math
import subprocess
import types
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from page_code import CELL
from scipy.signal import lfilter, lsim

from shapegcode import _core
from shapegcode.io.units import FloatArray

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "integrations" / "example_control"
CONTOUR = ROOT / "tests" / "golden" / "programs" / "CONTOUR_R.NC"
HALF_MM, RADIUS_MM = 55.123, 15.567  # of the rounded square that it cuts
PERIOD_S = 0.001
# Of machine.hpp.
MAX_SPEED, MAX_ACCELERATION, MAX_JERK = 250.0, 3000.0, 100_000.0
TOLERANCE_UM = 20.0
GAIN_PER_S, SPEED_GAIN, INTEGRAL_TIME_S, MASS_KG, VISCOUS = 30.0, 1.65e5, 0.02, 550.0, 500.0
MODES = {"x": [_core.Mode(46.0, 0.02)], "y": [_core.Mode(58.0, 0.02)], "z": []}


@dataclass(frozen=True)
class Run:
    """A run of the example: what it said, and its record by column."""

    exit_code: int
    said: str
    errors: str
    rows: np.ndarray

    def columns(self, pattern: str) -> FloatArray:
        return np.column_stack([self.rows[pattern.format(axis)] for axis in "xyz"])


def command(*words: str | Path) -> None:
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope="session")
def built() -> Path:
    """Where its programs are. Built in one place, of which later runs use what did not change."""
    place = ROOT / "build" / "test_example_control"
    place.mkdir(parents=True, exist_ok=True)
    with (place / "lock").open("w") as lock:  # several processes of pytest
        fcntl.flock(lock, fcntl.LOCK_EX)
        for component in ("rt", "runtime", "development"):
            command("cmake", "--install", ROOT / "build/release", "--prefix", place / "lib", "--component", component)
        command("cmake", "-S", EXAMPLE, "-B", place / "b", f"-DCMAKE_PREFIX_PATH={place / 'lib'}")
        command("cmake", "--build", place / "b")
    return place / "b"


def run(built: Path, program: Path, commands: str, record: Path, *options: str) -> Run:
    done = subprocess.run(
        [built / "example_control", program, "--csv", record, *options],
        input=commands,
        capture_output=True,
        text=True,
        check=False,
    )
    rows = np.genfromtxt(record, delimiter=",", names=True, dtype=None, encoding="utf-8")
    return Run(done.returncode, done.stdout, done.stderr, rows)


@pytest.fixture(scope="session")
def fast_contour(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The contour at F6000: at its own F500 nothing is asked of a machine."""
    file = tmp_path_factory.mktemp("program") / "contour.nc"
    file.write_text(CONTOUR.read_text(encoding="utf-8").replace("F500.0", "F6000.0"), encoding="utf-8")
    return file


@pytest.fixture(scope="session")
def session(built: Path, fast_contour: Path, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Tool changed, then held, the override turned to 50 and 150 % on the long sides, and on behind M01."""
    commands = (
        "at 0.5 resume\nat 3.7 hold\nat 4.7 resume\nat 4.75 override 50\nat 6.4 override 150\nat 7.5 status\n"
        "wait\nresume\n"
    )
    return run(built, fast_contour, commands, tmp_path_factory.mktemp("record") / "run.csv", "--fast")


def speed(of: Run) -> FloatArray:
    found: FloatArray = np.linalg.norm(of.columns("v{}_mm_per_s"), axis=1)
    return found


def at_second(of: Run, seconds: float) -> int:
    return round(seconds / PERIOD_S)


@pytest.mark.parametrize("stage", ["1_set_points", "2_program", "3_threads"])
def test_every_stage_of_the_tutorial_runs(built: Path, stage: str) -> None:
    command(built / stage, *([CONTOUR] if stage == "2_program" else []))


def test_the_program_ends_where_it_says(session: Run) -> None:
    assert session.exit_code == 0, session.said + session.errors
    end = session.columns("{}_mm")[-1]
    assert end.tolist() == [0.0, 65.123, 15.0]
    assert np.abs(session.columns("table_{}_mm")[-1] - end).max() < 0.2  # the drives come to rest after the command
    assert "late plans 0" in session.said
    assert "starved 0" in session.said


def test_spindle_coolant_and_tool_change_come_in_order(session: Run) -> None:
    events = [(row["time_s"], row["events"]) for row in session.rows if row["events"]]
    assert [text for _, text in events] == ["M6", "M3 S2000 M8", "M9 M5"]
    spindle = at_second(session, events[1][0])
    rests = np.all(np.diff(session.columns("{}_mm")[spindle : spindle + 500], axis=0) == 0.0)
    assert rests, "the spindle has half a second to come to speed"


def test_set_points_keep_the_limits(session: Run) -> None:
    positions = session.columns("{}_mm")
    for order, limit in ((1, MAX_SPEED), (2, MAX_ACCELERATION), (3, MAX_JERK)):
        found = np.abs(np.diff(positions, order, axis=0)).max() / PERIOD_S**order
        assert found < limit * (1.0 + 1e-4)
        assert found > 0.5 * limit, "it asks something of the machine"


def test_velocity_and_acceleration_belong_to_the_positions(session: Run) -> None:
    positions = session.columns("{}_mm")
    middle = (positions[2:] - positions[:-2]) / (2.0 * PERIOD_S)
    assert np.abs(session.columns("v{}_mm_per_s")[1:-1] - middle).max() < MAX_JERK * PERIOD_S**2 / 2.0
    second = np.diff(positions, 2, axis=0) / PERIOD_S**2
    assert np.abs(session.columns("a{}_mm_per_s2")[1:-1] - second).max() < MAX_JERK * PERIOD_S


def test_the_path_is_kept(session: Run) -> None:
    """Distance of the set-points to the rounded square in closed form, and what the record says of it."""
    assert np.nanmax(np.abs(session.rows["set_point_off_um"])) < TOLERANCE_UM
    x, y, z = session.columns("{}_mm").T
    is_cut = (session.rows["line"] >= 15) & (session.rows["line"] <= 21) & (z < -5.1)
    beyond = np.abs(np.column_stack([x, y])) - (HALF_MM - RADIUS_MM)
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)
    off_um = 1e3 * (outside - RADIUS_MM)[is_cut]
    assert is_cut.sum() > 2000
    assert np.abs(off_um).max() < TOLERANCE_UM
    assert np.abs(np.abs(session.rows["set_point_off_um"][is_cut]) - np.abs(off_um)).max() < 0.01


def test_a_hold_rests(session: Run) -> None:
    held = slice(at_second(session, 4.0), at_second(session, 4.7))
    assert set(session.rows["activity"][held]) == {"held"}
    assert np.ptp(session.columns("{}_mm")[held], axis=0).max() == 0.0
    assert np.ptp(session.columns("table_{}_mm")[held][-200:], axis=0).max() < 1e-3
    assert speed(session)[at_second(session, 3.7)] > 99.0, "it was moving"


def test_the_override_is_that_of_the_feed(session: Run) -> None:
    """On the straight sides, where neither corner nor acceleration limits."""
    for begin, end, ratio in ((5.0, 5.5, 0.5), (6.7, 6.85, 1.5)):
        rows = slice(at_second(session, begin), at_second(session, end))
        assert set(session.rows["override"][rows]) == {ratio}
        assert np.median(speed(session)[rows]) == pytest.approx(100.0 * ratio, rel=1e-5)


def test_drives_are_the_linear_model(session: Run) -> None:
    """The closed form of the feed drive, driven by what was fed forward: SciPy's exact linear system."""
    for axis, modes in MODES.items():
        drive = _core.FeedDriveParameters(
            motor_mass_kg=150.0,
            table_mass_kg=400.0,
            stiffness_n_per_m=1.2e8,
            damping_n_s_per_m=1e4,
            motor_friction=_core.FrictionParameters(viscous_n_s_per_m=VISCOUS),
            position_gain_per_s=GAIN_PER_S,
            velocity_gain_n_s_per_m=SPEED_GAIN,
            velocity_integral_time_s=INTEGRAL_TIME_S,
            modes=modes,
        )
        a, b, c, d = _core.linear_model(drive)
        rows = session.rows
        start = rows[f"{axis}_mm"][0]
        speeds = rows[f"v{axis}_mm_per_s"]
        force = (MASS_KG * rows[f"a{axis}_mm_per_s2"] + VISCOUS * speeds) / SPEED_GAIN
        decay = math.exp(-PERIOD_S / INTEGRAL_TIME_S)
        integral = lfilter([0.0, 1.0 - decay], [1.0, -decay], force)  # what the speed loop gives by itself
        asked = rows[f"{axis}_mm"] - start + (speeds + force - integral) / GAIN_PER_S
        _, wanted, _ = lsim((a, b, c, d), asked, np.arange(len(asked)) * PERIOD_S)
        assert np.abs(rows[f"table_{axis}_mm"] - start - wanted).max() < 1e-4
        following = np.abs(rows[f"{axis}_mm"] - rows[f"table_{axis}_mm"]).max()
        assert following > 0.002, "there is something to hold"


def test_the_lag_without_feed_forward_is_speed_over_gain(built: Path, fast_contour: Path, tmp_path: Path) -> None:
    found = run(built, fast_contour, "at 0.1 resume\n", tmp_path / "run.csv", "--fast", "--feed-forward", "0")
    side = (found.rows["line"] == 16) & (np.abs(found.rows["y_mm"]) < 5.0)  # the X = -55 side, long under way
    assert side.sum() > 50
    np.testing.assert_allclose(found.rows["vy_mm_per_s"][side], -100.0, rtol=1e-5)
    lag = found.rows["y_mm"][side] - found.rows["table_y_mm"][side]
    # What viscous friction asks of the speed loop is the integral's, which decays by then.
    np.testing.assert_allclose(lag, -100.0 / GAIN_PER_S, rtol=2e-3)


def test_probe_and_what_comes_behind_it(built: Path, fast_contour: Path, tmp_path: Path) -> None:
    """It rests near where it touched, on the path; then a jog and a block of the operator's own."""
    commands = "at 0.1 resume\nat 3.2 probe\nwait\njog z+ 5\nwait\nmdi G90 G01 X0 Y0 F3000\nwait\nstatus\n"
    found = run(built, fast_contour, commands, tmp_path / "run.csv", "--fast")
    assert found.exit_code == 1, "not all of the program was run"
    assert "probe at X" in found.said
    positions = found.columns("{}_mm")
    touched = positions[at_second(found, 3.2)]
    begin = at_second(found, 3.2)
    rests = begin + 1 + int(np.flatnonzero(~np.diff(positions[begin:], axis=0).any(axis=1))[0])
    # Behind the touch: 32 periods or an eighth of the lead, the stop at the limits, and the filters.
    assert np.linalg.norm(positions[rests] - touched) < 100.0 * (0.032 + 0.022 + 0.1)
    assert found.rows["set_point_off_um"][rests] < TOLERANCE_UM
    assert positions[-1].tolist() == pytest.approx([0.0, 0.0, positions[rests][2] + 5.0], abs=1e-9)
    assert np.isnan(found.rows["set_point_off_um"][-1]), "what was no program has no deviation"


def test_flush_in_a_hold_and_abort(built: Path, fast_contour: Path, tmp_path: Path) -> None:
    flushed = run(built, fast_contour, "at 0.1 resume\nat 3.2 hold\nat 3.6 flush\nwait\n", tmp_path / "a.csv", "--fast")
    assert flushed.exit_code == 1
    assert flushed.rows["activity"][-1] == "idle"
    aborted = run(built, fast_contour, "at 0.1 resume\nat 3.2 abort\n", tmp_path / "b.csv", "--fast")
    assert aborted.exit_code == 1
    assert aborted.rows["activity"][-1] == "aborted"
    assert 3.2 < aborted.rows["time_s"][-1] < 3.5
    quitted = run(built, fast_contour, "at 0.1 resume\nat 3.2 quit\n", tmp_path / "c.csv", "--fast")
    assert quitted.rows["activity"][-1] == "aborted", "not from full speed"


def test_by_the_clock_it_is_the_same_path(built: Path, tmp_path: Path) -> None:
    """Threads, deadlines and a queue of rows in between; what it takes is up to the machine, so no time is held."""
    program = tmp_path / "short.nc"
    program.write_text(
        "%\nO1\nG21 G90 G00 X10. Y0 Z90.\nM8\nG01 X30. F6000\nG03 X40. Y10. R10.\nG01 Y30.\nG04 X.1\nM9\nM30\n%\n"
    )
    found = run(built, program, "at 0.3 hold\nat 0.6 resume\n", tmp_path / "run.csv")
    assert found.exit_code == 0, found.said + found.errors
    assert found.columns("{}_mm")[-1].tolist() == [40.0, 30.0, 90.0]
    assert np.nanmax(np.abs(found.rows["set_point_off_um"])) < TOLERANCE_UM
    np.testing.assert_allclose(np.diff(found.rows["time_s"]), PERIOD_S, atol=1e-9)  # no row is lost
    assert [text for text in found.rows["events"] if text] == ["M8", "M9"]
    positions = found.columns("{}_mm")
    assert np.abs(np.diff(positions, 2, axis=0)).max() / PERIOD_S**2 < MAX_ACCELERATION * (1.0 + 1e-4)
    assert "periods" in found.said


def test_a_stop_without_an_operator_ends_the_run(built: Path, fast_contour: Path, tmp_path: Path) -> None:
    """`wait` waits for it, too; where nobody is left to resume the run is over."""
    found = run(built, fast_contour, "wait\nresume\nat 3 hold\n", tmp_path / "run.csv", "--fast")
    assert found.exit_code == 1
    assert "no command will come" in found.said
    assert found.rows["activity"][-1] == "aborted"
    assert found.rows["activity"][at_second(found, 0.1)] == "moving", "the tool is changed at once"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "usage"),
        (["no_such_file.nc"], "cannot be read"),
        (["{bad}"], "line 2: "),
        (["{good}", "--feed-forward", "2"], "--feed-forward: not understood"),
        (["{good}", "--csv", "/no/such/folder/run.csv"], "cannot be written"),
    ],
)
def test_bad_input_is_refused(built: Path, tmp_path: Path, words: list[str], said: str) -> None:
    (tmp_path / "bad.nc").write_text("G21 G90\nG01 XX1\nM30\n")
    (tmp_path / "good.nc").write_text("G21 G90\nG01 X1. F100\nM30\n")
    given = [word.format(bad=tmp_path / "bad.nc", good=tmp_path / "good.nc") for word in words]
    done = subprocess.run(
        [built / "example_control", *given], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert said in done.stderr


def test_lines_that_are_no_commands_do_no_harm(built: Path, tmp_path: Path) -> None:
    program = tmp_path / "good.nc"
    program.write_text("G21 G90\nG01 X1. F600\nM30\n")
    commands = "\n# a comment\nhalt\noverride\njog q+ 1\njog x+\nmdi\nat x hold\nmdi G01 X2.\nwait\nmdi G01 XX\nwait\n"
    found = run(built, program, commands, tmp_path / "run.csv", "--fast")
    assert found.exit_code == 0
    assert found.said.count("not understood") == 6
    assert "only at rest" in found.said
    assert "XX" in found.said


def test_the_tutorial_runs(built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its cells, but for the one that builds: commands by bash, Python here."""
    page = (ROOT / "docs/tutorials/build_a_control.md").read_text(encoding="utf-8")
    (tmp_path / "c").symlink_to(built)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SHAPEGCODE_CONTROL", str(EXAMPLE))
    monkeypatch.setenv("SHAPEGCODE_PROGRAMS", str(CONTOUR.parent))
    said = []
    for cell in CELL.findall(page)[1:]:
        if cell.startswith("%%bash\n"):
            done = subprocess.run(
                ["bash", "-euo", "pipefail", "-c", cell.partition("\n")[2]], capture_output=True, text=True, check=False
            )
            assert done.returncode == 0, done.stderr
            said.append(done.stdout)
        else:
            exec(compile(cell, "build_a_control.md", "exec"), {"__name__": "page"})
    assert len(said) == 5
    off = [float(line.split()[-2]) for line in said[-1].splitlines()]
    assert off[0] > 10.0 * off[1], "what the page says of the lag: the table leaves the path without feed-forward"


def plot_script() -> types.ModuleType:
    spec = importlib.util.spec_from_file_location("plot_run", EXAMPLE / "plot_run.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_record_is_drawn(session: Run, tmp_path: Path) -> None:
    figure = plot_script().plot_run(session.rows)
    figure.savefig(tmp_path / "run.png")
    lag = figure.axes[2].lines[1].get_ydata()
    np.testing.assert_allclose(lag, 1e3 * (session.rows["y_mm"] - session.rows["table_y_mm"]), atol=1e-9)
