"""Identification of hard simulated impact tests: modes found, false ones, coverage of intervals, CPU time.

Run from the root of the repository: ``python tests/benchmarks/many_modes.py --draws 200`` (``tests/oracles/
hard_records.py`` says what is drawn). Counted as to be found: modes within what the hits excite (-20 dB) whose
Cramér-Rao bounds are below 1 % in frequency and 20 % in damping. Found: supported, within half of the damping ratio in
frequency and a factor of two in damping. Coverage: of those to be found. ``--pyema``: sdypy-EMA (``pip install
sdypy-EMA``) on the same records.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, field

import numpy as np
import places  # noqa: F401
from table import markdown

from hard_records import RATE_HZ, HardRecord, hard_record, is_meant, to_find
from shapegcode.identification.identify import identify
from shapegcode.identification.result import IdentifiedMode


@dataclass
class Tally:
    """What the draws came to."""

    wanted: int = 0
    found: int = 0
    supported: int = 0
    false: int = 0
    used: int = 0
    covered: list[tuple[bool, bool]] = field(default_factory=list)
    errors: list[tuple[float, float]] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    def add(self, hard: HardRecord, excited_hz: float, modes: list[tuple[float, float, IdentifiedMode | None]]) -> None:
        """Count one draw; modes as frequency, damping ratio and estimate, if there is one."""
        left = list(modes)
        self.supported += len(modes)
        told = to_find(hard, excited_hz)
        self.wanted += len(told)
        for mode in hard.modes:
            near = [each for each in left if is_meant(mode, *each[:2])]
            if not near:
                continue
            best = min(near, key=lambda each: abs(each[0] - mode.frequency_hz))
            left.remove(best)
            self.found += mode in told
            self.errors.append((abs(best[0] / mode.frequency_hz - 1.0), abs(best[1] / mode.damping_ratio - 1.0)))
            if best[2] is not None and mode in told:
                pairs = ((best[2].frequency_hz, mode.frequency_hz), (best[2].damping_ratio, mode.damping_ratio))
                hertz, zeta = (estimate.low <= truth <= estimate.high for estimate, truth in pairs)
                self.covered.append((hertz, zeta))
        self.false += len(left)

    def row(self, name: str, draws: int) -> list[str]:
        """As a row of the table."""
        errors = 100.0 * np.median(self.errors, axis=0)
        covered = 100.0 * np.mean(self.covered, axis=0) if self.covered else np.full(2, np.nan)
        return [
            name, f"{self.wanted}", f"{self.found} ({100.0 * self.found / self.wanted:.1f} %)",
            f"{self.false} of {self.supported} ({100.0 * self.false / self.supported:.2f} %)",
            f"{errors[0]:.4f} / {errors[1]:.2f} %", f"{covered[0]:.1f} / {covered[1]:.1f} %", f"{self.used} of {draws}",
            f"{np.median(self.seconds):.1f} s", f"{max(self.seconds):.1f} s",
        ]  # fmt: skip


HEAD = [
    "", "modes to find", "found", "false", "median error f / zeta", "95 % intervals cover f / zeta", "use", "CPU time",
    "longest",
]  # fmt: skip


def ours(hard: HardRecord, tally: Tally) -> float:
    """Count what `identify` finds; up to where the hits excite."""
    start = time.process_time()
    result = identify(list(hard.records), strict=False)
    tally.seconds.append(time.process_time() - start)
    tally.used += not result.doubt and bool(result.modes)
    excited = max((each.excited_hz or 0.0 for each in result.prepared.usable), default=0.0) if result.prepared else 0.0
    tally.add(hard, excited, [(m.frequency_hz.value, m.damping_ratio.value, m) for m in result.modes])
    return excited


def theirs(hard: HardRecord, excited_hz: float, tally: Tally) -> None:
    """Count what sdypy-EMA's poles give that are stable in frequency and damping over most orders."""
    from sdypy import EMA

    used = [record for record, double in zip(hard.records, hard.double, strict=True) if not double]
    start = time.process_time()
    force, response = (np.fft.rfft([getattr(each, name) for each in used]) for name in ("force_n", "response"))
    ratio = np.sum(np.conj(force) * response, axis=0) / np.sum(np.abs(force) ** 2, axis=0)
    frequency = np.fft.rfftfreq(len(used[0].response), 1.0 / RATE_HZ)
    kept = frequency < 1.3 * excited_hz
    model = EMA.Model(
        ratio[None, kept], frequency[kept], lower=20, upper=excited_hz, pol_order_high=60, frf_form="accelerance"
    )
    model.get_poles(show_progress=False)
    found = stable_poles(model)
    tally.seconds.append(time.process_time() - start)
    tally.used += 1
    tally.add(hard, excited_hz, [(hertz, zeta, None) for hertz, zeta in found])


def stable_poles(model: object) -> list[tuple[float, float]]:
    """Poles that the last ten orders have within 1 % of the frequency and 5 % of the damping ratio."""
    orders = list(zip(model.pole_freq, model.pole_xi, strict=True))  # type: ignore[attr-defined]
    found: list[tuple[float, float]] = []
    for hertz, zeta in zip(*orders[-1], strict=True):
        if not (hertz > 0.0 and 0.0 < zeta < 0.3):
            continue
        seen = sum(
            bool(np.any((np.abs(f / hertz - 1.0) < 0.01) & (np.abs(z / zeta - 1.0) < 0.05))) for f, z in orders[-11:-1]
        )
        if seen >= 8 and not any(abs(f / hertz - 1.0) < 0.002 for f, _ in found):
            found.append((float(hertz), float(zeta)))
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--delay-us", type=float, default=0.0, help="of the response behind the force")
    parser.add_argument("--tangent", type=float, default=0.0, help="standard deviation of the phases of complex modes")
    parser.add_argument("--pyema", action="store_true")
    args = parser.parse_args()
    mine, peer = Tally(), Tally()
    for seed in range(args.first, args.first + args.draws):
        hard = hard_record(seed, 1e-6 * args.delay_us, args.tangent)
        excited = ours(hard, mine)
        if args.pyema:
            theirs(hard, excited, peer)
    rows = [mine.row("shapegcode", args.draws)]
    if args.pyema:
        rows.append(peer.row("sdypy-EMA, poles stable over 8 of 10 orders", args.draws))
    print(markdown(HEAD, rows))


if __name__ == "__main__":
    main()
