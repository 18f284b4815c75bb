"""Random 2.5-D milling programs with their tool and stock files, and the same stock as shapes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import shapely

from .cutting import EndMill
from .engagement import Block

Array = npt.NDArray[np.float64]
INCH_MM = 25.4


@dataclass
class Case:
    """A program, its files and what the judge knows about them."""

    program: str
    tool_toml: str
    stock_toml: str
    mill: EndMill
    blocks: list[Block]
    limits: dict[str, float]
    incremental: bool = False
    inch: bool = False
    files: dict[str, str] = field(default_factory=dict)
    before: tuple[str, EndMill] | None = None  # a program that ran before and its tool


@dataclass
class Writer:
    """Writes moves as blocks, in G90 or G91, mm or inch, arcs by R or I J."""

    rng: np.random.Generator
    incremental: bool
    inch: bool
    lines: list[str] = field(default_factory=list)
    at: Array = field(default_factory=lambda: np.zeros(3))  # whole increments
    feed: float = 0.0
    mode: str = ""

    @property
    def unit_mm(self) -> float:
        """Least increment, mm."""
        return INCH_MM * 1e-4 if self.inch else 1e-3

    def _word(self, axis: str, increments: float) -> str:
        text = f"{increments * (1e-4 if self.inch else 1e-3):.{4 if self.inch else 3}f}".rstrip("0")
        return axis + text

    def _axes(self, to: Array, always: str = "") -> str:
        out = []
        for k, axis in enumerate("XYZ"):
            if to[k] != self.at[k] or axis in always:
                out.append(self._word(axis, to[k] - self.at[k] if self.incremental else to[k]))
        return " ".join(out)

    def _f(self, feed: float) -> str:
        if feed == self.feed:
            return ""
        self.feed = feed
        return f" F{feed / INCH_MM:.2f}" if self.inch else f" F{feed:g}."

    def _go(self, code: str, words: str, feed: float = 0.0, comment: str = "") -> None:
        head = "" if code == self.mode else code + " "
        self.mode = code
        self.lines.append(f"{head}{words}{self._f(feed) if feed else ''}{comment}")

    def _grid(self, x: float, y: float, z: float) -> Array:
        return np.round(np.array([x, y, z]) / self.unit_mm)

    @property
    def z(self) -> float:
        """Height of the tip, mm."""
        return float(self.at[2] * self.unit_mm)

    def rapid(self, x: float, y: float, z: float, first: bool = False) -> None:
        """G00."""
        to = self._grid(x, y, z)
        if first and self.incremental:
            self.lines.append("G90")
            kept, self.incremental = self.incremental, False
            self._go("G00", self._axes(to, "XYZ"))
            self.incremental = kept
            self.lines.append("G91")
        elif (to != self.at).any() or first:
            self._go("G00", self._axes(to, "XYZ" if first else ""))
        self.at = to

    def line(self, x: float, y: float, feed: float, z: float | None = None) -> None:
        """G01."""
        to = self._grid(x, y, self.z if z is None else z)
        if (to != self.at).any():
            comment = " (WALL)" if self.rng.uniform() < 0.05 else ""
            self._go("G01", self._axes(to), feed, comment)
            self.at = to

    def arc(self, x: float, y: float, centre: tuple[float, float], ccw: bool, feed: float) -> None:
        """G02 or G03 in XY, less than a full turn."""
        to = self._grid(x, y, self.z)
        if (to[:2] == self.at[:2]).all():
            return
        c = np.array(centre) / self.unit_mm
        here = self.at[:2]
        turn = (math.atan2(*(to[:2] - c)[::-1]) - math.atan2(*(here - c)[::-1])) * (1 if ccw else -1) % (2 * math.pi)
        code = "G03" if ccw else "G02"
        if self.rng.uniform() < 0.5 and 0.2 < turn < 2.8:
            radius = round(float(np.hypot(*(here - c))))
            words = f"{self._axes(to)} {self._word('R', radius)}"
        else:
            i, j = np.round(c - here)
            words = f"{self._axes(to)} {self._word('I', i)} {self._word('J', j)}"
        self._go(code, words, feed)
        self.at = to


def _fillet(a: Array, b: Array, c: Array, radius: float) -> tuple[Array, Array, Array, bool] | None:
    """Rounds the corner b: begin, end, centre, counter-clockwise; None if it does not fit."""
    u, v = (b - a) / np.hypot(*(b - a)), (c - b) / np.hypot(*(c - b))
    turn = math.atan2(u[0] * v[1] - u[1] * v[0], u @ v)
    reach = radius * math.tan(abs(turn) / 2.0)
    if abs(turn) < 0.15 or abs(turn) > 2.6 or reach > 0.4 * min(np.hypot(*(b - a)), np.hypot(*(c - b))):
        return None
    side = math.copysign(1.0, turn)
    begin = b - reach * u
    return begin, b + reach * v, begin + side * radius * np.array([-u[1], u[0]]), turn > 0


def star(rng: np.random.Generator, size: float) -> Array:
    """A polygon around the origin, counter-clockwise."""
    n = int(rng.integers(4, 8))
    angle = 2.0 * math.pi * (np.arange(n) + rng.uniform(-0.25, 0.25, n)) / n
    radius = size * rng.uniform(0.65, 1.15, n)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def closed(w: Writer, corners: Array, rounds: list[float], feed: float, reverse: bool) -> None:
    """Along a polygon, from the middle of its first side, with rounded corners where they fit."""
    order = corners[::-1] if reverse else corners
    rounds = rounds[::-1] if reverse else rounds
    n = len(order)
    middle = 0.5 * (order[0] + order[-1])
    for k in range(n):
        a, b, c = order[k - 1], order[k], order[(k + 1) % n]
        fillet = _fillet(a if k else middle, b, c if k < n - 1 else middle, rounds[k]) if rounds[k] > 0 else None
        if fillet is None:
            w.line(*b, feed)
        else:
            w.line(*fillet[0], feed)
            w.arc(*fillet[1], tuple(fillet[2]), fillet[3], feed)
    w.line(*middle, feed)


def _ring(shape: shapely.Geometry) -> str:
    points = np.asarray(shape.coords)[:-1]
    return "[" + ", ".join(f"[{x:.6f}, {y:.6f}]" for x, y in points) + "]"


def _polygon_toml(shape: shapely.Polygon, bottom: float, top: float, table: str = "polygon") -> str:
    holes = ", ".join(_ring(hole) for hole in shape.interiors)
    return (
        f"[{table}]\npoints_mm = {_ring(shape.exterior)}\nholes_mm = [{holes}]\nz_mm = [{bottom:.3f}, {top:.3f}]\n"
    )  # fmt: skip


def random_mill(rng: np.random.Generator, rev_per_min: float | None = None) -> tuple[EndMill, str]:
    """A tool and its file, without limits."""
    diameter = float(rng.choice([6.0, 8.0, 10.0, 12.0, 16.0]))
    flutes = int(rng.integers(2, 5))
    helix = float(rng.choice([0.0, 20.0, 30.0, 38.0, 45.0], p=[0.1, 0.2, 0.3, 0.2, 0.2]))
    speed = rev_per_min or float(rng.choice([1800.0, 3000.0, 5000.0]))
    local = bool(rng.uniform() < 0.4)
    specific = float(rng.uniform(200.0, 900.0))
    exponents = [float(rng.uniform(-0.3, 0.0)), float(rng.uniform(-0.1, 0.0))]
    ratio = float(rng.uniform(0.2, 0.5))
    edges = [float(rng.uniform(0.0, 8.0)), float(rng.uniform(0.0, 8.0))] if rng.uniform() < 0.5 else [0.0, 0.0]
    flute_length, overhang = 2.5 * diameter, 4.0 * diameter
    holder = float(rng.choice([math.inf, 30.0]))
    mill = EndMill(
        diameter, flutes, helix, specific, exponents[0], ratio, exponents[1], edges[0], edges[1], local, speed,
        overhang, flute_length, diameter, 0.8 * diameter, 600.0, holder,
    )  # fmt: skip
    text = (
        f'[tool]\nname = "mill"\ndiameter_mm = {diameter}\nflutes = {flutes}\nhelix_deg = {helix}\n'
        f"flute_length_mm = {flute_length}\noverhang_mm = {overhang}\n"
        + (f"holder_stiffness_n_per_um = {holder}\n" if math.isfinite(holder) else "")
        + f"[cutting]\nspecific_n_per_mm2 = {specific!r}\nspecific_exponent = {exponents[0]!r}\nratio = {ratio!r}\n"
        f"ratio_exponent = {exponents[1]!r}\ntangential_edge_n_per_mm = {edges[0]!r}\n"
        f'radial_edge_n_per_mm = {edges[1]!r}\nchip_thickness = "{"local" if local else "mean"}"\n'
    )
    return mill, text


def limits_toml(limits: dict[str, float], *, mean: bool = False, air: float = 0.0, most: float = 0.0) -> str:
    """The tables of limits and feed."""
    text = "[limits]\n" + "".join(f"{name} = {value!r}\n" for name, value in limits.items())
    text += 'resultant = "mean"\n' if mean else ""
    text += "[feed]\n" + (f"air_feed_mm_per_min = {air!r}\n" if air else "")
    return text + (f"max_feed_mm_per_min = {most!r}\n" if most else "")


def random_case(rng: np.random.Generator, kind: str, *, feed: float, rev_per_min: float | None = None) -> Case:
    """kind: "outside" contour on a polygon stock, "inside" finishing of a pocket, "pocket" out of a box, "island"."""
    mill, text = random_mill(rng, rev_per_min)
    radius = 0.5 * mill.diameter
    incremental, inch = bool(rng.uniform() < 0.3), bool(rng.uniform() < 0.25)
    w = Writer(rng, incremental, inch)
    levels = [-float(v) for v in np.cumsum(np.round(rng.uniform(0.2, 0.7, int(rng.integers(1, 4))) * radius, 2))]
    bottom, top = levels[-1] - 1.0, 0.0
    safe = 3.0
    w.lines += ["%", "O0001", f"G17 {'G20' if inch else 'G21'} G90 G94 G40 G80", "(MAIN)", f"S{mill.rev_per_min:g} M03"]
    allowance = float(rng.uniform(0.08, 0.35)) * mill.diameter
    if kind in ("outside", "inside"):
        size = 5.0 * radius
        corners = star(rng, size)
        rounds = [float(rng.choice([0.0, 0.3, 0.8])) * radius for _ in corners]
        axis = shapely.Polygon(corners)
        if kind == "outside":
            stock = axis.buffer(-radius, quad_segs=32).buffer(allowance, join_style="mitre", quad_segs=32)
            shapes = [stock] if isinstance(stock, shapely.Polygon) else list(stock.geoms)
            stock = max(shapes, key=lambda shape: shape.area)
        else:
            hole = axis.buffer(radius, quad_segs=32).buffer(-allowance, quad_segs=32)
            # What a rough tool of 1.3 radii left in the corners.
            hole = hole.buffer(-1.3 * radius, quad_segs=32).buffer(1.3 * radius, quad_segs=32)
            if not isinstance(hole, shapely.Polygon):
                hole = max(hole.geoms, key=lambda shape: shape.area)
            stock = shapely.Polygon(shapely.box(-4 * size, -4 * size, 4 * size, 4 * size).exterior, [hole.exterior])
        stock = shapely.set_precision(stock, 0.0, mode="pointwise")
        stock_text = _polygon_toml(stock, bottom, top)
        blocks = [Block(stock, bottom, top)]
        reverse = bool(rng.uniform() < 0.5)
        first = 0.5 * (corners[0] + corners[-1])
        away = first / np.hypot(*first) * (mill.diameter + allowance + 2.0)
        begin = first + away if kind == "outside" else np.zeros(2)
        w.rapid(*begin, safe, first=True)
        for level in levels:
            w.rapid(*begin, safe)
            w.line(*begin, feed, z=level)
            w.line(*first, feed)
            closed(w, corners, rounds, feed, reverse)
            w.line(*begin, feed)
            w.rapid(*begin, safe)
            if rng.uniform() < 0.4:
                w.lines.append(str(rng.choice(["M08", "(NEXT LEVEL)", "G04 P100"])))
    else:
        x, y = float(rng.uniform(3.5, 6.0)) * radius, float(rng.uniform(3.0, 5.0)) * radius
        stock = shapely.box(-x - 3 * radius, -y - 3 * radius, x + 3 * radius, y + 3 * radius)
        blocks = [Block(stock, bottom, top)]
        (x0, y0, x1, y1) = stock.bounds
        stock_text = f"[box]\nx_mm = [{x0!r}, {x1!r}]\ny_mm = [{y0!r}, {y1!r}]\nz_mm = [{bottom!r}, {top!r}]\n"
        pitch = float(rng.uniform(0.3, 0.7)) * mill.diameter
        if kind == "pocket":
            w.rapid(0.0, 0.0, safe, first=True)
            for level in levels:
                w.rapid(0.0, 0.0, safe)
                w.line(0.0, 0.0, feed, z=level)
                rings = max(2, math.ceil(y / pitch))
                for k in range(1, rings + 1):
                    a, b = x * k / rings, y * k / rings
                    w.line(a, w.at[1] * w.unit_mm, feed)
                    corner = np.array([[a, b], [-a, b], [-a, -b], [a, -b]])
                    curve = float(rng.choice([0.0, 0.0, 0.5])) * radius if k == rings else 0.0
                    closed(w, corner, [curve] * 4, feed, False)
                w.line(0.5 * x, 0.0, feed)
                w.rapid(0.5 * x, 0.0, safe)
                if rng.uniform() < 0.4:
                    w.lines.append("M08")
        else:  # rows along X with an island of air: rows leave the block at both ends
            out = x + 3 * radius + radius + 1.0
            w.rapid(-out, -y, safe, first=True)
            for level in levels:
                w.rapid(-out, -y - 2 * radius, safe)
                w.line(-out, -y - 2 * radius, feed, z=level)
                row, side = -y - 2 * radius, 1.0
                while row < 0.0:
                    w.line(side * out, row, feed)
                    row += pitch
                    if rng.uniform() < 0.5:
                        w.arc(side * out, row, (side * out, row - 0.5 * pitch), side > 0, feed)
                    else:
                        w.line(side * out, row, feed)
                    side = -side
                w.rapid(w.at[0] * w.unit_mm, w.at[1] * w.unit_mm, safe)
    w.lines += ["M05", "M30", "%", ""]
    return Case("\n".join(w.lines), text, stock_text, mill, blocks, {}, incremental, inch)
