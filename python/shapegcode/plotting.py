"""Pictures of a conversion, one per question: how far off the path, how fast, how much vibration.

Matplotlib is imported when the first picture is drawn and draws to files only (PNG or SVG, by the file's
ending); no window system and no global state are touched. Colours are those of Okabe and Ito, which
colour-blind readers can tell apart; the original program is also the thinner line.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from shapegcode.report import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot_feed", "plot_path", "plot_vibration", "thin_min_max"]

FloatArray = npt.NDArray[np.float64]
Plane = Literal["XY", "ZX", "YZ"]

_AXIS_NAMES = "XYZ"
_COLOURS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7")
_WIDTHS = (0.9, 1.4, 1.4, 1.4)
_GREY = "#8a8a8a"
_MAX_POINTS = 4000
_FORMATS = (".png", ".svg")
_MOVES_MM = 1e-9
# Pieces of the programmed path among which the nearest one is looked for.
_PATH_PIECES = 20_000


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


def plot_path(
    file: str | Path,
    programmed_mm: npt.ArrayLike,
    traces: Sequence[Trace],
    *,
    quantity: Literal["response", "command"] = "response",
    plane: Plane = "XY",
    magnification: float | None = None,
) -> float:
    """How far, and to which side, does the table leave the programmed path?

    Each curve is the programmed path plus the deviation times the magnification.

    Args:
        file: ``.png`` or ``.svg``.
        programmed_mm: the programmed path as a polyline, shape (m, 3), fine enough for its arcs.
        traces: usually the original and the emitted program.
        quantity: deviation of the table ("response") or of the set-points ("command").
        plane: plane of the picture.
        magnification: factor of the deviation; None: chosen so that the largest one is easy to see.

    Returns:
        The magnification that was used.

    Raises:
        ValueError: a wrong shape, ending or magnification.
        OSError: the file cannot be written.
    """
    polyline = np.asarray(programmed_mm, dtype=np.float64)
    if polyline.ndim != 2 or polyline.shape[1] != 3 or len(polyline) < 2 or not np.isfinite(polyline).all():
        raise ValueError(f"programmed_mm has shape {polyline.shape}: must be (m, 3), m >= 2, and finite")
    _check_traces(traces)
    if magnification is not None and not (math.isfinite(magnification) and magnification > 0):
        raise ValueError(f"magnification = {magnification}: must be finite and greater than 0")

    drawn = []
    for trace in traces:
        points = _telling_samples(trace, quantity)
        feet = _foot_points(points, polyline)
        drawn.append((trace.label, feet, points - feet))
    largest_mm = max(float(np.linalg.norm(deviation, axis=1).max()) for _, _, deviation in drawn)
    size_mm = float(np.linalg.norm(np.ptp(polyline, axis=0)))
    factor = magnification or _round_factor(0.1 * size_mm / largest_mm if largest_mm > 0 else 1.0)

    across, up = (_AXIS_NAMES.index(name) for name in plane)
    figure = _figure(7.2, 6.4)
    axes = figure.add_subplot()
    axes.plot(polyline[:, across], polyline[:, up], color=_GREY, linewidth=3, alpha=0.55, label="programmed path")
    for number, (label, feet, deviation) in enumerate(drawn):
        curve = feet + factor * deviation
        largest_um = 1e3 * float(np.linalg.norm(deviation, axis=1).max())
        axes.plot(
            curve[:, across],
            curve[:, up],
            color=_colour(number),
            linewidth=_width(number),
            label=f"{label}, largest {largest_um:.1f} µm",
        )
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    axes.set_xlabel(f"{plane[0]} in mm")
    axes.set_ylabel(f"{plane[1]} in mm")
    what = "table" if quantity == "response" else "command"
    _title(axes, f"Deviation of the {what} from the path, drawn ×{factor:g}")
    _deviation_scale(axes, factor, largest_mm)
    axes.legend(loc="best", frameon=False)
    _save(figure, file)
    return factor


def plot_feed(file: str | Path, traces: Sequence[Trace]) -> None:
    """How fast does the command go, along the path and per axis?

    Args:
        file: ``.png`` or ``.svg``.
        traces: usually the original and the emitted program.

    Raises:
        ValueError: a wrong ending, or no trace.
        OSError: the file cannot be written.
    """
    _check_traces(traces)
    moving = _moving_axes(traces)
    figure = _figure(8.0, 1.6 + 1.7 * (1 + len(moving)))
    panels = _panels(figure, 1 + len(moving))
    for number, trace in enumerate(traces):
        speeds = np.diff(trace.command_mm, axis=0) / trace.period_s * 60
        # A difference belongs to the middle of its period.
        middles = trace.times_s[:-1] + trace.period_s / 2
        curves = [np.linalg.norm(speeds, axis=1), *(speeds[:, axis] for axis in moving)]
        for panel, values in zip(panels, curves, strict=True):
            _curve(panel, number, trace.label, middles, values)
    panels[0].set_ylabel("path feed\nin mm/min")
    for panel, axis in zip(panels[1:], moving, strict=True):
        panel.set_ylabel(f"{_AXIS_NAMES[axis]} speed\nin mm/min")
    _title(panels[0], "Feed of the command", above_legend=True)
    _legend_above(panels[0])
    # Standstill before and after says nothing about feed.
    begin, end = min(trace.departure_s for trace in traces), max(trace.rest_s for trace in traces)
    margin = 0.03 * (end - begin) or traces[0].period_s
    panels[-1].set_xlim(begin - margin, end + margin)
    panels[-1].set_xlabel("time in s")
    figure.align_ylabels(panels)
    _save(figure, file)


def plot_vibration(file: str | Path, traces: Sequence[Trace], *, rest_s: Mapping[str, float] | None = None) -> None:
    """How much does each axis swing about its command, and how much of it remains after the stop?

    Args:
        file: ``.png`` or ``.svg``.
        traces: usually the original and the emitted program.
        rest_s: by label, the instant from which vibration counts as residual; None: where the trace's command
            has come to rest.

    Raises:
        ValueError: a wrong ending, no trace, or an instant outside its trace.
        OSError: the file cannot be written.
    """
    _check_traces(traces)
    instants = [float((rest_s or {}).get(trace.label, trace.rest_s)) for trace in traces]
    for trace, instant in zip(traces, instants, strict=True):
        if not 0 <= instant <= len(trace.command_mm) * trace.period_s:
            raise ValueError(
                f"trace {trace.label}: rest at {instant} s is outside the trace, which ends at "
                f"{trace.times_s[-1]:.6g} s"
            )
    moving = _moving_axes(traces)
    figure = _figure(8.0, 1.6 + 2.2 * len(moving))
    panels = _panels(figure, len(moving))
    for panel, axis in zip(panels, moving, strict=True):
        for number, (trace, instant) in enumerate(zip(traces, instants, strict=True)):
            deflection_um = trace.deflection_mm[:, axis] * 1e3
            remaining = deflection_um[trace.times_s >= instant - trace.period_s / 2]
            residual = float(np.abs(remaining).max()) if len(remaining) else 0.0
            _curve(panel, number, f"{trace.label}, residual {residual:.1f} µm", trace.times_s, deflection_um)
            panel.axvline(instant, color=_colour(number), linewidth=1, linestyle=(0, (4, 3)))
        panel.axhline(0, color=_GREY, linewidth=0.6, zorder=0)
        panel.set_ylabel(f"{_AXIS_NAMES[axis]} table − command\nin µm")
        _legend_above(panel)
    _title(panels[0], "Vibration; dashed: the command has come to rest", above_legend=True)
    panels[-1].set_xlabel("time in s")
    figure.align_ylabels(panels)
    _save(figure, file)


def _check_traces(traces: Sequence[Trace]) -> None:
    if not traces:
        raise ValueError("no trace: must be one or more")


def _colour(number: int) -> str:
    return _COLOURS[number % len(_COLOURS)]


def _width(number: int) -> float:
    return _WIDTHS[number % len(_WIDTHS)]


def _moving_axes(traces: Sequence[Trace]) -> list[int]:
    """Axes that move in any trace; X where none does, so that a picture is never empty."""
    travel = np.max([np.ptp(trace.command_mm, axis=0) for trace in traces], axis=0)
    return [axis for axis in range(3) if travel[axis] > _MOVES_MM] or [0]


def _telling_samples(trace: Trace, quantity: str) -> FloatArray:
    """Positions to draw; of a long trace one per stretch, the one that swings most."""
    points = trace.response_mm if quantity == "response" else trace.command_mm
    if len(points) <= _MAX_POINTS:
        return points
    starts = np.linspace(0, len(points), _MAX_POINTS, endpoint=False).astype(np.intp)
    swing = np.linalg.norm(trace.deflection_mm, axis=1)
    ends = [*starts[1:], len(points)]
    chosen = [begin + int(np.argmax(swing[begin:end])) for begin, end in zip(starts, ends, strict=True)]
    return points[np.array([0, *chosen, len(points) - 1], dtype=np.intp)]


def _foot_points(points: FloatArray, polyline: FloatArray) -> FloatArray:
    """Nearest point of the polyline to each point: for drawing; figures come from the core's metrology."""
    from scipy.spatial import KDTree

    vertices = _refine(polyline)
    if len(vertices) < 2:
        return np.broadcast_to(vertices[0], points.shape).copy()
    nearest = KDTree(vertices).query(points)[1]
    feet, best = np.empty_like(points), np.full(len(points), np.inf)
    # The foot lies on one of the two segments that meet in the nearest vertex.
    for shift in (-1, 0):
        first = np.clip(nearest + shift, 0, len(vertices) - 2)
        start, along = vertices[first], vertices[first + 1] - vertices[first]
        dot = np.einsum("ij,ij->i", points - start, along)
        share = np.clip(dot / np.einsum("ij,ij->i", along, along), 0, 1)
        candidate = start + share[:, None] * along
        distance2 = np.einsum("ij,ij->i", points - candidate, points - candidate)
        closer = distance2 < best
        feet[closer], best[closer] = candidate[closer], distance2[closer]
    return feet


