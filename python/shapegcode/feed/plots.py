"""The pictures of ``shapegcode feed``: the curves along the path, the path coloured by force, and the wall."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.feed.schedule import FeedSchedule
from shapegcode.feed.traces import FeedTraces, WallMaps, envelope, feed_traces, groups, wall_maps
from shapegcode.results import plot as canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot_along_path", "plot_path", "plot_surface", "wall_figure", "write_feed_pictures"]

Vector = npt.NDArray[np.float64]

_BEFORE, _AFTER = canvas.COLOURS[0], canvas.COLOURS[1]
_LIMIT = "#000000"
_BEYOND = canvas.COLOURS[0]
_BANDS = 1500
_PIECES = 20000
_LOGARITHMIC = 8.0  # ratio of the largest feed to the least in material from which on the axis is logarithmic
_MINOR = "235"  # first digits of the numbers that a logarithmic axis shows between powers of ten
_AIR_MM2 = 1e-9
_STACKED = 1.9  # width over height of the part from which on the two paths stand below each other
_MARGIN = 0.03  # around the part, of its longer side
_GROUND = 300  # cells of the ground along the longer side
_LOADS = (
    ("peak_resultant_n", "resultant, peak\nin N", "N"),
    ("mean_resultant_n", "resultant, mean of\na revolution, in N", "N"),
    ("peak_deflection_um", "deflection of\nthe tip in µm", "µm"),
    ("peak_torque_nm", "torque, peak\nin N m", "N m"),
    ("mean_power_w", "power in W", "W"),
)
_ALWAYS = ("peak_resultant_n", "mean_resultant_n")


def write_feed_pictures(result: FeedSchedule, folder: str | Path) -> list[str]:
    """Write the pictures of a schedule as PNG and SVG into a folder, which is made where it is missing.

    `feed-along-path`: engagement, feed and loads over the distance along the cutting path; `feed-path`: the path
    coloured by the peak resultant before and after; `feed-surface`: the form error of the walls, where walls are made.

    Returns:
        The files written; none where no cutting force is known.

    Raises:
        OSError: the folder cannot be made or a file not be written.
    """
    if all(load is None for load in result.loads):
        return []
    traces = feed_traces(result)
    part = _summary(result)
    pictures: dict[str, Callable[[Path], None]] = {
        "along-path": lambda file: plot_along_path(file, traces, part),
        "path": lambda file: plot_path(file, traces, result.survey.material, part),
    }
    walls = wall_maps(result, traces)
    if walls is not None:
        pictures["surface"] = lambda file: plot_surface(file, walls, part)
    return canvas.write_pictures(folder, "feed", pictures)


def _summary(result: FeedSchedule) -> str:
    report = result.report
    peak, time = report["resultant_force_n"], report["cycle_time_s"]
    return (
        f"{Path(report['program']).name}, {', '.join(report['tools'])}: peak resultant {peak['before']['max']:.3g} → "
        f"{peak['after']['max']:.3g} N, cycle time {time['before']:.4g} → {time['after']:.4g} s"
    )


def plot_along_path(file: str | Path, traces: FeedTraces, part: str) -> None:
    """What does the tool meet, how fast does it go, and what does it bear, before and after?

    Long programs are drawn as bands between the least and the largest value of each stretch, so that no peak is lost.

    Args:
        file: ``.png`` or ``.svg``.
        traces: the curves.
        part: second line of the title.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    loads = [row for row in _LOADS if row[0] in _ALWAYS or np.isfinite(traces.limit[row[0]]).any()]
    figure = canvas.figure(11.0, 1.2 + 1.55 * (3 + len(loads)))
    (grid,) = canvas.panels(figure, 3 + len(loads), 1)
    starts = groups(traces.distance_mm, _BANDS)
    along = _Along(traces, starts)
    along.draw(grid[0], traces.radial_depth_mm, canvas.COLOURS[2], "radial depth", filled=True)
    along.draw(grid[1], traces.section_mm2, canvas.COLOURS[2], "section of the cut", filled=True)
    grid[0].set_ylabel("radial depth\nin mm")
    grid[1].set_ylabel("section of the\ncut in mm²")
    feeds = traces.feed_mm_per_min
    along.draw(grid[2], feeds["programmed"], canvas.GREY, "programmed")
    along.draw(grid[2], feeds["after"], _AFTER, "really run", width=2.2)
    along.draw(grid[2], feeds["written"], canvas.COLOURS[4], "written")
    _feed_axis(grid[2], np.concatenate([feeds["programmed"], feeds["written"]]))
    canvas.legend_above(grid[2])
    for panel, (name, label, unit) in zip(grid[3:], loads, strict=True):
        along.draw(panel, traces.before[name], _BEFORE, "before")
        along.draw(panel, traces.after[name], _AFTER, "after")
        limit = traces.limit[name]
        if np.isfinite(limit).any():
            along.draw(
                panel, np.where(np.isfinite(limit), limit, np.nan), _LIMIT, _limit_label(limit, unit), dashed=True
            )
        panel.set_ylim(bottom=0.0)
        panel.set_ylabel(label)
        canvas.legend_above(panel)
    grid[-1].set_xlabel("distance along the cutting path in mm")
    canvas.heading(figure, "Feed and force along the cutting path", part)
    figure.align_ylabels(grid)
    canvas.save(figure, file)


