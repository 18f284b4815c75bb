"""End-milling forces by brute force: a tool of many discs, turned in small steps; shares no code with the core.

Frame, signs and azimuths are the core's (x along the feed, y to its left, clockwise spindle). The chip of a tooth is
not taken from a formula: the surface that every tooth leaves is kept, and each cuts down to its own circle.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Cutter:
    """Tool, laws of the force (N, mm) and spindle."""

    diameter_mm: float
    flutes: int
    helix_rad: float
    specific: float
    specific_exponent: float = 0.0
    ratio: float = 0.0
    ratio_exponent: float = 0.0
    tangential_edge: float = 0.0
    radial_edge: float = 0.0
    local: bool = True
    runout_mm: tuple[float, ...] = ()


@dataclass
class Turn:
    """One revolution: forces (n, 2) N, torque (n,) N mm, power (n,) in N times the cutting speed."""

    force: Array
    torque: Array
    power: Array
    flutes: list[Array] = field(default_factory=list)
    # Force of each disc: (n, discs, 2), and the discs' heights.
    by_height: Array = field(default_factory=lambda: np.empty(0))
    height_mm: Array = field(default_factory=lambda: np.empty(0))


def chips(cutter: Cutter, feed_per_tooth_mm: float, azimuth: Array) -> Array:
    """Chip of every flute at every azimuth, (flutes, n), in the steady state of a tool that keeps on moving."""
    runout = np.array(cutter.runout_mm or (0.0,) * cutter.flutes)
    surface = np.full(azimuth.shape, -np.inf)
    thickness = np.zeros((cutter.flutes, *azimuth.shape))
    forwards = feed_per_tooth_mm * np.cos(azimuth)
    for tooth in range(4 * cutter.flutes):  # the first revolutions only make the surface
        flute = tooth % cutter.flutes
        reach = tooth * forwards + runout[flute]
        thickness[flute] = np.maximum(reach - surface, 0.0)
        surface = np.maximum(surface, reach)
    return thickness


def turn(
    cutter: Cutter, arcs: Array, feed_per_tooth_mm: float, *, angles: int = 720, discs: int = 60, whole: bool = False
) -> Turn:
    """Forces at equal angles of the spindle; `arcs` (m, 4): from, to in rad, bottom, top in mm.

    `whole`: a disc cuts wholly or not at all, as its middle does.
    """
    turned = 2.0 * np.pi * np.arange(angles) / angles
    lag = np.tan(cutter.helix_rad) / (0.5 * cutter.diameter_mm)
    extent = sum((b - a) * (top - bottom) for a, b, bottom, top in arcs)
    mean = feed_per_tooth_mm * sum((np.sin(b) - np.sin(a)) * (top - bottom) for a, b, bottom, top in arcs) / extent
    flutes = [np.zeros((angles, 2)) for _ in range(cutter.flutes)]
    torque = np.zeros(angles)
    power = np.zeros(angles)
    by_height = []
    heights = []
    for start, end, bottom, top in arcs:
        dz = (top - bottom) / discs
        z = bottom + dz * (np.arange(discs) + 0.5)
        heights.append(z)
        discs_force = np.zeros((angles, discs, 2))
        for flute in range(cutter.flutes):
            azimuth = 2.0 * np.pi * flute / cutter.flutes - turned[:, None] + lag * z[None, :]
            azimuth = np.remainder(azimuth + np.pi, 2.0 * np.pi) - np.pi
            # Of a disc that an arc's end passes only the part within it cuts.
            half = max(0.5 * lag * dz, 1e-12)
            low, high = np.maximum(azimuth - half, start), np.minimum(azimuth + half, end)
            if whole:
                inside = (azimuth > start) & (azimuth < end)
                low, high = np.where(inside, azimuth - half, 0.0), np.where(inside, azimuth + half, 0.0)
            azimuth = 0.5 * (low + high)
            chip = chips(cutter, feed_per_tooth_mm, azimuth)[flute]
            cutting = (high > low) & (chip > 1e-15)
            chip = np.where(cutting, chip, 1.0)
            width = np.where(cutting, dz * (high - low) / (2.0 * half), 0.0)
            law = chip if cutter.local else np.full(chip.shape, mean)
            k1 = cutter.specific * law**cutter.specific_exponent
            k2 = cutter.ratio * law**cutter.ratio_exponent
            along = (k1 * chip + cutter.tangential_edge) * width
            across = (k2 * k1 * chip + cutter.radial_edge) * width
            outwards = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
            moving = np.stack([np.sin(azimuth), -np.cos(azimuth)], axis=-1)  # of a tooth that turns clockwise
            force = -along[..., None] * moving - across[..., None] * outwards
            flutes[flute] += force.sum(axis=1)
            discs_force += force
            power -= np.sum(force * moving, axis=(1, 2))
            arm = 0.5 * cutter.diameter_mm * outwards
            torque += np.sum(arm[..., 0] * force[..., 1] - arm[..., 1] * force[..., 0], axis=1)
        by_height.append(discs_force)
    return Turn(sum(flutes), torque, power, flutes, np.concatenate(by_height, axis=1), np.concatenate(heights))
