"""``shapegcode batch``: the bytes of the single command, nothing done twice, and no run that ends the others."""

import csv
import json
import os
import signal
import subprocess
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import shapegcode as sg
from command import COMMAND, run
from shapegcode.batching import batch as batching
from shapegcode.batching.plan import called_files, find_programs
from shapegcode.results.json import plain

HEAD = "%\nO0001\nG90 G21 G17 G54\nG0 X0 Y0 Z5.\nG1 Z0. F3000.\n"
TAIL = "G0 Z5.\nM30\n%\n"
BAD = HEAD + "G99.9 X1.\n" + TAIL
CALLER = HEAD + "M98 P1234\n" + TAIL
LONG = HEAD + "X1.\nX0.\n" * 700_000 + TAIL  # takes seconds, wherever it is timed
CALLED = "O1234\nG1 X{x}. Y10.\nM99\n"
ONE = ("-m", "vx500", "-o", "out", "--jobs", "1")


def part(x: int) -> str:
    return HEAD + f"X{x}. Y40.\nX60. Y0.\n" + TAIL


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two good programs, one of them in a folder below, one that calls, one that is refused."""
    monkeypatch.chdir(tmp_path)
    for name, text in {
        "parts/a.nc": part(30), "parts/deep/a.nc": part(20), "parts/bad.nc": BAD, "parts/caller.nc": CALLER,
        "parts/notes.md": "no program", "mine.toml": sg.Machine.builtin_text("vx500"),
    }.items():  # fmt: skip
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    (tmp_path / "parts" / "lib").mkdir()
    (tmp_path / "parts" / "O1234").write_text(CALLED.format(x=9))
    return tmp_path


def told(folder: Path, *words: str, code: int = 1) -> dict[str, Any]:
    """The JSON of a batch, by program."""
    done = run(folder, "batch", "--json", "batch.json", *words)
    assert done.returncode == code, done.stdout + done.stderr
    report: dict[str, Any] = json.loads((folder / "batch.json").read_text())
    return report


def fresh(report: dict[str, Any]) -> list[str]:
    """What was not done by an earlier batch."""
    return [row["program"] for row in report["rows"] if not row["earlier"]]


def contents(*folders: Path) -> dict[str, bytes]:
    """Every result in some folders, without the manifest and the summary, which have times."""
    return {
        str(file.relative_to(folder.parent)): file.read_bytes()
        for folder in folders
        for file in folder.rglob("*")
        if file.is_file() and file.name not in ("batch.jsonl", "summary.csv", "index.html")
    }


@pytest.mark.slow
def test_the_bytes_are_those_of_the_single_command(folder: Path) -> None:
    report = told(folder, "parts", *ONE, "--html", "pages", "--", "--shaper", "zvd")
    ended = {row["program"]: row["ended"] for row in report["rows"]}
    assert ended == {
        "parts/a.nc": "ok", "parts/bad.nc": "refused", "parts/caller.nc": "ok", "parts/deep/a.nc": "ok",
    }  # fmt: skip
    assert report["warnings"] == ["subprograms (M99), converted where they are called: parts/O1234"]
    (refused,) = (row for row in report["rows"] if row["ended"] == "refused")
    assert "parts/bad.nc:6:1: " in refused["answer"]
    found = contents(folder / "out", folder / "pages")
    for name in ("a.nc", "deep/a.nc", "caller.nc"):
        words = ["convert", f"parts/{name}", "-m", "vx500", "-o", f"out/{name}", "--json", f"out/{name}.json"]
        words += ["--html", f"pages/{name}.html", "--html-script", "beside", "-q", "--shaper", "zvd"]
        assert run(folder, *words).returncode == 0
    assert contents(folder / "out", folder / "pages") == found
    assert not list(folder.glob("out/bad*"))
    assert not (folder / "out" / ".batch-scratch").exists()
    index = (folder / "pages" / "index.html").read_text()
    assert '<a href="deep/a.nc.html">' in index


def test_the_summary_has_the_figures_of_the_reports(folder: Path) -> None:
    told(folder, "parts/a.nc", "-m", "vx500", "-m", "mine.toml", "-o", "out", code=0)
    rows = list(csv.DictReader((folder / "out" / "summary.csv").read_text().splitlines()))
    assert [row["machine"] for row in rows] == ["vx500", "mine.toml"]
    for row in rows:
        report = json.loads(Path(row["report"]).read_text())
        assert row["report"] == f"out/{Path(row['machine']).stem}/a.nc.json"
        assert float(row["cycle_time_s.emitted"]) == report["cycle_time_s"]["emitted"]
        residual = report["residual_vibration_um"]["original"].values()
        assert float(row["residual_um.original"]) == max(residual)


def test_resume_does_what_is_missing_or_changed_and_nothing_else(folder: Path) -> None:
    """A changed program, a changed subprogram, a lost or touched result, another option, another machine file."""
    words = ["parts", "-m", "mine.toml", "-o", "out", "--jobs", "1", "--resume", "--command", "time"]
    assert len(fresh(told(folder, *words))) == 4
    assert fresh(told(folder, *words)) == []
    (folder / "parts/a.nc").write_text(part(31))
    assert fresh(told(folder, *words)) == ["parts/a.nc"]
    (folder / "parts/O1234").write_text(CALLED.format(x=8))
    assert fresh(told(folder, *words)) == ["parts/caller.nc"]
    (folder / "out/deep/a.nc.json").unlink()
    (folder / "out/a.nc.json").write_text("{}")
    assert fresh(told(folder, *words)) == ["parts/a.nc", "parts/deep/a.nc"]
    assert len(fresh(told(folder, *words, "--", "--override", "80%"))) == 4
    (folder / "mine.toml").write_text((folder / "mine.toml").read_text() + "\n# measured\n")
    assert len(fresh(told(folder, *words, "--", "--override", "80%"))) == 4
    # A row that was cut off in the middle was never there.
    manifest = folder / "out" / "batch.jsonl"
    manifest.write_bytes(manifest.read_bytes()[:-20])
    assert len(fresh(told(folder, *words, "--", "--override", "80%"))) == 1


@pytest.mark.slow
def test_an_older_result_of_another_name_goes(folder: Path) -> None:
    """Out of tolerance the program has another name: the one that passed before must not stand beside it."""
    told(folder, "parts/a.nc", *ONE, code=0)
    assert (folder / "out/a.nc").exists()
    tight = ("--", "--set", "tolerance.contour_um=0.001", "--set", "shaping.contour=off", "--shape-all")
    (row,) = told(folder, "parts/a.nc", *ONE, *tight)["rows"]
    if row["ended"] == "refused":
        assert not (folder / "out/a.nc").exists()
    else:
        assert row["ended"] == "not ok"
        assert Path(row["output"]).exists()
        assert row["output"] != "out/a.nc"
        assert not (folder / "out/a.nc").exists()


def test_resume_from_another_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is done stays done, what is missing gets the bytes of the first folder, and rows are named from here."""
    told(folder, "parts", "-m", "mine.toml", "-o", "out", "--html", "pages", "--command", "time")
    whole = contents(folder / "out", folder / "pages")
    (folder / "out/a.nc.json").unlink()
    (folder / "pages/caller.nc.html").unlink()
    (folder / "elsewhere").mkdir()
    monkeypatch.chdir(folder / "elsewhere")
    words = ["../parts", "-m", "../mine.toml", "-o", str(folder / "out"), "--html", "../pages", "--command", "time"]
    report = told(folder / "elsewhere", *words, "--resume")
    assert contents(folder / "out", folder / "pages") == whole
    assert fresh(report) == ["../parts/a.nc", "../parts/caller.nc"]
    for row in report["rows"]:
        assert row["report"] == ("" if row["ended"] == "refused" else row["program"].replace("parts", "out") + ".json")
        assert not row["report"] or Path(row["report"]).exists()
    assert {file.name for file in Path.cwd().iterdir()} == {"batch.json"}


