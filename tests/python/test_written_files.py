"""Files that are written: many writers, full disks, links in a circle, Ctrl-C and kills at random instants."""

import errno
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import shapegcode as sg
from command import run
from effort import trials
from faults import command, hear_ctrl_c, sound
from shapegcode.io.data_file import is_temporary, write_text
from test_data_limits import PROGRAM, M, no_wait

LONG = PROGRAM.replace("Y10.\n", "".join(f"Y{k}.\nX{k}.\n" for k in range(8)))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "p.nc").write_text(LONG)
    return tmp_path


def test_threads_that_write_one_file_leave_one_of_their_texts(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    texts = [str(rank) * 50_000 for rank in range(4)]
    failed: list[Exception] = []

    def write(text: str) -> None:
        for _ in range(50):
            try:
                write_text(target, text)
            except Exception as error:
                failed.append(error)

    threads = [threading.Thread(target=write, args=(text,)) for text in texts]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failed == []
    assert target.read_text() in texts
    assert os.listdir(tmp_path) == ["a.txt"]


def test_what_a_killed_process_left_behind_is_nobodys_business(tmp_path: Path) -> None:
    """In a container each process has the number of the one before it."""
    stale = tmp_path / f".a.txt.{os.getpid()}.tmp"
    stale.write_text("half")
    write_text(tmp_path / "a.txt", "whole")
    assert (tmp_path / "a.txt").read_text() == "whole" and stale.read_text() == "half"
    assert is_temporary(stale)
    write_text(tmp_path / ("a" * 250), "a name as long as the system lets it be")


@pytest.mark.parametrize("words", [("convert", "p.nc", *M, "-o", "FILE"), ("time", "p.nc", *M, "--json", "FILE")])
def test_links_in_a_circle_are_refused_and_stay(words: tuple[str, ...], folder: Path) -> None:
    (folder / "a").symlink_to("b")
    (folder / "b").symlink_to("a")
    done = run(folder, *(word.replace("FILE", "a") for word in words))
    assert done.returncode == 2 and f"a: {os.strerror(errno.ELOOP)}" in done.stderr
    assert (folder / "a").is_symlink() and (folder / "b").is_symlink()
    with pytest.raises(OSError, match=os.strerror(errno.ELOOP)):
        write_text(folder / "a", "new", overwrite=False)


WRITTEN = {
    "program": ("convert", "p.nc", *M, "-o", "FILE"),
    "json": ("time", "p.nc", *M, "--json", "FILE"),
    "csv": ("simulate", "p.nc", *M, "--csv", "FILE"),
    "npz": ("simulate", "p.nc", *M, "--npz", "FILE"),
    "page": ("time", "p.nc", *M, "--html", "FILE"),
    "machine": ("machine", "init", "vx500", "--force", "-o", "FILE"),
    "expanded": ("expand", "p.nc", *M, "-o", "FILE"),
}


@pytest.mark.parametrize("kind", WRITTEN)
def test_a_full_disk_is_told_with_the_name_of_the_file(kind: str, folder: Path) -> None:
    done = run(folder, *(word.replace("FILE", "/dev/full") for word in WRITTEN[kind]))
    assert done.returncode == 2, done.stderr
    assert f"/dev/full: {os.strerror(errno.ENOSPC)}" in done.stderr
    assert Path("/dev/full").is_char_device()


def test_a_picture_for_which_there_is_no_room_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.png").symlink_to("/dev/full")
    from matplotlib.figure import Figure

    from shapegcode.results.plot import save

    with pytest.raises(OSError, match=r"a\.png"):
        save(Figure().subplots(), tmp_path / "a.png")


#: The command in a Python that looks for modules through `Finder`.
WITH_FINDER = """
import runpy, signal, sys
class Finder:
    def find_spec(self, name, *_):
        if name == MODULE:
            FOUND
sys.modules.pop(MODULE, None)
sys.meta_path.insert(0, Finder())
sys.argv = ["shapegcode", "convert", "p.nc", "-m", "vx500", "-o", "o.nc"]
runpy.run_module("shapegcode", run_name="__main__")
"""
INTERRUPT = "signal.raise_signal(signal.SIGINT)"
#: Python drops what is raised within a finalizer: the command would go on.
LAST = f"""
import signal
class Last:
    def __del__(self):
        {INTERRUPT}
        for _ in range(100):
            pass
"""


MODULES = ["argparse", "numpy", "shapegcode._core", "pydantic", "shapegcode.conversion.plan"]


@pytest.mark.parametrize(
    ("module", "found"), [*((each, INTERRUPT) for each in MODULES), ("numpy", "Last()")], ids=[*MODULES, "finalizer"]
)
def test_ctrl_c_while_modules_load_is_no_traceback(module: str, found: str, folder: Path) -> None:
    code = LAST + WITH_FINDER.replace("MODULE", repr(module)).replace("FOUND", found)
    sound(command(folder, python=("-c", code)), "shapegcode: stopped", code=130)
    assert not (folder / "o.nc").exists()


def test_ctrl_c_ends_what_does_not_end_by_itself(folder: Path) -> None:
    """A thread that waits for what never comes: Python would wait for it at its end."""
    code = """
import signal, sys, threading
from shapegcode import cli
cli._MAX_STOP_S = 1.0
threading.Thread(target=threading.Event().wait).start()
cli._run = lambda _words: signal.raise_signal(signal.SIGINT)
sys.exit(cli.main())
"""
    done = command(folder, python=("-c", code))
    sound(done, "shapegcode: stopped", code=130)
    assert done.said.count("stopped") == 1


def _interrupted(folder: Path, number: int, after_s: float) -> subprocess.CompletedProcess[str]:
    words = ("convert", "p.nc", *M, "-o", "o.nc", "--json", "o.json", "--html", "o.html")
    code = "print('begun', flush=True)\nfrom shapegcode.__main__ import main\nimport sys\nsys.exit(main())"
    process = subprocess.Popen(
        [sys.executable, "-c", code, *words], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=hear_ctrl_c,  # noqa: PLW1509 - no thread of this test runs yet
    )  # fmt: skip
    process.stdout.readline()
    time.sleep(after_s)
    process.send_signal(number)
    with no_wait():
        out, said = process.communicate()
    return subprocess.CompletedProcess(words, process.returncode, out, said)


@pytest.mark.parametrize("times", [4, pytest.param(trials(60), marks=pytest.mark.slow)])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_stopped_at_random_instants_no_half_file_is_there(number: int, times: int, folder: Path) -> None:
    whole = _interrupted(folder, 0, 0.0)
    assert whole.returncode in (0, 1)
    size = {name: (folder / name).stat().st_size for name in ("o.nc", "o.json", "o.html") if (folder / name).exists()}
    text = (folder / "o.nc").read_text()
    draw = random.Random(number)
    stopped = 0
    for _ in range(times):
        for file in folder.glob("o.*"):
            file.unlink()
        done = _interrupted(folder, number, draw.uniform(0.03, 2.0))
        assert "Traceback" not in done.stderr, done.stderr
        if number == signal.SIGINT:
            assert done.returncode in (0, 1, 130), done.stderr
        stopped += done.returncode in (130, -signal.SIGKILL)
        if (folder / "o.nc").exists():
            assert (folder / "o.nc").read_text() == text
        for name in ("o.json", "o.html"):
            assert not (folder / name).exists() or (folder / name).stat().st_size > 0.9 * size[name]
        left = [file.name for file in folder.iterdir() if is_temporary(file)]
        assert number == signal.SIGKILL or left == []
    assert stopped


def _be_nobody() -> None:
    """Root may write anywhere; anybody else is nobody enough."""
    if os.geteuid() != 0:
        return
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)


