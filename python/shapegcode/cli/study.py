"""``shapegcode study``: a program on many sampled machines."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from shapegcode.cli import runner
from shapegcode.cli.arguments import count
from shapegcode.cli.options import (
    add_cluster_arguments,
    add_machine_argument,
    add_plots_argument,
    add_result_arguments,
    cluster_of,
    load_machine,
)
from shapegcode.io.data_file import write_lines

if TYPE_CHECKING:
    from shapegcode.machine import Machine
    from shapegcode.studies.study_file import StudyFile


def add_study_arguments(parser: argparse.ArgumentParser, what: str, draws: str) -> None:
    """Declare the study file, the machine and the number of samples; `what` describes the file, `draws` the number."""
    parser.add_argument("input", metavar="STUDY.toml", help=what)
    add_machine_argument(parser, required=False)
    parser.add_argument("-n", "--draws", type=count, metavar="N", help=f"{draws} (default: the file's)")


def load(args: argparse.Namespace) -> tuple[StudyFile, Machine]:
    """The study file and the machine, with program and machine file added to the input files of the command."""
    from shapegcode.errors import ArgumentError
    from shapegcode.studies.study_file import load_study

    file = load_study(args.input)
    args.machine = args.machine or file.machine
    if args.machine is None:
        raise ArgumentError(f"{args.input}: no machine: name one there, or with -m")
    args.inputs = [file.program]
    machine = load_machine(args)
    runner.check_files(args)
    return file if args.draws is None else file.model_copy(update={"n": args.draws}), machine


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Converts a program once and simulates it on machines sampled as the file says (Monte Carlo): how likely it "
        "stays "
        "within tolerance, quantiles, and which value decides. Exit code 1 if that is less likely than at_least."
    )
    add_study_arguments(parser, "program, machine, and what is varied", "how many draws")
    parser.add_argument("--csv", metavar="FILE", help="write one line per draw; - for standard output")
    add_cluster_arguments(parser, "simulate")
    add_plots_argument(
        parser, "write what decides, and the quantiles over it, as pictures (PNG and SVG) into this folder"
    )
    add_result_arguments(parser, cites=False)  # each draw is a run of `convert`, which cites


def run(args: argparse.Namespace) -> int:
    """Run the study."""
    from shapegcode.studies.study import study

    file, machine = load(args)
    options: dict[str, Any] = file.options()
    with runner.progress(f"{args.input}: converting", args) as bar:

        def show(stage: str, share: float) -> None:
            bar.update(share)
            bar.say(f"{args.input}: {stage}")

        result = study(file.program, machine, **options, scheduler=cluster_of(args), on_progress=show)
    if args.csv is not None:
        write_lines(args.csv, result.csv_lines())
    return runner.finish(result, args)
