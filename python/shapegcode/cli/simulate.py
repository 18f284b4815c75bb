"""``shapegcode simulate``: play a program on the machine's model."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapegcode.cli.console import add_json_argument
from shapegcode.cli.options import (
    add_input_arguments,
    add_plots_argument,
    count,
    line_range,
    load_machine,
    refuse_same_file,
)

if TYPE_CHECKING:
    from shapegcode.machine import Machine
    from shapegcode.program import Program
    from shapegcode.simulation.motion import MotionTraces

__all__ = ["add_arguments", "run"]

# Of the progress bar, for the figures of the regions; the rest is the motion in time.
_FIGURES_SHARE = 0.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Plays a program through the controller's model and the machine's plant. Of each cutting region: time, "
        "residual and peak vibration, settling time, contour error of command and response. Of the whole program with "
        "its rapids, dwells and waits: the motion of the axes in time, as table, files and pictures."
    )
    parser.epilog = (
        "example: shapegcode simulate part.nc -m mine.toml --plant feed-drive --npz motion.npz --plots plots"
    )
    add_input_arguments(parser)
    parser.add_argument(
        "--shaped",
        action="store_true",
        help="IN was written by shapegcode: play its blocks at their feed, without look-ahead",
    )
    parser.add_argument(
        "--plant",
        choices=("modal", "feed-drive"),
        default="modal",
        help="modal: vibration modes behind an ideal servo; feed-drive: motor, ball screw, table, friction and servo "
        "loops of [axes.x.drive] (default: %(default)s)",
    )
    parser.add_argument(
        "--csv",
        metavar="FILE",
        default=None,
        help="write the motion in time, one line per period; - for standard output",
    )
    parser.add_argument("--npz", metavar="FILE", default=None, help="write the same columns as a NumPy archive")
    parser.add_argument(
        "--every", metavar="N", type=count, default=1, help="write every N-th sample only (default: %(default)d)"
    )
    parser.add_argument(
        "--lines",
        metavar="A-B",
        type=line_range,
        default=None,
        help="motion in time of these lines alone, as `shapegcode expand` numbers them; the program is played from its "
        "start in any case",
    )
    add_plots_argument(
        parser,
        "write pictures (PNG and SVG) into this folder: the motion in time, and path, feed and vibration of the region "
        "that vibrates most",
    )
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Play one program.

    Raises:
        ProgramError, MachineError, ArgumentError: bad input.
        NumericError: the integrator of a feed drive fails.
        OSError: a file cannot be read or written.
    """
    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json
    from shapegcode.program import Program
    from shapegcode.program.program import written_by_shapegcode
    from shapegcode.results.table import warning_table
    from shapegcode.simulation.simulate import simulate
    from shapegcode.simulation.tables import motion_table, simulation_table

    _check_targets(args)
    machine = load_machine(args)
    stdout = "-" if "-" in (args.csv, args.json) else None
    with progress(f"playing {args.input}", stdout) as bar:
        program = Program.read(args.input, machine, program_number=args.program)
        # A program of ours says so; played as an ordinary one it would show figures of nothing.
        shaped = args.shaped or written_by_shapegcode(program)
        simulation = simulate(
            program,
            machine,
            plant=args.plant,
            shaped=shaped,
            record_samples=0,
            on_progress=lambda done, total: bar.update(_FIGURES_SHARE * done / total),
        )
        motion, traces = _play_motion(
            args, program, machine, shaped, lambda done: bar.update(_FIGURES_SHARE + (1.0 - _FIGURES_SHARE) * done)
        )
        report = {**simulation.report, "motion": motion}
        if args.plots is not None:
            from shapegcode.simulation.plots import write_motion_pictures, write_simulation_pictures

            part = Path(program.source).name + (f", lines {args.lines[0]} to {args.lines[1]}" if args.lines else "")
            files = write_motion_pictures(traces, args.plots, part)
            report["plots"] = [*files, *write_simulation_pictures(simulation, args.plots)]
    if args.json is not None:
        write_json(report, args.json)
    console = output_console(stdout)
    console.print(simulation_table(report))
    console.print(motion_table(motion))
    if report["warnings"]:
        console.print(warning_table(report["warnings"]))
    if shaped:
        console.print("played block by block at its feed, as a shaped program, against its own path", markup=False)
        console.print("next: shapegcode measure ORIGINAL SHAPED measures it against the programmed path", markup=False)
    else:
        console.print("next: shapegcode convert shapes this program and shows what it gains", markup=False)
    return ExitCode.OK


def _check_targets(args: argparse.Namespace) -> None:
    """Refuse files that would overwrite each other or what is read.

    Raises:
        ArgumentError: two of them are one.
    """
    from shapegcode._core import ArgumentError

    if args.csv == "-" and args.json == "-":
        raise ArgumentError("--csv - and --json -: only one of them can have standard output")
    if args.npz == "-":
        raise ArgumentError("--npz -: an archive cannot go to standard output, name a file")
    targets = [Path(name) for name in (args.csv, args.npz, args.json) if name not in (None, "-")]
    refuse_same_file(targets, [Path(args.input), Path(args.machine)])
    for number, target in enumerate(targets):
        refuse_same_file([target], targets[number + 1 :])


def _play_motion(
    args: argparse.Namespace, program: Program, machine: Machine, shaped: bool, on_progress: Callable[[float], None]
) -> tuple[dict[str, Any], MotionTraces]:
    """Play the whole program once: write its files, and keep its figures and envelopes.

    Raises:
        ArgumentError: the lines hold no motion.
        OSError: a file cannot be written.
    """
    from shapegcode import _core
    from shapegcode.model.machine_model import MachineModel
    from shapegcode.model.stream import stream
    from shapegcode.simulation.files import csv_file, npz_file
    from shapegcode.simulation.motion import MotionFigures, MotionTraces

    chunks = stream(program, machine, plant=args.plant, shaped=shaped, lines=args.lines)
    period_s = machine.controller.interpolation_period_s
    whole_s = _core.time_program(program.core, MachineModel(machine).playing(shaped=shaped).model).total_s or period_s
    figures, traces = MotionFigures(period_s), MotionTraces(period_s)
    with contextlib.ExitStack() as files:
        written = [
            files.enter_context(make(name))
            for make, name in ((csv_file, args.csv), (npz_file, args.npz))
            if name is not None
        ]
        for chunk in chunks:
            traces.add(chunk, figures.add(chunk))
            for file in written:
                file.write(chunk.every(args.every))
            on_progress(float(chunk.time_s[-1]) / whole_s)
        report = figures.report()
        if not report["samples"]:
            raise _core.ArgumentError(f"lines {args.lines[0]}-{args.lines[1]}: nothing happens there: name other lines")
    named = {name: target for name, target in (("csv", args.csv), ("npz", args.npz)) if target is not None}
    return {**report, "lines": args.lines, "every": args.every, **named}, traces
