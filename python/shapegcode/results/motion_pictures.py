"""The pictures of a played region: its path, feed and vibration, whole or at its worst place and its stop."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.results import motion_plots
from shapegcode.results.motion_plots import View
from shapegcode.results.trace import Trace

__all__ = ["RECORD_SAMPLES", "part_of", "trace_of", "write_motion"]

_FORMATS = ("png", "svg")


RECORD_SAMPLES = 1_000_000


# A longer region shows its worst place and its stop.
_WHOLE_S = 10.0


_AROUND_S = 1.5


_BEFORE_STOP_S = 2.0


_SAGITTA_MM = 1e-5


_COARSE_STEP_RAD = 0.05


FloatArray = npt.NDArray[np.float64]


def trace_of(label: str, run: _core.PlaybackFigures, machine: Machine) -> Trace:
    """A playback as a trace of the pictures."""
    period = machine.controller.interpolation_period_s
    x, y, z = (float(value) for value in run.residual_mm)
    return Trace(
        label,
        period,
        run.recorded_command,
        run.recorded_response,
        stops=len(run.recorded_command) * period > run.duration_s,
        largest_mm=run.response.max_abs_mm,
        residual_mm=(x, y, z),
    )


def part_of(first_line: int, last_line: int, regions: int, run: _core.PlaybackFigures, trace: Trace) -> str:
    """Which part of the program a picture is of; empty where it is all of it."""
    parts = [f"lines {first_line} to {last_line}, the region that vibrates most after its stop"] if regions > 1 else []
    if not trace.stops:
        parts.append(f"first {trace.times_s[-1]:.0f} s of {run.duration_s:.0f} s")
    return "; ".join(parts)


@dataclass(frozen=True)
class _Worst:
    """The neighbourhood of the place where the first trace is furthest from the path.

    Attributes:
        traces: the stretches of all traces that pass it; each is there at time 0.
        piece: of the programmed path, (m, 3), mm.
        time_s: instant of the first trace.
    """

    traces: list[Trace]
    piece: FloatArray
    time_s: float


def write_motion(traces: list[Trace], path: _core.Path, part: str, folder: Path) -> list[str]:
    """Path, feed and vibration of the traces into a folder, as PNG and SVG; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    programmed = _polyline(path)
    whole = None
    views = [View(traces)]
    near, path_part = traces, part
    if max(len(trace.command_mm) * trace.period_s for trace in traces) > _WHOLE_S:
        worst = _worst_place(traces, programmed)
        whole, programmed, near = path.polyline(_COARSE_STEP_RAD), worst.piece, worst.traces
        path_part = "; ".join(
            text
            for text in (
                part,
                f"{2 * _AROUND_S:g} s around the worst place of the {traces[0].label} (at {worst.time_s:.2f} s)",
            )
            if text
        )
        views = [View(worst.traces, f"the worst place, at {worst.time_s:.2f} s", "time from the worst place in s")]
        if all(trace.stops for trace in traces):
            stop = [trace.part(trace.rest_s - _BEFORE_STOP_S, math.inf, trace.rest_s) for trace in traces]
            views.append(View(stop, f"the stop, at {traces[0].rest_s:.2f} s", "time from the stop in s"))
    plane = _widest_plane(programmed)
    files = []
    for suffix in _FORMATS:
        for name in ("path", "feed", "vibration"):
            file = folder / f"{name}.{suffix}"
            if name == "path":
                motion_plots.plot_path(file, programmed, near, plane=plane, part=path_part, whole_mm=whole)
            elif name == "feed":
                motion_plots.plot_feed(file, views, part=part)
            else:
                motion_plots.plot_vibration(file, views, part=part)
            files.append(str(file))
    return files


def _worst_place(traces: list[Trace], programmed: FloatArray) -> _Worst:
    first = traces[0]
    _, feet = motion_plots.follow(first.command_mm, first.response_mm, programmed, complete=first.stops)
    at = int(np.argmax(np.linalg.norm(first.response_mm - feet, axis=1)))
    around = round(_AROUND_S / first.period_s)
    begin, end = max(at - around, 0), min(at + around, len(feet) - 1)
    near: list[Trace] = []
    limits = (0.0, 0.0)
    place = 0.0
    for trace in traces:
        progress, _ = motion_plots.follow(trace.command_mm, trace.command_mm, programmed, complete=trace.stops)
        progress = np.maximum.accumulate(progress)
        if trace is first:
            limits, place = (float(progress[begin]), float(progress[end])), float(progress[at])
            times = trace.times_s[[begin, at, end]]
        else:
            ranks = np.searchsorted(progress, [limits[0], place, limits[1]])
            times = trace.times_s[np.minimum(ranks, len(progress) - 1)]
        near.append(trace.part(float(times[0]), float(times[2]), float(times[1])))
    return _Worst(near, _piece(programmed, *limits), float(first.times_s[at]))


def _piece(polyline: FloatArray, begin_mm: float, end_mm: float) -> FloatArray:
    """What lies between two distances along a polyline."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(polyline, axis=0), axis=1))])
    inside = (along > begin_mm) & (along < end_mm)
    ends = [[np.interp(s, along, polyline[:, axis]) for axis in range(3)] for s in (begin_mm, end_mm)]
    return np.concatenate([ends[:1], polyline[inside], ends[1:]])


def _polyline(path: _core.Path) -> FloatArray:
    """The path as a polyline that is nowhere further than a hundredth of a micrometre from its arcs."""
    if path.largest_sweep_rad == 0.0:
        return path.polyline()
    parts = [path.start_mm[None, :]]
    for index in range(len(path)):
        segment = path[index]
        if segment.kind == _core.SegmentKind.arc:
            step = math.sqrt(8.0 * _SAGITTA_MM / segment.radius_mm)
            parts.append(_core.Path([segment]).polyline(min(step, _COARSE_STEP_RAD))[1:])
        else:
            parts.append(segment.end_mm[None, :])
    return np.concatenate(parts)


def _widest_plane(programmed: FloatArray) -> motion_plots.Plane:
    spans = np.ptp(programmed, axis=0)
    planes: dict[motion_plots.Plane, float] = {
        "XY": spans[0] * spans[1] + 1e-6, "ZX": spans[2] * spans[0], "YZ": spans[1] * spans[2],
    }  # fmt: skip
    return max(planes, key=lambda plane: planes[plane])
