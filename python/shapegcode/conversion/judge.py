"""The verdict on an emitted text: regions played in every case, held against limits, summed up for the report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Any

import numpy as np

from shapegcode import _core
from shapegcode.conversion.cases import (
    ALL_MODES,
    Case,
    CaseFigures,
    Limits,
    Target,
    region_misses,
    stated_cases,
    summarise_cases,
    worst_counted,
)
from shapegcode.conversion.readback import Placed
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import Offset
from shapegcode.program import Program, least_increment_mm
from shapegcode.results.figures import Deviation, deviation_um, largest_um, xyz

__all__ = ["OVERRIDES", "RegionFigures", "contour_target", "contour_um", "measure", "summarise"]

OVERRIDES = (0.8, 0.9, 1.1, 1.2)  # of the report's override_residual; the cases have more
_HASTE = 0.9  # of its time: a region that takes less cuts faster than programmed
_BLOCK_ENDS = (_core.BlockEnd.ceil, _core.BlockEnd.carry)

Step = Callable[[int, int], None]


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


def measure(
    emitted: Program,
    placed: Sequence[Placed],
    originals: Sequence[Future[_core.PlaybackFigures]],
    machine: Machine,
    pool: Executor,
    on_step: Step = lambda _done, _total: None,
) -> list[RegionFigures]:
    """Play every emitted region beside its original.

    Args:
        emitted: the program read back.
        placed: the regions and their places in it.
        originals: the originals' playbacks under way, one per region (`play_original`).
        machine: controller model and plant.
        pool: runs the playbacks.
        on_step: called with regions done and regions in all.
    """
    cases = stated_cases(machine)
    model = MachineModel(machine)
    limits = model.limits()
    running = []
    for place in placed:
        player = _CasePlayer(
            emitted.core.cutting_path(place.first_line, place.last_line), place.region.path, machine, model, cases,
            model.offset(place.region), _core.ContourTracker(place.region.path),
        )  # fmt: skip
        runs = [pool.submit(player.nominal, rule) for rule in _BLOCK_ENDS]
        planned = pool.submit(player.planned)
        rest = [pool.submit(player.others, group) for group in player.groups()]
        slowed = pool.submit(
            _core.count_slowed_blocks, player.blocks, limits.corner_speed_difference_mm_per_s, limits.max_feed_mm_per_s
        )
        running.append((player, runs, planned, rest, slowed))
    results: list[RegionFigures] = []
    for original, (player, runs, planned, rest, slowed) in zip(originals, running, strict=True):
        nominal = tuple(run.result() for run in runs)
        figures = player.figures(
            nominal, planned.result(), {k: run for part in rest for k, run in part.result().items()}
        )
        results.append(RegionFigures(original.result(), nominal, figures, slowed.result()))
        on_step(len(results), len(placed))
    return results


@dataclass(frozen=True)
class _CasePlayer:
    """One emitted region in every case of the verdict; every method is a task of its own."""

    blocks: _core.Path
    path: _core.Path
    machine: Machine
    model: MachineModel
    cases: Sequence[Case]
    offset: Offset
    tracker: _core.ContourTracker

    def nominal(self, rule: _core.BlockEnd) -> _core.PlaybackFigures:
        """Blocks at 100 %; under the controller's own rule also with an empty buffer where a stop excites most."""
        own = rule == self.model.own_rule
        return self.model.play_emitted(
            self.blocks, self.path, rule, offset=self.offset,
            starved_blocks=_core.fastest_block_ends(self.blocks) if own else (),
            memory_s=self.model.vibration_memory_s, tracker=self.tracker,
        )  # fmt: skip

    def planned(self) -> _core.PlaybackFigures | None:
        """The look-ahead left on; None where no case asks."""
        wanted = any(case.look_ahead for case in self.cases)
        return self.model.play_planned(self.blocks, self.path, offset=self.offset) if wanted else None

    def groups(self) -> list[list[Case]]:
        """Overrides and shifted modes: those played in full each by itself, the short ones in one task."""
        others = [case for case in self.cases if case.override != 1.0 or case.mode is not None]
        target = contour_target(self.machine)
        whole = [[case] for case in others if case.needs_contour(target)]
        return [*whole, [case for case in others if not case.needs_contour(target)]]

    def others(self, cases: Sequence[Case]) -> dict[str, _core.PlaybackFigures]:
        """A group of them by the name of their case."""
        memory_s = self.model.vibration_memory_s
        played = {}
        for case in cases:
            whole = case.needs_contour(contour_target(self.machine))
            played[case.name] = self.model.play_emitted(
                self.blocks, self.path, override=case.override, shift=case.shift,
                only=None if case.mode == ALL_MODES else case.mode, offset=self.offset,
                contour=whole, command_contour=case.override != 1.0, last_seconds=0.0 if whole else memory_s,
                tracker=self.tracker,
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
        own = by_rule[self.model.own_rule.name]
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
        whole = case.needs_contour(contour_target(self.machine))
        if case.override == 1.0:  # the set-points are those of the nominal case, only the table is another
            response = Deviation.of([run.response]) if whole else None
            return CaseFigures(run.residual_mm, Deviation.of([own.command]), response, own.duration_s)
        if whole:
            return _whole_figures(run)
        period = self.machine.controller.interpolation_period_s
        cut_s = [_core.play_duration_s(self.blocks, period, self.model.own_rule, at) for at in (case.override, 1.0)]
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


def summarise(
    figures: Sequence[RegionFigures], placed: Sequence[Placed], machine: Machine, block_period_s: float
) -> dict[str, Any]:
    """The figures of all regions as the stable keys of the report; the emitted ones are the worse of both rules.

    Args:
        figures: per region, as played.
        placed: the regions.
        machine: tolerances.
        block_period_s: of the emitted blocks, s.
    """
    emitted = [run for region in figures for run in region.emitted]
    originals = [region.original for region in figures]
    cases = stated_cases(machine)
    limits = [_limits(region, place, machine) for region, place in zip(figures, placed, strict=True)]
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
            _region_summary(region, place, cases, limit, block_period_s)
            for region, place, limit in zip(figures, placed, limits, strict=True)
        ],
    }


