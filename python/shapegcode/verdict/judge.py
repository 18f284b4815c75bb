"""Verdict of an emitted program: simulate its regions in every condition, compare with the limits, summarise."""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import compress, count
from typing import TypeVar

import numpy as np

from shapegcode import _core
from shapegcode.errors import RoundTripError
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import moving_axis
from shapegcode.program import Program, least_increment_mm, written_increment_mm
from shapegcode.program.computer import cores
from shapegcode.results.outcome import ContourError, Deviation, Pair, Tracks, Xyz, largest_xyz_um
from shapegcode.verdict.figures import (
    ALL_MODES,
    Case,
    CaseFigures,
    CaseSimulation,
    CaseVerdict,
    FeedExcess,
    FrequencyResidual,
    OverrideResidual,
    Placed,
    ProgramFigures,
    RegionLimits,
    RegionVerdict,
    SimulatedCase,
    Target,
    case_figures,
    judge_region,
    region_misses,
    stated_cases,
    worst_counted,
)

_T = TypeVar("_T")

OVERRIDES = (0.8, 0.9, 1.1, 1.2)  # for `override_residual`; there are more cases
_HASTE = 0.9  # ratio of times below which a region is faster than programmed
_WORSE, _WORSE_UM = 1.001, 0.05  # ratio and µm: differences from the original beyond the last digits
Step = Callable[[int, int], None]


@dataclass(frozen=True)
class RegionFigures:
    """Simulations of one cut: as programmed, and as emitted in the operating conditions of the verdict."""

    original: _core.SimulationFigures  # the programmed path with the controller's own motion
    # shaped blocks with each rule of block timing; one entry for a cut left unchanged
    emitted: tuple[_core.SimulationFigures, ...]
    # one entry per operating condition; None: not simulated for a cut left unchanged
    cases: tuple[CaseFigures | None, ...]
    slowed_blocks: int  # emitted blocks that the controller's look-ahead limits would slow
    is_shaped: bool = True  # False: the cut was left unchanged

    @property
    def feed_excess(self) -> FeedExcess | None:
        """Largest ratio of speed to programmed feed, by the worse rule of block timing; None: cut not shaped."""
        if not self.is_shaped:
            return None
        worst = max((run.feed_excess for run in self.emitted), key=lambda each: each.ratio)
        return FeedExcess(worst.ratio, worst.speed_mm_per_s * 60.0, worst.programmed_mm_per_s * 60.0, worst.line)

    @property
    def emitted_s(self) -> float:
        """Time until the set-points rest, with the slower rule of block timing."""
        return max(run.duration_s for run in self.emitted)

    @property
    def gain_um(self) -> float:
        """Gain with the worse rule of block timing: reduction of residual vibration or contour error, the larger."""
        after = np.max([_figures_um(run) for run in self.emitted], axis=0)
        return max(0.0, float(np.max(np.asarray(_figures_um(self.original)) - after)))


def _figures_um(simulated: _core.SimulationFigures) -> tuple[float, float]:
    """Residual vibration of the worst axis, contour error of the machine table."""
    return float(np.max(simulated.residual_mm)) * 1e3, simulated.response.max_abs_mm * 1e3


def max_gain_um(original: _core.SimulationFigures) -> float:
    """Upper bound of the gain of shaping: residual vibration or contour error of the original, the larger."""
    return max(_figures_um(original))


@dataclass(frozen=True)
class PendingSimulations:
    """The running simulations of one emitted region."""

    simulation: CaseSimulation  # the simulation with these tasks
    nominal: Sequence[Future[_core.SimulationFigures]]  # with each rule of block timing
    planned: Future[_core.SimulationFigures | None]  # with the look-ahead left on
    others: Sequence[Future[dict[str, SimulatedCase]]]  # the other cases, in groups
    slowed: Future[int]  # blocks that the look-ahead limits would slow


