"""Feed scheduling through Python and the command; the independent judge of its forces is in test_feed_judge."""

import json
import re
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import shapegcode as sg
from judge.interpreter import interpret
from judge.player import moving_average, play
from shapegcode import _core
from shapegcode.cli import main
from shapegcode.results.json import schema

TOOL = """
[tool]
name = "E8"
number = 1
diameter_mm = 8.0
flutes = 6
helix_deg = 50.0
flute_length_mm = 20.0
overhang_mm = 35.0
[cutting]
material = "al6061-t6-carbide-6"
[limits]
{limits}
[feed]
{feed}
"""
ALLOWANCE = """
[allowance]
allowance_mm = 0.8
corner_radius_mm = 8.0
wall = "right"
z_mm = [-15.0, 0.0]
"""
CORNER = (
    "%\nO1000\nG90 G54 G17 G21\nT1 M06\nS1800 M03\nG00 X-36. Y4. Z5.\nG01 Z-15. F2000.\nX4. F216. (ALONG THE WALL)\n"
    "G03 X8. Y8. R4.\nG01 Y38.\nG00 Z50.\nM30\n%\n"
)
BOX = "[box]\nx_mm = [0.0, 30.0]\ny_mm = [-10.0, 10.0]\nz_mm = [-5.0, 0.0]\n"
STRAIGHT_N = 35.03
"""Peak resultant of the straight cut at 216 mm/min."""


def tool(limits: str = f"resultant_n = {STRAIGHT_N}", feed: str = "") -> sg.Tool:
    return sg.Tool.from_toml(TOOL.format(limits=limits, feed=feed))


def scheduled(
    text: str, a_tool: sg.Tool | None = None, stock: str = ALLOWANCE, machine: sg.Machine | None = None
) -> sg.FeedSchedule:
    machine = machine or sg.Machine.load("vx500")
    program = sg.Program.from_text(text, machine, source="part.nc")
    return sg.schedule_feed(program, machine, a_tool or tool(), sg.Stock.from_toml(stock))


@pytest.fixture(scope="module")
def corner() -> sg.FeedSchedule:
    return scheduled(CORNER)


def test_the_corner_is_cut_at_the_force_of_the_straight(corner: sg.FeedSchedule) -> None:
    resultant = corner.resultant_force_n
    assert resultant.original.max == pytest.approx(78.8, rel=0.01)
    assert 0.98 * STRAIGHT_N < resultant.emitted.max <= STRAIGHT_N
    load = corner.loads[0]
    inside = load.emitted.peak_resultant_n > 1.0
    near = load.emitted.peak_resultant_n[inside] > 0.95 * STRAIGHT_N
    lengths = np.diff(np.concatenate(([0.0], load.s_mm)))[inside]
    assert lengths[near].sum() / lengths.sum() > 0.8
    # The constant feed at which the worst point of the corner is within the limit: 81.3 mm/min.
    constant_s = corner.survey.regions[0].region.path.length_mm / 81.3 * 60.0
    assert corner.cycle_time_s.emitted < 0.85 * constant_s
    assert corner.ok


def test_the_text_says_the_feeds_of_the_report(corner: sg.FeedSchedule) -> None:
    cuts = [move for move in interpret(corner.text.decode()).cuts if move.start[2] < -14.0 and move.end[2] < -14.0]
    assert min(move.feed for move in cuts) == corner.feed_mm_per_min.min
    assert all(move.length >= 0.6 - 0.002 for move in cuts)
    assert "(ALONG THE WALL)" in corner.text.decode()
    assert corner.blocks.original == 4
    assert corner.blocks.emitted == len(cuts) + 1


@pytest.mark.parametrize("time_constant_s", [0.0, 0.1])
def test_the_feed_that_the_machine_runs_keeps_the_limit(time_constant_s: float) -> None:
    values = {"controller.motion": "after_interpolation", "controller.time_constant_s": time_constant_s}
    machine = sg.Machine.load("vx500").with_values(values)
    text = CORNER.replace("S1800", "S12000").replace("F216.", "F1440.")
    result = scheduled(text, machine=machine)
    assert result.ok
    # SimulatedCase by the judge: blocks at their feed, then the moving average; speed over the time between two teeth.
    period = 0.001
    moves = [move for move in interpret(result.text.decode()).cuts if move.end[2] < -14.0 and move.start[2] < -14.0]
    points = play(moves, period_s=period)
    points = moving_average(points, round(time_constant_s / period)) if time_constant_s > 0.0 else points
    travelled = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))))
    window = 1  # 12000 rev/min, six teeth: 0.83 ms
    speed = (travelled[window:] - travelled[:-window]) / (window * period) * 60.0
    plan = result.plans[0]
    track = result.survey.regions[0].track
    down = float(track.s_mm[np.flatnonzero(np.asarray(track.segment) > 0)[0] - 1])
    stations = np.asarray(track.s_mm) - down
    at = np.clip(np.searchsorted(stations, travelled[window:]), 0, len(stations) - 1)
    assert (speed <= plan.limit_mm_per_min[at] / (1.0 - result.margin) ** (1.0 / 0.85)).mean() > 0.995


