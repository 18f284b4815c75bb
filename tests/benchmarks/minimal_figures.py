"""Figures of docs/concepts/minimal_shapers.md: `python tests/benchmarks/minimal_figures.py` prints them."""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shapegcode._core import Mode, convolved_zv, minimal_shapers

SPANS = (1.0, 1.5, 2.0)
"""Durations of the convolved ZV that are searched, one after the other until one holds a shaper."""


@dataclass(frozen=True)
class Solved:
    """What was found for a set of modes."""

    modes: tuple[Mode, ...]  # the set
    found: int  # number of shapers in the last region that was searched
    shortest_s: float  # duration of the shortest, s; NaN if there is none
    shortest_non_negative_s: float  # the same of those without negative taps
    convolved_s: float  # duration of the convolved ZV, s
    residual: float  # largest residual ratio of any mode after any of the shapers; 0 if there is none
    complete: bool  # whether no other shaper exists in the region
    shortest_proven: bool  # whether no shorter one exists
    seconds: float  # processor time of the search


def random_sets(count: int, seed: int) -> list[tuple[Mode, ...]]:
    """Sets of 2, 3 and 4 modes in turn: neighbours at least 1.1 apart, extremes at most 8; every fifth undamped."""
    rng = np.random.default_rng(seed)
    sets = []
    for index in range(count):
        n = 2 + index % 3
        least = (n - 1) * np.log(1.1)
        free = rng.uniform(0.0, np.log(8.0) - least)
        gaps = np.log(1.1) + free * rng.dirichlet(np.ones(n - 1))
        frequencies = 20.0 * np.exp(np.concatenate([[0.0], np.cumsum(gaps)]))
        damping = np.zeros(n) if index % 5 == 0 else rng.uniform(0.0, 0.1, n)
        sets.append(tuple(Mode(float(f), float(z)) for f, z in zip(frequencies, damping, strict=True)))
    return sets


def solve(modes: Sequence[Mode], max_boxes: int = 400_000, max_abs_sum: float = 10.0) -> Solved:
    """The set's minimal shapers within the first of `SPANS` that has one."""
    begin = time.process_time()
    convolved_s = convolved_zv(modes).duration_s
    for span in SPANS:
        result = minimal_shapers(modes, span * convolved_s, max_boxes=max_boxes, max_abs_sum=max_abs_sum)
        if result.shapers:
            break
    seconds = time.process_time() - begin
    shortest_s = result.shapers[0].duration_s if result.shapers else float("nan")
    return Solved(
        tuple(modes),
        len(result.shapers),
        shortest_s,
        next((shaper.duration_s for shaper in result.shapers if not shaper.has_negative), float("nan")),
        convolved_s,
        max((shaper.residual_ratio(mode) for shaper in result.shapers for mode in modes), default=0.0),
        result.complete,
        bool(result.shapers) and result.complete_up_to_s >= shortest_s,
        seconds,
    )


def _print_figures(results: Sequence[Solved]) -> None:
    for n in (2, 3, 4):
        rows = [each for each in results if len(each.modes) == n]
        found = [each for each in rows if each.found]
        within = [each for each in found if each.shortest_s <= each.convolved_s]
        non_negative = [each for each in rows if each.shortest_non_negative_s == each.shortest_non_negative_s]
        ratio = statistics.median(each.shortest_s / each.convolved_s for each in found)
        positive = statistics.median(each.shortest_non_negative_s / each.convolved_s for each in non_negative)
        print(
            f"{n} modes: {len(rows)} sets; found {100 * len(found) / len(rows):.1f} %, "
            f"within convolved ZV {100 * len(within) / len(rows):.1f} %; "
            f"not found but proven absent {sum(each.complete for each in rows if not each.found)}; "
            f"list complete {100 * sum(each.complete for each in rows) / len(rows):.0f} %, "
            f"shortest proven {100 * sum(each.shortest_proven for each in rows) / len(rows):.0f} %; "
            f"shapers per set: median {statistics.median(each.found for each in rows):.0f}, "
            f"most {max(each.found for each in rows)}; "
            f"duration/convolved ZV: median {ratio:.3f}, without negative taps {positive:.3f} "
            f"({100 * len(non_negative) / len(rows):.0f} % of the sets); "
            f"largest residual {max(each.residual for each in rows):.1e}; "
            f"seconds per set: median {statistics.median(each.seconds for each in rows):.3f}, "
            f"most {max(each.seconds for each in rows):.2f}"
        )
    print(f"{len(results)} sets in {sum(each.seconds for each in results):.0f} s")


def main() -> None:
    """Solve the sets and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=500, help="number of sets (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the random numbers (default: %(default)s)")
    parser.add_argument("--max-boxes", type=int, default=400_000, help="of the proof (default: %(default)s)")
    parser.add_argument("--max-abs-sum", type=float, default=10.0, help="of the taps (default: %(default)s)")
    arguments = parser.parse_args()
    sets = random_sets(arguments.sets, arguments.seed)
    _print_figures([solve(modes, arguments.max_boxes, arguments.max_abs_sum) for modes in sets])


if __name__ == "__main__":
    main()
