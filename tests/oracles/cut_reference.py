"""Cutting forces of an end mill, independent of shapegcode: means over a revolution in closed form, records by sums.

Forces on the tool, x along the feed, y to its left, clockwise spindle. A tooth at azimuth t from the feed moves along
(sin t, -cos t); the tangential force on it points the other way, the radial one to the axis; its chip is f cos t thick.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

PAPER: dict[str, float] = {
    "specific_n_per_mm2": 221.3,
    "specific_exponent": -0.153,
    "ratio": 0.41,
    "ratio_exponent": -0.0775,
}


def mean_chip(begin: Array, end: Array, feed_per_tooth: Array | float) -> Array:
    """Mean of f cos t over the engagement."""
    return np.asarray(feed_per_tooth * (np.sin(end) - np.sin(begin)) / (end - begin))


def mean_force(
    begin: Array, end: Array, feed_per_tooth: Array | float, flutes: int, axial_mm: float, law: Mapping[str, float]
) -> Array:
    """(n, 2) mean force over a revolution, coefficients of the mean chip; the helix does not matter."""
    chip = mean_chip(begin, end, feed_per_tooth)
    k1 = law["specific_n_per_mm2"] * chip ** law["specific_exponent"]
    k2 = law["ratio"] * chip ** law["ratio_exponent"]
    kte, kre = law.get("tangential_edge_n_per_mm", 0.0), law.get("radial_edge_n_per_mm", 0.0)
    sine, cosine = np.sin(end) - np.sin(begin), np.cos(begin) - np.cos(end)  # integrals of cos t, sin t
    double = 0.25 * (np.cos(2 * begin) - np.cos(2 * end))  # of sin t cos t
    square = 0.5 * (end - begin) + 0.25 * (np.sin(2 * end) - np.sin(2 * begin))  # of cos^2 t
    turn = flutes * axial_mm / (2.0 * math.pi)
    x = k1 * feed_per_tooth * (-double - k2 * square) - kte * cosine - kre * sine
    y = k1 * feed_per_tooth * (square - k2 * double) + kte * sine - kre * cosine
    return turn * np.column_stack([x, y])


def climb_arc(depth: Array, radius: float) -> tuple[Array, Array]:
    """Azimuths of a straight down-milling cut: material on the right."""
    return np.full(len(depth), -0.5 * math.pi), -np.arccos(np.sqrt(1.0 - (1.0 - np.asarray(depth) / radius) ** 2))


def record(
    x_of_time: Callable[[Array], Array],
    arc: Callable[[Array], tuple[Array, Array]],
    times_s: Array,
    *,
    feed_mm_per_min: Callable[[Array], Array],
    spindle: float,
    diameter: float,
    flutes: int,
    helix_deg: float,
    axial_mm: float,
    law: Mapping[str, float],
    runout_mm: tuple[float, ...] = (),
    slices: int = 24,
    phase: float = 0.3,
) -> Array:
    """(n, 2) force on the tool at each instant, summed over flutes and slices of the axis."""
    x = x_of_time(times_s)
    begin, end = arc(x)
    pitch = feed_mm_per_min(x) / spindle / flutes
    width = np.maximum(end - begin, 1e-12)
    chip = np.maximum(pitch * (np.sin(end) - np.sin(begin)) / width, 1e-9)
    k1 = law["specific_n_per_mm2"] * chip ** law["specific_exponent"]
    k2 = law["ratio"] * chip ** law["ratio_exponent"]
    force = np.zeros((len(times_s), 2))
    turned = phase - 2.0 * math.pi * spindle / 60.0 * times_s  # clockwise
    dz = axial_mm / slices
    for flute in range(flutes):
        # What flute j teeth before left; none may cut more than there is.
        ahead = [(j, runout_mm[flute] - runout_mm[flute - j] if runout_mm else 0.0) for j in range(1, flutes + 1)]
        for z in (np.arange(slices) + 0.5) * dz:
            lag = z * math.tan(math.radians(helix_deg)) / (0.5 * diameter)
            t = turned + 2.0 * math.pi * flute / flutes + lag
            t = (t + math.pi) % (2.0 * math.pi) - math.pi
            cuts = np.flatnonzero((t > begin) & (t < end))
            sine, cosine = np.sin(t[cuts]), np.cos(t[cuts])
            left = np.min([j * pitch[cuts] * cosine + more for j, more in (ahead if runout_mm else ahead[:1])], axis=0)
            tangential = k1[cuts] * np.maximum(left, 0.0) * dz
            radial = k2[cuts] * tangential
            force[cuts, 0] -= tangential * sine + radial * cosine
            force[cuts, 1] += tangential * cosine - radial * sine
    return force


def rows(columns: Mapping[str, Any]) -> str:
    """CSV text of columns."""
    text = io.StringIO()
    np.savetxt(
        text, np.column_stack(list(columns.values())), "%.7g", delimiter=",", header=",".join(columns), comments=""
    )
    return text.getvalue()


def local_mean_force(
    begin: float, end: float, feed_per_tooth: float, flutes: int, axial_mm: float, law: Mapping[str, float]
) -> Array:
    """Mean force over a revolution with coefficients of the local chip, by Gauss-Legendre quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    # Equal steps of the square root of the distance to the thin end: the force has a fractional power there.
    root = math.sqrt(end - begin) * 0.5 * (nodes + 1.0)
    t = begin + root**2
    weights = weights * 0.5 * math.sqrt(end - begin) * 2.0 * root
    chip = feed_per_tooth * np.cos(t)
    tangential = law["specific_n_per_mm2"] * chip ** (1.0 + law["specific_exponent"])
    radial = tangential * law["ratio"] * chip ** law["ratio_exponent"]
    x = float(weights @ (-tangential * np.sin(t) - radial * np.cos(t)))
    y = float(weights @ (tangential * np.cos(t) - radial * np.sin(t)))
    return flutes * axial_mm / (2.0 * math.pi) * np.array([x, y])


def met_by_circle(edge: Callable[[Array], Array], x: Array, radius: float, length: float) -> tuple[Array, Array]:
    """Azimuths at which the front of a tool is in material below an edge over 0 ... length, its wall at height 0.

    By trying points of the front half, on stations between which is interpolated.
    """
    stations = np.arange(x.min() - 0.08, x.max() + 0.16, 0.08)
    t = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 3001)
    begin, end = np.zeros(len(stations)), np.zeros(len(stations))
    for k, at in enumerate(stations):
        px, py = at + radius * np.cos(t), radius + radius * np.sin(t)
        inside = (px >= 0.0) & (px <= length) & (py <= edge(px))
        if inside.any():
            begin[k], end[k] = t[np.argmax(inside)], t[len(t) - 1 - np.argmax(inside[::-1])]
    return np.interp(x, stations, begin), np.interp(x, stations, end)


def lagging_way(blocks: list[tuple[float, float]], start: float, lag_s: float, step_s: float = 5e-4) -> Array:
    """Way over time at the feeds of blocks (end, mm/min), followed with a first-order lag: rows of time and X."""
    x, speed, time, rows = start, blocks[0][1] / 60.0, 0.0, [(0.0, start)]
    for end, feed in blocks:
        while x < end:
            speed += (feed / 60.0 - speed) * (step_s / lag_s if lag_s > step_s else 1.0)
            x += speed * step_s
            time += step_s
            rows.append((time, x))
    return np.array(rows)