def _refine(polyline: FloatArray) -> FloatArray:
    """The polyline without repeated points, its long segments split, so that vertices stand for the path."""
    lengths = np.linalg.norm(np.diff(polyline, axis=0), axis=1)
    polyline = polyline[np.concatenate([[True], lengths > 0])]
    lengths = lengths[lengths > 0]
    if not len(lengths):
        return polyline
    pieces = np.ceil(lengths / (lengths.sum() / _PATH_PIECES)).astype(np.intp)
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


def _figure(width_inch: float, height_inch: float) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_inch, height_inch), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def _panels(figure: Figure, count: int) -> list[Axes]:
    """Panels one below the other that share the time axis."""
    grid: Any = figure.subplots(count, 1, sharex=True, squeeze=False)
    panels: list[Axes] = list(grid[:, 0])
    for panel in panels:
        panel.grid(True, color="#e4e4e4", linewidth=0.6)
        panel.set_axisbelow(True)
        panel.margins(x=0.01)
        panel.spines[["top", "right"]].set_visible(False)
    return panels


def _curve(panel: Axes, number: int, label: str, times: FloatArray, values: FloatArray) -> None:
    t, v = thin_min_max(times, values)
    panel.plot(t, v, color=_colour(number), linewidth=_width(number), label=label)


def _title(axes: Axes, text: str, *, above_legend: bool = False) -> None:
    axes.set_title(text, loc="left", fontsize=11, pad=24 if above_legend else 8)


def _legend_above(panel: Axes) -> None:
    """Legend between the panel and what is above it, where it hides no curve."""
    panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False, borderaxespad=0.2, fontsize=9)


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
    axes.add_artist(AnchoredOffsetbox("lower right", child=packed, frameon=False, pad=0.4))


def _save(figure: Figure, file: str | Path) -> None:
    """Write the picture; the same data gives the same bytes."""
    import matplotlib

    path = Path(file)
    suffix = path.suffix.lower()
    if suffix not in _FORMATS:
        raise ValueError(f"{path}: the ending of a picture must be one of {', '.join(_FORMATS)}")
    if suffix == ".svg":
        with matplotlib.rc_context({"svg.hashsalt": "shapegcode", "svg.fonttype": "none"}):
            figure.savefig(path, format="svg", metadata={"Date": None})
    else:
        figure.savefig(path, format="png", dpi=150, metadata={"Software": None})
