"""Cycle time: paper 004's equations by hand, the same by every set-point, and the command that shows both."""

import csv
import dataclasses
import io
import json
import math
import os
import random
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from page_code import run_page

import shapegcode as sg
from acceptance import PROGRAMS, machine_with
from effort import cpu_s
from shapegcode.cli import main
from shapegcode.results.json import schema
from shapegcode.timing import cycle_time as timing

TICK_S = 0.001
RATE = 10_000 / 60  # mm/s
SETS = ((0.150, 0.030, 0.050), (0.100, 0.020, 0.100))  # rapid, bell of the rapid, cutting
WAITS_S = {"X": 0.025, "Y": 0.025, "Z": 0.12}
PARTS = ("cutting_s", "rapid_s", "in_position_s", "dwell_s", "acceleration_s", "tool_change_s", "function_s")
HAND = """%
O1
G21 G17 G90 G94
G00 X0. Y0. Z0.
T1 M06
G00 X0. Y0. Z0.
G00 X100.
G00 Z-10.
G01 X110. F1000.
Y0.5
X112.345
G04 X1.5
T2 M06
M30
%
"""


def paper_004() -> dict[str, Any]:
    return run_page("evidence/paper004.md")


def timed(text: str, machine: sg.Machine | None = None, **options: Any) -> sg.CycleTime:
    machine = machine or sg.Machine.load("kimm004")
    return sg.cycle_time(text, machine, **options)


def ticks(seconds: float) -> float:
    """The next whole interpolation period; what ends on one to within rounding ends there."""
    return math.ceil(seconds / TICK_S - 1e-7) * TICK_S


def rapid_s(way_mm: float, rate: float, ramp_s: float, bell_s: float) -> float:
    """Paper 004, eq. 13 to 16: `way_mm` is the length (linear) or the longest axis' (non-linear)."""
    acceleration = rate / ramp_s
    if way_mm / rate >= ramp_s:
        return ticks(way_mm / rate) + ramp_s + bell_s
    return 2.0 * ticks(math.sqrt(way_mm / acceleration)) + bell_s


def test_a_tiny_program_by_hand() -> None:
    """Rapids .600 + .150 + .030 and 2 * .095 + .030; cuts .600 + .030 + .141, overlapped, and .050 once."""
    time = timed(HAND)
    assert time.cycle_time_s == pytest.approx((0.780 + 0.025) + (0.220 + 0.120) + (0.771 + 0.050) + 1.5, abs=1e-9)
    assert time.cutting_s == pytest.approx(0.771, abs=1e-9)
    assert time.rapid_s == pytest.approx(0.600 + 0.060, abs=1e-9)
    assert time.acceleration_s == pytest.approx(0.180 + 0.160 + 0.050, abs=1e-9)
    assert time.in_position_s == pytest.approx(0.025 + 0.120, abs=1e-9)
    assert time.dwell_s == pytest.approx(1.5, abs=1e-9)
    assert time.full_interpolation_s == pytest.approx(time.cycle_time_s, abs=1e-9)
    assert [region.lines for region in time.regions] == [(9, 11)]
    assert time.regions[0].duration_s == pytest.approx(0.821, abs=1e-9)
    assert time.regions[0].programmed_s == pytest.approx(12.845 / (1000 / 60), abs=1e-9)
    assert time.regions[0].start_s == pytest.approx(0.805 + 0.340, abs=1e-9)


def test_the_second_set_of_constants_by_hand() -> None:
    """Rapids .600 + .120 and 2 * .078 + .020; the run ends .100 later."""
    time = timed(HAND, paper_004()["testbed"](*SETS[1]))
    assert time.cycle_time_s == pytest.approx((0.720 + 0.025) + (0.176 + 0.120) + (0.771 + 0.100) + 1.5, abs=1e-9)


