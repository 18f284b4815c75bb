"""A file of several O programs: `--program all`, and one number in two folders of a memory punch."""

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

import shapegcode as sg
from command import run
from shapegcode.program.reading import programs_of

HEAD = "G21 G90 G17 G54\nG00 X0 Y0 Z5.\n"
CUT = "G01 X{x}. F3000\nY40.\nX0\n"
SUB = "O0003(CALLED)\nG01 Y10. F3000\nM99\n"


def program(name: str, x: int, calls: str = "") -> str:
    return f"{name}\n{HEAD}{CUT.format(x=x)}{calls}M30\n"


PUNCH = (
    "(LEADER)\n%\n"
    + "&F=/ONE/\n"
    + program("O0001(FIRST)", 30, "M98 P0003\n")
    + program("O0002", 60)
    + SUB
    + "&F=/TWO/\n"
    + program("O0001(OTHER)", 90)
    + program("<PART-7>", 120)
    + "%\n"
)
DONE = ["/ONE/O0001", "O0002", "/TWO/O0001", "<PART-7>"]
LENGTH_S = [(2 * x + 40) / 50.0 for x in (30, 60, 90, 120)]  # at F3000, without acceleration


def punch(folder: Path, text: str = PUNCH) -> Path:
    (folder / "all.nc").write_bytes(text.encode())
    return folder / "all.nc"


def every(folder: Path, command: str, *words: str) -> subprocess.CompletedProcess[str]:
    """A command over all programs of the file."""
    return run(folder, command, "all.nc", "-m", "vx500", "--program", "all", *words)


def test_addresses_pick_one_program_and_no_other(tmp_path: Path) -> None:
    path, machine = punch(tmp_path), sg.Machine.load("vx500")
    assert [place.address for place in programs_of(PUNCH.encode())] == [*DONE[:2], "O0003", *DONE[2:]]
    for address, seconds in zip(DONE, LENGTH_S, strict=True):
        read = sg.Program.read(path, machine, program_number=address)
        cut = sum(region.path.programmed_time_s for region in read.regions)
        assert cut == pytest.approx(seconds + (0.6 if address == DONE[0] else 0.0), rel=1e-6), address
    # A line alone between two programs of one number: which is meant must be said.
    with pytest.raises(sg.ProgramError, match=r"several programs O1: specify one, /ONE/O0001, /TWO/O0001"):
        sg.Program.read(path, machine, program_number=1)
    for wanted in ("/TWO/O0002", "<OTHER>", "#9"):
        with pytest.raises(sg.ProgramError, match=f"no program {wanted}"):
            sg.Program.read(path, machine, program_number=wanted)
    assert sg.Program.read(path, machine, program_number="#2").core.program_number == 2
    # What stands alone is the program alone, as it was written.
    assert sg.Program.read(path, machine, program_number="#2").expanded_text.decode() == f"%\n{program('O0002', 60)}%\n"


def test_two_programs_without_any_difference_in_name_have_places(tmp_path: Path) -> None:
    text = "%\n<A>\nM30\n<A>\nM30\n%\n"
    assert [place.address for place in programs_of(text.encode())] == ["#1", "#2"]


@pytest.mark.parametrize(
    "words", [["time"], ["check"], ["simulate"], ["measure", "--tool-diameter", "6mm"]], ids=lambda words: words[0]
)
def test_every_program_has_its_table_and_its_place_in_the_json(words: list[str], tmp_path: Path) -> None:
    punch(tmp_path)
    told = every(tmp_path, words[0], "--json", "r.json", *words[1:])
    reports = json.loads((tmp_path / "r.json").read_text())
    assert [report["program_address"] for report in reports] == DONE
    lines = told.stdout.splitlines()
    assert [line.rstrip(":") for line in lines if line.rstrip(":") in DONE] == DONE
    assert "called by others and expanded there: O0003" in lines
    alone = run(tmp_path, words[0], "all.nc", "-m", "vx500", "--program", "O2", "--json", "one.json", *words[1:])
    one = json.loads((tmp_path / "one.json").read_text())
    ours = {key: value for key, value in reports[1].items() if key != "program_address"}
    # Alone it is told that the file holds others.
    for report in (one, ours):
        for key in ("warnings", "findings", "counts", "counts_by_code", "programs", "provenance"):
            report.pop(key, None)
    assert ours == one
    assert told.returncode >= alone.returncode


def test_time_of_all_is_the_time_of_each(tmp_path: Path) -> None:
    path, machine = punch(tmp_path), sg.Machine.load("vx500")
    every(tmp_path, "time", "--json", "r.json", "--csv", "blocks.csv")
    for report in json.loads((tmp_path / "r.json").read_text()):
        read = sg.Program.read(path, machine, program_number=report["program_address"])
        assert report["cycle_time_s"] == pytest.approx(sg.cycle_time(read, machine).cycle_time_s)
    assert sorted(each.name for each in tmp_path.glob("blocks*")) == [
        "blocks-O0002.csv", "blocks-ONE-O0001.csv", "blocks-PART-7.csv", "blocks-TWO-O0001.csv",
    ]  # fmt: skip
    refused = every(tmp_path, "time", "--csv", "-")
    assert refused.returncode == 2 and "each program needs a file" in refused.stderr


