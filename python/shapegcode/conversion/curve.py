"""Tolerance against time: what a tighter contour costs, cut by cut and for the program."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np

from shapegcode import _core
from shapegcode.conversion.whole_text import TextWriter, Written
from shapegcode.machine import Machine
from shapegcode.program import Program
from shapegcode.results.table import Column, Table

__all__ = ["CutCurve", "CutCurves", "ToleranceCurve", "TolerancePoint", "curve_table", "knee_of", "plan_curve"]

MARGIN = 0.95
"""Of the tolerance, for which a cut is planned: the rest is for rounding and for what the plan leaves out."""

FACTORS = (1.0, 1.25, 1.5, 2.0)
"""Of the tolerance that was asked for: at these it is planned."""

_BETWEEN = (2.8, 4.0, 5.6, 8.0)  # likewise, so that the curve between them is known where a price asks for it
_FLAT = 0.002  # of the time: a curve that falls by less has no knee


@dataclass(frozen=True)
class CutCurve:
    """Time of one shaped cut over the deviation that it is planned for.

    Attributes:
        planned_um: ascending; the last is what it reaches without slowing.
        times_s: of the shaped command at each, descending.
    """

    planned_um: tuple[float, ...]
    times_s: tuple[float, ...]

    @property
    def loosest_um(self) -> float:
        """Beyond this a looser tolerance saves no time."""
        return self.planned_um[-1] * 1.1

    def time_s(self, planned_um: float) -> float:
        """Between the planned points on straight lines over the logarithm of the deviation; constant beyond them."""
        if len(self.planned_um) == 1 or not math.isfinite(planned_um):
            return self.times_s[-1]
        return float(np.interp(math.log(planned_um), np.log(self.planned_um), self.times_s))


@dataclass(frozen=True)
class TolerancePoint:
    """The program at one contour tolerance.

    Attributes:
        name: "as asked", "1.5 times", "the original's contour error", "no slowing".
        tolerance_um: that the cuts are planned for; without slowing: what they then reach.
        time_s: of the program.
        time_increase_percent: over the original.
        is_within_price: of the program and of each cut.
        is_knee: a tighter tolerance costs disproportionately more time.
    """

    name: str
    tolerance_um: float
    time_s: float
    time_increase_percent: float
    is_within_price: bool
    is_knee: bool = False


@dataclass(frozen=True)
class ToleranceCurve:
    """Tolerance against time, of the cuts that can be shaped.

    Attributes:
        points: from tight to loose.
        cuts: how many cuts it is of.
    """

    points: tuple[TolerancePoint, ...]
    cuts: int

    @property
    def sentence(self) -> str:
        """The price of what was asked and of the knee, such as "15 µm costs +102 %, 25 µm +18 %"; empty: no time."""
        first, knee = self.points[0], next((each for each in self.points if each.is_knee), None)
        if knee is None:
            return ""
        return (
            f"{first.tolerance_um:.3g} µm costs {first.time_increase_percent:+.3g} % time, "
            f"{knee.tolerance_um:.3g} µm {knee.time_increase_percent:+.3g} %"
        )


def plan_curve(
    path: _core.Path, fir: _core.Fir, options: _core.ShapingOptions, asked_um: float, original_um: float
) -> CutCurve:
    """Plan a cut at several tolerances, from no slowing to what was asked; each search starts from the last speeds."""
    wanted = sorted(
        {*(factor * asked_um for factor in (*FACTORS, *_BETWEEN)), max(original_um, asked_um)}, reverse=True
    )
    tried = [math.inf, *(each * 1e-3 for each in wanted)]
    planned = _core.plan_tolerances(path, fir, options, tried)
    reached_um = max(planned[0][1] * 1e3, 1e-3)
    points = {reached_um: planned[0][0]}
    # What keeps a tolerance without slowing says nothing new; a search may end a little above a looser one's time.
    slowest = planned[0][0]
    for tolerance_um, (time_s, _) in zip(wanted, planned[1:], strict=True):
        if tolerance_um < reached_um:
            slowest = max(slowest, time_s)
            points[tolerance_um] = slowest
    ordered = sorted(points.items())
    return CutCurve(tuple(um for um, _ in ordered), tuple(time_s for _, time_s in ordered))


class CutCurves:
    """The curve of each cut of a conversion, planned when it is asked for.

    Args:
        writer: gives the writer on the grid that is used.
        program: the original.
        machine: its tolerance is what was asked for.
        originals: simulations of the original cuts under way.
    """

    def __init__(
        self,
        writer: Callable[[], TextWriter],
        program: Program,
        machine: Machine,
        originals: Sequence[Future[_core.PlaybackFigures]],
    ) -> None:
        self._writer, self._program, self._machine, self._originals = writer, program, machine, originals
        self._known: dict[int, tuple[object, CutCurve]] = {}  # on one grid
        self._feed_ratio: dict[int, float] = {}

    def note(self, written: Written) -> None:
        """Remember cuts that the tolerance does not slow: nothing needs to be planned for them."""
        grid = self._writer().grid
        for index in written.unslowed:
            known = self._known.get(index)
            if known is None or known[0] is not grid:
                self._known[index] = (
                    grid,
                    CutCurve((max(written.planned_um.get(index, 0.0), 1e-3),), (written.durations_s[index],)),
                )

    def of(self, index: int) -> CutCurve:
        """The curve of a cut."""
        writer = self._writer()
        known = self._known.get(index)
        if known is not None and known[0] is writer.grid:
            return known[1]
        asked_um = self._machine.tolerance.contour_um * MARGIN
        target = "command" if self._machine.shaping.contour != "response" else "response"
        original_um = getattr(self._originals[index].result(), target).max_abs_mm * 1e3
        path = self._program.regions[index].path
        curve = plan_curve(path, writer.grid.fir, writer.options(index, 1.0), asked_um, original_um)
        self._known[index] = writer.grid, curve
        return curve


def knee_of(tolerances_um: Sequence[float], times_s: Sequence[float]) -> int | None:
    """Rank of the point that lies furthest below the line from first to last, over logarithms."""
    if len(times_s) < 3 or times_s[0] <= times_s[-1] * (1.0 + _FLAT):
        return None
    x, y = np.log(tolerances_um), np.log(times_s)
    if x[-1] <= x[0]:
        return None
    below = (1.0 - (x - x[0]) / (x[-1] - x[0])) - (y - y[-1]) / (y[0] - y[-1])
    rank = int(np.argmax(below))
    return rank if below[rank] > 0.0 else None


def curve_table(curve: ToleranceCurve) -> Table:
    """The curve as a table."""
    columns = (
        Column("contour tolerance", value="name", text=True),
        Column("µm", value="tolerance_um", digits=1),
        Column("program s", value="time_s", digits=2),
        Column("increase %", value="time_increase_percent", digits=1),
        Column("", value=_remark, text=True),
    )
    return Table("tolerance against time", columns, curve.points, caption=f"{curve.cuts} cuts that can be shaped")


def _remark(point: TolerancePoint) -> str:
    said = (["knee"] if point.is_knee else []) + ([] if point.is_within_price else ["above the price"])
    return ", ".join(said)
