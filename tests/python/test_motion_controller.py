"""The motion controller against closed forms and NumPy: times of single moves, shapers as convolutions, limits by
differences; and what it answers."""

import itertools
import math
import threading
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

import shapegcode as sg
from planned_steps import planned_steps
from shapegcode.io.units import FloatArray

PERIOD_S = 0.001
ACCELERATION = 1000.0
JERK = 50_000.0
JERK_TIME_S = ACCELERATION / JERK  # from rest to full acceleration
FEED = 100.0
LIMITS: dict[str, Any] = {"max_acceleration_mm_per_s2": ACCELERATION, "max_jerk_mm_per_s3": JERK}


def control(**changes: Any) -> sg.MotionController:
    """A control with limits of acceleration and jerk, neither smoothing nor shaper."""
    return sg.MotionController(**({**LIMITS, "smoothing_time_s": 0.0, "period_s": PERIOD_S} | changes))


def line(to: float, made: sg.MotionController, feed: float = FEED) -> FloatArray:
    """All set-points of one move along X."""
    assert made.push_line([to, 0, 0], feed, stop_at_end=True) == sg.PushResult.accepted
    return made.run()


def arrival(rows: FloatArray) -> int:
    """Periods until the end is reached: the first row that is the last one for good."""
    away = np.flatnonzero((rows != rows[-1]).any(axis=1))
    return int(away[-1]) + 2 if len(away) else 1


@pytest.mark.parametrize(("length", "feed"), [(40.0, 100.0), (3.0, 100.0), (200.0, 300.0), (0.5, 100.0)])
def test_a_single_move_takes_the_shortest_time(length: float, feed: float) -> None:
    """Seven phases: with the feed, without it, or without the full acceleration."""
    ramp = ACCELERATION * JERK_TIME_S
    peak = (math.sqrt(ramp**2 + 4 * ACCELERATION * length) - ramp) / 2
    if peak >= feed:
        seconds = length / feed + feed / ACCELERATION + JERK_TIME_S
    elif peak >= ramp:
        seconds = 2 * (peak / ACCELERATION + JERK_TIME_S)
    else:
        seconds = 4 * (length / (2 * JERK)) ** (1 / 3)
    rows = line(length, control(), feed)
    assert arrival(rows) * PERIOD_S == pytest.approx(seconds, abs=2 * PERIOD_S)
    assert rows[-1, 0] == length


@pytest.mark.parametrize("taps", [[0.5, 0.3, 0.2], [0.5, 0.7, -0.2]], ids=["positive", "both signs"])
def test_a_shaper_is_a_convolution(taps: list[float]) -> None:
    """Taps of both signs add up to more than one: so much less than the limits is planned, that they hold behind."""
    delays, share = [0, 7, 19], sum(map(abs, taps))
    less = {name: limit / share for name, limit in LIMITS.items()}
    plain, shaped = line(40.0, control(**less)), line(40.0, control(shaper=sg.Fir(delays, taps)))
    train = np.zeros(20)
    train[delays] = taps
    wanted = np.convolve(np.diff(plain[:, 0], prepend=0.0), train).cumsum()
    count = min(len(wanted), len(shaped))
    np.testing.assert_allclose(shaped[:count, 0], wanted[:count], atol=1e-11)
    assert shaped[-1, 0] == 40.0
    assert arrival(shaped) == arrival(plain) + 19


def test_smoothing_is_two_moving_averages() -> None:
    plain, smooth = line(40.0, control()), line(40.0, control(smoothing_time_s=0.01))
    box = np.full(10, 0.1)
    wanted = np.convolve(np.convolve(np.diff(plain[:, 0], prepend=0.0), box), box).cumsum()
    count = min(len(wanted), len(smooth))
    np.testing.assert_allclose(smooth[:count, 0], wanted[:count], atol=1e-11)


def test_a_design_and_its_filter_are_the_same_and_each_axis_may_have_its_own() -> None:
    design = sg.Shaper([0.0, 0.011], [0.516, 0.484])
    fir = sg.Fir([0, 11], [0.516, 0.484])
    runs = []
    for shaper in (design, fir, [design, fir, sg.Fir([0], [1.0])]):
        made = control(shaper=shaper)
        assert made.push_line([30, 20, 10], FEED, stop_at_end=True) == sg.PushResult.accepted
        runs.append(made.run())
    np.testing.assert_array_equal(runs[0], runs[1])
    np.testing.assert_array_equal(runs[0][: len(runs[2]), :2], runs[2][: len(runs[0]), :2])
    assert not np.array_equal(runs[0][:100, 2], runs[2][:100, 2])
    with pytest.raises(sg.DesignError, match=r"10\.5 ms"):
        control(shaper=sg.Shaper([0.0, 0.0105], [0.5, 0.5]))


