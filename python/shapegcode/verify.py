"""The round trip: the emitted text is read back, played as the controller would, and measured.

Nothing here looks at what the converter meant to write; the figures are those of the text.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.controller import controller_model
from shapegcode.emit import motion_limits
from shapegcode.machine import Machine
from shapegcode.program import Program, least_increment_mm
from shapegcode.worst_case import (
    ALL_MODES,
    Case,
    CaseFigures,
    Deviation,
    Limits,
    Target,
    region_misses,
    stated_cases,
    summarise_cases,
    worst_counted,
)

OVERRIDES = (0.8, 0.9, 1.1, 1.2)  # of the report's override_residual; the cases have more
_BLOCK_ENDS = (_core.BlockEnd.ceil, _core.BlockEnd.carry)
_LARGEST_SWEEP_RAD = math.pi / 2
_STATE_FIELDS = (
    "motion", "plane", "distance", "feed_mode", "units", "compensation", "length_offset",
    "cycle", "cycle_return", "coordinate_system", "exact_stop", "feed",
)  # fmt: skip

Vector = npt.NDArray[np.float64]
Step = Callable[[int, int], None]


class RoundTripError(_core.ShapegcodeError):
    """The emitted text does not say what it should: a defect of shapegcode, never of the input. Nothing is written."""


@dataclass(frozen=True)
class Placed:
    """A region and where its shaped blocks stand in the emitted text.

    Attributes:
        region: of the original program.
        first_line: first emitted line, from 1.
        last_line: last emitted line.
    """

    region: _core.Region
    first_line: int
    last_line: int


@dataclass(frozen=True)
class RegionFigures:
    """One region played: as programmed, and as emitted in every case of the verdict.

    Attributes:
        original: the programmed path under the controller's own motion.
        emitted: the emitted blocks under both rules of block end (ceil, carry).
        cases: one entry per `stated_cases`.
        slowed_blocks: emitted blocks that the controller's look-ahead limits would slow.
    """

    original: _core.PlaybackFigures
    emitted: tuple[_core.PlaybackFigures, ...]
    cases: tuple[CaseFigures, ...]
    slowed_blocks: int


def axis_modes(machine: Machine, shift: float = 0.0, only: str = ALL_MODES) -> list[list[_core.Mode]]:
    """Modes of X, Y, Z for the core, shifted by `shift` times their stated uncertainty: all, or `only` one ("x.1")."""
    return [
        [
            _core.Mode(
                mode.frequency_hz
                * (
                    1.0 + shift * (mode.frequency_uncertainty_percent or 0.0) / 100.0
                    if only in (ALL_MODES, f"{letter}.{number}")
                    else 1.0
                ),
                mode.damping_ratio,
                mode.participation,
            )
            for number, mode in enumerate(axis.modes, start=1)
        ]
        for letter, axis in zip("xyz", machine.axes.as_tuple(), strict=True)
    ]


def playback_options(
    machine: Machine, *, time_constant_s: float = 0.0, shift: float = 0.0, only: str = ALL_MODES
) -> _core.PlaybackOptions:
    """Plant and interpolation period of a machine, with an acceleration filter after interpolation.

    Args:
        machine: whose.
        time_constant_s: length of the filter, a moving average.
        shift: of the modes, in their stated uncertainties.
        only: the mode that is shifted, "all" or one as in the machine file ("x.1").
    """
    options = _core.PlaybackOptions()
    period = machine.controller.interpolation_period_s
    options.period_s = period
    options.modes = axis_modes(machine, shift, only)
    options.axis_filters = [
        _core.Fir.moving_average(round(length / period)) for length in (time_constant_s,) if round(length / period) > 1
    ]
    return options


def _own_rule(machine: Machine) -> _core.BlockEnd:
    rule: _core.BlockEnd = getattr(_core.BlockEnd, machine.controller.block_end)
    return rule


def play_original(path: _core.Path, machine: Machine, *, record_samples: int = 0) -> _core.PlaybackFigures:
    """A programmed path as the controller plays an ordinary program."""
    model = controller_model(machine)
    options = playback_options(machine)
    options.axis_filters = _core.acceleration_filters(model)
    options.record_samples = record_samples
    if model.motion == _core.MotionKind.look_ahead:
        return _core.play_path(path, _core.plan_speed(path, model.limits), options)
    return _core.play_blocks(path, path, model.block_end, 1.0, options)


def play_emitted(
    blocks: _core.Path,
    path: _core.Path,
    machine: Machine,
    block_end: _core.BlockEnd | None = None,
    *,
    override: float = 1.0,
    contour: bool = True,
    last_seconds: float = 0.0,
    shift: float = 0.0,
    only: str = ALL_MODES,
    record_samples: int = 0,
    starved_blocks: Sequence[int] = (),
    memory_s: float = 0.0,
) -> _core.PlaybackFigures:
    """Emitted blocks as the controller plays them, measured against the programmed path.

    Args:
        blocks: what was emitted.
        path: what was programmed.
        machine: controller and modes.
        block_end: rule of block timing; None: the controller's own.
        override: feed override, 1 = 100 %.
        contour: measure the deviations too.
        last_seconds: play no more than the end; 0: all.
        shift: of the modes, in their stated uncertainties.
        only: the mode that is shifted; "all".
        record_samples: samples kept for pictures.
        starved_blocks: behind each of these, tried one by one, the buffer is empty for `verdict.starved_s`.
        memory_s: how long after that its vibration is looked at; 0: to the end.
    """
    controller = machine.controller
    options = playback_options(machine, time_constant_s=controller.shaped_time_constant_s, shift=shift, only=only)
    options.measure_contour = contour
    options.last_seconds = last_seconds
    options.record_samples = record_samples
    if starved_blocks:
        options.starved_blocks = list(starved_blocks)
        options.starved_s = machine.verdict.starved_s
        options.starved_memory_s = memory_s + controller.shaped_time_constant_s if memory_s > 0.0 else 0.0
    return _core.play_blocks(blocks, path, block_end or _own_rule(machine), override, options)


def play_planned(blocks: _core.Path, path: _core.Path, machine: Machine) -> _core.PlaybackFigures:
    """Emitted blocks as the controller's look-ahead plans them anew if it is left on, against the programmed path."""
    options = playback_options(machine, time_constant_s=machine.controller.look_ahead_filter_time_constant_s)
    return _core.play_path(blocks, _core.plan_speed(blocks, motion_limits(machine)), options, path)


