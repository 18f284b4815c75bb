"""Facts of a controller, each with its interval or with the reason why it is not known, and how two sources join."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

__all__ = ["CUTTING_SUM", "PERIODS_S", "ControllerFact", "Facts", "combine", "mean"]

#: What a stopwatch sees of the acceleration after interpolation.
CUTTING_SUM = "cutting time constant + bell time"
#: Interpolation periods that controls are built with, s.
PERIODS_S = tuple(ms / 1000.0 for ms in (0.125, 0.25, 0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 12, 16))


@dataclass(frozen=True)
class ControllerFact:
    """One quantity.

    Attributes:
        quantity: its name, the same whatever it is found from.
        value: a number, a word, or None if it is not known.
        low: lower end of the 95 % interval; None for a word, and where nothing bounds it.
        high: upper end.
        unit: of value, low and high.
        key: dotted key of the machine file that it goes into; empty: none.
        source: how it was measured, "log" or "stopwatch"; empty: not at all.
        note: what it rests on; for an unknown value, why it is not known.
        assumed: what the machine file had; None where it has no such key.
    """

    quantity: str
    value: float | str | None
    low: float | None
    high: float | None
    unit: str
    key: str
    source: str
    note: str = ""
    assumed: float | str | None = None

    @property
    def width(self) -> float:
        """Of the interval: infinite where the value is not known, 0 for a word."""
        if self.value is None:
            return math.inf
        return 0.0 if self.low is None or self.high is None else self.high - self.low

    def contradicts(self, other: ControllerFact) -> bool:
        """Whether both are numbers whose intervals are apart, or words that differ."""
        if self.value is None or other.value is None:
            return False
        if isinstance(self.value, str) or isinstance(other.value, str):
            # "linear or bell" contains "bell"
            return str(self.value) not in str(other.value) and str(other.value) not in str(self.value)
        if self.low is None or self.high is None or other.low is None or other.high is None:
            return False
        return self.low > other.high or other.low > self.high


@dataclass
class Facts:
    """Collects the facts that one source gives.

    Attributes:
        source: "log" or "stopwatch".
        found: one for each quantity, known or not.
    """

    source: str
    found: list[ControllerFact] = field(default_factory=list)

    def known(self, quantity: str, value: float, half: float, key: str = "", note: str = "", unit: str = "s") -> None:
        """A number with a symmetric interval of half-width *half*, cut off at 0."""
        self.between(quantity, value, max(0.0, value - half), value + half, key, note, unit)

    def between(
        self, quantity: str, value: float, low: float, high: float, key: str = "", note: str = "", unit: str = "s"
    ) -> None:
        """A number with its interval."""
        self.found.append(ControllerFact(quantity, value, low, high, unit, key, self.source, note))

    def said(self, quantity: str, word: str, key: str = "", note: str = "") -> None:
        """A word."""
        self.found.append(ControllerFact(quantity, word, None, None, "", key, self.source, note))

    def unknown(self, quantity: str, why: str, unit: str = "s", high: float | None = None) -> None:
        """A quantity that the data do not determine; *high* is a limit that they do give."""
        self.found.append(ControllerFact(quantity, None, None, high, unit, "", self.source, why))


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


def combine(first: Sequence[ControllerFact], second: Sequence[ControllerFact]) -> list[ControllerFact]:
    """For each quantity the better of two facts: a known one, then the narrower interval.

    Where the two contradict each other, the note says so.
    """
    other = {each.quantity: each for each in second}
    out: list[ControllerFact] = []
    for each in first:
        rival = other.pop(each.quantity, None)
        if rival is None:
            out.append(each)
            continue
        better, worse = (each, rival) if each.width <= rival.width else (rival, each)
        note = better.note
        if better.contradicts(worse):
            shown = worse.value if isinstance(worse.value, str) else f"{worse.value:.6g} {worse.unit}"
            note = f"{note}; the {worse.source} contradicts it: {shown}".removeprefix("; ")
        out.append(replace(better, note=note))
    return [*out, *other.values()]
