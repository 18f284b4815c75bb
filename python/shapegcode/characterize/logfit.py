"""What servo logs of the test programs say about a controller."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from shapegcode.characterize.findings import CUTTING_SUM, PERIODS_S, Finding, known, mean, unknown
from shapegcode.characterize.log import ServoLog
from shapegcode.characterize.moves import (
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
from shapegcode.characterize.plan import AXES, Test
from shapegcode.characterize.timing import whole_periods

__all__ = ["fit_logs"]

Array = npt.NDArray[np.float64]
_SOURCE = "log"
_ODD_SHAPE = 0.002  # of the way: a fit that leaves more is no fit
_BELL_GAIN = 0.8  # a second moving average must lower the variance below this share
_FOLLOWED = 0.9
_SERVO_SLACK = 0.02
_FINE = 1.7  # periods
_FINE_BENT = 1.0
_GAINS = (2.0, 1000.0)  # 1/s
_RUN_SETTLE_S = 0.45
_STEPS_SETTLE_S = 0.3


@dataclass
class _State:
    """What is known so far; times in s."""

    period: float | None = None
    held: bool = False
    bent: bool = False
    sampling: float = 0.001
    end: str | None = None
    cutting: float | None = None
    cutting_half: float = 0.0
    exponential: bool = False
    stop_pitch: float | None = None
    findings: list[Finding] = field(default_factory=list)

    @property
    def fine_s(self) -> float:
        """A second moving average up to this length may be interpolation between unseen periods."""
        if self.bent and self.period:
            return _FINE_BENT * self.period
        return 0.0 if self.held else _FINE * max(self.period or 0.0, 2.0 * self.sampling)


def _pitch(part: PartLog) -> tuple[float, float]:
    """Mean time from one move to the next, and its 95 % half-width."""
    steps = np.diff(part.middles_s())
    spread = float(steps.std(ddof=1)) if len(steps) > 1 else 0.001
    return float(steps.mean()), 1.96 * max(spread, 2e-5) / math.sqrt(len(steps))


def _period(state: _State, logs: Mapping[str, ServoLog], parts: Mapping[str, list[PartLog]], bend: int) -> None:
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
        state.findings.append(known(name, period, 1e-3 * period, "s", key, _SOURCE, note))
        return
    stops = [part for part in parts.get("log_cutting", []) if part.part.pattern == "dwell"]
    if len(stops) >= 2:
        (below, half_b), (above, half_a) = _pitch(stops[0]), _pitch(stops[1])
        short, long = stops[0].part.duration_s, stops[1].part.duration_s
        step, half = above - below, math.hypot(half_a, half_b) + 1e-4
        expected = {t: whole_periods(long, t) - whole_periods(short, t) for t in PERIODS_S}
        fits = [t for t, e in expected.items() if abs(e - step) <= half and t > long - short]
        if step > (long - short) + half and len(fits) == 1:
            state.period = fits[0]
            note = f"moves of {short * 1e3:.2f} and {long * 1e3:.2f} ms differ by {step * 1e3:.2f} ms"
            state.findings.append(known(name, fits[0], half, "s", key, _SOURCE, note))
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
            state.findings.append(known(name, fits[0], slack, "s", key, _SOURCE, note))
            return
    why = f"not longer than the {sampling * 1e3:g} ms between samples, or interpolated between periods"
    if len(stops) < 2 or not run:
        why += "; log_cutting and log_run together may tell"
    state.findings.append(unknown(name, "s", _SOURCE, why))


def _smoothed(times: Array, boxes: Array) -> Array:
    return smoothed_share(times, boxes.tolist())


def _lagged(times: Array, values: Array) -> Array:
    return lagged_share(times, float(values[0]), float(values[1]))


def _cutting(state: _State, stops: list[PartLog]) -> None:
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
    if best == "linear" and rms["bell"] ** 2 < _BELL_GAIN * rms["linear"] ** 2 and min(bell) > fine:
        best = "bell"
    length = abs(stops[0].part.length_mm)
    if rms[best] > _ODD_SHAPE * length + 3.0 * stops[0].noise_mm:
        why = (
            f"no moving average and no exponential: the best fit ({best}) leaves {rms[best] * 1e3:.1f} µm; "
            "was a look-ahead mode on?"
        )
        state.findings += [unknown(name, "s", _SOURCE, why) for name in names]
        return
    chosen = fits[best]
    pairs = [sorted(zip(fit.values[1:].tolist(), fit.half[1:].tolist(), strict=True), reverse=True) for fit in chosen]
    value, half = mean([pair[0][0] for pair in pairs], [pair[0][1] for pair in pairs])
    note = {"linear": "linear", "bell": "the longer of two moving averages", "exponential": "exponential"}[best]
    state.findings.append(known(names[0], value, half, "s", "controller.time_constant_s", _SOURCE, note))
    shape_key = "controller.after_interpolation_shape"
    state.findings.append(Finding("cutting acceleration shape", best, None, None, "", shape_key, _SOURCE))
    state.exponential = best == "exponential"
    state.cutting, state.cutting_half = value, half
    if best == "bell":
        second, second_half = mean([pair[1][0] for pair in pairs], [pair[1][1] for pair in pairs])
        state.findings.append(known(names[1], second, second_half, "s", "controller.bell_time_s", _SOURCE))
        state.cutting, state.cutting_half = value + second, math.hypot(half, second_half)
    elif best == "linear":
        note = "no second moving average shows"
        state.findings.append(
            Finding(names[1], 0.0, 0.0, max(fine, 0.002), "s", "controller.bell_time_s", _SOURCE, note)
        )


def _sum(state: _State) -> None:
    """The sum of both times, which is what a stopwatch sees."""
    if state.cutting is not None and not state.exponential:
        state.findings.append(known(CUTTING_SUM, state.cutting, state.cutting_half, "s", "", _SOURCE))


def _dwells(state: _State, stops: list[PartLog]) -> None:
    """Pitch of the moves with a dwell, and whether the control waits for in-position before a dwell."""
    part = stops[0]
    pitch, half = _pitch(part)
    period = state.period or 1e-6
    state.stop_pitch = pitch - whole_periods(part.part.dwell_s, period)
    if state.cutting is None or state.exponential:
        return
    extra = state.stop_pitch - whole_periods(part.part.duration_s, period) - state.cutting
    waits = extra > 2.0 * (half + state.cutting_half) + 1.5 * (state.period or 0.004)
    word = f"yes, {extra * 1e3:.1f} ms" if waits else "no"
    state.findings.append(Finding("in-position wait before a dwell", word, None, None, "", "", _SOURCE))


def _in_position(state: _State, parts: list[PartLog]) -> dict[str, tuple[float, float]]:
    """In-position time of each axis from exact stops."""
    out = {}
    for part in parts:
        pitch, half = _pitch(part)
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


@dataclass(frozen=True)
class _Rapid:
    """Fit of one part of rapids; s."""

    long: bool
    ramp: tuple[float, float]
    bell: tuple[float, float] | None
    wait: tuple[float, float]
    nominal: float
    rms_mm: float


def _rapid(part: PartLog, period: float, fine_s: float) -> _Rapid:
    """The shape of rapids over one length, as a long move (the rate is reached) or a short one."""
    nominal = part.part.duration_s
    rectangle = whole_periods(nominal, period)
    found: list[tuple[ShapeFit, bool, bool]] = []
    for bell, ramp_guess in itertools.product((None, 0.005, 0.03, 0.08), (0.06, 0.15)):
        begin = math.sqrt(nominal * ramp_guess)
        tail, low, high = ([], [], []) if bell is None else ([bell], [1e-5], [0.5])
        fit = fit_shape(
            part,
            lambda t, p: smoothed_share(t, [p[0], p[0], *p[1:]]),
            [begin, *tail],
            [0.1 * begin, *low],
            [20.0 * begin, *high],
        )
        found.append((fit, False, bell is not None))
        fit = fit_shape(
            part,
            lambda t, p: smoothed_share(t, [rectangle, *p]),
            [0.7 * rectangle, *tail],
            [1e-4, *low],
            [1.05 * rectangle, *high],
        )
        found.append((fit, True, bell is not None))
    plain = min((each for each in found if not each[2]), key=lambda each: each[0].rms_mm)
    curved = min((each for each in found if each[2]), key=lambda each: each[0].rms_mm)
    better = curved[0].rms_mm ** 2 < _BELL_GAIN * plain[0].rms_mm ** 2
    fit, long, bell_found = curved if better and curved[0].values[1] > fine_s else plain
    values = list(zip(fit.values.tolist(), fit.half.tolist(), strict=True))
    if long:
        values.sort(reverse=True)
    ramp, bell_value = values[0], values[1] if bell_found else None
    moving = (rectangle if long else ramp[0]) + ramp[0] + (bell_value[0] if bell_value else 0.0)
    slack = (1.0 if long else 2.0) * ramp[1] + (bell_value[1] if bell_value else 0.0)
    pitch, half = _pitch(part)
    return _Rapid(long, ramp, bell_value, (pitch - moving, half + slack), nominal, fit.rms_mm)


def _rapids(state: _State, axis: str, parts: list[PartLog]) -> list[tuple[float, float]]:
    """Time constants of an axis' rapids; returns the in-position times that they show."""
    period = state.period or 1e-6
    lower = axis.lower()
    name, bell_name = f"rapid time constant {axis}", f"rapid bell time {axis}"
    every = [_rapid(part, period, state.fine_s) for part in parts]
    fits = [fit for fit, part in zip(every, parts, strict=True) if fit.rms_mm < _ODD_SHAPE * abs(part.part.length_mm)]
    if not fits:
        why = f"the rapids are no constant acceleration: the best fit leaves {every[0].rms_mm * 1e3:.1f} µm"
        state.findings += [unknown(each, "s", _SOURCE, why) for each in (name, bell_name)]
        return []
    long = [fit for fit in fits if fit.long]
    key = f"controller.rapid_time_constant_s.{lower}"
    if long:
        value, half = mean([fit.ramp[0] for fit in long], [fit.ramp[1] for fit in long])
        state.findings.append(known(name, value, half, "s", key, _SOURCE, "ramp of rapids that reach the rate"))
    else:
        # half the move lasts ceil(sqrt(nominal * A) / T) T
        halves = [(whole_periods(fit.ramp[0] - 0.3 * period, period), fit) for fit in fits]
        sure = [(half, fit) for half, fit in halves if abs(half - fit.ramp[0]) + fit.ramp[1] < 0.3 * period]
        slack = 0.0 if sure and state.period else 1e-4
        pairs = sure if slack == 0.0 else [(fit.ramp[0], fit) for fit in fits]
        low = max((half - slack - period) ** 2 / fit.nominal for half, fit in pairs)
        high = min((half + slack) ** 2 / fit.nominal for half, fit in pairs)
        if low <= high:
            note = "no rapid reaches the rate: from their acceleration, in whole periods"
            state.findings.append(Finding(name, (low + high) / 2.0, low, high, "s", key, _SOURCE, note))
        else:
            why = "rapids of different length have different accelerations; is the rate in the machine file right?"
            state.findings.append(unknown(name, "s", _SOURCE, why))
    bells = [fit.bell for fit in fits if fit.bell is not None]
    bell_key = f"controller.rapid_bell_time_s.{lower}"
    if len(bells) * 2 > len(fits):
        value, half = mean([each[0] for each in bells], [each[1] for each in bells])
        state.findings.append(known(bell_name, value, half, "s", bell_key, _SOURCE))
    else:
        note = "no second moving average shows"
        state.findings.append(Finding(bell_name, 0.0, 0.0, max(state.fine_s, 0.002), "s", bell_key, _SOURCE, note))
    return [fit.wait for fit in fits]


