"""One section of a path, measured, with the profiles of its walls."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.metrology.figures import MeasuredArc, SidedError, Sides, WallDeviation, WallRoughness, Width
from shapegcode.results.figures import Tracks, largest_xyz_um
from shapegcode.results.json import hidden
from shapegcode.results.result import Xyz

__all__ = ["MeasuredSection", "WallProfile"]

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
class MeasuredSection:
    """One section of the path: a line, an arc, a curve of short moves, or the lines that one asked for.

    Attributes:
        region: cutting region in which it is, from 1.
        kind: "line", "arc" or "curve".
        lines: first and last of the nominal program, from 1.
        begin_mm: distance from the region's start.
        length_mm: of the section.
        time_s: while the command moves in it.
        peak_vibration_um: largest |response - command| of each axis while the command moves.
        residual_vibration_um: the same once it rests; None: it does not stop here.
        settling_time_s: from then until it stays within the band; null: not while it was looked at; None: no stop.
        observed_rest_s: how long the rest was looked at; None: no stop.
        contour_error_um: distance of command and response from the path.
        arc: what only arcs have; None for others.
        wall_deviation_um: of both walls.
        width_mm: from wall to wall.
        roughness: of both walls; None where a wall is too short.
        walls: the profiles; None where so many stations are not kept.
    """

    region: int
    kind: str
    lines: tuple[int, int]
    begin_mm: float
    length_mm: float
    time_s: float
    peak_vibration_um: Xyz[float]
    residual_vibration_um: Xyz[float] | None
    settling_time_s: Xyz[float | None] | None
    observed_rest_s: float | None
    contour_error_um: Tracks[SidedError]
    arc: MeasuredArc | None
    wall_deviation_um: Sides[WallDeviation]
    width_mm: Width
    roughness: Sides[WallRoughness | None]
    walls: WallProfile | None = field(metadata=hidden())

    @classmethod
    def of(
        cls, figures: _core.SectionFigures, region: int, tool_diameter_mm: float, walls: WallProfile | None
    ) -> MeasuredSection:
        """From the core's figures, and with what tool the walls were cut."""
        section, rest = figures.section, figures.rest
        return cls(
            region=region,
            kind=section.kind.name,
            lines=(section.first_line, section.last_line),
            begin_mm=section.begin_mm,
            length_mm=section.length_mm,
            time_s=figures.time_s,
            peak_vibration_um=largest_xyz_um([figures.peak_mm]),
            residual_vibration_um=None if rest is None else largest_xyz_um([rest.residual_mm]),
            settling_time_s=None
            if rest is None
            else Xyz(*(float(value) if math.isfinite(value) else None for value in rest.settling_s)),
            observed_rest_s=None if rest is None else rest.observed_s,
            contour_error_um=Tracks(
                SidedError.of([figures.command], [figures.command_sides]),
                SidedError.of([figures.response], [figures.response_sides]),
            ),
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
