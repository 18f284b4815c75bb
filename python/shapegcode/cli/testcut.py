"""``shapegcode testcut``: test cuts as programs, and what their measured forces tell."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapegcode.cli.console import add_json_argument
from shapegcode.cli.options import (
    add_machine_argument,
    add_plots_argument,
    load_machine,
    positive,
    program_number,
    refuse_same_file,
)

if TYPE_CHECKING:
    from shapegcode.machine import Machine
    from shapegcode.testcut.design import Conditions, Design
    from shapegcode.testcut.plan import TestCut
    from shapegcode.testcut.taper import Measured

__all__ = ["add_arguments", "run"]

_PROGRAM = 7101
_STATION_MM = 0.01


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the actions."""
    parser.description = (
        "Writes test cuts (paper 001) as programs with instructions in their heads and a side file (JSON) that "
        "describes the cut; `fit` reads that and the measured forces. Exit code 0; 1: the fit is poor or the result "
        "not as it should be; 2: bad input."
    )
    parser.epilog = "example: shapegcode testcut taper -m vx500 --tool em8.toml -S 1800 -F 216 -a 15 -o TAPER.NC"
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True, title="actions")
    taper = actions.add_parser(
        "taper",
        help="growing radial depth: for the coefficients of the cutting force (figure 4)",
        description="Mills a tapered edge, then passes along it with one feed each: for k1 and k2.",
    )
    _add_cut_arguments(taper, many_feeds=True)
    taper.add_argument(
        "--radial-depth",
        metavar="MM:MM",
        type=_pair,
        default=None,
        help="radial depth at begin and end of the stock (default: 0.05 to 0.35 of the diameter)",
    )
    taper.add_argument(
        "--length", metavar="MM", type=positive, default=60.0, help="length of the stock along X (default: %(default)s)"
    )
    corner = actions.add_parser(
        "corner",
        help="a corner unrolled on a straight line: constant feed, then modified (figure 7)",
        description="Mills an edge on which a straight pass meets the radial depth of a corner, and passes it with "
        "constant feed, then with the feed of equation 7.",
    )
    _add_cut_arguments(corner)
    _add_corner_arguments(corner)
    corner.add_argument(
        "--interval",
        metavar="MM",
        type=positive,
        default=None,
        help="length of a block with a feed of its own (default: feed_control.interval_mm of the machine)",
    )
    interval = actions.add_parser(
        "interval",
        help="feeds that change every 0.2, 0.4 and 0.6 mm: which the controller follows (figure 8)",
        description="Passes of constant radial depth whose feed changes as in a corner, each at another interval.",
    )
    _add_cut_arguments(interval)
    _add_corner_arguments(interval)
    interval.add_argument(
        "--intervals",
        metavar="MM,MM,...",
        type=_list,
        default=(0.2, 0.4, 0.6),
        help="lengths of the blocks, one pass each (default: 0.2,0.4,0.6)",
    )
    interval.add_argument(
        "--feeds",
        metavar="F,F,...",
        type=_list,
        default=None,
        help="feeds of the blocks in mm/min, the same for every pass (default: the corner's by equation 7)",
    )
    _add_fit(actions)


def _add_cut_arguments(parser: argparse.ArgumentParser, *, many_feeds: bool = False) -> None:
    add_machine_argument(parser)
    parser.add_argument("--tool", metavar="T.toml", required=True, help="tool file")
    parser.add_argument("-o", "--output", metavar="OUT.NC", required=True, help="program; the side file is OUT.json")
    parser.add_argument(
        "-S",
        "--spindle",
        metavar="REV",
        type=positive,
        default=None,
        help="spindle speed in rev/min (default: feed.spindle_rev_per_min of the tool file)",
    )
    if many_feeds:
        parser.add_argument(
            "-F",
            "--feeds",
            metavar="F,F,...",
            type=_list,
            required=True,
            help="feed in mm/min; one is passed at its half, once and double",
        )
    else:
        parser.add_argument("-F", "--feed", metavar="F", type=positive, required=True, help="feed in mm/min")
    parser.add_argument("-a", "--axial-depth", metavar="MM", type=positive, required=True, help="axial depth")
    parser.add_argument(
        "--up", action="store_true", help="up milling, the material on the left (default: down milling)"
    )
    parser.add_argument(
        "--program",
        metavar="O1234",
        type=program_number,
        default=_PROGRAM,
        help=f"number of the program (default: O{_PROGRAM})",
    )
    add_json_argument(parser)


def _add_corner_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--allowance", metavar="MM", type=positive, default=None, help="radial depth on the walls (default: 0.1 D)"
    )
    parser.add_argument(
        "--rough-radius", metavar="MM", type=positive, default=None, help="of the rough corner (default: D)"
    )
    parser.add_argument(
        "--finish-radius", metavar="MM", type=positive, default=None, help="of the finished corner (default: D)"
    )


