"""`shapegcode characterize`: programs that stay in their box, and fits held against controllers with hidden facts."""

import json
import math
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from subprocess import CompletedProcess

import jsonschema
import numpy as np
import pytest
from characterization_figures import deviations

import shapegcode as sg
from command import run
from judge.characterization import controllers, fill_in_logs, fill_in_times, write_csv
from judge.controller_simulator import Hidden, play, servo_log
from shapegcode.characterization.air_tests import (
    AirBox,
    ControllerTiming,
    Part,
    make_tests,
    part_time_s,
    program_time_s,
)
from shapegcode.characterization.programs import program_text, read_sheet
from shapegcode.characterization.result import ControllerFact
from shapegcode.io.servo_log import parse_units, read_log
from shapegcode.model.machine_model import fanuc_model
from shapegcode.results.json import schema

MACHINE = sg.Machine.load("vx500")
BOXES = ["0:100,0:100,0:20", "-50:50,-80:0,-5:30", "0:40,-40:0,0:10", "-300:0,0:250,0:200"]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("characterize") / "tests"
    sg.write_characterization_tests(folder, MACHINE)
    return folder


@pytest.fixture
def folder(written: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(written, tmp_path / "tests"))


def shell(*words: str | Path) -> CompletedProcess[str]:
    return run(Path.cwd(), *words)


def by_name(findings: Sequence[ControllerFact]) -> dict[str, ControllerFact]:
    return {each.quantity: each for each in findings}


def extremes(text: str) -> tuple[list[float], list[float], list[float]]:
    """Smallest, largest and last place of each axis, by adding up the words: nothing else moves in these programs."""
    at, low, high = [0.0] * 3, [0.0] * 3, [0.0] * 3
    for line in re.sub(r"\([^)]*\)", "", text).splitlines():
        for axis, value in re.findall(r"([XYZ])(-?\d*\.\d*)", line):
            k = "XYZ".index(axis)
            at[k] += float(value)
            low[k], high[k] = min(low[k], at[k]), max(high[k], at[k])
    return low, high, at


@pytest.mark.parametrize("text", BOXES)
def test_every_program_stays_in_its_box_and_comes_back(text: str) -> None:
    box = AirBox.parse(text)
    for test in make_tests(MACHINE, box):
        program = program_text(test, box, MACHINE)
        low, high, end = extremes(program)
        assert all(a >= b - 1e-6 for a, b in zip(low, box.low, strict=True)), test.name
        assert all(a <= b + 1e-6 for a, b in zip(high, box.high, strict=True)), test.name
        assert end == pytest.approx([0.0] * 3, abs=1e-6), test.name
        # the smoothed motion too, whatever the controller
        points, _ = play(program, Hidden(period_s=0.004, time_constant_s=0.1))
        assert (points.min(axis=0) >= np.array(box.low) - 1e-6).all()
        assert (points.max(axis=0) <= np.array(box.high) + 1e-6).all()


def test_programs_are_plain_fanuc_that_shapegcode_reads(written: Path) -> None:
    programs = sorted(written.glob("*.nc"))
    assert len(programs) > 30
    for file in programs:
        text = file.read_text()
        lines = text.splitlines()
        assert lines[0] == lines[-1] == "%" and lines[-2] == "M30" and lines[1].startswith(f"{file.stem}(")
        assert max(map(len, lines)) < 60 and text == text.upper() and text.isascii()
        codes = set(re.findall(r"[GMST]\d+", re.sub(r"\([^)]*\)", "", text)))
        assert codes <= {"G00", "G01", "G04", "G17", "G21", "G61", "G64", "G90", "G91", "G94", "M30"}
        assert all(re.fullmatch(r"F\d+\.\d?", word) for word in re.findall(r"F[\d.]+", re.sub(r"\(.*\)", "", text)))
        assert "BOX" in text and " S IN TOTAL" in text
        sg.Program.read(str(file), MACHINE)


