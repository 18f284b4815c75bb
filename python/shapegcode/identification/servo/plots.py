"""The pictures of a servo log: the control's contour deviation, and the model's residual."""

from functools import partial
from pathlib import Path

from matplotlib.axes import Axes

from shapegcode.identification.servo.result import ServoFit
from shapegcode.results import plot
from shapegcode.results.outcome import Plot

_OWN, _OURS = "control: contour deviation", "residual of the best model, fitted to the other half"


def plots_of(found: ServoFit) -> dict[str, Plot]:
    """Pictures of a servo log, by name."""
    return {"servo": partial(plot_servo, found)} if any(axis.models for axis in found.axes) else {}


def plot_servo(found: ServoFit, ax: Axes | None = None) -> Axes:
    """One panel per axis: the control's contour deviation; the best model's residual in samples not used for its fit.

    Args:
        found: fit of the log.
        ax: where to draw; None: a new figure.

    Returns:
        The first panel.
    """
    shown = [axis for axis in found.axes if axis.models and axis.curves is not None]
    title, size_inch = f"Deviation of each axis: {Path(found.source).name}", (9.0, 0.8 + 1.3 * len(shown))
    panels = [row[0] for row in plot.grid(ax, len(shown), 1, size_inch=size_inch, title=title, sharex=True)]
    for panel, axis in zip(panels, shown, strict=True):
        curves = axis.curves
        assert curves is not None
        for rank, time in enumerate(curves.time_s):
            own, ours = (_OWN, _OURS) if rank == 0 else (None, None)
            if curves.deviation is not None:
                panel.plot(time, 1e3 * curves.deviation[rank], color=plot.GREY, linewidth=0.8, label=own)
            panel.plot(time, 1e3 * curves.rest[rank], color=plot.COLOURS[0], linewidth=0.8, label=ours)
        panel.set_ylabel(f"{axis.name}, {axis.small_unit}")
    panels[-1].set_xlabel("time in s")
    plot.legend_above(panels[0])
    return plot.aligned(panels)
