"""One emitted region simulated in every operating condition of the verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shapegcode import _core
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import Offset
from shapegcode.results.figures import Deviation
from shapegcode.verdict.cases import ALL_MODES, Case, CaseFigures, Target

BLOCK_ENDS = (_core.BlockEnd.ceil, _core.BlockEnd.carry)
"""Both rules of block timing."""


@dataclass(frozen=True)
class Played:
    """An operating condition that was simulated.

    Attributes:
        run: its figures.
        cut_s: how much longer all blocks take in it than at 100 %, before any filter, where only their end was
            simulated; else 0.
    """

    run: _core.PlaybackFigures
    cut_s: float


@dataclass(frozen=True)
class CasePlayer:
    """Simulates one emitted region; every method is a task of its own.

    Attributes:
        blocks: what was emitted.
        path: what was programmed.
        model: the machine for the core.
        cases: in which it is simulated.
        target: what the contour tolerance is about.
        offset: from the region's positions to the machine's.
        tracker: of the programmed path.
        increment_mm: least increment of the text.
    """

    blocks: _core.Path
    path: _core.Path
    model: MachineModel
    cases: Sequence[Case]
    target: Target
    offset: Offset
    tracker: _core.ContourTracker
    increment_mm: float

    def nominal(self, rule: _core.BlockEnd) -> _core.PlaybackFigures:
        """Blocks at 100 %; under the controller's own rule also with an empty buffer where a stop excites most."""
        own = rule == self.model.own_rule
        return self.model.play_emitted(
            self.blocks, self.path, rule, offset=self.offset,
            other_overrides=[case.override for case in self.cases if self._beside(case)] if own else (),
            starved_blocks=_core.fastest_block_ends(self.blocks) if own else (),
            memory_s=self.model.vibration_memory_s, tracker=self.tracker, increment_mm=self.increment_mm,
        )  # fmt: skip

    def planned(self) -> _core.PlaybackFigures | None:
        """The look-ahead left on; None where no case asks."""
        wanted = any(case.look_ahead for case in self.cases)
        if not wanted:
            return None
        return self.model.play_planned(self.blocks, self.path, offset=self.offset, tracker=self.tracker)

    def _beside(self, case: Case) -> bool:
        """Whether the contour of a case is measured beside the nominal run."""
        return case.override != 1.0 and case.mode is None and self.model.bounds_deviations

    def _whole(self, case: Case) -> bool:
        """Whether the whole region is simulated for a case alone."""
        # Behind feed drives each would take a quarter of a conversion: what is only shown makes do with the residual.
        spared = case.override != 1.0 and not case.counts and self.model.machine.verdict.plant != "modal"
        return case.needs_contour(self.target) and not spared and not self._beside(case)

    def groups(self) -> list[list[Case]]:
        """Overrides and shifted modes: those simulated in full each by itself, the short ones in one task."""
        others = [case for case in self.cases if case.override != 1.0 or case.mode is not None]
        whole = [[case] for case in others if self._whole(case)]
        return [*whole, [case for case in others if not self._whole(case)]]

    def others(self, cases: Sequence[Case]) -> dict[str, Played]:
        """A group of them by the name of their case."""
        played = {}
        for case in cases:
            whole = self._whole(case)
            run = self.model.play_emitted(
                self.blocks, self.path, override=case.override, shift=case.shift,
                only=None if case.mode == ALL_MODES else case.mode, offset=self.offset, contour=whole,
                command_contour=case.override != 1.0,
                last_seconds=0.0 if whole else self.model.vibration_memory_s, tracker=self.tracker,
            )  # fmt: skip
            cut_s = 0.0
            if not whole and case.override != 1.0:
                # That at 100 % is taken off it: worked out here, where others need not wait for it.
                cut_s = self._cut_s(case.override) - self._own_cut_s
            played[case.name] = Played(run, cut_s)
        return played

    def _cut_s(self, override: float) -> float:
        """How long all blocks take at a feed override, before any filter."""
        return _core.play_duration_s(self.blocks, self.model.period_s, self.model.own_rule, override)

    @cached_property
    def _own_cut_s(self) -> float:
        return self._cut_s(1.0)

    def figures(
        self,
        nominal: Sequence[_core.PlaybackFigures],
        planned: _core.PlaybackFigures | None,
        others: Mapping[str, Played],
    ) -> tuple[CaseFigures, ...]:
        """One entry per case, of what the tasks gave."""
        by_rule = {rule.name: run for rule, run in zip(BLOCK_ENDS, nominal, strict=True)}
        own = by_rule[self.model.own_rule.name]
        figures = []
        for case in self.cases:
            if case.name in others:
                figures.append(self._other(case, others[case.name], own))
            elif case.starved_s > 0.0:
                figures.append(_starved(own, case.starved_s if own.starved else 0.0))
            else:
                run = planned if case.look_ahead and planned is not None else by_rule[case.block_end or ""]
                figures.append(case_figures(run))
        return tuple(figures)

    def _other(self, case: Case, played: Played, own: _core.PlaybackFigures) -> CaseFigures:
        run, whole = played.run, self._whole(case)
        if case.override == 1.0:  # the set-points are those of the nominal case, only the table is another
            response = Deviation.of([run.response]) if whole else None
            return CaseFigures(run.residual_mm, Deviation.of([own.command]), response, own.duration_s)
        if whole:
            return case_figures(run)
        time_s = own.duration_s + played.cut_s
        if not self._beside(case):
            return CaseFigures(run.residual_mm, None, None, time_s)
        largest = next(each for each in own.other_overrides if each.override_ratio == case.override)
        command, response = (Deviation(mm, math.nan, math.nan) for mm in (largest.command_mm, largest.response_mm))
        return CaseFigures(run.residual_mm, command, response, time_s)


def case_figures(run: _core.PlaybackFigures, *, contour: bool = True, response: bool = True) -> CaseFigures:
    """What a simulation showed."""
    if not contour:
        return CaseFigures(run.residual_mm, None, None, run.duration_s)
    followed = Deviation.of([run.response]) if response else None
    return CaseFigures(run.residual_mm, Deviation.of([run.command]), followed, run.duration_s)


def _starved(run: _core.PlaybackFigures, waited_s: float) -> CaseFigures:
    """The worst of all places; at the end of the region the vibration is that without a wait, but for a wait nearby."""
    runs: list[_core.PlaybackFigures | _core.StarvedFigures] = [run, *run.starved]
    return CaseFigures(
        np.max([each.residual_mm for each in runs], axis=0),
        Deviation.of(each.command for each in runs),
        Deviation.of(each.response for each in runs),
        run.duration_s + waited_s,
    )