def test_arcs_with_absolute_centres_are_scheduled_as_those_with_distances(corner: sg.FeedSchedule) -> None:
    """Emitted arcs have positions of centres as the original has: the same machine reads them back."""
    machine = sg.Machine.load("vx500").with_values({"input.arc_centre": "absolute"})
    absolute = scheduled(CORNER.replace("R4.", "I4. J8."), machine=machine)
    emitted = absolute.text.decode()
    assert set(re.findall(r"I[-.\d]+ ?J[-.\d]+", emitted)) == {"I4. J8.", "I4.J8."}
    assert re.findall(r"F[\d.]+", emitted) == re.findall(r"F[\d.]+", corner.text.decode())
    again = sg.Program.from_text(emitted, machine)
    assert again.regions[0].path.length_mm == pytest.approx(corner.written.regions[0].path.length_mm)


def test_air_is_crossed_faster_but_not_up_to_the_material() -> None:
    text = "%\nG90 G54 G17 G21\nT1 M06\nS3000 M03\nG00 X-20. Y-12. Z-5.\nG01 X50. F300.\nM30\n%\n"
    fast = tool("resultant_n = 1000", "air_feed_mm_per_min = 3000\napproach_mm = 2.0")
    result = scheduled(text, fast, BOX)
    cuts = interpret(result.text.decode()).cuts
    # The tool's axis is 2 mm outside of the block: it meets the corner at X = -sqrt(4^2 - 2^2).
    contact = -np.sqrt(12.0)
    assert [move.feed for move in cuts] == [3000.0, 300.0, 3000.0]
    assert contact - 4.0 < cuts[0].end[0] <= contact - 2.0
    assert 29.8 < cuts[1].end[0] < 31.0  # the last contact is beside the axis, at the end of the block
    assert result.air_time_s.emitted < 0.5 * result.air_time_s.original


def test_feeds_change_by_no_more_than_the_machine_says() -> None:
    values = {"feed_control.max_change_mm_per_min": 25.0, "feed_control.interval_mm": 0.5}
    result = scheduled(CORNER, machine=sg.Machine.load("vx500").with_values(values))
    feeds = [move.feed for move in interpret(result.text.decode()).cuts if move.start[2] < -14.0]
    assert np.abs(np.diff(feeds)).max() <= 25.0 + 1e-9
    assert result.ok


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("T1 M06", "T2 M06", "no tool file describes T2"),
        ("S1800 M03", "M03", "no spindle speed"),
        ("X4. F216.", "G95 X4. F.12", "not all of its feeds are per minute"),
        ("X4. F216.", "X4. F1.", "already below the lowest one"),
    ],
)
def test_what_cannot_be_scheduled_is_said_and_left(old: str, new: str, said: str) -> None:
    text = CORNER.replace(old, new)
    limits = f"resultant_n = {STRAIGHT_N}\nfeed_per_tooth_min_mm = 0.001"
    if new == "T2 M06":
        with pytest.raises(sg.ArgumentError, match="engagement"):
            scheduled(text, tool(limits))
        return
    result = scheduled(text, tool(limits))
    assert any(said in warning for warning in result.warnings)
    if "lowest" not in said:
        assert result.text.decode() == text


def test_a_plunge_into_material_keeps_its_feed() -> None:
    text = "%\nG90 G54 G17 G21\nT1 M06\nS3000 M03\nG00 X15. Y0. Z2.\nG01 Z-5. F120.\nX40. F300.\nM30\n%\n"
    result = scheduled(text, tool("resultant_n = 60"), BOX)
    lines = result.text.decode().splitlines()
    assert "G01 Z-5. F120." in lines
    assert any("left unchanged: plunges into material" in warning for warning in result.warnings)
    kept = [entry for entry in result.limits if entry.limit == "kept"]
    assert kept[0].lines == (6, 6)


def test_a_limit_below_the_least_feed_is_not_within_limits() -> None:
    result = scheduled(CORNER, tool("resultant_n = 20\nfeed_per_tooth_min_mm = 0.012"))
    assert not result.ok
    assert result.feed_mm_per_min.min == pytest.approx(0.012 * 6 * 1800, abs=0.1)
    assert any("a feed below the lowest feed" in warning for warning in result.warnings)


def test_other_limits_bind_by_their_names() -> None:
    for limits, name, column, most in (
        ("deflection_um = 3.0", "deflection", "peak_deflection_um", 3.0),
        ("torque_nm = 0.12", "torque", "peak_torque_nm", 0.12),
        ("power_w = 20.0", "power", "mean_power_w", 20.0),
        ('resultant_n = 31.0\nresultant = "mean"', "resultant", "mean_resultant_n", 31.0),
    ):
        result = scheduled(CORNER, tool(limits))
        assert name in {entry.limit for entry in result.limits}, limits
        assert 0.95 * most < getattr(result.peak, column).emitted <= most, limits


