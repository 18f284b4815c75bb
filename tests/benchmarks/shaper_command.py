"""Processor time of ``shapegcode shaper`` here and in another checkout, in turn, and whether both say the same.

    python tests/benchmarks/shaper_command.py ../before --runs 7

The other checkout needs its own compiled core. User and system time, start of Python included, bytecode compiled first.
"""

from __future__ import annotations

import argparse
import compileall
import os
import resource
import statistics
import subprocess
import sys
from pathlib import Path

MODES = {
    "two modes": ("46:0.02", "80:0.02"),
    "two with bands": ("46:0.02±5%", "80:0.02±5%"),
    "four with bands": ("46:0.02±5%", "80:0.02±5%", "120:0.02±5%", "200:0.02±5%"),
}


def run(modes: tuple[str, ...], package: Path) -> tuple[float, bytes]:
    """CPU seconds of one run, and what it printed."""
    words = [word for mode in modes for word in ("--mode", mode)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-m", "shapegcode", "shaper", *words],
        env=os.environ | {"PYTHONPATH": str(package)},
        capture_output=True,
        check=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout


def main() -> None:
    """Print median, least and largest of each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("before", type=Path, help="the other checkout")
    parser.add_argument("--runs", type=int, default=7)
    args = parser.parse_args()
    here = Path(__file__).resolve().parents[2]
    packages = {"before": args.before.resolve() / "python", "now": here / "python"}
    for package in packages.values():
        compileall.compile_dir(str(package / "shapegcode"), quiet=1)
    for name, modes in MODES.items():
        times: dict[str, list[float]] = {state: [] for state in packages}
        said: dict[str, bytes] = {}
        for _ in range(args.runs):
            for state, package in packages.items():
                taken, said[state] = run(modes, package)
                times[state].append(taken)
        figures = ", ".join(
            f"{state} {statistics.median(each):.2f} s ({min(each):.2f} – {max(each):.2f})"
            for state, each in times.items()
        )
        print(f"{name}: {figures}; {'the same output' if said['before'] == said['now'] else 'OTHER OUTPUT'}")


if __name__ == "__main__":
    main()
