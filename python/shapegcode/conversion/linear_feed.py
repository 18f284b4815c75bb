"""Lines of shaped blocks in the words of a SINUMERIK, with feeds that are linear along their blocks (FLIN)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from shapegcode import _core
from shapegcode.conversion.restart import decimal

_LABEL = re.compile(r"N\d+")
_MERE_MOVE = re.compile(r"(?:N\d+)?(?:G0?[123])?(?:[XYZIJKRF]-?(?:\d+\.\d*|\.\d+))+")


def linear_lines(
    lines: Mapping[int, str], path: _core.Path, blocks: Sequence[_core.LinearBlock], decimals: int
) -> dict[int, list[str]]:
    """Replacements of the lines of shaped blocks, by line number; none for a line that is joined to another."""
    numbers = [int(number) for number in path.segment_lines]
    written: dict[int, list[str]] = {number: [] for number in numbers}
    is_linear, code, start = False, "", np.asarray(path.start_mm, dtype=float)
    for block in blocks:
        label = _LABEL.match(lines[numbers[block.first]])
        out = written[numbers[block.first]]
        if block.sets_feed:
            out.append(f"{'FNORM ' if is_linear else ''}F{decimal(block.start_feed_mm_per_min, 2)}")
            is_linear = False
        change = "" if block.is_linear == is_linear else "FLIN " if block.is_linear else "FNORM "
        is_linear = block.is_linear
        motion = "G1" if not block.sweep_rad else "G3" if block.sweep_rad > 0.0 else "G2"
        words = "" if motion == code else f"{motion} "
        code = motion
        moved = np.abs(np.round(block.end_mm, decimals) - np.round(start, decimals)) > 0.5 * 10.0**-decimals
        words += "".join(f"{'XYZ'[k]}{decimal(float(block.end_mm[k]), decimals)}" for k in range(3) if moved[k])
        words += f"CR={decimal(block.radius_mm, 3)}" if block.sweep_rad else ""
        out.append(f"{change}{words}F{decimal(block.feed_mm_per_min, 2 if block.is_linear else 4)}")
        if label is not None:
            out[0] = f"{label[0]} {out[0]}"
        start = block.end_mm
    if is_linear:
        written[numbers[-1]].append("FNORM")
    return written


def joints_of(lines: Mapping[int, str], numbers: Sequence[int]) -> list[int] | None:
    """Blocks that must begin a joined block: after other lines, and with N words; None: a line is not only a move."""
    if not all(_MERE_MOVE.fullmatch(lines[number]) for number in numbers):
        return None
    pairs = enumerate(pairwise(numbers), start=1)
    return [k for k, (before, number) in pairs if number != before + 1 or lines[number].startswith("N")]
