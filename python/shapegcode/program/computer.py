"""Available processors and memory; memory is checked before it is needed."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from shapegcode._core import ProgramError

_CGROUP = Path("/sys/fs/cgroup")
_PER_LINE = 130  # bytes per line read: blocks, path and plan (docs/evidence/benchmarks.md)
_SMALL_BYTES = 2**20
MEMORY_NEEDED = "bytes of memory are needed"
"""Start of the message when there is not enough memory; recognized by a batch with a memory limit."""


def cores() -> int:
    """Number of processors for this process, by its affinity; SHAPEGCODE_THREADS overrides it."""
    stated = os.environ.get("SHAPEGCODE_THREADS", "")
    if stated.isdecimal() and int(stated) > 0:
        return int(stated)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def available_bytes() -> int | None:
    """Memory available to this process within computer, control group and its own limits, bytes; None: unknown."""
    found = [_kilobytes("/proc/meminfo", "MemAvailable"), *_of_groups(), *_of_own_limits()]
    known = [value for value in found if value is not None]
    return max(0, min(known)) if known else None


def require_memory(source: str, needed: int, what: str) -> None:
    """Refuse a task that needs more memory than available."""
    available = available_bytes()
    if available is not None and needed > available:
        raise ProgramError(
            f"{source}:1:1: {what}: about {needed} {MEMORY_NEEDED} and {available} are available; split the "
            "program, or use a computer with more memory"
        )


def require_memory_for_lines(text: bytes, source: str, per_line: int = _PER_LINE) -> None:
    """Refuse a program whose lines need more memory than is available; texts below a megabyte are not checked."""
    if len(text) > _SMALL_BYTES:
        lines = text.count(b"\n")
        require_memory(source, lines * per_line, f"{lines} lines are to be read")


def _kilobytes(file: str, name: str) -> int | None:
    """Read a line "Name:  123 kB" of a /proc file, in bytes."""
    with contextlib.suppress(OSError):
        for line in Path(file).read_text().splitlines():
            if line.startswith(f"{name}:"):
                return int(line.split()[1]) * 1024
    return None


def _of_groups() -> list[int | None]:
    """Memory left, bytes, in each control group (version 2) with a limit that contains this process."""
    left: list[int | None] = []
    with contextlib.suppress(OSError, ValueError):
        own = _CGROUP / Path("/proc/self/cgroup").read_text().partition("::")[2].strip().lstrip("/")
        for folder in (own, *own.parents):
            limit = folder / "memory.max"
            if limit.is_file() and (limit_text := limit.read_text().strip()) != "max":
                left.append(int(limit_text) - int((folder / "memory.current").read_text()))
    return left


def _of_own_limits() -> list[int | None]:
    """Address space and data that the limits of `ulimit` still permit, bytes; nothing for those without a limit."""
    try:
        import resource
    except ModuleNotFoundError:  # not on this system
        return []
    found: list[int | None] = []
    for limit, taken in ((resource.RLIMIT_AS, "VmSize"), (resource.RLIMIT_DATA, "VmData")):
        most = resource.getrlimit(limit)[0]
        used = _kilobytes("/proc/self/status", taken)
        if most != resource.RLIM_INFINITY and used is not None:
            found.append(most - used)
    return found
