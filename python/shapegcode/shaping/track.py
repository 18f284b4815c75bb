"""Shapers that follow modes along an axis: one design per node, interpolated linearly (`_core.FollowingFir`).

If the grid permits, all have the same mean delay, so that the speed along the path does not change.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from shapegcode._core import ArgumentError, DesignError, Fir, FollowingFir, Mode, ModeTable, Shaper, VaryingFir
from shapegcode.io.units import FloatArray
from shapegcode.shaping.bands import check_modes_and_times, check_times, whole_periods
from shapegcode.shaping.cutting_planes import LinearProgram
from shapegcode.shaping.grid_designs import RESIDUAL_LIMIT, exact_conditions, refined, shortest_non_negative

_LOOKS = 16  # steps from node to node; the residual is checked between them
_SUPPORT = 1e-9  # smaller amplitudes are no taps
_LONGER = 1.3  # factor by which a common mean delay may lengthen shapers
_SAME_MEAN = 1e-9  # periods
NodeDesign = Callable[[Sequence[Mode]], Shaper]
_MEANS = 9  # number of compared mean delays
_POINT = 1e-8  # periods: means closer than this are equal


def shaper_fir(shaper: Shaper, period_s: float) -> Fir:
    """Convert a shaper to a filter in whole periods of its grid."""
    return Fir([round(time / period_s) for time in shaper.times_s], list(shaper.amplitudes))


@dataclass(frozen=True)
class MovingMode:
    """A mode and its variation with the position of the followed axis."""

    mode: Mode  # nominal frequency and damping
    table: ModeTable | None = None  # over the axis' position; None: constant

    def at(self, position_mm: float) -> Mode:
        """The mode at an axis position."""
        return self.mode if self.table is None else self.table.mode_at(self.mode, position_mm)


@dataclass(frozen=True)
class TrackNode:
    """A position of the axis and the shaper for it."""

    position_mm: float  # axis position, in the coordinates of the tables
    modes: tuple[Mode, ...]  # modes cancelled at this position
    shaper: Shaper  # the taps, on the grid


@dataclass(frozen=True)
class ShaperTrack:
    """Shapers along an axis."""

    axis: int  # 0, 1, 2 for X, Y, Z
    period_s: float  # grid of all shapers, s
    nodes: tuple[TrackNode, ...]  # at ascending positions
    worst_residual: float  # largest residual ratio of any mode anywhere on the track

    @property
    def duration_s(self) -> float:
        """Time of the last impulse of the longest shaper, s."""
        return max(node.shaper.duration_s for node in self.nodes)

    @cached_property
    def filters(self) -> VaryingFir:
        """The shapers as filters whose delays are whole periods."""
        return VaryingFir([shaper_fir(node.shaper, self.period_s) for node in self.nodes])

    def following(self, offset_mm: float = 0.0) -> FollowingFir:
        """Filter that follows the axis."""
        return FollowingFir(self.filters, self.axis, [node.position_mm - offset_mm for node in self.nodes])


def design_track(
    modes: Sequence[MovingMode],
    axis: int,
    span_mm: tuple[float, float],
    period_s: float,
    max_duration_s: float = 0.25,
    *,
    residual_limit: float = 0.01,
    max_nodes: int = 100,
    design: NodeDesign | None = None,
) -> ShaperTrack:
    """Design shapers along an axis with every mode's residual below a limit, also between the nodes."""
    low, high = span_mm
    check_modes_and_times(modes)
    if not (math.isfinite(low) and math.isfinite(high) and low <= high):
        raise ArgumentError(f"span is {low} to {high} mm: must be finite and ascend")
    if not residual_limit > 0.0:
        raise ArgumentError(f"residual limit is {residual_limit}: must be above 0")
    tables = [moving.table for moving in modes if moving.table is not None]
    if any(table.axis != axis for table in tables):
        names = sorted({"XYZ"[table.axis] for table in tables})
        raise ArgumentError(f"modes depend on the positions of {' and '.join(names)}: shapers can follow one axis")
    rows = {row for table in tables for row in table.position_mm if low < row < high}
    positions = sorted({low, high} | rows)
    while True:
        found = [tuple(moving.at(position) for moving in modes) for position in positions]
        shapers = [design(here) for here in found] if design else _equal_means(found, period_s, max_duration_s)
        nodes = [TrackNode(*each) for each in zip(positions, found, shapers, strict=True)]
        residuals = [_worst_between(left, right, modes) for left, right in pairwise(nodes)]
        middles = [
            0.5 * (left + right)
            for (left, right), residual in zip(pairwise(positions), residuals, strict=True)
            if residual > residual_limit
        ]
        if not middles:
            ends = max(node.shaper.residual_ratio(mode) for node in nodes for mode in node.modes)
            return ShaperTrack(axis, period_s, tuple(nodes), max([ends, *residuals]))
        if len(positions) + len(middles) > max_nodes:
            raise DesignError(
                f"{len(positions)} shapers between {low:g} and {high:g} mm have a residual up to {max(residuals):.3g}, "
                f"limit {residual_limit:g}; more than {max_nodes} are not tried"
            )
        positions = sorted([*positions, *middles])