def _waits(state: _State, stops: dict[str, tuple[float, float]], rapids: dict[str, list[tuple[float, float]]]) -> None:
    """In-position times: after rapids, compared with those after exact stops."""
    for axis in AXES:
        name, key = f"in-position time {axis}", f"controller.in_position_s.{axis.lower()}"
        after = rapids.get(axis, [])
        stop = stops.get(axis)
        if not after and stop is None:
            state.findings.append(unknown(name, "s", _SOURCE, f"needs log_exact or log_rapid_{axis.lower()}"))
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
            state.findings.append(unknown(name, "s", _SOURCE, f"{value * 1e3:.1f} ms: the next move begins too early"))
        else:
            state.findings.append(known(name, max(value, 0.0), half, "s", key, _SOURCE, note))


def _runs(state: _State, run: list[PartLog], blocks: list[PartLog]) -> None:
    """Ceil or carry from the mean time of long blocks; the block time from short ones."""
    rule, name = "block end", "block time"
    settle = (state.cutting or 0.1) * (4.5 if state.exponential else 1.1)
    if not run:
        state.findings.append(unknown(rule, "", _SOURCE, "needs log_run"))
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
            state.findings.append(Finding(rule, state.end, None, None, "", "controller.block_end", _SOURCE, note))
        else:
            state.findings.append(unknown(rule, "", _SOURCE, note + ": neither fits, or the period is not known"))
    if not blocks:
        state.findings.append(unknown(name, "s", _SOURCE, "needs log_blocks"))
        return
    part = blocks[0].part
    steady = line_slope(blocks[0], settle)
    if steady is None:
        why = f"blocks of {part.duration_s * 1e3:.2f} ms are over before the speed is steady: it is short"
        state.findings.append(unknown(name, "s", _SOURCE, why))
        return
    speed, half = steady
    lasts = abs(part.length_mm) / speed
    slack = lasts * half / speed
    floor = part.duration_s
    if state.period and state.end != "carry":
        floor = whole_periods(part.duration_s, state.period)
    if lasts <= 1.02 * floor + slack:
        why = f"blocks of {part.duration_s * 1e3:.2f} ms last {lasts * 1e3:.2f} ms: it hides behind the period"
        state.findings.append(unknown(name, "s", _SOURCE, why, high=lasts + slack))
        return
    if state.exponential:
        slack += 0.005 * lasts  # the tail of the start
    note = f"blocks of {part.duration_s * 1e3:.2f} ms last so long"
    state.findings.append(known(name, lasts, slack, "s", "controller.block_time_s", _SOURCE, note))