class Judge:
    """Simulates emitted regions in every operating condition and compares them with the tolerances."""

    def __init__(self, model: MachineModel, cases: Sequence[Case] | None = None) -> None:
        self._machine, self._model = model.machine, model
        # As in `RegionFigures.cases`; rules of block timing: the control's own, and those of `RegionFigures.emitted`.
        self.cases = stated_cases(model.machine) if cases is None else list(cases)
        self.own_rule, self.rules = model.own_rule, model.block_rules
        # Target of the contour tolerance.
        self.target: Target = "response" if model.machine.shaping.contour == "response" else "command"

    def measure(
        self,
        emitted: Program,
        placed: Sequence[Placed],
        originals: Sequence[Future[_core.SimulationFigures]],
        pool: Executor,
    ) -> list[RegionFigures]:
        """Simulate every emitted region, and add the figures of its original; calls `begin`, then `figures`."""
        trackers = [_core.ContourTracker(place.region.path) for place in placed]
        return self.figures(self.begin(emitted, placed, trackers, pool), originals)

    def begin(
        self, emitted: Program, placed: Sequence[Placed], trackers: Iterable[_core.ContourTracker], pool: Executor
    ) -> list[PendingSimulations]:
        """Start the simulation of every emitted region."""
        limits = self._model.limits()
        if self._model.always_plans:  # slowing by its planner is part of every simulation
            limits.corner_speed_difference_mm_per_s = limits.max_feed_mm_per_s = [math.inf] * 3
        running = []
        for place, tracker in zip(placed, trackers, strict=True):
            simulation = CaseSimulation(
                place.blocks(emitted), place.region.path, self._model, self.cases, self.target,
                self._model.offset(place.region), tracker,
                written_increment_mm(self._machine, place.region.exit.units),
            )  # fmt: skip
            planned = pool.submit(simulation.planned)  # takes longest
            runs = [pool.submit(simulation.nominal, rule) for rule in self.rules]
            rest = [pool.submit(simulation.others, group) for group in simulation.groups()]
            slowed = pool.submit(
                _core.count_slowed_blocks, simulation.blocks, limits.corner_speed_difference_mm_per_s,
                limits.max_feed_mm_per_s,
            )  # fmt: skip
            running.append(PendingSimulations(simulation, runs, planned, rest, slowed))
        return running

    def figures(
        self,
        running: Sequence[PendingSimulations],
        originals: Sequence[Future[_core.SimulationFigures]],
        on_step: Step = lambda _done, _total: None,
    ) -> list[RegionFigures]:
        """Collect the results of the simulations."""
        results: list[RegionFigures] = []
        # A program may be one long region: progress is measured in simulations.
        done = count(1)
        total = sum(len(each.nominal) + len(each.others) + 3 for each in running)

        def result(future: Future[_T]) -> _T:
            found = future.result()
            on_step(next(done), total)
            return found

        for original, each in zip(originals, running, strict=True):
            nominal = tuple(result(run) for run in each.nominal)
            others = {name: run for part in each.others for name, run in result(part).items()}
            cases: tuple[CaseFigures | None, ...] = each.simulation.figures(nominal, result(each.planned), others)
            results.append(RegionFigures(result(original), nominal, cases, result(each.slowed)))
        return results

    def simulate_unchanged(
        self, mine: _core.Region, region: _core.Region, original: _core.SimulationFigures
    ) -> RegionFigures:
        """Simulate an unchanged cut in every operating condition that counts for it.

        Three conditions affect shaped blocks only, and get the nominal result: the other block timing, a buffer
        underrun, and look-ahead left on. Other feed overrides and uncertain modes are simulated where they count. The
        path is that of the emitted program, which may have chords instead of an arc.
        """
        model, path, offset = self._model, mine.path, self._model.offset(region)
        same = path.moves_as(region.path)
        run = original
        if not (same and model.is_emitted_alike(path)):
            run = model.simulate_original(path, against=region.path, offset=offset, emitted=True)

        def figures(case: Case) -> CaseFigures | None:
            if case.override == 1.0 and case.mode is None:
                return case_figures(run)
            if not case.counts:
                return None
            simulated = model.simulate_original(
                path, against=None if same else region.path, override=case.override, shift=case.shift,
                only=None if case.mode == ALL_MODES else case.mode, offset=offset, emitted=True,
            )  # fmt: skip
            return case_figures(simulated)

        return RegionFigures(original, (run,), tuple(map(figures, self.cases)), 0, is_shaped=False)

    def contour_um(self, figures: RegionFigures, *, turned: bool = True) -> float:
        """Largest deviation of the target, µm, in conditions that count; not with look-ahead left on or an underrun.

        A lower feed does not improve those two. Without *turned* only conditions at 100 % feed override are used.
        """
        deviations = [
            simulated.command if self.target == "command" else simulated.response
            for case, simulated in zip(self.cases, figures.cases, strict=True)
            if simulated is not None
            and case.counts
            and not case.look_ahead
            and case.starved_s == 0.0
            and (turned or case.override == 1.0)
        ]
        return max(each.largest_mm for each in deviations if each is not None) * 1e3

    def verdicts(
        self, figures: Sequence[RegionFigures], placed: Sequence[Placed], block_period_s: float
    ) -> tuple[RegionVerdict, ...]:
        """Verdict of every cut against its limits."""
        pairs = zip(figures, placed, strict=True)
        return tuple(self._verdict(region, place, block_period_s) for region, place in pairs)

    def summarise(
        self,
        figures: Sequence[RegionFigures],
        placed: Sequence[Placed],
        block_period_s: float,
        rapid_vibration_um: Pair[Xyz[float]],
    ) -> ProgramFigures:
        """The figures of all cuts; see `verdicts`."""
        emitted = [run for region in figures for run in region.emitted]
        both = [region.original for region in figures], emitted
        side = self._machine.input.material_side
        cases = self._case_verdicts(figures, placed)
        excesses = [region.feed_excess for region in figures if region.feed_excess is not None]
        verdicts = self.verdicts(figures, placed, block_period_s)
        return ProgramFigures(
            residual_vibration_um=Pair(*(largest_xyz_um(run.residual_mm for run in runs) for runs in both)),
            peak_vibration_um=Pair(*(largest_xyz_um(run.peak_mm for run in runs) for runs in both)),
            contour_error_um=Tracks(
                Pair(*(ContourError.of((run.command for run in runs), side) for runs in both)),
                Pair(*(ContourError.of((run.response for run in runs), side) for runs in both)),
            ),
            rapid_vibration_um=rapid_vibration_um,
            orbit_error_percent=tuple(
                max(pair)
                for region in figures
                for pair in zip(*(run.orbit_error_percent for run in region.emitted), strict=True)
            ),
            override_residual=tuple(
                OverrideResidual(ratio, self._residual_um(figures, self._at_override(ratio))) for ratio in OVERRIDES
            ),
            frequency_residual=tuple(
                FrequencyResidual(case.shift, self._residual_um(figures, [case]))
                for case in self.cases
                if case.mode == ALL_MODES and case.override == 1.0
            ),
            slowed_blocks=sum(region.slowed_blocks for region in figures),
            feed_excess=max(excesses, key=lambda each: each.ratio, default=None),
            cases=cases,
            worst_case=worst_counted(cases),
            regions=tuple(cut for cut, of in zip(verdicts, figures, strict=True) if of.is_shaped),
            unchanged=tuple(cut for cut, of in zip(verdicts, figures, strict=True) if not of.is_shaped),
        )

    def _at_override(self, ratio: float) -> list[Case]:
        turned = [case for case in self.cases if case.override == ratio and case.mode is None]
        return turned or [case for case in self.cases if case.nominal]

    def _residual_um(self, figures: Sequence[RegionFigures], cases: Iterable[Case]) -> Xyz[float]:
        ranks = [self.cases.index(case) for case in cases]
        simulated = [region.cases[rank] for region in figures if region.is_shaped for rank in ranks]
        return largest_xyz_um(each.residual_mm for each in simulated if each is not None)

    def deciding(self, figures: Sequence[RegionFigures], placed: Sequence[Placed]) -> tuple[int, int] | None:
        """Lines of the cut closest to a limit in a condition that counts; None without cuts."""
        worst = worst_counted(self._case_verdicts(figures, placed))
        return None if worst is None else worst.lines

    def limits(self, figures: RegionFigures, place: Placed) -> RegionLimits:
        """Limits of a region; of the residual: `residual_ratio` times the original's, or the floor if that is more."""
        tolerance, floor_um = self._machine.tolerance, residual_floor_um(place.region, self._machine)
        limit_um = np.maximum(tolerance.residual_ratio * (figures.original.residual_mm * 1e3), floor_um)
        return RegionLimits(limit_um, tolerance.contour_um, self.target)

    def _verdict(self, figures: RegionFigures, place: Placed, block_period_s: float) -> RegionVerdict:
        limits = self.limits(figures, place)
        after = np.max([run.residual_mm for run in figures.emitted], axis=0)
        found = region_misses(self.cases, figures.cases, limits)
        misses = [miss for miss, _ in found]
        worse: list[str] = []
        excess, allowed = figures.feed_excess, self._machine.tolerance.feed_excess_ratio
        if excess is not None:
            before = {each.figure: each.value_um for each in judge_region(case_figures(figures.original), limits)}
            worse = [miss for miss, checks in found if checks.value_um > before[checks.figure] * _WORSE + _WORSE_UM]
            too_fast = _haste(figures, place, block_period_s)
            if excess.ratio > 1.0 + allowed:
                too_fast.append(f"{excess}, limit {allowed * 100.0:g} %")
            misses += too_fast
            worse += too_fast
        return RegionVerdict(
            lines=place.original_lines,
            emitted_lines=(place.first_line, place.last_line),
            time_s=Pair(figures.original.duration_s, figures.emitted_s),
            residual_vibration_um=Pair(largest_xyz_um([figures.original.residual_mm]), largest_xyz_um([after])),
            residual_limit_um=Xyz(*limits.residual_um.tolist()),
            contour_error_um=max(getattr(run, limits.target).max_abs_mm for run in figures.emitted) * 1e3,
            original_contour_error_um=getattr(figures.original, limits.target).max_abs_mm * 1e3,
            feed_excess=excess,
            misses=tuple(misses),
            worse=tuple(worse),
        )

    def _case_verdicts(self, figures: Sequence[RegionFigures], placed: Sequence[Placed]) -> tuple[CaseVerdict, ...]:
        limits = [self.limits(region, place) for region, place in zip(figures, placed, strict=True)]
        side = self._machine.input.material_side
        verdicts = []
        for rank, case in enumerate(self.cases):
            rows = [
                (found, limit, place.original_lines)
                for region, limit, place in zip(figures, limits, placed, strict=True)
                if (found := region.cases[rank]) is not None
            ]
            if rows:
                verdict = _case_verdict(case, rows, side)
                verdicts.append(verdict if len(rows) == len(figures) else replace(verdict, time_s=None))
        return tuple(verdicts)


