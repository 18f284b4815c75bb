"""The program that the benchmarks read and convert: always the same bytes for the same number of lines."""

from __future__ import annotations

import math
import random
from pathlib import Path

_SEED = 20_240
_SHORTEST_MM, _LONGEST_MM = 0.1, 0.5
_TURN_RAD = 0.02  # standard deviation of the change of heading per line
_STEEPNESS_KEPT = 0.98  # per line: the path tends back to the horizontal
_FENCE_MM = 190.0  # beyond it the path is steered back, so that it stays within 200 mm
_STEERING_RAD = 0.1  # per line, at most


def write_program(file: Path, lines: int, *, scale: float = 1.0) -> None:
    """Write a smooth wandering curve in X Y Z of `lines` G01 blocks, as a finishing program is.

    `scale`: 1 for lines of .1 to .5 mm.
    """
    draw = random.Random(_SEED)
    x = y = z = 0.0
    heading, pitch = 0.3, 0.0
    with file.open("w", encoding="ascii", newline="\n") as out:
        out.write("%\nO0001\nG21 G17 G90 G94 G40 G49 G80\nG0 X0.000 Y0.000 Z0.000\n")
        feed = " F3000."
        for _ in range(lines):
            length = scale * draw.uniform(_SHORTEST_MM, _LONGEST_MM)
            heading += draw.gauss(0.0, _TURN_RAD)
            pitch = _STEEPNESS_KEPT * pitch + draw.gauss(0.0, _TURN_RAD)
            x += length * math.cos(pitch) * math.cos(heading)
            y += length * math.cos(pitch) * math.sin(heading)
            z += length * math.sin(pitch)
            if math.hypot(x, y) > _FENCE_MM:
                home = math.remainder(math.atan2(-y, -x) - heading, math.tau)
                heading += max(-_STEERING_RAD, min(_STEERING_RAD, home))
            if abs(z) > _FENCE_MM:
                pitch -= math.copysign(_STEERING_RAD, z)
            out.write(f"G01 X{x:.3f} Y{y:.3f} Z{z:.3f}{feed}\n")
            feed = ""
        out.write("M30\n%\n")
