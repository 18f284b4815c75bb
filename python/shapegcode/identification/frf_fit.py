"""Modes of a frequency response without its time record, each with its 95 % interval, or the reason why not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shapegcode.errors import RecordError
from shapegcode.identification.chart import stabilisation_chart
from shapegcode.identification.frf_model import FrfFit
from shapegcode.identification.frf_problem import FrfProblem, frf_problem_of, refit
from shapegcode.identification.mode import IdentifiedMode
from shapegcode.identification.model_search import Search, chart_poles, evidence_of, evidence_of_none, search
from shapegcode.identification.result import Identification, reason_for
from shapegcode.identification.support import (
    Doubts,
    Estimates,
    estimates_of,
    is_background,
    refusal_of,
    rivals_of,
)
from shapegcode.io.frequency_response import FrequencyResponse

#: A resonance narrower than so many distances of two lines tells its damping by its window, not by its structure.
_LEAST_WIDTH = 1.0
_ROUNDS = 2  # of weights taken from what the model leaves


def find_frf_modes(
    responses: Sequence[FrequencyResponse],
    files: tuple[str, ...],
    *,
    band_hz: tuple[float, float] | None,
    most_modes: int,
    modes: int | None,
    accepted_percent: float,
) -> Identification:
    """Find the modes that frequency responses of the same point support; see `identify.identify`."""
    problem, used = frf_problem_of(responses, band_hz)
    problem, models = _searched(problem, modes or most_modes)
    turned: list[str] = []
    chosen = models.fits[(modes or models.order) - 1] if 0 < (modes or models.order) <= len(models.fits) else None
    if isinstance(chosen, FrfFit) and bool(np.all(chosen.inverse_mass < 0.0)):
        turned.append(
            f"{responses[0].source}: every mode goes against the push of the hammer: the sign is turned, as for a "
            "sensor at the same point that points the other way"
        )
        problem, used = frf_problem_of([replace(each, response=-each.response) for each in responses], band_hz)
        problem, models = _searched(problem, modes or most_modes)
    if modes is not None and len(models.fits) < modes:
        raise RecordError(f"{modes} modes are asked for, and the lines hold no more than {len(models.fits)}")
    order = modes or models.order
    notes = list(dict.fromkeys(note for each in responses for note in each.notes))
    notes.append(
        "a frequency response no longer tells overload, double hits or windows: an exponential window adds its damping"
    )
    fit = models.fits[order - 1] if order else None
    left = problem.left(fit)
    found = [] if fit is None else _judged(problem, fit, models, band_hz, accepted_percent)
    supported = tuple(mode for mode in found if not mode.refusal)
    refused = tuple(mode for mode in found if mode.refusal)
    fitted = problem.lines.response - left if fit is not None else np.zeros_like(left)
    return Identification(
        files=files,
        modes=supported,
        refused=refused,
        order=order,
        evidence=dict(enumerate(models.evidence)),
        fit_percent=0.0 if fit is None else 100.0 * (1.0 - float(np.sqrt(fit.sum_of_squares / problem.squares))),
        noise_rms=float(np.sqrt(np.mean(np.abs(left) ** 2))),
        reason=reason_for(supported, refused),
        warnings=(*dict.fromkeys(warning for each in responses for warning in each.warnings), *turned),
        notes=tuple(notes),
        responses=tuple(used),
        chart=stabilisation_chart(chart_poles(problem), problem.period_s),
        fitted_lines=tuple(np.split(fitted, np.cumsum(problem.counts)[:-1])),
    )


def _searched(problem: FrfProblem, most: int) -> tuple[FrfProblem, Search]:
    """Models of growing order; then the noise is known from what they leave, and they are fitted and judged anew."""
    models = search(problem, most)
    for _ in range(_ROUNDS):
        if not models.fits:
            break
        problem = problem.reweighted(models.fits[max(models.order, 1) - 1])
        fits = refit(problem, models.fits)
        evidence = (evidence_of_none(problem), *(evidence_of(each, problem.white_share) for each in fits))
        models = Search(tuple(fits), evidence)
    return problem, models


def _judged(
    problem: FrfProblem, fit: object, models: Search, band_hz: tuple[float, float] | None, accepted_percent: float
) -> list[IdentifiedMode]:
    """The modes of a fit by ascending frequency, without background, each with its refusal where there is one."""
    assert isinstance(fit, FrfFit)
    doubts = Doubts(
        limit_percent=accepted_percent,
        band_hz=band_hz or problem.band_hz,
        record_s=problem.duration_s,
        rivals=rivals_of(len(fit.omega_rad_s), models.fits, problem.white_share),
    )
    found = [
        IdentifiedMode(
            each.frequency_hz,
            each.damping_ratio,
            each.mass_kg,
            each.damping_n_s_per_m,
            each.stiffness_n_per_m,
            _too_narrow(each, problem.resolution_hz) or refusal_of(each, doubts),
        )
        for each in estimates_of(fit, (), white_share=problem.white_share)
        if not is_background(each, doubts)
    ]
    return sorted(found, key=lambda mode: mode.frequency_hz.value)


def _too_narrow(mode: Estimates, resolution_hz: float) -> str:
    """Why lines so far apart do not tell the damping; empty if they do."""
    width = 2.0 * mode.damping_ratio.value * mode.frequency_hz.value
    if width >= _LEAST_WIDTH * resolution_hz:
        return ""
    return (
        f"its half-power width of {width:.3g} Hz is less than the {resolution_hz:.3g} Hz between two lines: window and "
        "length of the record make such a peak; needed is a finer resolution, or the time record"
    )
