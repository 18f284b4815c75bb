"""Cuts planned by the time-optimal planner: the emitted text, judged by what shares no code with the tool."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from contour_figures import TICK_S, Figures, arcs_and_corners, corner_speed, judge

import shapegcode as sg
from acceptance import BLOCK_ENDS, Judged, check_figures, convert, machine_with
from command import run
from judge import play
from shapegcode.errors import MachineError

JERK = {f"axes.{axis}.max_jerk_mm_s3": 100_000.0 for axis in "xyz"}
BLOCK_S = 0.005

EXACT_STOP = "%\nO1\n(PART)\nG21G17G90G94G54G00X0Y0Z0\n{mode}G01X30.F6000.\n{g64}Y30.\nX10.Y40.\nG00Z5.\nM30\n%\n"
FEEDS = "%\nO1\nG21G17G90G94G54G00X0Y0Z0\nG01X20.F6000.\nX40.F1200.\nX60.F6000.\nY30.\nM30\n%\n"
INVERSE_TIME = "%\nO1\nG21G17G90G94G54G00X0Y0Z0\nG93G01X30.F200.\nG03X40.Y10.R10.F300.\nG01Y40.F150.\nG94\nM30\n%\n"
ONE_FEED = "%\nO1\nG21G17G90G94G54G00X0Y0Z0\nG01X30.F6000.\nM30\n%\n"


def curve() -> str:
    """Chords of .4 mm along a sine."""
    points = ((0.4 * k, 5.0 * math.sin(0.4 * k / 8.0)) for k in range(1, 200))
    lines = [f"G01X{x:.3f}Y{y:.3f}" for x, y in points]
    return "\n".join(["%", "O1", "G21G17G90G94G54G00X0Y0Z0", lines[0] + "F4000.", *lines[1:], "M30", "%", ""])


def shaped(text: str, planner: str = "optimal", **keys: Any) -> Judged:
    """Converted by a planner; complaints of the independent judge about the text are failures."""
    values = {f"{key.replace('__', '.')}": value for key, value in keys.items()}
    machine = machine_with({**JERK, "shaping.planner": planner, "controller.block_time_s": BLOCK_S, **values})
    return convert(text, machine, block_period_s=BLOCK_S)


def figures(judged: Judged, rule: Any = "ceil") -> Figures:
    """Of the one cut, by the tests' own player and plant."""
    ((programmed, blocks, _),) = judged.regions()
    return judge(judged, blocks, programmed, BLOCK_S, rule)


@pytest.mark.parametrize("rule", BLOCK_ENDS)
@pytest.mark.parametrize(
    ("target", "tolerance_um"), [("response", 20.0), ("response", 5.0), ("command", 10.0), ("off", 20.0)]
)
@pytest.mark.parametrize("text", [arcs_and_corners(6000.0), curve()], ids=["arcs and corners", "curve"])
def test_tolerance_and_vibration(text: str, target: str, tolerance_um: float, rule: str) -> None:
    judged = shaped(text, shaping__contour=target, tolerance__contour_um=tolerance_um)
    check_figures(judged)
    found = figures(judged, rule)
    reached = found.response_um if target == "response" else found.command_um
    if target != "off":
        # At 5 um arcs are shaped as closely as the feed allows, which may be a little beyond it: the answer says so.
        errors = judged.conversion.contour_error_um
        said_um = (errors.response if target == "response" else errors.command).emitted.max
        assert said_um <= 1.03 * tolerance_um
        tolerance_um = max(tolerance_um, said_um)
    assert reached <= 1.02 * tolerance_um  # the judge looks more often
    assert reached > 0.2 * tolerance_um  # of one that is of use
    unshaped = max(judged.conversion.residual_vibration_um.original)
    assert found.residual_um.max() <= max(0.01 * unshaped, 0.6)  # rounding of words alone leaves half an increment


def test_it_saves_time_within_the_same_tolerance() -> None:
    text = arcs_and_corners(9000.0)
    before, now = (figures(shaped(text, planner)) for planner in ("look-ahead", "optimal"))
    assert now.response_um <= 20.0
    assert now.time_s < 0.98 * before.time_s
    # Within what the machine file says of its axes, seen from block to block.
    assert now.peak_acceleration.max() <= 5000.0


def test_an_exact_stop_is_one() -> None:
    corner = np.array([30.0, 0.0, 0.0])

    def cuts(mode: str) -> list[np.ndarray]:
        judged = shaped(EXACT_STOP.format(mode=mode, g64=""))
        moves = [[move for move in blocks if move.length > 0.0] for _, blocks, _ in judged.regions()]
        return [play(each, period_s=TICK_S, block_end="ceil") for each in moves]

    (rounded,) = cuts("")
    assert np.linalg.norm(rounded - corner, axis=1).min() > 3e-3
    assert corner_speed(rounded, (30.0, 0.0)) > 1.0
    before, behind = cuts("G09")
    assert np.array_equal(before[-1], corner)
    assert np.array_equal(behind[0], corner)
    for points in (before[::-1], behind):  # at rest there, not only slow
        assert np.linalg.norm(points[5] - corner) / 5.0 <= 1e-3
    # What runs in G61 is no cut to be shaped.
    text = EXACT_STOP.format(mode="G61", g64="G64")
    assert "\nG61G01X30.F6000.\nG64Y30.\n" in shaped(text).emitted


