"""A comparison of shapers: how designs rank, which one to take and why in words; tables, the answer, the next step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from shapegcode._core import ArgumentError
from shapegcode.results.outcome import Plot
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table
from shapegcode.shaping.bands import SAME, Design, ModeBand, ms, spoken
from shapegcode.shaping.registry import FAMILIES

NO_RESIDUAL = 1e-9  # a residual ratio below this is none: what is left is the rounding of the solver

_CONVERTED = {"non-negative", "robust"}  # what a conversion takes by itself
_FOR_GRIDS = {row.name for row in FAMILIES if not row.continuous}
_DIGITS = 9  # designs that agree in so many digits are equally good
_ROUNDING = 1e-6  # a design made for a limit may miss it by so much, relative


def _merits(each: Design) -> tuple[float, float, float, float]:
    """What is better small: duration, worst residual, contour cost (either sign), sum of magnitudes."""
    values = (each.duration_s, max(each.worst_residual, NO_RESIDUAL), abs(each.variance_s2), each.abs_sum)
    duration, residual, contour, magnitudes = (float(f"{value:.{_DIGITS}g}") for value in values)
    return duration, residual, contour, magnitudes


OBJECTIVES = {
    "shortest": "the shortest",
    "contour": "the one with the least contour cost",
    "robust": "the one with the least worst residual",
}
"""Objectives by name, and how the reason calls the winner."""


def _order(each: Design, objective: str) -> tuple[float, ...]:
    """What is least in the design to take, then the family of which an equally good one is taken."""
    duration, residual, contour, _ = _merits(each)
    fewest_blocks = -(each.period_s or 0.0)  # the longest period
    rank = 0.0 if each.family in _CONVERTED else 1.0 if each.family in _FOR_GRIDS else 2.0
    if objective == "shortest":  # what is left is within the limit
        return duration, fewest_blocks, rank, contour, residual
    first, last = (contour, residual) if objective == "contour" else (residual, contour)
    return first, duration, fewest_blocks, last, rank


def pareto_front(designs: Sequence[Design]) -> list[bool]:
    """For each design whether no other one is at least as good in everything and better in something.

    Compared are duration, worst residual, magnitude of the contour cost and sum of the taps' magnitudes, each to nine
    digits, a residual below 1e-9 as none. A design on a grid serves where continuous times are asked for, not the
    other way round: so designs on grids are compared with each other only.
    """
    if not designs:
        return []
    merits = np.array([_merits(each) for each in designs])
    on_grid = np.array([each.period_s is not None for each in designs])
    front = []
    for own, grid in zip(merits, on_grid, strict=True):
        better = (merits <= own).all(axis=1) & (merits < own).any(axis=1)
        front.append(not bool((better & (on_grid | ~grid)).any()))
    return front


def recommend(
    designs: Sequence[Design], vibration_limit: float, objective: str = "shortest", allow_negative: bool = False
) -> int:
    """Index of the design to take.

    Of the designs without negative impulses (of all with `allow_negative`, or where every design has some) those whose
    worst residual is at most the limit compete for the objective, and of these, if there are any, those that cancel the
    modes that state no band; if there is none within the limit, the one that leaves least is taken. Of equally short
    ones on grids, to 2 %, the one with the longest period is taken, because it writes the fewest blocks; of equal ones
    the family that a conversion takes by itself, then one that is made for grids.
    """
    if not designs:
        raise ArgumentError("there is no design to choose from: 0 given")
    indices, good = _competing(designs, vibration_limit, allow_negative)
    aim = objective if good else "robust"
    orders = {index: _order(designs[index], aim) for index in good or indices}
    best = min(orders, key=orders.__getitem__)
    if designs[best].period_s is None or (good and objective != "shortest"):
        return best
    most = (1.0 + SAME) * orders[best][0]
    periods = {index: designs[index].period_s or 0.0 for index, order in orders.items() if order[0] <= most}
    longest_s = max(periods.values())
    return min((index for index in periods if periods[index] == longest_s), key=orders.__getitem__)


def _competing(designs: Sequence[Design], limit: float, allow_negative: bool) -> tuple[list[int], list[int]]:
    """Designs that may be taken; those within the limit, of them those that cancel the modes without a band."""
    indices = [index for index, each in enumerate(designs) if allow_negative or not each.negative]
    indices = indices or list(range(len(designs)))
    good = [index for index in indices if is_within(designs[index], limit)]
    return indices, [index for index in good if designs[index].exact] or good


def is_within(each: Design, vibration_limit: float) -> bool:
    """Whether the worst residual is at most the limit, but for rounding."""
    return each.worst_residual <= vibration_limit * (1.0 + _ROUNDING)


def reason_for(
    designs: Sequence[Design], index: int, bands: Sequence[ModeBand], limit: float, objective: str, allow_negative: bool
) -> str:
    """Why `recommend` takes the design of that index, in a sentence."""
    taken = designs[index]
    indices, among = _competing(designs, limit, allow_negative)
    good, leaves = len(among), _left(taken.worst_residual)
    only_negative = not allow_negative and taken.negative
    kind = "" if allow_negative or only_negative else "non-negative "
    if good:
        unstated = [band for band in bands if not band.uncertainty]
        exactly = f" and which cancel{'' if good > 1 else 's'} {spoken(unstated)}" if unstated and taken.exact else ""
        text = (
            f"{OBJECTIVES[objective]} of {good} {kind}design{'' if good == 1 else 's'} whose worst residual over "
            f"{spoken(bands)} stays within {_left(limit)}{exactly} (it leaves {leaves})"
        )
    else:
        text = (
            f"none of {len(indices)} {kind}design{'' if len(indices) == 1 else 's'} stays within {_left(limit)} "
            f"over {spoken(bands)}; this one leaves least, {leaves}"
        )
        others = [each for each in designs if each.negative and is_within(each, limit)]
        if others and not allow_negative:
            other = min(others, key=lambda each: _order(each, "shortest"))
            text += f"; with negative impulses {other.family} ({ms(other.duration_s)}) would leave less"
    return text + ("; every design has negative impulses" if only_negative else "")


def _left(ratio: float) -> str:
    return "nothing" if ratio < NO_RESIDUAL else f"{_percent(ratio)} %"


_MARK, _GRID_MARK = "=>", "->"
_PARETO_OF_A_FAMILY = 3  # rows, beside the preferred one
_SPEED_MM_PER_S, _RADIUS_MM = 200.0, 20.0  # at which the contour cost is shown


@dataclass(frozen=True)
class Refusal:
    """A family that has no design."""

    family: str  # name of its row in the registry
    period_s: float | None  # grid on which it was tried, s; None: continuous times
    reason: str  # why there is none, with what is nearest where the family knows


@dataclass(frozen=True, repr=False, eq=False)
class Recommendation(Result):
    """A comparison of shapers and the one to take.

    Attributes:
        modes: what is to be cancelled.
        designs: every design, in the order of the registry and of the periods.
        recommended: index of the design to take.
        reason: why it is that one, in a sentence.
        refused: families without a design.
        objective: what is least in the design to take: "shortest", "contour" or "robust".
        allow_negative: whether a design with negative impulses may be taken.
        vibration_limit: largest worst residual ratio of the design to take.
        max_duration_s: longest shaper that was looked for, s.
        max_abs_sum: largest sum of the impulses' magnitudes.
        machine: whose modes they are: its name, of the command as -m names it; None: the modes were given.
        warnings: none as a rule.
    """

    json_extra: ClassVar[dict[str, Any]] = {**Result.json_extra, "recommended_on_grid": int | None}

    modes: tuple[ModeBand, ...]
    designs: tuple[Design, ...]
    recommended: int
    reason: str
    refused: tuple[Refusal, ...]
    objective: str
    allow_negative: bool
    vibration_limit: float
    max_duration_s: float
    max_abs_sum: float
    machine: str | None = None
    warnings: tuple[str, ...] = ()

    @property
    def methods(self) -> tuple[str, ...]:
        """Every family that has a design."""
        return tuple(f"shaper {each.family}" for each in self.designs)

    @property
    def design(self) -> Design:
        """The design to take."""
        return self.designs[self.recommended]

    @property
    def ok(self) -> bool:
        """Whether the worst residual of the design to take stays within the vibration limit."""
        return is_within(self.design, self.vibration_limit)

    @property
    def recommended_on_grid(self) -> int | None:
        """Index of the design to take of those on a grid, which alone can be written as blocks; None: there is none."""
        return self._best_of([index for index, each in enumerate(self.designs) if each.period_s is not None])

    @property
    def best_by_period(self) -> dict[float, int]:
        """Index of the design to take on each grid, by its period in s, ascending."""
        indices: dict[float, list[int]] = {}
        for index, each in enumerate(self.designs):
            if each.period_s is not None:
                indices.setdefault(each.period_s, []).append(index)
        best = {period_s: self._best_of(indices[period_s]) for period_s in sorted(indices)}
        return {period_s: index for period_s, index in best.items() if index is not None}

    def _best_of(self, indices: Sequence[int]) -> int | None:
        if not indices:
            return None
        designs = [self.designs[index] for index in indices]
        return indices[recommend(designs, self.vibration_limit, self.objective, self.allow_negative)]

    @property
    def answer(self) -> str:
        """What to take, how long it lasts and what it leaves."""
        word = "take" if self.ok else "NONE is good enough; best is"
        return f"{word} {_spoken(self.design)}, leaves {self._left(self.design)}"

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        if not self.ok:
            return (
                "measure the frequencies more closely (a narrower band), or allow more: --max-duration, "
                "--vibration-limit, --negative"
            )
        index = self.recommended_on_grid
        if index is None:
            return (
                "blocks of a program need impulses on a grid: compare some with --block-period 5ms, or name the "
                "machine with -m"
            )
        best = self.designs[index]
        options = f"--shaper {best.family} --block-period {(best.period_s or 0.0) * 1e3:.6g}ms -o shaped.nc"
        if best.family == "taps":
            return "impulses of your own cannot be written by convert: take a family, or use the Python interface"
        if self.machine is None:
            return (
                f"put the modes into a machine file (shapegcode machine init -o mine.toml), then "
                f"shapegcode convert part.nc -m mine.toml {options}"
            )
        return f"shapegcode convert part.nc -m {self.machine} {options}"

    def notes(self) -> list[str]:
        """Why it is that one; what to take for blocks where that is another one; the best of each grid."""
        lines = [f"{_MARK} {'recommended' if self.ok else 'the best there is'}: {self.reason}"]
        index = self.recommended_on_grid
        if index is not None and index != self.recommended:
            other = self.designs[index]
            lines.append(f"{_GRID_MARK} for the blocks of a program: {_spoken(other)}, leaves {self._left(other)}")
        best = [self.designs[index] for index in self.best_by_period.values()]
        if len(best) > 1:
            lines.append(f"best of each grid: {'; '.join(map(_spoken, best))}")
        return lines

    def _left(self, each: Design) -> str:
        among = "within the bands of" if any(band.uncertainty for band in self.modes) else "of"
        where = f"{among} {spoken(self.modes)}"
        if each.worst_residual < NO_RESIDUAL:
            return f"nothing {where}"
        return f"at most {_percent(each.worst_residual)} % {where} (limit {_percent(self.vibration_limit)} %)"

    def shown(self, *, everything: bool = False) -> list[int]:
        """Indices of the designs for a table, shortest first.

        What is recommended, at all and for each grid; of each family at continuous times the preferred design and the
        shortest ones of the Pareto front, and on grids the shortest one of all.

        Args:
            everything: all designs instead.

        Returns:
            Indices of `designs`.
        """
        if everything:
            return sorted(range(len(self.designs)), key=lambda index: (self.designs[index].duration_s, index))
        kept = {self.recommended, *self.best_by_period.values()}
        families: dict[tuple[str, bool], list[int]] = {}
        for index, each in enumerate(self.designs):
            families.setdefault((each.family, each.period_s is None), []).append(index)

        def length(index: int) -> tuple[float, float]:
            # Of equally long ones the longest period: it writes the fewest blocks.
            return round(self.designs[index].duration_s, 9), -(self.designs[index].period_s or 0.0)

        for (_, continuous), members in families.items():
            by_duration = sorted(members, key=length)
            front = [index for index in by_duration if self.designs[index].pareto]
            kept |= {members[0], *front[:_PARETO_OF_A_FAMILY]} if continuous else set(by_duration[:1])
        return sorted(kept, key=lambda index: (self.designs[index].duration_s, index))

    def tables(
        self, speed_mm_per_s: float = _SPEED_MM_PER_S, radius_mm: float = _RADIUS_MM, *, everything: bool = False
    ) -> list[Table]:
        """The designs with what they cost and leave; the families without one, and why.

        Args:
            speed_mm_per_s: at which the contour cost is shown.
            radius_mm: of the arc on which it is shown.
            everything: all designs, not only those of `shown`.

        Returns:
            One table, or two where a family was refused.
        """
        found = [self._designs_table(speed_mm_per_s, radius_mm, everything)]
        return [*found, self._refused_table()] if self.refused else found

    def _designs_table(self, speed_mm_per_s: float, radius_mm: float, everything: bool) -> Table:
        indices = self.shown(everything=everything)
        rows = [self.designs[index] for index in indices]
        marks = {id(self.design): _MARK}
        if (on_grid := self.recommended_on_grid) is not None:
            marks.setdefault(id(self.designs[on_grid]), _GRID_MARK)
        columns = (
            Column("", value=lambda each: marks.get(id(each), ""), text=True),
            Column("family", text=True),
            Column("grid", "ms", lambda each: "any" if each.period_s is None else f"{each.period_s * 1e3:.4g}"),
            Column("lasts", "ms", lambda each: each.duration_s * 1e3, digits=2),
            Column("worst", "%", lambda each: _percent(each.worst_residual)),
            Column("nominal", "%", lambda each: _percent(each.residual)),
            Column("σ²", "ms²", lambda each: f"{each.variance_s2 * 1e6:.4g}"),
            Column("arc", "µm", lambda each: f"{each.radial_error_um(speed_mm_per_s, radius_mm):.4g}"),
            Column("Σ|a|", value=lambda each: f"{each.abs_sum:.3g}"),
            Column("a < 0", value=lambda each: sum(tap < 0.0 for tap in each.amplitudes) or None),
            Column("Pareto", value=lambda each: "yes" if each.pareto else None, text=True),
        )
        left_out = len(self.designs) - len(rows)
        caption = f"arc: by how much R{radius_mm:g} mm comes out too small at {speed_mm_per_s:g} mm/s"
        return Table(
            f"shapers for {', '.join(map(str, self.modes))}", columns, rows,
            caption=caption + (f"; {left_out} more designs: --verbose shows them" if left_out else ""),
            row_style=lambda each: "bold" if each is self.design else "",
        )  # fmt: skip

    def _refused_table(self) -> Table:
        """The same reason on several kinds of times is one row."""
        times: dict[tuple[str, str], list[float | None]] = {}
        for refusal in self.refused:
            times.setdefault((refusal.family, refusal.reason), []).append(refusal.period_s)
        columns = (
            Column("family", value=lambda row: row[0][0], text=True),
            Column("times", value=lambda row: ", ".join(map(times_name, row[1])), text=True),
            Column("why", value=lambda row: row[0][1], text=True),
        )
        return Table("no design", columns, list(times.items()))

    def plots(self) -> Mapping[str, Plot]:
        """Pareto front, sensitivity, impulses, steps, and for two modes the branches of minimal shapers."""
        return self._drawn_beside()


def families_table() -> Table:
    """Every family of the registry: what it is, where it comes from, where it is valid."""
    columns = (
        Column("family", value="name", text=True),
        Column("what", value="title", text=True),
        Column(
            "times", value=lambda row: ", ".join(["continuous"] * row.continuous + ["grid"] * row.on_grid), text=True
        ),
        Column("valid for", value="validity", text=True),
        Column("source", text=True),
    )
    return Table("families of shapers", columns, FAMILIES, sections=range(len(FAMILIES)))


def times_name(period_s: float | None) -> str:
    """Kind of times in words."""
    return "continuous" if period_s is None else f"{period_s * 1e3:.4g} ms grid"


def _spoken(each: Design) -> str:
    times = "at continuous times" if each.period_s is None else f"on the {times_name(each.period_s)}"
    return f"{each.family} ({each.duration_s * 1e3:.4g} ms {times})"


def _percent(ratio: float) -> str:
    return "0" if ratio < NO_RESIDUAL else f"{100.0 * ratio:.3g}"
