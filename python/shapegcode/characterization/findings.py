"""A finding: one fact of the controller, with its interval or with the reason why it is not known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

__all__ = ["CUTTING_SUM", "PERIODS_S", "Finding", "combine", "known", "mean", "unknown"]

#: What a stopwatch sees of the acceleration after interpolation.
CUTTING_SUM = "cutting time constant + bell time"
#: Interpolation periods that controls are built with, s.
PERIODS_S = tuple(ms / 1000.0 for ms in (0.125, 0.25, 0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 16))


@dataclass(frozen=True)
class Finding:
    """One quantity.

    Attributes:
        quantity: its name, the same whatever it is found from.
        value: a number, a word, or None if it is not known.
        low: lower end of the 95 % interval; None for a word, and where nothing bounds it.
        high: upper end.
        unit: of value, low and high.
        key: dotted key of the machine file that it goes into; empty: none.
        source: ``log`` or ``stopwatch``.
        note: what it rests on; for an unknown value, why it is not known.
    """

    quantity: str
    value: float | str | None
    low: float | None
    high: float | None
    unit: str
    key: str
    source: str
    note: str = ""


def known(quantity: str, value: float, half: float, unit: str, key: str, source: str, note: str = "") -> Finding:
    """A number with a symmetric interval of half-width *half*, cut off at 0."""
    return Finding(quantity, value, max(0.0, value - half), value + half, unit, key, source, note)


def unknown(quantity: str, unit: str, source: str, why: str, high: float | None = None) -> Finding:
    """A quantity that the data do not determine; *high* is a limit that they do give."""
    return Finding(quantity, None, None, high, unit, "", source, why)


def mean(values: Sequence[float], halves: Sequence[float]) -> tuple[float, float]:
    """Weighted mean of values with 95 % half-widths, and its half-width; wider where the values disagree."""
    weights = [1.0 / max(half, 1e-9) ** 2 for half in halves]
    total = sum(weights)
    centre = sum(w * v for w, v in zip(weights, values, strict=True)) / total
    half = 1.0 / math.sqrt(total)
    if len(values) > 1:
        chi = sum(w * (v - centre) ** 2 for w, v in zip(weights, values, strict=True)) / (len(values) - 1)
        half *= math.sqrt(max(1.0, 1.96**2 * chi))
    return centre, half


def combine(first: Sequence[Finding], second: Sequence[Finding]) -> list[Finding]:
    """For each quantity the better of two findings: a known one, then the narrower interval.

    Where both are numbers and their intervals are apart, or both are words and differ, the note says so.
    """

    def width(each: Finding) -> float:
        if each.value is None:
            return math.inf
        return 0.0 if each.low is None or each.high is None else each.high - each.low

    other = {each.quantity: each for each in second}
    out: list[Finding] = []
    for each in first:
        rival = other.pop(each.quantity, None)
        if rival is None:
            out.append(each)
            continue
        better, worse = (each, rival) if width(each) <= width(rival) else (rival, each)
        note = better.note
        if better.value is not None and worse.value is not None and _apart(better, worse):
            shown = worse.value if isinstance(worse.value, str) else f"{worse.value:.6g} {worse.unit}"
            note = f"{note}; the {worse.source} contradicts it: {shown}".removeprefix("; ")
        out.append(
            Finding(
                better.quantity, better.value, better.low, better.high, better.unit, better.key, better.source, note
            )
        )
    return [*out, *other.values()]


def _apart(a: Finding, b: Finding) -> bool:
    if isinstance(a.value, str) or isinstance(b.value, str):
        # "linear or bell" contains "bell"
        return str(a.value) not in str(b.value) and str(b.value) not in str(a.value)
    if a.low is None or a.high is None or b.low is None or b.high is None:
        return False
    return a.low > b.high or b.low > a.high
