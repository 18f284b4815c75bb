"""Tests of the judge itself: closed forms, published figures, samples, good and bad conversions."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.signal import lsim

from judge import (
    JudgeError,
    Mode,
    Move,
    contour_error_um,
    durations,
    interpret,
    path_polyline,
    play,
    regions,
    residual_um,
    response,
    rest_index,
    split,
    verify_conversion,
)
from judge.generate import programs
from judge.interpreter import PLANES

Vector = npt.NDArray[np.float64]
PROGRAMS = Path(__file__).parents[1] / "golden" / "programs"
SAMPLES = sorted(p.name for p in PROGRAMS.iterdir() if p.suffix.lower() == ".nc")
RANDOM = settings(max_examples=80, deadline=None, suppress_health_check=list(HealthCheck))
MODES = [(46.0, 0.02), (131.0, 0.02)]
HEAD = "G21 G17 G90 G94\nG0 X0 Y0 Z0\n"


def read(name: str) -> str:
    return (PROGRAMS / name).read_bytes().decode("ascii")


def centre_of(name: str) -> Any:
    return "absolute" if name == "BOTTLE.NC" else "incremental"


def cuts(body: str, **options: Any) -> list[Move]:
    return interpret(HEAD + body, **options).cuts


# ---- interpreter: arcs -------------------------------------------------------------------------------------


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


# ---- interpreter: everything else --------------------------------------------------------------------------


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


# ---- sample programs ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SAMPLES)
def test_sample_programs(name: str) -> None:
    text = read(name)
    result = interpret(text, arc_centre=centre_of(name))
    for move in result.moves:
        if move.kind == "arc":
            assert move.radius is not None and move.end_radius is not None
            assert abs(move.radius - move.end_radius) < 2.6e-3
    assert not result.remarks
    assert verify_conversion(text, text, arc_centre=centre_of(name)) == []


def test_bottle_has_absolute_centres() -> None:
    with pytest.raises(JudgeError, match=r"line 12: .*2\.4514 mm off"):
        interpret(read("BOTTLE.NC"))


def test_absolute_and_incremental_sample_are_the_same_part() -> None:
    absolute, incremental = interpret(read("TEST_G90.NC")).cuts, interpret(read("TEST_G91.NC")).cuts
    assert len(absolute) == len(incremental) == 121
    for one, other in zip(absolute, incremental, strict=True):
        assert one.kind == other.kind and one.feed == other.feed
        known = ~np.isnan(one.delta)
        # The incremental words are rounded on their own: Y-37.198 stands for a way of 37.199.
        assert other.delta[known] == pytest.approx(one.delta[known], abs=1.001e-3)
        assert one.sweep == pytest.approx(other.sweep)


# ---- player ------------------------------------------------------------------------------------------------


def test_ceil_blocks_start_on_a_tick() -> None:
    moves = cuts("G1 X1 F6000\nX1.25\nY10 F600")  # 100 mm/s: 10 ticks, 2.5 → 3 ticks; 10 mm/s: 1000 ticks
    points = play(moves)
    assert durations(moves) == pytest.approx([0.010, 0.003, 1.0])
    assert len(points) == 1 + 10 + 3 + 1000
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert steps[:14] == pytest.approx([0.1] * 12 + [0.05] + [0.01])
    assert points[-1] == pytest.approx([1.25, 10, 0])


def test_carry_runs_on() -> None:
    moves = cuts("G1 X1 F6000\nX1.25\nX2")
    assert durations(moves, block_end="carry") == pytest.approx([0.01, 0.0025, 0.0075])
    points = play(moves, block_end="carry")
    assert points[:, 0] == pytest.approx(np.linspace(0, 2, 21))
    assert len(play(moves, block_end="carry", override=0.5)) == 41


def test_a_feed_rounded_up_lasts_one_period() -> None:
    length, period = 0.4567, 0.005
    rounded_up = math.ceil(length / period * 60 * 10) / 10
    moves = cuts(f"G1 X{length} F{rounded_up}")
    assert durations(moves, period_s=0.001) == pytest.approx([period])
    assert durations(cuts(f"G1 X{length} F{rounded_up - 5}")) == pytest.approx([period + 0.001])


def test_moving_average_and_arc() -> None:
    moves = cuts("G3 I-10 F6000")
    points = play(moves)
    assert np.hypot(points[:, 0] + 10, points[:, 1]) == pytest.approx(np.full(len(points), 10.0))
    line = play(cuts("G1 X10 F6000"), acceleration_samples=50)
    assert len(line) == 101 + 49
    assert np.diff(line[:, 0])[[0, 49, 98, 99, 148]] == pytest.approx([0.002, 0.1, 0.1, 0.1, 0.002], abs=2.1e-3)
    assert np.diff(line[:52, 0], 2)[:48] == pytest.approx(np.full(48, 0.1 / 50))
    assert line[-1, 0] == pytest.approx(10.0)


def test_moving_average_shrinks_a_circle_by_the_second_moment() -> None:
    samples, speed, radius = 50, 100.0, 10.0
    points = play(cuts(f"G3 I-{radius} F{speed * 60}\nI-{radius}"), acceleration_samples=samples)
    middle = points[len(points) // 4]
    shrink = 1 - math.hypot(middle[0] + radius, middle[1]) / radius
    variance = (samples**2 - 1) / 12 * 1e-6
    assert shrink == pytest.approx(variance * (speed / radius) ** 2 / 2, rel=0.02)


def test_incremental_from_an_unknown_origin_is_played() -> None:
    points = play(interpret("G91 G1 X1 F600\nY1\nG3 X1 Y1 J1").cuts)
    assert points[-1] == pytest.approx([2, 2, 0])


def test_player_refuses_what_it_cannot_know() -> None:
    with pytest.raises(ValueError, match="rapid"):
        play(interpret(HEAD + "G0 X1").moves[1:])
    with pytest.raises(ValueError, match="not known"):
        play(interpret("G1 X1 F100").cuts)


# ---- plant -------------------------------------------------------------------------------------------------


def paper_path(speed: float, reduction: float, step_s: float) -> Vector:
    """Set-points of the path of spec section 3: line 20, quarter arc R20, line 20; 50 ms ramps."""
    ramp, on_arc, arc = 0.05, speed * (1 - reduction), math.pi * 10
    steady = (20 - speed / 2 * ramp - (speed + on_arc) / 2 * ramp) / speed
    times = np.cumsum([0, ramp, steady, ramp, arc / on_arc, ramp, steady, ramp])
    speeds = np.array([0, speed, speed, on_arc, on_arc, speed, speed, 0])
    at = np.concatenate([[0], np.cumsum(np.diff(times) * (speeds[1:] + speeds[:-1]) / 2)])
    t = np.minimum(np.arange(0, times[-1] + step_s, step_s), times[-1])
    i = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    dt = t - times[i]
    s = at[i] + speeds[i] * dt + (np.diff(speeds) / np.diff(times))[i] * dt**2 / 2
    angle = np.clip((s - 20) / 20, 0, np.pi / 2)
    x = np.where(s < 20, s, 20 + 20 * np.sin(angle))
    y = 20 * (1 - np.cos(angle)) + np.maximum(s - 20 - arc, 0)
    return np.stack([x, y], axis=1)


def shaped(points: Vector, taps: dict[int, float]) -> Vector:
    kernel = np.zeros(max(taps) + 1)
    for k, a in taps.items():
        kernel[k] = a / sum(taps.values())
    held = np.concatenate([points, np.repeat(points[-1:], len(kernel) - 1, axis=0)])
    return np.stack([np.convolve(c - c[0], kernel)[: len(held)] + c[0] for c in held.T], axis=1)


def test_unshaped_residual_of_the_paper_path() -> None:
    points = paper_path(200, 0.01, 1e-4)
    assert residual_um(points, MODES, 1e-4, still_mm=1e-9) == pytest.approx([16.7, 8.4], abs=0.05)
    late = residual_um(points, MODES, 1e-4, still_mm=1e-9, delay_s=0.03)
    assert late == pytest.approx([13.8, 5.1], abs=0.05)


def test_ideal_minimal_shaper_and_its_staircase() -> None:
    step = 1e-6 * 2
    taps = {round(t / step): a for t, a in ((0, 0.49156), (6.514e-3, 0.06297), (11.326e-3, 0.44547))}
    fine = shaped(paper_path(200, 0.01, step), taps)
    keep = fine[::50]
    assert residual_um(keep, MODES, 1e-4, still_mm=1e-9, delay_s=0.03).max() < 0.05
    blocks = fine[::2500]
    blocks = np.concatenate([blocks, fine[-1:]])
    late = residual_um(blocks, MODES, 5e-3, still_mm=1e-9, delay_s=0.03)
    assert late[0] < 1.0 and 3.5 < late[1] < 6.0  # spec section 4: 0.2 and 4.7, depending on the phase


def test_grid_exact_shaper_survives_the_staircase() -> None:
    taps = dict(enumerate((0.20394, 0.16162, 0.31387, 0.15731, 0.16327)))
    points = shaped(paper_path(200, 0.01, 5e-3), taps)
    assert residual_um(points, MODES, 5e-3, still_mm=1e-9).max() < 0.05


@pytest.mark.parametrize(("frequency", "damping"), [(46.0, 0.02), (131.0, 0.001), (8.0, 0.5)])
def test_response_agrees_with_lsim(frequency: float, damping: float) -> None:
    rng = np.random.default_rng(1)
    points = np.cumsum(rng.normal(size=(60, 1)), axis=0) + 100.0
    times, command, moved = response(points, [(frequency, damping)], 1e-3, rest_s=0.05)
    w = 2 * math.pi * frequency
    system = ([2 * damping * w, w * w], [1, 2 * damping * w, w * w])
    _, expected, _ = lsim(system, command[:, 0] - 100.0 - points[0, 0] + 100.0, times)
    assert moved[:, 0] - points[0, 0] == pytest.approx(expected, abs=1e-9)
    assert command[::10][:60] == pytest.approx(points)


def test_residual_after_a_ramp_in_closed_form() -> None:
    """Undamped, constant speed v for T: afterwards e has amplitude (v/ω)·2·|sin(ωT/2)|."""
    f, v = 131.0, 100.0
    w = 2 * math.pi * f
    for ticks in (7, 20, 33):
        points = np.minimum(np.arange(ticks + 5), ticks)[:, None] * v * 1e-3
        expected = 1000 * v / w * 2 * abs(math.sin(w * ticks * 1e-3 / 2))
        assert residual_um(points, [(f, 0.0)], 1e-3) == pytest.approx([expected], rel=4e-3)
    assert rest_index(points) == 33


def test_modes_per_axis() -> None:
    points = np.repeat(np.minimum(np.arange(30), 20)[:, None] * 0.1, 3, axis=1)
    both = residual_um(points, [None, Mode(46, 0.02), [(46.0, 0.02), Mode(131, 0.02, share=0.0)]], 1e-3)
    assert both[0] == 0 and both[1] == both[2] > 0
    assert residual_um(points[:1], [None] * 3, 1e-3).tolist() == [0, 0, 0]
    with pytest.raises(ValueError, match="damping ratio"):
        residual_um(points, [(46.0, 1.0)] * 3, 1e-3)


def test_a_table_on_a_circle_swings_outwards() -> None:
    """Steady state on a circle at Ω: radius R/(1 − (Ω/ω)²) (spec section 5)."""
    speed, radius = 198.0, 20.0
    moves = cuts(f"G3 I-{radius} F{speed * 60}\n" + f"I-{radius}\n" * 5)
    _, _, moved = response(play(moves, acceleration_samples=100), [(46.0, 0.02)] * 2 + [None], 1e-3)
    swing = np.hypot(moved[20000:24000, 0] + radius, moved[20000:24000, 1]).mean() - radius
    ratio = (speed / radius / (2 * math.pi * 46)) ** 2
    half = speed / radius * 0.5e-3
    average = radius * (1 - math.sin(100 * half) / (100 * math.sin(half)))
    assert swing + average == pytest.approx(ratio / (1 - ratio) * (radius - average), abs=2e-4)
    assert ratio / (1 - ratio) * radius == pytest.approx(0.0235, abs=1e-4)


# ---- contour error -----------------------------------------------------------------------------------------


def test_contour_error_of_displaced_points() -> None:
    moves = cuts("G1 X20 F100\nG3 X40 Y20 J20\nG1 Y40\nG2 X44 Y44 Z7 I4\nG19 G3 Y44 Z7 J.05 K.01")
    for distance in (0.0, 0.0003, 0.02, 1.5):
        angle = np.linspace(-1.5, -0.1, 37)
        on_arc = np.stack([20 + (20 + distance) * np.cos(angle), 20 + (20 + distance) * np.sin(angle)], axis=1)
        on_line = np.stack([np.linspace(0.5, 19, 20), np.full(20, -distance)], axis=1)
        points = np.concatenate([on_arc, on_line])
        error = contour_error_um(np.column_stack([points, np.zeros(len(points))]), moves)
        assert error.max_um == pytest.approx(1000 * distance, abs=0.05)
        assert error.rms_um == pytest.approx(1000 * distance, abs=0.05)
    path = np.concatenate([m.points(np.random.default_rng(2).random(200)) for m in moves])
    assert contour_error_um(path, moves).max_um < 0.1


@RANDOM
@given(programs(max_contours=1, cycles=False))
def test_played_set_points_lie_on_the_path(text: str) -> None:
    moves = interpret(text).cuts
    for block_end in ("ceil", "carry"):
        points = play(moves, period_s=0.05, block_end=block_end)
        assert contour_error_um(points, moves).max_um < 0.1
    assert points[-1] == pytest.approx(moves[-1].end)
    assert path_polyline(moves)[-1] == pytest.approx(moves[-1].end)


# ---- generator ---------------------------------------------------------------------------------------------


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


# ---- conversions -------------------------------------------------------------------------------------------


def chop(text: str, largest_sweep: float = math.radians(80.0), **options: Any) -> str:
    """A converter that shapes nothing: it halves lines, cuts arcs into pieces and restores all modes."""
    original = interpret(text, **options)
    inside = {n for a, b in regions(original) for n in range(a, b + 1)}
    out: list[str] = []
    for record in original.lines:
        if record.number not in inside or not record.moves:
            out.append(record.text)
            continue
        out.extend(chopped(record, largest_sweep))
    return "\n".join(out)


def chopped(record: Any, largest_sweep: float) -> list[str]:
    """One cutting line as several lines."""
    move: Move = record.moves[0]
    inch = record.modal["units"] == "G20"
    unit, digits = (25.4, 4) if inch else (1.0, 3)
    keep = " ".join(a + v for a, v in record.words if a in "NF")
    codes = " ".join(g for g in record.g_codes if g not in ("G00", "G01", "G02", "G03", "G09"))
    pieces = 2 if move.sweep is None else max(2, math.ceil(abs(move.sweep) / largest_sweep))
    at = np.zeros(3)
    lines: list[str] = []
    for k in range(1, pieces + 1):
        to = np.round(move.offsets(k / pieces)[0] / unit, digits) * unit if k < pieces else move.delta
        step, at = to - at, to
        words = []
        for i, axis in enumerate("XYZ"):
            value = step[i] if record.modal["distance"] == "G91" else move.start[i] + to[i]
            if abs(step[i]) > 1e-9:
                words.append(f"{axis}{value / unit:.{digits}f}")
        code = "G01"
        if move.kind == "arc" and move.normal_axis is not None and move.radius is not None:
            chord = math.hypot(*np.delete(step, move.normal_axis))
            if chord > 0.1:
                code = record.modal["motion"]
                words.append(f"R{math.ceil(move.radius / unit * 10**digits + 1) / 10**digits:.{digits}f}")
        if words or k == 1:
            head = [keep, codes] if k == 1 else []
            lines.append(" ".join([*[w for w in head if w], code, *words]))
    if code != record.modal["motion"]:
        lines.append(record.modal["motion"])
    return lines


@RANDOM
@given(programs())
def test_a_faithful_conversion_is_acquitted(text: str) -> None:
    assert verify_conversion(text, chop(text), contour_tolerance_um=60.0) == []
    ranges = regions(interpret(text))
    assert verify_conversion(text, chop(text), ranges) == []


@pytest.mark.parametrize("name", SAMPLES)
def test_faithful_conversion_of_the_samples(name: str) -> None:
    text = read(name)
    emitted = chop(text, arc_centre=centre_of(name))
    assert verify_conversion(text, emitted, arc_centre=centre_of(name), contour_tolerance_um=10.0) == []


BASE = """%
O0001
G21 G17 G90 G94 G64
T1 M6
G54
S1000 M3
G0 X0 Y0
G43 H1 Z5. M8
(POCKET)
N10 G1 Z-1. F100.
N20 X20. F6000.
(ARC)
N30 G3 X40. Y20. R20.
N40 G9 G1 Y40.
N50 X50.

