"""What a taper tells: coefficients of the cutting force from the records of its passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from shapegcode._core import ArgumentError
from shapegcode.testcut.coefficient_fit import CoefficientFit, MeanForces, fit_coefficients
from shapegcode.testcut.means import FEWEST_SAMPLES, Revolutions, placed, revolutions
from shapegcode.testcut.plan import (
    Engagement,
    MeasuringPass,
    TestCut,
    engagement,
    fully_engaged,
    straight_engagement,
)
from shapegcode.testcut.record import ForceRecord
from shapegcode.testcut.shape import expected

__all__ = ["Measured", "TaperResult", "fit_taper"]

Array = npt.NDArray[np.float64]

_BINS_PER_PASS = 60
_FEWEST_TURNS = 4
_ROUNDS = 2
#: Standard error of the place of the tool, found from entry and exit, in feeds per revolution.
_PLACE = 0.25
_PER_MINUTE = 60.0
#: Wider intervals (half of them) are no result to build on.
EXPONENT_LIMIT = 0.05
FACTOR_LIMIT = 0.10


@dataclass(frozen=True)
class Measured:
    """A record and the pass that it is of.

    Attributes:
        record: the file.
        number: of the pass, from 1.
    """

    record: ForceRecord
    number: int


@dataclass(frozen=True, eq=False)
class TaperResult:
    """Coefficients, and what they were fitted to.

    Attributes:
        cut: the test cut.
        fit: coefficients, residuals, outliers.
        data: the mean forces.
        x_mm: (n,) X of each mean force; NaN where the file told the radial depth.
        passes: reduced records; empty for files with means.
        left_out: stretches with chatter: pass, from and to X.
        notes: for the user.
    """

    cut: TestCut
    fit: CoefficientFit
    data: MeanForces
    x_mm: Array
    passes: tuple[Revolutions, ...]
    left_out: tuple[dict[str, float], ...]
    notes: tuple[str, ...]

    @property
    def poor(self) -> list[str]:
        """Coefficients of the power laws that are not known well, in words."""
        found = []
        for each in self.fit.coefficients[:4]:
            half = 0.5 * (each.high - each.low)
            if each.name.endswith("exponent"):
                if half > EXPONENT_LIMIT:
                    found.append(f"{each.name} is known to +-{half:.3f} only (wanted: +-{EXPONENT_LIMIT:g})")
            elif half > FACTOR_LIMIT * each.value:
                share = 100.0 * half / each.value
                found.append(f"{each.name} is known to +-{share:.0f} % only (wanted: +-{100 * FACTOR_LIMIT:g} %)")
        return found

    def report(self) -> dict[str, Any]:
        """The plain dictionary that ``--json`` writes."""
        fit = self.fit
        return {
            "kind": "taper",
            "cutting": fit.cutting(),
            "coefficients": [vars(each) for each in fit.coefficients],
            "at_chip": [vars(each) for each in fit.at_chip],
            "chip_mm": {"min": float(fit.chip_mm.min()), "max": float(fit.chip_mm.max()), "middle": fit.middle_chip_mm},
            "mean_forces": len(fit.chip_mm),
            "outliers": int(fit.outlier.sum()),
            "rms_n": [float(value) for value in fit.rms_n],
            "rms_percent": fit.rms_percent,
            "neighbour_correlation": fit.correlation,
            "passes": [
                {
                    "file": each.source,
                    "feed_mm_per_min": each.feed_mm_per_min,
                    "spindle_rev_per_min": each.spindle_rev_per_min,
                    "offset_n": [float(value) for value in each.offset_n],
                    "drift_n": [float(value) for value in each.drift_n],
                }
                for each in self.passes
            ],
            "left_out": list(self.left_out),
            "poor": self.poor,
            "notes": list(self.notes),
        }


@dataclass(eq=False)
class _Rows:
    """Mean forces of one file."""

    met: Engagement
    displaced: Engagement
    x_mm: Array
    feed: float | Array
    speed: float
    force_n: Array
    torque_nm: Array | None
    revolutions: float


def fit_taper(
    cut: TestCut, measured: Sequence[Measured], *, thickness: str = "mean", edge: bool = False
) -> TaperResult:
    """Fit the coefficients of the cutting force to records of a test cut.

    Args:
        cut: the test cut, as its side file describes it.
        measured: records with their passes: sampled ones, or means over whole revolutions.
        thickness: chip thickness of the power laws, "mean" of the engagement or "local".
        edge: with edge forces.

    Returns:
        The coefficients with their intervals, and how well they fit.

    Raises:
        ArgumentError: a record that does not fit the cut, or forces that do not tell the coefficients.
    """
    cutting: dict[str, Any] = cut.tool.cutting
    sampled = any(_samples(cut, each) >= FEWEST_SAMPLES for each in measured)
    for _ in range(_ROUNDS if sampled else 1):
        # Where entry and exit lie in the record depends a little on the law.
        rows, passes, left_out, notes = _reduced(cut, measured, cutting)
        data = _joined(rows)
        fit = fit_coefficients(data, cut.tool, cut.axial_depth_mm, thickness=thickness, edge=edge)
        cutting = fit.cutting()
    if fit.outlier.any():
        notes.append(f"{int(fit.outlier.sum())} of {len(fit.outlier)} mean forces do not fit the others: left out")
    x = np.concatenate([each.x_mm for each in rows])
    return TaperResult(cut, fit, data, x, tuple(passes), tuple(left_out), tuple(notes))


def _samples(cut: TestCut, each: Measured) -> float:
    """Rows per revolution."""
    record, measuring = each.record, cut.passes[each.number - 1]
    if record.radial_depth_mm is not None:
        return 0.0
    turn = _PER_MINUTE / cut.spindle_rev_per_min
    if record.time_s is not None:
        return float(turn / np.mean(np.diff(record.time_s)))
    assert record.position_mm is not None
    way = float(np.ptp(record.position_mm)) / (len(record) - 1)
    return measuring.feed_mm_per_min / cut.spindle_rev_per_min / max(way, 1e-12)


def _reduced(cut: TestCut, measured: Sequence[Measured], cutting: dict[str, Any]) -> Any:
    rows, passes, left_out, notes = [], [], [], []
    for each in measured:
        measuring = cut.passes[each.number - 1]
        if _samples(cut, each) <= 1.0 + 1e-6:
            rows.append(_of_means(cut, measuring, each.record))
            continue
        found = revolutions(placed(each.record, cut, measuring, expected(cut, measuring, cutting).shape()))
        passes.append(found)
        notes += [f"{found.source}: {note}" for note in found.notes]
        rows.append(_of_revolutions(cut, measuring, found))
        for low, high in _stretches(found):
            left_out.append({"pass": each.number, "from_mm": low, "to_mm": high})
            notes.append(
                f"{found.source}: X {low:.1f} to {high:.1f} mm left out: the force swings far more there than in the "
                "rest of the pass (chatter?)"
            )
    return rows, passes, left_out, notes


def _of_means(cut: TestCut, measuring: MeasuringPass, record: ForceRecord) -> _Rows:
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
        met = straight_engagement(cut.tool, depth, up=cut.milling == "up")
        x = np.full(len(depth), np.nan)
    else:
        if record.position_mm is None:
            raise ArgumentError(
                f"{record.file}: means over time do not tell where they were taken: needed is position_mm or "
                "radial_depth_mm"
            )
        row = fully_engaged(cut, measuring, record.position_mm)
        x = record.position_mm[row]
        met = engagement(cut, measuring, x)
    feed = measuring.feed_mm_per_min if record.feed_mm_per_min is None else record.feed_mm_per_min[row]
    torque = None if record.torque_nm is None else np.abs(record.torque_nm[row])
    return _Rows(met, met, x, feed, cut.spindle_rev_per_min, record.force_n[row], torque, 1.0)


def _of_revolutions(cut: TestCut, measuring: MeasuringPass, found: Revolutions) -> _Rows:
    """Means over some revolutions each, chatter left out."""
    margin = 2.0 * found.feed_mm_per_min / found.spindle_rev_per_min
    kept = np.flatnonzero(fully_engaged(cut, measuring, found.x_mm, margin) & ~found.chatter)
    if kept.size < _FEWEST_TURNS:
        raise ArgumentError(f"{found.source}: {kept.size} revolutions in full engagement: too few")
    many = max(1, kept.size // _BINS_PER_PASS)
    # A bin holds neighbours only: none goes across what was left out.
    runs = np.split(kept, np.flatnonzero(np.diff(kept) > 1) + 1)
    bins = np.vstack([run[: len(run) // many * many].reshape(-1, many) for run in runs])
    x = found.x_mm[bins].mean(axis=1)
    met = engagement(cut, measuring, x)
    displaced = engagement(cut, measuring, x + _PLACE * found.feed_mm_per_min / found.spindle_rev_per_min)
    force = found.mean_n[bins].mean(axis=1)
    torque = None if found.torque_nm is None else found.torque_nm[bins].mean(axis=1)
    return _Rows(met, displaced, x, found.feed_mm_per_min, found.spindle_rev_per_min, force, torque, float(many))


def _stretches(found: Revolutions) -> list[tuple[float, float]]:
    """First and last X of each run of revolutions with chatter."""
    marks = np.flatnonzero(np.diff(np.concatenate([[0], found.chatter.astype(int), [0]])))
    return [(float(found.x_mm[a]), float(found.x_mm[b - 1])) for a, b in zip(marks[::2], marks[1::2], strict=True)]


def _joined(rows: Sequence[_Rows]) -> MeanForces:
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
