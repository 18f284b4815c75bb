"""Minimal multi-mode shapers: the figures of paper 002, SciPy's own searches, and vibration simulated step by step."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from minimal_figures import random_sets, solve
from scipy.optimize import fsolve

from shapegcode._core import (
    ArgumentError,
    DesignError,
    Mode,
    convolved_zv,
    minimal_branches,
    minimal_shapers,
    minimal_two_mode,
)
from shapegcode.io.units import FloatArray
from shapegcode.shaping import DesignOptions, ModeBand, design
from shaper_residual import simulated

THREE = (Mode(20.0, 0.02), Mode(71.0, 0.05), Mode(160.0, 0.01))
THREE_UNDAMPED = (Mode(1.0, 0.0), Mode(2.3, 0.0), Mode(5.2, 0.0))


def conditions(modes: Sequence[Mode], times: FloatArray) -> FloatArray:
    """The rows of paper 002, eq. 10, real and imaginary parts scaled as the residual is; last row: the sum."""
    s = np.array([mode.pole for mode in modes])
    terms = np.exp(np.outer(s.real, times.max() - times)) * np.exp(-1j * np.outer(s.imag, times))
    return np.vstack([terms.real, terms.imag, np.ones(len(times))])


def scipy_solutions(modes: Sequence[Mode], longest_s: float, starts: int, seed: int) -> list[FloatArray]:
    """Times of the shapers that Powell's hybrid method finds from random starts, amplitudes up to a sum of 9.9."""
    rng = np.random.default_rng(seed)
    n = len(modes)
    fastest = max(mode.frequency_hz for mode in modes)
    target = np.eye(2 * n + 1)[-1]
    found: list[FloatArray] = []

    def error(x: FloatArray) -> FloatArray:
        times = np.concatenate([[0.0], x[:n] / fastest])
        return np.asarray(conditions(modes, times) @ x[n:] - target)

    for _ in range(starts):
        times = np.sort(rng.uniform(0.0, longest_s, n))
        rows = conditions(modes, np.concatenate([[0.0], times]))
        x, _, flag, _ = fsolve(
            error, np.concatenate([times * fastest, np.linalg.lstsq(rows, target, rcond=None)[0]]), full_output=True
        )
        times = x[:n] / fastest
        distinct = np.all(np.diff(np.concatenate([[0.0], np.sort(times)])) * fastest > 1e-3)
        if flag != 1 or np.abs(error(x)).max() > 1e-9 or times.min() <= 0.0 or not distinct:
            continue
        if times.max() < longest_s and np.abs(x[n:]).sum() < 9.9:
            found.append(np.sort(times))
    return found


@pytest.mark.parametrize(("modes", "longest_s"), [(THREE, 0.036), (THREE_UNDAMPED, 0.85)])
def test_scipy_finds_no_three_mode_shaper_that_is_not_listed(modes: Sequence[Mode], longest_s: float) -> None:
    result = minimal_shapers(modes, longest_s)
    assert result.complete
    listed = np.array([shaper.times_s[1:] for shaper in result.shapers])
    found = scipy_solutions(modes, longest_s, 250, seed=1)
    assert len(found) >= 20
    for times in found:
        assert np.abs(listed - times).max(axis=1).min() < 1e-6 * longest_s
    seen = {int(np.abs(listed - times).max(axis=1).argmin()) for times in found}
    assert len(seen) >= len(listed) / 2


def test_the_spec_shaper_of_46_and_131_hz_from_the_registry() -> None:
    bands = [ModeBand(Mode(46.0, 0.02)), ModeBand(Mode(131.0, 0.02))]
    best = design("minimal", bands)[0]
    assert best.shaper.times_s == pytest.approx([0.0, 6.514e-3, 11.326e-3], abs=5e-7)
    assert best.shaper.amplitudes == pytest.approx([0.49156, 0.06297, 0.44547], abs=5e-6)
    assert best.residual < 1e-13
    assert best.period_s is None


@pytest.mark.parametrize(("zeta", "minimal", "convolved"), [(0.03, 0.111, 0.068), (0.0, 0.127, 0.0775)])
def test_the_spec_sensitivity_at_ratio_2(zeta: float, minimal: float, convolved: float) -> None:
    bands = [ModeBand(Mode(1.0, zeta), 0.05), ModeBand(Mode(2.0, zeta), 0.05)]
    best = design("minimal", bands, DesignOptions(max_duration_s=2.0))[0]
    assert best.worst_residual == pytest.approx(minimal, abs=6e-4)
    both = convolved_zv([band.mode for band in bands])
    worst = max(both.residual_ratio(band.shifted(share)) for band in bands for share in (-1.0, 1.0))
    assert worst == pytest.approx(convolved, abs=6e-4)


@pytest.mark.parametrize(
    "modes",
    [THREE, THREE_UNDAMPED, (*THREE, Mode(46.0, 0.03)), (*THREE, Mode(46.0, 0.03), Mode(110.0, 0.1))],
    ids=["three", "undamped", "four", "five"],
)
def test_every_listed_shaper_solves_the_paper_s_equations_and_leaves_simulated_modes_at_rest(
    modes: Sequence[Mode],
) -> None:
    result = minimal_shapers(modes, convolved_zv(modes).duration_s, max_boxes=0)
    assert result.shapers
    durations = [shaper.duration_s for shaper in result.shapers]
    assert durations == sorted(durations)
    for shaper in result.shapers:
        assert len(shaper.times_s) == len(modes) + 1
        assert shaper.abs_sum <= 10.0
        error = conditions(modes, shaper.times_s) @ shaper.amplitudes - np.eye(2 * len(modes) + 1)[-1]
        assert np.abs(error).max() < 1e-12
        assert max(shaper.residual_ratio(mode) for mode in modes) < 1e-12
    for shaper in result.shapers[:4]:
        assert max(simulated(shaper, mode) for mode in modes) < 1e-11


