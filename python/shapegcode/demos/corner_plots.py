"""The pictures of ``shapegcode demo corner``: the figures of Kim and Ko, 2001 (paper 001), and the scheduler."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shapegcode.demos.corner import CornerDemo
from shapegcode.demos.corner_program import AXIAL_DEPTH_MM, STRAIGHT_MM, TOOL_RADIUS_MM
from shapegcode.demos.corner_study import AlongCorner, CornerStudy
from shapegcode.feed.wall_plot import draw_walls
from shapegcode.results import plot
from shapegcode.results.result import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_depth", "plot_forces", "plot_resultant", "plot_scheduled", "plot_surface", "plots_of"]

Vector = npt.NDArray[np.float64]

_SHOWN_MM = (-8.0, 11.0)
_EVERY = 4  # stations
_ANGLES = 72
_HEIGHTS = 31
_DISTANCE = "distance from the corner's begin in mm"
_COLOURS = (plot.COLOURS[0], plot.COLOURS[4], plot.COLOURS[1])  # of the feeds that are compared


def plots_of(demo: CornerDemo) -> dict[str, Plot]:
    """Its pictures by name: figures 6, 9, 11 and 12 of the paper, and the scheduler."""
    first = demo.studies[0]
    return {
        "paper001-figure6a-radial-depth": partial(plot_depth, demo.studies),
        "paper001-figures6bc-forces": partial(plot_forces, first),
        "paper001-figure9-resultant": partial(plot_resultant, first),
        "paper001-figures11-12-surface": partial(plot_surface, first),
        "paper001-scheduled": partial(plot_scheduled, demo.studies),
    }


def _shown(study: CornerStudy) -> npt.NDArray[np.intp]:
    """The stations that are drawn."""
    place = _place(study)
    inside = np.flatnonzero((place >= _SHOWN_MM[0]) & (place <= _SHOWN_MM[1]))
    # Both sides of a vertex stay.
    kept = (inside % _EVERY == 0) | np.isin(inside, [study.worst, study.worst + 1])
    stations: npt.NDArray[np.intp] = inside[kept]
    return stations


def _place(study: CornerStudy) -> Vector:
    """Distance of the stations from where the arc, or else the vertex, is."""
    place: Vector = np.asarray(study.track.s_mm) - STRAIGHT_MM
    return place


def _title(study: CornerStudy) -> str:
    case = study.case
    return f"case {case.number}: rough {case.rough_radius_mm:g} mm, finish {case.finish_radius_mm:g} mm"


def plot_depth(studies: tuple[CornerStudy, ...], ax: Axes | None = None) -> Axes:
    """Radial depth along the three corners (figure 6a).

    Args:
        studies: of the corners.
        ax: where to draw; None: a new figure.

    Returns:
        The only panel.
    """
    ((panel,),) = plot.grid(ax, 1, 1, size_inch=(9.0, 4.4), title="Radial depth along the corner (figure 6a)")
    for study, colour in zip(studies, plot.COLOURS, strict=False):
        shown = _shown(study)
        depth = np.asarray(study.track.radial_depth_mm)
        panel.plot(_place(study)[shown], depth[shown], color=colour, linewidth=1.4, label=_title(study))
        worst = study.worst
        panel.annotate(
            f"{depth[worst]:.3f} mm = {depth[worst] / (2.0 * TOOL_RADIUS_MM):.3f} D",
            (_place(study)[worst], depth[worst]), (6, 3 if worst else 0), textcoords="offset points", fontsize=8,
            color=colour, va="bottom",
        )  # fmt: skip
    panel.set_xlim(*_SHOWN_MM)
    panel.set_ylim(0.0, 7.4)
    panel.set_xlabel(_DISTANCE)
    panel.set_ylabel("radial depth in mm")
    plot.legend_above(panel)
    return panel


def _revolutions(study: CornerStudy, along: AlongCorner, shown: npt.NDArray[np.intp]) -> tuple[Vector, Vector]:
    """Force over one revolution at each place, (places, angles, 2), N: in the frame of the tool and of the machine."""
    tool = np.array(
        [
            study.force.curve(study.track.arcs_of(int(i)), float(along.feed_mm_per_min[i]), _ANGLES).force_n
            for i in shown
        ]
    )
    direction = np.asarray(study.track.direction_rad)[shown][:, None]
    x, y = tool[..., 0], tool[..., 1]
    cosine, sine = np.cos(direction), np.sin(direction)
    return tool, np.stack([x * cosine - y * sine, x * sine + y * cosine], axis=-1)


def _ripple(panel: Axes, place: Vector, values: Vector, colour: str, label: str) -> None:
    """A band from the least to the largest value of a revolution, with the mean in it."""
    panel.fill_between(place, values.min(axis=1), values.max(axis=1), color=colour, linewidth=0, alpha=0.35)
    panel.plot(place, values.mean(axis=1), color=colour, linewidth=1.1, label=label)


def plot_forces(study: CornerStudy, ax: Axes | None = None) -> Axes:
    """Force with the programmed feed in the frame of the tool and of the machine (figures 6b and 6c).

    Args:
        study: of the corner.
        ax: where to draw; None: a new figure.

    Returns:
        The upper panel.
    """
    shown = _shown(study)
    place = _place(study)[shown]
    title = f"Cutting force at {study.case.feed_mm_per_min:g} mm/min; band: within one revolution"
    rows = plot.grid(ax, 2, 1, size_inch=(9.0, 6.4), sharex=True, title=title, part=_title(study))
    grid = [row[0] for row in rows]
    names = (("along the feed, Fx'", "across it to the left, Fy'"), ("along X, Fx", "along Y, Fy"))
    frames = ("frame of the tool (6b)", "frame of the machine (6c)")
    for panel, force, labels, frame in zip(
        grid, _revolutions(study, study.programmed, shown), names, frames, strict=True
    ):
        for component in range(2):
            _ripple(panel, place, force[..., component], plot.COLOURS[component], labels[component])
        panel.set_ylabel("force in N")
        panel.set_title(frame, loc="right", fontsize=10)
        plot.legend_above(panel)
    grid[-1].set_xlim(*_SHOWN_MM)
    grid[-1].set_xlabel(_DISTANCE)
    return grid[0]


def plot_resultant(study: CornerStudy, ax: Axes | None = None) -> Axes:
    """Resultant with the programmed feed, by equation 7 and as scheduled (figure 9).

    Args:
        study: of the corner.
        ax: where to draw; None: a new figure.

    Returns:
        The uppermost panel.
    """
    shown = _shown(study)
    place = _place(study)[shown]
    rows = plot.grid(
        ax, len(_COLOURS) + 1, 1, size_inch=(9.0, 8.6), sharex=True,
        title="Resultant force (figure 9); band: within one revolution", part=_title(study),
    )  # fmt: skip
    grid = [row[0] for row in rows]
    target = float(study.programmed.peak_n[0])
    for panel, (name, along), colour in zip(grid, study.feeds, _COLOURS, strict=False):
        tool, _ = _revolutions(study, along, shown)
        _ripple(panel, place, np.hypot(tool[..., 0], tool[..., 1]), colour, name)
        panel.axhline(target, color="black", linewidth=0.9, linestyle=(0, (5, 3)), label="peak of the straight")
        panel.set_ylim(0.0, 1.05 * float(study.programmed.peak_n.max()))
        panel.set_ylabel("resultant in N")
        plot.legend_above(panel)
        grid[-1].plot(place, along.feed_mm_per_min[shown], color=colour, linewidth=1.2, label=name)
    grid[-1].set_ylabel("feed in mm/min")
    grid[-1].set_ylim(bottom=0.0)
    plot.legend_above(grid[-1])
    grid[-1].set_xlim(*_SHOWN_MM)
    grid[-1].set_xlabel(_DISTANCE)
    return plot.aligned(grid)


def plot_surface(study: CornerStudy, ax: Axes | None = None) -> Axes:
    """Form error of the wall with the programmed feed, by equation 7 and as scheduled (figures 11 and 12).

    Args:
        study: of the corner.
        ax: where to draw; None: a new figure.

    Returns:
        The uppermost panel.
    """
    height = np.linspace(0.0, AXIAL_DEPTH_MM, _HEIGHTS)
    place = _place(study)[::_EVERY]
    inside = (place >= _SHOWN_MM[0]) & (place <= _SHOWN_MM[1])
    maps = {name: study.wall_error_um(along, _EVERY, height)[inside] for name, along in study.feeds}
    drawn = place[inside]
    edges = np.append(drawn, 2.0 * drawn[-1] - drawn[-2])
    return draw_walls(
        ax, edges, height, maps, _COLOURS, along=_DISTANCE, part=_title(study),
        title="Form error of the wall (figures 11 and 12); +: material is left standing",
    )  # fmt: skip


def plot_scheduled(studies: tuple[CornerStudy, ...], ax: Axes | None = None) -> Axes:
    """Peak resultant and feed of the three corners, a column for each.

    Args:
        studies: of the corners.
        ax: where to draw; None: a new figure.

    Returns:
        The first upper panel.
    """
    rows = plot.grid(
        ax, 2, len(studies), size_inch=(3.0 + 3.6 * len(studies), 6.4), sharex="col",
        title="Peak resultant and feed on the corners of the paper",
    )  # fmt: skip
    for study, upper, lower in zip(studies, *rows, strict=True):
        shown = _shown(study)
        place = _place(study)[shown]
        for (name, along), colour in zip(study.feeds, _COLOURS, strict=True):
            upper.plot(place, along.peak_n[shown], color=colour, linewidth=1.2, label=name)
            lower.plot(place, along.feed_mm_per_min[shown], color=colour, linewidth=1.2)
        upper.axhline(
            float(study.programmed.peak_n[0]), color="black", linewidth=0.9, linestyle=(0, (5, 3)), label="target"
        )
        upper.set_title(_title(study), loc="left", fontsize=9)
        upper.set_ylim(bottom=0.0)
        lower.set_ylim(bottom=0.0)
        lower.set_xlim(*_SHOWN_MM)
        lower.set_xlabel(_DISTANCE)
    rows[0][0].set_ylabel("peak resultant in N")
    rows[1][0].set_ylabel("feed in mm/min")
    handles, labels = rows[0][0].get_legend_handles_labels()
    whole: Any = rows[0][0].figure
    whole.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return rows[0][0]
