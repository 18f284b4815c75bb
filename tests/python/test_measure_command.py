"""`shapegcode measure` as a shell sees it: tables, JSON, pictures, exit codes."""

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import shapegcode as sg
from acceptance import machine_with
from command import run
from shapegcode.cli import main
from shapegcode.results.json import schema

LINES = "%\nO1\nG21G17G90G94\nG0X0Y0Z0\nG1X20.F12000\nG3X40.Y20.R20.\nG1Y40.\nG0Z50.\nM30\n%\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.nc").write_text(LINES)
    (tmp_path / "shaped.nc").write_bytes(sg.convert(LINES, machine_with({"tolerance.contour_um": 50.0})).text)
    return tmp_path


def measured(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> dict[str, Any]:
    assert main(["measure", *words, "-m", "vx500", "--tool-diameter", "3mm", "--json", "-"]) == code
    report: dict[str, Any] = json.loads(capsys.readouterr().out)
    jsonschema.validate(report, schema(sg.Measurement))
    assert report["ok"] is (code == 0)
    return report


def told(folder: Path, *words: str, code: int = 0, machine: str = "vx500", width: str = "80") -> str:
    """What the command prints."""
    done = run(folder, "measure", *words, "-m", machine, "--tool-diameter", "3mm", COLUMNS=width)
    assert done.returncode == code, done.stderr
    return done.stdout


def test_json_of_two_programs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = measured(capsys, "part.nc", "shaped.nc", "--set", "tolerance.contour_um=50")
    part, shaped = report["programs"]
    assert (part["shaped"], shaped["shaped"]) == (False, True)
    assert part["measured_against"] == shaped["measured_against"] == "part.nc"
    for program in (part, shaped):
        assert [section["kind"] for section in program["sections"]] == ["line", "arc", "line"]
        assert [section["lines"] for section in program["sections"]] == [[5, 5], [6, 6], [7, 7]]
        assert program["sections"][0]["residual_vibration_um"] is None
        assert program["sections"][1]["arc"]["inside_wall"]["nominal_radius_mm"] == 18.5
        assert program["sections"][0]["arc"] is None
        assert program["sections"][2]["width_mm"]["nominal"] == 3.0
    band = [program["sections"][1]["wall_deviation_um"]["left"]["band"] for program in (part, shaped)]
    assert band[1] < 0.5 * band[0]
    residual = [program["sections"][2]["residual_vibration_um"]["x"] for program in (part, shaped)]
    assert residual[1] < 0.05 * residual[0]
    assert shaped["contour_error_um"]["response"]["max"] == pytest.approx(
        max(section["contour_error_um"]["response"]["max"] for section in shaped["sections"])
    )


def test_exit_code_says_whether_the_tolerance_is_kept(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert measured(capsys, "part.nc", code=1)["programs"][0]["ok"] is False  # 42 um of 20
    report = measured(capsys, "part.nc", "--set", "tolerance.contour_um=50")
    assert (report["programs"][0]["ok"], report["contour_tolerance_um"]) == (True, 50.0)
    assert measured(capsys, "shaped.nc", "--against", "part.nc")["programs"][0]["ok"] is True
    # The original beside a shaped program is there to compare with.
    report = measured(capsys, "part.nc", "shaped.nc")
    assert [each["ok"] for each in report["programs"]] == [None, True]
    report = measured(capsys, "part.nc", "shaped.nc", "--set", "tolerance.contour_um=2", code=1)
    assert [each["ok"] for each in report["programs"]] == [None, False]


def test_table_like_a_measuring_report(folder: Path) -> None:
    said = told(folder, "part.nc", "shaped.nc", "--plots", "plots", width="120")
    for text in (
        "2 arc R20, line 6", "inside wall mm (deviation µm)", "18.500", "cut-width band left / right µm",
        "Ra left / right µm", "settled to 1 µm X / Y / Z ms", "next: ",
        "part.nc: simulated with the controller's own motion, measured against its own path, to compare with",
        "shaped.nc: within tolerance: deviates from the path by up to",
        "pictures: plots/measure-part.png, plots/measure-walls.png",
        "shaped.nc: simulated block by block, as a shaped program, measured against the path of part.nc",
    ):  # fmt: skip
        assert text in said, text
    written = {file.name for file in (folder / "plots").iterdir()}
    assert written == {f"measure-{name}.{suffix}" for name in ("part", "walls") for suffix in ("png", "svg")}
    picture = (folder / "plots" / "measure-part.svg").read_text()
    assert "deviations magnified" in picture
    assert "shaped.nc" in picture


def test_deviations_along_z_are_above_and_below(folder: Path) -> None:
    # A mode of Z alone, a cut along X and a ramp: what Z does is neither left nor right.
    (folder / "ramp.nc").write_text("%\nO1\nG21G17G90G94\nG0X0Y0Z0\nG1X10.F3000\nX20.Z-5.\nX30.\nM30\n%\n")
    modes = [{"frequency_hz": 30.0, "damping_ratio": 0.02}]
    other = sg.Machine.load("vx500").with_values({"axes.z.modes": modes, "axes.x.modes": []})
    (folder / "z.toml").write_text(other.to_toml())
    said = told(
        folder, "ramp.nc", "--set", "tolerance.contour_um=500", "--json", "z.json", machine="z.toml", width="120"
    )
    assert "above / below µm" in said
    assert "peak vibration X / Y / Z µm" in said
    last = json.loads((folder / "z.json").read_text())["programs"][0]["sections"][2]
    contour = last["contour_error_um"]["response"]
    assert (contour["left"], contour["right"]) == (0.0, 0.0)
    # On a level line the deviation is what Z oscillates.
    assert contour["max"] == pytest.approx(max(contour["above"], contour["below"]))
    assert contour["max"] == pytest.approx(last["peak_vibration_um"]["z"], rel=0.05)
    assert last["peak_vibration_um"]["z"] > 1.0


def test_exit_code_1_is_explained(folder: Path) -> None:
    said = told(folder, "part.nc", "--json", "m.json", code=1)
    largest = json.loads((folder / "m.json").read_text())["programs"][0]["contour_error_um"]["response"]["max"]
    assert (
        f"part.nc: OUT OF TOLERANCE by {largest - 20.0:.2f} µm: deviates from the path by up to {largest:.2f}" in said
    )
    assert "limit 20 µm (tolerance.contour_um), in section 2 arc R20, line 6" in said
    said = told(folder, "part.nc", "shaped.nc", "--plant", "feed-drive", code=1)
    assert "shaped.nc: OUT OF TOLERANCE" in said
    assert "part.nc: OUT OF TOLERANCE" not in said
    assert "next: servo lag moves the table" in said
    assert "convert again" not in said


def test_summary_has_the_worst_of_each_figure_and_its_place(folder: Path) -> None:
    said = told(folder, "part.nc", "shaped.nc", "--json", "m.json", width="200").replace("\N{NO-BREAK SPACE}", " ")
    assert said.index("worst figures on") < said.index("sections measured on")
    rows = {row[0]: row for line in said.splitlines() if len(row := re.split(r"  +", line.strip())) == 3}
    for column, program in enumerate(json.loads((folder / "m.json").read_text())["programs"], start=1):
        sections = program["sections"]
        for name, key in (
            ("peak vibration X µm", "peak_vibration_um"),
            ("residual at the stop Y µm", "residual_vibration_um"),
        ):
            axis = name.split()[-2].lower()
            values = [-1.0 if each[key] is None else each[key][axis] for each in sections]
            worst = values.index(max(values))
            cell = f"{values[worst]:.2f} ({worst + 1}, line {worst + 5})"
            assert rows[name][column] == cell


def test_many_sections_are_shown_with_all(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    zigzag = "".join(f"X{5 * number}. Y{5 * (number % 2)}.\n" for number in range(1, 16))
    (folder / "zigzag.nc").write_text(f"%\nO1\nG21G17G90G94\nG0X0Y0Z0\nG1F3000\n{zigzag}M30\n%\n")
    words = ["measure", "zigzag.nc", "-m", "vx500", "--tool-diameter", "3mm", "--set", "tolerance.contour_um=500"]
    assert main(words) == 0
    few = capsys.readouterr().out
    assert "3 more sections" in few
    assert few.count("length mm, time s") == 12
    assert main([*words, "--verbose"]) == 0
    assert capsys.readouterr().out.count("length mm, time s") == 15


def test_a_shaped_program_alone_says_so(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["measure", "shaped.nc", "-m", "vx500", "--tool-diameter", "3mm"]) == 0
    said = capsys.readouterr().out
    assert "measured against its own path, which is not the programmed one: not judged" in said
    assert "--against the original program" in said
    assert measured(capsys, "shaped.nc")["programs"][0]["ok"] is None


def test_programs_of_different_parts_have_tables_of_their_own(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "other.nc").write_text("%\nO2\nG21G17G90G94\nG0X0Y0Z0\nG1X30.F3000\nM30\n%\n")
    assert main(["measure", "part.nc", "other.nc", "-m", "vx500", "--tool-diameter", "3mm"]) == 1
    assert capsys.readouterr().out.count("sections measured on") == 2


def test_sections_by_lines_and_options(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "--lines",
        "6-7",
        "--settling-band",
        "5um",
        "--station",
        "0.02mm",
        "--cutoff",
        "2.5mm",
        "--lambda-s",
        "0.1mm",
    ]
    report = measured(capsys, "part.nc", *words, code=1)
    (section,) = report["programs"][0]["sections"]
    assert section["kind"] == "curve"
    assert section["lines"] == [6, 7]
    assert section["roughness"]["left"]["cutoff_mm"] == 2.5
    assert (report["settling_band_um"], report["station_spacing_mm"]) == (5.0, pytest.approx(0.02))


def test_feed_drives(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    driven = measured(capsys, "part.nc", "--plant", "feed-drive", "--set", "tolerance.contour_um=2000")
    assert driven["plant"] == "feed-drive"
    modal = measured(capsys, "part.nc", "--set", "tolerance.contour_um=2000")
    for one, other in zip(driven["programs"][0]["sections"], modal["programs"][0]["sections"], strict=True):
        assert one["lines"] == other["lines"]
        # The servo lags behind by more than a mode vibrates.
        assert max(one["peak_vibration_um"].values()) > max(other["peak_vibration_um"].values())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["part.nc", "--lines", "9-8"], "'9-8': must be lines, first to last"),
        (["part.nc", "--lines", "100-200"], "part.nc: no cutting move in lines 100-200"),
        (["part.nc", "--lines", "5-6", "--lines", "6-7"], "lines 5 to 6 and 6 to 7 overlap"),
        (["part.nc", "--settling-band", "0um"], "must be a length above 0"),
        (["gone.nc"], "gone.nc: no such file"),
        (["shaped.nc", "--against", "short.nc"], "it was not made from that program"),
        (["part.nc", "--json", "part.nc"], "part.nc would overwrite part.nc"),
    ],
)
def test_bad_input(folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str) -> None:
    (folder / "short.nc").write_text("%\nO2\nG21G17G90G94\nG0X0Y0Z0\nG1X30.F3000\nM30\n%\n")
    assert main(["measure", *words, "-m", "vx500", "--tool-diameter", "3mm"]) == 2
    assert message in capsys.readouterr().err
    assert (folder / "part.nc").read_text() == LINES


def test_a_tool_is_needed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["measure", "part.nc", "-m", "vx500"]) == 2
    assert "--tool-diameter" in capsys.readouterr().err


def test_demo_without_pictures_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "path", "--plots", str(tmp_path)]) == 0
    assert "pictures: this result has none" in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == []
