"""A tap test or a decay from its files to its modes: read, looked through, identified."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from shapegcode.errors import ArgumentError, NumericError
from shapegcode.identification.checks import prepare
from shapegcode.identification.fit import find_modes
from shapegcode.identification.prepared import Prepared
from shapegcode.identification.result import Identification
from shapegcode.identification.support import ACCEPTED_PERCENT
from shapegcode.io.read import ReadOptions, read_records
from shapegcode.io.record import Record

__all__ = ["MOST_MODES", "identify"]

MOST_MODES = 8
"""Largest number of modes that is tried unless asked otherwise."""
_LARGEST_MODEL = 99


def identify(
    source: str | Path | Sequence[str | Path] | Sequence[Record],
    options: ReadOptions | None = None,
    *,
    most_modes: int = MOST_MODES,
    modes: int | None = None,
    band_hz: tuple[float, float] | None = None,
    start_s: float | None = None,
    accepted_percent: float = ACCEPTED_PERCENT,
    strict: bool = True,
) -> Identification:
    """Modes in one or several taps of a point (with force), or in free decays (without).

    Args:
        source: a file (CSV, UFF, WAV), several files, or records, all of one point and axis.
        options: what the files do not say.
        most_modes: largest number of modes that is tried.
        modes: number of modes; None: chosen by evidence.
        band_hz: lowest and highest frequency of interest; None: all.
        start_s: time at which a decay begins; None: it is looked for.
        accepted_percent: a mode is refused whose damping ratio or stiffness is less certain than this (95 %).
        strict: raise where no record can be used; False: the result says it, in `reason`.

    Returns:
        The modes that the data support, and those that they do not, each with the reason.

    Returns:
        The modes with their uncertainties, those that were refused and why, and how well they fit.

    Raises:
        ArgumentError: a number of modes that is not from 1 to 99.
        RecordError: no record can be used; what was found and what is needed.
        OSError: a file cannot be read.

    Source: Back, Ko and Kim, 2003 (paper 003 in docs/references.md) for the ARMA models that it starts from; the fit in
    time, intervals and refusals are this project's.
    """
    for name, number in (("most_modes", most_modes), ("modes", modes)):
        if number is not None and not 1 <= number <= _LARGEST_MODEL:
            raise ArgumentError(f"{name} = {number}: must be from 1 to {_LARGEST_MODEL}")
    sources = [source] if isinstance(source, str | Path) else source
    names = tuple(each.source if isinstance(each, Record) else str(each) for each in sources)
    ready: Prepared | None = None
    try:
        records: list[Record] = []
        for each in sources:
            records += [each] if isinstance(each, Record) else read_records(each, options)
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
