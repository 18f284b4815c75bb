"""Tasks of one job in a thread pool, collected in order: the same results with any number of threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future
from functools import partial
from queue import SimpleQueue
from typing import Generic, TypeVar

T = TypeVar("T")

OnShare = Callable[[float], None]
"""Told how much of a part is done, 0 to 1."""

_WAITING = 2  # parts per core that are under way or done and not yet taken: what bounds the memory


def cores() -> int:
    """Processors that this process may use, by its affinity; SHAPEGCODE_THREADS says another number."""
    said = os.environ.get("SHAPEGCODE_THREADS", "")
    if said.isdecimal() and int(said) > 0:
        return int(said)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Ahead(Generic[T]):
    """Runs tasks in a pool some steps before their results are asked for, one after the other.

    Args:
        pool: that runs them.
        tasks: by number, in the order in which they are asked for; each is given what it tells its share to.
        weights: of each part of the progress, those without a task among them.
        on_progress: told the sum of the weights done, in the thread that asks for results.

    Attributes:
        on_progress: as given; may be set anew.
    """

    def __init__(
        self,
        pool: Executor,
        tasks: Mapping[int, Callable[[OnShare], T]],
        weights: Mapping[int, float],
        on_progress: Callable[[float], None],
    ) -> None:
        self._pool, self._weights, self.on_progress = pool, weights, on_progress
        self._waiting = list(tasks.items())[::-1]
        self._running: dict[int, Future[T]] = {}
        # Number of a part and its share; None: a part has ended.
        self._news: SimpleQueue[tuple[int, float] | None] = SimpleQueue()
        self._shares = dict.fromkeys(weights, 0.0)
        self._done = 0.0

    def begin(self) -> None:
        """Start the first tasks before a result is asked for."""
        while self._waiting and len(self._running) < _WAITING * cores():
            number, task = self._waiting.pop()
            future = self._pool.submit(task, partial(self._hear, number))
            future.add_done_callback(lambda _future: self._news.put(None))
            self._running[number] = future

    def result(self, number: int) -> T:
        """The result of the next task."""
        self.begin()
        future = self._running.pop(number)
        while not future.done():
            self._tell(self._news.get())
        self.skip(number)
        return future.result()

    def skip(self, number: int) -> None:
        """Count a part as done."""
        self._tell((number, 1.0))

    def _hear(self, number: int, share: float) -> None:
        self._news.put((number, share))

    def _tell(self, news: tuple[int, float] | None) -> None:
        if news is not None:
            number, share = news
            if share > self._shares[number]:
                self._done += (share - self._shares[number]) * self._weights[number]
                self._shares[number] = share
            self.on_progress(self._done)
