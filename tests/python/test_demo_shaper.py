"""``shapegcode demo shaper``: Park, Hong and Danielson, 2009 (paper 002), against closed forms and reference values."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from shapegcode.cli import main
from shapegcode.demos import shaper as demo_shaper, stage
from shapegcode.demos.shaper import ShaperDemo, shaper_demo
from shapegcode.demos.stage import MODES
from shapegcode.results import plot as canvas
from shapegcode.results.json import schema


@pytest.fixture(scope="module")
def demo() -> ShaperDemo:
    return shaper_demo()


def test_shapers_are_those_of_the_paper(demo: ShaperDemo) -> None:
    expected = {
        "short": ([0.0, 0.2, 0.4], [0.72361, -0.44721, 0.72361]),
        "medium": ([0.0, 0.4, 0.6], [0.44721, 0.27639, 0.27639]),
        "long": ([0.0, 0.4, 0.8], [0.27639, 0.44721, 0.27639]),
        "convolved ZV": ([0.0, 0.125, 0.5, 0.625], [0.25] * 4),
    }
    assert demo.shapers.keys() == expected.keys()
    for name, (times_s, amplitudes) in expected.items():
        np.testing.assert_allclose(demo.shapers[name].times_s, times_s, atol=1e-9)
        np.testing.assert_allclose(demo.shapers[name].amplitudes, amplitudes, atol=1e-5)
    assert len(demo.all_minimal_s) == 7


def test_every_statement_that_can_be_compared_agrees(demo: ShaperDemo) -> None:
    assert demo.ok
    places = {row.place for row in demo.rows}
    assert places == {f"figure {number}" for number in (2, 3, 4, 5, 6, 8, 9)} | {"figures 8, 9"}
    assert all(row.published and row.ours for row in demo.rows)


def test_branches_hold_the_uniform_families(demo: ShaperDemo) -> None:
    """Closed form: times 0, t, 2t with t = k/(f1+f2) or k/(f2-f1), amplitudes as (1, -2cos 2πf1t, 1)."""
    branches = demo.branches
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


def test_the_stage_goes_its_way_and_rests(demo: ShaperDemo) -> None:
    for name, run in demo.runs.items():
        assert run.command[0] == 0.0
        assert run.command[-1] == pytest.approx(200.0)
        longer_s = 0.0 if name == "unshaped" else demo.shapers[name].duration_s
        moving = run.times_s[np.flatnonzero(np.diff(run.command) != 0.0)[-1] + 1]
        assert moving == pytest.approx(3.0 + longer_s, abs=2e-3)


def test_unshaped_stage_against_the_superposed_ramps(demo: ShaperDemo) -> None:
    """Each ramp of the speed V over A is a rectangle of acceleration; their waves add as phasors, decay included."""
    speed, ramp = 200.0 / 2.9, 0.1
    for beam, mode in enumerate(MODES):
        omega, zeta = 2.0 * math.pi * mode.frequency_hz * 1.02, 0.005
        pole = complex(-zeta * omega, omega * math.sqrt(1.0 - zeta**2))
        # d'' + 2 zeta omega d' + omega² d = -a: d = Im(phasor e^{pole t}) once the acceleration is over
        impulse = -(speed / ramp) / pole.imag
        rectangle = impulse * (1.0 - np.exp(-pole * ramp)) / pole  # of starts at 0, seen at t > ramp
        phasor = rectangle * (1.0 - np.exp(-pole * 2.9))
        t = np.linspace(3.0, 3.0 + 3.0 / mode.frequency_hz, 20_000)
        expected = np.abs((phasor * np.exp(pole * t)).imag).max()
        assert demo.stage_vibration["unshaped"].after_stop_mm[beam] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("ramp_s", "damping", "error"), [(0.1, 0.01, 0.02), (0.2, 0.005, -0.02), (0.05, 0.002, 0.01), (0.3, 0.005, 0.03)]
)
def test_what_the_remark_says_does_not_depend_on_the_assumptions(
    monkeypatch: pytest.MonkeyPatch, ramp_s: float, damping: float, error: float
) -> None:
    monkeypatch.setattr(stage, "RAMP_S", ramp_s)
    monkeypatch.setattr(stage, "DAMPING_RATIO", damping)
    monkeypatch.setattr(stage, "FREQUENCY_ERROR", error)
    monkeypatch.setattr(demo_shaper, "_BRANCH_RATIOS", np.array([1.5, 2.5, 3.5]))
    rows = [row for row in shaper_demo().rows if row.place in ("figure 8", "figure 9", "figures 8, 9")]
    assert [row.agreement for row in rows] == ["open", "open", "agrees", "agrees", "agrees"]


@pytest.mark.slow
def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(canvas, "FORMATS", (".svg",))  # PNG takes three times as long
    assert main(["demo", "shaper", "--json", str(tmp_path / "demo.json"), "--plots", str(tmp_path / "plots")]) == 0
    out = capsys.readouterr().out
    assert "Park, Hong and Danielson, 2009 (paper 002 in docs/evidence/references.md)" in out
    assert "next:" in out
    result = json.loads((tmp_path / "demo.json").read_text(encoding="utf-8"))
    jsonschema.validate(result, schema(ShaperDemo))
    assert len(result["plots"]) == 7
    assert all(Path(name).stat().st_size > 5000 for name in result["plots"])
