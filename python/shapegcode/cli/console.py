"""What every command shares: consoles, a progress bar, JSON, and files that are complete or absent."""

from __future__ import annotations

import argparse
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
    from rich.progress import Progress, TaskID

_PIPE_WIDTH = 120
_PIECES = 4096
_PROGRESS_DELAY_S = 1.0


def add_json_argument(parser: argparse.ArgumentParser) -> None:
    """Declare ``--json FILE``; the value is ``args.json``, None where it is not given."""
    parser.add_argument(
        "--json",
        metavar="FILE",
        default=None,
        help="write the result as JSON to FILE; - for standard output and nothing else there",
    )


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
    """A bar on standard error that shows itself only when the work takes longer than a second."""

    def __init__(self, description: str, *, enabled: bool) -> None:
        """Start the clock; nothing is shown yet."""
        self._description = description
        self._enabled = enabled
        self._lock = threading.Lock()
        self._timer: threading.Timer | None = None
        self._closed = False
        self._bar: Progress | None = None
        self._task: TaskID | None = None

    def update(self, fraction: float) -> None:
        """Tell how much of the work is done, 0 to 1; cheap enough for every step of a loop."""
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, completed=min(max(fraction, 0.0), 1.0), total=1.0)

    def say(self, text: str) -> None:
        """Say what is being done in other words."""
        self._description = text
        if self._bar is not None and self._task is not None:
            self._bar.update(self._task, description=text)

    def wait(self) -> None:
        """Show from the first second on that work goes on, also as long as nobody tells how much of it is done."""
        if self._enabled:
            self._timer = threading.Timer(_PROGRESS_DELAY_S, self._open_late)
            self._timer.daemon = True
            self._timer.start()

    def close(self) -> None:
        """Remove the bar from the screen."""
        if self._timer is not None:
            self._timer.cancel()
        with self._lock:
            self._closed = True
            if self._bar is not None:
                self._bar.stop()
                self._bar = None

    def _open_late(self) -> None:
        with self._lock:
            if not self._closed:
                self._open()

    def _open(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TimeRemainingColumn(),
            TimeElapsedColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        self._task = bar.add_task(self._description, total=None)
        bar.start()
        self._bar = bar


@contextlib.contextmanager
def progress(description: str, json_target: str | None = None) -> Iterator[ProgressBar]:
    """A progress bar for the block; off if standard error is no terminal or JSON goes to standard output."""
    bar = ProgressBar(description, enabled=sys.stderr.isatty() and json_target != "-")
    bar.wait()
    try:
        yield bar
    finally:
        bar.close()
