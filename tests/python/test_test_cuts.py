"""Test cuts as programs: what they cut, and what is told from records of them; through the command."""

import json
import math
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import cut_reference as reference
import shapegcode as sg
from judge.interpreter import interpret
from shapegcode import _core
from shapegcode.cli import main
from shapegcode.cutting.tool import Tool
from shapegcode.io.units import FloatArray
from shapegcode.results import plot
from shapegcode.results.json import schema

RADIUS, AXIAL, SPINDLE, FLUTES = 4.0, 15.0, 1800.0, 6
FINE = 0.004  # of what is tried point by point, mm
TOOL = """
[tool]
name = "EM8"
diameter_mm = 8.0
flutes = 6
helix_deg = 50.0
flute_length_mm = 20.0
overhang_mm = 30.0

[cutting]
specific_n_per_mm2 = 221.3
specific_exponent = -0.153
ratio = 0.41
ratio_exponent = -0.0775
"""
# What a user may have before the test.
OTHER = TOOL.replace("221.3", "300.0").replace("-0.153", "-0.2").replace("0.41", "0.3")


def write(folder: Path, kind: str, *options: str, tool: str = TOOL) -> dict[str, Any]:
    """Write a test cut; its side file."""
    (folder / "tool.toml").write_text(tool, encoding="utf-8")
    given = ["-m", "vx500", "--tool", str(folder / "tool.toml"), "-S", "1800", "-a", "15", "-F", "216"]
    assert main(["testcut", kind, *given, *options, "-o", str(folder / "CUT.NC")]) == 0
    side: dict[str, Any] = json.loads((folder / "CUT.json").read_text(encoding="utf-8"))
    return side


# What the programs cut -------------------------------------------------------------------------------------------


def moves(text: str) -> list[list[tuple[float, float, float, float]]]:
    """Lines that are cut at depth, as x, y to x, y; a new list begins at each M00."""
    parts: list[list[tuple[float, float, float, float]]] = [[]]
    for record in interpret(text).lines:
        if record.text.startswith("M00"):
            parts.append([])
        for move in record.moves:
            if move.start[2] < 0.0 and move.end[2] < 0.0:
                assert move.is_cut, f"rapid in the material: {record.text}"
                parts[-1].append((*move.start[:2], *move.end[:2]))
    return parts


def edge_behind(lines: list[tuple[float, float, float, float]], x: FloatArray, side: float) -> FloatArray:
    """Outermost height of the material at each X that circles along lines leave; *side* -1: material towards -Y."""
    centres = np.vstack(
        [np.linspace((a, b), (c, d), max(2, math.ceil(math.hypot(c - a, d - b) / 0.01) + 1)) for a, b, c, d in lines]
    )
    order = np.argsort(centres[:, 0])
    cx, cy = centres[order, 0], -side * centres[order, 1]
    height = np.empty(len(x))
    bounds = np.searchsorted(cx, np.column_stack([x - RADIUS, x + RADIUS]))
    for k, (at, (low, high)) in enumerate(zip(x, bounds, strict=True)):
        height[k] = np.min(cy[low:high] - np.sqrt(np.maximum(RADIUS**2 - (cx[low:high] - at) ** 2, 0.0)))
    return height


def radial_depths(program: Path, number: int, at: FloatArray, side: float = -1.0) -> FloatArray:
    """Radial depth that a measuring pass meets, from all moves before it."""
    parts = moves(program.read_text(encoding="utf-8"))
    before = [line for part in parts[: 2 * number - 1] for line in part]
    ((_, yc, _, _),) = parts[2 * number - 1][:1]
    axis = -side * yc
    grid = np.arange(at.min() - 0.02, at.max() + RADIUS + 0.02, FINE)
    edge = edge_behind(before, grid, side) - (axis - RADIUS)
    return radial_depths_of(lambda x: np.interp(x, grid, edge), at)


