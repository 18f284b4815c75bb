"""Commands that read programs: simulate, feed, expand, measure, time, check, compare."""

from __future__ import annotations

import argparse
from dataclasses import replace

from shapegcode.cli import options, runner
from shapegcode.cli.arguments import NEEDED, Interface, OldName, count, line_range, micrometres, override, ratio
from shapegcode.cli.options import RESULT, load_machine
from shapegcode.io.data_file import write_lines

# Fraction of the progress bar for the cuts; the motion in time takes the rest.
_REGIONS_SHARE = 0.1


def _simulate(args: argparse.Namespace) -> int:
    from shapegcode.model.programs import shaped_note
    from shapegcode.program import Program
    from shapegcode.simulation.simulate import simulate, simulate_motion

    runner.check_files(args)
    machine = load_machine(args)
    with runner.progress(f"simulating {args.input}", args) as bar:
        program = Program.read(args.input, machine, program_number=args.program)
        shaped = True if args.shaped else None
        against = None if args.against is None else Program.read(args.against, machine, program_number=args.program)
        simulation = simulate(
            program, machine, plant=args.plant, shaped=shaped, against=against, record_samples=0,
            on_progress=lambda done, total: bar.update(_REGIONS_SHARE * done / total),
        )  # fmt: skip
        motion = simulate_motion(
            program, machine, plant=args.plant, shaped=shaped, lines=args.lines, csv=args.csv, npz=args.npz,
            every=args.every, on_progress=lambda done: bar.update(_REGIONS_SHARE + (1.0 - _REGIONS_SHARE) * done),
        )  # fmt: skip
    note = shaped_note(program)
    notes = [note] if note and shaped is None else []
    wrote = [name for name in (args.csv, args.npz) if name not in (None, "-")]
    return runner.finish(replace(simulation, motion=motion), args, notes=notes, wrote=wrote)


SIMULATE = Interface(
    "Simulates a program: the controller's model, then the machine's plant. Reports the time of the cuts, their "
    "largest residual and peak vibration, settling time, contour error of command and response. For the whole program "
    "with rapids, dwells and waits: the motion of the axes over time, as table, files and pictures.",
    (
        *options.program_input(),
        ("--shaped", None, bool,
         "simulate every cut as shaped blocks: at their feed, without look-ahead; needed only if the header of a "
         "shaped program, which marks its shaped cuts, is missing"),
        ("--against", "ORIGINAL", None,
         "measure the contour error against the path of this program, such as the original of a shaped one, and give "
         "the verdict of `convert` (default: IN's own path, no verdict)"),
        ("--plant", None, ("modal", "feed-drive"),
         "modal: ideal servo followed by vibration modes; feed-drive: motor, ball screw, table, friction and servo "
         "loops of [axes.x.drive] (default: %(default)s)", "modal"),
        ("--csv", "FILE", None, "write the motion, one line per interpolation period; - for standard output"),
        ("--npz", "FILE", None, "write the columns of --csv as a NumPy archive"),
        ("--every", "N", count, "write every N-th sample only (default: %(default)d)", 1),
        ("--lines", "A-B", line_range,
         "motion of these lines only, numbered as by `shapegcode expand`; the program is simulated from its "
         "start in any case"),
        options.plots(
            "write pictures (PNG and SVG) into this folder: the motion over time, and path, feed and vibration of the "
            "cut that vibrates most"
        ),
        *RESULT,
    ),
    _simulate,
)  # fmt: skip


def _feed(args: argparse.Namespace) -> int:
    from shapegcode.feed.schedule import schedule_feed
    from shapegcode.program.compensation import read_for_conversion

    output = options.output_file(args.output)
    machine = load_machine(args, writes_program=True)
    runner.check_files(args)
    cutting = options.read_cutting(args)
    with runner.progress(f"scheduling {args.input}", args) as bar:
        program = read_for_conversion(args.input, machine, program_number=args.program)
        schedule = schedule_feed(program, machine, **cutting, on_progress=bar.update)
    return runner.finish(schedule, args, output=(output, schedule.text))


FEED = Interface(
    "Sweeps the tool through the stock, computes the cutting force at the feed that the machine really reaches, and "
    "writes the program with the highest feeds that keep the tool's limits. Blocks are split where the load "
    "changes within them; everything else is unchanged. Exit code 0: every limit is kept; 1: written, but "
    "somewhere a limit is not kept (the report says where and why); 2: bad input.",
    (
        *options.program_input(),
        *options.cutting(required=True),
        ("-o --output", "OUT", None, "program to write", NEEDED),
        options.plots(
            "write pictures (PNG and SVG) into this folder: force, feed and engagement along the path; the path "
            "coloured by force, before and after; surface error of the wall"
        ),
        *RESULT,
    ),
    _feed,
)