def test_a_set_of_equal_filters_followed_along_an_axis_is_that_filter() -> None:
    fir = sg.Fir([0, 11], [0.516, 0.484])
    followed = line(40.0, control(shaper=sg.FollowingFir(sg.VaryingFir([fir, fir]), 0, [0.0, 40.0])))
    plain = line(40.0, control(shaper=fir))
    count = min(len(followed), len(plain))
    np.testing.assert_allclose(followed[:count], plain[:count], atol=1e-11)


def differences(rows: FloatArray, order: int, start: FloatArray) -> FloatArray:
    """Differences over the period of the set-points, with rest at the start before them."""
    whole = np.vstack([np.tile(start, (order, 1)), rows])
    return np.asarray(np.diff(whole, order, axis=0) / PERIOD_S**order)


points = st.lists(
    st.tuples(*[st.floats(-30, 30).map(lambda value: round(value, 2)) for _ in range(3)]), min_size=1, max_size=8
)


@given(points=points, dial=st.floats(0.1, 2.0), at=st.integers(1, 400), stop=st.booleans())
def test_set_points_keep_limits_and_end_where_the_last_segment_does(
    points: list[tuple[float, float, float]], dial: float, at: int, stop: bool
) -> None:
    ends = [point for point, before in zip(points, [(0.0, 0.0, 0.0), *points], strict=False) if point != before]
    made = control(smoothing_time_s=0.01, contour_tolerance_mm=0.05, shaper=sg.Fir([0, 11], [0.516, 0.484]))
    for point in ends:
        assert made.push_line(point, FEED, stop_at_end=point is ends[-1]) == sg.PushResult.accepted
    rows = [made.step(at)]
    made.feed_override(dial)
    if stop:
        made.hold()
        rows.append(made.run())
        made.resume()
    rows.append(made.run())
    run = np.vstack(rows)
    start = np.zeros(3)
    assert tuple(run[-1]) == (ends[-1] if ends else (0.0, 0.0, 0.0))
    assert made.state.segments_done == len(ends)
    assert made.state.activity == sg.Activity.idle
    speeds = np.linalg.norm(differences(run, 1, start), axis=1)
    assert speeds.max() <= FEED * max(1.0, dial) * 1.001
    assert np.abs(differences(run, 2, start)).max() <= ACCELERATION * 1.001
    assert np.abs(differences(run, 3, start)).max() <= JERK * 1.001
    for end in ends:
        assert np.linalg.norm(run - np.array(end), axis=1).min() <= 0.05 + FEED * 2 * PERIOD_S


def test_hold_rests_on_the_path_and_resume_goes_on() -> None:
    made = control()
    made.push_line([60, 0, 0], FEED)
    made.push_line([60, 60, 0], FEED, stop_at_end=True)
    before = made.step(300)
    made.hold()
    stopping = made.run()
    assert made.state.activity == sg.Activity.held
    assert made.state.speed_mm_per_s == 0.0
    assert (made.step(50) == stopping[-1]).all()
    # What braking from the feed takes, with the jerk, and what was planned before: 32 periods at most.
    braking_mm = FEED / 2 * (FEED / ACCELERATION + JERK_TIME_S)
    assert stopping[-1, 0] - before[-1, 0] <= braking_mm + FEED * 33 * PERIOD_S
    made.resume()
    assert made.run()[-1].tolist() == [60, 60, 0]
    assert made.state.activity == sg.Activity.idle


def test_the_dial_changes_the_time_by_what_it_says() -> None:
    half, whole = control(), control()
    half.feed_override(0.5)
    half.step()
    assert half.state.feed_override == 0.5
    slow = FEED / 2
    seconds = 40.0 / slow + slow / ACCELERATION + JERK_TIME_S
    assert arrival(line(40.0, half)) * PERIOD_S == pytest.approx(seconds, abs=2 * PERIOD_S)
    assert arrival(line(40.0, whole)) < arrival(line(80.0, half))
    for ratio, taken in ((2.5, 2.0), (-1.0, 0.0), (math.nan, 0.0)):
        half.feed_override(ratio)
        half.step()
        assert half.state.feed_override == taken


