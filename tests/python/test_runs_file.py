"""RUNS.toml: which program made which log, and what is wrong in it."""

import os
from pathlib import Path

import pytest

import shapegcode as sg

NIST = Path(__file__).resolve().parents[2] / "python" / "shapegcode" / "data" / "measured" / "nist"


def folder_with(tmp_path: Path, text: str) -> Path:
    for name in ("a.nc", "b.nc"):
        (tmp_path / name).write_text("%\nO0012(PART)\nG0X1.\nM30\n%\n")
    (tmp_path / "logs").mkdir()
    for name, program in (("a-2", "O12"), ("a-10", "O12"), ("day", "b.nc"), ("nameless", "")):
        (tmp_path / "logs" / f"{name}.txt").write_text(
            f"2026-03-02T08:00:00Z|execution|ACTIVE|program|{program}\n2026-03-02T08:00:01Z|line|2\n"
            "2026-03-02T08:00:02Z|execution|PROGRAM_COMPLETED\n"
        )
    path = tmp_path / "RUNS.toml"
    path.write_text(text, encoding="utf-8")
    return path


def refused(tmp_path: Path, text: str, *messages: str) -> None:
    path = folder_with(tmp_path, text)
    with pytest.raises(sg.RunsFileError) as error:
        sg.load_runs(path)
    assert str(error.value).splitlines() == [f"{path}{message}" for message in messages]
    assert isinstance(error.value, sg.FileError)


def test_a_file_with_every_key(tmp_path: Path) -> None:
    path = folder_with(
        tmp_path,
        """
# a remark
[[runs]]
program = "a.nc"
logs = ["logs/a-*.txt", "logs/nameless.txt"]
feed_unit = "in/min"
items = { block = "line", status = "execution" }
format = "shdr"
override_percent = 90
rapid_override_percent = 50.0

[[runs]]
program = "b.nc"
log = "logs/day.txt"
use = "test"
logged_as = "B"

[[runs]]
program = "gone.nc"
log = "logs/a-2.txt"
leave_out = "the door was opened"
""",
    )
    runs = sg.load_runs(path)
    first, second, third = runs.entries
    assert first == sg.RunEntry(
        program=tmp_path / "a.nc",
        logs=tuple(tmp_path / "logs" / f"{name}.txt" for name in ("a-10", "a-2", "nameless")),
        feed_unit="inch/min",
        items=(("block", "line"), ("status", "execution")),
        format="shdr",
        override_percent=90,
        rapid_override_percent=50.0,
        line=3,
    )
    assert (second.use, second.logged_as, second.override_percent, second.line) == ("test", "B", None, 12)
    assert third.leave_out == "the door was opened"
    assert runs.used == (first, second)
    assert first.names == ("a.nc", "O0012")
    assert [run.feed_unit for run in first.read()] == [None, None, None]  # no feed in these logs


def test_paths_are_relative_to_the_file(tmp_path: Path) -> None:
    path = folder_with(tmp_path, '[[runs]]\nprogram = "a.nc"\nlog = "logs/a-2.txt"\n')
    here = Path.cwd()
    os.chdir("/")
    try:
        (entry,) = sg.load_runs(path).entries
        assert len(entry.read()) == 1
    finally:
        os.chdir(here)


def test_logs_of_nist(tmp_path: Path) -> None:
    path = tmp_path / "RUNS.toml"
    path.write_text(
        "".join(
            f"[[runs]]\nprogram = '{NIST}/programs/{name}.NC'\nlog = '{NIST}/logs/{name}-run*.gz'\nfeed_unit = 'mm/s'\n"
            for name in ("COVER", "PLATE-12")
        )
    )
    cover, plate = sg.load_runs(path).used
    assert [round(run.duration_s or 0.0, 1) for run in cover.read()] == [80.1, 80.1, 80.1, 80.2]
    (run,) = plate.read()
    assert (run.program, run.feed_unit) == ("NIST_MTC_CRADA_PLATE-12.NC", "mm/s")


