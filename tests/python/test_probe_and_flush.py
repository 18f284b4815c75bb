"""A probe and a flush, by closed forms; random sessions of an operator: tests/cpp/operator_session.cpp."""

import math
from typing import Any

import numpy as np
import pytest

import shapegcode as sg
from beside_the_path import ACCELERATION, FILTERS, JERK, PERIOD_S, control, largest_share
from planned_steps import planned_steps
from shapegcode.io.units import FloatArray


@pytest.mark.parametrize("lead", [None, 60])
@pytest.mark.parametrize("filters", FILTERS)
def test_a_probe_stops_the_motion_on_its_path(filters: dict[str, Any], lead: int | None) -> None:
    """As soon as the limits allow, within what is planned ahead; the rest of the path is gone."""
    made = control(lead_periods=lead, **filters)

    def step(periods: int) -> FloatArray:
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
    np.testing.assert_array_equal(position, [5.0, 0.0, 0.0])
    made.push_line([5, 3, 0], 50.0, stop_at_end=True)
    np.testing.assert_array_equal(made.run()[-1], [5.0, 3.0, 0.0])
