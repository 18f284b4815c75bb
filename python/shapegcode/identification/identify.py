"""A tap test or a decay from its files to its modes: read, looked through, identified."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shapegcode.errors import ArgumentError, NumericError, RecordError
from shapegcode.identification.checks import prepare
from shapegcode.identification.fit import find_modes
from shapegcode.identification.frf_fit import find_frf_modes
from shapegcode.identification.prepared import Prepared
from shapegcode.identification.result import Identification
from shapegcode.identification.support import ACCEPTED_PERCENT
from shapegcode.identification.sweep import find_swept_modes
from shapegcode.io.data_file import open_file
from shapegcode.io.frequency_response import FrequencyResponse
from shapegcode.io.read import read_measurement
from shapegcode.io.record import Quantity, ReadOptions, Record
from shapegcode.io.sampling import UnevenTimeError, even_period
from shapegcode.io.taps import is_klipper, read_sweep

MOST_MODES = 8
"""Largest number of modes that is tried unless asked otherwise."""
_LARGEST_MODEL = 99
_LEAST_SAMPLES = 3


def identify(
    source: str | Path | Sequence[str | Path] | Sequence[Record] | Sequence[FrequencyResponse] | ArrayLike,
    response: ArrayLike | ReadOptions | None = None,
    force: ArrayLike | None = None,
    *,
    options: ReadOptions | None = None,
    quantity: Quantity = "acceleration",
    most_modes: int = MOST_MODES,
    modes: int | None = None,
    band_hz: tuple[float, float] | None = None,
    start_s: float | None = None,
    accepted_percent: float = ACCEPTED_PERCENT,
    strict: bool = True,
) -> Identification:
    """Modes in one or several taps of a point (with force), in free decays (without), or in frequency responses.

    Args:
        source: a file (CSV, UFF, WAV, MATLAB), several files, records or frequency responses; of one point and axis.
            With `response`: the instants of its samples in s, shape (n,), evenly spaced.
        response: what a sensor measured at these instants, shape (n,), in the unit of `quantity`. Read options are
            taken here too.
        force: of the hammer at these instants in N, shape (n,); None: a free decay.
        options: what the files do not say.
        quantity: of `response`: "acceleration" in m/s², "velocity" in m/s or "displacement" in m.
        most_modes: largest number of modes that is tried.
        modes: number of modes; None: chosen by evidence.
        band_hz: lowest and highest frequency of interest; None: all.
        start_s: time at which a decay begins; None: it is looked for.
        accepted_percent: a mode is refused whose damping ratio or stiffness is less certain than this (95 %).
        strict: raise where no record can be used; False: the result says it, in `reason`.

    Returns:
        The modes with their uncertainties, those that were refused and why, and how well they fit.

    Raises:
        ArgumentError: a number of modes that is not from 1 to 99.
        RecordError: no record can be used; what was found and what is needed.
        OSError: a file cannot be read.

    Source: Back, Ko and Kim, 2003 (paper 003 in docs/evidence/references.md) for its ARMA models; the fit in
    time, intervals and refusals are this project's.
    """
    for name, number in (("most_modes", most_modes), ("modes", modes)):
        if number is not None and not 1 <= number <= _LARGEST_MODEL:
            raise ArgumentError(f"{name} = {number}: must be from 1 to {_LARGEST_MODEL}")
    if isinstance(response, ReadOptions):
        options, response = response, None
    if response is not None:
        source = [_record_of(source, response, force, quantity)]
    elif force is not None:
        raise ArgumentError("force is given without a response: identify(time_s, response, force)")
    sources: Sequence[Any] = [source] if isinstance(source, str | Path) else source  # type: ignore[assignment]
    names = tuple(str(each) if isinstance(each, str | Path) else each.source for each in sources)
    ready: Prepared | None = None
    try:
        swept = _swept(sources, options or ReadOptions())
        if swept is not None:
            return find_swept_modes(swept, names, band_hz=band_hz, most_modes=most_modes, modes=modes)
        records: list[Record] = []
        responses: list[FrequencyResponse] = []
        for each in sources:
            for one in [each] if isinstance(each, Record | FrequencyResponse) else read_measurement(each, options):
                if isinstance(one, Record):
                    records.append(one)
                else:
                    responses.append(one)
        if responses and records:
            raise RecordError(
                f"{responses[0].source} is a frequency response, {records[0].source} a record over time: identify them "
                "apart"
            )
        if responses:
            return find_frf_modes(
                responses, names, band_hz=band_hz, most_modes=most_modes, modes=modes, accepted_percent=accepted_percent
            )
        ready = prepare(records, band_hz=None if band_hz is None else band_hz[1], start_s=start_s)
        return find_modes(
            ready, names, band_hz=band_hz, most_modes=most_modes, modes=modes, accepted_percent=accepted_percent
        )
    except (ArgumentError, NumericError) as error:
        if strict:
            raise
        if ready is None:
            return Identification(files=names, reason=str(error))
        return Identification(
            files=names, prepared=ready, reason=str(error), warnings=ready.warnings, notes=ready.notes
        )


def _record_of(time_s: Any, response: ArrayLike, force: ArrayLike | None, quantity: Quantity) -> Record:
    """Arrays as a record."""
    times = np.asarray(time_s, dtype=np.float64)
    samples = np.asarray(response, dtype=np.float64)
    if times.shape != samples.shape or times.ndim != 1 or len(times) < _LEAST_SAMPLES:
        raise RecordError(
            f"arrays: {times.shape} instants and {samples.shape} samples of the response: one of each is needed, at "
            f"least {_LEAST_SAMPLES}"
        )
    if not np.isfinite(times).all():
        raise RecordError(f"arrays: instant {np.flatnonzero(~np.isfinite(times))[0]} is not finite")
    try:
        period_s, warnings = even_period(times)
    except UnevenTimeError as error:
        raise RecordError(f"arrays: {error}") from None
    hammer = None if force is None else np.asarray(force, dtype=np.float64)
    start_s = float(times[0])
    return Record("arrays", period_s, samples, quantity, hammer, start_s=start_s, warnings=tuple(warnings))


def _swept(sources: Sequence[object], options: ReadOptions) -> Record | None:
    """The record of a resonance sweep, if that is what the file holds; None: it is anything else."""
    paths = [Path(each) for each in sources if isinstance(each, str | Path)]
    found = [path for path in paths if path.is_file() and is_klipper(_beginning(path))]
    if not found or options.ignore_force:
        return None
    if len(sources) > 1:
        raise RecordError(f"{found[0]}: a sweep is identified alone: one file at a time")
    return read_sweep(found[0], options)


def _beginning(path: Path) -> bytes:
    with open_file(path) as file:
        return file.read(400)
