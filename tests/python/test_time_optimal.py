"""Time-optimal trajectories against an oracle of the shortest time, and by NumPy: limits, tolerance, ends."""

from typing import Any

import numpy as np
import pytest

import shapegcode as sg
from judge.plant import distances_from_polyline
from shapegcode.io.units import FloatArray
from time_optimal import Limits, rounded_polyline, time_optimal

PERIOD_S = 0.001
LIMITS: dict[str, Any] = {
    "max_feed_mm_per_s": [120.0, 100.0, 80.0],
    "max_acceleration_mm_per_s2": [1000.0, 800.0, 600.0],
    "max_jerk_mm_per_s3": [50_000.0, 30_000.0, 25_000.0],
}


def differences(points: FloatArray, order: int) -> FloatArray:
    """Over the period, with rest before and after."""
    whole = np.vstack([np.tile(points[:1], (order, 1)), points, np.tile(points[-1:], (order, 1))])
    return np.asarray(np.diff(whole, order, axis=0) / PERIOD_S**order)


def polyline(seed: int, corners: int, size: float) -> FloatArray:
    steps = np.random.default_rng(seed).normal(0.0, size, (corners, 3))
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])


@pytest.mark.parametrize("seed", range(6))
def test_limits_and_tolerance_are_kept_and_the_end_is_reached(seed: int) -> None:
    corners, tolerance_mm = polyline(seed, 15, 4.0), 10.0 ** (-1.0 - 0.3 * seed)
    points = sg.time_optimal_trajectory(corners, contour_tolerance_mm=tolerance_mm, feed_mm_per_s=90.0, **LIMITS)
    for order, name in enumerate(LIMITS, start=1):
        assert (np.abs(differences(points, order)).max(axis=0) <= 1.001 * np.array(LIMITS[name])).all()
    assert np.linalg.norm(differences(points, 1), axis=1).max() <= 90.0 * 1.001
    assert distances_from_polyline(np.asarray(points), corners).max() <= tolerance_mm * (1 + 1e-6)
    assert (points[0] == corners[0]).all()
    assert (points[-1] == corners[-1]).all()


@pytest.mark.parametrize("seed", range(4))
def test_it_takes_little_more_than_the_shortest_time(seed: int) -> None:
    """Corners far enough apart to be rounded each by itself: then d = 6 tolerance / turn."""
    corners, tolerance_mm = polyline(seed + 10, 8, 8.0), 0.05
    legs = np.diff(corners, axis=0)
    turns = np.linalg.norm(np.diff(legs / np.linalg.norm(legs, axis=1)[:, None], axis=0), axis=1)
    limits = [np.array(limit) for limit in LIMITS.values()]
    oracle = time_optimal(
        rounded_polyline(corners, 6.0 * tolerance_mm / turns), Limits(*limits, feed=lambda p: np.full(len(p), 90.0))
    )
    points = sg.time_optimal_trajectory(corners, contour_tolerance_mm=tolerance_mm, feed_mm_per_s=90.0, **LIMITS)
    ratio = (len(points) - 1) * PERIOD_S / oracle.time_s
    assert 0.998 <= ratio <= 1.10


def test_corners_that_do_not_limit_the_motion_are_braked_through() -> None:
    """Short lines at a low jerk limit: 1.055 of the shortest time if braking ends at each corner."""
    flat = [[0.0, 0.0], [0.35, 0.1], [1.16, 0.26], [3.27, 0.12], [7.24, -1.47], [7.66, -1.76], [8.38, -2.41]]
    corners = np.column_stack([np.array(flat), np.zeros(len(flat))])
    limits = {
        "max_feed_mm_per_s": [123.0, 160.0, 212.0],
        "max_acceleration_mm_per_s2": [1650.0, 1380.0, 1800.0],
        "max_jerk_mm_per_s3": [25_400.0, 24_500.0, 25_400.0],
    }
    half_widths = np.array([0.36199599, 0.74988169, 0.83358408, 0.75284616, 0.75284616])  # their sum is the tolerance
    oracle = time_optimal(
        rounded_polyline(corners, half_widths),
        Limits(*map(np.array, limits.values()), feed=lambda p: np.full(len(p), 174.0)),
    )
    points = sg.time_optimal_trajectory(corners, contour_tolerance_mm=0.044, feed_mm_per_s=174.0, **limits)
    assert 0.998 <= (len(points) - 1) * PERIOD_S / oracle.time_s <= 1.04


def test_a_fine_polyline_is_run_through_at_its_feed() -> None:
    """A circle of chords: no corner slows it, and the limits hold."""
    angle = np.linspace(0.0, 2.0 * np.pi, 721)
    corners = np.column_stack([20.0 * np.cos(angle), 20.0 * np.sin(angle), np.zeros_like(angle)])
    points = sg.time_optimal_trajectory(corners, feed_mm_per_s=50.0, **LIMITS)
    length = np.linalg.norm(np.diff(corners, axis=0), axis=1).sum()
    assert (len(points) - 1) * PERIOD_S <= length / 50.0 + 0.12


def test_lines_and_arcs_of_a_program_are_planned_with_their_feeds(tmp_path: Any) -> None:
    text = "%\nO1\nG21 G17 G90 G94 G64\nG0 X0 Y0 Z0\nG1 X30 F3000\nG3 X30 Y10 I0 J5\nG1 X0 F1200\nM30\n%\n"
    (tmp_path / "part.nc").write_text(text, encoding="ascii")
    path = max((region.path for region in sg.Program.read(tmp_path / "part.nc", "vx500").regions), key=len)
    points = sg.time_optimal_trajectory(path, contour_tolerance_mm=0.02, **LIMITS)
    for order, name in enumerate(LIMITS, start=1):
        assert (np.abs(differences(points, order)).max(axis=0) <= 1.001 * np.array(LIMITS[name])).all()
    assert distances_from_polyline(np.asarray(points), np.asarray(path.polyline(0.005))).max() <= 0.02 + 1e-3
    assert (points[-1] == path.end_mm).all()


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"period_s": 0.0}, "period"),
        ({"max_jerk_mm_per_s3": 0.0}, "jerk limit is 0"),
        ({"max_acceleration_mm_per_s2": np.inf}, "acceleration limit is inf"),
        ({"contour_tolerance_mm": -0.01}, "tolerance is -0.01"),
        ({"feed_mm_per_s": 0.0}, "feed"),
        ({"path": [[0.0, 0.0]]}, "shape"),
        ({"path": [[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0]]}, "not finite"),
    ],
)
def test_what_cannot_be_planned_is_refused(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(sg.ArgumentError, match=said):
        sg.time_optimal_trajectory(**{"path": [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]], **LIMITS, **wrong})
