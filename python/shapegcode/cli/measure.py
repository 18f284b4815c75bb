"""``shapegcode measure``: what programs would measure on the part, section by section."""

from __future__ import annotations

import argparse
from functools import partial

from shapegcode.cli import options, runner
from shapegcode.cli.arguments import NEEDED, add_alias, add_options, line_range, micrometres


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Simulates programs on the machine's model and measures the response like a part: per section of the path "
        "vibration and settling time, contour error, fitted radius, the walls that the tool leaves, their roughness "
        "and waviness. Programs written by shapegcode are measured against the first one if that is not. "
        "Exit code 0; 1: the response of a program leaves the path by more than tolerance.contour_um (of shaped "
        "programs beside their original the shaped ones count alone); 2: bad input."
    )
    parser.add_argument("inputs", metavar="PROGRAM", nargs="+", help="CNC program; several stand side by side")
    options.add_machine_argument(parser)
    options.add_program_argument(parser)
    add_options(parser, (
        ("--tool-diameter", "LENGTH", micrometres, "of the tool, for example 3mm", NEEDED),
        ("--plant", None, ("modal", "feed-drive"),
         "modal: vibration modes behind an ideal servo; feed-drive: [axes.x.drive] (default: %(default)s)", "modal"),
        ("--against", "ORIGINAL", None,
         "measure against the path of this program (default: the first one if shapegcode wrote the others, else each "
         "program's own path)"),
        ("--lines", "A-B", [line_range],
         "measure the cut of these lines as one section; may be repeated (default: every line and arc)"),
    ))  # fmt: skip
    length = partial(parser.add_argument, metavar="LENGTH", type=micrometres)
    length("--settling-band", default=1.0, help="settled is what stays within it (default: 1um)")
    length("--station", default=50.0, help="distance of the places at which walls are measured (default: 0.05mm)")
    length("--cutoff", help="cut-off of the roughness (default: 0.8mm, less on sections shorter than 5.6 mm)")
    length("--lambda-s", default=0.0, help="short-wave cut-off (default: none)")
    options.add_plots_argument(parser, "write pictures of part, walls and width (PNG and SVG) into this folder")
    options.add_result_arguments(parser)
    add_alias(parser, "--all", "--verbose")


def run(args: argparse.Namespace) -> int:
    """Measure programs."""
    from shapegcode.metrology.measure import measure
    from shapegcode.program import Program

    runner.check_files(args)
    machine = options.load_machine(args)
    with runner.progress("measuring", args) as bar:
        names = [*args.inputs, *([args.against] if args.against is not None else [])]
        read = [Program.read(name, machine, program_number=args.program) for name in names]
        count = len(args.inputs)
        measurement = measure(
            read[:count],
            machine,
            args.tool_diameter * 1e-3,
            plant=args.plant,
            against=read[count] if len(read) > count else None,
            lines=args.lines,
            band_um=args.settling_band,
            station_spacing_mm=args.station * 1e-3,
            cutoff_mm=None if args.cutoff is None else args.cutoff * 1e-3,
            lambda_s_mm=args.lambda_s * 1e-3,
            on_progress=lambda done, total: bar.update(done / total),
        )
    tables = measurement.tables(every_section=args.verbose)
    return runner.finish(measurement, args, tables=tables, notes=[program.how for program in measurement.programs])
