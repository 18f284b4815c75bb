"""The figures of a section of a path by kind: contour, circles, walls, width, roughness."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.results.json import hidden
from shapegcode.results.outcome import ContourError, Tracks, Xyz, largest_xyz_um

T = TypeVar("T")


@dataclass(frozen=True)
class Sides(Generic[T]):
    """A figure of both sides of the travel."""

    left: T  # of the left one
    right: T  # of the right one

    def both(self) -> tuple[T, T]:
        """Left and right."""
        return self.left, self.right


@dataclass(frozen=True)
class SidedError:
    """How far a track leaves the programmed path, in µm; a vertical deviation is above or below, not left or right."""

    max: float  # distance, any side
    rms: float  # root mean square over the time in which the command moves
    left: float  # largest to the left of the travel
    right: float  # largest to the right of it
    above: float  # largest above it
    below: float  # largest below it

    @classmethod
    def of(cls, stats: Sequence[_core.DeviationStats], sides: Sequence[_core.SideFigures]) -> SidedError:
        """The figures of one or several runs together; all zero without any. The core's are in mm."""
        whole = ContourError.of(stats)
        names = ("left_mm", "right_mm", "above_mm", "below_mm")
        largest = (max((getattr(each, name) for each in sides), default=0.0) * 1e3 for name in names)
        return cls(whole.max, whole.rms, *largest)


@dataclass(frozen=True)
class FittedCircle:
    """A circle through what was moved or cut on an arc."""

    nominal_radius_mm: float  # as programmed; of a wall with the tool's radius
    fitted_radius_mm: float  # circle of least squares
    radius_deviation_um: float  # fitted less nominal
    mean_radius_deviation_um: float  # mean distance from the programmed centre less nominal
    centre_offset_um: tuple[float, float]  # of the fitted centre from the programmed one, in the plane of the arc
    form_error_um: float  # largest less smallest radial distance

    @classmethod
    def of(cls, arc: _core.ArcFigures | None, nominal_mm: float, centre_mm: FloatArray) -> FittedCircle | None:
        """From the core; None where there is none."""
        if arc is None:
            return None
        x, y = (float(value) for value in (arc.fit.centre_mm - centre_mm) * 1e3)
        off, mean_off = (arc.fit.radius_mm - nominal_mm) * 1e3, (arc.mean_radius_mm - nominal_mm) * 1e3
        return cls(nominal_mm, arc.fit.radius_mm, off, mean_off, (x, y), arc.fit.form_mm * 1e3)


@dataclass(frozen=True)
class MeasuredArc:
    """What only an arc has."""

    nominal_radius_mm: float  # as programmed
    command: FittedCircle | None  # circle through the set-points; arcs of 10 degrees on, else None
    response: FittedCircle | None  # through the table's positions, likewise
    inside_wall: FittedCircle | None  # through the wall towards the centre; None where there is none
    outside_wall: FittedCircle | None  # through the other wall, likewise
    orbit_error_percent: Tracks[float | None]  # area between track and arc over the sector; None where it is not known

    @classmethod
    def of(cls, figures: _core.SectionFigures, tool_diameter_mm: float) -> MeasuredArc:
        """From the core's figures of an arc, and the tool that cuts its walls."""
        nominal, centre, radius = figures.nominal_radius_mm, figures.nominal_centre_mm, tool_diameter_mm / 2.0
        walls = (figures.left_wall_arc, figures.right_wall_arc)
        inside, outside = walls if figures.turns_left else walls[::-1]
        arcs = (figures.command_arc, 0.0), (figures.response_arc, 0.0), (inside, -radius), (outside, radius)
        command, response, inner, outer = (FittedCircle.of(arc, nominal + beside, centre) for arc, beside in arcs)
        orbit_error_percent = Tracks(figures.command_orbit_percent, figures.response_orbit_percent)
        return cls(nominal, command, response, inner, outer, orbit_error_percent)


@dataclass(frozen=True)
class WallDeviation:
    """A wall from where the programmed path cuts it, in µm, positive to the left of the travel; None without a wall."""

    min: float | None  # least
    mean: float | None  # of all stations
    max: float | None  # largest
    band: float | None  # largest less least
    stations: int  # places at which it was measured

    @classmethod
    def of(cls, wall: _core.WallFigures) -> WallDeviation:
        """From the core, in mm."""
        values_mm = (wall.least_mm, wall.mean_mm, wall.largest_mm, wall.band_mm)
        least, mean, largest, band = (1e3 * value if wall.stations else None for value in values_mm)
        return cls(least, mean, largest, band, wall.stations)