def radial_depths_of(edge: Callable[[FloatArray], FloatArray], at: FloatArray) -> FloatArray:
    """Height of the first point at which the front of the tool comes out of an edge, its wall at height 0."""
    found = np.empty(len(at))
    u = np.arange(0.0, RADIUS, FINE)
    circle = RADIUS - np.sqrt(RADIUS**2 - u**2)
    for k, x in enumerate(at):
        above = circle - edge(x + u)
        first = int(np.argmax(above > 0.0))
        share = above[first - 1] / (above[first - 1] - above[first])
        place = u[first - 1] + share * FINE
        found[k] = RADIUS - math.sqrt(RADIUS**2 - place**2)
    return found


@pytest.mark.parametrize("up", [False, True])
def test_the_taper_has_the_radial_depth_that_is_wanted(tmp_path: Path, up: bool) -> None:
    write(tmp_path, "taper", *(["--up"] if up else []))
    at = np.arange(1.0, 54.0, 2.3)
    # The circle of the tool against the line 0.4 + 0.04 x, from the wall: (1 + m²) u² + 2 m c u + c² - R² = 0.
    m, c = 0.04, 0.4 + 0.04 * at - RADIUS
    u = (-m * c + np.sqrt((m * c) ** 2 - (1 + m * m) * (c * c - RADIUS**2))) / (1 + m * m)
    wanted = RADIUS - np.sqrt(RADIUS**2 - u**2)
    for number in (1, 3):
        met = radial_depths(tmp_path / "CUT.NC", number, at, side=1.0 if up else -1.0)
        np.testing.assert_allclose(met, wanted, atol=1e-3)
    assert wanted.max() < 2.8 < radial_depths(tmp_path / "CUT.NC", 1, np.array([57.0]), side=1.0 if up else -1.0)[0]


def test_the_unrolled_corner_has_the_corners_radial_depth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    side = write(tmp_path, "corner")
    about = side["about"]
    assert about["radial_depth_mm"]["max"] == pytest.approx(2.103, abs=1e-3)
    feeds = [feed for _, feed in side["passes"][1]["feeds"]]
    assert min(feeds) == pytest.approx(90.8, abs=0.05)  # paper 001: 91
    assert {feed for _, feed in side["passes"][0]["feeds"]} == {216.0}
    deeper = about["deeper_than_corner"]
    out = " ".join(capsys.readouterr().out.split())
    assert re.search(r"up to 0\.2[12]\d mm deeper than the corner", out)
    at = np.arange(2.0, 34.0, 0.11)
    corner = _core.CornerCut(4.0, 8.0, 8.0, 0.8, before_mm=40.0, after_mm=40.0)
    # The tool's front, sqrt(4² - 3.2²) = 2.4 before its axis, reaches the rough arc 8.8 before the corner of the walls;
    # the path's arc begins 8 before it, at 40.
    begins = 40.0 - (8.8 + 2.4 - 8.0)
    wanted = np.array([corner.at(x - about["corner_begins_at_mm"] + begins).radial_depth_mm for x in at])
    met = radial_depths(tmp_path / "CUT.NC", 2, at)
    same = (at < deeper["from_mm"] - 0.02) | (at > deeper["to_mm"] + 0.02)
    np.testing.assert_allclose(met[same], wanted[same], atol=1e-3)
    # Elsewhere the round tool leaves more, as the side file says.
    assert np.all(met[~same] >= wanted[~same] - 1e-3)
    assert np.max(met - wanted) == pytest.approx(deeper["most_mm"], abs=0.01)
    each = side["passes"][1]
    described = radial_depths_of(lambda x: np.interp(x, each["edge_x_mm"], each["edge_height_mm"]), at)
    np.testing.assert_allclose(met, described, atol=1e-3)


