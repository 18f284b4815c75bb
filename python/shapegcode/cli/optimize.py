"""``shapegcode optimize``: the shortest program that stays within tolerance with a given probability."""

from __future__ import annotations

import argparse
import shlex
from dataclasses import replace

from shapegcode.cli import runner
from shapegcode.cli.arguments import ratio
from shapegcode.cli.options import add_plots_argument, add_result_arguments
from shapegcode.cli.study import add_study_arguments, load


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Chooses block period, shaper, tolerance that is aimed at and feed on arcs, or what [choose] of the file has, "
        "for the shortest time at which the program stays within tolerance on enough of the sampled machines. "
        "The file is that of `shapegcode study`. Exit code 1 if no choice is likely enough."
    )
    add_study_arguments(
        parser,
        "program, machine, what is varied, what can be chosen",
        "on how many sampled machines a choice is simulated",
    )
    within = "probability of staying within tolerance, for example 99%% (default: the file's)"
    parser.add_argument("--at-least", type=ratio, metavar="RATIO", help=within)
    add_plots_argument(parser, "write time and probability of the choices as a picture (PNG and SVG) into this folder")
    add_result_arguments(parser, cites=False)  # each draw is a run of `convert`, which cites


def run(args: argparse.Namespace) -> int:
    """Choose."""
    from shapegcode.studies.optimize import optimize

    file, machine = load(args)
    options = file.choice_options() | ({} if args.at_least is None else {"probability": args.at_least})
    with runner.progress(f"{args.input}: converting", args) as bar:
        result = optimize(file.program, machine, **options, on_progress=bar.update)
    words = shlex.join([args.machine, *(word for each in args.set for word in ("--set", each))])
    return runner.finish(replace(result, machine_words=words), args)
