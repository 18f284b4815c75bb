"""A machine learned from logs of NIST's test bed, against published times of runs it never saw (evidence.md)."""

import dataclasses
import statistics
from pathlib import Path

import pytest
from evidence_nist import (
    NIST,
    learned_machines,
    left_out,
    log_name,
    nist_runs,
    plot_evidence,
    prediction_rows,
    published,
)

import shapegcode as sg
from effort import trials
from shapegcode.results import plot


@pytest.fixture(scope="module")
def learned() -> sg.CycleTimeCalibration:
    """One kind of look-ahead, one run of BOX OP3; OP2 left out."""
    runs = nist_runs({"BOX_OP3": (3,)}, "BOX_OP2")
    return sg.calibrate_cycle_time(runs, sg.Machine.load("vx500"), families=["speed difference"])


def test_the_data_come_with_the_package() -> None:
    assert (NIST / "NOTICE.md").is_file() and len(list((NIST / "logs").glob("*.txt.gz"))) == 15
    assert sum(file.stat().st_size for file in NIST.parent.rglob("*") if file.is_file()) < 1e6


def test_op2_from_one_run_of_op3_is_within_2_percent_of_what_was_published(learned: sg.CycleTimeCalibration) -> None:
    times = published()["BOX_OP2"]
    assert len(left_out(learned)) == 4  # of five runs one was held
    for run in left_out(learned):
        truth = min(times, key=lambda each: abs(each - (run.measured_s or 0.0)))
        assert run.measured_s == pytest.approx(truth, abs=0.01)
        assert run.predicted_s == pytest.approx(truth, rel=0.02)
        # Four dials, four times: a time that ignores them cannot be within 2 % of all.
        for tool in run.tools:
            assert tool.predicted_s == pytest.approx(tool.measured_s, rel=0.05), tool.name
        assert sum(tool.predicted_s for tool in run.tools) == pytest.approx(run.predicted_s, abs=1e-6)
        assert sum(tool.measured_s for tool in run.tools) == pytest.approx(truth, abs=0.01)
    assert max(times) / min(times) > 1.04


def test_the_written_machine_says_the_same_at_the_dial_that_was_set(learned: sg.CycleTimeCalibration) -> None:
    program = sg.Program.read(NIST / "programs" / "BOX_OP2.NC", learned.fitted)
    said = sg.cycle_time(program, learned.fitted, feed_override=1.01, full=False).cycle_time_s
    usual = statistics.median(published()["BOX_OP2"])  # most were run at about 101 %
    assert said == pytest.approx(usual, rel=0.02)
    before = sg.cycle_time(sg.Program.read(NIST / "programs" / "BOX_OP2.NC", "vx500"), "vx500", full=False)
    assert before.cycle_time_s < 0.7 * usual


def test_a_prediction_that_is_wrong_is_out_of_its_limit(learned: sg.CycleTimeCalibration) -> None:
    rows = list(prediction_rows("OP3", learned))
    assert [within for cells, within in rows if cells[1].startswith("BOX_OP2")] == [True] * 4
    assert {"T3", "T21", "cuts", "between cuts"} <= {cells[1] for cells, _ in rows}
    slow = tuple(dataclasses.replace(run, predicted_s=1.03 * run.predicted_s) for run in learned.runs)
    wrong = prediction_rows("OP3", dataclasses.replace(learned, runs=slow))
    assert [within for cells, within in wrong if cells[1].startswith("BOX_OP2")] == [False] * 4


def test_a_held_run_is_not_counted(learned: sg.CycleTimeCalibration) -> None:
    held = [log_name(run) for run in learned.runs if run.held_s]
    assert held == ["BOX_OP2-run2"]
    assert not {*held} & {log_name(run) for run in left_out(learned)}


def test_picture_has_a_row_for_each_run(learned: sg.CycleTimeCalibration) -> None:
    panel = plot_evidence({"OP3": learned}, plot.axes(None))
    assert len(panel.get_yticks()) == len(learned.runs)


@pytest.mark.slow
def test_every_program_left_out_is_predicted() -> None:
    for title, found in learned_machines(trials(3)).items():
        assert [cells for cells, within in prediction_rows(title, found) if not within] == []
        for run in left_out(found):
            times = published()[Path(run.program).stem]
            assert min(abs(time - (run.measured_s or 0.0)) for time in times) < 0.01
