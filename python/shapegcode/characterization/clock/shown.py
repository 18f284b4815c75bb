"""What the feeds in logs show directly: the rate of rapids, and the acceleration across the path in arcs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from shapegcode.characterization.clock.observed import ObservedRun
from shapegcode.characterization.clock.played import PlayedProgram
from shapegcode.characterization.clock.readings import LEAST_READINGS, as_dialled, lines_at

__all__ = ["rapid_rate", "seen_arc_acceleration", "with_override"]

FloatArray = npt.NDArray[np.float64]

_LIMITED = 0.9  # of the programmed feed: below it something else than the program sets the speed
_LEAST_ARC_READINGS = 12
_DIALS = (1.0, 0.75, 0.5, 0.25, 0.1, 0.05)  # where a dial of rapids usually stands


def seen_arc_acceleration(runs: Sequence[ObservedRun]) -> float:
    """What the feeds shown in arcs say of the largest acceleration across the path: v²/r where v is below the feed."""
    found: list[FloatArray] = []
    for run in runs:
        log, played = run.log, run.played
        if log.feed is None or not math.isfinite(run.feed_unit_mm_per_s):
            continue
        line = lines_at(log.feed, log, played)
        speed = log.feed.value * run.feed_unit_mm_per_s
        radius = played.arc_radius_mm[line]
        feed = played.feed_mm_per_s[line]
        inside = np.isfinite(radius) & np.isfinite(feed) & (speed > 0.0)
        for each, programmed in {
            (round(float(r), 1), float(f)) for r, f in zip(radius[inside], feed[inside], strict=True)
        }:
            group = inside & (np.round(radius, 1) == each) & (feed == programmed)
            # A reading may fall upon a corner or a ramp: the steady speed is the one that is hardly passed.
            top = float(np.percentile(speed[group], 90))
            if group.sum() >= LEAST_READINGS and top < _LIMITED * programmed:
                found.append(np.full(int(group.sum()), top**2 / float(np.median(radius[group]))))
    every = np.concatenate(found) if found else np.empty(0)
    return float(np.median(every)) if len(every) >= _LEAST_ARC_READINGS else math.nan


def rapid_rate(runs: Sequence[ObservedRun]) -> tuple[float, list[ObservedRun]]:
    """Rapid rate of the machine and the override of each run, from the feeds that its logs show in rapids.

    A rate shows as the highest feed that returns again and again. Where runs show several, the highest one, or one that
    a usual place of the dial makes of it, is the machine's.
    """
    shown = {id(run): _shown_rate(run) for run in runs}
    plateaus = [plateau for plateau, _ in shown.values() if math.isfinite(plateau)]
    if not plateaus:
        return math.nan, [with_override(run, math.nan) for run in runs]
    top = max(plateaus)
    fastest = max(single for _, single in shown.values())
    stated = [run for run in runs if math.isfinite(run.rapid_override) and math.isfinite(shown[id(run)][0])]
    rate = top
    if stated:
        rate = float(np.median([shown[id(run)][0] / run.rapid_override for run in stated if run.rapid_override > 0]))
    elif fastest > 1.05 * top:
        rate = next((top / dial for dial in _DIALS if top / dial >= 0.98 * fastest), fastest)
    return rate, [with_override(run, rate) for run in runs]


def with_override(run: ObservedRun, rate_mm_per_s: float) -> ObservedRun:
    """A run with the override of its rapids: as stated, else as its rapids show it, else 1."""
    if math.isfinite(run.rapid_override):
        return run
    plateau = _shown_rate(run)[0]
    if not (math.isfinite(plateau) and math.isfinite(rate_mm_per_s)):
        return _with_rapids(run, 1.0)
    return _with_rapids(run, as_dialled(min(1.0, plateau / rate_mm_per_s)))


def _with_rapids(run: ObservedRun, override: float) -> ObservedRun:
    notes = (*run.notes, f"rapid override {override:.0%} as its rapids show") if override < 0.99 else run.notes
    return replace(run, rapid_override=override, notes=notes)


def _shown_rate(run: ObservedRun) -> tuple[float, float]:
    """Feed at which rapids run steadily, and the highest one of a way along Z alone; NaN and 0 where none is seen."""
    log, played = run.log, run.played
    if log.feed is None or not math.isfinite(run.feed_unit_mm_per_s):
        return math.nan, 0.0
    line = lines_at(log.feed, log, played)
    moving = np.isnan(played.feed_mm_per_s[line]) & (line > 0)
    value = log.feed.value[moving] * run.feed_unit_mm_per_s
    if not len(value):
        return math.nan, 0.0
    single = _along_z(played)[line[moving]]
    alone = value[single]
    high = value[value > 0.3 * value.max()]
    ordered = np.sort(high)
    upto = np.searchsorted(ordered, ordered * 1.003, side="right")
    count = upto - np.arange(len(ordered))
    steady = np.flatnonzero(count >= LEAST_READINGS)
    plateau = float(np.median(ordered[steady[np.argmax(count[steady])] :][: count.max()])) if len(steady) else math.nan
    return plateau, float(alone.max()) if len(alone) else 0.0


def _along_z(played: PlayedProgram) -> npt.NDArray[np.bool_]:
    """Lines whose only axis word is Z."""
    alone = np.zeros(played.line_count + 2, dtype=bool)
    for number, words in enumerate(played.text_lines[: played.line_count], start=1):
        plain = words.split("(")[0].upper()
        alone[number] = "Z" in plain and "X" not in plain and "Y" not in plain
    return alone