@dataclass(frozen=True)
class Width:
    """Width from wall to wall, in mm; None without two walls."""

    nominal: float  # the tool's diameter
    min: float | None  # least
    mean: float | None  # of all stations
    max: float | None  # largest
    stations: int  # places at which it was measured

    @classmethod
    def of(cls, width: _core.WallFigures, tool_diameter_mm: float) -> Width:
        """From the core."""
        values = (width.least_mm, width.mean_mm, width.largest_mm)
        least, mean, largest = (value if width.stations else None for value in values)
        return cls(tool_diameter_mm, least, mean, largest, width.stations)


@dataclass(frozen=True)
class WallRoughness:
    """Roughness and waviness of a wall (ISO 4287, ISO 21920-2)."""

    ra_um: float  # arithmetic mean height of the roughness
    rz_um: float  # mean of highest less deepest over sampling lengths
    wa_um: float  # arithmetic mean height of the waviness
    cutoff_mm: float  # cut-off λc
    evaluated_mm: float  # length that the figures speak of

    @classmethod
    def of(cls, figures: _core.Roughness | None) -> WallRoughness | None:
        """From the core, in mm; None of a wall that is too short."""
        if figures is None:
            return None
        heights = (figures.ra_mm * 1e3, figures.rz_mm * 1e3, figures.wa_mm * 1e3)
        return cls(*heights, figures.cutoff_mm, figures.evaluated_mm)


@dataclass(frozen=True, eq=False)
class WallProfile:
    """The walls of a section."""

    distance_mm: FloatArray  # of the stations from the region's start, (n,)
    # deviation of the left wall from what the programmed path cuts, positive to the left, (n,); NaN where there is no
    # wall
    left_um: FloatArray
    right_um: FloatArray  # of the right wall, likewise
    point_mm: FloatArray  # of the programmed path there, seen from above, (n, 2)
    normal: FloatArray  # unit vectors to the left of the path, (n, 2); zero where it has no horizontal direction


@dataclass(frozen=True, eq=False)
class MeasuredSection:
    """One section of the path: a line, an arc, a curve of short moves, or the lines that one asked for."""

    region: int  # cutting region in which it is, from 1
    kind: str  # "line", "arc" or "curve"
    lines: tuple[int, int]  # first and last of the nominal program, from 1
    begin_mm: float  # distance from the region's start
    length_mm: float  # of the section
    time_s: float  # while the command moves in it
    peak_vibration_um: Xyz[float]  # largest |response - command| of each axis while the command moves
    residual_vibration_um: Xyz[float] | None  # the same once it rests; None: it does not stop here
    # from then until it stays within the band; null: not while it was looked at; None: no stop
    settling_time_s: Xyz[float | None] | None
    observed_rest_s: float | None  # how long the rest was looked at; None: no stop
    contour_error_um: Tracks[SidedError]  # distance of command and response from the path
    arc: MeasuredArc | None  # what only arcs have; None for others
    wall_deviation_um: Sides[WallDeviation]  # of both walls
    width_mm: Width  # from wall to wall
    roughness: Sides[WallRoughness | None]  # of both walls; None where a wall is too short
    walls: WallProfile | None = field(metadata=hidden())  # the profiles; None where so many stations are not kept

    @classmethod
    def of(
        cls, figures: _core.SectionFigures, region: int, tool_diameter_mm: float, walls: WallProfile | None
    ) -> MeasuredSection:
        """From the core's figures, and with what tool the walls were cut."""
        section, rest = figures.section, figures.rest
        settling = None
        if rest is not None:
            settling = Xyz(*(float(value) if math.isfinite(value) else None for value in rest.settling_s))
        of_command = SidedError.of([figures.command], [figures.command_sides])
        of_response = SidedError.of([figures.response], [figures.response_sides])
        return cls(
            region=region,
            kind=section.kind.name,
            lines=(section.first_line, section.last_line),
            begin_mm=section.begin_mm,
            length_mm=section.length_mm,
            time_s=figures.time_s,
            peak_vibration_um=largest_xyz_um([figures.peak_mm]),
            residual_vibration_um=None if rest is None else largest_xyz_um([rest.residual_mm]),
            settling_time_s=settling,
            observed_rest_s=None if rest is None else rest.observed_s,
            contour_error_um=Tracks(of_command, of_response),
            arc=MeasuredArc.of(figures, tool_diameter_mm) if section.kind == _core.SectionKind.arc else None,
            wall_deviation_um=Sides(WallDeviation.of(figures.left), WallDeviation.of(figures.right)),
            width_mm=Width.of(figures.width, tool_diameter_mm),
            roughness=Sides(WallRoughness.of(figures.left_roughness), WallRoughness.of(figures.right_roughness)),
            walls=walls,
        )

    def name(self, number: int) -> str:
        """Number, kind and lines in words."""
        kind = self.kind if self.arc is None else f"arc R{self.arc.nominal_radius_mm:g}"
        return f"{number} {kind}, {self.place}"

    @property
    def place(self) -> str:
        """Its lines in words."""
        first, last = self.lines
        return f"line {first}" if first == last else f"lines {first}-{last}"
