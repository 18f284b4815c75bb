"""Robust and least-worst grid shapers, held against the residual formula, other linear programs and EI shapers."""

import math
import re
from collections.abc import Callable, Sequence

import highspy
import numpy as np
import pytest
from scipy.optimize import linprog

from extra_insensitive import ei_convolved, fine_enough_period_s, random_pairs, worst_over_bands
from shapegcode._core import ArgumentError, DesignError, Mode, Shaper, convolve, grid_polynomial, zv
from shapegcode.io.units import FloatArray
from shapegcode.shaping import (
    DesignOptions,
    ModeBand,
    choose_block_period,
    design,
    least_worst,
    minimax_robust,
    proven_worst,
    robust_candidate,
    shortest_non_negative,
)
from shapegcode.shaping.grid_designs import lower_hull

PAPER_BANDS = (ModeBand(Mode(46.0, 0.02), 0.1), ModeBand(Mode(131.0, 0.02), 0.1))


def worst(shaper: Shaper, bands: Sequence[ModeBand]) -> float:
    return worst_over_bands(shaper.times_s, shaper.amplitudes, bands, 4001)


def min_possible(bands: Sequence[ModeBand], period_s: float, last: int) -> float:
    """Bound that no non-negative design of this many periods beats: a dual solution, checked by hand.

    Any weights (sum 1) on frequencies and directions turn the largest |R| into a weighted sum of Re(e^{-ja} R), which
    is linear in the taps; its least value over the taps (sum 1, none negative) is the least of its coefficients.
    """
    t = np.arange(last + 1) * period_s
    rows = []
    for band in bands:
        zeta = band.mode.damping_ratio
        for f in band.mode.frequency_hz * (1.0 + band.uncertainty * np.linspace(-1.0, 1.0, 61)):
            omega = 2.0 * np.pi * f
            term = np.exp(-zeta * omega * (t[-1] - t)) * np.exp(1j * omega * math.sqrt(1.0 - zeta**2) * (t - t[-1] / 2))
            rows += [(term * np.exp(-1j * angle)).real for angle in np.arange(64) * (2.0 * np.pi / 64)]
    matrix = np.array(rows)
    result = linprog(
        np.eye(last + 2)[-1],
        A_ub=np.hstack([matrix, -np.ones((len(matrix), 1))]),
        b_ub=np.zeros(len(matrix)),
        A_eq=np.append(np.ones(last + 1), 0.0)[None, :],
        b_eq=[1.0],
        method="highs-ds",
    )
    weights = np.maximum(-np.asarray(result.ineqlin.marginals), 0.0)
    return float((weights / weights.sum() @ matrix).min())


@pytest.mark.parametrize(
    ("bands", "period_s", "last"),
    [
        (PAPER_BANDS, 0.002, 10),
        (PAPER_BANDS, 0.005, 6),
        ((ModeBand(Mode(20.0, 0.0), 0.2),), 0.004, 14),
        ((ModeBand(Mode(12.0, 0.08), 0.15), ModeBand(Mode(33.0, 0.01), 0.05)), 0.005, 14),
    ],
)
def test_least_worst_reaches_what_a_dual_solution_allows(bands: Sequence[ModeBand], period_s: float, last: int) -> None:
    found = least_worst(bands, period_s, last * period_s)
    bound = min_possible(bands, period_s, last)
    assert bound > 1e-3
    assert found.shaper.duration_s == pytest.approx(last * period_s)
    assert found.shaper.amplitudes.min() > 0.0
    # 64 directions and 61 frequencies miss at most 0.2 % of the optimum, the design itself 0.1 %
    assert bound <= found.worst_residual * (1.0 + 1e-6) <= bound * 1.003
    assert found.min_possible <= bound * 1.003
    assert worst(found.shaper, bands) == pytest.approx(found.worst_residual, rel=2e-4)
    assert found.worst_residual <= (1.0 + 1.5e-3) * found.min_possible


