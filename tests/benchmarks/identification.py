"""Identification of random structures whose truth is known: errors, coverage of intervals, honesty of refusals.

Run from the root of the repository: ``python tests/benchmarks/identification.py``. Each draw is one tap of 2 s on 1 to
4 modes (20 to 400 Hz, at least 10 % apart, damping .5 to 5 %, stiffnesses within a decade), simulated by SciPy on a
grid 32 times finer, with white noise on response and force. The last rows are of the same structures, one second at
51.2 kHz with pulses of .8 to 5 ms, all of it and a band of 20 to 450 Hz: what thinning out costs and gains.
``--responses``: the same structures as frequency responses without time record, in closed form.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, field

import numpy as np
import places  # noqa: F401
from table import markdown

from hard_records import accelerance
from shapegcode.identification.identify import identify
from shapegcode.identification.result import Estimate, IdentifiedMode
from shapegcode.io.record import FrequencyResponse, Quantity
from tap_truth import TrueMode, random_modes, tap

NAMES = ("frequency_hz", "damping_ratio", "stiffness_n_per_m")
WRONG = 0.10  # a mode is wrong if any of its figures is off by more
SAME = 0.05  # a found mode this near in frequency is meant to be the true one


@dataclass
class Tally:
    """What the draws of one noise level came to."""

    modes: int = 0
    missed: int = 0
    spurious: int = 0
    accepted: int = 0
    wrong: int = 0
    refused_of_wrong: int = 0
    errors: list[list[float]] = field(default_factory=list)
    covered: list[list[bool]] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    def add(self, truth: list[TrueMode], found: list[tuple[IdentifiedMode, bool]]) -> None:
        """Count one draw; `found` with a flag: accepted."""
        self.modes += len(truth)
        left = list(found)
        for mode in truth:
            near = [pair for pair in left if abs(pair[0].frequency_hz.value / mode.frequency_hz - 1) < SAME]
            if not near:
                self.missed += 1
                continue
            best = min(near, key=lambda pair: abs(pair[0].frequency_hz.value - mode.frequency_hz))
            left.remove(best)
            self._compare(mode, *best)
        self.spurious += sum(accepted for _, accepted in left)

    def _compare(self, mode: TrueMode, found: IdentifiedMode, accepted: bool) -> None:
        estimates = [getattr(found, name) for name in NAMES]
        true = [getattr(mode, name) for name in NAMES]
        # A refused mode may have no mass at all: it cannot be right.
        errors = [
            abs(estimate.value / value - 1) if isinstance(estimate, Estimate) else np.inf
            for estimate, value in zip(estimates, true, strict=True)
        ]
        wrong = max(errors) > WRONG
        self.wrong += wrong
        self.refused_of_wrong += wrong and not accepted
        if accepted:
            self.accepted += 1
            self.errors.append(errors)
            self.covered.append(
                [estimate.low <= value <= estimate.high for estimate, value in zip(estimates, true, strict=True)]
            )


HEAD = [
    "noise",
    *(f"median error {name}" for name in ("f", "zeta", "k")),
    *(f"covered {name}" for name in ("f", "zeta", "k")),
    "modes",
    "accepted",
    "missed",
    "spurious",
    "wrong by over 10 %: refused",
    "CPU time of a draw",
    "longest",
]
FAST_HZ = 51200.0
FAST_BAND_HZ = (20.0, 450.0)


def response(truth: list[TrueMode], rng: np.random.Generator, quantity: Quantity, *, uneven: bool) -> FrequencyResponse:
    """1199 lines to 600 Hz, or 900 uneven ones, with white noise of an accelerometer, 3 % of the median accelerance."""
    hertz = np.sort(np.exp(rng.uniform(np.log(5.0), np.log(700.0), 900))) if uneven else np.arange(1, 1200) * 0.5
    power = {"displacement": 0, "velocity": 1, "acceleration": 2}[quantity]
    clean = accelerance(tuple(truth), None, 2j * np.pi * hertz)
    level = 0.03 * np.median(np.abs(clean)) / np.sqrt(2.0)
    noisy = clean + level * (rng.standard_normal(len(hertz)) + 1j * rng.standard_normal(len(hertz)))
    return FrequencyResponse("closed form", hertz, noisy * (2j * np.pi * hertz) ** (power - 2), quantity)


def responses(draws: int, seed: int) -> list[list[str]]:
    """Rows of the table of frequency responses."""
    rows = []
    kinds: tuple[tuple[str, Quantity, bool], ...] = (
        ("accelerance", "acceleration", False),
        ("mobility", "velocity", False),
        ("receptance", "displacement", False),
        ("accelerance, uneven", "acceleration", True),
    )
    for name, quantity, uneven in kinds:
        rng, tally = np.random.default_rng(seed), Tally()
        for draw in range(draws):
            truth = random_modes(rng, 1 + draw % 4)
            measured = response(truth, rng, quantity, uneven=uneven)
            start = time.process_time()
            found = identify([measured], strict=False)
            tally.seconds.append(time.process_time() - start)
            tally.add(truth, [*((mode, True) for mode in found.modes), *((mode, False) for mode in found.refused)])
        rows.append(row_of(name, tally))
    return rows


def row_of(name: str, tally: Tally) -> list[str]:
    """The table's row of a tally."""
    return [
        name,
        *(f"{error:.4f} %" for error in 100 * np.median(tally.errors, axis=0)),
        *(f"{share:.1f} %" for share in 100 * np.mean(tally.covered, axis=0)),
        f"{tally.modes}",
        f"{tally.accepted}",
        f"{tally.missed}",
        f"{tally.spurious}",
        f"{tally.refused_of_wrong} of {tally.wrong}",
        f"{1e3 * np.median(tally.seconds):.0f} ms",
        f"{1e3 * max(tally.seconds):.0f} ms",
    ]