def test_abort_forgets_the_path_and_restart_begins_anew() -> None:
    made = control(following=[sg.FollowingLimits()])
    assert made.push_line([60, 0, 0], FEED, [90.0], line=5) == sg.PushResult.accepted
    made.step(300)
    assert made.state.line == 5
    made.abort()
    rest = made.run()[-1]
    assert made.state.activity == sg.Activity.aborted
    assert 0 < rest[0] < 60
    assert rest[3] == pytest.approx(rest[0] * 1.5)
    assert made.push_line([60, 0, 0], FEED) == sg.PushResult.aborted
    for wrong in ([0.0] * 3, [0.0, 0.0, 0.0, math.nan]):
        with pytest.raises(sg.ArgumentError, match="position"):
            made.restart(wrong)
    made.restart([1, 2, 3, 4])
    assert made.end_mm.tolist() == [1, 2, 3]
    assert made.following_end.tolist() == [4]
    assert made.push_line([1, 2, 9], FEED, stop_at_end=True) == sg.PushResult.accepted
    assert made.run()[-1].tolist() == [1, 2, 9, 4]


def test_segments_that_run_out_are_no_loss() -> None:
    made = control()
    made.push_line([20, 0, 0], FEED)
    assert made.run()[-1].tolist() == [20, 0, 0]
    assert (made.state.activity, made.state.starvations) == (sg.Activity.idle, 1)
    made.push_line([40, 0, 0], FEED, stop_at_end=True)
    assert made.run()[-1].tolist() == [40, 0, 0]
    assert (made.state.activity, made.state.starvations) == (sg.Activity.idle, 1)


def test_what_is_not_taken_leaves_no_trace() -> None:
    made = control()
    results = sg.PushResult
    assert made.push_line([1, 0, 0], 0.0) == results.no_feed
    assert made.push_line([1, 0, 0], math.nan) == results.no_feed
    assert made.push_line([math.inf, 0, 0], FEED) == results.not_finite
    assert made.push_line([0, 0, 0], FEED) == results.no_length
    assert made.push_line([1, 0, 0], FEED, [1.0]) == results.wrong_axes
    assert made.push(sg.Segment.line([1, 0, 0], [2, 0, 0], FEED)) == results.not_connected
    assert made.state.segments_waiting == 0
    assert made.end_mm.tolist() == [0, 0, 0]
    assert made.push_arc([20, 20, 0], [20, 0, 0], -1.5, FEED) == results.not_connected  # a quarter is 1.5708
    assert made.state.segments_waiting == 0
    with pytest.raises(sg.ArgumentError, match="radius"):
        made.push_arc([0, 0, 0], [0, 0, 0], math.pi, FEED)


def test_a_path_longer_than_the_queue_is_taken_piece_by_piece() -> None:
    corners = [[i / 4, 5.0 * (i % 2), 0.0] for i in range(101)]
    path = sg.Path([sg.Segment.line(*pair, FEED) for pair in itertools.pairwise(corners)])
    made = control(queue=16, window=8)
    done, rows, answers = 0, [], set()
    while done < len(path):
        done, answer = made.push_path(path, done)
        answers.add(answer)
        rows.append(made.step(5))
    rows.append(made.run())
    assert answers == {sg.PushResult.queue_full, sg.PushResult.accepted}
    assert rows[-1][-1].tolist() == corners[-1]
    assert made.state.segments_done == 100
    assert made.push_path(path) == (0, sg.PushResult.not_connected)
    assert made.push_path(path, 100) == (100, sg.PushResult.accepted)
    with pytest.raises(sg.ArgumentError, match="-1"):
        made.push_path(path, -1)


def test_arcs_are_circles() -> None:
    made = control(max_acceleration_mm_per_s2=5000.0, contour_tolerance_mm=0.0)
    made.push_arc([0, 0, 0], [20, 0, 0], 2 * math.pi, 50.0)
    made.push_arc([20, -20, 4], [20, 0, 0], math.pi / 2, 50.0, stop_at_end=True)
    rows = made.run()
    radius = np.hypot(rows[:, 0] - 20, rows[:, 1])
    assert np.abs(radius - 20).max() < 1e-9
    assert rows[-1].tolist() == [20, -20, 4]


