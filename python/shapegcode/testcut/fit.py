"""From the records of a test cut's passes to what they tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from shapegcode.errors import ArgumentError
from shapegcode.testcut.corner import fit_corner
from shapegcode.testcut.cut import TestCut, read_test_cut
from shapegcode.testcut.interval import fit_interval
from shapegcode.testcut.mean_forces import Thickness
from shapegcode.testcut.record import ForceRecord, read_forces
from shapegcode.testcut.result import CornerResult, IntervalResult, TaperResult
from shapegcode.testcut.taper import fit_taper

__all__ = ["fit_test_cut"]

_Record = str | Path | ForceRecord


def fit_test_cut(
    cut: TestCut | str | Path,
    records: Sequence[_Record] | Mapping[int, _Record],
    *,
    forces_on: str = "workpiece",
    chip_thickness: Thickness = "mean",
    edge_forces: bool = False,
) -> TaperResult | CornerResult | IntervalResult:
    """What the measured forces of a test cut tell.

    Args:
        cut: the test cut, or its side file.
        records: files of the passes in their order, or by the number of the pass, from 1; see docs/howto/test_cuts.md.
        forces_on: on what the measured forces act, "workpiece" (as a dynamometer below it measures) or "tool".
        chip_thickness: taper: to which the power laws belong, "mean" of the engagement or "local".
        edge_forces: taper: fit the forces of the edge, K_te and K_re, too.

    Returns:
        Of a taper the coefficients of the cutting force, of a corner measured against expected resultant, of an
        interval test the shortest interval that the controller follows.

    Raises:
        ArgumentError: a file that cannot be used, or records that do not fit the cut or do not tell what is looked for.
        OSError: a file cannot be read.
    """
    known = cut if isinstance(cut, TestCut) else read_test_cut(cut)
    by_pass = records if isinstance(records, Mapping) else dict(enumerate(records, start=1))
    for number, record in by_pass.items():
        if not 1 <= number <= len(known.passes):
            raise ArgumentError(f"{record}: pass {number}: the test cut has {len(known.passes)} passes")
    if known.kind != "taper" and (edge_forces or chip_thickness != "mean"):
        raise ArgumentError(f"the test cut is a {known.kind}: edge forces and chip thickness go with a taper")
    measured = {
        number: record if isinstance(record, ForceRecord) else read_forces(record, on=forces_on)
        for number, record in by_pass.items()
    }
    if known.kind == "taper":
        return fit_taper(known, measured, thickness=chip_thickness, edge=edge_forces)
    return fit_corner(known, measured) if known.kind == "corner" else fit_interval(known, measured)
