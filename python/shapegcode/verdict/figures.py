"""The parts of a conversion's result: what was simulated, per case and per region, beside its limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from shapegcode import _core
from shapegcode.program import Program
from shapegcode.results.json import OldNames, sparse
from shapegcode.results.outcome import ContourError, Pair, Tracks, Xyz

_LEAST_BETTER = 0.3  # share by which a figure must fall to count as a benefit


@dataclass(frozen=True)
class Placed:
    """A region and the lines of its shaped blocks in the emitted program."""

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
    """How many blocks a program has."""

    read: int  # of the original, expanded
    emitted: int  # shaped ones that replace its regions


@dataclass(frozen=True)
class GridTaps:
    """A shaper on the grid of the blocks."""

    delays: tuple[int, ...]  # in whole block periods
    taps: tuple[float, ...]  # one for each delay


@dataclass(frozen=True)
class FollowingShapers:
    """Shapers along an axis, with which modes vary."""

    axis: str  # "x", "y" or "z"
    position_mm: tuple[float, ...]  # where each of them holds exactly (machine coordinates)
    times_s: tuple[tuple[float, ...], ...]  # taps of each
    amplitudes: tuple[tuple[float, ...], ...]  # likewise
    worst_residual: float  # largest share of a vibration that is left anywhere along the axis


@dataclass(frozen=True)
class UsedShaper:
    """The design of a conversion."""

    times_s: tuple[float, ...]  # of the taps
    amplitudes: tuple[float, ...]  # of the taps
    family: str  # name of its family
    duration_s: float  # of the longest shaper that acts
    per_axis: tuple[GridTaps, ...]  # those of X, Y, Z that are used instead (`--per-axis`); else empty
    per_axis_duration_s: float | None  # how long such ones would be; null: not shorter, or not looked for
    # those that follow an axis; only where modes vary with its position
    following: FollowingShapers | None = field(default=None, metadata=sparse())


@dataclass(frozen=True)
class AppliedLimits:
    """The tolerances of the machine file that were applied."""

    contour_um: float  # largest deviation from the programmed path
    contour_target: str  # of what: "response" or "command"
    residual_ratio: float  # of the original's residual vibration
    residual_floor_um: float  # residual vibration below this passes
    residual_floor_increments: float  # likewise, in least increments
    feed_excess_ratio: float  # share by which the set-points may run faster than programmed
    plant: str  # behind which the programs were simulated, "modal" or "feed-drive"
    program_time_percent: float  # largest increase of the program's time
    cut_time_percent: float  # largest increase of the time of one cut


@dataclass(frozen=True)
class OverrideResidual:
    """Residual vibration of the emitted program at another feed override."""

    override: float  # ratio, 0.9 = 90 %
    residual_um: Xyz[float]  # largest of all regions


@dataclass(frozen=True)
class FrequencyResidual:
    """Residual vibration of the emitted program where every mode is off."""

    shift: float  # by how many of their stated uncertainties, -1 or +1
    residual_um: Xyz[float]  # largest of all regions


@dataclass(frozen=True)
class CaseVerdict(OldNames):
    """The emitted program in one case: residual and the figure nearest to its limit."""

    name: str  # in words, unique
    block_end: str | None  # "ceil" or "carry"; null where look-ahead plans the blocks anew
    override: float  # feed override, 1 = 100 %
    mode: str | None  # that is off: "x.1" as in the machine file, "all", or null
    shift: float  # by how many of its stated uncertainties, -1 or +1
    look_ahead: bool  # the controller's look-ahead stays on
    underrun_ms: float  # how long the block buffer is empty once (buffer underrun); 0: never
    counts: bool  # it lies in the band that the machine file states
    residual_um: Xyz[float]  # largest of all regions
    contour_error_um: Tracks[float | None]  # largest of all regions; null where it was not measured
    time_s: float | None  # of all cuts; null where those left unchanged were not simulated
    within: bool  # every region keeps its limits
    figure: str  # which figure takes the largest share of its limit
    value_um: float  # that figure
    limit_um: float  # its limit
    share_of_limit: float | None  # their ratio; null where nothing is allowed
    lines: tuple[int, int]  # of the region that has it, first and last
    # largest deviation towards the workpiece; only where its side is known
    gouge_um: Tracks[float | None] | None = field(default=None, metadata=sparse())
    # largest deviation away from it; likewise
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
    """

    ratio: float  # speed over programmed feed; 1: as programmed
    speed_mm_per_min: float  # of the set-points
    programmed_mm_per_min: float  # at the same place
    line: int  # that programs this feed, of the original

    def __str__(self) -> str:
        return (
            f"runs at {self.speed_mm_per_min:.1f} mm/min where line {self.line} programs "
            f"{self.programmed_mm_per_min:.1f}, {(self.ratio - 1.0) * 100.0:.0f} % faster"
        )


