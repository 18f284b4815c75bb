"""The picture of a calibrated cycle-time model: predicted against measured, by run and by tool."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from shapegcode.results import plot
from shapegcode.results.outcome import Plot
from shapegcode.timing.calibration.result import TOLERANCE_PERCENT, CycleTimeCalibration

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TOOL_PERCENT = 5.0


def plots_of(found: CycleTimeCalibration) -> dict[str, Plot]:
    """Pictures of a calibration, by name."""
    return {"clock": partial(plot_cycle_time_calibration, found)} if any(run.measured_s for run in found.runs) else {}


def plot_cycle_time_calibration(found: CycleTimeCalibration, ax: Axes | None = None) -> Axes:
    """Plot the errors of the calibrated model for whole runs and for their tools, one row for each run (20 at most).

    How to read this: 0 is the measured time; the bands are 2 % for a run and 5 % for a tool's part; a bar is the
    95 % interval.

    Args:
        found: the calibration.
        ax: where to draw; None: a new figure.

    Returns:
        The axes of the plot.
    """
    runs = [run for run in found.runs if run.measured_s is not None and run.measured_s > run.held_s][:20]
    title = f"Predicted against measured: {found.machine}, {found.family}"
    panel = plot.axes(ax, size_inch=(9.0, 1.6 + 0.42 * len(runs)), title=title)
    panel.axvspan(-_TOOL_PERCENT, _TOOL_PERCENT, color=plot.GREY, alpha=0.12, label="5 %, of a tool's share")
    panel.axvspan(-TOLERANCE_PERCENT, TOLERANCE_PERCENT, color=plot.GREY, alpha=0.25, label="2 %, of a run")
    labelled: set[str] = set()

    def once(label: str) -> str | None:
        """The label on first use only, so that the legend has it once."""
        first = label not in labelled
        labelled.add(label)
        return label if first else None

    for row, run in enumerate(runs):
        took = (run.measured_s or 0.0) - run.held_s
        error = 100.0 * (run.predicted_s / took - 1.0)
        reach = 100.0 * (run.high_s - run.predicted_s) / took
        label = once("whole run, with its interval")
        panel.errorbar(error, row, xerr=reach, fmt="o", color=plot.COLOURS[1], capsize=3, label=label)
        if run.cross_validated_percent is not None:
            label = once("whole run, calibrated with the others")
            panel.plot(run.cross_validated_percent, row, "D", color=plot.COLOURS[0], markersize=5, label=label)
        for share in run.tools:
            if share.measured_s > 0.02 * took:
                panel.plot(share.error_percent, row + 0.22, "|", color=plot.COLOURS[2], label=once("tools"))
    panel.set_yticks(
        range(len(runs)),
        [f"{run.name}{' (not fitted)' if run.use == 'test' else ''}\n{run.measured_s:.1f} s" for run in runs],
        fontsize=8,
    )
    panel.set(ylim=(len(runs) - 0.5, -0.5), xlabel="predicted over measured, %")
    plot.legend_below(panel)
    return panel
