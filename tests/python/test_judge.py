"""Tests of the judge's interpreter: closed forms, samples, programs at random."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from judge import JudgeError, Move, interpret, verify_conversion
from judge.generate import programs
from judge.records import PLANES
from judge.samples import SAMPLES, centre_of, read_sample

RANDOM = settings(max_examples=80, deadline=None, suppress_health_check=list(HealthCheck))
HEAD = "G21 G17 G90 G94\nG0 X0 Y0 Z0\n"


def cuts(body: str, **options: Any) -> list[Move]:
    return interpret(HEAD + body, **options).cuts


@pytest.mark.parametrize("plane", ["G17", "G18", "G19"])
@pytest.mark.parametrize("code", ["G2", "G3"])
def test_quarter_turn_by_centre_and_by_radius(plane: str, code: str) -> None:
    a, b, normal = PLANES[plane]
    sign = 1 if code == "G3" else -1
    # From (0, 0) about (10, 0): counter-clockwise goes to (10, -10), clockwise to (10, 10).
    end = f"{'XYZ'[a]}10 {'XYZ'[b]}{-sign * 10} {'XYZ'[normal]}3"
    by_centre, by_radius, long_way = (
        cuts(f"{plane} {code} {end} {w} F600")[0] for w in (f"{'IJK'[a]}10", "R10", "R-10")
    )
    for move in (by_centre, by_radius):
        assert move.normal_axis == normal
        assert move.sweep == pytest.approx(sign * math.pi / 2)
        assert move.radius == pytest.approx(10.0)
        assert move.length == pytest.approx(math.hypot(5 * math.pi, 3))
        assert move.centre is not None and move.centre[a] == pytest.approx(10) and abs(move.centre[b]) < 1e-12
        middle = move.points(0.5)[0]
        assert middle[a] == pytest.approx(10 - 10 * math.cos(math.pi / 4))
        assert middle[b] == pytest.approx(-sign * 10 * math.sin(math.pi / 4))
        assert middle[normal] == pytest.approx(1.5)
        assert move.points(1.0)[0] == pytest.approx(move.end)
    assert long_way.sweep == pytest.approx(sign * 1.5 * math.pi)
    assert long_way.centre is not None and abs(long_way.centre[a]) < 1e-12
    assert long_way.centre[b] == pytest.approx(-sign * 10)


@pytest.mark.parametrize("plane", ["G17", "G18", "G19"])
def test_full_circle_and_helix(plane: str) -> None:
    a, _, normal = PLANES[plane]
    for code, sign in (("G2", -1), ("G3", 1)):
        move = cuts(f"{plane} {code} {'IJK'[a]}-5 {'XYZ'[normal]}-2 F100")[0]
        assert move.sweep == pytest.approx(sign * 2 * math.pi)
        assert move.length == pytest.approx(math.hypot(10 * math.pi, 2))
        assert move.end[normal] == -2


def test_half_circle_by_radius() -> None:
    move = cuts("G2 X20 R10 F100")[0]
    assert move.sweep == pytest.approx(-math.pi)
    assert move.points(0.5)[0] == pytest.approx([10, 10, 0])


def test_absolute_centre() -> None:
    text = "G1 X30 F100\nG3 X20 Y10 I20 J0"
    move = interpret(HEAD + text, arc_centre="absolute").cuts[1]
    assert move.centre == pytest.approx([20, 0, 0])
    assert move.sweep == pytest.approx(math.pi / 2)
    with pytest.raises(JudgeError, match="line 4"):
        interpret(HEAD + text)


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ("G2 X10 R4.9 F100", "half the chord"),
        ("G2 X0 Y0 R5 F100", "full circle"),
        ("G2 Z5 R5 F100", "full circle"),
        ("G2 X10 F100", "without R"),
        ("G17 G2 X10 K5 F100", "without R"),
        ("G2 X10 I5.1 F100", "off its radius"),
        ("G2 X10 I0 J0 F100", "radius zero"),
        ("G2 X10 I5", "feed"),
        ("G1 X5 F0", "feed"),
        ("G1 X1.2.3 F100", "cannot read"),
        ("G1 XNAN F100", "cannot read"),
        ("#1=5", "cannot read"),
        ("M3.5", "decimal point"),
        ("G04 P1.5", "decimal point"),
        ("G68 X0 Y0 R30", "not judged"),
        ("(A (B))", "comment"),
        ("G28 G04 X1", "contend"),
        ("M98 P10", "subprogram"),
    ],
)
def test_mistakes_are_refused_with_their_line(block: str, message: str) -> None:
    with pytest.raises(JudgeError, match=message) as caught:
        interpret(HEAD + block)
    assert caught.value.line == 3


def test_arc_needs_known_plane_position() -> None:
    with pytest.raises(JudgeError, match="unknown position"):
        interpret("G3 X1 Y1 R1 F100")
    move = interpret("G91 G3 X1 Y1 J1 F100").cuts[0]
    assert np.isnan(move.end).all() and move.delta == pytest.approx([1, 1, 0])
    assert move.offsets(1.0)[0] == pytest.approx([1, 1, 0])


def test_decimal_point_notations() -> None:
    assert cuts("G1 X10 F100")[0].end[0] == 10.0
    assert cuts("G1 X10 F100", calculator_decimal_point=False)[0].end[0] == pytest.approx(0.010)
    assert cuts("G1 X10. F100", calculator_decimal_point=False)[0].end[0] == 10.0
    inch = interpret("G20 G0 X1. Y10 Z0\nG1 Y0 F2.", calculator_decimal_point=False).moves
    assert inch[0].end[:2] == pytest.approx([25.4, 0.0254])
    assert inch[1].feed == pytest.approx(50.8)
    assert interpret("G4 X2").lines[0].dwell_s == 2.0
    assert interpret("G4 X2", calculator_decimal_point=False).lines[0].dwell_s == 0.002
    assert interpret("G4 P250").lines[0].dwell_s == 0.25


def test_one_digit_feed_is_flagged() -> None:
    result = interpret(HEAD + "G1 X1 F5\nX2 F5.\nX3 F15")
    assert result.one_digit_feeds == [3]


@pytest.mark.parametrize(
    ("block", "unknown"),
    [
        ("G28 X1", [True, False, False]),
        ("G91 G28 Z0", [False, False, True]),
        ("G91 G30 X0 Y0", [True, True, False]),
        ("G53 Z-5", [False, False, True]),
        ("T1 M6", [True, True, True]),
        ("G55", [True, True, True]),
        ("G54", [False, False, False]),
        ("G54.1 P3", [True, True, True]),
        ("G43 H1 Z3", [False, False, False]),
        ("G10 L2 P1 X0", [True, True, True]),
    ],
)
def test_what_makes_positions_unknown(block: str, unknown: list[bool]) -> None:
    assert np.isnan(interpret(HEAD + block).modal["position"]).tolist() == unknown


def test_unknown_at_the_start_and_known_after_a_word() -> None:
    result = interpret("G0 X5\nG91 Y3\nX1")
    assert np.isnan(result.lines[0].modal["position"]).tolist() == [False, True, True]
    assert result.modal["position"][0] == 6
    assert result.modal["drift"][1] == 3
    assert result.moves[1].delta.tolist() == [0, 3, 0]
    assert math.isnan(result.moves[0].delta[0])


def test_coordinate_systems() -> None:
    assert interpret(HEAD + "G0 X10\nG52 X4\nG0 Y1").modal["position"].tolist() == [6, 1, 0]
    assert interpret(HEAD + "G0 X10\nG52 X4\nG52 X0").modal["position"].tolist() == [10, 0, 0]
    assert interpret("G92 X3 Y4").modal["position"][:2].tolist() == [3, 4]


def test_modal_state_and_start_state() -> None:
    state = interpret("G19 G91 G20 G61 G41 D1\nG43 H3 Z1.\nG3 F10.").modal
    keys = "motion plane distance units comp length_offset exact_stop"
    assert [state[k] for k in keys.split()] == ["G03", "G19", "G91", "G20", "G41", "G43H3", "G61"]
    assert state["F"] == pytest.approx(254.0)
    move = interpret("X1", start_state={"motion": "G01", "F": 60.0, "position": [0, 0, 0]}).cuts[0]
    assert move.end.tolist() == [1, 0, 0] and move.feed == 60.0


def test_exact_stop_marks() -> None:
    marks = [r.exact_stop for r in interpret(HEAD + "G1 X1 F100\nG9 X2\nX3\nG61 X4\nX5\nG64\nX6").lines]
    assert marks[2:] == [False, True, False, True, True, False, False]


def test_inverse_time_feed() -> None:
    assert cuts("G93 G1 X10 F6.")[0].feed == pytest.approx(60.0)


def test_drilling_cycle() -> None:
    result = interpret(HEAD + "G0 Z10\nG99 G81 X5 Y5 Z-3 R2 F100\nX7\nG98 X9\nG80\nG0 X0")
    ends = [r.modal["position"].tolist() for r in result.lines[3:7]]
    assert ends == [[5, 5, 2], [7, 5, 2], [9, 5, 10], [9, 5, 10]]
    assert not result.cuts
    assert result.modal["cycle"] == "G80"
    repeated = interpret(HEAD + "G0 Z10\nG91 G81 X5 Z-3 R-8 F100 K3\nG0 X1")
    assert repeated.modal["position"].tolist() == [16, 0, 10]
    assert min(m.end[2] for m in repeated.moves) == -1


def test_tape_format() -> None:
    text = "%TITLE X1\nO0001\nN10 G0 X1 (SAYS G1 X5)\n/ Y2 ;\r\n\r\rZ3\nM30\nX9\n%\nX7"
    result = interpret(text)
    assert result.modal["position"].tolist() == [1, 2, 3]
    assert [r.executed for r in result.lines] == [False, *[True] * 5, False, False, False]
    assert interpret("%\nG0 X1\n%\nX2").modal["position"][0] == 1
    assert result.lines[2].n_words == (10,)


@pytest.mark.parametrize("name", SAMPLES)
def test_sample_programs(name: str) -> None:
    text = read_sample(name)
    result = interpret(text, arc_centre=centre_of(name))
    for move in result.moves:
        if move.kind == "arc":
            assert move.radius is not None and move.end_radius is not None
            assert abs(move.radius - move.end_radius) < 2.6e-3
    assert not result.remarks
    assert verify_conversion(text, text, arc_centre=centre_of(name)) == []


def test_bottle_has_absolute_centres() -> None:
    with pytest.raises(JudgeError, match=r"line 12: .*2\.4514 mm off"):
        interpret(read_sample("BOTTLE.NC"))


def test_absolute_and_incremental_sample_are_the_same_part() -> None:
    absolute, incremental = interpret(read_sample("TEST_G90.NC")).cuts, interpret(read_sample("TEST_G91.NC")).cuts
    assert len(absolute) == len(incremental) == 121
    for one, other in zip(absolute, incremental, strict=True):
        assert one.kind == other.kind and one.feed == other.feed
        known = ~np.isnan(one.delta)
        # The incremental words are rounded on their own: Y-37.198 stands for a way of 37.199.
        assert other.delta[known] == pytest.approx(one.delta[known], abs=1.001e-3)
        assert one.sweep == pytest.approx(other.sweep)


@RANDOM
@given(programs())
def test_generated_programs_are_valid(text: str) -> None:
    result = interpret(text)
    plain = interpret(text, calculator_decimal_point=False)
    assert not result.remarks and len(result.moves) == len(plain.moves)
    for move, same in zip(result.moves, plain.moves, strict=True):
        assert np.array_equal(move.delta, same.delta, equal_nan=True)
        if move.kind == "arc":
            assert move.radius is not None and move.end_radius is not None
            assert abs(move.radius - move.end_radius) <= 1e-3
        if move.is_cut:
            assert 49 < move.feed < 6001
    assert verify_conversion(text, text) == []
