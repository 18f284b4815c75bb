"""Result of a simulation: each cutting region from rest to rest, and the motion of the whole program."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.model.programs import SimulatedPrograms
from shapegcode.results.json import hidden, sparse
from shapegcode.results.outcome import CONTOURS, ContourError, Plot, Tracks, Xyz
from shapegcode.results.page.model import Figure
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table, xyz_columns
from shapegcode.verdict.figures import ProgramFigures, case_table

# With a feed drive the difference of command and table is vibration and servo lag.
_MIN_SHOWN_UM = 0.005
_NAMES = {"modal": ("residual vibration", "peak vibration"), "feed-drive": ("error after the stop", "largest error")}


@dataclass(frozen=True, eq=False)
class RegionRun:
    """One cutting region simulated."""

    lines: tuple[int, int]  # first and last line of the expanded program, from 1
    shaped: bool  # simulated as shaped blocks
    was_rapid: bool  # shaped blocks in place of a rapid
    time_s: float  # until the set-points rest
    residual_vibration_um: Xyz[float]  # largest |response - command| of each axis after the set-points rest
    # time from then until |response - command| stays within the band; None: not within the limit, or no band
    settling_time_s: Xyz[float | None]
    period_s: float = field(metadata=hidden())  # time between two samples
    path: _core.Path = field(metadata=hidden())  # path against which it is measured
    # measured by the core, with the recorded samples
    figures: _core.SimulationFigures = field(metadata=hidden())
    # simulates it again with the given number of recorded samples
    replay: Callable[[int], _core.SimulationFigures] = field(metadata=hidden())

    @property
    def command_mm(self) -> FloatArray:
        """Set-points after all filters, (n, 3), also those at rest while the vibration decays after the stop."""
        return self.figures.recorded_command

    @property
    def response_mm(self) -> FloatArray:
        """Table positions at the same instants, (n, 3)."""
        return self.figures.recorded_response


@dataclass(frozen=True)
class ShapedFigures:
    """Figures of the shaped regions, without shaped rapids: each the larger of both block timings, as in `convert`."""

    regions: int  # number of regions
    cutting_time_s: float  # until the set-points rest
    residual_vibration_um: Xyz[float]  # largest |response - command| of each axis after the set-points rest
    peak_vibration_um: Xyz[float]  # the same while the set-points move
    contour_error_um: Tracks[ContourError]  # against the path named in the simulation


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of a whole program, or some of its lines: largest values, and curves as envelopes.

    Attributes:
        lines: first and last line shown, of the expanded program; None: all.
        every: the files have every *every*-th sample.
        samples: number of samples.
        end_s: time of the last sample.
        largest_speed_mm_per_min: of the command.
        largest_acceleration_mm_per_s2: of the command, from second differences of its positions.
        largest_error_um: largest |response - command|.
        largest_motor_force_n: largest motor force, with feed drives.
        largest_friction_force_n: largest friction force, with feed drives.
        csv: CSV file written.
        npz: NumPy file written.
        program: name of the program.
        times_s: middle of each of n intervals.
        low: minimum in each interval, (n, curves, 3): command and response (mm), speed of the command (mm/s), its
            acceleration (mm/s²), response minus command (mm), with feed drives force of the motor and friction (N).
        high: maximum in each interval, in the same form.
    """

    lines: tuple[int, int] | None
    every: int
    samples: int
    end_s: float
    largest_speed_mm_per_min: Xyz[float]
    largest_acceleration_mm_per_s2: Xyz[float]
    largest_error_um: Xyz[float]
    program: str = field(metadata=hidden())
    times_s: FloatArray = field(metadata=hidden())
    low: FloatArray = field(metadata=hidden())
    high: FloatArray = field(metadata=hidden())
    largest_motor_force_n: Xyz[float] | None = field(default=None, metadata=sparse())
    largest_friction_force_n: Xyz[float] | None = field(default=None, metadata=sparse())
    csv: str | None = field(default=None, metadata=sparse())
    npz: str | None = field(default=None, metadata=sparse())

    def table(self) -> Table:
        """Table of the largest values by axis."""
        forces = (("force of the motor N", self.largest_motor_force_n), ("friction N", self.largest_friction_force_n))
        rows: list[tuple[str, Xyz[float], float, int]] = [
            ("speed of the command m/min", self.largest_speed_mm_per_min, 1e-3, 2),
            ("acceleration of the command m/s²", self.largest_acceleration_mm_per_s2, 1e-3, 2),
            ("response − command µm", self.largest_error_um, 1.0, 2),
            *((name, force, 1.0, 0) for name, force in forces if force is not None),
        ]
        columns = (
            Column("largest", value=lambda row: row[0], text=True),
            *xyz_columns(lambda axis, row: f"{row[1][axis] * row[2]:z.{row[3]}f}"),
        )
        part = "whole program" if self.lines is None else f"lines {self.lines[0]} to {self.lines[1]}"
        return Table(f"{part}, {self.samples} samples up to {self.end_s:.2f} s", columns, rows)


