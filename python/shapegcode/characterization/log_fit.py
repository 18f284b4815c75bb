"""Fits controller parameters to servo logs of the tests: period, time constants, waits, blocks, position loop."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from shapegcode.characterization import moves
from shapegcode.characterization.air_tests import AXES, AirTest, whole_periods
from shapegcode.characterization.result import CUTTING_SUM, PERIODS_S, ControllerFact, Facts, mean
from shapegcode.identification.servo.fit import GAINS, lagged_motion
from shapegcode.io.servo_log import ServoLog
from shapegcode.io.units import FloatArray

_Interval = tuple[float, float]  # a value and its half-width
_FOLLOWED, _RUN_SETTLE_S, _STEPS_SETTLE_S = 0.9, 0.45, 0.3
_FINE = 1.7  # periods


@dataclass
class LogFacts(Facts):
    """Parameters found from the logs so far; times in s."""

    source: str = "log"
    period: float | None = None  # interpolation period; None: unknown
    fine_s: float = 0.0  # longest second time constant that may come from sampling alone, and so is no bell time
    cutting: float | None = None  # time constant and bell time of cutting moves together; None: unknown
    cutting_half: float = 0.0  # half-width of its interval
    exponential: bool = False  # cutting moves are exponential

    @property
    def tick(self) -> float:
        """The interpolation period; if it is unknown, one too short to round anything."""
        return self.period or 1e-6

    @property
    def stop_s(self) -> float | None:
        """Time that a stop adds to a cutting move; None: unknown, or infinite (exponential)."""
        return None if self.exponential else self.cutting


def fit_logs(tests: Mapping[str, AirTest], logs: Mapping[str, ServoLog]) -> list[ControllerFact]:
    """Fit all parameters that the logs determine."""
    bend = moves.bend_samples(list(logs.values()))
    parts = {name: moves.parts_of(log, tests[name], bend) for name, log in logs.items()}
    facts = LogFacts()
    stops = [part for part in parts.get("log_cutting", []) if part.part.pattern == "dwell"]
    run = parts.get("log_run", [])
    _period(facts, logs, stops, run, bend)
    stop_pitch: float | None = None
    if stops:
        fit_cutting(facts, stops)
        stop_pitch = _dwells(facts, stops[0])
    else:
        facts.add_unknown("cutting time constant", "needs log_cutting")
    blocks = parts.get("log_blocks", [])
    settle = (facts.cutting or 0.1) * (4.5 if facts.exponential else 1.1)
    end = _block_end(facts, run[0], settle) if run else None
    if not run:
        facts.add_unknown("block end", "needs log_run", "")
    if blocks:
        _block_time(facts, blocks[0], settle, end)
    else:
        facts.add_unknown("block time", "needs log_blocks")
    rapids = {
        axis: fit_rapids(facts, axis, parts[f"log_rapid_{axis.lower()}"])
        for axis in AXES
        if f"log_rapid_{axis.lower()}" in parts
    }
    _waits(facts, _in_position(facts, parts.get("log_exact", []), stop_pitch), rapids)
    _feed_steps(facts, parts.get("log_feed_steps", []))
    fit_servo(facts, logs)
    return facts.found


def _period(
    facts: LogFacts, logs: Mapping[str, ServoLog], stops: list[moves.PartLog], run: list[moves.PartLog], bend: int
) -> None:
    """Interpolation period: from steps or bends of the command, else from move durations rounded up to periods."""
    name, key = "interpolation period", "controller.interpolation_period_s"
    count, sampling = min((moves.held_samples(log)[0], log.sampling_s) for log in logs.values())
    note = f"the command changes every {count} samples"
    bent = count == 1 and bend > 1
    if bent:
        count, note = bend, f"the speed of the command changes every {bend} samples"
    if count > 1:
        facts.period = round(count * sampling, 6)
        facts.fine_s = facts.period if bent else 0.0
        facts.add(name, facts.period, 1e-3 * facts.period, key, note)
        return
    facts.fine_s = _FINE * (2.0 * sampling)
    for found in (_period_of_stops(stops), _period_of_run(run, sampling)):
        if found is not None:
            facts.period, half, note = found
            facts.fine_s = max(facts.fine_s, _FINE * facts.period)
            facts.add(name, facts.period, half, key, note)
            return
    why = f"not longer than the {sampling * 1e3:g} ms between samples, or interpolated between periods"
    if len(stops) < 2 or not run:
        why += "; log_cutting and log_run together may determine it"
    facts.add_unknown(name, why)


def _period_of_stops(stops: list[moves.PartLog]) -> tuple[float, float, str] | None:
    """Interpolation period, if one usual value alone explains the difference of two durations; half-width, note."""
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


def _period_of_run(run: list[moves.PartLog], sampling: float) -> tuple[float, float, str] | None:
    """The one of `PERIODS_S` that explains the rounded block times of a run; with half-width and a note."""
    steady = moves.line_slope(run[0], _RUN_SETTLE_S) if run else None
    if steady is None:
        return None
    part = run[0].part
    lasts = abs(part.length_mm) / steady[0]
    slack = lasts * steady[1] / steady[0] + 2e-5
    fits = [t for t in PERIODS_S if abs(whole_periods(part.duration_s, t) - lasts) <= slack and t <= 1.01 * sampling]
    if lasts - part.duration_s <= 2.0 * slack or len(fits) != 1:
        return None
    note = f"blocks of {part.duration_s * 1e3:.2f} ms take {lasts * 1e3:.2f} ms, and no longer period fits"
    return fits[0], slack, note


def _dwells(facts: LogFacts, part: moves.PartLog) -> float:
    """Find whether a dwell waits for in-position; returns the time from one move to the next, less the dwell, s."""
    pitch, half = part.pitch_s()
    moving = pitch - whole_periods(part.part.dwell_s, facts.tick)
    if facts.stop_s is not None:
        extra = moving - whole_periods(part.part.duration_s, facts.tick) - facts.stop_s
        waits = extra > 2.0 * (half + facts.cutting_half) + 1.5 * (facts.period or 0.004)
        facts.add_word("in-position wait before a dwell", f"yes, {extra * 1e3:.1f} ms" if waits else "no")
    return moving


def _in_position(facts: LogFacts, parts: list[moves.PartLog], stop_pitch: float | None) -> dict[str, _Interval]:
    out = {}
    for part in parts:
        pitch, half = part.pitch_s()
        if facts.stop_s is not None:
            moving = whole_periods(part.part.duration_s, facts.tick) + facts.stop_s
            out[part.part.axis] = (pitch - moving, half + facts.cutting_half + (0.0 if facts.period else 0.002))
        elif stop_pitch is not None:
            out[part.part.axis] = (pitch - stop_pitch, 2.0 * half)
    return out


def _waits(facts: LogFacts, stops: dict[str, _Interval], rapids: dict[str, list[_Interval]]) -> None:
    """In-position times after rapids and after exact stops: combined if they agree, else those after rapids."""
    for axis in AXES:
        name, key = f"in-position time {axis}", f"controller.in_position_s.{axis.lower()}"
        after, stop = rapids.get(axis, []), stops.get(axis)
        if not after and stop is None:
            facts.add_unknown(name, f"needs log_exact or log_rapid_{axis.lower()}")
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
            facts.add_unknown(name, f"{value * 1e3:.1f} ms: the next move starts too early")
        else:
            facts.add(name, max(value, 0.0), half, key, note)


def _block_end(facts: LogFacts, run: moves.PartLog, settle: float) -> str | None:
    """Find ceil or carry from the mean time of long blocks."""
    part, nominal = run.part, run.part.duration_s
    speed, half = moves.line_slope(run, settle) or (abs(part.length_mm) / nominal, math.inf)
    lasts = abs(part.length_mm) / speed
    note = f"blocks of {nominal * 1e3:.2f} ms take {lasts * 1e3:.2f} ms"
    full = whole_periods(nominal, facts.period) - nominal if facts.period else None
    slack = lasts * half / speed + 1e-5
    end = None
    if lasts - nominal > 3.0 * slack and (full is None or abs(lasts - nominal - full) < 0.3 * full + slack):
        end = "ceil"
    elif full is not None and abs(lasts - nominal) < 0.3 * full and slack < 0.3 * full:
        end = "carry"
    if end is None:
        facts.add_unknown("block end", note + ": neither fits, or the period is unknown", "")
    else:
        facts.add_word("block end", end, "controller.block_end", note)
    return end


def _block_time(facts: LogFacts, blocks: moves.PartLog, settle: float, end: str | None) -> None:
    name, part = "block time", blocks.part
    lasting = f"blocks of {part.duration_s * 1e3:.2f} ms"
    steady = moves.line_slope(blocks, settle)
    if steady is None:
        facts.add_unknown(name, f"{lasting} end before the speed is steady: it is short")
        return
    speed, half = steady
    lasts = abs(part.length_mm) / speed
    slack = lasts * half / speed
    floor = part.duration_s
    if facts.period and end != "carry":
        floor = whole_periods(part.duration_s, facts.period)
    if lasts <= 1.02 * floor + slack:
        why = f"{lasting} take {lasts * 1e3:.2f} ms: it is hidden by the period"
        facts.add_unknown(name, why, high=lasts + slack)
        return
    if facts.exponential:
        slack += 0.005 * lasts  # tail of the start
    facts.add(name, lasts, slack, "controller.block_time_s", f"{lasting} take this time")


def _feed_steps(facts: LogFacts, parts: list[moves.PartLog]) -> None:
    """Shortest distance over which the speed reaches 90 % of a feed step between F and F/2."""
    if not parts:
        facts.add_unknown("feed-control interval", "needs log_feed_steps", "mm")
        return
    name = f"feed-control interval at F{parts[0].part.feed_mm_per_min:g}"
    depths = {abs(log.part.length_mm): depth for log in parts if (depth := _followed_share(log)) is not None}
    followed = [d for d in depths if all(depths[e] >= _FOLLOWED for e in depths if e >= d)]
    shown = ", ".join(f"{d:g} mm {max(0.0, min(1.0, depths[d])) * 100:.0f} %" for d in sorted(depths))
    if not followed:
        facts.add_unknown(name, f"the speed follows over none of the distances in the box: {shown}", "mm")
        return
    best = min(followed)
    below = max((d for d in depths if d < best), default=0.0)
    facts.add_interval(name, best, below, best, "", f"followed: {shown}", "mm")


def _followed_share(log: moves.PartLog) -> float | None:
    """Fraction of the speed step that is reached; None without samples between the ramps at start and reversal."""
    part = log.part
    top = int(np.argmax(log.travel_mm))  # the reversal, which smoothing shortens
    begin = log.times_s[int(np.argmax(log.travel_mm > max(0.02, 5 * log.noise_mm)))]
    settle = min(_STEPS_SETTLE_S, 0.25 * (log.times_s[top] - begin))
    inside = (log.times_s > begin + settle) & (log.times_s < log.times_s[top] - settle)
    pitch = float(np.median(np.diff(log.times_s)))
    width = max(1, round(min(0.02, 0.25 * part.duration_s) / pitch))
    speed = (log.travel_mm[width:] - log.travel_mm[:-width]) / (log.times_s[width:] - log.times_s[:-width])
    seen = speed[inside[width:] & inside[:-width]]
    if not len(seen):
        return None
    noise = 2.0 * log.noise_mm * math.sqrt(2.0) / (width * pitch)
    swing = float(np.percentile(seen, 99.0) - np.percentile(seen, 1.0)) - noise
    return swing / (part.feed_mm_per_min / 120.0)


_ODD_SHAPE = 0.002  # largest residual of a fit, relative to the travel
_BELL_GAIN = 0.8  # a second moving average must reduce the variance below this ratio
_NO_BELL = "no second moving average was found"


def fit_cutting(facts: LogFacts, stops: list[moves.PartLog]) -> None:
    """Time constant and bell time from the shape of moves between stops."""
    names = ("cutting time constant", "cutting bell time")
    fits = _cutting_fits(facts, stops[:2])
    rms = {shape: math.sqrt(sum(fit.rms_mm**2 for fit in each) / len(each)) for shape, each in fits.items()}
    best = "exponential" if rms["exponential"] < min(rms["linear"], rms["bell"]) else "linear"
    bell = [min(fit.values[1:]) for fit in fits["bell"]]
    if best == "linear" and rms["bell"] ** 2 < _BELL_GAIN * rms["linear"] ** 2 and min(bell) > facts.fine_s:
        best = "bell"
    if rms[best] > _ODD_SHAPE * abs(stops[0].part.length_mm) + 3.0 * stops[0].noise_mm:
        why = f"no moving average or exponential: the best fit ({best}) has a residual of {rms[best] * 1e3:.1f} µm; "
        for name in names:
            facts.add_unknown(name, f"{why}was a look-ahead mode on?")
        return
    # Longest time of each fit first.
    pairs_of = [zip(fit.values[1:].tolist(), fit.half[1:].tolist(), strict=True) for fit in fits[best]]
    times = [sorted(pairs, reverse=True) for pairs in pairs_of]
    value, half = mean(*zip(*(pairs[0] for pairs in times), strict=True))
    note = "the longer of two moving averages" if best == "bell" else best
    facts.add(names[0], value, half, "controller.time_constant_s", note)
    facts.add_word("cutting acceleration shape", best, "controller.after_interpolation_shape")
    facts.exponential = best == "exponential"
    facts.cutting, facts.cutting_half = value, half
    bell_key = "controller.bell_time_s"
    if best == "bell":
        second, second_half = mean(*zip(*(pairs[1] for pairs in times), strict=True))
        facts.add(names[1], second, second_half, bell_key)
        facts.cutting, facts.cutting_half = value + second, math.hypot(half, second_half)
    elif best == "linear":
        facts.add_interval(names[1], 0.0, 0.0, max(facts.fine_s, 0.002), bell_key, _NO_BELL)
    if not facts.exponential:
        facts.add(CUTTING_SUM, facts.cutting, facts.cutting_half)


def _cutting_fits(facts: LogFacts, stops: list[moves.PartLog]) -> dict[str, list[moves.ShapeFit]]:
    """Fit nominal duration and one or two time constants to each part, with each shape of filter."""
    fits: dict[str, list[moves.ShapeFit]] = {"linear": [], "bell": [], "exponential": []}
    for part in stops:
        nominal = part.part.duration_s
        low, high = nominal * 0.95, nominal + (facts.period or 0.004) * 1.1
        one = [low, 1e-4], [high, 1.0]
        fits["linear"].append(moves.fit_shape(part, moves.smoothed_share, [nominal, 0.05], one))
        two = [low, 1e-4, 1e-5], [high, 1.0, 0.5]
        fits["bell"].append(moves.fit_shape(part, moves.smoothed_share, [nominal, 0.06, 0.02], two))
        fits["exponential"].append(moves.fit_shape(part, moves.lagged_share, [nominal, 0.03], one))
    return fits


@dataclass(frozen=True)
class _Rapid:
    """Fit to the rapids of one part of a test; values with their half-widths, s."""

    long: bool  # the rate is reached
    ramp: _Interval
    bell: _Interval | None
    wait: _Interval
    nominal: float
    rms_mm: float


def _rapid(part: moves.PartLog, facts: LogFacts) -> _Rapid:
    """The shape of rapids over one length, as a long move (the rate is reached) or a short one."""
    nominal = part.part.duration_s
    rectangle = whole_periods(nominal, facts.tick)
    found: list[tuple[moves.ShapeFit, bool, bool]] = []
    for bell, ramp_guess in itertools.product((None, 0.005, 0.03, 0.08), (0.06, 0.15)):
        begin = math.sqrt(nominal * ramp_guess)
        tail, low, high = ([], [], []) if bell is None else ([bell], [1e-5], [0.5])
        ends = [0.1 * begin, *low], [20.0 * begin, *high]
        fit = moves.fit_shape(part, lambda t, p: moves.smoothed_share(t, [p[0], p[0], *p[1:]]), [begin, *tail], ends)
        found.append((fit, False, bell is not None))
        ends, start = ([1e-4, *low], [1.05 * rectangle, *high]), [0.7 * rectangle, *tail]
        fit = moves.fit_shape(part, lambda t, p: moves.smoothed_share(t, [rectangle, *p]), start, ends)
        found.append((fit, True, bell is not None))
    plain, curved = (
        min((each for each in found if each[2] == with_bell), key=lambda each: each[0].rms_mm)
        for with_bell in (False, True)
    )
    better = curved[0].rms_mm ** 2 < _BELL_GAIN * plain[0].rms_mm ** 2
    fit, long, bell_found = curved if better and curved[0].values[1] > facts.fine_s else plain
    values = list(zip(fit.values.tolist(), fit.half.tolist(), strict=True))
    if long:
        values.sort(reverse=True)
    ramp, bell_value = values[0], values[1] if bell_found else None
    moving = (rectangle if long else ramp[0]) + ramp[0] + (bell_value[0] if bell_value else 0.0)
    slack = (1.0 if long else 2.0) * ramp[1] + (bell_value[1] if bell_value else 0.0)
    pitch, half = part.pitch_s()
    return _Rapid(long, ramp, bell_value, (pitch - moving, half + slack), nominal, fit.rms_mm)


def fit_rapids(facts: LogFacts, axis: str, parts: list[moves.PartLog]) -> list[_Interval]:
    """Fit time constants of an axis' rapids; returns their in-position times with half-widths."""
    name, bell_name = f"rapid time constant {axis}", f"rapid bell time {axis}"
    every = [_rapid(part, facts) for part in parts]
    fits = [fit for fit, part in zip(every, parts, strict=True) if fit.rms_mm < _ODD_SHAPE * abs(part.part.length_mm)]
    if not fits:
        why = f"rapids have no constant acceleration: the best fit has a residual of {every[0].rms_mm * 1e3:.1f} µm"
        facts.add_unknown(name, why)
        facts.add_unknown(bell_name, why)
        return []
    key = f"controller.rapid_time_constant_s.{axis.lower()}"
    long = [fit.ramp for fit in fits if fit.long]
    low, high = (0.0, 0.0) if long else _short_ramp(facts, fits)
    if long:
        value, half = mean(*zip(*long, strict=True))
        facts.add(name, value, half, key, "ramp of rapids that reach the rate")
    elif low <= high:
        note = "no rapid reaches the rate: from their acceleration, in whole periods"
        facts.add_interval(name, (low + high) / 2.0, low, high, key, note)
    else:
        why = "rapids of different length have different accelerations; is the rate in the machine file right?"
        facts.add_unknown(name, why)
    bells = [fit.bell for fit in fits if fit.bell is not None]
    bell_key = f"controller.rapid_bell_time_s.{axis.lower()}"
    if len(bells) * 2 > len(fits):
        value, half = mean(*zip(*bells, strict=True))
        facts.add(bell_name, value, half, bell_key)
    else:
        facts.add_interval(bell_name, 0.0, 0.0, max(facts.fine_s, 0.002), bell_key, _NO_BELL)
    return [fit.wait for fit in fits]


