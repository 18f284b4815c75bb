"""A measurement as a measuring report: section by section what is nominal, what was measured, and the limit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shapegcode.metrology.summary import summary_table

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["Feature", "demo_table", "features", "measurement_tables", "next_step", "section_name", "verdicts"]

_MOST_SECTIONS = 12
_SIDES = ("left", "right")
_HEIGHTS = ("above", "below")
_SHOWN_UM = 0.005  # less is shown as 0.00

Section = Mapping[str, Any]


@dataclass(frozen=True)
class Feature:
    """One row of the report.

    Attributes:
        name: what is measured.
        nominal: what it should be; empty where that is nothing but zero.
        values: as text, one per program.
        limit: what the machine file allows; empty: nothing stated.
        out: for each program, whether it is beyond the limit.
    """

    name: str
    nominal: str
    values: tuple[str, ...]
    limit: str = ""
    out: tuple[bool, ...] = ()


def measurement_tables(report: Mapping[str, Any], *, every_section: bool = False) -> list[Table]:
    """A summary and a table of sections for the programs that are measured against the same path, side by side.

    Args:
        report: the JSON of a measurement.
        every_section: show all sections; False: of many the worst ones.
    """
    paths = dict.fromkeys(program["measured_against"] for program in report["programs"])
    groups = [[each for each in report["programs"] if each["measured_against"] == path] for path in paths]
    tables = []
    for programs in groups:
        if any(program["sections"] for program in programs):
            tables.append(summary_table(programs, _names(programs), report))
        tables.append(_table(programs, report, every_section=every_section))
    return tables


def _table(programs: Sequence[Mapping[str, Any]], report: Mapping[str, Any], *, every_section: bool) -> Table:
    """One block of rows per section, one column per program."""
    from rich.table import Table
    from rich.text import Text

    shown, left_out = _shown_sections(programs, None if every_section else _MOST_SECTIONS)
    machine, diameter = report["machine"], report["tool_diameter_mm"]
    table = Table(title=f"measured on {machine} with a tool of {diameter:g} mm diameter", pad_edge=False)
    table.add_column("section", overflow="fold")
    table.add_column("feature", overflow="fold")
    table.add_column("nominal", justify="right", no_wrap=True)
    for name in _names(programs):
        table.add_column(name, justify="right", overflow="fold")
    table.add_column("limit", justify="right", no_wrap=True)
    for index in shown:
        sections = [program["sections"][index] for program in programs]
        judged = any(program["within_tolerance"] is not None for program in programs)
        limit_um = report["tolerance_um"]["contour"] if judged else None
        rows = list(features(sections, limit_um, report["settling_band_um"]))
        for number, row in enumerate(rows):
            cells = [Text(value) for value in row.values]
            for cell, out in zip(cells, row.out, strict=False):
                if out:
                    cell.stylize("bold red")
            table.add_row(
                Text(section_name(sections[0], index) if number == 0 else ""), row.name, row.nominal, *cells, row.limit,
                end_section=number + 1 == len(rows),
            )  # fmt: skip
    if left_out:
        table.caption = f"{left_out} more sections, whose contour error is less: --all shows them, --json lists them"
    return table


def _shown_sections(programs: Sequence[Mapping[str, Any]], most: int | None) -> tuple[list[int], int]:
    """Indices of the sections that a table shows, in order, and how many are left out."""
    count = len(programs[0]["sections"])
    worst = [
        max(program["sections"][index]["contour_error_um"]["response"]["max"] for program in programs)
        for index in range(count)
    ]
    shown = sorted(sorted(range(count), key=lambda index: -worst[index])[:most])
    return shown, count - len(shown)


def section_name(section: Section, index: int) -> str:
    """Number, kind and lines of a section."""
    first, last = section["lines"]
    kind = section["kind"]
    if section["arc"] is not None:
        kind = f"arc R{section['arc']['nominal_radius_mm']:g}"
    lines = f"line {first}" if first == last else f"lines {first}-{last}"
    return f"{index + 1} {kind}, {lines}"


def features(sections: Sequence[Section], limit_um: float | None, band_um: float) -> Iterator[Feature]:
    """The rows of one section, as it came out in each program; without a limit none is judged."""
    yield Feature(
        "length mm, time s", f"{sections[0]['length_mm']:.3f}", _each(sections, lambda s: f"{s['time_s']:.3f}")
    )
    yield from _contour(sections, limit_um)
    if sections[0]["arc"] is not None:
        yield from _arc_rows(sections)
    yield from _walls(sections)
    yield from _roughness(sections)
    yield Feature("peak vibration X / Y / Z µm", "", _each(sections, lambda s: _axes(s["peak_vibration_um"], 2)))
    if any(section["residual_vibration_um"] is not None for section in sections):
        yield Feature(
            "residual at the stop X / Y / Z µm", "", _each(sections, lambda s: _axes(s["residual_vibration_um"], 2))
        )
        yield Feature(f"settled to {band_um:g} µm X / Y / Z ms", "", _each(sections, _settling))


def demo_table(result: Mapping[str, Any], feed_mm_per_s: float) -> Table:
    """Paper 000's line, arc and line at one feed: one column per program, the paper's specimens below."""
    from rich.table import Table

    rows = [row for row in result["cases"] if row["feed_mm_per_s"] == feed_mm_per_s]
    arcs = [row["sections"][1] for row in rows]
    table = Table(title=f"Paper 000 at {feed_mm_per_s:g} mm/s, tool of {result['tool_diameter_mm']:g} mm, as cut")
    table.add_column("figure", overflow="fold")
    for row in rows:
        heading = row["program"].replace("-", " ")
        table.add_column(heading, justify="right", overflow="fold", min_width=max(map(len, heading.split())))
    inside = [arc["arc"]["inside_wall"] for arc in arcs]
    table.add_row(
        f"inside radius mm (nominal {inside[0]['nominal_radius_mm']:g})",
        *(f"{circle['fitted_radius_mm']:.4f}" for circle in inside),
    )
    for number in range(2):
        table.add_row(
            ("  paper, SM20C (depth .05, .1)", "  paper, Al6061 (depth .05, .1)")[number],
            *(
                "" if row["paper"] is None else ", ".join(
                    f"{radius:.3f}" for radius in list(row["paper"]["inside_radius_mm"].values())[2 * number :][:2]
                )
                for row in rows
            ),
            end_section=number == 1,
        )  # fmt: skip
    table.add_row("band of the arc's walls µm", *(f"{arc['wall_deviation_um']['left']['band']:.1f}" for arc in arcs))
    for number, name in enumerate(("line in", "arc", "line out")):
        sections = [row["sections"][number] for row in rows]
        table.add_row(
            f"width, {name} mm", *_each(sections, lambda s: _pair([s["width_mm"][key] for key in ("min", "max")], 4))
        )
    for name, key, decimals in (("Ra", "ra_um", 3), ("Wa", "wa_um", 2)):
        table.add_row(
            f"{name} left wall µm: line, arc, line",
            *(
                " / ".join(f"{section['roughness']['left'][key]:z.{decimals}f}" for section in row["sections"])
                for row in rows
            ),
        )
    ends = [row["sections"][2] for row in rows]
    table.add_row("residual X / Y / Z µm", *_each(ends, lambda s: _axes(s["residual_vibration_um"], 2)))
    table.add_row("time s", *(f"{row['time_s']:.3f}" for row in rows))
    return table


def next_step(report: Mapping[str, Any]) -> str:
    """The one thing to do next, in one sentence."""
    programs = report["programs"]
    if not report["within_tolerance"] and report["plant"] == "feed-drive":
        return (
            "the lag of the servo loops takes the table off the path: more feed-forward or position gain, or less "
            "feed; --plant modal shows what vibration alone does"
        )
    missed = next((each for each in programs if each["shaped"] and each["within_tolerance"] is False), None)
    if missed is not None:
        return f"convert again with a smaller --contour-tolerance: {Path(missed['program']).name} leaves the path"
    if not any(program["shaped"] for program in programs):
        return "shapegcode convert shapes the program; measure both to see what it gains"
    if any(program["shaped"] and program["within_tolerance"] is None for program in programs):
        return "measure it --against the original program: its own path is not the programmed one"
    if "plots" not in report:
        return "--plots DIR draws the part with its deviations magnified"
    return "--lines A-B measures the cut of these lines alone, --json FILE keeps every figure"


def verdicts(report: Mapping[str, Any]) -> list[str]:
    """One sentence for each program that is held against the tolerance: what it keeps or by how much it does not."""
    limit = report["tolerance_um"]["contour"]
    said = []
    for program in report["programs"]:
        if program["within_tolerance"] is None:
            continue
        name, largest = Path(program["program"]).name, program["contour_error_um"]["response"]["max"]
        within = f"leaves the path by {largest:.2f} µm at most"
        if program["within_tolerance"]:
            said.append(f"{name}: within tolerance: {within}, limit {limit:g} µm (tolerance.contour_um)")
            continue
        said.append(
            f"{name}: OUT OF TOLERANCE by {largest - limit:.2f} µm: {within}, limit {limit:g} µm "
            f"(tolerance.contour_um), {_worst_place(program)}"
        )
    return said


def _worst_place(program: Mapping[str, Any]) -> str:
    sections = program["sections"]
    worst = [section["contour_error_um"]["response"]["max"] for section in sections]
    index = worst.index(max(worst))
    if worst[index] < program["contour_error_um"]["response"]["max"]:
        return "at a corner that it rounds off"
    return f"in section {section_name(sections[index], index)}"


def _names(programs: Sequence[Mapping[str, Any]]) -> list[str]:
    """File names; whole paths where two files of one name are compared."""
    short = [Path(program["program"]).name for program in programs]
    return short if len(set(short)) == len(short) else [program["program"] for program in programs]


def _each(sections: Sequence[Section], text: Any) -> tuple[str, ...]:
    return tuple(text(section) for section in sections)


def _contour(sections: Sequence[Section], limit_um: float | None) -> Iterator[Feature]:
    def sides(who: str, which: Sequence[str]) -> tuple[str, ...]:
        return _each(sections, lambda s: _pair([s["contour_error_um"][who][side] for side in which], 2))

    def any_of(who: str, which: Sequence[str]) -> bool:
        return any(s["contour_error_um"][who][side] >= _SHOWN_UM for s in sections for side in which)

    largest = [section["contour_error_um"]["response"]["max"] for section in sections]
    out = tuple(limit_um is not None and value > limit_um for value in largest)
    limit = "" if limit_um is None else f"{limit_um:g}"
    yield Feature("contour error µm", "0", tuple(f"{value:.2f}" for value in largest), limit, out)
    yield Feature("  left / right µm", "", sides("response", _SIDES))
    if any_of("response", _HEIGHTS):
        yield Feature("  above / below µm", "", sides("response", _HEIGHTS))
    yield Feature("  RMS µm", "", _each(sections, lambda s: f"{s['contour_error_um']['response']['rms']:.2f}"))
    yield Feature("command left / right µm", "0", sides("command", _SIDES))
    if any_of("command", _HEIGHTS):
        yield Feature("command above / below µm", "0", sides("command", _HEIGHTS))


def _arc_rows(sections: Sequence[Section]) -> Iterator[Feature]:
    for name, key in (("fitted radius", "response"), ("inside wall", "inside_wall"), ("outside wall", "outside_wall")):
        circles = [section["arc"][key] for section in sections]
        if all(circle is None for circle in circles):
            continue
        nominal = next(circle for circle in circles if circle is not None)["nominal_radius_mm"]
        yield Feature(
            f"{name} mm (µm off)",
            f"{nominal:.3f}",
            tuple(
                "–" if circle is None else f"{circle['fitted_radius_mm']:.4f} ({circle['radius_deviation_um']:+z.1f})"
                for circle in circles
            ),
        )
    track = [section["arc"]["response"] for section in sections]
    if any(circle is not None for circle in track):
        yield Feature("form error µm", "0", tuple(_or_dash(circle, "form_error_um", 2) for circle in track))
        yield Feature(
            "centre off µm",
            "0",
            tuple("–" if each is None else _pair(each["centre_offset_um"], 1) for each in track),
        )
    yield Feature(
        "orbit error of response %",
        "0",
        _each(sections, lambda s: f"{s['arc']['orbit_error_percent']['response']:.4f}"),
    )


def _walls(sections: Sequence[Section]) -> Iterator[Feature]:
    if all(section["wall_deviation_um"][side]["stations"] == 0 for section in sections for side in _SIDES):
        return
    for side in _SIDES:
        yield Feature(f"{side} wall, from / to µm", "0", _each(sections, lambda s, side=side: _span(s, side)))
    yield Feature(
        "cut-width band left / right µm",
        "0",
        _each(sections, lambda s: _pair([s["wall_deviation_um"][side]["band"] for side in _SIDES], 2)),
    )
    nominal = sections[0]["width_mm"]["nominal"]
    yield Feature(
        "width least / most mm",
        f"{nominal:.3f}",
        _each(sections, lambda s: _pair([s["width_mm"]["min"], s["width_mm"]["max"]], 4)),
    )


def _roughness(sections: Sequence[Section]) -> Iterator[Feature]:
    if all(section["roughness"][side] is None for section in sections for side in _SIDES):
        return
    for name, key in (("Ra", "ra_um"), ("Rz", "rz_um"), ("Wa", "wa_um")):
        yield Feature(
            f"{name} left / right µm",
            "",
            _each(
                sections,
                lambda s, key=key: _pair([(s["roughness"][side] or {}).get(key) for side in _SIDES], 3),
            ),
        )


def _span(section: Section, side: str) -> str:
    wall = section["wall_deviation_um"][side]
    return "–" if wall["stations"] == 0 else f"{wall['min']:+z.2f} … {wall['max']:+z.2f}"


def _settling(section: Section) -> str:
    times = section["settling_time_s"]
    if times is None:
        return "–"
    late = section["observed_rest_s"] * 1e3
    return " / ".join(f"> {late:.0f}" if times[axis] is None else f"{times[axis] * 1e3:.0f}" for axis in "xyz")


def _axes(values: Mapping[str, float] | None, decimals: int) -> str:
    return "–" if values is None else " / ".join(f"{values[axis]:.{decimals}f}" for axis in "xyz")


def _pair(values: Sequence[float | None], decimals: int) -> str:
    return " / ".join("–" if value is None else f"{value:z.{decimals}f}" for value in values)


def _or_dash(values: Mapping[str, Any] | None, key: str, decimals: int) -> str:
    return "–" if values is None else f"{values[key]:.{decimals}f}"
