"""The command as a shell sees it: exit codes, files, JSON."""

import argparse
import json
import os
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import shapegcode as sg
from acceptance import PROGRAMS
from command import run, run_process
from shapegcode.cli import COMMANDS, convert
from shapegcode.cli.options import load_machine, overridden
from shapegcode.results.json import schema

ROOT = Path(__file__).resolve().parents[2]
GOOD = "%\nO1\nG21G17G90G94\nG0X0Y0Z0\nG1X20.F12000\nG3X40.Y20.R20.\nG1Y40.\nG0Z50.\nM30\n%\n"
AXES = {"x", "y", "z"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "part.nc").write_text(GOOD)
    return tmp_path


def files(folder: Path) -> list[str]:
    return sorted(os.listdir(folder))


def test_convert_writes_the_program_of_the_api(folder: Path) -> None:
    done = run_process(folder, "convert", "part.nc", "-m", "vx500", "-o", "out.nc")
    assert (done.returncode, done.stderr) == (0, "")
    assert files(folder) == ["out.nc", "part.nc"]
    assert (folder / "out.nc").read_bytes() == sg.convert(GOOD, "vx500").text
    assert (folder / "part.nc").read_text() == GOOD
    for said in ("cycle time", "residual vibration X", "worth running", "next: ", "wrote out.nc"):
        assert said in done.stdout


def check_report(report: dict[str, Any]) -> None:
    """What the schema does not say."""
    jsonschema.validate(report, schema(sg.Conversion))
    for track in ("command", "response"):
        for figures in report["contour_error_um"][track].values():
            assert 0.0 <= figures["rms"] <= figures["max"]
    assert len(report["shaper"]["times_s"]) == len(report["shaper"]["amplitudes"]) > 1
    assert sum(report["shaper"]["amplitudes"]) == pytest.approx(1.0)
    assert report["within_tolerance"] is report["ok"]


def test_json_file(folder: Path) -> None:
    done = run(folder, "convert", "part.nc", "-m", "vx500", "-o", "out.nc", "--json", "report.json")
    assert done.returncode == 0
    report = json.loads((folder / "report.json").read_text())
    check_report(report)
    assert len(report["orbit_error_percent"]) == 1
    assert report["bytes_emitted"] == (folder / "out.nc").stat().st_size
    assert report["blocks"]["read"] == 8
    assert report["output"] == "out.nc"
    assert report["within_tolerance"]
    overrides = [each["override"] for each in report["override_residual"]]
    assert overrides == sorted(overrides) and overrides[0] <= 0.8 and overrides[-1] >= 1.2
    assert report["cycle_time_s"]["emitted"] > report["cycle_time_s"]["original"] > 0.7


def test_json_on_standard_output_is_all_there_is(folder: Path) -> None:
    done = run(folder, "convert", "part.nc", "-m", "vx500", "-o", "out.nc", "--json", "-")
    assert (done.returncode, done.stderr) == (0, "")
    check_report(json.loads(done.stdout))


def test_report_of_a_program_without_cuts(folder: Path) -> None:
    (folder / "air.nc").write_text("%\nG90G21\nG0X10.Y0Z0\nM30\n%\n")
    done = run(folder, "convert", "air.nc", "-m", "vx500", "-o", "out.nc", "--json", "-")
    assert done.returncode == 0
    report = json.loads(done.stdout)
    check_report(report)
    assert report["blocks"]["emitted"] == 0
    assert (folder / "out.nc").read_bytes() == (folder / "air.nc").read_bytes()
    assert run(folder, "convert", "air.nc", "-m", "vx500", "-o", "out.nc", "--plots", "plots").returncode == 0


def test_plots_are_png_and_svg(folder: Path) -> None:
    done = run(folder, "convert", "part.nc", "-m", "vx500", "-o", "out.nc", "--plots", "a/b", "--json", "r.json")
    assert (done.returncode, done.stderr) == (0, "")
    names = files(folder / "a" / "b")
    assert names == sorted(
        f"{name}.{kind}" for name in ("path", "feed", "tolerance", "vibration") for kind in ("png", "svg")
    )
    for name in names:
        begin = (folder / "a" / "b" / name).read_bytes()[:200]
        assert begin.startswith(b"\x89PNG" if name.endswith("png") else b"<?xml")
    listed = json.loads((folder / "r.json").read_text())["plots"]
    assert sorted(Path(path).name for path in listed) == names


