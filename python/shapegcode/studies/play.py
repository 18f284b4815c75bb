"""Draws played on processors: threads of this process, or the workers of a Dask cluster."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass

from shapegcode.studies.replay import PackedText, Replay
from shapegcode.studies.varied import drawn_machine
from shapegcode.verdict.ahead import cores

OVERRIDE = "times.feed_override_percent"
"""Where it is varied, the blocks are played at it."""

_AT_ONCE = 64  # draws of a task at most: long enough to be worth one
_PLAYED_S = 900.0  # of motion in a task: short enough to tell how far it is, and to be stopped
_KEPT_TEXTS = 4


@dataclass(frozen=True)
class DrawsJob:
    """Some draws of one text."""

    name: str  # of the machine, in messages
    rows: tuple[Mapping[str, object], ...]  # values of the machine that plays, by key, a row for each draw
    draws: tuple[int, ...]  # their numbers
    wanted: tuple[str, ...]  # what is measured
    times: bool  # see `Replay.play`

    def play(self, replay: Replay) -> list[list[float]]:
        """Play them."""
        found = []
        for row, draw in zip(self.rows, self.draws, strict=True):
            machine = drawn_machine(replay.machine, row, f"{self.name}, draw {draw}")
            override = machine.times.feed_override_percent / 100.0 if OVERRIDE in row else 1.0
            measured = replay.play(machine, self.wanted, override=override, times=self.times)
            found.append([measured[name] for name in self.wanted])
        return found

    def parts(self, motion_s: float) -> Iterator[DrawsJob]:
        """The same in tasks."""
        size = max(1, min(_AT_ONCE, int(_PLAYED_S / max(motion_s, 1e-3))))
        for at in range(0, len(self.rows), size):
            rows, draws = self.rows[at : at + size], self.draws[at : at + size]
            yield DrawsJob(self.name, rows, draws, self.wanted, self.times)


def play_all(
    replay: Replay, job: DrawsJob, pool: Executor | None, on_done: Callable[[int], None] = lambda _count: None
) -> list[list[float]]:
    """Play the draws of one text."""
    parts = list(job.parts(replay.time_s))
    found: list[list[float]] = []
    if pool is not None:
        packed = replay.packed()
        running = [pool.submit(_play_packed, packed, part) for part in parts]
    else:
        own = ThreadPoolExecutor(cores())
        running = [own.submit(part.play, replay) for part in parts]
    try:
        for future, part in zip(running, parts, strict=True):
            found += future.result()
            on_done(len(part.rows))
    finally:
        for future in running:
            future.cancel()
        if pool is None:
            own.shutdown()
    return found


@functools.lru_cache(maxsize=_KEPT_TEXTS)
def _unpacked(packed: PackedText) -> Replay:
    return Replay.unpacked(packed)


def _play_packed(packed: PackedText, job: DrawsJob) -> list[list[float]]:
    """On a worker: a text is read once for all its draws."""
    return job.play(_unpacked(packed))
