"""The families of shapers, one row each with source and validity, and their solvers.

A family is solved at continuous times, on a grid from its defining conditions, or both. Families of one mode are
extended to several by convolution, at continuous times and on a grid.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

from shapegcode import _core
from shapegcode._core import ArgumentError, DesignError, Shaper, grid_polynomial
from shapegcode.io.units import FloatArray
from shapegcode.shaping.bands import NARROW_PERCENT, Design, DesignOptions, ModeBand, evaluate, mode_names, ms, on_grid
from shapegcode.shaping.grid_designs import (
    RESIDUAL_LIMIT,
    Conditions,
    Zero,
    halved,
    shortest_non_negative,
    shortest_on_grid,
)
from shapegcode.shaping.robust import minimax_robust

Solve = Callable[[Sequence[ModeBand], DesignOptions], Sequence[_core.Shaper]]
"""All shapers of a family for some bands, the preferred one first."""
_STEPS_PER_PERIOD = 64  # of the fastest frequency: time grid of the SI shaper at continuous times
_PER_PERIOD = (40, 80, 160, 320)  # steps of the time grid in a period of the fastest mode
_NEIGHBOURS = 2.5  # steps: closer taps are merged into one tap between them
_NEWTON_STEPS = 30
_RESIDUAL = 1e-13
_SMALLEST_TAP = 1e-9
_FIRST = 0.7  # of the usual length: start of the search; no kernel without negative samples is shorter
_FURTHEST = 2.5
_STRIDES = 40  # of the usual length: first search step, before bisection
_MAX_SAMPLES = 20_000
_WHOLE = 1e-9
_CLEARLY = 1e-3  # of the largest sample: a negative sample beyond rounding error
_SINGULAR = 1e-12  # relative singular value below which two conditions coincide on this grid
_SPANS = (1.0, 2.0)  # searched durations relative to the convolved ZV, in order
_MAX_PERIODS = 100.0 - 1e-6  # of the fastest mode: the limit of minimal_shapers
_PROVEN_MODES = 3  # more modes need too many search boxes for a proof: searched from starting points only


def _one_after_the_other(of_one: Callable[[_core.Mode, DesignOptions], _core.Shaper]) -> Solve:
    def solve(bands: Sequence[ModeBand], options: DesignOptions) -> list[_core.Shaper]:
        shaper = of_one(bands[0].mode, options)
        for band in bands[1:]:
            shaper = _core.convolve(shaper, of_one(band.mode, options))
        return [shaper]

    return solve


def _defined(
    name: str,
    continuous: Callable[[_core.Mode, DesignOptions], _core.Shaper],
    conditions: Callable[[_core.Mode, DesignOptions], Conditions],
) -> Solve:
    """A closed form at continuous times; on a grid the shortest taps that satisfy its defining conditions."""

    def of_one(mode: _core.Mode, options: DesignOptions) -> _core.Shaper:
        if options.period_s is None:
            return continuous(mode, options)
        title, longest_s = f"{name} for {mode_names([mode])}", options.max_duration_s
        return shortest_on_grid(conditions(mode, options), options.period_s, longest_s, title=title)

    return _one_after_the_other(of_one)


def repeated(name: str, zeros: int) -> Solve:
    """ZV, ZVD, ZVDD ...: *zeros* zeros at each mode; on a grid the shortest non-negative impulses with these zeros."""
    return _defined(
        name,
        lambda mode, _options: _core.repeated_zv(mode, zeros),
        lambda mode, _options: Conditions(zeros=(Zero(mode, zeros),)),
    )


def hump_ei(name: str, humps: int) -> Solve:
    """EI with *humps* humps; on a grid the shortest impulses that have EI's zeros and keep its limit between them."""

    def conditions(mode: _core.Mode, options: DesignOptions) -> Conditions:
        zeros_hz = _core.extra_insensitive(mode, options.vibration_limit, humps).zeros_hz
        zeros = tuple(Zero(_core.Mode(frequency_hz, mode.damping_ratio)) for frequency_hz in zeros_hz)
        low_hz, high_hz = zeros_hz[0], zeros_hz[-1]
        middle = _core.Mode(0.5 * (low_hz + high_hz), mode.damping_ratio)
        return Conditions(zeros, (ModeBand(middle, (high_hz - low_hz) / (high_hz + low_hz)),), options.vibration_limit)

    return _defined(
        name, lambda mode, options: _core.extra_insensitive(mode, options.vibration_limit, humps).shaper, conditions
    )