def test_undamped_optimum_is_that_of_a_real_program() -> None:
    """Without damping the best design is symmetric, so R is real seen from the middle, and no cone is needed."""
    band, period_s, last = ModeBand(Mode(30.0, 0.0), 0.25), 0.003, 13
    t = (np.arange(last + 1) - last / 2) * period_s
    cosines = np.cos(np.outer(2.0 * np.pi * 30.0 * np.linspace(0.75, 1.25, 2001), t))
    result = linprog(
        np.eye(last + 2)[-1],
        A_ub=np.hstack([np.vstack([cosines, -cosines]), -np.ones((4002, 1))]),
        b_ub=np.zeros(4002),
        A_eq=np.append(np.ones(last + 1), 0.0)[None, :],
        b_eq=[1.0],
    )
    assert least_worst([band], period_s, last * period_s).worst_residual == pytest.approx(result.fun, rel=1.2e-3)


@pytest.mark.parametrize("period_s", [0.002, 0.005])
def test_minimax_is_the_shortest_below_the_limit(period_s: float) -> None:
    found = minimax_robust(PAPER_BANDS, period_s, vibration_limit=0.03)
    last = round(found.shaper.duration_s / period_s)
    assert worst(found.shaper, PAPER_BANDS) <= found.worst_residual <= 0.03
    assert min_possible(PAPER_BANDS, period_s, last - 1) > 0.03
    assert min_possible(PAPER_BANDS, period_s, last) <= 0.03
    assert np.abs(found.shaper.times_s / period_s - np.round(found.shaper.times_s / period_s)).max() < 1e-9


def test_least_contour_cost_among_the_shortest() -> None:
    """No design that some random linear cost selects below the limit costs less."""
    band, period_s, limit = ModeBand(Mode(20.0, 0.01), 0.1), 0.004, 0.05
    found = minimax_robust([band], period_s, vibration_limit=limit)
    last = round(found.shaper.duration_s / period_s)
    t = np.arange(last + 1) * period_s
    omega = 2.0 * np.pi * 20.0 * np.linspace(0.9, 1.1, 41)[:, None]
    terms = np.exp(-0.01 * omega * (t[-1] - t) + 1j * math.sqrt(1.0 - 0.01**2) * omega * t)
    planes = np.vstack([(terms * np.exp(-2j * np.pi * k / 24)).real for k in range(24)])
    rng = np.random.default_rng(4)
    costs = [(t - centre) ** 2 for centre in np.linspace(0.0, t[-1], 25)] + list(rng.normal(size=(25, last + 1)))
    inside = limit * math.cos(np.pi / 24)  # a polygon within the circle
    for cost in costs:
        result = linprog(
            cost / np.abs(cost).max(), A_ub=planes, b_ub=np.full(len(planes), inside),
            A_eq=np.ones((1, last + 1)), b_eq=[1.0],
        )  # fmt: skip
        assert result.status == 0
        taps = np.asarray(result.x)
        assert taps @ t**2 - (taps @ t) ** 2 >= 0.995 * found.shaper.variance_s2


def test_lower_hull_finds_the_least_second_central_moment() -> None:
    """Against every vertex of a small random polytope, listed by brute force."""
    rng = np.random.default_rng(11)
    for _ in range(5):
        points = rng.dirichlet(np.ones(6), size=40)
        mean, second = points @ np.arange(6) / 5, points @ (np.arange(6) / 5) ** 2

        def cheapest(cost: FloatArray, points: FloatArray = points) -> FloatArray:
            return np.asarray(points[int(np.argmin(points @ cost))], dtype=np.float64)

        best = lower_hull(cheapest, 5)[0] @ np.vstack([np.arange(6) / 5, (np.arange(6) / 5) ** 2]).T
        assert best[1] - best[0] ** 2 == pytest.approx((second - mean**2).min(), rel=1e-12)
    assert lower_hull(lambda _cost: None, 5) == []


def test_options_zeros_at_nominal_and_negative_taps() -> None:
    plain = least_worst(PAPER_BANDS, 0.002, 0.024)
    exact = least_worst(PAPER_BANDS, 0.002, 0.024, zeros_at_nominal=True)
    signed = least_worst(PAPER_BANDS, 0.002, 0.024, non_negative=False, max_abs_sum=2.0)
    assert max(worst(exact.shaper, [ModeBand(band.mode)]) for band in PAPER_BANDS) < 1e-13
    assert signed.worst_residual < plain.worst_residual < exact.worst_residual
    assert signed.shaper.has_negative
    assert signed.shaper.abs_sum <= 2.0 + 1e-8
    assert worst(signed.shaper, PAPER_BANDS) == pytest.approx(signed.worst_residual, rel=2e-4)
    short = minimax_robust(PAPER_BANDS, 0.002, non_negative=False, max_abs_sum=3.0)
    assert short.shaper.abs_sum <= 3.0 + 1e-8
    assert short.worst_residual <= 0.05
    assert short.shaper.duration_s <= minimax_robust(PAPER_BANDS, 0.002).shaper.duration_s
    robust_and_exact = minimax_robust(PAPER_BANDS, 0.002, zeros_at_nominal=True).shaper
    assert worst(robust_and_exact, PAPER_BANDS) <= 0.05
    assert worst(robust_and_exact, [ModeBand(band.mode) for band in PAPER_BANDS]) < 1e-13