def _feed_steps(state: _State, parts: list[PartLog]) -> None:
    """The shortest distance over which the speed follows a step of the feed between F and F/2 by 90 %."""
    name = f"feed-control interval at F{parts[0].part.feed_mm_per_min:g}" if parts else "feed-control interval"
    if not parts:
        state.findings.append(unknown(name, "mm", _SOURCE, "needs log_feed_steps"))
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
        state.findings.append(unknown(name, "mm", _SOURCE, why))
        return
    best = min(followed)
    below = max((d for d in depths if d < best), default=0.0)
    state.findings.append(Finding(name, best, below, best, "mm", "", _SOURCE, f"followed: {shown}"))


def _servo(state: _State, logs: Mapping[str, ServoLog]) -> None:
    """Position gain K and feed-forward f: e = −K ∫e dt + (1 − f) x + c, fitted to following error e and command x."""
    done = False
    for index, axis in enumerate(AXES):
        records = [each for log in logs.values() if (each := _servo_rows(log, index)) is not None]
        if not records:
            continue
        done = True
        name = f"position gain {axis}"
        gain, rest = _lag_of(records)
        if rest < 0.02 or not 2.0 * _GAINS[0] < gain < 0.5 * _GAINS[1]:
            why = "the actual position follows the command without a lag that tells it"
            state.findings.append(unknown(name, "1/s", _SOURCE, why))
            continue
        spread = np.std(np.array([_lag_of([record]) for record in records]), axis=0) / math.sqrt(len(records))
        # Command and actual position may be sampled up to half a sample apart, which looks like lag.
        apart = 0.5 * min(log.sampling_s for log in logs.values()) * gain
        key = f"controller.position_gain_per_s.{axis.lower()}"
        half = float(spread[0]) + (_SERVO_SLACK + apart / rest) * gain
        state.findings.append(known(name, gain, half, "1/s", key, _SOURCE))
        half = float(spread[1]) + _SERVO_SLACK + apart
        forward_key = f"controller.feed_forward_ratio.{axis.lower()}"
        state.findings.append(known(f"feed-forward {axis}", max(0.0, 1.0 - rest), half, "1", forward_key, _SOURCE))
    if not done:
        state.findings.append(unknown("position gain", "1/s", _SOURCE, "no actual positions in the logs"))


