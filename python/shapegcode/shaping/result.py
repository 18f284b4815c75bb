"""Result of a comparison of shapers: ranking, recommendation and reason; tables, the answer, the next step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from shapegcode._core import ArgumentError, Shaper
from shapegcode.results.outcome import Plot
from shapegcode.results.result import Result
from shapegcode.results.table import Column, Table
from shapegcode.shaping.bands import SAME, Design, ModeBand, ms, spoken
from shapegcode.shaping.registry import FAMILIES

NO_RESIDUAL = 1e-9  # a smaller residual ratio counts as zero: it is the solver's rounding

_CONVERTED = {"non-negative", "robust"}  # families that a conversion uses by default
_FOR_GRIDS = {row.name for row in FAMILIES if not row.continuous}
_DIGITS = 9  # figures equal in this many digits are equally good
_ROUNDING = 1e-6  # relative tolerance of a limit


def _merits(each: Design) -> tuple[float, float, float, float]:
    """Figures to minimise: duration, worst residual, magnitude of the contour cost (variance), sum of magnitudes."""
    values = (each.duration_s, max(each.worst_residual, NO_RESIDUAL), abs(each.variance_s2), each.abs_sum)
    duration, residual, contour, magnitudes = (float(f"{value:.{_DIGITS}g}") for value in values)
    return duration, residual, contour, magnitudes


OBJECTIVES = {
    "shortest": "the shortest",
    "contour": "the one with the least contour cost",
    "robust": "the one with the smallest worst residual",
}
"""Objectives by name, with the winner's description in the reason."""


def _order(each: Design, objective: str) -> tuple[float, ...]:
    """Sort key of a design for an objective: the design with the smallest key is the best."""
    duration, residual, contour, _ = _merits(each)
    fewest_blocks = -(each.period_s or 0.0)  # the longest period
    rank = 0.0 if each.family in _CONVERTED else 1.0 if each.family in _FOR_GRIDS else 2.0
    if objective == "shortest":  # the residual is within the limit
        return duration, fewest_blocks, rank, contour, residual
    first, last = (contour, residual) if objective == "contour" else (residual, contour)
    return first, duration, fewest_blocks, last, rank


def pareto_front(designs: Sequence[Design]) -> list[bool]:
    """For each design: True if no other one is at least as good in every figure and better in one.

    The figures are duration, worst residual, magnitude of the contour cost and sum of the impulses' magnitudes, each to
    nine digits; a residual below 1e-9 counts as zero. A design on a grid is also valid at continuous times, not the
    reverse, so designs on grids are compared only with each other.
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
    """Index of the recommended design.

    Designs with negative impulses are excluded, except with `allow_negative` or if every design has some. Candidates
    are the others whose worst residual is within the limit. If some of them exactly cancel the modes without a
    stated band, only these are candidates.

    With candidates, the best one by the objective is taken. If it is on a grid and the objective is "shortest", a
    longer period (fewer blocks) is preferred: of the candidates whose duration is at most 2 % longer, the one with the
    longest period is taken. Without candidates, the design with the smallest worst residual is taken; if it is on a
    grid, by the same preference among designs whose worst residual is at most 2 % larger.

    If candidates are equal, a family that `convert` uses comes first, then one made for grids.
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
    """Indices of the allowed designs (of all if none is), and of those within the limit: only `exact` ones, if any."""
    indices = [index for index, each in enumerate(designs) if allow_negative or not each.negative]
    indices = indices or list(range(len(designs)))
    good = [index for index in indices if is_within(designs[index], limit)]
    return indices, [index for index in good if designs[index].exact] or good


def is_within(each: Design, vibration_limit: float) -> bool:
    """Whether the worst residual is within the limit, apart from rounding."""
    return each.worst_residual <= vibration_limit * (1.0 + _ROUNDING)


