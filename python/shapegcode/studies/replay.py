"""Simulate an emitted program on other machines: converted once, simulated any number of times, on all processors."""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from shapegcode import _core
from shapegcode.conversion.convert import convert
from shapegcode.errors import ArgumentError
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.program import Program
from shapegcode.program.compensation import program_for_conversion
from shapegcode.program.computer import cores
from shapegcode.studies.varied import sampled_machine
from shapegcode.verdict.figures import RegionLimits, case_figures, judge_region
from shapegcode.verdict.judge import Judge, RegionFigures

SHARE = "share_of_limit"
MEASURES: Mapping[str, str] = {
    "residual_um": "residual vibration, worst axis",
    "residual_x_um": "residual vibration X",
    "residual_y_um": "residual vibration Y",
    "residual_z_um": "residual vibration Z",
    "peak_um": "vibration in motion, worst axis",
    "contour_um": "contour error that the tolerance limits",
    "command_um": "contour error of the command",
    "response_um": "contour error of the machine table",
    "cutting_time_s": "time of the shaped cuts",
    "time_s": "cycle time",
    "original_residual_um": "residual vibration of the original",
    "original_contour_um": "contour error of the machine table with the original",
    SHARE: "largest ratio to a limit",
}
"""Measures of each sample, with their meaning."""
DEFAULT_MEASURES = ("residual_um", "contour_um", "time_s")

CONTOURS = frozenset({"contour_um", "command_um", "response_um"})
"""If none of these is measured, the ratio to the limit is that of the residual vibration alone."""
_WHOLE_RUN = frozenset({*CONTOURS, "peak_um", "cutting_time_s"})


def checked_measures(measure: Sequence[str]) -> tuple[str, ...]:
    """Validate the measures; the ratio to the limit is always added."""
    for name in measure:
        if name not in MEASURES:
            raise ArgumentError(f"measure = {name!r}: must be one of {', '.join(MEASURES)}")
    return tuple(dict.fromkeys((*measure, SHARE)))


@dataclass(frozen=True)
class _SimulatedPart:
    """A shaped region: programmed path, emitted blocks, limits."""

    region: _core.Region
    blocks: _core.Path
    tracker: _core.ContourTracker
    limits: RegionLimits