N60 G0 Z5.
G4 P500
M5
G91 G28 Z0
M30
%
"""
GOOD = chop(BASE)


def swap(old: str, new: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        assert text.count(old) == 1, (old, text)
        return text.replace(old, new)

    return change


def test_the_base_conversion_is_good() -> None:
    assert verify_conversion(BASE, GOOD, contour_tolerance_um=20.0) == []
    assert "N30 G03 X34.142 Y5.858 R20.001" in GOOD


@pytest.mark.parametrize(
    ("change", "letters"),
    [
        (swap("G4 P500\n", ""), "a"),
        (swap("G4 P500\n", "G04 P500\n"), "a"),
        (swap("M5\n", "M5 \n"), "a"),
        (swap("M5\n", "M5\r\n"), "a"),
        (swap("(ARC)\n", ""), "a"),
        (swap("(POCKET)\n", ""), "a"),
        (swap("G4 P500\n", "(HELLO)\nG4 P500\n"), "a"),
        (swap("\nM30\n%\n", "\nM30\n%"), "a"),
        (swap("N60 G0 Z5.", "F300.\nN60 G0 Z5."), "b"),
        (swap("N60 G0 Z5.", "G2\nN60 G0 Z5."), "b"),
        (swap("N60 G0 Z5.", "G18\nN60 G0 Z5."), "b"),
        (swap("N60 G0 Z5.", "G91\nN60 G0 Z5."), "b"),
        (swap("N60 G0 Z5.", "G61\nN60 G0 Z5."), "b"),
        (swap("G01 X50.000", "G01 X50.002"), "be"),
        (swap("G01 X50.000", "G01 X50.000 F5"), "bc"),
        (swap("G03 X40.000 Y20.000 R20.001", "G03 X40.000 Y20.000 R-20.001"), "cg"),
        (swap("N30 G03 X34.142 Y5.858 R20.001", "N30 G03 X34.142 Y5.858 I0 J20.008"), "c"),
        (swap("N30 G03", "G03"), "d"),
        (swap("G01 Y40.000", "N40 G01 Y40.000"), "d"),
        (swap("N20 F6000.", "N21 F6000."), "d"),
        (swap("G01 X50.000", "G01 XNAN"), "e"),
        (swap("G01 Y40.000\nN50 G01 X45.000", "G01 Y39.990\nN50 G01 X45.000 Y40.000"), "f"),
        (swap("N30 G03 X34.142 Y5.858 R20.001", "N30 G02 X34.142 Y5.858 R20.001"), "g"),
        (swap("N30 G03 X34.142 Y5.858 R20.001", "N30 G01 X34.142 Y5.858"), "g"),
    ],
)
def test_a_spoilt_conversion_is_convicted(change: Callable[[str], str], letters: str) -> None:
    found = verify_conversion(BASE, change(GOOD), contour_tolerance_um=20.0)
    assert {c[1] for c in found} == set(letters), found


def test_vanished_cutting_lines() -> None:
    strong, gaps = split(interpret(BASE))
    run = next(g for g in gaps if g.run)
    text = BASE
    for record in run.run:
        text = text.replace(record.text + "\n", "", 1)
    assert any(c.startswith("(e)") for c in verify_conversion(BASE, text))
    assert len(gaps) == len(strong) + 1


def test_lines_outside_the_ranges_stay() -> None:
    first = BASE.split("\n").index("N20 X20. F6000.") + 1
    found = verify_conversion(BASE, GOOD, [(first, first + 4)])
    assert found and all("outside the shaped ranges" in c or "before a region" in c for c in found)
    assert any("outside every region" in c for c in verify_conversion(BASE, GOOD, []))


def test_drift_from_an_unknown_origin_is_compared() -> None:
    text = "G91\nG0 X1.\nG1 X10. F100.\nY5.\nG0 X3.\nM30"
    good = text.replace("G1 X10. F100.\nY5.", "G1 X4. F100.\nX6.\nY5.")
    assert verify_conversion(text, good) == []
    bad = good.replace("X6.", "X6.002")
    assert {c[1] for c in verify_conversion(text, bad)} == {"b", "e"}


@RANDOM
@given(programs(), st.data())
def test_a_lost_line_is_noticed(text: str, data: st.DataObject) -> None:
    """Whatever strong line or last piece of a run is dropped from a good conversion, the judge says so."""
    emitted = chop(text).split("\n")
    strong, gaps = split(interpret("\n".join(emitted)))
    numbers = [r.number for r in strong]
    for gap in gaps:
        pieces = [r for r in gap.run if r.moves and np.abs(r.moves[0].delta).max() > 0.01]
        if pieces and pieces[-1] is gap.run[-1] and pieces[-1].modal["distance"] == "G91":
            numbers.append(pieces[-1].number)
    i = data.draw(st.sampled_from(numbers))
    assert verify_conversion(text, "\n".join(emitted[: i - 1] + emitted[i:]))