@dataclass(frozen=True, repr=False, eq=False)
class Simulation(Result):
    """A program simulated unchanged on a model of the machine; figures are the largest of its cutting regions.

    Attributes:
        program: name of the program.
        machine: name of the machine.
        plant: "modal" or "feed-drive".
        shaped: some regions were simulated block by block at their feed, as in an emitted program.
        measured_against: the program whose path the contour error is measured against; its own name for its own path.
        cycle_time_s: whole program: regions, rapids, in-position waits, dwells, drilling cycles, tool changes, M codes.
        cutting_time_s: regions only, until the set-points rest.
        residual_vibration_um: largest |response - command| of each axis once the set-points rest.
        peak_vibration_um: the same while the set-points move.
        settling_time_s: time after the set-points rest until |response - command| stays in the band; None: longer than
            the limit, or no band.
        settling_band_um: band from the machine file (`tolerance.residual_floor_um`); 0: none.
        settling_limit_s: how long the motion after a stop is observed.
        contour_error_um: against the path of `measured_against`.
        orbit_error_percent: of the command on each arc.
        response_orbit_error_percent: of the machine table on each arc.
        regions: the cutting regions in order.
        of_shaped: the shaped regions only; None: no shaped regions.
        verdict: with `against`: verdict on the whole program, compared with its original in the operating conditions
            that count, as `convert` judges its output; None: without.
        motion: motion of the whole program; None: not requested.
        warnings: on the program and the machine.
        simulated: the program, for a page.
    """

    program: str
    machine: str
    plant: str
    shaped: bool
    measured_against: str
    cycle_time_s: float
    cutting_time_s: float
    residual_vibration_um: Xyz[float]
    peak_vibration_um: Xyz[float]
    settling_time_s: Xyz[float | None]
    settling_band_um: float
    settling_limit_s: float
    contour_error_um: Tracks[ContourError]
    orbit_error_percent: tuple[float, ...]
    response_orbit_error_percent: tuple[float, ...]
    regions: tuple[RegionRun, ...]
    warnings: tuple[str, ...]
    of_shaped: ShapedFigures | None = None
    verdict: ProgramFigures | None = field(default=None, metadata=sparse())
    motion: Motion | None = field(default=None, metadata=sparse())
    simulated: SimulatedPrograms | None = field(default=None, compare=False, repr=False, metadata=hidden())

    @property
    def methods(self) -> tuple[str, ...]:
        """Published methods of the models of controller and plant."""
        return () if self.simulated is None else self.simulated.methods

    @property
    def ok(self) -> bool:
        """Whether every cut keeps its limits; without `against` always true."""
        return self.verdict is None or self.verdict.within_tolerance

    @property
    def answer(self) -> str:
        """Cycle time, residual vibration and contour error."""
        takes = f"{Path(self.program).name} takes {self.cycle_time_s:.2f} s on {self.machine}"
        if not self.regions:
            return f"{takes}; no cut ({self.plant} plant)"
        if self.verdict is not None:
            return f"{takes}; {self._judged_answer(self.verdict)}"
        axis = max("xyz", key=lambda each: self.residual_vibration_um[each])
        contour_um = self.contour_error_um.response.max
        return (
            f"{takes}, {self.cutting_time_s:.2f} s of it in cuts; {_NAMES[self.plant][0]} "
            f"{axis.upper()} {self.residual_vibration_um[axis]:.2f} µm, contour error {contour_um:.2f} µm "
            f"{'against its own blocks ' if self.shaped and self._own_path else ''}({self.plant} plant)"
        )

    @staticmethod
    def _judged_answer(verdict: ProgramFigures) -> str:
        out = [cut for cut in verdict.all_cuts if cut.misses]
        residual = verdict.residual_vibration_um
        axis = max("xyz", key=lambda each: residual.original[each])
        contour = verdict.contour_error_um.response
        missed = "lines {} to {}: {}".format(*out[0].lines, out[0].misses[0]) if out else ""
        return (
            f"{'out of tolerance' if out else 'within tolerance'}: residual vibration {axis.upper()} "
            f"{residual.original[axis]:.1f} → {residual.emitted[axis]:.1f} µm, contour {contour.original.max:.1f} → "
            f"{contour.emitted.max:.1f} µm{'; ' + missed if out else ''}"
        )

    @property
    def _own_path(self) -> bool:
        return self.measured_against == self.program

    @property
    def next_step(self) -> str:
        """Next command, in one sentence."""
        if self.shaped and self._own_path:
            return "simulate it with --against ORIGINAL: only then the contour error is that of the part"
        if self.shaped:
            return "shapegcode measure ORIGINAL SHAPED shows where on the part the errors are"
        return "shapegcode convert shapes this program and shows the gain"

    def key_figures(self) -> tuple[Figure, ...]:
        """Time, vibration after a stop and contour error of the machine table."""
        (residual, _), contour_um = _NAMES[self.plant], self.contour_error_um.response.max
        vibrations = [
            Figure(f"{residual} {axis.upper()}", "µm", None, self.residual_vibration_um[axis], 2,
                   key_after=f"residual_vibration_um.{axis}")
            for axis in "xyz" if self.residual_vibration_um[axis] >= _MIN_SHOWN_UM
        ]  # fmt: skip
        return (
            Figure("cycle time", "s", None, self.cycle_time_s, 2, key_after="cycle_time_s"),
            *vibrations,
            Figure(CONTOURS["response"], "µm", None, contour_um, 2, key_after="contour_error_um.response.max"),
        )

    def tables(self) -> list[Table]:
        """Tables of vibration and settling by axis; contour and orbit errors; operating conditions; the motion."""
        regions = [self._vibration_table(), self._contour_table()] if self.regions else []
        if self.verdict is not None and self.verdict.cases:
            regions.append(case_table(self.verdict.cases, self.verdict.worst_case))
        return [*regions, *([self.motion.table()] if self.motion is not None else [])]

    def _vibration_table(self) -> Table:
        rows: list[tuple[str, Xyz[str]]] = []
        for figures, of in self._parts():
            for name, largest in zip(
                _NAMES[self.plant], (figures.residual_vibration_um, figures.peak_vibration_um), strict=True
            ):
                rows.append((f"{name} µm{of}", Xyz(*(f"{value:.2f}" for value in largest))))
        if self.settling_band_um > 0.0:
            over = f"over {self.settling_limit_s * 1e3:.0f}"
            times = (over if time_s is None else f"{time_s * 1e3:.0f}" for time_s in self.settling_time_s)
            rows.append((f"settling to ±{self.settling_band_um:g} µm, ms", Xyz(*times)))
        columns = (
            Column("largest of the cuts, each from rest to rest", value=lambda row: row[0], text=True),
            *xyz_columns(lambda axis, row: row[1][axis]),
        )
        return Table("", columns, rows)

    def _parts(self) -> Iterator[tuple[Simulation | ShapedFigures, str]]:
        yield self, ""
        if self.of_shaped is not None and self.of_shaped.regions < len(self.regions):
            yield self.of_shaped, f", {self.of_shaped.regions} shaped cuts alone"

    @property
    def _path_name(self) -> str:
        if not self._own_path:
            return f"the path of {Path(self.measured_against).name}"
        return "the program's own blocks, not the part's contour" if self.shaped else "the program's path"

    def _contour_table(self) -> Table:
        rows: list[tuple[str, str, str]] = []
        for figures, of in self._parts():
            for track, name in CONTOURS.items():
                error = getattr(figures.contour_error_um, track)
                rows.append((f"{name} µm{of}", f"{error.max:.2f}", f"{error.rms:.2f}"))
        orbits = {"command": self.orbit_error_percent, "machine table": self.response_orbit_error_percent}
        rows += [(f"orbit error of the {name} %", f"{max(of):.4f}", "") for name, of in orbits.items() if of]
        columns = (
            Column(f"cuts, against {self._path_name}", value=lambda row: row[0], text=True),
            Column("largest", value=lambda row: row[1]),
            Column("RMS", value=lambda row: row[2]),
        )
        return Table("", columns, rows)

    def plots(self) -> Mapping[str, Plot]:
        """`motion`, if requested; `path`, `feed`, `vibration` of the region with most vibration."""
        return self._drawn_beside()
