"""``shapegcode simulate``: simulate a program on the machine's model."""

from __future__ import annotations

import argparse
from dataclasses import replace

from shapegcode.cli import runner
from shapegcode.cli.arguments import add_options, count, line_range
from shapegcode.cli.options import add_input_arguments, add_plots_argument, add_result_arguments, load_machine

# Of the progress bar, for the regions; the rest is the motion in time, which takes most of it.
_REGIONS_SHARE = 0.1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Simulates a program: the controller's model, then the machine's plant. Of each cut: time, "
        "residual and peak vibration, settling time, contour error of command and response. Of the whole program with "
        "its rapids, dwells and waits: the motion of the axes in time, as table, files and pictures."
    )
    add_input_arguments(parser)
    add_options(parser, (
        ("--shaped", None, bool,
         "simulate every cut as shaped blocks: at their feed, without look-ahead; needed only if the header of a "
         "shaped program, which marks its shaped cuts, is missing"),
        ("--against", "ORIGINAL", None,
         "measure the contour error against the path of this program, such as the original of a shaped one; without it "
         "against IN's own path"),
        ("--plant", None, ("modal", "feed-drive"),
         "modal: vibration modes behind an ideal servo; feed-drive: motor, ball screw, table, friction and servo loops "
         "of [axes.x.drive] (default: %(default)s)", "modal"),
        ("--csv", "FILE", None, "write the motion in time, one line per period; - for standard output"),
        ("--npz", "FILE", None, "write the same columns as a NumPy archive"),
        ("--every", "N", count, "write every N-th sample only (default: %(default)d)", 1),
        ("--lines", "A-B", line_range,
         "motion in time of these lines alone, as `shapegcode expand` numbers them; the program is simulated from its "
         "start in any case"),
    ))  # fmt: skip
    add_plots_argument(
        parser,
        "write pictures (PNG and SVG) into this folder: the motion in time, and path, feed and vibration of the region "
        "that vibrates most",
    )
    add_result_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Simulate one program."""
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
            program,
            machine,
            plant=args.plant,
            shaped=shaped,
            against=against,
            record_samples=0,
            on_progress=lambda done, total: bar.update(_REGIONS_SHARE * done / total),
        )
        motion = simulate_motion(
            program,
            machine,
            plant=args.plant,
            shaped=shaped,
            lines=args.lines,
            csv=args.csv,
            npz=args.npz,
            every=args.every,
            on_progress=lambda done: bar.update(_REGIONS_SHARE + (1.0 - _REGIONS_SHARE) * done),
        )
    note = shaped_note(program)
    notes = [note] if note and shaped is None else []
    wrote = [name for name in (args.csv, args.npz) if name not in (None, "-")]
    return runner.finish(replace(simulation, motion=motion), args, notes=notes, wrote=wrote)
