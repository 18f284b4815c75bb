"""What an operator and a program do to a control, drawn at random: its set-points keep the limits, events come at their
places, and nothing is lost."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import shapegcode as sg
from planned_steps import planned_steps

Rows = npt.NDArray[np.float64]

PERIOD_S = 0.001
SPEED, ACCELERATION, JERK = 150.0, 1500.0, 60_000.0
TOLERANCE_MM = 0.05
FILTERS: tuple[dict[str, Any], ...] = (
    {},
    {"shaper": sg.Fir([0, 9], [0.55, 0.45])},
    {"smoothing_time_s": 0.008, "shaper": sg.Fir([0, 7, 15], [0.3, 0.4, 0.3])},
)


def control(**changes: Any) -> sg.MotionController:
    limits = {
        "max_feed_mm_per_s": SPEED,
        "max_acceleration_mm_per_s2": ACCELERATION,
        "max_jerk_mm_per_s3": JERK,
        "contour_tolerance_mm": TOLERANCE_MM,
        "window": 32,
        "queue": 64,
    }
    return sg.MotionController(**(limits | changes))


def largest_share(rows: Rows) -> float:
    """Of the limits of speed, acceleration and jerk, by differences; at rest before."""
    whole = np.vstack([np.zeros((4, 3)), rows])
    limits = (SPEED, ACCELERATION, JERK)
    return max(
        float(np.abs(np.diff(whole, n=order, axis=0)).max()) / PERIOD_S**order / limit
        for order, limit in enumerate(limits, 1)
    )


def distance_to(point: Rows, begin: Rows, end: Rows) -> float:
    """From a line."""
    along = end - begin
    share = np.clip((point - begin) @ along / (along @ along), 0.0, 1.0)
    return float(np.linalg.norm(point - begin - share * along))


class Session:
    """A control, what was pushed into it, and what it gave."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.lead = None if seed % 2 else 40
        self.made = control(lead_periods=self.lead, **FILTERS[seed % len(FILTERS)])
        self.rows: list[Rows] = [np.zeros((1, 3))]
        self.at = np.zeros(3)
        self.places: dict[int, Rows] = {}  # of events that were pushed
        self.reached: list[tuple[int, int]] = []
        self.forgotten = 0  # events before this one were flushed or reached
        self.latched: Rows | None = None

    def step(self) -> None:
        self.rows.append(planned_steps(self.made, 1, plans=self.lead is not None))
        for event in self.made.take_events():
            self.reached.append((event.id, event.step))

    def push(self) -> None:
        """A segment with what follows it."""
        kind = self.random.random()
        end = self.at + self.random.uniform(-8.0, 8.0, 3) * [1.0, 1.0, 0.3]
        if kind < 0.1:
            end = self.at + self.random.uniform(-0.05, 0.05, 3)
        feed = float(self.random.uniform(5.0, 140.0))
        if self.made.push_line(end, feed, stop_at_end=kind > 0.9) != sg.PushResult.accepted:
            return
        self.at = end
        if self.random.random() < 0.3:
            number = len(self.places)
            if self.made.push_event(number, number) == sg.PushResult.accepted:
                self.places[number] = end
        if self.random.random() < 0.05:
            self.made.push_dwell(float(self.random.uniform(0.0, 0.05)))
        if self.random.random() < 0.03:
            self.made.push_stop()

    def flush(self) -> None:
        if self.random.random() < 0.5:
            self.made.flush()
        else:
            self.latched = self.made.probe()
            np.testing.assert_array_equal(self.latched, self.rows[-1][-1])
        assert self.made.push_line(self.at + 1.0, 50.0) == sg.PushResult.flushing
        self.made.resume()
        self.made.feed_override(1.0)
        for _ in range(3000):
            position = self.made.flushed()
            if position is not None:
                break
            self.step()
        assert position is not None
        np.testing.assert_allclose(position, self.rows[-1][-1], atol=1e-9)
        self.at = position
        self.forgotten = len(self.places)

    def operate(self) -> None:
        drawn = self.random.random()
        if drawn < 0.003:
            self.made.hold()
        elif drawn < 0.02:
            self.made.resume()
        elif drawn < 0.03:
            self.made.feed_override(float(self.random.uniform(0.0, 2.0)))
        elif drawn < 0.0315:
            self.flush()

    def run(self, periods: int) -> None:
        for _ in range(periods):
            if self.random.random() < 0.15:
                self.push()
            self.operate()
            self.step()

    def end(self) -> None:
        """Everything that was pushed is run."""
        self.made.feed_override(1.0)
        for _ in range(60_000):
            self.made.resume()
            self.step()
            if self.made.state.activity == sg.Activity.idle and self.made.state.segments_waiting == 0:
                return
        raise AssertionError(str(self.made.state))


