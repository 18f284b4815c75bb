"""An identification for people: modes with their intervals, refused ones, records, the check, the one next step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from shapegcode.identification.mode import MODE_COLUMNS, IdentifiedMode, estimate_cell

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from shapegcode.identification.identify import TapTest

__all__ = ["modes_table", "print_tap_test", "refusals_table"]


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
    columns = [each for each in MODE_COLUMNS if any(getattr(mode, each[1]) is not None for mode in modes)]
    for heading, _, _ in columns:
        table.add_column(heading, justify="right", no_wrap=True)
    for mode in modes:
        table.add_row(*(estimate_cell(getattr(mode, name), factor) for _, name, factor in columns))
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
