"""Axes beside the path: jog, soft limits, offset, backlash, emergency braking; against closed forms and differences."""

import math
from typing import Any

import numpy as np
import pytest

import shapegcode as sg
from beside_the_path import ACCELERATION, FILTERS, JERK, PERIOD_S, SPEED, control, largest_share
from shapegcode.io.units import FloatArray

ACCEPTED = sg.JogResult.accepted


def ramp_s(speed: float) -> float:
    """Shortest change of speed from rest within the limits."""
    if speed * JERK >= ACCELERATION**2:
        return speed / ACCELERATION + ACCELERATION / JERK
    return 2.0 * math.sqrt(speed / JERK)


def held_on_a_path(**changes: Any) -> tuple[sg.MotionController, list[FloatArray]]:
    made = control(**changes)
    made.push_line([100, 0, 0], 100.0)
    made.push_line([100, 50, 0], 100.0, stop_at_end=True)
    rows = [made.step(300)]
    assert made.jog(0, 10.0) == sg.JogResult.path_moves
    made.hold()
    rows.append(made.run())
    assert made.state.activity == sg.Activity.held
    return made, rows


@pytest.mark.parametrize("filters", FILTERS)
def test_an_axis_is_jogged_from_hold_and_comes_back_onto_the_path(filters: dict[str, Any]) -> None:
    made, rows = held_on_a_path(**filters)
    rest = rows[-1][-1]
    assert made.jog(1, 30.0) == made.jog(2, -5.0) == ACCEPTED
    rows.append(made.step(400))
    assert made.state.activity == sg.Activity.jogging
    np.testing.assert_allclose(np.diff(rows[-1][-20:], axis=0), np.tile([0.0, 0.03, -0.005], (19, 1)), atol=1e-9)
    assert made.jog(1, -60.0) == made.jog(2, 0.0) == ACCEPTED
    rows.append(made.step(200))
    np.testing.assert_allclose(np.diff(rows[-1][-20:], axis=0), np.tile([0.0, -0.06, 0.0], (19, 1)), atol=1e-9)
    made.hold()  # stops a jog as well
    rows.append(made.step(400))
    assert made.state.activity == sg.Activity.held
    np.testing.assert_array_equal(rows[-1][-1], rows[-1][-2])
    assert np.abs(rows[-1][-1] - rest).max() > 1.0
    made.resume()
    rows.append(made.step(1))
    assert made.state.activity == sg.Activity.jogging
    rows.append(made.run())
    assert made.state.activity == sg.Activity.idle
    np.testing.assert_array_equal(rows[-1][-1], [100.0, 50.0, 0.0])
    whole = np.concatenate(rows)
    assert largest_share(whole) <= 1.001
    # The path goes on where it was left: nothing of it is skipped.
    back = np.flatnonzero((np.abs(whole - rest) < 1e-9).all(axis=1))
    assert back[-1] > len(whole) - len(rows[-1])
    on_x = whole[back[-1] :]
    assert (np.abs(on_x[on_x[:, 0] < 99.0][:, 1:]) < 1e-9).all()


@pytest.mark.parametrize("distance", [0.001, 0.05, 2.0, -40.0])
def test_an_increment_takes_the_shortest_time(distance: float) -> None:
    """Seven phases, and a few periods to be rounded to."""
    made = control()
    made.hold()
    made.step(2)
    assert made.jog_by(0, distance, 80.0) == ACCEPTED
    rows = made.run()
    length = abs(distance)
    shortest = ramp_s(80.0) + length / 80.0
    if 80.0 * ramp_s(80.0) > length:
        low, high = 0.0, 80.0
        for _ in range(100):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if middle * ramp_s(middle) > length else (middle, high)
        shortest = 2.0 * ramp_s(low)
    assert rows[-1][0] == distance
    assert largest_share(rows) <= 1.001
    assert shortest - PERIOD_S <= np.count_nonzero(rows[:, 0] != distance) * PERIOD_S <= 1.05 * shortest + 0.008


