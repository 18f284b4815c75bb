"""``shapegcode feed``: feeds that keep force, deflection, torque, power and chip within the tool's limits."""

from __future__ import annotations

import argparse

from shapegcode.cli import options, runner


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Sweeps the tool through the stock, computes the cutting force of the feed that the machine really runs, and "
        "writes the program with the highest feeds that keep the tool's limits. Blocks are divided where the load "
        "changes within them; everything else stays as it is. Exit code 0: every limit is kept; 1: written, but "
        "somewhere a limit is not kept (the report says where and why); 2: bad input."
    )
    options.add_input_arguments(parser)
    options.add_cutting_arguments(parser, required=True)
    parser.add_argument("-o", "--output", metavar="OUT", required=True, help="program to write")
    options.add_plots_argument(
        parser,
        "write pictures (PNG and SVG) into this folder: force, feed and engagement along the path, the path coloured "
        "by force before and after, the error of the wall",
    )
    options.add_result_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Schedule the feeds of one program."""
    from shapegcode.feed.schedule import schedule_feed
    from shapegcode.program.compensation import read_for_conversion

    output = options.output_file(args.output)
    machine = options.load_machine(args, writes_program=True)
    runner.check_files(args)
    cutting = options.read_cutting_arguments(args)
    with runner.progress(f"scheduling {args.input}", args) as bar:
        program = read_for_conversion(args.input, machine, program_number=args.program)
        schedule = schedule_feed(program, machine, **cutting, on_progress=bar.update)
    return runner.finish(schedule, args, output=(output, schedule.text))
