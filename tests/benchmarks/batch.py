"""What a batch costs beside the conversions: `python tests/benchmarks/batch.py [--repeat N] [--each] [--growth]`.

200 programs of several sizes (random polygons of 5 to 600 moves, four samples among them) are converted four ways in
turn: one after the other within one process (the conversions themselves, with JSON as a batch writes it), as a batch
with one process, with two, and on a Dask cluster of this machine with two workers. `--each` does instead one program
after the other in three ways in turn, so that other work on the machine meets all of them: within a process that has
converted before, in a process forked for it and nothing else, and as a run of a batch. `--growth` checks 100, 1 000
and 10 000 small programs instead and tells the client's memory.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from places import GOLDEN
from processes import SHAPEGCODE, Run, launched
from table import Sample

from shapegcode.batching.plan import find_programs, plan
from shapegcode.batching.process import Base, Hosts, pack

SAMPLES = ("TEST_G90.NC", "G83.NC", "VINT_360arc.NC", "helical_bore.nc")
SIZES = (5, 10, 20, 40, 80, 150, 300, 600)
ASKED = """
import json, os, sys, time
from shapegcode.cli import main
told = os.fdopen(os.dup(1), "w")
os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
for rank, line in enumerate(sys.stdin):
    words = json.loads(line)
    begin = time.perf_counter()
    if rank and sys.argv[1] == "forked":
        pid = os.fork()
        if not pid:
            main(words)
            os._exit(0)
        os.waitpid(pid, 0)
    else:
        main(words)
    print(time.perf_counter() - begin, file=told, flush=True)