def _expand(args: argparse.Namespace) -> int:
    from shapegcode.program.expand import expand

    machine = load_machine(args, writes_program=True)
    runner.check_files(args)
    with runner.progress(f"expanding {args.input}", args):
        result = expand(args.input, machine, compensation=args.compensation, program_number=args.program)
    return runner.finish(result, args, notes=result.notes, output=(args.output, result.text))


EXPAND = Interface(
    "Expands subprogram calls, custom macros, coordinate modes (G16, G51, G51.1, G68), corner words (,R ,C) and "
    "cutter compensation of a program into plain blocks that any control runs, also from DNC. Nothing is "
    "shaped. The input is never overwritten.",
    (
        *options.program_input(),
        ("-o --output", "OUT", None, "program to write; - for standard output", NEEDED),
        ("--compensation", None, ("expand", "keep"),
         "G41/G42 as plain moves of the tool centre, or unchanged (default: %(default)s)", "expand"),
        *RESULT,
    ),
    _expand,
)  # fmt: skip


def _measure(args: argparse.Namespace) -> int:
    from shapegcode.metrology.measure import measure
    from shapegcode.program import Program

    runner.check_files(args)
    machine = load_machine(args)
    with runner.progress("measuring", args) as bar:
        read = [Program.read(name, machine, program_number=args.program) for name in args.inputs]
        against = None if args.against is None else Program.read(args.against, machine, program_number=args.program)
        measurement = measure(
            read, machine, args.tool_diameter * 1e-3, plant=args.plant, against=against, lines=args.lines,
            band_um=args.settling_band, station_spacing_mm=args.station * 1e-3,
            cutoff_mm=None if args.cutoff is None else args.cutoff * 1e-3, lambda_s_mm=args.lambda_s * 1e-3,
            on_progress=lambda done, total: bar.update(done / total),
        )  # fmt: skip
    tables = measurement.tables(every_section=args.verbose)
    return runner.finish(measurement, args, tables=tables, notes=[program.how for program in measurement.programs])


MEASURE = Interface(
    "Simulates programs on the machine's model and measures the response as if it were a part. Gives for each section "
    "of the path vibration and settling time, contour error, fitted radius, walls that the tool leaves, with roughness "
    "and waviness. If the first program is an original and shapegcode wrote all others, they are measured against "
    "the original's path. Exit code 0: every response is within tolerance.contour_um of the path; "
    "1: at least one is not (if shaped programs are measured against their original, only the shaped ones count); "
    "2: bad input.",
    (
        ("inputs", "PROGRAM", {"nargs": "+"}, "CNC program; several are compared side by side"),
        *options.MACHINE,
        options.PROGRAM,
        ("--tool-diameter", "LENGTH", micrometres, "tool diameter, for example 3mm", NEEDED),
        ("--plant", None, ("modal", "feed-drive"),
         "modal: ideal servo followed by vibration modes; feed-drive: drives of [axes.x.drive] (default: %(default)s)",
         "modal"),
        ("--against", "ORIGINAL", None,
         "measure against the path of this program (default: the first one if shapegcode wrote the others, else each "
         "program's own path)"),
        ("--lines", "A-B", [line_range],
         "measure the cut of these lines, numbered as by `shapegcode expand`, as one section; may be repeated "
         "(default: every straight line and every arc)"),
        ("--settling-band", "LENGTH", micrometres, "vibration within it counts as settled (default: 1um)", 1.0),
        ("--station", "LENGTH", micrometres, "spacing of the points along a wall at which it is measured (default: "
         "0.05mm)", 50.0),
        ("--cutoff", "LENGTH", micrometres,
         "cut-off of the roughness (default: 0.8mm, less for sections shorter than 5.6 mm)"),
        ("--lambda-s", "LENGTH", micrometres, "short-wave cut-off (default: none)", 0.0),
        options.plots("write pictures of part, walls and width (PNG and SVG) into this folder"),
        *RESULT,
        OldName("--all", "--verbose"),
    ),
    _measure,
)  # fmt: skip


# A larger table of blocks is built only if it is written.
_MAX_BLOCKS_SHOWN = 100_000


