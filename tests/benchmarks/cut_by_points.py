"""Engagement and force of an end mill by brute force, sharing no code with the core: points, discs and sums.

The tool's path is a row of points; material stands where the stock is and no earlier point of the path, low enough, is
nearer than the radius. The flutes are cut into discs, whose forces are added up angle by angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]

_AZIMUTHS = np.radians(np.linspace(-90.0, 90.0, 721))
_TURNS = 90
_DISCS_PER_SLICE = 3
_TOUCH_MM = 2e-5


@dataclass(frozen=True)
class Cutter:
    """An end mill and its cutting force, as a power law of the mean chip thickness."""

    radius_mm: float
    flutes: int
    helix_rad: float
    specific: tuple[float, float]
    ratio: tuple[float, float]


@dataclass(frozen=True)
class Block:
    """A stock: low and high corner, mm."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]


def engaged(
    past: Vector, here: Vector, heading: float, block: Block, radius_mm: float, slice_mm: float
) -> npt.NDArray[np.bool_]:
    """Which azimuths of the front half meet material, (slices above the tip, azimuths).

    Args:
        past: points of the path so far, (n, 3).
        here: where the tip is, (3,).
        heading: of the feed, from +X, rad.
        block: the stock.
        radius_mm: of the tool.
        slice_mm: height of a slice; tips end on whole slices below the stock's top.
    """
    rim = here[:2] + radius_mm * np.column_stack((np.cos(heading + _AZIMUTHS), np.sin(heading + _AZIMUTHS)))
    inside = ((rim > np.array(block.low[:2])) & (rim < np.array(block.high[:2]))).all(axis=1)
    past = past[(np.abs(past[:, :2] - here[:2]) <= 2.0 * radius_mm).all(axis=1)]
    distance = np.hypot(*(rim[:, None, :] - past[None, :, :2]).transpose(2, 0, 1))
    gone = distance < radius_mm - _TOUCH_MM
    count = max(round((block.high[2] - here[2]) / slice_mm), 0)
    middles = here[2] + slice_mm * (np.arange(count) + 0.5)
    return np.array([inside & ~gone[:, past[:, 2] < middle].any(axis=1) for middle in middles]).reshape(count, -1)


def peak_resultant_n(mask: npt.NDArray[np.bool_], cutter: Cutter, slice_mm: float, feed_per_tooth_mm: float) -> float:
    """Largest XY force over a revolution of a clockwise spindle; every flute alike, so one pitch says all."""
    if not mask.any():
        return 0.0
    chip = feed_per_tooth_mm * np.cos(_AZIMUTHS)
    mean = float((mask * chip).sum() / mask.sum())
    k1, k2 = (factor * mean**exponent for factor, exponent in (cutter.specific, cutter.ratio))
    disc_mm = slice_mm / _DISCS_PER_SLICE
    heights = disc_mm * (np.arange(len(mask) * _DISCS_PER_SLICE) + 0.5)
    pitch = 2.0 * np.pi / cutter.flutes
    turned = pitch * np.arange(_TURNS) / _TURNS
    flute = pitch * np.arange(cutter.flutes)
    lag = heights * np.tan(cutter.helix_rad) / cutter.radius_mm
    azimuth = lag[:, None, None] - turned[None, :, None] - flute[None, None, :]
    azimuth = (azimuth + np.pi) % (2.0 * np.pi) - np.pi
    front = np.abs(azimuth) < 0.5 * np.pi
    step = _AZIMUTHS[1] - _AZIMUTHS[0]
    cell = np.clip(np.rint((azimuth - _AZIMUTHS[0]) / step).astype(int), 0, len(_AZIMUTHS) - 1)
    row = np.repeat(np.arange(len(mask)), _DISCS_PER_SLICE)[:, None, None]
    tangential = np.where(front & mask[row, cell], k1 * feed_per_tooth_mm * np.cos(azimuth) * disc_mm, 0.0)
    radial = k2 * tangential
    x = (-tangential * np.sin(azimuth) - radial * np.cos(azimuth)).sum(axis=(0, 2))
    y = (tangential * np.cos(azimuth) - radial * np.sin(azimuth)).sum(axis=(0, 2))
    return float(np.hypot(x, y).max())
