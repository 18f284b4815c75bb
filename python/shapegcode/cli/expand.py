"""``shapegcode expand``: the expanded program: calls, macros and coordinate modes resolved."""

from __future__ import annotations

import argparse

from shapegcode.cli import runner
from shapegcode.cli.arguments import NEEDED, add_options
from shapegcode.cli.options import add_input_arguments, add_result_arguments, load_machine


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Writes a program with its subprogram calls, custom macros, coordinate modes (G16, G51, G51.1, G68), corner "
        "words and cutter compensation worked out: plain blocks that any control runs, also from DNC. Nothing is "
        "shaped. The input is never overwritten."
    )
    add_input_arguments(parser)
    add_options(parser, (
        ("-o --output", "OUT", None, "program to write; - for standard output", NEEDED),
        ("--compensation", None, ("expand", "keep"),
         "G41/G42 as plain moves of the tool centre, or as they stand (default: %(default)s)", "expand"),
    ))  # fmt: skip
    add_result_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Expand one program; see the module."""
    from shapegcode.program.expand import expand

    machine = load_machine(args, writes_program=True)
    runner.check_files(args)
    with runner.progress(f"expanding {args.input}", args):
        result = expand(args.input, machine, compensation=args.compensation, program_number=args.program)
    return runner.finish(result, args, notes=result.notes, output=(args.output, result.text))