def _short_ramp(facts: LogFacts, fits: list[_Rapid]) -> tuple[float, float]:
    """Bounds of the time constant from rapids too short to reach their rate: paper 004, eq. 16, for half a rapid."""
    period = facts.tick
    halves = [(whole_periods(fit.ramp[0] - 0.3 * period, period), fit) for fit in fits]
    sure = [(half, fit) for half, fit in halves if abs(half - fit.ramp[0]) + fit.ramp[1] < 0.3 * period]
    slack = 0.0 if sure and facts.period else 1e-4
    pairs = sure if slack == 0.0 else [(fit.ramp[0], fit) for fit in fits]
    low = max((half - slack - period) ** 2 / fit.nominal for half, fit in pairs)
    high = min((half + slack) ** 2 / fit.nominal for half, fit in pairs)
    return low, high


_SERVO_SLACK = 0.02


def fit_servo(facts: Facts, logs: Mapping[str, ServoLog]) -> None:
    """Fit position gain K and feed-forward f to following error e and command x: e = −K ∫e dt + (1 − f) x + c."""
    by_axis = {axis: [_servo_rows(log, index) for log in logs.values()] for index, axis in enumerate(AXES)}
    if not any(record for records in by_axis.values() for record in records):
        facts.add_unknown("position gain", "no actual positions in the logs", "1/s")
    for axis, found in by_axis.items():
        if not (records := [record for record in found if record is not None]):
            continue
        name = f"position gain {axis}"
        gain, rest = _lag_of(records)
        if rest < 0.02 or not 2.0 * GAINS[0] < gain < 0.5 * GAINS[1]:
            facts.add_unknown(name, "the actual position follows the command without measurable lag", "1/s")
            continue
        spread = np.std(np.array([_lag_of([record]) for record in records]), axis=0) / math.sqrt(len(records))
        # Command and actual position may be sampled up to half a sample apart, which appears as lag.
        apart = 0.5 * min(log.sampling_s for log in logs.values()) * gain
        half = float(spread[0]) + (_SERVO_SLACK + apart / rest) * gain
        facts.add(name, gain, half, f"controller.position_gain_per_s.{axis.lower()}", unit="1/s")
        half = float(spread[1]) + _SERVO_SLACK + apart
        key = f"controller.feed_forward_ratio.{axis.lower()}"
        facts.add(f"feed-forward {axis}", max(0.0, 1.0 - rest), half, key, unit="1")


