"""Taps on a grid whose residual stays below a bound over whole frequency bands: linear programs with cutting planes.

The condition ``|R(w)| <= v`` for every frequency w of a band is infinitely many second-order cones. Each of them
is equivalent to ``Re(e^{-ja} R(w)) <= v`` for every direction a, which is linear in the taps. So a linear program
with some (w, a) is a relaxation: its optimum is a lower bound for any design. The residual of
its taps is swept over the bands, and where it exceeds the bound the cutting plane (w, a = arg R(w)) is added.
Bound and sweep enclose the optimum, and the search ends when they meet.
"""

import math
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple, Self

import highspy
import numpy as np
from numpy.typing import NDArray

from shapegcode._core import DesignError
from shapegcode.io.units import FloatArray
from shapegcode.shaping.bands import ModeBand

# Tolerance and presolve: occasionally the solver fails or cycles with the first of them.
_ATTEMPTS = ((1e-10, False), (1e-9, True), (1e-9, False), (1e-8, True), (1e-7, True), (1e-7, False))
_MAX_PIVOTS = 20  # per unknown and condition; about 1 is usual


class _Quiet(highspy.Highs):
    """HiGHS without callbacks: these take as long as a small linear program, and version 1.16 prints a notice."""

    def __init__(self) -> None:
        super(highspy.Highs, self).__init__()
        self.setOptionValue("output_flag", False)


_FREE: list[_Quiet] = []
"""Free solvers for reuse: creating one takes a third of the time of a small linear program."""


def _solver() -> _Quiet:
    try:
        return _FREE.pop()  # atomic: another thread may take the last one
    except IndexError:
        return _Quiet()


def _give_back(solver: _Quiet) -> None:
    solver.clearModel()
    _FREE.append(solver)


class LinearProgram:
    """Minimises ``cost @ x`` between bounds, under linear constraints that can be added."""

    def __init__(self, lower: FloatArray, upper: FloatArray, equal: tuple[FloatArray, FloatArray]) -> None:
        """Bounds of each unknown, (n,); matrix and right-hand side of the equations."""
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
        """Replace the cost vector."""
        self._solver.changeColsCost(len(cost), self._columns, cost)

    def bound(self, column: int, lower: float, upper: float) -> None:
        """Change the bounds of one unknown."""
        self._solver.changeColBounds(column, lower, upper)

    def solve(self) -> FloatArray | None:
        """Minimise; None if infeasible."""
        pivots = _MAX_PIVOTS * (len(self._columns) + self._rows)
        for attempt, (tolerance, presolve) in enumerate(_ATTEMPTS):
            if attempt:  # restart
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


class TapProgram:
    """Taps of least cost under equations and planes; an additional unknown is the excess over the planes."""

    def __init__(
        self, equal: tuple[FloatArray, FloatArray], max_abs_sum: float | None, largest: float, last_tap: float
    ) -> None:
        matrix, right = equal
        self._count, self._signed = matrix.shape[1], max_abs_sum is not None
        matrix = np.hstack([*self._parts(matrix), np.zeros((len(matrix), 1))])
        least = np.zeros(matrix.shape[1])
        least[self._count - 1] = last_tap
        self._program = LinearProgram(least, np.full(matrix.shape[1], largest), (matrix, right))
        if max_abs_sum is not None:
            self._program.add_below(np.append(np.ones(2 * self._count), 0.0)[None, :], np.array([max_abs_sum]))

    def add_planes(self, planes: FloatArray, above: FloatArray) -> None:
        """Add planes; each may exceed its limit in `above` by at most the excess."""
        self._program.add_below(np.hstack([*self._parts(planes), np.full((len(planes), 1), -1.0)]), above)

    def solve(self, cost: FloatArray | None) -> tuple[FloatArray, float] | None:
        """Taps of least cost without an excess; without a cost: taps of least excess, and that."""
        objective = np.zeros(self._count) if cost is None else cost
        width = len(objective) * (1 + self._signed)
        self._program.set_cost(np.append(np.resize(objective, width), 1.0 if cost is None else 0.0))
        self._program.bound(width, 0.0, math.inf if cost is None else 0.0)
        x = self._program.solve()
        if x is None:
            return None
        taps = x[: self._count] - x[self._count : width] if self._signed else x[:width]
        return taps, float(x[-1])

    def _parts(self, matrix: FloatArray) -> list[FloatArray]:
        return [matrix, -matrix] if self._signed else [matrix]