@pytest.mark.parametrize("end", ["\n", "\r\n", "\n\r\r"], ids=["LF", "CR LF", "LF CR CR"])
def test_convert_writes_one_file_with_every_program_in_its_place(end: str, tmp_path: Path) -> None:
    original = PUNCH.replace("\n", end)
    punch(tmp_path, original)
    told = every(tmp_path, "convert", "--shape-all", "-o", "out.nc", "--json", "r.json")
    assert told.returncode == 0, told.stderr
    emitted = (tmp_path / "out.nc").read_bytes()
    reports = json.loads((tmp_path / "r.json").read_text())
    assert [report["output"] for report in reports] == ["out.nc"] * 4
    assert [place.address for place in programs_of(emitted)] == [*DONE[:2], "O0003", *DONE[2:]]
    assert emitted.count(b"(VERDICT WITHIN TOLERANCE       )") == 4
    # No line has another end than the file's, and what is called stands to the letter.
    assert emitted.count(b"\n") == emitted.count(end.encode())
    assert SUB.replace("\n", end).encode() in emitted
    assert emitted.startswith(b"(LEADER)" + end.encode() + b"%" + end.encode() + b"&F=/ONE/")
    assert emitted.endswith(b"M30" + end.encode() + b"%" + end.encode())
    for address in DONE:
        was = sg.Program.from_text(original, "vx500", program_number=address)
        now = sg.Program.from_text(emitted, "vx500", program_number=address)
        ends = [sum((region.path.end_mm - region.path.start_mm) for region in each.regions) for each in (was, now)]
        assert ends[1] == pytest.approx(ends[0], abs=1e-6)
        assert sum(region.blocks for region in now.regions) > sum(region.blocks for region in was.regions)


def test_expand_leaves_what_needs_nothing_to_the_letter(tmp_path: Path) -> None:
    plain = "%\n" + program("O0001", 30) + program("O0002", 60) + "%\n"
    punch(tmp_path, plain)
    assert every(tmp_path, "expand", "-o", "out.nc").returncode == 0
    assert (tmp_path / "out.nc").read_bytes() == plain.encode()


def test_a_program_that_cannot_be_read_does_not_stop_the_others(tmp_path: Path) -> None:
    bad = f"O0005\n{HEAD}G02 X10. I3. F500\nM30\n"
    punch(tmp_path, "%\n" + program("O0001", 30) + bad + program("O0002", 60) + "%\n")
    told = every(tmp_path, "convert", "--shape-all", "-o", "out.nc", "--json", "r.json")
    assert told.returncode == 2
    assert "not done: all.nc:12:" in told.stdout and "off its radius" in told.stdout
    reports = json.loads((tmp_path / "r.json").read_text())
    assert [report["ok"] for report in reports] == [True, False, True]
    assert bad.encode() in (tmp_path / "out.nc").read_bytes()


def test_one_program_out_of_tolerance_sends_the_file_beside_the_one_asked_for(tmp_path: Path) -> None:
    slanting = (program("O0001", 30) + program("O0002", 60)).replace("Y40.", "X33.3Y41.7")
    punch(tmp_path, "%\n" + slanting + "%\n")
    told = every(
        tmp_path, "convert", "--shape-all", "-o", "out.nc",
        "--contour", "command", "--contour-tolerance", "0.4um", "--max-time-increase", "1e5",
        "--max-cut-time-increase", "1e5",
    )  # fmt: skip
    if told.returncode == 2:
        pytest.fail(told.stderr)
    assert told.returncode == 1
    assert not (tmp_path / "out.nc").exists()
    (written,) = (path for path in tmp_path.iterdir() if path.name.startswith("out.nc"))
    assert b"DO NOT RUN" in written.read_bytes()


def test_each_emitted_program_is_held_against_its_own_header(tmp_path: Path) -> None:
    punch(tmp_path)
    done = every(tmp_path, "convert", "--shape-all", "-o", "out.nc")
    assert done.returncode == 0, done.stderr

    def codes() -> dict[str, set[str]]:
        run(tmp_path, "check", "out.nc", "-m", "vx500", "--program", "all", "--json", "r.json")
        reports = json.loads((tmp_path / "r.json").read_text())
        return {report["program_address"]: set(report["counts_by_code"]) for report in reports}

    found = codes()
    # O0003 was called; now its moves stand in O0001, and it is no program to run.
    assert list(found) == DONE
    assert not any({"edited", "unmarked"} & each for each in found.values())
    told = run(tmp_path, "time", "out.nc", "-m", "vx500", "--program", "all")
    assert "no longer called, since the shaped programs contain their moves: O0003" in told.stdout
    alone = run(tmp_path, "check", "out.nc", "-m", "vx500", "--program", "O3")
    assert "no region is marked" not in alone.stdout and "was changed" not in alone.stdout
    for number in (2, "O2", "#2"):
        assert sg.Program.read(tmp_path / "out.nc", program_number=number).own_text.startswith(b"O0002")
    # A change in one is told of that one alone.
    text = (tmp_path / "out.nc").read_text()
    at = text.index("Y", text.index("(SHAPED)", text.index("O0002")))
    (tmp_path / "out.nc").write_text(f"{text[:at]}Y1{text[at + 1 :]}")
    assert [address for address, each in codes().items() if "edited" in each] == ["O0002"]


