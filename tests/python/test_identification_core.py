"""The numerical core of identification against SciPy, closed forms, numeric differentiation and repeated draws."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import scipy.optimize
import scipy.signal

from shapegcode import _core
from shapegcode.io.units import FloatArray

PERIOD_S = 1 / 4000
COUNT = 1500
TIME_S = PERIOD_S * np.arange(COUNT)
# Two modes: Hz, damping ratio, kg.
OMEGA = 2.0 * np.pi * np.array([60.0, 145.0])
ZETA = np.array([0.03, 0.02])
INVERSE_MASS = 1.0 / np.array([12.0, 5.0])
POWER = {"displacement": [1.0], "velocity": [1.0, 0.0], "acceleration": [1.0, 0.0, 0.0]}


def pulse(
    start_s: float = 0.004, width_s: float = 0.003, peak_n: float = 400.0, time_s: FloatArray = TIME_S
) -> FloatArray:
    inside = (time_s > start_s) & (time_s < start_s + width_s)
    return np.where(inside, peak_n * np.sin(np.pi * (time_s - start_s) / width_s) ** 2, 0.0)


def systems(parameters: FloatArray, quantity: str) -> list[tuple[FloatArray, list[float]]]:
    """Numerator and denominator per mode; `parameters`: omega, zeta, 1/m per row."""
    return [
        (inverse_mass * np.array(POWER[quantity]), [1.0, 2.0 * zeta * omega, omega * omega])
        for omega, zeta, inverse_mass in parameters
    ]


def simulated(force: FloatArray, parameters: FloatArray, quantity: str = "acceleration") -> FloatArray:
    """SciPy's response to a force that is linear between samples."""
    total = np.zeros(len(force))
    for system in systems(parameters, quantity):
        numerator, denominator, _ = scipy.signal.cont2discrete(system, PERIOD_S, method="foh")
        total += scipy.signal.lfilter(numerator.ravel(), denominator, force)
    return total


TRUTH = np.column_stack([OMEGA, ZETA, INVERSE_MASS])
FORCE = pulse()
RESPONSE = simulated(FORCE, TRUTH)
NOISE = 0.01 * float(np.sqrt(np.mean(RESPONSE**2)))  # 40 dB


def fitted_rows(fit: _core.ModalFit) -> FloatArray:
    return np.column_stack([fit.omega_rad_s, fit.damping_ratio, fit.inverse_mass])


def deviations(fit: Any) -> FloatArray:
    return np.sqrt(np.diag(fit.covariance))


def fit_from(force: FloatArray, response: FloatArray, **options: Any) -> _core.ModalFit:
    fit = _core.fit_modes([force], [response], PERIOD_S, OMEGA * [1.02, 0.98], ZETA * 1.3, **options)
    assert fit.converged, fit.reason
    return fit


REFERENCE = (5.0, 20.0, 4000.0)  # kg, N s/m, N/m
REFERENCE_PERIOD_S = 0.005
REFERENCE_COUNT = 1024
REFERENCE_OMEGA = np.sqrt(4000.0 / 5.0)
REFERENCE_ZETA = 20.0 / (2.0 * np.sqrt(4000.0 * 5.0))


def after_impulse() -> FloatArray:
    """Exact acceleration after an impulse of 1 N s at the first sample."""
    pole = complex(-REFERENCE_ZETA * REFERENCE_OMEGA, REFERENCE_OMEGA * np.sqrt(1.0 - REFERENCE_ZETA**2))
    time_s = REFERENCE_PERIOD_S * np.arange(REFERENCE_COUNT)
    return np.asarray(np.imag(pole**2 * np.exp(pole * time_s)) / pole.imag / 5.0)


def wilson_after_impulse(theta: float) -> FloatArray:
    return _core.wilson_theta(
        *REFERENCE, np.zeros(REFERENCE_COUNT), REFERENCE_PERIOD_S, theta, velocity_m_per_s=1.0 / 5.0
    )[2]


def reference_figures(arma: _core.Arma) -> list[float]:
    omega, zeta = _core.poles_to_modes(list(arma.poles), REFERENCE_PERIOD_S)
    return [*arma.phi, omega[0] / (2.0 * np.pi), zeta[0]]


