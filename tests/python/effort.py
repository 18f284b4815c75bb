"""How much CPU time a piece of work takes; a busy machine does not change it, so a ratio of two may be a test."""

import time
from collections.abc import Callable


def cpu_s(work: Callable[[], object], repeats: int = 2) -> float:
    """Least CPU time of some runs, s."""
    best = float("inf")
    for _ in range(repeats):
        began = time.process_time()
        work()
        best = min(best, time.process_time() - began)
    return best
