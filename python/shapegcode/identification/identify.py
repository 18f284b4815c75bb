"""A tap test or a decay from its files to its modes: read, looked through, identified, reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shapegcode._core import ArgumentError, NumericError
from shapegcode.identification import fit
from shapegcode.identification.checks import Prepared, prepare
from shapegcode.identification.mode import IdentifiedMode
from shapegcode.identification.result import Identification
from shapegcode.io.read import ReadOptions, read_records
from shapegcode.io.record import Record

__all__ = ["MOST_MODES", "TapTest", "identify", "tap_test"]

MOST_MODES = 8
"""Largest number of modes that is tried unless asked otherwise."""


@dataclass(frozen=True, eq=False)
class TapTest:
    """A tap test, or a decay, with its result.

    Attributes:
        files: as named.
        prepared: taps or decays that were used, and those that were not; None: the files hold none that can be.
        found: the result; None: none.
        reason: why there is no mode; empty: there is.
    """

    files: tuple[str, ...]
    prepared: Prepared | None
    found: Identification | None
    reason: str = ""

    @property
    def records(self) -> tuple[Record, ...]:
        """Taps or decays that were used."""
        return () if self.prepared is None else self.prepared.records

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know of the records and of the result."""
        if self.found is not None:
            return self.found.warnings
        return () if self.prepared is None else self.prepared.warnings

    @property
    def modes(self) -> tuple[IdentifiedMode, ...]:
        """Those that the data support."""
        return () if self.found is None else self.found.modes

    @property
    def refused(self) -> tuple[IdentifiedMode, ...]:
        """Those that stand out but are not supported."""
        return () if self.found is None else self.found.refused

    @property
    def axis(self) -> str | None:
        """Along which it was measured; None: the files do not say."""
        return self.records[0].axis if self.records else None

    @property
    def is_decay(self) -> bool:
        """Whether no force was measured."""
        return bool(self.records) and self.records[0].force_n is None

    @property
    def source(self) -> str:
        """Where the modes come from, for the machine file."""
        names = ", ".join(Path(file).name for file in self.files)
        if self.is_decay:
            return f"free decay {names}"
        taps = len(self.records)
        return f"tap test {names}, {taps} {'tap' if taps == 1 else 'taps'}"

    def report(self) -> dict[str, Any]:
        """Everything as plain values; the keys are stable."""
        found = self.found
        return {
            "files": list(self.files),
            "axis": self.axis,
            "decay": self.is_decay,
            "modes": [mode.as_dict() for mode in self.modes],
            "refused": [mode.as_dict() for mode in self.refused],
            "records": self._records(),
            "order": 0 if found is None else found.order,
            "evidence": {} if found is None else {str(order): value for order, value in sorted(found.evidence.items())},
            "fit_percent": None if found is None else found.fit_percent,
            "noise_rms": None if found is None else found.noise_rms,
            "checks": {} if found is None else dict(found.checks),
            "warnings": list(self.warnings),
            "reason": self.reason,
        }

    def _records(self) -> list[dict[str, Any]]:
        if self.prepared is None:
            return []
        used = [
            {
                "source": record.source,
                "used": True,
                "reason": "",
                "samples": len(record.response),
                "period_s": record.period_s,
                "start_s": record.start_s,
                "quantity": record.quantity,
                "excited_hz": excited,
            }
            for record, excited in zip(self.prepared.records, self.prepared.excited_hz, strict=True)
        ]
        return used + [{"source": each.source, "used": False, "reason": each.reason} for each in self.prepared.refused]


def tap_test(
    files: Sequence[str | Path],
    options: ReadOptions | None = None,
    *,
    most_modes: int = MOST_MODES,
    modes: int | None = None,
    band_hz: tuple[float, float] | None = None,
    start_s: float | None = None,
) -> TapTest:
    """Identify the modes in the files of one tap test, or of one decay.

    What makes a result impossible is told in it; only a file that cannot be read at all is an error.

    Args:
        files: records of one point and axis.
        options: what the files do not say.
        most_modes: largest number of modes that is tried.
        modes: number of modes; None: chosen by evidence.
        band_hz: lowest and highest frequency of interest; None: all.
        start_s: time at which a decay begins; None: it is looked for.

    Raises:
        OSError: a file cannot be read.
    """
    names = tuple(str(file) for file in files)
    prepared = None
    try:
        prepared = _prepared(files, options, band_hz, start_s)
        found = fit.identify(prepared.records, band_hz=band_hz, most_modes=most_modes, modes=modes, prepared=prepared)
    except (ArgumentError, NumericError) as error:
        return TapTest(names, prepared, None, str(error))
    return TapTest(names, prepared, found, "" if found.modes else _nothing(found))


def identify(
    source: str | Path | Sequence[str | Path] | Sequence[Record],
    options: ReadOptions | None = None,
    *,
    most_modes: int = MOST_MODES,
    modes: int | None = None,
    band_hz: tuple[float, float] | None = None,
    start_s: float | None = None,
) -> Identification:
    """Modes in one or several taps of a point (with force), or in free decays (without).

    Args:
        source: a file (CSV, UFF, WAV), several files, or records.
        options: what the files do not say; see `tap_test` for the others.
        most_modes: largest number of modes that is tried.
        modes: number of modes; None: chosen by evidence.
        band_hz: lowest and highest frequency of interest; None: all.
        start_s: time at which a decay begins; None: it is looked for.

    Returns:
        The modes with their uncertainties, those that were refused and why, and how well they fit.

    Raises:
        RecordError: no record can be used; what was found and what is needed.
        OSError: a file cannot be read.
    """
    files = [source] if isinstance(source, str | Path) else source
    prepared = _prepared(files, options, band_hz, start_s)
    return fit.identify(prepared.records, band_hz=band_hz, most_modes=most_modes, modes=modes, prepared=prepared)


def _prepared(
    sources: Sequence[str | Path] | Sequence[Record],
    options: ReadOptions | None,
    band_hz: tuple[float, float] | None,
    start_s: float | None,
) -> Prepared:
    """Files read, records checked.

    Raises:
        RecordError: none can be used.
        OSError: a file cannot be read.
    """
    records: list[Record] = []
    for each in sources:
        records += [each] if isinstance(each, Record) else read_records(each, options)
    return prepare(records, band_hz=None if band_hz is None else band_hz[1], start_s=start_s)


def _nothing(found: Identification) -> str:
    """Why there is no mode."""
    if not found.refused:
        return "no mode stands out of the noise"
    return "no mode is supported: " + "; ".join(
        f"{mode.frequency_hz.value:.4g} Hz: {mode.refusal}" for mode in found.refused
    )
