"""What a control would refuse, and what it would not run as programmed: each kind by hand."""

import json
import random
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import shapegcode as sg
from effort import cpu_s
from shapegcode.checking.check import MAX_FINDINGS
from shapegcode.checking.runs import block_table
from shapegcode.cli import main
from shapegcode.results.json import schema

HEAD = "%\nO1\nG21G17G90G94G54G64\nG0X0Y0Z0\n"  # 4 lines
END = "M30\n%\n"


def machine(**controller: Any) -> sg.Machine:
    return sg.Machine.load("vx500").with_values({f"controller.{key}": value for key, value in controller.items()})


def checked(body: str, end: str = END, **controller: Any) -> sg.Check:
    return sg.check_text(HEAD + body + end, machine(**controller), source="part.nc")


def told(check: sg.Check, code: str) -> list[tuple[int, str, int]]:
    """(line, severity, alarm) of the findings of one code."""
    return [(each.line, each.severity, each.alarm) for each in check.findings if each.code == code]


# ---- what deserves a word ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        (HEAD + "G1X10.F900\n%\n", 6, "does not end with M30, M02 or M99"),
        (HEAD + "G1X10.F900\nM30\n%\nG1X99.\nM30\n%\n", 8, "text behind the '%' that ends the program"),
        (HEAD + "G68X0Y0R400.\nG1X10.F900\nG69\n" + END, 5, "G68 R400: a control takes -360 to 360 degrees"),
        ("\ufeff" + HEAD + "G1X10.F900\n" + END, 1, "a byte-order mark (UTF-8) before the first line is left out"),
    ],
    ids=["no end", "text behind the end", "a turn and more", "byte-order mark"],
)
def test_what_a_control_may_take_otherwise_is_a_warning_everywhere(text: str, line: int, said: str) -> None:
    check = sg.check_text(text, machine(), source="part.nc")
    (found,) = [each for each in check.findings if said in each.message]
    assert (found.severity, found.line) == ("warning", line)
    # What converts and simulates reads a program with these warnings; no other line of theirs is touched.
    program = sg.Program.from_text(text, machine(), source="part.nc")
    assert [each for each in program.warnings if said in each and f"part.nc:{line}:" in each]
    for warnings in (sg.convert(program, machine(), shape_all=True).warnings, sg.simulate(program, machine()).warnings):
        assert [each for each in warnings if said in each]
    plain = text.removeprefix("\ufeff").encode()
    assert sg.convert(program, machine(), shape_all=True, only=[]).text == plain


def test_a_line_that_ends_with_cr_alone_is_refused() -> None:
    text = (HEAD + "G1X10.F900\n" + END).replace("\n", "\r")
    check = sg.check_text(text, machine(), source="part.nc")
    assert told(check, "alarm") == [(1, "alarm", 0)] and "CR alone" in check.findings[0].message
    with pytest.raises(
        sg.ProgramError, match=r"part\.nc:1:2: a line ends with CR alone: write line ends as LF or CR LF"
    ):
        sg.Program.from_text(text, machine(), source="part.nc")


def test_a_turn_beyond_a_whole_one_is_turned_by_what_is_left() -> None:
    """400 degrees are 40: the judge of the dialect works out where the cut ends."""
    body = HEAD + "G68X0Y0R{}.\nG1X10.Y5.F900\nG69\n" + END
    ends = [sg.Program.from_text(body.format(turn), machine()).regions[0].path.end_mm for turn in (400, 40)]
    assert list(ends[0]) == pytest.approx(list(ends[1]), abs=1e-9)


# ---- what is refused ---------------------------------------------------------------------------------------


def test_several_alarms_in_one_run() -> None:
    check = checked("G1X10.F1000.\nG99.9\nX20.Q\nX25.\nG2X30.R1.\nG1X40.\nM98P77\n")
    assert told(check, "alarm") == [(6, "alarm", 10), (7, "alarm", 5), (9, "alarm", 20), (11, "alarm", 78)]
    assert check.counts.alarm == check.counts_by_code["alarm"] == 4
    assert check.refused
    for finding in check.findings:
        # The number has a field of its own and the place too.
        assert "(alarm" not in finding.message
        assert "part.nc" not in finding.message
        assert finding.file == "part.nc"
    columns = {finding.line: finding.column for finding in check.findings}
    assert columns[7] == 5
    assert columns[11] == 4