def test_out_of_tolerance_gets_the_suffix_and_exit_code_1(folder: Path) -> None:
    words = ("convert", "part.nc", "-m", "vx500", "-o", "out.nc", "--shape-all", "--json", "r.json")
    # A contour of the command that the original keeps, and no program with words of 1 um can.
    strict = ("--contour", "command", "--contour-tolerance", "0.4um", "--max-time-increase", "1e5",
              "--max-cut-time-increase", "1e5")  # fmt: skip
    done = run(folder, *words, *strict)
    assert done.returncode == 1
    assert files(folder) == ["out.nc.out-of-tolerance", "part.nc", "r.json"]
    report = json.loads((folder / "r.json").read_text())
    check_report(report)
    assert report["within_tolerance"] is False
    assert report["output"] == "out.nc.out-of-tolerance"
    assert any("contour error" in w and "limit" in w for w in report["warnings"])
    assert "OUT OF TOLERANCE" in done.stdout
    assert "do not run it" in done.stdout
    other = run(folder, *words, *strict, "--set", "emission.failed_suffix=.bad")
    assert other.returncode == 1
    assert "out.nc.bad" in files(folder)


def test_options_change_the_result(folder: Path) -> None:
    def report(*words: str) -> dict[str, Any]:
        done = run(folder, "convert", "part.nc", "-m", "vx500", "-o", "out.nc", "--json", "-", *words)
        assert done.returncode in (0, 1), done.stderr
        return dict(json.loads(done.stdout))

    plain = report()
    slow = report("--arc-feed", "60%", "--max-time-increase", "100", "--max-cut-time-increase", "100")
    assert slow["cycle_time_s"]["emitted"] > plain["cycle_time_s"]["emitted"] + 0.1
    assert slow["orbit_error_percent"][0] < plain["orbit_error_percent"][0]
    coarse = report("--block-period", "8ms")
    assert coarse["block_period_s"] == 0.008
    assert report("--set", "emission.block_period_s=0.008")["shaper"] == coarse["shaper"]
    bare = report("--set", "emission.header=false")
    assert bare["bytes_emitted"] < plain["bytes_emitted"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "key", "value"),
    [
        ("--contour-tolerance 5um", "tolerance.contour_um", 5.0),
        ("--contour-tolerance 0.03mm", "tolerance.contour_um", 30.0),
        ("--contour off", "shaping.contour", "off"),
        ("--shaper zvd", "shaping.family", "zvd"),
        ("--per-axis", "shaping.per_axis", True),
        ("--set shaping.rapids=true --no-shape-rapids", "shaping.rapids", False),
        ("--part-mass 120", "shaping.part_mass_kg", 120.0),
        ("--compensation expand", "input.compensation", "expand"),
    ],
)
def test_options_that_stand_for_a_key_of_the_machine(words: str, key: str, value: object) -> None:
    parser = argparse.ArgumentParser()
    convert.CONVERT.declare(parser)
    args = parser.parse_args(["in.nc", "-m", "vx500", "-o", "out.nc", *words.split()])
    machine = sg.Machine.load("vx500")
    assert overridden(load_machine(args), args, convert.MACHINE_KEYS) == machine.with_values(key, value)
    assert key in {word for action in parser._actions for word in (action.help or "").split()}


@pytest.mark.slow
def test_sample_with_a_setting_it_needs(folder: Path) -> None:
    bottle = PROGRAMS / "BOTTLE.NC"
    refused = run(folder, "convert", bottle, "-m", "vx500", "-o", "out.nc")
    assert refused.returncode == 2
    assert 'input.arc_centre = "absolute"' in refused.stderr
    done = run(folder, "convert", bottle, "-m", "vx500", "-o", "out.nc", "--set", "input.arc_centre=absolute")
    assert done.returncode == 0, done.stderr
    assert (folder / "out.nc").stat().st_size > bottle.stat().st_size


def test_output_goes_through_links_and_keeps_permissions(folder: Path) -> None:
    (folder / "real.nc").write_text("old")
    (folder / "real.nc").chmod(0o640)
    (folder / "out.nc").symlink_to("real.nc")
    assert run(folder, "convert", "part.nc", "-m", "vx500", "-o", "out.nc").returncode == 0
    assert (folder / "out.nc").is_symlink()
    assert (folder / "real.nc").stat().st_mode & 0o777 == 0o640
    assert (folder / "real.nc").read_text().startswith("%\nO1\n(SHAPEGCODE")


def test_simulate_says_of_a_shaped_program_what_convert_said(folder: Path) -> None:
    converted = run(folder, "convert", "part.nc", "-m", "vx500", "-o", "out.nc", "--json", "-")
    promised = json.loads(converted.stdout)
    before = json.loads(run(folder, "simulate", "part.nc", "-m", "vx500", "--json", "-").stdout)
    after = json.loads(run(folder, "simulate", "out.nc", "-m", "vx500", "--shaped", "--json", "-").stdout)
    for axis in AXES:
        original, emitted = (promised["residual_vibration_um"][which][axis] for which in ("original", "emitted"))
        assert before["residual_vibration_um"][axis] == pytest.approx(original)
        assert after["residual_vibration_um"][axis] == pytest.approx(emitted, abs=1e-9)
    assert before["cycle_time_s"] == pytest.approx(promised["cycle_time_s"]["original"])
    assert after["cycle_time_s"] == pytest.approx(promised["cycle_time_s"]["emitted"], abs=1e-9)
    keys = {"cycle_time_s", "residual_vibration_um", "peak_vibration_um", "contour_error_um", "orbit_error_percent"}
    assert set(before) == set(after) >= keys | {"warnings"}


