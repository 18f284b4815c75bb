"""The commands shaper, report, demo and completion."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapegcode.cli import command_in, parser_of, runner
from shapegcode.cli.arguments import Interface, OldName, positive, ratio, seconds, share
from shapegcode.cli.options import AMOUNT, JSON, MACHINE_OR_NONE, RESULT, SCRIPT, load_machine, plots, refuse_same_file
from shapegcode.errors import ArgumentError

if TYPE_CHECKING:
    from shapegcode.results.page.model import Page


# The names in the registry of families, which is not imported here: its solvers load too slowly for a help text.
_FAMILIES = (
    "zv", "zvd", "zvdd", "mzv", "ei", "ei2", "ei3", "si", "negative-zv", "simultaneous", "minimal", "polynomial",
    "non-negative", "robust", "mirrored", "smooth-zv", "smooth-mzv", "smooth-ei", "smooth-ei2", "smooth-si",
    "smooth-zvd-ei", "taps",
)  # fmt: skip


def _shaper(args: argparse.Namespace) -> int:
    from shapegcode.shaping.comparison import choose_shaper
    from shapegcode.shaping.result import families_table

    if args.list_families:
        runner.output_console(args.json).print(families_table())
        return 0
    if bool(args.mode) == (args.machine is not None):
        raise ArgumentError("the modes come from --mode 46:0.02 ... or from -m MACHINE: give one of them")
    machine = None if args.machine is None else load_machine(args)
    runner.check_files(args)
    with runner.progress("comparing shapers", args) as bar:
        result = choose_shaper(
            args.mode, machine=machine, uncertainty=args.uncertainty,
            periods_s=[*([None] if args.continuous else []), *args.block_period] or None, families=args.family,
            max_duration_s=args.max_duration, max_abs_sum=args.max_abs_sum, vibration_limit=args.vibration_limit,
            objective=args.objective, allow_negative=args.negative, taps=args.taps, on_progress=bar.update,
        )  # fmt: skip
    result = replace(result, machine=args.machine)
    tables = result.tables(args.speed, args.radius, everything=args.verbose)
    return runner.finish(result, args, tables=tables, notes=result.notes())


SHAPER = Interface(
    "Designs every family of input shapers for some vibration modes and compares them: duration, residual "
    "vibration at other frequencies, contour cost (error on arcs), negative impulses; and recommends one. "
    "Exit code 0: the recommended one is within the vibration limit; 1: it is not; 2: bad input.",
    (
        ("--mode", "HZ[:DAMPING][±BAND]", [None],
         "a mode to cancel, such as 46:0.02±5%%, 46:0.02+-2Hz or 46:0.02-5%%+8%%, from 0.1 to 10000 Hz; once for each "
         "mode", []),
        *MACHINE_OR_NONE,
        ("--uncertainty", "RATIO", share,
         "uncertainty of the frequency of modes given without a band, for example 5%% (default: 0)", 0.0),
        ("--block-period", "TIME", [seconds],
         "block period: the times of the impulses are multiples of it, such as 5ms; may be repeated (default: that of "
         "the machine file, else the best few)", []),
        ("--continuous", None, bool,
         "also design shapers whose impulses may lie at any time (continuous time); without --block-period design no "
         "others. Default without -m and --block-period: continuous time and the best few periods"),
        ("--family", "NAME", {"action": "extend", "nargs": "+"},
         f"compare only these families, of {', '.join(_FAMILIES)} (default: all)"),
        ("--list-families", None, bool, "list the families with meaning and source, and exit"),
        ("--max-duration", "TIME", seconds,
         "longest shaper, for example 50ms (default: three periods of the slowest mode; with -m at most "
         "shaping.max_duration_s, and just that if no shaper of three periods is good enough)"),
        ("--max-abs-sum", "N", positive, "largest sum of the impulses' magnitudes (default: %(default)g)", 10.0),
        ("--vibration-limit", "RATIO", ratio,
         "maximum residual ratio within the bands (default: the machine's "
          "shaping.vibration_limit, else 5%%)"),
        ("--objective", None, ("shortest", "contour", "robust"),
         "quantity that the recommended design minimizes: duration, contour cost, or residual vibration "
         "(default: %(default)s)", "shortest"),
        ("--negative", None, bool, "a design with negative impulses may be recommended"),
        ("--taps", "TIME:A,...", None, 'compare your own shaper (impulses): "0:.5,10.9ms:.5"'),
        ("--speed", "MM/S", positive, "speed at which the contour cost is shown (default: %(default)g)", 200.0),
        ("--radius", "MM", positive, "radius of the arc for the contour cost (default: %(default)g)", 20.0),
        plots("write pictures of the comparison (PNG and SVG) into this folder"),
        *RESULT,
        OldName("--all", "--verbose"),
    ),
    _shaper,
)  # fmt: skip


def _report(args: argparse.Namespace) -> int:
    from shapegcode.results.page.html import save
    from shapegcode.results.revive import ReportPage, Reports, written_reports

    jobs = [(Path(name), report) for name in args.inputs for report in written_reports(name)]
    if args.output is not None and len(jobs) > 1:
        raise ArgumentError(f"-o {args.output}: {len(jobs)} results need a page each; leave it out")
    if args.output == "-":
        raise ArgumentError("-o -: a page cannot go to standard output, name a file")
    targets = [_target(source, report) if args.output is None else Path(args.output) for source, report in jobs]
    refuse_same_file(targets, [source for source, _ in jobs])
    written = []
    for (source, report), target in zip(jobs, targets, strict=True):
        with runner.progress(f"writing {target}", args) as bar:
            page, kind = _page_of(source, report, bar.update)
            save(page, target, args.html_script)
        written.append(ReportPage(str(source), str(target), kind, page.scene is not None, tuple(page.problems)))
    warnings = tuple(f"{page.source}: {problem}" for page in written for problem in page.problems)
    return runner.finish(Reports(tuple(written), warnings), args, wrote=[page.page for page in written])


def _target(source: Path, report: Mapping[str, Any]) -> Path:
    """Path of the page in the folder of the JSON; its name ends in the program's address in a multi-program file."""
    address = str(report.get("program_address", ""))
    label = "".join(letter if letter.isalnum() else "-" for letter in address).strip("-")
    return source.with_name(f"{source.stem}{'-' + label if label else ''}.html")