def shaper_of_mean(modes: Sequence[Mode], period_s: float, periods: int, mean_s: float) -> Shaper | None:
    """Non-negative shaper with a given mean delay and zero residual at every mode, of least second central moment."""
    found = taps_of_mean(modes, period_s, periods, mean_s)
    return None if found is None or found[0][0] != 0 else found[2]


def taps_of_mean(
    modes: Sequence[Mode], period_s: float, periods: int, mean_s: float
) -> tuple[NDArray[np.intp], FloatArray, Shaper] | None:
    """Delays in periods and taps as in `shaper_of_mean`; and their shaper, moved so that its times begin at 0."""
    steps = np.arange(periods + 1.0)
    matrix, right = exact_conditions(modes, period_s, periods)
    matrix = np.vstack([matrix, steps / periods])
    right = np.append(right, mean_s / period_s / periods)
    cost = steps**2 / periods**2
    taps = _vertices(matrix, right, cost)[0]
    if taps is None:
        return None
    support = np.flatnonzero(taps > _SUPPORT)
    taps = refined(matrix[:, support], right, taps[support])
    if not (np.all(taps > 0.0) and abs(taps.sum() - 1.0) <= RESIDUAL_LIMIT):
        return None
    taps = taps / taps.sum()
    # A mode's residual does not depend on the time of the first tap.
    shaper = Shaper(((support - support[0]) * period_s).tolist(), taps.tolist())
    exact = max(shaper.residual_ratio(mode) for mode in modes) <= RESIDUAL_LIMIT
    return (support, taps, shaper) if exact else None


def _vertices(matrix: FloatArray, right: FloatArray, *costs: FloatArray) -> list[FloatArray | None]:
    """For each cost vector: non-negative taps of least cost that meet the conditions; None: there are none."""
    count = matrix.shape[1]
    program = LinearProgram(np.zeros(count), np.full(count, math.inf), (matrix, right))
    found: list[FloatArray | None] = []
    for cost in costs:
        program.set_cost(cost)
        try:
            found.append(program.solve())
        except DesignError:
            found.append(None)
    return found


def _equal_means(found: Sequence[Sequence[Mode]], period_s: float, max_duration_s: float) -> list[Shaper]:
    """One shaper for each set of modes, all with the same mean delay; without a common one the shortest shapers."""
    shortest = [shortest_non_negative(modes, period_s, max_duration_s) for modes in found]
    fewest = max(round(shaper.duration_s / period_s) for shaper in shortest)
    most = min(whole_periods(max_duration_s, period_s), math.ceil(_LONGER * fewest))
    for periods in range(fewest, most + 1):
        ranges = [mean_range(modes, period_s, periods) for modes in found]
        least = max(low for low, _ in ranges)
        largest = min(high for _, high in ranges)
        if least <= largest:
            usual = sum(shaper.mean_s for shaper in shortest) / len(shortest) / period_s
            mean = min(max(usual, least), largest)
            designs = [shaper_of_mean(modes, period_s, periods, mean * period_s) for modes in found]
            whole = [shaper for shaper in designs if shaper is not None]
            if len(whole) == len(found):
                return whole
    return shortest


