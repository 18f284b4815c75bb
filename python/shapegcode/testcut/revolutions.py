"""Means over whole revolutions of a pass, and where it chattered."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shapegcode.testcut.engagement import fully_engaged
from shapegcode.testcut.placing import PlacedRecord

__all__ = ["Revolutions", "revolutions"]

Array = npt.NDArray[np.float64]
_PER_MINUTE = 60.0
_GUARD_REVS = 2
_FEWEST = 20
_CHATTER, _CHATTER_LEAST = 8.0, 0.02  # times the median deviation; the least that counts as one, of the median
_CHATTER_ROUNDS = 12


@dataclass(frozen=True, eq=False)
class Revolutions:
    """Means over whole revolutions of one pass.

    Attributes:
        record: what they are of.
        x_mm: (n,) X of the tool's axis in the middle of each revolution.
        mean_n: (n, 2) mean force on the tool along the feed and to its left.
        torque_nm: (n,) mean torque; None: not recorded.
        resultant_n: (n,) mean magnitude.
        peak_n: (n,) largest magnitude.
        chatter: (n,) whether the force swings more than its mean lets expect from the rest of the pass.
        feed_mm_per_min: the feed between entry and exit, as the record shows it; of a pass with changing feeds the
            first one.
    """

    record: PlacedRecord
    x_mm: Array
    mean_n: Array
    torque_nm: Array | None
    resultant_n: Array
    peak_n: Array
    chatter: npt.NDArray[np.bool_]
    feed_mm_per_min: float


def revolutions(record: PlacedRecord) -> Revolutions:
    """Means over whole revolutions of a pass."""
    cut, measuring, x = record.cut, record.measuring, record.x_mm
    inside = np.flatnonzero((x >= measuring.start_mm) & (x <= measuring.end_mm))
    turns = int((inside[-1] - inside[0]) / record.samples)
    edges = inside[0] + np.arange(turns + 1) * record.samples
    size = np.linalg.norm(record.force_n, axis=1)
    columns = [record.force_n, size[:, None], size[:, None] ** 2, x[:, None]]
    if record.torque_nm is not None:
        columns.append(record.torque_nm)
    table = np.hstack(columns)
    sums = np.vstack([np.zeros((1, table.shape[1])), np.cumsum(table, axis=0)])
    at = np.arange(len(sums), dtype=np.float64)
    means = np.diff(np.column_stack([np.interp(edges, at, column) for column in sums.T]), axis=0) / record.samples
    peaks = np.maximum.reduceat(size[: int(edges[-1])], edges[:-1].astype(np.intp))
    middle = means[:, 4]
    uneven = np.sqrt(np.maximum(means[:, 3] - np.sum(means[:, :2] ** 2, axis=1), 0.0))
    full = np.flatnonzero(fully_engaged(cut, measuring, middle))[_GUARD_REVS:-_GUARD_REVS]
    chatter = np.zeros(len(middle), dtype=bool)
    chatter[full] = _swings(middle[full], uneven[full], means[full, 2])
    feed = measuring.feed_mm_per_min
    if measuring.constant_feed:
        feed = float(np.polyfit(record.time_s[inside], x[inside], 1)[0]) * _PER_MINUTE
    return Revolutions(
        record,
        middle,
        means[:, :2],
        np.abs(means[:, 5]) if record.torque_nm is not None else None,
        means[:, 2],
        peaks,
        chatter,
        feed,
    )


def _swings(x: Array, uneven: Array, resultant: Array) -> npt.NDArray[np.bool_]:
    """Where the force within a revolution swings more, for its mean, than in the rest of the pass."""
    if len(uneven) < _FEWEST:
        return np.zeros(len(uneven), dtype=bool)
    share = uneven / np.maximum(resultant, 1e-300)
    place = (x - x.mean()) / max(float(np.ptp(x)), 1e-300)
    floor = _CHATTER_LEAST * float(np.median(share))
    weight = np.ones(len(share))
    for _ in range(_CHATTER_ROUNDS):
        # Least absolute deviations: what stands out does not bend the curve of the rest.
        off = share - np.polyval(np.polyfit(place, share, 2, w=np.sqrt(weight)), place)
        weight = 1.0 / np.maximum(np.abs(off), floor)
    spread = 1.4826 * float(np.median(np.abs(off))) + floor
    return np.asarray(off > _CHATTER * spread)