def check_session(seed: int, periods: int = 3000) -> None:
    session = Session(seed)
    session.run(periods)
    session.end()
    rows = np.concatenate(session.rows)
    assert largest_share(rows) <= 1.001
    np.testing.assert_allclose(rows[-1], session.at, atol=1e-9)
    numbers = [number for number, _ in session.reached]
    assert numbers == sorted(set(numbers))
    # Behind the last flush none is missing; before it what had not been reached is gone.
    assert [n for n in numbers if n >= session.forgotten] == list(range(session.forgotten, len(session.places)))
    for number, step in session.reached:
        begin, end = rows[max(step - 1, 0)], rows[min(step + 1, len(rows) - 1)]
        off = distance_to(session.places[number], begin, end) if (begin != end).any() else 0.0
        off = min(off, float(np.linalg.norm(session.places[number] - rows[step])))
        assert off <= 2.0 * TOLERANCE_MM, (number, step)


@pytest.mark.parametrize("seed", range(9))
def test_sessions(seed: int) -> None:
    check_session(seed, 1000)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1000, 1040, 4))
def test_many_sessions(first: int) -> None:
    for seed in range(first, first + 4):
        check_session(seed)


@pytest.mark.parametrize("lead", [None, 60])
@pytest.mark.parametrize("filters", FILTERS)
def test_a_probe_stops_the_motion_on_its_path(filters: dict[str, Any], lead: int | None) -> None:
    """As soon as the limits allow, within what is planned ahead; the rest of the path is gone."""
    made = control(lead_periods=lead, **filters)

    def step(periods: int) -> Rows:
        return planned_steps(made, periods, plans=lead is not None)

    made.push_line([100, 0, 0], 100.0)
    made.push_event(1)
    made.push_line([100, 50, 0], 100.0, stop_at_end=True)
    rows = step(500)
    assert made.flushed() is None  # nobody has asked
    latched = made.probe()
    np.testing.assert_array_equal(latched, rows[-1])
    assert made.push_line([0, 0, 0], 100.0) == sg.PushResult.flushing
    assert made.push_event(2) == made.push_dwell(1.0) == made.push_stop() == sg.PushResult.flushing
    assert made.flushed() is None
    seen = [rows, step(1)]
    assert made.state.activity == sg.Activity.stopping
    seen.append(step(400))
    assert made.state.activity == sg.Activity.idle
    position = made.flushed()
    assert position is not None
    assert made.flushed() is None
    rest = seen[-1][-1]
    np.testing.assert_allclose(position, rest, atol=1e-9)
    # Seven phases from 100 mm/s at 1500 mm/s2 and 60 000 mm/s3, and at most a section before them.
    shortest = 100.0 * (100.0 / ACCELERATION + ACCELERATION / JERK) / 2
    late = 100.0 * PERIOD_S * (32 + 2 * made.delay_periods + 3)
    assert shortest - 0.5 <= rest[0] - latched[0] <= 1.2 * shortest + late
    # A move away, as after every touch; what was pushed before is gone.
    assert made.push_line(position + np.array([0.0, 20.0, 0.0]), 50.0, stop_at_end=True) == sg.PushResult.accepted
    seen.append(step(1200))
    assert made.state.activity == sg.Activity.idle
    assert made.state.segments_done == 1
    np.testing.assert_allclose(seen[-1][-1], position + np.array([0.0, 20.0, 0.0]), atol=1e-9)
    assert made.take_events() == []
    assert largest_share(np.concatenate(seen)) <= 1.001


def test_a_flush_at_rest_in_a_dwell_and_twice() -> None:
    made = control()
    made.flush()
    made.step(2)
    position = made.flushed()
    assert position is not None
    np.testing.assert_array_equal(position, np.zeros(3))
    made.push_line([5, 0, 0], 50.0, stop_at_end=True)
    made.push_dwell(math.pi)
    made.push_line([9, 0, 0], 50.0, stop_at_end=True)
    made.step(600)
    assert made.state.set_point[0] == 5.0
    made.flush()
    made.flush()
    made.step(40)  # at most a section
    assert made.flushed() is not None
    made.flush()  # before the next step
    assert made.push_line([6, 0, 0], 50.0) == sg.PushResult.flushing
    made.step(3)
    position = made.flushed()
    assert position is not None
    np.testing.assert_array_equal(position, [5.0, 0.0, 0.0])
    made.push_line([5, 3, 0], 50.0, stop_at_end=True)
    np.testing.assert_array_equal(made.run()[-1], [5.0, 3.0, 0.0])
