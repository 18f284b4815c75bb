"""``shapegcode sweep``: a program that shakes an axis, for modes without a hammer."""

from __future__ import annotations

import argparse

from shapegcode.cli import runner
from shapegcode.cli.arguments import NEEDED, add_options, frequency_band, positive, program_number, ratio
from shapegcode.cli.options import add_machine_argument, add_result_arguments, load_machine


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Writes a program that shakes one axis: moves back and forth whose frequency rises and falls, band by band, "
        "with pauses. Reports the band that the control can reach and the acceleration of each part, simulated from "
        "the written program. Any logger records accelerations while it runs; `identify --sweep` finds the "
        "modes. Exit "
        "code 0; 2: bad input, or a band that the control does not reach."
    )
    add_machine_argument(parser)
    add_options(parser, (
        ("--axis", None, ("x", "y", "z"), "that is shaken (default: %(default)s)", "x"),
        ("--frequencies", "LOW:HIGH", frequency_band,
         "of the moves back and forth, Hz (default: from 8 Hz up to what the control reaches, at most 200 Hz)"),
        ("--travel", "MM", positive,
         "longest move, in the positive direction from the start point (default: 5)", 5.0),
        ("--acceleration", "SHARE", ratio,
         "amplitude, of the largest acceleration of the axis: a drive tolerates some 30%% for the whole sweep "
         "(default: 30%%)", 0.3),
        ("--seconds", "S", positive, "approximate duration of all moves together (default: 60)", 60.0),
        ("-o --output", "OUT.NC", None, "program", NEEDED),
        ("--program", "O1234", program_number, "number of the program (default: O7201)", 7201),
    ))  # fmt: skip
    add_result_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Write the program."""
    from shapegcode.identification.sweep_program import plan_sweep

    machine = load_machine(args, writes_program=True)
    runner.check_files(args)
    with runner.progress("planning the strokes", args):
        found, text = plan_sweep(
            args.output, machine, args.axis, band_hz=args.frequencies, travel_mm=args.travel,
            acceleration_share=args.acceleration, seconds=args.seconds, number=args.program,
        )  # fmt: skip
    return runner.finish(found, args, output=(args.output, text.encode("ascii")))
