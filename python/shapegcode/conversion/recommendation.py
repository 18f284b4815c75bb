"""What to do with an emitted program: one of five grades, each with its one reason, from benefit and price."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from shapegcode.comparison.result import ProgramDifference
from shapegcode.verdict.figures import RegionVerdict

__all__ = ["GRADES", "Grade", "Situation", "benefits", "recommend"]

Grade = Literal[
    "worth running",
    "better, tolerance not met",
    "already within tolerance: shaping is optional",
    "no benefit: run the original",
    "do not run",
]
GRADES: tuple[Grade, ...] = (
    "worth running",
    "better, tolerance not met",
    "already within tolerance: shaping is optional",
    "no benefit: run the original",
    "do not run",
)
"""From the best down; the first that applies from the end is the answer."""

LEAST_BETTER = 0.3
"""Share by which a figure must fall to count as a benefit."""


@dataclass(frozen=True)
class Situation:
    """What the grade is decided by.

    Attributes:
        cuts: all of the program, shaped or left unchanged.
        shaped: how many of them are shaped.
        original_within: every cut of the original keeps its limits.
        could_gain: there is a cut in which shaping gains, or as far as is known would gain, the least gain.
        benefit: a shaped cut gains enough, see `benefits`.
        other_changes: what else differs from the original; none, unless shapegcode has a defect.
    """

    cuts: Sequence[RegionVerdict]
    shaped: int
    original_within: bool
    could_gain: bool
    benefit: bool
    other_changes: Sequence[ProgramDifference] = ()


def recommend(situation: Situation) -> tuple[Grade, str]:
    """The grade and its reason: the first that applies, from "do not run" upwards."""
    worse = next((_at(cut, why) for cut in situation.cuts for why in cut.worse), "")
    if worse:
        return "do not run", worse
    for change in situation.other_changes:
        had, has = change.original or "nothing", change.emitted or "nothing"
        return "do not run", f"{change.place}: {change.kind} changed: {had} became {has}: please report this defect"
    if not situation.cuts:
        return "no benefit: run the original", "there is nothing to shape"
    if not situation.could_gain or (not situation.benefit and not situation.original_within):
        return "no benefit: run the original", "nothing that misses its limit gets noticeably better"
    if situation.original_within:
        return "already within tolerance: shaping is optional", "every cut of the original keeps its limits"
    missed = next((_at(cut, why) for cut in situation.cuts for why in cut.misses), "")
    if missed:
        return "better, tolerance not met", missed
    return "worth running", "every cut is within its limits, and within the price"


def _at(cut: RegionVerdict, why: str) -> str:
    return "lines {} to {}: {}".format(*cut.lines, why)


def benefits(cut: RegionVerdict, contour_limit_um: float, least_gain_um: float) -> bool:
    """Whether shaping a cut is a benefit.

    A figure that missed its limit, or a residual vibration above the least gain, falls by the least gain and either by
    30 % or to within the limit.
    """
    pairs = [(cut.original_contour_error_um, cut.contour_error_um, contour_limit_um, contour_limit_um)]
    residual = cut.residual_vibration_um
    pairs += [
        (before, after, limit, min(limit, least_gain_um))
        for before, after, limit in zip(residual.original, residual.emitted, cut.residual_limit_um, strict=True)
    ]
    return any(
        before > threshold
        and before - after >= least_gain_um
        and (after <= (1.0 - LEAST_BETTER) * before or (before > limit >= after))
        for before, after, limit, threshold in pairs
    )
