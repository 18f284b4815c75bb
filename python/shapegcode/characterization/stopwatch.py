"""What stopwatch times of the test programs say about a controller.

Each time is one equation. For every usual interpolation period and both rules of the block's end the others are least
squares; a period or rule counts as known only where the alternatives fit clearly worse. Rapids come after that, since
a short rapid lasts whole periods of a square root.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from shapegcode.characterization.findings import CUTTING_SUM, PERIODS_S, Finding, known, unknown
from shapegcode.characterization.plan import AXES, Test
from shapegcode.characterization.results import Results
from shapegcode.characterization.timing import Timing, part_time_s, program_time_s

__all__ = ["StopwatchFit", "fit_stopwatch"]

Array = npt.NDArray[np.float64]
_SOURCE = "stopwatch"
_CLEARLY = 9.0  # chi² by which an alternative must fit worse
_WIDE = 0.5  # of the value: an interval of so much either way determines nothing
_CONTRADICTS = 4.0  # standard deviations
_SHAPE_KEY = "controller.after_interpolation_shape"
_SLOW = ("stop_slow", "stop_slower")
_NO_PERIOD_S = 1e-6
_PRIOR_S = 1.0
_RAMPS_S = np.arange(0.005, 1.0, 0.00025)
_INSIDE = 3.84  # chi² of a 95 % interval of one parameter
_NAMES = ("overhead", "cutting", "X", "Y", "Z", "block")


@dataclass
class StopwatchFit:
    """What was found.

    Attributes:
        findings: one for each quantity.
        contradictions: times that do not go with the others, in words.
    """

    findings: list[Finding] = field(default_factory=list)
    contradictions: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class _Row:
    test: Test
    time_s: float
    sigma_s: float


@dataclass(frozen=True)
class _Fit:
    period: float
    end: str
    values: Array
    covariance: Array
    chi2: float

    def get(self, name: str) -> tuple[float, float]:
        """A parameter and its 95 % half-width."""
        k = _NAMES.index(name)
        return float(self.values[k]), 1.96 * math.sqrt(float(self.covariance[k, k]))


def _timing(values: Sequence[float], period: float, end: str) -> Timing:
    overhead, cutting, x, y, z, block = values
    waits = dict(zip(AXES, (x, y, z), strict=True))
    return Timing(period, end, block, cutting, in_position_s=waits, overhead_s=overhead)  # type: ignore[arg-type]


def _least_squares(rows: Sequence[_Row], period: float, end: str) -> _Fit:
    """All unknowns but the rapids', for one period and rule."""
    from scipy.optimize import least_squares

    tiny = next((row for row in rows if row.test.name == "blocks_tiny"), None)
    block = tiny.time_s / tiny.test.parts[0].count if tiny else 0.005
    begin = np.array([0.3, 0.1, 0.05, 0.05, 0.05, block])

    def residual(p: Array) -> Array:
        timing = _timing(p.tolist(), period, end)
        fits = [(program_time_s(row.test, timing) - row.time_s) / row.sigma_s for row in rows]
        return np.array([*fits, *((p - begin) / _PRIOR_S)])

    found = least_squares(residual, begin, x_scale=np.maximum(begin, 1e-3), diff_step=[1e-6] * len(begin))
    jacobian = np.asarray(found.jac)
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    return _Fit(period, end, found.x, covariance, float(found.fun @ found.fun))


def _rows(results: Results) -> dict[str, _Row]:
    single = math.hypot(results.resolution_s / math.sqrt(12.0), results.reaction_s)
    out = {}
    for name, times in results.times_s.items():
        # The rounding of one reading is not averaged out by the next: a machine repeats itself.
        sigma = math.hypot(results.resolution_s / math.sqrt(12.0), results.reaction_s / math.sqrt(len(times)))
        spread = float(np.std(times, ddof=1)) if len(times) > 2 else 0.0
        if spread > 2.0 * single:
            sigma = max(sigma, spread / math.sqrt(len(times)))
        out[name] = _Row(results.tests[name], float(np.mean(times)), sigma)
    return out


