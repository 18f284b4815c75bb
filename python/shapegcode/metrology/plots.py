"""The pictures of ``shapegcode measure``: the part with its deviations magnified, and the walls along the path."""

from dataclasses import fields
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from shapegcode.io.units import FloatArray
from shapegcode.metrology.figures import WallProfile
from shapegcode.metrology.result import MeasuredProgram, MeasuredRegion, Measurement
from shapegcode.results import plot
from shapegcode.results.outcome import Plot


def plots_of(measurement: Measurement) -> dict[str, Plot]:
    """Pictures of the region with the largest deviation of walls; empty unless every program has walls of a region."""
    if _worst_region(measurement) is None:
        return {}
    return {"measure-part": partial(plot_part, measurement), "measure-walls": partial(plot_walls, measurement)}


def plot_part(measurement: Measurement, ax: Axes | None = None, *, region: int | None = None) -> Axes:
    """Plot the slot from above: nominal walls in grey, those of each program with magnified deviation.

    Args:
        measurement: the measurement.
        ax: where to draw; None: a new figure.
        region: index of the region; None: the one with the largest wall deviation.

    Returns:
        The panel.

    Raises:
        ValueError: no walls were measured there.
    """
    radius = measurement.tool_diameter_mm / 2.0
    drawn = _shown(measurement, region)
    everything = np.concatenate([wall.point_mm for wall in _walls(drawn[0][1])])
    extent = float(np.ptp(everything, axis=0).max())
    largest_mm = max(_largest_um(each) for _, each in drawn) * 1e-3
    wanted_mm = max(0.8 * radius, 0.03 * extent)  # drawn size of the largest deviation
    magnified = plot.round_below(wanted_mm / max(largest_mm, 1e-6))
    title = (
        f"Walls cut by a tool of {measurement.tool_diameter_mm:g} mm, deviations magnified {magnified:g} times "
        f"(1 mm drawn is {1e3 / magnified:g} µm)"
    )
    ((panel,),) = plot.grid(ax, 1, 1, size_inch=(7.5, 7.5), title=title, part=_part(drawn[0][1]))
    nominal = _joined(drawn[0][1])
    for side in (radius, -radius):
        panel.plot(*_edge(nominal, np.zeros(nominal.left_um.size), side).T, color=plot.GREY, linewidth=0.9)
    panel.plot(*nominal.point_mm.T, color=plot.GREY, linewidth=0.6, linestyle=(0, (8, 3, 2, 3)))
    for number, (program, each) in enumerate(drawn):
        wall = _joined(each)
        for deviation, side, label in ((wall.left_um, radius, program.name), (wall.right_um, -radius, None)):
            edge = _edge(wall, deviation * 1e-3 * magnified, side)
            panel.plot(*edge.T, color=_colour(number), linewidth=1.2, label=label)
    panel.grid(False)
    panel.set(aspect="equal", xlabel="X in mm", ylabel="Y in mm")
    plot.legend_above(panel)
    return panel


def plot_walls(measurement: Measurement, ax: Axes | None = None, *, region: int | None = None) -> Axes:
    """Plot left wall, right wall and width along the path; borders of sections are marked if there are at most 12.

    Args:
        measurement: the measurement.
        ax: where to draw; None: a new figure.
        region: index of the region; None: the one with the largest wall deviation.

    Returns:
        The upper panel.

    Raises:
        ValueError: no walls were measured there.
    """
    drawn = _shown(measurement, region)
    title = "Deviation of the walls, positive to the left of the path"
    left, right, width = column = plot.column(ax, 3, size_inch=(9.5, 7.0), title=title, part=_part(drawn[0][1]))
    for number, (program, each) in enumerate(drawn):
        wall = _joined(each)
        curves = (wall.left_um, wall.right_um, wall.left_um - wall.right_um)
        for panel, values in zip(column, curves, strict=True):
            panel.plot(wall.distance_mm, values, color=_colour(number), linewidth=1.1, label=program.name)
            panel.margins(x=0.01)
    left.set_ylabel("left wall, µm\npositive: cut too deep")
    right.set_ylabel("right wall, µm\nnegative: cut too deep")
    ylabel = f"width minus {measurement.tool_diameter_mm:g} mm, µm"
    width.set(ylabel=ylabel, xlabel="distance along the programmed path, mm")
    sections = drawn[0][1].sections
    for section in sections if len(sections) <= 12 else ():
        for panel in column if section is not sections[0] else ():
            panel.axvline(section.begin_mm, color=plot.GREY, linewidth=0.7, linestyle=":")
        width.annotate(
            section.kind, (section.begin_mm + section.length_mm / 2.0, 1.0), xycoords=width.get_xaxis_transform(),
            ha="center", va="top", fontsize=8, color=plot.GREY,
        )  # fmt: skip
    plot.legend_above(left)
    return left


def _worst_region(measurement: Measurement) -> int | None:
    """Region with the largest wall deviation in any program, of those with walls measured in every program."""
    beside = enumerate(zip(*(program.regions for program in measurement.programs), strict=False))
    found = {index: max(map(_largest_um, regions)) for index, regions in beside if all(map(_walls, regions))}
    return max(found, key=lambda index: found[index], default=None)


def _shown(measurement: Measurement, region: int | None) -> list[tuple[MeasuredProgram, MeasuredRegion]]:
    index = _worst_region(measurement) if region is None else region
    drawn = [(program, program.regions[index]) for program in measurement.programs if index is not None]
    if not drawn or not all(_walls(each) for _, each in drawn):
        raise ValueError("no walls were measured there: nothing to draw")
    return drawn


def _walls(region: MeasuredRegion) -> list[WallProfile]:
    return [
        section.walls
        for section in region.sections
        if section.walls is not None
        and bool((np.isfinite(section.walls.left_um) | np.isfinite(section.walls.right_um)).any())
    ]


def _joined(region: MeasuredRegion) -> WallProfile:
    """Join all walls of a region, with a gap between sections."""
    gap = WallProfile(*(np.full(1, np.nan) for _ in range(3)), *(np.full((1, 2), np.nan) for _ in range(2)))
    with_gaps = [each for wall in _walls(region) for each in (wall, gap)]
    return WallProfile(*(np.concatenate([getattr(each, field.name) for each in with_gaps]) for field in fields(gap)))


def _largest_um(region: MeasuredRegion) -> float:
    walls = (np.concatenate([wall.left_um, wall.right_um]) for wall in _walls(region))
    return max(float(np.nanmax(np.abs(each), initial=0.0)) for each in walls)


def _edge(wall: WallProfile, deviation_mm: FloatArray, side_mm: float) -> FloatArray:
    edge: FloatArray = wall.point_mm + wall.normal * (side_mm + deviation_mm)[:, None]
    return edge


def _colour(number: int) -> str:
    return plot.COLOURS[number % len(plot.COLOURS)]


def _part(region: MeasuredRegion) -> str:
    return "lines {} to {}".format(*region.lines)
