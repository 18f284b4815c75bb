"""Pictures: complete files, honest curves, the right figures."""

import io
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.axes import Axes
from rich.console import Console
from scipy.spatial import KDTree

from effort import cpu_s
from shapegcode.conversion import plots as pictures
from shapegcode.conversion.convert import convert
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.results import plot
from shapegcode.results.motion_plots import Trace, View, plot_feed, plot_vibration, thin_min_max
from shapegcode.results.path_plots import follow, plot_path, polyline_of
from shapegcode.results.table import warning_table


def quarter(points: int) -> FloatArray:
    """Polyline of a line along X, 20 mm, and a quarter circle of 20 mm."""
    angle = np.linspace(0, np.pi / 2, points)
    arc = np.stack([20 + 20 * np.sin(angle), 20 - 20 * np.cos(angle), np.zeros_like(angle)], axis=1)
    return np.concatenate([[[0.0, 0.0, 0.0]], arc])


def traces(samples: int = 900) -> list[Trace]:
    """A command along the quarter, at rest for the last third, with a decaying swing of the table."""
    s = np.minimum(np.linspace(0, 1.5, samples), 1)[:, None]
    path = quarter(400)
    at = s[:, 0] * (len(path) - 1)
    command = np.stack([np.interp(at, np.arange(len(path)), path[:, axis]) for axis in range(3)], axis=1)
    t = np.arange(samples) * 1e-3
    swing = np.zeros_like(command)
    swing[:, 0] = 0.02 * np.sin(2 * np.pi * 46 * t)
    return [Trace("original", 1e-3, command, command + swing), Trace("emitted", 1e-3, command, command + swing / 10)]


@pytest.mark.parametrize("ending", ["png", "svg"])
def test_pictures_are_complete_and_the_same_every_time(tmp_path: Path, ending: str) -> None:
    for name, draw in (
        ("path", lambda: plot_path(quarter(200), traces())),
        ("feed", lambda: plot_feed([View(traces())])),
        ("vibration", lambda: plot_vibration([View(traces())])),
    ):
        first, second = tmp_path / f"{name}1.{ending}", tmp_path / f"{name}2.{ending}"
        plot.save(draw(), first)
        plot.save(draw(), second)
        assert first.read_bytes() == second.read_bytes()
        if ending == "png":
            assert first.read_bytes().startswith(b"\x89PNG")
        else:
            ElementTree.parse(first)


def svg_text(file: Path) -> str:
    return " ".join("".join(node.itertext()) for node in ElementTree.parse(file).iter() if node.tag.endswith("text"))


def text_of(drawn: Axes, folder: Path) -> str:
    plot.save(drawn, folder / "drawn.svg")
    return svg_text(folder / "drawn.svg")


def test_pictures_carry_units_and_figures(tmp_path: Path) -> None:
    text = text_of(plot_path(quarter(500), traces()), tmp_path)
    # A tenth of the path, 20 by 40 mm, over the swing of .02 mm: 224, rounded down.
    assert "drawn ×200" in text
    for part in ("X in mm", "Y in mm", "programmed path", "original, largest 20.0 µm in this picture", "of deviation"):
        assert part in text
    text = text_of(plot_vibration([View(traces())]), tmp_path)
    for part in ("in µm", "time in s", "original, residual 20.0 µm", "emitted, residual 2.0 µm"):
        assert part in text
    text = text_of(plot_feed([View(traces())]), tmp_path)
    assert "in mm/min" in text and "Z speed" not in text


def test_legends_have_the_figures_of_the_core(tmp_path: Path) -> None:
    measured = [replace(trace, largest_mm=0.0451, residual_mm=(0.0123, 0.0, 0.0)) for trace in traces()]
    assert "original, largest 45.1 µm" in text_of(plot_path(quarter(500), measured), tmp_path)
    text = text_of(plot_vibration([View(measured)]), tmp_path)
    assert "original, residual 12.3 µm" in text
    assert "Y: rigid" in text and "Y table" not in text