def test_the_interval_test_has_one_radial_depth_and_the_corners_feeds(tmp_path: Path) -> None:
    side = write(tmp_path, "interval")
    at = np.arange(1.0, 40.0, 3.0)
    for number, step in ((1, 0.2), (3, 0.6)):
        np.testing.assert_allclose(radial_depths(tmp_path / "CUT.NC", number, at), 0.8, atol=1e-3)
        ends = np.array([end for end, _ in side["passes"][number - 1]["feeds"]])
        np.testing.assert_allclose(np.diff(ends[:-1]), step, atol=1.1e-3)
        assert min(feed for _, feed in side["passes"][number - 1]["feeds"]) == pytest.approx(90.8, abs=0.15)
    own = write(tmp_path, "interval", "--intervals", "0.5", "--feeds", "100,200,100")
    assert own["passes"][0]["feeds"][1:-1] == [[16.5, 100.0], [17.0, 200.0], [17.5, 100.0]]


@pytest.mark.parametrize("kind", ["taper", "corner", "interval"])
def test_the_programs_raise_nothing(tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, kind)
    text = (tmp_path / "CUT.NC").read_text(encoding="utf-8")
    assert main(["check", str(tmp_path / "CUT.NC"), "-m", "vx500"]) == 0
    assert "0 alarms, 0 warnings, 0 notes" in capsys.readouterr().out
    assert text.isascii()
    assert max(map(len, text.splitlines())) <= 60
    head = text[: text.index("G21")]
    for said in ("ZERO G54", "STOCK:", "2220 HZ", "TOOL IN SPINDLE: D8 MM, 6 FLUTES", "KEEP IT FREE OF CLAMPS"):
        assert said in head


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("corner", "--rough-radius", "4", "--finish-radius", "4"), "cannot be unrolled on a straight line"),
        (("corner", "--rough-radius", "8", "--finish-radius", "4"), "cannot be unrolled on a straight line"),
        (("taper", "--radial-depth", "0.4:3.9"), "at most 3.8 mm"),
        (("taper", "--length", "5"), "too short for a taper of 2.4 mm"),
        (("taper", "-a", "25"), "the flutes are 20 mm long"),
        (("taper", "-F", "99999"), "this machine allows 1 to 15000 mm/min"),
    ],
)
def test_what_cannot_be_cut_is_refused(
    tmp_path: Path, options: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "tool.toml").write_text(TOOL, encoding="utf-8")
    given = ["-m", "vx500", "--tool", str(tmp_path / "tool.toml"), "-S", "1800", "-o", str(tmp_path / "CUT.NC")]
    given += [] if "-a" in options else ["-a", "15"]
    given += [] if "-F" in options else ["-F", "216"]
    assert main(["testcut", options[0], *given, *options[1:]]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "CUT.NC").exists()


# What records tell -----------------------------------------------------------------------------------------------


