"""A whole emitted program beside its original: shaped cuts, cuts left unchanged, and the rapids between them."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.errors import RoundTripError
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.program import Program
from shapegcode.program.pairing import paired_regions
from shapegcode.results.figures import largest_xyz_um
from shapegcode.results.result import Pair, Xyz
from shapegcode.verdict.ahead import cores
from shapegcode.verdict.case_player import case_figures
from shapegcode.verdict.cases import ALL_MODES, Case, CaseFigures, stated_cases
from shapegcode.verdict.figures import PlayedFigures
from shapegcode.verdict.judge import Judge, RegionFigures
from shapegcode.verdict.placed import Placed

__all__ = ["judge_program", "rapid_vibration_um", "simulate_unchanged", "unshaped_regions"]

T = TypeVar("T")
Vector = npt.NDArray[np.float64]


def judge_program(
    emitted: Program, original: Program, machine: Machine, *, shaped: bool | None = None
) -> PlayedFigures:
    """An emitted program judged in the operating conditions that count, as `convert` judges its own."""
    model = MachineModel(machine)
    judge = Judge(model, [case for case in stated_cases(machine) if case.counts or case.nominal])
    pairs = list(paired_regions(emitted, original))
    is_shaped = [mine.shaped if shaped is None else shaped for mine, _ in pairs]
    placed = [Placed(region, mine.first_line, mine.last_line, mine.path) for mine, region in pairs]
    with ThreadPoolExecutor(max_workers=cores()) as pool:
        originals = [
            pool.submit(model.play_original, place.region.path, offset=model.offset(place.region)) for place in placed
        ]

        def of(wanted: bool, rows: Sequence[T]) -> list[T]:
            return [row for row, each in zip(rows, is_shaped, strict=True) if each == wanted]

        simulated = iter(judge.measure(emitted, of(True, placed), of(True, originals), pool))
        unchanged = [
            pool.submit(simulate_unchanged, judge, model, mine, region, original.result())
            for (mine, region), original in zip(of(False, pairs), of(False, originals), strict=True)
        ]
        left = iter(run.result() for run in unchanged)
        figures = [next(simulated if each else left) for each in is_shaped]
        rapids = Pair(rapid_vibration_um(original, model), rapid_vibration_um(emitted, model))
    period_s = machine.emission.block_period_s or machine.controller.interpolation_period_s
    return judge.summarise(figures, placed, period_s, rapids)


def simulate_unchanged(
    judge: Judge, model: MachineModel, mine: _core.Region, region: _core.Region, original: _core.PlaybackFigures
) -> RegionFigures:
    """A cut left unchanged in every operating condition that counts for it.

    Rules of block timing, a buffer underrun and look-ahead left on concern shaped blocks alone: there it is as it is
    meant to run. Other feed overrides and uncertain modes are simulated where they count.
    """
    path, offset = mine.path, model.offset(region)
    same = path.moves_as(region.path)
    run = original if same else model.play_original(path, against=region.path, offset=offset)

    def figures(case: Case) -> CaseFigures | None:
        if case.override == 1.0 and case.mode is None:
            return case_figures(run)
        if not case.counts:
            return None
        only = None if case.mode == ALL_MODES else case.mode
        return case_figures(
            model.play_original(
                path, against=None if same else region.path, override=case.override, shift=case.shift, only=only,
                offset=offset,
            )
        )  # fmt: skip

    return RegionFigures(original, (run,), tuple(map(figures, judge.cases)), 0, is_shaped=False)


def rapid_vibration_um(program: Program, model: MachineModel) -> Xyz[float]:
    """Vibration that rapids leave where a cut follows: maximum of |table - command| once their set-points rest."""
    found: dict[tuple[float, ...], Vector] = {}
    for start_mm, end_mm in _rapids_before_cuts(program):
        key = tuple(np.round(end_mm - start_mm, 9))
        if key not in found:
            found[key] = model.play_rapid(start_mm, end_mm, model.verdict_options()).residual_mm
    shaped = [
        model.play_emitted(region.path, region.path, rule, contour=False, offset=model.offset(region)).residual_mm
        for region in program.regions
        if region.was_rapid
        for rule in (_core.BlockEnd.ceil, _core.BlockEnd.carry)
    ]
    return largest_xyz_um([*found.values(), *shaped])


def _rapids_before_cuts(program: Program) -> Iterator[tuple[Vector, Vector]]:
    """Start and end of every rapid that nothing but functions and dwells lies between it and a cut."""
    moves = program.core.other_moves
    last: _core.Segment | None = None
    regions = program.regions
    for kind, index, _ in program.core.steps:
        if kind == _core.StepKind.move:
            segment, dwell_s = moves[index]
            if segment.kind == _core.SegmentKind.rapid and segment.length_mm > 0.0:
                last = segment
            elif dwell_s <= 0.0:
                last = None
        elif kind == _core.StepKind.region:
            if last is not None and not regions[index].was_rapid:
                yield np.asarray(last.start_mm), np.asarray(last.end_mm)
            last = None


def unshaped_regions(
    emitted: Program, shaped_lines: Sequence[tuple[int, int]], expected: Sequence[_core.Region]
) -> list[_core.Region]:
    """The cuts of an emitted program that were left unchanged."""
    starts = sorted(shaped_lines)
    begins = [begin for begin, _ in starts]

    def is_shaped(region: _core.Region) -> bool:
        rank = bisect_right(begins, region.first_line) - 1
        return rank >= 0 and region.first_line <= starts[rank][1]

    found = [region for region in emitted.regions if not is_shaped(region)]
    if len(found) != len(expected):
        raise RoundTripError(
            f"the emitted program has {len(found)} cuts beside the shaped ones, expected {len(expected)}"
        )
    return found
