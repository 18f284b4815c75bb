"""What virtual metrology found: programs side by side, held against the tolerance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from shapegcode import _core
from shapegcode.metrology.figures import MeasuredSection, SidedError
from shapegcode.metrology.tables import section_table, summary_table
from shapegcode.model.playable import PlayedPrograms
from shapegcode.results.figures import Tracks, largest_xyz_um
from shapegcode.results.json import hidden
from shapegcode.results.result import Plot, Result, Xyz
from shapegcode.results.table import Table


@dataclass(frozen=True, eq=False)
class MeasuredRegion:
    """One cutting region of a program, measured.

    Attributes:
        lines: of the program whose path it is measured against, first and last, from 1.
        path: that path.
        figures: what the core measured.
        sections: of the path, in order.
        station_spacing_mm: largest distance between two places at which walls were measured.
    """

    lines: tuple[int, int]
    path: _core.Path
    figures: _core.TrackFigures
    sections: tuple[MeasuredSection, ...]
    station_spacing_mm: float


@dataclass(frozen=True, eq=False)
class MeasuredProgram:
    """One program, measured.

    Attributes:
        program: its name.
        shaped: played as one that shapegcode wrote: block by block at its feed.
        measured_against: name of the program whose path is the nominal one; its own name for its own path.
        ok: the response stays within the tolerance of the path; None: it is not judged.
        cutting_time_s: of all regions, until the set-points rest.
        contour_error_um: of all regions; missed corners count.
        residual_vibration_um: largest |response - command| of each axis at the stops.
        sections: of all regions, in order.
        warnings: about the program and the machine.
        regions: in order.
    """

    program: str
    shaped: bool
    measured_against: str
    ok: bool | None
    cutting_time_s: float
    contour_error_um: Tracks[SidedError]
    residual_vibration_um: Xyz[float]
    sections: tuple[MeasuredSection, ...]
    warnings: tuple[str, ...]
    regions: tuple[MeasuredRegion, ...] = field(metadata=hidden())

    @classmethod
    def of(
        cls,
        regions: Iterable[MeasuredRegion],
        *,
        program: str,
        shaped: bool,
        measured_against: str,
        limit_um: float | None,
        warnings: Iterable[str] = (),
    ) -> MeasuredProgram:
        """The figures of its regions together."""
        kept = tuple(regions)
        figures = [region.figures for region in kept]
        contour = Tracks(
            SidedError.of([each.command for each in figures], [each.command_sides for each in figures]),
            SidedError.of([each.response for each in figures], [each.response_sides for each in figures]),
        )
        return cls(
            program=program,
            shaped=shaped,
            measured_against=measured_against,
            ok=None if limit_um is None else contour.response.max <= limit_um,
            cutting_time_s=sum(each.duration_s for each in figures),
            contour_error_um=contour,
            residual_vibration_um=largest_xyz_um(each.rest.residual_mm for each in figures),
            sections=tuple(section for region in kept for section in region.sections),
            warnings=tuple(warnings),
            regions=kept,
        )

    @property
    def name(self) -> str:
        """The name of its file."""
        return Path(self.program).name

    @property
    def how(self) -> str:
        """How it was played, and against which path it was measured."""
        played = "block by block, as a shaped program" if self.shaped else "with the controller's own motion"
        own = self.measured_against == self.program
        path = "its own path" if own else f"the path of {self.measured_against}"
        judged = ""
        if self.ok is None:
            judged = ", which is not the programmed one" if self.shaped else ", to compare the shaped with"
            judged += ": not judged"
        return f"{self.program}: played {played}, measured against {path}{judged}"

    def verdict(self, limit_um: float) -> str:
        """By how much it keeps the tolerance or does not, and where."""
        largest = self.contour_error_um.response.max
        within = f"leaves the path by {largest:.2f} µm at most"
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
            return "at a corner that it rounds off"
        return f"in section {self.sections[index].name(index + 1)}"


@dataclass(frozen=True, repr=False, eq=False)
class Measurement(Result):
    """Programs measured side by side.

    Attributes:
        machine: name of the machine.
        plant: "modal" or "feed-drive".
        tool_diameter_mm: of the disc that was swept along the response.
        settling_band_um: settled is what stays within it.
        station_spacing_mm: largest distance between two places at which walls were measured.
        roughness_cutoff_mm: cut-off λc; None: by the length of each section.
        roughness_lambda_s_mm: short-wave cut-off; 0: none.
        contour_tolerance_um: of the machine file (`tolerance.contour_um`).
        programs: in the order in which they were given.
        played: the first two of them, to play them again for a page.
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
    played: PlayedPrograms | None = field(default=None, compare=False, repr=False, metadata=hidden())

    @property
    def ok(self) -> bool:
        """The response of every program that is judged stays within the tolerance of the path."""
        return all(program.ok is not False for program in self.programs)

    @property
    def warnings(self) -> tuple[str, ...]:  # type: ignore[override]
        """Those of the programs, each once."""
        return tuple(dict.fromkeys(warning for program in self.programs for warning in program.warnings))

    @property
    def answer(self) -> str:
        """For each program that is held against the tolerance: what it keeps, or by how much it does not."""
        judged = [program for program in self.programs if program.ok is not None] or self.programs
        return "; ".join(program.verdict(self.contour_tolerance_um) for program in judged)

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        if not self.ok and self.plant == "feed-drive":
            return (
                "the lag of the servo loops takes the table off the path: more feed-forward or position gain, or less "
                "feed; --plant modal shows what vibration alone does"
            )
        missed = next((each for each in self.programs if each.shaped and each.ok is False), None)
        if missed is not None:
            return f"convert again with a smaller --contour-tolerance: {missed.name} leaves the path"
        if not any(program.shaped for program in self.programs):
            return "shapegcode convert shapes the program; measure both to see what it gains"
        if any(program.shaped and program.ok is None for program in self.programs):
            return "measure it --against the original program: its own path is not the programmed one"
        return "--plots DIR draws the part with its deviations magnified, --lines A-B measures the cut of these lines"

    def tables(self, *, every_section: bool = False) -> list[Table]:
        """A summary and a table of sections for the programs that are measured against the same path, side by side.

        Args:
            every_section: show all sections; False: of many the worst ones.

        Returns:
            Two for each path.
        """
        found = []
        for path in dict.fromkeys(program.measured_against for program in self.programs):
            beside = [program for program in self.programs if program.measured_against == path]
            by_name = {program.name: program for program in beside}
            # Whole paths where two files of one name are compared.
            if len(by_name) < len(beside):
                by_name = {f"{number} {program.program}": program for number, program in enumerate(beside, start=1)}
            judged = any(program.ok is not None for program in beside)
            limit_um = self.contour_tolerance_um if judged else None
            sections = {name: program.sections for name, program in by_name.items()}
            whole = {
                name: (program.cutting_time_s, program.contour_error_um.response.max)
                for name, program in by_name.items()
            }
            on = f"{self.machine}, tool of {self.tool_diameter_mm:g} mm, {self.plant} plant"
            if any(sections.values()):
                found.append(summary_table(f"worst figures on {on}", sections, whole, self.settling_band_um))
            title = f"sections measured on {on}"
            found.append(section_table(title, sections, limit_um, self.settling_band_um, every=every_section))
        return found

    def plots(self) -> Mapping[str, Plot]:
        """`measure-part` and `measure-walls` of the region whose walls leave their place most; none without walls."""
        return self._drawn_beside()
