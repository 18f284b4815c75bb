"""The emitted text read back and held against the original: end points, modal state at every border, sweeps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from shapegcode import _core
from shapegcode.errors import RoundTripError
from shapegcode.machine import Machine
from shapegcode.program import Program, least_increment_mm
from shapegcode.verdict.placed import Placed

_LARGEST_SWEEP_RAD = math.pi / 2


_STATE_FIELDS = (
    "motion", "plane", "distance", "feed_mode", "units", "compensation", "length_offset",
    "cycle", "cycle_return", "coordinate_system", "exact_stop", "feed",
)  # fmt: skip


def read_back(parts: list[bytes], placed: Sequence[Placed], machine: Machine) -> Program:
    """Read the emitted text and hold it against the original: end points, modal state at every border, sweeps."""
    # Half an increment: a program may carry more digits than the controller resolves.
    tolerance_mm = {units: 0.5 * least_increment_mm(machine, units) + 1e-9 for units in (20, 21)}
    probes = [line for place in placed for line in (place.first_line - 1, place.last_line)]
    emitted = Program.from_parts(parts, machine, source="emitted program", probe_lines=probes)
    states = emitted.core.probed
    for index, place in enumerate(placed):
        region = place.region
        _compare_states(states[2 * index], region.entry, place.first_line - 1, region.incremental, tolerance_mm)
        _compare_states(states[2 * index + 1], region.exit, place.last_line, region.incremental, tolerance_mm)
        blocks = place.blocks(emitted)
        _compare_ends(blocks, place, tolerance_mm)
        if blocks.largest_sweep_rad >= _LARGEST_SWEEP_RAD:
            raise RoundTripError(
                f"emitted arc between lines {place.first_line} and {place.last_line} sweeps "
                f"{math.degrees(blocks.largest_sweep_rad):.1f} degrees (limit 90)"
            )
    return emitted


def _compare_states(
    emitted: _core.ModalState,
    original: _core.ModalState,
    line: int,
    incremental: bool,
    tolerance_mm: Mapping[int, float],
) -> None:
    for field in _STATE_FIELDS:
        was, now = getattr(original, field), getattr(emitted, field)
        if was != now and not (field == "feed" and original.feed_mode == 93):
            raise RoundTripError(f"emitted line {line}: modal {field} is {now}, the original has {was}")
    if original.known != emitted.known:
        raise RoundTripError(f"emitted line {line}: known axes {emitted.known}, the original has {original.known}")
    if incremental:
        return
    limit = tolerance_mm[original.units]
    for axis, known, was, now in zip("XYZ", original.known, original.position_mm, emitted.position_mm, strict=True):
        if known and abs(was - now) > limit:
            raise RoundTripError(f"emitted line {line}: {axis} is at {now:.6f} mm, the original at {was:.6f} mm")


def _compare_ends(blocks: _core.Path, place: Placed, tolerance_mm: Mapping[int, float]) -> None:
    path = place.region.path
    travel = path.end_mm - path.start_mm
    gap = float(np.abs((blocks.end_mm - blocks.start_mm) - travel).max())
    # Start and end are rounded to the increment, each once.
    limit = 2.0 * tolerance_mm[place.region.exit.units]
    if gap > limit:
        raise RoundTripError(
            f"shaped blocks of lines {place.region.first_line} to {place.region.last_line} end {gap * 1e3:.2f} um off "
            f"(limit {limit * 1e3:.2f} um)"
        )