def residual_floor_um(region: _core.Region, machine: Machine) -> float:
    """Residual vibration that always passes, µm."""
    increment_um = least_increment_mm(machine, region.exit.units) * 1e3
    return max(machine.tolerance.residual_floor_um, machine.tolerance.residual_floor_increments * increment_um)


def _case_verdict(
    case: Case, rows: Sequence[tuple[CaseFigures, RegionLimits, tuple[int, int]]], material_side: str | None
) -> CaseVerdict:
    checks = [(each, where) for run, limit, where in rows for each in judge_region(run, limit)]
    worst, where = max(checks, key=lambda pair: pair[0].share)
    simulated = [run for run, _, _ in rows]
    tracks = _largest(run.command for run in simulated), _largest(run.response for run in simulated)
    sides: dict[str, Tracks[float | None]] = {}
    if material_side is not None:
        both = [None if found is None else found.gouge_and_excess_um(material_side) for found in tracks]
        sides = {
            f"{name}_um": Tracks(*(None if found is None else found[name] for found in both))
            for name in ("gouge", "excess")
        }
    return CaseVerdict(
        name=case.name,
        block_end=case.block_end,
        override=case.override,
        mode=case.mode,
        shift=case.shift,
        look_ahead=case.look_ahead,
        underrun_ms=case.starved_s * 1e3,
        counts=case.counts,
        residual_um=largest_xyz_um(run.residual_mm for run in simulated),
        contour_error_um=Tracks(*(None if found is None else found.largest_mm * 1e3 for found in tracks)),
        time_s=sum(run.time_s for run in simulated),
        within=not worst.is_missed,
        figure=worst.figure,
        value_um=worst.value_um,
        limit_um=worst.limit_um,
        share_of_limit=worst.share if math.isfinite(worst.share) else None,
        lines=where,
        **sides,
    )