def read_back(text: bytes, placed: Sequence[Placed], machine: Machine) -> Program:
    """Read the emitted text and hold it against the original: end points, modal state at every border, sweeps.

    Raises:
        RoundTripError: something differs; the message names the line and both values.
    """
    probes = [line for place in placed for line in (place.first_line - 1, place.last_line)]
    emitted = Program.from_text(text, machine, source="emitted program", emitted=True, probe_lines=probes)
    states = emitted.core.probed
    for index, place in enumerate(placed):
        region = place.region
        _compare_states(states[2 * index], region.entry, place.first_line - 1, region.incremental, machine)
        _compare_states(states[2 * index + 1], region.exit, place.last_line, region.incremental, machine)
        blocks = emitted.core.cutting_path(place.first_line, place.last_line)
        _compare_ends(blocks, place, machine)
        if blocks.largest_sweep_rad >= _LARGEST_SWEEP_RAD:
            raise RoundTripError(
                f"emitted arc between lines {place.first_line} and {place.last_line} sweeps "
                f"{math.degrees(blocks.largest_sweep_rad):.1f} degrees (limit 90)"
            )
    return emitted


def measure(
    emitted: Program,
    placed: Sequence[Placed],
    originals: Sequence[Future[_core.PlaybackFigures]],
    machine: Machine,
    pool: Executor,
    on_step: Step = lambda _done, _total: None,
    target: Target = "command",
) -> list[RegionFigures]:
    """Play every emitted region beside its original.

    Args:
        emitted: the program read back.
        placed: the regions and their places in it.
        originals: the originals' playbacks under way, one per region (`play_original`).
        machine: controller model and plant.
        pool: runs the playbacks.
        on_step: called with regions done and regions in all.
        target: deviation that the contour limit is for; the cases that count are measured for it.
    """
    cases = stated_cases(machine)
    limits = motion_limits(machine)
    running = []
    for place in placed:
        player = _CasePlayer(
            emitted.core.cutting_path(place.first_line, place.last_line), place.region.path, machine, cases, target
        )
        runs = [pool.submit(player.nominal, rule) for rule in _BLOCK_ENDS]
        planned = pool.submit(player.planned)
        rest = pool.submit(player.others)
        slowed = pool.submit(
            _core.count_slowed_blocks, player.blocks, limits.corner_speed_difference_mm_per_s, limits.max_feed_mm_per_s
        )
        running.append((player, runs, planned, rest, slowed))
    results: list[RegionFigures] = []
    for original, (player, runs, planned, rest, slowed) in zip(originals, running, strict=True):
        nominal = tuple(run.result() for run in runs)
        figures = player.figures(nominal, planned.result(), rest.result())
        results.append(RegionFigures(original.result(), nominal, figures, slowed.result()))
        on_step(len(results), len(placed))
    return results


