"""The oracle of the shortest time against closed forms and symmetries."""

import math

import numpy as np
import pytest

from shapegcode.io.units import FloatArray
from time_optimal import (
    CallablePath,
    Limits,
    RoundedPolyline,
    TimeOptimal,
    largest_ratios,
    rounded_polyline,
    sampled_path,
    time_optimal,
)


def straight(length: float) -> CallablePath:
    def constant(value: float) -> FloatArray:
        return np.array([value])

    return CallablePath(
        length,
        lambda p: np.tile(constant(1.0), (len(p), 1)),
        lambda p: np.tile(constant(0.0), (len(p), 1)),
        lambda p: np.tile(constant(0.0), (len(p), 1)),
    )


def circle(radius: float) -> CallablePath:
    def turned(p: FloatArray, quarter: int) -> FloatArray:
        at = p / radius + 0.5 * math.pi * quarter
        return np.column_stack((np.cos(at), np.sin(at))) / radius**quarter

    return CallablePath(2.0 * math.pi * radius, lambda p: turned(p, 0), lambda p: turned(p, 1), lambda p: turned(p, 2))


def limits(axes: int, velocity: float = 100.0, acceleration: float = 1000.0, jerk: float = 5e4) -> Limits:
    return Limits(np.full(axes, velocity), np.full(axes, acceleration), np.full(axes, jerk))


def seven_phases_s(length: float, velocity: float, acceleration: float, jerk: float) -> float:
    """Time from rest to rest over a straight line."""
    ramp = acceleration / jerk  # of the acceleration
    reaches = velocity * jerk >= acceleration**2
    rise = velocity / acceleration + ramp if reaches else 2.0 * math.sqrt(velocity / jerk)
    if velocity * rise <= length:
        return rise + length / velocity
    if length >= 2.0 * acceleration * ramp**2:
        reached = acceleration * 0.5 * (math.sqrt(ramp**2 + 4.0 * length / acceleration) - ramp)
        return 2.0 * (reached / acceleration + ramp)
    return 4.0 * math.cbrt(length / (2.0 * jerk))


def zigzag(seed: int, corners: int, length: float, half_width: float) -> RoundedPolyline:
    rng = np.random.default_rng(seed)
    angle = np.cumsum(rng.normal(0.0, 1.0, corners + 1))
    legs = rng.uniform(0.3, 1.7, corners + 1)
    legs *= length / legs.sum()
    points = np.zeros((corners + 2, 2))
    points[1:] = np.cumsum(np.column_stack((np.cos(angle), np.sin(angle))) * legs[:, None], axis=0)
    return rounded_polyline(points, np.full(corners, half_width))


def holds(path: CallablePath | RoundedPolyline, found: TimeOptimal, bounds: Limits) -> None:
    assert found.ratios.largest <= 1.005
    # Points that the solver did not choose.
    assert largest_ratios(path, bounds, found.profile, 37).largest <= 1.005
    assert found.refinement_change < 0.002


@pytest.mark.parametrize(
    ("length", "velocity", "acceleration", "jerk"),
    [
        (10.0, 100.0, 1000.0, 5e4),
        (1.0, 100.0, 1000.0, 5e4),
        (50.0, 100.0, 1000.0, 5e4),
        (0.05, 100.0, 1000.0, 5e4),  # jerk alone
        (10.0, 100.0, 1000.0, 1e6),  # nearly no jerk
        (40.0, 20.0, 1000.0, 2e4),  # speed reached before the acceleration
    ],
)
def test_straight_line_takes_seven_phases(length: float, velocity: float, acceleration: float, jerk: float) -> None:
    path, bounds = straight(length), limits(1, velocity, acceleration, jerk)
    found = time_optimal(path, bounds)
    assert found.time_s == pytest.approx(seven_phases_s(length, velocity, acceleration, jerk), rel=0.003)
    holds(path, found, bounds)
    # The instants by another quadrature: p(t) must get there.
    at = np.linspace(0.0, 1.0, 20001) ** 3 * length / 2.0  # dense at rest, where dt = dp/√b grows
    b = found.profile.at(0.5 * (at[1:] + at[:-1]))[0]
    assert 2.0 * np.sum(np.diff(at) / np.sqrt(b)) == pytest.approx(found.time_s, rel=0.002)


def test_circle_at_low_feed_is_a_straight_line_bent() -> None:
    path = circle(5.0)
    bounds = Limits(np.full(2, 100.0), np.full(2, 1000.0), np.full(2, 5e4), feed=lambda p: np.full(len(p), 20.0))
    found = time_optimal(path, bounds)
    assert found.time_s == pytest.approx(seven_phases_s(path.length, 20.0, 1000.0, 5e4), rel=0.003)
    holds(path, found, bounds)


