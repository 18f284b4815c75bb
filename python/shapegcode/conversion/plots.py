"""The pictures of a conversion: the region that vibrates most, before and after."""

from __future__ import annotations

from functools import partial

from shapegcode.conversion.result import Conversion
from shapegcode.results.motion_pictures import RECORD_SAMPLES, PlayedRegion, motion_pictures
from shapegcode.results.result import Plot

__all__ = ["plots_of"]


def plots_of(conversion: Conversion) -> dict[str, Plot]:
    """Path, feed and vibration of the region that vibrates most after its stop, before and after.

    Args:
        conversion: its region is played again when the first picture is drawn.

    Returns:
        By name; none for a program without shaped regions.
    """
    return motion_pictures(partial(_played, conversion)) if conversion.placed else {}


def _played(conversion: Conversion) -> PlayedRegion:
    worst = max(
        range(len(conversion.regions)), key=lambda rank: max(conversion.regions[rank].residual_vibration_um.original)
    )
    place, model = conversion.placed[worst], conversion.model
    path, blocks = place.region.path, place.blocks(conversion.emitted)
    offset = model.offset(place.region)
    runs = {
        "original": model.play_original(path, record_samples=RECORD_SAMPLES, offset=offset),
        "emitted": model.play_emitted(blocks, path, record_samples=RECORD_SAMPLES, offset=offset),
    }
    return PlayedRegion.of_runs(runs, path, model.period_s, lines=place.original_lines, regions=len(conversion.regions))
