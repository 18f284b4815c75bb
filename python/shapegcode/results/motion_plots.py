"""Pictures of a conversion, one per question: how far off the path, how fast, how much vibration.

Matplotlib is imported when the first picture is drawn and draws to files only (PNG or SVG, by the file's
ending); no window system and no global state are touched. Colours are those of Okabe and Ito, which
colour-blind readers can tell apart; the original program is also the wider line, so that it shows
beneath the emitted one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from shapegcode.results import plot as canvas
from shapegcode.results.trace import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["View", "follow", "plot_feed", "plot_path", "plot_vibration", "thin_min_max"]

FloatArray = npt.NDArray[np.float64]
Plane = Literal["XY", "ZX", "YZ"]

_AXIS_NAMES = "XYZ"
_WIDTHS = (2.4, 0.9, 0.9, 0.9)
_MAX_POINTS = 4000
_MOVES_MM = 1e-9
# A deflection below this is none.
_SHOWN_MM = 5e-5
_FLAT = 0.06  # of an axis in µm or mm/min
# Pieces of the programmed path among which the nearest one is looked for.
_PATH_PIECES = 20_000
_SHORTEST_PIECE_MM = 0.01
# A millimetre between two places along the path counts as this many mm between a sample and the path.
_PROGRESS_WEIGHT = 0.03
_SEGMENTS_ASKED = 3  # on either side of the nearest vertex


def thin_min_max(
    times: npt.ArrayLike, values: npt.ArrayLike, max_points: int = _MAX_POINTS
) -> tuple[FloatArray, FloatArray]:
    """Fewer points of a curve that look the same: of each stretch only its smallest and largest value.

    Args:
        times: shape (n,), rising.
        values: shape (n,).
        max_points: about how many points may remain; shorter curves come back as they are.

    Returns:
        The times and values that remain, in order; first and last point always among them.

    Raises:
        ValueError: shapes differ, or max_points is below 4.
    """
    t, v = np.asarray(times, dtype=np.float64), np.asarray(values, dtype=np.float64)
    if t.shape != v.shape or t.ndim != 1:
        raise ValueError(f"times have shape {t.shape}, values {v.shape}: must be equal and one-dimensional")
    if max_points < 4:
        raise ValueError(f"max_points = {max_points}: must be 4 or more")
    if len(t) <= max_points:
        return t, v
    starts = np.linspace(0, len(t), max_points // 2, endpoint=False).astype(np.intp)
    keep = {0, len(t) - 1}
    for begin, end in zip(starts, [*starts[1:], len(t)], strict=True):
        keep.add(int(begin + np.argmin(v[begin:end])))
        keep.add(int(begin + np.argmax(v[begin:end])))
    indices = np.array(sorted(keep), dtype=np.intp)
    return t[indices], v[indices]


@dataclass(frozen=True)
class View:
    """A stretch of time, drawn as one column of a picture.

    Attributes:
        traces: usually the original and the emitted program.
        heading: what the stretch is; empty where it is all there is.
        time_label: of the time axis.
    """

    traces: Sequence[Trace]
    heading: str = ""
    time_label: str = "time in s"


def plot_path(
    file: str | Path,
    programmed_mm: npt.ArrayLike,
    traces: Sequence[Trace],
    *,
    quantity: Literal["response", "command"] = "response",
    plane: Plane = "XY",
    magnification: float | None = None,
    part: str = "",
    whole_mm: npt.ArrayLike | None = None,
) -> float:
    """How far, and to which side, does the table leave the programmed path?

    Each curve is the programmed path plus the deviation times the magnification, every sample of it. The legend
    has the figure that the core measured over the whole run; where a trace has none, that of the samples drawn.

    Args:
        file: ``.png`` or ``.svg``.
        programmed_mm: the programmed path as a polyline, shape (m, 3), fine enough for its arcs.
        traces: usually the original and the emitted program.
        quantity: deviation of the table ("response") or of the set-points ("command").
        plane: plane of the picture.
        magnification: factor of the deviation; None: chosen so that the largest one is easy to see.
        part: which part of the program this is, for the title.
        whole_mm: the whole path where `programmed_mm` is a piece of it, shape (k, 3): a second panel shows where
            the piece lies.

    Returns:
        The magnification that was used.

    Raises:
        ValueError: a wrong shape, ending or magnification.
        OSError: the file cannot be written.
    """
    polyline = _checked_polyline("programmed_mm", programmed_mm)
    whole = None if whole_mm is None else _checked_polyline("whole_mm", whole_mm)
    _check_traces(traces)
    if magnification is not None and not (math.isfinite(magnification) and magnification > 0):
        raise ValueError(f"magnification = {magnification}: must be finite and greater than 0")

    drawn = []
    for trace in traces:
        points = trace.response_mm if quantity == "response" else trace.command_mm
        _, feet = follow(trace.command_mm, points, polyline, complete=trace.stops and whole is None)
        drawn.append((trace, feet, points - feet))
    largest_mm = max(float(np.linalg.norm(deviation, axis=1).max()) for _, _, deviation in drawn)
    size_mm = float(np.linalg.norm(np.ptp(polyline, axis=0)))
    factor = magnification or _round_factor(0.1 * size_mm / largest_mm if largest_mm > 0 else 1.0)

    straight = _only_along(polyline, [deviation for _, _, deviation in drawn])
    figure = canvas.figure(7.2 if whole is None else 10.4, 6.4)
    axes, locator = _path_axes(figure, with_locator=whole is not None)
    across, up = (_AXIS_NAMES.index(name) for name in plane)
    axes.plot(polyline[:, across], polyline[:, up], color=canvas.GREY, linewidth=3, alpha=0.55, label="programmed path")
    for number, (trace, feet, deviation) in enumerate(drawn):
        curve = feet + factor * deviation
        label = _path_label(trace, deviation, quantity, is_part=whole is not None)
        if straight:
            curve = curve[:0]  # the label alone
        axes.plot(curve[:, across], curve[:, up], color=_colour(number), linewidth=_width(number), label=label)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    axes.set_xlabel(f"{plane[0]} in mm")
    axes.set_ylabel(f"{plane[1]} in mm")
    what = "table" if quantity == "response" else "command"
    canvas.heading(figure, f"Deviation of the {what} from the path, drawn ×{factor:g}", part)
    if straight:
        axes.text(
            0.5, 0.3, "The path is straight: the table deviates along it only,\nwhich no drawing of the path shows. "
            "See the picture of the vibration.", transform=axes.transAxes, ha="center", va="center",
        )  # fmt: skip
    else:
        _deviation_scale(axes, factor, largest_mm)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=1, frameon=False, borderaxespad=0.2, fontsize=9)
    if whole is not None and locator is not None:
        _locate(locator, whole[:, [across, up]], polyline[:, [across, up]])
    canvas.save(figure, file)
    return factor


def plot_feed(file: str | Path, views: Sequence[View], *, part: str = "") -> None:
    """How fast does the command go, along the path and per axis?

    Args:
        file: ``.png`` or ``.svg``.
        views: stretches of time, side by side.
        part: which part of the program this is, for the title.

    Raises:
        ValueError: a wrong ending, or no trace.
        OSError: the file cannot be written.
    """
    _check_views(views)
    moving = _moving_axes([trace for view in views for trace in view.traces])
    figure = canvas.figure(8.0 + 4.0 * (len(views) - 1), 1.8 + 1.7 * (1 + len(moving)))
    grid = canvas.panels(figure, 1 + len(moving), len(views))
    for view, panels in zip(views, grid, strict=True):
        for number, trace in enumerate(view.traces):
            speeds = np.diff(trace.command_mm, axis=0) / trace.period_s * 60
            # A difference belongs to the middle of its period.
            middles = trace.times_s[:-1] + trace.period_s / 2
            curves = [np.linalg.norm(speeds, axis=1), *(speeds[:, axis] for axis in moving)]
            for panel, values in zip(panels, curves, strict=True):
                _curve(panel, number, trace.label, middles, values)
        for panel in panels:
            _spread_flat(panel)
        _column_heading(panels[0], view)
        canvas.legend_above(panels[0])
        # Standstill before and after says nothing about feed.
        begin = min(trace.departure_s for trace in view.traces)
        end = max(trace.rest_s if trace.stops else float(trace.times_s[-1]) for trace in view.traces)
        margin = 0.03 * (end - begin) or view.traces[0].period_s
        panels[-1].set_xlim(begin - margin, end + margin)
        panels[-1].set_xlabel(view.time_label)
    grid[0][0].set_ylabel("path feed\nin mm/min")
    for panel, axis in zip(grid[0][1:], moving, strict=True):
        panel.set_ylabel(f"{_AXIS_NAMES[axis]} speed\nin mm/min")
    canvas.heading(figure, "Feed of the command", part)
    figure.align_ylabels(grid[0])
    canvas.save(figure, file)


def plot_vibration(file: str | Path, views: Sequence[View], *, part: str = "") -> None:
    """How much does each axis swing about its command, and how much of it remains after the stop?

    Axes that do not swing are named, not drawn.

    Args:
        file: ``.png`` or ``.svg``.
        views: stretches of time, side by side.
        part: which part of the program this is, for the title.

    Raises:
        ValueError: a wrong ending, or no trace.
        OSError: the file cannot be written.
    """
    _check_views(views)
    traces = [trace for view in views for trace in view.traces]
    moving = _moving_axes(traces)
    swing_mm = np.max([np.abs(trace.deflection_mm).max(axis=0) for trace in traces], axis=0)
    swinging = [axis for axis in moving if swing_mm[axis] >= _SHOWN_MM]
    still = [axis for axis in moving if axis not in swinging]
    shown = swinging or still[:1]
    figure = canvas.figure(8.0 + 4.0 * (len(views) - 1), 1.8 + 2.2 * len(shown))
    grid = canvas.panels(figure, len(shown), len(views))
    for view, panels in zip(views, grid, strict=True):
        for panel, axis in zip(panels, shown, strict=True):
            for number, trace in enumerate(view.traces):
                label = _vibration_label(trace, axis)
                _curve(panel, number, label, trace.times_s, trace.deflection_mm[:, axis] * 1e3, fine=len(views) > 1)
                if trace.stops:
                    panel.axvline(trace.rest_s, color=_colour(number), linewidth=1, linestyle=(0, (4, 3)))
            panel.axhline(0, color=canvas.GREY, linewidth=0.6, zorder=0)
            canvas.legend_above(panel)
            _spread_flat(panel)
        _column_heading(panels[0], view)
        panels[-1].set_xlabel(view.time_label)
    for panel, axis in zip(grid[0], shown, strict=True):
        panel.set_ylabel(f"{_AXIS_NAMES[axis]} table − command\nin µm")
    notes = ["dashed: the command has come to rest"] if any(trace.stops for trace in traces) else []
    notes += (
        [f"{', '.join(_AXIS_NAMES[axis] for axis in still)}: rigid (below {_SHOWN_MM * 1e3:g} µm)"] if still else []
    )
    canvas.heading(figure, "; ".join(["Vibration", *notes]), part)
    figure.align_ylabels(grid[0])
    canvas.save(figure, file)


def _checked_polyline(name: str, points: npt.ArrayLike) -> FloatArray:
    polyline = np.asarray(points, dtype=np.float64)
    if polyline.ndim != 2 or polyline.shape[1] != 3 or len(polyline) < 2 or not np.isfinite(polyline).all():
        raise ValueError(f"{name} has shape {polyline.shape}: must be (m, 3), m >= 2, and finite")
    return polyline


def _check_traces(traces: Sequence[Trace]) -> None:
    if not traces:
        raise ValueError("no trace: must be one or more")


def _check_views(views: Sequence[View]) -> None:
    if not views:
        raise ValueError("no view: must be one or more")
    for view in views:
        _check_traces(view.traces)


def _path_label(trace: Trace, deviation: FloatArray, quantity: str, *, is_part: bool) -> str:
    """Name and figures: the core's own, which also see what lies between and beyond the samples drawn."""
    here = f"{1e3 * float(np.linalg.norm(deviation, axis=1).max()):.1f} µm"
    if trace.largest_mm is None or quantity != "response":
        return f"{trace.label}, largest {here} in this picture"
    return f"{trace.label}, largest {1e3 * trace.largest_mm:.1f} µm" + (f", here {here}" if is_part else "")