def test_a_record_without_the_stop_claims_none(tmp_path: Path) -> None:
    cut = [replace(trace, stops=False) for trace in traces()]
    text = text_of(plot_vibration([View(cut)], part="first 1 s of 9 s"), tmp_path)
    assert "come to rest" not in text and "residual" not in text
    assert "first 1 s of 9 s" in text


def test_a_straight_path_gets_a_note(tmp_path: Path) -> None:
    line = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    command = np.linspace(line[0], line[1], 500)
    swing = np.zeros_like(command)
    swing[:, 0] = 0.02 * np.sin(np.arange(500))
    drawn = plot_path(line, [Trace("original", 1e-3, command, command + swing)])
    assert "The path is straight" in text_of(drawn, tmp_path)


def test_pictures_go_into_the_callers_axes(tmp_path: Path) -> None:
    figure = plot.figure(24, 16)
    places = figure.subplots(2, 2)
    long = View([trace.part(0.2, 0.5, 0.3) for trace in traces()], "the worst place", "time from there in s")
    drawn = [
        plot_path(quarter(500), traces(), places[0, 0]),
        plot_path(quarter(500)[:200], traces(), places[0, 1], whole_mm=quarter(500)),
        plot_feed([View(traces())], places[1, 0]),
        plot_vibration([long, View(traces())], places[1, 1], part="lines 4 to 9"),
    ]
    figure.draw_without_rendering()
    for place, panel in zip(places.flat, drawn, strict=True):
        assert panel.get_figure(root=True) is figure
        outer, inner = place.get_window_extent(), panel.get_window_extent()
        assert outer.x0 <= inner.x0 < inner.x1 <= outer.x1
        assert outer.y0 <= inner.y0 < inner.y1 <= outer.y1
    text = text_of(drawn[0], tmp_path)
    for part in ("drawn ×200", "on the whole path", "Feed of the command", "the worst place", "lines 4 to 9"):
        assert part in text


def test_no_line_joins_the_two_sides_of_a_rounded_corner() -> None:
    """The table cuts a corner of two lines by 0.5 mm: drawn ten times as far, each side ends by itself."""
    angle = np.linspace(0, np.pi / 2, 200)
    rounding = np.stack([38.2 + 1.8 * np.sin(angle), 1.8 - 1.8 * np.cos(angle)], axis=1)
    table = np.concatenate([np.linspace([0, 0], [38.2, 0], 400)[:-1], rounding, np.linspace([40, 1.8], [40, 40], 400)])
    response = np.column_stack([table, np.zeros(len(table))])
    corner = np.array([[0.0, 0, 0], [40, 0, 0], [40, 40, 0]])
    panel = plot_path(corner, [Trace("cut", 1e-3, response, response)], magnification=10.0)
    curve = np.asarray(panel.get_lines()[1].get_xydata())
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    assert np.isnan(steps).sum() == 2  # to the gap, and from it
    assert np.nanmax(steps) < 0.3
    assert "drawn up to the bisector" in " ".join(text.get_text() for text in panel.texts)


def test_numbers_in_titles_are_never_powers_of_ten() -> None:
    said = [plot.number(value) for value in (1113.6, 83.0249, 0.09357, 2.2, 0.0, -1234567.0, 99.96)]
    assert said == ["1114", "83", "0.0936", "2.2", "0", "-1234567", "100"]
    assert plot.number(83.0249, 4) == "83.02"


def test_following_keeps_to_its_own_pass() -> None:
    there_and_back = np.array([[0.0, 0, 0], [50, 0, 0], [50, 0.001, 0], [0, 0.001, 0]])
    command = np.concatenate([np.linspace(a, b, 2000) for a, b in pairwise(there_and_back)])
    progress, feet = follow(command, command + np.array([0, 0.0005, 0]), there_and_back, complete=True)
    assert np.abs(np.linalg.norm(command - feet, axis=1)).max() < 0.0011
    assert progress[1000] == pytest.approx(25, abs=0.1)
    assert progress[5000] == pytest.approx(75, abs=0.1)