def test_simulate_writes_plots_and_prints_a_table(folder: Path) -> None:
    done = run(folder, "simulate", "part.nc", "-m", "vx500", "--plots", "plots")
    assert (done.returncode, done.stderr) == (0, "")
    assert len(files(folder / "plots")) == 8
    assert done.stdout.startswith("part.nc takes 0.80 s on VX500, ")
    assert "residual vibration µm" in done.stdout
    assert files(folder) == ["part.nc", "plots"]


def test_expand(folder: Path) -> None:
    (folder / "main.nc").write_text("%\nO1\nG21G17G90G94\nG0X0Y0Z0\nM98P2\nM30\nO2\nG1X10.F600\nM99\n%\n")
    done = run(folder, "expand", "main.nc", "-m", "vx500", "-o", "plain.nc", "--json", "e.json")
    assert (done.returncode, done.stderr) == (0, "")
    assert "expanded" in done.stdout.splitlines()[0]
    plain = (folder / "plain.nc").read_bytes()
    assert b"M98" not in plain
    assert plain == sg.expand(folder / "main.nc", "vx500").text == sg.Program.read(folder / "main.nc").expanded_text
    report = json.loads((folder / "e.json").read_text())
    jsonschema.validate(report, schema(sg.Expansion))
    assert report["size_bytes"] == len(plain)
    assert [8, ""] in report["origins"]
    piped = run_process(folder, "expand", "main.nc", "-m", "vx500", "-o", "-")
    assert (piped.returncode, piped.stdout) == (0, plain.decode())
    unchanged = run(folder, "expand", "part.nc", "-m", "vx500", "-o", "same.nc")
    assert "unchanged" in unchanged.stdout
    assert (folder / "same.nc").read_text() == GOOD
    for words in (("-o", "main.nc"), ("-o", "-", "--json", "-"), ("-o", "x.nc", "--json", "x.nc")):
        refused = run(folder, "expand", "main.nc", "-m", "vx500", *words)
        assert (refused.returncode, refused.stdout) == (2, ""), words
    assert files(folder) == ["e.json", "main.nc", "part.nc", "plain.nc", "same.nc"]


def test_demo_path(folder: Path) -> None:
    done = run(folder, "demo", "path", "--json", "-")
    assert (done.returncode, done.stderr) == (0, "")
    result = json.loads(done.stdout)
    assert len(result["conditions"]) == 4
    for row in result["conditions"]:
        for which in ("ideal", "emitted"):
            assert row[which]["orbit_error_percent"] >= 0.0 < row[which]["time_s"]
            assert set(row[which]["residual_vibration_um"]) == AXES
        assert row["published_orbit_error_percent"] > 0.0
    table = run(folder, "demo", "path")
    assert table.returncode == 0
    assert "0.0270" in table.stdout
    assert files(folder) == ["part.nc"]


def test_demo_of_another_paper_names_its_page(folder: Path) -> None:
    for name in ("corner", "shaper", "tap", "cycle-time", "metrology", "evidence"):
        done = run(folder, "demo", name)
        assert (done.returncode, done.stdout) == (2, "")
        page = re.search(r"docs/evidence/\w+\.md", done.stderr)
        assert page and (ROOT / page[0]).is_file()


@pytest.mark.parametrize(
    "words",
    ["", "nothing", "convert", "convert part.nc", "demo nothing", "convert --bogus", "machine", "machine show a b"],
)
def test_wrong_usage_is_exit_code_2(folder: Path, words: str) -> None:
    done = run(folder, *words.split())
    assert done.returncode == 2
    assert done.stdout == ""
    assert "usage: shapegcode" in done.stderr
    assert files(folder) == ["part.nc"]


@pytest.mark.parametrize("command", ["convert", "simulate", "time", "machine", "demo"])
def test_help(folder: Path, command: str) -> None:
    done = run(folder, command, "--help", COLUMNS="100")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"usage: shapegcode {command}")
    assert all(each in run(folder, "--help").stdout for each in COMMANDS)


def test_version_and_debug(folder: Path) -> None:
    assert re.fullmatch(r"shapegcode \d+\.\d+\.\d+\S*\n", run_process(folder, "--version").stdout)
    traced = run_process(folder, "--debug", "convert", "nothing.nc", "-m", "vx500", "-o", "out.nc")
    assert "Traceback" in traced.stderr