@dataclass(frozen=True)
class RegionVerdict:
    """One cut as programmed and as emitted, beside its limits."""

    lines: tuple[int, int]  # of the original, first and last
    emitted_lines: tuple[int, int]  # of the emitted program
    time_s: Pair[float]  # until the set-points rest
    # maximum of |table - command| while they rest; emitted: worse rule of block timing
    residual_vibration_um: Pair[Xyz[float]]
    residual_limit_um: Xyz[float]  # what the emitted one is judged by
    contour_error_um: float  # of the emitted program, of what the tolerance is about
    original_contour_error_um: float  # likewise of the original
    # where shaped blocks run fastest against the programmed feed; null for a cut left unchanged
    feed_excess: FeedExcess | None
    misses: tuple[str, ...]  # every tolerance that it leaves, in words
    worse: tuple[str, ...] = ()  # those of them in which it is worse than the original

    def is_benefit(self, contour_limit_um: float, least_gain_um: float) -> bool:
        """Whether a figure that missed its limit, or vibrates, falls by the least gain and by 30 % or to the limit."""
        pairs = [(self.original_contour_error_um, self.contour_error_um, contour_limit_um, contour_limit_um)]
        residual = self.residual_vibration_um
        pairs += [
            (before, after, limit, min(limit, least_gain_um))
            for before, after, limit in zip(residual.original, residual.emitted, self.residual_limit_um, strict=True)
        ]
        return any(
            before > threshold
            and before - after >= least_gain_um
            and (after <= (1.0 - _LEAST_BETTER) * before or (before > limit >= after))
            for before, after, limit, threshold in pairs
        )


@dataclass(frozen=True, repr=False)
class ProgramFigures:
    """Every cut of a program, as programmed and as emitted, shaped or left unchanged.

    Emitted figures of shaped cuts are the worse of both rules of block timing.
    """

    # maximum of |table - command| from the instant at which the set-points rest
    residual_vibration_um: Pair[Xyz[float]]
    peak_vibration_um: Pair[Xyz[float]]  # maximum of |table - command| before that instant
    contour_error_um: Tracks[Pair[ContourError]]  # distance to the programmed path of command and table
    # maximum of |table - command| behind a rapid that a cut follows; it is held to no limit
    rapid_vibration_um: Pair[Xyz[float]]
    orbit_error_percent: tuple[float, ...]  # per arc: area between emitted command and arc over the area of its sector
    override_residual: tuple[OverrideResidual, ...]  # residual vibration of the shaped cuts at 80, 90, 110 and 120 %
    # with every mode off by its uncertainty; empty where none states one
    frequency_residual: tuple[FrequencyResidual, ...]
    slowed_blocks: int  # emitted blocks that step an axis by more than the corner limit of the look-ahead
    # where the emitted blocks run fastest against the programmed feed; null where nothing was shaped
    feed_excess: FeedExcess | None
    # the operating conditions in which the emitted program was simulated; those that do not count are of the shaped
    # cuts alone
    cases: tuple[CaseVerdict, ...]
    worst_case: CaseVerdict | None  # the one that decides; null without cuts
    regions: tuple[RegionVerdict, ...]  # the shaped cuts, in the order of the program
    unchanged: tuple[RegionVerdict, ...]  # the cuts left unchanged, likewise

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
