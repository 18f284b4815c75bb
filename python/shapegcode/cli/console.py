"""What every command shares: consoles, a progress bar, JSON, and files that are complete or absent."""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import shutil
import sys
import textwrap
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TextIO

from shapegcode.io.atomic import write_lines

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

_PIPE_WIDTH = 120
_PIECES = 4096
_PROGRESS_DELAY_S = 1.0


def output_console(json_target: str | None = None, *, file: TextIO | None = None, least: int = 0) -> Console:
    """Console for tables and text on standard output; silent where the JSON goes there (``--json -``)."""
    from rich.console import Console

    stream = file or sys.stdout
    # A pipe has no width: rich would take 80 characters and break the tables.
    width = None if stream.isatty() or "COLUMNS" in os.environ else _PIPE_WIDTH
    # rich would still print in bold.
    colours: Literal["auto"] | None = None if os.environ.get("NO_COLOR") else "auto"
    console = Console(
        file=stream, width=width, quiet=json_target == "-", highlight=False, soft_wrap=False, color_system=colours
    )
    if least > console.width:
        console.width = least
    return console


def wrapped(text: str) -> str:
    """Text in lines between words on a terminal; elsewhere, where a line is searched for, as it is."""
    if not sys.stdout.isatty():
        return text
    width = shutil.get_terminal_size().columns
    lines = [textwrap.wrap(line, width, break_long_words=False, break_on_hyphens=False) for line in text.split("\n")]
    return "\n".join("\n".join(parts) for parts in lines)


def write_json(data: object, target: str | Path) -> None:
    """Write *data* as stable JSON: sorted keys, two spaces, one newline at the end; ``-`` is standard output."""
    encoder = json.JSONEncoder(sort_keys=True, indent=2, allow_nan=False, ensure_ascii=False)
    pieces = itertools.chain(encoder.iterencode(data), ["\n"])
    # Not word by word, nor all at once: there may be millions.
    write_lines(str(target), iter(lambda: "".join(itertools.islice(pieces, _PIECES)), ""))


class ProgressBar:
    """A bar on standard error; until it is opened nothing is shown."""

    def __init__(self, description: str) -> None:
        """Say what is being done."""
        self._description = description
        self.bar: Progress | None = None

    def update(self, fraction: float) -> None:
        """Tell how much of the work is done, 0 to 1; cheap enough for every step of a loop."""
        if self.bar is not None:
            self.bar.update(self.bar.task_ids[0], completed=min(max(fraction, 0.0), 1.0), total=1.0)

    def say(self, text: str) -> None:
        """Say what is being done in other words."""
        self._description = text
        if self.bar is not None:
            self.bar.update(self.bar.task_ids[0], description=text)

    def open(self) -> None:
        """Show it."""
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        text = TextColumn("{task.description}", markup=False)
        columns = (text, BarColumn(), TimeRemainingColumn(), TimeElapsedColumn())
        bar = Progress(*columns, console=Console(stderr=True), transient=True)
        bar.add_task(self._description, total=None)
        bar.start()
        self.bar = bar


@contextlib.contextmanager
def progress(description: str, json_target: str | None = None) -> Iterator[ProgressBar]:
    """A progress bar for the block, from its first second on, also as long as nobody tells how much of it is done.

    There is none if standard error is no terminal or JSON goes to standard output.
    """
    bar = ProgressBar(description)
    later = threading.Timer(_PROGRESS_DELAY_S, bar.open)
    later.daemon = True
    shown = sys.stderr.isatty() and json_target != "-"
    if shown:
        later.start()
    try:
        yield bar
    finally:
        if shown:
            later.cancel()
            later.join()  # it may be opening just now
        if bar.bar is not None:
            bar.bar.stop()
