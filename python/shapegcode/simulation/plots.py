"""The pictures of a simulation: the motion of each axis over time, and the region with most vibration."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shapegcode.io.units import FloatArray
from shapegcode.results import plot
from shapegcode.results.motion_plots import MOVES_MM
from shapegcode.results.outcome import Plot
from shapegcode.results.path_plots import RECORD_SAMPLES, SimulatedRegion, motion_pictures
from shapegcode.simulation.result import Motion, Simulation

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_COMMAND, _RESPONSE = plot.COLOURS[1], plot.COLOURS[0]
_DENSE = 0.2  # median width of a dense band, relative to the range of its curve
# Label of the axis, factor from the curve's own unit, and curves: number, colour, name.
_Row = tuple[str, float, tuple[tuple[int, str, str], ...]]
_ROWS: tuple[_Row, ...] = (
    ("position\nin mm", 1.0, ((0, _COMMAND, "command"), (1, _RESPONSE, "response"))),
    ("speed\nin m/min", 0.06, ((2, _COMMAND, "command"),)),
    ("acceleration\nin m/s²", 1e-3, ((3, _COMMAND, "command"),)),
    ("response − command\nin µm", 1e3, ((4, _RESPONSE, "response"),)),
    ("force\nin N", 1.0, ((5, plot.COLOURS[2], "motor"), (6, plot.COLOURS[3], "friction"))),
)


def plots_of(simulation: Simulation) -> dict[str, Plot]:
    """Pictures of a simulation, by name."""
    found: dict[str, Plot] = {}
    if simulation.motion is not None:
        found["motion"] = partial(plot_motion, simulation.motion)
    if simulation.regions:
        found |= motion_pictures(partial(_worst_region, simulation))
    return found


def _worst_region(simulation: Simulation) -> SimulatedRegion:
    run = max(simulation.regions, key=lambda each: max(each.residual_vibration_um))
    runs = {"program": run.replay(RECORD_SAMPLES)}
    return SimulatedRegion.of_runs(runs, run.path, run.period_s, lines=run.lines, regions=len(simulation.regions))


def plot_motion(motion: Motion, ax: Axes | None = None) -> Axes:
    """Plot the motion of each axis, and the deviation of table from command.

    One column for each axis that moves. A long motion is drawn as the band between minimum and maximum of
    each interval, so that no peak is lost.

    Args:
        motion: the simulated motion.
        ax: where to draw; None: a new figure.

    Returns:
        The first panel.
    """
    low, high = motion.low, motion.high
    travel = high[:, 0].max(axis=0) - low[:, 0].min(axis=0)
    moving = [axis for axis in range(3) if travel[axis] > MOVES_MM] or [0]
    shown = _ROWS if motion.largest_motor_force_n is not None else _ROWS[:-1]
    part = Path(motion.program).name + ("" if motion.lines is None else ", lines {} to {}".format(*motion.lines))
    size_inch = (3.4 + 3.6 * len(moving), 1.6 + 1.7 * len(shown))
    rows = plot.grid(
        ax, len(shown), len(moving), size_inch=size_inch, title="Motion of the axes", part=part, sharex="col"
    )
    for panels, (label, factor, curves) in zip(rows, shown, strict=True):
        for panel, axis in zip(panels, moving, strict=True):
            panel.margins(x=0.01)
            for number, colour, name in curves:
                of = (slice(None), number, axis)
                _band(panel, motion.times_s, factor * low[of], factor * high[of], colour, name)
        panels[0].set_ylabel(label)
        if len(curves) > 1:
            plot.legend_above(panels[0])
    for top, lowest, axis in zip(rows[0], rows[-1], moving, strict=True):
        top.set_title("XYZ"[axis], loc="right", fontsize=10)
        lowest.set_xlabel("time in s")
    rows[0][0].figure.align_ylabels([panels[0] for panels in rows])
    return rows[0][0]


def _band(panel: Axes, times: FloatArray, low: FloatArray, high: FloatArray, colour: str, name: str) -> None:
    """A curve, or the band of several samples; a wide one is light, so that it does not look solid."""
    width = high - low
    tall = float(high.max() - low.min())
    dense = tall > 0 and float(np.median(width)) > _DENSE * tall
    if width.any():
        panel.fill_between(times, low, high, color=colour, alpha=0.3 if dense else 1.0, linewidth=0)
    if dense:
        panel.plot(times, np.array([low, high]).T, color=colour, linewidth=0.5)
        panel.plot([], [], color=colour, alpha=0.4, linewidth=6, label=f"{name}, minimum to maximum of each interval")
    else:
        panel.plot(times, (low + high) / 2, color=colour, linewidth=0.9, label=name)