@dataclass(frozen=True)
class _CasePlayer:
    """One emitted region in every case of the verdict; every method is a task of its own."""

    blocks: _core.Path
    path: _core.Path
    machine: Machine
    cases: Sequence[Case]
    target: Target

    def nominal(self, rule: _core.BlockEnd) -> _core.PlaybackFigures:
        """Blocks at 100 %; under the controller's own rule also with an empty buffer where a stop excites most."""
        own = rule == _own_rule(self.machine)
        return play_emitted(
            self.blocks, self.path, self.machine, rule,
            starved_blocks=_core.fastest_block_ends(self.blocks) if own else (),
            memory_s=_vibration_memory_s(self.machine),
        )  # fmt: skip

    def planned(self) -> _core.PlaybackFigures | None:
        """The look-ahead left on; None where no case asks."""
        wanted = any(case.look_ahead for case in self.cases)
        return play_planned(self.blocks, self.path, self.machine) if wanted else None

    def others(self) -> dict[str, _core.PlaybackFigures]:
        """Overrides and shifted modes by the name of their case."""
        memory_s = _vibration_memory_s(self.machine)
        played = {}
        for case in self.cases:
            if case.override == 1.0 and case.mode is None:
                continue
            whole = case.needs_contour(self.target)
            played[case.name] = play_emitted(
                self.blocks, self.path, self.machine, override=case.override, shift=case.shift,
                only=case.mode or ALL_MODES, contour=whole, last_seconds=0.0 if whole else memory_s,
            )  # fmt: skip
        return played

    def figures(
        self,
        nominal: Sequence[_core.PlaybackFigures],
        planned: _core.PlaybackFigures | None,
        others: dict[str, _core.PlaybackFigures],
    ) -> tuple[CaseFigures, ...]:
        """One entry per case."""
        by_rule = {rule.name: run for rule, run in zip(_BLOCK_ENDS, nominal, strict=True)}
        own = by_rule[_own_rule(self.machine).name]
        figures = []
        for case in self.cases:
            if case.name in others:
                figures.append(self._other(case, others[case.name], own))
            elif case.starved_s > 0.0:
                figures.append(_starved_figures(own, case.starved_s if own.starved else 0.0))
            else:
                run = planned if case.look_ahead and planned is not None else by_rule[case.block_end or ""]
                figures.append(_whole_figures(run))
        return tuple(figures)

    def _other(self, case: Case, run: _core.PlaybackFigures, own: _core.PlaybackFigures) -> CaseFigures:
        if case.needs_contour(self.target):
            return _whole_figures(run)
        if case.override == 1.0:  # the set-points are those of the nominal case, only the table is another
            return CaseFigures(run.residual_mm, Deviation.of([own.command]), None, own.duration_s)
        period = self.machine.controller.interpolation_period_s
        cut_s = [_core.play_duration_s(self.blocks, period, _own_rule(self.machine), at) for at in (case.override, 1.0)]
        return CaseFigures(run.residual_mm, None, None, own.duration_s + cut_s[0] - cut_s[1])


