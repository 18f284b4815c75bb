"""Chooses the number of modes by models of growing order; intervals and refusals of each mode."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import stats

from shapegcode import _core
from shapegcode.errors import RecordError
from shapegcode.identification.problem import MIN_CYCLES, Fit, FitProblem, Starts
from shapegcode.identification.result import ChartPole, Estimate, IdentifiedMode
from shapegcode.io.units import FloatArray

MAX_MODES = 8  # default largest number of modes of a model
_TWINS = 0.25  # distance of coinciding modes, relative to the half-power half width
_STABLE_FREQUENCY, _STABLE_DAMPING = 0.01, 0.05  # of a stable pole: largest relative change from one order lower
_APART = np.pi  # rad: two modes must differ by this phase over the record
# Chart poles merged to one start: distance in half-power half widths, and in ln of damping.
_SAME_FREQUENCY, _SAME_DAMPING = 0.2, 0.2
_MAX_DAMPING = 0.7  # of a pole used as a start
_PATIENCE = 2  # Consecutive unsupported models that end the search: one alone may have started badly


@dataclass(frozen=True, eq=False)
class Search:
    """Models by number of modes."""

    fits: tuple[Fit, ...]  # the best fit of each number of modes, from 1
    # by number of modes, from 0: samples * ln(mean square of the residual) + (parameters + modes) * ln(samples);
    # lower is better. Each mode counts one parameter more, since its frequency was searched
    evidence: tuple[float, ...]


@dataclass(frozen=True)
class Sought:
    """Search parameters."""

    band_hz: tuple[float, float] | None  # frequencies of interest; None: all
    max_modes: int | None
    modes: int | None  # number of modes; None: by evidence
    accepted_percent: float | None  # see `identify.identify`
    exponential_window_s: float | None = None  # time constant of a window already applied to the response
    phase_known: bool = True  # phases of residues are known; False: a drive lies between command and motion

    def order(self, models: Search) -> int:
        """Number of modes to use; raises if the data support fewer than requested."""
        if self.modes is not None and len(models.fits) < self.modes:
            raise RecordError(f"{self.modes} modes are asked for, and the data support no more than {len(models.fits)}")
        return self.modes or int(np.argmin(models.evidence))


def search(problem: FitProblem, sought: Sought) -> Search:
    """Fit models of 0, 1, 2, ... modes until a further mode is insignificant."""
    squares = problem.squares
    evidence = [evidence_of(problem, None)]
    fits: list[Fit] = []
    pool = _pool(problem)
    while len(fits) < (sought.modes or sought.max_modes or MAX_MODES):
        best = _next_fit(problem, fits[-1] if fits else None, pool)
        if best is None:
            break
        explained = (fits[-1].sum_of_squares if fits else squares) - best.sum_of_squares
        if explained < 1e-6 * squares:  # sensors are nonlinear by 0.1 % of amplitude
            break
        fits.append(best)
        evidence.append(evidence_of(problem, best))
        if len(fits) - int(np.argmin(evidence)) >= _PATIENCE:
            break
    return Search(tuple(fits), tuple(evidence))


def evidence_of(problem: FitProblem, fit: Fit | None) -> float:
    """Evidence of a fit, as in `Search.evidence`; if *fit* is None, evidence of the model without modes."""
    squares, count, parameters, modes = problem.squares, problem.samples, len(problem.responses), 0
    if fit is not None:
        squares, count, parameters = fit.sum_of_squares, fit.samples, fit.parameters
        modes = len(fit.omega_rad_s)
    samples, tiny = problem.white_share * count, np.finfo(float).tiny
    return float(samples * np.log(max(squares / samples, tiny)) + (parameters + modes) * np.log(samples))


def chart_modes(problem: FitProblem) -> Iterator[Starts]:
    """Yield the modes of each model of a stabilisation chart, in the order of the models: for 1 mode, for 2 ..."""
    orders = (min(map(len, problem.responses)) - 8) // 8  # limited by the samples of the shortest record
    most = max(1, min(20, orders))
    for poles in _core.stabilisation_poles(problem.responses, most, problem.forces):
        omega, zeta = _core.poles_to_modes(list(poles), problem.period_s)
        yield list(zip(map(float, omega), map(float, zeta), strict=True))


def chart_of(models: Iterable[tuple[int, Starts]]) -> tuple[ChartPole, ...]:
    """Poles of models of ascending order, each compared with the poles of the model before."""
    chart: list[ChartPole] = []
    before = np.empty((0, 2))
    for order, now in models:
        omega, zeta = before.T
        for w, z in now:
            near = np.abs(w / omega - 1.0) <= _STABLE_FREQUENCY
            damped_alike = near & (np.abs(z - zeta) <= _STABLE_DAMPING * zeta)
            chart.append(ChartPole(order, w / (2.0 * np.pi), z, bool(np.any(near)), bool(np.any(damped_alike))))
        before = np.array(now).reshape(-1, 2)
    return tuple(chart)


def _pool(problem: FitProblem) -> Starts:
    """Stabilisation-chart poles in the band, one per mode, from the model of highest order that has it."""
    low, high = problem.band_hz
    kept: Starts = []
    for w, z in reversed([mode for modes in chart_modes(problem) for mode in modes]):
        inside = z < _MAX_DAMPING and low <= w / (2.0 * np.pi) <= high
        near = [y for v, y in kept if abs(w - v) < _SAME_FREQUENCY * min(z, y) * w]
        if inside and not any(abs(np.log(z / y)) < _SAME_DAMPING for y in near):
            kept.append((w, z))
    return kept


def _next_fit(problem: FitProblem, last: Fit | None, pool: Starts) -> Fit | None:
    """Best fit with one more mode, started at peaks of the last residual and at the pole that explains most of it."""
    so_far = [] if last is None else starts_of(last)
    candidates: list[Starts] = []
    for omega in problem.peaks_left(last):
        alone = [_attempt(problem, [(omega, zeta)], left_by=last, quick=True) for zeta in (0.01, 0.05)]
        usable = [fit for fit in alone if fit is not None]
        if usable:
            candidates.append([*so_far, *starts_of(min(usable, key=lambda fit: fit.sum_of_squares))])
    if pool:
        chosen = problem.rank([*so_far, *pool], len(so_far))
        if len(chosen) > len(so_far):
            candidates.append([*so_far, pool[chosen[len(so_far)] - len(so_far)]])
    fits = [fit for starts in candidates if (fit := _attempt(problem, starts, quick=True)) is not None]
    # If the full fit ends in coinciding modes, try the next best start.
    for quick in sorted(fits, key=lambda fit: fit.sum_of_squares):
        if not _has_twins(quick, problem.duration_s):
            fit = _attempt(problem, starts_of(quick))
            if fit is not None and not _has_twins(fit, problem.duration_s):
                return fit
    return None


def _has_twins(fit: Fit, record_s: float) -> bool:
    """Whether two modes coincide, fitted to something that is no mode: drift, hum, a channel delay."""
    modes = sorted(starts_of(fit))
    return any(w2 - w1 < max(_TWINS * w1 * max(z1, z2), _APART / record_s) for (w1, z1), (w2, z2) in pairwise(modes))


def starts_of(fit: Fit) -> Starts:
    """Modes of a fit, as starts of another one."""
    return [(float(omega), float(zeta)) for omega, zeta in zip(fit.omega_rad_s, fit.damping_ratio, strict=True)]


def _attempt(problem: FitProblem, starts: Starts, **how: Any) -> Fit | None:
    """A fit, or None for an unusable start (a mode at the end of the band, too few samples)."""
    try:
        fit = problem.fit(starts, **how)
    except (_core.ArgumentError, _core.NumericError):
        return None
    return fit if np.isfinite(fit.sum_of_squares) else None


ACCEPTED_PERCENT = 5.0  # Widest accepted half interval of damping ratio and stiffness: an error of 10 % is then 4 sigma
_NO_VIBRATION = 0.5  # damping ratio above which it is drift, not a mode for a shaper
_LASTING = 0.8  # Not decayed: still above this ratio at the end (mains hum, a pump, a turning spindle)
_RIVAL_PROBABILITY = 0.05  # Largest probability that a competing model with one more mode fits as well by chance
_UNKNOWN = 7.0  # half width of the logarithm of an unknown value: a factor of a thousand
SCATTER_PROBABILITY = 0.01  # probability that noise alone makes taps differ as much
TURNED = (
    "modes are opposite to the hammer's force: the sign is reversed, as for a sensor at the same point that points "
    "the other way"
)
OPPOSED = "moves opposite to the hammer's force: hammer and sensor are not at the same point, so no mass follows"


@dataclass(frozen=True, eq=False)
class Doubts:
    """Limits that a mode must meet."""

    limit_percent: float  # widest accepted half interval of damping ratio and stiffness
    band_hz: tuple[float, float]  # modes outside are not reported
    record_s: float  # length of the longest record
    rival: Fit | None  # competing model with one more mode; see `rival_of`
    aliased: Callable[[float], float]  # fraction of the force at a frequency that may be aliased
    white_share: float  # independent fraction of the samples
    least: tuple[float, float]  # lower limits of the half intervals of ln f and ln zeta


def _estimates(fit: Fit, alone: Sequence[Fit], others: Sequence[Fit], doubts: Doubts) -> list[IdentifiedMode]:
    """Values and 95 % intervals of each mode of a fit; a mode opposite to the force is refused."""
    white_share = doubts.white_share
    freedom = max(white_share * fit.samples - fit.parameters, 1.0)
    quantile = float(stats.t.ppf(0.975, freedom)) / np.sqrt(white_share)
    rows = [_logarithms(fit, mode) for mode in range(len(fit.omega_rad_s))]
    found = []
    for mode, row in enumerate(rows):
        spread = _half_widths(row, quantile)
        spread[:2] = np.hypot(spread[:2], doubts.least)
        if len(row.values) > 2:
            spread[2:] = np.hypot(spread[2:], doubts.aliased(float(np.exp(row.values[0]))))
        # The covariance does not include the force's intersample behaviour.
        for other in others:
            apart = _logarithms(other, mode)
            spread = np.maximum(spread, np.abs(apart.values - row.values) + _half_widths(apart, quantile))
        if len(alone) > 1:
            spread = np.maximum(spread, _scatter([_logarithms(one, mode) for one in alone], white_share))
        found.append(mode_estimates(row.values, spread, OPPOSED if row.opposed else ""))
    return found


def mode_estimates(values: FloatArray, spread: FloatArray, refusal: str = "") -> IdentifiedMode:
    """A mode from logarithms of f (Hz), damping ratio and, if known, m, c, k; *spread*: their 95 % half-widths."""
    estimates = [
        Estimate(value, value * float(np.exp(-half)), value * float(np.exp(half)))
        for value, half in zip(np.exp(values), np.minimum(spread, _UNKNOWN), strict=True)
    ]
    frequency, damping, *physical = estimates
    mass, viscous, stiffness = physical or (None, None, None)
    return IdentifiedMode(frequency, damping, mass, viscous, stiffness, refusal)


#: ln of f, zeta, m, c = 2 zeta omega m, k = omega² m from ln omega, ln zeta, ln 1/m, apart from constants.
LOGARITHMS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, -1], [1, 1, -1], [2, 0, -1]], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class _Logarithms:
    """Logarithms of a mode's frequency (Hz) and damping ratio, with a force also of m, c, k; and their variances."""

    values: FloatArray
    variance: FloatArray
    opposed: bool


