"""The 95 % interval of a predicted time, against hand sums and least squares in NumPy; what it was calibrated from."""

import json
import math
from itertools import islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import time_intervals

import shapegcode as sg
from effort import trials
from judge.run_simulator import surface_program, written_program
from shapegcode.cli import main
from shapegcode.timing.calibration.calibrate import _scatters
from shapegcode.timing.calibration.motion import FunctionFit
from shapegcode.timing.calibration.open_times import function_rows, kind_weights, run_scatter
from shapegcode.timing.cycle_time import TimeInterval, time_interval

NONE = {"cuts_percent": 0.0, "between_cuts_s": 0.0, "runs_percent": 0.0}
# Two tool changes, three M08; cuts of T1 and T2.
PROGRAM = (
    "%\nO1\nG21 G17 G90 G94\nT1 M06\nG00 X0. Y0. Z0.\nM08\nG01 X10. F600.\nX20.\nX30.\nT2 M06\nG00 X0. Y0. Z0.\nM08\n"
    "G01 X10. F1200.\nY20.\nX30.\nM08\nM30\n%\n"
)


def machine(rows: list[dict[str, object]], scatter: dict[str, float] | None = None, **times: object) -> sg.Machine:
    """The built-in one with what logs leave open."""
    values = {f"times.{name}": value for name, value in times.items()}
    return sg.Machine.load("vx500").with_values({**values, "times.scatter": scatter or NONE, "times.open": rows})


def half_width(time: sg.CycleTime) -> float:
    """Half of the interval; it lies evenly about the time, and no time is below 0."""
    assert time.total_low_s is not None and time.total_high_s is not None
    half = time.total_high_s - time.cycle_time_s
    assert time.total_low_s == pytest.approx(max(0.0, time.cycle_time_s - half))
    return half


def test_without_calibrated_data_there_is_no_interval() -> None:
    time = sg.cycle_time(PROGRAM, sg.Machine.load("vx500"), full=False)
    assert (time.total_low_s, time.total_high_s, time.interval_parts, time.narrowed_by) == (None, None, (), None)
    assert "±" not in time.answer
    with pytest.raises(sg.ArgumentError, match=r"has no times\.scatter"):
        sg.cycle_time(PROGRAM, sg.Machine.load("vx500"), full=False, log_next=[PROGRAM])


def test_directions_and_scatters_add_by_their_squares() -> None:
    rows: list[dict[str, object]] = [
        {"name": "tool change", "values": ["times.tool_change_s = 4.5"], "weight": 4.0},
        {"name": "M08", "values": ["times.m_codes = { code = [8], s = [1.1] }"]},
    ]
    scatter = {"cuts_percent": 2.0, "between_cuts_s": 0.3, "runs_percent": 1.0}
    codes = {"code": [8], "s": [1.0]}
    time = sg.cycle_time(PROGRAM, machine(rows, scatter, tool_change_s=4.0, m_codes=codes), full=False)
    cuts: dict[int | None, float] = {}
    for region in time.regions:
        cuts[region.tool] = cuts.get(region.tool, 0.0) + region.duration_s
    assert len(cuts) == 2
    # Sections of more than two lines without M, S, T: the head, and the cuts of both tools.
    variances = [(2 * 2 * 0.5) ** 2, (3 * 0.1) ** 2, 3 * 0.3**2, (0.01 * time.cycle_time_s) ** 2]
    variances += [(0.02 * each) ** 2 for each in cuts.values()]
    assert half_width(time) == pytest.approx(1.96 * math.sqrt(sum(variances)), rel=1e-6)
    assert time.interval_parts[0].name == "tool change"
    assert time.interval_parts[0].half_width_s == pytest.approx(1.96 * 2.0)
    assert time.interval_parts[0].share == pytest.approx(4.0 / sum(variances))
    assert sum(part.share for part in time.interval_parts) == pytest.approx(1.0)
    assert "tool change occurs alone" in (time.narrowed_by or "")


