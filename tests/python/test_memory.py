"""Peak memory of a conversion: what a block more costs."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
FEW, MANY = 200_000, 400_000  # with fewer, what does not grow is not yet there
MAX_BYTES_PER_BLOCK = 150


def peak_bytes(folder: Path, lines: int) -> int:
    """Peak memory of `shapegcode convert` as a process of its own, of a program of so many lines."""
    program = folder / f"{lines}.nc"
    write = f"import workload, pathlib; workload.write_program(pathlib.Path({str(program)!r}), {lines})"
    subprocess.run([sys.executable, "-c", write], cwd=BENCHMARKS, check=True)
    command = [sys.executable, "-m", "shapegcode", "convert", program, "-m", "vx500", "-o", folder / "shaped.nc"]
    launcher = [sys.executable, "-I", "-S", BENCHMARKS / "launch.py", *command]
    run = json.loads(subprocess.run(launcher, env=dict(os.environ), capture_output=True, check=True).stdout)
    assert run["exit_code"] == 0, run["messages"]
    return round(run["peak_mb"] * 1e6)


@pytest.mark.slow
def test_a_block_more_costs_little_memory(tmp_path: Path) -> None:
    few, many = peak_bytes(tmp_path, FEW), peak_bytes(tmp_path, MANY)
    assert (many - few) / (MANY - FEW) <= MAX_BYTES_PER_BLOCK
