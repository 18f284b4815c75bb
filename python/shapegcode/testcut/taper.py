"""What a taper tells: coefficients of the cutting force from the records of its passes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from shapegcode.errors import ArgumentError
from shapegcode.testcut.coefficient_fit import CoefficientFit, fit_coefficients
from shapegcode.testcut.cut import CuttingLaw, MeasuringPass, TestCut
from shapegcode.testcut.engagement import Engagement, engagement, fully_engaged, straight_engagement
from shapegcode.testcut.force import expected
from shapegcode.testcut.mean_forces import MeanForces, Thickness
from shapegcode.testcut.placing import FEWEST_SAMPLES, placed
from shapegcode.testcut.record import ForceRecord
from shapegcode.testcut.result import EXPONENT_LIMIT, FACTOR_LIMIT, ChipRange, LeftOut, TaperPass, TaperResult
from shapegcode.testcut.revolutions import Revolutions, revolutions

__all__ = ["fit_taper"]

Array = npt.NDArray[np.float64]

_BINS_PER_PASS = 60
_FEWEST_TURNS = 4
_ROUNDS = 2
#: Standard error of the place of the tool, found from entry and exit, in feeds per revolution.
_PLACE = 0.25
_PER_MINUTE = 60.0


@dataclass(eq=False)
class _TaperRows:
    """Mean forces of one file."""

    met: Engagement
    displaced: Engagement
    feed: float | Array
    speed: float
    force_n: Array
    torque_nm: Array | None
    revolutions: float


@dataclass
class _Reduced:
    """The records of all passes."""

    rows: list[_TaperRows] = field(default_factory=list)
    passes: list[TaperPass] = field(default_factory=list)
    left_out: list[LeftOut] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def fit_taper(
    cut: TestCut, measured: Mapping[int, ForceRecord], *, thickness: Thickness = "mean", edge: bool = False
) -> TaperResult:
    """Fit the coefficients of the cutting force to records of a test cut."""
    law = cut.tool.cutting
    sampled = any(_samples(cut, number, record) >= FEWEST_SAMPLES for number, record in measured.items())
    for _ in range(_ROUNDS if sampled else 1):
        # Where entry and exit lie in the record depends a little on the law.
        reduced = _reduced(cut, measured, law)
        data = _joined(reduced.rows)
        fit = fit_coefficients(data, cut.tool, cut.axial_depth_mm, thickness=thickness, edge=edge)
        law = fit.law
    return _result(cut, fit, data, reduced)


def _result(cut: TestCut, fit: CoefficientFit, data: MeanForces, reduced: _Reduced) -> TaperResult:
    warnings = reduced.warnings
    if fit.outlier.any():
        count = int(fit.outlier.sum())
        warnings = [*warnings, f"{count} of {len(fit.outlier)} mean forces do not fit the others: left out"]
    return TaperResult(
        program=cut.program,
        machine=cut.machine,
        cutting=fit.law,
        coefficients=fit.coefficients,
        at_chip=fit.at_chip,
        chip_mm=ChipRange(float(fit.chip_mm.min()), float(fit.chip_mm.max()), fit.middle_chip_mm),
        mean_forces=len(fit.chip_mm),
        outliers=int(fit.outlier.sum()),
        rms_n=_pair(fit.rms_n),
        rms_percent=fit.rms_percent,
        neighbour_correlation=fit.correlation,
        passes=tuple(reduced.passes),
        left_out=tuple(reduced.left_out),
        poor=tuple(_poor(fit)),
        warnings=tuple(warnings),
        cut=cut,
        fit=fit,
        data=data,
    )


def _poor(fit: CoefficientFit) -> Iterator[str]:
    """Coefficients of the power laws that are not known well, in words."""
    for each in fit.coefficients[:4]:
        half = 0.5 * (each.high - each.low)
        if each.name.endswith("exponent"):
            if half > EXPONENT_LIMIT:
                yield f"{each.name} is known to +-{half:.3f} only (wanted: +-{EXPONENT_LIMIT:g})"
        elif half > FACTOR_LIMIT * each.value:
            share = 100.0 * half / each.value
            yield f"{each.name} is known to +-{share:.0f} % only (wanted: +-{100 * FACTOR_LIMIT:g} %)"


def _pair(values: Array) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _samples(cut: TestCut, number: int, record: ForceRecord) -> float:
    """Rows per revolution."""
    if record.radial_depth_mm is not None:
        return 0.0
    turn = _PER_MINUTE / cut.spindle_rev_per_min
    if record.time_s is not None:
        return float(turn / np.mean(np.diff(record.time_s)))
    assert record.position_mm is not None
    way = float(np.ptp(record.position_mm)) / (len(record) - 1)
    return cut.passes[number - 1].feed_mm_per_min / cut.spindle_rev_per_min / max(way, 1e-12)


def _reduced(cut: TestCut, measured: Mapping[int, ForceRecord], law: CuttingLaw) -> _Reduced:
    """The records as mean forces: as they are, or of the revolutions in full engagement without chatter."""
    out = _Reduced()
    for number, record in measured.items():
        measuring = cut.passes[number - 1]
        if _samples(cut, number, record) <= 1.0 + 1e-6:
            out.rows.append(_of_means(cut, measuring, record))
            continue
        found = revolutions(placed(record, cut, measuring, expected(cut, measuring, law)))
        shown = found.record
        offset, drift = _pair(shown.offset_n), _pair(shown.drift_n)
        out.passes.append(TaperPass(shown.file, found.feed_mm_per_min, shown.spindle_rev_per_min, offset, drift))
        out.warnings += shown.notes
        out.rows.append(_of_revolutions(cut, measuring, found))
        for low, high in _stretches(found):
            out.left_out.append(LeftOut(number, low, high))
            out.warnings.append(
                f"{shown.file}: X {low:.1f} to {high:.1f} mm left out: the force swings far more there than in the "
                "rest of the pass (chatter?)"
            )
    return out


def _of_means(cut: TestCut, measuring: MeasuringPass, record: ForceRecord) -> _TaperRows:
    """Rows that are means already: at the radial depth that the file tells, or at its positions."""
    if record.radial_depth_mm is not None:
        depth = record.radial_depth_mm
        wrong = np.flatnonzero((depth <= 0.0) | (depth >= 2.0 * cut.tool.radius_mm))
        if wrong.size:
            raise ArgumentError(
                f"{record.file}: a radial depth of {depth[wrong[0]]:g} mm: must be above 0 and below the diameter, "
                f"{cut.tool.diameter_mm:g} mm"
            )
        row = np.ones(len(depth), dtype=bool)
        met = straight_engagement(cut.tool, depth, up=cut.up)
    else:
        if record.position_mm is None:
            raise ArgumentError(
                f"{record.file}: means over time do not tell where they were taken: needed is position_mm or "
                "radial_depth_mm"
            )
        row = fully_engaged(cut, measuring, record.position_mm)
        met = engagement(cut.tool, measuring, record.position_mm[row], up=cut.up)
    feed = measuring.feed_mm_per_min if record.feed_mm_per_min is None else record.feed_mm_per_min[row]
    torque = None if record.torque_nm is None else np.abs(record.torque_nm[row])
    return _TaperRows(met, met, feed, cut.spindle_rev_per_min, record.force_n[row], torque, 1.0)


def _of_revolutions(cut: TestCut, measuring: MeasuringPass, found: Revolutions) -> _TaperRows:
    """Means over some revolutions each, chatter left out."""
    margin = 2.0 * found.feed_mm_per_min / found.record.spindle_rev_per_min
    kept = np.flatnonzero(fully_engaged(cut, measuring, found.x_mm, margin) & ~found.chatter)
    if kept.size < _FEWEST_TURNS:
        raise ArgumentError(f"{found.record.file}: {kept.size} revolutions in full engagement: too few")
    many = max(1, kept.size // _BINS_PER_PASS)
    # A bin holds neighbours only: none goes across what was left out.
    runs = np.split(kept, np.flatnonzero(np.diff(kept) > 1) + 1)
    bins = np.vstack([run[: len(run) // many * many].reshape(-1, many) for run in runs])
    x = found.x_mm[bins].mean(axis=1)
    met = engagement(cut.tool, measuring, x, up=cut.up)
    speed = found.record.spindle_rev_per_min
    displaced = engagement(cut.tool, measuring, x + _PLACE * found.feed_mm_per_min / speed, up=cut.up)
    force = found.mean_n[bins].mean(axis=1)
    torque = None if found.torque_nm is None else found.torque_nm[bins].mean(axis=1)
    return _TaperRows(met, displaced, found.feed_mm_per_min, speed, force, torque, float(many))


def _stretches(found: Revolutions) -> list[tuple[float, float]]:
    """First and last X of each run of revolutions with chatter."""
    marks = np.flatnonzero(np.diff(np.concatenate([[0], found.chatter.astype(int), [0]])))
    return [(float(found.x_mm[a]), float(found.x_mm[b - 1])) for a, b in zip(marks[::2], marks[1::2], strict=True)]


def _joined(rows: Sequence[_TaperRows]) -> MeanForces:
    sizes = [len(each.force_n) for each in rows]
    met, displaced = (
        Engagement(
            *(np.concatenate(columns) for columns in zip(*(vars(each).values() for each in engaged), strict=True))
        )
        for engaged in ([each.met for each in rows], [each.displaced for each in rows])
    )
    # A torque that only some of the files have does not help the others.
    torques = [each.torque_nm for each in rows if each.torque_nm is not None]
    return MeanForces(
        met,
        np.concatenate([np.broadcast_to(each.feed, size) for each, size in zip(rows, sizes, strict=True)]),
        np.repeat([each.speed for each in rows], sizes),
        np.concatenate([each.force_n for each in rows]),
        np.repeat([each.revolutions for each in rows], sizes),
        np.repeat(np.arange(len(rows)), sizes),
        displaced,
        np.concatenate(torques) if len(torques) == len(rows) else None,
    )
