"""A test cut: tool, cutting conditions and measuring passes, and its side file, from which the fit reads them.

A pass moves along +X at constant Y; the height of the stock edge above the finished wall is known over X.
"""

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError
from scipy.ndimage import grey_dilation

from shapegcode import _core
from shapegcode.cutting.tool import COEFFICIENTS
from shapegcode.errors import ArgumentError
from shapegcode.io.data_file import DataFile
from shapegcode.io.units import FloatArray

_FORMAT = "shapegcode test cut 1"
_Kind = Literal["taper", "corner", "interval"]
_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_Finite = Annotated[float, Field(allow_inf_nan=False)]


@dataclass(frozen=True)
class CuttingLaw:
    """The coefficients of the force law, as in the tool file's ``[cutting]``; see docs/concepts/cutting_force.md."""

    specific_n_per_mm2: float  # specific cutting force k1 at a chip 1 mm thick
    specific_exponent: float = 0.0  # exponent of the chip thickness in k1
    ratio: float = 0.0  # ratio of radial to tangential force, k2, at a chip 1 mm thick
    ratio_exponent: float = 0.0  # exponent of the chip thickness in k2
    tangential_edge_n_per_mm: float = 0.0  # tangential force of the edge per length, K_te
    radial_edge_n_per_mm: float = 0.0  # radial force of the edge per length, K_re
    # chip thickness of the exponents, "mean" of the engagement or "local"
    chip_thickness: Literal["mean", "local"] = "mean"

    @classmethod
    def of(cls, law: _core.CuttingCoefficients) -> Self:
        """Convert from coefficients of the core."""
        values = {name: getattr(law, name) for name in COEFFICIENTS}
        return cls(**values, chip_thickness="local" if law.thickness == _core.ChipThickness.local else "mean")

    def core(self) -> _core.CuttingCoefficients:
        """Convert to coefficients of the core."""
        values = {name: float(getattr(self, name)) for name in COEFFICIENTS}
        return _core.CuttingCoefficients(**values, thickness=_core.ChipThickness.__members__[self.chip_thickness])


@dataclass(frozen=True)
class CutTool:
    """The end mill of a test cut."""

    diameter_mm: _Positive  # measured on the rotating tool
    flutes: Annotated[int, Field(gt=0)]  # their number
    helix_deg: _Finite  # right-hand helix
    runout_mm: tuple[_Finite, ...] = ()  # radial runout of each flute; empty: unknown
    cutting: CuttingLaw = CuttingLaw(0.0)  # the force law known before

    @property
    def radius_mm(self) -> float:
        """Half of the diameter."""
        return 0.5 * self.diameter_mm


@dataclass(frozen=True)
class MeasuringPass:
    """One pass with recorded force."""

    name: str  # what distinguishes it, such as its feed
    start_mm: _Finite  # X of the tool's axis at its start, in the air
    end_mm: _Finite  # X at its end, in the air
    # ascending X of the edge's corner points, from one end of the stock to the other
    edge_x_mm: Annotated[tuple[_Finite, ...], Field(min_length=2)]
    # height of the edge there above the finished wall; linear in between
    edge_height_mm: Annotated[tuple[_Finite, ...], Field(min_length=2)]
    # pairs (upper end in X, feed in mm/min), ascending
    feeds: Annotated[tuple[tuple[_Finite, _Positive], ...], Field(min_length=1)]

    @property
    def feed_mm_per_min(self) -> float:
        """Feed of its first block."""
        return self.feeds[0][1]

    @property
    def constant_feed(self) -> bool:
        """Whether the whole pass has one feed."""
        return len({feed for _, feed in self.feeds}) == 1

    @property
    def duration_s(self) -> float:
        """Duration at the commanded feeds, s."""
        begins = (self.start_mm, *(end for end, _ in self.feeds))
        return sum((end - begin) / feed * 60.0 for begin, (end, feed) in zip(begins, self.feeds, strict=False))

    @property
    def consistent(self) -> bool:
        """Whether edge and blocks ascend in X, and the pass starts and ends beyond the edge."""
        x, ends = np.array(self.edge_x_mm), [end for end, _ in self.feeds]
        ascending = len(x) == len(self.edge_height_mm) and bool(np.all(np.diff(x) > 0.0)) and ends == sorted(ends)
        return ascending and bool(self.start_mm < x[0] and x[-1] < self.end_mm)

    def commanded_feed(self, x_mm: FloatArray) -> FloatArray:
        """Feed of the block in which the axis is at each X, mm/min."""
        ends = np.array([end for end, _ in self.feeds])
        values = np.array([feed for _, feed in self.feeds])
        return np.asarray(values[np.minimum(np.searchsorted(ends, x_mm, side="left"), len(values) - 1)])


