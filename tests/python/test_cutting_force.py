"""Cutting force, deflection and form of the wall against a tool cut into discs (milling_brute_force)."""

import threading
from math import asin, pi, radians, tan

import numpy as np
import pytest

from milling_brute_force import Cutter, Turn, turn
from shapegcode import _core
from shapegcode._core import (
    ChipThickness,
    CornerCut,
    CuttingCoefficients,
    EndMill,
    FeedLimit,
    FeedLimits,
    MillingForce,
    SpindleSense,
    ToolBeam,
    WallSide,
)
from shapegcode.io.units import FloatArray

SPEED = 1800.0
TIGHT = 1e-3

CASES = {
    "paper": Cutter(8, 6, radians(50), 221.3, -0.153, 0.41, -0.0775, local=False),
    "paper, local chip": Cutter(8, 6, radians(50), 221.3, -0.153, 0.41, -0.0775),
    "edges": Cutter(12, 3, radians(30), 1500.0, -0.2, 0.4, -0.05, 14.0, 20.0),
    "runout": Cutter(10, 4, radians(40), 900.0, -0.25, 0.45, 0.0, runout_mm=(0.006, -0.002, -0.008, 0.004)),
    "runout and edges": Cutter(10, 3, radians(25), 900.0, -0.1, 0.4, -0.1, 8.0, 9.0, False, (0.02, -0.015, -0.005)),
    "no helix": Cutter(10, 2, 0.0, 1200.0, -0.15, 0.35),
}
ARCS = {
    "down milling": np.array([[-pi / 2, asin(2.103 / 4 - 1), 0.0, 15.0]]),
    "slot": np.array([[-pi / 2, pi / 2, 0.0, 4.0]]),
    "several": np.array([[-pi / 2, -0.9, 0.0, 3.0], [-pi / 2, 0.2, 3.0, 7.0], [0.6, 1.3, 3.0, 7.0]]),
}


def model(cutter: Cutter, sense: SpindleSense = SpindleSense.clockwise) -> MillingForce:
    coefficients = CuttingCoefficients(
        cutter.specific,
        cutter.specific_exponent,
        cutter.ratio,
        cutter.ratio_exponent,
        cutter.tangential_edge,
        cutter.radial_edge,
        ChipThickness.local if cutter.local else ChipThickness.mean,
    )
    tool = EndMill(cutter.diameter_mm, cutter.flutes, cutter.helix_rad, list(cutter.runout_mm))
    return MillingForce(tool, coefficients, SPEED, sense)


@pytest.mark.parametrize("engagement", ARCS)
@pytest.mark.parametrize("case", CASES)
def test_forces_of_a_tool_cut_into_discs(case: str, engagement: str) -> None:
    cutter, arcs, per_tooth = CASES[case], ARCS[engagement], 0.03
    feed = per_tooth * SPEED * cutter.flutes
    # Straight flutes jump in and out of an arc; with runout and edge forces they do so within a disc, too.
    straight = cutter.helix_rad == 0.0
    angles = 2880 if straight else 180
    expected = turn(cutter, arcs, per_tooth, angles=angles, discs=1 if straight else 240 if cutter.runout_mm else 60)
    force = model(cutter)
    curve = force.curve(arcs, feed, angles)
    # At an angle at which a straight flute stands on an arc's end it may count or not.
    clear = np.ones(angles, dtype=bool)
    if straight:
        tips = 2.0 * pi * np.arange(cutter.flutes)[:, None] / cutter.flutes - curve.turned_rad
        for end in arcs[:, :2].ravel():
            clear &= (np.abs(np.exp(1j * tips) - np.exp(1j * end)) > 1e-9).all(axis=0)
    largest = np.hypot(*expected.force.T).max()
    assert np.abs(curve.force_n - expected.force)[clear].max() < TIGHT * largest
    for own, other in zip(curve.flute_n, expected.flutes, strict=True):
        assert np.abs(own - other)[clear].max() < TIGHT * largest
    assert np.abs(curve.torque_nm - 1e-3 * expected.torque)[clear].max() < 1e-3 * TIGHT * largest * cutter.diameter_mm

    figures = force.figures(arcs, feed)
    np.testing.assert_allclose(figures.mean_n, expected.force.mean(axis=0), atol=TIGHT * largest)
    assert figures.mean_torque_nm == pytest.approx(1e-3 * expected.torque.mean(), rel=TIGHT)
    assert figures.mean_resultant_n == pytest.approx(np.hypot(*expected.force.T).mean(), rel=TIGHT)


@pytest.mark.parametrize("case", ["paper", "edges", "runout and edges"])
def test_energy_balance(case: str) -> None:
    """Mean torque times angular speed is the integral of what every disc's force does on its tooth's way."""
    cutter, arcs, per_tooth = CASES[case], ARCS["several"], 0.05
    expected = turn(cutter, arcs, per_tooth, angles=360)
    figures = model(cutter).figures(arcs, per_tooth * SPEED * cutter.flutes)
    cutting_speed_m_per_s = pi * cutter.diameter_mm * 1e-3 * SPEED / 60.0
    assert figures.mean_power_w == pytest.approx(expected.power.mean() * cutting_speed_m_per_s, rel=1e-3)
    assert figures.mean_power_w == pytest.approx(figures.mean_torque_nm * SPEED * 2.0 * pi / 60.0, rel=1e-12)