def write_files(folder: Path, limits: str = f"resultant_n = {STRAIGHT_N}") -> list[str]:
    (folder / "part.nc").write_text(CORNER)
    (folder / "tool.toml").write_text(TOOL.format(limits=limits, feed=""))
    (folder / "stock.toml").write_text(ALLOWANCE)
    return [str(folder / "part.nc"), "-m", "vx500", "--tool", str(folder / "tool.toml"), "--stock",
            str(folder / "stock.toml")]  # fmt: skip


def test_the_command_writes_program_report_and_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    out, report = tmp_path / "out.nc", tmp_path / "r.json"
    assert main(["feed", *write_files(tmp_path), "-o", str(out), "--json", str(report)]) == 0
    result = json.loads(report.read_text())
    jsonschema.validate(result, schema(sg.FeedSchedule))
    assert result["output"] == str(out)
    # The figures of the JSON are those of the program that stands there.
    words = {float(word) for word in re.findall(r"F([0-9.]+)", out.read_text())}
    assert result["feed_mm_per_min"]["min"] == min(words)
    shown = capsys.readouterr().out
    assert "peak resultant" in shown
    assert "what limits the feed" in shown
    assert interpret(out.read_text()).cuts
    assert (
        main(["feed", *write_files(tmp_path, "resultant_n = 20\nfeed_per_tooth_min_mm = 0.012"), "-o", str(out)]) == 1
    )


def test_the_command_refuses_bad_input_and_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out.nc"
    arguments = write_files(tmp_path)
    assert main(["feed", *arguments, "-o", str(tmp_path / "part.nc")]) == 2
    assert (tmp_path / "part.nc").read_text() == CORNER
    assert main(["feed", *arguments[:-1], str(tmp_path / "no.toml"), "-o", str(out)]) == 2
    (tmp_path / "stock.toml").write_text(ALLOWANCE.replace("8.0", "3.0"))
    assert main(["feed", *arguments, "-o", str(out)]) == 2
    assert "corner_radius_mm" in capsys.readouterr().err
    assert main(["convert", arguments[0], "-m", "vx500", "--feed-schedule", "-o", str(out)]) == 2
    assert "belong together" in capsys.readouterr().err
    assert not out.exists()


def test_feeds_and_shaping_in_one_go_keep_the_limit_of_the_shaped_motion(tmp_path: Path) -> None:
    out, report = tmp_path / "out.nc", tmp_path / "r.json"
    arguments = ["convert", *write_files(tmp_path), "--feed-schedule", "-o", str(out), "--json", str(report)]
    assert main(arguments) == 0
    result = json.loads(report.read_text())
    jsonschema.validate(result, schema(sg.ScheduledConversion))
    feed = result["feed_schedule"]
    assert feed["ok"]
    assert 0.9 * STRAIGHT_N < feed["resultant_force_n"]["emitted"]["max"] <= STRAIGHT_N
    assert result["within_tolerance"]
    assert feed["blocks"]["emitted"] == result["blocks"]["emitted"]
    assert b"SHAPEGCODE" in out.read_bytes()


def test_a_missed_limit_of_the_cut_is_no_missed_tolerance_but_no_success_either() -> None:
    machine = sg.Machine.load("vx500")
    program = sg.Program.from_text(CORNER, machine, source="part.nc")
    low = tool("resultant_n = 20\nfeed_per_tooth_min_mm = 0.012")
    scheduled = sg.convert_scheduled(program, machine, low, sg.Stock.from_toml(ALLOWANCE))
    assert (scheduled.within_tolerance, scheduled.feed_schedule.ok, scheduled.ok) == (True, False, False)
    assert scheduled.answer.startswith("do not run, OUT OF TOLERANCE: ")
    assert "NOT within limits: peak resultant" in scheduled.answer
    assert scheduled.next_step.startswith("do not run it: reduce the depth of cut there")
    assert b"(OUT OF TOLERANCE - DO NOT RUN  )" in scheduled.text
    assert [table.title for table in scheduled.tables()][:2] == [
        "part.nc on VX500, tool E8", "what limits the feed",
    ]  # fmt: skip
    assert {"path", "feed", "vibration", "feed-along-path"} <= scheduled.plots().keys()


def test_a_tool_without_limits_is_told_so() -> None:
    result = scheduled(CORNER, tool(""))
    assert any("no limit of force" in warning for warning in result.warnings)
    assert result.text.decode() == CORNER


def test_core_and_python_agree_on_the_least_stretch() -> None:
    # The machine's interval is what the core is asked for: a block of two intervals is divided in its middle only.
    stretches = _core.schedule_feed([1.2], [0.0], [True], [0.6, 1.2], [100.0, 50.0], 0.6)
    assert [(s.begin_mm, s.end_mm, s.feed_mm_per_min) for s in stretches] == [(0.0, 0.6, 100.0), (0.6, 1.2, 50.0)]
