"""The families of shapers: one row each, with its source and where it is valid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from shapegcode._core import ArgumentError, DesignError, Shaper, convolved_zv, grid_polynomial
from shapegcode.shaping.band import ModeBand
from shapegcode.shaping.design import Design, evaluate
from shapegcode.shaping.grid_designs import shortest_non_negative
from shapegcode.shaping.robust import minimax_robust

__all__ = ["FAMILIES", "DesignOptions", "Family", "design", "family_named"]


@dataclass(frozen=True)
class DesignOptions:
    """What a design may be.

    Attributes:
        period_s: grid on which the taps must lie, s; None: continuous times.
        max_duration_s: longest shaper, s.
        max_abs_sum: largest sum of the taps' magnitudes.
        vibration_limit: residual ratio that a family with a tolerated residual (EI, SI, robust) may leave.
    """

    period_s: float | None = None
    max_duration_s: float = 0.25
    max_abs_sum: float = 10.0
    vibration_limit: float = 0.05


@dataclass(frozen=True)
class Family:
    """A row of the registry.

    Attributes:
        name: short name, as it is typed and as it stands in reports.
        title: what people call it.
        source: where it comes from.
        validity: for which modes and on which times it exists, and what it does not do.
        continuous: whether it can be designed at continuous times.
        on_grid: whether it can be designed on a grid.
        solve: all shapers of the family for the bands, the preferred one first; raises DesignError, which says
            what is nearest, if there is none.
    """

    name: str
    title: str
    source: str
    validity: str
    continuous: bool
    on_grid: bool
    solve: Callable[[Sequence[ModeBand], DesignOptions], Sequence[Shaper]]


def _convolved_zv(bands: Sequence[ModeBand], _options: DesignOptions) -> list[Shaper]:
    return [convolved_zv([band.mode for band in bands])]


def _polynomial(bands: Sequence[ModeBand], options: DesignOptions) -> list[Shaper]:
    return [grid_polynomial([band.mode for band in bands], _period(options))]


def _shortest_non_negative(bands: Sequence[ModeBand], options: DesignOptions) -> list[Shaper]:
    return [shortest_non_negative([band.mode for band in bands], _period(options), options.max_duration_s)]


def _robust(bands: Sequence[ModeBand], options: DesignOptions) -> list[Shaper]:
    if not any(band.uncertainty for band in bands):
        raise DesignError("no mode states a band: a robust design is the non-negative one")
    found = minimax_robust(
        bands, _period(options), vibration_limit=options.vibration_limit, max_duration_s=options.max_duration_s,
        hints=False,
    )  # fmt: skip
    return [found.shaper]


def _period(options: DesignOptions) -> float:
    if options.period_s is None:
        raise ArgumentError("this family is designed on a grid: give its period")
    return options.period_s


FAMILIES: tuple[Family, ...] = (
    Family(
        "zv", "zero vibration, one mode after the other", "paper 002, eq. 1-3; Smith 1958",
        "any number of modes, damped or not; exact at the nominal frequencies only", True, False, _convolved_zv,
    ),
    Family(
        "polynomial", "shortest exact shaper of a grid", "this project",
        "any modes on any grid on which none aliases to zero; taps may be negative and large", False, True, _polynomial,
    ),
    Family(
        "non-negative", "shortest shaper of a grid without negative taps", "this project",
        "any modes on a grid on which one exists within the longest duration", False, True, _shortest_non_negative,
    ),
    Family(
        "robust", "shortest shaper of a grid below a residual over the bands", "this project",
        "modes with a band; one without is cancelled exactly; no tap is negative", False, True, _robust,
    ),
)  # fmt: skip
"""Every family, in the order of tables."""


def family_named(name: str) -> Family:
    """The row of that name.

    Raises:
        ArgumentError: there is none; the message lists the names.
    """
    for row in FAMILIES:
        if row.name == name:
            return row
    raise ArgumentError(f"{name!r} is no family of shapers: {', '.join(row.name for row in FAMILIES)}")


def design(name: str, bands: Sequence[ModeBand], options: DesignOptions | None = None) -> list[Design]:
    """All shapers of a family for some modes, judged, the preferred one first.

    Args:
        name: of a row of `FAMILIES`.
        bands: at least one mode with its band.
        options: grid, longest duration and other limits; None: the defaults.

    Raises:
        ArgumentError: no mode, no such family, or one that is not designed on the asked kind of times.
        DesignError: the family has no shaper for these modes within the limits.
    """
    options = options or DesignOptions()
    row = family_named(name)
    if not bands:
        raise ArgumentError("a shaper needs at least one mode: 0 given")
    if options.period_s is None and not row.continuous:
        raise ArgumentError(f"{name} is designed on a grid: give its period")
    if options.period_s is not None and not row.on_grid:
        raise ArgumentError(f"{name} has no design on a grid: leave the period out")
    return [evaluate(name, shaper, bands, options.period_s) for shaper in row.solve(bands, options)]
