"""The pictures of ``shapegcode testcut fit``: forces and coefficients of a taper, resultants of corner and interval."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from shapegcode.results import plot as canvas
from shapegcode.testcut.corner import CornerResult, IntervalResult
from shapegcode.testcut.taper import TaperResult

__all__ = ["plot_coefficients", "plot_corner", "plot_interval", "plot_taper", "write_cut_pictures"]

_MEASURED, _EXPECTED = canvas.GREY, canvas.COLOURS[0]


def write_cut_pictures(result: TaperResult | CornerResult | IntervalResult, folder: str | Path) -> list[str]:
    """Write the pictures of a result as PNG and SVG into a folder, which is made where it is missing.

    Raises:
        OSError: the folder cannot be made or a file not be written.
    """
    pictures: dict[str, Callable[[Path], None]]
    if isinstance(result, TaperResult):
        pictures = {
            "forces": lambda file: plot_taper(file, result),
            "coefficients": lambda file: plot_coefficients(file, result),
        }
    elif isinstance(result, CornerResult):
        pictures = {"corner": lambda file: plot_corner(file, result)}
    else:
        pictures = {"interval": lambda file: plot_interval(file, result)}
    return canvas.write_pictures(folder, "testcut", pictures)


def plot_taper(file: str | Path, result: TaperResult) -> None:
    """Mean forces over the radial depth, measured and fitted, one colour per pass.

    Raises:
        OSError: the file cannot be written.
    """
    figure = canvas.figure(8.0, 5.6)
    column = canvas.panels(figure, 2, 1)[0]
    data, fit = result.data, result.fit
    for axis, panel in enumerate(column):
        for group in np.unique(data.group):
            at = np.flatnonzero(data.group == group)
            depth = data.met.radial_depth_mm[at]
            order = np.argsort(depth, kind="stable")
            colour = canvas.COLOURS[int(group) % len(canvas.COLOURS)]
            panel.plot(depth, data.force_n[at, axis], ".", color=colour, markersize=4)
            label = f"{data.feed_mm_per_min[at[0]]:.0f} mm/min"
            panel.plot(depth[order], fit.predicted_n[at, axis][order], "-", color=colour, linewidth=1.0, label=label)
        out = fit.outlier
        if out.any():
            panel.plot(data.met.radial_depth_mm[out], data.force_n[out, axis], "x", color="black", label="left out")
        panel.set_ylabel(("along the feed in N", "to its left in N")[axis])
    column[-1].set_xlabel("radial depth in mm")
    canvas.legend_above(column[0])
    canvas.heading(figure, f"Mean force on the tool, measured (points) and fitted, {fit.rms_percent:.1f} % left", "")
    canvas.save(figure, file)


def plot_coefficients(file: str | Path, result: TaperResult) -> None:
    """k1 and k2 over the chip thickness, with what was known before.

    Raises:
        OSError: the file cannot be written.
    """
    fit = result.fit
    chip = np.geomspace(fit.chip_mm.min(), fit.chip_mm.max(), 60)
    figure = canvas.figure(6.4, 5.0)
    column = canvas.panels(figure, 2, 1)[0]
    laws = (("before", result.cut.tool.cutting, _MEASURED, "--"), ("fitted", fit.cutting(), _EXPECTED, "-"))
    keys = (("specific_n_per_mm2", "specific_exponent"), ("ratio", "ratio_exponent"))
    for panel, (factor, exponent), label in zip(column, keys, ("k1 in N/mm²", "k2"), strict=True):
        for name, law, colour, style in laws:
            panel.plot(1e3 * chip, law[factor] * chip ** law[exponent], style, color=colour, label=name)
        panel.set_ylabel(label)
    column[-1].set_xlabel("mean chip thickness in µm")
    canvas.legend_above(column[0])
    canvas.heading(figure, "Coefficients of the cutting force", "")
    canvas.save(figure, file)


def plot_corner(file: str | Path, result: CornerResult) -> None:
    """Mean and largest resultant along each pass, measured and expected.

    Raises:
        OSError: the file cannot be written.
    """
    figure = canvas.figure(8.0, 1.4 + 2.4 * len(result.passes))
    column = canvas.panels(figure, len(result.passes), 1)[0]
    for panel, (number, record, hoped) in zip(column, result.passes, strict=True):
        panel.plot(record.x_mm, record.resultant_n, color=_MEASURED, linewidth=2.0, label="measured, mean")
        panel.plot(record.x_mm, record.peak_n, color=_MEASURED, linewidth=0.8, label="measured, peak")
        panel.plot(hoped.x_mm, hoped.mean_resultant_n, color=_EXPECTED, linewidth=1.4, label="expected, mean")
        panel.plot(hoped.x_mm, hoped.peak_resultant_n, color=_EXPECTED, linewidth=0.8, label="expected, peak")
        panel.set_ylabel(f"pass {number} in N")
    column[-1].set_xlabel("X of the tool's axis in mm")
    canvas.legend_above(column[0])
    canvas.heading(figure, "Resultant in the unrolled corner", "")
    canvas.save(figure, file)


def plot_interval(file: str | Path, result: IntervalResult) -> None:
    """Resultant over time of each pass: measured, at the commanded feeds, and with the lag that fits best.

    Raises:
        OSError: the file cannot be written.
    """
    figure = canvas.figure(8.0, 1.4 + 2.2 * len(result.passes))
    column = canvas.panels(figure, len(result.passes), 1)[0]
    for panel, each in zip(column, result.passes, strict=True):
        panel.plot(each.time_s, each.force_n, color=_MEASURED, linewidth=2.0, label="measured")
        panel.plot(each.time_s, each.immediate_n, color=_EXPECTED, linewidth=1.1, label="feed as commanded")
        label = f"lag of {1e3 * each.lag_s:.0f} ms"
        panel.plot(each.time_s, each.lagging_n, "--", color=canvas.COLOURS[1], linewidth=1.1, label=label)
        panel.set_ylabel(f"{each.interval_mm:g} mm: N")
        canvas.legend_above(panel)
    column[-1].set_xlabel("time in s")
    canvas.heading(figure, "Mean resultant at feeds that change every so often", "")
    canvas.save(figure, file)