def _vibration_label(trace: Trace, axis: int) -> str:
    deflection = np.abs(trace.deflection_mm[:, axis])
    if not trace.stops:
        return f"{trace.label}, here up to {1e3 * float(deflection.max()):.1f} µm"
    if trace.residual_mm is not None:
        return f"{trace.label}, residual {1e3 * trace.residual_mm[axis]:.1f} µm"
    remaining = deflection[trace.times_s >= trace.rest_s - trace.period_s / 2]
    return f"{trace.label}, residual {1e3 * float(remaining.max()):.1f} µm"


def _only_along(polyline: FloatArray, deviations: Sequence[FloatArray]) -> bool:
    """Whether the path is one straight line and nothing deviates across it."""
    chord = polyline[-1] - polyline[0]
    length = float(np.linalg.norm(chord))
    if length == 0:
        return False
    direction = chord / length

    def across(vectors: FloatArray) -> float:
        return float(np.linalg.norm(vectors - np.outer(vectors @ direction, direction), axis=1).max())

    return across(polyline - polyline[0]) < _MOVES_MM and max(map(across, deviations)) < _SHOWN_MM


def _colour(number: int) -> str:
    return canvas.COLOURS[number % len(canvas.COLOURS)]


def _width(number: int) -> float:
    return _WIDTHS[number % len(_WIDTHS)]


