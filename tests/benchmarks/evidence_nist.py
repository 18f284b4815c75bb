"""The figures of docs/evidence/evidence.md on NIST's test bed: `python tests/benchmarks/evidence_nist.py [--curve]`.

Prints the demonstration's tables, what the runs of runs.csv took that have no log here beside the learned machine's
time, and what length over feed and the built-in machine say. `--curve` learns from 1, 2, 4 runs as well (some ten
minutes); `--plots DIR` writes the pictures.
"""

from __future__ import annotations

import argparse
import csv
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import shapegcode as sg
from shapegcode._core import SegmentKind
from shapegcode.demos.evidence import STUDIES, Study, evidence_demo, nist_folder, nist_runs, study_of
from shapegcode.results import plot
from shapegcode.timing.calibration.calibrate import learn_clock
from shapegcode.timing.cycle_time import cycle_time

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: What is learned from in each step of the curve: runs by program.
SUBSETS: dict[str, tuple[dict[str, tuple[int, ...]], ...]] = {
    "BOX OP2 → OP3": (
        *({"BOX_OP2": (number,)} for number in (1, 3, 5)),
        *({"BOX_OP2": numbers} for numbers in ((1, 3), (4, 5))),
        {"BOX_OP2": (1, 3, 4, 5)},
    ),
    "BOX OP3 → OP2": (
        *({"BOX_OP3": (number,)} for number in (1, 2, 3)),
        *({"BOX_OP3": numbers} for numbers in ((1, 2), (3, 4))),
        {"BOX_OP3": (1, 2, 3, 4)},
    ),
    "COVER, PLATE-12 → PLATE-13": (
        *({"COVER": (number,), "PLATE-12": (1,)} for number in (1, 2)),
        {"COVER": (1, 2), "PLATE-12": (1,)},
        {"COVER": (1, 2, 3, 4), "PLATE-12": (1,)},
        {"PLATE-12": (1,)},
        {"COVER": (1, 2, 3, 4)},
    ),
}


@dataclass(frozen=True)
class Point:
    """One step of the curve: runs and blocks learned from, errors of what was left out in %."""

    title: str
    learned: str
    runs: int
    blocks: int
    error_percent: float
    tool_percent: float
    cuts_percent: float
    family: str


def program_of(name: str, machine: sg.Machine) -> sg.Program:
    """A program of the test bed."""
    return sg.Program.read(nist_folder() / "programs" / f"{name}.NC", machine)


def length_over_feed(name: str, machine: sg.Machine, rapid_mm_per_s: float) -> float:
    """Time in s as CAM systems give it: every way at its programmed feed, rapids at their rate."""
    program = program_of(name, machine)
    total_s = sum(region.path[index].length_mm / region.path[index].feed_mm_per_s
                  for region in program.regions for index in range(len(region.path)))  # fmt: skip
    for segment, dwell_s in program.core.other_moves:
        rapid = segment.kind == SegmentKind.rapid
        total_s += dwell_s + (segment.length_mm / (rapid_mm_per_s if rapid else segment.feed_mm_per_s))
    return float(total_s)