def _whole_figures(run: _core.PlaybackFigures) -> CaseFigures:
    return CaseFigures(run.residual_mm, Deviation.of([run.command]), Deviation.of([run.response]), run.duration_s)


def _starved_figures(run: _core.PlaybackFigures, waited_s: float) -> CaseFigures:
    """The worst of all places; at the end of the region the vibration is that without a wait, but for a wait nearby."""
    runs: list[_core.PlaybackFigures | _core.StarvedFigures] = [run, *run.starved]
    return CaseFigures(
        np.max([each.residual_mm for each in runs], axis=0),
        Deviation.of(each.command for each in runs),
        Deviation.of(each.response for each in runs),
        run.duration_s + waited_s,
    )


def _vibration_memory_s(machine: Machine) -> float:
    """Time after which a vibration is a millionth of itself; 0 where a mode has no damping to speak of."""
    rates = [
        mode.damping_ratio * 2.0 * math.pi * mode.frequency_hz
        for axis in machine.axes.as_tuple()
        for mode in axis.modes
    ]
    slowest = min(rates, default=0.0)
    return math.log(1e6) / slowest if slowest > 0.01 else 0.0


def other_time_s(program: _core.ProgramText, machine: Machine) -> float:
    """Time of everything between the regions, s: rapids, waits for in-position, dwells, kept moves, functions.

    Moves of which an axis' position is not known count with what is known of them.
    """
    return _core.time_program(program, controller_model(machine)).outside_regions_s


def summarise(
    figures: Sequence[RegionFigures], placed: Sequence[Placed], machine: Machine, target: Target = "command"
) -> dict[str, Any]:
    """The figures of all regions as the stable keys of the report; the emitted ones are the worse of both rules."""
    emitted = [run for region in figures for run in region.emitted]
    originals = [region.original for region in figures]
    cases = stated_cases(machine)
    limits = [_limits(region, place, machine, target) for region, place in zip(figures, placed, strict=True)]
    lines = [(place.region.first_line, place.region.last_line) for place in placed]
    side = machine.input.material_side
    entries = summarise_cases(cases, [region.cases for region in figures], limits, lines, side) if figures else []
    return {
        "residual_vibration_um": {
            "original": largest_um(run.residual_mm for run in originals),
            "emitted": largest_um(run.residual_mm for run in emitted),
        },
        "peak_vibration_um": {
            "original": largest_um(run.peak_mm for run in originals),
            "emitted": largest_um(run.peak_mm for run in emitted),
        },
        "contour_error_um": {
            "command": {
                "original": deviation_um((run.command for run in originals), side),
                "emitted": deviation_um((run.command for run in emitted), side),
            },
            "response": {
                "original": deviation_um((run.response for run in originals), side),
                "emitted": deviation_um((run.response for run in emitted), side),
            },
        },
        "orbit_error_percent": [
            max(pair)
            for region in figures
            for pair in zip(*(run.orbit_error_percent for run in region.emitted), strict=True)
        ],
        "override_residual": [
            {
                "override": ratio,
                "residual_um": largest_um(
                    region.cases[k].residual_mm
                    for region in figures
                    for k, case in enumerate(cases)
                    if case.override == ratio and case.mode is None
                ),
            }
            for ratio in OVERRIDES
        ],
        "frequency_residual": [
            {"shift": case.shift, "residual_um": largest_um(region.cases[k].residual_mm for region in figures)}
            for k, case in enumerate(cases)
            if case.mode == ALL_MODES and case.override == 1.0
        ],
        "slowed_blocks": sum(region.slowed_blocks for region in figures),
        "cases": entries,
        "worst_case": worst_counted(entries),
        "regions": [
            _region_summary(region, place, cases, limit)
            for region, place, limit in zip(figures, placed, limits, strict=True)
        ],
    }


def _limits(figures: RegionFigures, place: Placed, machine: Machine, target: Target) -> Limits:
    """What a region is judged by: its residual beside that of the original as programmed, in whatever case."""
    tolerance = machine.tolerance
    increment_um = least_increment_mm(machine, place.region.exit.units) * 1e3
    floor_um = max(tolerance.residual_floor_um, tolerance.residual_floor_increments * increment_um)
    before_um = figures.original.residual_mm * 1e3
    return Limits(np.maximum(tolerance.residual_ratio * before_um, floor_um), tolerance.contour_um, target)


