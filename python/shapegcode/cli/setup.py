"""``shapegcode setup``: questions about a machine, and a short machine file of the answers."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from shapegcode.cli import runner
from shapegcode.cli.arguments import add_options
from shapegcode.cli.options import add_result_arguments, file_exists, write_new


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Asks what a shop knows about its machine, explains what each answer changes, reads the control's parameter "
        "file and tap tests if there are any, and writes a short machine file with the answers and their provenance; "
        "everything else is a default. Enter means `not known yet` at every question, and < goes back to the one "
        "before. Another machine's modes are never used."
    )

    add_options(parser, (
        ("-o --output", "FILE", None, "machine file to write (default: %(default)s)", "machine.toml"),
        ("--answers", "FILE", None,
         "answers from a file (TOML, or JSON) in place of questions; the keys are in docs/howto/setup.md"),
        ("--force", None, bool, "overwrite an existing file"),
    ))  # fmt: skip
    add_result_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Ask, and write the machine file."""
    from shapegcode.errors import ArgumentError
    from shapegcode.setup.answers import read_answers
    from shapegcode.setup.build import set_up

    runner.check_files(args, also_read=[args.answers] if args.answers else [])
    if Path(args.output).exists() and not args.force:
        raise file_exists(args.output)  # before anybody has answered a dozen questions
    if args.answers is not None:
        answers = read_answers(args.answers)
    elif sys.stdin.isatty() and sys.stdout.isatty():
        from shapegcode.setup.ask import ask_all  # with all that asks

        answers = ask_all()
    else:
        raise ArgumentError("setup asks at a terminal, and there is none: --answers FILE answers in place of it")
    found = set_up(answers)
    write_new(args, found.text)
    return runner.finish(replace(found, file=args.output), args, notes=found.notes, wrote=[args.output])