def published() -> dict[str, list[float]]:
    """Times in s of every published run, by program."""
    found: dict[str, list[float]] = defaultdict(list)
    with (nist_folder() / "runs.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            found[row["program"]].append(float(row["active_to_completed_s"]))
    return found


def judge_all_runs(study: Study) -> None:
    """Print what the learned machine says of all published runs, at its usual overrides."""
    machine, builtin, times = study.fitted, sg.Machine.load("vx500"), published()
    usual = f"{machine.times.feed_override_percent:g} %, rapids {machine.times.rapid_override_percent:g} %"
    print(f"\n{study.title}: {study.family}; usual overrides: feed {usual}")
    for file in dict.fromkeys(run.program for run in study.runs):
        name = file.removesuffix(".NC")
        runs = [run for run in study.runs if run.program == file]
        said = cycle_time(program_of(name, machine), machine, full=False).cycle_time_s
        # Runs without a log here: those that took as long as none that has one.
        rest = np.array(
            [each for each in times[name] if all(abs(each - (run.measured_s or 0)) > 0.006 for run in runs)]
        )
        # The shop's dial is what the logs that were learned from show most; another program may be run at another.
        full = cycle_time(program_of(name, machine), machine, feed_override=1.0, full=False).cycle_time_s
        line = f"  {name} ({runs[0].use}): {said:.1f} s, feed at 100 %: {full:.1f} s"
        if len(rest):
            error = 100.0 * (full / rest - 1.0)
            line += (
                f"; {len(rest)} runs without log took {rest.min():.1f} ... {rest.max():.1f} s, median "
                f"{np.median(rest):.1f}: error at 100 % {error.min():+.2f} ... {error.max():+.2f} %, median "
                f"{np.median(error):+.2f} %, {np.sum(abs(error) <= 2.0)} within 2 %"
            )
        print(line)
        unfitted = cycle_time(program_of(name, builtin), builtin, full=False).cycle_time_s
        cam = length_over_feed(name, builtin, machine.axes.x.rapid_mm_per_min / 60.0)
        middle = float(np.median(times[name]))
        print(
            f"    median of all {len(times[name])} published: {middle:.1f} s; length over feed {cam:.1f} s "
            f"({100.0 * (cam / middle - 1.0):+.0f} %), built-in machine {unfitted:.1f} s "
            f"({100.0 * (unfitted / middle - 1.0):+.0f} %)"
        )


def point_cells(point: Point) -> tuple[object, ...]:
    """A row of the table of the curve."""
    errors = f"{point.error_percent:.2f}", f"{point.cuts_percent:.2f}", f"{point.tool_percent:.1f}"
    return point.title, point.learned, point.runs, point.blocks, *errors, point.family


def curve() -> list[Point]:
    """Learn from fewer runs, and predict the program that is left out."""
    machine, points = sg.Machine.load("vx500"), []
    for title, _, left_out in STUDIES:
        for subset in SUBSETS[title]:
            study = study_of(title, learn_clock(nist_runs(subset, left_out), machine))
            blocks = sum(len(numbers) * program_of(name, machine).core.line_count for name, numbers in subset.items())
            tools = [abs(share.error_percent) for run in study.left_out for share in run.tools]
            cuts = [abs(share.error_percent) for run in study.left_out for share in run.kinds if share.name == "cuts"]
            learned = ", ".join(f"{name} {'+'.join(map(str, numbers))}" for name, numbers in subset.items())
            points.append(
                Point(title, learned, study.learned_runs, blocks, study.largest_error_percent, max(tools), max(cuts),
                      study.family)
            )  # fmt: skip
            print("|", " | ".join(map(str, point_cells(points[-1]))), "|", flush=True)
    return points


def plot_curve(points: Sequence[Point], ax: Axes | None = None) -> Axes:
    """Does the error of what was left out fall with the number of runs, and of blocks, learned from?

    The line is the mean of points that hold every program of the study; the others are hollow.
    """
    ((left, right),) = plot.grid(ax, 1, 2, size_inch=(10.0, 4.2), title="Programs left out, by what was learned from")
    needed = {title: {name.replace("_", " ") for name in learned} for title, learned, _ in STUDIES}
    for number, title in enumerate(dict.fromkeys(point.title for point in points)):
        colour = plot.COLOURS[number]
        own = [point for point in points if point.title == title]
        whole = [point for point in own if all(name in point.learned.replace("_", " ") for name in needed[title])]
        counts = sorted({point.runs for point in whole})
        middle = [np.mean([point.error_percent for point in whole if point.runs == count]) for count in counts]
        left.plot(counts, middle, "-", color=colour, label=title)
        for point in own:
            fill = colour if point in whole else "white"
            left.plot(point.runs, point.error_percent, "o", color=colour, markerfacecolor=fill)
            right.plot(point.blocks / 1000.0, point.error_percent, "o", color=colour, markerfacecolor=fill)
    for panel, text in ((left, "runs"), (right, "thousand blocks run")):
        panel.axhline(2.0, color=plot.GREY, linewidth=0.8)
        panel.set_xlabel(text)
        panel.set_ylabel("error of a whole run, %")
        panel.set_ylim(bottom=0.0)
    plot.legend_below(left, columns=1)
    return left


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--curve", action="store_true", help="learn from 1, 2, 4 runs (some ten minutes)")
    parser.add_argument("--only-curve", action="store_true", help="nothing else")
    parser.add_argument("--plots", metavar="DIR", type=Path)
    args = parser.parse_args()
    if not args.only_curve:
        demo = evidence_demo()
        print(demo.answer, *demo.tables(), *demo.warnings, sep="\n\n")
        for study in demo.studies:
            judge_all_runs(study)
        if args.plots:
            print(*demo.save_plots(args.plots))
    if args.curve or args.only_curve:
        points = curve()
        if args.plots:
            print(*plot.save_all({"evidence-nist-runs": partial(plot_curve, points)}, args.plots))


if __name__ == "__main__":
    main()
