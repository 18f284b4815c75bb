"""``shapegcode identify``: vibration modes from a tap test or a decay, and into the machine file with them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode.cli.console import add_json_argument
from shapegcode.cli.options import (
    add_machine_argument,
    add_plots_argument,
    count,
    frequency_band,
    load_machine,
    nonzero,
    refuse_same_file,
    seconds,
    start_time,
)

if TYPE_CHECKING:
    from shapegcode.io.read import ReadOptions

__all__ = ["add_arguments", "run"]

_MOST_MODES = 8  # as identify.MOST_MODES, which would have to be imported with all that is slow


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Finds vibration modes in hammer taps (frequency, damping, equivalent mass, damping and stiffness) or in the "
        "decay after a rapid stop (frequency and damping), each with its 95 % interval, and refuses what the data do "
        "not support. Exit code 0: all that stands out is supported; 1: some of it is not; 2: nothing is, or bad input."
    )
    parser.epilog = "example: shapegcode identify tap1.csv tap2.csv tap3.csv --axis x --update mine.toml --plots plots"
    add = parser.add_argument
    add("files", metavar="FILE", nargs="*", help="CSV, UFF (dataset 58) or WAV; several taps of one point together")
    add(
        "--axis",
        choices=("x", "y", "z"),
        default=None,
        help="use the response along this axis; where the file names none, it is this one",
    )
    add("--update", metavar="MACHINE.toml", default=None, help="put the supported modes into this machine file")
    add("--tap-plan", action="store_true", help="say how to do the test (for the modes of -m MACHINE) only")
    add_machine_argument(parser, required=False)
    add("--modes", metavar="N", type=count, default=None, help="number of modes (default: chosen by evidence)")
    add(
        "--most-modes",
        metavar="N",
        type=count,
        default=_MOST_MODES,
        help="largest number of modes that is tried (default: %(default)s)",
    )
    add(
        "--frequencies",
        metavar="LOW:HIGH",
        type=frequency_band,
        default=None,
        help="look for modes between these, Hz",
    )
    add(
        "--decay",
        "--ignore-force",
        dest="decay",
        action="store_true",
        help="take it as a free decay: do not use the force, even if there is one",
    )
    add(
        "--start",
        metavar="TIME",
        type=start_time,
        default=None,
        help="where the decay begins in the file, for example 250ms (default: found by itself)",
    )
    _add_file_arguments(parser)
    add_plots_argument(parser, "write pictures (PNG and SVG) of records, fit and stabilisation into this folder")
    add_json_argument(parser)


def _add_file_arguments(parser: argparse.ArgumentParser) -> None:
    """What the user says of a file, over what it says itself."""
    group = parser.add_argument_group("what a file does not say")
    add = group.add_argument
    add("--time-column", metavar="NAME", default=None, help="header or number (from 1) of the time")
    add("--force-column", metavar="NAME", default=None, help="of the force")
    add("--response-column", metavar="NAME", action="append", default=[], help="of a response; may be repeated")
    add("--time-unit", metavar="UNIT", default=None, help="s, ms or us")
    add("--force-unit", metavar="UNIT", default=None, help="N, kN, kgf or lbf")
    add("--response-unit", metavar="UNIT", default=None, help="for example m/s^2, g, mm/s or um")
    add(
        "--sample-period",
        metavar="TIME",
        type=seconds,
        default=None,
        help="time between two samples, for example 0.1ms",
    )
    quantities = ("acceleration", "velocity", "displacement")
    add("--quantity", choices=quantities, default=None, help="what the sensor measured")
    add("--force-scale", metavar="N", type=nonzero, default=None, help="N for 1 in the file (integer WAV: full scale)")
    add(
        "--response-scale",
        metavar="X",
        type=nonzero,
        default=None,
        help="m/s^2, m/s or m for 1 in the file (integer WAV: full scale)",
    )
    add("--response-first", action="store_true", help="in a WAV file the response is the first channel, not the force")


def run(args: argparse.Namespace) -> int:
    """Identify modes; see the module.

    Raises:
        ArgumentError, MachineError: bad input.
        OSError: a file cannot be read or written.
    """
    from shapegcode.cli import runner
    from shapegcode.errors import ArgumentError

    if args.tap_plan and args.files:
        raise ArgumentError("--tap-plan says how to do the test and reads no file: leave one of both out")
    runner.check_files(args)
    if args.tap_plan:
        from shapegcode.identification.plan import tap_plan

        plan = tap_plan(load_machine(args) if args.machine is not None else None)
        return runner.finish(plan, args, notes=["", plan.instructions])
    if not args.files:
        raise ArgumentError("name the file of a tap test or decay, or ask how to do the test: identify --tap-plan")
    if args.machine is not None or args.set:
        raise ArgumentError("-m and --set go with --tap-plan; --update names the machine file that takes the modes")
    return _identify(args)


def _identify(args: argparse.Namespace) -> int:
    from shapegcode.cli import runner
    from shapegcode.identification.identify import identify
    from shapegcode.identification.update import check_updatable, update_machine
    from shapegcode.io.atomic import write_text

    if args.update is not None:
        refuse_same_file([Path(args.update)], map(Path, args.files))
        check_updatable(args.update)
    with runner.progress(f"fitting {', '.join(args.files)}", args, endless=True):
        found = identify(
            args.files,
            _read_options(args),
            most_modes=args.most_modes,
            modes=args.modes,
            band_hz=args.frequencies,
            start_s=args.start,
            strict=False,
        )
    notes, wrote = list(found.notes), []
    if args.update is not None and found.modes:
        update = update_machine(args.update, found)
        write_text(args.update, update.text)
        found = update.noted_in(found, args.update)
        notes += [f"{args.update}: {note}" for note in update.notes]
        wrote = [args.update]
    return runner.finish(found, args, notes=notes, wrote=wrote)


def _read_options(args: argparse.Namespace) -> ReadOptions:
    from shapegcode.io.read import ReadOptions

    return ReadOptions(
        axis=args.axis,
        time_column=args.time_column,
        force_column=args.force_column,
        response_columns=tuple(args.response_column),
        time_unit=args.time_unit,
        force_unit=args.force_unit,
        response_unit=args.response_unit,
        period_s=args.sample_period,
        quantity=args.quantity,
        force_scale=args.force_scale,
        response_scale=args.response_scale,
        response_first=args.response_first,
        ignore_force=args.decay,
    )
