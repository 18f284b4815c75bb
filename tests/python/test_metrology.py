"""Virtual metrology against closed forms, SciPy and brute force."""

import functools
import math
import random
import re
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from page_code import run_page
from scipy import ndimage, optimize, spatial

import shapegcode as sg
from acceptance import machine_with
from shapegcode import _core
from shapegcode.demos.path import path_program
from shapegcode.io.units import FloatArray
from shapegcode.metrology.figures import FittedCircle
from shapegcode.metrology.result import MeasuredRegion
from shapegcode.model.machine_model import MachineModel
from shapegcode.results import plot

TOOL_MM = 3.0


def program(moves: Sequence[str], machine: sg.Machine) -> sg.Program:
    return sg.Program.from_text("\n".join(["%", "O1", "G21G17G90G94G40G64G00X0Y0Z0", *moves, "M30", "%", ""]), machine)


def one_mode(frequency_hz: float, damping_ratio: float) -> sg.Machine:
    """The built-in machine with the same mode on X and Y."""
    mode = [{"frequency_hz": frequency_hz, "damping_ratio": damping_ratio}]
    return machine_with({"axes.x.modes": mode, "axes.y.modes": mode})


@functools.cache
def paper_region(feed: float = 200.0) -> MeasuredRegion:
    machine = sg.Machine.load("vx500")
    return sg.measure(path_program(feed, machine), machine, TOOL_MM).programs[0].regions[-1]


@functools.cache
def paper_samples(feed: float = 200.0) -> tuple[FloatArray, FloatArray, _core.Path, _core.SimulationFigures]:
    machine = sg.Machine.load("vx500")
    path = path_program(feed, machine).regions[-1].path
    simulated = MachineModel(machine).simulate_original(path, record_samples=10**6)
    return simulated.recorded_command, simulated.recorded_response, path, simulated


def found(arc: _core.ArcFigures | None) -> _core.ArcFigures:
    assert arc is not None
    return arc


def fed(
    command: FloatArray, response: FloatArray, path: _core.Path, chunk: int, **options: float
) -> tuple[_core.TrackFigures, _core.SectionMetrology]:
    chosen = _core.MetrologyOptions()
    for name, value in options.items():
        setattr(chosen, name, value)
    metrology = _core.SectionMetrology(path, _core.path_sections(path), chosen)
    for begin in range(0, len(command), chunk):
        metrology.feed(command[begin : begin + chunk], response[begin : begin + chunk])
    return metrology.finish(), metrology


@pytest.mark.parametrize(("frequency_hz", "damping", "feed"), [(20.0, 0.05, 60.0), (46.0, 0.02, 100.0)])
def test_a_circle_is_magnified_as_base_excitation_says(frequency_hz: float, damping: float, feed: float) -> None:
    machine = one_mode(frequency_hz, damping)
    turns = 12
    text = [f"G01X5.F{feed * 60:.0f}.", *["G03X5.Y0.I-5.J0."] * turns, "G01X5.Y10."]
    # The third last turn: the start has decayed, the end is not felt yet.
    line = 4 + turns - 2
    measured = sg.measure(program(text, machine), machine, TOOL_MM, lines=[(line, line)])
    (figures,) = measured.programs[0].regions[0].figures.sections
    x = feed / 5.0 / (2 * math.pi * frequency_hz)
    gain = abs(complex(1.0, 2 * damping * x) / complex(1.0 - x * x, 2 * damping * x))
    assert figures.nominal_radius_mm == pytest.approx(5.0)
    # Command and response are straight from one set-point to the next; walls are cut by the corners and the chords.
    chords = (feed * 1e-3) ** 2 / 5.0 / 12.0
    assert found(figures.response_arc).fit.radius_mm == pytest.approx(5.0 * gain - 2.0 * chords, abs=5e-5)
    assert found(figures.response_arc).mean_radius_mm == pytest.approx(5.0 * gain - 2.0 * chords, abs=5e-5)
    assert found(figures.left_wall_arc).fit.radius_mm == pytest.approx(5.0 * gain - TOOL_MM / 2, abs=5e-4)
    assert found(figures.right_wall_arc).fit.radius_mm == pytest.approx(5.0 * gain + TOOL_MM / 2, abs=5e-4)
    assert found(figures.response_arc).fit.form_mm < 1e-3


