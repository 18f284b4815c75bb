"""Parts of a conversion's result: figures per case and per region, with their limits."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from shapegcode import _core
from shapegcode.program import Program
from shapegcode.results.json import OldNames, sparse
from shapegcode.results.outcome import ContourError, Pair, Tracks, Xyz

_LEAST_BETTER = 0.3  # relative reduction of a figure that counts as a benefit


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
    """Number of blocks of a program."""

    read: int  # of the original, expanded
    emitted: int  # shaped blocks that replace its regions


@dataclass(frozen=True)
class GridTaps:
    """A shaper on the grid of the blocks."""

    delays: tuple[int, ...]  # in whole block periods
    taps: tuple[float, ...]  # one for each delay


@dataclass(frozen=True)
class FollowingShapers:
    """Shapers along an axis, with which modes vary."""

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
    residual_um: Xyz[float]  # maximum over all regions


@dataclass(frozen=True)
class FrequencyResidual:
    """Residual vibration of the emitted program with every mode frequency shifted."""

    shift: float  # in units of their uncertainty, -1 or +1
    residual_um: Xyz[float]  # maximum over all regions


@dataclass(frozen=True)
class CaseVerdict(OldNames):
    """Verdict in one case: residual, and the figure closest to its limit."""

    name: str  # shown name, unique
    block_end: str | None  # "ceil" or "carry"; null if look-ahead replans the blocks
    override: float  # feed override, 1 = 100 %
    mode: str | None  # shifted mode: "x.1" as in the machine file, "all", or null
    shift: float  # in units of its uncertainty, -1 or +1
    look_ahead: bool  # the controller's look-ahead is left on
    underrun_ms: float  # duration of one buffer underrun; 0: none
    counts: bool  # it is within the range of the machine file
    residual_um: Xyz[float]  # maximum over all regions
    contour_error_um: Tracks[float | None]  # maximum over all regions; null if not measured
    time_s: float | None  # of all cuts; null if those left unchanged were not simulated
    within: bool  # every region keeps its limits
    figure: str  # the figure that is largest relative to its limit
    value_um: float  # that figure
    limit_um: float  # its limit
    share_of_limit: float | None  # their ratio; null if the limit is 0
    lines: tuple[int, int]  # first and last line of the region with this figure
    # largest deviation towards the workpiece; only if its side is known
    gouge_um: Tracks[float | None] | None = field(default=None, metadata=sparse())
    # largest deviation away from it; likewise
    excess_um: Tracks[float | None] | None = field(default=None, metadata=sparse())


def worst_counted(cases: Sequence[CaseVerdict]) -> CaseVerdict | None:
    """The deciding case: of those that count, the one with the largest ratio to a limit; None without cases."""
    counted = [case for case in cases if case.counts]
    shares = [math.inf if case.share_of_limit is None else case.share_of_limit for case in counted]
    return counted[shares.index(max(shares))] if counted else None


@dataclass(frozen=True)
class FeedExcess:
    """Largest ratio of the emitted speed to the programmed feed at the same position of the path.

    The speed is that of the set-points along their own path, averaged over one, four or sixteen shortest blocks; two
    increments are subtracted, by which rounding may lengthen them. Positions are matched by path length, not by time.
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
        """True if a missed figure or a vibration falls by the least gain, and by 30 % or to within its limit."""
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

    Emitted figures of shaped cuts are for the worse rule of block timing.
    """

    # maximum of |table - command| from the instant at which the set-points rest
    residual_vibration_um: Pair[Xyz[float]]
    peak_vibration_um: Pair[Xyz[float]]  # maximum of |table - command| before that instant
    contour_error_um: Tracks[Pair[ContourError]]  # distance to the programmed path of command and table
    # maximum of |table - command| after a rapid before a cut; no limit applies
    rapid_vibration_um: Pair[Xyz[float]]
    orbit_error_percent: tuple[float, ...]  # per arc: area between emitted command and arc over the area of its sector
    override_residual: tuple[OverrideResidual, ...]  # residual vibration of the shaped cuts at 80, 90, 110 and 120 %
    # with every mode shifted by its uncertainty; empty if there is none
    frequency_residual: tuple[FrequencyResidual, ...]
    slowed_blocks: int  # emitted blocks whose speed step of an axis exceeds the corner limit of the look-ahead
    # largest ratio of emitted speed to programmed feed; null if nothing was shaped
    feed_excess: FeedExcess | None
    # the simulated operating conditions; those that do not count include only the shaped
    # cuts
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