def deflected(expected: Turn, beam: ToolBeam, height_mm: float) -> FloatArray:
    """Deflection at a height at every angle (n, 2), um, each disc's force by its own influence."""
    weights = np.array([beam.compliance_um_per_n(height_mm, z) for z in expected.height_mm])
    return np.einsum("ndk,d->nk", expected.by_height, weights)


BEAM = ToolBeam(30.0, 20.0, 6.4, 8.0, 600.0, holder_n_per_um=25.0)


@pytest.mark.parametrize("case", ["paper", "edges", "runout"])
def test_deflection_of_the_tip(case: str) -> None:
    cutter, arcs = CASES[case], ARCS["down milling"]
    feed = 0.02 * SPEED * cutter.flutes
    expected = turn(cutter, arcs, 0.02, angles=720)
    tip = deflected(expected, BEAM, 0.0)
    force = model(cutter)
    assert force.peak_deflection_um(arcs, feed, BEAM) == pytest.approx(np.hypot(*tip.T).max(), rel=3e-3)
    moment = np.einsum("ndk,d->nk", expected.by_height, 30.0 - expected.height_mm)
    for i in (0, 200, 555):
        turned = 2.0 * pi * i / 720
        np.testing.assert_allclose(
            force.deflection_um(arcs, feed, turned, 0.0, BEAM), tip[i], atol=2e-3 * np.hypot(*tip[i])
        )
        centre = force.force_centre_mm(arcs, feed, turned, 30.0)
        np.testing.assert_allclose(centre * expected.force[i], moment[i], rtol=1e-2)


@pytest.mark.parametrize("sense", [SpindleSense.clockwise, SpindleSense.counter_clockwise])
@pytest.mark.parametrize("case", ["paper", "edges"])
def test_wall(case: str, sense: SpindleSense) -> None:
    """Down milling: each height stands where the tool was bent to as a flute left the wall there."""
    cutter, per_tooth = CASES[case], 0.03
    arcs = np.array([[-pi / 2, -0.4, 0.0, 12.0]])
    heights = np.array([0.5, 4.0, 8.0, 11.5])
    angles = 720
    expected = turn(cutter, arcs, per_tooth, angles=angles, discs=80)
    lag = tan(cutter.helix_rad) / (0.5 * cutter.diameter_mm)
    errors = []
    for z in heights:
        at = (lag * z + pi / 2) / (2.0 * pi) * angles
        bent = deflected(expected, BEAM, z)[:, 1]
        errors.append(np.interp(at, np.arange(3 * angles), np.tile(bent, 3)))
    side = WallSide.right
    if sense == SpindleSense.counter_clockwise:
        arcs = np.array([[0.4, pi / 2, 0.0, 12.0]])
        side = WallSide.left
    found = _core.wall_error_um(
        model(cutter, sense), BEAM, arcs, per_tooth * SPEED * cutter.flutes, side, np.append(heights, 12.5)
    )
    np.testing.assert_allclose(found[:-1], errors, rtol=3e-3, atol=0.02)
    assert np.isnan(found[-1])
    assert (found[:3] > 0.0).all()  # down milling leaves material


def test_paper_001() -> None:
    """What eq. 7 of paper 001 gives in the corner, and what holds the force."""
    cutter = CASES["paper"]
    force = model(cutter)
    entry = np.array([[-pi / 2, asin(0.8 / 4 - 1), 0.0, 15.0]])
    deepest = ARCS["down milling"]
    before, at = force.figures(entry, 216.0), force.figures(deepest, 216.0)
    assert 216.0 * before.mean_resultant_n / at.mean_resultant_n == pytest.approx(90.8, abs=0.05)
    discs = [turn(cutter, arcs, 0.02, angles=360) for arcs in (entry, deepest)]
    mean = [np.hypot(*t.force.T).mean() for t in discs]
    assert 216.0 * mean[0] / mean[1] == pytest.approx(90.8, abs=0.1)
    held = _core.largest_feed(force, deepest, FeedLimits(mean_resultant_n=before.mean_resultant_n), 10.0, 216.0)
    assert held.feed_mm_per_min == pytest.approx(75.6, abs=0.05)
    assert held.limit == FeedLimit.resultant
    peak = _core.largest_feed(force, deepest, FeedLimits(peak_resultant_n=before.peak_resultant_n), 10.0, 216.0)
    assert peak.feed_mm_per_min == pytest.approx(80.75, abs=0.05)
    local = model(CASES["paper, local chip"])
    ratio = local.figures(entry, 216.0).mean_resultant_n / local.figures(deepest, 216.0).mean_resultant_n
    assert 216.0 * ratio == pytest.approx(90.55, abs=0.05)
    # The wall, 2.5 mm above the tip, with an overhang that the paper does not state.
    beam = ToolBeam(30.0, 20.0, 6.4, 8.0, 600.0)
    walls = [
        _core.wall_error_um(force, beam, arcs, feed, WallSide.right, np.array([2.5]))[0]
        for arcs, feed in ((entry, 216.0), (deepest, 216.0), (deepest, 90.8), (deepest, 80.75))
    ]
    np.testing.assert_allclose(walls, [1.58, 3.97, 1.96, 1.78], atol=0.02)