def test_what_pages_share_stays(folder: Path) -> None:
    """The script beside them, when a program with a page is refused later."""
    words = ["parts/a.nc", "parts/caller.nc", *ONE, "--html", "pages", "--command", "time", "--resume"]
    told(folder, *words, code=0)
    (script,) = (folder / "pages").glob("plotly-*.js")
    (folder / "parts/a.nc").write_text(BAD)
    assert fresh(told(folder, *words)) == ["parts/a.nc"]
    assert script.exists()
    assert not (folder / "pages/a.nc.html").exists()


def test_files_that_cannot_be_read_or_written_are_rows(folder: Path) -> None:
    (folder / "parts/link.nc").symlink_to("nowhere.nc")
    (folder / "parts" / f"{'n' * 250}.nc").write_text(part(7))
    os.mkfifo(folder / "parts/pipe.nc")
    (folder / "out").mkdir()
    (folder / "out/deep").write_text("mine")
    ended = {row["program"]: row for row in told(folder, "parts", *ONE, "--command", "time")["rows"]}
    assert len(ended) == 6
    assert ended["parts/a.nc"]["ended"] == "ok"
    assert ended["parts/link.nc"]["answer"] == "parts/link.nc: No such file or directory"
    assert ended["parts/deep/a.nc"]["answer"] == "out/deep: File exists"
    assert ended[f"parts/{'n' * 250}.nc"]["answer"].endswith("File name too long")
    assert (folder / "out/deep").read_text() == "mine"


