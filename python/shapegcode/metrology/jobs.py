"""What is measured of a program: its regions beside those of the nominal one, and the sections of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shapegcode import _core
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.program.pairing import paired_regions

__all__ = ["Job", "jobs_of"]

_SHORT_MM = 0.5
_MOST_SECTIONS = 20_000  # of a program: each is a row with its walls
_LARGEST_FACTOR = 2.0**20
_LAST_LINE = 2**32 - 1
_BLOCKS_PER_CURVE = 2.5  # a shaped program's own blocks are shorter than this many block periods at its feed


@dataclass(frozen=True)
class Job:
    """A region to play, the nominal one, and its sections.

    `joined_mm`: runs shorter than this are one curve, because there were too many of them; 0: as everywhere.
    """

    played: _core.Region
    nominal: _core.Region
    path: _core.Path
    sections: list[_core.PathSection]
    joined_mm: float = 0.0


def jobs_of(program: Program, nominal: Program, machine: Machine, lines: Sequence[tuple[int, int]] | None) -> list[Job]:
    """Pairs of regions that are measured, those without a section left out."""
    pairs = [pair for pair in paired_regions(program, nominal) if pair[1].path.length_mm > 0.0]
    own_blocks = program.shaped_regions > 0 and nominal is program
    joined = 1.0 if lines is not None else _joined(pairs, machine, own_blocks=own_blocks)
    jobs = []
    for played, region in pairs:
        path = region.path
        if lines is None:
            short_mm = joined * _short_mm(path, machine, own_blocks=own_blocks)
            sections = _core.path_sections(path, short_mm)
        else:
            short_mm = 0.0
            sections = _core.line_sections(path, [(min(a, _LAST_LINE), min(b, _LAST_LINE)) for a, b in lines])
        if sections:
            jobs.append(Job(played, region, path, sections, short_mm if joined > 1.0 else 0.0))
    if lines is not None and not jobs:
        names = ", ".join(f"{first}-{last}" for first, last in lines)
        raise _core.ArgumentError(f"{nominal.source}: no cutting move in lines {names}")
    return jobs


def _joined(pairs: Sequence[tuple[_core.Region, _core.Region]], machine: Machine, *, own_blocks: bool) -> float:
    """How many times longer than elsewhere runs must be to stand alone, so that a program has a number of sections
    that somebody may look at; a region has one at least."""
    most = max(_MOST_SECTIONS, len(pairs))
    factor = 1.0
    while factor < _LARGEST_FACTOR:
        count = sum(
            len(_core.path_sections(region.path, factor * _short_mm(region.path, machine, own_blocks=own_blocks)))
            for _, region in pairs
        )
        if count <= most:
            break
        factor *= 2.0
    return factor


def _short_mm(path: _core.Path, machine: Machine, *, own_blocks: bool) -> float:
    """Runs shorter than this that follow each other are one curve."""
    if not own_blocks:
        return _SHORT_MM
    return max(_SHORT_MM, _BLOCKS_PER_CURVE * path.fastest_feed_mm_per_s * machine.controller.block_time_s)
