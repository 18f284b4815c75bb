"""Shaper designs: the reference figures of 46 and 131 Hz, and residuals judged by NumPy and by simulation alone."""

import itertools
import math
import pickle
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from numpy.typing import NDArray
from scipy.optimize import least_squares, linprog

from shapegcode._core import (
    ArgumentError,
    DesignError,
    Mode,
    Shaper,
    convolve,
    convolved_zv,
    grid_polynomial,
    minimal_two_mode,
    zv,
)
from shapegcode.shaping import choose_block_period, shortest_non_negative
from shaper_residual import is_feasible, left_of, simulated

PAPER_MODES = (Mode(46.0, 0.02), Mode(131.0, 0.02))
PERIODS_S = (0.001, 0.002, 0.004, 0.005, 0.008)
LIMIT = 1e-10


def is_designable(modes: Sequence[Mode], period_s: float, last: int) -> bool:
    """A linear program of its own for a non-negative design of `last` periods."""
    t = np.arange(last + 1) * period_s
    poles = [
        2.0 * np.pi * mode.frequency_hz * complex(-mode.damping_ratio, math.sqrt(1.0 - mode.damping_ratio**2))
        for mode in modes
    ]
    return is_feasible([np.exp(s.real * (t[-1] - t) - 1j * s.imag * t) for s in poles], last)


def test_mode_states_its_values_and_refuses_others() -> None:
    mode = Mode(46.0, 0.02)
    assert (mode.frequency_hz, mode.damping_ratio, mode.participation) == (46.0, 0.02, 1.0)
    assert mode == Mode(46.0, 0.02, participation=1.0)
    assert mode != Mode(46.0, 0.0)
    assert hash(mode) == hash(Mode(46.0, 0.02))
    assert pickle.loads(pickle.dumps(mode)) == mode
    assert repr(mode) == "Mode(frequency_hz=46.0, damping_ratio=0.02, participation=1.0)"
    omega = 2.0 * np.pi * 46.0
    assert mode.pole == pytest.approx(complex(-0.02 * omega, omega * math.sqrt(1.0 - 0.02**2)), rel=1e-14)
    for bad in [
        (0.0, 0.1),
        (-1.0, 0.1),
        (math.nan, 0.1),
        (1.0, 1.0),
        (1.0, -0.1),
        (1.0, math.nan),
        (1.0, 0.1, math.inf),
    ]:
        with pytest.raises(ArgumentError):
            Mode(*bad)


def test_shaper_states_its_moments_and_cannot_be_changed() -> None:
    shaper = Shaper([0.0, 0.25, 1.0], [0.5, 0.75, -0.25])
    assert shaper.duration_s == 1.0
    assert shaper.mean_s == pytest.approx(0.75 * 0.25 - 0.25, rel=1e-14)
    assert shaper.variance_s2 == pytest.approx(0.75 * 0.0625 - 0.25 - shaper.mean_s**2, rel=1e-13)
    assert shaper.abs_sum == 1.5
    assert shaper.has_negative
    assert shaper == Shaper(list(np.array([0.0, 0.25, 1.0])), (0.5, 0.75, -0.25))
    assert shaper == Shaper(shaper.times_s, shaper.amplitudes)  # type: ignore[arg-type]
    assert shaper != zv(PAPER_MODES[0])
    assert pickle.loads(pickle.dumps(shaper)) == shaper
    assert repr(shaper) == "Shaper(times_s=[0.0, 0.25, 1.0], amplitudes=[0.5, 0.75, -0.25])"
    with pytest.raises(ValueError, match="read-only"):
        shaper.times_s[0] = 1.0
    with pytest.raises(AttributeError):
        shaper.duration_s = 2.0  # type: ignore[misc]
    amplitudes = shaper.amplitudes
    del shaper
    assert amplitudes.tolist() == [0.5, 0.75, -0.25]