def test_circle_at_the_limits_of_its_axes() -> None:
    """Hardly slower than without a limit of the jerk, and faster where two axes share the acceleration."""
    path, bounds = circle(5.0), limits(2)
    found = time_optimal(path, bounds)
    holds(path, found, bounds)
    b = found.profile.at(np.linspace(0.3, 0.7, 401) * path.length)[0]
    assert np.max(b) > 5.0 * 1000.0 > np.min(b)
    without_jerk = time_optimal(path, limits(2, jerk=1e8)).time_s
    assert without_jerk < found.time_s < without_jerk + 4.0 * 1000.0 / 5e4


def test_polyline_backwards_and_in_other_units_of_time() -> None:
    path = zigzag(3, 7, 25.0, 0.2)
    bounds = limits(2)
    found = time_optimal(path, bounds)
    holds(path, found, bounds)
    assert max(found.start_times_s) < min(found.start_times_s) * 1.001
    back = CallablePath(
        path.length,
        lambda p: -path.derivatives(path.length - p)[0],
        lambda p: path.derivatives(path.length - p)[1],
        lambda p: -path.derivatives(path.length - p)[2],
        path.length - path.breaks,
        path.scales,
    )
    assert time_optimal(back, bounds).time_s == pytest.approx(found.time_s, rel=0.001)
    assert time_optimal(path, limits(2, 1e2 * 3, 1e3 * 9, 5e4 * 27)).time_s == pytest.approx(
        found.time_s / 3.0, rel=0.001
    )
    times = [time_optimal(path, limits(2, jerk=jerk)).time_s for jerk in (1e4, 5e4, 5e5)]
    assert times[0] > times[1] > times[2]


def test_feed_that_jumps_and_cap_are_kept() -> None:
    path = zigzag(5, 6, 30.0, 0.3)
    bounds = Limits(
        np.full(2, 100.0),
        np.full(2, 1000.0),
        np.full(2, 5e4),
        feed=lambda p: np.where(p < 12.0, 60.0, 15.0),
        cap=lambda p: 400.0 + 50.0 * p,
        breaks=np.array([12.0]),
    )
    found = time_optimal(path, bounds)
    holds(path, found, bounds)
    assert found.ratios.feed > 0.99 and found.ratios.cap > 0.99


def test_samples_give_what_the_functions_give() -> None:
    path, bounds = circle(5.0), limits(2)
    p = np.linspace(0.0, path.length, 4001)
    assert time_optimal(sampled_path(p, *path.derivatives(p)), bounds).time_s == pytest.approx(
        time_optimal(path, bounds).time_s, rel=0.001
    )


def test_rounded_polyline_against_its_definition() -> None:
    points = np.array([[0.0, 0.0, 0.0, 1.0], [3.0, 0.0, 0.0, 2.0], [3.0, 4.0, 0.0, 2.0], [6.0, 4.0, 2.0, -5.0]])
    widths = [0.5, 3.0]  # the second reaches into the first, and over the end
    path = rounded_polyline(points, widths)
    assert path.length == pytest.approx(7.0 + math.sqrt(13.0))
    rng = np.random.default_rng(0)
    p = rng.uniform(0.0, path.length, 400)  # not in order
    first, second, third = path.derivatives(p)
    step = 1e-4
    middle, below, above = (path.position(p + d) for d in (0.0, -step, step))
    np.testing.assert_allclose((above - below) / (2.0 * step), first, atol=1e-6)
    np.testing.assert_allclose((above - 2.0 * middle + below) / step**2, second, atol=2e-2)
    smooth = np.min(np.abs(p[:, None] - path.breaks), axis=1) > 2.0 * step
    slope = (path.derivatives(p + step)[1] - path.derivatives(p - step)[1]) / (2.0 * step)
    np.testing.assert_allclose(slope[smooth], third[smooth], atol=1e-6)
    directions = np.diff(points, axis=0) / np.array([3.0, 4.0, math.sqrt(13.0)])[:, None]
    wanted = np.zeros((400, 4))
    for k, d in enumerate(widths):
        u = (p - (3.0, 7.0)[k]) / d
        bump = np.maximum(1.0 - np.abs(u), 0.0) / d
        wanted += bump[:, None] * (directions[k + 1] - directions[k])
    np.testing.assert_allclose(second, wanted, atol=1e-12)
    np.testing.assert_allclose(path.position(np.zeros(1))[0], points[0])
    narrow = rounded_polyline(points, [0.5, 0.5])
    np.testing.assert_allclose(narrow.position(np.array([narrow.length]))[0], points[-1], atol=1e-12)
    with pytest.raises(ValueError, match="half-width"):
        rounded_polyline(points, [0.5])
    with pytest.raises(ValueError, match="without length"):
        rounded_polyline(np.array([[0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]), [])
