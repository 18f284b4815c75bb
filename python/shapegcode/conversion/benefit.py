"""What shaping a region gains, and which regions are better left as they are.

What counts is what a part shows: the vibration that is left behind a stop, and how far the table leaves the path.
The peak of |table - command| on the way is reported, but counts for nothing here: across the path it is in the contour
error, along the path it leaves no mark.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shapegcode import _core
from shapegcode.verdict.judge import RegionFigures

__all__ = ["KeptRegion", "gain_um", "most_to_gain_um", "summary"]


@dataclass(frozen=True)
class KeptRegion:
    """A region that keeps its text although it could be shaped.

    Attributes:
        lines: first and last, of the original.
        reason: why, in words.
        gain_um: what shaping it would gain at most, or gained: the larger fall of residual vibration and contour
            error of the table.
        cutting_s: how long it takes.
    """

    lines: tuple[int, int]
    reason: str
    gain_um: float
    cutting_s: float


def _figures_um(played: _core.PlaybackFigures) -> tuple[float, float]:
    """Residual vibration of the worst axis, contour error of the table."""
    return float(np.max(played.residual_mm)) * 1e3, played.response.max_abs_mm * 1e3


def most_to_gain_um(original: _core.PlaybackFigures) -> float:
    """The most that shaping can gain: what is there.

    Args:
        original: the region as programmed, played.

    Returns:
        The larger of residual vibration and contour error of the table, µm.
    """
    return max(_figures_um(original))


def gain_um(figures: RegionFigures) -> float:
    """What shaping gained: the larger fall of the two figures, the emitted one in the worse rule.

    Args:
        figures: the region as programmed and as emitted.

    Returns:
        In µm; 0 where nothing became better.
    """
    after = np.max([_figures_um(run) for run in figures.emitted], axis=0)
    return max(0.0, float(np.max(np.asarray(_figures_um(figures.original)) - after)))


def summary(kept: Sequence[KeptRegion], least_um: float) -> str:
    """One sentence for all kept regions; empty where there is none.

    Args:
        kept: the regions.
        least_um: `shaping.least_gain_um`.

    Returns:
        How many they are, how long they take, and why.
    """
    if not kept:
        return ""
    count = f"{len(kept)} region{'' if len(kept) == 1 else 's'}"
    missed = [region for region in kept if region.gain_um >= least_um]
    reasons = []
    if len(missed) < len(kept):
        reasons.append(f"shaping would gain less than {least_um:g} µm (shaping.least_gain_um)")
    if missed:
        worst = max(missed, key=lambda region: region.gain_um)
        many = f"in {len(missed)} of them " if reasons else ""
        where = (
            "lines {} to {}".format(*worst.lines) if len(missed) == 1 else "such as lines {} to {}".format(*worst.lines)
        )
        reasons.append(f"{many}a tolerance would be missed, {where}: {worst.reason}")
    time_s = sum(region.cutting_s for region in kept)
    return f"{count} ({time_s:.1f} s of cutting) as programmed: {'; '.join(reasons)}"