def _limit_label(limit: Vector, unit: str) -> str:
    values = np.unique(limit[np.isfinite(limit)])
    return f"limit {values[0]:.4g} {unit}" if len(values) == 1 else "limit"


def _feed_axis(panel: Axes, feeds: Vector) -> None:
    """Air cuts may be many times faster than cuts, of which something must still be seen."""
    least, largest = float(feeds.min()), float(feeds.max())
    if least > 0.0 and largest > _LOGARITHMIC * least:
        panel.set_yscale("log")
        panel.set_ylim(0.7 * least, 1.4 * largest)
        panel.yaxis.set_major_formatter("{x:g}")
        panel.yaxis.set_minor_formatter(lambda x, _: f"{x:g}" if f"{x:g}"[0] in _MINOR else "")
    else:
        panel.set_ylim(0.0, 1.08 * largest)
    panel.set_ylabel("feed\nin mm/min")


class _Along:
    """Draws values over the distance: steps, or bands where stretches hold several stations."""

    def __init__(self, traces: FeedTraces, starts: npt.NDArray[np.intp]) -> None:
        self._starts = starts
        begin = traces.distance_mm[starts] - traces.length_mm[starts]
        self._edges = np.append(begin, traces.distance_mm[-1])
        self._bands = len(starts) < len(traces)

    def draw(
        self, panel: Axes, values: Vector, colour: str, name: str, *, filled: bool = False, dashed: bool = False,
        width: float = 0.9,
    ) -> None:  # fmt: skip
        low, high = envelope(values, self._starts)
        if self._bands and not dashed:
            band = np.concatenate([low, low[-1:]]), np.concatenate([high, high[-1:]])
            panel.fill_between(self._edges, *band, step="post", color=colour, linewidth=0, alpha=0.55)
        if filled:
            panel.fill_between(
                self._edges, np.append(high, high[-1]), step="post", color=colour, linewidth=0, alpha=0.25
            )
            panel.set_ylim(0.0, 1.08 * max(float(high.max()), 1e-9))
        style: Any = (0, (5, 3)) if dashed else "-"
        panel.stairs(high, self._edges, baseline=None, color=colour, linewidth=width, linestyle=style, label=name)


def plot_path(file: str | Path, traces: FeedTraces, material: _core.Material, part: str) -> None:
    """Where is the force large? The path from above, before and after in one scale; behind it what is left standing.

    Pieces with the largest force are drawn last, so that passes below them do not hide them.

    Args:
        file: ``.png`` or ``.svg``.
        traces: the curves.
        material: what is left of the stock.
        part: second line of the title.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    from matplotlib import colormaps
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize

    lines, first = _pieces(traces)
    low, high = (each(traces.xy_mm, axis=0) for each in (np.min, np.max))
    low, high = np.minimum(low, material.low_mm), np.maximum(high, material.high_mm)
    margin = _MARGIN * max(float((high - low).max()), 1e-3)
    low, high = low - margin, high + margin
    size = high - low
    wide = bool(size[0] > _STACKED * size[1])
    ratio = float(np.clip(size[1] / size[0], 0.25, 3.0))
    figure = canvas.figure(9.5, 2.0 + 2 * 8.0 * ratio) if wide else canvas.figure(12.0, 1.2 + 4.9 * ratio)
    grid: Any = figure.subplots(2 if wide else 1, 1 if wide else 2, sharex=True, sharey=True, squeeze=False)
    panels = list(grid.flat)
    largest = float(max(traces.before["peak_resultant_n"].max(), traces.after["peak_resultant_n"].max(), 1e-9))
    limits = np.unique(traces.limit["peak_resultant_n"])
    limited = len(limits) == 1 and float(limits[0]) < largest
    norm = Normalize(0.0, float(limits[0]) if limited else largest)
    shades = colormaps["YlGnBu"].with_extremes(over=_BEYOND)
    air = traces.section_mm2 <= _AIR_MM2
    for panel, (when, values) in zip(panels, (("before", traces.before), ("after", traces.after)), strict=True):
        _ground(panel, material, low, high)
        force = np.maximum.reduceat(np.where(air, -1.0, values["peak_resultant_n"]), first)
        order = np.argsort(force, kind="stable")
        order, empty = order[force[order] >= 0.0], order[force[order] < 0.0]
        panel.add_collection(LineCollection(list(lines[empty]), colors=canvas.GREY, linewidths=0.7, rasterized=True))
        coloured = LineCollection(
            list(lines[order]), array=force[order], cmap=shades, norm=norm, linewidths=2.2, rasterized=True,
            capstyle="round",
        )  # fmt: skip
        panel.add_collection(coloured)
        panel.set_xlim(low[0], high[0])
        panel.set_ylim(low[1], high[1])
        panel.set_aspect("equal")
        panel.set_title(
            f"{when}: up to {max(float(values['peak_resultant_n'].max()), 0.0):.3g} N", loc="left", fontsize=10
        )
        panel.set_xlabel("X in mm")
        panel.set_ylabel("Y in mm")
    bar = figure.colorbar(coloured, ax=panels, shrink=0.85, pad=0.02, extend="max" if limited else "neither")
    bar.set_label("peak resultant in N" + (f"; red: above the limit, {limits[0]:.4g} N" if limited else ""))
    canvas.heading(figure, "Peak resultant along the path; grey: without material", part)
    canvas.save(figure, file)


def _pieces(traces: FeedTraces) -> tuple[Vector, npt.NDArray[np.intp]]:
    """Lines of the path, (m, 2, 2), and the first station of each; none goes from region to region."""
    runs = np.unique(np.concatenate([groups(traces.distance_mm, _PIECES), traces.begins]))
    last = np.append(runs[1:], len(traces)) - 1
    begin = traces.xy_mm[np.maximum(runs - 1, 0)]
    opening = np.isin(runs, traces.begins)
    begin[opening] = traces.xy_mm[runs[opening]]
    return np.stack([begin, traces.xy_mm[last]], axis=1), runs


def _ground(panel: Axes, material: _core.Material, low: Vector, high: Vector) -> None:
    """What is left of the stock, the higher the darker."""
    size = high - low
    cell = max(float(size.max()) / _GROUND, 1e-9)
    columns, rows = (max(int(np.ceil(each / cell)), 1) for each in size)
    heights = np.asarray(material.heights_mm(low, high, rows, columns))
    bottom, top = material.bottom_mm, material.top_mm
    shade = (heights - bottom) / max(top - bottom, 1e-9)
    panel.imshow(
        np.where(np.isnan(shade), np.nan, 0.25 + 0.75 * shade), extent=(low[0], high[0], low[1], high[1]),
        origin="lower", cmap="Greys", vmin=0.0, vmax=3.0, interpolation="nearest", zorder=0,
    )  # fmt: skip


def plot_surface(file: str | Path, walls: WallMaps, part: str) -> None:
    """How far off is the wall? Error over distance and axial height before and after, in one scale.

    Args:
        file: ``.png`` or ``.svg``.
        walls: the maps.
        part: second line of the title.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    figure, last = wall_figure(
        walls.edges_mm, walls.height_mm, {"before": walls.before, "after": walls.after}, (_BEFORE, _AFTER)
    )
    last.set_xlabel("distance along the cutting path in mm")
    canvas.heading(figure, "Form error of the wall; +: material is left standing", part)
    canvas.save(figure, file)