def _servo_rows(log: ServoLog, index: int) -> tuple[FloatArray, FloatArray, float] | None:
    """Command, following error and time step, one row for each period of constant command; None without such data."""
    if log.actual_mm is None or np.isnan(log.actual_mm[0, index]) or np.isnan(log.command_mm[0, index]):
        return None
    count, first = moves.held_samples(log)
    n = (len(log.times_s) - first) // count

    def rows(values: FloatArray) -> FloatArray:
        return np.asarray(values[first : first + n * count].reshape(n, count).mean(axis=1))

    travel = rows(log.command_mm[:, index] - log.command_mm[0, index])
    if np.ptp(travel) < 1.0:
        return None
    error = travel - rows(log.actual_mm[:, index] - log.actual_mm[0, index])
    step = count * log.sampling_s
    return travel, error - np.median(error[: max(3, round(0.1 / step))]), step


def _lag_of(records: list[tuple[FloatArray, FloatArray, float]]) -> tuple[float, float]:
    """Fit position gain (1/s) and remaining lag ratio (1 − feed-forward ratio) to all records by least squares."""

    def solve(gain: float) -> tuple[float, float]:
        cross = square = power = 0.0
        for travel, error, step in records:
            model = lagged_motion(travel, gain, step)
            cross += float(model @ error)
            square += float(model @ model)
            power += float(error @ error)
        rest = cross / square
        return power - rest * cross, rest

    bounds = tuple(np.log(GAINS))
    found = minimize_scalar(lambda logarithm: solve(math.exp(logarithm))[0], bounds=bounds, method="bounded")
    gain = math.exp(float(found.x))
    return gain, solve(gain)[1]
