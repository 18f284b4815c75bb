"""The figures of vibration-aware rounding: `python tests/benchmarks/rounding_figures.py` prints them."""

from __future__ import annotations

import math
import os
import random
from collections.abc import Sequence
from dataclasses import dataclass
from unittest import mock

import numpy as np
import numpy.typing as npt
import places  # noqa: F401

import shapegcode as sg
from acceptance import machine_with
from judge.interpreter import interpret
from judge.plant import residual_um
from judge.player import play
from shapegcode import _core
from shapegcode.conversion.convert import convert

MODES = ((46.0, 0.02), (131.0, 0.02), None)
#: Name, inch, least increment in mm.
UNITS = (("mm, 1 um", False, 1e-3), ("IS-C, 0.1 um", False, 1e-4), ("inch, 2.54 um", True, 2.54e-3))
PERIODS_S = (0.002, 0.005)
PATHS = 50


def path(seed: int, *, inch: bool = False) -> str:
    """A small 2.5-D contour: three to eight lines and tangent arcs, every other joint a corner."""
    draw = random.Random(seed)
    unit = 25.4 if inch else 1.0
    decimals = 4 if inch else 3
    feed = draw.choice([600.0, 1500.0, 3000.0, 6000.0])
    lines = ["%", "O1", "G20" if inch else "G21", "G17G90G94G40G64G00X0Y0Z0"]
    x = y = 0.0
    heading = draw.uniform(0.0, math.tau)

    def word(letter: str, mm: float) -> str:
        return f"{letter}{mm / unit:.{decimals}f}"

    f = f"F{feed / unit:.1f}"
    for _ in range(draw.randint(3, 8)):
        if draw.random() < 0.35:
            radius, sweep, sense = draw.uniform(2.0, 15.0), draw.uniform(0.4, 1.5), draw.choice([1, -1])
            x += sense * radius * (math.sin(heading + sense * sweep) - math.sin(heading))
            y -= sense * radius * (math.cos(heading + sense * sweep) - math.cos(heading))
            heading += sense * sweep
            lines.append(f"G0{3 if sense > 0 else 2}{word('X', x)}{word('Y', y)}{word('R', radius)}{f}")
        else:
            length = draw.uniform(2.0, 25.0)
            x += length * math.cos(heading)
            y += length * math.sin(heading)
            lines.append(f"G01{word('X', x)}{word('Y', y)}{f}")
        f = ""
        if draw.random() < 0.5:
            heading += draw.uniform(-2.0, 2.0)
    return "\n".join([*lines, "M30", "%", ""])


def machine(rounding: str, period_s: float, increment_mm: float = 1e-3) -> sg.Machine:
    """The VX500 with a rounding and a block period, at any price, and IS-C words if the increment is 0.1 µm."""
    return machine_with(
        {
            "emission.rounding": rounding, "emission.block_period_s": period_s, "controller.block_time_s": period_s,
            "controller.least_increment_mm": min(increment_mm, 1e-3),
        }
    )  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """One path written with one rounding."""

    # X and Y behind the last set-point, under the rule of block ends "ceil", by the judge
    residual_um: npt.NDArray[np.float64]
    carry_um: npt.NDArray[np.float64]  # the same under "carry"
    peak_um: tuple[float, float]  # X and Y of the whole motion, by the tool itself
    error_increments: float  # largest distance of a block's end from the exact command
    blocks: int  # shaped blocks
    size: int  # bytes of the text
    slowed: int  # blocks that the controller's look-ahead would slow


def convert_path(seed: int, rounding: str, period_s: float, *, inch: bool, increment_mm: float) -> Outcome:
    """Convert one path and play the text with the judge, which shares no code with the tool."""
    owner = machine(rounding, period_s, increment_mm)
    errors = [0.0]
    blocks = 0
    fit_blocks = _core.fit_blocks

    def measured(command: _core.ShapedCommand, breaks: Sequence[int], options: _core.FitOptions) -> _core.FittedBlocks:
        nonlocal blocks
        fitted = fit_blocks(command, breaks, options)
        blocks = len(fitted)
        # A block ends where its successor begins; the last one is on the nearest increment of the end.
        exact = command.grid_mm[fitted.first_periods[1:]] / options.increment_mm
        errors.append(float(np.abs(fitted.ends[:-1] - exact).max(initial=0.0)))
        return fitted

    program = sg.Program.from_text(path(seed, inch=inch).encode(), owner, source=f"path {seed}")
    # With one thread the last blocks that are fitted are those that are written.
    with mock.patch.object(_core, "fit_blocks", measured), mock.patch.dict(os.environ, {"SHAPEGCODE_THREADS": "1"}):
        result = convert(program, owner, shape_all=True)
    moves = [move for line in interpret(result.text.decode()).lines for move in line.moves if move.kind != "rapid"]
    residuals = [residual_um(play(moves, block_end=rule), MODES, 0.001)[:2] for rule in ("ceil", "carry")]
    peak = result.peak_vibration_um.emitted
    return Outcome(
        residuals[0], residuals[1], (peak.x, peak.y), max(errors), blocks, len(result.text),
        result.slowed_blocks,
    )  # fmt: skip


def outcomes(
    seeds: Sequence[int], period_s: float, *, inch: bool = False, increment_mm: float = 1e-3
) -> dict[str, list[Outcome]]:
    """Every path with both roundings."""
    return {
        rounding: [convert_path(seed, rounding, period_s, inch=inch, increment_mm=increment_mm) for seed in seeds]
        for rounding in ("nearest", "vibration")
    }


def _print_figures() -> None:
    print("| words | block period | rounding | residual X, median (largest) | residual Y | under carry X, Y | "
          "peak X, Y, median | largest error | blocks | bytes | slowed |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for name, inch, increment_mm in UNITS:
        for period_s in PERIODS_S:
            for rounding, rows in outcomes(range(PATHS), period_s, inch=inch, increment_mm=increment_mm).items():
                residual = np.array([row.residual_um for row in rows])
                carry = np.median([row.carry_um for row in rows], axis=0)
                peak = np.median([row.peak_um for row in rows], axis=0)
                middle, worst = np.median(residual, axis=0), residual.max(axis=0)
                print(
                    f"| {name} | {period_s * 1e3:g} ms | {rounding} "
                    f"| {middle[0]:.3f} ({worst[0]:.2f}) um | {middle[1]:.3f} ({worst[1]:.2f}) um "
                    f"| {carry[0]:.3f}, {carry[1]:.3f} um | {peak[0]:.1f}, {peak[1]:.1f} um "
                    f"| {max(row.error_increments for row in rows):.4f} increments "
                    f"| {sum(row.blocks for row in rows)} | {sum(row.size for row in rows)} "
                    f"| {sum(row.slowed for row in rows)} |"
                )


if __name__ == "__main__":
    _print_figures()
