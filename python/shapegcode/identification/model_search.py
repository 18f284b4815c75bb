"""How many modes the data hold: models of growing order, each started where the last one left something unexplained.

A search knows nothing of taps or decays: a `FitProblem` fits a number of modes to its records, or quickly (without what
only the last digits need) to them or to what is left of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Protocol

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.errors import RecordError
from shapegcode.identification.frf_model import FrfFit
from shapegcode.identification.result import ChartPole

Starts = list[tuple[float, float]]  # (omega_rad_s, damping ratio) of each mode

# A further mode must explain this share of the response's energy: sensors are not linear beyond .1 % of amplitude.
_MIN_SHARE = 1e-6
_START_DAMPING = (0.01, 0.05)
PEAKS = 2  # of the residual's spectrum that are tried
_TWINS = 0.25  # of the half width of a resonance
_STABLE_FREQUENCY, _STABLE_DAMPING = 0.01, 0.05  # of the chart: the model one order lower has the pole too
_APART = np.pi  # rad: two modes must come half a turn apart in the record
_CHART_ORDERS = 20  # of the stabilisation chart
_SAME_PLACE = 0.2  # of the half width of a resonance: two poles of the chart are one start
_SAME_DAMPING = 0.2  # and in the logarithm of their damping
_MAX_DAMPING = 0.7  # of a pole to begin with
_PATIENCE = 2  # Two models in a row that the data do not ask for end the search: one may only have missed its place


Fit = _core.ModalFit | _core.DecayFit | FrfFit


class FitProblem(Protocol):
    """Records of one point, over time or over frequency."""

    # ruff: noqa: D102
    @property
    def squares(self) -> float: ...
    @property
    def samples(self) -> int: ...
    @property
    def constants(self) -> int: ...
    @property
    def duration_s(self) -> float: ...
    @property
    def period_s(self) -> float: ...
    @property
    def band_hz(self) -> tuple[float, float]: ...
    @property
    def white_share(self) -> float: ...
    @property
    def chart_orders(self) -> int: ...
    def fit(self, starts: Starts) -> Fit: ...
    def fit_quickly(self, starts: Starts) -> Fit: ...
    def fit_left(self, starts: Starts, last: Fit | None) -> Fit: ...
    def peaks_left(self, last: Fit | None) -> Sequence[float]: ...
    def poles(self, most: int) -> Sequence[npt.NDArray[np.complex128]]: ...
    def rank(self, candidates: Starts, kept: int) -> Sequence[int]: ...


@dataclass(frozen=True)
class Sought:
    """What is looked for."""

    band_hz: tuple[float, float] | None  # frequencies of interest; None: all
    most_modes: int
    modes: int | None  # their number; None: by evidence
    accepted_percent: float  # see `identify.identify`

    def order(self, models: Search) -> int:
        """Number of modes that is taken; refused where the data hold fewer than were asked for."""
        if self.modes is not None and len(models.fits) < self.modes:
            raise RecordError(f"{self.modes} modes are asked for, and the data hold no more than {len(models.fits)}")
        return self.modes or models.order


@dataclass(frozen=True, eq=False)
class Search:
    """Models by number of modes."""

    fits: tuple[Fit, ...]  # the best fit of each number of modes, from 1
    # by number of modes, from 0: samples * ln(mean square of the residual) + (parameters + modes) * ln(samples);
    # lower is better. One more than the parameters is counted for each mode, because its place was looked for
    # among all frequencies
    evidence: tuple[float, ...]

    @property
    def order(self) -> int:
        """Number of modes with the best evidence."""
        return int(np.argmin(self.evidence))


def search(problem: FitProblem, sought: Sought) -> Search:
    """Fit models of 0, 1, 2, ... modes until the data ask for no more."""
    squares = problem.squares
    evidence = [evidence_of(problem, None)]
    fits: list[Fit] = []
    pool = _pool(problem)
    while len(fits) < (sought.modes or sought.most_modes):
        best = _next_fit(problem, fits[-1] if fits else None, pool)
        if best is None:
            break
        explained = (fits[-1].sum_of_squares if fits else squares) - best.sum_of_squares
        if explained < _MIN_SHARE * squares:
            break
        fits.append(best)
        evidence.append(evidence_of(problem, best))
        if len(fits) - int(np.argmin(evidence)) >= _PATIENCE:
            break
    return Search(tuple(fits), tuple(evidence))


def evidence_of(problem: FitProblem, fit: Fit | None) -> float:
    """Evidence of a fit, as in `Search.evidence`; None: of a model without modes."""
    squares, count, parameters, modes = problem.squares, problem.samples, problem.constants, 0
    if fit is not None:
        squares, count, parameters = fit.sum_of_squares, fit.samples, fit.parameters
        modes = len(fit.omega_rad_s)
    samples, tiny = problem.white_share * count, np.finfo(float).tiny
    return float(samples * np.log(max(squares / samples, tiny)) + (parameters + modes) * np.log(samples))


def _chart_modes(problem: FitProblem) -> Iterator[Starts]:
    """Modes of the models of a stabilisation chart, by number of modes from 1."""
    for poles in problem.poles(max(1, min(_CHART_ORDERS, problem.chart_orders))):
        omega, zeta = _core.poles_to_modes(list(poles), problem.period_s)
        yield list(zip(map(float, omega), map(float, zeta), strict=True))


def stabilisation_chart(problem: FitProblem) -> tuple[ChartPole, ...]:
    """Poles of models with 1, 2, ... modes, each held against the model one order lower."""
    chart: list[ChartPole] = []
    before: Starts = []
    for order, now in enumerate(_chart_modes(problem), start=1):
        for w, z in now:
            near = [(wb, zb) for wb, zb in before if abs(w / wb - 1.0) <= _STABLE_FREQUENCY]
            damped_alike = any(abs(z - zb) <= _STABLE_DAMPING * zb for _, zb in near)
            chart.append(ChartPole(order, w / (2.0 * np.pi), z, bool(near), damped_alike))
        before = now
    return tuple(chart)


def _pool(problem: FitProblem) -> Starts:
    """Poles of the stabilisation chart that lie in the band, each mode once, as the models of higher order have it."""
    low, high = problem.band_hz
    kept: Starts = []
    for w, z in reversed([mode for modes in _chart_modes(problem) for mode in modes]):
        inside = z < _MAX_DAMPING and low <= w / (2.0 * np.pi) <= high
        if inside and not any(
            abs(w - v) < _SAME_PLACE * min(z, y) * w and abs(np.log(z / y)) < _SAME_DAMPING for v, y in kept
        ):
            kept.append((w, z))
    return kept


def _next_fit(problem: FitProblem, last: Fit | None, pool: Starts) -> Fit | None:
    """The best fit with one mode more, from peaks of what the last one leaves and the pole that explains most."""
    so_far = [] if last is None else starts_of(last)
    candidates: list[Starts] = []
    for omega in problem.peaks_left(last):
        alone = [_attempt(partial(problem.fit_left, [(omega, zeta)], last)) for zeta in _START_DAMPING]
        usable = [fit for fit in alone if fit is not None]
        if usable:
            candidates.append([*so_far, *starts_of(min(usable, key=lambda fit: fit.sum_of_squares))])
    if pool:
        chosen = problem.rank([*so_far, *pool], len(so_far))
        if len(chosen) > len(so_far):
            candidates.append([*so_far, pool[chosen[len(so_far)] - len(so_far)]])
    fits = [fit for starts in candidates if (fit := _attempt(partial(problem.fit_quickly, starts))) is not None]
    # The full fit may still run into twins: then the next best start has its turn.
    for quick in sorted(fits, key=lambda fit: fit.sum_of_squares):
        if not _has_twins(quick, problem.duration_s):
            fit = _attempt(partial(problem.fit, starts_of(quick)))
            if fit is not None and not _has_twins(fit, problem.duration_s):
                return fit
    return None


def _has_twins(fit: Fit, record_s: float) -> bool:
    """Whether two modes lie within a fraction of their width, or of what the record tells apart.

    That is one mode, drawn twice to mend what is no mode: drift, hum, a delay between the channels.
    """
    modes = sorted(starts_of(fit))
    return any(w2 - w1 < max(_TWINS * w1 * max(z1, z2), _APART / record_s) for (w1, z1), (w2, z2) in pairwise(modes))


def starts_of(fit: Fit) -> Starts:
    """The modes of a fit, for another one to begin with."""
    return [(float(omega), float(zeta)) for omega, zeta in zip(fit.omega_rad_s, fit.damping_ratio, strict=True)]


def _attempt(task: Callable[[], Fit]) -> Fit | None:
    """A fit, or None where the start cannot be used (a mode at the end of the band, too few samples)."""
    try:
        fit = task()
    except (_core.ArgumentError, _core.NumericError):
        return None
    return fit if np.isfinite(fit.sum_of_squares) else None
