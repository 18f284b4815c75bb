"""Proof that nothing but the shaped cuts changed: the emitted program compared with its original, read once more."""

from __future__ import annotations

import math
from dataclasses import dataclass

from shapegcode.comparison.allowed import Allowed
from shapegcode.comparison.compare import compare
from shapegcode.comparison.result import KindCount, ProgramDifference
from shapegcode.machine import Machine
from shapegcode.program import Program

__all__ = ["ChangeProof", "prove"]


@dataclass(frozen=True)
class ChangeProof:
    """What is unchanged in an emitted program.

    Attributes:
        answer: such as "42 of 42 rapids, 7 of 7 tool calls, 31 of 31 offsets unchanged; path within 12.3 µm".
        counts: of each kind of which one of both programs has some.
        path_um: largest distance of the paths of a cut, seen from either; of the command, not of the table.
        refused: differences that shaping does not explain; none: it is proven.
    """

    answer: str
    counts: tuple[KindCount, ...]
    path_um: float
    refused: tuple[ProgramDifference, ...]


def prove(original: Program, emitted: Program, machine: Machine, *, rapids_shaped: bool) -> ChangeProof:
    """Compare an emitted program with its original.

    What shaping changes is allowed: blocks and feeds of cuts, calls that were expanded, the path within its tolerance,
    which the verdict judges.
    """
    kinds = {"feeds", "blocks", "calls"}
    kinds |= {"shaped-rapids"} if rapids_shaped else set()
    kinds |= {"compensation"} if original.core.expanded_radii_mm else set()
    found = compare(original, emitted, machine, allow=Allowed(frozenset(kinds), math.inf))
    # Without header comments nothing says that lines of emission.* are the converter's own.
    refused = tuple(each for each in found.refused if machine.emission.header or each.kind != "emission")
    return ChangeProof(found.answer, found.counts, found.path_um, refused)
