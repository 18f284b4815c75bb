"""Fits controller parameters to stopwatch times of the test programs; method: this project.

Each time is one equation. For every candidate period and both rules of block timing the other parameters are fitted; a
period or rule is known only if the alternatives fit clearly worse. Rapids are fitted afterwards, for each candidate
time constant.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares

from shapegcode.characterization import air_tests
from shapegcode.characterization.air_tests import AXES, ControllerTiming, program_time_s
from shapegcode.characterization.programs import FilledSheet
from shapegcode.characterization.result import CUTTING_SUM, PERIODS_S, Facts
from shapegcode.io.units import FloatArray

_CLEARLY = 9.0  # chi² difference of a clearly worse alternative
_WIDE = 0.5  # ratio to the value: a wider half interval determines nothing
_CONTRADICTS = 4.0  # standard deviations
_SLOW = ("stop_slow", "stop_slower")
_NAMES = ("overhead", "cutting", "X", "Y", "Z", "block")


@dataclass
class WatchFacts(Facts):
    """Parameters found from the times so far."""

    source: str = "stopwatch"
    contradictions: list[str] = field(default_factory=list)  # times that do not agree with the others, in words

    def add_if_narrow(self, name: str, value: float, half: float, key: str, needs: str, note: str) -> None:
        """Add a time in s; if its interval is too wide or below 0, add it as unknown."""
        if half > _WIDE * max(abs(value), 0.002):
            self.add_unknown(name, f"needs {needs}; the interval would be ±{half * 1e3:.1f} ms", high=value + half)
        elif value < -half:
            why = f"{value * 1e3:.1f} ms ± {half * 1e3:.1f} ms is negative: {needs} contradict each other"
            self.add_unknown(name, why)
        else:
            self.add(name, value, half, key, note)


@dataclass(frozen=True)
class TimedTest:
    """A timed test."""

    test: air_tests.AirTest  # the test
    time_s: float  # mean of the readings
    sigma_s: float  # its standard deviation


@dataclass(frozen=True)
class _Fit:
    period: float
    end: air_tests.BlockEnd
    values: FloatArray
    covariance: FloatArray
    chi2: float

    def get(self, name: str) -> tuple[float, float]:
        """A parameter and its 95 % half-width."""
        k = _NAMES.index(name)
        return float(self.values[k]), 1.96 * math.sqrt(float(self.covariance[k, k]))


def fit_stopwatch(results: FilledSheet) -> WatchFacts:
    """Fit all parameters that the stopwatch times determine."""
    rows = _rows(results)
    facts = WatchFacts()
    exponential = _shape(rows, facts)
    used = _used(rows, exponential)
    if not used:
        facts.add_unknown("all but rapids", "no times of the cutting tests", "")
        return facts
    periods = (air_tests.NO_PERIOD_S, *PERIODS_S)
    fits = [_least_squares(used, period, end) for period in periods for end in ("ceil", "carry")]
    best, period = _discrete(fits, facts)
    _cutting(best, exponential > 0.0, facts)
    _block_time(best, rows.get("blocks_tiny"), facts)
    for row in used:
        expected = program_time_s(row.test, _timing(best.values, best.period, best.end))
        if abs(expected - row.time_s) > _CONTRADICTS * row.sigma_s + 0.001 * row.time_s:
            facts.contradictions.append(
                f"{results.file}:{results.lines[row.test.name]}: {row.test.name}: {row.time_s:.2f} s; the best fit to "
                f"all tests gives {expected:.2f} s"
            )
    for axis in AXES:
        mine = [row for row in rows.values() if row.test.parts[0].pattern == "rapid" and row.test.parts[0].axis == axis]
        _fit_rapids(facts, axis, mine, period, best)
    _override(best, rows, facts)
    return facts


def _rows(results: FilledSheet) -> dict[str, TimedTest]:
    """Mean time of each timed test, and its standard deviation."""
    rounding = results.resolution_s / math.sqrt(12.0)
    single = math.hypot(rounding, results.reaction_s)
    out = {}
    for name, times in results.times_s.items():
        # Rounding errors of readings do not average out, as a machine repeats exactly.
        sigma = math.hypot(rounding, results.reaction_s / math.sqrt(len(times)))
        spread = float(np.std(times, ddof=1)) if len(times) > 2 else 0.0
        if spread > 2.0 * single:
            sigma = max(sigma, spread / math.sqrt(len(times)))
        out[name] = TimedTest(results.tests[name], float(np.mean(times)), sigma)
    return out


def _used(rows: dict[str, TimedTest], exponential: float) -> list[TimedTest]:
    """Tests for the least squares: no rapids, no overrides, no redundant stops."""
    left_out = {*_SLOW, "stop_above"} if exponential else {"stop_slow" if "stop_slower" in rows else ""}
    used = []
    for name, row in rows.items():
        pattern = row.test.parts[0].pattern
        # The tail of a run differs from that of a stop: other last speed and length.
        sigma_s = math.hypot(row.sigma_s, 1.5 * exponential) if pattern == "continuous" else row.sigma_s
        if name not in left_out and pattern != "rapid" and not name.startswith("override"):
            used.append(replace(row, sigma_s=sigma_s))
    return used


def _timing(values: FloatArray, period: float, end: air_tests.BlockEnd) -> ControllerTiming:
    overhead, cutting, x, y, z, block = values.tolist()
    waits = dict(zip(AXES, (x, y, z), strict=True))
    return ControllerTiming(period, end, block, cutting, in_position_s=waits, overhead_s=overhead)


def _least_squares(rows: Sequence[TimedTest], period: float, end: air_tests.BlockEnd) -> _Fit:
    """Fit all unknowns except those of rapids, for one period and rule."""
    tiny = next((row for row in rows if row.test.name == "blocks_tiny"), None)
    block = tiny.time_s / tiny.test.parts[0].count if tiny else 0.005
    begin = np.array([0.3, 0.1, 0.05, 0.05, 0.05, block])

    def residual(p: FloatArray) -> FloatArray:
        timing = _timing(p, period, end)
        fits = [(program_time_s(row.test, timing) - row.time_s) / row.sigma_s for row in rows]
        return np.array([*fits, *(p - begin)])  # a parameter without effect stays at its start

    found = least_squares(residual, begin, x_scale=np.maximum(begin, 1e-3), diff_step=[1e-6] * len(begin))
    jacobian = np.asarray(found.jac)
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    return _Fit(period, end, found.x, covariance, float(found.fun @ found.fun))


def _shape(rows: dict[str, TimedTest], facts: WatchFacts) -> float:
    """Time constant of an exponential filter, whose stops take longer from a higher feed; 0 if none was found."""
    fast = rows.get("stop_below")
    slow = [rows[name] for name in _SLOW if name in rows]
    name = "cutting acceleration shape"
    if fast is None or not slow:
        facts.add_unknown(name, "needs stop_below and stop_slower", "")
        return 0.0
    points = []
    for row in (fast, *slow):
        part = row.test.parts[0]
        per_move = row.time_s / part.count - part.duration_s
        points.append((math.log(part.feed_mm_per_min), per_move, row.sigma_s / part.count))
    x, y, sigma = np.array(points).T
    weight = 1.0 / (sigma**2 + (0.0005**2))
    centre = (weight @ x) / weight.sum()
    spread = float(weight @ (x - centre) ** 2)
    slope = float(weight @ ((x - centre) * y)) / spread
    half = 1.96 / math.sqrt(spread)
    if slope <= half + 0.002:
        note = "a stop takes the same time from every feed; linear or bell cannot be distinguished"
        facts.add_word(name, "linear or bell", "controller.after_interpolation_shape", note)
        return 0.0
    facts.add_word(name, "exponential", "controller.after_interpolation_shape", "stops from a higher feed take longer")
    # The end of each stop is rounded to an unknown period: an error uniform over half of the longest usual one.
    away = float(((x - centre) ** 2).sum())
    slack = 1.96 * 0.008 / math.sqrt(12.0) * math.sqrt(away) / away
    key, note = "controller.time_constant_s", "from stops at several feeds"
    facts.add("cutting time constant", slope, math.hypot(half, slack), key, note)
    return slope


def _discrete(fits: Sequence[_Fit], facts: WatchFacts) -> tuple[_Fit, float | None]:
    """The best fit, and its interpolation period if certain; adds period and rule of block timing to the facts."""
    best = min(fits, key=lambda fit: fit.chi2)
    close = [fit for fit in fits if fit.chi2 < best.chi2 + _CLEARLY]
    periods = sorted({fit.period for fit in close})
    ends = {fit.end for fit in close}
    name = "interpolation period"
    period = periods[0] if len(periods) == 1 and periods[0] > air_tests.NO_PERIOD_S else None
    if period is not None:
        note = "of the usual periods, the only one that fits"
        facts.add_interval(name, period, period, period, "controller.interpolation_period_s", note)
    else:
        shown = ", ".join("none" if t <= air_tests.NO_PERIOD_S else f"{t * 1e3:g} ms" for t in periods)
        facts.add_unknown(name, f"these fit equally well: {shown}", high=max(periods))
    if len(ends) == 1:
        facts.add_word("block end", best.end, "controller.block_end")
    else:
        facts.add_unknown("block end", "both fit: needs run_above, and a known period", "")
    return best, period


def _cutting(best: _Fit, exponential: bool, facts: WatchFacts) -> None:
    """Sum of the time constants of cutting moves (not if exponential), and the waits after exact stops."""
    if not exponential:
        note = "a stopwatch measures only the sum"
        key = "controller.time_constant_s"
        facts.add_if_narrow(CUTTING_SUM, *best.get("cutting"), key, "stop_below, overhead", note)
        facts.add_unknown("cutting bell time", "a stopwatch measures only the sum of both times")
    note = "after exact stops, if a dwell does not wait for in-position"
    for axis in AXES:
        key, needs = f"controller.in_position_s.{axis.lower()}", f"exact_{axis.lower()}, stop_below"
        facts.add_if_narrow(f"in-position time {axis}", *best.get(axis), key, needs, note)


def _block_time(best: _Fit, tiny: TimedTest | None, facts: WatchFacts) -> None:
    value, half = best.get("block")
    if tiny is None:
        facts.add_unknown("block time", "needs blocks_tiny")
        return
    part = tiny.test.parts[0]
    floor = air_tests.part_time_s(replace(part, count=1), ControllerTiming(best.period, best.end, 0.0, 0.0))
    if value <= 1.02 * floor + half or half > _WIDE * value:
        lasts = max(value, floor) * 1e3
        why = f"blocks of {part.duration_s * 1e3:.2f} ms take {lasts:.2f} ms: it is hidden by the period"
        facts.add_unknown("block time", why, high=floor + 2.0 * tiny.sigma_s / part.count)
        return
    facts.add("block time", value, half, "controller.block_time_s")


def _override(best: _Fit, rows: dict[str, TimedTest], facts: WatchFacts) -> None:
    for row in [row for name, row in rows.items() if name.startswith("override")]:
        part = row.test.parts[0]
        # the blocks follow each other without stops: there is one ramp, at any override
        moving = max(row.time_s - best.get("overhead")[0] - best.get("cutting")[0], 1e-3)
        seen = 100.0 * part.count * part.duration_s / moving
        half = 1.96 * seen * row.sigma_s / moving
        right = abs(seen - row.test.override_percent) <= half + 1.0
        note = "time is proportional to 1 / override" if right else "the feed does not follow the override"
        facts.add(f"feed at override {row.test.override_percent} %", seen, half, "", note, "%")


_RAMPS_S = np.arange(0.005, 1.0, 0.00025)
_INSIDE = 3.84  # chi² of a 95 % interval of one parameter
_WAIT_UNKNOWN_S = 0.1


def _fit_rapids(facts: WatchFacts, axis: str, timed: list[TimedTest], period: float | None, best: _Fit) -> None:
    """Fit time constant and bell time of an axis' rapids."""
    overhead, wait = best.get("overhead"), best.get(axis)
    names = (f"rapid time constant {axis}", f"rapid bell time {axis}")
    if len(timed) < 2:
        for name in names:
            facts.add_unknown(name, f"needs two of the rapid_{axis.lower()} tests or more")
        return
    parts = [each.test.parts[0] for each in timed]
    count = np.array([part.count for part in parts])
    sigma = np.hypot([each.sigma_s for each in timed], overhead[1] / 1.96) / count
    if period is None:
        sigma = np.hypot(sigma, 0.002)
    weight = 1.0 / sigma**2
    seen = (np.array([each.time_s for each in timed]) - overhead[0]) / count
    # A rapid is followed at least by the in-position wait, if known.
    least = max(0.0, wait[0] - wait[1]) if wait[1] < _WAIT_UNKNOWN_S else 0.0
    chi2, after = np.empty(len(_RAMPS_S)), np.empty(len(_RAMPS_S))
    singles, zero = [replace(part, count=1) for part in parts], {axis: 0.0}
    for k, ramp in enumerate(_RAMPS_S):
        timing = ControllerTiming(period or air_tests.NO_PERIOD_S, "ceil", 0.0, 0.0, {axis: float(ramp)}, zero, zero)
        moving = np.array([air_tests.part_time_s(part, timing) for part in singles])
        after[k] = max(least, float(weight @ (seen - moving)) / float(weight.sum()))
        chi2[k] = float((((seen - moving - after[k]) / sigma) ** 2).sum())
    floor = float(chi2.min())
    if floor > _CONTRADICTS**2 + 3.0 * len(timed):
        for name in names:
            facts.add_unknown(name, "the times contradict each other")
        tests = ", ".join(each.test.name for each in timed)
        facts.contradictions.append(
            f"{tests}: no time constant gives these times (chi² {floor:.0f}); is the rapid rate of the machine file "
            "right, and the rapid override 100 %?"
        )
        return
    inside = chi2 <= floor + _INSIDE
    likely = np.exp(-0.5 * (chi2[inside] - floor))
    _ramp(facts, axis, _RAMPS_S[inside], likely)
    sums = after[inside]
    slack = math.hypot(wait[1], 1.96 / math.sqrt(float(weight.sum())))
    ends = float(sums.min()) - wait[0] - slack, float(sums.max()) - wait[0] + slack
    _bell(facts, axis, float(likely @ sums / likely.sum()), wait, ends, slack)