def test_fitted_circles_are_those_of_scipy() -> None:
    generator = np.random.default_rng(4)
    for _ in range(20):
        radius, sweep = 10.0 ** generator.uniform(-1, 2), generator.uniform(0.5, 6.0)
        angle = np.linspace(0.0, sweep, 50)
        points = radius * np.column_stack([np.cos(angle), np.sin(angle)]) + generator.uniform(-100, 100, 2)
        points += generator.normal(scale=0.01 * radius, size=points.shape)
        fit = _core.fit_circle(points)

        def residuals(c: FloatArray, points: FloatArray = points) -> FloatArray:
            return np.asarray(np.hypot(points[:, 0] - c[0], points[:, 1] - c[1]) - c[2])

        start = np.array([*points.mean(axis=0), radius])
        best = optimize.least_squares(residuals, start, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=2000)
        assert np.sum(residuals(np.array([*fit.centre_mm, fit.radius_mm])) ** 2) <= 2 * best.cost * (1 + 1e-12)
        assert fit.radius_mm == pytest.approx(best.x[2], rel=1e-6)
        assert fit.form_mm == pytest.approx(np.ptp(residuals(best.x)), rel=1e-5)


def test_the_gaussian_filter_is_that_of_scipy() -> None:
    profile = np.random.default_rng(1).normal(size=3000)
    spacing, cutoff = 0.005, 0.25
    alpha = math.sqrt(math.log(2) / math.pi)
    sigma = alpha * cutoff / math.sqrt(2 * math.pi) / spacing
    expected = ndimage.gaussian_filter1d(profile, sigma, truncate=cutoff / spacing / sigma)
    middle = slice(200, -200)
    np.testing.assert_allclose(_core.gaussian_low_pass(profile, spacing, cutoff)[middle], expected[middle], atol=1e-6)


def test_roughness_of_a_sine() -> None:
    x = np.arange(4000) * 0.005
    figures = _core.measure_roughness(2e-3 * np.sin(2 * np.pi * x / 0.10137), 0.005, 0.8)
    assert figures.ra_mm == pytest.approx(2e-3 * 2 / math.pi, rel=5e-3)
    assert figures.rz_mm == pytest.approx(4e-3, rel=5e-3)
    assert figures.wa_mm < 1e-6


def swept_edges(response: FloatArray, point: FloatArray, normal: FloatArray, radius: float) -> tuple[float, float]:
    """How far the swept area reaches along a normal, by asking a cloud of disc centres point by point."""
    steps = np.linspace(0.0, 1.0, 200, endpoint=False)[:, None]
    near = np.linalg.norm(response - point, axis=1) < 2 * radius
    ends = [k for k in range(len(response) - 1) if near[k]]
    cloud = np.concatenate([response[k] + steps * (response[k + 1] - response[k]) for k in ends])
    tree = spatial.cKDTree(cloud)
    edges = []
    for side in (1.0, -1.0):
        reach = np.arange(0.9 * radius, 1.1 * radius, 2e-4)
        inside = tree.query(point + side * reach[:, None] * normal)[0] <= radius
        edges.append(side * float(reach[np.flatnonzero(~inside)[0]] - 1e-4))
    return edges[0], edges[1]


def test_walls_are_the_edges_of_the_swept_area() -> None:
    command, response, path, _ = paper_samples()
    _, metrology = fed(command, response, path, 10**6)
    for section in range(3):
        _, _, left, right, points, normals = metrology.wall_profile(section)
        for k in range(5, len(left), 83):
            edges = swept_edges(response[:, :2], points[k], normals[k], TOOL_MM / 2)
            assert left[k] == pytest.approx(edges[0] - TOOL_MM / 2, abs=4e-4), (section, k)
            assert right[k] == pytest.approx(edges[1] + TOOL_MM / 2, abs=4e-4), (section, k)


