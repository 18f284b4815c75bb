"""``shapegcode demo tap``: paper 003's figures against closed forms, SciPy and this project's reference values."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from scipy.linalg import expm

from shapegcode.cli import main
from shapegcode.demos.tap import COLLET, END_MILL, SYSTEM, TapDemo, tap_demo
from shapegcode.results import plot as canvas
from shapegcode.results.json import schema


@pytest.fixture(scope="module")
def demo() -> TapDemo:
    return tap_demo()


def test_references_of_the_system(demo: TapDemo) -> None:
    system = demo.system
    assert system.phi == pytest.approx([1.96043, -0.98020], abs=5e-6)
    assert system.frequency_hz == pytest.approx(4.5016, abs=5e-5)
    assert system.damping_ratio == pytest.approx(0.0707, abs=5e-5)
    assert system.rms_m_per_s2 == pytest.approx(0.8928, abs=5e-5)
    assert np.round(system.wilson_theta.phi, 4).tolist() == [1.9605, -0.9803]
    assert system.closed_form_kg == pytest.approx(5.0, rel=2e-3)
    assert system.bisection_kg == pytest.approx(5.0059, abs=5e-5)
    assert system.halvings == 12


def test_the_system_is_discrete_as_scipy_makes_it(demo: TapDemo) -> None:
    mass, damping, stiffness = SYSTEM.mass_kg, SYSTEM.damping_n_s_per_m, SYSTEM.stiffness_n_per_m
    transition = expm(np.array([[0.0, 1.0], [-stiffness / mass, -damping / mass]]) * demo.period_s)
    expected = [np.trace(transition), -np.linalg.det(transition)]
    assert demo.system.phi == pytest.approx(expected, rel=1e-8)
    # the impulse makes the body move at 1/m, from which on x'' = -(c x' + k x)/m
    assert demo.acceleration[0] == pytest.approx(-damping / mass**2, rel=1e-12)
    omega = math.sqrt(stiffness / mass)
    assert np.abs(demo.acceleration).max() < omega / mass


def test_the_end_mill(demo: TapDemo) -> None:
    mill = demo.end_mill
    pole = np.log(np.roots([1.0, -0.6175, 0.9670])[0]) * 6000.0
    assert mill.frequency_hz == pytest.approx(abs(pole) / (2.0 * math.pi), rel=1e-9)
    assert mill.frequency_hz == pytest.approx(1195.0, abs=0.5)
    assert mill.damping_ratio == pytest.approx(0.013, abs=5e-4)
    assert mill.mass_kg == pytest.approx(0.9, abs=5e-4)
    assert mill.stiffness_n_per_m == pytest.approx(5.07e7, rel=1e-3)
    coarse, fine = (stepped.frequency_hz for stepped in mill.wilson_theta)
    assert coarse < 1050.0
    assert fine == pytest.approx(END_MILL.frequency_hz, rel=2e-3)


def test_the_series(demo: TapDemo) -> None:
    series = demo.series
    compliances = [1.0 / END_MILL.stiffness_n_per_m, 1.0 / COLLET.stiffness_n_per_m]
    assert series.end_mill_um == pytest.approx(1.97, abs=0.01)
    assert series.collet_um == pytest.approx(0.094, abs=0.001)
    assert series.total_um == pytest.approx(1e8 * sum(compliances), rel=1e-12)
    assert series.end_mill_share_percent == pytest.approx(100.0 * compliances[0] / sum(compliances), rel=1e-12)
    assert series.end_mill_share_percent + series.collet_share_percent == pytest.approx(100.0)
    # the chain's frequencies from its characteristic polynomial
    m1, k1, m2, k2 = END_MILL.mass_kg, END_MILL.stiffness_n_per_m, COLLET.mass_kg, COLLET.stiffness_n_per_m
    squares = sorted(np.roots([m1 * m2, -(m1 * (k1 + k2) + m2 * k1), k1 * k2]).real)
    expected = [math.sqrt(each) / (2.0 * math.pi) for each in squares]
    assert series.natural_frequencies_hz == pytest.approx(expected, rel=1e-9)
    # of the slower mode: the tip moves 1, the nose what the tip's own balance asks for
    nose = 1.0 - m1 * squares[0] / k1
    assert series.end_mill_share_of_slow_mode_percent == pytest.approx(100.0 * (1.0 - nose), rel=1e-9)


def test_differences_are_said(demo: TapDemo) -> None:
    explained = {row.what: row for row in demo.rows if row.agreement == "explained"}
    assert set(explained) == {
        "collet, table 3: frequency",
        "collet, table 3: damping ratio",
        "end mill under 100 N",
        "collet under 100 N",
    }
    assert all(row.note.startswith("slip of the paper: ") for row in explained.values())
    assert explained["end mill under 100 N"].published == "18 µm"
    assert demo.ok
    assert COLLET.frequency_hz == pytest.approx(1353.0, abs=0.5)
    found = (demo.collet.equation_damping_ratio, demo.collet.listed_damping_ratio)
    assert found == pytest.approx((0.63, 0.063), rel=1e-2)


def test_a_note_makes_nothing_agree(demo: TapDemo) -> None:
    """What a row says of its difference is for people: only `agreement` counts."""
    (first, *others) = demo.rows
    wrong = dataclasses.replace(first, agreement="differs", note="slip of the paper: so it says")
    other = dataclasses.replace(demo, rows=(wrong, *others))
    assert not other.ok
    assert other.exit_code == 1
    assert "1 DIFFER" in other.answer


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(canvas, "FORMATS", (".svg",))
    plots = ["--plots", str(tmp_path / "plots")]
    assert main(["demo", "tap", "--json", str(tmp_path / "tap.json"), *plots]) == 0
    out = capsys.readouterr().out
    assert "Back, Ko and Kim, 2003" in out
    assert "next: shapegcode identify --tap-plan" in out
    result = json.loads((tmp_path / "tap.json").read_text(encoding="utf-8"))
    jsonschema.validate(result, schema(TapDemo))
    assert result["ok"]
    assert "4.50 Hz" in Path(result["plots"][0]).read_text(encoding="utf-8")
    assert "end mill: 1.97 µm, 95.5 %" in Path(result["plots"][1]).read_text(encoding="utf-8")
    assert main(["demo", "tap", "--json", "-", *plots]) == 0
    assert {**json.loads(capsys.readouterr().out), "made": None} == {**result, "made": None}