def test_overrides_by_hand() -> None:
    """Half the feed: 1200 + 60 + 282 ms. Half the rapid rate at the same acceleration: ramps of 75 ms."""
    slow = timed(HAND, feed_override=0.5)
    assert slow.cutting_s == pytest.approx(1.542, abs=1e-9)
    assert slow.cycle_time_s == pytest.approx(timed(HAND).cycle_time_s + 0.771, abs=1e-9)
    lame = timed(HAND, rapid_override=0.5)
    assert lame.rapid_s == pytest.approx(1.200 + 0.120, abs=1e-9)
    assert lame.cycle_time_s == pytest.approx((1.305 + 0.025) + (0.225 + 0.120) + 0.821 + 1.5, abs=1e-9)
    for each in (slow, lame):
        assert each.full_interpolation_s == pytest.approx(each.cycle_time_s, abs=1e-9)


@pytest.mark.parametrize(("path", "way_mm"), [("linear", 40.0), ("non_linear", 40.0)])
def test_a_slanted_rapid_is_limited_by_its_longest_axis(path: str, way_mm: float) -> None:
    """X 30, Y 40: straight or not, Y goes at its rate (eq. 8; FANUC's straight rapid keeps every axis within 1420)."""
    machine = machine_with({"controller.rapid_path": path}, "kimm004")
    time = timed("%\nO1\nG90G21\nG0X0Y0Z0\nG0X30.Y40.\nM30\n%\n", machine)
    assert time.cycle_time_s == pytest.approx(rapid_s(way_mm, RATE, 0.15, 0.03) + 0.025, abs=1e-9)


@pytest.mark.parametrize("constants", SETS)
@pytest.mark.parametrize("seed", range(8))
def test_random_programs_after_the_equations_of_the_paper(constants: tuple[float, float, float], seed: int) -> None:
    """Rapids, cuts of every length and dwells in any order, against eq. 2 to 16 and the overlap of section 2.2."""
    ramp_s, bell_s, cut_s = constants
    draw = random.Random(seed)
    lines, place = ["%", "O1", "G21 G90 G17 G94", "G0 X0 Y0 Z0"], dict.fromkeys("XYZ", 0.0)
    expected, run = 0.0, False
    for _ in range(150):
        kind = draw.choice(("cut", "cut", "cut", "cut", "rapid", "dwell"))
        if kind != "cut" and run:
            expected, run = expected + cut_s, False
        if kind == "dwell":
            wait = draw.randint(1, 900)
            lines.append(f"G04 P{wait}")
            expected += wait * 1e-3
            continue
        axis = draw.choice("XYZ")
        way = round(draw.choice((-1, 1)) * 10.0 ** draw.uniform(-2.0, 2.0), 3)
        place[axis] = round(place[axis] + way, 3)
        if kind == "rapid":
            lines.append(f"G00 {axis}{place[axis]:.3f}")
            expected += rapid_s(abs(way), RATE, ramp_s, bell_s) + WAITS_S[axis]
        else:
            feed = draw.randint(50, 6000)
            lines.append(f"G01 {axis}{place[axis]:.3f} F{feed}.")
            expected += ticks(abs(way) / (feed / 60.0))
            run = True
    expected += cut_s if run else 0.0
    time = timed("\n".join([*lines, "M30", "%"]) + "\n", paper_004()["testbed"](*constants), per_block=True)
    assert time.cycle_time_s == pytest.approx(expected, abs=1e-6)
    assert time.full_interpolation_s == pytest.approx(expected, abs=1e-6)
    assert sum(block.duration_s for block in time.blocks) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("constants", SETS)
def test_closed_form_and_full_interpolation_agree_on_the_test_piece(constants: tuple[float, float, float]) -> None:
    time = timed(paper_004()["piece"], paper_004()["testbed"](*constants))
    assert time.cycle_time_s > 1800.0
    assert abs(time.difference_percent) <= 0.5
    assert [tool.tool for tool in time.tools] == [1, 2, 3, 4, 5, 6, 7, 8]