def simulated(
    each: dict[str, Any],
    edge: Callable[[FloatArray], FloatArray],
    *,
    rate: float = 1013.0,
    noise: float = 0.05,
    override: float = 1.0,
    spindle: float = SPINDLE,
    lag_s: float = 0.0,
    runout: tuple[float, ...] = (),
    seed: int = 1,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time, X and forces on the work piece of one pass, with offset, drift and noise of a dynamometer."""
    rng = np.random.default_rng(seed)
    way = reference.lagging_way([(end, feed * override) for end, feed in each["feeds"]], each["start_mm"], lag_s)
    wait = 0.4
    times = np.arange(0.0, way[-1, 0] + 2.0 * wait, 1.0 / rate)
    speed = np.gradient(way[:, 1], way[:, 0]) * 60.0
    x = np.interp(times - wait, way[:, 0], way[:, 1])
    length = each["edge_x_mm"][-1]
    force = reference.record(
        lambda t: np.interp(t - wait, way[:, 0], way[:, 1]),
        lambda place: reference.met_by_circle(edge, place, RADIUS, length),
        times,
        feed_mm_per_min=lambda place: np.interp(place, way[:, 1], speed),
        spindle=spindle,
        diameter=2.0 * RADIUS,
        flutes=FLUTES,
        helix_deg=50.0,
        axial_mm=AXIAL,
        law=reference.PAPER,
        runout_mm=runout,
        slices=8,
    )
    force *= 1.0 + noise * rng.standard_normal(force.shape)
    force += [18.0, -7.0] + np.outer(times / times[-1], [9.0, 4.0]) + 0.3 * rng.standard_normal(force.shape)
    return times, x, -force


def saved(path: Path, **columns: FloatArray) -> str:
    path.write_text(reference.rows(columns), encoding="utf-8")
    return str(path)


def taper_edge(x: FloatArray) -> FloatArray:
    return 0.4 + 2.4 / 40.0 * x


def fitted(folder: Path, *arguments: str, code: int = 0) -> dict[str, Any]:
    report = folder / "report.json"
    assert main(["testcut", "fit", *arguments, "--cut", str(folder / "CUT.json"), "--json", str(report)]) == code
    found: dict[str, Any] = json.loads(report.read_text(encoding="utf-8"))
    jsonschema.validate(
        found, schema({"taper": sg.TaperResult, "corner": sg.CornerResult}.get(found["kind"], sg.IntervalResult))
    )
    assert found["ok"] is (code == 0)
    assert (found["program"], found["machine"]) == ("CUT.NC", "VX500")
    return found


def test_the_taper_gives_the_coefficients_behind_its_records(tmp_path: Path) -> None:
    side = write(tmp_path, "taper", "--length", "40", "-F", "216,432,864", tool=OTHER)
    files = []
    for k, each in enumerate(side["passes"]):
        runout = (0.002, -0.001, 0.0015, -0.0025, 0.0005, -0.0005)
        time, _, force = simulated(each, taper_edge, override=0.9, spindle=1782.0, runout=runout, seed=k)
        files.append(saved(tmp_path / f"{k}.csv", time_s=time, fx_n=force[:, 0], fy_n=force[:, 1]))
    report = fitted(tmp_path, *files, "-o", str(tmp_path / "cutting.toml"), "--plots", str(tmp_path / "plots"))
    found = {each["name"]: each for each in report["coefficients"]}
    for name, true in reference.PAPER.items():
        each = found[name]
        allowed = 0.01 if name.endswith("exponent") else 0.03 * true
        assert abs(each["value"] - true) < allowed, each
        assert each["low"] < true < each["high"], each
    assert [each["feed_mm_per_min"] for each in report["passes"]] == pytest.approx([194.4, 388.8, 777.6], rel=2e-3)
    assert [each["spindle_rev_per_min"] for each in report["passes"]] == pytest.approx([1782.0] * 3, rel=2e-3)
    assert any("the feed was" in note for note in report["warnings"])
    assert report["left_out"] == []
    assert report["next_step"].startswith("put [cutting]") and "-o FILE" not in report["next_step"]
    text = (tmp_path / "cutting.toml").read_text(encoding="utf-8")
    tool = Tool.from_toml(TOOL.partition("[cutting]")[0] + text)
    assert tool.coefficients().specific_exponent == pytest.approx(found["specific_exponent"]["value"], rel=1e-5)
    assert {file.name for file in (tmp_path / "plots").iterdir()} == {
        f"testcut-{name}{suffix}" for name in ("forces", "coefficients") for suffix in (".png", ".svg")
    }


def test_chatter_is_left_out_and_told(tmp_path: Path) -> None:
    side = write(tmp_path, "taper", "--length", "40", "-F", "432,864")
    files = []
    for k, each in enumerate(side["passes"]):
        time, x, force = simulated(each, taper_edge, rate=1913.0, noise=0.02, seed=k)
        if k == 0:
            swing = (x > 22.0) & (x < 27.0)
            force[swing] *= 1.0 + 1.5 * np.sin(2.0 * math.pi * 760.0 * time[swing])[:, None]
        files.append(saved(tmp_path / f"{k}.csv", time_s=time, fx_n=force[:, 0], fy_n=force[:, 1]))
    report = fitted(tmp_path, *files)
    stretches = report["left_out"]
    assert {each["number"] for each in stretches} == {1}
    assert min(each["from_mm"] for each in stretches) == pytest.approx(22.0, abs=1.0)
    assert max(each["to_mm"] for each in stretches) == pytest.approx(27.0, abs=1.0)
    assert abs(report["cutting"]["specific_exponent"] + 0.153) < 0.01


def test_another_override_is_refused_where_the_feed_changes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    side = write(tmp_path, "corner")
    time, _, force = simulated(side["passes"][1], corner_edge(side), override=0.9)
    file = saved(tmp_path / "a.csv", time_s=time, fx_n=force[:, 0], fy_n=force[:, 1])
    assert main(["testcut", "fit", f"2={file}", "--cut", str(tmp_path / "CUT.json")]) == 2
    assert "was the feed override 100 %?" in capsys.readouterr().err


def test_samples_in_step_with_the_teeth_are_told(tmp_path: Path) -> None:
    side = write(tmp_path, "corner")
    time, _, force = simulated(side["passes"][0], corner_edge(side), rate=900.0, noise=0.02)
    file = saved(tmp_path / "a.csv", time_s=time, fx_n=force[:, 0], fy_n=force[:, 1])
    assert any("5.0 samples per tooth" in note for note in fitted(tmp_path, file)["warnings"])


def mean_rows(depth: FloatArray, feed: float, noise: float, seed: int) -> FloatArray:
    """Mean force on the work piece at radial depths."""
    begin, end = reference.climb_arc(depth, RADIUS)
    force = reference.mean_force(begin, end, feed / SPINDLE / FLUTES, FLUTES, AXIAL, reference.PAPER)
    return -force * (1.0 + noise * np.random.default_rng(seed).standard_normal(force.shape))


def test_tables_of_means_are_read_too(tmp_path: Path) -> None:
    write(tmp_path, "taper", "-F", "108,432", tool=OTHER)
    depth = np.linspace(0.4, 2.8, 200)
    first = mean_rows(depth, 108.0, 0.05, 1)
    second = mean_rows(depth, 432.0, 0.05, 2)
    text = "Rd [mm];Fx [kN];Fy [kN]\n" + "\n".join(
        f"{d:.4f};{fx / 1000:.6f};{fy / 1000:.6f}".replace(".", ",") for d, (fx, fy) in zip(depth, first, strict=True)
    )
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    other = saved(tmp_path / "b.csv", radial_depth_mm=depth, fx_n=-second[:, 0], fy_n=-second[:, 1])
    on_tool = saved(tmp_path / "c.csv", radial_depth_mm=depth, fx_n=-first[:, 0], fy_n=-first[:, 1])
    report = fitted(tmp_path, on_tool, other, "--forces-on", "tool")
    same = fitted(tmp_path, str(tmp_path / "a.csv"), code=1)
    assert abs(report["cutting"]["specific_exponent"] + 0.153) < 0.01
    assert report["cutting"]["specific_n_per_mm2"] == pytest.approx(221.3, rel=0.03)
    # One feed alone tells less, and that is said.
    assert any("is known only to +-" in text for text in same["poor"])
    assert abs(same["at_chip"][0]["value"] / (221.3 * same["chip_mm"]["middle"] ** -0.153) - 1.0) < 0.02


def test_means_at_positions_are_laid_over_the_taper(tmp_path: Path) -> None:
    side = write(tmp_path, "taper", "--length", "40", "-F", "216,864")
    files = []
    for k, each in enumerate(side["passes"]):
        x = np.arange(0.5, 35.0, each["feeds"][0][1] / SPINDLE)
        begin, end = reference.met_by_circle(taper_edge, x, RADIUS, 40.0)
        pitch = each["feeds"][0][1] / SPINDLE / FLUTES
        force = -reference.mean_force(begin, end, pitch, FLUTES, AXIAL, reference.PAPER)
        torque = pitch * FLUTES * (np.sin(end) - np.sin(begin)) * AXIAL / (2.0 * math.pi) * RADIUS * 1e-3
        torque *= 221.3 * reference.mean_chip(begin, end, pitch) ** -0.153
        files.append(saved(tmp_path / f"{k}.csv", position_mm=x, fx_n=force[:, 0], fy_n=force[:, 1], torque_nm=-torque))
    cutting = fitted(tmp_path, *files)["cutting"]
    for name, true in reference.PAPER.items():
        assert cutting[name] == pytest.approx(true, rel=5e-3)


def test_the_api_does_what_the_command_does(tmp_path: Path) -> None:
    """Designs, programs, side files and fits are the same, and the plots draw into axes of one's own."""
    side = write(tmp_path, "taper", "-F", "108,432")
    given = sg.CutConditions(sg.Machine.load("vx500"), sg.Tool.from_toml(TOOL), 108.0, AXIAL, SPINDLE)
    design = sg.write_test_cut(sg.taper_cut(given, [108.0, 432.0]), tmp_path / "API.NC")
    assert (tmp_path / "API.NC").read_bytes() == (tmp_path / "CUT.NC").read_bytes()
    assert json.loads((tmp_path / "API.json").read_text(encoding="utf-8")) == {**side, "program": "API.NC"}
    assert sg.read_test_cut(tmp_path / "API.json") == design.cut
    assert repr(design).startswith("<CutDesign: taper for VX500: 2 measuring passes, ")
    assert design.next_step.endswith(f"pass1.csv pass2.csv --cut {tmp_path / 'API.json'}")
    jsonschema.validate(design.to_dict(), schema(sg.CutDesign))
    depth = np.linspace(0.4, 2.8, 40)
    files = {}
    for number, feed in ((2, 432.0), (1, 108.0)):
        force = mean_rows(depth, feed, 0.03, number)
        files[number] = saved(tmp_path / f"{number}.csv", radial_depth_mm=depth, fx_n=force[:, 0], fy_n=force[:, 1])
    found = sg.fit_test_cut(design.cut, files)
    assert isinstance(found, sg.TaperResult)
    report = fitted(tmp_path, f"2={files[2]}", f"1={files[1]}", code=found.exit_code)
    assert report.pop("provenance")["result"] == "TaperResult"
    assert report == {**found.to_dict(), "program": "CUT.NC"}
    assert tomllib.loads(found.to_toml())["cutting"]["chip_thickness"] == "mean"
    assert max(map(len, str(found.tables()[0]).splitlines())) <= 80
    whole = plot.figure(8.0, 4.0)
    drawn = [draw(ax) for draw, ax in zip(found.plots().values(), whole.subplots(1, 2), strict=True)]
    assert all(panel.figure.figure is whole for panel in drawn)
    assert [panel.get_ylabel() for panel in drawn] == ["along the feed in N", "k1 in N/mm²"]
    with pytest.raises(sg.ArgumentError, match="the radial depth must increase"):
        sg.taper_cut(given, None, (0.8, 0.8))
    with pytest.raises(sg.ArgumentError, match="state the spindle speed"):
        sg.taper_cut(sg.CutConditions(given.machine, given.tool, 108.0, AXIAL))


def test_the_table_is_not_written_over_a_tool_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, "taper", "-F", "108,432")
    depth = np.linspace(0.4, 2.8, 40)
    force = mean_rows(depth, 108.0, 0.0, 0)
    file = saved(tmp_path / "a.csv", radial_depth_mm=depth, fx_n=force[:, 0], fy_n=force[:, 1])
    tool = tmp_path / "tool.toml"
    assert main(["testcut", "fit", file, "--cut", str(tmp_path / "CUT.json"), "-o", str(tool)]) == 2
    assert "contains more than [cutting] (tool), which would be lost" in capsys.readouterr().err
    assert tool.read_text(encoding="utf-8") == TOOL