def _shape(rows: dict[str, _Row], out: StopwatchFit) -> float:
    """Time constant of an exponential, whose way to a stop lasts longer from a higher feed; 0 if it does not."""
    fast = rows.get("stop_below")
    slow = [rows[name] for name in _SLOW if name in rows]
    name = "cutting acceleration shape"
    if fast is None or not slow:
        out.findings.append(unknown(name, "", _SOURCE, "needs stop_below and stop_slower"))
        return 0.0
    points = []
    for row in (fast, *slow):
        part = row.test.parts[0]
        per_move = row.time_s / part.count - part.duration_s
        points.append((math.log(part.feed_mm_per_min), per_move, row.sigma_s / part.count))
    x, y, sigma = (np.array(column) for column in zip(*points, strict=True))
    weight = 1.0 / (sigma**2 + (0.0005**2))
    centre = (weight @ x) / weight.sum()
    spread = float(weight @ (x - centre) ** 2)
    slope = float(weight @ ((x - centre) * y)) / spread
    half = 1.96 / math.sqrt(spread)
    if slope <= half + 0.002:
        note = "a stop takes equally long from every feed; linear or bell cannot be told apart"
        out.findings.append(Finding(name, "linear or bell", None, None, "", _SHAPE_KEY, _SOURCE, note))
        return 0.0
    out.findings.append(
        Finding(name, "exponential", None, None, "", "", _SOURCE, "stops from a higher feed last longer")
    )
    # Each stop ends on a period that is not known well: half of the longest usual one, evenly spread.
    slack = (
        1.96 * 0.008 / math.sqrt(12.0) * math.sqrt(float(((x - centre) ** 2).sum())) / float(((x - centre) ** 2).sum())
    )
    note = "from stops at several feeds"
    key = "controller.time_constant_s"
    out.findings.append(known("cutting time constant", slope, math.hypot(half, slack), "s", key, _SOURCE, note))
    return slope


def _discrete(fits: Sequence[_Fit], out: StopwatchFit) -> tuple[_Fit, float | None]:
    """The best fit; says whether the period and the rule are known."""
    best = min(fits, key=lambda fit: fit.chi2)
    close = [fit for fit in fits if fit.chi2 < best.chi2 + _CLEARLY]
    periods = sorted({fit.period for fit in close})
    ends = sorted({fit.end for fit in close})
    name = "interpolation period"
    period: float | None = None
    if len(periods) == 1 and periods[0] > _NO_PERIOD_S:
        period = periods[0]
        note = "of the usual periods, the only one that fits"
        key = "controller.interpolation_period_s"
        out.findings.append(Finding(name, period, period, period, "s", key, _SOURCE, note))
    else:
        shown = ", ".join("none" if t <= _NO_PERIOD_S else f"{t * 1e3:g} ms" for t in periods)
        out.findings.append(unknown(name, "s", _SOURCE, f"these fit equally well: {shown}", high=max(periods)))
    if len(ends) == 1:
        out.findings.append(Finding("block end", ends[0], None, None, "", "controller.block_end", _SOURCE))
    else:
        out.findings.append(unknown("block end", "", _SOURCE, "both fit: needs run_above, and a known period"))
    return best, period


def _determined(name: str, value: float, half: float, key: str, needs: str, note: str = "") -> Finding:
    if half > _WIDE * max(abs(value), 0.002):
        return unknown(name, "s", _SOURCE, f"needs {needs}; the interval would be ±{half * 1e3:.1f} ms", value + half)
    if value < -half:
        why = f"{value * 1e3:.1f} ms ± {half * 1e3:.1f} ms is negative: {needs} contradict each other"
        return unknown(name, "s", _SOURCE, why)
    return known(name, value, half, "s", key, _SOURCE, note)


