"""Tables: columns with name, unit, value and digits; for terminal and page.

A table fits 80 columns: numbers are not broken, texts wrap between words, and empty columns are left out.
"""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Literal

from shapegcode.hints import Hinted

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult
    from rich.table import Table as RichTable

NO_BREAK = "\N{NO-BREAK SPACE}"  # keeps the words of a cell on one line
_NARROWEST = 12


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes:
        name: heading.
        unit: unit after the heading; empty: none.
        value: content of a cell: attribute of the row (dotted names allowed; empty: `name`), or a function of the row.
        digits: decimals of numbers; None: as text.
        text: left-aligned text, which wraps; other columns are right-aligned and never wrapped.
        left: left-aligned and never wrapped: a column of names.
        style: rich style of a cell from the row; None: plain.
        link: link target of a cell on a page: attribute or function of the row, as for `value`; empty: none.
        priority: in a table that is too wide, columns of the highest priority are dropped first; of equal ones, the
            rightmost first. A column of priority 0 and the first column are never dropped.
    """

    name: str
    unit: str = ""
    value: str | Callable[[Any], object] = ""
    digits: int | None = None
    text: bool = False
    left: bool = False
    style: Callable[[Any], str] | None = None
    link: str | Callable[[Any], str] = ""
    priority: int = 1

    @property
    def heading(self) -> str:
        """Name and unit."""
        return f"{self.name} {self.unit}".strip()

    def cell(self, row: object) -> str:
        """Text of a cell; empty without a value.

        Args:
            row: row of the table.

        Returns:
            The text of the cell.
        """
        take = attrgetter(self.value or self.name) if isinstance(self.value, str) else self.value
        value = take(row)
        if value is None:
            return ""
        if isinstance(value, float) and self.digits is not None:
            return f"{value:z.{self.digits}f}"
        return str(value)


@dataclass(frozen=True)
class Table(Hinted):
    """A table as data.

    Attributes:
        title: title above the table; empty: none.
        columns: from left to right.
        rows: input of the columns, from top to bottom.
        caption: text below the table; empty: none.
        sections: indices of rows before which a line is drawn.
        row_style: rich style of a whole row.
        caption_style: rich style of the caption.
        whole: leave no column out, even on a narrow terminal.
    """

    title: str
    columns: tuple[Column, ...]
    rows: Sequence[Any]
    caption: str = ""
    sections: Collection[int] = ()
    row_style: Callable[[Any], str] | None = None
    caption_style: str = ""
    whole: bool = False

    def cells(self) -> list[list[str]]:
        """Headings and rows as texts, without the columns that are empty in every row."""
        shown = self.shown()
        return [[column.heading for column in shown], *([column.cell(row) for column in shown] for row in self.rows)]

    def shown(self) -> list[Column]:
        """The columns with a text in one row or more, as in `cells`; without rows all columns."""
        return [column for column in self.columns if not self.rows or any(column.cell(row) for row in self.rows)]

    def __str__(self) -> str:
        """The table as on a terminal of 80 columns, without colours."""
        import io

        from rich.console import Console

        stream = io.StringIO()
        Console(file=stream, width=80, color_system=None, highlight=False).print(self)
        return stream.getvalue().rstrip("\n")

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        from rich.text import Text

        # Separate lines: rich would wrap them at the width of the table.
        if self.title:
            yield Text(self.title, style="bold")
        shown = self.shown()
        kept = shown if self.whole else self._fitting(shown, options.max_width)
        yield self._rich(kept, options.max_width)
        if self.caption:
            yield Text(self.caption, style=self.caption_style)
        if left := [column.heading for column in shown if column not in kept]:
            yield Text(f"left out, because the terminal is too narrow: {', '.join(left)} (--verbose)", style="dim")

    def everything(self) -> Table:
        """The table with every column, even on a narrow terminal."""
        return replace(self, whole=True)

    def width(self) -> int:
        """Width of the table in characters, with every column that has a text, and no text wrapped."""
        return _min_width(self.shown(), self._texts(self.shown()), whole=True)

    def _texts(self, shown: Sequence[Column]) -> list[list[str]]:
        """Cells as texts; a figure with interval or unit is kept on one line."""
        cells = [[column.cell(row) for column in shown] for row in self.rows]
        worded = [column.text or column.left for column in shown]
        return [[c if w else c.replace(" ", NO_BREAK) for c, w in zip(row, worded, strict=True)] for row in cells]

    def _fitting(self, shown: list[Column], width: int) -> list[Column]:
        """Leave out columns until the rest fits without cutting words; the first and those of priority 0 stay."""
        kept = list(shown)
        while _min_width(kept, self._texts(kept)) > width:
            free = [rank for rank, column in enumerate(kept) if rank > 0 and column.priority > 0]
            if not free:
                break
            del kept[max(free, key=lambda rank: (kept[rank].priority, rank))]
        return kept

    def _rich(self, shown: Sequence[Column], width: int) -> RichTable:
        from rich.box import SIMPLE_HEAD
        from rich.table import Table as RichTable
        from rich.text import Text

        table = RichTable(box=SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
        rows = self._texts(shown)
        widths = _widths(shown, rows, width)
        for column, place in zip(shown, widths, strict=True):
            side: Literal["left", "right"] = "left" if column.text or column.left else "right"
            table.add_column(column.heading, justify=side, width=place, overflow="fold")
        for rank, (row, cells) in enumerate(zip(self.rows, rows, strict=True)):
            if rank in self.sections and rank > 0:
                table.add_section()
            styled = [
                Text(_wrapped(cell, place) if column.text else cell, style=column.style(row) if column.style else "")
                for column, cell, place in zip(shown, cells, widths, strict=True)
            ]
            table.add_row(*styled, style=self.row_style(row) if self.row_style else None)
        return table


def _min_and_max(columns: Sequence[Column], rows: Sequence[Sequence[str]]) -> tuple[list[int], list[int]]:
    """Width of each column for its longest word (24 at most for texts, else 60), and for its longest cell."""
    least, most = [], []
    for rank, column in enumerate(columns):
        parts = [[cells[rank]] if column.left else cells[rank].split(" ") for cells in rows]
        words = [*column.heading.split(), *(word for words in parts for word in words)]
        # A path may exceed the width of the terminal, and is folded.
        least.append(min(max(map(len, words), default=1), 24 if column.text else 60))
        most.append(max([len(column.heading), *(len(cells[rank]) for cells in rows)]))
    return least, most


def _min_width(columns: Sequence[Column], rows: Sequence[Sequence[str]], *, whole: bool = False) -> int:
    """Width of a table for its longest words or, if *whole*, its longest lines, with the space between its columns."""
    least, most = _min_and_max(columns, rows)
    return sum(most if whole else least) + 2 * len(columns) - 1


def _widths(columns: Sequence[Column], rows: Sequence[Sequence[str]], width: int) -> list[int]:
    """Column widths that cut no word, if possible; rich would shrink all columns alike and cut the last ones."""
    least, most = _min_and_max(columns, rows)
    found = list(least)
    spare = width - (2 * len(columns) - 1) - sum(least)
    for _ in range(-spare):
        # Terminal too narrow: long words of texts are folded, names and figures are not.
        texts = [rank for rank, column in enumerate(columns) if column.text and found[rank] > _NARROWEST]
        if texts:
            found[max(texts, key=found.__getitem__)] -= 1
    for _ in range(spare):
        # One more character for the column with the most lines.
        rank = max(range(len(columns)), key=lambda rank: most[rank] / max(found[rank], 1))
        if found[rank] >= most[rank]:
            break
        found[rank] += 1
    return found


def _wrapped(cell: str, width: int) -> str:
    """Wrap a cell to a width, because rich breaks lines at NO_BREAK too; the result has plain spaces."""
    parts = (textwrap.wrap(part, width, break_on_hyphens=False) or [""] for part in cell.split("\n"))
    return "\n".join(itertools.chain.from_iterable(parts)).replace(NO_BREAK, " ")


def xyz_columns(cell: Callable[[str, Any], object]) -> tuple[Column, ...]:
    """Columns of the three axes."""
    return tuple(Column(axis.upper(), value=partial(cell, axis)) for axis in "xyz")


def share_percent(part: float, whole: float) -> str:
    """A part in percent of the whole, for a cell; empty if the whole is 0."""
    return f"{part / whole * 100.0:.1f} %" if whole > 0.0 else ""


def warning_table(warnings: Iterable[str]) -> RichTable:
    """Warnings below each other; a long one is wrapped with hanging indent."""
    from rich.table import Table as RichTable
    from rich.text import Text

    table = RichTable.grid(padding=(0, 1))
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for warning in warnings:
        table.add_row("warning:", Text(warning))
    return table
