"""``shapegcode identify``: vibration modes from a tap test or a decay, and into the machine file with them."""

from __future__ import annotations

import argparse
import math
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode.cli.console import add_json_argument
from shapegcode.cli.options import add_machine_argument, add_plots_argument, load_machine, refuse_same_file, seconds

if TYPE_CHECKING:
    from shapegcode.identification.identify import TapTest
    from shapegcode.identification.update import MachineUpdate
    from shapegcode.io.read import ReadOptions

__all__ = ["add_arguments", "run"]

_MOST_MODES = 8  # as tap_test.MOST_MODES, which would have to be imported with all that is slow

_SEEN = "no mode is supported by the data: the table says why"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Finds vibration modes in hammer taps (frequency, damping, equivalent mass, damping and stiffness) or in the "
        "decay after a rapid stop (frequency and damping), each with its 95 % interval, and refuses what the data do "
        "not support. Exit code 0: all that stands out is supported; 1: some of it is not; 2: nothing is, or bad input."
    )
    parser.epilog = "example: shapegcode identify tap1.csv tap2.csv tap3.csv --axis x --update mine.toml --plots plots"
    parser.add_argument(
        "files", metavar="FILE", nargs="*", help="CSV, UFF (dataset 58) or WAV; several taps of the same point together"
    )
    parser.add_argument(
        "--axis",
        choices=("x", "y", "z"),
        default=None,
        help="use the response along this axis; where the file names none, it is this one",
    )
    parser.add_argument(
        "--update", metavar="MACHINE.toml", default=None, help="put the supported modes into this machine file"
    )
    parser.add_argument(
        "--tap-plan", action="store_true", help="say how to do the test (for the modes of -m MACHINE), and nothing else"
    )
    add_machine_argument(parser, required=False)
    parser.add_argument(
        "--modes", metavar="N", type=_count, default=None, help="number of modes (default: chosen by evidence)"
    )
    parser.add_argument(
        "--most-modes",
        metavar="N",
        type=_count,
        default=_MOST_MODES,
        help="largest number of modes that is tried (default: %(default)s)",
    )
    parser.add_argument(
        "--frequencies",
        metavar="LOW:HIGH",
        type=_band,
        default=None,
        help="look for modes between these frequencies, Hz",
    )
    parser.add_argument(
        "--decay",
        "--ignore-force",
        dest="decay",
        action="store_true",
        help="take it as a free decay: do not use the force, even if there is one",
    )
    parser.add_argument(
        "--start",
        metavar="TIME",
        type=_start,
        default=None,
        help="where the decay begins in the file, for example 250ms (default: found by itself)",
    )
    _add_file_arguments(parser)
    add_plots_argument(parser, "write pictures (PNG and SVG) of records, fit and stabilisation into this folder")
    add_json_argument(parser)


def _add_file_arguments(parser: argparse.ArgumentParser) -> None:
    """What the user says of a file, over what it says itself."""
    group = parser.add_argument_group("what a file does not say")
    group.add_argument("--time-column", metavar="NAME", default=None, help="header or number (from 1) of the time")
    group.add_argument("--force-column", metavar="NAME", default=None, help="of the force")
    group.add_argument(
        "--response-column", metavar="NAME", action="append", default=[], help="of a response; may be repeated"
    )
    group.add_argument("--time-unit", metavar="UNIT", default=None, help="s, ms or us")
    group.add_argument("--force-unit", metavar="UNIT", default=None, help="N, kN, kgf or lbf")
    group.add_argument("--response-unit", metavar="UNIT", default=None, help="for example m/s^2, g, mm/s or um")
    group.add_argument(
        "--sample-period",
        metavar="TIME",
        type=seconds,
        default=None,
        help="time between two samples, for example 0.1ms",
    )
    group.add_argument(
        "--quantity",
        choices=("acceleration", "velocity", "displacement"),
        default=None,
        help="what the sensor measured",
    )
    group.add_argument(
        "--force-scale", metavar="N", type=_scale, default=None, help="N for 1 in the file (integer WAV: full scale)"
    )
    group.add_argument(
        "--response-scale",
        metavar="X",
        type=_scale,
        default=None,
        help="m/s^2, m/s or m for 1 in the file (integer WAV: full scale)",
    )
    group.add_argument(
        "--response-first", action="store_true", help="in a WAV file the response is the first channel, not the force"
    )


def run(args: argparse.Namespace) -> int:
    """Identify modes; see the module.

    Raises:
        ArgumentError, MachineError: bad input.
        OSError: a file cannot be read or written.
    """
    from shapegcode._core import ArgumentError

    if args.tap_plan:
        return _plan(args)
    if not args.files:
        raise ArgumentError("name the file of a tap test or decay, or ask how to do the test: identify --tap-plan")
    if args.machine is not None or args.set:
        raise ArgumentError("-m and --set go with --tap-plan; --update names the machine file that takes the modes")
    return _identify(args)


