"""``shapegcode convert``: shape a program, write it, and give the verdict of the emitted program."""

from __future__ import annotations

import argparse
import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from threading import Thread
from typing import TYPE_CHECKING, Any

from shapegcode.cli import options, runner
from shapegcode.cli.arguments import NEEDED, Interface, OldName, line_ranges, positive, ratio, seconds, size
from shapegcode.cli.runner import ProgressBar
from shapegcode.errors import ArgumentError

if TYPE_CHECKING:
    from shapegcode.conversion.result import Conversion
    from shapegcode.machine import Machine
    from shapegcode.program import Program

_MMAP_THRESHOLD = -3  # M_MMAP_THRESHOLD of glibc's malloc.h
_LARGE_BYTES = 1 << 20

MACHINE_KEYS = {
    "--contour-tolerance": "tolerance.contour_um",
    "--contour": "shaping.contour",
    "--shaper": "shaping.family",
    "--per-axis": "shaping.per_axis",
    "--planner": "shaping.planner",
    "--part-mass": "shaping.part_mass_kg",
    "--shape-rapids": "shaping.rapids",
    "--max-time-increase": "price.program_time_percent",
    "--max-cut-time-increase": "price.cut_time_percent",
    "--compensation": "input.compensation",
    "--dialect": "emission.dialect",
}
"""Options that override a key of the machine file."""


def _convert(args: argparse.Namespace) -> int:
    from shapegcode.program.compensation import read_for_conversion
    from shapegcode.program.reading import alone_with

    output = options.output_file(args.output)
    machine = options.overridden(options.load_machine(args), args, MACHINE_KEYS)
    failed = output.with_name(output.name + machine.emission.failed_suffix)
    if args.feed_schedule != bool(args.tool and args.stock) or bool(args.tool) != bool(args.stock):
        raise ArgumentError("--feed-schedule, --tool and --stock belong together: give all three or none")
    if hasattr(args, "several") and machine.emission.dialect != "fanuc":
        raise ArgumentError(f"--program all writes FANUC's words alone (emission.dialect = {machine.emission.dialect})")
    runner.check_files(args, also_written=[failed])
    if sys.platform == "linux" and hasattr(libc := ctypes.CDLL(None), "mallopt"):
        libc.mallopt(_MMAP_THRESHOLD, _LARGE_BYTES)  # glibc returns large blocks of memory to the system at once
    with runner.progress(f"converting {args.input}", args) as bar:
        with _loading("shapegcode.conversion.convert"):
            program = read_for_conversion(args.input, machine, program_number=args.program)
        result = (_scheduled if args.feed_schedule else _converted)(args, program, machine, bar)
    target = output if result.is_written_as_output else failed
    notes = ["original: the program with these feeds, not yet shaped"] if args.feed_schedule else []
    if result.tolerance_curve is not None and (price := result.tolerance_curve.sentence):
        notes.append(f"tolerance against time: {price}")
    if result.proof is not None:
        notes.append(f"{'nothing else changed' if not result.proof.refused else 'CHANGED'}: {result.proof.answer}")
    if target == failed and output.exists():
        notes.append(f"{output} is from an earlier run and was not changed")
    if (tested := result.unverified_parameters_tested) and not result.parameter_sensitivity:
        notes.append(f"{tested} unverified parameters were changed one at a time: none matters for the verdict")
    needed = () if hasattr(args, "several") else program.kept_calls
    if needed:
        names = ", ".join(place.address for place in needed)
        notes.append(f"calls of {names} were kept: these programs of {args.input} are appended unchanged")
    view = result.emitted.view() if result.written is None else memoryview(result.written)
    content = alone_with(view, program.text, needed)
    tables = result.tables(every_cut=args.verbose)
    return runner.finish(result, args, tables=tables, notes=notes, output=(target, content))


