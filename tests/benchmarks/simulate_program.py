"""Time and memory of `shapegcode simulate` on programs of any length: `python tests/benchmarks/simulate_program.py`.

Each run is a process of its own: processor time of all its threads, and its largest resident size, NumPy included.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path

from processes import SHAPEGCODE, launched

SQUARE_S = 24.4  # a square of 20 mm at 200 mm/min, a dwell and two rapids
SQUARE = "G01 X20. F200.\nY20.\nX0.\nY0.\nG04 P100\nG00 Z1.\nG00 Z0.\n"


@dataclass(frozen=True)
class Run:
    """A command: hours of the program, plant, further words, the file they name."""

    hours: float
    plant: str
    words: tuple[str, ...]
    file: str = ""


RUNS = (
    Run(1.0, "modal", ()),
    Run(10.0, "modal", ()),
    Run(10.0, "modal", ("--npz", "m.npz"), "m.npz"),
    Run(10.0, "modal", ("--npz", "m.npz", "--every", "10"), "m.npz"),
    Run(10.0, "modal", ("--csv", "m.csv"), "m.csv"),
    Run(0.02, "feed-drive", ("--npz", "m.npz"), "m.npz"),
    Run(0.1, "feed-drive", ("--npz", "m.npz"), "m.npz"),
)


def measured(run: Run, folder: Path) -> tuple[float, float, float]:
    """Seconds of processor time, MB resident, MB of the file."""
    turns = max(round(run.hours * 3600.0 / SQUARE_S), 1)
    (folder / "part.nc").write_text("%\nO1\nG21 G17 G90 G94\nG00 X0. Y0. Z0.\n" + SQUARE * turns + "M30\n%\n")
    words = ["simulate", "part.nc", "-m", "vx500", "--plant", run.plant, *run.words]
    done = launched([SHAPEGCODE, *words], folder=folder)
    size = (folder / run.file).stat().st_size if run.file else 0
    return done.cpu_s, done.peak_mb * 1e6 / 2**20, size / 1e6


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a hundredth of the hours")
    scale = 0.01 if parser.parse_args().quick else 1.0
    print("| program | plant | options | processor time | resident | file |\n|---|---|---|---|---|---|")
    for run in RUNS:
        scaled = Run(run.hours * scale, run.plant, run.words, run.file)
        with tempfile.TemporaryDirectory() as folder:
            seconds, resident_mb, file_mb = measured(scaled, Path(folder))
        name = f"{scaled.hours:g} h, {scaled.hours * 3.6:.3g} million samples"
        file = f"{file_mb:.0f} MB" if run.file else ""
        words = " ".join(run.words)
        print(f"| {name} | {run.plant} | {words} | {seconds:.1f} s | {resident_mb:.0f} MB | {file} |", flush=True)


if __name__ == "__main__":
    main()
