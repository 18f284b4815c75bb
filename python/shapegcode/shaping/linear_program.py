"""Linear programs in a row that differ by little: further conditions, another cost. Each goes on from the last.

HiGHS does the work, through its own module: SciPy's `linprog` calls the same solver, but takes some ten times as long
to say so, and cannot go on from an earlier solution. Beside them least squares without negative unknowns.
"""

from __future__ import annotations

import math
import weakref

import highspy
import numpy as np
from numpy.typing import NDArray

from shapegcode._core import DesignError

FloatArray = NDArray[np.float64]

# Tolerance and presolve: now and then the solver gives up, or goes round in circles, at the first of them.
_WAYS = ((1e-10, False), (1e-9, True), (1e-9, False), (1e-8, True), (1e-7, True), (1e-7, False))
_MOST_PIVOTS = 20  # per unknown and condition; some 1 is usual
_MOST_ROUNDS = 3  # per unknown, of the least squares


class _Quiet(highspy.Highs):
    """HiGHS without its callbacks: nobody listens, they take as long as a small program, and 1.16 prints a notice."""

    def __init__(self) -> None:
        super(highspy.Highs, self).__init__()
        self.setOptionValue("output_flag", False)


_FREE: list[_Quiet] = []
"""Solvers whose program is no longer needed: a new one takes a third of the time of a small program."""


def _solver() -> _Quiet:
    try:
        return _FREE.pop()  # in one step: another thread may take the last one
    except IndexError:
        return _Quiet()


def _give_back(solver: _Quiet) -> None:
    solver.clearModel()
    _FREE.append(solver)


class LinearProgram:
    """Least ``cost @ x`` over x between two bounds, under linear conditions that may be added to.

    Args:
        lower: (n,) least value of each unknown.
        upper: (n,) largest value of each unknown; may be infinite.
        equal: matrix and right-hand side of the equations.
    """

    def __init__(self, lower: FloatArray, upper: FloatArray, equal: tuple[FloatArray, FloatArray]) -> None:
        self._columns = np.arange(len(lower), dtype=np.int32)
        self._solver = _solver()
        weakref.finalize(self, _give_back, self._solver).atexit = False
        self._set(threads=1, solver="simplex", presolve="off")
        nothing = np.zeros(0)
        no_index = np.zeros(0, dtype=np.int32)
        self._solver.addCols(len(lower), np.zeros(len(lower)), lower, upper, 0, no_index, no_index, nothing)
        self._rows = 0
        self._tolerance = 0.0
        self._add(equal[0], equal[1], equal[1])

    def add_below(self, matrix: FloatArray, above: FloatArray) -> None:
        """Add ``matrix @ x <= above``."""
        self._add(matrix, np.full(len(above), -math.inf), above)

    def set_cost(self, cost: FloatArray) -> None:
        """Take another cost."""
        self._solver.changeColsCost(len(cost), self._columns, cost)

    def bound(self, column: int, lower: float, upper: float) -> None:
        """Bound one unknown anew."""
        self._solver.changeColBounds(column, lower, upper)

    def solve(self) -> FloatArray | None:
        """The least cost."""
        pivots = _MOST_PIVOTS * (len(self._columns) + self._rows)
        for attempt, (tolerance, presolve) in enumerate(_WAYS):
            if attempt:  # from the beginning
                self._solver.clearSolver()
            if tolerance != self._tolerance or attempt:
                self._set(
                    primal_feasibility_tolerance=tolerance,
                    dual_feasibility_tolerance=tolerance,
                    presolve="on" if presolve else "off",
                )
                self._tolerance = tolerance
            self._set(simplex_iteration_limit=pivots)
            self._solver.run()
            status = self._solver.getModelStatus()
            if status == highspy.HighsModelStatus.kOptimal:
                return np.array(self._solver.getSolution().col_value, dtype=np.float64)
            if status == highspy.HighsModelStatus.kInfeasible:
                return None
        raise DesignError(
            f"the linear program of a shaper with {len(self._columns)} unknowns failed: "
            f"{self._solver.modelStatusToString(status)}"
        )

    def _add(self, matrix: FloatArray, lower: FloatArray, upper: FloatArray) -> None:
        count, width = matrix.shape
        self._solver.addRows(
            count,
            np.ascontiguousarray(lower, dtype=np.float64),
            np.ascontiguousarray(upper, dtype=np.float64),
            count * width,
            np.arange(0, count * width, width, dtype=np.int32),
            np.broadcast_to(self._columns, (count, width)).ravel(),
            np.ascontiguousarray(matrix, dtype=np.float64).ravel(),
        )
        self._rows += count

    def _set(self, **options: bool | float | str) -> None:
        for name, value in options.items():
            self._solver.setOptionValue(name, value)


def non_negative_least_squares(matrix: FloatArray, right: FloatArray) -> FloatArray | None:
    """The x >= 0 for which ``matrix @ x`` comes nearest to a right-hand side, to rounding.

    Written out here because SciPy's is behind an import that takes longer than all the designs of a conversion.

    Source: Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23.
    """
    count = matrix.shape[1]
    # Below it one unknown more would lower the squares by rounding only.
    slightest = 10.0 * np.finfo(float).eps * max(matrix.shape) * float(np.abs(matrix).sum(axis=0).max())
    x = np.zeros(count)
    used = np.zeros(count, dtype=bool)
    for _ in range(_MOST_ROUNDS * count):
        gain = matrix.T @ (right - matrix @ x)
        gain[used] = 0.0
        following = int(np.argmax(gain))
        if gain[following] <= slightest:
            return x
        used[following] = True
        better = _over(matrix, right, used)
        while np.any(better[used] <= 0.0):
            falling = np.flatnonzero(used & (better <= 0.0))
            shares = x[falling] / (x[falling] - better[falling])
            x = x + shares.min() * (better - x)
            used[falling[np.argmin(shares)]] = False
            used &= x > 0.0
            x[~used] = 0.0
            better = _over(matrix, right, used)
        x = better
    return None


def _over(matrix: FloatArray, right: FloatArray, used: NDArray[np.bool_]) -> FloatArray:
    """Least squares over some unknowns; the others are zero."""
    x = np.zeros(matrix.shape[1])
    x[used] = np.linalg.lstsq(matrix[:, used], right, rcond=None)[0]
    return x
