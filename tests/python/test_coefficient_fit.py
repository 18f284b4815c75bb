"""Cutting coefficients from measured forces, against closed forms and simulated records."""

import dataclasses
import math

import numpy as np
import pytest

import cut_reference as reference
from shapegcode._core import ArgumentError
from shapegcode.cutting.tool import COEFFICIENTS
from shapegcode.io.units import FloatArray
from shapegcode.testcut.cut import CuttingLaw, CutTool
from shapegcode.testcut.forces import (
    CoefficientFit,
    Engagement,
    ForceLaw,
    MeanForces,
    fit_coefficients,
    mean_chip_mm,
    straight_engagement,
)

TOOL = CutTool(8.0, 6, 50.0)
AXIAL, SPINDLE = 15.0, 1800.0
TRUE = [reference.PAPER[name] for name in COEFFICIENTS[:4]]


def drawn(
    rng: np.random.Generator,
    depths: FloatArray,
    feeds: tuple[float, ...],
    noise: float,
    law: dict[str, float] = reference.PAPER,
    *,
    up: bool = False,
) -> MeanForces:
    """Mean forces at each depth and feed; noise: share of each force, in each direction by itself."""
    depth = np.tile(depths, len(feeds))
    feed = np.repeat(feeds, len(depths))
    begin, end = reference.climb_arc(depth, 4.0)
    if up:
        begin, end = -end, -begin
    force = reference.mean_force(begin, end, feed / SPINDLE / 6, 6, AXIAL, law)
    force = force * (1.0 + noise * rng.standard_normal(force.shape))
    ones = np.ones(len(depth))
    groups = np.repeat(np.arange(len(feeds)), len(depths))
    return MeanForces(Engagement(begin, end, depth), feed, SPINDLE * ones, force, ones, groups)


def values(fit: CoefficientFit) -> list[float]:
    return [each.value for each in fit.coefficients]


@pytest.mark.parametrize("up", [False, True])
def test_the_law_is_the_closed_form(up: bool) -> None:
    depth = np.linspace(0.2, 3.6, 9)
    law = {**reference.PAPER, "tangential_edge_n_per_mm": 7.0, "radial_edge_n_per_mm": 5.0}
    met = straight_engagement(TOOL, depth, up=up)
    begin, end = reference.climb_arc(depth, 4.0)
    if up:
        begin, end = -end, -begin
    np.testing.assert_allclose(met.from_rad, begin, atol=1e-12)
    np.testing.assert_allclose(met.to_rad, end, atol=1e-12)
    forces = ForceLaw(TOOL, CuttingLaw(**law), SPINDLE, AXIAL).forces(met, np.full(9, 216.0))
    expected = reference.mean_force(begin, end, 0.02, 6, AXIAL, law)
    np.testing.assert_allclose(forces.mean_n, expected, rtol=1e-6, atol=1e-6)
    chip = mean_chip_mm(TOOL, SPINDLE, AXIAL, met, np.full(9, 216.0))
    np.testing.assert_allclose(chip, reference.mean_chip(begin, end, 0.02), rtol=1e-6)


def test_exact_forces_give_the_coefficients() -> None:
    data = drawn(np.random.default_rng(0), np.linspace(0.4, 2.8, 15), (216.0,), 0.0, up=True)
    np.testing.assert_allclose(values(fit_coefficients(data, TOOL, AXIAL)), TRUE, rtol=1e-5)


def test_noise_of_five_percent_leaves_exponents_within_a_hundredth_and_factors_within_three_percent() -> None:
    # One row per revolution of three passes of 60 mm would be 1700 rows; noise: 5 % of the force of each row.
    data = drawn(np.random.default_rng(1), np.linspace(0.4, 2.8, 250), (108.0, 216.0, 432.0), 0.05)
    fit = fit_coefficients(data, TOOL, AXIAL)
    found = values(fit)
    assert abs(found[1] - TRUE[1]) < 0.01
    assert abs(found[3] - TRUE[3]) < 0.01
    assert found[0] == pytest.approx(TRUE[0], rel=0.03)
    assert found[2] == pytest.approx(TRUE[2], rel=0.03)
    assert fit.rms_percent == pytest.approx(5.0, abs=0.4)


