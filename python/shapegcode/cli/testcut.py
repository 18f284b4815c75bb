"""``shapegcode testcut``: test cuts as programs, and cutting-force parameters from their measured forces."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from shapegcode.cli import runner
from shapegcode.cli.arguments import NEEDED, add_options, positive, program_number
from shapegcode.cli.options import add_machine_argument, add_plots_argument, add_result_arguments, load_machine


def _list(text: str) -> tuple[float, ...]:
    """Numbers above 0, divided by commas."""
    return tuple(positive(part.strip()) for part in text.split(","))


def _pair(text: str) -> tuple[float, float]:
    low, sign, high = text.partition(":")
    pair = (positive(low), positive(high)) if sign else (math.nan, math.nan)
    if not pair[0] < pair[1]:
        raise argparse.ArgumentTypeError(f"{text!r}: must be two lengths in mm, ascending, for example 0.4:2.8")
    return pair


# Options of the actions, as `add_options` takes them.
_CUT = (
    ("--tool", "T.toml", None, "tool file", NEEDED),
    ("-o --output", "OUT.NC", None, "program; the side file is OUT.json", NEEDED),
    ("-S --spindle", "REV", positive, "rev/min (default: feed.spindle_rev_per_min of the tool file)"),
    ("-a --axial-depth", "MM", positive, "axial depth", NEEDED),
    ("--program", "O1234", program_number, "number of the program (default: O7101)", 7101),
)
_SHAPE = (
    ("-F --feed", "F", positive, "feed in mm/min", NEEDED),
    ("--allowance", "MM", positive, "radial depth on the walls (default: 0.1 D)"),
    ("--rough-radius", "MM", positive, "of the rough corner (default: D)"),
    ("--finish-radius", "MM", positive, "of the finished corner (default: D)"),
)
_TAPER = (
    ("-F --feeds", "F,F,...", _list, "in mm/min; one is passed at its half, once and double", NEEDED),
    ("--radial-depth", "MM:MM", _pair, "at begin and end of the stock (default: 0.05 to 0.35 of the diameter)"),
    ("--length", "MM", positive, "of the stock along X (default: %(default)s)", 60.0),
)
_CORNER = (("--interval", "MM", positive, "of a block (default: feed_control.interval_mm of the machine)", None),)
_INTERVAL = (
    ("--intervals", "MM,MM,...", _list, "lengths of the blocks, one pass each (default: 0.2,0.4,0.6)", (0.2, 0.4, 0.6)),
    ("--feeds", "F,F,...", _list, "of the blocks, the same for every pass (default: the corner's by equation 7)"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the actions."""
    parser.description = (
        "Writes test cuts (paper 001) as programs with instructions in their heads and a side file (JSON) that "
        "describes the cut; `fit` reads that and the measured forces. Exit code 0; 1: the fit is poor or the result "
        "not as it should be; 2: bad input."
    )
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True, title="actions")
    for name, options, meaning, description in (
        (
            "taper", _TAPER, "growing radial depth: for the coefficients of the cutting force (figure 4)",
            "Mills a tapered edge, then passes along it with one feed each: for k1 and k2.",
        ),
        (
            "corner", (*_SHAPE, *_CORNER),
            "a corner unrolled on a straight line: constant feed, then modified (figure 7)",
            "Mills an edge on which a straight pass meets the radial depth of a corner, and passes it with constant "
            "feed, then with the feed of equation 7.",
        ),
        (
            "interval", (*_SHAPE, *_INTERVAL),
            "feeds that change every 0.2, 0.4 and 0.6 mm: which the controller follows (figure 8)",
            "Passes of constant radial depth whose feed changes as in a corner, each at another interval.",
        ),
    ):  # fmt: skip
        cut = actions.add_parser(name, help=meaning, description=description)
        add_machine_argument(cut)
        add_options(cut, (*_CUT, *options))
        cut.add_argument("--up", action="store_true", help="up milling, material on the left (default: down milling)")
        add_result_arguments(cut)
    _add_fit(actions)


