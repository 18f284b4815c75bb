"""``shapegcode shaper``: exit codes, JSON, messages."""

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import shapegcode as sg
from shapegcode import _core
from shapegcode._core import ArgumentError, Mode, Shaper, convolved_zv
from shapegcode.cli import main
from shapegcode.results import plot as canvas
from shapegcode.results.json import schema
from shapegcode.shaping import FAMILIES, Design, Recommendation, choose_shaper, families_table
from shapegcode.shaping.plots import plots_of, residual_curve, selected, shaped_step

FEW = ("--family", "zv", "mzv", "minimal", "polynomial", "non-negative", "robust")  # quick ones
PAPER = ("--mode", "46:0.02±5%", "--mode", "131:0.02")


def asked(capsys: pytest.CaptureFixture[str], *words: str, code: int = 0) -> dict[str, Any]:
    assert main(["shaper", *words, "--json", "-"]) == code
    result: dict[str, Any] = json.loads(capsys.readouterr().out)
    jsonschema.validate(result, schema(Recommendation))
    return result


def test_json_of_a_grid(capsys: pytest.CaptureFixture[str]) -> None:
    result = asked(capsys, *PAPER, "--block-period", "5ms")
    assert result["ok"]
    exact = next(row for row in result["designs"] if row["family"] == "non-negative")
    assert exact["times_s"] == pytest.approx([0.0, 0.005, 0.01, 0.015, 0.02], abs=1e-12)
    assert exact["amplitudes"] == pytest.approx([0.20394, 0.16162, 0.31387, 0.15731, 0.16327], abs=1e-5)
    taken = result["designs"][result["recommended"]]
    assert taken["period_s"] == 0.005
    assert not taken["negative"]
    assert taken["worst_residual"] <= 0.05
    assert "±5 %" in result["reason"]
    assert {row["family"] for row in result["refused"]} >= {"minimal", "simultaneous"}
    assert all(row["reason"] for row in result["refused"])
    assert result["modes"] == [
        {"frequency_hz": 46.0, "damping_ratio": 0.02, "uncertainty": 0.05},
        {"frequency_hz": 131.0, "damping_ratio": 0.02, "uncertainty": 0.0},
    ]


def test_plus_minus_in_ascii_is_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    few = ("--block-period", "5ms", *FEW)
    ours = asked(capsys, "--mode", "46:0.02+-5%", "--mode", "131:0.02", *few)
    assert {**ours, "provenance": None} == {**asked(capsys, *PAPER, *few), "provenance": None}