def _cutting(best: _Fit, rows: dict[str, _Row], exponential: bool, out: StopwatchFit) -> None:
    cutting, half = best.get("cutting")
    if not exponential:
        needs, note = "stop_below, overhead", "a stopwatch sees only the sum"
        out.findings.append(_determined(CUTTING_SUM, cutting, half, "controller.time_constant_s", needs, note))
        out.findings.append(unknown("cutting bell time", "s", _SOURCE, "a stopwatch sees only the sum of both times"))
    for axis in AXES:
        value, half = best.get(axis)
        test = f"exact_{axis.lower()}"
        key = f"controller.in_position_s.{axis.lower()}"
        note = "after exact stops, if a dwell does not wait for in-position"
        out.findings.append(_determined(f"in-position time {axis}", value, half, key, f"{test}, stop_below", note))
    value, half = best.get("block")
    tiny = rows.get("blocks_tiny")
    if tiny is None:
        out.findings.append(unknown("block time", "s", _SOURCE, "needs blocks_tiny"))
        return
    part = tiny.test.parts[0]
    part = dataclasses.replace(part, count=1)
    floor = part_time_s(part, Timing(best.period, best.end, 0.0, 0.0))  # type: ignore[arg-type]
    if value <= 1.02 * floor + half or half > _WIDE * value:
        lasts = max(value, floor) * 1e3
        why = f"blocks of {part.duration_s * 1e3:.2f} ms last {lasts:.2f} ms: it hides behind the period"
        out.findings.append(
            unknown("block time", "s", _SOURCE, why, high=floor + 2.0 * tiny.sigma_s / tiny.test.parts[0].count)
        )
        return
    out.findings.append(known("block time", value, half, "s", "controller.block_time_s", _SOURCE))


def _rapids(best: _Fit, period: float | None, rows: dict[str, _Row], axis: str, out: StopwatchFit) -> None:
    """Time constant and bell time of an axis' rapids: all time constants are tried, the bell time is linear."""
    name, bell_name = f"rapid time constant {axis}", f"rapid bell time {axis}"
    mine = [row for row in rows.values() if row.test.parts[0].pattern == "rapid" and row.test.parts[0].axis == axis]
    if len(mine) < 2:
        for each in (name, bell_name):
            out.findings.append(unknown(each, "s", _SOURCE, f"needs two of the rapid_{axis.lower()} tests or more"))
        return
    overhead, overhead_half = best.get("overhead")
    count = np.array([row.test.parts[0].count for row in mine])
    sigma = np.array([math.hypot(row.sigma_s, overhead_half / 1.96) for row in mine]) / count
    seen = np.array([row.time_s - overhead for row in mine]) / count
    tick = period or _NO_PERIOD_S
    if period is None:
        sigma = np.hypot(sigma, 0.002)
    wait, wait_half = best.get(axis)
    # After a rapid comes at least the in-position wait, if that is known.
    least = max(0.0, wait - wait_half) if wait_half < 0.1 else 0.0
    chi2, after = np.empty(len(_RAMPS_S)), np.empty(len(_RAMPS_S))
    zero = {axis: 0.0}
    for k, ramp in enumerate(_RAMPS_S):
        timing = Timing(tick, "ceil", 0.0, 0.0, {axis: float(ramp)}, zero, zero)
        moving = np.array([part_time_s(dataclasses.replace(row.test.parts[0], count=1), timing) for row in mine])
        weight = 1.0 / sigma**2
        after[k] = max(least, float(weight @ (seen - moving)) / float(weight.sum()))
        chi2[k] = float((((seen - moving - after[k]) / sigma) ** 2).sum())
    floor = float(chi2.min())
    if floor > _CONTRADICTS**2 + 3.0 * len(mine):
        tests = ", ".join(row.test.name for row in mine)
        out.contradictions.append(
            f"{tests}: no time constant gives these times (chi² {floor:.0f}); is the rapid rate of the machine file "
            "right, and the rapid override 100 %?"
        )
        for each in (name, bell_name):
            out.findings.append(unknown(each, "s", _SOURCE, "the times contradict each other"))
        return
    inside = chi2 <= floor + _INSIDE
    step = float(_RAMPS_S[1] - _RAMPS_S[0])
    low, high = float(_RAMPS_S[inside].min()) - step, float(_RAMPS_S[inside].max()) + step
    likely = np.exp(-0.5 * (chi2[inside] - floor))
    value = float(likely @ _RAMPS_S[inside] / likely.sum())
    key = f"controller.rapid_time_constant_s.{axis.lower()}"
    if high - low > 2.0 * _WIDE * value:
        why = f"from {low * 1e3:.0f} to {high * 1e3:.0f} ms all fit; longer moves would tell more"
        out.findings.append(unknown(name, "s", _SOURCE, why, high))
    else:
        out.findings.append(Finding(name, value, low, high, "s", key, _SOURCE))
    sums = after[inside]
    total = float(likely @ sums / likely.sum())
    slack = math.hypot(wait_half, 1.96 / math.sqrt(float((1.0 / sigma**2).sum())))
    bell_low, bell_high = float(sums.min()) - wait - slack, float(sums.max()) - wait + slack
    if wait_half > 0.1:
        why = f"needs exact_{axis.lower()}: rapids alone show bell and in-position time together, {total * 1e3:.1f} ms"
        out.findings.append(unknown(bell_name, "s", _SOURCE, why, total))
        return
    bell = total - wait
    bell_key = f"controller.rapid_bell_time_s.{axis.lower()}"
    if bell_low <= 0.0:
        if bell_high > 2.0 * slack + 0.02:
            why = f"anything up to {bell_high * 1e3:.0f} ms fits"
            out.findings.append(unknown(bell_name, "s", _SOURCE, why, bell_high))
            return
        note = "none, or below the upper end"
        out.findings.append(Finding(bell_name, 0.0, 0.0, max(bell_high, 0.0), "s", bell_key, _SOURCE, note))
    elif bell_high - bell_low > 2.0 * _WIDE * bell:
        why = f"from {bell_low * 1e3:.0f} to {bell_high * 1e3:.0f} ms all fit"
        out.findings.append(unknown(bell_name, "s", _SOURCE, why, bell_high))
    else:
        note = "if rapids and exact stops wait equally long for in-position"
        out.findings.append(Finding(bell_name, bell, bell_low, bell_high, "s", bell_key, _SOURCE, note))


