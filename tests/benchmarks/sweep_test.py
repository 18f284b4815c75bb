"""Modes of simulated machines from a record beside a known command: found, errors, false ones, CPU time.

Run from the root of the repository: ``python tests/benchmarks/sweep_test.py --draws 60``. Axis, drive and logger are
those of ``tests/oracles/shaken_axis.py`` (NumPy alone): one to four modes between 14 and 75 Hz of 1 to 6 % damping, a
drive of 40 to 120 Hz bandwidth, in the second row the lag of a position loop (20 to 60 1/s), in the third a control
that builds up the feed in 0 to 100 ms (50 in the machine file) and goes on up to 100 ms later behind each pause; of all
this the identification is not told. A logger of 12 bits, ± 4 g, 800 samples per second, whose clock is 1 % off and
which begins .5 to 15 s earlier.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import places  # noqa: F401
from table import markdown

from shaken_axis import Logger, logged, ran, random_modes, shaken
from shapegcode.identification.identify import identify
from shapegcode.identification.known_command import KnownCommand, known_command
from shapegcode.identification.sweep_program import write_sweep
from shapegcode.io.record import Record
from shapegcode.machine import Machine

Draw = dict[str, Any]


def main() -> None:
    """Draw, identify, count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=60)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--first", type=int, default=0)
    args = parser.parse_args()
    machine = Machine.load("vx500")
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "SWEEP.NC"
        write_sweep(program, machine, "x", seconds=args.seconds)
        command = known_command(program, machine)
        rows = [
            _row(name, _draws(args, program, machine, command, lag=lag, other=other))
            for name, lag, other in (
                ("none", False, False),
                ("lag of the position loop", True, False),
                ("ramps and waits", False, True),
            )
        ]
    head = ["not told", "modes", "within .5 % and 10 %", "accepted, but farther off",
            "refused or missed", "false ones", "95 % intervals cover f / ζ", "machines with all modes",
            "median error f / ζ, %", "CPU time, median and longest, s"]  # fmt: skip
    print(markdown(head, rows))


def _draws(
    args: argparse.Namespace, program: Path, machine: Machine, command: KnownCommand, *, lag: bool, other: bool
) -> list[Draw]:
    """What each draw came to."""
    found = []
    for seed in range(args.first, args.first + args.draws):
        generator = np.random.default_rng([seed, int(lag) + 2 * int(other)])
        modes = random_modes(generator)
        gain = float(generator.uniform(20.0, 60.0)) if lag else None
        position, period_s = command.position * 1e3, command.period_s
        if other:
            period_s = 5e-4
            position = ran(program.read_text(), period_s, generator.uniform(0.0, 0.1), generator.uniform(0.0, 0.1))
        moved = shaken(
            position,
            period_s,
            modes,
            bandwidth_hz=generator.uniform(40.0, 120.0),
            gain_per_s=gain,
        )
        logger = Logger(clock=1.0 + generator.choice([-0.01, 0.01]), begins_s=-generator.uniform(0.5, 15.0))
        times, values = logged(*moved, logger, seed)
        begin = time.process_time()
        result = identify([Record("r", times[1] - times[0], values)], sweep=program, machine=machine, strict=False)
        draw: Draw = {"seconds": time.process_time() - begin, "errors": [], "covered": [], "modes": len(modes)}
        left = list(result.modes)
        for mode in modes:
            near = [each for each in left if abs(each.frequency_hz.value / mode.frequency_hz - 1.0) < 0.05]
            if not near:
                continue
            best = min(near, key=lambda each: abs(each.frequency_hz.value - mode.frequency_hz))
            left.remove(best)
            pairs = (best.frequency_hz, mode.frequency_hz), (best.damping_ratio, mode.damping_ratio)
            draw["errors"].append([abs(estimate.value / truth - 1.0) for estimate, truth in pairs])
            draw["covered"].append([estimate.low <= truth <= estimate.high for estimate, truth in pairs])
        draw["false"] = len(left)
        found.append(draw)
        if draw["false"] or len(draw["errors"]) < len(modes):
            print(f"draw {seed}, lag {lag}, other ramps {other}: {modes}\n  {result.answer}", file=sys.stderr)
    return found


def _row(name: str, draws: list[Draw]) -> list[str]:
    errors = np.array([each for draw in draws for each in draw["errors"]]).reshape(-1, 2)
    covered = np.array([each for draw in draws for each in draw["covered"]]).reshape(-1, 2)
    good = (errors[:, 0] < 0.005) & (errors[:, 1] < 0.1)
    modes = sum(draw["modes"] for draw in draws)
    whole = sum(
        len(draw["errors"]) == draw["modes"] and all(f < 0.005 and z < 0.1 for f, z in draw["errors"]) for draw in draws
    )
    seconds = [draw["seconds"] for draw in draws]
    return [
        name, str(modes), f"{good.sum()}", f"{len(good) - good.sum()}", f"{modes - len(good)}",
        f"{sum(draw['false'] for draw in draws)}", " / ".join(f"{100 * each:.0f} %" for each in covered.mean(axis=0)),
        f"{whole} of {len(draws)}", " / ".join(f"{100 * each:.3f}" for each in np.median(errors, axis=0)),
        f"{np.median(seconds):.1f}, {max(seconds):.1f}",
    ]  # fmt: skip


if __name__ == "__main__":
    main()
