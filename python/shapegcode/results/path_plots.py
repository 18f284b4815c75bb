"""Plots of a path and its motion in a plane, deviations magnified; pictures of the worst position of a region."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.results import motion_plots, plot
from shapegcode.results.motion_plots import Trace, View, line_style, plot_feed, plot_vibration
from shapegcode.results.outcome import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Plane = Literal["XY", "ZX", "YZ"]

_STRAIGHT = (
    "The path is straight: the table deviates along it only,\nwhich is not visible here. "
    "See the picture of the vibration."
)

_CUT = "Corners: each side is drawn up to the bisector of the corner, with its own deviation."
# A smaller angle between two segments is one of an arc that is approximated by lines.
_CORNER_RAD = 0.3
# If the curves at both sides of a corner are further apart than this fraction of the path's size, they are not joined.
_APART = 0.01
# Ratio of lengths above which a drawn curve oscillates about its path.
_DEFLECTED = 4.0


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
    """Plot the deviation of the table, or of the command, from the programmed path, magnified.

    Each curve is the programmed path plus the magnified deviation of every sample; the title gives the
    magnification. The legend states the largest deviation: of the table over the whole run, if the core measured it,
    else of the samples drawn.

    Args:
        programmed_mm: the programmed path as a polyline, shape (m, 3), fine enough for its arcs.
        traces: usually the original and the emitted program.
        ax: where to draw; None: a new figure.
        quantity: deviation of the table ("response") or of the set-points ("command").
        plane: plane of the picture.
        magnification: factor of the deviation; None: chosen so that the largest one is easy to see.
        part: part of the program, for the title.
        whole_mm: the whole path if `programmed_mm` is a part of it, shape (k, 3): a second panel shows
            the position of the part.

    Returns:
        The panel of the path.

    Raises:
        ValueError: a wrong shape or magnification, or no trace.
    """
    polyline = _checked_polyline("programmed_mm", programmed_mm)
    whole = None if whole_mm is None else _checked_polyline("whole_mm", whole_mm)
    if not traces:
        raise ValueError("no trace: must be one or more")
    if magnification is not None and not (math.isfinite(magnification) and magnification > 0):
        raise ValueError(f"magnification = {magnification}: must be finite and greater than 0")

    drawn = []
    for trace in traces:
        points = trace.response_mm if quantity == "response" else trace.command_mm
        along, feet = follow(trace.command_mm, points, polyline, complete=trace.stops and whole is None)
        drawn.append((trace, along, feet, points - feet))
    largest_mm = max(float(np.linalg.norm(deviation, axis=1).max()) for *_, deviation in drawn)
    size_mm = float(np.linalg.norm(np.ptp(polyline, axis=0)))
    factor = magnification or plot.round_below(max(0.1 * size_mm / largest_mm, 1.0) if largest_mm > 0 else 1.0)

    cut = False
    what = "table" if quantity == "response" else "command"
    widths = [1.0] if whole is None else [2.4, 1.0]
    panels = plot.grid(
        ax, 1, len(widths), size_inch=(7.2 if whole is None else 10.4, 6.4), width_ratios=widths,
        title=f"Deviation of the {what} from the path, drawn ×{factor:g}", part=part,
    )[0]  # fmt: skip
    panel, shown = panels[0], [motion_plots.AXIS_NAMES.index(name) for name in plane]
    panel.plot(*polyline[:, shown].T, color=plot.GREY, linewidth=3, alpha=0.55, label="programmed path")
    straight = _only_along(polyline, [deviation for *_, deviation in drawn])
    for number, (trace, along, feet, deviation) in enumerate(drawn):
        curve = (feet + factor * deviation)[:, shown]
        breaks = _at_corners(along, polyline, curve, _APART * size_mm)
        cut = cut or bool(len(breaks))
        curve = np.insert(curve, breaks, np.nan, axis=0)
        label = _path_label(trace, deviation, quantity, is_part=whole is not None)
        # For a straight path only the label.
        panel.plot(*curve[: 0 if straight else None].T, label=label, **_style(number, curve, polyline))
    panel.set_aspect("equal", adjustable="datalim")
    panel.margins(0.08)
    panel.set(xlabel=f"{plane[0]} in mm", ylabel=f"{plane[1]} in mm")
    if cut:
        panel.text(0.0, -0.13, _CUT, transform=panel.transAxes, fontsize=8, color="#555555", va="top")
    if straight:
        panel.text(0.5, 0.3, _STRAIGHT, transform=panel.transAxes, ha="center", va="center")
    else:
        _deviation_scale(panel, factor, largest_mm)
    plot.legend_above(panel, columns=1)
    if whole is not None:
        _locate(panels[1], whole[:, shown], polyline[:, shown])
    return panel


def _distances(polyline: FloatArray) -> FloatArray:
    """Distance of each vertex along a polyline, mm."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(polyline, axis=0), axis=1))])


