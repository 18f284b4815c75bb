"""The picture of a played motion: position, speed, acceleration, vibration and forces of each axis over time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shapegcode.results import plot as canvas
from shapegcode.results.motion_pictures import RECORD_SAMPLES, PlayedRegion, motion_pictures
from shapegcode.simulation.motion import MotionTraces
from shapegcode.simulation.simulate import Simulation

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_motion", "write_motion_pictures"]

FloatArray = npt.NDArray[np.float64]

_COMMAND, _RESPONSE = canvas.COLOURS[1], canvas.COLOURS[0]
_MOVES_MM = 1e-9
# Label of the axis, factor from the curve's own unit, and which curves it shows: number, colour, name.
_Row = tuple[str, float, tuple[tuple[int, str, str], ...]]
_ROWS: tuple[_Row, ...] = (
    ("position\nin mm", 1.0, ((0, _COMMAND, "command"), (1, _RESPONSE, "response"))),
    ("speed\nin m/min", 0.06, ((2, _COMMAND, "command"),)),
    ("acceleration\nin m/s²", 1e-3, ((3, _COMMAND, "command"),)),
    ("response − command\nin µm", 1e3, ((4, _RESPONSE, "response"),)),
)
_DRIVE_ROWS: tuple[_Row, ...] = (
    ("force\nin N", 1.0, ((5, canvas.COLOURS[2], "motor"), (6, canvas.COLOURS[3], "friction"))),
)


def write_motion_pictures(traces: MotionTraces, folder: str | Path, part: str) -> list[str]:
    """Write ``motion.png`` and ``motion.svg`` into a folder, which is made where it is missing.

    Args:
        traces: what passed by; one sample or more.
        folder: where to.
        part: which program, and which part of it, for the title.

    Returns:
        The files written.

    Raises:
        OSError: the folder cannot be made or a file not be written.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"motion{suffix}" for suffix in canvas.FORMATS]
    for file in files:
        plot_motion(file, traces, part)
    return [str(file) for file in files]


def plot_motion(file: str | Path, traces: MotionTraces, part: str) -> None:
    """How does each axis move, and how far is the table from its command?

    One column for each axis that moves. A long motion is drawn as the band between the least and the largest value of
    each stretch of time, so that no peak is lost.

    Args:
        file: ``.png`` or ``.svg``.
        traces: what passed by; one sample or more.
        part: which program, and which part of it, for the title.

    Raises:
        ValueError: a wrong ending, or no sample.
        OSError: the file cannot be written.
    """
    times, low, high = traces.result()
    travel = high[:, 0].max(axis=0) - low[:, 0].min(axis=0)
    moving = [axis for axis in range(3) if travel[axis] > _MOVES_MM] or [0]
    rows = [*_ROWS, *(_DRIVE_ROWS if traces.driven else ())]
    figure = canvas.figure(3.4 + 3.6 * len(moving), 1.6 + 1.7 * len(rows))
    grid = canvas.panels(figure, len(rows), len(moving))
    for panels, axis in zip(grid, moving, strict=True):
        for panel, (_, factor, curves) in zip(panels, rows, strict=True):
            for number, colour, name in curves:
                _band(panel, times, factor * low[:, number, axis], factor * high[:, number, axis], colour, name)
            if len(curves) > 1 and axis == moving[0]:
                canvas.legend_above(panel)
        panels[0].set_title("XYZ"[axis], loc="right", fontsize=10)
        panels[-1].set_xlabel("time in s")
    for panel, (label, _, _) in zip(grid[0], rows, strict=True):
        panel.set_ylabel(label)
    canvas.heading(figure, "Motion of the axes", part)
    figure.align_ylabels(grid[0])
    canvas.save(figure, file)


def _band(panel: Axes, times: FloatArray, low: FloatArray, high: FloatArray, colour: str, name: str) -> None:
    """A curve, or the band that it fills where a stretch of time holds several samples; never thinner than a line."""
    if not np.array_equal(low, high):
        panel.fill_between(times, low, high, color=colour, linewidth=0)
    panel.plot(times, (low + high) / 2, color=colour, linewidth=0.9, label=name)


def write_simulation_pictures(simulation: Simulation, folder: str | Path) -> list[str]:
    """Path, feed and vibration of the region that vibrates most after its stop.

    Returns:
        The files written; none for a program without cutting regions.

    Raises:
        OSError: the folder cannot be made or a file not be written.
    """
    if not simulation.regions:
        return []
    run = max(simulation.regions, key=lambda each: float(each.figures.residual_mm.max()))

    def played() -> PlayedRegion:
        runs = {"program": simulation.play(run, record_samples=RECORD_SAMPLES)}
        lines = (run.first_line, run.last_line)
        return PlayedRegion.of_runs(runs, run.path, run.period_s, lines=lines, regions=len(simulation.regions))

    return canvas.save_all(motion_pictures(played), folder)