def contour_target(machine: Machine) -> Target:
    """What the contour tolerance is about: "command" or "response"."""
    return "response" if machine.shaping.contour == "response" else "command"


def contour_um(figures: RegionFigures, machine: Machine) -> float:
    """Largest deviation from the path of what the contour tolerance is about, over the cases that count, µm.

    Without those that a lower feed is no remedy for: look-ahead left on, a starved block.
    """
    target = contour_target(machine)
    deviations = [
        played.command if target == "command" else played.response
        for case, played in zip(stated_cases(machine), figures.cases, strict=True)
        if case.counts and not case.look_ahead and case.starved_s == 0.0
    ]
    return max(each.largest_mm for each in deviations if each is not None) * 1e3


def _limits(figures: RegionFigures, place: Placed, machine: Machine) -> Limits:
    """What a region is judged by: its residual beside that of the original as programmed, in whatever case."""
    tolerance = machine.tolerance
    increment_um = least_increment_mm(machine, place.region.exit.units) * 1e3
    floor_um = max(tolerance.residual_floor_um, tolerance.residual_floor_increments * increment_um)
    before_um = figures.original.residual_mm * 1e3
    return Limits(
        np.maximum(tolerance.residual_ratio * before_um, floor_um), tolerance.contour_um, contour_target(machine)
    )


def _haste(figures: RegionFigures, place: Placed, block_period_s: float) -> list[str]:
    """The miss of a region that runs faster than programmed.

    At feeds so slow that an increment lasts several blocks, F words of its resolution do not meet their ticks. A rapid
    may take longer than its replacement, and an original longer than its feeds say: neither makes that too fast.
    """
    was_s, now_s = figures.original.duration_s, max(run.duration_s for run in figures.emitted)
    if now_s >= _HASTE * min(was_s, place.region.path.programmed_time_s):
        return []
    return [
        f"runs in {now_s:.1f} s instead of {was_s:.1f} s: too slow a feed for blocks of {block_period_s * 1e3:g} ms "
        "(raise controller.minimum_feed_mm_per_min above it to keep its text)"
    ]


def _region_summary(
    figures: RegionFigures, place: Placed, cases: Sequence[Case], limits: Limits, block_period_s: float
) -> dict[str, Any]:
    after = np.max([run.residual_mm for run in figures.emitted], axis=0) * 1e3
    return {
        "lines": [place.region.first_line, place.region.last_line],
        "emitted_lines": [place.first_line, place.last_line],
        "time_s": {
            "original": figures.original.duration_s,
            "emitted": max(run.duration_s for run in figures.emitted),
        },
        "residual_vibration_um": {"original": xyz(figures.original.residual_mm * 1e3), "emitted": xyz(after)},
        "residual_limit_um": xyz(limits.residual_um),
        "contour_error_um": max(getattr(run, limits.target).max_abs_mm for run in figures.emitted) * 1e3,
        "misses": [*region_misses(cases, figures.cases, limits), *_haste(figures, place, block_period_s)],
    }