def check_sums(time: sg.CycleTime) -> None:
    assert sum(getattr(time, part) for part in PARTS) == pytest.approx(time.cycle_time_s, abs=1e-6)
    for part in PARTS:
        assert sum(getattr(tool, part) for tool in time.tools) == pytest.approx(getattr(time, part), abs=1e-6)
    assert sum(tool.duration_s for tool in time.tools) == pytest.approx(time.cycle_time_s, abs=1e-6)
    assert sum(block.duration_s for block in time.blocks) == pytest.approx(time.cycle_time_s, abs=1e-6)
    ends = [block.start_s + block.duration_s for block in time.blocks]
    starts = [block.start_s for block in time.blocks]
    assert starts == pytest.approx([0.0, *ends[:-1]], abs=1e-6)
    for region in time.regions:
        inside = [b for b in time.blocks if b.kind == "cutting" and region.lines[0] <= b.line <= region.lines[1]]
        assert sum(b.length_mm for b in inside) == pytest.approx(region.length_mm, abs=1e-6)
        parts = region.cutting_s + region.acceleration_s + region.in_position_s
        assert region.duration_s == pytest.approx(parts, abs=1e-9)


@pytest.mark.parametrize("machine_name", ["vx500", "kimm004"])
def test_blocks_tools_and_regions_add_up(machine_name: str) -> None:
    machine = sg.Machine.load(machine_name)
    for text in (paper_004()["piece"], (PROGRAMS / "PARALLEL.NC").read_text(), (PROGRAMS / "G83.NC").read_text()):
        program = sg.Program.from_text(text, machine)
        time = sg.cycle_time(program, machine, per_block=True, full=False)
        check_sums(time)
        fastest = 0.0
        for block in time.blocks:
            if block.kind == "cutting" and block.length_mm > 0.0:
                assert 0.0 < block.reached_feed_mm_per_min <= block.programmed_feed_mm_per_min * (1 + 1e-9)
                assert block.mean_feed_mm_per_min <= block.reached_feed_mm_per_min * (1 + 1e-6)
            fastest = max(fastest, block.reached_feed_mm_per_min if block.kind == "rapid" else 0.0)
        assert fastest <= math.sqrt(3.0) * max(axis.rapid_mm_per_min for axis in machine.axes.as_tuple())
        # A cutting move is in the table once, with the length of the program's own path.
        cut = sum(block.length_mm for block in time.blocks if block.kind == "cutting")
        own = sum(region.path.length_mm for region in program.regions)
        kept = [segment for segment, dwell in program.core.other_moves if dwell <= 0.0 and segment.feed_mm_per_s > 0.0]
        assert cut == pytest.approx(own + sum(segment.length_mm for segment in kept), abs=1e-6)


def test_a_tool_that_comes_back_is_one_row() -> None:
    body = "G0X0Y0Z0\nT1M6\nG0X0Y0Z0\nG1X10.F600.\nT2M6\nG0X0Y0Z0\nG1X20.\nT1M6\nG0X0Y0Z0\nG1X30.\n"
    time = timed(f"%\nO1\nG21G17G90G94\n{body}M30\n%\n")
    assert [(tool.tool, tool.first_line) for tool in time.tools] == [(1, 5), (2, 8)]
    assert [tool.cutting_s for tool in time.tools] == pytest.approx([1.0 + 3.0, 2.0], abs=1e-9)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "part.nc").write_text(HAND)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    code = main(["time", *words])
    out, err = capsys.readouterr()
    return code, out, err


def test_json_has_its_keys(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "part.nc", "-m", "kimm004", "--json", "-")
    assert (code, err) == (0, "")
    data = json.loads(out)
    jsonschema.validate(data, schema(sg.CycleTime))
    assert data["blocks"] == []
    assert data["cycle_time_s"] == pytest.approx(3.466, abs=1e-9)
    assert data["full_interpolation_s"] == pytest.approx(3.466, abs=1e-9)
    assert data["program"] == "part.nc"
    assert data["machine"] == "kimm004"
    assert data["regions"][0]["lines"] == [9, 11]
    assert data["tools"][0]["tool"] == 1
    code, out, _ = run(capsys, "part.nc", "-m", "kimm004", "--json", "-", "--blocks", "--no-full")
    data = json.loads(out)
    jsonschema.validate(data, schema(sg.CycleTime))
    assert (data["full_interpolation_s"], data["difference_percent"]) == (None, None)
    assert [block["kind"] for block in data["blocks"]] == [
        "tool_change", "rapid", "rapid", "cutting", "cutting", "cutting", "dwell", "tool_change", "function",
    ]  # fmt: skip


