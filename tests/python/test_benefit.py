"""Cuts that gain nothing are left unchanged."""

import json
from pathlib import Path

import jsonschema
import pytest

import shapegcode as sg
from acceptance import PROGRAMS, convert, machine_with
from command import run
from shapegcode.results.json import schema

# A fast contour that shakes the table, and a slow one that does not.
FAST = "G1X20.F12000.\nG3X40.Y20.R20.\nG1Y40.\n"
SLOW = "G1X20.F200.\nG3X40.Y20.R20.\nG1Y40.\n"
MACHINE = sg.Machine.load("vx500")


def part(*contours: str) -> str:
    body = "".join(f"G0X0Y0\nG1Z-1.F100.\n{contour}G0Z5.\n" for contour in contours)
    return f"%\nO1\nG21G17G90G94\nG0X0Y0Z5.\n{body}M30\n%\n"


def test_a_program_that_gains_nothing_is_left_as_it_is() -> None:
    judged = convert(part(SLOW, SLOW), MACHINE, shape_all=False)
    conversion = judged.conversion
    assert conversion.text == part(SLOW, SLOW).encode()
    assert conversion.recommendation == "no benefit: run the original"
    assert conversion.ok
    assert conversion.answer.startswith("no benefit: run the original: shaping would gain ")
    assert conversion.kept
    # What is there to gain is what playing the original shows.
    simulated = sg.simulate(part(SLOW, SLOW), MACHINE)
    most = max(region.gain_um for region in conversion.kept)
    shown = max(simulated.contour_error_um.response.max, *simulated.residual_vibration_um)
    assert most == pytest.approx(shown, rel=0.02, abs=0.02)
    assert most < MACHINE.shaping.least_gain_um


def test_arcs_with_absolute_centres_stay_shaped_where_nothing_is_gained() -> None:
    # Their text cannot stand in an emitted program, whose arcs are FANUC's.
    slow = "%\nO1\nG21G17G90G94\nG0X0Y0Z0\nG1X2.F600\nG3X4.Y2.I2.J2.\nG1Y4.\nG0Z5.\nM30\n%\n"
    converted = convert(slow, machine_with({"input.arc_centre": "absolute"}), shape_all=False).conversion
    (region,) = converted.regions
    assert region.lines == (5, 7)
    assert converted.kept == ()


def test_only_the_region_that_gains_is_shaped() -> None:
    text = part(SLOW, FAST, SLOW)
    conversion = convert(text, MACHINE, shape_all=False).conversion
    assert conversion.recommendation == "worth running"
    (region,) = conversion.regions
    assert "G1X20.F12000." in text.split("\n")[region.lines[0] - 1 : region.lines[1]]
    kept = {each.lines for each in conversion.kept}
    assert len(kept) == len(conversion.kept) == 2
    # The others stand in the text to the letter.
    assert conversion.text.decode().count(SLOW) == 2
    everything = convert(text, MACHINE).conversion
    assert everything.kept == ()
    assert everything.bytes_emitted > conversion.bytes_emitted
    assert conversion.residual_vibration_um.emitted.x <= everything.residual_vibration_um.emitted.x + 0.1


def test_a_cut_that_misses_its_tolerance_but_is_better_is_shaped_and_named() -> None:
    machine = machine_with({"tolerance.residual_ratio": 1e-6, "tolerance.residual_floor_um": 1e-6,
                            "tolerance.residual_floor_increments": 0.0})  # fmt: skip
    for options in ({}, {"shape_all": False}):
        conversion = convert(part(FAST), machine, **options).conversion
        assert conversion.recommendation == "better, tolerance not met"
        assert not conversion.ok and conversion.is_written_as_output
        assert conversion.exit_code == 1
        (cut,) = conversion.cuts
        assert cut.is_shaped and "residual" in cut.misses[0]
        assert cut.misses[0] in conversion.answer


def test_a_least_gain_of_nothing_shapes_everything() -> None:
    machine = machine_with({"shaping.least_gain_um": 0.0})
    conversion = convert(part(SLOW, FAST), machine, shape_all=False).conversion
    assert len(conversion.regions) == 2
    assert conversion.kept == ()


def test_the_command_says_it_first(tmp_path: Path) -> None:
    (tmp_path / "slow.nc").write_text(part(SLOW))
    done = run(tmp_path, "convert", "slow.nc", "-m", "vx500", "-o", "out.nc", "--json", "out.json")
    assert done.returncode == 0
    assert done.stdout.startswith("no benefit: run the original")
    assert "shaping would gain" in done.stdout and "(required: 3)" in done.stdout
    assert (tmp_path / "out.nc").read_text() == part(SLOW)
    data = json.loads((tmp_path / "out.json").read_text())
    jsonschema.validate(data, schema(sg.Conversion))
    assert data["recommendation"] == "no benefit: run the original"
    done = run(tmp_path, "convert", "slow.nc", "-m", "vx500", "-o", "all.nc", "--shape-all")
    assert done.stdout.startswith("no benefit: run the original")
    assert "next: run the original program: the shaped one" in done.stdout


@pytest.mark.parametrize(
    "name", ["TEST_G90.NC", *(pytest.param(name, marks=pytest.mark.slow) for name in ("PARALLEL.NC", "PROGRAM2.NC"))]
)
def test_what_stays_shaped_is_shaped_as_before(name: str) -> None:
    program = sg.Program.read(PROGRAMS / name, MACHINE)
    everything = sg.convert(program, MACHINE, shape_all=True)
    chosen = sg.convert(program, MACHINE)
    assert chosen.ok
    whole = {region.lines: region for region in everything.regions}
    for region in chosen.regions:
        other = whole[region.lines]
        assert region.residual_vibration_um == other.residual_vibration_um
        assert region.contour_error_um == other.contour_error_um
    assert len(chosen.regions) + len(chosen.kept) == len(everything.regions)


def test_no_benefit_names_the_moving_axes_of_which_nobody_knows_a_mode() -> None:
    along_y = part(SLOW)
    for keys, named in (
        ({"axes.y.modes": [], "axes.y.rigid": False}, True),
        ({"axes.y.modes": [], "axes.y.rigid": True}, False),
    ):
        conversion = convert(along_y, MACHINE.with_values(keys), shape_all=False).conversion
        assert conversion.nothing_shaped
        assert (
            any(warning.startswith("Y moves, but it is not known whether") for warning in conversion.warnings) == named
        )


def test_no_benefit_asks_for_the_unit_first() -> None:
    conversion = convert(part(SLOW).replace("G21", ""), MACHINE, shape_all=False).conversion
    assert conversion.nothing_shaped and conversion.next_step.startswith("check the unit")
    assert "power_on.units=G20" in conversion.next_step


@pytest.mark.parametrize(
    ("prologue", "off"),
    [
        (["G05.1 Q0"], True),
        (["G08P0"], True),
        (["G05P0"], True),
        (["G05.1Q1"], False),
        (["G5P10000"], False),
        (["G64"], False),
        ([], False),
    ],
)
def test_no_advice_to_do_what_the_prologue_does(prologue: list[str], off: bool) -> None:
    machine = machine_with({"emission.prologue": prologue, "controller.corner_speed_difference_mm_per_min": 1.0})
    conversion = convert(part(FAST), machine).conversion
    assert conversion.slowed_blocks > 0
    assert any("run them with the look-ahead mode off" in warning for warning in conversion.warnings) != off
    (note,) = (each for each in conversion.at_the_control if each.topic == "look-ahead")
    assert ("switches the look-ahead mode off" in note.text) == off