def test_random_sets_have_a_shaper_and_none_is_missed_below_a_proven_duration() -> None:
    """A small run of minimal_figures.py, whose figures docs/concepts/minimal_shapers.md states for 500 sets."""
    results = [solve(modes, max_boxes=50_000) for modes in random_sets(12, seed=2)]
    assert all(each.found or each.complete for each in results)
    assert max(each.residual for each in results if each.found) <= 1e-10
    for each in results:
        if len(each.modes) == 2 and all(mode.damping_ratio == 0.0 for mode in each.modes):
            assert each.shortest_s <= 2.0 / sum(mode.frequency_hz for mode in each.modes) * (1.0 + 1e-9)


def test_two_undamped_modes_never_take_longer_than_the_closed_form() -> None:
    """t = k/(f1+f2): the uniform family with k = 1 exists but where its sum is zero, and lasts 2/(f1+f2)."""
    for ratio in np.random.default_rng(3).uniform(1.1, 8.0, 40):
        shapers = minimal_shapers([Mode(1.0, 0.0), Mode(ratio, 0.0)], 1.0, max_abs_sum=100.0).shapers
        closed_form_s = 2.0 / (1.0 + ratio)
        assert shapers[0].duration_s <= closed_form_s * (1.0 + 1e-12)
        assert closed_form_s <= 0.5 + 0.5 / ratio


def test_branches_hold_the_complete_list_and_run_on_smoothly() -> None:
    ratios = np.arange(1.5, 2.5, 0.01)
    first = Mode(1.0, 0.02)
    branches = minimal_branches(first, 0.02, list(ratios), 1.2)
    assert branches.times_s.shape == branches.amplitudes.shape == (len(branches.times_s), len(ratios), 3)
    assert np.array_equal(branches.ratios, ratios)
    for at in (0, 37, 99):
        listed = {
            tuple(shaper.times_s)
            for shaper in minimal_two_mode(first, Mode(float(ratios[at]), 0.02), 1.2)
            if len(shaper.times_s) == 3
        }
        here = branches.times_s[:, at, :]
        assert {tuple(times) for times in here[~np.isnan(here[:, 0])]} == listed
    bends = np.abs(np.diff(branches.times_s, n=2, axis=1))
    assert np.nanmax(bends) < 0.05  # s; a wrong joint would jump by a tenth of a period
    gone = np.isnan(branches.times_s)
    assert np.array_equal(gone, np.isnan(branches.amplitudes))
    assert np.nanmax(np.abs(np.nansum(branches.amplitudes, axis=2)[~gone[..., 0]] - 1.0)) < 1e-12
    with pytest.raises(ValueError, match="read-only"):
        branches.times_s[0, 0, 0] = 1.0


def test_a_branch_goes_on_behind_the_ratio_at_which_its_sum_is_zero() -> None:
    """t = 3/(f1+f2) with two undamped modes: the sum 2 - 2 cos(2 pi f1 t) is zero at f2 = 2 f1."""
    ratios = np.linspace(1.6, 2.4, 81)
    branches = minimal_branches(Mode(1.0, 0.0), 0.0, [float(each) for each in ratios], 2.5)
    spacing = 3.0 / (1.0 + ratios)
    follows = [
        int(np.sum(np.abs(times[:, 1] - spacing) + np.abs(times[:, 2] - 2.0 * spacing) < 1e-9))
        for times in branches.times_s
    ]
    best = branches.times_s[int(np.argmax(follows))]
    present = ~np.isnan(best[:, 0])
    assert present[0]
    assert present[-1]
    assert not np.all(present)
    assert not np.any(present[np.abs(ratios - 2.0) < 0.05])


def test_what_is_refused_names_value_and_limit() -> None:
    with pytest.raises(ArgumentError, match=r"1 to 6 modes: 7 given"):
        minimal_shapers([Mode(float(f), 0.0) for f in range(1, 8)], 1.0)
    with pytest.raises(ArgumentError, match=r"are the same.*limit 1e-06"):
        minimal_shapers([Mode(1.0, 0.0), Mode(2.0, 0.0), Mode(2.0 + 1e-7, 0.0)], 1.0)
    with pytest.raises(ArgumentError, match=r"100 periods of the fastest mode \(25 s\): it is 26 s"):
        minimal_shapers([Mode(1.0, 0.0), Mode(2.0, 0.0), Mode(4.0, 0.0)], 26.0)
    with pytest.raises(ArgumentError, match=r"it is nan"):
        minimal_shapers([Mode(1.0, 0.0)], math.nan)
    with pytest.raises(ArgumentError, match=r"ascend: 1.5 follows 2"):
        minimal_branches(Mode(1.0, 0.0), 0.0, [2.0, 1.5], 1.0)


def test_the_registry_says_how_far_it_is_proven_that_there_is_none() -> None:
    bands = [ModeBand(mode) for mode in THREE]
    with pytest.raises(DesignError, match=r"no minimal shaper of 20 Hz, 71 Hz, 160 Hz takes up to 15 ms.*proven"):
        design("minimal", bands, DesignOptions(max_duration_s=0.015))
    with pytest.raises(ArgumentError, match="no design on a grid"):
        design("minimal", bands, DesignOptions(period_s=0.001))