def reason_for(
    designs: Sequence[Design], index: int, bands: Sequence[ModeBand], limit: float, objective: str, allow_negative: bool
) -> str:
    """Reason why `recommend` takes this design, in a sentence."""
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
            f"{spoken(bands)} stays within {_left(limit)}{exactly} (residual {leaves})"
        )
    else:
        text = (
            f"none of {len(indices)} {kind}design{'' if len(indices) == 1 else 's'} stays within {_left(limit)} "
            f"over {spoken(bands)}; this one has the least, {leaves}"
        )
        others = [each for each in designs if each.negative and is_within(each, limit)]
        if others and not allow_negative:
            other = min(others, key=lambda each: _order(each, "shortest"))
            text += f"; with negative impulses {other.family} ({ms(other.duration_s)}) would stay within it"
    return text + ("; every design has negative impulses" if only_negative else "")


def _left(ratio: float) -> str:
    return "zero" if ratio < NO_RESIDUAL else f"{_percent(ratio)} %"


_MARK, _GRID_MARK = "=>", "->"
_PARETO_OF_A_FAMILY = 3  # rows in addition to the preferred one
_SPEED_MM_PER_S, _RADIUS_MM = 200.0, 20.0  # for which the contour cost is shown


@dataclass(frozen=True)
class Refusal:
    """A family without a design."""

    family: str  # name of its row in the registry
    period_s: float | None  # grid on which it was tried, s; None: continuous times
    reason: str  # why there is none, with the nearest design if known