def _logarithms(fit: Fit, mode: int) -> _Logarithms:
    omega, zeta = float(fit.omega_rad_s[mode]), float(fit.damping_ratio[mode])
    values = [np.log(omega / (2.0 * np.pi)), np.log(zeta)]
    residue, scale, change = 1.0, np.array([1.0 / omega, 1.0 / zeta]), np.eye(2)
    if not isinstance(fit, _core.DecayFit):
        residue, change = float(fit.inverse_mass[mode]), LOGARITHMS
        scale = np.append(scale, 1.0 / residue)
        mass = -np.log(abs(residue))
        values += [mass, np.log(2.0 * zeta * omega) + mass, 2.0 * np.log(omega) + mass]
    size = len(scale)
    block = fit.covariance[size * mode : size * (mode + 1), size * mode : size * (mode + 1)]
    covariance = change @ (block * np.outer(scale, scale)) @ change.T
    return _Logarithms(np.array(values), np.diag(covariance), residue < 0.0)


def _half_widths(row: _Logarithms, quantile: float) -> FloatArray:
    """Half widths of the intervals; `_UNKNOWN` without a usable covariance."""
    usable = np.isfinite(row.variance) & (row.variance >= 0.0)
    return np.where(usable, quantile * np.sqrt(np.where(usable, row.variance, 0.0)), _UNKNOWN)


