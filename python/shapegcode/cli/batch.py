"""``shapegcode batch``: a command over many programs and machines."""

from __future__ import annotations

import argparse
import shlex
from dataclasses import replace
from pathlib import Path

from shapegcode.cli import runner
from shapegcode.cli.arguments import NEEDED, add_options, count, seconds, size
from shapegcode.cli.options import add_amount_arguments, add_cluster_arguments, cluster_of

_INDEX = "index.html"
_COMMANDS = ("convert", "time", "check", "feed", "measure", "simulate")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Runs a command over many programs and machines, each run in a separate process. Options of the command come "
        "after --. Results, each complete or absent, go into the folder of -o, with batch.jsonl (what is done) "
        "and summary.csv (all rows). Exit code 0 if all are within tolerance, 1 if some are not or were refused, 2 if "
        "none could be started."
    )
    add_options(parser, (
        ("programs", "PROGRAMS", {"nargs": "+"},
         "files, folders (with all below them), patterns in quotes ('parts/**/*.nc'), or @LIST: a file with one of "
         "these per line"),
        ("-m --machine", "MACHINE", [None],
         "machine file or built-in machine; more than one -m: every program on each of them", NEEDED),
        ("-o --output", "DIR", None, "folder of the results", NEEDED),
        ("--command", None, {"dest": "batch_command", "choices": _COMMANDS},
         "what is done with each program (default: convert)", "convert"),
        ("--resume", None, bool, "do only what is missing, failed or changed since"),
        ("--jobs", "N", count, "processes at a time (default: one per processor)", 0),
        ("--time-limit", "TIME", seconds, "of each run (default: 3600s)", 3600.0),
        ("--memory-limit", "SIZE", size,
         "of each run, such as 2G, beyond what is loaded (default: none; Linux only)", 0),
    ))  # fmt: skip
    add_cluster_arguments(parser, "run")
    add_options(parser, (
        ("--json", "FILE", None, "write all rows as JSON; - for standard output"),
        ("--html", "DIR", None, "write a page for each run into this folder, and an index of them"),
    ))  # fmt: skip
    add_amount_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Run the batch."""
    from shapegcode.batching.batch import batch
    from shapegcode.cli import ExitCode, parser_of

    options = list(getattr(args, "rest", ()))
    # What the command does not understand is refused before anything is done; argparse says what.
    target = ["-o", "out"] if args.batch_command in ("convert", "feed") else []
    parser_of(args.batch_command).parse_args([args.batch_command, "part.nc", "-m", "vx500", *target, *options])
    html, args.html = args.html, None
    name = f"{args.batch_command}: "
    with runner.progress(f"{name}reading", args) as bar:

        def show(share: float, text: str) -> None:
            bar.update(share)
            bar.say(name + text)

        result = batch(
            args.programs,
            args.machine,
            args.output,
            command=args.batch_command,
            options=options,
            jobs=args.jobs,
            cluster=cluster_of(args),
            resume=args.resume,
            html=html,
            time_limit_s=args.time_limit,
            memory_limit_bytes=args.memory_limit,
            on_progress=show,
        )
    tables = result.tables()
    if html is not None:
        args.html = str(Path(html) / _INDEX)
        result = replace(result, html=str(html))
    notes = []
    if result.stopped:
        words = [word for word in args.typed if word != "--resume"]
        notes.append(f"go on with: {shlex.join(['shapegcode', 'batch', '--resume', *words[1:]])}")
    code = runner.finish(result, args, tables=tables, notes=notes, wrote=[result.summary])
    return ExitCode.INTERRUPTED if result.stopped == "Ctrl-C" else code
