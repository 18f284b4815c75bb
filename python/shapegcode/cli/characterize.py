"""``shapegcode characterize``: measure what a controller does with blocks, and put it into the machine file."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from shapegcode.cli import runner
from shapegcode.cli.arguments import add_options, one_of
from shapegcode.cli.options import add_machine_argument, add_plots_argument, add_result_arguments, load_machine

if TYPE_CHECKING:
    from shapegcode.machine import Machine


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Writes short test programs (air moves inside a stated box) with instructions, then fits the machine file to "
        "stopwatch times or servo logs of them: interpolation period, block time, time constants, in-position times. "
        "--servo takes any log of commands and actual positions: dead time, position gain, feed-forward, friction. "
        "--runs learns the clock (look-ahead, tool changes, M codes, spindle) from programs and the logs of their "
        "runs. Exit code 1 if results contradict each other, no axis tells its loop, or a run is not told within 2 %%."
    )
    action = one_of(parser, "what to do", required=True)
    add_options(action, (
        ("--write", "DIR", None, "write the test programs, RESULTS.toml to fill in, and README.txt"),
        ("--fit", "RESULTS", None, "fit a filled-in RESULTS.toml, a folder with it and logs, or one log beside it"),
        ("--servo", "LOG", None,
         "fit the position loops to one half of a log and validate them with the "
         "other: a capture of a Sinumerik control "
         "(JSON, gzip, zip), or a CSV with columns of commands and actual positions"),
        ("--runs", "RUNS.toml", None,
         "calibrate the cycle-time model from programs and the logs of their runs (SHDR text, MTConnect streams, "
         "Sinumerik Edge, CSV), which this file pairs"),
    ))  # fmt: skip
    add_machine_argument(parser)
    add_options(parser, (
        ("--look-ahead", "KIND", [None],
         'with --runs: kind of look-ahead that is tried, for example "speed difference"; may be repeated (default: '
         "all; the one that predicts left-out runs best is chosen)"),
        ("-o --output", "FILE", None, "with --fit, --servo, --runs: machine file to write, with what is known"),
        ("--axes", "X=1,Y=6,Z=2", None, "with --servo: axes of the log that are X, Y, Z (default: by their names)"),
        ("--drive", None, bool, "with --servo: fit a drive with friction too, some ten seconds for each axis"),
    ))  # fmt: skip
    add_plots_argument(parser, "with --servo, --runs: write the pictures (PNG and SVG) into this folder")
    add_options(parser, (
        ("--units", "TIME,LENGTH", None,
         "with --fit, --servo: of CSV logs, for example ms,um (default: from their headers)"),
        ("--box", "X0:X1,Y0:Y1,Z0:Z1", None,
         "where the tests may move, in mm from the point at which they are started (default: %(default)s); write "
         "--box=-50:0,... if it begins with a minus sign", "0:100,0:100,0:20"),
    ))  # fmt: skip
    add_result_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Write the tests or fit their results; see the module."""
    _check_options(args)
    machine = load_machine(args, writes_program=args.write is not None)
    runner.check_files(args, also_read=[each for each in (args.servo, args.runs) if each is not None])
    if args.servo is not None:
        return _servo(args, machine)
    if args.runs is not None:
        return _runs(args, machine)
    return _write(args, machine) if args.write is not None else _fit(args, machine)


def _check_options(args: argparse.Namespace) -> None:
    """Refuse options that do not go with what is asked for."""
    from shapegcode.errors import ArgumentError

    for option, value in (("--axes", args.axes), ("--drive", args.drive or None)):
        if value is not None and args.servo is None:
            raise ArgumentError(f"{option}: goes with --servo alone")
    if args.plots is not None and args.servo is None and args.runs is None:
        raise ArgumentError("--plots: goes with --servo and --runs")
    if args.look_ahead is not None and args.runs is None:
        raise ArgumentError("--look-ahead: goes with --runs alone")
    if args.runs is not None and args.units is not None:
        raise ArgumentError("--units: goes with --fit and --servo; of runs the file of runs states feed_unit")


def _runs(args: argparse.Namespace, machine: Machine) -> int:
    from shapegcode.timing.calibration.calibrate import calibrate_cycle_time
    from shapegcode.timing.calibration.runs_file import load_runs

    file = load_runs(args.runs)
    read = [str(path) for entry in file.entries for path in (entry.program, *entry.logs)]
    runner.check_files(args, also_read=read)
    with runner.progress(f"learning from {args.runs}", args) as bar:
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
    from shapegcode.errors import ArgumentError

    for option, value in (("-o", args.output), ("--units", args.units)):
        if value is not None:
            raise ArgumentError(f"{option} {value}: goes with --fit, not with --write")
    tests = write_characterization_tests(args.write, machine, args.box)
    return runner.finish(tests, args, wrote=[args.write])


def _fit(args: argparse.Namespace, machine: Machine) -> int:
    from shapegcode.characterization.characterize import characterize

    with runner.progress(f"fitting {args.fit}", args) as bar:
        found = characterize(args.fit, machine, units=args.units, on_progress=bar.update)
    runner.check_files(args, also_read=found.files)
    return runner.finish(found, args, output=_machine_file(args, found))


def _machine_file(args: argparse.Namespace, found: Any) -> tuple[str, bytes] | None:
    """The machine file of ``-o``, with what is known."""
    return None if args.output is None else (args.output, found.to_toml().encode())