def test_csv_is_the_blocks(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "part.nc", "-m", "kimm004", "--csv", "blocks.csv", "--json", "time.json", "--blocks")
    assert (code, err) == (0, "")
    assert "next: " in out
    rows = list(csv.DictReader(io.StringIO((folder / "blocks.csv").read_text())))
    data = json.loads((folder / "time.json").read_text())
    assert sum(float(row["duration_s"]) for row in rows) == pytest.approx(data["cycle_time_s"], abs=1e-5)
    assert [int(row["line"]) for row in rows] == [block["line"] for block in data["blocks"]]
    cut = [row for row in rows if row["kind"] == "cutting"]
    assert [float(row["programmed_feed_mm_per_min"]) for row in cut] == [1000.0] * 3
    assert [float(row["length_mm"]) for row in cut] == pytest.approx([10.0, 0.5, 2.345])
    # The last block of a run has the run's acceleration: .141 + .050.
    assert [float(row["duration_s"]) for row in cut] == pytest.approx([0.600, 0.030, 0.191])
    code, out, _ = run(capsys, "part.nc", "-m", "kimm004", "--csv", "-")
    assert code == 0
    assert out == (folder / "blocks.csv").read_text()


def test_the_table_says_where_the_time_goes(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "part.nc", "-m", "kimm004", "--override", "50%", "--rapid-override", "0.5")
    assert (code, err) == (0, "")
    for said in (
        "cycle time", "lost to acceleration", "in-position", "tool change", "T1", "9 to 11", "full interpolation",
        "count 0 s on this machine (3 in the program)", "next: ",
    ):  # fmt: skip
        assert said in out
    _, out, _ = run(capsys, "part.nc", "-m", "kimm004", "--set", "times.tool_change_s=5.8")
    assert "1 of 3 tool changes and M codes count 0 s on this machine" in out, "M30 alone"
    code, out, _ = run(capsys, "part.nc", "-m", "kimm004", "--set", "controller.time_constant_s=0.1", "--no-full")
    assert code == 0
    assert "3.516" in out
    assert "full interpolation" not in out


def test_pictures(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "part.nc", "-m", "kimm004", "--plots", "plots")[0] == 0
    assert sorted(os.listdir(folder / "plots")) == ["time.png", "time.svg"]
    assert (folder / "plots" / "time.png").read_bytes().startswith(b"\x89PNG")
    drawing = (folder / "plots" / "time.svg").read_text(encoding="utf-8")
    for said in ("Parts of the time: 3.5 s on kimm004", "lines 9 to 11, T1", "lost to acceleration"):
        assert said in drawing


def test_a_program_that_takes_no_time(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "empty.nc").write_text("%\nO1\nM30\n%\n")
    code, out, err = run(capsys, "empty.nc", "-m", "kimm004", "--plots", "plots", "--csv", "b.csv", "--json", "t.json")
    assert (code, err) == (0, "")
    assert "nothing in the program takes time" in out
    assert not (folder / "plots").exists()
    assert json.loads((folder / "t.json").read_text())["difference_percent"] == 0.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("no.nc", "no.nc: no such file"),
        ("part.nc --set controller.nothing=1", "nothing"),
        ("part.nc --override 0", "above 0 and at most 254%"),
        ("part.nc --override 255%", "above 0 and at most 254%"),
        ("part.nc --rapid-override 101%", "above 0 and at most 100%"),
        ("part.nc --override fast", "is not a number"),
        ("part.nc --csv - --json -", "only one of them"),
        ("part.nc --csv part.nc", "would overwrite"),
        ("part.nc --csv x --json x", "would overwrite"),
        ("part.nc --csv no/x.csv", "no/x.csv: the folder no does not exist"),
        ("bad.nc", "bad.nc:3:"),
    ],
)
def test_bad_input(folder: Path, capsys: pytest.CaptureFixture[str], words: str, said: str) -> None:
    (folder / "bad.nc").write_text("%\nO1\nG01 X1.\nM30\n%\n")
    code, _, err = run(capsys, *words.split(), "-m", "kimm004")
    assert code == 2
    assert said in err
    assert (folder / "part.nc").read_text() == HAND