ComplexArray = NDArray[np.complex128]
SAME_RESIDUAL = 1e-3  # relative gap between the lower bound and the design at which the design counts as optimal
NO_RESIDUAL = 1e-6  # residual ratio that counts as zero: no smaller gap is pursued
_STEP_RAD = 0.1  # sweep step as phase from the middle of the shaper; peaks are refined
_FEWEST_STEPS = 8
_MAX_ROUNDS = 60
_STARTS = 5  # initial frequencies of a band in every search
_BOUNDS_SHARE = 0.5  # of the worst residual: planes whose value is below this fraction count as inactive
_SAME_VALUE = 1e-6  # relative
_BESIDE = np.array([-1.0, 0.0, 1.0])
_QUARTERS = [share * math.pi for share in (0.0, 0.5, 1.0, 1.5)]


class Bounds(NamedTuple):
    """Result of a search for the smallest worst residual."""

    taps: FloatArray
    """Best taps at 0, 1 ... periods."""
    lower: float
    """No design of this duration has a smaller worst residual."""
    upper: float
    """Worst residual of `taps`, by a sweep."""


@dataclass
class CutPool:
    """Planes found so far, per band, each with angular frequency and direction. Valid for every duration.

    Directions are relative to the phase of an impulse in the middle of the shaper: so the directions of the best design
    hardly depend on its duration.
    """

    planes: list[list[tuple[float, float]]]
    starts: int = 0
    """This many planes of each band, the first ones, are never removed."""

    @classmethod
    def around(cls, bands: Sequence[ModeBand]) -> Self:
        """Start with four directions at a few frequencies of every band."""
        omegas = (np.linspace(*_ends(band), _STARTS).tolist() for band in bands)
        return cls([list(product(each, _QUARTERS)) for each in omegas], _STARTS * len(_QUARTERS))


class _Band:
    """The band of a mode: exponents of its residual's terms on a grid, and the frequencies at which it is evaluated."""

    def __init__(self, band: ModeBand, times_s: FloatArray) -> None:
        zeta = band.mode.damping_ratio
        end = times_s[-1]
        # R(w) = sum of a_k*exp(w*q_k): q is free of w because zeta is the same over the band
        self.q = -zeta * (end - times_s) + 1j * math.sqrt(1.0 - zeta**2) * (times_s - 0.5 * end)
        self.low, self.high = _ends(band)
        steps = max(_FEWEST_STEPS, math.ceil((self.high - self.low) * 0.5 * end / _STEP_RAD))
        self.omegas = np.linspace(self.low, self.high, steps + 1 if self.high > self.low else 1)
        self.terms = np.exp(np.outer(self.omegas, self.q))

    def residual(self, taps: FloatArray, omegas: FloatArray) -> ComplexArray:
        return np.asarray(np.exp(np.outer(omegas, self.q)) @ taps, dtype=np.complex128)

    def peaks(self, taps: FloatArray) -> tuple[FloatArray, ComplexArray]:
        """Angular frequencies of the local maxima of the residual's magnitude, refined, and the residual there."""
        size = np.abs(self.terms @ taps)
        padded = np.concatenate([[-1.0], size, [-1.0]])
        at = np.flatnonzero((size >= padded[:-2]) & (size >= padded[2:]))
        omegas, step = self.omegas[at], self.omegas[1] - self.omegas[0] if len(self.omegas) > 1 else 0.0
        for _ in range(2 if step else 0):
            # Include the ends of the band: a maximum may lie between an end and its neighbour.
            centres = _within(omegas, self.low + step, self.high - step)
            three = centres[:, None] + step * _BESIDE
            left, middle, right = (np.abs(self.residual(taps, three.ravel())) ** 2).reshape(-1, 3).T
            bend = left - 2.0 * middle + right
            shift = np.where(bend < 0.0, 0.5 * (left - right) / np.where(bend < 0.0, bend, -1.0), 0.0)
            omegas = centres + step * _within(shift, -1.0, 1.0)
            step *= 0.1
        omegas = np.concatenate([self.omegas[at], omegas])
        values = self.residual(taps, omegas)
        better = np.argmax(np.abs(values).reshape(2, -1), axis=0)
        pick = better * len(at) + np.arange(len(at))
        return omegas[pick], values[pick]