def _override(best: _Fit, rows: dict[str, _Row], out: StopwatchFit) -> None:
    for name in [each for each in rows if each.startswith("override")]:
        row = rows[name]
        part = row.test.parts[0]
        # without block overlap there is one ramp, whatever the override
        moving = row.time_s - best.get("overhead")[0] - best.get("cutting")[0]
        seen = 100.0 * part.count * part.duration_s / max(moving, 1e-3)
        half = 1.96 * seen * row.sigma_s / max(moving, 1e-3)
        right = abs(seen - row.test.override_percent) <= half + 1.0
        note = "time goes with 1 / override" if right else "the feed does not follow the override"
        quantity = f"feed at override {row.test.override_percent} %"
        out.findings.append(known(quantity, seen, half, "%", "", _SOURCE, note))


def fit_stopwatch(results: Results) -> StopwatchFit:
    """Fit everything that the stopwatch times hold.

    Args:
        results: the filled-in file; tests without times are left out.
    """
    rows = _rows(results)
    out = StopwatchFit()
    exponential = _shape(rows, out)
    left_out = {*_SLOW, "stop_above"} if exponential else {"stop_slow" if "stop_slower" in rows else ""}
    used = [
        row
        for name, row in rows.items()
        if name not in left_out and row.test.parts[0].pattern != "rapid" and not name.startswith("override")
    ]
    if exponential:
        # The tail of a run is not that of a stop: its last speed and its length are others.
        used = [
            dataclasses.replace(row, sigma_s=math.hypot(row.sigma_s, 1.5 * exponential))
            if row.test.parts[0].pattern == "continuous"
            else row
            for row in used
        ]
    if not used:
        out.findings.append(unknown("all but rapids", "", _SOURCE, "no times of the cutting tests"))
        return out
    fits = [_least_squares(used, period, end) for period in (_NO_PERIOD_S, *PERIODS_S) for end in ("ceil", "carry")]
    best, period = _discrete(fits, out)
    _cutting(best, rows, exponential > 0.0, out)
    timing = _timing(best.values.tolist(), best.period, best.end)
    for row in used:
        expected = program_time_s(row.test, timing)
        if abs(expected - row.time_s) > _CONTRADICTS * row.sigma_s + 0.001 * row.time_s:
            out.contradictions.append(
                f"{results.file}:{results.lines[row.test.name]}: {row.test.name}: {row.time_s:.2f} s; what fits all "
                f"tests best gives {expected:.2f} s"
            )
    for axis in AXES:
        _rapids(best, period, rows, axis, out)
    _override(best, rows, out)
    return out
