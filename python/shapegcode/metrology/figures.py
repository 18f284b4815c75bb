"""Figures of a section of a path: contour, circles, walls, width, roughness."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Generic, Self, TypeVar

from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.results.json import hidden
from shapegcode.results.outcome import ContourError, Tracks, Xyz, largest_xyz_um

T = TypeVar("T")


@dataclass(frozen=True)
class Sides(Generic[T]):
    """A figure for both sides of the travel."""

    left: T  # left side
    right: T  # right side

    def both(self) -> tuple[T, T]:
        """Left and right."""
        return self.left, self.right


@dataclass(frozen=True)
class SidedError:
    """Deviation of a track from the programmed path, µm: to the left or right; if mainly along Z, above or below."""

    max: float  # distance, any side
    rms: float  # root mean square over the time in which the command moves
    left: float  # largest to the left of the travel
    right: float  # largest to the right of it
    above: float  # largest above it
    below: float  # largest below it

    @classmethod
    def of(cls, stats: Sequence[_core.DeviationStats], sides: Sequence[_core.SideFigures]) -> Self:
        """Combine the core's figures (mm) of one or several sections or regions; all zero without any."""
        whole = ContourError.of(stats)
        names = ("left_mm", "right_mm", "above_mm", "below_mm")
        largest = (max((getattr(each, name) for each in sides), default=0.0) * 1e3 for name in names)
        return cls(whole.max, whole.rms, *largest)


@dataclass(frozen=True)
class FittedCircle:
    """A circle fitted to the track or the wall of an arc."""

    nominal_radius_mm: float  # as programmed; for a wall including the tool's radius
    fitted_radius_mm: float  # radius of the least-squares circle
    radius_deviation_um: float  # fitted minus nominal
    mean_radius_deviation_um: float  # mean distance from the programmed centre minus nominal
    centre_offset_um: tuple[float, float]  # fitted minus programmed centre, in the plane of the arc
    form_error_um: float  # largest minus smallest radial distance

    @classmethod
    def of(cls, arc: _core.ArcFigures | None, nominal_mm: float, centre_mm: FloatArray) -> Self | None:
        """Convert from the core; None: no circle."""
        if arc is None:
            return None
        x, y = (float(value) for value in (arc.fit.centre_mm - centre_mm) * 1e3)
        off, mean_off = (arc.fit.radius_mm - nominal_mm) * 1e3, (arc.mean_radius_mm - nominal_mm) * 1e3
        return cls(nominal_mm, arc.fit.radius_mm, off, mean_off, (x, y), arc.fit.form_mm * 1e3)


@dataclass(frozen=True)
class MeasuredArc:
    """Figures of an arc."""

    nominal_radius_mm: float  # as programmed
    command: FittedCircle | None  # circle through the set-points; None for arcs below 10 degrees
    response: FittedCircle | None  # through the table's positions, likewise
    inside_wall: FittedCircle | None  # through the wall towards the centre; None: no wall
    outside_wall: FittedCircle | None  # through the other wall, likewise
    orbit_error_percent: Tracks[float | None]  # area between track and arc over that of the sector; None: unknown

    @classmethod
    def of(cls, figures: _core.SectionFigures, tool_diameter_mm: float) -> Self:
        """Convert the core's figures of an arc, given the diameter of the tool that cuts its walls."""
        nominal, centre, radius = figures.nominal_radius_mm, figures.nominal_centre_mm, tool_diameter_mm / 2.0
        walls = (figures.left_wall_arc, figures.right_wall_arc)
        inside, outside = walls if figures.turns_left else walls[::-1]
        arcs = (figures.command_arc, 0.0), (figures.response_arc, 0.0), (inside, -radius), (outside, radius)
        command, response, inner, outer = (FittedCircle.of(arc, nominal + beside, centre) for arc, beside in arcs)
        orbit_error_percent = Tracks(figures.command_orbit_percent, figures.response_orbit_percent)
        return cls(nominal, command, response, inner, outer, orbit_error_percent)