def _page_of(source: Path, report: Mapping[str, Any], on_progress: Callable[[float], None]) -> tuple[Page, str]:
    """The page of a result, and the name of its class, which is empty if this version cannot read the result."""
    from shapegcode.cli.replay import changes, simulated_again
    from shapegcode.results.json import this_version
    from shapegcode.results.outcome import NotKeptError
    from shapegcode.results.page.model import raw_page
    from shapegcode.results.revive import provenance_in, revived

    try:
        provenance = provenance_in(report)
        problems = (
            [] if provenance.by == this_version() else [f"made by {provenance.by}; this page by {this_version()}"]
        )
        found, changed = changes(provenance, source.parent)
        problems += changed
        simulated, why = (None, "") if changed else simulated_again(provenance, found, report)
        problems += [why] if why else []
        result = revived(report, {"simulated": simulated})
    except ArgumentError as error:
        if not isinstance(report.get("provenance", report.get("made")), dict):
            raise ArgumentError(f"{source}: {error}") from None
        return raw_page(report, str(error)), ""
    try:
        page = result.page(provenance=provenance, problems=problems, on_progress=on_progress)
    except NotKeptError as error:
        return raw_page(report, str(error)), provenance.result
    return replace(page, report=report), provenance.result


REPORT = Interface(
    "Makes the page of --html later: figures from the JSON and, if the programs and the machine file are "
    "unchanged, the motion too. They are looked for at their original paths and in the folder of the JSON. Exit "
    "code 0: done; 1: done, with a problem, such as a changed file, that the page names; 2: bad input.",
    (
        ("inputs", "RESULT.json", {"nargs": "+"}, "file written by --json"),
        ("-o --output", "PAGE.html", None, "page to write (default: RESULT.html in the same folder)"),
        SCRIPT,
        JSON,
        AMOUNT,
    ),
    _report,
)


_PAGES = {
    "metrology": "paper000", "corner": "paper001", "shaper": "paper002", "tap": "paper003", "cycle-time": "paper004",
    "evidence": "evidence",
}  # fmt: skip
"""Page of the documentation that replaces a demo of version 0.1.0, by the name of the demo."""


def _name(word: str) -> str:
    if word in _PAGES:
        page = f"docs/evidence/{_PAGES[word]}.md"
        raise argparse.ArgumentTypeError(
            f"{word} is now a page of the documentation, which says how to reproduce its figures: {page}"
        )
    return word


def _demo(args: argparse.Namespace) -> int:
    from shapegcode.demos.path import path_demo

    runner.check_files(args)
    with runner.progress(f"demo {args.name}", args) as bar:
        result = path_demo(bar.update)
    return runner.finish(result, args)


DEMO = Interface(
    "Repeats the figures of a paper with the models of shapegcode, and compares them with the published ones. Other "
    "papers: docs/evidence/figures.md. Exit code 0: they agree, or why not is known; 1: one differs for an unknown "
    "reason, or an emitted program is out of tolerance; 2: bad input.",
    (
        ("name", "NAME", {"type": _name, "choices": ("path",)},
         "path: line, arc, line, at two feeds and two feed reductions: Ko, Lim and Hong, 2023 (paper 000)"),
        plots("folder for the pictures, if there are any (PNG and SVG)"),
        *RESULT,
    ),
    _demo,
)  # fmt: skip

# At each TAB the shell calls the command itself, so that completions match the parser of this version.


def _completion(args: argparse.Namespace) -> int:
    from argcomplete.shell_integration import shellcode

    sys.stdout.write(shellcode(["shapegcode"], shell=args.shell))
    return 0


def complete() -> None:
    """Print the completions for a shell, and exit."""
    import argcomplete

    argcomplete.autocomplete(parser_of(command_in(os.environ.get("COMP_LINE", "").split()[1:])))


COMPLETION = Interface(
    "Prints the shell completion script for commands, options, their values and files. Line for "
    '~/.bashrc (for ~/.zshrc with zsh instead of bash):\n\n  eval "$(shapegcode completion bash)"\n\nand for '
    "~/.config/fish/config.fish:\n\n  shapegcode completion fish | source",
    (("shell", None, ("bash", "zsh", "fish"), "your shell"),),
    _completion,
)
