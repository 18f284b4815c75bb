"""``shapegcode demo evidence``: a machine learned from logs of NIST, against published times of runs it never saw."""

from __future__ import annotations

import csv
import dataclasses
import json
import statistics
from pathlib import Path

import jsonschema
import pytest

from shapegcode.cli import main
from shapegcode.demos import evidence
from shapegcode.demos.evidence import EvidenceDemo, Study, nist_folder, nist_runs, statements, study_of
from shapegcode.machine import Machine
from shapegcode.results import plot as canvas
from shapegcode.results.json import schema
from shapegcode.timing.calibration.calibrate import learn_clock


def published(program: str) -> list[float]:
    """Times in s as they were published."""
    with (nist_folder() / "runs.csv").open(encoding="utf-8") as file:
        return [float(row["active_to_completed_s"]) for row in csv.DictReader(file) if row["program"] == program]


@pytest.fixture(scope="module")
def study() -> Study:
    """One kind of look-ahead, one run of BOX OP3; OP2 left out."""
    runs = nist_runs({"BOX_OP3": (3,)}, "BOX_OP2")
    return study_of("BOX OP3 → OP2", learn_clock(runs, Machine.load("vx500"), families=["speed difference"]))


@pytest.fixture(scope="module")
def demo(study: Study) -> EvidenceDemo:
    return EvidenceDemo(
        paper="the logs", title="Left out", rows=tuple(statements(study)), remark="-", studies=(study,)
    )  # fmt: skip


def test_the_data_come_with_the_package() -> None:
    folder = nist_folder()
    assert (folder / "NOTICE.md").is_file() and len(list((folder / "logs").glob("*.txt.gz"))) == 15
    assert sum(file.stat().st_size for file in folder.parent.rglob("*") if file.is_file()) < 1e6


def test_op2_from_one_run_of_op3_is_within_2_percent_of_what_was_published(study: Study) -> None:
    times = published("BOX_OP2")
    assert len(study.left_out) == 4  # of five runs one was held
    for run in study.left_out:
        truth = min(times, key=lambda each: abs(each - (run.measured_s or 0.0)))
        assert run.measured_s == pytest.approx(truth, abs=0.01)
        assert run.predicted_s == pytest.approx(truth, rel=0.02)
        # Four dials, four times: a time that ignores them cannot be within 2 % of all.
        for tool in run.tools:
            assert tool.predicted_s == pytest.approx(tool.measured_s, rel=0.05), tool.name
        assert sum(tool.predicted_s for tool in run.tools) == pytest.approx(run.predicted_s, abs=1e-6)
        assert sum(tool.measured_s for tool in run.tools) == pytest.approx(truth, abs=0.01)
    assert max(times) / min(times) > 1.04


def test_the_written_machine_says_the_same_at_the_dial_that_was_set(study: Study) -> None:
    from shapegcode.program import Program
    from shapegcode.timing.cycle_time import cycle_time

    program = Program.read(nist_folder() / "programs" / "BOX_OP2.NC", study.fitted)
    said = cycle_time(program, study.fitted, feed_override=1.01, full=False).cycle_time_s
    usual = statistics.median(published("BOX_OP2"))  # most were run at about 101 %
    assert said == pytest.approx(usual, rel=0.02)
    unfitted = Machine.load("vx500")
    before = cycle_time(Program.read(nist_folder() / "programs" / "BOX_OP2.NC", unfitted), unfitted, full=False)
    assert before.cycle_time_s < 0.7 * usual


def test_statements_agree_and_a_wrong_prediction_does_not(study: Study, demo: EvidenceDemo) -> None:
    whole = [row for row in demo.rows if row.what.startswith("BOX_OP2")]
    assert len(whole) == 4 and all(row.agreement == "agrees" for row in whole)
    assert {"T3", "T21", "cuts", "between cuts"} <= {row.what for row in demo.rows}
    slow = tuple(
        dataclasses.replace(run, predicted_s=1.03 * run.predicted_s) if run.use == "test" else run for run in study.runs
    )
    wrong = dataclasses.replace(study, runs=slow)
    rows = tuple(statements(wrong))
    assert [row.agreement for row in rows if row.what.startswith("BOX_OP2")] == ["differs"] * 4
    assert not dataclasses.replace(demo, rows=rows).ok


def test_a_held_run_is_not_counted(study: Study) -> None:
    held = [run for run in study.runs if run.held_s]
    assert [run.log for run in held] == ["BOX_OP2-run2.txt.gz"]
    assert not {run.log for run in held} & {run.log for run in study.left_out}


def test_command(demo: EvidenceDemo, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evidence, "evidence_demo", lambda _progress: demo)
    code = main(["demo", "evidence", "--plots", str(tmp_path / "plots"), "--json", str(tmp_path / "e.json")])
    assert code == (0 if demo.ok else 1)
    found = json.loads((tmp_path / "e.json").read_text())
    jsonschema.validate(found, schema(EvidenceDemo))
    assert found["studies"][0]["runs"][0]["program"] in ("BOX_OP2.NC", "BOX_OP3.NC")
    assert found["largest_error_percent"] == pytest.approx(demo.largest_error_percent)
    assert (tmp_path / "plots" / "evidence-nist.png").stat().st_size > 10_000


def test_picture_has_a_row_for_each_run(demo: EvidenceDemo) -> None:
    panel = demo.plots()["evidence-nist"](canvas.axes(None))
    assert len(panel.get_yticks()) == len(demo.studies[0].runs)


@pytest.mark.slow
def test_the_whole_demonstration() -> None:
    found = evidence.evidence_demo()
    assert found.largest_error_percent < 2.0
    assert found.largest_tool_error_percent < 5.0
    for each in found.studies:
        for run in each.left_out:
            program = run.program.removesuffix(".NC")
            assert min(abs(time - (run.measured_s or 0.0)) for time in published(program)) < 0.01
    assert found.ok, [row for row in found.rows if not row.ok]
