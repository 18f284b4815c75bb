"""Exact propagation of linear plants: held against SciPy's exponential and simulation, and against closed forms."""

import numpy as np
import pytest
from scipy import linalg, signal

import shapegcode as sg
from shapegcode import _core
from shapegcode.io.units import FloatArray

PERIOD = 1e-3
TURN = 2.0 * np.pi


def modal(frequency: float, damping: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Base-excited mode: u'' + 2 zeta omega u' + omega^2 u = 2 zeta omega x' + omega^2 x."""
    omega = TURN * frequency
    a = np.array([[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]])  # u, u' - 2 zeta omega x
    b = np.array([[2.0 * damping * omega], [omega**2 * (1.0 - 4.0 * damping**2)]])
    return a, b, np.array([[1.0, 0.0]]), np.zeros((1, 1))


def drive() -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Motor and table on a stiff screw under P-PI control, electrical pole at 1e5 1/s: stiff. SI, angles as lengths."""
    motor, table, screw, damper = 60.0, 40.0, 3e8, 2e3
    velocity_gain, integral, position_gain, electrical = 4e4, 4e6, 60.0, 1e5
    a = np.zeros((6, 6))  # x_m, v_m, x_t, v_t, integral of the velocity's error, force
    a[0, 1] = a[2, 3] = 1.0
    a[1] = np.array([-screw, -damper, screw, damper, 0.0, 1.0]) / motor
    a[3] = np.array([screw, damper, -screw, -damper, 0.0, 0.0]) / table
    a[4, :2] = -position_gain, -1.0
    a[5] = electrical * np.array([-velocity_gain * position_gain, -velocity_gain, 0.0, 0.0, integral, -1.0])
    b = np.zeros((6, 1))
    b[4, 0] = position_gain
    b[5, 0] = electrical * velocity_gain * position_gain
    return a, b, np.array([[1.0, 0, 0, 0, 0, 0], [0, 0, 1.0, 0, 0, 0]]), np.zeros((2, 1))


def chain(modes: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Free masses on springs, no damping, pushed at one end: singular A, a double integrator and undamped modes."""
    springs = np.diff(np.eye(modes), axis=0)
    stiffness = 1e4 * springs.T @ springs
    a = np.block([[np.zeros((modes, modes)), np.eye(modes)], [-stiffness, np.zeros((modes, modes))]])
    b = np.zeros((2 * modes, 2))
    b[modes, 0] = 1.0
    b[-1, 1] = -0.5
    return a, b, np.eye(modes, 2 * modes), np.ones((modes, 2)) * 1e-4


PLANTS = {
    "mode 46 Hz": modal(46.0, 0.02),
    "undamped 131 Hz": modal(131.0, 0.0),
    "mode near Nyquist": modal(460.0, 0.5),
    "stiff drive": drive(),
    "free chain": chain(4),
    "integrators": (np.diag([1.0, 1.0], 1), np.array([[0.0], [0.0], [1.0]]), np.eye(3), np.zeros((3, 1))),
}


def inputs_for(plant: tuple[FloatArray, FloatArray, FloatArray, FloatArray], samples: int = 2000) -> FloatArray:
    rng = np.random.default_rng(5)
    walk = np.cumsum(rng.normal(size=(samples, plant[1].shape[1])), axis=0)
    walk[: samples // 10] = 0.0
    return walk


@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS.keys())
def test_record_is_that_of_lsim(plant: tuple[FloatArray, FloatArray, FloatArray, FloatArray]) -> None:
    inputs = inputs_for(plant)
    start = np.linspace(1.0, -1.0, len(plant[0]))
    times = np.arange(len(inputs)) * PERIOD
    for state in (None, start):
        got = sg.LinearPlant(*plant, PERIOD).respond(inputs, state)
        expected = signal.lsim(plant, inputs, times, X0=state)[1].reshape(got.shape)
        assert np.abs(got - expected).max() <= 1e-8 * np.abs(expected).max()


def test_steps_are_the_record_to_the_last_bit() -> None:
    plant = drive()
    inputs = inputs_for(plant)
    whole = sg.LinearPlant(*plant, PERIOD)
    record = whole.respond(inputs)
    stepped = sg.LinearPlant(*plant, PERIOD)
    stepped.reset_at_rest(inputs[0])
    assert np.array_equal(stepped.output, record[0])
    assert all(
        np.array_equal(stepped.step(row), expected) for row, expected in zip(inputs[1:], record[1:], strict=True)
    )
    assert np.array_equal(stepped.state, whole.state)


@pytest.mark.parametrize("period", [1e-5, 1e-3, 0.05])
@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS.keys())
def test_exponential_is_that_of_scipy(
    plant: tuple[FloatArray, FloatArray, FloatArray, FloatArray], period: float
) -> None:
    matrix = plant[0] * period
    got = _core.matrix_exponential(matrix)
    # The scale of the state is ours to choose: in one where A is balanced, an error means the same in each element.
    _, (scale, _) = linalg.matrix_balance(matrix, permute=False, separate=True)
    got, expected = (exponential / scale[:, None] * scale for exponential in (got, linalg.expm(matrix)))
    assert np.abs(got - expected).max() <= 1e-11 * max(1.0, np.abs(expected).max())


def test_exponential_of_what_is_known_exactly() -> None:
    rng = np.random.default_rng(3)
    rates = np.array([-1e6, -1e3, -1.0, 0.0, 1.0])
    assert _core.matrix_exponential(np.diag(rates)) == pytest.approx(np.diag(np.exp(rates)), rel=1e-13, abs=0.0)
    for spread in (1.0, 1e3, 1e6):  # badly scaled rotations and decays
        scale = spread ** rng.uniform(-1.0, 1.0, 2)
        decay, turn = -3.0, 40.0
        matrix = np.array([[decay, turn * scale[0] / scale[1]], [-turn * scale[1] / scale[0], decay]])
        cosine, sine = np.exp(decay) * np.array([np.cos(turn), np.sin(turn)])
        exact = np.array([[cosine, sine * scale[0] / scale[1]], [-sine * scale[1] / scale[0], cosine]])
        assert _core.matrix_exponential(matrix) == pytest.approx(exact, rel=1e-12, abs=0.0)
    nilpotent = np.diag([1.0, 2.0, 3.0], 1)
    assert _core.matrix_exponential(nilpotent)[0] == pytest.approx([1.0, 1.0, 1.0, 1.0], rel=1e-15)
    for bad in (np.zeros((2, 3)), np.array([[np.nan]])):
        with pytest.raises(sg.ArgumentError, match="square and finite"):
            _core.matrix_exponential(bad)
    with pytest.raises(sg.NumericError, match="exceeds"):
        _core.matrix_exponential(np.array([[1e4]]))


def test_undamped_mode_after_a_million_samples() -> None:
    """A ramp that stops: the deflection goes on with the amplitude of the closed form."""
    omega = TURN * 131.0
    plant = sg.LinearPlant(*modal(131.0, 0.0), PERIOD)
    inputs = np.minimum(np.arange(1_000_001) * PERIOD, 0.1)[:, None]
    got = plant.respond(inputs)[:, 0]
    times = np.arange(len(inputs)) * PERIOD
    after = 0.1 + (np.sin(omega * (times - 0.1)) - np.sin(omega * times)) / omega
    assert np.abs(got - after)[101:].max() <= 1e-8 * np.abs(after).max()


def test_rest() -> None:
    plant = sg.LinearPlant(*drive(), PERIOD)
    plant.reset_at_rest([3.0])
    assert plant.state[:5] == pytest.approx([3.0, 0, 3.0, 0, 0], abs=1e-9)
    assert plant.state[5] == pytest.approx(0.0, abs=1e-11 * 4e4 * 60.0 * 3.0)  # force, N: where both its terms cancel
    for _ in range(100):
        assert plant.step([3.0]) == pytest.approx([3.0, 3.0], abs=1e-9)


def test_rest_of_free_masses_is_where_they_are() -> None:
    plant = sg.LinearPlant(*chain(3), PERIOD)
    plant.reset_at_rest([0.0, 0.0], near=[7.0, 7.0, 7.0, 0.0, 0.0, 0.0])
    assert plant.state == pytest.approx([7.0, 7.0, 7.0, 0.0, 0.0, 0.0], abs=1e-12)
    plant.reset_at_rest([1.0, 2.0])  # forces in balance: 1 on the first mass, -0.5 * 2 on the last
    assert np.diff(plant.state[:3]) == pytest.approx([-1e-4, -1e-4], rel=1e-9)
    assert plant.state[:3].sum() == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(sg.ArgumentError, match="no state of the linear plant rests"):
        plant.reset_at_rest([1.0, 0.0])


def test_refusals() -> None:
    a, b, c, d = modal(46.0, 0.02)
    for bad, named in (
        ((a[:1], b, c, d, PERIOD), "A of"),
        ((a, b[:1], c, d, PERIOD), "B of"),
        ((a, b, c[:, :1], d, PERIOD), "C of"),
        ((a, b, c, np.zeros((1, 2)), PERIOD), "D of"),
        ((a + np.inf, b, c, d, PERIOD), "not finite"),
        ((a, b, c, d, 0.0), "period"),
        ((a, b, c, d, np.nan), "period"),
        ((np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), d, PERIOD), "0 states"),
    ):
        with pytest.raises(sg.ArgumentError, match=named):
            sg.LinearPlant(*bad)
    with pytest.raises(sg.NumericError, match="exceeds"):
        sg.LinearPlant([[1e6]], [[1.0]], [[1.0]], [[0.0]], 1.0)
    plant = sg.LinearPlant(a, b, c, d, PERIOD)
    for call in (
        lambda: plant.step([1.0, 2.0]),
        lambda: plant.step([np.nan]),
        lambda: plant.respond(np.zeros((0, 1))),
        lambda: plant.respond(np.zeros((5, 2))),
        lambda: plant.respond([[np.inf]]),
        lambda: plant.respond([[0.0]], [1.0]),
        lambda: plant.reset([1.0], [0.0]),
        lambda: plant.reset([1.0, 0.0], [0.0, 0.0]),
        lambda: plant.reset_at_rest([0.0], near=[1.0]),
    ):
        with pytest.raises(sg.ArgumentError, match="linear plant"):
            call()