@pytest.mark.parametrize("value", [(5.0, 2.0), (5.0, 0.05), (0.1, 2.0)])
def test_correlated_times_give_the_deviation_of_their_sum(value: tuple[float, float]) -> None:
    """Two tool changes and three M08, which the logs tell by their sum: a' C a, also where one is nearly 0."""
    covariance = np.array([[1.0, -0.995], [-0.995, 1.0]]) * 0.5**2
    values = {"tool change": value[0], "M8": value[1]}
    fit = FunctionFit(values, values, values, covariance, False, 0.0)

    def file_values(functions: FunctionFit) -> dict[str, object]:
        return {
            "times.tool_change_s": functions.values["tool change"],
            "times.m_codes": {"code": [8], "s": [functions.values["M8"]]},
        }

    rows = function_rows(fit, file_values, lambda name: name)
    with_rows = machine(rows).with_values(file_values(fit))
    expected = math.sqrt(np.array([2.0, 3.0]) @ covariance @ np.array([2.0, 3.0]))
    assert half_width(sg.cycle_time(PROGRAM, with_rows, full=False)) == pytest.approx(1.96 * expected, rel=1e-3)


def test_a_block_time_that_no_log_showed_costs_small_moves_alone() -> None:
    rows: list[dict[str, object]] = [
        {"name": "time in which a block is read", "values": ["controller.look_ahead_block_time_s = 0.05"]}
    ]
    with_rows = machine(rows).with_values("controller.motion", "look_ahead")
    corners = "\n".join(f"G01 X{20 * (row % 2)}. Y{row}. F1500." for row in range(1, 60))
    long_moves = f"%\nO1\nG21 G17 G90 G94\nG00 X0. Y0. Z0.\n{corners}\nM30\n%\n"
    pockets = sg.cycle_time(long_moves, with_rows, full=False)
    surface = sg.cycle_time(surface_program(1), with_rows, full=False)
    assert half_width(pockets) < 0.002 * pockets.cycle_time_s
    assert half_width(surface) > 0.1 * surface.cycle_time_s
    assert "many moves below 0." in (surface.narrowed_by or "")
    found = sg.cycle_time(surface_program(1), with_rows, full=False, log_next=[long_moves, surface_program(2)])
    assert found.log_next[0].half_width_s < 0.01 * half_width(surface)
    assert found.log_next[1].half_width_s == pytest.approx(half_width(surface), rel=0.1)


def test_what_logging_another_program_leaves_is_that_of_least_squares() -> None:
    generator = np.random.default_rng(3)
    names = [f"p{number}" for number in range(6)]
    one, other = generator.normal(size=(2, 6))
    noise = 0.7
    first = TimeInterval(100.0, 1.0, dict(zip(names, one.tolist(), strict=True)), {"scatter": 0.4})
    second = TimeInterval(90.0, 1.0, dict(zip(names, other.tolist(), strict=True)), {"scatter": noise})
    posterior = np.linalg.inv(np.eye(6) + np.outer(other, other) / noise**2)
    assert first.after_logging(second) == pytest.approx(1.96 * math.sqrt(one @ posterior @ one + 0.4**2))
    assert first.half_width_s == pytest.approx(1.96 * math.sqrt(one @ one + 0.4**2))


def test_kinds_weigh_by_what_they_say_of_runs_left_out() -> None:
    weights = kind_weights([0.2, 0.2, 0.22, 0.4], 0)
    assert sum(weights) == pytest.approx(1.0)
    assert weights[0] == weights[1] and weights[2] == pytest.approx(weights[0] * math.exp(-0.5))
    assert weights[3] < 1e-6


def test_repeated_runs_scatter_by_their_own_mean() -> None:
    generator = np.random.default_rng(5)
    ratios = {f"{program}": (1.03 * (1.0 + 0.004 * generator.normal(size=5))).tolist() for program in range(400)}
    assert run_scatter(ratios) == pytest.approx(0.004, rel=0.05)
    assert run_scatter({"a": [1.1], "b": [0.9]}) == 0.003


def test_tool_changes_that_err_alike_show_in_whole_programs() -> None:
    """Twelve sections, each .1 s late: together they scatter by more than .05 s each."""

    def row(program: str, late_s: float) -> Any:
        kinds = (SimpleNamespace(name="between cuts", measured_s=30.0 + late_s, predicted_s=30.0),)
        return SimpleNamespace(use="fit", program=program, error_percent=0.0, kinds=kinds)

    runs: list[Any] = [SimpleNamespace(cut_sections=range(12))] * 2
    learned: Any = SimpleNamespace(functions=SimpleNamespace(scatter_s=0.05))
    between_s, _ = _scatters([row("a", 1.2), row("b", -1.2)], runs, learned)
    assert between_s == pytest.approx(1.2 / math.sqrt(12.0))
    between_s, _ = _scatters([row("a", 0.1), row("a", -0.1)], runs, learned)
    assert between_s == 0.05