def test_stopwatch_tests_are_short_enough_and_long_enough() -> None:
    tests = [test for test in make_tests(MACHINE, AirBox()) if test.kind == "stopwatch"]
    assert sum(program_time_s(test, ControllerTiming.of(MACHINE)) for test in tests) < 15 * 60
    # 5 % of the shortest time constant that is claimed, 20 ms, is ten times the rounding of 0.1 s over the moves
    stops = next(test for test in tests if test.name == "stop_below").parts[0].count
    assert 0.05 * 0.020 * stops >= 2 * 0.05


def test_feeds_stay_below_the_limits_of_a_slow_machine(tmp_path: Path) -> None:
    slow = MACHINE.with_values("axes.y.max_feed_mm_per_min", 900.0)
    feeds = [part.feed_mm_per_min for t in make_tests(slow, AirBox()) for part in t.parts if part.pattern != "rapid"]
    assert max(feeds) <= 450.0


@pytest.mark.parametrize(("block_end", "override"), [("ceil", 1.0), ("ceil", 0.5), ("carry", 1.0), ("carry", 1.2)])
def test_expected_times_are_those_of_an_independent_controller(block_end: str, override: float) -> None:
    hidden = Hidden(period_s=0.002, block_end=block_end, block_time_s=0.006, in_position_s=(0.03, 0.04, 0.1))
    ramps, bells = dict.fromkeys("XYZ", 0.15), dict.fromkeys("XYZ", 0.0)
    timing = ControllerTiming(0.002, block_end, 0.006, 0.05, ramps, bells, {"X": 0.03, "Y": 0.04, "Z": 0.1})
    for test in make_tests(MACHINE, AirBox()):
        _, seconds = play(program_text(test, AirBox(), MACHINE), hidden, override, positions=False)
        mine = sum(part_time_s(part, timing, override) for part in test.parts)
        # each run ends on a tick
        assert mine == pytest.approx(seconds, abs=0.002 * (1 + len(test.parts))), test.name


@pytest.mark.parametrize("length", [1.0, 7.3, 20.0, 95.0])
def test_rapids_and_runs_agree_with_the_core(length: float) -> None:
    timing, model = ControllerTiming.of(MACHINE), fanuc_model(MACHINE)
    part = Part("rapid", "X", 1, length, MACHINE.axes.x.rapid_mm_per_min)
    moving = part_time_s(part, timing) - timing.in_position_s["X"]
    assert moving == pytest.approx(sg._core.rapid_time_s([length, 0.0, 0.0], model), abs=1e-9)
    run = Part("continuous", "X", 6, length, 3000.0)
    model.motion = sg._core.MotionKind.after_interpolation
    core = sg._core.block_overlap_time_s(np.full(6, length), np.full(6, 50.0), model)
    assert part_time_s(run, timing) == pytest.approx(core, abs=1e-9)


PUBLISHED_LOG = re.compile(r"block time|in-position time|cutting (time constant|bell)|rapid (time constant|bell time)")
PUBLISHED_WATCH = re.compile(r"block time|in-position time|cutting time constant|rapid time constant [XY]")


@pytest.mark.slow
def test_logs_give_the_hidden_truth_within_2_percent() -> None:
    # The documented figures come from more draws: tests/benchmarks/characterization_figures.py.
    found, wrong = deviations(range(5), log=True)
    assert wrong == []
    for each in found:
        if PUBLISHED_LOG.match(each.quantity) and each.value is not None and each.truth > 0.0:
            assert each.relative <= 0.02, each
    known = [each for each in found if each.value is not None]
    assert sum(each.covered for each in known) >= 0.95 * len(known)
    assert len(known) >= 0.95 * len(found)


@pytest.mark.slow
def test_stopwatch_times_give_the_hidden_truth_within_5_percent() -> None:
    found, wrong = deviations(range(10), log=False)
    assert wrong == []
    for each in found:
        if PUBLISHED_WATCH.match(each.quantity) and each.value is not None:
            assert each.relative <= 0.05, each
    known = [each for each in found if each.value is not None]
    assert sum(each.covered for each in known) >= 0.95 * len(known)


