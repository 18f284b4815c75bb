"""``shapegcode demo corner``: paper 001's figures against brute force and the reference values of its formulas."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import jsonschema
import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import brentq

from shapegcode.cli import main
from shapegcode.demos.corner import CornerDemo, corner_demo
from shapegcode.results import plot
from shapegcode.results.json import schema

Vector = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def demo() -> CornerDemo:
    return corner_demo()


def resultant_n(radial_depth_mm: float, feed_mm_per_min: float, rev_per_min: float) -> Vector:
    """Resultant over one tooth pitch by discs of 0.05 mm: eq. 1 to 5, 8 and 9, k1 and k2 at the mean chip."""
    radius, teeth, helix, depth = 4.0, 6, math.radians(50.0), 15.0
    per_tooth = feed_mm_per_min / (teeth * rev_per_min)
    begin, end = -0.5 * math.pi, math.asin(radial_depth_mm / radius - 1.0)
    mean = per_tooth * (math.sin(end) - math.sin(begin)) / (end - begin)
    k1, k2 = 22.57 * 9.80665 * mean**-0.153, 0.41 * mean**-0.0775
    disc = 0.05
    heights = np.arange(0.5 * disc, depth, disc)
    pitch = 2.0 * math.pi / teeth
    turned = pitch * np.arange(120) / 120
    azimuth = (
        heights[:, None, None] * math.tan(helix) / radius
        - turned[None, :, None]
        - pitch * np.arange(teeth)[None, None, :]
    )
    azimuth = (azimuth + math.pi) % (2.0 * math.pi) - math.pi
    cutting = (azimuth >= begin) & (azimuth <= end)
    tangential = np.where(cutting, k1 * per_tooth * np.cos(azimuth) * disc, 0.0)
    x = (-tangential * np.sin(azimuth) - k2 * tangential * np.cos(azimuth)).sum(axis=(0, 2))
    y = (tangential * np.cos(azimuth) - k2 * tangential * np.sin(azimuth)).sum(axis=(0, 2))
    return np.asarray(np.hypot(x, y))


def test_case_1_geometry(demo: CornerDemo) -> None:
    first = demo.cases[0]
    assert first.radial_depth_mm.max == pytest.approx(2.103, abs=5e-4)
    assert first.angle_deg == pytest.approx(14.2, abs=0.05)
    # distance of the tool's circle and the rough arc, both of radius 4 + 4 and 8 about their centres, by search
    angles = np.radians(np.linspace(0.0, 30.0, 301))
    depths = [_depth_on_arc(angle) for angle in angles]
    assert max(depths) == pytest.approx(first.radial_depth_mm.max, abs=1e-4)
    assert math.degrees(angles[int(np.argmax(depths))]) == pytest.approx(first.angle_deg, abs=0.2)


def _depth_on_arc(turned: float) -> float:
    """Radial depth on the arc of case 1: finished corner about (-8, 8), rough one about (-8.8, 8.8), both of 8 mm."""
    centre = np.array([-8.0 + 4.0 * math.sin(turned), 8.0 - 4.0 * math.cos(turned)])
    outward = np.array([math.sin(turned), -math.cos(turned)])
    forward = np.array([math.cos(turned), math.sin(turned)])

    def beyond(azimuth: float) -> float:
        rim = centre + 4.0 * (math.cos(azimuth) * forward - math.sin(azimuth) * outward)
        return float(np.hypot(*(rim - np.array([-8.8, 8.8])))) - 8.0

    meets = brentq(beyond, -0.5 * math.pi + 1e-9, 0.5 * math.pi)
    return 4.0 * (1.0 + math.sin(meets))


def test_case_1_feeds_and_forces(demo: CornerDemo) -> None:
    first = demo.cases[0]
    assert first.feed_mm_per_min.min == pytest.approx(90.8, abs=0.1)
    assert first.feed_mm_per_min.max == 216.0
    straight, worst = resultant_n(0.8, 216.0, 1800.0), resultant_n(first.radial_depth_mm.max, 216.0, 1800.0)
    assert first.feed_mm_per_min.min == pytest.approx(216.0 * straight.mean() / worst.mean(), rel=2e-3)
    assert first.resultant_force_n.original.max == pytest.approx(worst.max(), rel=5e-3)
    assert first.scheduled.target_n == pytest.approx(straight.max(), rel=5e-3)
    above = first.above_straight_percent
    assert (above.mean, above.peak) == pytest.approx((16.0, 10.0), abs=0.5)
    assert first.drop_percent == pytest.approx(50.0, abs=2.0)
    lengths = first.blocks.length_mm
    assert 0.5 <= lengths.min <= lengths.max <= 0.6
    for name, of in (("mean", np.mean), ("peak", np.max)):
        feed = brentq(
            lambda feed, of=of: of(resultant_n(first.radial_depth_mm.max, feed, 1800.0)) - of(straight),
            50.0,
            216.0,
        )
        assert getattr(first.constant_force_mm_per_min, name) == pytest.approx(feed, rel=1e-2)


def test_the_jump_is_reported(demo: CornerDemo) -> None:
    second, third = demo.cases[1:]
    # At the vertex the tool of case 2 meets the straight rough wall x = -0.8: its centre is at (-4, 4).
    assert second.radial_depth_mm.max == pytest.approx(4.0 + math.sqrt(4.0**2 - 3.2**2), rel=1e-9)
    assert second.radial_depth_mm.behind == pytest.approx(0.8)
    assert second.full_circle_radial_depth_mm == pytest.approx(7.2, rel=1e-12)
    assert third.radial_depth_mm.max == pytest.approx(third.full_circle_radial_depth_mm, rel=1e-6)
    assert third.radial_depth_ratio == pytest.approx(0.84, abs=0.005)
    jumps = [row for row in demo.rows if row.what.startswith("jump")]
    assert [(row.published, row.agreement) for row in jumps] == [("0.9 D", "explained")] * 2
    assert "the full circle of the rough corner" in jumps[0].note


@pytest.mark.parametrize("number", [0, 1, 2])
def test_the_scheduler_keeps_the_target_and_gains(demo: CornerDemo, number: int) -> None:
    scheduled = demo.cases[number].scheduled
    assert scheduled.resultant_force_n.emitted.max <= scheduled.target_n
    assert scheduled.share_within_5_percent > 0.8
    assert scheduled.gain_percent >= 15.0
    assert scheduled.warnings == ()
    rev_per_min = demo.cases[number].spindle_rev_per_min
    depth = demo.cases[number].radial_depth_mm.max
    # The constant feed that it is compared with is the highest: a tenth more is too much.
    constant = scheduled.constant_feed_mm_per_min
    assert resultant_n(depth, 0.99 * constant, rev_per_min).max() < scheduled.target_n
    assert resultant_n(depth, 1.01 * constant + 0.1, rev_per_min).max() > scheduled.target_n


def test_the_wall_is_better(demo: CornerDemo) -> None:
    wall = demo.cases[0].wall_error_um
    assert wall.scheduled < wall.equation7 < 0.6 * wall.programmed


@pytest.mark.slow
def test_the_command(
    demo: CornerDemo, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plot, "FORMATS", (".svg",))
    monkeypatch.setattr("shapegcode.demos.corner.corner_demo", lambda _progress: demo)
    plots = ["--plots", str(tmp_path / "plots")]
    assert main(["demo", "corner", "--json", str(tmp_path / "corner.json"), *plots]) == 0
    out = capsys.readouterr().out
    assert "4 of 11 statements of Kim and Ko, 2001 (paper 001 in docs/evidence/references.md) agree" in out
    assert "next: shapegcode feed" in out
    result = json.loads((tmp_path / "corner.json").read_text(encoding="utf-8"))
    jsonschema.validate(result, schema(CornerDemo))
    assert result["ok"]
    assert [case["case"] for case in result["cases"]] == [1, 2, 3]
    drawn = {Path(name).stem: Path(name).read_text(encoding="utf-8") for name in result["plots"]}
    assert "2.103 mm = 0.263 D" in drawn["paper001-figure6a-radial-depth"]
    assert "frame of the machine (6c)" in drawn["paper001-figures6bc-forces"]
    assert "peak of the straight" in drawn["paper001-figure9-resultant"]
    assert "as programmed: up to" in drawn["paper001-figures11-12-surface"]
    assert "case 3: rough 8 mm, finish 4 mm" in drawn["paper001-scheduled"]


def test_a_target_that_is_missed_is_no_success(demo: CornerDemo) -> None:
    case = demo.cases[0]
    short = dataclasses.replace(case.scheduled, gain_percent=14.9)
    too_much = dataclasses.replace(case.scheduled, target_n=case.scheduled.resultant_force_n.emitted.max - 1e-6)
    for scheduled in (short, too_much):
        missed = dataclasses.replace(demo, cases=(dataclasses.replace(case, scheduled=scheduled), *demo.cases[1:]))
        assert (demo.ok, missed.ok, missed.exit_code) == (True, False, 1)


def test_pictures_are_drawn_into_the_axes_of_the_caller(demo: CornerDemo) -> None:
    for draw in demo.plots().values():
        whole = plot.figure(10.0, 7.0)
        assert draw(whole.subplots()).figure.figure is whole
