"""Runs a command and prints one JSON line: exit code, messages, wall and CPU seconds, peak memory of the command alone.

A process of its own, because Linux counts into a program's peak what its parent held when it was started; this one
holds almost nothing.
"""

import json
import resource
import subprocess
import sys
import time

begin = time.perf_counter()
run = subprocess.run(
    sys.argv[1:], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False
)
wall_s = time.perf_counter() - begin
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(
    json.dumps(
        {
            "exit_code": run.returncode,
            "messages": run.stderr.decode(errors="replace"),
            "wall_s": wall_s,
            "cpu_s": used.ru_utime + used.ru_stime,
            "peak_mb": used.ru_maxrss * 1024 / 1e6,
        }
    )
)