def test_one_log_and_one_stopwatch_fit(folder: Path) -> None:
    ((_, hidden, rng),) = controllers([7])
    fill_in_times(folder, hidden, rng)
    fill_in_logs(folder, hidden, rng)
    result = sg.characterize(folder, MACHINE)
    assert result.warnings == ()
    found = by_name(result.findings)
    assert found["interpolation period"].value == hidden.period_s
    assert found["block end"].value == hidden.block_end
    assert found["cutting time constant"].value == pytest.approx(hidden.time_constant_s, rel=0.02)
    assert not any("contradicts" in each.note for each in result.findings)
    machine = result.fitted
    assert sg.Machine.from_toml(result.to_toml()) == machine
    assert machine.controller.bell_time_s == pytest.approx(hidden.bell_s, rel=0.02)
    assert machine.controller.in_position_s.z == pytest.approx(hidden.in_position_s[2], rel=0.02)
    assert machine.controller.motion == MACHINE.controller.motion


def test_feed_control_interval_is_that_of_a_brute_force_filter(folder: Path) -> None:
    hidden = Hidden(time_constant_s=0.08)
    rng = np.random.default_rng(3)
    test = read_sheet(folder / "RESULTS.toml").tests["log_feed_steps"]
    write_csv(folder / "log_feed_steps.csv", servo_log((folder / test.program).read_text(), hidden, rng))
    found = by_name(sg.characterize(folder / "log_feed_steps.csv", MACHINE).findings)["feed-control interval at F3000"]
    followed = []
    for part in test.parts:
        if part.pattern != "feed_steps":
            continue
        fast, slow = (math.ceil(part.length_mm / v / 1e-4 - 1e-6) for v in (50.0, 25.0))
        speed = np.tile(np.r_[np.full(fast, 50.0), np.full(slow, 25.0)], 6)
        smooth = np.convolve(speed, np.full(800, 1 / 800), mode="valid")
        if np.ptp(smooth) >= 0.9 * 25.0:
            followed.append(part.length_mm)
    assert found.value == min(followed)
    assert found.low is not None and 0.0 < found.low < min(followed)


@pytest.mark.slow
def test_a_control_that_waits_before_a_dwell_is_noticed(folder: Path) -> None:
    hidden = Hidden(dwell_waits_in_position=True)
    fill_in_logs(folder, hidden, np.random.default_rng(5), actual=False)
    found = by_name(sg.characterize(folder, MACHINE).findings)
    assert str(found["in-position wait before a dwell"].value).startswith("yes")
    assert found["in-position time X"].value == pytest.approx(0.025, rel=0.02)
    assert found["position gain"].value is None


def test_few_times_leave_the_rest_unknown(folder: Path) -> None:
    text = (folder / "RESULTS.toml").read_text().replace("reaction_s = 0.1", "reaction_s = 0.0")
    for name, value in (("overhead", 10.3), ("blocks_tiny", 10.4)):
        text = re.sub(rf"(\[tests\.{name}\][^\[]*times_s = )\[\]", rf"\g<1>[{value}]", text)
    (folder / "RESULTS.toml").write_text(text)
    found = by_name(sg.characterize(folder, MACHINE).findings)
    for quantity in ("interpolation period", "in-position time X", "rapid time constant X"):
        assert found[quantity].value is None and found[quantity].note
    assert found["block time"].value == pytest.approx(0.005, rel=0.15)