class Replay:
    """A program that was converted for a machine, ready to be simulated on others."""

    def __init__(
        self, machine: Machine, original: Program, emitted: Program, parts: Sequence[tuple[int, int, int]],
        limits: Sequence[RegionLimits], time_s: float,
    ) -> None:  # fmt: skip
        """Prepare the regions.

        `parts`: for each region its index in the original, and its first and last emitted line. `time_s`: cycle time
        of the emitted program on the machine for which it was converted.
        """
        self.machine, self._original, self._emitted, self._extents = machine, original, emitted, tuple(parts)
        self.limits, self.time_s = tuple(limits), time_s
        regions = [original.regions[index] for index, _, _ in parts]
        self._parts = [
            _SimulatedPart(region, emitted.core.cutting_path(first, last), _core.ContourTracker(region.path), limit)
            for region, (_, first, last), limit in zip(regions, parts, limits, strict=True)
        ]
        # Part of the cycle time that the model does not compute.
        self._beyond_s = time_s - MachineModel(machine).cycle_time_s(emitted.core)

    @classmethod
    def of(
        cls, program: Program | str, machine: Machine, judged_by: Machine | None = None, *, shape_all: bool = False,
        is_whole: bool = False,
    ) -> Replay:  # fmt: skip
        """Convert a program."""
        original = program_for_conversion(program, machine)
        found = convert(original, machine, shape_all=shape_all, tolerance_curve=False)
        if is_whole and (missed := next(found.misses(), "")):
            raise ArgumentError(missed)
        if not found.placed:
            nothing = f"nothing was shaped that could be simulated: {found.answer}"
            raise ArgumentError(f"{found.program} on {machine.name}: {nothing}")
        judging = MachineModel(judged_by or machine)
        judge, ranks = Judge(judging), {id(region): index for index, region in enumerate(original.regions)}
        limits, extents = [], []
        for place in found.placed:
            simulated = judging.simulate_original(place.region.path, offset=judging.offset(place.region))
            limits.append(judge.limits(RegionFigures(simulated, (), (), 0), place))
            extents.append((ranks[id(place.region)], place.first_line, place.last_line))
        return cls(machine, original, found.emitted, extents, limits, found.cycle_time_s.emitted)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as bytes and numbers, for another process."""
        numbers = tuple((tuple(each.residual_um.tolist()), each.contour_um, each.target) for each in self.limits)
        texts = self._original.source, self._original.expanded_text, self._emitted.text
        return _replay, (self.machine.to_toml(short=True), *texts, self._extents, numbers, self.time_s)

    def simulate(
        self, machine: Machine, wanted: Collection[str], *, override: float = 1.0, times: bool = True
    ) -> dict[str, float]:
        """Simulate the program on a machine; return the measures by name."""
        model = MachineModel(machine)
        found = dict.fromkeys(wanted, 0.0)
        for part in self._parts:
            for name, value in self._of_region(part, model, wanted, override).items():
                found[name] = found[name] + value if name == "cutting_time_s" else max(found[name], value)
        if "time_s" in found:
            found["time_s"] = self.time_s
            if times or override != 1.0:
                controller = model.ordinary.model
                controller.feed_override = override
                found["time_s"] = float(_core.time_program(self._emitted.core, controller).total_s) + self._beyond_s
        return found

    def _of_region(
        self, part: _SimulatedPart, model: MachineModel, wanted: Collection[str], override: float
    ) -> dict[str, float]:
        path, offset = part.region.path, model.offset(part.region)
        contour = not CONTOURS.isdisjoint(wanted)
        command = contour and (part.limits.target == "command" or "command_um" in wanted)
        # Vibration at the end was excited shortly before.
        last_s = model.vibration_memory_s if _WHOLE_RUN.isdisjoint(wanted) else 0.0
        run = model.simulate_emitted(
            part.blocks, path, override=override, offset=offset, tracker=part.tracker, contour=contour,
            command_contour=command, last_seconds=last_s,
        )  # fmt: skip
        outcomes = judge_region(case_figures(run, contour=contour), part.limits)
        axes = (run.residual_mm * 1e3).tolist()
        measured = {
            "residual_um": max(axes),
            **dict(zip(("residual_x_um", "residual_y_um", "residual_z_um"), axes, strict=True)),
            "peak_um": float(run.peak_mm.max()) * 1e3,
            "contour_um": outcomes[-1].value_um if contour else 0.0,
            "command_um": run.command.max_abs_mm * 1e3 if command else 0.0,
            "response_um": run.response.max_abs_mm * 1e3 if contour else 0.0,
            "cutting_time_s": run.duration_s,
            SHARE: max(each.share for each in outcomes),
        }
        if "original_residual_um" in wanted or "original_contour_um" in wanted:
            was = model.simulate_original(path, offset=offset)
            measured["original_residual_um"] = float(was.residual_mm.max()) * 1e3
            measured["original_contour_um"] = was.response.max_abs_mm * 1e3
        return {name: value for name, value in measured.items() if name in wanted}


OVERRIDE = "times.feed_override_percent"  # if varied, the blocks are simulated at this override

_AT_ONCE = 64  # maximum number of samples per task
_SIMULATED_S = 900.0  # of motion in a task: short enough for progress and stopping


@dataclass(frozen=True)
class SamplesJob:
    """Some samples of one program."""

    name: str  # name of the machine, in messages
    rows: tuple[Mapping[str, object], ...]  # values of the simulated machine, by key, one row per sample
    draws: tuple[int, ...]  # numbers of the samples
    wanted: tuple[str, ...]  # measures
    times: bool  # whether `time_s` is computed for each machine; False: only if the override differs from 100 %

    def simulate(self, replay: Replay) -> list[list[float]]:
        """Simulate the samples; one list of measures per sample."""
        found = []
        for row, draw in zip(self.rows, self.draws, strict=True):
            machine = sampled_machine(replay.machine, row, f"{self.name}, sample {draw}")
            override = machine.times.feed_override_percent / 100.0 if OVERRIDE in row else 1.0
            measured = replay.simulate(machine, self.wanted, override=override, times=self.times)
            found.append([measured[name] for name in self.wanted])
        return found

    def parts(self, motion_s: float) -> Iterator[SamplesJob]:
        """Split the job into tasks."""
        size = max(1, min(_AT_ONCE, int(_SIMULATED_S / max(motion_s, 1e-3))))
        for at in range(0, len(self.rows), size):
            rows, draws = self.rows[at : at + size], self.draws[at : at + size]
            yield SamplesJob(self.name, rows, draws, self.wanted, self.times)


def simulate_all(
    replay: Replay, job: SamplesJob, pool: Executor | None, on_done: Callable[[int], None] = lambda _count: None
) -> list[list[float]]:
    """Simulate the samples of one emitted program; *on_done* gets the number of finished ones."""
    found: list[list[float]] = []
    threads = ThreadPoolExecutor(cores())
    running = [(pool or threads).submit(part.simulate, replay) for part in job.parts(replay.time_s)]
    try:
        for future in running:
            found += future.result()
            on_done(len(found))
    finally:
        for future in running:
            future.cancel()
        threads.shutdown()
    return found


@functools.lru_cache(maxsize=4)
def _replay(
    toml: str, source: str, original: bytes, emitted: bytes, extents: tuple[tuple[int, int, int], ...],
    limits: tuple[tuple[tuple[float, ...], float, Any], ...], time_s: float,
) -> Replay:  # fmt: skip
    """Unpickle a replay: a worker reads an emitted program once for all its samples."""
    machine = Machine.from_toml(toml)
    read = Program.from_text(original, machine, source=source)
    shaped = Program.from_text(emitted, machine, source=source, emitted=True)
    region_limits = [RegionLimits(np.array(residual), contour, target) for residual, contour, target in limits]
    return Replay(machine, read, shaped, extents, region_limits, time_s)