def _largest(deviations: Iterable[Deviation | None]) -> Deviation | None:
    rows = list(deviations)
    measured = [each for each in rows if each is not None]
    return Deviation.largest(measured) if rows and len(measured) == len(rows) else None


def _haste(figures: RegionFigures, place: Placed, block_period_s: float) -> list[str]:
    """The missed limit of a region that is faster than programmed.

    At feeds so slow that an increment takes several blocks, F words cannot represent whole periods. Less
    time than the original takes is not yet too fast: a rapid may take longer than its replacement, an original
    longer than its feeds require.
    """
    was_s, now_s = figures.original.duration_s, figures.emitted_s
    if now_s >= _HASTE * was_s or now_s >= _HASTE * place.region.path.programmed_time_s:
        return []
    return [
        f"runs in {now_s:.1f} s instead of {was_s:.1f} s: too slow a feed for blocks of {block_period_s * 1e3:g} ms "
        "(raise controller.minimum_feed_mm_per_min above it to leave the cut unchanged)"
    ]


def judge_program(
    emitted: Program,
    original: Program,
    pairs: Sequence[tuple[_core.Region, _core.Region]],
    model: MachineModel,
    *,
    shaped: bool | None = None,
) -> ProgramFigures:
    """Judge an emitted program in nominal conditions and those that count. *pairs*: its cuts, and the original's."""
    machine = model.machine
    judge = Judge(model, [case for case in stated_cases(machine) if case.counts or case.nominal])
    is_shaped = [mine.shaped if shaped is None else shaped for mine, _ in pairs]
    placed = [Placed(region, mine.first_line, mine.last_line, mine.path) for mine, region in pairs]
    with ThreadPoolExecutor(max_workers=cores()) as pool:
        originals = [
            pool.submit(model.simulate_original, place.region.path, offset=model.offset(place.region))
            for place in placed
        ]
        shaped_cuts = [*compress(placed, is_shaped)], [*compress(originals, is_shaped)]
        simulated = iter(judge.measure(emitted, *shaped_cuts, pool))
        unchanged = [
            pool.submit(judge.simulate_unchanged, mine, region, original.result())
            for (mine, region), original, each in zip(pairs, originals, is_shaped, strict=True)
            if not each
        ]
        left = iter(run.result() for run in unchanged)
        figures = [next(simulated if each else left) for each in is_shaped]
        rapids = Pair(rapid_vibration_um(original, model), rapid_vibration_um(emitted, model))
    period_s = machine.emission.block_period_s or machine.controller.interpolation_period_s
    return judge.summarise(figures, placed, period_s, rapids)


