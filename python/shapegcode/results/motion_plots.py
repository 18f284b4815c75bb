"""Played motion, one plot per question: how far off the path, how fast, how much vibration.

They are functions of data: of traces of any motion, measured ones too. The first trace, usually the original program,
is the wider line, so that it shows beneath the others.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from shapegcode.results import plot
from shapegcode.results.follow import follow
from shapegcode.results.trace import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Plane", "View", "plot_feed", "plot_path", "plot_vibration", "thin_min_max"]

FloatArray = npt.NDArray[np.float64]
Plane = Literal["XY", "ZX", "YZ"]

_AXIS_NAMES = "XYZ"
_WIDTHS = (2.4, 0.9, 0.9, 0.9)
_MAX_POINTS = 4000
_MOVES_MM = 1e-9
# A deflection below this is none.
_SHOWN_MM = 5e-5
_STRAIGHT = (
    "The path is straight: the table deviates along it only,\nwhich no drawing of the path shows. "
    "See the picture of the vibration."
)
_FLAT = 0.06  # of an axis in µm or mm/min


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
    programmed_mm: npt.ArrayLike,
    traces: Sequence[Trace],
    ax: Axes | None = None,
    *,
    quantity: Literal["response", "command"] = "response",
    plane: Plane = "XY",
    magnification: float | None = None,
    part: str = "",
    whole_mm: npt.ArrayLike | None = None,
) -> Axes:
    """How far, and to which side, does the table leave the programmed path?

    Each curve is the programmed path plus the deviation times the magnification, every sample of it; the title says the
    magnification. The legend has the figure that the core measured over the whole run; where a trace has none, that of
    the samples drawn.

    Args:
        programmed_mm: the programmed path as a polyline, shape (m, 3), fine enough for its arcs.
        traces: usually the original and the emitted program.
        ax: where to draw; None: a new figure.
        quantity: deviation of the table ("response") or of the set-points ("command").
        plane: plane of the picture.
        magnification: factor of the deviation; None: chosen so that the largest one is easy to see.
        part: which part of the program this is, for the title.
        whole_mm: the whole path where `programmed_mm` is a piece of it, shape (k, 3): a second panel shows where
            the piece lies.

    Returns:
        The panel of the path.

    Raises:
        ValueError: a wrong shape or magnification, or no trace.
    """
    polyline = _checked_polyline("programmed_mm", programmed_mm)
    whole = None if whole_mm is None else _checked_polyline("whole_mm", whole_mm)
    _check_traces(traces)
    if magnification is not None and not (math.isfinite(magnification) and magnification > 0):
        raise ValueError(f"magnification = {magnification}: must be finite and greater than 0")

    drawn = [(trace, *_deviation(trace, polyline, quantity, whole is None)) for trace in traces]
    largest_mm = max(float(np.linalg.norm(deviation, axis=1).max()) for _, _, deviation in drawn)
    size_mm = float(np.linalg.norm(np.ptp(polyline, axis=0)))
    factor = magnification or _round_factor(0.1 * size_mm / largest_mm if largest_mm > 0 else 1.0)

    what = "table" if quantity == "response" else "command"
    widths = [1.0] if whole is None else [2.4, 1.0]
    panels = plot.grid(
        ax, 1, len(widths), size_inch=(7.2 if whole is None else 10.4, 6.4), width_ratios=widths,
        title=f"Deviation of the {what} from the path, drawn ×{factor:g}", part=part,
    )[0]  # fmt: skip
    panel, shown = panels[0], [_AXIS_NAMES.index(name) for name in plane]
    panel.plot(*polyline[:, shown].T, color=plot.GREY, linewidth=3, alpha=0.55, label="programmed path")
    straight = _only_along(polyline, [deviation for _, _, deviation in drawn])
    for number, (trace, feet, deviation) in enumerate(drawn):
        curve = (feet + factor * deviation)[:, shown]
        label = _path_label(trace, deviation, quantity, is_part=whole is not None)
        # Of a straight path the label alone.
        panel.plot(*curve[: 0 if straight else None].T, color=_colour(number), linewidth=_width(number), label=label)
    panel.set_aspect("equal", adjustable="datalim")
    panel.margins(0.08)
    panel.set_xlabel(f"{plane[0]} in mm")
    panel.set_ylabel(f"{plane[1]} in mm")
    if straight:
        panel.text(0.5, 0.3, _STRAIGHT, transform=panel.transAxes, ha="center", va="center")
    else:
        _deviation_scale(panel, factor, largest_mm)
    plot.legend_above(panel, columns=1)
    if whole is not None:
        _locate(panels[1], whole[:, shown], polyline[:, shown])
    return panel


def plot_feed(views: Sequence[View], ax: Axes | None = None, *, part: str = "") -> Axes:
    """How fast does the command go, along the path and per axis?

    Args:
        views: stretches of time, side by side.
        ax: where to draw; None: a new figure.
        part: which part of the program this is, for the title.

    Returns:
        The first panel.

    Raises:
        ValueError: no view, or no trace.
    """
    _check_views(views)
    moving = _moving_axes([trace for view in views for trace in view.traces])
    names = ["path feed\nin mm/min", *(f"{_AXIS_NAMES[axis]} speed\nin mm/min" for axis in moving)]
    columns = _columns(ax, views, names, 1.7, "Feed of the command", part)
    for view, panels in zip(views, columns, strict=True):
        for number, trace in enumerate(view.traces):
            speeds = np.diff(trace.command_mm, axis=0) / trace.period_s * 60
            # A difference belongs to the middle of its period.
            middles = trace.times_s[:-1] + trace.period_s / 2
            curves = [np.linalg.norm(speeds, axis=1), *(speeds[:, axis] for axis in moving)]
            for panel, values in zip(panels, curves, strict=True):
                _curve(panel, number, trace.label, middles, values)
        for panel in panels:
            _spread_flat(panel)
        plot.legend_above(panels[0])
        # Standstill before and after says nothing about feed.
        begin = min(trace.departure_s for trace in view.traces)
        end = max(trace.rest_s if trace.stops else float(trace.times_s[-1]) for trace in view.traces)
        margin = 0.03 * (end - begin) or view.traces[0].period_s
        panels[-1].set_xlim(begin - margin, end + margin)
    return columns[0][0]


def plot_vibration(views: Sequence[View], ax: Axes | None = None, *, part: str = "") -> Axes:
    """How much does each axis swing about its command, and how much of it remains after the stop?

    Axes that do not swing are named, not drawn.

    Args:
        views: stretches of time, side by side.
        ax: where to draw; None: a new figure.
        part: which part of the program this is, for the title.

    Returns:
        The first panel.

    Raises:
        ValueError: no view, or no trace.
    """
    _check_views(views)
    traces = [trace for view in views for trace in view.traces]
    moving = _moving_axes(traces)
    swing_mm = np.max([np.abs(trace.deflection_mm).max(axis=0) for trace in traces], axis=0)
    swinging = [axis for axis in moving if swing_mm[axis] >= _SHOWN_MM]
    still = [_AXIS_NAMES[axis] for axis in moving if axis not in swinging]
    shown = swinging or moving[:1]
    said = ["Vibration"]
    said += ["dashed: the command has come to rest"] if any(trace.stops for trace in traces) else []
    said += [f"{', '.join(still)}: rigid (below {_SHOWN_MM * 1e3:g} µm)"] if still else []
    names = [f"{_AXIS_NAMES[axis]} table − command\nin µm" for axis in shown]
    columns = _columns(ax, views, names, 2.2, "; ".join(said), part)
    for view, panels in zip(views, columns, strict=True):
        for panel, axis in zip(panels, shown, strict=True):
            for number, trace in enumerate(view.traces):
                label = _vibration_label(trace, axis)
                _curve(panel, number, label, trace.times_s, trace.deflection_mm[:, axis] * 1e3, fine=len(views) > 1)
                if trace.stops:
                    panel.axvline(trace.rest_s, color=_colour(number), linewidth=1, linestyle=(0, (4, 3)))
            panel.axhline(0, color=plot.GREY, linewidth=0.6, zorder=0)
            plot.legend_above(panel)
            _spread_flat(panel)
    return columns[0][0]


def _columns(
    ax: Axes | None, views: Sequence[View], names: Sequence[str], row_inch: float, title: str, part: str
) -> list[list[Axes]]:
    """One column of panels per view, each with its own time axis; `names` are those of the rows."""
    size_inch = (8.0 + 4.0 * (len(views) - 1), 1.8 + row_inch * len(names))
    rows = plot.grid(ax, len(names), len(views), size_inch=size_inch, title=title, part=part, sharex="col")
    for row, name in zip(rows, names, strict=True):
        row[0].set_ylabel(name)
        for panel in row:
            panel.margins(x=0.01)
    for view, top, lowest in zip(views, rows[0], rows[-1], strict=True):
        lowest.set_xlabel(view.time_label)
        if view.heading:
            top.set_title(view.heading, loc="left", fontsize=10, pad=22)
    columns = [list(column) for column in zip(*rows, strict=True)]
    columns[0][0].figure.align_ylabels(columns[0])
    return columns


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


def _deviation(trace: Trace, polyline: FloatArray, quantity: str, is_whole: bool) -> tuple[FloatArray, FloatArray]:
    """Where each sample belongs on the path, and how far it is from there."""
    points = trace.response_mm if quantity == "response" else trace.command_mm
    _, feet = follow(trace.command_mm, points, polyline, complete=trace.stops and is_whole)
    return feet, points - feet


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
    return plot.COLOURS[number % len(plot.COLOURS)]


def _width(number: int) -> float:
    return _WIDTHS[number % len(_WIDTHS)]


def _moving_axes(traces: Sequence[Trace]) -> list[int]:
    """Axes that move in any trace; X where none does, so that a picture is never empty."""
    travel = np.max([np.ptp(trace.command_mm, axis=0) for trace in traces], axis=0)
    return [axis for axis in range(3) if travel[axis] > _MOVES_MM] or [0]


def _round_factor(factor: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... that is not above the factor; at least 1."""
    if factor <= 1:
        return 1.0
    decade = 10.0 ** math.floor(math.log10(factor))
    return max(step * decade for step in (1, 2, 5) if step * decade <= factor * (1 + 1e-9))


def _locate(axes: Axes, whole: FloatArray, piece: FloatArray) -> None:
    """The whole path, small, and where the piece lies on it."""
    axes.plot(whole[:, 0], whole[:, 1], color=plot.GREY, linewidth=0.8)
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