def test_a_difference_is_an_exit_code(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    time = timed(HAND)
    # Just inside and just outside of 0.5 %.
    assert dataclasses.replace(time, full_interpolation_s=time.cycle_time_s / 1.00499).ok
    wrong = dataclasses.replace(time, full_interpolation_s=time.cycle_time_s / 0.99499)
    assert not wrong.ok
    assert "trust the full interpolation" in wrong.next_step
    monkeypatch.setattr(timing, "cycle_time", lambda *_, **__: wrong)
    code, out, _ = run(capsys, "part.nc", "-m", "kimm004")
    assert code == 1
    assert "-0.50 %" in out


def test_short_blocks_that_are_rounded_up_are_named() -> None:
    """0.02 mm at 1000 mm/min are 1.2 ms, which take 2."""
    steps = "".join(f"X{0.02 * k:.2f}\n" for k in range(1, 1001))
    time = timed(f"%\nO1\nG21G17G90G94\nG0X0Y0Z0\nG1F1000.\n{steps}M30\n%\n")
    assert time.cycle_time_s == pytest.approx(2.05, abs=1e-9)
    assert "1.67 times its time by feed" in time.next_step


def test_the_closed_form_of_half_an_hour_does_not_play_it() -> None:
    """The paper's own claim is less than a second for more than half an hour."""
    machine = paper_004()["testbed"](*SETS[0])
    program = sg.Program.from_text(paper_004()["piece"], machine)
    played_s = cpu_s(lambda: sg.cycle_time(program, machine), 1)
    assert cpu_s(lambda: sg.cycle_time(program, machine, full=False)) < 0.25 * played_s


def test_the_page_shows_both_sets_beside_the_paper() -> None:
    page = paper_004()
    assert list(page["published"].values()) == [(2172.4, 2169.1), (2172.0, 2157.3)]
    first, second = (time for time, _ in page["times"].values())
    for time, computing_s in page["times"].values():
        assert abs(time.difference_percent) <= 0.5
        assert 0.0 < computing_s < 1.0  # the paper's limit
        assert time.cycle_time_s > 1800.0
    # What does not accelerate does not change.
    for part in ("cutting_s", "rapid_s", "in_position_s", "dwell_s"):
        assert getattr(first, part) == pytest.approx(getattr(second, part), abs=1e-6)


def test_an_override_that_the_program_switches_off_is_told(tmp_path: Path) -> None:
    (tmp_path / "part.nc").write_text("%\nO0001\nG21 G90 G17\nG00 X0 Y0 Z5.\nG01 X40. F4000.\nY40.\nM30\n%\n")
    for override, expected in (("lock", 1), ("ask", 0)):
        machine = sg.Machine.load("vx500").with_values({"emission.override": override})
        text = sg.convert(tmp_path / "part.nc", machine, shape_all=True).text
        program = sg.Program.from_text(text, machine)

        def said(program: sg.Program, machine: sg.Machine, feed: float) -> int:
            warnings = sg.cycle_time(program, machine, feed_override=feed).warnings
            return sum("switches the feed override off in its shaped regions (1)" in each for each in warnings)

        assert said(program, machine, 0.8) == expected
        assert said(program, machine, 1.0) == 0
