"""Operating conditions of an emitted program (`[verdict]` of the machine file), and the figures of its cuts in them."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import Literal

import numpy as np

from shapegcode import _core
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.machine.controller import PLANNER_NAMES
from shapegcode.model.machine_model import MachineModel
from shapegcode.model.modes import Offset
from shapegcode.program import Program
from shapegcode.results.json import OldNames, sparse
from shapegcode.results.outcome import CONTOURS, ContourError, Deviation, Pair, Tracks, Xyz
from shapegcode.results.table import NO_BREAK, Column, Table


@dataclass(frozen=True)
class Placed:
    """A region and its lines in the emitted program: its shaped blocks, or the cut left unchanged."""

    region: _core.Region  # of the original program
    first_line: int  # first emitted line, from 1
    last_line: int  # last emitted line
    path: _core.Path | None = None  # the shaped blocks; None: those of these lines

    @property
    def original_lines(self) -> tuple[int, int]:
        """First and last line of the region in the original program."""
        return self.region.first_line, self.region.last_line

    def blocks(self, emitted: Program) -> _core.Path:
        """The shaped blocks as they were read back."""
        return emitted.core.cutting_path(self.first_line, self.last_line) if self.path is None else self.path


@dataclass(frozen=True)
class BlockCount:
    """Number of blocks of a program."""

    read: int  # of the original, expanded
    emitted: int  # shaped blocks that replace its regions


@dataclass(frozen=True)
class GridTaps:
    """A shaper on the grid of the blocks."""

    delays: tuple[int, ...]  # in whole block periods
    taps: tuple[float, ...]  # amplitude of the impulse at each delay


@dataclass(frozen=True)
class FollowingShapers:
    """Shapers for several positions of the axis on which frequencies depend."""

    axis: str  # "x", "y" or "z"
    position_mm: tuple[float, ...]  # position at which each is exact (machine coordinates)
    times_s: tuple[tuple[float, ...], ...]  # impulse times of each
    amplitudes: tuple[tuple[float, ...], ...]  # impulse amplitudes of each
    worst_residual: float  # largest residual ratio along the axis


@dataclass(frozen=True)
class UsedShaper:
    """The shaper of a conversion."""

    times_s: tuple[float, ...]  # of the impulses
    amplitudes: tuple[float, ...]  # of the impulses
    family: str  # name of its family
    duration_s: float  # of the longest active shaper
    per_axis: tuple[GridTaps, ...]  # shapers of X, Y, Z used instead (`--per-axis`); else empty
    per_axis_duration_s: float | None  # duration with such shapers; null: not shorter, or not computed
    # shapers that follow an axis; only if modes vary with its position
    following: FollowingShapers | None = field(default=None, metadata=sparse())


@dataclass(frozen=True)
class AppliedLimits:
    """The tolerances of the machine file that were applied."""

    contour_um: float  # largest deviation from the programmed path
    contour_target: str  # its target: "response" or "command"
    residual_ratio: float  # ratio to the original's residual vibration
    residual_floor_um: float  # residual vibration below this passes
    residual_floor_increments: float  # likewise, in least increments
    feed_excess_ratio: float  # ratio by which the set-points may be faster than programmed
    plant: str  # plant of the simulation, "modal" or "feed-drive"
    program_time_percent: float  # largest increase of the program's time
    cut_time_percent: float  # largest increase of the time of one cut


@dataclass(frozen=True)
class OverrideResidual:
    """Residual vibration of the emitted program at another feed override."""

    override: float  # ratio, 0.9 = 90 %
    residual_um: Xyz[float]  # maximum over the shaped cuts


@dataclass(frozen=True)
class FrequencyResidual:
    """Residual vibration of the emitted program with every mode shifted by its uncertainty."""

    shift: float  # of the frequencies in units of their uncertainty, -1 or +1; damping is at its lowest
    residual_um: Xyz[float]  # maximum over the shaped cuts


@dataclass(frozen=True)
class CaseVerdict(OldNames):
    """Verdict in one case: residual, and the figure that is largest relative to its limit."""

    name: str  # shown name, unique
    block_end: str | None  # "ceil" or "carry"; null if look-ahead replans the blocks
    override: float  # feed override, 1 = 100 %
    mode: str | None  # shifted mode: "x.1" (first of the X axis), "all", or null: none
    shift: float  # in units of its uncertainty, -1 or +1; 0 without a shifted mode
    look_ahead: bool  # the controller's look-ahead is left on
    underrun_ms: float  # duration of one buffer underrun; 0: none
    counts: bool  # it is within the range of the machine file
    residual_um: Xyz[float]  # maximum over the cuts simulated in this case
    contour_error_um: Tracks[float | None]  # maximum over the same cuts; null if not measured in each
    time_s: float | None  # of all cuts; null if those left unchanged were not simulated
    within: bool  # every region keeps its limits
    figure: str  # the figure that is largest relative to its limit
    value_um: float  # that figure
    limit_um: float  # its limit
    share_of_limit: float | None  # their ratio; null: the limit is 0, and the figure is not
    lines: tuple[int, int]  # first and last line of the region with this figure
    # largest deviation towards the workpiece; only if its side is known
    gouge_um: Tracks[float | None] | None = field(default=None, metadata=sparse())
    # largest deviation away from the workpiece; only if its side is known
    excess_um: Tracks[float | None] | None = field(default=None, metadata=sparse())


def worst_counted(cases: Sequence[CaseVerdict]) -> CaseVerdict | None:
    """The deciding case: of those that count, the one with the largest ratio to a limit; None if none counts."""
    counted = [case for case in cases if case.counts]
    shares = [math.inf if case.share_of_limit is None else case.share_of_limit for case in counted]
    return counted[shares.index(max(shares))] if counted else None


@dataclass(frozen=True)
class FeedExcess:
    """Largest ratio of the emitted speed to the programmed feed at the same position of the path.

    The speed is that of the set-points along their own path, averaged over one, four or sixteen times the control's
    block time (at least an interpolation period); two increments, the effect of rounding, are subtracted. The feed
    is that of the path where the set-points are, not that at the same time.
    """

    ratio: float  # speed over programmed feed; 1: as programmed
    speed_mm_per_min: float  # speed of the set-points
    programmed_mm_per_min: float  # feed at the same position
    line: int  # line of the original that programs this feed

    def __str__(self) -> str:
        return (
            f"runs at {self.speed_mm_per_min:.1f} mm/min where line {self.line} programs "
            f"{self.programmed_mm_per_min:.1f}, {(self.ratio - 1.0) * 100.0:.0f} % faster"
        )


@dataclass(frozen=True)
class RegionVerdict:
    """One cut as programmed and as emitted, with its limits."""

    lines: tuple[int, int]  # first and last line of the original
    emitted_lines: tuple[int, int]  # likewise of the emitted program
    time_s: Pair[float]  # until the set-points rest
    # maximum of |table - command| while they rest; emitted: with the worse rule of block timing
    residual_vibration_um: Pair[Xyz[float]]
    residual_limit_um: Xyz[float]  # limit of the emitted one
    contour_error_um: float  # of the emitted program, for the target of the tolerance
    original_contour_error_um: float  # likewise of the original
    # largest ratio of speed to programmed feed; null for a cut left unchanged
    feed_excess: FeedExcess | None
    misses: tuple[str, ...]  # every missed tolerance, as text
    worse: tuple[str, ...] = ()  # missed tolerances in which it is worse than the original

    def is_benefit(self, contour_limit_um: float, least_gain_um: float) -> bool:
        """True if the contour error or a residual vibration falls enough.

        Enough: by the least gain, and either by 30 % or from above its limit to within it. The contour error must have
        been above its limit, the vibration above its limit or the least gain, whichever is less.
        """
        pairs = [(self.original_contour_error_um, self.contour_error_um, contour_limit_um, contour_limit_um)]
        residual = self.residual_vibration_um
        pairs += [
            (before, after, limit, min(limit, least_gain_um))
            for before, after, limit in zip(residual.original, residual.emitted, self.residual_limit_um, strict=True)
        ]
        return any(
            before > threshold
            and before - after >= least_gain_um
            and (after <= 0.7 * before or (before > limit >= after))
            for before, after, limit, threshold in pairs
        )


@dataclass(frozen=True, repr=False)
class ProgramFigures:
    """Every cut of a program, as programmed and as emitted, shaped or left unchanged.

    Emitted figures of shaped cuts are for the worse rule of block timing.
    """

    # maximum of |table - command| from the instant at which the set-points rest
    residual_vibration_um: Pair[Xyz[float]]
    peak_vibration_um: Pair[Xyz[float]]  # maximum of |table - command| before that instant
    contour_error_um: Tracks[Pair[ContourError]]  # distance of command and table from the programmed path
    # maximum of |table - command| after a rapid before a cut; no limit applies
    rapid_vibration_um: Pair[Xyz[float]]
    orbit_error_percent: tuple[float, ...]  # per arc: area between emitted command and arc over the area of its sector
    override_residual: tuple[OverrideResidual, ...]  # residual vibration of the shaped cuts at 80, 90, 110 and 120 %
    # with every mode shifted by its uncertainty; empty if there is none
    frequency_residual: tuple[FrequencyResidual, ...]
    slowed_blocks: int  # emitted blocks that look-ahead would slow: speed step or feed of an axis above its limit
    # largest ratio of emitted speed to programmed feed; null if nothing was shaped
    feed_excess: FeedExcess | None
    # the simulated operating conditions; other overrides and shifted modes that do not count are simulated for
    # shaped cuts only
    cases: tuple[CaseVerdict, ...]
    worst_case: CaseVerdict | None  # the deciding one; null without cuts
    regions: tuple[RegionVerdict, ...]  # the shaped cuts, in the order of the program
    unchanged: tuple[RegionVerdict, ...]  # the cuts left unchanged, likewise

    @property
    def all_cuts(self) -> list[RegionVerdict]:
        """All cuts, shaped or left unchanged, in program order."""
        return sorted([*self.regions, *self.unchanged], key=lambda cut: cut.lines)

    @property
    def within_tolerance(self) -> bool:
        """True if every cut, shaped or left unchanged, keeps its limits in every operating condition that counts."""
        return self.shaped_cuts_within and not any(cut.misses for cut in self.unchanged)

    @property
    def shaped_cuts_within(self) -> bool:
        """True if the shaped cuts keep their limits."""
        return not any(cut.misses for cut in self.regions)

    def region_time_s(self) -> Pair[float]:
        """Time of all cuts, until the set-points rest."""
        cuts = self.all_cuts
        return Pair(math.fsum(cut.time_s.original for cut in cuts), math.fsum(cut.time_s.emitted for cut in cuts))


Target = Literal["command", "response"]

ALL_MODES = "all"


@dataclass(frozen=True)
class Case:
    """One operating condition of the emitted program."""

    name: str  # shown name, unique
    block_end: str | None  # "ceil" or "carry"; None if look-ahead replans the blocks
    counts: bool  # it is within the range of the machine file
    override: float = 1.0  # feed override, 1 = 100 %
    # the shifted mode ("x.1": first of the X axis, as in the machine file), "all", or None
    mode: str | None = None
    shift: float = 0.0  # in units of its uncertainty, -1 or +1; 0 without a shifted mode
    look_ahead: bool = False  # the controller's look-ahead is left on
    starved_s: float = 0.0  # time for which the block buffer is empty once; 0: never

    @property
    def nominal(self) -> bool:
        """True for the intended operation, with either rule of block timing."""
        return self.override == 1.0 and self.mode is None and not self.look_ahead and self.starved_s == 0.0

    def needs_contour(self, target: Target) -> bool:
        """True if the contour error must be measured in this operating condition.

        At 100 % override a shifted mode does not change the command. So with a shifted mode it is measured only if the
        condition counts, and if the target is the response or the override differs from 100 %.
        """
        return self.mode is None or (self.counts and (self.override != 1.0 or target == "response"))


@dataclass(frozen=True)
class CaseFigures:
    """One region simulated in one operating condition."""

    residual_mm: FloatArray  # largest |table - command| while the set-points rest, (3,)
    command: Deviation | None  # deviation of the command; None: not measured
    response: Deviation | None  # deviation of the table; None: not measured
    time_s: float  # until the set-points rest


@dataclass(frozen=True)
class RegionLimits:
    """Limits of a region."""

    residual_um: FloatArray  # limit per axis, (3,)
    contour_um: float  # limit of the target's deviation
    target: Target = "command"  # target: the command, or the machine table (response)


@dataclass(frozen=True)
class LimitCheck:
    """A figure of a case and its limit."""

    figure: str  # its name
    value_um: float  # its value
    limit_um: float  # its limit
    decimals: int = 2  # shown decimals; more if figure and limit would look equal

    @property
    def share(self) -> float:
        """Ratio to the limit; with a limit of 0 infinite, or 0 for a figure of 0."""
        if self.limit_um > 0.0:
            return self.value_um / self.limit_um
        return math.inf if self.value_um > 0.0 else 0.0

    @property
    def is_missed(self) -> bool:
        """True if the figure exceeds its limit."""
        return self.value_um > self.limit_um * (1.0 + 1e-9)

    def __str__(self) -> str:
        for decimals in range(self.decimals, self.decimals + 4):  # as many as show which one is larger
            value, limit = (f"{each:.{decimals}f}" for each in (self.value_um, self.limit_um))
            if value != limit:
                break
        return f"{self.figure} {value} um, limit {limit} um"


def _uncertain_modes(machine: Machine) -> list[tuple[str, list[tuple[str, float]]]]:
    """Key of every mode with an uncertainty, with name and shift (-1 or +1) of each of its conditions."""
    found = []
    for axis, table in zip("XYZ", machine.axes.as_tuple(), strict=True):
        for number, mode in enumerate(table.modes, start=1):
            name, damping = f"{axis} {mode.frequency_hz:.4g} Hz", mode.damping_uncertainty_percent
            less = f", damping {-damping:.3g} %" if damping else ""
            if percent := mode.frequency_uncertainty_percent:
                variants = [(f"{name} {shift * percent:+.3g} %{less}", shift) for shift in (-1.0, 1.0)]
            elif damping:
                variants = [(f"{name}{less}", -1.0)]
            else:
                continue
            found.append((f"{axis.lower()}.{number}", variants))
    return found


def stated_cases(machine: Machine) -> list[Case]:
    """Operating conditions of the verdict for a machine; the nominal ones come first (FANUC: ceil, carry)."""
    band, kind = machine.verdict, machine.controller.kind
    low, high = band.override_percent
    own = machine.controller.block_end if kind == "fanuc" else None
    cases = [Case(f"nominal, planner of {PLANNER_NAMES[kind]}", None, counts=True)]
    if own is not None:
        counting = ("ceil", "carry") if band.block_end == "both" else (own,)
        cases = [Case(f"nominal, {rule}", rule, counts=rule in counting) for rule in ("ceil", "carry")]

    def at_override(percent: float) -> Case:
        return Case(f"override {percent:g} %", own, low <= percent <= high, override=percent / 100.0)

    turns = machine.emission.override != "lock"  # a disabled override has no effect
    ends = sorted({low, high} - {100.0}) if turns else []
    overrides = {50.0, 60.0, 70.0, 80.0, 90.0, 110.0, 120.0, *ends} if turns else set[float]()
    cases += [at_override(percent) for percent in sorted(overrides)]
    modes = _uncertain_modes(machine)
    for mode, variants in modes:
        cases += [Case(words, own, band.mode_uncertainty, mode=mode, shift=shift) for words, shift in variants]
    if modes:
        together = [(-1.0, "all modes low")]
        if any(len(variants) > 1 for _, variants in modes):
            together.append((1.0, "all modes high"))
        cases += [Case(words, own, band.mode_uncertainty, mode=ALL_MODES, shift=shift) for shift, words in together]
        cases += [
            replace(corner, name=f"{corner.name}, {words}", counts=band.mode_uncertainty, mode=ALL_MODES, shift=shift)
            for corner in map(at_override, ends)
            for shift, words in together
        ]
    if own is None:  # a planner that cannot be switched off: it stops in time if its buffer runs empty
        return cases
    if machine.controller.motion == "look_ahead" or band.look_ahead:
        cases.append(Case("look-ahead on", None, band.look_ahead, look_ahead=True))
    cases.append(Case(f"underrun {band.starved_s * 1e3:g} ms", own, band.starved_block, starved_s=band.starved_s))
    return cases


def judge_region(figures: CaseFigures, limits: RegionLimits) -> list[LimitCheck]:
    """Check the figures of a region in one case against their limits: residuals, and the target's deviation."""
    check = [
        LimitCheck(f"residual vibration {axis}", float(now), float(limit))
        for axis, now, limit in zip("XYZ", figures.residual_mm * 1e3, limits.residual_um, strict=True)
    ]
    deviation = figures.command if limits.target == "command" else figures.response
    if deviation is not None:
        check.append(LimitCheck(CONTOURS[limits.target], deviation.largest_mm * 1e3, limits.contour_um, decimals=1))
    return check