@dataclass(frozen=True)
class TaperDetails:
    """Parameters of a taper."""

    radial_depth_mm: tuple[float, float]  # at the start and end of the stock
    length_mm: float  # of the stock


@dataclass(frozen=True)
class Deepest:
    """Largest radial depth of a pass."""

    max: float  # radial depth, mm
    at_mm: float  # X of the tool's axis


@dataclass(frozen=True)
class DeeperSection:
    """Range where passes are more than 1 µm deeper than in the corner, since a round tool milled the stock edge."""

    from_mm: float  # X at its start
    to_mm: float  # X at its end
    most_mm: float  # largest additional depth


@dataclass(frozen=True)
class CornerDetails:
    """Parameters of a corner test."""

    allowance_mm: float  # radial depth on the walls
    rough_radius_mm: float  # of the rough corner
    finish_radius_mm: float  # of the finished corner
    interval_mm: float  # length of a block with a feed of its own
    corner_begins_at_mm: float  # X where the corner begins
    radial_depth_mm: Deepest  # largest radial depth
    deeper_than_corner: DeeperSection | None  # where it is deeper than in the corner; None: nowhere


@dataclass(frozen=True)
class IntervalDetails:
    """Parameters of an interval test."""

    radial_depth_mm: float  # constant
    intervals_mm: tuple[_Positive, ...]  # length of the blocks of each pass
    steps_begin_at_mm: float  # X of the first change of the feed


@dataclass(frozen=True)
class TestCut:
    """One test cut, with the content of its side file.

    Attributes:
        kind: "taper", "corner" or "interval".
        program: name of the program file; empty before it is written.
        machine: name of the machine.
        tool: the end mill.
        spindle_rev_per_min: clockwise (M03).
        axial_depth_mm: axial depth of every pass.
        milling: "down": the material is on the right of the feed; "up": on its left.
        passes: in program order.
        about: parameters of this kind.
    """

    __test__ = False  # not a test for pytest

    kind: _Kind
    program: str
    machine: str
    tool: CutTool
    spindle_rev_per_min: _Positive
    axial_depth_mm: _Positive
    milling: Literal["down", "up"]
    passes: Annotated[tuple[MeasuringPass, ...], Field(min_length=1)]
    about: TaperDetails | CornerDetails | IntervalDetails

    @property
    def up(self) -> bool:
        """True for up milling."""
        return self.milling == "up"

    def data(self) -> dict[str, Any]:
        """The content of the JSON file beside the program."""
        return {"format": _FORMAT, **asdict(self)}


FIGURES: dict[_Kind, type] = {"taper": TaperDetails, "corner": CornerDetails, "interval": IntervalDetails}