def corner_edge(side: dict[str, Any]) -> Callable[[FloatArray], FloatArray]:
    each = side["passes"][0]
    return lambda x: np.interp(x, each["edge_x_mm"], each["edge_height_mm"])


def test_the_corner_shows_what_the_modified_feed_does(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    side = write(tmp_path, "corner")
    files = []
    for k, each in enumerate(side["passes"]):
        time, _, force = simulated(each, corner_edge(side), noise=0.02, seed=k)
        files.append(saved(tmp_path / f"{k}.csv", time_s=time, fx_n=1.2 * force[:, 0], fy_n=1.2 * force[:, 1]))
    report = fitted(tmp_path, *files, "--plots", str(tmp_path / "plots"))
    # The work piece was harder than the coefficients say.
    assert report["scale"] == pytest.approx(1.2, rel=0.02)
    assert report["ratio"]["measured"] == pytest.approx(report["ratio"]["expected"], rel=0.05)
    assert 0.4 < report["ratio"]["measured"] < 0.6  # paper 001: about half
    first = report["peaks"][0]
    assert first["measured_mean_n"] == pytest.approx(1.2 * first["expected_mean_n"], rel=0.04)
    assert re.search(r"is 1\.(19|20|21) times the expected", capsys.readouterr().out)
    assert (tmp_path / "plots" / "testcut-corner.svg").exists()


def interval_files(folder: Path, lag_s: float, *, position: bool = False) -> list[str]:
    side = write(folder, "interval")
    files = []
    for k, each in enumerate(side["passes"]):
        time, x, force = simulated(each, lambda x: np.full(len(x), 0.8), rate=2219.0, noise=0.03, lag_s=lag_s, seed=k)
        place = {"position_mm": x} if position else {}
        files.append(saved(folder / f"{k}.csv", time_s=time, **place, fx_n=force[:, 0], fy_n=force[:, 1]))
    return files


def test_a_controller_that_follows_at_once_follows_every_interval(tmp_path: Path) -> None:
    report = fitted(tmp_path, *interval_files(tmp_path, 0.0))
    assert report["interval_mm"] == 0.2
    assert all(each["lag_s"] < 0.02 for each in report["passes"])


@pytest.mark.parametrize("position", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_lagging_controller_needs_longer_intervals(tmp_path: Path, position: bool) -> None:
    report = fitted(tmp_path, *interval_files(tmp_path, 0.1, position=position), "--plots", str(tmp_path / "plots"))
    assert report["interval_mm"] in (0.4, 0.6)
    assert not report["passes"][0]["ok"]
    for each in report["passes"]:
        assert each["lag_s"] == pytest.approx(0.1, rel=0.35)
    assert (tmp_path / "plots" / "testcut-interval.png").exists()


def test_where_no_interval_is_followed_none_is_proposed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = fitted(tmp_path, *interval_files(tmp_path, 0.4), code=1)
    assert report["interval_mm"] is None
    assert report["lag_interval_mm"] > 0.6
    assert "the control follows none of the measured intervals" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,fx_n\n0,1\n1,2\n2,3\n3,4\n", "no column of fy"),
        ("fx_n,fy_n\n0,1\n1,2\n2,3\n3,4\n", "no column of time, position or radial_depth"),
        ("time_s,fx_n,fy_n\n0,1,1\n1,2,2\n2,3,1\n3,4,1\n4,x,1\n", ":6: column 2 (fx_n) 'x' is not a finite number"),
        ("radial_depth_mm,fx_n,fy_n\n0.4,1,1\n0.5,2,2\n", "2 rows of numbers: too short; required: at least 4"),
        ("position_mm,fx_n,fy_n\n1,1,1\n2,1,2\n1.5,3,1\n3,4,1\n4,4,1\n", ":4: the position decreases"),
        ("radial_depth_mm,fx_n,fy_n\n" + "9,1,1\n" * 9, "must be above 0 and below the diameter"),
        ("time_s,fx_n,fy_n\n" + "\n".join(f"{k},1,1" for k in range(20)), "means over time have no position"),
        ("time_s,fx_n,fy_n\n" + "\n".join(f"{k / 60:.6f},1,1" for k in range(90)), "2.0 samples per revolution"),
        ("time_s,fx_n,fy_n\n" + "\n".join(f"{k / 600:.6f},1,1" for k in range(2000)), "no cut found"),
    ],
)
def test_bad_records_are_refused(tmp_path: Path, text: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, "taper")
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    assert main(["testcut", "fit", str(tmp_path / "a.csv"), "--cut", str(tmp_path / "CUT.json")]) == 2
    assert said in capsys.readouterr().err


