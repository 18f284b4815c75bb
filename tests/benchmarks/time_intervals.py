"""Do the 95 % intervals of predicted times hold what programs took that were not learned from?

python tests/benchmarks/time_intervals.py [--controls 20] [--only nist|simulated]

Every program of NIST's test bed is left out once: its machine is learned from the others (some five minutes of CPU).
Then simulated controls with drawn facts, a planner of their own and a block time (judge/run_simulator.py):
of two programs of pockets and one of a surface in small moves one is left out, in turn (some ten minutes for 20).
Prints coverage and half-widths; exit code 1 if less than 90 % is held, or the median half-width is
above 3 %.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import places  # noqa: F401
from evidence_nist import left_out, nist_runs
from table import markdown

import shapegcode as sg
from judge.run_simulator import drawn_control, surface_program, written_program

COVERAGE_PERCENT, HALF_WIDTH_PERCENT = 90.0, 3.0
MACHINES = (("BOX_OP2", "BOX_OP3"), ("COVER", "PLATE-12", "PLATE-13"))
KINDS = ("speed difference", "speed difference, block time", "junction deviation")


@dataclass(frozen=True)
class Held:
    """A program left out: its runs beside the interval."""

    learned: str
    program: str
    predicted_s: float
    half_width_percent: float
    errors_percent: tuple[float, ...]  # predicted over measured, by run

    @property
    def held(self) -> float:
        """The ratio of its runs that are in the interval."""
        return float(np.mean(np.abs(self.errors_percent) <= self.half_width_percent))


def held(learned: str, found: sg.CycleTimeCalibration) -> Held:
    """The runs of the program that was left out."""
    runs = left_out(found)
    errors = tuple(100.0 * (run.predicted_s / (run.measured_s or np.nan) - 1.0) for run in runs)
    halves = [100.0 * (run.high_s - run.low_s) / 2.0 / run.predicted_s for run in runs]
    name = Path(runs[0].program).stem
    return Held(learned, name, float(np.median([run.predicted_s for run in runs])), float(np.median(halves)), errors)


def nist() -> Iterator[Held]:
    """Each program of the test bed left out once."""
    for programs in MACHINES:
        for name in programs:
            others = [each for each in programs if each != name]
            found = sg.calibrate_cycle_time(nist_runs(dict.fromkeys(others, ()), name), sg.Machine.load("vx500"))
            yield held(", ".join(others), found)


def simulated(seed: int, families: tuple[str, ...] = KINDS) -> Held:
    """A drawn control, one of its three programs left out."""
    control = drawn_control(seed)
    texts = {"pockets": written_program(seed), "other": written_program(100 + seed), "surface": surface_program(seed)}
    test = list(texts)[seed % 3]
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number, (title, text) in enumerate(texts.items()):
            (folder / f"{title}.nc").write_text(text)
            for run in range(2):
                (folder / f"{title}-{run}.txt").write_text(control.run(text, seed=100 * seed + 10 * number + run)[0])
            # Of the program left out the log tells what it took, and nothing else.
            use = '"test"\noverride_percent = 100.0\nrapid_override_percent = 100.0' if title == test else '"fit"'
            rows.append(f'[[runs]]\nprogram = "{title}.nc"\nlog = "{title}-*.txt"\nuse = {use}\n')
        (folder / "RUNS.toml").write_text("\n".join(rows))
        found = sg.calibrate_cycle_time(folder / "RUNS.toml", sg.Machine.load("vx500"), families=families)
    return held(f"control {seed}", found)


def report(title: str, rows: list[Held]) -> bool:
    """Print them; whether the limits are kept."""
    half = float(np.median([row.half_width_percent for row in rows]))
    coverage = 100.0 * float(np.mean([row.held for row in rows]))  # each program counts alike
    print(f"\n{title}: {coverage:.0f} % of {len(rows)} programs left out are held, median half-width {half:.2f} %")
    cells = [
        (row.learned, row.program, f"{row.predicted_s:.1f} s", f"± {row.half_width_percent:.2f} %",
         f"{np.median(row.errors_percent):+.2f} %", f"{100.0 * row.held:.0f} %")
        for row in rows
    ]  # fmt: skip
    print(markdown(["learned from", "left out", "predicted", "95 %", "error", "held"], cells), flush=True)
    return coverage >= COVERAGE_PERCENT and half <= HALF_WIDTH_PERCENT


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--controls", type=int, default=20)
    parser.add_argument(
        "--first", type=int, default=21, help="seed of the first control"
    )  # 1 to 20 served to find faults
    parser.add_argument("--only", choices=("nist", "simulated"))
    args = parser.parse_args()
    kept = []
    if args.only != "simulated":
        kept.append(report("NIST's test bed", list(nist())))
    if args.only != "nist":
        rows = []
        for seed in range(args.first, args.first + args.controls):
            rows.append(simulated(seed))
            print(rows[-1], file=sys.stderr, flush=True)
        kept.append(report("simulated controls", rows))
    if not all(kept):
        raise SystemExit("out of the limits")


if __name__ == "__main__":
    main()
