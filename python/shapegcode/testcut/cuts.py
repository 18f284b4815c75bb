"""Draws up test cuts: which edge, which passes, which feeds.

Source: Y.-H. Kim, S.-L. Ko: Improvement of the Accuracy in Cornering Cut Using End Mill, 2001 (paper 001).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.errors import ArgumentError
from shapegcode.testcut.conditions import CornerShape, CutConditions
from shapegcode.testcut.cut import (
    CornerDetails,
    DeeperStretch,
    Deepest,
    IntervalDetails,
    MeasuringPass,
    TaperDetails,
    TestCut,
)
from shapegcode.testcut.design_result import CutDesign
from shapegcode.testcut.edges import Edge, left_edge, reduced, tool_path, unrolled_edge
from shapegcode.testcut.engagement import engagement, straight_engagement
from shapegcode.testcut.force import ForceLaw

__all__ = ["corner_cut", "interval_cut", "taper_cut"]

Array = npt.NDArray[np.float64]

_STATION_MM = 0.01
_FEW_UM = 1e-3  # mm
_SAME_MM = 1e-6

_Sizes = tuple[float, float, float]  # of a corner: allowance, rough and finish radius
_Block = tuple[float | None, float]  # X up to which a feed holds (None: the end of the pass), feed in mm/min


def taper_cut(
    given: CutConditions,
    feeds_mm_per_min: Sequence[float] | None = None,
    depths_mm: tuple[float, float] | None = None,
    length_mm: float = 60.0,
) -> CutDesign:
    """Straight passes along a tapered work piece (paper 001, figure 4): one per feed, for k1 and k2.

    Args:
        given: tool, spindle, axial depth, feed.
        feeds_mm_per_min: of the passes; None: the half, once and double of the given one.
        depths_mm: radial depth at the beginning and at the end of the stock; None: 0.05 and 0.35 of the diameter.
        length_mm: of the stock.

    Returns:
        The design, for `write_test_cut`.

    Raises:
        ArgumentError: what the tool or the machine cannot do.
    """
    feeds = feeds_mm_per_min or [given.feed_mm_per_min * share for share in (0.5, 1.0, 2.0)]
    given.check_feeds(feeds)
    low, high = depths_mm or (0.05 * given.diameter_mm, 0.35 * given.diameter_mm)
    given.check_depths(low, high)
    if low == high:
        raise ArgumentError(f"a taper with {low:g} mm at both ends: the radial depth must grow")
    if high - low > 0.2 * length_mm:
        raise ArgumentError(
            f"{length_mm:g} mm are too short for a taper of {high - low:g} mm: at least 5 times as long"
        )
    edge = Edge(np.array([0.0, length_mm]), np.array([_rounded(low), _rounded(high)]))
    passes = [(f"F{feed:g}", [(None, feed)]) for feed in feeds]
    return _drawn(given, edge, length_mm, passes, TaperDetails((low, high), length_mm))


def corner_cut(given: CutConditions, corner: CornerShape | None = None, interval_mm: float | None = None) -> CutDesign:
    """A corner unrolled on a straight line (paper 001, figure 7): a pass with constant and one with modified feed.

    Args:
        given: tool, spindle, axial depth, feed on the straight walls.
        corner: to unroll; None: case 1 of the paper.
        interval_mm: length of the blocks with a feed of their own; None: as the machine's feed control has it.

    Returns:
        The design, for `write_test_cut`.

    Raises:
        ArgumentError: the corner cannot be unrolled, or is more than the tool or the machine can do.
    """
    sizes = (corner or CornerShape()).sizes_mm(given.diameter_mm)
    interval = given.machine.feed_control.interval_mm if interval_mm is None else interval_mm
    constant: _Block = (None, given.feed_mm_per_min)
    given.check_feeds([given.feed_mm_per_min])
    radius = given.tool.radius_mm
    straight = max(10.0, 3.0 * radius)
    s, depth = _corner_depth(given, sizes)
    stock = math.ceil(2.0 * straight + float(s[-1]) + radius)
    wanted_edge = unrolled_edge(s, depth, radius, stock, straight)
    # What the round tool leaves is the edge that the passes meet: where the wanted one is hollow more sharply than
    # the tool is round, it stays higher.
    far = 3.0 * radius
    path = tool_path(wanted_edge, radius, -far, stock + far)
    edge = reduced(left_edge(path, radius, -radius, stock + radius), 1e-4)
    x = np.arange(0.0, stock - radius, _STATION_MM)
    probe = _measuring_pass(given, edge, stock, "probe", [constant])
    met = engagement(given.cut_tool(), probe, x, up=given.up).radial_depth_mm
    off = np.flatnonzero(np.abs(met - sizes[0]) > _FEW_UM)
    begin, end = _rounded(min(straight, float(x[off[0]]))), max(straight + float(s[-1]), float(x[off[-1]]))
    blocks = _blocks(x, _corner_feeds(given, met), interval, begin, end)
    given.check_feeds([feed for _, feed in blocks])
    about = CornerDetails(
        *sizes,
        interval_mm=interval,
        corner_begins_at_mm=straight,
        radial_depth_mm=Deepest(float(met.max()), float(x[int(np.argmax(met))])),
        deeper_than_corner=_stretch(x, met - np.interp(x, s + straight, depth)),
    )
    modified = [(begin, given.feed_mm_per_min), *blocks, constant]
    passes = [("CONSTANT FEED", [constant]), ("MODIFIED FEED", modified)]
    return _drawn(given, wanted_edge, stock, passes, about, met=edge)


def interval_cut(
    given: CutConditions,
    corner: CornerShape | None = None,
    intervals_mm: Sequence[float] = (0.2, 0.4, 0.6),
    feeds_mm_per_min: Sequence[float] | None = None,
) -> CutDesign:
    """Feeds that change every so often at a constant radial depth (paper 001, figure 8): one pass per interval.

    Args:
        given: tool, spindle, axial depth, feed before and after.
        corner: its allowance is the radial depth; None: case 1 of the paper.
        intervals_mm: length of the blocks of each pass.
        feeds_mm_per_min: of the blocks, the same for every pass; None: those of the corner (eq. 7).

    Returns:
        The design, for `write_test_cut`.

    Raises:
        ArgumentError: what the tool or the machine cannot do.
    """
    sizes = (corner or CornerShape()).sizes_mm(given.diameter_mm)
    depth, feed = sizes[0], given.feed_mm_per_min
    sequences = [feeds_mm_per_min or _corner_feed_sequence(given, sizes, step) for step in intervals_mm]
    given.check_feeds([feed, *(each for sequence in sequences for each in sequence)])
    given.check_depths(depth, depth)
    straight = max(10.0, 4.0 * given.tool.radius_mm)
    longest = max(len(feeds) * step for feeds, step in zip(sequences, intervals_mm, strict=True))
    stock = float(math.ceil(longest + 2.0 * straight))
    edge = Edge(np.array([0.0, stock]), np.array([_rounded(depth)] * 2))
    passes: list[tuple[str, list[_Block]]] = []
    for feeds, step in zip(sequences, intervals_mm, strict=True):
        steps = [(_rounded(straight + (k + 1) * step), round(each, 1)) for k, each in enumerate(feeds)]
        passes.append((f"FEED CHANGES EVERY {step:g} MM", [(straight, feed), *steps, (None, feed)]))
    return _drawn(given, edge, stock, passes, IntervalDetails(depth, tuple(intervals_mm), straight))


def _drawn(
    given: CutConditions,
    edge: Edge,
    stock_mm: float,
    passes: Sequence[tuple[str, Sequence[_Block]]],
    about: TaperDetails | CornerDetails | IntervalDetails,
    *,
    met: Edge | None = None,
) -> CutDesign:
    """The design of measuring passes over one edge."""
    kinds = {TaperDetails: "taper", CornerDetails: "corner", IntervalDetails: "interval"}
    warnings = []
    if isinstance(about, CornerDetails) and about.deeper_than_corner is not None:
        deeper = about.deeper_than_corner
        warnings.append(
            f"X {deeper.from_mm:.2f} to {deeper.to_mm:.2f} mm: the passes meet up to {deeper.most_mm:.3f} mm more than "
            "the corner: there its edge is hollow more sharply than the tool is round; the side file has what is met"
        )
    cut = TestCut(
        kind=kinds[type(about)],  # type: ignore[arg-type]
        program="",
        machine=given.machine.name,
        tool=given.cut_tool(),
        spindle_rev_per_min=given.spindle,
        axial_depth_mm=given.axial_depth_mm,
        milling="up" if given.up else "down",
        passes=tuple(_measuring_pass(given, met or edge, stock_mm, name, blocks) for name, blocks in passes),
        about=about,
    )
    return CutDesign(cut, (), tuple(warnings), edge, stock_mm, given.machine)


def _measuring_pass(
    given: CutConditions, edge: Edge, stock_mm: float, name: str, blocks: Sequence[_Block]
) -> MeasuringPass:
    """One pass over an edge, from air to air."""
    inside = (edge.x_mm > 0.0) & (edge.x_mm < stock_mm)
    x = np.concatenate([[0.0], edge.x_mm[inside], [stock_mm]])
    air = given.air_mm(max(feed for _, feed in blocks)) + given.tool.radius_mm
    end = round(stock_mm + air, 3)
    return MeasuringPass(
        name=name,
        start_mm=round(-air, 3),
        end_mm=end,
        edge_x_mm=tuple(x.tolist()),
        edge_height_mm=tuple(edge.at(x).tolist()),
        feeds=tuple((end if until is None else until, feed) for until, feed in blocks),
    )


def _corner_feeds(given: CutConditions, radial_depth_mm: Array) -> Array:
    """Feeds at which the mean resultant is that of the first depth (paper 001, eq. 7), mm/min."""
    tool = given.cut_tool()
    law = ForceLaw(tool, tool.cutting, given.spindle, given.axial_depth_mm)
    met = straight_engagement(tool, radial_depth_mm, up=given.up)
    force = law.forces(met, np.full(len(radial_depth_mm), given.feed_mm_per_min)).mean_resultant_n
    return np.asarray(given.feed_mm_per_min * force[0] / force)


def _blocks(x_mm: Array, feed: Array, interval_mm: float, begin: float, end: float) -> list[tuple[float, float]]:
    """_Blocks of one length, each with the least feed within it."""
    count = max(1, math.ceil((end - begin) / interval_mm - 1e-9))
    blocks = []
    for k in range(count):
        low, high = begin + k * interval_mm, begin + (k + 1) * interval_mm
        within = feed[(x_mm >= low - 1e-9) & (x_mm <= high + 1e-9)]
        blocks.append((_rounded(high), round(float(within.min()), 1)))
    return blocks


def _corner_depth(given: CutConditions, sizes: _Sizes) -> tuple[Array, Array]:
    """Distance along the corner's path from the beginning of S2 on, and the radial depth until it is constant again."""
    allowance, rough, finish = sizes
    before = 2.0 * (rough + finish)
    cut = _core.CornerCut(given.tool.radius_mm, rough, finish, allowance, before_mm=before, after_mm=before)
    low, high = 0.0, before
    while high - low > _SAME_MM:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if cut.at(middle).section == _core.CornerSection.s1 else (low, middle)
    s = np.arange(0.0, cut.length_mm - low, _STATION_MM)
    depth = np.array([cut.at(low + each).radial_depth_mm for each in s])
    off = np.flatnonzero(np.abs(depth - depth[0]) > _SAME_MM)
    if off.size == 0:
        raise ArgumentError("the radial depth of this corner does not change: nothing to unroll")
    last = min(int(off[-1]) + 2, len(s))
    return s[:last], depth[:last]


def _corner_feed_sequence(given: CutConditions, sizes: _Sizes, interval_mm: float) -> list[float]:
    """Feeds of a corner in blocks of one length, mm/min."""
    s, depth = _corner_depth(given, sizes)
    return [feed for _, feed in _blocks(s, _corner_feeds(given, depth), interval_mm, 0.0, float(s[-1]))]


def _stretch(x_mm: Array, excess_mm: Array) -> DeeperStretch | None:
    """Where the passes meet more than the corner has, by more than 1 µm."""
    off = np.flatnonzero(excess_mm > _FEW_UM)
    if off.size == 0:
        return None
    return DeeperStretch(float(x_mm[off[0]]), float(x_mm[off[-1]]), float(excess_mm.max()))


def _rounded(value: float) -> float:
    return round(value, 3)
