"""``shapegcode demo``: repeat a paper's figures, or hold a prediction against what machines did."""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Callable

from shapegcode.cli.options import add_result_arguments

__all__ = ["add_arguments", "run"]

_FOLDER = "demo-output"
# Name of a demonstration: its module, which has the function `<module>_demo(on_progress)`, and what it repeats.
_DEMOS = {
    "path": ("path", "line, arc, line at both feeds and reductions: Ko, Lim and Hong, 2023 (paper 000)"),
    "cycle-time": (
        "cycle_time",
        "a test piece with the features of ISO 10791-7, both sets of constants: Lee, Ro, Song and Oh, 2022 (paper 004)",
    ),
    "shaper": (
        "shaper",
        "two-mode shapers, figures 2 to 6, and their test on a stage: Park, Hong and Danielson, 2009 (paper 002)",
    ),
    "metrology": ("metrology", "the specimens, measured on the model: Ko, Lim and Hong, 2023 (paper 000)"),
    "tap": (
        "tap",
        "equivalent systems, and what end mill and collet deflect: Back, Ko and Kim, 2003 (paper 003)",
    ),
    "corner": ("corner", "cornering cuts, the feeds of the paper and the scheduler's: Kim and Ko, 2001 (paper 001)"),
    "evidence": (
        "evidence",
        "clocks of two machining centres learned from their logs, other programs predicted: NIST's test bed (minutes)",
    ),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Repeats the figures of a paper with this program's models, and shows both; papers in full: "
        "docs/evidence/references.md. evidence: predicted beside measured, docs/evidence/evidence.md. "
        "Exit code 1 if a statement of the paper differs and why is not known, or a prediction is out of its limits."
    )
    parser.add_argument(
        "name",
        metavar="NAME",
        choices=tuple(_DEMOS),
        help="; ".join(f"{name}: {what}" for name, (_, what) in _DEMOS.items()),
    )
    parser.add_argument(
        "--plots",
        metavar="DIR",
        default=None,
        help=f"folder for the pictures, where there are some (PNG and SVG; default: {_FOLDER})",
    )
    add_result_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Run one demonstration.

    Raises:
        OSError: the JSON file or a picture cannot be written.
    """
    from shapegcode.cli import runner
    from shapegcode.demos.result import Demonstration

    runner.check_files(args)
    module = _DEMOS[args.name][0]
    found = importlib.import_module(f"shapegcode.demos.{module}")
    demo: Callable[[Callable[[float], None]], Demonstration] = getattr(found, f"{module}_demo")
    with runner.progress(f"demo {args.name}", args) as bar:
        result = demo(bar.update)
    if args.plots is None and result.plots():
        args.plots = _FOLDER
    return runner.finish(result, args)
