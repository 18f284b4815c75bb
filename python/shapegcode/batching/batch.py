"""A command over many programs and machines: each run in a process of its own, each result complete or absent."""

from __future__ import annotations

import concurrent.futures
import contextlib
import csv
import errno
import functools
import hashlib
import io
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from shapegcode.batching.inputs import find_programs
from shapegcode.batching.job import BatchJob, JobOutcome, Packed, pack
from shapegcode.batching.manifest import Manifest
from shapegcode.batching.plan import COMMANDS, plan
from shapegcode.batching.process import end_hosts, run_packed
from shapegcode.batching.result import Batch, BatchRow
from shapegcode.batching.row import row_of, row_read
from shapegcode.errors import ArgumentError
from shapegcode.io.atomic import is_temporary, write_bytes, write_text
from shapegcode.results.json import plain

__all__ = ["Cluster", "batch"]

Progress = Callable[[float, str], None]

_SCRATCH = ".batch-scratch"
_SUMMARY = "summary.csv"
_AHEAD = 2
"""Runs that are ready for each process, so that none waits for files."""
_TOLD_EVERY_S = 1.0
_NAMED = 5


@dataclass(frozen=True)
class Cluster:
    """Where Dask runs the jobs.

    Attributes:
        scheduler: its address, such as ``tcp://host:8786``, or "local" for a cluster on this machine.
        tls_ca: file of the authority's certificate, as Dask takes it; empty: none; likewise the next two.
        tls_cert: of this client.
        tls_key: of this client.
    """

    scheduler: str
    tls_ca: str = ""
    tls_cert: str = ""
    tls_key: str = ""


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
    on_progress: Progress = lambda _share, _text: None,
) -> Batch:
    """Run a command over programs and machines, and write down what came of it.

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
    sources = find_programs([str(each) for each in programs], output)
    called = [source.path for source in sources if source.subprogram]
    sources = tuple(source for source in sources if not source.subprogram)
    planned = plan(sources, [str(each) for each in machines], str(output), command, options, html)
    processes = jobs or os.cpu_count() or 1
    with contextlib.ExitStack() as stack:
        # A scheduler that does not answer is found before anything is written; processes of this machine end before
        # the folder goes that they work in.
        remote = None if cluster is None else stack.enter_context(_remote_executor(processes, cluster))
        manifest = Manifest(Path(output), resume=resume)
        stack.callback(manifest.close)
        if html is not None:
            Path(html).mkdir(parents=True, exist_ok=True)
        scratch = Path(output) / _SCRATCH
        _sweep(scratch, [Path(output), *([Path(html)] if html else [])])
        scratch.mkdir()
        stack.callback(shutil.rmtree, scratch, ignore_errors=True)
        executor, slots = remote or stack.enter_context(_local_executor(processes))
        prepare = functools.partial(
            pack, seconds=time_limit_s, memory_bytes=memory_limit_bytes, scratch="" if cluster else str(scratch),
            kept=planned.shared,
        )  # fmt: skip
        run = _Runs(planned.jobs, manifest, [Path(output), *([Path(html)] if html else [])], resume, on_progress)
        stopped = run.all(executor, slots, prepare)
    rows = tuple(run.rows[job.key] for job in planned.jobs if job.key in run.rows)
    summary = Path(output) / _SUMMARY
    write_text(summary, "".join(summary_lines(rows)))
    return Batch(
        command, str(output), rows, str(summary), len(planned.jobs) - len(rows), stopped,
        _warnings(stopped, called), time.monotonic() - begin, slots,
    )  # fmt: skip


def _sweep(scratch: Path, folders: Sequence[Path]) -> None:
    """Remove what a batch that was killed has left, before this one writes."""
    shutil.rmtree(scratch, ignore_errors=True)
    for folder in folders:
        for file in folder.rglob(".*.tmp"):
            if is_temporary(file):
                file.unlink(missing_ok=True)


def _warnings(stopped: str, called: Sequence[str]) -> tuple[str, ...]:
    found = [f"stopped: {stopped}"] if stopped else []
    if called:
        more = f" and {len(called) - _NAMED} more" if len(called) > _NAMED else ""
        found.append(f"subprograms (M99), done where they are called: {', '.join(called[:_NAMED])}{more}")
    return tuple(found)


def _remote_executor(processes: int, cluster: Cluster) -> AbstractContextManager[tuple[Executor, int]]:
    from shapegcode.batching.cluster import cluster_executor

    tls = {name: getattr(cluster, name) for name in ("tls_ca", "tls_cert", "tls_key")}
    return cluster_executor(cluster.scheduler, processes=processes, **tls)


@contextlib.contextmanager
def _local_executor(processes: int) -> Iterator[tuple[Executor, int]]:
    executor = ThreadPoolExecutor(max_workers=processes)
    try:
        yield executor, processes
    finally:
        executor.shutdown(wait=False, cancel_futures=True)
        end_hosts()
        executor.shutdown()


class _Runs:
    """The runs of one batch."""

    def __init__(
        self, jobs: Sequence[BatchJob], manifest: Manifest, folders: Sequence[Path], resume: bool, on_progress: Progress
    ) -> None:
        self.rows: dict[str, BatchRow] = {}
        self._jobs, self._manifest, self._resume, self._on_progress = jobs, manifest, resume, on_progress
        self._allowed = tuple(os.path.join(os.path.realpath(folder), "") for folder in folders)
        self._whole_bytes = sum(job.size_bytes for job in jobs) or 1
        self._done_bytes, self._told = 0, 0.0

    def all(self, executor: Executor, slots: int, prepare: Callable[[BatchJob], Packed]) -> str:
        """Do them; gives why it stopped before the end, or nothing."""
        waiting: dict[Future[JobOutcome], tuple[BatchJob, str]] = {}
        try:
            for job in self._jobs:
                try:
                    packed = prepare(job)
                except OSError as error:
                    outcome = JobOutcome("crashed", 0, "", f"{error.filename}: {error.strerror}", {})
                    self._keep(job, "", outcome)
                    continue
                if self._is_done(job, packed.fingerprint):
                    continue
                waiting[executor.submit(run_packed, packed)] = (job, packed.fingerprint)
                if len(waiting) >= slots * _AHEAD:
                    self._collect(waiting, slots)
            while waiting:
                self._collect(waiting, slots)
        except KeyboardInterrupt:
            return "Ctrl-C"
        except OSError as error:
            if error.errno not in (errno.ENOSPC, errno.EDQUOT):
                raise
            return f"{error.filename or 'scratch'}: {error.strerror}"
        finally:
            for future in waiting:
                future.cancel()
        return ""

    def _collect(self, waiting: dict[Future[JobOutcome], tuple[BatchJob, str]], slots: int) -> None:
        """Wait for one of them at least, and keep what came back."""
        while True:
            self._tell(min(slots, len(waiting)))
            done, _ = concurrent.futures.wait(
                waiting, _TOLD_EVERY_S, return_when=concurrent.futures.FIRST_COMPLETED
            )  # fmt: skip
            if done:
                break
        for future in done:
            job, fingerprint = waiting.pop(future)
            try:
                outcome = future.result()
            except OSError as error:
                if error.errno in (errno.ENOSPC, errno.EDQUOT):
                    raise
                outcome = JobOutcome("crashed", 0, "", str(error), {})
            except Exception as error:
                outcome = JobOutcome("killed", 0, "", f"{type(error).__name__}: {error}".splitlines()[0], {})
            self._keep(job, fingerprint, outcome)

    def _is_done(self, job: BatchJob, fingerprint: str) -> bool:
        """An earlier batch did the same, and its files are there as it left them."""
        row = self._manifest.earlier.get(job.key) if self._resume else None
        if row is None or row.get("fingerprint") != fingerprint or row["ended"] == "failed":
            return False
        if any(_hash_of(name) != sha256 for name, sha256 in row["files"].items()):
            return False
        self._done_bytes += job.size_bytes
        self.rows[job.key] = row_read(row, earlier=True)
        return True

    def _keep(self, job: BatchJob, fingerprint: str, outcome: JobOutcome) -> None:
        """Write what a run wrote, then its row."""
        row, written = row_of(job, outcome)
        if row.ended == "failed" and os.strerror(errno.ENOSPC) in outcome.complained:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), job.program)
        for name, content in written.items():
            if not os.path.realpath(name).startswith(self._allowed):
                raise ArgumentError(f"{name}: a worker wants to write outside of the output folder")
            Path(name).parent.mkdir(parents=True, exist_ok=True)
            write_bytes(name, content)
        # What an earlier run wrote and this one did not: nobody may take it for a result of this one.
        for name in self._manifest.earlier.get(job.key, {}).get("files", {}):
            if name not in written and os.path.realpath(name).startswith(self._allowed):
                Path(name).unlink(missing_ok=True)
        hashes = {name: hashlib.sha256(content).hexdigest() for name, content in written.items()}
        self._manifest.add({**plain(row), "key": job.key, "fingerprint": fingerprint, "files": hashes})
        self.rows[job.key] = row
        self._done_bytes += job.size_bytes

    def _tell(self, running: int) -> None:
        if time.monotonic() - self._told < _TOLD_EVERY_S / 5:
            return
        self._told = time.monotonic()
        failed = sum(row.ended in ("failed", "refused") for row in self.rows.values())
        text = f"{len(self.rows)} of {len(self._jobs)} done, {running} running, {failed} failed"
        self._on_progress(self._done_bytes / self._whole_bytes, text)


def _hash_of(name: str) -> str:
    try:
        with open(name, "rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError:
        return ""


def summary_lines(rows: Sequence[BatchRow]) -> Iterator[str]:
    """The rows as CSV.

    Args:
        rows: of a batch.

    Returns:
        Lines with their ends, the first with the names; a figure before and after has two columns.
    """
    names = ["residual_um", "contour_um", "cycle_time_s"]
    heads: list[str] = []
    for field in fields(BatchRow):
        heads += [f"{field.name}.original", f"{field.name}.emitted"] if field.name in names else [field.name]
    yield _csv_line(heads)
    for row in rows:
        flat = _flat(plain(row))
        yield _csv_line([flat.get(head, "") for head in heads])


def _flat(row: Mapping[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, Mapping):
            flat |= {f"{name}.{key}": inner for key, inner in value.items()}
        else:
            flat[name] = value
    return flat


def _csv_line(cells: Sequence[object]) -> str:
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerow(["" if cell is None else cell for cell in cells])
    return stream.getvalue()
