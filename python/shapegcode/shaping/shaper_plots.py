"""Pictures of any shapers side by side: taps, sensitivity, steps, and the branches of minimal shapers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shapegcode._core import MinimalBranches, Mode, Shaper
from shapegcode.results import plot
from shapegcode.shaping.bands import ModeBand
from shapegcode.shaping.modal_run import respond, shaped_step

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_branches", "draw_impulses", "draw_sensitivity", "draw_steps", "residual_curve"]

_FREQUENCIES = 601
_PERIODS_IN_DURATION = 2.0
_SAMPLES_OF_A_STEP = 3000
_SWINGS_SHOWN = 3.0  # of the slowest mode, behind the longest shaper


def residual_curve(shaper: Shaper, frequencies_hz: NDArray[np.float64], modes: Sequence[Mode]) -> NDArray[np.float64]:
    """Residual ratio over frequency, with the damping ratios of the modes and between them what lies between."""
    known = sorted((mode.frequency_hz, mode.damping_ratio) for mode in modes) or [(0.0, 0.0)]
    damping = np.interp(frequencies_hz, [frequency for frequency, _ in known], [ratio for _, ratio in known])
    return np.asarray(shaper.residual(frequencies_hz, damping))


def draw_sensitivity(
    shapers: Mapping[str, Shaper],
    bands: Sequence[ModeBand],
    vibration_limit: float | None = None,
    ax: Axes | None = None,
) -> Axes:
    """What is left if the frequency is another one? Residual ratio over frequency, the bands of the modes shaded."""
    panel = plot.axes(ax, size_inch=(9.0, 5.4), title="What is left if the frequency is another one")
    panel.text(
        1.0, 1.01, "a curve that comes down to 0 turns there: an amplitude has no sign", ha="right", fontsize=8,
        color="#555555", transform=panel.transAxes,
    )  # fmt: skip
    longest_s = max(shaper.duration_s for shaper in shapers.values())
    highest = max(
        (band.mode.frequency_hz * (1.0 + band.uncertainty) for band in bands),
        default=_PERIODS_IN_DURATION / longest_s if longest_s > 0.0 else 1.0,
    )
    frequencies_hz = np.linspace(0.0, 1.25 * highest, _FREQUENCIES)[1:]
    modes = [band.mode for band in bands]
    for number, (label, shaper) in enumerate(shapers.items()):
        panel.plot(
            frequencies_hz, 100.0 * residual_curve(shaper, frequencies_hz, modes), label=label,
            color=plot.COLOURS[number % len(plot.COLOURS)], linewidth=1.6,
        )  # fmt: skip
    for band in bands:
        frequency, width = band.mode.frequency_hz, band.mode.frequency_hz * band.uncertainty
        panel.axvspan(frequency - width, frequency + width, color="#e4e4e4", zorder=0)
        panel.axvline(frequency, color=plot.GREY, linewidth=0.8, zorder=0)
        panel.annotate(
            f" mode {frequency:g} Hz" + (f" ±{100.0 * band.uncertainty:g} %" if width else ""), (frequency, 0.97),
            xycoords=panel.get_xaxis_transform(), fontsize=8, color="#555555", va="top",
        )  # fmt: skip
    if vibration_limit is not None:
        panel.axhline(
            100.0 * vibration_limit, color="black", linewidth=1.0, linestyle="--", zorder=1,
            label=f"limit {100.0 * vibration_limit:g} %",
        )  # fmt: skip
    panel.set_ylim(bottom=0.0)
    panel.margins(x=0.01)
    panel.set_xlabel("natural frequency in Hz")
    panel.set_ylabel("residual vibration in %")
    plot.legend_below(panel, columns=3)
    return panel


def draw_impulses(shapers: Mapping[str, Shaper], ax: Axes | None = None) -> Axes:
    """The taps of each shaper, one panel each."""
    rows = plot.grid(
        ax, len(shapers), 1, size_inch=(9.0, 1.2 + 1.35 * len(shapers)), title="Taps", sharex="col"
    )  # fmt: skip
    panels = [row[0] for row in rows]
    unit, scale = _time_unit(max(shaper.duration_s for shaper in shapers.values()))
    for number, (panel, (label, shaper)) in enumerate(zip(panels, shapers.items(), strict=True)):
        colour = plot.COLOURS[number % len(plot.COLOURS)]
        panel.vlines(shaper.times_s * scale, 0.0, shaper.amplitudes, color=colour, linewidth=2.5)
        panel.plot(shaper.times_s * scale, shaper.amplitudes, "o", color=colour, markersize=4)
        panel.axhline(0.0, color="black", linewidth=0.8)
        panel.set_title(label, loc="left", fontsize=9)
        panel.margins(x=0.03, y=0.15)
    panels[-1].set_xlabel(f"time in {unit}")
    return panels[0]


def draw_steps(
    shapers: Mapping[str, Shaper], modes: Sequence[Mode], ax: Axes | None = None, *, unshaped: bool = True
) -> Axes:
    """A shaped unit step (the staircase), and how each mode follows it; grey: unshaped."""
    slowest_s = 1.0 / min(mode.frequency_hz for mode in modes)
    until_s = max(shaper.duration_s for shaper in shapers.values()) + _SWINGS_SHOWN * slowest_s
    period_s = until_s / _SAMPLES_OF_A_STEP
    unit, scale = _time_unit(until_s)
    rows = plot.grid(
        ax, 1 + len(modes), 1, size_inch=(9.0, 2.2 + 1.9 * (1 + len(modes))), sharex="col",
        title="A step behind each shaper, and how the modes follow" + " (grey: unshaped)" * unshaped,
    )  # fmt: skip
    panels = [row[0] for row in rows]
    drawn = [("", Shaper([0.0], [1.0]), plot.GREY)] if unshaped else []
    for number, (label, shaper) in enumerate(shapers.items()):
        drawn.append((label, shaper, plot.COLOURS[number % len(plot.COLOURS)]))
    for label, shaper, colour in drawn:
        run = respond(modes, shaped_step(shaper, period_s, until_s), period_s)
        if label:
            panels[0].plot(run.times_s * scale, run.command, color=colour, linewidth=1.6, label=label)
        for place, panel in enumerate(panels[1:]):
            panel.plot(run.times_s * scale, run.responses[:, place], color=colour, linewidth=1.4 if label else 0.8)
    panels[0].set_ylabel("command")
    for panel, mode in zip(panels[1:], modes, strict=True):
        panel.set_ylabel(f"{mode.frequency_hz:g} Hz")
    panels[-1].set_xlabel(f"time in {unit}")
    panels[-1].margins(x=0.01)
    plot.legend_below(panels[-1], of=panels[0], columns=3)
    return panels[0]


def draw_branches(branches: MinimalBranches, modes: Sequence[Mode], ax: Axes | None = None) -> Axes:
    """Durations of all minimal shapers of two modes over the frequency of the faster one, which a line marks."""
    slow, fast = sorted(mode.frequency_hz for mode in modes)
    panel = plot.axes(ax, size_inch=(9.0, 5.0), title=f"Minimal shapers of two modes, the slower one at {slow:g} Hz")
    negative = (branches.amplitudes < 0.0).any(axis=2)
    durations_s = branches.times_s[..., 2]
    unit, scale = _time_unit(float(np.nanmax(durations_s)))
    for has, colour, label in ((True, plot.COLOURS[0], "a negative tap"), (False, plot.COLOURS[1], "none")):
        curves = np.where(negative == has, durations_s, np.nan)
        panel.plot(branches.ratios * slow, curves.T * scale, color=colour, linewidth=1.4)
        panel.plot([], [], color=colour, label=label)
    panel.axvline(fast, color=plot.GREY, linewidth=0.8, linestyle="--", label=f"the faster mode, {fast:g} Hz")
    panel.set_ylim(bottom=0.0)
    panel.margins(x=0.01)
    panel.set_xlabel("frequency of the faster mode in Hz")
    panel.set_ylabel(f"duration in {unit}")
    plot.legend_below(panel, columns=3)
    return panel


def _time_unit(longest_s: float) -> tuple[str, float]:
    return ("s", 1.0) if longest_s >= 1.0 else ("ms", 1e3)
