"""The families of shapers: one row each, with source and validity."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from shapegcode._core import ArgumentError, DesignError, Shaper, grid_polynomial
from shapegcode.shaping import solvers
from shapegcode.shaping.bands import NARROW_PERCENT, Design, DesignOptions, ModeBand, evaluate, ms
from shapegcode.shaping.grid_designs import shortest_non_negative
from shapegcode.shaping.robust import minimax_robust

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
    solve: Callable[[Sequence[ModeBand], DesignOptions], Sequence[Shaper]]


def _polynomial(bands: Sequence[ModeBand], options: DesignOptions) -> list[Shaper]:
    return [grid_polynomial([band.mode for band in bands], options.grid_period_s)]


def _shortest_non_negative(bands: Sequence[ModeBand], options: DesignOptions) -> list[Shaper]:
    return [shortest_non_negative([band.mode for band in bands], options.grid_period_s, options.max_duration_s)]


def _robust(bands: Sequence[ModeBand], options: DesignOptions) -> list[Shaper]:
    if not any(band.uncertainty for band in bands):
        raise DesignError(
            f"no mode has a band to design for (those in a machine file up to {NARROW_PERCENT:g} % count as "
            "exact): a robust design is the non-negative one"
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
        "any modes, damped or not; exact at the nominal frequencies only", True, True, solvers.repeated("ZV", 1),
    ),
    Family(
        "zvd", "zero vibration and derivative", "Singer and Seering 1990",
        "any modes; double zeros at the nominal frequencies, twice as long as ZV", True, True,
        solvers.repeated("ZVD", 2),
    ),
    Family(
        "zvdd", "zero vibration and two derivatives", "Singer and Seering 1990",
        "any modes; triple zeros at the nominal frequencies, three times as long as ZV", True, True,
        solvers.repeated("ZVDD", 3),
    ),
    Family(
        "mzv", "modified zero vibration", "the printer firmware Klipper",
        "any modes; zeros at each mode and at 5/3 of its damped frequency, half as long again as ZV", True, True,
        solvers.modified,
    ),
    Family(
        "ei", "extra-insensitive, one hump", "Singhose, Seering and Singer 1994; damped: this project",
        "modes damped up to about 0.7; residual at the vibration limit at the nominal frequency", True, True,
        solvers.hump_ei("EI", 1),
    ),
    Family(
        "ei2", "extra-insensitive, two humps", "Singhose, Porter, Tuttle and Singer 1997; damped: this project",
        "modes damped up to about 0.45; zero at the nominal frequency, the vibration limit on both sides", True, True,
        solvers.hump_ei("two-hump EI", 2),
    ),
    Family(
        "ei3", "extra-insensitive, three humps", "Singhose, Porter, Tuttle and Singer 1997; damped: this project",
        "modes damped up to about 0.3; residual at the vibration limit at the nominal frequency", True, True,
        solvers.hump_ei("three-hump EI", 3),
    ),
    Family(
        "si", "specified insensitivity", "Singhose, Seering and Singer 1996; linear programs: this project",
        "any modes with their bands, all at once; residual up to the vibration limit; without a grid its times are "
        "1/64 of the fastest period apart", True, True, solvers.specified,
    ),
    Family(
        "negative-zv", "unity-magnitude ZV with a negative impulse", "Singhose, Singer and Seering 1994",
        "any modes; shorter than ZV, sum |a| 3 for one mode; excites faster modes", True, True, solvers.negative,
    ),
    Family(
        "simultaneous", "shortest without negative impulses, all modes at once", "this project",
        "any modes at continuous times; on a grid it is the family non-negative", True, False, solvers.simultaneous,
    ),
    Family(
        "minimal", "one impulse more than modes",
        "Park, Hong and Danielson 2009 (paper 002), eq. 4-17; searches of this project",
        "one to six modes, damped or not, at continuous times (on a grid replaced by the polynomial); exact at the "
        "nominal frequencies only; impulses may be negative", True, False, solvers.solve_minimal,
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
        "modes with a band; one without is cancelled exactly; no impulse is negative", False, True, _robust,
    ),
    Family(
        "mirrored", "robust and symmetric in time: equal contours in both directions", "this project",
        "modes with a band or without one, which is cancelled exactly; no impulse is negative; longer than robust",
        False, True, _mirrored,
    ),
    Family(
        "smooth-zv", "polynomial kernel with a zero at the mode (Kalico's smooth_zv)", _KALICO,
        "any modes, best on a grid of four periods in a cycle or more; its samples are the impulses, none is negative; "
        "exact at the nominal frequencies", False, True, solvers.smooth("smooth-zv", (1.0,), 0.8025),
    ),
    Family(
        "smooth-mzv", "polynomial kernel with zeros at 1 and 5/3 times the mode (smooth_mzv)", _KALICO,
        _SMOOTH, False, True, solvers.smooth("smooth-mzv", (1.0, 5.0 / 3.0), 0.95625),
    ),
    Family(
        "smooth-ei", "polynomial kernel with zeros at 1 and 1.414 times the mode (smooth_ei)", _KALICO,
        _SMOOTH, False, True, solvers.smooth("smooth-ei", (1.0, 1.41375), 1.06625),
    ),
    Family(
        "smooth-ei2", "polynomial kernel with zeros at 1, 1.525 and 2.159 times the mode (smooth_2hump_ei)", _KALICO,
        _SMOOTH, False, True, solvers.smooth("smooth-ei2", (1.0, 1.525, 2.159), 1.14875),
    ),
    Family(
        "smooth-si", "polynomial kernel with zeros at 1, 1.55 and 2.33 times the mode (smooth_si)", _KALICO,
        _SMOOTH, False, True, solvers.smooth("smooth-si", (1.0, 1.5495, 2.32975), 1.245, at_least=True),
    ),
    Family(
        "smooth-zvd-ei", "polynomial kernel with a double zero at the mode and one at 1.69 times it (smooth_zvd_ei)",
        _KALICO, _SMOOTH, False, True, solvers.smooth("smooth-zvd-ei", (1.0, 1.0, 1.6875), 1.475),
    ),
    Family(
        "taps", "impulses as given", "the user",
        "evaluated as given; on a grid only if their times lie on it", True, True, solvers.user_taps,
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
    """Design and evaluate all shapers of a family for some modes, the preferred one first."""
    options = options or DesignOptions()
    row = family_named(name)
    if not bands:
        raise ArgumentError("a shaper needs at least one mode: 0 given")
    if options.period_s is None and not row.continuous:
        raise ArgumentError(f"{name} is designed on a grid: specify its period")
    if options.period_s is not None and not row.on_grid:
        raise ArgumentError(f"{name} has no design on a grid: omit the period ({row.validity})")
    found = row.solve(distinct(bands), options)
    most_s, most_sum = options.max_duration_s, options.max_abs_sum
    within = [
        shaper
        for shaper in found
        if row.name == "taps"
        or (shaper.duration_s <= most_s * (1.0 + _SLACK) and shaper.abs_sum <= most_sum * (1.0 + _SLACK))
    ]
    if found and not within:
        nearest = min(found, key=lambda shaper: shaper.duration_s)
        raise DesignError(
            f"{name} takes {ms(nearest.duration_s)} with sum|a| {nearest.abs_sum:.4g}: the limits are {ms(most_s)} and "
            f"{most_sum:.4g}"
        )
    return [evaluate(name, shaper, bands, options.period_s) for shaper in within]
