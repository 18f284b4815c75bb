"""What servo logs of the test programs say about a controller."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from shapegcode.characterization.findings import CUTTING_SUM, PERIODS_S, Finding, known, mean, unknown
from shapegcode.characterization.log import ServoLog
from shapegcode.characterization.logstate import BELL_GAIN, ODD_SHAPE, SOURCE, State, pitch_of
from shapegcode.characterization.moves import (
    PartLog,
    ShapeFit,
    bend_samples,
    fit_shape,
    held_samples,
    lagged_share,
    line_slope,
    parts_of,
    smoothed_share,
)
from shapegcode.characterization.plan import AXES, Test
from shapegcode.characterization.rapidfit import fit_rapids
from shapegcode.characterization.servofit import fit_servo
from shapegcode.characterization.timing import whole_periods

__all__ = ["fit_logs"]

Array = npt.NDArray[np.float64]
_FOLLOWED = 0.9
_RUN_SETTLE_S = 0.45
_STEPS_SETTLE_S = 0.3


def _period(state: State, logs: Mapping[str, ServoLog], parts: Mapping[str, list[PartLog]], bend: int) -> None:
    """Interpolation period: from a held command, else from moves just below and just above whole periods."""
    name, key = "interpolation period", "controller.interpolation_period_s"
    holds = [(held_samples(log)[0], log.sampling_s) for log in logs.values()]
    count, sampling = min(holds)
    state.sampling = sampling
    note = f"the command changes every {count} samples"
    if count == 1 and bend > 1:
        state.bent = True
        count, note = bend, f"the speed of the command changes every {bend} samples"
    if count > 1:
        period = round(count * sampling, 6)
        state.period, state.held = period, True
        state.findings.append(known(name, period, 1e-3 * period, "s", key, SOURCE, note))
        return
    stops = [part for part in parts.get("log_cutting", []) if part.part.pattern == "dwell"]
    if len(stops) >= 2:
        (below, half_b), (above, half_a) = pitch_of(stops[0]), pitch_of(stops[1])
        short, long = stops[0].part.duration_s, stops[1].part.duration_s
        step, half = above - below, math.hypot(half_a, half_b) + 1e-4
        expected = {t: whole_periods(long, t) - whole_periods(short, t) for t in PERIODS_S}
        fits = [t for t, e in expected.items() if abs(e - step) <= half and t > long - short]
        if step > (long - short) + half and len(fits) == 1:
            state.period = fits[0]
            note = f"moves of {short * 1e3:.2f} and {long * 1e3:.2f} ms differ by {step * 1e3:.2f} ms"
            state.findings.append(known(name, fits[0], half, "s", key, SOURCE, note))
            return
    run = parts.get("log_run", [])
    steady = line_slope(run[0], _RUN_SETTLE_S) if run else None
    if run and steady is not None:
        part = run[0].part
        lasts = abs(part.length_mm) / steady[0]
        slack = lasts * steady[1] / steady[0] + 2e-5
        fits = [
            t for t in PERIODS_S if abs(whole_periods(part.duration_s, t) - lasts) <= slack and t <= 1.01 * sampling
        ]
        if lasts - part.duration_s > 2.0 * slack and len(fits) == 1:
            state.period = fits[0]
            note = f"blocks of {part.duration_s * 1e3:.2f} ms last {lasts * 1e3:.2f} ms, and no longer period shows"
            state.findings.append(known(name, fits[0], slack, "s", key, SOURCE, note))
            return
    why = f"not longer than the {sampling * 1e3:g} ms between samples, or interpolated between periods"
    if len(stops) < 2 or not run:
        why += "; log_cutting and log_run together may tell"
    state.findings.append(unknown(name, "s", SOURCE, why))


def _smoothed(times: Array, boxes: Array) -> Array:
    return smoothed_share(times, boxes.tolist())


def _lagged(times: Array, values: Array) -> Array:
    return lagged_share(times, float(values[0]), float(values[1]))


def _cutting(state: State, stops: list[PartLog]) -> None:
    """Time constant and bell time from the shape of moves between stops."""
    names = ("cutting time constant", "cutting bell time")
    fits: dict[str, list[ShapeFit]] = {}
    for part in stops[:2]:
        nominal = part.part.duration_s
        longest = nominal + (state.period or 0.004) * 1.1
        shapes = {
            "linear": ([nominal, 0.05], [nominal * 0.95, 1e-4], [longest, 1.0]),
            "bell": ([nominal, 0.06, 0.02], [nominal * 0.95, 1e-4, 1e-5], [longest, 1.0, 0.5]),
            "exponential": ([nominal, 0.03], [nominal * 0.95, 1e-4], [longest, 1.0]),
        }
        for shape, (guess, low, high) in shapes.items():
            share = _lagged if shape == "exponential" else _smoothed
            fits.setdefault(shape, []).append(fit_shape(part, share, guess, low, high))
    rms = {shape: math.sqrt(sum(fit.rms_mm**2 for fit in each) / len(each)) for shape, each in fits.items()}
    best = "exponential" if rms["exponential"] < min(rms["linear"], rms["bell"]) else "linear"
    bell = [sorted(fit.values[1:])[0] for fit in fits["bell"]]
    fine = state.fine_s
    if best == "linear" and rms["bell"] ** 2 < BELL_GAIN * rms["linear"] ** 2 and min(bell) > fine:
        best = "bell"
    length = abs(stops[0].part.length_mm)
    if rms[best] > ODD_SHAPE * length + 3.0 * stops[0].noise_mm:
        why = (
            f"no moving average and no exponential: the best fit ({best}) leaves {rms[best] * 1e3:.1f} µm; "
            "was a look-ahead mode on?"
        )
        state.findings += [unknown(name, "s", SOURCE, why) for name in names]
        return
    chosen = fits[best]
    pairs = [sorted(zip(fit.values[1:].tolist(), fit.half[1:].tolist(), strict=True), reverse=True) for fit in chosen]
    value, half = mean([pair[0][0] for pair in pairs], [pair[0][1] for pair in pairs])
    note = {"linear": "linear", "bell": "the longer of two moving averages", "exponential": "exponential"}[best]
    state.findings.append(known(names[0], value, half, "s", "controller.time_constant_s", SOURCE, note))
    shape_key = "controller.after_interpolation_shape"
    state.findings.append(Finding("cutting acceleration shape", best, None, None, "", shape_key, SOURCE))
    state.exponential = best == "exponential"
    state.cutting, state.cutting_half = value, half
    if best == "bell":
        second, second_half = mean([pair[1][0] for pair in pairs], [pair[1][1] for pair in pairs])
        state.findings.append(known(names[1], second, second_half, "s", "controller.bell_time_s", SOURCE))
        state.cutting, state.cutting_half = value + second, math.hypot(half, second_half)
    elif best == "linear":
        note = "no second moving average shows"
        state.findings.append(
            Finding(names[1], 0.0, 0.0, max(fine, 0.002), "s", "controller.bell_time_s", SOURCE, note)
        )


def _sum(state: State) -> None:
    """The sum of both times, which is what a stopwatch sees."""
    if state.cutting is not None and not state.exponential:
        state.findings.append(known(CUTTING_SUM, state.cutting, state.cutting_half, "s", "", SOURCE))


def _dwells(state: State, stops: list[PartLog]) -> None:
    """Pitch of the moves with a dwell, and whether the control waits for in-position before a dwell."""
    part = stops[0]
    pitch, half = pitch_of(part)
    period = state.period or 1e-6
    state.stop_pitch = pitch - whole_periods(part.part.dwell_s, period)
    if state.cutting is None or state.exponential:
        return
    extra = state.stop_pitch - whole_periods(part.part.duration_s, period) - state.cutting
    waits = extra > 2.0 * (half + state.cutting_half) + 1.5 * (state.period or 0.004)
    word = f"yes, {extra * 1e3:.1f} ms" if waits else "no"
    state.findings.append(Finding("in-position wait before a dwell", word, None, None, "", "", SOURCE))


def _in_position(state: State, parts: list[PartLog]) -> dict[str, tuple[float, float]]:
    """In-position time of each axis from exact stops."""
    out = {}
    for part in parts:
        pitch, half = pitch_of(part)
        if state.cutting is not None and not state.exponential:
            moving = whole_periods(part.part.duration_s, state.period or 1e-6) + state.cutting
            half = half + state.cutting_half + (0.0 if state.period else 0.002)
        elif state.stop_pitch is not None:
            moving = state.stop_pitch
            half *= 2.0
        else:
            continue
        out[part.part.axis] = (pitch - moving, half)
    return out


def _waits(state: State, stops: dict[str, tuple[float, float]], rapids: dict[str, list[tuple[float, float]]]) -> None:
    """In-position times: after rapids, compared with those after exact stops."""
    for axis in AXES:
        name, key = f"in-position time {axis}", f"controller.in_position_s.{axis.lower()}"
        after = rapids.get(axis, [])
        stop = stops.get(axis)
        if not after and stop is None:
            state.findings.append(unknown(name, "s", SOURCE, f"needs log_exact or log_rapid_{axis.lower()}"))
            continue
        value, half = mean([each[0] for each in after], [each[1] for each in after]) if after else (0.0, math.inf)
        note = "after rapids"
        if stop is not None and not after:
            value, half, note = *stop, "after exact stops"
        elif stop is not None:
            if abs(stop[0] - value) > stop[1] + half + (state.period or 0.001):
                note += f"; after exact stops {stop[0] * 1e3:.1f} ms"
            else:
                value, half = mean([value, stop[0]], [half, stop[1]])
                note = "after rapids and exact stops"
        if value < -half:
            state.findings.append(unknown(name, "s", SOURCE, f"{value * 1e3:.1f} ms: the next move begins too early"))
        else:
            state.findings.append(known(name, max(value, 0.0), half, "s", key, SOURCE, note))


def _runs(state: State, run: list[PartLog], blocks: list[PartLog]) -> None:
    """Ceil or carry from the mean time of long blocks; the block time from short ones."""
    rule, name = "block end", "block time"
    settle = (state.cutting or 0.1) * (4.5 if state.exponential else 1.1)
    if not run:
        state.findings.append(unknown(rule, "", SOURCE, "needs log_run"))
    else:
        part = run[0].part
        nominal = part.duration_s
        speed, half = line_slope(run[0], settle) or (abs(part.length_mm) / nominal, math.inf)
        lasts = abs(part.length_mm) / speed
        note = f"blocks of {nominal * 1e3:.2f} ms last {lasts * 1e3:.2f} ms"
        full = whole_periods(nominal, state.period) - nominal if state.period else None
        slack = lasts * half / speed + 1e-5
        if lasts - nominal > 3.0 * slack and (full is None or abs(lasts - nominal - full) < 0.3 * full + slack):
            state.end = "ceil"
        elif full is not None and abs(lasts - nominal) < 0.3 * full and slack < 0.3 * full:
            state.end = "carry"
        if state.end:
            state.findings.append(Finding(rule, state.end, None, None, "", "controller.block_end", SOURCE, note))
        else:
            state.findings.append(unknown(rule, "", SOURCE, note + ": neither fits, or the period is not known"))
    if not blocks:
        state.findings.append(unknown(name, "s", SOURCE, "needs log_blocks"))
        return
    part = blocks[0].part
    steady = line_slope(blocks[0], settle)
    if steady is None:
        why = f"blocks of {part.duration_s * 1e3:.2f} ms are over before the speed is steady: it is short"
        state.findings.append(unknown(name, "s", SOURCE, why))
        return
    speed, half = steady
    lasts = abs(part.length_mm) / speed
    slack = lasts * half / speed
    floor = part.duration_s
    if state.period and state.end != "carry":
        floor = whole_periods(part.duration_s, state.period)
    if lasts <= 1.02 * floor + slack:
        why = f"blocks of {part.duration_s * 1e3:.2f} ms last {lasts * 1e3:.2f} ms: it hides behind the period"
        state.findings.append(unknown(name, "s", SOURCE, why, high=lasts + slack))
        return
    if state.exponential:
        slack += 0.005 * lasts  # the tail of the start
    note = f"blocks of {part.duration_s * 1e3:.2f} ms last so long"
    state.findings.append(known(name, lasts, slack, "s", "controller.block_time_s", SOURCE, note))


def _feed_steps(state: State, parts: list[PartLog]) -> None:
    """The shortest distance over which the speed follows a step of the feed between F and F/2 by 90 %."""
    name = f"feed-control interval at F{parts[0].part.feed_mm_per_min:g}" if parts else "feed-control interval"
    if not parts:
        state.findings.append(unknown(name, "mm", SOURCE, "needs log_feed_steps"))
        return
    depths: dict[float, float] = {}
    for log in parts:
        part = log.part
        distance = abs(part.length_mm)
        top = int(np.argmax(log.way_mm))  # the turn, which smoothing cuts short
        begin = log.times_s[int(np.argmax(log.way_mm > max(0.02, 5 * log.noise_mm)))]
        settle = min(_STEPS_SETTLE_S, 0.25 * (log.times_s[top] - begin))
        inside = (log.times_s > begin + settle) & (log.times_s < log.times_s[top] - settle)
        pitch = float(np.median(np.diff(log.times_s)))
        width = max(1, round(min(0.02, 0.25 * part.duration_s) / pitch))
        speed = (log.way_mm[width:] - log.way_mm[:-width]) / (log.times_s[width:] - log.times_s[:-width])
        seen = speed[inside[width:] & inside[:-width]]
        if len(seen):
            noise = 2.0 * log.noise_mm * math.sqrt(2.0) / (width * pitch)
            swing = float(np.percentile(seen, 99.0) - np.percentile(seen, 1.0)) - noise
            depths[distance] = swing / (part.feed_mm_per_min / 120.0)
    followed = [d for d in depths if all(depths[e] >= _FOLLOWED for e in depths if e >= d)]
    shown = ", ".join(f"{d:g} mm {max(0.0, min(1.0, depths[d])) * 100:.0f} %" for d in sorted(depths))
    if not followed:
        why = f"no distance that fits into the box is followed: {shown}"
        state.findings.append(unknown(name, "mm", SOURCE, why))
        return
    best = min(followed)
    below = max((d for d in depths if d < best), default=0.0)
    state.findings.append(Finding(name, best, below, best, "mm", "", SOURCE, f"followed: {shown}"))


def fit_logs(tests: Mapping[str, Test], logs: Mapping[str, ServoLog]) -> list[Finding]:
    """Fit everything that the logs hold.

    Args:
        tests: what the programs did, by name.
        logs: the record of each test that was logged, by name.

    Raises:
        ArgumentError: a log is not that of its test.
    """
    bend = bend_samples(list(logs.values()))
    parts = {name: parts_of(log, tests[name], bend) for name, log in logs.items()}
    state = State()
    _period(state, logs, parts, bend)
    stops = [part for part in parts.get("log_cutting", []) if part.part.pattern == "dwell"]
    if stops:
        _cutting(state, stops)
        _sum(state)
        _dwells(state, stops)
    else:
        state.findings.append(unknown("cutting time constant", "s", SOURCE, "needs log_cutting"))
    _runs(state, parts.get("log_run", []), parts.get("log_blocks", []))
    rapids = {
        axis: fit_rapids(state, axis, parts[f"log_rapid_{axis.lower()}"])
        for axis in AXES
        if f"log_rapid_{axis.lower()}" in parts
    }
    _waits(state, _in_position(state, parts.get("log_exact", [])), rapids)
    _feed_steps(state, parts.get("log_feed_steps", []))
    fit_servo(state, logs)
    return state.findings
