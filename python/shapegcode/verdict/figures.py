"""The parts of a conversion's result: what was simulated, per case and per region, beside its limits."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from shapegcode import _core
from shapegcode.program import Program
from shapegcode.results.figures import ContourError, Tracks
from shapegcode.results.json import sparse
from shapegcode.results.result import Pair, Xyz


@dataclass(frozen=True)
class Placed:
    """A region and where its shaped blocks stand in the emitted text."""

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
        if self.path is not None:
            return self.path
        return emitted.core.cutting_path(self.first_line, self.last_line)


@dataclass(frozen=True)
class BlockCount:
    """How many blocks a program has.

    Attributes:
        read: of the original, expanded.
        emitted: shaped ones that replace its regions.
    """

    read: int
    emitted: int


@dataclass(frozen=True)
class GridTaps:
    """A shaper on the grid of the blocks.

    Attributes:
        delays: in whole block periods.
        taps: one for each delay.
    """

    delays: tuple[int, ...]
    taps: tuple[float, ...]


@dataclass(frozen=True)
class FollowingShapers:
    """Shapers along an axis, with which modes vary.

    Attributes:
        axis: "x", "y" or "z".
        position_mm: where each of them holds exactly (machine coordinates).
        times_s: taps of each.
        amplitudes: likewise.
        worst_residual: largest share of a vibration that is left anywhere along the axis.
    """

    axis: str
    position_mm: tuple[float, ...]
    times_s: tuple[tuple[float, ...], ...]
    amplitudes: tuple[tuple[float, ...], ...]
    worst_residual: float


@dataclass(frozen=True)
class UsedShaper:
    """The design of a conversion.

    Attributes:
        times_s: of the taps.
        amplitudes: of the taps.
        family: name of its family.
        duration_s: of the longest shaper that acts.
        per_axis: those of X, Y, Z that are used instead (`--per-axis`); else empty.
        per_axis_duration_s: how long such ones would be; null: not shorter, or not looked for.
        following: those that follow an axis; only where modes vary with its position.
    """

    times_s: tuple[float, ...]
    amplitudes: tuple[float, ...]
    family: str
    duration_s: float
    per_axis: tuple[GridTaps, ...]
    per_axis_duration_s: float | None
    following: FollowingShapers | None = field(default=None, metadata=sparse())


@dataclass(frozen=True)
class AppliedLimits:
    """The tolerances of the machine file that were applied.

    Attributes:
        contour_um: largest deviation from the programmed path.
        contour_target: of what: "response" or "command".
        residual_ratio: of the original's residual vibration.
        residual_floor_um: residual vibration below this passes.
        residual_floor_increments: likewise, in least increments.
        feed_excess_ratio: share by which the set-points may run faster than programmed.
        plant: behind which the programs were simulated, "modal" or "feed-drive".
        program_time_percent: largest increase of the program's time.
        cut_time_percent: largest increase of the time of one cut.
    """

    contour_um: float
    contour_target: str
    residual_ratio: float
    residual_floor_um: float
    residual_floor_increments: float
    feed_excess_ratio: float
    plant: str
    program_time_percent: float
    cut_time_percent: float


@dataclass(frozen=True)
class OverrideResidual:
    """Residual vibration of the emitted program at another feed override.

    Attributes:
        override: ratio, 0.9 = 90 %.
        residual_um: largest of all regions.
    """

    override: float
    residual_um: Xyz[float]


@dataclass(frozen=True)
class FrequencyResidual:
    """Residual vibration of the emitted program where every mode is off.

    Attributes:
        shift: by how many of their stated uncertainties, -1 or +1.
        residual_um: largest of all regions.
    """

    shift: float
    residual_um: Xyz[float]


@dataclass(frozen=True)
class CaseVerdict:
    """The emitted program in one case: what it leaves, beside the limit that it comes nearest to.

    Attributes:
        name: in words, unique.
        block_end: "ceil" or "carry"; null where look-ahead plans the blocks anew.
        override: feed override, 1 = 100 %.
        mode: that is off: "x.1" as in the machine file, "all", or null.
        shift: by how many of its stated uncertainties, -1 or +1.
        look_ahead: the controller's look-ahead stays on.
        starved_ms: how long the block buffer is empty once; 0: never.
        counts: it lies in the band that the machine file states.
        residual_um: largest of all regions.
        contour_error_um: largest of all regions; null where it was not measured.
        time_s: of all cuts; null where those left unchanged were not simulated.
        within: every region keeps its limits.
        figure: which figure takes the largest share of its limit.
        value_um: that figure.
        limit_um: its limit.
        share_of_limit: their ratio; null where nothing is allowed.
        lines: of the region that has it, first and last.
        gouge_um: largest deviation towards the workpiece; only where its side is known.
        excess_um: largest deviation away from it; likewise.
    """

    name: str
    block_end: str | None
    override: float
    mode: str | None
    shift: float
    look_ahead: bool
    starved_ms: float
    counts: bool
    residual_um: Xyz[float]
    contour_error_um: Tracks[float | None]
    time_s: float | None
    within: bool
    figure: str
    value_um: float
    limit_um: float
    share_of_limit: float | None
    lines: tuple[int, int]
    gouge_um: Tracks[float | None] | None = field(default=None, metadata=sparse())
    excess_um: Tracks[float | None] | None = field(default=None, metadata=sparse())


def worst_counted(cases: Sequence[CaseVerdict]) -> CaseVerdict | None:
    """The case that decides: of those that count the one with the largest share of a limit; None without cases."""
    counted = [case for case in cases if case.counts]
    shares = [math.inf if case.share_of_limit is None else case.share_of_limit for case in counted]
    return counted[shares.index(max(shares))] if counted else None


@dataclass(frozen=True)
class FeedExcess:
    """Where the emitted blocks are fastest against the feed that is programmed at the same position of the path.

    The speed is that of the set-points along their own path, over one, four or sixteen shortest blocks, less two
    increments by which rounding may lengthen it; positions are matched by path length, not by time.

    Attributes:
        ratio: speed over programmed feed; 1: as programmed.
        speed_mm_per_min: of the set-points.
        programmed_mm_per_min: at the same place.
        line: that programs this feed, of the original.
    """

    ratio: float
    speed_mm_per_min: float
    programmed_mm_per_min: float
    line: int

    def __str__(self) -> str:
        """For people."""
        return (
            f"runs at {self.speed_mm_per_min:.1f} mm/min where line {self.line} programs "
            f"{self.programmed_mm_per_min:.1f}, {(self.ratio - 1.0) * 100.0:.0f} % faster"
        )


@dataclass(frozen=True)
class RegionVerdict:
    """One cut as programmed and as emitted, beside its limits.

    Attributes:
        lines: of the original, first and last.
        emitted_lines: of the emitted program.
        time_s: until the set-points rest.
        residual_vibration_um: maximum of |table - command| while they rest; emitted: worse rule of block timing.
        residual_limit_um: what the emitted one is judged by.
        contour_error_um: of the emitted program, of what the tolerance is about.
        original_contour_error_um: likewise of the original.
        feed_excess: where shaped blocks run fastest against the programmed feed; null for a cut left unchanged.
        misses: every tolerance that it leaves, in words.
        worse: those of them in which it is worse than the original.
    """

    lines: tuple[int, int]
    emitted_lines: tuple[int, int]
    time_s: Pair[float]
    residual_vibration_um: Pair[Xyz[float]]
    residual_limit_um: Xyz[float]
    contour_error_um: float
    original_contour_error_um: float
    feed_excess: FeedExcess | None
    misses: tuple[str, ...]
    worse: tuple[str, ...] = ()

    def over_limit(self) -> Iterator[tuple[float, float]]:
        """Residual and limit of every axis that leaves its limit, um."""
        for left, limit in zip(self.residual_vibration_um.emitted, self.residual_limit_um, strict=True):
            if left > limit:
                yield left, limit


@dataclass(frozen=True, repr=False)
class ProgramFigures:
    """Every cut of a program, as programmed and as emitted, shaped or left unchanged.

    Emitted figures of shaped cuts are the worse of both rules of block timing.

    Attributes:
        residual_vibration_um: maximum of |table - command| from the instant at which the set-points rest.
        peak_vibration_um: maximum of |table - command| before that instant.
        contour_error_um: distance to the programmed path of command and table.
        rapid_vibration_um: maximum of |table - command| behind a rapid that a cut follows; it is held to no limit.
        orbit_error_percent: per arc: area between emitted command and arc over the area of its sector.
        override_residual: residual vibration of the shaped cuts at 80, 90, 110 and 120 %.
        frequency_residual: with every mode off by its uncertainty; empty where none states one.
        slowed_blocks: emitted blocks that step an axis by more than the corner limit of the look-ahead.
        feed_excess: where the emitted blocks run fastest against the programmed feed; null where nothing was shaped.
        cases: the operating conditions in which the emitted program was simulated; those that do not count are of the
            shaped cuts alone.
        worst_case: the one that decides; null without cuts.
        regions: the shaped cuts, in the order of the program.
        unchanged: the cuts left unchanged, likewise.
    """

    residual_vibration_um: Pair[Xyz[float]]
    peak_vibration_um: Pair[Xyz[float]]
    contour_error_um: Tracks[Pair[ContourError]]
    rapid_vibration_um: Pair[Xyz[float]]
    orbit_error_percent: tuple[float, ...]
    override_residual: tuple[OverrideResidual, ...]
    frequency_residual: tuple[FrequencyResidual, ...]
    slowed_blocks: int
    feed_excess: FeedExcess | None
    cases: tuple[CaseVerdict, ...]
    worst_case: CaseVerdict | None
    regions: tuple[RegionVerdict, ...]
    unchanged: tuple[RegionVerdict, ...]

    @property
    def all_cuts(self) -> list[RegionVerdict]:
        """Shaped or left unchanged, in the order of the program."""
        return sorted([*self.regions, *self.unchanged], key=lambda cut: cut.lines)

    @property
    def within_tolerance(self) -> bool:
        """Whether every cut, shaped or left unchanged, keeps its limits in every operating condition that counts."""
        return self.shaped_cuts_within and not any(cut.misses for cut in self.unchanged)

    @property
    def shaped_cuts_within(self) -> bool:
        """Whether the shaped cuts alone do."""
        return not any(cut.misses for cut in self.regions)

    def region_time_s(self) -> Pair[float]:
        """All cuts together, until the set-points rest."""
        cuts = self.all_cuts
        return Pair(math.fsum(cut.time_s.original for cut in cuts), math.fsum(cut.time_s.emitted for cut in cuts))