def test_pieces_of_any_size_give_the_same_figures() -> None:
    command, response, path, simulated = paper_samples()
    whole, _ = fed(command, response, path, 10**6)
    pieces, _ = fed(command, response, path, 7)
    for one, other in zip(whole.sections, pieces.sections, strict=True):
        assert one.left.band_mm == other.left.band_mm
        assert one.response.rms_mm == other.response.rms_mm
        np.testing.assert_array_equal(one.peak_mm, other.peak_mm)
    assert whole.duration_s == pytest.approx(simulated.duration_s)
    assert whole.response.max_abs_mm == pytest.approx(simulated.response.max_abs_mm)


MEMORY = """
import resource
import shapegcode as sg
machine = sg.Machine.load("vx500")
text = "%\\nO1\\nG21G17G90G94G40G64G00X0Y0Z0\\nG01X100.F{feed}.\\nG03X140.Y40.R40.\\nM30\\n%\\n"
def measured(feed):
    program = sg.Program.from_text(text.format(feed=feed), machine)
    time_s = sg.measure(program, machine, 3.0).programs[0].regions[0].figures.duration_s
    return round(time_s * 1000), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(*measured(3000), *measured(15))
"""


def test_memory_does_not_grow_with_the_samples() -> None:
    done = subprocess.run([sys.executable, "-c", MEMORY], capture_output=True, text=True, check=True)
    few, before_kib, many, after_kib = map(int, done.stdout.split())
    assert many > 100 * few
    assert many * 48 / 1024 > 25_000  # KiB that the samples of command and response alone would take
    assert after_kib - before_kib < 12_000


def test_vibration_is_that_of_the_playback() -> None:
    figures = paper_region().figures
    simulated = paper_samples()[3]
    np.testing.assert_allclose(figures.rest.residual_mm, simulated.residual_mm, rtol=5e-3, atol=1e-9)
    peaks = np.max([section.peak_mm for section in figures.sections], axis=0)
    np.testing.assert_allclose(peaks, simulated.peak_mm, rtol=0.05, atol=1e-9)
    assert [section.rest is None for section in figures.sections] == [True, True, False]


def test_settling_lies_within_half_a_wave_of_the_envelope() -> None:
    rest = paper_region().figures.rest
    for axis, frequency_hz in ((0, 46.0), (1, 131.0)):
        envelope = math.log(rest.residual_mm[axis] / 1e-3) / (0.02 * 2 * math.pi * frequency_hz)
        assert envelope - 1 / frequency_hz < rest.settling_s[axis] < envelope + 1 / frequency_hz + 2e-3
    assert rest.settling_s[2] == 0.0


def test_random_programs_keep_what_the_playback_says() -> None:
    generator = random.Random(8)
    machine = sg.Machine.load("vx500")
    for _ in range(6):
        x, y, moves = 0.0, 0.0, []
        for _ in range(8):
            dx, dy = generator.uniform(-20, 20), generator.uniform(3, 20)
            word = generator.choice(["G01", "G02", "G03"])
            x, y = round(x + dx, 3), round(y + dy, 3)
            size = f"R{math.ceil(math.hypot(dx, dy)):d}." if word != "G01" else ""
            moves.append(f"{word}X{x:.3f}Y{y:.3f}{size}F{generator.choice([1500, 6000])}.")
        text = program(moves, machine)
        measured = sg.measure(text, machine, 4.0)
        figures = measured.programs[0].regions[0].figures
        simulated = MachineModel(machine).simulate_original(text.regions[0].path)
        assert figures.duration_s == pytest.approx(simulated.duration_s)
        assert figures.response.max_abs_mm == pytest.approx(simulated.response.max_abs_mm, abs=1e-6)
        assert sum(section.section.length_mm for section in figures.sections) == pytest.approx(
            text.regions[0].path.length_mm
        )
        assert max(section.response.most_positive_mm for section in figures.sections) == pytest.approx(
            simulated.response.most_positive_mm, abs=1e-6
        )


