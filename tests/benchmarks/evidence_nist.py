"""The figures of docs/evidence/evidence.md on NIST's test bed: `python tests/benchmarks/evidence_nist.py [--curve]`.

Learns two machining centres from their logs and predicts the programs that were left out (some 100 s of CPU): whole
runs, tools and kinds of motion beside what the logs say; exit code 1 if one is out of its limit. Then what the runs of
runs.csv took that have no log here, and what length over feed and the built-in machine say. `--curve` learns from 1, 2,
4 runs as well (some ten minutes); `--plots DIR` writes the pictures.
"""

from __future__ import annotations

import argparse
import csv
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from table import markdown

import shapegcode as sg
from shapegcode._core import SegmentKind
from shapegcode.results import plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NIST = Path(str(resources.files("shapegcode") / "data" / "measured" / "nist"))
#: Programs that are learned from, and the one that is left out, by title.
STUDIES = {
    "BOX OP2 → OP3": (("BOX_OP2",), "BOX_OP3"),
    "BOX OP3 → OP2": (("BOX_OP3",), "BOX_OP2"),
    "COVER, PLATE-12 → PLATE-13": (("COVER", "PLATE-12"), "PLATE-13"),
}
RUN_PERCENT, TOOL_PERCENT = 2.0, 5.0  # limits of a whole run, and of a tool's share or that of a kind of motion
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
    """One step of the curve: runs and blocks learned from, error of a whole run of what was left out in %."""

    title: str
    learned: str
    runs: int
    blocks: int
    error_percent: float


def nist_runs(learned: Mapping[str, Sequence[int]], left_out: str) -> sg.RunsFile:
    """Runs of the test bed: numbers of those learned from, by program (none: all), and the program predicted."""

    def entry(program: str, numbers: Sequence[int], use: str) -> sg.RunEntry:
        logs = sorted((NIST / "logs").glob(f"{program}-run*.txt.gz"))
        if numbers:
            logs = [NIST / "logs" / f"{program}-run{number}.txt.gz" for number in numbers]
        return sg.RunEntry(NIST / "programs" / f"{program}.NC", tuple(logs), use)

    entries = [entry(program, numbers, "fit") for program, numbers in learned.items()]
    return sg.RunsFile(NIST, (*entries, entry(left_out, (), "test")))


def learned_machines(studies: int = len(STUDIES)) -> dict[str, sg.CycleTimeCalibration]:
    """The machines of the first studies, by title."""
    machine = sg.Machine.load("vx500")
    return {
        title: sg.calibrate_cycle_time(nist_runs(dict.fromkeys(learned, ()), left_out), machine)
        for title, (learned, left_out) in list(STUDIES.items())[:studies]
    }


def left_out(found: sg.CycleTimeCalibration) -> list[sg.CalibrationRun]:
    """Runs of the program that was not learned from, whole and without holds."""
    return [run for run in found.runs if run.use == "test" and run.measured_s is not None and not run.held_s]


def log_name(run: sg.CalibrationRun) -> str:
    """BOX_OP2-run1."""
    return Path(run.log).name.split(".")[0]


def worst_shares(found: sg.CycleTimeCalibration) -> dict[str, tuple[sg.CycleTimePart, str]]:
    """Of each tool and kind of motion the share that is furthest off, and the run that it is of."""
    worst: dict[str, tuple[sg.CycleTimePart, str]] = {}
    for run in left_out(found):
        for share in (*run.tools, *run.kinds):
            if share.name not in worst or abs(share.error_percent) > abs(worst[share.name][0].error_percent):
                worst[share.name] = share, log_name(run)
    return worst


def prediction_rows(title: str, found: sg.CycleTimeCalibration) -> Iterator[tuple[tuple[str, ...], bool]]:
    """Predicted beside measured, and whether it is within its limit: whole runs, then tools and kinds of motion."""
    for run in left_out(found):
        error = run.error_percent or 0.0
        holds = run.low_s <= (run.measured_s or 0.0) <= run.high_s
        note = f"95 %: {run.low_s:.1f} ... {run.high_s:.1f} s" + ("" if holds else ", does NOT hold it")
        cells = f"{run.measured_s:.1f} s", f"{run.predicted_s:.1f} s", f"{error:+.2f} %", note
        yield (title, log_name(run), *cells), holds and abs(error) <= RUN_PERCENT
    for name, (share, log) in worst_shares(found).items():
        cells = f"{share.measured_s:.1f} s", f"{share.predicted_s:.1f} s", f"{share.error_percent:+.2f} %", f"in {log}"
        yield (title, name, *cells), abs(share.error_percent) <= TOOL_PERCENT


