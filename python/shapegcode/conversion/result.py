"""Result of a conversion: figures before and after, cases, regions, warnings, next step, emitted program."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from shapegcode.conversion.budget import BudgetOutcome
from shapegcode.conversion.operating import ControlNote, control_table, restart_table
from shapegcode.conversion.plan import ToleranceCurve, curve_table
from shapegcode.conversion.restart import RestartPoint
from shapegcode.conversion.tables import (
    BeforeAfter,
    CutOutcome,
    RapidsOutcome,
    Sensitivity,
    before_after_table,
    change_percent,
    cut_table,
    sensitivity_table,
)
from shapegcode.model.programs import SimulatedPrograms
from shapegcode.program import Program
from shapegcode.program.comparison import KindCount, ProgramDifference
from shapegcode.results.json import Provenance, exact, hidden, sparse
from shapegcode.results.outcome import CONTOURS, ContourError, Pair, Plot
from shapegcode.results.result import Result
from shapegcode.results.table import Table
from shapegcode.verdict.figures import AppliedLimits, BlockCount, Placed, ProgramFigures, UsedShaper, case_table

if TYPE_CHECKING:
    from shapegcode.results.page.model import Light, Section
    from shapegcode.results.page.scene import Scene

_MIN_SHOWN_UM = 0.05
_DEVIATIONS = {"max": "largest", "rms": "RMS", "gouge": "gouge", "excess": "excess"}


Grade = Literal[
    "worth running",
    "better, tolerance not met",
    "already within tolerance: shaping is optional",
    "no benefit: run the original",
    "do not run",
]
"""From best to worst; the first that applies from the end is the answer."""


@dataclass(frozen=True)
class ChangeProof:
    """Proof of what is unchanged in an emitted program."""

    answer: str  # such as "42 of 42 rapids, 7 of 7 tool calls, 31 of 31 offsets unchanged; programmed …"
    counts: tuple[KindCount, ...]  # for each kind that occurs in one of the programs
    path_um: float  # largest distance between the programmed paths of a cut in both programs, in either direction
    refused: tuple[ProgramDifference, ...]  # differences not explained by shaping; none: proven


@dataclass(frozen=True)
class DialectNotes:
    """Control for which the program is written, and its known properties."""

    name: str  # `emission.dialect`
    control: str  # its name
    facts: Mapping[str, str]  # by topic (words, dwell, look-ahead, override, restart ...)
    assumed: tuple[str, ...]  # topics without a source

    @property
    def sentence(self) -> str:
        """The target control, and the topics whose rules are assumed, in one sentence."""
        assumed = f"; assumed: {', '.join(self.assumed)}" if self.assumed else ""
        return f"written for {self.control} (emission.dialect = {self.name}){assumed}"


@dataclass(frozen=True)
class FilterAdvice:
    """A contour error caused by the control's own filter, and its remedy without shaping."""

    key: str  # key of the filter's time constant
    now_s: float  # its present value
    enough_s: float  # value at which every cut of the original keeps its limits, simulated
    rounding_um: float  # contour error of the command caused by the filter
    lines: tuple[int, int]  # lines of the cut with the largest error

    def __str__(self) -> str:
        lower = f"with {self.enough_s * 1e3:.3g} ms" if self.enough_s > 0.0 else "switched off"
        return (
            f"the control's {self.now_s * 1e3:.3g} ms filter rounds the path by {self.rounding_um:.0f} µm (lines "
            f"{self.lines[0]} to {self.lines[1]}): {lower} ({self.key}), or with contour control, the original keeps "
            "every limit unshaped"
        )


