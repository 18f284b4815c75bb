"""``shapegcode identify``: find vibration modes from a tap test, a decay or a sweep, and update a machine file.

``shapegcode sweep``: write a program that shakes an axis, to find modes without a hammer.
"""

from __future__ import annotations

import argparse
import re
import shlex
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode.cli import arguments, options, runner
from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import write_text

if TYPE_CHECKING:
    from shapegcode.machine import Machine

# Options that override the contents of a file; each is a field of ReadOptions.
_OF_FILES = (
    ("--time-column", "NAME", None, "header or number (from 1) of the time column"),
    ("--force-column", "NAME", None, "header or number of the force column"),
    ("--response-column", "NAME", {"dest": "response_columns", "action": "append"},
     "header or number of a response column; may be repeated"),
    ("--time-unit", "UNIT", None, "s, ms or us"),
    ("--force-unit", "UNIT", None, "N, kN, kgf or lbf"),
    ("--response-unit", "UNIT", None, "for example m/s^2, g, mm/s or um"),
    ("--sample-period", "TIME", {"dest": "period_s", "type": arguments.seconds}, "time between samples, such as 0.1ms"),
    ("--quantity", None, ("acceleration", "velocity", "displacement"), "measured quantity of the sensor"),
    ("--force-scale", "N", arguments.nonzero, "newtons per unit in the file (integer WAV: newtons at full scale)"),
    ("--response-scale", "X", arguments.nonzero, "m/s^2, m/s or m per unit in the file (integer WAV: at full scale)"),
    ("--force-sensitivity", "mV/N", None, "sensitivity of the hammer if the force is in volts: 2.25mV/N"),
    ("--response-sensitivity", "mV/g", None, "sensitivity of the sensor if the response is in volts: 100mV/g"),
    ("--exponential-window", "TIME", {"dest": "exponential_window_s", "type": arguments.seconds},
     "time constant of an exponential window that the analyser applied to the response, such as 50ms"),
    ("--response-first", None, bool, "in a WAV file the response is the first channel, not the force"),
)  # fmt: skip
_OPTION = re.compile("--?[A-Za-z]")  # not a negative number
_DETERMINING = {
    "--across", "--modes", "--max-modes", "--most-modes", "--frequencies", "--decay", "--ignore-force", "--stops",
    "--start", *(name for names, *_ in _OF_FILES for name in names.split()),
}  # fmt: skip


def _identify(args: argparse.Namespace) -> int:
    if args.tap_plan and args.files:
        raise ArgumentError("--tap-plan prints instructions and reads no file: omit one of the two")
    runner.check_files(args, also_read=[*(args.across or ()), *([] if args.sweep is None else [args.sweep])])
    if args.tap_plan:
        from shapegcode.identification.plan import tap_plan

        plan = tap_plan(options.load_machine(args) if args.machine is not None else None)
        return runner.finish(plan, args, notes=["", plan.instructions])
    if not args.files:
        raise ArgumentError("give the file of a tap test or decay; instructions for the test: identify --tap-plan")
    if args.sweep is None and (args.machine is not None or args.set):
        raise ArgumentError("-m and --set belong to --tap-plan and --sweep; --update gives the machine file to update")
    if args.sweep is not None and args.machine is None:
        raise ArgumentError("--sweep needs -m, the machine file of the control that ran the program")
    return _fit(args)


def _fit(args: argparse.Namespace) -> int:
    from shapegcode.identification.identify import identify
    from shapegcode.identification.update import check_updatable, update_machine
    from shapegcode.io.record import ReadOptions

    if args.update is not None:
        options.refuse_same_file([Path(args.update)], map(Path, args.files))
        machine = check_updatable(args.update)
        if args.axis is not None and args.sweep is None:
            _decide(args, machine, args.axis)
    shaken = {} if args.sweep is None else {"sweep": args.sweep, "machine": options.load_machine(args)}
    said = {field.name: getattr(args, field.name) for field in fields(ReadOptions)}
    said["response_columns"] = tuple(args.response_columns or ())
    with runner.progress(f"fitting {', '.join(args.files)}", args):
        found = identify(
            args.files, ReadOptions(**said), max_modes=args.max_modes, modes=args.modes, band_hz=args.frequencies,
            start_s=args.start, stops=args.stops, across=args.across or args.across is not None, strict=False, **shaken,
        )  # fmt: skip
    found = replace(found, options=_said_again(args))
    notes, wrote = list(found.notes), []
    if args.update is not None and found.modes and found.doubt and not args.force:
        notes.append(f"{args.update}: not changed: {found.doubt} (--force writes it nevertheless)")
    elif args.update is not None and found.modes:
        if args.axis is None or args.sweep is not None:
            _decide(args, machine, found.axis)
        update = update_machine(args.update, found, keep_modes=args.keep_modes, rigid=args.rigid)
        write_text(args.update, update.text)
        found, wrote = update.noted_in(found, args.update), [args.update]
        notes += [f"{args.update}: {note}" for note in update.notes]
    return runner.finish(found, args, notes=notes, wrote=wrote)