def test_a_good_program_has_nothing() -> None:
    check = checked("G1X10.F1000.\nY20.\nG0Z5.\n")
    assert check.findings == ()
    assert (check.counts.alarm, check.counts.warning, check.counts.note) == (0, 0, 0)
    assert not check.refused
    assert check.size_bytes == len(HEAD + "G1X10.F1000.\nY20.\nG0Z5.\n" + END)


def test_an_error_that_ends_the_reading_is_a_finding() -> None:
    check = checked("G1X10.F1000.\n", end="M30\n")
    assert told(check, "alarm")
    assert check.refused


def test_calls_are_told_with_their_callers(tmp_path: Path) -> None:
    (tmp_path / "main.nc").write_text(HEAD + "M98P2\n" + END)
    (tmp_path / "O0002.nc").write_text("%\nO2\nG1X10.F1000.\nM98P3\nM99\n%\n")
    (tmp_path / "O0003.nc").write_text("%\nO3\nX20.\nG99.9\nM99\n%\n")
    check = sg.check(tmp_path / "main.nc", machine())
    (finding,) = (each for each in check.findings if each.severity == "alarm")
    assert (finding.alarm, finding.line, Path(finding.file).name) == (10, 4, "O0003.nc")
    assert "called by O2 line 4" in finding.message
    assert "called by O1 line 5" in finding.message


def test_a_called_program_may_be_in_a_folder_whose_name_is_no_utf_8(tmp_path: Path) -> None:
    """A file system holds any bytes; the name is shown with its byte as an escape sequence."""
    folder = tmp_path / "teile\udce9"
    folder.mkdir()
    (folder / "O0002.nc").write_text("%\nO2\nG99.9\nM99\n%\n")
    (folder / "main.nc").write_text("%\nO1\nG21 G90 G94 G17\nM98P2\nM30\n%\n")
    with pytest.raises(sg.ProgramError, match=r"teile\\udce9/O0002\.nc:3:1: "):
        sg.Program.read(folder / "main.nc", machine())


def test_a_program_that_was_read_is_checked_as_its_file(tmp_path: Path) -> None:
    (tmp_path / "main.nc").write_text(HEAD + "M98P2\nG1X10.F1000.\n" + END)
    (tmp_path / "O0002.nc").write_text("%\nO2\nG1X20.F99999.\nM99\n%\n")
    program = sg.Program.read(tmp_path / "main.nc", machine())
    assert program.core.expanded
    assert program.text == (tmp_path / "main.nc").read_bytes()
    assert sg.check(program, machine()) == sg.check(tmp_path / "main.nc", machine())


def test_another_program_of_the_file() -> None:
    text = "%\nO1\nG21\nM30\nO2\nG99.9\nM30\n%\n"
    assert not sg.check_text(text, machine()).refused
    second = sg.check_text(text, machine(), program_number=2)
    assert told(second, "alarm") == [(6, "alarm", 10)]
    missing = sg.check_text(text, machine(), program_number=3)
    assert [each.alarm for each in missing.findings if each.severity == "alarm"] == [78]


def test_macro_control_cannot_run_from_dnc() -> None:
    body = "#1=0\nWHILE[#1LT2]DO1\n#1=#1+1\nG1X#1F1000.\nEND1\n(IF THIS GOTO 5)\nIF[#1EQ9]GOTO10\nN10\n"
    assert told(checked(body), "macro_in_dnc") == []
    check = checked(body, dnc_baud=115_200)
    assert told(check, "macro_in_dnc") == [(6, "alarm", 123), (9, "alarm", 123), (11, "alarm", 123)]
    assert check.refused


def test_the_end_of_the_reading_is_told() -> None:
    few, many = (checked("G1F1000.\n" + "X1.Q\n" * count) for count in (199, 500))
    assert not any("not checked" in each.message for each in few.findings)
    assert (few.counts.alarm, many.counts.alarm) == (199, 200)
    assert [each.line for each in many.findings if "what follows is not checked" in each.message] == [205]


# ---- what stops in the cut ---------------------------------------------------------------------------------

_CUTS = "G1X10.F1000.\n{}\nX20.\n"