@pytest.mark.parametrize("plain", [False, True])
def test_reference_of_paper_003_from_the_exact_response(plain: bool) -> None:
    response = after_impulse()
    assert np.sqrt(np.mean(response**2)) == pytest.approx(0.8928, abs=5e-5)
    arma = _core.arma_decay([response], 1, plain=plain)
    assert arma.converged
    pole = np.exp(REFERENCE_PERIOD_S * complex(-2.0, np.sqrt(796.0)))
    exact = [2.0 * pole.real, -(abs(pole) ** 2), np.sqrt(800.0) / (2.0 * np.pi), np.sqrt(0.005)]
    assert reference_figures(arma) == pytest.approx(exact, rel=1e-10)
    assert exact == pytest.approx([1.96043, -0.98020, 4.5016, 0.0707], abs=5e-5)


def wilson_poles(theta: float) -> npt.NDArray[np.complex128]:
    """Poles of the method itself: eigenvalues of one step on (x, v, a)."""
    starts = ((1.0, 0.0), (0.0, 1.0))
    motions = [
        np.array(_core.wilson_theta(*REFERENCE, np.zeros(3), REFERENCE_PERIOD_S, theta, *start)) for start in starts
    ]
    # The acceleration of a start follows from x and v; those after one step are starts of another kind.
    before = np.column_stack([motion[:, k] for motion in motions for k in (0, 1)])
    after = np.column_stack([motion[:, k] for motion in motions for k in (1, 2)])
    scale = np.diag([1.0, 1.0 / 30.0, 1.0 / 900.0])
    return np.linalg.eigvals(scale @ after @ np.linalg.pinv(scale @ before, rcond=1e-9))


@pytest.mark.parametrize("theta", [1.0, 1.4, 2.0])
def test_iterated_model_finds_the_poles_of_the_wilson_method(theta: float) -> None:
    oscillating = [pole for pole in wilson_poles(theta) if pole.imag > 1e-6]
    # The method has a third, real pole, which dies out within a few samples.
    arma = _core.arma_decay([wilson_after_impulse(theta)[20:]], 1)
    assert max(arma.poles, key=lambda pole: pole.imag) == pytest.approx(oscillating[0], abs=1e-7)


def test_reference_of_paper_003_from_the_wilson_response() -> None:
    # Plain least squares, the third pole of the method in the way.
    plain = _core.arma_decay([wilson_after_impulse(1.4)], 1, plain=True)
    assert reference_figures(plain) == pytest.approx([1.9610, -0.9806, 4.484, 0.0695], abs=5e-4)
    assert reference_figures(plain)[:2] == pytest.approx([1.9610, -0.9806], abs=5e-5)
    # The paper's own digits come from linear acceleration, the method with theta = 1.
    linear = _core.arma_decay([wilson_after_impulse(1.0)], 1)
    assert reference_figures(linear)[:2] == pytest.approx([1.9605, -0.9803], abs=5e-5)


@pytest.mark.parametrize("impulse", ["state", "sample"])
def test_equivalent_mass_of_paper_003(impulse: str) -> None:
    force = np.zeros(REFERENCE_COUNT)
    if impulse == "state":
        response, impulse_n_s = wilson_after_impulse(1.4), 1.0
    else:
        force[1] = 1.0 / REFERENCE_PERIOD_S
        response, impulse_n_s = _core.wilson_theta(*REFERENCE, force, REFERENCE_PERIOD_S)[2], 0.0
    arguments = (force, response, REFERENCE_PERIOD_S, REFERENCE_OMEGA, REFERENCE_ZETA)
    closed = _core.equivalent_mass_closed_form(*arguments, impulse_n_s=impulse_n_s)
    assert closed.mass_kg == pytest.approx(5.0, rel=1e-12)
    search = _core.equivalent_mass_bisection(*arguments, 1e-3, 1e3, 0.01, impulse_n_s=impulse_n_s)
    assert search.converged
    assert search.halvings == 12
    assert search.mass_kg == pytest.approx(5.0059, abs=5e-5)
    # With frequency and damping from the response as well, as the paper does it.
    omega, zeta = _core.poles_to_modes(list(_core.arma_decay([response[20:]], 1).poles), REFERENCE_PERIOD_S)
    found = _core.equivalent_mass_closed_form(
        force, response, REFERENCE_PERIOD_S, omega[0], zeta[0], impulse_n_s=impulse_n_s
    )
    assert found.mass_kg == pytest.approx(5.0, rel=2e-3)


@pytest.mark.parametrize("quantity", ["acceleration", "velocity", "displacement"])
def test_response_equals_lsim(quantity: str) -> None:
    random_force = np.random.default_rng(3).standard_normal(COUNT)
    random_force[0] = 0.0
    expected = sum(scipy.signal.lsim(system, random_force, TIME_S)[1] for system in systems(TRUTH, quantity))
    response = _core.modal_response(random_force, PERIOD_S, OMEGA, ZETA, INVERSE_MASS, quantity)
    assert np.max(np.abs(response - expected)) < 1e-11 * np.max(np.abs(expected))


