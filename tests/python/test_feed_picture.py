"""The pictures of a feed schedule: what they draw, and that nothing large is lost in a long program."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from matplotlib.text import Text

from shapegcode import _core
from shapegcode.cutting.stock import Stock
from shapegcode.cutting.tool import Tool
from shapegcode.feed.load import LOADS, envelope, groups
from shapegcode.feed.plots import plot_feed_along_path, plot_force_path, plot_wall_error, plots_of
from shapegcode.feed.result import FeedSchedule
from shapegcode.feed.schedule import schedule_feed
from shapegcode.machine import Machine
from shapegcode.results import plot

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes

FEED = Path(__file__).parents[1] / "golden" / "feed"


def scheduled(machine: Machine) -> FeedSchedule:
    tool, stock = Tool.load(FEED / "pocket_tool.toml"), Stock.load(FEED / "pocket_stock.toml")
    return schedule_feed(FEED / "POCKET.NC", machine, tool, stock, resolution_mm=0.16)


@pytest.fixture(scope="module")
def pocket() -> FeedSchedule:
    return scheduled(Machine.load("vx500"))


def test_groups_hold_every_station_once_and_envelopes_lose_nothing() -> None:
    random = np.random.default_rng(5)
    distance = np.cumsum(random.exponential(1.0, 5000))
    values = random.normal(size=5000)
    starts = groups(distance, 300)
    assert starts[0] == 0
    assert 250 < len(starts) <= 300
    assert (np.diff(starts) > 0).all()
    low, high = envelope(values, starts)
    ends = np.append(starts[1:], 5000)
    assert [values[a:b].min() for a, b in zip(starts, ends, strict=True)] == low.tolist()
    assert [values[a:b].max() for a, b in zip(starts, ends, strict=True)] == high.tolist()
    spans = np.diff(distance[starts])
    assert spans.max() < 3.0 * distance[-1] / 300 + 10.0
    assert groups(distance[:200], 300).tolist() == list(range(200))


def test_traces_are_those_of_the_regions_in_a_row(pocket: FeedSchedule) -> None:
    traces = pocket.traces
    regions = [part for part in pocket.survey.regions if part.track is not None]
    assert traces.distance_mm[-1] == pytest.approx(sum(part.region.path.length_mm for part in regions), rel=1e-9)
    assert traces.length_mm.sum() == pytest.approx(traces.distance_mm[-1], rel=1e-12)
    assert len(traces.begins) == len(regions) == 3
    assert traces.xy_mm[traces.begins[1]] == pytest.approx([22.3, 22.3], abs=0.5)
    assert set(np.round(traces.programmed_mm_per_min, 6)) == {300.0, 1500.0, 2000.0}
    # What is written stands in the text.
    words = {float(word) for word in re.findall(rb"F([0-9.]+)", pocket.text)}
    assert set(np.round(traces.written_mm_per_min, 6)) <= words
    assert (traces.load.emitted.feed_mm_per_min <= traces.written_mm_per_min.max() * (1.0 + 1e-9)).all()
    assert {len(getattr(traces.load.original, name)) for name in LOADS} == {len(traces)}
    assert (traces.limit["peak_resultant_n"] == 100.0).all()
    assert np.isinf(traces.limit["mean_power_w"]).all()
    assert traces.load.original.peak_resultant_n.max() > 100.0 >= traces.load.emitted.peak_resultant_n.max()


def test_limits_of_the_spindle_are_drawn_as_they_are_kept(pocket: FeedSchedule) -> None:
    """The tool file limits the resultant alone; torque and power are the machine's."""
    limits = {"feed_control.spindle_torque_nm": 0.4, "feed_control.spindle_power_w": 150.0}
    schedule = scheduled(Machine.load("vx500").with_values(limits))
    assert schedule.peak.mean_power_w.emitted <= 150.0 < schedule.peak.mean_power_w.original
    assert (schedule.traces.limit["mean_power_w"] == 150.0).all()
    assert (schedule.traces.limit["peak_torque_nm"] == 0.4).all()
    texts = {text.get_text() for text in plot_feed_along_path(schedule).figure.findobj(Text)}
    assert {"limit 150 W", "limit 0.4 N m", "limit 100 N"} <= texts


def test_walls_are_those_of_the_core(pocket: FeedSchedule) -> None:
    traces, walls = pocket.traces, pocket.walls
    before, after = walls.error_um.original, walls.error_um.emitted
    assert before.shape == after.shape == (len(walls.edges_mm) - 1, len(walls.height_mm))
    assert walls.height_mm[-1] == pytest.approx(8.0)
    assert walls.edges_mm[[0, -1]] == pytest.approx([0.0, traces.distance_mm[-1]])
    # The finishing pass at the end makes its wall over its whole depth, roughing only over a level's.
    assert np.isfinite(before[-20]).all()
    assert np.isnan(before[100]).any()
    assert np.isfinite(before[100]).any()
    # Never more than the tip is deflected by at most.
    assert np.nanmax(np.abs(after)) <= traces.load.emitted.peak_deflection_um.max() * (1.0 + 1e-9)


@pytest.mark.slow
def test_the_files(pocket: FeedSchedule, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plot, "FORMATS", (".svg",))
    files = [Path(name) for name in pocket.save_plots(tmp_path / "plots")]
    assert [file.name for file in files] == ["feed-along-path.svg", "feed-path.svg", "feed-surface.svg"]
    along, path, surface = (file.read_text(encoding="utf-8") for file in files)
    for words in ("POCKET.NC", "reached", "limit 100 N", "distance along the cutting path in mm"):
        assert words in along
    assert "before: up to 124 N" in path
    assert "after: up to 98.4 N" in path
    assert "Form error of the wall" in surface


@pytest.mark.parametrize("draw", [plot_feed_along_path, plot_force_path, plot_wall_error])
def test_plots_draw_into_the_axes_of_the_caller(pocket: FeedSchedule, draw: Callable[..., Axes]) -> None:
    whole = plot.figure(12.0, 8.0)
    mine, other = whole.subplots(1, 2)
    drawn = draw(pocket, mine)
    assert drawn.figure.figure is whole
    assert not other.has_data()
    assert drawn.get_window_extent().x1 <= other.get_window_extent().x0
    assert set(plots_of(pocket)) == {"feed-along-path", "feed-path", "feed-surface"}


def test_without_known_forces_there_are_no_pictures(pocket: FeedSchedule, tmp_path: Path) -> None:
    unknown = replace(pocket, loads=(None,) * len(pocket.loads))
    assert unknown.save_plots(tmp_path / "plots") == []
    assert not (tmp_path / "plots").exists()
    for draw in (plot_feed_along_path, plot_force_path, plot_wall_error):
        with pytest.raises(_core.ArgumentError, match="nothing to draw"):
            draw(unknown)
