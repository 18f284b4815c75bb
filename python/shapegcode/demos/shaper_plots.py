"""The pictures of ``shapegcode demo shaper``: figures 2 to 6, 8 and 9 of paper 002."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from shapegcode._core import MinimalBranches
from shapegcode.demos.shaper import MODES, ShaperDemo
from shapegcode.results import plot as canvas
from shapegcode.shaping.bands import ModeBand
from shapegcode.shaping.modal_run import ModalRun
from shapegcode.shaping.plots import plot_branches, plot_impulses, plot_sensitivity, plot_steps

__all__ = ["plot_branch_amplitudes", "plot_stage", "write_demo_pictures"]


def write_demo_pictures(demo: ShaperDemo, folder: str | Path) -> list[str]:
    """Write the pictures as PNG and SVG into a folder, which is made where it is missing.

    Returns:
        The files written.

    Raises:
        OSError: the folder cannot be made or a file not be written.
    """
    labelled = {f"{name}, {shaper.duration_s:.4g} s": shaper for name, shaper in demo.shapers.items()}
    minimal = {label: shaper for label, shaper in labelled.items() if len(shaper.times_s) == 3}
    compared = {label: shaper for label, shaper in labelled.items() if not label.startswith("medium")}
    bands = [ModeBand(mode, 0.05) for mode in MODES]
    pictures: dict[str, Callable[[Path], None]] = {
        "figure2-durations": lambda file: plot_branches(file, demo.branches, MODES),
        "figure3-amplitudes": lambda file: plot_branch_amplitudes(file, demo.branches),
        "figure4-impulses": lambda file: plot_impulses(file, minimal),
        "figure5-sensitivity": lambda file: plot_sensitivity(file, compared, bands),
        "figure6-responses": lambda file: plot_steps(file, compared, MODES),
        "figure8-stage-short": lambda file: plot_stage(file, demo.runs, "short"),
        "figure9-stage-long": lambda file: plot_stage(file, demo.runs, "long"),
    }
    return canvas.write_pictures(folder, "paper002", pictures)


def plot_branch_amplitudes(file: str | Path, branches: MinimalBranches) -> None:
    """Amplitudes of the shortest minimal shaper over the second frequency.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    shortest = np.nanargmin(branches.times_s[..., 2], axis=0)
    amplitudes = branches.amplitudes[shortest, np.arange(len(shortest))]
    figure = canvas.figure(9.0, 4.5)
    panel = canvas.panels(figure, 1, 1)[0][0]
    for tap, label in enumerate(("first tap", "second tap", "third tap")):
        panel.plot(
            branches.ratios * MODES[0].frequency_hz, amplitudes[:, tap], "--" if tap == 2 else "-",
            color=canvas.COLOURS[tap], label=label,
        )  # fmt: skip
    panel.axhline(0.0, color="black", linewidth=0.8)
    panel.set_xlabel("second natural frequency in Hz")
    panel.set_ylabel("amplitude")
    canvas.legend_above(panel)
    canvas.heading(figure, "Taps of the shortest minimal shaper, the first mode at 1 Hz (figure 3)", "")
    canvas.save(figure, file)


def plot_stage(file: str | Path, runs: dict[str, ModalRun], name: str) -> None:
    """The beams on the stage relative to it, unshaped and behind a shaper.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    figure = canvas.figure(9.0, 6.0)
    column = canvas.panels(figure, len(MODES), 1)[0]
    for label, colour, width in (("unshaped", canvas.GREY, 1.0), (name, canvas.COLOURS[1], 1.6)):
        run = runs[label]
        for place, panel in enumerate(column):
            deflection = run.responses[:, place] - run.command
            panel.plot(run.times_s, np.asarray(deflection), color=colour, linewidth=width, label=label)
    for panel, mode in zip(column, MODES, strict=True):
        panel.set_ylabel(f"{mode.frequency_hz:g} Hz beam in mm")
    column[-1].set_xlabel("time in s")
    canvas.legend_above(column[0])
    number = {"short": "8", "long": "9"}.get(name, "8 and 9")
    canvas.heading(figure, f"Stage moves 200 mm in 3 s: {name} minimal shaper (figure {number})", "")
    canvas.save(figure, file)