def program_of(name: str, machine: sg.Machine) -> sg.Program:
    """A program of the test bed."""
    return sg.Program.read(NIST / "programs" / f"{name}.NC", machine)


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
    with (NIST / "runs.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            found[row["program"]].append(float(row["active_to_completed_s"]))
    return found


def judge_all_runs(title: str, found: sg.CycleTimeCalibration) -> None:
    """Print what the learned machine says of all published runs, at its usual overrides."""
    machine, builtin, times = found.fitted, sg.Machine.load("vx500"), published()
    usual = f"{machine.times.feed_override_percent:g} %, rapids {machine.times.rapid_override_percent:g} %"
    print(f"\n{title}: {found.family}; usual overrides: feed {usual}")
    for file in dict.fromkeys(run.program for run in found.runs):
        name = Path(file).stem
        runs = [run for run in found.runs if run.program == file]
        said = sg.cycle_time(program_of(name, machine), machine, full=False).cycle_time_s
        # Runs without a log here: those that took as long as none that has one.
        rest = np.array(
            [each for each in times[name] if all(abs(each - (run.measured_s or 0)) > 0.006 for run in runs)]
        )
        # The shop's dial is what the logs that were learned from show most; another program may be run at another.
        full = sg.cycle_time(program_of(name, machine), machine, feed_override=1.0, full=False).cycle_time_s
        line = f"  {name} ({runs[0].use}): {said:.1f} s, feed at 100 %: {full:.1f} s"
        if len(rest):
            error = 100.0 * (full / rest - 1.0)
            line += (
                f"; {len(rest)} runs without log took {rest.min():.1f} ... {rest.max():.1f} s, median "
                f"{np.median(rest):.1f}: error at 100 % {error.min():+.2f} ... {error.max():+.2f} %, median "
                f"{np.median(error):+.2f} %, {np.sum(abs(error) <= 2.0)} within 2 %"
            )
        print(line)
        unfitted = sg.cycle_time(program_of(name, builtin), builtin, full=False).cycle_time_s
        cam = length_over_feed(name, builtin, machine.axes.x.rapid_mm_per_min / 60.0)
        middle = float(np.median(times[name]))
        print(
            f"    median of all {len(times[name])} published: {middle:.1f} s; length over feed {cam:.1f} s "
            f"({100.0 * (cam / middle - 1.0):+.0f} %), built-in machine {unfitted:.1f} s "
            f"({100.0 * (unfitted / middle - 1.0):+.0f} %)"
        )


def curve() -> list[Point]:
    """Learn from fewer runs, and predict the program that is left out."""
    machine, points = sg.Machine.load("vx500"), []
    for title, (_, program) in STUDIES.items():
        for subset in SUBSETS[title]:
            found = sg.calibrate_cycle_time(nist_runs(subset, program), machine)
            runs = left_out(found)
            blocks = sum(len(numbers) * program_of(name, machine).core.line_count for name, numbers in subset.items())
            whole = [abs(run.error_percent or 0.0) for run in runs]
            tools = [abs(share.error_percent) for run in runs for share in run.tools]
            cuts = [abs(share.error_percent) for run in runs for share in run.kinds if share.name == "cuts"]
            learned = ", ".join(f"{name} {'+'.join(map(str, numbers))}" for name, numbers in subset.items())
            fitted = sum(run.use == "fit" for run in found.runs)
            points.append(Point(title, learned, fitted, blocks, max(whole)))
            errors = f"{max(whole):.2f} | {max(cuts):.2f} | {max(tools):.1f}"
            print(f"| {title} | {learned} | {fitted} | {blocks} | {errors} | {found.family} |", flush=True)
    return points


def plot_evidence(machines: Mapping[str, sg.CycleTimeCalibration], ax: Axes | None = None) -> Axes:
    """How far are the learned machines off? One row for each run, below the programs that were learned from.

    How to read this: 0 is what the machine took; the bands are 2 % for a run and 5 % for a tool's share; a bar is the
    95 % interval. Hollow: a run that was learned from.
    """
    rows = [
        (title, run)
        for title, found in machines.items()
        for run in sorted(found.runs, key=lambda run: run.use == "fit")
        if run.measured_s is not None
    ]
    panel = plot.axes(
        ax, size_inch=(9.0, 1.8 + 0.27 * len(rows)), title="Predicted over measured, NIST's test bed: every run at hand"
    )
    panel.axvspan(-TOOL_PERCENT, TOOL_PERCENT, color=plot.GREY, alpha=0.12, label="5 %, of a tool")
    panel.axvspan(-RUN_PERCENT, RUN_PERCENT, color=plot.GREY, alpha=0.25, label="2 %, of a run")
    labelled: set[str] = set()
    names = []
    for place, (title, run) in enumerate(rows):
        predicted = run.use == "test"
        took = (run.measured_s or 0.0) - run.held_s
        kind = "left out, with 95 % interval" if predicted else "learned from"
        reach = 100.0 * (run.high_s - run.predicted_s) / took if predicted else None
        panel.errorbar(
            run.error_percent or 0.0, place, xerr=reach, fmt="o", capsize=3, markersize=6,
            color=plot.COLOURS[1], markerfacecolor=plot.COLOURS[1] if predicted else "white",
            label=None if kind in labelled else kind,
        )  # fmt: skip
        labelled.add(kind)
        for share in run.tools:
            panel.plot(
                share.error_percent, place, "|", color=plot.COLOURS[0], markersize=9, markeredgewidth=1.6,
                alpha=1.0 if predicted else 0.4, label=None if "tools" in labelled else "its tools",
            )  # fmt: skip
            labelled.add("tools")
        held = f", held {run.held_s:.1f} s" if run.held_s else ""
        names.append(f"{log_name(run)}: {run.measured_s:.1f} s{held}")
        if place and rows[place - 1][0] != title:
            panel.axhline(place - 0.5, color=plot.GREY, linewidth=0.8)
    panel.set_yticks(range(len(rows)), names, fontsize=8)
    panel.set_ylim(len(rows) - 0.5, -0.5)
    panel.set_xlim(-16.0, 16.0)
    for title in dict.fromkeys(title for title, _ in rows):
        first = next(place for place, row in enumerate(rows) if row[0] == title)
        panel.text(
            -15.7, first + (0.0 if len(title) < 20 else 1.0), title, fontsize=8, va="center", color=plot.COLOURS[1]
        )
    panel.set_xlabel("predicted over measured, %")
    plot.legend_below(panel)
    return panel


def plot_curve(points: Sequence[Point], ax: Axes | None = None) -> Axes:
    """Does the error of what was left out fall with the number of runs, and of blocks, learned from?

    The line is the mean of points that hold every program of the study; the others are hollow.
    """
    ((left, right),) = plot.grid(ax, 1, 2, size_inch=(10.0, 4.2), title="Programs left out, by what was learned from")
    needed = {title: {name.replace("_", " ") for name in learned} for title, (learned, _) in STUDIES.items()}
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
    missed = []
    if not args.only_curve:
        machines = learned_machines()
        rows = [row for title, found in machines.items() for row in prediction_rows(title, found)]
        head = ["learned → left out", "what", "measured", "predicted", "error", ""]
        print(markdown(head, [cells for cells, _ in rows]))
        missed = [" ".join(cells) for cells, within in rows if not within]
        for title, found in machines.items():
            held = [f"{log_name(run)} for {run.held_s:.1f} s" for run in found.runs if run.use == "test" and run.held_s]
            unknown = len(found.undetermined)
            print(f"\n{title}: held and not counted: {', '.join(held) or 'none'}; not determined: {unknown}")
            judge_all_runs(title, found)
        if args.plots:
            print(*plot.save_all({"evidence-nist": partial(plot_evidence, machines)}, args.plots))
    if args.curve or args.only_curve:
        points = curve()
        if args.plots:
            print(*plot.save_all({"evidence-nist-runs": partial(plot_curve, points)}, args.plots))
    if missed:
        raise SystemExit("out of the limits:\n" + "\n".join(missed))


if __name__ == "__main__":
    main()