def shaped(feed: float, contour: str) -> tuple[sg.Program, sg.Program, sg.Machine]:
    machine = machine_with({"shaping.contour": contour, "tolerance.contour_um": 50.0})
    original = path_program(feed, machine)
    return original, sg.convert(original, machine, arc_feed_ratio=0.99).emitted, machine


def test_a_shaped_program_is_measured_against_the_original() -> None:
    original, emitted, machine = shaped(200.0, "off")
    both = sg.measure([original, emitted], machine, TOOL_MM)
    named = sg.measure(emitted, machine, TOOL_MM, against=original)
    alone = sg.measure(emitted, machine, TOOL_MM)
    assert [each.shaped for each in both.programs] == [False, True]
    assert both.programs[1].measured_against == named.programs[0].measured_against == original.source
    assert both.programs[1].contour_error_um == named.programs[0].contour_error_um
    # Its own path hides what the shaper did to the programmed one.
    assert alone.programs[0].measured_against == emitted.source
    hidden, seen = (each.programs[0].contour_error_um.response.max for each in (alone, named))
    assert hidden < 0.6 * seen
    assert [section.section.kind.name for section in both.programs[1].regions[-1].figures.sections] == [
        "line", "arc", "line",
    ]  # fmt: skip


def test_sections_by_lines() -> None:
    machine = sg.Machine.load("vx500")
    original = path_program(200.0, machine)
    measured = sg.measure(original, machine, TOOL_MM, lines=[(9, 9), (10, 12)])
    (region,) = measured.programs[0].regions
    assert [each.section.kind.name for each in region.figures.sections] == ["arc", "line"]
    whole = paper_region().figures.sections[1]
    assert found(region.figures.sections[0].response_arc).fit.radius_mm == found(whole.response_arc).fit.radius_mm
    with pytest.raises(sg.ArgumentError, match="no cutting move in lines 200-300"):
        sg.measure(original, machine, TOOL_MM, lines=[(200, 300)])


def test_refusals() -> None:
    machine = sg.Machine.load("vx500")
    original = path_program(200.0, machine)
    other = program(["G01X30.F3000."], machine)
    for arguments, message in (
        ({"programs": []}, "no program"),
        ({"tool_diameter_mm": 0.0}, "tool diameter is 0 mm"),
        ({"tool_diameter_mm": 2e3}, "tool diameter is 2000 mm, must be at most 1000 mm"),
        ({"station_spacing_mm": 1e-4}, "station spacing is 0.0001 mm, must be at least 0.001 mm"),
        ({"station_spacing_mm": math.nan}, "station spacing is nan mm"),
        ({"band_um": 0.0}, "band is 0 mm, must be finite and above 0"),
        ({"cutoff_mm": -1.0}, "cut-off is -1 mm"),
        ({"against": other}, "no cut from X0.000 Y0.000 Z0.000 to X30.000"),
        ({"lines": [(9, 8)]}, "first must not be behind the last"),
    ):
        chosen: dict[str, Any] = {"programs": original, "tool_diameter_mm": TOOL_MM} | arguments
        with pytest.raises(sg.ArgumentError, match=re.escape(message)):
            sg.measure(machine=machine, **chosen)
    path = paper_samples()[2]
    with pytest.raises(sg.ArgumentError, match="differ in length"):
        metrology = _core.SectionMetrology(path, _core.path_sections(path), _core.MetrologyOptions())
        metrology.feed(np.zeros((3, 3)), np.zeros((4, 3)))


def test_a_spacing_that_a_long_path_cannot_have_is_said() -> None:
    machine = sg.Machine.load("vx500")
    (measured,) = sg.measure(program(["G01X30000.F15000."], machine), machine, TOOL_MM).programs
    # 30 m of path, at most 500 000 stations.
    assert any("walls are measured every 0.06 mm, not every 0.05 mm" in warning for warning in measured.warnings)


def test_a_program_without_cuts_measures_nothing() -> None:
    machine = sg.Machine.load("vx500")
    with pytest.raises(sg.ArgumentError, match="no cutting move, nothing to measure"):
        sg.measure(program(["G00X10."], machine), machine, TOOL_MM)