def test_rows_from_python(folder: Path) -> None:
    found = sg.batch(["parts"], ["vx500"], "out", command="time", jobs=1)
    rows = list(found.rows)
    assert [row.program for row in found.rows[1:3]] == ["parts/bad.nc", "parts/caller.nc"]
    assert found.rows[-1] == rows[-1]
    assert found.to_dict()["rows"] == list(found.to_json()["rows"]) == [plain(row) for row in rows]
    assert list(found.to_pandas("rows")["program"]) == [row.program for row in rows]
    (folder / "parts/a.nc").write_text(BAD)
    later = sg.batch(["parts"], ["vx500"], "out", command="time", jobs=1)
    assert list(found.rows) == rows
    assert later.counts["refused"] == 2


def test_the_index_lists_more_than_the_terminal(folder: Path) -> None:
    found = sg.batch(["parts/a.nc"], ["vx500"], "out", command="time", jobs=1)
    many = replace(found, rows=(replace(found.rows[0], page="pages/a.nc.html"),) * 30)
    assert (len(many.tables()[0].rows), many.tables()[0].caption) == (20, f"and 10 more: {found.summary}")
    (table,) = replace(many, html="pages").tables()
    assert (len(table.rows), table.caption) == (30, "")


def test_a_run_that_takes_too_long_ends_alone(folder: Path) -> None:
    (folder / "parts/long.nc").write_text(LONG)
    words = ["parts/a.nc", "parts/long.nc", *ONE, "--command", "time"]
    a, long = told(folder, *words, "--time-limit", "400ms")["rows"]
    assert (a["ended"], long["ended"]) == ("ok", "failed")
    assert long["answer"] == "stopped after 0.4 s (--time-limit)"
    a, long = told(folder, *words, "--memory-limit", "8M", "--resume")["rows"]
    assert (a["ended"], a["earlier"], long["ended"]) == ("ok", True, "failed")
    assert "needs more than 8 MB (--memory-limit)" in long["answer"]
    a, long = told(folder, *words, "--resume", code=0)["rows"]
    assert (long["ended"], long["earlier"]) == ("ok", False)


