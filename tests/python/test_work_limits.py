"""Work is bounded before it begins, through every command: key, place, message, and nothing written (counting itself:
tests/cpp/test_work_limits.cpp). Nothing is timed: a bound that does not hold would never come back."""

import json
import math
import re
from pathlib import Path

import pytest

import shapegcode as sg
from command import run_process
from shapegcode.cli import main

HEAD = "%\nO0001\nG21 G90 G17 G54\nG00 X0 Y0 Z5.\n"  # line 5 is the first of the body
END = "M30\n%\n"


def subprogram(body: str, sub: str) -> str:
    return f"{HEAD}{body}M30\nO0002\n{sub}M99\n%\n"


TURN = "G03 I-20. Z-.01 F500\n"
# Program, limit that is passed, line of the file at which it is.
CASES = {
    "F0.001 over metres": (f"{HEAD}G01 X5000. F.001\n{END}", "max_program_s", 5),
    "dwell of days": (f"{HEAD}G04 X99999.\nG04 X2.\n{END}", "max_program_s", 6),
    "sum of dwells": (subprogram("M98 P0002 L9999\n", "G04 X99.\n"), "max_program_s", 8),
    "full turns of R -99999": (f"{HEAD}G01 X0 Y0 F200\nG03 X.01 R-99999.\n{END}", "max_program_s", 6),
    "inverse time slip": (f"{HEAD}G93 G01 X5. F.00001\n{END}", "max_program_s", 5),
    "rapids to and fro": (f"{HEAD}#1=0\nWHILE[#1EQ0]DO1\nG00 X9999.\nX0\nEND1\n{END}", "max_program_s", 0),
    "helix of a hundred thousand turns": (
        subprogram("G01 X20. F500\nG91\nM98 P0002 L99999\n", TURN),
        "max_program_s",
        10,
    ),
    "nested calls": (
        f"{HEAD}F50000\nM98 P0002 L9999\nM30\nO0002\nM98 P0003 L9999\nM99\nO0003\nG01 X.001\nX0\nM99\n%\n",
        "max_expansion_moves",
        0,
    ),
    "peck cycle of a tiny Q": (f"{HEAD}G91 G83 X1. Z-50. R-2. Q.01 F100 K9999\n{END}", "max_expansion_moves", 5),
    "loop without an end": (f"{HEAD}#1=0\nWHILE[#1EQ0]DO1\n#2=#2+1\nEND1\n{END}", "max_program_steps", 0),
    "long text": (HEAD + "(A COMMENT OF SOME LENGTH)\n" * 2000 + END, "max_program_bytes", 0),
}
# The same limits at sizes that a test has time for.
SMALL = {"max_expansion_moves": 20_000, "max_program_steps": 30_000, "max_program_bytes": 40_000}
COMMANDS = {
    "time": ["time"],
    "simulate": ["simulate"],
    "measure": ["measure", "--tool-diameter", "6mm"],
    "convert": ["convert", "-o", "out.nc"],
    "expand": ["expand", "-o", "out.nc"],
}