def test_walls_are_drawn_into_the_callers_axes() -> None:
    original, emitted, machine = shaped(200.0, "off")
    measurement = sg.measure([original, emitted], machine, TOOL_MM)
    assert list(measurement.plots()) == ["measure-part", "measure-walls"]
    figure = plot.figure(16, 8)
    left, right = figure.subplots(1, 2)
    part, walls = sg.plot_part(measurement, left), measurement.plots()["measure-walls"](right)
    figure.draw_without_rendering()
    assert part.get_window_extent().x1 < walls.get_window_extent().x0
    # The first curve is the left wall of the original, gaps between sections included.
    drawn = np.concatenate([line.get_ydata() for line in walls.get_lines()[:1]])
    expected = [each.wall_deviation_um.left for each in measurement.programs[0].sections]
    assert np.nanmax(drawn) == pytest.approx(max(each.max or 0.0 for each in expected), abs=1e-9)
    assert np.nanmin(drawn) == pytest.approx(min(each.min or 0.0 for each in expected), abs=1e-9)


def test_without_walls_there_is_nothing_to_draw() -> None:
    machine = sg.Machine.load("vx500")
    plunge = sg.measure(program(["G01Z-5.F600."], machine), machine, TOOL_MM)
    assert plunge.plots() == {}
    with pytest.raises(ValueError, match="no walls were measured"):
        sg.plot_walls(plunge)


def specimen(feed: int, name: str) -> MeasuredRegion:
    found: MeasuredRegion = run_page("evidence/paper000.md")["cases"][feed, name]
    return found


def arc_of(region: MeasuredRegion) -> FittedCircle:
    arc = region.sections[1].arc
    assert arc.response is not None
    return arc.response


def test_the_band_narrows_and_the_radius_moves_as_the_model_must() -> None:
    unshaped, ideal = specimen(200, "unshaped"), specimen(200, "shaped 1 %, paper's shaper")
    kept = specimen(200, "contour-preserving")
    bands = [row.sections[1].wall_deviation_um.left.band or 0.0 for row in (unshaped, ideal, kept)]
    assert bands[0] == pytest.approx(49.0, abs=1.0)
    assert bands[1] == pytest.approx(24.0, abs=1.0)
    assert bands[2] < 12.0
    radii = [arc_of(row).radius_deviation_um for row in (unshaped, ideal)]
    assert radii[0] == pytest.approx(20.0, abs=2.0)
    assert radii[1] == pytest.approx(-13.0, abs=1.0)
    # Mean radius of both axes' magnification of a circle: each has its own mode.
    for feed in (100, 200):
        arc = arc_of(specimen(feed, "unshaped"))
        gains = [1.0 / (1.0 - (feed / 20.0 / (2 * math.pi * f)) ** 2) for f in (46.0, 131.0)]
        assert arc.mean_radius_deviation_um == pytest.approx((sum(gains) / 2 - 1) * 20e3, rel=0.05)


def test_what_the_page_says_of_radius_width_and_roughness() -> None:
    page = run_page("evidence/paper000.md")
    for (feed, name), region in page["cases"].items():
        line, arc, out = region.sections
        off_um = 1e3 * (arc.arc.inside_wall.fitted_radius_mm - 18.5)
        assert 2.0 < off_um < 20.0 if name == "unshaped" else -22.0 < off_um < -1.0, (feed, name)
        assert line.roughness.left.ra_um < 0.03  # it vibrates along the cut there
        limit_um = 40.0 if name == "unshaped" else 2.0
        assert max(map(page["off_um"], region.sections)) < limit_um
        if name != "unshaped":
            unshaped = specimen(feed, "unshaped").sections
            assert arc.roughness.left.ra_um < 0.47 * unshaped[1].roughness.left.ra_um
            assert out.roughness.left.ra_um < 0.1 * unshaped[2].roughness.left.ra_um
            assert out.residual_vibration_um.x < 0.2 and out.residual_vibration_um.y < 0.2
    assert {name for _, name in page["PUBLISHED_MM"]} < {name for _, name in page["cases"]}
