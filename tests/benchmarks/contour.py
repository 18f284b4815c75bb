"""Contour-preserving shaping beside SciPy's banded solver: `python tests/benchmarks/contour.py`.

Both solve the same normal equations on one core: one window of a correction, samples × axis per second. SciPy's solver
gets the banded matrix ready made and factors it in every call (that is its interface); ours keeps its factor. A second
table gives whole regions: planning, feed search, correction and shaping.
"""

from __future__ import annotations

import argparse
import math
import sys
from typing import Any

import numpy as np
import numpy.typing as npt
import places  # noqa: F401
from contour_figures import arcs_and_corners
from scipy.linalg import solveh_banded
from table import Row, Sample, comparison_table, markdown, timed

import shapegcode as sg
from acceptance import machine_with
from shapegcode import _core
from shapegcode.conversion.write import RegionWriter
from shapegcode.model.machine_model import MachineModel
from shapegcode.shaping.grid import Grid, choose_grid

Vector = npt.NDArray[np.float64]

_MEGA = 1e6
_GOAL = 5.0  # million samples x axis per second
_SMOOTHNESS = _core.ShapingOptions().contour_smoothness
_TARGETS = {"command": _core.ContourTarget.command, "response": _core.ContourTarget.response}


def _grid(period_s: float) -> tuple[sg.Machine, Grid]:
    # Interpolation well below the block period, so that blocks of 1 ms have a middle.
    machine = machine_with({"controller.block_time_s": period_s})
    return machine, choose_grid(machine, period_s)


def _kernel(period_s: float, target: str) -> list[float]:
    machine, grid = _grid(period_s)
    half = _core.Fir([2 * delay for delay in grid.fir.delays], list(grid.fir.taps))
    modes = [_core.Mode(mode.frequency_hz, mode.damping_ratio) for mode in machine.axes.x.modes]
    return list(_core.contour_kernel(half, modes, 0.5 * period_s, _TARGETS[target]))


def _banded(kernel: Vector, rows: int) -> Vector:
    """Normal matrix in SciPy's lower form."""
    band = max(len(kernel) - 1, 2)
    column = np.zeros(band + 1)
    column[: len(kernel)] = [kernel[: len(kernel) - j] @ kernel[j:] for j in range(len(kernel))]
    column[:3] += _SMOOTHNESS * np.array([6.0, -4.0, 1.0])
    return np.ascontiguousarray(np.repeat(column[:, None], rows, axis=1))


def _solver_row(period_s: float, target: str, samples: int, repetitions: int) -> Row:
    taps = _kernel(period_s, target)
    kernel = np.array(taps)
    reach = len(kernel) - 1
    error = np.cumsum(np.random.default_rng(1).normal(size=samples + reach)) * 1e-4
    carried = np.zeros(reach + 2)
    solver = _core.ContourSolver(taps, _SMOOTHNESS)
    banded = _banded(kernel, samples)

    def ours() -> Vector:
        return np.asarray(solver.solve(error, carried))

    def theirs() -> Vector:
        right = -np.convolve(error, kernel[::-1])[reach : reach + samples]
        return np.asarray(solveh_banded(banded, right, lower=True, check_finite=False))

    np.testing.assert_allclose(ours(), theirs(), atol=1e-9 * float(np.abs(error).max() + 1.0))
    rates: tuple[list[float], list[float]] = ([], [])
    for _ in range(repetitions):
        for rate, task in zip(rates, (ours, theirs), strict=True):
            rate.append(samples / timed(task)[0] / _MEGA)
    what = f"ContourSolver, {period_s * 1e3:g} ms blocks, {target}, {len(kernel)} taps"
    return Row(
        f"contour_{period_s * 1e3:g}_{target}", what, "M samples × axis/s", Sample.of(rates[0]),
        "scipy.linalg.solveh_banded", Sample.of(rates[1]), at_least=1.0,
    )  # fmt: skip


def _region_rows(repetitions: int) -> list[list[str]]:
    rows = []
    for period_s in (0.005, 0.001):
        for target in ("off", "command", "response"):
            machine = machine_with({"controller.block_time_s": period_s, "shaping.contour": target})
            grid = choose_grid(machine, period_s)
            path = sg.Program.from_text(arcs_and_corners().encode(), machine, source="path").regions[0].path
            model = MachineModel(machine)
            writer = RegionWriter(model, grid)
            options = writer.options(model.limits(), writer.tolerance(machine.tolerance.contour_um))

            def shape(path: Any = path, grid: Grid = grid, options: Any = options) -> int:
                piece = _core.RegionShaper(path, grid.fir, [], options).next(10**7)
                assert piece is not None
                return len(piece.middle_mm)

            found = [timed(shape) for _ in range(repetitions)]
            times = Sample.of([seconds * 1e3 for seconds, _ in found])
            periods = found[0][1]
            per_second = Sample.of([2 * 2 * periods / seconds / _MEGA for seconds, _ in found])
            rows.append([
                f"{period_s * 1e3:g} ms", target, f"{periods * period_s:.2f} s", f"{times} ms",
                f"{periods * period_s / times.median * 1e3:.0f}", str(per_second),
            ])  # fmt: skip
    return rows


def main() -> int:
    """Print the tables; 0 if every solver reaches its goal."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--samples", type=int, default=200_000, help="of a window (default: %(default)s)")
    parser.add_argument("--repetitions", type=int, default=11, help="default: %(default)s")
    arguments = parser.parse_args()
    rows = [
        _solver_row(period_s, target, arguments.samples, arguments.repetitions)
        for period_s in (0.005, 0.001)
        for target in ("command", "response")
    ]
    print(comparison_table(rows), end="\n\n")
    print(markdown(
        ["blocks", "target", "motion", "RegionShaper", "times real time", "M samples × axis/s (X and Y, half periods)"],
        _region_rows(arguments.repetitions),
    ))  # fmt: skip
    slowest = min(row.ours.median for row in rows)
    print(f"\nslowest solver: {slowest:.2f} M samples × axis/s, goal {_GOAL:g}")
    return int(math.isfinite(_GOAL) and slowest < _GOAL)


if __name__ == "__main__":
    sys.exit(main())
