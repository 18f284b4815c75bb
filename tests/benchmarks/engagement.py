"""Engagement along a program: `python tests/benchmarks/engagement.py`.

How long it takes for pockets of growing length, and how far the field of distances is from the closed form of a corner
at several resolutions.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from itertools import pairwise
from typing import Any

import numpy as np
from table import Sample, markdown

from shapegcode._core import CornerCut, Material, Path, Segment, layer_borders, sweep

_DIAMETER_MM = 8.0
_BLOCK_MM = 0.5
_SIZE_MM = (100.0, 80.0)
_STEPOVER_MM = 3.2
_LEVEL_MM = 1.0
_BLOCKS = (25_000, 50_000, 100_000, 200_000)
_MAX_SECONDS = 10.0  # for 100 000 blocks, force included: what users were promised


def pocket(blocks: int) -> Path:
    """A pocket of so many levels as the blocks suffice for: forth and back, then once around; blocks of .5 mm."""
    x1, y1 = _SIZE_MM[0] / 2 - _DIAMETER_MM / 2, _SIZE_MM[1] / 2 - _DIAMETER_MM / 2
    rows = np.linspace(-y1, y1, int(np.ceil(2 * y1 / _STEPOVER_MM)) + 1)
    corners = [(side * x1, y) for i, y in enumerate(rows) for side in ((-1, 1) if i % 2 == 0 else (1, -1))]
    corners += [(x1, -y1), (-x1, -y1), (-x1, y1), (x1, y1), (-x1, -y1)]
    segments: list[Segment] = []
    here = np.array([*corners[0], 0.0])
    level = 0
    while len(segments) < blocks:
        level += 1
        for x, y in corners:
            to = np.array([x, y, -_LEVEL_MM * level])
            pieces = max(1, int(np.ceil(np.linalg.norm(to - here) / _BLOCK_MM)))
            ends = here + np.linspace(0.0, 1.0, pieces + 1)[:, None] * (to - here)
            segments += [Segment.line(a, b, 10.0) for a, b in pairwise(ends)]
            here = to
    return Path(segments[:blocks])


def speed(repetitions: int) -> list[dict[str, Any]]:
    """Seconds of one core for each length."""
    rows = []
    outline = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (np.array(_SIZE_MM) / 2 + 5.0)
    for blocks in _BLOCKS:
        path = pocket(blocks)
        bottom = min(path[i].end_mm[2] for i in range(len(path))) - 1.0
        seconds = []
        for _ in range(repetitions):
            begin = time.process_time()
            material = Material([outline], layer_borders([path], bottom, 0.0, _DIAMETER_MM / 10), _DIAMETER_MM / 100)
            track = sweep(material, path, _DIAMETER_MM)
            seconds.append(time.process_time() - begin)
        rows.append(
            {
                "blocks": blocks,
                "layers": len(material),
                "samples": len(track),
                "seconds": seconds,
                "megabytes": material.bytes / 1e6,
            }
        )
    return rows


def accuracy() -> list[dict[str, Any]]:
    """Largest errors on the paper's corners."""
    rows = []
    for resolution in (0.2, 0.1, 0.08, 0.05, 0.02):
        for name, rough, finish in (("case 1", 8.0, 8.0), ("case 2", 4.0, 4.0), ("case 3", 8.0, 4.0)):
            cut = CornerCut(4.0, rough, finish, 0.8, before_mm=30.0, after_mm=30.0)
            track = sweep(Material([cut.stock(8.0)], [-15.0, 0.0], resolution), cut.path(3.6, -15.0), _DIAMETER_MM)
            exact = [
                cut.at(min(s, cut.length_mm), finish == 4.0 and segment == 1)
                for s, segment in zip(track.s_mm, track.segment, strict=True)
            ]
            entry = np.degrees(track.arcs[:, 1] - [at.to_rad for at in exact])
            depth = track.radial_depth_mm - [at.radial_depth_mm for at in exact]
            rows.append(
                {
                    "case": name,
                    "resolution_mm": resolution,
                    "entry_degrees": float(np.abs(entry).max()),
                    "depth_mm": float(np.abs(depth).max()),
                    "largest_depth_mm": float(track.radial_depth_mm.max()),
                }
            )
    return rows


def main() -> int:
    """Measure and print; 0 if the figures of the documentation hold."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--json", help="write every value to this file")
    arguments = parser.parse_args()
    errors, times = accuracy(), speed(arguments.repetitions)
    print(
        markdown(
            ["corner", "resolution", "entry azimuth off by", "radial depth off by", "largest radial depth"],
            [
                [
                    row["case"],
                    f"{1e3 * row['resolution_mm']:g} µm",
                    f"{row['entry_degrees']:.4f}°",
                    f"{1e3 * row['depth_mm']:.2f} µm",
                    f"{row['largest_depth_mm']:.3f} mm",
                ]
                for row in errors
            ],
        )
    )
    print(
        markdown(
            ["blocks", "layers", "samples", "seconds", "µs per block", "MB"],
            [
                [
                    str(row["blocks"]),
                    str(row["layers"]),
                    str(row["samples"]),
                    str(Sample.of(row["seconds"])),
                    f"{1e6 * Sample.of(row['seconds']).median / row['blocks']:.1f}",
                    f"{row['megabytes']:.1f}",
                ]
                for row in times
            ],
        )
    )
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:
            json.dump({"corner": errors, "speed": times}, file, indent=1)
    fine = [row["entry_degrees"] for row in errors if row["resolution_mm"] == 0.02]
    longest = next(Sample.of(row["seconds"]).median for row in times if row["blocks"] == 100_000)
    return 0 if max(fine) < 0.5 and longest < _MAX_SECONDS else 1


if __name__ == "__main__":
    sys.exit(main())
