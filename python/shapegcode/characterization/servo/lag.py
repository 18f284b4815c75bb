"""The servo lag behind a dead time: its error in closed form, and the fit to a record by separable least squares.

The command r reaches the loop τ later; the loop is the core's `ServoLag`, x' = K (r − x) + f r'. So the lag at constant
speed is τ + (1 − f)/K. A Sinumerik with speed feed-forward balances it by such a dead time (MD32620 = 3, 4).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["LagFit", "delayed", "fit_lag", "lag_way", "rms"]

FloatArray = npt.NDArray[np.float64]
GAINS = (2.0, 1000.0)  # 1/s
LONGEST_DEAD_S = 0.05
SETTLE_S = 0.1


@dataclass(frozen=True, eq=False)
class LagFit:
    """A servo lag behind a dead time.

    Attributes:
        dead_s: dead time τ.
        gain_per_s: position gain K.
        rest: 1 − f, what the feed-forward leaves, 0 to 1.
        offset: of the encoder against the command at rest.
        error: of each stretch: command less actual position, as the model has it.
    """

    dead_s: float
    gain_per_s: float
    rest: float
    offset: float
    error: tuple[FloatArray, ...]

    @property
    def lag_s(self) -> float:
        """Lag at constant speed over speed."""
        return self.dead_s + self.rest / self.gain_per_s


def rms(values: FloatArray) -> float:
    """Root of the mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(values**2))) if values.size else math.nan


def delayed(way: FloatArray, samples: float) -> FloatArray:
    """A command some samples later: joined by straight lines, at constant speed before its first sample."""
    at = np.arange(len(way)) - samples
    found: FloatArray = np.interp(at, np.arange(len(way)), way)
    return np.where(at < 0.0, way[0] + at * (way[1] - way[0]), found)


def lag_way(way: FloatArray, gain_per_s: float, period_s: float, late: float = 0.0) -> FloatArray:
    """Error of a first-order lag without feed-forward (f = 0), exact for set-points joined by straight lines."""
    from scipy.signal import lfilter

    kept = math.exp(-gain_per_s * period_s)
    share = (1.0 - kept) / (gain_per_s * period_s)  # of a ramp over one period
    first = way[1] - way[0]
    steady = share * first / (1.0 - kept)
    steps = np.diff(way, prepend=way[0] - first)
    error = np.asarray(lfilter([share], [1.0, -kept], steps, zi=[kept * steady])[0], dtype=np.float64)
    whole = math.ceil(late)
    part = whole - late
    if whole == 0:
        return error
    # Between two samples: the error at the one before decays, that of the line up to there comes in.
    inside = math.exp(-gain_per_s * period_s * part)
    before = np.concatenate([np.full(whole, steady), error[: max(len(way) - whole, 0)]])[: len(way)]
    step = np.concatenate([np.full(whole, first), np.diff(way)])[: len(way)]
    return inside * before + step * (1.0 - inside) / (gain_per_s * period_s)


@dataclass(frozen=True, eq=False)
class _LagProblem:
    commands: Sequence[FloatArray]
    measured: Sequence[FloatArray]  # command less actual
    use: Sequence[npt.NDArray[np.bool_]]
    period_s: float

    def solve(self, dead_s: float, gain_per_s: float) -> tuple[float, LagFit]:
        """The best 1 − f and offset for a dead time and gain, and the mean square that is left."""
        late = [way - delayed(way, dead_s / self.period_s) for way in self.commands]
        lags = [lag_way(way, gain_per_s, self.period_s, dead_s / self.period_s) for way in self.commands]
        left = self.used([e - gone for e, gone in zip(self.measured, late, strict=True)])
        basis = self.used(lags)
        mean_left, mean_basis = left.mean(), basis.mean()
        power = float(np.sum((basis - mean_basis) ** 2))
        rest = float((basis - mean_basis) @ (left - mean_left)) / power if power > 0.0 else 0.0
        rest = min(max(rest, 0.0), 1.0)
        offset = float(mean_left - rest * mean_basis)
        error = tuple(gone + rest * lag + offset for gone, lag in zip(late, lags, strict=True))
        square = float(np.mean((left - rest * basis - offset) ** 2))
        return square, LagFit(dead_s, gain_per_s, rest, offset, error)

    def used(self, values: Sequence[FloatArray]) -> FloatArray:
        """Those samples that count, of all stretches."""
        return np.concatenate([each[use] for each, use in zip(values, self.use, strict=True)])


def fit_lag(
    commands: Sequence[FloatArray],
    actuals: Sequence[FloatArray],
    use: Sequence[npt.NDArray[np.bool_]],
    period_s: float,
    *,
    dead_time: bool,
) -> LagFit:
    """Fit dead time, gain, feed-forward and offset."""
    from scipy.optimize import minimize, minimize_scalar

    problem = _LagProblem(commands, [r - x for r, x in zip(commands, actuals, strict=True)], use, period_s)
    scale = max(rms(problem.used(problem.measured)) ** 2, 1e-18)
    low, high = (math.log(each) for each in GAINS)

    def square(values: FloatArray) -> float:
        dead, gain = (values[0] * 1e-3, values[1]) if dead_time else (0.0, values[-1])
        out = max(0.0, -dead) + max(0.0, dead - LONGEST_DEAD_S) + max(0.0, low - gain) + max(0.0, gain - high)
        dead = min(max(dead, 0.0), LONGEST_DEAD_S)
        found = problem.solve(dead, math.exp(min(max(gain, low), high)))[0]
        return math.log(found / scale + 1e-18) + 1e3 * float(out)

    if dead_time:
        lag = _steady_lag(problem)
        starts = [(1e3 * share * lag, math.log(gain)) for share in (0.6, 0.9, 0.99) for gain in (20.0, 60.0)]
        # Two valleys are followed to their ends: from the other starts others only come later to the same place.
        tried = [
            minimize(square, start, method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-9, "maxiter": 300})
            for start in sorted(starts, key=lambda each: square(np.array(each)))[:2]
        ]
        best = min(tried, key=lambda each: float(each.fun)).x
    else:
        gains = np.linspace(low, high, 13)
        rank = int(np.argmin([square(gains[at : at + 1]) for at in range(len(gains))]))
        around = gains[max(rank - 1, 0)], gains[min(rank + 1, len(gains) - 1)]
        found = minimize_scalar(lambda gain: square(np.array([gain])), bounds=around, method="bounded")
        best = np.array([float(found.x)])
    dead = min(max(float(best[0]) * 1e-3, 0.0), LONGEST_DEAD_S) if dead_time else 0.0
    return problem.solve(dead, math.exp(min(max(float(best[-1]), low), high)))[1]


def _steady_lag(problem: _LagProblem) -> float:
    """Lag over speed, by least squares."""
    speed = problem.used([np.gradient(way, problem.period_s) for way in problem.commands])
    error = problem.used(problem.measured)
    power = float(speed @ speed)
    return min(max(float(speed @ error) / power, 0.0), LONGEST_DEAD_S) if power > 0.0 else 0.0
