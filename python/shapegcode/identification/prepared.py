"""Records of taps or decays that were looked through: those that can be used, what is known of them, and the others."""

from __future__ import annotations

from dataclasses import dataclass

from shapegcode.identification.hits import Hit
from shapegcode.io.record import Record

__all__ = ["Prepared", "Refused"]


@dataclass(frozen=True)
class Refused:
    """A record that is not used.

    Attributes:
        source: which.
        reason: what was found and what is needed.
    """

    source: str
    reason: str


@dataclass(frozen=True, eq=False)
class Prepared:
    """Records that can be used, and what is known of them; tuples have one entry per record.

    Attributes:
        records: without offset; the force is 0 outside the pulse; a free decay from where it begins.
        refused: the others.
        warnings: what the user should know.
        notes: what was left out of the files.
        force_noise_n: RMS noise of the force off the pulse; None: no force.
        response_noise: RMS noise of the response before the hit, in its unit; None: not measured.
        excited_hz: frequency up to which the force excites (-20 dB); None: no force.
        hits: the pulse; None: no force.
    """

    records: tuple[Record, ...]
    refused: tuple[Refused, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    force_noise_n: tuple[float | None, ...]
    response_noise: tuple[float | None, ...]
    excited_hz: tuple[float | None, ...]
    hits: tuple[Hit | None, ...]
