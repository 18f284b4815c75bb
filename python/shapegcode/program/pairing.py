"""Regions of a program beside those of the program that it was made from."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from shapegcode import _core
from shapegcode.program.compensation import RADIUS_NOT_KNOWN
from shapegcode.program.program import Program

__all__ = ["paired_regions"]

_SAME_PLACE_MM = 0.005


def paired_regions(program: Program, nominal: Program) -> Iterator[tuple[_core.Region, _core.Region]]:
    """Regions of a program beside those of the nominal one, found by where they start and end."""
    if program is nominal:
        yield from ((region, region) for region in program.regions)
        return
    if nominal.core.kept_compensated_moves > program.core.kept_compensated_moves:
        raise _core.ArgumentError(_unknown_radius(nominal))
    candidates = iter(program.regions)
    for region in nominal.regions:
        for candidate in candidates:
            if _same_ends(candidate.path, region.path):
                yield candidate, region
                break
        else:
            raise _core.ArgumentError(
                f"{program.source}: no cut from {_place(region.path.start_mm)} to {_place(region.path.end_mm)} as "
                f"{nominal.source} has in {nominal.lines(region)}: it was not made from that program; leave out "
                "--against"
            )


def _unknown_radius(nominal: Program) -> str:
    said = (warning for warning in nominal.warnings if RADIUS_NOT_KNOWN in warning)
    why = next(said, f"{nominal.source}: cutter compensation is on and not expanded").partition(" (")[0]
    return (
        f"{why}: the path of the original is not known, and a shaped program cannot be measured against it: set "
        "input.tool_radius_mm to the radius that it was shaped with, in the machine file or with --set"
    )


def _same_ends(one: _core.Path, other: _core.Path) -> bool:
    ends = ((one.start_mm, other.start_mm), (one.end_mm, other.end_mm))
    return all(float(np.abs(a - b).max()) <= _SAME_PLACE_MM for a, b in ends)


def _place(position_mm: npt.ArrayLike) -> str:
    return " ".join(f"{axis}{value:.3f}" for axis, value in zip("XYZ", np.asarray(position_mm), strict=True))
