"""The pictures of ``shapegcode measure``: the part with its deviations magnified, and the walls along the path."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from shapegcode.metrology.measure import MeasuredProgram, MeasuredRegion, Measurement, WallProfile
from shapegcode.results import plot as canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_part", "plot_walls", "write_measurement_pictures"]

FloatArray = npt.NDArray[np.float64]
_SHARE_OF_TOOL = 0.8  # of the tool's radius that the largest deviation takes in the drawing
_SHARE_OF_PART = 0.03
_LEAST_DRAWN_UM = 1e-3
_MOST_MARKED = 12


def write_measurement_pictures(measurement: Measurement, folder: str | Path) -> list[str]:
    """Write the part and the walls of the region whose walls leave their place most, as PNG and SVG.

    Returns:
        The files written; none where no walls were measured.

    Raises:
        OSError: the folder cannot be made or a file not be written.
    """
    number = _region_to_draw(measurement)
    if number is None:
        return []
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for suffix in canvas.FORMATS:
        for name, plot in (("measure-part", plot_part), ("measure-walls", plot_walls)):
            file = folder / f"{name}{suffix}"
            plot(file, measurement, number)
            written.append(str(file))
    return written


def plot_part(file: str | Path, measurement: Measurement, region: int) -> None:
    """The slot from above: nominal walls in grey, those of each program magnified.

    Args:
        file: ``.png`` or ``.svg``.
        measurement: what was measured.
        region: index of the region, whose walls were kept.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    radius = measurement.tool_diameter_mm / 2.0
    drawn = _drawn(measurement, region)
    everything = np.concatenate([wall.point_mm for wall in _walls(drawn[0][1])])
    extent = float(np.ptp(everything, axis=0).max())
    largest_mm = max(_largest_um(each) for _, each in drawn) * 1e-3
    magnified = _round(max(_SHARE_OF_TOOL * radius, _SHARE_OF_PART * extent) / max(largest_mm, _LEAST_DRAWN_UM * 1e-3))
    figure = canvas.figure(7.5, 7.5)
    panel = figure.subplots()
    nominal = _joined(drawn[0][1])
    for side in (radius, -radius):
        panel.plot(*_edge(nominal, np.zeros(nominal.left_um.size), side).T, color=canvas.GREY, linewidth=0.9)
    panel.plot(*nominal.point_mm.T, color=canvas.GREY, linewidth=0.6, linestyle=(0, (8, 3, 2, 3)))
    for number, (program, each) in enumerate(drawn):
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        wall = _joined(each)
        for deviation, side in ((wall.left_um, radius), (wall.right_um, -radius)):
            label = _label(program) if side > 0.0 else None
            panel.plot(*_edge(wall, deviation * 1e-3 * magnified, side).T, color=colour, linewidth=1.2, label=label)
    panel.set_aspect("equal")
    panel.set_xlabel("X in mm")
    panel.set_ylabel("Y in mm")
    panel.spines[["top", "right"]].set_visible(False)
    canvas.legend_above(panel)
    title = (
        f"Walls cut by a tool of {measurement.tool_diameter_mm:g} mm, deviations magnified {magnified:g} times "
        f"(1 mm drawn is {1e3 / magnified:g} µm)"
    )
    canvas.heading(figure, title, _part(drawn[0][1]))
    canvas.save(figure, file)