def _add_fit(actions: Any) -> None:
    fit = actions.add_parser(
        "fit",
        help="evaluate the measured forces of a test cut",
        description="Reads the side file of a test cut and the records of its passes, in their order: of a taper the "
        "coefficients with 95 % intervals, of a corner measured against expected resultant, of an interval test the "
        "shortest interval that the controller follows.",
    )
    fit.add_argument(
        "files", metavar="CSV", nargs="+",
        help="record of a pass with a header, time_s or position_mm, fx_n, fy_n; 2=FILE names the pass",
    )  # fmt: skip
    add_options(fit, (
        ("--cut", "OUT.json", None, "side file of the test cut", NEEDED),
        ("--forces-on", None, ("workpiece", "tool"),
         "on what the measured forces act; a dynamometer below the work piece measures those on it (default: "
         "%(default)s)", "workpiece"),
        ("--chip-thickness", None, ("mean", "local"),
         "taper: to which chip thickness the power laws belong (default: %(default)s)", "mean"),
        ("--edge-forces", None, bool, "taper: fit the forces of the edge, K_te and K_re, too"),
        ("-o --output", "FILE", None, "taper: write the table [cutting] (TOML)"),
    ))  # fmt: skip
    add_plots_argument(fit, "write pictures (PNG and SVG) of measured and expected forces into this folder")
    add_result_arguments(fit)


def run(args: argparse.Namespace) -> int:
    """Write a test cut, or fit; see the module."""
    return _fit(args) if args.action == "fit" else _write(args)


def _write(args: argparse.Namespace) -> int:
    from shapegcode.cutting.tool import Tool
    from shapegcode.testcut.design import (
        CornerShape,
        CutConditions,
        corner_cut,
        interval_cut,
        taper_cut,
        write_test_cut,
    )

    feed = args.feeds[0] if args.action == "taper" else args.feed
    conditions = CutConditions(
        load_machine(args, writes_program=True), Tool.load(args.tool), feed, args.axial_depth, args.spindle, args.up
    )
    if args.action == "taper":
        design = taper_cut(conditions, args.feeds if len(args.feeds) > 1 else None, args.radial_depth, args.length)
    else:
        shape = CornerShape(args.allowance, args.rough_radius, args.finish_radius)
        if args.action == "corner":
            design = corner_cut(conditions, shape, args.interval)
        else:
            design = interval_cut(conditions, shape, args.intervals, args.feeds)
    runner.check_files(args, also_written=[Path(args.output).with_suffix(".json")])
    design = write_test_cut(design, args.output, args.program)
    return runner.finish(design, args, wrote=design.files)


def _fit(args: argparse.Namespace) -> int:
    from shapegcode.errors import ArgumentError
    from shapegcode.testcut.cut import read_test_cut
    from shapegcode.testcut.fit import fit_test_cut
    from shapegcode.testcut.result import TaperResult

    cut = read_test_cut(args.cut)
    if args.output is not None:
        if cut.kind != "taper":
            raise ArgumentError(f"{args.cut} describes a {cut.kind}: -o goes with a taper")
        _refuse_whole_tool_file(args.output)
    records = _records(args.files)
    runner.check_files(args, also_read=list(records.values()))
    with runner.progress(f"fitting {args.cut}", args):
        found = fit_test_cut(
            cut, records, forces_on=args.forces_on, chip_thickness=args.chip_thickness, edge_forces=args.edge_forces
        )
    table = found.to_toml().encode() if isinstance(found, TaperResult) else b""
    return runner.finish(found, args, output=(args.output, table) if args.output is not None else None)


def _records(texts: list[str]) -> dict[int, str]:
    """The files by the number of their pass: ``2=FILE`` names it, else their order does."""
    from shapegcode.errors import ArgumentError

    found: dict[int, str] = {}
    for place, text in enumerate(texts, start=1):
        head, sign, rest = text.partition("=")
        number, file = (int(head), rest) if sign and head.isdigit() else (place, text)
        if number in found:
            raise ArgumentError(f"{text}: pass {number} is given twice: name the passes, for example 2={file}")
        found[number] = file
    return found


def _refuse_whole_tool_file(name: str) -> None:
    """Refuse to write the table [cutting] over a file that holds more than that."""
    from shapegcode.errors import ArgumentError
    from shapegcode.io.data_file import MAX_SETTINGS_BYTES, read_file, toml_tables

    try:
        more = sorted(set(toml_tables(read_file(name, MAX_SETTINGS_BYTES).decode())) - {"cutting"})
    except (OSError, ValueError):  # not there, or nothing of ours
        return
    if more:
        raise ArgumentError(
            f"-o {name}: holds more than [cutting] ({', '.join(more)}), which would be lost: name another file and "
            "put its table into this one"
        )
