"""The pictures of a conversion: the region that vibrates most, before and after."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shapegcode.conversion.convert import Conversion
from shapegcode.machine import Machine
from shapegcode.model.machine_model import MachineModel
from shapegcode.results import plot
from shapegcode.results.motion_pictures import RECORD_SAMPLES, PlayedRegion, motion_pictures


def write_pictures(conversion: Conversion, machine: Machine, folder: str | Path) -> list[str]:
    """Path, feed and vibration of the region that vibrates most after its stop, before and after.

    Returns:
        The files written; none for a program without shaped regions.

    Raises:
        OSError: the folder cannot be made or a file not be written.
    """
    if not conversion.placed:
        return []
    residuals = [max(region["residual_vibration_um"]["original"].values()) for region in conversion.report["regions"]]
    place = conversion.placed[int(np.argmax(residuals))]

    def played() -> PlayedRegion:
        model, path = MachineModel(machine), place.region.path
        offset = model.offset(place.region)
        blocks = conversion.emitted.core.cutting_path(place.first_line, place.last_line)
        runs = {
            "original": model.play_original(path, record_samples=RECORD_SAMPLES, offset=offset),
            "emitted": model.play_emitted(blocks, path, record_samples=RECORD_SAMPLES, offset=offset),
        }
        lines = (place.region.first_line, place.region.last_line)
        return PlayedRegion.of_runs(runs, path, model.period_s, lines=lines, regions=len(residuals))

    return plot.save_all(motion_pictures(played), folder)
