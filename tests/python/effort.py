"""How much CPU time a piece of work takes; a busy machine does not change it, so a ratio of two may be a test. And how
many of its random samples a slow test takes.
"""

import os
import time
from collections.abc import Callable


def trials(count: int) -> int:
    """So many with SHAPEGCODE_ALL_TRIALS set, as `make test-all` does; a quarter of them for `.ci/run`."""
    return count if "SHAPEGCODE_ALL_TRIALS" in os.environ else max(1, count // 4)


def cpu_s(work: Callable[[], object], repeats: int = 2) -> float:
    """Least CPU time of some runs, s."""
    best = float("inf")
    for _ in range(repeats):
        began = time.process_time()
        work()
        best = min(best, time.process_time() - began)
    return best