def _servo_rows(log: ServoLog, index: int) -> tuple[Array, Array, float] | None:
    """Command, following error and time step, one row for each held command so that its stairs are no error."""
    if log.actual_mm is None or np.isnan(log.actual_mm[0, index]) or np.isnan(log.command_mm[0, index]):
        return None
    count, first = held_samples(log)
    n = (len(log.times_s) - first) // count

    def rows(values: Array) -> Array:
        return np.asarray(values[first : first + n * count].reshape(n, count).mean(axis=1))

    way = rows(log.command_mm[:, index] - log.command_mm[0, index])
    if np.ptp(way) < 1.0:
        return None
    error = way - rows(log.actual_mm[:, index] - log.actual_mm[0, index])
    step = count * log.sampling_s
    return way, error - np.median(error[: max(3, round(0.1 / step))]), step


def _lag_of(records: list[tuple[Array, Array, float]]) -> tuple[float, float]:
    """Position gain in 1/s and what feed-forward leaves (1 − f), from all records: least squares of the error."""
    from scipy.optimize import minimize_scalar
    from scipy.signal import lfilter

    def solve(gain: float) -> tuple[float, float]:
        cross = square = power = 0.0
        for way, error, step in records:
            kept = math.exp(-gain * step)
            part = (1.0 - kept) / (gain * step)  # of a ramp over one step
            model: Array = np.asarray(lfilter([part, -part], [1.0, -kept], way))
            cross += float(model @ error)
            square += float(model @ model)
            power += float(error @ error)
        rest = cross / square
        return power - rest * cross, rest

    found = minimize_scalar(
        lambda log_gain: solve(math.exp(log_gain))[0], bounds=tuple(np.log(_GAINS)), method="bounded"
    )
    gain = math.exp(float(found.x))
    return gain, float(solve(gain)[1])


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
    state = _State()
    _period(state, logs, parts, bend)
    stops = [part for part in parts.get("log_cutting", []) if part.part.pattern == "dwell"]
    if stops:
        _cutting(state, stops)
        _sum(state)
        _dwells(state, stops)
    else:
        state.findings.append(unknown("cutting time constant", "s", _SOURCE, "needs log_cutting"))
    _runs(state, parts.get("log_run", []), parts.get("log_blocks", []))
    rapids = {
        axis: _rapids(state, axis, parts[f"log_rapid_{axis.lower()}"])
        for axis in AXES
        if f"log_rapid_{axis.lower()}" in parts
    }
    _waits(state, _in_position(state, parts.get("log_exact", [])), rapids)
    _feed_steps(state, parts.get("log_feed_steps", []))
    _servo(state, logs)
    return state.findings