def test_a_part_keeps_time_and_says_whether_it_stops() -> None:
    whole = traces()[0]
    part = whole.part(0.1, 0.2, 0.15)
    assert part.times_s[[0, -1]] == pytest.approx([-0.05, 0.05])
    assert not part.stops
    end = whole.part(whole.rest_s - 0.1, np.inf, whole.rest_s)
    assert end.stops and end.rest_s == pytest.approx(0, abs=1e-9)
    assert len(whole.part(5, 6).command_mm) == 2


LONG = "%\nO1\nG21G90G94G17\nG00X0Y0Z0\nG01X20.F200\nG03X40.Y20.I0.J20.\nG01Y40.\nX0.F100\nM30\n%\n"


@pytest.mark.slow
def test_a_long_region_shows_its_worst_place_and_its_stop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = Machine.load("vx500")
    conversion = convert(Program.from_text(LONG.encode(), machine, source="long"), machine, shape_all=True)
    assert len(conversion.save_plots(tmp_path)) == 8
    text = svg_text(tmp_path / "path.svg")
    assert "around the worst position of the original" in text and "on the whole path" in text
    text = svg_text(tmp_path / "vibration.svg")
    assert "worst position, at" in text and "the stop, at" in text and "come to rest" in text

    monkeypatch.setattr(pictures, "RECORD_SAMPLES", 20_000)
    conversion.save_plots(tmp_path)
    text = svg_text(tmp_path / "vibration.svg")
    assert "first 20 s of" in text and "come to rest" not in text and "the stop" not in text


def test_polyline_is_close_to_large_arcs() -> None:
    text = "%\nO1\nG21G90G94G17\nG00X0Y0Z0\nG02X300.Y-300.I0.J-300.F3000\nM30\n%\n"
    points = polyline_of(Program.from_text(text.encode(), "vx500", source="arc").regions[0].path)
    middles = (points[1:] + points[:-1]) / 2
    assert np.abs(np.linalg.norm(middles - [0, -300, 0], axis=1) - 300).max() < 1.01e-5


def test_given_magnification_and_plane_are_used(tmp_path: Path) -> None:
    text = text_of(plot_path(quarter(50), traces(), magnification=123, plane="ZX"), tmp_path)
    assert "drawn ×123" in text and "Z in mm" in text


def test_bad_pictures_are_refused(tmp_path: Path) -> None:
    drawn = plot_feed([View(traces())])
    with pytest.raises(ValueError, match=r"\.png, \.svg"):
        plot.save(drawn, tmp_path / "p.jpeg")
    with pytest.raises(FileNotFoundError):
        plot.save(drawn, tmp_path / "no" / "p.png")
    for bad in (0, -1, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="magnification"):
            plot_path(quarter(50), traces(), magnification=bad)
    for said, draw in (
        ("no trace", lambda: plot_feed([View([])])),
        ("no view", lambda: plot_vibration([])),
        ("whole_mm", lambda: plot_path(quarter(20), traces(), whole_mm=np.zeros((1, 3)))),
        ("programmed_mm", lambda: plot_path(np.zeros((4, 2)), traces())),
        ("not in a grid", lambda: plot_feed([View(traces())], plot.figure(4, 4).add_axes((0, 0, 1, 1)))),
    ):
        with pytest.raises(ValueError, match=said):
            draw()
    assert not list(tmp_path.iterdir())


def test_machine_at_rest_gives_a_picture(tmp_path: Path) -> None:
    still = [Trace("original", 1e-3, np.zeros((5, 3)), np.zeros((5, 3)))]
    assert "drawn ×1 " in text_of(plot_path(np.zeros((2, 3)), still), tmp_path) + " "
    plot.save(plot_feed([View(still)]), tmp_path / "f.png")
    plot.save(plot_vibration([View(still)]), tmp_path / "v.png")


