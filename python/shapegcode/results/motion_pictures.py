"""The pictures of a played region: its path, feed and vibration, whole or at its worst place and its stop.

What was played is asked for when the first of them is drawn.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.results.motion_plots import Trace, View, plot_feed, plot_vibration
from shapegcode.results.path_plots import COARSE_STEP_RAD, Plane, follow, piece_of, plot_path, polyline_of
from shapegcode.results.result import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = npt.NDArray[np.float64]

RECORD_SAMPLES = 1_000_000
"""That a playback keeps for pictures, at most."""

# A longer region shows its worst place and its stop.
_WHOLE_S = 10.0
_PLACES = 20_000  # some milliseconds apart in minutes of motion
_AROUND_S = 1.5
_BEFORE_STOP_S = 2.0


@dataclass(frozen=True, eq=False)
class PlayedRegion:
    """What the pictures of a region draw."""

    traces: tuple[Trace, ...]  # one or more, for example of the original and of the emitted program
    path: _core.Path  # as programmed
    part: str = ""  # which part of the program it is, for titles; empty where it is all of it

    @classmethod
    def of_runs(
        cls,
        runs: Mapping[str, _core.PlaybackFigures],
        path: _core.Path,
        period_s: float,
        *,
        lines: tuple[int, int],
        regions: int,
    ) -> PlayedRegion:
        """The region that vibrates most, as the core played it."""
        traces = tuple(_trace(label, run, period_s) for label, run in runs.items())
        said = [f"lines {lines[0]} to {lines[1]}, the region that vibrates most after its stop"] if regions > 1 else []
        if not traces[0].stops:
            said.append(f"first {traces[0].times_s[-1]:.0f} s of {next(iter(runs.values())).duration_s:.0f} s")
        return cls(traces, path, "; ".join(said))


def _trace(label: str, run: _core.PlaybackFigures, period_s: float) -> Trace:
    x, y, z = (float(value) for value in run.residual_mm)
    return Trace(
        label,
        period_s,
        run.recorded_command,
        run.recorded_response,
        stops=len(run.recorded_command) * period_s > run.duration_s,
        largest_mm=run.response.max_abs_mm,
        residual_mm=(x, y, z),
    )


def motion_pictures(played: Callable[[], PlayedRegion]) -> dict[str, Plot]:
    """Path, feed and vibration of a region, by name."""
    scene = functools.cache(lambda: _Scene.of(played()))

    def path(ax: Axes | None = None) -> Axes:
        s = scene()
        plane = _widest_plane(s.programmed_mm)
        return plot_path(s.programmed_mm, s.near, ax, plane=plane, part=s.near_part, whole_mm=s.whole_mm)

    def feed(ax: Axes | None = None) -> Axes:
        return plot_feed(scene().views, ax, part=scene().part)

    def vibration(ax: Axes | None = None) -> Axes:
        return plot_vibration(scene().views, ax, part=scene().part)

    return {"path": path, "feed": feed, "vibration": vibration}


@dataclass(frozen=True, eq=False)
class _Scene:
    """What of a region is drawn."""

    views: tuple[View, ...]  # stretches of time: the whole, or the worst place and the stop
    part: str  # which part of the program they are of
    near: tuple[Trace, ...]  # the traces, or of a long region their stretches around the worst place
    near_part: str  # which part of the program these are of
    programmed_mm: FloatArray  # the path beside them, (m, 3)
    whole_mm: FloatArray | None = None  # the whole path where that is a piece of it, (k, 3)

    @classmethod
    def of(cls, played: PlayedRegion) -> _Scene:
        """All of a short region; of a long one the worst place and, if it is there, the stop."""
        traces, programmed = played.traces, polyline_of(played.path)
        if max(len(trace.command_mm) * trace.period_s for trace in traces) <= _WHOLE_S:
            return cls((View(traces),), played.part, traces, played.part, programmed)
        worst = _worst_place(traces, programmed, played.path)
        at = f"at {worst.time_s:.2f} s"
        around = f"{2 * _AROUND_S:g} s around the worst place of the {traces[0].label} ({at})"
        views = [View(worst.traces, f"the worst place, {at}", "time from the worst place in s")]
        if all(trace.stops for trace in traces):
            stop = tuple(trace.part(trace.rest_s - _BEFORE_STOP_S, math.inf, trace.rest_s) for trace in traces)
            views.append(View(stop, f"the stop, at {traces[0].rest_s:.2f} s", "time from the stop in s"))
        near_part = "; ".join(filter(None, (played.part, around)))
        whole = played.path.polyline(COARSE_STEP_RAD)
        return cls(tuple(views), played.part, worst.traces, near_part, worst.piece, whole)


@dataclass(frozen=True, eq=False)
class _Worst:
    """The neighbourhood of the place where the first trace is furthest from the path."""

    traces: tuple[Trace, ...]  # the stretches of all traces that pass it; each is there at time 0
    piece: FloatArray  # of the programmed path, (m, 3), mm
    time_s: float  # instant of the first trace


def _worst_place(traces: tuple[Trace, ...], programmed: FloatArray, path: _core.Path) -> _Worst:
    first = traces[0]
    away = _core.PathFollower(path).step(first.command_mm, first.response_mm)
    at = int(np.argmax(np.linalg.norm(away, axis=1)))
    around = round(_AROUND_S / first.period_s)
    ranks = np.array([max(at - around, 0), at, min(at + around, len(away) - 1)])
    limits: FloatArray | None = None
    near: list[Trace] = []
    for trace in traces:
        progress = _progress(trace, programmed)
        if limits is None:
            limits = progress[ranks]
        else:
            ranks = np.minimum(np.searchsorted(progress, limits), len(progress) - 1)
        begin, place, end = (float(time) for time in trace.times_s[ranks])
        near.append(trace.part(begin, end, place))
    assert limits is not None
    return _Worst(tuple(near), piece_of(programmed, float(limits[0]), float(limits[2])), float(first.times_s[at]))


def _progress(trace: Trace, programmed: FloatArray) -> FloatArray:
    """How far along the path each set-point is, (n,), mm, rising; of a long motion between places that are found."""
    count = len(trace.command_mm)
    rows = np.unique(np.append(np.arange(0, count, -(-count // _PLACES)), count - 1))
    command = trace.command_mm[rows]
    found, _ = follow(command, command, programmed, complete=trace.stops)
    progress: FloatArray = np.interp(np.arange(count), rows, np.maximum.accumulate(found))
    return progress


def _widest_plane(programmed: FloatArray) -> Plane:
    spans = np.ptp(programmed, axis=0)
    planes: dict[Plane, float] = {
        "XY": spans[0] * spans[1] + 1e-6, "ZX": spans[2] * spans[0], "YZ": spans[1] * spans[2],
    }  # fmt: skip
    return max(planes, key=lambda plane: planes[plane])