@pytest.mark.parametrize(
    ("times_s", "amplitudes", "message"),
    [
        ([], [], "0 times"),
        ([0.0, 1.0], [1.0], "2 times, 1 amplitudes"),
        ([0.1], [1.0], "it is 0.1 s"),
        ([0.0, 0.0], [0.5, 0.5], "tap 2 at 0 s"),
        ([0.0, math.nan], [0.5, 0.5], "not finite"),
        ([0.0, 1.0], [0.5, 0.6], "add up to 1.1"),
    ],
)
def test_shaper_refuses_what_is_none(times_s: list[float], amplitudes: list[float], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        Shaper(times_s, amplitudes)


@given(st.floats(1.0, 200.0), st.floats(0.0, 0.5), st.floats(1.0, 200.0), st.floats(0.0, 0.5), st.floats(0.0, 0.5))
def test_residual_ratio_is_the_formula(f: float, zeta: float, g: float, eta: float, off: float) -> None:
    shaper = convolve(zv(Mode(f, zeta)), zv(Mode(g, eta)))
    for frequency, damping in [(f, zeta), (g, eta)]:
        assert left_of(shaper, Mode(frequency, damping)) < 1e-12
        assert shaper.residual_ratio(Mode(frequency, damping)) < 1e-12
    away = Mode(f * (1.0 + off), zeta)
    assert shaper.residual_ratio(away) == pytest.approx(left_of(shaper, away), abs=1e-12)


def test_convolved_zv_of_the_paper_lasts_625_ms() -> None:
    shaper = convolved_zv([Mode(1.0, 0.0), Mode(4.0, 0.0)])
    assert shaper.duration_s == pytest.approx(0.625, rel=1e-14)
    np.testing.assert_allclose(shaper.amplitudes, 0.25)
    with pytest.raises(ArgumentError, match="0 given"):
        convolved_zv([])


def brute_force(first: Mode, second: Mode, max_duration_s: float, points: int) -> list[tuple[float, float]]:
    """Times of all minimal shapers with sum|a| <= 10: minima of the least singular value on a grid."""
    poles = np.array([first.pole, second.pole])
    rate = float(np.abs(poles).max())
    grid = np.linspace(0.0, 1.001 * max_duration_s, points + 1)[1:]
    misfit = np.full((points + 2, points + 2), np.inf)

    def terms(t2: NDArray[np.float64], t3: NDArray[np.float64]) -> NDArray[np.float64]:
        times = np.stack([np.zeros_like(t2), t2, t3], axis=-1)[:, None, :]
        s = poles[None, :, None]
        value = np.exp(s.real * (t3[:, None, None] - times)) * np.exp(-1j * s.imag * times)
        return np.concatenate([value.real, value.imag], axis=1)

    for j in range(1, points):
        _, strength, basis = np.linalg.svd(terms(grid[:j], np.full(j, grid[j])))
        misfit[1 : j + 1, j + 1] = strength[:, 2] / np.abs(basis[:, 2, :].sum(axis=1)).clip(1e-3)
    inner = misfit[1:-1, 1:-1]
    around = [
        misfit[1 + a : points + 1 + a, 1 + b : points + 1 + b]
        for a, b in itertools.product((-1, 0, 1), repeat=2)
        if (a, b) != (0, 0)
    ]
    minima = np.argwhere((inner <= np.min(around, axis=0)) & np.isfinite(inner))

    def equations(x: NDArray[np.float64]) -> NDArray[np.float64]:
        matrix = terms(np.array([x[0] / rate]), np.array([x[1] / rate]))[0]
        return np.append(matrix @ x[2:], x[2:].sum() - 1.0)

    found: list[tuple[float, float]] = []
    for i, j in minima:
        matrix = np.vstack([terms(grid[i : i + 1], grid[j : j + 1])[0], np.ones(3)])
        start = np.linalg.lstsq(matrix, np.eye(5)[4], rcond=None)[0]
        x = least_squares(equations, np.append(rate * grid[[i, j]], start), xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        t2, t3 = float(x[0] / rate), float(x[1] / rate)
        if (
            np.abs(equations(x)).max() < 1e-10
            and 1e-4 < rate * t2 < rate * t3 - 1e-4
            and t3 <= max_duration_s * (1.0 + 1e-9)
            and np.abs(x[2:]).sum() <= 10.0
            and all(max(abs(t2 - a), abs(t3 - b)) > 1e-4 / rate for a, b in found)
        ):
            found.append((t2, t3))
    return sorted(found, key=lambda times: (round(times[1] * rate, 5), times[0]))


@pytest.mark.parametrize(
    ("first", "second", "max_duration_s", "count"),
    [
        (Mode(1.0, 0.0), Mode(4.0, 0.0), 0.8, 7),
        (Mode(131.0, 0.02), Mode(46.0, 0.02), 0.03, 9),
        pytest.param(Mode(1.0, 0.3), Mode(4.7, 0.1), 1.0, None, marks=pytest.mark.slow),
        (Mode(1.0, 0.05), Mode(2.3, 0.0), 1.5, None),
        (Mode(1.0, 0.0), Mode(2.7, 0.0), 1.6, None),
        (Mode(1.0, 0.06), Mode(3.4, 0.01), 1.6, None),
    ],
)
def test_minimal_two_mode_finds_what_brute_force_finds(
    first: Mode, second: Mode, max_duration_s: float, count: int | None
) -> None:
    shapers = minimal_two_mode(first, second, max_duration_s)
    expected = brute_force(first, second, max_duration_s, 400)
    assert count in (None, len(shapers))
    np.testing.assert_allclose([each.times_s[1:] for each in shapers], expected, rtol=1e-8)
    for shaper in shapers:
        for mode in (first, second):
            assert left_of(shaper, mode) < 1e-13


def test_grid_polynomial_reference_and_refusal() -> None:
    shaper = grid_polynomial(PAPER_MODES, 0.005)
    np.testing.assert_allclose(shaper.times_s, np.arange(5) * 0.005)
    np.testing.assert_allclose(shaper.amplitudes, [0.20394, 0.16162, 0.31387, 0.15731, 0.16327], atol=5e-6)
    with pytest.raises(DesignError, match=r"mode 200 Hz cannot be cancelled on a 5 ms grid: z = 1\.000"):
        grid_polynomial([Mode(200.0, 0.0)], 0.005)


@pytest.mark.parametrize(
    ("period_s", "duration_s"), [(0.001, 0.012), (0.002, 0.012), (0.004, 0.016), (0.005, 0.02), (0.008, 0.096)]
)
def test_shortest_non_negative_durations_of_the_machine(period_s: float, duration_s: float) -> None:
    shaper = shortest_non_negative(PAPER_MODES, period_s)
    assert shaper.duration_s == pytest.approx(duration_s, rel=1e-12)
    for mode in PAPER_MODES:
        assert left_of(shaper, mode) < 1e-14
        assert simulated(shaper, mode) < 1e-12


def test_shortest_non_negative_is_the_polynomial_at_5_ms() -> None:
    shaper = shortest_non_negative(PAPER_MODES, 0.005)
    np.testing.assert_allclose(shaper.amplitudes, grid_polynomial(PAPER_MODES, 0.005).amplitudes, rtol=1e-12)


def test_least_contour_cost_among_the_shortest() -> None:
    """The second central moment is at most that of every vertex that some linear objective selects."""
    modes, period_s = (Mode(20.0, 0.01),), 0.001
    shaper = shortest_non_negative(modes, period_s)
    last = round(shaper.duration_s / period_s)
    t = np.arange(last + 1) * period_s
    s = modes[0].pole
    term = np.exp(-s * t)
    rows, right = np.array([np.ones(last + 1), term.real, term.imag]), np.array([1.0, 0.0, 0.0])
    rng = np.random.default_rng(3)
    centres = np.linspace(0.0, t[-1], 40)
    costs = [(t - centre) ** 2 for centre in centres] + list(rng.normal(size=(40, last + 1)))
    for cost in costs:
        taps = np.asarray(linprog(cost / np.abs(cost).max(), A_eq=rows, b_eq=right).x, dtype=np.float64)
        assert taps @ t**2 - (taps @ t) ** 2 >= shaper.variance_s2 - 1e-12


def test_equal_aliased_and_near_equal_modes() -> None:
    one = shortest_non_negative([PAPER_MODES[0]], 0.005)
    assert shortest_non_negative([PAPER_MODES[0]] * 3, 0.005).duration_s == one.duration_s
    alias = [Mode(46.0, 0.0), Mode(154.0, 0.0), Mode(246.0, 0.0)]  # one z on a 5 ms grid, or its conjugate
    one = shortest_non_negative(alias[:1], 0.005)
    assert shortest_non_negative(alias, 0.005).duration_s == one.duration_s
    for distance in (1e-9, 1e-6, 1e-4, 1e-2):
        modes = [Mode(46.0, 0.02), Mode(46.0 * (1.0 + distance), 0.02)]
        for period_s in PERIODS_S:
            shaper = shortest_non_negative(modes, period_s)
            for mode in modes:
                assert left_of(shaper, mode) < LIMIT


def test_refusals_say_what_there_is() -> None:
    with pytest.raises(DesignError) as failed:
        shortest_non_negative(PAPER_MODES, 0.008, max_duration_s=0.09)
    assert str(failed.value) == (
        "no non-negative design within 90 ms on a 8 ms grid for modes 46 Hz (zeta 0.02), 131 Hz (zeta 0.02); "
        "the shortest polynomial takes 32 ms with sum|a| 10.34; try another period"
    )
    with pytest.raises(DesignError, match="nor is there a polynomial design: mode 200 Hz cannot be cancelled on"):
        shortest_non_negative([Mode(200.0, 0.0)], 0.005)
    with pytest.raises(ArgumentError, match="0 given"):
        shortest_non_negative([], 0.005)
    for bad in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ArgumentError, match="period_s"):
            shortest_non_negative(PAPER_MODES, bad)
        with pytest.raises(ArgumentError, match="max_duration_s"):
            shortest_non_negative(PAPER_MODES, 0.005, bad)


@pytest.mark.parametrize("pairs", [40, pytest.param(200, marks=pytest.mark.slow)])
def test_acceptance_of_random_pairs(pairs: int) -> None:
    """Each design leaves at most 1e-10 and none is shorter, or there is none within 250 ms."""
    rng = np.random.default_rng(20250)
    designs, refusals, worst = 0, 0, 0.0
    for pair in range(pairs):
        frequencies_hz, ratios = rng.uniform(15.0, 150.0, 2).tolist(), rng.uniform(0.0, 0.05, 2).tolist()
        modes = [Mode(f, zeta) for f, zeta in zip(frequencies_hz, ratios, strict=True)]
        for period_s in PERIODS_S:
            try:
                shaper = shortest_non_negative(modes, period_s)
            except DesignError as error:
                refusals += 1
                assert "no non-negative design within 250 ms" in str(error)
                assert not is_designable(modes, period_s, math.floor(0.25 / period_s + 1e-9))
                continue
            designs += 1
            steps = shaper.times_s / period_s
            assert np.abs(steps - np.round(steps)).max() < 1e-9
            assert shaper.amplitudes.min() > 0.0
            assert shaper.amplitudes.sum() == pytest.approx(1.0, abs=1e-14)
            assert shaper.duration_s <= 0.25 + 1e-12
            assert not is_designable(modes, period_s, round(steps[-1]) - 1)
            worst = max(worst, *(left_of(shaper, mode) for mode in modes))
            if pair % 10 == 0:
                assert max(simulated(shaper, mode) for mode in modes) < LIMIT
    assert worst <= LIMIT
    assert designs + refusals == len(PERIODS_S) * pairs
    assert designs > 0.9 * len(PERIODS_S) * pairs
    print(f"{designs} designs, {refusals} refusals, worst residual {worst:.1e}")


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.tuples(st.floats(10.0, 200.0), st.floats(0.0, 0.1)), min_size=1, max_size=4), st.sampled_from(PERIODS_S)
)
def test_any_number_of_modes(values: list[tuple[float, float]], period_s: float) -> None:
    modes = [Mode(f, zeta) for f, zeta in values]
    try:
        shaper = shortest_non_negative(modes, period_s)
    except DesignError:
        assume(False)
    for mode in modes:
        assert left_of(shaper, mode) <= LIMIT


