"""The pictures of ``shapegcode study``: influence of each value (tornado), measures over the most influential (bands).

The picture of ``shapegcode optimize``: time and probability of the combinations.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from shapegcode.results import plot
from shapegcode.results.outcome import Plot
from shapegcode.studies.replay import MEASURES, SHARE
from shapegcode.studies.result import Bins, MachineStudy, Optimum

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plots_of(study: MachineStudy | Optimum) -> dict[str, Plot]:
    """Pictures of a study or an optimisation, by name."""
    if isinstance(study, Optimum):
        return {"optimum-choices": partial(plot_choices, study)}
    return {"study-tornado": partial(plot_tornado, study), "study-bands": partial(plot_bands, study)}


def plot_tornado(study: MachineStudy, ax: Axes | None = None) -> Axes:
    """Plot the influence of at most 12 values: bars from the smallest to the largest median of the ratio to the limit.

    Args:
        study: the study.
        ax: where to draw; None: a new figure.

    Returns:
        The panel.
    """
    rows = study.parameter_sensitivity[:12]
    panel = plot.axes(
        ax,
        size_inch=(9.0, 1.6 + 0.4 * len(rows)),
        title=f"Influence on the verdict: {Path(study.program).name} on {study.machine}",
    )
    whole = study.quantity(SHARE)
    for place, row in enumerate(rows):
        panel.barh(place, row.high - row.low, left=row.low, height=0.6, color=plot.COLOURS[1])
        plot.note(panel, row.low_at, row.low, place, shift=-4)
        plot.note(panel, row.high_at, row.high, place)
    panel.axvline(whole.p50, color=plot.GREY, linewidth=1.0)
    panel.axvline(1.0, color=plot.COLOURS[0], linewidth=1.0, linestyle="--")
    panel.annotate(
        "limit", (1.0, 1.0), xycoords=("data", "axes fraction"), xytext=(-3, -3), textcoords="offset points",
        fontsize=8, color=plot.COLOURS[0], va="top", ha="right",
    )  # fmt: skip
    _name_rows(panel, [row.key for row in rows])
    low, high = min(row.low for row in rows), max(1.0, *(row.high for row in rows))
    panel.set_xlim(low - 0.15 * (high - low), high + 0.15 * (high - low))
    panel.set_xlabel("ratio to the limit, median (grey: of all samples)")
    return panel


def plot_choices(found: Optimum, ax: Axes | None = None) -> Axes:
    """Plot cycle time and probability of the shortest combinations; the best one has the full colour.

    Args:
        found: the result of `optimize`.
        ax: where to draw; None: a new figure.

    Returns:
        The panel.
    """
    rows = found.shown
    panel = plot.axes(
        ax, size_inch=(9.0, 1.6 + 0.35 * len(rows)), title=f"Choices: {Path(found.program).name} on {found.machine}"
    )
    times_s = [each.time_s or 0.0 for each in rows]
    for place, (row, time_s) in enumerate(zip(rows, times_s, strict=True)):
        share = row.checked if row.checked is not None else row.within
        longer_ms = 1e3 * (time_s - times_s[0])
        panel.barh(place, longer_ms, height=0.6, color=plot.COLOURS[1] if row == found.best else plot.COLOURS[5])
        label = f"{time_s:.3f} s, " + ("not simulated" if share is None else f"within tolerance on {share * 100:.1f} %")
        plot.note(panel, label, longer_ms, place, fontweight="bold" if row == found.best else "normal")
    _name_rows(panel, [", ".join(each.value for each in row.values) for row in rows])
    panel.set_xlim(0.0, 1.5 * max(1.0, 1e3 * (times_s[-1] - times_s[0])))
    panel.set_ylabel(", ".join(each.key.rpartition(".")[2] for each in rows[0].values), fontsize=8)
    panel.set_xlabel("time above that of the shortest in ms (bold: the best)")
    return panel


def plot_bands(study: MachineStudy, ax: Axes | None = None) -> Axes:
    """Plot measures over the most influential value: median, and the band that contains 90 % of the samples.

    Args:
        study: the study.
        ax: where to draw; None: a new figure.

    Returns:
        The uppermost panel.
    """
    key = study.parameter_sensitivity[0].key
    curves = [bins for bins in study.curves if bins.key == key and bins.measure != SHARE][:3]
    curves = curves or [bins for bins in study.curves if bins.key == key]
    panels = plot.column(
        ax, len(curves), size_inch=(8.0, 1.0 + 2.1 * len(curves)), part="median, and the band that contains 90 %",
        title=f"{study.n} machines: {Path(study.program).name} on {study.machine}",
    )  # fmt: skip
    for panel, bins in zip(panels, curves, strict=True):
        _band(panel, bins)
        limit = study.limits_um.get(bins.measure)
        if limit is not None and limit < 3.0 * max(each.high for each in bins.bins):
            panel.axhline(limit, color=plot.COLOURS[0], linewidth=1.0, linestyle="--")
        unit = study.quantity(bins.measure).unit
        panel.set_title(f"{MEASURES[bins.measure]}, {unit}".rstrip(", "), loc="left", fontsize=10)
    unit = next(each.unit for each in study.varied if each.key == key)
    panels[-1].set_xlabel(f"{key}{f' in {unit}' if unit not in ('', '1') else ''}")
    return plot.aligned(panels)


def _name_rows(panel: Axes, names: Sequence[str]) -> None:
    panel.set_yticks(range(len(names)), names, fontsize=8)
    panel.set_ylim(len(names) - 0.4, -0.6)


def _band(panel: Axes, bins: Bins) -> None:
    positions = [each.at for each in bins.bins]
    low, middle, high = ([getattr(each, name) for each in bins.bins] for name in ("low", "median", "high"))
    if bins.numbers and len(positions) > 1:
        panel.fill_between(positions, low, high, color=plot.COLOURS[5], alpha=0.5, linewidth=0.0)
        panel.plot(positions, middle, color=plot.COLOURS[1])
        return
    for position, bottom, at, top in zip(positions, low, middle, high, strict=True):
        panel.plot([position, position], [bottom, top], color=plot.COLOURS[5], linewidth=8.0, solid_capstyle="butt")
        panel.plot([position], [at], color=plot.COLOURS[1], marker="o")
    if not bins.numbers:
        panel.set_xticks(positions, [each.name for each in bins.bins])
        panel.margins(x=0.25)