def _scatter(taps: Sequence[_Logarithms], white_share: float) -> FloatArray:
    """Half widths of the intervals from the scatter between taps; 0 where noise explains it."""
    values = np.array([tap.values for tap in taps])
    expected = np.mean([tap.variance for tap in taps], axis=0) / white_share
    seen = np.var(values, axis=0, ddof=1)
    ratio = seen / np.maximum(expected, np.finfo(float).tiny)
    more = ratio > stats.chi2.ppf(1.0 - SCATTER_PROBABILITY, len(taps) - 1) / (len(taps) - 1)
    half = stats.t.ppf(0.975, len(taps) - 1) * np.sqrt(seen / len(taps))
    return np.where(more, half, 0.0)


def rival_of(order: int, fits: Sequence[Fit], white_share: float) -> Fit | None:
    """The model with one more mode than the chosen one, if its better fit is unlikely to be chance."""
    if len(fits) <= order:
        return None
    chosen, larger = fits[order - 1 : order + 1]
    better = chosen.sum_of_squares / max(larger.sum_of_squares, np.finfo(float).tiny)
    gain = white_share * chosen.samples * np.log(better)
    by_chance = stats.chi2.ppf(1.0 - _RIVAL_PROBABILITY, larger.parameters - chosen.parameters)
    return larger if gain > by_chance else None


