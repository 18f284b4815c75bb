"""Run packed jobs, each in a separate process with limits of time and memory, locally or on a Dask worker.

Each thread has a fork server with shapegcode loaded (`shapegcode.cli.host`), which forks a process for each job.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Literal, cast

from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import named_errors
from shapegcode.program.computer import MEMORY_NEEDED
from shapegcode.results.json import this_version

if TYPE_CHECKING:
    from distributed import Client

Ending = Literal["ended", "crashed", "killed", "out of time", "out of memory", "other version"]
"""How a run ended; "ended": by itself, with an exit code of the command."""

FAILED_CODES = {97: "crashed", 98: "out of memory"}  # exit codes of a run that no command uses


@dataclass(frozen=True)
class Base:
    """The folder in which a batch was started: names are relative to it, also after resuming from another folder."""

    folder: str  # its absolute path

    def name_of(self, path: str | Path) -> str:
        """Name of a file in the folder of a run."""
        return os.path.relpath(path, self.folder)

    def path_of(self, name: str) -> str:
        """Path of a name: the inverse of `name_of`."""
        return os.path.normpath(os.path.join(os.path.relpath(self.folder), name))


@dataclass(frozen=True)
class BatchJob:
    """A run to be executed."""

    program: str  # as given
    machine: str
    words: tuple[str, ...]  # command line
    output: str  # name of its main file, which is also its key in the manifest; the JSON is in the same folder

    @property
    def report(self) -> str:
        """Name of its JSON file."""
        return f"{self.output}.json"


@dataclass(frozen=True)
class Packed:
    """A run with all files that it reads; independent of files on the sending computer."""

    words: tuple[str, ...]  # command line
    files: Mapping[str, bytes]  # content by name in the folder of the run
    version: str  # required version of shapegcode
    fingerprint: str  # hash of command line, files and version: equal ones give equal results
    seconds: float = 0.0  # time limit; 0: none
    memory_bytes: int = 0  # memory limit; 0: none
    scratch: str = ""  # parent of the folder of the run; empty: the folder of temporary files


@dataclass(frozen=True)
class JobOutcome:
    """Outcome of a run."""

    ending: Ending  # end of the run
    complained: str  # its standard error, or why it did not end by itself
    code: int = 0  # exit code of the command; 0 if it did not end by itself
    said: str = ""  # its standard output
    files: Mapping[str, bytes] = field(default_factory=dict)  # content of the files it wrote, by name in its folder
    wall_s: float = 0.0  # elapsed time
    cpu_s: float = 0.0  # processor time
    peak_bytes: int = 0  # peak memory


def pack(
    job: BatchJob, files: Mapping[str, bytes], *, seconds: float = 0.0, memory_bytes: int = 0, scratch: str = ""
) -> Packed:
    """Pack a run with its files for another process."""
    hashes = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    whole = json.dumps([this_version(), list(job.words), hashes], sort_keys=True)
    fingerprint = hashlib.sha256(whole.encode()).hexdigest()
    return Packed(job.words, files, this_version(), fingerprint, seconds, memory_bytes, scratch)


_ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1",  # the other cores are for other runs
    "LD_BIND_NOW": "1",  # functions are linked once, not in each run
    # Memory returned to the system is fetched again page by page: set thresholds that glibc adapts only in long runs.
    "MALLOC_ARENA_MAX": "1",
    "MALLOC_MMAP_THRESHOLD_": "33554432",
    "MALLOC_TRIM_THRESHOLD_": "67108864",
}


class _Host:
    """A fork server for jobs; `ask` may be called by one thread at a time."""

    def __init__(self, command: str) -> None:
        # Ctrl-C of a terminal must reach only the batch, which ends its hosts itself: they have a separate session.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "shapegcode.cli.host", command], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env={**_ENVIRONMENT, **os.environ}, start_new_session=True,
        )  # fmt: skip
        self._requests, self._answers = cast(IO[bytes], self._process.stdin), cast(IO[bytes], self._process.stdout)

    def ask(self, request: Mapping[str, Any]) -> dict[str, Any] | None:
        """The answer of the host; None if it has ended."""
        try:
            self._requests.write(json.dumps(request).encode() + b"\n")
            self._requests.flush()
            line = self._answers.readline()
        except (OSError, ValueError):
            return None
        return json.loads(line) if line.endswith(b"\n") else None

    def end(self) -> None:
        """End the host and its running job."""
        # The host ends its job when its input ends.
        with contextlib.suppress(OSError, ValueError):
            self._requests.close()
        try:
            self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        with contextlib.suppress(OSError):
            self._answers.close()


class Hosts:
    """Fork servers of one batch, or of one Dask worker: one for each thread."""

    def __init__(self) -> None:
        self._own = threading.local()
        self._lock = threading.Lock()
        self._all: set[_Host] = set()
        self._ended = False

    def run(self, packed: Packed) -> JobOutcome:
        """Run a job in a separate process, in a temporary folder."""
        if packed.version != (mine := this_version()):
            return JobOutcome("other version", f"this worker has {mine}, the batch needs {packed.version}")
        where = packed.scratch or None
        with tempfile.TemporaryDirectory(prefix="job-", dir=where, ignore_cleanup_errors=True) as folder:
            return self._run_in(Path(folder), packed)

    def end(self) -> None:
        """End all fork servers and the jobs that they run; `run` then reports every job as killed."""
        with self._lock:
            self._ended = True
            hosts = list(self._all)
            self._all.clear()
        for host in hosts:
            host.end()

    def _host(self, command: str) -> _Host | None:
        """The fork server of this thread; None after shutdown."""
        host: _Host | None = getattr(self._own, "host", None)
        with self._lock:
            if self._ended:
                return None
            if host is None or host not in self._all:
                host = self._own.host = _Host(command)
                self._all.add(host)
            return host

    def _run_in(self, folder: Path, packed: Packed) -> JobOutcome:
        names = [*packed.files]
        # Names may contain "..": the folder of the run is nested so deep that they stay within the temporary folder.
        depth = max(os.path.normpath(word).split(os.sep).count("..") for word in (*names, *packed.words))
        cwd = folder.joinpath("files", *("d" for _ in range(depth)))
        cwd.mkdir(parents=True)
        for name, content in packed.files.items():
            target = Path(os.path.normpath(cwd / name))
            target.parent.mkdir(parents=True, exist_ok=True)
            with named_errors(target):
                target.write_bytes(content)
        for word in packed.words:
            if os.sep in word and not os.path.isabs(word):  # create the folders of the batch for the files of a run
                Path(os.path.normpath(cwd / word)).parent.mkdir(parents=True, exist_ok=True)
        host = self._host(packed.words[0])
        limits = {"seconds": packed.seconds, "memory_bytes": packed.memory_bytes}
        job = {"cwd": str(cwd), "logs": str(folder), "words": packed.words, **limits}
        answer = None if host is None else host.ask(job)
        if host is not None and answer is None:
            host.end()
            with self._lock:
                self._all.discard(host)
        if answer is None:
            return JobOutcome("killed", "the process that ran it was killed")
        said, complained = (_text(folder / name) for name in ("out", "err"))
        ending, why = _ending(answer, packed, complained)
        files = dict(_written(folder / "files", cwd, names)) if ending == "ended" else {}
        return JobOutcome(
            ending, why, answer["code"] if ending == "ended" else 0, said, files, answer["wall_s"], answer["cpu_s"],
            answer["peak_bytes"],
        )  # fmt: skip


_of_worker = Hosts()


def run_packed(packed: Packed) -> JobOutcome:
    """`Hosts.run` on a Dask worker, whose fork servers live as long as the worker."""
    return _of_worker.run(packed)


def _ending(answer: Mapping[str, Any], packed: Packed, complained: str) -> tuple[Ending, str]:
    """End of a run, and the reason or its standard error."""
    if answer["out_of_time"]:
        return "out of time", f"stopped after {packed.seconds:g} s (--time-limit)"
    code = answer["code"]
    if code < 0:
        return "killed", f"killed by signal {-code}"
    # The reader computes the memory for a program in advance, and refuses it if that is too much.
    foreseen = packed.memory_bytes > 0 and code == 2 and MEMORY_NEEDED in complained
    if foreseen or FAILED_CODES.get(code) == "out of memory":
        return "out of memory", f"needs more than {packed.memory_bytes / 1e6:.0f} MB (--memory-limit)"
    if code in FAILED_CODES:
        last = complained.strip().splitlines()
        return "crashed", f"crashed: {last[-1] if last else 'no message'}"
    return "ended", complained


def _text(file: Path) -> str:
    try:
        return file.read_text(errors="replace")
    except OSError:
        return ""


def _written(root: Path, cwd: Path, read: list[str]) -> Iterator[tuple[str, bytes]]:
    """Files that a run wrote into its folder."""
    given = {os.path.normpath(cwd / name) for name in read}
    for file in sorted(root.rglob("*")):
        if file.is_file() and str(file) not in given:
            yield os.path.relpath(file, cwd), file.read_bytes()


LOCAL = "local"  # name for a cluster on this computer

_RETRIES = 3
_WAIT_S = 30


@dataclass(frozen=True)
class Cluster:
    """A Dask cluster for the jobs.

    Attributes:
        scheduler: its address, such as ``tcp://host:8786``, or "local" for a cluster on this machine.
        tls_ca: file of the authority's certificate, as for Dask; empty: none.
        tls_cert: file of this client's certificate; empty: none.
        tls_key: file of this client's key; empty: none.
    """

    scheduler: str
    tls_ca: str = ""
    tls_cert: str = ""
    tls_key: str = ""


@contextlib.contextmanager
def cluster_executor(cluster: Cluster, processes: int) -> Iterator[tuple[Executor, int]]:
    """Executor of a Dask cluster, and its number of parallel jobs; checks that its workers have this version."""
    scheduler = cluster.scheduler
    try:
        from distributed import Client, LocalCluster
        from distributed.security import Security
    except ModuleNotFoundError as error:
        raise ArgumentError(f"--scheduler needs {error.name}: pip install 'shapegcode[cluster]'") from None
    security = None
    if cluster.tls_ca or cluster.tls_cert or cluster.tls_key:
        security = Security(  # type: ignore[no-untyped-call]
            tls_ca_file=cluster.tls_ca or None, tls_client_cert=cluster.tls_cert or None,
            tls_client_key=cluster.tls_key or None, require_encryption=True,
        )  # fmt: skip
    with contextlib.ExitStack() as stack:
        where: Any = scheduler
        if scheduler == LOCAL:
            where = LocalCluster(n_workers=processes, threads_per_worker=1, dashboard_address=None)  # type: ignore[no-untyped-call]
            stack.enter_context(where)
        try:
            client = stack.enter_context(Client(where, security=security, timeout=_WAIT_S, set_as_default=False))  # type: ignore[no-untyped-call]
        except (OSError, ValueError, TypeError) as error:
            raise ArgumentError(f"--scheduler {scheduler}: no answer from a scheduler ({error})") from None
        slots = _checked_slots(client, scheduler)
        executor = client.get_executor(pure=False, retries=_RETRIES)
        try:
            yield executor, slots
        finally:
            executor.shutdown(wait=False)


def _checked_slots(client: Client, scheduler: str) -> int:
    """Check that all workers have this version, and count their parallel jobs."""
    try:
        versions = client.run(this_version)
    except ModuleNotFoundError as error:
        missing = f"a worker has no {error.name}: install shapegcode there"
        raise ArgumentError(f"--scheduler {scheduler}: {missing}") from None
    if not versions:
        raise ArgumentError(f"--scheduler {scheduler}: the scheduler has no workers; start some with `dask worker`")
    mine = _own_version()
    for worker, version in sorted(versions.items()):
        if version != mine:
            raise ArgumentError(f"worker {worker} has {version}, this is {mine}: install the same everywhere")
    return sum(client.nthreads().values())  # type: ignore[no-untyped-call]


def _own_version() -> str:
    return this_version()
