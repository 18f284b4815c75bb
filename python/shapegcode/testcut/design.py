"""Designs test cuts (edge, passes, feeds) and writes them as FANUC programs with instructions.

Source: Y.-H. Kim, S.-L. Ko: Improvement of the Accuracy in Cornering Cut Using End Mill, 2001 (paper 001).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from itertools import accumulate
from pathlib import Path

import numpy as np

from shapegcode import _core
from shapegcode.cutting.tool import Tool
from shapegcode.errors import ArgumentError
from shapegcode.identification.sweep_program import plain_name
from shapegcode.io.data_file import write_text
from shapegcode.io.units import FloatArray
from shapegcode.machine import Machine
from shapegcode.program import decimal
from shapegcode.program.stamp import OVERRIDE
from shapegcode.results.json import to_text
from shapegcode.testcut import cut as cuts
from shapegcode.testcut.cut import CornerDetails, CutTool, Edge, IntervalDetails, MeasuringPass, TaperDetails
from shapegcode.testcut.forces import ForceLaw, engagement, straight_engagement
from shapegcode.testcut.result import CutDesign

_Sizes = tuple[float, float, float]  # allowance, rough and finish radius of a corner
_Block = tuple[float | None, float]  # X up to which a feed applies (None: the end of the pass), feed in mm/min


@dataclass(frozen=True)
class CutConditions:
    """Conditions of a test cut; `taper_cut` and the others refuse those that machine or tool do not allow.

    Attributes:
        machine: machine whose controller runs the program.
        tool: the tool file.
        feed_mm_per_min: feed of the measuring passes; for a corner that of its straight part.
        axial_depth_mm: axial depth of every pass.
        spindle_rev_per_min: spindle speed of every pass; None: `feed.spindle_rev_per_min` of the tool.
        up: up milling, the material on the left of the feed.
    """

    machine: Machine
    tool: Tool
    feed_mm_per_min: float
    axial_depth_mm: float
    spindle_rev_per_min: float | None = None
    up: bool = False

    def __post_init__(self) -> None:
        """A machine may be given by its file or name."""
        object.__setattr__(self, "machine", Machine.of(self.machine))
        if not isinstance(self.tool, Tool):
            raise ArgumentError(f"tool: sg.Tool.load(file) is needed, not {type(self.tool).__name__}")

    @property
    def spindle(self) -> float:
        """Spindle speed, rev/min.

        Raises:
            ArgumentError: neither conditions nor tool state one.
        """
        known = self.tool.feed.spindle_rev_per_min if self.spindle_rev_per_min is None else self.spindle_rev_per_min
        if known is None:
            raise ArgumentError("the tool has no feed.spindle_rev_per_min: state the spindle speed (-S)")
        return known

    @property
    def diameter_mm(self) -> float:
        """Diameter of the tool, mm."""
        return 2.0 * self.tool.radius_mm

    def _cut_tool(self) -> CutTool:
        """The tool, for the side file."""
        mill, law = self.tool.tool, cuts.CuttingLaw.of(self.tool.coefficients())
        runout = tuple(0.001 * value for value in mill.runout_um or ())
        return CutTool(mill.diameter_mm, mill.flutes, mill.helix_deg, runout, law)

    def _check_feeds(self, feeds_mm_per_min: Sequence[float]) -> None:
        low, high = self.machine.controller.minimum_feed_mm_per_min, self.machine.axes.x.max_feed_mm_per_min
        for feed in feeds_mm_per_min:
            if not low <= feed <= high:
                raise ArgumentError(f"a feed of {feed:g} mm/min: this machine allows {low:g} to {high:g} mm/min")
        long = self.tool.tool.flute_length_mm
        if self.axial_depth_mm > long:
            raise ArgumentError(f"an axial depth of {self.axial_depth_mm:g} mm: the flutes are {long:g} mm long")
        if self.tool.sense() != _core.SpindleSense.clockwise:
            raise ArgumentError("the tool turns counter-clockwise: test cuts are written for M03 only")

    def _check_depths(self, low_mm: float, high_mm: float) -> None:
        limit = 0.95 * self.tool.radius_mm
        if not 0.0 < low_mm <= high_mm <= limit:
            raise ArgumentError(
                f"radial depths from {low_mm:g} to {high_mm:g} mm: must ascend, above 0, at most {limit:g} mm"
            )


@dataclass(frozen=True)
class CornerShape:
    """An inside corner between two straight walls at a right angle (paper 001, figure 1; docs/evidence/references.md).

    Attributes:
        allowance_mm: radial depth on the walls; None: 0.1 D of the tool.
        rough_radius_mm: radius of the rough corner; None: D.
        finish_radius_mm: radius of the finished corner; None: D.
    """

    allowance_mm: float | None = None
    rough_radius_mm: float | None = None
    finish_radius_mm: float | None = None

    def _sizes_mm(self, diameter_mm: float) -> _Sizes:
        """The three values for a tool; defaults are case 1 of the paper."""
        usual = (0.1 * diameter_mm, diameter_mm, diameter_mm)
        given = (self.allowance_mm, self.rough_radius_mm, self.finish_radius_mm)
        allowance, rough, finish = (other if own is None else own for own, other in zip(given, usual, strict=True))
        return allowance, rough, finish


_STATION_MM = 0.01
_FEW_UM = 1e-3  # mm
_SAME_MM = 1e-6


def _require_conditions(given: object) -> None:
    if not isinstance(given, CutConditions):
        needed = "sg.CutConditions(machine, sg.Tool.load(file), feed_mm_per_min=..., axial_depth_mm=...)"
        raise ArgumentError(f"{needed} is needed, not {type(given).__name__}")


def taper_cut(
    given: CutConditions,
    feeds_mm_per_min: Sequence[float] | None = None,
    depths_mm: tuple[float, float] | None = None,
    length_mm: float = 60.0,
) -> CutDesign:
    """Straight passes along a tapered work piece (paper 001, figure 4): one per feed, to fit k1 and k2.

    Args:
        given: tool, spindle, axial depth, feed.
        feeds_mm_per_min: feeds of the passes; None: 0.5, 1 and 2 times the given one.
        depths_mm: radial depth at the beginning and at the end of the stock; None: 0.05 and 0.35 of the diameter.
        length_mm: length of the stock.

    Returns:
        The design, for `write_test_cut`.

    Raises:
        ArgumentError: a feed or depth beyond the limits of tool or machine, radial depths that do not increase, or a
            length below five times their difference.
    """
    _require_conditions(given)
    feeds = feeds_mm_per_min or [given.feed_mm_per_min * share for share in (0.5, 1.0, 2.0)]
    given._check_feeds(feeds)
    low, high = depths_mm or (0.05 * given.diameter_mm, 0.35 * given.diameter_mm)
    given._check_depths(low, high)
    if low == high:
        raise ArgumentError(f"a taper with {low:g} mm at both ends: the radial depth must increase")
    if high - low > 0.2 * length_mm:
        raise ArgumentError(
            f"{length_mm:g} mm are too short for a taper of {high - low:g} mm: at least 5 times as long"
        )
    edge = Edge(np.array([0.0, length_mm]), np.array([round(low, 3), round(high, 3)]))
    passes = [(f"F{feed:g}", [(None, feed)]) for feed in feeds]
    return _design(given, edge, length_mm, passes, TaperDetails((low, high), length_mm))


def corner_cut(given: CutConditions, corner: CornerShape | None = None, interval_mm: float | None = None) -> CutDesign:
    """A corner unrolled on a straight line (paper 001, figure 7): a pass with constant and one with modified feed.

    Args:
        given: tool, spindle, axial depth, feed on the straight walls.
        corner: to unroll; None: case 1 of the paper.
        interval_mm: length of the blocks with their own feed; None: from the machine's feed control.

    Returns:
        The design, for `write_test_cut`.

    Raises:
        ArgumentError: the corner cannot be unrolled, or exceeds the limits of tool or machine.
    """
    _require_conditions(given)
    sizes = (corner or CornerShape())._sizes_mm(given.diameter_mm)
    interval = given.machine.feed_control.interval_mm if interval_mm is None else interval_mm
    constant: _Block = (None, given.feed_mm_per_min)
    given._check_feeds([given.feed_mm_per_min])
    radius = given.tool.radius_mm
    straight = max(10.0, 3.0 * radius)
    s, depth = _corner_depth(given, sizes)
    stock = math.ceil(2.0 * straight + float(s[-1]) + radius)
    wanted_edge = cuts.unrolled_edge(s, depth, radius, stock, straight)
    # The milled edge is higher than the wanted one where the latter is more sharply concave than the tool: material
    # remains there.
    far = 3.0 * radius
    path = cuts.offset_line(wanted_edge, radius, -far, stock + far)
    edge = cuts.reduced(cuts.offset_line(path, radius, -radius, stock + radius, inwards=True))
    x = np.arange(0.0, stock - radius, _STATION_MM)
    probe = _measuring_pass(given, edge, stock, "probe", [constant])
    met = engagement(given._cut_tool(), probe, x, up=given.up).radial_depth_mm
    off = np.flatnonzero(np.abs(met - sizes[0]) > _FEW_UM)
    begin, end = round(min(straight, float(x[off[0]])), 3), max(straight + float(s[-1]), float(x[off[-1]]))
    blocks = _blocks(x, _corner_feeds(given, met), interval, begin, end)
    given._check_feeds([feed for _, feed in blocks])
    excess = met - np.interp(x, s + straight, depth)
    more = np.flatnonzero(excess > _FEW_UM)
    deeper = cuts.DeeperSection(float(x[more[0]]), float(x[more[-1]]), float(excess.max())) if more.size else None
    deepest = cuts.Deepest(float(met.max()), float(x[int(np.argmax(met))]))
    about = CornerDetails(*sizes, interval, straight, deepest, deeper)
    modified = [(begin, given.feed_mm_per_min), *blocks, constant]
    passes = [("CONSTANT FEED", [constant]), ("MODIFIED FEED", modified)]
    return _design(given, wanted_edge, stock, passes, about, met=edge)


def interval_cut(
    given: CutConditions,
    corner: CornerShape | None = None,
    intervals_mm: Sequence[float] = (0.2, 0.4, 0.6),
    feeds_mm_per_min: Sequence[float] | None = None,
) -> CutDesign:
    """Feed changes at equal distances at a constant radial depth (paper 001, figure 8): one pass per interval.

    Args:
        given: tool, spindle, axial depth, feed before and after.
        corner: its allowance is the radial depth; None: case 1 of the paper.
        intervals_mm: length of the blocks of each pass.
        feeds_mm_per_min: of the blocks, the same for every pass; None: those of the corner (eq. 7).

    Returns:
        The design, for `write_test_cut`.

    Raises:
        ArgumentError: beyond the limits of tool or machine.
    """
    _require_conditions(given)
    sizes = (corner or CornerShape())._sizes_mm(given.diameter_mm)
    depth, feed = sizes[0], given.feed_mm_per_min
    sequences = [list(feeds_mm_per_min or ())] * len(intervals_mm)
    if not feeds_mm_per_min:
        s, depths = _corner_depth(given, sizes)
        needed = _corner_feeds(given, depths)
        sequences = [[each for _, each in _blocks(s, needed, step, 0.0, float(s[-1]))] for step in intervals_mm]
    given._check_feeds([feed, *(each for sequence in sequences for each in sequence)])
    given._check_depths(depth, depth)
    straight = max(10.0, 4.0 * given.tool.radius_mm)
    longest = max(len(feeds) * step for feeds, step in zip(sequences, intervals_mm, strict=True))
    stock = float(math.ceil(longest + 2.0 * straight))
    edge = Edge(np.array([0.0, stock]), np.array([round(depth, 3)] * 2))
    passes: list[tuple[str, list[_Block]]] = []
    for feeds, step in zip(sequences, intervals_mm, strict=True):
        steps = [(round(straight + (k + 1) * step, 3), round(each, 1)) for k, each in enumerate(feeds)]
        passes.append((f"FEED CHANGES EVERY {step:g} MM", [(straight, feed), *steps, (None, feed)]))
    return _design(given, edge, stock, passes, IntervalDetails(depth, tuple(intervals_mm), straight))


def _design(
    given: CutConditions, edge: Edge, stock_mm: float, passes: Sequence[tuple[str, Sequence[_Block]]],
    about: TaperDetails | CornerDetails | IntervalDetails, *, met: Edge | None = None,
) -> CutDesign:  # fmt: skip
    kind = next(kind for kind, figures in cuts.FIGURES.items() if isinstance(about, figures))
    warnings = []
    if isinstance(about, CornerDetails) and about.deeper_than_corner is not None:
        deeper = about.deeper_than_corner
        warnings.append(
            f"X {deeper.from_mm:.2f} to {deeper.to_mm:.2f} mm: passes are up to {deeper.most_mm:.3f} mm deeper than "
            "the corner, whose edge is more sharply concave than the tool; the side file has the real depths"
        )
    cut = cuts.TestCut(
        kind, "", given.machine.name, given._cut_tool(), given.spindle, given.axial_depth_mm,
        "up" if given.up else "down",
        tuple(_measuring_pass(given, met or edge, stock_mm, name, blocks) for name, blocks in passes), about,
    )  # fmt: skip
    return CutDesign(cut, (), tuple(warnings), edge, stock_mm, given.machine)


def _measuring_pass(
    given: CutConditions, edge: Edge, stock_mm: float, name: str, blocks: Sequence[_Block]
) -> MeasuringPass:
    inside = (edge.x_mm > 0.0) & (edge.x_mm < stock_mm)
    x = np.concatenate([[0.0], edge.x_mm[inside], [stock_mm]])
    # Travel in air at both ends of the pass: 20 revolutions at its largest feed, 5 mm or more.
    air = max(5.0, math.ceil(20.0 * max(feed for _, feed in blocks) / given.spindle))
    air += given.tool.radius_mm
    end = round(stock_mm + air, 3)
    feeds = tuple((end if until is None else until, feed) for until, feed in blocks)
    return MeasuringPass(name, round(-air, 3), end, tuple(x.tolist()), tuple(edge.at(x).tolist()), feeds)


def _corner_feeds(given: CutConditions, radial_depth_mm: FloatArray) -> FloatArray:
    """Feeds in inverse proportion to the mean resultant at the first feed (paper 001, eq. 7), mm/min."""
    tool = given._cut_tool()
    law = ForceLaw(tool, tool.cutting, given.spindle, given.axial_depth_mm)
    met = straight_engagement(tool, radial_depth_mm, up=given.up)
    force = law.forces(met, np.full(len(radial_depth_mm), given.feed_mm_per_min)).mean_resultant_n
    return np.asarray(given.feed_mm_per_min * force[0] / force)


def _blocks(
    x_mm: FloatArray, feed: FloatArray, interval_mm: float, begin: float, end: float
) -> list[tuple[float, float]]:
    """Blocks of one length, each with the lowest feed within it."""
    blocks = []
    for k in range(max(1, math.ceil((end - begin) / interval_mm - 1e-9))):
        low, high = begin + k * interval_mm, begin + (k + 1) * interval_mm
        within = feed[(x_mm >= low - 1e-9) & (x_mm <= high + 1e-9)]
        blocks.append((round(high, 3), round(float(within.min()), 1)))
    return blocks


def _corner_depth(given: CutConditions, sizes: _Sizes) -> tuple[FloatArray, FloatArray]:
    """Distances from the start of section S2 (paper 001) to where the radial depth stays constant, and the depths."""
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


_SKIM_MM = 0.2
_RAW_MM = 0.5  # allowed protrusion of the raw edge
_CLEAR_Z_MM, _NEAR_Z_MM = 10.0, 2.0
_BLOCKS_OF_EDGE = 3.0  # least duration of a block of the edge, in block times
_SAMPLES_PER_TOOTH = 12.3  # not a whole number, so that samples do not repeat the same angles
_TITLES = {  # and purpose
    "taper": ("TAPER TEST CUT", "CUTTING COEFFICIENTS FROM A GROWING RADIAL DEPTH"),
    "corner": ("CORNER ON A STRAIGHT LINE", "SAME RADIAL DEPTH AS IN A CORNER, FEED CONSTANT,", "THEN MODIFIED"),
    "interval": ("FEED INTERVAL TEST", "HOW OFTEN THE CONTROL FOLLOWS A CHANGE OF FEED"),
}


def write_test_cut(design: CutDesign, file: str | Path, number: int = 7101) -> CutDesign:
    """Write the program of a test cut, and next to it the side file (JSON) that `fit_test_cut` reads.

    Args:
        design: the test cut.
        file: program file; the side file has its name with the suffix ``.json``.
        number: program number (O word).

    Returns:
        The design with the names of both files.

    Raises:
        OSError: a file cannot be written.
    """
    output = Path(file)
    side = output.with_suffix(".json")
    named = replace(design, cut=replace(design.cut, program=output.name), files=(str(output), str(side)))
    write_text(side, to_text(named.cut.data()))
    write_text(output, _program_text(named, number))
    return named


def _program_text(design: CutDesign, number: int) -> str:
    writer = _Writer(design)
    title, *purpose = _TITLES[design.cut.kind]
    lines = ["%", f"O{number:04d}({title})", *(f"({line})" for line in (*purpose, *writer.head()))]
    lines += ["G21 G17 G90 G94 G64 G40 G49 G80", "G54"]
    lines += [f"S{design.cut.spindle_rev_per_min:g} M03", "G04 P3000", f"G00 Z{decimal(_CLEAR_Z_MM, 3)}"]
    for k in range(len(design.cut.passes)):
        lines += writer.passes(k)
    return "\n".join([*lines, "M05", "M30", "%"]) + "\n"


class _Writer:
    def __init__(self, design: CutDesign) -> None:
        self.design, self.cut, self.controller = design, design.cut, design.machine.controller
        self.decimals = max(1, round(-math.log10(self.controller.least_increment_mm)))
        self.radius = self.cut.tool.radius_mm
        self.side = 1.0 if self.cut.up else -1.0  # sign of Y in the material, from the raw edge
        # Distance of each finished wall from the raw edge.
        self.walls = list(accumulate(round(max(each.edge_height_mm) + _SKIM_MM, 3) for each in self.cut.passes))

    def head(self) -> Iterator[str]:
        """Instructions, in lines that any control can show."""
        cut = self.cut
        ends = self.side * (-_RAW_MM - 3.0 * self.radius), self.side * self.walls[-1]
        rate = math.ceil(_SAMPLES_PER_TOOTH * cut.tool.flutes * cut.spindle_rev_per_min / 60.0 / 10.0) * 10
        text = (resources.files("shapegcode") / "data" / "testcut_head.txt").read_text(encoding="ascii")
        yield from text.format(
            cut=cut, machine=plain_name(cut.machine), stock_mm=self.design.stock_mm, rate=rate, clear_z_mm=_CLEAR_Z_MM,
            edge="REAR EDGE" if self.side < 0.0 else "FRONT EDGE", near=min(ends), far=max(ends),
            wide=math.ceil(self.walls[-1] + 5.0), deep=math.ceil(cut.axial_depth_mm + 2.0), override=OVERRIDE.comment,
            left=min(each.start_mm for each in cut.passes), right=max(each.end_mm for each in cut.passes),
        ).splitlines()  # fmt: skip
        if isinstance(cut.about, CornerDetails) and cut.about.deeper_than_corner is not None:
            deeper = cut.about.deeper_than_corner
            yield f"X{deeper.from_mm:.2f} TO {deeper.to_mm:.2f}: UP TO {deeper.most_mm:.3f} MM DEEPER"
            yield "THAN THE CORNER: THE ROUND TOOL LEAVES IT"

    def passes(self, k: int) -> Iterator[str]:
        """Lines for the edge of a pass, a stop, and the pass."""
        each, wall = self.cut.passes[k], self.walls[k]
        path = cuts.offset_line(self.design.edge, self.radius, each.start_mm, each.end_mm)
        path = cuts.on_increments(path, self.controller.least_increment_mm)
        yield f"(PASS {k + 1}: MILL THE EDGE)"
        for offset in self._offsets(self.walls[k - 1] if k else -_RAW_MM, wall):
            yield from self._edge(path, wall, offset, min(feed for _, feed in each.feeds))
        yield f"G00 Z{decimal(_CLEAR_Z_MM, 3)}"
        yield f"M00 (START RECORD {k + 1}: {each.name})"
        yield f"S{self.cut.spindle_rev_per_min:g} M03"  # The control may have stopped the spindle
        yield "G04 P3000"
        yield from self._begin(each.start_mm, self.side * (wall - self.radius), each.feed_mm_per_min)
        for end, feed in each.feeds:
            yield f"G01 X{decimal(end, self.decimals)} F{decimal(feed, 1)}"
        yield f"G00 Z{decimal(_CLEAR_Z_MM, 3)}"
        yield f"M00 (STOP RECORD {k + 1})"
        yield f"S{self.cut.spindle_rev_per_min:g} M03"

    def _begin(self, x: float, y: float, feed: float) -> Iterator[str]:
        yield f"G00 X{decimal(x, self.decimals)} Y{decimal(y, self.decimals)}"
        yield f"Z{decimal(_NEAR_Z_MM, 3)}"
        yield f"G01 Z{decimal(-self.cut.axial_depth_mm, self.decimals)} F{decimal(max(feed, 100.0), 1)}"

    def _edge(self, path: Edge, wall: float, offset: float, feed: float) -> Iterator[str]:
        """Lines of one cut along the edge, with an outward offset."""
        y = wall - path.height_mm - offset
        shortest = float(np.min(np.hypot(np.diff(path.x_mm), np.diff(y))))
        block_s = max(self.controller.block_time_s, self.controller.interpolation_period_s)
        feed = max(min(feed, shortest / (_BLOCKS_OF_EDGE * block_s) * 60.0), 1.0)
        yield from self._begin(float(path.x_mm[0]), self.side * float(y[0]), feed)
        first = f" F{decimal(math.floor(feed * 10.0) / 10.0, 1)}"
        for px, py in zip(path.x_mm[1:], y[1:], strict=True):
            yield f"G01 X{decimal(float(px), self.decimals)} Y{decimal(self.side * float(py), self.decimals)}{first}"
            first = ""
        yield f"G00 Z{decimal(_NEAR_Z_MM, 3)}"

    def _offsets(self, before: float, wall: float) -> list[float]:
        """Distance of each cut from the edge: equal ones up to 0.1 D, then a thin one that hardly bends the tool."""
        height = self.design.edge.at(np.linspace(0.0, self.design.stock_mm, 200))
        more = float(np.max(wall - height - before)) - _SKIM_MM
        if more <= 0.0:
            return [0.0]
        rough = math.ceil(more / (0.1 * self.cut.tool.diameter_mm))
        return [round(_SKIM_MM + more * k / rough, 3) for k in range(rough - 1, -1, -1)] + [0.0]