def _add_fit(actions: Any) -> None:
    fit = actions.add_parser(
        "fit",
        help="what the measured forces of a test cut tell",
        description="Reads the side file of a test cut and the records of its passes, in their order: of a taper the "
        "coefficients with 95 % intervals, of a corner measured against expected resultant, of an interval test the "
        "shortest interval that the controller follows.",
        epilog="example: shapegcode testcut fit pass1.csv pass2.csv pass3.csv --cut TAPER.json -o cutting.toml",
    )
    fit.add_argument(
        "files",
        metavar="CSV",
        nargs="+",
        help="record of a pass with a header, time_s or position_mm, fx_n, fy_n; 2=FILE names the pass",
    )
    fit.add_argument("--cut", metavar="OUT.json", required=True, help="side file of the test cut")
    fit.add_argument(
        "--forces-on",
        choices=("workpiece", "tool"),
        default="workpiece",
        help="on what the measured forces act; a dynamometer below the work piece measures those on it "
        "(default: %(default)s)",
    )
    fit.add_argument(
        "--chip-thickness",
        choices=("mean", "local"),
        default="mean",
        help="taper: to which chip thickness the power laws belong (default: %(default)s)",
    )
    fit.add_argument("--edge-forces", action="store_true", help="taper: fit the forces of the edge, K_te and K_re, too")
    fit.add_argument("-o", "--output", metavar="FILE", default=None, help="taper: write the table [cutting] (TOML)")
    add_plots_argument(fit, "write pictures (PNG and SVG) of measured and expected forces into this folder")
    add_json_argument(fit)


def run(args: argparse.Namespace) -> int:
    """Write a test cut, or fit; see the module.

    Raises:
        ArgumentError, MachineError, ToolError: bad input.
        OSError: a file cannot be read or written.
    """
    return _fit(args) if args.action == "fit" else _write(args)


def _write(args: argparse.Namespace) -> int:
    import dataclasses

    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, write_json
    from shapegcode.io.atomic import write_text
    from shapegcode.testcut.program import program_text
    from shapegcode.testcut.tables import cut_table, design_notes

    machine = load_machine(args)
    output = Path(args.output)
    side = output.with_suffix(".json")
    targets = [output, side, *([Path(args.json)] if args.json not in (None, "-") else [])]
    read = [Path(args.machine), Path(args.tool)]
    for k, target in enumerate(targets):
        refuse_same_file([target], [*read, *targets[:k]])
    design = _design(args, machine, _conditions(args, machine))
    cut = dataclasses.replace(design.cut, program=output.name)
    design = dataclasses.replace(design, cut=cut)
    write_text(output, program_text(design, machine, args.program))
    write_json(cut.data(), side)
    if args.json is not None:
        write_json({"program": str(output), "side_file": str(side), **cut.data()}, args.json)
    console = output_console(args.json)
    console.print(cut_table(cut))
    for note in design_notes(cut):
        console.print(note, markup=False, soft_wrap=True)
    console.print(f"wrote {output} (instructions in its head) and {side}", markup=False, soft_wrap=True)
    files = " ".join(f"pass{k + 1}.csv" for k in range(len(cut.passes)))
    console.print(f"next: run it, then shapegcode testcut fit {files} --cut {side}", markup=False, soft_wrap=True)
    return ExitCode.OK


def _conditions(args: argparse.Namespace, machine: Machine) -> Conditions:
    from shapegcode._core import ArgumentError
    from shapegcode.cutting.tool import Tool
    from shapegcode.testcut.design import Conditions

    tool = Tool.load(args.tool)
    spindle = args.spindle if args.spindle is not None else tool.feed.spindle_rev_per_min
    if spindle is None:
        raise ArgumentError(f"{args.tool} has no feed.spindle_rev_per_min: state the spindle speed with -S")
    feed = args.feeds[0] if args.action == "taper" else args.feed
    return Conditions(machine, tool, spindle, feed, args.axial_depth, args.up)


def _design(args: argparse.Namespace, machine: Machine, given: Conditions) -> Design:
    from shapegcode.testcut.design import corner_cut, corner_feed_sequence, interval_cut, taper_cut

    diameter = 2.0 * given.tool.radius_mm
    if args.action == "taper":
        feeds = args.feeds if len(args.feeds) > 1 else tuple(args.feeds[0] * share for share in (0.5, 1.0, 2.0))
        depths = args.radial_depth or (0.05 * diameter, 0.35 * diameter)
        return taper_cut(given, feeds, depths, args.length)
    corner = _corner(args, diameter)
    if args.action == "corner":
        interval = args.interval if args.interval is not None else machine.feed_control.interval_mm
        return corner_cut(given, corner, interval)
    if args.feeds is not None:
        sequences = [args.feeds] * len(args.intervals)
    else:
        sequences = [corner_feed_sequence(given, corner, interval) for interval in args.intervals]
    return interval_cut(given, corner.allowance_mm, args.intervals, sequences)