def test_a_file_and_the_table(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "shaper.json"
    assert main(["shaper", "-m", "vx500", *FEW, "--json", str(file)]) == 0
    out = capsys.readouterr().out
    result = json.loads(file.read_text(encoding="utf-8"))
    assert result["designs"][result["recommended"]]["duration_s"] == pytest.approx(0.02)
    assert "=> recommended" in out
    assert (
        "next: shapegcode convert part.nc -m vx500 --shaper non-negative --block-period 5ms -o shaped.nc"
        in " ".join(out.split())
    )
    assert "no design" in out
    assert result["reason"] in out
    assert out.startswith("take non-negative (20 ms on the 5 ms grid), zero residual at 46 Hz and 131 Hz\n")
    assert result["machine"] == "vx500"


def test_exit_code_1_if_the_best_leaves_too_much(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("--mode", "46:0.02±20%", "--block-period", "5ms", "--max-duration", "15ms", *FEW)
    result = asked(capsys, *words, code=1)
    best = result["designs"][result["recommended"]]
    assert best["worst_residual"] > 0.05
    rivals = [row["worst_residual"] for row in result["designs"] if not row["negative"]]
    assert best["worst_residual"] == min(rivals)
    assert main(["shaper", *words]) == 1
    out = capsys.readouterr().out
    assert "best available" in out
    assert out.startswith("NONE is good enough; best is")
    assert f"residual at most {100 * best['worst_residual']:.3g} % within the bands of 46 Hz ±20 % (limit 5 %)" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        # What is wrong with modes, taps and families is in test_shaper_families and test_shaper_choice.
        ("--mode 46 --mode 46", "modes 1 and 2 are equal"),
        ("--mode=-46:0.02", "mode frequency -46 Hz"),
        ("--mode 1e-9", "mode frequency 1e-09 Hz, in '1e-9': must be 0.1 to 10000 Hz"),
        ("--mode 0.099:0.02", "mode frequency 0.099 Hz"),
        ("--mode 10001:0.02", "mode frequency 10001 Hz"),
        ("--mode 46:-0.1", "damping ratio -0.1"),
        ("--mode 46:0.02±100%", "must be at least 0 and below 1"),
        ("--mode fast", "is not a mode"),
        ("--mode 46 --taps 0:.5,10ms:.6", "add up to 1.1"),
        ("--mode 46 -m vx500", "give one of them"),
        ("", "give one of them"),
        ("--mode 46 --block-period 1us", "at most 5000 can be searched"),
        ("--mode 46 --block-period 0ms", "must be a time above 0"),
        ("--mode 46 --uncertainty 120%", "below 100%"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(capsys: pytest.CaptureFixture[str], words: str, message: str) -> None:
    assert main(["shaper", *words.split()]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len([line for line in error.splitlines() if not line.startswith((" ", "usage"))]) == 1


def _rows(out: str) -> list[str]:
    """The lines of the table of designs."""
    return re.findall(r"^(?:=>|->|  )  [a-z].*\d\.\d\d .*$", out, re.MULTILINE)


def test_the_table_shows_some_and_all(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["shaper", *PAPER, "--continuous", "--block-period", "2ms", "--block-period", "5ms", *FEW]
    rows = []
    for more in ([], ["--verbose"]):
        assert main([*words, *more]) == 0
        rows.append(_rows(capsys.readouterr().out))
    result = asked(capsys, *words[1:])
    assert len(rows[1]) == len(result["designs"]) > len(rows[0])
    families = {row["family"] for row in result["designs"]}
    assert {line.removeprefix("=>").removeprefix("->").split()[0] for line in rows[0]} == families


def test_tables_fit_80_columns_and_cut_no_word() -> None:
    result = choose_shaper(["46:0.02±5%", "131:0.02"], families=FEW[1:])
    for table in (*result.tables(), families_table()):
        text = str(table)
        assert max(map(len, text.splitlines())) <= 80
        assert {word for cells in table.cells() for cell in cells for word in cell.split()} <= set(text.split())


def test_the_families_are_listed_and_the_help_names_each(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["shaper", "--list-families"]) == 0
    out = capsys.readouterr().out
    assert all(name in out for name in ("zv", "polynomial", "non-negative", "Smith"))
    assert main(["shaper", "--help"]) == 0
    text = re.sub(r"\s+", "", capsys.readouterr().out)  # lines may end within a name
    assert f"of{','.join(row.name for row in FAMILIES)}(default:all)" in text


def test_contour_cost_in_micrometres() -> None:
    """Moving average of length A: the manual's A²/24·v²/R; here as 1001 equal taps."""
    length, speed, radius = 0.05, 100.0, 20.0
    shaper = Shaper([length * k / 1000 for k in range(1001)], [1 / 1001] * 1001)
    expected = length**2 / 24.0 * speed**2 / radius * 1e3
    assert Design("average", shaper, None, 0.0, 0.0).radial_error_um(speed, radius) == pytest.approx(expected, rel=3e-3)


def test_pictures_are_complete(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(canvas, "FORMATS", (".svg",))  # PNG takes three times as long
    assert main(["shaper", *PAPER, "--continuous", "--block-period", "5ms", *FEW, "--plots", str(tmp_path)]) == 0
    assert "next:" in capsys.readouterr().out
    kinds = {"branches", "pareto", "sensitivity", "impulses", "steps"}
    assert {file.name for file in tmp_path.iterdir()} == {f"shaper-{kind}.svg" for kind in kinds}
    text = (tmp_path / "shaper-sensitivity.svg").read_text(encoding="utf-8")
    assert "residual vibration in %" in text
    assert "(5 ms grid)" in text


def test_pictures_are_drawn_into_the_caller_s_axes() -> None:
    result = choose_shaper(["46:0.02±5%", "131:0.02"], periods_s=[0.005], families=FEW[1:])
    for name, draw in plots_of(result).items():
        figure = canvas.figure(16.0, 12.0)
        place = figure.subplots(1, 2)[1]
        drawn = draw(ax=place)
        assert drawn.figure.figure is figure, name
        figure.draw_without_rendering()
        assert drawn.has_data(), name
        assert drawn.get_window_extent().x0 > 0.5 * figure.bbox.width, name
    assert "shaper-branches" not in plots_of(choose_shaper(["46:0.02"], periods_s=[0.005], families=["zv"]))


def test_shapers_by_name_are_drawn_as_those_of_a_comparison() -> None:
    shapers = {"zv": convolved_zv([Mode(46.0, 0.02)]), "none": Shaper([0.0], [1.0])}
    sensitivity = sg.plot_sensitivity(shapers, modes=["46:0.02±5%"])
    steps = sg.plot_steps(shapers, modes=[46])
    for panel in (sensitivity, steps):
        assert shapers.keys() <= {line.get_label() for line in panel.get_lines()}
    assert sg.plot_impulses(shapers["zv"]).get_title(loc="left") == "shaper"
    # Behind the last impulse the mode keeps what the residual ratio says: here nothing.
    grey, behind_zv, behind_none = steps.figure.axes[1].get_lines()
    rest = grey.get_xdata() > 1e3 * shapers["zv"].duration_s + 1.0
    assert np.abs(behind_zv.get_ydata()[rest] - 1.0).max() < 0.05 < np.abs(behind_none.get_ydata()[rest] - 1.0).max()
    with pytest.raises(ArgumentError, match="0 given"):
        sg.plot_steps(shapers)


def test_families_that_were_asked_for_are_drawn_where_there_is_room() -> None:
    names = ["zv", "smooth-zv", "smooth-ei", "mirrored"]
    result = choose_shaper(["30:0.1"], periods_s=[0.001], families=names)
    assert {each.family for each in selected(result)} == set(names)  # of these only zv is on the front


def test_selected_curves_begin_with_the_recommended_one() -> None:
    result = choose_shaper(["46:0.02±5%", "131:0.02"], families=FEW[1:])
    curves = selected(result)
    assert curves[0] is result.design
    assert len(curves) <= 6
    assert any(each.period_s is not None for each in curves)


def test_residual_curve_is_zero_at_the_modes() -> None:
    modes = [Mode(46.0, 0.02), Mode(131.0, 0.05)]
    curve = residual_curve(convolved_zv(modes), np.array([46.0, 131.0, 80.0]), modes)
    assert curve[:2] == pytest.approx([0.0, 0.0], abs=1e-14)
    between = 0.02 + 0.03 * (80.0 - 46.0) / (131.0 - 46.0)  # no jump of the damping, hence none of the curve
    assert curve[2] == pytest.approx(convolved_zv(modes).residual_ratio(Mode(80.0, between)), rel=1e-12)


def test_a_shaped_step_leaves_what_the_residual_ratio_says() -> None:
    modes = [Mode(1.0, 0.0), Mode(4.0, 0.0)]
    shaper = Shaper([0.0, 0.2, 0.41], [0.72361, -0.44721, 0.7236])

    def residuals(given: Shaper) -> list[float]:
        step = shaped_step(given, 0.0005, 2.0)
        assert (step[0], step[-1]) == (0.0, pytest.approx(1.0))
        response = _core.plant_response(np.tile(step[:, None], (1, 2)), [[mode] for mode in modes], 0.0005)
        at_rest = step == step[-1]
        return [float(np.abs(each[at_rest] - step[-1]).max()) for each in response.T]

    assert residuals(shaper) == pytest.approx([shaper.residual_ratio(mode) for mode in modes], rel=1e-4)
    # taps between the samples keep their times
    odd = residuals(Shaper([0.0, 0.2003], [0.5, 0.5]))
    assert odd == pytest.approx([abs(np.cos(np.pi * f * 0.2003)) for f in (1.0, 4.0)], rel=1e-4)
