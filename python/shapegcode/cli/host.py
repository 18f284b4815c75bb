"""Fork server: loads all modules once, and forks a process for each command line from `shapegcode.batching`.

It reads one JSON object per line and answers with another. When its input ends, it kills its running command and ends.
"""

from __future__ import annotations

import ctypes
import gc
import importlib
import json
import os
import select
import signal
import sys
import time
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from shapegcode.batching.process import FAILED_CODES
from shapegcode.cli import main as run_command, parser_of
from shapegcode.io.data_file import write_in_passing
from shapegcode.results.json import this_version

_LOADED = (
    "shapegcode.cli.runner", "shapegcode.cli.options", "shapegcode.cli.arguments",
    "shapegcode.results.table", "rich.console", "rich.table", "rich._emoji_codes", "importlib.metadata",
    "importlib.readers", "email.parser", "shlex",
)  # fmt: skip
_OF_COMMAND = {
    "convert": ("shapegcode.conversion.convert", "shapegcode.shaping.registry", "shapegcode.model.signatures"),
    "time": ("shapegcode.timing.cycle_time",), "check": ("shapegcode.checking.check",),
    "feed": ("shapegcode.feed.schedule",), "measure": ("shapegcode.metrology.measure",),
    "simulate": ("shapegcode.simulation.simulate",),
}  # fmt: skip
"""Modules that a run imports on demand; loaded here, so that no run has to."""
_CODES = {name: code for code, name in FAILED_CODES.items()}
_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG of prctl


def main() -> int:
    """Serve until the input ends."""
    for command in sys.argv[1:]:
        for name in (*_LOADED, *_OF_COMMAND[command]):
            importlib.import_module(name)
        parser_of(command)
    this_version()  # determined once
    os.environ["SHAPEGCODE_THREADS"] = "1"  # the other cores are for other runs
    write_in_passing()
    gc.collect()
    gc.freeze()  # keep loaded objects shared: a garbage collection in a run would copy them
    answers = os.dup(1)
    while line := sys.stdin.buffer.readline():
        reply = _run(json.loads(line))
        if reply is None:
            return 0
        os.write(answers, json.dumps(reply).encode() + b"\n")
    return 0


def _run(job: Mapping[str, Any]) -> dict[str, Any] | None:
    """Fork, wait, and return the outcome; None if the input has ended."""
    begin = time.monotonic()
    ended, held = os.pipe()  # the child holds the other end, which closes however the child ends
    parent = os.getpid()
    pid = os.fork()
    if pid == 0:
        os.close(ended)
        _be_the_command(job, parent)
    os.close(held)
    left, out_of_time = job["seconds"] or None, False
    while ended not in (ready := select.select([ended, sys.stdin.fileno()], [], [], left)[0]):
        os.kill(pid, signal.SIGKILL)
        if ready:  # the input has ended
            os.waitpid(pid, 0)
            return None
        left, out_of_time = None, True
    os.close(ended)
    _, status, used = os.wait4(pid, 0)
    return {
        "code": os.waitstatus_to_exitcode(status),
        "out_of_time": out_of_time,
        "wall_s": time.monotonic() - begin,
        "cpu_s": used.ru_utime + used.ru_stime,
        "peak_bytes": used.ru_maxrss * (1 if sys.platform == "darwin" else 1024),
    }


def _be_the_command(job: Mapping[str, Any], parent: int) -> None:
    """Run the command in the new process; never returns."""
    code = _CODES["crashed"]
    try:
        _follow(parent)
        logs = Path(job["logs"])
        nothing = os.open(os.devnull, os.O_RDONLY)
        os.dup2(nothing, 0)
        for descriptor, name in ((1, "out"), (2, "err")):
            os.dup2(os.open(logs / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), descriptor)
        os.chdir(job["cwd"])
        if job["memory_bytes"]:
            _limit_memory(job["memory_bytes"])
        code = run_command(job["words"])
    except MemoryError:
        code = _CODES["out of memory"]
    except BaseException:
        traceback.print_exc()
    finally:
        try:
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(code)


def _follow(parent: int) -> None:
    """Have the process killed when the server ends."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(_CODES["crashed"])


def _limit_memory(more_bytes: int) -> None:
    """On Linux limit the data memory of the process to its present size plus *more_bytes*."""
    if sys.platform != "linux":
        return  # only Linux counts memory from mmap in RLIMIT_DATA
    import resource

    pages = int(Path("/proc/self/statm").read_text().split()[5])
    most = pages * resource.getpagesize() + more_bytes
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))


if __name__ == "__main__":
    sys.exit(main())