@pytest.mark.parametrize(
    ("between", "severity", "said"),
    [
        ("M8", "note", "M08 "),
        ("M0", "note", "M00 "),
        ("M1", "note", "M01 "),
        ("S2000", "note", "S2000 "),
        ("G4X0.5", "note", "G04 "),
        ("G53Z0", "note", "G53 "),
        ("M50", "warning", "M50 "),
        ("G9X15.", "note", "exact stop "),
    ],
)
def test_what_stops_between_two_cuts(between: str, severity: str, said: str) -> None:
    check = checked(_CUTS.format(between), no_buffer_m_codes=[50])
    ((line, level, alarm),) = told(check, "look_ahead_breaker")
    assert (line, level, alarm) == (6, severity, 0)
    assert next(each for each in check.findings if each.code == "look_ahead_breaker").message.startswith(said)


def test_a_rapid_between_makes_it_harmless() -> None:
    for between in ("M8", "M50", "G4X0.5", "S2000"):
        for body in (f"G0Z5.\n{between}", f"{between}\nG0Z5."):
            assert told(checked(_CUTS.format(body), no_buffer_m_codes=[50]), "look_ahead_breaker") == []
    # Before the first cut and behind the last one nothing is broken.
    assert told(checked("M50\nG1X10.F1000.\nX20.\nM50\n", no_buffer_m_codes=[50]), "look_ahead_breaker") == []


def test_words_of_one_gap_are_one_finding() -> None:
    check = checked(_CUTS.format("M9\nS2000\nG4X1."))
    (finding,) = check.findings
    assert finding.line == 6
    assert all(word in finding.message for word in ("M09", "S2000", "G04"))


def test_a_comment_stops_nothing() -> None:
    assert checked(_CUTS.format("(G53 M8 G9)")).findings == ()


def test_in_a_look_ahead_mode_every_function_stops() -> None:
    check = checked("G05.1Q1\n" + _CUTS.format("M8") + "G05.1Q0\n")
    assert told(check, "look_ahead_breaker") == [(7, "warning", 0)]


def test_long_lists_are_capped_and_counted() -> None:
    count = MAX_FINDINGS + 500
    check = checked("G1F1000.\n" + "".join(f"X{k % 2 * 10}.\nM8\n" for k in range(1, count + 1)) + "X5.\n")
    assert check.counts_by_code["look_ahead_breaker"] == check.counts.note == count
    assert len(told(check, "look_ahead_breaker")) == MAX_FINDINGS


# ---- time, memory, line ------------------------------------------------------------------------------------


def test_short_blocks_by_hand() -> None:
    """At 100 mm/s: 10 mm are 100 ms, 0.4 mm 4 ms, 0.1 mm 1 ms, 0.5 mm exactly 5 ms."""
    check = checked("G1X10.F6000.\nX10.4\nX10.5\nX11.\nX21.\n", block_time_s=0.005)
    assert told(check, "short_block") == [(6, "warning", 0)]
    short = check.short_blocks
    assert (short.count, short.blocks, short.region_count) == (2, 5, 1)
    assert short.share == pytest.approx(0.4)
    assert short.shortest_s == pytest.approx(0.001, abs=1e-8)
    assert short.programmed_s == pytest.approx(0.210, abs=1e-8)
    assert short.taken_s == pytest.approx(0.215, abs=1e-8)
    assert short.first_places == ("part.nc:6", "part.nc:7")
    (region,) = short.regions
    assert region.lines == (5, 9)
    assert (region.count, region.blocks) == (2, 5)
    assert checked("G1X10.F6000.\nX10.4\n", block_time_s=0.004).counts_by_code == {}
    (half,) = checked("G1X10.F6000.\nX10.4\n", block_time_s=0.0045).findings
    assert half.severity == "note" and "0.104 s at its feeds, takes less than 1 ms more" in half.message


def test_short_blocks_of_each_region_and_its_lines_in_the_source() -> None:
    """A subprogram called twice: two runs, both told at its own lines."""
    sub = "O2\nG91G1X10.F6000.\nX0.1\nG90\nM99\n"
    text = HEAD + "M98P2\nG0Z5.\nM98P2\nM30\n" + sub + "%\n"
    check = sg.check_text(text, machine(block_time_s=0.005), source="part.nc")
    assert told(check, "short_block") == [(11, "warning", 0)] * 2
    assert [row.lines for row in check.short_blocks.regions] == [(10, 11)] * 2


def test_moves_of_rotary_axes_alone_have_no_length_to_judge() -> None:
    check = checked("G1X10.F6000.\nA90.\nX20.\n", block_time_s=0.005)
    assert check.counts.warning == 0
    assert check.short_blocks.blocks == 2


