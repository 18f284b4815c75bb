"""``shapegcode check``: what the controller would refuse, and what it would not run as programmed."""

from __future__ import annotations

import argparse

from shapegcode.cli.console import add_json_argument
from shapegcode.cli.options import add_input_arguments, load_machine, refuse_json_over_input

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Lists what the controller would refuse, several alarms in one run, each with number and place; and what it "
        "would not run as programmed: stops inside of cuts, blocks shorter than the block time, feeds above the limits "
        "of the axes, program memory, speed of the serial line. "
        "Exit code 0: nothing of both; 1: warnings; 2: at least one alarm."
    )
    add_input_arguments(parser, metavar="PROGRAM")
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Check one program.

    Raises:
        ProgramError, MachineError: bad input.
        OSError: a file cannot be read or written.
    """
    from shapegcode.checking.check import check
    from shapegcode.checking.tables import findings_table, next_step, summary
    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json

    machine = load_machine(args)
    refuse_json_over_input(args)
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