modified = _defined(
    "MZV",
    lambda mode, _options: _core.mzv(mode),
    lambda mode, _options: Conditions(zeros=(Zero(mode), Zero(_core.mzv_second_zero(mode)))),
)
"""MZV; on a grid the shortest non-negative impulses with its two zeros."""

negative = _defined(
    "negative ZV",
    lambda mode, _options: _core.negative_zv(mode),
    lambda mode, _options: Conditions(zeros=(Zero(mode),), largest_tap=1.0),
)
"""Unity-magnitude ZV; on a grid the shortest taps between -1 and 1."""


def specified(bands: Sequence[ModeBand], options: DesignOptions) -> list[_core.Shaper]:
    """SI: the shortest non-negative impulses with a residual within the vibration limit over every band."""
    limit, period_s = options.vibration_limit, options.period_s
    if not 0.0 < limit < 1.0:
        raise _core.ArgumentError(f"the vibration limit is {limit:.4g}: it must be above 0 and below 1")
    if period_s is None:
        period_s = 1.0 / (_STEPS_PER_PERIOD * max(band.shifted(1.0).frequency_hz for band in bands))
    title = f"SI shaper with residual {limit:.4g} for {mode_names([band.mode for band in bands])}"
    conditions = Conditions(bands=tuple(bands), limit=limit)
    return [shortest_on_grid(conditions, period_s, options.max_duration_s, title=title)]


def simultaneous(bands: Sequence[ModeBand], options: DesignOptions) -> list[_core.Shaper]:
    """Shortest non-negative impulses at continuous times that cancel all modes at once."""
    return [simultaneous_zv([band.mode for band in bands], options.max_duration_s)]


def user_taps(_bands: Sequence[ModeBand], options: DesignOptions) -> list[_core.Shaper]:
    """The user's taps, checked against the grid if there is one."""
    if options.taps is None:
        raise _core.ArgumentError("the family taps evaluates the user's impulses: none are given")
    return [options.taps if options.period_s is None else on_grid(options.taps, options.period_s)]


def simultaneous_zv(modes: Sequence[_core.Mode], max_duration_s: float) -> _core.Shaper:
    """Design the shortest non-negative shaper at continuous times with zero residual at every mode."""
    fastest_hz = max(mode.frequency_hz for mode in modes)
    title = f"simultaneous shaper without negative impulses for {mode_names(modes)}"
    conditions = Conditions(zeros=tuple(Zero(mode) for mode in modes))
    for per_period in _PER_PERIOD:
        step_s = 1.0 / (per_period * fastest_hz)
        # the exact solution may be a step or two shorter than that on the grid
        try:
            start = shortest_on_grid(conditions, step_s, max_duration_s + 2.0 * step_s, title=title)
        except _core.DesignError as error:
            one_by_one_s = _core.convolved_zv(modes).duration_s
            raise _core.DesignError(
                f"no {title} within {ms(max_duration_s)}; the convolved ZV shapers take {ms(one_by_one_s)}"
            ) from error
        shaper = _polished(*_merged(start, _NEIGHBOURS * step_s), modes)
        if shaper is not None and shaper.duration_s <= max_duration_s * (1.0 + 1e-9):
            return shaper
    raise _core.DesignError(
        f"no {title} within {ms(max_duration_s)}: on a grid of {1e3 * step_s:.3g} ms there is one of "
        f"{ms(start.duration_s)}, but no exact one was found near it"
    )


def _merged(shaper: _core.Shaper, distance_s: float) -> tuple[FloatArray, FloatArray]:
    """Merge impulses at most `distance_s` apart at their weighted mean time; return times (first 0) and amplitudes."""
    groups: list[list[int]] = []
    for index, time_s in enumerate(shaper.times_s):
        if groups and time_s - shaper.times_s[groups[-1][-1]] <= distance_s:
            groups[-1].append(index)
        else:
            groups.append([index])
    amplitudes = np.array([shaper.amplitudes[group].sum() for group in groups])
    times = np.array([shaper.amplitudes[group] @ shaper.times_s[group] for group in groups]) / amplitudes
    return times - times[0], amplitudes