def share_of_intervals_with_the_truth(draws: int, seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    inside = np.zeros(4)
    for _ in range(draws):
        fit = fit_coefficients(drawn(rng, np.linspace(0.4, 2.8, 12), (108.0, 432.0), 0.05), TOOL, AXIAL)
        inside += [each.low <= true <= each.high for each, true in zip(fit.coefficients, TRUE, strict=True)]
    return np.asarray(inside / draws)


def test_intervals_hold_the_truth_in_most_draws() -> None:
    inside = share_of_intervals_with_the_truth(30, 2)
    # Three standard deviations of 30 draws at 95 %.
    assert np.all(inside >= 0.83), inside


@pytest.mark.slow
def test_intervals_hold_the_truth_in_95_of_100_draws() -> None:
    inside = share_of_intervals_with_the_truth(120, 3)
    # Two and a half standard deviations of 120 draws at 95 %, on either side.
    assert np.all(inside > 0.90), inside
    assert np.all(inside < 0.9999), inside


def test_edge_forces_are_told_apart_by_the_feed() -> None:
    law = {**reference.PAPER, "tangential_edge_n_per_mm": 8.0, "radial_edge_n_per_mm": 6.0}
    data = drawn(np.random.default_rng(3), np.linspace(0.4, 2.8, 60), (108.0, 216.0, 432.0), 0.01, law)
    fit = fit_coefficients(data, TOOL, AXIAL, edge=True)
    for each, name in zip(fit.coefficients, COEFFICIENTS, strict=True):
        spread = each.high - each.low
        assert each.low - spread < law[name] < each.high + spread
    assert fit.coefficients[4].value == pytest.approx(8.0, rel=0.05)
    plain = fit_coefficients(data, TOOL, AXIAL)
    assert plain.rms_percent > 1.5 * fit.rms_percent


def test_the_local_chip_thickness_is_another_law() -> None:
    depth = np.tile(np.linspace(0.4, 2.8, 12), 2)
    feed = np.repeat([108.0, 432.0], 12)
    begin, end = reference.climb_arc(depth, 4.0)
    force = np.array(
        [
            reference.local_mean_force(-b, -e, f / SPINDLE / 6, 6, AXIAL, reference.PAPER)
            for b, e, f in zip(end, begin, feed, strict=True)
        ]
    )
    ones = np.ones(len(depth))
    data = MeanForces(Engagement(-end, -begin, depth), feed, SPINDLE * ones, force, ones, np.zeros(len(depth), int))
    np.testing.assert_allclose(values(fit_coefficients(data, TOOL, AXIAL, thickness="local")), TRUE, rtol=2e-3)
    assert abs(values(fit_coefficients(data, TOOL, AXIAL))[0] / TRUE[0] - 1.0) > 0.005


def test_a_torque_narrows_the_intervals() -> None:
    data = drawn(np.random.default_rng(8), np.linspace(0.4, 2.8, 40), (108.0, 432.0), 0.05)
    begin, end = data.met.from_rad, data.met.to_rad
    chip = reference.mean_chip(begin, end, data.feed_mm_per_min / SPINDLE / 6)
    # Tangential force k1 t dz of all that is engaged, times the radius.
    torque = 6 * AXIAL / (2.0 * math.pi) * (end - begin) * 221.3 * chip ** (1.0 - 0.153) * 4.0e-3
    with_torque = fit_coefficients(dataclasses.replace(data, torque_nm=torque), TOOL, AXIAL)
    without = fit_coefficients(data, TOOL, AXIAL)
    widths = [fit.coefficients[1].high - fit.coefficients[1].low for fit in (with_torque, without)]
    assert widths[0] < 0.5 * widths[1]
    assert abs(values(with_torque)[1] - TRUE[1]) < 2e-3
    assert with_torque.predicted_n.shape == (80, 2)


def test_outliers_are_found_and_left_out() -> None:
    data = drawn(np.random.default_rng(4), np.linspace(0.4, 2.8, 60), (108.0, 432.0), 0.01)
    data.force_n[40:52] *= 1.6
    fit = fit_coefficients(data, TOOL, AXIAL)
    assert set(range(40, 52)) <= set(np.flatnonzero(fit.outlier))
    assert fit.outlier.sum() <= 15
    assert abs(values(fit)[1] - TRUE[1]) < 0.01


@pytest.mark.parametrize(
    ("depths", "feeds", "edge", "said"),
    [
        (np.full(12, 0.8), (216.0,), False, "the exponents cannot be determined: the mean chip is 6.22 to 6.22 um"),
        (np.linspace(0.4, 2.8, 3), (216.0,), False, "3 mean forces are too few for 4 coefficients"),
        (np.linspace(0.4, 2.8, 20), (216.0,), True, "edge forces cannot be distinguished from the exponents"),
    ],
)
def test_what_the_forces_do_not_tell_is_refused(
    depths: FloatArray, feeds: tuple[float, ...], edge: bool, said: str
) -> None:
    data = drawn(np.random.default_rng(5), depths, feeds, 0.01)
    with pytest.raises(ArgumentError, match=said):
        fit_coefficients(data, TOOL, AXIAL, edge=edge)


@pytest.mark.parametrize("turn", [lambda force: -force, lambda force: force * [1.0, -1.0]])
def test_forces_of_the_wrong_sign_are_refused(turn: object) -> None:
    data = drawn(np.random.default_rng(6), np.linspace(0.4, 2.8, 20), (216.0,), 0.01)
    assert callable(turn)
    data.force_n[:] = turn(data.force_n)
    with pytest.raises(ArgumentError, match="check --forces-on"):
        fit_coefficients(data, TOOL, AXIAL)


def test_neighbours_that_share_their_error_widen_the_intervals() -> None:
    rng = np.random.default_rng(7)
    plain = drawn(rng, np.linspace(0.4, 2.8, 100), (108.0, 432.0), 0.0)
    wave = np.convolve(rng.standard_normal(len(plain.force_n) + 9), np.ones(10) / math.sqrt(10.0), "valid")
    white = rng.standard_normal(len(plain.force_n))
    widths = []
    for error in (white, wave):
        data = drawn(rng, np.linspace(0.4, 2.8, 100), (108.0, 432.0), 0.0)
        data.force_n[:] = plain.force_n * (1.0 + 0.02 * error[:, None])
        fit = fit_coefficients(data, TOOL, AXIAL)
        widths.append(fit.coefficients[1].high - fit.coefficients[1].low)
    assert widths[1] > 2.0 * widths[0]