def _said_again(args: argparse.Namespace) -> tuple[str, ...]:
    """Options that determine which modes are found, as typed: the command of the next step repeats them."""
    said, repeats = [], False
    for word in args.typed[1:]:
        if _OPTION.match(word):
            name = word.partition("=")[0]  # or an abbreviation
            repeats = name != "--force" and any(each.startswith(name) for each in _DETERMINING)
        if repeats and word not in args.files:
            said.append(shlex.quote(word))
    return tuple(said)


def _decide(args: argparse.Namespace, machine: Machine, axis: str | None) -> None:
    """Ask what to do with modes of the other axes that were not measured on this machine."""
    from shapegcode.identification.update import open_modes, require_decisions

    found = open_modes(machine, axis)
    args.keep_modes, args.rigid = options.decided_modes(args, found, f"{args.update}: not measured on this machine:")
    require_decisions(found, args.keep_modes, args.rigid, args.update)


IDENTIFY = arguments.Interface(
    "Finds vibration modes from impact tests or frequency responses (natural frequency, damping ratio; equivalent "
    "mass, damping and stiffness), from the decay after a rapid stop, or from a record made during a sweep "
    "(frequency and damping ratio), each with its 95 % interval. A mode that the data do not support is refused. "
    "Exit code 0: all modes above the noise are supported; 1: not all, or doubtful; 2: none, or bad input.",
    (
        ("files", "FILE", {"nargs": "*"},
         "CSV, UFF (dataset 58), WAV, .frf, .mat, SINUMERIK tuning (XML), capture of command and encoder; several "
          "files of the same point are fitted together"),
        ("--sweep", "PROGRAM", None, "program (of shapegcode sweep) that the control of -m ran during the record"),
        ("--axis", None, ("x", "y", "z"),
         "use the response along this axis; if the file names no axis, its response is assumed to be along this one"),
        ("--across", "FILE", {"nargs": "*"},
         "also find the mode shape along the other axes, for a tool that rocks: from a triaxial sensor, or from these "
          "files of impacts at the same point with the sensor turned"),
        ("--update", "MACHINE.toml", None, "write the supported modes to this machine file"),
        *options.MODES,
        ("--tap-plan", None, bool, "print instructions for the test (for the modes of -m MACHINE), and exit"),
        *options.MACHINE_OR_NONE,
        ("--modes", "N", arguments.count, "number of modes (default: by information criterion)"),
        ("--max-modes --most-modes", "N", {"dest": "max_modes", "type": arguments.count},
         "largest number of modes (default: frequency fit 40, time fit 8); Klipper's sweep: 4"),
        ("--force", None, bool, "write modes with --update even if the verdict is 'do not use'"),
        ("--frequencies", "LOW:HIGH", arguments.frequency_band, "find modes only between these frequencies, Hz"),
        ("--decay --ignore-force", None, {"dest": "ignore_force", "action": "store_true"},
         "treat the record as a free decay: ignore a force channel"),
        ("--stops", None, bool,
         "record of an ordinary program: use the 20 strongest of its stops that are followed by rest"),
        ("--start", "TIME", arguments.start_time,
         "start of the decay in the file, for example 250ms (default: found automatically)"),
        *_OF_FILES,
        options.plots("write pictures (PNG and SVG) of records, fit and stabilisation into this folder"),
        *options.RESULT,
    ),
    _identify,
)  # fmt: skip


def _sweep(args: argparse.Namespace) -> int:
    from shapegcode.identification.sweep_program import plan_sweep

    machine = options.load_machine(args, writes_program=True)
    runner.check_files(args)
    with runner.progress("planning the moves", args):
        found, text = plan_sweep(
            args.output, machine, args.axis, band_hz=args.frequencies, travel_mm=args.travel,
            acceleration_share=args.acceleration, seconds=args.seconds, number=args.program,
        )  # fmt: skip
    return runner.finish(found, args, output=(args.output, text.encode("ascii")))


SWEEP = arguments.Interface(
    "Writes a program that shakes one axis: moves back and forth whose frequency rises and falls, band by band, "
    "with pauses. Reports the band that the control can reach and, by simulation of the written program, the "
    "acceleration in each part. Record the acceleration with any logger while it runs; `identify --sweep` finds the "
    "modes. Exit code 0; 2: bad input, or a band that the control does not reach.",
    (
        *options.MACHINE,
        ("--axis", None, ("x", "y", "z"), "axis to shake (default: %(default)s)", "x"),
        ("--frequencies", "LOW:HIGH", arguments.frequency_band,
         "frequency range of the moves, Hz (default: from 8 Hz up to what the control reaches, at most 200 Hz)"),
        ("--travel", "MM", arguments.positive,
         "longest move, in the positive direction from the start point (default: 5)", 5.0),
        ("--acceleration", "RATIO", arguments.ratio,
         "acceleration amplitude relative to the axis' maximum; a drive tolerates about 30%% over a whole sweep "
         "(default: 30%%)", 0.3),
        ("--seconds", "S", arguments.positive, "approximate duration of all moves together (default: 60)", 60.0),
        ("-o --output", "OUT.NC", None, "program", arguments.NEEDED),
        ("--program", "O1234", arguments.program_number, "number of the program (default: O7201)", 7201),
        *options.RESULT,
    ),
    _sweep,
)  # fmt: skip