def test_increments_add_up_and_flushed_goes_on_from_there() -> None:
    made = control(**FILTERS[1])
    made.push_line([100, 0, 0], 100.0)
    rows = [made.step(300)]
    made.flush()
    rows.append(made.step(300))
    rest = rows[-1][-1]
    for _ in range(3):
        assert made.jog_by(0, -4.0, 50.0) == ACCEPTED
        rows.append(made.step(20))
        assert made.flushed() is None
        assert made.push_line([0, 0, 0], 10.0) == sg.PushResult.flushing
    rows.append(made.step(800))
    position = made.flushed()
    np.testing.assert_allclose(position, rest - [12.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(rows[-1][-1], position, atol=1e-9)
    assert made.push_line([0, 0, 0], 80.0, stop_at_end=True) == sg.PushResult.accepted
    rows.append(made.run())
    np.testing.assert_array_equal(rows[-1][-1], [0.0, 0.0, 0.0])
    assert largest_share(np.concatenate(rows)) <= 1.001


def test_a_probe_while_an_axis_is_jogged_stops_it() -> None:
    made = control(**FILTERS[1])
    made.hold()
    made.step(2)
    assert made.jog(2, -20.0) == ACCEPTED
    rows = [made.step(300)]
    latched = made.probe()
    np.testing.assert_array_equal(latched, rows[-1][-1])
    rows.append(made.step(300))
    position = made.flushed()
    late = made.delay_periods + 1.0
    assert 0.0 < latched[2] - position[2] <= 20.0 * (ramp_s(20.0) / 2.0 + (late + 4.0) * PERIOD_S)
    assert largest_share(np.concatenate(rows)) <= 1.001


def test_what_a_jog_answers() -> None:
    made = control(travel=[(-10.0, 60.0), (-10.0, 60.0), (-5.0, 5.0)])
    assert made.jog(0, 1.0) == sg.JogResult.path_moves
    made.hold()
    made.step(2)
    assert made.jog(3, 1.0) == made.jog(-1, 1.0) == sg.JogResult.no_axis
    assert made.jog(0, math.nan) == made.jog_by(0, math.inf, 1.0) == sg.JogResult.not_finite
    assert made.jog_by(0, 1.0, 0.0) == made.jog_by(0, 1.0, -3.0) == sg.JogResult.no_speed
    assert made.jog_by(2, 5.1, 1.0) == sg.JogResult.beyond_travel
    assert made.jog(2, 40.0) == ACCEPTED
    rows = made.run()
    assert rows[-1][2] == 5.0
    assert rows[:, 2].max() <= 5.0 + 1e-9
    assert made.jog(2, 40.0) == sg.JogResult.beyond_travel
    assert made.jog_by(2, -10.0, 40.0) == ACCEPTED
    assert made.run()[-1][2] == -5.0
    made.resume()
    assert made.jog(2, 40.0) == made.jog_by(2, 1.0, 40.0) == sg.JogResult.path_moves


def test_soft_limits_refuse_at_the_push_and_hold_when_they_move() -> None:
    made = control(travel=[(-10.0, 60.0), (-10.0, 60.0), (-5.0, 5.0)])
    assert made.push_line([70, 0, 0], 50.0) == sg.PushResult.beyond_travel
    # Half a circle about (0, 30): its ends are within, its top at x = 30, or x = -30.
    assert made.push_arc([0, 60, 0], [0, 30, 0], math.pi, 50.0) == sg.PushResult.accepted
    assert made.push_arc([0, 0, 0], [0, 30, 0], math.pi, 50.0) == sg.PushResult.beyond_travel
    assert made.push_line([-9, 60, 0], 120.0, stop_at_end=True) == sg.PushResult.accepted
    rows = [made.step(330)]
    top = 20.0
    assert rows[0][-1][0] < top  # on its way to x = 30
    assert made.travel(0, -10.0, top)
    rows.append(made.run())
    assert made.state.activity == sg.Activity.held
    assert made.state.travel_stops == 1
    x, y, _ = rows[-1][-1]
    assert math.hypot(x, y - 30.0) == pytest.approx(30.0, abs=0.05)  # still on the path
    assert x <= top + 0.05
    made.resume()
    rows.append(made.run())  # as near as it gets
    assert made.state.activity == sg.Activity.held
    assert not made.travel(0, 5.0, 4.0)
    assert made.travel(0, -10.0, 60.0)
    made.resume()
    rows.append(made.run())
    np.testing.assert_array_equal(rows[-1][-1], [-9.0, 60.0, 0.0])
    assert largest_share(np.concatenate(rows)) <= 1.001


@pytest.mark.parametrize("filters", FILTERS)
def test_an_offset_is_added_within_its_own_limits(filters: dict[str, Any]) -> None:
    """At rest and in motion; the path beside it is the one without it, later by what the path leaves."""
    limits = sg.OffsetLimits(max_feed=20.0, max_acceleration=300.0, max_jerk=10_000.0, backlash=0.02)
    made = control(offset=[limits, sg.OffsetLimits(), limits], **filters)
    assert not made.offset(1, 1.0)
    assert not made.offset(2, math.nan)
    assert made.push_line([50, 0, 0], 100.0) == sg.PushResult.accepted
    assert made.push_line([50, 30, 0], 100.0, stop_at_end=True) == sg.PushResult.accepted
    rows = [made.step(100)]
    assert made.offset(2, 3.0)
    rows.append(made.step(200))
    assert made.offset(2, -2.0)
    rows += [made.run(), made.step(400)]
    np.testing.assert_allclose(rows[-1][-1], [50.0, 30.0, -2.02], atol=1e-9)  # Z went down last
    np.testing.assert_allclose(made.state.offset, [0.0, 0.0, -2.02], atol=1e-12)
    assert made.push_line([20, 30, 0], 100.0, stop_at_end=True) == sg.PushResult.accepted
    rows += [made.run(), made.step(400)]
    np.testing.assert_allclose(rows[-1][-1], [19.98, 30.0, -2.02], atol=1e-9)
    whole = np.concatenate(rows)
    assert largest_share(whole) <= 1.001
    z = whole[:, 2]
    for order, limit in enumerate((20.0, 300.0, 10_000.0), 1):
        assert np.abs(np.diff(z, n=order)).max() / PERIOD_S**order <= 1.001 * limit


@pytest.mark.parametrize("filters", FILTERS[:2])
def test_an_emergency_stop_takes_the_hardware_limit(filters: dict[str, Any]) -> None:
    most = 6000.0
    made = control(emergency_acceleration=[most] * 3, **filters)
    made.push_line([100, 0, 0], 120.0, stop_at_end=True)
    rows = [made.step(500)]
    at, speed = rows[0][-1][0], (rows[0][-1][0] - rows[0][-2][0]) / PERIOD_S
    made.emergency_stop()
    rows.append(made.run())
    assert made.state.activity == sg.Activity.aborted
    late = speed * PERIOD_S * made.delay_periods
    assert rows[-1][-1][0] - at == pytest.approx(speed**2 / (2 * most) + late, abs=speed * PERIOD_S)
    whole = np.concatenate(rows)
    assert np.abs(np.diff(whole, n=2, axis=0)).max() / PERIOD_S**2 <= 1.001 * most
    assert made.push_line([0, 0, 0], 50.0) == sg.PushResult.aborted
    made.restart(rows[-1][-1])
    made.push_line([0, 0, 0], 120.0, stop_at_end=True)
    np.testing.assert_array_equal(made.run()[-1], np.zeros(3))


def test_an_emergency_stop_stays_on_a_curve() -> None:
    most = 4000.0
    made = control(emergency_acceleration=[most] * 3)
    made.push_arc([0, 40, 0], [0, 20, 0], math.pi, 120.0)
    made.push_line([-50, 40, 0], 120.0, stop_at_end=True)
    rows = [made.step(420)]
    speed = float(np.linalg.norm(rows[0][-1] - rows[0][-2])) / PERIOD_S
    made.emergency_stop()
    rows.append(made.run())
    radius = np.hypot(rows[-1][:, 0], rows[-1][:, 1] - 20.0)
    np.testing.assert_allclose(radius, 20.0, atol=2e-3)
    travel = float(np.linalg.norm(np.diff(rows[-1], axis=0), axis=1).sum())
    assert travel < 1.5 * speed**2 / (2 * most) + speed * PERIOD_S
    whole = np.concatenate(rows)
    assert np.abs(np.diff(whole, n=2, axis=0)).max() / PERIOD_S**2 <= 1.01 * most


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"travel": [(0.0, 1.0)]}, "travel of 1 axes, the control has 3"),
        ({"travel": [(0.0, 1.0), (2.0, 1.0), (0.0, 1.0)]}, "axis 1: travel from 2 to 1"),
        (
            {"emergency_acceleration": [100.0] * 3},
            "emergency acceleration 100, must be at least that of the axis, 1500",
        ),
        ({"offset": [sg.OffsetLimits(max_feed=200.0, max_acceleration=1.0, max_jerk=1.0)] * 3}, "feed of the offset"),
        ({"offset": [sg.OffsetLimits(max_feed=20.0)] * 3}, "wants feed, acceleration and jerk"),
        ({"offset": [sg.OffsetLimits(backlash=0.1)] * 3}, "a backlash of 0.1 wants limits"),
        ({"spindle_bandwidth_hz": 0.0}, "spindle bandwidth"),
    ],
)
def test_settings_that_are_none(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(sg.ArgumentError, match=message):
        control(**changes)


def test_jog_speeds_are_bounded_by_the_axis() -> None:
    made = control()
    made.hold()
    made.step(2)
    assert made.jog(0, 1e6) == ACCEPTED
    rows = made.step(500)
    assert np.diff(rows[:, 0])[-1] / PERIOD_S == pytest.approx(SPEED)
    assert largest_share(rows) <= 1.001


@pytest.mark.parametrize("filters", FILTERS)
def test_the_path_is_retraced_and_run_on(filters: dict[str, Any]) -> None:
    """Back round the corner, forward a little, and on: all of it on the path, nothing skipped or cut twice."""
    made, rows = held_on_a_path(retrace_periods=4000, **filters)
    held = rows[-1][-1]
    made.resume()
    rows.append(made.step(900))
    made.hold()
    rows.append(made.run())
    forward = np.concatenate(rows)
    held = forward[-1]
    assert held[1] > 5.0  # round the corner
    assert made.retrace(30.0) == ACCEPTED
    rows.append(made.step(30))
    assert made.state.activity == sg.Activity.jogging
    rows.append(made.run())
    travelled = float(np.linalg.norm(np.diff(rows[-1], axis=0), axis=1).sum())
    assert rows[-1][-1][1] == pytest.approx(0.0, abs=0.05)
    assert 100.0 - rows[-1][-1][0] + held[1] == pytest.approx(30.0, abs=0.2)
    assert travelled < 31.0
    assert made.retrace(10.0) == ACCEPTED  # forward
    rows.append(made.run())
    assert np.linalg.norm(rows[-1][-1] - held) < 12.0
    made.resume()
    rows.append(made.run())
    np.testing.assert_array_equal(rows[-1][-1], [100.0, 50.0, 0.0])
    whole = np.concatenate(rows)
    assert largest_share(whole) <= 1.001
    # Every place is one that was run on the way there.
    for point in whole[len(forward) :: 25]:
        on_first = np.abs(forward - point).max(axis=1).min()
        assert min(on_first, abs(point[0] - 100.0)) < 0.08


def test_what_a_retrace_answers() -> None:
    assert control().retrace(1.0) == sg.JogResult.no_record
    made = control(retrace_periods=100)
    assert made.retrace(1.0) == sg.JogResult.path_moves
    assert made.retrace(-1.0) == made.retrace(math.nan) == sg.JogResult.not_finite
    made.push_line([50, 0, 0], 50.0, stop_at_end=True)
    rows = [made.step(800)]
    made.hold()
    rows.append(made.run())
    held = rows[-1][-1]
    assert made.retrace(1000.0) == ACCEPTED  # as far as it is kept: the last 0.1 s
    rows.append(made.run())
    assert 1.0 < held[0] - rows[-1][-1][0] < 5.0
    made.flush()
    rows.append(made.step(100))
    position = made.flushed()
    np.testing.assert_allclose(position, rows[-1][-1], atol=1e-9)
    made.resume()
    made.push_line([50, 10, 0], 50.0, stop_at_end=True)
    rows.append(made.run())
    np.testing.assert_array_equal(rows[-1][-1], [50.0, 10.0, 0.0])
    assert largest_share(np.concatenate(rows)) <= 1.001


def test_an_emergency_stop_a_jog_and_flushed_go_on_where_the_axes_are() -> None:
    made = control(emergency_acceleration=[6000.0] * 3)
    made.push_line([100, 0, 0], 100.0)
    made.step(300)
    made.flush()
    made.emergency_stop()
    made.step(300)
    assert made.jog_by(1, 5.0, 50.0) == ACCEPTED
    rows = [made.step(500)]
    position = made.flushed()
    np.testing.assert_allclose(position, rows[-1][-1], atol=1e-9)
    rows.append(made.step(5))
    np.testing.assert_allclose(rows[-1], np.tile(position, (5, 1)), atol=1e-9)


@pytest.mark.parametrize("stop", ["hold", "flush", "abort", "emergency_stop"])
def test_a_stop_in_the_same_period_is_stronger_than_what_was_asked_for(stop: str) -> None:
    made, rows = held_on_a_path(retrace_periods=2000, emergency_acceleration=[6000.0] * 3)
    assert made.retrace(20.0) == made.jog_by(1, 3.0, 40.0) == ACCEPTED
    getattr(made, stop)()
    np.testing.assert_allclose(made.step(800), np.tile(rows[-1][-1], (800, 1)), atol=1e-9)
    made, rows = held_on_a_path()
    assert made.jog_by(0, 5.0, 50.0) == made.jog(0, 0.0) == ACCEPTED
    np.testing.assert_allclose(made.step(300), np.tile(rows[-1][-1], (300, 1)), atol=1e-9)


def test_an_emergency_stop_is_not_retraced() -> None:
    made = control(emergency_acceleration=[6000.0] * 3, retrace_periods=2000)
    made.push_line([100, 0, 0], 120.0)
    made.step(400)
    made.emergency_stop()
    rest = made.run()[-1]
    made.step(5)
    assert made.retrace(20.0) == ACCEPTED  # of nothing
    np.testing.assert_allclose(made.step(400), np.tile(rest, (400, 1)), atol=1e-9)


def test_the_way_back_is_as_fast_as_the_way_there() -> None:
    made, _ = held_on_a_path()
    made.jog(0, 50.0)
    made.step(300)
    made.jog(0, 1e-3)
    made.step(300)
    made.resume()
    assert len(made.run(20_000)) < 3000
    assert made.state.activity == sg.Activity.idle


@pytest.mark.parametrize("beside", ["retrace", "jog"])
def test_an_emergency_stop_beside_the_path_stays_there(beside: str) -> None:
    made, rows = held_on_a_path(retrace_periods=2000, emergency_acceleration=[2.0 * ACCELERATION] * 3)
    assert (made.retrace(12.0) if beside == "retrace" else made.jog_by(1, 8.0, 60.0)) == ACCEPTED
    rows.append(made.step(200))
    made.emergency_stop()
    rows.append(made.step(600))
    assert made.state.activity == sg.Activity.aborted
    assert np.abs(rows[-1][-1] - rows[1][-1]).max() > 1.0
    assert largest_share(np.concatenate(rows)) <= 1.001
