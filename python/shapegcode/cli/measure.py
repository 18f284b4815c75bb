"""``shapegcode measure``: what programs would measure on the part, section by section."""

from __future__ import annotations

import argparse
from pathlib import Path

from shapegcode.cli.console import add_json_argument
from shapegcode.cli.options import (
    add_machine_argument,
    add_plots_argument,
    add_program_argument,
    line_range,
    load_machine,
    micrometres,
    refuse_same_file,
)

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Plays programs on the machine's model and measures the response like a part: per section of the path "
        "vibration and settling time, contour error, fitted radius, the walls that the tool leaves, their roughness "
        "and waviness. Programs written by shapegcode are measured against the first one if that is not. "
        "Exit code 0; 1: the response of a program leaves the path by more than tolerance.contour_um (of shaped "
        "programs beside their original the shaped ones count alone); 2: bad input."
    )
    parser.epilog = "example: shapegcode measure part.nc shaped.nc -m vx500 --tool-diameter 3mm --plots plots"
    parser.add_argument("inputs", metavar="PROGRAM", nargs="+", help="CNC program; several stand side by side")
    add_machine_argument(parser)
    add_program_argument(parser)
    parser.add_argument(
        "--tool-diameter", metavar="LENGTH", type=micrometres, required=True, help="of the tool, for example 3mm"
    )
    parser.add_argument(
        "--plant",
        choices=("modal", "feed-drive"),
        default="modal",
        help="modal: vibration modes behind an ideal servo; feed-drive: [axes.x.drive] (default: %(default)s)",
    )
    parser.add_argument(
        "--against",
        metavar="ORIGINAL",
        default=None,
        help="measure against the path of this program (default: the first one if shapegcode wrote the others, else "
        "each program's own path)",
    )
    parser.add_argument(
        "--lines",
        metavar="A-B",
        type=line_range,
        action="append",
        default=None,
        help="measure the cut of these lines as one section; may be repeated (default: every line and arc)",
    )
    parser.add_argument(
        "--settling-band",
        metavar="LENGTH",
        type=micrometres,
        default=1.0,
        help="settled is what stays within it (default: 1um)",
    )
    parser.add_argument(
        "--station",
        metavar="LENGTH",
        type=micrometres,
        default=50.0,
        help="distance of the places at which walls are measured (default: 0.05mm)",
    )
    parser.add_argument(
        "--cutoff",
        metavar="LENGTH",
        type=micrometres,
        default=None,
        help="cut-off of the roughness (default: 0.8mm, less on sections shorter than 5.6 mm)",
    )
    parser.add_argument(
        "--lambda-s", metavar="LENGTH", type=micrometres, default=0.0, help="short-wave cut-off (default: none)"
    )
    parser.add_argument(
        "--all", action="store_true", help="show every section (default: the 12 with the largest contour error)"
    )
    add_plots_argument(parser, "write pictures of part, walls and width (PNG and SVG) into this folder")
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Measure programs.

    Raises:
        ProgramError, MachineError, ArgumentError: bad input.
        OSError: a file cannot be read or written.
    """
    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json
    from shapegcode.metrology.measure import measure
    from shapegcode.metrology.tables import measurement_tables, next_step, verdicts
    from shapegcode.program import Program
    from shapegcode.results.table import warning_table

    machine = load_machine(args)
    names = [*args.inputs, *([args.against] if args.against is not None else [])]
    if args.json not in (None, "-"):
        refuse_same_file([Path(args.json)], [Path(name) for name in [*names, args.machine]])
    with progress("measuring", args.json) as bar:
        programs = [Program.read(name, machine, program_number=args.program) for name in args.inputs]
        against = None
        if args.against is not None:
            against = Program.read(args.against, machine, program_number=args.program)
        measurement = measure(
            programs,
            machine,
            args.tool_diameter * 1e-3,
            plant=args.plant,
            against=against,
            lines=args.lines,
            band_um=args.settling_band,
            station_spacing_mm=args.station * 1e-3,
            cutoff_mm=None if args.cutoff is None else args.cutoff * 1e-3,
            lambda_s_mm=args.lambda_s * 1e-3,
            on_progress=lambda done, total: bar.update(done / total),
        )
        report = measurement.report()
        if args.plots is not None:
            from shapegcode.metrology.plots import write_measurement_pictures

            report["plots"] = write_measurement_pictures(measurement, args.plots)
    if args.json is not None:
        write_json(report, args.json)
    console = output_console(args.json)
    for table in measurement_tables(report, every_section=args.all):
        console.print(table)
    for program in report["programs"]:
        console.print(_said(program), markup=False, soft_wrap=True)
    warnings = list(dict.fromkeys(warning for program in report["programs"] for warning in program["warnings"]))
    if warnings:
        console.print(warning_table(warnings))
    if args.plots is not None:
        drawn = f"{args.plots}/measure-*" if report["plots"] else "none, as no walls were measured"
        console.print(f"pictures: {drawn}", markup=False, soft_wrap=True)
    for verdict in verdicts(report):
        console.print(verdict, markup=False, soft_wrap=True)
    console.print(f"next: {next_step(report)}", markup=False)
    return ExitCode.OK if measurement.within_tolerance else ExitCode.OUT_OF_TOLERANCE


def _said(program: dict[str, object]) -> str:
    name, against = program["program"], program["measured_against"]
    how = "block by block, as a shaped program" if program["shaped"] else "with the controller's own motion"
    path = "its own path" if against == name else f"the path of {against}"
    judged = ""
    if program["within_tolerance"] is None:
        judged = ", which is not the programmed one" if program["shaped"] else ", to compare the shaped with"
        judged += ": not judged"
    return f"{name}: played {how}, measured against {path}{judged}"
