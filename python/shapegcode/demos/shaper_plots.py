"""The pictures of ``shapegcode demo shaper``: figures 2 to 6, 8 and 9 of Park, Hong and Danielson, 2009 (paper 002)."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from shapegcode.demos.shaper import ShaperDemo
from shapegcode.demos.stage import MODES
from shapegcode.results import plot
from shapegcode.results.result import Plot
from shapegcode.shaping.bands import ModeBand
from shapegcode.shaping.shaper_plots import draw_branches, draw_impulses, draw_sensitivity, draw_steps

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_branch_amplitudes", "plot_stage", "plots_of"]


def plots_of(demo: ShaperDemo) -> dict[str, Plot]:
    """The paper's figures by name."""
    labelled = {f"{name}, {shaper.duration_s:.4g} s": shaper for name, shaper in demo.shapers.items()}
    minimal = {label: shaper for label, shaper in labelled.items() if len(shaper.times_s) == 3}
    compared = {label: shaper for label, shaper in labelled.items() if not label.startswith("medium")}
    bands = [ModeBand(mode, 0.05) for mode in MODES]
    return {
        "paper002-figure2-durations": partial(draw_branches, demo.branches, MODES),
        "paper002-figure3-amplitudes": partial(plot_branch_amplitudes, demo),
        "paper002-figure4-impulses": partial(draw_impulses, minimal),
        "paper002-figure5-sensitivity": partial(draw_sensitivity, compared, bands, None),
        "paper002-figure6-responses": partial(draw_steps, compared, MODES),
        "paper002-figure8-stage-short": partial(plot_stage, demo, "short"),
        "paper002-figure9-stage-long": partial(plot_stage, demo, "long"),
    }


def plot_branch_amplitudes(demo: ShaperDemo, ax: Axes | None = None) -> Axes:
    """Which taps has the shortest minimal shaper if the second frequency is another one?

    Args:
        demo: of which the branches are drawn.
        ax: where to draw; None: a new figure.

    Returns:
        The axes that were drawn into.
    """
    branches = demo.branches
    shortest = np.nanargmin(branches.times_s[..., 2], axis=0)
    amplitudes = branches.amplitudes[shortest, np.arange(len(shortest))]
    panel = plot.axes(ax, size_inch=(9.0, 4.8), title="Taps of the shortest minimal shaper, the first mode at 1 Hz")
    for tap, label in enumerate(("first tap", "second tap", "third tap")):
        panel.plot(
            branches.ratios * MODES[0].frequency_hz, amplitudes[:, tap], "--" if tap == 2 else "-",
            color=plot.COLOURS[tap], label=label,
        )  # fmt: skip
    panel.axhline(0.0, color="black", linewidth=0.8)
    panel.set_xlabel("second natural frequency in Hz")
    panel.set_ylabel("amplitude")
    plot.legend_below(panel)
    return panel


def plot_stage(demo: ShaperDemo, name: str, ax: Axes | None = None) -> Axes:
    """How do the beams on the stage swing, unshaped and behind a shaper? One panel for each, relative to the stage.

    Args:
        demo: of which the runs are drawn.
        name: of the shaper: "short", "medium", "long" or "convolved ZV".
        ax: whose place is divided; None: a new figure.

    Returns:
        The upper panel.
    """
    rows = plot.grid(
        ax, len(MODES), 1, size_inch=(9.0, 6.2), sharex="col",
        title=f"Stage moves {demo.stage_way_mm:g} mm in {demo.stage_move_s:g} s: {name} shaper",
    )  # fmt: skip
    panels = [row[0] for row in rows]
    for label, colour, width in (("unshaped", plot.GREY, 1.0), (name, plot.COLOURS[1], 1.6)):
        run = demo.runs[label]
        for place, panel in enumerate(panels):
            deflection = run.responses[:, place] - run.command
            panel.plot(run.times_s, np.asarray(deflection), color=colour, linewidth=width, label=label)
    for panel, mode in zip(panels, MODES, strict=True):
        panel.set_ylabel(f"{mode.frequency_hz:g} Hz beam in mm")
    panels[-1].set_xlabel("time in s")
    plot.legend_below(panels[-1])
    return panels[0]
