"""The pictures of ``shapegcode testcut fit``: forces and coefficients of a taper, resultants of corner and interval."""

from collections.abc import Mapping
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from shapegcode.results import plot
from shapegcode.results.outcome import Plot
from shapegcode.testcut.result import CornerResult, IntervalResult, TaperResult

_MEASURED, _EXPECTED, _LAGGING = plot.GREY, plot.COLOURS[0], plot.COLOURS[1]


def plots_of(result: TaperResult | CornerResult | IntervalResult) -> Mapping[str, Plot]:
    """Pictures of a result, by name."""
    if isinstance(result, TaperResult):
        return {
            "testcut-forces": partial(plot_taper, result),
            "testcut-coefficients": partial(plot_coefficients, result),
        }
    if isinstance(result, CornerResult):
        return {"testcut-corner": partial(plot_corner, result)}
    return {"testcut-interval": partial(plot_interval, result)}


def _column(ax: Axes | None, rows: int, height: float, title: str, xlabel: str, width: float = 8.0) -> list[Axes]:
    panels = plot.column(ax, rows, size_inch=(width, height), title=title, xlabel=xlabel)
    for panel in panels:
        panel.margins(x=0.01)
    return panels


def plot_taper(result: TaperResult, ax: Axes | None = None) -> Axes:
    """Mean forces over the radial depth, measured and fitted, one colour per pass.

    Args:
        result: result of a taper.
        ax: where to draw; None: a new figure.

    Returns:
        The upper panel: forces along the feed.
    """
    data, fit = result.data, result.fit
    title = f"Mean force on the tool, measured (points) and fitted, residual {fit.rms_percent:.1f} %"
    panels = _column(ax, 2, 5.6, title, "radial depth in mm")
    for axis, panel in enumerate(panels):
        for group in np.unique(data.group):
            at = np.flatnonzero(data.group == group)
            depth = data.met.radial_depth_mm[at]
            order = np.argsort(depth, kind="stable")
            colour = plot.COLOURS[int(group) % len(plot.COLOURS)]
            panel.plot(depth, data.force_n[at, axis], ".", color=colour, markersize=4)
            label = f"{data.feed_mm_per_min[at[0]]:.0f} mm/min"
            panel.plot(depth[order], fit.predicted_n[at, axis][order], "-", color=colour, linewidth=1.0, label=label)
        out = fit.outlier
        if out.any():
            panel.plot(data.met.radial_depth_mm[out], data.force_n[out, axis], "x", color="black", label="ignored")
        panel.set_ylabel(("along the feed in N", "to its left in N")[axis])
    plot.legend_above(panels[0])
    return panels[0]


def plot_coefficients(result: TaperResult, ax: Axes | None = None) -> Axes:
    """k1 and k2 over the chip thickness, with those of the force law known before the test cut.

    Args:
        result: result of a taper.
        ax: where to draw; None: a new figure.

    Returns:
        The upper panel: k1.
    """
    chip = np.geomspace(result.chip_mm.min, result.chip_mm.max, 60)
    panels = _column(ax, 2, 5.0, "Coefficients of the cutting force", "mean chip thickness in µm", 6.4)
    for name, law, colour, style in (
        ("before", result.cut.tool.cutting, _MEASURED, "--"),
        ("fitted", result.cutting, _EXPECTED, "-"),
    ):
        curves = (law.specific_n_per_mm2 * chip**law.specific_exponent, law.ratio * chip**law.ratio_exponent)
        for panel, curve in zip(panels, curves, strict=True):
            panel.plot(1e3 * chip, curve, style, color=colour, label=name)
    for panel, label in zip(panels, ("k1 in N/mm²", "k2"), strict=True):
        panel.set_ylabel(label)
    plot.legend_above(panels[0])
    return panels[0]


def plot_corner(result: CornerResult, ax: Axes | None = None) -> Axes:
    """Mean and largest resultant along each pass, measured and expected.

    Args:
        result: result of a corner.
        ax: where to draw; None: a new figure.

    Returns:
        The panel of the first pass.
    """
    title, xlabel = "Resultant in the unrolled corner", "X of the tool's axis in mm"
    panels = _column(ax, len(result.peaks), 1.4 + 2.4 * len(result.peaks), title, xlabel)
    for panel, each in zip(panels, result.peaks, strict=True):
        record, forecast = each.record, each.forecast
        panel.plot(record.x_mm, record.resultant_n, color=_MEASURED, linewidth=2.0, label="measured, mean")
        panel.plot(record.x_mm, record.peak_n, color=_MEASURED, linewidth=0.8, label="measured, peak")
        panel.plot(forecast.x_mm, forecast.mean_resultant_n, color=_EXPECTED, linewidth=1.4, label="expected, mean")
        panel.plot(forecast.x_mm, forecast.peak_resultant_n, color=_EXPECTED, linewidth=0.8, label="expected, peak")
        panel.set_ylabel(f"pass {each.number} in N")
    plot.legend_above(panels[0])
    return panels[0]


def plot_interval(result: IntervalResult, ax: Axes | None = None) -> Axes:
    """Resultant over time of each pass: measured, at the commanded feeds, and with the best lag.

    Args:
        result: result of an interval test.
        ax: where to draw; None: a new figure.

    Returns:
        The panel of the shortest interval.
    """
    title = "Mean resultant with changing feed"
    panels = _column(ax, len(result.passes), 1.4 + 2.2 * len(result.passes), title, "time in s")
    for panel, each in zip(panels, result.passes, strict=True):
        panel.plot(each.time_s, each.force_n, color=_MEASURED, linewidth=2.0, label="measured")
        panel.plot(each.time_s, each.immediate_n, color=_EXPECTED, linewidth=1.1, label="feed as commanded")
        label = f"lag of {1e3 * each.lag_s:.0f} ms"
        panel.plot(each.time_s, each.lagging_n, "--", color=_LAGGING, linewidth=1.1, label=label)
        panel.set_ylabel(f"{each.interval_mm:g} mm: N")
        plot.legend_above(panel)
    return panels[0]
