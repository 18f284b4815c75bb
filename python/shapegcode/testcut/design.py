"""Draws up test cuts: which edge, which passes, which feeds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode._core import ArgumentError
from shapegcode.testcut.edges import Edge, left_edge, reduced, tool_path, unrolled_edge
from shapegcode.testcut.force import COEFFICIENTS, ForceLaw
from shapegcode.testcut.plan import CutTool, MeasuringPass, TestCut, engagement, straight_engagement

if TYPE_CHECKING:
    from shapegcode.cutting.tool import Tool
    from shapegcode.machine import Machine

__all__ = [
    "Conditions",
    "Corner",
    "Design",
    "corner_cut",
    "corner_feed_sequence",
    "corner_feeds",
    "interval_cut",
    "taper_cut",
]

Array = npt.NDArray[np.float64]

_LEAST_AIR_MM = 5.0
_AIR_REVS = 20.0
_LARGEST_SHARE = 0.95  # of the radius, up to which a radial depth is taken
_STATION_MM = 0.01
_FEW_UM = 1e-3  # mm
_SAME_MM = 1e-6


@dataclass(frozen=True)
class Conditions:
    """What every test cut needs to know.

    Attributes:
        machine: whose controller runs the program.
        tool: the tool file.
        spindle_rev_per_min: of every pass.
        feed_mm_per_min: of the measuring passes; of a corner that of its straight part.
        axial_depth_mm: of every pass.
        up: up milling, the material on the left of the feed.
    """

    machine: Machine
    tool: Tool
    spindle_rev_per_min: float
    feed_mm_per_min: float
    axial_depth_mm: float
    up: bool = False

    def cut_tool(self) -> CutTool:
        """The tool as the side file holds it."""
        cutter, law = self.tool.tool, self.tool.coefficients()
        cutting: dict[str, Any] = {name: getattr(law, name) for name in COEFFICIENTS}
        cutting["chip_thickness"] = law.thickness.name
        runout = tuple(0.001 * value for value in cutter.runout_um or ())
        return CutTool(cutter.diameter_mm, cutter.flutes, cutter.helix_deg, runout, cutting)

    def air_mm(self, feed_mm_per_min: float) -> float:
        """How far a pass goes through the air at both ends."""
        return max(_LEAST_AIR_MM, math.ceil(_AIR_REVS * feed_mm_per_min / self.spindle_rev_per_min))

    def check(self, feeds: Sequence[float]) -> None:
        """Refuse what the machine or the tool cannot do.

        Raises:
            ArgumentError: a feed outside of the machine's, an axial depth beyond the flutes, a spindle that turns left.
        """
        most = self.machine.axes.x.max_feed_mm_per_min
        least = self.machine.controller.minimum_feed_mm_per_min
        for feed in feeds:
            if not least <= feed <= most:
                raise ArgumentError(f"a feed of {feed:g} mm/min: this machine takes {least:g} to {most:g} mm/min")
        if self.axial_depth_mm > self.tool.tool.flute_length_mm:
            raise ArgumentError(
                f"an axial depth of {self.axial_depth_mm:g} mm: the flutes are {self.tool.tool.flute_length_mm:g} mm "
                "long"
            )
        if self.tool.sense() != _core.SpindleSense.clockwise:
            raise ArgumentError("the tool turns counter-clockwise: test cuts are written for M03 only")


@dataclass(frozen=True)
class Corner:
    """An inside corner between two straight walls at a right angle (paper 001, figure 1).

    Attributes:
        allowance_mm: radial depth on the walls.
        rough_radius_mm: of the corner that roughing left.
        finish_radius_mm: of the finished corner.
    """

    allowance_mm: float
    rough_radius_mm: float
    finish_radius_mm: float


@dataclass(frozen=True, eq=False)
class Design:
    """A test cut with what its program needs beyond the side file.

    Attributes:
        cut: what the side file holds.
        edges: the edge to be milled before each pass.
        stock_mm: length of the stock along X.
        wanted: (2, n) of a corner X and the radial depth that the passes should meet; else empty.
    """

    cut: TestCut
    edges: tuple[Edge, ...]
    stock_mm: float
    wanted: Array


def _cut(kind: str, given: Conditions, passes: Sequence[MeasuringPass], about: dict[str, Any]) -> TestCut:
    return TestCut(
        kind,
        "",
        given.machine.name,
        given.cut_tool(),
        given.spindle_rev_per_min,
        given.axial_depth_mm,
        "up" if given.up else "down",
        tuple(passes),
        about,
    )


def _passes_through(given: Conditions, edge: Edge, stock_mm: float, names: Sequence[str], feeds: Any) -> Any:
    """Measuring passes over the same edge; *feeds* is for each a list of (end, feed), None for the end of the pass."""
    radius = given.tool.radius_mm
    inside = (edge.x_mm > 0.0) & (edge.x_mm < stock_mm)
    x = np.concatenate([[0.0], edge.x_mm[inside], [stock_mm]])
    height = edge.at(x)
    for name, blocks in zip(names, feeds, strict=True):
        air = given.air_mm(max(feed for _, feed in blocks)) + radius
        start, end = _rounded(-air), _rounded(stock_mm + air)
        ends = tuple((end if x_end is None else x_end, feed) for x_end, feed in blocks)
        yield MeasuringPass(name, start, end, tuple(map(float, x)), tuple(map(float, height)), ends)


def _rounded(value: float) -> float:
    return round(value, 3)


def taper_cut(given: Conditions, feeds: Sequence[float], depths_mm: tuple[float, float], length_mm: float) -> Design:
    """Straight passes along a tapered work piece (paper 001, figure 4): one per feed, for k1 and k2.

    Args:
        given: tool, spindle, axial depth.
        feeds: of the passes, mm/min.
        depths_mm: radial depth at the beginning and at the end of the stock.
        length_mm: of the stock.

    Returns:
        The passes, feeds in mm/min.

    Raises:
        ArgumentError: what the tool or the machine cannot do.
    """
    given.check(feeds)
    radius = given.tool.radius_mm
    low, high = depths_mm
    if not 0.0 < low < high <= _LARGEST_SHARE * radius:
        raise ArgumentError(
            f"radial depths from {low:g} to {high:g} mm: must ascend, above 0, at most {_LARGEST_SHARE * radius:g} mm"
        )
    if high - low > 0.2 * length_mm:
        raise ArgumentError(
            f"{length_mm:g} mm are too short for a taper of {high - low:g} mm: at least 5 times as long"
        )
    edge = Edge(np.array([0.0, length_mm]), np.array([_rounded(low), _rounded(high)]))
    passes = _passes_through(given, edge, length_mm, [f"F{feed:g}" for feed in feeds], [[(None, f)] for f in feeds])
    cut = _cut("taper", given, list(passes), {"radial_depth_mm": [low, high], "length_mm": length_mm})
    return Design(cut, (edge,) * len(feeds), length_mm, np.empty((2, 0)))


def corner_feeds(given: Conditions, radial_depth_mm: Array) -> Array:
    """Feeds at which the mean resultant is that of the first depth (paper 001, eq. 7), mm/min.

    Args:
        given: tool, spindle, axial depth, feed of the first depth.
        radial_depth_mm: (n,).

    Returns:
        Feeds in mm/min, one per depth.
    """
    tool = given.cut_tool()
    law = ForceLaw(tool, tool.cutting, given.spindle_rev_per_min, given.axial_depth_mm)
    met = straight_engagement(tool, radial_depth_mm, up=given.up)
    force = law.forces(met, np.full(len(radial_depth_mm), given.feed_mm_per_min)).mean_resultant_n
    return np.asarray(given.feed_mm_per_min * force[0] / force)


def _blocks(x_mm: Array, feed: Array, interval_mm: float, begin: float, end: float) -> list[tuple[float, float]]:
    """Blocks of one length, each with the least feed within it."""
    count = max(1, math.ceil((end - begin) / interval_mm - 1e-9))
    blocks = []
    for k in range(count):
        low, high = begin + k * interval_mm, begin + (k + 1) * interval_mm
        within = feed[(x_mm >= low - 1e-9) & (x_mm <= high + 1e-9)]
        blocks.append((_rounded(high), round(float(within.min()), 1)))
    return blocks


def _corner_depth(given: Conditions, corner: Corner) -> tuple[Array, Array]:
    """Distance along the corner's path from the beginning of S2 on, and the radial depth until it is constant again.

    Raises:
        ArgumentError: not a corner, or none that changes the radial depth.
    """
    before = 2.0 * (corner.rough_radius_mm + corner.finish_radius_mm)
    cut = _core.CornerCut(
        given.tool.radius_mm,
        corner.rough_radius_mm,
        corner.finish_radius_mm,
        corner.allowance_mm,
        before_mm=before,
        after_mm=before,
    )
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


def corner_feed_sequence(given: Conditions, corner: Corner, interval_mm: float) -> list[float]:
    """Feeds of a corner (eq. 7) in blocks of one length, mm/min.

    Raises:
        ArgumentError: as for :func:`corner_cut`.
    """
    s, depth = _corner_depth(given, corner)
    return [feed for _, feed in _blocks(s, corner_feeds(given, depth), interval_mm, 0.0, float(s[-1]))]


def corner_cut(given: Conditions, corner: Corner, interval_mm: float) -> Design:
    """A corner unrolled on a straight line (paper 001, figure 7): a pass with constant and one with modified feed.

    Args:
        given: tool, spindle, axial depth, feed on the straight walls.
        corner: to unroll.
        interval_mm: length of the blocks with a feed of their own.

    Returns:
        The two passes, feeds in mm/min.

    Raises:
        ArgumentError: the corner cannot be unrolled, or is more than the tool or the machine can do.
    """
    given.check([given.feed_mm_per_min])
    radius = given.tool.radius_mm
    straight = max(10.0, 3.0 * radius)
    s, depth = _corner_depth(given, corner)
    stock = math.ceil(2.0 * straight + float(s[-1]) + radius)
    wanted_edge = unrolled_edge(s, depth, radius, stock, straight)
    # What the round tool leaves is the edge that the passes meet: where the wanted one is hollow more sharply than
    # the tool is round, it stays higher.
    far = 3.0 * radius
    path = tool_path(wanted_edge, radius, -far, stock + far)
    edge = reduced(left_edge(path, radius, -radius, stock + radius), 1e-4)
    x = np.arange(0.0, stock - radius, _STATION_MM)
    probe = _passes_through(given, edge, stock, ["probe"], [[(None, given.feed_mm_per_min)]])
    cut = _cut("corner", given, list(probe), {})
    met = engagement(cut, cut.passes[0], x).radial_depth_mm
    wanted = np.interp(x, s + straight, depth)
    off = np.flatnonzero(np.abs(met - corner.allowance_mm) > _FEW_UM)
    begin, end = _rounded(min(straight, float(x[off[0]]))), max(straight + float(s[-1]), float(x[off[-1]]))
    blocks = [(begin, given.feed_mm_per_min), *_blocks(x, corner_feeds(given, met), interval_mm, begin, end)]
    given.check([feed for _, feed in blocks])
    programs = [[(None, given.feed_mm_per_min)], [*blocks, (None, given.feed_mm_per_min)]]
    names = ["CONSTANT FEED", "MODIFIED FEED"]
    about = {
        "allowance_mm": corner.allowance_mm,
        "rough_radius_mm": corner.rough_radius_mm,
        "finish_radius_mm": corner.finish_radius_mm,
        "interval_mm": interval_mm,
        "corner_begins_at_mm": straight,
        "radial_depth_mm": {"max": float(met.max()), "at_mm": float(x[int(np.argmax(met))])},
        "deeper_than_corner": _stretch(x, met - wanted),
    }
    cut = _cut("corner", given, list(_passes_through(given, edge, stock, names, programs)), about)
    return Design(cut, (wanted_edge, wanted_edge), stock, np.vstack([x, wanted]))


def _stretch(x_mm: Array, excess_mm: Array) -> dict[str, float] | None:
    """Where the passes meet more than the corner has, by more than 1 µm."""
    off = np.flatnonzero(excess_mm > _FEW_UM)
    if off.size == 0:
        return None
    return {
        "from_mm": float(x_mm[off[0]]),
        "to_mm": float(x_mm[off[-1]]),
        "most_mm": float(excess_mm.max()),
    }


def interval_cut(
    given: Conditions, depth_mm: float, intervals_mm: Sequence[float], sequences: Sequence[Sequence[float]]
) -> Design:
    """Feeds that change every so often at a constant radial depth (paper 001, figure 8): one pass per interval.

    Args:
        given: tool, spindle, axial depth, feed before and after.
        depth_mm: radial depth.
        intervals_mm: length of the blocks of each pass.
        sequences: feeds of the blocks of each pass, mm/min.

    Returns:
        The passes, feeds in mm/min.

    Raises:
        ArgumentError: what the tool or the machine cannot do.
    """
    given.check([given.feed_mm_per_min, *(feed for sequence in sequences for feed in sequence)])
    radius = given.tool.radius_mm
    if not 0.0 < depth_mm <= _LARGEST_SHARE * radius:
        raise ArgumentError(
            f"a radial depth of {depth_mm:g} mm: must be above 0, at most {_LARGEST_SHARE * radius:g} mm"
        )
    straight = max(10.0, 4.0 * radius)
    lengths = [len(feeds) * step for feeds, step in zip(sequences, intervals_mm, strict=True)]
    stock = float(math.ceil(max(lengths) + 2.0 * straight))
    edge = Edge(np.array([0.0, stock]), np.array([_rounded(depth_mm)] * 2))
    programs = []
    for feeds, step in zip(sequences, intervals_mm, strict=True):
        steps = [(_rounded(straight + (k + 1) * step), round(feed, 1)) for k, feed in enumerate(feeds)]
        programs.append([(straight, given.feed_mm_per_min), *steps, (None, given.feed_mm_per_min)])
    names = [f"FEED CHANGES EVERY {step:g} MM" for step in intervals_mm]
    about = {"radial_depth_mm": depth_mm, "intervals_mm": list(intervals_mm), "steps_begin_at_mm": straight}
    cut = _cut("interval", given, list(_passes_through(given, edge, stock, names, programs)), about)
    return Design(cut, (edge,) * len(names), stock, np.empty((2, 0)))
