"""``shapegcode demo``: repeat a paper's figures with this program's models."""

from __future__ import annotations

import argparse

from shapegcode.cli import runner
from shapegcode.cli.options import add_plots_argument, add_result_arguments

_PAGES = {
    "metrology": "docs/evidence/paper000.md",
    "corner": "docs/evidence/paper001.md",
    "shaper": "docs/evidence/paper002.md",
    "tap": "docs/evidence/paper003.md",
    "cycle-time": "docs/evidence/paper004.md",
    "evidence": "docs/evidence/evidence.md",
}
"""Pages of the book that repeat what the command of that name did up to version 0.1.0."""


def _name(word: str) -> str:
    if word in _PAGES:
        raise argparse.ArgumentTypeError(
            f"{word} is a page of the book now, which says what repeats its figures: {_PAGES[word]}"
        )
    return word


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Repeats the figures of a paper with this program's models, and shows both. Other papers are pages of the "
        "book: docs/evidence/figures.md. Exit code 1 if a statement of the paper differs and why is not known."
    )
    what = "path: line, arc, line at both feeds and reductions: Ko, Lim and Hong, 2023 (paper 000)"
    parser.add_argument("name", metavar="NAME", type=_name, choices=("path",), help=what)
    add_plots_argument(parser, "folder for the pictures, where there are some (PNG and SVG)")
    add_result_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Repeat a paper's figures."""
    from shapegcode.demos.path import path_demo

    runner.check_files(args)
    with runner.progress(f"demo {args.name}", args) as bar:
        result = path_demo(bar.update)
    return runner.finish(result, args)