def wall_figure(
    edges_mm: Vector, height_mm: Vector, maps: Mapping[str, Vector], colours: Sequence[str]
) -> tuple[Figure, Axes]:
    """Maps of the wall's error below each other in one scale, and in the last panel the largest of each column.

    Args:
        edges_mm: of the columns, (m + 1,).
        height_mm: above the tip, evenly spaced, (h,).
        maps: error in µm by name, (m, h); NaN: no wall.
        colours: of their curves in the last panel.

    Returns:
        The picture without its title, and its last panel.
    """
    everything = np.concatenate([each[np.isfinite(each)] for each in maps.values()])
    low, high = min(float(everything.min()), 0.0), max(float(everything.max()), 0.0)
    high = high if high > low else low + 1e-3
    figure = canvas.figure(11.0, 1.3 + 1.9 * (len(maps) + 1))
    rows: Any = figure.subplots(len(maps) + 1, 1, sharex=True)
    grid: list[Axes] = list(rows)
    step = height_mm[1] - height_mm[0]
    levels = np.concatenate([height_mm - 0.5 * step, height_mm[-1:] + 0.5 * step])
    for panel, (name, values) in zip(grid, maps.items(), strict=False):
        panel.set_facecolor("#efefef")
        mesh = panel.pcolormesh(
            edges_mm, levels, np.ma.masked_invalid(values.T), cmap="viridis", vmin=low, vmax=high, rasterized=True,
        )  # fmt: skip
        panel.set_ylim(levels[0], levels[-1])
        panel.set_ylabel("height above\nthe tip in mm")
        worst = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
        panel.set_title(f"{name}: up to {worst:.3g} µm", loc="left", fontsize=10)
    figure.colorbar(mesh, ax=grid[:-1], pad=0.01, label="error of the wall in µm")
    last = grid[-1]
    for (name, values), colour in zip(maps.items(), colours, strict=True):
        made = np.isfinite(values).any(axis=1)
        largest = np.full(len(values), np.nan)
        largest[made] = np.nanmax(np.abs(values[made]), axis=1)
        last.stairs(largest, edges_mm, baseline=None, color=colour, linewidth=1.1, label=name)
    last.set_ylim(bottom=0.0)
    last.grid(True, color="#e4e4e4", linewidth=0.6)
    last.set_axisbelow(True)
    last.spines[["top", "right"]].set_visible(False)
    last.margins(x=0.0)
    last.set_ylabel("largest over\nthe height in µm")
    canvas.legend_above(last)
    figure.align_ylabels(grid)
    return figure, last
