"""What a feed is of and what it counts in: closed forms; a thread against the angle of its spindle."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import shapegcode as sg
from beside_the_path import ACCELERATION, FILTERS, JERK, PERIOD_S, control, largest_share
from shapegcode.io.units import FloatArray

FOLLOWING = [sg.FollowingLimits(max_feed=180.0, max_acceleration=2000.0, max_jerk=100_000.0)]
COUNTS = 4096  # an encoder of 1 024 lines
SYNCHRONOUS = sg.SegmentRules(feed_rate=sg.FeedRate.synchronous)


def top_speed(rows: FloatArray, axis: int) -> float:
    return float(np.abs(np.diff(rows[:, axis])).max()) / PERIOD_S


@pytest.mark.parametrize(
    ("feed_of", "x", "a", "feed", "wanted_a"),
    [
        # (mm, degrees, feed) -> speed of the rotary axis: its travel times feed over what the feed is of.
        (sg.FeedOf.path, 30.0, 60.0, 20.0, 40.0),
        (sg.FeedOf.path, 0.0, 60.0, 20.0, 20.0),
        (sg.FeedOf.path, 1e-12, 60.0, 10.0, 10.0),  # a residue is no travel
        (sg.FeedOf.all_axes, 30.0, 40.0, 20.0, 16.0),
        (sg.FeedOf.all_axes, 1e-12, 60.0, 10.0, 10.0),
        (sg.FeedOf.all_axes, 1e-3, 60.0, 10.0, 10.0),
        (sg.FeedOf.dominant, 30.0, 60.0, 20.0, 20.0),
        (sg.FeedOf.dominant, 60.0, 30.0, 20.0, 10.0),
        (sg.FeedOf.time, 30.0, 60.0, 0.5, 30.0),
        (sg.FeedOf.time, 0.0, 60.0, 0.25, 15.0),
    ],
)
def test_what_a_feed_is_of(feed_of: sg.FeedOf, x: float, a: float, feed: float, wanted_a: float) -> None:
    made = control(following=FOLLOWING)
    rules = sg.SegmentRules(feed_of=feed_of)
    assert made.push_line([x, 0, 0], feed, [a], rules=rules, stop_at_end=True) == sg.PushResult.accepted
    rows = made.run()
    np.testing.assert_allclose(rows[-1], [x, 0.0, 0.0, a], atol=1e-12)
    assert top_speed(rows, 3) == pytest.approx(wanted_a, rel=2e-3)


def test_rotary_and_mixed_segments_one_after_another() -> None:
    """Whichever of them is the path: ends are met and limits kept."""
    made = control(following=FOLLOWING, window=16)
    vector = sg.SegmentRules(feed_of=sg.FeedOf.all_axes)
    ends = [([10, 0, 0], 5.0), ([10, 1e-10, 0], 25.0), ([10.002, 0, 0], 60.0), ([20, 5, 0], 60.0), ([20, 5, 0], -30.0)]
    for xyz, a in ends:
        assert made.push_line(xyz, 40.0, [a], rules=vector, stop_at_end=xyz == ends[-1][0]) == sg.PushResult.accepted
    rows = made.run()
    np.testing.assert_allclose(rows[-1], [20.0, 5.0, 0.0, -30.0], atol=1e-9)
    assert largest_share(rows[:, :3]) <= 1.001
    for order, limit in enumerate((180.0, 2000.0, 100_000.0), 1):
        assert np.abs(np.diff(rows[:, 3], n=order)).max() / PERIOD_S**order <= 1.001 * limit


def test_a_segment_has_limits_of_its_own() -> None:
    made = control()
    gentle = sg.SegmentRules(max_acceleration=200.0, max_jerk=4000.0)
    made.push_line([20, 0, 0], 100.0, stop_at_end=True)
    made.push_line([0, 0, 0], 100.0, rules=gentle, stop_at_end=True)
    rows = made.run()
    there = int(rows[:, 0].argmax())
    back = rows[there:, 0]
    assert np.abs(np.diff(back, n=2)).max() / PERIOD_S**2 == pytest.approx(200.0, rel=2e-3)
    assert np.abs(np.diff(back, n=3)).max() / PERIOD_S**3 <= 1.001 * 4000.0
    assert np.abs(np.diff(rows[:there, 0], n=2)).max() / PERIOD_S**2 > 1000.0
    assert made.push_line([5, 0, 0], 1.0, rules=sg.SegmentRules(max_jerk=0.0)) == sg.PushResult.bad_limit


def test_rapids_have_an_override_of_their_own() -> None:
    made = control()
    rapid = sg.SegmentRules(feed_rate=sg.FeedRate.rapid)
    made.feed_override(0.5)
    made.rapid_override(0.25)
    made.push_line([30, 0, 0], 100.0, stop_at_end=True)
    rows = made.run()
    assert top_speed(rows, 0) == pytest.approx(50.0, rel=2e-3)
    made.push_line([0, 0, 0], 120.0, rules=rapid, stop_at_end=True)
    rows = made.step(400)
    assert top_speed(rows, 0) == pytest.approx(30.0, rel=2e-3)
    made.feed_override(0.0)  # leaves it alone
    assert np.diff(made.step(200)[-2:, 0])[0] / PERIOD_S == pytest.approx(-30.0, rel=2e-3)
    made.rapid_override(0.0)
    assert np.diff(made.step(200)[-2:, 0])[0] == 0.0
    made.rapid_override(1.0)
    assert top_speed(made.run(), 0) > 100.0


def test_a_feed_per_revolution_follows_the_spindle() -> None:
    made = control()
    per_turn = sg.SegmentRules(feed_rate=sg.FeedRate.per_revolution)
    made.push_line([90, 0, 0], 0.5, rules=per_turn, stop_at_end=True)
    angle = 0.0
    rows = []
    for speed in (20.0, 40.0, 0.0, 60.0):  # revolutions per s
        angles = angle + np.arange(1, 601) * speed * PERIOD_S
        angle = float(angles[-1])
        rows.append(made.step(600, angles))
        assert np.diff(rows[-1][-2:, 0])[0] / PERIOD_S == pytest.approx(0.5 * speed, rel=0.006, abs=1e-12)
    made.feed_override(2.0)
    rows.append(made.step(600, angle + np.arange(1, 601) * 60.0 * PERIOD_S))
    assert np.diff(rows[-1][-2:, 0])[0] / PERIOD_S == pytest.approx(60.0, rel=0.006)
    assert largest_share(np.concatenate(rows)) <= 1.001
    with pytest.raises(sg.ArgumentError, match="3 angles of the spindle for 4 periods"):
        made.step(4, [0.0, 0.0, 0.0])


def spindle_angle(t: npt.NDArray[np.floating[Any]], speed: float, ripple: float, frequency: float) -> FloatArray:
    return speed * t - speed * ripple / (2 * math.pi * frequency) * (np.cos(2 * math.pi * frequency * t) - 1.0)


def pitch_bound(pitch: float, speed: float, made: sg.MotionController, bandwidth_hz: float) -> float:
    """What is left of a ripple of 5 % and 2 Hz, and of half a count: see docs/howto/controller.md."""
    amplitude = pitch * speed * 0.05 / (2 * math.pi * 2.0)
    slow = 2.0 / bandwidth_hz
    ahead = 2 * math.pi * 2.0 * made.delay_periods * PERIOD_S
    left = 20.0 * slow**3 + 15.0 * slow**2 * ahead + 3.0 * slow * ahead**2 + ahead**3 / 6.0
    return left * amplitude + pitch / COUNTS


@pytest.mark.parametrize(
    ("filters", "pitch", "speed"),
    [
        *((filters, pitch, speed) for filters in FILTERS for pitch, speed in [(2.0, 10.0), (1.0, 5.0)]),
        *((filters, 1.5, 25.0) for filters in FILTERS[:2]),  # with the longest filter 8.6 um are the bound
    ],
)
def test_a_thread_keeps_its_pitch(filters: dict[str, Any], pitch: float, speed: float) -> None:
    """50 mm at 1 kHz, an encoder of 1 024 lines, 5 % ripple of 2 Hz: within the bound, and within 5 um."""
    made = control(**filters)
    t = np.arange(1, int(80.0 / (pitch * speed) / PERIOD_S)) * PERIOD_S
    angle = spindle_angle(t, speed, 0.05, 2.0)
    assert made.push_line([0, 0, -60], pitch, rules=SYNCHRONOUS, stop_at_end=True) == sg.PushResult.accepted
    rows = made.step(len(t), np.floor(angle * COUNTS) / COUNTS)
    assert made.state.activity == sg.Activity.idle
    np.testing.assert_array_equal(rows[-1], [0.0, 0.0, -60.0])
    depth = -rows[:, 2]
    thread = (depth > 5.0) & (depth < 55.0)
    # Phase: a whole number of revolutions, read in the middle of a count.
    error = (depth - pitch * (angle - 0.5 / COUNTS))[thread]
    error -= pitch * round(float(error.mean()) / pitch)
    bound = pitch_bound(pitch, speed, made, 20.0)
    assert np.abs(error).max() <= min(bound, 5e-3)
    assert largest_share(rows) <= 1.001


def test_threads_that_are_cut_again_meet() -> None:
    """A second pass begins at another time and runs in the same groove."""
    made = control(**FILTERS[1])
    t = np.arange(1, 30_001) * PERIOD_S
    angle = spindle_angle(t, 8.0, 0.02, 3.0)
    rapid = sg.SegmentRules(feed_rate=sg.FeedRate.rapid)
    for passes in range(3):
        made.push_line([0.1 * passes, 0, -30], 1.5, rules=SYNCHRONOUS)
        made.push_line([-3, 0, -30], 140.0, rules=rapid)
        made.push_line([-3, 0, 0], 140.0, rules=rapid)
        made.push_line([0.1 * (passes + 1), 0, 0], 140.0, rules=rapid, stop_at_end=passes == 2)
    rows = made.step(len(t), np.floor(angle * COUNTS) / COUNTS)
    assert made.state.activity == sg.Activity.idle
    places = []
    for passes in range(3):
        # On the way down, in the middle of the thread.
        x = 0.1 * passes + 0.1 / 30.0 * np.abs(rows[:, 2])
        at = (
            (np.abs(rows[:, 2] + 15.0) < 5.0)
            & (np.diff(rows[:, 2], prepend=0.0) < 0.0)
            & (np.abs(rows[:, 0] - x) < 0.2)
        )
        at &= rows[:, 0] > -1.0
        phase = (-rows[at, 2] / 1.5 - angle[at]) % 1.0
        places.append(phase)
    phases = np.concatenate(places)
    phases = (phases + 0.5) % 1.0 - 0.5
    assert np.abs(phases).max() * 1.5 <= 5e-3
    assert largest_share(rows) <= 1.001


def test_a_synchronous_segment_waits_and_is_lost() -> None:
    """For a spindle that turns, and not too fast; one that stops at once cannot be followed."""
    made = control()
    made.push_line([0, 0, -40], 2.0, rules=SYNCHRONOUS, stop_at_end=True)
    rows = [made.step(200)]  # not measured
    assert made.state.activity == sg.Activity.moving
    assert not rows[0].any()
    fast = np.arange(1, 401) * 100.0 * PERIOD_S  # 200 mm/s
    rows.append(made.step(400, fast))
    assert not rows[-1].any()
    assert made.push_arc([0, 9, -40], [0, 4.5, -40], math.pi, 1.0, rules=SYNCHRONOUS) == sg.PushResult.not_straight
    slow = fast[-1] + np.arange(1, 801) * 10.0 * PERIOD_S
    rows.append(made.step(800, slow))
    assert made.state.spindle_speed == pytest.approx(10.0)
    assert np.diff(rows[-1][-2:, 2])[0] / PERIOD_S == pytest.approx(-20.0, rel=1e-3)
    assert abs(made.state.spindle_error_mm) < 1e-3
    made.hold()  # not before the end of the thread
    rows.append(made.step(50, slow[-1] + np.arange(1, 51) * 10.0 * PERIOD_S))
    assert np.diff(rows[-1][-2:, 2])[0] / PERIOD_S == pytest.approx(-20.0, rel=1e-3)
    made.resume()
    rows.append(made.step(400, np.full(400, slow[-1] + 0.5)))
    assert made.state.activity == sg.Activity.aborted
    whole = np.concatenate(rows)
    assert whole[-1, 2] > -40.0
    assert np.abs(np.diff(whole, n=2, axis=0)).max() / PERIOD_S**2 <= 1.001 * ACCELERATION
    assert np.abs(np.diff(whole, n=3, axis=0)).max() / PERIOD_S**3 <= 1.001 * JERK


def test_a_thread_is_not_cut_again_after_a_restart() -> None:
    made = control()
    angle = np.arange(1, 20_001) * 0.01
    made.push_line([0, 0, -15], 1.0, rules=SYNCHRONOUS)
    made.push_line([0, 0, -30], 1.0, rules=SYNCHRONOUS, stop_at_end=True)
    made.step(8000, angle[:8000])
    made.restart([50.0, 0.0, 0.0])
    rows = made.step(1000, angle[8000:9000])
    np.testing.assert_array_equal(rows, np.tile([50.0, 0.0, 0.0], (1000, 1)))
    assert (made.state.segments_waiting, made.state.activity) == (0, sg.Activity.idle)


@pytest.mark.parametrize("seed", range(4))
def test_threads_that_end_while_they_catch_up_keep_the_limits(seed: int) -> None:
    random = np.random.default_rng(seed)
    for _ in range(20):
        length, pitch = float(np.exp(random.uniform(np.log(0.04), np.log(12.0)))), float(random.uniform(0.25, 3.0))
        made = control(**FILTERS[seed % len(FILTERS)])
        made.push_line([0, 0, -length], pitch, rules=SYNCHRONOUS, stop_at_end=True)
        count = int(2000 + 1000.0 * length / (pitch * 10.0))
        rows = made.step(count, np.arange(1, count + 1) * 0.01 * float(random.uniform(0.5, 2.0)))
        assert made.state.activity == sg.Activity.idle
        assert rows[-1, 2] == -length
        assert largest_share(rows) <= 1.001, (length, pitch)


def test_an_angle_that_is_missing_changes_nothing() -> None:
    made = control()
    made.push_line([0, 0, -40], 2.0, rules=SYNCHRONOUS, stop_at_end=True)
    angle = np.arange(1, 3001) * 0.01
    angle[800] = math.nan
    angle[900] = 1e308
    angle[1000] += 1e6
    angle[1100:1103] -= 100.0
    rows = [made.step(1500, angle[:1500]), made.step(1), made.step(1499, angle[1501:])]
    assert made.state.activity == sg.Activity.idle
    np.testing.assert_array_equal(rows[-1][-1], [0.0, 0.0, -40.0])
    assert largest_share(np.concatenate(rows)) <= 1.001


@pytest.mark.parametrize("jump", [1e6, -1e6, 30.0])
def test_a_spindle_that_is_somewhere_else_is_believed_and_the_thread_is_lost(jump: float) -> None:
    made = control()
    made.push_line([0, 0, -40], 2.0, rules=SYNCHRONOUS, stop_at_end=True)
    angle = np.arange(1, 2001) * 0.01
    angle[1000:] += jump
    rows = made.step(2000, angle)
    assert made.state.activity == sg.Activity.aborted
    assert -40.0 < rows[-1, 2] < 0.0
    assert largest_share(rows) <= 1.001
    assert made.state.spindle_speed == pytest.approx(10.0)


@pytest.mark.parametrize("feed_of", [sg.FeedOf.all_axes, sg.FeedOf.dominant, sg.FeedOf.path, sg.FeedOf.time])
def test_a_rotary_axis_that_moves_much_further_comes_to_its_end(feed_of: sg.FeedOf) -> None:
    axis = sg.FollowingLimits(max_feed=180.0, max_acceleration=2000.0, max_jerk=1e5, tolerance=0.05)
    made = control(following=[axis])
    rules = sg.SegmentRules(feed_of=feed_of)
    made.push_line([3, 0, 0], 50.0, [-3.0], rules=rules)
    made.push_line([3.02, 0.02, 0], 50.0, [-20.0], rules=rules, stop_at_end=True)
    rows = made.run(3000)
    np.testing.assert_array_equal(rows[-1], [3.02, 0.02, 0.0, -20.0])