def _time(args: argparse.Namespace) -> int:
    from shapegcode.model.programs import shaped_note
    from shapegcode.program import Program
    from shapegcode.timing.cycle_time import cycle_time

    machine = load_machine(args)
    runner.check_files(args, also_read=args.log_next or ())
    with runner.progress(f"timing {args.input}", args):
        program = Program.read(args.input, machine, program_number=args.program)
        wanted = args.csv is not None or args.blocks
        time = cycle_time(
            program, machine, per_block=wanted or program.core.block_count <= _MAX_BLOCKS_SHOWN,
            full=not args.no_full, feed_override=args.override, rapid_override=args.rapid_override,
            log_next=[Program.read(each, machine) for each in args.log_next or ()],
        )  # fmt: skip
    if args.csv is not None:
        write_lines(args.csv, time.csv_lines())
    events = [block for block in time.blocks if block.kind in ("tool_change", "function")]
    free = sum(block.duration_s <= 0.0 for block in events)
    notes = [f"to narrow the interval most, log {time.narrowed_by}"] if time.narrowed_by else []
    for what, key, given in (
        ("feeds", "feed_override_percent", args.override),
        ("rapids", "rapid_override_percent", args.rapid_override),
    ):
        percent = getattr(machine.times, key)
        if given is None and percent != 100.0:
            notes.append(f"{what} at {percent:g} %, the usual setting in this shop (times.{key})")
    notes += [shaped] if (shaped := shaped_note(program)) else []
    if free:
        part = f"{free} of {len(events)} " if free < len(events) else ""
        whole = "" if part else f" ({free} in the program)"
        notes.append(f"{part}tool changes and M codes count 0 s on this machine{whole}")
    return runner.finish(time if args.blocks else time.without_blocks(), args, tables=time.tables(), notes=notes)


TIME = Interface(
    "Predicts the cycle time of a program in closed form, and checks it by computing every set-point. Reports the "
    "time of cutting, rapids, in-position waits, dwells, acceleration, tool changes, each also by tool; and the "
    "slowest cuts and blocks. For a machine calibrated with run logs also the 95 % interval, and which log would "
    "narrow it. Exit code 0: both agree; 1: they differ by more than 0.5 %; 2: bad input.",
    (
        *options.program_input("PROGRAM"),
        ("--override", "RATIO", override,
         "feed override, for example 80%% (at most 254%%; default: times.feed_override_percent)"),
        ("--rapid-override", "RATIO", ratio,
         "rapid override, for example 25%% (at most 100%%; default: times.rapid_override_percent); the acceleration of "
         "rapids is unchanged"),
        ("--log-next", "PROGRAM", [None],
         "show the 95 %% interval that would remain if a run of this program were logged too; may be repeated: the "
         "program that narrows it most is listed first"),
        ("--no-full", None, bool, "closed form only, no full interpolation"),
        ("--blocks", None, bool, "write the times of every block into the JSON too"),
        ("--csv", "FILE", None, "write the times, one line per block; - for standard output"),
        options.plots("write a picture of the time components (PNG and SVG) into this folder"),
        *RESULT,
    ),
    _time,
)  # fmt: skip


def _check(args: argparse.Namespace) -> int:
    from shapegcode.checking.check import check

    machine = load_machine(args)
    runner.check_files(args)
    with runner.progress(f"checking {args.input}", args):
        result = check(args.input, machine, program_number=args.program)
    # The table contains the warnings.
    return runner.finish(result, args, warnings=())


CHECK = Interface(
    "Lists what the control would refuse, each alarm with number and position, not only the first; and what the "
    "control would not run as programmed: stops inside of cuts, blocks shorter than the block time, feeds above the "
    "limits of the axes, program memory, speed of the serial line. Exit code 0: no alarms and no warnings; 1: "
    "warnings; 2: at least one alarm.",
    (*options.program_input("PROGRAM"), *RESULT),
    _check,
)


def _compare(args: argparse.Namespace) -> int:
    from shapegcode.program.comparison import compare

    notes = [] if args.machine else ["read for the built-in machine vx500; -m MACHINE selects another one"]
    args.machine = args.machine or "vx500"
    machine = load_machine(args)
    runner.check_files(args)
    with runner.progress(f"comparing {args.input} with {args.against}", args):
        result = compare(args.input, args.against, machine, allow=args.allow)
    return runner.finish(result, args, notes=notes)


COMPARE = Interface(
    "Compares two programs by what they do: distance between the paths of each cut, order of cuts, rapids, tool calls, "
    "spindle, coolant, offsets, modal state, calls, feeds, other functions, dwells and stops. Every difference is "
    "listed with its lines. Exit code 0: --allow covers all; 1: not all; 2: bad input.",
    (
        ("input", "A", None, "first program, for example the original"),
        ("against", "B", None, "second program, such as the output of convert"),
        *options.MACHINE_OR_NONE,
        ("--allow", "WORDS", None,
         "differences that are allowed, for example feeds,blocks,path=20um,calls; an unknown word is an error that "
         "lists the known ones", ""),
        *RESULT,
    ),
    _compare,
)  # fmt: skip