def test_a_time_that_contradicts_the_others_is_named(folder: Path, tmp_path: Path) -> None:
    fill_in_times(folder, Hidden(), np.random.default_rng(1))
    text = (folder / "RESULTS.toml").read_text()
    text = re.sub(r"(\[tests\.run_above\][^\[]*times_s = \[)([\d.]+)", r"\g<1>60.0", text)
    (folder / "RESULTS.toml").write_text(text)
    done = shell("characterize", "--fit", folder, "-m", "vx500", "--json", tmp_path / "fit.json")
    line = next(n for n, each in enumerate(text.splitlines(), 1) if each.startswith("[tests.run_above]"))
    assert done.returncode == 1
    assert "CONTRADICTIONS" in done.stdout and "next: repeat the tests" in done.stdout
    report = json.loads((tmp_path / "fit.json").read_text())
    assert report["ok"] is False
    assert any(f"RESULTS.toml:{line}: run_above: 60.00 s" in each for each in report["warnings"])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("times_s = []", "times_s = [-3.0]", ":11: tests.overhead.times_s.1 = -3.0: must be greater than 0"),
        ("times_s = []", 'times_s = "34"', ':11: tests.overhead.times_s = "34": must be a list'),
        ("times_s = []", "time_s = [34]", ":11: tests.overhead.time_s = [34]: unknown key"),
        ("resolution_s = 0.1", "resolution_s = 0", ":5: resolution_s = 0: must be 1e-06 or more (unit: s)"),
        ('pattern = "dwell"', 'pattern = "dwel"', 'tests.stop_below.parts.1.pattern = "dwel": must be "pause", '),
        ("feed_mm_per_min = 3000.0", "feed_mm_per_min = 0.0", "feed_mm_per_min = 0.0: must not be 0 with motion"),
        ('"O7001.nc"', '"7001.nc"', ':9: tests.overhead.program = "7001.nc": malformed; as'),
        ('log = ""', 'log = "gone.csv"', "tests.log_cutting.log = gone.csv: no such file"),
        ("[tests.overhead]", "[tests.overhead", "RESULTS.toml:8: "),
        ("", "", "nothing was measured"),
    ],
)
def test_bad_results_are_named_with_their_place(folder: Path, old: str, new: str, said: str) -> None:
    file = folder / "RESULTS.toml"
    file.write_text(file.read_text().replace(old, new, 1))
    done = shell("characterize", "--fit", file, "-m", "vx500")
    assert done.returncode == 2
    assert said in done.stderr and "RESULTS.toml" in done.stderr and "Traceback" not in done.stderr


GOOD_ROWS = "".join(f"{k},{k * 0.01:.3f}\n" for k in range(200))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no rows of numbers"),
        ("a,b\n1,2\n", "no header"),
        ("time_ms,X_act\n" + GOOD_ROWS, "only actual positions"),
        ("time_ms,X\n" + GOOD_ROWS.replace("50,0.500", "49,0.500"), ":52: time 49 does not come after 49"),
        ("time_ms,X\n" + GOOD_ROWS.replace("50,0.500", "50,abc"), ":52: column 2 (X) 'abc' is not a finite number"),
        ("time_ms,X\n" + GOOD_ROWS.replace("50,0.500", "50"), ":52: 1 cells, column 2 (X) is missing"),
        ("time_ms,X\n" + re.sub(r"5[012],0\.5[012]0\n", "", GOOD_ROWS), "rows are missing"),
        ("time_ms,X\n1,0\n2,0\n", "2 rows of numbers: too short; "),
        ("time_s,X\n" + GOOD_ROWS, "from 0.02 to 50 ms"),
        ("time_ms,X\n" + GOOD_ROWS, "no commanded position of Y"),
    ],
)
def test_bad_logs_are_named_with_their_place(folder: Path, text: str, said: str) -> None:
    (folder / "log_exact.csv").write_text(text)
    done = shell("characterize", "--fit", folder, "-m", "vx500")
    assert done.returncode == 2
    assert said in done.stderr and "log_exact.csv" in done.stderr and "Traceback" not in done.stderr


def test_the_log_of_another_test_is_refused(folder: Path) -> None:
    fill_in_logs(folder, Hidden(), np.random.default_rng(2), actual=False)
    shutil.copy(folder / "log_exact.csv", folder / "log_cutting.csv")
    with pytest.raises(sg.ShapegcodeError, match=r"log_cutting\.csv"):
        sg.characterize(folder, MACHINE)