def written_alone(folder: Path, text: str, *options: str) -> tuple[str, dict[str, Any], str]:
    """What `convert --program O1` writes, its report, and what it says."""
    punch(folder, text)
    told = run(
        folder, "convert", "all.nc", "-m", "vx500", "--program", "O1", "--shape-all", "-o", "out.nc", "--json",
        "r.json", *options,
    )  # fmt: skip
    assert told.returncode == 0, told.stderr
    return (folder / "out.nc").read_text(), json.loads((folder / "r.json").read_text()), told.stdout


def test_the_first_program_alone_is_written_alone_and_its_sizes_are_its_own(tmp_path: Path) -> None:
    alone = "%\n" + program("O0001", 30) + "%\n"
    written, report, _ = written_alone(tmp_path, alone)
    folder = tmp_path / "backup"
    folder.mkdir()
    backup = "%\n" + program("O0001", 30) + program("O0002", 60) + SUB + "%\n"
    of_backup, told, said = written_alone(folder, backup)
    assert of_backup == written
    assert [place.address for place in programs_of(of_backup.encode())] == ["O0001"]
    for key in ("bytes_read", "bytes_emitted", "blocks", "at_the_control"):
        assert told[key] == report[key], key
    assert told["bytes_read"] == len(alone) and told["bytes_emitted"] == len(of_backup)
    assert "calls of" not in said


def test_programs_whose_calls_were_kept_stand_behind_the_one_that_was_asked_for(tmp_path: Path) -> None:
    probe = "O0003(PROBE)\nG65 P0004 (M98 P2)\n#100=#5061\nM99\n"
    second = "O0004\nM08\nM99\n"
    back = f"M98 P3\nG90 G00 X0 Y0 Z5.\n{CUT.format(x=20)}"
    text = "%\n" + program("O0001", 30, back) + program("O0002", 60) + probe + second + "%\n"
    written, report, said = written_alone(tmp_path, text)
    assert [place.address for place in programs_of(written.encode())] == ["O0001", "O0003", "O0004"]
    assert written.endswith(f"M30\n{probe}{second}%\n")
    assert "calls of O0003, O0004 were kept" in said
    assert report["bytes_emitted"] == len(written) - len(probe) - len(second)
    # The header's mark is that of the program alone, and holds for it in the file.
    checked = run(tmp_path, "check", "out.nc", "-m", "vx500", "--program", "O1", "--json", "c.json")
    found = json.loads((tmp_path / "c.json").read_text())
    assert checked.returncode == 0 and "edited" not in found["counts_by_code"]
    # All of them: the two are expanded there, and unchanged.
    every(tmp_path, "convert", "--shape-all", "-o", "whole.nc")
    whole = (tmp_path / "whole.nc").read_bytes()
    assert [place.address for place in programs_of(whole)] == ["O0001", "O0002", "O0003", "O0004"]
    assert whole.endswith(f"{probe}{second}%\n".encode())


def test_check_weighs_the_program_that_was_asked_for_and_not_the_file(tmp_path: Path) -> None:
    large = program("O0002", 60).replace("M30", "(" + "X" * 50 + ")\nM30")
    loop = "O0005\nWHILE [#1 LT 3] DO1\n#1=#1+1\nEND1\nM30\n"
    text = "%\n" + program("O0001", 30) + large + loop + "%\n"
    room = len(program("O0001", 30))
    punch(tmp_path, text)

    def found(*words: str) -> dict[str, Any]:
        run(tmp_path, "check", "all.nc", "-m", "vx500", "--json", "r.json", *words)
        return json.loads((tmp_path / "r.json").read_text())

    memory = ("--set", f"controller.program_memory_bytes={room}")
    one, two = found("--program", "O1", *memory), found("--program", "O2", *memory)
    assert (one["size_bytes"], two["size_bytes"]) == (room, len(large))
    assert "program_memory" not in one["counts_by_code"]
    assert two["counts_by_code"]["program_memory"] == 1
    assert f"the program has {len(large)} bytes" in json.dumps(two["findings"])
    every = found("--program", "all", *memory)
    assert [report["size_bytes"] for report in every] == [room, len(large), len(loop)]
    assert ["program_memory" in report["counts_by_code"] for report in every] == [False, True, False]
    # What cannot be drip fed is told of the program that holds it, at its line of the file.
    fed = ("--set", "controller.dnc_baud=9600")
    assert "macro_in_dnc" not in found("--program", "O1", *fed)["counts_by_code"]
    lines = [each["line"] for each in found("--program", "O5", *fed)["findings"] if each["code"] == "macro_in_dnc"]
    assert lines[0] == 1 + text.split("WHILE")[0].count("\n")
