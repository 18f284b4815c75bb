"""Which pictures a conversion or a simulation writes, and from what."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shapegcode import _core, plotting
from shapegcode.converter import Conversion
from shapegcode.machine import Machine
from shapegcode.report import Trace
from shapegcode.simulator import Simulation
from shapegcode.verify import play_emitted, play_original

_FORMATS = ("png", "svg")
_RECORD_SAMPLES = 60_000  # a picture cannot show more; a longer region shows its beginning


def write_pictures(conversion: Conversion, machine: Machine, folder: str | Path) -> list[str]:
    """Path, feed and vibration of the region that vibrates most after its stop, before and after.

    Returns:
        The files written; none for a program without shaped regions.

    Raises:
        OSError: the folder cannot be made or a file not be written.
    """
    if not conversion.placed:
        return []
    residuals = [max(region["residual_vibration_um"]["original"].values()) for region in conversion.report["regions"]]
    place = conversion.placed[int(np.argmax(residuals))]
    path = place.region.path
    blocks = conversion.emitted.core.cutting_path(place.first_line, place.last_line)
    rule = getattr(_core.BlockEnd, machine.controller.block_end)
    period = machine.controller.interpolation_period_s
    traces = [
        Trace(label, period, run.recorded_command, run.recorded_response)
        for label, run in (
            ("original", play_original(path, machine, record_samples=_RECORD_SAMPLES)),
            ("emitted", play_emitted(blocks, path, machine, rule, record_samples=_RECORD_SAMPLES)),
        )
    ]
    return _write(traces, path, Path(folder))


def write_simulation_pictures(simulation: Simulation, folder: str | Path) -> list[str]:
    """Path, feed and vibration of the region that vibrates most after its stop.

    Returns:
        The files written; none for a program without cutting regions.

    Raises:
        OSError: the folder cannot be made or a file not be written.
    """
    if not simulation.regions:
        return []
    run = max(simulation.regions, key=lambda each: float(each.figures.residual_mm.max()))
    keep = slice(_RECORD_SAMPLES)
    trace = Trace("program", run.period_s, run.command_mm[keep], run.response_mm[keep])
    return _write([trace], run.path, Path(folder))


def _write(traces: list[Trace], path: _core.Path, folder: Path) -> list[str]:
    folder.mkdir(parents=True, exist_ok=True)
    programmed = path.polyline(0.02)
    plane = _widest_plane(programmed)
    files = []
    for suffix in _FORMATS:
        for name in ("path", "feed", "vibration"):
            file = folder / f"{name}.{suffix}"
            if name == "path":
                plotting.plot_path(file, programmed, traces, plane=plane)
            elif name == "feed":
                plotting.plot_feed(file, traces)
            else:
                plotting.plot_vibration(file, traces)
            files.append(str(file))
    return files


def _widest_plane(programmed: np.ndarray) -> plotting.Plane:
    spans = np.ptp(programmed, axis=0)
    planes: dict[plotting.Plane, float] = {
        "XY": spans[0] * spans[1] + 1e-6, "ZX": spans[2] * spans[0], "YZ": spans[1] * spans[2],
    }  # fmt: skip
    return max(planes, key=lambda plane: planes[plane])
