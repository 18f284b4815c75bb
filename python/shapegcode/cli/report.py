"""``shapegcode report``: pages of results that --json has written."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapegcode.cli import runner
from shapegcode.cli.arguments import add_options
from shapegcode.cli.options import add_amount_arguments, add_json_argument, add_script_argument, refuse_same_file

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from shapegcode.results.page.model import Page


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.description = (
        "Makes the page that --html writes later, from the JSON: figures from the JSON, and where the programs and the "
        "machine file are still as they were, their motion too. Changed files are reported on the page and here (exit "
        "code 1). Files are searched at their original paths, and in the folder of the JSON."
    )
    add_options(parser, (
        ("inputs", "RESULT.json", {"nargs": "+"}, "what --json has written"),
        ("-o --output", "PAGE.html", None, "page to write (default: RESULT.html beside the JSON)"),
    ))  # fmt: skip
    add_script_argument(parser)
    add_json_argument(parser)
    add_amount_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Make the pages."""
    from shapegcode._core import ArgumentError
    from shapegcode.results.page.html import save
    from shapegcode.results.report_result import ReportPage, Reports
    from shapegcode.results.revive import written_reports

    jobs = [(Path(name), report) for name in args.inputs for report in written_reports(name)]
    if args.output is not None and len(jobs) > 1:
        raise ArgumentError(f"-o {args.output}: {len(jobs)} results need a page each; leave it out")
    if args.output == "-":
        raise ArgumentError("-o -: a page cannot go to standard output, name a file")
    targets = [_target(source, report) if args.output is None else Path(args.output) for source, report in jobs]
    for rank, target in enumerate(targets):
        refuse_same_file([target], [*(source for source, _ in jobs), *targets[rank + 1 :]])
    written = []
    for (source, report), target in zip(jobs, targets, strict=True):
        with runner.progress(f"writing {target}", args) as bar:
            page, kind = _page_of(source, report, bar.update)
            save(page, target, args.html_script)
        written.append(ReportPage(str(source), str(target), kind, page.scene is not None, tuple(page.problems)))
    warnings = tuple(f"{page.source}: {problem}" for page in written for problem in page.problems)
    return runner.finish(Reports(tuple(written), warnings), args, wrote=[page.page for page in written])


def _target(source: Path, report: Mapping[str, Any]) -> Path:
    """The page beside the JSON; one of several programs has its address in the name."""
    address = str(report.get("program_address", ""))
    label = "".join(letter if letter.isalnum() else "-" for letter in address).strip("-")
    return source.with_name(f"{source.stem}{'-' + label if label else ''}.html")


def _page_of(source: Path, report: Mapping[str, Any], on_progress: Callable[[float], None]) -> tuple[Page, str]:
    """The page of a result, and the result's class; empty: this version cannot read it."""
    from shapegcode._core import ArgumentError
    from shapegcode.cli.replay import changes, simulated_again
    from shapegcode.results.json import this_version
    from shapegcode.results.outcome import NotKeptError
    from shapegcode.results.page.default import raw_page
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
