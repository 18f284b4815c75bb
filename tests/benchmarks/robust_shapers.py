"""Robust grid shapers beside convolved EI shapers for random mode pairs, and the time a design takes.

Run from the root of the repository: ``python tests/benchmarks/robust_shapers.py``. Both modes lie within 10 %. The EI
shapers (5 %, three impulses each) stand at continuous times, where they are best; the grid design has no greater
duration.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from functools import partial

import numpy as np
import places  # noqa: F401
from table import markdown, timed

from extra_insensitive import ei_convolved, fine_enough_period_s, random_pairs, worst_over_bands
from shapegcode.shaping import ModeBand, choose_block_period, least_worst, minimax_robust

_PERIODS_MS = (1, 2, 3, 4, 5)


def _times(name: str, seconds: Sequence[float]) -> list[str]:
    return [
        name,
        *(f"{1e3 * value:.0f} ms" for value in (np.median(seconds), np.percentile(seconds, 95), max(seconds))),
    ]


def main() -> int:
    """Print the tables; 0 if no pair on a fine enough grid is worse than EI."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()

    pairs = random_pairs(arguments.pairs, arguments.seed)
    ratios: dict[str, list[float]] = {"fine enough": [], **{f"{period} ms": [] for period in _PERIODS_MS}}
    worse: list[list[str]] = []
    shares: list[float] = []
    min_s: list[float] = []
    minimax_s: list[float] = []
    choice_s: list[float] = []
    for bands in pairs:
        times_s, amplitudes = ei_convolved(bands)
        theirs = worst_over_bands(times_s, amplitudes, bands, 2001)
        fine_s = fine_enough_period_s(bands)
        for name, values in ratios.items():
            period_s = fine_s if name == "fine enough" else 1e-3 * int(name.split()[0])
            spent_s, found = timed(partial(least_worst, bands, period_s, float(times_s.max())), time.process_time)
            min_s.append(spent_s)
            ours = worst_over_bands(found.shaper.times_s, found.shaper.amplitudes, bands, 2001)
            values.append(ours / theirs)
            if ours > theirs:
                worse.append(_worse(bands, name, period_s, ours, theirs))
        shortest = minimax_robust(bands, fine_s, vibration_limit=theirs)
        shares.append(shortest.shaper.duration_s / float(times_s.max()))
        minimax_s.append(timed(partial(minimax_robust, bands, fine_s), time.process_time)[0])
        choice_s.append(timed(partial(choose_block_period, bands, 0.001, 0.002), time.process_time)[0])

    rows = [
        [name, f"{sum(r <= 1.0 for r in values)} of {len(values)}", f"{np.median(values):.2f}", f"{max(values):.2f}"]
        for name, values in ratios.items()
    ]
    print(markdown(["grid", "no worse than EI", "median ours/EI", "largest"], rows), end="\n\n")
    print(
        f"shortest design with the residual of EI, fine enough grid: {np.median(shares):.2f} of its duration "
        f"({min(shares):.2f} to {max(shares):.2f})",
        end="\n\n",
    )
    times = [
        _times("minimax", min_s),
        _times("minimax_robust", minimax_s),
        _times("choose_block_period, 2 to 20 ms", choice_s),
    ]
    print(markdown(["CPU time", "median", "95 %", "most"], times), end="\n\n")
    print(markdown(["worse than EI", "grid", "periods per swing at the upper end", "ours", "EI"], worse))
    return int(max(ratios["fine enough"]) > 1.0)


def _worse(bands: Sequence[ModeBand], name: str, period_s: float, ours: float, theirs: float) -> list[str]:
    highest_hz = max(band.mode.frequency_hz * (1.0 + band.uncertainty) for band in bands)
    modes = ", ".join(f"{band.mode.frequency_hz:.1f}:{band.mode.damping_ratio:.3f}" for band in bands)
    return [modes, name, f"{1.0 / (highest_hz * period_s):.2f}", f"{100 * ours:.2f} %", f"{100 * theirs:.2f} %"]


if __name__ == "__main__":
    sys.exit(main())
