"""The pictures of a feed schedule: the curves along the path, the path coloured by force, and the wall."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.feed.load import LOADS, FeedTraces, envelope, groups
from shapegcode.feed.plan import Vector
from shapegcode.feed.result import FeedSchedule
from shapegcode.results import plot
from shapegcode.results.outcome import Plot
from shapegcode.results.page.scene import Scene, Variant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap

_BEFORE, _AFTER = plot.COLOURS[0], plot.COLOURS[1]
_PIECES = 20000
_LOGARITHMIC = 8.0  # ratio of largest to lowest feed from which the axis is logarithmic
_MINOR = "235"  # first digits of labels between powers of ten on a logarithmic axis
_AIR_MM2 = 1e-9
_STACKED = 1.9  # width over height of the part from which the two paths are stacked
_MARGIN = 0.03  # around the part, of its longer side
_GROUND = 300  # cells of the background along the longer side
_ALWAYS = ("peak_resultant_n", "mean_resultant_n")
_ALONG_PATH = "distance along the cutting path in mm"


def plots_of(schedule: FeedSchedule) -> dict[str, Plot]:
    """Pictures by name; none without a known cutting force."""
    if schedule.traces is None:
        return {}
    found: dict[str, Plot] = {
        "feed-along-path": partial(plot_feed_along_path, schedule),
        "feed-path": partial(plot_force_path, schedule),
    }
    return found | ({} if schedule.walls is None else {"feed-surface": partial(plot_wall_error, schedule)})


def _traces(schedule: FeedSchedule) -> FeedTraces:
    if schedule.traces is None:
        raise _core.ArgumentError("no region with a known cutting force: nothing to draw")
    return schedule.traces


def _summary(schedule: FeedSchedule) -> str:
    force, time = schedule.resultant_force_n, schedule.cycle_time_s
    return (
        f"{Path(schedule.program).name}, {', '.join(schedule.tools)}: peak resultant "
        f"{plot.number(force.original.max)} → {plot.number(force.emitted.max)} N, cycle time "
        f"{plot.number(time.original, 4)} → {plot.number(time.emitted, 4)} s"
    )


def plot_feed_along_path(schedule: FeedSchedule, ax: Axes | None = None) -> Axes:
    """Plot engagement, feed and load of the tool along the path, before and after.

    Long programs are drawn as bands between minimum and maximum of each interval, so that no peak is lost.

    Args:
        schedule: the schedule.
        ax: where to draw; None: a new figure.

    Returns:
        The uppermost panel.

    Raises:
        ArgumentError: no cutting force is known.
    """
    traces = _traces(schedule)
    loads = [name for name in LOADS if name in _ALWAYS or np.isfinite(traces.limit[name]).any()]
    panels = plot.column(
        ax, 3 + len(loads), size_inch=(11.0, 1.2 + 1.55 * (3 + len(loads))),
        title="Feed and force along the cutting path", part=_summary(schedule), xlabel=_ALONG_PATH,
    )  # fmt: skip
    along = _Along(traces, groups(traces.distance_mm, 1500))
    along.draw(panels[0], traces.radial_depth_mm, plot.COLOURS[2], "radial depth", filled=True)
    along.draw(panels[1], traces.section_mm2, plot.COLOURS[2], "section of the cut", filled=True)
    panels[0].set_ylabel("radial depth\nin mm")
    panels[1].set_ylabel("section of the\ncut in mm²")
    along.draw(panels[2], traces.programmed_mm_per_min, plot.GREY, "programmed")
    along.draw(panels[2], traces.load.emitted.feed_mm_per_min, _AFTER, "reached", width=2.2)
    along.draw(panels[2], traces.written_mm_per_min, plot.COLOURS[4], "written")
    _feed_axis(panels[2], np.concatenate([traces.programmed_mm_per_min, traces.written_mm_per_min]))
    plot.legend_above(panels[2])
    for panel, name in zip(panels[3:], loads, strict=True):
        words, unit, _ = LOADS[name]
        along.draw(panel, getattr(traces.load.original, name), _BEFORE, "before")
        along.draw(panel, getattr(traces.load.emitted, name), _AFTER, "after")
        limit = traces.limit[name]
        if len(values := np.unique(limit[np.isfinite(limit)])):
            label = f"limit {plot.number(values[0], 4)} {unit}" if len(values) == 1 else "limit"
            along.draw(panel, np.where(np.isfinite(limit), limit, np.nan), "#000000", label, dashed=True)
        panel.set_ylim(bottom=0.0)
        panel.set_ylabel(f"{words}\nin {unit}")
        plot.legend_above(panel)
    for panel in panels:
        panel.margins(x=0.01)
    return plot.aligned(panels)


def _feed_axis(panel: Axes, feeds: Vector) -> None:
    least, largest = float(feeds.min()), float(feeds.max())
    if least > 0.0 and largest > _LOGARITHMIC * least:
        panel.set(yscale="log", ylim=(0.7 * least, 1.4 * largest))
        panel.yaxis.set_major_formatter("{x:g}")
        panel.yaxis.set_minor_formatter(lambda x, _: f"{x:g}" if f"{x:g}"[0] in _MINOR else "")
    else:
        panel.set_ylim(0.0, 1.08 * largest)
    panel.set_ylabel("feed\nin mm/min")


class _Along:
    """Plot values over the distance: steps, or bands where an interval contains several values."""

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
            band = np.append(low, low[-1]), np.append(high, high[-1])
            panel.fill_between(self._edges, *band, step="post", color=colour, linewidth=0, alpha=0.55)
        if filled:
            panel.fill_between(
                self._edges, np.append(high, high[-1]), step="post", color=colour, linewidth=0, alpha=0.25
            )
            panel.set_ylim(0.0, 1.08 * max(float(high.max()), 1e-9))
        style: Any = (0, (5, 3)) if dashed else "-"
        panel.stairs(high, self._edges, baseline=None, color=colour, linewidth=width, linestyle=style, label=name)


def plot_force_path(schedule: FeedSchedule, ax: Axes | None = None) -> Axes:
    """Plot the force on the path from above, before and after in one scale, over the remaining material.

    Pieces with the largest force are drawn last, so that lower passes do not hide them.

    Args:
        schedule: the schedule.
        ax: where to draw; None: a new figure.

    Returns:
        The panel of the force before scheduling.

    Raises:
        ArgumentError: no cutting force is known.
    """
    from matplotlib.colors import Normalize

    traces, material = _traces(schedule), schedule.survey.material
    low, high = (each(traces.xy_mm, axis=0) for each in (np.min, np.max))
    low, high = np.minimum(low, material.low_mm), np.maximum(high, material.high_mm)
    margin = _MARGIN * max(float((high - low).max()), 1e-3)
    low, high = low - margin, high + margin
    size = high - low
    wide = bool(size[0] > _STACKED * size[1])
    ratio = float(np.clip(size[1] / size[0], 0.25, 3.0))
    rows = plot.grid(
        ax, 2 if wide else 1, 1 if wide else 2, sharex=True, sharey=True,
        size_inch=(9.5, 2.0 + 2 * 8.0 * ratio) if wide else (12.0, 1.2 + 4.9 * ratio),
        title="Peak resultant along the path; grey: without material", part=_summary(schedule),
    )  # fmt: skip
    panels = [panel for row in rows for panel in row]
    forces = (traces.load.original.peak_resultant_n, traces.load.emitted.peak_resultant_n)
    largest = max(float(forces[0].max()), float(forces[1].max()), 1e-9)
    limits = np.unique(traces.limit["peak_resultant_n"])
    limited = len(limits) == 1 and float(limits[0]) < largest
    norm = Normalize(0.0, float(limits[0]) if limited else largest)
    for panel, name, force in zip(panels, ("before", "after"), forces, strict=True):
        _ground(panel, material, low, high)
        coloured = _coloured_path(panel, traces, force, norm)
        panel.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="X in mm", ylabel="Y in mm")
        panel.set_title(f"{name}: up to {plot.number(max(float(force.max()), 0.0))} N", loc="left", fontsize=10)
    whole: Any = panels[0].figure
    bar = whole.colorbar(coloured, ax=panels, shrink=0.85, pad=0.02, extend="max" if limited else "neither")
    bar.set_label("peak resultant in N" + (f"; red: above the limit, {plot.number(limits[0], 4)} N" if limited else ""))
    return panels[0]


def _coloured_path(panel: Axes, traces: FeedTraces, force_n: Vector, norm: Any) -> Any:
    """Draw the pieces of the path, those with the largest force last; returns the data for a colour bar."""
    from matplotlib import colormaps
    from matplotlib.collections import LineCollection

    lines, first = _pieces(traces)
    force = np.maximum.reduceat(np.where(traces.section_mm2 <= _AIR_MM2, -1.0, force_n), first)
    order = np.argsort(force, kind="stable")
    order, empty = order[force[order] >= 0.0], order[force[order] < 0.0]
    panel.add_collection(LineCollection(list(lines[empty]), colors=plot.GREY, linewidths=0.7, rasterized=True))
    coloured = LineCollection(
        list(lines[order]), array=force[order], cmap=colormaps["YlGnBu"].with_extremes(over=plot.COLOURS[0]), norm=norm,
        linewidths=2.2, rasterized=True, capstyle="round",
    )  # fmt: skip
    panel.add_collection(coloured)
    return coloured


def _pieces(traces: FeedTraces) -> tuple[Vector, npt.NDArray[np.intp]]:
    runs = np.unique(np.concatenate([groups(traces.distance_mm, _PIECES), traces.begins]))
    last = np.append(runs[1:], len(traces)) - 1
    begin = traces.xy_mm[np.maximum(runs - 1, 0)]
    opening = np.isin(runs, traces.begins)
    begin[opening] = traces.xy_mm[runs[opening]]
    return np.stack([begin, traces.xy_mm[last]], axis=1), runs


def _ground(panel: Axes, material: _core.Material, low: Vector, high: Vector) -> None:
    """Draw the remaining stock, higher parts darker."""
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


def plot_wall_error(schedule: FeedSchedule, ax: Axes | None = None) -> Axes:
    """Plot the wall error over distance and height with original and new feeds, and the largest over the height.

    Args:
        schedule: the schedule.
        ax: where to draw; None: a new figure.

    Returns:
        The panel of the wall error before scheduling.

    Raises:
        ArgumentError: no wall with a known cutting force.
    """
    walls = schedule.walls
    if walls is None:
        raise _core.ArgumentError("no wall with a known cutting force: nothing to draw")
    maps = {"before": walls.error_um.original, "after": walls.error_um.emitted}
    everything = np.concatenate([each[np.isfinite(each)] for each in maps.values()])
    low, high = min(float(everything.min()), 0.0), max(float(everything.max()), 0.0)
    high = high if high > low else low + 1e-3
    both = _both_sides(low, high)
    panels = plot.column(
        ax, 3, size_inch=(11.0, 7.0), part=_summary(schedule), xlabel=_ALONG_PATH,
        title="Form error of the wall; +: material remains",
    )  # fmt: skip
    step = walls.height_mm[1] - walls.height_mm[0]
    levels = np.append(walls.height_mm - 0.5 * step, walls.height_mm[-1] + 0.5 * step)
    for panel, (name, values) in zip(panels, maps.items(), strict=False):
        panel.grid(False)
        panel.spines[["top", "right"]].set_visible(True)
        panel.set_facecolor("#c9c9c9")
        mesh = panel.pcolormesh(
            walls.edges_mm, levels, np.ma.masked_invalid(values.T), cmap=both, vmin=low, vmax=high, rasterized=True,
        )  # fmt: skip
        panel.set(ylim=(levels[0], levels[-1]), ylabel="height above\nthe tip in mm")
        worst = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
        panel.set_title(f"{name}: up to {plot.number(worst)} µm", loc="left", fontsize=10)
    whole: Any = panels[0].figure
    whole.colorbar(
        mesh, ax=panels[:-1], pad=0.01, label="error of the wall in µm\nred: material remains, blue: cut too deep"
    )
    last = panels[-1]
    for (name, values), colour in zip(maps.items(), (_BEFORE, _AFTER), strict=True):
        largest = np.fmax.reduce(np.abs(values), axis=1)
        last.stairs(largest, walls.edges_mm, baseline=None, color=colour, linewidth=1.1, label=name)
    last.set_ylim(bottom=0.0)
    last.margins(x=0.0)
    last.set_ylabel("largest over\nthe height in µm")
    plot.legend_above(last)
    return plot.aligned(panels)


def _both_sides(low: float, high: float) -> Colormap:
    """Colours from `low` to `high`: white at 0, equally strong at equal distances from it; `low` <= 0 <= `high`."""
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap

    reach = 2.0 * max(-low, high)
    places = np.linspace(0.5 + low / reach, 0.5 + high / reach, 257)
    return LinearSegmentedColormap.from_list("both sides", colormaps["RdBu_r"](places))


def with_forces(scene: Scene, schedule: FeedSchedule) -> Scene:
    """Add the cutting force (largest resultant within a revolution) to the motion; 0 where it is not known."""
    loads = schedule.loads
    regions = [[part.region for part in schedule.survey.regions], list(schedule.written.regions)]
    variants = []
    for variant, own, side in zip(scene.variants, regions, ("original", "emitted"), strict=True):
        known = [
            (region, load.s_mm, getattr(load, side).peak_resultant_n)
            for region, load in zip(own, loads, strict=True)
            if load is not None
        ]
        force = _along(variant, known)
        variants.append(replace(variant, channels=dict(variant.channels) | {"force": force}))
    return replace(scene, variants=tuple(variants))


def _along(variant: Variant, known: Sequence[tuple[_core.Region, Vector, Vector]]) -> Vector:
    force = np.zeros(len(variant.sample))
    travel = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(variant.command_mm, axis=0), axis=1))])
    for region, stations_mm, values_n in known:
        rows = np.flatnonzero((variant.line >= region.first_line) & (variant.line <= region.last_line))
        if len(rows) < 2 or not len(stations_mm) or travel[rows[-1]] <= travel[rows[0]]:
            continue
        # The decimated travel is slightly shorter than the path: scale one to the other.
        ratio = (travel[rows] - travel[rows[0]]) / (travel[rows[-1]] - travel[rows[0]])
        force[rows] = np.interp(ratio * stations_mm[-1], stations_mm, values_n)
    return force