def _ramp(facts: Facts, axis: str, ramps: FloatArray, likely: FloatArray) -> None:
    """Add the time constant: mean and range of those that fit."""
    name = f"rapid time constant {axis}"
    step = float(_RAMPS_S[1] - _RAMPS_S[0])
    low, high = float(ramps.min()) - step, float(ramps.max()) + step
    value = float(likely @ ramps / likely.sum())
    if high - low > 2.0 * _WIDE * value:
        why = f"from {low * 1e3:.0f} to {high * 1e3:.0f} ms all fit; longer moves would be more exact"
        facts.add_unknown(name, why, high=high)
    else:
        facts.add_interval(name, value, low, high, f"controller.rapid_time_constant_s.{axis.lower()}")


def _bell(
    facts: Facts, axis: str, total: float, wait: tuple[float, float], ends: tuple[float, float], slack: float
) -> None:
    """Add the bell time: the time after the motion, without the in-position wait."""
    name, key = f"rapid bell time {axis}", f"controller.rapid_bell_time_s.{axis.lower()}"
    low, high = ends
    bell = total - wait[0]
    if wait[1] > _WAIT_UNKNOWN_S:
        why = f"needs exact_{axis.lower()}: rapids show only bell plus in-position time, {total * 1e3:.1f} ms"
        facts.add_unknown(name, why, high=total)
    elif low <= 0.0 and high > 2.0 * slack + 0.02:
        facts.add_unknown(name, f"any value up to {high * 1e3:.0f} ms fits", high=high)
    elif low <= 0.0:
        facts.add_interval(name, 0.0, 0.0, max(high, 0.0), key, "none, or below the upper end")
    elif high - low > 2.0 * _WIDE * bell:
        facts.add_unknown(name, f"from {low * 1e3:.0f} to {high * 1e3:.0f} ms all fit", high=high)
    else:
        facts.add_interval(name, bell, low, high, key, "if rapids and exact stops have equal in-position waits")
