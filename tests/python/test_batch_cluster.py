"""A batch on a real Dask scheduler with two workers: the same bytes, also when a worker or the client is killed."""

import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from command import COMMAND, run
from test_batch import HEAD, TAIL, contents

pytestmark = pytest.mark.slow

WORDS = ("batch", "parts", "-m", "vx500", "-o", "out", "--command", "time")
DASK = Path(sys.executable).with_name("dask")


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Its address, and its workers, whose folder has nothing of the batch in it."""
    folder = tmp_path_factory.mktemp("cluster")
    address = f"tcp://127.0.0.1:{free_port()}"

    def begin(*words: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen([DASK, *words], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    scheduler = begin("scheduler", "--host", "127.0.0.1", "--port", address.rsplit(":", 1)[1], "--no-dashboard")
    workers = [begin("worker", address, "--nthreads", "1", "--no-dashboard", "--no-nanny") for _ in range(2)]
    from distributed import Client

    with Client(address, set_as_default=False) as client:  # type: ignore[no-untyped-call]
        client.wait_for_workers(2)
    yield address, workers
    for process in (*workers, scheduler):
        process.kill()
        process.wait()


@pytest.fixture
def whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, bytes]:
    """Twelve programs, one of them refused, one that calls another, and what one process makes of them."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "parts").mkdir()
    for rank in range(10):
        moves = "".join(f"X{k % 90}. Y{k * rank % 40}.\n" for k in range(4000))
        (tmp_path / "parts" / f"p{rank}.nc").write_text(HEAD + moves + TAIL)
    (tmp_path / "parts" / "bad.nc").write_text(HEAD + "G99.9\n" + TAIL)
    (tmp_path / "parts" / "caller.nc").write_text(HEAD + "M98 P1234\n" + TAIL)
    (tmp_path / "parts" / "O1234").write_text("O1234\nG1 X9. Y10.\nM99\n")
    run(tmp_path, *WORDS, "--jobs", "1")
    found = contents(Path("out"))
    assert len(found) == 11
    shutil.rmtree("out")
    return found


def test_a_killed_worker(
    tmp_path: Path, whole: dict[str, bytes], cluster: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    address, workers = cluster
    client = subprocess.Popen([COMMAND, *WORDS, "--scheduler", address], stdout=subprocess.PIPE, text=True)
    wait_for(2)
    workers[0].send_signal(signal.SIGKILL)
    out, _ = client.communicate()
    assert client.returncode == 1, out
    assert "11 of 12 runs of time are ok; 1 refused" in out
    assert contents(Path("out")) == whole


def test_a_killed_client(
    tmp_path: Path, whole: dict[str, bytes], cluster: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    address, _ = cluster
    client = subprocess.Popen([COMMAND, *WORDS, "--scheduler", address], stdout=subprocess.DEVNULL)
    wait_for(2)
    client.kill()
    client.wait()
    kept = contents(Path("out"))
    assert 0 < len(kept) < len(whole)
    done = run(tmp_path, *WORDS, "--scheduler", address, "--resume")
    assert done.returncode == 1, done.stderr
    assert "by an earlier batch" in done.stdout
    assert contents(Path("out")) == whole


def wait_for(count: int) -> None:
    """Until so many results are there."""
    for _ in range(1200):
        if len(list(Path("out").glob("*.json"))) >= count:
            return
        time.sleep(0.02)


def test_a_worker_of_another_version_is_named(
    tmp_path: Path, whole: dict[str, bytes], cluster: tuple[str, list[subprocess.Popen[bytes]]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr("shapegcode.batching.process._own_version", lambda: "shapegcode 0.0.0")
    done = run(tmp_path, *WORDS, "--scheduler", cluster[0])
    assert done.returncode == 2
    assert "this is shapegcode 0.0.0: install the same everywhere" in done.stderr
    assert not Path("out").exists()
