"""``shapegcode characterize``: measure what a controller does with blocks, and put it into the machine file."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from shapegcode.cli.console import add_json_argument
from shapegcode.cli.options import add_machine_argument, load_machine

if TYPE_CHECKING:
    from shapegcode.machine import Machine

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Writes short test programs (air moves inside a stated box) with instructions, then fits the machine file to "
        "stopwatch times or servo logs of them: interpolation period, block time, time constants, in-position times. "
        "Exit code 1 if results contradict each other."
    )
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument(
        "--write", metavar="DIR", help="write the test programs, RESULTS.toml to fill in, and README.txt"
    )
    action.add_argument(
        "--fit", metavar="RESULTS", help="fit a filled-in RESULTS.toml, a folder with it and logs, or one log beside it"
    )
    add_machine_argument(parser)
    parser.add_argument("-o", "--output", metavar="FILE", help="with --fit: machine file to write, with what is known")
    parser.add_argument(
        "--units",
        metavar="TIME,LENGTH",
        help="with --fit: of the logs, for example ms,um (default: from their headers)",
    )
    parser.add_argument(
        "--box",
        metavar="X0:X1,Y0:Y1,Z0:Z1",
        default="0:100,0:100,0:20",
        help="where the tests may move, in mm from the point at which they are started (default: %(default)s); write "
        "--box=-50:0,... if it begins with a minus sign",
    )
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Write the tests or fit their results; see the module.

    Raises:
        ArgumentError, MachineError: bad input.
        OSError: a file cannot be read or written.
    """
    from shapegcode.cli import runner

    machine = load_machine(args)
    runner.check_files(args)
    return _write(args, machine) if args.write is not None else _fit(args, machine)


def _write(args: argparse.Namespace, machine: Machine) -> int:
    from shapegcode.characterization.programs import write_characterization_tests
    from shapegcode.cli import runner
    from shapegcode.errors import ArgumentError

    for option, value in (("-o", args.output), ("--units", args.units)):
        if value is not None:
            raise ArgumentError(f"{option} {value}: goes with --fit, not with --write")
    tests = write_characterization_tests(args.write, machine, args.box)
    return runner.finish(tests, args, wrote=[args.write])


def _fit(args: argparse.Namespace, machine: Machine) -> int:
    from shapegcode.characterization.characterize import characterize
    from shapegcode.cli import runner

    with runner.progress(f"fitting {args.fit}", args) as bar:
        found = characterize(args.fit, machine, units=args.units, on_progress=bar.update)
    runner.check_files(args, also_read=found.files)
    return runner.finish(
        found, args, output=(args.output, found.to_toml().encode()) if args.output is not None else None
    )