def _region_summary(figures: RegionFigures, place: Placed, cases: Sequence[Case], limits: Limits) -> dict[str, Any]:
    after = np.max([run.residual_mm for run in figures.emitted], axis=0) * 1e3
    return {
        "lines": [place.region.first_line, place.region.last_line],
        "emitted_lines": [place.first_line, place.last_line],
        "time_s": {
            "original": figures.original.duration_s,
            "emitted": max(run.duration_s for run in figures.emitted),
        },
        "residual_vibration_um": {"original": _xyz(figures.original.residual_mm * 1e3), "emitted": _xyz(after)},
        "residual_limit_um": _xyz(limits.residual_um),
        "contour_error_um": max(run.command.max_abs_mm for run in figures.emitted) * 1e3,
        "misses": region_misses(cases, figures.cases, limits),
    }


def _compare_states(
    emitted: _core.ModalState, original: _core.ModalState, line: int, incremental: bool, machine: Machine
) -> None:
    for field in _STATE_FIELDS:
        was, now = getattr(original, field), getattr(emitted, field)
        if was != now and not (field == "feed" and original.feed_mode == 93):
            raise RoundTripError(f"emitted line {line}: modal {field} is {now}, the original has {was}")
    if original.known != emitted.known:
        raise RoundTripError(f"emitted line {line}: known axes {emitted.known}, the original has {original.known}")
    if incremental:
        return
    limit = _end_tolerance_mm(machine, original.units)
    for axis, known, was, now in zip("XYZ", original.known, original.position_mm, emitted.position_mm, strict=True):
        if known and abs(was - now) > limit:
            raise RoundTripError(f"emitted line {line}: {axis} is at {now:.6f} mm, the original at {was:.6f} mm")


def _compare_ends(blocks: _core.Path, place: Placed, machine: Machine) -> None:
    path = place.region.path
    travel = path.end_mm - path.start_mm
    gap = float(np.abs((blocks.end_mm - blocks.start_mm) - travel).max())
    # Start and end are rounded to the increment, each once.
    limit = 2.0 * _end_tolerance_mm(machine, place.region.exit.units)
    if gap > limit:
        raise RoundTripError(
            f"shaped blocks of lines {place.region.first_line} to {place.region.last_line} end {gap * 1e3:.2f} um off "
            f"(limit {limit * 1e3:.2f} um)"
        )


def _end_tolerance_mm(machine: Machine, units: int) -> float:
    # Half an increment: a program may carry more digits than the controller resolves.
    return 0.5 * least_increment_mm(machine, units) + 1e-9


def _xyz(values: Iterable[float]) -> dict[str, float]:
    return {axis: float(value) for axis, value in zip("xyz", values, strict=True)}


def largest_um(vectors: Iterable[Vector]) -> dict[str, float]:
    """Largest of each axis, mm to µm."""
    rows = list(vectors)
    return _xyz(np.max(rows, axis=0) * 1e3 if rows else np.zeros(3))


def deviation_um(stats: Iterable[_core.DeviationStats], material_side: str | None = None) -> dict[str, float]:
    """Largest magnitude, RMS over all samples and largest on either side of the path, µm.

    Args:
        stats: of one or several runs.
        material_side: "left" or "right" of the travel, where the workpiece is: adds `gouge` and `excess`.
    """
    rows = list(stats)
    count = sum(row.count for row in rows)
    squares = sum(row.sum_of_squares_mm2 for row in rows)
    largest = Deviation.of(rows) if rows else Deviation(0.0, 0.0, 0.0)
    found = {
        "max": largest.largest_mm * 1e3,
        "rms": math.sqrt(squares / count) * 1e3 if count else 0.0,
        "left": largest.left_mm * 1e3,
        "right": largest.right_mm * 1e3,
    }
    return found if material_side is None else found | largest.gouge_and_excess_um(material_side)
