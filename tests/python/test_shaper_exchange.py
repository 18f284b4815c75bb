"""Shapers that are exchanged in motion: limits, tolerance, derivatives, and what is left of a vibration behind them."""

from typing import Any

import numpy as np
import pytest
from scipy.signal import lsim

import shapegcode as sg
from beside_the_path import ACCELERATION, PERIOD_S, control, largest_share
from shapegcode.io.units import FloatArray

SLOW, FAST = sg.Mode(12.0, 0.01), sg.Mode(40.0, 0.01)
EACH = [sg.Fir([0, 4], [0.5, 0.5]), sg.Fir([0], [1.0]), sg.Fir([0, 6, 12], [1.0, -1.0, 1.0])]


def zigzag(made: sg.MotionController, moves: int = 30) -> None:
    for n in range(1, moves + 1):
        made.push_line([6.0 * n, 5.0 * (n % 2), 0.2 * n], 90.0, stop_at_end=n == moves)


def left_of(rows: FloatArray, mode: sg.Mode, begin: int) -> float:
    """Largest deflection of a mode behind the last step, mm, where the base went on evenly before the first
    one: SciPy's integration."""
    even = rows[0] + np.arange(len(rows))[:, None] * (rows[1] - rows[0])
    rows = np.vstack([rows - even, (rows - even)[-1] + np.arange(1, 401)[:, None] * (rows[0] - rows[1])])
    w = 2.0 * np.pi * mode.frequency_hz
    times = np.arange(len(rows)) * PERIOD_S
    system = ([-1.0, 0.0, 0.0], [1.0, 2.0 * mode.damping_ratio * w, w * w])
    return float(np.abs(lsim(system, rows[:, 0], times)[1][begin:]).max())


@pytest.mark.parametrize("others", [[SLOW], [EACH], [sg.Fir([0, 30], [0.5, 0.5]), EACH]])
@pytest.mark.parametrize("fade_time_s", [0.4, 1.5])
def test_limits_hold_whenever_they_are_exchanged(others: list[Any], fade_time_s: float) -> None:
    made = control(shaper=FAST, other_shapers=others, fade_time_s=fade_time_s, queue=128)
    zigzag(made)
    rows = [made.step(50)]
    for n in range(12):
        number = (n + 1) % (len(others) + 1)
        assert made.exchange_shaper(number)
        assert not made.exchange_shaper(len(others) + 1)
        rows.append(made.step(1 + 97 * (n % 7)))
    rows.append(made.run())
    np.testing.assert_allclose(rows[-1][-1], [180.0, 0.0, 6.0], atol=1e-9)
    assert largest_share(np.concatenate(rows)) <= 1.001


def test_the_path_is_left_by_no_more_than_the_tolerance() -> None:
    """A circle: both shapers cut off less than the tolerance, and so does what lies between them."""
    made = control(shaper=FAST, other_shapers=[SLOW], fade_time_s=1.0)
    made.push_line([20, 0, 0], 80.0)
    for _ in range(8):
        made.push_arc([20, 0, 0], [20, 20, 0], 2.0 * np.pi, 80.0)
    rows = [made.step(1500)]
    made.exchange_shaper(1)
    rows.append(made.step(3000))
    radius = np.hypot(rows[1][:, 0] - 20.0, rows[1][:, 1] - 20.0)
    assert np.abs(radius - 20.0).max() <= 0.05


def test_velocity_and_acceleration_are_those_of_the_set_points() -> None:
    made = control(shaper=FAST, other_shapers=[SLOW], fade_time_s=0.4)
    zigzag(made)
    first = made.step_motion(300)
    made.exchange_shaper(1)
    x, velocity, acceleration = (np.concatenate(both) for both in zip(first, made.step_motion(900), strict=True))
    speed = (x[2:] - x[:-2]) / (2.0 * PERIOD_S)
    np.testing.assert_allclose(velocity[1:-1], speed, atol=0.02)
    change = (x[2:] - 2.0 * x[1:-1] + x[:-2]) / PERIOD_S**2
    assert np.quantile(np.abs(acceleration[1:-1] - change), 0.99) < 0.05 * ACCELERATION


def test_what_is_faded_to_leaves_no_vibration() -> None:
    """A cut that is stopped after the exchange leaves nothing of the mode that the second shaper is for."""
    left = []
    for number in (0, 1):
        made = control(shaper=FAST, other_shapers=[SLOW], fade_time_s=0.5)
        made.push_line([150, 0, 0], 100.0, stop_at_end=True)
        rows = [made.step(200)]
        made.exchange_shaper(number)
        rows.append(made.run())
        assert made.state.shaper == number
        braking = np.concatenate(rows)[900:]
        left.append(left_of(braking, SLOW, len(braking)))
    assert left[0] > 0.05
    assert left[1] < 0.05 * left[0]


def test_the_delay_is_that_of_the_shaper() -> None:
    made = control(shaper=sg.Fir([0, 10], [0.5, 0.5]), other_shapers=[sg.Fir([0, 40], [0.5, 0.5])], fade_time_s=0.3)
    assert made.delay_periods == 5.0
    assert made.exchange_shaper(1)
    assert made.delay_periods == 20.0
    made.push_line([100, 0, 0], 50.0)
    made.push_event(7)
    made.push_line([120, 0, 0], 50.0, stop_at_end=True)
    rows = made.run()
    (event,) = made.take_events()
    # Set-points are 20 periods of 50 mm/s behind the path.
    assert rows[event.step - 1][0] == pytest.approx(100.0, abs=0.051)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fade_time_s": 0.0}, "time of a fade is 0 s, must be finite and above 0"),
        ({"fade_time_s": 0.02}, "axis 0: a fade of 0.02 s leaves the share"),
        ({"contour_correction": True}, "shapers to exchange beside a contour correction"),
        ({"max_feed_mm_per_s": None}, "axis 0: a fade between shapers wants a limit of the feed"),
        ({"other_shapers": [EACH[:2]]}, "2 shapers for 3 axes"),
    ],
)
def test_what_cannot_be_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(sg.ArgumentError, match=message):
        control(**({"shaper": FAST, "other_shapers": [SLOW]} | changes))