def _options(args: argparse.Namespace) -> dict[str, Any]:
    """Arguments common to `convert` and `convert_scheduled`."""
    from shapegcode.conversion.budget import Budget

    limits = (args.max_bytes, args.baud, args.max_blocks_per_second)
    return {
        "arc_feed_ratio": args.arc_feed,
        "block_period_s": args.block_period,
        "budget": None if limits == (None, None, None) else Budget(*limits),
    }


@contextmanager
def _loading(module: str) -> Iterator[None]:
    """Import a module in parallel: the core reads a long program without the interpreter lock."""
    thread = Thread(target=import_module, args=(module,))
    thread.start()
    try:
        yield
    finally:
        thread.join()


def _converted(args: argparse.Namespace, program: Program, machine: Machine, bar: ProgressBar) -> Conversion:
    from shapegcode.conversion.convert import convert

    # Start and length of each stage on the bar; it does not move back when a program is shaped again.
    spans = {"shaping": (0.0, 0.4), "shaping again, slower": (0.0, 0.4), "round trip": (0.4, 0.4)}
    spans["sensitivity to unverified parameters"] = (0.8, 0.2)
    reached = 0.0

    def show(stage: str, done: float, total: int) -> None:
        nonlocal reached
        begin, share = spans[stage]
        reached = max(reached, begin + share * done / total)
        bar.update(reached)

    return convert(
        program, machine, **_options(args), only=args.only, leave=args.leave, shape_all=args.shape_all,
        tolerance_curve=args.tolerance_curve, on_progress=show,
    )  # fmt: skip


def _scheduled(args: argparse.Namespace, program: Program, machine: Machine, bar: ProgressBar) -> Conversion:
    """Schedule the feeds, then shape."""
    from shapegcode.conversion.scheduled import convert_scheduled

    return convert_scheduled(program, machine, **options.read_cutting(args), **_options(args), on_progress=bar.update)


CONVERT = Interface(
    "Rewrites the cutting moves of a program so that they no longer excite the machine's vibration modes, and "
    "simulates the emitted program for its verdict: vibration, contour error, time. The input is never "
    "overwritten; a program that must not be run is written as OUT.out-of-tolerance instead (exit code 1).",
    (
        ("input", "IN", None, "CNC program"),
        *options.MACHINE,
        ("-o --output", "OUT", None, "program to write", NEEDED),
        ("--arc-feed", "RATIO", ratio, "feed on arcs relative to the programmed feed, for example 60%%"),
        *options.override_options(MACHINE_KEYS),
        ("--shape-all", None, bool,
         "shape every cut whose time stays within --max-time-increase and --max-cut-time-increase, even if it gains "
         "less than shaping.least_gain_um, gets worse, or the program is within tolerance; by default such cuts stay "
         "unchanged"),
        ("--only", "A-B,...", line_ranges,
         "shape nothing but the cuts in these lines, numbered as by `shapegcode expand`, for example 12-80,95-240"),
        ("--leave", "A-B,...", line_ranges, "leave the cuts in these lines unchanged; numbered as for --only", ()),
        ("--tolerance-curve", None, {"action": argparse.BooleanOptionalAction},
         "compute the cycle time at other contour tolerances (default: %(default)s)", True),
        ("--block-period", "TIME", seconds,
         "duration of the shortest block, for example 5ms (default: emission.block_period_s of the machine file, else "
         "chosen for the modes)"),
        ("--max-bytes", "N[k|M]", size,
         "largest size of the emitted program, for example 256k; to keep it, cuts gaining least per byte stay "
         "unchanged"),
        ("--baud", "N", positive,
         "speed of the serial line; if it is too low, longer block periods are used; if they are not enough, cuts are "
         "left unchanged"),
        ("--max-blocks-per-second", "N", positive, "blocks per second that the control can read; acts as --baud"),
        ("--feed-schedule", None, bool,
         "first set the feeds as `shapegcode feed` does, so that the shaped program keeps the tool's limits; "
         "needs --tool and --stock"),
        *options.cutting(required=False),
        options.PROGRAM,
        options.plots(),
        *options.RESULT,
        OldName("--all", "--shape-all"),
    ),
    _convert,
)  # fmt: skip
