"""Time constants from the shape of single moves in servo logs: of cutting moves between stops, and of rapids."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode.characterization.facts import CUTTING_SUM, Facts, mean
from shapegcode.characterization.moves import PartLog, ShapeFit, fit_shape, lagged_share, smoothed_share
from shapegcode.characterization.timing import whole_periods

__all__ = ["LogFacts", "fit_cutting", "fit_rapids"]

Array = npt.NDArray[np.float64]
_ODD_SHAPE = 0.002  # of the way: a fit that leaves more is no fit
_BELL_GAIN = 0.8  # a second moving average must lower the variance below this share
_FINE = 1.7  # periods
_FINE_BENT = 1.0
_NO_BELL = "no second moving average shows"
_SHAPE_NOTES = {"linear": "linear", "bell": "the longer of two moving averages", "exponential": "exponential"}


@dataclass
class LogFacts(Facts):
    """What the logs have told so far; times in s.

    Attributes:
        period: interpolation period; None: not known.
        held: whether the command is held over a period.
        bent: whether it is interpolated between periods.
        sampling: of the logs.
        cutting: time constant and bell time of cutting moves together; None: not known.
        cutting_half: half-width of its interval.
        exponential: whether cutting moves have the shape of an exponential.
    """

    source: str = "log"
    period: float | None = None
    held: bool = False
    bent: bool = False
    sampling: float = 0.001
    cutting: float | None = None
    cutting_half: float = 0.0
    exponential: bool = False

    @property
    def tick(self) -> float:
        """The period, or one so short that nothing is rounded."""
        return self.period or 1e-6

    @property
    def stop_s(self) -> float | None:
        """What a stop adds to a cutting move; None: not known, or an exponential, which has no end."""
        return None if self.exponential else self.cutting

    @property
    def fine_s(self) -> float:
        """A second moving average up to this length may be interpolation between unseen periods."""
        if self.bent and self.period:
            return _FINE_BENT * self.period
        return 0.0 if self.held else _FINE * max(self.period or 0.0, 2.0 * self.sampling)


# --- cutting moves ----------------------------------------------------------------------------------------------------


def fit_cutting(facts: LogFacts, stops: list[PartLog]) -> None:
    """Time constant and bell time from the shape of moves between stops."""
    names = ("cutting time constant", "cutting bell time")
    fits = _cutting_fits(facts, stops[:2])
    rms = {shape: math.sqrt(sum(fit.rms_mm**2 for fit in each) / len(each)) for shape, each in fits.items()}
    best = "exponential" if rms["exponential"] < min(rms["linear"], rms["bell"]) else "linear"
    bell = [min(fit.values[1:]) for fit in fits["bell"]]
    if best == "linear" and rms["bell"] ** 2 < _BELL_GAIN * rms["linear"] ** 2 and min(bell) > facts.fine_s:
        best = "bell"
    if rms[best] > _ODD_SHAPE * abs(stops[0].part.length_mm) + 3.0 * stops[0].noise_mm:
        why = (
            f"no moving average and no exponential: the best fit ({best}) leaves {rms[best] * 1e3:.1f} µm; "
            "was a look-ahead mode on?"
        )
        for name in names:
            facts.unknown(name, why)
        return
    # Of each fit the longest time first.
    times = [
        sorted(zip(fit.values[1:].tolist(), fit.half[1:].tolist(), strict=True), reverse=True) for fit in fits[best]
    ]
    value, half = mean(*zip(*(pairs[0] for pairs in times), strict=True))
    facts.known(names[0], value, half, "controller.time_constant_s", _SHAPE_NOTES[best])
    facts.said("cutting acceleration shape", best, "controller.after_interpolation_shape")
    facts.exponential = best == "exponential"
    facts.cutting, facts.cutting_half = value, half
    bell_key = "controller.bell_time_s"
    if best == "bell":
        second, second_half = mean(*zip(*(pairs[1] for pairs in times), strict=True))
        facts.known(names[1], second, second_half, bell_key)
        facts.cutting, facts.cutting_half = value + second, math.hypot(half, second_half)
    elif best == "linear":
        facts.between(names[1], 0.0, 0.0, max(facts.fine_s, 0.002), bell_key, _NO_BELL)
    if not facts.exponential:
        # What a stopwatch sees.
        facts.known(CUTTING_SUM, facts.cutting, facts.cutting_half)


def _cutting_fits(facts: LogFacts, stops: list[PartLog]) -> dict[str, list[ShapeFit]]:
    """Each part with each shape: its nominal duration and one or two times are fitted."""
    fits: dict[str, list[ShapeFit]] = {"linear": [], "bell": [], "exponential": []}
    for part in stops:
        nominal = part.part.duration_s
        longest = nominal + (facts.period or 0.004) * 1.1
        shapes = {
            "linear": ([nominal, 0.05], [nominal * 0.95, 1e-4], [longest, 1.0]),
            "bell": ([nominal, 0.06, 0.02], [nominal * 0.95, 1e-4, 1e-5], [longest, 1.0, 0.5]),
            "exponential": ([nominal, 0.03], [nominal * 0.95, 1e-4], [longest, 1.0]),
        }
        for shape, (guess, low, high) in shapes.items():
            share = _lagged if shape == "exponential" else _smoothed
            fits[shape].append(fit_shape(part, share, guess, low, high))
    return fits


def _smoothed(times: Array, boxes: Array) -> Array:
    return smoothed_share(times, boxes.tolist())


def _lagged(times: Array, values: Array) -> Array:
    return lagged_share(times, float(values[0]), float(values[1]))


# --- rapids -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Rapid:
    """Fit of one part of rapids; values with their half-widths, s."""

    long: bool  # whether the rate is reached
    ramp: tuple[float, float]
    bell: tuple[float, float] | None
    wait: tuple[float, float]
    nominal: float
    rms_mm: float


def _rapid(part: PartLog, facts: LogFacts) -> _Rapid:
    """The shape of rapids over one length, as a long move (the rate is reached) or a short one."""
    nominal = part.part.duration_s
    rectangle = whole_periods(nominal, facts.tick)
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
    fit, long, bell_found = curved if better and curved[0].values[1] > facts.fine_s else plain
    values = list(zip(fit.values.tolist(), fit.half.tolist(), strict=True))
    if long:
        values.sort(reverse=True)
    ramp, bell_value = values[0], values[1] if bell_found else None
    moving = (rectangle if long else ramp[0]) + ramp[0] + (bell_value[0] if bell_value else 0.0)
    slack = (1.0 if long else 2.0) * ramp[1] + (bell_value[1] if bell_value else 0.0)
    pitch, half = part.pitch_s()
    return _Rapid(long, ramp, bell_value, (pitch - moving, half + slack), nominal, fit.rms_mm)


def fit_rapids(facts: LogFacts, axis: str, parts: list[PartLog]) -> list[tuple[float, float]]:
    """Time constants of an axis' rapids; returns the in-position times that they show, with their half-widths."""
    name, bell_name = f"rapid time constant {axis}", f"rapid bell time {axis}"
    every = [_rapid(part, facts) for part in parts]
    fits = [fit for fit, part in zip(every, parts, strict=True) if fit.rms_mm < _ODD_SHAPE * abs(part.part.length_mm)]
    if not fits:
        why = f"the rapids are no constant acceleration: the best fit leaves {every[0].rms_mm * 1e3:.1f} µm"
        facts.unknown(name, why)
        facts.unknown(bell_name, why)
        return []
    key = f"controller.rapid_time_constant_s.{axis.lower()}"
    long = [fit.ramp for fit in fits if fit.long]
    if long:
        value, half = mean(*zip(*long, strict=True))
        facts.known(name, value, half, key, "ramp of rapids that reach the rate")
    else:
        low, high = _short_ramp(facts, fits)
        if low <= high:
            note = "no rapid reaches the rate: from their acceleration, in whole periods"
            facts.between(name, (low + high) / 2.0, low, high, key, note)
        else:
            facts.unknown(
                name, "rapids of different length have different accelerations; is the rate in the machine file right?"
            )
    bells = [fit.bell for fit in fits if fit.bell is not None]
    bell_key = f"controller.rapid_bell_time_s.{axis.lower()}"
    if len(bells) * 2 > len(fits):
        value, half = mean(*zip(*bells, strict=True))
        facts.known(bell_name, value, half, bell_key)
    else:
        facts.between(bell_name, 0.0, 0.0, max(facts.fine_s, 0.002), bell_key, _NO_BELL)
    return [fit.wait for fit in fits]


def _short_ramp(facts: LogFacts, fits: list[_Rapid]) -> tuple[float, float]:
    """Between which time constants rapids lie that do not reach the rate.

    Half of such a rapid lasts ceil(sqrt(nominal * A) / T) T (eq. 16 of paper 004, docs/evidence/references.md).
    """
    period = facts.tick
    halves = [(whole_periods(fit.ramp[0] - 0.3 * period, period), fit) for fit in fits]
    sure = [(half, fit) for half, fit in halves if abs(half - fit.ramp[0]) + fit.ramp[1] < 0.3 * period]
    slack = 0.0 if sure and facts.period else 1e-4
    pairs = sure if slack == 0.0 else [(fit.ramp[0], fit) for fit in fits]
    low = max((half - slack - period) ** 2 / fit.nominal for half, fit in pairs)
    high = min((half + slack) ** 2 / fit.nominal for half, fit in pairs)
    return low, high
