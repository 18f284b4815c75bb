"""Time per sample of the force model along paper 001's corner: `python tests/benchmarks/milling_force.py`."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from math import radians

import numpy as np
from table import Sample, markdown, timed

from shapegcode._core import (
    ChipThickness,
    CornerCut,
    CuttingCoefficients,
    EndMill,
    FeedLimits,
    MillingForce,
    ToolBeam,
    WallSide,
    largest_feeds,
    wall_errors_um,
)

_BEAM = ToolBeam(30.0, 20.0, 6.4, 8.0, 600.0)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=5)
    repetitions = parser.parse_args().repetitions
    track = CornerCut(4.0, 8.0, 8.0, 0.8).track(15.0, 0.005)
    feeds = np.linspace(216.0, 90.0, len(track))
    heights = np.linspace(0.5, 14.5, 15)
    rows = []
    for name, thickness, edge, runout in (
        ("6 flutes, mean chip", ChipThickness.mean, 0.0, []),
        ("6 flutes, local chip, edge forces", ChipThickness.local, 5.0, []),
        ("6 flutes, local chip, runout", ChipThickness.local, 0.0, [0.003, -0.001, 0.002, -0.004, 0.001, -0.001]),
    ):
        coefficients = CuttingCoefficients(221.3, -0.153, 0.41, -0.0775, edge, edge, thickness)
        force = MillingForce(EndMill(8.0, 6, radians(50.0), runout), coefficients, 1800.0)
        limit = force.figures_of(track, np.full(len(track), 216.0))["peak_resultant_n"][0]
        plain = FeedLimits(peak_resultant_n=limit, peak_torque_nm=0.2)
        bent = FeedLimits(peak_resultant_n=limit, peak_torque_nm=0.2, peak_deflection_um=15.0, beam=_BEAM)
        works: list[Callable[[], object]] = [
            lambda force=force: force.figures_of(track, feeds),
            lambda force=force, limits=plain: largest_feeds(force, track, limits, 10.0, 1000.0),
            lambda force=force, limits=bent: largest_feeds(force, track, limits, 10.0, 1000.0),
            lambda force=force: wall_errors_um(force, _BEAM, track, feeds, WallSide.right, heights),
        ]
        rows.append([name, *(str(_microseconds(work, len(track), repetitions)) for work in works)])
    print(f"{len(track)} samples; microseconds of processor time per sample, median (least - largest)\n")
    print(markdown(["tool", "figures", "largest feed", "the same with deflection", "wall at 15 heights"], rows))


def _microseconds(work: Callable[[], object], samples: int, repetitions: int) -> Sample:
    return Sample.of([1e6 * timed(work, time.process_time)[0] / samples for _ in range(repetitions)])


if __name__ == "__main__":
    main()