def test_a_mode_without_a_band_is_cancelled_exactly() -> None:
    bands = [PAPER_BANDS[0], ModeBand(Mode(131.0, 0.02))]
    shaper = minimax_robust(bands, 0.005).shaper
    assert worst(shaper, bands[1:]) < 1e-13
    assert worst(shaper, bands[:1]) <= 0.05
    plain = [ModeBand(band.mode) for band in PAPER_BANDS]
    found = minimax_robust(plain, 0.005)
    assert found.shaper == shortest_non_negative([band.mode for band in plain], 0.005)
    assert found.worst_residual < 1e-13
    polynomial = grid_polynomial([band.mode for band in plain], 0.002)  # sum|a| 9.7 of the 10 that are allowed
    signed = minimax_robust(plain, 0.002, non_negative=False).shaper
    np.testing.assert_allclose(signed.amplitudes, polynomial.amplitudes, rtol=1e-9)


def test_equal_and_aliased_modes_count_once() -> None:
    one = minimax_robust(PAPER_BANDS[:1], 0.004)
    assert minimax_robust([PAPER_BANDS[0]] * 3, 0.004).shaper.duration_s == one.shaper.duration_s
    undamped = [ModeBand(Mode(46.0, 0.0)), ModeBand(Mode(154.0, 0.0)), ModeBand(Mode(20.0, 0.0), 0.1)]
    found = minimax_robust(undamped, 0.005)  # 46 and 154 Hz are one z on this grid
    assert found.shaper.duration_s == minimax_robust(undamped[1:], 0.005).shaper.duration_s
    assert worst(found.shaper, undamped[:2]) < 1e-12


def test_waiting_is_no_shaper() -> None:
    """A strongly damped mode dies out by itself: the design does not spend the duration on that."""
    band = ModeBand(Mode(131.788, 0.478324), 0.1)
    found = least_worst([band], 0.001, 0.121)
    assert found.worst_residual < 2e-6
    assert found.shaper.duration_s < 0.04
    assert worst(found.shaper, [band]) <= found.worst_residual
    near_one = ModeBand(Mode(118.765, 0.0815792), 0.05)
    slow = minimax_robust([near_one], 0.008)
    assert worst(slow.shaper, [near_one]) <= slow.worst_residual <= 0.05


def test_sweep_bound_holds_against_a_dense_sweep() -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        bands = [ModeBand(Mode(float(rng.uniform(5, 200)), float(rng.uniform(0, 0.2))), float(rng.uniform(0, 0.4)))]
        shaper = convolve(zv(Mode(float(rng.uniform(5, 60)), 0.02)), zv(Mode(float(rng.uniform(5, 200)), 0.0)))
        dense = worst_over_bands(shaper.times_s, shaper.amplitudes, bands, 20001)
        assert dense * (1.0 - 1e-12) <= proven_worst(shaper, bands) <= dense * (1.0 + 2e-4) + 2e-7


def test_refusal_shows_the_nearest() -> None:
    with pytest.raises(DesignError) as failed:
        minimax_robust(PAPER_BANDS, 0.005, vibration_limit=0.01, max_duration_s=0.02)
    text = str(failed.value)
    assert text.startswith("no design within 20 ms on a 5 ms grid keeps below 1 % for 46:0.02±10% Hz, 131:0.02±10% Hz")
    match = re.search(
        r"the longest allowed shaper reaches ([\d.]+) %; (\d+) ms suffices; a period of ([\d.]+) ms reaches", text
    )
    assert float(match[1]) == pytest.approx(100.0 * min_possible(PAPER_BANDS, 0.005, 4), rel=0.005)
    assert min_possible(PAPER_BANDS, 0.005, round(int(match[2]) / 5)) <= 0.01
    assert min_possible(PAPER_BANDS, 0.005, round(int(match[2]) / 5) - 2) > 0.01
    with pytest.raises(DesignError, match=r"40 ms do not; .* reaches"):
        minimax_robust(PAPER_BANDS, 0.005, vibration_limit=0.0001, max_duration_s=0.01)


