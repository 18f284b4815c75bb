"""Material and engagement from Python: against a reference without a grid, and the shapes of what comes out."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import shapegcode as sg
from engagement_truth import random_program, section_mm2
from shapegcode import _core as core
from shapegcode.results import plot

GOLDEN = Path(__file__).parents[1] / "golden" / "feed"

BORDERS = [-9.0, -6.0, -3.0, 0.0]


def box(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def slot(z: float = -6.0) -> core.Path:
    return core.Path([core.Segment.line([-20, 0, z], [20, 0, z], 10.0)])


@pytest.mark.parametrize("seed", range(3))
def test_random_programs_meet_what_the_definition_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rings = [box(-15, -12, 15, 12), 3.0 + 3 * np.array([[np.cos(a), np.sin(a)] for a in np.arange(5) * 1.2566])]
    path = random_program(rng, BORDERS[:-1], 60)
    material = core.Material(rings, BORDERS, 0.06)
    track = core.sweep(material, path, 6.0)
    cutting = np.flatnonzero(track.section_mm2 > 0)
    samples = np.concatenate([rng.choice(cutting, 60, replace=False), rng.choice(len(track), 60, replace=False)])
    ours = np.array([track.section_mm2[i] if track.horizontal[i] == 1.0 else 0.0 for i in samples])
    truth = np.array([section_mm2(path, track, i, rings, BORDERS, 3.0) for i in samples])
    error = np.abs(ours - truth)
    # Up to 9 mm deep: the places of the reference are 0.08 mm2 apart. Only the tips of cusps may be off by more: by a
    # few nodes of 0.06 mm in width.
    assert np.median(error[truth > 0]) < 0.02
    assert np.quantile(error, 0.9) < 0.06
    assert np.max(error) < 1.0


def test_random_programs_remove_what_the_definition_says() -> None:
    rng = np.random.default_rng(7)
    rings = [box(-15, -12, 15, 12)]
    path = random_program(rng, BORDERS[:-1], 20)
    material = core.Material(rings, BORDERS, 0.06)
    before = material.volume_mm3
    core.sweep(material, path, 6.0)
    places = rng.uniform([-15, -12, -9], [15, 12, 0], (4000, 3))
    swept = np.zeros(len(places), dtype=bool)
    for i in range(len(path)):
        line = [path[i].point_at(s) for s in np.linspace(0, path[i].length_mm, 1 + int(path[i].length_mm / 0.2))]
        for p in line:
            layer_bottom = np.floor(places[:, 2] / 3.0) * 3.0
            swept |= (np.hypot(*(places[:, :2] - p[:2]).T) < 3.0) & (p[2] < layer_bottom + 1.5)
    left = np.array([material.is_material(*p) for p in places])
    assert np.mean(left == swept) < 0.002  # places next to a wall, and between the chords of arcs
    assert material.volume_mm3 / before == pytest.approx(1 - np.mean(swept), abs=0.03)


def test_columns_are_read_only_views_that_keep_the_track() -> None:
    material = core.Material([box(-15, -10, 15, 10)], [-6.0, 0.0], 0.08)
    track = core.sweep(material, slot(), 8.0)
    s, arcs = track.s_mm, track.arcs
    n = len(track)
    del track
    assert s.shape == (n,)
    assert s[-1] == 40.0
    assert arcs.shape[1] == 4
    np.testing.assert_allclose(arcs[len(arcs) // 2], [-np.pi / 2, np.pi / 2, 0.0, 6.0])
    for array in (s, arcs):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_track_tells_samples_in_one_shape() -> None:
    material = core.Material([box(-15, -10, 15, 10)], [-6.0, 0.0], 0.08)
    track = core.sweep(material, slot(), 8.0, step_mm=0.5)
    n = len(track)
    for name in ("s_mm", "x_mm", "y_mm", "direction_rad", "horizontal", "segment", "radial_depth_mm", "section_mm2",
                 "plunged_mm2"):  # fmt: skip
        assert getattr(track, name).shape == (n,)
    assert track.first_arc.shape == (n + 1,)
    assert np.max(np.diff(track.s_mm)) <= 0.5 + 1e-12
    middle = int(np.argmin(np.abs(track.x_mm)))
    assert track.arcs_of(middle).shape == (1, 4)
    assert track.arcs_of(0).shape == (0, 4)
    assert track.section_mm2[middle] == pytest.approx(48.0)
    with pytest.raises(IndexError):
        track.arcs_of(n)
    empty = core.sweep(material, core.Path([]), 8.0)
    assert len(empty) == 0
    assert empty.arcs.shape == (0, 4)


def test_material_is_kept_between_paths_and_copied_on_demand() -> None:
    material = core.Material([box(-15, -10, 15, 10)], [-6.0, -3.0, 0.0], 0.08)
    copy = material.copy()
    core.sweep(material, slot(-3.0), 8.0)
    assert material.volume_mm3 == pytest.approx(30 * 20 * 6 - 30 * 8 * 3, rel=1e-4)
    assert copy.volume_mm3 == pytest.approx(30 * 20 * 6, rel=1e-4)
    heights = material.heights_mm([-20.0, -9.0], [20.0, 9.0], 3, 5)
    np.testing.assert_array_equal(heights[0], [np.nan, 0.0, 0.0, 0.0, np.nan])
    np.testing.assert_array_equal(heights[1], [np.nan, -3.0, -3.0, -3.0, np.nan])
    assert material.volume_in_cylinder_mm3(0.0, 0.0, 3.0, -6.0, 0.0) == pytest.approx(27 * np.pi, rel=1e-3)
    assert not material.is_material(0.0, 0.0, -1.0)
    assert material.distance_mm(1, 0.0, 3.95) == pytest.approx(-0.05, abs=1e-5)
    assert material.bytes < 2_000_000
    material.compact()
    assert material.borders_mm == [-6.0, -3.0, 0.0]


def test_progress_is_called_and_may_stop() -> None:
    material = core.Material([box(-15, -10, 15, 10)], [-6.0, 0.0], 0.2)
    seen: list[float] = []
    core.sweep(material, slot(), 8.0, step_mm=0.005, progress=seen.append)
    assert len(seen) > 3
    assert seen == sorted(seen)

    def stop(_: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        core.sweep(material, slot(), 8.0, step_mm=0.005, progress=stop)


def test_corner_of_the_paper() -> None:
    cut = core.CornerCut(4.0, 8.0, 8.0, 0.8, before_mm=30.0, after_mm=30.0)
    track = cut.track(15.0, 0.01)
    worst = int(np.argmax(track.radial_depth_mm))
    assert track.radial_depth_mm[worst] == pytest.approx(2.103, abs=0.0005)
    at = cut.at(track.s_mm[worst])
    assert np.degrees(at.turned_rad) == pytest.approx(14.0, abs=0.3)
    assert at.section == core.CornerSection.s3
    material = core.Material([cut.stock(8.0)], [-15.0, 0.0], 0.08)
    swept = core.sweep(material, cut.path(3.6, -15.0), 8.0)
    closed = np.array([cut.at(min(s, cut.length_mm)).radial_depth_mm for s in swept.s_mm])
    np.testing.assert_allclose(swept.radial_depth_mm, closed, atol=5e-4)


@pytest.mark.parametrize(
    ("rings", "message"),
    [
        ([], "no outline"),
        ([np.zeros((2, 2))], "2 points"),
        ([np.zeros((4, 3))], r"shape \(n, 2\)"),
        ([np.full((3, 2), np.nan)], "not finite"),
    ],
)
def test_no_stock_is_said_so(rings: list[np.ndarray], message: str) -> None:
    with pytest.raises(sg.ArgumentError, match=message):
        core.Material(rings, BORDERS, 0.1)


def test_too_fine_a_grid_is_said_so() -> None:
    with pytest.raises(sg.ArgumentError, match=r"limit 1000 MB"):
        core.Material([box(0, 0, 300, 300)], BORDERS, 1e-4, 1_000_000_000)


def test_layers_follow_the_program() -> None:
    paths = [slot(-3.0), slot(-6.0), core.Path([core.Segment.line([0, 0, -6], [9, 0, -7.5], 10.0)])]
    borders = core.layer_borders(paths, -9.0, 0.0, 0.5)
    assert borders == pytest.approx([-9.0, -7.5, -7.0, -6.5, -6.0, -3.0, 0.0])
    with pytest.raises(sg.ArgumentError, match="bottom must lie below"):
        core.layer_borders(paths, 0.0, -1.0, 0.5)


@pytest.mark.parametrize("page", ["concepts/engagement.md", "concepts/cutting_force.md", "howto/feed.md"])
def test_examples_of_the_pages_run_as_they_stand(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, file in (("POCKET.NC", "part.nc"), ("pocket_tool.toml", "T8.toml"), ("pocket_stock.toml", "block.toml")):
        shutil.copy(GOLDEN / name, tmp_path / file)
    monkeypatch.chdir(tmp_path)
    text = (GOLDEN.parents[2] / "docs" / page).read_text(encoding="utf-8")
    examples = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert examples
    assert "_core" not in text
    for example in examples:
        names: dict[str, object] = {"ax": plot.figure(8.0, 6.0).subplots()}
        exec(compile(example, page, "exec"), names)
        assert "sg" in names
