"""A command over many programs and machines: each run in a process of its own, each result complete or absent."""

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
    """Run a command over programs and machines, and record the results.

    Each run has a process of its own; a crash of one is a row of the result. Outputs, JSON and page of a run are those
    of the single command to the byte, and appear complete or not at all. ``batch.jsonl`` in the output folder says what
    is done.

    Args:
        programs: files, folders, patterns, and ``@LIST`` files, see `find_programs`.
        machines: files or built-in names; several make the product, each in a folder of its name.
        output: folder of the results.
        command: "convert", "time", "check", "feed", "measure" or "simulate".
        options: further words of the command line; a word that is a file travels with each run.
        jobs: processes at a time; 0: as many as there are processors.
        cluster: run on Dask instead; None: on this machine.
        resume: do only what is missing, has failed or has changed since.
        html: folder of a page for each run, and an index of them; None: none.
        time_limit_s: of a run; 0: none.
        memory_limit_bytes: of a run, beyond what is loaded; 0: none.
        on_progress: called with the share that is done and with words.

    Returns:
        A row for each run.

    Raises:
        ArgumentError: nothing to do, another batch writes there, or a bad value.
        MachineError: a machine is none.
        OSError: a full disk, a file that cannot be read; what was done until then stays, and `resume` goes on.
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
            raise ArgumentError(f"{called[0]}: a subprogram (M99), as all that were named: name what calls them")
        base = Base(base_folder(output) if resume else os.getcwd())
        planned = plan(sources, [str(each) for each in machines], str(output), command, options, html, base)
        # A scheduler that does not answer is found before anything is written; processes of this machine end before
        # the folder goes that they work in.
        remote = None if cluster is None else stack.enter_context(cluster_executor(cluster, processes))
        manifest = Manifest(Path(output), resume=resume, base=base.folder)
        stack.callback(manifest.close)
        if html is not None:
            Path(html).mkdir(parents=True, exist_ok=True)
        scratch = Path(output) / _SCRATCH
        # What a batch that was killed has left goes before this one writes.
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
        found.append(f"subprograms (M99), done where they are called: {', '.join(called[:_NAMED])}{more}")
    return tuple(found)
