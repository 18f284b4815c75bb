"""The picture of ``shapegcode demo evidence``: predicted over measured for every run and tool."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from shapegcode.demos.evidence import TOOL_PERCENT, EvidenceDemo
from shapegcode.results import plot
from shapegcode.results.result import Plot
from shapegcode.timing.calibration.result import TOLERANCE_PERCENT

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_evidence", "plots_of"]


def plots_of(demo: EvidenceDemo) -> dict[str, Plot]:
    """Its picture by name.

    Args:
        demo: what was worked out.

    Returns:
        What draws it, by the name of its file without ending.
    """
    return {"evidence-nist": partial(plot_evidence, demo)}


def plot_evidence(demo: EvidenceDemo, ax: Axes | None = None) -> Axes:
    """How far are the learned machines off? One row for each run, below the programs that were learned from.

    How to read this: 0 is what the machine took; the bands are 2 % for a run and 5 % for a tool's share; a bar is the
    95 % interval. Hollow: a run that was learned from.

    Args:
        demo: what was worked out.
        ax: where to draw; None: a new figure.

    Returns:
        The axes drawn into.
    """
    rows = [
        (study.title, run)
        for study in demo.studies
        for run in sorted(study.runs, key=lambda run: run.use == "fit")
        if run.measured_s is not None
    ]
    panel = plot.axes(
        ax, size_inch=(9.0, 1.8 + 0.27 * len(rows)), title="Predicted over measured, NIST's test bed: every run at hand"
    )
    panel.axvspan(-TOOL_PERCENT, TOOL_PERCENT, color=plot.GREY, alpha=0.12, label="5 %, of a tool")
    panel.axvspan(-TOLERANCE_PERCENT, TOLERANCE_PERCENT, color=plot.GREY, alpha=0.25, label="2 %, of a run")
    labelled: set[str] = set()
    names = []
    for place, (title, run) in enumerate(rows):
        left_out = run.use == "test"
        took = (run.measured_s or 0.0) - run.held_s
        kind = "left out, with 95 % interval" if left_out else "learned from"
        reach = 100.0 * (run.high_s - run.predicted_s) / took if left_out else None
        panel.errorbar(
            run.error_percent or 0.0, place, xerr=reach, fmt="o", capsize=3, markersize=6,
            color=plot.COLOURS[1], markerfacecolor=plot.COLOURS[1] if left_out else "white",
            label=None if kind in labelled else kind,
        )  # fmt: skip
        labelled.add(kind)
        for share in run.tools:
            panel.plot(
                share.error_percent, place, "|", color=plot.COLOURS[0], markersize=9, markeredgewidth=1.6,
                alpha=1.0 if left_out else 0.4, label=None if "tools" in labelled else "its tools",
            )  # fmt: skip
            labelled.add("tools")
        held = f", held {run.held_s:.1f} s" if run.held_s else ""
        names.append(f"{run.log.split('.')[0]}: {run.measured_s:.1f} s{held}")
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
