"""Common parts of all commands: files, progress, answer, tables, pictures, next step, exit code."""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import os
import shlex
import shutil
import sys
import textwrap
import threading
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TextIO

from shapegcode.cli.options import refuse_same_file
from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import write_bytes, write_lines

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from shapegcode.results.json import Provenance, ProvenanceFile
    from shapegcode.results.result import Result
    from shapegcode.results.table import Table

Output = tuple[str | Path, bytes | memoryview]  # the program of a command: its file and content

_PIPE_WIDTH = 120
_PIECES = 4096
_PROGRESS_DELAY_S = 1.0


def output_console(json_target: str | None = None, *, file: TextIO | None = None, least: int = 0) -> Console:
    """Console for tables and text on standard output; silent if the JSON goes there (``--json -``)."""
    from rich.console import Console

    stream = file or sys.stdout
    # A pipe has no width: rich would assume 80 characters and break the tables.
    width = None if stream.isatty() or "COLUMNS" in os.environ else _PIPE_WIDTH
    # With NO_COLOR alone, rich would still print in bold.
    colours: Literal["auto"] | None = None if os.environ.get("NO_COLOR") else "auto"
    console = Console(
        file=stream, width=width, quiet=json_target == "-", highlight=False, soft_wrap=False, color_system=colours
    )
    if least > console.width:
        console.width = least
    return console


def wrapped(text: str) -> str:
    """Wrap text between words on a terminal; elsewhere return it unchanged, so that its lines can be searched."""
    if not sys.stdout.isatty():
        return text
    width = shutil.get_terminal_size().columns
    lines = [textwrap.wrap(line, width, break_long_words=False, break_on_hyphens=False) for line in text.split("\n")]
    return "\n".join("\n".join(parts) for parts in lines)


def write_json(data: object, target: str | Path) -> None:
    """Write *data* as stable JSON: sorted keys, two spaces, one newline at the end; ``-`` is standard output."""
    encoder = json.JSONEncoder(sort_keys=True, indent=2, allow_nan=False, ensure_ascii=False)
    pieces = itertools.chain(encoder.iterencode(data), ["\n"])
    # In chunks: there may be millions of pieces.
    write_lines(str(target), iter(lambda: "".join(itertools.islice(pieces, _PIECES)), ""))


class ProgressBar:
    """A bar on standard error, shown only after `open`."""

    def __init__(self, description: str) -> None:
        self._description = description
        self.bar: Progress | None = None

    def update(self, fraction: float) -> None:
        """Show the finished fraction of the work, 0 to 1; cheap enough for every step of a loop."""
        if self.bar is not None:
            self.bar.update(self.bar.task_ids[0], completed=min(max(fraction, 0.0), 1.0), total=1.0)

    def say(self, text: str) -> None:
        """Replace the description of the progress bar."""
        self._description = text
        if self.bar is not None:
            self.bar.update(self.bar.task_ids[0], description=text)

    def open(self) -> None:
        """Show the bar."""
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        text = TextColumn("{task.description}", markup=False)
        columns = (text, BarColumn(), TimeRemainingColumn(), TimeElapsedColumn())
        bar = Progress(*columns, console=Console(stderr=True), transient=True)
        bar.add_task(self._description, total=None)
        bar.start()
        self.bar = bar


# Options for files that a command writes.
_WRITTEN = ("output", "json", "csv", "npz", "html")
_NEVER_PIPED = {"npz": "an archive", "html": "a page"}


def check_files(
    args: argparse.Namespace, *, also_written: Sequence[str | Path] = (), also_read: Sequence[str | Path] = ()
) -> None:
    """Refuse to overwrite an input file, to write a file twice, and to send two outputs to standard output."""
    given = {name: value for name in _WRITTEN if (value := getattr(args, name, None)) is not None}
    piped = ["-o -" if name == "output" else f"--{name} -" for name, value in given.items() if value == "-"]
    if len(piped) > 1:
        raise ArgumentError(f"{' and '.join(piped)}: only one of them can have standard output")
    for name, what in _NEVER_PIPED.items():
        if given.get(name) == "-":
            raise ArgumentError(f"--{name} -: {what} cannot go to standard output, give a file")
    targets = [Path(value) for value in (*given.values(), *also_written) if value != "-"]
    read = [Path(name) for _, name in given_files(args)]
    refuse_same_file(targets, [*read, *map(Path, also_read)])


def standard_output(args: argparse.Namespace) -> str | None:
    """ "-" if a file goes to standard output, which then contains nothing else; else None."""
    return "-" if "-" in [getattr(args, name, None) for name in _WRITTEN] else None


@contextlib.contextmanager
def progress(description: str, args: argparse.Namespace) -> Iterator[ProgressBar]:
    """Show a bar after the first second of the block; none without a terminal or if a file goes to standard output."""
    bar = ProgressBar(description)
    later = threading.Timer(_PROGRESS_DELAY_S, bar.open)
    later.daemon = True
    shown = sys.stderr.isatty() and standard_output(args) != "-"
    if shown:
        later.start()
    try:
        yield bar
    finally:
        if shown:
            later.cancel()
            later.join()  # it may just be opening
        if bar.bar is not None:
            bar.bar.stop()


def write_results(report: object, json: str | None, output: Output | None) -> None:
    """Write the JSON and the program of a command."""
    if json not in (None, "-"):
        write_json(report, str(json))
    if output is not None:
        # Last, so that no program exists if another file could not be written.
        if str(output[0]) == "-":
            sys.stdout.buffer.write(output[1])
        else:
            write_bytes(*output)
    if json == "-":
        write_json(report, json)


