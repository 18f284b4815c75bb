"""What the feeds in a log tell: their unit, and the overrides at which a run was cut."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode.characterization.clock.played import PlayedProgram
from shapegcode.characterization.runs_file import RunEntry
from shapegcode.errors import RecordError
from shapegcode.io.run_log import RunLog, Signal
from shapegcode.io.units import find_unit

__all__ = [
    "LEAST_READINGS",
    "Stretch",
    "as_dialled",
    "feed_unit",
    "held_longest",
    "line_numbers",
    "lines_at",
    "stretches_of",
]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

FEED_UNITS = {"mm/s": 1.0, "mm/min": 1.0 / 60.0, "in/min": 25.4 / 60.0}
"""mm/s of the units that a feed is tried in where none is stated."""

LEAST_READINGS = 4
"""So many readings of one value are no chance."""

_FEED_BIN = 0.0025  # of the programmed feed: readings of a steady feed agree better
_LEAST_SHARE = 0.06
_LEAST_OVERRIDE, _MOST_OVERRIDE = 0.2, 2.0
_STEPS = (1.0, 0.5, 0.1, 1.0 / 60.0, 0.01, 0.001)  # in which controls show feeds


@dataclass(frozen=True)
class Stretch:
    """A section of a run without functions.

    Attributes:
        lines: first and last.
        feed_override: ratio at which it was cut.
        measured: whether that was seen in the log, else it is taken from the run or as 1.
    """

    lines: tuple[int, int]
    feed_override: float
    measured: bool


def line_numbers(log: RunLog, played: PlayedProgram) -> IntArray:
    """Lines of the text from what the log counts."""
    value = np.asarray(log.block.value, dtype=np.int64)
    if log.block_counts == "line":
        return value
    found, at = np.zeros(len(value), dtype=np.int64), 0
    for index, sequence_number in enumerate(value.tolist()):
        ahead = [place for place in played.sequence_lines.get(sequence_number, []) if place >= at]
        if ahead:
            at = found[index] = ahead[0]
    return found


def lines_at(signal: Signal, log: RunLog, played: PlayedProgram) -> IntArray:
    """Line that was reported when a value came."""
    line = line_numbers(log, played)
    at = np.searchsorted(log.block.time_s, signal.time_s, side="right") - 1
    return np.clip(np.where(at >= 0, line[np.maximum(at, 0)], 0), 0, played.line_count + 1)


def held_longest(signal: Signal, end_s: float | None) -> float:
    """The value that a signal had for the longest time."""
    held: dict[float, float] = defaultdict(float)
    until = np.append(signal.time_s[1:], end_s if end_s is not None else signal.time_s[-1])
    for value, begin, end in zip(signal.value, signal.time_s, until, strict=True):
        held[round(float(value), 3)] += max(0.0, float(end - begin))
    return max(held, key=lambda value: held[value])


def feed_unit(entry: RunEntry, log: RunLog, played: PlayedProgram) -> float:
    """The unit of the logged feed: as stated, else the one in which steady cuts run as programmed."""
    if log.feed is None or len(log.feed) < LEAST_READINGS:
        return math.nan
    line = lines_at(log.feed, log, played)
    ratio = log.feed.value / played.feed_mm_per_s[line]
    ratio = ratio[np.isfinite(ratio) & (ratio > 0.0)]
    steady = steady_value(np.log(ratio)) if len(ratio) else None
    name = entry.feed_unit or log.feed_unit
    stated = find_unit(name) if name is not None else None
    if steady is None:
        return float(stated.factor) * 1000.0 if stated is not None else math.nan
    # An override is between a half and twice the programmed feed: units lie further apart.
    units = [float(stated.factor) * 1000.0] if stated is not None else list(FEED_UNITS.values())
    best = min(units, key=lambda unit: abs(steady + math.log(unit)))
    if abs(steady + math.log(best)) > math.log(2.0):
        tried = name if stated is not None else f"no unit of {', '.join(FEED_UNITS)}"
        raise RecordError(
            f"{log.source}: steady feeds of {entry.program.name} are {math.exp(steady):.4g} times the programmed ones "
            f"in mm/s: {tried} does not make that an override of 50 to 200 %; the log is of another program, the "
            "program in another unit (G20, G21), or feed_unit must be stated"
            + (" otherwise" if stated is not None else "")
        )
    return best


def steady_value(values: FloatArray) -> float | None:
    """Where values heap up."""
    ordered = np.sort(values)
    upto = np.searchsorted(ordered, ordered + _FEED_BIN, side="right")
    count = upto - np.arange(len(ordered))
    most = int(count.max())
    if most < LEAST_READINGS or most < _LEAST_SHARE * len(values):
        return None
    at = int(np.argmax(count))
    return float(np.median(ordered[at : at + most]))


def stretches_of(entry: RunEntry, log: RunLog, played: PlayedProgram, unit: float, notes: list[str]) -> list[Stretch]:
    """Feed override of each section: what steady cuts show, else what is stated, else that of the run, else 1."""
    ratio = np.empty(0)
    line = np.empty(0, dtype=np.int64)
    if log.feed is not None and math.isfinite(unit):
        line = lines_at(log.feed, log, played)
        ratio = log.feed.value * unit / played.feed_mm_per_s[line]
        # A control shows feeds in steps: where one is much of the feed, it tells nothing.
        fine = played.feed_mm_per_s[line] * _FEED_BIN > _step_of(log.feed.value) * unit
        keep = np.isfinite(ratio) & (ratio > 0.0) & played.free[line] & fine
        ratio, line = ratio[keep], line[keep]
    whole = steady_value(ratio) if len(ratio) else None
    stated = entry.override_percent / 100.0 if entry.override_percent is not None else None
    if stated is None and log.feed_override is not None and len(log.feed_override):
        stated = held_longest(log.feed_override, log.duration_s)
    found = []
    for first, last in played.sections:
        inside = ratio[(line >= first) & (line <= last) & (ratio >= _LEAST_OVERRIDE) & (ratio <= _MOST_OVERRIDE)]
        seen = steady_value(inside) if len(inside) else None
        fallback = stated if stated is not None else whole
        value = seen if seen is not None else fallback if fallback is not None else 1.0
        found.append(Stretch((first, last), as_dialled(value), seen is not None))
    used = sorted({stretch.feed_override for stretch in found if stretch.measured})
    if any(abs(value - 1.0) > 0.005 for value in used):
        notes.append("feed override " + ", ".join(f"{value:.1%}" for value in used) + " as steady cuts show")
    if ratio.size == 0 and stated is None:
        notes.append("no feed in the log: overrides cannot be told and are taken as 100 %")
    return found


def _step_of(values: FloatArray) -> float:
    """The step in which values are shown: the largest usual one that all of them are multiples of; 0: none is."""
    for step in _STEPS:
        if np.all(np.abs(values / step - np.round(values / step)) < 1e-3):
            return step
    return 0.0


def as_dialled(ratio: float) -> float:
    """As a dial has it: whole percents where they are within what a reading means."""
    whole = round(ratio, 2)
    return whole if abs(ratio - whole) < 0.002 else round(ratio, 4)