def test_a_killed_process_is_a_row(folder: Path) -> None:
    (folder / "parts/long.nc").write_text(LONG)
    killed: list[int] = []

    def kill() -> None:
        for _ in range(600):
            found = subprocess.run(["pgrep", "-f", "shapegcode.cli.host"], capture_output=True, text=True, check=False)
            mine = [int(pid) for pid in found.stdout.split() if parent_of(int(pid)) == os.getpid()]
            if mine and (folder / "out/.batch-scratch").is_dir() and list((folder / "out/.batch-scratch").iterdir()):
                time.sleep(0.3)
                os.kill(mine[0], signal.SIGKILL)
                killed.append(mine[0])
                return
            time.sleep(0.05)

    killer = threading.Thread(target=kill)
    killer.start()
    long, a = told(folder, "parts/long.nc", "parts/a.nc", *ONE)["rows"]
    killer.join()
    assert killed
    assert (long["ended"], long["answer"]) == ("failed", "the process that ran it was killed")
    assert a["ended"] == "ok"


def parent_of(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[1])
    except OSError:
        return 0


def test_a_full_disk_stops_it_and_loses_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ("parts", *ONE, "--command", "time")
    told(folder, *words)
    whole = contents(folder / "out")
    write = batching.write_bytes
    for room in (0, 2):
        left = [room]

        def full(path: str, data: bytes, left: list[int] = left) -> None:
            left[0] -= 1
            if left[0] < 0:
                raise OSError(28, os.strerror(28), str(path))
            write(path, data)

        monkeypatch.setattr(batching, "write_bytes", full)
        subprocess.run(["rm", "-r", "out"], check=True)
        report = told(folder, *words)
        assert "No space left on device" in report["warnings"][0]
        assert report["not_done"] > 0
        monkeypatch.setattr(batching, "write_bytes", write)
        told(folder, *words, "--resume")
        assert contents(folder / "out") == whole


def test_ctrl_c_says_how_to_go_on(folder: Path) -> None:
    (folder / "parts/long.nc").write_text(HEAD + "".join(f"X{k % 100}. Y{k % 7}.\n" for k in range(150_000)) + TAIL)
    words = [COMMAND, "batch", "parts/a.nc", "parts/long.nc", *ONE]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for _ in range(400):
        if (folder / "out/a.nc").exists():
            break
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate()
    assert process.returncode == 130, out + err
    assert "resume with: shapegcode batch --resume parts/a.nc parts/long.nc" in out
    assert {file.name for file in (folder / "out").iterdir()} == {"a.nc", "a.nc.json", "batch.jsonl", "summary.csv"}


