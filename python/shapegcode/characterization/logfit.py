"""What servo logs of the test programs say about a controller."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from shapegcode.characterization.facts import PERIODS_S, ControllerFact, mean
from shapegcode.characterization.hold import bend_samples, held_samples
from shapegcode.characterization.moves import PartLog, line_slope, parts_of
from shapegcode.characterization.plan import AXES, AirTest
from shapegcode.characterization.servofit import fit_servo
from shapegcode.characterization.shapefit import LogFacts, fit_cutting, fit_rapids
from shapegcode.characterization.timing import whole_periods
from shapegcode.io.servo_log import ServoLog

__all__ = ["fit_logs"]

_FOLLOWED = 0.9
_RUN_SETTLE_S = 0.45
_STEPS_SETTLE_S = 0.3

_Interval = tuple[float, float]  # a value and its half-width


def fit_logs(tests: Mapping[str, AirTest], logs: Mapping[str, ServoLog]) -> list[ControllerFact]:
    """Fit everything that the logs hold."""
    bend = bend_samples(list(logs.values()))
    parts = {name: parts_of(log, tests[name], bend) for name, log in logs.items()}
    facts = LogFacts()
    stops = [part for part in parts.get("log_cutting", []) if part.part.pattern == "dwell"]
    run = parts.get("log_run", [])
    _period(facts, logs, stops, run, bend)
    stop_pitch: float | None = None
    if stops:
        fit_cutting(facts, stops)
        stop_pitch = _dwells(facts, stops[0])
    else:
        facts.unknown("cutting time constant", "needs log_cutting")
    _runs(facts, run, parts.get("log_blocks", []))
    rapids = {
        axis: fit_rapids(facts, axis, parts[f"log_rapid_{axis.lower()}"])
        for axis in AXES
        if f"log_rapid_{axis.lower()}" in parts
    }
    _waits(facts, _in_position(facts, parts.get("log_exact", []), stop_pitch), rapids)
    _feed_steps(facts, parts.get("log_feed_steps", []))
    fit_servo(facts, logs)
    return facts.found


def _period(facts: LogFacts, logs: Mapping[str, ServoLog], stops: list[PartLog], run: list[PartLog], bend: int) -> None:
    """Interpolation period: from a held command, else from moves just below and just above whole periods."""
    name, key = "interpolation period", "controller.interpolation_period_s"
    count, sampling = min((held_samples(log)[0], log.sampling_s) for log in logs.values())
    facts.sampling = sampling
    note = f"the command changes every {count} samples"
    if count == 1 and bend > 1:
        facts.bent = True
        count, note = bend, f"the speed of the command changes every {bend} samples"
    if count > 1:
        facts.period, facts.held = round(count * sampling, 6), True
        facts.known(name, facts.period, 1e-3 * facts.period, key, note)
        return
    for found in (_period_of_stops(stops), _period_of_run(run, sampling)):
        if found is not None:
            facts.period, half, note = found
            facts.known(name, facts.period, half, key, note)
            return
    why = f"not longer than the {sampling * 1e3:g} ms between samples, or interpolated between periods"
    if len(stops) < 2 or not run:
        why += "; log_cutting and log_run together may tell"
    facts.unknown(name, why)


def _period_of_stops(stops: list[PartLog]) -> tuple[float, float, str] | None:
    """Of the usual periods the one that rounds two durations so far apart; its half-width and a note."""
    if len(stops) < 2:
        return None
    (below, half_b), (above, half_a) = stops[0].pitch_s(), stops[1].pitch_s()
    short, long = stops[0].part.duration_s, stops[1].part.duration_s
    step, half = above - below, math.hypot(half_a, half_b) + 1e-4
    expected = {t: whole_periods(long, t) - whole_periods(short, t) for t in PERIODS_S}
    fits = [t for t, e in expected.items() if abs(e - step) <= half and t > long - short]
    if step <= (long - short) + half or len(fits) != 1:
        return None
    return fits[0], half, f"moves of {short * 1e3:.2f} and {long * 1e3:.2f} ms differ by {step * 1e3:.2f} ms"


def _period_of_run(run: list[PartLog], sampling: float) -> tuple[float, float, str] | None:
    """Of the usual periods the one to which the blocks of a run are rounded; its half-width and a note."""
    steady = line_slope(run[0], _RUN_SETTLE_S) if run else None
    if steady is None:
        return None
    part = run[0].part
    lasts = abs(part.length_mm) / steady[0]
    slack = lasts * steady[1] / steady[0] + 2e-5
    fits = [t for t in PERIODS_S if abs(whole_periods(part.duration_s, t) - lasts) <= slack and t <= 1.01 * sampling]
    if lasts - part.duration_s <= 2.0 * slack or len(fits) != 1:
        return None
    note = f"blocks of {part.duration_s * 1e3:.2f} ms last {lasts * 1e3:.2f} ms, and no longer period shows"
    return fits[0], slack, note


def _dwells(facts: LogFacts, part: PartLog) -> float:
    """Whether the control waits for in-position before a dwell; returns the pitch of the moves without the dwell."""
    pitch, half = part.pitch_s()
    moving = pitch - whole_periods(part.part.dwell_s, facts.tick)
    if facts.stop_s is not None:
        extra = moving - whole_periods(part.part.duration_s, facts.tick) - facts.stop_s
        waits = extra > 2.0 * (half + facts.cutting_half) + 1.5 * (facts.period or 0.004)
        facts.said("in-position wait before a dwell", f"yes, {extra * 1e3:.1f} ms" if waits else "no")
    return moving


def _in_position(facts: LogFacts, parts: list[PartLog], stop_pitch: float | None) -> dict[str, _Interval]:
    """In-position time of each axis from exact stops."""
    out = {}
    for part in parts:
        pitch, half = part.pitch_s()
        if facts.stop_s is not None:
            moving = whole_periods(part.part.duration_s, facts.tick) + facts.stop_s
            half = half + facts.cutting_half + (0.0 if facts.period else 0.002)
        elif stop_pitch is not None:
            moving = stop_pitch
            half *= 2.0
        else:
            continue
        out[part.part.axis] = (pitch - moving, half)
    return out


def _waits(facts: LogFacts, stops: dict[str, _Interval], rapids: dict[str, list[_Interval]]) -> None:
    """In-position times: after rapids, compared with those after exact stops."""
    for axis in AXES:
        name, key = f"in-position time {axis}", f"controller.in_position_s.{axis.lower()}"
        after, stop = rapids.get(axis, []), stops.get(axis)
        if not after and stop is None:
            facts.unknown(name, f"needs log_exact or log_rapid_{axis.lower()}")
            continue
        value, half = mean(*zip(*after, strict=True)) if after else (0.0, math.inf)
        note = "after rapids"
        if stop is not None and not after:
            value, half, note = *stop, "after exact stops"
        elif stop is not None:
            if abs(stop[0] - value) > stop[1] + half + (facts.period or 0.001):
                note += f"; after exact stops {stop[0] * 1e3:.1f} ms"
            else:
                value, half = mean([value, stop[0]], [half, stop[1]])
                note = "after rapids and exact stops"
        if value < -half:
            facts.unknown(name, f"{value * 1e3:.1f} ms: the next move begins too early")
        else:
            facts.known(name, max(value, 0.0), half, key, note)


def _runs(facts: LogFacts, run: list[PartLog], blocks: list[PartLog]) -> None:
    """Ceil or carry from the mean time of long blocks; the block time from short ones."""
    settle = (facts.cutting or 0.1) * (4.5 if facts.exponential else 1.1)
    end = None
    if run:
        end = _block_end(facts, run[0], settle)
    else:
        facts.unknown("block end", "needs log_run", "")
    if blocks:
        _block_time(facts, blocks[0], settle, end)
    else:
        facts.unknown("block time", "needs log_blocks")


def _block_end(facts: LogFacts, run: PartLog, settle: float) -> str | None:
    part = run.part
    nominal = part.duration_s
    speed, half = line_slope(run, settle) or (abs(part.length_mm) / nominal, math.inf)
    lasts = abs(part.length_mm) / speed
    note = f"blocks of {nominal * 1e3:.2f} ms last {lasts * 1e3:.2f} ms"
    full = whole_periods(nominal, facts.period) - nominal if facts.period else None
    slack = lasts * half / speed + 1e-5
    end = None
    if lasts - nominal > 3.0 * slack and (full is None or abs(lasts - nominal - full) < 0.3 * full + slack):
        end = "ceil"
    elif full is not None and abs(lasts - nominal) < 0.3 * full and slack < 0.3 * full:
        end = "carry"
    if end:
        facts.said("block end", end, "controller.block_end", note)
    else:
        facts.unknown("block end", note + ": neither fits, or the period is not known", "")
    return end


def _block_time(facts: LogFacts, blocks: PartLog, settle: float, end: str | None) -> None:
    name, part = "block time", blocks.part
    lasting = f"blocks of {part.duration_s * 1e3:.2f} ms"
    steady = line_slope(blocks, settle)
    if steady is None:
        facts.unknown(name, f"{lasting} are over before the speed is steady: it is short")
        return
    speed, half = steady
    lasts = abs(part.length_mm) / speed
    slack = lasts * half / speed
    floor = part.duration_s
    if facts.period and end != "carry":
        floor = whole_periods(part.duration_s, facts.period)
    if lasts <= 1.02 * floor + slack:
        why = f"{lasting} last {lasts * 1e3:.2f} ms: it hides behind the period"
        facts.unknown(name, why, high=lasts + slack)
        return
    if facts.exponential:
        slack += 0.005 * lasts  # the tail of the start
    facts.known(name, lasts, slack, "controller.block_time_s", f"{lasting} last so long")


def _feed_steps(facts: LogFacts, parts: list[PartLog]) -> None:
    """The shortest distance over which the speed follows a step of the feed between F and F/2 by 90 %."""
    name = f"feed-control interval at F{parts[0].part.feed_mm_per_min:g}" if parts else "feed-control interval"
    if not parts:
        facts.unknown(name, "needs log_feed_steps", "mm")
        return
    depths = {abs(log.part.length_mm): depth for log in parts if (depth := _followed_share(log)) is not None}
    followed = [d for d in depths if all(depths[e] >= _FOLLOWED for e in depths if e >= d)]
    shown = ", ".join(f"{d:g} mm {max(0.0, min(1.0, depths[d])) * 100:.0f} %" for d in sorted(depths))
    if not followed:
        facts.unknown(name, f"no distance that fits into the box is followed: {shown}", "mm")
        return
    best = min(followed)
    below = max((d for d in depths if d < best), default=0.0)
    facts.between(name, best, below, best, "", f"followed: {shown}", "mm")


def _followed_share(log: PartLog) -> float | None:
    """How much of the step the speed follows; None where nothing of the way is steady."""
    part = log.part
    top = int(np.argmax(log.way_mm))  # the turn, which smoothing cuts short
    begin = log.times_s[int(np.argmax(log.way_mm > max(0.02, 5 * log.noise_mm)))]
    settle = min(_STEPS_SETTLE_S, 0.25 * (log.times_s[top] - begin))
    inside = (log.times_s > begin + settle) & (log.times_s < log.times_s[top] - settle)
    pitch = float(np.median(np.diff(log.times_s)))
    width = max(1, round(min(0.02, 0.25 * part.duration_s) / pitch))
    speed = (log.way_mm[width:] - log.way_mm[:-width]) / (log.times_s[width:] - log.times_s[:-width])
    seen = speed[inside[width:] & inside[:-width]]
    if not len(seen):
        return None
    noise = 2.0 * log.noise_mm * math.sqrt(2.0) / (width * pitch)
    swing = float(np.percentile(seen, 99.0) - np.percentile(seen, 1.0)) - noise
    return swing / (part.feed_mm_per_min / 120.0)
