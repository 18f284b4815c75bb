"""A test cut: tool, cutting conditions and measuring passes, and the side file that keeps them for the fit.

Every measuring pass goes along +X at a constant Y and leaves a straight wall. The material in front of it has an edge
whose height above that wall is known over X, so the radial depth is known wherever the tool's axis is.
"""

from __future__ import annotations

import dataclasses
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode._core import ArgumentError

__all__ = [
    "FORMAT",
    "KINDS",
    "CutTool",
    "Engagement",
    "MeasuringPass",
    "TestCut",
    "engagement",
    "fully_engaged",
    "load_cut",
    "straight_engagement",
]

Array = npt.NDArray[np.float64]

KINDS = ("taper", "corner", "interval")
FORMAT = "shapegcode test cut 1"


@dataclass(frozen=True)
class CutTool:
    """The end mill of a test cut.

    Attributes:
        diameter_mm: as it turns, measured.
        flutes: their number.
        helix_deg: right-hand helix.
        runout_mm: how far each flute stands out; empty: not known.
        cutting: the seven coefficients of the force law, as in the tool file's ``[cutting]``: what is known before.
    """

    diameter_mm: float
    flutes: int
    helix_deg: float
    runout_mm: tuple[float, ...] = ()
    cutting: dict[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def radius_mm(self) -> float:
        """Half of the diameter."""
        return 0.5 * self.diameter_mm


@dataclass(frozen=True)
class MeasuringPass:
    """One pass whose force is recorded.

    Attributes:
        name: what is special about it.
        start_mm: X of the tool's axis at its start, in the air.
        end_mm: X at its end, in the air.
        edge_x_mm: ascending X of the edge's corner points, from one end of the stock to the other.
        edge_height_mm: how high the edge stands there above the wall that the pass leaves; straight between them.
        feeds: pairs (X up to which it holds, feed in mm/min), ascending.
    """

    name: str
    start_mm: float
    end_mm: float
    edge_x_mm: tuple[float, ...]
    edge_height_mm: tuple[float, ...]
    feeds: tuple[tuple[float, float], ...]

    @property
    def feed_mm_per_min(self) -> float:
        """Feed of its first block."""
        return self.feeds[0][1]

    @property
    def constant_feed(self) -> bool:
        """Whether one feed holds from its start to its end."""
        return len({feed for _, feed in self.feeds}) == 1

    def commanded_feed(self, x_mm: Array) -> Array:
        """Feed of the block in which the axis is at each X, mm/min."""
        ends = np.array([end for end, _ in self.feeds])
        values = np.array([feed for _, feed in self.feeds])
        return np.asarray(values[np.minimum(np.searchsorted(ends, x_mm, side="left"), len(values) - 1)])


@dataclass(frozen=True)
class TestCut:
    """One test cut, as its side file holds it.

    Attributes:
        kind: one of `KINDS`.
        program: name of the program file.
        machine: name of the machine.
        tool: the end mill.
        spindle_rev_per_min: clockwise (M03).
        axial_depth_mm: of every pass.
        milling: "down": the material is on the right of the feed; "up": on its left.
        passes: in the order of the program.
        about: figures of this kind: the corner's radii, the intervals.
    """

    __test__ = False  # not for pytest, whatever its name

    kind: str
    program: str
    machine: str
    tool: CutTool
    spindle_rev_per_min: float
    axial_depth_mm: float
    milling: str
    passes: tuple[MeasuringPass, ...]
    about: dict[str, Any] = dataclasses.field(default_factory=dict)

    def data(self) -> dict[str, Any]:
        """The content of the side file."""
        return {"format": FORMAT, **dataclasses.asdict(self)}


@dataclass(frozen=True)
class Engagement:
    """What the tool meets where its axis is at each X; azimuths as in ``_core.EngagedArc``.

    Attributes:
        from_rad: first azimuth in material, from the direction of feed, positive to its left.
        to_rad: last one; equal to `from_rad` where nothing is met.
        radial_depth_mm: depth of the outermost point in material below the edge: distance from it to the wall.
    """

    from_rad: Array
    to_rad: Array
    radial_depth_mm: Array


def engagement(cut: TestCut, measuring: MeasuringPass, x_mm: Array) -> Engagement:
    """Engagement of a pass where the tool's axis is at each X, exact for the straight pieces of its edge.

    Args:
        cut: gives the tool and the side on which the material is.
        measuring: the pass.
        x_mm: (n,) positions of the tool's axis.

    Returns:
        Angles in rad and depths in mm at each X, (n,).
    """
    radius = cut.tool.radius_mm
    edge_x, edge_y = np.array(measuring.edge_x_mm), np.array(measuring.edge_height_mm)
    x = np.asarray(x_mm, dtype=np.float64)
    # Along the tool: how far a point of its front lies before the axis.
    begin = np.clip(edge_x[0] - x, 0.0, radius)
    end = _crossing(x, begin, edge_x, edge_y, radius)
    end = np.maximum(np.minimum(end, edge_x[-1] - x), begin)
    first, last = -np.arccos(begin / radius), -np.arccos(np.clip(end / radius, 0.0, 1.0))
    depth = np.where(end > begin, radius - np.sqrt(np.maximum(radius**2 - end**2, 0.0)), 0.0)
    if cut.milling == "up":
        first, last = -last, -first
    return Engagement(first, last, depth)


def _crossing(x: Array, begin: Array, edge_x: Array, edge_y: Array, radius: float) -> Array:
    """How far before the axis the front of the tool first comes out of the edge; `begin` where it is not in it."""
    found = np.full(len(x), radius)
    open_ = np.ones(len(x), dtype=bool)
    at_begin = np.interp(x + begin, edge_x, edge_y)
    outside = at_begin <= radius - np.sqrt(np.maximum(radius**2 - begin**2, 0.0))
    found[outside] = begin[outside]
    open_ &= ~outside
    slopes = np.diff(edge_y) / np.diff(edge_x)
    first = np.clip(np.searchsorted(edge_x, x + begin, side="right") - 1, 0, len(slopes) - 1)
    for step in range(len(slopes)):
        piece = first + step
        active = np.flatnonzero(open_ & (piece < len(slopes)))
        active = active[edge_x[np.minimum(piece[active], len(slopes) - 1)] - x[active] < radius]
        if active.size == 0:
            break
        k = piece[active]
        m = slopes[k]
        # The edge over the distance u before the axis: height c + m u; the tool's front: u^2 + (y - R)^2 = R^2.
        c = edge_y[k] + m * (x[active] - edge_x[k]) - radius
        inner = (m * c) ** 2 - (1.0 + m * m) * (c * c - radius * radius)
        u = (-m * c + np.sqrt(np.maximum(inner, 0.0))) / (1.0 + m * m)
        inside = (inner >= 0.0) & (u <= edge_x[k + 1] - x[active] + 1e-12)
        found[active[inside]] = u[inside]
        open_[active[inside]] = False
    return found


def straight_engagement(tool: CutTool, radial_depth_mm: Array, *, up: bool) -> Engagement:
    """Engagement of straight cuts of known radial depth."""
    last = -np.arcsin(1.0 - radial_depth_mm / tool.radius_mm)
    first = np.full(len(last), -0.5 * math.pi)
    return Engagement(-last, -first, radial_depth_mm) if up else Engagement(first, last, radial_depth_mm)


def fully_engaged(cut: TestCut, measuring: MeasuringPass, x_mm: Array, margin_mm: float = 0.0) -> npt.NDArray[np.bool_]:
    """Where the tool is over the stock with all of its engagement, and by a margin within its ends."""
    met = engagement(cut, measuring, x_mm)
    reach = cut.tool.radius_mm * np.maximum(np.cos(met.to_rad), np.cos(met.from_rad))
    # The engagement ends at the end of the stock: there it is not whole, by whatever little.
    low, high = measuring.edge_x_mm[0] + margin_mm, measuring.edge_x_mm[-1] - max(margin_mm, 1e-6)
    return np.asarray((x_mm >= low) & (x_mm + reach <= high) & (met.to_rad > met.from_rad))


def load_cut(path: str | Path) -> TestCut:
    """Read the side file of a test cut.

    Raises:
        ArgumentError: not such a file, or a value in it is missing or impossible.
        OSError: the file cannot be read.
    """
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"))
    except ValueError as error:
        raise ArgumentError(f"{path}: no JSON: {error}") from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise ArgumentError(f"{path}: not the side file of a test cut ('format' must be {FORMAT!r})")
    try:
        tool = CutTool(**{**data["tool"], "runout_mm": tuple(data["tool"].get("runout_mm", ()))})
        passes = tuple(
            MeasuringPass(
                str(each["name"]),
                float(each["start_mm"]),
                float(each["end_mm"]),
                tuple(map(float, each["edge_x_mm"])),
                tuple(map(float, each["edge_height_mm"])),
                tuple((float(end), float(feed)) for end, feed in each["feeds"]),
            )
            for each in data["passes"]
        )
        plain = {name: data[name] for name in ("kind", "program", "machine", "milling", "about")}
        cut = TestCut(
            **plain,
            tool=tool,
            passes=passes,
            spindle_rev_per_min=float(data["spindle_rev_per_min"]),
            axial_depth_mm=float(data["axial_depth_mm"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise ArgumentError(f"{path}: {what}: write the test cut again") from error
    _check(path, cut)
    return cut


def _check(path: str | Path, cut: TestCut) -> None:
    if cut.kind not in KINDS or cut.milling not in ("down", "up"):
        raise ArgumentError(f"{path}: kind {cut.kind!r}, milling {cut.milling!r}: must be {', '.join(KINDS)}; down, up")
    for name, value in (
        ("tool.diameter_mm", cut.tool.diameter_mm),
        ("tool.flutes", cut.tool.flutes),
        ("spindle_rev_per_min", cut.spindle_rev_per_min),
        ("axial_depth_mm", cut.axial_depth_mm),
        ("passes", len(cut.passes)),
    ):
        if not (math.isfinite(value) and value > 0):
            raise ArgumentError(f"{path}: {name} = {value}: must be above 0")
    for number, each in enumerate(cut.passes, start=1):
        x, height = np.array(each.edge_x_mm), np.array(each.edge_height_mm)
        good = len(x) == len(height) >= 2 and bool(np.all(np.isfinite(height))) and bool(np.all(np.diff(x) > 0.0))
        ends = [end for end, _ in each.feeds]
        good &= bool(ends) and ends == sorted(ends) and all(feed > 0.0 for _, feed in each.feeds)
        if not (good and each.start_mm < x[0] and x[-1] < each.end_mm):
            raise ArgumentError(f"{path}: pass {number}: edge, feeds and ends do not fit together: write the cut again")
