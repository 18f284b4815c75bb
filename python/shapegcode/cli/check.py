"""``shapegcode check``: what the controller would refuse, and what it would not run as programmed."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from shapegcode.cli.console import add_json_argument
from shapegcode.cli.options import add_machine_argument, load_machine, refuse_same_file

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Lists what the controller would refuse, several alarms in one run, each with number and place; and what it "
        "would not run as programmed: stops inside of cuts, blocks shorter than the block time, feeds above the limits "
        "of the axes, program memory, speed of the serial line. "
        "Exit code 0: nothing of both; 1: warnings; 2: at least one alarm."
    )
    parser.add_argument("input", metavar="PROGRAM", help="CNC program")
    add_machine_argument(parser)
    parser.add_argument(
        "--program",
        type=_program_number,
        default=None,
        metavar="O1234",
        help="program to check of a file that holds several; without it the first",
    )
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Check one program.

    Raises:
        ProgramError, MachineError: bad input.
        OSError: a file cannot be read or written.
    """
    from shapegcode.check_table import findings_table, next_step, summary
    from shapegcode.checker import check
    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json

    machine = load_machine(args)
    if args.json not in (None, "-"):
        refuse_same_file([Path(args.json)], [Path(args.input), Path(args.machine)])
    with progress(f"checking {args.input}", args.json) as bar:
        bar.wait()
        result = check(args.input, machine, program_number=args.program)
    if args.json is not None:
        write_json(result.report(), args.json)
    console = output_console(args.json)
    if result.findings:
        console.print(findings_table(result))
    console.print(summary(result), markup=False)
    console.print(f"next: {next_step(result)}", markup=False)
    if result.refused:
        return ExitCode.BAD_INPUT
    return ExitCode.OUT_OF_TOLERANCE if result.counts["warning"] else ExitCode.OK


def _program_number(text: str) -> int:
    match = re.fullmatch(r"[Oo]?(\d{1,8})", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r}: must be a program number such as O1234")
    return int(match[1])
