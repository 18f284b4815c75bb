"""From a fit to values with intervals, and whether the data support them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import stats

from shapegcode import _core
from shapegcode.identification.mode import Estimate
from shapegcode.identification.model_search import Fit

FloatArray = npt.NDArray[np.float64]

#: A damping ratio or stiffness less certain than this is refused: 10 % are then four standard deviations off.
ACCEPTED_PERCENT = 5.0
_FREQUENCY_PERCENT = 2.0
_NOT_AT_ALL_PERCENT = 1000.0
_NO_VIBRATION = 0.5  # damping ratio above which it is drift, not a mode that a shaper could deal with
#: Swings of a mode in the record: fewer do not tell its frequency.
LEAST_SWINGS = 2.0
#: What has not fallen to this share at the end of the record does not decay: mains hum, a pump, a turning spindle.
_LASTING = 0.8
#: A model with one mode more counts as a rival while it fits better by more than chance alone does in one case of 20.
_RIVAL_PROBABILITY = 0.05
_UNKNOWN = 7.0  # half width of a logarithm that says nothing: a factor of a thousand
_SCATTER_PROBABILITY = 0.01  # of taps that differ as much by noise alone


@dataclass(frozen=True)
class Estimates:
    """One mode of a fit. SI units; the last three are None for a free decay."""

    frequency_hz: Estimate  # undamped natural frequency
    damping_ratio: Estimate  # no unit
    mass_kg: Estimate | None  # equivalent mass
    damping_n_s_per_m: Estimate | None  # equivalent viscous damping
    stiffness_n_per_m: Estimate | None  # equivalent stiffness
    opposed: bool = False  # the residue is negative: the mode moves against the push


@dataclass(frozen=True, eq=False)
class Rival:
    """Another model that the data do not clearly refuse."""

    fit: Fit  # of the same records
    condition: str  # under which it would be the right one
    remedy: str  # what would decide


@dataclass(frozen=True, eq=False)
class Doubts:
    """What a mode must stand up to."""

    limit_percent: float  # least certainty of damping ratio and stiffness
    band_hz: tuple[float, float]  # frequencies that were searched
    record_s: float  # length of the longest record
    rivals: Sequence[Rival] = ()  # models of nearly the same evidence
    aliased: Callable[[float], float] = lambda _hz: 0.0  # see `estimates_of`


def estimates_of(
    fit: Fit,
    alone: Sequence[Fit],
    others: Sequence[Fit] = (),
    aliased: Callable[[float], float] = lambda _hz: 0.0,
    white_share: float = 1.0,
    least: tuple[float, float] = (0.0, 0.0),
) -> list[Estimates]:
    """Values and 95 % intervals of each mode of a fit.

    The intervals are those of the fit's covariance, in logarithms. Where taps differ by more than that explains, their
    scatter takes its place. What the force does between its samples is not known to the covariance: the intervals
    reach as far as those of the other courses that the data allow, and by what may have been folded into its spectrum.
    """
    freedom = max(white_share * fit.samples - fit.parameters, 1.0)
    quantile = float(stats.t.ppf(0.975, freedom)) / np.sqrt(white_share)
    rows = [_logarithms(fit, mode) for mode in range(len(fit.omega_rad_s))]
    found = []
    for mode, row in enumerate(rows):
        spread = _half_widths(row, quantile)
        spread[:2] = np.hypot(spread[:2], least)
        if len(row.values) > 2:
            spread[2:] = np.hypot(spread[2:], aliased(float(np.exp(row.values[0]))))
        for other in others:
            apart = _logarithms(other, mode)
            spread = np.maximum(spread, np.abs(apart.values - row.values) + _half_widths(apart, quantile))
        if len(alone) > 1:
            spread = np.maximum(spread, _scatter([_logarithms(one, mode) for one in alone], white_share))
        values = [
            Estimate(value, value * float(np.exp(-half)), value * float(np.exp(half)))
            for value, half in zip(np.exp(row.values), np.minimum(spread, _UNKNOWN), strict=True)
        ]
        if len(values) == 2:
            found.append(Estimates(values[0], values[1], None, None, None))
        else:
            found.append(Estimates(values[0], values[1], values[2], values[3], values[4], row.opposed))
    return found


@dataclass(frozen=True, eq=False)
class _Logarithms:
    """Logarithms of frequency (Hz), damping ratio, mass, viscous damping, stiffness (SI), and their covariance."""

    values: FloatArray
    covariance: FloatArray
    opposed: bool


def _logarithms(fit: Fit, mode: int) -> _Logarithms:
    omega, zeta = float(fit.omega_rad_s[mode]), float(fit.damping_ratio[mode])
    values = [np.log(omega / (2.0 * np.pi)), np.log(zeta)]
    if not isinstance(fit, _core.DecayFit):
        residue = float(fit.inverse_mass[mode])
        scale = np.array([1.0 / omega, 1.0 / zeta, 1.0 / residue])
        # ln of f, zeta, m, c = 2 zeta omega m, k = omega^2 m from ln omega, ln zeta, ln 1/m.
        change = np.array([[1, 0, 0], [0, 1, 0], [0, 0, -1], [1, 1, -1], [2, 0, -1]], dtype=np.float64)
        mass = -np.log(abs(residue))
        values += [mass, np.log(2.0 * zeta * omega) + mass, 2.0 * np.log(omega) + mass]
    else:
        residue = 1.0
        scale = np.array([1.0 / omega, 1.0 / zeta])
        change = np.eye(2)
    size = len(scale)
    block = fit.covariance[size * mode : size * (mode + 1), size * mode : size * (mode + 1)]
    covariance = change @ (block * np.outer(scale, scale)) @ change.T
    return _Logarithms(np.array(values), covariance, residue < 0.0)


def _half_widths(row: _Logarithms, quantile: float) -> FloatArray:
    """Half widths of the intervals; where the fit has no usable covariance, as wide as can be."""
    variance = np.diag(row.covariance)
    usable = np.isfinite(variance) & (variance >= 0.0)
    return np.where(usable, quantile * np.sqrt(np.where(usable, variance, 0.0)), _UNKNOWN)


def _scatter(taps: Sequence[_Logarithms], white_share: float) -> FloatArray:
    """Half widths from the scatter of single taps; 0 where noise explains it."""
    values = np.array([tap.values for tap in taps])
    expected = np.mean([np.diag(tap.covariance) for tap in taps], axis=0) / white_share
    seen = np.var(values, axis=0, ddof=1)
    ratio = seen / np.maximum(expected, np.finfo(float).tiny)
    more = ratio > stats.chi2.ppf(1.0 - _SCATTER_PROBABILITY, len(taps) - 1) / (len(taps) - 1)
    half = stats.t.ppf(0.975, len(taps) - 1) * np.sqrt(seen / len(taps))
    return np.where(more, half, 0.0)


def rivals_of(order: int, fits: Sequence[Fit], white_share: float) -> list[Rival]:
    """Models beside the chosen one that the data do not clearly refuse.

    That is the one with a mode more, if chance alone would seldom make it fit so much better.
    """
    chosen = fits[order - 1]
    if len(fits) <= order:
        return []
    larger = fits[order]
    gain = (
        white_share * chosen.samples * np.log(chosen.sum_of_squares / max(larger.sum_of_squares, np.finfo(float).tiny))
    )
    if gain <= stats.chi2.ppf(1.0 - _RIVAL_PROBABILITY, larger.parameters - chosen.parameters):
        return []
    return [Rival(larger, "with one mode more in the model", "more taps or less noise")]


def is_background(mode: Estimates, doubts: Doubts) -> bool:
    """Whether a part of the model is drift or lies outside the band: it helps the fit, and is no mode to speak of."""
    low, high = doubts.band_hz
    return mode.damping_ratio.value > _NO_VIBRATION or not low <= mode.frequency_hz.value <= high


def refusal_of(mode: Estimates, doubts: Doubts) -> str:
    """Why the data do not support a mode; empty if they do."""
    frequency, damping, stiffness = mode.frequency_hz, mode.damping_ratio, mode.stiffness_n_per_m
    if frequency.value * doubts.record_s < LEAST_SWINGS:
        return (
            f"{frequency.value * doubts.record_s:.1f} swings in the record of {doubts.record_s:.3g} s: "
            f"{LEAST_SWINGS:g} or more are needed"
        )
    lasting = float(np.exp(-2.0 * np.pi * frequency.value * damping.value * doubts.record_s))
    if lasting > _LASTING:
        return (
            f"still at {100.0 * lasting:.0f} % after {doubts.record_s:.3g} s: a steady disturbance (mains, pump, "
            "spindle), or a record too short for a mode of so little damping"
        )
    limits = (
        ("frequency", frequency, min(_FREQUENCY_PERCENT, doubts.limit_percent)),
        ("damping ratio", damping, doubts.limit_percent),
        ("stiffness", stiffness, doubts.limit_percent),
    )
    for name, estimate, limit in limits:
        if estimate is not None and not estimate.uncertainty_percent <= limit:
            folded = 100.0 * doubts.aliased(frequency.value)
            if name == "stiffness" and folded > 0.5 * limit:
                return (
                    f"{name} is known to {estimate.uncertainty_percent:.2g} % only (limit {limit:g} %): the pulse has "
                    "few samples, and without an anti-aliasing filter they do not tell its force at this frequency; "
                    "sample faster or take a softer tip"
                )
            known = f"to {estimate.uncertainty_percent:.2g} % only"
            if estimate.uncertainty_percent > _NOT_AT_ALL_PERCENT:
                known = "not at all"
            return f"{name} is known {known} (limit {limit:g} %): more taps, a longer record or less noise"
    if mode.opposed:
        return "moves against the push of the hammer: hammer and sensor are not at the same point, so no mass follows"
    return _rival_refusal(mode, doubts)


def _rival_refusal(mode: Estimates, doubts: Doubts) -> str:
    for rival in doubts.rivals:
        # A rival that splits the mode in two or lacks it disagrees as much as one can.
        rows = [_logarithms(rival.fit, i) for i in range(len(rival.fit.omega_rad_s))]
        nearest = min(rows, key=lambda row: abs(row.values[0] - np.log(mode.frequency_hz.value)))
        named = [("frequency", mode.frequency_hz, 0), ("damping ratio", mode.damping_ratio, 1)]
        if mode.stiffness_n_per_m is not None:
            named.append(("stiffness", mode.stiffness_n_per_m, 4))
        for name, estimate, index in named:
            change = 100.0 * abs(float(np.expm1(nearest.values[index] - np.log(estimate.value))))
            if change > doubts.limit_percent:
                return (
                    f"{name} would change by {change:.0f} % {rival.condition}, which the data cannot decide "
                    f"(limit {doubts.limit_percent:g} %): {rival.remedy}"
                )
    return ""