def machine_words(key: str) -> list[str]:
    return ["-m", "vx500", *(["--set", f"controller.{key}={SMALL[key]}"] if key in SMALL else [])]


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("case", CASES)
def test_too_much_is_refused_by_every_command_with_limit_key_and_line(
    case: str, command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text, key, line = CASES[case]
    monkeypatch.chdir(tmp_path)
    Path("part.nc").write_text(text)
    name, *options = COMMANDS[command]
    assert main([name, "part.nc", *machine_words(key), *options]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert f"controller.{key}" in err
    assert f"{SMALL.get(key, 100_000)}" in err
    place = err.removeprefix("shapegcode: part.nc:").partition(":")[0]
    assert place.isdigit(), err
    assert line in (0, int(place)), err
    assert not Path("out.nc").exists()


@pytest.mark.parametrize("case", CASES)
def test_check_says_where_it_stopped_and_that_no_control_would_refuse_it(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, key, line = CASES[case]
    (tmp_path / "part.nc").write_text(text)
    code = main(["check", str(tmp_path / "part.nc"), *machine_words(key), "--json", "-"])
    out, err = capsys.readouterr()
    if key == "max_program_bytes":
        assert code == 2 and f"controller.{key}" in err
        return
    report = json.loads(out)
    assert (code, report["counts"]["alarm"]) == (1, 0)
    (found,) = [finding for finding in report["findings"] if finding["code"] == "work_limit"]
    assert f"controller.{key}" in found["message"] and found["message"].endswith("what follows is not checked")
    assert line in (0, found["line"])


def test_a_raised_limit_lets_the_program_through() -> None:
    text = f"{HEAD}G04 X99999.\nG04 X2.\n{END}"
    machine = sg.Machine.load("vx500")
    with pytest.raises(sg.ProgramError, match="max_program_s"):
        sg.Program.from_text(text, machine)
    program = sg.Program.from_text(text, machine.with_values({"controller.max_program_s": 2e5}))
    assert sg.cycle_time(program, machine, full=False).dwell_s == pytest.approx(100_001.0)


def test_least_time_is_never_above_the_clock() -> None:
    # The clock counts acceleration on top: what is refused for its time would have taken at least that.
    text = f"{HEAD}G01 X80. F3000\nG02 X120. I20.\nG00 X0 Y300.\nG04 X1.5\nG81 X10. Z-5. R2. F200\nX20.\nG80\n{END}"
    program = sg.Program.from_text(text, "vx500")
    total_s = sg.cycle_time(program, "vx500").cycle_time_s
    assert 0.8 * total_s < program.core.least_time_s <= total_s
    # By hand: 80 mm and half a turn of 20 mm at 50 mm/s, the dwell, two holes of 7 mm at 200 mm/min; rapids on top.
    by_hand_s = (80.0 + 20.0 * math.pi) / 50.0 + 1.5 + 2 * 7.0 / (200.0 / 60.0)
    assert program.core.least_time_s > by_hand_s


def test_an_override_that_makes_hours_of_minutes_is_timed_in_closed_form_alone() -> None:
    machine = sg.Machine.load("vx500").with_values({"controller.max_program_s": 100.0})
    program = sg.Program.from_text(f"{HEAD}G01 X500. F1000\n{END}", machine)
    assert sg.cycle_time(program, machine).cycle_time_s < 40.0
    with pytest.raises(sg.ArgumentError, match=r"controller\.max_program_s.*--no-full"):
        sg.cycle_time(program, machine, feed_override=0.01)
    assert sg.cycle_time(program, machine, feed_override=0.01, full=False).cycle_time_s > 2900.0


def test_of_a_file_without_an_end_no_more_is_read_than_the_limit(tmp_path: Path) -> None:
    # A sparse file of 8 GB: read as a whole it would not fit.
    path = tmp_path / "huge.nc"
    with path.open("wb") as file:
        file.write(b"%\nO0001\n" + b"G01 X1. F100\n" * 100)
        file.truncate(8 * 2**30)
    machine = sg.Machine.load("vx500").with_values({"controller.max_program_bytes": 500})
    with pytest.raises(sg.ProgramError, match=r"more than 500 bytes .*controller\.max_program_bytes") as caught:
        sg.Program.read(path, machine)
    assert caught.value.line == 3 + (500 - 8) // 13


def test_a_plain_text_has_room_for_its_lines_whatever_the_limits_of_an_expansion_are() -> None:
    zigzag = "".join(f"X{k % 2}.Y{k}.\n" for k in range(200))
    tight = {"max_expansion_moves": 1, "max_expansion_bytes": 1, "max_program_steps": 1}
    machine = sg.Machine.load("vx500").with_values({f"controller.{key}": value for key, value in tight.items()})
    assert sg.Program.from_text(f"{HEAD}G01 F3000\n{zigzag}{END}", machine).core.move_count == 200
    with pytest.raises(sg.ProgramError, match=r"controller\.max_(program_steps|expansion)"):
        sg.Program.from_text(subprogram("M98 P0002 L20\n", "G01 X1. F500\nX0\n"), machine)


def test_the_defaults_read_a_plain_text_of_a_hundred_megabytes() -> None:
    controller = sg.Machine.load("vx500").controller
    assert controller.max_program_bytes >= 100 * 2**20 and controller.max_program_moves >= 3_000_000


def test_what_the_memory_would_not_hold_is_refused_before_it_is_taken(tmp_path: Path) -> None:
    import resource

    path = tmp_path / "huge.nc"
    with path.open("wb") as file:
        file.write(b"%\nO0001\n")
        file.truncate(900_000_000)

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (3 * 2**29, 3 * 2**29))

    for words in (("convert", "-o", "out.nc"), ("simulate",), ("check",), ("time",)):
        done = run_process(tmp_path, words[0], "huge.nc", "-m", "vx500", *words[1:], limit=limit)
        assert done.returncode == 2, done.stderr
        found = re.search(
            r"huge\.nc:1:1: .* about (\d+) bytes of memory are needed and (\d+) are available", done.stderr
        )
        assert found is not None, done.stderr
        assert int(found[1]) > 900_000_000 and 0 < int(found[2]) < 3 * 2**29


def test_what_a_conversion_would_write_counts_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from shapegcode.program import computer
    from shapegcode.program.compensation import read_for_conversion

    machine = sg.Machine.load("vx500")
    (tmp_path / "part.nc").write_text(f"{HEAD}G01 X200. F2000\nX0\n{END}")
    blocks = round(sg.Program.read(tmp_path / "part.nc", machine).core.least_time_s / machine.controller.block_time_s)
    monkeypatch.setattr(computer, "available_bytes", lambda: 50_000)
    with pytest.raises(sg.ProgramError, match=rf"about {blocks} blocks are to be written: .* 50000 are available"):
        read_for_conversion(tmp_path / "part.nc", machine)
    monkeypatch.setattr(computer, "available_bytes", lambda: None)
    assert read_for_conversion(tmp_path / "part.nc", machine).regions


def test_a_region_too_long_for_one_piece_keeps_its_text_and_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from shapegcode.conversion import whole_text

    monkeypatch.setattr(whole_text, "_MAX_PERIODS", 1000)
    text = f"{HEAD}G01 X200. F2000\nY100.\nX0\nG00 Z50.\nX0 Y0\nG01 X10. F2000\nY20.\n{END}"
    converted = sg.convert(text, "vx500", shape_all=True)
    assert b"\nG01 X200. F2000\nY100.\nX0\n" in converted.text
    assert any("exceed what can be shaped at a time" in warning for warning in converted.warnings)
    assert len(converted.placed) == 1


def test_a_region_whose_blocks_have_no_room_keeps_its_text_and_is_named() -> None:
    zigzag = "".join(f"X{5 * (k % 2)}.Y{k}.\n" for k in range(60))
    text = f"{HEAD}G01 X5. F3000\nX0\nG00 Z50.\nG00 Z5.\nG01 F3000\n{zigzag}{END}"
    free = sg.Machine.load("vx500")
    whole = sg.convert(text, free, shape_all=True)
    assert len(whole.placed) == 2
    for key, of_whole in (("max_program_bytes", len(whole.text)), ("max_program_moves", whole.blocks.emitted)):
        machine = free.with_values({f"controller.{key}": of_whole // 2})
        converted = sg.convert(text, machine, shape_all=True)
        assert len(converted.placed) == 1
        assert zigzag.encode() in converted.text
        assert any(f"controller.{key}" in warning for warning in converted.warnings)
        assert len(converted.text) < of_whole if key == "max_program_bytes" else converted.blocks.emitted < of_whole


def test_of_very_many_sections_short_runs_are_measured_together_and_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    from shapegcode.metrology import measure

    zigzag = "".join(f"X{k % 2}.Y{k}.\n" for k in range(1, 61))
    program = sg.Program.from_text(f"{HEAD}G01 F2000\n{zigzag}{END}", "vx500")
    each = sg.measure(program, "vx500", 6.0)
    assert len(each.programs[0].regions[0].sections) == 60
    assert not any("measured together" in warning for warning in each.warnings)
    monkeypatch.setattr(measure, "_MAX_SECTIONS", 20)
    joined = sg.measure(program, "vx500", 6.0)
    assert len(joined.programs[0].regions[0].sections) <= 20
    assert any("measured together as curves" in warning for warning in joined.warnings)
    # Nothing is lost: the worst place is found in both.
    assert joined.programs[0].contour_error_um == each.programs[0].contour_error_um
