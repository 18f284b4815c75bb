"""``shapegcode characterize``: measure what a controller does with blocks, and put it into the machine file."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode.cli.console import add_json_argument
from shapegcode.cli.options import add_machine_argument, load_machine, refuse_same_file

if TYPE_CHECKING:
    from rich.table import Table

    from shapegcode.characterization.findings import Finding
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
    action.add_argument(
        "--fit",
        metavar="RESULTS",
        default=None,
        help="fit a filled-in RESULTS.toml, a folder with it and servo logs, or one log beside it",
    )
    add_machine_argument(parser)
    parser.add_argument(
        "-o", "--output", metavar="FILE", default=None, help="with --fit: machine file to write, with what is known"
    )
    parser.add_argument(
        "--units",
        metavar="TIME,LENGTH",
        default=None,
        help="with --fit: units of the servo logs, for example ms,um (default: from their headers)",
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
    machine = load_machine(args)
    return _write(args, machine) if args.write is not None else _fit(args, machine)


def _write(args: argparse.Namespace, machine: Machine) -> int:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from shapegcode._core import ArgumentError
    from shapegcode.characterization.plan import Box
    from shapegcode.characterization.programs import write_tests
    from shapegcode.characterization.timing import Timing, program_time_s
    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, write_json

    for option, value in (("-o", args.output), ("--units", args.units)):
        if value is not None:
            raise ArgumentError(f"{option} {value}: goes with --fit, not with --write")
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
                "expected_s": round(program_time_s(test, timing), 3),
            }
            for test in tests
        ]
        write_json({"folder": str(folder), "box": str(box), "tests": rows}, args.json)
    table = Table(title=f"tests of {machine.name}", title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for heading in ("program", "test", "for", "expected s", "purpose"):
        table.add_column(heading, justify="right" if heading == "expected s" else "left")
    for test in tests:
        kind = f"{test.kind} {test.override_percent} %" if test.override_percent != 100 else test.kind
        cells = (test.program, test.name, kind, f"{program_time_s(test, timing):.1f}", test.purpose.lower())
        table.add_row(*cells)
    console = output_console(args.json)
    console.print(table)
    console.print(
        f"wrote {folder}: programs, README.txt, RESULTS.toml; box from the start point, mm: {box}", markup=False
    )
    console.print(f"next: read {folder / 'README.txt'}, run the tests, fill in {folder / 'RESULTS.toml'}", markup=False)
    return ExitCode.OK


def _fit(args: argparse.Namespace, machine: Machine) -> int:
    from shapegcode.characterization.fit import applied, assumed_value, fit
    from shapegcode.characterization.log import parse_units
    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json
    from shapegcode.io.atomic import write_text

    units = parse_units(args.units) if args.units is not None else None
    with progress(f"fitting {args.fit}", args.json) as bar:
        found = fit(Path(args.fit), units, bar.update)
    read = [Path(args.machine), *found.read]
    fitted, remarks = applied(machine, found.findings)
    if args.output is not None:
        refuse_same_file([Path(args.output)], read)
    if args.json is not None:
        rows = [
            {
                "quantity": each.quantity,
                "value": each.value,
                "low": each.low,
                "high": each.high,
                "unit": each.unit,
                "assumed": assumed_value(machine, each),
                "key": each.key,
                "source": each.source,
                "note": each.note,
            }
            for each in found.findings
        ]
        if args.json != "-":
            refuse_same_file([Path(args.json)], [*read, *([Path(args.output)] if args.output else [])])
        write_json({"findings": rows, "contradictions": found.contradictions, "output": args.output}, args.json)
    console = output_console(args.json)
    console.print(_table(machine, found.findings))
    for each in found.contradictions:
        console.print(f"contradiction: {each}", markup=False, soft_wrap=True)
    if args.output is not None:
        write_text(args.output, fitted.to_toml(remarks))
        console.print(f"wrote {args.output}: {len(remarks)} keys from measurement", markup=False, soft_wrap=True)
    if found.contradictions:
        console.print("next: repeat the tests that contradict the others", markup=False)
        return ExitCode.OUT_OF_TOLERANCE
    if args.output is None:
        console.print("next: -o FILE writes the machine file with these values", markup=False)
    else:
        console.print(f"next: shapegcode machine show {args.output}", markup=False, soft_wrap=True)
    return ExitCode.OK


def _table(machine: Machine, findings: list[Finding]) -> Table:
    """Findings with their intervals beside what the machine file has; times in ms."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    from shapegcode.characterization.fit import assumed_value

    table = Table(title=f"{machine.name}, measured", title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for heading in ("quantity", "value", "95 % interval", "unit", "file has", "from", "remark"):
        table.add_column(heading, overflow="fold", no_wrap=heading != "remark")
    for each in findings:
        scale, unit = (1e3, "ms") if each.unit == "s" else (1.0, each.unit)

        def shown(value: object, scale: float = scale) -> str:
            return f"{value * scale:.4g}" if isinstance(value, int | float) else str(value or "")

        if each.low is not None and each.high is not None:
            interval = f"{shown(each.low)} ... {shown(each.high)}"
        else:
            interval = f"at most {shown(each.high)}" if each.high is not None else ""
        value = "unknown" if each.value is None else shown(each.value)
        cells = (each.quantity, value, interval, unit, shown(assumed_value(machine, each)), each.source, each.note)
        table.add_row(*(Text(cell) for cell in cells))
    return table