@dataclass(frozen=True, repr=False, eq=False, kw_only=True)
class Conversion(ProgramFigures, Result):
    """The emitted program, and the results of its simulation compared with the original.

    Attributes:
        program: name of the original.
        machine: name of the machine.
        recommendation: recommendation for the program: one of the five values of `Grade`.
        reason: reason of the recommendation.
        cuts: every cut, shaped or left unchanged, with its gain and its time.
        tolerance_curve: what other contour tolerances cost in time; null: not computed, or no cut was ever shaped.
        proof: evidence that only shaped cuts changed; null: nothing was shaped, or rapids were shaped without a header.
        advice: a smaller filter of the control that makes shaping unnecessary; null: none.
        cycle_time_s: whole program: cuts, rapids with in-position wait, dwells, drilling cycles, tool changes, M codes.
        cutting_time_s: the cuts alone, until the set-points rest.
        block_period_s: block period: a shaped block lasts one, or several where blocks were merged.
        shaper: the shaper; its impulses are whole block periods apart.
        blocks: number of blocks read, and of shaped blocks.
        expanded: true if the original was expanded (calls, macros, coordinate modes) before shaping.
        expanded_radii_mm: radii of cutter compensation included in the path, by offset.
        bytes_read: size of the original, expanded.
        bytes_emitted: size of the emitted program.
        limits: tolerances and price that were applied.
        warnings: sentences to read before the program is run.
        budget: only with a budget: its limits and effect.
        rapids: only with shaped rapids: their outcome.
        least_gain_um: smallest gain for which a cut is shaped, µm.
        parameter_sensitivity: unverified values that matter, sorted by how much they increase a figure relative to its
            limit, the largest increase first.
        unverified_parameters_tested: number of unverified values that were changed, one at a time.
        at_the_control: cautions for loading and running it; empty if nothing was shaped.
        restart_points: blocks inside shaped cuts at which the control can restart.
        emitted: the emitted program, read back.
        placed: the shaped regions and their positions in it.
        dialect: only if the program is written for a control other than FANUC's.
        written: the program in the dialect of that control; None: `emitted` is written.
        simulated: a handle, not data: both programs and the machine, to simulate them again for a picture or a page.
    """

    json_extra: ClassVar[dict[str, Any]] = Result.json_extra | {"within_tolerance": bool, "shaped_cuts_within": bool}

    program: str
    machine: str
    recommendation: Grade
    reason: str
    cuts: tuple[CutOutcome, ...]
    tolerance_curve: ToleranceCurve | None
    proof: ChangeProof | None
    advice: FilterAdvice | None
    cycle_time_s: Pair[float]
    cutting_time_s: Pair[float]
    block_period_s: float
    shaper: UsedShaper = field(metadata=exact())
    blocks: BlockCount
    expanded: bool
    expanded_radii_mm: Mapping[str, float]
    bytes_read: int
    bytes_emitted: int
    limits: AppliedLimits
    warnings: tuple[str, ...]
    budget: BudgetOutcome | None = field(default=None, metadata=sparse())
    rapids: RapidsOutcome | None = field(default=None, metadata=sparse())
    least_gain_um: float = 0.0
    parameter_sensitivity: tuple[Sensitivity, ...] = ()
    unverified_parameters_tested: int = 0
    at_the_control: tuple[ControlNote, ...] = ()
    restart_points: tuple[RestartPoint, ...] = ()
    emitted: Program = field(metadata=hidden())
    placed: tuple[Placed, ...] = field(metadata=hidden())
    dialect: DialectNotes | None = field(default=None, metadata=sparse())
    written: bytes | None = field(default=None, metadata=hidden())
    simulated: SimulatedPrograms | None = field(default=None, compare=False, metadata=hidden())

    __eq__ = Result.__eq__
    __hash__ = Result.__hash__

    @property
    def methods(self) -> tuple[str, ...]:
        """Published methods used for shaper, blocks, controller and proof."""
        found = [f"shaper {self.shaper.family}"]
        if self.simulated is not None:
            found += self.simulated.methods
            if self.regions and self.simulated.machine.emission.rounding == "vibration":
                found.append("rounding of block ends")
        return (*found, "comparison of programs") if self.proof is not None else tuple(found)

    @property
    def text(self) -> bytes:
        """The content of the emitted program file."""
        return self.emitted.text if self.written is None else self.written

    @property
    def ok(self) -> bool:
        """True if the recommended program can be run without further decisions: exit code 0."""
        return self.recommendation not in ("better, tolerance not met", "do not run")

    @property
    def is_written_as_output(self) -> bool:
        """False if it must not be run and is written with another suffix."""
        return self.recommendation != "do not run"

    @property
    def nothing_shaped(self) -> bool:
        """True if no cut was shaped."""
        return self.blocks.emitted == 0

    @property
    def kept(self) -> tuple[CutOutcome, ...]:
        """The cuts left unchanged for a reason other than the budget."""
        over_budget = {each.lines for each in self.budget.left_unchanged} if self.budget is not None else set()
        return tuple(cut for cut in self.cuts if not cut.is_shaped and cut.lines not in over_budget)

    @property
    def answer(self) -> str:
        """Recommendation, figures and time; then a cut beyond its limits, with its remedy."""
        lines = [self._headline(), *self._left_out()]
        if self.recommendation == "do not run" and not any(self.reason in line for line in lines):
            lines.append(self.reason)
        elif self.advice is not None:
            lines.append(str(self.advice))
        if self.dialect is not None:
            lines.append(self.dialect.sentence)
        return "\n".join(lines)

    @property
    def _unchanged(self) -> str:
        if self.dialect is not None:
            return "its motion is unchanged"
        in_other_words = self.simulated is not None and self.simulated.original.foreign is not None
        return "its motion is unchanged, written as a FANUC program" if in_other_words else "the program is unchanged"

    def _headline(self) -> str:
        verdict = self.recommendation + ("" if self.is_written_as_output else ", OUT OF TOLERANCE")
        if not self.cuts:
            return f"{verdict}: there is nothing to shape; {self._unchanged}"
        vibration = self.residual_vibration_um
        axis = max("xyz", key=lambda each: vibration.original[each])
        target = getattr(self.contour_error_um, self.limits.contour_target)
        if self.nothing_shaped:
            over_budget = self.budget is not None and self.budget.left_unchanged
            why = "nothing fits the budget" if over_budget else self._why_unchanged()
            return (
                f"{verdict}: {why}; residual vibration {axis.upper()} {vibration.original[axis]:.1f} µm, contour "
                f"{target.original.max:.1f} µm; {self._unchanged}"
            )
        worst_stay = target.original.max - target.emitted.max < _MIN_SHOWN_UM and (
            vibration.original[axis] - vibration.emitted[axis] < _MIN_SHOWN_UM
        )
        best = max(self.cuts, key=lambda cut: cut.gain_um if cut.is_shaped else -1.0)
        beside = ""
        if worst_stay and best.is_shaped:
            beside = "; the worst cuts are left unchanged, lines {} to {} are better by ".format(*best.lines)
            beside += f"{best.gain_um:.1f} µm"
        share, shaped = "", len(self.regions)
        if shaped < len(self.cuts):
            share = f" ({shaped} of {len(self.cuts)} cuts shaped, the others unchanged)"
        shown = f"residual vibration {axis.upper()} {vibration.original[axis]:.1f} → {vibration.emitted[axis]:.1f} µm, "
        if shown.count(" 0.0 ") == 2:
            shown = ""  # the gain is in the contour
        return (
            f"{verdict}: {shown}contour {target.original.max:.1f} → {target.emitted.max:.1f} µm, "
            f"time {change_percent(self.cycle_time_s.original, self.cycle_time_s.emitted)}{share}{beside}"
        )

    def _why_unchanged(self) -> str:
        best = max(self.cuts, key=lambda cut: cut.gain_um)
        if self.within_tolerance and best.gain_um >= self.least_gain_um:
            return self.reason
        if best.gain_um < self.least_gain_um:
            return f"shaping would gain {best.gain_um:.1f} µm at most (required: {self.least_gain_um:g})"
        return "lines {} to {}: {}".format(*best.lines, best.reason)

    def _left_out(self) -> Iterator[str]:
        """A cut beyond its limits, and its remedy: the first one left unchanged, else the first shaped one."""
        out = sorted((cut for cut in self.cuts if cut.misses), key=lambda cut: cut.is_shaped)
        for cut in out[:1]:
            how = f"left unchanged ({cut.reason})" if not cut.is_shaped else self._cost_of(cut)
            remedy = f": {cut.remedy}" if cut.remedy else ""
            more = f" (and {len(out) - 1} further cuts out of their limits)" if len(out) > 1 else ""
            yield "lines {} to {}: ".format(*cut.lines) + f"{cut.misses[0]}; {how}{remedy}{more}"

    def _cost_of(self, cut: CutOutcome) -> str:
        if cut.tolerance_um > self.limits.contour_um:
            asked = self.tolerance_curve.points[0] if self.tolerance_curve is not None else None
            cost = f", {asked.tolerance_um:.3g} µm would cost {asked.time_increase_percent:+.3g} %" if asked else ""
            return f"shaped for {cut.tolerance_um:.3g} µm within the price{cost}"
        return "shaped as closely as the feed allows"

    @property
    def next_step(self) -> str:
        """The one thing to do next, in one sentence."""
        if self.nothing_shaped:
            # A program read in the wrong unit was simulated with lengths and speeds wrong by a factor of 25.4.
            if any("(power_on.units)" in warning for warning in self.warnings):
                return (
                    "check the unit, because the program has neither G20 nor G21: convert it with "
                    "--set power_on.units=G20 (inch) or G21 (mm), and write that code into it."
                )
            if self.recommendation.startswith("already"):
                return "run the original program; --shape-all shapes it nevertheless."
            return "run the original program: nothing in it was shaped."
        if self.recommendation.startswith("no benefit"):
            return "run the original program: the shaped one brings no benefit."
        if self.proof is not None and self.proof.refused:
            return f"do not run it, and report this defect of shapegcode with the program: {self.reason}."
        if not self.is_written_as_output:
            stated = any("; feasible: " in warning for warning in self.warnings)
            remedy = "a warning says which limit is feasible" if stated else "lower the feed there, and convert again"
            return f"do not run it ({self.reason}): {remedy}."
        if not self.within_tolerance:
            return (
                "decide whether the cuts that remain out of tolerance matter for this part (see the table of cuts); "
                "then run the emitted program above the workpiece, without a tool."
            )
        if self.warnings:
            return "resolve the warnings, then run the emitted program above the workpiece, without a tool."
        return "run the emitted program above the workpiece, without a tool, at 100 % feed override."

    def misses(self) -> Iterator[str]:
        """Yield every tolerance that a cut misses, with the lines of the original program."""
        for cut in self.all_cuts:
            for miss in cut.misses:
                yield "lines {} to {}: {}".format(*cut.lines, miss)

    def tables(self, *, every_cut: bool = False) -> list[Table]:
        """Tables: before and after, cuts, tolerance against time, conditions, sensitivity, control, restart points.

        Args:
            every_cut: list all cuts; else those that miss a limit or gain most.

        Returns:
            The tables.
        """
        cuts = [cut_table(self.cuts, every=every_cut)] if len(self.cuts) > 1 else []
        curve = [curve_table(self.tolerance_curve)] if self.tolerance_curve is not None else []
        if self.nothing_shaped:
            return [*cuts, *curve] if any(cut.misses for cut in self.cuts) else cuts
        cases = [case_table(self.cases, self.worst_case)] if self.cases else []
        unverified = self.parameter_sensitivity
        rests = [sensitivity_table(unverified, self.unverified_parameters_tested)] if unverified else []
        points = [restart_table(self.restart_points)] if self.restart_points else []
        before_after = before_after_table(self.before_after())
        return [before_after, *cuts, *curve, *cases, *rests, control_table(self.at_the_control), *points]

    def before_after(self) -> list[list[BeforeAfter]]:
        """Every figure of the original and the emitted program, in groups."""
        pairs = (("cycle time", self.cycle_time_s), ("cutting time", self.cutting_time_s))
        times = [BeforeAfter(name, "s", pair.original, pair.emitted, 3) for name, pair in pairs]
        return [times, *self._vibrations(), *self._contours(), *self._orbits_and_feeds(), self._sizes()]

    def _vibrations(self) -> Iterator[list[BeforeAfter]]:
        for name, both in (
            ("residual vibration", self.residual_vibration_um),
            ("peak vibration", self.peak_vibration_um),
        ):
            limits = {axis: self.residual_limit_um(axis) for axis in "xyz" if name.startswith("residual")}
            yield [
                BeforeAfter(
                    f"{name} {axis.upper()}", "µm", both.original[axis], both.emitted[axis], limit=limits.get(axis)
                )
                for axis in "xyz"
                if both.original[axis] or both.emitted[axis]
            ]
        between = self.rapid_vibration_um
        yield [
            BeforeAfter(f"vibration after rapids {axis.upper()}", "µm", between.original[axis], between.emitted[axis])
            for axis in "xyz"
            if between.original[axis] >= _MIN_SHOWN_UM or between.emitted[axis] >= _MIN_SHOWN_UM
        ]

    def residual_limit_um(self, axis: str) -> float | None:
        """Limit of residual vibration of an axis, µm, in the cut whose emitted residual vibration along it is largest.

        Args:
            axis: "x", "y" or "z".

        Returns:
            The limit; None: there is no cut.
        """
        worst = max(self.all_cuts, key=lambda each: each.residual_vibration_um.emitted[axis], default=None)
        return None if worst is None else worst.residual_limit_um[axis]

    def _contours(self) -> Iterator[list[BeforeAfter]]:
        for track, name in CONTOURS.items():
            both: Pair[ContourError] = getattr(self.contour_error_um, track)
            rows = []
            for statistic, suffix in _DEVIATIONS.items():
                original, emitted = getattr(both.original, statistic), getattr(both.emitted, statistic)
                if original is not None and emitted is not None:
                    is_judged = (track, statistic) == (self.limits.contour_target, "max")
                    limit = self.limits.contour_um if is_judged else None
                    rows.append(BeforeAfter(f"{name}, {suffix}", "µm", original, emitted, limit=limit))
            yield rows

    def _orbits_and_feeds(self) -> Iterator[list[BeforeAfter]]:
        if errors := self.orbit_error_percent:
            name = "orbit error of the command" + (f", largest of {len(errors)} arcs" if len(errors) > 1 else "")
            yield [BeforeAfter(name, "%", None, max(errors, key=abs), 4)]
        if self.feed_excess is not None:
            above, limit = max(0.0, self.feed_excess.ratio - 1.0) * 100.0, self.limits.feed_excess_ratio * 100.0
            yield [BeforeAfter("speed above the programmed feed", "%", None, above, limit=limit)]

    def _sizes(self) -> list[BeforeAfter]:
        rows = [
            BeforeAfter("blocks (original: all, emitted: shaped)", "", self.blocks.read, self.blocks.emitted, 0),
            BeforeAfter("size of the program", "bytes", self.bytes_read, self.bytes_emitted, 0),
            BeforeAfter("block period", "ms", None, self.block_period_s * 1e3, 3),
        ]
        if self.budget is not None:
            rows.append(BeforeAfter("cuts left unchanged for the budget", "", None, len(self.budget.left_unchanged), 0))
        rows.append(BeforeAfter("duration of the shaper", "ms", None, self.shaper.duration_s * 1e3, 3))
        if self.shaper.per_axis_duration_s:
            shorter_ms = self.shaper.per_axis_duration_s * 1e3
            rows.append(BeforeAfter("duration, one shaper per axis (--per-axis, not used)", "ms", None, shorter_ms, 3))
        return rows

    def plots(self) -> Mapping[str, Plot]:
        """`path`, `feed` and `vibration` of one cut, before and after; `tolerance` against time.

        Of the shaped cuts, it is the one that vibrates most in the original.
        """
        return self._drawn_beside()

    @property
    def light(self) -> tuple[Light, str]:
        """Colour of the traffic light on its page, and the reason."""
        found: tuple[Light, str] = self._beside("page").light_of(self)
        return found

    def _completed(self, scene: Scene) -> Scene:
        """The motion with the final text of the emitted program, which contains the verdict."""
        *others, last = scene.variants
        # The FANUC program, to whose lines the motion refers, even if another dialect is written.
        with_verdict = replace(last, text=self.emitted.text.decode("utf-8", "replace"))
        return replace(scene, variants=(*others, with_verdict))

    def page_sections(self, provenance: Provenance | None = None) -> tuple[Section, ...]:
        """Sections of its page, from "Before and after" to the operator's run sheet.

        Args:
            provenance: provenance of the result; None: unknown.

        Returns:
            The sections.
        """
        return tuple(self._beside("page").sections_of(self, provenance))
