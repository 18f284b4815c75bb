"""A command on many programs and machines: each run in a separate process, each result complete or absent."""

from __future__ import annotations

import contextlib
import functools
import os
import shutil
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from shapegcode.batching.manifest import Manifest, base_folder
from shapegcode.batching.plan import COMMANDS, find_programs, plan
from shapegcode.batching.process import Base, Cluster, Hosts, cluster_executor, pack, run_packed
from shapegcode.batching.result import Batch
from shapegcode.batching.runs import KeptRows, OnBatch, Runs, summary_lines
from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import is_temporary, write_lines
from shapegcode.program.computer import cores

_SCRATCH = ".batch-scratch"
_SUMMARY = "summary.csv"
_NAMED = 5


def batch(
    programs: Sequence[str | Path],
    machines: Sequence[str | Path],
    output: str | Path,
    *,
    command: str = "convert",
    options: Sequence[str] = (),
    jobs: int = 0,
    cluster: Cluster | None = None,
    resume: bool = False,
    html: str | Path | None = None,
    time_limit_s: float = 3600.0,
    memory_limit_bytes: int = 0,
    on_progress: OnBatch = lambda _share, _text: None,
) -> Batch:
    """Run a command on programs and machines, and record the results.

    Each run has a separate process; a crash is a row of the result. Outputs, JSON and page of a run are identical to
    those of the single command, and appear complete or not at all. ``batch.jsonl`` in the output folder lists
    finished runs.

    Args:
        programs: files, folders, patterns, and ``@LIST`` files, see `find_programs`.
        machines: files or built-in names; with several, every program runs on each, in folders of their names.
        output: folder of the results.
        command: "convert", "time", "check", "feed", "measure" or "simulate".
        options: further arguments of the command line; files among them are sent with each run.
        jobs: parallel processes; 0: one per processor.
        cluster: run on Dask instead; None: on this machine.
        resume: run only what is missing, failed or changed.
        html: folder for a page of each run, and an index; None: no pages.
        time_limit_s: time limit of a run; 0: none.
        memory_limit_bytes: memory limit of a run, beyond the loaded program; 0: none.
        on_progress: called with the finished ratio and a text.

    Returns:
        A row for each run.

    Raises:
        ArgumentError: nothing to do, another batch writes there, or a bad value.
        MachineError: an invalid machine.
        OSError: a full disk, an unreadable file; finished runs are kept, and `resume` continues.
    """
    if command not in COMMANDS:
        raise ArgumentError(f"command {command}: must be one of {', '.join(COMMANDS)}")
    if jobs < 0 or not time_limit_s >= 0.0 or memory_limit_bytes < 0:
        raise ArgumentError(f"jobs {jobs}, time limit {time_limit_s}, memory limit {memory_limit_bytes}: not below 0")
    begin = time.monotonic()
    folders = [Path(output), *([Path(html)] if html is not None else [])]
    processes = jobs or cores()
    with contextlib.ExitStack() as stack:
        hosts = Hosts()
        stack.callback(hosts.end)
        sources = find_programs([str(each) for each in programs], output)
        called = [source.path for source in sources if source.subprogram]
        sources = tuple(source for source in sources if not source.subprogram)
        if not sources:
            raise ArgumentError(f"{called[0]}: a subprogram (M99), like all given programs: give their callers")
        base = Base(base_folder(output) if resume else os.getcwd())
        planned = plan(sources, [str(each) for each in machines], str(output), command, options, html, base)
        # The scheduler is tried before anything is written; local processes end before
        # their working folder is removed.
        remote = None if cluster is None else stack.enter_context(cluster_executor(cluster, processes))
        manifest = Manifest(Path(output), resume=resume, base=base.folder)
        stack.callback(manifest.close)
        if html is not None:
            Path(html).mkdir(parents=True, exist_ok=True)
        scratch = Path(output) / _SCRATCH
        # Remove remains of a killed batch first.
        shutil.rmtree(scratch, ignore_errors=True)
        for file in (file for folder in folders for file in folder.rglob(".*.tmp") if is_temporary(file)):
            file.unlink(missing_ok=True)
        scratch.mkdir()
        stack.callback(shutil.rmtree, scratch, ignore_errors=True)
        executor, slots = remote or (ThreadPoolExecutor(max_workers=processes), processes)
        if remote is None:
            stack.callback(executor.shutdown)
            stack.callback(hosts.end)
            stack.callback(executor.shutdown, wait=False, cancel_futures=True)
        where = "" if cluster else str(scratch)
        prepare = functools.partial(pack, seconds=time_limit_s, memory_bytes=memory_limit_bytes, scratch=where)
        run = Runs(planned, manifest, folders, resume, on_progress)
        stopped = run.all(executor, slots, prepare, run_packed if cluster else hosts.run)
    rows = KeptRows(manifest.path, planned, run.places, run.earlier)
    summary = Path(output) / _SUMMARY
    write_lines(summary, summary_lines(rows))
    return Batch(
        command, str(output), rows, str(summary), len(planned) - len(rows), stopped,
        _warnings(stopped, called), time.monotonic() - begin, slots,
    )  # fmt: skip


def _warnings(stopped: str, called: Sequence[str]) -> tuple[str, ...]:
    found = [f"stopped: {stopped}"] if stopped else []
    if called:
        more = f" and {len(called) - _NAMED} more" if len(called) > _NAMED else ""
        found.append(f"subprograms (M99), converted where they are called: {', '.join(called[:_NAMED])}{more}")
    return tuple(found)
