"""``shapegcode characterize``: measure how a controller executes blocks, and write it to the machine file.

``shapegcode testcut``: write test cuts as programs, and fit cutting-force parameters to their measured forces.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapegcode.cli import runner
from shapegcode.cli.arguments import NEEDED, Interface, OneOf, positive, program_number
from shapegcode.cli.options import MACHINE, RESULT, load_machine, plots
from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import MAX_SETTINGS_BYTES, read_file, toml_tables

if TYPE_CHECKING:
    from shapegcode.machine import Machine


_OF_ACTIONS = {"axes": ["servo"], "drive": ["servo"], "plots": ["servo", "runs"], "look-ahead": ["runs"]}


def _characterize(args: argparse.Namespace) -> int:
    _check_options(args)
    machine = load_machine(args, writes_program=args.write is not None)
    runner.check_files(args, also_read=[each for each in (args.servo, args.runs) if each is not None])
    if args.servo is not None:
        return _servo(args, machine)
    if args.runs is not None:
        return _runs(args, machine)
    return _write(args, machine) if args.write is not None else _fit(args, machine)


def _check_options(args: argparse.Namespace) -> None:
    """Refuse options that do not belong to the selected action."""
    for option, actions in _OF_ACTIONS.items():
        value = getattr(args, option.replace("-", "_"))
        if value not in (None, False) and all(getattr(args, action) is None for action in actions):
            raise ArgumentError(f"--{option}: only with {' and '.join(f'--{action}' for action in actions)}")
    if args.runs is not None and args.units is not None:
        raise ArgumentError("--units: only with --fit and --servo; for runs set feed_unit in the file of runs")


def _runs(args: argparse.Namespace, machine: Machine) -> int:
    from shapegcode.timing.calibration.calibrate import calibrate_cycle_time
    from shapegcode.timing.calibration.runs_file import load_runs

    file = load_runs(args.runs)
    read = [str(path) for entry in file.entries for path in (entry.program, *entry.logs)]
    runner.check_files(args, also_read=read)
    with runner.progress(f"calibrating with {args.runs}", args) as bar:
        found = calibrate_cycle_time(file, machine, families=args.look_ahead, on_progress=bar.update)
    return runner.finish(
        found, args, output=_machine_file(args, found), notes=[f"not determined: {each}" for each in found.undetermined]
    )


def _servo(args: argparse.Namespace, machine: Machine) -> int:
    from shapegcode.identification.servo.fit import fit_servo

    with runner.progress(f"fitting {args.servo}", args) as bar:
        found = fit_servo(
            args.servo, machine, axes=args.axes, units=args.units, drive=args.drive, on_progress=bar.update
        )
    return runner.finish(found, args, output=_machine_file(args, found))


def _write(args: argparse.Namespace, machine: Machine) -> int:
    from shapegcode.characterization.programs import write_characterization_tests

    for option, value in (("-o", args.output), ("--units", args.units)):
        if value is not None:
            raise ArgumentError(f"{option} {value}: only with --fit, not with --write")
    tests = write_characterization_tests(args.write, machine, args.box)
    return runner.finish(tests, args, wrote=[args.write])


def _fit(args: argparse.Namespace, machine: Machine) -> int:
    from shapegcode.characterization.characterize import characterize

    with runner.progress(f"fitting {args.fit}", args) as bar:
        found = characterize(args.fit, machine, units=args.units, on_progress=bar.update)
    runner.check_files(args, also_read=found.files)
    return runner.finish(found, args, output=_machine_file(args, found))


def _machine_file(args: argparse.Namespace, found: Any) -> tuple[str, bytes] | None:
    """The machine file of ``-o``, with the measured values."""
    return None if args.output is None else (args.output, found.to_toml().encode())


CHARACTERIZE = Interface(
    "Writes short test programs (air moves inside a given box) with instructions, then fits the machine file to "
    "their stopwatch times or servo logs: interpolation period, block time, time constants, in-position waits. "
    "--servo takes any log of commands and actual positions: dead time, position gain, feed-forward, friction. "
    "--runs calibrates the cycle-time model (look-ahead, tool changes, M codes, spindle) with programs and their "
    "logs. Exit code 0: done; 1: results contradict each other, no axis of the log gives a model, or a predicted "
    "time is wrong by more than 2 %; 2: bad input.",
    (
        OneOf("what to do", (
            ("--write", "DIR", None, "write the test programs, RESULTS.toml to fill in, and README.txt"),
            ("--fit", "RESULTS", None, "fit to a filled-in RESULTS.toml, to a folder with it and logs, or to one log"),
            ("--servo", "LOG", None,
             "fit the position loops to a log, and test the fit to either half on the other; the log: a capture of a "
             "Sinumerik control (JSON, gzip, zip), or a CSV with columns of commands and actual positions"),
            ("--runs", "RUNS.toml", None,
             "calibrate the cycle-time model from programs and the logs of their runs (SHDR text, MTConnect streams, "
             "Sinumerik Edge, CSV), listed in pairs in this file"),
        ), required=True),
        *MACHINE,
        ("--look-ahead", "KIND", [None],
         'with --runs: kind of look-ahead to try, for example "speed difference"; may be repeated (default: '
         "all; the one that predicts left-out runs best is chosen)"),
        ("-o --output", "FILE", None, "with --fit, --servo, --runs: machine file to write, with the measured values"),
        ("--axes", "X=1,Y=6,Z=2", None, "with --servo: axes of the log used as X, Y, Z (default: by their names)"),
        ("--drive", None, bool, "with --servo: also fit a drive with friction; takes some 20 s per axis"),
        plots("with --servo, --runs: write the pictures (PNG and SVG) into this folder"),
        ("--units", "TIME,LENGTH", None,
         "with --fit, --servo: units of CSV logs, for example ms,um (default: from their headers)"),
        ("--box", "X0:X1,Y0:Y1,Z0:Z1", None,
         "range of the test moves, in mm from their start point (default: %(default)s); write "
         "--box=-50:0,... if it begins with a minus sign", "0:100,0:100,0:20"),
        *RESULT,
    ),
    _characterize,
)  # fmt: skip


def _write_cut(args: argparse.Namespace) -> int:
    from shapegcode.cutting.tool import Tool
    from shapegcode.testcut import design as cuts

    feed = args.feeds[0] if args.action == "taper" else args.feed
    conditions = cuts.CutConditions(
        load_machine(args, writes_program=True), Tool.load(args.tool), feed, args.axial_depth, args.spindle, args.up
    )
    if args.action == "taper":
        design = cuts.taper_cut(conditions, args.feeds if len(args.feeds) > 1 else None, args.radial_depth, args.length)
    else:
        shape = cuts.CornerShape(args.allowance, args.rough_radius, args.finish_radius)
        if args.action == "corner":
            design = cuts.corner_cut(conditions, shape, args.interval)
        else:
            design = cuts.interval_cut(conditions, shape, args.intervals, args.feeds)
    runner.check_files(args, also_written=[Path(args.output).with_suffix(".json")])
    design = cuts.write_test_cut(design, args.output, args.program)
    return runner.finish(design, args, wrote=design.files)


def _fit_cut(args: argparse.Namespace) -> int:
    from shapegcode.testcut.cut import read_test_cut
    from shapegcode.testcut.fit import fit_test_cut
    from shapegcode.testcut.result import TaperResult

    cut = read_test_cut(args.cut)
    if args.output is not None:
        if cut.kind != "taper":
            raise ArgumentError(f"{args.cut} describes a {cut.kind}: -o only with a taper")
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
    """The files by the number of their pass: from ``2=FILE``, else by their order."""
    found: dict[int, str] = {}
    for place, text in enumerate(texts, start=1):
        head, sign, rest = text.partition("=")
        number, file = (int(head), rest) if sign and head.isdigit() else (place, text)
        if number in found:
            raise ArgumentError(f"{text}: pass {number} is given twice: number the passes, for example 2={file}")
        found[number] = file
    return found


def _refuse_whole_tool_file(name: str) -> None:
    """Refuse to write the table [cutting] over a file with other tables."""
    try:
        more = sorted(set(toml_tables(read_file(name, MAX_SETTINGS_BYTES).decode())) - {"cutting"})
    except (OSError, ValueError):  # missing, or not a tool file
        return
    if more:
        raise ArgumentError(
            f"-o {name}: contains more than [cutting] ({', '.join(more)}), which would be lost: give another file and "
            "copy its table into this one"
        )


def _list(text: str) -> tuple[float, ...]:
    """Numbers above 0, separated by commas."""
    return tuple(positive(part.strip()) for part in text.split(","))


def _pair(text: str) -> tuple[float, float]:
    low, sign, high = text.partition(":")
    pair = (positive(low), positive(high)) if sign else (math.nan, math.nan)
    if not pair[0] < pair[1]:
        raise argparse.ArgumentTypeError(f"{text!r}: must be two lengths in mm, ascending, for example 0.4:2.8")
    return pair


_CUT = (
    *MACHINE,
    ("--tool", "T.toml", None, "tool file", NEEDED),
    ("-o --output", "OUT.NC", None, "program to write; next to it OUT.json, which describes the cut", NEEDED),
    ("-S --spindle", "REV", positive, "rev/min (default: feed.spindle_rev_per_min of the tool file)"),
    ("-a --axial-depth", "MM", positive, "axial depth", NEEDED),
    ("--program", "O1234", program_number, "number of the program (default: O7101)", 7101),
)
_END = (("--up", None, bool, "up milling, material on the left (default: down milling)"), *RESULT)
_SHAPE = (
    ("-F --feed", "F", positive, "feed in mm/min", NEEDED),
    ("--allowance", "MM", positive, "radial depth on the walls (default: 0.1 D)"),
    ("--rough-radius", "MM", positive, "radius of the rough corner (default: D)"),
    ("--finish-radius", "MM", positive, "radius of the finished corner (default: D)"),
)
_TAPER = (
    ("-F --feeds", "F,F,...", _list, "feeds in mm/min; a single one is used at half, full and double value", NEEDED),
    ("--radial-depth", "MM:MM", _pair, "radial depth at start and end of the stock (default: 0.05 to 0.35 D)"),
    ("--length", "MM", positive, "length of the stock along X (default: %(default)s)", 60.0),
)
_CORNER = (("--interval", "MM", positive, "length of a block (default: feed_control.interval_mm)", None),)
_INTERVAL = (
    ("--intervals", "MM,MM,...", _list, "lengths of the blocks, one pass each (default: 0.2,0.4,0.6)", (0.2, 0.4, 0.6)),
    ("--feeds", "F,F,...", _list, "feeds of the blocks, the same for every pass (default: those of `corner`)"),
)
_FIT = (
    ("files", "CSV", {"nargs": "+"},
     "record of a pass: columns time_s, position_mm or radial_depth_mm, and fx_n, fy_n; 2=FILE: that of pass 2"),
    ("--cut", "OUT.json", None, "description of the test cut, written with its program", NEEDED),
    ("--forces-on", None, ("workpiece", "tool"),
     "body on which the measured forces act; under the workpiece a dynamometer measures those on it (default: "
     "%(default)s)",
     "workpiece"),
    ("--chip-thickness", None, ("mean", "local"),
     "taper: chip thickness used in the power laws (default: %(default)s)", "mean"),
    ("--edge-forces", None, bool, "taper: fit the edge force coefficients K_te and K_re too"),
    ("-o --output", "FILE", None, "taper: write the table [cutting] (TOML)"),
    plots("write pictures (PNG and SVG) of measured and expected forces into this folder"),
    *RESULT,
)  # fmt: skip

TESTCUT = Interface(
    "Writes test cuts (Kim and Ko 2001, paper 001) as programs with instructions in comments at the start, and next to "
    "each a JSON file that describes the cut; `fit` reads that file and the measured forces. Exit code 0: done; 1: the "
    "fit is poor, or the result not as expected; 2: bad input.",
    actions={
        "taper": (
            "increasing radial depth: for the coefficients of the cutting force (figure 4)",
            Interface(
                "Mills a tapered edge, then cuts along it in passes, each at one feed, to fit k1 and k2 of the force.",
                (*_CUT, *_TAPER, *_END), _write_cut,
            ),
        ),
        "corner": (
            "the radial depths of a corner along a straight edge: at constant, then at modified feed (figure 7)",
            Interface(
                "Mills an edge on which a straight pass has the radial depths of a corner, and cuts it at "
                "constant feed, then at that of equation 7 (paper 001).", (*_CUT, *_SHAPE, *_CORNER, *_END), _write_cut,
            ),
        ),
        "interval": (
            "feeds that change every 0.2, 0.4 and 0.6 mm: shortest interval that the control follows (figure 8)",
            Interface(
                "Cuts passes of constant radial depth; the feed changes as in a corner, each time at another interval.",
                (*_CUT, *_SHAPE, *_INTERVAL, *_END), _write_cut,
            ),
        ),
        "fit": (
            "evaluate the measured forces of a test cut",
            Interface(
                "Reads the JSON file of a test cut and the records of its passes, in their order. Gives, for a taper, "
                "the coefficients with 95 % intervals; for a corner, measured and expected resultant; for an interval "
                "test, the shortest interval that the control follows. Exit code 0: done; 1: the fit is poor, or the "
                "result not as expected; 2: bad input.", _FIT, _fit_cut,
            ),
        ),
    },
)  # fmt: skip