def region_misses(
    cases: Sequence[Case], figures: Sequence[CaseFigures | None], limits: RegionLimits
) -> list[tuple[str, LimitCheck]]:
    """Figures of a cut beyond their limits, each in the worst condition that counts: as text, and with its limit."""
    worst: dict[str, tuple[LimitCheck, Case]] = {}
    for case, simulated in zip(cases, figures, strict=True):
        for check in judge_region(simulated, limits) if case.counts and simulated is not None else ():
            if check.figure not in worst or check.value_um > worst[check.figure][0].value_um:
                worst[check.figure] = (check, case)
    return [
        (str(check) if case.nominal else f"{check} ({case.name})", check)
        for check, case in worst.values()
        if check.is_missed
    ]


_NUMBER = re.compile(r"(\d) (%|ms\b|s\b|mm\b|Hz\b|µm\b)")


def case_table(cases: Sequence[CaseVerdict], worst: CaseVerdict | None) -> Table:
    """Table of operating conditions: their figures, which of them count, and which one decides."""
    columns = (
        Column("condition", value=lambda case: unbroken(case.name), text=True),
        *(
            Column(axis.upper(), value=f"residual_um.{axis}", digits=2)
            for axis in "xyz"
            if any(case.residual_um[axis] >= 0.005 for case in cases)
        ),
        Column("command", value=lambda case: _known(case.contour_error_um.command, 1)),
        Column("table", value=lambda case: _known(case.contour_error_um.response, 1)),
        Column("s", value=lambda case: _known(case.time_s, 2)),
        Column("of limit", value=_share),
        Column("verdict", value=lambda case: _verdict(case, case is worst), left=True),
    )
    shown = sum(not case.counts for case in cases)
    brackets = "; a verdict in brackets does not" if shown else ""
    return Table(
        "operating conditions: residual of each axis, contour error of command and machine table, µm",
        columns,
        cases,
        caption=f"{len(cases) - shown} of {len(cases)} operating conditions count (table [verdict]){brackets}; "
        "ceil, carry: block timing (controller.block_end)",
        row_style=lambda case: _style(case, case is worst),
    )