def _polished(times_s: FloatArray, amplitudes: FloatArray, modes: Sequence[_core.Mode]) -> _core.Shaper | None:
    """Newton iteration on all amplitudes and times; None unless it ends at a non-negative exact shaper."""
    poles = np.array([mode.pole for mode in modes])
    scale = float(np.abs(poles).max())
    count = len(times_s)
    target = np.zeros(2 * len(modes) + 1)
    target[-1] = 1.0
    best: tuple[float, FloatArray, FloatArray] = (math.inf, times_s, amplitudes)
    for _ in range(_NEWTON_STEPS):
        terms = np.exp(poles[:, None].real * (times_s[-1] - times_s) - 1j * poles[:, None].imag * times_s)
        by_amplitude = np.vstack([terms.real, terms.imag, np.ones(count)])
        slopes = -(poles[:, None] / scale) * terms * amplitudes
        by_time = np.vstack([slopes.real, slopes.imag, np.zeros(count)])[:, 1:]
        error = by_amplitude @ amplitudes - target
        size = float(np.abs(error).max())
        if not math.isfinite(size):
            return None
        if size < best[0]:
            best = (size, times_s, amplitudes)
        # the last tap's time also scales the sums, without effect on zeros; the Newton steps omit this
        change = np.linalg.lstsq(np.hstack([by_amplitude, by_time]), error, rcond=1e-10)[0]
        amplitudes = amplitudes - change[:count]
        times_s = times_s - np.concatenate([[0.0], change[count:]]) / scale
    _, times_s, amplitudes = best
    if np.any(np.diff(times_s) <= 0.0) or float(amplitudes.min()) < _SMALLEST_TAP:
        return None
    shaper = _core.Shaper(times_s.tolist(), (amplitudes / amplitudes.sum()).tolist())
    return shaper if max(shaper.residual_ratio(mode) for mode in modes) <= _RESIDUAL else None


