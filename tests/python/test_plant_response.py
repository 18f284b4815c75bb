"""Whole records through base-excited modes, against SciPy's filter and simulation of the same plant."""

import numpy as np
import pytest
from scipy import signal

import shapegcode as sg
from shapegcode.io.units import FloatArray

PERIOD = 1e-3
MODES = [[sg.Mode(46.0, 0.02, 1.0), sg.Mode(210.0, 0.05, 0.2)], [sg.Mode(131.0, 0.0, 1.0)]]


def record(rows: int = 5000) -> FloatArray:
    rng = np.random.default_rng(1)
    steps = rng.normal(0.0, 0.1, (rows, 2))
    steps[rows // 2 :] = 0.0
    return 20.0 + np.cumsum(steps, axis=0)


def deflection_model(mode: sg.Mode) -> tuple[list[float], list[float]]:
    """Deflection over command in continuous time."""
    omega = 2.0 * np.pi * mode.frequency_hz
    return [-mode.participation, 0.0, 0.0], [1.0, 2.0 * mode.damping_ratio * omega, omega**2]


def test_record_is_that_of_scipy() -> None:
    command = record()
    got = sg.plant_response(command, MODES, PERIOD)
    times = np.arange(len(command)) * PERIOD
    for axis, modes in enumerate(MODES):
        moved = command[:, axis] - command[0, axis]
        simulated = command[:, axis] + sum(signal.lsim(deflection_model(mode), moved, times)[1] for mode in modes)
        assert np.abs(got[:, axis] - simulated).max() < 1e-9
        filtered = command[:, axis].copy()
        for mode in modes:
            numerator, denominator, _ = signal.cont2discrete(deflection_model(mode), PERIOD, method="foh")
            filtered += signal.lfilter(np.ravel(numerator), denominator, moved)
        assert np.abs(got[:, axis] - filtered).max() < 1e-7


@pytest.mark.parametrize("arrange", [np.asfortranarray, np.ascontiguousarray, lambda a: np.repeat(a, 2, axis=0)[::2]])
def test_memory_order_does_not_matter(arrange: object) -> None:
    command = record(1300)
    got = sg.plant_response(arrange(command), MODES, PERIOD)  # type: ignore[operator]
    for axis in range(2):
        alone = sg.plant_response(command[:, axis : axis + 1], [MODES[axis]], PERIOD)
        assert np.array_equal(got[:, axis], alone[:, 0])


def test_short_records() -> None:
    assert sg.plant_response(np.zeros((0, 2)), MODES, PERIOD).shape == (0, 2)
    assert sg.plant_response([[3, 4]], MODES, PERIOD).tolist() == [[3.0, 4.0]]
    assert np.array_equal(sg.plant_response(record(10), [[], []], PERIOD), record(10))


def test_refusals() -> None:
    for command, modes, period, named in (
        (np.zeros(5), MODES, PERIOD, "n_samples, n_axes"),
        (np.zeros((5, 3)), MODES, PERIOD, "2 axes"),
        (np.zeros((5, 0)), [], PERIOD, "0 axes"),
        (np.full((5, 2), np.nan), MODES, PERIOD, "not finite"),
        (np.zeros((5, 2)), MODES, -1.0, "period"),
    ):
        with pytest.raises(sg.ArgumentError, match=named):
            sg.plant_response(command, modes, period)


def test_modes_of_a_machine_file() -> None:
    machine = sg.Machine.load("vx500")
    command = np.cumsum(record(300), axis=0)
    expected = sg.plant_response(command, [[sg.Mode(46.0, 0.02)], [sg.Mode(131.0, 0.02)]], PERIOD)
    assert np.array_equal(sg.plant_response(command, machine, PERIOD), expected)
    assert np.array_equal(sg.plant_response(command, [machine.axes.x.modes, machine.axes.y.modes], PERIOD), expected)
    assert sg.plant_response(np.zeros((5, 3)), machine, PERIOD).shape == (5, 3)
    for wrong in (machine.axes.x.modes, [[(46.0, 0.02)], []], 46.0, "vx500"):
        with pytest.raises(sg.ArgumentError, match=r"modes.* must be a machine or a list of modes for each axis"):
            sg.plant_response(command, wrong, PERIOD)  # type: ignore[arg-type]
    assert sg.plant_response(np.zeros((5, 1)), machine, PERIOD).shape == (5, 1)
    with pytest.raises(sg.ArgumentError):
        sg.plant_response(np.zeros((5, 4)), machine, PERIOD)