def mean_range(modes: Sequence[Mode], period_s: float, periods: int) -> tuple[float, float]:
    """Smallest and largest mean delay of non-negative exact shapers, in periods; (inf, -inf): there are none."""
    steps = np.arange(periods + 1.0)
    matrix, right = exact_conditions(modes, period_s, periods)
    least, largest = _vertices(matrix, right, steps / periods, -steps / periods)
    if least is None or largest is None:
        return math.inf, -math.inf
    return float(steps @ least) + _SAME_MEAN, float(steps @ largest) - _SAME_MEAN


def _worst_between(left: TrackNode, right: TrackNode, modes: Sequence[MovingMode]) -> float:
    """Largest residual ratio of any mode at positions between two nodes, where their shapers are interpolated."""
    times = sorted({*left.shaper.times_s.tolist(), *right.shaper.times_s.tolist()})
    first, second = (
        np.array([dict(zip(s.times_s.tolist(), s.amplitudes.tolist(), strict=True)).get(t, 0.0) for t in times])
        for s in (left.shaper, right.shaper)
    )
    worst = 0.0
    for share in np.arange(1, _LOOKS) / _LOOKS:
        mixed = Shaper(times, ((1.0 - share) * first + share * second).tolist())
        position = left.position_mm + float(share) * (right.position_mm - left.position_mm)
        worst = max(worst, *(mixed.residual_ratio(moving.at(position)) for moving in modes))
    return worst


def design_per_axis(axis_modes: Sequence[Sequence[Mode]], period_s: float, max_duration_s: float) -> list[Fir] | None:
    """Shortest non-negative filters, one per axis, with a common mean delay and zero residual at the axis' own modes.

    The longest filter is as short as the grid permits. Nine mean delays that are possible for all axes are compared;
    the one with the smallest sum of the filters' second central moments is chosen. An axis without modes is only
    delayed. None: no such filters exist within `max_duration_s`.
    """
    if not any(axis_modes):
        raise ArgumentError("shapers for each axis need at least one mode: 0 given")
    check_times(period_s=period_s)
    shaken = [list(modes) for modes in axis_modes if modes]
    for periods in range(1, whole_periods(max_duration_s, period_s) + 1):
        ranges = [mean_range(modes, period_s, periods) for modes in shaken]
        least, largest = max(low for low, _ in ranges), min(high for _, high in ranges)
        if least > largest + _POINT:
            continue
        if least > largest:  # a single mean, within the rounding of both ends
            least = largest = 0.5 * (least + largest)
        found = [
            filters
            for mean in np.linspace(least, largest, _MEANS)
            if (filters := _of_mean(axis_modes, period_s, periods, float(mean))) is not None
        ]
        if found:
            return min(found, key=lambda filters: sum(each.variance_samples2 for each in filters))
    return None


def _of_mean(axis_modes: Sequence[Sequence[Mode]], period_s: float, periods: int, mean: float) -> list[Fir] | None:
    """One filter per axis with a mean delay of `mean` periods, or None."""
    filters = []
    for modes in axis_modes:
        if not modes:
            whole = math.floor(mean)
            share = mean - whole
            filters.append(Fir([whole, whole + 1], [1.0 - share, share]) if share > 0.0 else Fir([whole], [1.0]))
            continue
        found = taps_of_mean(modes, period_s, periods, mean * period_s)
        if found is None:
            return None
        filters.append(Fir(found[0].tolist(), found[1].tolist()))
    return filters