def _write_page(
    result: Result, args: argparse.Namespace, report: dict[str, Any], output: Output | None, wrote: Sequence[str | Path]
) -> list[str]:
    """Write provenance into the JSON, and the page of --html; return the files of the page."""
    html = getattr(args, "html", None)
    if html is None and getattr(args, "json", None) is None:
        return []  # no file contains the provenance

    from shapegcode.results.json import plain

    provenance = _provenance(result, args, output, wrote)
    report["provenance"] = plain(provenance)
    if html is None:
        return []
    from shapegcode.results.page.html import save

    with progress(f"writing {html}", args) as bar:
        page = result.page(provenance=provenance, on_progress=bar.update)
        return save(replace(page, report=report), html, getattr(args, "html_script", "inline"))


def finish(
    result: Result,
    args: argparse.Namespace,
    *,
    tables: Sequence[Table] | None = None,
    warnings: Sequence[str] | None = None,
    notes: Sequence[str] = (),
    wrote: Sequence[str | Path] = (),
    output: Output | None = None,
) -> int:
    """Write --json, --html, --plots and the program, and print answer, tables, warnings, notes, files, next step."""
    report = result.to_json()
    last = []
    if (plots := getattr(args, "plots", None)) is not None:
        pictures = report["plots"] = result.save_plots(plots)
        last.append(f"pictures: {', '.join(pictures[::2]) or 'this result has none'}")
    written = [*wrote, *([] if output is None else [output[0]])]
    if output is not None:
        report["output"] = str(output[0])
    step = report["next_step"] = result.next_step_after(str(written[0])) if written else result.next_step
    pages = _write_page(result, args, report, output, wrote)
    several = getattr(args, "several", None)
    if several is not None:
        several.add(report, output)
    else:
        write_results(report, getattr(args, "json", None), output)
    # Programs of one file are written together, after the last of them.
    there = [*wrote, *pages, *([output[0]] if output is not None and several is None else [])]
    tables = result.tables() if tables is None else tables
    warnings = result.warnings if warnings is None else warnings
    _say(result, args, tables, warnings, notes, [*(f"wrote {file}" for file in there), *last, f"next: {step}"])
    return result.exit_code


def _say(
    result: Result, args: argparse.Namespace, tables: Sequence[Table], warnings: Sequence[str], notes: Sequence[str],
    last: Sequence[str],
) -> None:  # fmt: skip
    """Print on standard output, the answer first; with --quiet only answer, citations (--cite) and warnings."""
    from shapegcode.results.table import warning_table

    quiet, verbose = getattr(args, "quiet", False), getattr(args, "verbose", False)
    shown = () if quiet else [table.everything() for table in tables] if verbose else tables
    least = max((table.width() for table in shown), default=0) if verbose else 0
    console = output_console(standard_output(args), least=least)

    def say(text: str, style: str | None = None) -> None:
        console.print(wrapped(text), markup=False, soft_wrap=True, style=style)

    say(result.answer, "bold" if result.ok else "bold red")
    if getattr(args, "cite", False):
        for entry in result.citations:
            console.print(f"\n{entry}", markup=False, soft_wrap=True)
    for table in shown:
        console.print()
        console.print(table)
    if warnings:
        if not quiet:
            console.print()
        console.print(warning_table(warnings))
    if quiet:
        return
    for note in notes:
        say(note)
    for line in last:
        # Paths and commands stay on one line, so that they can be copied.
        console.print(line, markup=False, soft_wrap=True)


# Options for files that a command reads, and those of them that may name a built-in machine.
_READ = ("input", "inputs", "files", "machine", "tool", "stock", "against", "cut", "update", "dump", "base")
MACHINES = ("machine", "base", "files")


def given_files(args: argparse.Namespace) -> Iterator[tuple[str, str]]:
    """Yield role and value of every option that names a file to read."""
    for role in _READ:
        value = getattr(args, role, None)
        for entry in value if isinstance(value, list | tuple) else [value]:
            if entry is not None:
                yield role, str(entry)


def _provenance(
    result: Result, args: argparse.Namespace, output: Output | None, wrote: Sequence[str | Path]
) -> Provenance:
    from shapegcode.results.json import FORMAT, Provenance, ProvenanceFile, this_version

    files = [_read(role, name) for role, name in given_files(args)]
    if output is not None:
        alone = getattr(args, "several", None) is None
        files.append(ProvenanceFile.of("output" if alone else "output of all", output[0], output[1]))
    files += [ProvenanceFile.of("wrote", name) for name in wrote if Path(name).is_file()]
    return Provenance(type(result).__name__, this_version(), FORMAT, _command(args), tuple(files))


def _read(role: str, name: str) -> ProvenanceFile:
    from shapegcode.machine import Machine
    from shapegcode.results.json import ProvenanceFile

    is_builtin = role in MACHINES and not Path(name).exists() and name in Machine.builtin_names()
    return ProvenanceFile.of(role, name, Machine.builtin_text(name).encode() if is_builtin else None)


def _command(args: argparse.Namespace) -> str:
    """The command line as typed; with ``--program all`` for the current program."""
    words = list(getattr(args, "typed", ()))
    if getattr(args, "several", None) is not None:
        at = next((rank for rank, word in enumerate(words) if word.startswith("--program")), None)
        if at is not None:
            words[at : at + (1 if "=" in words[at] else 2)] = ["--program", str(args.program)]
    return shlex.join(["shapegcode", *words]) if words else ""