def smooth(name: str, ratios: tuple[float, ...], periods: float, *, at_least: bool = False) -> Solve:
    """A polynomial kernel with zeros at these multiples of each mode's frequency.

    Source: D. Butyugin's smoothers of the printer firmware Kalico; derivation on a grid: this project.
    """

    def of_one(mode: _core.Mode, options: DesignOptions) -> _core.Shaper:
        period_s = options.grid_period_s
        usual = periods / (mode.frequency_hz * period_s)
        # one step more than unknowns: both ends have no sample
        fewest = max(2 * len(ratios) + 2, math.ceil((1.0 - _WHOLE if at_least else _FIRST) * usual))
        most = max(2 * fewest, int(_FURTHEST * usual))
        title = f"{name} for {mode_names([mode])} on a {ms(period_s)} grid"
        if usual > _MAX_SAMPLES:
            raise _core.DesignError(
                f"{title} would take {usual:.0f} samples: at most {_MAX_SAMPLES}; use a longer period"
            )

        def taps(steps: int) -> FloatArray | None:
            return _samples(mode, ratios, period_s, steps)

        steps = _first(lambda count: taps(count) is not None, fewest, most, max(1, int(usual) // _STRIDES))
        found = None if steps is None else taps(steps)
        if found is None:
            raise _core.DesignError(
                f"no {title} up to {ms(most * period_s)}: no polynomial of degree {2 * len(ratios) + 2} without "
                f"negative samples has its zeros there; {_other_period(max(ratios) * mode.frequency_hz, period_s)}"
            )
        return _core.Shaper((np.arange(len(found)) * period_s).tolist(), found.tolist())

    return _one_after_the_other(of_one)


def _first(good: Callable[[int], bool], fewest: int, most: int, stride: int) -> int | None:
    """Smallest good count from `fewest` to `most`, by strides, then bisection; None: none is good."""
    if fewest > most:
        return None
    counts = [*range(fewest, most, stride), most]
    at = next((index for index, count in enumerate(counts) if good(count)), None)
    return None if at is None else halved(good, counts[at - 1] if at else fewest - 1, counts[at])


def _samples(mode: _core.Mode, ratios: tuple[float, ...], period_s: float, steps: int) -> FloatArray | None:
    """Samples inside a kernel of `steps` periods; None if one is not above 0, or a zero is missed."""
    x = 2.0 * np.arange(1, steps) / steps - 1.0
    count = 2 * len(ratios) + 1
    basis = legendre.legvander(x, count - 1) * (1.0 - x * x)[:, None]
    rows = [np.ones(len(x))]
    for index, ratio in enumerate(ratios):
        pole = _core.Mode(ratio * mode.frequency_hz, mode.damping_ratio).pole
        # residual of each sample at the last one; a double zero also cancels the derivative
        terms = np.exp((pole.real * (len(x) - 1 - np.arange(len(x))) + 1j * pole.imag * np.arange(len(x))) * period_s)
        terms = terms * x ** ratios[:index].count(ratio)
        rows += [terms.real, terms.imag]
    matrix = np.array(rows)
    target = np.eye(len(rows))[0]
    taps = basis @ np.linalg.lstsq(matrix @ basis, target, rcond=_SINGULAR)[0]
    if float(taps.min()) < -_CLEARLY * float(taps.max()):
        return None
    for _ in range(2):  # correct rounding errors of the zeros
        taps = taps + np.linalg.lstsq(matrix, target - matrix @ taps, rcond=_SINGULAR)[0]
    if float(np.abs(matrix @ taps - target).max()) > RESIDUAL_LIMIT or float(taps.min()) <= 0.0:
        return None
    return np.asarray(taps / taps.sum(), dtype=np.float64)


def _other_period(highest_hz: float, period_s: float) -> str:
    if 2.0 * highest_hz * period_s > 1.0:
        return f"a period below {ms(0.5 / highest_hz)} resolves its highest zero, {highest_hz:.4g} Hz"
    return "this family is for modes with less damping"


def solve_minimal(bands: Sequence[ModeBand], options: DesignOptions) -> list[_core.Shaper]:
    """Minimal shapers of the bands' nominal modes: those without negative impulses first, each group by duration."""
    modes = [band.mode for band in bands]
    longest_s = min(options.max_duration_s, _MAX_PERIODS / max(mode.frequency_hz for mode in modes))
    usual_s = _core.convolved_zv(modes).duration_s
    boxes = {} if len(modes) <= _PROVEN_MODES else {"max_boxes": 0}
    for span in _SPANS:
        found = _core.minimal_shapers(modes, min(span * usual_s, longest_s), max_abs_sum=options.max_abs_sum, **boxes)
        if found.shapers or found.max_duration_s >= longest_s:
            break
    if not found.shapers:
        raise _core.DesignError(_none_found(modes, found))
    return sorted(found.shapers, key=lambda shaper: shaper.has_negative)


def _none_found(modes: Sequence[_core.Mode], found: _core.MinimalShapers) -> str:
    names = ", ".join(f"{mode.frequency_hz:g} Hz" for mode in modes)
    what = (
        f"no minimal shaper of {names} takes up to {ms(found.max_duration_s)} with sum|a| up to {found.max_abs_sum:g}"
    )
    if found.complete:
        return what + ": proven; increase the limit"
    return f"{what} was found from {found.starts} starts, proven up to {ms(found.complete_up_to_s)}"


_SAME_POLE = 1e-9  # relative
_SLACK = 1e-9  # tolerance of a limit, for rounding


@dataclass(frozen=True)
class Family:
    """A row of the registry."""

    name: str  # short name, as in options and reports
    title: str  # full name
    source: str  # source; in full in docs/evidence/references.md
    validity: str  # modes and times for which it exists, and its limits
    continuous: bool  # whether it can be designed at continuous times
    on_grid: bool  # whether it can be designed on a grid
    # all shapers of the family for the bands, preferred one first; raises DesignError, which names the nearest design,
    # if none exists
    solve: Solve


def _polynomial(bands: Sequence[ModeBand], options: DesignOptions) -> list[Shaper]:
    return [grid_polynomial([band.mode for band in bands], options.grid_period_s)]


def _shortest_non_negative(bands: Sequence[ModeBand], options: DesignOptions) -> list[Shaper]:
    return [shortest_non_negative([band.mode for band in bands], options.grid_period_s, options.max_duration_s)]


def _robust(bands: Sequence[ModeBand], options: DesignOptions) -> list[Shaper]:
    if not any(band.uncertainty for band in bands):
        raise DesignError(
            f"no mode has a band to design for (bands in a machine file up to {NARROW_PERCENT:g} % count as "
            "exact): the robust design is that of family non-negative"
        )
    return _mirrored(bands, options, mirrored=False)


def _mirrored(bands: Sequence[ModeBand], options: DesignOptions, *, mirrored: bool = True) -> list[Shaper]:
    found = minimax_robust(
        bands, options.grid_period_s, vibration_limit=options.vibration_limit, max_duration_s=options.max_duration_s,
        mirrored=mirrored, hints=False,
    )  # fmt: skip
    return [found.shaper]


_KALICO = "the printer firmware Kalico; on a grid: this project"
_SMOOTH = "as smooth-zv; flat towards faster modes, so a grid must resolve its highest zero"

FAMILIES: tuple[Family, ...] = (
    Family(
        "zv", "zero vibration, one mode after the other",
        "Smith 1958; Park, Hong and Danielson 2009 (paper 002), eq. 1-3",
        "any modes, damped or not; exact at the nominal frequencies only", True, True, repeated("ZV", 1),
    ),
    Family(
        "zvd", "zero vibration and derivative", "Singer and Seering 1990",
        "any modes; double zeros at the nominal frequencies, twice as long as ZV", True, True,
        repeated("ZVD", 2),
    ),
    Family(
        "zvdd", "zero vibration and two derivatives", "Singer and Seering 1990",
        "any modes; triple zeros at the nominal frequencies, three times as long as ZV", True, True,
        repeated("ZVDD", 3),
    ),
    Family(
        "mzv", "modified zero vibration", "the printer firmware Klipper",
        "any modes; zeros at each mode and at 5/3 of its damped frequency, 1.5 times as long as ZV", True, True,
        modified,
    ),
    Family(
        "ei", "extra-insensitive, one hump", "Singhose, Seering and Singer 1994; damped: this project",
        "modes damped up to about 0.7; residual at the vibration limit at the nominal frequency", True, True,
        hump_ei("EI", 1),
    ),
    Family(
        "ei2", "extra-insensitive, two humps", "Singhose, Porter, Tuttle and Singer 1997; damped: this project",
        "modes damped up to about 0.45; zero at the nominal frequency, the vibration limit on both sides", True, True,
        hump_ei("two-hump EI", 2),
    ),
    Family(
        "ei3", "extra-insensitive, three humps", "Singhose, Porter, Tuttle and Singer 1997; damped: this project",
        "modes damped up to about 0.3; residual at the vibration limit at the nominal frequency", True, True,
        hump_ei("three-hump EI", 3),
    ),
    Family(
        "si", "specified insensitivity", "Singhose, Seering and Singer 1996; linear programs: this project",
        "any modes with their bands, all at once; residual up to the vibration limit; without a grid its times are "
        "multiples of 1/64 of the fastest mode's period", True, True, specified,
    ),
    Family(
        "negative-zv", "unity-magnitude ZV with a negative impulse", "Singhose, Singer and Seering 1994",
        "any modes; shorter than ZV, sum |a| 3 for one mode; excites faster modes", True, True, negative,
    ),
    Family(
        "simultaneous", "shortest without negative impulses, all modes at once", "this project",
        "any modes at continuous times; on a grid it is the family non-negative", True, False, simultaneous,
    ),
    Family(
        "minimal", "one impulse more than modes",
        "Park, Hong and Danielson 2009 (paper 002), eq. 4-17; searches of this project",
        "one to six modes, damped or not, at continuous times (on a grid replaced by the polynomial); exact at the "
        "nominal frequencies only; impulses may be negative", True, False, solve_minimal,
    ),
    Family(
        "polynomial", "shortest exact shaper of a grid", "this project",
        "any modes on any grid on which none aliases to zero; impulses may be negative and large",
        False, True, _polynomial,
    ),
    Family(
        "non-negative", "shortest shaper of a grid without negative impulses", "this project",
        "any modes on a grid on which one exists within the longest duration", False, True, _shortest_non_negative,
    ),
    Family(
        "robust", "shortest shaper of a grid below a residual over the bands", "this project",
        "modes with a band; others with them are cancelled exactly; no impulse is negative", False, True, _robust,
    ),
    Family(
        "mirrored", "robust and symmetric in time: equal contours in both directions", "this project",
        "any modes; those without a band are cancelled exactly; no impulse is negative; longer than robust",
        False, True, _mirrored,
    ),
    Family(
        "smooth-zv", "polynomial kernel with a zero at the mode (Kalico's smooth_zv)", _KALICO,
        "any modes, best on a grid of four periods in a cycle or more; its samples are the impulses, none is negative; "
        "exact at the nominal frequencies", False, True, smooth("smooth-zv", (1.0,), 0.8025),
    ),
    Family(
        "smooth-mzv", "polynomial kernel with zeros at 1 and 5/3 times the mode (smooth_mzv)", _KALICO,
        _SMOOTH, False, True, smooth("smooth-mzv", (1.0, 5.0 / 3.0), 0.95625),
    ),
    Family(
        "smooth-ei", "polynomial kernel with zeros at 1 and 1.414 times the mode (smooth_ei)", _KALICO,
        _SMOOTH, False, True, smooth("smooth-ei", (1.0, 1.41375), 1.06625),
    ),
    Family(
        "smooth-ei2", "polynomial kernel with zeros at 1, 1.525 and 2.159 times the mode (smooth_2hump_ei)", _KALICO,
        _SMOOTH, False, True, smooth("smooth-ei2", (1.0, 1.525, 2.159), 1.14875),
    ),
    Family(
        "smooth-si", "polynomial kernel with zeros at 1, 1.55 and 2.33 times the mode (smooth_si)", _KALICO,
        _SMOOTH, False, True, smooth("smooth-si", (1.0, 1.5495, 2.32975), 1.245, at_least=True),
    ),
    Family(
        "smooth-zvd-ei", "polynomial kernel with a double zero at the mode and one at 1.69 times it (smooth_zvd_ei)",
        _KALICO, _SMOOTH, False, True, smooth("smooth-zvd-ei", (1.0, 1.0, 1.6875), 1.475),
    ),
    Family(
        "taps", "impulses as given", "the user",
        "evaluated as given; on a grid only if their times lie on it", True, True, user_taps,
    ),
)  # fmt: skip
"""Every family, in the order of tables."""


def family_named(name: str) -> Family:
    """Find a family by name."""
    rows = {row.name: row for row in FAMILIES}
    if name not in rows:
        raise ArgumentError(f"{name!r} is not a family of shapers: {', '.join(rows)}")
    return rows[name]


def distinct(bands: Sequence[ModeBand]) -> list[ModeBand]:
    """The bands; of modes whose poles agree within 1e-9 only the wider one, so that no mode is cancelled twice."""
    kept: list[ModeBand] = []
    for band in bands:
        pole = band.mode.pole
        for index, other in enumerate(kept):
            if abs(other.mode.pole - pole) <= _SAME_POLE * abs(pole):
                kept[index] = max(other, band, key=lambda each: each.uncertainty)
                break
        else:
            kept.append(band)
    return kept


def design(name: str, bands: Sequence[ModeBand], options: DesignOptions | None = None) -> list[Design]:
    """Design and evaluate the shapers of a family for some modes, within limits; the preferred one first."""
    options = options or DesignOptions()
    row = family_named(name)
    if not bands:
        raise ArgumentError("a shaper needs at least one mode: 0 given")
    if options.period_s is None and not row.continuous:
        raise ArgumentError(f"{name} is designed on a grid: specify its period")
    if options.period_s is not None and not row.on_grid:
        raise ArgumentError(f"{name} has no design on a grid: omit the period ({row.validity})")
    found = row.solve(distinct(bands), options)
    max_s, max_sum = options.max_duration_s, options.max_abs_sum
    within = [
        shaper
        for shaper in found
        if row.name == "taps"
        or (shaper.duration_s <= max_s * (1.0 + _SLACK) and shaper.abs_sum <= max_sum * (1.0 + _SLACK))
    ]
    if found and not within:
        nearest = min(found, key=lambda shaper: shaper.duration_s)
        raise DesignError(
            f"{name} takes {ms(nearest.duration_s)} with sum|a| {nearest.abs_sum:.4g}: the limits are {ms(max_s)} and "
            f"{max_sum:.4g}"
        )
    return [evaluate(name, shaper, bands, options.period_s) for shaper in within]
