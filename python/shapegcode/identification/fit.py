"""Modes of a structure from its taps or its free decays, each with its 95 % interval, or the reason why not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import resample_poly

from shapegcode import _core
from shapegcode.identification.checks import Prepared
from shapegcode.identification.model_search import (
    Doubts,
    Fit,
    Search,
    Sought,
    estimates_of,
    evidence_of,
    judged_modes,
    rival_of,
    search,
    stabilisation_chart,
    starts_of,
)
from shapegcode.identification.problem import HIGHEST_SHARE, Decays, Taps, problem_of
from shapegcode.identification.result import Identification, MassCheck, by_support
from shapegcode.io.record import FloatArray, Record

_COLOURED = 4.0  # standard errors of the residuals' autocorrelation above which they are not taken for white
_SPECTRUM = 4096  # points of the force's transform
_FOLDED = 2.0 / 3.0
_FILTER_ERROR = 3e-4  # what thinning out may do to a mass: the filters let 80 dB less pass
_FILTER_MOVES = (1e-6, 1e-4)  # ... and to a frequency and a damping ratio
_FINER = 16  # steps of the check by Wilson's method in a sampling period
_POSSIBLY = 15.0  # by so much (twice the logarithm of the odds) another course of the force may be less evident


def find_modes(ready: Prepared, files: tuple[str, ...], sought: Sought) -> Identification:
    """Find the modes that checked records of the same point support; see `identify.identify`."""
    problem = problem_of(ready, sought.band_hz, within=sought.modes is not None)
    models = search(problem, sought)
    sought.order(models)
    others: list[Fit] = []
    if isinstance(problem, Taps) and models.fits:
        problem, models, others = _choose_course(problem, models, sought)
    return _result(ready, files, problem, models, others, sought)


def _choose_course(problem: Taps, models: Search, sought: Sought) -> tuple[Taps, Search, list[Fit]]:
    """The course of the force between its samples for which the data speak, and fits of what else it may have been.

    A recorder with an anti-aliasing filter gives a band-limited force; a simulation may have one that is linear between
    samples, or single blows. The mass differs by (pi f/rate)^2/3 and more.
    """
    courses = [(problem, models)]
    order = max(sought.order(models), 1)
    for other in problem.other_courses(models.fits[order - 1]):
        fits = tuple(other.fit(starts_of(fit)) for fit in models.fits[:order])
        evidence = tuple(evidence_of(other, fit) for fit in fits)
        # The search is worth its time only where it may win: a wrong course asks for modes of its own.
        may_win = min(evidence) < min(models.evidence)
        courses.append((other, search(other, sought) if may_win else Search(fits, evidence)))
    best = min(courses, key=lambda course: min(course[1].evidence))
    least = min(best[1].evidence)
    starts = starts_of(best[1].fits[max(sought.order(best[1]), 1) - 1])
    # A record that begins within the pulse does not tell half of the momentum from the whole.
    in_pulse = problem.starts_in_pulse and best[0].hold != "impulse"
    possible = [other for other, searched in courses if in_pulse or min(searched.evidence) < least + _POSSIBLY]
    others: list[Fit] = [other.fit(starts) for other in possible if other is not best[0]]
    return *best, others


def _result(
    ready: Prepared,
    files: tuple[str, ...],
    problem: Taps | Decays,
    models: Search,
    others: Sequence[Fit],
    sought: Sought,
) -> Identification:
    order = sought.order(models)
    warnings = [*ready.warnings, *(f"{refused.source}: not used: {refused.reason}" for refused in ready.refused)]
    squares = sum(float(np.sum(response**2)) for response in problem.responses)
    without = Identification(
        files=files,
        evidence=dict(enumerate(models.evidence)),
        fit_percent=0.0,
        noise_rms=float(np.sqrt(squares / sum(len(response) for response in problem.responses))),
        reason="no mode stands out of the noise",
        warnings=tuple(warnings),
        notes=(*ready.notes, *_thinned_note(ready, problem, sought.band_hz)),
        prepared=ready,
        chart=stabilisation_chart(problem),
        fitted=tuple(np.zeros(len(response)) for response in problem.responses),
        fitted_records=_fitted_records(ready, problem),
    )
    if order == 0:
        return without
    fit = models.fits[order - 1]
    coloured = abs(fit.residual_autocorrelation - problem.noise_correlation) * np.sqrt(fit.samples) > _COLOURED
    if coloured:
        fit = problem.fit(starts_of(fit), coloured=True)
        warnings.append(
            f"what the model leaves is no white noise (autocorrelation {fit.residual_autocorrelation:.2f}): the "
            "intervals allow for it; other causes than modes, or a mode that is not linear"
        )
    white_share = 1.0 / max(record.widened for record in ready.records) ** 2 if coloured else problem.white_share
    aliased = _aliased(ready, problem)
    is_whole = isinstance(problem, Decays) or problem.thinned is None
    doubts = Doubts(
        limit_percent=sought.accepted_percent,
        band_hz=sought.band_hz or problem.band_hz,
        record_s=problem.duration_s,
        rival=rival_of(order, models.fits, problem.white_share),
        aliased=aliased,
    )
    least = (0.0, 0.0) if is_whole else _FILTER_MOVES
    found = judged_modes(estimates_of(fit, _alone(problem, fit), others, aliased, white_share, least), doubts)
    left = float(np.sqrt(fit.sum_of_squares / squares)) if squares > 0.0 else 1.0
    return replace(
        without,
        **by_support(found),
        order=order,
        fit_percent=100.0 * (1.0 - left),
        noise_rms=float(np.sqrt(fit.sum_of_squares / (fit.samples - fit.parameters))),
        mass_check=_mass_check(problem, fit),
        warnings=tuple(warnings),
        fitted=tuple(np.real(part) for part in fit.fitted),
    )


def _fitted_records(ready: Prepared, problem: Taps | Decays) -> tuple[Record, ...]:
    """The records as they were fitted: thinned out, if they were."""
    if isinstance(problem, Decays) or problem.thinned is None:
        return ready.records
    thinned = problem.thinned
    parts = zip(ready.records, problem.responses, problem.forces, thinned.first_s, strict=True)
    return tuple(
        replace(record, response=response, force_n=force, period_s=thinned.period_s, start_s=record.start_s + first_s)
        for record, response, force, first_s in parts
    )


def _thinned_note(ready: Prepared, problem: Taps | Decays, band_hz: tuple[float, float] | None) -> list[str]:
    thinned = problem.thinned if isinstance(problem, Taps) else None
    if thinned is None:
        return []
    rates = f"{1.0 / ready.records[0].period_s:.6g} samples per second are thinned out to {1.0 / thinned.period_s:.6g}"
    if band_hz is not None:
        return [
            f"{rates}, which the band up to {band_hz[1]:g} Hz and what stands out of the response above it need, "
            "behind one filter for force and response"
        ]
    return [
        f"{rates}, behind one filter for force and response: above {problem.band_hz[1]:.4g} Hz the hit excites little "
        "and nothing stands out of the response (--frequencies LOW:HIGH states another band)"
    ]


def _aliased(ready: Prepared, problem: Taps | Decays) -> Callable[[float], float]:
    """Share of the force's spectrum at a frequency that may have been folded down from above half the sampling rate.

    Its height at half the rate, beyond noise, tells how much: a half sine falls with the square of the frequency, so
    that two thirds of it fold down from both sides of the rate. A straight force without noise is no recording.
    """
    if isinstance(problem, Decays):
        return lambda _hz: 0.0
    is_simulated = problem.force_noise_n == 0.0 and problem.hold != "band_limited"
    record = ready.records[0]
    least = 0.0 if problem.thinned is None else _FILTER_ERROR
    if problem.hold == "impulse" or is_simulated or record.force_n is None:
        return lambda _hz: least
    pulse = np.trim_zeros(record.force_n)
    spectrum = np.abs(np.fft.rfft(pulse, _SPECTRUM))
    share = np.fft.rfftfreq(_SPECTRUM)
    highest = float(np.sqrt(np.mean(spectrum[share > HIGHEST_SHARE] ** 2)))
    noise = (ready.usable[0].force_noise_n or 0.0) * np.sqrt(len(pulse))
    folded = _FOLDED * np.sqrt(max(highest**2 - 2.0 * noise**2, 0.0))

    def at(frequency_hz: float) -> float:
        here = float(np.interp(frequency_hz * record.period_s, share, spectrum))
        return max(folded / here, least) if here > 0.0 else np.inf

    return at


def _alone(problem: Taps | Decays, fit: Fit) -> list[Fit]:
    """The same modes fitted to each record by itself; none if there is but one, or a record does not hold them."""
    if len(problem.responses) < 2:
        return []
    try:
        return [problem.record(index).fit(starts_of(fit)) for index in range(len(problem.responses))]
    except _core.ArgumentError:
        return []


def _mass_check(problem: Taps | Decays, fit: Fit) -> MassCheck | None:
    """The equivalent mass by paper 003's way, from the first tap, where the model has one mode."""
    if isinstance(problem, Decays) or len(fit.omega_rad_s) != 1 or problem.hold == "impulse":
        return None
    args = (
        _finer(problem.forces[0], problem.held),
        _finer(problem.responses[0], "band_limited"),
        problem.period_s / _FINER,
        float(fit.omega_rad_s[0]),
        float(fit.damping_ratio[0]),
    )
    closed = _core.equivalent_mass_closed_form(*args, quantity=problem.quantity)
    halved = _core.equivalent_mass_bisection(*args, quantity=problem.quantity)
    return MassCheck(closed.mass_kg, halved.mass_kg, halved.halvings)


def _finer(signal: FloatArray, hold: str) -> FloatArray:
    """A signal with more samples: straight between its samples, or band-limited."""
    if hold == "band_limited":
        return np.asarray(resample_poly(signal, _FINER, 1), dtype=np.float64)
    places = np.arange(len(signal) * _FINER) / _FINER
    return np.interp(places, np.arange(len(signal)), signal)
