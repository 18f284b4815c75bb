"""``shapegcode shaper``: which input shapers there are for some modes, what each costs, and which to take."""

from __future__ import annotations

import argparse
from dataclasses import replace

from shapegcode.cli import runner
from shapegcode.cli.arguments import add_alias, add_options, positive, ratio, seconds, share
from shapegcode.cli.options import add_machine_argument, add_plots_argument, add_result_arguments, load_machine

# The registry's, whose solvers take too long to load for a help text.
_FAMILIES = (
    "zv", "zvd", "zvdd", "mzv", "ei", "ei2", "ei3", "si", "negative-zv", "simultaneous", "minimal", "polynomial",
    "non-negative", "robust", "mirrored", "smooth-zv", "smooth-mzv", "smooth-ei", "smooth-ei2", "smooth-si",
    "smooth-zvd-ei", "taps",
)  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Designs every family of input shapers for some vibration modes and compares them: duration, residual "
        "vibration if the frequencies are off, contour cost, negative impulses; and recommends one. "
        "Exit code 0: it stays within the vibration limit; 1: the best one does not; 2: bad input."
    )
    add_options(parser, ((
        "--mode", "HZ[:DAMPING][±BAND]", [None],
        "a mode to cancel, such as 46:0.02±5%%, 46:0.02+-2Hz or 46:0.02-5%%+8%%, from 0.1 to 10000 Hz; once for each "
        "mode", [],
    ),))  # fmt: skip
    add_machine_argument(parser, required=False)
    add_options(parser, (
        ("--uncertainty", "RATIO", share,
         "how far the frequency of a mode that states no band may be off, for example 5%% (default: 0)", 0.0),
        ("--block-period", "TIME", [seconds],
         "block period on which the impulses must lie, such as 5ms; may be repeated (default: the machine's, or the "
         "best few)", []),
        ("--continuous", None, bool,
         "designs at continuous times, with --block-period beside those on its grid (default: without a machine)"),
        ("--family", "NAME", {"action": "extend", "nargs": "+"},
         f"compare only these families, of {', '.join(_FAMILIES)} (default: all)"),
        ("--list-families", None, bool, "say what each family is and where it comes from, and nothing else"),
        ("--max-duration", "TIME", seconds,
         "longest shaper, for example 50ms (default: three periods of the slowest mode; the machine's limit if that is "
         "not enough)"),
        ("--max-abs-sum", "N", positive, "largest sum of the impulses' magnitudes (default: %(default)g)", 10.0),
        ("--vibration-limit", "RATIO", ratio,
         "largest share of the vibration that may be left anywhere in the bands (default: the machine's "
         "shaping.vibration_limit, else 5%%)"),
        ("--objective", None, ("shortest", "contour", "robust"),
         "what the recommended design minimizes, within the limit: duration, contour cost, or residual vibration "
         "(default: %(default)s)", "shortest"),
        ("--negative", None, bool, "a design with negative impulses may be recommended"),
        ("--taps", "TIME:A,...", None, 'compare a shaper of your own: "0:.5,10.9ms:.5"'),
        ("--speed", "MM/S", positive, "speed at which the contour cost is shown (default: %(default)g)", 200.0),
        ("--radius", "MM", positive, "radius of the arc on which it is shown (default: %(default)g)", 20.0),
    ))  # fmt: skip
    add_plots_argument(parser, "write pictures of the comparison (PNG and SVG) into this folder")
    add_result_arguments(parser)
    add_alias(parser, "--all", "--verbose")


def run(args: argparse.Namespace) -> int:
    """Compare shapers."""
    from shapegcode._core import ArgumentError
    from shapegcode.shaping.comparison import choose_shaper
    from shapegcode.shaping.result import families_table

    if args.list_families:
        runner.output_console(args.json).print(families_table())
        return 0
    if bool(args.mode) == (args.machine is not None):
        raise ArgumentError("the modes come from --mode 46:0.02 ... or from -m MACHINE: give one of both")
    machine = None if args.machine is None else load_machine(args)
    runner.check_files(args)
    with runner.progress("comparing shapers", args) as bar:
        result = choose_shaper(
            args.mode,
            machine=machine,
            uncertainty=args.uncertainty,
            periods_s=[*([None] if args.continuous else []), *args.block_period] or None,
            families=args.family,
            max_duration_s=args.max_duration,
            max_abs_sum=args.max_abs_sum,
            vibration_limit=args.vibration_limit,
            objective=args.objective,
            allow_negative=args.negative,
            taps=args.taps,
            on_progress=bar.update,
        )
    result = replace(result, machine=args.machine)
    tables = result.tables(args.speed, args.radius, everything=args.verbose)
    return runner.finish(result, args, tables=tables, notes=result.notes())