def checked_modes(fit: Fit, alone: Sequence[Fit], others: Sequence[Fit], doubts: Doubts) -> list[IdentifiedMode]:
    """The modes by ascending frequency, with refusals; drift (damping too high) and modes outside the band left out."""
    low, high = doubts.band_hz
    found = [
        replace(mode, refusal=_refusal_of(mode, doubts))
        for mode in _estimates(fit, alone, others, doubts)
        if mode.damping_ratio.value <= _NO_VIBRATION and low <= mode.frequency_hz.value <= high
    ]
    return sorted(found, key=lambda mode: mode.frequency_hz.value)


def _refusal_of(mode: IdentifiedMode, doubts: Doubts) -> str:
    """Why the data do not support a mode; empty if they do."""
    frequency, damping, stiffness = mode.frequency_hz, mode.damping_ratio, mode.stiffness_n_per_m
    if frequency.value * doubts.record_s < MIN_CYCLES:
        return (
            f"{frequency.value * doubts.record_s:.1f} cycles in the record of {doubts.record_s:.3g} s: "
            f"{MIN_CYCLES:g} or more are needed"
        )
    refusal = lasting_refusal(frequency.value, damping.value, doubts.record_s)[0]
    refusal = refusal or interval_refusal(mode, doubts.limit_percent, 100.0 * doubts.aliased(frequency.value))
    if refusal:
        return refusal
    if mode.refusal or doubts.rival is None:
        return mode.refusal
    # A competing model that splits or lacks the mode disagrees completely.
    rows = [_logarithms(doubts.rival, i) for i in range(len(doubts.rival.omega_rad_s))]
    nearest = min(rows, key=lambda row: abs(row.values[0] - np.log(frequency.value)))
    compared = ("frequency", frequency, 0), ("damping ratio", damping, 1), ("stiffness", stiffness, 4)
    for name, estimate, index in compared:
        moved = 0.0 if estimate is None else nearest.values[index] - np.log(estimate.value)
        change = 100.0 * abs(float(np.expm1(moved)))
        if change > doubts.limit_percent:
            return (
                f"{name} would change by {change:.0f} % with one mode more in the model, which the data cannot decide "
                f"(limit {doubts.limit_percent:g} %): more taps or less noise"
            )
    return ""


def lasting_refusal(frequency_hz: float, damping_ratio: float, record_s: float) -> tuple[str, float]:
    """Refusal of a vibration that does not decay (empty: it decays); ratio of its final to its first amplitude."""
    lasting = float(np.exp(-2.0 * np.pi * frequency_hz * damping_ratio * record_s))
    said = (
        f"still at {100.0 * lasting:.0f} % after {record_s:.3g} s: a steady disturbance (mains, pump, "
        "spindle), or a record too short for a mode of so little damping"
    )
    return said if lasting > _LASTING else "", lasting


def interval_refusal(mode: IdentifiedMode, limit_percent: float, folded_percent: float = 0.0) -> str:
    """Reason why an interval is too wide; empty if none is. `folded_percent`: aliased part of the force."""
    limits = (
        ("frequency", mode.frequency_hz, min(2.0, limit_percent)),
        ("damping ratio", mode.damping_ratio, limit_percent),
        ("stiffness", mode.stiffness_n_per_m, limit_percent),
    )
    for name, estimate, limit in limits:
        if estimate is None or estimate.uncertainty_percent <= limit:
            continue
        known = f"{name} is known only to {estimate.uncertainty_percent:.2g} % (limit {limit:g} %)"
        if name == "stiffness" and folded_percent > 0.5 * limit:
            return (
                f"{known}: the pulse has few samples, which without an anti-aliasing filter do not determine the force "
                "at this frequency; sample faster or take a softer tip"
            )
        if estimate.uncertainty_percent > 1000.0:
            known = f"{name} is not known (limit {limit:g} %)"
        return f"{known}: more taps, a longer record or less noise"
    return ""
