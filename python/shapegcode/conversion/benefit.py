"""What shaping a cut gains, and what there is to gain.

What counts is what a part shows: the vibration that is left behind a stop, and how far the table leaves the path.
The peak of |table - command| on the way is reported, but counts for nothing here: across the path it is in the contour
error, along the path it leaves no mark.
"""

from __future__ import annotations

import numpy as np

from shapegcode import _core
from shapegcode.verdict.judge import RegionFigures

__all__ = ["gain_um", "most_to_gain_um"]


def _figures_um(played: _core.PlaybackFigures) -> tuple[float, float]:
    """Residual vibration of the worst axis, contour error of the machine table."""
    return float(np.max(played.residual_mm)) * 1e3, played.response.max_abs_mm * 1e3


def most_to_gain_um(original: _core.PlaybackFigures) -> float:
    """The most that shaping can gain: what is there."""
    return max(_figures_um(original))


def gain_um(figures: RegionFigures) -> float:
    """What shaping gained: the larger fall of the two figures, the emitted one in the worse rule."""
    after = np.max([_figures_um(run) for run in figures.emitted], axis=0)
    return max(0.0, float(np.max(np.asarray(_figures_um(figures.original)) - after)))