def _moving_axes(traces: Sequence[Trace]) -> list[int]:
    """Axes that move in any trace; X where none does, so that a picture is never empty."""
    travel = np.max([np.ptp(trace.command_mm, axis=0) for trace in traces], axis=0)
    return [axis for axis in range(3) if travel[axis] > _MOVES_MM] or [0]


def follow(
    command_mm: FloatArray, points_mm: FloatArray, polyline_mm: FloatArray, *, complete: bool
) -> tuple[FloatArray, FloatArray]:
    """Where on a polyline are samples that follow it? For drawing; figures come from the core's metrology.

    Where the polyline passes a place twice, the distance that the command has gone decides.

    Args:
        command_mm: set-points, shape (n, 3).
        points_mm: the samples asked for at the same instants, shape (n, 3).
        polyline_mm: shape (m, 3).
        complete: the command ends where the polyline ends; where it begins, it begins in any case.

    Returns:
        Distance of each foot along the polyline, shape (n,), and the foot itself, shape (n, 3).
    """
    vertices = _refine(polyline_mm)
    lengths = np.linalg.norm(np.diff(vertices, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    steps = np.linalg.norm(np.diff(command_mm, axis=0), axis=1)
    gone = np.concatenate([[0.0], np.cumsum(steps)])
    if complete and gone[-1] > 0:
        gone *= along[-1] / gone[-1]
    return _feet(points_mm, vertices, gone, _PROGRESS_WEIGHT)


def _foot_points(points: FloatArray, polyline: FloatArray) -> FloatArray:
    """Nearest point of the polyline to each point, wherever on it."""
    return _feet(points, _refine(polyline), np.zeros(len(points)), 0.0)[1]


def _feet(points: FloatArray, vertices: FloatArray, gone: FloatArray, weight: float) -> tuple[FloatArray, FloatArray]:
    """Nearest points of the polyline, as distances along it and places."""
    from scipy.spatial import KDTree

    if len(vertices) < 2:
        return np.zeros(len(points)), np.broadcast_to(vertices[0], points.shape).copy()
    lengths = np.linalg.norm(np.diff(vertices, axis=0), axis=1)
    distance = np.concatenate([[0.0], np.cumsum(lengths)])
    tree = KDTree(np.column_stack([vertices, weight * distance]))
    nearest = tree.query(np.column_stack([points, weight * gone]), workers=-1)[1]
    feet, best = np.empty_like(points), np.full(len(points), np.inf)
    progress = np.zeros(len(points))
    # The foot lies on a segment near the nearest vertex.
    for shift in range(-_SEGMENTS_ASKED, _SEGMENTS_ASKED):
        first = np.clip(nearest + shift, 0, len(vertices) - 2)
        start, chord = vertices[first], vertices[first + 1] - vertices[first]
        dot = np.einsum("ij,ij->i", points - start, chord)
        share = np.clip(dot / np.einsum("ij,ij->i", chord, chord), 0, 1)
        candidate = start + share[:, None] * chord
        distance2 = np.einsum("ij,ij->i", points - candidate, points - candidate)
        closer = distance2 < best
        feet[closer], best[closer] = candidate[closer], distance2[closer]
        progress[closer] = (distance[first] + share * lengths[first])[closer]
    return progress, feet


def _refine(polyline: FloatArray) -> FloatArray:
    """The polyline without repeated points, its long segments split, so that vertices stand for the path."""
    lengths = np.linalg.norm(np.diff(polyline, axis=0), axis=1)
    polyline = polyline[np.concatenate([[True], lengths > 0])]
    lengths = lengths[lengths > 0]
    if not len(lengths):
        return polyline
    pieces = np.ceil(lengths / max(lengths.sum() / _PATH_PIECES, _SHORTEST_PIECE_MM)).astype(np.intp)
    segment = np.repeat(np.arange(len(pieces)), pieces)
    share = (np.arange(len(segment)) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[segment]
    split = polyline[segment] + share[:, None] * (polyline[segment + 1] - polyline[segment])
    return np.concatenate([split, polyline[-1:]])


def _round_factor(factor: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... that is not above the factor; at least 1."""
    if factor <= 1:
        return 1.0
    decade = 10.0 ** math.floor(math.log10(factor))
    return max(step * decade for step in (1, 2, 5) if step * decade <= factor * (1 + 1e-9))


def _path_axes(figure: Figure, *, with_locator: bool) -> tuple[Axes, Axes | None]:
    if not with_locator:
        return figure.add_subplot(), None
    grid: Any = figure.subplots(1, 2, width_ratios=[2.4, 1])
    return grid[0], grid[1]


def _locate(axes: Axes, whole: FloatArray, piece: FloatArray) -> None:
    """The whole path, small, and where the piece lies on it."""
    axes.plot(whole[:, 0], whole[:, 1], color=canvas.GREY, linewidth=0.8)
    axes.plot(piece[:, 0], piece[:, 1], color="black", linewidth=2)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(piece, axis=0), axis=1))])
    middle = [float(np.interp(along[-1] / 2, along, piece[:, axis])) for axis in range(2)]
    axes.plot(*middle, marker="o", markersize=16, markerfacecolor="none", markeredgecolor="black")
    axes.set_aspect("equal", adjustable="box", anchor="N")
    axes.margins(0.08)
    axes.set_title("where that is on the whole path", loc="left", fontsize=9)
    axes.tick_params(labelsize=8)


def _curve(panel: Axes, number: int, label: str, times: FloatArray, values: FloatArray, *, fine: bool = False) -> None:
    t, v = thin_min_max(times, values)
    panel.plot(t, v, color=_colour(number), linewidth=_width(number) / (2 if fine else 1), label=label)


def _spread_flat(panel: Axes) -> None:
    """A curve at zero is a line in the middle, not rounding writ large."""
    if max(map(abs, panel.get_ylim())) < _FLAT:
        panel.set_ylim(-1, 1)


def _column_heading(panel: Axes, view: View) -> None:
    if view.heading:
        panel.set_title(view.heading, loc="left", fontsize=10, pad=22)


def _deviation_scale(axes: Axes, factor: float, largest_mm: float) -> None:
    """A bar that shows how long a round number of µm is drawn."""
    from matplotlib.lines import Line2D
    from matplotlib.offsetbox import AnchoredOffsetbox, AuxTransformBox, TextArea, VPacker

    if largest_mm <= 0:
        return
    target_um = largest_mm * 1e3
    decade = 10.0 ** math.floor(math.log10(target_um))
    length_um = max(step * decade for step in (1, 2, 5) if step * decade <= target_um * (1 + 1e-9))
    length_mm = factor * length_um / 1e3
    bar = AuxTransformBox(axes.transData)
    bar.add_artist(Line2D([0, length_mm], [0, 0], color="black", linewidth=2.5, solid_capstyle="butt"))
    label = TextArea(f"{length_um:g} µm of deviation")
    packed = VPacker(children=[bar, label], align="center", pad=0, sep=4)
    above = AnchoredOffsetbox(
        "lower right", child=packed, frameon=False, pad=0.4, bbox_to_anchor=(1.0, 1.0), bbox_transform=axes.transAxes
    )
    axes.add_artist(above)
