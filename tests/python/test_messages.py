"""Messages name what is in the program: its own words, who calls what, what kind of program it is."""

import shlex
from pathlib import Path

import pytest

import shapegcode as sg
from command import run

MACHINE = sg.Machine.load("vx500")
HEAD = "%\nO0001\nG90 G21 G17 G54\n"
LATHE = (
    "%\nO0010 (TURN THE SHAFT, Y IS NOT THERE)\nG50 S2500\nT0101\nG96 S200 M03\nG00 X52. Z2. M08\nG71 U2. R1.\n"
    "G71 P100 Q200 U0.5 W0.1 F0.3\nN100 G00 X20.\nG01 Z-30. F0.15\nN200 X52.\nG70 P100 Q200\nM30\n%\n"
)


def warnings(text: str, **values: object) -> list[str]:
    machine = MACHINE.with_values({key.replace("__", "."): value for key, value in values.items()})
    return sg.Program.from_text(text, machine).warnings


@pytest.mark.parametrize(
    ("block", "said"),
    [
        ("G0 X0 Y-12.5", "Y-12.5 is read as -12.5 mm, and would be -317.5 mm in inch"),
        ("G1 Z2. F100", "Z2. is read as 2 mm, and would be 50.8 mm in inch"),
        ("G0 X0 Y0", "numbers are read in mm"),
    ],
)
def test_the_unit_is_shown_by_a_word_of_the_line(block: str, said: str) -> None:
    text = f"%\nO0001\nG90 G17\n{block}\nM30\n%\n"
    (found,) = [warning for warning in warnings(text) if "neither G20 nor G21" in warning]
    assert found.startswith("<text>:4: ") and said in found
    (inch,) = [each for each in warnings(text, power_on__units="G20") if "neither G20 nor G21" in each]
    assert "100" not in found + inch


@pytest.mark.parametrize(
    ("block", "key", "value", "said"),
    [
        ("T1 M06", "input.m_macros", {"6": 9001}, "O9001 that M06 calls (input.m_macros, parameters 6080 to 6089)"),
        ("M6", "input.m_subprograms", {"6": 9002}, "O9002 that M6 calls (input.m_subprograms, parameters 6071 to"),
        ("G120 X1.", "input.g_macros", {"120": 9010}, "O9010 that G120 calls (input.g_macros, parameters 6050 to"),
        ("T5", "input.tool_program", 9000, "O9000 that T5 calls (input.tool_program, parameter 6001#5)"),
    ],
)
def test_who_calls_a_program_that_the_text_does_not_name(block: str, key: str, value: object, said: str) -> None:
    found = warnings(f"{HEAD}{block}\nM30\n%\n", **{key: value})
    (call,) = [warning for warning in found if "is not at hand" in warning]
    assert call.startswith("<text>:4: ") and said in call
    assert call.endswith("beside this program makes them known")
    missing = {"input.opaque_programs": (9900, 9999), key: value}
    with pytest.raises(sg.ProgramError, match=r"that \S+ calls .* is not found"):
        sg.Program.from_text(f"{HEAD}{block}\nM30\n%\n", MACHINE.with_values(missing))


@pytest.mark.parametrize("command", ["convert -o out.nc", "time", "simulate", "expand -o out.nc", "check"])
def test_a_turning_program_is_named(command: str, tmp_path: Path) -> None:
    (tmp_path / "shaft.nc").write_text(LATHE)
    name, *words = command.split()
    done = run(tmp_path, name, "shaft.nc", "-m", "vx500", *words)
    assert done.returncode == 2
    said = done.stdout if name == "check" else done.stderr
    assert "this is a turning program: G50 S2500 (" in said and ("shaft.nc:3:1: " in said or name == "check")
    for sign in ("T0101", "G96 S200", "G71 U2. R1."):
        assert sign in said
    assert not (tmp_path / "out.nc").exists()


