"""``shapegcode characterize``: measure what a controller does with blocks, and put it into the machine file."""

from __future__ import annotations

import argparse
from pathlib import Path
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
        "stopwatch times or servo logs of them: interpolation period, block time, time constants, in-position times."
    )
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument(
        "--write",
        metavar="DIR",
        default=None,
        help="write the test programs, RESULTS.toml to fill in, and README.txt",
    )
    add_machine_argument(parser)
    parser.add_argument(
        "--box",
        metavar="X0:X1,Y0:Y1,Z0:Z1",
        default="0:100,0:100,0:20",
        help="where the tests may move, in mm from the point at which they are started (default: %(default)s); write "
        "--box=-50:0,... if it begins with a minus sign",
    )
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Write the tests; see the module.

    Raises:
        ArgumentError, MachineError: bad input.
        OSError: a file cannot be read or written.
    """
    return _write(args, load_machine(args))


def _write(args: argparse.Namespace, machine: Machine) -> int:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from shapegcode.characterize.plan import Box
    from shapegcode.characterize.programs import write_tests
    from shapegcode.characterize.timing import Timing, test_time_s
    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, write_json

    box = Box.parse(args.box)
    folder = Path(args.write)
    tests = write_tests(folder, machine, box)
    timing = Timing.of(machine)
    if args.json is not None:
        rows = [
            {
                "name": test.name,
                "program": test.program,
                "kind": test.kind,
                "override_percent": test.override_percent,
                "expected_s": round(test_time_s(test, timing), 3),
            }
            for test in tests
        ]
        write_json({"folder": str(folder), "box": str(box), "tests": rows}, args.json)
    table = Table(title=f"tests of {machine.name}", title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for heading in ("program", "test", "for", "expected s", "purpose"):
        table.add_column(heading, justify="right" if heading == "expected s" else "left")
    for test in tests:
        kind = f"{test.kind} {test.override_percent} %" if test.override_percent != 100 else test.kind
        cells = (test.program, test.name, kind, f"{test_time_s(test, timing):.1f}", test.purpose.lower())
        table.add_row(*cells)
    console = output_console(args.json)
    console.print(table)
    console.print(
        f"wrote {folder}: programs, README.txt, RESULTS.toml; box from the start point, mm: {box}", markup=False
    )
    console.print(f"next: read {folder / 'README.txt'}, run the tests, fill in {folder / 'RESULTS.toml'}", markup=False)
    return ExitCode.OK
