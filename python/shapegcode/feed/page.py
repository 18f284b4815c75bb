"""The motion on the page of a schedule of feeds, with the cutting force along it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from shapegcode._core import Region
from shapegcode.feed.result import FeedSchedule
from shapegcode.results.page.scene import Scene, Variant

__all__ = ["with_forces"]

FloatArray = npt.NDArray[np.float64]


def with_forces(scene: Scene, schedule: FeedSchedule) -> Scene:
    """The motion with the largest resultant in a revolution, by place along each region."""
    loads = schedule.loads
    regions = [[part.region for part in schedule.survey.regions], list(schedule.written.regions)]
    variants = []
    for variant, own, side in zip(scene.variants, regions, ("original", "emitted"), strict=True):
        known = [
            (region, load.s_mm, getattr(load, side).peak_resultant_n)
            for region, load in zip(own, loads, strict=True)
            if load is not None
        ]
        force = _along(variant, known)
        variants.append(replace(variant, channels=dict(variant.channels) | {"force": force}))
    return replace(scene, variants=tuple(variants))


def _along(variant: Variant, known: Sequence[tuple[Region, FloatArray, FloatArray]]) -> FloatArray:
    """Force at each kept sample: by its share of the way through its region."""
    force = np.zeros(len(variant.sample))
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(variant.command_mm, axis=0), axis=1))])
    for region, stations_mm, values_n in known:
        rows = np.flatnonzero((variant.line >= region.first_line) & (variant.line <= region.last_line))
        if len(rows) < 2 or not len(stations_mm) or way[rows[-1]] <= way[rows[0]]:
            continue
        # The thinned way is a little shorter than the path: both are taken from their beginning to their end.
        share = (way[rows] - way[rows[0]]) / (way[rows[-1]] - way[rows[0]])
        force[rows] = np.interp(share * stations_mm[-1], stations_mm, values_n)
    return force
