"""``shapegcode simulate``: play a program on the machine's model."""

from __future__ import annotations

import argparse

from shapegcode.cli.console import add_json_argument
from shapegcode.cli.options import add_input_arguments, add_plots_argument, load_machine, refuse_json_over_input

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Plays the cutting regions of a program through the controller's model and the machine's modes: time, residual "
        "and peak vibration, contour error of command and response."
    )
    add_input_arguments(parser)
    parser.add_argument(
        "--shaped",
        action="store_true",
        help="IN was written by shapegcode: play its blocks at their feed, without look-ahead",
    )
    add_plots_argument(parser)
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Play one program.

    Raises:
        ProgramError, MachineError: bad input.
        OSError: a file cannot be read or written.
    """
    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json
    from shapegcode.converter import written_by_shapegcode
    from shapegcode.program import Program
    from shapegcode.report import simulation_table, warning_table
    from shapegcode.simulator import simulate

    machine = load_machine(args)
    refuse_json_over_input(args)
    with progress(f"playing {args.input}", args.json) as bar:
        program = Program.read(args.input, machine, program_number=args.program)
        # A program of ours says so; played as an ordinary one it would show figures of nothing.
        shaped = args.shaped or written_by_shapegcode(program)
        simulation = simulate(
            program,
            machine,
            shaped=shaped,
            record_samples=0,
            on_progress=lambda done, total: bar.update(done / total),
        )
        report = simulation.report
        if args.plots is not None:
            from shapegcode.pictures import write_simulation_pictures

            report = {**report, "plots": write_simulation_pictures(simulation, args.plots)}
    if args.json is not None:
        write_json(report, args.json)
    console = output_console(args.json)
    console.print(simulation_table(report))
    if report["warnings"]:
        console.print(warning_table(report["warnings"]))
    if shaped:
        console.print("played block by block at its feed, as a shaped program", markup=False)
    else:
        console.print("next: shapegcode convert shapes this program and shows what it gains", markup=False)
    return ExitCode.OK