@pytest.mark.parametrize(
    ("head", "delimiter", "scale", "units"),
    [
        ("Time [ms];X cmd [um];X act [um]", ";", (1.0, 1000.0), None),
        ("t_s\tX_command_mm\tXa", "\t", (0.001, 1.0), None),
        ("TIME,X,X_FB", ",", (1.0, 1.0), None),
        ("time x xact", " ", (1.0, 1000.0), parse_units("ms,um")),
        ("Logger 7\n\nZeit;X_soll;X_ist\n[ms];[µm];[µm]", ";", (1.0, 1000.0), None),
        ("t_s,X_in,X_act_in", ",", (0.001, 1.0 / 25.4), None),
    ],
)
def test_logs_are_read_whatever_their_columns_are_called(
    tmp_path: Path, head: str, delimiter: str, scale: tuple[float, float], units: tuple[float, float] | None
) -> None:
    rows = [
        delimiter.join(f"{v:.6g}" for v in (k * scale[0], k * 0.01 * scale[1], k * 0.009 * scale[1]))
        for k in range(150)
    ]
    body = "\n".join([head, *rows])
    (tmp_path / "log.csv").write_text(body.replace(".", ",") if delimiter == ";" else body)
    log = read_log(tmp_path / "log.csv", units)
    assert log.sampling_s == pytest.approx(0.001)
    assert log.command_mm[100, 0] == pytest.approx(1.0)
    assert log.actual_mm is not None and log.actual_mm[100, 0] == pytest.approx(0.9)
    assert np.isnan(log.command_mm[:, 1]).all()


def test_the_command_writes_once_and_fits(tmp_path: Path) -> None:
    done = shell("characterize", "--write", tmp_path / "t", "-m", "vx500", "--json", tmp_path / "w.json")
    assert (done.returncode, done.stderr) == (0, "")
    assert "next: read" in done.stdout
    report = json.loads((tmp_path / "w.json").read_text())
    jsonschema.validate(report, schema(sg.CharacterisationTests))
    assert len(report["tests"]) > 30
    assert report["tests"][0] == {
        "name": "overhead", "program": "O7001.nc", "kind": "stopwatch", "override_percent": 100, "expected_s": 10.0,
        "purpose": "TIME OF START AND END OF A PROGRAM",
    }  # fmt: skip
    again = shell("characterize", "--write", tmp_path / "t", "-m", "vx500")
    assert again.returncode == 2 and "may contain results" in again.stderr
    fill_in_times(tmp_path / "t", Hidden(), np.random.default_rng(4))
    done = shell("characterize", "--fit", tmp_path / "t", "-m", "vx500", "-o", tmp_path / "m.toml", "--json", "-")
    assert (done.returncode, done.stderr) == (0, "")
    report = json.loads(done.stdout)
    jsonschema.validate(report, schema(sg.Characterisation))
    assert report["warnings"] == []
    assert report["output"] == str(tmp_path / "m.toml")
    assert report["next_step"] == f"shapegcode machine show {tmp_path / 'm.toml'} explains it"
    assert report["files"] == [str(tmp_path / "t" / "RESULTS.toml")]
    sum_of_both = next(each for each in report["findings"] if each["quantity"] == "cutting time constant + bell time")
    assert sum_of_both["key"] == "controller.time_constant_s"
    assert sum_of_both["assumed"] == MACHINE.controller.time_constant_s
    assert sum_of_both["low"] < sum_of_both["value"] < sum_of_both["high"]
    assert sg.Machine.load(tmp_path / "m.toml").controller.time_constant_s == pytest.approx(0.05, rel=0.05)
    assert "measured (stopwatch)" in (tmp_path / "m.toml").read_text()


def test_the_tables_fit_a_terminal(folder: Path) -> None:
    fill_in_times(folder, Hidden(), np.random.default_rng(4))
    found = sg.characterize(folder / "RESULTS.toml", MACHINE)
    assert repr(found).startswith("<Characterisation: ") and " of VX500 are known" in found.answer
    text = str(found.tables()[0])
    assert max(map(len, text.splitlines())) <= 80
    assert re.search(r"^block time +[\d.]+\sms +[\d.]+\s\.\.\.\s[\d.]+ +5  stopwatch", text, re.MULTILINE)


@pytest.mark.parametrize("box", ["0:100", "10:100,0:100,0:20", "0:0,0:100,0:20", "a:b,0:1,0:1", "0:0.1,0:100,0:20"])
def test_a_bad_box_is_refused(tmp_path: Path, box: str) -> None:
    done = shell("characterize", "--write", tmp_path / "t", "-m", "vx500", f"--box={box}")
    assert done.returncode == 2 and "--box" in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "t").exists()