def test_refusal_where_all_taps_add_up() -> None:
    with pytest.raises(DesignError) as failed:
        minimax_robust(PAPER_BANDS, 0.008)
    said = "131:0.02±10% Hz completes one cycle per period of 8 ms at 125.03 Hz, where all impulses add up"
    assert said in str(failed.value)
    assert re.search(r"on a period of \d ms a design of \d+ ms would suffice", str(failed.value))
    with pytest.raises(DesignError, match=r"400:0 Hz completes 2 cycles per period of 5 ms at 400 Hz"):
        least_worst([PAPER_BANDS[0], ModeBand(Mode(400.0, 0.0))], 0.005, 0.1)
    with pytest.raises(DesignError, match=r"sum\|a\| up to 1.5 .* do not cancel 46 Hz \(zeta 0.02\), 131 Hz"):
        least_worst(PAPER_BANDS, 0.005, 0.005, non_negative=False, max_abs_sum=1.5, zeros_at_nominal=True)
    with pytest.raises(DesignError, match=r"non-negative impulses up to 5 ms on a 5 ms grid do not cancel"):
        minimax_robust([PAPER_BANDS[0], ModeBand(Mode(131.0, 0.02))], 0.005, max_duration_s=0.005)
    with pytest.raises(DesignError, match="no other period from half to twice as long has a design"):
        minimax_robust([ModeBand(Mode(1000.0, 0.0), 0.2)], 0.005)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: least_worst([], 0.005, 0.02), "0 given"),
        (lambda: least_worst(PAPER_BANDS, 0.0, 0.02), r"period_s is 0\.0 s"),
        (lambda: least_worst(PAPER_BANDS, 0.005, math.nan), "duration_s is nan s"),
        (lambda: least_worst([ModeBand(Mode(46.0, 0.02))], 0.005, 0.02), r"no mode states a band \(46:0.02 Hz\)"),
        (lambda: least_worst(PAPER_BANDS, 0.005, 0.02, non_negative=False, max_abs_sum=0.5), "max_abs_sum is 0.5"),
        (lambda: minimax_robust(PAPER_BANDS, 0.005, vibration_limit=1.0), r"vibration_limit is 1\.0"),
        (lambda: minimax_robust(PAPER_BANDS, 0.005, max_duration_s=-1.0), r"max_duration_s is -1\.0 s"),
        (lambda: choose_block_period(PAPER_BANDS, 0.001, 0.005, vibration_limit=0.0), r"vibration_limit is 0\.0"),
        (lambda: choose_block_period([], 0.001, 0.005), "0 given"),
        (lambda: ModeBand(Mode(46.0, 0.02), -0.1), "uncertainty of the mode at 46 Hz is -0.1"),
    ],
)
def test_values_out_of_range(call: Callable[[], object], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        call()


def test_a_solver_that_gives_up_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = least_worst(PAPER_BANDS, 0.005, 0.03)
    calls = 0

    status = highspy.Highs.getModelStatus

    def moody(solver: highspy.Highs) -> highspy.HighsModelStatus:
        nonlocal calls
        calls += 1
        return highspy.HighsModelStatus.kUnknown if calls % 2 else status(solver)

    monkeypatch.setattr(highspy.Highs, "getModelStatus", moody)
    assert least_worst(PAPER_BANDS, 0.005, 0.03).worst_residual == pytest.approx(expected.worst_residual, rel=1e-3)
    monkeypatch.setattr(highspy.Highs, "getModelStatus", lambda _solver: highspy.HighsModelStatus.kUnknown)
    with pytest.raises(DesignError, match="linear program of a shaper with 8 unknowns failed: Unknown"):
        least_worst(PAPER_BANDS, 0.005, 0.03)


def test_robust_grid_compares_the_periods() -> None:
    choice = choose_block_period(PAPER_BANDS, 0.001, 0.002, max_block_period_s=0.008)
    assert [round(each.period_s * 1e3) for each in choice.candidates] == [2, 3, 4, 5, 6, 7, 8]
    durations_s = [each.shaper.duration_s for each in choice.candidates if each.shaper is not None]
    assert durations_s[:5] == pytest.approx([0.022, 0.024, 0.024, 0.030, 0.042])  # as docs/concepts/shapers.md says
    for each in choice.candidates[:4]:
        assert each.shaper.duration_s == pytest.approx(minimax_robust(PAPER_BANDS, each.period_s).shaper.duration_s)
    assert choice.candidates[-1].shaper is None
    assert "z close to +1" in choice.candidates[-1].refusal
    assert choice.shaper.duration_s == pytest.approx(min(durations_s))
    assert worst(choice.shaper, PAPER_BANDS) <= choice.worst_residual <= 0.05
    assert choice.note == ""
    alone = robust_candidate(PAPER_BANDS, choice.period_s)
    assert (alone.shaper, alone.worst_residual) == (choice.shaper, choice.worst_residual)
    assert alone.shaper.variance_s2 == choice.shaper.variance_s2


def test_robust_grid_without_bands_is_the_plain_choice() -> None:
    modes = [band.mode for band in PAPER_BANDS]
    plain = choose_block_period(modes, 0.001, 0.005, max_block_period_s=0.008)
    assert choose_block_period([ModeBand(mode) for mode in modes], 0.001, 0.005, max_block_period_s=0.008) == plain
    assert robust_candidate([ModeBand(mode) for mode in modes], plain.period_s).shaper == plain.shaper


def test_robust_grid_falls_back_to_the_least_worst_and_says_so() -> None:
    choice = choose_block_period(PAPER_BANDS, 0.001, 0.005, max_duration_s=0.02)
    least = least_worst(PAPER_BANDS, choice.period_s, 0.02)
    assert choice.worst_residual == least.worst_residual > 0.05
    assert choice.note == (
        "no shaper within 20 ms keeps 46:0.02±10% Hz, 131:0.02±10% Hz below 5 % of the vibration on a 5 ms grid: "
        "that with the smallest worst residual, 9.1 %, is used"
    )
    assert robust_candidate(PAPER_BANDS, choice.period_s, 0.02).note == choice.note
    assert all(each.worst_residual is None or each.worst_residual > 0.05 for each in choice.candidates)
    hopeless = [ModeBand(Mode(1000.0, 0.03), 0.2)]
    with pytest.raises(DesignError, match=r"no block period from 2 ms to 20 ms .*; on the first: .*z close to \+1"):
        choose_block_period(hopeless, 0.001, 0.002)
    with pytest.raises(DesignError, match=r"z close to \+1"):
        robust_candidate(hopeless, 0.002)


def test_family_of_the_registry() -> None:
    options = DesignOptions(period_s=0.005, max_duration_s=0.03)
    (robust,) = design("robust", PAPER_BANDS, options)
    assert robust.worst_residual <= 0.05
    assert robust.duration_s == pytest.approx(0.03)
    with pytest.raises(DesignError, match=r"no design within 20 ms on a 5 ms grid keeps below 5 % for [^;]*$"):
        design("robust", PAPER_BANDS, DesignOptions(period_s=0.005, max_duration_s=0.02))
    with pytest.raises(DesignError, match=r"no mode has a band to design for .*up to 0\.2 % count as exact"):
        design("robust", [ModeBand(Mode(46.0, 0.02))], options)


def test_better_than_convolved_extra_insensitive_shapers_at_no_greater_duration() -> None:
    """Twelve random pairs; tests/benchmarks/robust_shapers.py measures a hundred."""
    for number, bands in enumerate(random_pairs(12, seed=3)):
        times_s, amplitudes = ei_convolved(bands)
        theirs = worst_over_bands(times_s, amplitudes, bands, 401)
        period_s = fine_enough_period_s(bands)
        ours = least_worst(bands, period_s, float(times_s.max()))
        assert ours.shaper.duration_s <= times_s.max()
        assert worst(ours.shaper, bands) <= theirs
        if number % 4 == 0:
            shortest = minimax_robust(bands, period_s, vibration_limit=theirs)
            assert worst(shortest.shaper, bands) <= theirs
            assert shortest.shaper.duration_s <= ours.shaper.duration_s
