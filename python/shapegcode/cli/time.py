"""``shapegcode time``: how long a program takes, and where the time goes."""

from __future__ import annotations

import argparse
from pathlib import Path

from shapegcode.cli.console import add_json_argument
from shapegcode.cli.options import (
    add_input_arguments,
    add_plots_argument,
    load_machine,
    override,
    ratio,
    refuse_same_file,
)

__all__ = ["add_arguments", "run"]

# A table of more blocks is built only where it is written.
_MOST_BLOCKS_SHOWN = 100_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Predicts the cycle time of a program as it is, in closed form, and checks it by giving every set-point: "
        "cutting, rapids, in-position, dwells, acceleration, tool changes; by tool; the slowest regions and blocks. "
        "Exit code 1 if closed form and full interpolation differ by more than 0.5 %."
    )
    add_input_arguments(parser, metavar="PROGRAM")
    parser.add_argument(
        "--override",
        type=override,
        default=1.0,
        metavar="RATIO",
        help="feed override, for example 80%% (at most 254%%)",
    )
    parser.add_argument(
        "--rapid-override",
        type=ratio,
        default=1.0,
        metavar="RATIO",
        help="rapid override, for example 25%% (at most 100%%); the acceleration of rapids stays what it is",
    )
    parser.add_argument("--no-full", action="store_true", help="closed form only, no full interpolation")
    parser.add_argument("--blocks", action="store_true", help="put every block into the JSON")
    parser.add_argument("--csv", metavar="FILE", default=None, help="write one line per block; - for standard output")
    add_plots_argument(parser, "write the picture of where the time goes (PNG and SVG) into this folder")
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Time one program.

    Raises:
        ProgramError, MachineError, ArgumentError: bad input.
        OSError: a file cannot be read or written.
    """
    from shapegcode._core import ArgumentError
    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json
    from shapegcode.io.atomic import write_text
    from shapegcode.program import Program
    from shapegcode.results.table import warning_table
    from shapegcode.timing.cycle_time import cycle_time
    from shapegcode.timing.tables import blocks_csv, next_step, parts_table, slowest_table, tools_table

    if args.csv == "-" and args.json == "-":
        raise ArgumentError("--csv - and --json -: only one of them can have standard output")
    machine = load_machine(args)
    targets = [Path(name) for name in (args.csv, args.json) if name not in (None, "-")]
    refuse_same_file(targets, [Path(args.input), Path(args.machine)])
    refuse_same_file(targets[:1], targets[1:])
    stdout = "-" if "-" in (args.csv, args.json) else None
    with progress(f"timing {args.input}", stdout) as bar:
        bar.wait()
        program = Program.read(args.input, machine, program_number=args.program)
        wanted = args.csv is not None or args.blocks
        time = cycle_time(
            program,
            machine,
            per_block=wanted or program.core.block_count <= _MOST_BLOCKS_SHOWN,
            full=not args.no_full,
            feed_override=args.override,
            rapid_override=args.rapid_override,
        )
    if args.plots is not None:
        from shapegcode.timing.plots import write_time_pictures

        write_time_pictures(time, args.plots)
    if args.csv == "-":
        print(blocks_csv(time), end="")
    elif args.csv is not None:
        write_text(args.csv, blocks_csv(time))
    if args.json is not None:
        write_json(time.report(blocks=args.blocks), args.json)
    console = output_console(stdout)
    console.print(parts_table(time))
    if time.tools:
        console.print(tools_table(time))
    if time.regions or time.blocks:
        console.print(slowest_table(time))
    if time.warnings:
        console.print(warning_table(time.warnings))
    free = sum(block.kind in ("tool_change", "function") and block.duration_s <= 0.0 for block in time.blocks)
    if free:
        console.print(f"tool changes and M codes count 0 s on this machine ({free} in the program)", markup=False)
    console.print(f"next: {next_step(time)}", markup=False)
    return ExitCode.OK if time.agrees else ExitCode.OUT_OF_TOLERANCE