@pytest.mark.parametrize("kind", ["program", "json", "csv", "page", "machine"])
def test_a_folder_in_which_one_may_not_write_is_named(kind: str, folder: Path) -> None:
    for place in [folder, *folder.parents]:
        if place.is_relative_to("/tmp") and place != Path("/tmp"):
            place.chmod(0o755)
    (folder / "out").mkdir(mode=0o555)
    done = _as_nobody(folder, *(word.replace("FILE", "out/file") for word in WRITTEN[kind]))
    assert done.returncode == 2, done.stderr
    assert f"out/file: {os.strerror(errno.EACCES)}" in done.stderr and "Traceback" not in done.stderr
    assert not list((folder / "out").iterdir())
    (folder / "p.nc").chmod(0o600)
    done = _as_nobody(folder, "time", "p.nc", *M)
    assert done.returncode == 2 and f"p.nc: {os.strerror(errno.EACCES)}" in done.stderr


def _as_nobody(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Within a fork of this process: another user may not be allowed to read the package."""
    import importlib

    for name in ("convert", "programs", "machine", "several"):
        importlib.import_module(f"shapegcode.cli.{name}")
    run(folder, *(word.replace("out/file", "warm") for word in words))  # everything that it needs is loaded then
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            _be_nobody()
            done = run(folder, *words)
            os.write(writing, f"{done.returncode}\n{done.stderr}".encode())
        except BaseException as error:
            os.write(writing, f"99\n{error!r}".encode())
        finally:
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as stream:
        code, _, said = stream.read().partition("\n")
    os.waitpid(child, 0)
    return subprocess.CompletedProcess(words, int(code or 98), "", said)


def test_every_pool_is_as_large_as_the_processors_that_may_be_used(monkeypatch: pytest.MonkeyPatch) -> None:
    from shapegcode.program.computer import cores

    monkeypatch.delenv("SHAPEGCODE_THREADS", raising=False)
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    try:
        assert cores() == 1
    finally:
        os.sched_setaffinity(0, before)
    monkeypatch.setenv("SHAPEGCODE_THREADS", "3")
    assert cores() == 3
    package = Path(sg.__file__).parent
    users = [file for file in package.rglob("*.py") if "cpu_count" in file.read_text(encoding="utf-8")]
    assert users == [package / "program/computer.py"]


def test_every_module_loads_where_there_is_no_posix(tmp_path: Path) -> None:
    """As Windows has it: no fcntl, resource, pwd, termios; no fork, no affinity, no library of the process itself."""
    code = """
import importlib, os, pkgutil, sys
for name in ("fcntl", "resource", "grp", "termios", "tty"):
    sys.modules[name] = None
for name in ("fork", "wait4", "sched_getaffinity", "setsid", "killpg", "getuid", "geteuid", "O_NONBLOCK", "O_NOCTTY"):
    if hasattr(os, name):
        delattr(os, name)
import ctypes
def refuse(name, *_, **__):
    if name is None:
        raise TypeError("no library")
    return None
ctypes.CDLL = refuse
import shapegcode
for module in pkgutil.walk_packages(shapegcode.__path__, "shapegcode."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
from shapegcode.cli import main
assert main(["time", "p.nc", "-m", "vx500"]) == 0
"""
    (tmp_path / "p.nc").write_text(PROGRAM)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_solver_that_another_thread_took_is_made_anew() -> None:
    """Between looking and taking another thread may take the last one: here at every look."""
    from shapegcode.shaping import cutting_planes

    class Taken(list[object]):
        def __bool__(self) -> bool:
            return True

    before = cutting_planes._FREE
    cutting_planes._FREE = Taken()  # type: ignore[assignment]
    try:
        program = cutting_planes.LinearProgram(np.zeros(1), np.ones(1), (np.ones((1, 1)), np.ones(1)))
        program.set_cost(np.ones(1))
        assert program.solve() == pytest.approx([1.0])
    finally:
        cutting_planes._FREE = before