def test_one_batch_at_a_time(folder: Path) -> None:
    from shapegcode.batching.manifest import Manifest

    held = Manifest(folder / "out", resume=True)
    done = run(folder, "batch", "parts", *ONE)
    held.close()
    assert done.returncode == 2
    assert "out: another batch is writing there" in done.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("nothing", *ONE), "nothing: no such file, folder or match"),
        (("lib", *ONE), "lib: no program in it; programs end in .nc"),
        (("parts/a.nc", "parts/deep/a.nc", *ONE), "would both be written to a.nc"),
        (("@empty.txt", *ONE), "empty.txt: the list contains no program"),
        (("@gone.txt", *ONE), "gone.txt:3: gone.nc: no such file, folder or match"),
        (("@nested.txt", *ONE), "nested.txt:1: @gone.txt: a list must not contain lists"),
        (("@bytes.txt", *ONE), "bytes.txt: not a list of programs: it is not text"),
        (("parts/d*", *ONE), "parts/d*: no such file, folder or match"),
        (("only", *ONE), "only/O5: a subprogram (M99)"),
        (("parts", "-m", "none.toml", "-o", "out"), "none.toml: no such file"),
        (("parts", "-m", "vx500", "-m", "vx500", "-o", "out"), "two machines would be written to out/vx500"),
        (("parts", *ONE, "--", "--shaper", "none"), "--shaper"),
        (("parts", *ONE, "--", "--json", "x.json"), "--json after --: is a file of one run"),
        (("parts", *ONE, "--scheduler", "tcp://127.0.0.1:9"), "no answer from a scheduler"),
        (("parts", "-m", "vx500", "-o", "full"), "full/batch.jsonl: not a manifest of this version"),
    ],
    ids=str,
)
def test_what_cannot_be_started(
    folder: Path, words: tuple[str, ...], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shapegcode.batching.process._WAIT_S", 1)
    (folder / "lib").mkdir()
    (folder / "full").mkdir()
    (folder / "full/batch.jsonl").write_text("{}\n")
    (folder / "empty.txt").write_text("# none yet\n\n")
    (folder / "gone.txt").write_text("parts/a.nc\n\ngone.nc # it was\n")
    (folder / "nested.txt").write_text("@gone.txt\n")
    (folder / "bytes.txt").write_bytes(b"\xff\xfe")
    (folder / "only").mkdir()
    (folder / "only/O5").write_text("O5\nM99\n")
    done = run(folder, "batch", *words)
    assert done.returncode == 2
    assert said in done.stderr
    assert not list(folder.glob("out/*"))


def test_programs_are_found(folder: Path) -> None:
    (folder / "parts/out").mkdir()
    (folder / "parts/out/z.nc").write_text(part(1))
    (folder / "list.txt").write_text("parts/a.nc  # the first\n\nparts/deep/a.nc\n")
    places = {source.path: source.place for source in find_programs(["parts"], "parts/out")}
    assert places == {f"parts/{name}": name for name in ("O1234", "a.nc", "bad.nc", "caller.nc", "deep/a.nc")}
    assert [source.place for source in find_programs(["parts/**/a.nc"], "out")] == ["a.nc", "deep/a.nc"]
    with pytest.raises(sg.ArgumentError, match="would both be written"):
        find_programs(["@list.txt"], "out")
    assert len(find_programs(["parts", "parts/a.nc", str(folder / "parts" / "a.nc")], "parts/out")) == 5


def test_results_of_another_batch_are_no_programs(folder: Path) -> None:
    told(folder, "parts/a.nc", "-m", "vx500", "-o", "parts/done", code=0)
    assert len(find_programs(["parts"], "out")) == 5
    with pytest.raises(sg.ArgumentError, match="no program in it"):
        find_programs(["parts/done"], "out")


def test_a_file_of_several_programs(folder: Path) -> None:
    (folder / "memory.nc").write_text(
        part(30).replace("%\n", "") + part(20).replace("%\n", "").replace("O0001", "O0002")
    )
    (row,) = told(folder, "memory.nc", *ONE, "--", "--program", "all", code=0)["rows"]
    assert (row["ended"], row["output"]) == ("ok", "out/memory.nc")
    assert row["residual_um"] is None
    assert len(json.loads((folder / row["report"]).read_text())) == 2


def test_what_a_program_may_call_travels_with_it(folder: Path) -> None:
    """Beside it, through several, in the machine's folders; computed numbers take all that are there."""
    machine = sg.Machine.load("vx500").with_values({"input.program_folders": ["parts/lib"]})
    (folder / "parts/lib/O9001.nc").write_text("O9001\nG65 P9002 A1.\nM99\n")
    (folder / "parts/lib/O9002").write_text("O9002\nX1.\nM99\n")
    (folder / "parts/c.nc").write_text(HEAD + "M98 P9001\n" + TAIL)
    assert sorted(name for name, _ in called_files("parts/c.nc", machine)) == ["parts/O9002", "parts/O9001.nc"][::-1]
    (folder / "parts/c.nc").write_text(HEAD + "M98 P[#1+1]\n" + TAIL)
    found = {Path(name).name for name, _ in called_files("parts/c.nc", machine)}
    assert found == {"O1234", "O9001.nc", "O9002"}
    assert list(called_files("parts/a.nc", machine)) == []


@pytest.mark.slow
def test_on_a_cluster_of_this_machine_the_bytes_are_the_same(folder: Path) -> None:
    told(folder, "parts", *ONE)
    whole = contents(folder / "out")
    subprocess.run(["rm", "-r", "out"], check=True)
    told(folder, "parts", *ONE, "--scheduler", "local")
    assert contents(folder / "out") == whole