def test_one_thread_pushes_while_another_steps() -> None:
    made = control(queue=8, window=8)
    count = 300

    def plan() -> None:
        for i in range(count):
            while made.push_line([(i + 1) / 10, 0, 0], FEED, stop_at_end=i + 1 == count) == sg.PushResult.queue_full:
                pass

    planner = threading.Thread(target=plan)
    planner.start()
    while planner.is_alive() or made.state.segments_done < count:
        made.step(20)
    planner.join()
    assert made.run()[-1].tolist() == [30.0, 0, 0]
    assert (made.state.segments_done, made.state.segments_waiting) == (count, 0)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"period_s": 0.0}, "period"),
        ({"max_acceleration_mm_per_s2": [1.0, -1.0, 1.0]}, "-1"),
        ({"max_feed_mm_per_s": math.nan}, "nan"),
        ({"smoothing_time_s": -0.5}, "-0.5"),
        ({"contour_tolerance_mm": -0.1}, "-0.1"),
        ({"contour_tolerance_mm": 0.0, "smoothing_time_s": 0.01}, "0"),
        ({"lead_periods": -1}, "-1"),
        ({"following": [sg.FollowingLimits()] * 7}, "7"),
        ({"following": [sg.FollowingLimits(max_feed=-2.0)]}, "-2"),
        ({"shaper": [sg.Fir([0], [1.0])] * 2}, "2"),
        ({"window": 7}, "7"),
        ({"queue": -1}, "-1"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_settings_that_cannot_be_are_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(sg.ArgumentError, match=said):
        control(**changes)


def test_the_rules_for_corners_are_those_of_the_limits() -> None:
    limits = sg.MotionLimits()
    limits.law = sg.AccelerationLaw.jerk_limited
    limits.corner_stop_angle_rad = 0.1
    free, stopped = control(), control(limits=limits)
    times = []
    for made in (free, stopped):
        for end in ([20, 0, 0], [40, 4, 0]):
            made.push_line(end, 20.0, stop_at_end=end[0] == 40)
        times.append(arrival(made.run()))
    assert times[0] < times[1]


def test_the_state_says_what_it_is() -> None:
    made = control(following=[sg.FollowingLimits(max_feed=50.0)])
    assert made.n_axes == 4
    assert made.step(0).shape == (0, 4)
    with pytest.raises(sg.ArgumentError, match="-1"):
        made.step(-1)
    made.push_line([10, 0, 0], FEED, [5.0], stop_at_end=True)
    made.step(100)
    state = made.state
    assert (state.steps, state.activity, state.segments_waiting) == (100, sg.Activity.moving, 1)
    assert state.set_point.shape == (4,)
    assert 0 < state.distance_mm < 10
    assert 0 < state.speed_mm_per_s <= FEED
    assert repr(state).startswith("ControllerState(activity=moving, set_point=[")
    assert repr(sg.FollowingLimits(max_feed=50.0)) == (
        "FollowingLimits(max_feed=50.0, max_acceleration=inf, max_jerk=inf, tolerance=inf)"
    )
    with pytest.raises(AttributeError):
        state.steps = 5  # type: ignore[misc]


def test_the_delay_is_what_the_set_points_lag() -> None:
    """Behind the ramp of the motion: on a straight line at constant speed a mean delay is a shift."""
    rows = line(60.0, control(smoothing_time_s=0.01, shaper=sg.Fir([0, 20], [0.75, 0.25])))
    ramp = FEED / ACCELERATION + JERK_TIME_S
    middle = 400
    ideal = FEED * (middle * PERIOD_S - ramp / 2)
    made = control(smoothing_time_s=0.01, shaper=sg.Fir([0, 20], [0.75, 0.25]))
    lag = (ideal - rows[middle - 1, 0]) / FEED / PERIOD_S
    assert lag == pytest.approx(made.delay_periods, abs=1.01)
    assert made.correction_delay == 0


FILTERS = {
    "none": {},
    "shaper": {"shaper": sg.Fir([0, 7, 19], [0.5, 0.3, 0.2])},
    "smoothing": {"smoothing_time_s": 0.01},
    "of each axis": {"shaper": [sg.Fir([0, 9], [0.6, 0.4]), sg.Fir([0], [1.0]), sg.Fir([0, 4], [0.5, 0.5])]},
}


@pytest.mark.parametrize("filters", FILTERS.values(), ids=list(FILTERS))
def test_velocity_and_acceleration_are_those_of_the_set_points(filters: dict[str, Any]) -> None:
    """On a line the jerk is constant in each period: what Euler and Maclaurin say of a step is exact there. On a
    corner that is rounded it misses by a share of the jerk."""
    made, same = control(**filters), control(**filters)
    for each in (made, same):
        each.push_line([20, 5, 0], FEED)
        each.push_line([40, 5, 1], FEED, stop_at_end=True)
    position, velocity, acceleration = made.step_motion(1500)
    np.testing.assert_array_equal(position, same.step(1500))
    mean = (velocity[1:] + velocity[:-1]) / 2 - PERIOD_S * (acceleration[1:] - acceleration[:-1]) / 12
    missed = np.abs(np.diff(position, axis=0) / PERIOD_S - mean).max(axis=1)
    assert missed.max() <= 0.02 * JERK * PERIOD_S**2
    assert (missed <= 1e-9).mean() > 0.6
    assert np.abs(acceleration).max() <= ACCELERATION
    assert np.abs(acceleration).max() > 0.9 * ACCELERATION
    np.testing.assert_array_equal(velocity[-1], 0.0)
    np.testing.assert_array_equal(acceleration[-1], 0.0)


def test_acceleration_on_a_circle() -> None:
    radius, feed = 20.0, 50.0
    made = control()
    assert made.push_arc([40, 0, 0], [20, 0, 0], -math.pi, feed, stop_at_end=True) == sg.PushResult.accepted
    position, velocity, acceleration = made.step_motion(700)
    assert made.state.activity == sg.Activity.moving
    assert np.linalg.norm(velocity[-1]) == pytest.approx(feed, rel=1e-6)
    out = (position[-1] - [20, 0, 0]) / radius
    np.testing.assert_allclose(acceleration[-1], -(feed**2) / radius * out, atol=0.02)
    assert velocity[-1] @ out == pytest.approx(0.0, abs=1e-6)


def test_the_line_behind_the_shaper_comes_as_much_later() -> None:
    made = control(shaper=sg.Fir([0, 20], [0.5, 0.5]))
    made.push_line([10, 0, 0], FEED, line=3)
    made.push_line([20, 0, 0], FEED, line=4, stop_at_end=True)
    before, behind, places = [], [], []
    for _ in range(400):
        x = made.step()[0, 0]
        state = made.state
        before.append(state.line)
        behind.append(state.set_point_line)
        places.append((x, state.set_point_distance_mm))
    assert made.delay_periods == 10.0
    assert behind.index(4) == before.index(4) + 10
    x, distance = np.array(places[150:180]).T  # at the feed
    np.testing.assert_allclose(distance, x, atol=1e-9)


@pytest.mark.parametrize("filters", FILTERS.values(), ids=list(FILTERS))
def test_events_come_where_the_set_points_are(filters: dict[str, Any]) -> None:
    """At a junction that is passed with a constant feed, and at stops, where the set-points come to rest."""
    made = control(**filters)
    answers = [
        made.push_event(1, 7),
        made.push_line([40, 0, 0], FEED),
        made.push_event(2, 2**63),
        made.push_event(3),
        made.push_line([80, 0, 0], FEED, stop_at_end=True),
        made.push_event(4),
        made.push_line([80, 30, 0], FEED, stop_at_end=True),
        made.push_event(5),
    ]
    assert set(answers) == {sg.PushResult.accepted}
    rows = made.run()
    events = made.take_events()
    assert [each.id for each in events] == [1, 2, 3, 4, 5]
    assert [each.word for each in events[:2]] == [7, 2**63]
    at = [each.step - 1 for each in events]
    assert at[0] <= 1
    assert at[1] == at[2]
    # A period is 0.1 mm, and the delay is rounded to periods.
    assert rows[at[1], 0] == pytest.approx(40.0, abs=0.16)
    stopped = np.flatnonzero((rows[:, 0] == 80.0) & (rows[:, 1] == 0.0))
    assert rows[at[3]] == pytest.approx([80, 0, 0], abs=1e-9)
    assert at[3] - stopped[0] <= 20  # a filter that is not the longest is done before
    assert at[3] < np.flatnonzero(rows[:, 1] > 1e-9)[0]
    assert rows[at[4]] == pytest.approx([80, 30, 0], abs=1e-9)
    assert not made.take_events()


@pytest.mark.parametrize("filters", FILTERS.values(), ids=list(FILTERS))
@pytest.mark.parametrize("dwell_s", [0.0, 0.0004, 0.25])
def test_a_dwell_is_rest_for_so_long(filters: dict[str, Any], dwell_s: float) -> None:
    rows = []
    for dwells in (False, True):
        made = control(**filters)
        made.push_line([10, 0, 0], FEED, stop_at_end=True)
        if dwells:
            assert made.push_dwell(dwell_s) == sg.PushResult.accepted
        made.push_line([20, 0, 0], FEED, stop_at_end=True)
        rows.append(made.run())
        assert made.state.starvations == 0
    periods = math.ceil(dwell_s / PERIOD_S)
    assert len(rows[1]) == len(rows[0]) + periods
    rest = int((np.abs(rows[1][:, 0] - 10.0) < 1e-12).sum())
    assert rest >= dwell_s / PERIOD_S
    for wrong in (-1.0, math.nan, math.inf, 2e6):
        assert made.push_dwell(wrong) == sg.PushResult.no_time


@pytest.mark.parametrize("lead", [None, 40])
def test_a_programmed_stop_waits_for_the_operator(lead: int | None) -> None:
    """Also where nothing follows yet, and where the thread that plans is ahead."""
    made = control(lead_periods=lead, shaper=sg.Fir([0, 11], [0.5, 0.5]))

    def step(periods: int) -> FloatArray:
        return planned_steps(made, periods, plans=lead is not None)

    made.push_line([10, 0, 0], FEED)
    assert made.push_stop() == sg.PushResult.accepted
    made.push_event(9)
    made.push_line([20, 0, 0], FEED, stop_at_end=True)
    rows = step(800)
    assert made.state.activity == sg.Activity.held
    np.testing.assert_array_equal(rows[-1], [10.0, 0.0, 0.0])
    assert made.take_events() == []  # behind the stop
    made.resume()
    rows = step(800)
    assert [each.id for each in made.take_events()] == [9]
    assert made.state.activity == sg.Activity.idle
    np.testing.assert_array_equal(rows[-1], [20.0, 0.0, 0.0])
    made.push_stop()
    step(5)
    assert made.state.activity == sg.Activity.held
    made.push_line([30, 0, 0], FEED, stop_at_end=True)
    step(300)
    assert made.state.set_point[0] == 20.0
    made.resume()
    step(800)
    assert (made.state.set_point[0], made.state.activity) == (30.0, sg.Activity.idle)
    assert made.state.late_plans == 0


def test_events_without_room_and_after_an_abort() -> None:
    made = control(window=8, queue=16)
    answers = [made.push_event(number) for number in range(100)]
    taken = answers.index(sg.PushResult.queue_full)
    assert taken >= 16
    assert set(answers[taken:]) == {sg.PushResult.queue_full}
    made.push_line([10, 0, 0], FEED)
    made.step(3)
    assert [each.id for each in made.take_events()] == list(range(taken))
    assert made.push_event(5) == sg.PushResult.accepted
    made.abort()
    made.step(500)
    assert made.push_event(6) == made.push_stop() == made.push_dwell(1.0) == sg.PushResult.aborted
    made.restart([0, 0, 0])
    made.push_line([1, 0, 0], FEED, stop_at_end=True)
    made.run()
    assert made.take_events() == []  # what was pushed before is gone


def test_without_a_tolerance_corners_are_exact_stops() -> None:
    made = control(contour_tolerance_mm=0.0)
    for end in ([10, 0, 0], [10, 10, 0], [20, 20, 0]):
        made.push_line(end, FEED, stop_at_end=end[0] == 20)
    rows = made.run()
    for corner in ([10, 0, 0], [10, 10, 0]):
        assert np.abs(rows - corner).max(axis=1).min() < 1e-9


def test_planned_by_another_caller() -> None:
    made = control(lead_periods=20)
    made.push_line([10, 0, 0], FEED, stop_at_end=True)
    assert (made.step(5) == 0.0).all()  # nothing is planned
    assert made.plan()
    assert not made.plan()
    rows = []
    while made.state.segments_done < 1:
        made.plan()
        rows.append(made.step(10))
    assert made.state.late_plans == 0
    np.testing.assert_array_equal(np.vstack(rows)[: len(line(10.0, control()))][-1], [10.0, 0.0, 0.0])