@pytest.fixture
def shop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a program and a calibrated machine."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.nc").write_text(PROGRAM)
    (tmp_path / "other.nc").write_text(PROGRAM.replace("O1", "O2"))
    rows: list[dict[str, object]] = [{"name": "M08", "values": ["times.m_codes = { code = [8], s = [1.5] }"]}]
    (tmp_path / "learned.toml").write_text(machine(rows, m_codes={"code": [8], "s": [1.0]}).to_toml())
    return tmp_path


def test_the_command_says_it_first_and_in_its_json(shop: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["time", "part.nc", "-m", "learned.toml", "--log-next", "other.nc", "--json", "t.json"]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "± 2.9 s" in out.splitlines()[0]  # 1.96 * 3 * 0.5
    assert "to narrow the interval most, log a program in which M08 occurs alone" in out
    found = json.loads((shop / "t.json").read_text())
    assert found["total_high_s"] - found["cycle_time_s"] == pytest.approx(1.96 * 1.5)
    assert found["cycle_time_s"] - found["total_low_s"] == pytest.approx(1.96 * 1.5)
    assert found["interval_parts"] == [
        {"name": "M08", "half_width_s": pytest.approx(2.94), "share": pytest.approx(1.0)}
    ]
    assert found["log_next"] == [{"program": "other.nc", "half_width_s": pytest.approx(0.0, abs=1e-9)}]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('values = ["times.m_codes"]', "must be KEY = VALUE"),
        ('values = ["times.m_kodes = 1"]', "times.m_kodes"),
        ('values = ["times.tool_change_s = -3.0"]', "times.tool_change_s"),
    ],
)
def test_rows_that_are_wrong_are_refused(shop: Path, capsys: pytest.CaptureFixture[str], text: str, said: str) -> None:
    file = shop / "learned.toml"
    lines = file.read_text().splitlines()
    lines = [text if line.startswith('values = ["times') else line for line in lines]
    assert text in lines
    file.write_text("\n".join(lines) + "\n")
    assert main(["time", "part.nc", "-m", "learned.toml"]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.slow
def test_nist_programs_left_out_are_held() -> None:
    """Two of five programs; with all trials each of them."""
    assert time_intervals.report("NIST", list(islice(time_intervals.nist(), trials(8))))


@pytest.mark.slow
def test_programs_of_simulated_controls_are_held() -> None:
    """Some of the twenty of the benchmark; each third one leaves out a surface."""
    rows = [time_intervals.simulated(seed, ("speed difference", "speed difference, block time")) for seed in (1, 2, 3)]
    assert all(row.held == 1.0 for row in rows)
    assert min(row.half_width_percent for row in rows) < 3.0


def test_the_interval_of_a_written_machine_is_that_of_the_result(tmp_path: Path) -> None:
    """Rows with tables in them, through the file and back."""
    rows: list[dict[str, object]] = [
        {"name": "corner", "values": ["controller.corner_speed_difference_mm_per_min = { x = 1.0, y = 1.0, z = 2.0 }"]}
    ]
    before = machine(rows).with_values("controller.motion", "look_ahead")
    file = tmp_path / "m.toml"
    file.write_text(before.to_toml())
    program = sg.Program.from_text(written_program(1), before)
    one, other = (time_interval(program, each, 1.0, 1.0) for each in (before, sg.Machine.load(file)))
    assert one is not None and one == other and one.half_width_s > 0.0


def test_a_weight_beyond_reason_is_refused() -> None:
    rows: list[dict[str, object]] = [{"name": "M08", "values": ["times.tool_change_s = 3.0"], "weight": 1e300}]
    with pytest.raises(sg.ShapegcodeError, match=r"times\.open\.1\.weight = 1e\+300: must be 1000000000\.0 or less"):
        machine(rows)
