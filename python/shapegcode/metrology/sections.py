"""What virtual metrology found, and all of it as a plain dictionary: the JSON of ``shapegcode measure``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.results.figures import deviation_um, largest_um, xyz

__all__ = ["MeasuredProgram", "MeasuredRegion", "Measurement", "WallProfile", "measurement_report", "section_report"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class WallProfile:
    """The walls of a section.

    Attributes:
        distance_mm: of the stations from the region's start, (n,).
        left_um: deviation of the left wall from what the programmed path cuts, positive to the left, (n,); NaN where
            there is no wall.
        right_um: of the right wall, likewise.
        point_mm: of the programmed path there, seen from above, (n, 2).
        normal: unit vectors to the left of the path, (n, 2); zero where it has no horizontal direction.
    """

    distance_mm: FloatArray
    left_um: FloatArray
    right_um: FloatArray
    point_mm: FloatArray
    normal: FloatArray


@dataclass(frozen=True, eq=False)
class MeasuredRegion:
    """One cutting region of a program, measured.

    Attributes:
        lines: of the program whose path it is measured against, first and last, from 1.
        path: that path.
        figures: what the core measured.
        walls: one per section; None where so many stations are not kept.
        station_spacing_mm: largest distance between two stations.
    """

    lines: tuple[int, int]
    path: _core.Path
    figures: _core.RunFigures
    walls: tuple[WallProfile | None, ...]
    station_spacing_mm: float


@dataclass(frozen=True, eq=False)
class MeasuredProgram:
    """One program, measured.

    Attributes:
        source: its name.
        shaped: played as one that shapegcode wrote: block by block at its feed.
        against: name of the program whose path it is measured against; the same as `source` for its own path.
        regions: in order.
        warnings: about the program and the machine.
    """

    source: str
    shaped: bool
    against: str
    regions: tuple[MeasuredRegion, ...]
    warnings: tuple[str, ...]

    @property
    def contour_error_um(self) -> float:
        """Largest distance of the response from the path, µm."""
        return max((region.figures.response.max_abs_mm for region in self.regions), default=0.0) * 1e3


@dataclass(frozen=True, eq=False)
class Measurement:
    """Programs measured side by side.

    Attributes:
        machine: that they were played on.
        plant: "modal" or "feed-drive".
        tool_diameter_mm: of the disc.
        band_um: settled is what stays within it.
        station_spacing_mm: largest distance between two places at which walls were measured.
        cutoff_mm: cut-off of the roughness; None: by the length of each section.
        lambda_s_mm: short-wave cut-off; 0: none.
        programs: in the order in which they were given.
    """

    machine: Machine
    plant: str
    tool_diameter_mm: float
    band_um: float
    station_spacing_mm: float
    cutoff_mm: float | None
    lambda_s_mm: float
    programs: tuple[MeasuredProgram, ...]

    @property
    def judged(self) -> tuple[MeasuredProgram, ...]:
        """The programs that are held against the tolerance.

        Shaped programs beside the programmed path; what they are compared with only stands beside them. Without such a
        program the others. A shaped program's own path is not the programmed one: it is not judged against that.
        """
        shaped = tuple(each for each in self.programs if each.shaped and each.against != each.source)
        return shaped or tuple(each for each in self.programs if not each.shaped)

    @property
    def within_tolerance(self) -> bool:
        """Whether the response of every program that is judged stays within `tolerance.contour_um` of the path."""
        limit = self.machine.tolerance.contour_um
        return all(each.contour_error_um <= limit for each in self.judged)

    def report(self) -> dict[str, Any]:
        """Everything as the JSON of ``shapegcode measure --json`` (docs/metrology.md)."""
        return measurement_report(self)


def measurement_report(measurement: Measurement) -> dict[str, Any]:
    """The whole measurement (keys: docs/metrology.md)."""
    return {
        "machine": measurement.machine.name,
        "plant": measurement.plant,
        "tool_diameter_mm": measurement.tool_diameter_mm,
        "settling_band_um": measurement.band_um,
        "station_spacing_mm": measurement.station_spacing_mm,
        "roughness_cutoff_mm": measurement.cutoff_mm,
        "roughness_lambda_s_mm": measurement.lambda_s_mm,
        "tolerance_um": {"contour": measurement.machine.tolerance.contour_um},
        "within_tolerance": measurement.within_tolerance,
        "programs": [_program(program, measurement) for program in measurement.programs],
    }


def _program(program: MeasuredProgram, measurement: Measurement) -> dict[str, Any]:
    figures = [region.figures for region in program.regions]
    return {
        "program": program.source,
        "shaped": program.shaped,
        "measured_against": program.against,
        "within_tolerance": program.contour_error_um <= measurement.machine.tolerance.contour_um
        if program in measurement.judged
        else None,
        "cutting_time_s": sum(each.duration_s for each in figures),
        "contour_error_um": {
            "command": _deviation([each.command for each in figures], [each.command_sides for each in figures]),
            "response": _deviation([each.response for each in figures], [each.response_sides for each in figures]),
        },
        "residual_vibration_um": largest_um(each.rest.residual_mm for each in figures),
        "sections": [
            {"region": number, **section_report(section, measurement.tool_diameter_mm)}
            for number, region in enumerate(program.regions, start=1)
            for section in region.figures.sections
        ],
        "warnings": list(program.warnings),
    }


def section_report(figures: _core.SectionFigures, tool_diameter_mm: float) -> dict[str, Any]:
    """One section; figures that do not apply are null."""
    section, rest = figures.section, figures.rest
    return {
        "kind": section.kind.name,
        "lines": [section.first_line, section.last_line],
        "begin_mm": section.begin_mm,
        "length_mm": section.length_mm,
        "time_s": figures.time_s,
        "peak_vibration_um": xyz(figures.peak_mm * 1e3),
        "residual_vibration_um": None if rest is None else xyz(rest.residual_mm * 1e3),
        "settling_time_s": None
        if rest is None
        else {axis: _number(value) for axis, value in zip("xyz", rest.settling_s, strict=True)},
        "observed_rest_s": None if rest is None else rest.observed_s,
        "contour_error_um": {
            "command": _deviation([figures.command], [figures.command_sides]),
            "response": _deviation([figures.response], [figures.response_sides]),
        },
        "arc": _arc(figures, tool_diameter_mm) if section.kind == _core.SectionKind.arc else None,
        "wall_deviation_um": {"left": _wall(figures.left), "right": _wall(figures.right)},
        "width_mm": {
            "nominal": tool_diameter_mm,
            **(
                {"min": None, "mean": None, "max": None, "stations": 0}
                if figures.width.stations == 0
                else {
                    "min": figures.width.least_mm,
                    "mean": figures.width.mean_mm,
                    "max": figures.width.largest_mm,
                    "stations": figures.width.stations,
                }
            ),
        },
        "roughness": {"left": _roughness(figures.left_roughness), "right": _roughness(figures.right_roughness)},
    }


def _deviation(stats: Sequence[_core.DeviationStats], sides: Sequence[_core.SideFigures]) -> dict[str, float]:
    """Largest and RMS deviation, and the largest on each side: a vertical one is above or below, not left or right."""
    by_side = {
        "left": [each.left_mm for each in sides],
        "right": [each.right_mm for each in sides],
        "above": [each.above_mm for each in sides],
        "below": [each.below_mm for each in sides],
    }
    return {**deviation_um(stats), **{side: max(values, default=0.0) * 1e3 for side, values in by_side.items()}}


def _wall(wall: _core.WallFigures) -> dict[str, float | int | None]:
    if wall.stations == 0:
        return {"min": None, "mean": None, "max": None, "band": None, "stations": 0}
    return {
        "min": wall.least_mm * 1e3,
        "mean": wall.mean_mm * 1e3,
        "max": wall.largest_mm * 1e3,
        "band": wall.band_mm * 1e3,
        "stations": wall.stations,
    }


def _roughness(roughness: _core.Roughness | None) -> dict[str, float] | None:
    if roughness is None:
        return None
    return {
        "ra_um": roughness.ra_mm * 1e3,
        "rz_um": roughness.rz_mm * 1e3,
        "wa_um": roughness.wa_mm * 1e3,
        "cutoff_mm": roughness.cutoff_mm,
        "evaluated_mm": roughness.evaluated_mm,
    }


def _arc(figures: _core.SectionFigures, tool_diameter_mm: float) -> dict[str, Any]:
    nominal, radius = figures.nominal_radius_mm, tool_diameter_mm / 2.0
    walls = (figures.left_wall_arc, figures.right_wall_arc)
    inside, outside = walls if figures.turns_left else walls[::-1]
    return {
        "nominal_radius_mm": nominal,
        "command": _circle(figures.command_arc, nominal, figures),
        "response": _circle(figures.response_arc, nominal, figures),
        "inside_wall": _circle(inside, nominal - radius, figures),
        "outside_wall": _circle(outside, nominal + radius, figures),
        "orbit_error_percent": {"command": figures.command_orbit_percent, "response": figures.response_orbit_percent},
    }


def _circle(arc: _core.ArcFigures | None, nominal_mm: float, figures: _core.SectionFigures) -> dict[str, Any] | None:
    if arc is None:
        return None
    offset = (arc.fit.centre_mm - figures.nominal_centre_mm) * 1e3
    return {
        "nominal_radius_mm": nominal_mm,
        "fitted_radius_mm": arc.fit.radius_mm,
        "radius_deviation_um": (arc.fit.radius_mm - nominal_mm) * 1e3,
        "mean_radius_deviation_um": (arc.mean_radius_mm - nominal_mm) * 1e3,
        "centre_offset_um": [float(offset[0]), float(offset[1])],
        "form_error_um": arc.fit.form_mm * 1e3,
    }


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
