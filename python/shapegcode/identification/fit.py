"""Modes of a structure from its taps or its free decays, each with its 95 % interval, or the reason why not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.signal import resample_poly

from shapegcode import _core
from shapegcode.errors import RecordError
from shapegcode.identification.chart import stabilisation_chart
from shapegcode.identification.mode import IdentifiedMode
from shapegcode.identification.model_search import Fit, Search, chart_poles, evidence_of, search, starts_of
from shapegcode.identification.prepared import Prepared
from shapegcode.identification.problem import HIGHEST_SHARE, Decays, Taps, problem_of
from shapegcode.identification.result import Identification, MassCheck, reason_for
from shapegcode.identification.support import Doubts, estimates_of, is_background, refusal_of, rivals_of
from shapegcode.io.record import Record

FloatArray = npt.NDArray[np.float64]

_COLOURED = 4.0  # standard errors of the residuals' autocorrelation above which they are not taken for white
_SPECTRUM = 4096  # points of the force's transform
_FOLDED = 2.0 / 3.0
_FILTER_ERROR = 3e-4  # what thinning out may do to a mass: the filters let 80 dB less pass
_FILTER_MOVES = (1e-6, 1e-4)  # ... and to a frequency and a damping ratio
_FINER = 16  # steps of the check by Wilson's method in a sampling period
_POSSIBLY = 15.0  # by so much (twice the logarithm of the odds) another course of the force may be less evident


def find_modes(
    ready: Prepared,
    files: tuple[str, ...],
    *,
    band_hz: tuple[float, float] | None,
    most_modes: int,
    modes: int | None,
    accepted_percent: float,
) -> Identification:
    """Find the modes that checked records of the same point support; see `identify.identify`."""
    problem = problem_of(ready, band_hz, within=modes is not None)
    models = _search(problem, most_modes, modes)
    others: list[Fit] = []
    if isinstance(problem, Taps) and models.fits:
        problem, models, others = _held(problem, models, most_modes, modes)
    return _result(ready, files, problem, models, modes or models.order, others, accepted_percent, band_hz)


def _held(problem: Taps, models: Search, most_modes: int, modes: int | None) -> tuple[Taps, Search, list[Fit]]:
    """The course of the force between its samples for which the data speak, and fits of what else it may have been.

    A recorder with an anti-aliasing filter gives a band-limited force; a simulation may have one that is linear between
    samples, or single blows. The mass differs by (pi f/rate)^2/3 and more.
    """
    courses = [(problem, models)]
    order = modes or max(models.order, 1)
    for other in problem.other_courses(models.fits[order - 1]):
        fits = tuple(other.fit(starts_of(fit)) for fit in models.fits[:order])
        evidence = tuple(evidence_of(fit, other.white_share) for fit in fits)
        # The search is worth its time only where it may win: a wrong course asks for modes of its own.
        may_win = min(evidence) < min(models.evidence)
        courses.append((other, _search(other, most_modes, modes) if may_win else Search(fits, evidence)))
    best = min(courses, key=lambda course: min(course[1].evidence))
    least = min(best[1].evidence)
    starts = starts_of(best[1].fits[(modes or max(best[1].order, 1)) - 1])
    # A record that begins within the pulse does not tell half of the momentum from the whole.
    begun = problem.begun and best[0].hold != "impulse"
    possible = [other for other, searched in courses if begun or min(searched.evidence) < least + _POSSIBLY]
    others: list[Fit] = [other.fit(starts) for other in possible if other is not best[0]]
    return *best, others


def _search(problem: Taps | Decays, most_modes: int, modes: int | None) -> Search:
    models = search(problem, modes or most_modes)
    if modes is not None and len(models.fits) < modes:
        raise RecordError(f"{modes} modes are asked for, and the records hold no more than {len(models.fits)}")
    return models


def _result(
    ready: Prepared,
    files: tuple[str, ...],
    problem: Taps | Decays,
    models: Search,
    order: int,
    others: Sequence[Fit],
    accepted_percent: float,
    band_hz: tuple[float, float] | None,
) -> Identification:
    warnings = [*ready.warnings, *(f"{refused.source}: not used: {refused.reason}" for refused in ready.refused)]
    squares = sum(float(np.sum(response**2)) for response in problem.responses)
    without = Identification(
        files=files,
        evidence=dict(enumerate(models.evidence)),
        fit_percent=0.0,
        noise_rms=float(np.sqrt(squares / sum(len(response) for response in problem.responses))),
        reason="no mode stands out of the noise",
        warnings=tuple(warnings),
        notes=(*ready.notes, *_thinned_note(ready, problem, band_hz)),
        prepared=ready,
        chart=stabilisation_chart(chart_poles(problem), problem.period_s),
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
    found = _judged(ready, problem, fit, models, others, accepted_percent, white_share, band_hz)
    supported = tuple(mode for mode in found if not mode.refusal)
    refused = tuple(mode for mode in found if mode.refusal)
    left = float(np.sqrt(fit.sum_of_squares / squares)) if squares > 0.0 else 1.0
    return replace(
        without,
        modes=supported,
        refused=refused,
        order=order,
        fit_percent=100.0 * (1.0 - left),
        noise_rms=float(np.sqrt(fit.sum_of_squares / (fit.samples - fit.parameters))),
        mass_check=_mass_check(problem, fit),
        reason=reason_for(supported, refused),
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


def _judged(
    ready: Prepared,
    problem: Taps | Decays,
    fit: Fit,
    models: Search,
    others: Sequence[Fit],
    accepted_percent: float,
    white_share: float,
    band_hz: tuple[float, float] | None,
) -> list[IdentifiedMode]:
    """The modes of a fit by ascending frequency, without background, each with its refusal where there is one."""
    aliased = _aliased(ready, problem) if isinstance(problem, Taps) else _never_aliased
    is_whole = isinstance(problem, Decays) or problem.thinned is None
    least = (0.0, 0.0) if is_whole else _FILTER_MOVES
    doubts = Doubts(
        limit_percent=accepted_percent,
        band_hz=band_hz or problem.band_hz,
        record_s=max(len(response) for response in problem.responses) * problem.period_s,
        rivals=rivals_of(len(fit.omega_rad_s), models.fits, problem.white_share),
        aliased=aliased,
    )
    found = [
        IdentifiedMode(
            each.frequency_hz,
            each.damping_ratio,
            each.mass_kg,
            each.damping_n_s_per_m,
            each.stiffness_n_per_m,
            refusal_of(each, doubts),
        )
        for each in estimates_of(fit, _alone(problem, fit), others, aliased, white_share, least)
        if not is_background(each, doubts)
    ]
    return sorted(found, key=lambda mode: mode.frequency_hz.value)


def _never_aliased(_frequency_hz: float) -> float:
    return 0.0


def _aliased(ready: Prepared, problem: Taps) -> Callable[[float], float]:
    """Share of the force's spectrum at a frequency that may have been folded down from above half the sampling rate.

    Without an anti-aliasing filter the spectrum does not end before half the rate: what it still has there, beyond
    noise, tells how much came from above. A pulse with kinks, a half sine, falls with the square of the frequency: what
    folds down to the lower frequencies from both sides of the rate is some two thirds of what is left at half of it. A
    force without any noise that runs straight from sample to sample is no recording: it holds nothing else.
    """
    is_simulated = problem.force_noise_n == 0.0 and problem.hold != "band_limited"
    record = ready.records[0]
    least = 0.0 if problem.thinned is None else _FILTER_ERROR
    if problem.hold == "impulse" or is_simulated or record.force_n is None:
        return lambda _hz: least
    pulse = np.trim_zeros(record.force_n)
    spectrum = np.abs(np.fft.rfft(pulse, _SPECTRUM))
    share = np.fft.rfftfreq(_SPECTRUM)
    highest = float(np.sqrt(np.mean(spectrum[share > HIGHEST_SHARE] ** 2)))
    noise = (ready.force_noise_n[0] or 0.0) * np.sqrt(len(pulse))
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
        fits: list[Fit] = [problem.record(index).fit(starts_of(fit)) for index in range(len(problem.responses))]
    except _core.ArgumentError:
        return []
    return fits


def _mass_check(problem: Taps | Decays, fit: Fit) -> MassCheck | None:
    """The equivalent mass by paper 003's way, from the first tap, where the model has one mode.

    Wilson's method shortens the frequency unless its steps are short: force and response are resampled.
    """
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
