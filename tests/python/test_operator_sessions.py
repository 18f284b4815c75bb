"""What an operator and a program do to a control, drawn at random: its set-points keep the limits, events come at their
places, and nothing is lost."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import shapegcode as sg
from beside_the_path import ACCELERATION, FILTERS, JERK, PERIOD_S, Rows, control, largest_share
from planned_steps import planned_steps

TOLERANCE_MM = 0.05


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
        offset = sg.OffsetLimits(max_feed=15.0, max_acceleration=150.0, max_jerk=6000.0)
        extras: dict[str, Any] = {"emergency_acceleration": [2.0 * ACCELERATION] * 3, "retrace_periods": 800}
        self.offsets = seed % 4 == 3
        if self.offsets:
            extras["offset"] = [offset, offset, offset]
        self.made = control(lead_periods=self.lead, **extras, **FILTERS[seed % len(FILTERS)])
        self.rows: list[Rows] = [np.zeros((1, 3))]
        self.at = np.zeros(3)
        self.places: dict[int, Rows] = {}  # of events that were pushed
        self.reached: list[tuple[int, int]] = []
        self.forgotten = 0  # events before this one were flushed or reached
        self.braked: list[int] = []  # rows at which an emergency stop began
        self.beside = np.zeros(0, dtype=int)

    def step(self) -> None:
        self.rows.append(planned_steps(self.made, 1, plans=self.lead is not None))
        for event in self.made.take_events():
            self.reached.append((event.id, len(self.rows) - 1))

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
            np.testing.assert_array_equal(self.made.probe(), self.rows[-1][-1])
        assert self.made.push_line(self.at + 1.0, 50.0) == sg.PushResult.flushing
        self.made.resume()
        self.made.feed_override(1.0)
        for _ in range(3000):
            position = self.made.flushed()
            if position is not None:
                break
            self.step()
        assert position is not None
        if not self.offsets:
            np.testing.assert_allclose(position, self.rows[-1][-1], atol=1e-9)
        self.at = position
        self.forgotten = len(self.places)

    def rest(self) -> None:
        """After hold, flush or an emergency stop."""
        for _ in range(3000):
            if self.made.state.activity in (sg.Activity.held, sg.Activity.idle, sg.Activity.aborted):
                return
            self.step()
        raise AssertionError(str(self.made.state))

    def move_by_hand(self) -> None:
        self.made.hold()
        self.rest()
        for _ in range(int(self.random.integers(1, 6))):
            axis = int(self.random.integers(0, 3))
            speed = float(self.random.uniform(-60.0, 60.0))
            drawn = self.random.random()
            if drawn < 0.4:
                self.made.jog(axis, speed)
            elif drawn < 0.7:
                self.made.jog_by(axis, float(self.random.uniform(-3.0, 3.0)), abs(speed))
            else:
                self.made.retrace(float(self.random.uniform(0.0, 10.0)))
            for _ in range(int(self.random.integers(1, 150))):
                self.step()
            self.made.jog(axis, 0.0)
        if self.random.random() < 0.3:
            self.flush()

    def emergency_stop(self) -> None:
        self.braked.append(sum(map(len, self.rows)))
        self.made.emergency_stop()
        self.rest()
        for _ in range(30):
            self.step()
        while (self.rows[-1] != self.rows[-2]).any():  # an offset on its way
            self.step()
        self.at = self.rows[-1][-1]
        self.made.restart(list(self.at))
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
        elif drawn < 0.0325:
            self.move_by_hand()
        elif drawn < 0.0327:
            self.emergency_stop()
        elif drawn < 0.0347 and self.offsets:
            self.made.offset(int(self.random.integers(0, 3)), float(self.random.uniform(-2.0, 2.0)))

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
                break
        else:
            raise AssertionError(str(self.made.state))
        for axis in range(3 if self.offsets else 0):
            self.made.offset(axis, 0.0)
        for _ in range(600):
            self.step()
        return
        raise AssertionError(str(self.made.state))


def check_session(seed: int, periods: int = 3000) -> None:
    session = Session(seed)
    session.run(periods)
    session.end()
    rows = np.concatenate(session.rows)
    begins = [0, *session.braked]
    for begin, end in zip(begins, [*session.braked, len(rows)], strict=True):
        # An emergency stop has its own acceleration; what follows it begins at rest.
        piece = rows[begin:end]
        if begin:
            braking = np.abs(np.diff(rows[begin - 2 : begin + 200], n=2, axis=0)).max() / PERIOD_S**2
            assert braking <= 1.001 * 2.0 * ACCELERATION
            piece = piece[int(np.flatnonzero((np.diff(piece, axis=0) == 0.0).all(axis=1))[0]) :]
        assert largest_share(piece - piece[0]) <= 1.001
    np.testing.assert_allclose(rows[-1], session.at, atol=1e-9)
    numbers = [number for number, _ in session.reached]
    assert numbers == sorted(set(numbers))
    # Behind the last flush none is missing; before it what had not been reached is gone.
    assert [n for n in numbers if n >= session.forgotten] == list(range(session.forgotten, len(session.places)))
    for number, step in session.reached:
        begin, end = rows[max(step - 1, 0)], rows[min(step + 1, len(rows) - 1)]
        off = distance_to(session.places[number], begin, end) if (begin != end).any() else 0.0
        off = min(off, float(np.linalg.norm(session.places[number] - rows[step])))
        assert session.offsets or off <= 2.0 * TOLERANCE_MM, (number, step)  # places are without the offset


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
