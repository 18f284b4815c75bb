"""What servo logs say about rapids: their ramp, their bell, and the wait behind them."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

from shapegcode.characterization.findings import Finding, known, mean, unknown
from shapegcode.characterization.logstate import BELL_GAIN, ODD_SHAPE, SOURCE, State, pitch_of
from shapegcode.characterization.moves import PartLog, ShapeFit, fit_shape, smoothed_share
from shapegcode.characterization.timing import whole_periods


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
    better = curved[0].rms_mm ** 2 < BELL_GAIN * plain[0].rms_mm ** 2
    fit, long, bell_found = curved if better and curved[0].values[1] > fine_s else plain
    values = list(zip(fit.values.tolist(), fit.half.tolist(), strict=True))
    if long:
        values.sort(reverse=True)
    ramp, bell_value = values[0], values[1] if bell_found else None
    moving = (rectangle if long else ramp[0]) + ramp[0] + (bell_value[0] if bell_value else 0.0)
    slack = (1.0 if long else 2.0) * ramp[1] + (bell_value[1] if bell_value else 0.0)
    pitch, half = pitch_of(part)
    return _Rapid(long, ramp, bell_value, (pitch - moving, half + slack), nominal, fit.rms_mm)


def fit_rapids(state: State, axis: str, parts: list[PartLog]) -> list[tuple[float, float]]:
    """Time constants of an axis' rapids; returns the in-position times that they show."""
    period = state.period or 1e-6
    lower = axis.lower()
    name, bell_name = f"rapid time constant {axis}", f"rapid bell time {axis}"
    every = [_rapid(part, period, state.fine_s) for part in parts]
    fits = [fit for fit, part in zip(every, parts, strict=True) if fit.rms_mm < ODD_SHAPE * abs(part.part.length_mm)]
    if not fits:
        why = f"the rapids are no constant acceleration: the best fit leaves {every[0].rms_mm * 1e3:.1f} µm"
        state.findings += [unknown(each, "s", SOURCE, why) for each in (name, bell_name)]
        return []
    long = [fit for fit in fits if fit.long]
    key = f"controller.rapid_time_constant_s.{lower}"
    if long:
        value, half = mean([fit.ramp[0] for fit in long], [fit.ramp[1] for fit in long])
        state.findings.append(known(name, value, half, "s", key, SOURCE, "ramp of rapids that reach the rate"))
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
            state.findings.append(Finding(name, (low + high) / 2.0, low, high, "s", key, SOURCE, note))
        else:
            why = "rapids of different length have different accelerations; is the rate in the machine file right?"
            state.findings.append(unknown(name, "s", SOURCE, why))
    bells = [fit.bell for fit in fits if fit.bell is not None]
    bell_key = f"controller.rapid_bell_time_s.{lower}"
    if len(bells) * 2 > len(fits):
        value, half = mean([each[0] for each in bells], [each[1] for each in bells])
        state.findings.append(known(bell_name, value, half, "s", bell_key, SOURCE))
    else:
        note = "no second moving average shows"
        state.findings.append(Finding(bell_name, 0.0, 0.0, max(state.fine_s, 0.002), "s", bell_key, SOURCE, note))
    return [fit.wait for fit in fits]
