"""An identification for people: modes with their intervals, refused ones, records, the check, the one next step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from shapegcode.identification.results import Estimate, IdentifiedMode

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from shapegcode.identification.tap_test import TapTest

__all__ = ["mode_line", "modes_table", "plus_minus", "print_tap_test", "refusals_table", "with_interval"]

_SKEWED = 1.2

# heading, attribute, factor to the unit of the heading
_COLUMNS: tuple[tuple[str, str, float], ...] = (
    ("frequency Hz", "frequency_hz", 1.0),
    ("damping %", "damping_ratio", 100.0),
    ("m kg", "mass_kg", 1.0),
    ("c N s/m", "damping_n_s_per_m", 1.0),
    ("k N/µm", "stiffness_n_per_m", 1e-6),
)


def print_tap_test(test: TapTest, console: Console) -> None:
    """Records, modes, what is not supported, checks and warnings of a test."""

    def say(text: str) -> None:
        console.print(text, markup=False, soft_wrap=True)

    if test.prepared is not None:
        kind = "decay" if test.is_decay else "tap"
        count = len(test.records)
        axis = "" if test.axis is None else f", {test.axis.upper()} axis"
        say(f"used: {count} {kind}{'' if count == 1 else 's'}{axis}")
        for record in test.records:
            lasts_s = len(record.response) * record.period_s
            say(f"  {record.source}: {len(record.response)} samples, {lasts_s:.4g} s, {record.quantity}")
    found = test.found
    if found is not None:
        if found.modes:
            console.print(modes_table(found.modes))
        if found.refused:
            console.print(refusals_table(found.refused))
        modes = "mode" if found.order == 1 else "modes"
        say(f"model: {found.order} {modes}, {found.fit_percent:.1f} % of the response")
        if found.checks:
            say(f"check: {_check_line(found.checks)}")
    for warning in test.warnings:
        say(warning if warning.startswith("note: ") else f"warning: {warning}")


def mode_line(mode: IdentifiedMode) -> str:
    """A mode in one line: each value with half of its 95 % interval, or why the data do not support it."""
    if mode.refusal:
        return f"{mode.frequency_hz.value:.4g} Hz not supported: {mode.refusal}"
    parts = (
        f"{heading.partition(' ')[0]} {_cell(estimate, factor)} {heading.partition(' ')[2]}"
        for heading, name, factor in _COLUMNS
        if (estimate := getattr(mode, name)) is not None
    )
    return ", ".join(parts)


def _check_line(checks: Mapping[str, float]) -> str:
    """The mass by paper 003's method, in words."""
    halvings = int(checks["bisection_halvings"])
    return (
        f"equivalent mass by paper 003's method: closed form {checks['mass_closed_form_kg']:.4g} kg, bisection "
        f"{checks['mass_bisection_kg']:.4g} kg after {halvings} halving{'' if halvings == 1 else 's'}"
    )


def modes_table(modes: Sequence[IdentifiedMode]) -> Table:
    """One row per mode that the data support: value ± half of the 95 % interval."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(title="modes, each ± 95 %", title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    columns = [each for each in _COLUMNS if any(getattr(mode, each[1]) is not None for mode in modes)]
    for heading, _, _ in columns:
        table.add_column(heading, justify="right", no_wrap=True)
    for mode in modes:
        table.add_row(*(_cell(getattr(mode, name), factor) for _, name, factor in columns))
    return table


def refusals_table(modes: Sequence[IdentifiedMode]) -> Table:
    """What stands out of the noise but is not supported, with the reason."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(title="not supported by the data", title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("frequency Hz", justify="right", no_wrap=True)
    table.add_column("why", overflow="fold")
    for mode in modes:
        table.add_row(f"{mode.frequency_hz.value:.4g}", Text(mode.refusal))
    return table


def with_interval(estimate: Estimate, factor: float = 1.0) -> str:
    """``46.02 ± 0.05``, with as many digits as the interval is worth; both ends where it is skewed."""
    value, low, high = (factor * each for each in (estimate.value, estimate.low, estimate.high))
    above, below = high - value, value - low
    if not (math.isfinite(above) and math.isfinite(below) and above > 0.0 and below > 0.0):
        return f"{value:.4g} ({low:.4g} ... {high:.4g})"
    if max(above, below) > _SKEWED * min(above, below):
        decimals = _decimals(min(above, below))
        return f"{value:z.{decimals}f} ({low:z.{decimals}f} ... {high:z.{decimals}f})"
    return plus_minus(value, max(above, below))


def plus_minus(value: float, half: float) -> str:
    """A value and half its interval, to two digits of the latter."""
    decimals = _decimals(half)
    return f"{value:z.{decimals}f} ± {half:.{decimals}f}"


def _decimals(half: float) -> int:
    return min(max(0, 1 - math.floor(math.log10(half))), 6)


def _cell(estimate: Estimate | None, factor: float) -> str:
    return "" if estimate is None else with_interval(estimate, factor)
