"""Records of taps or decays that were looked through: those that can be used, what is known of them, and the others."""

from __future__ import annotations

from dataclasses import dataclass

from shapegcode.identification.hits import Hit
from shapegcode.io.record import Record


@dataclass(frozen=True)
class Refused:
    """A record that is not used."""

    source: str  # which
    reason: str  # what was found and what is needed


@dataclass(frozen=True, eq=False)
class Prepared:
    """Records that can be used, and what is known of them; tuples have one entry per record."""

    records: tuple[Record, ...]  # without offset; the force is 0 outside the pulse; a free decay from where it begins
    refused: tuple[Refused, ...]  # the others
    warnings: tuple[str, ...]  # what the user should know
    notes: tuple[str, ...]  # what was left out of the files
    force_noise_n: tuple[float | None, ...]  # RMS noise of the force off the pulse; None: no force
    # RMS noise of the response before the hit, in its unit; None: not measured
    response_noise: tuple[float | None, ...]
    excited_hz: tuple[float | None, ...]  # frequency up to which the force excites (-20 dB); None: no force
    hits: tuple[Hit | None, ...]  # the pulse; None: no force