def test_programmed_feeds_are_kept() -> None:
    judged = shaped(FEEDS)
    ((_, blocks, _),) = judged.regions()
    points = play([move for move in blocks if move.length > 0.0], period_s=TICK_S, block_end="ceil")
    points = points - points[0]
    speed = np.linalg.norm(np.diff(points, axis=0), axis=1) / TICK_S
    slow = (points[1:, 0] > 20.0) & (points[1:, 0] < 40.0)
    assert speed[slow].max() <= 20.0 * 1.05 + 2e-3 / BLOCK_S
    assert speed.max() <= 100.0 * 1.05 + 2e-3 / BLOCK_S
    assert judged.conversion.ok


def test_inverse_time_feeds() -> None:
    judged = shaped(INVERSE_TIME)
    assert figures(judged).response_um <= 20.0
    assert judged.conversion.ok


def test_nothing_but_cuts_changes() -> None:
    judged = shaped(EXACT_STOP.format(mode="", g64=""))
    original, emitted = judged.original.split("\n"), judged.emitted.split("\n")
    assert emitted[:4] == original[:4]
    assert emitted[-4:] == original[-4:]


def test_a_straight_move_takes_what_jerk_and_acceleration_allow() -> None:
    # From rest to 100 mm/s with 100 m/s³: 2 sqrt(v/J) each way, v times that on the way; and the shaper.
    judged = shaped(ONE_FEED)
    ramp_s = 2.0 * math.sqrt(100.0 / 100_000.0)
    steady_s = (30.0 - 100.0 * ramp_s) / 100.0
    shaper_s = judged.conversion.to_dict()["shaper"]["duration_s"]
    assert figures(judged).time_s == pytest.approx(2.0 * ramp_s + steady_s + shaper_s, abs=0.012)


def test_jerk_must_be_known(tmp_path: Path) -> None:
    with pytest.raises(MachineError, match=r'shaping\.planner = "optimal": needs axes\.x\.max_jerk_mm_s3.*look-ahead'):
        sg.Machine.load("vx500").with_values({"shaping.planner": "optimal"})
    part = tmp_path / "part.nc"
    part.write_text(ONE_FEED)
    said = run(tmp_path, "convert", part, "-m", "vx500", "-o", tmp_path / "out.nc", "--planner", "optimal")
    assert said.returncode == 2
    assert "axes.y.max_jerk_mm_s3" in said.stderr
    assert not (tmp_path / "out.nc").exists()


def test_option_and_key_are_one() -> None:
    machine = machine_with(JERK)
    program = sg.Program.from_text(ONE_FEED.encode(), machine)
    by_option = sg.convert(program, machine, planner="optimal", shape_all=True)
    by_key = sg.convert(program, machine.with_values({"shaping.planner": "optimal"}), shape_all=True)
    assert by_option.text == by_key.text
    assert by_option.text != sg.convert(program, machine, shape_all=True).text


@pytest.mark.parametrize(
    ("kind", "planner"), [("fanuc", "look-ahead"), ("linuxcnc", "optimal"), ("klipper", "optimal")]
)
def test_by_default_open_planners_get_what_their_axes_can_do(kind: str, planner: str) -> None:
    machine = machine_with({"controller.kind": kind, "controller.dialect": "fanuc"})
    program = sg.Program.from_text(ONE_FEED.encode(), machine)
    stated = machine.with_values({"shaping.planner": planner})
    assert sg.convert(program, machine, shape_all=True).text == sg.convert(program, stated, shape_all=True).text


def test_without_a_limit_of_jerk_the_acceleration_builds_up_in_the_stated_time() -> None:
    """The same motion as with that jerk stated; a longer time is a longer cut."""
    machine = machine_with({"controller.kind": "klipper", "controller.dialect": "fanuc"})
    program = sg.Program.from_text(arcs_and_corners(9000.0).encode(), machine)
    jerks = {f"axes.{axis}.max_jerk_mm_s3": getattr(machine.axes, axis).max_acceleration_mm_s2 / 0.08 for axis in "xyz"}
    slow = sg.convert(program, machine.with_values({"shaping.jerk_time_s": 0.08}), shape_all=True)
    assert slow.text == sg.convert(program, machine.with_values(jerks), shape_all=True).text
    assert slow.cutting_time_s.emitted > sg.convert(program, machine, shape_all=True).cutting_time_s.emitted


@pytest.mark.parametrize("time_s", [1e-9, 1000.0])
def test_a_time_that_no_axis_has_is_refused(time_s: float) -> None:
    """So short a time is a jerk at which planning would not end."""
    with pytest.raises(MachineError, match=r"shaping\.jerk_time_s = \S+: must be (0\.001 or more|1 or less)"):
        machine_with({"shaping.jerk_time_s": time_s})
