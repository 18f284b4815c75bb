"""Commands with many runs. ``shapegcode batch``: a command on many programs and machines; ``study``: a program on many
sampled machines; ``optimize``: the shortest program that stays within tolerance with a given probability."""

from __future__ import annotations

import argparse
import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode.batching import COMMANDS, WRITES
from shapegcode.cli import ExitCode, parser_of, runner
from shapegcode.cli.arguments import NEEDED, Interface, Row, count, ratio, seconds, size
from shapegcode.cli.options import AMOUNT, MACHINE_OR_NONE, RESULT_OF_DRAWS, cluster, cluster_of, load_machine, plots
from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import write_lines

if TYPE_CHECKING:
    from shapegcode.machine import Machine
    from shapegcode.studies.study_file import StudyFile

_INDEX = "index.html"


def _batch(args: argparse.Namespace) -> int:
    from shapegcode.batching.batch import batch

    options = list(getattr(args, "rest", ()))
    # argparse refuses arguments unknown to the command before any run.
    target = ["-o", "out"] if args.batch_command in WRITES else []
    parser_of(args.batch_command).parse_args([args.batch_command, "part.nc", "-m", "vx500", *target, *options])
    html, args.html = args.html, None
    name = f"{args.batch_command}: "
    with runner.progress(f"{name}reading", args) as bar:

        def show(share: float, text: str) -> None:
            bar.update(share)
            bar.say(name + text)

        result = batch(
            args.programs, args.machine, args.output, command=args.batch_command, options=options, jobs=args.jobs,
            cluster=cluster_of(args), resume=args.resume, html=html, time_limit_s=args.time_limit,
            memory_limit_bytes=args.memory_limit, on_progress=show,
        )  # fmt: skip
    tables = result.tables()
    if html is not None:
        args.html = str(Path(html) / _INDEX)
        result = replace(result, html=str(html))
    notes = []
    if result.stopped:
        words = [word for word in args.typed if word != "--resume"]
        notes.append(f"resume with: {shlex.join(['shapegcode', 'batch', '--resume', *words[1:]])}")
    code = runner.finish(result, args, tables=tables, notes=notes, wrote=[result.summary])
    return ExitCode.INTERRUPTED if result.stopped == "Ctrl-C" else code


BATCH = Interface(
    "Runs a command over many programs and machines, each run in a separate process. Options of the command come "
    "after --. Results, each complete or absent, go into the folder of -o, with batch.jsonl (finished runs) and "
    "summary.csv (one row per run). Exit code 0: all within tolerance; 1: some are not, were refused or failed; 2: "
    "none could be started.",
    (
        ("programs", "PROGRAMS", {"nargs": "+"},
         "files, folders (with subfolders), patterns in quotes ('parts/**/*.nc'), or @LIST: a file with one of "
         "these per line"),
        ("-m --machine", "MACHINE", [None],
         "machine file or built-in machine; more than one -m: every program on each of them", NEEDED),
        ("-o --output", "DIR", None, "folder of the results", NEEDED),
        ("--command", None, {"dest": "batch_command", "choices": COMMANDS},
         "command to run on each program (default: convert)", "convert"),
        ("--resume", None, bool, "run only what is missing, failed or changed"),
        ("--jobs", "N", count, "parallel processes (default: one per processor)", 0),
        ("--time-limit", "TIME", seconds, "time limit of each run (default: 3600s)", 3600.0),
        ("--memory-limit", "SIZE", size,
         "memory limit of each run, such as 2G, on top of what shapegcode itself needs (default: none; Linux only)", 0),
        *cluster("run"),
        ("--json", "FILE", None, "write all rows as JSON; - for standard output"),
        ("--html", "DIR", None, "write a page for each run into this folder, with an index"),
        AMOUNT,
    ),
    _batch,
)  # fmt: skip


def _study_options(what: str, draws: str) -> tuple[Row, ...]:
    """Study file, machine and number of samples; *what* describes the file, *draws* the number."""
    number = ("-n --draws", "N", count, f"{draws} (default: the file's)")
    return ("input", "STUDY.toml", None, what), *MACHINE_OR_NONE, number


def _loaded(args: argparse.Namespace) -> tuple[StudyFile, Machine]:
    """Load the study file and the machine; record program and machine file as inputs of the command."""
    from shapegcode.studies.study_file import load_study

    file = load_study(args.input)
    args.machine = args.machine or file.machine
    if args.machine is None:
        raise ArgumentError(f"{args.input}: no machine: give one there, or with -m")
    args.inputs = [file.program]
    machine = load_machine(args)
    runner.check_files(args)
    return file if args.draws is None else file.model_copy(update={"n": args.draws}), machine


def _study(args: argparse.Namespace) -> int:
    from shapegcode.studies.study import study

    file, machine = _loaded(args)
    with runner.progress(f"{args.input}: converting", args) as bar:

        def show(stage: str, share: float) -> None:
            bar.update(share)
            bar.say(f"{args.input}: {stage}")

        result = study(file.program, machine, **file.options(), scheduler=cluster_of(args), on_progress=show)
    if args.csv is not None:
        write_lines(args.csv, result.csv_lines())
    return runner.finish(result, args)


STUDY = Interface(
    "Converts a program and simulates it on sampled machines (Monte Carlo): probability of staying "
    "within tolerance, quantiles, most influential parameter. Exit code 0: the probability is at_least of the file or "
    "more; 1: it is less; 2: bad input.",
    (
        *_study_options("program, machine, varied parameters", "number of samples"),
        ("--csv", "FILE", None, "write one line per sample; -: standard output"),
        *cluster("simulate"),
        plots("write pictures (PNG and SVG) of the influence of each value and of the quantiles into this folder"),
        *RESULT_OF_DRAWS,
    ),
    _study,
)


def _optimize(args: argparse.Namespace) -> int:
    from shapegcode.studies.optimize import optimize

    file, machine = _loaded(args)
    options = file.choice_options() | ({} if args.at_least is None else {"probability": args.at_least})
    with runner.progress(f"{args.input}: converting", args) as bar:
        result = optimize(file.program, machine, **options, on_progress=bar.update)
    words = shlex.join([args.machine, *(word for each in args.set for word in ("--set", each))])
    return runner.finish(replace(result, machine_words=words), args)


OPTIMIZE = Interface(
    "Chooses block period, shaper, contour tolerance for shaping and arc feed (or the keys under [choose]) for the "
    "shortest cycle time that keeps the machine's tolerance on enough sampled machines. Reads the same file as "
    "`shapegcode study`. Exit code 0: found; 1: no combination reaches the probability; 2: bad input.",
    (
        *_study_options(
            "program, machine, varied parameters, settings to choose", "sampled machines per combination"
        ),
        ("--at-least", "RATIO", ratio,
         "probability of staying within tolerance, for example 99%% (default: the file's)"),
        plots("write a picture of time and probability of the combinations (PNG and SVG) into this folder"),
        *RESULT_OF_DRAWS,
    ),
    _optimize,
)  # fmt: skip
