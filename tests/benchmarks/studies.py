"""Studies: ten thousand drawn machines on the paper's path, and fifty of them one by one: docs/evidence/benchmarks.md.

Run from the root of the repository: ``python tests/benchmarks/studies.py``. The peer converts the program for every
draw, as one would without a study. The fifty are simulated by the interpreter, player and plant of the tests, which
share no code with the package.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from places import ROOT, TESTS
from table import markdown

import shapegcode as sg
from acceptance import under_modes
from judge import Mode
from shapegcode.demos.path import path_program
from shapegcode.studies.replay import DEFAULT_MEASURES, SHARE, Replay
from shapegcode.studies.study_file import load_study

_PERCENT = (5, 25, 50, 75, 95, 99)
_FIFTY = 50
_CONVERTED_ANEW = 50


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=10_000, help="of the study (default: %(default)s)")
    arguments = parser.parse_args()
    machine = sg.Machine.load("vx500")
    options = load_study(TESTS / "golden" / "study" / "STUDY.toml").options()
    rows = [
        ["peer: converted for each draw", *_converted_for_each(machine, options)],
        ["one text", *_timed(path_program(200, machine), machine, options, arguments.draws)],
        ["the same with Sobol indices", *_timed(path_program(200, machine), machine, options, arguments.draws, True)],
        ["with times that differ", *_timed(path_program(200, machine), machine, _with_times(options), arguments.draws)],
        [
            "one text, the test piece of ISO 10791-7",
            *_timed(sg.Program.read(_part(), machine), machine, options, 200),
        ],
        [
            "residual vibration alone, the same piece",
            *_timed(sg.Program.read(_part(), machine), machine, {**options, "measure": ["residual_um"]}, 2000),
        ],
    ]
    print(markdown(["study", "draws", "s", "ms per draw", "conversions"], rows))
    print(markdown(["50 draws", *(f"{share} %" for share in _PERCENT)], _fifty(machine, options)))
    return 0


def _part() -> Path:
    return ROOT / "python" / "shapegcode" / "data" / "iso10791_7.nc"


def _with_times(options: dict[str, object]) -> dict[str, object]:
    vary = {**options["vary"], "controller.rapid_time_constant_s": sg.uniform(0.1, 0.2)}  # type: ignore[dict-item]
    return {**options, "vary": vary}


def _timed(
    program: sg.Program, machine: sg.Machine, options: dict[str, object], n: int, indices: bool = False
) -> list[str]:
    begin = time.perf_counter()
    found = sg.study(program, machine, **{**options, "n": n, "indices": indices})  # type: ignore[arg-type]
    return _row(found.n, time.perf_counter() - begin, found.conversions)


def _converted_for_each(machine: sg.Machine, options: dict[str, object]) -> list[str]:
    program = path_program(200, machine)
    found = sg.study(program, machine, **{**options, "n": _CONVERTED_ANEW, "indices": False})  # type: ignore[arg-type]
    begin = time.perf_counter()
    for draw in range(found.n):
        replay = Replay.of(program, machine)
        replay.simulate(
            machine.with_values({each.key: float(found.draws[each.key][draw]) for each in found.varied}),
            (*DEFAULT_MEASURES, SHARE),
        )
    return _row(found.n, time.perf_counter() - begin, found.n)


def _row(draws: int, wall_s: float, conversions: int) -> list[str]:
    return [str(draws), f"{wall_s:.1f}", f"{1e3 * wall_s / draws:.2f}", str(conversions)]


def _fifty(machine: sg.Machine, options: dict[str, object]) -> list[list[str]]:
    program = path_program(200, machine)
    found = sg.study(program, machine, **{**options, "n": _FIFTY, "indices": False})  # type: ignore[arg-type]
    conversion = sg.convert(program, machine)
    columns = [
        found.draws[f"axes.{axis}.modes.1.{name}"] for axis in "xy" for name in ("frequency_hz", "damping_ratio")
    ]
    machines = [[[Mode(*draw[:2])], [Mode(*draw[2:])], []] for draw in zip(*columns, strict=True)]
    brute = under_modes(conversion, program, machine.controller.interpolation_period_s, machines)
    rows = []
    for name, values in zip(("residual_um", "contour_um"), brute, strict=True):
        ours, theirs = np.percentile(found.draws[name], _PERCENT), np.percentile(values, _PERCENT)
        rows.append([f"{name}, study", *(f"{each:.3f}" for each in ours)])
        rows.append([f"{name}, one by one", *(f"{each:.3f}" for each in theirs)])
        rows.append(["difference, %", *(f"{100 * (a / b - 1):.2f}" for a, b in zip(ours, theirs, strict=True))])
    return rows


if __name__ == "__main__":
    sys.exit(main())
