"""The pictures of ``shapegcode demo tap``: figures 2 and 3 of Back, Ko and Kim, 2003, and what its spindle deflects."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from shapegcode.demos.tap import TapDemo
from shapegcode.results import plot
from shapegcode.results.result import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_acceleration", "plot_deflection", "plots_of"]

_SHOWN_S = 2.5
_SHOWN_HZ = 20.0


def plots_of(demo: TapDemo) -> dict[str, Plot]:
    """Its pictures by name.

    Args:
        demo: what was worked out.

    Returns:
        What draws each picture, by the name of its file without ending.
    """
    return {
        "paper003-figures2-3-acceleration": partial(plot_acceleration, demo),
        "paper003-deflection": partial(plot_deflection, demo),
    }


def plot_acceleration(demo: TapDemo, ax: Axes | None = None) -> Axes:
    """Acceleration of the 5 kg body after 1 N·s, and its spectrum.

    Args:
        demo: what was worked out.
        ax: where to draw; None: a new figure.

    Returns:
        The panel of the acceleration.
    """
    count = len(demo.acceleration)
    time_s = demo.period_s * np.arange(count)
    frequency = np.fft.rfftfreq(count, demo.period_s)
    amplitude = 2.0 / count * np.abs(np.fft.rfft(demo.acceleration))
    title = "5 kg, 20 N·s/m, 4000 N/m after 1 N·s (figures 2 and 3)"
    ((left, right),) = plot.grid(ax, 1, 2, size_inch=(10.0, 4.0), title=title)
    left.plot(time_s, demo.acceleration, color=plot.COLOURS[1], linewidth=1.2)
    left.set_xlim(0.0, _SHOWN_S)
    left.set_xlabel("time in s")
    left.set_ylabel("acceleration in m/s²")
    right.plot(frequency, amplitude, color=plot.COLOURS[1], linewidth=1.2)
    right.set_xlim(0.0, _SHOWN_HZ)
    right.set_ylim(0.0, 1.15 * float(amplitude.max()))
    right.set_xlabel("frequency in Hz")
    right.set_ylabel("amplitude in m/s²")
    peak = int(np.argmax(amplitude))
    right.annotate(
        f"{demo.system.frequency_hz:.2f} Hz", (frequency[peak], amplitude[peak]), (0, 5), textcoords="offset points",
        ha="center",
    )  # fmt: skip
    return left


def plot_deflection(demo: TapDemo, ax: Axes | None = None) -> Axes:
    """Deflection of end mill and collet in series under 100 N, and the share of each.

    Args:
        demo: what was worked out.
        ax: where to draw; None: a new figure.

    Returns:
        The axes that were drawn into.
    """
    series = demo.series
    panel = plot.axes(ax, size_inch=(9.0, 2.4), title="")
    parts = (
        ("end mill", series.end_mill_um, series.end_mill_share_percent),
        ("collet", series.collet_um, series.collet_share_percent),
    )
    begin = 0.0
    for number, (name, width, share) in enumerate(parts):
        label = f"{name}: {plot.number(width)} µm, {share:.1f} %"
        panel.barh(0.0, width, left=begin, height=0.6, color=plot.COLOURS[number], label=label)
        begin += width
    panel.set_yticks([])
    panel.set_ylim(-0.5, 0.5)
    panel.set_xlabel(f"deflection of the tip under {series.force_n:g} N in µm, end mill on collet")
    plot.legend_above(panel)
    return panel
