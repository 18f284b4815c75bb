"""``shapegcode expand``: the plain program that calls, macros and coordinate modes come to."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from shapegcode.cli.console import add_json_argument
from shapegcode.cli.options import add_input_arguments, load_machine, refuse_same_file

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Writes a program with its subprogram calls, custom macros, coordinate modes (G16, G51, G51.1, G68), corner "
        "words and cutter compensation worked out: plain blocks that any control runs, also from DNC. Nothing is "
        "shaped. The input is never overwritten."
    )
    add_input_arguments(parser)
    parser.add_argument("-o", "--output", metavar="OUT", required=True, help="program to write; - for standard output")
    parser.add_argument(
        "--compensation",
        choices=("expand", "keep"),
        default="expand",
        help="G41/G42 as plain moves of the tool centre, or as they stand (default: %(default)s)",
    )
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Expand one program; see the module.

    Raises:
        ProgramError, MachineError: bad input.
        OSError: a file cannot be read or written.
    """
    from shapegcode._core import ArgumentError
    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, write_json
    from shapegcode.io.atomic import write_bytes
    from shapegcode.program import Program

    if args.output == "-" and args.json == "-":
        raise ArgumentError("-o - and --json - both want standard output")
    machine = load_machine(args)
    read = [Path(args.input), Path(args.machine)]
    targets = [Path(name) for name in (args.output, args.json) if name not in (None, "-")]
    refuse_same_file(targets[:1], read)
    refuse_same_file(targets[1:], [*read, *targets[:1]])
    expand = args.compensation == "expand"
    program = Program.read(args.input, machine, program_number=args.program, expand_compensation=expand)
    core = program.core
    report = {
        "program": program.source,
        "machine": machine.name,
        "output": args.output,
        "expanded": core.expanded,
        "lines": core.line_count,
        "bytes": core.size,
        "expanded_radii_mm": {f"D{number}": radius for number, radius in core.expanded_radii_mm.items()},
        "origins": [list(core.origin(line)) for line in range(1, core.line_count + 1)] if core.expanded else [],
        "warnings": program.warnings,
    }
    if args.json is not None:
        write_json(report, args.json)
    if args.output == "-":
        sys.stdout.buffer.write(program.expanded_text)
        return ExitCode.OK
    write_bytes(Path(args.output), program.expanded_text)
    console = output_console(args.json)
    for warning in program.warnings:
        console.print(f"warning: {warning}", markup=False, soft_wrap=True)
    what = "expanded" if core.expanded else "nothing to expand: the text is unchanged"
    console.print(f"wrote {args.output}: {core.line_count} lines, {core.size} bytes, {what}", markup=False)
    for name, radius in report["expanded_radii_mm"].items():
        console.print(
            f"{name} = {radius:g} mm is in the path now: the offset in the control does not act", markup=False
        )
    console.print(f"next: shapegcode time {args.output} -m {args.machine}", markup=False, soft_wrap=True)
    return ExitCode.OK
