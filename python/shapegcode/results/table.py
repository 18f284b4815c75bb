"""Tables on the terminal."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table


def warning_table(warnings: Iterable[str]) -> Table:
    """Warnings one below the other; a long one wraps under its own text, not under the word `warning`."""
    from rich.table import Table
    from rich.text import Text

    table = Table.grid(padding=(0, 1))
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for warning in warnings:
        table.add_row("warning:", Text(warning))
    return table