def _plan(args: argparse.Namespace) -> int:
    from shapegcode._core import ArgumentError
    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, write_json
    from shapegcode.identification.plan import tap_plan

    if args.files:
        raise ArgumentError("--tap-plan says how to do the test and reads no file: leave one of both out")
    plan = tap_plan(load_machine(args) if args.machine is not None else None)
    if args.json is not None:
        write_json({"plan": plan}, args.json)
    output_console(args.json).print(plan, markup=False, soft_wrap=True)
    return ExitCode.OK


def _identify(args: argparse.Namespace) -> int:
    from shapegcode.cli import ExitCode
    from shapegcode.cli.console import output_console, progress, write_json
    from shapegcode.identification.identify import tap_test
    from shapegcode.identification.tables import print_tap_test
    from shapegcode.io.atomic import write_text

    _check_targets(args)
    with progress(_work(args.files), args.json) as bar:
        bar.wait()
        test = tap_test(
            args.files,
            _read_options(args),
            most_modes=args.most_modes,
            modes=args.modes,
            band_hz=args.frequencies,
            start_s=args.start,
        )
        if args.plots is not None and test.found is not None:
            from shapegcode.identification.plots import write_tap_pictures

            write_tap_pictures(test, args.plots)
    update = _updated(args, test)
    if update is not None:
        write_text(args.update, update.text)
    if args.json is not None:
        written = None if update is None else {"path": args.update, "axis": test.axis, "notes": list(update.notes)}
        write_json({**test.report(), "machine_file": written}, args.json)
    console = output_console(args.json)
    print_tap_test(test, console)
    if update is not None:
        for note in update.notes:
            console.print(f"{args.update}: {note}", markup=False, soft_wrap=True)
    console.print(f"next: {_next_step(args, test)}", markup=False, soft_wrap=True)
    if not test.modes:
        shown = args.json != "-" and bool(test.refused)
        reason = _SEEN if shown else test.reason.replace("\n", "\nshapegcode: ")
        print(f"shapegcode: {reason}", file=sys.stderr)
        return ExitCode.BAD_INPUT
    return ExitCode.OUT_OF_TOLERANCE if test.refused else ExitCode.OK


def _work(files: list[str]) -> str:
    return f"fitting {files[0]}" if len(files) == 1 else f"fitting {len(files)} files"


def _check_targets(args: argparse.Namespace) -> None:
    """Refuse what would fail after the work.

    Raises:
        ArgumentError: a file that is read would be written over, or a built-in machine be updated.
        MachineError: the machine file to update is bad.
        OSError: it cannot be read.
    """
    read = [Path(file) for file in args.files]
    if args.update is not None:
        from shapegcode.identification.update import check_updatable

        check_updatable(args.update)
        refuse_same_file([Path(args.update)], read)
    if args.json not in (None, "-"):
        refuse_same_file([Path(args.json)], [*read, *([Path(args.update)] if args.update else [])])


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


def _updated(args: argparse.Namespace, test: TapTest) -> MachineUpdate | None:
    """The machine file with the modes in it; None where it stays as it is."""
    if args.update is None or not test.modes:
        return None
    from shapegcode._core import ArgumentError
    from shapegcode.identification.update import update_machine_file

    if test.axis is None:
        raise ArgumentError(f"{args.files[0]} does not say along which axis it was measured: add --axis x, y or z")
    return update_machine_file(args.update, test.axis, test.modes, source=test.source, refused=test.refused)


def _next_step(args: argparse.Namespace, test: TapTest) -> str:
    if not test.modes:
        return "shapegcode identify --tap-plan says how to do the test"
    if test.refused:
        return "tap again, longer or more often, for what is not supported (shapegcode identify --tap-plan)"
    if args.update is not None:
        return f"shapegcode shaper -m {args.update}"
    axis = "" if test.axis is not None and args.axis is None else f" --axis {test.axis or 'x'}"
    return f"shapegcode identify {' '.join(args.files)}{axis} --update mine.toml"


def _count(text: str) -> int:
    if not re.fullmatch(r"[1-9]\d?", text):
        raise argparse.ArgumentTypeError(f"{text!r}: must be a whole number from 1 to 99")
    return int(text)


def _band(text: str) -> tuple[float, float]:
    """Two frequencies such as ``20:400``, ascending."""
    low, sign, high = text.partition(":")
    try:
        band = float(low), float(high)
    except ValueError:
        band = math.nan, math.nan
    if not (sign and 0.0 <= band[0] < band[1] < math.inf):
        raise argparse.ArgumentTypeError(f"{text!r}: must be two frequencies in Hz, for example 20:400")
    return band


def _start(text: str) -> float:
    """A time with its unit; 0 needs none."""
    return 0.0 if text in ("0", "0s", "0ms") else seconds(text)


def _scale(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or value == 0.0:
        raise argparse.ArgumentTypeError(f"{text!r}: must be a number other than 0")
    return value
