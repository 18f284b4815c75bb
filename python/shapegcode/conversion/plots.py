"""The pictures of a conversion: the cut that vibrates most, before and after, and tolerance against time."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from shapegcode.conversion.plan import ToleranceCurve
from shapegcode.conversion.result import Conversion
from shapegcode.model.machine_model import MachineModel
from shapegcode.results import plot
from shapegcode.results.outcome import Plot
from shapegcode.results.path_plots import RECORD_SAMPLES, SimulatedRegion, motion_pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plots_of(conversion: Conversion) -> dict[str, Plot]:
    """Path, feed and vibration of the shaped cut with the largest original residual vibration; tolerance curve."""
    found = motion_pictures(partial(_simulated, conversion)) if conversion.regions else {}
    if conversion.tolerance_curve is not None and len(conversion.tolerance_curve.points) > 1:
        found["tolerance"] = partial(plot_tolerance, conversion.tolerance_curve)
    return found


def plot_tolerance(curve: ToleranceCurve, ax: Axes | None = None) -> Axes:
    """Plot the increase of the cycle time over the contour tolerance, and mark the knee.

    Args:
        curve: tolerance curve of a conversion.
        ax: where to draw; None: a new figure.

    Returns:
        The panel.
    """
    panel = plot.axes(ax, title="Tolerance against time")
    points = curve.points
    tolerances = [point.tolerance_um for point in points]
    increases = [point.time_increase_percent for point in points]
    panel.plot(tolerances, increases, "o-", color=plot.COLOURS[1])
    for point in points:
        if point.is_knee:
            panel.plot([point.tolerance_um], [point.time_increase_percent], "o", color=plot.COLOURS[0], markersize=11)
            panel.annotate(
                f"knee: {point.tolerance_um:.3g} µm, {point.time_increase_percent:+.3g} %",
                (point.tolerance_um, point.time_increase_percent), (10, 12), textcoords="offset points",
            )  # fmt: skip
    panel.set_xscale("log")
    panel.set_xticks(tolerances, [f"{each:.3g}" for each in tolerances])
    panel.minorticks_off()
    panel.set(xlabel="contour tolerance in µm", ylabel="time of the program, increase in %")
    return panel


def _simulated(conversion: Conversion) -> SimulatedRegion:
    worst = max(
        range(len(conversion.regions)), key=lambda rank: max(conversion.regions[rank].residual_vibration_um.original)
    )
    place, handle = conversion.placed[worst], conversion.simulated
    assert handle is not None  # in a result from JSON, `placed` raises NotKeptError before
    model = MachineModel(handle.machine)
    path, blocks = place.region.path, place.blocks(conversion.emitted)
    offset = model.offset(place.region)
    runs = {
        "original": model.simulate_original(path, record_samples=RECORD_SAMPLES, offset=offset),
        "emitted": model.simulate_emitted(blocks, path, record_samples=RECORD_SAMPLES, offset=offset),
    }
    return SimulatedRegion.of_runs(
        runs,
        path,
        model.period_s,
        lines=handle.original.source_lines(*place.original_lines),
        regions=len(conversion.regions),
    )
