"""Shaped rapids: what is written is held against the judge's interpreter, player and plant, and rapids by hand."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from judge import LineRecord, interpret, play, response, verify_conversion
from shapegcode._core import ArgumentError, InPosition, in_position_wait_behind_s
from shapegcode.cli import main
from shapegcode.conversion.budget import Budget
from shapegcode.conversion.convert import Conversion, convert
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.model.machine_model import fanuc_model
from shapegcode.program import Program

# Figures of vx500.toml that the model of a rapid by hand needs.
PERIOD_S, RAPID_MM_PER_S, RAMP_S, ARRIVAL_S = 0.001, 400.0, 0.15, {"X": 0.025, "Y": 0.025, "Z": 0.12}
MODES = [(46.0, 0.02), (131.0, 0.02), None]
BAND_UM = 3.0
REST_S = 1.5

# Cuts that end and begin slowly in X and Y, so that what rings at the next one is the rapid.
PROGRAM = """%
O0001
G90 G54 G17 G21 G40
G00 X0. Y0. S5000 M03
Z50.
Z2.
G01 Z-1. F500
X20. F1000
G00 Z2.
N10 X80. Y30. (OVER)
G01 Z-1. F500
X100.
G00 Z2.
X20. Y5.
G01 Z-1. F500
Y25.
G00 X21. Y25.
G01 X30.
G00 Z100.
M30
%
"""


CUT_BETWEEN = (
    "G90 G21 G17 G40\nG00 X0. Y0.\nZ50.\nZ2.\nG01 Z-1. F500\nX20. F1000\nG00 Z2.\nX80. Y30.\nG01 Z-1. F500\nX100.\n"
    "M30\n"
)


VX500 = Machine.load("vx500")
PLAIN = VX500.with_values("emission.header", False)


def converted(text: str, machine: Machine = VX500, **options: Any) -> Conversion:
    machine = machine.with_values({"shaping.rapids": True, "emission.header": False})
    return convert(Program.from_text(text, machine), machine, **({"shape_all": True} | options))


def rapid_by_hand(start: FloatArray, end: FloatArray) -> FloatArray:
    """Paper 004, linear rapid: an even run smoothed by a moving average; a short one has run = average."""
    length = float(np.linalg.norm(end - start))
    share = length / np.abs(end - start).max()
    rate, acceleration = RAPID_MM_PER_S * share, RAPID_MM_PER_S / RAMP_S * share
    run, ramp = math.ceil(length / rate / PERIOD_S - 1e-6), round(RAMP_S / PERIOD_S)
    if run < ramp:
        run = ramp = math.ceil(math.sqrt(length / acceleration) / PERIOD_S - 1e-6)
    # Speed at the middle of each period, continuous in time: a trapezoid's average over the period.
    edges = np.arange(run + ramp + 1, dtype=float)
    ramps = np.clip(edges, 0, None), np.clip(edges - run, 0, None), np.clip(edges - ramp, 0, None)
    way = (ramps[0] ** 2 - ramps[1] ** 2 - ramps[2] ** 2 + np.clip(edges - run - ramp, 0, None) ** 2) / (
        2.0 * run * ramp
    )
    return np.asarray(start + way[:, None] * (end - start))


def hold(points: FloatArray, seconds: float) -> FloatArray:
    return np.concatenate([points, np.repeat(points[-1:], round(seconds / PERIOD_S), axis=0)])


def command_between_cuts(records: list[LineRecord]) -> FloatArray:
    """Set-points of lines between two cuts: rapids with their wait, shaped blocks, dwells, waits of exact stops."""
    moves = [move for record in records for move in record.moves if move.length > 0.0]
    points = np.asarray(moves[0].start, dtype=float)[None, :]
    run: list[Any] = []
    for record in records:
        if record.dwell_s:
            points = hold(points, record.dwell_s)
        for move in record.moves:
            if move.length <= 0.0:
                continue
            wait = max(ARRIVAL_S[axis] for axis, way in zip("XYZ", move.delta, strict=True) if way)
            if move.kind == "rapid":
                points = hold(np.concatenate([points, rapid_by_hand(move.start, move.end)[1:]]), wait)
                continue
            run.append(move)
            if record.exact_stop:
                simulated = play(run, period_s=PERIOD_S)
                moved = [axis for axis, way in zip("XYZ", np.ptp(simulated, axis=0), strict=True) if way > 0.0]
                points = hold(np.concatenate([points, simulated[1:]]), max(ARRIVAL_S[axis] for axis in moved))
                run = []
    assert not run
    return points


def gap_figures(records: list[LineRecord]) -> tuple[float, float]:
    """Time until the table has settled, s, and largest vibration from the beginning of the next cut on, µm."""
    points = command_between_cuts(records)
    times, command, moved = response(points, MODES, PERIOD_S, rest_s=REST_S)
    apart = 1e3 * np.abs(moved - command).max(axis=1)
    begin = (len(points) - 1) * PERIOD_S
    outside = np.flatnonzero(apart > BAND_UM)
    settled = float(times[outside[-1] + 1]) if len(outside) else 0.0
    return max(begin, settled), float(apart[times >= begin - 1e-9].max())


def test_the_hand_made_rapid_is_the_one_of_the_paper() -> None:
    # Eq. 6: ceil(l / (F T)) T + A; eq. 9 to 11 for a short one: 2 ceil(sqrt(l / a) / T) T.
    assert len(rapid_by_hand(np.zeros(3), np.array([100.0, 0.0, 0.0]))) - 1 == 250 + 150
    assert len(rapid_by_hand(np.zeros(3), np.array([20.0, 0.0, 0.0]))) - 1 == 2 * 87
    assert rapid_by_hand(np.zeros(3), np.array([20.0, 7.0, 0.0]))[-1] == pytest.approx([20.0, 7.0, 0.0])


def original_and_emitted(conversion: Conversion, text: str) -> tuple[list[LineRecord], list[LineRecord]]:
    return interpret(text).lines, interpret(conversion.text.decode()).lines


def same_state(one: LineRecord, other: LineRecord) -> bool:
    """Modal state and position behind two lines; without any F yet, F0 is the same: a cut is an alarm either way."""
    for key, was in one.modal.items():
        now = other.modal[key]
        if isinstance(was, np.ndarray):
            if key == "position" and not np.allclose(was, now, atol=1e-9, equal_nan=True):
                return False
        elif was != now and not (key == "F" and math.isnan(was) and (math.isnan(now) or now == 0.0)):
            return False
    return True


def check_text(conversion: Conversion, text: str) -> None:
    """Every shaped rapid leaves the state of its original; with the rapids put back the judge acquits."""
    original, emitted = original_and_emitted(conversion, text)
    lines = conversion.text.decode().split("\n")
    for move in reversed(conversion.to_dict()["rapids"]["moves"]):
        (line, _), (first, last) = move["lines"], move["emitted_lines"]
        assert same_state(original[line - 1], emitted[last - 1]), text.split("\n")[line - 1]
        assert same_state(original[line - 2], emitted[first - 2])
        assert original[line - 1].n_words == tuple(n for k in range(first - 1, last) for n in emitted[k].n_words)
        assert original[line - 1].comments == tuple(c for k in range(first - 1, last) for c in emitted[k].comments)
        blocks = [m for k in range(first - 1, last) for m in emitted[k].moves if m.length > 0.0]
        assert all(m.kind == "line" for m in blocks)
        assert max(m.feed for m in blocks) <= 15000.0
        assert emitted[last - 2].exact_stop
        lines[first - 1 : last] = [text.split("\n")[line - 1]]
    assert verify_conversion(text, "\n".join(lines)) == []


def gaps(records: list[LineRecord]) -> list[list[LineRecord]]:
    """The lines between the cuts of these programs: they cut below Z = 2."""
    found, now = [], []
    for record in records:
        cuts = [m for m in record.moves if m.is_cut and m.length > 0.0 and min(m.start[2], m.end[2]) < 1.999]
        if cuts:
            if any(m.length > 0.0 for r in now for m in r.moves):
                found.append(now)
            now = []
        else:
            now.append(record)
    return found


def test_the_table_is_settled_sooner_and_rings_less_at_the_next_cut() -> None:
    text = PROGRAM.replace("G00 X21. Y25.\nG01 X30.\n", "")
    conversion = converted(text)
    rapids = conversion.to_dict()["rapids"]
    assert conversion.ok
    check_text(conversion, text)
    assert [move["lines"] for move in rapids["moves"]] == [[10, 10], [14, 14]]
    original, emitted = original_and_emitted(conversion, text)
    # Not the approach, whose start is not known.
    before, after = gaps(original)[1:], gaps(emitted)[1:]
    assert len(before) == len(after) == 2
    saved = 0.0
    for was, now in zip(before, after, strict=True):
        (was_s, was_um), (now_s, now_um) = gap_figures(was), gap_figures(now)
        assert was_um > 3.0 * BAND_UM
        assert now_um < BAND_UM
        assert now_s < was_s - 0.2
        saved += was_s - now_s
    assert rapids["time_saved_s"] == pytest.approx(saved, abs=0.004)
    assert saved == pytest.approx(0.47, abs=0.01)  # docs/howto/shaped_rapids.md
    for move in rapids["moves"]:
        for axis, now in move["residual_vibration_um"]["emitted"].items():
            assert now <= move["residual_limit_um"][axis]


def test_it_is_off_by_default_and_changes_nothing_else() -> None:
    plain = convert(PROGRAM, PLAIN, shape_all=True)
    assert "rapids" not in plain.to_dict()
    shaped = converted(PROGRAM)
    assert plain.to_dict()["regions"] != [] and len(plain.to_dict()["regions"]) == len(shaped.to_dict()["regions"])
    for one, other in zip(plain.to_dict()["regions"], shaped.to_dict()["regions"], strict=True):
        assert one["residual_vibration_um"] == other["residual_vibration_um"]
    lines = shaped.text.decode().split("\n")
    for move in reversed(shaped.to_dict()["rapids"]["moves"]):
        first, last = move["emitted_lines"]
        lines[first - 1 : last] = [PROGRAM.split("\n")[move["lines"][0] - 1]]
    assert "\n".join(lines) == plain.text.decode()
    clock = shaped.to_dict()["cycle_time_s"]["emitted"] - plain.to_dict()["cycle_time_s"]["emitted"]
    moves = shaped.to_dict()["rapids"]["moves"]
    added = sum(m[key]["emitted"] - m[key]["original"] for m in moves for key in ("time_s", "in_position_s"))
    assert clock == pytest.approx(added, abs=1e-6)


def test_every_rapid_is_accounted_for() -> None:
    rapids = converted(PROGRAM).to_dict()["rapids"]
    assert rapids["found"] == sum(
        line.startswith(("G00", "N10", "X20. Y5", "Z2", "Z50")) for line in PROGRAM.split("\n")
    )
    assert rapids["found"] == rapids["shaped"] + sum(rapids["left_unchanged"].values())
    assert rapids["left_unchanged"]["start position not known"] == 1  # Z50.
    assert rapids["left_unchanged"]["other words in its block"] == 1  # S and M
    assert rapids["left_unchanged"]["no cut follows"] == 1  # the last retract
    assert rapids["settle_band_um"] == BAND_UM


@pytest.mark.parametrize("damping_ratio", [0.02, 0.5])
def test_where_nothing_is_gained_the_text_stays(damping_ratio: float) -> None:
    # A Z move on a machine without a mode in Z, and a short move of well damped modes.
    moves = {0.02: "Z20.\nZ2.\n", 0.5: "X21.\n"}[damping_ratio]
    text = f"G90 G21 G17 G40\nG00 X0. Y0. Z2.\nG01 Z1. F500\nX20.\nG00 Z2.\n{moves}G01 Z1. F500\nX40.\nM30\n"
    machine = PLAIN.with_values({f"axes.{axis}.modes.1.damping_ratio": damping_ratio for axis in "xy"})
    conversion = converted(text, machine)
    plain = convert(Program.from_text(text, machine), machine, shape_all=True)
    assert conversion.to_dict()["rapids"]["shaped"] == 0
    assert conversion.to_dict()["rapids"]["left_unchanged"]["no time gained"] >= 1
    assert conversion.to_dict()["rapids"]["time_saved_s"] == 0.0
    assert conversion.text == plain.text
    assert conversion.to_dict()["warnings"] == plain.to_dict()["warnings"]


CUT = "G01 Z1. F500\nX{0}\nG00 Z2.\n"
HEAD = "G90 G21 G17 G40\nG00 X0. Y0.\nZ2.\n" + CUT.format("20.")


def one_rapid(block: str, before: str = "", after: str = "", tail: str = "G90 G01 Z1. F500\nX95.\nM30\n") -> str:
    """A rapid that is worth shaping, X 20 to 80, between two cuts."""
    return f"{HEAD}{before}{block}\n{after}{tail}"


def test_the_plain_case_of_the_edge_cases_is_shaped() -> None:
    conversion = converted(one_rapid("G00 X80."))
    assert conversion.to_dict()["rapids"]["shaped"] == 1
    check_text(conversion, one_rapid("G00 X80."))


@pytest.mark.parametrize(
    "text",
    [
        one_rapid("X60.", before="G91\n"),  # incremental, but it is known where from
        one_rapid("G90 G54 G94 G17 X80. (ALL THIS HOLDS ALREADY)"),
        one_rapid("N7 x80. y.5", before="g61\n", after="g64\n"),
        one_rapid("X80.", before="G18\n", after="G17\n"),
        one_rapid("G00X+80Y-5.5"),
        one_rapid("X80.", before="G95 S1000\n", after="G94\n"),
        # No F yet: what was an alarm without one stays an alarm.
        "G90 G21 G17\nG00 X0. Y0.\nZ2.\nX80.\nG01 Z1. F500\nX90.\nM30\n",
    ],
)
def test_modal_states_around_a_rapid_come_back(text: str) -> None:
    conversion = converted(text)
    assert conversion.to_dict()["rapids"]["shaped"] == 1
    assert conversion.ok
    check_text(conversion, text)


def test_inch_programs_are_shaped_in_inches() -> None:
    text = "G90 G20 G17\nG00 X0. Y0.\nZ.1\nG01 Z-.05 F20.\nX1. F40.\nG00 Z.1\nX3.5 Y.25\nG01 Z-.05 F20.\nX4.\nM30\n"
    conversion = converted(text)
    (move,) = conversion.to_dict()["rapids"]["moves"]
    assert move["lines"] == [7, 7]
    emitted = interpret(conversion.text.decode()).lines
    first, last = move["emitted_lines"]
    assert emitted[last - 1].modal["units"] == "G20"
    assert emitted[last - 1].modal["position"] == pytest.approx([3.5 * 25.4, 0.25 * 25.4, 2.54])
    assert emitted[last - 1].modal["F"] == emitted[first - 2].modal["F"]
    assert max(m.feed for k in range(first - 1, last) for m in emitted[k].moves) <= 15000.0


def test_a_rapid_in_inches_leaves_a_height_in_mm_where_it_is() -> None:
    text = "G90 G21 G17\nG00 X0. Y0.\nZ5.\nG20\nG01 X1. F40.\nG00 X3.5 Y.25\nG01 X4. F20.\nG21\nX140. F500.\nM30\n"
    conversion = converted(text)
    (move,) = conversion.to_dict()["rapids"]["moves"]
    assert move["lines"] == [6, 6]
    lines = interpret(conversion.text.decode()).lines[3:]
    assert {line.modal["position"][2] for line in lines if line.moves} == {5.0}


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("G91 G21 G17\nG01 Z-1. F500\nX20.\nG00 Z1.\nX60.\nG01 Z-1.\nX5.\nM30\n", "start position not known"),
        (one_rapid("G00 X80. M08"), "other words in its block"),
        (one_rapid("G00 X80. S3000"), "other words in its block"),
        (one_rapid("G00 G43 X80. H2"), "other words in its block"),
        (one_rapid("G00 G53 X80.", after="G00 X80. Z2.\n"), "start position not known"),
        (one_rapid("/G00 X80."), "other words in its block"),
        (one_rapid("G00 A10. X80."), "other words in its block"),
        (one_rapid("G28 X80.", after="G00 X80. Z2.\n"), "start position not known"),
        (one_rapid("G00 G18 X80."), "other codes in its block change the modal state"),
        (one_rapid("G00 G91 X60."), "other codes in its block change the modal state"),
        (one_rapid("G00 X80.", before="/G18\n"), "the modal state depends on the block-skip switch"),
        (one_rapid("G81 X80. Z1. R2. F100\nX90.\nG80"), "drilling cycle"),
        (one_rapid("G00 X80.", tail="M05\nM30\n"), "no cut follows"),
        (one_rapid("G00 X80.", after="M06 T2\n", tail="G00 X80. Z2.\nG01 Z1. F500\nX90.\nM30\n"), "no cut follows"),
    ],
)
def test_a_rapid_that_is_no_plain_one_stays(text: str, reason: str) -> None:
    conversion = converted(text)
    rapids = conversion.to_dict()["rapids"]
    assert rapids["left_unchanged"].get(reason, 0) >= 1, rapids
    assert rapids["found"] == rapids["shaped"] + sum(rapids["left_unchanged"].values())
    assert rapids["shaped"] == 0
    assert conversion.text == convert(text, PLAIN, shape_all=True).text


def test_compensated_rapids_stay() -> None:
    text = one_rapid("G00 X80.", before="G41 D1\n", after="G40\n")
    machine = PLAIN.with_values({"input.compensation": "keep", "shaping.rapids": True})
    rapids = convert(Program.from_text(text, machine, expand_compensation=False), machine, shape_all=True).to_dict()[
        "rapids"
    ]
    assert rapids["left_unchanged"]["cutter compensation"] == 1
    assert rapids["shaped"] == 0


def test_nothing_is_shaped_where_no_cut_is() -> None:
    text = one_rapid("G00 X80.").replace("F500", "F.5")
    rapids = converted(text).to_dict()["rapids"]
    assert rapids["shaped"] == 0
    assert rapids["left_unchanged"]["no cut of the program is shaped"] >= 1


def test_a_long_approach_leaves_nothing_to_gain() -> None:
    # The vibration of X has decayed before Z arrives, and before the dwell is over.
    for after in ("Z300.\nZ2.\n", "G04 P1500\n"):
        rapids = converted(one_rapid("G00 X80.", after=after)).to_dict()["rapids"]
        assert rapids["shaped"] == 0
        assert rapids["time_saved_s"] == 0.0


@pytest.mark.parametrize(
    ("blocks", "shaped"),
    [
        (["X79.", "X80."], 2),
        (["X70.", "X80."], 0),  # the second one happens to stop the vibration of the first
        (["X80.", "X79.", "X80."], 3),
        (["X80.", "Y30.", "Z3.", "Z2."], 0),  # Z takes long enough
    ],
)
def test_rapids_one_after_the_other_are_judged_together(blocks: list[str], shaped: int) -> None:
    text = CUT_BETWEEN.replace("X80. Y30.", "\n".join(blocks))
    conversion = converted(text)
    check_text(conversion, text)
    original, emitted = original_and_emitted(conversion, text)
    (before,), (after,) = gaps(original)[1:], gaps(emitted)[1:]
    assert conversion.to_dict()["rapids"]["shaped"] == shaped
    saved = gap_figures(before)[0] - gap_figures(after)[0]
    assert conversion.to_dict()["rapids"]["time_saved_s"] == pytest.approx(saved, abs=0.004)
    assert saved >= 0.0


def test_the_warnings_say_what_is_different() -> None:
    text = one_rapid("G00 X80. Y30.")
    warnings = " ".join(converted(text).to_dict()["warnings"])
    assert "rapid override has no effect" in warnings
    assert "parameters 1422, 1430" in warnings
    assert "15000" in warnings
    assert "straight" not in warnings
    dogleg = VX500.with_values("controller.rapid_path", "non_linear")
    conversion = converted(text, dogleg)
    assert conversion.to_dict()["rapids"]["shaped"] == 1
    assert "check that the straight path is free" in " ".join(conversion.to_dict()["warnings"])
    check_straight(conversion)
    per_axis = converted(text, VX500.with_values("shaping.per_axis", True))
    assert per_axis.to_dict()["rapids"]["shaped"] == 1
    check_straight(per_axis)


def check_straight(conversion: Conversion) -> None:
    """The replacement of X20 Y0 to X80 Y30 is on the straight line, within rounding."""
    (move,) = conversion.to_dict()["rapids"]["moves"]
    first, last = move["emitted_lines"]
    for record in interpret(conversion.text.decode()).lines[first - 1 : last]:
        for block in record.moves:
            x, y = block.end[0] - 20.0, block.end[1]
            assert abs(x * 30.0 - y * 60.0) / math.hypot(30.0, 60.0) < 1.5e-3


def test_the_wait_behind_a_command_is_the_one_of_the_servo_lag() -> None:
    model = fanuc_model(VX500)
    model.in_position = InPosition.servo_lag
    # e exp(-K t) = w: K = 30 1/s, w = 20 um of vx500.
    wait_s = in_position_wait_behind_s([0.4, 5.0, 0.0], [True, False, True], model)
    assert wait_s == pytest.approx(math.ceil(math.log(0.4 / 0.02) / 30.0 * 1e3) * 1e-3)


@pytest.mark.parametrize(
    "controller",
    [
        {"in_position": "servo_lag"},
        {"motion": "after_interpolation", "shaped_time_constant_s": 0.02},
        {"rapid_bell_time_s": 0.03},
        {"law": "jerk_limited", "block_end": "carry"},
    ],
)
def test_other_controllers(controller: dict[str, Any]) -> None:
    text = one_rapid("G00 X80.")
    conversion = converted(text, VX500.with_values({f"controller.{key}": value for key, value in controller.items()}))
    rapids = conversion.to_dict()["rapids"]
    check_text(conversion, text)
    assert rapids["found"] == rapids["shaped"] + sum(rapids["left_unchanged"].values())
    for move in rapids["moves"]:
        assert not move["misses"]
        assert rapids["time_saved_s"] > 0.0


def test_modes_that_vary_with_position_are_looked_up_where_the_rapid_is() -> None:
    # 46 Hz in the middle of the table, but 10 Hz lower where this program works.
    table = {"axis": "x", "position_mm": [0, 150, 500, 900], "frequency_hz": [36, 36, 46, 46]}
    machine = VX500.with_values("axes.x.modes.1.frequency_over", table)
    (here,) = converted(one_rapid("G00 X80."), machine).to_dict()["rapids"]["moves"]
    plain = VX500.with_values("axes.x.modes.1.frequency_hz", 36.0)
    (same,) = converted(one_rapid("G00 X80."), plain).to_dict()["rapids"]["moves"]
    assert here["settling_s"]["original"] == pytest.approx(same["settling_s"]["original"], abs=0.002)
    assert here["residual_vibration_um"]["original"]["x"] == pytest.approx(
        same["residual_vibration_um"]["original"]["x"], rel=0.01
    )


def test_a_budget_comes_first() -> None:
    text = one_rapid("G00 X80.")
    full = converted(text)
    assert full.to_dict()["rapids"]["shaped"] == 1
    plain = convert(text, PLAIN, shape_all=True)
    tight = converted(text, budget=Budget(max_bytes=len(full.text) - 1))
    assert tight.text == plain.text
    assert tight.to_dict()["rapids"]["left_unchanged"]["budget"] == 1
    assert tight.to_dict()["rapids"]["time_saved_s"] == 0.0
    assert converted(text, budget=Budget(max_bytes=len(full.text))).text == full.text
    slow = converted(text, block_period_s=0.005, budget=Budget(max_blocks_per_second=150))
    assert slow.to_dict()["rapids"]["shaped"] in (0, 1)


def test_a_band_of_zero_is_refused() -> None:
    machine = VX500.with_values("tolerance.residual_floor_um", 0.0)
    with pytest.raises(ArgumentError, match="residual_floor_um is 0"):
        converted(one_rapid("G00 X80."), machine)


def test_the_command_has_an_option_for_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, target, report = tmp_path / "in.nc", tmp_path / "out.nc", tmp_path / "report.json"
    source.write_bytes(PROGRAM.replace("\n", "\r\n").encode())
    arguments = ["convert", str(source), "--machine", "vx500", "-o", str(target), "--json", str(report)]
    assert main([*arguments, "--shape-rapids"]) == 0
    assert "rapid override has no effect" in " ".join(capsys.readouterr().out.split())
    figures = json.loads(report.read_text())
    assert figures["rapids"]["shaped"] >= 2
    assert target.read_bytes().count(b"\n") == target.read_bytes().count(b"\r\n")
    assert main(arguments) == 0
    assert "rapids" not in json.loads(report.read_text())