def test_block_period_of_the_machine_is_5_ms() -> None:
    choice = choose_block_period(PAPER_MODES, 0.001, 0.005)
    assert choice.period_s == pytest.approx(0.005, rel=1e-12)
    assert choice.shaper.duration_s == pytest.approx(0.02, rel=1e-12)
    assert [round(each.period_s * 1e3) for each in choice.candidates] == list(range(5, 21))
    at_8_ms = choice.candidates[3].shaper
    assert at_8_ms.duration_s == pytest.approx(0.096)


def test_equal_durations_go_to_the_longer_block_period() -> None:
    choice = choose_block_period(PAPER_MODES, 0.001, 0.0, max_block_period_s=0.004)
    durations_s = [each.shaper.duration_s for each in choice.candidates if each.shaper]
    assert durations_s == pytest.approx([0.012, 0.012, 0.015, 0.016])
    assert choice.period_s == 0.002


def test_choice_without_a_design_or_a_candidate() -> None:
    with pytest.raises(DesignError, match=r"no block period from 5 ms to 8 ms .* within 15 ms"):
        choose_block_period(PAPER_MODES, 0.001, 0.005, max_block_period_s=0.008, max_duration_s=0.015)
    choice = choose_block_period(PAPER_MODES, 0.001, 0.005, max_block_period_s=0.008, max_duration_s=0.06)
    refused = choice.candidates[3]
    assert refused.shaper is None
    assert "8 ms grid" in refused.refusal
    with pytest.raises(ArgumentError, match="multiple of the interpolation period of 4 ms"):
        choose_block_period(PAPER_MODES, 0.004, 0.005, max_block_period_s=0.007)
    with pytest.raises(ArgumentError, match="block_time_s"):
        choose_block_period(PAPER_MODES, 0.001, -0.001)