def study(
    draws: int, snr_db: float, seed: int, *, fast: bool = False, band_hz: tuple[float, float] | None = None
) -> Tally:
    """Identify `draws` random structures at a signal-to-noise ratio."""
    rng = np.random.default_rng(seed)
    tally = Tally()
    for draw in range(draws):
        truth = random_modes(rng, 1 + draw % 4)
        record = tap(truth, rng, snr_db=snr_db)
        if fast:
            pulse = int(rng.uniform(40, 250))
            record = tap(truth, rng, snr_db=snr_db, rate_hz=FAST_HZ, samples=int(FAST_HZ), pulse_samples=pulse)
        start = time.process_time()
        result = identify([record], band_hz=band_hz)
        tally.seconds.append(time.process_time() - start)
        tally.add(truth, [*((mode, True) for mode in result.modes), *((mode, False) for mode in result.refused)])
    return tally


def _scatter(tally: Tally) -> float:
    """By how much a share of 95 % may be off, in %: 3, of few modes three standard deviations."""
    return max(3.0, 300.0 * float(np.sqrt(0.95 * 0.05 / max(1, tally.accepted))))


def main() -> int:
    """Print the tables; 0 if the figures of the documentation hold."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--responses", action="store_true", help="frequency responses instead of taps")
    arguments = parser.parse_args()
    if arguments.responses:
        print(markdown(HEAD, responses(arguments.draws, arguments.seed)))
        return 0
    rows, good = [], True
    fast = {"fast": True}
    for name, snr_db, how in (
        ("40 dB", 40.0, {}),
        ("10 dB", 10.0, {}),
        ("40 dB, 51.2 kHz", 40.0, fast),
        ("40 dB, 51.2 kHz, band", 40.0, fast | {"band_hz": FAST_BAND_HZ}),
    ):
        tally = study(arguments.draws, snr_db, arguments.seed, **how)
        errors = 100 * np.median(tally.errors, axis=0)
        covered = 100 * np.mean(tally.covered, axis=0)
        honest = 100 * tally.refused_of_wrong / tally.wrong if tally.wrong else 100.0
        rows.append(row_of(name, tally))
        if snr_db == 40.0:
            good &= bool(np.all(errors <= (0.1, 2.0, 2.0)) and np.all(np.abs(covered - 95.0) <= _scatter(tally)))
        good &= honest >= 95.0
    print(markdown(HEAD, rows))
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