@dataclass(frozen=True, repr=False, eq=False)
class Recommendation(Result):
    """A comparison of shapers and the recommended one.

    Attributes:
        modes: modes to cancel.
        designs: every design, by family in the given order (else the registry's), then by period; `robust` ones above
            the limit come last.
        recommended: index of the recommended design.
        reason: reason for the recommendation, in a sentence.
        refused: families without a design.
        objective: figure to minimise: "shortest", "contour" or "robust".
        allow_negative: designs with negative impulses are allowed.
        vibration_limit: limit of the worst residual ratio.
        max_duration_s: longest searched shaper, s.
        max_abs_sum: largest sum of the impulses' magnitudes.
        machine: name of the machine of the modes (in the command, the value of -m); None: modes were given.
        warnings: usually none.
    """

    json_extra: ClassVar[dict[str, Any]] = {**Result.json_extra, "recommended_on_grid": int | None}
    main_list: ClassVar[str] = "designs"

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
        """Methods of every family with a design."""
        return tuple(f"shaper {each.family}" for each in self.designs)

    @property
    def design(self) -> Design:
        """The recommended design."""
        return self.designs[self.recommended]

    @property
    def shaper(self) -> Shaper:
        """The recommended shaper."""
        return self.design.shaper

    @property
    def ok(self) -> bool:
        """Whether the worst residual of the recommended design is within the vibration limit."""
        return is_within(self.design, self.vibration_limit)

    @property
    def recommended_on_grid(self) -> int | None:
        """Index of the best design on a grid, as needed to write blocks; None: no such design."""
        indices = [index for index, each in enumerate(self.designs) if each.period_s is not None]
        return self._best_of(indices) if indices else None

    @property
    def best_by_period(self) -> dict[float, int]:
        """Index of the best design on each grid, by its period in s, ascending."""
        indices: dict[float, list[int]] = {}
        for index, each in enumerate(self.designs):
            if each.period_s is not None:
                indices.setdefault(each.period_s, []).append(index)
        return {period_s: self._best_of(indices[period_s]) for period_s in sorted(indices)}

    def _best_of(self, indices: Sequence[int]) -> int:
        designs = [self.designs[index] for index in indices]
        return indices[recommend(designs, self.vibration_limit, self.objective, self.allow_negative)]

    @property
    def answer(self) -> str:
        """The recommended design, its duration and its residual."""
        word = "take" if self.ok else "NONE is good enough; best is"
        return f"{word} {_spoken(self.design)}, {self._left(self.design)}"

    @property
    def next_step(self) -> str:
        """Next command or measurement, in one sentence."""
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
            return "your own impulses cannot be used by convert: choose a family, or use the Python interface"
        if self.machine is None:
            return (
                f"write the modes to a machine file (shapegcode machine init -o mine.toml), then "
                f"shapegcode convert part.nc -m mine.toml {options}"
            )
        return f"shapegcode convert part.nc -m {self.machine} {options}"

    def notes(self) -> list[str]:
        """Reason of the recommendation; best design for blocks, if another; best design of each grid, if several."""
        lines = [f"{_MARK} {'recommended' if self.ok else 'best available'}: {self.reason}"]
        index = self.recommended_on_grid
        if index is not None and index != self.recommended:
            other = self.designs[index]
            lines.append(f"{_GRID_MARK} for the blocks of a program: {_spoken(other)}, {self._left(other)}")
        best = [self.designs[index] for index in self.best_by_period.values()]
        if len(best) > 1:
            lines.append(f"best of each grid: {'; '.join(map(_spoken, best))}")
        return lines

    def _left(self, each: Design) -> str:
        among = "within the bands of" if any(band.uncertainty for band in self.modes) else "at"
        where = f"{among} {spoken(self.modes)}"
        if each.worst_residual < NO_RESIDUAL:
            return f"zero residual {where}"
        return f"residual at most {_percent(each.worst_residual)} % {where} (limit {_percent(self.vibration_limit)} %)"

    def shown(self, *, everything: bool = False) -> list[int]:
        """Indices of the designs for a table, shortest first.

        The recommended designs, overall and for each grid. Of each family also: at continuous times the preferred
        design and the shortest on the Pareto front; on grids the shortest.

        Args:
            everything: return all designs.

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
            # Of equal durations the longest period: it needs the fewest blocks.
            return round(self.designs[index].duration_s, 9), -(self.designs[index].period_s or 0.0)

        for (_, continuous), members in families.items():
            by_duration = sorted(members, key=length)
            front = [index for index in by_duration if self.designs[index].pareto]
            kept |= {members[0], *front[:_PARETO_OF_A_FAMILY]} if continuous else set(by_duration[:1])
        return sorted(kept, key=lambda index: (self.designs[index].duration_s, index))

    def tables(
        self, speed_mm_per_s: float = _SPEED_MM_PER_S, radius_mm: float = _RADIUS_MM, *, everything: bool = False
    ) -> list[Table]:
        """Designs with their figures; families without a design, and why.

        Args:
            speed_mm_per_s: speed for which the contour cost is shown.
            radius_mm: radius of the arc for which it is shown.
            everything: all designs, not only those of `shown`.

        Returns:
            One table, or two if a family was refused.
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
            Column("duration", "ms", lambda each: each.duration_s * 1e3, digits=2),
            Column("worst", "%", lambda each: _percent(each.worst_residual)),
            Column("nominal", "%", lambda each: _percent(each.residual)),
            Column("σ²", "ms²", lambda each: f"{each.variance_s2 * 1e6:.4g}"),
            Column("arc", "µm", lambda each: f"{each.radial_error_um(speed_mm_per_s, radius_mm):.4g}"),
            Column("Σ|a|", value=lambda each: f"{each.abs_sum:.3g}"),
            Column("a < 0", value=lambda each: sum(tap < 0.0 for tap in each.amplitudes) or None),
            Column("Pareto", value=lambda each: "yes" if each.pareto else None, text=True),
        )
        left_out = len(self.designs) - len(rows)
        caption = f"σ²: variance of the impulse times; arc: radius lost by R{radius_mm:g} mm at {speed_mm_per_s:g} mm/s"
        return Table(
            f"shapers for {', '.join(map(str, self.modes))}", columns, rows,
            caption=caption + (f"; {left_out} more designs: --verbose shows them" if left_out else ""),
            row_style=lambda each: "bold" if each is self.design else "",
        )  # fmt: skip

    def _refused_table(self) -> Table:
        """Table of refusals; the same reason on several grids is one row."""
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
        """Pareto front, sensitivity, impulses, steps, and for two modes the shapers of three impulses."""
        return self._drawn_beside()


def families_table() -> Table:
    """Table of the families in the registry: name, title, kind of times, validity, source."""
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
    """Grid or continuous times, in words."""
    return "continuous" if period_s is None else f"{period_s * 1e3:.4g} ms grid"


def _spoken(each: Design) -> str:
    times = "at continuous times" if each.period_s is None else f"on the {times_name(each.period_s)}"
    return f"{each.family} ({each.duration_s * 1e3:.4g} ms {times})"


def _percent(ratio: float) -> str:
    return "0" if ratio < NO_RESIDUAL else f"{100.0 * ratio:.3g}"
