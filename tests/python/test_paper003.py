"""Back, Ko and Kim, 2003 (docs/evidence/paper003.md): its page against closed forms, SciPy and printed figures."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from page_code import run_page
from scipy.linalg import expm


def page() -> SimpleNamespace:
    return SimpleNamespace(**run_page("evidence/paper003.md"))


def test_the_system_as_the_paper_has_it() -> None:
    found = page()
    assert found.exact.phi == pytest.approx([1.96043, -0.98020], abs=5e-6)
    assert found.exact.theta[0, 0] == pytest.approx(0.004, abs=1e-3)
    assert (found.exact_hz, found.exact_damping) == pytest.approx((4.5016, 0.0707), abs=5e-5)
    assert found.exact_damping == pytest.approx(0.0702, abs=6e-4)
    assert found.rms(found.acceleration) == pytest.approx(0.8928, abs=5e-5)
    assert np.round(found.stepped.phi, 4).tolist() == [1.9605, -0.9803]
    assert min(found.reach_hz) <= 4.5078 <= max(found.reach_hz)
    assert found.closed.mass_kg == pytest.approx(5.0, rel=2e-3)
    assert found.halved.mass_kg == pytest.approx(5.0059, abs=5e-5)
    assert found.halved.halvings == 12


def test_the_system_is_discrete_as_scipy_makes_it() -> None:
    found = page()
    mass, damping, stiffness = found.system
    transition = expm(np.array([[0.0, 1.0], [-stiffness / mass, -damping / mass]]) * found.period_s)
    assert found.exact.phi == pytest.approx([np.trace(transition), -np.linalg.det(transition)], rel=1e-8)
    # the impulse makes the body move at 1/m, from which on x'' = -(c x' + k x)/m
    assert found.acceleration[0] == pytest.approx(-damping / mass**2, rel=1e-12)
    assert np.abs(found.acceleration).max() < math.sqrt(stiffness / mass) / mass


def test_the_end_mill() -> None:
    found = page()
    pole = np.log(np.roots([1.0, -0.6175, 0.9670])[0]) * 6000.0
    assert found.mill_hz == pytest.approx(abs(pole) / (2.0 * math.pi), rel=1e-9)
    assert found.mill_hz == pytest.approx(1195.0, abs=0.5)
    assert found.mill_damping == pytest.approx(0.013, abs=5e-4)
    assert found.mill_kg == pytest.approx(0.9, abs=5e-4)
    assert found.mill_kg * found.mill_omega**2 == pytest.approx(5.07e7, rel=1e-3)
    assert found.model_hz == pytest.approx(1194.0, abs=0.5)
    assert found.coarse[0] < 1050.0
    mass, damping, stiffness = found.end_mill
    assert found.fine[0] == pytest.approx(math.sqrt(stiffness / mass) / (2.0 * math.pi), rel=2e-3)
    assert found.fine[1] == pytest.approx(damping / (2.0 * math.sqrt(mass * stiffness)), rel=2e-2)


def test_both_under_100_newton() -> None:
    found = page()
    (m1, _, k1), (m2, _, k2) = found.end_mill, found.collet
    assert found.mill_um == pytest.approx(1.97, abs=0.01)
    assert found.collet_um == pytest.approx(0.094, abs=0.001)
    assert found.share_percent == pytest.approx(100.0 * k2 / (k1 + k2), rel=1e-12)
    assert found.share_percent > 90.0  # most of it is the end mill's: so says the paper too
    # the chain's frequencies from its characteristic polynomial
    squares = sorted(np.roots([m1 * m2, -(m1 * (k1 + k2) + m2 * k1), k1 * k2]).real)
    assert found.chain_hz == pytest.approx([math.sqrt(each) / (2.0 * math.pi) for each in squares], rel=1e-9)
    # of the slower mode: the tip moves 1, the nose what the tip's own balance asks for
    nose = 1.0 - m1 * squares[0] / k1
    assert found.slow_share_percent == pytest.approx(100.0 * (1.0 - nose), rel=1e-9)


def test_figures_that_do_not_follow_from_the_papers_numbers() -> None:
    found = page()
    assert found.collet_hz == pytest.approx(1353.0, abs=0.5)  # 1195 Hz printed
    assert (found.collet_damping, found.listed_damping) == pytest.approx((0.63, 0.063), rel=1e-2)  # .013 printed
    assert found.mill_um < 18.0 / 5.0 and found.collet_um < 0.7 / 5.0