def test_bad_arguments_of_the_fit_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, "corner")
    depth = np.linspace(0.4, 2.8, 20)
    force = mean_rows(depth, 216.0, 0.0, 0)
    file = saved(tmp_path / "a.csv", radial_depth_mm=depth, fx_n=force[:, 0], fy_n=force[:, 1])
    cut = ["--cut", str(tmp_path / "CUT.json")]
    for arguments, said in (
        ([f"3={file}", *cut], "pass 3: the test cut has 2 passes"),
        ([file, f"1={file}", *cut], "pass 1 is given twice"),
        ([file, *cut, "--edge-forces"], "edge forces and chip thickness are for a taper"),
        ([file, *cut, "-o", str(tmp_path / "c.toml")], "describes a corner: -o only with a taper"),
        ([file, "--cut", file], "not valid JSON"),
        ([file, *cut, "--json", file], "would overwrite"),
        ([file, *cut], "a table of means: a corner needs"),
    ):
        assert main(["testcut", "fit", *arguments]) == 2
        assert said in capsys.readouterr().err
    side = json.loads((tmp_path / "CUT.json").read_text(encoding="utf-8"))
    for key, value, said in (
        ("passes", [], "passes: Tuple should have at least 1 item"),
        ("kind", "bore", "kind: Input should be 'taper', 'corner' or 'interval'"),
        ("kind", "taper", "the parameters in 'about' are not of a taper"),
        ("axial_depth_mm", 0.0, "axial_depth_mm: Input should be greater than 0"),
        ("spindle_rev_per_min", None, "spindle_rev_per_min: Input should be a valid number"),
        ("passes", [{**side["passes"][0], "start_mm": 9.0}], "pass 1: edge, feeds and ends are inconsistent"),
        ("format", 1, "not the side file of a test cut"),
    ):
        (tmp_path / "bad.json").write_text(json.dumps({**side, key: value}), encoding="utf-8")
        assert main(["testcut", "fit", file, "--cut", str(tmp_path / "bad.json")]) == 2
        assert said in capsys.readouterr().err


def test_the_table_for_the_tool_file_names_its_range(tmp_path: Path) -> None:
    write(tmp_path, "taper", "-F", "108,432")
    depth = np.linspace(0.4, 2.8, 40)
    files = []
    for name, feed in (("a", 108.0), ("b", 432.0)):
        force = mean_rows(depth, feed, 0.0, 0)
        files.append(saved(tmp_path / f"{name}.csv", radial_depth_mm=depth, fx_n=force[:, 0], fy_n=force[:, 1]))
    fitted(tmp_path, *files, "-o", str(tmp_path / "c.toml"))
    text = (tmp_path / "c.toml").read_text(encoding="utf-8")
    table = tomllib.loads(text)["cutting"]
    assert table.pop("chip_thickness") == "mean"
    assert table == pytest.approx(reference.PAPER, rel=1e-3)
    thin = reference.mean_chip(*reference.climb_arc(depth[:1], RADIUS), 108.0 / SPINDLE / FLUTES)[0]
    assert f"{thin:.4f}" in text