@pytest.mark.parametrize(("discs", "whole", "held"), [(50, True, 81.7), (150, True, 80.0), (60, False, 80.75)])
def test_feed_that_holds_the_peak_depends_on_discs(discs: int, whole: bool, held: float) -> None:
    """By integration along the flute 81.3: whole discs scatter about it."""

    def peak(radial_depth: float, feed: float) -> float:
        arcs = np.array([[-pi / 2, asin(radial_depth / 4 - 1), 0.0, 15.0]])
        cut = turn(CASES["paper"], arcs, feed / (6 * SPEED), angles=360, discs=discs, whole=whole)
        return float(np.hypot(*cut.force.T).max())

    target, feed = peak(0.8, 216.0), 80.0
    for _ in range(4):
        feed *= (target / peak(2.103, feed)) ** (1 / 0.847)
    assert feed == pytest.approx(held, abs=0.08)


def test_whole_track() -> None:
    force = model(CASES["paper"])
    track = CornerCut(4.0, 8.0, 8.0, 0.8).track(15.0, 0.05)
    feeds = np.linspace(100.0, 216.0, len(track))
    columns = force.figures_of(track, feeds, BEAM)
    arcs = np.asarray(track.arcs_of(len(track) // 2))
    one = force.figures(arcs, feeds[len(track) // 2] * track.horizontal[len(track) // 2])
    for name in ("mean_resultant_n", "peak_resultant_n", "peak_torque_nm", "mean_torque_nm", "mean_power_w"):
        assert columns[name].shape == (len(track),)
        assert columns[name][len(track) // 2] == getattr(one, name)
    assert columns["mean_x_n"][len(track) // 2] == one.mean_n[0]
    limits = FeedLimits(peak_resultant_n=35.0, beam=BEAM, peak_deflection_um=20.0)
    feed, limit, within = _core.largest_feeds(force, track, limits, 20.0, 1000.0)
    after = force.figures_of(track, feed, BEAM)
    assert (after["peak_resultant_n"] <= 35.0 * (1 + 1e-12)).all()
    assert (after["peak_deflection_um"] <= 20.0 * (1 + 1e-12)).all()
    share = np.maximum(after["peak_resultant_n"] / 35.0, after["peak_deflection_um"] / 20.0)
    bound = limit != FeedLimit.none.value
    assert bound.any() and within.all()
    assert (share[bound] > 1 - 2.1e-4).all()
    wall = _core.wall_errors_um(force, BEAM, track, feed, WallSide.right, np.array([1.0, 7.0, 14.0]))
    assert wall.shape == (len(track), 3)
    assert np.isfinite(wall[len(track) // 2]).all()


def test_tracks_in_two_threads() -> None:
    """Each thread has its own force model; the interpreter's lock is not held."""
    track = CornerCut(4.0, 8.0, 8.0, 0.8).track(15.0, 0.05)
    feeds = np.full(len(track), 200.0)
    results: list[FloatArray] = []

    def work() -> None:
        results.append(model(CASES["paper"]).figures_of(track, feeds)["peak_resultant_n"])

    threads = [threading.Thread(target=work) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    np.testing.assert_array_equal(results[0], results[1])


def test_shapes_and_refusals() -> None:
    force = model(CASES["paper"])
    assert force.figures(np.empty((0, 4)), 100.0).peak_resultant_n == 0.0
    assert force.tool.flutes == 6
    assert force.sense == SpindleSense.clockwise
    with pytest.raises(_core.ArgumentError, match=r"\(n_arcs, 4\)"):
        force.figures(np.zeros((2, 3)), 100.0)
    with pytest.raises(_core.ArgumentError, match="must rise within"):
        force.figures(np.array([[-2.0, 1.0, 0.0, 1.0]]), 100.0)
    with pytest.raises(_core.ArgumentError, match="feed is -1"):
        force.figures(ARCS["slot"], -1.0)
    with pytest.raises(_core.ArgumentError, match="overhang and diameters"):
        FeedLimits(peak_deflection_um=10.0)
    with pytest.raises(_core.ArgumentError, match="overhang is 10"):
        force.peak_deflection_um(ARCS["down milling"], 100.0, ToolBeam(10.0, 10.0, 6.4, 8.0, 600.0))
    with pytest.raises(_core.ArgumentError, match="exponent"):
        CuttingCoefficients(100.0, -1.5)
    np.testing.assert_allclose(_core.machine_frame(np.array([3.0, 1.0]), pi / 2), [-1.0, 3.0], atol=1e-12)
