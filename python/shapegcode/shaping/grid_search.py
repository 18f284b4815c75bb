"""The families of shapers on a sample grid: what defines them, imposed exactly there.

Rounding the times of a continuous design to a grid undoes its zeros. So a family is taken here by the
conditions that define it, and the shortest taps on the grid that meet them are looked for: zeros, with their
multiplicity, hold at ``z = e^{s*period}`` to rounding; a tolerated residual holds over its whole band, proven by
:func:`shapegcode._core.worst_residual`. A zero is linear in the taps. A limit on the residual is linear for each
frequency and direction, and the ones that matter are found as the linear program breaks them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.shaping.bands import check_times, ms, whole_periods
from shapegcode.shaping.cutting_planes import TapProgram
from shapegcode.shaping.grid_designs import RESIDUAL_LIMIT, exact_conditions, halved, refined

_LONGER = 4  # times the longest duration: how far a refusal looks for what would do
_HINT_PERIODS = 400  # longest grid that a refusal searches, periods
LIMIT_MARGIN = 1e-3
"""Share of a tolerated residual that the search leaves unused, so that it ends: the shortest is meant with it."""
_SUPPORT_THRESHOLDS = (1e-9, 1e-7, 1e-13)  # magnitudes above one of these are taps
_FIRST_DIRECTIONS = 8
_FIRST_FREQUENCIES = 5
_SWEEP = 65  # frequencies of a band at which new planes are looked for
_MOST_ROUNDS = 60
_CENTRES = (0.0, 0.5, 1.0)  # of the duration: starts on the way to the least second central moment
_CENTRINGS = 4  # steps of that way
_SAME_CENTRE = 1e-6  # of the duration


def shortest_on_grid(conditions: Conditions, period_s: float, max_duration_s: float, *, title: str) -> _core.Shaper:
    """Shortest shaper with taps at multiples of a period that meets the conditions.

    Among the shapers of the shortest duration, one without negative impulses has the least second central moment that
    was found (the contour cost; a local minimum from three starts), one with them the least sum of magnitudes.

    Source: this project.
    """
    check_times(period_s=period_s, max_duration_s=max_duration_s)
    search = GridSearch(conditions, period_s)
    most = whole_periods(max_duration_s, period_s)
    shaper = search.shortest(most)
    if shaper is not None:
        return shaper
    text = f"no {title} within {ms(max_duration_s)} on a {ms(period_s)} grid"
    further = min(_LONGER * most, _HINT_PERIODS)
    if further > most:
        longer = search.shortest(further)
        if longer is not None:
            raise _core.DesignError(f"{text}; the shortest lasts {ms(longer.duration_s)}")
        text += f", nor within {ms(further * period_s)}"
    raise _core.DesignError(f"{text}; {_polynomial(conditions, period_s)}; try another period")


def _polynomial(conditions: Conditions, period_s: float) -> str:
    if not conditions.zeros:
        return "there is no zero from which a polynomial could be made"
    try:
        shaper = _core.Shaper([0.0], [1.0])
        for zero in conditions.zeros:
            for _ in range(zero.multiplicity):
                shaper = _core.convolve(shaper, _core.grid_polynomial([zero.mode], period_s))
    except _core.ShapegcodeError as error:
        return f"nor is there a polynomial: {error}"
    return f"the polynomial with its zeros lasts {ms(shaper.duration_s)} with sum|a| {shaper.abs_sum:.4g}"


@dataclass(frozen=True)
class Zero:
    """A mode of which nothing may be left: `multiplicity` - 1 derivatives of the residual vanish with it."""

    mode: _core.Mode
    multiplicity: int = 1


@dataclass(frozen=True)
class ResidualLimit:
    """The most that may be left of a mode (no unit) whose natural frequency lies anywhere in a band (Hz)."""

    mode: _core.Mode
    lowest_hz: float
    highest_hz: float
    limit: float

    def worst(self, shaper: _core.Shaper) -> tuple[float, float]:
        """Proven bound on the residual over the band, and the frequency (Hz) where it is largest."""
        found = _core.worst_residual(shaper, self.mode, self.lowest_hz, self.highest_hz)
        return found.upper_bound, found.frequency_hz


@dataclass(frozen=True)
class Conditions:
    """What a shaper must satisfy."""

    zeros: tuple[Zero, ...] = ()  # met to rounding
    limits: tuple[ResidualLimit, ...] = ()  # met over their bands
    largest_tap: float | None = None  # None: no tap is negative; else: the largest magnitude of a tap, either sign


@dataclass(frozen=True)
class _Plane:
    """Re(e^{-j direction} R) <= limit at one frequency, R seen from the middle of the shaper."""

    pole: complex
    direction: float
    limit: float


class GridSearch:
    """The linear programs of one set of conditions; the planes that were found are good for every duration."""

    def __init__(self, conditions: Conditions, period_s: float) -> None:
        self._conditions = conditions
        self._period_s = period_s
        # By number of periods, with the number of planes that are in it.
        self._programs: dict[int, tuple[TapProgram, int]] = {}
        self._answers: dict[int, FloatArray | None] = {}
        self._planes = [
            _Plane(_core.Mode(float(frequency_hz), each.mode.damping_ratio).pole, float(direction), each.limit)
            for each in conditions.limits
            for frequency_hz in _frequencies(each, _FIRST_FREQUENCIES)
            for direction in 2.0 * np.pi * np.arange(_FIRST_DIRECTIONS) / _FIRST_DIRECTIONS
        ]

    def shortest(self, most: int) -> _core.Shaper | None:
        """The shortest shaper of at most that many periods, or None."""
        last = self._smallest_feasible(most)
        while last is not None and last <= most:
            for taps in self._candidates(last):
                shaper = self._polished(taps)
                if shaper is not None:
                    return shaper
            last += 1  # what the linear program took for feasible was so within its tolerance only
        return None

    def _smallest_feasible(self, most: int) -> int | None:
        """A solution stays one with further taps at zero: from a first guess in growing steps, then by halving."""
        at, step = min(self._usual_periods(), most), 1
        too_few, enough = -1, most + 1
        if self._feasible(at) is None:
            too_few = at
            while too_few < most and enough > most:
                at, step = min(at + step, most), 2 * step
                if self._feasible(at) is None:
                    too_few = at
                else:
                    enough = at
            if enough > most:
                return None
        else:
            enough = at
            while enough > 0 and too_few < 0:
                at, step = max(at - step, 0), 2 * step
                if self._feasible(at) is None:
                    too_few = at
                else:
                    enough = at
        return halved(lambda last: self._feasible(last) is not None, too_few, enough)

    def _usual_periods(self) -> int:
        """Estimate of the duration found: half a cycle for each zero, a whole one for each limit without a zero in
        it."""
        swings_s = sum(0.5 * zero.multiplicity / zero.mode.frequency_hz for zero in self._conditions.zeros)
        if not self._conditions.zeros:
            swings_s = sum(1.0 / limit.mode.frequency_hz for limit in self._conditions.limits)
        return max(1, math.ceil(swings_s / self._period_s))

    def _candidates(self, last: int) -> list[FloatArray]:
        feasible = self._feasible(last)
        rest = [] if feasible is None else [feasible]
        if self._conditions.largest_tap is not None:
            best = self._best(last, 0.0)
            return rest if best is None else [best, *rest]

        def variance(taps: FloatArray) -> float:
            steps = np.arange(last + 1)
            return float(taps @ (steps - taps @ steps) ** 2)

        seen: list[float] = []
        centred = [taps for share in _CENTRES for taps in self._centred(last, share * last, seen)]
        return [*sorted(centred, key=variance), *rest]

    def _centred(self, last: int, centre: float, seen: list[float]) -> list[FloatArray]:
        """Taps of each step from a centre (periods) to a local minimum of the second moment, or to where one passed."""
        found: list[FloatArray] = []
        for _ in range(_CENTRINGS):
            if any(abs(centre - other) < _SAME_CENTRE * (last + 1) for other in seen):
                break
            seen.append(centre)
            taps = self._best(last, centre)
            if taps is None:
                break
            found.append(taps)
            mean = float(taps @ np.arange(last + 1))
            centre = mean  # the second central moment is concave in the taps: each step lowers it
        return found

    def _feasible(self, last: int) -> FloatArray | None:
        """Taps at 0 ... `last` periods that meet the conditions; None: proven not to be."""
        if self._conditions.limits:  # the planes found since say more
            return self._found_feasible(last)
        if last not in self._answers:
            self._answers[last] = self._found_feasible(last)
        return self._answers[last]

    def _found_feasible(self, last: int) -> FloatArray | None:
        for _ in range(_MOST_ROUNDS):
            found = self._program(last, None)
            if found is None:
                return None
            taps, share = found
            if share > 1.0 - LIMIT_MARGIN:
                return None
            if not self._cut(taps):
                return taps
        return None

    def _best(self, last: int, centre: float) -> FloatArray | None:
        """Taps of least second moment about `centre` (periods), signed ones of least sum of magnitudes, or None."""
        cost = ((np.arange(last + 1) - centre) / max(1, last)) ** 2
        for _ in range(_MOST_ROUNDS):
            found = self._program(last, cost)
            if found is None or not self._cut(found[0]):
                return None if found is None else found[0]
        return None

    def _program(self, last: int, cost: FloatArray | None) -> tuple[FloatArray, float] | None:
        """The taps of least cost, or (None) with the least share of the limits used, and that share."""
        if cost is not None and self._conditions.largest_tap is not None:
            cost = np.ones(last + 1)
        try:
            return self._with_planes(last).solve(cost, 1.0 - LIMIT_MARGIN)
        except _core.DesignError:
            return None

    def _with_planes(self, last: int) -> TapProgram:
        largest = self._conditions.largest_tap
        program, done = self._programs.get(last, (None, 0))
        if program is None:
            program = TapProgram(self._equalities(last), signed=largest is not None, largest=largest or math.inf)
        new = self._planes[done:]
        if new:
            planes = self._inequalities(new, last) / np.array([plane.limit for plane in new])[:, None]
            program.add_planes(planes, np.zeros(len(new)))
        self._programs[last] = program, len(self._planes)
        return program

    def _equalities(self, last: int) -> tuple[FloatArray, FloatArray]:
        zeros = self._conditions.zeros
        modes, counts = [zero.mode for zero in zeros], [zero.multiplicity for zero in zeros]
        return exact_conditions(modes, self._period_s, last, counts)

    def _inequalities(self, planes: Sequence[_Plane], last: int) -> FloatArray:
        poles = np.array([plane.pole for plane in planes])
        directions = np.array([plane.direction for plane in planes])
        phases = poles.imag[:, None] * self._period_s * (np.arange(last + 1) - 0.5 * last) - directions[:, None]
        decay = np.exp(poles.real[:, None] * self._period_s * (last - np.arange(last + 1)))
        return np.asarray(decay * np.cos(phases), dtype=np.float64)

    def _cut(self, taps: FloatArray) -> bool:
        if not self._conditions.limits:
            return False
        last = len(taps) - 1
        shaper = _core.Shaper((np.arange(last + 1) * self._period_s).tolist(), (taps / taps.sum()).tolist())
        before = len(self._planes)
        for each in self._conditions.limits:
            worst, frequency_hz = each.worst(shaper)
            if worst <= each.limit:
                continue
            sweep = _frequencies(each, _SWEEP)
            curve = np.array(_core.sensitivity_curve(shaper, each.mode.damping_ratio, sweep.tolist()))
            padded = np.concatenate([[-1.0], curve, [-1.0]])
            peaks = sweep[(curve >= padded[:-2]) & (curve >= padded[2:]) & (curve > each.limit)]
            for frequency in (*peaks.tolist(), frequency_hz):
                pole = _core.Mode(frequency, each.mode.damping_ratio).pole
                steps = np.arange(last + 1)
                left = np.exp(self._period_s * (pole.real * (last - steps) + 1j * pole.imag * steps)) @ taps
                direction = float(np.angle(left)) - pole.imag * self._period_s * 0.5 * last
                self._planes.append(_Plane(pole, direction, each.limit))
        return len(self._planes) > before

    def _polished(self, vertex: FloatArray) -> _core.Shaper | None:
        """The taps solved again to rounding, or None if they then break a condition."""
        matrix, right = self._equalities(len(vertex) - 1)
        largest = self._conditions.largest_tap
        for threshold in _SUPPORT_THRESHOLDS:
            support = np.flatnonzero(np.abs(vertex) > threshold)
            taps = vertex[support]
            free = np.ones(len(taps), dtype=bool)
            if largest is not None:
                free = np.abs(taps) < largest - 1e-8
                taps[~free] = np.copysign(largest, taps[~free])
            columns = matrix[:, support]
            taps[free] = refined(columns[:, free], right - columns[:, ~free] @ taps[~free], taps[free])
            if abs(taps.sum() - 1.0) <= RESIDUAL_LIMIT and (taps.min() > 0.0 or largest is not None):
                times = (support - support[0]) * self._period_s
                shaper = _core.Shaper(times.tolist(), (taps / taps.sum()).tolist())
                if self._meets(shaper) and float(np.abs(matrix[:-1, support] @ taps).max(initial=0.0)) < RESIDUAL_LIMIT:
                    return shaper
        return None

    def _meets(self, shaper: _core.Shaper) -> bool:
        largest = self._conditions.largest_tap
        return (
            all(shaper.residual_ratio(zero.mode) <= RESIDUAL_LIMIT for zero in self._conditions.zeros)
            and all(each.worst(shaper)[0] <= each.limit for each in self._conditions.limits)
            and (largest is None or float(np.abs(shaper.amplitudes).max()) <= largest * (1.0 + RESIDUAL_LIMIT))
        )


def _frequencies(limit: ResidualLimit, count: int) -> FloatArray:
    if limit.lowest_hz == limit.highest_hz:
        return np.array([limit.lowest_hz])
    return np.linspace(limit.lowest_hz, limit.highest_hz, count)
