"""Park, Hong and Danielson, 2009 (docs/evidence/paper002.md): its page against closed forms and reference values."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from page_code import run_page


def page() -> dict[str, Any]:
    return run_page("evidence/paper002.md")


def test_shapers_are_those_of_the_paper() -> None:
    expected = {
        "short": ([0.0, 0.2, 0.4], [0.72361, -0.44721, 0.72361]),
        "medium": ([0.0, 0.4, 0.6], [0.44721, 0.27639, 0.27639]),
        "long": ([0.0, 0.4, 0.8], [0.27639, 0.44721, 0.27639]),
        "convolved ZV": ([0.0, 0.125, 0.5, 0.625], [0.25] * 4),
    }
    shapers = page()["shapers"]
    assert shapers.keys() == expected.keys()
    for name, (times_s, amplitudes) in expected.items():
        np.testing.assert_allclose(shapers[name].times_s, times_s, atol=1e-9)
        np.testing.assert_allclose(shapers[name].amplitudes, amplitudes, atol=1e-5)
    assert len(page()["found"]) == 7


def test_what_the_paper_says_of_them() -> None:
    """Figures 2, 5 and 6: several per pair of frequencies, the shortest 2/(f1+f2); nothing left; which is robust."""
    assert page()["counts"].max() > 1
    assert page()["miss_s"] < 1e-12
    assert page()["turning"] == pytest.approx(3.0, abs=0.021)  # a step of the ratio
    worst = {name: page()["worst_percent"](shaper) for name, shaper in page()["shapers"].items()}
    assert max(worst, key=worst.__getitem__) == "short"
    assert worst["short"] > worst["medium"] > worst["long"]
    for shaper in page()["shapers"].values():
        phasors = np.exp(2j * np.pi * np.outer([1.0, 4.0], shaper.times_s)) @ shaper.amplitudes
        assert np.abs(phasors).max() < 1e-9
        assert page()["left_of_a_step"](shaper) < 1e-6


def test_branches_hold_the_uniform_families() -> None:
    """Closed form: times 0, t, 2t with t = k/(f1+f2) or k/(f2-f1), amplitudes as (1, -2cos 2πf1t, 1)."""
    branches = page()["branches"]
    compared = 0
    for place in range(0, len(branches.ratios), 20):
        second_hz = float(branches.ratios[place])
        for spacing_hz, k in itertools.product((1.0 + second_hz, second_hz - 1.0), range(1, 10)):
            t = k / spacing_hz
            weights = np.array([1.0, -2.0 * math.cos(2.0 * math.pi * t), 1.0])
            # a member whose amplitudes sum to zero does not exist, and the search ends at a sum of magnitudes of 10
            if 2.0 * t > 1.0 or np.abs(weights).sum() > 9.9 * abs(weights.sum()):
                continue
            weights /= weights.sum()
            same = np.isclose(branches.times_s[:, place], [0.0, t, 2.0 * t], atol=1e-9).all(axis=1)
            same &= np.isclose(branches.amplitudes[:, place], weights, atol=1e-8).all(axis=1)
            assert same.any(), (second_hz, t)
            compared += 1
    assert compared > 30


def test_the_stage_goes_its_way_and_rests() -> None:
    for name, (command, _) in page()["runs"].items():
        assert command[0] == 0.0
        assert command[-1] == pytest.approx(200.0)
        longer_s = 0.0 if name == "unshaped" else page()["shapers"][name].duration_s
        rests = np.flatnonzero(np.diff(command) != 0.0)[-1] + 1
        assert rests * page()["PERIOD_S"] == pytest.approx(3.0 + longer_s, abs=2e-3)


def test_unshaped_stage_against_the_superposed_ramps() -> None:
    """Each ramp of the speed V over A is a rectangle of acceleration; their waves add as phasors, decay included."""
    speed, ramp = 200.0 / 2.9, 0.1
    for beam, hz in enumerate((1.0, 4.0)):
        omega, zeta = 2.0 * math.pi * hz * 1.02, 0.005
        pole = complex(-zeta * omega, omega * math.sqrt(1.0 - zeta**2))
        # d'' + 2 zeta omega d' + omega² d = -a: d = Im(phasor e^{pole t}) once the acceleration is over
        impulse = -(speed / ramp) / pole.imag
        rectangle = impulse * (1.0 - np.exp(-pole * ramp)) / pole  # of starts at 0, seen at t > ramp
        phasor = rectangle * (1.0 - np.exp(-pole * 2.9))
        t = np.linspace(3.0, 3.0 + 3.0 / hz, 20_000)
        expected = np.abs((phasor * np.exp(pole * t)).imag).max()
        assert page()["left_mm"]["unshaped"][beam] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("ramp_s", "damping", "error"),
    [(0.1, 0.005, 0.02), (0.1, 0.01, 0.02), (0.2, 0.005, -0.02), (0.05, 0.002, 0.01), (0.3, 0.005, 0.03)],
)
def test_what_the_page_says_of_the_stage_does_not_depend_on_the_assumptions(
    ramp_s: float, damping: float, error: float
) -> None:
    left = {name: page()["after_stop_mm"](run) for name, run in page()["stage"](ramp_s, damping, error).items()}
    short, long = (left[name] / left["unshaped"] for name in ("short", "long"))
    assert short[0] < short[1] < 0.25
    assert long[0] < long[1] < 0.25
    assert long[1] < short[1]
