"""``shapegcode check``: what the controller would refuse, and what it would not run as programmed."""

from __future__ import annotations

import argparse

from shapegcode.cli import runner
from shapegcode.cli.options import add_input_arguments, add_result_arguments, load_machine


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Lists what the control would refuse, several alarms in one run, each with number and position; and what it "
        "would not run as programmed: stops inside of cuts, blocks shorter than the block time, feeds above the "
        "limits of the axes, program memory, speed of the serial line. Exit code 0: no alarms and no warnings; 1: "
        "warnings; 2: at least one alarm."
    )
    add_input_arguments(parser, metavar="PROGRAM")
    add_result_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Check one program."""
    from shapegcode.checking.check import check

    machine = load_machine(args)
    runner.check_files(args)
    with runner.progress(f"checking {args.input}", args):
        result = check(args.input, machine, program_number=args.program)
    # The table says the warnings.
    return runner.finish(result, args, warnings=())