def numeric_jacobian(quantity: str) -> FloatArray:
    columns = []
    for row in range(len(TRUTH)):
        for column in range(3):
            step = 1e-4 * TRUTH[row, column]
            ends = []
            for sign in (1.0, -1.0):
                moved = TRUTH.copy()
                moved[row, column] += sign * step
                ends.append(simulated(FORCE, moved, quantity))
            columns.append((ends[0] - ends[1]) / (2.0 * step))
    return np.column_stack([*columns, np.ones(COUNT)])


@pytest.mark.parametrize("quantity", ["acceleration", "velocity", "displacement"])
def test_covariance_equals_that_of_numeric_derivatives(quantity: str) -> None:
    exact = simulated(FORCE, TRUTH, quantity)
    noise = 1e-5 * np.std(exact) * np.random.default_rng(1).standard_normal(COUNT)
    fit = fit_from(FORCE, exact + noise, quantity=quantity)
    jacobian = numeric_jacobian(quantity)
    variance = fit.sum_of_squares / (COUNT - 7)
    expected = variance * np.linalg.inv(jacobian.T @ jacobian)[:6, :6]
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(fit.covariance / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-2)
    assert fit.parameters == 7
    assert fit.samples == COUNT
    assert fit.residual_rms[0] == pytest.approx(np.sqrt(fit.sum_of_squares / COUNT))
    assert np.sqrt(np.mean((fit.fitted[0] - exact - noise) ** 2)) == pytest.approx(fit.residual_rms[0])