def unbroken(text: str) -> str:
    """Keep a number and its unit on one line."""
    return _NUMBER.sub(rf"\1{NO_BREAK}\2", text)


def _known(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _share(case: CaseVerdict) -> str:
    percent = "limit is 0" if case.share_of_limit is None else f"{case.share_of_limit * 100:.0f} %"
    return f"> {percent}" if percent == "100 %" and not case.within else percent


def _verdict(case: CaseVerdict, worst: bool) -> str:
    word = "within" if case.within else "OUT"
    return (word if case.counts else f"({word.lower()})") + (" ← decides" if worst else "")


def _style(case: CaseVerdict, worst: bool) -> str:
    colour = "" if case.within else "red"
    return "dim" if not case.counts else f"bold {colour}".strip() if worst else colour


# Figures of a simulated operating condition, and, if only the end was simulated, the time by which all blocks
# together are longer than at 100 %, before filters; else 0.
SimulatedCase = tuple[_core.SimulationFigures, float]


@dataclass(frozen=True)
class CaseSimulation:
    """Simulates one emitted region; `nominal`, `planned` and `others` may run in parallel."""

    blocks: _core.Path  # emitted blocks
    path: _core.Path  # programmed path
    model: MachineModel  # the machine for the core
    cases: Sequence[Case]  # operating conditions
    target: Target  # target of the contour tolerance
    offset: Offset  # from positions of the region to machine positions
    tracker: _core.ContourTracker  # of the programmed path
    increment_mm: float  # least increment of the program

    def nominal(self, rule: _core.BlockEnd) -> _core.SimulationFigures:
        """Simulate the blocks at 100 %; with the control's own block timing also other overrides, and underruns."""
        own = rule == self.model.own_rule
        return self.model.simulate_emitted(
            self.blocks, self.path, rule, offset=self.offset,
            other_overrides=[case.override for case in self.cases if self._beside(case)] if own else (),
            starved_blocks=_core.fastest_block_ends(self.blocks) if own else (),
            memory_s=self.model.vibration_memory_s, tracker=self.tracker, increment_mm=self.increment_mm,
        )  # fmt: skip

    def planned(self) -> _core.SimulationFigures | None:
        """Simulate with the look-ahead left on; None if no case needs it."""
        if not any(case.look_ahead for case in self.cases):
            return None
        return self.model.simulate_planned(self.blocks, self.path, offset=self.offset, tracker=self.tracker)

    def _beside(self, case: Case) -> bool:
        """True if the simulation of the nominal case also computes the contour error of this case."""
        return case.override != 1.0 and case.mode is None and self.model.bounds_deviations

    def _whole(self, case: Case) -> bool:
        if self.model.always_plans and case.override != 1.0:
            return True
        # With feed drives each would take a quarter of a conversion: cases that are only shown have the residual only.
        spared = case.override != 1.0 and not case.counts and self.model.machine.verdict.plant != "modal"
        return case.needs_contour(self.target) and not spared and not self._beside(case)

    def groups(self) -> list[list[Case]]:
        """Cases of other overrides or modes, in groups: each full simulation alone, all short ones together."""
        others = [case for case in self.cases if case.override != 1.0 or case.mode is not None]
        whole = [[case] for case in others if self._whole(case)]
        return [*whole, [case for case in others if not self._whole(case)]]

    def others(self, cases: Sequence[Case]) -> dict[str, SimulatedCase]:
        """Simulate a group of cases; results by name."""
        simulated = {}
        duration_s = cache(partial(_core.simulated_duration_s, self.blocks, self.model.period_s, self.model.own_rule))
        for case in cases:
            whole = self._whole(case)
            run = self.model.simulate_emitted(
                self.blocks, self.path, override=case.override, shift=case.shift,
                only=None if case.mode == ALL_MODES else case.mode, offset=self.offset, contour=whole,
                command_contour=case.override != 1.0,
                last_seconds=0.0 if whole else self.model.vibration_memory_s, tracker=self.tracker,
            )  # fmt: skip
            cut_s = 0.0
            if not whole and case.override != 1.0:
                # The time at 100 % is subtracted: computed here, where no other task waits for it.
                cut_s = duration_s(case.override) - duration_s(1.0)
            simulated[case.name] = run, cut_s
        return simulated

    def figures(
        self,
        nominal: Sequence[_core.SimulationFigures],
        planned: _core.SimulationFigures | None,
        others: Mapping[str, SimulatedCase],
    ) -> tuple[CaseFigures, ...]:
        """Combine the results of the tasks, one entry per case."""
        by_rule = {rule.name: run for rule, run in zip(self.model.block_rules, nominal, strict=True)}
        own = by_rule[self.model.own_rule.name]
        figures = []
        for case in self.cases:
            if case.name in others:
                figures.append(self._other(case, others[case.name], own))
            elif case.starved_s > 0.0:
                figures.append(_starved(own, case.starved_s if own.starved else 0.0))
            else:
                run = planned if case.look_ahead and planned is not None else by_rule.get(case.block_end or "", own)
                figures.append(case_figures(run))
        return tuple(figures)

    def _other(self, case: Case, simulated: SimulatedCase, own: _core.SimulationFigures) -> CaseFigures:
        (run, cut_s), whole = simulated, self._whole(case)
        if case.override == 1.0:  # the set-points are those of the nominal case, only the response differs
            response = Deviation.of([run.response]) if whole else None
            return CaseFigures(run.residual_mm, Deviation.of([own.command]), response, own.duration_s)
        if whole:
            return case_figures(run)
        time_s = own.duration_s + cut_s
        if not self._beside(case):
            return CaseFigures(run.residual_mm, None, None, time_s)
        largest = next(each for each in own.other_overrides if each.override_ratio == case.override)
        command, response = (Deviation(mm, math.nan, math.nan) for mm in (largest.command_mm, largest.response_mm))
        return CaseFigures(run.residual_mm, command, response, time_s)


def case_figures(run: _core.SimulationFigures, *, contour: bool = True, response: bool = True) -> CaseFigures:
    """Figures of a simulation."""
    if not contour:
        return CaseFigures(run.residual_mm, None, None, run.duration_s)
    followed = Deviation.of([run.response]) if response else None
    return CaseFigures(run.residual_mm, Deviation.of([run.command]), followed, run.duration_s)


def _starved(run: _core.SimulationFigures, waited_s: float) -> CaseFigures:
    """Largest figures of several runs: one without an underrun, and one for each position of the underrun."""
    runs: list[_core.SimulationFigures | _core.StarvedFigures] = [run, *run.starved]
    return CaseFigures(
        np.max([each.residual_mm for each in runs], axis=0),
        Deviation.of(each.command for each in runs),
        Deviation.of(each.response for each in runs),
        run.duration_s + waited_s,
    )
