"""A command on many programs and machines: each run in a separate process, each result complete or absent.

The runs are distributed, collected and recorded; Ctrl-C and a full disk stop them between two runs.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import csv
import errno
import functools
import hashlib
import json
import os
import shutil
import signal
import threading
import time
import weakref
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any, overload

from shapegcode.batching import COMMANDS, process
from shapegcode.batching.manifest import Manifest, base_folder
from shapegcode.batching.plan import Plan, find_programs, plan
from shapegcode.batching.result import Batch, BatchRow, Ended, figures_of
from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import is_temporary, write_bytes, write_lines
from shapegcode.program.computer import cores
from shapegcode.results.json import ProvenanceFile, current_keys, plain
from shapegcode.results.outcome import Pair
from shapegcode.results.page.html import is_shared

_SCRATCH = ".batch-scratch"
_SUMMARY = "summary.csv"
_NAMED = 5
_ENDED: dict[int, Ended] = {0: "ok", 1: "not ok", 2: "refused"}
_PAIRS = ("residual_um", "contour_um", "cycle_time_s")
_PREFIX = "shapegcode: "


def row_of(job: process.BatchJob, outcome: process.JobOutcome) -> tuple[BatchRow, Mapping[str, bytes]]:
    """The row of a run, and its output files."""
    ended: Ended = _ENDED.get(outcome.code, "failed") if outcome.ending == "ended" else "failed"
    if ended == "refused" and any(os.strerror(code) in outcome.complained for code in (errno.ENOSPC, errno.EDQUOT)):
        ended = "failed"  # not caused by the program
    written = {} if ended in ("failed", "refused") else outcome.files
    report = json.loads(written[job.report]) if job.report in written else {}
    # A multi-program file (--program all) has one report per program, without common figures.
    several = report if isinstance(report, list) else [report]
    output = next((str(each["output"]) for each in several if "output" in each), "")
    page = next((name for name in written if name.endswith(".html")), "")
    values = figures_of(several[0] if len(several) == 1 else {})
    values |= {"output": output, "report": job.report if job.report in written else "", "page": page}
    values |= {name: getattr(outcome, name) for name in ("wall_s", "cpu_s", "peak_bytes")}
    row = BatchRow(job.program, job.machine, ended, _answer(outcome, ended), earlier=False, **values)
    return row, written


def _answer(outcome: process.JobOutcome, ended: Ended) -> str:
    """The answer, or the problem."""
    text = outcome.said if ended in ("ok", "not ok") else outcome.complained
    lines = [line for line in text.strip().splitlines() if line]
    first = next((line for line in lines if line.startswith(_PREFIX)), lines[0] if lines else outcome.ending)
    return first.removeprefix(_PREFIX)


class KeptRows(Sequence[BatchRow]):
    """Rows of a batch, read from its manifest on access."""

    def __init__(self, manifest: Path, planned: Plan, places: Sequence[int], earlier: Sequence[int]) -> None:
        self._stream = manifest.open("rb")
        weakref.finalize(self, self._stream.close)
        self._planned, self._places, self._earlier = planned, places, earlier
        self._ranks = array("q", (rank for rank, at in enumerate(places) if at >= 0))

    def __len__(self) -> int:
        return len(self._ranks)

    def __iter__(self) -> Iterator[BatchRow]:
        return map(self._row, self._ranks)

    @overload
    def __getitem__(self, rank: int) -> BatchRow: ...

    @overload
    def __getitem__(self, rank: slice) -> list[BatchRow]: ...

    def __getitem__(self, rank: int | slice) -> BatchRow | list[BatchRow]:
        ranks = self._ranks[rank]
        return self._row(ranks) if isinstance(ranks, int) else [self._row(each) for each in ranks]

    def __reduce__(self) -> tuple[type, tuple[list[BatchRow]]]:
        """Pickle the rows as a list: elsewhere there is no manifest."""
        return list, (list(self),)

    def _row(self, rank: int) -> BatchRow:
        self._stream.seek(self._places[rank])
        row = current_keys(BatchRow, json.loads(self._stream.readline()))
        job, base = self._planned.job(rank), self._planned.base
        files = {name: base.path_of(row[name]) for name in ("output", "report", "page") if row[name]}
        given = {"program": job.program, "machine": job.machine}
        pairs = {name: None if row[name] is None else Pair(**row[name]) for name in _PAIRS}
        values = {field.name: row[field.name] for field in fields(BatchRow)}
        return BatchRow(**values | files | given | pairs | {"earlier": bool(self._earlier[rank])})


def summary_lines(rows: Iterable[BatchRow]) -> Iterator[str]:
    """The rows as CSV."""
    heads: list[str] = []
    for field in fields(BatchRow):
        heads += [f"{field.name}.original", f"{field.name}.emitted"] if field.name in _PAIRS else [field.name]
    # The writer returns the value of its stream's `write`: the line.
    writer = csv.DictWriter(SimpleNamespace(write=str), heads, extrasaction="ignore", lineterminator="\n")
    yield str(writer.writeheader())
    for row in map(plain, rows):
        pairs = {f"{name}.{key}": value for name in _PAIRS if row[name] for key, value in row[name].items()}
        yield str(writer.writerow(row | pairs))


OnBatch = Callable[[float, str], None]
"""Called with the finished fraction, and a text with the numbers of finished, running and failed runs."""

_AHEAD = 2  # runs prepared per process, so that none waits for files
_REPORT_EVERY_S = 1.0
_FULL = (errno.ENOSPC, errno.EDQUOT)


class _CtrlC:
    """Delays Ctrl-C while the files of one run are written, so that all or none of them exist."""

    def __init__(self) -> None:
        self._asked = self._busy = False
        self._before: Any = None

    def begin(self) -> None:
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._handle)

    def end(self) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)

    def _handle(self, _number: int, _frame: object) -> None:
        self._asked = True
        if not self._busy:
            raise KeyboardInterrupt

    @contextlib.contextmanager
    def later(self) -> Iterator[None]:
        self._busy = True
        try:
            yield
        finally:
            self._busy = False
        if self._asked:
            raise KeyboardInterrupt


class Runs:
    """The runs of one batch."""

    def __init__(
        self, planned: Plan, manifest: Manifest, folders: Sequence[Path], resume: bool, on_progress: OnBatch
    ) -> None:
        self.places = array("q", [-1]) * len(planned)
        self.earlier = bytearray(len(planned))
        self._planned, self._manifest, self._resume, self._on_progress = planned, manifest, resume, on_progress
        self._path_of = planned.base.path_of
        self._allowed = tuple(os.path.join(os.path.realpath(folder), "") for folder in folders)
        self._whole_bytes = sum(map(planned.size_bytes, range(len(planned)))) or 1
        self._done = self._failed = self._done_bytes = 0
        self._reported_at = 0.0
        self._shared: dict[str, str] = {}  # scripts shared by pages are written once
        self._ctrl_c = _CtrlC()

    def all(
        self,
        executor: Executor,
        slots: int,
        prepare: Callable[[process.BatchJob, Mapping[str, bytes]], process.Packed],
        run: Callable[[process.Packed], process.JobOutcome],
    ) -> str:
        """Do all runs that are not done yet; return the reason for an early stop, or an empty string."""
        waiting: dict[Future[process.JobOutcome], tuple[int, str]] = {}
        self._ctrl_c.begin()
        try:
            for rank in range(len(self._planned)):
                job = self._planned.job(rank)
                try:
                    packed = prepare(job, self._planned.files(rank))
                except OSError as error:
                    self._keep(rank, "", process.JobOutcome("crashed", f"{error.filename}: {error.strerror}"))
                    continue
                if self._is_done(rank, job.output, packed.fingerprint):
                    continue
                waiting[executor.submit(run, packed)] = (rank, packed.fingerprint)
                if len(waiting) >= slots * _AHEAD:
                    self._collect(waiting, slots)
            while waiting:
                self._collect(waiting, slots)
        except KeyboardInterrupt:
            return "Ctrl-C"
        except OSError as error:
            if error.errno not in _FULL:
                raise
            return f"{error.filename or 'scratch'}: {error.strerror}"
        finally:
            self._ctrl_c.end()
            for future in waiting:
                future.cancel()
        return ""

    def _collect(self, waiting: dict[Future[process.JobOutcome], tuple[int, str]], slots: int) -> None:
        """Wait for at least one run, and store its outcome."""
        done: set[Future[process.JobOutcome]] = set()
        while not done:
            self._report(min(slots, len(waiting)))
            done, _ = concurrent.futures.wait(waiting, _REPORT_EVERY_S, return_when=concurrent.futures.FIRST_COMPLETED)
        for future in done:
            rank, fingerprint = waiting.pop(future)
            try:
                outcome = future.result()
            except OSError as error:
                if error.errno in _FULL:
                    raise
                outcome = process.JobOutcome("crashed", str(error))
            except Exception as error:
                outcome = process.JobOutcome("killed", f"{type(error).__name__}: {error}".splitlines()[0])
            self._keep(rank, fingerprint, outcome)

    def _is_done(self, rank: int, key: str, fingerprint: str) -> bool:
        """True if an earlier batch has this run, not as "failed", and its files are unchanged; it is then counted."""
        row = self._manifest.earlier(key) if self._resume else None
        if row is None or row.get("fingerprint") != fingerprint or row["ended"] == "failed":
            return False
        for name, sha256 in row["files"].items():
            if ProvenanceFile.of("wrote", self._path_of(name)).sha256 != sha256:
                return False
        self.earlier[rank] = 1
        self._count(rank, self._manifest.kept_at(key), row["ended"])
        return True

    def _keep(self, rank: int, fingerprint: str, outcome: process.JobOutcome) -> None:
        """Write the files of a run, then its row; if the files cannot be written, a row with that reason."""
        job = self._planned.job(rank)
        row, written = row_of(job, outcome)
        if row.ended == "failed" and os.strerror(errno.ENOSPC) in outcome.complained:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), job.program)
        for name in written:
            if not self._is_allowed(name):
                raise ArgumentError(f"{name}: a worker wants to write outside the output folder")
        hashes = {name: hashlib.sha256(content).hexdigest() for name, content in written.items()}
        with self._ctrl_c.later():
            try:
                self._write(job, written, hashes)
            except OSError as error:
                if error.errno in _FULL:
                    raise
                crashed = process.JobOutcome("crashed", f"{error.filename}: {error.strerror}")
                row, hashes = row_of(job, crashed)[0], {}
                self._remove(written)
                self._write(job, {}, hashes)
            line = {**plain(row), "key": job.output, "fingerprint": fingerprint, "files": hashes}
            self._count(rank, self._manifest.add(line), row.ended)

    def _write(self, job: process.BatchJob, written: Mapping[str, bytes], hashes: Mapping[str, str]) -> None:
        for name, content in written.items():
            if self._shared.get(name) == hashes[name]:
                continue
            Path(self._path_of(name)).parent.mkdir(parents=True, exist_ok=True)
            write_bytes(self._path_of(name), content)
            if is_shared(name):
                self._shared[name] = hashes[name]
        # Remove files of an earlier run that this run did not write.
        earlier = (self._manifest.earlier(job.output) or {}).get("files", {})
        self._remove(name for name in earlier if name not in written)

    def _remove(self, names: Iterable[str]) -> None:
        for name in names:
            if self._is_allowed(name) and not is_shared(name):
                with contextlib.suppress(OSError):  # it may not exist
                    os.unlink(self._path_of(name))

    def _is_allowed(self, name: str) -> bool:
        return os.path.realpath(self._path_of(name)).startswith(self._allowed)

    def _count(self, rank: int, at: int, ended: str) -> None:
        self.places[rank] = at
        self._done += 1
        self._failed += ended in ("failed", "refused")
        self._done_bytes += self._planned.size_bytes(rank)

    def _report(self, running: int) -> None:
        if time.monotonic() - self._reported_at < _REPORT_EVERY_S / 5:
            return
        self._reported_at = time.monotonic()
        text = f"{self._done} of {len(self._planned)} done, {running} running, {self._failed} failed"
        self._on_progress(self._done_bytes / self._whole_bytes, text)


def batch(
    programs: str | Path | Sequence[str | Path],
    machines: str | Path | Sequence[str | Path],
    output: str | Path,
    *,
    command: str = "convert",
    options: Sequence[str] = (),
    jobs: int = 0,
    cluster: process.Cluster | None = None,
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
        machines: files or built-in names; with several, every program runs on each: one folder per machine.
        output: folder of the results.
        command: "convert", "time", "check", "feed", "measure" or "simulate".
        options: further arguments of the command line; files among them are sent with each run.
        jobs: parallel processes; 0: one per processor.
        cluster: run on Dask instead; None: on this machine.
        resume: run only what is missing, failed or changed.
        html: folder for a page of each run; None: no pages.
        time_limit_s: time limit of a run; 0: none.
        memory_limit_bytes: memory limit of a run, beyond what shapegcode itself needs; 0: none.
        on_progress: called with the finished fraction and a text.

    Returns:
        A row for each finished run; `stopped` is not empty after Ctrl-C or if the disk is full.

    Raises:
        ArgumentError: nothing to do, another batch writes there, or a bad value.
        MachineError: an invalid machine.
        OSError: a file cannot be read or written; finished runs are kept, and `resume` continues.
    """
    if command not in COMMANDS:
        raise ArgumentError(f"command {command}: must be one of {', '.join(COMMANDS)}")
    if jobs < 0 or not time_limit_s >= 0.0 or memory_limit_bytes < 0:
        raise ArgumentError(f"jobs {jobs}, time limit {time_limit_s}, memory limit {memory_limit_bytes}: not below 0")
    begin = time.monotonic()
    programs, machines = ([each] if isinstance(each, str | Path) else each for each in (programs, machines))
    for what, given in (("programs", programs), ("machines", machines)):
        if any(not isinstance(each, str | Path) for each in given):
            raise ArgumentError(f"{what}: files or built-in names are needed, since each run reads them again")
    folders = [Path(output), *([Path(html)] if html is not None else [])]
    processes = jobs or cores()
    with contextlib.ExitStack() as stack:
        hosts = process.Hosts()
        stack.callback(hosts.end)
        sources = find_programs([str(each) for each in programs], output)
        called = [source.path for source in sources if source.subprogram]
        sources = tuple(source for source in sources if not source.subprogram)
        if not sources:
            raise ArgumentError(f"{called[0]}: a subprogram (M99), like all given programs: give their callers")
        base = process.Base(base_folder(output) if resume else os.getcwd())
        planned = plan(sources, [str(each) for each in machines], str(output), command, options, html, base)
        # The scheduler is tried before anything is written; local processes end before
        # their working folder is removed.
        remote = None if cluster is None else stack.enter_context(process.cluster_executor(cluster, processes))
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
        prepare = functools.partial(process.pack, seconds=time_limit_s, memory_bytes=memory_limit_bytes, scratch=where)
        run = Runs(planned, manifest, folders, resume, on_progress)
        stopped = run.all(executor, slots, prepare, process.run_packed if cluster else hosts.run)
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