def test_fit_equals_scipy_least_squares() -> None:
    response = RESPONSE + 10.0 * NOISE * np.random.default_rng(2).standard_normal(COUNT) + 0.3
    fit = fit_from(FORCE, response)

    def residual(scaled: FloatArray) -> FloatArray:
        return np.asarray(simulated(FORCE, scaled[:6].reshape(2, 3) * TRUTH) + scaled[6] - response)

    other = scipy.optimize.least_squares(residual, np.r_[np.ones(6), 0.0], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert fit.sum_of_squares == pytest.approx(2.0 * other.cost, rel=1e-10)
    np.testing.assert_allclose(fitted_rows(fit), other.x[:6].reshape(2, 3) * TRUTH, rtol=1e-5)
    assert fit.offset[0] == pytest.approx(other.x[6], abs=1e-6)
    variance = 2.0 * other.cost / (COUNT - 7)
    expected = np.sqrt(variance * np.diag(np.linalg.inv(other.jac.T @ other.jac)))[:6] * TRUTH.ravel()
    np.testing.assert_allclose(deviations(fit), expected, rtol=1e-3)


def test_decay_equals_scipy_least_squares() -> None:
    random = np.random.default_rng(4)
    amplitude = np.array([[1.0, 0.4], [-0.5, 0.8]])

    def model(values: FloatArray, record: int) -> FloatArray:
        omega, zeta = values[0:4:2], values[1:4:2]
        own = values[4 + 5 * record : 9 + 5 * record]
        cosines = [
            np.exp(-z * w * TIME_S)
            * (a * np.cos(w * np.sqrt(1 - z * z) * TIME_S) + b * np.sin(w * np.sqrt(1 - z * z) * TIME_S))
            for w, z, a, b in zip(omega, zeta, own[0:4:2], own[1:4:2], strict=True)
        ]
        return np.asarray(sum(cosines) + own[4])

    shared = np.column_stack([OMEGA, ZETA]).ravel()
    truth = np.r_[shared, amplitude[0], 0.2, 0.1, 0.0, amplitude[1], 0.3, -0.2, 0.05]
    records = [model(truth, r) + 0.02 * random.standard_normal(COUNT) for r in (0, 1)]
    starts = _core.poles_to_modes(list(_core.arma_decay(records, 2).poles), PERIOD_S)
    fit = _core.fit_decay(records, PERIOD_S, *starts)
    assert fit.converged, fit.reason
    scale = np.r_[truth[:4], np.ones(10)]

    def residual(scaled: FloatArray) -> FloatArray:
        return np.concatenate([model(scaled * scale, r) - records[r] for r in (0, 1)])

    other = scipy.optimize.least_squares(residual, truth / scale, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert fit.sum_of_squares == pytest.approx(2.0 * other.cost, rel=1e-9)
    np.testing.assert_allclose(
        np.column_stack([fit.omega_rad_s, fit.damping_ratio]).ravel(), (other.x * scale)[:4], rtol=1e-5
    )
    variance = 2.0 * other.cost / (2 * COUNT - 14)
    expected = np.sqrt(variance * np.diag(np.linalg.inv(other.jac.T @ other.jac)))[:4] * truth[:4]
    np.testing.assert_allclose(deviations(fit), expected, rtol=1e-3)
    np.testing.assert_allclose(fit.amplitude[0], np.hypot(other.x[4:8:2], other.x[5:8:2]), rtol=1e-4)


def test_intervals_cover_at_forty_decibels() -> None:
    random = np.random.default_rng(11)
    inside = []
    for _ in range(60):
        fit = fit_from(FORCE, RESPONSE + NOISE * random.standard_normal(COUNT))
        inside.append(np.abs(fitted_rows(fit) - TRUTH).ravel() < 1.96 * deviations(fit))
        assert abs(fit.residual_autocorrelation) < 0.1
    assert 0.92 <= np.mean(inside) <= 0.98


def spread(draws: list[FloatArray]) -> FloatArray:
    return np.sqrt(np.mean((np.array(draws) - TRUTH.ravel()) ** 2, axis=0))


def test_intervals_hold_for_coloured_noise() -> None:
    random = np.random.default_rng(12)
    draws, coloured, white = [], [], []
    for _ in range(60):
        noise = scipy.signal.lfilter([NOISE], [1.0, -0.9], random.standard_normal(COUNT + 200))[200:]
        fit = fit_from(FORCE, RESPONSE + noise, coloured_residuals=True)
        draws.append(fitted_rows(fit).ravel())
        coloured.append(deviations(fit))
        white.append(deviations(fit_from(FORCE, RESPONSE + noise)))
        assert fit.residual_autocorrelation > 0.7
    ratio = np.median(coloured, axis=0) / spread(draws)
    assert np.all((ratio > 0.75) & (ratio < 1.3))
    # Without the option the slow mode's intervals are too short: most of this noise lies near it.
    assert np.all(np.median(white, axis=0)[:3] < 0.7 * spread(draws)[:3])


def test_intervals_hold_for_noise_on_the_force() -> None:
    random = np.random.default_rng(13)
    force_noise_n = 1.0
    draws, stated, without = [], [], []
    for _ in range(60):
        force = FORCE + force_noise_n * random.standard_normal(COUNT)
        response = RESPONSE + 0.1 * NOISE * random.standard_normal(COUNT)
        fit = fit_from(force, response, force_noise_n=force_noise_n)
        draws.append(fitted_rows(fit).ravel())
        stated.append(deviations(fit))
        without.append(deviations(fit_from(force, response)))
    ratio = np.median(stated, axis=0) / spread(draws)
    assert np.all((ratio > 0.75) & (ratio < 1.3))
    assert np.mean(np.median(without, axis=0) / spread(draws)) < 0.6


@pytest.mark.parametrize(
    ("frequency_hz", "zeta", "mass_kg"),
    [
        ([100.0, 105.0], [0.02, 0.02], [5.0, 8.0]),  # 5 % apart
        ([100.0, 240.0], [0.02, 0.02], [5.0, 158.0]),  # -30 dB
        ([46.0, 131.0, 137.5, 600.0], [0.02, 0.03, 0.025, 0.01], [12.0, -6.0, 8.0, 40.0]),
    ],
)
def test_modes_are_found_from_poles_alone(frequency_hz: list[float], zeta: list[float], mass_kg: list[float]) -> None:
    truth = np.column_stack([2.0 * np.pi * np.array(frequency_hz), zeta, 1.0 / np.array(mass_kg)])
    random = np.random.default_rng(5)
    time_s = PERIOD_S * np.arange(4096)
    forces = [pulse(0.002 + 0.0001 * k, 0.0012, 300.0 + 80.0 * k, time_s) for k in range(3)]
    exact = [simulated(force, truth) for force in forces]
    noise = 0.01 * np.sqrt(np.mean(np.square(exact)))
    responses = [response + noise * random.standard_normal(4096) for response in exact]
    count = len(truth)
    arma = _core.arma_driven(forces, responses, count)
    fit = _core.fit_modes(forces, responses, PERIOD_S, *_core.poles_to_modes(list(arma.poles), PERIOD_S))
    assert fit.converged, fit.reason
    assert np.all(np.abs(fitted_rows(fit) - truth).ravel() < 4.0 * deviations(fit))
    # The chart has them too, and forward selection picks them out of a model with far too many.
    poles = _core.stabilisation_poles(responses, 20, forces)
    assert [len(order) for order in poles] == list(range(2, 42, 2))
    candidates = _core.poles_to_modes(list(poles[19]), PERIOD_S)
    ranking = _core.rank_modes(responses, PERIOD_S, *candidates, count, forces)
    np.testing.assert_allclose(np.sort(candidates[0][ranking.chosen]), truth[:, 0], rtol=0.01)
    assert ranking.sum_of_squares[-1] < 0.01 * ranking.total
    # What is kept is not chosen again.
    doubled = tuple(np.r_[values[:1], candidate] for values, candidate in zip(truth.T[:2], candidates, strict=True))
    again = _core.rank_modes(responses, PERIOD_S, *doubled, count, forces, kept=1)
    assert again.chosen[0] == 0
    np.testing.assert_allclose(np.sort(doubled[0][again.chosen]), truth[:, 0], rtol=0.01)


def test_terms_out_of_band() -> None:
    second_difference = np.convolve(FORCE, [1.0, -2.0, 1.0])[1:-1] / PERIOD_S**2
    response = RESPONSE + FORCE / 90.0 + 2e-9 * second_difference
    fit = fit_from(FORCE, response, with_mass_line=True, with_compliance=True)
    np.testing.assert_allclose(fitted_rows(fit), TRUTH, rtol=1e-8)
    assert fit.mass_line == pytest.approx(1.0 / 90.0, rel=1e-7)
    assert fit.compliance == pytest.approx(2e-9, rel=1e-7)


def test_a_mode_too_many_is_told() -> None:
    fit = _core.fit_modes([FORCE], [RESPONSE], PERIOD_S, [*OMEGA, OMEGA[0]], [*ZETA, ZETA[0]])
    assert not fit.converged
    assert "told apart" in fit.reason


def test_refusals_carry_the_numbers() -> None:
    holed = RESPONSE.copy()
    holed[17] = np.nan
    start = (OMEGA, ZETA)
    cases: list[tuple[Any, str]] = [
        (lambda: _core.fit_modes([FORCE], [holed], PERIOD_S, *start), "record 0 is not finite at sample 17"),
        (lambda: _core.fit_modes([FORCE[:-1]], [RESPONSE], PERIOD_S, *start), "1499 samples of force and 1500"),
        (lambda: _core.fit_modes([0.0 * FORCE], [RESPONSE], PERIOD_S, *start), "zero throughout"),
        (lambda: _core.fit_modes([], [], PERIOD_S, *start), "no record"),
        (lambda: _core.fit_modes([FORCE], [RESPONSE], 0.0, *start), "is 0 s, must be finite and above 0"),
        (lambda: _core.fit_modes([FORCE], [RESPONSE], PERIOD_S, [13000.0], [0.1]), "13000 rad/s.*12566"),
        (lambda: _core.fit_modes([FORCE], [RESPONSE], PERIOD_S, [100.0], [1.0]), "damping ratio 1"),
        (lambda: _core.fit_modes([FORCE[16:20]], [RESPONSE[16:20]], PERIOD_S, *start), "4 samples, at least 8"),
        (lambda: _core.fit_modes([FORCE], [RESPONSE], PERIOD_S, *start, quantity="jerk"), "'jerk'"),
        (lambda: _core.fit_modes([FORCE], [RESPONSE], PERIOD_S, *start, force_noise_n=-1.0), "-1 N"),
        (lambda: _core.fit_decay([RESPONSE[:5]], PERIOD_S, *start), "5 samples, at least 10"),
        (lambda: _core.arma_driven([FORCE], [RESPONSE], 0), "0 modes"),
        (lambda: _core.arma_decay([RESPONSE[:10]], 1), "10 samples, at least 16"),
        (lambda: _core.stabilisation_poles([RESPONSE[:40]], 20), "40 samples, at least 168"),
        (lambda: _core.poles_to_modes([0.5j], -1.0), "-1 s"),
        (lambda: _core.equivalent_mass_closed_form(FORCE, 0.0 * RESPONSE, PERIOD_S, 1.0, 0.1), "zero throughout"),
        (lambda: _core.wilson_theta(0.0, 1.0, 1.0, FORCE, PERIOD_S), "mass in kg is 0"),
        (lambda: _core.rank_modes([RESPONSE], PERIOD_S, *start, 0), "at least 1"),
    ]
    for call, message in cases:
        with pytest.raises(_core.ArgumentError, match=message):
            call()