def _corner(args: argparse.Namespace, diameter: float) -> Any:
    from shapegcode.testcut.design import Corner

    return Corner(args.allowance or 0.1 * diameter, args.rough_radius or diameter, args.finish_radius or diameter)


def _fit(args: argparse.Namespace) -> int:
    from shapegcode._core import ArgumentError
    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json
    from shapegcode.io.atomic import write_text
    from shapegcode.testcut import tables as cut_table
    from shapegcode.testcut.corner import corner_result, interval_result
    from shapegcode.testcut.plan import load_cut
    from shapegcode.testcut.taper import fit_taper

    cut = load_cut(args.cut)
    if cut.kind != "taper" and (args.output is not None or args.edge_forces or args.chip_thickness != "mean"):
        raise ArgumentError(
            f"{args.cut} describes a {cut.kind}: -o, --edge-forces and --chip-thickness go with a taper"
        )
    measured = _measured(args, cut)
    if args.output is not None:
        _refuse_whole_tool_file(Path(args.output))
    targets = [Path(name) for name in (args.output, args.json) if name not in (None, "-")]
    refuse_same_file(targets, [Path(args.cut), *(Path(each.record.file) for each in measured)])
    refuse_same_file(targets[:1], targets[1:])
    with progress(f"fitting {args.cut}", args.json) as bar:
        bar.wait()
        result: Any
        if cut.kind == "taper":
            result = fit_taper(cut, measured, thickness=args.chip_thickness, edge=args.edge_forces)
        else:
            result = corner_result(cut, measured) if cut.kind == "corner" else interval_result(cut, measured)
        if args.plots is not None:
            from shapegcode.testcut.plots import write_cut_pictures

            write_cut_pictures(result, args.plots)
    if args.output is not None:
        write_text(args.output, cut_table.cutting_toml(result))
    if args.json is not None:
        write_json({"cut": args.cut, "output": args.output, **result.report()}, args.json)
    console = output_console(args.json)
    console.print(cut_table.result_table(result))
    for line in cut_table.result_lines(result):
        console.print(line, markup=False, soft_wrap=True)
    if args.output is not None:
        console.print(f"wrote {args.output}: [cutting] for the tool file", markup=False, soft_wrap=True)
    console.print(f"next: {cut_table.next_step(result)}", markup=False, soft_wrap=True)
    return ExitCode.OK if cut_table.is_good(result) else ExitCode.OUT_OF_TOLERANCE


def _measured(args: argparse.Namespace, cut: TestCut) -> list[Measured]:
    from shapegcode._core import ArgumentError
    from shapegcode.testcut.record import read_forces
    from shapegcode.testcut.taper import Measured

    found: list[Measured] = []
    for place, text in enumerate(args.files, start=1):
        head, sign, rest = text.partition("=")
        named = bool(sign) and head.isdigit()
        number, file = (int(head), rest) if named else (place, text)
        if not 1 <= number <= len(cut.passes):
            raise ArgumentError(f"{text}: pass {number}: {args.cut} has {len(cut.passes)} passes")
        if any(each.number == number for each in found):
            raise ArgumentError(f"{text}: pass {number} is given twice: name the passes, for example 2={file}")
        found.append(Measured(read_forces(file, on=args.forces_on), number))
    return found


def _list(text: str) -> tuple[float, ...]:
    """Numbers above 0, divided by commas."""
    return tuple(positive(part.strip()) for part in text.split(","))


def _pair(text: str) -> tuple[float, float]:
    low, sign, high = text.partition(":")
    pair = (positive(low), positive(high)) if sign else (math.nan, math.nan)
    if not pair[0] < pair[1]:
        raise argparse.ArgumentTypeError(f"{text!r}: must be two lengths in mm, ascending, for example 0.4:2.8")
    return pair


def _refuse_whole_tool_file(path: Path) -> None:
    """Refuse to write the table [cutting] over a file that holds more than that.

    Raises:
        ArgumentError: it does.
    """
    import tomllib

    from shapegcode._core import ArgumentError

    try:
        tables = set(tomllib.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError):  # not there, or nothing of ours
        return
    if tables - {"cutting"}:
        raise ArgumentError(
            f"-o {path}: holds more than [cutting] ({', '.join(sorted(tables - {'cutting'}))}), which would be lost: "
            "name another file and put its table into this one"
        )
