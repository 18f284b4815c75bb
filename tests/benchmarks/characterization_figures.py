"""The figures of docs/howto/characterize.md: `python tests/benchmarks/characterization_figures.py` prints them."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import places  # noqa: F401

import shapegcode as sg
from judge.characterization import Deviation, controllers, fill_in_logs, fill_in_times, truth_of

SEEDS = range(24)


def deviations(
    seeds: Sequence[int], *, log: bool, jitter_s: float = 0.0, hold: bool = True
) -> tuple[list[Deviation], list[str]]:
    """Every number that was fitted beside its truth, and every word that is wrong."""
    machine = sg.Machine.load("vx500")
    found: list[Deviation] = []
    wrong: list[str] = []
    with tempfile.TemporaryDirectory() as scratch:
        master = Path(scratch) / "tests"
        sg.write_characterization_tests(master, machine)
        for seed, hidden, rng in controllers(seeds):
            folder = Path(scratch) / f"{seed}"
            shutil.copytree(master, folder)
            if log:
                fill_in_logs(folder, hidden, rng, hold=hold)
            else:
                fill_in_times(folder, hidden, rng, jitter_s=jitter_s)
            result = sg.characterize(folder, machine)
            wrong += [f"seed {seed}: {each}" for each in result.warnings]
            truth = truth_of(hidden)
            for each in result.findings:
                real = truth.get(each.quantity)
                if isinstance(real, str):
                    if each.value is not None and real not in str(each.value):
                        wrong.append(f"seed {seed}: {each.quantity} {each.value}, truth {real}")
                elif real is not None:
                    value = each.value if isinstance(each.value, float) else None
                    found.append(Deviation(seed, each.quantity, real, value, each.low, each.high))
            shutil.rmtree(folder)
    return found, wrong


def main() -> None:
    for title, keywords in (
        ("log", {"log": True}),
        ("log, interpolated between periods", {"log": True, "hold": False}),
        ("stopwatch", {"log": False}),
        ("stopwatch, jitter 0.1 s", {"log": False, "jitter_s": 0.1}),
    ):
        found, wrong = deviations(SEEDS, **keywords)  # type: ignore[arg-type]
        print(f"\n{title}: {len(SEEDS)} controllers; wrong words or contradictions: {wrong or 'none'}")
        for quantity in dict.fromkeys(each.quantity for each in found):
            mine = [each for each in found if each.quantity == quantity]
            known = [each for each in mine if each.value is not None]
            real = [each for each in known if each.truth > 0.0]
            worst = f"{max(each.relative for each in real) * 100:7.2f} %" if real else "      -  "
            most = max((abs((each.value or 0.0) - each.truth) for each in known), default=0.0)
            covered = sum(each.covered for each in known)
            print(
                f"  {quantity:34} known {len(known):2} of {len(mine):2}  worst {worst} ({most:.5f})  covered {covered}"
            )


if __name__ == "__main__":
    main()