"""


def polygon(draw: random.Random, moves: int) -> str:
    """A program of random feeds along random lines."""
    lines = ["%", "O0001", "G90 G21 G17 G54", "G0 X0 Y0 Z5.", "G1 Z0. F2000."]
    for _ in range(moves):
        lines.append(f"X{draw.uniform(0, 120):.3f} Y{draw.uniform(0, 80):.3f} F{draw.randrange(500, 4000, 100)}")
    return "\n".join([*lines, "G0 Z5.", "M30", "%", ""])


def make(folder: Path, count: int, sizes: tuple[int, ...]) -> None:
    """The programs."""
    draw = random.Random(5)
    parts = folder / "parts"
    shutil.rmtree(parts, ignore_errors=True)
    parts.mkdir()
    for rank in range(count):
        (parts / f"p{rank:05d}.nc").write_text(polygon(draw, draw.choice(sizes)))
    if len(sizes) > 1:
        for rank, name in enumerate(SAMPLES):
            shutil.copy(GOLDEN / name, parts / f"p{rank:05d}.nc")


def loop(folder: Path) -> float:
    """The conversions one after the other in one process that has loaded all, with one thread as in a batch."""
    shutil.rmtree(folder / "loop", ignore_errors=True)
    (folder / "loop").mkdir()
    names = sorted(os.listdir(folder / "parts"))
    within = Asked("within", folder)

    def convert(name: str, output: str) -> float:
        words = ["-m", "vx500", "-o", f"loop/{output}", "--json", f"loop/{output}.json", "-q"]
        return within(["convert", f"parts/{name}", *words])

    convert(names[0], "first")
    spent = sum(convert(name, name) for name in names)
    within.end()
    return spent


def batch(folder: Path, *words: str) -> Run:
    """The batch as a process, its own start and end within."""
    shutil.rmtree(folder / "out", ignore_errors=True)
    command = [SHAPEGCODE, "batch", "parts", "-m", "vx500", "-o", "out", "-q", *words]
    return launched(command, folder=folder, accepted=(0, 1))


def compare(folder: Path, count: int, repeat: int) -> None:
    """The four ways."""
    make(folder, count, SIZES)
    ways: dict[str, Callable[[], float]] = {
        "conversions alone": lambda: loop(folder),
        "one process": lambda: batch(folder, "--jobs", "1").wall_s,
        "two processes": lambda: batch(folder, "--jobs", "2").wall_s,
        "Dask, two workers": lambda: batch(folder, "--jobs", "2", "--scheduler", "local").wall_s,
    }
    found: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(repeat):
        for name, run in ways.items():
            found[name].append(run())
    samples = {name: Sample.of(values) for name, values in found.items()}
    print(f"{count} programs, {os.cpu_count()} processors; wall clock in s, median (least – largest) of {repeat}\n")
    for name, sample in samples.items():
        print(f"| {name} | {sample} |")
    alone, one, two, dask = samples.values()
    over = Sample.of([1e3 * (a - b) / count for a, b in zip(one.values, alone.values, strict=True)])
    print(f"\none process / two processes: {one / two}")
    print(f"overhead per program beside the conversion: {over} ms")
    print(f"Dask / pool, two each: {dask / two}")


class Asked:
    """A process that converts what it is told, with one thread as in a batch: itself, or forked off it."""

    def __init__(self, how: str, folder: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", ASKED, how], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=folder,
            env={**os.environ, "SHAPEGCODE_THREADS": "1"},
        )  # fmt: skip

    def __call__(self, words: Sequence[str]) -> float:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(json.dumps(words), file=self._process.stdin, flush=True)
        return float(self._process.stdout.readline())

    def end(self) -> None:
        self._process.communicate()


def each(folder: Path, count: int, repeat: int) -> None:
    """Program by program, the least of its repetitions each."""
    make(folder, count, SIZES)
    os.chdir(folder)
    Path("scratch").mkdir()
    Path("out").mkdir()
    planned = plan(find_programs(["parts"], "out"), ["vx500"], "out", "convert", [], None, Base(str(folder)))
    within, forked, hosts = Asked("within", folder), Asked("forked", folder), Hosts()
    # What is converted first, within the process, sets up what the others find.
    for ask in (within, forked):
        ask(planned.job(0).words)
    found: dict[str, list[list[float]]] = {"within": [], "forked": [], "batch": []}
    for rank in range(len(planned)):
        job = planned.job(rank)
        for times in found.values():
            times.append([])
        for _ in range(repeat):
            found["within"][-1].append(within(job.words))
            found["forked"][-1].append(forked(job.words))
            begin = time.perf_counter()
            hosts.run(pack(job, planned.files(rank), seconds=3600.0, scratch="scratch"))
            found["batch"][-1].append(time.perf_counter() - begin)
    hosts.end()
    within.end()
    forked.end()
    least = {name: [1e3 * min(times) for times in programs] for name, programs in found.items()}
    print(f"{count} programs in turn, mean of the least of {repeat} of each, ms")
    for name, values in least.items():
        print(f"| {name} | {statistics.mean(values):.1f} |")
    for name in ("within", "forked"):
        over = [a - b for a, b in zip(least["batch"], least[name], strict=True)]
        quartiles = ", ".join(f"{each:.1f}" for each in statistics.quantiles(over, n=4))
        print(f"a run of a batch over {name}: mean {statistics.mean(over):.1f}, quartiles {quartiles}")


def growth(folder: Path) -> None:
    """Time per program and the client's memory for ten and a hundred times as many."""
    print("\n| programs | time per program | client's largest memory |\n|--:|--:|--:|")
    for count in (100, 1_000, 10_000):
        make(folder, count, (4,))
        run = batch(folder, "--command", "check", "--json", "all.json")
        rows = json.loads((folder / "all.json").read_text())["rows"]
        assert len(rows) == count
        print(f"| {count} | {1e3 * run.wall_s / count:.1f} ms | {run.peak_mb:.0f} MB |", flush=True)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=3, help="how often each way (default: %(default)d)")
    parser.add_argument("--count", type=int, default=200, help="programs (default: %(default)d)")
    parser.add_argument("--each", action="store_true", help="program by program in turn instead")
    parser.add_argument("--growth", action="store_true", help="100, 1 000 and 10 000 programs instead")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        if given.each:
            each(Path(name), given.count, given.repeat)
        elif given.growth:
            growth(Path(name))
        else:
            compare(Path(name), given.count, given.repeat)
    print(f"\nlargest memory of a process: {resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024:.0f} MB")


if __name__ == "__main__":
    main()
