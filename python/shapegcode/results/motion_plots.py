"""Plots of simulated or measured motion over time: feed, vibration; `path_plots` has the path.

The first trace, usually the original program, has the wider line, so that it is visible below the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shapegcode.io.units import FloatArray
from shapegcode.results import plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STILL_MM = 1e-9


@dataclass(frozen=True, eq=False)
class Trace:
    """Command and response of one program, simulated on the machine's model.

    Attributes:
        label: name in legends, for example "original" or "emitted".
        period_s: time between two samples.
        command_mm: set-points of the axes after every filter, shape (n, 3).
        response_mm: position of the table at the same instants, shape (n, 3).
        start_s: time of the first sample.
        stops: the record contains the final stop; False if it ends before.
        largest_mm: largest distance of the table from the programmed path over the whole run, as measured
            by the core; None: not measured.
        residual_mm: largest |response - command| of each axis after the stop, from the core; None: not measured.

    Raises:
        ValueError: a wrong shape, fewer than two samples, a value that is not finite, or a period that is not
            positive.
    """

    label: str
    period_s: float
    command_mm: FloatArray
    response_mm: FloatArray
    start_s: float = 0.0
    stops: bool = True
    largest_mm: float | None = None
    residual_mm: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        """Check the arrays and keep read-only views of them."""
        if not (np.isfinite(self.period_s) and self.period_s > 0):
            raise ValueError(f"trace {self.label}: period_s = {self.period_s}: must be finite and above 0")
        for name in ("command_mm", "response_mm"):
            values = np.asarray(getattr(self, name), dtype=np.float64).view()
            if values.ndim != 2 or values.shape[1] != 3 or len(values) < 2:
                raise ValueError(f"trace {self.label}: {name} has shape {values.shape}: not (n, 3), n > 1")
            if not np.isfinite(values).all():
                raise ValueError(f"trace {self.label}: {name} has values that are not finite")
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        if self.command_mm.shape != self.response_mm.shape:
            raise ValueError(
                f"trace {self.label}: {len(self.command_mm)} samples of the command, "
                f"{len(self.response_mm)} of the response: must be equal"
            )

    @property
    def times_s(self) -> FloatArray:
        """Time of each sample, shape (n,)."""
        return self.start_s + np.arange(len(self.command_mm), dtype=np.float64) * self.period_s

    @property
    def departure_s(self) -> float:
        """Instant of the last sample before the set-points begin to move; the first one if they never do."""
        moved = (np.abs(self.command_mm - self.command_mm[0]) > _STILL_MM).any(axis=1)
        return self.start_s + float(max(int(moved.argmax()) - 1, 0)) * self.period_s

    @property
    def deflection_mm(self) -> FloatArray:
        """Response minus command, shape (n, 3)."""
        return self.response_mm - self.command_mm

    @property
    def rest_s(self) -> float:
        """Instant at which the set-points finally rest: first sample from which on all are at the final position."""
        moved = np.flatnonzero((np.abs(self.command_mm - self.command_mm[-1]) > _STILL_MM).any(axis=1))
        return self.start_s + (float(moved[-1] + 1) * self.period_s if len(moved) else 0.0)

    def part(self, begin_s: float, end_s: float, zero_s: float = 0.0) -> Trace:
        """The samples between two instants.

        Args:
            begin_s: instant of the first sample; limited to the record.
            end_s: instant of the last sample; limited to the record.
            zero_s: instant that becomes time zero.

        Returns:
            A trace of at least two samples; its `stops` is true if it contains the stop.
        """
        count = len(self.command_mm)
        ranks = (np.array([begin_s, end_s]) - self.start_s) / self.period_s
        first = round(float(np.clip(ranks[0], 0, count - 2)))
        last = round(float(np.clip(ranks[1], first + 1, count - 1)))
        return replace(
            self,
            command_mm=self.command_mm[first : last + 1],
            response_mm=self.response_mm[first : last + 1],
            start_s=self.start_s + first * self.period_s - zero_s,
            stops=self.stops and first * self.period_s <= self.rest_s - self.start_s <= last * self.period_s,
        )


AXIS_NAMES = "XYZ"
_WIDTHS = (2.4, 0.9, 0.9, 0.9)
_MAX_POINTS = 4000
MOVES_MM = 1e-9
# A smaller deflection counts as zero.
SHOWN_MM = 5e-5
_FLAT = 0.06  # range of an axis in µm or mm/min


def thin_min_max(
    times: npt.ArrayLike, values: npt.ArrayLike, max_points: int = _MAX_POINTS
) -> tuple[FloatArray, FloatArray]:
    """Decimate a curve without visible change: keep minimum and maximum of each interval."""
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
    """Traces over one time range, plotted as one column of a picture.

    Attributes:
        traces: usually the original and the emitted program.
        heading: title of the range; empty for the whole.
        time_label: label of the time axis.
    """

    traces: Sequence[Trace]
    heading: str = ""
    time_label: str = "time in s"


def plot_feed(views: Sequence[View], ax: Axes | None = None, *, part: str = "") -> Axes:
    """Plot the speed of the command along the path and per axis.

    Args:
        views: time ranges, side by side.
        ax: where to draw; None: a new figure.
        part: part of the program, for the title.

    Returns:
        The first panel.

    Raises:
        ValueError: no view, or no trace.
    """
    _check_views(views)
    moving = _moving_axes([trace for view in views for trace in view.traces])
    names = ["path feed\nin mm/min", *(f"{AXIS_NAMES[axis]} speed\nin mm/min" for axis in moving)]
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
        # Leave out standstill before and after.
        begin = min(trace.departure_s for trace in view.traces)
        end = max(trace.rest_s if trace.stops else float(trace.times_s[-1]) for trace in view.traces)
        margin = 0.03 * (end - begin) or view.traces[0].period_s
        panels[-1].set_xlim(begin - margin, end + margin)
    return columns[0][0]


def plot_vibration(views: Sequence[View], ax: Axes | None = None, *, part: str = "") -> Axes:
    """Plot the vibration of each axis about its command, and what remains after the stop.

    Axes that do not vibrate are named, not drawn; if none vibrates, the first that moves is drawn.

    Args:
        views: time ranges, side by side.
        ax: where to draw; None: a new figure.
        part: part of the program, for the title.

    Returns:
        The first panel.

    Raises:
        ValueError: no view, or no trace.
    """
    _check_views(views)
    traces = [trace for view in views for trace in view.traces]
    moving = _moving_axes(traces)
    swing_mm = np.max([np.abs(trace.deflection_mm).max(axis=0) for trace in traces], axis=0)
    swinging = [axis for axis in moving if swing_mm[axis] >= SHOWN_MM]
    still = [AXIS_NAMES[axis] for axis in moving if axis not in swinging]
    shown = swinging or moving[:1]
    parts = ["Vibration"]
    parts += ["dashed: the command has come to rest"] if any(trace.stops for trace in traces) else []
    parts += [f"{', '.join(still)}: rigid (below {SHOWN_MM * 1e3:g} µm)"] if still else []
    names = [f"{AXIS_NAMES[axis]} table − command\nin µm" for axis in shown]
    columns = _columns(ax, views, names, 2.2, "; ".join(parts), part)
    for view, panels in zip(views, columns, strict=True):
        for panel, axis in zip(panels, shown, strict=True):
            for number, trace in enumerate(view.traces):
                label = _vibration_label(trace, axis)
                _curve(panel, number, label, trace.times_s, trace.deflection_mm[:, axis] * 1e3, fine=len(views) > 1)
                if trace.stops:
                    panel.axvline(trace.rest_s, color=line_style(number)["color"], linewidth=1, linestyle=(0, (4, 3)))
            panel.axhline(0, color=plot.GREY, linewidth=0.6, zorder=0)
            plot.legend_above(panel)
            _spread_flat(panel)
    return columns[0][0]


def _columns(
    ax: Axes | None, views: Sequence[View], names: Sequence[str], row_inch: float, title: str, part: str
) -> list[list[Axes]]:
    """One column of panels per view, each with its own time axis; *names*: of the rows."""
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


def _check_views(views: Sequence[View]) -> None:
    if not views:
        raise ValueError("no view: must be one or more")
    if not all(view.traces for view in views):
        raise ValueError("no trace: must be one or more")


def _vibration_label(trace: Trace, axis: int) -> str:
    deflection = np.abs(trace.deflection_mm[:, axis])
    if not trace.stops:
        return f"{trace.label}, here up to {1e3 * float(deflection.max()):.1f} µm"
    remaining = deflection[trace.times_s >= trace.rest_s - trace.period_s / 2]
    residual_mm = float(remaining.max()) if trace.residual_mm is None else trace.residual_mm[axis]
    return f"{trace.label}, residual {1e3 * residual_mm:.1f} µm"


def line_style(number: int, *, fine: bool = False) -> dict[str, Any]:
    """Colour and width of the curve of a trace."""
    width = _WIDTHS[number % len(_WIDTHS)] / (2 if fine else 1)
    return {"color": plot.COLOURS[number % len(plot.COLOURS)], "linewidth": width}


def _moving_axes(traces: Sequence[Trace]) -> list[int]:
    """Axes that move in any trace; X if none does, so that a picture is never empty."""
    travel = np.max([np.ptp(trace.command_mm, axis=0) for trace in traces], axis=0)
    return [axis for axis in range(3) if travel[axis] > MOVES_MM] or [0]


def _curve(panel: Axes, number: int, label: str, times: FloatArray, values: FloatArray, *, fine: bool = False) -> None:
    t, v = thin_min_max(times, values)
    panel.plot(t, v, label=label, **line_style(number, fine=fine))


def _spread_flat(panel: Axes) -> None:
    """Show a curve at zero as a line in the middle, not magnified round-off."""
    if max(map(abs, panel.get_ylim())) < _FLAT:
        panel.set_ylim(-1, 1)