def _checked_polyline(name: str, points: npt.ArrayLike) -> FloatArray:
    polyline = np.asarray(points, dtype=np.float64)
    if polyline.ndim != 2 or polyline.shape[1] != 3 or len(polyline) < 2 or not np.isfinite(polyline).all():
        raise ValueError(f"{name} has shape {polyline.shape}: must be (m, 3), m >= 2, and finite")
    return polyline


def _at_corners(along: FloatArray, polyline: FloatArray, curve: FloatArray, apart_mm: float) -> npt.NDArray[np.intp]:
    """Samples before which the nearest point jumps from one side of a corner to the other.

    Magnified, a line between the two samples would draw a loop that was not traversed.
    """
    steps = np.diff(polyline, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    steps, lengths = steps[lengths > 0], lengths[lengths > 0]
    directions = steps / lengths[:, None]
    turn = np.arccos(np.clip(np.einsum("ij,ij->i", directions[:-1], directions[1:]), -1.0, 1.0))
    passed = np.searchsorted(np.cumsum(lengths)[:-1][turn > _CORNER_RAD], along)
    far = np.linalg.norm(np.diff(curve, axis=0), axis=1) > apart_mm
    return np.flatnonzero((np.diff(passed) != 0) & far) + 1


def _style(number: int, curve: FloatArray, polyline: FloatArray) -> dict[str, Any]:
    """Style of a curve; an oscillating one is thinner, so that its cycles remain distinct."""
    drawn_mm = float(np.nansum(np.linalg.norm(np.diff(curve, axis=0), axis=1)))
    length_mm = float(_distances(polyline)[-1])
    style = line_style(number)
    return style if drawn_mm < _DEFLECTED * length_mm else style | {"linewidth": 0.6}


def _path_label(trace: Trace, deviation: FloatArray, quantity: str, *, is_part: bool) -> str:
    """Name and largest deviation of a trace; that of the core, if known, includes motion outside the samples drawn."""
    here = f"{1e3 * float(np.linalg.norm(deviation, axis=1).max()):.1f} µm"
    if trace.largest_mm is None or quantity != "response":
        return f"{trace.label}, largest {here} in this picture"
    return f"{trace.label}, largest {1e3 * trace.largest_mm:.1f} µm" + (f", here {here}" if is_part else "")


def _only_along(polyline: FloatArray, deviations: Sequence[FloatArray]) -> bool:
    """True if the path is one straight line and no deviation is perpendicular to it."""
    chord = polyline[-1] - polyline[0]
    length = float(np.linalg.norm(chord))
    if length == 0:
        return False
    direction = chord / length

    def across(vectors: FloatArray) -> float:
        return float(np.linalg.norm(vectors - np.outer(vectors @ direction, direction), axis=1).max())

    moves = across(polyline - polyline[0]) >= motion_plots.MOVES_MM
    return not moves and max(map(across, deviations)) < motion_plots.SHOWN_MM


def _locate(axes: Axes, whole: FloatArray, piece: FloatArray) -> None:
    """Draw the whole path, small, with the part marked on it."""
    axes.plot(whole[:, 0], whole[:, 1], color=plot.GREY, linewidth=0.8)
    axes.plot(piece[:, 0], piece[:, 1], color="black", linewidth=2)
    along = _distances(piece)
    middle = [float(np.interp(along[-1] / 2, along, piece[:, axis])) for axis in range(2)]
    axes.plot(*middle, marker="o", markersize=16, markerfacecolor="none", markeredgecolor="black")
    axes.set_aspect("equal", adjustable="box", anchor="N")
    axes.margins(0.08)
    axes.set_title("position on the whole path", loc="left", fontsize=9)
    axes.tick_params(labelsize=8)


def _deviation_scale(axes: Axes, factor: float, largest_mm: float) -> None:
    """Draw a scale bar: a round number of µm at the magnification of the deviation."""
    from matplotlib.lines import Line2D
    from matplotlib.offsetbox import AnchoredOffsetbox, AuxTransformBox, TextArea, VPacker

    if largest_mm <= 0:
        return
    length_um = plot.round_below(largest_mm * 1e3)
    length_mm = factor * length_um / 1e3
    bar = AuxTransformBox(axes.transData)
    bar.add_artist(Line2D([0, length_mm], [0, 0], color="black", linewidth=2.5, solid_capstyle="butt"))
    label = TextArea(f"{length_um:g} µm of deviation")
    packed = VPacker(children=[bar, label], align="center", pad=0, sep=4)
    above = AnchoredOffsetbox(
        "lower right", child=packed, frameon=False, pad=0.4, bbox_to_anchor=(1.0, 1.0), bbox_transform=axes.transAxes
    )
    axes.add_artist(above)


# Segments of the programmed path among which the nearest one is searched for.
_PATH_PIECES = 20_000
_SHORTEST_PIECE_MM = 0.01
# Weight of a distance along the path against the distance between a sample and the path.
_PROGRESS_WEIGHT = 0.03
_SEGMENTS_ASKED = 3  # on either side of the nearest vertex
_SAGITTA_MM = 1e-5

COARSE_STEP_RAD = 0.05  # angle of an arc between two points of a coarse polyline


def follow(
    command_mm: FloatArray, points: FloatArray, polyline_mm: FloatArray, *, complete: bool
) -> tuple[FloatArray, FloatArray]:
    """For each sample of a motion along a polyline (all of it, if *complete*) the nearest point: distance, position."""
    from scipy.spatial import KDTree

    vertices = _refine(polyline_mm)
    if len(vertices) < 2:
        return np.zeros(len(points)), np.broadcast_to(vertices[0], points.shape).copy()
    gone, distance = _distances(command_mm), _distances(vertices)
    if complete and gone[-1] > 0:
        gone *= distance[-1] / gone[-1]
    lengths = np.diff(distance)
    tree = KDTree(np.column_stack([vertices, _PROGRESS_WEIGHT * distance]))
    nearest = tree.query(np.column_stack([points, _PROGRESS_WEIGHT * gone]), workers=-1)[1]
    feet, best = np.empty_like(points), np.full(len(points), np.inf)
    progress = np.zeros(len(points))
    # The nearest point is on a segment near the nearest vertex; where the polyline passes a point twice, the distance
    # travelled has decided.
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
    """The polyline without repeated points and with long segments split, so that vertices represent the path."""
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


def _piece_of(polyline: FloatArray, begin_mm: float, end_mm: float) -> FloatArray:
    along = _distances(polyline)
    inside = (along > begin_mm) & (along < end_mm)
    ends = [[np.interp(s, along, polyline[:, axis]) for axis in range(3)] for s in (begin_mm, end_mm)]
    return np.concatenate([ends[:1], polyline[inside], ends[1:]])


def polyline_of(path: _core.Path) -> FloatArray:
    """The path as a polyline within a hundredth of a micrometre of its arcs."""
    if path.largest_sweep_rad == 0.0:
        return path.polyline()
    parts = [path.start_mm[None, :]]
    for index in range(len(path)):
        segment = path[index]
        if segment.kind == _core.SegmentKind.arc:
            step = math.sqrt(8.0 * _SAGITTA_MM / segment.radius_mm)
            parts.append(_core.Path([segment]).polyline(min(step, COARSE_STEP_RAD))[1:])
        else:
            parts.append(segment.end_mm[None, :])
    return np.concatenate(parts)


RECORD_SAMPLES = 1_000_000  # maximum number that a simulation records for pictures

# For a longer region its worst position and its stop are shown.
_WHOLE_S = 10.0
_MAX_SET_POINTS = (
    20_000  # set-points whose nearest point on the path is computed, some milliseconds apart in minutes of motion
)
_AROUND_S = 1.5
_BEFORE_STOP_S = 2.0


@dataclass(frozen=True, eq=False)
class SimulatedRegion:
    """Data for the pictures of a region."""

    traces: tuple[Trace, ...]  # one or more, for example of the original and of the emitted program
    path: _core.Path  # as programmed
    part: str = ""  # part of the program, for titles; empty for the whole

    @classmethod
    def of_runs(
        cls, runs: Mapping[str, _core.SimulationFigures], path: _core.Path, period_s: float, *,
        lines: tuple[int, int], regions: int,
    ) -> SimulatedRegion:  # fmt: skip
        """The region that vibrates most, from core simulations."""
        traces = tuple(_trace(label, run, period_s) for label, run in runs.items())
        parts = [f"lines {lines[0]} to {lines[1]}, the cut that vibrates most after its stop"] if regions > 1 else []
        if not traces[0].stops:
            parts.append(f"first {traces[0].times_s[-1]:.0f} s of {next(iter(runs.values())).duration_s:.0f} s")
        return cls(traces, path, "; ".join(parts))


def _trace(label: str, run: _core.SimulationFigures, period_s: float) -> Trace:
    x, y, z = (float(value) for value in run.residual_mm)
    return Trace(
        label, period_s, run.recorded_command, run.recorded_response, residual_mm=(x, y, z),
        stops=len(run.recorded_command) * period_s > run.duration_s, largest_mm=run.response.max_abs_mm,
    )  # fmt: skip


def motion_pictures(simulated: Callable[[], SimulatedRegion]) -> dict[str, Plot]:
    """Pictures of the path, feed and vibration of a region, by name."""
    scene = functools.cache(lambda: _Scene.of(simulated()))

    def path(ax: Axes | None = None) -> Axes:
        s = scene()
        plane = _widest_plane(s.programmed_mm)
        return plot_path(s.programmed_mm, s.near, ax, plane=plane, part=s.near_part, whole_mm=s.whole_mm)

    def over_time(draw: Plot) -> Plot:
        return lambda ax=None: draw(scene().views, ax, part=scene().part)

    return {"path": path, "feed": over_time(plot_feed), "vibration": over_time(plot_vibration)}


@dataclass(frozen=True, eq=False)
class _Scene:
    """The part of a region that is plotted."""

    views: tuple[View, ...]  # time ranges: the whole, or the worst position and the stop
    part: str  # part of the program
    near: tuple[Trace, ...]  # the traces; of a long region only around the worst position
    near_part: str  # part of the program that `near` shows
    programmed_mm: FloatArray  # programmed path of `near`, (m, 3)
    whole_mm: FloatArray | None = None  # the whole path if `programmed_mm` is a part of it, (k, 3)

    @classmethod
    def of(cls, simulated: SimulatedRegion) -> _Scene:
        """Select the whole of a short region, or the worst position and the stop (if any) of a long one."""
        traces, programmed = simulated.traces, polyline_of(simulated.path)
        if max(len(trace.command_mm) * trace.period_s for trace in traces) <= _WHOLE_S:
            return cls((View(traces),), simulated.part, traces, simulated.part, programmed)
        near, piece, time_s = _worst_place(traces, programmed, simulated.path)
        at = f"at {time_s:.2f} s"
        around = f"{2 * _AROUND_S:g} s around the worst position of the {traces[0].label} ({at})"
        views = [View(near, f"worst position, {at}", "time from the worst position in s")]
        if all(trace.stops for trace in traces):
            stop = tuple(trace.part(trace.rest_s - _BEFORE_STOP_S, math.inf, trace.rest_s) for trace in traces)
            views.append(View(stop, f"the stop, at {traces[0].rest_s:.2f} s", "time from the stop in s"))
        near_part = "; ".join(filter(None, (simulated.part, around)))
        whole = simulated.path.polyline(COARSE_STEP_RAD)
        return cls(tuple(views), simulated.part, near, near_part, piece, whole)


def _worst_place(
    traces: tuple[Trace, ...], programmed: FloatArray, path: _core.Path
) -> tuple[tuple[Trace, ...], FloatArray, float]:
    """Parts of all traces around the largest deviation of the first one, each with time 0 there; the corresponding
    part of the programmed path, (m, 3), mm; the instant of that deviation in the first trace."""
    first = traces[0]
    away = _core.PathFollower(path).step(first.command_mm, first.response_mm)
    at = int(np.argmax(np.linalg.norm(away, axis=1)))
    around = round(_AROUND_S / first.period_s)
    ranks = np.array([max(at - around, 0), at, min(at + around, len(away) - 1)])
    limits = _progress(first, programmed)[ranks]
    near: list[Trace] = []
    for trace in traces:
        if near:
            progress = _progress(trace, programmed)
            ranks = np.minimum(np.searchsorted(progress, limits), len(progress) - 1)
        begin, place, end = (float(time) for time in trace.times_s[ranks])
        near.append(trace.part(begin, end, place))
    return tuple(near), _piece_of(programmed, float(limits[0]), float(limits[2])), float(first.times_s[at])


def _progress(trace: Trace, programmed: FloatArray) -> FloatArray:
    """Distance along the path of each set-point, (n,), mm, ascending; interpolated in a long motion."""
    count = len(trace.command_mm)
    rows = np.unique(np.append(np.arange(0, count, -(-count // _MAX_SET_POINTS)), count - 1))
    command = trace.command_mm[rows]
    found, _ = follow(command, command, programmed, complete=trace.stops)
    progress: FloatArray = np.interp(np.arange(count), rows, np.maximum.accumulate(found))
    return progress


def _widest_plane(programmed: FloatArray) -> Plane:
    x, y, z = np.ptp(programmed, axis=0).tolist()
    planes: dict[Plane, float] = {"XY": x * y + 1e-6, "ZX": z * x, "YZ": y * z}
    return max(planes, key=lambda plane: planes[plane])
