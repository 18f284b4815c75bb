"""The component loaded and unloaded again and again while its thread runs and every processor is busy."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

PERIOD_NS = 1_000_000
THREAD = "rtapi_app:T#0"
LOOKS = 5  # at the memory of rtapi_app, at even distances
PRIORITY = 80


@dataclass(frozen=True)
class Unloads:
    """What was seen of rtapi_app, in the order of the looks."""

    processes: list[int]  # its process
    resident_kib: list[int]  # its memory
    threads: list[int]  # how many it had
    said: str  # all that HAL printed
    exit_code: int  # of halrun


def session(cycles: int, look: Path) -> str:
    """HAL commands. In half of the cycles a design is on its way when the component goes, in a quarter it is done."""
    lines = [
        f"loadrt threads name1=fast period1={PERIOD_NS} fp1=1",
        "loadrt siggen",
        "addf siggen.0.update fast",
        "start",
        "loadusr -w sleep 2",  # the thread gets its priority
    ]
    for cycle in range(cycles):
        lines += [
            "loadrt shapegcode_shaper personality=3",
            "setp shapegcode-shaper.0.frequency-0 46",
            "setp shapegcode-shaper.0.damping-0 0.02",
            f"setp shapegcode-shaper.0.enable {int(cycle % 4 != 3)}",
            "net sine siggen.0.sine => shapegcode-shaper.0.in-0",
            "addf shapegcode-shaper.0 fast",
            *(["loadusr -w sleep 0.03"] if cycle % 4 == 0 else []),
            "unloadrt shapegcode_shaper",
        ]
        if (cycle + 1) % (cycles // LOOKS) == 0:
            lines.append(f"loadusr -w {look}")
    return "\n".join([*lines, "show thread", ""])


def run(user: list[str], cycles: int) -> Unloads:
    """So many cycles by halrun, as that user."""
    with tempfile.TemporaryDirectory(prefix="unload-", ignore_cleanup_errors=True) as place:
        folder = Path(place)
        look = folder / "look.sh"
        look.write_text(
            "#!/bin/sh\nfor p in $(pidof rtapi_app); do\n"
            "  echo look $p $(awk '/VmRSS/ {print $2}' /proc/$p/status) $(ls /proc/$p/task | wc -l)\ndone\n"
        )
        commands = folder / "session.hal"
        commands.write_text(session(cycles, look))
        for file in (folder, look, commands):
            file.chmod(0o755)
        with _busy_processors():
            before = _threads()
            halrun = subprocess.Popen(
                [*user, "halrun", "-f", commands],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
            )
            _raise_priority(before)
            said, _ = halrun.communicate()
    looks = [[int(word) for word in line.split()[1:]] for line in said.splitlines() if line.startswith("look ")]
    columns = list(zip(*looks, strict=True)) or [(), (), ()]
    return Unloads(list(columns[0]), list(columns[1]), list(columns[2]), said, halrun.returncode)


@contextmanager
def _busy_processors() -> Iterator[None]:
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 1)]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


def _threads() -> set[int]:
    """Threads of LinuxCNC that run functions."""
    found = set()
    for name in Path("/proc").glob("[0-9]*/task/[0-9]*/comm"):
        try:
            if name.read_text().strip() == THREAD:
                found.add(int(name.parent.name))
        except OSError:  # it has ended
            continue
    return found


def _raise_priority(before: set[int]) -> None:
    """As a machine's kernel would have it: LinuxCNC itself does so only where it finds a real-time one."""
    end = time.monotonic() + 10.0
    while not (new := _threads() - before):
        if time.monotonic() > end:
            raise RuntimeError("halrun has started no thread")
        time.sleep(0.05)
    sudo = [] if os.geteuid() == 0 else ["sudo", "-n"]
    for thread in new:
        done = subprocess.run(
            [*sudo, "chrt", "-f", "-p", str(PRIORITY), str(thread)], check=False, capture_output=True, text=True
        )
        if done.returncode:
            raise RuntimeError(f"chrt: {done.stderr}")
