"""A batch whose worker or client is killed (-9), or whose disk fills (a tmpfs, or writes that fail at random where
nobody may mount one), at random instants: --resume has the same bytes."""

import errno
import os
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from command import COMMAND, run
from effort import trials
from shapegcode.batching import batch as batching
from test_batch import HEAD, TAIL, contents, parent_of

TIMES = trials(20)
WORDS = ("batch", "parts", "-m", "vx500", "-o", "disk/out", "--html", "disk/pages", "--jobs", "2", "--command", "time")


@pytest.fixture
def whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, bytes]:
    """Five programs, and what an undisturbed batch makes of them."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "parts").mkdir()
    for rank in range(5):
        moves = "".join(f"X{k % 90}. Y{k * rank % 40}.\n" for k in range(100 * rank))
        (tmp_path / "parts" / f"p{rank}.nc").write_text(HEAD + moves + TAIL)
    assert run(tmp_path, *WORDS).returncode == 0
    found = contents(Path("disk/out"), Path("disk/pages"))
    assert len(found) == 11
    shutil.rmtree("disk")
    return found


def started() -> subprocess.Popen[bytes]:
    """A batch as a process of its own, whose first host has begun to load."""
    client = subprocess.Popen([COMMAND, *WORDS], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while not hosts(client.pid) and client.poll() is None:
        time.sleep(0.02)
    return client


def hosts(client: int) -> list[int]:
    """Processes that run its jobs."""
    found = subprocess.run(["pgrep", "-f", "shapegcode.cli.host"], capture_output=True, text=True, check=False)
    return [pid for pid in map(int, found.stdout.split()) if parent_of(pid) == client]


def children(pid: int) -> list[int]:
    found = subprocess.run(["pgrep", "-P", str(pid)], capture_output=True, text=True, check=False)
    return [int(child) for child in found.stdout.split()]


def resumed(folder: Path, whole: dict[str, bytes]) -> None:
    """Nothing of what stands there is half a file; then the rest is done, and nothing temporary stays."""
    before = contents(Path("disk/out"), Path("disk/pages"))
    before = {name: data for name, data in before.items() if not any(part[0] == "." for part in Path(name).parts)}
    assert before.items() <= whole.items()
    done = run(folder, *WORDS, "--resume")
    assert done.returncode == 0, done.stdout + done.stderr
    assert contents(Path("disk/out"), Path("disk/pages")) == whole
    names = {file.name for file in Path("disk/out").rglob("*")} | {file.name for file in Path("disk/pages").rglob("*")}
    assert not [name for name in names if name.startswith(".") or name.endswith(".tmp")]
    shutil.rmtree("disk/out")
    shutil.rmtree("disk/pages")


@pytest.mark.slow
def test_killed_workers(tmp_path: Path, whole: dict[str, bytes]) -> None:
    """A host, or the run itself that it has forked."""
    draw = random.Random(7)
    hit = 0
    for rank in range(TIMES):
        client = started()
        time.sleep(draw.uniform(0.0, 1.6))
        victims = hosts(client.pid)
        if rank % 2:
            victims = [child for host in victims for child in children(host)] or victims
        if victims:
            os.kill(draw.choice(victims), signal.SIGKILL)
            hit += 1
        client.wait()
        resumed(tmp_path, whole)
    assert hit >= TIMES // 2


@pytest.mark.slow
def test_killed_client(tmp_path: Path, whole: dict[str, bytes]) -> None:
    draw = random.Random(11)
    for _ in range(TIMES):
        client = started()
        time.sleep(draw.uniform(0.0, 1.6))
        left = hosts(client.pid)
        client.kill()
        client.wait()
        for _ in range(100):
            if not any(Path(f"/proc/{pid}").exists() for pid in left):
                break
            time.sleep(0.05)
        assert not [pid for pid in left if Path(f"/proc/{pid}").exists()]
        Path("disk/out").mkdir(parents=True, exist_ok=True)
        Path("disk/pages").mkdir(parents=True, exist_ok=True)
        resumed(tmp_path, whole)


@pytest.fixture
def disk() -> Iterator[bool]:
    """A small disk of its own; False: nobody may mount one."""
    Path("disk").mkdir(exist_ok=True)
    mounted = subprocess.run(["mount", "-t", "tmpfs", "none", "disk"], capture_output=True, check=False).returncode == 0
    yield mounted
    if mounted:
        subprocess.run(["umount", "-l", "disk"], check=True)


@pytest.mark.slow
def test_full_disk(tmp_path: Path, whole: dict[str, bytes], disk: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    draw = random.Random(13)
    needed = sum(len(data) for data in whole.values())
    write = batching.write_bytes
    stopped = 0
    for _ in range(TIMES):
        if disk:
            size = draw.randrange(100_000, needed)
            subprocess.run(["mount", "-o", f"remount,size={size}", "disk"], check=True)
        else:
            left = draw.randrange(1, len(whole))

            def full(name: str, data: bytes) -> None:
                nonlocal left
                left -= 1
                if left < 0:
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), name)
                write(name, data)

            monkeypatch.setattr(batching, "write_bytes", full)
        done = run(tmp_path, *WORDS)
        assert done.returncode in (1, 2), done.stdout + done.stderr
        assert os.strerror(errno.ENOSPC) in done.stdout + done.stderr
        stopped += 1
        if disk:
            subprocess.run(["mount", "-o", "remount,size=1g", "disk"], check=True)
        monkeypatch.setattr(batching, "write_bytes", write)
        resumed(tmp_path, whole)
    assert stopped == TIMES