@dataclass
class TapProblem:
    """Taps at 0, 1 ... `last` periods, sum 1, under conditions on their residual over bands."""

    # bands of bounded residual; the frequency is swept, the damping ratio is nominal
    bands: Sequence[ModeBand]
    period_s: float  # of the grid, s
    last: int  # number of periods
    equalities: tuple[FloatArray, FloatArray]  # matrix and right-hand side of the linear conditions, the sum among them
    max_abs_sum: float | None  # largest sum of the taps' magnitudes; None: no tap is negative
    pool: CutPool  # planes, shared between problems of different duration
    last_tap: float = 0.0  # least value of the tap at `last` periods
    largest: float = math.inf  # largest magnitude of a tap
    _bands: list[_Band] = field(init=False)
    _rows: list[list[FloatArray]] = field(init=False)
    _program: TapProgram | None = field(init=False, default=None)
    _limit: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        times_s = np.arange(self.last + 1, dtype=np.float64) * self.period_s
        self._bands = [_Band(band, times_s) for band in self.bands]
        self._rows = [[] for _ in self.bands]

    def least_worst(self, limit: float | None = None) -> Bounds | None:
        """Taps with the smallest worst residual (with a limit: until it is met or impossible); None: there are none."""
        best = np.zeros(self.last + 1)
        lower, upper = 0.0, math.inf
        # far below the limit the program would be degenerate, and the solver may cycle
        floor = 0.5 * NO_RESIDUAL if limit is None else 0.5 * limit
        for _ in range(_MAX_ROUNDS):
            found = self._solve(None, floor)
            if found is None:
                return None
            taps, value = found
            if value > (1.0 + _SAME_VALUE) * floor:
                lower = max(lower, value)
            reached = self._add_cuts(taps, value)
            if reached < upper:
                best, upper = taps, reached
            decided = limit is not None and (lower > limit or upper <= limit)
            if decided or upper <= max((1.0 + SAME_RESIDUAL) * lower, NO_RESIDUAL):
                self._forget(best, upper)
                return Bounds(best, min(lower, upper), upper)
        raise DesignError(
            f"after {_MAX_ROUNDS} linear programs the worst residual lies between {lower:.4g} and {upper:.4g}: "
            "no design is proven best"
        )

    def cheapest(self, cost: FloatArray, limit: float) -> FloatArray | None:
        """Taps of least cost with a residual below the limit, or None; signed taps: the cost of their magnitudes."""
        for _ in range(_MAX_ROUNDS):
            found = self._solve(cost, limit)
            if found is None:
                return None
            if self._add_cuts(found[0], limit) <= (1.0 + 0.2 * SAME_RESIDUAL) * limit:
                return found[0]
        return None

    def _add_cuts(self, taps: FloatArray, bound: float) -> float:
        """Add planes where the bound is exceeded; returns the largest residual over the bands."""
        worst = 0.0
        for band, planes in zip(self._bands, self.pool.planes, strict=True):
            where, values = band.peaks(taps)
            size = np.abs(values)
            worst = max(worst, float(size.max()))
            over = size > (1.0 + 0.1 * SAME_RESIDUAL) * bound
            planes.extend(zip(where[over].tolist(), np.angle(values[over]).tolist(), strict=True))
        return worst

    def _forget(self, taps: FloatArray, worst: float) -> None:
        """Remove inactive cutting planes from the pool."""
        self._program = None if self._bands else self._program
        for rows, planes in zip(self._rows, self.pool.planes, strict=True):
            keep = [
                k for k in range(len(rows)) if k < self.pool.starts or float(rows[k] @ taps) >= _BOUNDS_SHARE * worst
            ]
            rows[:] = [rows[k] for k in keep]
            planes[:] = [planes[k] for k in keep]

    def _with_planes(self, limit: float) -> TapProgram:
        new: list[FloatArray] = []
        for band, rows, planes in zip(self._bands, self._rows, self.pool.planes, strict=True):
            if len(rows) < len(planes):
                omegas, directions = np.array(planes[len(rows) :]).T
                turned = np.exp(np.outer(omegas, band.q) - 1j * directions[:, None])
                rows.extend(turned.real)
                new.extend(turned.real)
        if self._program is None or (self._bands and limit != self._limit):
            self._program = TapProgram(self.equalities, self.max_abs_sum, self.largest, self.last_tap)
            self._limit = limit
            new = [row for rows in self._rows for row in rows]
        if new:
            self._program.add_planes(np.array(new), np.full(len(new), limit))
        return self._program

    def _solve(self, cost: FloatArray | None, limit: float) -> tuple[FloatArray, float] | None:
        """Solve the linear program with the current planes: least cost within the limit, or the least excess."""
        found = self._with_planes(limit).solve(cost)
        return None if found is None else (found[0], found[1] + limit)


def _within(values: FloatArray, low: float, high: float) -> FloatArray:
    """Like np.clip, but three times as fast for a few values."""
    return np.asarray(np.minimum(np.maximum(values, low), high))


def _ends(band: ModeBand) -> tuple[float, float]:
    omega = 2.0 * math.pi * band.mode.frequency_hz
    return omega * (1.0 - band.uncertainty), omega * (1.0 + band.uncertainty)