def test_a_log_of_several_programs(tmp_path: Path) -> None:
    """Each program takes the runs that name it; a run that names none belongs to nobody."""
    both = '[[runs]]\nprogram = "a.nc"\nlog = "logs/day.txt"\n[[runs]]\nprogram = "b.nc"\nlog = "logs/day.txt"\n'
    path = folder_with(tmp_path, both)
    day = tmp_path / "logs" / "day.txt"
    day.write_text(day.read_text() + (tmp_path / "logs" / "a-2.txt").read_text().replace("T08", "T09"))
    first, second = sg.load_runs(path).entries
    assert [run.start for run in first.read()] == ["2026-03-02T09:00:00Z"]
    # b.nc begins with O0012 too: a copy under another name; what it is called in the log tells them apart.
    assert [run.program for run in second.read()] == ["b.nc", "O12"]
    path.write_text(both.replace("day", "nameless"))
    with pytest.raises(sg.RecordError, match=r"a log of several programs, and a run in it .* names none"):
        sg.load_runs(path).entries[0].read()


def test_the_log_names_another_program(tmp_path: Path) -> None:
    path = folder_with(tmp_path, '[[runs]]\nprogram = "a.nc"\nlog = "logs/day.txt"\n')
    (entry,) = sg.load_runs(path).entries
    with pytest.raises(sg.RecordError, match=r"day.txt: no run of a.nc or O0012; the log names b.nc"):
        entry.read()


def test_wrong_keys_and_values_are_listed_with_their_lines(tmp_path: Path) -> None:
    refused(
        tmp_path,
        """[[runs]]
program = "a.nc"
log = "logs/a-2.txt"
usage = "fit"
use = "learn"
format = "xls"
override_percent = 0
leave_out = ""
[[runs]]
program = 7
logs = []
""",
        ':5: runs.1.use = "learn": must be "fit" or "test"',
        ':6: runs.1.format = "xls": must be "shdr", "mtconnect", "edge" or "csv"',
        ":7: runs.1.override_percent = 0: must be greater than 0 (unit: %)",
        ':8: runs.1.leave_out = "": string should have at least 1 character',
        ':4: runs.1.usage = "fit": unknown key; did you mean use?',
        ":10: runs.2.program = 7: must be a text in quotes",
        ":11: runs.2.logs = []: must have 1 or more values",
    )


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("", ":1: runs.1: one of log and logs is required"),
        ('log = "x"\nlogs = ["y"]', ':4: runs.1.logs = ["y"]: specify only one of log and logs'),
        ('log = "logs/a-2.txt"\nfeed_unit = "knots"', ":4: runs.1.feed_unit"),
        ('log = "logs/a-2.txt"\nitems = { blok = "line" }', ":4: runs.1.items"),
    ],
)
def test_what_does_not_fit_together(tmp_path: Path, lines: str, message: str) -> None:
    path = folder_with(tmp_path, f'[[runs]]\nprogram = "a.nc"\n{lines}\n')
    with pytest.raises(sg.RunsFileError) as error:
        sg.load_runs(path)
    assert str(error.value).startswith(f"{path}{message}"), error.value


def test_files_that_are_not_there_and_logs_twice(tmp_path: Path) -> None:
    refused(
        tmp_path,
        """[[runs]]
program = "c.nc"
logs = ["logs/c-*.txt", "logs/a-2.txt", "logs/a-*.txt"]
[[runs]]
program = "a.nc"
log = "logs"
""",
        ':2: runs.1.program = "c.nc": no such file',
        ':3: runs.1.logs = "logs/c-*.txt": matches no file',
        ':3: runs.1.logs = "logs/a-*.txt": a-2.txt is already a log of runs.1: each run counts once',
        ':6: runs.2.log = "logs": no such file',
    )


def test_no_runs_and_no_toml(tmp_path: Path) -> None:
    refused(tmp_path, "", ": runs: required, but missing")
    (tmp_path / "RUNS.toml").write_text("runs = 3\n[[runs")
    with pytest.raises(sg.RunsFileError, match=r"RUNS\.toml:"):
        sg.load_runs(tmp_path / "RUNS.toml")
    with pytest.raises(FileNotFoundError):
        sg.load_runs(tmp_path / "none.toml")
