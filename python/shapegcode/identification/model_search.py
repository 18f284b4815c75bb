"""How many modes the data hold: models of growing order, each started where the last one left something unexplained.

A search knows nothing of taps or decays: a `FitProblem` fits a number of modes to its records, or quickly (without what
only the last digits need) to them or to what is left of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Protocol

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.identification.frf_model import FrfFit

FloatArray = npt.NDArray[np.float64]
Starts = list[tuple[float, float]]  # (omega_rad_s, damping ratio) of each mode

# A further mode must explain this share of the response's energy: sensors are not linear beyond .1 % of amplitude.
_LEAST_SHARE = 1e-6
_START_DAMPING = (0.01, 0.05)
_PEAKS = 2  # of the residual's spectrum that are tried
_TWINS = 0.25  # of the half width of a resonance
_APART = np.pi  # rad: two modes must come half a turn apart in the record
_CHART_ORDERS = 20  # of the stabilisation chart
_SAME_PLACE = 0.2  # of the half width of a resonance: two poles of the chart are one start
_SAME_DAMPING = 0.2  # and in the logarithm of their damping
_MOST_DAMPING = 0.7  # of a pole to begin with
# Two models in a row that the data do not ask for end the search: one may only have missed its place.
_PATIENCE = 2


Fit = _core.ModalFit | _core.DecayFit | FrfFit


class FitProblem(Protocol):
    """Records of one point, over time or over frequency."""

    @property
    def squares(self) -> float: ...  # noqa: D102
    @property
    def samples(self) -> int: ...  # noqa: D102
    @property
    def constants(self) -> int: ...  # noqa: D102
    @property
    def duration_s(self) -> float: ...  # noqa: D102
    @property
    def period_s(self) -> float: ...  # noqa: D102
    @property
    def band_hz(self) -> tuple[float, float]: ...  # noqa: D102
    @property
    def white_share(self) -> float: ...  # noqa: D102
    @property
    def chart_orders(self) -> int: ...  # noqa: D102

    def fit(self, starts: Starts) -> Fit: ...  # noqa: D102

    def fit_quickly(self, starts: Starts) -> Fit: ...  # noqa: D102

    def fit_left(self, starts: Starts, last: Fit | None) -> Fit: ...  # noqa: D102

    def peaks_left(self, last: Fit | None, most: int) -> Sequence[float]: ...  # noqa: D102

    def poles(self, most: int) -> Sequence[npt.NDArray[np.complex128]]: ...  # noqa: D102

    def rank(self, candidates: Starts, kept: int) -> Sequence[int]: ...  # noqa: D102


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


def search(problem: FitProblem, most_modes: int) -> Search:
    """Fit models of 0, 1, 2, ... modes until the data ask for no more."""
    squares, share = problem.squares, problem.white_share
    evidence = [evidence_of_none(problem)]
    fits: list[Fit] = []
    pool = _pool(problem)
    while len(fits) < most_modes:
        best = _next_fit(problem, fits[-1] if fits else None, pool)
        if best is None:
            break
        explained = (fits[-1].sum_of_squares if fits else squares) - best.sum_of_squares
        if explained < _LEAST_SHARE * squares:
            break
        fits.append(best)
        evidence.append(evidence_of(best, share))
        if len(fits) - int(np.argmin(evidence)) >= _PATIENCE:
            break
    return Search(tuple(fits), tuple(evidence))


def evidence_of_none(problem: FitProblem) -> float:
    """Evidence of a model without modes."""
    return _evidence(problem.squares, problem.white_share * problem.samples, problem.constants, 0)


def evidence_of(fit: Fit, white_share: float) -> float:
    """Evidence of a fit, as in `Search.evidence`."""
    return _evidence(fit.sum_of_squares, white_share * fit.samples, fit.parameters, len(fit.omega_rad_s))


def _evidence(squares: float, samples: float, parameters: int, modes: int) -> float:
    tiny = np.finfo(float).tiny
    return float(samples * np.log(max(squares / samples, tiny)) + (parameters + modes) * np.log(samples))


def chart_poles(problem: FitProblem) -> Sequence[npt.NDArray[np.complex128]]:
    """Poles of the models of a stabilisation chart, by number of modes from 1."""
    return problem.poles(max(1, min(_CHART_ORDERS, problem.chart_orders)))


def _pool(problem: FitProblem) -> Starts:
    """Poles of the stabilisation chart that lie in the band: each mode is among them several times."""
    low, high = problem.band_hz
    found: Starts = []
    for of_model in chart_poles(problem):
        omega, zeta = _core.poles_to_modes(list(of_model), problem.period_s)
        found += [(w, z) for w, z in zip(map(float, omega), map(float, zeta), strict=True) if z < _MOST_DAMPING]
    return _apart([(w, z) for w, z in found if low <= w / (2.0 * np.pi) <= high])


def _apart(found: Starts) -> Starts:
    """Those that are no repetition of another one: of models of higher order, which know the weak modes too."""
    kept: Starts = []
    for w, z in reversed(found):
        if not any(abs(w - v) < _SAME_PLACE * min(z, y) * w and abs(np.log(z / y)) < _SAME_DAMPING for v, y in kept):
            kept.append((w, z))
    return kept


def _next_fit(problem: FitProblem, last: Fit | None, pool: Starts) -> Fit | None:
    """The best fit with one mode more than `last`.

    The further mode is begun at the peaks of what `last` leaves, and at the pole of the pool that explains most of it.
    """
    so_far = [] if last is None else starts_of(last)
    candidates: list[Starts] = []
    for omega in problem.peaks_left(last, _PEAKS):
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
