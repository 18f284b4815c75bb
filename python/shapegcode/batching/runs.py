"""The runs of one batch: handed out, collected, written down; Ctrl-C and a full disk stop them between two of them."""

from __future__ import annotations

import concurrent.futures
import contextlib
import errno
import hashlib
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

from shapegcode.batching.job import BatchJob, JobOutcome, Packed
from shapegcode.batching.manifest import Manifest
from shapegcode.batching.result import BatchRow
from shapegcode.batching.row import row_of, row_read
from shapegcode.errors import ArgumentError
from shapegcode.io.atomic import write_bytes
from shapegcode.results.json import plain

__all__ = ["OnBatch", "Runs"]

OnBatch = Callable[[float, str], None]
"""Told the share that is done, and how many runs are done, under way and failed."""

_AHEAD = 2
"""Runs that are ready for each process, so that none waits for files."""
_TOLD_EVERY_S = 1.0


class _CtrlC:
    """Ctrl-C waits while files of one run are written: all of them stand there, or none."""

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
        self, jobs: Sequence[BatchJob], manifest: Manifest, folders: Sequence[Path], resume: bool, on_progress: OnBatch
    ) -> None:
        self.rows: dict[str, BatchRow] = {}
        self._jobs, self._manifest, self._resume, self._on_progress = jobs, manifest, resume, on_progress
        self._allowed = tuple(os.path.join(os.path.realpath(folder), "") for folder in folders)
        self._whole_bytes = sum(job.size_bytes for job in jobs) or 1
        self._done_bytes, self._told = 0, 0.0
        self._ctrl_c = _CtrlC()

    def all(
        self,
        executor: Executor,
        slots: int,
        prepare: Callable[[BatchJob], Packed],
        run: Callable[[Packed], JobOutcome],
    ) -> str:
        """Do them; gives why it stopped before the end, or nothing."""
        waiting: dict[Future[JobOutcome], tuple[BatchJob, str]] = {}
        self._ctrl_c.begin()
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
                waiting[executor.submit(run, packed)] = (job, packed.fingerprint)
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
            self._ctrl_c.end()
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
        for name in written:
            if not os.path.realpath(name).startswith(self._allowed):
                raise ArgumentError(f"{name}: a worker wants to write outside of the output folder")
        with self._ctrl_c.later():
            self._write(job, fingerprint, row, written)

    def _write(self, job: BatchJob, fingerprint: str, row: BatchRow, written: Mapping[str, bytes]) -> None:
        for name, content in written.items():
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
