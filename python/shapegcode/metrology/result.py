"""Results of virtual metrology: programs side by side, compared with the tolerance."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Self

from shapegcode import _core
from shapegcode.metrology.figures import FittedCircle, MeasuredArc, MeasuredSection, SidedError, WallDeviation
from shapegcode.model.programs import SimulatedPrograms
from shapegcode.results.json import hidden
from shapegcode.results.outcome import Plot, Tracks, Xyz, largest_xyz_um
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table

_MAX_SECTIONS = 12
_SHOWN_UM = 0.005  # smaller values are shown as 0.00

Sections = Sequence[MeasuredSection]
Values = Callable[[MeasuredSection], Sequence[float | None]]


@dataclass(frozen=True, eq=False)
class MeasuredRegion:
    """One cutting region of a program, measured."""

    lines: tuple[int, int]  # first and last line of the program against which it is measured, from 1
    path: _core.Path  # path of that program in the region
    figures: _core.TrackFigures  # measured by the core
    sections: tuple[MeasuredSection, ...]  # sections of the path, in order
    station_spacing_mm: float  # largest distance between two measured stations of walls


@dataclass(frozen=True, eq=False)
class MeasuredProgram:
    """One program, measured."""

    program: str  # its file as named, or other source
    shaped: bool  # whether it has shaped cuts, which are simulated block by block at their feed
    measured_against: str  # file of the program whose path is the nominal one; its own file for its own path
    ok: bool | None  # the response is within the tolerance of the path; None: not judged
    cutting_time_s: float  # of all regions, until the set-points rest
    contour_error_um: Tracks[SidedError]  # of all regions, including corners
    residual_vibration_um: Xyz[float]  # largest |response - command| of each axis after the stop at each region's end
    sections: tuple[MeasuredSection, ...]  # of all regions, in order
    warnings: tuple[str, ...]  # on the program and the machine
    regions: tuple[MeasuredRegion, ...] = field(metadata=hidden())  # in order

    @classmethod
    def of(
        cls,
        about: tuple[str, bool, str],
        regions: tuple[MeasuredRegion, ...],
        limit_um: float | None,
        warnings: tuple[str, ...],
    ) -> Self:
        """Combine the figures of its regions; *about*: its name, whether shaped, what it is measured against."""
        figures = [region.figures for region in regions]
        contour = Tracks(
            SidedError.of([each.command for each in figures], [each.command_sides for each in figures]),
            SidedError.of([each.response for each in figures], [each.response_sides for each in figures]),
        )
        return cls(
            *about,
            ok=None if limit_um is None else contour.response.max <= limit_um,
            cutting_time_s=sum(each.duration_s for each in figures),
            contour_error_um=contour,
            residual_vibration_um=largest_xyz_um(each.rest.residual_mm for each in figures),
            sections=tuple(section for region in regions for section in region.sections),
            warnings=warnings,
            regions=regions,
        )

    @property
    def name(self) -> str:
        """File name."""
        return Path(self.program).name

    @property
    def how(self) -> str:
        """Sentence: how it was simulated, and against which path it was measured."""
        simulated = "block by block, as a shaped program" if self.shaped else "with the controller's own motion"
        own = self.measured_against == self.program
        path = "its own path" if own else f"the path of {self.measured_against}"
        why = ", which is not the programmed one" if self.shaped else ", to compare with the shaped one"
        judged = f"{why}: not judged" if self.ok is None else ""
        return f"{self.program}: simulated {simulated}, measured against {path}{judged}"

    def verdict(self, limit_um: float) -> str:
        """Sentence: the largest deviation; not judged, within tolerance, or out of tolerance by how much and where."""
        largest = self.contour_error_um.response.max
        within = f"deviates from the path by up to {largest:.2f} µm"
        if self.ok is None:
            return f"{self.name}: not judged: {within}"
        limit = f"limit {limit_um:g} µm (tolerance.contour_um)"
        if self.ok:
            return f"{self.name}: within tolerance: {within}, {limit}"
        return f"{self.name}: OUT OF TOLERANCE by {largest - limit_um:.2f} µm: {within}, {limit}, {self._worst_place}"

    @property
    def _worst_place(self) -> str:
        worst = [section.contour_error_um.response.max for section in self.sections]
        index = worst.index(max(worst))
        if worst[index] < self.contour_error_um.response.max:
            return "at a rounded corner"
        return f"in section {self.sections[index].name(index + 1)}"


@dataclass(frozen=True, repr=False, eq=False)
class Measurement(Result):
    """Programs measured side by side.

    Attributes:
        machine: name of the machine.
        plant: "modal" or "feed-drive".
        tool_diameter_mm: diameter of the disc swept along the response.
        settling_band_um: settled means within this distance of the command.
        station_spacing_mm: largest distance between two measured stations of walls.
        roughness_cutoff_mm: cut-off λc; None: by the length of each section.
        roughness_lambda_s_mm: short-wave cut-off; 0: none.
        contour_tolerance_um: of the machine file (`tolerance.contour_um`).
        programs: in the given order.
        simulated: the first two of them, for a page.
    """

    machine: str
    plant: str
    tool_diameter_mm: float
    settling_band_um: float
    station_spacing_mm: float
    roughness_cutoff_mm: float | None
    roughness_lambda_s_mm: float
    contour_tolerance_um: float
    programs: tuple[MeasuredProgram, ...]
    simulated: SimulatedPrograms | None = field(default=None, compare=False, repr=False, metadata=hidden())

    @property
    def methods(self) -> tuple[str, ...]:
        """Published methods of controller, plant and circle fit."""
        has_arcs = any(section.arc is not None for program in self.programs for section in program.sections)
        return (*(("circle fit",) if has_arcs else ()), *(() if self.simulated is None else self.simulated.methods))

    @property
    def ok(self) -> bool:
        """True if the response of every judged program is within the tolerance of the path."""
        return all(program.ok is not False for program in self.programs)

    @property
    def warnings(self) -> tuple[str, ...]:  # type: ignore[override]
        """Warnings of the programs, each once."""
        return tuple(dict.fromkeys(warning for program in self.programs for warning in program.warnings))

    @property
    def answer(self) -> str:
        """For each judged program: within tolerance, or how far out; if none is judged, the deviation of each."""
        judged = [program for program in self.programs if program.ok is not None] or self.programs
        return "; ".join(program.verdict(self.contour_tolerance_um) for program in judged)

    @property
    def next_step(self) -> str:
        """Next command or change, in one sentence."""
        if not self.ok and self.plant == "feed-drive":
            return (
                "servo lag moves the table off the path: more feed-forward or position gain, or less "
                "feed; --plant modal shows the effect of vibration alone"
            )
        missed = next((each for each in self.programs if each.shaped and each.ok is False), None)
        if missed is not None:
            return f"convert again with a smaller --contour-tolerance: {missed.name} deviates from the path"
        if not any(program.shaped for program in self.programs):
            return "shapegcode convert shapes the program; measure both to see the gain"
        if any(program.shaped and program.ok is None for program in self.programs):
            return "measure it --against the original program: its own path is not the programmed one"
        return "--plots DIR draws the part with its deviations magnified, --lines A-B measures the cut of these lines"

    def tables(self, *, every_section: bool = False) -> list[Table]:
        """Tables that compare the programs measured against the same path: a summary, and one of the sections.

        Args:
            every_section: show all sections; False: if there are many, only the worst.

        Returns:
            Two tables for each path.
        """
        found = []
        for path in dict.fromkeys(program.measured_against for program in self.programs):
            beside = [program for program in self.programs if program.measured_against == path]
            by_name = {program.name: program for program in beside}
            # Full file paths if two files have the same name.
            if len(by_name) < len(beside):
                by_name = {f"{number} {program.program}": program for number, program in enumerate(beside, start=1)}
            judged = any(program.ok is not None for program in beside)
            limit_um = self.contour_tolerance_um if judged else None
            on = f"{self.machine}, tool of {self.tool_diameter_mm:g} mm, {self.plant} plant"
            if any(program.sections for program in beside):
                found.append(_summary_table(f"worst figures on {on}", by_name, self.settling_band_um))
            title = f"sections measured on {on}"
            found.append(_section_table(title, by_name, limit_um, self.settling_band_um, every=every_section))
        return found

    def plots(self) -> Mapping[str, Plot]:
        """`measure-part` and `measure-walls` of the region with the largest deviation of walls; none without walls."""
        return self._drawn_beside()


@dataclass(frozen=True)
class _Row:
    name: str  # name of the figure
    values: Sequence[str]  # values as text, one per program
    nominal: str = ""  # nominal value; empty: zero
    limit: str = ""  # limit of the machine file; empty: none
    out: tuple[bool, ...] = ()  # for each program: beyond the limit
    heading: bool = False  # starts a section


def _program_columns(names: Sequence[str]) -> tuple[Column, ...]:
    """Columns, one per program; with more than two, values wrap to fit side by side."""

    def text(rank: int, row: _Row) -> str:
        return row.values[rank] if row.values else ""

    def style(rank: int, row: _Row) -> str:
        return "bold red" if row.out and row.out[rank] else ""

    return tuple(
        Column(name, value=partial(text, rank), style=partial(style, rank), text=len(names) > 2)
        for rank, name in enumerate(names)
    )


def _summary_table(title: str, programs: Mapping[str, MeasuredProgram], band_um: float) -> Table:
    """Table of cutting time, contour error, and the largest value of each other figure with section and line."""
    all_of = programs.values()
    largest = (each.contour_error_um.response.max for each in all_of)
    rows = [
        _Row("cutting time s", tuple(f"{each.cutting_time_s:.2f}" for each in all_of)),
        _Row("contour error µm, corners included", tuple(f"{value:.2f}" for value in largest)),
    ]
    for name, values in _figures(band_um):
        worst = [_worst(each.sections, values) for each in all_of]
        if any(worst):
            rows.append(_Row(name, tuple(cell or "–" for cell in worst)))
    columns = (Column("largest (section, line)", value="name", text=True), *_program_columns(list(programs)))
    return Table(title, columns, rows)


def _worst(sections: Sections, values: Values) -> str:
    """Largest value and its location; empty if no section has the figure."""
    numbered = enumerate(sections, start=1)
    found = [(value, -number) for number, each in numbered for value in values(each) if value is not None]
    if not found:
        return ""
    value, number = max(found)
    text = "not settled" if math.isinf(value) else f"{value:.2f}"
    return f"{text} ({-number}, {sections[-number - 1].place})"


def _figures(band_um: float) -> Iterator[tuple[str, Values]]:
    """Yield each figure: its name with unit, and a function for its values in a section; the largest value counts."""
    yield "contour error of a section µm", lambda s: [s.contour_error_um.response.max]
    for name, key in (("peak vibration", "peak_vibration_um"), ("residual at the stop", "residual_vibration_um")):
        for axis in "xyz":
            yield f"{name} {axis.upper()} µm", partial(_of_axis, key, axis)
    yield f"settling to {band_um:g} µm, ms", _settling_ms
    yield "fitted radius deviation µm", partial(_radii_off, ("response",))
    yield "inside, outside wall radius deviation µm", partial(_radii_off, ("inside_wall", "outside_wall"))
    yield "orbit error of response %", lambda s: [None if s.arc is None else s.arc.orbit_error_percent.response]
    yield "cut-width band µm", lambda s: [wall.band for wall in s.wall_deviation_um.both()]
    yield "width deviation µm", _width_off_um
    yield "Ra of a wall µm", partial(_of_walls, "ra_um")
    yield "Wa of a wall µm", partial(_of_walls, "wa_um")


def _of_axis(key: str, axis: str, section: MeasuredSection) -> list[float | None]:
    found: Xyz[float] | None = getattr(section, key)
    return [None if found is None else found[axis]]


def _of_walls(key: str, section: MeasuredSection) -> list[float | None]:
    return [None if wall is None else getattr(wall, key) for wall in section.roughness.both()]


def _settling_ms(section: MeasuredSection) -> list[float | None]:
    return [math.inf if value is None else 1e3 * value for value in section.settling_time_s or ()]


def _radii_off(keys: Sequence[str], section: MeasuredSection) -> list[float | None]:
    circles: list[FittedCircle | None] = [getattr(section.arc, key, None) for key in keys]
    return [None if circle is None else abs(circle.radius_deviation_um) for circle in circles]


def _width_off_um(section: MeasuredSection) -> list[float | None]:
    width = section.width_mm
    return [None if value is None else 1e3 * abs(value - width.nominal) for value in (width.min, width.max)]


def _section_table(
    title: str, programs: Mapping[str, MeasuredProgram], limit_um: float | None, band_um: float, *, every: bool
) -> Table:
    """Table of the figures of each section, one column per program."""
    beside = list(zip(*(each.sections for each in programs.values()), strict=False))
    count = len(beside)
    worst = [max(each.contour_error_um.response.max for each in sections) for sections in beside]
    shown = sorted(range(count), key=lambda index: -worst[index])[: None if every else _MAX_SECTIONS]
    rows: list[_Row] = []
    for index in sorted(shown):
        rows.append(_Row(beside[index][0].name(index + 1), (), heading=True))
        rows += _section_rows(beside[index], limit_um, band_um)
    columns = (
        Column("figure", value="name", text=True),
        Column("nominal", value="nominal"),
        *_program_columns(list(programs)),
        Column("limit", value="limit"),
    )
    left_out = count - len(shown)
    caption = f"{left_out} more sections with smaller contour error: --verbose shows them, --json lists them"
    return Table(
        title, columns, rows, caption=caption if left_out else "",
        sections=[rank for rank, row in enumerate(rows) if row.heading],
        row_style=lambda row: "bold" if row.heading else "",
    )  # fmt: skip


def _section_rows(sections: Sections, limit_um: float | None, band_um: float) -> Iterator[_Row]:
    yield _Row("length mm, time s", [f"{s.time_s:.3f}" for s in sections], f"{sections[0].length_mm:.3f}")
    yield from _contour_rows(sections, limit_um)
    arcs = [section.arc for section in sections if section.arc is not None]
    if arcs:
        yield from _arc_rows(arcs)
    yield from _wall_rows(sections)
    yield from _roughness_rows(sections)
    yield _Row("peak vibration X / Y / Z µm", [_axes(s.peak_vibration_um) for s in sections])
    if any(section.residual_vibration_um is not None for section in sections):
        yield _Row("residual at the stop X / Y / Z µm", [_axes(s.residual_vibration_um) for s in sections])
        yield _Row(f"settled to {band_um:g} µm X / Y / Z ms", [_settling(s) for s in sections])


def _contour_rows(sections: Sections, limit_um: float | None) -> Iterator[_Row]:
    response = [section.contour_error_um.response for section in sections]
    command = [section.contour_error_um.command for section in sections]
    limit = "" if limit_um is None else f"{limit_um:g}"
    out = tuple(limit_um is not None and each.max > limit_um for each in response)
    yield _Row("contour error µm", tuple(f"{each.max:.2f}" for each in response), "0", limit, out)
    yield _Row("  left / right µm", tuple(_pair((each.left, each.right), 2) for each in response))
    if _off_the_level(response):
        yield _Row("  above / below µm", tuple(_pair((each.above, each.below), 2) for each in response))
    yield _Row("  RMS µm", tuple(f"{each.rms:.2f}" for each in response))
    yield _Row("command left / right µm", tuple(_pair((each.left, each.right), 2) for each in command), "0")
    if _off_the_level(command):
        yield _Row("command above / below µm", tuple(_pair((each.above, each.below), 2) for each in command), "0")


def _off_the_level(errors: Sequence[SidedError]) -> bool:
    return any(value >= _SHOWN_UM for each in errors for value in (each.above, each.below))


def _arc_rows(arcs: Sequence[MeasuredArc]) -> Iterator[_Row]:
    track = [arc.response for arc in arcs]
    for name, circles in (
        ("fitted radius", track),
        ("inside wall", [arc.inside_wall for arc in arcs]),
        ("outside wall", [arc.outside_wall for arc in arcs]),
    ):
        nominal = next((circle.nominal_radius_mm for circle in circles if circle is not None), None)
        if nominal is not None:
            yield _Row(f"{name} mm (deviation µm)", tuple(map(_radius, circles)), f"{nominal:.3f}")
    if any(circle is not None for circle in track):
        form = ("–" if circle is None else f"{circle.form_error_um:.2f}" for circle in track)
        yield _Row("form error µm", tuple(form), "0")
        centre = ("–" if circle is None else _pair(circle.centre_offset_um, 1) for circle in track)
        yield _Row("centre offset µm", tuple(centre), "0")
    orbits = (arc.orbit_error_percent.response for arc in arcs)
    yield _Row("orbit error of response %", tuple("–" if value is None else f"{value:.4f}" for value in orbits), "0")


def _radius(circle: FittedCircle | None) -> str:
    return "–" if circle is None else f"{circle.fitted_radius_mm:.4f} ({circle.radius_deviation_um:+z.1f})"


def _wall_rows(sections: Sections) -> Iterator[_Row]:
    walls = [section.wall_deviation_um for section in sections]
    if all(wall.stations == 0 for each in walls for wall in each.both()):
        return
    yield _Row("left wall, from / to µm", tuple(_span(each.left) for each in walls), "0")
    yield _Row("right wall, from / to µm", tuple(_span(each.right) for each in walls), "0")
    bands = tuple(_pair([wall.band for wall in each.both()], 2) for each in walls)
    yield _Row("cut-width band left / right µm", bands, "0")
    ends = [_pair((s.width_mm.min, s.width_mm.max), 4) for s in sections]
    yield _Row("width min / max mm", ends, f"{sections[0].width_mm.nominal:.3f}")


def _span(wall: WallDeviation) -> str:
    return "–" if wall.min is None or wall.max is None else f"{wall.min:+z.2f} … {wall.max:+z.2f}"


def _roughness_rows(sections: Sections) -> Iterator[_Row]:
    if all(wall is None for section in sections for wall in section.roughness.both()):
        return
    for name, key in (("Ra", "ra_um"), ("Rz", "rz_um"), ("Wa", "wa_um")):
        yield _Row(f"{name} left / right µm", tuple(_pair(_of_walls(key, section), 3) for section in sections))


def _settling(section: MeasuredSection) -> str:
    if section.settling_time_s is None or section.observed_rest_s is None:
        return "–"
    late = f"> {section.observed_rest_s * 1e3:.0f}"
    return " / ".join(late if value is None else f"{value * 1e3:.0f}" for value in section.settling_time_s)


def _axes(values: Xyz[float] | None) -> str:
    return "–" if values is None else " / ".join(f"{value:.2f}" for value in values)


def _pair(values: Sequence[float | None], decimals: int) -> str:
    return " / ".join("–" if value is None else f"{value:z.{decimals}f}" for value in values)
