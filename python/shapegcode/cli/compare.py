"""``shapegcode compare``: proof that nothing else changed between two programs."""

from __future__ import annotations

import argparse

from shapegcode.cli import runner
from shapegcode.cli.options import add_machine_argument, add_result_arguments, load_machine


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Compares two programs by what they do: distance of the paths of each cut, order of cuts, rapids, tool calls, "
        "spindle, coolant, offsets, modal state, calls, feeds, other functions, dwells and stops. Every difference is "
        "listed with its lines. Exit code 1 if there is one that --allow does not cover."
    )
    parser.add_argument("input", metavar="A", help="the one program, for example the original")
    parser.add_argument("against", metavar="B", help="the other one, for example what convert made of it")
    add_machine_argument(parser, required=False)
    allowed = "differences that are allowed, for example feeds,blocks,path=20um,calls; a wrong word lists them all"
    parser.add_argument("--allow", metavar="WORDS", default="", help=allowed)
    add_result_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Compare two programs."""
    from shapegcode.program.comparison import compare

    notes = [] if args.machine else ["read as the built-in machine vx500 reads programs: -m MACHINE names another one"]
    args.machine = args.machine or "vx500"
    machine = load_machine(args)
    runner.check_files(args)
    with runner.progress(f"comparing {args.input} with {args.against}", args):
        result = compare(args.input, args.against, machine, allow=args.allow)
    return runner.finish(result, args, notes=notes)
