"""What the corner test tells: measured against expected resultant (paper 001, figure 7)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from shapegcode.testcut.cut import TestCut
from shapegcode.testcut.engagement import fully_engaged
from shapegcode.testcut.force import expected
from shapegcode.testcut.placing import placed
from shapegcode.testcut.record import ForceRecord
from shapegcode.testcut.result import CornerPass, CornerResult, ForceRatio
from shapegcode.testcut.revolutions import revolutions

__all__ = ["fit_corner"]

Array = npt.NDArray[np.float64]
_MARGIN_REVS = 4.0


def fit_corner(cut: TestCut, measured: Mapping[int, ForceRecord]) -> CornerResult:
    """Lay measured resultants over the expected ones."""
    passes = {number: _pass(cut, number, record) for number, record in measured.items()}
    first = passes[min(passes)]
    seen = _inside(cut, first.number, first.record.x_mm) & ~first.record.chatter
    there = np.interp(first.record.x_mm[seen], first.hoped.x_mm, first.hoped.mean_resultant_n)
    ratio = None
    if {1, 2} <= set(passes):
        before, after = passes[1], passes[2]
        ratio = ForceRatio(
            after.measured_mean_n / before.measured_mean_n, after.expected_mean_n / before.expected_mean_n
        )
    return CornerResult(
        program=cut.program,
        machine=cut.machine,
        peaks=tuple(passes.values()),
        ratio=ratio,
        scale=float(there @ first.record.resultant_n[seen] / (there @ there)),
        warnings=tuple(note for each in passes.values() for note in each.record.record.notes),
    )


def _pass(cut: TestCut, number: int, record: ForceRecord) -> CornerPass:
    measuring = cut.passes[number - 1]
    hoped = expected(cut, measuring)
    found = revolutions(placed(record, cut, measuring, hoped))
    seen = _inside(cut, number, found.x_mm) & ~found.chatter
    far = _inside(cut, number, hoped.x_mm)
    return CornerPass(
        number=number,
        measured_mean_n=float(found.resultant_n[seen].max()),
        measured_peak_n=float(found.peak_n[seen].max()),
        expected_mean_n=float(hoped.mean_resultant_n[far].max()),
        expected_peak_n=float(hoped.peak_resultant_n[far].max()),
        record=found,
        hoped=hoped,
    )


def _inside(cut: TestCut, number: int, x_mm: Array) -> npt.NDArray[np.bool_]:
    measuring = cut.passes[number - 1]
    margin = _MARGIN_REVS * measuring.feed_mm_per_min / cut.spindle_rev_per_min
    return fully_engaged(cut, measuring, x_mm, margin)