def test_short_blocks_in_a_called_file_stand_at_its_lines(tmp_path: Path) -> None:
    (tmp_path / "main.nc").write_text(HEAD + "G1X10.1F6000.\nM98P2\n" + END)
    (tmp_path / "O0002.nc").write_text("%\nO2\nX10.2\nM99\n%\n")
    check = sg.check(tmp_path / "main.nc", machine(block_time_s=0.005))
    (finding,) = check.findings
    assert (finding.code, finding.line, Path(finding.file).name) == ("short_block", 3, "O0002.nc")
    # The call does not stop the motion: both blocks are one run.
    assert finding.message.startswith("1 of the 2 blocks that end with line 3")


def test_every_line_runs_once_and_in_order() -> None:
    """What the search for places rests on, over every program of the dialect."""
    paths = sorted(Path(__file__).parents[1].glob("golden/dialect/*.nc"))
    assert len(paths) > 20
    for path in paths:
        program = sg.Program.read(path, machine(), collect_alarms=True)
        table = block_table(program, machine())
        for lines in (table.cutting_lines, table.rapid_lines, table.dwell_lines):
            assert lines.tolist() == sorted(lines.tolist()), path.name


def test_against_the_segments_one_by_one() -> None:
    chance = random.Random(5)
    lines, kinds = [], ("G1X{:.3f}Y{:.3f}F{}.", "G0X{:.3f}Y{:.3f}", "M8", "G1Y{:.3f}X{:.3f}F{}.")
    for _ in range(2000):
        kind = chance.choices(kinds, (8, 1, 1, 4))[0]
        lines.append(kind.format(chance.uniform(0, 2), chance.uniform(0, 2), chance.randint(200, 14_000)))
    program = sg.Program.from_text(HEAD + "\n".join(lines) + "\n" + END, machine())
    table = block_table(program, machine(block_time_s=0.007))
    runs = [run for run in table.runs if run.blocks]
    by_lines = {(run.first_line, run.last_line): run for run in runs}
    assert len(program.regions) > 100
    text = program.core.text.split(b"\n")
    for region in program.regions:
        path = region.path
        times = [path[k].length_mm / path[k].feed_mm_per_s for k in range(len(path))]
        run = by_lines[region.first_line, region.last_line]
        assert run.blocks == len(path)
        assert run.short_blocks == sum(time_s < 0.007 for time_s in times)
        assert run.time_s == pytest.approx(sum(times), abs=1e-7)
        assert run.taken_s == pytest.approx(sum(max(time_s, 0.007) for time_s in times), abs=1e-7)
        assert run.shortest_s == pytest.approx(min(times), abs=1e-8)
        assert run.bytes == sum(len(line) + 1 for line in text[region.first_line - 1 : region.last_line])


def test_feeds_above_the_limits_of_the_axes() -> None:
    """15 000 mm/min per axis: a diagonal may run 15 000 * sqrt 2 = 21 213 mm/min."""
    check = checked("G1X100.F20000.\nX0\nX100.Y100.\nX0.Y0.F30000.\nX10.F15000.\n")
    assert told(check, "axis_feed") == [(5, "warning", 0), (8, "warning", 0)]
    first, second = (each.message for each in check.findings if each.code == "axis_feed")
    assert "20000 mm/min exceed the axis limits in 2 blocks" in first
    assert first.endswith("15000 mm/min")
    assert second.endswith("21213 mm/min")


def test_program_memory() -> None:
    size = checked("G1X10.F1000.\n").size_bytes
    assert checked("G1X10.F1000.\n", program_memory_bytes=size).findings == ()
    check = checked("G1X10.F1000.\n", program_memory_bytes=size - 1)
    assert told(check, "program_memory") == [(0, "warning", 70)]
    assert (check.size_bytes, check.memory_bytes) == (size, size - 1)
    fed = checked("G1X10.F1000.\n", program_memory_bytes=size - 1, dnc_baud=115_200)
    assert told(fed, "program_memory") == [(0, "note", 0)]


