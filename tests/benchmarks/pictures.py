"""What --plots costs beside the command without it: `python tests/benchmarks/pictures.py`.

Each run is a process of its own, and the processor time of all its threads counts. Both run in turn, so that a slow
minute of the machine slows both.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

from places import GOLDEN
from processes import SHAPEGCODE, launched
from table import Sample

PROGRAM = GOLDEN / "PARALLEL.NC"
COMMANDS = (["simulate"], ["convert", "-o", "out.nc", "--shape-all"], ["time"])


def seconds(words: list[str], folder: Path) -> float:
    """Processor time of a command on the program."""
    command = [SHAPEGCODE, words[0], PROGRAM, "-m", "vx500", *words[1:]]
    return launched(command, folder=folder, accepted=(0, 1)).cpu_s


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeat", type=int, default=3, help="how often each runs (default: %(default)d)")
    repeat = parser.parse_args().repeat
    print(f"{PROGRAM.name}, vx500; processor time in s, median (least – largest) of {repeat}\n")
    print("| command | alone | with --plots | pictures cost, in commands |")
    print("|---|--:|--:|--:|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for words in COMMANDS:
            alone, drawn = [], []
            for _ in range(repeat):
                alone.append(seconds(words, folder))
                drawn.append(seconds([*words, "--plots", "plots"], folder))
            more = Sample.of([with_them - without for with_them, without in zip(drawn, alone, strict=True)])
            both = Sample.of(alone)
            print(f"| `{words[0]}` | {both} | {Sample.of(drawn)} | {more / both} |")


if __name__ == "__main__":
    main()
