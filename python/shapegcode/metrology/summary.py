"""The worst of every figure of a measurement, by program and with its place: what one looks at first."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["Worst", "summary_table", "worst_figures"]

Section = Mapping[str, Any]
Values = Callable[[Section], list[float | None]]
Worst = tuple[float, int]
"""A value and the index of the section in which it is."""


def worst_figures(program: Mapping[str, Any], band_um: float) -> dict[str, Worst | None]:
    """By name of the figure: the largest of all sections; None where no section has it.

    Args:
        program: one of `programs` in the JSON of a measurement.
        band_um: settled is what stays within it.

    Returns:
        The largest by name, or None.
    """
    found: dict[str, Worst | None] = {}
    for name, values in _figures(band_um):
        best: Worst | None = None
        for index, section in enumerate(program["sections"]):
            for value in values(section):
                if value is not None and (best is None or value > best[0]):
                    best = (value, index)
        found[name] = best
    return found


def summary_table(programs: Sequence[Mapping[str, Any]], names: Sequence[str], report: Mapping[str, Any]) -> Table:
    """Worst of each figure with section and line, one column per program.

    Args:
        programs: of the report, measured against the same path.
        names: of the columns.
        report: the whole.

    Returns:
        The table.
    """
    from rich.table import Table

    machine, diameter = report["machine"], report["tool_diameter_mm"]
    table = Table(title=f"worst figures on {machine}, tool of {diameter:g} mm, {report['plant']} plant", pad_edge=False)
    table.add_column("largest (section, line)", overflow="fold")
    for name in names:
        table.add_column(name, justify="right", overflow="fold")
    table.add_row("cutting time s", *(f"{program['cutting_time_s']:.2f}" for program in programs))
    whole = [program["contour_error_um"]["response"]["max"] for program in programs]
    table.add_row("contour error µm, corners included", *(f"{value:.2f}" for value in whole))
    by_program = [worst_figures(program, report["settling_band_um"]) for program in programs]
    for figure in by_program[0]:
        cells = [_cell(worst[figure], program) for worst, program in zip(by_program, programs, strict=True)]
        if any(worst[figure] is not None for worst in by_program):
            table.add_row(figure, *cells)
    return table


def _cell(worst: Worst | None, program: Mapping[str, Any]) -> str:
    if worst is None:
        return "–"
    value, index = worst
    first, last = program["sections"][index]["lines"]
    lines = f"line {first}" if first == last else f"lines {first}-{last}"
    text = "not settled" if value == float("inf") else f"{value:.2f}"
    return f"{text} ({index + 1}, {lines})"


def _figures(band_um: float) -> Iterator[tuple[str, Values]]:
    """Name with unit, and the values of a section of which the largest counts."""
    yield "contour error of a section µm", lambda s: [s["contour_error_um"]["response"]["max"]]
    for name, key in (("peak vibration", "peak_vibration_um"), ("residual at the stop", "residual_vibration_um")):
        for axis in "xyz":
            yield f"{name} {axis.upper()} µm", _of_axis(key, axis)
    yield f"settling to {band_um:g} µm, ms", _settling_ms
    yield "fitted radius off µm", lambda s: [_off(s, "response")]
    yield "inside, outside wall radius off µm", lambda s: [_off(s, "inside_wall"), _off(s, "outside_wall")]
    yield "orbit error of response %", lambda s: [s["arc"] and s["arc"]["orbit_error_percent"]["response"]]
    yield "cut-width band µm", lambda s: [s["wall_deviation_um"][side]["band"] for side in ("left", "right")]
    yield "width off µm", _width_off_um
    yield "Ra of a wall µm", _of_walls("ra_um")
    yield "Wa of a wall µm", _of_walls("wa_um")


def _of_axis(key: str, axis: str) -> Values:
    return lambda section: [(section[key] or {}).get(axis)]


def _of_walls(key: str) -> Values:
    return lambda section: [(section["roughness"][side] or {}).get(key) for side in ("left", "right")]


def _settling_ms(section: Section) -> list[float | None]:
    times = section["settling_time_s"]
    return [] if times is None else [float("inf") if value is None else 1e3 * value for value in times.values()]


def _off(section: Section, circle: str) -> float | None:
    fitted = None if section["arc"] is None else section["arc"][circle]
    return None if fitted is None else abs(fitted["radius_deviation_um"])


def _width_off_um(section: Section) -> list[float | None]:
    width = section["width_mm"]
    return [None if width[key] is None else 1e3 * abs(width[key] - width["nominal"]) for key in ("min", "max")]