def rapid_vibration_um(program: Program, model: MachineModel) -> Xyz[float]:
    """Residual vibration of rapids before cuts, µm: maximum of |table - command| once their set-points rest."""
    found: dict[tuple[float | None, ...], FloatArray] = {}
    moves = moving_axis(model.machine) is not None
    for region, start_mm, end_mm in _rapids_before_cuts(program):
        offset = model.offset(region)
        where = (*start_mm, *offset) if moves else ()
        key = (*np.round(end_mm - start_mm, 9), *where)
        if key not in found:
            options = model.verdict_options(offset=offset)
            found[key] = model.simulate_rapid(start_mm, end_mm, options).residual_mm
    shaped = [
        model.simulate_emitted(region.path, region.path, rule, contour=False, offset=model.offset(region)).residual_mm
        for region in program.regions
        if region.was_rapid
        for rule in model.block_rules
    ]
    return largest_xyz_um([*found.values(), *shaped])


def _rapids_before_cuts(program: Program) -> Iterator[tuple[_core.Region, FloatArray, FloatArray]]:
    """Yield each cut that follows a rapid with only functions and dwells between, with start and end of the rapid."""
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
                yield regions[index], np.asarray(last.start_mm), np.asarray(last.end_mm)
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
        raise RoundTripError(f"the emitted program has {len(found)} unshaped cuts, expected {len(expected)}")
    return found
