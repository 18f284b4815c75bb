"""Linear programs that go on from one another, against SciPy's from the beginning."""

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog

from shapegcode import Mode
from shapegcode.io.units import FloatArray
from shapegcode.shaping.bands import ModeBand
from shapegcode.shaping.cutting_planes import LinearProgram, _Band


def by_scipy(cost: FloatArray, equal: FloatArray, below: FloatArray, above: FloatArray) -> float | None:
    found = linprog(cost, A_eq=equal, b_eq=np.eye(len(equal))[0], A_ub=below, b_ub=above, bounds=(0.0, 2.0))
    assert found.status in (0, 2)
    return float(found.fun) if found.status == 0 else None


@pytest.mark.parametrize("seed", range(12))
def test_each_program_of_a_row_has_the_optimum_of_one_from_the_beginning(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 40))
    # Taps that add up to 1, and conditions as those on a residual are.
    equal = np.vstack([np.ones(count), np.cos(np.outer(rng.uniform(0.1, 3.0, 2), np.arange(count)))])
    program = LinearProgram(np.zeros(count), np.full(count, 2.0), (equal, np.eye(3)[0]))
    below, above = np.zeros((0, count)), np.zeros(0)
    for _ in range(8):
        rows = np.cos(np.outer(rng.uniform(0.1, 3.0, 3), np.arange(count)) + rng.uniform(0.0, math.tau, (3, 1)))
        limits = rng.uniform(0.05, 0.8, 3)
        program.add_below(rows, limits)
        below, above = np.vstack([below, rows]), np.append(above, limits)
        cost = rng.uniform(-1.0, 1.0, count)
        program.set_cost(cost)
        found, expected = program.solve(), by_scipy(cost, equal, below, above)
        if expected is None:
            assert found is None
            return
        assert found is not None
        assert float(cost @ found) == pytest.approx(expected, abs=1e-8)
        assert np.all(below @ found <= above + 1e-8)


def test_a_bound_that_moves() -> None:
    program = LinearProgram(np.zeros(2), np.full(2, math.inf), (np.ones((1, 2)), np.ones(1)))
    program.set_cost(np.array([1.0, 2.0]))
    program.bound(0, 0.0, 0.25)
    assert program.solve() == pytest.approx([0.25, 0.75])
    program.bound(0, 0.0, 1.0)
    assert program.solve() == pytest.approx([1.0, 0.0])
    program.bound(1, 0.5, 0.5)
    program.bound(0, 0.0, 0.25)
    assert program.solve() is None


def test_the_solver_prints_nothing(tmp_path: Path) -> None:
    """HiGHS 1.16 greets on the standard output, where a command's answer or its JSON belongs."""
    program = ["shaper", "--mode", "46:0.02+-5%", "--block-period", "5ms", "--family", "robust", "--json", "-"]
    done = subprocess.run(
        [sys.executable, "-m", "shapegcode", *program], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert json.loads(done.stdout)


def test_no_maximum_of_the_residual_over_a_band_is_missed() -> None:
    """Beside a fine sweep: maxima between an end of the band and the frequency next to it are found too."""
    band = ModeBand(Mode(40.0, 0.02), 0.2)
    times_s = 0.001 * np.arange(41)
    swept = _Band(band, times_s)
    fine = np.linspace(swept.low, swept.high, 20_001)
    random = np.random.default_rng(5)
    for _ in range(100):
        taps = random.dirichlet(np.full(times_s.size, 0.2))
        most = float(np.abs(swept.residual(taps, fine)).max())
        found = float(np.abs(swept.peaks(taps)[1]).max())
        assert found == pytest.approx(most, rel=2e-4, abs=1e-6)