def read_test_cut(path: str | Path) -> TestCut:
    """Read the side file of a test cut.

    Args:
        path: the file.

    Returns:
        The test cut.

    Raises:
        ArgumentError: not such a file, or a value in it is missing or impossible.
        OSError: the file cannot be read.
    """
    try:
        with DataFile(path, ArgumentError) as file:
            data = file.json(str(path), file.read())
    except ValueError as error:
        raise ArgumentError(f"{path}: not valid JSON: {error}") from error
    if not isinstance(data, dict) or data.get("format") != _FORMAT:
        raise ArgumentError(f"{path}: not the side file of a test cut ('format' must be {_FORMAT!r})")
    try:
        cut = TypeAdapter(TestCut).validate_python(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise ArgumentError(f"{path}: {where}: {first['msg']}: write the test cut again") from error
    if type(cut.about) is not FIGURES[cut.kind]:
        raise ArgumentError(f"{path}: the parameters in 'about' are not of a {cut.kind}: write the test cut again")
    wrong = next((number for number, each in enumerate(cut.passes, start=1) if not each.consistent), None)
    if wrong is not None:
        raise ArgumentError(f"{path}: pass {wrong}: edge, feeds and ends are inconsistent: write the test cut again")
    return cut


_GRID_MM = 0.004
_MOVED = 9  # increments


@dataclass(frozen=True, eq=False)
class Edge:
    """A polyline, ascending in X; extended straight beyond both ends. Heights are outwards from the finished wall."""

    x_mm: FloatArray  # (n,) at least 2
    height_mm: FloatArray  # (n,)

    def at(self, x_mm: FloatArray) -> FloatArray:
        """Height at each X."""
        x, y = self.x_mm, self.height_mm
        inside = np.interp(x_mm, x, y)
        first, last = ((y[k + 1] - y[k]) / (x[k + 1] - x[k]) for k in (0, -2))
        before, behind = np.where(x_mm < x[0], x_mm - x[0], 0.0), np.where(x_mm > x[-1], x_mm - x[-1], 0.0)
        return np.asarray(inside + before * first + behind * last)


def unrolled_edge(
    s_mm: FloatArray, radial_depth_mm: FloatArray, radius_mm: float, stock_mm: float, at_mm: float
) -> Edge:
    """Edge that gives a straight pass the radial depth of another path at each point."""
    depth = radial_depth_mm
    if depth.max() >= radius_mm:
        raise ArgumentError(
            f"the radial depth reaches {depth.max():.3f} mm, with a tool radius of {radius_mm:g} mm: such a corner "
            "cannot be unrolled on a straight line"
        )
    # With the axis at s, the tool's front leaves the edge at a height above the wall that equals the depth.
    x = s_mm + at_mm + np.sqrt(radius_mm**2 - (radius_mm - depth) ** 2)
    back = np.flatnonzero(np.diff(x) <= 0.0)
    if back.size:
        raise ArgumentError(
            f"at {s_mm[back[0]]:.2f} mm of the path the radial depth falls from {depth[back[0]]:.3f} mm faster than "
            f"on a straight pass of a tool of {2 * radius_mm:g} mm: such a corner cannot be unrolled on a straight line"
        )
    ends = np.array([min(0.0, x[0] - 1.0), max(stock_mm, x[-1] + 1.0)])
    return Edge(np.concatenate([ends[:1], x, ends[1:]]), np.concatenate([depth[:1], depth, depth[-1:]]))


def offset_line(line: Edge, radius: float, start: float, end: float, *, inwards: bool = False) -> Edge:
    """Tool path (axis of the tool) that mills an edge, within 0.1 µm; *inwards*: edge that a given tool path mills."""
    side = -1.0 if inwards else 1.0
    if len(line.x_mm) == 2:
        slope = float(np.diff(line.height_mm)[0] / np.diff(line.x_mm)[0])
        x = np.array([start, end])
        return reduced(Edge(x, line.at(x) + side * radius * math.sqrt(1.0 + slope * slope)))
    count = int(np.ceil((end - start) / _GRID_MM)) + 1
    reach = int(np.ceil(radius / _GRID_MM))
    x = start + _GRID_MM * np.arange(-reach, count + reach, dtype=np.float64)
    away = _GRID_MM * np.abs(np.arange(-reach, reach + 1, dtype=np.float64))
    circle = np.where(away <= radius, np.sqrt(np.maximum(radius * radius - away * away, 0.0)), -np.inf)
    best = grey_dilation(side * line.at(x), structure=circle)
    return reduced(Edge(x[reach : reach + count], side * best[reach : reach + count]))


def on_increments(line: Edge, step_mm: float) -> Edge:
    """Move points along their line by a few increments, to where both coordinates are nearly whole increments."""
    tried = step_mm * (np.round(line.x_mm / step_mm)[:, None] + np.arange(-_MOVED, _MOVED + 1))
    tried[[0, -1]] = step_mm * np.round(line.x_mm[[0, -1]] / step_mm)[:, None]
    # Keep neighbours apart.
    gaps = 0.4 * np.diff(line.x_mm)
    low = np.concatenate([[-np.inf], line.x_mm[1:] - gaps])
    high = np.concatenate([line.x_mm[:-1] + gaps, [np.inf]])
    heights = np.stack([line.at(column) for column in tried.T], axis=1)
    off = np.abs(heights - step_mm * np.round(heights / step_mm))
    off[(tried < low[:, None]) | (tried > high[:, None])] = np.inf
    off[[0, -1], _MOVED] = 0.0
    best = np.argmin(off, axis=1)
    rows = np.arange(len(best))
    return Edge(tried[rows, best], step_mm * np.round(heights[rows, best] / step_mm))


def reduced(line: Edge) -> Edge:
    """Reduce a line to few points, all its points within 0.1 µm of the result (Douglas and Peucker)."""
    import shapely

    points = np.column_stack([line.x_mm, line.height_mm])
    return Edge(*shapely.get_coordinates(shapely.LineString(points).simplify(1e-4, preserve_topology=False)).T)