@pytest.mark.parametrize(
    "body",
    [
        "T0101 M06\nG97 S1000 M03\nG0 X0 Y0 Z5.\nG1 X20. F.5\n",  # inch feeds, four-digit tools
        "T1212\nM6\nG97 S800 M3\nG0 X0 Z5.\nG1 X20. F0.2\n",  # no Y
        "(G50 S2500 T0101 G96 S200)\nG0 X0 Z5.\nG1 X20. F100.\n",  # said in a comment alone
        "G97 S800 M3\nG0 X0 Z5.\nG1 X20. F0.2\n",
        "G50\nG69\nG0 X0 Y0\nG96 S100 M3\n",
    ],
)
def test_a_milling_program_is_not_taken_for_one(body: str) -> None:
    from shapegcode.program.reading import signs_of_turning

    assert signs_of_turning(f"{HEAD}{body}M30\n%\n".encode()) is None


POCKET = f"{HEAD}G0 X0 Y0 Z5.\nG1 Z-1. F500.\nG41 D2 X10. Y5.\nY30.\nX-10.\nG40 X0 Y0\nM30\n%\n"


def test_cutter_compensation_is_refused_in_two_lines_with_the_command_that_goes_on(tmp_path: Path) -> None:
    """The command that it names, with a radius put in, converts the program."""
    (tmp_path / "pocket.nc").write_text(POCKET)
    done = run(tmp_path, "convert", "pocket.nc", "-m", "vx500", "-o", "out.nc")
    what, go_on = (line.removeprefix("shapegcode: ") for line in done.stderr.splitlines())
    assert done.returncode == 2 and what.startswith("pocket.nc:6:1: ")
    words = shlex.split(go_on.removeprefix("next: ").partition(" shapes ")[0])
    assert words[4:5] == ["MACHINE"] and "input.tool_radius_mm.2=RADIUS_IN_MM" in words
    words = [word.replace("MACHINE", "vx500").replace("RADIUS_IN_MM", "3") for word in words]
    assert words[0] == "shapegcode"
    assert run(tmp_path, *words[1:], "-o", "out.nc").returncode == 0
    kept = run(tmp_path, "convert", "pocket.nc", "-m", "vx500", "--compensation", "keep", "-o", "kept.nc")
    assert kept.returncode == 0
    unknown = run(tmp_path, "convert", "pocket.nc", "-m", "vx500", "--compensation", "expand", "-o", "no.nc")
    assert unknown.returncode == 2 and len(unknown.stderr.splitlines()) == 2
    assert "--set input.tool_radius_mm.2=" in unknown.stderr


@pytest.mark.parametrize(
    ("text", "words", "said"),
    [
        (POCKET, ["--set", "input.tool_radius_mm.2=0"], "--set input.tool_radius_mm.2=RADIUS_IN_MM"),
        (POCKET.replace("G41 D2", "G41 D0"), [], "write D with the number of the offset"),
        (POCKET.replace("G41 D2", "G41"), [], "as there is no D"),
        (POCKET.replace("G0 X0 Y0", "G10 L12 P2 R0\nG0 X0 Y0"), [], "G10 L12 P2 R"),
    ],
)
def test_a_radius_of_zero_is_not_expanded(text: str, words: list[str], said: str, tmp_path: Path) -> None:
    (tmp_path / "pocket.nc").write_text(text)
    line = 1 + text[: text.index("G41")].count("\n")
    for command in (["expand"], ["convert", "--compensation", "expand"]):
        done = run(tmp_path, *command, "pocket.nc", "-m", "vx500", *words, "-o", "out.nc")
        assert done.returncode == 2
        assert done.stderr.startswith(f"shapegcode: pocket.nc:{line}:1: offset D")
        assert said in done.stderr
    # What keeps the moves as they are, and what only looks, goes on.
    assert run(tmp_path, "expand", "--compensation", "keep", "pocket.nc", "-m", "vx500", "-o", "k.nc").returncode == 0
    assert run(tmp_path, "time", "pocket.nc", "-m", "vx500", *words).returncode == 0
