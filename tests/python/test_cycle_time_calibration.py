"""Cycle-time models calibrated with logs, held against simulated controls whose facts are known."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest

import shapegcode as sg
from judge.run_simulator import HiddenControl, written_program

ONE = ["speed difference"]


def shop(folder: Path, control: HiddenControl, fit: list[int], test: list[int], runs: int = 1) -> Path:
    """A folder with programs, logs and a file of runs."""
    rows = []
    for seed, use in [*((each, "fit") for each in fit), *((each, "test") for each in test)]:
        text = written_program(seed)
        (folder / f"p{seed}.nc").write_text(text)
        for run in range(runs):
            (folder / f"p{seed}-{run}.txt").write_text(control.run(text, seed=10 * seed + run)[0])
        rows.append(f'[[runs]]\nprogram = "p{seed}.nc"\nlog = "p{seed}-*.txt"\nuse = "{use}"\n')
    file = folder / "RUNS.toml"
    file.write_text("\n".join(rows))
    return file


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> tuple[sg.CycleTimeCalibration, HiddenControl]:
    """Learned from two programs; a third one is predicted."""
    control = HiddenControl()
    file = shop(tmp_path_factory.mktemp("shop"), control, [1, 2], [3])
    return sg.calibrate_cycle_time(file, sg.Machine.load("vx500"), families=ONE), control


def test_a_program_that_it_was_not_fitted_to_takes_what_it_says(
    learned: tuple[sg.CycleTimeCalibration, HiddenControl],
) -> None:
    clock, _ = learned
    run = next(run for run in clock.runs if run.use == "test")
    assert abs(run.predicted_s / run.measured_s - 1.0) < 0.02
    assert run.low_s < run.measured_s < run.high_s
    assert run.held_s == 0.0
    assert {share.name for share in run.tools} == {"T1", "T2"}
    for share in (*run.tools, *run.kinds):
        assert abs(share.error_percent) < 5.0, share
    assert sum(share.measured_s for share in run.tools) == pytest.approx(run.measured_s, abs=1e-6)


def test_what_the_runs_tell_is_what_the_control_does(learned: tuple[sg.CycleTimeCalibration, HiddenControl]) -> None:
    clock, control = learned
    machine = clock.fitted
    numbers = {(number.key, number.meaning): number for number in clock.numbers}
    truth = {
        "acceleration of X and Y": control.acceleration,
        "speed step of X and Y at a corner": control.corner_step * 60.0,
        "tool change": control.tool_change,
    }
    for (_, meaning), number in numbers.items():
        if meaning in truth and number.is_determined:
            assert number.low <= truth[meaning] <= number.high, number
    assert machine.axes.x.rapid_mm_per_min == pytest.approx(control.rapid * 60.0, rel=0.02)
    assert machine.times.tool_change_s == pytest.approx(control.tool_change, abs=0.6)
    assert machine.controller.corner_rule == "speed_difference"


def test_the_machine_file_times_as_the_result_says(
    learned: tuple[sg.CycleTimeCalibration, HiddenControl], tmp_path: Path
) -> None:
    """What is written is what was judged: `time` on the file, a path of its own through the code."""
    clock, _ = learned
    file = tmp_path / "learned.toml"
    file.write_text(clock.to_toml())
    machine = sg.Machine.load(file)
    run = next(run for run in clock.runs if run.use == "test")
    timed = sg.cycle_time(run.program, machine)
    assert timed.cycle_time_s == pytest.approx(run.predicted_s, rel=2e-3)
    assert abs(timed.difference_percent or 0.0) < 0.5
    assert timed.total_low_s is not None and timed.total_high_s is not None
    assert timed.total_high_s - timed.total_low_s == pytest.approx(run.high_s - run.low_s, rel=5e-3)
    assert timed.total_low_s < (run.measured_s or 0.0) < timed.total_high_s
    # A row for each parameter, and one for the block time that this kind does not have.
    meanings = [number.meaning for number in clock.numbers if number.key != "axes.x|y|z.rapid_mm_per_min"]
    names = {row.name for row in machine.times.open}
    assert names - {"time in which a block is read"} <= set(meanings)
    assert "time in which a block is read" in names


@pytest.mark.slow
def test_overrides_and_units_are_read_off_the_feed(tmp_path: Path) -> None:
    control = HiddenControl(override=0.8, feed_factor=60.0 / 25.4)
    clock = sg.calibrate_cycle_time(shop(tmp_path, control, [1, 2], [3]), sg.Machine.load("vx500"), families=ONE)
    for run in clock.runs:
        assert run.feed_override == pytest.approx(0.8, abs=0.005)
    assert clock.fitted.times.feed_override_percent == pytest.approx(80.0, abs=0.5)
    test = next(run for run in clock.runs if run.use == "test")
    assert abs(test.error_percent or 99.0) < 2.0


@pytest.mark.slow
def test_a_hold_is_found_and_left_out(tmp_path: Path) -> None:
    control = HiddenControl()
    file = shop(tmp_path, control, [1, 2], [])
    log = tmp_path / "p2-0.txt"
    rows = log.read_text().splitlines()
    at = len(rows) // 3
    held = [row if index < at else later(row, 17.0) for index, row in enumerate(rows)]
    log.write_text("\n".join(held) + "\n")
    clock = sg.calibrate_cycle_time(file, sg.Machine.load("vx500"), families=ONE)
    run = next(run for run in clock.runs if run.log.endswith("p2-0.txt"))
    assert run.held_s == pytest.approx(17.0, abs=1.0)
    assert abs(run.error_percent or 99.0) < 2.0
    assert any("hold at" in warning for warning in clock.warnings)


def later(row: str, seconds: float) -> str:
    """A line of a log so much later; within the same hour."""
    stamp, _, rest = row.partition("|")
    day, _, clock = stamp.rstrip("Z").partition("T")
    hours, minutes, secs = clock.split(":")
    whole = int(minutes) * 60 + float(secs) + seconds
    return f"{day}T{hours}:{int(whole // 60):02d}:{whole % 60:07.4f}Z|{rest}"


def other_program(folder: Path) -> None:
    (folder / "p1-0.txt").write_text(HiddenControl().run(written_program(7, tools=1))[0])


def shorter_program(folder: Path) -> None:
    text = written_program(1).splitlines()
    (folder / "p1.nc").write_text("\n".join([*text[:20], "M30", "%"]) + "\n")


def without_lines(folder: Path) -> None:
    log = folder / "p1-0.txt"
    log.write_text("\n".join(row for row in log.read_text().splitlines() if "Block_Number" not in row) + "\n")


def few_readings(folder: Path) -> None:
    log = folder / "p1-0.txt"
    log.write_text(HiddenControl(poll=30.0).run(written_program(1))[0])


def broken_off(folder: Path) -> None:
    log = folder / "p1-0.txt"
    rows = log.read_text().splitlines()
    half = rows[: len(rows) // 2]
    stamp = half[-1].partition("|")[0]
    log.write_text("\n".join([*half, f"{stamp}|Program_Status|PROGRAM_COMPLETED"]) + "\n")


def unit_of_another(folder: Path) -> None:
    file = folder / "RUNS.toml"
    file.write_text(file.read_text() + 'feed_unit = "mm/s"\n')  # the log shows mm/min


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (other_program, "do not belong together|another program"),
        (shorter_program, "do not belong together"),
        (without_lines, "Block_Number|block"),
        (few_readings, "reports|readings|lines"),
        (broken_off, "completed at line .* s before its end"),
        (unit_of_another, "mm/s that would not be an override.*feed_unit"),
    ],
)
def test_what_does_not_belong_together_is_refused(spoil: Callable[[Path], None], said: str, tmp_path: Path) -> None:
    file = shop(tmp_path, HiddenControl(), [1], [])
    spoil(tmp_path)
    with pytest.raises(sg.ShapegcodeError, match=said):
        sg.calibrate_cycle_time(file, sg.Machine.load("vx500"), families=ONE)


@pytest.mark.slow
def test_a_log_that_begins_in_the_middle_is_no_whole_run(tmp_path: Path) -> None:
    file = shop(tmp_path, HiddenControl(), [1, 2], [])
    log = tmp_path / "p2-0.txt"
    rows = log.read_text().splitlines()
    stamp = rows[len(rows) // 2].partition("|")[0]
    log.write_text("\n".join([f"{stamp}|Program_Status|ACTIVE", *rows[len(rows) // 2 :]]) + "\n")
    clock = sg.calibrate_cycle_time(file, sg.Machine.load("vx500"), families=ONE)
    run = next(run for run in clock.runs if run.log.endswith("p2-0.txt"))
    assert run.measured_s is None
    assert any("in the middle of the program" in note for note in run.notes)
    other = next(run for run in clock.runs if run.log.endswith("p1-0.txt"))
    assert abs(other.error_percent or 99.0) < 2.0


@pytest.mark.slow
def test_the_kind_of_look_ahead_is_chosen_by_runs_left_out(tmp_path: Path) -> None:
    control = HiddenControl()
    file = shop(tmp_path, control, [1, 2], [])
    kinds = ["speed difference", "after interpolation"]
    clock = sg.calibrate_cycle_time(file, sg.Machine.load("vx500"), families=kinds)
    scores = {family.name: family.cross_validated_s for family in clock.families}
    assert set(scores) == set(kinds)
    assert None not in scores.values()
    assert clock.family == "speed difference"
    assert all(run.cross_validated_s is not None for run in clock.runs)


def test_unknown_kinds_and_nothing_to_fit_are_refused(tmp_path: Path) -> None:
    file = shop(tmp_path, dataclasses.replace(HiddenControl()), [], [1])
    machine = sg.Machine.load("vx500")
    with pytest.raises(sg.ArgumentError, match="nothing to calibrate with"):
        sg.calibrate_cycle_time(file, machine, families=ONE)
    with pytest.raises(sg.ArgumentError, match="must be one of speed difference"):
        sg.calibrate_cycle_time(file, machine, families=["trapezium"])