def test_serial_line_by_hand() -> None:
    """19 200 baud, 11 bits: 1745.5 characters/s. 8 blocks of 10 bytes and 5 ms each ask for 2000."""
    body = "G1X0.F6000.\n" + "".join(f"X{k * 0.5:.3f}Y0.\n" for k in range(1, 9))
    assert {len(line) for line in body.splitlines()[1:]} == {9}
    rate = 8 * 10 / 0.040
    for baud, starves in ((19_200, True), (38_400, False)):
        check = checked(body, dnc_baud=baud, block_time_s=0.004)
        assert check.dnc.characters_per_s == pytest.approx(baud / 11)
        assert check.dnc.needed_characters_per_s == pytest.approx(rate, rel=1e-6)
        assert check.dnc.factor == pytest.approx(rate * 11 / baud, rel=1e-6)
        assert told(check, "dnc_rate") == ([(6, "warning", 0)] if starves else [])
        assert check.dnc.region_count == len(check.dnc.regions) == int(starves)
    starving = checked(body, dnc_baud=19_200)
    (row,) = starving.dnc.regions
    assert (row.lines, row.bytes) == ((6, 13), 80)
    assert row.programmed_s == pytest.approx(0.040, abs=1e-8)
    assert row.blocks_per_s == pytest.approx(200.0, rel=1e-6)
    assert checked(body, dnc_bits_per_character=10).dnc is None


# ---- size --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["", pytest.param("G61\n", marks=pytest.mark.slow)], ids=["run", "exact stops"])
def test_a_long_program_quickly(mode: str) -> None:
    body = f"{mode}G1F3000.\n" + "".join(f"X{k % 1000 * 0.1:.1f}Y{k % 2}.\n" for k in range(1, 40_001))
    check = checked(body)
    assert check.short_blocks.blocks == 40_000
    # Ten times as long takes about ten times as long, not a hundred times.
    tenth = "".join(body.splitlines(keepends=True)[:-36_000])
    assert cpu_s(lambda: checked(body), 1) < 30.0 * cpu_s(lambda: checked(tenth))


# ---- the command -------------------------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.nc").write_text(HEAD + "G1X10.F1000.\nG0Z5.\n" + END)
    (tmp_path / "short.nc").write_text(HEAD + "G1X10.F6000.\nX10.1\n" + END)
    (tmp_path / "bad.nc").write_text(HEAD + "G1X10.F1000.\nG99.9\nX20.\nX5.Q\n" + END)
    return tmp_path


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    code = main(["check", *words])
    out, err = capsys.readouterr()
    return code, out, err


