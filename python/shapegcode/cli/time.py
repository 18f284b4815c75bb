"""``shapegcode time``: how long a program takes, and where the time goes."""

from __future__ import annotations

import argparse

from shapegcode.cli import runner
from shapegcode.cli.arguments import add_options, override, ratio
from shapegcode.cli.options import add_input_arguments, add_plots_argument, add_result_arguments, load_machine
from shapegcode.io.data_file import write_lines

# A table of more blocks is built only where it is written.
_MAX_BLOCKS_SHOWN = 100_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Predicts the cycle time of a program as it is, in closed form, and checks it by giving every set-point: "
        "cutting, rapids, in-position, dwells, acceleration, tool changes; by tool; the slowest regions and blocks. "
        "A machine that was calibrated with run logs gives the 95 % interval too, and what would narrow it. "
        "Exit code 1 if closed form and full interpolation differ by more than 0.5 %."
    )
    add_input_arguments(parser, metavar="PROGRAM")
    add_options(parser, (
        ("--override", "RATIO", override,
         "feed override, for example 80%% (at most 254%%; default: times.feed_override_percent)"),
        ("--rapid-override", "RATIO", ratio,
         "rapid override, for example 25%% (at most 100%%; default: times.rapid_override_percent); the acceleration of "
         "rapids stays what it is"),
        ("--log-next", "PROGRAM", [None],
         "a program that could be run with a log next: how narrow the interval would be then; several times for "
         "several, the best comes first"),
        ("--no-full", None, bool, "closed form only, no full interpolation"),
        ("--blocks", None, bool, "put every block into the JSON"),
        ("--csv", "FILE", None, "write one line per block; - for standard output"),
    ))  # fmt: skip
    add_plots_argument(parser, "write the picture of where the time goes (PNG and SVG) into this folder")
    add_result_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Time one program."""
    from shapegcode.model.programs import shaped_note
    from shapegcode.program import Program
    from shapegcode.timing.cycle_time import cycle_time

    machine = load_machine(args)
    runner.check_files(args, also_read=args.log_next or ())
    with runner.progress(f"timing {args.input}", args):
        program = Program.read(args.input, machine, program_number=args.program)
        wanted = args.csv is not None or args.blocks
        time = cycle_time(
            program,
            machine,
            per_block=wanted or program.core.block_count <= _MAX_BLOCKS_SHOWN,
            full=not args.no_full,
            feed_override=args.override,
            rapid_override=args.rapid_override,
            log_next=[Program.read(each, machine) for each in args.log_next or ()],
        )
    if args.csv is not None:
        write_lines(args.csv, time.csv_lines())
    events = [block for block in time.blocks if block.kind in ("tool_change", "function")]
    free = sum(block.duration_s <= 0.0 for block in events)
    note = f"tool changes and M codes count 0 s on this machine ({free} in the program)"
    if free < len(events):
        note = f"{free} of {len(events)} tool changes and M codes count 0 s on this machine"
    usual = [
        f"{what} at {percent:g} %, as this shop usually runs (times.{key})"
        for what, key, percent, given in (
            ("feeds", "feed_override_percent", machine.times.feed_override_percent, args.override),
            ("rapids", "rapid_override_percent", machine.times.rapid_override_percent, args.rapid_override),
        )
        if given is None and percent != 100.0
    ]
    narrower = [f"to narrow the interval most, log {time.narrowed_by}"] if time.narrowed_by else []
    notes = [*narrower, *usual, *([shaped] if (shaped := shaped_note(program)) else []), *([note] if free else [])]
    return runner.finish(time if args.blocks else time.without_blocks(), args, tables=time.tables(), notes=notes)
