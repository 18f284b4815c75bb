"""Both planners of a cut beside one another: the tables of docs/evidence/converter_planner.md.

    python tests/benchmarks/planner_figures.py [--jerk MM_S3 ...] [--longest S] [PROGRAM ...]

Every program is converted with `shaping.planner` "look-ahead" and "optimal", both for the machine's tolerance, and with
"optimal" once more for the contour error that "look-ahead" reached, so that times stand beside equal contours. All cuts
are shaped at any price. The emitted texts are verified and simulated by the tests' own interpreter, player and plant.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import dataclass
from typing import Any
from unittest import mock

import numpy as np
import places  # noqa: F401
from contour_figures import arcs_and_corners

import shapegcode as sg
from acceptance import SAMPLE_KEYS, SAMPLES, Judged, convert, machine_with, read_sample
from judge import play

TICKS = 5  # of a block
TICK_S = 1e-3
PLAYED_S = 100.0  # of a cut, from which its acceleration and jerk are taken at most
MIN_UM = 1.0  # no tolerance below is asked for
HEADS = (
    "program", "original s", "look-ahead s", "optimal s", "same tolerance", "same contour", "contour µm",
    "residual µm", "blocks", "acceleration", "jerk", "conversion s",
)  # fmt: skip


@dataclass(frozen=True)
class Figures:
    """What a planner made of a program."""

    original_s: float
    time_s: float
    contour_um: float
    residual_um: float
    blocks: int
    acceleration: float  # largest of an axis from block to block, as a share of its limit
    jerk: float  # likewise
    conversion_s: float


def sine(feed: float, chord_mm: float) -> str:
    """Chords along a curve whose radius goes down to 4 mm."""
    lines = ["%", "O1", "G21G17G90G94G40G64G00X0Y0Z0"]
    word = f"F{feed:.0f}."
    for k in range(1, int(120.0 / chord_mm)):
        x = k * chord_mm
        lines.append(f"G01X{x:.3f}Y{10.0 * math.sin(x / 6.0) * math.sin(x / 37.0):.3f}{word}")
        word = ""
    return "\n".join([*lines, "M30", "%", ""])


def rows_of_a_pocket(feed: float) -> str:
    """Rows of 40 mm, 3 mm apart, corners of 90 degrees."""
    lines = ["%", "O1", "G21G17G90G94G40G64G00X0Y0Z0"]
    word = f"F{feed:.0f}."
    for k in range(12):
        lines += [f"G01X{40 * ((k + 1) % 2)}.Y{3 * k}.{word}", f"Y{3 * k + 3}."]
        word = ""
    return "\n".join([*lines, "M30", "%", ""])


def texts(names: list[str]) -> list[tuple[str, str, dict[str, Any]]]:
    """Name, text and settings of the programs: those of the tests, and generated ones at high feeds."""
    found = [(name, read_sample(name), SAMPLE_KEYS.get(name, {})) for name in sorted(SAMPLES)]
    for feed in (3000.0, 9000.0):
        found += [
            (f"arcs and corners, F{feed:.0f}", arcs_and_corners(feed), {}),
            (f"pocket, F{feed:.0f}", rows_of_a_pocket(feed), {}),
            (f"chords of 2 mm, F{feed:.0f}", sine(feed, 2.0), {}),
            (f"chords of .4 mm, F{feed:.0f}", sine(feed, 0.4), {}),
        ]
    return [each for each in found if not names or each[0] in names]


def differences(judged: Judged, jerk_mm_s3: float) -> tuple[float, float]:
    """Largest second and third differences of the simulated set-points over the limits, block by block."""
    block_s = TICKS * TICK_S
    acceleration = jerk = math.nan  # of cuts that are too long to be simulated
    for _, blocks, entry in judged.regions():
        if entry["time_s"]["emitted"] > PLAYED_S:
            continue
        points = play([move for move in blocks if move.length > 0.0], period_s=TICK_S, block_end="ceil")
        grid = np.pad(points[::TICKS], ((3, 3), (0, 0)), mode="edge")
        acceleration = np.fmax(acceleration, np.abs(np.diff(grid, 2, axis=0)).max() / block_s**2)
        jerk = np.fmax(jerk, np.abs(np.diff(grid, 3, axis=0)).max() / block_s**3)
    limits = [axis.max_acceleration_mm_s2 for axis in judged.machine.axes.as_tuple()]
    return float(acceleration) / min(limits), float(jerk) / jerk_mm_s3


def converted(text: str, machine: sg.Machine, jerk_mm_s3: float) -> Figures:
    """One conversion; whatever the independent judge complains of ends the run."""
    took_s = 0.0
    plain = sg.convert

    def timed(*args: Any, **options: Any) -> sg.Conversion:
        nonlocal took_s
        began = time.process_time()
        result = plain(*args, **options)
        took_s = time.process_time() - began
        return result

    with mock.patch.object(sg, "convert", timed):
        judged = convert(text, machine, block_period_s=TICKS * TICK_S, tolerance_curve=False)
    found = judged.conversion
    return Figures(
        found.cycle_time_s.original, found.cycle_time_s.emitted, found.contour_error_um.response.emitted.max,
        max(found.residual_vibration_um.emitted), found.blocks.emitted, *differences(judged, jerk_mm_s3), took_s,
    )  # fmt: skip


def row(name: str, text: str, machine: sg.Machine, jerk_mm_s3: float) -> tuple[str, ...]:
    """A program as a row of the table."""
    before, now = (
        converted(text, machine.with_values({"shaping.planner": planner}), jerk_mm_s3)
        for planner in ("look-ahead", "optimal")
    )
    equal_um = max(MIN_UM, before.contour_um)
    equal = converted(
        text, machine.with_values({"shaping.planner": "optimal", "tolerance.contour_um": equal_um}), jerk_mm_s3
    )

    def percent(figures: Figures) -> str:
        return f"{(figures.time_s / before.time_s - 1.0) * 100.0:+.2f} %"

    def pair(figure: str, digits: int) -> str:
        pair = getattr(before, figure), getattr(now, figure)
        return " → ".join("–" if math.isnan(value) else f"{value:.{digits}f}" for value in pair)

    return (
        name, f"{now.original_s:.2f}", f"{before.time_s:.2f}", f"{now.time_s:.2f}", percent(now), percent(equal),
        pair("contour_um", 1), pair("residual_um", 2), pair("blocks", 0), pair("acceleration", 2), pair("jerk", 2),
        pair("conversion_s", 1),
    )  # fmt: skip


def main() -> None:
    """A table for each jerk."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("programs", nargs="*", help="names of programs (default: all)")
    parser.add_argument("--jerk", type=float, nargs="+", default=[20_000.0, 100_000.0, 500_000.0], metavar="MM_S3")
    parser.add_argument("--law", default="constant_time", choices=["constant_time", "jerk_limited"])
    parser.add_argument("--longest", type=float, default=math.inf, metavar="S", help="no longer programs")
    args = parser.parse_args()
    for jerk_mm_s3 in args.jerk:
        keys = {f"axes.{axis}.max_jerk_mm_s3": jerk_mm_s3 for axis in "xyz"} | {"controller.law": args.law}
        print(f"\nJerk {jerk_mm_s3:g} mm/s³, {args.law}\n\n| {' | '.join(HEADS)} |\n|---|{'--:|' * (len(HEADS) - 1)}")
        for name, text, settings in texts(args.programs):
            machine = machine_with({**keys, **settings, "controller.block_time_s": TICKS * TICK_S})
            program = sg.Program.from_text(text.encode("latin-1"), machine)
            if program.regions and sum(each.path.programmed_time_s for each in program.regions) <= args.longest:
                print("| " + " | ".join(row(name, text, machine, jerk_mm_s3)) + " |", flush=True)


if __name__ == "__main__":
    main()