@dataclass(frozen=True)
class WallDeviation:
    """Deviation of a wall from that of the programmed path, µm, positive to the left; None without a wall."""

    min: float | None  # minimum
    mean: float | None  # mean of all stations
    max: float | None  # maximum
    band: float | None  # maximum minus minimum
    stations: int  # number of measured stations

    @classmethod
    def of(cls, wall: _core.WallFigures) -> Self:
        """Convert from the core's figures in mm."""
        values_mm = (wall.least_mm, wall.mean_mm, wall.largest_mm, wall.band_mm)
        least, mean, largest, band = (1e3 * value if wall.stations else None for value in values_mm)
        return cls(least, mean, largest, band, wall.stations)


@dataclass(frozen=True)
class Width:
    """Width from wall to wall, in mm; None without two walls."""

    nominal: float  # the tool's diameter
    min: float | None  # minimum
    mean: float | None  # mean of all stations
    max: float | None  # maximum
    stations: int  # number of measured stations

    @classmethod
    def of(cls, width: _core.WallFigures, tool_diameter_mm: float) -> Self:
        """Convert from the core."""
        values = (width.least_mm, width.mean_mm, width.largest_mm)
        least, mean, largest = (value if width.stations else None for value in values)
        return cls(tool_diameter_mm, least, mean, largest, width.stations)


@dataclass(frozen=True)
class WallRoughness:
    """Roughness and waviness of a wall (ISO 4287, ISO 21920-2)."""

    ra_um: float  # arithmetic mean height of the roughness
    rz_um: float  # mean of highest minus deepest over sampling lengths
    wa_um: float  # arithmetic mean height of the waviness
    cutoff_mm: float  # cut-off λc
    evaluated_mm: float  # evaluation length

    @classmethod
    def of(cls, figures: _core.Roughness | None) -> Self | None:
        """Convert from the core's figures in mm; None: the wall is too short."""
        if figures is None:
            return None
        heights = (figures.ra_mm * 1e3, figures.rz_mm * 1e3, figures.wa_mm * 1e3)
        return cls(*heights, figures.cutoff_mm, figures.evaluated_mm)


@dataclass(frozen=True, eq=False)
class WallProfile:
    """Wall profiles of a section."""

    distance_mm: FloatArray  # distance of the stations from the region's start, (n,)
    # deviation of the left wall from that of the programmed path, positive to the left, (n,); NaN: no wall
    left_um: FloatArray
    right_um: FloatArray  # deviation of the right wall, likewise
    point_mm: FloatArray  # points of the programmed path there, in XY, (n, 2)
    normal: FloatArray  # unit vectors to the left of the path, (n, 2); zero without a horizontal direction


@dataclass(frozen=True, eq=False)
class MeasuredSection:
    """One section of the path: a line, an arc, a curve of short moves, or the requested lines."""

    region: int  # its cutting region, from 1
    kind: str  # "line", "arc" or "curve"
    lines: tuple[int, int]  # first and last of the nominal program, from 1
    begin_mm: float  # distance from the region's start
    length_mm: float  # of the section
    time_s: float  # motion time of the command in it
    peak_vibration_um: Xyz[float]  # largest |response - command| of each axis while the command moves
    residual_vibration_um: Xyz[float] | None  # the same after its worst stop, or the region's end; None: no stop
    # time from that stop until the axis stays within the band; None for an axis: not observed; None: no stop
    settling_time_s: Xyz[float | None] | None
    observed_rest_s: float | None  # observed time after the stop; None: no stop
    contour_error_um: Tracks[SidedError]  # distance of command and response from the path
    arc: MeasuredArc | None  # figures of an arc; None for others
    wall_deviation_um: Sides[WallDeviation]  # of both walls
    width_mm: Width  # from wall to wall
    roughness: Sides[WallRoughness | None]  # of both walls; None: the wall is too short
    walls: WallProfile | None = field(metadata=hidden())  # wall profiles; None: too many stations to keep

    @classmethod
    def of(cls, figures: _core.SectionFigures, region: int, tool_diameter_mm: float, walls: WallProfile | None) -> Self:
        """Convert from the core's figures, given the tool that cut the walls."""
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
        """Number, kind and lines as text."""
        kind = self.kind if self.arc is None else f"arc R{self.arc.nominal_radius_mm:g}"
        return f"{number} {kind}, {self.place}"

    @property
    def place(self) -> str:
        """Program lines of the section, as text."""
        first, last = self.lines
        return f"line {first}" if first == last else f"lines {first}-{last}"
