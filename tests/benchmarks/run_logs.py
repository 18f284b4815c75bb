"""Reads the log of a whole day: CPU time, lines per second and peak memory, each in a process of its own.

python tests/benchmarks/run_logs.py [--lines 10000000]

The day is written again into a temporary folder: runs of 100 s with the items of NIST's logs (line number, feed,
spindle, runtime, tool, name of the program), a minute between them.
"""

from __future__ import annotations

import argparse
import gzip
import shutil
import sys
import tempfile
from datetime import datetime, timedelta
from pathlib import Path

import processes

_READ = """
import sys
from shapegcode.io.run_log import iter_run_logs
runs = blocks = 0
for run in iter_run_logs(sys.argv[1]):
    runs += 1
    blocks += len(run.block)
print(runs, blocks, file=sys.stderr)
"""
_START = datetime(2026, 3, 2)
_RUN_LINES = 2500


def write_day(path: Path, lines: int) -> int:
    """Write the log; the number of its runs."""
    count = runs = 0
    now = _START
    with path.open("w", encoding="ascii") as file:

        def put(seconds: float, item: str, value: object) -> None:
            nonlocal now, count
            now += timedelta(seconds=seconds)
            file.write(f"{now:%Y-%m-%dT%H:%M:%S.%f}0Z|{item}|{value}\n")
            count += 1

        while count < lines:
            runs += 1
            put(60.0, "Program_Status", "ACTIVE")
            put(0.02, "Program_Name_Running", f"PART-{runs % 7}.NC")
            for k in range(_RUN_LINES):
                block = 7 + k // 4
                item, value = (
                    ("Block_Number", block),
                    ("Feed_Rate", f"{16.9333 + k % 5:.4f}"),
                    ("Spindle_Speed", f"{12000 + k % 3}.000000"),
                    ("Program_Runtime_Seconds", k // 25),
                )[k % 4]
                put(0.04, item, value)
                if k % 600 == 0:
                    put(0.0, "Current_Tool", f"{k // 600 + 1}.000000")
            put(0.05, "Program_Status", "PROGRAM_COMPLETED")
    return runs


def main() -> None:
    """Write, read, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lines", type=int, default=10_000_000)
    lines = parser.parse_args().lines
    with tempfile.TemporaryDirectory() as folder:
        day, script = Path(folder) / "day.txt", Path(folder) / "read.py"
        packed = day.with_suffix(".txt.gz")
        script.write_text(_READ)
        runs = write_day(day, lines)
        with day.open("rb") as source, gzip.open(packed, "wb", compresslevel=1) as target:
            shutil.copyfileobj(source, target)
        for path in (day, packed):
            run = processes.launched([sys.executable, script, path])
            print(
                f"{path.suffix:>4} {path.stat().st_size / 1e6:7.0f} MB  {lines / 1e6:.1f} million lines, {runs} runs: "
                f"{run.cpu_s:.1f} s CPU, {lines / run.cpu_s / 1e6:.2f} million lines/s, peak {run.peak_mb:.0f} MB"
            )


if __name__ == "__main__":
    main()
