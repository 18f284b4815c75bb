"""Tests of the judge's player and plant: closed forms, published figures."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from scipy.signal import lsim

from judge import (
    Mode,
    Move,
    contour_error_um,
    durations,
    interpret,
    path_polyline,
    play,
    residual_um,
    response,
    rest_index,
)
from judge.generate import programs
from shapegcode.io.units import FloatArray

RANDOM = settings(max_examples=80, deadline=None, suppress_health_check=list(HealthCheck))
MODES = [(46.0, 0.02), (131.0, 0.02)]
HEAD = "G21 G17 G90 G94\nG0 X0 Y0 Z0\n"


def cuts(body: str, **options: Any) -> list[Move]:
    return interpret(HEAD + body, **options).cuts


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


def paper_path(speed: float, reduction: float, step_s: float) -> FloatArray:
    """Set-points of the path of paper 000: line 20, quarter arc R20, line 20; 50 ms ramps."""
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


def shaped(points: FloatArray, taps: dict[int, float]) -> FloatArray:
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
    assert late[0] < 1.0 and 3.5 < late[1] < 6.0  # 0.2 and 4.7, depending on the phase


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
    """Steady state on a circle at Ω: radius R/(1 − (Ω/ω)²)."""
    speed, radius = 198.0, 20.0
    moves = cuts(f"G3 I-{radius} F{speed * 60}\n" + f"I-{radius}\n" * 5)
    _, _, moved = response(play(moves, acceleration_samples=100), [(46.0, 0.02)] * 2 + [None], 1e-3)
    swing = np.hypot(moved[20000:24000, 0] + radius, moved[20000:24000, 1]).mean() - radius
    ratio = (speed / radius / (2 * math.pi * 46)) ** 2
    half = speed / radius * 0.5e-3
    average = radius * (1 - math.sin(100 * half) / (100 * math.sin(half)))
    assert swing + average == pytest.approx(ratio / (1 - ratio) * (radius - average), abs=2e-4)
    assert ratio / (1 - ratio) * radius == pytest.approx(0.0235, abs=1e-4)


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