def test_arcs_of_another_post_are_explained_once(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A quarter circle about X15 Y5, its I and J absolute: refused as an offset, exact as a position."""
    program = folder / "post.nc"
    arcs = "".join("G02 X15. Y15. I15. J5.\nG01 X5. Y5.\n" for _ in range(50))
    program.write_text(f"%\nO1\nG21 G90 G17 G94\nG00 X0. Y0. Z5.\nG01 X5. Y5. F500.\n{arcs}M30\n%\n")
    assert main(["check", str(program), "-m", "vx500"]) == 2
    told = " ".join(capsys.readouterr().out.split())
    assert "50 alarms" in told and told.count("arc end is") == 20
    assert "with absolute I J K the whole program reads: --set input.arc_centre=absolute" in told
    assert main(["check", str(program), "-m", "vx500", "--set", "input.arc_centre=absolute", "-q"]) == 0


def test_exit_codes_and_table(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "good.nc", "-m", "vx500")
    assert (code, err) == (0, "")
    assert out.startswith("good.nc on VX500: 0 alarms, 0 warnings, 0 notes; ")
    assert "next: " in out
    code, out, err = run(capsys, "short.nc", "-m", "vx500")
    assert (code, err) == (1, "")
    assert "short.nc:6" in out
    # The table says it, and nothing says it again.
    assert " ".join(out.split()).count("with an empty block buffer") == 1
    code, out, err = run(capsys, "bad.nc", "-m", "vx500")
    assert (code, err) == (2, "")
    for said in ("bad.nc:6:1", "0010", "bad.nc:8:4", "0005", "2 alarms", "next: correct bad.nc:6:1 first"):
        assert said in out
    assert run(capsys, "short.nc", "-m", "vx500", "--set", "controller.block_time_s=0.001")[0] == 0


def test_json(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "bad.nc", "-m", "vx500", "--json", "-")
    assert (code, err) == (2, "")
    data = json.loads(out)
    jsonschema.validate(data, schema(sg.Check))
    assert data["counts"] == {"alarm": 2, "warning": 0, "note": 0}
    assert (data["ok"], data["refused"], data["warnings"]) == (False, True, [])
    assert [(each["line"], each["column"], each["alarm"]) for each in data["findings"]] == [(6, 1, 10), (8, 4, 5)]
    assert data["dnc"] is None
    assert run(capsys, "good.nc", "-m", "vx500", "--json", "c.json")[0] == 0
    data = json.loads((folder / "c.json").read_text())
    jsonschema.validate(data, schema(sg.Check))
    assert (data["ok"], data["refused"]) == (True, False)
    assert run(capsys, "short.nc", "-m", "vx500", "--set", "controller.dnc_baud=1200", "--json", "c.json")[0] == 1
    data = json.loads((folder / "c.json").read_text())
    jsonschema.validate(data, schema(sg.Check))
    assert data["dnc"]["regions"][0]["lines"] == [5, 6]
    assert [each.partition(": ")[0] for each in data["warnings"]] == ["short.nc:5", "short.nc:6"]


def test_table_of_many_alike_is_short(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cuts = "".join(f"X{k % 2 * 10}.\nM8\n" for k in range(1, 2001))
    (folder / "many.nc").write_text(HEAD + "G1F1000.\n" + cuts + "X5.\n" + END)
    code, out, _ = run(capsys, "many.nc", "-m", "vx500")
    assert code == 0
    assert len(out.splitlines()) < 30
    assert "1995 more of look_ahead_breaker" in out


def test_shaped_blocks_ask_for_the_rate_of_their_busiest_stretch(tmp_path: Path) -> None:
    (tmp_path / "part.nc").write_text(HEAD + "G1X40.F4000.\nY40.\nX0\nY0\nG0Z5.\n" + END)
    vx500 = machine()
    conversion = sg.convert(tmp_path / "part.nc", vx500, shape_all=True)
    said = next(note.text for note in conversion.at_the_control if note.topic.startswith("drip feed"))
    asked = int(said.removeprefix("needs ").partition(" baud")[0])
    for baud, count in ((9600, 1), (asked - 100, 1), (asked + 100, 0)):
        check = sg.check_text(conversion.text, machine(dnc_baud=baud), source="out.nc")
        assert check.counts_by_code.get("dnc_rate", 0) == check.dnc.region_count == count
        assert check.dnc.needed_characters_per_s * 11 == pytest.approx(asked, rel=0.002)
    # Blocks of the program itself may be bridged by the buffer: their average counts, as before.
    plain = sg.check_text(HEAD + "G1X10.F6000.\nX20.F600.\n" + END, machine(dnc_baud=115_200))
    assert plain.dnc.needed_characters_per_s == pytest.approx(24 / 1.1, rel=0.1)


def test_a_feed_that_convert_does_not_write_is_noted() -> None:
    check = checked("G1X0.01F0.001\nY10.F3000.\nG0Z5.\nG1X5.F1.\n")
    assert told(check, "reader") == [(5, "note", 0)]
    (note,) = (each for each in check.findings if each.code == "reader")
    assert "0.001 mm/min is below controller.minimum_feed_mm_per_min = 1" in note.message
    assert told(checked("G1X0.01F0.001\n", minimum_feed_mm_per_min=0.001), "reader") == []


def test_the_next_step_is_for_the_warning_that_there_is() -> None:
    without_end = checked("G1X10.F1000.\n", end="%\n")
    assert without_end.warnings and "words that stop" not in without_end.next_step
    assert "words that stop" in checked(_CUTS.format("M50"), no_buffer_m_codes=[50]).next_step


def test_a_shaped_program_that_is_too_large_is_told_to_convert_smaller(tmp_path: Path) -> None:
    (tmp_path / "part.nc").write_text(HEAD + "G1X40.F4000.\nY40.\nX0\nG0Z5.\n" + END)
    small = machine(program_memory_bytes=1000)
    conversion = sg.convert(tmp_path / "part.nc", small, shape_all=True)
    check = sg.check_text(conversion.text, small, source="out.nc")
    said = [
        next(each.message for each in check.findings if each.code == "program_memory"),
        next(warning for warning in conversion.warnings if "program_memory_bytes" in warning),
        next(note.text for note in conversion.at_the_control if note.topic == "memory"),
    ]
    for sentence in said:
        way = sentence.index("--max-bytes 1000")
        assert all(sentence.find(other) > way for other in ("card", "data server", "drip feed"))
    assert check.next_step.startswith("convert the original with --max-bytes 1000")
    plain = checked("G1X10.F1000.\n", program_memory_bytes=10)
    assert "--max-bytes" not in plain.next_step