def plot_walls(file: str | Path, measurement: Measurement, region: int) -> None:
    """Left wall, right wall and width along the path; the borders of a few sections are marked.

    Args:
        file: ``.png`` or ``.svg``.
        measurement: what was measured.
        region: index of the region, whose walls were kept.

    Raises:
        ValueError: a wrong ending.
        OSError: the file cannot be written.
    """
    drawn = _drawn(measurement, region)
    figure = canvas.figure(9.5, 7.0)
    (column,) = canvas.panels(figure, 3, 1)
    left, right, width = column
    for number, (program, each) in enumerate(drawn):
        colour = canvas.COLOURS[number % len(canvas.COLOURS)]
        wall = _joined(each)
        left.plot(wall.distance_mm, wall.left_um, color=colour, linewidth=1.1, label=_label(program))
        right.plot(wall.distance_mm, wall.right_um, color=colour, linewidth=1.1)
        width.plot(wall.distance_mm, wall.left_um - wall.right_um, color=colour, linewidth=1.1)
    left.set_ylabel("left wall, µm\npositive: cut too far")
    right.set_ylabel("right wall, µm\nnegative: cut too far")
    width.set_ylabel(f"width less {measurement.tool_diameter_mm:g} mm, µm")
    width.set_xlabel("distance along the programmed path, mm")
    _mark_sections(column, drawn[0][1])
    canvas.legend_above(left)
    canvas.heading(figure, "Deviation of the walls, positive to the left of the path", _part(drawn[0][1]))
    canvas.save(figure, file)


def _mark_sections(panels: list[Axes], region: MeasuredRegion) -> None:
    sections = [each.section for each in region.figures.sections]
    if len(sections) > _MOST_MARKED:
        return
    for panel in panels:
        for section in sections[1:]:
            panel.axvline(section.begin_mm, color=canvas.GREY, linewidth=0.7, linestyle=":")
    for section in sections:
        middle = (section.begin_mm + section.end_mm) / 2.0
        panels[-1].annotate(
            section.kind.name,
            (middle, 1.0),
            xycoords=panels[-1].get_xaxis_transform(),
            ha="center",
            va="top",
            fontsize=8,
            color=canvas.GREY,
        )


def _region_to_draw(measurement: Measurement) -> int | None:
    """The region whose walls leave their place most in any program, of those whose walls were kept in all."""
    count = min(len(program.regions) for program in measurement.programs)
    found: dict[int, float] = {}
    for index in range(count):
        regions = [program.regions[index] for program in measurement.programs]
        if all(_walls(region) for region in regions):
            found[index] = max(_largest_um(region) for region in regions)
    return max(found, key=lambda index: found[index], default=None)


def _drawn(measurement: Measurement, region: int) -> list[tuple[MeasuredProgram, MeasuredRegion]]:
    return [(program, program.regions[region]) for program in measurement.programs]


def _walls(region: MeasuredRegion) -> list[WallProfile]:
    """The profiles of a region that hold a wall."""
    return [
        wall
        for wall in region.walls
        if wall is not None and bool((np.isfinite(wall.left_um) | np.isfinite(wall.right_um)).any())
    ]


def _joined(region: MeasuredRegion) -> WallProfile:
    """All walls of a region as one, with a gap between two sections."""
    walls = _walls(region)
    gap = WallProfile(*(np.full(1, np.nan) for _ in range(3)), *(np.full((1, 2), np.nan) for _ in range(2)))
    with_gaps = [each for wall in walls for each in (wall, gap)]
    return WallProfile(
        np.concatenate([each.distance_mm for each in with_gaps]),
        np.concatenate([each.left_um for each in with_gaps]),
        np.concatenate([each.right_um for each in with_gaps]),
        np.concatenate([each.point_mm for each in with_gaps]),
        np.concatenate([each.normal for each in with_gaps]),
    )


def _largest_um(region: MeasuredRegion) -> float:
    return max(
        float(np.nanmax(np.abs(np.concatenate([wall.left_um, wall.right_um])), initial=0.0)) for wall in _walls(region)
    )


def _edge(wall: WallProfile, deviation_mm: FloatArray, side_mm: float) -> FloatArray:
    edge: FloatArray = wall.point_mm + wall.normal * (side_mm + deviation_mm)[:, None]
    return edge


def _label(program: MeasuredProgram) -> str:
    return Path(program.source).name


def _part(region: MeasuredRegion) -> str:
    return "lines {} to {}".format(*region.lines)


def _round(factor: float) -> float:
    """The next lower 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(factor))
    return float(next(step for step in (5.0, 2.0, 1.0) if step * power <= factor * (1.0 + 1e-9)) * power)