def test_thinning_keeps_extremes_ends_and_order() -> None:
    rng = np.random.default_rng(1)
    t = np.arange(100_000.0)
    v = rng.normal(size=t.size)
    v[54_321], v[77_777] = 50, -60
    thin_t, thin_v = thin_min_max(t, v, 1000)
    assert len(thin_t) <= 1002
    assert thin_v.max() == 50 and thin_v.min() == -60
    assert thin_t[0] == 0 and thin_t[-1] == t[-1]
    assert (np.diff(thin_t) > 0).all()
    assert (v[thin_t.astype(int)] == thin_v).all()
    short_t, short_v = thin_min_max(t[:10], v[:10], 1000)
    assert len(short_t) == len(short_v) == 10


def test_feet_lie_on_the_polyline_and_nowhere_is_nearer() -> None:
    polyline = quarter(40)
    command = np.concatenate([np.linspace(a, b, 20) for a, b in pairwise(polyline)])
    points = command + np.random.default_rng(2).uniform(-0.1, 0.1, size=command.shape)
    feet = follow(command, points, polyline, complete=True)[1]
    fine = np.concatenate([np.linspace(a, b, 2000) for a, b in pairwise(polyline)])
    nearest = KDTree(fine).query(points)[0]
    distance = np.linalg.norm(points - feet, axis=1)
    assert (distance <= nearest + 1e-6).all()
    assert (distance >= nearest - 0.006).all()
    on_path = follow(command, command, polyline, complete=True)[1]
    assert np.abs(on_path - command).max() < 1e-9


def test_feet_far_from_the_origin_keep_a_hundredth_of_a_micrometre() -> None:
    shift = np.array([90_000.0, -90_000.0, 500.0])
    polyline = quarter(40)
    points = polyline + np.array([0, 0, 0.001])
    feet = follow(polyline + shift, points + shift, polyline + shift, complete=True)[1]
    assert np.abs(np.linalg.norm(points + shift - feet, axis=1) - 0.001).max() < 1e-5


@pytest.mark.slow
def test_long_programs_take_little_more_to_draw(tmp_path: Path) -> None:
    def draw(samples: int) -> None:
        long = traces(samples)
        plot.save(plot_path(quarter(samples // 15), long), tmp_path / "p.png")
        plot.save(plot_feed([View(long)]), tmp_path / "f.png")
        plot.save(plot_vibration([View(long)]), tmp_path / "v.svg")

    # What is drawn is thinned to the picture's pixels: ten times as long costs little more.
    short_s = cpu_s(lambda: draw(30_000), 1)
    assert cpu_s(lambda: draw(300_000), 1) < 10.0 * short_s
    assert (tmp_path / "v.svg").stat().st_size < 2_000_000


def test_trace_checks_its_arrays() -> None:
    good = np.zeros((4, 3))
    for period_s, response, said in (
        (0.0, good, "period_s = 0"),
        (1e-3, good.T, r"shape \(3, 4\)"),
        (1e-3, good * np.nan, "not finite"),
        (1e-3, good[:3], "4 samples of the command, 3 of the response"),
    ):
        with pytest.raises(ValueError, match=said):
            Trace("a", period_s, good, response)
    with pytest.raises(ValueError, match="read-only"):
        Trace("a", 1e-3, good, good).command_mm[0, 0] = 1
    good[0, 0] = 1  # the caller's own array stays writable


def test_trace_knows_when_the_command_moves() -> None:
    command = np.zeros((10, 3))
    command[3:, 1] = 1
    command[6:, 1] = 2
    command[8, 1] += 1e-12  # rounding is not motion
    trace = Trace("a", 0.5, command, command)
    assert trace.departure_s == 1.0
    assert trace.rest_s == 3.0
    still = Trace("a", 0.5, np.zeros((3, 3)), np.zeros((3, 3)))
    assert still.departure_s == still.rest_s == 0


def test_long_warnings_wrap_under_their_own_text() -> None:
    stream = io.StringIO()
    Console(file=stream, width=40).print(warning_table(["one two three four five six seven eight nine ten", "b"]))
    lines = stream.getvalue().splitlines()
    assert lines[0].startswith("warning: one") and lines[1].startswith("         ")
    assert lines[-1].startswith("warning: b")
