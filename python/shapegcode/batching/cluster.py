"""The same jobs on Dask: an executor whose workers are processes of a cluster; needs `shapegcode[cluster]`."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from shapegcode.errors import ArgumentError
from shapegcode.results.made import this_version

if TYPE_CHECKING:
    from distributed import Client

LOCAL = "local"
"""Word for a cluster of this machine."""

_RETRIES = 3
_WAIT_S = 30


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


@contextlib.contextmanager
def cluster_executor(cluster: Cluster, processes: int) -> Iterator[tuple[Executor, int]]:
    """An executor of a Dask cluster, whose workers were found to have this version of shapegcode."""
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
        if scheduler == LOCAL:
            where: Any = stack.enter_context(
                LocalCluster(n_workers=processes, threads_per_worker=1, dashboard_address=None)  # type: ignore[no-untyped-call]
            )
        else:
            where = scheduler
        try:
            client = stack.enter_context(Client(where, security=security, timeout=_WAIT_S, set_as_default=False))  # type: ignore[no-untyped-call]
        except (OSError, ValueError, TypeError) as error:
            raise ArgumentError(f"--scheduler {scheduler}: no scheduler answers there ({error})") from None
        slots = _checked_slots(client, scheduler)
        executor = client.get_executor(pure=False, retries=_RETRIES)
        try:
            yield executor, slots
        finally:
            executor.shutdown(wait=False)


def _checked_slots(client: Client, scheduler: str) -> int:
    """How many jobs the workers run at a time; all of them have this version."""
    try:
        versions = client.run(this_version)
    except ModuleNotFoundError as error:
        raise ArgumentError(
            f"--scheduler {scheduler}: a worker has no {error.name}: install shapegcode there"
        ) from None
    if not versions:
        raise ArgumentError(f"--scheduler {scheduler}: the scheduler has no workers; start some with `dask worker`")
    mine = _own_version()
    for worker, version in sorted(versions.items()):
        if version != mine:
            raise ArgumentError(f"worker {worker} has {version}, this is {mine}: install the same everywhere")
    return sum(client.nthreads().values())  # type: ignore[no-untyped-call]


def _own_version() -> str:
    return this_version()
